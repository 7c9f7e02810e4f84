//! What lists for cards have in common: points are whole units of the card.

use crate::diag::Place;
use crate::geom::FieldPoint;
use crate::program::Program;

/// The nearest whole number, halves away from zero: `f64::round`, which calls a library on processors for which Rust
/// builds by default. Beyond 2^63 it saturates as a cast does.
pub(super) fn rounded(value: f64) -> i64 {
    let whole = value as i64;
    // The rest is exact: it has no more digits than the value.
    whole.saturating_add((2.0 * (value - whole as f64)) as i64)
}

/// Blocks with marks that are a single point in these units, and the first of them; None where there is none.
pub(super) fn lost(program: &Program, units: impl Fn(FieldPoint) -> [i64; 2]) -> Option<(usize, Place)> {
    let is_lost = |i: &usize| {
        program.strokes_of(&program.blocks[*i]).iter().any(|stroke| {
            let points = program.points_of(stroke);
            points.iter().all(|&p| units(p) == units(points[0]))
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
