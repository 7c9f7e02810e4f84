//! `laser`: the stage programs, run as a state machine. The output is known to be off in every move
//! and at every end; each group of moves settles before START; both waits are there, each with its
//! test for a timeout; nothing rounds corners or switches an output behind the moves.

use std::collections::BTreeMap;

use super::stage::StageFile;
use crate::proof::Rule;
use crate::read::gcode::{AxisWords, StageStep, Statement};
use crate::read::manifest::BlockEntry;
use terrace_core::machine::Machine;
use terrace_core::units::Time;

/// G words, in tenths, that neither move nor change how moves are run: units, plane, offsets off,
/// exact path, distance mode, feed mode. That units and distance mode are right, and that G69 is for Mach alone, is for
/// `agreement`.
const HARMLESS: [u32; 14] = [170, 200, 210, 400, 490, 540, 610, 611, 690, 800, 900, 910, 921, 940];

/// A dwell may be shorter than the settling time by this, s: it is written in decimals of a second.
const DWELL_ROUNDING: f64 = 1e-6;

/// The shortest settling time of a program, s (docs/reference/formats.md), and by how much a dwell in whole
/// milliseconds may be longer.
const LEAST_SETTLE: f64 = 0.05;
const MILLISECOND: f64 = 1e-3;

/// Waits for BUSY, s, as docs/reference/formats.md states them: before START, and for its rise. A longer one leaves the
/// beam where it should not be; a shorter one ends the program although all is well.
const BEFORE_START: f64 = 2.0;
const FOR_RISE: f64 = 5.0;

/// The dwell after which BUSY must be low once more, s: a contact may bounce for less (docs/reference/formats.md).
const BOUNCE: f64 = 0.05;

/// The wait for the end of a block, s, as docs/reference/formats.md states: of its estimate twice that and this,
/// rounded up.
const FOR_END: f64 = 10.0;

/// How far the estimate of the manifest may lie from that of the program, s.
const ESTIMATE_ROUNDING: f64 = 1e-6;

/// Holds the rule; the estimated times are those of the manifest, which `summary` holds.
pub(super) fn check(stages: &[StageFile], blocks: &[BlockEntry], machine: &Machine, rule: &mut Rule) {
    rule.ran = true;
    let estimates: BTreeMap<&str, f64> = blocks.iter().map(|b| (b.id.as_str(), b.time_s)).collect();
    for stage in stages {
        let state = LaserState {
            stage,
            rule,
            settle: machine.stage.settle.by_axis().map(Time::as_s),
            moved: [false; 2],
            estimates: &estimates,
            block: "",
            off: false,
            settled: true,
            idle: false,
            fired: true,
            part: PartState::InPlace,
        };
        if stage.handshake && !stage.is_frames { state.handshake() } else { state.operator() }
    }
}

/// Whether the part lies as the blocks need it.
#[derive(Clone, Copy, PartialEq, Eq)]
enum PartState {
    InPlace,
    /// A set-up has begun, the stop at which the part is moved is still to come.
    ToBeMoved,
    /// The stop has come, the set-up's first block is still to come.
    Moved,
}

/// The state of laser, stage and part while a stage program is followed.
struct LaserState<'a> {
    stage: &'a StageFile,
    rule: &'a mut Rule,
    /// Settling time of x and y with the axes that turn, and of z, s.
    settle: [f64; 2],
    /// Which of them were sent since the last dwell.
    moved: [bool; 2],
    /// Estimated time of each block, s.
    estimates: &'a BTreeMap<&'a str, f64>,
    block: &'a str,
    /// Whether the output is known to be off.
    off: bool,
    /// Whether the stage stands still since the last move.
    settled: bool,
    /// Whether BUSY is known to be off since the last move or mark.
    idle: bool,
    /// Whether the block has fired.
    fired: bool,
    part: PartState,
}

impl<'a> LaserState<'a> {
    fn broken(&mut self, line: usize, message: impl Into<String>) {
        let place = self.stage.place(line);
        self.rule.broken(self.block, place, message);
    }

    fn begin(&mut self, id: &'a str, line: usize) {
        if !self.fired {
            self.broken(line, "this block ends without START or M0");
        }
        self.is_placed(line);
        (self.block, self.fired, self.part) = (id, false, PartState::InPlace);
    }

    /// Holds that the stop of a set-up has come.
    fn is_placed(&mut self, line: usize) {
        if self.part == PartState::ToBeMoved {
            self.broken(line, "the set-up begins without a stop (M0) at which the part is moved");
        }
    }

    fn setup(&mut self, line: usize) {
        if !self.fired {
            self.broken(line, "a set-up begins before the block has its START or M0");
        }
        self.part = PartState::ToBeMoved;
    }

    /// The stop at which the part is moved; returns whether it is one.
    fn is_moved(&mut self, line: usize) -> bool {
        if self.part != PartState::ToBeMoved {
            return false;
        }
        if !self.off {
            self.broken(line, "the part is moved while the laser output is not known to be off");
        }
        self.part = PartState::Moved;
        true
    }

