//! How strongly a filter may smooth.

use super::Method;

/// A filter whose strength is still open.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Family {
    /// [`Method::MovingAverage`]; its strength is the samples.
    MovingAverage,
    /// [`Method::Gaussian`]; its strength is sigma.
    Gaussian,
}

/// A strength that was tried.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trial<T> {
    /// In the units of the search.
    pub strength: f64,
    /// What came of it.
    pub found: T,
    /// Whether the trial keeps all limits.
    pub holds: bool,
}

impl Family {
    /// The method of this strength, in samples.
    pub fn at<const N: usize>(self, strength: f64) -> Method<N> {
        match self {
            // The nearest odd number.
            Self::MovingAverage => {
                Method::MovingAverage { samples: 2 * (strength / 2.0).floor().max(0.0) as usize + 1 }
            }
            Self::Gaussian => Method::Gaussian { sigma: strength },
        }
    }
}

/// The article's back-off search: from `start` down, each trial `factor` of the one before, to the first that holds or
/// the last that is not below `least`. Every trial that was tried, in order.
///
/// `attempt` gives what came of a strength and whether all limits hold. The strength is in units of the caller.
pub fn back_off<T>(start: f64, factor: f64, least: f64, mut attempt: impl FnMut(f64) -> (T, bool)) -> Vec<Trial<T>> {
    let mut trials = Vec::new();
    let mut strength = start;
    while strength >= least && strength > 0.0 {
        let (found, holds) = attempt(strength);
        trials.push(Trial { strength, found, holds });
        if holds || !(factor > 0.0 && factor < 1.0) {
            break;
        }
        strength *= factor;
    }
    trials
}

/// Bisection between a strength within the limits and a larger one beyond them, until they differ by less than
/// `tolerance`: the largest that was seen to hold, or none if none was tried that holds.
///
/// Exact where limits fail from some strength on for good. They need not: the moving average's do not always.
pub fn refine<T>(
    within: f64,
    beyond: f64,
    tolerance: f64,
    mut attempt: impl FnMut(f64) -> (T, bool),
) -> Option<Trial<T>> {
    let (mut low, mut high) = (within, beyond);
    let mut best = None;
    while high - low > tolerance {
        let strength = 0.5 * (low + high);
        if strength <= low || strength >= high {
            break;
        }
        let (found, holds) = attempt(strength);
        if holds {
            low = strength;
            best = Some(Trial { strength, found, holds });
        } else {
            high = strength;
        }
    }
    best
}

/// Down the strengths, then by bisection back up towards the last trial that failed. None where no trial holds.
pub fn largest<T>(
    start: f64,
    factor: f64,
    least: f64,
    tolerance: f64,
    mut attempt: impl FnMut(f64) -> (T, bool),
) -> Option<Trial<T>> {
    let mut trials = back_off(start, factor, least, &mut attempt);
    let best = trials.pop().filter(|r| r.holds)?;
    let Some(failed) = trials.last() else { return Some(best) };
    Some(refine(best.strength, failed.strength, tolerance, attempt).unwrap_or(best))
}
