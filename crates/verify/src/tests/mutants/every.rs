//! Jobs with all that a folder can hold, of which no leaf and no word can be changed.

use super::super::places::{unproved_leaves, unproved_words};
use super::*;
use crate::read::leaves::STEPPED;

/// A job of a few lines on a sheet of four facets, by the tables of its file.
fn small(machine: &str, more: &str, tables: &str) -> Bench {
    let dir = tempfile::tempdir().expect("a writable temporary folder");
    let z = |x: f64, y: f64| x / 40.0 + y / 200.0;
    let p = |x: f64, y: f64| [x, y, z(x, y)];
    let facets = [[0.0, 6.0], [6.0, 12.0]]
        .iter()
        .flat_map(|&[a, b]| [[p(a, 0.0), p(b, 0.0), p(b, 8.0)], [p(a, 0.0), p(b, 8.0), p(a, 8.0)]]);
    std::fs::write(dir.path().join("part.stl"), stl(&facets.collect::<Vec<_>>())).expect("a writable folder");
    let profile = terrace_core::machine::PROFILES.iter().find(|(name, _)| *name == machine).expect("a profile").1;
    std::fs::write(dir.path().join("machine.toml"), format!("{profile}\n{more}")).expect("a writable folder");
    let text = format!(
        r#"
        surface = {{ file = "part.stl", unit = "mm" }}
        machine = {{ file = "machine.toml" }}
        limits = {{ max_off_part = "50 %" }}
        {tables}
        [[pen]]
        name = "fine"
        speed = "1000 mm/s"
        power = "60 %"
        frequency = "60 kHz"
        [[pen]]
        name = "deep"
        speed = "500 mm/s"
        power = "8 W"
        frequency = "40 kHz"
        passes = 2
        dwell = "200 us"
        [[pen]]
        name = "pilot"
        speed = "1000 mm/s"
        power = "1 %"
        frequency = "60 kHz"
        "#
    );
    let path = dir.path().join("job.toml");
    std::fs::write(&path, text).expect("a writable folder");
    let Plan::Stepped(plan) = plan::plan(load(&path), &|_, _| {}).unwrap_or_else(|e| panic!("{e}")) else {
        panic!("a stepped job")
    };
    Bench { dir, plan, sound: OnceCell::new() }
}

/// Dots, squares and lines in two passes and two set-ups, with frames.
fn plain() -> Bench {
    small(
        "xyz-galvo-40",
        "[lmc]\nunits_per_mm = 1500\nlaser = \"fiber\"\n",
        r#"
        focus = { pdof = "0.2 mm" }
        partition = { method = "z-range", section = "8 mm", overlap = "0.05 mm" }
        passes = { count = 2, rotate = "90 deg", lower = "10 um" }
        setups = { columns = 2, registration = [["0 mm", "0 mm"], ["12 mm", "0 mm"]] }
        emit = { frames = "pilot", formats = ["dxf", "csv", "lmc", "linuxcnc", "gcode"] }
        [[texture]]
        pattern = "hatch"
        pitch = "3 mm"
        area = ["-1 mm", "0 mm", "13 mm", "8 mm"]
        pen = "fine"
        [[texture]]
        pattern = "squares"
        pitch = "6 mm"
        cell = "2 mm"
        pen = "deep"
        [[texture]]
        pattern = "dots"
        pitch = "6 mm"
        pen = "deep"
        "#,
    )
}

/// Lines of pens for their slope on a machine with a zoom optic.
fn zoom() -> Bench {
    small(
        "xyz-zoom-40",
        "[rtc]\nboard = \"rtc5\"\nbits_per_mm = 20000\nfocus_bits_per_mm = 5000\nlist_memory = 200\n",
        r#"
        focus = { pdof = "0.1 mm" }
        dose = { compensate = "speed", step = 0.002 }
        partition = { method = "z-range", min_mark = "2 um" }
        emit = { formats = ["lightburn", "rtc", "linuxcnc", "ovf"] }
        [[texture]]
        pattern = "hatch"
        pitch = "4 mm"
        pen = "fine"
        [[texture]]
        pattern = "squares"
        pitch = "6 mm"
        cell = "2 mm"
        pen = "deep"
        "#,
    )
}

/// Lines on a machine that tilts its head.
fn head() -> Bench {
    small(
        "xyz-headtilt-galvo-40",
        "",
        r#"
        focus = { pdof = "0.05 mm" }
        partition = { method = "tilt" }
        emit = { formats = ["poses", "csv", "ovf", "gcode"] }
        [[texture]]
        pattern = "hatch"
        pitch = "4 mm"
        area = ["0.5 mm", "1 mm", "11.3 mm", "7.1 mm"]
        pen = "fine"
        "#,
    )
}

fn jobs() -> [(&'static str, Bench); 3] {
    [("plain", plain()), ("zoom", zoom()), ("head", head())]
}

/// One change of a leaf in `step` is tried.
fn assert_leaves_are_proved(step: usize) {
    for (name, bench) in jobs() {
        let folder = bench.write();
        let proof = verified(&folder);
        assert!(proof.ok, "{name}: {}", proof.to_text());
        let passed = unproved_leaves(&folder, &STEPPED, step);
        assert!(passed.is_empty(), "{name}: {passed:#?}");
    }
}

#[test]
fn leaves_of_a_manifest_are_proved_one_in_twenty() {
    assert_leaves_are_proved(20);
}

#[test]
#[ignore = "slow: make test-all"]
fn every_leaf_of_a_manifest_is_proved_or_listed_as_not_proved() {
    assert_leaves_are_proved(1);
}

#[test]
fn words_of_files_are_proved_one_in_two_thousand() {
    for (name, bench) in jobs() {
        let passed = unproved_words(&bench.write(), 1999);
        assert!(passed.is_empty(), "{name}: {passed:#?}");
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn every_word_of_every_file_is_proved() {
    for (name, bench) in jobs() {
        let passed = unproved_words(&bench.write(), 1);
        assert!(passed.is_empty(), "{name}: {passed:#?}");
    }
}
