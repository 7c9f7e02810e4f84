//! Outlines as polylines in page mm: curves are flattened after all scales, in f64, with a bound.
//!
//! The second derivative of a cubic is at most 6 times its largest second difference of control points, that of a
//! quadratic twice the only one: from it follow the [`steps`] that a curve takes.

use std::f64::consts::TAU;
use terrace_core::math;

use svg_style::Map;

use crate::texture::artwork::{MAX_MM, Stop, arc_steps, counted, steps};
use crate::texture::clip::{Polylines, extent, is_hairline, traced_twice};
use crate::texture::place::LEAST;
use terrace_core::geom::PlanePoint;

/// Which kinds of subpaths of an element are not drawn.
#[derive(Debug, Default, PartialEq, Eq)]
pub(super) struct DroppedSubpaths {
    /// Some without extent.
    pub(super) dots: bool,
    /// Some that are closed and thinner than the tolerance: they bound no area.
    pub(super) hairlines: bool,
}

/// What the subpaths of an element mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum OutlineUse {
    /// They are marked along themselves.
    Line,
    /// They bound an area.
    Area,
}

/// What the subpaths of an element are drawn into, in the element's coordinates.
pub(super) trait Sink {
    /// The last point.
    fn at(&self) -> PlanePoint;
    fn move_to(&mut self, p: PlanePoint);
    fn line_to(&mut self, p: PlanePoint);
    fn quad_to(&mut self, c: PlanePoint, p: PlanePoint);
    fn cubic_to(&mut self, c: PlanePoint, d: PlanePoint, p: PlanePoint);
    /// The elliptic arc of path data, by SVG 1.1 appendix F.6: `turn` is the angle of the first radius
    /// in degrees.
    fn arc_to(&mut self, radii: [f64; 2], turn: f64, large: bool, sweep: bool, p: PlanePoint);
    /// A whole ellipse with axes along x and y, starting on +x, as one closed subpath.
    fn ellipse(&mut self, centre: PlanePoint, rx: f64, ry: f64);
    fn close(&mut self);
    /// Notes a figure that has no extent.
    fn dot(&mut self);
}

/// Draws one element's subpaths into `lines` as polylines.
pub(super) struct Outline<'a> {
    map: Map,
    tolerance: f64,
    outline_use: OutlineUse,
    lines: &'a mut Polylines,
    start: PlanePoint,
    at: PlanePoint,
    stop: Option<Stop>,
    dropped: DroppedSubpaths,
}

impl<'a> Outline<'a> {
    pub(super) fn new(map: Map, tolerance: f64, outline_use: OutlineUse, lines: &'a mut Polylines) -> Self {
        Self {
            map,
            tolerance,
            outline_use,
            lines,
            start: [0.0; 2],
            at: [0.0; 2],
            stop: None,
            dropped: DroppedSubpaths::default(),
        }
    }

    /// Ends the element: what was left out, or why it could not be drawn.
    pub(super) fn end(mut self) -> Result<DroppedSubpaths, Stop> {
        self.end_line();
        match self.stop {
            Some(stop) => Err(stop),
            None => Ok(self.dropped),
        }
    }

    /// The image under `axes` of the unit circle's arc from angle `a0` over `by`; ends in `p`.
    fn sweep(&mut self, axes: Map, a0: f64, by: f64, p: PlanePoint) {
        let steps = arc_steps(by, largest_radius(self.map.after(axes)), self.tolerance);
        self.curve(steps, p, |t| {
            let (sin, cos) = math::sin_cos(a0 + t * by);
            axes.at([cos, sin])
        });
    }

    /// Appends a curve from the last point to `p`.
    fn curve(&mut self, steps: f64, p: PlanePoint, point: impl Fn(f64) -> PlanePoint) {
        let from = self.at;
        self.at = p;
        if self.stop.is_some() {
            return;
        }
        if self.lines.points.len() == self.lines.tail() {
            self.put(from);
        }
        match counted(steps, self.lines.points.len()) {
            Ok(n) => {
                (1..n).for_each(|k| self.put(point(k as f64 / steps)));
                self.put(p);
            }
            Err(stop) => self.stop = Some(stop),
        }
    }

