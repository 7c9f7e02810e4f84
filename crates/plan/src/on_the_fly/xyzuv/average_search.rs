//! Moving averages with ramps, and the search for the one that the stage has to be slowed down for least.
//!
//! Consumes coordinates at even steps and the limits of their axes; promises the shortest average under which the axes
//! keep their limits at the speed asked for, else the one that needs the least slowing down. Averages that leave more
//! than scanner or focus can make up are not taken. Units: lengths of averages in samples; mm, s.
//!
//! # Source
//! Cui et al. (2021), eq. 4: the moving average. Its acceleration steps; two more averages make ramps of the steps.

use crate::on_the_fly::decompose::{Method, stage};
use crate::on_the_fly::xyzuv::Peaks;
use terrace_core::parallel;

/// Shares of its length by which an average is made longer and shorter, one after the other.
const STEP_SHARES: [f64; 3] = [0.2, 0.1, 0.05];
/// Gains of a thousandth are not worth a step.
const WORTH_A_STEP: f64 = 0.999;

/// A moving average followed by two shorter ones, its ramps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct RampedAverage {
    /// Samples of the average, odd.
    pub(super) samples: usize,
    /// Samples of each of the two that follow, odd; with 1 there are none.
    pub(super) ramp: usize,
    /// How many times slower than asked the stage must follow it, 1 or more.
    pub(super) slower: f64,
}

impl RampedAverage {
    /// Samples to each side that a sample of the stage depends on.
    pub(super) fn reach(&self) -> usize {
        self.samples / 2 + 2 * (self.ramp / 2)
    }

    /// A path that rests for `lead` samples at both ends, averaged, and twice more: a step of speed becomes a ramp of
    /// acceleration, and a step of place, as a quick jump is, one of speed. It begins and ends at rest where `lead` is
    /// [`RampedAverage::reach`] or more.
    pub(super) fn of<const N: usize>(&self, path: &[[f64; N]], lead: usize) -> Vec<[f64; N]> {
        // Each average turns a step of one derivative into a ramp of it over its samples.
        with_ramps(stage(&with_ends_held(path, lead), Method::MovingAverage { samples: self.samples }), self.ramp)
    }
}

/// A search for the average of some coordinates together.
pub(super) struct AverageSearch<'a, const N: usize, F> {
    /// The coordinates at even steps.
    pub(super) path: &'a [[f64; N]],
    /// Time between the samples of `path`.
    pub(super) step_s: f64,
    pub(super) limits: [Peaks; N],
    /// The search ends at an average that needs no more slowing down than this.
    pub(super) enough: f64,
    /// Whether scanner or focus can make up what is left by a stage with these positions at the samples of `path`.
    pub(super) accepts: F,
}

impl<const N: usize, F: Fn(&[[f64; N]]) -> bool + Sync> AverageSearch<'_, N, F> {
    /// The shortest average with which the stage keeps up at full speed; where there is none, the one with
    /// which least has to be slowed down.
    ///
    /// Axes that may step their acceleration need no ramp. Of the others every ramp is tried that is no longer
    /// than the average, and the best pair is then made better by steps to its neighbours.
    pub(super) fn run(&self) -> RampedAverage {
        let best = self.best_of_tried_lengths();
        if best.slower <= self.enough { best } else { self.polished(best) }
    }

    /// Tries lengths from short to long, up to the first that is slow enough, or to those that leave too much.
    fn best_of_tried_lengths(&self) -> RampedAverage {
        // Several at a time, taken in order: what ends the search does not depend on the number of threads.
        const CHUNK: usize = 8;
        let needs_ramps = self.limits.iter().any(|l| l.jerk.is_finite());
        let mut best = RampedAverage { samples: 1, ramp: 1, slower: f64::INFINITY };
        // Over twice the path and more the mean moves evenly: longer averages gain nothing.
        for lengths in tried_lengths(2 * self.path.len() + 1).chunks(CHUNK) {
            let averages: Vec<Option<RampedAverage>> = parallel::map(lengths.len(), |i| {
                self.attempt(lengths[i], &tried_lengths(if needs_ramps { lengths[i] } else { 1 }))
            });
            let none_accepted = averages.iter().all(Option::is_none);
            // Invariant: `best` is the best of all shorter averages, and not yet slow enough.
            for average in averages.into_iter().flatten() {
                if average.slower < best.slower {
                    best = average;
                }
                if best.slower <= self.enough {
                    return best;
                }
            }
            // Far beyond the last that was accepted no average that slows less will be accepted again. Where none was,
            // the search ends at half of the path.
            if none_accepted && (best.slower.is_finite() || lengths[0] > self.path.len() / 2) {
                break;
            }
        }
        best
    }

    /// The best of an average with ramps from short to long, up to the first that leaves too much.
    fn attempt(&self, samples: usize, ramps: &[usize]) -> Option<RampedAverage> {
        // The ramps repeat the ends of this: before and after its samples the stage rests.
        let averaged = stage(&with_ends_held(self.path, samples / 2), Method::MovingAverage { samples });
        let tried = ramps.iter().map_while(|&ramp| self.attempt_ramp(&averaged, samples, ramp));
        tried.min_by(|a, b| a.slower.total_cmp(&b.slower))
    }

    /// The path, `averaged` over `samples` already, under one length of ramp; None where that leaves too much.
    fn attempt_ramp(&self, averaged: &[[f64; N]], samples: usize, ramp: usize) -> Option<RampedAverage> {
        let average = RampedAverage { samples, ramp, slower: f64::INFINITY };
        let lead = average.reach();
        let positions = with_ramps(with_ends_held(averaged, lead - samples / 2), ramp);
        let is_accepted = (self.accepts)(&positions[lead..positions.len() - lead]);
        is_accepted.then(|| RampedAverage { slower: slowdown(&positions, self.step_s, &self.limits), ..average })
    }

    /// An average made better by steps to its neighbours, smaller and smaller ones.
    pub(super) fn polished(&self, mut best: RampedAverage) -> RampedAverage {
        for share in STEP_SHARES {
            while let Some(better) = self.better_neighbour(&best, share) {
                best = better;
                if best.slower <= self.enough {
                    return best;
                }
            }
        }
        best
    }

    /// The best of the averages whose length, or whose ramp, is longer or shorter by a share of it, if it is better.
    fn better_neighbour(&self, average: &RampedAverage, share: f64) -> Option<RampedAverage> {
        let of_length = neighbours(average.samples, share).map(|samples| (samples, average.ramp));
        let of_ramp = neighbours(average.ramp, share).map(|ramp| (average.samples, ramp));
        let pairs: Vec<(usize, usize)> = of_length.chain(of_ramp).collect();
        let tried: Vec<Option<RampedAverage>> = parallel::map(pairs.len(), |i| self.attempt(pairs[i].0, &[pairs[i].1]));
        let best = tried.into_iter().flatten().min_by(|a, b| a.slower.total_cmp(&b.slower))?;
        (best.slower < WORTH_A_STEP * average.slower).then_some(best)
    }
}

