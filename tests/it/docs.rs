//! The documents against the program: codes, keys, examples, printed output, links and line lengths.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;
use terrace_core::machine::{self, Machine};
use terrace_input::job::{self, Job, Overrides};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn text_of(file: &str) -> String {
    std::fs::read_to_string(root().join(file)).unwrap_or_else(|e| panic!("{file}: {e}"))
}

/// The files below `folder` that end in `extension`, sorted.
fn files(folder: &Path, extension: &str) -> Vec<PathBuf> {
    let mut out = Vec::new();
    let mut open = vec![folder.to_owned()];
    while let Some(dir) = open.pop() {
        for entry in std::fs::read_dir(dir).expect("readable") {
            let path = entry.expect("readable").path();
            if path.is_dir() {
                open.push(path);
            } else if path.extension().is_some_and(|e| e == extension) {
                out.push(path);
            }
        }
    }
    out.sort();
    out
}

// --- Codes

/// The text literal that `rest` begins with, after blanks.
fn literal(rest: &str) -> Option<&str> {
    rest.trim_start().strip_prefix('"')?.split('"').next()
}

/// Code and kinds of every message that one source text can give; what passes its code on by a name
/// stands in `helpers`, as text before the code and kind.
fn codes_of(shown: &str, text: &str, out: &mut BTreeMap<String, BTreeSet<String>>) {
    // A file, the text that stands before its codes, and their kind.
    let helpers = [
        ("src/surface/format.rs", "refuse(", "input"),
        ("src/surface/threemf/", "fault(", "input"),
        ("src/machine/read.rs", "fault(", "input"),
        ("crates/verify/src/", "unusable(", "input"),
        ("src/texture/svg/tally.rs", "Warned", "warning"),
        ("src/texture/svg/tally.rs", "Refused", "input"),
        ("src/texture/svg/tally.rs", "Refused", "warning"),
        ("src/texture/svg/remarks.rs", "report(", "input"),
        ("src/texture/svg/remarks.rs", "report(", "warning"),
        ("src/texture/dxf/tally.rs", "Warned", "warning"),
        ("src/texture/dxf/tally.rs", "Refused", "input"),
        ("src/texture/dxf/tally.rs", "Refused", "warning"),
        ("src/texture/dxf/", "fault(", "input"),
        ("src/texture/hpgl/mod.rs", "=> (", "input"),
        ("src/texture/hpgl/mod.rs", "=> (", "warning"),
        ("src/texture/hpgl/mod.rs", "add(", "input"),
        ("src/texture/hpgl/mod.rs", "add(", "warning"),
        ("src/texture/artwork/marking.rs", "unmarkable(", "input"),
    ];
    let mut add = |code: &str, kind: &str| {
        out.entry(code.to_owned()).or_default().insert(kind.to_owned());
    };
    for kind in ["warning", "input", "limit", "bug"] {
        let call = format!("Diag::{kind}(");
        for (at, _) in text.match_indices(&call) {
            match literal(&text[at + call.len()..]) {
                Some(code) => add(code, kind),
                None => assert!(
                    helpers.iter().any(|h| shown.contains(h.0)),
                    "{shown} passes the code of a message by a name: tell this test how to find it"
                ),
            }
        }
    }
    for (file, before, kind) in helpers {
        for (at, _) in text.match_indices(before).filter(|_| shown.contains(file)) {
            // A word and a comma may stand between, as in a table.
            let rest = text[at + before.len()..].trim_start_matches(char::is_alphanumeric);
            if let Some(code) = literal(rest.strip_prefix(',').unwrap_or(rest)) {
                add(code, kind);
            }
        }
    }
}

