//! Scanner and stage synchronised: the stage follows the path slowly, the scanner makes up the difference.
//!
//! Consumes a scheduled path and the machine; promises a stage path that keeps the speed, acceleration and
//! jerk of X, Y and Z, a scanner path that stays in its field, and a focus that stays in its depth. Where the
//! machine cannot do that at the pens' speeds, the whole path is slowed down evenly, so that every mark still
//! gets one speed; the share of the speed that is left is part of the answer. The stage goes from rest to rest.
//! Where no motion of z keeps all marks in focus the answer says so. Units: mm, s.
//!
//! # Sources
//! Cui et al. (2021): eq. 1 to 4 the decomposition, eq. 8 and 9 the times. Their average makes the acceleration
//! step; where the machine states a jerk two more averages make it a ramp.

use crate::on_the_fly::axes::following_error::Servo;
use crate::on_the_fly::axes::motion::{Motion, Waypoint};
use crate::on_the_fly::decompose::{Method, stage};
use crate::on_the_fly::path::Path;
use crate::on_the_fly::path::schedule::Schedule;
use terrace_core::diag::Error;
use terrace_core::machine::Machine;
use terrace_core::parallel;
use terrace_core::program::{PenId, PieceId};

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
    pub fn of<const N: usize>(positions: &[[f64; N]], axis: usize, step_s: f64) -> Self {
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
        // Run k times slower, speed falls by k, acceleration by k² and jerk by k³.
        let jerk = if limits.jerk.is_finite() { (self.jerk / limits.jerk).cbrt() } else { 0.0 };
        (self.speed / limits.speed).max((self.acceleration / limits.acceleration).sqrt()).max(jerk).max(1.0)
    }
}

/// What the scanner and the focus allow, mm: half of the field, and how far a mark may be out of focus.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScannerLimits {
    /// Half of the usable field along x and y.
    pub half_field: [f64; 2],
    /// Largest focal offset of a mark.
    pub focus: f64,
}

impl ScannerLimits {
    /// What a machine leaves: of its field less the following error of its stage at top speed, but half of it at
    /// least, since that is the scanner's to take up too.
    ///
    /// # Errors
    /// As [`Servo::new`].
    pub fn of(machine: &Machine, focus: f64) -> Result<Self, Error> {
        let [x, y] = Servo::following_error(machine)?;
        let [w, h] = machine.usable_field().map(|f| f.mm() / 2.0);
        Ok(Self { half_field: [w - x.min(w / 2.0), h - y.min(h / 2.0)], focus })
    }
}

/// A path decomposed between stage and scanner.
#[derive(Clone, Debug, Default)]
pub struct Decomposition {
    /// Samples of the averages of x and y together, and of z.
    pub samples: [usize; 2],
    /// All marks are in focus; without, they are as near to it as the samples allow.
    pub fits: bool,
    /// Whether it is z that is too slow for more.
    pub z_is_slowest: bool,
    /// How much slower than the pens ask for everything runs, 1 or more.
    pub slower: f64,
    /// How long the stage moves before the beam does, and after it, s.
    pub lead_s: f64,
    /// Where the stage is at even steps, from rest to rest.
    pub stage: Vec<[f64; 3]>,
    /// Time between these, slowed.
    pub step_s: f64,
    /// Where the beam is at the same times, and whether it marks.
    pub beam: Vec<[f64; 3]>,
    /// See `beam`.
    pub on: Vec<bool>,
}

/// How much finer than asked a path may be sampled.
const FINER: [f64; 2] = [3.0, 8.0];
/// A sample nearer to a node than this is left out of a motion, s: programs count in microseconds.
const BESIDE: f64 = 5e-6;
/// Samples that averages in plan are looked for with.
const COARSE: usize = 50_000;

/// Divides a scheduled path between stage and scanner, in even steps of `step_s` or less: where marks turn sharply on a
/// slope the average of z is so short that its samples must lie closer.
pub fn synchronise(
    path: &Path,
    schedule: &Schedule,
    machine: &Machine,
    allowed: ScannerLimits,
    step_s: f64,
) -> Decomposition {
    /// With fewer samples in the window of z, its length changes in steps of a third and more.
    const ENOUGH: usize = 7;
    let mut best = decomposed(path, schedule, machine, allowed, step_s, f64::INFINITY);
    for finer in FINER {
        if best.fits && (best.samples[1] >= ENOUGH || best.slower <= 1.0 || !best.z_is_slowest) {
            break;
        }
        let next = decomposed(path, schedule, machine, allowed, step_s / finer, f64::INFINITY);
        if next.fits && (!best.fits || next.slower < best.slower) {
            best = next;
        }
    }
    best
}

