//! Tilted stops: few on smooth parts, figures whole, hidden places left to the upright beam, every folder
//! verified.

use std::path::Path;
use terrace_core::math;

use crate::support::surfaces::{FIVE, dome, mesh, write_stl};
use crate::support::{JobText, compile, folder, machine_file, number, verify};
use serde_json::Value;

const MACHINE: &str = "profile = \"xyz-tilt-galvo-40\"";

/// A job by method `tilt` on a machine with a tilt table.
fn tilted(part: &Path, texture: &str) -> JobText {
    let mut job = JobText::on(part).texture(texture).method("tilt");
    job.machine = MACHINE.into();
    job
}

/// How far the end of a mark that is read again from its place in the field may lie from the cut in the drawing, mm,
/// under the leaning beams of the manifest and at the steepest slope of the proof.
///
/// With r = 0.71 nm, half the diagonal of the grid, the sine l of the tilt and the tangent t of the slope against the
/// beam: the cut is rounded to r in the drawing and its place in the field to r again, and the beam through that place
/// meets the file's facets at a height that the rounding of the place (r t) and of the welded vertices and the cut (1
/// nm up and 1.5 nm + r sideways) leave open. The beam turns each nm of height into l nm sideways.
fn end_mm(manifest: &Value, proof: &Value) -> f64 {
    const R: f64 = std::f64::consts::FRAC_1_SQRT_2;
    let axes = manifest["machine"]["tilt"]["axes"].as_array().expect("a tilt table");
    let lean = |block: &Value| -> f64 {
        let angles = block["tilt_deg"].as_array().expect("two angles").iter().map(|v| v.as_f64().expect("a number"));
        // C turns about the beam; what A and B lean by adds up at most.
        let leaning = axes.iter().zip(angles).filter(|(axis, _)| axis["letter"] != "C");
        math::sin(leaning.map(|(_, deg)| deg.to_radians().abs()).sum::<f64>())
    };
    let l = manifest["blocks"].as_array().expect("blocks").iter().map(lean).fold(0.0, f64::max);
    let t = math::tan(number(proof, "worst_incidence_deg").to_radians());
    (2.0 * R + l * (R * t + math::hypot(1f64, 1.5 + R) * math::hypot(1f64, t))) * 1e-6
}

/// Compiles, verifies, and holds the lengths of the summary against those read again; answers the summary.
fn proved(job: &JobText, dir: &Path) -> Value {
    let out = dir.join("tilted.job");
    let summary = compile(&job.write(dir, "job.toml"), &out);
    let proof = verify(&out);
    assert_eq!(proof["stops"], summary["stops"]);
    let text = std::fs::read_to_string(out.join("manifest.json")).expect("a manifest");
    let end = end_mm(&serde_json::from_str(&text).expect("JSON"), &proof);
    // Each mark has two ends; the pens mark once. Sums of f64 are far below.
    let known = 2.0 * number(&summary, "fragments") * end + 1e-12 * number(&summary, "texture_mm");
    let balance = |v: &Value| number(v, "mark_mm") - number(v, "overlap_mm") + number(v, "skipped_mm");
    for (v, known) in [(&summary, 1e-9 * number(&summary, "texture_mm")), (&proof, known)] {
        assert!((balance(v) - number(v, "texture_mm")).abs() <= known, "{} {v}", balance(v));
    }
    for key in ["mark_mm", "overlap_mm", "skipped_mm"] {
        let (read, stated) = (number(&proof, key), number(&summary, key));
        eprintln!("{key}: {read} read, {stated} stated, {:e} apart of {known:e}", (read - stated).abs());
        assert!((read - stated).abs() <= known, "{key}: {read} as re-read, {stated} as compiled, {known} allowed");
    }
    summary
}

