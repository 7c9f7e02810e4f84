//! Which cells are drawn: those under marks and those in the gaps between neighbouring marks.
//!
//! A gap is a run of cells without marks in a row or a column, with marks at both ends. Its width is the
//! distance of those ends, in cells. Nothing is closed that has marks on one side only.

use terrace_core::geom::Grid;

/// The widest gap that is closed, against that which three of four gaps do not exceed, in halves.
const HALVES: usize = 3;

/// Whether each cell is drawn. The usual gap is the width that three of four do not exceed. Gaps are
/// closed up to 1.5 times that, at most up to `widest` cells; where the usual gap is wider still, the
/// texture is sparse, and gaps are closed up to `least`.
pub(super) fn gaps(grid: &Grid, labels: &[u32], least: usize, widest: usize) -> Vec<bool> {
    let mut shown: Vec<bool> = labels.iter().map(|&label| label != 0).collect();
    // The last count is that of all wider gaps.
    let mut widths = vec![0usize; widest + 2];
    each(grid, &shown, |_, _, width| widths[width.min(widest + 1)] += 1);
    let total: usize = widths.iter().sum();
    let mut sum = 0;
    let is_usual = |n: &usize| {
        sum += n;
        4 * sum >= 3 * total
    };
    // The third quartile, not the mean: a few wide gaps between figures must not close the field.
    let usual = widths.iter().position(is_usual).unwrap_or(0);
    let reach = if usual > widest { least } else { (HALVES * usual / 2).min(widest) };
    // Twice: what lies between dots is between the columns that the rows between them have become.
    for _ in 0..2 {
        let before = shown.clone();
        each(grid, &before, |first, step, width| {
            if width <= reach {
                (1..width).for_each(|k| shown[first + k * step] = true);
            }
        });
    }
    shown
}

/// Hands all gaps to `take`: the marked cell before it, the index's step from cell to cell, the width.
fn each(grid: &Grid, marked: &[bool], mut take: impl FnMut(usize, usize, usize)) {
    let [columns, rows] = [grid.columns(), grid.rows()];
    const NONE: usize = usize::MAX;
    // The last marked row of every column.
    let mut below = vec![NONE; columns];
    for y in 0..rows {
        let mut left = NONE;
        for x in (0..columns).filter(|x| marked[y * columns + x]) {
            if left != NONE && x - left > 1 {
                take(y * columns + left, 1, x - left);
            }
            if below[x] != NONE && y - below[x] > 1 {
                take(below[x] * columns + x, columns, y - below[x]);
            }
            (left, below[x]) = (x, y);
        }
    }
}
