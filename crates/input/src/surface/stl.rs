//! STL, binary and ASCII.
//!
//! Consumes the file through one buffer of 2 MB (binary) or one line (ASCII); hands on each facet's
//! corners, never its normal. A file is binary if its length is that of its facet count, whatever its
//! header says: many binary files begin with "solid". Where it is not, it is text if it begins with
//! "solid" and continues as text, and else binary with a length that is wrong by little ([`Binary`]).
//! Attributes and solids' names are not kept; a unit that they name is held against that of the job.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

use super::Content;
use super::facets::{Facets, Unit};
use super::lines::{self, Lines, NoNumber, no_number, number, place, shown, words};
use super::stated_unit::StatedUnit;
use terrace_core::diag::{Diag, Error, Place, memory, unreadable};

/// Bytes before the first facet of a binary file: a header of 80 and the count.
const HEADER: usize = 84;
/// Bytes of a binary facet: normal, three corners, attribute.
const FACET: usize = 50;
/// Bytes of the attribute of a facet.
const ATTRIBUTE: u64 = 2;
/// Facets read at a time.
const CHUNK: usize = 40_000;

/// Reads an STL file; `unit` is what its numbers are.
pub(crate) fn read(
    path: &Path,
    unit: Unit,
    notes: &mut Vec<Diag>,
    sink: &mut dyn FnMut([[f64; 3]; 3]),
) -> Result<Content, Error> {
    let mut facets = Facets::new(path, unit, sink);
    let mut stated = StatedUnit::new(unit);
    let (mut file, length) = lines::open(path)?;
    let mut head = Vec::with_capacity(1024);
    file.by_ref().take(1024).read_to_end(&mut head).map_err(|e| unreadable(path, &e))?;
    let ask = |facets: u64| memory::ask("the mesh", super::FACET_BYTES * facets).map_err(|d| d.at(place(path)));
    if is_ascii(&head, length) {
        // Text has some 200 bytes a facet.
        ask(length / 200)?;
        read_ascii(path, &mut facets, &mut stated, notes)?;
    } else {
        let binary = Binary::of(&head, length, &mut file, path)?;
        ask(binary.facets)?;
        stated.look(&head[..HEADER - 4], || place(path));
        notes.extend(binary.note.clone().map(|d| d.at(place(path))));
        binary.read(path, file, &mut facets)?;
    }
    notes.extend(stated.note);
    facets.finish(notes)
}

/// The facets that the header counts.
fn count(head: &[u8]) -> Option<u32> {
    head.get(80..HEADER).and_then(|b| b.try_into().ok()).map(u32::from_le_bytes)
}

/// The length of a binary file of so many facets.
fn length_of(count: u32) -> u64 {
    HEADER as u64 + FACET as u64 * u64::from(count)
}

/// Whether the file is text: its length is not that of a binary one, it begins with the word "solid", and what follows
/// the name is text. The name may have any bytes.
fn is_ascii(head: &[u8], length: u64) -> bool {
    if count(head).map(length_of) == Some(length) {
        return false;
    }
    let text = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head).trim_ascii_start();
    let name_ends = text.iter().position(|b| matches!(b, b'\n' | b'\r')).unwrap_or(0);
    let is_solid = text.get(..5).is_some_and(|w| w.eq_ignore_ascii_case(b"solid"));
    is_solid && lines::is_text(&text[name_ends..])
}

/// How the facets of a binary file lie in it.
struct Binary {
    facets: u64,
    /// Bytes that the last one lacks: none, or some of its attribute.
    lacks: u64,
    note: Option<Diag>,
}

