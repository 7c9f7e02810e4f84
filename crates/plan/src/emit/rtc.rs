//! One text per block with lists for SCANLAB RTC boards, in the units of the board.
//!
//! The boards are programmed through a library, not by files: whoever calls it goes through the lines, one call a line.
//! A keyword and its integers or decimals; points are bits in controller coordinates from the optical axis. A list has
//! at most `rtc.list_memory` commands and begins with all settings, so that each can be loaded by itself; no stroke is
//! divided between two. A dot is a jump, and `laser_on` with its dwell in 10 us. A stroke is repeated as often as its pen
//! has passes.

use std::io::Write;

use super::cards;
use super::known::{JobPens, Key, KnownFault};
use crate::check::Checked;
use terrace_core::diag::{Diag, Place};
use terrace_core::geom::{ControllerPoint, FieldPoint, NM_PER_MM, Nm};
use terrace_core::machine::{Machine, Rtc, RtcBoard};
use terrace_core::program::{Block, Pen, Program};
use terrace_core::units::{Speed, Time};

/// Lines of a list that are not jumps and marks: its settings, its end, and a change of pen.
const SETTINGS: usize = 8;

/// How a board counts.
struct Counts {
    name: &'static str,
    /// Least and greatest coordinate.
    range: [i64; 2],
    /// Slowest and fastest speed, bits per ms.
    speeds: [f64; 2],
    /// Laser delays and pulse periods in one us.
    delay: f64,
    period: f64,
}

fn counts(board: RtcBoard) -> Counts {
    let small = ([-0x8000, 0x7FFF], [0.1, 50_000.0]);
    let large = ([-0x8_0000, 0x7_FFFF], [1.6, 800_000.0]);
    let (name, (range, speeds), delay, period) = match board {
        RtcBoard::Rtc4 => ("rtc4", small, 1.0, 8.0),
        RtcBoard::Rtc5 => ("rtc5", large, 2.0, 64.0),
        RtcBoard::Rtc6 => ("rtc6", large, 64.0, 64.0),
    };
    Counts { name, range, speeds, delay, period }
}

/// The lists of block `index`.
///
/// # Panics
/// If there is no such block, or the machine has no RTC board, as the table of targets makes sure.
pub fn block(checked: &Checked, machine: &Machine, index: usize) -> Vec<u8> {
    let program = checked.program();
    let block = &program.blocks[index];
    let rtc = machine.rtc.expect("a job for a board has one");
    let mut out = Text { bytes: Vec::new(), machine, rtc, counts: counts(rtc.board) };
    let name = out.counts.name;
    out.line(format_args!("terrace rtc 1\nboard {name}\nblock {}", program.id(index)));
    let (mut list, mut used, mut set) = (0, usize::MAX, None);
    for stroke in program.strokes_of(block) {
        let points = program.points_of(stroke);
        let pen = &program.pens[stroke.pen.index()];
        for _ in 0..pen.passes {
            if used.saturating_add(points.len() + SETTINGS) > rtc.list_memory {
                if list > 0 {
                    out.line(format_args!("end"));
                }
                (list, used, set) = (list + 1, SETTINGS, None);
                out.line(format_args!("list {list}"));
                out.delays(block);
            }
            if set != Some(stroke.pen) {
                set = Some(stroke.pen);
                used += 3;
                out.pen(pen);
            }
            used += points.len() + usize::from(stroke.is_dot());
            let mut last = None;
            for at @ [x, y] in points.iter().map(|&point| bits(&rtc, machine, point)) {
                // Points that are one in bits are marked once.
                if last != Some(at) {
                    out.line(format_args!("{} {x} {y}", if last.is_none() { "jump" } else { "mark" }));
                }
                last = Some(at);
            }
            if stroke.is_dot() {
                let dwell = pen.dwell.and_then(cards::dwell).expect("the faults of the board were looked for");
                out.line(format_args!("laser_on {dwell}"));
            }
        }
    }
    out.line(format_args!("end"));
    out.bytes
}

