//! Polylines with a width: the area that AutoCAD fills.
//!
//! Each segment is a closed contour, counter-clockwise in the plane of the polyline, and each mitre between two
//! straight segments another one; the area is what any of them goes round. Ends are butt, straight segments meet in
//! mitres, arcs meet their neighbours without one, and widths change linearly along a segment. Segments of width 0 have
//! no area: they are lines.
//!
//! Where straight segments meet at less than 30 deg, or with different widths, AutoCAD cuts the corner by rules that
//! are not documented: there the corner is bevelled, and the polyline reported.

use super::entity::Polyline;
use super::outline::{Arc, Heading, Outline, Vertex};
use super::space::{add, cross, dot, length, sub, times, unit};
use terrace_core::geom::SpacePoint;

/// Cosine of the turn beyond which two segments meet at less than 30 deg.
const SHARP: f64 = -0.866_025_403_784_438_6;

/// Directions that differ by less, rad, are one.
const TANGENT: f64 = 1e-6;

/// From one vertex to the next.
struct Segment {
    from: SpacePoint,
    to: SpacePoint,
    /// None for a straight one.
    arc: Option<Arc>,
    widths: [f64; 2],
    /// Directions at both ends.
    along: [SpacePoint; 2],
}

impl Segment {
    fn new(a: &Vertex, b: &Vertex) -> Option<Self> {
        let chord = unit(sub(b.p, a.p))?;
        let widths = a.widths.map(f64::abs);
        let arc = Arc::of_bulge(a.p, b.p, a.bulge);
        let along = match &arc {
            None => [chord; 2],
            Some(arc) => {
                [arc.start, arc.start + arc.by].map(|t| times(unit(arc.slope(t)).unwrap_or(chord), arc.by.signum()))
            }
        };
        Some(Self { from: a.p, to: b.p, arc, widths, along })
    }

    /// A point at one of its ends, beside the line: to the left where the side is positive.
    fn beside(&self, end: usize, side: f64) -> SpacePoint {
        let p = [self.from, self.to][end];
        add(p, times(left(self.along[end]), side * self.widths[end] / 2.0))
    }

    /// Draws the area of the segment; returns whether no side of it passes the centre of its arc.
    fn draw(&self, out: &mut Outline<'_>) -> bool {
        out.move_to(self.beside(0, -1.0));
        let is_sound = match &self.arc {
            None => {
                out.line_to(self.beside(1, -1.0));
                out.line_to(self.beside(1, 1.0));
                out.line_to(self.beside(0, 1.0));
                true
            }
            Some(arc) => {
                // Its left is the side of the centre where it turns left.
                let half = self.widths.map(|w| w / 2.0 * arc.by.signum());
                let radius = length(arc.a);
                out.spiral(arc, [radius + half[0], radius + half[1]], Heading::AlongArc);
                out.line_to(self.beside(1, 1.0));
                out.spiral(arc, [radius - half[0], radius - half[1]], Heading::AgainstArc);
                half.iter().all(|h| h.abs() <= radius)
            }
        };
        out.close();
        is_sound
    }
}

fn left([x, y, _]: SpacePoint) -> SpacePoint {
    [-y, x, 0.0]
}

/// Draws the area of all segments with a width; returns whether it is that of AutoCAD for certain.
pub(super) fn areas(line: &Polyline, out: &mut Outline<'_>) -> bool {
    let segments = segments(line);
    let mut is_certain = true;
    for segment in segments.iter().filter(|s| s.widths != [0.0; 2]) {
        is_certain &= segment.draw(out);
    }
    // The last segment of a closed one meets the first.
    let around = segments.last().filter(|_| line.is_closed);
    let pairs: Vec<&Segment> = around.into_iter().chain(&segments).collect();
    for pair in pairs.windows(2) {
        is_certain &= corner(pair[0], pair[1], out);
    }
    is_certain
}

