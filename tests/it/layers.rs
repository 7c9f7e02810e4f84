//! The layers of the library, and the modules that own each dependency, read from the `crate::` paths.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("src")
}

/// Every source file with its module (`emit` for src/emit/dxf.rs and src/emit.rs) and its text without
/// tests and comments.
fn sources() -> Vec<(PathBuf, String, String)> {
    let root = root();
    let mut out = Vec::new();
    let mut open = vec![root.clone()];
    while let Some(dir) = open.pop() {
        for entry in std::fs::read_dir(dir).expect("src is readable") {
            let path = entry.expect("src is readable").path();
            if path.is_dir() {
                open.push(path);
            } else if path.extension().is_some_and(|e| e == "rs") {
                let inner = path.strip_prefix(&root).expect("below src");
                let test_only = inner
                    .iter()
                    .any(|c| ["tests", "tests.rs", "sample.rs", "mutants.rs", "brute.rs"].iter().any(|t| c == *t))
                    && !inner.starts_with("job");
                if test_only {
                    continue;
                }
                let module = inner.iter().next().expect("a name").to_string_lossy().trim_end_matches(".rs").to_owned();
                let text = std::fs::read_to_string(&path).expect("readable");
                let text = text.split("#[cfg(test)]\nmod tests").next().unwrap_or_default();
                let code: String =
                    text.lines().filter(|l| !l.trim_start().starts_with("//")).collect::<Vec<_>>().join("\n");
                out.push((path, module, code));
            }
        }
    }
    out.sort();
    out
}

/// The paths that a text names from `crate::` or `super::` on, word by word; of a list in braces each.
fn paths(text: &str) -> Vec<Vec<&str>> {
    let mut out = Vec::new();
    for root in ["crate::", "super::"] {
        for (at, _) in text.match_indices(root) {
            // A longer path or name is taken from its begin.
            if !text[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_' || c == ':') {
                leaves(&text[at..], &[], &mut out);
            }
        }
    }
    out
}

/// Appends the paths with which a text begins, each after the words `before` it.
fn leaves<'a>(text: &'a str, before: &[&'a str], out: &mut Vec<Vec<&'a str>>) {
    let text = text.trim_start();
    if let Some(list) = text.strip_prefix('{') {
        return items(list).into_iter().for_each(|item| leaves(item, before, out));
    }
    let end = text.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(text.len());
    let path = [before, &[&text[..end]]].concat();
    match text[end..].strip_prefix("::") {
        Some(rest) => leaves(rest, &path, out),
        None => out.push(path),
    }
}

/// What stands between the commas of a list, up to the brace that closes it.
fn items(list: &str) -> Vec<&str> {
    let (mut out, mut depth, mut start) = (Vec::new(), 0, 0);
    for (i, c) in list.char_indices() {
        match c {
            '{' => depth += 1,
            '}' if depth > 0 => depth -= 1,
            ',' | '}' if depth == 0 => {
                out.push(&list[start..i]);
                start = i + 1;
                if c == '}' {
                    break;
                }
            }
            _ => {}
        }
    }
    out
}

/// The modules that a text names as `crate::module` or in `use crate::{module, other::…}`.
fn named(text: &str) -> BTreeSet<String> {
    let paths = paths(text).into_iter().filter(|path| path[0] == "crate");
    let words = paths.filter_map(|path| path.get(1).map(|word| (*word).to_owned()));
    words.filter(|word| word.starts_with(char::is_lowercase)).collect()
}

/// The modules of the library, lowest first: each may name those above it in this list and none below.
const ORDER: [&str; 36] = [
    "parallel",
    "progress",
    "geom",
    "units",
    "diag",
    "python",
    "format",
    "nurbs",
    "machine",
    "clearance",
    "motion",
    "program",
    "surface",
    "texture",
    "job",
    "projection",
    "partition",
    "split",
    "order",
    "check",
    "block_map",
    "on_the_fly",
    "emit",
    "budget",
    "manifest",
    "plan",
    "scene",
    "report",
    "view",
    "job_folder",
    "compare",
    "resume",
    "run",
    "sweep",
    "batch",
    "cli",
];

/// What the verifier may name: readers of input files and types. Nothing that planned or wrote what it verifies.
const VERIFIER: [&str; 11] =
    ["progress", "parallel", "geom", "units", "diag", "format", "machine", "program", "surface", "texture", "job"];

#[test]
fn what_the_verifier_may_name_stands_above_all_that_plans_and_writes() {
    let place = |module: &str| ORDER.iter().position(|m| *m == module);
    assert!(VERIFIER.iter().all(|module| place(module) < place("projection")), "nor does it reach it through them");
}