/// What of pens and machine the board cannot take.
pub(super) fn known_faults(job: &JobPens<'_>) -> Vec<KnownFault> {
    let machine = job.machine;
    let Some(rtc) = machine.rtc else {
        let text = "emit.formats has \"rtc\", but the machine file has no [rtc]";
        let hint = "state rtc.board, and rtc.bits_per_mm from the correction file";
        return vec![(Key::Format, Diag::input("emit-rtc", text).hint(hint))];
    };
    let Counts { name, speeds, .. } = counts(rtc.board);
    let mut faults = Vec::new();
    let jump = (Key::Machine("scanner.jump_speed"), "scanner.jump_speed".to_owned(), machine.scanner.jump_speed);
    let pens = job.pens.iter().enumerate();
    let pens = pens.map(|(i, pen)| (Key::Pen(i, "speed"), format!("pen {:?}", pen.name), pen.speed));
    for (key, what, speed) in std::iter::once(jump).chain(pens) {
        let bits = speed.as_mm_s() * rtc.bits_per_mm / 1000.0;
        if !(speeds[0]..=speeds[1]).contains(&bits) {
            let text = format!("{what}: {speed} are {bits} bits per ms, {name} takes {} to {}", speeds[0], speeds[1]);
            faults.push((key, Diag::limit("rtc-speed", text).hint("check rtc.bits_per_mm")));
        }
    }
    if let Some((i, text)) = cards::dwell_fault(job.pens) {
        faults.push((Key::Pen(i, "dwell"), Diag::limit("rtc-dwell", text).hint(cards::DWELL_HINT)));
    }
    faults
}

/// What of a program the board would clip or lose.
pub(super) fn faults(program: &Program, machine: &Machine) -> Vec<Diag> {
    let Some(rtc) = machine.rtc else { return Vec::new() };
    let Counts { name, range, .. } = counts(rtc.board);
    let is_within = |bits: i64| (range[0]..=range[1]).contains(&bits);
    let mut faults = Vec::new();
    if let Some(p) = program.points.iter().find(|&&p| !bits(&rtc, machine, p).into_iter().all(is_within)) {
        let [x, y] = bits(&rtc, machine, *p);
        let text = format!("a mark lies at ({x}, {y}) bits, {name} has {} to {}", range[0], range[1]);
        let hint = "check rtc.bits_per_mm; a smaller partition.section keeps marks near the centre";
        faults.push(Diag::limit("rtc-field", text).hint(hint));
    }
    let place = |i: usize| Place::Block(program.id(i).to_string());
    let focus = |b: &Block| rtc.focus_bits_per_mm.map(|scale| (b.focus_shift.mm() * scale).round() as i64);
    let unfocused = |b: &Block| b.focus_shift != Nm(0) && !focus(b).is_some_and(is_within);
    if let Some(i) = program.blocks.iter().position(unfocused) {
        let text = match rtc.focus_bits_per_mm {
            None => "the zoom optic has to be set, but rtc.focus_bits_per_mm is not stated".to_owned(),
            Some(_) => format!("a focus shift is beyond the {} to {} bits of {name}", range[0], range[1]),
        };
        faults.push(Diag::limit("rtc-focus", text).at(place(i)).hint("state rtc.focus_bits_per_mm of the zoom optic"));
    }
    if let Some((blocks, place)) = cards::lost(program, |p| bits(&rtc, machine, p)) {
        let um = 1000.0 / rtc.bits_per_mm;
        let text = format!("marks in {blocks} blocks are shorter than a bit of the board, {um} um, and would be lost");
        faults.push(Diag::limit("rtc-short", text).at(place).hint(cards::min_mark(um)));
    }
    let long = |b: &Block| program.strokes_of(b).iter().any(|s| s.len as usize + 2 * SETTINGS > rtc.list_memory);
    if let Some(i) = program.blocks.iter().position(long) {
        let text = format!("a stroke does not fit into a list of {} commands", rtc.list_memory);
        faults.push(Diag::limit("rtc-list", text).at(place(i)).hint("see rtc.list_memory"));
    }
    faults
}

/// A point of the field in bits.
fn bits(rtc: &Rtc, machine: &Machine, point: FieldPoint) -> [i64; 2] {
    let ControllerPoint { x, y } = machine.scanner.controller_from_field(point);
    [x, y].map(|nm| cards::rounded(f64::from(nm) * rtc.bits_per_mm / NM_PER_MM))
}

