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
            let [low, high] = [low, high].map(|points| Spline::through(mirrored(&points, mode.len())));
            for (i, x) in mode.iter_mut().enumerate() {
                *x -= 0.5 * (low.at(i as f64) + high.at(i as f64));
            }
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

/// A natural cubic spline.
struct Spline {
    knots: Vec<[f64; 2]>,
    /// Second derivatives at the knots.
    bends: Vec<f64>,
}

impl Spline {
    /// Through knots whose places rise; one at least.
    fn through(knots: Vec<[f64; 2]>) -> Self {
        // Thomas's algorithm for the tridiagonal system of the second derivatives, 0 at both ends.
        let n = knots.len();
        let mut bends = vec![0.0; n];
        let mut upper = vec![0.0; n];
        for i in 1..n.saturating_sub(1) {
            let [g, h] = [knots[i][0] - knots[i - 1][0], knots[i + 1][0] - knots[i][0]];
            let slope = |i: usize, h: f64| (knots[i + 1][1] - knots[i][1]) / h;
            let pivot = 2.0 * (g + h) - g * upper[i - 1];
            upper[i] = h / pivot;
            bends[i] = (6.0 * (slope(i, h) - slope(i - 1, g)) - g * bends[i - 1]) / pivot;
        }
        for i in (1..n.saturating_sub(1)).rev() {
            bends[i] -= upper[i] * bends[i + 1];
        }
        Self { knots, bends }
    }

    fn at(&self, t: f64) -> f64 {
        let knots = &self.knots;
        let next = knots.partition_point(|k| k[0] <= t).clamp(1, (knots.len() - 1).max(1));
        let ([a, x], Some(&[b, y])) = (knots[next - 1], knots.get(next)) else { return knots[0][1] };
        let h = b - a;
        let [q, p] = [(t - a) / h, (b - t) / h];
        p * x + q * y + ((p.powi(3) - p) * self.bends[next - 1] + (q.powi(3) - q) * self.bends[next]) * h * h / 6.0
    }
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
    fn spline_meets_its_knots_and_the_closed_form_of_three() {
        let spline = Spline::through(vec![[0.0, 0.0], [1.0, 1.0], [2.0, 0.0]]);
        // 3/2 t - 1/2 t^3 on the first half.
        for t in [0.0, 0.25, 0.5, 1.0] {
            assert!((spline.at(t) - (1.5 * t - 0.5 * t.powi(3))).abs() < 1e-14, "{t}");
            assert!((spline.at(2.0 - t) - spline.at(t)).abs() < 1e-14, "{t}");
        }
    }

    #[test]
    fn plateaus_turn_in_their_middle_and_rounding_does_not_turn() {
        let line = [0.0, 1.0, 2.0, 2.0, 2.0 + 1e-12, 2.0, 1.0, 0.5, 0.5, 3.0];
        assert_eq!(turning_points(&line, 1e-9), [vec![[7.5, 0.5]], vec![[3.5, 2.0 + 1e-12]]]);
        assert!(turning_points(&[], 1e-9).iter().all(Vec::is_empty));
    }
}
