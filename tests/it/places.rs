//! Where stops stand: marks about the axis, the part in the middle of the travel, moves that share coordinates, and
//! what the summary tells of it.

use std::path::Path;
use terrace_core::math;

use serde_json::Value;
use tempfile::TempDir;

use crate::support::surfaces::{Height, dome, mesh, saddle, wing, write_stl};
use crate::support::{JobText, ONE_FILE, compile, folder, machine_file, manifest, number, summary_of, verify};

/// A hatch of this pitch on a surface.
fn job(dir: &TempDir, height: Height, size: f64, pitch: &str) -> JobText {
    let stl = dir.path().join("part.stl");
    write_stl(&stl, &mesh(60, [0.0, 0.0, size, size], height));
    JobText::on(&stl).method("auto").texture(&format!("pattern = \"hatch\"\npitch = \"{pitch}\""))
}

/// The same with a machine file of its own.
fn with_machine(mut job: JobText, dir: &Path, edit: impl Fn(&str) -> String) -> JobText {
    let text = machine_file("xyz-galvo-40");
    let changed = edit(&text);
    assert_ne!(changed, text);
    std::fs::write(dir.join("machine.toml"), changed).expect("a writable folder");
    job.machine = "file = \"machine.toml\"".into();
    job
}

fn off_axis(summary: &Value) -> [f64; 2] {
    ["largest", "p95"].map(|key| number(&summary["off_axis_mm"], key))
}

/// Sizes of the box of all stops along x, y and z, mm.
fn travel(folder: &Path) -> [f64; 3] {
    let manifest = manifest(folder);
    let blocks = manifest["blocks"].as_array().expect("blocks");
    [0, 1, 2].map(|k| {
        let at = || blocks.iter().map(|b| b["stage"][k].as_f64().expect("a number"));
        at().fold(f64::NEG_INFINITY, f64::max) - at().fold(f64::INFINITY, f64::min)
    })
}

#[test]
fn a_job_that_fits_one_field_is_marked_about_the_axis() {
    let dir = folder();
    let mut job = job(&dir, |_, _| 0.0, 17.3, "1 mm");
    job.more = ONE_FILE.into();
    let job = job.write(dir.path(), "a.toml");
    let folder = dir.path().join("a.job");
    let summary = compile(&job, &folder);
    assert_eq!(number(&summary, "stops"), 1.0);
    // Lines from x = 0 to 17.3 mm, at y = 0 to 17 mm.
    let texture = &manifest(&folder)["blocks"][0];
    let centre = [0, 1].map(|k| texture["centre_mm"][k].as_f64().expect("a number"));
    assert!((centre[0] - 8.65).abs() <= 1e-3 && (centre[1] - 8.5).abs() <= 1e-3, "{centre:?}");
    let [largest, _] = off_axis(&summary);
    assert!((largest - math::hypot(8.65f64, 8.5)).abs() <= 1e-3, "{largest}");
    verify(&folder);
}

#[test]
#[ignore = "slow: make test-all"]
fn the_part_lies_where_its_stops_are_in_the_middle_of_the_travel_unless_it_is_stated() {
    let dir = folder();
    let mut job = job(&dir, dome, 450.0, "7 mm");
    job.more = ONE_FILE.into();
    let path = job.write(dir.path(), "a.toml");
    let folder = dir.path().join("a.job");
    compile(&path, &folder);
    let [x, y, _] = travel(&folder);
    assert!(x <= 425.0 && y <= 425.0, "{x} {y}");
    let stops = |k: usize| {
        let manifest = manifest(&folder);
        let at: Vec<f64> = manifest["blocks"]
            .as_array()
            .expect("blocks")
            .iter()
            .map(|b| b["stage"][k].as_f64().expect("mm"))
            .collect();
        at.iter().copied().fold(f64::INFINITY, f64::min) + at.iter().copied().fold(f64::NEG_INFINITY, f64::max)
    };
    // Travel is from -250 to 250 mm; sums of the ends are 0 but for the increment.
    assert!(stops(0).abs() < 1e-3 && stops(1).abs() < 1e-3, "{} {}", stops(0), stops(1));
    verify(&folder);
    // A travel of the stops' size is enough.
    let short = format!("[\"-{0} mm\", \"{0} mm\"]", (x.max(y) / 2.0 + 0.01).min(212.5));
    let job = with_machine(job, dir.path(), |text| text.replace("[\"-250 mm\", \"250 mm\"]", &short));
    let path = job.write(dir.path(), "short.toml");
    assert!(number(&summary_of(&path), "stops") > 100.0);
}

