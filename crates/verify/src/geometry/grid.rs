//! A uniform grid over the plane and the cells that a line passes.

use super::Line;

/// Square cells, counted from the lower left.
#[derive(Clone, Copy, Debug)]
pub(super) struct Grid {
    pub(super) lo: [f64; 2],
    pub(super) size: f64,
    pub(super) count: [usize; 2],
}

impl Grid {
    /// Column (axis 0) or row (axis 1) of a coordinate, clamped to the grid.
    pub(super) fn index(&self, axis: usize, v: f64) -> usize {
        // The cast saturates, so coordinates far outside land in the first or last cell.
        (((v - self.lo[axis]) / self.size) as usize).min(self.count[axis] - 1)
    }

    /// The cells (column, row) under the line in order, from where it enters the grid to where it leaves.
    pub(super) fn along(&self, line: &Line, mut visit: impl FnMut(usize, usize)) {
        let Some([from, to]) = self.clip(line) else { return };
        let p = line.at(from);
        let mut cell = [self.index(0, p[0]), self.index(1, p[1])];
        loop {
            visit(cell[0], cell[1]);
            // The next cell lies beyond the border that the line meets first; of two at once, x comes first.
            let next = [0, 1].map(|k| self.border(line, cell, k));
            let k = usize::from(next[1] < next[0]);
            if next[k] > to {
                return;
            }
            if line.dir[k] > 0.0 {
                cell[k] += 1;
                if cell[k] == self.count[k] {
                    return;
                }
            } else if cell[k] == 0 {
                return;
            } else {
                cell[k] -= 1;
            }
        }
    }

    /// Distance along the line to where it leaves the cell across axis `k`.
    fn border(&self, line: &Line, cell: [usize; 2], k: usize) -> f64 {
        if line.dir[k] == 0.0 {
            return f64::INFINITY;
        }
        let edge = self.lo[k] + (cell[k] + usize::from(line.dir[k] > 0.0)) as f64 * self.size;
        (edge - line.start[k]) / line.dir[k]
    }

    /// The stretch of the line inside the grid, borders included.
    fn clip(&self, line: &Line) -> Option<[f64; 2]> {
        let (mut from, mut to) = (0.0f64, line.len);
        for k in 0..2 {
            let (lo, hi) = (self.lo[k], self.lo[k] + self.size * self.count[k] as f64);
            if line.dir[k] == 0.0 {
                if line.start[k] < lo || line.start[k] > hi {
                    return None;
                }
                continue;
            }
            let (a, b) = ((lo - line.start[k]) / line.dir[k], (hi - line.start[k]) / line.dir[k]);
            from = from.max(a.min(b));
            to = to.min(a.max(b));
        }
        (from <= to).then_some([from, to])
    }
}