/// The runs of vertices without a width between them, to be drawn as lines.
pub(super) fn hairlines(line: &Polyline) -> Vec<Polyline> {
    let n = line.vertices.len();
    let ends = if line.is_closed { n } else { n.saturating_sub(1) };
    let mut runs: Vec<Polyline> = Vec::new();
    let mut is_open = false;
    for i in 0..ends {
        let a = line.vertices[i];
        let b = line.vertices[(i + 1) % n];
        let is_thin = a.widths == [0.0; 2] && a.p != b.p;
        match runs.last_mut().filter(|_| is_open && is_thin) {
            Some(run) => {
                run.vertices.pop();
                run.vertices.extend([a, b]);
            }
            None if is_thin => runs.push(Polyline { vertices: vec![a, b], ..Polyline::default() }),
            None => {}
        }
        is_open = is_thin;
    }
    runs
}

fn segments(line: &Polyline) -> Vec<Segment> {
    let back = line.vertices.first().filter(|_| line.is_closed);
    let ends = line.vertices.iter().skip(1).chain(back);
    line.vertices.iter().zip(ends).filter_map(|(a, b)| Segment::new(a, b)).collect()
}

/// Draws the mitre between two segments; returns whether the corner is that of AutoCAD for certain.
fn corner(a: &Segment, b: &Segment, out: &mut Outline<'_>) -> bool {
    let before = a.along[1];
    let after = b.along[0];
    let turn = cross(before, after)[2];
    let is_wide = a.widths[1] > 0.0 && b.widths[0] > 0.0;
    if !is_wide || a.arc.is_some() || b.arc.is_some() || (turn.abs() < TANGENT && dot(before, after) > 0.0) {
        return true;
    }
    let side = -turn.signum();
    let p = a.beside(1, side);
    let q = b.beside(0, side);
    let is_known = dot(before, after) > SHARP && (a.widths[1] - b.widths[0]).abs() < 1e-9 * a.widths[1];
    // Where the outer sides meet: the lines through p along u and through q along v.
    let u = sub(p, a.beside(0, side));
    let v = sub(q, b.beside(1, side));
    let area = cross(u, v)[2];
    let tip = add(p, times(u, cross(sub(q, p), v)[2] / area));
    let tip = Some(tip).filter(|t| is_known && t.iter().all(|c| c.is_finite()));
    let mut ring: Vec<SpacePoint> = [Some(a.to), Some(p), tip, Some(q)].into_iter().flatten().collect();
    if turn < 0.0 {
        ring.reverse();
    }
    out.move_to(ring[0]);
    ring[1..].iter().for_each(|&p| out.line_to(p));
    out.close();
    tip.is_some()
}

#[cfg(test)]
mod tests {
    use super::super::space::SpaceMap;
    use super::*;
    use crate::texture::clip::Polylines;
    use terrace_core::math;
    use terrace_core::random::Random;

    fn polyline(rows: &[[f64; 5]], is_closed: bool) -> Polyline {
        let vertex = |&[x, y, bulge, from, to]: &[f64; 5]| Vertex { p: [x, y, 0.0], bulge, widths: [from, to] };
        Polyline { vertices: rows.iter().map(vertex).collect(), is_closed, is_spatial: false }
    }

    fn drawn(line: &Polyline) -> (Polylines, bool) {
        let mut lines = Polylines::default();
        let mut out = Outline::new(SpaceMap::scale([1.0; 3]), 1e-5, &mut lines);
        let is_certain = areas(line, &mut out);
        out.end().expect("drawn");
        (lines, is_certain)
    }

