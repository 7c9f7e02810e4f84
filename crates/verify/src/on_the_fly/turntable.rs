//! A turntable that is commanded modulo a turn: where it really stands.
//!
//! From command to command such an axis goes the shorter way round; its angles of a program become angles that run on,
//! in millionths of a degree.

use crate::proof::Rule;
use crate::read::on_the_fly::{FlyProgram, FlyStep};
use terrace_core::machine::{AngleCommands, Machine};

/// A whole turn, millionths of a degree.
const TURN: i64 = 360_000_000;

fn is_in_turn(angle: i64) -> bool {
    (0..TURN).contains(&angle)
}

/// Lets the angles of axes run on that are commanded modulo a turn.
pub(super) fn unwind(program: &mut FlyProgram, name: &str, machine: &Machine, rule: &mut Rule) {
    let Some(table) = &machine.tilt else { return };
    for (k, axis) in table.axes.iter().enumerate().filter(|(_, axis)| axis.commands == AngleCommands::Modulo) {
        let (slot, letter) = (3 + k, axis.letter.char());
        let mut at = program.start.0[slot];
        if !is_in_turn(at) {
            rule.broken("", name.to_owned(), format!("{letter} begins at {} deg, not 0 to 360", at as f64 / 1e6));
            return;
        }
        for FlyStep { line, to, .. } in &mut program.steps {
            rule.checked += 1;
            let (commanded, deg) = (to.0[slot], to.0[slot] as f64 / 1e6);
            let way = (commanded - at).rem_euclid(TURN);
            let fault = if !is_in_turn(commanded) {
                Some(format!("{letter} is commanded to {deg} deg, not 0 to 360"))
            } else if way == TURN / 2 {
                Some(format!("{letter} is commanded by half a turn, to {deg} deg: either way is as short"))
            } else {
                None
            };
            if let Some(fault) = fault {
                rule.broken("", format!("{name}:{line}"), fault);
                return;
            }
            at += if way > TURN / 2 { way - TURN } else { way };
            to.0[slot] = at;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read::on_the_fly::Commands;
    use terrace_core::machine::AxisTravel;

    #[test]
    fn angles_modulo_a_turn_run_on_the_shorter_way() {
        let mut machine = Machine::built_in("xyzac-galvo-10").expect("a profile");
        let axis = &mut machine.tilt.as_mut().expect("a table").axes[1];
        (axis.travel, axis.commands) = (AxisTravel::CONTINUOUS, AngleCommands::Modulo);
        let at = |deg: i64| Commands([0, 0, 0, 0, 1_000_000 * deg, 0, 0]);
        let step = |deg| FlyStep { line: 1, us: 1, to: at(deg), mark: None, power: None };
        let program = |list: &[i64]| FlyProgram {
            start: at(350),
            steps: list.iter().map(|&deg| step(deg)).collect(),
            ..FlyProgram::default()
        };
        let mut rule = Rule::new("agreement", "");
        let mut made = program(&[10, 100, 0, 200, 30]);
        unwind(&mut made, "fly.pmc", &machine, &mut rule);
        let angles: Vec<i64> = made.steps.iter().map(|s| s.to.0[4] / 1_000_000).collect();
        assert_eq!((angles, rule.violated), (vec![370, 460, 360, 200, 30], 0));
        unwind(&mut program(&[10, 360]), "fly.pmc", &machine, &mut rule);
        assert_eq!(rule.violated, 1);
        unwind(&mut program(&[10, 190]), "fly.pmc", &machine, &mut rule);
        assert_eq!(rule.violated, 2, "half a turn");
        let begun = FlyProgram { start: at(360), ..program(&[0]) };
        unwind(&mut { begun }, "fly.pmc", &machine, &mut rule);
        assert_eq!(rule.violated, 3, "its start");
    }
}
