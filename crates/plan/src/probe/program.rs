//! The program of a touch probe: where the stage goes, and where it touches.
//!
//! One dialect for LinuxCNC, which writes a log of its own (PROBEOPEN), and one for GRBL, which answers each touch. A
//! touch that meets nothing ends both (G38.2): G38.3 would go on, and LinuxCNC's log would have the end of the move as
//! if it were a touch. Positions have the zero of the stage programs. The laser stays off.

use super::plan::{Move, Probing, Tool};
use crate::emit::lines::{LINUXCNC_ZERO, Lines, M0_ZERO, MOST_OF_GRBL, Word, letters};
use crate::emit::quoted;
use terrace_core::machine::{Commanded, Dialect};

/// The file that LinuxCNC writes the touches to.
pub const LOG: &str = "probe.log";

/// The name of the program, and its bytes; None without a touch probe, and for Mach, whose words are others.
pub fn program(probing: &Probing) -> Option<(&'static str, Vec<u8>)> {
    let Tool::Touch(probe) = probing.tool else { return None };
    let machine = &probing.machine;
    let (name, longest, zero) = match machine.controller.dialect {
        Dialect::Linuxcnc => ("probe.ngc", machine.controller.max_line, LINUXCNC_ZERO),
        Dialect::Grbl => ("probe.nc", machine.controller.max_line.min(MOST_OF_GRBL), M0_ZERO),
        Dialect::Mach => return None,
    };
    let is_linuxcnc = machine.controller.dialect == Dialect::Linuxcnc;
    let mut p = Lines::new(longest);
    p.comment("terrace: touch probe, absolute, mm");
    p.comment(&format!("machine: {}", quoted(&machine.name)));
    p.comment(zero);
    p.comment("a touch that meets nothing ends the program");
    if is_linuxcnc {
        p.line("G21 G90 G94 G17 G40 G49 G80 G61.1 G54");
        p.line("M65 P0");
        p.line("M5");
        p.offsets_end(machine, 1);
        p.line(&format!("(PROBEOPEN {LOG})"));
    } else {
        for line in ["G21 G90 G94 G17 G40 G80 G54", "G49", "G92.1", "M5"] {
            p.line(line);
        }
    }
    let feed = format!(" F{:.3}", probe.feed.as_mm_s() * 60.0);
    p.go("G0", &[('Z', machine.retract_z().0)], "");
    if let Some(letters) = letters(machine) {
        p.go("G0", &letters.map(|letter| (letter, 0)), "");
    }
    let mut names = probing.points.iter().map(|point| point.name.as_str());
    let mut at: Option<Commanded> = None;
    for step in &probing.moves {
        match *step {
            Move::Rapid(to) => {
                let words = changed(at, to);
                if !words.is_empty() {
                    p.go("G0", &words, "");
                }
                at = Some(to);
            }
            Move::Touch(to) => {
                p.comment(&format!("POINT {}", names.next().unwrap_or_default()));
                p.go("G38.2", &[('Z', to[2])], &feed);
                // Where it has touched is not known; the next move goes back up.
                at = Some(Commanded([to[0], to[1], i64::MIN]));
            }
        }
    }
    if is_linuxcnc {
        p.line("(PROBECLOSE)");
    }
    p.line("M2");
    Some((name, p.out))
}

/// Words of the axes that a move changes; at first all of x and y, the stage being lifted.
fn changed(from: Option<Commanded>, to: Commanded) -> Vec<Word> {
    let Some(from) = from else { return vec![('X', to[0]), ('Y', to[1])] };
    let axes = ['X', 'Y', 'Z'];
    (0..3).filter(|&k| from[k] != to[k]).map(|k| (axes[k], to[k])).collect()
}
