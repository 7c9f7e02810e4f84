//! Text surface files, line by line.
//!
//! Reads a text file of any length through one buffer: `\n`, `\r\n` and `\r` end a line, a UTF-8 mark
//! at the start is skipped, a line is at most [`MAX_LINE`] bytes long. Lines are bytes: names in a
//! file may be in any encoding, only keywords and numbers have to be ASCII.

use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::Path;

use terrace_core::diag::{Diag, Error, Place, unreadable};

/// Longest line that is read, in bytes: a polygon of several hundred thousand corners.
pub(crate) const MAX_LINE: usize = 4 << 20;

/// Bytes looked at to tell text from anything else.
const HEAD: usize = 1024;

/// Opens a regular file; its length in bytes goes with it.
pub(crate) fn open(path: &Path) -> Result<(File, u64), Error> {
    // Asked before opening: a pipe or a device would block or never end.
    let meta = std::fs::metadata(path).map_err(|e| unreadable(path, &e))?;
    if !meta.is_file() {
        let d = Diag::input("file-unreadable", "this is not a regular file");
        return Err(d.at(place(path)).hint("name a surface file").into());
    }
    let file = File::open(path).map_err(|e| unreadable(path, &e))?;
    Ok((file, meta.len()))
}

/// The file as a place.
pub(crate) fn place(path: &Path) -> Place {
    Place::file(path.display().to_string())
}

/// What the first bytes of a file show it to be, where that is neither plain text nor unknown bytes.
pub(crate) fn foreign(head: &[u8]) -> Option<&'static str> {
    const MARKS: &[(&[u8], &str)] = &[
        (b"\x89PNG", "a PNG image"),
        (b"\xff\xd8\xff", "a JPEG image"),
        (b"II*\0", "a TIFF image"),
        (b"MM\0*", "a TIFF image"),
        (b"PK\x03\x04", "a ZIP archive (3MF is one)"),
        (b"\x1f\x8b", "a gzip archive"),
        (b"%PDF", "a PDF document"),
        (b"ply\n", "a PLY file"),
        (b"ply\r", "a PLY file"),
        (b"ISO-10303-21", "a STEP file"),
        (b"<?xml", "an XML file"),
        (b"\xff\xfe", "UTF-16 text"),
        (b"\xfe\xff", "UTF-16 text"),
    ];
    MARKS.iter().find(|(mark, _)| head.starts_with(mark)).map(|&(_, name)| name)
}

/// Whether bytes look like text: of fifty at most one is a control character other than white space. Names may have
/// such; those that end a text or fill its last block do not count.
pub(crate) fn is_text(head: &[u8]) -> bool {
    let head = without_end_marks(head);
    let is_control = |b: &&u8| **b < b' ' && !b.is_ascii_whitespace();
    !head.is_empty() && head.iter().filter(is_control).count() * 50 <= head.len()
}

/// Bytes without Ctrl-Z, by which DOS ends a text, and zeros, by which others fill it up.
pub(crate) fn without_end_marks(bytes: &[u8]) -> &[u8] {
    let end = bytes.iter().rposition(|b| !matches!(b, 0 | 0x1a));
    &bytes[..end.map_or(0, |end| end + 1)]
}

/// The lines of a text file.
pub(crate) struct Lines {
    path: String,
    input: BufReader<File>,
    line: Vec<u8>,
    number: usize,
    after_cr: bool,
    length: u64,
}

impl Lines {
    /// Opens a file whose `kind` ("an OBJ file") the message names where it holds no text.
    pub(crate) fn open(path: &Path, kind: &str) -> Result<Self, Error> {
        let (file, length) = open(path)?;
        let mut input = BufReader::with_capacity(1 << 20, file);
        let head = input.fill_buf().map_err(|e| unreadable(path, &e))?;
        let head = &head[..head.len().min(HEAD)];
        if length == 0 || head.is_empty() {
            let d = Diag::input("surface-empty", "the file is empty").at(place(path));
            return Err(d.hint("export the surface again").into());
        }
        if let Some(what) = foreign(head).or((!is_text(head)).then_some("binary data")) {
            let d = Diag::input("surface-format", format!("this is {what}, not {kind}")).at(place(path));
            return Err(d.hint("give the file the extension of its format, or export it as plain ASCII text").into());
        }
        if head.starts_with(b"\xef\xbb\xbf") {
            input.consume(3);
        }
        let path = path.display().to_string();
        Ok(Self { path, input, line: Vec::new(), number: 0, after_cr: false, length })
    }

