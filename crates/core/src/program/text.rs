//! `program.txt`: the program as stable text, one line per block and per stroke, integers in nm.
//!
//! Lines end in `\n`; the numbers of pens, blocks and strokes stand before what they count. The layout is
//! in `docs/reference/formats.md`. [`parse`] gives back what [`write()`] wrote, with `==`, for every program whose
//! strokes and points lie block by block without gaps, which is how programs are made. It allocates by
//! what the file holds, never by a number that the file states.

use std::io::{self, Write};

use crate::diag::{Diag, Error, Place};
use crate::geom::{FieldPoint, Nm, P2};
use crate::machine::{Commanded, Origin, TiltAngles};
use crate::program::{Block, BlockId, PassId, Pen, PenId, Program, SectionId, SetupId, Stop, Stroke, StrokeId};
use crate::units::Time;

const TITLE: &str = "terrace program 1";

/// Bytes that are gathered before they are written.
const BUFFER: usize = 1 << 18;

/// Writes the text of a program on a part whose origin lies at one of `origins` (nm, table frame) in every set-up.
///
/// # Errors
/// Those of writing to `to`.
pub fn write(to: &mut dyn Write, program: &Program, origins: &[Origin]) -> io::Result<()> {
    let mut out = Text { bytes: Vec::with_capacity(2 * BUFFER), digits: itoa::Buffer::new() };
    out.text(TITLE);
    for &origin in origins {
        out.text("\norigin");
        out.numbers(origin.0);
    }
    out.text(&format!("\npens {}\n", program.pens.len()));
    for Pen { name, speed, power, frequency, passes, dwell } in &program.pens {
        let dwell = dwell.map_or_else(String::new, |dwell| format!(" | {dwell}"));
        out.text(&format!("pen {} | {speed} | {power} | {frequency} | {passes}{dwell}\n", escaped(name)));
    }
    out.text(&format!("blocks {}\n", program.blocks.len()));
    let (mut pass, mut setup, mut focus_shift) = (PassId(0), SetupId(0), Nm(0));
    for (i, block) in program.blocks.iter().enumerate() {
        if block.pass != pass {
            pass = block.pass;
            out.text(&format!("pass {}\n", pass.number()));
        }
        if block.setup != setup {
            setup = block.setup;
            out.text(&format!("setup {}\n", setup.number()));
        }
        if block.focus_shift != focus_shift {
            focus_shift = block.focus_shift;
            out.text(&format!("focus_shift {}\n", focus_shift.0));
        }
        out.block(BlockId::new(i), block);
        for stroke in program.strokes_of(block) {
            out.stroke(stroke, program.points_of(stroke));
            if out.bytes.len() >= BUFFER {
                to.write_all(&out.bytes)?;
                out.bytes.clear();
            }
        }
    }
    out.text("end\n");
    to.write_all(&out.bytes)
}

/// The text that is not yet written.
struct Text {
    bytes: Vec<u8>,
    digits: itoa::Buffer,
}

impl Text {
    fn text(&mut self, text: &str) {
        self.bytes.extend_from_slice(text.as_bytes());
    }
    /// Each number with a space before it.
    fn numbers<const N: usize, I: itoa::Integer>(&mut self, numbers: [I; N]) {
        for n in numbers {
            self.bytes.push(b' ');
            self.bytes.extend_from_slice(self.digits.format(n).as_bytes());
        }
    }
    fn block(&mut self, id: BlockId, block: &Block) {
        let Block { pass: _, setup: _, focus_shift: _, stop, stage, retract, z_lo, z_hi, strokes } = block;
        self.text("block ");
        self.text(&id.to_string());
        self.numbers(stop.section.0);
        self.numbers([
            i64::from(stop.level),
            stop.tilt[0],
            stop.tilt[1],
            stop.centre.x,
            stop.centre.y,
            stop.lpfl.0,
            stop.z_lo.0,
            stop.z_hi.0,
        ]);
        self.numbers(stage.0);
        self.numbers([i64::from(*retract), z_lo.0, z_hi.0]);
        self.numbers([strokes.len()]);
        self.bytes.push(b'\n');
    }
    fn stroke(&mut self, stroke: &Stroke, points: &[FieldPoint]) {
        self.bytes.extend_from_slice(self.digits.format(stroke.pen.0).as_bytes());
        self.numbers([stroke.source.0, stroke.segment]);
        self.text(if stroke.reversed { " -" } else { " +" });
        for &FieldPoint { x, y } in points {
            self.numbers([x, y]);
        }
        self.bytes.push(b'\n');
    }
}

/// A name on one line: backslash, line feed and carriage return as \\, \n, \r.
fn escaped(name: &str) -> String {
    name.replace('\\', "\\\\").replace('\n', "\\n").replace('\r', "\\r")
}

