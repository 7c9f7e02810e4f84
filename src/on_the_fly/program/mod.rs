//! The program of a machine that marks on the fly: what every axis is commanded, move by move.
//!
//! Consumes a [`Motion`] in the part frame; promises samples in whole nanometres, millionths of a degree and
//! microseconds, after placement and the machine's signs: what stands in a program is what is commanded. Moves
//! run straight in all axes from sample to sample, each in its own time; the laser is on in whole moves. Times
//! are rounded from the program's start, never one after the other, so that nothing adds up; the stage is then
//! where its motion has it at the rounded time, and the scanner makes up for the rest.
//!
//! # How far a mark lies from where the motion has it
//! Between two nodes of the motion a mark is meant to run straight in the part. Where axes turn it bows: such
//! a move is cut until it bows by at most [`BOW`]. Samples that lie within [`NEAR`] (turning axes: [`NEAR_TURN`])
//! of the line between those around them, at their time, are left out; a corner may be cut by 1 nm. With the rounding
//! of U and V that is at most BOW + sqrt 2 (2 NEAR + 1 nm) + 1 nm: 37 nm, and for every metre from the pivot 70 nm
//! more, of two axes NEAR_TURN each.
//!
//! # Limits
//! Every stroke is marked once, in one pass and one set-up.

mod frame;
mod merge;
pub mod peaks;

use crate::diag::{Diag, Error};
use crate::geom::MAX_NM;
use crate::machine::Machine;
use crate::on_the_fly::axes::motion::{AXES, Motion};
use crate::program::{self, Pen};
use frame::{Frame, Spot};

/// How far a move may bow beside its line in the part where axes turn, nm.
pub const BOW: f64 = 20.0;
/// How far a linear axis may be from a sample that was left out, nm.
pub const NEAR: i64 = 5;
/// The same of a turning axis, millionths of a degree.
pub const NEAR_TURN: i64 = 2;
/// The stage stands where it would move slower than this, nm/us: 0.12 mm/min.
const CREEP: f64 = 2e-3;
/// How far a corner of the motion may be cut because times are rounded, mm.
const CUT: f64 = 1e-6;
/// How often a move between two nodes may be halved.
const HALVINGS: u32 = 10;

/// Which axes a program commands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A stage of X, Y, Z and a scanner of U and V.
    Xyzuv,
    /// The same with a swivel A and a turntable C under the part.
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

/// What is marked in a move.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mark {
    /// Index of its pen.
    pub pen: u16,
    /// Stroke of the texture.
    pub source: u32,
    /// Which piece of the texture, numbered as it was planned; a new one begins a new mark.
    pub piece: u32,
}

/// A straight move of all axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Move {
    /// When it ends, microseconds from the program's start.
    pub us: i64,
    /// Where it ends: X Y Z A C U V as commanded, nm and millionths of a degree.
    pub to: [i64; AXES],
    /// What is marked meanwhile; None with the laser off.
    pub mark: Option<Mark>,
}

/// A program of moves.
#[derive(Clone, Debug, PartialEq)]
pub struct Program {
    /// Its axes.
    pub kind: Kind,
    /// Laser settings.
    pub pens: Vec<Pen>,
    /// Position of the part frame's origin in the table frame, nm.
    pub origin: [i64; 3],
    /// Where all axes stand at first, as commanded.
    pub start: [i64; AXES],
    /// The moves, one after the other.
    pub moves: Vec<Move>,
}

impl Program {
    /// The program of a motion, whose strokes are those of `strokes`, on a part that lies at `origin` (nm) in the
    /// table frame.
    ///
    /// # Errors
    /// `fly-axes` where the machine does not have the axes; `fly-motion` where the motion is none.
    pub fn of(
        motion: &Motion,
        strokes: &program::Program,
        machine: &Machine,
        origin: [i64; 3],
        kind: Kind,
    ) -> Result<Self, Error> {
        is_sound(motion, strokes)?;
        if kind == Kind::Xyzuv && motion.axes.iter().any(|axes| axes[3] != 0.0 || axes[4] != 0.0) {
            return Err(Diag::bug("fly-motion", "a motion turns axes that the program does not have").into());
        }
        let frame = Frame::new(machine, origin, kind)?;
        let mut maker = Maker { motion, frame, hint: 0, moves: Vec::with_capacity(motion.time.len()) };
        let mut program = Self { kind, pens: strokes.pens.clone(), origin, start: [0; AXES], moves: Vec::new() };
        if motion.time.is_empty() {
            return Ok(program);
        }
        program.start = maker.commanded(0, maker.spot(0))?;
        let mut last = 0;
        for i in 1..motion.time.len() {
            let mark = motion.pen[i].map(|pen| {
                let piece = motion.stroke[i];
                Mark { pen, source: strokes.strokes[piece as usize].source.0, piece }
            });
            maker.stretch(i, mark, &mut last)?;
        }
        program.moves = merge::merged(program.start, maker.moves);
        if kind == Kind::Xyzuv {
            hold(&mut program, &maker.frame);
        }
        Ok(program)
    }

