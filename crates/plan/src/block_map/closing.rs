//! Which cells are drawn: those under marks and those in the gaps between neighbouring marks.
//!
//! A gap is a run of cells without marks in a row or a column, with marks at both ends. Its width is the
//! distance of those ends, in cells. Nothing is closed that has marks on one side only.

use terrace_core::geom::Grid;

/// Gaps are closed up to this many halves of the width that three of four gaps do not exceed.
const REACH_HALVES: usize = 3;

/// Whether each cell is drawn: it is marked, or lies in a gap that is closed. The usual gap is the width that three of
/// four do not exceed. Gaps are closed up to 1.5 times that, at most up to `widest` cells; where the usual gap is wider
/// still, the texture is sparse, and gaps are closed up to `least`.
pub(super) fn drawn_cells(grid: &Grid, labels: &[u32], least: usize, widest: usize) -> Vec<bool> {
    let mut shown: Vec<bool> = labels.iter().map(|&label| label != 0).collect();
    // The last count is that of all wider gaps.
    let mut widths = vec![0usize; widest + 2];
    each_gap(grid, &shown, |gap| widths[gap.width.min(widest + 1)] += 1);
    let total: usize = widths.iter().sum();
    let mut sum = 0;
    // Widths come in order, so their counts add up.
    let reaches_third_quartile = |n: &usize| {
        sum += n;
        4 * sum >= 3 * total
    };
    // Not the mean: a few wide gaps between figures must not widen the reach until these gaps are closed. 0 where there
    // are no gaps.
    let usual = widths.iter().position(reaches_third_quartile).unwrap_or(0);
    let reach = if usual > widest { least } else { (REACH_HALVES * usual / 2).min(widest) };
    // Twice: of a lattice of dots the first round fills the rows and columns through the dots, the second the squares
    // between them.
    for _ in 0..2 {
        let before = shown.clone();
        each_gap(grid, &before, |gap| {
            if gap.width <= reach {
                (1..gap.width).for_each(|k| shown[gap.before + k * gap.step] = true);
            }
        });
    }
    shown
}

/// A gap between two marked cells of a row or a column.
struct Gap {
    /// Index of the marked cell before it.
    before: usize,
    /// From the index of a cell to that of the next.
    step: usize,
    /// Cells from one marked cell to the other.
    width: usize,
}

/// Hands all gaps to `take`.
fn each_gap(grid: &Grid, marked: &[bool], mut take: impl FnMut(Gap)) {
    let [columns, rows] = [grid.columns(), grid.rows()];
    const NONE: usize = usize::MAX;
    // The last marked row of every column.
    let mut below = vec![NONE; columns];
    for y in 0..rows {
        let mut left = NONE;
        for x in (0..columns).filter(|x| marked[y * columns + x]) {
            if left != NONE && x - left > 1 {
                take(Gap { before: y * columns + left, step: 1, width: x - left });
            }
            if below[x] != NONE && y - below[x] > 1 {
                take(Gap { before: below[x] * columns + x, step: columns, width: y - below[x] });
            }
            (left, below[x]) = (x, y);
        }
    }
}
