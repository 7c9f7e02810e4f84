//! One description of each key: schema, sample, tables of the documents.
//!
//! Keys are described once, at the fields that read them: `crates/input/src/job/file.rs` and
//! `crates/input/src/job/texture/keys.rs` for the job file, `crates/core/src/machine` for the machine file,
//! `src/run/settings.rs` for the run file. The schemas have that from there, and of the schemas are made the sample
//! that `terrace init` writes (`crates/input/src/job/sample.toml`) and the tables of the documents (see `tables`).
//! `KEYS=write` writes them again.

mod schema;
mod tables;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use schema::{Key, Schema, Table};
use terrace_input::job::{Job, Overrides, SAMPLE_JOB, json_schema};

/// Columns of a comment at most.
const WIDTH: usize = 100;

/// What the sample says first.
const HEAD: &str = "#:schema ./job.schema.json
# A terrace job with every key. Every length, angle, speed and power carries its unit.
# `terrace compile job.toml` writes the job folder job.job; open its layout.svg before you mark.
# Paths are relative to this file. Keys that are commented out have their default, or belong to another kind
# of input; docs/reference/job-file.md says more of each.
";

/// A second texture, after the keys of the first.
const SECOND: &str = "
# A drawing, in addition to the hatch or instead of it:
# [[texture]]
# file = \"sample.svg\"             # a leaf on a page of 10 x 10 mm
# area = \"part\"
# tile = true
# pen = \"fill\"
";

/// The keys of the sample that are not commented out, with their values.
const ACTIVE: [(&str, &str); 24] = [
    ("surface.file", "\"sample.stl\""),
    ("surface.unit", "\"mm\""),
    ("placement.turn", "\"0 deg\""),
    ("texture.pattern", "\"hatch\""),
    ("texture.area", "\"part\""),
    ("texture.pitch", "\"0.5 mm\""),
    ("texture.direction", "\"0 deg\""),
    ("texture.pen", "\"fill\""),
    ("focus.pdof", "\"0.07 mm\""),
    ("focus.level", "\"mid\""),
    ("focus.rule", "\"range\""),
    ("partition.method", "\"auto\""),
    ("order.stops", "\"time\""),
    ("order.strokes", "\"shortest\""),
    ("limits.warn_incidence", "\"10 deg\""),
    ("limits.max_incidence", "\"60 deg\""),
    ("limits.steep", "\"skip\""),
    ("machine.profile", "\"xyz-galvo-40\""),
    ("pen.name", "\"fill\""),
    ("pen.speed", "\"1000 mm/s\""),
    ("pen.power", "\"60 %\""),
    ("pen.frequency", "\"60 kHz\""),
    ("pen.passes", "1"),
    ("emit.formats", "[\"dxf\", \"linuxcnc\", \"ovf\"]"),
];

/// The tables of a job file.
fn job_file() -> Table {
    Schema::parse(&json_schema()).file()
}

/// Whether a table is not commented out.
fn is_active(table: &Table) -> bool {
    table.keys.iter().any(|key| active(&key.path).is_some()) || table.path.is_empty()
}

/// A table with its keys and the tables below it.
fn write(table: &Table, out: &mut String) {
    if !table.path.is_empty() {
        let [open, close] = if table.is_list { ["[[", "]]"] } else { ["[", "]"] };
        let comment = if is_active(table) { "" } else { "# " };
        *out += &format!("\n\n{}{comment}{open}{}{close}\n", wrapped(&table.about), table.path);
    }
    for same in table.keys.chunk_by(|a, b| a.name == b.name) {
        *out += &with_comment(same);
    }
    for inner in &table.tables {
        write(inner, out);
        *out += if inner.path == "texture" { SECOND } else { "" };
    }
}

/// A key below its description, or those that sources of textures have of it.
fn with_comment(same: &[Key]) -> String {
    let key = &same[0];
    let own = active(&key.path);
    let mut choices = [own.map(str::to_owned), key.example.clone(), key.default_value.clone()].into_iter().flatten();
    let more = || key.words.last().or(key.example_of_type.as_ref()).cloned();
    let shown = choices.next().or_else(more).unwrap_or_else(|| panic!("{} needs an example", key.path));
    let mut text = same.iter().map(|key| described(key, &shown)).collect::<Vec<_>>().join(" ");
    if key.words.len() > 1 {
        text += &format!(" One of {}.", key.words.join(", "));
    }
    let comment = if own.is_some() { "" } else { "# " };
    format!("\n{}{comment}{} = {shown}\n", wrapped(&text), key.name)
}

/// What a key is for, and what holds without it.
fn described(key: &Key, shown: &str) -> String {
    let text = plain(&key.about);
    // Which pattern is one is said by the pattern itself.
    if key.sources.is_empty() || key.name == "pattern" {
        return text + &without_it(key, shown);
    }
    // What a source needs is missed when it is not there.
    let without = if key.default == "required" { String::new() } else { without_it(key, shown) };
    format!("{}: {}{without}", begun(&key.sources.join(", "), true), begun(&text, false))
}

/// A text that begins with a capital or a small letter.
fn begun(text: &str, is_capital: bool) -> String {
    let (first, rest) = text.split_at(text.chars().next().map_or(0, char::len_utf8));
    let first = if is_capital { first.to_uppercase() } else { first.to_lowercase() };
    first + rest
}