    /// Where the beam of a sample meets the focal plane.
    pub(super) fn spots(&self, machine: &Machine) -> Result<impl Fn(&[i64; AXES]) -> Spot, Error> {
        let frame = Frame::new(machine, self.origin, self.kind)?;
        Ok(move |at: &[i64; AXES]| frame.spot(at))
    }

    /// The point of the field of a sample, nm.
    pub(super) fn fields(&self, machine: &Machine) -> Result<impl Fn(&[i64; AXES]) -> [i64; 2], Error> {
        let frame = Frame::new(machine, self.origin, self.kind)?;
        Ok(move |at: &[i64; AXES]| frame.field(at))
    }

    /// When the last move ends, s.
    pub fn total_s(&self) -> f64 {
        self.moves.last().map_or(0.0, |m| m.us as f64 / 1e6)
    }

    /// Every move with where and when it begins.
    pub fn steps(&self) -> impl Iterator<Item = (i64, &[i64; AXES], &Move)> {
        let before = std::iter::once((0, &self.start)).chain(self.moves.iter().map(|m| (m.us, &m.to)));
        before.zip(&self.moves).map(|((us, from), m)| (us, from, m))
    }
}

/// Lets the stage stand in moves in which it would creep, and the scanner make up for it: LinuxCNC takes the time of
/// a move from X, Y and Z wherever they move, and none slower than 0.1 mm/min.
fn hold(program: &mut Program, frame: &Frame) {
    let (mut from, mut us) = (program.start, 0);
    for m in &mut program.moves {
        let way: f64 = (0..3).map(|k| ((m.to[k] - from[k]) as f64).powi(2)).sum::<f64>().sqrt();
        if way > 0.0 && way < CREEP * (m.us - us) as f64 {
            let held = frame.held(&m.to, &from);
            // A mark must move; where only the stage did, it goes on creeping.
            if m.mark.is_none() || held != from {
                m.to = held;
            }
        }
        (from, us) = (m.to, m.us);
    }
}

/// Refuses what is not a motion.
fn is_sound(motion: &Motion, strokes: &program::Program) -> Result<(), Error> {
    let count = motion.time.len();
    let same = [motion.axes.len(), motion.pen.len(), motion.stroke.len()].iter().all(|&n| n == count);
    let bug = |text: &str| Err(Diag::bug("fly-motion", text).into());
    if !same {
        return bug("a motion does not have as many times as positions");
    }
    let finite = motion.time.iter().chain(motion.axes.iter().flatten()).all(|v| v.is_finite());
    if !finite || motion.time.windows(2).any(|w| w[1] < w[0]) {
        return bug("a motion runs back in time or nowhere");
    }
    if motion.total_s() - motion.time.first().copied().unwrap_or_default() > 1e8 {
        return bug("a motion takes more than three years");
    }
    let known = |(pen, &piece): (&Option<u16>, &u32)| {
        pen.is_none_or(|p| usize::from(p) < strokes.pens.len() && (piece as usize) < strokes.strokes.len())
    };
    if !motion.pen.iter().zip(&motion.stroke).all(known) {
        return bug("a motion marks a stroke or with a pen that is not there");
    }
    Ok(())
}

fn lerp(a: [f64; 3], b: [f64; 3], share: f64) -> [f64; 3] {
    let share = share.clamp(0.0, 1.0);
    std::array::from_fn(|k| a[k] + share * (b[k] - a[k]))
}

/// The program while it grows.
struct Maker<'a> {
    motion: &'a Motion,
    frame: Frame,
    /// The node before the time that was last asked for.
    hint: usize,
    moves: Vec<Move>,
}

