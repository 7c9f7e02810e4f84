//! The rests of the spot: it cannot turn sharply without one, and needs its time from one to the next.
//!
//! Consumes a program whose beams are vertical; holds that between two sharp turns the spot takes as long as each axis
//! of the field needs for its way from rest to rest, under the acceleration and jerk of the scanner and no faster than
//! the pen in a mark, or than the scanner. That is a lower bound for any motion through these places, whatever the
//! stage does. Turns are looked for over steps of [`APART`]; the time next to a rest counts for the runs on both sides.

use super::chain::Chain;
use crate::proof::Rule;
use crate::read::on_the_fly::FlyProgram;
use crate::rest_to_rest::{CORNER, profile_time};
use terrace_core::machine::Machine;
use terrace_core::math;
use terrace_core::program::Pen;

/// The spot is looked at again when it is so far away, nm, as docs/explanation/verify.md states.
const APART: f64 = 100.0;
/// How far the rounding of two samples may turn such a step, rad.
const ROUNDED: f64 = 0.05;
/// Sums of times are rounded: a time that is too short by this share is allowed.
const OVER: f64 = 1.0 + 1e-6;

/// A place of the spot, nm, with the times at which it comes within [`APART`] of it and leaves that, us.
#[derive(Clone, Copy)]
struct SpotPlace {
    at: [f64; 2],
    us: [f64; 2],
    line: usize,
    /// Highest speed on the way to it, mm/s.
    speed: f64,
}

/// Holds the rule.
pub(super) fn check(program: &FlyProgram, name: &str, chain: &Chain, machine: &Machine, pens: &[Pen], rule: &mut Rule) {
    let Some(acceleration) = machine.scanner.acceleration.map(|a| a.as_mm_s2()) else { return };
    let jerk = machine.scanner.jerk.map(|j| j.as_mm_s3());
    let [jump, mark] = [machine.scanner.jump_speed, machine.scanner.max_mark_speed].map(|v| v.as_mm_s());
    let places = places(program, chain, |pen| match pen {
        Some(pen) => pens.get(pen).map_or(mark, |pen| pen.speed.as_mm_s()),
        None => jump.max(mark),
    });
    if places.is_empty() {
        return;
    }
    // The spot rests where it turns sharply, however the rounding of two samples has turned it; and at the end.
    let turns = places.windows(3).map(|w| {
        let [a, b] = [0, 1].map(|i| [0, 1].map(|k| w[i + 1].at[k] - w[i].at[k]));
        math::atan2((a[0] * b[1] - a[1] * b[0]).abs(), a[0] * b[0] + a[1] * b[1]) > CORNER + ROUNDED
    });
    let rests = turns.zip(1..).filter_map(|(turns, i)| turns.then_some(i)).chain([places.len() - 1]);
    let mut first = 0;
    for last in rests {
        let (from, rest) = (&places[first], &places[last]);
        let speed = places[first + 1..=last].iter().fold(0.0, |speed: f64, place| speed.max(place.speed));
        rule.checked += 1;
        let needed = [0, 1].map(|k| {
            // The spot may rest anywhere within `APART` of either place.
            let way = ((rest.at[k] - from.at[k]).abs() - 2.0 * APART).max(0.0) * 1e-6;
            profile_time(way, speed, acceleration, jerk)
        });
        // Both axes go at once: the one that takes longer decides.
        let needed = needed[0].max(needed[1]);
        let taken = (rest.us[1] - from.us[0] + 1.0) * 1e-6;
        if taken * OVER < needed {
            let text = format!(
                "the spot takes {:.3} ms from one sharp turn to the next, for which its acceleration and jerk need {:.3} ms",
                1e3 * taken,
                1e3 * needed
            );
            rule.broken("", format!("{name}:{}", rest.line), text);
        }
        first = last;
    }
}