    fn dwell(&mut self, seconds: f64, line: usize) {
        // Without a move it is the zoom optic that settles.
        let is_still = self.moved == [false; 2];
        let of_moved = self.settle.iter().zip(self.moved).filter(|(_, moved)| is_still || *moved);
        let settle = of_moved.map(|(s, _)| *s).fold(0.0, f64::max);
        self.moved = [false; 2];
        if seconds < settle - DWELL_ROUNDING {
            self.broken(line, format!("the dwell of {seconds} s is shorter than the settling time {settle} s"));
        }
        if seconds > settle.max(LEAST_SETTLE) + MILLISECOND + DWELL_ROUNDING {
            self.broken(line, format!("the dwell of {seconds} s is longer than the settling time {settle} s"));
        }
        self.settled = true;
    }

    fn moves(&mut self, to: &AxisWords, line: usize) {
        self.moved[1] |= to[2].is_some();
        self.moved[0] |= [0, 1, 3, 4, 5].iter().any(|&axis| to[axis].is_some());
        if !self.off {
            self.broken(line, "the stage moves while the laser output is not known to be off");
        }
        (self.settled, self.idle) = (false, false);
    }

    fn modal(&mut self, codes: &[u32], line: usize) {
        for &code in codes.iter().filter(|c| !HARMLESS.contains(c)) {
            let text = match code {
                640 => "G64 lets the controller round corners".to_owned(),
                _ => format!("G{} is not expected in a stage program", f64::from(code) / 10.0),
            };
            self.broken(line, text);
        }
    }

    fn end(&mut self, line: usize) {
        if !self.off {
            self.broken(line, "the program ends while the laser output is not known to be off");
        }
    }

    fn handshake(mut self) {
        let statements = &self.stage.statements;
        let mut i = 0;
        let mut ended = false;
        while let Some(Statement { line, step }) = statements.get(i) {
            self.rule.checked += 1;
            if ended && !matches!(step, StageStep::Block(..)) {
                self.broken(*line, "something follows the end of the program");
            }
            i += 1;
            match step {
                StageStep::Block(id, _) => self.begin(id, *line),
                StageStep::Setup(_) => self.setup(*line),
                StageStep::Pass(_) | StageStep::FocusShift(_) | StageStep::EntryLift(_) | StageStep::EntryGo(_) => {}
                StageStep::Pause if self.is_moved(*line) => {}
                StageStep::Modal(codes) => self.modal(codes, *line),
                StageStep::Move(to) => self.moves(to, *line),
                StageStep::Dwell(seconds) => self.dwell(*seconds, *line),
                StageStep::OutputOff => self.off = true,
                StageStep::Wait { high: false, .. } => {
                    i = self.wait(i - 1, false, [BEFORE_START; 2], *line);
                    self.idle = true;
                }
                StageStep::OutputOn => i = self.fire(i, *line),
                StageStep::IfOffset(label, _) => i = self.branch(i, *label, *line, "an active offset"),
                StageStep::End => {
                    self.end(*line);
                    ended = true;
                }
                other => self.broken(*line, format!("{} is not expected here", name(other))),
            }
        }
        self.finish(ended);
    }

    /// START at statement `i - 1`: BUSY rises, START falls, BUSY falls. Returns where it continues.
    fn fire(&mut self, i: usize, line: usize) -> usize {
        if !self.settled {
            self.broken(line, "START comes without a dwell after the stage moved");
        }
        if !self.idle {
            self.broken(line, "START comes without a wait for BUSY low: a card that marks, or an inverted BUSY");
        }
        if self.part != PartState::InPlace {
            self.broken(line, "START comes while the part is moved to its next set-up");
        }
        (self.off, self.idle, self.fired) = (false, false, true);
        let i = self.wait(i, true, [FOR_RISE; 2], line);
        let i = match self.stage.statements.get(i) {
            Some(Statement { step: StageStep::OutputOff, .. }) => {
                self.off = true;
                i + 1
            }
            _ => {
                self.broken(line, "START is not cleared (M65 P0) after BUSY has risen");
                i
            }
        };
        let estimate = self.estimates.get(self.block).copied().unwrap_or_default();
        let times = [-ESTIMATE_ROUNDING, ESTIMATE_ROUNDING].map(|by| (2.0 * (estimate + by) + FOR_END).ceil());
        let i = self.wait(i, false, times, line);
        // A contact that bounces while it closes is low for a moment.
        match self.stage.statements.get(i).map(|s| &s.step) {
            Some(StageStep::Dwell(seconds)) if (BOUNCE..=BOUNCE + MILLISECOND).contains(seconds) => {
                self.wait(i + 1, false, times, line)
            }
            _ => {
                self.broken(line, "BUSY is not asked again after a dwell");
                i
            }
        }
    }