#[test]
fn modules_name_only_modules_above_them() {
    let place = |module: &str| ORDER.iter().position(|m| *m == module);
    let mut wrong = Vec::new();
    for (path, module, code) in sources() {
        for other in named(&code).into_iter().filter(|other| *other != module) {
            let may = match module.as_str() {
                "lib" | "main" | "cli" => true,
                "verify" => VERIFIER.contains(&other.as_str()),
                // Nothing is marked that does not verify.
                "run" if other == "verify" => true,
                _ => place(&other) < place(&module) && place(&other).is_some(),
            };
            if !may {
                wrong.push(format!("{}: {module} names {other}", path.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn the_verifier_uses_nothing_that_the_planner_uses_of_the_same_modules() {
    for (path, module, code) in sources() {
        if module == "verify" {
            for hidden in ["surface::walk", "Welder", "Tracer", "Surface::load", "from_facets", "program::text"] {
                assert!(!code.contains(hidden), "{} uses {hidden}", path.display());
            }
        }
    }
}

#[test]
fn each_dependency_is_used_in_its_own_modules_only() {
    // Crate, and the modules or files that may name it.
    let owners: [(&str, &[&str]); 32] = [
        ("rayon", &["src/parallel", "src/batch", "src/cli", "src/compare/mod.rs"]),
        ("nalgebra", &["src/geom"]),
        ("spade", &["src/surface/points"]),
        ("parry2d", &["src/clearance"]),
        ("geo", &["src/report", "src/surface/polygon"]),
        // The texture module has a module of this name.
        ("svg", &["src/report", "src/texture/mod.rs", "src/texture/source.rs"]),
        ("clap", &["src/cli"]),
        ("ctrlc", &["src/cli"]),
        // On Linux alone.
        ("rustix", &["src/job_folder"]),
        ("indicatif", &["src/cli"]),
        (
            "roxmltree",
            &[
                "src/texture/svg",
                "src/verify/read/labels.rs",
                "src/verify/read/lightburn.rs",
                "src/verify/read/picture.rs",
                "src/verify/read/unread.rs",
            ],
        ),
        // It alone names cssparser, cssparser-color, selectors and color, on which nothing in src depends.
        ("svg_style", &["src/texture/svg"]),
        ("svgtypes", &["src/texture/svg", "src/texture/artwork/marking.rs"]),
        ("kurbo", &["src/texture/svg"]),
        ("i_overlay", &["src/texture/artwork/area.rs"]),
        ("rstar", &["src/texture/artwork/marks.rs", "src/verify/read/outline.rs", "src/verify/read/picture.rs"]),
        ("usvg", &["src/verify/read/picture.rs"]),
        ("resvg", &["src/report/raster.rs", "src/report/pdf.rs"]),
        ("pdf_writer", &["src/report/pdf.rs"]),
        ("dejavu", &["src/report/raster.rs"]),
        ("rustfft", &["src/on_the_fly/decompose"]),
        ("png", &["src/surface/heightmap", "src/texture/bitmap", "src/report/image.rs", "src/report/pdf.rs"]),
        ("quick_xml", &["src/surface/threemf", "src/texture/xml.rs"]),
        ("tiff", &["src/surface/heightmap", "src/texture/bitmap"]),
        ("zip", &["src/surface/threemf"]),
        ("zune_jpeg", &["src/texture/bitmap/jpeg.rs"]),
        ("prost", &["src/emit/ovf", "src/verify/read/ovf"]),
        ("toml", &["src/diag", "src/job"]),
        ("toml_edit", &["src/cli/orient.rs"]),
        ("serialport", &["src/run/stage/grbl"]),
        ("nusb", &["src/run/laser/lmc/usb.rs"]),
        ("annotate_snippets", &["src/diag"]),
    ];
    let mut wrong = Vec::new();
    for (path, _, code) in sources() {
        let shown = path.display().to_string().replace('\\', "/");
        for (name, places) in owners {
            let uses = code
                .match_indices(&format!("{name}::"))
                .any(|(i, _)| !code[..i].ends_with(|c: char| c.is_alphanumeric() || c == '_' || c == ':'));
            if uses && !places.iter().any(|r| shown.contains(r)) {
                wrong.push(format!("{shown} uses {name}, which belongs to {places:?}"));
            }
        }
        let prints = ["println!", "eprintln!", "print!(", "dbg!"].iter().any(|p| code.contains(p));
        if prints && !shown.contains("src/cli") {
            wrong.push(format!("{shown} prints"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// By the module around them, which modules name which others beside them, and a file that does.
type Arrows = BTreeMap<String, BTreeMap<(String, String), PathBuf>>;

/// The module of a file, word by word.
fn module(path: &Path) -> Vec<String> {
    let inner = path.strip_prefix(root()).expect("below src").with_extension("");
    let mut words: Vec<String> = inner.iter().map(|word| word.to_string_lossy().into_owned()).collect();
    if words.last().is_some_and(|word| word == "mod") {
        words.pop();
    }
    words
}

/// What the modules inside each module name beside them. All inside a module counts as the module; what a module names
/// of those around it, or of those it holds, does not count.
fn arrows() -> Arrows {
    let files: Vec<_> = sources().into_iter().map(|(path, _, code)| (module(&path), path, code)).collect();
    let modules: BTreeSet<&[String]> = files.iter().map(|file| file.0.as_slice()).collect();
    let mut out = Arrows::new();
    for (module, path, code) in &files {
        for named in paths(code) {
            let ups = named.iter().take_while(|word| **word == "super").count();
            let from = if ups > 0 { &module[..module.len().saturating_sub(ups)] } else { &[] };
            let mut target = from.to_vec();
            target.extend(named[ups.max(1)..].iter().map(|word| (*word).to_owned()));
            while !target.is_empty() && !modules.contains(target.as_slice()) {
                target.pop();
            }
            let common = module.iter().zip(&target).take_while(|(a, b)| a == b).count();
            if common > 0 && common < module.len().min(target.len()) {
                let level = out.entry(module[..common].join("::")).or_default();
                level.entry((module[common].clone(), target[common].clone())).or_insert_with(|| path.clone());
            }
        }
    }
    out
}

/// The arrows that lie on a circle, or on a way from one circle to another.
fn on_circles<'a>(arrows: impl IntoIterator<Item = (&'a str, &'a str)>) -> BTreeSet<(&'a str, &'a str)> {
    let mut left: BTreeSet<_> = arrows.into_iter().collect();
    loop {
        let before = left.len();
        let [starts, ends]: [BTreeSet<&str>; 2] =
            [left.iter().map(|arrow| arrow.0).collect(), left.iter().map(|arrow| arrow.1).collect()];
        // No circle passes a module that names none, or that none names.
        left.retain(|(from, to)| ends.contains(from) && starts.contains(to));
        if left.len() == before {
            return left;
        }
    }
}

#[test]
fn modules_inside_a_module_do_not_name_each_other_in_a_circle() {
    let arrows = arrows();
    // Named from `crate::` and from `super::`, in a folder and deeper.
    for (level, from, to) in [
        ("on_the_fly", "check", "program"),
        ("verify", "rules", "geometry"),
        ("texture", "drawing", "clip"),
        ("verify::geometry", "mesh", "grid"),
    ] {
        let arrow = (from.to_owned(), to.to_owned());
        assert!(arrows.get(level).is_some_and(|a| a.contains_key(&arrow)), "{level}: {from} names {to}: {arrows:?}");
    }
    let mut wrong = Vec::new();
    for (level, named) in &arrows {
        for (from, to) in on_circles(named.keys().map(|(from, to)| (from.as_str(), to.as_str()))) {
            let file = &named[&(from.to_owned(), to.to_owned())];
            wrong.push(format!("{}: {level}::{from} names {to} in a circle", file.display()));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn circles_are_found() {
    let arrows = [("a", "b"), ("b", "c"), ("c", "d"), ("d", "b"), ("d", "e"), ("f", "e")];
    assert_eq!(on_circles(arrows), BTreeSet::from([("b", "c"), ("c", "d"), ("d", "b")]));
    assert_eq!(on_circles([("a", "b"), ("b", "c"), ("a", "c")]), BTreeSet::new());
}

#[test]
fn scan_for_module_names_finds_every_form() {
    let text = "use crate::{diag, surface::{Span, walk}};\nuse crate::geom::P2;\nlet x = crate::emit::dxf();";
    let want = ["diag", "emit", "geom", "surface"].map(str::to_owned);
    assert_eq!(named(text), BTreeSet::from(want));
    let found = paths("use super::{\n    Figure,\n    place::{self, Site},\n};\nlet x = super::super::clip::clip(1);");
    let want = ["super Figure", "super place self", "super place Site", "super ", "super super clip clip"];
    assert_eq!(found, want.map(|path| path.split(' ').collect::<Vec<_>>()));
}
