//! A regular grid of equal cells in the plane.

use std::ops::Range;

use super::{Box2, Nm, P2};

/// Equal rectangular cells, counted row by row from the lower left. Lengths are nm unless its user says
/// otherwise. A cell holds its lower and left border; those of the last column and row hold their upper
/// and right border too.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Grid {
    /// Lower left corner.
    pub origin: P2,
    /// Size of a cell along x and y.
    pub pitch: [Nm; 2],
    /// Columns and rows.
    pub count: [u32; 2],
}

impl Grid {
    /// The fewest cells of the given pitch over `area`, the grid starting at its lower corner or
    /// up to one `step` below it: at the next lower point whose cell centres lie on multiples of
    /// `step` less `offset`, where stage targets can stand.
    pub fn over(area: Box2, pitch: [Nm; 2], step: Nm, offset: [Nm; 2]) -> Self {
        let x = aligned_start(area.lo.x, pitch[0], step, offset[0]);
        let y = aligned_start(area.lo.y, pitch[1], step, offset[1]);
        let count = [cells_to(x, area.hi.x, pitch[0]), cells_to(y, area.hi.y, pitch[1])];
        Self { origin: P2::new(x, y), pitch, count }
    }

    /// How many cells there are.
    pub fn len(&self) -> usize {
        self.columns() * self.rows()
    }

    /// Whether there is none; never, as made by [`Grid::over`].
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Cells in a row.
    #[inline]
    pub fn columns(&self) -> usize {
        self.count[0] as usize
    }

    /// Cells in a column.
    #[inline]
    pub fn rows(&self) -> usize {
        self.count[1] as usize
    }

    /// Column and row of cell `i`.
    pub fn cell(&self, i: usize) -> [u32; 2] {
        [(i % self.columns()) as u32, (i / self.columns()) as u32]
    }

    /// The centre of cell `i`: of a section, the point under the optical axis when it is marked.
    pub fn centre(&self, i: usize) -> P2 {
        let [column, row] = self.cell(i).map(i64::from);
        P2::new(self.line(0, column) + self.pitch[0].0 / 2, self.line(1, row) + self.pitch[1].0 / 2)
    }

    /// What cell `i` covers, borders included.
    pub fn area(&self, i: usize) -> Box2 {
        let [column, row] = self.cell(i).map(i64::from);
        let lo = P2::new(self.line(0, column), self.line(1, row));
        Box2 { lo, hi: P2::new(self.line(0, column + 1), self.line(1, row + 1)) }
    }

    /// What all cells cover, borders included.
    pub fn bounds(&self) -> Box2 {
        let [columns, rows] = self.count.map(i64::from);
        Box2 { lo: self.origin, hi: P2::new(self.line(0, columns), self.line(1, rows)) }
    }

    /// Coordinate, nm, of the lower border of column (axis 0) or row (axis 1) `i`.
    #[inline]
    pub fn line(&self, axis: usize, i: i64) -> i64 {
        self.start(axis) + i * self.pitch[axis].0
    }

    /// The column (axis 0) or row (axis 1) in which a stroke is that goes from `v` in direction `d` along that axis: a
    /// point on a border belongs to the side it goes to, and to the upper side if it stays on the border. Points
    /// outside the grid are in its outermost cells.
    #[inline]
    pub fn along(&self, axis: usize, v: i64, d: i64) -> i64 {
        let from = v - self.start(axis);
        let pitch = self.pitch[axis].0;
        let i = if d < 0 { (from - 1).div_euclid(pitch) } else { from.div_euclid(pitch) };
        i.clamp(0, i64::from(self.count[axis]) - 1)
    }

    /// The columns (axis 0) or rows (axis 1) that hold something of the closed interval from `lo` to `hi`.
    #[inline]
    pub fn range(&self, axis: usize, lo: i64, hi: i64) -> Range<usize> {
        let index = |v: i64| (v - self.start(axis)).div_euclid(self.pitch[axis].0);
        let first = index(lo).max(0);
        let last = index(hi).min(i64::from(self.count[axis]) - 1);
        if first > last { 0..0 } else { first as usize..last as usize + 1 }
    }

    /// The cells that hold something of a closed box, row by row.
    #[inline]
    pub fn touched(&self, area: Box2) -> impl Iterator<Item = usize> + Clone + use<> {
        let (columns, count) = (self.range(0, area.lo.x, area.hi.x), self.columns());
        self.range(1, area.lo.y, area.hi.y).flat_map(move |row| columns.clone().map(move |column| row * count + column))
    }

    /// Cell `i` and those next to it, corners included, row by row.
    #[inline]
    pub fn around(&self, i: usize) -> impl Iterator<Item = usize> + use<> {
        let (columns, rows) = (self.columns(), self.rows());
        let near = |at: usize, count: usize| at.saturating_sub(1)..(at + 2).min(count);
        let beside = near(i % columns, columns);
        near(i / columns, rows).flat_map(move |row| beside.clone().map(move |column| row * columns + column))
    }

