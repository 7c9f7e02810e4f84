//! Mutants of tilted blocks.

use super::*;
use terrace_core::geom::Nm;

#[test]
#[ignore = "slow: make test-all"]
fn tilted_blocks_verify_and_every_mutant_is_reported() {
    let sound = Bench::tilted("");
    let proof = verified(&sound.write());
    assert!(proof.ok, "{}", proof.to_text());
    let tilted = |program: &Program| {
        (0..program.blocks.len()).find(|&i| !program.blocks[i].stop.tilt.is_upright()).expect("a tilted block")
    };
    let found = |code: &str, proof: &Proof| {
        assert!(proof.rule(code).is_some_and(|r| r.violated > 0), "{code}: {}", proof.to_text());
    };
    // Another tilt, said alike in all files: the marks come to lie elsewhere.
    let proof = Bench::tilted("").mutant(|program, _| {
        let i = tilted(program);
        program.blocks[i].stop.tilt[0] += 10_000;
    });
    found("source", &proof);
    assert!(proof.rule("agreement").is_some_and(|r| r.violated == 0), "{}", proof.to_text());
    // A point a micrometre off the line.
    let proof = Bench::tilted("").mutant(|program, _| {
        let i = tilted(program);
        let stroke = program.strokes[program.blocks[i].strokes.start];
        let p = &mut program.points[stroke.first as usize];
        *p = FieldPoint::new(p.x + 1000, p.y + 700);
    });
    found("source", &proof);
    // The focal plane too high, the stage with it.
    let proof = Bench::tilted("").mutant(|program, plan| {
        let i = tilted(program);
        let block = &mut program.blocks[i];
        block.stop.lpfl += Nm(60_000);
        let c = block.stop.centre;
        block.stage = plan.machine.stage_from_part(c, block.stop.lpfl, plan.checked.origin());
    });
    found("depth", &proof);
    // Beyond the travel of the table, and between its increments.
    for by in [360_000_000, 1] {
        let proof = Bench::tilted("").mutant(|program, _| {
            let i = tilted(program);
            program.blocks[i].stop.tilt[1] = (program.blocks[i].stop.tilt[1] + by).min(359_999_900);
        });
        found("travel", &proof);
    }
    // A mark left out.
    let proof = Bench::tilted("").mutant(|program, _| {
        let i = tilted(program);
        let longest = |&s: &usize| (program.strokes[s].len, s);
        let s = program.blocks[i].strokes.clone().max_by_key(longest).expect("a stroke");
        program.strokes.remove(s);
        for (k, b) in program.blocks.iter_mut().enumerate().skip(i) {
            b.strokes = b.strokes.start - usize::from(k > i)..b.strokes.end - 1;
        }
    });
    found("coverage", &proof);
    // The commands of a tilt axis in the stage program, and in the OVF's place in the manifest.
    let proof = sound.damaged("stage.ngc", |bytes| {
        let text = String::from_utf8(bytes.clone()).expect("ASCII");
        let at = text.find(" A-").or_else(|| text.find(" A")).expect("a tilt");
        bytes.splice(at + 2..at + 2, *b"1").for_each(drop);
    });
    assert!(!proof.ok, "{}", proof.to_text());
}

#[test]
#[ignore = "slow: make test-all"]
fn tilted_blocks_in_passes_with_dose_verify() {
    let more = "passes = { count = 2, lower = \"8 um\", rotate = \"30 deg\" }\n            \
        dose = { compensate = \"speed\", step = 0.001 }";
    let proof = verified(&Bench::tilted(more).write());
    assert!(proof.ok, "{}", proof.to_text());
}
