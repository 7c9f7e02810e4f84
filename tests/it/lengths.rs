//! Nothing is lost and nothing is marked twice: mark - overlap + skipped = texture, to 1e-9.

use std::path::Path;
use terrace_core::math;

use crate::support::surfaces::{dome, mesh, write_stl};
use crate::support::{
    JobText, ONE_FILE, assert_balance, compile, fixture, folder, machine_file, number, shared, verify,
};
use serde_json::Value;

/// Compiles and verifies; answers the summary.
fn check(job: &JobText, dir: &Path, name: &str) -> Value {
    let out = dir.join(format!("{name}.job"));
    let summary = compile(&job.write(dir, &format!("{name}.toml")), &out);
    assert_balance(&summary, &verify(&out));
    std::fs::remove_dir_all(out).expect("a folder of ours");
    summary
}

/// Hatch, Hilbert curve, 22,500 square loops, and a drawing tiled three by three, all over a square area
/// [x0, y0, x1, y1] in mm.
fn textures(area: [f64; 4], hatch_mm: f64, drawing: &Path) -> Vec<(&'static str, String)> {
    let side = area[2] - area[0];
    let place = format!("area = {:?}", area.map(|v| format!("{v} mm")));
    let pitch = side / 150.0;
    let (file, page) = (drawing.display().to_string(), side / 3.0);
    vec![
        ("hatch", format!("pattern = \"hatch\"\npitch = \"{hatch_mm} mm\"\ndirection = \"17 deg\"\n{place}")),
        ("hilbert", format!("pattern = \"hilbert\"\norder = 8\n{place}")),
        ("squares", format!("pattern = \"squares\"\npitch = \"{pitch} mm\"\ncell = \"{} mm\"\n{place}", 0.6 * pitch)),
        (
            "svg",
            format!(
                "file = {file:?}\nsize = [\"{page} mm\", \"{page} mm\"]\ntile = true\nfill = \"outline\"\nstroke = \"centre\"\n{place}"
            ),
        ),
    ]
}

#[test]
#[ignore = "slow: make test-all"]
fn lengths_balance_on_the_dome() {
    let dir = folder();
    let stl = dir.path().join("dome.stl");
    write_stl(&stl, &mesh(200, [0.0, 0.0, 450.0, 450.0], dome));
    for (name, texture) in textures([0.0, 0.0, 450.0, 450.0], 2.0, &fixture("leather.svg")) {
        let mut job = JobText::on(&stl).texture(&texture).method("z-range").partition("min_mark = \"0 mm\"");
        job.more = ONE_FILE.into();
        let summary = check(&job, dir.path(), name);
        assert_eq!(number(&summary, "skipped_mm"), 0.0, "{name}: the whole texture lies on the part");
        if name == "squares" {
            let figures = number(&summary, "figures_whole") + number(&summary, "figures_cut");
            assert_eq!(figures, 22_500.0);
            assert!((number(&summary, "texture_mm") - 22_500.0 * 7.2).abs() < 1e-3);
        }
    }
}

/// Marks every texture over a square area of the hood, and a hatch by contour and by z-range; answers with the stops by
/// contour. `sections` is the number of sections, of which levels of the whole part cut each once more than needed.
fn stops_on_a_hood(area: [f64; 4], machine: &str, sections: f64) -> f64 {
    let dir = folder();
    std::fs::write(dir.path().join("machine.txt"), machine).expect("a writable folder");
    let panel = |texture: &str, method| {
        let mut job =
            JobText::on(&fixture("hood.stl")).texture(texture).method(method).partition("min_mark = \"0 mm\"");
        job.machine = "file = \"machine.txt\"".into();
        job.more = ONE_FILE.into();
        job
    };
    let mut contour = 0.0;
    for (name, texture) in textures(area, 1.0, &fixture("leather.svg")) {
        let summary = check(&panel(&texture, "contour"), dir.path(), name);
        assert_eq!(number(&summary, "skipped_mm"), 0.0, "{name}: the whole texture lies on the part");
        if name == "hatch" {
            contour = number(&summary, "stops");
            let z_range = number(&check(&panel(&texture, "z-range"), dir.path(), name), "stops");
            assert!(z_range <= contour && contour <= z_range + sections, "{z_range} {contour}");
        }
    }
    contour
}

#[test]
#[ignore = "slow: make test-all"]
fn lengths_balance_on_a_hood() {
    stops_on_a_hood([605.0, -25.0, 655.0, 25.0], &large_machine(), 4.0);
}

#[test]
#[ignore = "slow: make test-all"]
fn lengths_balance_on_450_mm_of_a_hood() {
    // The counts of this patch: the whole field of 40 mm, and a rim of 2 mm left unused.
    let area = [415.0, -225.0, 865.0, 225.0];
    let whole = stops_on_a_hood(area, &large_machine(), 169.0);
    assert!((12_800.0..=32_000.0).contains(&whole), "{whole}");
    let rim = stops_on_a_hood(area, &large_machine().replace("margin = \"0 mm\"", "margin = \"2 mm\""), 169.0);
    assert!((13_000.0..=32_000.0).contains(&rim), "{rim}");
}

