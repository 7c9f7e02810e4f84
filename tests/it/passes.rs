//! Several passes: each a job of its own, on the surface that the one before has left.

use std::path::{Path, PathBuf};

use crate::support::surfaces::{dome, mesh, write_stl};
use crate::support::{JobText, assert_balance, compile, folder, manifest, number, verify};
use serde_json::Value;

const PASSES: &str = "[passes]\ncount = 3\nrotate = \"67 deg\"\nlower = \"8 um\"\n";

/// A hatch on a part of the dome.
fn job(dir: &Path, method: &'static str, direction: &str, passes: &str) -> PathBuf {
    let stl = dir.join("dome.stl");
    if !stl.exists() {
        write_stl(&stl, &mesh(60, [110.0, 70.0, 170.0, 130.0], dome));
    }
    let hatch = format!("pattern = \"hatch\"\npitch = \"1.1 mm\"\ndirection = \"{direction}\"");
    let mut job = JobText::on(&stl).texture(&hatch).method(method);
    job.more = passes.into();
    job.write(dir, "job.toml")
}

/// Blocks of the manifest by pass.
fn blocks(manifest: &Value, pass: u64) -> Vec<&Value> {
    manifest["blocks"].as_array().expect("blocks").iter().filter(|b| b["pass"] == pass).collect()
}

