//! The model of the galvo: one for every system, that of the job's machine.

use std::path::{Path, PathBuf};
use terrace_core::math;

use crate::support::surfaces::{mesh, write_stl};
use crate::support::{compile, folder, machine_file, manifest, number, said, summary_of, terrace, verify};
use serde_json::Value;

/// Distance of neighbouring points of the curve of Ma et al. (2025), mm: order 8 on 40 mm.
const STEP: f64 = 40.0 / 255.0;
/// Limits of the scanner of `xyzac-galvo-10`: mm/s2 and mm/s3.
const ACCELERATION: f64 = 20_000.0;
const JERK: f64 = 1e6;
/// Systems in which the beam stands upright on the table.
const UPRIGHT: [&str; 6] = ["flat", "contour", "z-range", "zoom", "sync", "sync-bands"];

/// The surface of Ma et al. (2025) as a sum of three hills with its heights and slopes.
fn hills(x: f64, y: f64) -> f64 {
    let hill =
        |a: f64, [mx, my]: [f64; 2], s: f64| a * math::exp(-((x - mx).powi(2) + (y - my).powi(2)) / (2.0 * s * s));
    14.5 + hill(-2.353_703_43, [14.935_112_68, 15.301_636], 7.0)
        + hill(4.726_817_10, [16.558_363_94, -16.081_084_23], 9.0)
        + hill(6.869_674_40, [-16.071_748_28, 5.491_591_76], 10.0)
}

/// A Hilbert curve with the steps of the article over the middle of a part, on a machine with a machine file.
fn job(dir: &Path, order: u32, surface: impl Fn(f64, f64) -> f64, machine: &str, more: &str) -> PathBuf {
    let half = STEP * (f64::from(1u32 << order) - 1.0) / 2.0;
    let stl = dir.join("part.stl");
    write_stl(&stl, &mesh(100, [-25.0, -25.0, 25.0, 25.0], surface));
    std::fs::write(dir.join("machine.toml"), machine).expect("a machine file");
    let text = format!(
        "{more}[surface]\nfile = \"part.stl\"\nunit = \"mm\"\n\n[placement]\norigin = [\"0 mm\", \"0 mm\", \"0 mm\"]\n\n\
         [[texture]]\npattern = \"hilbert\"\norder = {order}\narea = [\"{0} mm\", \"{0} mm\", \"{half} mm\", \"{half} mm\"]\n\n\
         [focus]\npdof = \"0.2 mm\"\n\n[partition]\nmethod = \"z-range\"\n\n[machine]\nfile = \"machine.toml\"\n\n[limits]\nimplausible = \"allow\"\n\n\
         [[pen]]\nname = \"groove\"\nspeed = \"3000 mm/s\"\npower = \"1.2 W\"\nfrequency = \"60 kHz\"\n",
        -half
    );
    let path = dir.join("job.toml");
    std::fs::write(&path, text).expect("a job");
    path
}

/// The machine file without the limits of the scanner.
fn without_limits(machine: &str) -> String {
    let is_limit =
        |line: &&str| !line.starts_with("acceleration = \"20000 mm/s2\"") && !line.starts_with("jerk = \"1000000");
    let out: String = machine.lines().filter(is_limit).map(|line| format!("{line}\n")).collect();
    assert_eq!(out.lines().count() + 2, machine.lines().count());
    out
}

/// Lengths of the straight runs of a Hilbert curve, in steps, by the rewriting rules of its turtle.
fn straights(order: u32) -> Vec<u32> {
    fn walk(rule: u8, depth: u32, moves: &mut Vec<u8>) {
        // A -> +BF-AFA-FB+, B -> -AF+BFB+FA-.
        let text: &[u8] = if rule == b'A' { b"+BF-AFA-FB+" } else { b"-AF+BFB+FA-" };
        for &c in text {
            match c {
                b'A' | b'B' if depth > 1 => walk(c, depth - 1, moves),
                b'A' | b'B' => {}
                _ => moves.push(c),
            }
        }
    }
    let mut moves = Vec::new();
    walk(b'A', order, &mut moves);
    let (mut out, mut turn) = (Vec::<u32>::new(), 0);
    for c in moves {
        match c {
            b'+' => turn += 1,
            b'-' => turn -= 1,
            _ => {
                match out.last_mut().filter(|_| turn == 0) {
                    Some(run) => *run += 1,
                    None => out.push(1),
                }
                turn = 0;
            }
        }
    }
    out
}

