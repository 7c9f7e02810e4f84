//! The reader as a whole: against ezdxf, in every form of file, and on damaged files.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use super::*;
use crate::texture::artwork::Rule;

/// What becomes of a file: how many shapes, or the code of the error; and the codes of the warnings.
type Outcome = (Result<usize, &'static str>, &'static [&'static str]);

const TOLERANCE: f64 = 5e-4;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn shared(folder: &str) -> PathBuf {
    let path = root().join("../shared/data").join(folder);
    assert!(path.is_dir(), "{} is absent", path.display());
    path
}

fn entities() -> Vec<u8> {
    std::fs::read(root().join("fixtures/entities.dxf")).expect("the fixture")
}

fn loaded(bytes: &[u8], unit_mm: Option<f64>) -> (Result<Artwork, Error>, Vec<Diag>) {
    let mut notes = Vec::new();
    let art = load(bytes, Path::new("a.dxf"), unit_mm, TOLERANCE, &mut notes);
    (art, notes)
}

/// A drawing of tags: group code, value.
fn file(tags: &str) -> Vec<u8> {
    let body: String = tags.split_whitespace().map(|t| format!("{}\n", t.replace('_', " "))).collect();
    format!("0\nSECTION\n2\nENTITIES\n{body}0\nENDSEC\n0\nEOF\n").into_bytes()
}

// --- Against ezdxf

/// Writes what is read of a drawing for the script that compares it with ezdxf.
fn write_json(path: &Path, to: &Path) {
    let bytes = std::fs::read(path).expect("readable");
    let file = file::read(&bytes).expect("read");
    let unit = units::unit_mm(file.unit, file.unit.filter(|&u| u != 0).is_none().then_some(1.0)).expect("a unit");
    let (art, tally) = walk::walk(&file, unit, TOLERANCE).expect("drawn");
    let shape = |s: &crate::texture::artwork::Shape| {
        let lines: Vec<&[[f64; 2]]> = s.lines.clone().map(|i| art.lines.get(i)).collect();
        serde_json::json!({ "name": art.names[s.name as usize], "lines": lines })
    };
    let not_unread = [
        "dxf-hidden",
        "dxf-ignored",
        "dxf-dash",
        "dxf-width",
        "dxf-block",
        "dxf-fault",
        "dxf-bulge",
        "dxf-noplot",
        "dxf-dot",
        "dxf-pattern-dots",
    ];
    let mut unread: BTreeMap<&str, u64> = BTreeMap::new();
    let rows = tally.rows().filter(|(code, ..)| !not_unread.contains(code));
    rows.for_each(|(_, what, n, _)| *unread.entry(what).or_default() += n);
    let hidden: u64 = tally.rows().filter(|r| r.0 == "dxf-hidden").map(|r| r.2).sum();
    let whole = serde_json::json!({
        "file": path.display().to_string(),
        "unit_mm": unit,
        "unread": unread,
        "hidden": hidden,
        "shapes": art.shapes.iter().map(shape).collect::<Vec<_>>(),
    });
    std::fs::write(to, whole.to_string()).expect("written");
}

fn compare(paths: &[PathBuf]) -> String {
    let dir = tempfile::tempdir().expect("a folder");
    let mut command = Command::new(root().join(".venv/bin/python"));
    command.arg(root().join("tests/python/check_drawing.py"));
    for (i, path) in paths.iter().enumerate() {
        let to = dir.path().join(format!("{i}.json"));
        write_json(path, &to);
        command.arg(to);
    }
    let out = command.output().expect("the foreign readers are installed: run tests/python/setup.sh");
    let said = String::from_utf8_lossy(&out.stdout).into_owned() + &String::from_utf8_lossy(&out.stderr);
    assert!(out.status.success(), "{said}");
    assert_eq!(said.lines().filter(|l| l.starts_with("ok")).count(), paths.len(), "{said}");
    said
}

#[test]
fn every_entity_equals_ezdxf_to_a_micrometre() {
    compare(&[root().join("fixtures/entities.dxf")]);
}

#[test]
#[ignore = "needs ../shared: make test-all"]
fn all_drawings_equal_ezdxf_to_a_micrometre() {
    let entries = std::fs::read_dir(shared("textures")).expect("readable");
    let mut paths: Vec<PathBuf> = entries.map(|e| e.expect("readable").path()).collect();
    paths.retain(|p| p.extension().is_some_and(|e| e.eq_ignore_ascii_case("dxf")));
    paths.sort();
    assert!(paths.len() >= 29, "{}", paths.len());
    println!("{}", compare(&paths));
}
