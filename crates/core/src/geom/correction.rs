//! Heights that are added to a surface, and how surely they are known: linear on the triangles of a grid.
//!
//! Beyond the grid the height is that of its border, and nothing is known of it: the deviation is infinite there.

use super::{Grid, P2};
use crate::parallel;

/// What a correction holds of a place: its height, its standard deviation, nm, and what of a part that lies aside the
/// points have seen there (a turn about z, nm, and shifts along x and y).
pub type Corrected = [f64; 5];

/// A correction of heights. Every cell of the grid is two triangles, parted by the diagonal from its lower left corner;
/// what it holds is linear on each.
#[derive(Clone, Debug, PartialEq)]
pub struct Correction {
    grid: Grid,
    /// By node, row by row; a row has one node more than cells.
    nodes: Vec<Corrected>,
}

/// What is linear in the plane, nm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Linear {
    at: [f64; 2],
    value: f64,
    slope: [f64; 2],
}

impl Linear {
    /// The value at a place.
    pub fn of(&self, [x, y]: [f64; 2]) -> f64 {
        self.value + self.slope[0] * (x - self.at[0]) + self.slope[1] * (y - self.at[1])
    }
}

impl Correction {
    /// What is held at each node, from its place, nm.
    pub fn new(grid: Grid, of: impl Fn([f64; 2]) -> Corrected + Sync) -> Self {
        let rows = parallel::map(grid.rows() + 1, |row| {
            let node = |column: usize| of([grid.line(0, column as i64) as f64, grid.line(1, row as i64) as f64]);
            (0..=grid.columns()).map(node).collect::<Vec<_>>()
        });
        Self { grid, nodes: rows.concat() }
    }

    /// The grid of its cells.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// What is held at each node, row by row.
    pub fn nodes(&self) -> &[Corrected] {
        &self.nodes
    }

    /// Columns and rows of cells, and their parts, to the left of and below a place.
    pub fn cells([x, y]: [f64; 2], grid: &Grid) -> [f64; 2] {
        let P2 { x: left, y: below, .. } = grid.origin;
        [(x - left as f64) / grid.pitch[0].f64(), (y - below as f64) / grid.pitch[1].f64()]
    }

    /// What is held on the triangle under a place; beyond the grid what is linear around it there.
    pub fn linear(&self, at: [f64; 2]) -> [Linear; 5] {
        let beyond = Self::cells(at, &self.grid);
        let count = [self.grid.columns(), self.grid.rows()];
        let [u, v] = [0, 1].map(|axis| beyond[axis].clamp(0.0, count[axis] as f64));
        let is_beyond = [u != beyond[0], v != beyond[1]];
        let cell = |t: f64, count: usize| (t.floor() as usize).min(count - 1);
        let [i, k] = [cell(u, count[0]), cell(v, count[1])];
        let node = |i: usize, k: usize| self.nodes[k * (self.grid.columns() + 1) + i];
        let [low, high] = [node(i, k), node(i + 1, k + 1)];
        let is_lower = u - i as f64 >= v - k as f64;
        let side = if is_lower { node(i + 1, k) } else { node(i, k + 1) };
        let [hx, hy] = self.grid.pitch.map(|pitch| pitch.f64());
        let corner = [self.grid.line(0, i as i64) as f64, self.grid.line(1, k as i64) as f64];
        let [du, dv] = [u - i as f64, v - k as f64];
        [0, 1, 2, 3, 4].map(|m| {
            if m == 1 && (is_beyond[0] || is_beyond[1]) {
                return Linear { at, value: f64::INFINITY, slope: [0.0; 2] };
            }
            let [sx, sy] = if is_lower {
                [(side[m] - low[m]) / hx, (high[m] - side[m]) / hy]
            } else {
                [(high[m] - side[m]) / hx, (side[m] - low[m]) / hy]
            };
            if is_beyond[0] || is_beyond[1] {
                let value = low[m] + sx * hx * du + sy * hy * dv;
                let slope = [if is_beyond[0] { 0.0 } else { sx }, if is_beyond[1] { 0.0 } else { sy }];
                return Linear { at, value, slope };
            }
            Linear { at: corner, value: low[m], slope: [sx, sy] }
        })
    }

    /// The height at a place, nm.
    pub fn height(&self, at: [f64; 2]) -> f64 {
        self.linear(at)[0].of(at)
    }

    /// Lowest and highest height, and the least and the largest deviation at a node, nm.
    pub fn ranges(&self) -> [[f64; 2]; 2] {
        [0, 1].map(|m| {
            let of = self.nodes.iter().map(|node| node[m]);
            of.fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], v| [lo.min(v), hi.max(v)])
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::Nm;

    #[test]
    fn nodes_and_what_is_linear_are_found_again() {
        let grid = Grid { origin: P2::new(-500, 300), pitch: [Nm(1000), Nm(2000)], count: [4, 3] };
        let of = |[x, y]: [f64; 2]| [0.5 * x - 0.25 * y + 7.0, 0.1 * x + 3.0 * y, 0.0, x, y];
        let correction = Correction::new(grid, of);
        for at in [[-500.0, 300.0], [123.0, 4567.0], [3499.0, 6299.0], [3500.0, 6300.0]] {
            let found = correction.linear(at).map(|l| l.of(at));
            let close = |(found, wanted): (f64, f64)| (found - wanted).abs() < 1e-9;
            assert!(found.into_iter().zip(of(at)).all(close), "{at:?}");
        }
        let [height, deviation, ..] = correction.linear([-900.0, 9000.0]).map(|l| l.of([-900.0, 9000.0]));
        assert!((height - of([-500.0, 6300.0])[0]).abs() < 1e-9 && deviation.is_infinite());
        let left = correction.linear([-900.0, 4000.0])[0];
        assert!((left.of([-700.0, 4100.0]) - of([-500.0, 4100.0])[0]).abs() < 1e-9);
        // Continuous across borders of triangles.
        let bumpy = Correction::new(grid, |[x, y]| [(x * y).rem_euclid(97.0), 0.0, 0.0, 0.0, 0.0]);
        for at in [[500.0, 1000.0], [100.0, 1500.0], [1500.0, 2300.0], [0.0, 1300.0]] {
            let around = [[1e-6, 0.0], [-1e-6, 0.0], [0.0, 1e-6], [0.0, -1e-6]];
            for d in around {
                assert!((bumpy.height([at[0] + d[0], at[1] + d[1]]) - bumpy.height(at)).abs() < 1e-5);
            }
        }
    }
}
