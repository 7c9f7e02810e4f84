//! Lines cut at the border of an area, whose edges lie in the cells of a grid.

use super::crossings::edges;
use crate::texture::clip::{Polylines, distance, extent, is_closed};
use crate::texture::place::{LEAST, NM};
use terrace_core::geom::{BoxMm, PlanePoint};

/// A line that lies nearer to the border of the area than this lies on it, mm.
const ON: f64 = 2.0 * NM;

/// Most rows and columns of the index.
const MAX_ROWS: usize = 4096;
const MAX_COLUMNS: usize = 256;

/// Which side of the area's border is kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::texture) enum Keep {
    /// What lies inside or on the border.
    Inside,
    /// What lies outside, without the border.
    Outside,
}

/// The edges of an area in the cells of a grid.
#[derive(Debug)]
pub(in crate::texture) struct Cutter {
    edges: Vec<[PlanePoint; 2]>,
    cells: Cells,
}

impl Cutter {
    /// The contours of an area bound it by the rule evenodd.
    pub(super) fn new<'a>(contours: impl Iterator<Item = &'a Vec<PlanePoint>>) -> Self {
        let edges: Vec<_> = contours.flat_map(|c| edges(c)).collect();
        let count = [(edges.len() / 64).clamp(1, MAX_COLUMNS), (edges.len() / 2).clamp(1, MAX_ROWS)];
        let cells = Cells::new(&edges, count, 2.0 * ON);
        Self { edges, cells }
    }

    /// For few contours and many lines: a grid of this many columns and rows.
    pub(in crate::texture) fn with_cells(contours: &[Vec<PlanePoint>], count: [usize; 2]) -> Self {
        let edges: Vec<_> = contours.iter().flat_map(|c| edges(c)).collect();
        let cells = Cells::new(&edges, count, 2.0 * ON);
        Self { edges, cells }
    }

    pub(in crate::texture) fn edges(&self) -> &[[PlanePoint; 2]] {
        &self.edges
    }

    pub(in crate::texture) fn cells(&self) -> &Cells {
        &self.cells
    }

    /// Appends the pieces of a polyline on the side that is kept, in its direction. Of a closed one no piece is divided
    /// at its first point unless it is whole.
    pub(in crate::texture) fn cut(&self, line: &[PlanePoint], keep: Keep, out: &mut Polylines) {
        if let [dot] = line {
            if self.holds(*dot).unwrap_or(true) == (keep == Keep::Inside) {
                out.push(line);
            }
            return;
        }
        let mut pieces: Vec<Vec<PlanePoint>> = Vec::new();
        // Whether the last piece reaches up to the place that is looked at.
        let mut is_open = false;
        let mut ts = Vec::new();
        for side in line.windows(2) {
            let [a, b] = [side[0], side[1]];
            let at = |t: f64| [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])];
            self.crossings([a, b], &mut ts);
            for t in ts.windows(2) {
                // Between two crossings all lies on one side, so its middle decides; what lies on the border is inside.
                let is_kept = self.holds(at((t[0] + t[1]) / 2.0)).unwrap_or(true) == (keep == Keep::Inside);
                if is_kept {
                    if !is_open {
                        pieces.push(vec![if t[0] == 0.0 { a } else { at(t[0]) }]);
                    }
                    pieces.last_mut().expect("one was begun").push(if t[1] == 1.0 { b } else { at(t[1]) });
                }
                is_open = is_kept;
            }
        }
        if is_closed(line) && pieces.len() > 1 && is_open && pieces[0][0] == line[0] {
            let first = pieces.remove(0);
            pieces.last_mut().expect("more than one").extend_from_slice(&first[1..]);
        }
        for mut piece in pieces {
            piece.dedup();
            let [w, h] = extent(&piece);
            if w.max(h) >= LEAST {
                out.push(&piece);
            }
        }
    }

    /// Writes the parameters, from 0 to 1, between each two of which the segment lies on one side into `ts`.
    fn crossings(&self, [a, b]: [PlanePoint; 2], ts: &mut Vec<f64>) {
        ts.clear();
        ts.extend([0.0, 1.0]);
        let d = [b[0] - a[0], b[1] - a[1]];
        let square = d[0] * d[0] + d[1] * d[1];
        if square == 0.0 {
            ts.truncate(1);
            return;
        }
        let side = |p: PlanePoint| (d[0] * (p[1] - a[1]) - d[1] * (p[0] - a[0])) / square.sqrt();
        let along = |p: PlanePoint| (d[0] * (p[0] - a[0]) + d[1] * (p[1] - a[1])) / square;
        let left = a[0].min(b[0]) - ON;
        let right = a[0].max(b[0]) + ON;
        self.cells.along([a, b], |cell| {
            for &i in self.cells.edges_of(cell) {
                let [p, q] = self.edges[i as usize];
                if p[0].max(q[0]) < left || p[0].min(q[0]) > right {
                    continue;
                }
                let sp = side(p);
                let sq = side(q);
                if (sp < 0.0) != (sq < 0.0) {
                    let f = sp / (sp - sq);
                    ts.push(along([p[0] + f * (q[0] - p[0]), p[1] + f * (q[1] - p[1])]));
                }
                // An edge along the segment does not cross it: the segment lies on the border between the ends of it.
                ts.extend([(sp, p), (sq, q)].into_iter().filter(|(s, _)| s.abs() < ON).map(|(_, p)| along(p)));
            }
        });
        ts.retain(|t| (0.0..=1.0).contains(t));
        ts.sort_unstable_by(f64::total_cmp);
        ts.dedup();
    }

    /// Whether the area holds a point; None for one on its border.
    pub(in crate::texture) fn holds(&self, p: PlanePoint) -> Option<bool> {
        let BoxMm { lo, hi } = self.cells.bounds;
        if (0..2).any(|k| p[k] < lo[k] - ON || p[k] > hi[k] + ON) {
            return Some(false);
        }
        let row = self.cells.index(1, p[1]);
        let mut inside = false;
        // The rule evenodd on a ray from the point to the right; an edge that lies in several cells is counted where it
        // is crossed.
        for column in self.cells.index(0, p[0] - 2.0 * ON)..self.cells.count[0] {
            for &i in self.cells.edges_of(row * self.cells.count[0] + column) {
                let [a, b] = self.edges[i as usize];
                if distance(p, [a, b]) < ON {
                    return None;
                }
                if (a[1] <= p[1]) != (b[1] <= p[1]) {
                    let x = a[0] + (p[1] - a[1]) / (b[1] - a[1]) * (b[0] - a[0]);
                    if x > p[0] && self.cells.index(0, x) == column {
                        inside = !inside;
                    }
                }
            }
        }
        Some(inside)
    }
}

