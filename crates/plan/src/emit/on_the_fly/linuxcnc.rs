//! `fly.ngc`: X Y Z U V for LinuxCNC, whose scanner axes are driven as U and V.
//!
//! G93 with F on every line gives every move its time; F has as many digits as it takes that the microseconds read
//! back. G64 P0.0002 Q0 rounds corners by at most 0.2 um and joins no moves: G61 would stop at every sample that is not
//! in line, and burn there. The times are kept where the controller's own limits of speed and acceleration are at least
//! the program's; it plans its own accelerations.
//!
//! The laser is digital output 0: M62 and M63 switch it with the next move, up to one servo period early;
//! M65 at once, before every rest, at the start and at the end, because M63 waits for a move that may
//! never come. Its power is analogue output 0 in percent (M67, with the next move); where it follows the speed of the
//! spot, it is set anew before every move that asks for another.

use super::{AxisWords, Pieces, Powers, approach, clean, head, percent, push_time, settle, word};
use crate::on_the_fly::check::Checked;
use terrace_core::machine::Machine;
use terrace_core::math;

/// The usual servo period of LinuxCNC, s.
pub const SERVO_S: f64 = 1e-3;

/// The program for LinuxCNC.
///
/// # Panics
/// If the program has other axes than X Y Z U V.
pub fn linuxcnc(checked: &Checked, machine: &Machine) -> Vec<u8> {
    let program = checked.program();
    assert_eq!(program.kind.letters(), "XYZUV", "LinuxCNC marks with five axes");
    let mut out = Vec::with_capacity(60 * program.moves.len() + 1024);
    let line = |out: &mut Vec<u8>, text: &str| {
        out.extend_from_slice(text.as_bytes());
        out.push(b'\n');
    };
    let comment = |out: &mut Vec<u8>, text: &str| {
        line(out, &format!("({})", clean(text, machine.controller.max_line - 2)));
    };
    comment(&mut out, "terrace: on-the-fly program for LinuxCNC, X Y Z stage and U V scanner, absolute, mm");
    head(checked, machine, SERVO_S).iter().for_each(|text| comment(&mut out, text));
    comment(&mut out, "digital output 0 is the laser, analogue output 0 its power in percent");
    comment(&mut out, "corners are rounded by 0.0002 mm at most, times hold where the limits of the axes allow them");
    line(&mut out, "G21 G90 G94 G17 G40 G49 G80");
    line(&mut out, "G64 P0.0002 Q0");
    line(&mut out, "M65 P0");
    approach(&mut out, checked, machine, "G0");
    line(&mut out, &dwell(settle(machine)));
    line(&mut out, "G93");
    let mut axis_words = AxisWords::start(program, machine);
    let (mut laser, mut pieces, mut powers) = (false, Pieces::default(), Powers::new(checked, machine));
    for (us, from, to) in program.steps() {
        let begun = pieces.begin(to.mark);
        if let Some((text, pen)) = &begun {
            comment(&mut out, text);
            if let Some(pen) = pen.filter(|_| !checked.power_by_speed()) {
                line(&mut out, &format!("M67 E0 Q{}", percent(checked, machine, pen)));
            }
        }
        if let Some(power) = powers.before(from, to, (to.us - us) as f64 * 1e-6, begun.is_some()) {
            line(&mut out, &format!("M67 E0 Q{power}"));
        }
        if *from == to.to {
            // A rest is not a move: what waits for one would not come.
            line(&mut out, "M65 P0");
            laser = false;
            line(&mut out, &dwell(to.us - us));
            continue;
        }
        if laser != to.mark.is_some() {
            laser = to.mark.is_some();
            line(&mut out, if laser { "M62 P0" } else { "M63 P0" });
        }
        out.extend_from_slice(b"G1");
        axis_words.append(&mut out, &to.to);
        out.extend_from_slice(b" F");
        push_inverse(&mut out, to.us - us);
        out.push(b'\n');
    }
    for text in ["M65 P0", "M68 E0 Q0", "G94"] {
        line(&mut out, text);
    }
    out.extend_from_slice(b"G0");
    word(&mut out, 2, machine.retract_z().0);
    line(&mut out, "\nM65 P0\nM2");
    out
}

fn dwell(us: i64) -> String {
    let mut text = b"G4 P".to_vec();
    push_time(&mut text, us, 1_000_000);
    String::from_utf8(text).expect("digits")
}

/// Appends 60e6 / us, moves per minute, to twelve digits.
fn push_inverse(out: &mut Vec<u8>, us: i64) {
    let value = 60e6 / us as f64;
    let whole = math::log10(value.max(1.0)) as usize + 1;
    // Below 1 the zeros after the point do not count.
    let zeros = if value < 1.0 { (-math::log10(value)) as usize } else { 0 };
    let decimals = (12 + zeros).saturating_sub(if value < 1.0 { 0 } else { whole });
    let text = format!("{value:.decimals$}");
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    out.extend_from_slice(text.as_bytes());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_time_reads_back_to_the_microsecond() {
        let mut us = 1;
        while us < 10_000_000_000 {
            let mut text = Vec::new();
            push_inverse(&mut text, us);
            let text = String::from_utf8(text).expect("digits");
            let back = 60e6 / text.parse::<f64>().expect("a number");
            assert!((back - us as f64).abs() < 0.3 && text.len() <= 20, "{us}: {text}");
            assert!((back / us as f64 - 1.0).abs() < 1e-10, "{us}: {text}");
            us = us * 11 / 9 + 1;
        }
    }
}
