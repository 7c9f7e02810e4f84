//! Scanner and stage synchronised: the stage follows the path slowly, the scanner makes up the difference.
//!
//! Consumes a scheduled path and the machine; promises a stage path that keeps the speed, acceleration and
//! jerk of X, Y and Z, a scanner path that stays in its field, and a focus that stays in its depth. Where the
//! machine cannot do that at the pens' speeds, the whole path is slowed down evenly, so that every mark still
//! gets one speed; the share of the speed that is left is part of the answer. Units: mm, s.
//!
//! # Sources
//! Cui et al. (2021): eq. 1 to 4 the decomposition, eq. 8 and 9 the times. Their average makes the acceleration
//! step; where the machine states a jerk a second, shorter average makes it a ramp.

use rayon::prelude::*;

use super::decompose::{Method, rms_acceleration, stage};
use super::motion::Motion;
use super::path::Path;
use super::schedule::{Samples, Schedule};
use crate::machine::Machine;

/// Time of a job that steps through `stops` and processes between moves (eq. 8).
pub fn step_scan_s(stops: usize, move_s: f64, process_s: f64) -> f64 {
    stops as f64 * move_s + process_s
}

/// Time of the same job with scanner and stage synchronised (eq. 9).
pub fn synchronised_s(move_s: f64, process_s: f64) -> f64 {
    move_s + process_s
}

/// Largest speed, acceleration and jerk of an axis; a jerk that is not limited is infinite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Peaks {
    /// Speed, mm/s.
    pub speed: f64,
    /// Acceleration, mm/s².
    pub acceleration: f64,
    /// Jerk, mm/s³.
    pub jerk: f64,
}

impl Peaks {
    /// The limits of X, Y and Z.
    pub fn limits(machine: &Machine) -> [Self; 3] {
        machine.axes().map(|(_, axis)| Self {
            speed: axis.speed.as_mm_s(),
            acceleration: axis.acceleration.as_mm_s2(),
            jerk: axis.jerk.map_or(f64::INFINITY, |j| j.as_mm_s3()),
        })
    }

    /// Of one coordinate of positions at even steps, by their differences.
    pub fn of(positions: &[[f64; 3]], axis: usize, step_s: f64) -> Self {
        let (mut most, mut last) = ([0.0f64; 3], [0.0; 2]);
        for (i, w) in positions.windows(2).enumerate() {
            let speed = w[1][axis] - w[0][axis];
            let (acceleration, jerk) = (speed - last[0], speed - last[0] - last[1]);
            most[0] = most[0].max(speed.abs());
            // It begins at rest where it begins to be seen.
            if i > 0 {
                most[1] = most[1].max(acceleration.abs());
            }
            if i > 1 {
                most[2] = most[2].max(jerk.abs());
            }
            last = [speed, acceleration];
        }
        Self { speed: most[0] / step_s, acceleration: most[1] / step_s.powi(2), jerk: most[2] / step_s.powi(3) }
    }

    /// How much slower the motion must run to keep `limits`; 1 where it keeps them.
    pub fn slowed(&self, limits: &Self) -> f64 {
        let jerk = if limits.jerk.is_finite() { (self.jerk / limits.jerk).cbrt() } else { 0.0 };
        (self.speed / limits.speed).max((self.acceleration / limits.acceleration).sqrt()).max(jerk).max(1.0)
    }
}

/// What the scanner and the focus allow, mm: half of the field, and how far a mark may be out of focus.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Room {
    /// Half of the usable field along x and y.
    pub half_field: [f64; 2],
    /// Largest focal offset of a mark.
    pub focus: f64,
}

/// A path shared out between stage and scanner.
#[derive(Clone, Debug, Default)]
pub struct Sync {
    /// Samples of the averages of x and y together, and of z.
    pub samples: [usize; 2],
    /// How much slower than the pens ask for everything runs, 1 or more.
    pub slower: f64,
    /// Where the stage is at even steps.
    pub stage: Vec<[f64; 3]>,
    /// Time between these, slowed.
    pub step_s: f64,
    /// Where the beam is at the same times, and whether it marks.
    pub beam: Vec<[f64; 3]>,
    /// See `beam`.
    pub on: Vec<bool>,
    /// Root of the mean squared acceleration of the stage, mm/s².
    pub rms_acceleration: f64,
    /// All axes, timed, at the nodes of the path and at even steps.
    pub motion: Motion,
}