/// Divides a scheduled path between stage and scanner (Cui et al. eq. 1 to 3), in even steps of `step_s` or a little
/// less. Gives up, and answers that nothing fits, if everything would have to run `cutoff` times slower or more.
pub(super) fn decomposed(
    path: &Path,
    schedule: &Schedule,
    machine: &Machine,
    allowed: ScannerLimits,
    step_s: f64,
    cutoff: f64,
) -> Decomposition {
    let [x, y, z] = Peaks::limits(machine);
    let beam = Beam::new(path, schedule, step_s);
    let xy = xy_average(&beam, [x, y], allowed.half_field);
    if xy.slower >= cutoff {
        return Decomposition { slower: xy.slower, ..Decomposition::default() };
    }
    // What x and y are slowed down to is slow enough for z.
    let focused = |stage: &[[f64; 1]]| beam.is_in_focus(stage, allowed.focus);
    let search = Search { path: &beam.height, step_s: beam.step_s, limits: [z], enough: xy.slower, fits: focused };
    let z_average = search.run();
    // Both rest at both ends for as long as the longer average reaches, so that they begin and end together.
    let lead = xy.reach().max(z_average.reach());
    let (stage_xy, stage_z) = (xy.of(&beam.plan, lead), z_average.of(&beam.height, lead));
    let slower = xy.slower.max(slowed(&stage_z, beam.step_s, &[z]));
    let step_s = beam.step_s * slower;
    Decomposition {
        samples: [xy.samples, z_average.samples],
        fits: z_average.slower.is_finite(),
        z_is_slowest: slower > xy.slower,
        slower,
        lead_s: lead as f64 * step_s,
        stage: stage_xy.iter().zip(&stage_z).map(|(&[x, y], &[z])| [x, y, z]).collect(),
        step_s,
        beam: held(&beam.at, lead),
        on: [vec![false; lead], beam.on, vec![false; lead]].concat(),
    }
}

/// The shortest average of x and y with which the stage keeps up and the scanner stays in its field; where there is
/// none, the one with which least has to be slowed down.
fn xy_average(beam: &Beam<'_>, limits: [Peaks; 2], half_field: [f64; 2]) -> Choice {
    // The field is wide, so the average is looked for on fewer samples first.
    let every = (beam.plan.len() / COARSE).max(1);
    let few: Vec<[f64; 2]> = beam.plan.iter().copied().step_by(every).collect();
    let fits = |stage: &[[f64; 2]]| beam.is_in_field(stage, &few, every, half_field);
    let coarse = Search { path: &few, step_s: beam.step_s * every as f64, limits, enough: 1.0, fits }.run();
    let fine = Choice { samples: (coarse.samples * every) | 1, ramp: (coarse.ramp * every) | 1, ..coarse };
    let mut xy = shortened_into_field(beam, fine, half_field);
    xy.slower = slowed(&xy.of(&beam.plan, xy.reach()), beam.step_s, &limits);
    // All samples may see sharper turns than few.
    if xy.slower > 1.02 * coarse.slower {
        let fits = |stage: &[[f64; 2]]| beam.is_in_field(stage, &beam.plan, 1, half_field);
        let search = Search { path: &beam.plan, step_s: beam.step_s, limits, enough: coarse.slower, fits };
        xy = search.polished(xy);
    }
    xy
}

/// The average shortened until the scanner stays in its field at all samples and all nodes: with one of a single
/// sample the stage carries the beam itself.
fn shortened_into_field(beam: &Beam<'_>, mut xy: Choice, half_field: [f64; 2]) -> Choice {
    let fits = |c: &Choice| {
        let stage = c.of(&beam.plan, c.reach());
        beam.is_in_field(&stage[c.reach()..], &beam.plan, 1, half_field)
    };
    while xy.samples > 1 && !fits(&xy) {
        (xy.samples, xy.ramp) = (xy.samples * 19 / 20, (xy.ramp * 19 / 20).max(1));
    }
    xy
}

