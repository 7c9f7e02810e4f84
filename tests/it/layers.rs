//! The layers of the library and the doors of its dependencies, read from the `crate::` paths.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Every source file with its room (`emit` for src/emit/dxf.rs and src/emit.rs) and its text without
/// tests and comments.
fn sources() -> Vec<(PathBuf, String, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut out = Vec::new();
    let mut open = vec![root.clone()];
    while let Some(dir) = open.pop() {
        for entry in std::fs::read_dir(dir).expect("src is readable") {
            let path = entry.expect("src is readable").path();
            if path.is_dir() {
                open.push(path);
            } else if path.extension().is_some_and(|e| e == "rs") {
                let inner = path.strip_prefix(&root).expect("below src");
                let test_only =
                    inner.iter().any(|c| ["tests", "tests.rs", "sample.rs", "mutants.rs"].iter().any(|t| c == *t))
                        && !inner.starts_with("spec");
                if test_only {
                    continue;
                }
                let room = inner.iter().next().expect("a name").to_string_lossy().trim_end_matches(".rs").to_owned();
                let text = std::fs::read_to_string(&path).expect("readable");
                let text = text.split("#[cfg(test)]\nmod tests").next().unwrap_or_default();
                let code: String =
                    text.lines().filter(|l| !l.trim_start().starts_with("//")).collect::<Vec<_>>().join("\n");
                out.push((path, room, code));
            }
        }
    }
    out.sort();
    out
}

/// The rooms that a text names as `crate::room` or in `use crate::{room, other::…}`.
fn named(text: &str) -> BTreeSet<String> {
    let mut out = BTreeSet::new();
    for (at, _) in text.match_indices("crate::") {
        let rest = &text[at + 7..];
        let word = |s: &str| s.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>();
        if let Some(list) = rest.strip_prefix('{') {
            let mut depth = 0;
            let mut item = true;
            for (i, c) in list.char_indices() {
                match c {
                    '}' if depth == 0 => break,
                    '{' => depth += 1,
                    '}' => depth -= 1,
                    ',' if depth == 0 => item = true,
                    c if item && c.is_alphabetic() => {
                        out.insert(word(&list[i..]));
                        item = false;
                    }
                    _ => {}
                }
            }
        } else {
            out.insert(word(rest));
        }
    }
    out.retain(|w| !w.is_empty() && w.chars().next().is_some_and(char::is_lowercase));
    out
}

/// What each room may name.
fn allowed() -> BTreeMap<&'static str, Vec<&'static str>> {
    let base = ["units", "geom", "diag"];
    let with = |more: &[&'static str]| base.iter().chain(more).copied().collect::<Vec<_>>();
    let ground = ["machine", "motion", "program"];
    let on_ground = |more: &[&'static str]| with(&[&ground[..], more].concat());
    BTreeMap::from([
        ("units", vec!["geom"]),
        ("geom", vec![]),
        ("diag", vec![]),
        ("surface", with(&[])),
        ("texture", with(&[])),
        ("machine", with(&[])),
        // spec names the options of the rooms whose keys it holds.
        ("spec", with(&["surface", "texture", "machine"])),
        ("motion", with(&["machine"])),
        ("program", with(&[])),
        ("trace", with(&["surface", "texture", "program"])),
        ("fill", with(&["surface", "texture", "program", "trace"])),
        ("partition", on_ground(&["trace"])),
        ("split", on_ground(&["trace", "partition"])),
        ("order", on_ground(&[])),
        ("check", on_ground(&["order"])),
        ("map", on_ground(&["surface"])),
        ("fly", on_ground(&["surface", "texture", "trace", "check"])),
        ("emit", on_ground(&["check", "fly"])),
        ("record", on_ground(&["check", "spec", "fly"])),
        ("preview", on_ground(&["check", "record", "map"])),
        ("verify", with(&["spec", "surface", "texture", "machine", "program"])),
        (
            "compile",
            on_ground(&[
                "spec",
                "surface",
                "texture",
                "trace",
                "fill",
                "fly",
                "partition",
                "split",
                "order",
                "check",
                "map",
                "record",
            ]),
        ),
        ("compare", on_ground(&["compile", "spec", "surface", "texture", "trace", "fly", "record", "preview"])),
        ("folder", on_ground(&["compile", "emit", "fly", "preview", "record", "spec"])),
        ("batch", with(&["compile", "folder", "machine", "spec"])),
    ])
}

#[test]
fn rooms_name_only_the_rooms_below_them() {
    let allowed = allowed();
    let mut wrong = Vec::new();
    for (path, room, code) in sources() {
        if ["lib", "main", "cli"].contains(&room.as_str()) {
            continue;
        }
        let Some(may) = allowed.get(room.as_str()) else {
            wrong.push(format!("{}: room {room} has no place in the layers", path.display()));
            continue;
        };
        for other in named(&code) {
            if other != room && !may.contains(&other.as_str()) {
                wrong.push(format!("{}: {room} names {other}", path.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn the_verifier_shares_readers_and_types_alone() {
    for (path, room, code) in sources() {
        if room == "verify" {
            for hidden in ["surface::walk", "Welder", "Tracer", "Surface::load", "from_facets", "program::text"] {
                assert!(!code.contains(hidden), "{} uses {hidden}", path.display());
            }
        }
    }
}

#[test]
fn every_dependency_has_its_door() {
    // Crate, and the rooms or files that may name it.
    let doors: [(&str, &[&str]); 14] = [
        ("nalgebra", &["src/geom"]),
        ("spade", &["src/surface/points"]),
        ("parry2d", &["src/order/clearance"]),
        ("geo", &["src/preview", "src/surface/obj"]),
        // The texture room has a module of this name.
        ("svg", &["src/preview", "src/texture/mod.rs"]),
        ("clap", &["src/cli"]),
        ("indicatif", &["src/cli"]),
        ("roxmltree", &["src/texture/svg"]),
        ("svgtypes", &["src/texture/svg"]),
        ("rustfft", &["src/fly/decompose"]),
        ("png", &["src/surface/heightmap"]),
        ("prost", &["src/emit/ovf", "src/verify/read/ovf"]),
        ("toml", &["src/diag", "src/spec"]),
        ("annotate_snippets", &["src/diag"]),
    ];
    let mut wrong = Vec::new();
    for (path, _, code) in sources() {
        let shown = path.display().to_string().replace('\\', "/");
        for (name, rooms) in doors {
            let uses = code
                .match_indices(&format!("{name}::"))
                .any(|(i, _)| !code[..i].ends_with(|c: char| c.is_alphanumeric() || c == '_' || c == ':'));
            if uses && !rooms.iter().any(|r| shown.contains(r)) {
                wrong.push(format!("{shown} uses {name}, whose door is {rooms:?}"));
            }
        }
        let prints = ["println!", "eprintln!", "print!(", "dbg!"].iter().any(|p| code.contains(p));
        if prints && !shown.contains("src/cli") {
            wrong.push(format!("{shown} prints"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn the_check_of_layers_sees_what_it_should() {
    let text = "use crate::{diag, surface::{Span, walk}};\nuse crate::geom::P2;\nlet x = crate::emit::dxf();";
    let want = ["diag", "emit", "geom", "surface"].map(str::to_owned);
    assert_eq!(named(text), BTreeSet::from(want));
}
