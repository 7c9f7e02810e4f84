//! Reader of the program of a touch probe, LinuxCNC's and GRBL's.
//!
//! Consumes the text; promises one [`ProbeStep`] per line that does something, with its line. What it does not know is
//! [`ProbeStep::Unknown`]: nothing is skipped that might move an axis.

use super::Fault;
use super::comments;
use super::gcode::{AxisWords, moved_to, o_word, split_comments, words};

/// What a line does.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum ProbeStep {
    /// A rapid move to the axis values given.
    Rapid(AxisWords),
    /// A touch (G38.2): down to a position of z, nm, at a speed, mm/min.
    Touch(i64, f64),
    /// Modes, outputs off, offsets off or tested, the log opened or closed.
    Nothing,
    /// A test that ends the program: from here to its end nothing is done where it does not hold.
    Test,
    /// The end of a test.
    TestEnd,
    /// M2.
    End,
    /// Anything else.
    Unknown(String),
}

/// Reads the program of a touch probe.
pub(crate) fn read(bytes: &[u8]) -> Result<Vec<(usize, ProbeStep)>, Fault> {
    let text = comments::printable(bytes)?;
    let mut steps = Vec::new();
    for (line, text) in (1..).zip(text.lines()) {
        let (code, comments) = split_comments(text).map_err(|message| Fault::new(line, message))?;
        for comment in comments {
            let first = comment.split([' ', ',']).next().unwrap_or_default();
            let acts = ["LOGOPEN", "LOGAPPEND", "PY", "ABORT", "PRINT", "LOG", "DEBUG", "PROBEOPEN", "PROBECLOSE"];
            let is_ours = comment == "PROBEOPEN probe.log" || comment == "PROBECLOSE";
            if acts.contains(&first) && !is_ours {
                steps.push((line, ProbeStep::Unknown(format!("({comment})"))));
            }
        }
        let code = code.trim();
        if !code.is_empty() {
            steps.push((line, step(code).unwrap_or_else(|| ProbeStep::Unknown(code.to_owned()))));
        }
    }
    Ok(steps)
}

/// Modal words that a probe program may have, in its preamble.
const MODES: [&str; 3] = ["G21 G90 G94 G17 G40 G49 G80 G61.1 G54", "G21 G90 G94 G17 G40 G80 G54", "G49"];

fn step(code: &str) -> Option<ProbeStep> {
    if code.starts_with('o') {
        return match o_word(code)? {
            super::gcode::StageStep::IfOffset(..) => Some(ProbeStep::Test),
            super::gcode::StageStep::EndIf(_) => Some(ProbeStep::TestEnd),
            _ => None,
        };
    }
    if MODES.contains(&code) || ["G92.1", "M5", "M65 P0"].contains(&code) {
        return Some(ProbeStep::Nothing);
    }
    let words = words(code)?;
    match words.as_slice() {
        [('M', "2")] => Some(ProbeStep::End),
        [('G', "0"), rest @ ..] if !rest.is_empty() => moved_to(rest).map(ProbeStep::Rapid),
        [('G', "38.2"), z @ ('Z', _), ('F', feed)] => {
            let [_, _, z, ..] = moved_to(&[*z])?;
            Some(ProbeStep::Touch(z?, feed.parse().ok().filter(|feed: &f64| *feed > 0.0 && feed.is_finite())?))
        }
        _ => None,
    }
}