/// Where the beam is along a scheduled path.
struct Beam<'a> {
    /// At even steps, mm; in plan and in height too.
    at: Vec<[f64; 3]>,
    plan: Vec<[f64; 2]>,
    height: Vec<[f64; 1]>,
    /// Whether it marks there.
    on: Vec<bool>,
    step_s: f64,
    nodes: Nodes<'a>,
}

impl<'a> Beam<'a> {
    fn new(path: &'a Path, schedule: &Schedule, step_s: f64) -> Self {
        let even = schedule.samples(path, step_s);
        Self {
            plan: even.at.iter().map(|p| [p[0], p[1]]).collect(),
            height: even.at.iter().map(|p| [p[2]]).collect(),
            nodes: Nodes::of(path, schedule, even.step_s),
            at: even.at,
            on: even.on,
            step_s: even.step_s,
        }
    }

    /// Whether what a stage leaves of x and y lies in the field, at the samples `path` of the plan, every `every`th of
    /// all, and at all nodes.
    fn is_in_field(&self, stage: &[[f64; 2]], path: &[[f64; 2]], every: usize, half: [f64; 2]) -> bool {
        stage.iter().zip(path).all(|(m, p)| (0..2).all(|k| (p[k] - m[k]).abs() <= half[k]))
            && self.nodes.all(false, |at, p| {
                let m = between(stage, at / every as f64);
                (0..2).all(|k| (p[k] - m[k]).abs() <= half[k] * (1.0 + 1e-9))
            })
    }

    /// Whether what a stage leaves of z is in focus, at all samples and nodes of marks.
    fn is_in_focus(&self, stage: &[[f64; 1]], focus: f64) -> bool {
        (0..stage.len()).all(|i| !self.on[i] || (self.height[i][0] - stage[i][0]).abs() <= focus)
            && self.nodes.all(true, |at, p| (p[2] - between(stage, at)[0]).abs() <= focus * (1.0 + 1e-9))
    }
}

/// When the beam comes to the nodes of its path and leaves them, in samples.
struct Nodes<'a> {
    path: &'a Path,
    times: Vec<[f64; 2]>,
}

impl<'a> Nodes<'a> {
    fn of(path: &'a Path, schedule: &Schedule, step_s: f64) -> Self {
        let times = schedule.visits.iter().map(|v| [v.arrive / step_s, v.leave / step_s]).collect();
        Self { path, times }
    }

    /// Whether all nodes hold, or all of marks.
    fn all(&self, marks: bool, holds: impl Fn(f64, &[f64; 3]) -> bool) -> bool {
        let lit = |i: usize| self.path.pen_at(i).is_some();
        self.times.iter().enumerate().all(|(i, [arrive, leave])| {
            // A mark ends as the beam comes and begins as it goes.
            let come = !marks || lit(i);
            let go = !marks || lit(i + 1);
            let at = &self.path.nodes[i].at;
            (!come || holds(*arrive, at)) && (!go || (come && arrive == leave) || holds(*leave, at))
        })
    }
}

/// A value between samples.
#[inline]
fn between<const N: usize>(made: &[[f64; N]], at: f64) -> [f64; N] {
    let last = made.len() - 1;
    let at = at.clamp(0.0, last as f64);
    let i = (at as usize).min(last.saturating_sub(1));
    let (a, b, t) = (made[i], made[(i + 1).min(last)], at - i as f64);
    std::array::from_fn(|k| a[k] + t * (b[k] - a[k]))
}

/// How much slower than asked some axes follow their positions.
fn slowed<const N: usize>(made: &[[f64; N]], step_s: f64, limits: &[Peaks; N]) -> f64 {
    (0..N).map(|k| Peaks::of(made, k, step_s).slowed(&limits[k])).fold(1.0, f64::max)
}

/// Samples of the averages that are tried: every odd number at first, then in steps of four tenths.
fn back_off(longest: usize) -> Vec<usize> {
    let next = |p: &usize| Some((p + 2).max((p * 7 / 5) | 1)).filter(|p| *p <= longest);
    std::iter::successors(Some(1), next).collect()
}

