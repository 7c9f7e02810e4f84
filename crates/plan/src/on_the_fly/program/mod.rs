//! The program of a machine that marks on the fly: what every axis is commanded, move by move.
//!
//! Consumes a [`Motion`] in the part frame; promises samples in whole nanometres, millionths of a degree and
//! microseconds, after placement and the machine's signs: a program contains the commanded values. Moves run straight
//! in all axes from sample to sample, each in its own time; the laser is on in whole moves. Times are rounded from the
//! program's start, never one after the other, so that nothing adds up; the stage is then where its motion has it at
//! the rounded time, and the scanner compensates for the rest. A move that would then be faster than its pen or the
//! scanner allows takes as many microseconds as it needs; the spot then lags and catches up where there is slack (but
//! not during waits). The excess is reported.
//!
//! # How far a mark lies from where the motion has it
//! Between two nodes of the motion a mark is meant to run straight in the part. Where axes turn it bows: such
//! a move is cut until it bows by at most `BOW`. Samples that lie within `NEAR` (turning axes: `NEAR_TURN`)
//! of the line between those around them, at their time, are left out; a corner may be cut by 1 nm. With the rounding
//! of U and V that is at most BOW + sqrt 2 (2 NEAR + 1 nm) + 1 nm: 37 nm, and for every metre from the pivot 70 nm
//! more, of two axes NEAR_TURN each.
//!
//! # Limits
//! Every stroke is marked once, in one pass and one set-up.

mod frame;
mod merge;
pub mod peaks;

use std::ops::{Index, IndexMut};
use terrace_core::math;

use crate::on_the_fly::axes::kinematics::turned_back;
use crate::on_the_fly::axes::motion::{AXES, Motion, Waypoint};
use crate::ordered_strokes::OrderedStrokes;
use frame::Frame;
pub use frame::Spot;
use terrace_core::diag::{Diag, Error};
use terrace_core::geom::{P3Mm, mm_from_nm};
use terrace_core::machine::{Machine, Origin};
use terrace_core::program::{Pen, PenId, PieceId, StrokeId};

/// How far a move may bow off its line in the part where axes turn, nm.
pub(crate) const BOW: f64 = 20.0;
/// How far a linear axis may be from a sample that was left out, nm.
pub const NEAR: i64 = 5;
/// How far a turning axis may be from a sample that was left out, millionths of a degree.
pub(crate) const NEAR_TURN: i64 = 2;
/// The stage stops where it would move slower than this, nm/us: 0.12 mm/min.
const CREEP: f64 = 2e-3;
/// How far a corner of the motion may be cut because times are rounded, mm.
const CUT: f64 = 1e-6;
/// How late the spot may be in a mark, us: the stage has gone on by less than a micrometre.
const LATE: f64 = 3.0;
/// What rounding may put on the length of a move, mm.
const ROUNDING: f64 = 2e-6;
/// How often the time of a late sample is looked for; a scanner slower than the stage finds none.
const ROUNDS: u32 = 32;
/// How often a move between two nodes may be halved.
const HALVINGS: u32 = 10;

/// Which axes a program commands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A stage of X, Y, Z and a scanner of U and V.
    Xyzuv,
    /// A stage of X, Y, Z with a swivel A and a turntable C under the part, and a scanner of U and V.
    Xyzacuv,
}

impl Kind {
    /// The letters of its axes, in the order in which they are written.
    pub fn letters(self) -> &'static str {
        match self {
            Self::Xyzuv => "XYZUV",
            Self::Xyzacuv => "XYZACUV",
        }
    }
    /// Indices of its axes in a sample.
    pub fn axes(self) -> &'static [usize] {
        match self {
            Self::Xyzuv => &[0, 1, 2, 5, 6],
            Self::Xyzacuv => &[0, 1, 2, 3, 4, 5, 6],
        }
    }
}

/// What the axes of a sample are commanded, in the order X Y Z A C U V: nm, of A and C millionths of a degree.
/// Placement and the machine's signs are in it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(transparent)]
pub struct AxisCommands(pub [i64; AXES]);

impl Index<usize> for AxisCommands {
    type Output = i64;

    fn index(&self, axis: usize) -> &i64 {
        &self.0[axis]
    }
}

impl IndexMut<usize> for AxisCommands {
    fn index_mut(&mut self, axis: usize) -> &mut i64 {
        &mut self.0[axis]
    }
}

