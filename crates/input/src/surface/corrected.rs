//! Facets of a part whose heights are corrected.
//!
//! A correction is linear on the triangles of its grid, so a facet is cut along their borders and each piece raised by
//! what its corners get. A cut of an edge depends on the edge alone, not on the facet, so what met before meets after.

use terrace_core::geom::{Correction, Grid, SpacePoint};

/// A corner so near to a line of the grid, nm, lies on it: slivers would be thinner than corners are round.
const ON_LINE_NM: f64 = 50.0;

/// Hands the pieces of a facet, raised by what the correction has there, to `sink`; corners are nm.
pub(super) fn each_piece(facet: [SpacePoint; 3], correction: &Correction, sink: &mut dyn FnMut([SpacePoint; 3])) {
    let grid = correction.grid();
    let mut pieces = vec![facet.to_vec()];
    let [columns, rows] = grid.count.map(f64::from);
    // Those along y, those along x, and the diagonals; beyond the grid there are none.
    let families = [([1.0, 0.0], [0.0, columns]), ([0.0, 1.0], [0.0, rows]), ([1.0, -1.0], [-rows, columns])];
    for (family, range) in families {
        let lines = Lines { grid, family, range };
        if pieces.iter().any(|piece| lines.first(piece).is_some()) {
            pieces = pieces.into_iter().flat_map(|piece| lines.cut(piece)).collect();
        }
    }
    for piece in pieces {
        let raised = |[x, y, z]: SpacePoint| [x, y, z + correction.height([x, y])];
        for k in 1..piece.len().saturating_sub(1) {
            sink([piece[0], piece[k], piece[k + 1]].map(raised));
        }
    }
}

/// Lines of one direction, numbered by whole numbers.
struct Lines<'a> {
    grid: &'a Grid,
    family: [f64; 2],
    /// The first and the last.
    range: [f64; 2],
}

impl Lines<'_> {
    /// The number of the line on which a point would lie, with its part.
    fn number(&self, [x, y, _]: SpacePoint) -> f64 {
        let [u, v] = Correction::cells([x, y], self.grid);
        self.family[0] * u + self.family[1] * v
    }

    /// How far from a whole number a point on that line may be.
    fn slack(&self) -> f64 {
        ON_LINE_NM / self.grid.pitch[0].f64()
    }

    /// The first line that parts a convex piece.
    fn first(&self, piece: &[SpacePoint]) -> Option<f64> {
        let numbers = piece.iter().map(|&p| self.number(p));
        let [lo, hi] = numbers.fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], n| [lo.min(n), hi.max(n)]);
        let line = ((lo + self.slack()).floor() + 1.0).max(self.range[0]);
        (line < hi - self.slack() && line <= self.range[1]).then_some(line)
    }

    /// A convex piece, cut along all lines that part it.
    fn cut(&self, mut piece: Vec<SpacePoint>) -> Vec<Vec<SpacePoint>> {
        let mut out = Vec::new();
        while let Some(line) = self.first(&piece) {
            let (below, above) = self.parted(&piece, line);
            out.push(below);
            piece = above;
        }
        out.push(piece);
        out
    }

    /// What of a convex piece lies below a line, and above it.
    fn parted(&self, piece: &[SpacePoint], line: f64) -> (Vec<SpacePoint>, Vec<SpacePoint>) {
        let (mut below, mut above) = (Vec::new(), Vec::new());
        let slack = self.slack();
        for (i, &p) in piece.iter().enumerate() {
            let q = piece[(i + 1) % piece.len()];
            let [off, next] = [p, q].map(|p| self.number(p) - line);
            if off <= slack {
                below.push(p);
            }
            if off >= -slack {
                above.push(p);
            }
            if off.min(next) < -slack && off.max(next) > slack {
                let on = self.crossing(p, q, line);
                below.push(on);
                above.push(on);
            }
        }
        (below, above)
    }

    /// Where an edge crosses a line: the same point from either end.
    fn crossing(&self, p: SpacePoint, q: SpacePoint, line: f64) -> SpacePoint {
        let is_ordered = p.iter().zip(&q).map(|(a, b)| a.total_cmp(b)).find(|o| o.is_ne()).is_none_or(|o| o.is_lt());
        let [a, b] = if is_ordered { [p, q] } else { [q, p] };
        let [from, to] = [a, b].map(|p| self.number(p));
        let t = (line - from) / (to - from);
        [0, 1, 2].map(|k| a[k] + (b[k] - a[k]) * t)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrace_core::geom::{Nm, P2};
    use terrace_core::random::Random;

    #[test]
    fn pieces_fill_the_facet_and_lie_on_the_correction() {
        let grid = Grid { origin: P2::new(0, 0), pitch: [Nm(3_000_000), Nm(3_000_000)], count: [20, 20] };
        let correction = Correction::new(grid, |[x, y]| {
            [(x * 1e-6).powi(2) * 300.0 - (y * 1e-6).powi(2) * 200.0, 0.0, 0.0, 0.0, 0.0]
        });
        let mut random = Random::case(3);
        for _ in 0..200 {
            // Beyond the grid too.
            let facet: [SpacePoint; 3] =
                [0; 3].map(|_| [random.range(-2e7, 8e7), random.range(-2e7, 8e7), random.range(-1e7, 1e7)]);
            let area =
                |[a, b, c]: [SpacePoint; 3]| ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])) / 2.0;
            let plane = |at: SpacePoint| {
                // Barycentric coordinates of the place.
                let [a, b, c] = facet;
                let all = area(facet);
                let share = [area([at, b, c]), area([a, at, c]), area([a, b, at])].map(|s| s / all);
                share[0] * a[2] + share[1] * b[2] + share[2] * c[2]
            };
            let mut sum = 0.0;
            each_piece(facet, &correction, &mut |piece| {
                sum += area(piece);
                let middle = [0, 1, 2].map(|k| (piece[0][k] + piece[1][k] + piece[2][k]) / 3.0);
                let wanted = plane(middle) + correction.height([middle[0], middle[1]]);
                assert!((middle[2] - wanted).abs() < 20.0, "{middle:?} {wanted}");
            });
            assert!((sum / area(facet) - 1.0).abs() < 1e-9, "{facet:?}");
        }
    }

    #[test]
    fn an_edge_is_cut_alike_from_both_sides() {
        let grid = Grid { origin: P2::new(-10, -10), pitch: [Nm(1_234_567), Nm(1_234_567)], count: [40, 40] };
        let correction = Correction::new(grid, |[x, y]| [x * 1e-4 + (y * 1e-6).powi(2), 0.0, 0.0, 0.0, 0.0]);
        let mut random = Random::case(4);
        let mut at = || [random.range(0.0, 4e7), random.range(0.0, 4e7), random.range(-1e6, 1e6)];
        for _ in 0..100 {
            let [a, b, c, d] = [at(), at(), at(), at()];
            let on_edge = |facet: [SpacePoint; 3]| {
                let mut found: Vec<[u64; 3]> = Vec::new();
                each_piece(facet, &correction, &mut |piece| {
                    for p in piece {
                        let off = (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]);
                        if off.abs() < 1e-2 * 4e7 {
                            found.push(p.map(f64::to_bits));
                        }
                    }
                });
                found.sort_unstable();
                found.dedup();
                found
            };
            assert_eq!(on_edge([a, b, c]), on_edge([b, a, d]));
        }
    }
}
