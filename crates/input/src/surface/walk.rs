//! The walk: a straight stroke segment in, its exact height as a piecewise linear function out.
//!
//! Where one sheet lies free under the lens the walk goes from facet to facet: the exit edge follows
//! from exact orientation signs of the corners against the segment, with ties broken as if the
//! segment were shifted by an infinitesimal (ε, ε²), so that a segment along an edge or through a
//! vertex meets exactly one facet at a time and never gets lost. Near rims and where several sheets
//! overlap, all facets under the stretch are cut with it, borders included, and the topmost is taken; along an edge
//! that is what is topmost beside it ([`Sheets::take`]).
//!
//! Promise: the spans of a segment tile its parameter range [0, 1] without overlap; a span without
//! facet is a gap (no part there). Heights of neighbouring spans on one sheet agree to rounding;
//! where they do not, the sheet changes or a wall stands upright. Gaps narrower than half a
//! nanometre, which the grid of the program cannot hold, are closed.
//!
//! Cost: one orientation per edge crossed in the free walk.

use super::bins::Class;
use super::mesh::{NONE, Vertex};
use super::topmost::{Hit, ProfilePoint, Sheets, Side, Span, height_between, push_gap, push_span, seal};
use super::vertex::FacetCorner;
pub(super) use super::vertex::ON_RIM;
use super::{Kind, Surface};
use terrace_core::geom::{P2, normal, orient, slope2};

/// Where the last segment ended, so that the next one starts there; and the walk's scratch space.
#[derive(Debug)]
pub struct Cursor {
    /// Square of the steepest slope that is marked.
    limit2: f64,
    /// The facet on which the last segment ended, and its bin; None where it did not end on a free sheet.
    pub(super) last: Option<(u32, usize)>,
    /// Scratch: the facets that may lie under a stretch.
    pub(super) facets: Vec<u32>,
    /// Scratch: the facets under a stretch, cut with it.
    pub(super) sheets: Sheets,
    /// Scratch: what rims hold of a gap.
    pub(super) on_rim: Vec<Span>,
}

impl Cursor {
    /// Of two facets along an edge, those are preferred whose slope, squared, is at most `limit2`.
    pub fn new(limit2: f64) -> Self {
        let (last, facets, sheets, on_rim) = Default::default();
        Self { limit2, last, facets, sheets, on_rim }
    }

    pub(super) fn limit2(&self) -> f64 {
        self.limit2
    }
}

impl Default for Cursor {
    fn default() -> Self {
        Self::new(f64::INFINITY)
    }
}

/// A segment with what every step needs.
pub(super) struct Line {
    pub(super) a: P2,
    pub(super) b: P2,
    /// From `a` to `b`, nm.
    pub(super) d: [f64; 2],
    /// One over the square of its length.
    inv_len2: f64,
    /// Sign of a corner that lies exactly on the line.
    pub(super) tie: f64,
    /// Half a nanometre as parameter.
    pub(super) half_nm: f64,
}

impl Line {
    /// The segment from `a` to `b`, in the mesh's own coordinates; they differ, since parameters divide by its length.
    fn new(a: P2, b: P2) -> Self {
        let d = [(b.x - a.x) as f64, (b.y - a.y) as f64];
        let len2 = d[0] * d[0] + d[1] * d[1];
        // Shifted by (ε, ε²), the segment moves to its right where it leads up; where it is level, ε² alone counts, and
        // it moves to its right where it leads to the left. Corners on it are then on its left.
        let is_shifted_right = d[1] > 0.0 || d[1] == 0.0 && d[0] < 0.0;
        // Almost zero, so that crossings computed with it lie in the corner itself.
        let tie = if is_shifted_right { f64::MIN_POSITIVE } else { -f64::MIN_POSITIVE };
        Self { a, b, d, inv_len2: 1.0 / len2, tie, half_nm: 0.5 / len2.sqrt() }
    }

    /// Side of `v`, exact in sign: positive on the left.
    #[inline]
    pub(super) fn side(&self, v: Vertex) -> f64 {
        orient(self.a, self.b, v.p2())
    }

