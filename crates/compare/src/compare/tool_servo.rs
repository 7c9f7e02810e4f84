//! A fast tool servo that turns the surface itself, for reference: another process than all other systems.
//!
//! The part turns on a spindle whose axis is vertical and stands in the middle of the texture's box; the tool goes from
//! the farthest mark to the axis on a spiral of even feed, and z follows the exact surface, a set-point in every
//! control cycle (Brecher et al.). A mesh does not do: its facets have edges, over which the jerk has no bound. So the
//! NURBS surface of the part is asked for, and held against the part's facets. Heights are those of algorithm II where
//! its net is decoupled, else of algorithm III.
//!
//! Promised: the time of the one cut, and stroke, speed, acceleration and jerk of z, as differences of set-points,
//! against what the drive makes. Units: mm, s.
//!
//! # Limits
//! The nose of the tool has no radius; spindle and feed run evenly; the approach is left out. Only places on the
//! NURBS surface count: beside it the tool may move as it likes. Of long cuts some revolutions, or stretches of long
//! ones, are looked at, spread evenly; the note says how many.

use std::ops::Range;
use terrace_core::math;

use super::follow::Follower;
use super::{Beyond, Figures, Split};
use crate::nurbs::{Decoupled, Inversion, Method, Surface};
use terrace_core::diag::{Diag, Error};
use terrace_core::machine::{Machine, Oscillation, ToolServo};
use terrace_core::motion::RestToRest;
use terrace_core::parallel;
use terrace_plan::on_the_fly::axes::following_error::{Axis, Servo};

/// Most set-points that are looked at.
const MOST: usize = 200_000;
/// Places at which the surface is held against the part.
const COMPARED: usize = 10_000;
/// A speed, mm/s, and an acceleration, mm/s², that limit nothing.
const UNLIMITED: [f64; 2] = [1e9, 1e13];

/// A figure, what is needed of it and what there is.
#[derive(Clone, Debug, PartialEq)]
pub struct Need {
    /// The name of the figure.
    pub figure: String,
    /// The unit of the figure.
    pub unit: &'static str,
    /// What the cut needs, or what the figure is.
    pub needed: f64,
    /// What the drive makes, where it is limited.
    pub limit: Option<f64>,
}

/// What a tool servo must do.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ToolFigures {
    /// The figures, in the order of the table.
    pub needs: Vec<Need>,
}

impl Figures {
    /// A figure of marks; None of a system that makes none.
    pub(super) fn of_marks<T>(&self, figure: T) -> Option<T> {
        self.tool.is_none().then_some(figure)
    }
}

/// The figures of turning the surface.
///
/// # Errors
/// `compare-tool-servo` where the machine has no tool servo, no exact surface is named, or the spiral does not lie on
/// it; `compare-nurbs` where the surface is not that of the part.
pub(super) fn turned(follower: &Follower<'_>) -> Result<Figures, Error> {
    let subject = follower.subject();
    let (tool, surface) = tool_and_surface(subject.machine, subject.exact)?;
    let inversion = Inversion::new(surface, Method::GaussNewton);
    let fit = fit(follower, surface, &inversion)?;
    let heights = Heights { decoupled: Decoupled::of(surface).ok(), inversion };
    let cut = Cut::new(Spiral::over_marks(follower, tool));
    let servo = tool.servo.map(Servo::of).transpose()?;
    let drive = Drive::of(tool);
    let peaks = cut.peaks(&heights, servo, drive.rates);
    if peaks.counted == 0 {
        let text = "the spiral of the tool has no four set-points in a row on the part";
        return Err(Diag::limit("compare-tool-servo", text).hint("check tool_servo.cycle, feed and spindle").into());
    }
    let (mut needs, beyond) = drive.needs(&peaks);
    needs.extend(cut.figures());
    if servo.is_some() {
        needs.extend(peaks.following_figures());
    }
    needs.extend(full_stroke_figures(tool));
    needs.extend(tool.oscillations.iter().map(|oscillation| jerk_of(oscillation, tool)));
    let mut notes = vec![cut.spiral.note(), fit.note(), heights.note()];
    notes.extend(cut.note());
    notes.extend(tool.oscillations.iter().filter_map(|oscillation| beyond_the_drive(oscillation, tool)));
    Ok(Figures {
        time: Split { mark: cut.time_s, ..Split::default() },
        stops: 1,
        speed: 100.0,
        within: 100.0 * (peaks.kept as f64 / peaks.counted as f64),
        beyond,
        tool: Some(ToolFigures { needs }),
        notes,
        ..Figures::default()
    })
}

