//! On-the-fly jobs by the program itself: compiled, read back, proved.

mod support;

use std::path::Path;
use std::process::Command;

use support::surfaces::{mesh, write_stl};
use support::{folder, said};

fn terrace(arguments: &[&str]) -> std::process::Output {
    Command::new(env!("CARGO_BIN_EXE_terrace")).args(arguments).output().expect("terrace runs")
}

fn job(dir: &Path, profile: &str, pdof: &str, speed: &str, pitch: &str, more: &str) -> String {
    let text = format!(
        "surface = {{ file = \"part.stl\", unit = \"mm\" }}\nfocus = {{ pdof = {pdof:?} }}\n{more}\
         partition = {{ method = \"z-range\" }}\nmachine = {{ profile = {profile:?} }}\n\
         [[texture]]\npattern = \"hatch\"\npitch = {pitch:?}\ndirection = \"10 deg\"\n\
         [[pen]]\nname = \"fine\"\nspeed = {speed:?}\npower = \"60 %\"\nfrequency = \"60 kHz\"\n"
    );
    let path = dir.join("job.toml");
    std::fs::write(&path, text).expect("write");
    path.display().to_string()
}

/// Compiles and proves a job; its summary and its proof.
fn proved(dir: &Path, job: &str) -> [serde_json::Value; 2] {
    let out = dir.join("made.job").display().to_string();
    let made = terrace(&["compile", "--mode", "on-the-fly", "--json", job, "-o", &out]);
    assert!(made.status.success(), "{}", said(&made));
    let proof = terrace(&["verify", "--json", &out]);
    assert!(proof.status.success(), "{}", said(&terrace(&["verify", &out])));
    let json = |o: &std::process::Output| serde_json::from_slice(&o.stdout).expect("JSON");
    let found: [serde_json::Value; 2] = [json(&made), json(&proof)];
    eprintln!("{}", found[0]);
    eprintln!("{} um, {} um", found[1]["worst_position_um"], found[1]["worst_defocus_um"]);
    found
}

#[test]
fn five_axes_are_compiled_and_proved() {
    let dir = folder();
    let dome = |x: f64, y: f64| -((x - 40.0).powi(2) + (y - 30.0).powi(2)) / 500.0;
    write_stl(&dir.path().join("part.stl"), &mesh(80, [0.0, 0.0, 80.0, 60.0], dome));
    let job = job(dir.path(), "xyz-galvo-40", "0.5 mm", "100 mm/s", "2 mm", "");
    let [summary, proof] = proved(dir.path(), &job);
    assert!(proof["worst_position_um"].as_f64().is_some_and(|p| p < 0.2), "{proof}");
    assert!(summary["laser_error_mm"].as_f64().is_some_and(|e| e > 0.0 && e < 0.11), "{summary}");
    let kept = std::fs::read_to_string(dir.path().join("made.job/manifest.json")).expect("a manifest");
    assert!(kept.contains("\"on-the-fly\""));
    // The same job on any number of threads.
    let bytes = || {
        ["fly.ngc", "fly.pmc", "manifest.json"]
            .map(|f| std::fs::read(dir.path().join("made.job").join(f)).expect("bytes"))
    };
    let first = bytes();
    let out = dir.path().join("made.job").display().to_string();
    assert!(terrace(&["compile", "-j", "1", "--mode", "on-the-fly", &job, "-o", &out]).status.success());
    assert!(first == bytes());
}

#[test]
fn seven_axes_are_compiled_and_proved() {
    let dir = folder();
    let bowl = |x: f64, y: f64| -0.25 * y - (x * x + y * y) / 200.0;
    write_stl(&dir.path().join("part.stl"), &mesh(60, [-8.0, -4.0, 8.0, 4.0], bowl));
    let job =
        job(dir.path(), "xyzac-galvo-10", "0.25 mm", "100 mm/s", "1 mm", "limits = { max_incidence = \"30 deg\" }\n");
    let [_, proof] = proved(dir.path(), &job);
    assert!(proof["worst_position_um"].as_f64().is_some_and(|p| p < 1.0), "{proof}");
}

#[test]
fn the_turntable_may_turn_over_its_pole_far_from_the_origin_of_the_file() {
    let dir = folder();
    // The top of a dome in the middle of the marks, 360 mm from the file's origin: C turns by half a turn there.
    let dome = |x: f64, y: f64| -((x - 300.0).powi(2) + (y - 200.0).powi(2)) / 500.0;
    write_stl(&dir.path().join("part.stl"), &mesh(60, [292.0, 196.0, 308.0, 204.0], dome));
    let job = job(dir.path(), "xyzac-galvo-10", "0.1 mm", "100 mm/s", "2 mm", "");
    let [_, proof] = proved(dir.path(), &job);
    assert!(proof["worst_position_um"].as_f64().is_some_and(|p| p < 1.0), "{proof}");
}

#[test]
fn what_on_the_fly_programs_cannot_do_is_refused() {
    let dir = folder();
    write_stl(&dir.path().join("part.stl"), &mesh(4, [0.0, 0.0, 8.0, 6.0], |_, _| 0.0));
    let job = job(dir.path(), "xyz-galvo-40", "0.5 mm", "100 mm/s", "2 mm", "passes = { count = 2 }\n");
    let out = terrace(&["compile", "--mode", "on-the-fly", &job]);
    assert_eq!(out.status.code(), Some(1), "{}", said(&out));
    assert!(said(&out).contains("fly-job"), "{}", said(&out));
    assert!(!dir.path().join("job.job").exists());
}
