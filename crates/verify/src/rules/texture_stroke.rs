//! A stroke of the texture, placed again from the job, and where a mark lies along it.
//!
//! Lengths along it are nm from its first point, without the passes of its pen. A claimed segment is only a hint: what
//! a mark's points say decides.

use crate::Drawing;
use crate::geometry::Line;
use terrace_core::geom::{P2, orient};
use terrace_core::math;
use terrace_core::program::PenId;

/// A cut point is a point of the stroke rounded to the grid: it lies 0.71 nm near, half the diagonal of the grid. A
/// whole nanometre is what docs/explanation/verify.md states.
const ON_STROKE: f64 = 1.0;

/// A mark that is not where it claims to be is laid on its stroke if that is this near, nm, so that
/// one fault is not reported as three.
const NEAR: f64 = 10_000.0;

/// Points, and the length along the stroke to each.
#[derive(Default)]
pub(super) struct TextureStroke {
    points: Vec<P2>,
    along: Vec<f64>,
}

impl TextureStroke {
    /// Places stroke `number` of the drawing, and returns its pen; None where it has no points.
    pub(super) fn place(&mut self, drawing: &Drawing<'_>, number: usize) -> Option<PenId> {
        let pen = (drawing.stroke)(number, &mut self.points);
        self.along.clear();
        let mut sum = 0.0;
        self.along.push(0.0);
        for w in self.points.windows(2) {
            sum += w[0].distance(w[1]);
            self.along.push(sum);
        }
        (!self.points.is_empty()).then_some(pen)
    }

    /// The point of the stroke where it is a dot.
    pub(super) fn dot(&self) -> Option<P2> {
        if let [dot] = self.points[..] { Some(dot) } else { None }
    }

    /// Whether it ends where it begins.
    pub(super) fn is_closed(&self) -> bool {
        self.points.first() == self.points.last()
    }

    /// The length of the stroke, nm.
    pub(super) fn len(&self) -> f64 {
        self.along.last().copied().unwrap_or(0.0)
    }

    /// The length along it to point `k`, nm.
    pub(super) fn along(&self, k: usize) -> f64 {
        self.along[k]
    }

    /// The segment that holds length `s` of the stroke, and how far along it.
    pub(super) fn locate(&self, s: f64) -> (usize, f64) {
        let k = self.along.partition_point(|&a| a <= s).clamp(1, self.points.len() - 1) - 1;
        (k, s - self.along[k])
    }

    /// The point of the stroke at length `s`, nm.
    pub(super) fn at(&self, s: f64) -> [f64; 2] {
        let (k, d) = self.locate(s);
        self.line(k).at(d)
    }

    /// Segment `k` of the stroke.
    pub(super) fn line(&self, k: usize) -> Line {
        let [a, b] = [self.points[k], self.points[k + 1]].map(|p| [p.x as f64, p.y as f64]);
        Line::new(a, b)
    }