#[test]
#[ignore = "slow: make test-all"]
fn passes_with_rotation_lowering_and_shift_verify() {
    let dir = folder();
    for (method, direction) in [("contour", "90 deg"), ("window", "20 deg"), ("z-range", "contour")] {
        let out = dir.path().join("job.job");
        let one = compile(&job(dir.path(), method, direction, ""), &out);
        let summary = compile(&job(dir.path(), method, direction, PASSES), &out);
        let proof = verify(&out);
        assert_balance(&summary, &proof);
        assert_eq!((&one["passes"], &summary["passes"]), (&1.into(), &3.into()));
        // Lines of every direction fill the same area, but for half a pitch at the rim.
        let ratio = number(&summary, "texture_mm") / number(&one, "texture_mm");
        assert!((ratio - 3.0).abs() < 0.03, "{method}: {ratio}");
        let m = manifest(&out);
        let mut at = 0;
        for pass in 1..=3 {
            let of = blocks(&m, pass);
            assert!(of.len() > 10, "{method}");
            // Passes follow each other.
            assert_eq!(of[0]["id"], format!("B{:04}", at + 1));
            at += of.len();
        }
        assert_eq!(at as f64, number(&summary, "stops"));
        let csv = std::fs::read_to_string(out.join("runsheet.csv")).expect("a run sheet");
        assert_eq!(csv.lines().filter(|l| l.rsplit(',').nth(3) == Some("2")).count(), blocks(&m, 2).len());
        assert!(out.join("layout-pass3.svg").is_file() && !out.join("layout-pass4.svg").exists());
        let text = std::fs::read_to_string(out.join("program.txt")).expect("program.txt");
        assert_eq!(text.lines().filter(|l| l.starts_with("pass ")).collect::<Vec<_>>(), ["pass 2", "pass 3"]);
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn seams_of_passes_do_not_coincide() {
    let dir = folder();
    let out = dir.path().join("job.job");
    let lines = |m: &Value, pass: usize, axis: usize| {
        let s = &m["passes"][pass]["sections"];
        let [o, p] = ["origin_mm", "pitch_mm"].map(|k| s[k][axis].as_f64().expect("a number"));
        (o / p).rem_euclid(1.0)
    };
    let apart = |a: f64, b: f64| (a - b).abs().min(1.0 - (a - b).abs());
    let sinking = "[passes]\ncount = 3\nlower = \"8 um\"\n";
    compile(&job(dir.path(), "contour", "0 deg", sinking), &out);
    verify(&out);
    let m = manifest(&out);
    let top = |pass| blocks(&m, pass).iter().map(|b| number(b, "z_hi_mm")).fold(f64::MIN, f64::max);
    for pass in 2..=3 {
        assert!((top(1) - top(pass) - 0.008 * (pass - 1) as f64).abs() < 1e-9, "the same lines, so much lower");
    }
    for (a, b) in [(0, 1), (0, 2), (1, 2)] {
        for axis in 0..2 {
            let d = apart(lines(&m, a, axis), lines(&m, b, axis));
            assert!(d > 0.2, "borders of passes {a} and {b} lie {d} of a section apart");
        }
        // Levels: lower ends of the intervals, on the surface as it was, as parts of the depth range.
        let level = |pass: usize| {
            let text = std::fs::read_to_string(out.join("program.txt")).expect("program.txt");
            let mut now = 0;
            let found = text.lines().find_map(|l| {
                now = l.strip_prefix("pass ").map_or(now, |n| n.parse::<usize>().expect("a number") - 1);
                (now == pass && l.starts_with("block ")).then(|| l.split(' ').nth(10).expect("z_lo").to_owned())
            });
            let lowered = 8_000.0 * pass as f64;
            ((found.expect("a block").parse::<f64>().expect("nm") + lowered) / 70_000.0).rem_euclid(1.0)
        };
        let d = apart(level(a), level(b));
        assert!(d > 0.2, "levels of passes {a} and {b} lie {d} of the depth range apart");
    }
    compile(&job(dir.path(), "contour", "0 deg", &format!("{PASSES}shift = \"10 mm\"\n")), &out);
    let m = manifest(&out);
    for pass in 1..3 {
        let d = apart(lines(&m, pass, 0), lines(&m, 0, 0)) * 40.0;
        assert!((d - 10.0 * pass as f64).abs() < 0.001, "{d}");
    }
    compile(&job(dir.path(), "contour", "0 deg", "[passes]\ncount = 2\nshift = \"0 mm\"\n"), &out);
    let m = manifest(&out);
    // The same twice, once there and once back; where a stop stands depends on the way.
    let stops = |pass| {
        let mut at: Vec<String> =
            blocks(&m, pass).iter().map(|b| format!("{} {} {}", b["section"], b["level"], b["mark_mm"])).collect();
        at.sort();
        at
    };
    assert_eq!(stops(1), stops(2));
}

#[test]
#[ignore = "slow: make test-all"]
fn several_passes_give_the_same_bytes_on_any_number_of_threads() {
    let dir = folder();
    let file = job(dir.path(), "auto", "contour", PASSES);
    crate::support::same_on_any_threads(&file, dir.path());
}

#[test]
fn each_pass_starts_where_the_previous_one_ended() {
    let dir = folder();
    let out = dir.path().join("job.job");
    compile(&job(dir.path(), "z-range", "0 deg", "[passes]\ncount = 2\nshift = \"0 mm\"\n"), &out);
    let m = manifest(&out);
    let (last, first) = (blocks(&m, 1).pop().expect("a block").clone(), blocks(&m, 2)[0].clone());
    let away = |k: usize| (last["stage"][k].as_f64().expect("mm") - first["stage"][k].as_f64().expect("mm")).abs();
    assert!(away(0) < 1e-9 && away(1) < 1e-9, "{last} {first}");
}

#[test]
fn impossible_passes_are_refused_with_place_and_hint() {
    let dir = folder();
    for (passes, code, says) in [
        ("count = 0", "passes-count", "job.toml:"),
        ("count = 101", "passes-count", "1 to 100"),
        ("count = -1", "toml", "job.toml:"),
        ("count = 2\nlower = \"0.1 mm\"", "passes-lower", "what one pass removes"),
        ("count = 2\nlower = \"-1 um\"", "toml", "job.toml:"),
        ("count = 2\nlower = 8", "toml", "job.toml:"),
        ("count = 2\nrotate = \"67 mm\"", "toml", "job.toml:"),
        ("count = 2\nshift = \"-1 mm\"", "toml", "job.toml:"),
        ("number = 2", "toml", "job.toml:"),
    ] {
        let file = job(dir.path(), "contour", "0 deg", &format!("[passes]\n{passes}\n"));
        let done = crate::support::terrace([Path::new("compile"), file.as_path()]);
        let said = crate::support::said(&done);
        assert!(!done.status.success() && said.contains(code) && said.contains(says), "{passes}: {said}");
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn rotated_passes_with_tilt_verify() {
    let dir = folder();
    let stl = dir.path().join("dome.stl");
    write_stl(&stl, &mesh(90, [100.0, 60.0, 190.0, 150.0], dome));
    let run = |method, passes: &str| {
        let mut job = JobText::on(&stl).texture("pattern = \"hatch\"\npitch = \"0.7 mm\"").method(method);
        job.machine = "profile = \"xyz-tilt-galvo-40\"".into();
        job.more = passes.into();
        let out = dir.path().join("job.job");
        let file = job.write(dir.path(), "job.toml");
        let args = ["compile", "--json", "-o"].map(Path::new);
        (crate::support::terrace(args.into_iter().chain([out.as_path(), file.as_path()])), out)
    };
    let (done, out) = run("tilt", PASSES);
    assert!(done.status.success(), "{}", crate::support::said(&done));
    let summary: Value = serde_json::from_slice(&done.stdout).expect("JSON");
    // Lengths of tilted blocks are re-read from turned points, to some picometres a mark.
    assert_balance(&summary, &summary);
    assert_eq!(verify(&out)["stops"], summary["stops"]);
}