/// Time of a straight run from rest to rest, s: below the speed of the scanner on all of these.
fn run_s(length: f64) -> f64 {
    let long = ACCELERATION / JERK + ((ACCELERATION / JERK).powi(2) + 4.0 * length / ACCELERATION).sqrt();
    if length * JERK * JERK >= 2.0 * ACCELERATION.powi(3) { long } else { math::cbrt(32.0 * length / JERK) }
}

fn marks_s(order: u32) -> f64 {
    straights(order).iter().map(|&n| run_s(f64::from(n) * STEP)).sum()
}

/// What a cut adds at most, s: both pieces of the run end at rest.
fn cut_s() -> f64 {
    let cut = |n: u32, k: u32| {
        let (whole, first) = (f64::from(n) * STEP, f64::from(n * k) / 100.0 * STEP);
        run_s(first) + run_s(whole - first) - run_s(whole)
    };
    (1..=3).flat_map(|n| (1..100).map(move |k| cut(n, k))).fold(0.0, f64::max)
}

fn compared(job: &Path, systems: &str) -> Value {
    let out = terrace([Path::new("compare"), job, "--systems".as_ref(), systems.as_ref(), "--json".as_ref()]);
    assert!(out.status.success(), "{}", said(&out));
    serde_json::from_slice(&out.stdout).expect("JSON")
}

#[test]
fn runs_of_the_curve_are_those_of_the_article() {
    let count = |n: u32| straights(8).iter().filter(|&&run| run == n).count();
    assert_eq!([1, 2, 3].map(count), [40_415, 10_922, 1_092]);
    let ms = [1.0, 2.0, 3.0].map(|n| (1e5 * run_s(n * STEP)).round() / 100.0);
    assert_eq!(ms, [17.12, 21.57, 24.69]);
    assert!((marks_s(8) / 60.0 - 15.9).abs() < 0.05, "{}", marks_s(8) / 60.0);
}