    /// A wait for BUSY of so many seconds, at least and at most, and the test that stops the program when it ran out of
    /// time.
    fn wait(&mut self, i: usize, wanted: bool, [least, most]: [f64; 2], line: usize) -> usize {
        let level = if wanted { "high" } else { "low" };
        let statements = &self.stage.statements;
        match statements.get(i).map(|s| &s.step) {
            Some(StageStep::Wait { high, seconds }) if *high == wanted => {
                if !(least..=most).contains(seconds) {
                    let at = statements[i].line;
                    let text = format!("the wait for BUSY {level} lasts {seconds} s, and not {most} s");
                    self.broken(at, text);
                }
            }
            _ => {
                self.broken(line, format!("the wait for BUSY {level} is missing after this START"));
                return i;
            }
        }
        let at = statements[i].line;
        let Some(StageStep::IfTimeout(label)) = statements.get(i + 1).map(|s| &s.step) else {
            self.broken(at, "this wait is not tested for a timeout");
            return i + 1;
        };
        self.branch(i + 2, *label, at, "a timeout of this wait")
    }

    /// A branch from statement `i` on, which must end the program with the output off, whatever else is in it: `off` is
    /// followed through it alone, since after `endif` the program continues as if there had been none. Returns where
    /// that is.
    fn branch(&mut self, i: usize, label: u32, at: usize, what: &str) -> usize {
        let statements = &self.stage.statements;
        let (mut off, mut stops) = (self.off, false);
        for (k, s) in statements.iter().enumerate().skip(i) {
            match &s.step {
                StageStep::EndIf(end) if *end == label => {
                    if !stops {
                        self.broken(at, format!("{what} does not end the program with the output off"));
                    }
                    return k + 1;
                }
                StageStep::OutputOff => off = true,
                StageStep::End if !stops => stops = off,
                other => {
                    self.broken(s.line, format!("{} is not expected in this branch", name(other)));
                    return k;
                }
            }
        }
        self.broken(at, format!("the branch for {what} has no end"));
        statements.len()
    }

    fn operator(mut self) {
        let statements = &self.stage.statements;
        let (mut i, mut ended) = (0, false);
        while let Some(Statement { line, step }) = statements.get(i) {
            i += 1;
            self.rule.checked += 1;
            if ended && !matches!(step, StageStep::Block(..)) {
                self.broken(*line, "something follows the end of the program");
            }
            match step {
                StageStep::Block(id, _) => self.begin(id, *line),
                StageStep::Setup(_) => self.setup(*line),
                StageStep::Pass(_) | StageStep::FocusShift(_) | StageStep::EntryLift(_) | StageStep::EntryGo(_) => {}
                StageStep::Pause if self.is_moved(*line) => {}
                StageStep::Modal(codes) => self.modal(codes, *line),
                StageStep::Move(to) => self.moves(to, *line),
                StageStep::Dwell(seconds) => self.dwell(*seconds, *line),
                StageStep::Registration(_) => {
                    self.is_placed(*line);
                    self.setup(*line);
                }
                // What switches off is what switches on in the program that marks.
                StageStep::SpindleOff if !self.stage.handshake => self.off = true,
                StageStep::OutputOff if self.stage.handshake => self.off = true,
                StageStep::IfOffset(label, _) if self.stage.handshake => {
                    i = self.branch(i, *label, *line, "an active offset");
                }
                StageStep::Pause => {
                    if self.fired {
                        self.broken(*line, "the program stops here, where nothing is to be done");
                    }
                    self.fired = true;
                }
                StageStep::End => {
                    self.end(*line);
                    ended = true;
                }
                other => self.broken(*line, format!("{} is not expected here", name(other))),
            }
        }
        self.finish(ended);
    }

    fn finish(mut self, ended: bool) {
        let last = self.stage.statements.last().map_or(1, |s| s.line);
        if !self.fired {
            self.broken(last, "this block ends without START or M0");
        }
        if !ended {
            self.broken(last, "the program does not end with M2 or M30");
        }
    }
}

/// The name of a step in messages.
fn name(step: &StageStep) -> String {
    match step {
        StageStep::Block(..) => "a block".into(),
        StageStep::Setup(_) => "a set-up".into(),
        StageStep::Registration(_) => "a registration point".into(),
        StageStep::Pass(_) => "a pass".into(),
        StageStep::FocusShift(_) => "a focus shift".into(),
        StageStep::EntryLift(_) => "a lift to begin with".into(),
        StageStep::EntryGo(_) => "a place to begin at".into(),
        StageStep::Modal(_) => "a modal word".into(),
        StageStep::Move(_) => "a move".into(),
        StageStep::Dwell(_) => "a dwell".into(),
        StageStep::OutputOn => "M64 P0".into(),
        StageStep::OutputOff => "M65 P0".into(),
        StageStep::Wait { .. } => "a wait (M66)".into(),
        StageStep::IfTimeout(_) => "a test for a timeout".into(),
        StageStep::IfOffset(..) => "a test for an offset".into(),
        StageStep::EndIf(_) => "endif".into(),
        StageStep::Pause => "M0".into(),
        StageStep::SpindleOff => "M5".into(),
        StageStep::End => "the end".into(),
        StageStep::Unknown(text) => format!("{text:?}"),
    }
}
