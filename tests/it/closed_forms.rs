//! Surfaces with a closed form: counts, straight bands, heights.

use crate::support::image::height_map;
use crate::support::surfaces::{dome, mesh, write_stl};
use crate::support::{JobText, ONE_FILE, assert_balance, compile, folder, manifest, number, verify};
use terrace_core::math;

#[test]
#[ignore = "slow: make test-all"]
fn flat_plate_has_one_block_per_field() {
    let dir = folder();
    let stl = dir.path().join("plate.stl");
    write_stl(&stl, &mesh(20, [0.0, 0.0, 330.0, 250.0], |_, _| 3.0));
    for method in ["contour", "z-range", "auto"] {
        let job = JobText::on(&stl).texture("pattern = \"hatch\"\npitch = \"5 mm\"").method(method);
        let out = dir.path().join(format!("{method}.job"));
        let summary = compile(&job.write(dir.path(), "plate.toml"), &out);
        assert_eq!((summary["stops"].as_u64(), summary["sub_blocks"].as_u64()), (Some(63), Some(63)), "{method}");
        assert_balance(&summary, &verify(&out));
    }
    // 240 mm are six fields of 40 mm, not seven.
    let job = JobText::on(&stl)
        .texture("pattern = \"hatch\"\npitch = \"5 mm\"\narea = [\"0 mm\", \"0 mm\", \"240 mm\", \"240 mm\"]");
    let summary = compile(&job.write(dir.path(), "plate.toml"), &dir.path().join("b.job"));
    assert_eq!(summary["stops"], 36);
}

#[test]
fn a_tilted_plane_gets_straight_bands_of_equal_width() {
    let dir = folder();
    let stl = dir.path().join("tilted.stl");
    let tan = math::tan(5f64.to_radians());
    write_stl(&stl, &mesh(40, [0.0, 0.0, 38.0, 38.0], |x, _| x * tan));
    let job = JobText::on(&stl).texture("pattern = \"hatch\"\npitch = \"1 mm\"");
    let out = dir.path().join("tilted.job");
    let summary = compile(&job.write(dir.path(), "tilted.toml"), &out);
    assert_balance(&summary, &verify(&out));
    let blocks = manifest(&out)["blocks"].as_array().expect("blocks").clone();
    assert_eq!(blocks.len(), (38.0 * tan / 0.07f64).ceil() as usize);
    // Every mark of an interior band runs from border to border: 0.8001 mm, to 0.1 um.
    let want = 0.07 / tan;
    assert!((want - 0.8001).abs() < 1e-4);
    let text = std::fs::read_to_string(out.join("program.txt")).expect("program.txt");
    let mut widths: Vec<Vec<f64>> = Vec::new();
    for line in text.lines() {
        let words: Vec<&str> = line.split(' ').collect();
        if words[0] == "block" {
            widths.push(Vec::new());
        } else if words.len() == 8 && (words[3] == "+" || words[3] == "-") {
            let x = |i: usize| words[i].parse::<f64>().expect("nm") / 1e6;
            widths.last_mut().expect("a block first").push((x(6) - x(4)).abs());
        }
    }
    let by_width = |w: &Vec<f64>| w.iter().all(|v| (v - want).abs() < 1e-4) && w.len() == 39;
    let whole = widths.iter().filter(|w| by_width(w)).count();
    assert!(whole >= widths.len() - 2, "all bands but the first and last are {want} mm wide: {widths:?}");
}

