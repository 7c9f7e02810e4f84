//! A job of the size of a real one.

use serde_json::json;

use super::made::{MM, Made, MadeBlock, Mark};
use terrace_core::geom::{Nm, P2};
use terrace_core::machine::{Origin, TiltAngles};
use terrace_core::program::{PenId, SectionId, Stop, StrokeId};

/// Pieces of this length, nm: about 690,000 on the whole part.
const PIECE: i64 = 2_930_000;

/// Side of a cell of the dome, mm.
const CELL: f64 = 0.45;

/// A corner of the cells, mm.
fn at(i: usize, j: usize) -> [f64; 3] {
    let (x, y) = (CELL * i as f64, CELL * j as f64);
    [x, y, 40.0 - ((x - 225.0).powi(2) + (y - 225.0).powi(2)) / 2531.25]
}

/// A dome of 2 M facets over 450 x 450 mm, hatched at 0.1 mm, in 144 blocks.
fn dome() -> Made {
    let mut made = Made::new();
    let cells = 1000;
    let quads = (0..cells).flat_map(|i| (0..cells).map(move |j| (i, j)));
    made.facets = quads
        .flat_map(|(i, j)| [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]])
        .collect();
    made.cosines = cosines;
    (made.strokes_cut, made.figures_whole) = (4500, 0);
    (made.facts.pdof, made.facts.depth_range) = (Nm(90_000_000), Nm(90_000_000));
    made.origin = Origin([-225 * MM, -225 * MM, 0]);
    made.strokes = (0..4500)
        .map(|i| 50_000 + 100_000 * i)
        .map(|y| (PenId(0), vec![P2::new(0, y), P2::new(450 * MM, y)]))
        .collect();
    made.blocks = (0..144).map(|k| block(k % 12, k / 12)).collect();
    for m in made.blocks.iter_mut().flat_map(|b| &mut b.marks) {
        m.source = StrokeId((m.points[0].y / 100_000) as u32);
    }
    made.renew();
    made.summary["skipped_off_part_mm"] = 0.0.into();
    made.summary["skipped_steep_mm"] = 0.0.into();
    // The lines next to the top lie 0.05 mm next to it, on facets that fall by the sag of a cell of 0.45 mm.
    made.summary["worst_defocus_um"] = json!(40_000.0 - 1e3 * 0.45 * 0.45 / 2531.25 / 9.0);
    made
}

fn block(column: u32, row: u32) -> MadeBlock {
    let lo = |c: u32| i64::from(c) * 40 * MM;
    let (x0, x1) = (lo(column), (lo(column) + 40 * MM).min(450 * MM));
    let rows = (lo(row)..(lo(row) + 40 * MM).min(450 * MM)).step_by(100_000);
    let marks = rows.flat_map(|y| {
        let y = y + 50_000;
        (x0..x1).step_by(PIECE as usize).map(move |x| Mark {
            source: StrokeId(0),
            segment: 0,
            reversed: false,
            pen: PenId(0),
            points: vec![P2::new(x, y), P2::new((x + PIECE).min(x1), y)],
        })
    });
    let stop = Stop {
        section: SectionId([column, row]),
        level: 0,
        tilt: TiltAngles::UPRIGHT,
        centre: P2::new(lo(column) + 20 * MM, lo(row) + 20 * MM),
        lpfl: Nm(0),
        z_lo: Nm(-45 * MM),
        z_hi: Nm(45 * MM),
    };
    MadeBlock { pass: 0, stop, z: [Nm(-41 * MM), Nm(41 * MM)], retract: false, marks: marks.collect() }
}

/// Mean and least cosine of the incidence under marks along x, cell by cell: both facets of a cell lie under a line.
fn cosines(block: &MadeBlock) -> [f64; 2] {
    let (mut sum, mut length, mut least) = (0.0, 0.0, f64::INFINITY);
    for [a, b] in block.marks.iter().map(|m| [m.points[0].mm(), m.points[1].mm()]) {
        let j = (a[1] / CELL) as usize;
        let up = a[1] / CELL - j as f64;
        for i in (a[0] / CELL) as usize..=(b[0] / CELL) as usize {
            let [h00, h10, h01, h11] =
                [at(i, j), at(i + 1, j), at(i, j + 1), at(i + 1, j + 1)].map(|corner| corner[2] / CELL);
            // The upper facet lies on the left of the cell's diagonal, the lower one on its right.
            let x = CELL * i as f64;
            let facets =
                [([x, x + CELL * up], [h11 - h01, h01 - h00]), ([x + CELL * up, x + CELL], [h10 - h00, h11 - h10])];
            for ([from, to], [dx, dy]) in facets {
                let under = to.min(b[0]) - from.max(a[0]);
                if under > 1e-9 {
                    let cos = 1.0 / (1.0 + dx * dx + dy * dy).sqrt();
                    (sum, length, least) = (sum + under * cos, length + under, cos.min(least));
                }
            }
        }
    }
    [sum / length, least]
}

#[test]
#[ignore = "slow: make test-all"]
fn job_of_two_million_facets_verifies() {
    let made = dome();
    let dir = tempfile::tempdir().expect("folder");
    let folder = dir.path().join("made.job");
    made.write(&folder);
    let proof = made.verify(&folder);
    assert!(proof.ok, "{}", proof.to_text());
}
