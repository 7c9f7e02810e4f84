//! Segments that run along edges of facets: what is topmost beside them counts.
//!
//! Corners of a mesh and points of a segment are rounded to the grid, so an edge runs along a segment where it lies
//! within [`ON_RIM`] of it for some length. There each facet counts on its own side of the edge, at the height of the
//! edge, and [`super::topmost::Sheets::take`] decides between the two sides.

use super::Surface;
use super::mesh::{NONE, Vertex};
use super::topmost::{FacetChoice, Hit, Incline, Side, Span, push_gap, seal};
use super::walk::{Cursor, Line, ON_RIM};
use terrace_core::geom::{P2, orient};
use terrace_core::math;

/// Least length of a stretch along an edge, nm: at less the segment crosses it.
const RUN: f64 = 100.0;

/// A stretch of a line along an edge of a facet, within rounding.
#[derive(Clone, Copy)]
struct EdgeRun {
    /// The edge, 0 to 2.
    edge: usize,
    /// Parameters of its ends.
    t: [f64; 2],
}

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
        cursor.sheets.take(t0, t1, &self.facet_choice(&line, cursor.limit2()), out);
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
        edges.any(|k| self.edge_run(&line, f, k, [span.t0, span.t1]).is_some())
    }

    /// The stretch between two parameters on which the line runs along edge k of facet f, within rounding.
    fn edge_run(&self, line: &Line, f: u32, k: usize, [from, to]: [f64; 2]) -> Option<EdgeRun> {
        let [u, v] = [k, (k + 1) % 3].map(|k| self.corner(f, k).vertex);
        // Most edges lie beside the line, or cross it at a larger angle than leaves them near it for so long.
        let off = [u, v].map(|c| line.side(c) * 2.0 * line.half_nm);
        let is_beside = off[0] * off[1] > 0.0 && off[0].abs().min(off[1].abs()) > ON_RIM;
        let length = math::hypot(f64::from(v.x) - f64::from(u.x), f64::from(v.y) - f64::from(u.y));
        // An edge that crosses the line is within ON_RIM of it over 2 * ON_RIM * length / |off[0] - off[1]| of its
        // length. Twice that is compared, since this only sorts out early; below, the stretch itself is measured.
        if is_beside || (off[0] - off[1]).abs() * RUN > 4.0 * ON_RIM * length {
            return None;
        }
        let [s, e] = [u, v].map(|c| line.parameter(c.x.into(), c.y.into()));
        let near = line.near(u, v);
        let run = [near[0].max(from).max(s.min(e)), near[1].min(to).min(s.max(e))];
        (run[1] - run[0] > RUN * 2.0 * line.half_nm).then_some(EdgeRun { edge: k, t: run })
    }

    /// What decides between facets along a line.
    pub(super) fn facet_choice(&self, line: &Line, limit2: f64) -> FacetChoice<impl Fn(u32) -> Incline> {
        let left = [-line.d[1], line.d[0]];
        FacetChoice {
            half_nm: line.half_nm,
            limit2,
            tie_side: line.shifted_to(),
            incline: move |f: u32| self.incline(f, left),
        }
    }

    /// How facet f lies to a line, given the direction to the left of the line.
    fn incline(&self, f: u32, left: [f64; 2]) -> Incline {
        let [x, y, z] = self.normal(f);
        Incline { rise_left: -(x * left[0] + y * left[1]) / z, slope2: self.slope2(f) }
    }

    /// Adds the stretches of the line in the closed facet f: those along its edges as ones on the facet's side.
    fn closed_along(&self, line: &Line, f: u32, [from, to]: [f64; 2], hits: &mut Vec<Hit>) {
        let whole = self.closed(line, f, from, to);
        let mut runs: Vec<EdgeRun> = (0..3).filter_map(|k| self.edge_run(line, f, k, [from, to])).collect();
        runs.sort_by(|p, q| (q.t[1] - q.t[0]).total_cmp(&(p.t[1] - p.t[0])));
        // Where edges meet the longer one counts.
        for i in 1..runs.len() {
            runs[i].t = runs[..i].iter().fold(runs[i].t, |run, longer| beside(run, longer.t));
        }
        runs.retain(|run| line.has_length(run.t[0], run.t[1]));
        for &EdgeRun { edge, t: [t0, t1] } in &runs {
            let [u, v, opposite] = [0, 1, 2].map(|i| self.corner(f, (edge + i) % 3).vertex);
            let z = |t: f64| u.z + (v.z - u.z) * line.share(u, v, t);
            let side = line.side_of_edge(u, v, opposite);
            hits.push(Hit { span: Span { t0, t1, z0: z(t0), z1: z(t1), facet: f }, side });
        }
        let Some(Hit { span, side }) = whole else { return };
        if side != Side::Both && !runs.is_empty() {
            return;
        }
        // A line that leaves an edge at a small angle continues in the facet.
        runs.sort_by(|p, q| p.t[0].total_cmp(&q.t[0]));
        let mut t = span.t0;
        for [t0, t1] in runs.iter().map(|run| run.t).chain([[span.t1; 2]]) {
            let end = t0.min(span.t1);
            if line.has_length(t, end) {
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
