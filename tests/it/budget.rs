//! The error and depth budget, and the reserve that is taken off PDOF.

use std::path::{Path, PathBuf};
use terrace_core::math;

use serde_json::Value;

use crate::support::surfaces::{mesh, write_stl};
use crate::support::{JobText, compile, folder, machine_file, manifest, number, said, summary_of, terrace, verify};

/// Tangent of the slope of the plane.
const SLOPE: f64 = 0.1;

/// A plane of 60 x 60 mm that rises along x, under squares 1.5 mm apart, for a machine with these errors.
fn job(dir: &Path, machine: &str, surface: &str, more: &str, focus: &str) -> PathBuf {
    let stl = dir.join("plane.stl");
    write_stl(&stl, &mesh(1, [0.0, 0.0, 60.0, 60.0], |x, _| SLOPE * x));
    let text = machine_file("xyz-galvo-40")
        .replace("[scanner]", &format!("{machine}\n[scanner]"))
        .replace("[stage]", "[stage]\nz_accuracy = \"2 um\"");
    std::fs::write(dir.join("m.toml"), text).expect("written");
    let mut text = JobText::on(&stl).texture("pattern = \"squares\"\npitch = \"1.5 mm\"\ncell = \"1 mm\"");
    text.surface = format!("{}\n{surface}", text.surface);
    text.machine = "file = \"m.toml\"".into();
    text.focus = focus.into();
    text.more = more.into();
    text.method("z-range").write(dir, "plane.toml")
}

const LENS: &str = "telecentricity = \"0.5 deg\"\nfield_residual = \"5 um\"\n";
const PLACED: &str = "[placement]\nresidual = \"10 um\"\nresidual_z = \"3 um\"\n";

/// The terms of one side of a budget by their cause; null where nothing is stated.
fn term(side: &Value, cause: &str) -> Value {
    let terms = side["terms"].as_array().expect("terms");
    terms.iter().find(|t| t["cause"] == cause).unwrap_or_else(|| panic!("{cause}: {side}"))["um"].clone()
}

fn near(found: &Value, wanted: f64) {
    let found = found.as_f64().unwrap_or_else(|| panic!("{found}"));
    assert!((found - wanted).abs() < 2e-4 * wanted, "{found} {wanted}");
}

fn codes(summary: &Value) -> Vec<String> {
    summary["warnings"].as_array().expect("a list").iter().map(|w| w["code"].as_str().expect("a code").into()).collect()
}

#[test]
#[ignore = "slow: make test-all"]
fn the_terms_of_a_plane_are_those_of_their_formulae() {
    let dir = folder();
    let at = |reserve: &str| {
        let focus = format!("pdof = \"0.07 mm\"\nreserve = {reserve:?}");
        job(dir.path(), LENS, "tessellation = \"1 um\"", PLACED, &focus)
    };
    let out = dir.path().join("plane.job");
    let summary = compile(&at("0 mm"), &out);
    verify(&out);
    let (lateral, depth) = (&summary["budget"]["lateral"], &summary["budget"]["depth"]);
    let stretch = math::hypot(SLOPE, 1.0);
    near(&term(lateral, "projection"), 1500.0 * (stretch - 1.0));
    near(&term(lateral, "stage"), 5.0 * std::f64::consts::SQRT_2);
    // 35 um out of focus, 0.5 deg.
    near(&term(lateral, "telecentricity"), 0.3054);
    near(&term(lateral, "field_residual"), 5.0);
    near(&term(lateral, "registration"), 10.0);
    near(&term(depth, "tessellation"), stretch);
    near(&term(depth, "stage_z"), 2.0);
    near(&term(depth, "registration_z"), 3.0);
    let moved = 5.0 * std::f64::consts::SQRT_2 + 0.3054 + 5.0 + 10.0;
    near(&term(depth, "slope"), SLOPE * moved);
    near(&lateral["sum_um"], 1500.0 * (stretch - 1.0) + moved);
    let of_depth = [stretch, 2.0, 3.0, SLOPE * moved];
    near(&depth["sum_um"], of_depth.iter().sum());
    near(&depth["rss_um"], of_depth.iter().map(|um| um * um).sum::<f64>().sqrt());
    // Every block has its own, and the job the worst of them.
    let printed = manifest(&out);
    let blocks = printed["blocks"].as_array().expect("blocks");
    let sums = |key: &str| blocks.iter().map(|b| number(&b["errors_um"], key)).fold(0.0, f64::max);
    assert_eq!(sums("lateral_sum"), number(lateral, "sum_um"));
    let worst = blocks.iter().find(|b| b["id"] == depth["block"]).expect("the worst block");
    assert_eq!(worst["errors_um"]["depth_sum"], depth["sum_um"]);
    assert_eq!(worst["errors_um"]["depth_left"], summary["budget"]["depth_left_um"]);
    // Blocks use all of PDOF, so the errors have no room.
    assert!(codes(&summary).contains(&"depth-budget".into()), "{summary}");
    // What the hint says is room enough, and no more than that.
    let hint = summary["warnings"].as_array().expect("a list").iter().find(|w| w["code"] == "depth-budget");
    let hint = hint.expect("a warning")["help"].as_str().expect("a hint").to_owned();
    let reserve = hint.split('"').nth(1).expect("a length").to_owned();
    assert_eq!(reserve, "17 um");
    let summary = compile(&at(&reserve), &out);
    verify(&out);
    assert!(!codes(&summary).contains(&"depth-budget".into()), "{summary}");
    let summary = summary_of(&at("14 um"));
    assert!(codes(&summary).contains(&"depth-budget".into()), "{summary}");
}