/// An average, averaged twice more.
fn with_ramp<const N: usize>(once: Vec<[f64; N]>, ramp: usize) -> Vec<[f64; N]> {
    if ramp < 2 {
        return once;
    }
    let twice = Method::MovingAverage { samples: ramp };
    stage(&stage(&once, twice), twice)
}

/// Both ends repeated.
fn held<T: Copy>(list: &[T], by: usize) -> Vec<T> {
    let [first, last] = [list[0], list[list.len() - 1]].map(|end| std::iter::repeat_n(end, by));
    first.chain(list.iter().copied()).chain(last).collect()
}

/// An average and its ramp in samples, and how much slower than asked the stage follows it.
#[derive(Clone, Copy, Debug)]
struct Choice {
    samples: usize,
    ramp: usize,
    slower: f64,
}

impl Choice {
    /// Samples to each side that a sample of the stage depends on.
    fn reach(&self) -> usize {
        self.samples / 2 + 2 * (self.ramp / 2)
    }

    /// A path that rests for `lead` samples at both ends, averaged, and twice more: a step of speed becomes a ramp of
    /// acceleration, and a step of place, as a quick jump is, one of speed. It begins and ends at rest where `lead` is
    /// [`Choice::reach`] or more.
    fn of<const N: usize>(&self, path: &[[f64; N]], lead: usize) -> Vec<[f64; N]> {
        // Each average turns a step of one derivative into a ramp of it over its samples.
        with_ramp(stage(&held(path, lead), Method::MovingAverage { samples: self.samples }), self.ramp)
    }
}

/// A search for the average of some coordinates together.
struct Search<'a, const N: usize, F> {
    path: &'a [[f64; N]],
    step_s: f64,
    limits: [Peaks; N],
    /// What is slow enough.
    enough: f64,
    /// Whether what is left for the others is little enough.
    fits: F,
}

impl<const N: usize, F: Fn(&[[f64; N]]) -> bool + std::marker::Sync> Search<'_, N, F> {
    /// What comes of an average with ramps from short to long, up to the first that does not fit; the best of them.
    fn attempt(&self, samples: usize, ramps: &[usize]) -> Option<Choice> {
        // Before and after these samples the stage rests.
        let once = stage(&held(self.path, samples / 2), Method::MovingAverage { samples });
        let with = |&ramp: &usize| {
            let choice = Choice { samples, ramp, slower: f64::INFINITY };
            let lead = choice.reach();
            let made = with_ramp(held(&once, lead - samples / 2), ramp);
            let fits = (self.fits)(&made[lead..made.len() - lead]);
            fits.then(|| Choice { slower: slowed(&made, self.step_s, &self.limits), ..choice })
        };
        ramps.iter().map_while(with).min_by(|a, b| a.slower.total_cmp(&b.slower))
    }

    /// The shortest average with which the stage keeps up at full speed; where there is none, the one with
    /// which least has to be slowed down.
    ///
    /// Axes that may step their acceleration need no ramp. Of the others every ramp is tried that is no longer
    /// than the average, and the best pair is then made better by steps to its neighbours.
    fn run(&self) -> Choice {
        // Some at a time, in order: what ends the search does not depend on the number of threads.
        const SOME: usize = 8;
        let jerks = self.limits.iter().any(|l| l.jerk.is_finite());
        let mut best = Choice { samples: 1, ramp: 1, slower: f64::INFINITY };
        for some in back_off(2 * self.path.len() + 1).chunks(SOME) {
            let of = |&samples: &usize| self.attempt(samples, &back_off(if jerks { samples } else { 1 }));
            let found: Vec<Option<Choice>> = parallel::map(some.len(), |i| of(&some[i]));
            let misses = found.iter().all(Option::is_none);
            for choice in found.into_iter().flatten() {
                if choice.slower < best.slower {
                    best = choice;
                }
                if best.slower <= self.enough {
                    return best;
                }
            }
            // Far beyond what fits nothing will fit again that slows less.
            if misses && (best.slower.is_finite() || some[0] > self.path.len() / 2) {
                break;
            }
        }
        self.polished(best)
    }

    /// Steps to neighbours, smaller and smaller ones, while that is quicker.
    fn polished(&self, mut best: Choice) -> Choice {
        for share in [0.2, 0.1, 0.05] {
            let by = |n: usize| (((n as f64 * share) as usize) & !1).max(2);
            loop {
                let (p, r) = (by(best.samples), by(best.ramp));
                let longer = |n: usize, by: usize| [Some(n + by), n.checked_sub(by).filter(|n| *n > 0)];
                let mut near: Vec<(usize, usize)> = Vec::new();
                near.extend(longer(best.samples, p).into_iter().flatten().map(|p| (p, best.ramp)));
                near.extend(longer(best.ramp, r).into_iter().flatten().map(|r| (best.samples, r)));
                let found: Vec<Option<Choice>> = parallel::map(near.len(), |i| self.attempt(near[i].0, &[near[i].1]));
                let next = found.into_iter().flatten().min_by(|a, b| a.slower.total_cmp(&b.slower));
                // Gains of a thousandth are not worth a step.
                match next.filter(|n| n.slower < 0.999 * best.slower) {
                    Some(next) => best = next,
                    None => break,
                }
                if best.slower <= self.enough {
                    return best;
                }
            }
        }
        best
    }
}

