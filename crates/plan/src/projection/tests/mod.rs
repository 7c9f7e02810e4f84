//! Pieces tile what they are cut from.

mod along_edges;

use super::*;

/// Two facets that rise along x, a tenth of it, over 9 x 9 mm.
pub fn slope() -> Surface {
    let facets =
        [[[0.0, 0.0, 0.0], [9.0, 0.0, 0.9], [9.0, 9.0, 0.9]], [[0.0, 0.0, 0.0], [9.0, 9.0, 0.9], [0.0, 9.0, 0.0]]];
    Surface::from_facets(facets, &mut Vec::new()).expect("two facets")
}

pub const MM: i64 = 1_000_000;
pub const LINES: [((i64, i64), (i64, i64)); 5] =
    [((0, 0), (8, 8)), ((9, 1), (0, 7)), ((2, 8), (2, 0)), ((8, 4), (1, 4)), ((-1, 3), (10, 3))];

pub fn ends((a, b): ((i64, i64), (i64, i64))) -> (P2, P2) {
    (P2::new(a.0 * MM, a.1 * MM), P2::new(b.0 * MM, b.1 * MM))
}

#[test]
fn pieces_tile_the_segment() {
    let surface = slope();
    let mut tracer = Tracer::new(&surface, 1.0);
    for (a, b) in LINES.map(ends) {
        let mut t = 0.0;
        tracer.segment(a, b, |p| {
            assert_eq!(p.t0, t);
            assert!(p.t1 > p.t0);
            t = p.t1;
            let mid = a.lerp(b, (p.t0 + p.t1) / 2.0);
            match p.skip {
                None => assert!((p.z0 - 0.1 * a.lerp(b, p.t0).x as f64).abs() < 2.0),
                Some(skip) => assert!(skip == Skip::OffPart && (mid.x < 0 || mid.x > 9 * MM)),
            }
        });
        assert_eq!(t, 1.0);
    }
}

#[test]
fn gridded_pieces_tile_what_is_marked_and_lie_in_their_cells() {
    let surface = slope();
    let grid = Sections { origin: P2::new(0, 0), pitch: [Nm(2 * MM); 2], count: [5, 5] };
    let mut tracer = GridTracer::new(Tracer::new(&surface, 1.0), &grid);
    for (a, b) in LINES.map(ends) {
        let mut length = 0.0;
        tracer.segment(a, b, |p, cell| {
            length += p.t1 - p.t0;
            let mid = a.lerp(b, (p.t0 + p.t1) / 2.0);
            assert_eq!(cell, [grid.along(0, mid.x, 0), grid.along(1, mid.y, 0)], "{a:?} {b:?} {p:?}");
            assert!((p.z0 - 0.1 * a.lerp(b, p.t0).x as f64).abs() < 2.0);
        });
        let want = if a.x < 0 { 9.0 / 11.0 } else { 1.0 };
        assert!((length - want).abs() < 1e-9, "{a:?} {b:?}: {length}");
    }
}
