//! Lines that fill an area.
//!
//! Lines lie at (k + 1/2) pitch from the page's origin, so that the lines of neighbouring areas continue each other. A
//! line is kept where its distance from the border is at least the inset, which is computed exactly: from the stretches
//! of the line inside the polygon, those nearer than the inset to an edge are taken away, each an interval. At an inset
//! of 2 nm or more (the least) no line leaves its area once its ends are rounded to nanometres.

use super::area::{Area, Polygon};
use super::crossings::edges;
use super::marking::ContourPass;
use crate::geom::{BoxMm, cos_sin};
use crate::texture::clip::Lines;
use crate::texture::place::{LEAST, NM};

type Point = [f64; 2];

/// The least inset, mm.
const LEAST_INSET: f64 = 2.0 * NM;

/// A line that lies nearer to the inset than this keeps it, mm: f64 noise is far below.
const SLACK: f64 = 1e-9;

/// Most ends of lines before those of one polygon are put together.
const MAX_ENDS: f64 = 4e7;

/// How areas are filled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Hatch {
    /// Distance of lines, mm.
    pub(super) pitch_mm: f64,
    /// Direction of lines from +x, anticlockwise.
    pub(super) direction_rad: f64,
    /// Whether lines wait for the directions of level lines.
    pub(super) waits: bool,
    /// Whether a second set of lines crosses the first at a right angle.
    pub(super) cross: bool,
    /// Whether all lines have one direction; else each is opposite to its neighbours.
    pub(super) one_way: bool,
    /// Distance of lines from the border of the area, mm.
    pub(super) inset_mm: f64,
    /// When the contour is marked.
    pub(super) contour: ContourPass,
}

/// More lines than one polygon may hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct TooFine;

impl Hatch {
    /// What waiting lines are laid by.
    pub(super) fn waiting(&self) -> Waiting {
        Waiting { pitch_mm: self.pitch_mm, inset_mm: self.inset(), cross: self.cross, one_way: self.one_way }
    }

    fn inset(&self) -> f64 {
        self.inset_mm.max(LEAST_INSET)
    }

    /// Appends the lines of a polygon, with its contour where that is asked for. None fits into polygons thinner than
    /// twice the inset.
    pub(super) fn fill(&self, polygon: &Polygon, out: &mut Lines) -> Result<(), TooFine> {
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

    /// Whether a polygon whose lines wait will hold any, with its contour where that is asked for.
    pub(super) fn prepare(&self, polygon: &Polygon, out: &mut Lines) -> Result<bool, TooFine> {
        let ends: f64 = polygon
            .iter()
            .flat_map(|ring| edges(ring))
            .map(|[p, q]| (p[0] - q[0]).hypot(p[1] - q[1]) / self.pitch_mm)
            .sum();
        if ends > MAX_ENDS {
            return Err(TooFine);
        }
        let inner = if self.is_thin(polygon) { Area::default() } else { Area::of(polygon).inset(self.inset()) };
        if self.contour != ContourPass::None {
            push_contours(&inner, out);
        }
        Ok(!inner.is_empty())
    }

    /// Appends rings at the inset, and from there at each pitch, from outside in.
    pub(super) fn rings(&self, area: &Area, out: &mut Lines) -> Result<(), TooFine> {
        let size = area.bounds().size();
        if size[0].min(size[1]) / self.pitch_mm * area.edge_count() as f64 > MAX_ENDS {
            return Err(TooFine);
        }
        for k in 0.. {
            let ring = area.inset(self.inset() + f64::from(k) * self.pitch_mm);
            if ring.is_empty() {
                break;
            }
            push_contours(&ring, out);
        }
        Ok(())
    }

    fn contour(&self, polygon: &Polygon, out: &mut Lines) {
        push_contours(&Area::of(polygon).inset(self.inset()), out);
    }

    fn lines(&self, polygon: &Polygon, direction: f64, out: &mut Lines) -> Result<(), TooFine> {
        let [c, s] = cos_sin(direction);
        let turned = |[x, y]: Point| [c * x + s * y, c * y - s * x];
        let sides: Vec<[Point; 2]> = polygon.iter().flat_map(|ring| edges(ring)).map(|e| e.map(turned)).collect();
        let pitch = self.pitch_mm;
        let (lo, hi) =
            sides.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), [p, _]| (lo.min(p[1]), hi.max(p[1])));
        let ends: f64 = sides.iter().map(|[p, q]| ((p[1] - q[1]).abs() + 2.0 * self.inset()) / pitch + 1.0).sum();
        if ends > MAX_ENDS {
            return Err(TooFine);
        }
        let first = (lo / pitch - 0.5).ceil();
        let count = (hi / pitch - 0.5).ceil() - first;
        let set = Set { first: (first + 0.5) * pitch, pitch, count: count as usize, inset: self.inset() - SLACK };
        let mut spans = if set.count > 0 { set.spans(&sides) } else { Vec::new() };
        if spans.is_empty() {
            // No line of the lattice meets it: one of its own, if any fits.
            let shares = [0.5, 0.25, 0.75, 0.125, 0.375, 0.625, 0.875];
            let own = |f: f64| Set { first: lo + f * (hi - lo), count: 1, ..set }.spans(&sides);
            spans = shares.into_iter().map(own).find(|s| !s.is_empty()).unwrap_or_default();
        }
        for Span { line, v, from, to } in spans {
            let turns = !self.one_way && (first as i64 + line as i64).rem_euclid(2) == 1;
            let [a, b] = if turns { [to, from] } else { [from, to] };
            out.push(&[a, b].map(|u| [c * u - s * v, s * u + c * v]));
        }
        Ok(())
    }
}

