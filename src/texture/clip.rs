//! Polylines in mm, and what is left of one in a rectangle.

use super::place::{LEAST, NM};
use crate::geom::BoxMm;

/// A point may miss the border by this much, mm, and still lies in the rectangle: it is moved onto it.
/// Without it the noise of f64 would cut figures that touch the border.
const SLACK: f64 = 0.5 * NM;

/// Polylines in one flat array, mm.
#[derive(Debug, Default)]
pub(super) struct Lines {
    pub(super) points: Vec<[f64; 2]>,
    /// z of every point of lines in space; empty for flat ones.
    heights: Vec<f64>,
    is_spatial: bool,
    ends: Vec<usize>,
}

impl Lines {
    /// Lines that keep z.
    pub(super) fn in_space() -> Self {
        Self { is_spatial: true, ..Self::default() }
    }

    pub(super) fn is_spatial(&self) -> bool {
        self.is_spatial
    }

    /// z of the points of line `i`, mm; empty for flat lines.
    pub(super) fn heights(&self, i: usize) -> &[f64] {
        if self.is_spatial { &self.heights[self.start(i)..self.ends[i]] } else { &[] }
    }

    /// Continues the line that is not finished yet, unless it ends in this point; flat lines leave out z.
    pub(super) fn put(&mut self, [x, y, z]: [f64; 3]) {
        let tail = self.tail();
        let stays = self.points[tail..].last() == Some(&[x, y]);
        if self.is_spatial {
            if stays && self.heights.last() == Some(&z) {
                return;
            }
            self.heights.push(z);
        } else if stays {
            return;
        }
        self.points.push([x, y]);
    }

    pub(super) fn len(&self) -> usize {
        self.ends.len()
    }

    pub(super) fn get(&self, i: usize) -> &[[f64; 2]] {
        &self.points[self.start(i)..self.ends[i]]
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = &[[f64; 2]]> {
        (0..self.len()).map(|i| self.get(i))
    }

    /// Where the points after the last finished line begin.
    pub(super) fn tail(&self) -> usize {
        self.start(self.len())
    }

    /// Ends the line that the points after the last one make.
    pub(super) fn finish(&mut self) {
        self.ends.push(self.points.len());
    }

    pub(super) fn push(&mut self, line: &[[f64; 2]]) {
        self.points.extend_from_slice(line);
        self.finish();
    }

    /// Takes back the lines from `count` on, and what was begun.
    pub(super) fn truncate(&mut self, count: usize) {
        let start = self.start(count);
        self.points.truncate(start);
        self.heights.truncate(start);
        self.ends.truncate(count);
    }

    pub(super) fn clear(&mut self) {
        self.points.clear();
        self.heights.clear();
        self.ends.clear();
    }

    fn start(&self, i: usize) -> usize {
        if i == 0 { 0 } else { self.ends[i - 1] }
    }
}

/// Width and height of the points' box; zero for none.
pub(super) fn extent(points: &[[f64; 2]]) -> [f64; 2] {
    BoxMm::of(points.iter().copied()).size().map(|side| side.max(0.0))
}

/// Whether the polyline ends where it starts.
pub(super) fn is_closed(points: &[[f64; 2]]) -> bool {
    points.len() > 2 && points.first() == points.last()
}

/// Whether a figure is closed and all its points lie between two lines nearer to each other than the
/// tolerance: it would be marked as one line, twice.
pub(super) fn is_hairline(line: &[[f64; 2]], tolerance: f64) -> bool {
    if !is_closed(line) {
        return false;
    }
    let [x, y] = line[0];
    let away = |p: &[f64; 2]| (p[0] - x).hypot(p[1] - y);
    let far = line.iter().copied().fold(line[0], |far, p| if away(&p) > away(&far) { p } else { far });
    let length = away(&far);
    let sides = line.iter().map(|p| ((far[0] - x) * (p[1] - y) - (far[1] - y) * (p[0] - x)) / length);
    let (lo, hi) = sides.fold((0.0_f64, 0.0_f64), |(lo, hi), s| (lo.min(s), hi.max(s)));
    hi - lo < tolerance
}

/// Whether the whole polyline lies in the rectangle, borders included.
pub(super) fn is_inside(points: &[[f64; 2]], rect: BoxMm<2>) -> bool {
    points.iter().all(|&p| holds(rect, p))
}

fn holds(BoxMm { lo, hi }: BoxMm<2>, p: [f64; 2]) -> bool {
    (0..2).all(|a| lo[a] - SLACK <= p[a] && p[a] <= hi[a] + SLACK)
}

fn onto(BoxMm { lo, hi }: BoxMm<2>, p: [f64; 2]) -> [f64; 2] {
    [0, 1].map(|a| p[a].clamp(lo[a], hi[a]))
}

/// Appends the pieces of a polyline that lie in the rectangle, borders included, in its direction. A polyline wholly
/// inside stays as it is, closed figures too; of a closed figure that is cut no piece is divided at its first point.
/// Pieces too short to mark are left out.
pub(super) fn clip(points: &[[f64; 2]], rect: BoxMm<2>, out: &mut Lines) {
    let first_outside = points.iter().position(|&p| !holds(rect, p));
    let Some(first_outside) = first_outside else {
        out.points.extend(points.iter().map(|&p| onto(rect, p)));
        out.finish();
        return;
    };
    if is_closed(points) {
        // Going round from a point outside, so that no piece runs over the start.
        let n = points.len() - 1;
        let ring = |k: usize| points[(first_outside + k) % n];
        pieces((0..n).map(|k| [ring(k), ring(k + 1)]), rect, out);
    } else {
        pieces(points.windows(2).map(|w| [w[0], w[1]]), rect, out);
    }
}

/// What a rectangle holds of a contour, as one contour that may run along the rectangle's border: how often it goes
/// round a point inside stays the same.
pub(super) fn clip_contour(contour: &[[f64; 2]], BoxMm { lo, hi }: BoxMm<2>) -> Vec<[f64; 2]> {
    let mut ring = contour.to_vec();
    for (axis, limit, sign) in [(0, lo[0], 1.0), (0, hi[0], -1.0), (1, lo[1], 1.0), (1, hi[1], -1.0)] {
        let inside = |p: [f64; 2]| sign * (p[axis] - limit) >= 0.0;
        let mut kept = Vec::with_capacity(ring.len());
        for (k, &p) in ring.iter().enumerate() {
            let q = ring[(k + 1) % ring.len()];
            if inside(p) {
                kept.push(p);
            }
            if inside(p) != inside(q) {
                let t = (limit - p[axis]) / (q[axis] - p[axis]);
                let mut cut = [0, 1].map(|k| p[k] + t * (q[k] - p[k]));
                cut[axis] = limit;
                kept.push(cut);
            }
        }
        ring = kept;
    }
    ring
}

fn pieces(segments: impl Iterator<Item = [[f64; 2]; 2]>, rect: BoxMm<2>, out: &mut Lines) {
    let snapped = |p: [f64; 2]| if holds(rect, p) { onto(rect, p) } else { p };
    for [a, b] in segments.map(|s| s.map(snapped)) {
        let Some([t0, t1]) = inside(a, b, rect) else {
            end_piece(out);
            continue;
        };
        let at = |t: f64| onto(rect, [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])]);
        if t0 > 0.0 {
            end_piece(out);
        }
        if out.points.len() == out.tail() {
            out.points.push(at(t0));
        }
        out.points.push(if t1 == 1.0 { b } else { at(t1) });
        if t1 < 1.0 {
            end_piece(out);
        }
    }
    end_piece(out);
}