impl Binary {
    /// The facets of a file that is not text, where their count can be relied on: that of the header where the length
    /// agrees, up to the last attribute and to bytes at the end that can be no facet; that of the length where the
    /// header has none.
    fn of(head: &[u8], length: u64, file: &mut File, path: &Path) -> Result<Self, Error> {
        let fault = |d: Diag| Error::from(d.at(place(path)));
        let Some(count) = count(head) else { return Err(fault(no_header(head, length))) };
        let promised = length_of(count);
        let whole = |facets: u64| Self { facets, lacks: 0, note: None };
        if promised == length {
            return Ok(whole(count.into()));
        }
        if let Some(d) = other_format(head) {
            return Err(fault(d));
        }
        // Programs that write as they go leave 0 or -1 where they cannot come back to the count.
        if matches!(count, 0 | u32::MAX) {
            return Self::by_length(count, length, file, path);
        }
        if length < promised {
            return match promised - length {
                lacks @ ..=ATTRIBUTE => Ok(Self { lacks, ..whole(count.into()) }),
                _ => Err(fault(truncated(count, length))),
            };
        }
        let follow = length - promised;
        if is_blank(file, promised, path)? {
            return Ok(whole(count.into()));
        }
        let text = format!("the header promises {count} facets in {promised} bytes, but {follow} more bytes follow");
        if follow < FACET as u64 {
            let d = Diag::warning("stl-trailing", text)
                .hint("a facet has 50 bytes, so these are not facets; they are not read");
            return Ok(Self { note: Some(d), ..whole(count.into()) });
        }
        let hint = "facets would be lost: export the surface again with the right count";
        Err(fault(Diag::input("stl-trailing", text).hint(hint)))
    }

    /// The facets for which the file has room, where the header counts none.
    fn by_length(count: u32, length: u64, file: &mut File, path: &Path) -> Result<Self, Error> {
        let facets = (length - HEADER as u64) / FACET as u64;
        let rest = (length - HEADER as u64) % FACET as u64;
        let lacks = FACET as u64 - rest;
        let mut found = Self { facets, lacks: 0, note: None };
        if is_blank(file, HEADER as u64, path)? {
            return Ok(Self { facets: 0, ..found });
        }
        if lacks <= ATTRIBUTE {
            found = Self { facets: facets + 1, lacks, note: None };
        } else if !is_blank(file, length - rest, path)? {
            let text = format!(
                "the header counts {count} facets, and {} bytes follow, which are not a whole number of facets",
                length - HEADER as u64
            );
            let d = Diag::input("stl-truncated", text).at(place(path));
            return Err(d.hint("the file is cut short or damaged: export or copy it again").into());
        }
        let text = format!("the header counts {count} facets; the {} of the file's length are read", found.facets);
        let d = Diag::warning("stl-count", text).hint("check that the file is complete: nothing in it says so");
        Ok(Self { note: Some(d), ..found })
    }

    /// Hands on the facets.
    fn read(&self, path: &Path, mut file: File, facets: &mut Facets<'_>) -> Result<(), Error> {
        file.seek(SeekFrom::Start(HEADER as u64)).map_err(|e| unreadable(path, &e))?;
        let mut left = self.facets;
        let mut buffer = vec![0; FACET * CHUNK.min(usize::try_from(left).unwrap_or(CHUNK))];
        while left > 0 {
            let now = CHUNK.min(usize::try_from(left).unwrap_or(CHUNK));
            let bytes = &mut buffer[..FACET * now];
            left -= now as u64;
            let there = bytes.len() - if left == 0 { self.lacks as usize } else { 0 };
            file.read_exact(&mut bytes[..there]).map_err(|e| unreadable(path, &e))?;
            for facet in bytes.chunks_exact(FACET) {
                let corners = corners(facet);
                if !corners.iter().flatten().all(|v| v.is_finite()) {
                    return Err(not_finite(path, facets.count(), corners).into());
                }
                facets.push(corners);
            }
        }
        Ok(())
    }
}

