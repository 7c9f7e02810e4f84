//! On-the-fly programs: one line a move, its time in the line, the laser switched with the motion.
//!
//! Consumes a checked [`on_the_fly::Program`](crate::on_the_fly::program::Program); promises programs whose samples
//! read back to the nanometre, the millionth of a degree and the microsecond. Words are absolute; an axis that stays
//! has none. A comment `MARK s PEN p` precedes every piece of a stroke: stroke of the texture from 0, pen from 1.
//!
//! The stage goes to the start like that of a stepped program: z lifted, x and y with all that turns and scans,
//! then z alone. At the end it lifts again. The laser is off in all of this, and in every rest.

mod linuxcnc;
mod pmac;

pub use linuxcnc::{SERVO_S as LINUXCNC_SERVO_S, linuxcnc};
pub use pmac::{SERVO_S as PMAC_SERVO_S, blend_us, pmac};

use crate::on_the_fly::axes::motion::AXES;
use crate::on_the_fly::check::{Checked, Figures};
use crate::on_the_fly::program::{AxisCommands, Kind, Mark, Move, Program};
use terrace_core::machine::Machine;
use terrace_core::program::PenId;

/// How far a controller that blends moves may round a corner of a mark, mm.
pub(crate) const BLEND_MM: f64 = 2e-4;

/// Letters of all axes of a sample.
const LETTERS: [u8; AXES] = *b"XYZACUV";

/// Where the axes are, so that only those that move get a word.
struct AxisWords<'a> {
    to: AxisCommands,
    kind: Kind,
    machine: &'a Machine,
}

impl<'a> AxisWords<'a> {
    fn start(program: &Program, machine: &'a Machine) -> Self {
        Self { to: program.start, kind: program.kind, machine }
    }

    /// Appends a word, after a blank, for each of these axes that moves to `to`; returns whether any does.
    fn append(&mut self, out: &mut Vec<u8>, to: &AxisCommands) -> bool {
        let mut moves = false;
        for &k in self.kind.axes() {
            if to[k] != self.to[k] {
                word(out, k, written(self.machine, k, to[k]));
                moves = true;
            }
        }
        self.to = *to;
        moves
    }
}

/// The command of an axis as its controller takes it.
fn written(machine: &Machine, axis: usize, to: i64) -> i64 {
    let table = machine.tilt.as_ref().filter(|_| matches!(axis, 3 | 4));
    table.map_or(to, |table| table.axes[axis - 3].written(to))
}

/// Appends a blank, the letter of an axis and where it goes; degrees have six decimals as well.
fn word(out: &mut Vec<u8>, axis: usize, to: i64) {
    out.extend_from_slice(&[b' ', LETTERS[axis]]);
    super::push_mm(out, to);
}

/// The lines that go to the start, z apart: lift, all others, down. `rapid` begins each.
fn approach(out: &mut Vec<u8>, checked: &Checked, machine: &Machine, rapid: &str) {
    let program = checked.program();
    let begin = |out: &mut Vec<u8>| out.extend_from_slice(rapid.as_bytes());
    begin(out);
    word(out, 2, machine.retract_z().0);
    out.push(b'\n');
    begin(out);
    for &k in program.kind.axes().iter().filter(|&&k| k != 2) {
        word(out, k, written(machine, k, program.start[k]));
    }
    out.push(b'\n');
    begin(out);
    word(out, 2, program.start[2]);
    out.push(b'\n');
}

/// Appends microseconds as a decimal in units of this many of them, without zeros at its end: of ms with 1000.
fn push_time(out: &mut Vec<u8>, us: i64, unit: i64) {
    let digits = unit.ilog10() as usize;
    let text = format!("{}.{:0digits$}", us / unit, us % unit);
    out.extend_from_slice(text.trim_end_matches('0').trim_end_matches('.').as_bytes());
}