/// What holds without a key that shows a value, as a sentence after a blank; nothing where that says itself.
fn without_it(key: &Key, shown: &str) -> String {
    let default = plain(&key.default);
    match default.split(' ').next() {
        Some("required") => format!(" R{}.", &default[1..]),
        Some("see") => format!(" S{}.", &default[1..]),
        Some("this" | "this,") => format!(" Give {default}."),
        _ if default == shown || default == "none" => String::new(),
        _ => format!(" Default: {default}."),
    }
}

/// A description without what belongs to the document that it is a row of: links, and words that point down the page.
fn plain(text: &str) -> String {
    let mut text = text.to_owned();
    while let Some((at, end)) = text.find("](").and_then(|at| Some((at, at + text[at..].find(')')?))) {
        let open = text[..at].rfind('[').expect("the text of a link");
        text = format!("{}{}{}", &text[..open], &text[open + 1..at], &text[end + 1..]);
    }
    text.replace("; see below", "").replace(", see below", "")
}

fn active(path: &str) -> Option<&'static str> {
    ACTIVE.iter().find(|(key, _)| *key == path).map(|(_, value)| *value)
}

/// A text as lines of a comment.
fn wrapped(text: &str) -> String {
    let mut out = String::new();
    let mut line = String::from("#");
    for word in text.split(' ') {
        if line.chars().count() + 1 + word.chars().count() > WIDTH {
            out += &format!("{line}\n");
            line = String::from("#");
        }
        line += &format!(" {word}");
    }
    out + &format!("{line}\n")
}

fn sample() -> String {
    let mut out = HEAD.to_owned();
    write(&job_file(), &mut out);
    out
}

#[test]
fn the_sample_is_made_of_the_schema() {
    let made = sample();
    if std::env::var("KEYS").is_ok_and(|v| v == "write") {
        std::fs::write(file(), &made).expect("a writable repository");
        return;
    }
    assert!(made == SAMPLE_JOB, "crates/input/src/job/sample.toml is not what `KEYS=write` writes");
}

fn file() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("crates/input/src/job/sample.toml")
}

/// The keys of the sample, commented out or not, and the line of each.
fn keys_of_the_sample() -> Vec<(String, usize)> {
    let (mut table, mut out) = (String::new(), Vec::new());
    let before_second = SAMPLE_JOB.split(SECOND).next().expect("a text");
    let after = SAMPLE_JOB.split(SECOND).nth(1).unwrap_or_default();
    let skipped = SECOND.lines().count();
    let count = before_second.lines().count();
    for (i, line) in before_second.lines().chain(after.lines()).enumerate() {
        let bare = line.strip_prefix("# ").unwrap_or(line);
        if let Some(name) = bare.strip_prefix('[').and_then(|rest| rest.split(']').next()) {
            table = name.trim_start_matches('[').to_owned();
        } else if let Some((key, _)) = bare.split_once(" = ").filter(|(key, _)| is_key(key)) {
            let path = if table.is_empty() { key.to_owned() } else { format!("{table}.{key}") };
            out.push((path, if i < count { i } else { i + skipped }));
        }
    }
    out
}

fn is_key(text: &str) -> bool {
    !text.is_empty() && text.chars().all(|c| c.is_ascii_lowercase() || c == '_')
}

#[test]
fn the_sample_has_every_key_of_the_schema_once() {
    let file = job_file();
    let tables = file.all();
    let wanted: Vec<&String> = tables.iter().flat_map(|table| table.keys.iter().map(|key| &key.path)).collect();
    let found: Vec<String> = keys_of_the_sample().into_iter().map(|(path, _)| path).collect();
    assert_eq!(found.len(), found.iter().collect::<BTreeSet<_>>().len(), "each once");
    assert_eq!(found.iter().collect::<BTreeSet<_>>(), wanted.iter().copied().collect::<BTreeSet<_>>());
    assert!(wanted.len() > 110, "{}", wanted.len());
}

#[test]
fn every_value_of_the_sample_is_one_that_its_key_can_have() {
    let keys = keys_of_the_sample();
    let bare = |line: &str| line.strip_prefix("# ").map(str::to_owned);
    for (path, line) in &keys {
        let mut lines: Vec<String> = SAMPLE_JOB.lines().map(str::to_owned).collect();
        let Some(key) = bare(&lines[*line]) else { continue };
        lines[*line] = key;
        // A table that is commented out comes with all its keys: some need others.
        let head = (0..*line).rev().find(|&i| lines[i].trim_start_matches("# ").starts_with('['));
        if let Some((head, text)) = head.and_then(|i| Some((i, bare(&lines[i])?))) {
            lines[head] = text;
            let table = path.rsplit_once('.').expect("a key of a table").0;
            for (_, other) in keys.iter().filter(|(other, _)| other.rsplit_once('.').is_some_and(|(t, _)| t == table)) {
                lines[*other] = bare(&lines[*other]).unwrap_or_else(|| lines[*other].clone());
            }
        }
        let parsed = Job::parse(Path::new("job.toml"), &lines.join("\n"), &Overrides::default());
        let codes: Vec<&str> = parsed.err().map_or_else(Vec::new, |e| e.diags().iter().map(|d| d.code).collect());
        // Keys that exclude others are refused for that, which is said of keys that could be read.
        assert!(!codes.contains(&"toml"), "{path}: {codes:?}\n{}", lines[*line]);
    }
}
