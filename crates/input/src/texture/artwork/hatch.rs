//! Lines that fill an area.
//!
//! Lines lie at (k + 1/2) pitch from the page's origin, so that the lines of neighbouring areas continue each other. A
//! line is kept where its distance from the border is at least the inset, which is computed exactly: from the stretches
//! of the line inside the polygon, those nearer than the inset to an edge are taken away, each an interval. At an inset
//! of 2 nm or more (the least) no line leaves its area once its ends are rounded to nanometres.

use super::area::{Polygon, PolygonArea};
use super::crossings::edges;
use super::cut::Keep;
use super::marking::{ContourPass, Marking};
use crate::texture::clip::{Polylines, is_closed};
use crate::texture::place::{LEAST, NM};
use terrace_core::geom::{BoxMm, PlanePoint, cos_sin};
use terrace_core::math;

/// The least inset, mm.
const LEAST_INSET: f64 = 2.0 * NM;

/// A line that lies nearer to the inset than this keeps it, mm: f64 noise is far below.
const SLACK: f64 = 1e-9;

/// How far inside a ring another line is marked where the next ring does not come, in pitches. A stripe of up to one
/// and a half pitches stays as it is: a line in its middle would be nearer to the others than three quarters of a
/// pitch.
/// At corners of 39 deg and more (2 arcsin 1/3) nothing lies so far from both rings.
const BETWEEN: f64 = 0.75;

/// Where a line is tried in an area that no line of the lattice meets, in shares of its height across the lines: in the
/// middle, then in the middles of what is left.
pub(in crate::texture) const OWN_LINE_SHARES: [f64; 7] = [0.5, 0.25, 0.75, 0.125, 0.375, 0.625, 0.875];

/// Most ends of lines before those of one polygon are put together.
const MAX_ENDS: f64 = 4e7;

/// How areas are filled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Hatch {
    /// Distance of lines, mm.
    pub(super) pitch_mm: f64,
    /// Direction of lines from +x, anticlockwise.
    pub(super) direction_rad: f64,
    /// Whether lines follow the level lines of the part, whose directions are not known yet.
    pub(super) follows_level_lines: bool,
    /// Whether a second set of lines crosses the first at a right angle.
    pub(super) cross: bool,
    /// Whether all lines have one direction; else each is opposite to its neighbours.
    pub(super) one_way: bool,
    /// Distance of lines from the border of the area, mm.
    pub(super) inset_mm: f64,
    /// When the contour is marked.
    pub(super) contour: ContourPass,
}

impl Hatch {
    /// What a marking says of areas on a page that is turned by `page_rad`: lines half a spot apart and from the border
    /// where it does not say.
    pub(super) fn of(marking: &Marking, spot_mm: f64, page_rad: f64) -> Self {
        Self {
            pitch_mm: marking.pitch_mm.unwrap_or(spot_mm / 2.0),
            direction_rad: marking.direction_rad - page_rad,
            follows_level_lines: marking.along_contours.is_some(),
            cross: marking.cross,
            one_way: marking.one_way,
            inset_mm: marking.inset_mm.unwrap_or(spot_mm / 2.0),
            contour: marking.contour,
        }
    }
}

/// More lines than one polygon may hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct TooFine;

impl Hatch {
    /// The part of it that lines along level lines are made by.
    pub(super) fn level_hatch(&self) -> LevelHatch {
        LevelHatch { pitch_mm: self.pitch_mm, inset_mm: self.inset(), cross: self.cross, one_way: self.one_way }
    }

    fn inset(&self) -> f64 {
        self.inset_mm.max(LEAST_INSET)
    }

    /// Appends the lines of a polygon, with its contour where that is asked for. None fits into polygons thinner than
    /// twice the inset.
    pub(super) fn fill(&self, polygon: &Polygon, out: &mut Polylines) -> Result<(), TooFine> {
        if self.is_thin(polygon) {
            return Ok(());
        }
        if self.contour == ContourPass::Before {
            self.contour(polygon, out);
        }
        self.lines(polygon, self.direction_rad, out)?;
        if self.cross {
            self.lines(polygon, self.direction_rad + std::f64::consts::FRAC_PI_2, out)?;
        }
        if self.contour == ContourPass::After {
            self.contour(polygon, out);
        }
        Ok(())
    }

