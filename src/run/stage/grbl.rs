//! GRBL 1.1 on a serial port: three axes X, Y and Z, in mm.
//!
//! Moves are those of `stage_m0.nc`: `G0` to absolute positions with G90 and G21 in the work offset that is active.
//! That offset must be the one of G54, because a reset clears all others. One line is sent at a time and its answer
//! awaited, so GRBL's receive buffer never holds more than one.
//!
//! The stage stands where GRBL is idle and its step counter is within half a step of the target, and the rounding of
//! two reports. GRBL has no encoders: lost steps are not seen. How long the mechanics settle is not GRBL's to know.
//!
//! An abort is looked at between answers, for none of which the driver waits longer than `TIMEOUTS` says.
//!
//! Sources: the pages "Interface", "Commands" and "Settings" of the documentation of GRBL 1.1.

mod link;
mod reply;

use std::time::{Duration, Instant};

use self::link::{LONGEST_LINE, Link};
use self::reply::{Reply, Report, State};
use super::super::Interrupt;
use super::{Move, Stage};
use terrace_core::diag::Diag;

const DEFAULT_BAUD: u32 = 115_200;

/// The axes in the order of GRBL's reports.
const AXES: [char; 3] = ['X', 'Y', 'Z'];

/// Modes as in the stage programs; the work offset must be that of G54 already.
const MODES: &str = "G21 G90 G94 G17 G40 G80";

/// Number of the setting: 1 where GRBL reports in inches.
const REPORT_INCHES: u16 = 13;
/// Number of the setting: 1 where GRBL can home.
const HOMING: u16 = 22;
/// Number of the setting: steps per mm of X; Y and Z have the next ones.
const STEPS_MM: u16 = 100;
/// Number of the setting: highest speed of X, mm/min; Y and Z have the next ones.
const MAX_RATE: u16 = 110;
/// Number of the setting: acceleration of X, mm/s²; Y and Z have the next ones.
const ACCELERATION: u16 = 120;

/// Real-time commands.
const FEED_HOLD: u8 = b'!';
const RESET: u8 = 0x18;
const STATUS: u8 = b'?';

/// Time between two status requests.
const POLL: Duration = Duration::from_millis(20);

/// Requests for status until one must hold the work offset: GRBL sends it in every tenth or thirtieth.
const OFFSET_REPORTS: usize = 40;

/// What the position of a report may be off by beyond half a step: position and work offset are each rounded to whole
/// um, and single precision adds a little.
const ROUNDING_NM: i64 = 1_100;

/// How long the driver waits.
#[derive(Clone, Copy, Debug)]
struct Timeouts {
    /// For an answer.
    answer: Duration,
    /// Until a request for status is repeated.
    repeat: Duration,
    /// For the first answer: opening the port resets many boards, and their boot loaders take 2 s.
    boot: Duration,
    /// For a motion that a run before has left to end.
    motion: Duration,
    /// For a feed hold to end the motion.
    hold: Duration,
    /// Until GRBL begins with a motion that it took.
    begin: Duration,
    /// Added to the longest time of a move.
    spare: Duration,
}

const TIMEOUTS: Timeouts = Timeouts {
    answer: Duration::from_secs(2),
    repeat: Duration::from_millis(250),
    boot: Duration::from_secs(6),
    motion: Duration::from_secs(60),
    hold: Duration::from_secs(3),
    begin: Duration::from_millis(500),
    spare: Duration::from_secs(10),
};

/// What GRBL's settings say of an axis.
#[derive(Clone, Copy, Debug)]
struct Axis {
    step_nm: f64,
    /// Highest speed, nm/s.
    speed: f64,
    /// Acceleration, nm/s².
    acceleration: f64,
}

/// A stage with GRBL 1.1.
pub struct Grbl {
    port: String,
    baud: u32,
    identity: Option<String>,
    timeouts: Timeouts,
    link: Option<Link>,
    axes: [Axis; 3],
    /// Work offset, nm.
    offset: [i64; 3],
    /// Whether GRBL was locked when the driver halted it: its position is not certain then.
    is_locked: bool,
}

/// Names of the serial ports of this computer.
///
/// # Errors
/// Why the system does not say.
pub fn ports() -> Result<Vec<String>, String> {
    link::ports()
}