/// The places of the spot, one after the other.
fn places(program: &FlyProgram, chain: &Chain, speed: impl Fn(Option<usize>) -> f64) -> Vec<SpotPlace> {
    let spot = |at: &crate::read::on_the_fly::Commands| {
        let [x, y, _] = chain.beam(&at.float()).at;
        [x, y]
    };
    let mut out = vec![SpotPlace { at: spot(&program.start), us: [0.0; 2], line: 0, speed: 0.0 }];
    let mut fastest = 0.0f64;
    for (us, from, step) in program.moves() {
        let (before, at) = (spot(from), spot(&step.to));
        fastest = fastest.max(speed(step.mark.map(|m| m.pen.index())));
        let Some(last) = out.last_mut() else { break };
        let way = [0, 1].map(|k| at[k] - before[k]);
        let [us, until] = [us, step.us].map(|t| t as f64);
        if math::hypot(at[0] - last.at[0], at[1] - last.at[1]) < APART {
            last.us[1] = until;
            continue;
        }
        // Where the move leaves the last place: |off + share * way| = APART.
        let off = [0, 1].map(|k| before[k] - last.at[k]);
        let dot = |a: [f64; 2], b: [f64; 2]| a[0] * b[0] + a[1] * b[1];
        let (square, half) = (dot(way, way), dot(off, way));
        let root = (half * half + square * (APART * APART - dot(off, off)).max(0.0)).sqrt();
        last.us[1] = us + ((root - half) / square).clamp(0.0, 1.0) * (until - us);
        // A move that begins near the new place came near it before: no earlier than it came near the last one.
        let near = 1.0 - APART / square.sqrt();
        let entered = if near > 0.0 { us + near * (until - us) } else { last.us[0] };
        out.push(SpotPlace { at, us: [entered, until], line: step.line, speed: fastest });
        fastest = 0.0;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read::on_the_fly::{Commands, FlyStep};
    use terrace_core::machine::Origin;

    /// A way of the spot there and up, 0.5 mm each, every side taking so many times as long as it must, by moves of the
    /// scanner in even steps of its profile.
    fn program(machine: &Machine, slower: f64) -> FlyProgram {
        let run = terrace_core::motion::Run::default().then([0.5, 0.0]);
        let motion = terrace_core::motion::GalvoModel::of(machine).motion(run, 3000.0).expect("limits");
        let mut out = FlyProgram::default();
        const STEPS: i32 = 60;
        for side in 0..2 {
            for k in 1..=STEPS {
                let time = motion.total_s() * f64::from(k) / f64::from(STEPS);
                let way = (motion.way_at(time) * 1e6).round() as i64;
                let total = slower * (f64::from(side) * motion.total_s() + time);
                let mut to = Commands::default();
                (to.0[5], to.0[6]) = if side == 0 { (way, 0) } else { (500_000, way) };
                out.steps.push(FlyStep {
                    line: out.steps.len() + 1,
                    us: (total * 1e6).ceil() as i64,
                    to,
                    mark: None,
                    power: None,
                });
            }
        }
        out
    }

    #[test]
    fn a_spot_that_turns_without_the_time_for_a_rest_is_found() {
        let machine = Machine::built_in("xyzac-galvo-10").expect("a profile");
        let chain = Chain::new(&machine, Origin([0; 3]), "XYZUV").expect("axes");
        let found = |slower: f64, machine: &Machine| {
            let mut rule = Rule::new("limits", "");
            check(&program(machine, slower), "fly.ngc", &chain, machine, &[], &mut rule);
            assert!(rule.checked >= 2 || machine.scanner.acceleration.is_none());
            rule.violated
        };
        assert_eq!([1.0, 1.5].map(|slower| found(slower, &machine)), [0, 0]);
        assert_eq!(found(0.9, &machine), 2, "both sides are too fast");
        let mut other = machine.clone();
        other.scanner.jerk = None;
        let mut rule = Rule::new("limits", "");
        check(&program(&other, 1.0), "fly.ngc", &chain, &machine, &[], &mut rule);
        assert_eq!(rule.violated, 2, "its acceleration steps");
    }
}
