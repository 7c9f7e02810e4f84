//! Areas: polygons with holes, their union, difference and intersection (i_overlay), and lines cut at them.

use i_overlay::core::fill_rule::FillRule;
use i_overlay::core::overlay_rule::OverlayRule;
use i_overlay::float::overlay::FloatOverlay;
use i_overlay::mesh::outline::offset::OutlineOffset;
use i_overlay::mesh::style::{LineJoin, OutlineStyle};

use super::WindingRule;
use super::crossings::{TooMany, are_few, edges};
use super::cut::{Cutter, Keep};
use crate::texture::clip::Polylines;
use terrace_core::geom::{BoxMm, PlanePoint};

/// One outer contour, anticlockwise, and its holes, clockwise; none repeats its first point.
pub(in crate::texture) type Polygon = Vec<Vec<PlanePoint>>;

/// Angle between the points of round corners, rad: they lie within 0.3 % of the radius.
const ROUND: f64 = 0.05 * std::f64::consts::PI;

/// Polygons that do not overlap, mm. Points lie on a grid of 2^-30 of the size of what they were computed from.
#[derive(Clone, Debug, Default, PartialEq)]
pub(in crate::texture) struct PolygonArea(Vec<Polygon>);

impl PolygonArea {
    /// What contours enclose; open ones are closed by a straight line.
    pub(in crate::texture) fn new<'a>(
        contours: impl Iterator<Item = &'a [PlanePoint]>,
        rule: WindingRule,
    ) -> Result<Self, TooMany> {
        let contours: Vec<Vec<PlanePoint>> = contours.map(|c| open(c).to_vec()).filter(|c| c.len() > 2).collect();
        let rule = match rule {
            WindingRule::NonZero => FillRule::NonZero,
            WindingRule::EvenOdd => FillRule::EvenOdd,
        };
        if contours.is_empty() {
            return Ok(Self::default());
        }
        are_few(contours.iter())?;
        Ok(Self(FloatOverlay::with_subj(&contours).overlay(OverlayRule::Subject, rule)))
    }

    /// One polygon.
    pub(in crate::texture) fn of(polygon: &Polygon) -> Self {
        Self(vec![polygon.clone()])
    }

    /// What one or more of the areas hold.
    pub(in crate::texture) fn union<'a>(areas: impl Iterator<Item = &'a Self>) -> Result<Self, TooMany> {
        let polygons: Vec<Polygon> = areas.flat_map(|a| a.0.iter().cloned()).collect();
        are_few(polygons.iter().flatten())?;
        Ok(Self(FloatOverlay::with_subj(&polygons).overlay(OverlayRule::Subject, FillRule::NonZero)))
    }

    /// What this area holds and `other` does not.
    pub(in crate::texture) fn without(&self, other: &Self) -> Result<Self, TooMany> {
        self.with(other, OverlayRule::Difference)
    }

    /// What both areas hold.
    pub(in crate::texture) fn within(&self, other: &Self) -> Result<Self, TooMany> {
        self.with(other, OverlayRule::Intersect)
    }

    /// The result of a boolean operation.
    fn with(&self, other: &Self, rule: OverlayRule) -> Result<Self, TooMany> {
        are_few(self.contours().chain(other.contours()))?;
        Ok(Self(FloatOverlay::with_subj_and_clip(&self.0, &other.0).overlay(rule, FillRule::NonZero)))
    }

    /// The points that lie at least `distance` inside; corners that bend inwards become arcs.
    pub(in crate::texture) fn inset(&self, distance: f64) -> Self {
        let style = OutlineStyle::new(-distance).line_join(LineJoin::Round(ROUND));
        Self(self.0.outline(&style))
    }

    /// With all points moved by a map that keeps left and right.
    #[must_use]
    pub(in crate::texture) fn mapped(mut self, map: impl Fn(PlanePoint) -> PlanePoint) -> Self {
        self.0.iter_mut().flatten().flatten().for_each(|p| *p = map(*p));
        self
    }

    /// Mirrors it between 0 and `side` along an axis.
    pub(super) fn mirror(&mut self, axis: usize, side: f64) {
        for contour in self.0.iter_mut().flatten() {
            contour.iter_mut().for_each(|p| p[axis] = side - p[axis]);
            // Outer contours stay anticlockwise.
            contour.reverse();
        }
    }

    /// What cuts lines at its border.
    pub(super) fn cutter(&self) -> Cutter {
        Cutter::new(self.contours())
    }

    /// Appends what of lines lies in it.
    pub(in crate::texture) fn cut<'a>(&self, lines: impl Iterator<Item = &'a [PlanePoint]>, out: &mut Polylines) {
        let cutter = self.cutter();
        lines.for_each(|line| cutter.cut(line, Keep::Inside, out));
    }

    pub(in crate::texture) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    pub(in crate::texture) fn polygons(&self) -> &[Polygon] {
        &self.0
    }

    /// Outer contours and holes.
    pub(in crate::texture) fn contours(&self) -> impl Iterator<Item = &Vec<PlanePoint>> {
        self.0.iter().flatten()
    }

    /// The size of the area, mm².
    pub(super) fn size_mm2(&self) -> f64 {
        // Outer contours are anticlockwise and holes clockwise, so that their signs differ (shoelace formula).
        self.contours().flat_map(|c| edges(c)).map(|[a, b]| (a[0] * b[1] - b[0] * a[1]) / 2.0).sum()
    }

    pub(in crate::texture) fn edge_count(&self) -> usize {
        self.contours().map(Vec::len).sum()
    }

    /// Empty for none.
    pub(in crate::texture) fn bounds(&self) -> BoxMm<2> {
        BoxMm::of(self.contours().flatten().copied())
    }
}