fn push_contours(area: &Area, out: &mut Lines) {
    for contour in area.contours() {
        out.points.extend(contour.iter().chain(contour.first()));
        out.finish();
    }
}

/// How lines are laid once their directions are known.
#[derive(Clone, Copy, Debug)]
pub(in crate::texture) struct Waiting {
    pub(in crate::texture) pitch_mm: f64,
    pub(in crate::texture) inset_mm: f64,
    pub(in crate::texture) cross: bool,
    pub(in crate::texture) one_way: bool,
}

/// Parallel lines along u, at v = first + k pitch.
#[derive(Clone, Copy)]
pub(in crate::texture) struct Set {
    first: f64,
    pitch: f64,
    count: usize,
    inset: f64,
}

/// A stretch of a line.
pub(in crate::texture) struct Span {
    pub(in crate::texture) line: usize,
    pub(in crate::texture) v: f64,
    pub(in crate::texture) from: f64,
    pub(in crate::texture) to: f64,
}

impl Set {
    /// Lines from v = `first` on, in areas of which they keep the inset.
    pub(in crate::texture) fn new(first: f64, count: usize, hatch: &Waiting) -> Self {
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
    pub(in crate::texture) fn spans(&self, sides: &[[Point; 2]]) -> Vec<Span> {
        let mut ends: Vec<(usize, f64)> = Vec::new();
        let mut gaps: Vec<(usize, f64, f64)> = Vec::new();
        for &[p, q] in sides {
            let (lo, hi) = (p[1].min(q[1]), p[1].max(q[1]));
            for k in self.near(lo - self.inset, hi + self.inset) {
                let v = self.v(k);
                if (p[1] <= v) != (q[1] <= v) {
                    ends.push((k, p[0] + (v - p[1]) / (q[1] - p[1]) * (q[0] - p[0])));
                }
                if let Some([a, b]) = gap([p, q], v, self.inset) {
                    gaps.push((k, a, b));
                }
            }
        }
        let by_place = |a: (usize, f64), b: (usize, f64)| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1));
        ends.sort_unstable_by(|&a, &b| by_place(a, b));
        gaps.sort_unstable_by(|&a, &b| by_place((a.0, a.1), (b.0, b.1)));
        let mut out = Vec::new();
        let mut gaps = gaps.into_iter().peekable();
        // How far the gaps of a line reach.
        let mut reach = (usize::MAX, 0.0);
        for inside in ends.chunks_exact(2) {
            let [(line, mut from), (_, to)] = [inside[0], inside[1]];
            if reach.0 == line {
                from = f64::max(from, reach.1);
            }
            while let Some(&(k, a, b)) = gaps.peek() {
                if k > line || (k == line && a >= to) {
                    break;
                }
                if k == line {
                    if a > from {
                        self.put(line, from, a, &mut out);
                    }
                    from = from.max(b);
                    reach = (line, if reach.0 == line { b.max(reach.1) } else { b });
                }
                gaps.next();
            }
            self.put(line, from, to, &mut out);
        }
        out
    }

    fn put(&self, line: usize, from: f64, to: f64, out: &mut Vec<Span>) {
        if to - from >= LEAST {
            out.push(Span { line, v: self.v(line), from, to });
        }
    }
}

/// The stretch of the line at height `v` that lies nearer than `r` to a side.
fn gap([p, q]: [Point; 2], v: f64, r: f64) -> Option<[f64; 2]> {
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
    let length = d[0].hypot(d[1]);
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
