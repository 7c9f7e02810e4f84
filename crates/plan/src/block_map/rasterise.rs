//! Cells under the strokes of blocks, or of bands of depth.
//!
//! Consumes marks in groups, promises for every cell the group with the longest marks in it. Strokes are followed
//! from border to border of the cells. Which cells a segment begins and ends in is decided on the
//! program's integers; a segment along a border belongs to the upper cell, one that only touches a cell
//! to none. Time follows the cells that strokes pass; memory is 8 bytes a cell, and 4 more in the rows of
//! the highest group.

use std::ops::Range;

use crate::ordered_strokes::{Band, OrderedStrokes};
use terrace_core::geom::{FieldPoint, Grid, P3, Turn};
use terrace_core::program::{Block, Program};

/// Marks no longer than this in a cell, nm, do not claim it: rounding may clip its corner.
const LEAST_NM: f32 = 1.0;

/// What a dot counts for, nm.
const DOT_NM: f32 = 1000.0;

/// Marks in groups, each of which a label stands for.
pub(super) trait MarkGroups {
    /// How many groups there are.
    fn group_count(&self) -> usize;
    /// Calls `visit` with the points of every stroke of a group, nm on the part; a dot has one.
    fn visit_strokes(&self, group: usize, visit: &mut dyn FnMut(&[[i64; 2]]));
}

/// The marks of the blocks of a program; by block how the part is turned, None where it is not.
pub(super) struct BlockMarks<'a> {
    pub program: &'a Program,
    pub turns: &'a [Option<Turn>],
}

impl MarkGroups for BlockMarks<'_> {
    fn group_count(&self) -> usize {
        self.program.blocks.len()
    }

    fn visit_strokes(&self, group: usize, visit: &mut dyn FnMut(&[[i64; 2]])) {
        let block = &self.program.blocks[group];
        let turn = &self.turns[group];
        let mut points = Vec::new();
        for stroke in self.program.strokes_of(block) {
            points.clear();
            points.extend(self.program.points_of(stroke).iter().map(|p| on_part(block, turn, p)));
            visit(&points);
        }
    }
}

/// The marks of bands of depth.
pub(super) struct BandMarks<'a> {
    pub ordered: &'a OrderedStrokes,
    pub bands: &'a [Band],
}

impl MarkGroups for BandMarks<'_> {
    fn group_count(&self) -> usize {
        self.bands.len()
    }

    fn visit_strokes(&self, group: usize, visit: &mut dyn FnMut(&[[i64; 2]])) {
        let mut points = Vec::new();
        for stroke in &self.ordered.strokes[self.bands[group].strokes.clone()] {
            points.clear();
            points.extend(self.ordered.points_of(stroke).iter().map(|p| [p.x, p.y]));
            visit(&points);
        }
    }
}

/// Index of the group with the longest marks plus 1 for every cell, 0 where there are none; among
/// equals the first.
pub(super) fn marked_cells(marks: &dyn MarkGroups, grid: &Grid) -> Vec<u32> {
    let mut labels = vec![0u32; grid.len()];
    let mut longest = vec![LEAST_NM; grid.len()];
    let mut lengths = GroupLengths::default();
    for group in 0..marks.group_count() {
        let Some(rows) = rows_of(marks, group, grid) else { continue };
        lengths.begin(rows, grid.columns());
        marks.visit_strokes(group, &mut |points| {
            if let [at] = points {
                let cell = grid.along(1, at[1], 0) as usize * grid.columns() + grid.along(0, at[0], 0) as usize;
                lengths.add(cell, DOT_NM);
            }
            for ends in points.windows(2) {
                pass(ends[0], ends[1], grid, |cell, length| lengths.add(cell, length as f32));
            }
        });
        lengths.take_each(|cell, length| {
            // More than the groups before have: among equals the first keeps the cell.
            if length > longest[cell] {
                (longest[cell], labels[cell]) = (length, group as u32 + 1);
            }
        });
    }
    labels
}

/// The lengths of the marks of one group in each cell, over the rows that it touches.
#[derive(Default)]
struct GroupLengths {
    /// By cell, from the first of these rows on; all 0 between two groups.
    by_cell: Vec<f32>,
    /// The first cell of these rows.
    first: usize,
    /// The cells that have a length.
    touched: Vec<u32>,
}

