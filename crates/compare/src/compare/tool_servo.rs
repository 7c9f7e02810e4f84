//! A fast tool servo that turns the surface itself, for reference: another process than all other systems.
//!
//! The part turns on a spindle whose axis is vertical and stands in the middle of the texture's box; the tool goes from
//! the farthest mark to the axis on a spiral of even feed, and z follows the exact surface, a set-point in every control
//! cycle (Brecher et al.). A mesh does not do: its facets have edges, over which the jerk has no bound. So the NURBS
//! surface of the part is asked for, and held against the part's facets. Heights are those of algorithm II where its
//! net is decoupled, else of algorithm III.
//!
//! Promised: the time of the one cut, and stroke, speed, acceleration and jerk of z, as differences of set-points,
//! against what the drive makes. Units: mm, s.
//!
//! # Limits
//! The nose of the tool has no radius; spindle and feed run evenly; the approach is left out. Only places on the
//! NURBS surface count: beside it the tool may move as it likes. Of long cuts some revolutions, or stretches of long
//! ones, are looked at, spread evenly; the note says how many.

use std::ops::Range;

use super::follow::Follower;
use super::{Beyond, Figures, Split};
use crate::nurbs::{Decoupled, Inversion, Method, Surface};
use terrace_core::diag::{Diag, Error};
use terrace_core::machine::ToolServo;
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
    /// Its name.
    pub figure: String,
    /// Its unit.
    pub unit: &'static str,
    /// What the cut needs, or what the figure is.
    pub needed: f64,
    /// What the drive makes, where it is limited.
    pub limit: Option<f64>,
}

/// What a tool servo must do.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ToolFigures {
    /// Its figures, in the order of the table.
    pub needs: Vec<Need>,
}

impl Figures {
    /// A figure of marks; None of a system that makes none.
    pub(super) fn of_marks<T>(&self, figure: T) -> Option<T> {
        self.tool.is_none().then_some(figure)
    }
}

/// Peaks of a run of set-points.
#[derive(Clone, Copy)]
struct Peaks {
    /// Least and largest height, mm.
    z: [f64; 2],
    /// Largest size of each difference: mm/s, mm/s², mm/s³.
    rates: [f64; 3],
    /// Largest following error, and the sum of all, mm.
    following: [f64; 2],
    /// Set-points that count, and how many of them keep the limits.
    counts: [usize; 2],
}

/// The spiral.
struct Spiral {
    axis: [f64; 2],
    radius: f64,
    /// rad/s.
    turns: f64,
    /// mm/s.
    feed: f64,
    /// s.
    cycle: f64,
}

impl Spiral {
    /// Where the tool is at a set-point.
    fn at(&self, i: usize) -> [f64; 2] {
        let t = i as f64 * self.cycle;
        let (radius, (sin, cos)) = ((self.radius - self.feed * t).max(0.0), (self.turns * t).sin_cos());
        [self.axis[0] + radius * cos, self.axis[1] + radius * sin]
    }
}

