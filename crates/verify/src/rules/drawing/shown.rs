//! What a drawing shows is marked: the other half of the rule.
//!
//! Of a grid of places on the page those are looked at about which the drawing shows one fill as far as a pitch and the
//! inset of the hatch reach: no contour passes there, and the place and [`RING`] others around it have the same colour.
//! A line of the hatch must pass within twice that distance, whichever way lines run. Strokes, patterns, what is
//! masked, fills of which the contours alone are marked, tiles, areas that are filled along contours of the part,
//! textures with a mask and those that leave out what cannot be reproduced are not looked at. Units: mm of the page as
//! it is placed.

use super::super::page::{Page, Site};
use super::InkChoice;
use crate::Drawing;
use crate::proof::Rule;
use crate::read::labels::Truth;
use crate::read::picture::{Ink, Picture};
use terrace_core::geom::{BoxMm, P2, PlanePoint};
use terrace_core::math;
use terrace_input::texture::{Area, FillMode, Kind, Request};

/// Most places along a side of the page, as docs/explanation/verify.md states.
const SIDE: f64 = 50.0;

/// How many others are looked at around a place.
const RING: u32 = 8;

/// Holds that the fills of a drawing on its page are marked.
pub(super) struct FillCheck<'a> {
    pub(super) picture: &'a Picture,
    pub(super) page: &'a Page,
    pub(super) choice: &'a InkChoice<'a>,
    pub(super) site: &'a Site,
    pub(super) spot_mm: f64,
    pub(super) slack_mm: f64,
}

/// The places at which something must be marked; None once it is.
struct FillPlaces {
    count: [usize; 2],
    cell: PlanePoint,
    /// How near a mark must pass.
    near: f64,
    /// The place of each cell, row by row.
    by_cell: Vec<Option<PlanePoint>>,
}

impl FillCheck<'_> {
    /// Holds the rule for the strokes of a texture, counted from 0.
    pub(super) fn check(
        &self,
        request: &Request,
        drawing: &Drawing<'_>,
        strokes: std::ops::Range<usize>,
        number: usize,
        rule: &mut Rule,
    ) {
        let Some(mut places) = self.places(request) else { return };
        rule.checked += places.by_cell.iter().flatten().count() as u64;
        let mut points: Vec<P2> = Vec::new();
        for i in strokes {
            (drawing.stroke)(i, &mut points);
            let on_plane = |p: &P2| self.page.on_plane([p.x as f64, p.y as f64]);
            let dot = points.first().filter(|_| points.len() == 1).map(|p| [on_plane(p); 2]);
            let sides = points.windows(2).map(|w| [on_plane(&w[0]), on_plane(&w[1])]);
            sides.chain(dot).for_each(|side| places.mark(side));
        }
        for place in places.by_cell.into_iter().flatten() {
            let [x, y] = self.page.unmirrored(place);
            let text = format!("nothing is marked where the drawing shows something, at {x:.4}, {y:.4} mm of the page");
            rule.broken("", format!("texture {}", number + 1), text);
        }
    }

    /// The places that must be marked; None where nothing has to be.
    fn places(&self, request: &Request) -> Option<FillPlaces> {
        let Kind::Drawing { marking, tile, .. } = &request.kind else { return None };
        let is_filled = matches!(marking.fill, FillMode::Hatch | FillMode::Rings) && marking.along_contours.is_none();
        if !is_filled || *tile || marking.is_lenient || request.masks.list().next().is_some() {
            return None;
        }
        let pitch = marking.pitch_mm.unwrap_or(self.spot_mm / 2.0);
        let inset = marking.inset_mm.unwrap_or(self.spot_mm / 2.0);
        let reach = pitch + inset + 2.0 * self.slack_mm;
        // A place lies in the middle half of its cell, which is 4 `near` wide at least: so all that is near a place
        // lies in the same cell or in the next.
        let near = 2.0 * reach;
        let count = self.page.size.map(|side| (side / (4.0 * near)).min(SIDE) as usize);
        if count.contains(&0) {
            return None;
        }
        let cell = [0, 1].map(|k| self.page.size[k] / count[k] as f64);
        let limit = match request.area {
            Area::Part => Some(self.site.part_box),
            Area::Rectangle(area) => Some(area),
            Area::Unlimited => None,
        };
        let in_cell = |n: usize| {
            let p = place_in_cell(n, count, cell);
            (self.may_be_marked(p, near, limit) && self.is_one_colour(p, reach)).then_some(p)
        };
        Some(FillPlaces { count, cell, near, by_cell: (0..count[0] * count[1]).map(in_cell).collect() })
    }

    /// Whether all of the part within `by` mm of a place lies within the area of the texture.
    fn may_be_marked(&self, p: PlanePoint, by: f64, limit: Option<BoxMm<2>>) -> bool {
        let Some(limit) = limit else { return true };
        let p_part = self.page.on_part(p);
        (0..2).all(|k| limit.lo[k] + by <= p_part[k] && p_part[k] + by <= limit.hi[k])
    }

    /// Whether the drawing shows a place and all within `reach` of it in one colour that is marked.
    fn is_one_colour(&self, p: PlanePoint, reach: f64) -> bool {
        let Some(ink) = self.ink(p) else { return false };
        let scale = [0, 1].map(|k| self.picture.size[k] / self.page.size[k]);
        if !self.picture.points_near(self.px(p), reach * scale[0].max(scale[1])).is_empty() {
            return false;
        }
        (0..RING).all(|k| {
            let (s, c) = math::sin_cos(f64::from(k) * std::f64::consts::TAU / f64::from(RING));
            let other = self.ink([p[0] + c * reach, p[1] + s * reach]);
            other.is_some_and(|other| other.colour == ink.colour && other.element == ink.element)
        })
    }

    /// The ink that must be marked at a place; None where nothing must be, or it is not known.
    fn ink(&self, p: PlanePoint) -> Option<Ink> {
        let inks = self.picture.inks_at(self.px(p), &|ink| self.choice.exists(ink));
        let &[ink] = inks.as_slice() else { return None };
        let is_sure = self.choice.exists(ink) == Truth::Yes && self.choice.marked(ink) == Truth::Yes;
        (is_sure && ink.is_plain_fill).then_some(ink)
    }

    /// Where a place of the page lies in the drawing, px.
    fn px(&self, p: PlanePoint) -> PlanePoint {
        let [x, y] = self.page.unmirrored(p);
        let [w, h] = self.page.size;
        [x / w * self.picture.size[0], (h - y) / h * self.picture.size[1]]
    }
}