#[test]
#[ignore = "slow: make test-all"]
fn moves_share_coordinates_and_diagonals_save_more() {
    for height in [dome as Height, saddle, wing] {
        let dir = folder();
        let plain = job(&dir, height, 450.0, "5 mm").write(dir.path(), "a.toml");
        let diagonal = with_machine(job(&dir, height, 450.0, "5 mm"), dir.path(), |text| {
            text.replacen("settle = \"0.1 s\"", "diagonal = true\nsettle = \"0.1 s\"", 1)
        });
        let diagonal = diagonal.write(dir.path(), "b.toml");
        let [plain, diagonal] = [plain, diagonal].map(|path| number(&summary_of(&path)["time_s"], "stage"));
        assert!(diagonal < 0.95 * plain, "{diagonal} {plain}");
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn settling_by_axis_counts_what_has_moved() {
    let dir = folder();
    let job = || job(&dir, dome, 200.0, "5 mm");
    let settle = |text: &str| {
        let text = text.to_owned();
        let job = with_machine(job(), dir.path(), |m| m.replacen("settle = \"0.1 s\"", &text, 1));
        let path = job.write(dir.path(), "a.toml");
        let folder = dir.path().join("a.job");
        let summary = compile(&path, &folder);
        verify(&folder);
        (number(&summary["time_s"], "settle"), number(&summary, "stops"), folder)
    };
    let (one, stops, _) = settle("settle = \"0.2 s\"");
    // A stop over the place and in the focal plane of the one before is not a move.
    assert!(one <= 0.2 * stops + 1e-6 && one > 0.195 * stops, "{one} for {stops} stops");
    let (two, stops, folder) = settle("settle = { xy = \"0.2 s\", z = \"0.06 s\" }");
    assert!(two > 0.06 * stops && two < 0.2 * stops, "{two} for {stops} stops");
    let program = std::fs::read_to_string(folder.join("stage.ngc")).expect("a program");
    let [short, long] = ["G4 P0.060\n", "G4 P0.200\n"].map(|dwell| program.matches(dwell).count());
    assert_eq!((short + long) as f64, stops);
    let dwelt = 0.06 * short as f64 + 0.2 * long as f64;
    assert!(two <= dwelt + 0.2 && two > 0.97 * dwelt, "{short} {long} {two}");
}

#[test]
fn errors_by_distance_are_those_at_the_farthest_mark() {
    let dir = folder();
    let job = with_machine(job(&dir, |_, _| 0.0, 17.3, "1 mm"), dir.path(), |text| {
        let list = "[[\"0 mm\", \"1 um\"], [\"10 mm\", \"3 um\"], [\"28.3 mm\", \"30 um\"]]";
        text.replacen("spot =", &format!("field_residual = {list}\nspot ="), 1)
    });
    let summary = summary_of(&job.write(dir.path(), "a.toml"));
    let [largest, _] = off_axis(&summary);
    assert!((11.0..12.3).contains(&largest), "{largest}");
    let wanted = 3.0 + 27.0 * (largest - 10.0) / 18.3;
    let terms = summary["budget"]["lateral"]["terms"].as_array().expect("terms");
    let term = terms.iter().find(|t| t["cause"] == "field_residual").expect("a term");
    assert!((number(term, "um") - wanted).abs() < 1e-6, "{term} {wanted}");
}