    /// How often the contours go round a point.
    fn winding(lines: &Polylines, [x, y]: [f64; 2]) -> i32 {
        let turns = lines.iter().flat_map(|l| l.windows(2)).map(|w| {
            let [a, b] = [w[0], w[1]];
            let side = (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0]);
            i32::from(a[1] <= y && b[1] > y && side > 0.0) - i32::from(b[1] <= y && a[1] > y && side < 0.0)
        });
        turns.sum()
    }

    fn assert_area(line: &Polyline, holds: impl Fn([f64; 2]) -> bool) {
        let (lines, is_certain) = drawn(line);
        assert!(is_certain);
        let mut noise = Random::case(3);
        let mut inside = 0;
        for _ in 0..4000 {
            let p = [noise.range(-4.0, 14.0), noise.range(-4.0, 14.0)];
            let n = winding(&lines, p);
            assert!(n >= 0, "all contours run one way");
            assert_eq!(n > 0, holds(p), "{p:?}");
            inside += u32::from(n > 0);
        }
        assert!((100..3900).contains(&inside), "{inside}");
    }

    #[test]
    fn closed_square_has_mitred_corners_both_ways_round() {
        let band = |[x, y]: [f64; 2]| {
            let within = |lo: f64, hi: f64| lo < x && x < hi && lo < y && y < hi;
            within(-1.0, 11.0) && !within(1.0, 9.0)
        };
        let corners = [[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]];
        let rows = corners.map(|[x, y]| [x, y, 0.0, 2.0, 2.0]);
        assert_area(&polyline(&rows, true), band);
        let mut back = rows;
        back.reverse();
        assert_area(&polyline(&back, true), band);
    }

    #[test]
    fn tapered_segments_and_arcs_have_the_area_of_their_widths() {
        let arrow = polyline(&[[0.0, 5.0, 0.0, 4.0, 0.0], [10.0, 5.0, 0.0, 0.0, 0.0]], false);
        assert_area(&arrow, |[x, y]| 0.0 < x && x < 10.0 && (y - 5.0).abs() < 2.0 - 0.2 * x);
        for (bulge, up) in [(1.0, -1.0), (-1.0, 1.0)] {
            let half = polyline(&[[0.0, 5.0, bulge, 2.0, 4.0], [10.0, 5.0, 0.0, 0.0, 0.0]], false);
            assert_area(&half, |[x, y]| {
                let (dx, dy) = (x - 5.0, (y - 5.0) * up);
                let along = math::atan2(dy, -dx) / std::f64::consts::PI;
                dy > 0.0 && (math::hypot(dx, dy) - 5.0).abs() < 1.0 + along
            });
        }
    }

    #[test]
    fn corners_without_a_known_rule_are_bevelled_and_reported() {
        for (what, rows) in [
            ("sharp", [[0.0, 0.0, 0.0, 1.0, 1.0], [10.0, 0.0, 0.0, 1.0, 1.0], [0.0, 4.0, 0.0, 0.0, 0.0]]),
            ("other width", [[0.0, 0.0, 0.0, 1.0, 1.0], [10.0, 0.0, 0.0, 3.0, 1.0], [10.0, 9.0, 0.0, 0.0, 0.0]]),
            (
                "wider than its radius",
                [[0.0, 0.0, 1.0, 9.0, 9.0], [4.0, 0.0, 0.0, 1.0, 1.0], [9.0, 0.0, 0.0, 0.0, 0.0]],
            ),
        ] {
            assert!(!drawn(&polyline(&rows, false)).1, "{what}");
        }
    }

    #[test]
    fn parts_without_width_are_lines() {
        let rows = [
            [0.0, 0.0, 0.5, 0.0, 0.0],
            [3.0, 0.0, 0.0, 0.0, 0.0],
            [6.0, 0.0, 0.0, 2.0, 0.0],
            [9.0, 0.0, 0.0, 0.0, 0.0],
        ];
        let runs = hairlines(&polyline(&rows, true));
        let shown: Vec<(usize, f64, f64)> =
            runs.iter().map(|r| (r.vertices.len(), r.vertices[0].p[0], r.vertices[0].bulge)).collect();
        assert_eq!(shown, [(3, 0.0, 0.5), (2, 9.0, 0.0)]);
    }
}