    /// The side of [`Line::side`], zero also where `v` lies within [`ON_RIM`] of the line: both were rounded to
    /// the grid, so a stroke drawn along the border of a turned part lies on it to that.
    #[inline]
    fn side_snapped(&self, v: Vertex) -> f64 {
        let o = self.side(v);
        if o.abs() * 2.0 * self.half_nm <= ON_RIM { 0.0 } else { o }
    }

    /// The side of [`Line::side`], never zero.
    #[inline]
    fn side_shifted(&self, v: Vertex) -> f64 {
        let o = self.side(v);
        if o == 0.0 { self.tie } else { o }
    }

    #[inline]
    pub(super) fn parameter(&self, x: f64, y: f64) -> f64 {
        ((x - self.a.x as f64) * self.d[0] + (y - self.a.y as f64) * self.d[1]) * self.inv_len2
    }

    /// Where the line crosses the edge (u, v), given the sides of its ends. The same bits from either facet of the
    /// edge.
    #[inline]
    fn crossing(&self, u: FacetCorner, side_u: f64, v: FacetCorner, side_v: f64) -> ProfilePoint {
        // From the corner of the lower number, whichever facet asks.
        let (from, side_from, to, side_to) = if u.number < v.number {
            (u.vertex, side_u, v.vertex, side_v)
        } else {
            (v.vertex, side_v, u.vertex, side_u)
        };
        let s = side_from / (side_from - side_to);
        let x = f64::from(from.x) + s * (f64::from(to.x) - f64::from(from.x));
        let y = f64::from(from.y) + s * (f64::from(to.y) - f64::from(from.y));
        ProfilePoint { t: self.parameter(x, y), z: from.z + s * (to.z - from.z) }
    }

    /// Whether a stretch between two parameters has a length. A facet that the line meets in one point alone may seem
    /// to have one by rounding: below a thousandth of half a nanometre it has none.
    pub(super) fn has_length(&self, t0: f64, t1: f64) -> bool {
        t1 - t0 > self.half_nm * 1e-3
    }
}

/// The line through one facet.
struct Through {
    entry: ProfilePoint,
    exit: ProfilePoint,
    /// The edge by which the line leaves, 0 to 2.
    exit_edge: usize,
    /// Sides of the three corners, never zero.
    sides: [f64; 3],
}

/// A stretch of a line through bins of one class.
struct Stretch {
    class: Class,
    /// Parameters of its ends.
    t: [f64; 2],
    /// The first and the last bin of the stretch.
    bins: [usize; 2],
    /// Whether the line ends with it.
    is_last: bool,
}

/// Steps from bin to bin along a segment.
struct BinSteps<'a> {
    surface: &'a Surface,
    line: &'a Line,
    /// Column and row of the present bin.
    cell: [i64; 2],
    /// Parameters at which the next border across x and the next across y is met.
    next: [f64; 2],
    /// Parameter at which the present bin was entered.
    t: f64,
    t_end: f64,
}

impl<'a> BinSteps<'a> {
    fn new(surface: &'a Surface, line: &'a Line, t: f64, t_end: f64) -> Self {
        let cell = [(0, line.a.x), (1, line.a.y)].map(|(axis, a)| {
            let v = if t == 0.0 { a } else { (a as f64 + t * line.d[axis]).floor() as i64 };
            let bin = surface.bin_of(axis, v);
            // Moving down from a bin line, the segment lies in the bin below it.
            let below = t == 0.0 && line.d[axis] < 0.0 && bin > 0 && surface.bin_line(axis, bin) == a;
            bin - i64::from(below)
        });
        let mut steps = Self { surface, line, cell, next: [f64::INFINITY; 2], t, t_end };
        (0..2).for_each(|axis| steps.aim(axis));
        steps
    }

    /// Finds where the line leaves the present column (axis 0) or row (axis 1).
    fn aim(&mut self, axis: usize) {
        let d = self.line.d[axis];
        let a = if axis == 0 { self.line.a.x } else { self.line.a.y };
        self.next[axis] = if d > 0.0 {
            (self.surface.bin_line(axis, self.cell[axis] + 1) - a) as f64 / d
        } else if d < 0.0 {
            (self.surface.bin_line(axis, self.cell[axis]) - a) as f64 / d
        } else {
            f64::INFINITY
        };
    }

    /// Number of the present bin.
    fn bin(&self) -> usize {
        (self.cell[1] * self.surface.bin_count(0) + self.cell[0]) as usize
    }

