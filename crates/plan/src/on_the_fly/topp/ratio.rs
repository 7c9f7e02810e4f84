//! How far a motion on a grid uses its limits.

use super::grid::Grid;
use super::{Ratio, jerk_rows};

/// What shares of the limits are reached: speed and acceleration at borders, middles and quarters of
/// cells, jerk at borders.
pub(super) fn of(grid: &Grid, b: &[f64]) -> Ratio {
    let mut out = Ratio::default();
    let mut speed = 0.0f64;
    for cell in 0..grid.cells() {
        speed = speed.max(b[cell] / grid.cap[cell]).max(b[cell + 1] / grid.cap[cell + 1]);
        let ends = [b[cell], b[cell + 1]];
        for axis in 0..grid.axes {
            let shares = grid.accelerations(cell, axis).map(|[l, r]| (l * ends[0] + r * ends[1]).abs());
            out.acceleration = shares.fold(out.acceleration, f64::max);
        }
    }
    out.speed = speed.sqrt();
    if grid.has_jerk() {
        out.jerk = jerk_rows::ratio(grid, b);
    }
    out
}