    fn put(&mut self, p: PlanePoint) {
        let p = self.map.at(p);
        if p.iter().all(|v| v.abs() <= MAX_MM) {
            self.lines.points.push(p);
        } else {
            self.stop = Some(Stop::Far);
        }
    }

    /// Ends the subpath, keeping it if it can be marked.
    fn end_line(&mut self) {
        let tail = self.lines.tail();
        let line = &self.lines.points[tail..];
        if line.is_empty() {
            return;
        }
        // A line that returns on itself is marked once. Of an area it is a hairline.
        if self.outline_use == OutlineUse::Line
            && self.stop.is_none()
            && let Some(once) = traced_twice(line, self.tolerance)
        {
            self.lines.points.truncate(tail);
            return self.lines.push(&once);
        }
        let [w, h] = extent(line);
        if self.stop.is_none() && w.max(h) >= LEAST && !is_hairline(line, self.tolerance) {
            return self.lines.finish();
        }
        *(if w.max(h) < LEAST { &mut self.dropped.dots } else { &mut self.dropped.hairlines }) = true;
        self.lines.points.truncate(tail);
    }
}

impl Sink for Outline<'_> {
    fn at(&self) -> PlanePoint {
        self.at
    }

    fn move_to(&mut self, p: PlanePoint) {
        self.end_line();
        self.start = p;
        self.at = p;
    }

    fn line_to(&mut self, p: PlanePoint) {
        self.curve(1.0, p, |_| p);
    }

    fn quad_to(&mut self, c: PlanePoint, p: PlanePoint) {
        let a = self.at;
        let m = self.map;
        let steps = steps(2.0 * bend(m, a, c, p), self.tolerance, 1.0);
        self.curve(steps, p, |t| {
            let s = 1.0 - t;
            [0, 1].map(|k| s * s * a[k] + 2.0 * s * t * c[k] + t * t * p[k])
        });
    }

    fn cubic_to(&mut self, c: PlanePoint, d: PlanePoint, p: PlanePoint) {
        let a = self.at;
        let m = self.map;
        let steps = steps(6.0 * bend(m, a, c, d).max(bend(m, c, d, p)), self.tolerance, 1.0);
        self.curve(steps, p, |t| {
            let s = 1.0 - t;
            [0, 1].map(|k| s * s * s * a[k] + 3.0 * s * t * (s * c[k] + t * d[k]) + t * t * t * p[k])
        });
    }

    fn arc_to(&mut self, radii: [f64; 2], turn: f64, large: bool, sweep: bool, p: PlanePoint) {
        let from = self.at;
        let [mut rx, mut ry] = radii.map(f64::abs);
        if from == p {
            return;
        }
        if rx == 0.0 || ry == 0.0 {
            return self.line_to(p);
        }
        let (sin, cos) = math::sin_cos(turn.to_radians());
        let half = [(from[0] - p[0]) / 2.0, (from[1] - p[1]) / 2.0];
        // The half chord in the frame of a unit circle.
        let mut u = [(cos * half[0] + sin * half[1]) / rx, (cos * half[1] - sin * half[0]) / ry];
        let reach = math::hypot(u[0], u[1]);
        if reach > 1.0 {
            // Radii that cannot span the chord grow until they do.
            (rx, ry) = (rx * reach, ry * reach);
            u = u.map(|v| v / reach);
        }
        let q = (u[0] * u[0] + u[1] * u[1]).min(1.0);
        if q == 0.0 {
            // So flat that it cannot be told from its chord.
            return self.line_to(p);
        }
        let side = if large == sweep { -1.0 } else { 1.0 } * ((1.0 - q) / q).sqrt();
        let centre = [side * u[1], -side * u[0]];
        let a0 = math::atan2(u[1] - centre[1], u[0] - centre[0]);
        // From the chord, not from two angles: their difference would be noise on flat arcs.
        let minor = 2.0 * math::asin(q.sqrt());
        let by = if large { TAU - minor } else { minor } * if sweep { 1.0 } else { -1.0 };
        let mid = [(from[0] + p[0]) / 2.0, (from[1] + p[1]) / 2.0];
        let axes = Map { a: cos * rx, b: sin * rx, c: -sin * ry, d: cos * ry, e: mid[0], f: mid[1] };
        self.sweep(axes.after(Map::shift(centre)), a0, by, p);
    }

    fn ellipse(&mut self, centre: PlanePoint, rx: f64, ry: f64) {
        let start = [centre[0] + rx, centre[1]];
        self.move_to(start);
        self.sweep(Map::scale(rx, ry, centre), 0.0, TAU, start);
        self.end_line();
    }

    fn dot(&mut self) {
        self.dropped.dots = true;
    }

    fn close(&mut self) {
        if self.at != self.start {
            self.line_to(self.start);
        }
        self.end_line();
        self.at = self.start;
    }
}