fn unescaped(text: &str) -> Option<String> {
    let mut out = String::with_capacity(text.len());
    let mut chars = text.chars();
    while let Some(c) = chars.next() {
        out.push(match c {
            '\\' => match chars.next()? {
                '\\' => '\\',
                'n' => '\n',
                'r' => '\r',
                _ => return None,
            },
            other => other,
        });
    }
    Some(out)
}

/// Reads a program text; `path` names it in messages.
///
/// # Errors
/// `program-text` with the line: anything that [`write()`] would not have written.
pub fn parse(path: &str, bytes: &[u8]) -> Result<(Program, Vec<Origin>), Error> {
    let mut lines = Lines { rest: bytes, number: 0 };
    read(&mut lines).map_err(|message| {
        Diag::input("program-text", message)
            .at(Place::line(path, lines.number))
            .hint("program.txt is written by terrace and not to be edited; compile the job again")
            .into()
    })
}

fn read(lines: &mut Lines<'_>) -> Result<(Program, Vec<Origin>), String> {
    if lines.next()? != TITLE.as_bytes() {
        return Err(format!("the first line is not {TITLE:?}"));
    }
    let mut origins = Vec::new();
    while origins.is_empty() || lines.rest.starts_with(b"origin ") {
        let mut fields = lines.fields("origin ")?;
        origins.push(Origin([fields.number()?, fields.number()?, fields.number()?]));
        fields.end()?;
    }
    let mut program = Program::default();
    for _ in 0..lines.count("pens ")? {
        let line = std::str::from_utf8(lines.next()?).map_err(|_| "the line is not UTF-8 text")?;
        program.pens.push(pen(line)?);
    }
    let (mut pass, mut setup, mut focus_shift) = (PassId(0), SetupId(0), Nm(0));
    for i in 0..lines.count("blocks ")? {
        if lines.rest.starts_with(b"pass ") {
            let number = u32::try_from(lines.count("pass ")?).map_err(|_| "there is no such pass")?;
            let changed = number.checked_sub(1).map(PassId).filter(|&n| n != pass);
            pass = changed.ok_or("no other pass begins here")?;
        }
        if lines.rest.starts_with(b"setup ") {
            let number = lines.count("setup ")?;
            let changed = number.checked_sub(1).filter(|&n| n < origins.len() && n != setup.index());
            setup = SetupId(changed.ok_or("no other set-up begins here")? as u32);
        }
        if lines.rest.starts_with(b"focus_shift ") {
            let mut fields = lines.fields("focus_shift ")?;
            let changed = Some(fields.nm()?).filter(|&shift| shift != focus_shift);
            fields.end()?;
            focus_shift = changed.ok_or("no other focus shift begins here")?;
        }
        let (mut block, stroke_count) = block(lines.fields("block ")?, i)?;
        (block.pass, block.setup, block.focus_shift) = (pass, setup, focus_shift);
        let start = program.strokes.len();
        for _ in 0..stroke_count {
            stroke(Fields(lines.next()?), &mut program)?;
        }
        block.strokes = start..program.strokes.len();
        program.blocks.push(block);
    }
    if lines.next()? != b"end" {
        return Err("the line is not \"end\"".into());
    }
    if lines.rest.is_empty() { Ok((program, origins)) } else { Err("something follows the end".into()) }
}

/// Reads a `pen` line from its end: the name, which stands first, may hold the separator itself.
fn pen(line: &str) -> Result<Pen, String> {
    let rest = line.strip_prefix("pen ").ok_or("the line does not start with \"pen\"")?;
    // The dwell is there only for pens that state one. It has a unit; the passes, which are last without it, have none.
    let (rest, dwell) = match rest.rsplit_once(" | ").map(|(before, last)| (before, last.parse::<Time>())) {
        Some((before, Ok(dwell))) => (before, Some(dwell)),
        _ => (rest, None),
    };
    let mut parts = rest.rsplitn(5, " | ");
    let mut next = || parts.next().ok_or_else(|| "a pen has a name and four values, separated by \" | \"".to_owned());
    let passes = next()?.parse().map_err(|_| "passes are not a number")?;
    let frequency = next()?.parse()?;
    let power = next()?.parse()?;
    let speed = next()?.parse()?;
    let name = unescaped(next()?).ok_or("the name has a stray backslash")?;
    Ok(Pen { name, speed, power, frequency, passes, dwell })
}