/// Code and kinds of every message in the source, its tests left out.
fn codes_in_source() -> BTreeMap<String, BTreeSet<String>> {
    let mut out = BTreeMap::new();
    let folders = [root().join("src"), root().join("crates")];
    for path in folders.iter().flat_map(|folder| files(folder, "rs")) {
        let shown = path.display().to_string().replace('\\', "/");
        if shown.contains("/tests/") || shown.ends_with("/tests.rs") {
            continue;
        }
        let text = std::fs::read_to_string(&path).expect("readable");
        let code = text.split("#[cfg(test)]\nmod tests").next().unwrap_or_default();
        codes_of(&shown, code, &mut out);
    }
    out
}

#[test]
fn every_code_has_its_section_in_the_list_of_errors() {
    let text = text_of("docs/reference/errors.md");
    let mut listed = BTreeMap::new();
    for section in text.split("\n### ").skip(1) {
        let (code, rest) = section.split_once('\n').expect("a heading has a text");
        let kinds = rest.trim_start().strip_prefix('*').and_then(|r| r.split(".*").next());
        let kinds = kinds.unwrap_or_else(|| panic!("{code} names no kind"));
        let body = rest.split(".*").nth(1).unwrap_or_default();
        assert!(body.trim().len() > 20, "{code} has no text");
        let kinds: BTreeSet<String> = kinds.split(", ").map(str::to_owned).collect();
        assert!(listed.insert(code.trim().to_owned(), kinds).is_none(), "{code} is listed twice");
    }
    let source = codes_in_source();
    assert!(source.len() > 100 && source.contains_key("svg-text"), "codes are found: {}", source.len());
    for (code, kinds) in &source {
        let have = listed.get(code);
        assert_eq!(have, Some(kinds), "docs/reference/errors.md against the source (right): ### {code}");
    }
    for code in listed.keys() {
        assert!(source.contains_key(code), "docs/reference/errors.md lists {code}, which no source file gives");
    }
}

#[test]
fn scan_for_codes_finds_every_form() {
    let mut found = BTreeMap::new();
    codes_of("src/a.rs", "Diag::limit(\n    \"a-b\", x); Diag::bug(\"c\", y)", &mut found);
    codes_of(
        "src/texture/svg/tally.rs",
        "(Issue::Text, Refused, \"svg-t\", 1), (\n Issue::Dot,\n Warned,\n \"svg-d\",",
        &mut found,
    );
    let codes: Vec<&str> = found.keys().map(String::as_str).collect();
    assert_eq!(codes, ["a-b", "c", "svg-d", "svg-t"]);
}

// --- Examples

/// The schema that `at` refers to: through references, lists and choices to an object with keys.
fn object<'a>(schema: &'a Value, at: &'a Value) -> Option<&'a Value> {
    if at.get("properties").is_some() {
        return Some(at);
    }
    if let Some(name) = at["$ref"].as_str().and_then(|r| r.strip_prefix("#/$defs/")) {
        return object(schema, &schema["$defs"][name]);
    }
    let choices = at["anyOf"].as_array().into_iter().flatten();
    choices.chain(at.get("items")).find_map(|c| object(schema, c))
}

/// The code blocks of a document whose opening line is "```" and `kind`.
fn blocks<'a>(text: &'a str, kind: &str) -> Vec<&'a str> {
    let open = format!("\n```{kind}\n");
    text.split(&open).skip(1).map(|b| b.split("\n```").next().unwrap_or_default()).collect()
}

/// Writes a small made file where a job expects one.
fn make(path: &Path) {
    let bytes = match path.extension().and_then(|e| e.to_str()) {
        Some("stl") => job::sample_surface(),
        Some("svg") => br#"<svg xmlns="http://www.w3.org/2000/svg" width="10mm" height="10mm" viewBox="0 0 10 10">
            <path d="M1 1 C 3 9 7 9 9 1 Z" stroke="black"/></svg>"#
            .to_vec(),
        Some("xyz") => {
            (0..900).map(|i| format!("{} {} {}\n", i % 30, i / 30, f64::from(i % 30) / 50.0)).collect::<String>().into()
        }
        Some("png") => grey(60, 50),
        Some("toml") => terrace_core::machine::PROFILES[0].1.into(),
        other => panic!("no sample for {other:?}"),
    };
    std::fs::write(path, bytes).expect("written");
}