impl Grbl {
    /// The stage at a serial port such as `/dev/ttyUSB0` or `COM3`; `baud` is 115200 where it is None. `identity` must
    /// be part of what `$I` answers. [`Stage::open`] connects.
    pub fn new(port: impl Into<String>, baud: Option<u32>, identity: Option<String>) -> Self {
        let axis = Axis { step_nm: 0.0, speed: 1.0, acceleration: 1.0 };
        Self {
            port: port.into(),
            baud: baud.unwrap_or(DEFAULT_BAUD),
            identity,
            timeouts: TIMEOUTS,
            link: None,
            axes: [axis; 3],
            offset: [0; 3],
            is_locked: false,
        }
    }

    fn link(&mut self) -> Result<&mut Link, Diag> {
        self.link.as_mut().ok_or_else(|| Diag::bug("grbl-closed", "the stage was used before it was opened"))
    }

    /// Waits for what `wanted` takes from the replies; None where it does not come in time. An alarm or a restart is a
    /// fault.
    fn wait<T>(&mut self, longest: Duration, mut wanted: impl FnMut(&Reply) -> Option<T>) -> Result<Option<T>, Diag> {
        let until = Instant::now() + longest;
        while let Some(reply) = self.link()?.next(until)? {
            match reply {
                Reply::Alarm(number) => return Err(alarm(number)),
                Reply::Banner => {
                    return Err(Diag::limit("grbl-reset", "GRBL has started anew: it was reset or lost its supply")
                        .hint("find the cause; home the stage with $H, then start the run again"));
                }
                _ => {}
            }
            if let Some(found) = wanted(&reply) {
                return Ok(Some(found));
            }
            if Instant::now() >= until {
                break;
            }
        }
        Ok(None)
    }

    /// A new status report.
    fn report(&mut self) -> Result<Report, Diag> {
        let Timeouts { answer, repeat, .. } = self.timeouts;
        let begin = Instant::now();
        while begin.elapsed() < answer {
            self.link()?.real_time(STATUS)?;
            let found = self.wait(repeat, |reply| match reply {
                Reply::Report(report) => Some(*report),
                _ => None,
            })?;
            if let Some(report) = found {
                if report.offset.is_some_and(|offset| offset != self.offset) {
                    return Err(Diag::limit("grbl-offset", "the work offset of GRBL has changed during the run")
                        .hint("nothing else may command the controller during a run; check the zero of the part"));
                }
                return Ok(report);
            }
        }
        Err(silence(answer))
    }

    /// Sends a line and waits until GRBL has taken it; returns what it sent before that.
    fn command(&mut self, line: &str) -> Result<Vec<Reply>, Diag> {
        self.link()?.send(line)?;
        let mut replies = Vec::new();
        let end = self.wait(self.timeouts.answer, |reply| match reply {
            Reply::Ok => Some(None),
            Reply::Error(number) => Some(Some(*number)),
            other => {
                replies.push(other.clone());
                None
            }
        })?;
        match end {
            Some(None) => Ok(replies),
            Some(Some(number)) => {
                let text = format!("GRBL refuses {line:?} with error:{number}: {}", reply::error(number));
                Err(Diag::limit("grbl-refused", text).hint("where the line is damaged, check cable and baud rate"))
            }
            None => Err(silence(self.timeouts.answer)),
        }
    }

    /// Waits for GRBL's first answer and for the end of a motion, and asks what it is.
    fn identify(&mut self, interrupt: &Interrupt) -> Result<String, Diag> {
        let begin = Instant::now();
        let mut was_reset = false;
        let state = loop {
            interrupt.check()?;
            self.link()?.real_time(STATUS)?;
            let until = Instant::now() + self.timeouts.repeat;
            let mut state = None;
            while let Some(reply) = self.link()?.next(until)? {
                match reply {
                    Reply::Banner => was_reset = true,
                    Reply::Report(report) => state = Some(report.state),
                    _ if Instant::now() < until => continue,
                    _ => {}
                }
                break;
            }
            match state {
                // What a run before has begun comes to its end.
                Some(state) if state.moves() && begin.elapsed() < self.timeouts.motion => std::thread::sleep(POLL),
                Some(state) => break state,
                None if begin.elapsed() < self.timeouts.boot => {}
                None => {
                    let text = format!("nothing on {} answers as GRBL does, at {} baud", self.port, self.baud);
                    let hint = "check stage.port and stage.baud; after a limit switch GRBL answers nothing until it \
                                is reset: reset it and home it";
                    return Err(Diag::input("grbl-answer", text).hint(hint));
                }
            }
        };
        if state == State::Alarm {
            return Err(not_homed(&self.port, was_reset));
        }
        if state != State::Idle {
            let text = format!("GRBL is {}", state.words());
            return Err(Diag::input("grbl-state", text).hint("bring it to rest, then start the run again"));
        }
        // A line that a killed run left unfinished spoils the first command, which is then refused.
        let info = self.command("$I").or_else(|_| self.command("$I"))?;
        let lines = info.iter().filter_map(|reply| match reply {
            Reply::Other(line) => Some(line.as_str()),
            _ => None,
        });
        let info = lines.collect::<Vec<_>>().join(" ");
        if !info.contains("[VER:1.1") {
            let text = format!("the controller on {} is not GRBL 1.1: $I answers {info:?}", self.port);
            return Err(Diag::input("grbl-identity", text).hint("this driver is for GRBL 1.1"));
        }
        match &self.identity {
            Some(name) if !info.contains(name.as_str()) => {
                let text = format!("the controller on {} is not {name:?}: $I answers {info:?}", self.port);
                Err(Diag::input("grbl-identity", text).hint("check stage.port and stage.identity; $I=NAME sets a name"))
            }
            _ => Ok(info),
        }
    }

