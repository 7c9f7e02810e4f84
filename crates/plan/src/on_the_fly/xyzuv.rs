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

mod average_search;

use crate::on_the_fly::axes::following_error::Servo;
use crate::on_the_fly::axes::motion::{Motion, Waypoint};
use crate::on_the_fly::path::Path;
use crate::on_the_fly::path::schedule::Schedule;
use crate::on_the_fly::xyzuv::average_search::{AverageSearch, RampedAverage, slowdown, with_ends_held};
use terrace_core::diag::Error;
use terrace_core::geom::P3Mm;
use terrace_core::machine::Machine;
use terrace_core::math;
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

    /// The peaks of one coordinate of positions at even steps, by their differences.
    pub fn of<const N: usize>(positions: &[[f64; N]], axis: usize, step_s: f64) -> Self {
        // Largest first to third differences.
        let [mut most_d1, mut most_d2, mut most_d3] = [0.0f64; 3];
        let [mut last_d1, mut last_d2] = [0.0; 2];
        for (i, w) in positions.windows(2).enumerate() {
            let d1 = w[1][axis] - w[0][axis];
            let d2 = d1 - last_d1;
            let d3 = d2 - last_d2;
            most_d1 = most_d1.max(d1.abs());
            // What was before the samples is not known: a difference counts from where it lies within them.
            if i > 0 {
                most_d2 = most_d2.max(d2.abs());
            }
            if i > 1 {
                most_d3 = most_d3.max(d3.abs());
            }
            last_d1 = d1;
            last_d2 = d2;
        }
        Self { speed: most_d1 / step_s, acceleration: most_d2 / step_s.powi(2), jerk: most_d3 / step_s.powi(3) }
    }

    /// How many times slower the motion must run to keep `limits`; 1 where it keeps them.
    pub fn slowed(&self, limits: &Self) -> f64 {
        // Run k times slower, speed falls by k, acceleration by k² and jerk by k³.
        let jerk = if limits.jerk.is_finite() { math::cbrt(self.jerk / limits.jerk) } else { 0.0 };
        (self.speed / limits.speed).max((self.acceleration / limits.acceleration).sqrt()).max(jerk).max(1.0)
    }
}

/// What the scanner and the focus allow, mm: half of the field, and how far a mark may be out of focus.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScannerLimits {
    /// Half of the usable field along x and y.
    pub half_field: [f64; 2],
    /// Largest focal offset of a mark.
    pub half_depth: f64,
}

impl ScannerLimits {
    /// What a machine allows: its field less the following error of its stage at top speed, which the scanner makes up
    /// too, but half of the field at least.
    ///
    /// # Errors
    /// `fly-servo` where frequency or damping of a servo is not positive and finite.
    pub fn of(machine: &Machine, half_depth: f64) -> Result<Self, Error> {
        let [error_x, error_y] = Servo::following_error(machine)?;
        let [half_x, half_y] = machine.half_usable_field_mm();
        Ok(Self { half_field: [half_x - error_x.min(half_x / 2.0), half_y - error_y.min(half_y / 2.0)], half_depth })
    }
}

/// A path decomposed between stage and scanner.
#[derive(Clone, Debug, Default)]
pub struct Decomposition {
    /// Samples of the average of x and y together, and of that of z.
    pub samples: [usize; 2],
    /// All marks are in focus; otherwise they are as near to it as the samples allow.
    pub fits: bool,
    /// Whether z is slower than x and y, so that it sets the speed.
    pub z_is_slowest: bool,
    /// How many times slower than the pens ask for everything runs, 1 or more.
    pub slower: f64,
    /// How long the stage moves before the beam does, and after it, s.
    pub lead_s: f64,
    /// Where the stage is at even steps, from rest to rest.
    pub stage: Vec<[f64; 3]>,
    /// Time between two samples of `stage`, at the slowed speed.
    pub step_s: f64,
    /// Where the beam is at the same times.
    pub beam: Vec<[f64; 3]>,
    /// Whether the beam marks at the same times.
    pub on: Vec<bool>,
}

/// How many times finer than asked a path may be sampled for the average of z, one after the other.
const FINER: [f64; 2] = [3.0, 8.0];
/// A sample nearer to a node than this is left out of a motion, s: programs count in microseconds.
const BESIDE: f64 = 5e-6;
/// About so many samples are enough to look for the average of x and y.
const COARSE: usize = 50_000;
/// All samples are searched too if they ask for more slowing down than the coarse ones by this factor.
const SHARPER: f64 = 1.02;
/// Share of a limit that rounding may add at a node, where the stage lies between two samples.
const ROUNDED: f64 = 1e-9;

