//! `terrace compare`: every system in one table, within the limits where it promises them, the same on any
//! number of threads.

use std::path::{Path, PathBuf};

use crate::support::surfaces::{dome, mesh, write_stl};
use crate::support::{JobText, fixture, folder, number, said, shared, terrace};
use serde_json::Value;

/// A bulge of a millimetre under hatch and squares.
fn job(dir: &Path) -> PathBuf {
    job_of(dir, [48.0, 42.0])
}

/// Some of it.
fn job_of(dir: &Path, [w, h]: [f64; 2]) -> PathBuf {
    let stl = dir.join("bulge.stl");
    write_stl(&stl, &mesh(30, [0.0, 0.0, w, h], |x, y| (x / 20.0).sin() * (y / 17.0).cos()));
    JobText::on(&stl)
        .texture("pattern = \"hatch\"\npitch = \"10 mm\"")
        .texture("pattern = \"squares\"\npitch = \"20 mm\"\ncell = \"8 mm\"")
        .write(dir, "bulge.toml")
}

fn compared(args: &[&str], job: &Path) -> Value {
    let all = [Path::new("compare"), job].into_iter().chain(args.iter().map(Path::new));
    let out = terrace(all.chain([Path::new("--json")]));
    assert!(out.status.success(), "{}", said(&out));
    serde_json::from_slice(&out.stdout).expect("JSON")
}

#[test]
fn every_system_is_timed_and_keeps_what_it_promises() {
    let dir = folder();
    let job = job(dir.path());
    let found = compared(&[], &job);
    let limits = &found["limits"];
    let systems = found["systems"].as_array().expect("systems");
    let of = |name: &str| systems.iter().find(|s| s["system"] == name).unwrap_or_else(|| panic!("no {name}"));
    assert_eq!(systems.len(), 11);
    for s in systems {
        let parts = ["stage_s", "settle_s", "zoom_s", "mark_s", "jump_s", "delay_s"].map(|k| number(s, k));
        let total = number(s, "total_s");
        assert!((parts.iter().sum::<f64>() - total).abs() < 1e-9 * total && total > 0.0, "{s}");
        if s["system"] == "flat" {
            continue;
        }
        assert!(number(s, "worst_fod_um") <= number(limits, "fod_um") + 0.01, "{s}");
        assert!(number(s, "within_limits_percent") > 99.9, "{s}");
    }
    // Flat tiling is quick and out of focus.
    assert!(number(of("flat"), "worst_fod_um") > 200.0 && number(of("flat"), "within_limits_percent") < 50.0);
    assert!(number(of("flat"), "total_s") < number(of("contour"), "total_s"));
    assert!(number(of("z-range"), "stops") <= number(of("contour"), "stops"));
    // A zoom optic moves the stage once a field.
    assert_eq!(number(of("zoom"), "stops"), number(of("flat"), "stops"));
    assert!(number(of("zoom"), "total_s") < number(of("z-range"), "total_s"));
    // Where five axes follow the mark itself nothing is off; smoothing lets it be off and saves time.
    assert!(number(of("5-axis"), "worst_fod_um") < 1e-6);
    assert!(number(of("7-axis-smooth"), "total_s") < number(of("5-axis"), "total_s"));
    assert!(number(of("sync"), "worst_displacement_mm") <= 20.0 * std::f64::consts::SQRT_2);
    // The scanner takes up the following error of the stage; where the stage rests there is none.
    let spot = |name: &str| number(of(name), "worst_spot_error_um");
    assert!(spot("7-axis") < 0.1 * spot("5-axis"), "{} {}", spot("7-axis"), spot("5-axis"));
    // Decompositions share one path: the one of least acceleration has the least.
    let filters = found["decompositions"].as_array().expect("decompositions");
    let rms = |f: &Value| number(f, "rms_stage_acceleration_mm_s2");
    let least = filters.iter().find(|f| f["decomposition"] == "least acceleration").expect("the last");
    assert!(filters.len() >= 5 && filters.iter().all(|f| rms(least) <= rms(f)), "{filters:?}");
}