    /// Reads the settings, sets the modes, switches the output off, and learns the work offset.
    fn make_ready(&mut self, interrupt: &Interrupt) -> Result<Report, Diag> {
        let replies = self.command("$$")?;
        if setting(&replies, HOMING) != Some(1.0) {
            let hint = "a stage that cannot home does not know where it is; fit limit switches and set $22=1";
            return Err(Diag::input("grbl-setting", "homing of GRBL is off ($22)").hint(hint));
        }
        if setting(&replies, REPORT_INCHES) != Some(0.0) {
            return Err(Diag::input("grbl-setting", "GRBL reports in inches ($13)").hint("set $13=0"));
        }
        for (k, axis) in self.axes.iter_mut().enumerate() {
            let k = k as u16;
            let steps_mm = positive_setting(&replies, STEPS_MM + k)?;
            let mm_min = positive_setting(&replies, MAX_RATE + k)?;
            let mm_s2 = positive_setting(&replies, ACCELERATION + k)?;
            *axis = Axis { step_nm: 1e6 / steps_mm, speed: mm_min * 1e6 / 60.0, acceleration: mm_s2 * 1e6 };
        }
        interrupt.check()?;
        self.command(MODES)?;
        self.command("M5")?;
        self.learn_offset()?;
        let report = self.report()?;
        if report.is_on {
            return Err(Diag::limit("grbl-output", "GRBL's output is on after M5").hint("check the controller"));
        }
        Ok(report)
    }

    /// Learns the active work offset, which must be that of G54.
    fn learn_offset(&mut self) -> Result<(), Diag> {
        let replies = self.command("$#")?;
        let g54 = replies.iter().find_map(|reply| match reply {
            Reply::G54(offset) => Some(*offset),
            _ => None,
        });
        let g54 = g54.ok_or_else(|| silence(self.timeouts.answer))?;
        self.offset = g54;
        for _ in 0..OFFSET_REPORTS {
            match self.report() {
                Ok(Report { offset: None, .. }) => {}
                Ok(_) => return Ok(()),
                Err(fault) if fault.code == "grbl-offset" => {
                    let text = "the active work offset of GRBL is not that of G54";
                    let hint =
                        "a reset clears G92, G43.1 and G55 to G59: switch to G54 and set the zero with G10 L20 P1";
                    return Err(Diag::input("grbl-zero", text).hint(hint));
                }
                Err(fault) => return Err(fault),
            }
        }
        Err(Diag::input("grbl-zero", "GRBL does not report its work offset (WCO)").hint("use the standard build"))
    }

    /// Position in work coordinates, nm.
    fn work(&self, report: &Report) -> [i64; 3] {
        let shift = if report.is_work { [0; 3] } else { self.offset };
        [0, 1, 2].map(|k| report.position[k] - shift[k])
    }

    /// Whether the stage stands at a target.
    fn is_at(&self, report: &Report, target: &[(usize, i64)]) -> bool {
        let work = self.work(report);
        target.iter().all(|&(k, nm)| {
            let most = (self.axes[k].step_nm / 2.0).ceil() as i64 + ROUNDING_NM;
            (work[k] - nm).abs() <= most
        })
    }

    /// The longest time that a move can take: axes one after the other, at the lowest rapid override, 25 %.
    fn longest(&self, from: &Report, target: &[(usize, i64)]) -> Duration {
        let work = self.work(from);
        let s: f64 = target
            .iter()
            .map(|&(k, nm)| {
                let axis = self.axes[k];
                (nm - work[k]).abs() as f64 / axis.speed + axis.speed / axis.acceleration
            })
            .sum();
        Duration::from_secs_f64((4.0 * s).min(86_400.0)) + self.timeouts.spare
    }

