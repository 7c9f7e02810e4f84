//! In each section the fewest levels: interval stabbing of the heights by one sweep upwards, each level
//! starting at the lowest height that is not covered yet. Optimal for a fixed grid of sections.

use super::Lattice;

/// Number and lower end of every level, upwards.
pub(super) fn levels(heights: &[(f64, f64)], lattice: &Lattice) -> Vec<(i32, i64)> {
    let mut out: Vec<(i32, i64)> = Vec::new();
    let mut covered = i64::MIN;
    for &(lo, hi) in heights {
        while out.is_empty() || hi > covered as f64 {
            // The part of the interval that is not covered begins at its own start or where the
            // last level ends.
            let start = if lo > covered as f64 { lattice.floor(lo).max(covered) } else { covered };
            out.push((out.len() as i32, start));
            covered = start + lattice.depth;
        }
    }
    out
}