#[test]
#[ignore = "slow: make test-all"]
fn heights_follow_plane_sphere_and_sine_to_the_chord_error() {
    type Form = (&'static str, fn(f64, f64) -> f64, f64);
    let forms: [Form; 3] = [
        ("plane", |x, y| 0.05 * x - 0.03 * y, 0.0),
        ("sphere", |x, y| (500f64.powi(2) - (x - 30.0).powi(2) - (y - 30.0).powi(2)).sqrt() - 490.0, 1.0 / 497.0),
        ("sine", |x, y| 0.4 * math::sin(x / 7.0) * math::cos(y / 9.0), 0.4 / 49.0 + 0.4 / 81.0),
    ];
    for (name, z, curvature) in forms {
        let dir = folder();
        let stl = dir.path().join("form.stl");
        let n = 100;
        write_stl(&stl, &mesh(n, [0.0, 0.0, 60.0, 60.0], z));
        // Longest edge of a jittered cell of 0.6 mm, its chord error, and the f32 of the file.
        let chord = curvature * (0.6f64 * 1.6).powi(2) * 2.0 / 8.0 + 5e-6 * 8.0;
        heights_agree(name, &JobText::on(&stl), dir.path(), z, chord);

        // The same as a height map of 16 bit: its step, and the chord of its cells.
        let png = dir.path().join("form.png");
        let (lo, step) = (-13.0, 24.0 / 65535.0);
        write_height_map(&png, 241, 0.25, |x, y| ((z(x, y) - lo) / step).round() as u16);
        let mut job = JobText::on(&png);
        job.surface = format!(
            "file = {:?}\n\n[surface.heightmap]\npixel = \"0.25 mm\"\nz = [\"{lo} mm\", \"{} mm\"]",
            png.display().to_string(),
            lo + 24.0
        );
        heights_agree(name, &job, dir.path(), z, curvature * 0.36f64.powi(2) * 2.0 / 8.0 + step);
    }
}

/// Compiles a hatch and compares the blocks' heights and the cut points with the closed form.
fn heights_agree(name: &str, job: &JobText, dir: &std::path::Path, z: fn(f64, f64) -> f64, tolerance: f64) {
    let job = JobText {
        textures: vec!["pattern = \"hatch\"\npitch = \"0.7 mm\"\ndirection = \"30 deg\"".into()],
        ..clone(job)
    };
    let out = dir.join("form.job");
    let summary = compile(&job.write(dir, "form.toml"), &out);
    assert_balance(&summary, &verify(&out));
    let text = std::fs::read_to_string(out.join("program.txt")).expect("program.txt");
    let (mut centre, mut marks, mut worst) = ([0.0; 2], [0.0; 2], 0f64);
    let mut points = 0;
    for line in text.lines() {
        let words: Vec<&str> = line.split(' ').collect();
        let mm = |w: &str| w.parse::<f64>().expect("nm") / 1e6;
        if words[0] == "block" {
            centre = [mm(words[7]), mm(words[8])];
            marks = [mm(words[16]), mm(words[17])];
        } else if words.get(3).is_some_and(|w| *w == "+" || *w == "-") {
            for p in words[4..].chunks(2) {
                let want = z(centre[0] + mm(p[0]), centre[1] + mm(p[1]));
                worst = worst.max(marks[0] - want).max(want - marks[1]);
                points += 1;
            }
        }
    }
    assert!(points > 500);
    assert!(worst <= tolerance, "{name}: a mark lies {worst} mm outside of its block's heights, allowed {tolerance}");
}

fn clone(job: &JobText) -> JobText {
    JobText {
        surface: job.surface.clone(),
        textures: job.textures.clone(),
        focus: job.focus.clone(),
        method: job.method,
        partition: job.partition.clone(),
        machine: job.machine.clone(),
        more: job.more.clone(),
    }
}

#[test]
fn a_steeper_facet_beyond_a_cut_does_not_count_as_under_the_mark() {
    // The first section is level; it ends at x 106.75, where the slope begins, and lines run along the edges of facets
    // there. The place of the cut on the line and that of the vertex are rounded apart.
    let dir = folder();
    let stl = dir.path().join("bend.stl");
    let strip = |[x0, z0]: [f64; 2], [x1, z1]: [f64; 2]| {
        [-27.0, -17.0, -7.0].map(|y| {
            let [a, b, c, d] = [[x0, y, z0], [x1, y, z1], [x1, y + 10.0, z1], [x0, y + 10.0, z0]];
            [[a, b, c], [a, c, d]]
        })
    };
    let facets = [strip([66.75, 0.0], [106.75, 0.0]), strip([106.75, 0.0], [132.0, 0.02525])].concat().concat();
    write_stl(&stl, &facets);
    let job = JobText::on(&stl).texture("pattern = \"hatch\"\npitch = \"10 mm\"\ndirection = \"180 deg\"");
    let out = dir.path().join("bend.job");
    assert_balance(&compile(&job.write(dir.path(), "bend.toml"), &out), &verify(&out));
    let m = manifest(&out);
    let incidence = |k: usize| m["blocks"][k]["incidence_deg"][1].as_f64().expect("deg");
    assert_eq!(m["blocks"].as_array().map(Vec::len), Some(2));
    let (level, slope) = (incidence(0).min(incidence(1)), incidence(0).max(incidence(1)));
    assert!(level < 1e-9 && (slope - math::atan(0.001f64).to_degrees()).abs() < 1e-6, "{level} {slope}");
}

/// Writes a square 16-bit height map; row 0 of the file is the top.
fn write_height_map(path: &std::path::Path, n: usize, pixel: f64, value: impl Fn(f64, f64) -> u16) {
    let places = (0..n).rev().flat_map(|j| (0..n).map(move |i| (i, j)));
    let samples: Vec<u16> = places.map(|(i, j)| value(i as f64 * pixel, j as f64 * pixel)).collect();
    std::fs::write(path, height_map(n, &samples)).expect("a writable folder");
}

#[test]
fn focus_mean_of_a_steep_part_lies_within_its_marks() {
    let dir = folder();
    let stl = dir.path().join("steep.stl");
    let tan = math::tan(50f64.to_radians());
    write_stl(&stl, &mesh(12, [0.0, 0.0, 3.0, 3.0], |x, _| 2000.0 + x * tan));
    let mut job = JobText::on(&stl).texture("pattern = \"hatch\"\npitch = \"0.3 mm\"\ndirection = \"40 deg\"");
    job.focus = "pdof = \"0.02 mm\"\nlevel = \"mean\"".into();
    let out = dir.path().join("steep.job");
    let summary = compile(&job.write(dir.path(), "steep.toml"), &out);
    let worst = number(&summary, "worst_defocus_um");
    assert!(worst <= 20.2, "{worst}");
    assert_balance(&summary, &verify(&out));
}

#[test]
#[ignore = "slow: make test-all"]
fn dome_needs_the_published_number_of_stops() {
    // A coarse hatch misses the smallest corners of some levels.
    dome_needs_stops(200, "1 mm", [3_537, 3_450], 10);
}

#[test]
#[ignore = "slow: make test-all"]
fn dome_of_500_000_facets_under_a_fine_hatch_needs_the_published_number_of_stops() {
    dome_needs_stops(500, "0.1 mm", [3_575, 3_508], 15);
}

/// Holds the stops by contour and by z-range against `counts`, to `tolerance`.
fn dome_needs_stops(cells: usize, pitch: &str, counts: [u64; 2], tolerance: u64) {
    let dir = folder();
    let stl = dir.path().join("dome.stl");
    write_stl(&stl, &mesh(cells, [0.0, 0.0, 450.0, 450.0], dome));
    let job = |keys: &str, pitch: &str| {
        let mut job = JobText::on(&stl).texture(&format!("pattern = \"hatch\"\npitch = {pitch:?}"));
        job.focus += keys;
        job.more = ONE_FILE.into();
        job
    };
    let stops = |v: &serde_json::Value| v["stops"].as_u64().expect("a count");

    let out = dir.path().join("contour.job");
    let summary = compile(&job("", pitch).write(dir.path(), "dome.toml"), &out);
    assert!(stops(&summary).abs_diff(counts[0]) <= tolerance, "{}", stops(&summary));
    assert!(number(&summary, "worst_defocus_um") <= 35.0);
    assert_balance(&summary, &verify(&out));

    let out = dir.path().join("z-range.job");
    let summary = compile(&job("", pitch).method("z-range").write(dir.path(), "dome.toml"), &out);
    // The published count is that of the method, before stops are merged.
    let chosen = stops(&summary) + summary["stops_merged"].as_u64().expect("a count");
    assert!(chosen.abs_diff(counts[1]) <= tolerance, "{chosen}");
    assert!(number(&summary, "worst_defocus_um") <= 35.0);
    assert_balance(&summary, &verify(&out));

    let out = dir.path().join("mean.job");
    let summary = compile(&job("\nlevel = \"mean\"", pitch).write(dir.path(), "dome.toml"), &out);
    let worst = number(&summary, "worst_defocus_um");
    assert!((47.0..=53.0).contains(&worst), "{worst}");
    let warnings = summary["warnings"].as_array().expect("warnings");
    assert!(warnings.iter().any(|w| w["code"] == "defocus"), "{warnings:?}");
    assert_balance(&summary, &verify(&out));

    // rule = "half": PDOF either way, so half the bands of twice the height.
    let out = dir.path().join("half.job");
    let summary = compile(&job("\nrule = \"half\"", "1 mm").write(dir.path(), "dome.toml"), &out);
    assert!((1_750..=1_900).contains(&stops(&summary)), "{}", stops(&summary));
    let worst = number(&summary, "worst_defocus_um");
    assert!(worst <= 70.0 && worst > 60.0, "{worst}");
    assert_balance(&summary, &verify(&out));
}