#[test]
fn zoom_optic_stops_at_its_range() {
    let dir = folder();
    let stl = dir.path().join("slope.stl");
    // 20 mm of height in one field, an optic of 10 mm.
    write_stl(&stl, &mesh(20, [0.0, 0.0, 40.0, 10.0], |x, _| 0.5 * x));
    let job = JobText::on(&stl).texture("pattern = \"hatch\"\npitch = \"2 mm\"").write(dir.path(), "slope.toml");
    let found = compared(&["--systems", "z-range,zoom"], &job);
    let of = |i: usize, key: &str| number(&found["systems"][i], key);
    assert_eq!(of(1, "stops"), 2.0);
    // Levels are 0.07 mm apart; the optic runs at 500 mm/s and settles for 5 ms.
    let want = (of(0, "stops") - 2.0) * (0.005 + 0.07 / 500.0);
    assert!((of(1, "zoom_s") - want).abs() < 1e-4, "{want} {}", of(1, "zoom_s"));
}

#[test]
#[ignore = "slow: make test-all"]
fn protection_option_selects_the_compensation() {
    let dir = folder();
    let job = job(dir.path());
    let error = |name: &str| {
        let found = compared(&["--systems", "sync", "--protection", name], &job);
        let spread = |figure: &str| {
            let rows = found["deviations"].as_array().expect("deviations");
            number(rows.iter().find(|r| r["figure"] == figure).expect("a row"), "worst")
        };
        [spread("spot error"), spread("stage lag")]
    };
    let [saturate, off, accumulated] = ["saturate", "off", "accumulated"].map(error);
    // The field is wide enough here for all that the stage misses: nothing is clipped.
    assert!(saturate == off && saturate[0] > 0.0 && saturate[0] < 0.1 * saturate[1], "{saturate:?} {off:?}");
    // Eq. 5 stops feeding the error where its sum has grown: the spot is then off by what the stage misses.
    assert!((accumulated[0] / accumulated[1] - 1.0).abs() < 0.05, "{accumulated:?}");
    let out = terrace([Path::new("compare"), &job, Path::new("--protection"), Path::new("none")]);
    assert!(out.status.code() == Some(2) && said(&out).contains("accumulated"), "{}", said(&out));
}

