//! Fewer stops, less time, whole figures, rough surfaces: what the methods of partition promise.

use std::path::Path;
use terrace_core::math;

use crate::support::image::height_map;
use crate::support::surfaces::{FIVE, Random, dome, mesh, write_stl};
use crate::support::{JobText, ONE_FILE, assert_balance, compile, folder, machine_file, number, summary_of, verify};
use serde_json::Value;

/// A candidate of `auto`.
fn candidate<'a>(summary: &'a Value, method: &str) -> &'a Value {
    let list = summary["candidates"].as_array().expect("candidates");
    list.iter().find(|c| c["method"] == method).unwrap_or_else(|| panic!("no {method}: {summary}"))
}

fn mean(values: &[f64]) -> f64 {
    math::exp(values.iter().map(|v| math::ln(*v)).sum::<f64>() / values.len() as f64)
}

/// Stops of a smooth hatch over one of the five surfaces, by contour as the article has it and by window, and their
/// lower bound: the method with the fewest is kept.
fn fewest(dir: &Path, name: &str, cells: usize, pitch: &str) -> [f64; 3] {
    let z = FIVE.iter().find(|(n, _)| *n == name).expect("one of the five").1;
    let stl = dir.join("part.stl");
    write_stl(&stl, &mesh(cells, [0.0, 0.0, 450.0, 450.0], z));
    let job = JobText::on(&stl)
        .texture(&format!("pattern = \"hatch\"\npitch = {pitch:?}"))
        .method("auto")
        .partition("objective = \"stops\"");
    let summary = summary_of(&job.write(dir, "job.toml"));
    let stops = |method: &str| number(candidate(&summary, method), "stops");
    let (merged, z_range, window) = (stops("contour"), stops("z-range"), stops("window"));
    // By name its stops are not merged.
    let contour = number(&summary_of(&job.method("contour").write(dir, "contour.toml")), "stops");
    let least = number(&summary, "lower_bound_stops");
    eprintln!("{name}: contour {contour}, z-range {z_range}, window {window}, at least {least}");
    assert!(least <= window.min(merged) && window <= z_range && z_range.max(merged) <= contour, "{name}");
    assert_eq!(number(&summary, "stops"), window.min(merged), "{name}: the fewest are kept");
    [contour, window, least]
}

