//! Lines cut at the border of an area.

use super::crossings::edges;
use crate::geom::BoxMm;
use crate::texture::clip::{Lines, extent, is_closed};
use crate::texture::place::{LEAST, NM};

type Point = [f64; 2];

/// A line that lies nearer to the border of the area than this lies on it, mm.
const ON: f64 = 2.0 * NM;

/// Most rows of the index.
const MAX_ROWS: usize = 4096;

/// Which side of the area's border is kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Keep {
    /// What lies inside or on the border.
    Inside,
    /// What lies outside, without the border.
    Outside,
}

/// The edges of an area in rows of equal height.
pub(super) struct Cutter {
    edges: Vec<[Point; 2]>,
    rows: Vec<Vec<u32>>,
    bounds: BoxMm<2>,
    step: f64,
}

impl Cutter {
    /// The contours of an area bound it by the rule evenodd.
    pub(super) fn new<'a>(contours: impl Iterator<Item = &'a Vec<Point>>) -> Self {
        let edges: Vec<_> = contours.flat_map(|c| edges(c)).collect();
        let bounds = BoxMm::of(edges.iter().flatten().copied());
        let count = (edges.len() / 2).clamp(1, MAX_ROWS);
        let step = ((bounds.hi[1] - bounds.lo[1]) / count as f64).max(ON);
        let mut cutter = Self { edges, rows: vec![Vec::new(); count], bounds, step };
        for (i, [a, b]) in cutter.edges.iter().enumerate() {
            let rows = cutter.rows_between(a[1].min(b[1]), a[1].max(b[1]));
            cutter.rows[rows].iter_mut().for_each(|row| row.push(i as u32));
        }
        cutter
    }

    /// The rows that hold what lies between two heights.
    fn rows_between(&self, lo: f64, hi: f64) -> std::ops::Range<usize> {
        let row = |y: f64| ((y - self.bounds.lo[1]) / self.step).clamp(0.0, self.rows.len() as f64 - 1.0) as usize;
        row(lo - 2.0 * ON)..row(hi + 2.0 * ON) + 1
    }

    /// Appends the pieces of a polyline on the side that is kept, in its direction. Of a closed one no piece is divided
    /// at its first point unless it is whole.
    pub(super) fn cut(&self, line: &[Point], keep: Keep, out: &mut Lines) {
        if let [dot] = line {
            if self.holds(*dot).unwrap_or(true) == (keep == Keep::Inside) {
                out.push(line);
            }
            return;
        }
        let mut pieces: Vec<Vec<Point>> = Vec::new();
        let (mut is_open, mut ts) = (false, Vec::new());
        for side in line.windows(2) {
            let (a, b) = (side[0], side[1]);
            let at = |t: f64| [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])];
            self.crossings([a, b], &mut ts);
            for t in ts.windows(2) {
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

    /// The parameters, from 0 to 1, between which the segment lies on one side.
    fn crossings(&self, [a, b]: [Point; 2], ts: &mut Vec<f64>) {
        ts.clear();
        ts.extend([0.0, 1.0]);
        let d = [b[0] - a[0], b[1] - a[1]];
        let square = d[0] * d[0] + d[1] * d[1];
        if square == 0.0 {
            ts.truncate(1);
            return;
        }
        let side = |p: Point| (d[0] * (p[1] - a[1]) - d[1] * (p[0] - a[0])) / square.sqrt();
        let along = |p: Point| (d[0] * (p[0] - a[0]) + d[1] * (p[1] - a[1])) / square;
        let (left, right) = (a[0].min(b[0]) - ON, a[0].max(b[0]) + ON);
        for row in &self.rows[self.rows_between(a[1].min(b[1]), a[1].max(b[1]))] {
            for &i in row {
                let [p, q] = self.edges[i as usize];
                if p[0].max(q[0]) < left || p[0].min(q[0]) > right {
                    continue;
                }
                let (sp, sq) = (side(p), side(q));
                if (sp < 0.0) != (sq < 0.0) {
                    let f = sp / (sp - sq);
                    ts.push(along([p[0] + f * (q[0] - p[0]), p[1] + f * (q[1] - p[1])]));
                }
                ts.extend([(sp, p), (sq, q)].into_iter().filter(|(s, _)| s.abs() < ON).map(|(_, p)| along(p)));
            }
        }
        ts.retain(|t| (0.0..=1.0).contains(t));
        ts.sort_unstable_by(f64::total_cmp);
        ts.dedup();
    }

    /// Whether the area holds a point; None for one on its border.
    fn holds(&self, p: Point) -> Option<bool> {
        let BoxMm { lo, hi } = self.bounds;
        if (0..2).any(|k| p[k] < lo[k] - ON || p[k] > hi[k] + ON) {
            return Some(false);
        }
        let row = &self.rows[self.rows_between(p[1], p[1]).start];
        let mut inside = false;
        for &i in row {
            let [a, b] = self.edges[i as usize];
            if distance(p, [a, b]) < ON {
                return None;
            }
            if (a[1] <= p[1]) != (b[1] <= p[1]) && a[0] + (p[1] - a[1]) / (b[1] - a[1]) * (b[0] - a[0]) > p[0] {
                inside = !inside;
            }
        }
        Some(inside)
    }
}

/// Distance of a point from a segment.
fn distance(p: Point, [a, b]: [Point; 2]) -> f64 {
    let (d, v) = ([b[0] - a[0], b[1] - a[1]], [p[0] - a[0], p[1] - a[1]]);
    let square = d[0] * d[0] + d[1] * d[1];
    let t = if square > 0.0 { ((d[0] * v[0] + d[1] * v[1]) / square).clamp(0.0, 1.0) } else { 0.0 };
    (v[0] - t * d[0]).hypot(v[1] - t * d[1])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::texture::artwork::{Area, Rule};

    fn pieces(line: &[Point], keep: Keep) -> Vec<Vec<Point>> {
        let ring: [&[Point]; 2] =
            [&[[0.0, 0.0], [9.0, 0.0], [9.0, 9.0], [0.0, 9.0]], &[[3.0, 3.0], [6.0, 3.0], [6.0, 6.0], [3.0, 6.0]]];
        let area = Area::new(ring.into_iter(), Rule::EvenOdd).expect("few");
        let mut out = Lines::default();
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