/// Reads a `block` line from its id on, which must be that of the block at `index`. Returns the block without its
/// strokes, and the number of stroke lines that follow.
fn block(mut f: Fields<'_>, index: usize) -> Result<(Block, usize), String> {
    let id = BlockId::new(index).to_string();
    if f.word()? != id.as_bytes() {
        return Err(format!("this should be block {id}"));
    }
    let section = SectionId([f.number()?, f.number()?]);
    let level = f.number()?;
    let tilt = TiltAngles([f.number()?, f.number()?]);
    let centre = P2::new(f.number()?, f.number()?);
    let stop = Stop { section, level, tilt, centre, lpfl: f.nm()?, z_lo: f.nm()?, z_hi: f.nm()? };
    let stage = Commanded([f.number()?, f.number()?, f.number()?]);
    let retract = match f.word()? {
        b"0" => false,
        b"1" => true,
        _ => return Err("the retract mark is neither 0 nor 1".into()),
    };
    // The heights of the block's marks; those of the stop are the heights that it admits.
    let (z_lo, z_hi) = (f.nm()?, f.nm()?);
    let stroke_count = f.number()?;
    f.end()?;
    // These stand on lines of their own; the caller, which has read them, puts them in.
    let (pass, setup, focus_shift) = (PassId(0), SetupId(0), Nm(0));
    Ok((Block { pass, setup, stop, stage, focus_shift, retract, z_lo, z_hi, strokes: 0..0 }, stroke_count))
}

fn stroke(mut f: Fields<'_>, program: &mut Program) -> Result<(), String> {
    let pen = PenId(f.number()?);
    if pen.index() >= program.pens.len() {
        return Err(format!("there is no pen {}", pen.0));
    }
    let (source, segment) = (StrokeId(f.number()?), f.number()?);
    let reversed = match f.word()? {
        b"+" => false,
        b"-" => true,
        _ => return Err("the direction is neither + nor -".into()),
    };
    let first = program.points.len();
    while !f.0.is_empty() {
        program.points.push(FieldPoint::new(f.number()?, f.number()?));
    }
    let len = program.points.len() - first;
    if len == 0 {
        return Err("a stroke has no points".into());
    }
    if len == 1 && program.pens[pen.index()].dwell.is_none() {
        return Err(format!("a dot is marked with pen {}, which has no dwell", pen.0));
    }
    if u32::try_from(program.points.len()).is_err() {
        return Err("there are 2^32 points or more".into());
    }
    program.strokes.push(Stroke { source, segment, reversed, pen, first: first as u32, len: len as u32 });
    Ok(())
}

/// The lines not read yet; `number` is the one read last, from 1.
struct Lines<'a> {
    rest: &'a [u8],
    number: usize,
}

impl<'a> Lines<'a> {
    fn next(&mut self) -> Result<&'a [u8], String> {
        self.number += 1;
        let end = self.rest.iter().position(|&b| b == b'\n').ok_or("the text ends too early")?;
        let line = &self.rest[..end];
        self.rest = &self.rest[end + 1..];
        Ok(line)
    }
    fn fields(&mut self, keyword: &str) -> Result<Fields<'a>, String> {
        let rest = self.next()?.strip_prefix(keyword.as_bytes());
        rest.map(Fields).ok_or_else(|| format!("the line does not start with {:?}", keyword.trim_end()))
    }
    fn count(&mut self, keyword: &str) -> Result<usize, String> {
        let mut fields = self.fields(keyword)?;
        let n = fields.number()?;
        fields.end()?;
        Ok(n)
    }
}

/// The fields of a line not read yet, separated by single spaces.
struct Fields<'a>(&'a [u8]);

impl<'a> Fields<'a> {
    fn word(&mut self) -> Result<&'a [u8], String> {
        if self.0.is_empty() {
            return Err("the line ends too early".into());
        }
        let end = self.0.iter().position(|&b| b == b' ').unwrap_or(self.0.len());
        let word = &self.0[..end];
        if end + 1 == self.0.len() {
            return Err("the line ends in a space".into());
        }
        self.0 = self.0.get(end + 1..).unwrap_or(&[]);
        Ok(word)
    }
    fn number<I: TryFrom<i64>>(&mut self) -> Result<I, String> {
        let word = self.word()?;
        integer(word)
            .and_then(|n| I::try_from(n).ok())
            .ok_or_else(|| format!("{:?} is not a whole number in range", String::from_utf8_lossy(word)))
    }
    fn nm(&mut self) -> Result<Nm, String> {
        self.number().map(Nm)
    }
    fn end(&self) -> Result<(), String> {
        if self.0.is_empty() { Ok(()) } else { Err("the line has more fields than it should".into()) }
    }
}

