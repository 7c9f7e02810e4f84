//! `terrace orient`: the fixture angle that it finds saves stops, and its estimates agree with the compiled job.

use std::path::Path;
use terrace_core::math;

use crate::support::surfaces::{mesh, write_stl};
use crate::support::{JobText, compile, folder, number};
use serde_json::Value;

fn orientations(job: &Path) -> Vec<Value> {
    let out = crate::support::terrace([Path::new("orient"), job, Path::new("--json")]);
    assert!(out.status.success(), "{}", crate::support::said(&out));
    let found: Value = serde_json::from_slice(&out.stdout).expect("JSON");
    found["orientations"].as_array().expect("a list").clone()
}

/// The same point on a part that is turned about y, then about x, degrees.
fn leaned([x, y, z]: [f64; 3], [about_x, about_y]: [f64; 2]) -> [f64; 3] {
    let (s, c) = math::sin_cos(about_y.to_radians());
    let (x, z) = (x * c + z * s, z * c - x * s);
    let (s, c) = math::sin_cos(about_x.to_radians());
    [x, y * c - z * s, y * s + z * c]
}

#[test]
#[ignore = "slow: make test-all"]
fn orient_levels_a_slope_and_the_compiled_job_agrees() {
    let dir = folder();
    let stl = dir.path().join("slope.stl");
    // A bulge on a slope of several degrees.
    let form = |x: f64, y: f64| 0.08 * x - 0.05 * y + 0.4 * math::sin(x / 40.0) * math::sin(y / 40.0);
    let facets = mesh(120, [0.0, 0.0, 150.0, 110.0], form);
    write_stl(&stl, &facets);
    let job = JobText::on(&stl).texture("pattern = \"hatch\"\npitch = \"0.5 mm\"").method("z-range");
    let file = job.write(dir.path(), "job.toml");
    let found = orientations(&file);
    assert_eq!(found[0]["name"], "as placed");
    let as_it_lies = number(&compile(&file, &dir.path().join("flat.job")), "stops");
    let estimate = number(&found[0], "stops");
    assert!((estimate - as_it_lies).abs() <= 0.05 * as_it_lies, "{estimate} {as_it_lies}");
    assert!(found[1..].windows(2).all(|w| number(&w[0], "stage_s") <= number(&w[1], "stage_s")));
    assert!(found[1..].iter().all(|w| number(w, "stage_s") <= number(&found[0], "stage_s")));

    let leaning = found.iter().find(|w| w["name"] == "tilted fixture").expect("one tilted set-up");
    let lean = [0, 1].map(|k| leaning["set_ups"][0]["lean_deg"][k].as_f64().expect("degrees"));
    assert!(lean[0] > 1.0 && lean[1] > 2.0, "{lean:?}");
    let turned: Vec<[[f64; 3]; 3]> = facets.iter().map(|f| f.map(|p| leaned(p, lean))).collect();
    write_stl(&stl, &turned);
    let really = number(&compile(&file, &dir.path().join("leaning.job")), "stops");
    let estimate = number(leaning, "stops");
    eprintln!("{as_it_lies} stops as placed, {really} at {lean:?} deg, estimated {estimate}");
    // The texture's box grows with the angle, which may add a row of sections.
    assert!(really <= 0.5 * as_it_lies && (estimate - really).abs() <= 0.2 * really, "{estimate} {really}");
}

#[test]
fn orient_leaves_a_level_plate_unchanged() {
    let dir = folder();
    let stl = dir.path().join("plate.stl");
    write_stl(&stl, &mesh(10, [0.0, 0.0, 90.0, 70.0], |_, _| 3.0));
    let job = JobText::on(&stl).texture("pattern = \"hatch\"\npitch = \"1 mm\"");
    let found = orientations(&job.write(dir.path(), "job.toml"));
    for way in &found {
        for set_up in way["set_ups"].as_array().expect("a list") {
            assert_eq!([&set_up["lean_deg"][0], &set_up["lean_deg"][1]], [0.0, 0.0], "{way}");
        }
    }
    assert_eq!(number(&found[0], "stops"), 6.0);
}
