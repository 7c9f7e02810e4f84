//! Readers of on-the-fly programs: what the axes do and when, and what the laser does meanwhile.
//!
//! Each consumes the text of one program and promises a [`FlyProgram`]: exact nanometres, millionths of a degree and
//! microseconds. The laser is followed as the controller switches it; what is not known, and what could fire
//! where nothing is marked, is a fault of the program.

pub(crate) mod linuxcnc;
pub(crate) mod manifest;
pub(crate) mod pmac;

use std::ops::Index;

use super::Fault;
use super::comments::{CommentKind, on_the_fly};
use terrace_core::program::{PenId, StrokeId};

/// Axes of a sample: X Y Z A C U V.
pub(crate) const AXES: usize = 7;

/// The commands of the axes at a sample, in the order X Y Z A C U V: nm, of A and C millionths of a degree, with the
/// machine's signs. Between samples the values are f64.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Commands<T = i64>(pub(crate) [T; AXES]);

impl Commands {
    /// The same values as f64.
    pub(crate) fn float(&self) -> Commands<f64> {
        Commands(self.0.map(|v| v as f64))
    }
}

impl Commands<f64> {
    /// The values at a share, 0 to 1, of the straight way to others.
    pub(crate) fn between(&self, to: &Self, share: f64) -> Self {
        Self(std::array::from_fn(|k| self[k] + share * (to[k] - self[k])))
    }
}

impl<T> Index<usize> for Commands<T> {
    type Output = T;

    fn index(&self, axis: usize) -> &T {
        &self.0[axis]
    }
}

/// What a mark says that it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Claim {
    pub(crate) stroke: StrokeId,
    pub(crate) pen: PenId,
    /// Number of the mark in its program, from 1.
    pub(crate) run: u32,
}

/// A move in all axes together.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FlyStep {
    /// Line, from 1.
    pub(crate) line: usize,
    /// When it ends, us.
    pub(crate) us: i64,
    /// Where it ends.
    pub(crate) to: Commands,
    /// The mark that it belongs to; None with the laser off.
    pub(crate) mark: Option<Claim>,
    /// Power of the mark in percent of the laser's; None with the laser off, or where it was never set.
    pub(crate) power: Option<f64>,
}

/// A program as its controller runs it.
#[derive(Clone, Debug, Default)]
pub(crate) struct FlyProgram {
    /// Where the first timed move begins.
    pub(crate) start: Commands,
    /// The timed moves and rests.
    pub(crate) steps: Vec<FlyStep>,
    /// Where rapids go, by line.
    pub(crate) rapids: Vec<(usize, [Option<i64>; AXES])>,
    /// Power in percent and pen of every mark as it begins, by line.
    pub(crate) powers: Vec<(usize, PenId, Option<f64>)>,
    /// What its comments say, with their lines and figures.
    pub(crate) said: Vec<(usize, CommentKind, Vec<String>)>,
    /// Time over which moves are blended into each other, us.
    pub(crate) blend_us: i64,
    /// The largest distance by which corners may be rounded as the program asks, nm.
    pub(crate) rounded_nm: f64,
    /// Faults that the rule `laser` reports.
    pub(crate) faults: Vec<Fault>,
}

impl FlyProgram {
    /// Every step with the time and place where it begins.
    pub(crate) fn moves(&self) -> impl Iterator<Item = (i64, &Commands, &FlyStep)> {
        let before = std::iter::once((0, &self.start)).chain(self.steps.iter().map(|s| (s.us, &s.to)));
        before.zip(&self.steps).map(|((us, from), step)| (us, from, step))
    }
}

/// A controller while its program runs.
#[derive(Default)]
struct Runner {
    program: FlyProgram,
    line: usize,
    at: [Option<i64>; AXES],
    us: i64,
    /// Whether the laser is on; None before anyone knows.
    laser: Option<bool>,
    /// What it will be from the next move on.
    waiting: Option<bool>,
    claim: Option<Claim>,
    runs: u32,
    power: Option<f64>,
    /// The mark of the last step.
    last: Option<Claim>,
    /// Whether the approach is over, so that a dwell is a rest of the program.
    timed: bool,
}

impl Runner {
    fn fault(&mut self, message: impl Into<String>) {
        self.program.faults.push(Fault::new(self.line, message));
    }

