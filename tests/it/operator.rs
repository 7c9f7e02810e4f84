//! A person who loads the files of the blocks: in the figures, and in what `auto` minimises.

use std::path::Path;

use serde_json::Value;

use crate::support::surfaces::{mesh, write_stl};
use crate::support::{JobText, compile, folder, machine_file, number, summary_of, verify};

/// A wave that free windows cover with fewer stops than sections do, in these formats; a person takes `load`.
fn job(dir: &Path, formats: &str, load: Option<&str>) -> std::path::PathBuf {
    let stl = dir.join("wave.stl");
    write_stl(&stl, &mesh(40, [0.0, 0.0, 130.0, 90.0], |x, y| 0.4 * (x / 19.0).sin() * (y / 17.0).cos()));
    let operator = load.map_or_else(String::new, |load| format!("\n[operator]\nload = {load:?}\n"));
    std::fs::write(dir.join("machine.toml"), machine_file("xyz-galvo-40") + &operator).expect("a writable folder");
    let text = JobText {
        machine: "file = \"machine.toml\"".into(),
        more: format!("[emit]\nformats = {formats}\n"),
        ..JobText::on(&stl).texture("pattern = \"hatch\"\npitch = \"1 mm\"").method("auto")
    };
    text.write(dir, "wave.toml")
}

#[test]
fn summary_has_the_time_with_a_person_and_says_whether_one_is_needed() {
    let dir = folder();
    for (formats, load, load_s, is_needed) in [
        ("[\"dxf\", \"linuxcnc\"]", None, 15.0, true),
        ("[\"lightburn\"]", Some("40 s"), 40.0, true),
        ("[\"linuxcnc\", \"ovf\"]", None, 15.0, false),
    ] {
        let out = dir.path().join("wave.job");
        let summary = compile(&job(dir.path(), formats, load), &out);
        let hand = &summary["by_hand"];
        assert_eq!((hand["needed"] == true, hand["assumed"] == true), (is_needed, load.is_none()), "{formats}: {hand}");
        assert_eq!(number(hand, "load_s"), load_s);
        let total = number(&summary["time_s"], "total") + load_s * number(&summary, "blocks");
        assert!((number(hand, "total_s") - total).abs() < 1e-6, "{formats}: {hand} {total}");
        verify(&out);
        let sheet = std::fs::read_to_string(out.join("runsheet.txt")).expect("a run sheet");
        let line = sheet.lines().find(|l| l.starts_with("by hand")).expect("a line for it");
        let who = if is_needed { ", a person loads " } else { ", if a person loads " };
        assert!(line.contains(who) && line.contains(&format!(" files at {load_s} s each (")), "{line}");
        assert_eq!(line.contains("assumed"), load.is_none(), "{line}");
    }
}

#[test]
fn auto_counts_the_person_where_one_is_needed() {
    let dir = folder();
    let spent = |c: &Value, load: f64| number(&c["time_s"], "total") + load * number(c, "stops");
    let mut methods = Vec::new();
    for (formats, load) in [("[\"linuxcnc\"]", 0.0), ("[\"linuxcnc\"]", 60.0), ("[\"linuxcnc\", \"ovf\"]", 60.0)] {
        let text = format!("{load} s");
        let summary = summary_of(&job(dir.path(), formats, Some(&text)));
        let counted = if formats.contains("ovf") { 0.0 } else { load };
        let candidates = summary["candidates"].as_array().expect("candidates");
        let best = candidates.iter().min_by(|a, b| spent(a, counted).total_cmp(&spent(b, counted))).expect("several");
        assert_eq!(best["method"], summary["method"], "{formats} {load}: {summary}");
        methods.push((summary["method"].clone(), number(&summary, "stops")));
    }
    assert!(methods[1].1 < methods[0].1, "a person's minutes are worth longer moves: {methods:?}");
    assert_eq!(methods[0], methods[2], "nobody loads what one file holds");
}