/// How many times slower than asked some axes must follow their positions, 1 or more.
pub(super) fn slowdown<const N: usize>(positions: &[[f64; N]], step_s: f64, limits: &[Peaks; N]) -> f64 {
    (0..N).map(|k| Peaks::of(positions, k, step_s).slowed(&limits[k])).fold(1.0, f64::max)
}

/// Lengths of averages that are tried, odd: every one at first, then in steps of four tenths.
fn tried_lengths(longest: usize) -> Vec<usize> {
    let next = |n: &usize| Some((n + 2).max((n * 7 / 5) | 1)).filter(|n| *n <= longest);
    std::iter::successors(Some(1), next).collect()
}

/// The length that is longer by a share of `length`, and the one that is shorter, if there is one.
fn neighbours(length: usize, share: f64) -> impl Iterator<Item = usize> {
    // Steps are even: odd lengths stay odd.
    let step = (((length as f64 * share) as usize) & !1).max(2);
    [Some(length + step), length.checked_sub(step).filter(|n| *n > 0)].into_iter().flatten()
}

/// A path averaged twice more over `ramp` samples.
fn with_ramps<const N: usize>(averaged: Vec<[f64; N]>, ramp: usize) -> Vec<[f64; N]> {
    if ramp < 2 {
        return averaged;
    }
    let average = Method::MovingAverage { samples: ramp };
    stage(&stage(&averaged, average), average)
}

/// Samples with both ends repeated `by` times.
pub(super) fn with_ends_held<T: Copy>(samples: &[T], by: usize) -> Vec<T> {
    let [first, last] = [samples[0], samples[samples.len() - 1]].map(|end| std::iter::repeat_n(end, by));
    first.chain(samples.iter().copied()).chain(last).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tried_lengths_are_odd_and_grow_by_four_tenths() {
        assert_eq!(tried_lengths(20), [1, 3, 5, 7, 9, 13, 19]);
        assert_eq!(tried_lengths(1), [1]);
        assert_eq!(neighbours(41, 0.2).collect::<Vec<_>>(), [49, 33]);
        assert_eq!(neighbours(1, 0.2).collect::<Vec<_>>(), [3]);
    }

    #[test]
    fn average_turns_a_step_of_place_into_even_speed_between_rests() {
        let average = RampedAverage { samples: 3, ramp: 1, slower: 1.0 };
        let stage = average.of(&[[0.0], [0.0], [3.0], [3.0]], average.reach());
        assert_eq!(stage, [[0.0], [0.0], [1.0], [2.0], [3.0], [3.0]]);
    }

    #[test]
    fn search_takes_the_shortest_average_that_keeps_the_acceleration() {
        // At the turn the speed changes by 2 mm per step: over 5 samples by 0.4 each, over 3 by 0.67.
        let there_and_back: Vec<[f64; 1]> = (-50..=50).map(|i: i32| [f64::from(i.abs())]).collect();
        let limits = [Peaks { speed: 2.0, acceleration: 0.5, jerk: f64::INFINITY }];
        let search =
            AverageSearch { path: &there_and_back, step_s: 1.0, limits, enough: 1.0, accepts: |_: &[[f64; 1]]| true };
        assert_eq!(search.run(), RampedAverage { samples: 5, ramp: 1, slower: 1.0 });
        // A scanner that reaches less than a millimetre leaves the stage an average of 3 at most: 0.67 mm at the turn.
        let accepts = |stage: &[[f64; 1]]| stage.iter().zip(&there_and_back).all(|(m, p)| (p[0] - m[0]).abs() < 1.0);
        let short = AverageSearch { path: &there_and_back, step_s: 1.0, limits, enough: 1.0, accepts }.run();
        assert!(short.samples == 3 && (short.slower - (4.0f64 / 3.0).sqrt()).abs() < 1e-9, "{short:?}");
    }
}
