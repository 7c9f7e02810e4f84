//! A measurement at the size of a real job; run it with `--ignored --nocapture`.

use std::time::Instant;

use serde_json::json;

use super::made::{MM, Made, MadeBlock, Mark};
use crate::geom::{Nm, P2};
use crate::machine::{Origin, TiltAngles};
use crate::program::{PenId, SectionId, Stop, StrokeId};

/// Pieces of this length, nm: about 690,000 on the whole part.
const PIECE: i64 = 2_930_000;

/// A dome of 2 M facets over 450 x 450 mm, hatched at 0.1 mm, in 144 blocks.
fn dome() -> Made {
    let mut made = Made::new();
    let cells = 1000;
    let at = |i: usize, j: usize| {
        let (x, y) = (0.45 * i as f64, 0.45 * j as f64);
        [x, y, 40.0 - ((x - 225.0).powi(2) + (y - 225.0).powi(2)) / 2531.25]
    };
    let quads = (0..cells).flat_map(|i| (0..cells).map(move |j| (i, j)));
    made.facets = quads
        .flat_map(|(i, j)| [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]])
        .collect();
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
        focus: Nm(0),
        z_lo: Nm(-45 * MM),
        z_hi: Nm(45 * MM),
    };
    MadeBlock { pass: 0, stop, z: [Nm(-41 * MM), Nm(41 * MM)], retract: false, marks: marks.collect() }
}

#[test]
#[ignore = "slow, a measurement: make test-all"]
fn job_of_two_million_facets_verifies_in_seconds() {
    let made = dome();
    let dir = tempfile::tempdir().expect("folder");
    let folder = dir.path().join("made.job");
    made.write(&folder);
    let start = Instant::now();
    let proof = made.verify(&folder);
    let seconds = start.elapsed().as_secs_f64();
    eprintln!("{}verified in {seconds:.2} s, facets in memory", proof.to_text());
    assert!(proof.ok);
    assert!(seconds < 10.0);
}
