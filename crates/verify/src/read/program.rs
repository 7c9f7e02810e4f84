//! Reader of `program.txt`: integers in nm, one line per block and per stroke.
//!
//! Consumes the file line by line; promises a [`Program`] whose ranges are sound, whose strokes have
//! at least two points and whose numbers cannot overflow later sums. What the numbers mean is for the
//! rules. Memory grows with what was read, never with a count that the file announces.

use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::Path;

use super::Fault;
use super::number::integer;
use terrace_core::geom::{FieldPoint, MAX_NM, Nm, P2};
use terrace_core::machine::{Commanded, Origin, TiltAngles};
use terrace_core::program::{Block, PassId, Pen, PenId, Program, SectionId, SetupId, Stop, Stroke, StrokeId};

/// Largest block-local coordinate, nm: below i32 so that a mirrored one fits too.
const MAX_LOCAL: i64 = 2_000_000_000;

/// Largest angle of a tilt axis, millionths of a degree.
const MAX_TURN: i64 = 360_000_000;

/// Longest line, in bytes: a stroke of some ten million points.
const MAX_LINE: u64 = 1 << 28;

/// The contents of `program.txt`.
#[derive(Debug)]
pub(crate) struct ProgramFile {
    /// Part-frame origins in the table frame, nm, by set-up; at least one.
    pub(crate) origins: Vec<Origin>,
    /// Blocks, strokes, points, pens.
    pub(crate) program: Program,
    /// Names of the blocks.
    pub(crate) ids: Vec<String>,
}

impl ProgramFile {
    /// Where the part lies while a block is marked, nm.
    pub(crate) fn origin(&self, block: &Block) -> Origin {
        self.origins[block.setup.index()]
    }
}

/// Reads the file at `path`.
pub(crate) fn read(path: &Path) -> Result<ProgramFile, Fault> {
    if !path.metadata().is_ok_and(|found| found.is_file()) {
        return Err(Fault::new(0, "cannot be read: it is not a regular file"));
    }
    let file = File::open(path).map_err(|e| Fault::new(0, format!("cannot be read: {e}")))?;
    parse(BufReader::with_capacity(1 << 18, file))
}

/// Reads a program from any buffered source.
pub(crate) fn parse(input: impl BufRead) -> Result<ProgramFile, Fault> {
    let mut lines = Lines { input, line: 0, text: Vec::new() };
    if lines.next()? != b"terrace program 1" {
        return Err(lines.fault("does not begin with \"terrace program 1\""));
    }
    let mut origins = Vec::new();
    while origins.is_empty() || lines.begins_with(b'o')? {
        origins.push(lines.keyed(b"origin", |w| Some(Origin([w.nm()?, w.nm()?, w.nm()?])))?);
    }
    let pens = lines.keyed(b"pens", |w| w.count())?;
    let mut program = Program::default();
    for _ in 0..pens {
        let text = lines.next()?;
        match pen(text) {
            Some(pen) => program.pens.push(pen),
            None => {
                return Err(lines.fault(
                    "is not a pen: name | speed | power | frequency | passes, and a dwell where it marks dots",
                ));
            }
        }
    }
    let blocks = lines.keyed(b"blocks", |w| w.count())?;
    let mut ids = Vec::new();
    let (mut pass, mut setup, mut focus_shift) = (0, 0, Nm(0));
    for _ in 0..blocks {
        if lines.begins_with(b'p')? {
            pass = lines.keyed(b"pass", |w| w.count()?.checked_sub(1))?;
        }
        if lines.begins_with(b's')? {
            let is_known = |n: &u32| (*n as usize) < origins.len();
            setup = lines.keyed(b"setup", |w| w.count()?.checked_sub(1).filter(is_known))?;
        }
        if lines.begins_with(b'f')? {
            focus_shift = lines.keyed(b"focus_shift", |w| w.height())?;
        }
        let (id, mut block, strokes) = lines.keyed(b"block", block)?;
        (block.pass, block.setup, block.focus_shift) = (PassId(pass), SetupId(setup), focus_shift);
        block.strokes = program.strokes.len()..program.strokes.len();
        for _ in 0..strokes {
            let text = lines.next()?;
            if stroke(&mut Words { text }, &mut program).is_none() {
                return Err(lines.fault("is not a stroke: pen source segment +|- x y x y ..."));
            }
        }
        block.strokes.end = program.strokes.len();
        program.blocks.push(block);
        ids.push(id);
    }
    if lines.next()? != b"end" {
        return Err(lines.fault("\"end\" was expected after the last block"));
    }
    if !lines.at_end()? {
        return Err(lines.fault("something follows the end"));
    }
    Ok(ProgramFile { origins, program, ids })
}

