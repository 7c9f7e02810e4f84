//! STL, binary and ASCII.
//!
//! Consumes the file through one buffer of 2 MB (binary) or one line (ASCII); hands on each facet's
//! corners, never its normal. A file is binary if its length is that of its facet count, whatever its
//! header says: many binary files begin with "solid". Attributes and solids' names are not kept.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

use super::Content;
use super::facets::{Facets, Unit};
use super::lines::{self, Lines, no_number, number, place, shown, words};
use crate::diag::{Diag, Error, Place, memory, unreadable};

/// Bytes before the first facet of a binary file: a header of 80 and the count.
const HEADER: usize = 84;
/// Bytes of a binary facet: normal, three corners, attribute.
const FACET: usize = 50;
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
    let (mut file, length) = lines::open(path)?;
    let mut head = Vec::with_capacity(1024);
    file.by_ref().take(1024).read_to_end(&mut head).map_err(|e| unreadable(path, &e))?;
    let count = head.get(80..HEADER).and_then(|b| b.try_into().ok()).map(u32::from_le_bytes);
    let promised = count.map(|n| HEADER as u64 + FACET as u64 * u64::from(n));
    // Where the length is not that of a binary file it is text, with some 200 bytes a facet.
    let count_about = if promised == Some(length) { length / FACET as u64 } else { length / 200 };
    memory::ask("the mesh", super::FACET_BYTES * count_about).map_err(|d| d.at(place(path)))?;
    if promised == Some(length) {
        read_binary(path, file, length, &mut facets)?;
    } else if begins_with_solid(&head) {
        read_ascii(path, &mut facets, notes)?;
    } else {
        return Err(no_stl(&head, count, length).at(place(path)).into());
    }
    facets.finish(notes)
}

/// Whether the file is text that begins with the word "solid".
fn begins_with_solid(head: &[u8]) -> bool {
    let text = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head).trim_ascii_start();
    let is_solid = text.get(..5).is_some_and(|w| w.eq_ignore_ascii_case(b"solid"));
    is_solid && lines::is_text(head)
}

/// What is wrong with a file that is neither binary nor ASCII STL.
fn no_stl(head: &[u8], count: Option<u32>, length: u64) -> Diag {
    let again = "export the surface again as STL";
    if length == 0 {
        return Diag::input("surface-empty", "the file is empty").hint(again);
    }
    let other_format = |what: &str| {
        Diag::input("surface-format", format!("this is {what}, not an STL file"))
            .hint("give the file the extension of its format, or export it as binary or plain ASCII STL")
    };
    if let Some(what) = lines::foreign(head) {
        return other_format(what);
    }
    let Some(count) = count else {
        let text = format!("the file has {length} bytes, too few for an STL file: the header alone has {HEADER}");
        return Diag::input("stl-truncated", text).hint(again);
    };
    if lines::is_text(head) {
        return other_format("text that does not begin with solid");
    }
    let promised = HEADER as u64 + FACET as u64 * u64::from(count);
    if promised > length {
        let text = format!("the header promises {count} facets in {promised} bytes, but the file has {length} bytes");
        return Diag::input("stl-truncated", text).hint("the file is cut short or damaged: export or copy it again");
    }
    let text =
        format!("the header promises {count} facets in {promised} bytes, but {} more bytes follow", length - promised);
    Diag::input("stl-trailing", text).hint("facets would be lost: export the surface again with the right count")
}