/// Digits with or without a minus, as they are written: no leading zeros, no -0.
fn integer(word: &[u8]) -> Option<i64> {
    let (negative, digits) = match word {
        [b'-', rest @ ..] => (true, rest),
        all => (false, all),
    };
    if digits.is_empty() || digits.len() > 18 || (digits[0] == b'0' && word.len() > 1) {
        return None;
    }
    let mut n = 0i64;
    for &d in digits {
        if !d.is_ascii_digit() {
            return None;
        }
        n = n * 10 + i64::from(d - b'0');
    }
    Some(if negative { -n } else { n })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::program::sample;

    fn text(program: &Program, origins: &[Origin]) -> Vec<u8> {
        let mut bytes = Vec::new();
        write(&mut bytes, program, origins).expect("a list takes every byte");
        bytes
    }

    #[test]
    fn what_was_written_reads_back_equal() {
        let (mut program, origin) = sample::program();
        program.pens[0].name = "a | b\\ \n | 3 \r".into();
        program.pens[0].speed = crate::units::Speed::mm_s(1.0 / 3.0);
        program.pens[0].dwell = Some(Time::s(1.0 / 30_000.0));
        program.blocks[1].stop.level = -3;
        (program.blocks[1].pass, program.blocks[2].pass) = (PassId(1), PassId(4));
        program.points[0] = FieldPoint::new(i32::MIN, i32::MAX);
        (program.blocks[1].setup, program.blocks[2].setup) = (SetupId(1), SetupId(0));
        (program.blocks[0].focus_shift, program.blocks[1].focus_shift) = (Nm(-4_900_000), Nm(0));
        let origins = vec![origin, Origin([1, 2, 3])];
        let text = text(&program, &origins);
        assert_eq!(parse("program.txt", &text).expect("own text"), (program, origins));
    }

    #[test]
    fn an_empty_program_reads_back_equal() {
        let text = text(&Program::default(), &[Origin([0, -1, 4_000_000_000])]);
        assert_eq!(parse("p", &text).expect("own text"), (Program::default(), vec![Origin([0, -1, 4_000_000_000])]));
    }

    #[test]
    fn truncated_and_damaged_text_is_rejected_with_line_number() {
        let (mut program, origin) = sample::program();
        program.blocks[2].pass = PassId(1);
        program.blocks[1].setup = SetupId(1);
        program.blocks[2].setup = SetupId(1);
        program.blocks[2].focus_shift = Nm(1_500);
        let text = text(&program, &[origin, origin]);
        for end in 0..text.len() {
            assert!(parse("p", &text[..end]).is_err(), "cut at {end}");
        }
        let text = String::from_utf8(text).expect("ASCII");
        for (from, to, line) in [
            ("program 1", "program 2", 1),
            ("origin ", "origin  ", 2),
            ("pens 2", "pens 99999999999", 7),
            ("| 60 %", "| 60", 5),
            ("blocks 3", "blocks 2", 14),
            ("setup 2", "setup 1", 11),
            ("setup 2", "setup 3", 11),
            ("setup 2", "setup 0", 11),
            ("B0002", "B0003", 12),
            ("0 3 7 - ", "2 3 7 - ", 9),
            ("0 3 7 - ", "0 3 7 * ", 9),
            ("0 3 7 - ", "0 3 4294967296 - ", 9),
            ("pass 2", "pass 1", 14),
            ("pass 2", "pass 0", 14),
            ("pass 2", "pass 4294967296", 14),
            ("focus_shift 1500", "focus_shift 0", 15),
            ("focus_shift 1500", "focus_shift 1500 1", 15),
            ("focus_shift 1500", "focus_shift 1.5", 15),
            ("end\n", "end\n\n", 19),
        ] {
            assert!(text.contains(from), "{from}");
            let error = parse("p", text.replacen(from, to, 1).as_bytes()).expect_err(to);
            let place = error.diags()[0].place.to_string();
            assert_eq!(place, format!("p:{line}"), "{from} -> {to}: {error}");
        }
    }

    #[test]
    fn strokes_with_an_odd_count_and_dots_without_a_dwell_are_refused() {
        let start = "terrace program 1\norigin 0 0 0\npens 1\npen p | 1 mm/s | 5 W | 3 kHz | 1\nblocks 1\n\
                     block B0001 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 1\n";
        let dwells = start.replace("| 1\n", "| 1 | 0.0001 s\n");
        for (stroke, good) in [
            ("0 0 0 + 1 2 3 4", [true, true]),
            ("0 0 0 + 1 2 3", [false, false]),
            ("0 0 0 + 1 2", [false, true]),
            ("0 0 0 +", [false, false]),
        ] {
            for (start, good) in [start, &dwells].into_iter().zip(good) {
                assert_eq!(parse("p", format!("{start}{stroke}\nend\n").as_bytes()).is_ok(), good, "{stroke}");
            }
        }
    }
}