    /// Moves to the next bin; None at the end of the stretch or of the grid.
    fn step(&mut self) -> Option<()> {
        let axis = usize::from(self.next[1] < self.next[0]);
        if self.next[axis] >= self.t_end {
            return None;
        }
        // Rounding must not lead back along the line.
        self.t = self.next[axis].max(self.t);
        self.cell[axis] += if self.line.d[axis] > 0.0 { 1 } else { -1 };
        if self.cell[axis] < 0 || self.cell[axis] >= self.surface.bin_count(axis) {
            return None;
        }
        self.aim(axis);
        Some(())
    }

    /// The stretch from parameter `from`, in the present bin, through the bins in a row that have the class of this
    /// one; afterwards the present bin is the one behind it.
    fn through_one_class(&mut self, from: f64) -> Stretch {
        let first = self.bin();
        let class = self.surface.class(first);
        let mut last = first;
        loop {
            if self.step().is_none() {
                return Stretch { class, t: [from, self.t_end], bins: [first, last], is_last: true };
            }
            if self.surface.class(self.bin()) != class {
                return Stretch { class, t: [from, self.t], bins: [first, last], is_last: false };
            }
            last = self.bin();
        }
    }
}

impl Surface {
    /// Walks the segment from `a` to `b` (part frame, a ≠ b) and writes its spans into `out`; returns whether a rim or
    /// another sheet may be near.
    pub fn walk(&self, a: P2, b: P2, cursor: &mut Cursor, out: &mut Vec<Span>) -> bool {
        out.clear();
        let line = self.line(a, b);
        let Some([t0, t1]) = self.clip(&line) else {
            out.push(Span::gap(0.0, 1.0));
            return false;
        };
        push_gap(out, 0.0, t0, line.half_nm);
        let mut steps = BinSteps::new(self, &line, t0, t1);
        let mut from = t0;
        let mut is_compared = false;
        loop {
            // Bins of one class in a row make one stretch: the walk starts and ends once in it.
            let stretch = steps.through_one_class(from);
            let [_, end] = stretch.t;
            match stretch.class {
                Class::Empty => push_gap(out, from, end, line.half_nm),
                Class::Simple => {
                    // The free walk stops where it finds no facet to start on, and at a rim.
                    let reached = self.walk_free(&line, &stretch, cursor, out);
                    if reached < end {
                        is_compared = true;
                        self.compare(&line, reached, end, cursor, out);
                    }
                }
                Class::Complex => {
                    is_compared = true;
                    self.compare(&line, from, end, cursor, out);
                }
            }
            if stretch.is_last {
                break;
            }
            from = end;
        }
        push_gap(out, t1, 1.0, line.half_nm);
        seal(out);
        self.close_on_rims(&line, cursor, out);
        is_compared
    }

    /// A segment in the mesh's own coordinates.
    pub(super) fn line(&self, a: P2, b: P2) -> Line {
        let o = self.origin();
        Line::new(P2::new(a.x - o.x, a.y - o.y), P2::new(b.x - o.x, b.y - o.y))
    }

    /// The parameters between which the line lies in the grid of bins.
    pub(super) fn clip(&self, line: &Line) -> Option<[f64; 2]> {
        let mut t = [0.0, 1.0];
        for axis in 0..2 {
            let lo = self.bin_line(axis, 0);
            let hi = self.bin_line(axis, self.bin_count(axis));
            let (a, b) = if axis == 0 { (line.a.x, line.b.x) } else { (line.a.y, line.b.y) };
            if a.max(b) < lo || a.min(b) >= hi {
                return None;
            }
            for (limit, beyond_a, beyond_b) in [(lo, a < lo, b < lo), (hi, a >= hi, b >= hi)] {
                let t_limit = (limit - a) as f64 / line.d[axis];
                if beyond_a {
                    t[0] = f64::max(t[0], t_limit);
                } else if beyond_b {
                    t[1] = f64::min(t[1], t_limit);
                }
            }
        }
        (t[0] < t[1]).then_some(t)
    }

