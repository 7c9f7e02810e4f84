//! `terrace compare`: every system in one table, within the limits where it promises them, the same on any
//! number of threads.

use std::path::{Path, PathBuf};
use terrace_core::math;

use crate::support::surfaces::{dome, mesh, write_stl};
use crate::support::{JobText, fixture, folder, machine_file, number, said, shared, summary_of, terrace};
use serde_json::Value;

/// A bulge of a millimetre under hatch and squares.
fn job(dir: &Path) -> PathBuf {
    job_of(dir, [48.0, 42.0])
}

/// Some of it.
fn job_of(dir: &Path, [w, h]: [f64; 2]) -> PathBuf {
    let stl = dir.join("bulge.stl");
    write_stl(&stl, &mesh(30, [0.0, 0.0, w, h], |x, y| math::sin(x / 20.0) * math::cos(y / 17.0)));
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
#[ignore = "slow: make test-all"]
fn every_system_is_timed_and_keeps_what_it_promises() {
    let dir = folder();
    let job = job(dir.path());
    let found = compared(&[], &job);
    let limits = &found["limits"];
    let systems = found["systems"].as_array().expect("systems");
    let of = |name: &str| systems.iter().find(|s| s["system"] == name).unwrap_or_else(|| panic!("no {name}"));
    assert_eq!(systems.len(), 14);
    // Of another process, for which this machine has no tool.
    for s in systems.iter().filter(|s| s["system"] != "tool-servo") {
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
    // A head that tilts divides the part as a table does.
    assert_eq!(number(of("head-tilt"), "stops"), number(of("tilt"), "stops"));
    assert!(of("head-tilt")["note"].to_string().contains("rob-scan"), "{}", of("head-tilt"));
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
    assert!(filters.len() >= 3 && filters.iter().all(|f| rms(least) <= rms(f)), "{filters:?}");
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
    assert_eq!(systems.len(), terrace_compare::compare::SYSTEMS.len());
    for s in systems.iter().filter(|s| !["flat", "tool-servo"].iter().any(|name| s["system"] == *name)) {
        assert!(number(s, "worst_fod_um") <= number(limits, "fod_um") + 0.01, "{s}");
        assert!(number(s, "within_limits_percent") > 99.9, "{s}");
    }
    let grids = found["convergence"].as_array().expect("grids");
    let off: Vec<f64> = grids.iter().map(|g| number(g, "above_the_finest_percent")).collect();
    assert!(off.len() == 3 && off[0].abs() < 10.0 && off[1].abs() < 0.5 * off[0].abs(), "{off:?}");
    let filters = found["decompositions"].as_array().expect("decompositions");
    let (all, least) = filters.split_at(2);
    let best = |key: &str| all.iter().map(|f| number(f, key)).fold(f64::INFINITY, f64::min);
    let (rms, time) = ("rms_stage_acceleration_mm_s2", "time_s");
    // That, or the one that takes no more time than the best filter (but for what its start must stand off), keeps
    // both.
    let (smoothest, last) = (best(rms), least.last().expect("one"));
    let filter = all.iter().find(|f| number(f, rms) == smoothest).expect("the best");
    assert!(number(last, rms) <= 0.8 * smoothest && number(last, time) <= 1.0011 * number(filter, time), "{filters:?}");
    // Every filter for seven axes keeps the limits, and so does least acceleration.
    let seven = found["seven_axis_decompositions"].as_array().expect("decompositions");
    assert_eq!(seven.len(), 3);
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
#[ignore = "slow: make test-all"]
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
    for file in ["times", "back-off", "axes", "along", "space", "following-7-axis", "paths", "velocities"] {
        let svg = std::fs::read_to_string(out.join(format!("{file}.svg"))).expect("a chart");
        is_whole(&svg);
    }
    // The back-off search goes down by 0.95 to the first sigma that holds.
    let found: Value = serde_json::from_slice(&std::fs::read(out.join("compare.json")).expect("a file")).expect("JSON");
    let trials = found["back_off"].as_array().expect("trials");
    let sigma = |k: usize| 30_000.0 * 0.95f64.powi(k as i32);
    assert!(trials.iter().enumerate().all(|(k, t)| (number(t, "sigma_um") / sigma(k) - 1.0).abs() < 1e-12));
    let holds: Vec<bool> = trials.iter().map(|t| t["within_limits"] == "yes").collect();
    assert_eq!(holds.iter().position(|h| *h), Some(trials.len() - 1), "{trials:?}");
    let csv = std::fs::read_to_string(out.join("back-off.csv")).expect("a table");
    assert_eq!(csv.lines().count(), trials.len() + 1, "{csv}");
    assert_eq!(found["following_errors"].as_array().map(Vec::len), Some(7));
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

/// Height over (x, y), mm.
type Height = fn(f64, f64) -> f64;

/// Ten small jobs: planes, domes, cylinders, saddles and slopes on machines of every kind, with blocks that a person
/// loads, pens of several passes and rates of an hour; each with the systems that are asked for.
fn ten_jobs(dir: &Path) -> Vec<(PathBuf, &'static str)> {
    const STEPPED: &str = "flat,contour,z-range,window,zoom,tilt";
    const MOST: &str = "flat,contour,z-range,window,zoom,tilt,sync,sync-bands,7-axis-smooth";
    const ALL: &str = "flat,contour,z-range,window,zoom,tilt,sync,sync-bands,7-axis,7-axis-smooth,5-axis";
    // Nobody states who loads the blocks: a person is assumed.
    let cost = machine_file("xyz-galvo-40").replacen("\nway = \"run\"", "\n#", 1)
        + "\n[cost]\nmachine = \"80 EUR/h\"\noperator = \"45 EUR/h\"\n";
    std::fs::write(dir.join("cost.toml"), cost).expect("a writable folder");
    let plane: Height = |_, _| 0.0;
    let dome: Height = |x, y| -(x * x + y * y) / 60.0;
    let cylinder: Height = |x, _| -x * x / 40.0;
    let saddle: Height = |x, y| (x * x - y * y) / 50.0;
    let slope: Height = |x, _| 0.5 * x;
    let wave: Height = |x, y| 0.1 * math::sin(x + 0.3 * y);
    let jobs: [(Height, &str, &str, &str); 10] = [
        (plane, "profile = \"xyz-galvo-40\"", "", MOST),
        (plane, "profile = \"xyz-galvo-40\"", "mode = \"on-the-fly\"", "flat,contour,sync,sync-bands"),
        (dome, "profile = \"xyz-galvo-40\"", "", ALL),
        (dome, "profile = \"xyz-zoom-40\"", "", MOST),
        (cylinder, "profile = \"xyz-galvo-100\"", "passes = 3", MOST),
        (saddle, "file = \"cost.toml\"", "formats = [\"dxf\"]", MOST),
        (slope, "profile = \"xyz-galvo-40\"", "", STEPPED),
        (slope, "profile = \"xyz-tilt-galvo-40\"", "", MOST),
        (saddle, "profile = \"xyzac-galvo-10\"", "", ALL),
        (wave, "profile = \"xyz-tilt-galvo-40\"", "formats = [\"dxf\"]", STEPPED),
    ];
    let mut out = Vec::new();
    for (k, (height, machine, more, systems)) in jobs.into_iter().enumerate() {
        let stl = dir.join(format!("{k}.stl"));
        write_stl(&stl, &mesh(16, [-4.0, -3.0, 4.0, 3.0], height));
        let mut job = JobText::on(&stl).texture("pattern = \"hatch\"\npitch = \"2 mm\"");
        job.machine = machine.into();
        match more.split(' ').next() {
            Some("mode") => {}
            Some("formats") => job.more = format!("[emit]\n{more}\n"),
            // Keys of the last table, which is the pen's.
            _ => job.more = format!("{more}\n"),
        }
        let path = job.write(dir, &format!("{k}.toml"));
        if more.starts_with("mode") {
            let text = std::fs::read_to_string(&path).expect("a job");
            std::fs::write(&path, format!("{more}\n{}", text.replace("method = \"contour\"", ""))).expect("written");
        }
        out.push((path, systems));
    }
    out
}

/// What the verdict must be, from the table of systems alone: the fastest row within limits that runs on the job's
/// machine and has a key of the job file.
fn fastest<'a>(found: &'a Value, seconds: &dyn Fn(&Value) -> f64) -> Option<&'a Value> {
    let rows = found["systems"].as_array().expect("systems").iter();
    let usable = rows.filter(|s| {
        s["within_limits_percent"].as_f64() == Some(100.0)
            && s["beyond"].is_null()
            && s["machine"] == found["machine"]
            && s["job_key"].is_string()
    });
    usable.min_by(|a, b| seconds(a).total_cmp(&seconds(b)))
}

/// How a row of the table of systems stands.
fn standing_of<'a>(found: &'a Value, row: &Value) -> &'a str {
    let all = found["verdict"]["systems"].as_array().expect("a list");
    let printed = all.iter().find(|printed| printed["system"] == row["system"]).expect("every system");
    printed["standing"].as_str().expect("a standing")
}

