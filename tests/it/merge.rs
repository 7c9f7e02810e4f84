//! Stops merged where one box holds what two of them mark, and slivers that are left out.

use std::path::{Path, PathBuf};
use terrace_core::math;

use serde_json::Value;

use crate::support::surfaces::{mesh, write_stl};
use crate::support::{JobText, assert_balance, compile, fixture, folder, number, summary_of, verify};

/// Compiled and verified; the summary and the proof.
fn made(job: &Path, dir: &Path) -> (Value, Value) {
    let out = dir.join("merge.job");
    let summary = compile(job, &out);
    let proof = verify(&out);
    assert_balance(&summary, &proof);
    (summary, proof)
}

/// What the panel and the other fixtures took at the last commit without mergers (046a905): stops and time, s.
const PANEL: (f64, f64) = (279.0, 80.272);
const HOOD: (f64, f64) = (3900.0, 756.300);
const METHOD: (f64, f64) = (76.0, 31.763);

#[test]
#[ignore = "slow: make test-all"]
fn a_panel_with_three_pens_takes_15_percent_fewer_stops_in_no_more_time() {
    let dir = folder();
    let (summary, _) = made(&fixture("aerofoil.toml"), dir.path());
    let (stops, total) = (number(&summary, "stops"), number(&summary["time_s"], "total"));
    eprintln!("{stops} stops, {total} s, {} merged", summary["stops_merged"]);
    assert!(stops <= 0.85 * PANEL.0, "{stops} stops");
    assert!(total <= PANEL.1, "{total} s");
    assert!(number(&summary, "lower_bound_stops") <= stops);
}

fn no_worse(name: &str, (stops, total): (f64, f64)) {
    let summary = summary_of(&fixture(name));
    let now = (number(&summary, "stops"), number(&summary["time_s"], "total"));
    assert!(now.0 <= stops && now.1 <= total, "{name}: {now:?} instead of {stops} stops, {total} s");
}

#[test]
fn a_method_of_the_article_keeps_its_stops() {
    no_worse("method.toml", METHOD);
    assert_eq!(summary_of(&fixture("method.toml"))["stops_merged"], 0);
}

#[test]
#[ignore = "slow: make test-all"]
fn a_hood_takes_no_more_stops() {
    no_worse("hood.toml", HOOD);
}

/// Dots of 0.4 mm on a wave: most stops have a few of them.
fn dots(dir: &Path, partition: &str, more: &str) -> PathBuf {
    let stl = dir.join("wave.stl");
    write_stl(&stl, &mesh(40, [0.0, 0.0, 130.0, 90.0], |x, y| 0.4 * math::sin(x / 19.0) * math::cos(y / 17.0)));
    let mut job = JobText::on(&stl)
        .texture("pattern = \"circles\"\ncell = \"0.4 mm\"\npitch = \"9 mm\"")
        .texture("pattern = \"hatch\"\npitch = \"17 mm\"\ndirection = \"30 deg\"")
        .method("auto")
        .partition(partition);
    job.more = format!("[emit]\nformats = [\"ovf\"]\n{more}");
    job.write(dir, "dots.toml")
}

#[test]
#[ignore = "slow: make test-all"]
fn mergers_hold_with_every_kind_of_seam_pass_and_setup() {
    let dir = folder();
    let passes = "[passes]\ncount = 2\nlower = \"5 um\"\n";
    let mut all = 0.0;
    for (partition, more) in [
        ("", ""),
        ("overlap = \"0.05 mm\"", passes),
        ("zone = \"2 mm\"\nhysteresis = \"5 um\"", ""),
        ("keep_whole = \"1 mm\"", "[order]\nstops = \"z-up\"\n"),
        ("section = \"21 mm\"", "[order]\nstrokes = \"drawing\"\n"),
        ("min_mark = \"0.2 mm\"", ""),
    ] {
        let (summary, _) = made(&dots(dir.path(), partition, more), dir.path());
        let [stops, merged, least] = ["stops", "stops_merged", "lower_bound_stops"].map(|key| number(&summary, key));
        eprintln!("{partition} {more}: {stops} stops, {merged} merged, at least {least}");
        assert!(least <= stops, "{partition} {more}: {summary}");
        all += f64::from(u8::from(merged > 0.0));
    }
    // What is kept in the end may be a method that needs no mergers.
    assert!(all >= 4.0, "{all} of 6 jobs have merged stops");
}

#[test]
fn slivers_below_half_a_spot_are_left_out_unless_the_job_says_otherwise() {
    let dir = folder();
    // A wide spot and many cuts; every figure drawn is shorter than half the spot.
    let stl = dir.path().join("slope.stl");
    write_stl(
        &stl,
        &mesh(20, [0.0, 0.0, 60.0, 50.0], |x, y| 0.03 * x + 0.9 * math::sin(x / 11.0) * math::cos(y / 14.0)),
    );
    let machine = crate::support::machine_file("xyz-galvo-40").replace("spot = \"0.02 mm\"", "spot = \"0.4 mm\"");
    std::fs::write(dir.path().join("machine.toml"), machine).expect("a writable folder");
    let job = |partition: &str| {
        let mut job = JobText::on(&stl)
            .texture("pattern = \"hatch\"\npitch = \"2 mm\"\ndirection = \"20 deg\"")
            .texture("pattern = \"circles\"\ncell = \"0.03 mm\"\npitch = \"5 mm\"")
            .method("z-range")
            .partition(partition);
        job.machine = "file = \"machine.toml\"".into();
        job.more += "\n[limits]\nimplausible = \"allow\"\n";
        job.write(dir.path(), "slivers.toml")
    };
    let (by_default, _) = made(&job(""), dir.path());
    let (none, _) = made(&job("min_mark = \"0 mm\""), dir.path());
    let (all, _) = made(&job("min_mark = \"0.2 mm\""), dir.path());
    let small = |summary: &Value| number(summary, "skipped_small_mm");
    assert!(small(&by_default) > 0.5 && small(&none) == 0.0, "{} {}", small(&by_default), small(&none));
    assert!(number(&by_default, "fragments") < number(&none, "fragments"));
    // Only where the job states it are figures left out that were drawn so small: 0.09 mm each.
    assert!(small(&all) > small(&by_default) + 5.0, "{} {}", small(&all), small(&by_default));
    // Slivers are counted without a warning.
    let warned =
        |summary: &Value| summary["warnings"].as_array().is_some_and(|w| w.iter().any(|w| w["code"] == "small"));
    assert!(warned(&all) && !warned(&by_default) && !warned(&none));
}
