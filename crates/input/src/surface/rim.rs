//! Strokes that run along the rim of the part.
//!
//! The corners of a turned part and the points of its texture are rounded apart, each by up to half the diagonal of the
//! grid. A stroke that was drawn on the border of the part may then lie next to it by a nanometre. The walk snaps
//! corners to the segment; that is enough where the segment is as long as the edge. Points of a short segment next to a
//! long edge are found here: a gap in which every place lies within [`ON_RIM`] of a rim is not a gap. Gaps that lead
//! further off the part stay as they are, whole, so that a stroke that crosses the border ends where it did.
//!
//! Limit: of a segment that runs along a rim and on beyond it, the whole gap stays.

use super::Surface;
use super::mesh::{NONE, Vertex};
use super::topmost::{Hit, Side, Span};
use super::walk::{Cursor, Line, ON_RIM};
use terrace_core::geom::{P2, orient};

impl Surface {
    /// Fills the gaps that lie on a rim with what is there.
    pub(super) fn close_on_rims(&self, line: &Line, cursor: &mut Cursor, out: &mut Vec<Span>) {
        // From the back: a filled gap becomes several spans, and those before it keep their numbers.
        for i in (0..out.len()).rev() {
            let Span { t0, t1, .. } = out[i];
            // Most gaps lead far off the part: their middle decides.
            let is_on_rim = |t: f64| self.is_on_rim(line, t, cursor);
            if out[i].facet().is_some() || ![(t0 + t1) / 2.0, t1, t0].into_iter().all(is_on_rim) {
                continue;
            }
            if self.along_rims(line, [t0, t1], cursor) {
                out.splice(i..=i, cursor.on_rim.drain(..));
            }
        }
    }

    /// Whether the place at `t` lies on a rim.
    fn is_on_rim(&self, line: &Line, t: f64, cursor: &mut Cursor) -> bool {
        cursor.facets.clear();
        let p = line.a.lerp(line.b, t);
        let bin = self.bin_of(1, p.y) * self.bin_count(0) + self.bin_of(0, p.x);
        self.bin_facets(bin as usize, [p, p], &mut cursor.facets);
        cursor.facets.iter().flat_map(|&f| self.rims(f)).any(|[u, v, _]| {
            let near = line.near(u, v);
            near[0] - line.half_nm <= t && t <= near[1] + line.half_nm
        })
    }

    /// Writes what rims hold of a stretch of the line into `cursor.on_rim`; returns whether that is all of it.
    fn along_rims(&self, line: &Line, [from, to]: [f64; 2], cursor: &mut Cursor) -> bool {
        self.facets_under(line, [from, to], &mut cursor.facets);
        let limit2 = cursor.limit2();
        let Cursor { facets, sheets, on_rim, .. } = cursor;
        sheets.hits.clear();
        for &f in facets.iter() {
            for [u, v, opposite] in self.rims(f) {
                let near = line.near(u, v);
                let (t0, t1) = (near[0].max(from), near[1].min(to));
                if t0 < t1 {
                    let z = |t: f64| u.z + (v.z - u.z) * line.share(u, v, t);
                    let side = if line.side(opposite) > 0.0 { Side::Left } else { Side::Right };
                    sheets.hits.push(Hit { span: Span { t0, t1, z0: z(t0), z1: z(t1), facet: f }, side });
                }
            }
        }
        on_rim.clear();
        sheets.take(from, to, &self.facet_choice(line, limit2), on_rim);
        let is_whole = !on_rim.is_empty() && on_rim.iter().all(|s| s.facet().is_some());
        // Neighbouring edges meet within rounding: spans are made to tile the gap.
        if is_whole {
            let last = on_rim.len() - 1;
            (on_rim[0].t0, on_rim[last].t1) = (from, to);
            (1..=last).for_each(|i| on_rim[i].t0 = on_rim[i - 1].t1);
        }
        is_whole
    }

    /// The edges of facet f that have no facet on their other side, each with the corner opposite of it.
    fn rims(&self, f: u32) -> impl Iterator<Item = [Vertex; 3]> {
        let corner = move |k: usize| self.corner(f, k % 3).vertex;
        (0..3).filter(move |&k| self.twin(f * 3 + k as u32) == NONE).map(move |k| [0, 1, 2].map(|i| corner(k + i)))
    }
}

