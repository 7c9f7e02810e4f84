//! The comments of programs: a controller must not act on one, so only the sentences that terrace writes may stand there.
//!
//! LinuxCNC acts on comments by their first word (`MSG`, `PRINT`, `LOGOPEN`, `PROBEOPEN`, `PY`, `ABORT`, ...), GRBL on
//! single bytes wherever they stand (`!`, `~`, `?`, all that is no ASCII), both on a carriage return.

use super::Fault;

/// What begins a further line of a comment that was too long for one.
const FURTHER: &str = "... ";

/// Sentences of stepped programs; `*` stands for names and figures.
const STEPPED: [&str; 15] = [
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
    "PASS #",
];

/// Sentences of on-the-fly programs.
const ON_THE_FLY: [&str; 11] = [
    "terrace: on-the-fly program for LinuxCNC, X Y Z stage and U V scanner, absolute, mm",
    "terrace: on-the-fly program for Power PMAC, axes *, absolute, mm and degrees",
    "machine: \"*\"",
    "# moves, # marks, # s",
    "laser switched up to one servo period of # ms early: # mm/s x period",
    "LASER ERROR # mm",
    "pen #: \"*\", # mm/s, # * at # kHz",
    "digital output 0 is the laser, analogue output 0 its power in percent",
    "corners are rounded by 0.0002 mm at most, times hold where the limits of the axes allow them",
    "M1 is the laser, M2 its power in percent",
    "blending rounds corners of marks by # mm at most",
];

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
    /// Takes a comment that is no statement; what was before it and is no sentence of ours comes back with its line.
    pub(super) fn take(&mut self, comment: &str, line: usize) -> Option<(usize, String)> {
        if let Some(more) = comment.strip_prefix(FURTHER).filter(|_| !self.text.is_empty()) {
            self.text += more;
            return None;
        }
        let before = self.end();
        (self.text, self.line) = (comment.to_owned(), line);
        before
    }

    /// Ends it; what is no sentence of ours comes back with its line.
    pub(super) fn end(&mut self) -> Option<(usize, String)> {
        let text = std::mem::take(&mut self.text);
        let is_known = text.is_empty() || STEPPED.iter().any(|sentence| fits(sentence, &text));
        (!is_known).then_some((self.line, text))
    }
}

/// Whether a comment of an on-the-fly program is a sentence of ours, maybe cut.
pub(super) fn is_on_the_fly(comment: &str) -> bool {
    const LAST: &str = "not a safety system: the laser needs its own interlock";
    let is_cut = |sentence: &str| comment.len() >= CUT && fits_beginning(sentence, comment);
    ON_THE_FLY.iter().chain([&LAST]).any(|sentence| fits(sentence, comment) || is_cut(sentence))
}

/// Whether a controller could act on a byte of a name.
fn is_quiet(c: char) -> bool {
    matches!(c, ' '..='~') && !"();%!~?".contains(c)
}

/// Whether a text is a sentence. Blanks do not count: a comment is cut at one or within a word.
fn fits(sentence: &str, text: &str) -> bool {
    let [sentence, text] = [sentence, text].map(|t| t.bytes().filter(|c| *c != b' ').collect::<Vec<u8>>());
    matches(&sentence, &text, false)
}

/// Whether a text is what a sentence begins with.
fn fits_beginning(sentence: &str, text: &str) -> bool {
    let [sentence, text] = [sentence, text].map(|t| t.bytes().filter(|c| *c != b' ').collect::<Vec<u8>>());
    matches(&sentence, &text, true)
}

/// Compares with a sentence in which `#` stands for a decimal and `*` for any quiet text.
fn matches(sentence: &[u8], text: &[u8], is_cut: bool) -> bool {
    match (sentence.split_first(), text.split_first()) {
        (None, None) => true,
        (_, None) => is_cut,
        (None, Some(_)) => false,
        (Some((b'#', rest)), Some(_)) => {
            let digits = text.iter().take_while(|c| c.is_ascii_digit() || **c == b'.').count();
            digits > 0 && matches(rest, &text[digits..], is_cut)
        }
        (Some((b'*', rest)), Some(_)) => {
            let quiet = text.iter().take_while(|&&c| is_quiet(char::from(c))).count();
            (0..=quiet).rev().any(|n| matches(rest, &text[n..], is_cut))
        }
        (Some((a, rest)), Some((b, more))) => a == b && matches(rest, more, is_cut),
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
            &["output off before every move and at the end, a wait that", "... times out ends the program", "PASS 2"],
            &[
                "machine: \"aaaaaaaaaaaaaaaaaaaaa",
                "... aaaaaa\"",
                "not a safety system: the laser needs its own interlock",
            ],
        ] {
            assert_eq!(known(lines), [], "{lines:?}");
        }
        for lines in
            [&["LOGOPEN,f"][..], &["machine: \"x\"", "... LOGOPEN,f"], &["... machine: \"x\""], &["PASS x"], &["x"]]
        {
            assert_eq!(known(lines).len(), 1, "{lines:?}");
        }
        assert_eq!(known(&["abort, x", "PASS 1", "PRINT,1"]).len(), 2);
        assert!(!is_on_the_fly("pen 1: \"fine, (?)\", 800 mm/s, 50 percent at 60 kHz"));
        assert!(is_on_the_fly("pen 1: \"fine\", 800 mm/s, 50 percent at 60 kHz"));
        assert!(is_on_the_fly("pen 1: \"fine\", 800 mm/s, 50 perc"), "cut");
        assert!(!is_on_the_fly("pen 1: \"f"), "cut too short");
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