/// Divides a scheduled path between stage and scanner, in even steps of `step_s` or less: where marks turn sharply on a
/// slope the average of z is so short that its samples must lie closer.
pub fn synchronise(
    path: &Path,
    schedule: &Schedule,
    machine: &Machine,
    allowed: ScannerLimits,
    step_s: f64,
) -> Decomposition {
    /// Lengths of averages are odd: below 7 samples the next one is longer by a third and more.
    const ENOUGH: usize = 7;
    let mut best = decomposed(path, schedule, machine, allowed, step_s, f64::INFINITY);
    for finer in FINER {
        // Finer samples help only where z sets the speed, with an average of few samples.
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
    let beam = ScheduledBeam::new(path, schedule, step_s);
    let xy_average = find_xy_average(&beam, [x, y], allowed.half_field);
    if xy_average.slower >= cutoff {
        return Decomposition { slower: xy_average.slower, ..Decomposition::default() };
    }
    let z_average = find_z_average(&beam, z, allowed.half_depth, xy_average.slower);
    decomposed_by(beam, xy_average, z_average, z)
}

/// The shortest average of x and y with which the stage keeps up and the scanner stays in its field; where there is
/// none, the one with which least has to be slowed down.
fn find_xy_average(beam: &ScheduledBeam<'_>, limits: [Peaks; 2], half_field: [f64; 2]) -> RampedAverage {
    let coarse = find_coarse_xy_average(beam, limits, half_field);
    let mut average = shortened_into_field(beam, coarse, half_field);
    average.slower = slowdown(&average.of(&beam.plan, average.reach()), beam.step_s, &limits);
    // All samples may show sharper turns than the coarse ones.
    if average.slower > SHARPER * coarse.slower {
        average = polished_on_all_samples(beam, average, coarse.slower, limits, half_field);
    }
    average
}

/// The average of x and y that is best on some of the samples, in samples of the whole plan. The field is wide, so its
/// average is long, and coarse samples show it.
fn find_coarse_xy_average(beam: &ScheduledBeam<'_>, limits: [Peaks; 2], half_field: [f64; 2]) -> RampedAverage {
    let every = (beam.plan.len() / COARSE).max(1);
    let coarse_plan: Vec<[f64; 2]> = beam.plan.iter().copied().step_by(every).collect();
    let search = AverageSearch {
        path: &coarse_plan,
        step_s: beam.step_s * every as f64,
        limits,
        enough: 1.0,
        accepts: |stage: &[[f64; 2]]| beam.is_in_field(stage, &coarse_plan, every, half_field),
    };
    let found = search.run();
    // Lengths stay odd, so that an average has a sample in its middle.
    RampedAverage { samples: (found.samples * every) | 1, ramp: (found.ramp * every) | 1, ..found }
}

/// The average shortened until the scanner stays in its field at all samples and all nodes. An average of one sample is
/// always short enough: with it the stage carries the beam itself.
fn shortened_into_field(beam: &ScheduledBeam<'_>, mut average: RampedAverage, half_field: [f64; 2]) -> RampedAverage {
    while average.samples > 1 && !keeps_scanner_in_field(beam, &average, half_field) {
        average.samples = average.samples * 19 / 20;
        average.ramp = (average.ramp * 19 / 20).max(1);
    }
    average
}

/// Whether the scanner stays in its field at all samples and all nodes if the stage follows an average.
fn keeps_scanner_in_field(beam: &ScheduledBeam<'_>, average: &RampedAverage, half_field: [f64; 2]) -> bool {
    let lead = average.reach();
    let stage = average.of(&beam.plan, lead);
    beam.is_in_field(&stage[lead..], &beam.plan, 1, half_field)
}

/// The average of x and y made better on all samples, until it needs no more slowing down than `enough`.
fn polished_on_all_samples(
    beam: &ScheduledBeam<'_>,
    average: RampedAverage,
    enough: f64,
    limits: [Peaks; 2],
    half_field: [f64; 2],
) -> RampedAverage {
    let search = AverageSearch {
        path: &beam.plan,
        step_s: beam.step_s,
        limits,
        enough,
        accepts: |stage: &[[f64; 2]]| beam.is_in_field(stage, &beam.plan, 1, half_field),
    };
    search.polished(average)
}

/// The average of z that keeps all marks in focus, with which least has to be slowed down; infinitely slow where none
/// does. What x and y are slowed down to, `enough`, is slow enough.
fn find_z_average(beam: &ScheduledBeam<'_>, limits: Peaks, half_depth: f64, enough: f64) -> RampedAverage {
    let search = AverageSearch {
        path: &beam.height,
        step_s: beam.step_s,
        limits: [limits],
        enough,
        accepts: |stage: &[[f64; 1]]| beam.is_in_focus(stage, half_depth),
    };
    search.run()
}

/// A beam's path divided by averages, with everything slowed down to the slowest of X, Y and Z.
fn decomposed_by(
    beam: ScheduledBeam<'_>,
    xy_average: RampedAverage,
    z_average: RampedAverage,
    z_limits: Peaks,
) -> Decomposition {
    // All axes rest at both ends for as long as the longer average reaches, so that they begin and end together.
    let lead = xy_average.reach().max(z_average.reach());
    let stage_xy = xy_average.of(&beam.plan, lead);
    let stage_z = z_average.of(&beam.height, lead);
    let slower = xy_average.slower.max(slowdown(&stage_z, beam.step_s, &[z_limits]));
    let step_s = beam.step_s * slower;
    Decomposition {
        samples: [xy_average.samples, z_average.samples],
        fits: z_average.slower.is_finite(),
        z_is_slowest: slower > xy_average.slower,
        slower,
        lead_s: lead as f64 * step_s,
        stage: stage_xy.iter().zip(&stage_z).map(|(&[x, y], &[z])| [x, y, z]).collect(),
        step_s,
        beam: with_ends_held(&beam.positions, lead),
        on: [vec![false; lead], beam.is_on, vec![false; lead]].concat(),
    }
}

/// Where the beam is along a scheduled path.
struct ScheduledBeam<'a> {
    /// At even steps, mm.
    positions: Vec<[f64; 3]>,
    /// x and y of `positions`.
    plan: Vec<[f64; 2]>,
    /// z of `positions`.
    height: Vec<[f64; 1]>,
    /// Whether the beam marks at each sample.
    is_on: Vec<bool>,
    /// Time between samples, at the pens' speeds.
    step_s: f64,
    nodes: NodeTimes<'a>,
}

