use super::*;
use crate::projection::tests::{MM, slope};
use terrace_core::geom::{NM_PER_MM, Nm};
use terrace_core::machine::TiltAngles;
use terrace_core::program::{SectionId, Stop};

/// A stop that admits all heights of the slope.
fn stop(x: i64) -> Stop {
    Stop {
        section: SectionId([0; 2]),
        level: 0,
        tilt: TiltAngles::default(),
        centre: P2::new(x, 4 * MM),
        lpfl: Nm(0),
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
            let mut splitter =
                Splitter::new(Tracer::new(&surface, 1.0), &[&stops], Least::default(), Keep(Nm(0)), seam);
            splitter.stroke(StrokeId(0), PenId(0), 1, &points);
            let [cut] = splitter.finish().collect::<Vec<_>>().try_into().expect("one candidate");
            assert_eq!(cut.list.len(), 2, "{points:?}");
            assert!(cut.points.iter().all(|p| p.x.abs() <= 2_000_000), "{:?}", cut.points);
            assert!((cut.mark_mm - a.distance(b) / NM_PER_MM).abs() < 1e-9);
        }
    }
}

/// What becomes of lines along x between these ends, um, where a third stop holds 4 um between the windows of two
/// others: lengths of the marks, and how much is skipped, um.
fn cut(ends: [i64; 2], least: Least) -> (Vec<f64>, f64) {
    let surface = slope();
    // The slope is a tenth: the stop in the middle admits what lies beyond 4.9 mm, up to its window's end at 5.004 mm.
    let middle = Stop { z_lo: Nm(490_000), z_hi: Nm(490_000 + MM), ..stop(3_004_000) };
    let stops = Stops::new(vec![stop(3 * MM), middle, stop(7_004_000)], [Nm(4 * MM); 2], Nm(MM));
    let mut splitter = Splitter::new(Tracer::new(&surface, 1.0), &[&stops], least, Keep(Nm(0)), Seam::default());
    splitter.stroke(StrokeId(0), PenId(0), 2, &ends.map(|um| P2::new(um * 1000, 3 * MM)));
    let [cut] = splitter.finish().collect::<Vec<_>>().try_into().expect("one candidate");
    assert!((cut.mark_mm + cut.skipped.small - cut.texture_mm).abs() < 1e-9, "{cut:?}");
    assert_eq!(cut.slivers.is_empty(), cut.skipped.small == 0.0);
    assert_eq!(cut.points.len(), cut.list.iter().map(|f| f.len as usize).sum::<usize>());
    let points = |f: &Fragment| &cut.points[f.first as usize..][..f.len as usize];
    let length = |f: &Fragment| (f64::from(points(f)[1].x) - f64::from(points(f)[0].x)) / 1000.0;
    (cut.list.iter().map(length).collect(), (cut.skipped.small * 500.0).round())
}

#[test]
fn slivers_next_to_a_mark_are_left_out_and_no_stroke_vanishes() {
    let none = Least::default();
    let slivers = Least { sliver: 10_000.0, mark: 0.0 };
    assert_eq!(cut([2_000, 8_000], none), (vec![3_000.0, 4.0, 2_996.0], 0.0));
    assert_eq!(cut([2_000, 8_000], slivers), (vec![3_000.0, 2_996.0], 4.0));
    // A sliver before its mark, after it, and one that is not short enough.
    assert_eq!(cut([4_998, 8_000], slivers), (vec![2_996.0], 6.0));
    assert_eq!(cut([2_000, 5_002], slivers), (vec![3_000.0], 2.0));
    assert_eq!(cut([2_000, 8_000], Least { sliver: 4_000.0, mark: 0.0 }).0.len(), 3);
    // Strokes drawn that short stay, of a stroke of two slivers one.
    assert_eq!(cut([4_998, 5_002], slivers), (vec![4.0], 0.0));
    assert_eq!(cut([4_998, 5_008], slivers), (vec![6.0], 4.0));
    assert_eq!(cut([4_998, 5_008], Least { mark: 10_000.0, sliver: 0.0 }), (vec![], 10.0));
}