    /// Calls `f` with every cell within a few nanometres of the line from a to b, row by row.
    pub fn under(&self, a: P2, b: P2, mut f: impl FnMut(usize)) {
        let (a, b) = if a.y <= b.y { (a, b) } else { (b, a) };
        let dy = (b.y - a.y) as f64;
        let bounds = self.bounds();
        // `along` puts what lies outside into the outermost cells: a line beside the grid goes here.
        let beyond = |lo: i64, hi: i64, from: i64, to: i64| hi + 3 < from || lo - 3 > to;
        if beyond(a.y, b.y, bounds.lo.y, bounds.hi.y) {
            return;
        }
        for row in self.along(1, a.y - 1, 0)..=self.along(1, b.y + 1, 0) {
            // The stretch of the line in this row, a nanometre more at both ends.
            let y0 = (self.line(1, row) - 1).clamp(a.y, b.y);
            let y1 = (self.line(1, row + 1) + 1).clamp(a.y, b.y);
            let x_at = |y: i64| a.x as f64 + (b.x - a.x) as f64 * ((y - a.y) as f64 / dy);
            let (mut x0, mut x1) = if dy > 0.0 { (x_at(y0), x_at(y1)) } else { (a.x as f64, b.x as f64) };
            if x0 > x1 {
                std::mem::swap(&mut x0, &mut x1);
            }
            // Two nanometres more; f64 rounds by less than 1e-5 nm within 4 m.
            let (x0, x1) = (x0.floor() as i64 - 2, x1.ceil() as i64 + 2);
            if beyond(x0, x1, bounds.lo.x, bounds.hi.x) {
                continue;
            }
            for column in self.along(0, x0, 0)..=self.along(0, x1, 0) {
                f(row as usize * self.columns() + column as usize);
            }
        }
    }

    #[inline]
    fn start(&self, axis: usize) -> i64 {
        if axis == 0 { self.origin.x } else { self.origin.y }
    }
}

/// Where a grid starts along an axis: at `lo` or the next lower place with the centres of cells on multiples of `step`
/// less `offset`.
fn aligned_start(lo: i64, Nm(pitch): Nm, Nm(step): Nm, Nm(offset): Nm) -> i64 {
    lo - (lo + pitch / 2 + offset).rem_euclid(step)
}

/// How many cells it takes along an axis to come from `start` to `hi`, one at least.
fn cells_to(start: i64, hi: i64, Nm(pitch): Nm) -> u32 {
    let count = ((hi - start) as u64).div_ceil(pitch as u64).max(1);
    u32::try_from(count).unwrap_or(u32::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_whole_number_of_fields_needs_no_extra_section() {
        let mm = 1_000_000;
        let field = [Nm(40 * mm); 2];
        let area = |w: i64| Box2 { lo: P2::new(0, 0), hi: P2::new(w * mm, 450 * mm) };
        let s = Grid::over(area(400), field, Nm(100), [Nm(0); 2]);
        assert_eq!(s.count, [10, 12]);
        assert_eq!(s.centre(11), P2::new(60 * mm, 60 * mm));
        assert_eq!(Grid::over(area(450), field, Nm(100), [Nm(0); 2]).len(), 144);
    }

    #[test]
    fn centres_lie_where_the_stage_can_stand() {
        let area = Box2 { lo: P2::new(12_345, -777), hi: P2::new(90_000_000, 1_000_000) };
        let s = Grid::over(area, [Nm(40_000_000); 2], Nm(100), [Nm(37), Nm(-5)]);
        let c = s.centre(0);
        assert_eq!([(c.x + 37) % 100, (c.y - 5) % 100], [0, 0]);
        assert!(s.origin.x <= 12_345 && s.origin.x > 12_345 - 100);
    }

    #[test]
    fn borders_belong_to_the_side_a_stroke_goes_to() {
        let s = Grid { origin: P2::new(0, 0), pitch: [Nm(10); 2], count: [3, 1] };
        assert_eq!([s.along(0, 10, 1), s.along(0, 10, -1), s.along(0, 10, 0)], [1, 0, 1]);
        assert_eq!([s.along(0, 30, 0), s.along(0, 0, -1)], [2, 0]);
    }

    #[test]
    fn a_box_touches_the_cells_that_meet_it_and_none_beside_the_grid() {
        let grid = Grid { origin: P2::new(-20, 5), pitch: [Nm(10), Nm(7)], count: [5, 4] };
        let inside = |i: usize, area: Box2| {
            // Cells are half-open.
            let cell = grid.area(i);
            area.lo.x < cell.hi.x && cell.lo.x <= area.hi.x && area.lo.y < cell.hi.y && cell.lo.y <= area.hi.y
        };
        for x in -40..40 {
            for (y, w, h) in [(-9, 3, 11), (5, 10, 0), (12, 0, 7), (31, 25, 1), (33, 9, 9), (-9, 90, 90)] {
                let area = Box2 { lo: P2::new(x, y), hi: P2::new(x + w, y + h) };
                let want: Vec<usize> = (0..grid.len()).filter(|&i| inside(i, area)).collect();
                assert_eq!(grid.touched(area).collect::<Vec<_>>(), want, "{area:?}");
            }
        }
        let beside = |i: usize| grid.around(i).collect::<Vec<_>>();
        assert_eq!((beside(0), beside(14)), (vec![0, 1, 5, 6], vec![8, 9, 13, 14, 18, 19]));
        assert_eq!(grid.bounds(), Box2 { lo: P2::new(-20, 5), hi: P2::new(30, 33) });
    }
}