/// The text as it grows.
struct Text<'a> {
    bytes: Vec<u8>,
    machine: &'a Machine,
    rtc: Rtc,
    counts: Counts,
}

impl Text<'_> {
    fn line(&mut self, text: std::fmt::Arguments<'_>) {
        // Writing to a Vec cannot fail.
        let _ = self.bytes.write_fmt(text);
        self.bytes.push(b'\n');
    }

    /// What is the same for all pens.
    fn delays(&mut self, block: &Block) {
        let delays = &self.machine.delays;
        let [on, off] = [delays.laser_on, delays.laser_off].map(|d| (d.as_us() * self.counts.delay).round() as i64);
        self.line(format_args!("laser_delays {on} {off}"));
        let tens = |time: Time| (time.as_us() / 10.0).ceil() as i64;
        let [jump, mark, polygon] = [delays.jump, delays.mark, delays.polygon].map(tens);
        self.line(format_args!("scanner_delays {jump} {mark} {polygon}"));
        self.speed("jump_speed", self.machine.scanner.jump_speed);
        if let Some(scale) = self.rtc.focus_bits_per_mm {
            let focus = (block.focus_shift.mm() * scale).round() as i64;
            self.line(format_args!("focus {focus}"));
        }
    }

    fn pen(&mut self, pen: &Pen) {
        let power = (pen.power.share(self.machine.laser.max_power) * 4095.0).round() as i64;
        self.line(format_args!("power {power}"));
        let half = (1000.0 / pen.frequency.as_khz() / 2.0 * self.counts.period).round() as i64;
        self.line(format_args!("half_period {half}"));
        self.speed("mark_speed", pen.speed);
    }

    /// A speed in bits per ms.
    fn speed(&mut self, keyword: &str, speed: Speed) {
        self.bytes.extend_from_slice(keyword.as_bytes());
        self.bytes.push(b' ');
        super::push_mm(&mut self.bytes, (speed.as_mm_s() * self.rtc.bits_per_mm / 1000.0 * 1e6).round() as i64);
        self.bytes.push(b'\n');
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::emit;
    use terrace_core::format::Format;
    use terrace_core::program::sample;

    fn sample() -> (Checked, Machine) {
        let (program, origin) = sample::program();
        let mut machine = Machine::built_in("xyz-zoom-40").expect("profile");
        let (board, focus_bits_per_mm) = (RtcBoard::Rtc5, Some(5_000.0));
        machine.rtc = Some(Rtc { board, bits_per_mm: 20_000.0, focus_bits_per_mm, list_memory: 4000 });
        (Checked::unchecked(program, origin), machine)
    }

    fn text(checked: &Checked, machine: &Machine, index: usize) -> String {
        String::from_utf8(block(checked, machine, index)).expect("ASCII")
    }

    #[test]
    fn list_is_in_the_units_of_the_board() {
        let (checked, mut machine) = sample();
        let wanted = "terrace rtc 1\nboard rtc5\nblock B0001\nlist 1\nlaser_delays 100 160\nscanner_delays 20 10 3\n\
                      jump_speed 100000.000000\nfocus 0\npower 2457\nhalf_period 533\nmark_speed 20000.000000\n\
                      jump -100000 0\nmark 100000 0\njump -100000 -10000\nmark 100000 -10000\nend\n";
        assert_eq!(text(&checked, &machine, 0), wanted);
        let rtc = machine.rtc.as_mut().expect("a board");
        (rtc.board, rtc.bits_per_mm, rtc.focus_bits_per_mm) = (RtcBoard::Rtc4, 1_000.0, None);
        let wanted = "terrace rtc 1\nboard rtc4\nblock B0001\nlist 1\nlaser_delays 50 80\nscanner_delays 20 10 3\n\
                      jump_speed 5000.000000\npower 2457\nhalf_period 67\nmark_speed 1000.000000\n\
                      jump -5000 0\nmark 5000 0\njump -5000 -500\nmark 5000 -500\nend\n";
        assert_eq!(text(&checked, &machine, 0), wanted);
    }

    #[test]
    fn points_that_are_one_in_bits_are_marked_once() {
        let (checked, machine) = sample();
        let mut program = checked.program().clone();
        program.points = [0, 1_000_000, 1_000_010, 2_000_000].map(|x| FieldPoint { x, y: 0 }).to_vec();
        program.strokes.truncate(1);
        program.strokes[0].len = 4;
        program.blocks.truncate(1);
        program.blocks[0].strokes = 0..1;
        let text = text(&Checked::unchecked(program, checked.origin()), &machine, 0);
        assert!(text.ends_with("\njump 0 0\nmark 20000 0\nmark 40000 0\nend\n"), "{text}");
    }

    #[test]
    fn dot_is_a_jump_and_a_dwell() {
        let (checked, machine) = sample();
        let mut program = checked.program().clone();
        program.pens[0].dwell = Some(Time::us(120.0));
        program.points.truncate(1);
        program.strokes.truncate(1);
        program.strokes[0].len = 1;
        program.blocks.truncate(1);
        program.blocks[0].strokes = 0..1;
        let text = text(&Checked::unchecked(program, checked.origin()), &machine, 0);
        assert!(text.ends_with("\njump -100000 0\nlaser_on 12\nend\n"), "{text}");
    }

    #[test]
    fn lists_are_as_long_as_the_memory_and_each_has_all_settings() {
        let (checked, mut machine) = sample();
        machine.rtc.as_mut().expect("a board").list_memory = 25;
        let text = text(&checked, &machine, 2);
        let lists: Vec<&str> = text.split("list ").skip(1).collect();
        assert_eq!(lists.len(), 4, "{text}");
        for list in lists {
            assert!(list.lines().count() <= 25 && list.contains("\nend\n"), "{list}");
            for setting in
                ["laser_delays", "scanner_delays", "jump_speed", "focus", "power", "half_period", "mark_speed"]
            {
                assert!(list.contains(setting), "{setting}: {list}");
            }
        }
        assert_eq!(text.matches("jump ").count(), 4);
    }

    #[test]
    fn what_the_board_would_clip_or_lose_is_refused() {
        let code = |change: &dyn Fn(&mut Program, &mut Rtc)| {
            let (checked, mut machine) = sample();
            let mut program = checked.program().clone();
            change(&mut program, machine.rtc.as_mut().expect("a board"));
            emit::faults(&[Format::Rtc], &program, &machine).err().map(|e| e.diags()[0].code)
        };
        assert_eq!(code(&|_, _| {}), None);
        assert_eq!(code(&|_, r| r.bits_per_mm = 27_000.0), Some("rtc-field"));
        assert_eq!(code(&|_, r| r.board = RtcBoard::Rtc4), Some("rtc-speed"));
        assert_eq!(code(&|p, _| p.pens[0].speed = Speed::mm_s(0.05)), Some("rtc-speed"));
        assert_eq!(code(&|p, _| p.points[1].x = p.points[0].x + 40), None);
        assert_eq!(code(&|p, _| p.points[1] = FieldPoint::new(p.points[0].x + 9, p.points[0].y)), Some("rtc-short"));
        assert_eq!(code(&|p, _| p.blocks[1].focus_shift = Nm(4_000_000)), None);
        assert_eq!(code(&|p, r| (p.blocks[1].focus_shift, r.focus_bits_per_mm) = (Nm(1), None)), Some("rtc-focus"));
        assert_eq!(
            code(&|p, r| (p.blocks[1].focus_shift, r.focus_bits_per_mm) = (Nm(4_000_000), Some(2e5))),
            Some("rtc-focus")
        );
        assert_eq!(code(&|_, r| r.list_memory = 20), Some("rtc-list"));
        assert_eq!(code(&|p, _| p.pens[0].dwell = Some(Time::us(15.0))), Some("rtc-dwell"));
        let (checked, mut machine) = sample();
        machine.rtc = None;
        let refused = emit::faults(&[Format::Rtc], checked.program(), &machine).expect_err("no board");
        assert_eq!(refused.diags()[0].code, "emit-rtc");
    }
}