    /// Sends a move and waits until the stage stands at its target.
    fn travel(&mut self, line: &str, target: &[(usize, i64)], interrupt: &Interrupt) -> Result<(), Diag> {
        let before = self.report()?;
        if before.state != State::Idle {
            return Err(in_state(before.state));
        }
        self.command(line)?;
        let begin = Instant::now();
        let longest = self.longest(&before, target);
        // Since when GRBL is idle beside its target.
        let mut idle = None;
        loop {
            if interrupt.is_abort() {
                return Err(Diag::limit("grbl-aborted", "the run was aborted during a move of the stage"));
            }
            let report = self.report()?;
            match report.state {
                State::Idle if self.is_at(&report, target) => return Ok(()),
                // GRBL may answer once more before it begins.
                State::Idle => {
                    if idle.get_or_insert_with(Instant::now).elapsed() > self.timeouts.begin {
                        let at = mm(&self.work(&report));
                        let text = format!("GRBL took {line:?}, is idle, and the stage is at {at}");
                        let hint = "a character was lost on the line, or something else moved the stage: check the \
                                    cable, and that nothing else commands the controller";
                        return Err(Diag::limit("grbl-position", text).hint(hint));
                    }
                }
                State::Run => idle = None,
                other => return Err(in_state(other)),
            }
            if begin.elapsed() > longest {
                let text = format!("{line:?} has not ended within {} s", longest.as_secs());
                return Err(Diag::limit("grbl-time", text).hint("check the stage; home it, then start the run again"));
            }
            std::thread::sleep(POLL);
        }
    }

    /// The state, alarms and restarts passed over; None where GRBL does not answer.
    fn state(&mut self, longest: Duration) -> Result<Option<State>, Diag> {
        let begin = Instant::now();
        while begin.elapsed() < longest {
            self.link()?.real_time(STATUS)?;
            let until = Instant::now() + self.timeouts.repeat;
            while let Some(reply) = self.link()?.next(until)? {
                if let Reply::Report(report) = reply {
                    return Ok(Some(report.state));
                }
                if Instant::now() >= until {
                    break;
                }
            }
        }
        Ok(None)
    }

    /// Holds the motion, then resets GRBL, which empties its planner and switches its output off.
    fn reset(&mut self, state: Option<State>) -> Result<(), Diag> {
        let Timeouts { answer, hold, .. } = self.timeouts;
        if state.is_none_or(State::moves) {
            self.link()?.real_time(FEED_HOLD)?;
        }
        if state.is_some_and(State::moves) {
            self.rest(hold)?;
        }
        self.link()?.real_time(RESET)?;
        self.link()?.forget();
        let until = Instant::now() + answer;
        let mut is_reset = false;
        while let Some(reply) = self.link()?.next(until)? {
            is_reset = reply == Reply::Banner;
            if is_reset || Instant::now() >= until {
                break;
            }
        }
        let after = if is_reset { self.rest(answer)? } else { None };
        self.is_locked = after == Some(State::Alarm);
        match after {
            Some(_) => Ok(()),
            None => Err(uncertain("GRBL does not answer to a reset")),
        }
    }

    /// The state in which motion has ended; None where it does not end in time, or GRBL does not answer.
    fn rest(&mut self, longest: Duration) -> Result<Option<State>, Diag> {
        let begin = Instant::now();
        while begin.elapsed() < longest {
            match self.state(self.timeouts.answer)? {
                Some(state) if !state.moves() => return Ok(Some(state)),
                _ => std::thread::sleep(POLL),
            }
        }
        Ok(None)
    }

    /// Switches the output off: by a command where GRBL is idle and answers, else by a reset.
    fn switch_off(&mut self) -> Result<(), Diag> {
        let state = self.state(self.timeouts.repeat)?;
        // A line without its end would become one with M5, and move.
        let is_clear = self.link()?.is_answered();
        if is_clear && state == Some(State::Idle) && self.command("M5").is_ok() {
            self.is_locked = false;
            return Ok(());
        }
        self.reset(state)
    }

    /// A fault of a move, with what is certain after the stage was halted.
    fn halted(&mut self, mut fault: Diag) -> Diag {
        let end = match self.halt() {
            Ok(()) if self.is_locked || fault.code == "grbl-reset" => {
                "the stage is halted and its output off; its position is not certain: home it".to_owned()
            }
            Ok(()) => "the stage is halted and its output off; its position is kept".to_owned(),
            Err(e) => e.message,
        };
        fault.message = format!("{}; {end}", fault.message);
        fault
    }
}

