//! A small program that the tests of its writers and readers share.

use super::{Block, PassId, Pen, PenId, Program, SectionId, SetupId, Stop, Stroke, StrokeId};
use crate::geom::{FieldPoint, Nm, P2};
use crate::machine::{Machine, Origin, TiltAngles};
use crate::units::{Frequency, Power, Speed, Watts};

/// Three blocks on `xyz-galvo-40` with two pens: hatches, an open polyline, a closed loop; negative
/// coordinates, a retract and a move of z alone. Second value: the origin of the part.
pub fn program() -> (Program, Origin) {
    let machine = Machine::built_in("xyz-galvo-40").expect("profile");
    let origin = Origin([1_000_000, -2_000_000, 300_000]);
    let mut program = Program {
        pens: vec![
            Pen {
                name: "fill".into(),
                speed: Speed::mm_s(1000.0),
                power: Power::Percent(60.0),
                frequency: Frequency::khz(60.0),
                passes: 1,
                dwell: None,
            },
            Pen {
                name: "edge (fine)".into(),
                speed: Speed::mm_s(400.0),
                power: Power::Absolute(Watts::w(3.5)),
                frequency: Frequency::khz(80.0),
                passes: 3,
                dwell: None,
            },
        ],
        ..Program::default()
    };
    let points = |list: &[[i32; 2]]| list.iter().map(|&p| FieldPoint::from(p)).collect::<Vec<_>>();
    let hatch = |y: i32| points(&[[-5_000_000, y], [5_000_001, y]]);
    let zigzag = points(&[[0, 0], [1_250_000, -7], [2_000_000, 999_999]]);
    let square = points(&[[-1, -1], [19_999_999, -1], [19_999_999, 20_000_000], [-1, 20_000_000], [-1, -1]]);
    let blocks = [
        ([0, 0], 0, [0, 0, 35_000], false, vec![(0, 3, 7, true, hatch(1)), (0, 3, 9, false, hatch(-500_000))]),
        ([0, 0], 1, [0, 0, 105_000], false, vec![(1, 4, 0, false, zigzag)]),
        ([1, 0], 1, [40_000_000, 0, 105_000], true, vec![(1, 5, 0, false, square), (0, 6, 2, false, hatch(0))]),
    ];
    for (section, level, at, retract, strokes) in blocks {
        let start = program.strokes.len();
        for (pen, source, segment, reversed, points) in strokes {
            let first = program.points.len() as u32;
            let (source, pen) = (StrokeId(source), PenId(pen));
            program.strokes.push(Stroke { source, segment, reversed, pen, first, len: points.len() as u32 });
            program.points.extend(points);
        }
        let [x, y, lpfl] = at;
        let lpfl = Nm(lpfl);
        let (z_lo, z_hi) = (lpfl - Nm(35_000), lpfl + Nm(35_000));
        program.blocks.push(Block {
            pass: PassId(0),
            setup: SetupId(0),
            stop: Stop {
                section: SectionId(section),
                level,
                tilt: TiltAngles::UPRIGHT,
                centre: P2::new(x, y),
                lpfl,
                z_lo,
                z_hi,
            },
            stage: machine.stage_from_part(P2::new(x, y), lpfl, origin),
            focus_shift: Nm(0),
            retract,
            z_lo: z_lo + Nm(100),
            z_hi,
            strokes: start..program.strokes.len(),
        });
    }
    (program, origin)
}