    /// Where the line enters and leaves facet f; None where it passes beside it.
    #[inline]
    fn through(&self, line: &Line, f: u32) -> Option<Through> {
        let corners = [0, 1, 2].map(|k| self.corner(f, k));
        let sides = corners.map(|corner| line.side_shifted(corner.vertex));
        let crossing = |k: usize| line.crossing(corners[k], sides[k], corners[(k + 1) % 3], sides[(k + 1) % 3]);
        // Facets run counter-clockwise: the line leaves by the edge whose first corner lies right and second left.
        let exit_edge = (0..3).find(|&k| sides[k] < 0.0 && sides[(k + 1) % 3] > 0.0)?;
        let entry_edge = (0..3).find(|&k| sides[k] > 0.0 && sides[(k + 1) % 3] < 0.0)?;
        Some(Through { entry: crossing(entry_edge), exit: crossing(exit_edge), exit_edge, sides })
    }

    /// The facet to start on at parameter `t` in bin `bin`: of those that the line meets there, the
    /// highest.
    fn start(&self, line: &Line, t: f64, bin: usize, cursor: &mut Cursor) -> Option<(u32, Through)> {
        if let Some((f, last_bin)) = cursor.last
            && last_bin == bin
            && let Some(through) = self.through(line, f)
            && through.entry.t <= t
            && t < through.exit.t
        {
            return Some((f, through));
        }
        let mut best: Option<(f64, u32, Through)> = None;
        cursor.facets.clear();
        let p = line.a.lerp(line.b, t);
        self.bin_facets(bin, [p, p], &mut cursor.facets);
        for &f in &cursor.facets {
            if let Some(through) = self.through(line, f)
                && through.entry.t - t <= line.half_nm
                && t - through.exit.t <= line.half_nm
            {
                let Through { entry, exit, .. } = through;
                let z = height_between(t.clamp(entry.t, exit.t.max(entry.t)), entry, exit);
                if best.as_ref().is_none_or(|(best_z, _, _)| z > *best_z) {
                    best = Some((z, f, through));
                }
            }
        }
        best.map(|(_, f, through)| (f, through))
    }

    /// From facet to facet along a stretch of simple bins; returns how far it came.
    fn walk_free(&self, line: &Line, stretch: &Stretch, cursor: &mut Cursor, out: &mut Vec<Span>) -> f64 {
        let &Stretch { t: [mut t, t_to], bins: [first, last], .. } = stretch;
        let Some((mut f, start)) = self.start(line, t, first, cursor) else {
            cursor.last = None;
            return t;
        };
        // The line lies in facet f from `entry` to `exit`, spans are written up to t. The sign of a side is exact and
        // never 0, so of the three corners one lies alone on its side, and the line crosses the two edges to it:
        // it enters by one and leaves by the other.
        let Through { mut entry, mut exit, mut exit_edge, mut sides } = start;
        loop {
            if exit.t >= t_to {
                let (z0, z1) = (height_between(t, entry, exit), height_between(t_to, entry, exit));
                push_span(out, Span { t0: t, t1: t_to, z0, z1, facet: f }, line.half_nm);
                cursor.last = Some((f, last));
                return t_to;
            }
            // Facets that the line clips by less than rounding, exit.t <= t, leave no span, but are walked through.
            if exit.t > t {
                let z0 = height_between(t, entry, exit);
                push_span(out, Span { t0: t, t1: exit.t, z0, z1: exit.z, facet: f }, line.half_nm);
                t = exit.t;
            }
            let twin = self.twin(f * 3 + exit_edge as u32);
            if twin == NONE {
                cursor.last = None;
                return t;
            }
            // The corners of the edge lie right and left of the line; its twin runs the other way. Only the corner
            // opposite of it is new.
            let (right, left) = (sides[exit_edge], sides[(exit_edge + 1) % 3]);
            let k = (twin % 3) as usize;
            f = twin / 3;
            let opposite = line.side_shifted(self.corner(f, (k + 2) % 3).vertex);
            sides[k] = left;
            sides[(k + 1) % 3] = right;
            sides[(k + 2) % 3] = opposite;
            // The line leaves by the edge whose first corner lies right and second left.
            exit_edge = if opposite > 0.0 { (k + 1) % 3 } else { (k + 2) % 3 };
            entry = exit;
            let (u, v) = (self.corner(f, exit_edge), self.corner(f, (exit_edge + 1) % 3));
            exit = line.crossing(u, sides[exit_edge], v, sides[(exit_edge + 1) % 3]);
        }
    }

