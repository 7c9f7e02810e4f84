//! The stage program: where the stage goes, block by block, and how it waits for the scan card.
//!
//! Two dialects of the same moves. [`linuxcnc`] hands over to the scan card by a digital output (START)
//! and an input (BUSY) and never steps on after a timeout. [`m0`] stops at every block until the operator
//! presses cycle start, in words that LinuxCNC, GRBL and Mach read; Mach also cancels its turned coordinates (G69).
//!
//! Words are absolute axis commands in mm and degrees. Moves are x and y and the tilt axes together, then z alone;
//! where the machine file says so, x, y and z move together between stops that need no lift, but not from the end of z. First of all, at the end, before a set-up and where a block asks for it, z goes to the far end
//! of its travel. After a stop at which the operator may have moved them all axes are sent. The laser output is switched
//! off at once (not with the next motion) before every group of moves and at the end, and a dwell follows every group: a
//! motion queue otherwise lets the laser overlap the move.
//!
//! The zero of positions is that of the machine with LinuxCNC, whose program ends where an offset is active. The other
//! dialect cannot ask: its zero is that of G54, as GRBL and Mach are set up, and it switches G92 and the tool length off.
//!
//! The programs of frames go to the registration points and the frames of the outline, and stop at each (M0) in both
//! dialects: a scan card that is started would mark the block that it has loaded.
//!
//! The first line of block B0133 has the number N133. Comments say what must be done before the program is begun
//! there: the lift, where the block's own moves do not lift, and the axes that they do not move.

use super::Stepped;
use super::lines::{LINUXCNC_ZERO, Lines, M0_ZERO, MOST_OF_GRBL, Word, letters};
use terrace_core::geom::Nm;
use terrace_core::machine::{Commanded, Dialect, TiltAngles};
use terrace_core::program::{Block, PassId};

/// Shortest dwell after a move: a controller's last following error, whatever the machine file says.
const LEAST_DWELL_MS: u64 = 50;

/// Tests of each block with LinuxCNC, each with a number of its own.
const LABELS: usize = 4;

/// The dwell after which BUSY must still be low: contacts bounce for less.
const BOUNCE: &str = "G4 P0.050";

/// Largest number of a line that GRBL and LinuxCNC take.
const MOST_LINES: u64 = 9_999_999;

/// The program for LinuxCNC. Of the estimated time of every block (marks, jumps and delays) the wait for its end is
/// given twice that and 10 s.
///
/// # Panics
/// If a block has no figures.
pub fn linuxcnc(job: &Stepped<'_>) -> Vec<u8> {
    let Stepped { checked, machine, .. } = *job;
    let mut p = Writer::new(job, machine.controller.max_line, "M65 P0");
    if job.frames.is_some() {
        return p.all_frames(LINUXCNC_ZERO, Writer::linuxcnc_preamble);
    }
    p.comment("terrace: stage program for LinuxCNC, absolute, mm");
    p.comment(&format!("machine: {}", super::quoted(&machine.name)));
    p.comment(LINUXCNC_ZERO);
    p.comment("digital output 0 is START to the scan card, digital input 0 is its BUSY");
    p.comment("BUSY is high while the card marks: an inverted one ends the program at the first block");
    p.comment("BUSY must rise within 5 s of START and stay high for 20 ms or more, until the laser is off");
    p.comment("output off before every move and at the end, a wait that times out ends the program");
    p.comment("not a safety system: the laser needs its own interlock");
    p.linuxcnc_preamble();
    for i in 0..checked.program().blocks.len() {
        p.block(i);
        p.mark_by_card(i);
    }
    p.end();
    p.line("M2");
    p.lines.out
}

