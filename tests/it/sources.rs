//! The figures of docs/explanation/compare.md: what stands there between `<!-- make sources: NAME -->` and `<!-- end of
//! NAME -->` is made anew from the JSON of the program and held against the page; `make sources` writes it. The jobs are those of
//! `fixtures/sources`, after the articles, and the hood.

mod page;

use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::OnceLock;

use serde_json::Value;

use self::page::{hold, table, wrapped};
use crate::support::{compile, folder, number, said, verify};

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// Parts that all systems are compared on: what the page calls them, and their jobs.
const PARTS: [(&str, &str); 4] = [
    ("dome, lines", "fixtures/sources/cao/lines.toml"),
    ("hood, leather", "fixtures/hood.toml"),
    ("Cui's plate", CUI),
    ("Ma's part", "fixtures/sources/ma/job.toml"),
];
const MA: usize = 3;
const CUI: &str = "fixtures/sources/cui/job.toml";

/// Systems that step with nothing but an XYZ stage, those that step with more, and those that do not mark.
const PLAIN: [&str; 5] = ["auto", "flat", "contour", "z-range", "window"];
const STEPPED_WITH_MORE: [&str; 3] = ["zoom", "tilt", "head-tilt"];
const OTHER_PROCESSES: [&str; 1] = ["tool-servo"];

// --- Runs

/// What the program answers as JSON at the root of the repository, a job on standard input.
fn answer(args: &[&str], job: &str, folder: &Path) -> Value {
    let mut program = Command::new(env!("CARGO_BIN_EXE_terrace"));
    let piped = program.args(args).args(["-", "--json"]).current_dir(folder);
    let mut child =
        piped.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("the program starts");
    child.stdin.take().expect("a pipe").write_all(job.as_bytes()).expect("read to its end");
    let out = child.wait_with_output().expect("the program ends");
    assert!(out.status.success(), "{args:?}: {}", said(&out));
    serde_json::from_slice(&out.stdout).expect("JSON")
}

/// A job of the repository with parts of its text replaced, each of which it has.
fn changed(args: &[&str], job: &str, changes: &[(&str, &str)]) -> Value {
    let path = Path::new(ROOT).join(job);
    let text = std::fs::read_to_string(&path).expect("a job");
    answer(args, &replaced(text, changes), path.parent().expect("a folder"))
}

fn replaced(text: String, changes: &[(&str, &str)]) -> String {
    changes.iter().fold(text, |text, (from, to)| {
        assert!(text.contains(from), "{from} in {text}");
        text.replace(from, to)
    })
}

/// The comparison of a part in all systems, made once.
fn comparison(part: usize) -> &'static Value {
    static MADE: [OnceLock<Value>; PARTS.len()] = [const { OnceLock::new() }; PARTS.len()];
    MADE[part].get_or_init(|| changed(&["compare"], PARTS[part].1, &[]))
}

fn row<'a>(found: &'a Value, system: &str) -> &'a Value {
    let rows = found["systems"].as_array().expect("systems");
    rows.iter().find(|s| s["system"] == system).unwrap_or_else(|| panic!("no {system}"))
}

fn total(found: &Value, system: &str) -> f64 {
    number(row(found, system), "total_s")
}

/// A table of a comparison, empty where it has none.
fn list<'a>(found: &'a Value, key: &str) -> &'a [Value] {
    found[key].as_array().map_or(&[], Vec::as_slice)
}

/// One figure of a system as it is spread over the marks.
fn spread<'a>(found: &'a Value, system: &str, figure: &str) -> &'a Value {
    let rows = found["deviations"].as_array().expect("deviations");
    rows.iter().find(|r| r["system"] == system && r["figure"] == figure).unwrap_or_else(|| panic!("{system}: {figure}"))
}

fn note<'a>(found: &'a Value, system: &str) -> &'a str {
    row(found, system)["note"].as_str().expect("a note")
}

/// The number that follows `before` in a note.
fn said_after(note: &str, before: &str) -> f64 {
    let rest = note.split(before).nth(1).unwrap_or_else(|| panic!("{before:?} in {note:?}"));
    rest.split(' ').next().expect("a word").parse().unwrap_or_else(|e| panic!("{rest}: {e}"))
}

