//! What is measured on the labels: connected parts, and the length of borders.

use std::ops::Range;

use terrace_core::geom::Grid;

/// Number of connected components (8 neighbours) of cells of one label; cells of label 0, which no block owns, do not
/// count.
pub(super) fn count_components(grid: &Grid, labels: &[u32]) -> usize {
    // Union-find over the runs of one label in each row: components = runs - unions of two components.
    let columns = grid.columns();
    let mut parent: Vec<u32> = Vec::new();
    let mut joined = 0;
    // The runs of the row before and those of the row at hand.
    let mut below: Vec<LabelRun> = Vec::new();
    let mut here: Vec<LabelRun> = Vec::new();
    for row in labels.chunks_exact(columns) {
        let mut x = 0;
        let mut first = 0;
        for same in row.chunk_by(|a, b| a == b) {
            let columns_of = x..x + same.len();
            let label = same[0];
            x += same.len();
            if label == 0 {
                continue;
            }
            let id = parent.len() as u32;
            parent.push(id);
            // Runs below that end before this one begins touch neither it nor a later one. Ends are exclusive: where they
            // are equal the runs share a corner.
            while below.get(first).is_some_and(|b| b.columns.end < columns_of.start) {
                first += 1;
            }
            let touching = below[first..].iter().take_while(|b| b.columns.start <= columns_of.end);
            for b in touching.filter(|b| b.label == label) {
                let (p, q) = (root(&mut parent, b.id), root(&mut parent, id));
                joined += usize::from(p != q);
                parent[p.max(q) as usize] = p.min(q);
            }
            here.push(LabelRun { columns: columns_of, label, id });
        }
        std::mem::swap(&mut below, &mut here);
        here.clear();
    }
    parent.len() - joined
}

/// Adjacent cells of one label in a row.
struct LabelRun {
    columns: Range<usize>,
    label: u32,
    id: u32,
}

/// Root of the component of a run; halves the way to it.
fn root(parent: &mut [u32], mut i: u32) -> u32 {
    while parent[i as usize] != i {
        parent[i as usize] = parent[parent[i as usize] as usize];
        i = parent[i as usize];
    }
    i
}

/// Weights of pairs of cells for [`seam_cells`].
const PAIRS: [([isize; 2], f64); 8] = [
    ([1, 0], SIDE),
    ([0, 1], SIDE),
    ([1, 1], CORNER),
    ([-1, 1], CORNER),
    ([2, 1], KNIGHT),
    ([1, 2], KNIGHT),
    ([-1, 2], KNIGHT),
    ([-2, 1], KNIGHT),
];
// With these the errors of `seam_cells` along the eight directions and halfway between them are equal and opposite.
const SIDE: f64 = 0.23287;
const CORNER: f64 = 0.11319;
const KNIGHT: f64 = 0.08787;

/// Length of the borders between labels, in sides of a cell.
///
/// Pairs of cells that a border parts are counted in eight directions (Cauchy and Crofton: lines of
/// one direction meet a border as often as it is long across them). A straight border of direction u
/// parts |u × v| pairs of distance v per length; the weights make the sum right to 1.36 % for all u:
/// as much too short along the eight directions as too long halfway between. A pair that two borders
/// part is counted once.
pub(super) fn seam_cells(grid: &Grid, labels: &[u32]) -> f64 {
    PAIRS.iter().map(|&(pair, weight)| weight * parted_pairs(grid, labels, pair) as f64).sum()
}

/// How many pairs of cells, the second `dx` columns and `dy` rows (0 or more) from the first, have two labels that
/// differ, neither of them 0.
fn parted_pairs(grid: &Grid, labels: &[u32], [dx, dy]: [isize; 2]) -> usize {
    let columns = grid.columns();
    // Where the first and the second cells of the pairs begin in their rows. A grid narrower than a pair has no pairs:
    // `width` is 0 then.
    let first = 0.max(-dx) as usize;
    let second = 0.max(dx) as usize;
    let width = columns.saturating_sub(first + second);
    let parted_in_rows = |a: &[u32], b: &[u32]| {
        let pairs = a[first.min(columns)..][..width].iter().zip(&b[second.min(columns)..][..width]);
        // No branches and no checks for overflow, so that the loop can be vectorised: a row has fewer than 2^32 pairs.
        pairs.fold(0u32, |n, (&a, &b)| n.wrapping_add(u32::from((a != b) & (a != 0) & (b != 0)))) as usize
    };
    let above = labels.chunks_exact(columns).skip(dy as usize);
    labels.chunks_exact(columns).zip(above).map(|(row, above)| parted_in_rows(row, above)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrace_core::geom::{Nm, P2};

    #[test]
    fn pairs_are_parted_where_both_cells_have_labels_that_differ() {
        let grid = Grid { origin: P2::new(0, 0), pitch: [Nm(1); 2], count: [4, 2] };
        let labels = [1, 1, 2, 0, 1, 2, 2, 0];
        assert_eq!(parted_pairs(&grid, &labels, [1, 0]), 2, "one in each row");
        assert_eq!(parted_pairs(&grid, &labels, [0, 1]), 1);
        assert_eq!(parted_pairs(&grid, &labels, [1, 1]), 2);
        assert_eq!(parted_pairs(&grid, &labels, [-1, 1]), 0);
        assert_eq!(parted_pairs(&grid, &labels, [5, 1]), 0, "wider than the grid");
    }
}