impl FillPlaces {
    /// Takes out what lies near a side of a stroke.
    fn mark(&mut self, [a, b]: [PlanePoint; 2]) {
        let length = math::hypot(b[0] - a[0], b[1] - a[1]);
        let steps = (2.0 * length / self.cell[0].min(self.cell[1])).ceil() as usize;
        for k in 0..=steps {
            let t = k as f64 / steps.max(1) as f64;
            let cell = [0, 1].map(|k| ((a[k] + t * (b[k] - a[k])) / self.cell[k]).floor() as i64);
            for (i, j) in (-1..=1).flat_map(|i| (-1..=1).map(move |j| (cell[0] + i, cell[1] + j))) {
                let is_cell = (0..self.count[0] as i64).contains(&i) && (0..self.count[1] as i64).contains(&j);
                if !is_cell {
                    continue;
                }
                let place = &mut self.by_cell[j as usize * self.count[0] + i as usize];
                if place.is_some_and(|p| away(p, [a, b]) <= self.near) {
                    *place = None;
                }
            }
        }
    }
}

/// The place of cell `n`, in its middle half. Multiples of the powers of the plastic number are evenly spread, and in
/// step with no pattern.
fn place_in_cell(n: usize, count: [usize; 2], cell: PlanePoint) -> PlanePoint {
    let share = [0.754_877_666, 0.569_840_291].map(|by| 0.25 + 0.5 * (n as f64 * by).fract());
    [0, 1].map(|k| ([n % count[0], n / count[0]][k] as f64 + share[k]) * cell[k])
}

/// Distance of a point from a side.
fn away(p: PlanePoint, [a, b]: [PlanePoint; 2]) -> f64 {
    let d = [b[0] - a[0], b[1] - a[1]];
    let square = d[0] * d[0] + d[1] * d[1];
    let along = d[0] * (p[0] - a[0]) + d[1] * (p[1] - a[1]);
    let t = if square > 0.0 { (along / square).clamp(0.0, 1.0) } else { 0.0 };
    math::hypot(a[0] + t * d[0] - p[0], a[1] + t * d[1] - p[1])
}
