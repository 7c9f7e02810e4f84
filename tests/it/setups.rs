//! Parts beyond the stage travel: one job in several set-ups, each with its own place of the part.

use std::path::{Path, PathBuf};

use crate::support::surfaces::{mesh, write_stl};
use crate::support::{JobText, assert_balance, compile, folder, machine_file, manifest, number, verify};
use serde_json::Value;

/// Tooling holes along two edges of the part, every 75 mm.
const HOLES: &str = "registration = [[\"3 mm\", \"15 mm\"], [\"75 mm\", \"15 mm\"], [\"150 mm\", \"15 mm\"], \
    [\"222 mm\", \"15 mm\"], [\"3 mm\", \"110 mm\"], [\"75 mm\", \"110 mm\"], [\"150 mm\", \"110 mm\"], [\"222 mm\", \"110 mm\"]]\n";

const FORMATS: &str = "[emit]\nformats = [\"csv\", \"linuxcnc\", \"gcode\"]\n";

/// A hatch on a gentle dome of 225 x 125 mm; the stage travels 125 mm in x and y.
fn job(dir: &Path, method: &'static str, more: &str) -> PathBuf {
    let stl = dir.join("dome.stl");
    if !stl.exists() {
        let dome = |x: f64, y: f64| 0.5 - ((x - 112.5) / 225.0).powi(2) - ((y - 62.5) / 125.0).powi(2);
        write_stl(&stl, &mesh(40, [0.0, 0.0, 225.0, 125.0], dome));
    }
    let mut job = JobText::on(&stl).texture("pattern = \"hatch\"\npitch = \"5 mm\"").method(method);
    job.more = format!("{more}\n{FORMATS}");
    let text = machine_file("xyz-galvo-40").replace("250 mm", "62.5 mm").replace("\"40 mm\"", "\"25 mm\"");
    std::fs::write(dir.join("machine.txt"), text).expect("a writable folder");
    job.machine = "file = \"machine.txt\"".into();
    job.write(dir, "job.toml")
}

fn setups(keys: &str) -> String {
    format!("[setups]\n{keys}{HOLES}")
}

/// The set-ups of the blocks, as they follow each other.
fn order(manifest: &Value) -> Vec<u64> {
    let blocks = manifest["blocks"].as_array().expect("blocks");
    let mut order: Vec<u64> = blocks.iter().map(|b| b["setup"].as_u64().expect("a number")).collect();
    order.dedup();
    order
}

fn refused(dir: &Path, method: &'static str, more: &str) -> String {
    let file = job(dir, method, more);
    let done = crate::support::terrace([Path::new("compile"), file.as_path()]);
    assert!(!done.status.success(), "{more}");
    crate::support::said(&done)
}

#[test]
#[ignore = "slow: make test-all"]
fn part_beyond_the_travel_is_marked_in_set_ups_and_verifies() {
    let dir = folder();
    let out = dir.path().join("job.job");
    for (method, keys, count) in [
        ("contour", "", 2),
        ("z-range", "columns = 3\nrows = 2\n", 6),
        ("window", "columns = \"auto\"\n", 2),
        ("auto", "", 2),
    ] {
        let summary = compile(&job(dir.path(), method, &setups(keys)), &out);
        assert_balance(&summary, &verify(&out));
        assert_eq!(summary["setups"], count);
        let m = manifest(&out);
        assert_eq!(order(&m), (1..=count).collect::<Vec<u64>>(), "set-up after set-up");
        let all = m["setups"].as_array().expect("set-ups");
        assert_eq!(all.len() as u64, count);
        for b in m["blocks"].as_array().expect("blocks") {
            let origin = &all[b["setup"].as_u64().expect("a number") as usize - 1]["origin_mm"];
            for k in 0..2 {
                let [at, o, c] = [&b["stage"][k], &origin[k], &b["centre_mm"][k]].map(|v| v.as_f64().expect("mm"));
                // The table carries the part in x and y: commands count against it.
                assert!((at + c + o).abs() < 1e-9 && at.abs() <= 62.5, "{b}");
            }
        }
        for s in all {
            let found = s["registration"].as_array().expect("points");
            assert!(found.len() >= 2);
            for r in found {
                for k in 0..2 {
                    let [at, o, p] =
                        [&r["stage"][k], &s["origin_mm"][k], &r["point_mm"][k]].map(|v| v.as_f64().expect("mm"));
                    assert!((at + p + o).abs() <= 1e-4 && at.abs() <= 62.5, "{r}");
                }
            }
        }
        for name in ["stage.ngc", "stage_m0.nc"] {
            let text = std::fs::read_to_string(out.join(name)).expect("a stage program");
            assert_eq!(text.matches("(SETUP ").count() as u64, count);
            assert_eq!(text.matches("\nM0\n").count() as u64, count, "{name}");
        }
        let sheet = std::fs::read_to_string(out.join("runsheet.txt")).expect("a run sheet");
        assert!(sheet.contains(&format!("SET-UP {count} OF {count}  part zero X")), "{sheet}");
        let points: usize = all.iter().map(|s| s["registration"].as_array().expect("points").len()).sum();
        assert_eq!(sheet.matches("of the part: stage X").count(), points);
        let table = std::fs::read_to_string(out.join("runsheet.csv")).expect("a table");
        assert!(table.lines().next().is_some_and(|l| l.ends_with(",pass,setup,lift_z_mm,focus_shift_mm")));
        assert!(table.lines().last().is_some_and(|l| l.rsplit(',').nth(2) == Some(count.to_string().as_str())));
    }
}