impl Line {
    /// The parameters between which the line lies within [`ON_RIM`] of the edge from u to v; the first beyond the
    /// second where it nowhere does. What is near to an edge is convex: its ends and what is next to it.
    pub(super) fn near(&self, u: Vertex, v: Vertex) -> [f64; 2] {
        let mut near = [f64::INFINITY, f64::NEG_INFINITY];
        // What lies within ON_RIM of an edge is a capsule: a disc around each end and a strip between. It is
        // convex, so the line is in it between the first and the last parameter at which it is in one of the three.
        for c in [u, v] {
            let off = self.side(c) * 2.0 * self.half_nm;
            let half = (ON_RIM * ON_RIM - off * off).max(0.0).sqrt() * 2.0 * self.half_nm;
            let t = self.parameter(c.x.into(), c.y.into());
            if off.abs() <= ON_RIM {
                near = hull(near, [t - half, t + half]);
            }
        }
        let ([l, m], length2) = self.along(u, v);
        // The strip: next to the edge (x) and not farther off than ON_RIM (y), both linear along the line.
        let [o, r] = [self.a, self.b].map(|p| orient(u.p2(), v.p2(), p));
        let wide = ON_RIM * length2.sqrt();
        let (x, y) = (within(l, m, 0.0, length2), within(o, r, -wide, wide));
        hull(near, [x[0].max(y[0]), x[1].min(y[1])])
    }

    /// The part of the edge from u to v, 0 to 1, at which the place at `t` is nearest to it.
    pub(super) fn share(&self, u: Vertex, v: Vertex, t: f64) -> f64 {
        let ([l, m], length2) = self.along(u, v);
        ((l + t * (m - l)) / length2).clamp(0.0, 1.0)
    }

    /// How far both ends of the line lie along the edge from u to v, times its length, and that squared.
    fn along(&self, u: Vertex, v: Vertex) -> ([f64; 2], f64) {
        let (p, q) = (u.p2(), v.p2());
        let e = [(q.x - p.x) as f64, (q.y - p.y) as f64];
        let along = |a: P2| (a.x - p.x) as f64 * e[0] + (a.y - p.y) as f64 * e[1];
        ([along(self.a), along(self.b)], e[0] * e[0] + e[1] * e[1])
    }
}

/// The shortest interval that contains two; of one whose first end is beyond its second, nothing.
fn hull(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    if b[0] <= b[1] { [a[0].min(b[0]), a[1].max(b[1])] } else { a }
}