    /// Whether a polygon is narrower than twice the inset along an axis; others may be too narrow all the same.
    fn is_thin(&self, polygon: &Polygon) -> bool {
        let size = BoxMm::of(polygon.iter().flatten().copied()).size();
        size[0].min(size[1]) < 2.0 * (self.inset() - SLACK)
    }

    /// Whether a polygon that is filled later will hold lines, with its contour where that is asked for.
    pub(super) fn prepare(&self, polygon: &Polygon, out: &mut Polylines) -> Result<bool, TooFine> {
        let ends: f64 = polygon
            .iter()
            .flat_map(|ring| edges(ring))
            .map(|[p, q]| math::hypot(p[0] - q[0], p[1] - q[1]) / self.pitch_mm)
            .sum();
        if ends > MAX_ENDS {
            return Err(TooFine);
        }
        let inner =
            if self.is_thin(polygon) { PolygonArea::default() } else { PolygonArea::of(polygon).inset(self.inset()) };
        if self.contour != ContourPass::None {
            push_contours(&inner, out);
        }
        Ok(!inner.is_empty())
    }

    /// Appends rings at the inset, and from there at each pitch, from outside in. Where the next ring does not come, as
    /// there is no room for it, a stripe of up to two pitches would stay blank in the middle: what of a contour lies
    /// [`BETWEEN`] further in than a ring, and at least as far from the next one, is marked too.
    pub(super) fn rings(&self, area: &PolygonArea, out: &mut Polylines) -> Result<(), TooFine> {
        let size = area.bounds().size();
        if size[0].min(size[1]) / self.pitch_mm * area.edge_count() as f64 > MAX_ENDS {
            return Err(TooFine);
        }
        let mut ring = area.inset(self.inset());
        for k in 0.. {
            if ring.is_empty() {
                break;
            }
            push_contours(&ring, out);
            let depth = self.inset() + f64::from(k) * self.pitch_mm;
            let next = area.inset(depth + self.pitch_mm);
            self.between(&area.inset(depth + BETWEEN * self.pitch_mm), &next, out);
            ring = next;
        }
        Ok(())
    }

    /// Appends what of the contours of `inner`, which lie between two rings, is far from the second of them, `next`.
    fn between(&self, inner: &PolygonArea, next: &PolygonArea, out: &mut Polylines) {
        if next.is_empty() {
            return push_contours(inner, out);
        }
        let near = next.inset(-BETWEEN * self.pitch_mm).cutter();
        let (mut contours, mut far) = (Polylines::default(), Polylines::default());
        push_contours(inner, &mut contours);
        contours.iter().for_each(|contour| near.cut(contour, Keep::Outside, &mut far));
        let length = |line: &[PlanePoint]| {
            line.windows(2).map(|w| math::hypot(w[1][0] - w[0][0], w[1][1] - w[0][1])).sum::<f64>()
        };
        // Tips at sharp corners, shorter than a pitch, close no stripe.
        far.iter().filter(|line| is_closed(line) || length(line) >= self.pitch_mm).for_each(|line| out.push(line));
    }

    fn contour(&self, polygon: &Polygon, out: &mut Polylines) {
        push_contours(&PolygonArea::of(polygon).inset(self.inset()), out);
    }