fn time(seconds: f64) -> String {
    match seconds {
        s if s < 100.0 => format!("{s:.2} s"),
        s if s < 6000.0 => format!("{:.1} min", s / 60.0),
        s => format!("{:.0} min", s / 60.0),
    }
}

fn whole(n: f64) -> String {
    let digits = format!("{n:.0}");
    let parts: Vec<&str> =
        digits.as_bytes().rchunks(3).rev().map(|c| std::str::from_utf8(c).expect("digits")).collect();
    parts.join(",")
}

fn cells<const N: usize>(texts: [&str; N]) -> Vec<String> {
    texts.map(str::to_owned).to_vec()
}

// --- Cui et al.

#[test]
#[ignore = "slow: make test-all"]
fn figures_of_cui_are_those_of_the_page_and_close_to_the_article() {
    let found = changed(&["compare", "--systems", "z-range,sync"], CUI, &[]);
    let [stepped, synchronised] = ["z-range", "sync"].map(|system| total(&found, system));
    let saving = 100.0 * (1.0 - synchronised / stepped);
    assert_eq!(row(&found, "z-range")["stops"], 8);
    assert!((67.95..=68.3).contains(&stepped), "{stepped}");
    assert!((41.98..=42.5).contains(&synchronised), "{synchronised}");
    assert!((saving - 38.2).abs() <= 0.3, "{saving}");
    let [slow, fast] = [1000, 5000].map(samples_of_the_triangle);
    assert_eq!([slow, fast], [191.0, 39.0]);
    let stitch = number(row(&found, "z-range"), "stitch_um");
    let models = ["z-range", "sync"].map(|system| format!("{:.2} s", number(row(&found, system), "model_s")));
    let rows = vec![
        cells(["stepped, 8 stops", "67.95 s", &time(stepped)]),
        cells(["synchronised", "41.98 s", &time(synchronised)]),
        cells(["saved", "38.22 %", &format!("{saving:.2} %")]),
        cells(["by eq. 8 and 9 from the counts of the job", "", &models.join(", ")]),
        cells(["p by eq. 4, triangle of 100 mm/s, stage of 1000 mm/s2", "", &whole(slow)]),
        cells(["the same, stage of 5000 mm/s2", "", &whole(fast)]),
        cells(["error of stitching", "84.93 um", &format!("{stitch:.1} um, from the accuracy of the stage alone")]),
    ];
    hold("cui", &table(&["figure", "article", "here"], rows));
    hold("heat", &heat(&found));
}

/// What explains the temperature that the article prints, for every radius that the beam may have had.
fn heat(found: &Value) -> String {
    let fits = list(found, "heat");
    let absorptivities = fits.iter().map(|fit| number(fit, "absorptivity"));
    let [least, most] = absorptivities.fold([1.0f64, 0.0f64], |[l, m], a| [l.min(a), m.max(a)]);
    assert!(least < 0.035 && most > 0.39, "{least} {most}");
    let second =
        [10, 100, 1000].map(|ms| (format!("after {ms} ms, degC"), format!("second_exposure_after_{ms}_ms_degc")));
    let row = |fit: &Value| {
        let figure = |key: &str, digits: usize| format!("{:.digits$}", number(fit, key));
        let hot = second.iter().map(|(_, key)| figure(key, 0));
        [figure("radius_um", 0), figure("absorptivity", 3)].into_iter().chain(hot).collect()
    };
    let head: Vec<&str> =
        ["radius, um", "absorptivity"].into_iter().chain(second.iter().map(|(name, _)| name.as_str())).collect();
    table(&head, fits.iter().map(row).collect())
        + "\n"
        + &wrapped(&format!("So any absorptivity from {least:.2} to {most:.1} fits."))
}

