//! Bitmaps as areas, lines, dashes and dots on the wavy sheet: damaged marks.

use super::super::made::bmp;
use super::super::{assert_only, broken};
use super::{Bench, double, remove, verified};
use terrace_core::math;
use terrace_core::program::{PenId, Program};

/// Beside the hatch of the sheet a bitmap, marked with a pen of its own.
fn bench(keys: &str) -> Bench {
    let picture = bmp([60, 40], |i, j| if (20..30).contains(&i) && j > 20 { 255 } else { (i * 4 + j / 4) as u8 });
    let texture = format!(
        "file = \"grey.bmp\"\nsize = [\"9 mm\", \"6 mm\"]\norigin = [\"21 mm\", \"14 mm\"]\npen = \"c\"\n{keys}\n"
    );
    let pen =
        "[[pen]]\nname = \"c\"\nspeed = \"300 mm/s\"\npower = \"7 W\"\nfrequency = \"40 kHz\"\ndwell = \"1 ms\"\n";
    Bench::edited_beside(1.0, &[("grey.bmp", picture)], |text| {
        let start = text.find("pattern = \"squares\"").expect("squares");
        let end = start + text[start..].find("[[pen]]").expect("pens");
        format!("{}{texture}\n{}{pen}", &text[..start], &text[end..])
    })
}

const LINES: [&str; 4] = [
    "pitch = \"0.05 mm\"",
    "pitch = \"0.05 mm\"\nscreen = \"lines\"\ndirection = \"30 deg\"",
    "screen = \"dashes\"\nmirror = \"x\"",
    "pitch = \"0.05 mm\"\ncontour = \"after\"\nturn = \"20 deg\"",
];

const DOTS: [&str; 3] =
    ["screen = \"halftone\"", "screen = \"diffusion\"\ndirection = \"20 deg\"", "screen = \"noise\"\ninvert = true"];

/// A mark of the bitmap, whole and in a block with many.
fn mark(program: &Program) -> usize {
    let pen = program.pens.iter().position(|p| p.name == "c").expect("the pen") as u16;
    let pieces = |source| program.strokes.iter().filter(|s| s.source == source).count();
    let length = |i: usize| {
        let s = program.strokes[i];
        let of = |k: u32| program.points[(s.first + k) as usize];
        let (a, b) = (of(0), of(s.len - 1));
        math::hypot(f64::from(b.x - a.x), f64::from(b.y - a.y))
    };
    let all = program.blocks.iter().filter(|b| b.strokes.len() > 5).flat_map(|b| b.strokes.clone());
    let is_one = |&i: &usize| {
        let s = program.strokes[i];
        s.pen == PenId(pen) && (s.is_dot() || s.len == 2 && length(i) > 100_000.0)
    };
    all.filter(is_one).find(|&i| pieces(program.strokes[i].source) == 1).expect("a mark of the bitmap")
}

#[test]
#[ignore = "slow: make test-all"]
fn bitmaps_verify() {
    for keys in LINES.into_iter().chain(DOTS) {
        let proof = verified(&bench(keys).write());
        assert!(proof.ok, "{keys}: {}", proof.to_text());
        assert!(proof.rule("bitmap").is_some_and(|r| r.checked > 100 && r.left_out.is_empty()), "{}", proof.to_text());
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn lines_of_a_screen_that_are_moved_missing_or_doubled_are_reported() {
    for keys in LINES {
        // A mark that is not what it claims to be covers nothing either.
        let proof = bench(keys).mutant(|program, _| {
            let end = program.strokes[mark(program)].first as usize;
            program.points[end].x += 60_000;
            program.points[end].y += 60_000;
        });
        assert_eq!(broken(&proof), ["source", "coverage"], "{keys}: {}", proof.to_text());
        assert_only("coverage", &bench(keys).mutant(|program, _| remove(program, mark(program))));
        assert_only("once", &bench(keys).mutant(|program, _| double(program, mark(program))));
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn dots_of_a_screen_that_are_moved_missing_or_doubled_are_reported() {
    for keys in DOTS {
        let proof = bench(keys).mutant(|program, _| {
            let first = program.strokes[mark(program)].first as usize;
            program.points[first].x += 2;
        });
        assert_only("source", &proof);
        let mut missing = bench(keys);
        missing.plan.summary.dots.marked -= 1;
        missing.plan.summary.dots.off_part += 1;
        let proof = missing.mutant(|program, _| {
            let i = mark(program);
            program.points.remove(program.strokes[i].first as usize);
            remove(program, i);
            program.strokes[i..].iter_mut().for_each(|s| s.first -= 1);
        });
        assert_only("coverage", &proof);
        let mut twice = bench(keys);
        twice.plan.summary.dots.marked += 1;
        let proof = twice.mutant(|program, _| {
            let i = mark(program);
            let first = program.strokes[i].first as usize;
            program.points.insert(first, program.points[first]);
            double(program, i);
            program.strokes[i + 1..].iter_mut().for_each(|s| s.first += 1);
        });
        assert_only("once", &proof);
    }
}