/// What the system needs besides a job.
fn tool_and_surface<'a>(
    machine: &'a Machine,
    exact: Option<&'a Surface>,
) -> Result<(&'a ToolServo, &'a Surface), Error> {
    let missing = |text: &str, hint: &str| Diag::limit("compare-tool-servo", text).hint(hint);
    let tool = machine.tool_servo.as_ref().ok_or_else(|| {
        let hint = "add [tool_servo] to the machine file, or leave the system out with --systems";
        missing("the machine file states no tool servo", hint)
    })?;
    let surface = exact.ok_or_else(|| {
        let hint = "name the NURBS surface of the part with --nurbs FILE";
        missing("the jerk of a tool needs the exact surface, which a mesh is not", hint)
    })?;
    Ok((tool, surface))
}

/// The way of the tool over the part: from the farthest mark to the axis, at an even feed.
struct Spiral {
    /// Where the spindle's axis stands, mm.
    axis: [f64; 2],
    /// Distance of the farthest mark from the axis, mm.
    radius: f64,
    /// Speed of the spindle, rad/s.
    spindle: f64,
    /// Feed towards the axis, mm/s.
    feed: f64,
    /// Time from set-point to set-point, s.
    cycle: f64,
}

impl Spiral {
    /// The spiral about the middle of the texture's box.
    fn over_marks(follower: &Follower<'_>, tool: &ToolServo) -> Self {
        let area = follower.texture();
        let axis = [0, 1].map(|k| 0.5 * (area.lo[k] + area.hi[k]));
        let marks = follower.path().nodes.iter().filter(|node| node.pen.is_some());
        let radius = marks.map(|node| math::hypot(node.at[0] - axis[0], node.at[1] - axis[1])).fold(0.0, f64::max);
        let [spindle, feed, cycle] = [tool.spindle.as_rad_s(), tool.feed.as_mm_s(), tool.cycle.as_s()];
        Self { axis, radius, spindle, feed, cycle }
    }

    /// Where the tool is at a set-point, mm.
    fn at(&self, i: usize) -> [f64; 2] {
        let t = i as f64 * self.cycle;
        let (radius, (sin, cos)) = ((self.radius - self.feed * t).max(0.0), math::sin_cos(self.spindle * t));
        [self.axis[0] + radius * cos, self.axis[1] + radius * sin]
    }

    fn revolution_s(&self) -> f64 {
        std::f64::consts::TAU / self.spindle
    }

    fn note(&self) -> String {
        format!("spiral of {:.1} mm about the middle of the texture", self.radius)
    }
}

/// The one cut, and how much of it is looked at.
struct Cut {
    spiral: Spiral,
    time_s: f64,
    /// Set-points of the cut.
    set_points: usize,
    /// Set-points of a revolution.
    revolution: usize,
    /// Set-points of each run that is looked at: a revolution, where one is not too long.
    run: usize,
    /// One of so many runs is looked at.
    every: usize,
}

impl Cut {
    fn new(spiral: Spiral) -> Self {
        let time_s = spiral.radius / spiral.feed;
        let set_points = (time_s / spiral.cycle).floor() as usize + 1;
        let revolution = ((spiral.revolution_s() / spiral.cycle).round() as usize).max(4);
        let [run, every] = looked_at(set_points, revolution);
        Self { spiral, time_s, set_points, revolution, run, every }
    }