/// Samples of the moving average that eq. 4 gives for a stage of this acceleration, mm/s2.
fn samples_of_the_triangle(acceleration: u32) -> f64 {
    let dir = folder();
    let cui = Path::new(ROOT).join("fixtures/sources/cui");
    let machine = std::fs::read_to_string(cui.join("machine.toml")).expect("a machine");
    let own = dir.path().join("machine.toml");
    let stage = format!("acceleration = \"{acceleration} mm/s2\"");
    std::fs::write(&own, replaced(machine, &[("acceleration = \"5000 mm/s2\"", &stage)])).expect("a writable folder");
    let (job, own) = ("fixtures/sources/cui/triangle.toml", own.display().to_string());
    let found = changed(&["compare", "--systems", "sync"], job, &[("\"machine.toml\"", &format!("{own:?}"))]);
    let note = note(&found, "sync");
    assert!(note.contains("of 1.0 ms"), "{note}");
    said_after(note, "eq. 4: p = ")
}

#[test]
fn job_of_cui_compiles_and_verifies() {
    let dir = folder();
    let out = dir.path().join("cui.job");
    assert_eq!(compile(&Path::new(ROOT).join(CUI), &out)["stops"], 8);
    verify(&out);
}

// --- Cao and Zhu

#[test]
#[ignore = "slow: make test-all, make sources"]
fn figures_of_cao_are_those_of_the_page_and_close_to_the_article() {
    const JOB: &str = "fixtures/sources/cao/job.toml";
    let contour = changed(&["check"], JOB, &[]);
    let z_range = changed(&["check"], JOB, &[("\"contour\"", "\"z-range\"")]);
    let squares = [("\"jerusalem\"", "\"squares\""), ("\"1.4 mm\"\nwidth = \"0.1 mm\"\nbar = \"0.7 mm\"", "\"1 mm\"")];
    let sparse = changed(&["check"], JOB, &squares);
    let stops = |v: &Value| whole(number(v, "stops"));
    assert!((3560.0..=3590.0).contains(&number(&contour, "stops")), "{}", stops(&contour));
    assert!(number(&contour, "worst_defocus_um") <= 35.0 + 1e-6);
    let um = |key: &str| format!("{:.1} um", number(&contour, key));
    let rows = vec![
        cells(["sub-blocks by contour lines", "3553", &whole(number(&contour, "sub_blocks"))]),
        cells(["stops by contour lines", "", &stops(&contour)]),
        cells(["the same, squares of 1 mm in place of Jerusalem crosses", "", &stops(&sparse)]),
        cells(["stops by `z-range`", "", &stops(&z_range)]),
        cells(["stops, at least", "", &whole(number(&contour, "lower_bound_stops"))]),
        cells(["worst distance from focus, planes in the middle", "", &um("worst_defocus_um")]),
        cells(["worst distance from focus, planes at the mean height", "", &um("worst_defocus_mean_um")]),
        cells(["error of the spacing of cells, of their shape", "0.06 mm, 0.03 mm", &{
            let lateral = number(&contour["budget"]["lateral"], "sum_um");
            format!("{lateral:.1} um lateral, as far as the budget knows its terms")
        }]),
    ];
    hold("cao", &table(&["figure", "article", "here"], rows));
}

// --- Ma et al.