/// What is marked in a move.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mark {
    /// Index of its pen.
    pub pen: PenId,
    /// Stroke of the texture.
    pub source: StrokeId,
    /// Which piece of the texture, numbered as it was planned; a new one begins a new mark.
    pub piece: PieceId,
}

/// A straight move of all axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Move {
    /// When it ends, microseconds from the program's start.
    pub us: i64,
    /// Where it ends.
    pub to: AxisCommands,
    /// What is marked meanwhile; None with the laser off.
    pub mark: Option<Mark>,
}

/// A move with the laser on, as it is seen along z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Marked {
    /// Index of its pen.
    pub pen: PenId,
    /// The time of the sample, s.
    pub s: f64,
    /// How far the beam moves across itself.
    pub way_mm: f64,
    /// Where the spot begins, part frame, mm.
    pub from: [f64; 2],
    /// Where it ends.
    pub to: [f64; 2],
}

impl Marked {
    /// A move that begins at `from` at a time, us; None with the laser off.
    fn of_move(frame: &Frame, us: i64, from: &AxisCommands, to: &Move) -> Option<Self> {
        let mark = to.mark?;
        let [from, at] = [from, &to.to].map(|sample| frame.spot(sample));
        let way_mm = from.way(&at);
        let [from, at] = [from.part, at.part].map(P3Mm::xy);
        Some(Self { pen: mark.pen, s: (to.us - us) as f64 * 1e-6, way_mm, from, to: at })
    }
}

/// A program of moves.
#[derive(Clone, Debug, PartialEq)]
pub struct Program {
    /// The axes of the program.
    pub kind: Kind,
    /// Laser settings.
    pub pens: Vec<Pen>,
    /// Position of the part frame's origin in the table frame.
    pub origin: Origin,
    /// Where all axes are at the start.
    pub start: AxisCommands,
    /// The moves, one after the other.
    pub moves: Vec<Move>,
}

impl Program {
    /// The program of a motion, whose strokes are those of `strokes`, on a part that lies at `origin` in the
    /// table frame; and how much slower the motion should run, 1 or more, where the spot is late by more than `LATE`.
    ///
    /// # Errors
    /// `fly-axes` where the machine does not have the axes; `fly-motion` where the motion is not one.
    pub fn of(
        motion: &Motion,
        strokes: &OrderedStrokes,
        machine: &Machine,
        origin: Origin,
        kind: Kind,
    ) -> Result<(Self, f64), Error> {
        check_motion(motion, strokes)?;
        if kind == Kind::Xyzuv && motion.waypoints.iter().any(|w| w.axes[3] != 0.0 || w.axes[4] != 0.0) {
            return Err(Diag::bug("fly-motion", "a motion turns axes that the program does not have").into());
        }
        let frame = Frame::new(machine, origin, kind)?;
        let speeds = Speeds {
            pens: strokes.pens.iter().map(|p| p.speed.as_mm_s()).collect(),
            scanner_jump: machine.scanner.jump_speed.as_mm_s(),
            scanner_mark: machine.scanner.max_mark_speed.as_mm_s(),
        };
        let moves = Vec::with_capacity(motion.waypoints.len());
        let mut sampler = MotionSampler { motion, frame, speeds, hint: 0, delay: Delay::default(), moves };
        let (pens, start) = (strokes.pens.clone(), AxisCommands::default());
        let mut program = Self { kind, pens, origin, start, moves: Vec::new() };
        if motion.waypoints.is_empty() {
            return Ok((program, sampler.delay.slower));
        }
        program.start = sampler.commanded(0, sampler.spot(0))?;
        let mut last = Move { us: 0, to: program.start, mark: None };
        for (i, w) in motion.waypoints.iter().enumerate().skip(1) {
            let piece = w.stroke;
            let mark = w.pen.map(|pen| Mark { pen, source: strokes.strokes[piece.index()].source, piece });
            sampler.add_stretch(i, mark, &mut last)?;
        }
        program.moves = merge::merged(program.start, sampler.moves);
        if kind == Kind::Xyzuv {
            hold_creeping_stage(&mut program, &sampler.frame);
        }
        Ok((program, sampler.delay.slower))
    }

    /// The function that says where the beam of a sample meets the focal plane.
    ///
    /// # Errors
    /// `fly-axes` where the machine does not have the axes.
    pub fn spots(&self, machine: &Machine) -> Result<impl Fn(&AxisCommands) -> Spot, Error> {
        let frame = Frame::new(machine, self.origin, self.kind)?;
        Ok(move |at: &AxisCommands| frame.spot(at))
    }

