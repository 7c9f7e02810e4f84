//! Mutants of jobs on a machine with a zoom optic.

use super::*;
use terrace_core::geom::Nm;

fn bench(tables: &str) -> Bench {
    let bench = Bench::edited(4.0, |text| {
        let text = text.replacen("xyz-galvo-40", "xyz-zoom-40", 1);
        text.replacen("machine =", &format!("{tables}\n            machine ="), 1)
    });
    let s = &bench.plan.summary;
    assert!(s.stops < s.blocks / 5, "{s:?}");
    bench
}

/// A block that the optic alone goes to.
fn shifted(program: &Program) -> usize {
    let by_zoom = |w: &[Block]| w[1].is_reached_by_zoom(&w[0]);
    1 + program.blocks.windows(2).position(by_zoom).expect("a block reached by zoom")
}

#[test]
fn job_with_zoom_optic_verifies_in_passes_too() {
    for tables in ["", "passes = { count = 3, rotate = \"67 deg\", lower = \"8 um\" }"] {
        let proof = verified(&bench(tables).write());
        assert!(proof.ok, "{}", proof.to_text());
    }
}

#[test]
fn depth_reports_a_wrong_focus_shift_in_all_files() {
    for by in [20_000, -70_000] {
        let proof = bench("").mutant(|program, _| {
            let i = shifted(program);
            program.blocks[i].focus_shift += Nm(by);
        });
        assert_only("depth", &proof);
    }
}

#[test]
fn depth_reports_a_plane_of_the_stage_that_does_not_belong_to_the_focus_shift() {
    let proof = bench("").mutant(|program, plan| {
        let i = shifted(program);
        // All blocks of the standstill, so that the stage does not move within it.
        let at = program.blocks[i].stage;
        let raised = |b: &mut Block| b.stage[2] += 50_000 * plan.machine.stage.z.sign();
        program.blocks.iter_mut().filter(|b| b.stage == at).for_each(raised);
    });
    assert_only("depth", &proof);
}

#[test]
fn depth_reports_a_focus_shift_beyond_the_optic() {
    let proof = bench("").mutant(|program, plan| {
        let by = plan.machine.most_focus_shift() + Nm(100) - program.blocks[0].focus_shift;
        let at = program.blocks[0].stage;
        for b in program.blocks.iter_mut().filter(|b| b.stage == at) {
            b.focus_shift += by;
            b.stage[2] -= by.0 * plan.machine.stage.z.sign();
        }
    });
    assert_only("depth", &proof);
}

#[test]
fn travel_reports_a_standstill_beside_its_blocks() {
    let proof = bench("").mutant(|program, _| {
        let at = program.blocks[0].stage;
        program.blocks.iter_mut().filter(|b| b.stage == at).for_each(|b| b.stage[0] += 1_000);
    });
    assert_only("travel", &proof);
}

#[test]
fn agreement_reports_a_focus_shift_that_one_file_states_otherwise() {
    let bench = bench("");
    let program = bench.plan.checked.program();
    let i = shifted(program);
    let shift = program.blocks[i].focus_shift.mm();
    let id = terrace_core::program::BlockId::new(i).to_string();
    for name in ["stage.ngc", "stage_m0.nc"] {
        let old = format!("(FOCUS SHIFT {shift:.6})");
        for new in ["(FOCUS SHIFT 0.123456)", "(FOCUS SHIFT x)", ""] {
            let proof = bench.damaged(name, |b| replace(b, &format!("(BLOCK {id} "), &old, new));
            assert!(!proof.ok, "{name} {new}: {}", proof.to_text());
        }
    }
    let proof = bench.damaged("runsheet.csv", |b| replace(b, &format!("\n{id},"), &format!(",{shift:.6}\n"), ",9.0\n"));
    assert_only("agreement", &proof);
    let proof = bench.damaged("runsheet.txt", |b| {
        replace(b, &format!("\n[ ] {id} "), &format!(" {shift:.4} "), &format!(" {:.4} ", shift + 0.01));
    });
    assert_only("agreement", &proof);
    let target = bench.write();
    alter_manifest(&target, |m| m["blocks"][i]["focus_shift_mm"] = 0.5.into());
    assert_only("agreement", &verified(&target));
    // The settings of one plane of the OVF: a float of 4 bytes after the tag of field 3.
    let proof = bench.damaged("job.ovf", |b| {
        let wanted = [&[3 << 3 | 5][..], &(shift as f32).to_le_bytes()].concat();
        let at = b.windows(5).position(|w| w == wanted).expect("the settings of the block");
        b[at + 3] ^= 1;
    });
    assert_only("agreement", &proof);
}

#[test]
fn a_focus_shift_on_a_machine_without_zoom_optic_is_reported() {
    let proof = Bench::new().mutant(|program, plan| {
        let block = &mut program.blocks[5];
        block.focus_shift = Nm(10_000);
        block.stage[2] -= 10_000 * plan.machine.stage.z.sign();
    });
    let rule = proof.rule("depth").expect("a rule");
    assert!(rule.violated > 0, "{}", proof.to_text());
}
