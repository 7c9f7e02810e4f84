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
    // Which y is chosen does not matter where x is the same, as long as the half-planes before hold.
    for (i, &[p, r]) in halves.iter().enumerate() {
        if p * x + r * y <= 1.0 + 1e-12 {
            continue;
        }
        // On the line p x + r y = 1, by y, where x is not fixed by it.
        let by_y = p.abs() * x_most >= r.abs() * y_most;
        let (mut lo, mut hi) = (0.0, if by_y { y_most } else { x_most });
        let (own, other) = if by_y { (p, r) } else { (r, p) };
        let mut clip = |f: f64, g: f64, most: f64| {
            // f * free + g * fixed ≤ most with fixed = (1 - other * free) / own.
            let (slope, rest) = (f - g * other / own, most - g / own);
            if slope > 0.0 {
                hi = f64::min(hi, rest / slope);
            } else if slope < 0.0 {
                lo = f64::max(lo, rest / slope);
            }
        };
        clip(0.0, 1.0, if by_y { x_most } else { y_most });
        clip(0.0, -1.0, 0.0);
        for &[a, c] in &halves[..i] {
            if by_y { clip(c, a, 1.0) } else { clip(a, c, 1.0) }
        }
        if by_y {
            y = if -other / own > 0.0 { hi } else { lo };
            x = (1.0 - other * y) / own;
        } else {
            x = hi;
            y = (1.0 - other * x) / own;
        }
        (x, y) = (x.clamp(0.0, x_most), y.clamp(0.0, y_most));
    }
    x
}