    /// The bytes ahead, some thousand at least where the file has them.
    pub(crate) fn head(&self) -> &[u8] {
        self.input.buffer()
    }

    /// Bytes of the whole file.
    pub(crate) fn length(&self) -> u64 {
        self.length
    }

    /// Goes to the next line; false at the end of the file.
    pub(crate) fn advance(&mut self) -> Result<bool, Error> {
        self.line.clear();
        loop {
            let chunk = self.input.fill_buf().map_err(|e| unreadable(Path::new(&self.path), &e))?;
            let Some(&first) = chunk.first() else {
                // The last line may lack its end.
                self.line.truncate(without_end_marks(&self.line).len());
                self.number += usize::from(!self.line.is_empty());
                return Ok(!self.line.is_empty());
            };
            if std::mem::take(&mut self.after_cr) && first == b'\n' {
                self.input.consume(1);
                continue;
            }
            let end = chunk.iter().position(|&b| b == b'\n' || b == b'\r');
            let text = &chunk[..end.unwrap_or(chunk.len())];
            if self.line.len() + text.len() > MAX_LINE {
                self.number += 1;
                let text = format!("line {} has more than {MAX_LINE} bytes", self.number);
                let d = Diag::input("line-too-long", text).at(self.place());
                return Err(d.hint("no real surface file has such lines: export it again").into());
            }
            self.line.extend_from_slice(text);
            let used = text.len();
            if let Some(end) = end {
                self.after_cr = chunk[end] == b'\r';
                self.input.consume(used + 1);
                self.line.truncate(without_end_marks(&self.line).len());
                self.number += 1;
                return Ok(true);
            }
            self.input.consume(used);
        }
    }

    /// The line without its end.
    pub(crate) fn line(&self) -> &[u8] {
        &self.line
    }

    /// Number of the last line read, from 1.
    pub(crate) fn number(&self) -> usize {
        self.number
    }

    /// The last line read as a place.
    pub(crate) fn place(&self) -> Place {
        Place::line(self.path.clone(), self.number)
    }
}

/// The words of a line, as white space parts them.
pub(crate) fn words(line: &[u8]) -> impl Iterator<Item = &[u8]> + Clone {
    line.split(u8::is_ascii_whitespace).filter(|w| !w.is_empty())
}

/// Why a word is not a coordinate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum NoNumber {
    /// The text is nan, infinite, or beyond what a number can hold.
    NotFinite,
    /// The text has a decimal comma.
    Comma,
    /// The text is something else.
    Text,
}

/// A finite number; its exponent may have the D of Fortran.
pub(crate) fn number(word: &[u8]) -> Result<f64, NoNumber> {
    let text = std::str::from_utf8(word).ok();
    match text.and_then(|t| t.parse::<f64>().ok().or_else(|| with_fortran_exponent(t))) {
        Some(v) if v.is_finite() => Ok(v),
        Some(_) => Err(NoNumber::NotFinite),
        // Rust parses nan and inf, but not what C programs write, such as `-nan(ind)` and `1.#INF`.
        None if is_nan(word) || has(word, b".#inf") => Err(NoNumber::NotFinite),
        None if word.contains(&b',') && word.iter().any(u8::is_ascii_digit) => Err(NoNumber::Comma),
        None => Err(NoNumber::Text),
    }
}

/// A number such as 1.5D+02.
fn with_fortran_exponent(text: &str) -> Option<f64> {
    let (digits, exponent) = text.split_once(['d', 'D'])?;
    let is_number = digits.ends_with(|c: char| c.is_ascii_digit() || c == '.');
    is_number.then(|| format!("{digits}e{exponent}").parse().ok())?
}

/// Whether a word is one by which programs write what is not a number: `nan`, `-nan(ind)`, `-1.#IND`, `1.#QNAN`.
pub(crate) fn is_nan(word: &[u8]) -> bool {
    let bare = word.strip_prefix(b"-").or(word.strip_prefix(b"+")).unwrap_or(word);
    let is_named = bare.get(..3).is_some_and(|w| w.eq_ignore_ascii_case(b"nan"));
    (is_named && matches!(bare.get(3), None | Some(b'(')))
        || [&b".#ind"[..], b".#qnan", b".#snan"].iter().any(|n| has(word, n))
}

