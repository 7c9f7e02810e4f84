//! What lists for cards have in common: points are whole units of the card.

use terrace_core::diag::Place;
use terrace_core::geom::FieldPoint;
use terrace_core::program::{Pen, Program};
use terrace_core::units::Time;

/// Dwells are counted in 10 us; after rounding they may be off by this share.
const DWELL_ERROR: f64 = 0.05;

/// Longest dwell, in 10 us.
const LONGEST_DWELL: f64 = 60_000.0;

/// The nearest whole number, halves away from zero: `f64::round`, which calls a library on processors for which Rust
/// builds by default. Beyond 2^63 it saturates as a cast does.
pub(super) fn rounded(value: f64) -> i64 {
    let whole = value as i64;
    // The rest is exact: it has no more digits than the value.
    whole.saturating_add((2.0 * (value - whole as f64)) as i64)
}

/// A dwell in 10 us; None where a card cannot keep it.
pub(super) fn dwell(time: Time) -> Option<u16> {
    let exact = time.as_us() / 10.0;
    let whole = exact.round();
    let is_kept = (1.0..=LONGEST_DWELL).contains(&whole) && (whole - exact).abs() <= DWELL_ERROR * exact;
    is_kept.then_some(whole as u16)
}

/// The first pen whose dwell a card cannot keep, and what is said of it.
pub(super) fn dwell_fault(pens: &[Pen]) -> Option<(usize, String)> {
    let unkept = |(i, pen): (usize, &Pen)| Some((i, pen.dwell.filter(|&time| dwell(time).is_none())?));
    let (i, time) = pens.iter().enumerate().find_map(unkept)?;
    let text = format!(
        "pen {:?} has a dwell of {} us: the card counts 10 us, 1 to 60000 of them, which miss that by more than 5 %",
        pens[i].name,
        time.as_us()
    );
    Some((i, text))
}

/// What helps.
pub(super) const DWELL_HINT: &str = "choose a multiple of 10 us, or pulses and a frequency that come to one";

/// Blocks with lines that are a single point in these units, and the first of them; None where there is none.
pub(super) fn lost(program: &Program, units: impl Fn(FieldPoint) -> [i64; 2]) -> Option<(usize, Place)> {
    let is_lost = |i: &usize| {
        program.strokes_of(&program.blocks[*i]).iter().any(|stroke| {
            let points = program.points_of(stroke);
            !stroke.is_dot() && points.iter().all(|&p| units(p) == units(points[0]))
        })
    };
    let blocks: Vec<usize> = (0..program.blocks.len()).filter(is_lost).collect();
    blocks.first().map(|&first| (blocks.len(), Place::Block(program.id(first).to_string())))
}

/// The `partition.min_mark` that leaves out what a unit of this many um would lose.
pub(super) fn min_mark(um: f64) -> String {
    format!("leave them out with partition.min_mark = \"{} um\"", (2.0 * um).ceil())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounded_is_round() {
        let mut value = 1e-9f64;
        while value < 1e15 {
            let near = [value, value.round() + 0.5, value.round() - 0.5, value.floor()];
            for v in near.into_iter().flat_map(|v| [v.next_down(), v, v.next_up()]).flat_map(|v| [v, -v]) {
                assert_eq!(rounded(v), v.round() as i64, "{v:e}");
            }
            value *= 1.37;
        }
        for v in [0.0f64, f64::MAX, f64::INFINITY, f64::NEG_INFINITY, f64::NAN] {
            assert_eq!(rounded(v), v.round() as i64, "{v:e}");
        }
    }
}
