//! A small program that the tests of its writers and readers share.

use super::{Block, Pen, Program, Stop, Stroke};
use crate::geom::P2;
use crate::machine::Machine;
use crate::units::{Frequency, Power, Speed, Watts};

/// A job of `blocks` blocks on `machine` with random strokes, for readers that are to see many shapes:
/// hatches, open and closed polylines, two pens, stage targets on the grid of 100 nm, retracts.
pub fn random(blocks: usize, machine: &Machine) -> (Program, [i64; 3]) {
    let (mut program, origin) = program();
    program.blocks.clear();
    program.strokes.clear();
    program.points.clear();
    // Knuth's MMIX generator: the same program on every run.
    let mut state = 7u64;
    let mut random = |below: u64| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) % below
    };
    for i in 0..blocks {
        let start = program.strokes.len();
        for source in 0..1 + random(12) {
            let len = if random(2) == 0 { 2 } else { 2 + random(9) as u32 };
            let first = program.points.len() as u32;
            for _ in 0..len {
                program.points.push([(); 2].map(|()| random(40_000_001) as i32 - 20_000_000));
            }
            if random(3) == 0 {
                let last = program.points.len() - 1;
                program.points[last] = program.points[first as usize];
            }
            if len == 2 && program.points[first as usize] == program.points[first as usize + 1] {
                program.points[first as usize][0] /= 2;
            }
            let (pen, source) = (random(2) as u16, source as u32);
            program.strokes.push(Stroke {
                source,
                segment: random(9) as u32,
                reversed: random(2) == 1,
                pen,
                first,
                len,
            });
        }
        let column = (i / 4) as u32;
        let focus = 100 * (random(200_000) as i64 - 100_000);
        let centre = P2::new(i64::from(column) * 7_654_300 - 150_000_000, 1_234_500);
        program.blocks.push(Block {
            stop: Stop { section: [column, 0], level: (i % 4) as i32, centre, focus, z_lo: focus - 9, z_hi: focus + 9 },
            stage: machine.stage_from_part([centre.x, centre.y, focus], origin),
            retract: random(8) == 0,
            z_lo: focus - 8,
            z_hi: focus + 7,
            strokes: start..program.strokes.len(),
        });
    }
    (program, origin)
}

/// Three blocks on `xyz-galvo-40` with two pens: hatches, an open polyline, a closed loop; negative
/// coordinates, a retract and a move of z alone. Second value: the origin of the part.
pub fn program() -> (Program, [i64; 3]) {
    let machine = Machine::built_in("xyz-galvo-40").expect("profile");
    let origin = [1_000_000, -2_000_000, 300_000];
    let mut program = Program {
        pens: vec![
            Pen {
                name: "fill".into(),
                speed: Speed::mm_s(1000.0),
                power: Power::Percent(60.0),
                frequency: Frequency::khz(60.0),
                passes: 1,
            },
            Pen {
                name: "edge (fine)".into(),
                speed: Speed::mm_s(400.0),
                power: Power::Absolute(Watts::w(3.5)),
                frequency: Frequency::khz(80.0),
                passes: 3,
            },
        ],
        ..Program::default()
    };
    let hatch = |y: i32| vec![[-5_000_000, y], [5_000_001, y]];
    let zigzag = vec![[0, 0], [1_250_000, -7], [2_000_000, 999_999]];
    let square = vec![[-1, -1], [19_999_999, -1], [19_999_999, 20_000_000], [-1, 20_000_000], [-1, -1]];
    let blocks = [
        ([0, 0], 0, [0, 0, 35_000], false, vec![(0, 3, 7, true, hatch(1)), (0, 3, 9, false, hatch(-500_000))]),
        ([0, 0], 1, [0, 0, 105_000], false, vec![(1, 4, 0, false, zigzag)]),
        ([1, 0], 1, [40_000_000, 0, 105_000], true, vec![(1, 5, 0, false, square), (0, 6, 2, false, hatch(0))]),
    ];
    for (section, level, at, retract, strokes) in blocks {
        let start = program.strokes.len();
        for (pen, source, segment, reversed, points) in strokes {
            let first = program.points.len() as u32;
            program.strokes.push(Stroke { source, segment, reversed, pen, first, len: points.len() as u32 });
            program.points.extend(points);
        }
        let [x, y, focus] = at;
        let (z_lo, z_hi) = (focus - 35_000, focus + 35_000);
        program.blocks.push(Block {
            stop: Stop { section, level, centre: P2::new(x, y), focus, z_lo, z_hi },
            stage: machine.stage_from_part(at, origin),
            retract,
            z_lo: z_lo + 100,
            z_hi,
            strokes: start..program.strokes.len(),
        });
    }
    (program, origin)
}
