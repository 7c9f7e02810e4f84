//! Areas of parallel lines whose direction changes from cell to cell of a grid, so that they can follow
//! the level lines of a part.
//!
//! An area holds no line until it is filled. Then every cell has the lines of one lattice, exactly
//! `pitch` apart, each from border to border of what the area has in the cell: the area is closed, and a
//! line along the border of two cells belongs to the upper one. So lines fill every cell to its border
//! and none reaches over it.
//!
//! A lattice continues from the cell below, or from the one on the left where its lines rather run upwards: in the
//! middle of the border they share, lines of both are a pitch apart. Cells of one direction so share one lattice, and
//! an even slope is hatched as if there were no cells; the first lies half a pitch inside the area's box, and a stated
//! part of a pitch further. Where directions differ, lines end on the border, and next to it up to one pitch stays
//! free.
//!
//! Left out are lines in corners whose ends are less than 2 nm apart in x or in y: rounding could lay them
//! along a border. Those are some nm long, and 12 um a hundredth of a degree off an axis. Strokes are counted cell by
//! cell, in each along the normal that lies left of the lines. Units: nm as f64 in the turned part frame, rounded once.

use crate::texture::Figure;
use crate::texture::place::{NM, Turn};
use crate::texture::{MAX_STROKES, too_large};
use terrace_core::diag::Error;
use terrace_core::geom::{Box2, BoxMm, Grid, NM_PER_MM, P2, cos_sin};

/// The direction of the lines in every cell of a grid, turned part frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Directions {
    /// The cells of the grid.
    pub grid: Grid,
    /// From +x, counter-clockwise, in hundredths of a degree from 0 to 17999; row by row.
    pub hundredths: Vec<u16>,
}

impl Directions {
    /// Directions in half a turn.
    pub const COUNT: u16 = 18_000;

    /// The directions of a cross of lines: of its first set themselves, of its second at a right angle to them.
    #[must_use]
    pub fn turned(&self, set: usize) -> Self {
        let by = if set == 0 { 0 } else { Self::COUNT / 2 };
        let hundredths = self.hundredths.iter().map(|h| (h + by) % Self::COUNT).collect();
        Self { grid: self.grid, hundredths }
    }

    /// Cosine and sine of a direction in hundredths of a degree, exact along the axes.
    pub fn cos_sin(hundredths: u16) -> [f64; 2] {
        cos_sin((f64::from(hundredths) / 100.0).to_radians())
    }
}

/// An area to be filled.
#[derive(Clone, Debug)]
pub struct Contour {
    /// Lower and upper corner, nm in the part frame.
    area: [[f64; 2]; 2],
    /// The part frame's axes.
    axes: [[f64; 2]; 2],
    corners: [[f64; 2]; 4],
    bounds: Box2,
    pitch: f64,
    /// Distance of the first line from the lower left corner of the box, nm.
    begin: f64,
    lattices: Vec<CellLattice>,
}

/// The parallel lines of one cell, numbered along their normal.
#[derive(Clone, Debug)]
struct CellLattice {
    cell: Box2,
    /// Whether the upper border along x and y belongs to the next cell.
    open: [bool; 2],
    direction: [f64; 2],
    /// A point of line 0.
    anchor: P2,
    /// Number of the first line in the cell.
    first: i64,
    /// Lines in this cell and those before it.
    end: u64,
}

impl CellLattice {
    fn normal(&self) -> [f64; 2] {
        [-self.direction[1], self.direction[0]]
    }

    /// Shortest line: its ends are 2 nm apart in x and in y, unless it runs along an axis.
    fn shortest(&self) -> f64 {
        let along = self.direction.map(f64::abs).into_iter().filter(|&v| v > 0.0);
        2.0 / along.fold(1.0, f64::min)
    }

    /// A point moved along the normal, on the grid.
    fn shifted(&self, p: P2, by: f64) -> P2 {
        let normal = self.normal();
        P2::new(p.x + (by * normal[0]).round() as i64, p.y + (by * normal[1]).round() as i64)
    }

    /// Distance of a point from line 0, along the normal.
    fn height(&self, p: [f64; 2]) -> f64 {
        dot([p[0] - self.anchor.x as f64, p[1] - self.anchor.y as f64], self.normal())
    }
}

impl Figure for Contour {
    fn len(&self) -> u64 {
        self.lattices.last().map_or(0, |l| l.end)
    }

    fn points(&self) -> u64 {
        2 * self.len()
    }

    /// The box of the area; that of its lines lies in it.
    fn bounds(&self) -> Box2 {
        self.bounds
    }