/// Turning the surface.
pub(super) fn turned(follower: &Follower<'_>) -> Result<Figures, Error> {
    let subject = follower.subject();
    let Some(tool) = subject.machine.tool_servo.as_ref() else {
        return Err(Diag::limit("compare-tool-servo", "the machine file states no tool servo")
            .hint("add [tool_servo] to the machine file, or leave the system out with --systems")
            .into());
    };
    let Some(surface) = subject.exact else {
        return Err(Diag::limit(
            "compare-tool-servo",
            "the jerk of a tool needs the exact surface, and a mesh is none",
        )
        .hint("name the NURBS surface of the part with --nurbs FILE")
        .into());
    };
    let decoupled = Decoupled::of(surface).ok();
    let inversion = Inversion::new(surface, Method::GaussNewton);
    let (off, compared) = distance(follower, surface, &inversion)?;
    let area = follower.texture();
    let axis = [0, 1].map(|k| 0.5 * (area.lo[k] + area.hi[k]));
    let marks = follower.path().nodes.iter().filter(|node| node.pen.is_some());
    let radius = marks.map(|node| (node.at[0] - axis[0]).hypot(node.at[1] - axis[1])).fold(0.0, f64::max);
    let spiral =
        Spiral { axis, radius, turns: tool.spindle.as_rad_s(), feed: tool.feed.as_mm_s(), cycle: tool.cycle.as_s() };
    let time_s = radius / spiral.feed;
    let revolution_s = std::f64::consts::TAU / spiral.turns;
    let all = (time_s / spiral.cycle).floor() as usize + 1;
    let revolution = ((revolution_s / spiral.cycle).round() as usize).max(4);
    let [run, every] = looked_at(all, revolution);
    let runs = all.div_ceil(run);
    let servo = tool.servo.map(Servo::of).transpose()?;
    let jerk = tool.jerk_mm_s3();
    let limits = [
        tool.speed.map_or(f64::INFINITY, |v| v.as_mm_s()),
        tool.acceleration.map_or(f64::INFINITY, |a| a.as_mm_s2()),
        jerk,
    ];
    // Each run, of a revolution where one is not too long, is looked at by itself; the one before it lets a servo settle.
    let found = parallel::map(runs.div_ceil(every), |k| {
        let first = k * every * run;
        let settle = servo.map_or(0, |_| run.min(first));
        let mut warm = inversion.clone();
        let height = |xy: [f64; 2]| match &decoupled {
            Some(decoupled) => decoupled.height(xy),
            None => warm.next(xy).ok().map(|found| found.at[2]),
        };
        peaks(&spiral, first - settle, first..(first + run).min(all), servo, limits, height)
    });
    let whole = found.into_iter().reduce(joined).expect("a cut has set-points");
    let [counted, kept] = whole.counts;
    if counted == 0 {
        let text = "the spiral of the tool has no four set-points in a row on the part";
        return Err(Diag::limit("compare-tool-servo", text).hint("check tool_servo.cycle, feed and spindle").into());
    }
    let stroke = whole.z[1] - whole.z[0];
    let mut beyond = Vec::new();
    let mut needs = Vec::new();
    for (figure, unit, by, needed, limit) in [
        ("stroke", "mm", 1.0, stroke, tool.stroke.as_mm()),
        ("speed", "m/s", 1e3, whole.rates[0], limits[0]),
        ("acceleration", "m/s2", 1e3, whole.rates[1], limits[1]),
        ("jerk", "m/s3", 1e3, whole.rates[2], limits[2]),
    ] {
        let [needed, limit] = [needed, limit].map(|v| v / by);
        if needed > limit {
            beyond.push(Beyond::Drive(figure, unit, [needed, limit]));
        }
        needs.push(Need { figure: figure.into(), unit, needed, limit: limit.is_finite().then_some(limit) });
    }
    let mut figure = |name: &str, unit, needed| needs.push(Need { figure: name.into(), unit, needed, limit: None });
    figure("set-points per second", "Hz", 1.0 / spiral.cycle);
    figure("set-points", "", all as f64);
    figure("set-points per revolution", "", revolution_s / spiral.cycle);
    figure("way from set-point to set-point at the rim", "um", 1000.0 * radius * spiral.turns * spiral.cycle);
    figure("feed per revolution", "um", 1000.0 * spiral.feed * revolution_s);
    figure("cutting speed at the rim", "mm/s", radius * spiral.turns);
    if servo.is_some() {
        figure("worst following error", "um", 1000.0 * whole.following[0]);
        figure("mean following error", "um", 1000.0 * whole.following[1] / counted as f64);
    }
    let full = full_stroke(tool);
    figure("time of the full stroke", "ms", 1000.0 * full.total_s());
    figure("top speed of the full stroke", "m/s", full.peak() / 1000.0);
    let mut notes = vec![
        format!("spiral of {radius:.1} mm about the middle of the texture"),
        format!("at {compared} points of the marks the facets lie within {:.2} um of the NURBS surface", 1000.0 * off),
        format!("heights by algorithm {}", if decoupled.is_some() { "II" } else { "III" }),
    ];
    if every > 1 {
        let of = if run < revolution { format!("stretches of {run} set-points") } else { "revolutions".into() };
        notes.push(format!("1 of {every} {of} looked at"));
    }
    for oscillation in &tool.oscillations {
        let [stroke, hz] = [oscillation.stroke.as_mm(), oscillation.frequency.as_khz() * 1000.0];
        let name = format!("{} um at {hz} Hz", 1000.0 * stroke);
        let needed = oscillation.jerk_mm_s3();
        if needed > jerk {
            notes.push(format!("the drive does not make {name}: {:.2} times its jerk", needed / jerk));
        }
        needs.push(Need {
            figure: format!("jerk of {name}"),
            unit: "m/s3",
            needed: needed / 1000.0,
            limit: Some(jerk / 1000.0),
        });
    }
    Ok(Figures {
        time: Split { mark: time_s, ..Split::default() },
        stops: 1,
        speed: 100.0,
        within: 100.0 * (kept as f64 / counted as f64),
        beyond,
        tool: Some(ToolFigures { needs }),
        notes,
        ..Figures::default()
    })
}

