//! Segments that run along edges of facets: what is topmost beside them counts.
//!
//! Corners of a mesh and points of a segment are rounded to the grid, so an edge runs along a segment where it lies
//! within [`ON_RIM`] of it for some length. There each facet counts on its own side of the edge, at the height of the
//! edge, and [`super::topmost::Sheets::take`] decides between the two sides.

use super::Surface;
use super::mesh::{NONE, Vertex};
use super::topmost::{Choice, Hit, Side, Span, push_gap, seal};
use super::walk::{Cursor, Line, ON_RIM};
use terrace_core::geom::{P2, orient};

/// Least length of a stretch along an edge, nm: at less the segment crosses it.
const RUN: f64 = 100.0;

impl Surface {
    /// Walks as [`Surface::walk`] does a segment that runs along edges: all facets under it are cut with it, each on
    /// its own side of an edge that lies within rounding of the segment.
    pub fn walk_along_edges(&self, a: P2, b: P2, cursor: &mut Cursor, out: &mut Vec<Span>) {
        out.clear();
        let line = self.line(a, b);
        let Some([t0, t1]) = self.clip(&line) else {
            out.push(Span::gap(0.0, 1.0));
            return;
        };
        push_gap(out, 0.0, t0, line.half_nm);
        cursor.last = None;
        self.facets_under(&line, [t0, t1], &mut cursor.facets);
        cursor.sheets.hits.clear();
        for &f in &cursor.facets {
            self.closed_along(&line, f, [t0, t1], &mut cursor.sheets.hits);
        }
        cursor.sheets.take(t0, t1, &self.choice(&line, cursor.limit2()), out);
        push_gap(out, t1, 1.0, line.half_nm);
        seal(out);
        self.close_on_rims(&line, cursor, out);
    }

    /// Whether the segment from `a` to `b` runs along an edge of the facet under a span, so that what is marked depends
    /// on what lies beside it: any edge of a facet that is too steep, and a rim.
    pub fn is_along_edge(&self, a: P2, b: P2, span: &Span, is_steep: bool) -> bool {
        let Some(f) = span.facet() else { return false };
        let mut edges = (0..3).filter(|&k| is_steep || self.twin(f * 3 + k as u32) == NONE).peekable();
        if edges.peek().is_none() {
            return false;
        }
        let line = self.line(a, b);
        edges.any(|k| self.run(&line, f, k, [span.t0, span.t1]).is_some())
    }

    /// The stretch between two parameters on which the line runs along edge k of facet f, within rounding.
    fn run(&self, line: &Line, f: u32, k: usize, [from, to]: [f64; 2]) -> Option<[f64; 2]> {
        let [u, v] = [k, (k + 1) % 3].map(|k| self.corner(f, k).0);
        // Most edges lie beside the line, or cross it at a larger angle than leaves them near it for so long.
        let off = [u, v].map(|c| line.side(c) * 2.0 * line.half_nm);
        let is_beside = off[0] * off[1] > 0.0 && off[0].abs().min(off[1].abs()) > ON_RIM;
        let length = (f64::from(v.x) - f64::from(u.x)).hypot(f64::from(v.y) - f64::from(u.y));
        if is_beside || (off[0] - off[1]).abs() * RUN > 4.0 * ON_RIM * length {
            return None;
        }
        let [s, e] = [u, v].map(|c| line.parameter(c.x.into(), c.y.into()));
        let near = line.near(u, v);
        let run = [near[0].max(from).max(s.min(e)), near[1].min(to).min(s.max(e))];
        (run[1] - run[0] > RUN * 2.0 * line.half_nm).then_some(run)
    }

    /// What decides between facets along a line.
    pub(super) fn choice(&self, line: &Line, limit2: f64) -> Choice<impl Fn(u32) -> (f64, f64)> {
        let left = [-line.d[1], line.d[0]];
        let look = move |f: u32| {
            let [x, y, z] = self.normal(f);
            (-(x * left[0] + y * left[1]) / z, self.slope2(f))
        };
        Choice { half_nm: line.half_nm, limit2, first: line.shifted_to(), look }
    }

    /// Adds the stretches of the line in the closed facet f: those along its edges as ones on the facet's side.
    fn closed_along(&self, line: &Line, f: u32, [from, to]: [f64; 2], hits: &mut Vec<Hit>) {
        let whole = self.closed(line, f, from, to);
        let mut runs: Vec<(usize, [f64; 2])> =
            (0..3).filter_map(|k| Some((k, self.run(line, f, k, [from, to])?))).collect();
        runs.sort_by(|(_, p), (_, q)| (q[1] - q[0]).total_cmp(&(p[1] - p[0])));
        // Where edges meet the longer one counts.
        for i in 1..runs.len() {
            runs[i].1 = runs[..i].iter().fold(runs[i].1, |run, (_, longer)| beside(run, *longer));
        }
        let is_long = |[t0, t1]: [f64; 2]| t1 - t0 > line.half_nm * 1e-3;
        runs.retain(|(_, run)| is_long(*run));
        for &(k, [t0, t1]) in &runs {
            let [u, v, opposite] = [0, 1, 2].map(|i| self.corner(f, (k + i) % 3).0);
            let z = |t: f64| u.z + (v.z - u.z) * line.share(u, v, t);
            let side = line.side_of_edge(u, v, opposite);
            hits.push(Hit { span: Span { t0, t1, z0: z(t0), z1: z(t1), facet: f }, side });
        }
        let Some(Hit { span, side }) = whole else { return };
        if side != Side::Both && !runs.is_empty() {
            return;
        }
        // A line that leaves an edge at a small angle continues in the facet.
        runs.sort_by(|(_, p), (_, q)| p[0].total_cmp(&q[0]));
        let mut t = span.t0;
        for [t0, t1] in runs.iter().map(|(_, run)| *run).chain([[span.t1; 2]]) {
            let end = t0.min(span.t1);
            if is_long([t, end]) {
                hits.push(Hit { span: span.cut(t, end), side });
            }
            t = t.max(t1);
        }
    }
}

impl Line {
    /// The side to which the symbolic shift moves the segment.
    fn shifted_to(&self) -> Side {
        if self.tie > 0.0 { Side::Right } else { Side::Left }
    }

    /// The side on which a facet lies of its edge (u, v), which runs along the line within rounding.
    fn side_of_edge(&self, u: Vertex, v: Vertex, opposite: Vertex) -> Side {
        let is_along = self.parameter(v.x.into(), v.y.into()) > self.parameter(u.x.into(), u.y.into());
        let is_left = orient(u.p2(), v.p2(), opposite.p2()) > 0.0;
        if is_left == is_along { Side::Left } else { Side::Right }
    }
}

/// What of a stretch lies beside another: the longer part where that is within it.
fn beside([from, to]: [f64; 2], [t0, t1]: [f64; 2]) -> [f64; 2] {
    if t1 <= from || to <= t0 {
        [from, to]
    } else if t0 - from >= to - t1 {
        [from, t0]
    } else {
        [t1, to]
    }
}