/// The verdict of a comparison against its tables.
fn verdict_agrees(found: &Value, page: &str) {
    let (verdict, limits) = (&found["verdict"], &found["limits"]);
    let seconds = |s: &Value| s["with_loading_s"].as_f64().unwrap_or_else(|| number(s, "total_s"));
    let best = fastest(found, &seconds);
    assert_eq!(verdict["recommended"], best.map_or(Value::Null, |s| s["system"].clone()), "{found:#}");
    let sentences = verdict["sentences"].as_array().expect("sentences");
    let answer = sentences[0].as_str().expect("words");
    assert!(page.contains(&format!("<p class=\"answer\">{answer}</p>")), "{answer}");
    if let Some(best) = best {
        // What is recommended is so good that the limits hold without the table's own word for it.
        assert!(number(best, "worst_fod_um") <= number(limits, "fod_um") + 2e-3, "{best}");
        assert!(number(best, "worst_bia_deg") <= number(limits, "bia_deg") + 1e-6, "{best}");
        assert!(number(best, "worst_displacement_mm") <= number(limits, "displacement_mm") + 2e-6, "{best}");
        assert!(answer.contains(&terrace_core::duration::duration(seconds(best))), "{answer}");
        assert_eq!(verdict["job_key"], best["job_key"]);
    } else {
        let is_made = |s: &&Value| standing_of(found, s) == "yours-to-set" && s["job_key"].is_string();
        let may_be_set = found["systems"].as_array().expect("systems").iter().filter(is_made);
        let nearest =
            may_be_set.filter(|s| s["machine"] == found["machine"]).min_by(|a, b| seconds(a).total_cmp(&seconds(b)));
        match nearest {
            Some(s) => {
                let printed = format!("Yours to set: {} takes {}", s["system"].as_str().expect("a name"), {
                    terrace_core::duration::duration(seconds(s))
                });
                assert!(answer.starts_with(&printed) && answer.contains("limits.warn_incidence"), "{answer}");
            }
            None => assert!(answer.starts_with("None of these systems keeps all limits"), "{answer}"),
        }
    }
    let of = |list: &'static str| found[list].as_array().expect("a table").iter();
    for ((row, printed), short) in of("systems").zip(verdict["systems"].as_array().expect("a list")).zip(of("overview"))
    {
        assert!(printed["system"] == row["system"] && short["system"] == row["system"]);
        let note = short["note"].as_str().expect("a note");
        if row["total_s"].is_null() {
            assert!(printed["standing"] == "does-not-apply" && note.starts_with("does not apply: "), "{printed}");
            continue;
        }
        let keeps = number(row, "within_limits_percent") == 100.0 && row["beyond"].is_null();
        let is_own = row["machine"] == found["machine"];
        // What only the incidence keeps from the limits is warned of by compile.
        let beyond = row["beyond"].as_str().unwrap_or_default();
        let is_yours = !keeps && beyond.starts_with("beam incidence ") && !beyond.contains(';');
        let standing = match (keeps, is_own, row["job_key"].is_string()) {
            _ if is_yours => "yours-to-set",
            (false, ..) => "beyond-limits",
            _ if verdict["recommended"] == row["system"] => "recommended",
            (_, false, _) => "other-hardware",
            (_, _, false) => "estimate-only",
            _ => "usable",
        };
        assert_eq!(printed["standing"], standing, "{row}");
        assert_eq!(note.starts_with("not usable: "), !keeps && !is_yours, "{note}");
        assert_eq!(note.starts_with("yours to set: "), is_yours, "{note}");
        let name = row["system"].as_str().expect("a name");
        let is_struck = page.contains(&format!("<s>{name}</s>"));
        assert_eq!(is_struck, !keeps && !is_yours, "{name} is struck out where it must not be used");
        let ratio = best.map(|best| seconds(row) / seconds(best));
        let said = printed["times_the_recommended"].as_f64();
        assert!(ratio.zip(said).is_none_or(|(a, b)| (a / b - 1.0).abs() < 1e-12) && ratio.is_some() == said.is_some());
        // Whatever the system, the job has one length of marks, or the row says what is missing.
        let (marked, whole) = (number(row, "marked_m"), number(found, "marked_m"));
        let printed = row["note"].as_str().is_some_and(|note| note.contains("mm less: "));
        assert!(marked <= whole * (1.0 + 1e-9) && (marked > 0.999 * whole || printed), "{name}: {marked} {whole}");
    }
}

