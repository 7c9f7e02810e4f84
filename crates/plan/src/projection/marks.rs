//! Marks that stand for all others: in each cell of a grid the lowest and the highest end of a piece.

use rustc_hash::FxHashMap;

use super::{GridTracer, segments};
use terrace_core::geom::{P2, P3};

/// Points of marks in space, nm: at most two for every cell.
#[derive(Clone, Debug, Default)]
pub struct Marks {
    cells: FxHashMap<u32, [P3; 2]>,
    /// Largest squared slope of the marks.
    pub worst_slope2: f64,
}

impl Marks {
    /// Adds one stroke, traced over the grid.
    pub fn add(&mut self, points: &[P2], tracer: &mut GridTracer<'_>) {
        let columns = i64::from(tracer.grid.count[0]);
        for (a, b) in segments(points) {
            tracer.segment(a, b, |p, [column, row]| {
                for (t, z) in [(p.t0, p.z0), (p.t1, p.z1)] {
                    let [x, y] = [(a.x, b.x), (a.y, b.y)].map(|(a, b)| a as f64 + t * (b - a) as f64);
                    self.point((row * columns + column) as u32, P3::new([x, y, z]));
                }
            });
        }
        self.worst_slope2 = self.worst_slope2.max(tracer.tracer.worst_slope2);
    }

    fn point(&mut self, cell: u32, p: P3) {
        // Of equally high points always the same, whatever the order in which they come.
        let key = |p: &P3| [p[2], p[0], p[1]];
        let below = |a: &P3, b: &P3| key(a).partial_cmp(&key(b)).is_some_and(|o| o.is_lt());
        let [lo, hi] = self.cells.entry(cell).or_insert([p; 2]);
        if below(&p, lo) {
            *lo = p;
        }
        if below(hi, &p) {
            *hi = p;
        }
    }

    /// Joins what another part of the texture found.
    pub fn merge(&mut self, other: Self) {
        self.worst_slope2 = self.worst_slope2.max(other.worst_slope2);
        for (cell, points) in other.cells {
            points.into_iter().for_each(|p| self.point(cell, p));
        }
    }

    /// The points, by cell.
    pub fn list(self) -> Vec<P3> {
        let mut cells: Vec<(u32, [P3; 2])> = self.cells.into_iter().collect();
        cells.sort_unstable_by_key(|c| c.0);
        cells.into_iter().flat_map(|(_, points)| points).collect()
    }
}
