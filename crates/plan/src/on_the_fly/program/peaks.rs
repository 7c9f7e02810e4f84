//! Peak speed, acceleration and jerk of every axis, by the differences of a program's samples.
//!
//! Moves are straight between samples, so the program itself steps in speed at every one; what is measured is
//! the motion that the samples stand for. *Speed*: of every move. *Acceleration* and *jerk*: divided
//! differences of samples, 2 x[t0, t1, t2] and 6 x[t0, t1, t2, t3]; by the mean value theorem every smooth
//! motion through these samples reaches at least that much between the first and the last of them. The samples
//! taken are at least `APART_A` and `APART_J` apart, the next one of the program after that time each:
//! closer ones would measure the nanometre of their rounding. Before its first and after its last sample a
//! program rests. From each difference is taken what rounding of
//! the samples to a nanometre (or millionth of a degree) may have put there.
//!
//! # Limits
//! Peaks that last shorter than the samples lie apart are seen only in part.

use crate::on_the_fly::axes::motion::AXES;
use crate::on_the_fly::program::{AxisCommands, Program};

/// Least time between samples of which accelerations are taken, us.
pub(crate) const APART_A: i64 = 5_000;
/// Least time between samples of which jerks are taken, us.
pub(crate) const APART_J: i64 = 10_000;
/// What rounding may put on a sample, nm or millionths of a degree.
const ROUNDING: f64 = 1.0;

/// A figure and when it is reached, s.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Peak {
    /// The size of the peak: mm or degrees, per s, s2 or s3.
    pub size: f64,
    /// When.
    pub at_s: f64,
}

impl Peak {
    fn raise(&mut self, size: f64, us: i64) {
        if size > self.size {
            *self = Self { size, at_s: us as f64 / 1e6 };
        }
    }
}

/// Largest figures of one axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Peaks {
    /// Speed.
    pub speed: Peak,
    /// Acceleration.
    pub acceleration: Peak,
    /// Jerk.
    pub jerk: Peak,
}

/// The last samples that lie far enough apart.
struct Window<const N: usize> {
    apart: i64,
    us: [i64; N],
    at: [AxisCommands; N],
}

impl<const N: usize> Window<N> {
    fn new(apart: i64, start: AxisCommands) -> Self {
        Self { apart, us: std::array::from_fn(|i| (i as i64 + 1 - N as i64) * apart), at: [start; N] }
    }

    /// Takes a sample if it lies far enough from the last; returns whether it did.
    fn takes(&mut self, us: i64, at: &AxisCommands) -> bool {
        if us - self.us[N - 1] < self.apart {
            return false;
        }
        self.us.rotate_left(1);
        self.at.rotate_left(1);
        (self.us[N - 1], self.at[N - 1]) = (us, *at);
        true
    }

    /// (N - 1)! times the divided difference of an axis, less what rounding may have put there.
    fn difference(&self, axis: usize) -> f64 {
        let (mut sum, mut slack) = (0.0, 0.0);
        for i in 0..N {
            let others = (0..N).filter(|&j| j != i);
            let product: f64 = others.map(|j| (self.us[i] - self.us[j]) as f64 * 1e-6).product();
            // Differences from the first sample are small and exact.
            sum += (self.at[i][axis] - self.at[0][axis]) as f64 / product;
            slack += ROUNDING / product.abs();
        }
        let times: f64 = (1..N).map(|k| k as f64).product();
        times * (sum.abs() - slack).max(0.0) * 1e-6
    }
}

/// The largest figures of every axis of a program.
pub fn peaks(program: &Program) -> [Peaks; AXES] {
    let mut out = [Peaks::default(); AXES];
    let mut three = Window::<3>::new(APART_A, program.start);
    let mut four = Window::<4>::new(APART_J, program.start);
    for (us, from, to) in program.steps() {
        let time = (to.us - us) as f64;
        for (k, peak) in out.iter_mut().enumerate() {
            let way = ((to.to[k] - from[k]).abs() as f64 - 2.0 * ROUNDING).max(0.0);
            peak.speed.raise(way / time, us);
        }
    }
    let end = program.moves.last().copied();
    let rest = |apart: i64| end.into_iter().flat_map(move |m| (1..=3).map(move |k| (m.us + k * apart, m.to)));
    let samples = || program.moves.iter().map(|m| (m.us, m.to));
    for (us, to) in samples().chain(rest(APART_A)) {
        if three.takes(us, &to) {
            out.iter_mut().enumerate().for_each(|(k, p)| p.acceleration.raise(three.difference(k), three.us[1]));
        }
    }
    for (us, to) in samples().chain(rest(APART_J)) {
        if four.takes(us, &to) {
            out.iter_mut().enumerate().for_each(|(k, p)| p.jerk.raise(four.difference(k), four.us[1]));
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::on_the_fly::program::{Kind, Move};
    use terrace_core::machine::Origin;
    use terrace_core::math;

    #[test]
    fn peak_rates_of_smooth_motions_match_closed_forms() {
        // x = 3 mm (1 - cos 20 t)^2 from rest to rest, samples at uneven times.
        let mut us = 0;
        let at = |us: i64| {
            let x = 3.0 * (1.0 - math::cos(us as f64 * 20e-6)).powi(2);
            AxisCommands([(x * 1e6).round() as i64, 0, 0, 0, 0, 0, 0])
        };
        let mut moves = Vec::new();
        while us < 628_319 {
            us = (us + 90 + 37 * (moves.len() as i64 % 5)).min(628_319);
            moves.push(Move { us, to: at(us), mark: None });
        }
        let program = Program { kind: Kind::Xyzuv, pens: Vec::new(), origin: Origin::default(), start: at(0), moves };
        let [x, ..] = peaks(&program);
        let near = |is: f64, is_at_most: f64, share: f64| is <= is_at_most && is > share * is_at_most;
        assert!(near(x.speed.size, 155.89, 0.999) && near(x.acceleration.size, 4800.0, 0.99), "{x:?}");
        assert!(near(x.jerk.size, 131_350.0, 0.93), "{x:?}");
    }

    #[test]
    fn peak_rates_of_a_speed_step_scale_with_its_duration() {
        // At rest, then 100 mm/s from one sample to the next.
        let to = |i: i64| AxisCommands([(i - 100).max(0) * 100_000; AXES]);
        let moves = (1..=200i64).map(|i| Move { us: i * 1000, to: to(i), mark: None });
        let program = Program {
            kind: Kind::Xyzacuv,
            pens: Vec::new(),
            origin: Origin::default(),
            start: AxisCommands::default(),
            moves: moves.collect(),
        };
        let found = peaks(&program)[0];
        assert!((found.acceleration.size - 100.0 / 0.005).abs() < 1.0, "{found:?}");
        assert!((found.acceleration.at_s - 0.1).abs() < 1e-9);
    }
}
