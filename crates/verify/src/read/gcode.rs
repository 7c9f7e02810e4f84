//! Reader of the stage programs: LinuxCNC with its handshake, and the plain M0 variant.
//!
//! Consumes the text; promises one [`Statement`] per thing that the controller does, in order, with
//! its line. Coordinates are exact nanometres. What it does not know becomes [`StageStep::Unknown`], so that
//! the laser rule can refuse it: nothing is skipped that might move an axis or switch an output.

use super::Fault;
use super::comments::{self, Sentence};
use super::number::nm_from_decimal;
use terrace_core::geom::Nm;

/// Axis values of a move: x, y and z in nm, a, b and c in millionths of a degree; None of an axis that is not named.
pub(crate) type AxisWords = [Option<i64>; 6];

/// A thing that a stage program does or states.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum StageStep {
    /// The comment that begins a block, with the block's name and the file that is marked there, if it names one.
    Block(String, Option<String>),
    /// The comment that begins a set-up, with its number.
    Setup(u32),
    /// The comment that begins a stop at a registration point, with its number in the set-up.
    Registration(usize),
    /// The comment that begins a pass, with its number.
    Pass(u32),
    /// The comment that states the shift of the zoom optic, nm.
    FocusShift(i64),
    /// The comment that states the z to lift to first where the program is begun here, nm.
    EntryLift(i64),
    /// The comment that states axis values to go to after that, as those of a move.
    EntryGo(AxisWords),
    /// Modal G words, in tenths: G61.1 is 611.
    Modal(Vec<u32>),
    /// A rapid move to the axis values given.
    Move(AxisWords),
    /// A wait, s.
    Dwell(f64),
    /// M64 P0: START on.
    OutputOn,
    /// M65 P0: START off, at once.
    OutputOff,
    /// M66 P0: waits for BUSY, high or low, for at most this many seconds.
    Wait { high: bool, seconds: f64 },
    /// An `if` that asks whether the last wait ran out of time, with its o-number.
    IfTimeout(u32),
    /// An `if` that asks whether a parameter is not 0, with its o-number: whether an offset is active.
    IfOffset(u32, u32),
    /// The end of a condition.
    EndIf(u32),
    /// M0: waits for the operator.
    Pause,
    /// M5: laser (spindle) off.
    SpindleOff,
    /// M2 or M30.
    End,
    /// Anything else.
    Unknown(String),
}

impl StageStep {
    /// Whether it may stand between the title of a block and its moves.
    pub(crate) fn is_before_moves(&self) -> bool {
        matches!(self, Self::OutputOff | Self::SpindleOff | Self::Modal(_) | Self::FocusShift(_)) || self.is_entry()
    }
    /// Whether it states what comes first where the program is begun at a block.
    pub(crate) fn is_entry(&self) -> bool {
        matches!(self, Self::EntryLift(_) | Self::EntryGo(_))
    }
    /// The focus shift that it states, if it is such a comment.
    pub(crate) fn focus_shift(&self) -> Option<Nm> {
        if let Self::FocusShift(nm) = self { Some(Nm(*nm)) } else { None }
    }
}

/// A step and its line, from 1.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Statement {
    /// Line, from 1.
    pub(crate) line: usize,
    /// The step.
    pub(crate) step: StageStep,
}

/// A stage program.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct StageProgram {
    /// Its steps, in order.
    pub(crate) statements: Vec<Statement>,
    /// Blocks that comments name in addition to those that begin a block, each with its line.
    pub(crate) names: Vec<(usize, String)>,
    /// Numbers of lines (N words), each with its line.
    pub(crate) numbers: Vec<(usize, u64)>,
}

/// Reads a stage program.
pub(crate) fn read(bytes: &[u8]) -> Result<StageProgram, Fault> {
    let text = comments::printable(bytes)?;
    let mut reader = Reader::default();
    for (i, line) in text.lines().enumerate() {
        reader.line(i + 1, line)?;
    }
    let last = reader.sentence.end();
    reader.unknown(last);
    Ok(StageProgram { statements: reader.statements, names: reader.names, numbers: reader.numbers })
}

#[derive(Default)]
struct Reader {
    statements: Vec<Statement>,
    names: Vec<(usize, String)>,
    numbers: Vec<(usize, u64)>,
    sentence: Sentence,
    /// The message that the next stop must have: its set-up or registration point.
    stop: String,
}

