//! Wide and dashed lines (kurbo): dashes cut out of an element's subpaths, and the area that a wide line covers.

use kurbo::{Arc, BezPath, Cap, Join, PathEl, Point as KurboPoint, Shape, StrokeOpts, SvgArc, Vec2};
use terrace_core::math;

use super::outline::Sink;
use terrace_core::geom::PlanePoint;

/// Most dashes of one element.
const MAX_DASHES: f64 = 1e6;

/// Dashes shorter than this share of the width are dots, which have a shape if their ends are not cut straight.
const DOT: f64 = 1e-6;

/// Joins that turn the line by less, rad, cut off nothing that shows.
const LEAST_TURN: f64 = 0.05;

/// How a line is drawn, in the element's units.
pub(super) struct Pen {
    pub(super) width: f64,
    pub(super) cap: Cap,
    pub(super) join: Join,
    pub(super) miter: f64,
    /// Lengths of dashes and gaps in turn, an even number; none for a full line.
    pub(super) dashes: Vec<f64>,
    pub(super) offset: f64,
}

impl Pen {
    /// Adds the triangle at a corner at which a line turns from one direction to another, unless nothing of it shows.
    fn add_inner_join(&self, corner: KurboPoint, from: Vec2, to: Vec2, out: &mut BezPath) {
        let cross = from.cross(to);
        let dot = from.dot(to);
        let hypot = math::hypot(cross, dot);
        // Mitred joins go through the corner; the condition is that of kurbo.
        let is_mitred = self.join == Join::Miter && 2.0 * hypot < (hypot + dot) * self.miter.powi(2);
        if is_mitred || math::atan2(cross, dot).abs() < LEAST_TURN {
            return;
        }
        let normal = |d: Vec2| self.width / 2.0 * Vec2::new(-d.y, d.x) / d.hypot();
        let [last, next] = [normal(from), normal(to)];
        // kurbo goes there along the side -normal, and back along +normal.
        let [a, b] = if cross > 0.0 { [next, last] } else { [-last, -next] };
        out.extend([PathEl::MoveTo(corner + a), PathEl::LineTo(corner), PathEl::LineTo(corner + b)]);
        out.close_path();
    }
}

/// More than [`MAX_DASHES`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct TooMany;

/// An element's subpaths as Bézier curves.
pub(super) struct Curves {
    path: BezPath,
    start: PlanePoint,
    at: PlanePoint,
    /// Largest distance of an arc from its curves, in the element's units.
    tolerance: f64,
}

impl Curves {
    pub(super) fn new(tolerance: f64) -> Self {
        Self { path: BezPath::new(), start: [0.0; 2], at: [0.0; 2], tolerance }
    }

    /// Takes out the subpaths that are drawn without going farther than `reach` from their first point; returns
    /// these.
    pub(super) fn take_dots(&mut self, reach: f64) -> Vec<PlanePoint> {
        let mut dots = Vec::new();
        let mut kept = BezPath::new();
        let elements = self.path.elements();
        for subpath in elements.chunk_by(|_, next| !matches!(next, PathEl::MoveTo(_))) {
            let PathEl::MoveTo(start) = subpath[0] else { unreachable!("a subpath begins with a move") };
            if !subpath.iter().all(|el| stays_near(el, start, reach)) {
                kept.extend(subpath.iter().copied());
            } else if subpath.len() > 1 {
                // A move alone draws nothing.
                dots.push([start.x, start.y]);
            }
        }
        self.path = kept;
        dots
    }

    /// Of all subpaths together.
    pub(super) fn length(&self) -> f64 {
        self.path.perimeter(self.tolerance)
    }

    /// Cuts the subpaths into dashes; returns the length that dashes of no length were given.
    pub(super) fn dash(&mut self, pen: &Pen) -> Result<f64, TooMany> {
        let period: f64 = pen.dashes.iter().sum();
        if self.path.perimeter(self.tolerance) / period * pen.dashes.len() as f64 > MAX_DASHES {
            return Err(TooMany);
        }
        // A dash of no length has no direction, which its ends need.
        let least = pen.width.max(self.tolerance) * DOT;
        let is_dash = |i: usize| i.is_multiple_of(2);
        let dashes: Vec<f64> =
            pen.dashes.iter().enumerate().map(|(i, d)| if is_dash(i) { d.max(least) } else { *d }).collect();
        self.path = kurbo::dash(self.path.iter(), pen.offset, &dashes).collect();
        Ok(least)
    }

    /// Replaces the lines by the area that they cover; contours may overlap and count by the rule nonzero.
    pub(super) fn widen(&mut self, pen: &Pen) {
        let style = kurbo::Stroke {
            width: pen.width,
            join: pen.join,
            miter_limit: pen.miter,
            start_cap: pen.cap,
            end_cap: pen.cap,
            ..Default::default()
        };
        let inner = self.inner_joins(pen);
        self.path = kurbo::stroke(self.path.iter(), &style, &StrokeOpts::default(), self.tolerance);
        self.path.extend(inner);
    }

