//! Parts that lie as their CAD program left them: `orient --apply` lays them, and what is compiled then is the part the
//! right way up, with no editing by hand.

use std::path::Path;
use terrace_core::math;

use crate::support::surfaces::{mesh, write_stl};
use crate::support::{JobText, compile, folder, manifest, number, said, terrace, verify};

type Point = [f64; 3];

/// Rotated about x, then y, then z, degrees, and moved.
fn moved(p: Point, angles: Point, by: Point) -> Point {
    let [mut x, mut y, mut z] = p;
    let (s, c) = math::sin_cos(angles[0].to_radians());
    (y, z) = (y * c - z * s, y * s + z * c);
    let (s, c) = math::sin_cos(angles[1].to_radians());
    (x, z) = (x * c + z * s, z * c - x * s);
    let (s, c) = math::sin_cos(angles[2].to_radians());
    (x, y) = (x * c - y * s, x * s + y * c);
    [x + by[0], y + by[1], z + by[2]]
}

/// A panel of 120 x 70 mm with one bump outwards, wound so that it faces the bump's side.
fn panel() -> Vec<[Point; 3]> {
    let form = |x: f64, y: f64| 4.0 * math::exp(-((x - 35.0).powi(2) + (y - 30.0).powi(2)) / 150.0);
    let mut facets = mesh(40, [0.0, 0.0, 120.0, 70.0], form);
    for f in &mut facets {
        let [a, b, c] = *f;
        if (b[0] - a[0]) * (c[1] - a[1]) < (b[1] - a[1]) * (c[0] - a[0]) {
            f.swap(1, 2);
        }
    }
    facets
}

fn job(dir: &Path) -> std::path::PathBuf {
    let job = JobText::on(&dir.join("part.stl")).texture("pattern = \"hatch\"\npitch = \"1 mm\"");
    job.write(dir, "job.toml")
}

/// Lays the part of a job, compiles it, and answers with the length of its marks and the heights of its highest mark
/// above the lowest and of the middle.
fn applied(dir: &Path, job: &Path, args: &[&str]) -> [f64; 2] {
    let mut all = vec!["orient", job.to_str().expect("text"), "--apply", "-q"];
    all.extend(args);
    let out = terrace(&all);
    assert!(out.status.success(), "{}", said(&out));
    let folder = dir.join("laid.job");
    let _ = std::fs::remove_dir_all(&folder);
    let summary = compile(job, &folder);
    let proof = verify(&folder);
    assert_eq!(proof["ok"], true, "{proof}");
    let blocks = manifest(&folder)["blocks"].as_array().expect("blocks").clone();
    let z = |key: &str| blocks.iter().map(|b| number(b, key)).collect::<Vec<_>>();
    let highest = z("z_hi_mm").into_iter().fold(f64::NEG_INFINITY, f64::max);
    let lowest = z("z_lo_mm").into_iter().fold(f64::INFINITY, f64::min);
    // Most of the panel is flat: marks lie there, and the bump rises above it or sinks below it.
    let weighed: f64 = blocks.iter().map(|b| number(b, "mark_mm") * number(b, "lpfl_mm")).sum();
    let mean = weighed / number(&summary, "mark_mm");
    [number(&summary, "mark_mm"), (highest - mean) / (highest - lowest)]
}

#[test]
#[ignore = "slow: make test-all"]
fn a_panel_in_car_coordinates_upright_or_on_its_back_is_laid_with_its_outside_up() {
    let dir = folder();
    write_stl(&dir.path().join("part.stl"), &panel());
    let as_drawn = number(&compile(&job(dir.path()), &dir.path().join("drawn.job")), "mark_mm");
    for (what, angles, by) in [
        ("in car coordinates", [120.0, 35.0, 20.0], [2487.0, -1001.0, 364.0]),
        ("upright", [90.0, 0.0, 0.0], [0.0; 3]),
        ("upright, leaning", [-88.0, 12.0, 0.0], [10.0, 20.0, 30.0]),
        ("on its back", [180.0, 0.0, 0.0], [0.0; 3]),
        ("on its back, turned", [0.0, 177.0, 40.0], [0.0; 3]),
    ] {
        let facets: Vec<_> = panel().iter().map(|f| f.map(|p| moved(p, angles, by))).collect();
        write_stl(&dir.path().join("part.stl"), &facets);
        let job = job(dir.path());
        let inspected = terrace(["inspect", dir.path().join("part.stl").to_str().expect("text"), "--unit", "mm"]);
        assert!(said(&inspected).contains("orient JOB --apply"), "{what}: {}", said(&inspected));
        let [marks, above] = applied(dir.path(), &job, &[]);
        assert!((marks - as_drawn).abs() < 0.03 * as_drawn, "{what}: {marks} mm for {as_drawn}");
        assert!(above > 0.6, "{what}: the bump is up to {above} of the height above the mean");
    }
    // What lies as it can is left alone.
    let job = dir.path().join("job.toml");
    let before = std::fs::read(&job).expect("readable");
    let out = terrace(["orient", job.to_str().expect("text"), "--apply"]);
    assert!(said(&out).contains("the job file stays as it is"), "{}", said(&out));
    assert_eq!(std::fs::read(&job).expect("readable"), before);
}