/// Of how many set-points each run is that is looked at, and of how many runs one.
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

/// How far the surface lies off the part at points of the marks at most, mm, and at how many of these.
///
/// # Errors
/// `compare-tool-servo` where it is beyond the focal offset that is allowed, or the surface is not there at all.
fn distance(follower: &Follower<'_>, surface: &Surface, inversion: &Inversion<'_>) -> Result<(f64, usize), Error> {
    let allowed = follower.subject().limits.focus;
    let refused = |text: String| {
        let hint = "give the NURBS surface of this part, in mm and in the frame of the placed part";
        Err(Diag::limit("compare-nurbs", text).hint(hint).into())
    };
    let nodes = &follower.path().nodes;
    let (mut worst, mut compared) = (0.0f64, 0);
    let mut inversion = inversion.clone();
    for node in nodes.iter().step_by(nodes.len().div_ceil(COMPARED).max(1)).filter(|node| node.pen.is_some()) {
        let [x, y, z] = node.at;
        let Ok(found) = inversion.next([x, y]) else {
            return refused(format!("the NURBS surface is not under the mark at {x:.3}, {y:.3} mm"));
        };
        worst = worst.max((found.at[2] - z).abs());
        compared += 1;
    }
    if worst > allowed {
        let [lo, hi] = surface.hull();
        return refused(format!(
            "the NURBS surface (z from {:.3} to {:.3} mm) lies up to {worst:.3} mm off the part, {allowed} mm allowed",
            lo[2], hi[2]
        ));
    }
    Ok((worst, compared))
}

/// Peaks of a run of set-points, of a servo that starts at rest at `settle`; `height` tells none where
/// the tool may move as it likes.
fn peaks(
    spiral: &Spiral,
    settle: usize,
    run: Range<usize>,
    servo: Option<Servo>,
    limits: [f64; 3],
    mut height: impl FnMut([f64; 2]) -> Option<f64>,
) -> Peaks {
    let none = [f64::INFINITY, f64::NEG_INFINITY];
    let mut out = Peaks { z: none, rates: [0.0; 3], following: [0.0; 2], counts: [0; 2] };
    let mut axis: Option<Axis> = None;
    // The last three heights, and how many of them in a row are on the part.
    let (mut before, mut row) = ([0.0; 3], 0);
    // Three set-points of the run before, so that no difference is missed between runs.
    for i in settle.min(run.start.saturating_sub(3))..run.end {
        let Some(z) = height(spiral.at(i)) else {
            // It comes in at rest again.
            (row, axis) = (0, None);
            continue;
        };
        row += 1;
        let late = servo.map_or(0.0, |servo| {
            let axis = axis.get_or_insert_with(|| Axis::new(servo, spiral.cycle, z));
            (axis.step(z) - z).abs()
        });
        if i >= run.start && row > 3 {
            let [a, b, c] = before;
            let differences = [z - a, z - 2.0 * a + b, z - 3.0 * a + 3.0 * b - c];
            let rates: [f64; 3] = std::array::from_fn(|k| differences[k].abs() / spiral.cycle.powi(k as i32 + 1));
            out.z = [out.z[0].min(z), out.z[1].max(z)];
            out.rates = std::array::from_fn(|k| out.rates[k].max(rates[k]));
            out.following = [out.following[0].max(late), out.following[1] + late];
            let keeps = rates.iter().zip(limits).all(|(rate, limit)| *rate <= limit);
            out.counts = [out.counts[0] + 1, out.counts[1] + usize::from(keeps)];
        }
        before = [z, before[0], before[1]];
    }
    out
}

/// Peaks of two runs together.
fn joined(a: Peaks, b: Peaks) -> Peaks {
    Peaks {
        z: [a.z[0].min(b.z[0]), a.z[1].max(b.z[1])],
        rates: std::array::from_fn(|k| a.rates[k].max(b.rates[k])),
        following: [a.following[0].max(b.following[0]), a.following[1] + b.following[1]],
        counts: [0, 1].map(|k| a.counts[k] + b.counts[k]),
    }
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