impl<'a> ScheduledBeam<'a> {
    fn new(path: &'a Path, schedule: &Schedule, step_s: f64) -> Self {
        let samples = schedule.samples(path, step_s);
        Self {
            plan: samples.at.iter().map(|p| [p[0], p[1]]).collect(),
            height: samples.at.iter().map(|p| [p[2]]).collect(),
            nodes: NodeTimes::new(path, schedule, samples.step_s),
            positions: samples.at,
            is_on: samples.on,
            step_s: samples.step_s,
        }
    }

    /// Whether what a stage leaves of x and y lies in the field, at the samples `plan`, every `every`th of all, and at
    /// all nodes: these lie between samples, and a corner there would be missed.
    fn is_in_field(&self, stage: &[[f64; 2]], plan: &[[f64; 2]], every: usize, half_field: [f64; 2]) -> bool {
        stage.iter().zip(plan).all(|(m, p)| (0..2).all(|k| (p[k] - m[k]).abs() <= half_field[k]))
            && self.nodes.all(|sample, p| {
                let m = interpolated(stage, sample / every as f64);
                (0..2).all(|k| (p[k] - m[k]).abs() <= half_field[k] * (1.0 + ROUNDED))
            })
    }

    /// Whether what a stage leaves of z is in focus, at all samples and nodes of marks.
    fn is_in_focus(&self, stage: &[[f64; 1]], half_depth: f64) -> bool {
        (0..stage.len()).all(|i| !self.is_on[i] || (self.height[i][0] - stage[i][0]).abs() <= half_depth)
            && self
                .nodes
                .all_of_marks(|sample, p| (p[2] - interpolated(stage, sample)[0]).abs() <= half_depth * (1.0 + ROUNDED))
    }
}

/// When the beam comes to the nodes of its path and leaves them, counted in samples.
struct NodeTimes<'a> {
    path: &'a Path,
    /// Arrival at each node and departure from it.
    times: Vec<[f64; 2]>,
}

impl<'a> NodeTimes<'a> {
    fn new(path: &'a Path, schedule: &Schedule, step_s: f64) -> Self {
        let times = schedule.visits.iter().map(|v| [v.arrive / step_s, v.leave / step_s]).collect();
        Self { path, times }
    }

    /// Whether a condition on time, in samples, and place holds at all nodes, as the beam comes and as it leaves.
    fn all(&self, holds: impl Fn(f64, P3Mm) -> bool) -> bool {
        self.times
            .iter()
            .zip(&self.path.nodes)
            .all(|(&[arrive, leave], node)| holds(arrive, node.at) && (arrive == leave || holds(leave, node.at)))
    }

