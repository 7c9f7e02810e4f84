//! Speed and acceleration limits: the greatest b by passes backward and forward.

use super::grid::Grid;

/// Share of a limit that rounding may add.
const SLACK: f64 = 1e-9;

/// A half-plane p x + r y ≤ 1, normalised.
type Half = [f64; 2];

/// What speed and acceleration leave of b at the borders of a run's cells.
pub(super) struct Reach {
    /// What no motion exceeds.
    pub most: Vec<f64>,
    /// A motion: from the start on the greatest b that is left from border to border.
    pub greatest: Vec<f64>,
}

/// By a pass backward and one forward.
pub(super) fn reach(grid: &Grid) -> Reach {
    // TOPP-RA (Pham and Pham 2018, algorithm 1): controllable sets backward, the greatest control forward.
    let n = grid.cells();
    let mut rows: Vec<Half> = Vec::with_capacity(10 * grid.axes);
    // Backward: from how much can the next be reached, and so on to the end at rest?
    let mut most = grid.cap.clone();
    (most[0], most[n]) = (0.0, 0.0);
    for cell in (1..n).rev() {
        halves(grid, cell, &mut rows);
        most[cell] = widest(&rows, most[cell], most[cell + 1]);
    }
    // Forward: the most of that, from a motion and from any.
    let mut b = most.clone();
    for cell in 0..n - 1 {
        halves(grid, cell, &mut rows);
        let x = b[cell];
        // Where an axis turns round, a factor of y is next to nothing: rounding must not decide then.
        let allowed = rows.iter().filter(|h| h[1] > 0.0).map(|h| (1.0 + SLACK - h[0] * x).max(0.0) / h[1]);
        let need = rows.iter().filter(|h| h[1] < 0.0).map(|h| (h[0] * x - 1.0 - SLACK) / -h[1]);
        let (allowed, need) = (allowed.fold(b[cell + 1], f64::min), need.fold(0.0, f64::max));
        b[cell + 1] = allowed.max(need.min(b[cell + 1]));
        rows.iter_mut().for_each(|h| h.swap(0, 1));
        most[cell + 1] = widest(&rows, most[cell + 1], most[cell]).max(b[cell + 1]);
    }
    Reach { most, greatest: b }
}

/// Acceleration limits in a cell.
fn halves(grid: &Grid, cell: usize, out: &mut Vec<Half>) {
    out.clear();
    for axis in 0..grid.axes {
        out.extend(grid.accelerations(cell, axis).flat_map(|[p, r]| [[p, r], [-p, -r]]));
    }
}

/// The greatest x ≤ `x_most` with some 0 ≤ y ≤ `y_most` in all half-planes, which hold the origin: one after the
/// other, each that is broken is leant on (Seidel).
fn widest(halves: &[Half], x_most: f64, y_most: f64) -> f64 {
    let (mut x, mut y) = (x_most, y_most);
    // Invariant: x is the greatest in the half-planes before `i`, with y in them. Which y is chosen does not matter
    // where x is the same.
    for (i, &[p, r]) in halves.iter().enumerate() {
        if p * x + r * y <= 1.0 + 1e-12 {
            continue;
        }
        // On the line p x + r y = 1, by y, where x is not fixed by it.
        let by_y = p.abs() * x_most >= r.abs() * y_most;
        if by_y {
            let mut interval = LineInterval { lo: 0.0, hi: y_most, own: p, other: r };
            interval.clip(0.0, 1.0, x_most);
            interval.clip(0.0, -1.0, 0.0);
            halves[..i].iter().for_each(|&[a, c]| interval.clip(c, a, 1.0));
            // x rises along the line with y, or falls.
            y = if -r / p > 0.0 { interval.hi } else { interval.lo };
            x = (1.0 - r * y) / p;
        } else {
            let mut interval = LineInterval { lo: 0.0, hi: x_most, own: r, other: p };
            interval.clip(0.0, 1.0, y_most);
            interval.clip(0.0, -1.0, 0.0);
            halves[..i].iter().for_each(|&[a, c]| interval.clip(a, c, 1.0));
            x = interval.hi;
            y = (1.0 - p * x) / r;
        }
        (x, y) = (x.clamp(0.0, x_most), y.clamp(0.0, y_most));
    }
    x
}

/// What half-planes leave of the line own * fixed + other * free = 1, as an interval of the free coordinate.
struct LineInterval {
    lo: f64,
    hi: f64,
    own: f64,
    other: f64,
}

impl LineInterval {
    /// Keeps f * free + g * fixed ≤ `most`, with fixed = (1 - other * free) / own.
    #[inline]
    fn clip(&mut self, f: f64, g: f64, most: f64) {
        let (slope, rest) = (f - g * self.other / self.own, most - g / self.own);
        if slope > 0.0 {
            self.hi = f64::min(self.hi, rest / slope);
        } else if slope < 0.0 {
            self.lo = f64::max(self.lo, rest / slope);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn widest_is_the_corner_of_a_polygon() {
        assert_eq!(widest(&[], 3.0, 2.0), 3.0);
        // x - y <= 1 and x + y <= 2: the greatest x is 1.5, at y = 0.5.
        let halves = [[1.0, -1.0], [0.5, 0.5]];
        assert!((widest(&halves, 3.0, 2.0) - 1.5).abs() < 1e-12);
        // With y up to 0.2 only.
        assert!((widest(&halves, 3.0, 0.2) - 1.2).abs() < 1e-12);
    }
}