#[test]
fn marks_do_not_depend_on_the_set_ups() {
    let dir = folder();
    let out = dir.path().join("job.job");
    let run = |keys: &str| {
        let summary = compile(&job(dir.path(), "z-range", &setups(keys)), &out);
        // Stops are not among them: where two blocks come to stand depends on the stops before and after them.
        ["fragments", "mark_mm", "seam_mm", "skipped_mm"].map(|k| number(&summary, k).round())
    };
    assert_eq!(run(""), run("columns = 3\nrows = 2\n"));
}

#[test]
fn a_turned_part_has_its_points_turned_too() {
    let dir = folder();
    let out = dir.path().join("job.job");
    let summary =
        compile(&job(dir.path(), "z-range", &format!("[placement]\nturn = \"90 deg\"\n{}", setups(""))), &out);
    verify(&out);
    assert_eq!(summary["setups"], 2);
    let m = manifest(&out);
    let first = &m["setups"][0];
    let [x, y] = [0, 1].map(|k| first["registration"][0]["stage"][k].as_f64().expect("mm"));
    let [px, py] = [0, 1].map(|k| first["registration"][0]["point_mm"][k].as_f64().expect("mm"));
    let [ox, oy] = [0, 1].map(|k| first["origin_mm"][k].as_f64().expect("mm"));
    assert!((x + ox - py).abs() < 1e-3 && (y + oy + px).abs() < 1e-3, "{first}");
}

#[test]
#[ignore = "slow: make test-all"]
fn passes_alternate_the_order_of_set_ups() {
    let dir = folder();
    let out = dir.path().join("job.job");
    let passes = "[passes]\ncount = 2\nlower = \"8 um\"\nrotate = \"90 deg\"\n";
    let summary = compile(&job(dir.path(), "z-range", &format!("{passes}{}", setups(""))), &out);
    assert_balance(&summary, &verify(&out));
    let m = manifest(&out);
    let n = summary["setups"].as_u64().expect("a number");
    // Sections of the second pass reach beyond the texture, where one row would not do.
    assert!(n >= 2);
    let there = 1..=n;
    assert_eq!(
        order(&m),
        there.clone().chain(there.rev().skip(1)).collect::<Vec<_>>(),
        "the part stays between passes"
    );
}

#[test]
#[ignore = "slow: make test-all"]
fn set_ups_give_the_same_bytes_on_any_number_of_threads() {
    let dir = folder();
    let file = job(dir.path(), "auto", &setups(""));
    crate::support::same_on_any_threads(&file, dir.path());
}

#[test]
fn a_part_within_travel_needs_one_set_up_and_no_stop() {
    let dir = folder();
    let out = dir.path().join("job.job");
    let stl = dir.path().join("small.stl");
    write_stl(&stl, &mesh(20, [0.0, 0.0, 120.0, 80.0], |x, y| (x + y) / 400.0));
    let mut text = JobText::on(&stl).texture("pattern = \"hatch\"\npitch = \"5 mm\"");
    text.more = format!("[setups]\nregistration = [[\"0 mm\", \"0 mm\"], [\"120 mm\", \"0 mm\"]]\n{FORMATS}");
    let summary = compile(&text.write(dir.path(), "small.toml"), &out);
    verify(&out);
    assert_eq!(summary["setups"], 1);
    for name in ["program.txt", "stage.ngc", "stage_m0.nc"] {
        let text = std::fs::read_to_string(out.join(name)).expect("a file");
        assert!(
            !text.contains("SETUP") && !text.contains("\nsetup ") && text.matches("\norigin ").count() <= 1,
            "{name}"
        );
    }
    assert_eq!(manifest(&out)["setups"][0]["registration"].as_array().map(Vec::len), Some(2));
}

