//! The layers of the library, and the modules that own each dependency, read from the `crate::` paths.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Every source file with its module (`emit` for src/emit/dxf.rs and src/emit.rs) and its text without
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

/// The modules that a text names as `crate::module` or in `use crate::{module, other::…}`.
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

/// The modules of the library, lowest first: each may name those above it in this list and none below.
const ORDER: [&str; 24] = [
    "geom",
    "units",
    "diag",
    "machine",
    "motion",
    "program",
    "surface",
    "texture",
    "projection",
    "partition",
    "split",
    "order",
    "check",
    "block_map",
    "on_the_fly",
    "emit",
    "job",
    "manifest",
    "plan",
    "report",
    "job_folder",
    "compare",
    "batch",
    "cli",
];

/// What the verifier may name: readers of input files and types. Nothing that planned or wrote what it verifies.
const VERIFIER: [&str; 8] = ["geom", "units", "diag", "machine", "program", "surface", "texture", "job"];

#[test]
fn modules_name_only_modules_above_them() {
    let place = |module: &str| ORDER.iter().position(|m| *m == module);
    let mut wrong = Vec::new();
    for (path, module, code) in sources() {
        for other in named(&code).into_iter().filter(|other| *other != module) {
            let may = match module.as_str() {
                "lib" | "main" | "cli" => true,
                "verify" => VERIFIER.contains(&other.as_str()),
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
    let owners: [(&str, &[&str]); 14] = [
        ("nalgebra", &["src/geom"]),
        ("spade", &["src/surface/points"]),
        ("parry2d", &["src/order/clearance"]),
        ("geo", &["src/report", "src/surface/obj"]),
        // The texture module has a module of this name.
        ("svg", &["src/report", "src/texture/mod.rs"]),
        ("clap", &["src/cli"]),
        ("indicatif", &["src/cli"]),
        ("roxmltree", &["src/texture/svg"]),
        ("svgtypes", &["src/texture/svg"]),
        ("rustfft", &["src/on_the_fly/decompose"]),
        ("png", &["src/surface/heightmap"]),
        ("prost", &["src/emit/ovf", "src/verify/read/ovf"]),
        ("toml", &["src/diag", "src/job"]),
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

#[test]
fn scan_for_module_names_finds_every_form() {
    let text = "use crate::{diag, surface::{Span, walk}};\nuse crate::geom::P2;\nlet x = crate::emit::dxf();";
    let want = ["diag", "emit", "geom", "surface"].map(str::to_owned);
    assert_eq!(named(text), BTreeSet::from(want));
}
