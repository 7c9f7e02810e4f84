//! A correction of heights: its nodes, and the facets that it raises.

use terrace_core::geom::SpacePoint;
use terrace_core::parallel;

/// By how much a height may differ where the compiler leaves a corner on a line of the grid that it is next to, nm.
pub(super) const CUT_NM: f64 = 4.0;

/// Of a place: height and deviation, nm, and what of a part that lies aside the points have seen there, of a turn about z,
/// nm, and of shifts along x and y.
pub(crate) type Corrected = [f64; 5];

/// Heights that are added to a part, linear on triangles: each square of four nodes has two, parted from its lower left to
/// its upper right.
#[derive(Clone, Debug)]
pub(crate) struct Correction {
    /// The first node, and the distance to the next along x and y, nm.
    origin: [f64; 2],
    pitch: f64,
    /// Squares along x and y.
    count: [usize; 2],
    /// What is held of each node, by row.
    nodes: Vec<Vec<Corrected>>,
}

impl Correction {
    /// What is held of all nodes, from their places, nm.
    pub(crate) fn new(
        origin: [f64; 2],
        pitch: f64,
        count: [usize; 2],
        of: impl Fn([f64; 2]) -> Corrected + Sync,
    ) -> Self {
        let row = |k: usize| {
            (0..=count[0]).map(|i| of([origin[0] + i as f64 * pitch, origin[1] + k as f64 * pitch])).collect()
        };
        Self { origin, pitch, count, nodes: parallel::map(count[1] + 1, row) }
    }