/// Reads the facets of a binary file whose length is right.
fn read_binary(path: &Path, mut file: File, length: u64, facets: &mut Facets<'_>) -> Result<(), Error> {
    file.seek(SeekFrom::Start(HEADER as u64)).map_err(|e| unreadable(path, &e))?;
    let mut left = (length - HEADER as u64) / FACET as u64;
    let mut buffer = vec![0; FACET * CHUNK.min(usize::try_from(left).unwrap_or(CHUNK))];
    while left > 0 {
        let now = CHUNK.min(usize::try_from(left).unwrap_or(CHUNK));
        let bytes = &mut buffer[..FACET * now];
        file.read_exact(bytes).map_err(|e| unreadable(path, &e))?;
        for facet in bytes.chunks_exact(FACET) {
            let corners = corners(facet);
            if !corners.iter().flatten().all(|v| v.is_finite()) {
                return Err(not_finite(path, facets.count(), corners).into());
            }
            facets.push(corners);
        }
        left -= now as u64;
    }
    Ok(())
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
enum Next {
    Solid,
    Facet,
    Loop,
    Vertex(usize),
    EndLoop,
    EndFacet,
}

impl Next {
    fn wanted(self) -> &'static str {
        match self {
            Self::Solid => "\"solid\"",
            Self::Facet => "\"facet\" or \"endsolid\"",
            Self::Loop => "\"outer loop\"",
            Self::Vertex(_) => "\"vertex\" (a facet has three)",
            Self::EndLoop => "\"endloop\" (a facet has three vertices)",
            Self::EndFacet => "\"endfacet\"",
        }
    }
}

/// Reads an ASCII file, one statement to a line, several solids one after the other.
fn read_ascii(path: &Path, facets: &mut Facets<'_>, notes: &mut Vec<Diag>) -> Result<(), Error> {
    let mut lines = Lines::open(path, "an STL file")?;
    let mut next = Next::Solid;
    let mut corners = [[0.0; 3]; 3];
    while lines.advance()? {
        let line = lines.line();
        let Some(word) = words(line).next() else { continue };
        let is = |keyword: &str| word.eq_ignore_ascii_case(keyword.as_bytes());
        next = match next {
            Next::Solid | Next::Facet if is("solid") => {
                if next == Next::Facet {
                    notes.push(no_endsolid(lines.place()));
                }
                Next::Facet
            }
            Next::Facet if is("facet") => Next::Loop,
            Next::Facet if is("endsolid") => Next::Solid,
            Next::Loop if is("outer") => Next::Vertex(0),
            Next::Vertex(k) if is("vertex") => {
                corners[k] = vertex(line).map_err(|d| d.at(lines.place()))?;
                if k < 2 { Next::Vertex(k + 1) } else { Next::EndLoop }
            }
            Next::EndLoop if is("endloop") => Next::EndFacet,
            Next::EndFacet if is("endfacet") => {
                facets.push(corners);
                Next::Facet
            }
            _ => {
                let text = format!("found \"{}\" where {} belongs", shown(word), next.wanted());
                return Err(bad_ascii(text).at(lines.place()).into());
            }
        };
    }
    match next {
        Next::Solid => Ok(()),
        Next::Facet => {
            notes.push(no_endsolid(lines.place()));
            Ok(())
        }
        _ => {
            let text = format!("the file ends inside a facet, where {} belongs", next.wanted());
            let d = Diag::input("stl-truncated", text).at(lines.place());
            Err(d.hint("the file is cut short: export or copy it again").into())
        }
    }
}

/// The corner in a vertex line, in file units.
fn vertex(line: &[u8]) -> Result<[f64; 3], Diag> {
    let mut found = words(line).skip(1);
    let mut p = [0.0; 3];
    for (k, v) in p.iter_mut().enumerate() {
        let word = found.next().ok_or_else(|| bad_ascii(format!("a vertex has three numbers, this one has {k}")))?;
        *v = number(word).map_err(|why| no_number(word, why, Place::Nowhere))?;
    }
    match found.next() {
        None => Ok(p),
        Some(word) => Err(bad_ascii(format!("\"{}\" follows the three numbers of a vertex", shown(word)))),
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
        let (mut got, mut notes) = (vec![], vec![]);
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
        refused(&[b'a'; 100], "surface-format", "text that does not begin with solid");
        refused(&[1; 40], "stl-truncated", "40 bytes");
        refused(b"", "surface-empty", "empty");
        refused(b"\x89PNG\r\n\x1a\nxx", "surface-format", "a PNG image, not an STL");
        refused(b"\xff\xfes\0o\0l\0i\0d\0", "surface-format", "UTF-16");
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
