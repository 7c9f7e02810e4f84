//! Textures that reach the border of a part that is turned: the part and its texture are rounded to the grid
//! apart, and nothing of the border may be lost by that.

use std::path::Path;

use crate::support::surfaces::{Random, mesh, write_stl};
use crate::support::{JobText, compile, folder, number, verify};
use serde_json::Value;

/// The least length that a summary may lose to the grid, mm.
const FEW_NM: f64 = 5e-6;

/// A plate with many corners along its border, away from the origin.
fn plate(dir: &Path, tilted: f64) -> std::path::PathBuf {
    let path = dir.join("plate.stl");
    write_stl(&path, &mesh(7, [3.7, -11.3, 33.9, 8.6], |x, y| tilted * (0.02 * x - 0.01 * y)));
    path
}

fn marked(dir: &Path, texture: &str, turn: f64, more: &str) -> Value {
    let mut job = JobText::on(&plate(dir, 1.0)).texture(texture).method("z-range");
    job.focus = "pdof = \"2 mm\"".into();
    job.more = format!("[placement]\nturn = \"{turn} deg\"\n{more}");
    let out = dir.join("turned.job");
    let summary = compile(&job.write(dir, "job.toml"), &out);
    verify(&out);
    summary
}

const TEXTURES: [&str; 5] = [
    "pattern = \"hilbert\"\norder = 6",
    "pattern = \"hatch\"\npitch = \"0.995 mm\"",
    "pattern = \"hatch\"\npitch = \"1.51 mm\"\ndirection = \"90 deg\"",
    "pattern = \"hatch\"\npitch = \"0.7 mm\"\ndirection = \"33 deg\"",
    // Cells that fill the plate along y: their sides lie on its border.
    "pattern = \"squares\"\npitch = \"1.99 mm\"\ncell = \"1.99 mm\"",
];

#[test]
#[ignore = "slow: make test-all"]
fn a_texture_that_reaches_the_border_is_marked_whole_at_any_turn() {
    let dir = folder();
    let mut noise = Random::new(3);
    let mut turns = vec![0.0, 17.3, 90.0, -45.001];
    turns.extend((0..6).map(|_| (noise.half() * 360.0 * 1e3).round() / 1e3));
    for turn in turns {
        for texture in TEXTURES {
            let summary = marked(dir.path(), texture, turn, "");
            let lost = number(&summary, "skipped_off_part_mm");
            assert!(lost <= FEW_NM, "{texture} at {turn} deg: {lost} mm lost");
            assert_eq!(number(&summary, "strokes_cut"), 0.0, "{texture} at {turn} deg: {summary}");
            assert_eq!(number(&summary, "figures_cut"), 0.0, "{texture} at {turn} deg: {summary}");
        }
    }
}

/// A drawing may lie off the part as a whole.
const ALL_OFF: &str = "\n[limits]\nmax_off_part = \"100 %\"\n";

#[test]
#[ignore = "slow: make test-all"]
fn marks_beside_the_part_are_skipped() {
    let dir = folder();
    for turn in [0.0, 17.3, 200.02] {
        for (beside, is_lost) in [(0.000_000, false), (0.000_004, true), (0.01, true)] {
            // One line next to the lower border, as far as it goes, in pieces.
            let y = -11.3 - beside;
            let points: String = (0..=40).map(|i| format!("{},{} ", f64::from(i) * 0.5, 0)).collect();
            let svg = format!(
                "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"20mm\" height=\"1mm\" viewBox=\"0 -1 20 1\">\
                 <polyline fill=\"none\" stroke=\"black\" stroke-width=\"0.001\" points=\"{points}\"/></svg>"
            );
            std::fs::write(dir.path().join("line.svg"), svg).expect("a writable folder");
            let texture =
                format!("file = \"line.svg\"\norigin = [\"8 mm\", \"{y:.6} mm\"]\n\n[[texture]]\n{}", TEXTURES[3]);
            let lost = number(&marked(dir.path(), &texture, turn, ALL_OFF), "skipped_off_part_mm");
            let want = if is_lost { 20.0 } else { 0.0 };
            assert!((lost - want).abs() <= FEW_NM, "{beside} mm beside the part at {turn} deg: {lost} mm lost");
        }
    }
}