/// Whether a file has nothing but zeros, blanks and ends of text from this byte on.
fn is_blank(file: &mut File, from: u64, path: &Path) -> Result<bool, Error> {
    file.seek(SeekFrom::Start(from)).map_err(|e| unreadable(path, &e))?;
    let mut buffer = [0; 1 << 16];
    loop {
        match file.read(&mut buffer).map_err(|e| unreadable(path, &e))? {
            0 => return Ok(true),
            n if buffer[..n].iter().all(|b| matches!(b, 0 | 0x1a) || b.is_ascii_whitespace()) => {}
            _ => return Ok(false),
        }
    }
}

/// What the file is instead, where its first bytes show it.
fn other_format(head: &[u8]) -> Option<Diag> {
    // Text has no zero among its first bytes.
    let is_text = lines::is_text(head) && !head.iter().take(HEADER).any(|&b| b == 0);
    let text = || is_text.then_some("text that does not begin with solid");
    let what = lines::foreign(head).or_else(text)?;
    let d = Diag::input("surface-format", format!("this is {what}, not an STL file"));
    Some(d.hint("give the file the extension of its format, or export it as binary or plain ASCII STL"))
}

/// What is wrong with a file that is too short for a header.
fn no_header(head: &[u8], length: u64) -> Diag {
    let again = "export the surface again as STL";
    if length == 0 {
        return Diag::input("surface-empty", "the file is empty").hint(again);
    }
    lines::foreign(head).and_then(|_| other_format(head)).unwrap_or_else(|| {
        let text = format!("the file has {length} bytes, too few for an STL file: the header alone has {HEADER}");
        Diag::input("stl-truncated", text).hint(again)
    })
}

fn truncated(count: u32, length: u64) -> Diag {
    let promised = length_of(count);
    let text = format!("the header promises {count} facets in {promised} bytes, but the file has {length} bytes");
    Diag::input("stl-truncated", text).hint("the file is cut short or damaged: export or copy it again")
}

/// The corners of a binary facet.
#[inline]
fn corners(facet: &[u8]) -> [[f64; 3]; 3] {
    let mut out = [[0.0; 3]; 3];
    for (v, bytes) in out.as_flattened_mut().iter_mut().zip(facet[12..48].as_chunks::<4>().0) {
        *v = f64::from(f32::from_le_bytes(*bytes));
    }
    out
}

fn not_finite(path: &Path, facet: usize, corners: [[f64; 3]; 3]) -> Diag {
    let bad = corners.iter().flatten().find(|v| !v.is_finite()).copied().unwrap_or(f64::NAN);
    Diag::input("surface-number", format!("facet {facet} (counted from 0) has a coordinate that is {bad}"))
        .at(Place::Facet { path: path.display().to_string(), facet })
        .hint("repair the surface: a facet without a place cannot be marked")
}

/// What may follow in an ASCII file.
#[derive(Clone, Copy, PartialEq)]
enum Expected {
    Solid,
    Facet,
    /// The normal, in any words, and the loop.
    Outer,
    Loop,
    Vertex(usize),
    /// So many numbers of this vertex have been read.
    Number(usize, usize),
    EndLoop,
    EndFacet,
}

impl Expected {
    fn wanted(self) -> &'static str {
        match self {
            Self::Solid => "\"solid\"",
            Self::Facet => "\"facet\" or \"endsolid\"",
            Self::Outer | Self::Loop => "\"outer loop\"",
            Self::Vertex(_) | Self::Number(..) => "\"vertex\" (a facet has three)",
            Self::EndLoop => "\"endloop\" (a facet has three vertices)",
            Self::EndFacet => "\"endfacet\"",
        }
    }
}

const KEYWORDS: [&str; 9] = ["solid", "facet", "outer", "loop", "vertex", "endloop", "endfacet", "endsolid", "color"];

fn is(word: &[u8], keyword: &str) -> bool {
    word.eq_ignore_ascii_case(keyword.as_bytes())
}