    /// Where a mark lies along the stroke, if it is the piece that begins on `segment`; else why it is not.
    pub(super) fn fit(&self, mark: &[P2], segment: usize) -> Result<[f64; 2], &'static str> {
        if mark.len() < 2 {
            return Err("it is a dot, and the stroke a line");
        }
        let otherwise = || self.fit_beyond(mark, segment).or_else(|| self.fit_around(mark, segment));
        self.fit_from(mark, segment).or_else(|why| otherwise().ok_or(why))
    }

    /// The fit of [`TextureStroke::fit`] for a mark that begins on `segment` itself and runs in the stroke's direction.
    fn fit_from(&self, mark: &[P2], segment: usize) -> Result<[f64; 2], &'static str> {
        // Between its cut points a mark has the very vertices of its stroke, one after another.
        let inner = &mark[1..mark.len() - 1];
        let last = segment.saturating_add(inner.len());
        if last.saturating_add(1) >= self.points.len() {
            return Err("the stroke has no such segment");
        }
        if self.points[segment + 1..=last] != *inner {
            return Err("its inner points are not the stroke's");
        }
        let from = self.beside(segment, mark[0], ON_STROKE).ok_or("it does not begin on that segment")?;
        let to = self.beside(last, mark[mark.len() - 1], ON_STROKE).ok_or("it does not end on its last segment")?;
        if from < to { Ok([from, to]) } else { Err("it runs against the direction that it claims") }
    }

    /// The fit of [`TextureStroke::fit`] for a mark on a tilted part, whose points are known to `off` nm: they lie on
    /// the stroke one after another, every vertex of the stroke among them.
    pub(super) fn fit_turned(&self, mark: &[P2], segment: usize, off: f64) -> Result<[f64; 2], &'static str> {
        if mark.len() < 2 {
            return Err("it is a dot, and the stroke a line");
        }
        let off = off + ON_STROKE;
        if segment + 1 >= self.points.len() {
            return Err("the stroke has no such segment");
        }
        if self.is_closed_whole(mark, segment, off) {
            return Ok([0.0, self.len()]);
        }
        self.fit_turned_from(mark, segment, off).or_else(|why| {
            // A cut point may have been rounded onto the end of its segment.
            let is_end = self.is_vertex(mark[0], segment + 1, off) && segment + 2 < self.points.len();
            if is_end { self.fit_turned_from(mark, segment + 1, off) } else { Err(why) }
        })
    }

    /// Whether a point is vertex `k` of the stroke, to `off` nm.
    fn is_vertex(&self, p: P2, k: usize, off: f64) -> bool {
        self.points.get(k).is_some_and(|&v| v.distance(p) <= off)
    }

    /// The fit of [`TextureStroke::fit_turned`] for a mark that begins on segment `k`.
    fn fit_turned_from(&self, mark: &[P2], mut k: usize, off: f64) -> Result<[f64; 2], &'static str> {
        let from = self.beside(k, mark[0], off).ok_or("it does not begin on that segment")?;
        let mut at = from;
        for (i, &p) in mark.iter().enumerate().skip(1) {
            let Some(to) = self.beside(k, p, off) else {
                return Err("its points are not on the stroke");
            };
            if to < at - off {
                return Err("it runs against the direction that it claims");
            }
            at = to;
            if self.is_vertex(p, k + 1, off) && i + 1 < mark.len() && k + 2 < self.points.len() {
                k += 1;
            }
        }
        if from < at { Ok([from, at]) } else { Err("it runs against the direction that it claims") }
    }

    /// Whether the mark is a whole closed figure that begins at the vertex where `segment` does.
    fn is_closed_whole(&self, mark: &[P2], segment: usize, off: f64) -> bool {
        let n = self.points.len();
        let same = |i: usize| {
            let k = if segment + i < n { segment + i } else { segment + i + 1 - n };
            self.points[k].distance(mark[i]) <= off
        };
        n == mark.len() && segment > 0 && self.points[0] == self.points[n - 1] && (0..n).all(same)
    }

    /// Length along the stroke of a point that lies next to segment `k` by no more than `off` nm.
    fn beside(&self, k: usize, p: P2, off: f64) -> Option<f64> {
        let (d, aside) = self.project(k, p);
        let len = self.along[k + 1] - self.along[k];
        let on = (-off..=len + off).contains(&d) && aside <= off;
        on.then(|| self.along[k] + d.clamp(0.0, len))
    }

    /// A whole closed figure may begin where `segment` does and run on over the point where it was drawn
    /// from.
    fn fit_around(&self, mark: &[P2], segment: usize) -> Option<[f64; 2]> {
        let (drawn, around) = (self.points.get(segment..)?, self.points.get(1..=segment)?);
        let is_turned = self.is_whole(mark) && drawn.iter().chain(around).eq(mark);
        is_turned.then(|| [0.0, self.len()])
    }

    /// Whether stroke and mark are closed and have equally many points.
    fn is_whole(&self, mark: &[P2]) -> bool {
        let is_closed = |points: &[P2]| points.first() == points.last();
        self.points.len() == mark.len() && is_closed(&self.points) && is_closed(mark)
    }

    /// A cut point that was rounded onto the end of its segment is the beginning of the next.
    fn fit_beyond(&self, mark: &[P2], segment: usize) -> Option<[f64; 2]> {
        let next = segment.checked_add(1)?;
        (self.points.get(next) == mark.first()).then(|| self.fit_from(mark, next).ok()).flatten()
    }

    /// Distance of `p` along and aside of segment `k`.
    fn project(&self, k: usize, p: P2) -> (f64, f64) {
        let (a, b) = (self.points[k], self.points[k + 1]);
        let len = a.distance(b);
        let dot = (b.x - a.x) as f64 * (p.x - a.x) as f64 + (b.y - a.y) as f64 * (p.y - a.y) as f64;
        // The end itself, whatever the rounding of its length.
        let d = if p == b { self.along[k + 1] - self.along[k] } else { dot / len };
        (d, orient(a, b, p).abs() / len)
    }

    /// Where a mark that is not what it claims comes nearest to the stroke with its ends, if anywhere near.
    pub(super) fn nearest(&self, mark: &[P2]) -> Option<[f64; 2]> {
        let [first, last] = [*mark.first()?, *mark.last()?];
        // Of equally near places the first for the beginning, the last for the end: closed figures.
        let from = self.nearest_place(first, |away, nearest| away < nearest)?;
        let to = self.nearest_place(last, |away, nearest| away <= nearest)?;
        if self.is_whole(mark) {
            return Some([0.0, self.len()]);
        }
        Some([from.min(to), from.max(to)])
    }

    /// The length along the stroke at which it passes a point, within [`NEAR`]; `is_nearer` compares the distance there
    /// with the least so far.
    fn nearest_place(&self, p: P2, is_nearer: impl Fn(f64, f64) -> bool) -> Option<f64> {
        let mut nearest = NEAR;
        let mut place = None;
        for k in 0..self.points.len() - 1 {
            let (d, aside) = self.project(k, p);
            let len = self.along[k + 1] - self.along[k];
            let away = math::hypot(aside, (-d).max(d - len).max(0.0));
            if is_nearer(away, nearest) {
                nearest = away;
                place = Some(self.along[k] + d.clamp(0.0, len));
            }
        }
        place
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_equally_near_places_a_mark_begins_at_the_first_and_ends_at_the_last() {
        let there_and_back = vec![P2::new(0, 0), P2::new(1000, 0), P2::new(0, 0)];
        let stroke = TextureStroke { points: there_and_back, along: vec![0.0, 1000.0, 2000.0] };
        assert_eq!(stroke.nearest(&[P2::new(100, 3), P2::new(200, 3)]), Some([100.0, 1800.0]));
        assert_eq!(stroke.nearest(&[P2::new(100, 20_000), P2::new(200, 3)]), None, "too far");
    }
}