/// Where a linear function that is `a` at 0 and `b` at 1 lies between `lo` and `hi`.
fn within(a: f64, b: f64, lo: f64, hi: f64) -> [f64; 2] {
    if a == b {
        let everywhere = [f64::NEG_INFINITY, f64::INFINITY];
        let nowhere = [f64::INFINITY, f64::NEG_INFINITY];
        return if (lo..=hi).contains(&a) { everywhere } else { nowhere };
    }
    let [s, t] = [(lo - a) / (b - a), (hi - a) / (b - a)];
    [s.min(t), s.max(t)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrace_core::geom::{NM_PER_MM, cos_sin};
    use terrace_core::progress::Task;

    const SIZE: [f64; 2] = [60.0, 40.0];
    const LID: f64 = 5.0;

    /// A box of 60 x 40 mm and 5 mm, its lid sloping along x by a tenth, turned and rounded as parts are.
    fn solid(turn: [f64; 2]) -> Surface {
        let corner = |k: usize, up: bool| {
            let [x, y] = [[0.0, 0.0], [SIZE[0], 0.0], SIZE, [0.0, SIZE[1]]][k];
            [x, y, if up { LID + 0.1 * x } else { 0.0 }]
        };
        let mut welder = super::super::Welder::new(turn, super::super::Joining::default());
        for up in [false, true] {
            welder.facet([corner(0, up), corner(1, up), corner(2, up)]);
            welder.facet([corner(0, up), corner(2, up), corner(3, up)]);
        }
        for k in 0..4 {
            let next = (k + 1) % 4;
            welder.facet([corner(k, false), corner(next, false), corner(next, true)]);
            welder.facet([corner(k, false), corner(next, true), corner(k, true)]);
        }
        Surface::from_welder(welder, "a box", &mut Vec::new(), Task::silent()).expect("a solid")
    }

    /// The grid point nearest to a place of the box before its turn, mm.
    fn place([c, s]: [f64; 2], [x, y]: [f64; 2]) -> P2 {
        P2::from_mm(c * x - s * y, s * x + c * y).expect("near")
    }

    #[test]
    fn within_finds_where_a_linear_function_keeps_its_limits() {
        assert_eq!(within(0.0, 4.0, 1.0, 3.0), [0.25, 0.75]);
        assert_eq!(within(4.0, 0.0, 1.0, 3.0), [0.25, 0.75]);
        assert_eq!(within(2.0, 2.0, 1.0, 3.0), [f64::NEG_INFINITY, f64::INFINITY]);
        assert_eq!(hull([0.0, 1.0], within(5.0, 5.0, 1.0, 3.0)), [0.0, 1.0]);
    }

    #[test]
    fn strokes_on_or_up_to_a_rotated_border_are_marked_in_full() {
        let mut spans = Vec::new();
        let mut cursor = Cursor::default();
        for i in 0..200 {
            let turn = cos_sin(f64::from(i) * 0.731 + 0.001);
            let part = solid(turn);
            for k in 0..60 {
                let [x, y] = [f64::from(k), f64::from(k) * 0.65];
                let step = 0.1 + f64::from(i) * 0.003;
                // Along every side, a step to it, and round a corner.
                for [a, b] in [
                    [[x, 0.0], [x + step, 0.0]],
                    [[x + step, SIZE[1]], [x, SIZE[1]]],
                    [[0.0, y], [0.0, y + 0.01 * step]],
                    [[SIZE[0], y], [SIZE[0], y + step]],
                    [[x, step], [x, 0.0]],
                    [[SIZE[0], y], [SIZE[0] - step, y]],
                    [[0.0, SIZE[1]], [step, SIZE[1]]],
                ] {
                    part.walk(place(turn, a), place(turn, b), &mut cursor, &mut spans);
                    assert_eq!((spans[0].t0, spans[spans.len() - 1].t1), (0.0, 1.0));
                    assert!(spans.windows(2).all(|w| w[0].t1 == w[1].t0), "{spans:?}");
                    for s in &spans {
                        for (t, z) in [(s.t0, s.z0), (s.t1, s.z1)] {
                            // The lid, not the bottom that ends on the same border.
                            let want = (LID + 0.1 * (a[0] + t * (b[0] - a[0]))) * NM_PER_MM;
                            assert!((z - want).abs() < 1.0, "{i}: {a:?} to {b:?} at {t}: {z} for {want}");
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn strokes_end_at_the_border_where_they_leave_the_part() {
        let mut spans = Vec::new();
        let mut cursor = Cursor::default();
        let part = solid([1.0, 0.0]);
        for (beside, is_off) in [(1, false), (2, true), (5, true)] {
            let y = -f64::from(beside) / NM_PER_MM;
            part.walk(place([1.0, 0.0], [7.0, y]), place([1.0, 0.0], [7.5, y]), &mut cursor, &mut spans);
            assert_eq!(spans.iter().any(|s| s.facet().is_none()), is_off, "{beside} nm beside");
        }
        // Over the border at a right angle and at a small one: the mark ends on the border.
        for (dx, dy) in [(0.0, -1.0), (10.0, -1e-5)] {
            let (a, b) = (place([1.0, 0.0], [20.0, -dy]), place([1.0, 0.0], [20.0 + dx, dy]));
            part.walk(a, b, &mut cursor, &mut spans);
            let gap = spans[spans.len() - 1];
            assert!(gap.facet().is_none() && gap.t1 == 1.0 && (gap.t0 - 0.5).abs() < 1e-9, "{spans:?}");
        }
    }
}