/// A slope of 16-bit samples.
fn grey(width: u32, height: u32) -> Vec<u8> {
    let row: Vec<u16> = (0..width).map(|x| 1 + 20 * x as u16).collect();
    crate::support::image::height_map(width as usize, &row.repeat(height as usize))
}

#[test]
fn whole_jobs_of_the_documents_compile() {
    let mut count = 0;
    for file in documents() {
        for block in blocks(&text_of(&file), "toml job") {
            let dir = tempfile::tempdir().expect("a folder");
            let job = Job::parse(&dir.path().join("job.toml"), block, &Overrides::default())
                .unwrap_or_else(|e| panic!("{file}: {e}\n{block}"));
            job.input_files().iter().for_each(|(_, file)| make(&job.relative(file)));
            let plan = terrace_plan::plan::plan(job, &|_, _| {}).unwrap_or_else(|e| panic!("{file}: {e}\n{block}"));
            assert!(plan.stepped().expect("a stepped job").summary.mark_mm > 0.0);
            count += 1;
        }
    }
    assert!(count >= 6, "whole jobs are found: {count}");
}

#[test]
fn whole_run_files_of_the_documents_load() {
    let mut count = 0;
    for file in documents() {
        for block in blocks(&text_of(&file), "toml run") {
            let dir = tempfile::tempdir().expect("a folder");
            let path = dir.path().join("run.toml");
            std::fs::write(&path, block).expect("written");
            terrace::run::settings::RunFile::read(&path).unwrap_or_else(|e| panic!("{file}: {e}\n{block}"));
            count += 1;
        }
    }
    assert!(count >= 4, "whole run files are found: {count}");
}

#[test]
fn whole_machines_of_the_documents_load() {
    let text = text_of("docs/reference/machine-file.md");
    let machines = blocks(&text, "toml machine");
    assert!(!machines.is_empty());
    for block in machines {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("machine.toml");
        std::fs::write(&path, block).expect("written");
        Machine::load(&path).unwrap_or_else(|e| panic!("{e}\n{block}"));
    }
}

#[test]
fn every_built_in_machine_is_counted_and_has_its_row() {
    let text = text_of("docs/reference/machine-file.md");
    let numbers = ["five", "six", "seven", "eight", "nine", "ten"];
    let count = numbers[machine::PROFILES.len() - 5];
    let section =
        text.split(&format!("\n## The {count} built-in profiles\n")).nth(1).expect("the section of this count");
    let rows = section.lines().take_while(|line| !line.starts_with("## ")).filter_map(|l| l.strip_prefix("| `"));
    let named: Vec<&str> = rows.filter_map(|l| l.split('`').next()).collect();
    let names: Vec<&str> = machine::PROFILES.iter().map(|(name, _)| *name).collect();
    assert_eq!(named, names);
}

/// Every key of an example exists.
fn keys_exist(schema: &Value, at: &Value, example: &toml::Table, shown: &str) {
    for (key, value) in example {
        let inner = property(schema, at, key);
        assert!(!inner.is_null(), "an example has the key {key}, which does not exist:\n{shown}");
        let list = value.as_array().cloned().unwrap_or_else(|| vec![value.clone()]);
        for table in list.iter().filter_map(toml::Value::as_table) {
            if inner["additionalProperties"].is_object() {
                // Its keys are names that the user chooses.
                continue;
            }
            let inner = object(schema, inner).unwrap_or_else(|| panic!("{key} is not a table:\n{shown}"));
            keys_exist(schema, inner, table, shown);
        }
    }
}

/// What a table has of a key; of a table whose keys depend on its source what the first source has that knows it.
fn property<'a>(schema: &'a Value, at: &'a Value, key: &str) -> &'a Value {
    if !at["properties"][key].is_null() {
        return &at["properties"][key];
    }
    let choices = ["anyOf", "oneOf"].into_iter().filter_map(|of| at[of].as_array()).flatten();
    let found = choices.map(|one| {
        let name = one["$ref"].as_str().and_then(|r| r.rsplit('/').next());
        let own = &one["properties"][key];
        if own.is_null() { name.map_or(own, |name| property(schema, &schema["$defs"][name], key)) } else { own }
    });
    found.into_iter().find(|value| !value.is_null()).unwrap_or(&Value::Null)
}