/// The program that stops at every block for the operator (M0), in the dialect of the machine's control.
pub fn m0(job: &Stepped<'_>) -> Vec<u8> {
    let Stepped { checked, machine, .. } = *job;
    let mut p = Writer::new(job, machine.controller.max_line.min(MOST_OF_GRBL), "M5");
    if job.frames.is_some() {
        return p.all_frames(M0_ZERO, Writer::m0_preamble);
    }
    p.comment("terrace: stage program with stops, absolute, mm, dwell in s");
    p.comment(&format!("machine: {}", super::quoted(&machine.name)));
    p.comment(M0_ZERO);
    p.comment("at every M0 mark the block named, wait for its end, then press cycle start");
    p.comment("not a safety system: the laser needs its own interlock");
    p.m0_preamble();
    p.operator_may_move = true;
    for i in 0..checked.program().blocks.len() {
        p.block(i);
        p.line(&format!("M0 (mark {})", checked.program().id(i)));
    }
    p.end();
    p.line("M2");
    p.lines.out
}

/// A stage program as it grows.
struct Writer<'a> {
    job: &'a Stepped<'a>,
    lines: Lines,
    /// The line that switches the laser off at once.
    off: &'static str,
    /// z of a lift, as commanded, nm.
    retract_z: i64,
    /// Which axes were sent since the last dwell: x, y or a tilt axis; z.
    sent: [bool; 2],
    /// Where the stage stands, as commanded, nm; None where that is not known: before the first move, and after a stop at
    /// which the operator may have moved it.
    at: Option<Commanded>,
    /// Letters of the tilt axes; None where there are none.
    letters: Option<[char; 2]>,
    /// Angles as commanded; None as for `at`.
    tilt: Option<TiltAngles>,
    has_zoom: bool,
    /// Whether the operator may move the axes at a stop before each block.
    operator_may_move: bool,
}

impl<'a> Writer<'a> {
    fn new(job: &'a Stepped<'a>, longest: usize, off: &'static str) -> Self {
        let machine = job.machine;
        Self {
            job,
            lines: Lines::new(longest),
            off,
            retract_z: machine.retract_z().0,
            sent: [false; 2],
            at: None,
            letters: letters(machine),
            tilt: None,
            has_zoom: machine.zoom.is_some(),
            operator_may_move: false,
        }
    }

    /// Has the scan card mark block `i`, and waits for its end.
    fn mark_by_card(&mut self, i: usize) {
        let wait_s = (2.0 * self.job.figures[i].time_s + 10.0).ceil();
        let id = self.job.checked.program().id(i);
        let number = LABELS * i;
        // A card that still marks, and a BUSY of the wrong polarity.
        self.line("M66 P0 L4 Q2");
        self.stop_on_timeout(number + 1, &format!("BUSY before START, block {id}"));
        self.line("M64 P0");
        self.line("M66 P0 L3 Q5");
        self.stop_on_timeout(number + 2, &format!("no BUSY, block {id}"));
        self.line("M65 P0");
        // Twice, a dwell apart: a contact that bounces while it closes is low for a moment.
        let until_idle = format!("M66 P0 L4 Q{wait_s}");
        let busy = format!("still BUSY, block {id}");
        self.line(&until_idle);
        self.stop_on_timeout(number + 3, &busy);
        self.line(BOUNCE);
        self.line(&until_idle);
        self.stop_on_timeout(number + 4, &busy);
    }

    /// Modes, output off, and the tests that end the program where an offset is active.
    fn linuxcnc_preamble(&mut self) {
        self.line("G21 G90 G94 G17 G40 G49 G80 G61.1 G54");
        self.line(self.off);
        // The tests of the blocks have the numbers up to here.
        let first = LABELS * self.job.checked.program().blocks.len() + 1;
        self.lines.offsets_end(self.job.machine, first);
    }

    /// Modes with G54; then tool length and G92 off, each on a line of its own, as GRBL reads them; output off.
    fn m0_preamble(&mut self) {
        self.line("G21 G90 G94 G17 G40 G80 G54");
        self.line("G49");
        self.line("G92.1");
        // Mach may still have coordinates that G68 has turned.
        if self.job.machine.controller.dialect == Dialect::Mach {
            self.line("G69");
        }
        self.line(self.off);
    }

