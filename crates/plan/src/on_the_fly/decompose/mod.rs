//! A path of marks taken apart: what the stage does, slow and smooth, and what the scanner does, the rest.
//!
//! Consumes a path at even steps (of arc length or of time), any number of coordinates; promises a stage path of
//! as many samples, and as the scanner's path the difference, so that both sum to the path up to one rounding.
//! Units: the path's for coordinates, samples for lengths along it, unless a name says otherwise.
//!
//! [`decompose`] takes any [`Method`]. How strongly a filter of a [`Family`] may smooth is found by [`back_off()`] (the
//! article's way) and [`refine`]; of the moving average by [`choose_average`]. For seven axes
//! filters smooth the plan of the path and [`on_surface`] puts it on the part; [`seven_axes`] finds stage axes of
//! least acceleration instead.
//!
//! # Sources
//! Moving average: Cui et al., eq. 1 to 4. Gaussian, its back-off search and the three limits: Ma et al. (2025).
//!
//! # Limits
//! Filters know nothing of limits: these are checked afterwards. Only [`Method::LeastAcceleration`] and
//! [`seven_axes`] keep them by construction.

mod average;
mod back_off;
mod corridor;
mod gauss;
#[cfg(test)]
pub(crate) mod sample;
mod xyzacuv;

pub use average::{Average, Infeasible, choose_average, samples_for_jump};
pub use back_off::{Family, Trial, back_off, largest, refine};
pub use corridor::{paced, rms_bend, within};
pub use xyzacuv::{Limits, on_surface, seven_axes};

/// How the stage's path is made of the path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Method<const N: usize> {
    /// Mean over an odd number of samples around each (an even one counts as one more), ends repeated.
    MovingAverage {
        /// Samples.
        samples: usize,
    },
    /// Weights of a normal distribution, cut off at 4 σ, ends repeated.
    Gaussian {
        /// Standard deviation, samples.
        sigma: f64,
    },
    /// The least sum of squared second differences with the scanner in its box at every sample.
    LeastAcceleration {
        /// What the scanner reaches to each side, per coordinate; for z, what focus allows.
        half: [f64; N],
    },
}

/// A path taken apart.
#[derive(Clone, Debug, PartialEq)]
pub struct Parts<const N: usize> {
    /// What the stage does.
    pub stage: Vec<[f64; N]>,
    /// What the scanner adds.
    pub scanner: Vec<[f64; N]>,
}

/// Takes a path apart.
pub fn decompose<const N: usize>(path: &[[f64; N]], method: Method<N>) -> Parts<N> {
    let stage = stage(path, method);
    let scanner = rest(path, &stage);
    Parts { stage, scanner }
}

/// The stage's path alone.
pub fn stage<const N: usize>(path: &[[f64; N]], method: Method<N>) -> Vec<[f64; N]> {
    if path.len() < 3 {
        return path.to_vec();
    }
    match method {
        Method::MovingAverage { samples } => average::moving_average(path, samples),
        Method::Gaussian { sigma } => gauss::gaussian(path, sigma),
        Method::LeastAcceleration { half } => corridor::least_acceleration(path, half),
    }
}

/// The scanner's path: what the stage leaves.
fn rest<const N: usize>(path: &[[f64; N]], stage: &[[f64; N]]) -> Vec<[f64; N]> {
    path.iter().zip(stage).map(|(x, s)| std::array::from_fn(|k| x[k] - s[k])).collect()
}

/// Largest value of each coordinate of a path, without sign.
pub fn peak<const N: usize>(path: &[[f64; N]]) -> [f64; N] {
    path.iter().fold([0.0; N], |peak, x| std::array::from_fn(|k| f64::max(peak[k], x[k].abs())))
}

/// Root of the mean squared acceleration (as a vector) of positions that follow each other after `step_s`; 0 for
/// fewer than three.
pub fn rms_acceleration<const N: usize>(positions: &[[f64; N]], step_s: f64) -> f64 {
    let inner = positions.windows(3);
    let count = inner.len();
    if count == 0 {
        return 0.0;
    }
    let sum: f64 = inner.map(|w| (0..N).map(|k| (w[0][k] - 2.0 * w[1][k] + w[2][k]).powi(2)).sum::<f64>()).sum();
    (sum / count as f64).sqrt() / (step_s * step_s)
}

/// A sample with index before the start or past the end repeats the one there.
#[inline]
fn at_or_end<const N: usize>(path: &[[f64; N]], i: isize) -> &[f64; N] {
    &path[i.clamp(0, path.len() as isize - 1) as usize]
}

#[cfg(test)]
mod tests;
