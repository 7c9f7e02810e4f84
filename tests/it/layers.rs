//! What no compiler holds of the structure: the crates as docs/developing/architecture.md draws them, modules without
//! circles, and what the verifier may not touch of the crates that it shares.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The folders of sources, each with the name of its crate.
fn crates() -> Vec<(String, PathBuf)> {
    let mut out = vec![("terrace".to_owned(), root().join("src"))];
    for entry in std::fs::read_dir(root().join("crates")).expect("crates is readable") {
        let folder = entry.expect("crates is readable").path();
        // `packages` is no crate.
        if !folder.join("Cargo.toml").is_file() {
            continue;
        }
        let name = folder.file_name().expect("a name").to_string_lossy().into_owned();
        out.push((name, folder.join("src")));
    }
    out.sort();
    out
}

/// Every source file with its crate and its text without tests and comments.
fn sources() -> Vec<(PathBuf, String, String)> {
    let mut out = Vec::new();
    for (name, root) in crates() {
        let mut open = vec![root.clone()];
        while let Some(dir) = open.pop() {
            for entry in std::fs::read_dir(dir).expect("sources are readable") {
                let path = entry.expect("sources are readable").path();
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
                    let text = std::fs::read_to_string(&path).expect("readable");
                    let text = text.split("#[cfg(test)]\nmod tests").next().unwrap_or_default();
                    let code: String =
                        text.lines().filter(|l| !l.trim_start().starts_with("//")).collect::<Vec<_>>().join("\n");
                    out.push((path, name.clone(), code));
                }
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

/// The crates of the project that each crate is built from, tests apart.
fn graph() -> BTreeMap<String, BTreeSet<String>> {
    let of = |(name, src): (String, PathBuf)| {
        let manifest = src.parent().expect("a folder").join("Cargo.toml");
        let manifest: toml::Table = std::fs::read_to_string(&manifest).expect("readable").parse().expect("TOML");
        let own =
            |name: &str| name.strip_prefix("terrace-").or((name == "svg-style").then_some(name)).map(str::to_owned);
        let needed = manifest["dependencies"].as_table().expect("dependencies").keys();
        (name, needed.filter_map(|name| own(name)).collect())
    };
    crates().into_iter().map(of).collect()
}

/// All that a crate is built from.
fn reached(graph: &BTreeMap<String, BTreeSet<String>>, name: &str) -> BTreeSet<String> {
    let mut out = BTreeSet::new();
    let mut open = vec![name.to_owned()];
    while let Some(name) = open.pop() {
        open.extend(graph[&name].iter().filter(|other| out.insert((*other).clone())).cloned());
    }
    out
}

#[test]
fn the_verifier_is_built_without_anything_that_plans_or_writes() {
    let want = ["core", "input", "svg-style"].map(str::to_owned);
    assert_eq!(reached(&graph(), "verify"), BTreeSet::from(want));
}

/// The arrows between the crates as docs/developing/architecture.md draws them, those left out that others imply.
#[test]
fn the_crates_are_drawn_as_they_are() {
    let graph = graph();
    let mut drawn = String::from("```mermaid\ngraph BT\n");
    for (name, needed) in &graph {
        let implied = |other: &String| needed.iter().any(|via| via != other && reached(&graph, via).contains(other));
        for other in needed.iter().filter(|other| !implied(other)) {
            drawn.push_str(&format!("    {name} --> {other}\n"));
        }
    }
    drawn.push_str("```\n");
    let text = std::fs::read_to_string(root().join("docs/developing/architecture.md")).expect("readable");
    assert!(text.contains(&drawn), "docs/developing/architecture.md draws the crates otherwise than\n{drawn}");
}

#[test]
fn the_verifier_uses_nothing_that_the_planner_uses_of_the_same_modules() {
    for (path, name, code) in sources() {
        if name == "verify" {
            for hidden in ["surface::walk", "Welder", "Tracer", "Surface::load", "from_facets", "program::text"] {
                assert!(!code.contains(hidden), "{} uses {hidden}", path.display());
            }
        }
    }
}

#[test]
fn only_the_command_line_prints() {
    for (path, _, code) in sources() {
        let prints = ["println!", "eprintln!", "print!(", "dbg!"].iter().any(|p| code.contains(p));
        assert!(!prints || path.starts_with(root().join("src/cli")), "{} prints", path.display());
    }
}

/// By the module around them, which modules name which others beside them, and a file that does.
type Arrows = BTreeMap<String, BTreeMap<(String, String), PathBuf>>;

/// The module of a file, word by word, from its crate on.
fn module(path: &Path, name: &str) -> Vec<String> {
    let src = crates().into_iter().find(|(other, _)| other == name).expect("a crate").1;
    let inner = path.strip_prefix(src).expect("below src").with_extension("");
    let mut words = vec![name.to_owned()];
    words.extend(inner.iter().map(|word| word.to_string_lossy().into_owned()));
    if words.last().is_some_and(|word| ["mod", "lib", "main"].contains(&word.as_str())) {
        words.pop();
    }
    words
}

/// What the modules inside each module name beside them. All inside a module counts as the module; what a module names
/// of those around it, or of those it holds, does not count.
fn arrows() -> Arrows {
    let files: Vec<_> = sources().into_iter().map(|(path, name, code)| (module(&path, &name), path, code)).collect();
    let modules: BTreeSet<&[String]> = files.iter().map(|file| file.0.as_slice()).collect();
    let mut out = Arrows::new();
    for (module, path, code) in &files {
        for named in paths(code) {
            let ups = named.iter().take_while(|word| **word == "super").count();
            let from = if ups > 0 { &module[..module.len().saturating_sub(ups)] } else { &module[..1] };
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
        ("plan", "plan", "partition"),
        ("plan::on_the_fly", "check", "program"),
        ("verify", "rules", "geometry"),
        ("input::texture", "drawing", "clip"),
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
    let found = paths("use crate::{diag, surface::{Span, walk}};\nlet x = crate::emit::dxf();");
    let want = ["crate diag", "crate surface Span", "crate surface walk", "crate emit dxf"];
    assert_eq!(found, want.map(|path| path.split(' ').collect::<Vec<_>>()));
    let found = paths("use super::{\n    Figure,\n    place::{self, Site},\n};\nlet x = super::super::clip::clip(1);");
    let want = ["super Figure", "super place self", "super place Site", "super ", "super super clip clip"];
    assert_eq!(found, want.map(|path| path.split(' ').collect::<Vec<_>>()));
}