/// Holds the verdicts of the first jobs against their tables; answers what they recommend.
fn verdicts(count: usize) -> Vec<String> {
    let dir = folder();
    let mut recommended = Vec::new();
    for (k, (job, systems)) in ten_jobs(dir.path()).into_iter().enumerate().take(count) {
        let out = dir.path().join(format!("out-{k}"));
        let found = compared(&["--systems", systems, "-o", out.to_str().expect("UTF-8")], &job);
        let page = std::fs::read_to_string(out.join("compare.html")).expect("a page");
        verdict_agrees(&found, &page);
        recommended.push(found["verdict"]["recommended"].as_str().unwrap_or("none").to_owned());
        let costs = found["overview"].as_array().expect("rows").iter().filter(|s| s["cost_eur"].is_f64()).count();
        assert_eq!(costs > 0, k == 5, "rates are given once: {found:#}");
    }
    recommended
}

#[test]
fn verdict_agrees_with_the_table_and_recommends_nothing_beyond_the_limits() {
    assert_eq!(verdicts(2).len(), 2);
}

#[test]
#[ignore = "slow"]
fn verdict_of_ten_jobs_agrees_with_the_tables_and_recommends_nothing_beyond_the_limits() {
    let recommended = verdicts(10);
    assert_eq!(recommended.len(), 10);
    // The jobs are of different kinds.
    for system in ["none", "zoom", "tilt", "sync", "7-axis"] {
        assert!(recommended.iter().any(|r| r == system), "{system}: {recommended:?}");
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn marked_length_is_that_of_compile_with_every_pass_of_the_pens() {
    let dir = folder();
    let stl = dir.path().join("bulge.stl");
    write_stl(&stl, &mesh(20, [0.0, 0.0, 8.0, 6.0], |x, y| 0.2 * math::sin(x / 3.0) * math::cos(y / 2.0)));
    let marked = |passes: u32| {
        let mut job = JobText::on(&stl).method("z-range").texture("pattern = \"hatch\"\npitch = \"2 mm\"");
        job.more = format!("passes = {passes}\n");
        let path = job.write(dir.path(), "job.toml");
        let systems = "flat,contour,z-range,window,zoom,tilt,sync,sync-bands,7-axis-smooth,5-axis";
        let found = compared(&["--systems", systems], &path);
        let compiled = number(&summary_of(&path), "mark_mm") / 1000.0;
        let rows = found["systems"].as_array().expect("systems");
        for row in rows {
            assert!((number(row, "marked_m") / compiled - 1.0).abs() < 1e-9, "{compiled} {row}");
        }
        let time = |name: &str| number(rows.iter().find(|r| r["system"] == name).expect("a row"), "mark_s");
        ([time("z-range"), time("5-axis")], compiled)
    };
    let ((once, short), (thrice, long)) = (marked(1), marked(3));
    assert!((long / short - 3.0).abs() < 1e-9);
    // Their times are those of three passes too, on the fly as well as stepped.
    for (one, three) in once.into_iter().zip(thrice) {
        assert!((three / one - 3.0).abs() < 0.05, "{one} {three}");
    }
}

/// The dish that is turned in `fixtures/sources/brecher`, its machine file changed.
fn turned(dir: &Path, volts: u32, edit: impl Fn(String) -> String) -> Value {
    let at = |name: &str| fixture("sources/brecher").join(name);
    let machine = format!("fts-{volts}v.toml");
    let text = std::fs::read_to_string(at(&machine)).expect("a machine");
    std::fs::write(dir.join(&machine), edit(text)).expect("a writable file");
    for name in ["dish.ply".to_owned(), format!("dish-{volts}v.toml")] {
        std::fs::copy(at(&name), dir.join(&name)).expect("a writable file");
    }
    let exact = at("dish.nurbs.json").display().to_string();
    compared(&["--systems", "z-range,tool-servo", "--nurbs", &exact], &dir.join(format!("dish-{volts}v.toml")))
}

/// What is needed of a figure of the tool servo, and its limit where it has one.
fn need(found: &Value, figure: &str) -> (f64, Option<f64>) {
    let rows = found["tool_servo"].as_array().expect("a table");
    let row = rows.iter().find(|row| row["figure"] == figure).unwrap_or_else(|| panic!("no {figure} in {rows:?}"));
    (number(row, "needed"), row["limit"].as_f64())
}

#[test]
#[ignore = "slow: make test-all"]
fn tool_servo_turns_the_surface_within_its_drive_and_is_never_recommended() {
    let dir = folder();
    let found = turned(dir.path(), 50, |text| text);
    let systems = &found["verdict"]["systems"];
    assert_eq!((&systems[0]["standing"], &systems[1]["standing"]), (&"recommended".into(), &"other-process".into()));
    assert_eq!(systems[1]["times_the_recommended"], Value::Null);
    let sentences = found["verdict"]["sentences"].to_string();
    assert!(sentences.contains("another process, which marks no texture"), "{sentences}");
    let row = &found["systems"][1];
    assert_eq!((&row["worst_fod_um"], &row["marked_m"], &row["job_key"]), (&Value::Null, &Value::Null, &Value::Null));
    // The corners of the texture are the farthest marks; 1.8 mm a minute.
    let radius = 10.6 * 2f64.sqrt();
    assert!((number(row, "total_s") / (radius / 1.8 * 60.0) - 1.0).abs() < 0.01, "{row}");
    assert!(row["note"].as_str().expect("a note").contains("heights by algorithm II"), "{row}");
    assert_eq!(need(&found, "set-points per second").0, 8000.0);
    assert!((need(&found, "set-points per revolution").0 - 2400.0).abs() < 1e-9);
    assert!((need(&found, "feed per revolution").0 - 9.0).abs() < 1e-9);
    let (jerk, limit) = need(&found, "jerk");
    assert!((limit.expect("a limit") / 133_547.0 - 1.0).abs() < 0.005);
    // Around the rim z goes through waves of 0.2 mm that are some 7 to 12 mm long: amplitude times angular frequency
    // to the third.
    let wave = |length: f64| 0.2e-3 * (std::f64::consts::TAU * (radius * 20.944) / length).powi(3);
    assert!(jerk > wave(12.0) && jerk < 2.0 * wave(7.0), "{jerk}: {} {}", wave(12.0), wave(7.0));
    assert!((need(&found, "time of the full stroke").0 / 12.41 - 1.0).abs() < 0.04);
    assert!((need(&found, "top speed of the full stroke").0 / 1.289 - 1.0).abs() < 0.04);
    let (needed, limit) = need(&found, "jerk of 4000 um at 64 Hz");
    assert!(needed < limit.expect("a limit"));
    // The speed is fed forward: what is left is the acceleration over omega squared.
    let lag = need(&found, "acceleration").0 * 1e6 / (std::f64::consts::TAU * 200.0).powi(2);
    let late = need(&found, "worst following error").0;
    assert!((late / lag - 1.0).abs() < 0.1, "{late} um, {lag} um");
    let stroke = need(&found, "stroke");
    assert!(stroke.0 > 0.8 && stroke.0 < 1.6 && stroke.1 == Some(8.0), "{stroke:?}");
}

#[test]
#[ignore = "slow: make test-all"]
fn tool_servo_beyond_its_drive_is_named_with_the_figure_that_it_does_not_reach() {
    let dir = folder();
    let found = turned(dir.path(), 200, |text| text);
    let note = found["systems"][1]["note"].to_string();
    assert!(note.contains("the drive does not make 300 um at 300 Hz: 1.88 times its jerk"), "{note}");
    assert!((need(&found, "time of the full stroke").0 / 7.82 - 1.0).abs() < 0.04);
    assert!((need(&found, "top speed of the full stroke").0 / 2.047 - 1.0).abs() < 0.04);
    assert!((need(&found, "jerk").1.expect("a limit") / 534_188.0 - 1.0).abs() < 0.005);
    // Ten times the speed of the spindle takes 1000 times the jerk.
    let slow = need(&found, "jerk").0;
    let found = turned(dir.path(), 200, |text| text.replace("200 1/min", "2000 rpm").replace("8 mm\"  ", "0.5 mm\""));
    assert!((need(&found, "jerk").0 / slow / 1000.0 - 1.0).abs() < 0.1, "{} {slow}", need(&found, "jerk").0);
    let system = &found["verdict"]["systems"][1];
    assert_eq!(system["standing"], "beyond-limits");
    let reasons = system["reasons"].to_string();
    assert!(
        reasons.contains("stroke of ") && reasons.contains("jerk of ") && reasons.contains("m/s3 allowed"),
        "{reasons}"
    );
}

#[test]
#[ignore = "slow: make test-all"]
fn tool_servo_does_not_apply_without_a_tool_or_without_the_exact_surface_of_the_part() {
    let dir = folder();
    let standing = |job: &Path, args: &[&str]| {
        let found = compared(&[&["--systems", "z-range,tool-servo"], args].concat(), job);
        let system = found["verdict"]["systems"][1].clone();
        assert_eq!((&system["standing"], &system["time_s"]), (&"does-not-apply".into(), &Value::Null), "{system}");
        system["reasons"].to_string()
    };
    let exact = fixture("sources/brecher/dish.nurbs.json").display().to_string();
    let plain = job(dir.path());
    assert!(standing(&plain, &[]).contains("the machine file states no tool servo"));
    let dish = fixture("sources/brecher/dish-50v.toml");
    assert!(standing(&dish, &[]).contains("needs the exact surface"));
    let patch = fixture("sources/brecher/patch.nurbs.json").display().to_string();
    let reasons = standing(&dish, &["--nurbs", &patch]);
    assert!(reasons.contains("is not under the mark at"), "{reasons}");
    // Another surface of the same size.
    let text = std::fs::read_to_string(&exact).expect("a surface").replace("-0.", "-0.9");
    let other = dir.path().join("other.nurbs.json");
    std::fs::write(&other, text).expect("a writable file");
    let reasons = standing(&dish, &["--nurbs", &other.display().to_string()]);
    assert!(reasons.contains("mm off the part, 0.035 mm allowed"), "{reasons}");
}

#[test]
fn jerk_of_a_tool_servo_is_stated_once() {
    let dir = folder();
    let text = std::fs::read_to_string(fixture("sources/brecher/fts-50v.toml")).expect("a machine");
    let file = dir.path().join("fts-50v.toml");
    std::fs::copy(fixture("sources/brecher/dish.ply"), dir.path().join("dish.ply")).expect("a writable file");
    let job = dir.path().join("dish-50v.toml");
    std::fs::copy(fixture("sources/brecher/dish-50v.toml"), &job).expect("a writable file");
    let neither = text.split("[tool_servo.drive]").next().expect("a machine").to_owned();
    let both = text.replace("stroke = \"8 mm\"", "jerk = \"1e8 mm/s3\"\nstroke = \"8 mm\"");
    for (bad, code, says) in [
        (neither, "machine-tool-servo", "twice or not at all"),
        (both, "machine-tool-servo", "twice or not at all"),
        (text.replace("damping = 0.7", "damping = 70.0"), "machine-servo", "damping"),
        (text.replace("1.6 kg", "1.6 mg"), "toml", "unknown unit"),
        (text.replace("200 1/min", "2e6 1/min"), "machine-range", "tool_servo.spindle"),
        (text.replace("1.8 mm/min", "0 mm/min"), "toml", "greater than zero"),
        (text.replace("frequency = \"64 Hz\"", "frequency = \"2 MHz\""), "machine-range", "tool_servo.oscillations"),
    ] {
        std::fs::write(&file, bad).expect("a writable file");
        let out = terrace([Path::new("compare"), &job]);
        assert!(
            out.status.code() == Some(2) && said(&out).contains(code) && said(&out).contains(says),
            "{}",
            said(&out)
        );
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn a_key_of_the_job_that_makes_stepping_slower_is_named_with_the_time_without_it() {
    let dir = folder();
    let stl = dir.path().join("plate.stl");
    write_stl(&stl, &mesh(4, [0.0, 0.0, 90.0, 30.0], |_, _| 0.0));
    let text = |keys: &str| JobText::on(&stl).texture("pattern = \"hatch\"\npitch = \"1 mm\"").partition(keys);
    let dear = text("overlap = \"8 mm\"").write(dir.path(), "dear.toml");
    let whole = text("").write(dir.path(), "whole.toml");
    let [dear, whole] = [&dear, &whole].map(|job| compared(&["--systems", "flat,contour"], job));
    let contour = |found: &Value| number(&found["systems"][1], "total_s");
    let cost = &dear["key_costs"][0];
    assert_eq!(
        (&cost["system"], &cost["key"], &cost["value"]),
        (&"contour".into(), &"partition.overlap".into(), &"8 mm".into())
    );
    assert!((number(cost, "time_s") - contour(&whole)).abs() < 1e-9, "{cost} {whole:#}");
    let printed = dear["verdict"]["sentences"].to_string();
    assert!(printed.contains("partition.overlap = \\\"8 mm\\\" of the job file, not the machine, costs "), "{printed}");
    assert_eq!(whole["key_costs"], Value::Array(Vec::new()));
}
