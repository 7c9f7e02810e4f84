//! Outlines as polylines in mm: curves are flattened after all maps, in f64, with a bound.
//!
//! An arc takes even [`steps`]. A Bézier curve with positive weights lies in the hull of its control points: it is
//! halved until these lie within the tolerance of its chord. Everything is kept in space until a point is put down:
//! there flat lines drop z, and nowhere else.

use std::f64::consts::FRAC_PI_4;
use terrace_core::math;

use super::space::{SpaceMap, add, largest_radius, length, sub, times};
use super::spline::Bezier;
use crate::texture::artwork::{MAX_MM, MAX_POINTS, Stop, arc_steps, counted, steps};
use crate::texture::clip::{Polylines, extent};
use crate::texture::place::{LEAST, NM};
use terrace_core::geom::SpacePoint;

/// Most halvings of a Bézier curve, one in the other; a curve within [`MAX_MM`] needs fewer.
const MAX_HALVINGS: usize = 40;

/// A vertex of a polyline, and what leads to the next one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Vertex {
    pub(super) p: SpacePoint,
    /// Tangent of a quarter of the angle of the arc to the next vertex.
    pub(super) bulge: f64,
    /// At both ends of what leads to the next vertex.
    pub(super) widths: [f64; 2],
}

/// Part of an ellipse: centre + a cos t + b sin t for t from `start` over `by`, rad.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Arc {
    pub(super) centre: SpacePoint,
    pub(super) a: SpacePoint,
    pub(super) b: SpacePoint,
    pub(super) start: f64,
    pub(super) by: f64,
}

impl Arc {
    fn at(&self, t: f64) -> SpacePoint {
        let (sin, cos) = math::sin_cos(t);
        add(self.centre, add(times(self.a, cos), times(self.b, sin)))
    }

    /// The direction in which it runs where `by` is positive.
    pub(super) fn slope(&self, t: f64) -> SpacePoint {
        let (sin, cos) = math::sin_cos(t);
        add(times(self.a, -sin), times(self.b, cos))
    }

    /// The arc from `p` to `q` in the plane of their z whose included angle is four times the arctangent of `bulge`,
    /// counter-clockwise where that is positive. None where it cannot be told from its chord, or has no finite radius.
    pub(super) fn of_bulge(p: SpacePoint, q: SpacePoint, bulge: f64) -> Option<Self> {
        let half = times(sub(q, p), 0.5);
        let side = (1.0 - bulge * bulge) / (2.0 * bulge);
        let centre = [p[0] + half[0] - side * half[1], p[1] + half[1] + side * half[0], p[2]];
        let a = sub(p, centre);
        let is_sound = centre.iter().all(|v| v.is_finite()) && bulge != 0.0 && length(half) > 0.0;
        is_sound.then_some(Self { centre, a, b: [-a[1], a[0], 0.0], start: 0.0, by: 4.0 * math::atan(bulge) })
    }
}

/// Draws one entity's lines into `lines`. Coordinates are those of the entity.
pub(super) struct Outline<'a> {
    map: SpaceMap,
    tolerance: f64,
    lines: &'a mut Polylines,
    start: SpacePoint,
    at: SpacePoint,
    stop: Option<Stop>,
    /// Whether a part without extent was left out.
    has_dots: bool,
    /// Lowest and highest point put down.
    z: [f64; 2],
}

/// Which way a line runs beside an arc.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Heading {
    /// From the start of the arc to its end.
    AlongArc,
    /// From its end to its start.
    AgainstArc,
}

/// What is known of an entity once it is drawn.
#[derive(Clone, Copy, Debug)]
pub(super) struct OutlineReport {
    /// Whether a part without extent was left out.
    pub(super) has_dots: bool,
    /// Lowest and highest point, mm.
    pub(super) z: [f64; 2],
}

impl<'a> Outline<'a> {
    pub(super) fn new(map: SpaceMap, tolerance: f64, lines: &'a mut Polylines) -> Self {
        let z = [f64::INFINITY, f64::NEG_INFINITY];
        Self { map, tolerance, lines, start: [0.0; 3], at: [0.0; 3], stop: None, has_dots: false, z }
    }

    pub(super) fn move_to(&mut self, p: SpacePoint) {
        self.end_line();
        self.start = p;
        self.at = p;
    }

    pub(super) fn line_to(&mut self, p: SpacePoint) {
        self.begin();
        self.put(p);
        self.at = p;
    }

    pub(super) fn close(&mut self) {
        if self.at != self.start {
            self.line_to(self.start);
        }
        self.end_line();
    }

    /// A part of an ellipse as a line of its own.
    pub(super) fn arc(&mut self, arc: &Arc) {
        self.move_to(arc.at(arc.start));
        let is_whole = arc.by.abs() >= std::f64::consts::TAU;
        let end = if is_whole { self.start } else { arc.at(arc.start + arc.by) };
        self.arc_to(arc, end);
    }