/// A contour without its last point where that repeats the first.
fn open(contour: &[PlanePoint]) -> &[PlanePoint] {
    match contour {
        [first, rest @ .., last] if first == last && !rest.is_empty() => &contour[..contour.len() - 1],
        _ => contour,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(x: f64, y: f64, side: f64) -> Vec<PlanePoint> {
        vec![[x, y], [x + side, y], [x + side, y + side], [x, y + side]]
    }

    #[test]
    fn booleans_have_the_expected_sizes() {
        let of = |contours: &[Vec<PlanePoint>], rule| {
            PolygonArea::new(contours.iter().map(Vec::as_slice), rule).expect("few")
        };
        let ring = of(&[square(0.0, 0.0, 10.0), square(2.0, 2.0, 6.0)], WindingRule::EvenOdd);
        let full = of(&[square(0.0, 0.0, 10.0), square(2.0, 2.0, 6.0)], WindingRule::NonZero);
        let other = of(&[square(5.0, 5.0, 10.0)], WindingRule::NonZero);
        for (area, want) in [
            (ring.clone(), 64.0),
            (full.clone(), 100.0),
            (ring.within(&other).expect("few"), 16.0),
            (full.without(&other).expect("few"), 75.0),
            (PolygonArea::union([&ring, &other].into_iter()).expect("few"), 64.0 + 100.0 - 16.0),
            (ring.inset(0.5), 81.0 - 49.0 + (1.0 - std::f64::consts::FRAC_PI_4)),
        ] {
            let size = area.size_mm2();
            assert!((size - want).abs() < 5e-3, "{size} instead of {want}");
        }
        assert!(full.inset(5.1).is_empty());
    }

    #[test]
    fn areas_with_opposite_directions_do_not_cancel() {
        let back: Vec<PlanePoint> = square(0.0, 0.0, 4.0).into_iter().rev().collect();
        let a = PolygonArea::new([back.as_slice()].into_iter(), WindingRule::NonZero).expect("few");
        let b = PolygonArea::new([square(2.0, 0.0, 4.0).as_slice()].into_iter(), WindingRule::NonZero).expect("few");
        assert!((PolygonArea::union([&a, &b].into_iter()).expect("few").size_mm2() - 24.0).abs() < 1e-6);
    }
}