    /// The peaks of all runs that are looked at, each by itself, against limits of speed, acceleration and jerk.
    fn peaks(&self, heights: &Heights<'_>, servo: Option<Servo>, limits: [f64; 3]) -> CutPeaks {
        let runs = self.set_points.div_ceil(self.run);
        let by_run = parallel::map(runs.div_ceil(self.every), |k| {
            let first = k * self.every * self.run;
            // The run before it lets a servo settle.
            let settle = servo.map_or(0, |_| self.run.min(first));
            let run = first..(first + self.run).min(self.set_points);
            run_peaks(&self.spiral, first - settle, run, servo, limits, heights.along_a_way())
        });
        by_run.into_iter().reduce(CutPeaks::joined).expect("a cut has set-points")
    }

    /// The figures that follow from spindle, feed and cycle alone.
    fn figures(&self) -> [Need; 6] {
        let Spiral { radius, spindle, feed, cycle, .. } = self.spiral;
        let revolution_s = self.spiral.revolution_s();
        [
            figure("set-points per second", "Hz", 1.0 / cycle),
            figure("set-points", "", self.set_points as f64),
            figure("set-points per revolution", "", revolution_s / cycle),
            figure("way from set-point to set-point at the rim", "um", 1000.0 * radius * spindle * cycle),
            figure("feed per revolution", "um", 1000.0 * feed * revolution_s),
            figure("cutting speed at the rim", "mm/s", radius * spindle),
        ]
    }

    /// How much is looked at; None where it is all.
    fn note(&self) -> Option<String> {
        let Self { run, every, .. } = *self;
        let of = if run < self.revolution { format!("stretches of {run} set-points") } else { "revolutions".into() };
        (every > 1).then(|| format!("1 of {every} {of} looked at"))
    }
}

/// Heights of the exact surface.
struct Heights<'a> {
    /// By algorithm II, where the net is decoupled.
    decoupled: Option<Decoupled<'a>>,
    /// By algorithm III elsewhere.
    inversion: Inversion<'a>,
}

impl Heights<'_> {
    /// Heights at places that follow each other; None beside the surface.
    fn along_a_way(&self) -> impl FnMut([f64; 2]) -> Option<f64> {
        let mut inversion = self.inversion.clone();
        move |xy| match &self.decoupled {
            Some(decoupled) => decoupled.height(xy),
            None => inversion.next(xy).ok().map(|found| found.at[2]),
        }
    }

    fn note(&self) -> String {
        format!("heights by algorithm {}", if self.decoupled.is_some() { "II" } else { "III" })
    }
}

/// What the drive of the tool makes.
struct Drive {
    /// mm.
    stroke: f64,
    /// mm/s, mm/s², mm/s³.
    rates: [f64; 3],
}

impl Drive {
    fn of(tool: &ToolServo) -> Self {
        let speed = tool.speed.map_or(f64::INFINITY, |v| v.as_mm_s());
        let acceleration = tool.acceleration.map_or(f64::INFINITY, |a| a.as_mm_s2());
        Self { stroke: tool.stroke.as_mm(), rates: [speed, acceleration, tool.jerk_mm_s3()] }
    }

    /// What the cut needs of it, and which of that it does not make.
    fn needs(&self, peaks: &CutPeaks) -> (Vec<Need>, Vec<Beyond>) {
        let [speed, acceleration, jerk] = [0, 1, 2].map(|k| [peaks.rates[k] / 1e3, self.rates[k] / 1e3]);
        let rows = [
            ("stroke", "mm", [peaks.highest - peaks.lowest, self.stroke]),
            ("speed", "m/s", speed),
            ("acceleration", "m/s2", acceleration),
            ("jerk", "m/s3", jerk),
        ];
        let is_beyond = |[needed, limit]: [f64; 2]| needed > limit;
        let beyond = rows.iter().filter(|row| is_beyond(row.2)).map(|&(name, unit, v)| Beyond::Drive(name, unit, v));
        let needs = rows.iter().map(|&(name, unit, [needed, limit])| Need {
            figure: name.into(),
            unit,
            needed,
            limit: limit.is_finite().then_some(limit),
        });
        (needs.collect(), beyond.collect())
    }
}

/// A figure that nothing limits.
fn figure(name: &str, unit: &'static str, value: f64) -> Need {
    Need { figure: name.into(), unit, needed: value, limit: None }
}