    fn line(&mut self, text: &str) {
        self.lines.line(text);
    }

    fn comment(&mut self, text: &str) {
        self.lines.comment(text);
    }

    /// The program of frames.
    fn all_frames(mut self, zero: &str, modes: fn(&mut Self)) -> Vec<u8> {
        let machine = self.job.machine;
        self.comment("terrace: registration points and frames of the outline, absolute, mm");
        self.comment(&format!("machine: {}", super::quoted(&machine.name)));
        self.comment(zero);
        self.comment("at every M0 show the frame named with the pilot laser, then press cycle start");
        self.comment("at registration points the head is lifted: the spot is large, judge its centre");
        self.comment("not a safety system: the laser needs its own interlock");
        modes(&mut self);
        for i in 0..self.job.checked.program().blocks.len() {
            self.block(i);
            self.line(&format!("M0 (frame {})", self.job.checked.program().id(i)));
            (self.at, self.tilt) = (None, None);
        }
        self.end();
        self.line("M2");
        self.lines.out
    }

    /// Title, moves and dwell of block `i`; the stage then stands still with the output off.
    fn block(&mut self, i: usize) {
        let checked = self.job.checked;
        let program = checked.program();
        let block = &program.blocks[i];
        let before = i.checked_sub(1).map(|i| &program.blocks[i]);
        if block.pass != before.map_or(PassId(0), |b| b.pass) {
            self.comment(&format!("PASS {}", block.pass.number()));
        }
        let setups = checked.origins().len();
        if before.is_none_or(|b| b.setup != block.setup) {
            if setups > 1 {
                self.setup(block.setup.number(), setups);
            }
            let points = self.job.frames.and_then(|setups| setups.get(block.setup.index()));
            points.into_iter().flatten().zip(1..).for_each(|(&at, number)| self.registration(number, at));
        }
        let id = program.id(i);
        let title = match self.job.file_of(id) {
            Some(file) => format!("BLOCK {id} FILE {file}"),
            None => format!("BLOCK {id}"),
        };
        self.comment(&title);
        if self.has_zoom {
            self.focus_shift(block.focus_shift.0);
        }
        let moves = self.moves(block);
        self.entry(&moves, block);
        match id.number() {
            number @ ..=MOST_LINES => self.line(&format!("N{number} {}", self.off)),
            _ => self.line(self.off),
        }
        moves.iter().for_each(|words| self.travel(words));
        (self.at, self.tilt) = (Some(block.stage), Some(block.stop.tilt));
        self.dwell();
    }

    /// The moves to a block: words of one line each.
    fn moves(&self, block: &Block) -> Vec<Vec<Word>> {
        // The stage position is unknown at the start, so the first move lifts as well.
        let lifts = block.retract || self.at.is_none();
        let mut moves = Vec::new();
        if lifts && !self.is_lifted() {
            moves.push(vec![('Z', self.retract_z)]);
        }
        let [x, y, z] = block.stage.0;
        let is_new = self.operator_may_move || self.tilt != Some(block.stop.tilt);
        let tilt = self.letters.filter(|_| is_new).map(|letters| std::iter::zip(letters, block.stop.tilt.0));
        let mut across = Vec::new();
        if tilt.is_some() || self.operator_may_move || self.at.is_none_or(|at| [at[0], at[1]] != [x, y]) {
            across.extend([('X', x), ('Y', y)]);
        }
        // Degrees have six decimals as well.
        across.extend(tilt.into_iter().flatten());
        let from = if lifts { Some(self.retract_z) } else { self.at.map(|at| at[2]) };
        let along = (self.operator_may_move || from != Some(z)).then_some(('Z', z));
        if !lifts && !self.is_lifted() && self.job.machine.stage.diagonal {
            across.extend(along);
            moves.push(across);
        } else {
            moves.extend([across, along.into_iter().collect()]);
        }
        moves.retain(|words| !words.is_empty());
        moves
    }