/// Length of the second difference of three points after the map.
fn bend(m: Map, p: PlanePoint, q: PlanePoint, r: PlanePoint) -> f64 {
    let [x, y] = [0, 1].map(|k| p[k] - 2.0 * q[k] + r[k]);
    math::hypot(m.a * x + m.c * y, m.b * x + m.d * y)
}

/// The longest image of a unit vector: the map's larger singular value.
fn largest_radius(m: Map) -> f64 {
    let squares = (m.a * m.a + m.b * m.b + m.c * m.c + m.d * m.d) / 2.0;
    let det = m.a * m.d - m.b * m.c;
    (squares + (squares * squares - det * det).max(0.0).sqrt()).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::texture::clip::is_closed;
    use terrace_core::random::Random;

    fn drawn(map: Map, tolerance: f64, draw: impl FnOnce(&mut Outline<'_>)) -> Polylines {
        let mut lines = Polylines::default();
        let mut outline = Outline::new(map, tolerance, OutlineUse::Area, &mut lines);
        draw(&mut outline);
        outline.end().expect("drawn");
        lines
    }

    /// Largest distance of the curve from the polyline, sampled.
    fn miss(line: &[PlanePoint], curve: impl Fn(f64) -> PlanePoint) -> f64 {
        (0..=2000)
            .map(|i| {
                let p = curve(f64::from(i) / 2000.0);
                let to = |w: &[PlanePoint]| {
                    let d = [w[1][0] - w[0][0], w[1][1] - w[0][1]];
                    let v = [p[0] - w[0][0], p[1] - w[0][1]];
                    let t = ((d[0] * v[0] + d[1] * v[1]) / (d[0] * d[0] + d[1] * d[1])).clamp(0.0, 1.0);
                    math::hypot(v[0] - t * d[0], v[1] - t * d[1])
                };
                line.windows(2).filter(|w| w[0] != w[1]).map(to).fold(f64::INFINITY, f64::min)
            })
            .fold(0.0, f64::max)
    }

    #[test]
    fn curves_keep_their_tolerance_under_any_map() {
        let mut tried = 0;
        for seed in 0..70 {
            let mut noise = Random::case(seed);
            let p = [0; 4].map(|_| [0; 2].map(|_| noise.range(-10.0, 10.0)));
            let m = [0; 4].map(|_| noise.range(-3.0, 3.0));
            let tolerance = noise.range(0.0005, 0.5);
            let map = Map { a: m[0], b: m[1], c: m[2], d: m[3], e: 1.0, f: -2.0 };
            let is_near =
                |line: &[PlanePoint], curve: &dyn Fn(f64) -> PlanePoint| miss(line, curve) <= tolerance * 1.000001;

            let cubic = |t: f64| {
                let s = 1.0 - t;
                let of = [s.powi(3), 3.0 * s * s * t, 3.0 * s * t * t, t.powi(3)];
                map.at([0, 1].map(|k| (0..4).map(|i| of[i] * p[i][k]).sum()))
            };
            let lines = drawn(map, tolerance, |o| {
                o.move_to(p[0]);
                o.cubic_to(p[1], p[2], p[3]);
            });
            if lines.len() != 1 {
                continue;
            }
            assert!(is_near(lines.get(0), &cubic), "seed {seed}: the cubic curve");

            let quad = |t: f64| {
                let s = 1.0 - t;
                let of = [s * s, 2.0 * s * t, t * t];
                map.at([0, 1].map(|k| (0..3).map(|i| of[i] * p[i][k]).sum()))
            };
            let lines = drawn(map, tolerance, |o| {
                o.move_to(p[0]);
                o.quad_to(p[1], p[2]);
            });
            if lines.len() != 1 {
                continue;
            }
            assert!(is_near(lines.get(0), &quad), "seed {seed}: the quadratic curve");

            let ([x, y], [rx, ry]) = (p[0], p[1].map(|v| v.abs() + 0.5));
            let ellipse = |t: f64| {
                let (sin, cos) = math::sin_cos(TAU * t);
                map.at([x + rx * cos, y + ry * sin])
            };
            let lines = drawn(map, tolerance, |o| o.ellipse([x, y], rx, ry));
            if lines.len() != 1 {
                continue;
            }
            assert!(lines.get(0).len() > 8 && is_closed(lines.get(0)), "seed {seed}: the ellipse");
            assert!(is_near(lines.get(0), &ellipse), "seed {seed}: the ellipse");
            tried += 1;
        }
        assert!(tried >= 64, "{tried} sets of curves");
    }

    #[test]
    fn arcs_lie_on_their_ellipse_and_end_where_they_should() {
        let mut tried = 0;
        for seed in 0..70 {
            let mut noise = Random::case(seed);
            let [from, to] = [0; 2].map(|_| [0; 2].map(|_| noise.range(-10.0, 10.0)));
            let radii = [0; 2].map(|_| noise.range(-10.0, 10.0).abs() + 12.0);
            let turn = noise.range(0.0, 360.0);
            let (large, sweep) = (noise.chance(50), noise.chance(50));
            let id = Map::shift([0.0; 2]);
            let lines = drawn(id, 1e-3, |o| {
                o.move_to(from);
                o.arc_to(radii, turn, large, sweep, to);
            });
            if lines.len() != 1 {
                continue;
            }
            let line = lines.get(0);
            assert_eq!((line[0], line[line.len() - 1]), (from, to), "seed {seed}");
            // In the frame of the ellipse the points have one distance from one centre.
            let (s, k) = math::sin_cos(turn.to_radians());
            let unit: Vec<PlanePoint> =
                line.iter().map(|p| [(k * p[0] + s * p[1]) / radii[0], (k * p[1] - s * p[0]) / radii[1]]).collect();
            let n = unit.len();
            if n < 3 {
                continue;
            }
            let bend = |w: &[PlanePoint]| {
                let (a, b) = ([w[1][0] - w[0][0], w[1][1] - w[0][1]], [w[2][0] - w[1][0], w[2][1] - w[1][1]]);
                math::atan2(a[0] * b[1] - a[1] * b[0], a[0] * b[0] + a[1] * b[1])
            };
            let turned: f64 = unit.windows(3).map(bend).sum::<f64>() * (n - 1) as f64 / (n - 2) as f64;
            assert_eq!(turned > 0.0, sweep, "seed {seed}");
            assert_eq!(turned.abs() > std::f64::consts::PI, large, "seed {seed}: turned {turned}");
            let chord = math::hypot(unit[n - 1][0] - unit[0][0], unit[n - 1][1] - unit[0][1]);
            let want = 2.0 * math::sin(turned.abs() / 2.0);
            assert!((chord - want).abs() < 1e-6, "seed {seed}: a chord of the unit circle");
            tried += 1;
        }
        assert!(tried >= 64, "{tried} arcs");
    }

    #[test]
    fn slivers_and_dots_are_told_from_figures() {
        let id = Map::shift([0.0; 2]);
        let figure = |points: &[PlanePoint]| {
            let mut lines = Polylines::default();
            let mut o = Outline::new(id, 1e-3, OutlineUse::Area, &mut lines);
            o.move_to(points[0]);
            points[1..].iter().for_each(|&p| o.line_to(p));
            o.close();
            let dropped = o.end().expect("drawn");
            (lines.len(), dropped.dots, dropped.hairlines)
        };
        assert_eq!(figure(&[[0.0, 0.0], [100.0, 0.0], [100.0, 1e-5], [0.0, 1e-5]]), (0, false, true));
        assert_eq!(figure(&[[0.0, 0.0], [100.0, 0.0], [100.0, 2e-3], [0.0, 2e-3]]), (1, false, false));
        assert_eq!(
            figure(&[[0.0, 0.0], [10.0, 10.0], [10.0, 0.0], [0.0, 10.0]]),
            (1, false, false),
            "a figure of eight"
        );
        assert_eq!(figure(&[[1.0, 1.0], [1.0, 1.0]]), (0, true, false));
    }
}