#[test]
fn impossible_set_ups_are_refused_with_a_hint() {
    let dir = folder();
    let says = |more: &str, code: &str, hint: &str| {
        let said = refused(dir.path(), "z-range", more);
        assert!(said.contains(&format!("[{code}]")) && said.contains(hint), "{more}: {said}");
    };
    says("", "travel", "[setups] with columns = 2 and rows = 1");
    says(&setups("columns = 1\n"), "travel", "[setups] with columns = 2 and rows = 1");
    // Both points lie in the first set-up.
    let near = "[setups]\nregistration = [[\"3 mm\", \"7 mm\"], [\"25 mm\", \"7 mm\"]]\n";
    says(near, "registration", "set-up 2 of 2 reaches 0 registration points");
    says(near, "registration", "set-up 2 reaches x 100 to 225 mm and y 0 to 125 mm");
    let off = "[setups]\nregistration = [[\"900 mm\", \"7 mm\"], [\"925 mm\", \"7 mm\"]]\n";
    says(off, "registration", "2 of 2 set-ups reach fewer than two registration points");
    says("[setups]\nregistration = [[\"3 mm\", \"7 mm\"]]\n", "setups-registration", "fewer than two points");
    says("[setups]\nregistration = [[\"1 mm\", \"3 mm\"], [\"1 mm\", \"3 mm\"]]\n", "setups-registration", "the same");
    says("[setups]\nregistration = [[\"1 mm\", \"3 mm\"], [\"9 m\", \"3 mm\"]]\n", "length-far", "beyond 4 m");
    says("[setups]\ncolumns = 2\n", "toml", "registration");
    says("[setups]\nregistration = [[\"1 mm\"]]\n", "toml", "job.toml:");
    says(&setups("columns = 0\n"), "setups-count", "setups.columns is not between 1 and 100");
    says(&setups("rows = 101\n"), "setups-count", "setups.rows is not between 1 and 100");
    says(&setups("rows = \"many\"\n"), "toml", "a number of set-ups, or \"auto\"");
    says(
        &format!("[placement]\norigin = [\"0 mm\", \"0 mm\", \"0 mm\"]\n{}", setups("")),
        "setups-origin",
        "run sheet",
    );
    let tilted = refused(dir.path(), "tilt", &setups(""));
    assert!(tilted.contains("[setups-tilt]"), "{tilted}");
}

#[test]
fn a_format_without_stops_is_refused() {
    let dir = folder();
    let file = job(dir.path(), "z-range", &setups(""));
    let text = std::fs::read_to_string(&file).expect("a job file").replace("\"gcode\"]", "\"ovf\"]");
    std::fs::write(&file, text).expect("a writable folder");
    let done = crate::support::terrace([Path::new("compile"), file.as_path()]);
    assert!(
        !done.status.success() && crate::support::said(&done).contains("[setups-format]"),
        "{}",
        crate::support::said(&done)
    );
}

#[test]
fn registration_points_in_any_unit_verify() {
    let dir = folder();
    let stl = dir.path().join("plate.stl");
    write_stl(&stl, &mesh(4, [0.0, 0.0, 60.0, 50.0], |_, _| 0.0));
    // Lengths that have no short decimal in mm: 2.1 in is 53.339999999999996 mm in f64.
    for points in [
        "[\"2.1 in\", \"0 mm\"], [\"8 mm\", \"8 mm\"]",
        "[\"0.1 in\", \"1.7 in\"], [\"33333.3333 um\", \"1.0000004 mm\"]",
    ] {
        for turn in ["0 deg", "17.3 deg"] {
            let mut job = JobText::on(&stl).texture("pattern = \"hatch\"\npitch = \"4 mm\"");
            job.more = format!(
                "[placement]\nturn = \"{turn}\"\n[setups]\ncolumns = 1\nrows = 1\nregistration = [{points}]\n{FORMATS}"
            );
            let out = dir.path().join("inches.job");
            compile(&job.write(dir.path(), "job.toml"), &out);
            verify(&out);
        }
    }
}