    /// Cuts all facets under a stretch with it, borders included, and takes the topmost.
    fn compare(&self, line: &Line, t_from: f64, t_to: f64, cursor: &mut Cursor, out: &mut Vec<Span>) {
        cursor.last = None;
        self.facets_under(line, [t_from, t_to], &mut cursor.facets);
        cursor.sheets.hits.clear();
        for &f in &cursor.facets {
            cursor.sheets.hits.extend(self.closed(line, f, t_from, t_to));
        }
        cursor.sheets.take(t_from, t_to, &self.facet_choice(line, cursor.limit2), out);
    }

    /// The facets that may lie under a stretch of the line, each once, rising: of all bins that it passes.
    pub(super) fn facets_under(&self, line: &Line, [from, to]: [f64; 2], facets: &mut Vec<u32>) {
        facets.clear();
        let mut steps = BinSteps::new(self, line, from, to);
        let ends = [from, to].map(|t| line.a.lerp(line.b, t));
        loop {
            self.bin_facets(steps.bin(), ends, facets);
            if steps.step().is_none() {
                break;
            }
        }
        facets.sort_unstable();
        facets.dedup();
    }

    /// The stretch of the line between the two parameters that lies in the closed facet f; None if
    /// it has no length.
    pub(super) fn closed(&self, line: &Line, f: u32, t_from: f64, t_to: f64) -> Option<Hit> {
        let corners = [0, 1, 2].map(|k| self.corner(f, k));
        let sides = corners.map(|corner| line.side_snapped(corner.vertex));
        // A closed facet meets the line between two of at most three places: corners that lie on it, and crossings
        // of edges whose ends lie on opposite sides. Borders count, else a line along an edge would meet neither
        // facet.
        let mut ends = [ProfilePoint { t: 0.0, z: 0.0 }; 3];
        let mut n = 0;
        for k in 0..3 {
            let next = (k + 1) % 3;
            if sides[k] == 0.0 {
                let Vertex { x, y, z } = corners[k].vertex;
                ends[n] = ProfilePoint { t: line.parameter(x.into(), y.into()), z };
                n += 1;
            } else if sides[next] != 0.0 && (sides[k] < 0.0) != (sides[next] < 0.0) {
                ends[n] = line.crossing(corners[k], sides[k], corners[next], sides[next]);
                n += 1;
            }
        }
        let ends = &ends[..n];
        let &first = ends.iter().min_by(|p, q| p.t.total_cmp(&q.t))?;
        let &last = ends.iter().max_by(|p, q| p.t.total_cmp(&q.t))?;
        let (t0, t1) = (first.t.max(t_from), last.t.min(t_to));
        line.has_length(t0, t1).then(|| {
            let (z0, z1) = (height_between(t0, first, last), height_between(t1, first, last));
            Hit { span: Span { t0, t1, z0, z1, facet: f }, side: Side::of_facet(sides) }
        })
    }

    /// Square of the slope (tangent) of a facet.
    pub fn slope2(&self, f: u32) -> f64 {
        slope2([0, 1, 2].map(|k| {
            let v = self.corner(f, k).vertex;
            [f64::from(v.x), f64::from(v.y), v.z].into()
        }))
    }

    /// The direction in which a facet looks, upwards, of length 1.
    pub fn normal(&self, f: u32) -> [f64; 3] {
        normal([0, 1, 2].map(|k| {
            let v = self.corner(f, k).vertex;
            [f64::from(v.x), f64::from(v.y), v.z].into()
        }))
    }

    /// Corner k of facet f.
    #[inline]
    pub(super) fn corner(&self, f: u32, k: usize) -> FacetCorner {
        match &self.kind {
            Kind::Mesh(m, _) => {
                let number = m.facets[f as usize][k];
                FacetCorner { vertex: m.vertices[number as usize], number }
            }
            Kind::Implicit(g, _) => g.corner(f, k),
        }
    }

