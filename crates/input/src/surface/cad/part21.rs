//! The syntax of a STEP file (ISO 10303-21), as far as Open CASCADE relies on it.
//!
//! Consumes the file twice, through one buffer; holds 8 bytes an instance. Promises that texts end, brackets match and
//! are not nested deeply, numbers are finite, every reference has its instance, and that the file is complete. What
//! the instances mean is left to the reader.

use std::io::{BufRead, BufReader};
use std::path::Path;

use super::AGAIN;
use crate::surface::lines::{self, foreign, place};
use terrace_core::diag::{Diag, Error, Place, unreadable};

/// Deepest nesting of brackets; lists of lists of points are three deep.
const DEEPEST: usize = 200;

/// Longest word that is looked at: a keyword or a number.
const WORD: usize = 100;

/// The UTF-8 mark, which may stand before everything.
const MARK: &[u8] = b"\xef\xbb\xbf";

/// Checks a file.
pub(super) fn check(path: &Path) -> Result<(), Error> {
    let mut defined = Vec::new();
    let mut twice = None;
    walk(path, &mut |_, instance| {
        if let Instance::Defined(id) = instance {
            defined.push(id);
        }
        Ok(())
    })?;
    defined.sort_unstable();
    for pair in defined.windows(2) {
        if pair[0] == pair[1] && twice.is_none() {
            twice = Some(pair[0]);
        }
    }
    if let Some(id) = twice {
        let d = Diag::input("step-reference", format!("two instances have the number #{id}")).at(place(path));
        return Err(d.hint(AGAIN).into());
    }
    walk(path, &mut |line, instance| match instance {
        Instance::Named(id) if defined.binary_search(&id).is_err() => {
            let text = format!("#{id} is referred to but not in the file");
            Err(Diag::input("step-reference", text).at(Place::line(path.display().to_string(), line)).hint(AGAIN))
        }
        _ => Ok(()),
    })
}

/// An instance where it is defined, or where it is named.
enum Instance {
    Defined(u64),
    Named(u64),
}

/// Goes through the file; `each` gets every instance with its line.
fn walk(path: &Path, each: &mut dyn FnMut(usize, Instance) -> Result<(), Diag>) -> Result<(), Error> {
    let (file, _) = lines::open(path)?;
    let mut input = BufReader::with_capacity(1 << 20, file);
    let head = input.fill_buf().map_err(|e| unreadable(path, &e))?;
    let marked = head.strip_prefix(MARK).unwrap_or(head);
    let start = marked.iter().position(|b| !b.is_ascii_whitespace()).unwrap_or(marked.len());
    if !marked[start..].starts_with(b"ISO-10303-21") {
        let what = if head.is_empty() { Some("empty") } else { foreign(head) };
        let text = format!("this is {}, not a STEP file", what.unwrap_or("something else"));
        let d = Diag::input("surface-format", text).at(place(path));
        return Err(d.hint("give the file the extension of its format, or export it as STEP").into());
    }
    let mark = head.len() - marked.len();
    input.consume(mark);
    let mut scanner = Scanner::new();
    loop {
        let bytes = input.fill_buf().map_err(|e| unreadable(path, &e))?;
        if bytes.is_empty() {
            break;
        }
        let length = bytes.len();
        for &b in bytes {
            scanner.byte(b, each).map_err(|d| {
                let named = d.place != Place::Nowhere;
                if named { d } else { d.at(Place::line(path.display().to_string(), scanner.line)).hint(AGAIN) }
            })?;
        }
        input.consume(length);
    }
    scanner.end().map_err(|d| d.at(Place::line(path.display().to_string(), scanner.line)).hint(AGAIN).into())
}

/// What the scanner is inside of.
#[derive(Clone, Copy, PartialEq)]
enum Inside {
    /// Between words.
    Plain,
    /// A keyword, a number, or a reference.
    Word,
    /// A text that began at this line.
    Text(usize),
    /// Behind a text, where a comma or a bracket must come.
    BehindText,
    /// A comment, and whether its last byte was a star.
    Comment { star: bool },
    /// A slash that may begin a comment.
    Slash,
    /// An enumeration between points.
    Enumeration,
    /// Binary data between double quotes.
    Binary,
}

