//! Nothing is lost and nothing is marked twice: mark - overlap + skipped = texture, to 1e-9.

mod support;

use std::path::Path;

use support::surfaces::{dome, mesh, write_stl};
use support::{JobText, assert_balance, compile, folder, number, shared, verify};

fn check(job: &JobText, dir: &Path, name: &str) -> serde_json::Value {
    let out = dir.join(format!("{name}.job"));
    let summary = compile(&job.write(dir, &format!("{name}.toml")), &out);
    assert_balance(&summary, &verify(&out));
    std::fs::remove_dir_all(&out).expect("a folder of ours");
    summary
}

/// A real drawing with thousands of curves; None where it is absent.
fn drawing() -> Option<String> {
    let path = shared()?.join("textures/hero_topography.svg");
    Some(format!("file = {:?}", path.display().to_string()))
}

#[test]
fn lengths_balance_on_the_dome() {
    let dir = folder();
    let stl = dir.path().join("dome.stl");
    write_stl(&stl, &mesh(500, [0.0, 0.0, 450.0, 450.0], dome));
    let mut textures = vec![
        ("hatch", "pattern = \"hatch\"\npitch = \"0.5 mm\"\ndirection = \"17 deg\"".to_owned()),
        ("hilbert", "pattern = \"hilbert\"\norder = 10".to_owned()),
        ("squares", "pattern = \"squares\"\npitch = \"1 mm\"\ncell = \"0.6 mm\"".to_owned()),
    ];
    if let Some(file) = drawing() {
        textures.push(("svg", format!("{file}\nsize = [\"100 mm\", \"100 mm\"]\ntile = true\narea = \"part\"")));
    }
    for (name, texture) in textures {
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
    let machine = dir.path().join("large.toml.machine");
    std::fs::write(&machine, large_machine()).expect("a writable folder");
    let area = "area = [\"415 mm\", \"-225 mm\", \"865 mm\", \"225 mm\"]";
    let mut job = JobText::on(&data.join("surfaces/hood_mm_bin.stl"));
    job.machine = format!("file = {:?}", machine.display().to_string());
    let hatch = format!("pattern = \"hatch\"\npitch = \"1 mm\"\n{area}");
    let summary = check(&JobText { textures: vec![hatch], method: "contour", ..job }, dir.path(), "hatch");
    let stops = number(&summary, "stops");
    assert!((13_000.0..=32_000.0).contains(&stops), "{stops}");
    let mut job = JobText::on(&data.join("surfaces/hood_mm_bin.stl"));
    job.machine = format!("file = {:?}", machine.display().to_string());
    if let Some(file) = drawing() {
        let svg = format!("{file}\nsize = [\"150 mm\", \"150 mm\"]\ntile = true\n{area}");
        check(&JobText { textures: vec![svg], method: "z-range", ..job }, dir.path(), "svg");
    }
}

/// The article's machine with a stage of 500 x 500 x 400 mm.
fn large_machine() -> String {
    let out = support::terrace(["machines", "xyz-galvo-40"]);
    assert!(out.status.success());
    let text = String::from_utf8(out.stdout).expect("text");
    assert!(text.contains("travel = [\"-250 mm\", \"250 mm\"]") && text.contains("travel = [\"-200 mm\", \"200 mm\"]"));
    text
}

#[test]
fn lengths_balance_on_undercuts() {
    let Some(data) = shared() else { return };
    let dir = folder();
    for (file, unit) in [("mouse_shell_undercut.stl", "mm"), ("helmet_shell_undercut.stl", "mm"), ("quadknot.obj", "mm")] {
        let mut job = JobText::on(&data.join("surfaces").join(file)).texture("pattern = \"hatch\"\npitch = \"2 mm\"");
        job.surface = job.surface.replace("unit = \"mm\"", &format!("unit = \"{unit}\""));
        job.focus = "pdof = \"0.5 mm\"".into();
        let summary = check(&job, dir.path(), "undercut");
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