#[test]
fn parts_of_files_in_the_documents_have_keys_that_exist() {
    let how_to = documents().into_iter().filter(|file| file.starts_with("docs/how-to/"));
    let jobs = how_to.chain(["docs/reference/job-file.md".to_owned()]).map(|file| (file, job::json_schema()));
    let machines = [("docs/reference/machine-file.md".to_owned(), machine::json_schema(), "toml")];
    let of_how_to = documents().into_iter().filter(|file| file.starts_with("docs/how-to/"));
    let in_how_to = of_how_to.map(|file| (file, machine::json_schema(), "toml machine-keys"));
    let jobs = jobs.map(|(file, schema)| (file, schema, "toml"));
    for (file, schema, language) in jobs.chain(machines).chain(in_how_to) {
        let schema: Value = serde_json::from_str(&schema).expect("a schema is JSON");
        let text = text_of(&file);
        let parts = blocks(&text, language);
        assert!(!parts.is_empty() || file.contains("/how-to/"), "{file}");
        for part in parts {
            let example: toml::Table = part.parse().unwrap_or_else(|e| panic!("{file}: {e}\n{part}"));
            keys_exist(&schema, &schema, &example, part);
        }
    }
}

/// The documents: README.md, then the pages of the book in its order, by their paths from the root.
fn documents() -> Vec<String> {
    let pages = book().into_iter().map(|page| format!("docs/{page}"));
    std::iter::once("README.md".to_owned()).chain(pages).collect()
}

/// The pages of the book in the order of its table of contents.
fn book() -> Vec<String> {
    let text = text_of("docs/SUMMARY.md");
    let links = text.split("](").skip(1).filter_map(|rest| rest.split(')').next());
    links.map(str::to_owned).collect()
}

#[test]
fn every_page_is_in_the_table_of_contents() {
    let pages: BTreeSet<PathBuf> = files(&root().join("docs"), "md").into_iter().collect();
    let mut listed: BTreeSet<PathBuf> = book().iter().map(|page| root().join("docs").join(page)).collect();
    listed.insert(root().join("docs/SUMMARY.md"));
    assert_eq!(pages, listed);
}

/// What a script prints to stdout, run by sh in `dir` with the tested program first in PATH.
#[cfg(unix)]
fn printed(dir: &Path, script: &str, shown: &str) -> String {
    let program = Path::new(env!("CARGO_BIN_EXE_terrace")).parent().expect("a folder");
    let path = format!("{}:{}", program.display(), std::env::var("PATH").unwrap_or_default());
    let mut sh = Command::new("sh");
    sh.args(["-e", "-c", script]).current_dir(dir).env("PATH", &path);
    sh.env("TERRACE_PYTHON", root().join(".venv/bin/python"));
    // Journals of runs are noted there.
    sh.env("XDG_STATE_HOME", dir.join("state"));
    let done = sh.output().expect("sh starts");
    let said = String::from_utf8_lossy(&done.stderr);
    assert!(done.status.success(), "{shown}: {}\n{said}\n{script}", done.status);
    String::from_utf8(done.stdout).expect("output is UTF-8")
}

/// Every `<!-- output: COMMAND -->` of a document: the command, and where the text of the fenced block
/// after it stands.
fn outputs(text: &str) -> Vec<(&str, Range<usize>)> {
    let open = "<!-- output: ";
    let found = text.match_indices(open).map(|(at, _)| {
        let line = text[at..].lines().next().expect("a line");
        let command = line[open.len()..].strip_suffix(" -->").unwrap_or_else(|| panic!("not closed: {line}"));
        let body = &text[at + line.len()..];
        let fence = ["\n```text\n", "\n```toml\n"].into_iter().find(|fence| body.starts_with(fence));
        let from = at + line.len() + fence.unwrap_or_else(|| panic!("no block follows {line}")).len();
        // An empty block has its closing fence at once.
        let close = text[from - 1..].find("\n```\n").unwrap_or_else(|| panic!("the block of {line} is open"));
        (command, from..from + close)
    });
    found.collect()
}