/// Reads an ASCII file word by word, however they are divided into lines; several solids one after the other.
fn read_ascii(
    path: &Path,
    facets: &mut Facets<'_>,
    stated: &mut StatedUnit,
    notes: &mut Vec<Diag>,
) -> Result<(), Error> {
    let mut lines = Lines::open(path, "an STL file")?;
    let mut state = Ascii::new();
    while lines.advance()? {
        let mut rest = words(lines.line());
        while let Some(word) = rest.next() {
            state.take(word, &lines, facets)?;
            if is(word, "solid") || is(word, "endsolid") {
                stated.look(lines.line(), || lines.place());
                rest = after_name(rest);
            }
        }
    }
    state.end(&lines)?;
    notes.extend(state.open);
    Ok(())
}

/// The words behind the name of a solid, which ends with its line or before the first facet.
fn after_name<'a, I: Iterator<Item = &'a [u8]> + Clone>(mut rest: I) -> I {
    loop {
        let here = rest.clone();
        match rest.next() {
            None => return rest,
            Some(word) if is(word, "facet") && rest.clone().next().is_some_and(|w| is(w, "normal")) => return here,
            Some(_) => {}
        }
    }
}

/// How far the words of an ASCII file have come.
struct Ascii {
    next: Expected,
    corners: [[f64; 3]; 3],
    /// Where the last vertex began.
    vertex: Place,
    /// The words up to the next keyword have no meaning here: a normal, a colour.
    is_passing: bool,
    /// The first solid that another one or the end of the file follows without `endsolid`.
    open: Option<Diag>,
}

impl Ascii {
    fn new() -> Self {
        Self { next: Expected::Solid, corners: [[0.0; 3]; 3], vertex: Place::Nowhere, is_passing: false, open: None }
    }

    fn take(&mut self, word: &[u8], lines: &Lines, facets: &mut Facets<'_>) -> Result<(), Error> {
        let is_keyword = || KEYWORDS.iter().any(|keyword| is(word, keyword));
        if self.is_passing && !is_keyword() {
            return Ok(());
        }
        self.is_passing = false;
        self.next = match self.next {
            Expected::Number(corner, k) => self.number(word, corner, k, lines)?,
            next if is(word, "color") && next != Expected::Solid => {
                self.is_passing = true;
                next
            }
            Expected::Solid | Expected::Facet if is(word, "solid") => {
                if self.next == Expected::Facet {
                    self.open.get_or_insert_with(|| no_endsolid(lines.place()));
                }
                Expected::Facet
            }
            Expected::Facet if is(word, "facet") => {
                self.is_passing = true;
                Expected::Outer
            }
            Expected::Facet if is(word, "endsolid") => Expected::Solid,
            Expected::Outer if is(word, "outer") => Expected::Loop,
            Expected::Loop if is(word, "loop") => Expected::Vertex(0),
            Expected::Vertex(corner) if is(word, "vertex") => {
                self.vertex = lines.place();
                Expected::Number(corner, 0)
            }
            Expected::EndLoop if is(word, "endloop") => Expected::EndFacet,
            Expected::EndFacet if is(word, "endfacet") => {
                facets.push(self.corners);
                Expected::Facet
            }
            Expected::Vertex(1..) | Expected::EndLoop if !is_keyword() => {
                let text = format!("\"{}\" follows the three numbers of a vertex", shown(word));
                return Err(bad_ascii(text).at(lines.place()).into());
            }
            next => {
                let text = format!("found \"{}\" where {} belongs", shown(word), next.wanted());
                return Err(bad_ascii(text).at(lines.place()).into());
            }
        };
        Ok(())
    }

    /// Takes number `k` of a corner.
    fn number(&mut self, word: &[u8], corner: usize, k: usize, lines: &Lines) -> Result<Expected, Error> {
        match number(word) {
            Ok(v) => self.corners[corner][k] = v,
            Err(NoNumber::Text) if KEYWORDS.iter().any(|keyword| is(word, keyword)) => return Err(self.few(k)),
            Err(why) => return Err(no_number(word, why, lines.place()).into()),
        }
        Ok(match (corner, k) {
            (2, 2) => Expected::EndLoop,
            (_, 2) => Expected::Vertex(corner + 1),
            _ => Expected::Number(corner, k + 1),
        })
    }