/// Shares a scheduled path out, in even steps of `step_s` or a little less.
pub fn synchronise(path: &Path, schedule: &Schedule, machine: &Machine, room: Room, step_s: f64) -> Sync {
    let limits = Peaks::limits(machine);
    let even = schedule.samples(path, step_s);
    let mut tight = room;
    // Corners lie between samples: where one of them leaves the field, the samples get less of it.
    for _ in 0..TIGHTER {
        let (stage, samples, slower) = averaged(&even, &limits, tight);
        let out = Sync { samples, slower, stage, step_s: even.step_s * slower, ..Sync::default() };
        let over = out.over(path, schedule, room);
        if over.iter().all(|&o| o <= 0.0) {
            return out.timed(path, schedule, even);
        }
        for (half, over) in tight.half_field.iter_mut().zip(over) {
            *half = (*half - 1.05 * over).max(0.1 * *half);
        }
        tight.focus = (tight.focus - 1.05 * over[2]).max(0.1 * tight.focus);
    }
    // The stage that follows every sample leaves nothing to the scanner.
    let slower = (0..3).map(|axis| Peaks::of(&even.at, axis, even.step_s).slowed(&limits[axis])).fold(1.0, f64::max);
    let out = Sync { samples: [1, 1], slower, stage: even.at.clone(), step_s: even.step_s * slower, ..Sync::default() };
    out.timed(path, schedule, even)
}

/// How often the field is made tighter.
const TIGHTER: usize = 6;

/// Samples of the averages that are tried: every odd number at first, then in steps of four tenths.
fn ladder(longest: usize) -> Vec<usize> {
    let next = |p: &usize| Some((p + 2).max((p * 7 / 5) | 1)).filter(|p| *p <= longest);
    std::iter::successors(Some(1), next).collect()
}

/// The time in which the slowest of some axes builds its acceleration up; 0 where it may step.
fn build_up(limits: &[Peaks; 3], axes: &[usize]) -> f64 {
    axes.iter().map(|&k| limits[k].acceleration / limits[k].jerk).fold(0.0, f64::max)
}

/// A path averaged twice more: a step of speed becomes a ramp of acceleration, and a step of place, as a quick
/// jump is, one of speed.
fn ramped(path: Vec<[f64; 3]>, samples: usize) -> Vec<[f64; 3]> {
    if samples < 2 {
        return path;
    }
    stage(&stage(&path, Method::MovingAverage { samples }), Method::MovingAverage { samples })
}

/// One search for an average.
struct Search<'a> {
    even: &'a Samples,
    /// Which coordinates are averaged together.
    axes: &'a [usize],
    limits: &'a [Peaks; 3],
    /// What is slow enough.
    enough: f64,
}

