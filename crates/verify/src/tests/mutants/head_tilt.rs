//! Mutants of blocks under a head that tilts.

use super::*;
use terrace_core::machine::{Machine, Tilt};

/// The wavy sheet under a head that tilts, with poses.
fn bench(tables: &str) -> Bench {
    let bench = Bench::edited(1.0, |text| {
        let text = text.replacen("\"z-range\"", "\"tilt\"", 1).replacen("xyz-galvo-40", "xyz-headtilt-galvo-40", 1);
        let text = text.replacen("\"ovf\"]", "\"ovf\", \"poses\"]", 1);
        text.replacen("machine =", &format!("{tables}\n            machine ="), 1)
    });
    let tilts = bench.plan.checked.program().blocks.iter().filter(|b| !b.stop.tilt.is_upright()).count();
    assert!(tilts > 3, "{:?}", bench.plan.summary);
    bench
}

fn found(code: &str, proof: &Proof) {
    assert!(proof.rule(code).is_some_and(|r| r.violated > 0), "{code}: {}", proof.to_text());
}

/// The stage where a compiler would send it that takes the axes to be others than they are.
fn mistaken(change: impl Fn(&mut Tilt)) -> Proof {
    bench("").mutant(|program, plan| {
        let mut machine: Machine = plan.machine.clone();
        change(machine.tilt.as_mut().expect("axes"));
        for b in program.blocks.iter_mut().filter(|b| !b.stop.tilt.is_upright()) {
            b.stage = machine.stand(b.stop.tilt, b.stop.centre, b.stage_plane(), plan.checked.origin()).stage;
        }
    })
}

#[test]
fn blocks_under_a_tilted_head_verify_and_every_mutant_is_reported() {
    let sound = bench("");
    let proof = verified(&sound.write());
    assert!(proof.ok, "{}", proof.to_text());
    // The pivot 20 um higher, an axis the other way round, and the axes in the other order: the stage goes elsewhere.
    let proof = mistaken(|tilt| tilt.pivot[2] = terrace_core::units::Length::mm(250.02));
    found("travel", &proof);
    // The poses of the OVF are those of the blocks, and no longer where the commands bring the head.
    found("agreement", &proof);
    found("travel", &mistaken(|tilt| tilt.axes[1].reversed = true));
    found("travel", &mistaken(|tilt| tilt.axes.swap(0, 1)));
    // A command of the wrong sign, said alike in all files, with the stage where it would belong to it.
    let proof = bench("").mutant(|program, plan| {
        let most = |b: &&mut Block| b.stop.tilt[1].abs();
        let block = program.blocks.iter_mut().max_by_key(most).expect("a block");
        block.stop.tilt[1] = -block.stop.tilt[1];
        block.stage =
            plan.machine.stand(block.stop.tilt, block.stop.centre, block.stage_plane(), plan.checked.origin()).stage;
    });
    found("source", &proof);
    // A position of the stage that is off by one increment.
    let proof = bench("").mutant(|program, plan| {
        let block = program.blocks.iter_mut().find(|b| !b.stop.tilt.is_upright()).expect("a tilted block");
        block.stage[0] += plan.machine.increment_nm().0;
    });
    found("travel", &proof);
}

#[test]
#[ignore = "slow: make test-all"]
fn poses_that_differ_from_the_commands_are_reported() {
    let sound = bench("");
    let text = String::from_utf8(std::fs::read(sound.write().join("poses.csv")).expect("poses")).expect("ASCII");
    let lines: Vec<&str> = text.lines().collect();
    let tilted =
        lines.iter().skip(1).find(|line| !line.ends_with("0.000000,0.000000,0.000000")).expect("a tilted block");
    // Another angle, another place, a block left out, and two exchanged.
    let fields: Vec<&str> = tilted.split(',').collect();
    for column in 1..7 {
        let value: f64 = fields[column].parse().expect("a number");
        let mut changed: Vec<String> = fields.iter().map(|f| (*f).to_owned()).collect();
        for other in [format!("{:.6}", value + 0.000_01), "NaN".into(), "inf".into()] {
            changed[column] = other;
            let proof = sound.damaged("poses.csv", |bytes| replace(bytes, "", tilted, &changed.join(",")));
            found("agreement", &proof);
        }
    }
    found("agreement", &sound.damaged("poses.csv", |bytes| replace(bytes, "", &format!("{tilted}\r\n"), "")));
    // The pose of the work plane in the OVF with an angle that is not a number, and written by a compiler that takes the axes to be others than they are.
    let job = |plan: &SteppedPlan| {
        let mut machine = plan.machine.clone();
        machine.tilt.as_mut().expect("axes").axes.iter_mut().for_each(|axis| axis.reversed = true);
        terrace_plan::emit::ovf::write(&plan.checked, &machine, "job.toml", "part.stl")
    };
    let other = job(&sound.plan);
    found("agreement", &sound.damaged("job.ovf", |bytes| *bytes = other));
    let angle = fields[5].parse::<f32>().expect("a number").to_le_bytes();
    let proof = sound.damaged("job.ovf", |bytes| {
        let at = bytes.windows(4).position(|four| four == angle).expect("the angle");
        bytes[at..at + 4].copy_from_slice(&f32::NAN.to_le_bytes());
    });
    found("agreement", &proof);
}

#[test]
#[ignore = "slow: make test-all"]
fn blocks_under_a_tilted_head_in_passes_with_dose_verify() {
    let more = "passes = { count = 2, lower = \"8 um\", rotate = \"30 deg\" }\n            \
        dose = { compensate = \"speed\", step = 0.001 }";
    let proof = verified(&bench(more).write());
    assert!(proof.ok, "{}", proof.to_text());
}

#[test]
fn clearance_reports_a_lift_that_is_missing_before_the_head_swings() {
    let files = [("machine.toml", head("xyz-headtilt-galvo-40", "10.4 mm", "20 mm"))];
    let bench = || {
        Bench::edited_beside(1.0, &files, |text| {
            let text = text.replacen("profile = \"xyz-galvo-40\"", "file = \"machine.toml\"", 1);
            text.replacen("\"z-range\"", "\"tilt\"", 1)
        })
    };
    let sound = bench();
    let proof = verified(&sound.write());
    assert!(proof.ok, "{}", proof.to_text());
    let proof = bench().mutant(|program, _| {
        let lifted = program.blocks.iter_mut().skip(1).filter(|b| b.retract);
        assert!(lifted.map(|b| b.retract = false).count() > 0, "blocks that are entered by a lift");
    });
    found("clearance", &proof);
}