    fn few(&self, k: usize) -> Error {
        bad_ascii(format!("a vertex has three numbers, this one has {k}")).at(self.vertex.clone()).into()
    }

    /// Ends the file.
    fn end(&mut self, lines: &Lines) -> Result<(), Error> {
        match self.next {
            Expected::Solid => Ok(()),
            Expected::Facet => {
                self.open.get_or_insert_with(|| no_endsolid(lines.place()));
                Ok(())
            }
            Expected::Number(_, k) => Err(self.few(k)),
            next => {
                let text = format!("the file ends inside a facet, where {} belongs", next.wanted());
                let d = Diag::input("stl-truncated", text).at(lines.place());
                Err(d.hint("the file is cut short: export or copy it again").into())
            }
        }
    }
}

fn bad_ascii(text: String) -> Diag {
    Diag::input("stl-ascii", text).hint("the file is cut short or damaged: export it again, preferably as binary STL")
}

fn no_endsolid(place: Place) -> Diag {
    Diag::warning("stl-no-endsolid", "a solid ends without \"endsolid\"")
        .at(place)
        .hint("check that the file is complete")
}

#[cfg(test)]
mod tests {
    use super::*;

    type Outcome = (Result<Content, Error>, Vec<[[f64; 3]; 3]>, Vec<Diag>);

    fn read_bytes(bytes: &[u8], unit_mm: f64) -> Outcome {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("a.stl");
        std::fs::write(&path, bytes).expect("written");
        let mut got = vec![];
        let mut notes = vec![];
        let result = read(&path, Unit::mm(unit_mm), &mut notes, &mut |f| got.push(f));
        (result, got, notes)
    }

    fn binary(header: &str, count: u32, facets: &[[f32; 9]]) -> Vec<u8> {
        let mut out = format!("{header:80}").into_bytes();
        out.extend_from_slice(&count.to_le_bytes());
        for f in facets {
            out.extend_from_slice(&[0; 12]);
            f.iter().for_each(|v| out.extend_from_slice(&v.to_le_bytes()));
            out.extend_from_slice(&[0; 2]);
        }
        out
    }

    const ONE: [f32; 9] = [0.1, 0.0, 0.0, 10.0, 0.0, 0.5, 0.0, 10.0, 0.0];

    #[track_caller]
    fn refused(bytes: &[u8], code: &str, say: &str) {
        let e = read_bytes(bytes, 1.0).0.err().expect("refused");
        assert_eq!(e.diags()[0].code, code, "{e}");
        assert!(e.to_string().contains(say) && !e.diags()[0].hint.is_empty(), "{e}");
    }

    #[test]
    fn binary_corners_keep_their_bits_in_the_unit_given() {
        let (result, got, notes) = read_bytes(&binary("solid not ascii", 2, &[ONE, ONE]), 25.4);
        assert!(matches!(result, Ok(Content::Facets(2))) && notes.is_empty());
        assert_eq!(got[1][0][0], f64::from(0.1f32) * 25.4);
        assert_eq!(got[1][1], [254.0, 0.0, 12.7]);
    }

    #[test]
    fn binary_longer_than_one_chunk_comes_in_order() {
        let n = CHUNK + 3;
        let facets: Vec<[f32; 9]> = (0..n).map(|i| [i as f32 / 64.0; 9]).collect();
        let (result, got, _) = read_bytes(&binary("", n as u32, &facets), 1.0);
        assert!(matches!(result, Ok(Content::Facets(k)) if k == n));
        assert!(got.iter().enumerate().all(|(i, f)| f[2][2] == i as f64 / 64.0));
    }