impl Search<'_> {
    fn make(&self, samples: usize, ramp: usize) -> Vec<[f64; 3]> {
        ramped(stage(&self.even.at, Method::MovingAverage { samples }), ramp)
    }

    /// The shortest average with which the stage keeps up at full speed; where there is none, the one with
    /// which least has to be slowed down. `fits` tells whether what is left for the others is little enough.
    ///
    /// Further averages, as long as the stage takes to build its acceleration up, make that a ramp. Slowed down,
    /// that is fewer samples: they are found in a few rounds, and shortened where they alone are too much.
    fn run(&self, fits: impl Fn(&[[f64; 3]]) -> bool + std::marker::Sync) -> (usize, f64, Vec<[f64; 3]>) {
        const ROUNDS: usize = 3;
        let build_up = build_up(self.limits, self.axes);
        let without = self.limits.map(|l| Peaks { jerk: f64::INFINITY, ..l });
        let (mut samples, mut slower) = self.best(1, &without, &fits);
        let mut ramp = 1;
        if build_up > 0.0 {
            let mut wanted = (build_up / (slower * self.even.step_s)).ceil() as usize;
            let mut best: Option<(usize, f64, usize)> = None;
            for _ in 0..ROUNDS {
                wanted = wanted.clamp(1, self.even.at.len());
                let (p, slow) = self.best(wanted, self.limits, &fits);
                if slow.is_finite() && best.is_none_or(|b| slow < b.1) {
                    best = Some((p, slow, wanted));
                }
                let next = if slow.is_finite() { build_up / (slow * self.even.step_s) } else { wanted as f64 / 4.0 };
                if next.ceil() as usize == wanted {
                    break;
                }
                wanted = next.ceil() as usize;
            }
            (samples, slower, ramp) = best.unwrap_or_else(|| {
                let (p, slow) = self.best(1, self.limits, &fits);
                (p, slow, 1)
            });
        }
        (samples, slower, self.make(samples, ramp))
    }

    fn best(
        &self,
        ramp: usize,
        limits: &[Peaks; 3],
        fits: &(impl Fn(&[[f64; 3]]) -> bool + std::marker::Sync),
    ) -> (usize, f64) {
        // Some at a time, in order: what ends the search does not depend on the number of threads.
        const SOME: usize = 8;
        let mut best = (1, f64::INFINITY);
        for some in ladder(2 * self.even.at.len() + 1).chunks(SOME) {
            let found: Vec<Option<f64>> = some
                .par_iter()
                .map(|&samples| {
                    let made = self.make(samples, ramp);
                    let slowed = |&k: &usize| Peaks::of(&made, k, self.even.step_s).slowed(&limits[k]);
                    fits(&made).then(|| self.axes.iter().map(slowed).fold(1.0, f64::max))
                })
                .collect();
            let misses = found.iter().all(Option::is_none);
            for (&samples, slower) in some.iter().zip(found).filter_map(|(p, f)| Some((p, f?))) {
                if slower < best.1 {
                    best = (samples, slower);
                }
                if best.1 <= self.enough {
                    return best;
                }
            }
            // Far beyond what fits nothing will fit again that slows less.
            if misses && (best.1.is_finite() || some[0] > self.even.at.len() / 2) {
                break;
            }
        }
        best
    }
}

fn averaged(even: &Samples, limits: &[Peaks; 3], room: Room) -> (Vec<[f64; 3]>, [usize; 2], f64) {
    let far = |made: &[[f64; 3]], k: usize, i: usize| (even.at[i][k] - made[i][k]).abs();
    let (p, slower, mut path) = Search { even, axes: &[0, 1], limits, enough: 1.0 }.run(|made| {
        (0..made.len()).all(|i| far(made, 0, i) <= room.half_field[0] && far(made, 1, i) <= room.half_field[1])
    });
    // What x and y are slowed down to is slow enough for z.
    let (p_z, slower_z, z) = Search { even, axes: &[2], limits, enough: slower }
        .run(|made| (0..made.len()).all(|i| !even.on[i] || far(made, 2, i) <= room.focus));
    path.iter_mut().zip(z).for_each(|(p, z)| p[2] = z[2]);
    (path, [p, p_z], slower.max(slower_z))
}

impl Sync {
    /// Where the stage is at a time: straight between its samples.
    fn stage_at(&self, time: f64) -> [f64; 3] {
        let last = self.stage.len() - 1;
        let at = (time / self.step_s).clamp(0.0, last as f64);
        let i = (at as usize).min(last.saturating_sub(1));
        let (a, b, t) = (self.stage[i], self.stage[(i + 1).min(last)], at - i as f64);
        [0, 1, 2].map(|c| a[c] + t * (b[c] - a[c]))
    }

    /// Where the stage is when the beam comes to each node of its path.
    pub fn nodes(&self, schedule: &Schedule) -> Vec<[f64; 3]> {
        schedule.arrive.iter().map(|&t| self.stage_at(t * self.slower)).collect()
    }

