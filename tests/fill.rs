//! `direction = "contour"`: hatch along the level lines in each section.

mod support;

use std::path::Path;

use serde_json::Value;
use support::surfaces::{dome, mesh, saddle, wing, write_stl};
use support::{JobText, assert_balance, compile, folder, number, verify};

type Shape = fn(f64, f64) -> f64;

/// The part of the counts, 450 x 450 mm in half a million facets.
fn part(dir: &Path, shape: Shape) -> std::path::PathBuf {
    let stl = dir.join("part.stl");
    write_stl(&stl, &mesh(500, [0.0, 0.0, 450.0, 450.0], shape));
    stl
}

fn hatch(direction: &str) -> String {
    format!("pattern = \"hatch\"\npitch = \"0.5 mm\"\ndirection = \"{direction}\"")
}

#[test]
fn fragments_fall_to_a_quarter_and_the_length_stays() {
    for (name, shape) in [("dome", dome as Shape), ("saddle", saddle), ("wing", wing)] {
        let dir = folder();
        let stl = part(dir.path(), shape);
        let run = |direction: &str| {
            let job = JobText::on(&stl).texture(&hatch(direction)).write(dir.path(), "job.toml");
            let out = dir.path().join("out.job");
            let summary = compile(&job, &out);
            assert_balance(&summary, &verify(&out));
            summary
        };
        let (along_x, contour) = (run("0 deg"), run("contour"));
        let ratio = |key: &str| number(&contour, key) / number(&along_x, key);
        eprintln!("{name}: fragments {} {} length {} stops {} {}", number(&contour, "fragments"), ratio("fragments"), ratio("mark_mm"), number(&contour, "stops"), number(&along_x, "stops"));
        assert!(ratio("fragments") <= 0.25, "{name}: {}", ratio("fragments"));
        assert!((ratio("mark_mm") - 1.0).abs() <= 0.01, "{name}: {}", ratio("mark_mm"));
    }
}