/// The article's machine, whose stage travels 500 x 500 x 400 mm, as a file.
fn large_machine() -> String {
    let text = machine_file("xyz-galvo-40");
    assert!(text.contains("travel = [\"-250 mm\", \"250 mm\"]") && text.contains("travel = [\"-200 mm\", \"200 mm\"]"));
    text
}

/// A torus whose axis leans by 50 degrees: up to four sheets lie over each other.
fn torus() -> Vec<[[f64; 3]; 3]> {
    let (n, m) = (80, 40);
    let lean = 50f64.to_radians();
    let at = |i: usize, j: usize| {
        let [a, b] = [(i, n), (j, m)].map(|(i, n)| (i % n) as f64 / n as f64 * std::f64::consts::TAU);
        let ring = 20.0 + 8.0 * math::cos(b);
        let [x, y, z] = [ring * math::cos(a), ring * math::sin(a), 8.0 * math::sin(b)];
        [x * math::cos(lean) + z * math::sin(lean), y, z * math::cos(lean) - x * math::sin(lean)]
    };
    let quads = (0..n).flat_map(|i| (0..m).map(move |j| [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]));
    quads.map(|q| q.map(|(i, j)| at(i, j))).flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect()
}

#[test]
#[ignore = "slow: make test-all"]
fn lengths_balance_on_undercuts() {
    let dir = folder();
    let stl = dir.path().join("torus.stl");
    write_stl(&stl, &torus());
    for (name, texture) in textures([-30.5, -30.5, 30.5, 30.5], 1.0, &fixture("leather.svg")) {
        let mut job = JobText::on(&stl).texture(&texture);
        job.focus = "pdof = \"0.5 mm\"".into();
        job.more = "[limits]\nmax_off_part = \"100 %\"\n".into();
        let summary = check(&job, dir.path(), name);
        assert!(number(&summary, "mark_mm") > 0.0 && number(&summary, "skipped_off_part_mm") > 0.0, "{name}");
        assert!(number(&summary, "skipped_steep_mm") > 0.0, "{name}");
    }
}

#[test]
#[ignore = "needs ../shared: make test-all"]
fn lengths_balance_on_undercuts_of_other_sources() {
    let data = shared();
    let dir = folder();
    // The helmet and the knot are higher than the article's lens stands above its focus.
    let text = large_machine().replace("working_distance = \"150 mm\"", "working_distance = \"400 mm\"");
    std::fs::write(dir.path().join("machine.txt"), text).expect("a writable folder");
    let job = |file: &str, texture: &str| {
        let mut job = JobText::on(&data.join("surfaces").join(file)).texture(texture);
        job.machine = "file = \"machine.txt\"".into();
        job.focus = "pdof = \"0.5 mm\"".into();
        job.more = "[limits]\nmax_off_part = \"100 %\"\n".into();
        job
    };
    for (name, texture) in textures([-40.5, -40.5, 40.5, 40.5], 0.5, &data.join("textures/hero_topography.svg")) {
        let summary = check(&job("mouse_shell_undercut.stl", &texture), dir.path(), name);
        assert!(number(&summary, "mark_mm") > 0.0 && number(&summary, "skipped_off_part_mm") > 0.0, "{name}");
        assert!(number(&summary, "skipped_steep_mm") > 0.0, "{name}");
    }
    for file in ["helmet_shell_undercut.stl", "quadknot.obj"] {
        let summary = check(&job(file, "pattern = \"hatch\"\npitch = \"2 mm\""), dir.path(), "hatch");
        assert!(number(&summary, "mark_mm") > 0.0 && number(&summary, "skipped_off_part_mm") > 0.0, "{file}");
        assert!(number(&summary, "skipped_steep_mm") > 0.0, "{file}");
    }
}

#[test]
fn lines_on_section_limits_and_on_the_border_are_marked_once() {
    let dir = folder();
    let stl = dir.path().join("plate.stl");
    write_stl(&stl, &mesh(9, [0.0, 0.0, 120.0, 80.0], |x, y| 0.001 * x + 0.0007 * y));
    for direction in ["0 deg", "90 deg"] {
        // Lines at every 20 mm: on the limits at 40 and 80 mm, and on all four borders.
        let hatch = format!("pattern = \"hatch\"\npitch = \"20 mm\"\ndirection = \"{direction}\"");
        let summary = check(&JobText::on(&stl).texture(&hatch), dir.path(), "plate");
        let want = if direction == "0 deg" { 5.0 * 120.0 } else { 7.0 * 80.0 };
        assert!((number(&summary, "mark_mm") - want).abs() < 1e-6, "{direction}: {}", summary["mark_mm"]);
        assert_eq!(number(&summary, "skipped_mm"), 0.0);
    }
}