#[test]
#[ignore = "slow: make test-all"]
fn smooth_parts_need_few_tilted_stops() {
    let dir = folder();
    for (name, z) in FIVE {
        let stl = dir.path().join(format!("{name}.stl"));
        write_stl(&stl, &mesh(500, [0.0, 0.0, 450.0, 450.0], z));
        let summary = proved(&tilted(&stl, "pattern = \"hatch\"\npitch = \"0.5 mm\""), dir.path());
        let stops = number(&summary, "stops");
        eprintln!("{name}: {stops} tilted stops");
        assert!(stops <= if name == "wave" { 1044.0 } else { 426.0 }, "{name}: {stops}");
        assert_eq!(summary["lower_bound_stops"], Value::Null, "the bound speaks of upright stops");
        std::fs::remove_file(stl).expect("a file of ours");
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn tilted_stops_keep_figures_whole() {
    let dir = folder();
    let stl = dir.path().join("dome.stl");
    write_stl(&stl, &mesh(500, [0.0, 0.0, 450.0, 450.0], dome));
    let squares = "pattern = \"squares\"\npitch = \"1.5 mm\"\ncell = \"1 mm\"";
    let summary = proved(&tilted(&stl, squares).partition("keep_whole = \"1.5 mm\""), dir.path());
    let (whole, cut) = (number(&summary, "figures_whole"), number(&summary, "figures_cut"));
    assert_eq!(whole + cut, 90_000.0);
    assert!(whole >= 0.99 * 90_000.0, "{whole}");
    assert!(number(&summary, "stops") <= 600.0, "{summary}");
}

/// The machine with another tilt table.
fn table(dir: &Path, axes: [(&str, bool); 2], travel: f64) -> String {
    let text = machine_file("xyz-tilt-galvo-40");
    let (head, _) = text.split_once("[tilt]").expect("a tilt table");
    let mut text = format!("{head}[tilt]\npivot = [\"30 mm\", \"-20 mm\", \"-150 mm\"]\n");
    for (letter, reversed) in axes {
        text += &format!(
            "[[tilt.axes]]\nletter = {letter:?}\nreversed = {reversed}\ntravel = [\"-{travel} deg\", \"{travel} deg\"]\n\
             move_time = \"1 s\"\nincrement = \"0.001 deg\"\n"
        );
    }
    std::fs::write(dir.join("table.txt"), text).expect("a writable folder");
    "file = \"table.txt\"".into()
}

#[test]
#[ignore = "slow: make test-all"]
fn jobs_for_every_kind_of_tilt_table_verify() {
    let dir = folder();
    let stl = dir.path().join("dome.stl");
    write_stl(&stl, &mesh(50, [0.0, 0.0, 140.0, 120.0], |x, y| dome(3.0 * x, 3.0 * y)));
    let job = |machine: String| {
        let mut job = tilted(&stl, "pattern = \"hatch\"\npitch = \"12 mm\"\ndirection = \"20 deg\"");
        job.machine = machine;
        job
    };
    let upright = number(&proved(&job(MACHINE.into()).method("z-range"), dir.path()), "stops");
    for (axes, travel) in [
        ([("B", true), ("A", false)], 30.0),
        ([("A", true), ("C", false)], 180.0),
        // A table that tilts by too little for the rim of the part.
        ([("A", false), ("B", false)], 1.0),
    ] {
        let summary = proved(&job(table(dir.path(), axes, travel)), dir.path());
        let stops = number(&summary, "stops");
        eprintln!("{axes:?} {travel}: {stops} of {upright}");
        assert!(stops < upright, "{axes:?}: {stops} of {upright}");
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn marks_of_tables_that_turn_about_z_end_inside_the_field() {
    let dir = folder();
    let stl = dir.path().join("part.stl");
    write_stl(
        &stl,
        &mesh(40, [0.0, 0.0, 80.0, 60.0], |x, y| 2.0 * math::sin(x / 13.0) + 1.5 * math::cos(y / 17.0) + 0.05 * x),
    );
    for axes in [["A", "C"], ["B", "C"], ["A", "B"], ["B", "A"]] {
        let machine = table(dir.path(), axes.map(|letter| (letter, false)), 180.0);
        let text = std::fs::read_to_string(dir.path().join("table.txt")).expect("the machine");
        let text = text.replace("[\"40 mm\", \"40 mm\"]", "[\"20 mm\", \"20 mm\"]");
        std::fs::write(dir.path().join("table.txt"), text).expect("a writable folder");
        for (direction, turn) in [(0.0, 0.0), (30.0, 0.0), (0.0, 17.3), (30.0, 17.3)] {
            for method in ["tilt", "auto"] {
                let hatch = format!("pattern = \"hatch\"\npitch = \"1 mm\"\ndirection = \"{direction} deg\"");
                let mut job = tilted(&stl, &hatch).method(method);
                job.machine = machine.clone();
                job.more = format!("[placement]\nturn = \"{turn} deg\"");
                // What would lie beyond the field is refused by an invariant.
                let summary = compile(&job.write(dir.path(), "job.toml"), &dir.path().join("tilted.job"));
                let left_out = summary["warnings"].to_string().contains("method-left-out");
                assert!(!left_out, "{axes:?} {direction} {turn}: {}", summary["warnings"]);
            }
        }
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn coarse_increment_with_small_field_compiles() {
    let dir = folder();
    let stl = dir.path().join("bump.stl");
    write_stl(&stl, &mesh(6, [0.0, 0.0, 1.0, 0.7], |x, y| 0.3 * x + 0.2 * x * y));
    // A quarter of the field is fewer increments than one more section would take away.
    for field in ["0.43 mm", "0.13 mm", "0.03 mm"] {
        let machine = table(dir.path(), [("A", false), ("B", false)], 30.0);
        let text = std::fs::read_to_string(dir.path().join("table.txt")).expect("the machine");
        let text = text
            .replace("[\"40 mm\", \"40 mm\"]", &format!("[{field:?}, {field:?}]"))
            .replace("increment = \"0.0001 mm\"", "increment = \"0.01 mm\"");
        std::fs::write(dir.path().join("table.txt"), text).expect("a writable folder");
        let mut job = tilted(&stl, "pattern = \"hatch\"\npitch = \"0.02 mm\"");
        job.machine = machine;
        job.focus = "pdof = \"0.02 mm\"".into();
        proved(&job, dir.path());
    }
}

/// A curved slope of `2 n²` facets with upright-walled bosses on it, whose shadows fall across tilted blocks.
fn bosses(n: usize) -> Vec<[[f64; 3]; 3]> {
    let floor = |x: f64, y: f64| 0.12 * x + 0.0004 * (x - 60.0) * (x - 60.0) + 0.03 * y;
    let mut facets = mesh(n, [0.0, 0.0, 120.0, 80.0], floor);
    for [x, y] in [[30.0, 20.0], [80.0, 50.0]] {
        let top = floor(x, y) + 12.0;
        let corner = |k: usize, z: f64| [x + [0.0, 9.0, 9.0, 0.0][k], y + [0.0, 0.0, 9.0, 9.0][k], z];
        facets.push([corner(0, top), corner(1, top), corner(2, top)]);
        facets.push([corner(0, top), corner(2, top), corner(3, top)]);
        for k in 0..4 {
            let next = (k + 1) % 4;
            facets.push([corner(k, top - 14.0), corner(next, top - 14.0), corner(next, top)]);
            facets.push([corner(k, top - 14.0), corner(next, top), corner(k, top)]);
        }
    }
    facets
}

#[test]
#[ignore = "slow: make test-all"]
fn texture_occluded_by_a_boss_is_marked_untilted() {
    let dir = folder();
    let stl = dir.path().join("boss.stl");
    write_stl(&stl, &bosses(120));
    let hatch = "pattern = \"hatch\"\npitch = \"0.5 mm\"";
    let tilt = proved(&tilted(&stl, hatch), dir.path());
    let upright = proved(&tilted(&stl, hatch).method("z-range"), dir.path());
    assert!(number(&tilt, "stops") < number(&upright, "stops"), "{tilt} {upright}");
}

#[test]
#[ignore = "slow: make test-all"]
fn figures_that_lie_across_shaded_blocks_are_marked_in_full() {
    let dir = folder();
    let stl = dir.path().join("boss.stl");
    write_stl(&stl, &bosses(40));
    // Blocks that a boss shades are kept to their area, and figures of 10 mm reach beyond it.
    let squares = "pattern = \"squares\"\npitch = \"12 mm\"\ncell = \"10 mm\"";
    let summary = proved(&tilted(&stl, squares).partition("keep_whole = \"12 mm\""), dir.path());
    assert!(number(&summary, "figures_whole") > 0.0 && number(&summary, "figures_cut") > 0.0, "{summary}");
}

#[test]
#[ignore = "slow: make test-all"]
fn auto_chooses_tilt_where_it_is_fastest_for_any_number_of_threads() {
    let dir = folder();
    let stl = dir.path().join("dome.stl");
    write_stl(&stl, &mesh(50, [0.0, 0.0, 100.0, 80.0], |x, y| dome(4.0 * x, 4.0 * y)));
    let job = tilted(&stl, "pattern = \"hatch\"\npitch = \"2 mm\"").method("auto");
    let summary = proved(&job, dir.path());
    let time = |c: &Value| number(&c["time_s"], "total");
    let candidates = summary["candidates"].as_array().expect("candidates");
    let least = candidates.iter().map(time).fold(f64::INFINITY, f64::min);
    assert!(candidates.iter().any(|c| c["method"] == "tilt"), "{summary}");
    assert_eq!(time(&summary), least);
    let file = tilted(&stl, "pattern = \"hatch\"\npitch = \"2 mm\"").write(dir.path(), "threads.toml");
    crate::support::same_on_any_threads(&file, dir.path());
}

#[test]
fn tilt_needs_a_tilt_table() {
    let dir = folder();
    let stl = dir.path().join("dome.stl");
    write_stl(&stl, &mesh(20, [0.0, 0.0, 60.0, 60.0], dome));
    let job = JobText::on(&stl).texture("pattern = \"hatch\"\npitch = \"1 mm\"").method("tilt");
    let file = job.write(dir.path(), "job.toml");
    let out = crate::support::terrace(["check", &file.display().to_string()]);
    assert_eq!(out.status.code(), Some(1));
    assert!(crate::support::said(&out).contains("tilt-missing"), "{}", crate::support::said(&out));
}