    /// Whether the condition holds wherever a mark ends or begins: one ends as the beam comes to a node, and one begins
    /// as it leaves.
    fn all_of_marks(&self, holds: impl Fn(f64, P3Mm) -> bool) -> bool {
        self.times.iter().enumerate().all(|(i, &[arrive, leave])| {
            let mark_ends = self.path.pen_at(i).is_some();
            let mark_begins = self.path.pen_at(i + 1).is_some();
            let place = self.path.nodes[i].at;
            let is_same_time = mark_ends && arrive == leave;
            (!mark_ends || holds(arrive, place)) && (!mark_begins || is_same_time || holds(leave, place))
        })
    }
}

/// A value between samples; before the first and after the last, theirs.
#[inline]
fn interpolated<const N: usize>(samples: &[[f64; N]], at: f64) -> [f64; N] {
    let last = samples.len() - 1;
    let at = at.clamp(0.0, last as f64);
    let i = (at as usize).min(last.saturating_sub(1));
    let (a, b) = (samples[i], samples[(i + 1).min(last)]);
    let t = at - i as f64;
    std::array::from_fn(|k| a[k] + t * (b[k] - a[k]))
}

impl Decomposition {
    /// Where the stage is at a time: straight between its samples.
    fn stage_at(&self, time: f64) -> [f64; 3] {
        interpolated(&self.stage, time / self.step_s)
    }

    /// A time of the schedule, at the pens' speeds, as one of the motion, which begins before it and is slowed down.
    fn motion_time(&self, scheduled_s: f64) -> f64 {
        self.lead_s + scheduled_s * self.slower
    }

    /// Where the stage is when the beam comes to each node of its path, or leaves it where a mark begins.
    pub fn nodes(&self, path: &Path, schedule: &Schedule) -> Vec<[f64; 3]> {
        let time = schedule
            .visits
            .iter()
            .zip(&path.nodes)
            .map(|(v, node)| if node.pen.is_some() { v.arrive } else { v.leave });
        time.map(|t| self.stage_at(self.motion_time(t))).collect()
    }

    /// The motion of all axes: at the nodes of the path, and where the stage's own samples lie.
    pub fn motion(&self, path: &Path, schedule: &Schedule) -> Motion {
        let mut motion = GrowingMotion { decomposition: self, motion: Motion::default(), next_sample: 0 };
        for (node, visit) in path.nodes.iter().zip(&schedule.visits) {
            let arrive = self.motion_time(visit.arrive);
            let leave = self.motion_time(visit.leave);
            motion.add_samples_before(arrive, node.pen, node.stroke);
            motion.add_waypoint(arrive, self.stage_at(arrive), node.at.mm, node.pen, node.stroke);
            // The beam waits at the node with the laser off, while the stage moves on.
            if leave > arrive {
                motion.add_samples_before(leave, None, node.stroke);
                motion.add_waypoint(leave, self.stage_at(leave), node.at.mm, None, node.stroke);
            }
        }
        // After the last node the stage comes to rest.
        motion.add_samples_before(f64::INFINITY, None, path.nodes[path.len() - 1].stroke);
        motion.motion
    }
}

/// The motion of a decomposition up to a time.
struct GrowingMotion<'a> {
    decomposition: &'a Decomposition,
    motion: Motion,
    /// The first of the stage's samples that the motion has not come to.
    next_sample: usize,
}

impl GrowingMotion<'_> {
    /// Adds the stage's samples before a time, all on a stretch of the pen and the stroke.
    fn add_samples_before(&mut self, time: f64, pen: Option<PenId>, stroke: PieceId) {
        let Decomposition { stage, beam, step_s, .. } = self.decomposition;
        while self.next_sample < stage.len() && self.next_sample as f64 * step_s < time {
            let now = self.next_sample as f64 * step_s;
            let last = self.motion.waypoints.last().map_or(f64::NEG_INFINITY, |w| w.time);
            if time - now > BESIDE && now - last > BESIDE {
                self.add_waypoint(now, stage[self.next_sample], beam[self.next_sample], pen, stroke);
            }
            self.next_sample += 1;
        }
    }

    /// Adds where the stage and the beam are at a time, unless the motion has come to that time before.
    fn add_waypoint(&mut self, time: f64, stage: [f64; 3], beam: [f64; 3], pen: Option<PenId>, stroke: PieceId) {
        if self.motion.waypoints.last().is_some_and(|w| w.time == time) {
            return;
        }
        let [x, y, z] = stage;
        let axes = [x, y, z, 0.0, 0.0, beam[0] - x, beam[1] - y];
        self.motion.waypoints.push(Waypoint { time, axes, pen, stroke });
    }
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
