//! Mutants of jobs with dots.

use super::*;
use terrace_core::units::Time;

/// Dots and squares on the wavy sheet, with a pen for dots.
fn bench(tables: &str) -> Bench {
    Bench::edited(1.0, |text| {
        let text = text.replacen("pattern = \"hatch\"", "pattern = \"dots\"\n            pen = \"dot\"", 1);
        let text = text.replacen("direction = \"contour\"", "jitter = \"80 %\"", 1);
        let pen = "[[pen]]\n            name = \"dot\"\n            speed = \"500 mm/s\"\n            power = \"8 W\"\n            \
                   frequency = \"40 kHz\"\n            pulses = 8\n            passes = 2\n            [[pen]]";
        let text = text.replacen("[[pen]]", pen, 1);
        let text = text.replacen("machine =", &format!("{tables}\n            machine ="), 1);
        text.replacen(
            "pattern = \"squares\"",
            "pattern = \"squares\"\n            area = [\"-3 mm\", \"-3 mm\", \"62 mm\", \"44 mm\"]",
            1,
        )
    })
}

/// A dot in a block with many strokes.
fn dot(program: &Program) -> usize {
    let block = program.blocks.iter().find(|b| b.strokes.len() > 5).expect("a block with many strokes");
    block.strokes.clone().find(|&i| program.strokes[i].is_dot()).expect("a dot")
}

#[test]
fn job_with_dots_verifies() {
    for tables in ["", "dose = { compensate = \"speed\", step = 0.002 }"] {
        let bench = bench(tables);
        let dots = bench.plan.summary.dots;
        assert!(dots.marked > 2000 && dots.off_part > 100, "{dots:?}");
        let proof = verified(&bench.write());
        assert!(proof.ok, "{}", proof.to_text());
    }
}

#[test]
fn dot_that_is_moved_is_reported_by_source() {
    let proof = bench("").mutant(|program, _| {
        let first = program.strokes[dot(program)].first as usize;
        program.points[first].x += 2;
    });
    assert_only("source", &proof);
}

#[test]
fn dot_that_is_left_out_is_reported_by_coverage() {
    let mut bench = bench("");
    bench.plan.summary.dots.marked -= 1;
    bench.plan.summary.dots.off_part += 1;
    let proof = bench.mutant(|program, _| {
        let i = dot(program);
        program.points.remove(program.strokes[i].first as usize);
        remove(program, i);
        program.strokes[i..].iter_mut().for_each(|s| s.first -= 1);
    });
    assert_only("coverage", &proof);
}

#[test]
fn dot_that_is_marked_twice_is_reported_by_once() {
    let mut bench = bench("");
    bench.plan.summary.dots.marked += 1;
    let proof = bench.mutant(|program, _| {
        let i = dot(program);
        // Each dot has a point of its own.
        let first = program.strokes[i].first as usize;
        program.points.insert(first, program.points[first]);
        double(program, i);
        program.strokes[i + 1..].iter_mut().for_each(|s| s.first += 1);
    });
    assert_only("once", &proof);
}

#[test]
fn dot_with_another_pen_is_reported_by_source() {
    let proof = bench("").mutant(|program, _| {
        let i = dot(program);
        program.pens[1].dwell = program.pens[0].dwell;
        program.strokes[i].pen = PenId(1);
    });
    assert!(!proof.ok);
    let broken: Vec<&str> = proof.rules.iter().filter(|r| r.violated > 0).map(|r| r.code).collect();
    // The pen that has a dwell now is not the job's.
    assert_eq!(broken, ["agreement", "source"]);
}

#[test]
fn dwell_that_is_not_the_jobs_is_reported_by_agreement() {
    let proof = bench("").mutant(|program, _| program.pens[0].dwell = Some(Time::us(201.0)));
    assert_only("agreement", &proof);
}

#[test]
fn dot_beyond_the_depth_of_its_block_is_reported_by_depth() {
    let proof = bench("").mutant(|program, plan| {
        let i = program.blocks.iter().position(|b| b.strokes.len() > 5).expect("a block");
        let block = &mut program.blocks[i];
        let by = plan.machine.increment_nm() * 600;
        (block.stop.lpfl, block.stop.z_lo, block.stop.z_hi) =
            (block.stop.lpfl + by, block.stop.z_lo + by, block.stop.z_hi + by);
        (block.z_lo, block.z_hi) = (block.z_lo + by, block.z_hi + by);
        place(block, plan);
    });
    assert_only("depth", &proof);
}

#[test]
fn run_sheet_with_another_dwell_is_reported_by_agreement() {
    let proof = bench("").damaged("runsheet.txt", |b| replace(b, "PENS", "dwell 200 us", "dwell 210 us"));
    assert_only("agreement", &proof);
}