/// Which piece of a stroke is being marked, and with which pen.
#[derive(Default)]
struct Pieces {
    piece: Option<Mark>,
    pen: Option<PenId>,
}

impl Pieces {
    /// Where a piece begins with this move: its comment, and its pen where that is another than before.
    fn begin(&mut self, mark: Option<Mark>) -> Option<(String, Option<PenId>)> {
        let new = mark.filter(|_| mark != self.piece);
        self.piece = mark;
        let new = new?;
        let pen = (self.pen != Some(new.pen)).then_some(new.pen);
        self.pen = Some(new.pen);
        Some((format!("MARK {} PEN {}", new.source.0, new.pen.number()), pen))
    }
}

/// How far the power that is written may lie from what the speed of the spot asks for, as a share of the pen's.
const POWER_STEP: f64 = 0.005;

/// The power of marks as it is written, percent of the laser's.
struct Powers<'a> {
    checked: &'a Checked,
    machine: &'a Machine,
    written: Option<f64>,
}

impl<'a> Powers<'a> {
    fn new(checked: &'a Checked, machine: &'a Machine) -> Self {
        Self { checked, machine, written: None }
    }

    /// The power to be set before a move of a mark that takes `s`; None where that is set already. A new mark always
    /// has its own where power follows the speed.
    fn before(&mut self, from: &AxisCommands, to: &Move, s: f64, is_new: bool) -> Option<String> {
        let mark = to.mark.filter(|_| self.checked.power_by_speed())?;
        let pen = &self.checked.program().pens[mark.pen.index()];
        let full = self.machine.laser.max_power;
        let most = pen.power.as_w(full) / full.as_w() * 100.0;
        let spot = self.checked.program().spots(self.machine).ok()?;
        let wanted = most * (spot(from).way(&spot(&to.to)) / (s * pen.speed.as_mm_s())).min(1.0);
        let is_near = self.written.is_some_and(|written| (written - wanted).abs() <= POWER_STEP * most);
        if is_near && !is_new {
            return None;
        }
        self.written = Some(wanted);
        Some(format!("{wanted:.3}"))
    }
}

/// How long the stage rests before the first mark, us.
fn settle(machine: &Machine) -> i64 {
    ((machine.stage.settle.longest() * 1e6).ceil() as i64).max(50_000)
}

/// Power of a pen in percent of the laser's, three decimals.
fn percent(checked: &Checked, machine: &Machine, pen: PenId) -> String {
    let full = machine.laser.max_power;
    format!("{:.3}", checked.program().pens[pen.index()].power.as_w(full) / full.as_w() * 100.0)
}

/// The head of every program; the servo of its controller has the period `servo_s` where the machine states none.
fn head(checked: &Checked, machine: &Machine, servo_s: f64) -> Vec<String> {
    let Figures { time_s, marks, mark_speed, .. } = checked.figures();
    let servo_s = machine.controller.servo_s(servo_s);
    let mut lines = vec![
        format!("machine: {}", super::quoted(&machine.name)),
        format!("{} moves, {marks} marks, {time_s:.3} s", checked.program().moves.len()),
        format!("laser switched up to one servo period of {} ms early: {mark_speed:.1} mm/s x period", servo_s * 1e3),
        format!("LASER ERROR {:.6} mm", checked.figures().laser_error_mm(servo_s)),
    ];
    for (i, pen) in checked.program().pens.iter().enumerate() {
        lines.push(format!(
            "pen {}: {}, {} mm/s, {} at {} kHz",
            i + 1,
            super::quoted(&pen.name),
            pen.speed.as_mm_s(),
            pen.power.to_string().replace('%', "percent"),
            pen.frequency.as_khz()
        ));
    }
    lines.push("not a safety system: the laser needs its own interlock".into());
    lines
}

/// A comment's text, cut to its line.
fn clean(text: &str, longest: usize) -> String {
    let mut plain = super::plain(text);
    plain.truncate(longest);
    plain
}

#[cfg(test)]
mod tests;
