//! Reader of `fly.pmc`.

use super::{AXES, FlyProgram, Runner, axis, scaled};
use crate::read::Fault;
use crate::read::comments::printable;
use crate::read::number::{millionths, nm_from_decimal};

#[derive(Default)]
struct Modes {
    open: bool,
    absolute: bool,
    linear: bool,
    closed: bool,
    /// Axes that moves of this program name, as bits.
    known: u8,
}

/// Reads a program of the axes named by `letters`.
pub(crate) fn read(bytes: &[u8], letters: &str) -> Result<FlyProgram, Fault> {
    let text = printable(bytes)?;
    let mut run = Runner::default();
    let known = letters.chars().filter_map(axis).fold(0, |bits, k| bits | 1 << k);
    let mut modes = Modes { known, ..Modes::default() };
    for (i, line) in text.lines().enumerate() {
        run.line = i + 1;
        if let Some(comment) = line.strip_prefix("// ") {
            run.comment(comment);
        } else if !line.is_empty() {
            if modes.closed {
                run.fault("a statement after the end");
            } else if statement(line, &mut run, &mut modes).is_none() {
                run.fault(format!("{line:?} is not known"));
            }
        }
    }
    Ok(run.finish(modes.closed))
}

/// Does what a line asks for; None where it is not known. `==` acts with the next move, `=` at once.
fn statement(line: &str, run: &mut Runner, modes: &mut Modes) -> Option<()> {
    if line == "open prog 1" && !modes.open {
        modes.open = true;
        return Some(());
    }
    if !modes.open {
        return None;
    }
    let percent = |text: &str| text.parse().ok().filter(|p: &f64| (0.0..=100.0).contains(p));
    match line {
        "close" => modes.closed = true,
        "abs" => modes.absolute = true,
        "M1=0" => run.off(),
        "M1==0" => run.waiting = Some(false),
        "M1==1" => run.waiting = Some(true),
        "M2=0" => run.no_power(),
        _ => {
            if let Some(power) = line.strip_prefix("M2==") {
                run.power = Some(percent(power)?);
            } else if let Some(ms) = line.strip_prefix("dwell") {
                run.rest(scaled(ms, 3)?, true);
            } else if let Some(rest) = line.strip_prefix("rapid") {
                if !modes.absolute {
                    run.fault("a move before abs");
                }
                (modes.linear, run.timed) = (false, false);
                run.rapid(places(rest, modes)?);
            } else if let Some(times) = line.strip_prefix("linear TA") {
                let (blend, curve) = times.split_once(" TS")?;
                run.program.blend_us = scaled(blend, 3)?;
                if scaled(curve, 3)? != 0 {
                    return None;
                }
                (modes.linear, run.timed) = (true, true);
            } else {
                let (time, rest) = line.strip_prefix("TM")?.split_once(' ')?;
                let us = scaled(time, 3)?;
                if !modes.linear || !modes.absolute {
                    run.fault("a timed move before abs and linear");
                }
                if us < run.program.blend_us {
                    run.fault("a move shorter than TA, which would take longer");
                }
                run.step(us, places(rest, modes)?, modes.known);
            }
        }
    }
    Some(())
}

/// Where words send the axes.
fn places(words: &str, modes: &Modes) -> Option<[Option<i64>; AXES]> {
    let mut to = [None; AXES];
    for word in words.split_whitespace() {
        let k = axis(word.chars().next()?).filter(|k| modes.known >> k & 1 == 1)?;
        let number = &word.as_bytes()[1..];
        // Angles have no end.
        let value = if matches!(k, 3 | 4) { millionths(number) } else { nm_from_decimal(number) };
        if to[k].replace(value?).is_some() {
            return None;
        }
    }
    to.iter().any(Option::is_some).then_some(to)
}