    /// What has to be done by hand before the program is begun at this block, which then has all of its position: the
    /// lift, where the block's moves do not begin with one; then the axes that they do not move, and all others where z is
    /// not moved or moves together with them.
    fn entry(&mut self, moves: &[Vec<Word>], block: &Block) {
        // z goes down last: where it is to be stated, all others are before it.
        let moves_z = moves.iter().any(|words| words.last().is_some_and(|word| *word == ('Z', block.stage[2])));
        let is_sent = |axis: char| moves_z && is_moved_apart_from_z(moves, axis);
        let [x, y, z] = block.stage.0;
        let missing = |words: &[Word]| words.iter().copied().filter(|word| !is_sent(word.0)).collect::<Vec<_>>();
        let across = missing(&[('X', x), ('Y', y)]);
        let turned = self.letters.map(|letters| std::iter::zip(letters, block.stop.tilt.0).collect::<Vec<_>>());
        let mut missing = [across, missing(&turned.unwrap_or_default()), missing(&[('Z', z)])].to_vec();
        missing.retain(|words| !words.is_empty());
        let lift = ('Z', self.retract_z);
        if !missing.is_empty() || moves.first().is_none_or(|words| words[..] != [lift]) {
            self.entry_line("LIFT", &[lift]);
        }
        missing.iter().for_each(|words| self.entry_line("GO", words));
    }

    fn entry_line(&mut self, what: &str, words: &[Word]) {
        self.lines.go(&format!("(ENTRY {what}"), words, ")");
    }

    /// The dwell in which the axes that were sent settle.
    fn dwell(&mut self) {
        let sent = std::mem::take(&mut self.sent);
        // Where the zoom optic alone has moved, it is given the longer of both.
        let [xy, z] = if sent == [false; 2] { [true; 2] } else { sent };
        let seconds = self.job.machine.stage.settle.after(xy, z);
        let ms = ((seconds * 1e3).ceil() as u64).max(LEAST_DWELL_MS);
        self.line(&format!("G4 P{}.{:03}", ms / 1000, ms % 1000));
    }

    /// The stop before a set-up, lifted and with the output off: the part is moved by hand, and maybe the axes.
    fn setup(&mut self, number: u32, count: usize) {
        self.comment(&format!("SETUP {number} OF {count}"));
        self.line(self.off);
        self.lift();
        self.line(&format!("(MSG, set-up {number} of {count})"));
        self.line("M0");
        (self.at, self.tilt) = (None, None);
    }

    /// The stop at a registration point, lifted and with the output off: the operator may move the axes.
    fn registration(&mut self, number: usize, [x, y]: [Nm; 2]) {
        self.comment(&format!("REGISTRATION {number}"));
        self.line(self.off);
        self.lift();
        let upright = self.letters.into_iter().flatten().map(|letter| (letter, 0));
        let words: Vec<(char, i64)> = [('X', x.0), ('Y', y.0)].into_iter().chain(upright).collect();
        self.travel(&words);
        self.line(&format!("(MSG, registration point {number})"));
        self.line("M0");
        (self.at, self.tilt) = (None, None);
    }

    /// What the zoom optic has to be set to; the stage program cannot do it.
    fn focus_shift(&mut self, nm: i64) {
        self.lines.out.extend_from_slice(b"(FOCUS SHIFT ");
        super::push_mm(&mut self.lines.out, nm);
        self.lines.out.extend_from_slice(b")\n");
    }

    fn is_lifted(&self) -> bool {
        self.at.is_some_and(|at| at[2] == self.retract_z)
    }

    fn lift(&mut self) {
        if !self.is_lifted() {
            self.travel(&[('Z', self.retract_z)]);
        }
        if let Some(at) = &mut self.at {
            at[2] = self.retract_z;
        }
    }

    fn travel(&mut self, words: &[Word]) {
        self.lines.go("G0", words, "");
        let moves_z = words.iter().any(|word| word.0 == 'Z');
        self.sent[1] |= moves_z;
        self.sent[0] |= words.len() > usize::from(moves_z);
    }