/// The name of an oscillation that the drive is held against.
fn name_of(oscillation: &Oscillation) -> String {
    let hz = oscillation.frequency.as_khz() * 1000.0;
    format!("{} um at {hz} Hz", 1000.0 * oscillation.stroke.as_mm())
}

fn jerk_of(oscillation: &Oscillation, tool: &ToolServo) -> Need {
    let [needed, limit] = [oscillation.jerk_mm_s3(), tool.jerk_mm_s3()].map(|jerk| jerk / 1000.0);
    Need { figure: format!("jerk of {}", name_of(oscillation)), unit: "m/s3", needed, limit: Some(limit) }
}

/// What is said of an oscillation that the drive does not make.
fn beyond_the_drive(oscillation: &Oscillation, tool: &ToolServo) -> Option<String> {
    let [needed, jerk] = [oscillation.jerk_mm_s3(), tool.jerk_mm_s3()];
    let times = needed / jerk;
    (needed > jerk).then(|| format!("the drive does not make {}: {times:.2} times its jerk", name_of(oscillation)))
}

/// How many set-points each run has, and one of how many runs is looked at.
fn looked_at(all: usize, revolution: usize) -> [usize; 2] {
    let run = revolution.min(MOST);
    [run, all.div_ceil(run).div_ceil(MOST / run)]
}

/// The full stroke from rest to rest.
fn full_stroke(tool: &ToolServo) -> RestToRest {
    let speed = tool.speed.map_or(UNLIMITED[0], |v| v.as_mm_s());
    let acceleration = tool.acceleration.map_or(UNLIMITED[1], |a| a.as_mm_s2());
    RestToRest::new(tool.stroke.as_mm(), speed, acceleration, Some(tool.jerk_mm_s3()))
}

/// The figures of the full stroke.
fn full_stroke_figures(tool: &ToolServo) -> [Need; 2] {
    let full = full_stroke(tool);
    [
        figure("time of the full stroke", "ms", 1000.0 * full.total_s()),
        figure("top speed of the full stroke", "m/s", full.peak() / 1000.0),
    ]
}

/// How well the exact surface is that of the part.
struct Fit {
    /// Largest distance of the surface from the part's facets along z, mm.
    worst: f64,
    /// Points of the marks at which it was measured.
    points: usize,
}

impl Fit {
    fn note(&self) -> String {
        let Self { worst, points } = self;
        format!("at {points} points of the marks the facets lie within {:.2} um of the NURBS surface", 1000.0 * worst)
    }
}

/// Holds the exact surface against the part at points of the marks.
///
/// # Errors
/// `compare-nurbs` where it lies farther off than the defocus that is allowed, or is not there at all.
fn fit(follower: &Follower<'_>, surface: &Surface, inversion: &Inversion<'_>) -> Result<Fit, Error> {
    let allowed = follower.subject().limits.half_depth;
    let refused = |text: String| {
        let hint = "give the NURBS surface of this part, in mm and in the frame of the placed part";
        Err(Diag::limit("compare-nurbs", text).hint(hint).into())
    };
    let nodes = &follower.path().nodes;
    let mut fit = Fit { worst: 0.0, points: 0 };
    let mut inversion = inversion.clone();
    for node in nodes.iter().step_by(nodes.len().div_ceil(COMPARED).max(1)).filter(|node| node.pen.is_some()) {
        let [x, y, z] = node.at.mm;
        let Ok(found) = inversion.next([x, y]) else {
            return refused(format!("the NURBS surface is not under the mark at {x:.3}, {y:.3} mm"));
        };
        fit.worst = fit.worst.max((found.at[2] - z).abs());
        fit.points += 1;
    }
    if fit.worst > allowed {
        let ([lo, hi], worst) = (surface.hull(), fit.worst);
        return refused(format!(
            "the NURBS surface (z from {:.3} to {:.3} mm) lies up to {worst:.3} mm off the part, {allowed} mm allowed",
            lo[2], hi[2]
        ));
    }
    Ok(fit)
}