    /// The rest of an arc that begins at the last point; ends in `end`.
    pub(super) fn arc_to(&mut self, arc: &Arc, end: SpacePoint) {
        let [a, b] = [arc.a, arc.b].map(|v| self.map.along(v));
        let steps = arc_steps(arc.by, largest_radius(a, b), self.tolerance);
        self.begin();
        if self.stop.is_some() {
            return;
        }
        match counted(steps, self.lines.points.len()) {
            Ok(n) => {
                (1..n).for_each(|k| self.put(arc.at(arc.start + arc.by * (k as f64 / steps))));
                self.put(end);
                self.at = end;
            }
            Err(stop) => self.stop = Some(stop),
        }
    }

    /// What runs beside an arc of a circle, at distances from its centre that change evenly from one end to the other.
    pub(super) fn spiral(&mut self, arc: &Arc, radii: [f64; 2], heading: Heading) {
        let [a, b] = [arc.a, arc.b].map(|v| self.map.along(v));
        let [r, s] = radii.map(|v| v / length(arc.a));
        // |p''| over the angle is at most r + 2 r', times the stretch of the map.
        let bend = largest_radius(a, b) * (r.abs().max(s.abs()) + 2.0 * ((s - r) / arc.by).abs());
        let steps = steps(arc.by * arc.by * bend, self.tolerance, (arc.by.abs() / FRAC_PI_4).ceil());
        if steps.is_nan() || steps > MAX_POINTS as f64 {
            self.stop = Some(Stop::Full);
            return;
        }
        for k in 0..=steps as usize {
            let t = match heading {
                Heading::AlongArc => k as f64 / steps,
                Heading::AgainstArc => 1.0 - k as f64 / steps,
            };
            let from_centre = sub(arc.at(arc.start + arc.by * t), arc.centre);
            self.line_to(add(arc.centre, times(from_centre, r + (s - r) * t)));
        }
    }

    /// A line or arc to the next vertex of a polyline; returns whether the bulge could be drawn as it is.
    pub(super) fn bulge_to(&mut self, p: SpacePoint, bulge: f64) -> bool {
        if bulge == 0.0 || p == self.at {
            self.line_to(p);
            return true;
        }
        // Its height over the chord says whether it is more than a line.
        let is_flat = bulge.abs() * length(self.map.along(sub(p, self.at))) < LEAST;
        match Arc::of_bulge(self.at, p, bulge).filter(|arc| length(self.map.along(arc.a)) < MAX_MM) {
            Some(arc) if !is_flat => self.arc_to(&arc, p),
            _ => {
                self.line_to(p);
                return is_flat;
            }
        }
        true
    }

    /// Pieces of a B-spline, one after the other.
    pub(super) fn spline(&mut self, pieces: &[Bezier]) {
        for piece in pieces {
            let piece = piece.mapped(self.map);
            let start = piece.start();
            let tail = self.lines.tail();
            // Pieces of one spline meet but for the noise of f64; a gap in xy begins another line.
            let is_joined =
                self.lines.points[tail..].last().is_some_and(|p| math::hypot(p[0] - start[0], p[1] - start[1]) < NM);
            if !is_joined {
                self.end_line();
                self.put_mm(start);
            }
            self.flatten(piece);
        }
    }

    /// Halves a curve in mm until each part is as good as its chord.
    fn flatten(&mut self, curve: Bezier) {
        // The parts that are not put down yet, the next one last, each with how often it was halved.
        let mut rest = vec![(curve, 0)];
        while let Some((curve, depth)) = rest.pop() {
            if self.stop.is_some() {
                return;
            }
            if depth >= MAX_HALVINGS || curve.is_flat(self.tolerance) {
                self.put_mm(curve.end());
            } else {
                let [first, second] = curve.halves();
                rest.push((second, depth + 1));
                rest.push((first, depth + 1));
            }
        }
    }

    /// Ends the entity; or says why it could not be drawn.
    pub(super) fn end(mut self) -> Result<OutlineReport, Stop> {
        self.end_line();
        match self.stop {
            Some(stop) => Err(stop),
            None => Ok(OutlineReport { has_dots: self.has_dots, z: self.z }),
        }
    }

    fn begin(&mut self) {
        if self.lines.points.len() == self.lines.tail() {
            self.put(self.at);
        }
    }

    /// Draws a line of one point.
    pub(super) fn dot(&mut self, p: SpacePoint) {
        self.end_line();
        self.put(p);
        if self.stop.is_none() {
            self.lines.finish();
        }
    }

    fn put(&mut self, p: SpacePoint) {
        self.put_mm(self.map.at(p));
    }

    fn put_mm(&mut self, p: SpacePoint) {
        if self.stop.is_some() {
            return;
        }
        let counts = if self.lines.is_spatial() { 3 } else { 2 };
        let is_near = p[..counts].iter().all(|v| v.abs() <= MAX_MM);
        if !is_near {
            self.stop = Some(Stop::Far);
        } else if self.lines.points.len() >= MAX_POINTS {
            self.stop = Some(Stop::Full);
        } else {
            self.z = [self.z[0].min(p[2]), self.z[1].max(p[2])];
            self.lines.put(p);
        }
    }