#[test]
#[ignore = "slow: make test-all, make sources"]
fn figures_of_ma_are_those_of_the_page() {
    let found = comparison(MA);
    let [seven, smooth, five] = ["7-axis", "7-axis-smooth", "5-axis"].map(|system| total(found, system));
    assert!(seven < five && smooth < five, "{seven} {smooth} {five}");
    let worst = |key: &str, digits: usize| format!("{:.digits$}", number(row(found, "7-axis"), key));
    let [lag, before] = ["7-axis", "5-axis"].map(|system| number(spread(found, system, "stage lag"), "mean"));
    let marks = ["z-range", "sync", "7-axis", "5-axis"].map(|s| time(number(row(found, s), "mark_s"))).join(", ");
    let sigma = whole(said_after(note(found, "7-axis"), "sigma "));
    let mut rows = vec![
        cells(["seven axes", "19.6 min", &time(seven)]),
        cells(["seven axes of least acceleration", "", &time(smooth)]),
        cells(["five axes", "110 min", &time(five)]),
        cells(["five axes in terms of seven", "5.6", &format!("{:.1}", five / seven)]),
        cells(["time of marks: `z-range`, `sync`, seven axes, five axes", "", &marks]),
        cells(["sigma of the smoothing", "13,750 um", &format!("{sigma} um")]),
        cells(["worst FOD there", "98.8 um", &format!("{} um", worst("worst_fod_um", 1))]),
        cells(["worst BIA there", "8.27 deg", &format!("{} deg", worst("worst_bia_deg", 2))]),
        cells(["worst displacement there", "1.837 mm", &format!("{} mm", worst("worst_displacement_mm", 3))]),
        cells([
            "mean following error of the stage, seven axes against five",
            "60 to 74 % less",
            &format!("{:.0} % less", 100.0 * (1.0 - lag / before)),
        ]),
    ];
    let worst_lag = number(spread(found, "5-axis", "stage lag"), "worst");
    rows.push(cells([
        "worst following error of the stage, five axes",
        "15 um",
        &format!("{worst_lag:.0} um, servos of 20 Hz assumed"),
    ]));
    for rest in list(found, "seven_axis_rests") {
        let [at, stage] = ["spot_rests_at", "stage"].map(|key| rest[key].as_str().expect("words"));
        let [whole, alone] = ["total_s", "scanner_alone_s"].map(|key| time(number(rest, key)));
        let figure = format!("seven axes, spot at rest at {at}, stage {stage}; scanner alone");
        rows.push(cells([&figure, "", &format!("{whole}; {alone}")]));
    }
    for axis in list(found, "following_errors").iter().filter(|r| r["system"] == "7-axis") {
        let [mean, speed] = ["fall_of_mean_percent", "fall_by_mean_speed_percent"].map(|key| axis[key].as_f64());
        if let (Some(mean), Some(speed)) = (mean, speed) {
            let figure = format!("mean following error of {}", axis["axis"].as_str().expect("an axis"));
            let here = format!("{mean:.0} % less, {speed:.0} % by the mean speed");
            rows.push(cells([&figure, "60 to 74 % less", &here]));
        }
    }
    hold("ma", &table(&["figure", "article", "here"], rows));
}

// --- Brecher et al.

/// What the program says of the dish that is turned, with its drive at so many volts.
fn turned(volts: u32) -> Value {
    let job = format!("fixtures/sources/brecher/dish-{volts}v.toml");
    changed(&["compare", "--systems", "z-range,tool-servo", "--nurbs", "dish.nurbs.json"], &job, &[])
}

/// A figure of the table of the tool servo.
fn of_tool(found: &Value, figure: &str, key: &str) -> f64 {
    let row = list(found, "tool_servo").iter().find(|row| row["figure"] == figure);
    number(row.unwrap_or_else(|| panic!("no {figure}")), key)
}