/// Every `<!-- picture: FILE -->` of a document: the file, and the address of the picture that follows it.
fn pictures(text: &str) -> Vec<(&str, &str)> {
    let found = text.split("<!-- picture: ").skip(1).map(|rest| {
        let (made, shown) = rest.split_once(" -->\n![").expect("a picture follows");
        (made, shown.split("](").nth(1).and_then(|rest| rest.split(')').next()).expect("its address"))
    });
    found.collect()
}

fn is_written() -> bool {
    std::env::var_os("DOCS").is_some_and(|v| v == "write")
}

/// The commands of every document run, those of the tutorial's pages in one folder; each block that is marked as output
/// holds what its command prints, and each picture is the one that was made. `DOCS=write` takes over what is printed
/// and made.
#[test]
#[ignore = "slow: make test-all"]
#[cfg(unix)]
fn commands_of_the_documents_run_and_print_what_is_shown() {
    let tutorial = tempfile::tempdir().expect("a folder");
    let (mut commands, mut shown, mut drawn) = (0, 0, 0);
    for file in documents() {
        let mut text = text_of(&file);
        // The blocks of a file follow each other in one folder, and outputs are those after all of them.
        let script = blocks(&text, "sh run").join("\n");
        let own = tempfile::tempdir().expect("a folder");
        let dir = if file.starts_with("docs/tutorial/") { tutorial.path() } else { own.path() };
        printed(dir, &script, &file);
        commands += script.matches("terrace ").count();
        for (made, picture) in pictures(&text) {
            let made = std::fs::read(dir.join(made)).unwrap_or_else(|e| panic!("{file}: {made}: {e}"));
            let kept = root().join(&file).parent().expect("a folder").join(picture);
            if is_written() {
                std::fs::write(kept, made).expect("written");
            } else {
                assert!(std::fs::read(kept).expect("a picture") == made, "{file}: {picture}: DOCS=write takes it over");
            }
            drawn += 1;
        }
        let found: Vec<(String, Range<usize>)> = outputs(&text).iter().map(|o| (o.0.to_owned(), o.1.clone())).collect();
        for (command, range) in found.into_iter().rev() {
            // Absolute paths are those of a reader who is at home.
            let here = dir.canonicalize().expect("a folder");
            let out = printed(dir, &command, &file).replace(&here.display().to_string(), "/home/me");
            if is_written() {
                text.replace_range(range, &out);
                std::fs::write(root().join(&file), &text).expect("written");
            } else {
                assert_eq!(&text[range], out, "{file}: what {command:?} prints (right); DOCS=write takes it over");
            }
            shown += 1;
        }
    }
    assert!(commands >= 30 && shown >= 15 && drawn >= 4, "{commands} commands, {shown} outputs, {drawn} pictures");
}

#[test]
#[cfg(unix)]
fn picture_and_numbers_of_the_readme_are_those_of_its_jobs() {
    let dir = tempfile::tempdir().expect("a folder");
    let script = "terrace init try >&2 && terrace compile --json try/job.toml";
    let summary: Value = serde_json::from_str(&printed(dir.path(), script, "README.md")).expect("JSON");
    let made = std::fs::read_to_string(dir.path().join("try/job.job/layout.svg")).expect("a picture");
    let shown = root().join("docs/start/layout.svg");
    if std::env::var_os("DOCS").is_some_and(|v| v == "write") {
        std::fs::write(shown, made).expect("written");
    } else {
        assert!(std::fs::read_to_string(shown).expect("a picture") == made, "DOCS=write takes it over");
    }
    let demo = crate::support::summary_of(&root().join("fixtures/hood.toml"));
    let text = text_of("README.md");
    let thousands = |n: u64| format!("{},{:03}", n / 1000, n % 1000);
    for said in [
        format!("![{} blocks on a curved panel", summary["blocks"]),
        format!("a field of 40 x 40 mm, {} stops.", summary["stops"]),
        format!("{} stops and", thousands(demo["stops"].as_u64().expect("a number"))),
        format!("stops and {:.0} m of marks", demo["mark_mm"].as_f64().expect("a number") / 1000.0),
    ] {
        assert!(text.contains(&said), "README.md says {said:?}");
    }
}

