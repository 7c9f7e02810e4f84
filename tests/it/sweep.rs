//! `terrace sweep`: a row for every combination, the same figures as `check`, the surface read once.

use std::path::Path;
use terrace_core::math;

use serde_json::Value;

use crate::support::surfaces::{mesh, write_stl};
use crate::support::{JobText, folder, number, said, summary_of, terrace};

fn job(dir: &Path) -> std::path::PathBuf {
    let stl = dir.join("wave.stl");
    write_stl(&stl, &mesh(30, [0.0, 0.0, 90.0, 60.0], |x, y| 0.4 * math::sin(x / 19.0) * math::cos(y / 17.0)));
    JobText::on(&stl).texture("pattern = \"hatch\"\npitch = \"2 mm\"").method("z-range").write(dir, "wave.toml")
}

fn swept(job: &Path, args: &[&str]) -> Vec<Value> {
    let all = [Path::new("sweep"), job, Path::new("--json")].into_iter().chain(args.iter().map(Path::new));
    let out = terrace(all);
    assert!(out.status.success(), "{}", said(&out));
    let found: Value = serde_json::from_slice(&out.stdout).expect("JSON");
    found["sweep"].as_array().expect("rows").clone()
}

#[test]
#[ignore = "slow: make test-all"]
fn rows_of_a_sweep_are_the_figures_of_the_jobs_so_set() {
    let dir = folder();
    let job = job(dir.path());
    let csv = dir.path().join("s.csv");
    let svg = dir.path().join("s.svg");
    let settings = ["--set", "focus.pdof=0.05..0.15mm/3", "--set", "partition.method=contour,z-range"];
    let files = ["-o", csv.to_str().expect("UTF-8"), "--plot", svg.to_str().expect("UTF-8")];
    let rows = swept(&job, &[&settings[..], &files].concat());
    assert_eq!(rows.len(), 6);
    let text = std::fs::read_to_string(&job).expect("the job");
    for (i, row) in rows.iter().enumerate() {
        let (pdof, method) = (["0.05 mm", "0.1 mm", "0.15 mm"][i / 2], ["contour", "z-range"][i % 2]);
        assert_eq!((row["focus_pdof"].as_str(), row["partition_method"].as_str()), (Some(pdof), Some(method)), "{row}");
        let own = dir.path().join("own.toml");
        let text =
            text.replacen("\"0.07 mm\"", &format!("{pdof:?}"), 1).replacen("\"z-range\"", &format!("{method:?}"), 1);
        std::fs::write(&own, text).expect("a writable folder");
        let summary = summary_of(&own);
        for key in ["stops", "blocks", "fragments"] {
            assert_eq!(number(row, key), number(&summary, key), "{key} of {row}");
        }
        assert_eq!(number(row, "machine_time_s"), number(&summary["time_s"], "total"));
        assert_eq!(number(row, "with_loading_s"), number(&summary["loading"], "total_s"));
        assert_eq!(number(row, "seam_mm"), number(&summary, "seam_mm"));
    }
    assert!(number(&rows[0], "stops") > number(&rows[4], "stops"), "a larger PDOF needs fewer stops");
    assert_eq!(std::fs::read_to_string(&csv).expect("a table").lines().count(), 7);
    assert!(std::fs::read_to_string(&svg).expect("a chart").contains("wave: sweep of focus.pdof"));
    // Any number of threads gives the same table.
    assert_eq!(swept(&job, &[&settings[..], &["-j", "1"]].concat()), rows);
}

#[test]
fn a_setting_that_cannot_be_planned_says_why_in_its_row() {
    let dir = folder();
    let rows = swept(&job(dir.path()), &["--set", "focus.pdof=0.1mm,9mm"]);
    assert!(rows[0]["stops"].is_number() && rows[1]["stops"].is_null(), "{rows:?}");
    assert!(rows[1]["note"].as_str().is_some_and(|note| note.contains("depth of focus")), "{}", rows[1]);
}

#[test]
fn settings_that_name_nothing_are_refused() {
    let dir = folder();
    let job = job(dir.path());
    let refused = |args: &[&str]| {
        let all = [Path::new("sweep"), &job].into_iter().chain(args.iter().map(Path::new));
        let out = terrace(all);
        assert!(!out.status.success(), "{args:?}: {}", said(&out));
        said(&out)
    };
    for (set, wanted) in [
        ("focus.pdof", "KEY=VALUES"),
        ("focus.pdof=1..2mm/0", "2 to 10000 values"),
        ("texture.1.pitch=1mm", "sweep-key"),
        ("focus.pdof.deep=1mm", "sweep-key"),
        ("focus.depht=1mm,2mm", "depht"),
        ("focus.pdof=0.01..1mm/200,", "is not a number of values"),
    ] {
        let text = refused(&["--set", set]);
        assert!(text.contains(wanted), "{set}: {text}");
    }
    let many = refused(&["--set", "focus.pdof=1..2mm/200", "--set", "partition.zone=0..1mm/200"]);
    assert!(many.contains("sweep-many"), "{many}");
    let mode = refused(&["--mode", "on-the-fly", "--set", "focus.pdof=0.1mm"]);
    assert!(mode.contains("sweep-mode"), "{mode}");
    let svg = dir.path().join("s.svg");
    let plot = refused(&["--set", "partition.method=contour,z-range", "--plot", svg.to_str().expect("UTF-8")]);
    assert!(plot.contains("sweep-plot") && !svg.exists(), "{plot}");
}