    /// The half-edge on the other side of half-edge `he`, or [`NONE`] at a rim.
    #[inline]
    pub(super) fn twin(&self, he: u32) -> u32 {
        match &self.kind {
            Kind::Mesh(m, _) => m.twins[he as usize],
            Kind::Implicit(g, _) => g.twin(he),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrace_core::geom::NM_PER_MM;
    use terrace_core::math;

    fn surface(facets: Vec<[[f64; 3]; 3]>) -> Surface {
        Surface::from_facets(facets, &mut Vec::new()).expect("a good surface")
    }

    /// A jittered sheet of n x n cells over [0, size]² with z from `f`, border kept straight.
    fn sheet(n: usize, size: f64, f: impl Fn(f64, f64) -> f64) -> Vec<[[f64; 3]; 3]> {
        let mut random = terrace_core::random::Random::new(1);
        let mut noise = || random.half();
        let h = size / n as f64;
        let mut nodes = vec![[0.0; 3]; (n + 1) * (n + 1)];
        for j in 0..=n {
            for i in 0..=n {
                let mut x = i as f64 * h;
                let mut y = j as f64 * h;
                if i > 0 && i < n && j > 0 && j < n {
                    x += noise() * h * 0.6;
                    y += noise() * h * 0.6;
                }
                nodes[j * (n + 1) + i] = [x, y, f(x, y)];
            }
        }
        let at = |i: usize, j: usize| nodes[j * (n + 1) + i];
        let mut out = Vec::new();
        for j in 0..n {
            for i in 0..n {
                let (a, b, c, d) = (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
                if (i * 7 + j * 3) % 2 == 0 {
                    out.extend([[a, b, c], [a, c, d]]);
                } else {
                    out.extend([[a, b, d], [d, b, c]]);
                }
            }
        }
        out
    }

    fn spans(s: &Surface, a: [f64; 2], b: [f64; 2]) -> Vec<Span> {
        let mut out = Vec::new();
        let p = |q: [f64; 2]| P2::from_mm(q[0], q[1]).expect("near");
        s.walk(p(a), p(b), &mut Cursor::default(), &mut out);
        assert_eq!(out[0].t0, 0.0);
        assert_eq!(out[out.len() - 1].t1, 1.0);
        assert!(out.windows(2).all(|w| w[0].t1 == w[1].t0 && w[1].t1 > w[1].t0), "{out:?}");
        out
    }

    #[test]
    fn a_plane_is_found_everywhere_borders_and_vertices_included() {
        let plane = |x: f64, y: f64| 0.3 * x - 0.2 * y + 1.0;
        let s = surface(sheet(8, 4.0, plane));
        let lines = [
            ([0.0, 0.0], [4.0, 0.0]), // along the lower border
            ([4.0, 4.0], [0.0, 4.0]), // along the upper border, backwards
            ([4.0, 0.0], [4.0, 4.0]), // along the right border
            ([0.0, 4.0], [0.0, 0.0]),
            ([0.0, 0.0], [4.0, 4.0]), // through vertices
            ([0.1, 3.9], [3.7, 0.2]),
            ([1.0, 1.0], [1.0, 1.000001]),
        ];
        for (a, b) in lines {
            for span in spans(&s, a, b) {
                assert!(span.facet().is_some(), "{a:?} {b:?}: gap {span:?}");
                for (t, z) in [(span.t0, span.z0), (span.t1, span.z1)] {
                    let want = plane(a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])) * NM_PER_MM;
                    assert!((z - want).abs() < 1.0, "{a:?} {b:?} at {t}: {z} {want}");
                }
            }
        }
    }

    #[test]
    fn walk_reports_gaps_exactly_where_the_part_is_absent() {
        let s = surface(sheet(8, 4.0, |_, _| 0.0));
        let out = spans(&s, [-1.0, 2.1], [5.0, 2.1]);
        assert!(out[0].facet().is_none() && (out[0].t1 - 1.0 / 6.0).abs() < 1e-9);
        let last = out[out.len() - 1];
        assert!(last.facet().is_none() && (last.t0 - 5.0 / 6.0).abs() < 1e-9);
        assert_eq!(out.iter().filter(|s| s.facet().is_none()).count(), 2);
        assert_eq!(spans(&s, [-3.0, -1.0], [9.0, -1.0]).len(), 1);
    }

    #[test]
    fn topmost_sheet_wins_and_changes_exactly_at_its_border() {
        let mut facets = sheet(6, 6.0, |_, _| 0.0);
        // A smaller sheet above, wound the other way, and one crossing both.
        for mut f in sheet(4, 2.0, |x, _| 1.0 + x) {
            f.swap(0, 1);
            facets.push(f.map(|[x, y, z]| [x + 2.0, y + 2.0, z]));
        }
        let s = surface(facets);
        let out = spans(&s, [0.0, 3.0], [6.0, 3.0]);
        for span in &out {
            let mid = 6.0 * (span.t0 + span.t1) / 2.0;
            let want = if (2.0..4.0).contains(&mid) { 1.0 + (mid - 2.0) } else { 0.0 };
            let z = (span.z0 + span.z1) / 2.0 / NM_PER_MM;
            assert!((z - want).abs() < 1e-6, "{mid}: {z} {want}");
        }
        let jumps: Vec<f64> =
            out.windows(2).filter(|w| (w[0].z1 - w[1].z0).abs() > 1000.0).map(|w| w[0].t1 * 6.0).collect();
        assert_eq!(jumps.len(), 2);
        assert!((jumps[0] - 2.0).abs() < 1e-9 && (jumps[1] - 4.0).abs() < 1e-9);
    }

    #[test]
    fn crossing_sheets_change_where_they_cross() {
        let mut facets = sheet(5, 4.0, |x, _| x - 2.0);
        facets.extend(sheet(7, 4.0, |x, _| 2.0 - x));
        let s = surface(facets);
        for span in spans(&s, [0.0, 1.3], [4.0, 1.3]) {
            let x = 4.0 * (span.t0 + span.t1) / 2.0;
            assert!(((span.z0 + span.z1) / 2.0 / NM_PER_MM - (x - 2.0).abs()).abs() < 1e-6);
        }
    }

    #[test]
    fn walk_on_a_closed_box_sees_only_its_lid() {
        let quad = |a: [f64; 3], b: [f64; 3], c: [f64; 3], d: [f64; 3]| [[a, b, c], [a, c, d]];
        let mut facets = Vec::new();
        let lid = sheet(20, 10.0, |_, _| 5.0);
        facets.extend(lid);
        facets.extend(sheet(20, 10.0, |_, _| 0.0).into_iter().map(|[a, b, c]| [a, c, b]));
        for (p, q) in [
            ([0.0, 0.0], [10.0, 0.0]),
            ([10.0, 0.0], [10.0, 10.0]),
            ([10.0, 10.0], [0.0, 10.0]),
            ([0.0, 10.0], [0.0, 0.0]),
        ] {
            facets.extend(quad([p[0], p[1], 0.0], [q[0], q[1], 0.0], [q[0], q[1], 5.0], [p[0], p[1], 5.0]));
        }
        let s = surface(facets);
        for (a, b) in [([0.0, 5.0], [10.0, 5.0]), ([0.0, 0.0], [10.0, 0.0]), ([3.0, 3.0], [7.0, 9.0])] {
            for span in spans(&s, a, b) {
                assert_eq!((span.z0, span.z1), (5.0 * NM_PER_MM, 5.0 * NM_PER_MM), "{a:?} {span:?}");
            }
        }
    }

    #[test]
    fn cutting_a_segment_anywhere_changes_no_height() {
        let f = |x: f64, y: f64| math::sin(x * 1.3) + math::cos(y * 0.7);
        let s = surface(sheet(30, 10.0, f));
        let (a, b) = ([0.3, 0.7], [9.1, 8.2]);
        let whole = spans(&s, a, b);
        let z_at = |out: &[Span], t: f64| out.iter().find(|s| s.t0 <= t && t <= s.t1).expect("tiled").z(t);
        for i in 1..50 {
            let m = <P2>::from_mm(a[0], a[1])
                .expect("near")
                .lerp(P2::from_mm(b[0], b[1]).expect("near"), f64::from(i) / 50.0);
            let [mx, my] = m.mm();
            let second = spans(&s, [mx, my], b);
            let first = spans(&s, a, [mx, my]);
            let z = z_at(&whole, f64::from(i) / 50.0);
            assert!((second[0].z0 - z).abs() < 1.0 && (first[first.len() - 1].z1 - z).abs() < 1.0);
        }
    }
}