    /// What kurbo leaves out on the inner side of joins. There its outline goes from the side of one segment straight
    /// to that of the next, which cuts off what a segment shorter than the width has; through the corner of the line it
    /// would not. The triangle of both sides and the corner makes that difference in how often the outline goes round a
    /// point, exactly.
    fn inner_joins(&self, pen: &Pen) -> BezPath {
        let mut out = BezPath::new();
        let mut start = KurboPoint::ZERO;
        let mut at = KurboPoint::ZERO;
        // The directions at the begin of the subpath and at the end of its last segment.
        let mut ends: Option<[Vec2; 2]> = None;
        for &el in self.path.elements() {
            let segment: &[KurboPoint] = match el {
                PathEl::MoveTo(p) => {
                    start = p;
                    at = p;
                    ends = None;
                    continue;
                }
                PathEl::LineTo(p) => &[p],
                PathEl::QuadTo(c, p) => &[c, p],
                PathEl::CurveTo(c, d, p) => &[c, d, p],
                PathEl::ClosePath => &[start],
            };
            let end = segment[segment.len() - 1];
            // Where control points fall on an end, the direction there is that to the next point.
            let leaving = segment.iter().map(|p| *p - at).find(|d| d.hypot2() > 0.0);
            let before_end = segment.iter().rev().skip(1).chain([&at]);
            let arriving = before_end.map(|p| end - *p).find(|d| d.hypot2() > 0.0);
            if let (Some(leaving), Some(arriving)) = (leaving, arriving) {
                if let Some([_, last]) = ends {
                    pen.add_inner_join(at, last, leaving, &mut out);
                }
                ends = Some([ends.map_or(leaving, |[first, _]| first), arriving]);
            }
            at = end;
            if let Some([first, last]) = ends.take_if(|_| el == PathEl::ClosePath) {
                pen.add_inner_join(start, last, first, &mut out);
            }
        }
        out
    }

    /// Draws what there is now.
    pub(super) fn draw(&self, out: &mut impl Sink) {
        let xy = |p: KurboPoint| [p.x, p.y];
        for el in &self.path {
            match el {
                PathEl::MoveTo(p) => out.move_to(xy(p)),
                PathEl::LineTo(p) => out.line_to(xy(p)),
                PathEl::QuadTo(c, p) => out.quad_to(xy(c), xy(p)),
                PathEl::CurveTo(c, d, p) => out.cubic_to(xy(c), xy(d), xy(p)),
                PathEl::ClosePath => out.close(),
            }
        }
    }

    /// Path data may continue after it has been closed.
    fn begin(&mut self) {
        if matches!(self.path.elements().last(), None | Some(PathEl::ClosePath)) {
            self.path.move_to(KurboPoint::from((self.at[0], self.at[1])));
        }
    }
}

/// Whether an element goes no farther than `reach` from a point. A Bézier curve lies in the hull of its points.
fn stays_near(el: &PathEl, start: KurboPoint, reach: f64) -> bool {
    let is_near = |p: KurboPoint| (p - start).hypot() <= reach;
    match *el {
        PathEl::MoveTo(p) | PathEl::LineTo(p) => is_near(p),
        PathEl::QuadTo(c, p) => is_near(c) && is_near(p),
        PathEl::CurveTo(c, d, p) => is_near(c) && is_near(d) && is_near(p),
        PathEl::ClosePath => true,
    }
}

fn at([x, y]: PlanePoint) -> KurboPoint {
    KurboPoint::new(x, y)
}

impl Sink for Curves {
    fn at(&self) -> PlanePoint {
        self.at
    }

    fn move_to(&mut self, p: PlanePoint) {
        self.start = p;
        self.at = p;
        self.path.move_to(at(p));
    }

    fn line_to(&mut self, p: PlanePoint) {
        self.begin();
        self.path.line_to(at(p));
        self.at = p;
    }

    fn quad_to(&mut self, c: PlanePoint, p: PlanePoint) {
        self.begin();
        self.path.quad_to(at(c), at(p));
        self.at = p;
    }

    fn cubic_to(&mut self, c: PlanePoint, d: PlanePoint, p: PlanePoint) {
        self.begin();
        self.path.curve_to(at(c), at(d), at(p));
        self.at = p;
    }

    fn arc_to(&mut self, radii: PlanePoint, turn: f64, large: bool, sweep: bool, p: PlanePoint) {
        self.begin();
        let arc = SvgArc {
            from: at(self.at),
            to: at(p),
            radii: kurbo::Vec2::new(radii[0].abs(), radii[1].abs()),
            x_rotation: turn.to_radians(),
            large_arc: large,
            sweep,
        };
        match Arc::from_svg_arc(&arc) {
            Some(arc) => self.path.extend(arc.append_iter(self.tolerance)),
            None if self.at != p => self.path.line_to(at(p)),
            None => {}
        }
        self.at = p;
    }

    fn ellipse(&mut self, centre: PlanePoint, rx: f64, ry: f64) {
        // Not as kurbo's ellipse, which begins on its larger axis.
        self.move_to([centre[0] + rx, centre[1]]);
        let arc = Arc::new(at(centre), (rx, ry), 0.0, std::f64::consts::TAU, 0.0);
        self.path.extend(arc.append_iter(self.tolerance));
        self.close();
    }

    fn close(&mut self) {
        if !matches!(self.path.elements().last(), None | Some(PathEl::ClosePath)) {
            self.path.close_path();
        }
        self.at = self.start;
    }

    fn dot(&mut self) {}
}
