//! Nothing is lost and nothing is marked twice: mark - overlap + skipped = texture, to 1e-9.

use std::path::Path;

use crate::support::surfaces::{dome, mesh, write_stl};
use crate::support::{JobText, assert_balance, folder, number, shared, verify};
use serde_json::Value;

/// Compiles with one thread and with two, which must give the same bytes, and verifies; answers the summary.
fn check(job: &JobText, dir: &Path, name: &str) -> Value {
    let out = crate::support::same_on_any_threads(&job.write(dir, &format!("{name}.toml")), dir);
    let text = std::fs::read(out.join("manifest.json")).expect("a manifest");
    let manifest: Value = serde_json::from_slice(&text).expect("JSON");
    assert_balance(&manifest["summary"], &verify(&out));
    std::fs::remove_dir_all(out).expect("a folder of ours");
    manifest["summary"].clone()
}

/// Hatch, Hilbert curve, 202,500 square loops and, where it is at hand, a real drawing with thousands
/// of curves, all over a square area [x0, y0, x1, y1] in mm.
fn textures(area: [f64; 4], hatch_mm: f64) -> Vec<(&'static str, String)> {
    let side = area[2] - area[0];
    let place = format!("area = {:?}", area.map(|v| format!("{v} mm")));
    let pitch = side / 450.0;
    let mut out = vec![
        ("hatch", format!("pattern = \"hatch\"\npitch = \"{hatch_mm} mm\"\ndirection = \"17 deg\"\n{place}")),
        ("hilbert", format!("pattern = \"hilbert\"\norder = 10\n{place}")),
        ("squares", format!("pattern = \"squares\"\npitch = \"{pitch} mm\"\ncell = \"{} mm\"\n{place}", 0.6 * pitch)),
    ];
    if let Some(data) = shared() {
        let file = data.join("textures/hero_topography.svg").display().to_string();
        let page = side / 3.0;
        out.push(("svg", format!("file = {file:?}\nsize = [\"{page} mm\", \"{page} mm\"]\ntile = true\n{place}")));
    }
    out
}

#[test]
fn lengths_balance_on_the_dome() {
    let dir = folder();
    let stl = dir.path().join("dome.stl");
    write_stl(&stl, &mesh(500, [0.0, 0.0, 450.0, 450.0], dome));
    for (name, texture) in textures([0.0, 0.0, 450.0, 450.0], 0.5) {
        let summary = check(&JobText::on(&stl).texture(&texture).method("z-range"), dir.path(), name);
        assert_eq!(number(&summary, "skipped_mm"), 0.0, "{name}: the whole texture lies on the part");
        if name == "squares" {
            let figures = number(&summary, "figures_whole") + number(&summary, "figures_cut");
            assert_eq!(figures, 202_500.0);
            assert!((number(&summary, "texture_mm") - 202_500.0 * 2.4).abs() < 1e-3);
        }
    }
}

#[test]
fn lengths_balance_on_a_real_panel() {
    let Some(data) = shared() else { return };
    let dir = folder();
    std::fs::write(dir.path().join("machine.txt"), large_machine()).expect("a writable folder");
    let panel = |texture: &str| {
        let mut job = JobText::on(&data.join("surfaces/hood_mm_bin.stl")).texture(texture);
        job.machine = "file = \"machine.txt\"".into();
        job
    };
    let area = [415.0, -225.0, 865.0, 225.0];
    for (name, texture) in textures(area, 1.0) {
        let summary = check(&panel(&texture), dir.path(), name);
        assert_eq!(number(&summary, "skipped_mm"), 0.0, "{name}: the whole texture lies on the part");
    }
    // The counts of this patch: the whole field of 40 mm, and a rim of 2 mm left unused.
    let place = format!("area = {:?}", area.map(|v| format!("{v} mm")));
    let stops = |machine: String| {
        std::fs::write(dir.path().join("machine.txt"), machine).expect("a writable folder");
        let hatch = format!("pattern = \"hatch\"\npitch = \"1 mm\"\n{place}");
        let contour = number(&check(&panel(&hatch), dir.path(), "contour"), "stops");
        let z_range = number(&check(&panel(&hatch).method("z-range"), dir.path(), "z-range"), "stops");
        // Levels of the whole part cut each section's heights at most once more than needed.
        assert!(z_range <= contour && contour <= z_range + 169.0, "{z_range} {contour}");
        contour
    };
    let whole = stops(large_machine());
    assert!((12_800.0..=32_000.0).contains(&whole), "{whole}");
    let rim = stops(large_machine().replace("margin = \"0 mm\"", "margin = \"2 mm\""));
    assert!((13_000.0..=32_000.0).contains(&rim), "{rim}");
}

/// The article's machine, whose stage travels 500 x 500 x 400 mm, as a file.
fn large_machine() -> String {
    let out = crate::support::terrace(["machines", "xyz-galvo-40"]);
    assert!(out.status.success());
    let text = String::from_utf8(out.stdout).expect("text");
    assert!(text.contains("travel = [\"-250 mm\", \"250 mm\"]") && text.contains("travel = [\"-200 mm\", \"200 mm\"]"));
    text
}

#[test]
fn lengths_balance_on_undercuts() {
    let Some(data) = shared() else { return };
    let dir = folder();
    // The helmet and the knot are higher than the article's lens stands above its focus.
    let text = large_machine().replace("working_distance = \"150 mm\"", "working_distance = \"400 mm\"");
    std::fs::write(dir.path().join("machine.txt"), text).expect("a writable folder");
    let job = |file: &str, texture: &str| {
        let mut job = JobText::on(&data.join("surfaces").join(file)).texture(texture);
        job.machine = "file = \"machine.txt\"".into();
        job.focus = "pdof = \"0.5 mm\"".into();
        job
    };
    for (name, texture) in textures([-40.5, -40.5, 40.5, 40.5], 0.5) {
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