/// Lines of the file, one at a time in a reused buffer.
struct Lines<R> {
    input: R,
    line: usize,
    text: Vec<u8>,
}

impl<R: BufRead> Lines<R> {
    fn fault(&self, message: impl Into<String>) -> Fault {
        Fault::new(self.line, message)
    }

    fn next(&mut self) -> Result<&[u8], Fault> {
        self.line += 1;
        self.text.clear();
        let mut limited = std::io::Read::take(&mut self.input, MAX_LINE);
        let read = limited.read_until(b'\n', &mut self.text);
        read.map_err(|e| Fault::new(self.line, format!("cannot be read: {e}")))?;
        if self.text.pop() != Some(b'\n') {
            return Err(Fault::new(self.line, "ends in the middle"));
        }
        Ok(&self.text)
    }

    /// A line `key value ...`.
    fn keyed<T>(&mut self, key: &[u8], parse: impl Fn(&mut Words<'_>) -> Option<T>) -> Result<T, Fault> {
        let mut words = Words { text: self.next()? };
        let value = if words.next() == Some(key) { parse(&mut words) } else { None };
        match value {
            Some(value) if words.next().is_none() => Ok(value),
            _ => Err(self.fault(format!("is not a sound \"{}\" line", String::from_utf8_lossy(key)))),
        }
    }

    /// Whether the next line begins with a byte.
    fn begins_with(&mut self, first: u8) -> Result<bool, Fault> {
        let rest = self.input.fill_buf().map_err(|e| Fault::new(self.line, format!("cannot be read: {e}")))?;
        Ok(rest.first() == Some(&first))
    }

    fn at_end(&mut self) -> Result<bool, Fault> {
        let rest = self.input.fill_buf().map_err(|e| Fault::new(self.line, format!("cannot be read: {e}")))?;
        Ok(rest.is_empty())
    }
}

/// Words of a line, separated by single spaces.
struct Words<'a> {
    text: &'a [u8],
}

impl<'a> Words<'a> {
    fn next(&mut self) -> Option<&'a [u8]> {
        if self.text.is_empty() {
            return None;
        }
        let end = self.text.iter().position(|&c| c == b' ').unwrap_or(self.text.len());
        let word = &self.text[..end];
        self.text = self.text.get(end + 1..).unwrap_or(&[]);
        Some(word)
    }
    fn int(&mut self) -> Option<i64> {
        integer(self.next()?)
    }
    fn within(&mut self, limit: i64) -> Option<i64> {
        self.int().filter(|v| (-limit..=limit).contains(v))
    }
    fn nm(&mut self) -> Option<i64> {
        self.within(MAX_NM.0)
    }
    fn height(&mut self) -> Option<Nm> {
        self.nm().map(Nm)
    }
    fn count(&mut self) -> Option<u32> {
        u32::try_from(self.int()?).ok()
    }
    fn local(&mut self) -> Option<i32> {
        i32::try_from(self.within(MAX_LOCAL)?).ok()
    }
}

fn pen(line: &[u8]) -> Option<Pen> {
    let text = std::str::from_utf8(line).ok()?.strip_prefix("pen ")?;
    let mut parts = text.split('|').map(str::trim);
    let mut pen = Pen {
        name: parts.next()?.to_owned(),
        speed: parts.next()?.parse().ok()?,
        power: parts.next()?.parse().ok()?,
        frequency: parts.next()?.parse().ok()?,
        passes: parts.next()?.parse().ok()?,
        dwell: None,
    };
    if let Some(dwell) = parts.next() {
        pen.dwell = Some(dwell.parse().ok()?);
    }
    parts.next().is_none().then_some(pen)
}

fn block(w: &mut Words<'_>) -> Option<(String, Block, u32)> {
    let id = std::str::from_utf8(w.next()?).ok()?.to_owned();
    let section = [w.count()?, w.count()?];
    let level = i32::try_from(w.int()?).ok()?;
    let tilt = TiltAngles([w.within(MAX_TURN)?, w.within(MAX_TURN)?]);
    let centre = P2::new(w.nm()?, w.nm()?);
    let (lpfl, z_lo, z_hi) = (w.height()?, w.height()?, w.height()?);
    let stop = Stop { section: SectionId(section), level, tilt, centre, lpfl, z_lo, z_hi };
    let stage = Commanded([w.nm()?, w.nm()?, w.nm()?]);
    let retract = match w.next()? {
        b"0" => false,
        b"1" => true,
        _ => return None,
    };
    let (z_lo, z_hi) = (w.height()?, w.height()?);
    let (pass, setup, focus_shift) = (PassId(0), SetupId(0), Nm(0));
    let block = Block { pass, setup, stop, stage, focus_shift, retract, z_lo, z_hi, strokes: 0..0 };
    Some((id, block, w.count()?))
}