    /// Of height (0) or deviation (1) the least and the largest of all nodes.
    pub(crate) fn range(&self, of: usize) -> [f64; 2] {
        let all = self.nodes.iter().flatten().map(|node| node[of]);
        all.fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], v| [lo.min(v), hi.max(v)])
    }

    /// How far a place lies beyond the nodes, nm.
    pub(crate) fn beyond(&self, at: [f64; 2]) -> f64 {
        let squares = self.squares(at);
        [0, 1]
            .map(|k| (-squares[k]).max(squares[k] - self.count[k] as f64).max(0.0) * self.pitch)
            .into_iter()
            .fold(0.0, f64::max)
    }

    /// Squares to the left of a place, and below it.
    fn squares(&self, at: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|k| (at[k] - self.origin[k]) / self.pitch)
    }

    /// What is held of a place; beyond the nodes the height of the nearest of them, of which nothing is known.
    pub(crate) fn at(&self, at: [f64; 2]) -> Corrected {
        let squares = self.squares(at);
        let inside = [0, 1].map(|k| squares[k].clamp(0.0, self.count[k] as f64));
        let [i, k] = [0, 1].map(|along| (inside[along] as usize).min(self.count[along] - 1));
        let part = [inside[0] - i as f64, inside[1] - k as f64];
        let [height, deviation, aside @ ..] = self.on_triangle([i, k], part[0] >= part[1], part);
        let [turn, x, y] = aside;
        [height, if self.beyond(at) > 0.0 { f64::INFINITY } else { deviation }, turn, x, y]
    }

    /// What is held by the planes of a triangle, at a place by its parts of the square.
    fn on_triangle(&self, [i, k]: [usize; 2], is_right: bool, [u, v]: [f64; 2]) -> Corrected {
        let corner = |di: usize, dk: usize| self.nodes[k + dk][i + di];
        let [low, high] = [corner(0, 0), corner(1, 1)];
        // Weights of the corners that a place in a triangle has.
        let (third, weights) =
            if is_right { (corner(1, 0), [1.0 - u, u - v, v]) } else { (corner(0, 1), [1.0 - v, v - u, u]) };
        [0, 1, 2, 3, 4].map(|m| weights[0] * low[m] + weights[1] * third[m] + weights[2] * high[m])
    }

    /// Hands the parts of a facet, corners in nm, to `sink`: what of it lies over each triangle, and beyond the nodes beside
    /// each square at the rim, raised by that.
    pub(super) fn raised(&self, facet: [SpacePoint; 3], sink: &mut dyn FnMut([SpacePoint; 3])) {
        let squares = facet.map(|[x, y, _]| self.squares([x, y]));
        let [columns, rows] = [0, 1].map(|along| {
            let of = squares.map(|s| s[along]);
            let [lo, hi] = [of[0].min(of[1]).min(of[2]), of[0].max(of[1]).max(of[2])];
            let square = |v: f64| v.floor().clamp(-1.0, self.count[along] as f64) as i64;
            square(lo)..=square(hi)
        });
        for k in rows {
            for i in columns.clone() {
                let is_square = i >= 0 && k >= 0 && (i as usize) < self.count[0] && (k as usize) < self.count[1];
                let sides: &[Option<bool>] = if is_square { &[Some(true), Some(false)] } else { &[None] };
                for side in sides {
                    self.part(facet, [i, k], *side, sink);
                }
            }
        }
    }

    /// What of a facet lies over one square, or a side of its diagonal.
    fn part(
        &self,
        facet: [SpacePoint; 3],
        [i, k]: [i64; 2],
        side: Option<bool>,
        sink: &mut dyn FnMut([SpacePoint; 3]),
    ) {
        let parts = |[x, y, _]: SpacePoint| {
            let [u, v] = self.squares([x, y]);
            [u - i as f64, v - k as f64]
        };
        let last = self.count.map(|count| count as i64);
        // How far a place lies inside each border: positive inside. What is beyond the nodes has no far border.
        let borders: [&dyn Fn([f64; 2]) -> f64; 5] = [
            &|[u, _]| if i < 0 { f64::INFINITY } else { u },
            &|[u, _]| if i >= last[0] { f64::INFINITY } else { 1.0 - u },
            &|[_, v]| if k < 0 { f64::INFINITY } else { v },
            &|[_, v]| if k >= last[1] { f64::INFINITY } else { 1.0 - v },
            &|[u, v]| match side {
                Some(true) => u - v,
                Some(false) => v - u,
                None => f64::INFINITY,
            },
        ];
        let mut inside = facet.to_vec();
        for border in borders {
            let from = std::mem::take(&mut inside);
            for (n, &p) in from.iter().enumerate() {
                let q = from[(n + 1) % from.len()];
                let [a, b] = [p, q].map(|p| border(parts(p)));
                if a >= 0.0 {
                    inside.push(p);
                }
                if (a > 0.0 && b < 0.0) || (a < 0.0 && b > 0.0) {
                    let t = a / (a - b);
                    inside.push([0, 1, 2].map(|k| p[k] + t * (q[k] - p[k])));
                }
            }
        }
        let height = |p: SpacePoint| match side {
            Some(is_right) => self.on_triangle([i as usize, k as usize], is_right, parts(p))[0],
            None => self.at([p[0], p[1]])[0],
        };
        let lifted: Vec<SpacePoint> = inside.into_iter().map(|p| [p[0], p[1], p[2] + height(p)]).collect();
        for n in 2..lifted.len() {
            sink([lifted[0], lifted[n - 1], lifted[n]]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_of_a_facet_fill_it_and_are_raised_by_their_triangles() {
        let of = |[x, y]: [f64; 2]| [1e-3 * x * y / 1e6, x * 1e-3, 0.0, 0.0, 0.0];
        // It reaches beyond the nodes on two sides.
        let correction = Correction::new([-1e6, -5e6], 2e6, [5, 12], of);
        let facet = [[-4.3e6, -2.0e6, 0.0], [13.1e6, 1.7e6, 3e6], [2.2e6, 15.9e6, -1e6]];
        let area =
            |f: [SpacePoint; 3]| (f[1][0] - f[0][0]) * (f[2][1] - f[0][1]) - (f[1][1] - f[0][1]) * (f[2][0] - f[0][0]);
        let mut sum = 0.0;
        correction.raised(facet, &mut |part| {
            sum += area(part);
            let middle = [0, 1, 2].map(|k| (part[0][k] + part[1][k] + part[2][k]) / 3.0);
            let at = [middle[0], middle[1], 0.0];
            let shares =
                [area([at, facet[1], facet[2]]), area([facet[0], at, facet[2]]), area([facet[0], facet[1], at])];
            let plane: f64 = (0..3).map(|k| shares[k] / area(facet) * facet[k][2]).sum();
            let raised = plane + correction.at([middle[0], middle[1]])[0];
            assert!((middle[2] - raised).abs() < 1e-3, "{middle:?} {raised}");
        });
        assert!((sum / area(facet) - 1.0).abs() < 1e-9);
    }
}