    /// Appends the lines of one direction, in a frame whose u runs along them and whose v runs across.
    fn lines(&self, polygon: &Polygon, direction: f64, out: &mut Polylines) -> Result<(), TooFine> {
        let [c, s] = cos_sin(direction);
        let turned = |[x, y]: PlanePoint| [c * x + s * y, c * y - s * x];
        let sides: Vec<[PlanePoint; 2]> = polygon.iter().flat_map(|ring| edges(ring)).map(|e| e.map(turned)).collect();
        let pitch = self.pitch_mm;
        // A side can end lines, or cut a gap into them, over its height and the inset above and below it.
        let ends: f64 = sides.iter().map(|[p, q]| ((p[1] - q[1]).abs() + 2.0 * self.inset()) / pitch + 1.0).sum();
        if ends > MAX_ENDS {
            return Err(TooFine);
        }
        let [lo, hi] = extent_across(&sides);
        let first = (lo / pitch - 0.5).ceil();
        let count = (hi / pitch - 0.5).ceil() - first;
        let inset = self.inset() - SLACK;
        let lattice = LineSet { first: (first + 0.5) * pitch, pitch, count: count as usize, inset };
        let mut spans = if lattice.count > 0 { lattice.spans(&sides) } else { Vec::new() };
        if spans.is_empty() {
            // No line of the lattice meets it: one of its own, if any fits.
            let own_line = |share: f64| LineSet { first: lo + share * (hi - lo), count: 1, ..lattice }.spans(&sides);
            spans = OWN_LINE_SHARES.into_iter().map(own_line).find(|s| !s.is_empty()).unwrap_or_default();
        }
        for Span { line, v, from, to } in spans {
            // By the number of the line in the lattice of the page, so that it runs alike in neighbouring areas.
            let is_backward = !self.one_way && (first as i64 + line as i64).rem_euclid(2) == 1;
            let [a, b] = if is_backward { [to, from] } else { [from, to] };
            out.push(&[a, b].map(|u| [c * u - s * v, s * u + c * v]));
        }
        Ok(())
    }
}

/// The least and the greatest v of the sides of closed rings.
pub(in crate::texture) fn extent_across(sides: &[[PlanePoint; 2]]) -> [f64; 2] {
    sides.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], [p, _]| [lo.min(p[1]), hi.max(p[1])])
}

fn push_contours(area: &PolygonArea, out: &mut Polylines) {
    for contour in area.contours() {
        out.points.extend(contour.iter().chain(contour.first()));
        out.finish();
    }
}

/// How areas are filled by lines that follow the level lines of the part, once their directions are known.
#[derive(Clone, Copy, Debug)]
pub(in crate::texture) struct LevelHatch {
    /// Distance of lines, mm.
    pub(in crate::texture) pitch_mm: f64,
    /// Distance of lines from the border of the area, mm; at least the least inset.
    pub(in crate::texture) inset_mm: f64,
    /// Whether a second set of lines crosses the first at a right angle.
    pub(in crate::texture) cross: bool,
    /// Whether all lines have one direction; else each is opposite to its neighbours.
    pub(in crate::texture) one_way: bool,
}

/// Parallel lines along u, at v = first + k pitch.
#[derive(Clone, Copy)]
pub(in crate::texture) struct LineSet {
    first: f64,
    pitch: f64,
    count: usize,
    inset: f64,
}

/// Where a line enters or leaves the area.
#[derive(Clone, Copy)]
struct LineEnd {
    line: usize,
    u: f64,
}

/// A stretch of a line that lies nearer than the inset to a side.
#[derive(Clone, Copy)]
struct LineGap {
    line: usize,
    from: f64,
    to: f64,
}

/// A stretch of a line.
pub(in crate::texture) struct Span {
    pub(in crate::texture) line: usize,
    pub(in crate::texture) v: f64,
    pub(in crate::texture) from: f64,
    pub(in crate::texture) to: f64,
}

impl LineSet {
    /// Lines from v = `first` on, in areas of which they keep the inset.
    pub(in crate::texture) fn new(first: f64, count: usize, hatch: &LevelHatch) -> Self {
        Self { first, pitch: hatch.pitch_mm, count, inset: hatch.inset_mm - SLACK }
    }

    fn v(&self, k: usize) -> f64 {
        self.first + k as f64 * self.pitch
    }

    /// The lines between two heights, and one more at either side.
    fn near(&self, lo: f64, hi: f64) -> std::ops::Range<usize> {
        let index = |v: f64| ((v - self.first) / self.pitch).clamp(-1.0, self.count as f64);
        let from = index(lo).floor().max(0.0) as usize;
        from..((index(hi).ceil() + 1.0) as usize).min(self.count)
    }