/// Edges in the cells of a grid over their box: in all cells nearer than a distance to them.
#[derive(Debug)]
pub(in crate::texture) struct Cells {
    pub(in crate::texture) bounds: BoxMm<2>,
    /// Columns and rows.
    pub(in crate::texture) count: [usize; 2],
    step: [f64; 2],
    /// How far from its edges a cell lies at most.
    reach: f64,
    /// Where the edges of a cell begin.
    starts: Vec<u32>,
    list: Vec<u32>,
}

impl Cells {
    pub(in crate::texture) fn new(edges: &[[PlanePoint; 2]], count: [usize; 2], reach: f64) -> Self {
        let bounds = BoxMm::of(edges.iter().flatten().copied());
        let step = [0, 1].map(|k| ((bounds.hi[k] - bounds.lo[k]) / count[k] as f64).max(ON));
        let mut cells = Self { bounds, count, step, reach, starts: vec![0; count[0] * count[1] + 1], list: Vec::new() };
        if edges.is_empty() {
            return cells;
        }
        let mut entries: Vec<(u32, u32)> = Vec::new();
        for (i, edge) in edges.iter().enumerate() {
            cells.near(*edge, reach, |cell| entries.push((cell as u32, i as u32)));
        }
        // A sort by cell that counts: how many edges each cell has, where they begin, and each into its place.
        entries.iter().for_each(|&(cell, _)| cells.starts[cell as usize + 1] += 1);
        for cell in 1..cells.starts.len() {
            cells.starts[cell] += cells.starts[cell - 1];
        }
        let mut next = cells.starts.clone();
        cells.list = vec![0; entries.len()];
        for (cell, edge) in entries {
            let at = &mut next[cell as usize];
            cells.list[*at as usize] = edge;
            *at += 1;
        }
        cells
    }

    /// The edges of a cell.
    pub(in crate::texture) fn edges_of(&self, cell: usize) -> &[u32] {
        &self.list[self.starts[cell] as usize..self.starts[cell + 1] as usize]
    }

    /// The column or row of a coordinate; the outermost for one beyond the grid.
    pub(in crate::texture) fn index(&self, axis: usize, v: f64) -> usize {
        ((v - self.bounds.lo[axis]) / self.step[axis]).clamp(0.0, self.count[axis] as f64 - 1.0) as usize
    }

