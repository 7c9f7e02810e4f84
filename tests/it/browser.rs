//! `view.html` in a browser: every control, on jobs of every kind, against the manifest; the pictures of sample jobs
//! against those that are kept. `tests/browser` drives Chromium, which `setup.sh all` installs.

use std::path::{Path, PathBuf};
use std::process::Command;

use terrace_core::math;

use crate::support::image::height_map;
use crate::support::surfaces::{mesh, write_stl};
use crate::support::{JobText, fixture, folder, machine_file, manifest, said, terrace};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Runs a script of `tests/browser`; its lines where it fails.
fn node<'a>(script: &str, args: impl IntoIterator<Item = &'a Path>) {
    let script = root().join("tests/browser").join(script);
    let out = Command::new("node").arg(&script).args(args).output().expect("node is installed by setup.sh all");
    assert!(out.status.success(), "{}: {}", script.display(), said(&out));
}

fn compiled(job: &Path, mode: &str, out: PathBuf) -> PathBuf {
    let done = terrace([Path::new("compile"), job, Path::new("--mode"), Path::new(mode), Path::new("-o"), &out]);
    assert!(done.status.success(), "{}: {}", job.display(), said(&done));
    out
}

/// A hatch in three passes on a part that is marked in two set-ups.
fn passes_and_setups(dir: &Path) -> PathBuf {
    let stl = dir.join("dome.stl");
    let dome = |x: f64, y: f64| 0.5 - ((x - 90.0) / 225.0).powi(2) - ((y - 25.0) / 125.0).powi(2);
    write_stl(&stl, &mesh(40, [0.0, 0.0, 180.0, 50.0], dome));
    let mut job = JobText::on(&stl).texture("pattern = \"hatch\"\npitch = \"4 mm\"").method("z-range");
    job.more = "[passes]\ncount = 3\nrotate = \"67 deg\"\nlower = \"8 um\"\n\n[setups]\nregistration = [[\"3 mm\", \"5 mm\"], \
        [\"60 mm\", \"5 mm\"], [\"120 mm\", \"5 mm\"], [\"177 mm\", \"5 mm\"], [\"3 mm\", \"45 mm\"], [\"60 mm\", \"45 mm\"], \
        [\"120 mm\", \"45 mm\"], [\"177 mm\", \"45 mm\"]]\n"
        .into();
    let text = machine_file("xyz-galvo-40").replace("250 mm", "62.5 mm").replace("\"40 mm\"", "\"25 mm\"");
    std::fs::write(dir.join("machine.txt"), text).expect("a writable folder");
    job.machine = "file = \"machine.txt\"".into();
    job.write(dir, "passes.toml")
}

/// A hatch under a head that tilts, on a part with a flank along one side that is too steep to be marked.
fn tilted_head(dir: &Path) -> PathBuf {
    let stl = dir.join("flank.stl");
    let dome = |x: f64, y: f64| 6.0 - ((x - 25.0) / 12.0).powi(2) - ((y - 20.0) / 18.0).powi(2);
    let facets = [
        mesh(50, [0.0, 0.0, 50.0, 40.0], dome),
        mesh(50, [50.0, 0.0, 70.0, 40.0], |x, y| dome(50.0, y) - 2.2 * (x - 50.0)),
    ];
    write_stl(&stl, &facets.concat());
    let mut job = JobText::on(&stl).texture("pattern = \"hatch\"\npitch = \"1 mm\"").method("tilt");
    job.focus = "pdof = \"0.3 mm\"".into();
    job.machine = "profile = \"xyz-headtilt-galvo-40\"".into();
    job.write(dir, "headtilt.toml")
}

#[test]
#[ignore = "slow"]
fn every_control_of_the_view_works_in_a_browser_and_shows_what_the_manifest_says() {
    let dir = folder();
    let at = |name: &str| dir.path().join(name);
    let text = std::fs::read_to_string(fixture("method.toml")).expect("a fixture").replace("\"contour\"", "\"tilt\"");
    let text = text.replace("hood.stl", &fixture("hood.stl").display().to_string());
    std::fs::write(at("tilt.toml"), text).expect("a writable folder");
    let started = terrace([Path::new("init"), &at("try")]);
    assert!(started.status.success(), "{}", said(&started));
    let passes = compiled(&passes_and_setups(dir.path()), "stepped", at("passes.job"));
    let found = manifest(&passes);
    assert_eq!((&found["summary"]["passes"], &found["summary"]["setups"]), (&3.into(), &2.into()));
    let jobs = [
        compiled(&fixture("hood.toml"), "stepped", at("hood.job")),
        compiled(&at("tilt.toml"), "stepped", at("tilt.job")),
        passes,
        compiled(&tilted_head(dir.path()), "stepped", at("headtilt.job")),
        compiled(&at("try/job.toml"), "on-the-fly", at("try.fly.job")),
    ];
    node("view.mjs", jobs.iter().map(PathBuf::as_path));
}

