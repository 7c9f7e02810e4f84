//! The comments of programs: a controller must not act on one, so only the sentences that terrace writes may stand
//! there.
//!
//! LinuxCNC acts on comments by their first word (`MSG`, `PRINT`, `LOGOPEN`, `PROBEOPEN`, `PY`, `ABORT`, ...), GRBL on
//! single bytes wherever they stand (`!`, `~`, `?`, all that is no ASCII), both on a carriage return.

use super::Fault;

/// The beginning of a further line of a comment that was too long for one.
const FURTHER: &str = "... ";

/// Sentences of stepped programs; `*` stands for names and figures.
const STEPPED: [&str; 14] = [
    "terrace: stage program for LinuxCNC, absolute, mm",
    "terrace: stage program with stops, absolute, mm, dwell in s",
    "terrace: registration points and frames of the outline, absolute, mm",
    "machine: \"*\"",
    "positions are machine positions: any offset of G54, G92 or rotation ends the program",
    "positions are from the zero of G54, which must be the zero of the table frame",
    "digital output 0 is START to the scan card, digital input 0 is its BUSY",
    "BUSY is high while the card marks: an inverted one ends the program at the first block",
    "BUSY must rise within 5 s of START and stay high for 20 ms or more, until the laser is off",
    "output off before every move and at the end, a wait that times out ends the program",
    "at every M0 mark the block named, wait for its end, then press cycle start",
    "at every M0 show the frame named with the pilot laser, then press cycle start",
    "at registration points the head is lifted: the spot is large, judge its centre",
    "not a safety system: the laser needs its own interlock",
];

/// Sentences of on-the-fly programs, with what their figures are.
const ON_THE_FLY: [(&str, CommentKind); 12] = [
    ("terrace: on-the-fly program for LinuxCNC, X Y Z stage and U V scanner, absolute, mm", CommentKind::Words),
    ("terrace: on-the-fly program for Power PMAC, axes *, absolute, mm and degrees", CommentKind::Words),
    ("machine: \"*\"", CommentKind::Words),
    ("# moves, # marks, # s", CommentKind::Size),
    ("laser switched up to one servo period of # ms early: # mm/s x period", CommentKind::Switch),
    ("LASER ERROR # mm", CommentKind::LaserError),
    ("pen #: \"*\", # mm/s, # * at # kHz", CommentKind::Pen),
    ("digital output 0 is the laser, analogue output 0 its power in percent", CommentKind::Words),
    (
        "corners are rounded by 0.0002 mm at most, times hold where the limits of the axes allow them",
        CommentKind::Words,
    ),
    ("M1 is the laser, M2 its power in percent", CommentKind::Words),
    ("blending rounds corners of marks by # mm at most", CommentKind::Blend),
    ("not a safety system: the laser needs its own interlock", CommentKind::Words),
];

/// The figures of a sentence of an on-the-fly program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum CommentKind {
    /// A comment without a value.
    Words,
    /// Moves, marks, time in s.
    Size,
    /// Servo period in ms, speed in mm/s.
    Switch,
    /// How early the laser is switched, mm.
    LaserError,
    /// Number, speed in mm/s, power in its unit, frequency in kHz.
    Pen,
    /// How far corners are rounded, mm.
    Blend,
}

/// Least length of a sentence that was cut to the longest line of its controller.
const CUT: usize = 24;

/// The text of a program: printable ASCII in whole lines. The faulty line otherwise.
pub(super) fn printable(bytes: &[u8]) -> Result<&str, Fault> {
    let line = |at: usize| bytes[..at].iter().filter(|&&c| c == b'\n').count() + 1;
    if let Some(at) = bytes.iter().position(|c| !matches!(c, b' '..=b'~' | b'\n')) {
        return Err(Fault::new(line(at), format!("holds the byte {:#04x}: programs are printable ASCII", bytes[at])));
    }
    if bytes.last() != Some(&b'\n') {
        return Err(Fault::new(line(bytes.len()), "ends in the middle of a line"));
    }
    std::str::from_utf8(bytes).map_err(|_| Fault::new(0, "the file is not text"))
}

/// The sentence of a stepped program that goes over several comments.
#[derive(Default)]
pub(super) struct Sentence {
    text: String,
    line: usize,
}

impl Sentence {
    /// Takes a comment that is not a statement; what was before it and is not a sentence of ours comes back with its
    /// line.
    pub(super) fn take(&mut self, comment: &str, line: usize) -> Option<(usize, String)> {
        if let Some(more) = comment.strip_prefix(FURTHER).filter(|_| !self.text.is_empty()) {
            self.text += more;
            return None;
        }
        let before = self.end();
        (self.text, self.line) = (comment.to_owned(), line);
        before
    }

    /// Ends it; what is not a sentence of ours comes back with its line.
    pub(super) fn end(&mut self) -> Option<(usize, String)> {
        let text = std::mem::take(&mut self.text);
        let is_known = text.is_empty() || STEPPED.iter().any(|sentence| fits(sentence, &text));
        (!is_known).then_some((self.line, text))
    }
}

/// The kind of a comment of an on-the-fly program, maybe cut, with its figures as they stand there; None where it is no
/// sentence of ours.
pub(super) fn on_the_fly(comment: &str) -> Option<(CommentKind, Vec<String>)> {
    let is_long = comment.len() >= CUT;
    ON_THE_FLY.iter().find_map(|(sentence, kind)| {
        let mut figures = Vec::new();
        let fits = fits_with(sentence, comment, false, &mut figures)
            || is_long && fits_with(sentence, comment, true, &mut figures);
        // The last one may be cut.
        if sentence.ends_with(|c| !comment.ends_with(c)) && comment.ends_with(|c: char| c.is_ascii_digit() || c == '.')
        {
            figures.pop();
        }
        fits.then_some((*kind, figures))
    })
}