    /// Ends the program if the wait before timed out; `number` is unique among such tests.
    fn stop_on_timeout(&mut self, number: usize, what: &str) {
        self.line(&format!("o{number} if [#5399 LT 0]"));
        self.line(&format!("(MSG, {what})"));
        self.line("M65 P0");
        self.line("M2");
        self.line(&format!("o{number} endif"));
    }

    fn end(&mut self) {
        self.line(self.off);
        self.lift();
        self.line(self.off);
    }
}

/// Whether lines move an axis other than together with z; for z whether they move it.
fn is_moved_apart_from_z(moves: &[Vec<Word>], axis: char) -> bool {
    let mut lines = moves.iter().filter(|words| words.iter().any(|word| word.0 == axis));
    lines.any(|words| axis == 'Z' || words.iter().all(|word| word.0 != 'Z'))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::Checked;
    use crate::emit::lines::OFFSETS;
    use terrace_core::machine::{AxisSettling, Machine, Settling};
    use terrace_core::program::{BlockFigures, SetupId, sample};
    use terrace_core::units::Time;

    fn job<'a>(
        checked: &'a Checked,
        machine: &'a Machine,
        figures: &'a [BlockFigures],
        block_file: Option<&'static str>,
    ) -> Stepped<'a> {
        Stepped { checked, machine, figures, job: "job.toml", part: "part.stl", block_file, frames: None }
    }

    fn timed(times: [f64; 3]) -> [BlockFigures; 3] {
        times.map(|time_s| BlockFigures { time_s, ..BlockFigures::default() })
    }

    fn sample() -> (Checked, Machine) {
        let (program, origin) = sample::program();
        (Checked::unchecked(program, origin), Machine::built_in("xyz-galvo-40").expect("profile"))
    }

    fn text(bytes: Vec<u8>) -> String {
        String::from_utf8(bytes).expect("ASCII")
    }

    #[test]
    fn handshake_program_equals_the_documented_text() {
        let (checked, machine) = sample();
        let text = text(linuxcnc(&job(&checked, &machine, &timed([1.0, 0.5, 60.3]), Some("dxf"))));
        let body = text.split_once("G61.1 G54\n").expect("modes").1;
        let offsets = "M65 P0\no13 if [#5210 NE 0]\n(MSG, G92 is active)\nM2\no13 endif\no14 if [#5221 NE 0]\n\
                       (MSG, G54 has an offset in X)\nM2\no14 endif\no15 if [#5222 NE 0]\n(MSG, G54 has an offset in Y)\n\
                       M2\no15 endif\no16 if [#5223 NE 0]\n(MSG, G54 has an offset in Z)\nM2\no16 endif\n\
                       o17 if [#5230 NE 0]\n(MSG, G54 is rotated)\nM2\no17 endif\n";
        let body = body.strip_prefix(offsets).unwrap_or_else(|| panic!("{body}"));
        let first = "(BLOCK B0001 FILE blocks/B0001.dxf)\nN1 M65 P0\nG0 Z200.000000\nG0 X-1.000000 Y2.000000\n\
                     G0 Z0.335000\nG4 P0.100\nM66 P0 L4 Q2\no1 if [#5399 LT 0]\n(MSG, BUSY before START, block B0001)\n\
                     M65 P0\nM2\no1 endif\nM64 P0\nM66 P0 L3 Q5\no2 if [#5399 LT 0]\n(MSG, no BUSY, block B0001)\n\
                     M65 P0\nM2\no2 endif\nM65 P0\nM66 P0 L4 Q12\no3 if [#5399 LT 0]\n(MSG, still BUSY, block B0001)\n\
                     M65 P0\nM2\no3 endif\nG4 P0.050\nM66 P0 L4 Q12\no4 if [#5399 LT 0]\n\
                     (MSG, still BUSY, block B0001)\nM65 P0\nM2\no4 endif\n";
        assert!(body.starts_with(first), "{body}");
        let second = "(BLOCK B0002 FILE blocks/B0002.dxf)\n(ENTRY LIFT Z200.000000)\n(ENTRY GO X-1.000000 Y2.000000)\nN2 M65 P0\nG0 Z0.405000\nG4 P0.100\nM66 P0 L4 Q2\n";
        assert!(body.contains(second), "a move of z alone");
        let third = "(BLOCK B0003 FILE blocks/B0003.dxf)\nN3 M65 P0\nG0 Z200.000000\nG0 X-41.000000 Y2.000000\nG0 Z0.405000\nG4";
        assert!(body.contains(third), "lifted");
        assert!(body.contains("M66 P0 L4 Q131\n"), "twice 60.3 s and 10 s, rounded up");
        assert!(body.ends_with("o12 endif\nM65 P0\nG0 Z200.000000\nM65 P0\nM2\n"));
    }

    #[test]
    fn the_output_is_off_before_every_move_and_a_dwell_comes_before_every_start() {
        let (checked, machine) = sample();
        for (text, off, on) in [
            (text(linuxcnc(&job(&checked, &machine, &timed([0.0; 3]), None))), "M65 P0", "M64 P0"),
            (text(m0(&job(&checked, &machine, &[], Some("dxf")))), "M5", "M0"),
        ] {
            let (mut is_off, mut settled) = (false, false);
            for line in text.lines() {
                assert!(line.len() <= 255);
                let line =
                    line.strip_prefix('N').map_or(line, |l| l.trim_start_matches(|c: char| c.is_ascii_digit()).trim());
                if line.starts_with(off) {
                    is_off = true;
                } else if line.starts_with(on) {
                    assert!(settled, "{line}");
                    is_off = false;
                } else if line.starts_with("G0 ") {
                    assert!(is_off, "{line}");
                    assert!(!(line.contains('X') && line.contains('Z')), "{line}");
                    settled = false;
                } else if line.starts_with("G4 P") {
                    settled = true;
                }
            }
            assert!(is_off);
            assert!(!text.contains(" FILE ") || off == "M5");
        }
    }

    #[test]
    fn lines_keep_to_the_controller_and_to_plain_characters() {
        let (checked, mut machine) = sample();
        machine.controller.max_line = 40;
        machine.name = "Fräse (alt) ; ".repeat(12);
        for bytes in [
            linuxcnc(&job(&checked, &machine, &timed([1e5; 3]), Some("dxf"))),
            m0(&job(&checked, &machine, &[], Some("dxf"))),
        ] {
            for line in text(bytes).lines() {
                assert!(line.len() <= 40 && line.is_ascii(), "{line}");
                assert_eq!(line.matches('(').count(), usize::from(line.contains(')')), "{line}");
                let is_test = line.contains("endif") || line.contains(" NE 0]");
                let plain = line.starts_with('(') || !line.to_ascii_lowercase().contains('e') || is_test;
                assert!(plain, "an exponent: {line}");
            }
        }
    }

    #[test]
    fn wrapped_names_never_begin_a_comment_line() {
        let (checked, mut machine) = sample();
        for word in crate::emit::HOSTILE {
            for pad in 0..80 {
                for max_line in [40, 255] {
                    machine.controller.max_line = max_line;
                    machine.name = format!("{} {word},x(y)\n%;{word} BLOCK B0001", "x".repeat(pad));
                    for bytes in [
                        linuxcnc(&job(&checked, &machine, &timed([0.0; 3]), Some("dxf"))),
                        m0(&job(&checked, &machine, &[], Some("dxf"))),
                    ] {
                        let text = text(bytes);
                        for comment in text.lines().filter_map(|l| l.strip_prefix('(')) {
                            let ours = [
                                "terrace:",
                                "machine:",
                                "digital",
                                "BUSY",
                                "output",
                                "not",
                                "at",
                                "BLOCK",
                                "ENTRY",
                                "positions",
                                "...",
                                "MSG,",
                            ];
                            let first = comment.split([' ', ')']).next().unwrap_or_default();
                            assert!(ours.contains(&first), "{comment}");
                            assert!(
                                first != "MSG,"
                                    || comment.contains("BUSY") && comment.contains(", block B")
                                    || OFFSETS.iter().any(|(_, what)| comment == format!("MSG, {what})")),
                                "{comment}"
                            );
                        }
                        assert_eq!(text.matches("(BLOCK ").count(), 3, "{text}");
                    }
                }
            }
        }
    }

    #[test]
    fn programs_of_frames_go_to_registration_points_first_and_never_fire() {
        let (checked, mut machine) = sample();
        machine.controller.max_line = 60;
        machine.name = "MSG, (a) ".repeat(12);
        let points = [vec![[Nm(1_500_000), Nm(-2_000_000)], [Nm(0), Nm(0)]]];
        let framed = crate::emit::frames::frames(&checked, terrace_core::program::PenId(0), &machine);
        let job = Stepped { frames: Some(&points), ..job(&framed, &machine, &[], Some("dxf")) };
        for (text, off) in [(text(linuxcnc(&job)), "M65 P0"), (text(m0(&job)), "M5")] {
            let first = format!(
                "(REGISTRATION 1)\n{off}\nG0 Z200.000000\nG0 X1.500000 Y-2.000000\n(MSG, registration point 1)\nM0\n\
                 (REGISTRATION 2)\n{off}\nG0 Z200.000000\nG0 X0.000000 Y0.000000\n(MSG, registration point 2)\nM0\n\
                 (BLOCK B0001 FILE frames/B0001-frame.dxf)\nN1 {off}\nG0 Z200.000000\nG0 X-1.000000 Y2.000000\n\
                 G0 Z0.335000\nG4 P0.100\nM0 (frame B0001)\n(BLOCK B0002 FILE frames/B0002-frame.dxf)\nN2 {off}\n\
                 G0 Z200.000000\nG0 X-1.000000 Y2.000000\nG0 Z0.405000\n"
            );
            assert!(text.contains(&first), "{text}");
            assert!(!text.contains("M64") && !text.contains("M66") && !text.contains("\n(MSG, ("), "{text}");
            assert!(text.lines().all(|l| l.len() <= 60), "{text}");
        }
    }

    #[test]
    fn program_with_stops_uses_only_words_of_grbl() {
        let (checked, machine) = sample();
        let text = text(m0(&job(&checked, &machine, &[], Some("dxf"))));
        for word in ["G61", "M6", "#", "o1"] {
            assert!(!text.lines().any(|l| !l.starts_with('(') && l.contains(word)), "{word}");
        }
        assert_eq!(text.matches("\nM0 (mark B").count(), 3);
        // GRBL takes each of these alone; after every stop the operator may have moved all axes.
        assert!(text.contains("\nG21 G90 G94 G17 G40 G80 G54\nG49\nG92.1\nM5\n"), "{text}");
        for block in text.split("(BLOCK ").skip(1) {
            let moves = block.split("\nM0 ").next().expect("moves");
            assert!(moves.contains(" X") && moves.contains(" Y") && moves.contains("G0 Z"), "{block}");
        }
        assert!(text.lines().all(|l| l.len() <= 70));
    }

    #[test]
    fn every_set_up_begins_lifted_with_a_stop_after_which_all_axes_are_sent_anew() {
        let (mut program, origin) = sample::program();
        program.blocks[1].setup = SetupId(1);
        program.blocks[2].setup = SetupId(1);
        let machine = Machine::built_in("xyz-galvo-40").expect("profile");
        let checked = Checked::unchecked_setups(program, vec![origin, origin]);
        for (text, off) in [
            (text(linuxcnc(&job(&checked, &machine, &timed([0.0; 3]), None))), "M65 P0"),
            (text(m0(&job(&checked, &machine, &[], None))), "M5"),
        ] {
            let stop = |n: u32| format!("(SETUP {n} OF 2)\n{off}\nG0 Z200.000000\n(MSG, set-up {n} of 2)\nM0\n");
            let first =
                stop(1) + &format!("(BLOCK B0001)\nN1 {off}\nG0 Z200.000000\nG0 X-1.000000 Y2.000000\nG0 Z0.33");
            let second =
                stop(2) + &format!("(BLOCK B0002)\nN2 {off}\nG0 Z200.000000\nG0 X-1.000000 Y2.000000\nG0 Z0.40");
            assert!(text.contains(&first) && text.contains(&second), "{text}");
            assert_eq!(text.matches("(SETUP ").count(), 2);
        }
    }

    #[test]
    fn a_block_that_the_zoom_optic_alone_goes_to_states_its_focus_shift_and_has_no_move() {
        let (mut program, origin) = sample::program();
        let machine = Machine::built_in("xyz-zoom-40").expect("profile");
        (program.blocks[0].focus_shift, program.blocks[1].focus_shift) = (Nm(-35_000), Nm(35_000));
        program.blocks[0].stage = machine.stage_from_part(program.blocks[0].stop.centre, Nm(70_000), origin);
        program.blocks[1].stage = program.blocks[0].stage;
        let checked = Checked::unchecked(program, origin);
        let text = text(linuxcnc(&job(&checked, &machine, &timed([0.0; 3]), None)));
        let first =
            "(BLOCK B0001)\n(FOCUS SHIFT -0.035000)\nN1 M65 P0\nG0 Z200.000000\nG0 X-1.000000 Y2.000000\nG0 Z0.37";
        let second = "(BLOCK B0002)\n(FOCUS SHIFT 0.035000)\n(ENTRY LIFT Z200.000000)\n\
                      (ENTRY GO X-1.000000 Y2.000000)\n(ENTRY GO Z0.370000)\nN2 M65 P0\nG4 P0.100\nM66 P0 L4 Q2\n";
        let third = "(BLOCK B0003)\n(FOCUS SHIFT 0.000000)\nN3 M65 P0\n";
        for part in [first, second, third] {
            assert!(text.contains(part), "{part}: {text}");
        }
    }

    #[test]
    fn z_moves_together_with_x_and_y_where_the_machine_says_so_and_no_lift_is_needed() {
        let (mut program, origin) = sample::program();
        let mut machine = Machine::built_in("xyz-galvo-40").expect("profile");
        machine.stage.diagonal = true;
        machine.stage.settle = Settling::ByAxis(AxisSettling { xy: Time::s(0.2), z: Time::s(0.06) });
        program.blocks[2].retract = false;
        program.blocks[2].stage[2] += 1_000;
        let checked = Checked::unchecked(program, origin);
        let text = text(linuxcnc(&job(&checked, &machine, &timed([0.0; 3]), None)));
        let parts = [
            "N1 M65 P0\nG0 Z200.000000\nG0 X-1.000000 Y2.000000\nG0 Z0.335000\nG4 P0.200\n",
            "(ENTRY LIFT Z200.000000)\n(ENTRY GO X-1.000000 Y2.000000)\nN2 M65 P0\nG0 Z0.405000\nG4 P0.060\n",
            "(ENTRY LIFT Z200.000000)\n(ENTRY GO X-41.000000 Y2.000000)\nN3 M65 P0\n\
             G0 X-41.000000 Y2.000000 Z0.406000\nG4 P0.200\n",
        ];
        for part in parts {
            assert!(text.contains(part), "{part}: {text}");
        }
    }

    #[test]
    fn a_dwell_is_never_left_out() {
        let (checked, mut machine) = sample();
        machine.stage.settle = Settling::Every(Time::s(0.0));
        assert!(text(m0(&job(&checked, &machine, &[], None))).contains("\nG4 P0.050\n"));
        machine.stage.settle = Settling::Every(Time::s(1.2501));
        assert!(text(m0(&job(&checked, &machine, &[], None))).contains("\nG4 P1.251\n"));
    }
}
