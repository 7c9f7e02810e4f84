//! The lines of a hatch pattern in the area that the boundary encloses, in mm.
//!
//! A point p is base + t direction + s offset: the lines have whole s, their dashes begin at t = 0. That holds after
//! any affine map, so the lines are found after it. An edge crosses line s where one of its ends lies at or below s and
//! the other above; so a corner on a line counts once or not at all, and crossings come in pairs.

use crate::texture::artwork::{MAX_POINTS, Stop};
use crate::texture::clip::Polylines;
use crate::texture::place::{LEAST, NM};
use terrace_core::math;

/// Most crossings of the lines of a family with the boundary: they are held to be sorted.
const MAX_CROSSINGS: f64 = 8e6;

/// A family of pattern lines after the map.
pub(super) struct Ruling<'a> {
    pub(super) base: [f64; 2],
    pub(super) direction: [f64; 2],
    pub(super) offset: [f64; 2],
    /// In units of `direction`.
    pub(super) dashes: &'a [f64],
}

/// What is reported of a family of lines that was drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct RulingReport {
    /// Whether the lines have no direction or no distance.
    pub(super) is_faulty: bool,
    /// Whether the pattern has dots, which are left out.
    pub(super) has_dots: bool,
    /// How often its lines meet the boundary.
    pub(super) crossings: usize,
}

/// A point as p = base + t direction + s offset: where an edge crosses line s, or an end of an edge.
#[derive(Clone, Copy, Debug)]
struct Crossing {
    s: f64,
    t: f64,
}