/// Whether a controller could act on a byte of a name.
fn is_quiet(c: char) -> bool {
    matches!(c, ' '..='~') && !"();%!~?".contains(c)
}

/// Whether a text is a sentence. Blanks do not count: a comment is cut at one or within a word.
fn fits(sentence: &str, text: &str) -> bool {
    fits_with(sentence, text, false, &mut Vec::new())
}

/// The same, or what a sentence begins with where the text is cut; adds its figures.
fn fits_with(sentence: &str, text: &str, is_cut: bool, figures: &mut Vec<String>) -> bool {
    let [sentence, text] = [sentence, text].map(|t| t.bytes().filter(|c| *c != b' ').collect::<Vec<u8>>());
    figures.clear();
    matches(&sentence, &text, is_cut, figures)
}

/// Compares with a sentence in which `#` stands for a decimal and `*` for any quiet text without quotes.
fn matches(sentence: &[u8], text: &[u8], is_cut: bool, figures: &mut Vec<String>) -> bool {
    match (sentence.split_first(), text.split_first()) {
        (None, None) => true,
        (_, None) => is_cut,
        (None, Some(_)) => false,
        (Some((b'#', rest)), Some(_)) => {
            let digits = text.iter().take_while(|c| c.is_ascii_digit() || **c == b'.').count();
            let (figure, more) = text.split_at(digits);
            figures.push(String::from_utf8_lossy(figure).into_owned());
            let fits = digits > 0 && matches(rest, more, is_cut, figures);
            if !fits {
                figures.pop();
            }
            fits
        }
        (Some((b'*', rest)), Some(_)) => {
            let quiet = text.iter().take_while(|&&c| c != b'"' && is_quiet(char::from(c))).count();
            (0..=quiet).any(|n| matches(rest, &text[n..], is_cut, figures))
        }
        (Some((a, rest)), Some((b, more))) => a == b && matches(rest, more, is_cut, figures),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_sentences_of_ours_are_known() {
        let known = |lines: &[&str]| {
            let mut sentence = Sentence::default();
            let before: Vec<_> = lines.iter().enumerate().filter_map(|(i, line)| sentence.take(line, i + 1)).collect();
            before.into_iter().chain(sentence.end()).collect::<Vec<_>>()
        };
        assert_eq!(known(&["machine: \"a mill (1)\""]), [(1, "machine: \"a mill (1)\"".to_owned())]);
        for lines in [
            &["machine: \"a mill, 1\""][..],
            &["output off before every move and at the end, a wait that", "... times out ends the program"],
            &[
                "machine: \"aaaaaaaaaaaaaaaaaaaaa",
                "... aaaaaa\"",
                "not a safety system: the laser needs its own interlock",
            ],
        ] {
            assert_eq!(known(lines), [], "{lines:?}");
        }
        for lines in [&["LOGOPEN,f"][..], &["machine: \"x\"", "... LOGOPEN,f"], &["... machine: \"x\""], &["x"]] {
            assert_eq!(known(lines).len(), 1, "{lines:?}");
        }
        assert_eq!(known(&["abort, x", "PRINT,1"]).len(), 2);
        assert_eq!(on_the_fly("pen 1: \"fine, (?)\", 800 mm/s, 50 percent at 60 kHz"), None);
        assert_eq!(on_the_fly("pen 1: \"f"), None, "cut too short");
        for (text, kind, figures) in [
            ("pen 1: \"fine\", 800 mm/s, 50 percent at 60 kHz", CommentKind::Pen, &["1", "800", "50", "60"][..]),
            ("pen 1: \"pen 2: , 3 mm/s\", 800 mm/s, 50 W at 60 kHz", CommentKind::Pen, &["1", "800", "50", "60"]),
            ("pen 1: \"fine\", 800 mm/s, 50 perc", CommentKind::Pen, &["1", "800", "50"]),
            ("pen 1: \"fine fine\", 800 mm/s, 50 percent at 6", CommentKind::Pen, &["1", "800", "50"]),
            ("12 moves, 3 marks, 1.250 s", CommentKind::Size, &["12", "3", "1.250"]),
            ("LASER ERROR 0.388047 mm", CommentKind::LaserError, &["0.388047"]),
            ("M1 is the laser, M2 its power in percent", CommentKind::Words, &[]),
        ] {
            assert_eq!(on_the_fly(text), Some((kind, figures.iter().map(|f| (*f).to_owned()).collect())), "{text}");
        }
    }

    #[test]
    fn programs_are_printable_ascii_in_whole_lines() {
        assert_eq!(printable(b"G0 X1\n(a)\n"), Ok("G0 X1\n(a)\n"));
        for (bytes, line) in [
            (&b"G0\n(x\rG0 Z-50)\n"[..], 2),
            (b"G0\n\n\x18\n", 3),
            (b"G0\tX1\n", 1),
            (b"(\xc2\xa0)\n", 1),
            (b"G0\nG1", 2),
            (b"", 1),
        ] {
            assert_eq!(printable(bytes).expect_err("a fault").line, line, "{bytes:?}");
        }
    }
}