    #[test]
    fn binary_of_the_wrong_length_is_refused() {
        refused(&binary("", 4_000_000_000, &[ONE]), "stl-truncated", "200000000084 bytes, but the file has 134");
        refused(&binary("", 1, &[ONE, ONE]), "stl-trailing", "50 more bytes");
        refused(&binary("", 0, &[]), "surface-empty", "no facets");
        refused(&[binary("", 0, &[]), vec![0; 300]].concat(), "surface-empty", "no facets");
        refused(
            &[binary("", 0, &[ONE]), vec![1; 30]].concat(),
            "stl-truncated",
            "80 bytes follow, which are not a whole",
        );
        refused(&binary("", u32::MAX, &[ONE])[..120], "stl-truncated", "36 bytes follow");
        refused(&binary("", 1, &[ONE])[..131], "stl-truncated", "134 bytes, but the file has 131");
        refused(&[b'a'; 100], "surface-format", "text that does not begin with solid");
        refused(&[1; 40], "stl-truncated", "40 bytes");
        refused(b"", "surface-empty", "empty");
        refused(b"\x89PNG\r\n\x1a\nxx", "surface-format", "a PNG image, not an STL");
        refused(b"\xff\xfes\0o\0l\0i\0d\0", "surface-format", "UTF-16");
    }

    #[test]
    fn binary_of_nearly_the_right_length_is_read() {
        let with = |tail: &[u8]| [binary("", 2, &[ONE, ONE]), tail.to_vec()].concat();
        let cut = |count: u32, by: usize| binary("", count, &[ONE, ONE])[..184 - by].to_vec();
        for (bytes, note) in [
            (with(b"\0"), None),
            (with(b"\r\n"), None),
            (with(&[0; 50]), None),
            (with(&[0; 428]), None),
            (with(b"\n\x1a"), None),
            (with(b"end"), Some(("stl-trailing", "3 more bytes"))),
            (cut(2, 1), None),
            (cut(2, 2), None),
            (cut(0, 0), Some(("stl-count", "counts 0 facets; the 2 of"))),
            (cut(u32::MAX, 0), Some(("stl-count", "counts 4294967295 facets; the 2 of"))),
            (cut(0, 2), Some(("stl-count", "the 2 of"))),
            ([cut(0, 0), vec![0; 7]].concat(), Some(("stl-count", "the 2 of"))),
        ] {
            let (result, got, notes) = read_bytes(&bytes, 1.0);
            assert!(matches!(result, Ok(Content::Facets(2))), "{:?}", result.err());
            assert_eq!(got[0], got[1]);
            assert_eq!(notes.len(), usize::from(note.is_some()), "{notes:?}");
            if let Some((code, say)) = note {
                assert!(notes[0].code == code && notes[0].message.contains(say), "{}", notes[0]);
            }
        }
    }

    #[test]
    fn a_unit_in_a_header_is_held_against_that_of_the_job() {
        for bytes in [binary("UNITS=in", 1, &[ONE]), TEXT.replacen("a part", "a UNITS=in", 1).into()] {
            let notes = read_bytes(&bytes, 1.0).2;
            assert!(notes[0].code == "surface-unit-named" && notes[0].hint.contains("\"in\""), "{notes:?}");
            assert!(read_bytes(&bytes, 25.4).2.is_empty());
        }
    }

    #[test]
    fn coordinates_without_a_place_are_refused() {
        let mut bad = ONE;
        bad[4] = f32::NAN;
        refused(&binary("", 2, &[ONE, bad]), "surface-number", "facet 1");
        bad[4] = 3e38;
        refused(&binary("", 3, &[ONE, bad, ONE]), "surface-size", "3.000e38");
        let (_, got, _) = read_bytes(&binary("", 3, &[ONE, bad, ONE]), 1.0);
        assert_eq!(got.len(), 1, "nothing is handed on from the first facet beyond");
        let (result, _, notes) = read_bytes(&binary("", 1, &[ONE]), 1e-2);
        assert!(result.is_ok());
        assert_eq!(notes[0].code, "surface-tiny");
    }