    /// The function that says at which point of the field a sample is, nm.
    pub(super) fn fields(&self, machine: &Machine) -> Result<impl Fn(&AxisCommands) -> [i64; 2], Error> {
        let frame = Frame::new(machine, self.origin, self.kind)?;
        Ok(move |at: &AxisCommands| frame.field(at))
    }

    /// The moves with the laser on, none where the machine does not have the axes.
    pub fn marked(&self, machine: &Machine) -> impl Iterator<Item = Marked> + use<'_> {
        let frame = Frame::new(machine, self.origin, self.kind).ok();
        self.steps().filter_map(move |(us, from, to)| Marked::of_move(frame.as_ref()?, us, from, to))
    }

    /// When the last move ends, s.
    pub fn total_s(&self) -> f64 {
        self.moves.last().map_or(0.0, |m| m.us as f64 / 1e6)
    }

    /// Every move with where and when it begins.
    pub fn steps(&self) -> impl Iterator<Item = (i64, &AxisCommands, &Move)> {
        let before = std::iter::once((0, &self.start)).chain(self.moves.iter().map(|m| (m.us, &m.to)));
        before.zip(&self.moves).map(|((us, from), m)| (us, from, m))
    }
}

/// Stops the stage in moves in which it would creep, and lets the scanner compensate for it: LinuxCNC takes the time of
/// a move from X, Y and Z wherever they move, and none slower than 0.1 mm/min.
fn hold_creeping_stage(program: &mut Program, frame: &Frame) {
    let (mut from, mut us) = (program.start, 0);
    for m in &mut program.moves {
        let way: f64 = (0..3).map(|k| ((m.to[k] - from[k]) as f64).powi(2)).sum::<f64>().sqrt();
        if way > 0.0 && way < CREEP * (m.us - us) as f64 {
            let held = frame.held(&m.to, &from);
            // A mark must move; where only the stage did, it keeps creeping.
            if m.mark.is_none() || held != from {
                m.to = held;
            }
        }
        (from, us) = (m.to, m.us);
    }
}

/// Refuses what is not a motion.
fn check_motion(motion: &Motion, strokes: &OrderedStrokes) -> Result<(), Error> {
    let waypoints = &motion.waypoints;
    let bug = |text: &str| Err(Diag::bug("fly-motion", text).into());
    let finite = waypoints.iter().all(|w| w.time.is_finite() && w.axes.iter().all(|v| v.is_finite()));
    if !finite || waypoints.windows(2).any(|w| w[1].time < w[0].time) {
        return bug("a motion runs back in time or nowhere");
    }
    if motion.total_s() - waypoints.first().map_or(0.0, |w| w.time) > 1e8 {
        return bug("a motion takes more than three years");
    }
    let known =
        |w: &Waypoint| w.pen.is_none_or(|p| p.index() < strokes.pens.len() && w.stroke.index() < strokes.strokes.len());
    if !waypoints.iter().all(known) {
        return bug("a motion marks a stroke or with a pen that is not there");
    }
    Ok(())
}

/// A sample that is due at a time of the motion, s, on the way to a node from `from` to `to`.
struct DueSample {
    /// Node of the motion at which the way ends.
    i: usize,
    /// Time in the motion, s.
    at: f64,
    /// Whether this is the node itself, not a place before it.
    is_node: bool,
    /// The spot at the beginning of the way.
    from: P3Mm,
    /// The spot at its end.
    to: P3Mm,
}

/// Where the spot is for a sample.
struct SpotAtTime {
    spot: P3Mm,
    /// Whether that is where the motion has it at the time.
    keeps_pace: bool,
}

/// How far `spot`, on the way to a corner or after it, lies off the other leg of the corner: the distance from the
/// corner times the sine of its angle.
fn corner_cut(before: P3Mm, corner: P3Mm, after: P3Mm, spot: P3Mm) -> f64 {
    let [way, on, off] = [corner.way_from(before), after.way_from(corner), spot.way_from(corner)];
    let norm = |v: [f64; 3]| v.iter().map(|v| v * v).sum::<f64>().sqrt();
    let cross = [way[1] * on[2] - way[2] * on[1], way[2] * on[0] - way[0] * on[2], way[0] * on[1] - way[1] * on[0]];
    norm(off) * norm(cross) / (norm(way) * norm(on))
}

