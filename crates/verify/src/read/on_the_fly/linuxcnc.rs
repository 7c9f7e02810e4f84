//! Reader of `fly.ngc`.

use super::{AXES, FlyProgram, Runner, axis, scaled};
use crate::read::Fault;
use crate::read::comments::printable;
use crate::read::gcode::{split_comments, words};
use crate::read::number::nm_from_decimal;

/// X Y Z U V, as bits.
const KNOWN: u8 = 0b110_0111;
/// How near, us, the time of a line must be to a whole one.
const WHOLE: f64 = 0.35;

/// Modes that a program has set.
#[derive(Default)]
struct Modes {
    metric: bool,
    absolute: bool,
    inverse: bool,
    path: bool,
    ended: bool,
}

/// Reads a program. Its axes are X Y Z U V, the only ones that it is written for.
pub(crate) fn read(bytes: &[u8], _letters: &str) -> Result<FlyProgram, Fault> {
    let text = printable(bytes)?;
    let mut run = Runner::default();
    let mut modes = Modes::default();
    for (i, line) in text.lines().enumerate() {
        run.line = i + 1;
        let (code, comments) = split_comments(line).map_err(|m| Fault::new(i + 1, m))?;
        comments.iter().for_each(|c| run.comment(c));
        let code = code.trim();
        if code.is_empty() {
            continue;
        }
        if modes.ended {
            run.fault("a statement after the end");
        } else if words(code).and_then(|words| statement(&words, &mut run, &mut modes)).is_none() {
            run.fault(format!("{code:?} is not known"));
        }
    }
    Ok(run.finish(modes.ended))
}

/// Does what a line asks for; None where it is not known.
fn statement(words: &[(char, &str)], run: &mut Runner, modes: &mut Modes) -> Option<()> {
    match words {
        [('G', "64"), ('P', corner), ('Q', joined)] => {
            let corner = nm_from_decimal(corner.as_bytes())?;
            // Q joins moves that are nearly in line, which would change their times.
            if scaled(joined, 6)? != 0 {
                return None;
            }
            run.program.rounded_nm = run.program.rounded_nm.max(corner as f64);
            modes.path = true;
        }
        [('G', "4"), ('P', seconds)] => run.rest(scaled(seconds, 6)?, false),
        [('G', "0"), rest @ ..] if !rest.is_empty() => {
            if !modes.metric || !modes.absolute {
                run.fault("a move before G21 and G90");
            }
            run.rapid(places(rest)?);
        }
        [('G', "1"), rest @ .., ('F', rate)] if !rest.is_empty() => {
            if !modes.metric || !modes.absolute || !modes.inverse || !modes.path {
                run.fault("a timed move before G21, G90, G64 and G93");
            }
            let us = 60e6 / rate.parse::<f64>().ok().filter(|f| *f > 0.0)?;
            if (us - us.round()).abs() > WHOLE || us > 1e15 {
                run.fault("the time of a move is not a whole microsecond");
            }
            run.step(us.round() as i64, places(rest)?, KNOWN);
        }
        [('M', "62"), ('P', "0")] => run.waiting = Some(true),
        [('M', "63"), ('P', "0")] => run.waiting = Some(false),
        [('M', "65"), ('P', "0")] => run.off(),
        [('M', "68"), ('E', "0"), ('Q', "0")] => run.no_power(),
        [('M', "67"), ('E', "0"), ('Q', power)] => {
            run.power = power.parse().ok().filter(|p: &f64| (0.0..=100.0).contains(p));
            run.power?;
        }
        [('M', "2")] => modes.ended = true,
        _ => {
            for &(letter, number) in words {
                match (letter, number) {
                    ('G', "21") => modes.metric = true,
                    ('G', "90") => modes.absolute = true,
                    ('G', mode @ ("93" | "94")) => {
                        modes.inverse = mode == "93";
                        run.timed = modes.inverse;
                    }
                    ('G', "17" | "40" | "49" | "80") => {}
                    _ => return None,
                }
            }
        }
    }
    Some(())
}

/// Where words send the axes.
fn places(words: &[(char, &str)]) -> Option<[Option<i64>; AXES]> {
    let mut to = [None; AXES];
    for (letter, number) in words {
        let slot = &mut to[axis(*letter)?];
        if slot.replace(nm_from_decimal(number.as_bytes())?).is_some() {
            return None;
        }
    }
    Some(to)
}