/// Every system applies and keeps the limits; the time of seven axes converges; least acceleration is least.
fn holds(found: &Value) {
    let (limits, systems) = (&found["limits"], found["systems"].as_array().expect("systems"));
    assert_eq!(systems.len(), 11);
    for s in systems.iter().filter(|s| s["system"] != "flat") {
        assert!(number(s, "worst_fod_um") <= number(limits, "fod_um") + 0.01, "{s}");
        assert!(number(s, "within_limits_percent") > 99.9, "{s}");
    }
    let grids = found["convergence"].as_array().expect("grids");
    let off: Vec<f64> = grids.iter().map(|g| number(g, "above_the_finest_percent")).collect();
    assert!(off.len() == 3 && off[0].abs() < 10.0 && off[1].abs() < 0.5 * off[0].abs(), "{off:?}");
    let filters = found["decompositions"].as_array().expect("decompositions");
    let (four, least) = filters.split_at(4);
    let best = |key: &str| four.iter().map(|f| number(f, key)).fold(f64::INFINITY, f64::min);
    let (rms, time) = ("rms_stage_acceleration_mm_s2", "time_s");
    // That, or the one that takes no more time than the best filter (but for what its start must stand off), keeps
    // both.
    let (smoothest, last) = (best(rms), least.last().expect("one"));
    let filter = four.iter().find(|f| number(f, rms) == smoothest).expect("the best");
    assert!(number(last, rms) <= 0.8 * smoothest && number(last, time) <= 1.0011 * number(filter, time), "{filters:?}");
    // Every filter for seven axes keeps the limits, and so does least acceleration.
    let seven = found["seven_axis_decompositions"].as_array().expect("decompositions");
    assert_eq!(seven.len(), 5);
    for s in seven {
        let inside = |key: &str, limit: &str| number(s, key) <= number(limits, limit) * (1.0 + 1e-6);
        assert!(
            inside("worst_fod_um", "fod_um") && inside("worst_bia_deg", "bia_deg") && number(s, "least_time_s") > 0.0
        );
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn a_dome_of_450_mm_under_hatch_is_marked_in_every_way() {
    let dir = folder();
    let stl = dir.path().join("dome.stl");
    write_stl(&stl, &mesh(500, [0.0, 0.0, 450.0, 450.0], dome));
    let job = JobText::on(&stl).texture("pattern = \"hatch\"\npitch = \"1 mm\"").write(dir.path(), "dome.toml");
    holds(&compared(&[], &job));
}

#[test]
#[ignore = "slow, needs ../shared: make test-all"]
fn a_drawing_on_450_mm_of_a_hood_is_marked_in_every_way() {
    let (hood, drawing) = (fixture("hood.stl"), shared().join("textures/hero_topography.svg"));
    let keys = format!(
        "file = {:?}\nsize = [\"100 mm\", \"100 mm\"]\ntile = true\nfill = \"outline\"\nstroke = \"centre\"\n\
         area = [\"415 mm\", \"-225 mm\", \"865 mm\", \"225 mm\"]",
        drawing.display().to_string()
    );
    let dir = folder();
    holds(&compared(&[], &JobText::on(&hood).texture(&keys).write(dir.path(), "hood.toml")));
}

#[test]
fn compare_writes_tables_and_charts_to_a_folder_whatever_the_threads() {
    let dir = folder();
    let job = job_of(dir.path(), [24.0, 20.0]);
    let out = dir.path().join("out");
    let run = |threads, folder: &Path| {
        let systems = "flat,contour,tilt,sync,7-axis";
        compared(&["--systems", systems, "-j", threads, "-o", folder.to_str().expect("UTF-8")], &job)
    };
    assert_eq!(run("2", &out), run("1", &dir.path().join("again")), "threads change nothing");
    for file in ["compare.html", "compare.json", "systems.csv", "systems.md", "systems.txt", "decompositions.csv"] {
        assert!(out.join(file).is_file(), "{file}");
    }
    for file in ["times", "back-off", "axes", "along", "paths"] {
        let svg = std::fs::read_to_string(out.join(format!("{file}.svg"))).expect("a chart");
        is_whole(&svg);
    }
    let csv = std::fs::read_to_string(out.join("systems.csv")).expect("a table");
    assert_eq!(csv.lines().count(), 6, "{csv}");
    // A comparison is replaced, anything else is not.
    compared(&["--systems", "flat", "-o", out.to_str().expect("UTF-8")], &job);
    let other = dir.path().join("mine");
    std::fs::create_dir(&other).expect("a folder");
    std::fs::write(other.join("letter.txt"), "keep").expect("a file");
    let refused =
        terrace([Path::new("compare"), &job, Path::new("--systems"), Path::new("flat"), Path::new("-o"), &other]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(said(&refused).contains("output-not-a-comparison") && other.join("letter.txt").is_file());
    // Nor is a comparison to which something was added.
    std::fs::write(out.join("letter.txt"), "keep").expect("a file");
    let refused =
        terrace([Path::new("compare"), &job, Path::new("--systems"), Path::new("flat"), Path::new("-o"), &out]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(said(&refused).contains("letter.txt") && out.join("letter.txt").is_file());
}

/// Well-formed, as far as brackets tell.
fn is_whole(svg: &str) {
    assert!(svg.starts_with("<svg") || svg.starts_with("<?xml"), "{}", &svg[..40.min(svg.len())]);
    assert_eq!(svg.matches("<svg").count(), svg.matches("</svg>").count());
}

#[test]
fn unknown_systems_are_named_with_the_known_ones() {
    let dir = folder();
    let out = terrace([Path::new("compare"), &job(dir.path()), Path::new("--systems"), Path::new("flat,9-axis")]);
    assert_eq!(out.status.code(), Some(2));
    assert!(said(&out).contains("7-axis-smooth"), "{}", said(&out));
}
