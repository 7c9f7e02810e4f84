//! Mutants of frames.

use super::*;
use crate::tests::broken;
use terrace_core::program::BlockId;
use terrace_plan::emit::frames;

const PILOT: &str = "[[pen]]\nname = \"pilot\"\nspeed = \"500 mm/s\"\npower = \"0.1 W\"\nfrequency = \"60 kHz\"\n";

/// The wavy sheet in three set-ups, with frames.
fn framed() -> Bench {
    let bench = Bench::edited(1.0, |text| {
        let setups =
            "setups = { columns = 3, registration = [[\"0 mm\", \"0 mm\"], [\"60 mm\", \"0 mm\"]] }\nmachine =";
        let text = text.replacen("machine =", setups, 1).replacen("\"z-range\"", "\"z-range\", section = \"15 mm\"", 1);
        let formats = "[\"dxf\", \"csv\", \"linuxcnc\", \"gcode\"], frames = \"pilot\"";
        text.replacen("[\"dxf\", \"csv\", \"linuxcnc\", \"gcode\", \"ovf\"]", formats, 1) + PILOT
    });
    assert_eq!(bench.plan.checked.origins().len(), 3);
    bench
}

/// A sound job of these formats on this machine.
fn assert_verifies(profile: &str, method: &str, formats: &str) -> Bench {
    let bench = Bench::edited(1.0, |text| {
        let text = text.replacen("xyz-galvo-40", profile, 1).replacen("z-range", method, 1);
        text.replacen("\"ovf\"]", &format!("\"ovf\"{formats}], frames = \"pilot\""), 1) + PILOT
    });
    let proof = verified(&bench.write());
    assert!(proof.ok, "{}", proof.to_text());
    bench
}

#[test]
#[ignore = "slow: make test-all"]
fn frames_verify_in_every_format_tilted_and_in_set_ups() {
    let bench = assert_verifies("xyz-zoom-40", "z-range", ", \"lightburn\"");
    let outline = frames::outline(&bench.plan.checked, &bench.plan.machine);
    assert!((4..=8).contains(&outline.len()), "{outline:?}");
    assert_verifies("xyz-tilt-galvo-40", "tilt", "");
    let proof = verified(&framed().write());
    assert!(proof.ok, "{}", proof.to_text());
}

#[test]
fn agreement_reports_frames_that_are_not_around_the_marks() {
    let bench = framed();
    let name = |ending: &str| frames::of_block(BlockId::new(3), ending);
    let coordinate = |b: &mut Vec<u8>, after: &str| replace(b, after, ".", ".1");
    assert_only("agreement", &bench.damaged(&name("csv"), |b| coordinate(b, "1,3,")));
    assert_only("agreement", &bench.damaged(&name("dxf"), |b| coordinate(b, "VERTEX")));
    // Another pen would burn it.
    assert_only("agreement", &bench.damaged(&name("csv"), |b| replace(b, "1,3,", "1,3,", "1,1,")));
    // The frame of another block.
    let other = std::fs::read(bench.write().join(frames::of_block(BlockId::new(4), "dxf"))).expect("a frame");
    assert_only("agreement", &bench.damaged(&name("dxf"), |b| *b = other));
}

#[test]
fn an_outline_that_leaves_out_the_farthest_block_is_reported() {
    let bench = framed();
    let target = bench.write();
    alter_manifest(&target, |m| {
        m["frames"]["outline"].as_array_mut().expect("a list").remove(0);
    });
    let proof = verified(&target);
    assert_only("agreement", &proof);
    assert!(proof.to_text().contains("farthest out"), "{}", proof.to_text());
    let target = bench.write();
    alter_manifest(&target, |m| m["frames"]["pen"] = "fine".into());
    assert!(verified(&target).to_text().contains("pen of its frames marks"));
}

#[test]
fn programs_of_frames_that_fire_or_go_elsewhere_are_reported() {
    let bench = framed();
    let (ngc, m0) = (frames::of_whole("stage.ngc"), frames::of_whole("stage_m0.nc"));
    // START would make the card mark the block that it has loaded.
    assert_only("laser", &bench.damaged(&ngc, |b| replace(b, "M0 (frame", "M0 (frame", "M64 P0\nM0 (frame")));
    assert_only("laser", &bench.damaged(&ngc, |b| replace(b, "REGISTRATION", "M65 P0\n", "M5\n")));
    for name in [&ngc, &m0] {
        let proof = bench.damaged(name, |b| replace(b, "REGISTRATION 1", "G0 X", "G0 X1"));
        assert!(proof.rule("agreement").is_some_and(|r| r.violated > 0), "{}", proof.to_text());
        let proof = bench.damaged(name, |b| replace(b, "REGISTRATION 1", "1)", "2)"));
        assert!(broken(&proof).contains(&"agreement"), "{}", proof.to_text());
        let proof = bench.damaged(name, |b| replace(b, "BLOCK", "G0 X", "G0 X1"));
        assert!(proof.rule("agreement").is_some_and(|r| r.violated > 0), "{}", proof.to_text());
        // A program of frames that names the drawing of the block would have it loaded.
        assert_only("agreement", &bench.damaged(name, |b| replace(b, "FILE", "frames/B", "blocks/B")));
    }
}
