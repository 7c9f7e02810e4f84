//! Empirical mode decomposition: a path as a sum of oscillations found in it, from quick to slow.
//!
//! Each coordinate is decomposed by itself. A mode is what is left of it after the mean of two cubic splines, through
//! its maxima and through its minima, was subtracted several times (sifting); the next mode is sought in what the mode
//! leaves. As a filter, the modes of short mean period are taken away, so its strength comes in steps.
//!
//! # Sources
//! Huang et al., Proc. R. Soc. A 454 (1998) 903. Ten siftings of every mode, a fixed number: Wu and Huang, Adv. Adapt.
//! Data Anal. 1 (2009) 1. Extrema mirrored about both ends: Rilling, Flandrin and Gonçalves, NSIP 2003.
//!
//! # Limits
//! Coordinates know nothing of each other: a curve may be slow in x where it is quick in y.

use crate::on_the_fly::spline;

/// Siftings of a mode.
const SIFTINGS: usize = 10;
/// Modes at most: each has about twice the mean period of the one before.
const MODES: usize = 40;
/// A rise or fall smaller than this share of the range of a coordinate is rounding.
const ROUNDING: f64 = 1e-9;

/// The modes of a path.
#[derive(Clone, Debug)]
pub(super) struct Modes<const N: usize> {
    path: Vec<[f64; N]>,
    /// Of every coordinate the modes from quick to slow, with their mean periods in samples.
    modes: [Vec<(f64, Vec<f64>)>; N],
}

impl<const N: usize> Modes<N> {
    /// Decomposes a path.
    pub(super) fn of(path: &[[f64; N]]) -> Self {
        let modes = std::array::from_fn(|k| modes(path.iter().map(|p| p[k]).collect()));
        Self { path: path.to_vec(), modes }
    }

    /// The path without its modes of a mean period shorter than `period` samples.
    pub(super) fn slow(&self, period: f64) -> Vec<[f64; N]> {
        let mut out = self.path.clone();
        for (k, modes) in self.modes.iter().enumerate() {
            for (_, mode) in modes.iter().filter(|(own, _)| *own < period) {
                out.iter_mut().zip(mode).for_each(|(p, m)| p[k] -= m);
            }
        }
        out
    }
}

/// The modes of one coordinate, with their mean periods in samples.
fn modes(mut rest: Vec<f64>) -> Vec<(f64, Vec<f64>)> {
    let [lo, hi] = rest.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], &x| [lo.min(x), hi.max(x)]);
    let rounding = ROUNDING * (hi - lo);
    let mut out = Vec::new();
    while out.len() < MODES {
        let mut mode = rest.clone();
        let mut extrema = 0;
        for _ in 0..SIFTINGS {
            let [low, high] = turning_points(&mode, rounding);
            // A maximum and two minima, or the other way round, are the least that oscillates.
            if low.len() + high.len() < 3 {
                break;
            }
            extrema = low.len() + high.len();
            let [low, high] = [low, high].map(|points| envelope(&mirrored(&points, mode.len()), mode.len()));
            mode.iter_mut().zip(low.iter().zip(&high)).for_each(|(x, (low, high))| *x -= 0.5 * (low + high));
        }
        if extrema == 0 {
            break;
        }
        rest.iter_mut().zip(&mode).for_each(|(r, m)| *r -= m);
        out.push((2.0 * mode.len() as f64 / extrema as f64, mode));
    }
    out
}

/// Places and values of the minima and of the maxima inside a line, each the middle of its plateau; rises and falls of
/// no more than `rounding` do not count.
fn turning_points(line: &[f64], rounding: f64) -> [Vec<[f64; 2]>; 2] {
    let mut out = [Vec::new(), Vec::new()];
    let Some(&start) = line.first() else { return out };
    // Where the line was lowest and highest since its last turning point.
    let mut ends = [(0, start); 2];
    let mut rises: Option<bool> = None;
    for (i, &x) in line.iter().enumerate() {
        if x < ends[0].1 {
            ends[0] = (i, x);
        }
        if x > ends[1].1 {
            ends[1] = (i, x);
        }
        let turned = if rises != Some(false) && ends[1].1 - x > rounding {
            1
        } else if rises != Some(true) && x - ends[0].1 > rounding {
            0
        } else {
            continue;
        };
        if rises.is_some() {
            let (at, value) = ends[turned];
            let is_level = |j: &usize| (line[*j] - value).abs() <= rounding;
            let first = (0..=at).rev().take_while(is_level).last().unwrap_or(at);
            let last = (at..i).take_while(is_level).last().unwrap_or(at);
            out[turned].push([0.5 * (first + last) as f64, value]);
        }
        rises = Some(turned == 0);
        ends = [(i, x); 2];
    }
    out
}

/// Turning points of one kind with those that are mirrored about the first and the last sample; where there is none,
/// nothing.
fn mirrored(points: &[[f64; 2]], samples: usize) -> Vec<[f64; 2]> {
    const BEYOND: usize = 2;
    let last = samples as f64 - 1.0;
    let before = points.iter().take(BEYOND).rev().map(|[t, x]| [-t, *x]);
    let after = points.iter().rev().take(BEYOND).map(|[t, x]| [2.0 * last - t, *x]);
    before.chain(points.iter().copied()).chain(after).collect()
}

/// The natural cubic spline through points whose places rise, around all of the samples.
fn envelope(points: &[[f64; 2]], samples: usize) -> Vec<f64> {
    let [places, values] = [0, 1].map(|k| points.iter().map(|p| p[k]).collect::<Vec<f64>>());
    let mut bends = vec![0.0; points.len()];
    spline::bends(&values, &places, 1, &mut bends);
    let mut hint = 0;
    let at = |i: usize| {
        let (k, t) = spline::cell(&places, i as f64, &mut hint);
        spline::segment([values[k], values[k + 1]], [bends[k], bends[k + 1]], places[k + 1] - places[k], t - places[k])
            [0]
    };
    (0..samples).map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn modes_sum_to_the_path_and_separate_two_waves() {
        let wave = |length: f64, i: usize| (TAU * i as f64 / length).sin();
        let path: Vec<[f64; 1]> = (0..4000).map(|i| [wave(50.0, i) + 3.0 * wave(700.0, i) + 0.01 * i as f64]).collect();
        let modes = Modes::of(&path);
        let [(first, _), (second, _), ..] = modes.modes[0][..] else { panic!("two modes") };
        assert!((first / 50.0 - 1.0).abs() < 0.02 && (second / 700.0 - 1.0).abs() < 0.1, "{first} {second}");
        assert_eq!(modes.slow(0.0), path);
        let slow = modes.slow(200.0);
        for (i, [slow]) in slow.iter().enumerate().take(3800).skip(200) {
            let off = slow - 3.0 * wave(700.0, i) - 0.01 * i as f64;
            assert!(off.abs() < 0.05, "{i}: {off}");
        }
        // What is left after all modes has no oscillation.
        let rest: Vec<f64> = modes.slow(f64::INFINITY).iter().map(|p| p[0]).collect();
        assert!(turning_points(&rest, 1e-6).iter().map(Vec::len).sum::<usize>() < 3);
    }

    #[test]
    fn plateaus_turn_in_their_middle_and_rounding_does_not_turn() {
        let line = [0.0, 1.0, 2.0, 2.0, 2.0 + 1e-12, 2.0, 1.0, 0.5, 0.5, 3.0];
        assert_eq!(turning_points(&line, 1e-9), [vec![[7.5, 0.5]], vec![[3.5, 2.0 + 1e-12]]]);
        assert!(turning_points(&[], 1e-9).iter().all(Vec::is_empty));
    }
}