fn end_piece(out: &mut Lines) {
    let tail = out.tail();
    let [w, h] = extent(&out.points[tail..]);
    if w.max(h) < LEAST {
        out.points.truncate(tail);
    } else {
        out.finish();
    }
}

/// The parameters between which the segment lies in the rectangle (Liang and Barsky).
fn inside(a: [f64; 2], b: [f64; 2], rect: BoxMm<2>) -> Option<[f64; 2]> {
    let (mut t0, mut t1) = (0.0_f64, 1.0_f64);
    for axis in 0..2 {
        let (lo, hi) = (rect.lo[axis], rect.hi[axis]);
        let d = b[axis] - a[axis];
        if d == 0.0 {
            if a[axis] < lo || a[axis] > hi {
                return None;
            }
            continue;
        }
        let (ta, tb) = ((lo - a[axis]) / d, (hi - a[axis]) / d);
        t0 = t0.max(ta.min(tb));
        t1 = t1.min(ta.max(tb));
    }
    (t0 <= t1).then_some([t0, t1])
}

#[cfg(test)]
mod tests {
    use super::*;

    const UNIT: BoxMm<2> = BoxMm::rectangle(0.0, 0.0, 10.0, 10.0);

    fn clipped(points: &[[f64; 2]]) -> Vec<Vec<[f64; 2]>> {
        let mut out = Lines::default();
        clip(points, UNIT, &mut out);
        out.iter().map(<[_]>::to_vec).collect()
    }

    #[test]
    fn pieces_are_joined_and_borders_kept() {
        let bent = [[-5.0, 5.0], [5.0, 5.0], [5.0, 8.0], [5.0, 20.0]];
        assert_eq!(clipped(&bent), [vec![[0.0, 5.0], [5.0, 5.0], [5.0, 8.0], [5.0, 10.0]]]);
        assert_eq!(clipped(&[[-1.0, 10.0], [11.0, 10.0]]).len(), 1, "a line on the border is marked");
        assert!(clipped(&[[-1.0, 11.0], [1.0, 11.0]]).is_empty());
        assert!(clipped(&[[-5.0, 5.0], [0.0, 10.0], [-5.0, 15.0]]).is_empty(), "touching a corner is not a mark");
    }

    #[test]
    fn closed_figures_stay_closed_or_are_cut_only_at_the_border() {
        let square = [[2.0, 2.0], [4.0, 2.0], [4.0, 4.0], [2.0, 4.0], [2.0, 2.0]];
        assert_eq!(clipped(&square), [square.to_vec()]);
        let touching = square.map(|p| [(p[0] - 2.0) * 5.0, (p[1] - 2.0) * 5.0 + 1e-12]);
        assert_eq!(clipped(&touching).len(), 1);
        assert!(is_closed(&clipped(&touching)[0]), "noise on the border cuts nothing");
        // Starts inside and leaves over the right border: one piece, not two.
        let over = square.map(|p| [p[0] + 7.0, p[1]]);
        let cut = clipped(&over);
        assert_eq!(cut.len(), 1);
        assert_eq!((cut[0].len(), cut[0][0][0], cut[0][3][0]), (4, 10.0, 10.0));
    }

    #[test]
    fn zigzag_is_clipped_into_its_pieces() {
        let zigzag: Vec<[f64; 2]> =
            (0..20).map(|i| [0.4 * f64::from(i), if i % 2 == 0 { 5.0 } else { 15.0 }]).collect();
        let cut = clipped(&zigzag);
        assert_eq!(cut.len(), 10);
        let length: f64 =
            cut.iter().flat_map(|p| p.windows(2)).map(|w| (w[1][0] - w[0][0]).hypot(w[1][1] - w[0][1])).sum();
        assert!((length - 19.0 * 0.5 * 0.4_f64.hypot(10.0)).abs() < 1e-5, "{length}");
    }
}