struct Scanner {
    line: usize,
    inside: Inside,
    depth: usize,
    word: Vec<u8>,
    /// Whether the statement has begun, and the instance number that it began with.
    begun: bool,
    ended: bool,
}

fn syntax(text: String) -> Diag {
    Diag::input("step-syntax", text)
}

impl Scanner {
    fn new() -> Self {
        Self { line: 1, inside: Inside::Plain, depth: 0, word: Vec::new(), begun: false, ended: false }
    }

    fn byte(&mut self, b: u8, each: &mut dyn FnMut(usize, Instance) -> Result<(), Diag>) -> Result<(), Diag> {
        self.line += usize::from(b == b'\n');
        match self.inside {
            Inside::Plain => self.plain(b)?,
            Inside::Word if b.is_ascii_alphanumeric() || b"_+-.#".contains(&b) => {
                if self.word.len() < WORD {
                    self.word.push(b);
                }
            }
            Inside::Word => {
                self.inside = Inside::Plain;
                self.word(each)?;
                self.plain(b)?;
            }
            Inside::Text(_) if b == b'\'' => self.inside = Inside::BehindText,
            Inside::Text(_) => {}
            // Two quotes are one that belongs to the text.
            Inside::BehindText if b == b'\'' => self.inside = Inside::Text(self.line),
            Inside::BehindText if b.is_ascii_whitespace() => {}
            Inside::BehindText if b",);/".contains(&b) => {
                self.inside = Inside::Plain;
                self.plain(b)?;
            }
            Inside::BehindText => {
                let text = format!("a text is followed by {:?}: a quote is missing in it or before it", char::from(b));
                return Err(syntax(text));
            }
            Inside::Comment { star } => {
                self.inside = if star && b == b'/' { Inside::Plain } else { Inside::Comment { star: b == b'*' } };
            }
            Inside::Slash => {
                self.inside = if b == b'*' { Inside::Comment { star: false } } else { Inside::Plain };
            }
            Inside::Enumeration if b == b'.' => self.inside = Inside::Plain,
            Inside::Enumeration if b.is_ascii_alphanumeric() || b == b'_' => {}
            Inside::Enumeration => {
                self.inside = Inside::Plain;
                self.plain(b)?;
            }
            Inside::Binary => {
                if b == b'"' {
                    self.inside = Inside::Plain;
                }
            }
        }
        Ok(())
    }

    fn plain(&mut self, b: u8) -> Result<(), Diag> {
        match b {
            b'\'' => self.inside = Inside::Text(self.line),
            b'"' => self.inside = Inside::Binary,
            b'/' => self.inside = Inside::Slash,
            b'.' => self.inside = Inside::Enumeration,
            b'(' => {
                self.depth += 1;
                if self.depth > DEEPEST {
                    return Err(syntax(format!("brackets are nested more than {DEEPEST} deep")));
                }
            }
            b')' => match self.depth.checked_sub(1) {
                Some(depth) => self.depth = depth,
                None => return Err(syntax("a bracket is closed that was not opened".into())),
            },
            b';' => {
                if self.depth > 0 {
                    return Err(syntax("a statement ends inside of brackets".into()));
                }
                self.begun = false;
            }
            b if b.is_ascii_alphanumeric() || b"_+-#".contains(&b) => {
                self.inside = Inside::Word;
                self.word.clear();
                self.word.push(b);
            }
            _ => {}
        }
        Ok(())
    }

    /// Takes a word: a reference, a number, or a keyword.
    fn word(&mut self, each: &mut dyn FnMut(usize, Instance) -> Result<(), Diag>) -> Result<(), Diag> {
        let first = !std::mem::replace(&mut self.begun, true);
        let word = std::str::from_utf8(&self.word).unwrap_or_default();
        if first && word == "END-ISO-10303-21" {
            self.ended = true;
        } else if let Some(id) = word.strip_prefix('#') {
            let id = id.parse().map_err(|_| syntax(format!("{word:?} is not a number of an instance")))?;
            each(self.line, if first { Instance::Defined(id) } else { Instance::Named(id) })?;
        } else if word.starts_with(|c: char| c.is_ascii_digit() || c == '+' || c == '-') && self.depth > 0 {
            let finite = word.parse::<f64>().map(f64::is_finite);
            if finite != Ok(true) {
                let text = format!("{word:?} is not a finite number");
                return Err(Diag::input("surface-number", text));
            }
        }
        Ok(())
    }