impl Maker<'_> {
    /// Where the beam meets the focal plane at a node, part frame.
    fn spot(&self, node: usize) -> [f64; 3] {
        let [x, y, z, a, c, u, v] = self.motion.axes[node];
        frame::part_from_machine(a, c, [x + u, y + v, z])
    }

    /// Positions of the motion at a time, s, X, Y and Z in the table frame: that is where axes run straight.
    fn at(&mut self, time: f64) -> [f64; AXES] {
        let (t, axes) = (&self.motion.time, &self.motion.axes);
        while self.hint + 2 < t.len() && t[self.hint + 1] < time {
            self.hint += 1;
        }
        while self.hint > 0 && t[self.hint] > time {
            self.hint -= 1;
        }
        let next = (self.hint + 1).min(t.len() - 1);
        let share = if t[next] > t[self.hint] { (time - t[self.hint]) / (t[next] - t[self.hint]) } else { 1.0 };
        let share = share.clamp(0.0, 1.0);
        let [a, b] = [self.hint, next].map(|node| self.frame.placed(&axes[node]));
        std::array::from_fn(|k| a[k] + share * (b[k] - a[k]))
    }

    /// The sample at a time with the spot on a point of the part.
    fn commanded(&mut self, us: i64, spot: [f64; 3]) -> Result<[i64; AXES], Error> {
        let axes = self.at(self.motion.time[0] + us as f64 * 1e-6);
        let to = self.frame.commanded(&axes, spot);
        let near = |v: &f64| v.abs() <= MAX_NM as f64;
        if !to.iter().all(near) {
            return Err(Diag::bug("fly-motion", "a motion reaches beyond 4 m or eleven turns").into());
        }
        Ok(to.map(|v| v as i64))
    }

    /// The moves to node `i`; `last` is the time of the sample before, us.
    fn stretch(&mut self, i: usize, mark: Option<Mark>, last: &mut i64) -> Result<(), Error> {
        let [t0, t1] = [self.motion.time[i - 1], self.motion.time[i]];
        let [from, to] = [self.spot(i - 1), self.spot(i)];
        if t1 == t0 && self.motion.axes[i - 1] == self.motion.axes[i] {
            return Ok(());
        }
        let halvings = if mark.is_some() && self.frame.turns() { self.halvings(i, from, to) } else { 0 };
        let count = 1u32 << halvings;
        for k in 1..=count {
            let share = f64::from(k) / f64::from(count);
            let us = ((t0 + share * (t1 - t0) - self.motion.time[0]) * 1e6).round() as i64;
            // A sample needs a time of its own; what waits for one is caught up by the next.
            let us = us.max(*last + 1);
            let time = self.motion.time[0] + us as f64 * 1e-6;
            let spot = if k < count { lerp(from, to, (time - t0) / (t1 - t0)) } else { self.end(i, time, from, to) };
            let to = self.commanded(us, spot)?;
            self.moves.push(Move { us, to, mark });
            *last = us;
        }
        Ok(())
    }

    /// Where the spot is at node `i`, asked for at a time that was rounded. On a straight run the spot keeps its
    /// pace and is where it is at that time; at a corner and where the pen changes it is at the node.
    fn end(&self, i: usize, time: f64, from: [f64; 3], at: [f64; 3]) -> [f64; 3] {
        let m = self.motion;
        let same = m.pen.get(i + 1).is_some_and(|&pen| pen == m.pen[i] && m.stroke[i + 1] == m.stroke[i]);
        if !same {
            return at;
        }
        let next = self.spot(i + 1);
        let after = time > m.time[i];
        let (t0, t1) = if after { (m.time[i], m.time[i + 1]) } else { (m.time[i - 1], m.time[i]) };
        let spot =
            if after { lerp(at, next, (time - t0) / (t1 - t0)) } else { lerp(from, at, (time - t0) / (t1 - t0)) };
        let [way, on, off] = [[from, at], [at, next], [at, spot]].map(|[a, b]| [0, 1, 2].map(|k| b[k] - a[k]));
        let norm = |v: [f64; 3]| v.iter().map(|v| v * v).sum::<f64>().sqrt();
        let cross = [way[1] * on[2] - way[2] * on[1], way[2] * on[0] - way[0] * on[2], way[0] * on[1] - way[1] * on[0]];
        let cut = norm(off) * norm(cross) / (norm(way) * norm(on));
        // Never of a NaN: where the spot rests.
        if cut < CUT { spot } else { at }
    }

    /// How often the move to node `i` is halved until no part of it bows too far.
    fn halvings(&self, i: usize, from: [f64; 3], to: [f64; 3]) -> u32 {
        let [a, b] = [&self.motion.axes[i - 1], &self.motion.axes[i]];
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