/// Largest speeds, mm/s.
struct Speeds {
    /// Of marks across the beam, by their pens.
    pens: Vec<f64>,
    /// Of the scanner with the laser off.
    scanner_jump: f64,
    /// Of the scanner with the laser on.
    scanner_mark: f64,
}

/// How late the spot is, us.
struct Delay {
    by: f64,
    /// When it was last in time, us.
    since: f64,
    /// How much slower the motion should run.
    slower: f64,
}

impl Default for Delay {
    fn default() -> Self {
        Self { by: 0.0, since: 0.0, slower: 1.0 }
    }
}

impl Delay {
    /// The spot is late by `by` at a sample that was due at `due`.
    fn record(&mut self, by: f64, due: f64, mark: Option<Mark>) {
        self.by = by.max(0.0);
        // Half a microsecond is the rounding of a time.
        if by <= 0.5 {
            self.since = due;
        } else if mark.is_some() && by > LATE {
            // Stretched by this, all since it was last in time would have taken as long as it did.
            self.slower = self.slower.max(1.0 + by / (due - self.since).max(1.0));
        }
    }
}

/// The samples of a motion while the program grows.
struct MotionSampler<'a> {
    motion: &'a Motion,
    frame: Frame,
    speeds: Speeds,
    delay: Delay,
    /// The node before the time that was last asked for.
    hint: usize,
    moves: Vec<Move>,
}