impl Ruling<'_> {
    /// Appends the lines inside the closed rings.
    ///
    /// # Errors
    /// [`Stop::Full`].
    pub(super) fn draw<'r>(
        &self,
        rings: impl Iterator<Item = &'r [[f64; 2]]>,
        out: &mut Polylines,
    ) -> Result<RulingReport, Stop> {
        let area = self.area();
        let distance = area.abs() / math::hypot(self.direction[0], self.direction[1]);
        // Lines closer than a nanometre would fill memory, not areas.
        if distance.is_nan() || distance < NM {
            return Ok(RulingReport { is_faulty: true, ..RulingReport::default() });
        }
        let crossings = self.crossings(rings, area)?;
        let mut report = RulingReport { crossings: crossings.len(), ..RulingReport::default() };
        for pair in crossings.chunks_exact(2) {
            report.has_dots |= self.dash(pair[0].s, [pair[0].t, pair[1].t], out)?;
        }
        Ok(report)
    }

    /// The cross product of direction and offset.
    fn area(&self) -> f64 {
        let [d, o] = [self.direction, self.offset];
        d[0] * o[1] - d[1] * o[0]
    }

    /// Where the lines cross the edges of closed rings, line by line and along each; `area` is [`Self::area`].
    fn crossings<'r>(&self, rings: impl Iterator<Item = &'r [[f64; 2]]>, area: f64) -> Result<Vec<Crossing>, Stop> {
        let mut crossings: Vec<Crossing> = Vec::new();
        for ring in rings {
            for i in 0..ring.len() {
                let [a, b] = [ring[i], ring[(i + 1) % ring.len()]].map(|p| self.coordinates(p, area));
                let [lo, hi] = if a.s < b.s { [a, b] } else { [b, a] };
                // A line through the lower end crosses the edge, one through the upper end does not.
                let first = lo.s.ceil();
                let last = hi.s.ceil() - 1.0;
                if crossings.len() as f64 + (last - first).max(0.0) > MAX_CROSSINGS {
                    return Err(Stop::Full);
                }
                let n = if last < first { 0 } else { (last - first) as usize + 1 };
                crossings.extend((0..n).map(|k| {
                    let s = first + k as f64;
                    Crossing { s, t: lo.t + (hi.t - lo.t) * ((s - lo.s) / (hi.s - lo.s)) }
                }));
            }
        }
        crossings.sort_unstable_by(|a, b| a.s.total_cmp(&b.s).then(a.t.total_cmp(&b.t)));
        Ok(crossings)
    }

    /// The line and the place along it on which a point lies.
    fn coordinates(&self, [x, y]: [f64; 2], area: f64) -> Crossing {
        let [d, o] = [self.direction, self.offset];
        let v = [x - self.base[0], y - self.base[1]];
        let s = (d[0] * v[1] - d[1] * v[0]) / area;
        // Noise must not decide which lines touch an edge along them.
        let s = if (s - s.round()).abs() < 1e-9 { s.round() } else { s };
        Crossing { s, t: (v[0] * o[1] - v[1] * o[0]) / area }
    }

    /// Appends line s from t0 to t1, unless it is too short to be marked; a unit of t has the length `scale`, mm.
    fn push(&self, s: f64, [t0, t1]: [f64; 2], scale: f64, out: &mut Polylines) -> Result<(), Stop> {
        if (t1 - t0) * scale < LEAST {
            return Ok(());
        }
        if out.points.len() + 2 > MAX_POINTS {
            return Err(Stop::Full);
        }
        let at = |t: f64| [0, 1].map(|k| self.base[k] + t * self.direction[k] + s * self.offset[k]);
        out.push(&[at(t0), at(t1)]);
        Ok(())
    }

    /// Appends the dashes of line s from t0 to t1; returns whether dots were left out.
    fn dash(&self, s: f64, [t0, t1]: [f64; 2], out: &mut Polylines) -> Result<bool, Stop> {
        let scale = math::hypot(self.direction[0], self.direction[1]);
        let period: f64 = self.dashes.iter().map(|d| d.abs()).sum();
        // Without dashes, or with ones too short to be marked, the line is drawn whole.
        if period * scale < LEAST {
            self.push(s, [t0, t1], scale, out)?;
            return Ok(false);
        }
        let has_dots = self.dashes.contains(&0.0);
        let first = (t0 / period).floor();
        let last = (t1 / period).floor();
        if last - first >= MAX_POINTS as f64 {
            return Err(Stop::Full);
        }
        // The dash that is being drawn: it may continue over the end of the period.
        let mut open: Option<[f64; 2]> = None;
        for k in 0..=(last - first) as usize {
            let mut at = (first + k as f64) * period;
            for &dash in self.dashes {
                let end = at + dash.abs();
                let [from, to] = [at.max(t0), end.min(t1)];
                if dash > 0.0 && from < to {
                    open = match open {
                        Some([a, b]) if (from - b).abs() <= 1e-9 * period => Some([a, to]),
                        Some(ended) => {
                            self.push(s, ended, scale, out)?;
                            Some([from, to])
                        }
                        None => Some([from, to]),
                    };
                }
                at = end;
            }
        }
        if let Some(ended) = open {
            self.push(s, ended, scale, out)?;
        }
        Ok(has_dots)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SQUARE: [[f64; 2]; 4] = [[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]];
    const HOLE: [[f64; 2]; 4] = [[4.0, 4.0], [6.0, 4.0], [6.0, 6.0], [4.0, 6.0]];

    fn drawn(ruling: &Ruling<'_>, rings: &[&[[f64; 2]]]) -> (RulingReport, Vec<[[f64; 2]; 2]>) {
        let mut lines = Polylines::default();
        let ruled = ruling.draw(rings.iter().copied(), &mut lines).expect("drawn");
        (ruled, lines.iter().map(|l| [l[0], l[1]]).collect())
    }

    fn length(lines: &[[[f64; 2]; 2]]) -> f64 {
        lines.iter().map(|[a, b]| math::hypot(b[0] - a[0], b[1] - a[1])).sum()
    }

    #[test]
    fn lines_leave_holes_out_and_dashes_begin_at_the_base() {
        let mut ruling = Ruling { base: [0.0, 0.5], direction: [1.0, 0.0], offset: [0.25, 1.0], dashes: &[] };
        let (_, lines) = drawn(&ruling, &[&SQUARE, &HOLE]);
        assert_eq!((lines.len(), length(&lines)), (12, 96.0));
        ruling.dashes = &[0.5, -0.25, 0.0, -0.25];
        let (ruled, lines) = drawn(&ruling, &[&SQUARE]);
        assert!(ruled.has_dots && (length(&lines) - 50.0).abs() < 1e-9);
        assert!(lines.contains(&[[0.0, 0.5], [0.5, 0.5]]) && lines.contains(&[[0.25, 1.5], [0.75, 1.5]]), "shifted");
        ruling.dashes = &[0.5, -0.25, 0.25];
        let (_, lines) = drawn(&ruling, &[&SQUARE]);
        assert!(lines.contains(&[[0.75, 0.5], [1.5, 0.5]]), "a dash continues over the end of the period: {lines:?}");
    }

    #[test]
    fn corners_on_lines_lose_and_double_nothing() {
        // All corners lie on lines.
        let diamond = [[5.0, 0.0], [10.0, 5.0], [5.0, 10.0], [0.0, 5.0]];
        let ruling = Ruling { base: [0.0; 2], direction: [2.0, 0.0], offset: [0.0, 1.0], dashes: &[] };
        let (_, lines) = drawn(&ruling, &[&diamond]);
        assert_eq!((lines.len(), length(&lines)), (9, 50.0));
        let (_, lines) = drawn(&ruling, &[&SQUARE]);
        assert_eq!((lines.len(), length(&lines)), (10, 100.0), "of two edges along lines one is drawn");
    }

    #[test]
    fn endless_families_are_refused() {
        let ruling = |offset: [f64; 2], dashes| Ruling { base: [0.0; 2], direction: [1.0, 0.0], offset, dashes };
        let (ruled, lines) = drawn(&ruling([1.0, 0.0], &[]), &[&SQUARE]);
        assert!(ruled.is_faulty && lines.is_empty(), "all lines are one");
        let (ruled, _) = drawn(&ruling([0.0, 1e-7], &[]), &[&SQUARE]);
        assert!(ruled.is_faulty, "a tenth of a nanometre apart");
        let mut lines = Polylines::default();
        assert_eq!(ruling([0.0, 1.1e-6], &[]).draw([&SQUARE[..]].into_iter(), &mut lines), Err(Stop::Full));
        let large = SQUARE.map(|p| p.map(|v| 10.0 * v));
        let mut lines = Polylines::default();
        assert_eq!(ruling([0.0, 1.0], &[1.5e-6, -1.5e-6]).draw([&large[..]].into_iter(), &mut lines), Err(Stop::Full));
    }
}