/// Peaks of set-points of a cut.
#[derive(Clone, Copy)]
struct CutPeaks {
    /// Least height, mm.
    lowest: f64,
    /// Largest height, mm.
    highest: f64,
    /// Largest size of each difference: mm/s, mm/s², mm/s³.
    rates: [f64; 3],
    /// Largest following error, mm.
    worst_following: f64,
    /// Sum of all following errors, mm.
    following_sum: f64,
    /// Set-points that count: those with three before them on the part.
    counted: usize,
    /// How many of these keep the limits.
    kept: usize,
}

impl CutPeaks {
    /// The peaks of no set-point.
    const NONE: Self = Self {
        lowest: f64::INFINITY,
        highest: f64::NEG_INFINITY,
        rates: [0.0; 3],
        worst_following: 0.0,
        following_sum: 0.0,
        counted: 0,
        kept: 0,
    };

    /// Adds a set-point: its height, the sizes of its differences, whether they keep the limits, and its following
    /// error.
    fn add(&mut self, z: f64, rates: [f64; 3], limits: [f64; 3], following: f64) {
        self.lowest = self.lowest.min(z);
        self.highest = self.highest.max(z);
        self.rates = std::array::from_fn(|k| self.rates[k].max(rates[k]));
        self.worst_following = self.worst_following.max(following);
        self.following_sum += following;
        self.counted += 1;
        self.kept += usize::from(rates.iter().zip(limits).all(|(rate, limit)| *rate <= limit));
    }

    /// The peaks of two runs together.
    fn joined(a: Self, b: Self) -> Self {
        Self {
            lowest: a.lowest.min(b.lowest),
            highest: a.highest.max(b.highest),
            rates: std::array::from_fn(|k| a.rates[k].max(b.rates[k])),
            worst_following: a.worst_following.max(b.worst_following),
            following_sum: a.following_sum + b.following_sum,
            counted: a.counted + b.counted,
            kept: a.kept + b.kept,
        }
    }

    /// The figures of the following errors.
    fn following_figures(&self) -> [Need; 2] {
        [
            figure("worst following error", "um", 1000.0 * self.worst_following),
            figure("mean following error", "um", 1000.0 * self.following_sum / self.counted as f64),
        ]
    }
}

/// Peaks of a run of set-points, of a servo that starts at rest at `settle`; `height` is None where the tool may move
/// as it likes.
fn run_peaks(
    spiral: &Spiral,
    settle: usize,
    run: Range<usize>,
    servo: Option<Servo>,
    limits: [f64; 3],
    mut height: impl FnMut([f64; 2]) -> Option<f64>,
) -> CutPeaks {
    let mut out = CutPeaks::NONE;
    let mut axis: Option<Axis> = None;
    // The last three heights, and how many set-points in a row are on the part.
    let mut before = [0.0; 3];
    let mut row = 0;
    // Three set-points of the run before, so that no difference is missed between runs.
    for i in settle.min(run.start.saturating_sub(3))..run.end {
        let Some(z) = height(spiral.at(i)) else {
            // It comes in at rest again.
            row = 0;
            axis = None;
            continue;
        };
        row += 1;
        let following = servo.map_or(0.0, |servo| {
            let axis = axis.get_or_insert_with(|| Axis::new(servo, spiral.cycle, z));
            (axis.step(z) - z).abs()
        });
        if i >= run.start && row > 3 {
            // First to third differences over the cycle's powers.
            let [a, b, c] = before;
            let differences = [z - a, z - 2.0 * a + b, z - 3.0 * a + 3.0 * b - c];
            let rates: [f64; 3] = std::array::from_fn(|k| differences[k].abs() / spiral.cycle.powi(k as i32 + 1));
            out.add(z, rates, limits, following);
        }
        before = [z, before[0], before[1]];
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_more_set_points_are_looked_at_than_the_bound() {
        assert_eq!(looked_at(1000, 300), [300, 1], "all of a short cut");
        for (all, revolution) in [(1_000_000, 300), (600_001, 150_001), (900_000_000, 60_000_000), (200_001, 200_000)] {
            let [run, every] = looked_at(all, revolution);
            let looked = all.div_ceil(run).div_ceil(every) * run;
            assert!(looked <= MOST && looked + run > MOST / 2, "{all} {revolution}: {looked}");
        }
    }
}
