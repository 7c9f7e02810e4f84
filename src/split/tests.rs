use super::*;
use crate::geom::{NM_PER_MM, Nm};
use crate::machine::TiltAngles;
use crate::program::{SectionId, Stop};
use crate::projection::tests::{MM, slope};

/// A stop that admits all heights of the slope.
fn stop(x: i64) -> Stop {
    Stop {
        section: SectionId([0; 2]),
        level: 0,
        tilt: TiltAngles::default(),
        centre: P2::new(x, 4 * MM),
        focus: Nm(0),
        z_lo: Nm(0),
        z_hi: Nm(MM),
    }
}

#[test]
fn a_gap_of_rounding_between_two_windows_is_marked_within_them() {
    let surface = slope();
    // Windows of 4 mm: the first ends at 5 mm, the second begins a nanometre later.
    let stops = Stops::new(vec![stop(3 * MM), stop(7 * MM + 1)], [Nm(4 * MM); 2], Nm(MM));
    for slant in [0, 1, 2, 3] {
        let [a, b] = [P2::new(2 * MM, 3 * MM), P2::new(8 * MM, 3 * MM + slant * MM / 2)];
        for points in [[a, b], [b, a]] {
            let seam = Seam::default();
            let mut splitter = Splitter::new(Tracer::new(&surface, 1.0), &[&stops], 0.0, Keep(Nm(0)), seam);
            splitter.stroke(StrokeId(0), PenId(0), 1, &points);
            let [cut] = splitter.finish().collect::<Vec<_>>().try_into().expect("one candidate");
            assert_eq!(cut.list.len(), 2, "{points:?}");
            assert!(cut.points.iter().all(|p| p.x.abs() <= 2_000_000), "{:?}", cut.points);
            assert!((cut.mark_mm - a.distance(b) / NM_PER_MM).abs() < 1e-9);
        }
    }
}