impl Reader {
    fn line(&mut self, line: usize, text: &str) -> Result<(), Fault> {
        let (code, comments) = split_comments(text).map_err(|m| Fault::new(line, m))?;
        for comment in comments {
            match statement(comment) {
                Some(step) => {
                    match &step {
                        StageStep::Setup(_) => {
                            self.stop = comment.replace("SETUP ", "MSG, set-up ").replace(" OF ", " of ")
                        }
                        StageStep::Registration(_) => {
                            self.stop = comment.replace("REGISTRATION ", "MSG, registration point ")
                        }
                        _ => {}
                    }
                    self.push(line, step);
                }
                None if comment == self.stop => {
                    let before = self.sentence.end();
                    self.unknown(before);
                }
                None => match named_block(comment) {
                    Some(block) => {
                        let before = self.sentence.end();
                        self.unknown(before);
                        self.names.extend((!block.is_empty()).then(|| (line, block.to_owned())));
                    }
                    None => {
                        let before = self.sentence.take(comment, line);
                        self.unknown(before);
                    }
                },
            }
        }
        let (number, code) = numbered(code.trim());
        self.numbers.extend(number.map(|n| (line, n)));
        if !code.is_empty() {
            self.push(line, step(code).unwrap_or_else(|| StageStep::Unknown(code.to_owned())));
        }
        Ok(())
    }

    fn push(&mut self, line: usize, step: StageStep) {
        let before = self.sentence.end();
        self.unknown(before);
        self.statements.push(Statement { line, step });
    }

    /// A comment that is not a sentence of ours.
    fn unknown(&mut self, found: Option<(usize, String)>) {
        if let Some((line, text)) = found {
            self.statements.push(Statement { line, step: StageStep::Unknown(format!("({text})")) });
        }
    }
}

/// The step that a comment states, if it states one.
fn statement(comment: &str) -> Option<StageStep> {
    let unknown = || StageStep::Unknown(format!("({comment})"));
    if let Some(rest) = comment.strip_prefix("BLOCK ") {
        let (id, file) = match rest.split_once(" FILE ") {
            Some((id, file)) => (id, Some(file.to_owned())),
            None => (rest, None),
        };
        Some(if is_block(id) { StageStep::Block(id.to_owned(), file) } else { unknown() })
    } else if let Some(rest) = comment.strip_prefix("SETUP ") {
        let numbers =
            rest.split_once(" OF ").and_then(|(n, count)| Some((n.parse().ok()?, count.parse::<u32>().ok()?)));
        Some(numbers.map_or_else(unknown, |(number, _)| StageStep::Setup(number)))
    } else if let Some(rest) = comment.strip_prefix("REGISTRATION ") {
        Some(rest.parse().map_or_else(|_| unknown(), StageStep::Registration))
    } else if let Some(rest) = comment.strip_prefix("PASS ") {
        Some(rest.parse().map_or_else(|_| unknown(), StageStep::Pass))
    } else if let Some(rest) = comment.strip_prefix("FOCUS SHIFT ") {
        Some(nm_from_decimal(rest.as_bytes()).map_or_else(unknown, StageStep::FocusShift))
    } else if let Some(rest) = comment.strip_prefix("ENTRY GO ") {
        Some(axis_values(rest).map_or_else(unknown, StageStep::EntryGo))
    } else {
        let rest = comment.strip_prefix("ENTRY LIFT Z")?;
        Some(nm_from_decimal(rest.as_bytes()).map_or_else(unknown, StageStep::EntryLift))
    }
}

/// Words of axes, each at most once.
fn axis_values(text: &str) -> Option<AxisWords> {
    let mut to = [None; 6];
    for word in text.split(' ') {
        let axis = "XYZABC".find(word.chars().next()?)?;
        let value = nm_from_decimal(&word.as_bytes()[1..])?;
        if to[axis].replace(value).is_some() {
            return None;
        }
    }
    Some(to)
}

/// Offsets that a message speaks of.
const OFFSETS: [&str; 8] = [
    "G92 is active",
    "G54 is rotated",
    "G54 has an offset in X",
    "G54 has an offset in Y",
    "G54 has an offset in Z",
    "G54 has an offset in A",
    "G54 has an offset in B",
    "G54 has an offset in C",
];