    /// The middle of a cell.
    pub(in crate::texture) fn centre(&self, cell: usize) -> PlanePoint {
        let at = [cell % self.count[0], cell / self.count[0]];
        [0, 1].map(|k| self.bounds.lo[k] + (at[k] as f64 + 0.5) * self.step[k])
    }

    /// Whether the grid covers all of a box.
    pub(in crate::texture) fn holds_box(&self, bounds: BoxMm<2>) -> bool {
        (0..2).all(|k| self.bounds.lo[k] <= bounds.lo[k] && bounds.hi[k] <= self.bounds.hi[k])
    }

    /// Whether a box lies beyond the reach of all edges.
    pub(in crate::texture) fn is_far(&self, lo: PlanePoint, hi: PlanePoint) -> bool {
        let BoxMm { lo: l, hi: h } = self.bounds;
        (0..2).any(|k| hi[k] < l[k] - self.reach || lo[k] > h[k] + self.reach)
    }

    /// The cells that hold the edges within reach of a segment, row by row.
    pub(in crate::texture) fn along(&self, [a, b]: [PlanePoint; 2], f: impl FnMut(usize)) {
        let lo = [0, 1].map(|k| a[k].min(b[k]));
        let hi = [0, 1].map(|k| a[k].max(b[k]));
        if !self.is_far(lo, hi) {
            self.near([a, b], 2.0 * ON, f);
        }
    }

    /// The cells within `by` of a segment along x and y.
    fn near(&self, [a, b]: [PlanePoint; 2], by: f64, mut f: impl FnMut(usize)) {
        let rows = self.index(1, a[1].min(b[1]) - by)..=self.index(1, a[1].max(b[1]) + by);
        let [dx, dy] = [b[0] - a[0], b[1] - a[1]];
        for row in rows {
            // The stretch of the segment that lies in the row.
            let low = self.bounds.lo[1] + row as f64 * self.step[1];
            let band = [
                if row == 0 { f64::NEG_INFINITY } else { low - by },
                if row + 1 == self.count[1] { f64::INFINITY } else { low + self.step[1] + by },
            ];
            let ends =
                if dy == 0.0 { [a[0], b[0]] } else { band.map(|y| a[0] + ((y - a[1]) / dy).clamp(0.0, 1.0) * dx) };
            let columns = self.index(0, ends[0].min(ends[1]) - by)..=self.index(0, ends[0].max(ends[1]) + by);
            columns.for_each(|column| f(row * self.count[0] + column));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::texture::artwork::{PolygonArea, WindingRule};

    fn pieces(line: &[PlanePoint], keep: Keep) -> Vec<Vec<PlanePoint>> {
        let ring: [&[PlanePoint]; 2] =
            [&[[0.0, 0.0], [9.0, 0.0], [9.0, 9.0], [0.0, 9.0]], &[[3.0, 3.0], [6.0, 3.0], [6.0, 6.0], [3.0, 6.0]]];
        let area = PolygonArea::new(ring.into_iter(), WindingRule::EvenOdd).expect("few");
        let mut out = Polylines::default();
        area.cutter().cut(line, keep, &mut out);
        out.iter().map(|l| l.iter().map(|p| p.map(|v| (v * 1e5).round() / 1e5)).collect()).collect()
    }

    #[test]
    fn lines_are_cut_at_a_ring() {
        let through = [[-1.0, 4.0], [10.0, 4.0]];
        assert_eq!(pieces(&through, Keep::Inside), [[[0.0, 4.0], [3.0, 4.0]], [[6.0, 4.0], [9.0, 4.0]]]);
        let outside = [[[-1.0, 4.0], [0.0, 4.0]], [[3.0, 4.0], [6.0, 4.0]], [[9.0, 4.0], [10.0, 4.0]]];
        assert_eq!(pieces(&through, Keep::Outside), outside);
        // A line on the border belongs to the area.
        let border = [[-1.0, 0.0], [4.0, 0.0]];
        assert_eq!(pieces(&border, Keep::Inside), [[[0.0, 0.0], [4.0, 0.0]]]);
        assert_eq!(pieces(&border, Keep::Outside), [[[-1.0, 0.0], [0.0, 0.0]]]);
    }

    #[test]
    fn a_closed_line_is_not_divided_at_its_first_point() {
        let square = [[1.0, 1.0], [1.0, -1.0], [-1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]];
        assert_eq!(pieces(&square, Keep::Inside), [[[0.0, 1.0], [1.0, 1.0], [1.0, 0.0]]]);
        let inner = [[1.0, 1.0], [2.0, 1.0], [2.0, 2.0], [1.0, 1.0]];
        assert_eq!(pieces(&inner, Keep::Inside), [inner.to_vec()]);
    }
}
