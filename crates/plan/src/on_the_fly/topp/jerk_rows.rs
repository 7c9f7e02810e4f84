//! The rows of the jerk limit: what jerk is on a grid, as a function of b at three neighbouring borders.
//!
//! Acceleration is even in b over a cell, so that jerk is taken as its change from the middle of one cell to the middle
//! of the next over the time between: |Σ c b| ≤ T(b). In the first and the last cell, which border on rest, d³s/dt³ is
//! even instead (a cell with even acceleration would begin with a step of it).

use super::grid::Grid;
use terrace_core::math;

/// Acceleration of an axis over its limit, where the time to the next reference begins or ends, as factors of
/// b at both borders: the middle of a cell, or the moving end of a cell that borders on rest.
#[inline]
fn reference(grid: &Grid, cell: usize, axis: usize) -> [f64; 2] {
    let third = if !grid.is_end(cell) {
        1
    } else if cell == 0 {
        2
    } else {
        0
    };
    grid.acceleration(cell, third, axis)
}

/// Time from a border to the reference of a cell next to it, and its derivatives by b at the border and at the cell's
/// other border.
#[inline]
fn half_time(grid: &Grid, cell: usize, own: f64, other: f64) -> [f64; 3] {
    if grid.is_end(cell) {
        return [0.0; 3];
    }
    let h = grid.width(cell);
    // Half of the cell at even acceleration: (h/2) over the mean of both speeds, √b being the speed.
    let (near, middle) = (own.sqrt(), (0.5 * (own + other)).sqrt());
    let sum = near + middle;
    let by = -h / (sum * sum);
    let by_middle = by * 0.25 / middle;
    [h / sum, by * 0.5 / near + by_middle, by_middle]
}

/// Time from reference to reference around border `i`, and its derivatives by b there and next to it.
pub(super) fn time_around(grid: &Grid, i: usize, b: [f64; 3]) -> (f64, [f64; 3]) {
    let left = half_time(grid, i - 1, b[1], b[0]);
    let right = half_time(grid, i, b[1], b[2]);
    (left[0] + right[0], [left[2], left[1] + right[1], right[2]])
}

/// Change of acceleration around a border in units of what the jerk limit allows in one second.
pub(super) fn change(grid: &Grid, i: usize, axis: usize) -> [f64; 3] {
    let (l, r) = (reference(grid, i - 1, axis), reference(grid, i, axis));
    [-l[0], r[0] - l[1], r[1]].map(|c| c * grid.ramp[axis])
}

/// Jerk over its limit of an axis in the cells next to the stops, per (2 b^(3/2)) / (9 h²): with even d³s/dt³ it is
/// d³s/dt³ (q' + 9 q'' x + 4.5 q''' x²) at x from the stop.
fn end_factor(grid: &Grid, cell: usize, axis: usize) -> f64 {
    let h = grid.width(cell);
    let (stop, sign) = if cell == 0 { (0, 1.0) } else { (2 * cell + 2, -1.0) };
    let halves = if cell == 0 { [0, 1, 2] } else { [2 * cell + 2, 2 * cell + 1, 2 * cell] };
    let third = (grid.shape(halves[2], axis).1 - grid.shape(stop, axis).1) / h;
    let mut most = 0.0f64;
    // At the stop, in the middle of the cell and at its other end.
    for (n, half) in halves.into_iter().enumerate() {
        let x = 0.5 * h * n as f64;
        let (d1, d2) = grid.shape(half, axis);
        most = most.max((d1 + sign * 9.0 * d2 * x + sign * 4.5 * third * x * x).abs());
    }
    most * grid.ramp[axis]
}

/// The largest share of the jerk limits that b reaches.
pub(super) fn ratio(grid: &Grid, b: &[f64]) -> f64 {
    let n = grid.cells();
    let mut most = 0.0f64;
    for axis in (0..grid.axes).filter(|&a| grid.ramp[a] > 0.0) {
        for (cell, b) in [(0, b[1]), (n - 1, b[n - 1])] {
            let even = 2.0 * math::pow(b, 1.5) / (9.0 * grid.width(cell).powi(2));
            most = most.max(end_factor(grid, cell, axis) * even);
        }
    }
    (1..n).fold(most, |m, i| m.max(ratio_at(grid, i, [b[i - 1], b[i], b[i + 1]])))
}

/// The largest share of the jerk limits that b reaches at one border.
fn ratio_at(grid: &Grid, i: usize, b: [f64; 3]) -> f64 {
    let (time, _) = time_around(grid, i, b);
    let share = |axis| {
        let c = change(grid, i, axis);
        (c[0] * b[0] + c[1] * b[1] + c[2] * b[2]).abs() / time
    };
    (0..grid.axes).filter(|&a| grid.ramp[a] > 0.0).map(share).fold(0.0, f64::max)
}

/// Largest b next to the stops by jerk alone.
pub(super) fn end_cap(grid: &Grid, cell: usize) -> f64 {
    let factor = (0..grid.axes).map(|a| end_factor(grid, cell, a)).fold(0.0, f64::max);
    math::pow(4.5 * grid.width(cell).powi(2) / factor, 2.0 / 3.0)
}