#[test]
#[ignore = "slow: make test-all"]
fn window_method_needs_the_fewest_stops() {
    let dir = folder();
    for (name, _) in FIVE {
        fewest(dir.path(), name, 100, "10 mm");
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn stops_of_the_window_method_stay_within_the_measured_figures() {
    let dir = folder();
    let all = FIVE.map(|(name, _)| (name, fewest(dir.path(), name, 500, "0.5 mm")));
    // The rulings of the cylinder need as few as the levels of its sections.
    let (mut four, mut ratios) = (Vec::new(), Vec::new());
    for (_, [contour, window, _]) in all.iter().filter(|(name, _)| *name != "cyl") {
        four.push(*window);
        ratios.push(window / contour);
    }
    assert!(mean(&four) <= 2545.0, "{}", mean(&four));
    assert!(mean(&ratios) <= 0.72, "{}", mean(&ratios));
    let over_bound = all.map(|(_, [_, window, least])| window / least);
    assert!(mean(&over_bound) <= 1.21, "{}", mean(&over_bound));
}

/// The machine of the article with measured times of its moves.
fn timed(dir: &Path, xy: &str, z: &str) -> String {
    let text = machine_file("xyz-galvo-40");
    let moves = format!("[stage]\nmove = {{ xy = \"{xy}\", z = \"{z}\" }}\n");
    let timed = text.replacen("[stage]\n", &moves, 1);
    assert_ne!(text, timed);
    let name = "timed.txt";
    std::fs::write(dir.join(name), timed).expect("a writable folder");
    format!("file = {name:?}")
}

/// Stage time of a written program, from the targets in it: a first move of x and y, then every move by
/// its kind.
fn stage_time(folder: &Path, xy: f64, z: f64) -> f64 {
    let text = std::fs::read(folder.join("manifest.json")).expect("a manifest");
    let manifest: Value = serde_json::from_slice(&text).expect("JSON");
    let at: Vec<[f64; 3]> = manifest["blocks"]
        .as_array()
        .expect("blocks")
        .iter()
        .map(|b| [0, 1, 2].map(|k| b["stage"][k].as_f64().expect("a number")))
        .collect();
    let moves = at.windows(2).map(|w| match (w[0] == w[1], w[0][..2] == w[1][..2]) {
        // Two blocks at one place.
        (true, _) => 0.0,
        (_, true) => z,
        _ => xy,
    });
    xy + moves.sum::<f64>()
}

/// Compiles a hatch over one of the five surfaces by `auto` and by each method, with given times of stage moves in s;
/// answers with the stage time of what `auto` kept, which must take the least time of all.
fn least_time(dir: &Path, z: fn(f64, f64) -> f64, (cells, pitch): (usize, &str), [xy_s, z_s]: [f64; 2]) -> f64 {
    let stl = dir.join("part.stl");
    write_stl(&stl, &mesh(cells, [0.0, 0.0, 450.0, 450.0], z));
    let job = |method| {
        let hatch = format!("pattern = \"hatch\"\npitch = {pitch:?}");
        let mut job = JobText::on(&stl).texture(&hatch).method(method);
        job.machine = timed(dir, &format!("{xy_s} s"), &format!("{z_s} s"));
        // Nobody loads files: the machine's time alone decides.
        job.more = "[emit]\nformats = [\"ovf\"]\n".into();
        let out = dir.join(format!("{method}.job"));
        let summary = compile(&job.write(dir, "job.toml"), &out);
        (summary, out)
    };
    let (summary, out) = job("auto");
    let chosen = stage_time(&out, xy_s, z_s);
    let stated = number(&summary["time_s"], "stage") + number(&summary["time_s"], "settle");
    assert!((stated - chosen).abs() < 1e-6 * chosen, "{stated} {chosen}");
    for method in ["contour", "z-range", "window"] {
        let (single, out) = job(method);
        // Windows are left out where they cannot win.
        if method != "window" || xy_s == z_s {
            let [listed, alone] = [candidate(&summary, method), &single].map(|s| number(s, "stops"));
            // Asked for by name, contour keeps the stops of the article.
            assert!(if method == "contour" { listed <= alone } else { listed == alone }, "{method}: {listed} {alone}");
        }
        let total = |s: &Value| number(&s["time_s"], "total");
        assert!(
            total(&summary) <= total(&single),
            "{method} is faster than what was kept: {} s by {}, {} s by itself; {}",
            total(&summary),
            summary["method"],
            total(&single),
            summary["candidates"]
        );
        let stage = stage_time(&out, xy_s, z_s);
        let marks = ["mark", "jump", "delay"].map(|k| number(&single["time_s"], k)).iter().sum::<f64>();
        assert!((stage + marks - total(&single)).abs() < 1e-6 * stage, "{method}: {stage} {marks}");
    }
    chosen
}

#[test]
#[ignore = "slow: make test-all"]
fn auto_keeps_the_job_that_takes_the_least_time() {
    let dir = folder();
    for (_, z) in FIVE {
        for moves in [[3.7, 0.3], [1.0, 1.0]] {
            least_time(dir.path(), z, (80, "12 mm"), moves);
        }
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn stage_time_of_the_dome_stays_within_the_measured_figures() {
    let dir = folder();
    for (moves, most_minutes) in [([3.7, 0.3], 25.8), ([1.0, 1.0], 44.5)] {
        let minutes = least_time(dir.path(), dome, (500, "0.5 mm"), moves) / 60.0;
        assert!(minutes <= most_minutes, "{minutes} min with {moves:?} s");
    }
}

/// Free windows never need more stops than the grid, also where fields fit the texture exactly.
#[test]
#[ignore = "slow: make test-all"]
fn window_method_needs_no_more_stops_than_a_fitting_grid() {
    let dir = folder();
    let stl = dir.path().join("part.stl");
    write_stl(&stl, &mesh(100, [0.0, 0.0, 120.0, 120.0], |x, y| dome(2.0 * x, 2.0 * y)));
    let stops = |method| {
        let job = JobText::on(&stl).texture("pattern = \"hatch\"\npitch = \"1 mm\"").method(method);
        let out = dir.path().join("job.job");
        let summary = compile(&job.write(dir.path(), "job.toml"), &out);
        verify(&out);
        number(&summary, "stops")
    };
    let (window, grid) = (stops("window"), stops("z-range"));
    assert!(window <= grid, "{window} {grid}");
}

/// A height map of a part of the dome with white noise of `noise` um at 0.05 mm; answers its job.
fn rough(dir: &Path, noise: f64) -> JobText {
    const N: u32 = 801;
    let at = |i: u32| 60.0 + f64::from(i) * 0.05;
    let (lo, hi) = (dome(60.0, 60.0) - 0.05, dome(100.0, 100.0) + 0.05);
    let mut random = Random::new(7);
    // Twelve numbers of even density have a deviation of 1.
    let mut normal = || (0..12).map(|_| random.half()).sum::<f64>();
    let mut samples = Vec::with_capacity((N * N) as usize);
    for row in (0..N).rev() {
        for column in 0..N {
            let z = dome(at(column), at(row)) + noise * 1e-3 * normal();
            samples.push(((z - lo) / (hi - lo) * 65535.0).round() as u16);
        }
    }
    std::fs::write(dir.join("rough.png"), height_map(N as usize, &samples)).expect("a writable folder");
    let mut job =
        JobText::on(Path::new("rough.png")).texture("pattern = \"hatch\"\npitch = \"0.2 mm\"").method("z-range");
    job.surface =
        format!("file = \"rough.png\"\n[surface.heightmap]\npixel = \"0.05 mm\"\nz = [\"{lo} mm\", \"{hi} mm\"]");
    job
}

#[test]
#[ignore = "slow: make test-all"]
fn overlapping_levels_keep_strokes_whole_on_a_rough_surface() {
    let dir = folder();
    // Slivers are fragments here, too.
    let rough = |dir: &Path, noise: f64| rough(dir, noise).partition("min_mark = \"0 mm\"");
    let run = |job: &JobText| {
        let out = dir.path().join("job.job");
        let summary = compile(&job.write(dir.path(), "job.toml"), &out);
        assert_balance(&summary, &verify(&out));
        assert!(number(&summary, "worst_defocus_um") <= 35.0, "the depth rule is kept");
        (number(&summary, "stops"), number(&summary, "fragments"))
    };
    let (stops, fragments) = run(&rough(dir.path(), 0.0));
    let none = run(&rough(dir.path(), 0.0).partition("min_mark = \"0 mm\"\nhysteresis = \"0 mm\""));
    assert_eq!((stops, fragments), none, "a smooth surface needs no hysteresis");
    let (rough_stops, rough_fragments) = run(&rough(dir.path(), 3.0));
    assert!(rough_fragments <= 1.22 * fragments, "{rough_fragments} {fragments}");
    assert!(rough_stops <= 1.2 * stops, "{rough_stops} {stops}");
    let (_, shredded) = run(&rough(dir.path(), 3.0).partition("min_mark = \"0 mm\"\nhysteresis = \"0 mm\""));
    assert!(shredded >= 2.4 * fragments, "{shredded} {fragments}");
}

/// Summaries of squares of 1 mm on the dome, on a stage whose increment is far below the depth range, so that what fits
/// is a question of depth alone: cut by z-range, then kept whole by z-range and by window.
fn squares_on_the_dome(dir: &Path, cells: usize, area: &str, count: f64) -> [Value; 3] {
    let stl = dir.join("dome.stl");
    write_stl(&stl, &mesh(cells, [0.0, 0.0, 450.0, 450.0], dome));
    let squares = format!("pattern = \"squares\"\npitch = \"1.5 mm\"\ncell = \"1 mm\"\narea = {area}");
    let run = |method, keep: &str| {
        let mut job = JobText::on(&stl).texture(&squares).method(method).partition(keep);
        let text = machine_file("xyz-galvo-40").replace("\"0.0001 mm\"", "\"0.00001 mm\"");
        std::fs::write(dir.join("fine.txt"), text).expect("a writable folder");
        job.machine = "file = \"fine.txt\"".into();
        job.more = ONE_FILE.into();
        let out = dir.join("job.job");
        let summary = compile(&job.write(dir, "job.toml"), &out);
        assert_balance(&summary, &verify(&out));
        assert_eq!(number(&summary, "figures_whole") + number(&summary, "figures_cut"), count);
        summary
    };
    let keep = "keep_whole = \"1 mm\"";
    let all = [run("z-range", ""), run("z-range", keep), run("window", keep)];
    for kept in &all[1..] {
        let warning = &kept["warnings"].as_array().expect("warnings")[0];
        assert_eq!(warning["code"], "figures-cut", "{warning}");
    }
    all
}

/// A square of 1 mm fits a depth range of 0.07 mm where the dome rises less over its diagonal.
fn fits_the_depth(x: f64, y: f64) -> bool {
    let z = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|[dx, dy]| dome(x + dx, y + dy));
    let [lo, hi] = [z.iter().copied().fold(f64::MAX, f64::min), z.iter().copied().fold(f64::MIN, f64::max)];
    hi - lo <= 0.07
}

#[test]
#[ignore = "slow: make test-all"]
fn figures_stay_whole_wherever_a_stop_can_hold_them() {
    let dir = folder();
    // The slope towards the corner is too steep for some of them.
    let (y0, n) = (30.0, 60);
    let area = "[\"0 mm\", \"30 mm\", \"90 mm\", \"120 mm\"]";
    let [cut, z_range, window] = squares_on_the_dome(dir.path(), 200, area, 3600.0);
    let at = |o: f64, i: i32| o + 1.5 * f64::from(i) + 0.25;
    let fit = (0..n * n).filter(|i| fits_the_depth(at(0.0, i % n), at(y0, i / n))).count() as f64;
    assert!(fit > 1000.0 && fit < 3000.0, "{fit}");
    assert!(number(&cut, "figures_whole") < 0.6 * fit, "{cut}");
    for kept in [z_range, window] {
        let whole = number(&kept, "figures_whole");
        assert!((whole / fit - 1.0).abs() <= 0.01, "{whole} of {fit}");
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn stops_for_90_000_whole_figures_stay_within_the_measured_figures() {
    let dir = folder();
    let [cut, z_range, window] = squares_on_the_dome(dir.path(), 500, "\"part\"", 90_000.0);
    assert!(number(&cut, "figures_whole") < 40_000.0, "{cut}");
    for (kept, most) in [(z_range, 11_600.0), (window, 10_680.0)] {
        let whole = number(&kept, "figures_whole");
        assert!((whole - 81_680.0).abs() <= 60.0, "{whole}");
        assert!(number(&kept, "stops") <= most, "{}", kept["stops"]);
    }
}

/// Places along x at which the lines of a hatch are cut, from program.txt: ends that are not ends of lines.
fn cuts(folder: &Path, from: f64, to: f64) -> Vec<f64> {
    let text = std::fs::read_to_string(folder.join("program.txt")).expect("program.txt");
    let mut centre = 0.0;
    let mut found = Vec::new();
    for line in text.lines() {
        let words: Vec<&str> = line.split(' ').collect();
        let mm = |i: usize| words[i].parse::<f64>().expect("nm") / 1e6;
        if words[0] == "block" {
            centre = mm(7);
        } else if words.len() == 8 && ["+", "-"].contains(&words[3]) {
            found.extend([mm(4), mm(6)].map(|x| centre + x).into_iter().filter(|x| x - from > 1e-6 && to - x > 1e-6));
        }
    }
    found.sort_by(f64::total_cmp);
    found
}

#[test]
fn cuts_lie_at_seeded_random_places_of_the_zone() {
    let dir = folder();
    let stl = dir.path().join("plate.stl");
    write_stl(&stl, &mesh(9, [0.0, 0.0, 75.0, 30.0], |x, y| 0.0002 * x + 0.0001 * y));
    let job = JobText::on(&stl).texture("pattern = \"hatch\"\npitch = \"0.5 mm\"").partition("zone = \"2 mm\"");
    let file = job.write(dir.path(), "job.toml");
    let run = |seed: &str| {
        let out = dir.path().join(format!("{seed}.job"));
        let args = ["compile", "--json", "--seed", seed, "-o"].map(Path::new);
        let done = crate::support::terrace(args.into_iter().chain([out.as_path(), file.as_path()]));
        assert!(done.status.success(), "{}", crate::support::said(&done));
        let summary = serde_json::from_slice(&done.stdout).expect("JSON");
        assert_balance(&summary, &verify(&out));
        cuts(&out, 0.0, 75.0)
    };
    let (a, b) = (run("1"), run("2"));
    // 61 lines, each cut once; both sides end on the same nanometre.
    assert_eq!(a.len(), 122);
    assert!(a.chunks(2).all(|w| w[0] == w[1]));
    // Windows of 40 mm around sections of 38 mm share 37 to 39 mm.
    assert!(a.iter().all(|x| (36.99..=39.01).contains(x)), "{a:?}");
    let places: Vec<f64> = a.iter().step_by(2).copied().collect();
    let middle = places.iter().sum::<f64>() / 61.0;
    assert!((middle - 38.0).abs() < 0.25, "{middle}");
    assert!(places.windows(2).all(|w| w[1] > w[0]), "no two at the same place");
    assert_ne!(a, b, "another seed, other places");
    assert_eq!(a, run("1"));
}

/// Strokes of the texture that a program marks pieces of.
fn sources(folder: &Path) -> usize {
    let text = std::fs::read_to_string(folder.join("program.txt")).expect("program.txt");
    let words = text.lines().map(|l| l.split(' ').collect::<Vec<_>>());
    let strokes = words.filter(|w| w.len() >= 8 && ["+", "-"].contains(&w[3]));
    strokes.map(|w| w[1].to_owned()).collect::<std::collections::BTreeSet<_>>().len()
}

/// Every way to cut between two stops: at borders of sections, at levels, along free windows.
#[test]
#[ignore = "slow: make test-all"]
fn seams_overlap_by_what_the_job_declares() {
    let dir = folder();
    let stl = dir.path().join("dome.stl");
    write_stl(&stl, &mesh(150, [0.0, 0.0, 450.0, 450.0], dome));
    let hatch = "pattern = \"hatch\"\npitch = \"2 mm\"\ndirection = \"30 deg\"";
    for method in ["contour", "z-range", "window"] {
        let run = |overlap: &str| {
            let mut job = JobText::on(&stl).texture(hatch).method(method).partition(&format!("overlap = {overlap:?}"));
            job.more = ONE_FILE.into();
            let out = dir.path().join("job.job");
            let summary = compile(&job.write(dir.path(), "job.toml"), &out);
            let proof = verify(&out);
            assert_balance(&summary, &proof);
            let [stated, found] = [&summary, &proof].map(|v| number(v, "overlap_mm"));
            assert!((stated - found).abs() <= 1e-9 * number(&summary, "texture_mm"), "{method}: {stated} {found}");
            (summary, sources(&out))
        };
        let ((butt, _), (summary, strokes)) = (run("0 mm"), run("0.05 mm"));
        assert_eq!(number(&butt, "overlap_mm"), 0.0);
        // Nothing is skipped on the dome: every fragment but the first of a stroke follows a cut.
        let cuts = number(&summary, "fragments") - strokes as f64;
        let share = number(&summary, "overlap_mm") / (0.05 * cuts);
        eprintln!("{method}: {} stops, {} with overlaps, {share} of them", butt["stops"], summary["stops"]);
        assert!((0.995..=1.0 + 1e-6).contains(&share), "{method}: {share}");
        let warning = &summary["warnings"][0];
        assert_eq!(warning["code"], "overlap-short", "{warning}");
        let text = warning["message"].as_str().expect("text");
        let words: Vec<f64> = text.split(' ').filter_map(|w| w.parse().ok()).collect();
        assert!(words[1] == cuts && words[0] <= 0.005 * cuts, "{text}");
        assert!(number(&summary, "stops") <= 1.1 * number(&butt, "stops"), "{method}");
        // What is marked twice is not a seam of its own: that would double the length. Mergers, of which there are
        // others with overlaps, take some of it away.
        let lengths = [&butt, &summary].map(|s| number(s, "seam_mm") / number(s, "stops"));
        assert!((lengths[0] / lengths[1] - 1.0).abs() < 0.1, "{method}: {lengths:?}");
    }
}

#[test]
fn both_sides_of_a_seam_mark_the_overlap() {
    let dir = folder();
    let stl = dir.path().join("plate.stl");
    write_stl(&stl, &mesh(9, [0.0, 0.0, 75.0, 30.0], |x, y| 0.0002 * x + 0.0001 * y));
    let run = |keys: &str| {
        let job = JobText::on(&stl).texture("pattern = \"hatch\"\npitch = \"0.5 mm\"").partition(keys);
        let file = job.write(dir.path(), "job.toml");
        let out = dir.path().join("job.job");
        let args = ["compile", "--json", "-o"].map(Path::new);
        (crate::support::terrace(args.into_iter().chain([out.as_path(), file.as_path()])), out)
    };
    let (done, out) = run("overlap = \"0.05 mm\"");
    assert!(done.status.success(), "{}", crate::support::said(&done));
    let summary: Value = serde_json::from_slice(&done.stdout).expect("JSON");
    assert_eq!(summary["warnings"], serde_json::json!([]));
    assert_balance(&summary, &verify(&out));
    let places = cuts(&out, 0.0, 75.0);
    assert_eq!(places.len(), 122);
    let (from, to) = (places[0], places[121]);
    assert!((to - from - 0.05).abs() < 1e-9 && places.iter().all(|&x| x == from || x == to), "{from} {to}");
    assert!((number(&summary, "overlap_mm") - 61.0 * 0.05).abs() < 1e-9);
    // Too much of it, and a zone at the same time, are refused.
    for (keys, code) in [
        ("overlap = \"10 mm\"", "overlap-large"),
        ("overlap = \"1 mm\"\nsection = \"39.5 mm\"", "overlap-large"),
        ("overlap = \"1 mm\"\nzone = \"1 mm\"", "seam-both"),
        ("overlap = \"1\"", "toml"),
        ("overlap = \"-1 mm\"", "toml"),
    ] {
        let (done, _) = run(keys);
        assert!(
            !done.status.success() && crate::support::said(&done).contains(code),
            "{}",
            crate::support::said(&done)
        );
    }
}