    fn stroke(&self, i: u64, out: &mut Vec<P2>) {
        let (cell, k) = self.find(i);
        let line = self.line(&self.lattices[cell], k).expect("lines between the outermost ones have a length");
        out.extend_from_slice(&line);
    }

    fn element(&self, i: u64) -> String {
        let (cell, k) = self.find(i);
        format!("line {} of section {}", k + 1 - self.lattices[cell].first, cell + 1)
    }
}

impl Contour {
    pub(in crate::texture) fn new(area_mm: BoxMm<2>, pitch_mm: f64, phase: f64, turn: Turn) -> Result<Self, Error> {
        if !(pitch_mm >= NM && pitch_mm.is_finite()) {
            return Err(super::bad_pitch("hatch", pitch_mm, NM));
        }
        let mut bounds = Box2::EMPTY;
        area_mm.corners().map(|c| turn.nm(c)).into_iter().for_each(|c| bounds.add(c));
        Ok(Self {
            area: [area_mm.lo, area_mm.hi].map(|corner| corner.map(|v| v * NM_PER_MM)),
            axes: [turn.turned([1.0, 0.0]), turn.turned([0.0, 1.0])],
            corners: area_mm.corners().map(|c| turn.turned(c).map(|v| v * NM_PER_MM)),
            bounds,
            pitch: pitch_mm * NM_PER_MM,
            begin: pitch_mm * NM_PER_MM * (0.5 + phase),
            lattices: Vec::new(),
        })
    }

    /// How many lines fill it.
    pub fn line_count(&self) -> u64 {
        self.len()
    }

    /// Writes the ends of line `i` into `out`, which is cleared.
    pub fn line_ends(&self, i: u64, out: &mut Vec<P2>) {
        out.clear();
        self.stroke(i, out);
    }

    /// The corners of the area, counter-clockwise, nm.
    pub fn corners(&self) -> [[f64; 2]; 4] {
        self.corners
    }

    /// Distance of lines, nm.
    pub fn pitch(&self) -> f64 {
        self.pitch
    }

    /// The cell that holds stroke `i`, and the number of its line.
    fn find(&self, i: u64) -> (usize, i64) {
        let cell = self.lattices.partition_point(|l| l.end <= i);
        let start = if cell == 0 { 0 } else { self.lattices[cell - 1].end };
        (cell, self.lattices[cell].first + (i - start) as i64)
    }

    /// Gives every cell its lines. The grid covers the area.
    pub(in crate::texture) fn fill(&mut self, directions: &Directions) -> Result<(), Error> {
        let grid = &directions.grid;
        let [columns, rows] = [grid.columns(), grid.rows()];
        self.lattices = Vec::with_capacity(grid.len());
        let mut end = 0;
        for (i, &hundredths) in directions.hundredths.iter().enumerate() {
            let direction = Directions::cos_sin(hundredths);
            let column = i % columns;
            let row = i / columns;
            let mut lattice = CellLattice {
                cell: grid.area(i),
                open: [column + 1 < columns, row + 1 < rows],
                direction,
                anchor: self.bounds.lo,
                first: 0,
                end,
            };
            let [along_x, along_y] = direction.map(f64::abs);
            let before = if along_x >= along_y {
                row.checked_sub(1).map(|_| i - columns)
            } else {
                column.checked_sub(1).map(|_| i - 1)
            };
            lattice.anchor = self.anchor(&lattice, before.map(|b| &self.lattices[b]));
            end += self.count(&mut lattice)?;
            lattice.end = end;
            self.lattices.push(lattice);
        }
        Ok(())
    }

    /// A point of line 0 of a lattice that continues the one of the cell before it.
    fn anchor(&self, lattice: &CellLattice, before: Option<&CellLattice>) -> P2 {
        let Some(before) = before else { return lattice.shifted(self.bounds.lo, self.begin) };
        if before.direction == lattice.direction {
            return before.anchor;
        }
        // The middle of the border, or of as much of it as lies in the area's box.
        let a = lattice.cell;
        let b = before.cell;
        let Box2 { lo, hi } = self.bounds;
        let middle = P2::new(
            middle_of_overlap([a.lo.x, a.hi.x], [b.lo.x, b.hi.x], [lo.x, hi.x]),
            middle_of_overlap([a.lo.y, a.hi.y], [b.lo.y, b.hi.y], [lo.y, hi.y]),
        );
        // From there to the nearest line of the cell before; directions end at 180 deg, so the normals may be opposite.
        let height = before.height([middle.x as f64, middle.y as f64]);
        let off = height - (height / self.pitch).round() * self.pitch;
        let is_opposite = dot(before.normal(), lattice.normal()) < 0.0;
        lattice.shifted(middle, if is_opposite { off } else { -off })
    }