/// Whether a word has these letters, in lower case, in it.
fn has(word: &[u8], letters: &[u8]) -> bool {
    word.windows(letters.len()).any(|w| w.eq_ignore_ascii_case(letters))
}

/// The diagnostic for a word that is not a coordinate.
pub(crate) fn no_number(word: &[u8], why: NoNumber, place: Place) -> Diag {
    let word = shown(word);
    let (text, hint) = match why {
        NoNumber::NotFinite => (format!("coordinate \"{word}\" is not a finite number"), "repair the surface"),
        NoNumber::Comma => (
            format!("coordinate \"{word}\" has a decimal comma"),
            "export again with decimal points: the exporting program used the locale of the computer",
        ),
        NoNumber::Text => {
            (format!("\"{word}\" is not a number"), "export the surface again; the file may be cut short")
        }
    };
    Diag::input("surface-number", text).at(place).hint(hint)
}

/// A word as a message shows it: short and printable.
pub(crate) fn shown(word: &[u8]) -> String {
    let cut = &word[..word.len().min(32)];
    let dots = if cut.len() < word.len() { "..." } else { "" };
    format!("{}{dots}", String::from_utf8_lossy(cut).escape_debug())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(bytes: &[u8]) -> Result<Vec<(usize, Vec<u8>)>, Error> {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("a.txt");
        std::fs::write(&path, bytes).expect("written");
        let mut lines = Lines::open(&path, "a text")?;
        let mut out = vec![];
        while lines.advance()? {
            out.push((lines.number(), lines.line().to_vec()));
        }
        Ok(out)
    }

    #[test]
    fn every_line_end_counts_once() {
        let want: Vec<(usize, Vec<u8>)> =
            [(1, "a"), (2, ""), (3, "b"), (4, "c")].map(|(n, t)| (n, t.as_bytes().to_vec())).to_vec();
        for text in ["a\n\nb\nc", "a\r\n\r\nb\r\nc\r\n", "a\r\rb\rc\r", "\u{feff}a\n\nb\nc\n"] {
            assert_eq!(all(text.as_bytes()).expect(text), want, "{text:?}");
        }
    }

    #[test]
    fn lines_and_bytes_that_are_no_text_are_refused() {
        let mut long = b"ok\n".to_vec();
        long.resize(MAX_LINE + 10, b'1');
        let e = all(&long).expect_err("too long");
        assert_eq!(e.diags()[0].code, "line-too-long");
        assert!(e.diags()[0].place.to_string().ends_with(":2"));
        let name = all(b"o a \x01 name\nv 1 2 3\nv 1 2 3\nv 1 2 3\nv 1 2 3\nv 1 2 3\n\x1a\0\0").expect("text");
        assert_eq!(name.len(), 6);
        for (bytes, say) in [(&b"\xff\xfea\0"[..], "UTF-16"), (b"v 1\0 2", "binary"), (b"\x89PNG\r\n", "PNG")] {
            let e = all(bytes).expect_err(say);
            assert_eq!(e.diags()[0].code, "surface-format");
            assert!(e.diags()[0].message.contains(say), "{e}");
        }
    }

    #[test]
    fn numbers_are_finite_and_have_points() {
        assert_eq!(number(b"-1.5e-007"), Ok(-1.5e-7));
        assert_eq!(number(b"-1.5D-007"), Ok(-1.5e-7));
        for (word, why) in [
            (&b"1e400"[..], NoNumber::NotFinite),
            (b"nan", NoNumber::NotFinite),
            (b"-inf", NoNumber::NotFinite),
            (b"-nan(ind)", NoNumber::NotFinite),
            (b"-1.#IND00", NoNumber::NotFinite),
            (b"1.#INF", NoNumber::NotFinite),
            (b"name", NoNumber::Text),
            (b"D5", NoNumber::Text),
            (b"3D", NoNumber::Text),
            (b"0,5", NoNumber::Comma),
            (b"x", NoNumber::Text),
            (b"\xff", NoNumber::Text),
        ] {
            assert_eq!(number(word), Err(why));
        }
    }
}