impl GroupLengths {
    /// Begins with a group that touches these rows.
    fn begin(&mut self, rows: Range<usize>, columns: usize) {
        self.first = rows.start * columns;
        self.by_cell.resize(self.by_cell.len().max(rows.len() * columns), 0.0);
    }

    #[inline]
    fn add(&mut self, cell: usize, length: f32) {
        let sum = &mut self.by_cell[cell - self.first];
        if *sum == 0.0 {
            self.touched.push(cell as u32);
        }
        *sum += length;
    }

    /// Hands on the cells with their lengths, and forgets them.
    fn take_each(&mut self, mut visit: impl FnMut(usize, f32)) {
        for cell in self.touched.drain(..).map(|cell| cell as usize) {
            visit(cell, std::mem::take(&mut self.by_cell[cell - self.first]));
        }
    }
}

/// A point of a block on the part, nm; of a turned part where the beam meets the focal plane, which is next to
/// the surface.
fn on_part(block: &Block, turn: &Option<Turn>, p: &FieldPoint) -> [i64; 2] {
    let c = block.stop.centre;
    let at = [c.x + i64::from(p.x), c.y + i64::from(p.y)];
    turn.map_or(at, |turn| {
        let [x, y, _] = turn.back(P3::new([at[0], at[1], block.stop.lpfl.0].map(|v| v as f64))).at;
        [x.round() as i64, y.round() as i64]
    })
}

/// The rows that hold a group's points.
fn rows_of(marks: &dyn MarkGroups, group: usize, grid: &Grid) -> Option<Range<usize>> {
    let (mut lo, mut hi) = (i64::MAX, i64::MIN);
    marks.visit_strokes(group, &mut |points| {
        points.iter().for_each(|p| (lo, hi) = (lo.min(p[1]), hi.max(p[1])));
    });
    if lo > hi {
        return None;
    }
    // Borders included: which row a point on a border belongs to depends on where its stroke goes.
    Some(grid.along(1, lo, -1) as usize..grid.along(1, hi, 0) as usize + 1)
}

/// One axis of a segment on its way through the cells.
struct Axis {
    /// Column or row at the beginning.
    first: usize,
    /// Borders still to be crossed.
    left: usize,
    /// Where the cell beyond the next border is, as an index.
    stride: isize,
    /// Parameter of the next border, and between two borders.
    next: f64,
    step: f64,
}

impl Axis {
    fn new(grid: &Grid, axis: usize, [a, b]: [i64; 2], stride: usize) -> Self {
        let d = b - a;
        let (first, last) = (grid.along(axis, a, d), grid.along(axis, b, -d));
        let left = first.abs_diff(last) as usize;
        let border = grid.line(axis, first + i64::from(d > 0));
        let next = if left > 0 { (border - a) as f64 / d as f64 } else { f64::INFINITY };
        Self {
            first: first as usize,
            left,
            stride: if d > 0 { stride as isize } else { -(stride as isize) },
            next,
            step: grid.pitch[axis].f64() / d.abs().max(1) as f64,
        }
    }

    /// Crosses the next border from cell `at`.
    #[inline]
    fn cross(&mut self, at: &mut usize) {
        *at = at.wrapping_add_signed(self.stride);
        self.left -= 1;
        self.next = if self.left > 0 { self.next + self.step } else { f64::INFINITY };
    }
}

/// Hands the cells under the segment from `a` to `b` to `visit` in order: index and length in nm.
#[inline]
pub(super) fn pass(a: [i64; 2], b: [i64; 2], grid: &Grid, mut visit: impl FnMut(usize, f64)) {
    let columns = grid.columns();
    let mut x = Axis::new(grid, 0, [a[0], b[0]], 1);
    let mut y = Axis::new(grid, 1, [a[1], b[1]], columns);
    let [dx, dy] = [0, 1].map(|k| (b[k] - a[k]) as f64);
    let length = (dx * dx + dy * dy).sqrt();
    let mut at = y.first * columns + x.first;
    let mut t = 0.0;
    loop {
        let next = x.next.min(y.next);
        if next == f64::INFINITY {
            return visit(at, (1.0 - t) * length);
        }
        visit(at, (next - t) * length);
        t = next;
        if x.next == next {
            x.cross(&mut at);
        }
        if y.next == next {
            y.cross(&mut at);
        }
    }
}