    /// Ends the line, keeping it if it can be marked.
    fn end_line(&mut self) {
        let tail = self.lines.tail();
        let line = &self.lines.points[tail..];
        if line.is_empty() {
            return;
        }
        let [w, h] = extent(line);
        if self.stop.is_none() && w.max(h) >= LEAST {
            return self.lines.finish();
        }
        self.has_dots = true;
        self.lines.truncate(self.lines.len());
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, PI, TAU};

    use super::*;
    use terrace_core::random::Random;

    fn drawn(map: SpaceMap, tolerance: f64, draw: impl FnOnce(&mut Outline<'_>)) -> Polylines {
        let mut lines = Polylines::default();
        let mut outline = Outline::new(map, tolerance, &mut lines);
        draw(&mut outline);
        outline.end().expect("drawn");
        lines
    }

    #[test]
    fn arcs_keep_their_tolerance_under_any_map() {
        for seed in 0..60 {
            let mut noise = Random::case(seed);
            let mut point = || [0; 3].map(|_| noise.range(-10.0, 10.0));
            let map = SpaceMap::of_extrusion(point()).after(SpaceMap::scale(point()));
            let arc = Arc { centre: point(), a: point(), b: point(), start: 1.0, by: point()[0] / 2.0 };
            let tolerance = math::pow(10f64, point()[1] / 5.0 - 2.0);
            let lines = drawn(map, tolerance, |o| o.arc(&arc));
            let line = lines.get(0);
            let worst = (0..=4000)
                .map(|i| {
                    let [x, y, _] = map.at(arc.at(1.0 + arc.by * f64::from(i) / 4000.0));
                    line.windows(2).map(|w| distance([x, y], w[0], w[1])).fold(f64::INFINITY, f64::min)
                })
                .fold(0.0, f64::max);
            assert!(worst <= tolerance * 1.000001, "seed {seed}: {worst} of {tolerance}");
        }
    }

    fn distance(p: [f64; 2], a: [f64; 2], b: [f64; 2]) -> f64 {
        let (d, v) = ([b[0] - a[0], b[1] - a[1]], [p[0] - a[0], p[1] - a[1]]);
        let t = ((d[0] * v[0] + d[1] * v[1]) / (d[0] * d[0] + d[1] * d[1])).clamp(0.0, 1.0);
        math::hypot(v[0] - t * d[0], v[1] - t * d[1])
    }

    #[test]
    fn bulges_have_the_centre_and_angle_of_the_reference() {
        let (p, q) = ([0.0; 3], [2.0, 0.0, 0.0]);
        for (bulge, centre, by) in
            [(1.0, [1.0, 0.0], PI), (-1.0, [1.0, 0.0], -PI), (math::tan(FRAC_PI_2), [1.0, -1e16], TAU)]
        {
            let arc = Arc::of_bulge(p, q, bulge).expect("an arc");
            assert!((arc.by - by).abs() < 1e-9, "{bulge}");
            assert!(
                bulge > 2.0 || math::hypot(arc.centre[0] - centre[0], arc.centre[1] - centre[1]) < 1e-12,
                "{bulge}"
            );
        }
        let quarter = Arc::of_bulge(p, q, math::tan(FRAC_PI_4 / 2.0)).expect("an arc");
        assert!(length(sub(quarter.centre, [1.0, 1.0, 0.0])) < 1e-12 && (quarter.by - FRAC_PI_2).abs() < 1e-12);
        assert_eq!(Arc::of_bulge(p, q, 1e308), None, "no finite radius");
        assert_eq!(Arc::of_bulge(p, p, 1.0), None, "no chord");
    }

    #[test]
    fn whole_circles_close_exactly_and_bulges_end_on_their_vertices() {
        let circle = Arc { centre: [0.1; 3], a: [0.3, 0.0, 0.0], b: [0.0, 0.3, 0.0], start: 0.7, by: TAU };
        let lines = drawn(SpaceMap::turn(33.0), 1e-4, |o| o.arc(&circle));
        assert_eq!(lines.get(0).first(), lines.get(0).last());
        let lines = drawn(SpaceMap::scale([1.0; 3]), 1e-4, |o| {
            o.move_to([0.1, 0.2, 0.0]);
            assert!(o.bulge_to([0.7, 0.9, 0.0], 0.4) && o.bulge_to([0.7, 0.9, 0.0], 1.0));
            assert!(!o.bulge_to([1.7, 0.9, 0.0], 1e308), "drawn straight, and said so");
            assert!(o.bulge_to([2.7, 0.9, 0.0], 1e-320), "as good as straight");
        });
        let line = lines.get(0);
        assert_eq!((line[0], line[line.len() - 1]), ([0.1, 0.2], [2.7, 0.9]));
        assert!(line.contains(&[0.7, 0.9]) && line.contains(&[1.7, 0.9]) && line.len() > 10);
    }
}