/// The block that a comment names for the operator: in a message or at a stop. Of messages about offsets, nothing.
fn named_block(comment: &str) -> Option<&str> {
    const NAMING: [&str; 5] =
        ["MSG, BUSY before START, block ", "MSG, no BUSY, block ", "MSG, still BUSY, block ", "mark ", "frame "];
    let named = NAMING.iter().find_map(|words| comment.strip_prefix(words)).filter(|id| is_block(id));
    if OFFSETS.iter().any(|words| comment.strip_prefix("MSG, ") == Some(words)) {
        return Some("");
    }
    named
}

/// The number of a line, and its code after it.
fn numbered(code: &str) -> (Option<u64>, &str) {
    let Some(rest) = code.strip_prefix(['N', 'n']) else { return (None, code) };
    let end = rest.find(|c: char| !c.is_ascii_digit()).unwrap_or(rest.len());
    rest[..end].parse().map_or((None, code), |number| (Some(number), rest[end..].trim_start()))
}

/// Whether a word is the name of a block: B and four digits or more.
fn is_block(word: &str) -> bool {
    word.strip_prefix('B').is_some_and(|n| n.len() >= 4 && n.bytes().all(|c| c.is_ascii_digit()))
}

/// The code of a line without its comments, and the comments.
pub(super) fn split_comments(line: &str) -> Result<(String, Vec<&str>), &'static str> {
    let (mut code, mut comments, mut rest) = (String::new(), Vec::new(), line);
    while let Some(at) = rest.find(['(', ';']) {
        code.push_str(&rest[..at]);
        if rest[at..].starts_with(';') {
            return Err("a comment begins with ;");
        }
        let Some(end) = rest[at..].find(')') else { return Err("a comment does not end") };
        comments.push(&rest[at + 1..at + end]);
        rest = &rest[at + end + 1..];
    }
    code.push_str(rest);
    Ok((code, comments))
}

fn step(code: &str) -> Option<StageStep> {
    if code.starts_with(['o', 'O']) {
        return o_word(code);
    }
    let words = words(code)?;
    let &[(letter, number), ref rest @ ..] = words.as_slice() else { return None };
    let rest: &[(char, &str)] = rest;
    match (letter, number, rest) {
        ('G', "4" | "04", [('P', seconds)]) => Some(StageStep::Dwell(positive(seconds)?)),
        ('G', "0" | "00", [_, ..]) => moved_to(rest).map(StageStep::Move),
        ('G', ..) if words.iter().all(|w| w.0 == 'G') => {
            Some(StageStep::Modal(words.iter().map(|w| tenths(w.1)).collect::<Option<_>>()?))
        }
        ('M', "64", [('P', "0")]) => Some(StageStep::OutputOn),
        ('M', "65", [('P', "0")]) => Some(StageStep::OutputOff),
        ('M', "66", [('P', "0"), ('L', level @ ("3" | "4")), ('Q', seconds)]) => {
            Some(StageStep::Wait { high: *level == "3", seconds: positive(seconds)? })
        }
        ('M', "0" | "00", []) => Some(StageStep::Pause),
        ('M', "5" | "05", []) => Some(StageStep::SpindleOff),
        ('M', "2" | "02" | "30", []) => Some(StageStep::End),
        _ => None,
    }
}

/// The axis values of words, each axis at most once.
pub(super) fn moved_to(words: &[(char, &str)]) -> Option<AxisWords> {
    let mut to = [None; 6];
    for (letter, number) in words {
        let axis = "XYZABC".find(*letter)?;
        if to[axis].is_some() {
            return None;
        }
        to[axis] = Some(nm_from_decimal(number.as_bytes())?);
    }
    Some(to)
}

/// `o101 if [#5399 LT 0]`, `o101 if [#5210 NE 0]` or `o101 endif`; other conditions are unknown.
pub(super) fn o_word(code: &str) -> Option<StageStep> {
    let code = code[1..].trim_start();
    let digits = code.find(|c: char| !c.is_ascii_digit())?;
    let label: u32 = code[..digits].parse().ok()?;
    let rest: String = code[digits..].split_whitespace().collect::<String>().to_ascii_uppercase();
    match rest.as_str() {
        "IF[#5399LT0]" => Some(StageStep::IfTimeout(label)),
        "ENDIF" => Some(StageStep::EndIf(label)),
        other => {
            let parameter = other.strip_prefix("IF[#")?.strip_suffix("NE0]")?;
            let is_plain = parameter.bytes().all(|c| c.is_ascii_digit());
            Some(StageStep::IfOffset(label, parameter.parse().ok().filter(|_| is_plain)?))
        }
    }
}