#[test]
#[ignore = "slow: make test-all, make sources"]
fn figures_of_brecher_are_those_of_the_page_and_close_to_the_article() {
    let folder = Path::new(ROOT).join("fixtures/sources/brecher");
    let out = Command::new(env!("CARGO_BIN_EXE_terrace"))
        .args(["inspect", "--nurbs", "patch.nurbs.json", "--json"])
        .current_dir(&folder)
        .output()
        .expect("the program starts");
    assert!(out.status.success(), "{}", said(&out));
    let surface: Value = serde_json::from_slice(&out.stdout).expect("JSON");
    let [low, high] = [50, 200].map(turned);
    let both = |figure: &str, key: &str, digits: usize| {
        [&low, &high].map(|found| format!("{:.digits$}", of_tool(found, figure, key))).join(" and ")
    };
    let close =
        |found: f64, printed: f64, share: f64| assert!((found / printed - 1.0).abs() <= share, "{found} {printed}");
    close(of_tool(&low, "jerk", "limit"), 133_547.0, 0.005);
    close(of_tool(&high, "jerk", "limit"), 534_188.0, 0.005);
    for (found, ms, m_s) in [(&low, 12.41, 1.289), (&high, 7.82, 2.047)] {
        close(of_tool(found, "time of the full stroke", "needed"), ms, 0.04);
        close(of_tool(found, "top speed of the full stroke", "needed"), m_s, 0.04);
    }
    let operations = |key: &str| whole(number(&surface["operations"], key));
    for (key, printed) in [("point", 141.0), ("algorithm_ii", 149.0), ("newton_step", 561.0)] {
        close(number(&surface["operations"], key), printed, 0.1);
    }
    let times = |figure: &str| format!("{:.2}", of_tool(&low, figure, "of_the_limit_percent") / 100.0);
    let most = &surface["algorithm_iii"]["cold"];
    let rows = vec![
        cells(["jerk of the drive at 50 and 200 V, m/s3", "134,000 and 536,000", &both("jerk", "limit", 0)]),
        cells(["time of 8 mm, ms", "12 and 7.8", &both("time of the full stroke", "needed", 2)]),
        cells(["top speed, m/s", "1.29 and 2", &both("top speed of the full stroke", "needed", 3)]),
        cells(["4 mm at 64 Hz at 50 V, jerk in terms of the drive's", "reached", &times("jerk of 4000 um at 64 Hz")]),
        cells(["300 um at 300 Hz", "reached at 200 V", &{
            let share = of_tool(&high, "jerk of 300 um at 300 Hz", "of_the_limit_percent") / 100.0;
            format!("{share:.2} of the drive's jerk at 200 V: not reached")
        }]),
        cells(["operations of a point of degree 2", "140", &operations("point")]),
        cells(["algorithm II", "150", &operations("algorithm_ii")]),
        cells(["full Newton step of algorithm III", "600", &operations("newton_step")]),
        cells(["Gauss-Newton step", "", &operations("gauss_newton_step")]),
        cells(["steps from a linear guess at most", "3 to 7", &whole(number(most, "most_steps"))]),
        cells(["turning of the dish", "", &time(total(&low, "tool-servo"))]),
        cells(["bandwidth of the position loop; frequency of the servo", "above 200 Hz", "200 Hz"]),
        cells(["form deviation; worst following error of the dish, speed fed forward, um", "0.4 to either side", &{
            both("worst following error", "needed", 2)
        }]),
    ];
    hold("brecher", &table(&["figure", "article", "here"], rows));
}

// --- All systems

#[test]
#[ignore = "slow: make test-all, make sources"]
fn figures_of_all_systems_are_those_of_the_page() {
    let all: Vec<&Value> = (0..PARTS.len()).map(comparison).collect();
    let names = PARTS.map(|p| p.0);
    let systems: Vec<&str> =
        all[0]["systems"].as_array().expect("systems").iter().map(|s| s["system"].as_str().expect("a name")).collect();
    let times = systems.iter().map(|s| {
        let of = |found: &&Value| match standing(found, s) {
            "does-not-apply" => "-".to_owned(),
            "beyond-limits" | "yours-to-set" => format!("~~{}~~", time(total(found, s))),
            _ => time(total(found, s)),
        };
        std::iter::once(format!("`{s}`")).chain(all.iter().map(of)).collect()
    });
    let head: Vec<&str> = std::iter::once("time").chain(names).collect();
    hold("times", &(table(&head, times.collect()) + "\n" + &verdict(&all)));

    let figures = systems.iter().map(|s| {
        let of = |found: &&Value| {
            let row = row(found, s);
            let cell =
                |key: &str, digits: usize| row[key].as_f64().map(|v| format!("{v:.digits$}")).unwrap_or_default();
            let stops = row["stops"].as_f64().map(whole).unwrap_or_default();
            [stops, cell("worst_fod_um", 1), cell("worst_bia_deg", 2), cell("worst_spot_error_um", 0)]
        };
        std::iter::once(format!("`{s}`")).chain(all[..2].iter().flat_map(of)).collect()
    });
    let columns = ["stops", "worst FOD, um", "worst BIA, deg", "spot error, um"];
    let head: Vec<String> = names[..2].iter().flat_map(|part| columns.map(|c| format!("{part}: {c}"))).collect();
    let head: Vec<&str> = std::iter::once("system").chain(head.iter().map(String::as_str)).collect();
    hold("deviations", &table(&head, figures.collect()));
    hold("decompositions", &decompositions(&all));
    hold("convergence", &convergence(&all));
}

fn standing<'a>(found: &'a Value, system: &str) -> &'a str {
    let rows = found["verdict"]["systems"].as_array().expect("standings");
    let row = rows.iter().find(|s| s["system"] == system);
    row.and_then(|s| s["standing"].as_str()).unwrap_or_else(|| panic!("no {system}"))
}

