//! Mutants of jobs of several passes.

use super::super::broken;
use super::*;
use terrace_core::geom::Nm;
use terrace_core::program::PassId;

/// Three passes of the same job.
fn three() -> Bench {
    Bench::with("", "passes = { count = 3, rotate = \"67 deg\", lower = \"8 um\" }")
}

fn range_of(program: &Program, pass: u32) -> std::ops::Range<usize> {
    let first = program.blocks.iter().position(|b| b.pass == PassId(pass)).expect("a pass");
    first..first + program.blocks.iter().filter(|b| b.pass == PassId(pass)).count()
}

#[test]
fn three_passes_verify() {
    let bench = three();
    let proof = verified(&bench.write());
    assert!(proof.ok, "{}", proof.to_text());
    assert!((proof.lengths.texture_mm / verified(&Bench::new().write()).lengths.texture_mm - 3.0).abs() < 0.05);
}

#[test]
fn coverage_reports_a_missing_pass() {
    let mut bench = Bench::hatched("passes = { count = 3, rotate = \"67 deg\" }");
    // Its picture has nothing to draw then.
    let first = bench.plan.passes[2].blocks.start;
    bench.plan.passes[2].blocks = first..first;
    let proof = bench.mutant(|program, _| {
        let gone = range_of(program, 2);
        program.strokes.truncate(program.blocks[gone.start].strokes.start);
        program.blocks.truncate(gone.start);
    });
    assert_only("coverage", &proof);
}

#[test]
fn depth_reports_a_pass_that_is_not_lowered() {
    let proof = three().mutant(|program, plan| {
        for i in range_of(program, 1) {
            let b = &mut program.blocks[i];
            for z in [&mut b.stop.lpfl, &mut b.stop.z_lo, &mut b.stop.z_hi, &mut b.z_lo, &mut b.z_hi] {
                *z += Nm(8_000);
            }
            place(b, plan);
        }
    });
    assert_only("depth", &proof);
}

#[test]
fn source_reports_a_pass_of_another_angle() {
    // Straight lines: those along contours do not turn.
    let mut bench = Bench::hatched("passes = { count = 2, rotate = \"67 deg\" }");
    assert!(verified(&bench.write()).ok);
    alter(bench.dir.path(), "job.toml", |b| replace(b, "passes", "67 deg", "66.9 deg"));
    bench.plan.job = load(&bench.dir.path().join("job.toml"));
    let proof = verified(&bench.write());
    let broken = broken(&proof);
    assert!(broken.contains(&"source") && !broken.contains(&"agreement"), "{}", proof.to_text());
}

#[test]
fn a_block_in_another_pass_is_found() {
    // The last of the first pass, as if it belonged to the second.
    let proof = three().mutant(|program, _| {
        let last = range_of(program, 0).end - 1;
        program.blocks[last].pass = PassId(1);
    });
    let rules = broken(&proof);
    assert!(rules.contains(&"coverage") && rules.contains(&"depth"), "{}", proof.to_text());
    // The first of the second at the end of the first.
    let proof = three().mutant(|program, _| {
        let end = range_of(program, 0).end;
        program.blocks[end - 1].pass = PassId(1);
        program.blocks[end].pass = PassId(0);
    });
    assert!(broken(&proof).contains(&"agreement"), "{}", proof.to_text());
    // A pass that the job does not have.
    let proof = three().mutant(|program, _| {
        let last = program.blocks.len() - 1;
        program.blocks[last].pass = PassId(3);
    });
    assert!(broken(&proof).contains(&"source"), "{}", proof.to_text());
}

#[test]
fn agreement_reports_passes_that_differ_from_the_manifest() {
    let bench = three();
    for (key, value) in [("lowered_mm", 0.009), ("turn_deg", 66.0)] {
        let target = bench.write();
        alter_manifest(&target, |m| m["passes"][1][key] = value.into());
        assert_only("agreement", &verified(&target));
    }
    let target = bench.write();
    alter_manifest(&target, |m| m["blocks"][0]["pass"] = 2.into());
    assert_only("agreement", &verified(&target));
    let target = bench.write();
    alter_manifest(&target, |m| _ = m["passes"][1].as_object_mut().expect("a pass").remove("sections"));
    assert_only("fill", &verified(&target));
}