/// A level plate with a texture of its own, compiled.
fn plate(dir: &Path, name: &str, texture: &str, pen: &str) -> PathBuf {
    let stl = dir.join("plate.stl");
    write_stl(&stl, &mesh(2, [0.0, 0.0, 60.0, 45.0], |_, _| 2.0));
    let mut job = JobText::on(&stl).texture(texture);
    // Keys of the pen, which is the last table.
    job.more = pen.into();
    compiled(&job.write(dir, &format!("{name}.toml")), "stepped", dir.join(format!("{name}.job")))
}

#[test]
#[ignore = "slow"]
fn texture_is_seen_at_every_zoom() {
    let dir = folder();
    let blobs: Vec<u16> = (0..82 * 112)
        .map(|i| (f64::from(i % 112), f64::from(i / 112)))
        .map(|(x, y)| 0.5 + 0.25 * math::sin(x / 5.0) * math::cos(y / 7.0) + 0.25 * math::sin((x + 2.0 * y) / 11.0))
        .map(|grey| (grey * 65_535.0) as u16)
        .collect();
    std::fs::write(dir.path().join("blobs.png"), height_map(112, &blobs)).expect("a writable folder");
    let leather = fixture("leather.svg").display().to_string();
    let filled = |area: &str| format!("file = {leather:?}\narea = {area}\ntile = true\nfill = \"hatch\"");
    let jobs = [
        plate(dir.path(), "leather", &filled("[\"2 mm\", \"2 mm\", \"58 mm\", \"43 mm\"]"), ""),
        plate(
            dir.path(),
            "fss",
            "pattern = \"jerusalem\"\npitch = \"3 mm\"\ncell = \"2.4 mm\"\nwidth = \"0.1 mm\"\nbar = \"0.9 mm\"",
            "",
        ),
        plate(dir.path(), "hatch", "pattern = \"hatch\"\npitch = \"0.2 mm\"\ndirection = \"20 deg\"", ""),
        plate(
            dir.path(),
            "halftone",
            "file = \"blobs.png\"\nsize = [\"22.4 mm\", \"16.4 mm\"]\nscreen = \"halftone\"\npitch = \"0.025 mm\"\n\
             period = \"0.2 mm\"\narea = [\"2 mm\", \"2 mm\", \"24 mm\", \"18 mm\"]",
            "dwell = \"100 us\"\n",
        ),
    ];
    node("zooms.mjs", jobs.iter().map(PathBuf::as_path));
}

#[test]
#[ignore = "slow"]
fn a_million_marks_are_seen_as_tone() {
    let dir = folder();
    let stl = dir.path().join("panel.stl");
    write_stl(&stl, &mesh(2, [0.0, 0.0, 240.0, 220.0], |_, _| 2.0));
    let leather = fixture("leather.svg").display().to_string();
    let texture = format!(
        "file = {leather:?}\narea = [\"2 mm\", \"2 mm\", \"238 mm\", \"218 mm\"]\ntile = true\nfill = \"hatch\""
    );
    let job = JobText::on(&stl).texture(&texture).write(dir.path(), "panel.toml");
    let out = compiled(&job, "stepped", dir.path().join("panel.job"));
    assert!(manifest(&out)["summary"]["fragments"].as_u64().is_some_and(|n| n > 1_000_000));
    node("zooms.mjs", [out.as_path(), Path::new("--tone")]);
}

#[test]
#[ignore = "slow"]
fn a_page_of_two_jobs_has_one_camera() {
    let dir = folder();
    let pitches = ["1 mm", "2 mm"].map(|pitch| format!("pattern = \"hatch\"\npitch = \"{pitch}\""));
    let jobs = [("before", &pitches[0]), ("after", &pitches[1])].map(|(name, t)| plate(dir.path(), name, t, ""));
    let page = dir.path().join("both.html");
    let done = terrace([Path::new("diff"), &jobs[0], &jobs[1], Path::new("-o"), &page]);
    assert!(done.status.success(), "{}", said(&done));
    node("both.mjs", [page.as_path()]);
}

#[test]
#[ignore = "slow"]
fn pictures_of_the_view_are_those_that_are_kept() {
    let dir = folder();
    node("sample.mjs", [dir.path()]);
    let golden = root().join("tests/browser/golden");
    let samples = ["demo", "tilt", "passes", "fly"].map(|name| dir.path().join(format!("sample-{name}")));
    let args = [Path::new("--pictures"), Path::new("--golden"), &golden]
        .into_iter()
        .chain(samples.iter().map(PathBuf::as_path));
    node("view.mjs", args);
}

#[test]
#[ignore = "slow"]
fn scripts_of_the_view_have_the_types_that_they_state() {
    let tsc = root().join(".venv/browser/node_modules/.bin/tsc");
    let out = Command::new(tsc)
        .arg("-p")
        .arg(root().join("crates/report/src/view/page"))
        .output()
        .expect("installed by setup.sh all");
    assert!(out.status.success(), "{}", said(&out));
}