#[test]
#[ignore = "slow: make test-all"]
fn the_side_can_be_chosen_and_the_job_file_keeps_all_else() {
    let dir = folder();
    write_stl(&dir.path().join("part.stl"), &panel());
    let file = job(dir.path());
    let text = std::fs::read_to_string(&file).expect("readable");
    std::fs::write(
        &file,
        format!("# A comment.\n{text}\n[placement]\nup = [1, 0, 0] # as it was\nturn = \"90 deg\"\n"),
    )
    .expect("written");
    // The back up: the bump is a hollow.
    let [_, above] = applied(dir.path(), &file, &["--up", "0,0,-1"]);
    assert!(above < 0.4, "{above}");
    let text = std::fs::read_to_string(&file).expect("readable");
    assert!(
        text.starts_with("# A comment.\n") && text.contains("turn = \"90 deg\"") && !text.contains("up ="),
        "{text}"
    );
    // The facet there on the table: the same.
    let [_, above] = applied(dir.path(), &file, &["--lie-on", "110,60,0"]);
    assert!(above < 0.4, "{above}");
}

#[test]
#[ignore = "slow: make test-all"]
fn a_fixture_angle_is_written_for_the_part_before_it_is_turned() {
    let dir = folder();
    // It rises along x by a tenth, and along y by a twentieth.
    write_stl(&dir.path().join("part.stl"), &mesh(30, [0.0, 0.0, 120.0, 70.0], |x, y| 0.1 * x + 0.05 * y));
    for turn in [0, 90, 37] {
        let file = job(dir.path());
        let text = std::fs::read_to_string(&file).expect("readable");
        std::fs::write(&file, format!("{text}\n[placement]\nturn = \"{turn} deg\"\n")).expect("written");
        let out = terrace(["orient", file.to_str().expect("text"), "--apply", "-q"]);
        assert!(out.status.success(), "{}", said(&out));
        let laid = dir.path().join(format!("{turn}.job"));
        compile(&file, &laid);
        let blocks = manifest(&laid)["blocks"].as_array().expect("blocks").clone();
        let steepest = blocks.iter().map(|b| b["incidence_deg"][1].as_f64().expect("an angle")).fold(0.0, f64::max);
        // It lay at 6.4 deg.
        assert!(steepest < 0.3, "turn {turn}: {steepest} deg are left");
    }
}

#[test]
fn a_closed_body_is_asked_for_its_side_where_two_are_alike() {
    let dir = folder();
    let corner = |i: usize| [[0.0, 0.0], [60.0, 0.0], [60.0, 40.0], [0.0, 40.0]][i % 4];
    let at = |i: usize, z: f64| [corner(i)[0], corner(i)[1], z];
    let mut facets = vec![
        [at(0, 0.0), at(2, 0.0), at(1, 0.0)],
        [at(0, 0.0), at(3, 0.0), at(2, 0.0)],
        [at(0, 5.0), at(1, 5.0), at(2, 5.0)],
        [at(0, 5.0), at(2, 5.0), at(3, 5.0)],
    ];
    for i in 0..4 {
        facets.extend([[at(i, 0.0), at(i + 1, 0.0), at(i + 1, 5.0)], [at(i, 0.0), at(i + 1, 5.0), at(i, 5.0)]]);
    }
    write_stl(&dir.path().join("part.stl"), &facets);
    let file = job(dir.path());
    let file = file.to_str().expect("text");
    let out = terrace(["orient", file, "--apply"]);
    assert_eq!(out.status.code(), Some(2), "{}", said(&out));
    assert!(said(&out).contains("orient-side") && said(&out).contains("--up"), "{}", said(&out));
    assert!(terrace(["orient", file]).status.success());
    assert!(terrace(["orient", file, "--apply", "--up", "0,0,1"]).status.success());
}

#[test]
#[ignore = "slow: make test-all"]
fn rotations_up_and_level_agree_and_what_says_nothing_is_refused() {
    let dir = folder();
    let facets: Vec<_> = panel().iter().map(|f| f.map(|p| moved(p, [90.0, 0.0, 0.0], [0.0; 3]))).collect();
    write_stl(&dir.path().join("part.stl"), &facets);
    let text = std::fs::read_to_string(job(dir.path())).expect("readable");
    let marks = |placement: &str| {
        let file = dir.path().join("placed.toml");
        std::fs::write(&file, format!("{text}\n[placement]\n{placement}\n")).expect("written");
        let folder = dir.path().join("placed.job");
        let _ = std::fs::remove_dir_all(&folder);
        let marks = number(&compile(&file, &folder), "mark_mm");
        assert_eq!(verify(&folder)["ok"], true, "{placement}");
        marks
    };
    let rotated = marks("rotate = [\"-90 deg\", \"0 deg\", \"0 deg\"]");
    for same in ["up = [0, -1, 0]", "level = [[0, 0, 0], [120, 0, 0], [0, 0, 70]]"] {
        let found = marks(same);
        assert!((found - rotated).abs() < 1e-6, "{same}: {found} for {rotated}");
    }
    for wrong in [
        "up = [0, 0, 0]",
        "level = [[0, 0, 0], [1, 1, 1], [2, 2, 2]]",
        "up = [0, 0, 1]\nrotate = [\"1 deg\", \"0 deg\", \"0 deg\"]",
    ] {
        let file = dir.path().join("wrong.toml");
        std::fs::write(&file, format!("{text}\n[placement]\n{wrong}\n")).expect("written");
        let out = terrace(["check", file.to_str().expect("text")]);
        assert!(!out.status.success() && said(&out).contains("placement-laid"), "{wrong}: {}", said(&out));
    }
}