    /// What of the lines lies inside the sides, farther than the inset from each of them.
    pub(in crate::texture) fn spans(&self, sides: &[[PlanePoint; 2]]) -> Vec<Span> {
        let mut ends: Vec<LineEnd> = Vec::new();
        let mut gaps: Vec<LineGap> = Vec::new();
        for &[p, q] in sides {
            let lo = p[1].min(q[1]);
            let hi = p[1].max(q[1]);
            for line in self.near(lo - self.inset, hi + self.inset) {
                let v = self.v(line);
                // A corner on a line counts as below it, so that ends come in pairs.
                if (p[1] <= v) != (q[1] <= v) {
                    ends.push(LineEnd { line, u: p[0] + (v - p[1]) / (q[1] - p[1]) * (q[0] - p[0]) });
                }
                if let Some([from, to]) = gap([p, q], v, self.inset) {
                    gaps.push(LineGap { line, from, to });
                }
            }
        }
        ends.sort_unstable_by(|a, b| a.line.cmp(&b.line).then(a.u.total_cmp(&b.u)));
        gaps.sort_unstable_by(|a, b| a.line.cmp(&b.line).then(a.from.total_cmp(&b.from)));
        self.without_gaps(&ends, gaps)
    }

    /// The stretches between each two ends, without the gaps; ends and gaps are sorted by line and place.
    fn without_gaps(&self, ends: &[LineEnd], gaps: Vec<LineGap>) -> Vec<Span> {
        let mut out = Vec::new();
        let mut gaps = gaps.into_iter().peekable();
        // Where the last of the gaps ends that were taken from the list. It may lie beyond the stretch that took it, in
        // the next one of the same line.
        let mut reach = LineEnd { line: usize::MAX, u: 0.0 };
        for stretch in ends.chunks_exact(2) {
            let [LineEnd { line, u: mut from }, LineEnd { u: to, .. }] = [stretch[0], stretch[1]];
            if reach.line == line {
                from = f64::max(from, reach.u);
            }
            // What lies before `from` is put out or lost; of the gaps from here on, those before `to` cut this stretch.
            while let Some(&gap) = gaps.peek() {
                if gap.line > line || (gap.line == line && gap.from >= to) {
                    break;
                }
                if gap.line == line {
                    if gap.from > from {
                        self.put(line, from, gap.from, &mut out);
                    }
                    from = from.max(gap.to);
                    reach = LineEnd { line, u: if reach.line == line { gap.to.max(reach.u) } else { gap.to } };
                }
                gaps.next();
            }
            self.put(line, from, to, &mut out);
        }
        out
    }

    /// Appends a stretch of a line, unless it is too short to be marked or empty.
    fn put(&self, line: usize, from: f64, to: f64, out: &mut Vec<Span>) {
        if to - from >= LEAST {
            out.push(Span { line, v: self.v(line), from, to });
        }
    }
}