    const TEXT: &str = "solid a part of steel\n facet normal 0 0 1\n  outer loop\n   vertex 0 0 0\n   VERTEX 1e1 0 -2.5e-001\n   vertex +0 10. 0\n  endloop\n endfacet\nendsolid a part\n";

    #[test]
    fn ascii_reads_solids_line_ends_and_exponents() {
        let two = format!("{}\n{TEXT}", TEXT.replace('\n', "\r\n"));
        let (result, got, notes) = read_bytes(two.as_bytes(), 1.0);
        assert!(matches!(result, Ok(Content::Facets(2))) && notes.is_empty());
        assert_eq!(got[0], [[0.0, 0.0, 0.0], [10.0, 0.0, -0.25], [0.0, 10.0, 0.0]]);
        assert_eq!(got[0], got[1]);
        let (result, _, notes) = read_bytes(TEXT.rsplit_once("endsolid").expect("there").0.as_bytes(), 1.0);
        assert!(result.is_ok());
        assert_eq!(notes[0].code, "stl-no-endsolid");
    }

    #[test]
    fn ascii_is_read_by_words_and_not_by_lines() {
        let plain = read_bytes(TEXT.as_bytes(), 1.0).1;
        let (name, body) = TEXT.split_once('\n').expect("lines");
        let (body, end) = body.rsplit_once("endsolid").expect("an end");
        for text in [
            TEXT.replacen('\n', "\t", 8),
            TEXT.replace('\n', " "),
            TEXT.replacen("steel\n", "steel\ncolor 0.5 0.5 0.5\n", 1),
            TEXT.replacen("loop\n", "loop\n color 1 0 0\n", 1),
            TEXT.replacen("0 0 1\n", "-1.#IND nan 0\n", 1),
            TEXT.replacen("1e1", "1D+1", 1),
            format!("{TEXT}\x1a"),
            format!("{TEXT}\0\0\0"),
            format!("{TEXT}\x1a\r\n"),
            TEXT.replacen("steel", "ste\x01\x02\x03el", 1),
            TEXT.replacen("a part of steel", &format!("{}\x02", "n".repeat(90)), 1),
            TEXT.replacen("a part of steel", "a facet of steel", 1),
            format!("{name}\n{}endsolid{end}", body.replace(' ', "\n\n")),
        ] {
            let (result, got, notes) = read_bytes(text.as_bytes(), 1.0);
            assert!(result.is_ok() && got == plain, "{text:?}: {:?}", result.err());
            assert!(notes.is_empty(), "{text:?}: {notes:?}");
        }
        let open = TEXT.replace("endsolid a part", "");
        assert_eq!(read_bytes(open.repeat(3).as_bytes(), 1.0).2.len(), 1);
    }

    #[test]
    fn ascii_faults_are_named_by_line() {
        for (from, to, code, say) in [
            ("endloop", "vertex 1 1 1\n  endloop", "stl-ascii", ":7: found \"vertex\""),
            ("vertex +0 10. 0", "", "stl-ascii", ":7: found \"endloop\""),
            ("10. 0", "10", "stl-ascii", ":6: a vertex has three numbers, this one has 2"),
            ("10. 0", "10 0 0", "stl-ascii", ":6: \"0\" follows"),
            ("10.", "0,5", "surface-number", ":6: coordinate \"0,5\" has a decimal comma"),
            ("10.", "nan", "surface-number", ":6: coordinate \"nan\""),
            ("10.", "1e400", "surface-number", ":6: coordinate \"1e400\""),
            (" endfacet\nendsolid a part\n", "", "stl-truncated", ":7: the file ends inside a facet"),
            ("facet normal", "fazet", "stl-ascii", ":2: found \"fazet\" where \"facet\""),
            ("solid a part of steel\n", "solid x\nendsolid x\n", "stl-ascii", ":3: found \"facet\""),
        ] {
            refused(TEXT.replacen(from, to, 1).as_bytes(), code, say);
        }
        refused(b"solid nothing\nendsolid\n", "surface-empty", "no facets");
    }
}