/// Systems of a part that keep the limits, the quickest first, with their times.
fn in_limits(found: &Value) -> Vec<(&str, f64)> {
    let rows = found["systems"].as_array().expect("systems").iter();
    let all = rows.map(|s| s["system"].as_str().expect("a name"));
    let kept = all.filter(|s| !["does-not-apply", "yours-to-set", "beyond-limits"].contains(&standing(found, s)));
    let kept = kept.filter(|s| !OTHER_PROCESSES.contains(s));
    let mut out: Vec<(&str, f64)> = kept.map(|s| (s, total(found, s))).collect();
    out.sort_by(|a, b| a.1.total_cmp(&b.1));
    out
}

/// What the tables say for and against a plain stage that steps.
fn verdict(all: &[&Value]) -> String {
    let (mut wins, mut lines) = (Vec::new(), String::new());
    for ((name, _), found) in PARTS.iter().zip(all) {
        let kept = in_limits(found);
        let said = |list: &[(&str, f64)]| match list {
            [] => "none".to_owned(),
            _ => list.iter().map(|(s, t)| format!("`{s}` {}", time(*t))).collect::<Vec<_>>().join(", "),
        };
        let line = match kept.iter().position(|(s, _)| PLAIN.contains(s)) {
            Some(at) => {
                if kept[..at].iter().all(|(s, _)| STEPPED_WITH_MORE.contains(s)) {
                    wins.push(*name);
                }
                format!("- {name}: `{}` takes {}. Quicker: {}.", kept[at].0, time(kept[at].1), said(&kept[..at]))
            }
            None => format!("- {name}: no plain stage that steps keeps the limits. Those that do: {}.", said(&kept)),
        };
        lines += &wrapped(&line);
    }
    let count = format!("{} of {} parts", wins.len(), PARTS.len());
    let parts = if wins.is_empty() { String::new() } else { format!(" ({})", wins.join("; ")) };
    wrapped(&format!(
        "A plain stage that steps is the quickest of the systems without a zoom optic and without a tilt table on \
         {count}{parts}; counted are systems that keep all limits:"
    )) + "\n"
        + &lines
}

/// Least acceleration beside the best filter, for each part and both kinds of machine.
fn decompositions(all: &[&Value]) -> String {
    let kinds = [
        ("scanner and stage", "decompositions", "time_s"),
        ("seven axes, first 20 m", "seven_axis_decompositions", "least_time_s"),
    ];
    let rms = |row: &Value| number(row, "rms_stage_acceleration_mm_s2");
    let mut rows = Vec::new();
    for (kind, key, seconds) in kinds {
        for ((name, _), found) in PARTS.iter().zip(all) {
            let made = list(found, key);
            let is_filter = |r: &&Value| r["strength_mm"].is_f64() || r["strength_in_plan_ms"].is_f64();
            let filters = made.iter().filter(is_filter);
            let Some(best) = filters.min_by(|a, b| rms(a).total_cmp(&rms(b))) else { continue };
            let least = made.iter().find(|r| r["decomposition"] == "least acceleration").expect("the last");
            let filter = best["decomposition"].as_str().expect("a name");
            let ratio = format!("{:.3}", rms(least) / rms(best));
            let [own, other] = [least, best].map(|r| time(number(r, seconds)));
            rows.push(cells([name, kind, filter, &ratio, &own, &other]));
        }
    }
    let head =
        ["part", "axes", "filter of least acceleration", "rms, least in terms of it", "time, least", "time, filter"];
    table(&head, rows)
}

/// How far the time of seven axes falls on finer grids.
fn convergence(all: &[&Value]) -> String {
    let of = PARTS.iter().zip(all).filter_map(|((name, _), found)| {
        let first = list(found, "convergence").first()?;
        Some(format!("{:.1} % ({name})", number(first, "above_the_finest_percent")))
    });
    wrapped(&format!(
        "- The least time of seven axes on the first 20 m of path falls on the finest of three grids by {}.",
        of.collect::<Vec<_>>().join(", ")
    ))
}