    /// Finds the first line of a cell and returns the number of its lines.
    fn count(&self, lattice: &mut CellLattice) -> Result<u64, Error> {
        let Some([lo, hi]) = span(self.outline(lattice.cell).into_iter().map(|p| lattice.height(p))) else {
            return Ok(0);
        };
        // A line that rounding, by up to 0.7 nm, brings onto the border belongs to the cell.
        let lo = ((lo - 1.0) / self.pitch).ceil();
        let hi = ((hi + 1.0) / self.pitch).floor();
        if lattice.end as f64 + (hi - lo) >= MAX_STROKES as f64 {
            let lines = lattice.end + (hi - lo) as u64;
            return Err(too_large(lines, 2 * lines).into());
        }
        let mut first = lo as i64;
        let mut last = hi as i64;
        // Lines get shorter towards a corner, so only the outermost can be too short.
        while first <= last && self.line(lattice, first).is_none() {
            first += 1;
        }
        while first <= last && self.line(lattice, last).is_none() {
            last -= 1;
        }
        lattice.first = first;
        Ok((last + 1 - first) as u64)
    }

    /// The corners of what the area has in a cell, borders included.
    pub fn outline(&self, cell: Box2) -> Vec<[f64; 2]> {
        let mut points = self.corners.to_vec();
        for (axis, sign, limit) in
            [(0, 1.0, cell.lo.x), (0, -1.0, cell.hi.x), (1, 1.0, cell.lo.y), (1, -1.0, cell.hi.y)]
        {
            points = cut_at(&points, axis, sign, limit as f64);
        }
        points
    }

    /// The lines of each cell.
    pub(in crate::texture) fn cells(&self) -> impl Iterator<Item = ContourCell<'_>> {
        let starts = std::iter::once(0).chain(self.lattices.iter().map(|l| l.end));
        let lattices = self.lattices.iter().zip(starts);
        lattices.map(|(lattice, start)| ContourCell { area: self, lattice, count: (lattice.end - start) as usize })
    }

    /// The ends of line `k` of a cell; None where it is too short.
    fn line(&self, lattice: &CellLattice, k: i64) -> Option<[P2; 2]> {
        let offset = k as f64 * self.pitch;
        let [t0, t1] = self.reach(lattice, offset)?;
        (t1 - t0 >= lattice.shortest()).then(|| [t0, t1].map(|t| self.place(lattice, offset, t)))
    }

    /// The point of the grid at `t` along a line, in the cell and in the area's box.
    fn place(&self, lattice: &CellLattice, offset: f64, t: f64) -> P2 {
        let (d, n, Box2 { lo, hi }) = (lattice.direction, lattice.normal(), lattice.cell);
        let anchor = [lattice.anchor.x as f64, lattice.anchor.y as f64];
        let [x, y] = [0, 1].map(|a| (anchor[a] + offset * n[a] + t * d[a]).round() as i64);
        let Box2 { lo: least, hi: most } = self.bounds;
        P2::new(x.clamp(lo.x.max(least.x), hi.x.min(most.x)), y.clamp(lo.y.max(least.y), hi.y.min(most.y)))
    }

    /// Between which places along it a line at `offset` from line 0 lies in the cell and in the area.
    fn reach(&self, lattice: &CellLattice, offset: f64) -> Option<[f64; 2]> {
        let d = lattice.direction;
        let n = lattice.normal();
        let p = [lattice.anchor.x as f64 + offset * n[0], lattice.anchor.y as f64 + offset * n[1]];
        let Box2 { lo, hi } = lattice.cell;
        let [[x0, y0], [x1, y1]] = self.area;
        let slabs = [
            Slab { axis: [1.0, 0.0], lo: lo.x as f64, hi: hi.x as f64, is_open: lattice.open[0] },
            Slab { axis: [0.0, 1.0], lo: lo.y as f64, hi: hi.y as f64, is_open: lattice.open[1] },
            Slab { axis: self.axes[0], lo: x0, hi: x1, is_open: false },
            Slab { axis: self.axes[1], lo: y0, hi: y1, is_open: false },
        ];
        let mut t0 = f64::NEG_INFINITY;
        let mut t1 = f64::INFINITY;
        for Slab { axis, lo, hi, is_open } in slabs {
            let at = dot(p, axis);
            let along = dot(d, axis);
            if along == 0.0 {
                // The line lies on the grid where it is marked: what is judged is its rounded place. One on the upper
                // border is the next cell's.
                let at = at.round();
                let lo = lo.round();
                let hi = hi.round();
                if at < lo || at > hi || is_open && at == hi {
                    return None;
                }
                continue;
            }
            let ta = (lo - at) / along;
            let tb = (hi - at) / along;
            t0 = t0.max(ta.min(tb));
            t1 = t1.min(ta.max(tb));
        }
        Some([t0, t1])
    }
}

