//! Seven axes on the part of `fixtures/anchors/seven_axis.json`: how strongly its mesh lets the path be smoothed, and the
//! following errors of its axes.

use std::path::Path;
use terrace_core::math;

use crate::support::surfaces::{mesh, write_stl};
use crate::support::{JobText, fixture, folder, number, said, terrace, verify};
use serde_json::Value;

/// The stored figures.
fn anchors() -> Value {
    let text = std::fs::read_to_string(fixture("anchors/seven_axis.json")).expect("the stored part");
    serde_json::from_str(&text).expect("JSON")
}

/// Compares systems on a mesh of the stored part, 50 x 50 mm in facets of half a millimetre, under a Hilbert curve over
/// 40 x 40 mm.
fn compared(anchors: &Value, order: u32, systems: &str) -> Value {
    let surface = &anchors["surface"];
    let of = |v: &Value| v.as_f64().expect("a number");
    let hills: Vec<[f64; 4]> = (0..3)
        .map(|i| [of(&surface["a"][i]), of(&surface["s"][i]), of(&surface["m"][i][0]), of(&surface["m"][i][1])])
        .collect();
    let base = number(surface, "c0");
    let z = |x: f64, y: f64| {
        let hill = |&[a, s, p, q]: &[f64; 4]| a * math::exp(-((x - p).powi(2) + (y - q).powi(2)) / (2.0 * s * s));
        base + hills.iter().map(hill).sum::<f64>()
    };
    let dir = folder();
    let stl = dir.path().join("part.stl");
    write_stl(&stl, &mesh(100, [-25.0, -25.0, 25.0, 25.0], z));
    let area = "area = [\"-20 mm\", \"-20 mm\", \"20 mm\", \"20 mm\"]";
    let mut job = JobText::on(&stl).texture(&format!("pattern = \"hilbert\"\norder = {order}\n{area}"));
    job.machine = "profile = \"xyzac-galvo-10\"".into();
    // A focal offset of 100 um, as in the article.
    job.focus = "pdof = \"0.2 mm\"".into();
    job.more = "[limits]\nmax_incidence = \"60 deg\"\n".into();
    let job = job.write(dir.path(), "job.toml");
    let out = terrace([Path::new("compare"), &job, Path::new("--systems"), Path::new(systems), Path::new("--json")]);
    assert!(out.status.success(), "{}", said(&out));
    serde_json::from_slice(&out.stdout).expect("JSON")
}

#[test]
#[ignore = "slow: make test-all"]
fn back_off_search_on_a_mesh_ends_at_the_rung_of_the_analytic_surface() {
    let anchors = anchors();
    let found = compared(&anchors, 8, "7-axis");
    let trials = found["back_off"].as_array().expect("trials");
    // Sigma in um, worst focal offset in mm, incidence in deg, displacement in mm.
    let stored = anchors["back_off"].as_array().expect("trials");
    let sigma = |k: usize| stored[k][0].as_f64().expect("a number");
    let rung = number(trials.last().expect("trials"), "sigma_um");
    let ratio = rung / sigma(stored.len() - 1);
    assert!((0.9499..1.0527).contains(&ratio), "{rung} um is more than one step from the analytic surface's");
    for (trial, want) in trials.iter().zip(stored) {
        let near = |key: &str, k: usize, off: f64| {
            let (found, want) = (number(trial, key), want[k].as_f64().expect("a number"));
            assert!((found - want).abs() < off, "{key}: {found} for {want} in {trial}");
        };
        near("sigma_um", 0, 1e-6);
        // A quarter of what a step of the search changes.
        near("worst_bia_deg", 2, 0.05);
        near("worst_displacement_mm", 3, 0.014);
        // The middles of facets lie up to 4 um below the hills: their diagonal squared times the bend, by 8.
        let off = number(trial, "worst_fod_um") - 1e3 * want[1].as_f64().expect("a number");
        assert!(off.abs() < 4.0, "{off} um in {trial}");
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn mean_following_errors_fall_as_mean_speeds_do() {
    let found = compared(&anchors(), 6, "7-axis,5-axis");
    let time = |name: &str| {
        let systems = found["systems"].as_array().expect("systems");
        number(systems.iter().find(|s| s["system"] == name).expect("a row"), "total_s")
    };
    let times = time("5-axis") / time("7-axis");
    let rows = found["following_errors"].as_array().expect("rows");
    assert_eq!(rows.len(), 7);
    for row in &rows[..5] {
        let ways = number(row, "way") / number(row, "5_axis_way");
        let want = 100.0 * (1.0 - ways * times);
        assert!((number(row, "fall_by_mean_speed_percent") - want).abs() < 1e-6, "{row}");
        assert!((number(row, "fall_of_mean_percent") / want - 1.0).abs() < 0.05, "{want} {row}");
        assert!(number(row, "mean") < number(row, "worst"), "{row}");
    }
    // With five axes the scanner rests.
    assert!(rows[5..].iter().all(|row| row["5_axis_mean"].is_null() && number(row, "mean") > 0.0), "{rows:?}");
}

#[test]
#[ignore = "slow: make test-all"]
fn skywriting_marks_the_same_and_verifies_and_a_stepped_job_says_that_it_is_not_carried() {
    let dir = folder();
    let stl = dir.path().join("part.stl");
    write_stl(&stl, &mesh(20, [0.0, 0.0, 16.0, 12.0], |x, y| 0.3 * math::sin(x / 8.0) * math::cos(y / 7.0)));
    let made = |skywriting: &str| {
        let mut job = JobText::on(&stl)
            .texture("pattern = \"hatch\"\npitch = \"1.5 mm\"\narea = [\"4 mm\", \"3 mm\", \"12 mm\", \"9 mm\"]");
        job.machine = "profile = \"xyzac-galvo-10\"".into();
        job.focus = "pdof = \"0.2 mm\"".into();
        let path = job.write(dir.path(), "job.toml");
        let text = std::fs::read_to_string(&path).expect("a job");
        let speed = "speed = \"1000 mm/s\"";
        assert!(text.contains(speed), "{text}");
        std::fs::write(&path, text.replace(speed, &format!("speed = \"100 mm/s\"\nskywriting = {skywriting}")))
            .expect("written");
        path
    };
    let marked = |skywriting: &str| {
        let out = dir.path().join(skywriting);
        let job = made(skywriting);
        let run =
            terrace([Path::new("compile"), &job, Path::new("--mode"), Path::new("on-the-fly"), Path::new("-o"), &out]);
        assert!(run.status.success(), "{}", said(&run));
        let proof = verify(&out);
        number(&proof, "mark_mm")
    };
    assert!((marked("true") - marked("false")).abs() < 1e-3);
    let stepped = terrace([Path::new("check"), &made("true")]);
    assert!(said(&stepped).contains("warning[skywriting-lost]"), "{}", said(&stepped));
    // Without seven axes nothing carries it either.
    let job = made("true");
    let text = std::fs::read_to_string(&job).expect("a job").replace("xyzac-galvo-10", "xyz-galvo-40");
    std::fs::write(&job, text).expect("written");
    let upright = terrace([Path::new("check"), &job, Path::new("--mode"), Path::new("on-the-fly")]);
    assert!(said(&upright).contains("which is for seven axes"), "{}", said(&upright));
}
