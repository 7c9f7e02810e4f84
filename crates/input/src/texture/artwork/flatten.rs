//! Curves of drawings as polylines: how many even steps keep the tolerance, and what a drawing must not exceed.
//!
//! A chord over the parameter step h of a curve with |B''| <= M misses it by at most M h² / 8; on an ellipse M is its
//! longest half axis, h an angle. So the number of even steps follows from the tolerance, and all points lie on the
//! curve.
//!
//! Units: mm, rad.

use std::f64::consts::{FRAC_PI_4, TAU};
use terrace_core::math;

/// Most points of one drawing.
pub(in crate::texture) const MAX_POINTS: usize = 20_000_000;

/// Largest coordinate of a drawing: f64 still tells a tenth of a nanometre there.
pub(in crate::texture) const MAX_MM: f64 = 1e9;

/// Most points of a disc: one of 4 m keeps a nanometre with fewer.
const MAX_DISC_STEPS: f64 = 1e6;

/// Why an outline cannot be continued.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::texture) enum Stop {
    /// More than [`MAX_POINTS`].
    Full,
    /// Beyond [`MAX_MM`], or not finite.
    Far,
}

/// Steps of a curve over parameters 0 to 1 whose second derivative is at most `second`.
pub(in crate::texture) fn steps(second: f64, tolerance: f64, least: f64) -> f64 {
    (second / (8.0 * tolerance)).sqrt().ceil().max(least)
}

/// Steps of a part of an ellipse, of at most an eighth of a turn; `radius` is the longest.
pub(in crate::texture) fn arc_steps(by: f64, radius: f64, tolerance: f64) -> f64 {
    let least = (by.abs() / FRAC_PI_4 - 1e-9).ceil().max(1.0);
    steps(by * by * radius, tolerance, least)
}

/// The contour of a disc, closed; its points lie on the circle, four of them at its ends along x and y.
pub(in crate::texture) fn disc([x, y]: [f64; 2], diameter: f64, tolerance: f64) -> Vec<[f64; 2]> {
    let radius = diameter / 2.0;
    let steps = 4.0 * (arc_steps(TAU, radius, tolerance).min(MAX_DISC_STEPS) / 4.0).ceil();
    let at = |k: usize| {
        let (sin, cos) = math::sin_cos(TAU * k as f64 / steps);
        [x + radius * cos, y + radius * sin]
    };
    let mut contour: Vec<[f64; 2]> = (0..steps as usize).map(at).collect();
    contour.extend(contour.first().copied());
    contour
}

/// The steps as a number of points, where a drawing that has `points` may have so many more.
///
/// # Errors
/// [`Stop::Far`] where they are not finite, [`Stop::Full`].
pub(in crate::texture) fn counted(steps: f64, points: usize) -> Result<usize, Stop> {
    if !steps.is_finite() {
        Err(Stop::Far)
    } else if points as f64 + steps > MAX_POINTS as f64 {
        Err(Stop::Full)
    } else {
        Ok(steps as usize)
    }
}