#[test]
fn errors_as_large_as_pdof_have_no_reserve_to_suggest() {
    let dir = folder();
    let placed = "[placement]\nresidual_z = \"0.1 mm\"\n";
    let summary = summary_of(&job(dir.path(), "", "", placed, "pdof = \"0.07 mm\""));
    let hint = summary["warnings"].as_array().expect("a list").iter().find(|w| w["code"] == "depth-budget");
    let hint = hint.expect("a warning")["help"].to_string();
    assert!(hint.contains("no focus.reserve can keep room"), "{hint}");
}

#[test]
fn what_nobody_states_is_named_and_is_not_zero() {
    let dir = folder();
    let job = job(dir.path(), "", "", "", "pdof = \"0.07 mm\"");
    let out = dir.path().join("plane.job");
    let summary = compile(&job, &out);
    let (lateral, depth) = (&summary["budget"]["lateral"], &summary["budget"]["depth"]);
    for (side, causes) in [
        (lateral, ["telecentricity", "field_residual", "registration"].as_slice()),
        (depth, ["tessellation", "registration_z"].as_slice()),
    ] {
        causes.iter().for_each(|cause| assert!(term(side, cause).is_null(), "{cause}: {side}"));
    }
    let keys =
        "lens.telecentricity, lens.field_residual, placement.residual, surface.tessellation, placement.residual_z";
    let sheet = std::fs::read_to_string(out.join("runsheet.txt")).expect("a run sheet");
    assert!(sheet.contains(&format!("           not stated: {keys}\n")), "{sheet}");
    assert!(sheet.contains("PDOF       70.0 um, of which 0.0 um are kept for errors\n"), "{sheet}");
    let report = std::fs::read_to_string(out.join("report.html")).expect("a report");
    assert_eq!(report.matches("<td>not stated</td>").count(), 5, "{report}");
    let warned = "Without a reserve, a warning comes only where the sum in depth exceeds what is left of PDOF by 10 % of \
                  half the depth range.";
    assert!(report.contains(warned), "{report}");
    let said = said(&terrace([Path::new("check"), &job]));
    assert!(said.contains(&format!("not stated     {keys}\n")), "{said}");
}

#[test]
#[ignore = "slow: make test-all"]
fn the_reserve_is_taken_off_pdof_under_either_rule() {
    let dir = folder();
    for (rule, deep) in [("range", 0.05), ("half", 0.1)] {
        let focus = format!("pdof = \"0.07 mm\"\nreserve = \"20 um\"\nrule = {rule:?}");
        let out = dir.path().join("plane.job");
        let summary = compile(&job(dir.path(), "", "", "", &focus), &out);
        let proof = verify(&out);
        assert!((number(&summary, "worst_defocus_um") - 500.0 * deep).abs() < 0.2, "{rule}: {summary}");
        assert!(number(&proof, "worst_defocus_um") <= 500.0 * deep + 0.06, "{rule}: {proof}");
        let focus = &manifest(&out)["focus"];
        assert_eq!(
            [number(focus, "pdof_mm"), number(focus, "reserve_mm"), number(focus, "depth_range_mm")],
            [0.07, 0.02, deep]
        );
        // Half of what PDOF allows, less the defocus: half of what the reserve has taken.
        let allowed = if rule == "range" { 35.0 } else { 70.0 };
        let left = allowed - number(&summary, "worst_defocus_um");
        assert!((number(&summary["budget"], "depth_left_um") - left).abs() < 1e-9, "{rule}: {summary}");
    }
}

#[test]
fn a_reserve_as_large_as_pdof_and_the_tessellation_of_step_are_refused_at_their_keys() {
    let dir = folder();
    let refused = |surface: &str, focus: &str| {
        let out = terrace([Path::new("check"), &job(dir.path(), "", surface, "", focus)]);
        assert_eq!(out.status.code(), Some(2), "{}", said(&out));
        said(&out)
    };
    let text = refused("", "pdof = \"0.07 mm\"\nreserve = \"70 um\"");
    assert!(text.contains("error[focus-reserve]") && text.contains("reserve = \"70 um\""), "{text}");
    let text = refused("", "pdof = \"0.07 mm\"\nreserve = \"-1 um\"");
    assert!(text.contains("must not be negative"), "{text}");
    let text = refused("tessellation = \"11 mm\"", "pdof = \"0.07 mm\"");
    assert!(text.contains("error[error-range]") && text.contains("surface.tessellation is 11 mm"), "{text}");
    let step = "[surface]\nfile = \"a.step\"\ntessellation = \"1 um\"\n";
    let path = job(dir.path(), "", "", "", "pdof = \"0.07 mm\"");
    let text = std::fs::read_to_string(&path).expect("a job");
    let texture = text.find("[[texture]]").expect("a texture");
    std::fs::write(&path, format!("{step}{}", &text[texture..])).expect("written");
    let out = terrace([Path::new("check"), &path]);
    assert!(said(&out).contains("error[surface-tessellation]"), "{}", said(&out));
}