    /// A comment may begin a mark.
    fn comment(&mut self, text: &str) {
        let mut words = text.split_whitespace();
        if words.next() != Some("MARK") {
            match on_the_fly(text) {
                Some((kind, figures)) => self.program.said.push((self.line, kind, figures)),
                None => self.fault(format!("({text}) is not a comment of an on-the-fly program")),
            }
            return;
        }
        // Strokes are counted from 0, pens from 1.
        let stroke = words.next().and_then(|w| w.parse().ok()).map(StrokeId);
        let pen = words.next().filter(|w| *w == "PEN").and(words.next()).and_then(|w| w.parse::<u16>().ok());
        let pen = pen.filter(|_| words.next().is_none());
        let pen = pen.and_then(|number| number.checked_sub(1)).map(PenId);
        let (Some(stroke), Some(pen)) = (stroke, pen) else { return self.fault("a mark does not say what it is") };
        self.runs += 1;
        self.claim = Some(Claim { stroke, pen, run: self.runs });
    }

    /// The laser is off at once; a switch that waits for the next move keeps waiting.
    fn off(&mut self) {
        self.laser = Some(false);
    }

    /// The power is 0 at once, which the next moves may not need while the laser is on.
    fn no_power(&mut self) {
        if self.laser != Some(false) || self.waiting.is_some() {
            self.fault("the power is set at once with the laser not known to be off");
        }
        self.power = Some(0.0);
    }

    /// A move that is not timed.
    fn rapid(&mut self, words: [Option<i64>; AXES]) {
        if self.laser != Some(false) || self.waiting.is_some() {
            self.fault("a rapid move with the laser not known to be off");
        }
        for (at, to) in self.at.iter_mut().zip(words) {
            *at = to.or(*at);
        }
        self.program.rapids.push((self.line, words));
    }

    /// A rest; `waits` says whether a switch that waits for a move has its effect before it.
    fn rest(&mut self, us: i64, waits: bool) {
        if waits {
            self.laser = self.waiting.take().or(self.laser);
        }
        if self.laser != Some(false) || self.waiting.is_some() {
            self.fault("a rest with the laser not known to be off");
        }
        // One of no time ends the motion.
        if us > 0 && self.timed {
            self.step(us, [None; AXES], 0);
        }
    }

    /// A timed move of the axes that are named; `known` axes must have a place by now.
    fn step(&mut self, us: i64, words: [Option<i64>; AXES], known: u8) {
        self.laser = self.waiting.take().or(self.laser);
        if us <= 0 {
            return self.fault("a move without a time");
        }
        if self.program.steps.is_empty() {
            if (0..AXES).any(|k| known >> k & 1 == 1 && self.at[k].is_none()) {
                self.fault("a move before all axes have a place");
            }
            self.program.start = Commands(self.at.map(Option::unwrap_or_default));
        }
        for (at, to) in self.at.iter_mut().zip(words) {
            *at = to.or(*at);
        }
        let mark = match self.laser {
            Some(false) => None,
            Some(true) if self.claim.is_some() => self.claim,
            _ => {
                self.fault("the laser is on, or not known to be off, and no mark was announced");
                None
            }
        };
        if let Some(claim) = mark.filter(|c| self.last.is_none_or(|l| l.run != c.run)) {
            self.program.powers.push((self.line, claim.pen, self.power));
        }
        self.last = mark;
        let Some(end) = self.us.checked_add(us) else { return self.fault("the program does not end") };
        self.us = end;
        let to = Commands(self.at.map(Option::unwrap_or_default));
        let power = self.power.filter(|_| mark.is_some());
        self.program.steps.push(FlyStep { line: self.line, us: end, to, mark, power });
    }

    fn finish(mut self, ended: bool) -> FlyProgram {
        if !ended {
            self.fault("the program does not end");
        }
        if self.laser != Some(false) || self.waiting.is_some() {
            self.fault("the laser is not switched off at once at the end");
        }
        self.program
    }
}

/// A plain decimal with at most this many decimals, in units of the last one.
fn scaled(text: &str, decimals: usize) -> Option<i64> {
    let (whole, part) = text.split_once('.').unwrap_or((text, ""));
    if part.len() > decimals || whole.is_empty() || !whole.bytes().chain(part.bytes()).all(|c| c.is_ascii_digit()) {
        return None;
    }
    format!("{whole}{part:0<decimals$}").parse().ok()
}

/// The index of an axis.
fn axis(letter: char) -> Option<usize> {
    "XYZACUV".find(letter)
}
