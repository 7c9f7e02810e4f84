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
            let at = |third| {
                let [l, r] = grid.acceleration(cell, third, axis);
                l * ends[0] + r * ends[1]
            };
            let [p, q, r] = [at(0), at(1), at(2)];
            // Quarters from the parabola through the three.
            let quarters = [(3.0 * p + 6.0 * q - r) / 8.0, (6.0 * q + 3.0 * r - p) / 8.0];
            let inner = if grid.is_end(cell) { [0.0; 2] } else { quarters };
            let most = [p, q, r, inner[0], inner[1]].iter().fold(0.0f64, |m, v| m.max(v.abs()));
            out.acceleration = out.acceleration.max(most);
        }
    }
    out.speed = speed.sqrt();
    if grid.has_jerk() {
        out.jerk = jerk_rows::ratio(grid, b);
    }
    out
}