    fn end(&self) -> Result<(), Diag> {
        if let Inside::Text(line) = self.inside {
            return Err(syntax(format!("the file ends inside of a text that begins at line {line}")));
        }
        if self.ended { Ok(()) } else { Err(syntax("the file is cut short: END-ISO-10303-21 is missing".into())) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn checked(data: &str) -> Result<(), Error> {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("a.step");
        std::fs::write(&path, format!("ISO-10303-21;\nHEADER;\nENDSEC;\nDATA;\n{data}")).expect("written");
        check(&path)
    }

    const END: &str = "ENDSEC;\nEND-ISO-10303-21;\n";

    #[test]
    fn texts_comments_numbers_and_references_of_real_files_are_read() {
        for data in [
            "#1=A('it''s; (','',.T.,$,*,#2);#2 = B ( -1.E-07 , (1,2.,+3.5E+3) ) ;",
            "/* a ( ' comment * / */ #1=(A() B(#1) C(\"0FF\"));\n#20=CARTESIAN_POINT('',(0.,0.,0.)\n );",
            "#1=A('a text\nin two lines' /* c */ );",
            "#1=!OWN('x',.NOT_KNOWN.,AXIS2_PLACEMENT_3D(1.));",
        ] {
            assert_eq!(checked(&format!("{data}\n{END}")), Ok(()), "{data}");
        }
    }

    #[test]
    fn a_utf_8_mark_may_stand_before_the_file() {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("a.step");
        for (head, is_read) in [("\u{feff}", true), ("\u{feff} \n", true), ("\u{feff}\u{feff}", false)] {
            std::fs::write(&path, format!("{head}ISO-10303-21;\nDATA;\n#1=A(1);\n{END}")).expect("written");
            assert_eq!(check(&path).is_ok(), is_read, "{head:?}");
        }
    }

    #[test]
    fn damaged_files_never_panic() {
        const WORDS: &[&str] =
            &["'", "''", "\"", "/*", "*/", "(", ")", ";", "#", "#1", "=", ".T.", "$", "\u{feff}", "END-ISO-10303-21;"];
        let text = format!(
            "ISO-10303-21;\nHEADER;\nENDSEC;\nDATA;\n/* a */#1=A('it''s',.T.,$,*,#20);\n#20=(A(1.E-7,(2,+3.)) B(\"0F\"));\n{END}"
        );
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("a.step");
        crate::surface::mutants::each(&[text.into_bytes()], WORDS, |bytes| {
            std::fs::write(&path, bytes).expect("written");
            let faults = check(&path).err();
            assert!(faults.iter().flat_map(Error::diags).all(|d| !d.hint.is_empty() && d.place != Place::Nowhere));
        });
    }

    #[test]
    fn faults_are_named_with_their_line() {
        let deep = format!("#1=A({});{END}", "(".repeat(300));
        for (data, code, line, say) in [
            ("#1=A(#7);ENDSEC;END-ISO-10303-21;", "step-reference", ":5", "#7 is referred to"),
            ("#1=A(1);\n#1=B(2);ENDSEC;END-ISO-10303-21;", "step-reference", ".step", "#1"),
            ("#1=A('a,'b');\nENDSEC;END-ISO-10303-21;", "step-syntax", ":5", "'b'"),
            ("#1=A(\n1.E999999);", "surface-number", ":6", "1.E999999"),
            ("#1=A(1,-);", "surface-number", ":5", "\"-\""),
            ("#1=A(1;", "step-syntax", ":5", "inside of brackets"),
            ("#1=A(1));", "step-syntax", ":5", "not opened"),
            ("#1=A('a", "step-syntax", ":5", "begins at line 5"),
            ("#1=A(1);\nENDSEC;\n", "step-syntax", ":7", "cut short"),
            ("#x=A(1);", "step-syntax", ":5", "not a number"),
            (deep.as_str(), "step-syntax", ":5", "200 deep"),
        ] {
            let e = checked(data).expect_err(data);
            let d = &e.diags()[0];
            assert_eq!(d.code, code, "{d}");
            assert!(d.place.to_string().ends_with(line) && d.message.contains(say), "{d}");
        }
    }
}