/// The stretch of the line at height `v` that lies nearer than `r` to a side.
fn gap([p, q]: [PlanePoint; 2], v: f64, r: f64) -> Option<[f64; 2]> {
    let mut out = [f64::INFINITY, f64::NEG_INFINITY];
    let mut add = |u: f64| out = [out[0].min(u), out[1].max(u)];
    for end in [p, q] {
        let away = (v - end[1]).abs();
        if away < r {
            let half = (r * r - away * away).sqrt();
            add(end[0] - half);
            add(end[0] + half);
        }
    }
    let d = [q[0] - p[0], q[1] - p[1]];
    let length = math::hypot(d[0], d[1]);
    if length > 0.0 {
        let n = [-d[1] / length * r, d[0] / length * r];
        for sign in [1.0, -1.0] {
            // The side moved by r to its left and to its right.
            let [a, b] = [p, q].map(|e| [e[0] + sign * n[0], e[1] + sign * n[1]]);
            if (a[1] <= v) != (b[1] <= v) {
                add(a[0] + (v - a[1]) / (b[1] - a[1]) * (b[0] - a[0]));
            }
        }
    }
    (out[0] < out[1]).then_some(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::texture::artwork::{Marking, WindingRule};
    use crate::texture::clip::distance;

    /// The rings of an area at a pitch of 1 mm and an inset of 0.5 mm.
    fn rings(contours: &[&[PlanePoint]]) -> (PolygonArea, Polylines) {
        let area = PolygonArea::new(contours.iter().copied(), WindingRule::EvenOdd).expect("few");
        let marking = Marking { pitch_mm: Some(1.0), inset_mm: Some(0.5), ..Marking::default() };
        let hatch = Hatch::of(&marking, 1.0, 0.0);
        let mut out = Polylines::default();
        hatch.rings(&area, &mut out).map_err(|TooFine| "fine").expect("rings");
        (area, out)
    }

    /// The largest distance of a place inside the inset from all lines.
    fn largest_gap(area: &PolygonArea, lines: &Polylines) -> f64 {
        let (inner, bounds) = (area.inset(0.5).cutter(), area.bounds());
        let step = |k: usize, n: i32| bounds.lo[k] + f64::from(n) * 0.05;
        let count = |k: usize| ((bounds.hi[k] - bounds.lo[k]) / 0.05) as i32;
        let places =
            (0..=count(0)).flat_map(|i| (0..=count(1)).map(move |j| (i, j))).map(|(i, j)| [step(0, i), step(1, j)]);
        let near = |p: PlanePoint| {
            lines.iter().flat_map(|l| l.windows(2)).map(|w| distance(p, [w[0], w[1]])).fold(f64::INFINITY, f64::min)
        };
        places.filter(|&p| inner.holds(p) == Some(true)).map(near).fold(0.0, f64::max)
    }

    #[test]
    #[ignore = "slow: make test-all"]
    fn rings_leave_no_stripe_of_two_pitches_in_the_middle() {
        for width in [2.9, 3.0, 3.1, 3.4, 3.6, 3.9, 4.0] {
            let bar: &[PlanePoint] = &[[0.0, 0.0], [20.0, 0.0], [20.0, width], [0.0, width]];
            // A bar beside a square that holds more rings.
            let head: &[PlanePoint] = &[
                [0.0, 0.0],
                [20.0, 0.0],
                [20.0, -4.0],
                [30.0, -4.0],
                [30.0, 8.0],
                [20.0, 8.0],
                [20.0, width],
                [0.0, width],
            ];
            for (name, contour) in [("bar", bar), ("bar and square", head)] {
                let (area, lines) = rings(&[contour]);
                let gap = largest_gap(&area, &lines);
                assert!(gap <= 0.8, "{name} {width} wide: {gap}");
            }
        }
        // An annulus: the stripe is closed.
        let circle = |r: f64| -> Vec<PlanePoint> {
            (0..256)
                .map(|k| math::sin_cos(f64::from(k) * std::f64::consts::TAU / 256.0))
                .map(|(s, c)| [r * c, r * s])
                .collect()
        };
        let (area, lines) = rings(&[&circle(8.9), &circle(5.0)]);
        assert!(largest_gap(&area, &lines) <= 0.8);
    }

    #[test]
    fn rings_that_fill_their_area_are_rings_alone() {
        // Depths 0.5, 1.5, 2.5 of 2.6; corners of 90 and of 60 deg.
        let square: &[PlanePoint] = &[[0.0, 0.0], [5.2, 0.0], [5.2, 5.2], [0.0, 5.2]];
        let triangle: &[PlanePoint] = &[[0.0, 0.0], [9.0, 0.0], [4.5, 4.5 * 3.0_f64.sqrt()]];
        for contour in [square, triangle] {
            let (area, lines) = rings(&[contour]);
            assert_eq!(lines.len(), 3, "{contour:?}");
            assert!(largest_gap(&area, &lines) <= 0.75);
        }
    }
}
