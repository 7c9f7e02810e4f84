//! Which cells are drawn: those under marks and those in the gaps between neighbouring marks.
//!
//! A gap is a run of cells without marks in a row or a column, with marks at both ends. Its width is the
//! distance of those ends, in cells. Nothing is closed that has marks on one side only.

use super::Frame;

/// The widest gap that is closed, against that which three of four gaps do not exceed, in halves.
const HALVES: usize = 3;

/// Whether each cell is drawn. Gaps wider than `widest` cells are neither counted nor closed.
pub(super) fn gaps(frame: &Frame, labels: &[u32], widest: usize) -> Vec<bool> {
    let mut shown: Vec<bool> = labels.iter().map(|&label| label != 0).collect();
    let mut widths = vec![0usize; widest + 1];
    each(frame, &shown, widest, |_, _, width| widths[width] += 1);
    let total: usize = widths.iter().sum();
    let mut sum = 0;
    let usual = widths.iter().position(|&n| {
        sum += n;
        total > 0 && 4 * sum >= 3 * total
    });
    let Some(usual) = usual else { return shown };
    let reach = (HALVES * usual / 2).min(widest);
    // Twice: what lies between dots is between the columns that the rows between them have become.
    for _ in 0..2 {
        let before = shown.clone();
        each(frame, &before, reach, |first, step, width| {
            (1..width).for_each(|k| shown[first + k * step] = true);
        });
    }
    shown
}

/// Hands all gaps of at most `widest` cells to `take`: the marked cell before it, the index's step
/// from cell to cell, the width.
fn each(frame: &Frame, inked: &[bool], widest: usize, mut take: impl FnMut(usize, usize, usize)) {
    let [columns, rows] = frame.count;
    const NONE: usize = usize::MAX;
    // The last inked row of every column.
    let mut below = vec![NONE; columns];
    for y in 0..rows {
        let mut left = NONE;
        for x in (0..columns).filter(|x| inked[y * columns + x]) {
            let near = |from: usize, to: usize| from != NONE && to - from > 1 && to - from <= widest;
            if near(left, x) {
                take(y * columns + left, 1, x - left);
            }
            if near(below[x], y) {
                take(below[x] * columns + x, columns, y - below[x]);
            }
            (left, below[x]) = (x, y);
        }
    }
}