/// Letters and the numbers after them; letters in upper case.
pub(super) fn words(code: &str) -> Option<Vec<(char, &str)>> {
    let mut out = Vec::new();
    let mut rest = code.trim();
    while let Some(letter) = rest.chars().next() {
        if !letter.is_ascii_alphabetic() {
            return None;
        }
        let number = rest[1..].trim_start();
        let end = number.find(|c: char| !(c.is_ascii_digit() || matches!(c, '.' | '-' | '+'))).unwrap_or(number.len());
        if end == 0 {
            return None;
        }
        out.push((letter.to_ascii_uppercase(), &number[..end]));
        rest = number[end..].trim_start();
    }
    Some(out)
}

fn positive(number: &str) -> Option<f64> {
    number.parse().ok().filter(|s: &f64| s.is_finite() && *s >= 0.0)
}

fn tenths(number: &str) -> Option<u32> {
    let (whole, tenth) = number.split_once('.').unwrap_or((number, "0"));
    let tenth: u32 = if tenth.len() == 1 { tenth.parse().ok()? } else { return None };
    whole.parse::<u32>().ok()?.checked_mul(10)?.checked_add(tenth)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn steps(text: &str) -> Vec<StageStep> {
        read(text.as_bytes()).expect("text").statements.into_iter().map(|s| s.step).collect()
    }

    #[test]
    fn the_handshake_is_read_step_by_step() {
        let text = "(PASS 1)\nG21 G90 G61.1\nM65 P0\n(BLOCK B0001 FILE x.dxf)\nG0 Z5\ng0 x10 Y-20.000001 B-1.5\nG4 P0.1\n\
            M64 P0\nM66 P0 L3 Q5\no101 if [#5399 LT 0]\n(MSG, no BUSY, block B0002)\nM2\no101 endif\nM30\n";
        let expected = [
            StageStep::Pass(1),
            StageStep::Modal(vec![210, 900, 611]),
            StageStep::OutputOff,
            StageStep::Block("B0001".into(), Some("x.dxf".into())),
            StageStep::Move([None, None, Some(5_000_000), None, None, None]),
            StageStep::Move([Some(10_000_000), Some(-20_000_001), None, None, Some(-1_500_000), None]),
            StageStep::Dwell(0.1),
            StageStep::OutputOn,
            StageStep::Wait { high: true, seconds: 5.0 },
            StageStep::IfTimeout(101),
            StageStep::End,
            StageStep::EndIf(101),
            StageStep::End,
        ];
        assert_eq!(steps(text), expected);
        let read = read(text.as_bytes()).expect("text");
        assert_eq!((read.statements[3].line, read.names), (4, vec![(11, "B0002".to_owned())]));
    }

    #[test]
    fn a_set_up_is_read_by_its_number() {
        assert_eq!(steps("(SETUP 2 OF 3)\nM0\n"), [StageStep::Setup(2), StageStep::Pause]);
        assert_eq!(steps("(SETUP two)\n"), [StageStep::Unknown("(SETUP two)".into())]);
    }

    #[test]
    fn unknown_words_are_a_fault() {
        for line in [
            "M62 P0",
            "G1 X5 F100",
            "G0 X1e3",
            "G0 X0.0000001",
            "M64 P1",
            "M66 P0 L3",
            "o1 while [1]",
            "X5",
            "%",
            "/G0 X5",
            "(LOGOPEN,f)",
            "(abort, x)",
            "(BLOCK 7)",
            "(FOCUS SHIFT x)",
            "(mark it)",
            "(MSG, no BUSY, block 7)",
            "(PASS one)",
        ] {
            assert_eq!(steps(&format!("{line}\n")), [StageStep::Unknown(line.into())], "{line}");
        }
        assert!(read(b"G0 X5").is_err(), "a cut line");
        assert!(read(b"(open\n").is_err());
        assert!(read(b"G0 X5 ; lift\n").is_err() && read(b"(\r)\n").is_err() && read("é\n".as_bytes()).is_err());
        assert!(read(b"\xff\n").is_err());
    }
}