fn stroke(w: &mut Words<'_>, program: &mut Program) -> Option<()> {
    let pen = u16::try_from(w.int()?).ok()?;
    let (source, segment) = (w.count()?, w.count()?);
    let reversed = match w.next()? {
        b"+" => false,
        b"-" => true,
        _ => return None,
    };
    let first = program.points.len();
    while !w.text.is_empty() {
        program.points.push(FieldPoint::new(w.local()?, w.local()?));
    }
    let len = program.points.len() - first;
    let dwell = program.pens.get(usize::from(pen))?.dwell;
    if len == 0 || len == 1 && dwell.is_none() {
        return None;
    }
    let (first, len) = (u32::try_from(first).ok()?, u32::try_from(len).ok()?);
    program.strokes.push(Stroke { source: StrokeId(source), segment, reversed, pen: PenId(pen), first, len });
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "terrace program 1\norigin 1 -2 3\norigin 4 5 6\npens 1\npen fill | 1000 mm/s | 60 % | 60 kHz | 2\nblocks 1\npass 3\nsetup 2\nfocus_shift -7\n\
        block B0001 0 1 -2 0 -5 10 20 30 25 35 -11 -18 33 1 28 31 2\n0 7 3 + 0 0 5 5\n0 8 0 - 1 1 2 2 3 -3\nend\n";

    #[test]
    fn a_program_is_read_as_written() {
        let file = parse(TEXT.as_bytes()).expect("sound");
        assert_eq!(
            (file.origins, file.ids.as_slice()),
            (vec![Origin([1, -2, 3]), Origin([4, 5, 6])], &["B0001".to_owned()][..])
        );
        let p = &file.program;
        assert_eq!((p.pens[0].name.as_str(), p.pens[0].passes), ("fill", 2));
        let b = &p.blocks[0];
        assert_eq!((b.pass, b.setup, b.focus_shift), (PassId(2), SetupId(1), Nm(-7)));
        assert_eq!((b.stop.section, b.stop.level, b.stop.centre), (SectionId([0, 1]), -2, P2::new(10, 20)));
        assert_eq!(b.stop.tilt, TiltAngles([0, -5]));
        assert_eq!((b.stop.lpfl, b.stop.z_lo, b.stop.z_hi, b.z_lo, b.z_hi), (Nm(30), Nm(25), Nm(35), Nm(28), Nm(31)));
        assert_eq!((b.stage, b.retract, b.strokes.clone()), (Commanded([-11, -18, 33]), true, 0..2));
        assert_eq!(p.points_of(&p.strokes[1]), [[1, 1], [2, 2], [3, -3]].map(FieldPoint::from));
        assert!(p.strokes[1].reversed && p.strokes[1].source == StrokeId(8));
    }

    #[test]
    fn every_cut_and_every_foreign_byte_is_a_fault_with_its_line() {
        for end in 0..TEXT.len() {
            assert!(parse(&TEXT.as_bytes()[..end]).is_err(), "cut at {end} of {}", TEXT.len());
        }
        for (from, to, line) in [
            ("program 1", "program 2", 1),
            ("origin 1", "origin x", 2),
            ("origin 4", "other 4", 3),
            ("pens 1", "pens 99999999999", 4),
            ("60 %", "60", 5),
            ("blocks 1", "blocks 4000000000", 13),
            ("pass 3", "pass 0", 7),
            ("pass 3", "past 3", 7),
            ("setup 2", "setup 3", 8),
            ("setup 2", "setup 0", 8),
            ("focus_shift -7", "focus_shift 1e3", 9),
            ("focus_shift -7", "focus -7", 9),
            ("block B0001 0", "block B0001 -1", 10),
            ("30 25", "99999999999999999999 25", 10),
            ("5 5\n", "5 2147483648\n", 11),
            ("5 5\n", "5\n", 11),
            ("0 7", "1 7", 11),
            ("8 0 -", "8 0 *", 12),
            ("end\n", "end\nmore\n", 13),
        ] {
            let fault = parse(TEXT.replace(from, to).as_bytes()).expect_err(to);
            assert_eq!(fault.line, line, "{from} -> {to}: {}", fault.message);
        }
    }
}