impl MotionSampler<'_> {
    /// Where the beam meets the focal plane at a node.
    fn spot(&self, node: usize) -> P3Mm {
        let [x, y, z, a, c, u, v] = self.motion.waypoints[node].axes;
        turned_back(a, c, P3Mm::new([x + u, y + v, z]))
    }

    /// Positions of the motion at a time, s, X, Y and Z in the table frame: that is where axes run straight.
    fn at(&mut self, time: f64) -> [f64; AXES] {
        let waypoints = &self.motion.waypoints;
        while self.hint + 2 < waypoints.len() && waypoints[self.hint + 1].time < time {
            self.hint += 1;
        }
        while self.hint > 0 && waypoints[self.hint].time > time {
            self.hint -= 1;
        }
        let [from, to] = [self.hint, (self.hint + 1).min(waypoints.len() - 1)].map(|i| &waypoints[i]);
        let share = if to.time > from.time { (time - from.time) / (to.time - from.time) } else { 1.0 };
        let share = share.clamp(0.0, 1.0);
        let [a, b] = [from, to].map(|w| self.frame.placed(&w.axes));
        std::array::from_fn(|k| a[k] + share * (b[k] - a[k]))
    }

    /// The sample at a time with the spot on a point of the part.
    fn commanded(&mut self, us: i64, spot: P3Mm) -> Result<AxisCommands, Error> {
        let axes = self.at(self.motion.waypoints[0].time + us as f64 * 1e-6);
        let far = || Diag::bug("fly-motion", "a motion reaches beyond 4 m or 100,000 turns").into();
        self.frame.commanded(&axes, spot).ok_or_else(far)
    }

    /// Adds the moves to node `i`; `last` is the one before.
    fn add_stretch(&mut self, i: usize, mark: Option<Mark>, last: &mut Move) -> Result<(), Error> {
        let [before, here] = [self.motion.waypoints[i - 1], self.motion.waypoints[i]];
        let [t0, t1] = [before.time, here.time];
        let [from, to] = [self.spot(i - 1), self.spot(i)];
        if t1 == t0 && before.axes == here.axes {
            return Ok(());
        }
        let halvings = if mark.is_some() && self.frame.turns() { self.halvings(i, from, to) } else { 0 };
        let count = 1u32 << halvings;
        let moves = math::hypot(to[0] - from[0], to[1] - from[1]) > 1e-9;
        let is_wait = mark.is_none() && !moves && !self.frame.turns();
        // A wait may be no shorter than it was meant, to the microsecond that its begin was rounded by.
        let least = if is_wait { ((t1 - t0) * 1e6 / f64::from(count)).floor() as i64 } else { 0 };
        for k in 1..=count {
            let share = f64::from(k) / f64::from(count);
            let due = DueSample { i, at: t0 + share * (t1 - t0), is_node: k == count, from, to };
            *last = self.sample(&due, mark, last, least.max(1))?;
            self.moves.push(*last);
        }
        Ok(())
    }

    /// The sample at a node: in time where that is not too fast, as late as the one before it on a straight run, or at
    /// the node as soon as it can be. The move to it takes `least` us or more.
    fn sample(&mut self, node: &DueSample, mark: Option<Mark>, last: &Move, least: i64) -> Result<Move, Error> {
        let start = self.motion.waypoints[0].time;
        let due = (node.at - start) * 1e6;
        for delay in [0.0, self.delay.by] {
            // A sample needs a time of its own; what waits for one is caught up by the next.
            let us = ((due + delay).round() as i64).max(last.us + least);
            let time = start + (us as f64 - delay) * 1e-6;
            let SpotAtTime { spot, keeps_pace } = self.spot_at_time(node, time);
            let to = self.commanded(us, spot)?;
            if us - last.us >= self.least_us(&last.to, &to, mark) {
                self.delay.record(if keeps_pace { delay } else { us as f64 - due }, due, mark);
                return Ok(Move { us, to, mark });
            }
        }
        let spot = if node.is_node { node.to } else { self.spot_at_time(node, node.at).spot };
        let mut us = last.us + least;
        // The stage moves on meanwhile, and the scanner has to compensate for that too.
        let mut round = 0;
        loop {
            let to = self.commanded(us, spot)?;
            let earliest = last.us + self.least_us(&last.to, &to, mark);
            // After all rounds the move stays too fast, and the check of the program refuses it.
            if earliest <= us || round == ROUNDS {
                self.delay.record(us as f64 - due, due, mark);
                return Ok(Move { us, to, mark });
            }
            us = earliest;
            round += 1;
        }
    }

    /// The least time of a move, us.
    fn least_us(&self, from: &AxisCommands, to: &AxisCommands, mark: Option<Mark>) -> i64 {
        let [u, v] = [5, 6].map(|k| mm_from_nm(to[k] - from[k]));
        let speed = if mark.is_some() { self.speeds.scanner_mark } else { self.speeds.scanner_jump };
        let scanner = (math::hypot(u, v) - ROUNDING) / speed;
        let pen = mark.map_or(0.0, |mark| {
            let way = self.frame.spot(from).way(&self.frame.spot(to));
            (way - ROUNDING) / self.speeds.pens[mark.pen.index()]
        });
        (scanner.max(pen) * 1e6).ceil() as i64
    }

    /// Where the spot is for a sample whose time was rounded. On a straight run it is where the motion has it at that
    /// time; at a corner and where the pen changes it is at the node.
    fn spot_at_time(&self, node: &DueSample, time: f64) -> SpotAtTime {
        let &DueSample { i, from, to, .. } = node;
        let (waypoints, here) = (&self.motion.waypoints, &self.motion.waypoints[i]);
        let begin = waypoints[i - 1].time;
        let passed = |time: f64| ((time - begin) / (here.time - begin)).clamp(0.0, 1.0);
        if !node.is_node {
            return SpotAtTime { spot: from.lerp(to, passed(time)), keeps_pace: true };
        }
        let at_node = SpotAtTime { spot: to, keeps_pace: false };
        let Some(after) = waypoints.get(i + 1).filter(|w| w.pen == here.pen && w.stroke == here.stroke) else {
            return at_node;
        };
        let next = self.spot(i + 1);
        let (t0, t1) = (here.time, after.time);
        let spot = if time > t0 {
            to.lerp(next, ((time - t0) / (t1 - t0)).clamp(0.0, 1.0))
        } else {
            from.lerp(to, passed(time))
        };
        // Not of NaN, which a spot at rest gives: then it is at the node.
        if corner_cut(from, to, next, spot) < CUT { SpotAtTime { spot, keeps_pace: true } } else { at_node }
    }

    /// How often the move to node `i` is halved until no part of it bows too far.
    fn halvings(&self, i: usize, from: P3Mm, to: P3Mm) -> u32 {
        let [a, b] = [i - 1, i].map(|i| &self.motion.waypoints[i].axes);
        // Of a move that turns evenly, what all its parts bow falls with the square of their length.
        let bow = self.frame.bow(a, b, from, to);
        let mut halvings = 0;
        while bow / f64::from(1u32 << (2 * halvings)) > BOW && halvings < HALVINGS {
            halvings += 1;
        }
        halvings
    }
}

#[cfg(test)]
mod tests;
