//! What lists for cards have in common: points are whole units of the card.

use crate::diag::Place;
use crate::geom::FieldPoint;
use crate::program::Program;

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