impl Decomposition {
    /// Where the stage is at a time: straight between its samples.
    fn stage_at(&self, time: f64) -> [f64; 3] {
        between(&self.stage, time / self.step_s)
    }

    /// Where the stage is when the beam comes to each node of its path, or leaves it where a mark begins.
    pub fn nodes(&self, path: &Path, schedule: &Schedule) -> Vec<[f64; 3]> {
        let time = schedule
            .visits
            .iter()
            .zip(&path.nodes)
            .map(|(v, node)| if node.pen.is_some() { v.arrive } else { v.leave });
        time.map(|t| self.stage_at(self.lead_s + t * self.slower)).collect()
    }

    /// The motion of all axes: at the nodes of the path, and where the stage's own samples lie.
    pub fn motion(&self, path: &Path, schedule: &Schedule) -> Motion {
        let mut motion = Motion::default();
        let mut sample = 0;
        let mut until = |time: f64, pen: Option<PenId>, stroke: PieceId, motion: &mut Motion| {
            while sample < self.stage.len() && sample as f64 * self.step_s < time {
                let now = sample as f64 * self.step_s;
                // Beside a node a sample says nothing.
                if time - now > BESIDE && now - motion.waypoints.last().map_or(f64::NEG_INFINITY, |w| w.time) > BESIDE {
                    push(motion, now, self.stage[sample], self.beam[sample], pen, stroke);
                }
                sample += 1;
            }
        };
        for i in 0..path.len() {
            let (pen, stroke) = (path.nodes[i].pen, path.nodes[i].stroke);
            let [come, go] =
                [schedule.visits[i].arrive, schedule.visits[i].leave].map(|t| self.lead_s + t * self.slower);
            until(come, pen, stroke, &mut motion);
            push(&mut motion, come, self.stage_at(come), path.nodes[i].at, pen, stroke);
            if go > come {
                until(go, None, stroke, &mut motion);
                push(&mut motion, go, self.stage_at(go), path.nodes[i].at, None, stroke);
            }
        }
        until(f64::INFINITY, None, path.nodes[path.len() - 1].stroke, &mut motion);
        motion
    }
}

fn push(motion: &mut Motion, time: f64, stage: [f64; 3], at: [f64; 3], pen: Option<PenId>, stroke: PieceId) {
    if motion.waypoints.last().is_some_and(|w| w.time == time) {
        return;
    }
    let [x, y, z] = stage;
    let axes = [x, y, z, 0.0, 0.0, at[0] - x, at[1] - y];
    motion.waypoints.push(Waypoint { time, axes, pen, stroke });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_match_the_article() {
        let (stops, move_s, process_s) = (8, 3.71, 38.27);
        let (stepped, synchronised) = (step_scan_s(stops, move_s, process_s), synchronised_s(move_s, process_s));
        assert!((stepped - 67.95).abs() < 1e-9 && (synchronised - 41.98).abs() < 1e-9);
        let saved = 100.0 * (stepped - synchronised) / stepped;
        assert_eq!(format!("{saved:.2}"), "38.22");
    }

    #[test]
    fn peaks_match_a_parabola_and_scale_with_speed_by_their_order() {
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