impl Stage for Grbl {
    fn open(&mut self, interrupt: &Interrupt) -> Result<String, Diag> {
        self.link = Some(Link::open(&self.port, self.baud)?);
        // What is not the control that was meant gets nothing more.
        let info = self.identify(interrupt).inspect_err(|_| self.link = None)?;
        let report = self.make_ready(interrupt)?;
        Ok(format!("GRBL on {}: {info}, at {}", self.port, mm(&self.work(&report))))
    }

    fn go(&mut self, to: &Move, interrupt: &Interrupt) -> Result<(), Diag> {
        let target = target(to)?;
        let line = line(to);
        self.travel(&line, &target, interrupt).map_err(|fault| self.halted(fault))
    }

    fn halt(&mut self) -> Result<(), Diag> {
        if self.link.is_none() {
            return Ok(());
        }
        self.switch_off().map_err(|e| if e.code == "grbl-off" { e } else { uncertain(&e.message) })
    }
}

/// The value of a setting in the answer to `$$`.
fn setting(replies: &[Reply], number: u16) -> Option<f64> {
    replies.iter().find_map(|reply| match reply {
        Reply::Setting(n, value) if *n == number => Some(*value),
        _ => None,
    })
}

/// The value of a setting that must be above zero.
fn positive_setting(replies: &[Reply], number: u16) -> Result<f64, Diag> {
    setting(replies, number).filter(|value| value.is_finite() && *value > 0.0).ok_or_else(|| {
        Diag::input("grbl-setting", format!("GRBL's setting ${number} is missing or not positive"))
            .hint("check the settings with $$")
    })
}

/// The line of a move, in the decimals of the stage programs.
fn line(to: &Move) -> String {
    let words = to.0.iter().map(|&(axis, nm)| {
        let sign = if nm < 0 { "-" } else { "" };
        let size = nm.unsigned_abs();
        format!(" {axis}{sign}{}.{:06}", size / 1_000_000, size % 1_000_000)
    });
    format!("G90 G21 G0{}", words.collect::<String>())
}

/// The axes of a move by their numbers.
fn target(to: &Move) -> Result<Vec<(usize, i64)>, Diag> {
    let number = |axis: char| AXES.iter().position(|a| *a == axis);
    let target: Option<Vec<_>> = to.0.iter().map(|&(axis, nm)| Some((number(axis)?, nm))).collect();
    let fits = line(to).len() <= LONGEST_LINE;
    target.filter(|target| fits && !target.is_empty()).ok_or_else(|| {
        Diag::input("grbl-axes", format!("GRBL cannot go to {:?}", line(to)))
            .hint("GRBL 1.1 has the axes X, Y and Z: use another controller for tilt axes")
    })
}

/// A position in mm.
fn mm(work: &[i64; 3]) -> String {
    let words = AXES.iter().zip(work).map(|(axis, nm)| format!("{axis}{:.3}", *nm as f64 / 1e6));
    words.collect::<Vec<_>>().join(" ")
}

fn alarm(number: u8) -> Diag {
    Diag::limit("grbl-alarm", format!("GRBL reports ALARM:{number}: {}", reply::alarm(number)))
        .hint("remove the cause; home the stage with $H, then start the run again")
}

fn in_state(state: State) -> Diag {
    Diag::limit("grbl-state", format!("GRBL is {}", state.words()))
        .hint("bring it to rest, idle and homed, then start the run again")
}

fn silence(longest: Duration) -> Diag {
    Diag::limit("grbl-answer", format!("GRBL has not answered for {:.1} s", longest.as_secs_f64()))
        .hint("check the cable, the power supply of the board and its limit switches; home the stage, then start again")
}

fn uncertain(why: &str) -> Diag {
    let text = format!(
        "{why}: it is not certain that the stage has stopped, nor where it is; its output was switched off when the run began"
    );
    Diag::limit("grbl-off", text).hint("use the emergency stop; home the stage before anything else")
}

fn not_homed(port: &str, was_reset: bool) -> Diag {
    let text = format!("GRBL on {port} is locked: it is not homed, or an alarm has locked it");
    let hint = if was_reset {
        "opening the port has reset the board: prevent that (on Linux with `stty -F PORT -hupcl`, or on the board), \
         home the stage with $H, then start the run again"
    } else {
        "remove the cause of an alarm; home the stage with $H in a terminal, not $X, then start the run again"
    };
    Diag::input("grbl-homing", text).hint(hint)
}

#[cfg(test)]
mod tests;
