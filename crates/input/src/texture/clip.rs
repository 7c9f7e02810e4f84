//! Polylines in mm, and what is left of one in a rectangle.

use super::place::{LEAST, NM};
use terrace_core::geom::BoxMm;
use terrace_core::math;

/// A point may miss the border by this much, mm, and still lies in the rectangle: it is moved onto it.
/// Without it the noise of f64 would cut figures that touch the border.
const SLACK: f64 = 0.5 * NM;

/// Polylines in one flat array, mm.
#[derive(Debug, Default)]
pub(super) struct Polylines {
    pub(super) points: Vec<[f64; 2]>,
    /// z of every point of lines in space; empty for flat ones.
    heights: Vec<f64>,
    is_spatial: bool,
    ends: Vec<usize>,
}

impl Polylines {
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

    /// Replaces flat lines from `first` on that run there and back by the line that they run along, see
    /// [`traced_twice`].
    pub(super) fn trace_once(&mut self, first: usize, tolerance: f64) {
        let once: Vec<_> = (first..self.len()).map(|i| traced_twice(self.get(i), tolerance)).collect();
        if self.is_spatial || once.iter().all(Option::is_none) {
            return;
        }
        let lines: Vec<_> =
            once.into_iter().zip(first..).map(|(once, i)| once.unwrap_or_else(|| self.get(i).to_vec())).collect();
        self.truncate(first);
        lines.iter().for_each(|line| self.push(line));
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
    is_closed(line) && strip(line).width < tolerance
}

/// A straight strip about a figure, along the line from its first point to the one farthest from that.
struct Strip {
    /// Distance of its sides, mm.
    width: f64,
    /// The places of the points that lie nearest to its two ends.
    ends: [usize; 2],
}

fn strip(line: &[[f64; 2]]) -> Strip {
    let [x, y] = line[0];
    let away = |p: &[f64; 2]| math::hypot(p[0] - x, p[1] - y);
    let far = line.iter().copied().fold(line[0], |far, p| if away(&p) > away(&far) { p } else { far });
    let length = away(&far);
    let [dx, dy] = [(far[0] - x) / length, (far[1] - y) / length];
    let mut lo = 0.0_f64;
    let mut hi = 0.0_f64;
    let mut ends = [(0.0, 0); 2];
    for (k, p) in line.iter().enumerate() {
        let along = dx * (p[0] - x) + dy * (p[1] - y);
        let across = dx * (p[1] - y) - dy * (p[0] - x);
        lo = lo.min(across);
        hi = hi.max(across);
        ends[0] = if along < ends[0].0 { (along, k) } else { ends[0] };
        ends[1] = if along > ends[1].0 { (along, k) } else { ends[1] };
    }
    Strip { width: hi - lo, ends: ends.map(|(_, k)| k) }
}

/// Most vertices of a figure that are tried as the end of a line: a line that runs back and forth on its way has more
/// turns than ends, and none is drawn with so many.
const MAX_TURNS: usize = 16;

/// The open line that a closed polyline runs along there and back, within the tolerance, wherever it begins: it is to
/// be marked once. None where the figure is open or encloses something. The line has points of the figure, and runs the
/// way in which the figure reaches its first end and then its second. Cost: the number of points, at most [`MAX_TURNS`]
/// times.
pub(super) fn traced_twice(line: &[[f64; 2]], tolerance: f64) -> Option<Vec<[f64; 2]>> {
    if !is_closed(line) {
        return None;
    }
    let strip = strip(line);
    if strip.width < tolerance {
        let [a, b] = strip.ends;
        return (a != b).then(|| vec![line[a.min(b)], line[a.max(b)]]);
    }
    let ring = &line[..line.len() - 1];
    let turns = (0..ring.len()).filter(|&k| turns_back(ring, k, tolerance));
    turns.take(MAX_TURNS).find_map(|k| halves(ring, k, tolerance))
}

/// Whether a ring leaves a vertex along the edge that it came by.
fn turns_back(ring: &[[f64; 2]], k: usize, tolerance: f64) -> bool {
    let n = ring.len();
    let at = ring[k];
    let before = ring[(k + n - 1) % n];
    let after = ring[(k + 1) % n];
    let ahead = (before[0] - at[0]) * (after[0] - at[0]) + (before[1] - at[1]) * (after[1] - at[1]);
    // Where edges are shorter than the tolerance, every vertex is near its neighbours.
    ahead > 0.0 && (distance(before, [at, after]) <= tolerance || distance(after, [at, before]) <= tolerance)
}

/// The way from vertex `turn` of a ring to where the ring turns back, if both ways there are one. They are followed
/// side by side: of the two next vertices the one that the other way passes first must lie on it. The ways may have
/// their vertices at different places.
fn halves(ring: &[[f64; 2]], turn: usize, tolerance: f64) -> Option<Vec<[f64; 2]>> {
    let n = ring.len();
    let forth = |i: usize| ring[(turn + i) % n];
    let back = |j: usize| ring[(turn + n - j) % n];
    // The next vertices of both ways; what was passed of one lies within the tolerance of the other. The last step
    // joins them, where all vertices have been passed.
    let mut i = 1;
    let mut j = 1;
    while i + j < n {
        let next = forth(i);
        let other = back(j);
        if distance(next, [back(j - 1), other]) <= tolerance {
            i += 1;
        } else if distance(other, [forth(i - 1), next]) <= tolerance {
            j += 1;
        } else {
            return None;
        }
    }
    Some((0..=i).map(forth).collect())
}

/// Distance of a point from a segment.
pub(super) fn distance(p: [f64; 2], [a, b]: [[f64; 2]; 2]) -> f64 {
    let d = [b[0] - a[0], b[1] - a[1]];
    let v = [p[0] - a[0], p[1] - a[1]];
    let square = d[0] * d[0] + d[1] * d[1];
    let t = if square > 0.0 { ((d[0] * v[0] + d[1] * v[1]) / square).clamp(0.0, 1.0) } else { 0.0 };
    math::hypot(v[0] - t * d[0], v[1] - t * d[1])
}

/// Whether the whole polyline lies in the rectangle, borders included.
pub(super) fn is_inside(points: &[[f64; 2]], rect: BoxMm<2>) -> bool {
    points.iter().all(|&p| holds(rect, p))
}

/// Whether a point lies in the rectangle, but for the slack.
fn holds(BoxMm { lo, hi }: BoxMm<2>, p: [f64; 2]) -> bool {
    (0..2).all(|a| lo[a] - SLACK <= p[a] && p[a] <= hi[a] + SLACK)
}

/// The point of the rectangle nearest to a point.
fn onto(BoxMm { lo, hi }: BoxMm<2>, p: [f64; 2]) -> [f64; 2] {
    [0, 1].map(|a| p[a].clamp(lo[a], hi[a]))
}

/// Appends the pieces of a polyline that lie in the rectangle, borders included, in its direction. A polyline wholly
/// inside stays as it is, closed figures too; of a closed figure that is cut no piece is divided at its first point.
/// Pieces too short to mark are left out.
pub(super) fn clip(points: &[[f64; 2]], rect: BoxMm<2>, out: &mut Polylines) {
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
    // Side by side of the rectangle (Sutherland and Hodgman).
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

/// Appends the pieces of consecutive segments that lie in the rectangle.
fn pieces(segments: impl Iterator<Item = [[f64; 2]; 2]>, rect: BoxMm<2>, out: &mut Polylines) {
    let snapped = |p: [f64; 2]| if holds(rect, p) { onto(rect, p) } else { p };
    for [a, b] in segments.map(|s| s.map(snapped)) {
        let Some([t0, t1]) = stretch_inside(a, b, rect) else {
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

/// Ends the piece that was begun, or drops it where it is too short to be marked.
fn end_piece(out: &mut Polylines) {
    let tail = out.tail();
    let [w, h] = extent(&out.points[tail..]);
    if w.max(h) < LEAST {
        out.points.truncate(tail);
    } else {
        out.finish();
    }
}

/// The parameters between which the segment lies in the rectangle (Liang and Barsky).
fn stretch_inside(a: [f64; 2], b: [f64; 2], rect: BoxMm<2>) -> Option<[f64; 2]> {
    let mut t0 = 0.0_f64;
    let mut t1 = 1.0_f64;
    for axis in 0..2 {
        let lo = rect.lo[axis];
        let hi = rect.hi[axis];
        let d = b[axis] - a[axis];
        if d == 0.0 {
            if a[axis] < lo || a[axis] > hi {
                return None;
            }
            continue;
        }
        let ta = (lo - a[axis]) / d;
        let tb = (hi - a[axis]) / d;
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
        let mut out = Polylines::default();
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
    fn a_line_there_and_back_is_one_line() {
        let once = |points: &[[f64; 2]]| traced_twice(points, 1e-3);
        let bent = [[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [6.0, 3.0]];
        // There and back by the same points, from each of them.
        let mut ring: Vec<_> = bent.iter().chain(bent[1..3].iter().rev()).copied().collect();
        for _ in 0..ring.len() {
            let closed: Vec<_> = ring.iter().chain(ring.first()).copied().collect();
            let found = once(&closed).expect("one line");
            assert!(found == bent || found.iter().rev().eq(&bent), "{closed:?}: {found:?}");
            ring.rotate_left(1);
        }
        // The way back has points of its own, and lies beside the way there by less than the tolerance.
        let back = [[6.0, 3.0], [5.0, 3.0], [4.0004, 2.9996], [4.0, 1.0], [3.9996, 0.0003], [1.0, 0.0], [0.0, 0.0]];
        let closed: Vec<_> = bent.iter().chain(&back[1..]).copied().collect();
        assert_eq!(once(&closed).expect("one line"), bent);
        // Straight lines, closed at an end, in between, and run along more often.
        for (closed, want) in [
            (vec![[1.0, 1.0], [9.0, 1.0], [1.0, 1.0]], [[1.0, 1.0], [9.0, 1.0]]),
            (vec![[5.0, 1.0], [9.0, 1.0], [1.0, 1.0], [5.0, 1.0]], [[9.0, 1.0], [1.0, 1.0]]),
            (vec![[0.0, 0.0], [6.0, 8.0], [3.0, 4.0004], [0.0, 0.0]], [[0.0, 0.0], [6.0, 8.0]]),
            (vec![[0.0, 0.0], [5.0, 0.0], [2.0, 0.0], [9.0, 0.0], [0.0, 0.0]], [[0.0, 0.0], [9.0, 0.0]]),
        ] {
            assert_eq!(once(&closed).expect("one line"), want, "{closed:?}");
        }
    }

    #[test]
    fn figures_that_enclose_something_and_open_lines_are_not_traced_twice() {
        let arc = |k: i32| math::sin_cos(f64::from(k) * 1e-4);
        let dense: Vec<[f64; 2]> = (0..=62_832).map(|k| [arc(k).1, arc(k).0]).chain([[1.0, 0.0]]).collect();
        for line in [
            vec![[0.0, 0.0], [9.0, 0.0], [9.0, 0.002], [0.0, 0.0]],
            vec![[0.0, 0.0], [9.0, 0.0], [9.0, 9.0], [0.0, 9.0], [0.0, 0.0]],
            // A stem with a loop, and one with a spur on the way there alone.
            vec![[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [8.0, 4.0], [8.0, 0.0], [4.0, 0.0], [0.0, 0.0]],
            vec![[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [4.0, 0.0], [4.0, -3.0], [4.0, 0.0], [0.0, 0.0]],
            vec![[0.0, 0.0], [9.0, 0.0], [0.0, 0.1]],
            vec![[3.0, 3.0], [3.0, 3.0], [3.0, 3.0]],
            vec![[3.0, 3.0]],
            vec![],
            dense,
        ] {
            assert_eq!(traced_twice(&line, 1e-3), None, "{:?}", line.get(..9));
        }
    }

    #[test]
    fn zigzag_is_clipped_into_its_pieces() {
        let zigzag: Vec<[f64; 2]> =
            (0..20).map(|i| [0.4 * f64::from(i), if i % 2 == 0 { 5.0 } else { 15.0 }]).collect();
        let cut = clipped(&zigzag);
        assert_eq!(cut.len(), 10);
        let length: f64 =
            cut.iter().flat_map(|p| p.windows(2)).map(|w| math::hypot(w[1][0] - w[0][0], w[1][1] - w[0][1])).sum();
        assert!((length - 19.0 * 0.5 * math::hypot(0.4, 10.0)).abs() < 1e-5, "{length}");
    }
}
