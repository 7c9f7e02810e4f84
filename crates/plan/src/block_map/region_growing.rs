//! Labels grow from the cells under marks over those without.
//!
//! Ring by ring, in each ring first over the sides of cells, then over their corners: every cell goes
//! to a label that is nearest among those that may have it. What comes first in a ring depends on the order
//! of the cells alone.

use terrace_core::geom::{Grid, Nm, P2};
use terrace_core::parallel;
use terrace_input::surface::{Cursor, Surface};

/// Heights of the surface at the centres of the cells of some rows.
pub(super) struct CellHeights(Vec<i32>);

/// Heights are held in steps of 4 nm: far below any level, and 8 m fit 32 bits.
const STEP_NM: f64 = 4.0;
const NONE: i32 = i32::MIN;

impl CellHeights {
    /// Walks the surface along the rows that are not `dense`.
    pub(super) fn under(surface: &Surface, grid: &Grid, dense: &[bool]) -> Self {
        let columns = grid.columns();
        let mut heights = vec![NONE; grid.len()];
        parallel::map_items(heights.chunks_mut(columns).collect(), |row, heights: &mut [i32]| {
            if dense[row] {
                return;
            }
            let mut cursor = Cursor::default();
            let mut spans = Vec::new();
            let b = grid.centre((row + 1) * columns - 1);
            let a = P2::new(grid.origin.x, b.y);
            surface.walk(a, b, &mut cursor, &mut spans);
            let mut span = 0;
            for (column, height) in heights.iter_mut().enumerate() {
                let Nm(x) = grid.pitch[0] * column as i64 + grid.pitch[0] / 2;
                let t = x as f64 / (b.x - a.x) as f64;
                // Spans tile 0 to 1 and columns come in order, so both are gone through once.
                while spans[span].t1 < t {
                    span += 1;
                }
                let s = &spans[span];
                if s.facet().is_some() {
                    let z = s.z0 + (s.z1 - s.z0) * ((t - s.t0) / (s.t1 - s.t0));
                    *height = (z / STEP_NM) as i32;
                }
            }
        });
        Self(heights)
    }

    /// The height at a cell's centre, nm; None where there is no surface, or its row is dense.
    #[inline]
    pub(super) fn at(&self, cell: usize) -> Option<Nm> {
        Some(self.0[cell]).filter(|&h| h != NONE).map(|h| Nm(i64::from(h) * STEP_NM as i64))
    }
}

/// The rows that have marks in every cell, as have the rows next to them.
pub(super) fn dense(grid: &Grid, marked: &[u32]) -> Vec<bool> {
    let is_whole = |row: &[u32]| row.iter().all(|&label| label != 0);
    let whole: Vec<bool> = marked.chunks_exact(grid.columns()).map(is_whole).collect();
    let near = |y: usize| y.saturating_sub(1)..(y + 2).min(whole.len());
    (0..whole.len()).map(|y| whole[near(y)].iter().all(|&w| w)).collect()
}

/// Gives cells without label that of a neighbour, as long as there is one that may have the cell:
/// `may(cell, label)`.
pub(super) fn grow(grid: &Grid, labels: &mut [u32], may: impl Fn(usize, u32) -> bool) {
    let mut front = rim(grid, labels);
    let mut next = Vec::new();
    while !front.is_empty() {
        // Breadth first: the cells of the front are equally many steps away from marks. Sides before corners, since
        // a step over a corner is longer. A cell is given once and never changed.
        for steps in [SIDES, CORNERS] {
            for &i in &front {
                let label = labels[i as usize];
                beside(grid, i, steps, |n| {
                    if labels[n] == 0 && may(n, label) {
                        labels[n] = label;
                        next.push(n as u32);
                    }
                });
            }
        }
        std::mem::swap(&mut front, &mut next);
        next.clear();
    }
}

type Steps = [[i32; 2]; 4];
const SIDES: Steps = [[-1, 0], [1, 0], [0, -1], [0, 1]];
const CORNERS: Steps = [[-1, -1], [1, -1], [-1, 1], [1, 1]];

/// Hands the cells next to cell `i` to `take`.
#[inline]
fn beside(grid: &Grid, i: u32, steps: Steps, mut take: impl FnMut(usize)) {
    let [columns, rows] = grid.count;
    let (x, y) = (i % columns, i / columns);
    for [dx, dy] in steps {
        let (x, y) = (x.wrapping_add_signed(dx), y.wrapping_add_signed(dy));
        if x < columns && y < rows {
            take((y * columns + x) as usize);
        }
    }
}

/// The cells with label that have one without next to them, rising.
fn rim(grid: &Grid, labels: &[u32]) -> Vec<u32> {
    let [columns, rows] = [grid.columns(), grid.rows()];
    let row = |y: usize| &labels[y * columns..(y + 1) * columns];
    let mut rim = Vec::new();
    // Whether a column holds a cell without label in the row at hand or those next to it.
    let mut open = vec![false; columns + 2];
    for y in 0..rows {
        open.fill(false);
        for near in y.saturating_sub(1)..(y + 2).min(rows) {
            open[1..=columns].iter_mut().zip(row(near)).for_each(|(open, &label)| *open |= label == 0);
        }
        let at = open.windows(3).zip(row(y)).enumerate();
        let at = at.filter(|(_, (open, label))| (open[0] | open[1] | open[2]) && **label != 0);
        rim.extend(at.map(|(x, _)| (y * columns + x) as u32));
    }
    rim
}