#[test]
#[ignore = "slow: make test-all"]
fn marks_take_the_same_time_in_every_upright_system() {
    let dir = folder();
    let machine = machine_file("xyzac-galvo-10");
    // One field, one depth: nothing is cut.
    let flat = |x: f64, y: f64| 15.0 + 1e-4 * x + 2e-4 * y;
    for (machine, model, mark_s) in [
        (machine.clone(), "rest to rest", marks_s(3)),
        (without_limits(&machine), "at speed plus delays", STEP * 63.0 / 3000.0),
    ] {
        let found = compared(&job(dir.path(), 3, flat, &machine, ""), &UPRIGHT.join(","));
        assert_eq!(found["galvo"], model);
        for row in found["systems"].as_array().expect("systems") {
            assert_eq!(row["galvo"], model, "{row}");
            let got = number(row, "mark_s") * number(row, "speed_percent") / 100.0;
            assert!((got / mark_s - 1.0).abs() < 1e-4, "{got} for {mark_s}: {row}");
        }
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn marks_of_the_article_take_as_long_in_every_upright_system() {
    let dir = folder();
    let machine = machine_file("xyzac-galvo-10");
    let uncut = marks_s(8) / 60.0;
    // The pieces of the curve by a method, on a flat part those by the field alone.
    let pieces = |method: &str, hilly: bool| {
        let dir = folder();
        let path = job(dir.path(), 8, |x, y| if hilly { hills(x, y) } else { 15.0 }, &machine, "");
        let text = std::fs::read_to_string(&path).expect("a job").replace("\"z-range\"", &format!("{method:?}"));
        std::fs::write(&path, text).expect("a writable folder");
        number(&summary_of(&path), "fragments")
    };
    // Of bands each runs at a speed of its own, of which the slowest is stated.
    let systems = UPRIGHT[..5].join(",");
    let found = compared(&job(dir.path(), 8, hills, &machine, ""), &systems);
    let minutes = |row: &Value| number(row, "mark_s") * number(row, "speed_percent") / 100.0 / 60.0;
    for row in found["systems"].as_array().expect("systems") {
        eprintln!("{}: marks {:.3} min, {} stops", row["system"], minutes(row), row["stops"]);
        let pieces = match row["system"].as_str() {
            Some("sync") => 1.0,
            Some("flat") => pieces("z-range", false),
            Some("zoom") => pieces("z-range", true),
            Some(method) => pieces(method, true),
            None => panic!("{row}"),
        };
        let most = uncut + (pieces - 1.0) * cut_s() / 60.0;
        assert!((uncut - 0.02..most + 0.02).contains(&minutes(row)), "{pieces} pieces, at most {most} min: {row}");
    }
    let found = compared(&job(dir.path(), 8, hills, &without_limits(&machine), ""), &systems);
    for row in found["systems"].as_array().expect("systems") {
        assert_eq!(row["galvo"], "at speed plus delays");
        assert!((minutes(row) * 60.0 / (STEP * 65_535.0 / 3000.0) - 1.0).abs() < 0.01, "{row}");
    }
}

#[test]
fn times_of_a_stepped_job_are_found_again_by_the_verifier() {
    let dir = folder();
    let machine = machine_file("xyzac-galvo-10");
    let out = dir.path().join("made.job");
    let made = |slope: f64| {
        let summary = compile(&job(dir.path(), 4, |x, y| 15.0 + slope * x + 0.2 * slope * y, &machine, ""), &out);
        let proof = verify(&out);
        assert_eq!(proof["ok"], true, "{proof}");
        summary
    };
    let whole = made(0.01);
    assert!((number(&whole["time_s"], "mark") / marks_s(4) - 1.0).abs() < 1e-5, "{}", whole["time_s"]);
    // What is cut between stops rests at its ends too.
    let summary = made(0.3);
    assert!(number(&summary, "blocks") > 2.0 && number(&summary["time_s"], "mark") > marks_s(4), "{summary}");
    // Power times time of all marks is what the blocks get, most of it where the spot rests.
    let manifest = manifest(&out);
    let blocks = manifest["blocks"].as_array().expect("blocks");
    let joule: f64 =
        blocks.iter().map(|b| number(&b["line_energy"], "mean_j_per_m") * number(b, "mark_mm") / 1e3).sum();
    let mark_s = number(&summary["time_s"], "mark");
    assert!((joule / (1.2 * mark_s) - 1.0).abs() < 1e-9, "{joule} for {mark_s} s at 1.2 W");
    for block in blocks {
        let energy = &block["line_energy"];
        // Half a spot of 24.5 um from rest under the jerk alone: t = (6 s / j)^(1/3).
        let share = 3000.0 * math::cbrt(6.0 * 0.012_25 / JERK) / 0.012_25;
        assert!(
            number(energy, "worst_share") > 0.99 * share && number(energy, "length_at_speed_percent") == 0.0,
            "{energy}"
        );
    }
    let report = std::fs::read_to_string(out.join("report.html")).expect("a report");
    assert!(report.contains("<h2>Line energy</h2>") && report.contains("energy.svg"));
    let map = std::fs::read_to_string(out.join("energy.svg")).expect("a map");
    assert!(map.contains("data:image/png;base64,") && map.ends_with("</svg>\n"));
}

#[test]
fn line_energy_at_corners_is_not_known_without_limits_of_the_scanner() {
    let dir = folder();
    let machine = without_limits(&machine_file("xyzac-galvo-10"));
    let job = job(dir.path(), 3, |_, _| 15.0, &machine, "");
    let out = dir.path().join("made.job");
    compile(&job, &out);
    assert!(manifest(&out)["blocks"][0]["line_energy"].is_null());
    let report = std::fs::read_to_string(out.join("report.html")).expect("a report");
    assert!(report.contains("does not state scanner.acceleration"));
}

#[test]
fn heat_at_seams_is_explained_by_many_absorptivities() {
    let dir = folder();
    let found = compared(&job(dir.path(), 2, |_, _| 15.0, &machine_file("xyzac-galvo-10"), ""), "z-range");
    let rows = found["heat"].as_array().expect("heat");
    let of = |key: &str| rows.iter().map(|row| number(row, key)).collect::<Vec<f64>>();
    assert_eq!(of("radius_um"), [25.0, 50.0, 100.0, 200.0]);
    for (got, want) in of("absorptivity").iter().zip([0.034, 0.073, 0.165, 0.395]) {
        assert!((got - want).abs() < 6e-4, "{got} {want}");
    }
    assert!(of("second_exposure_after_10_ms_degc").iter().all(|t| *t > 2002.0));
}

#[test]
fn program_on_the_fly_keeps_the_time_of_the_model_and_verifies() {
    let dir = folder();
    // Three axes: without the swivel and the turntable.
    let machine = machine_file("xyzac-galvo-10");
    let upright = machine.split("[tilt]").next().expect("a tilt table after the rest");
    let job = job(dir.path(), 4, |x, y| 15.0 + 0.02 * x - 0.01 * y, upright, "mode = \"on-the-fly\"\n");
    let out = dir.path().join("made.job");
    let summary = compile(&job, &out);
    let proof = verify(&out);
    assert_eq!(proof["ok"], true, "{proof}");
    let mark_s = number(&summary, "mark_s");
    assert!(mark_s >= marks_s(4) * (1.0 - 1e-4) && mark_s < 1.5 * marks_s(4), "{mark_s} for {}", marks_s(4));
}
