//! Jobs for a machine with a zoom optic: stops of the stage in x, y and a coarse z, levels by the optic.

use std::path::Path;

use serde_json::Value;

use crate::support::surfaces::{dome, mesh, write_stl};
use crate::support::{JobText, compile, folder, manifest, number, said, terrace, verify};

#[test]
#[ignore = "slow: make test-all"]
fn a_dome_is_marked_at_one_stop_a_section_and_compare_gives_the_same_time() {
    // 11.25 fields: the lines of the last sections fit into the fields beside them, where the optic's range holds both.
    is_marked_at_one_stop_a_section(40, "12 mm", 141);
}

#[test]
#[ignore = "slow: make test-all"]
fn a_dome_under_a_hatch_of_1_mm_is_marked_at_one_stop_a_section() {
    // 450 mm are 12 fields of 40 mm along x and along y; the dome is 10 mm high, as is the optic's range.
    is_marked_at_one_stop_a_section(500, "1 mm", 144);
}

/// A dome of so many cells along each side, under a hatch of this pitch.
fn is_marked_at_one_stop_a_section(cells: usize, pitch: &str, stops: usize) {
    let dir = folder();
    let stl = dir.path().join("dome.stl");
    write_stl(&stl, &mesh(cells, [0.0, 0.0, 450.0, 450.0], dome));
    let text = JobText {
        machine: "profile = \"xyz-zoom-40\"".into(),
        more: "[emit]\nformats = [\"linuxcnc\", \"ovf\"]\n".into(),
        ..JobText::on(&stl).texture(&format!("pattern = \"hatch\"\npitch = {pitch:?}")).method("z-range")
    };
    let job = text.write(dir.path(), "dome.toml");
    let out = dir.path().join("dome.job");
    let summary = compile(&job, &out);
    assert_eq!(summary["stops"], stops);
    assert!(summary["blocks"].as_u64().expect("a number") > 1_000, "{summary}");
    let total = number(&summary["time_s"], "total");
    verify(&out);
    // No move of z between two blocks of one stop: as many moves of x and y as stops.
    let stage = std::fs::read_to_string(out.join("stage.ngc")).expect("a stage program");
    let moves = stage.lines().filter(|l| l.starts_with("G0 X")).count();
    let heights = stage.lines().filter(|l| l.starts_with("G0 Z")).count();
    assert!(moves <= stops && heights < 10, "{moves} {heights}");

    let args = [Path::new("compare"), &job, Path::new("--systems"), Path::new("zoom,z-range"), Path::new("--json")];
    let compared = terrace(args);
    assert!(compared.status.success(), "{}", said(&compared));
    let compared: Value = serde_json::from_slice(&compared.stdout).expect("JSON");
    let row = |name: &str| {
        let rows = compared["systems"].as_array().expect("rows");
        rows.iter().find(|r| r["system"] == name).unwrap_or_else(|| panic!("{name}: {compared}")).clone()
    };
    let of = |name: &str| number(&row(name), "total_s");
    assert!((of("zoom") - total).abs() <= 1e-6 * total, "{} {total}", of("zoom"));
    assert_eq!(row("zoom")["stops"], stops);
    assert!(of("z-range") > 2.0 * total, "{} {total}", of("z-range"));
}

#[test]
fn levels_one_way_are_marked_one_way_with_a_zoom_optic_too() {
    let dir = folder();
    let stl = dir.path().join("dome.stl");
    write_stl(&stl, &mesh(60, [100.0, 100.0, 200.0, 200.0], dome));
    for (order, sign) in [("z-up", 1.0), ("z-down", -1.0)] {
        let text = JobText {
            machine: "profile = \"xyz-zoom-40\"".into(),
            more: format!("[order]\nstops = {order:?}\n"),
            ..JobText::on(&stl).texture("pattern = \"hatch\"\npitch = \"2 mm\"").method("contour")
        };
        let job = text.write(dir.path(), "dome.toml");
        let out = dir.path().join("dome.job");
        compile(&job, &out);
        verify(&out);
        let manifest = manifest(&out);
        let planes = manifest["blocks"].as_array().expect("blocks").iter().map(|b| b["lpfl_mm"].as_f64().expect("mm"));
        let planes: Vec<f64> = planes.collect();
        assert!(planes.len() > 5 && planes.windows(2).all(|w| sign * (w[1] - w[0]) >= 0.0), "{order}: {planes:?}");
    }
}

#[test]
fn drawings_alone_do_not_set_the_zoom_optic_and_compile_says_so() {
    let dir = folder();
    let stl = dir.path().join("dome.stl");
    write_stl(&stl, &mesh(20, [150.0, 150.0, 200.0, 200.0], dome));
    // By terrace run, which the built-in machine assumes, job.ovf is not used.
    for (formats, is_warned) in [("[\"dxf\", \"linuxcnc\"]", true), ("[\"dxf\", \"ovf\"]", true), ("[\"ovf\"]", true)] {
        let text = JobText {
            machine: "profile = \"xyz-zoom-40\"".into(),
            more: format!("[emit]\nformats = {formats}\n"),
            ..JobText::on(&stl).texture("pattern = \"hatch\"\npitch = \"2 mm\"")
        };
        let job = text.write(dir.path(), "dome.toml");
        let output = terrace([Path::new("check"), &job]);
        let printed = said(&output).contains("focus-shift-lost");
        assert!(output.status.success() && printed == is_warned, "{formats}: {}", said(&output));
    }
}