// --- Lines

/// Lines that are too long to read in a diff, and table cells that hold a paragraph.
fn too_long(text: &str) -> Vec<String> {
    let (mut out, mut fenced) = (Vec::new(), false);
    for (i, line) in text.lines().enumerate() {
        if line.trim_start().starts_with("```") {
            fenced = !fenced;
        } else if !fenced && line.starts_with('|') {
            let cells = line.split('|').map(|c| c.trim().chars().count());
            out.extend(cells.filter(|&n| n > 200).map(|n| format!("{}: a cell of {n} characters", i + 1)));
        } else if !fenced && line.chars().count() > 100 && !line.contains("](") {
            out.push(format!("{}: {} columns", i + 1, line.chars().count()));
        }
    }
    out
}

#[test]
fn documents_keep_to_100_columns_and_short_table_cells() {
    let others = ["CHANGELOG.md", "tests/README.md", "src/lib.md"].map(str::to_owned);
    for file in documents().into_iter().chain(others) {
        let found = too_long(&text_of(&file));
        assert!(found.is_empty(), "{file}:{}", found.join("\n"));
    }
}

#[test]
fn long_lines_and_cells_are_found_outside_code_tables_and_links() {
    let (long, cell) = ("x".repeat(101), "y".repeat(201));
    let text = format!("{long}\n```\n{long}\n```\n[a]({long})\n| a | {long} |\n| {cell} |\n");
    assert_eq!(too_long(&text), ["1: 101 columns", "7: a cell of 201 characters"]);
}

// --- Links

#[test]
fn links_between_the_documents_lead_somewhere() {
    let mut documents = files(&root().join("docs"), "md");
    documents.extend(["README.md", "CHANGELOG.md"].map(|f| root().join(f)));
    let mut count = 0;
    for document in documents {
        let text = std::fs::read_to_string(&document).expect("readable");
        for target in text.split("](").skip(1).filter_map(|t| t.split(')').next()) {
            let file = target.split('#').next().unwrap_or_default();
            if !target.contains("://") && !file.is_empty() {
                let path = document.parent().expect("a folder").join(file);
                assert!(path.exists(), "{} links to {target}, which is not there", document.display());
                count += 1;
            }
        }
    }
    assert!(count > 10, "links are found: {count}");
}

#[test]
fn packages_are_named_with_this_version() {
    let text = text_of("docs/start/install.md");
    for name in ["terrace_", "terrace-", "terrace_laser-"] {
        let name = format!("`{name}{}", env!("CARGO_PKG_VERSION"));
        assert!(text.contains(&name), "install.md does not name {name}...");
    }
}

// --- Index of the tests

#[test]
fn index_of_tests_names_every_module_and_only_existing_files() {
    let index = text_of("tests/README.md");
    let named: BTreeSet<&str> = index.split('`').skip(1).step_by(2).collect();
    let modules = text_of("tests/it/main.rs");
    for module in modules.lines().filter_map(|l| l.strip_prefix("mod ")?.strip_suffix(';')) {
        assert!(module == "support" || named.contains(module), "tests/README.md does not name {module}");
    }
    for path in named.iter().filter(|n| n.starts_with("src/") || n.starts_with("crates/")) {
        assert!(root().join(path).exists(), "tests/README.md names {path}");
    }
}