    /// By how much the beam leaves the field along x and y at the nodes of its path, and marks the focus.
    fn over(&self, path: &Path, schedule: &Schedule, room: Room) -> [f64; 3] {
        let half = [room.half_field[0], room.half_field[1], room.focus];
        let mut over = [0.0; 3];
        for i in 0..path.len() {
            for time in [schedule.arrive[i], schedule.leave[i]] {
                let at = self.stage_at(time * self.slower);
                for k in 0..3 {
                    let marks = path.pen[i].is_some() || path.pen.get(i + 1).is_some_and(Option::is_some);
                    if k < 2 || marks {
                        over[k] = f64::max(over[k], (path.at[i][k] - at[k]).abs() - half[k] * (1.0 + 1e-9));
                    }
                }
            }
        }
        over
    }

    /// The motion of all axes: at the nodes of the path, and where the stage's own samples lie.
    fn timed(mut self, path: &Path, schedule: &Schedule, even: Samples) -> Self {
        self.rms_acceleration = rms_acceleration(&self.stage, self.step_s);
        let mut motion = Motion::default();
        let mut sample = 0;
        for i in 0..path.len() {
            let mut until = |self_: &Self, time: f64, pen: Option<u16>, motion: &mut Motion| {
                while sample < self_.stage.len() && sample as f64 * self_.step_s < time {
                    let at = even.at[sample];
                    push(motion, sample as f64 * self_.step_s, self_.stage[sample], at, pen, path.stroke[i]);
                    sample += 1;
                }
            };
            let waits = schedule.leave[i] > schedule.arrive[i];
            let (come, go) = (schedule.arrive[i] * self.slower, schedule.leave[i] * self.slower);
            until(&self, come, path.pen[i], &mut motion);
            push(&mut motion, come, self.stage_at(come), path.at[i], path.pen[i], path.stroke[i]);
            if waits {
                until(&self, go, None, &mut motion);
                push(&mut motion, go, self.stage_at(go), path.at[i], None, path.stroke[i]);
            }
        }
        self.motion = motion;
        (self.beam, self.on) = (even.at, even.on);
        self
    }
}

fn push(motion: &mut Motion, time: f64, stage: [f64; 3], at: [f64; 3], pen: Option<u16>, stroke: u32) {
    if motion.time.last() == Some(&time) {
        return;
    }
    let [x, y, z] = stage;
    motion.time.push(time);
    motion.axes.push([x, y, z, 0.0, 0.0, at[0] - x, at[1] - y]);
    motion.pen.push(pen);
    motion.stroke.push(stroke);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_times_of_the_article() {
        let (stops, move_s, process_s) = (8, 3.71, 38.27);
        let (stepped, synchronised) = (step_scan_s(stops, move_s, process_s), synchronised_s(move_s, process_s));
        assert!((stepped - 67.95).abs() < 1e-9 && (synchronised - 41.98).abs() < 1e-9);
        let saved = 100.0 * (stepped - synchronised) / stepped;
        assert_eq!(format!("{saved:.2}"), "38.22");
    }

    #[test]
    fn peaks_are_those_of_a_parabola_and_slow_down_by_their_own_powers() {
        let step_s = 0.01;
        let at: Vec<[f64; 3]> = (0..200).map(|i| f64::from(i) * step_s).map(|t| [3.0 * t * t, -5.0 * t, 0.0]).collect();
        let [x, y, z] = [0, 1, 2].map(|axis| Peaks::of(&at, axis, step_s));
        assert!((x.acceleration - 6.0).abs() < 1e-6 && x.jerk < 1e-3 && (x.speed - 6.0 * 1.985).abs() < 1e-6);
        assert!((y.speed - 5.0).abs() < 1e-9 && y.acceleration < 1e-6);
        assert_eq!(z, Peaks { speed: 0.0, acceleration: 0.0, jerk: 0.0 });
        let limits = Peaks { speed: 1e9, acceleration: 1.5, jerk: f64::INFINITY };
        assert!((x.slowed(&limits) - 2.0).abs() < 1e-6, "half the speed is a quarter of the acceleration");
        assert_eq!(y.slowed(&limits), 1.0);
    }
}