/// What lies between two limits along an axis.
struct Slab {
    axis: [f64; 2],
    lo: f64,
    hi: f64,
    /// Whether the upper limit itself does not belong to it.
    is_open: bool,
}

/// The middle of what two intervals share, each cut at the limits.
fn middle_of_overlap([a0, a1]: [i64; 2], [b0, b1]: [i64; 2], [lo, hi]: [i64; 2]) -> i64 {
    (a0.max(b0).clamp(lo, hi) + a1.min(b1).clamp(lo, hi)) / 2
}

/// The part of a convex polygon on one side of a line across an axis: above `limit` where `sign` is 1, below where it
/// is -1 (Sutherland and Hodgman). Points that arise lie on the limit exactly.
fn cut_at(points: &[[f64; 2]], axis: usize, sign: f64, limit: f64) -> Vec<[f64; 2]> {
    let depth = |p: [f64; 2]| sign * (p[axis] - limit);
    let mut kept = Vec::with_capacity(8);
    for (i, &b) in points.iter().enumerate() {
        let a = points[(i + points.len() - 1) % points.len()];
        let depth_a = depth(a);
        let depth_b = depth(b);
        if depth_a * depth_b < 0.0 {
            let t = depth_a / (depth_a - depth_b);
            let mut p = [0, 1].map(|k| a[k] + t * (b[k] - a[k]));
            p[axis] = limit;
            kept.push(p);
        }
        if depth_b >= 0.0 {
            kept.push(b);
        }
    }
    kept
}

/// The lines of one cell of a filled area.
pub(in crate::texture) struct ContourCell<'a> {
    area: &'a Contour,
    lattice: &'a CellLattice,
    /// How many there are.
    pub(in crate::texture) count: usize,
}

impl ContourCell<'_> {
    /// The cell's borders.
    pub(in crate::texture) fn bounds(&self) -> Box2 {
        self.lattice.cell
    }

    /// Along the lines, and across, from a point of line 0, nm.
    pub(in crate::texture) fn along(&self, p: [f64; 2]) -> [f64; 2] {
        let r = [p[0] - self.lattice.anchor.x as f64, p[1] - self.lattice.anchor.y as f64];
        [dot(r, self.lattice.direction), dot(r, self.lattice.normal())]
    }

    /// Number of the first line.
    pub(in crate::texture) fn first(&self) -> i64 {
        self.lattice.first
    }

    /// What lies in the cell of a stretch of a line `offset` nm from line 0.
    pub(in crate::texture) fn piece(&self, offset: f64, [from, to]: [f64; 2]) -> Option<[P2; 2]> {
        let [t0, t1] = self.area.reach(self.lattice, offset)?;
        let t0 = t0.max(from);
        let t1 = t1.min(to);
        // Shorter ones could be rounded to a point.
        (t1 - t0 >= 2.0).then(|| [t0, t1].map(|t| self.area.place(self.lattice, offset, t)))
    }
}

fn dot(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

/// The least and the largest; None where there is none.
fn span(values: impl Iterator<Item = f64>) -> Option<[f64; 2]> {
    values.fold(None, |s: Option<[f64; 2]>, v| Some(s.map_or([v, v], |[lo, hi]| [lo.min(v), hi.max(v)])))
}

#[cfg(test)]
mod tests {
    use super::{cut_at, middle_of_overlap};

    #[test]
    fn overlaps_are_cut_at_the_limits() {
        assert_eq!(middle_of_overlap([0, 10], [4, 20], [0, 100]), 7);
        assert_eq!(middle_of_overlap([0, 10], [4, 20], [0, 6]), 5);
    }

    #[test]
    fn a_square_is_cut_on_either_side_of_a_line() {
        let square = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]];
        assert_eq!(cut_at(&square, 0, 1.0, 1.0), [[1.0, 0.0], [2.0, 0.0], [2.0, 2.0], [1.0, 2.0]]);
        assert_eq!(cut_at(&square, 1, -1.0, 2.0), square, "its border belongs to it");
        assert!(cut_at(&square, 1, 1.0, 3.0).is_empty());
    }
}
