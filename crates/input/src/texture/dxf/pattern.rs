//! The lines of a hatch pattern in the area that the boundary encloses, in mm.
//!
//! A point p is base + t direction + s offset: the lines have whole s, their dashes begin at t = 0. That holds after
//! any affine map, so the lines are found after it. An edge crosses line s where one of its ends lies at or below s and
//! the other above; so a corner on a line counts once or not at all, and crossings come in pairs.

use crate::texture::artwork::{MAX_POINTS, Stop};
use crate::texture::clip::Lines;
use crate::texture::place::{LEAST, NM};

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

/// What came of a family.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Ruled {
    /// Whether the lines have no direction or no distance.
    pub(super) is_faulty: bool,
    /// Whether the pattern has dots, which are left out.
    pub(super) has_dots: bool,
    /// How often its lines meet the boundary.
    pub(super) crossings: usize,
}

impl Ruling<'_> {
    /// Appends the lines inside the closed rings.
    ///
    /// # Errors
    /// [`Stop::Full`].
    pub(super) fn draw<'r>(&self, rings: impl Iterator<Item = &'r [[f64; 2]]>, out: &mut Lines) -> Result<Ruled, Stop> {
        let [d, o] = [self.direction, self.offset];
        let area = d[0] * o[1] - d[1] * o[0];
        let distance = area.abs() / d[0].hypot(d[1]);
        // Lines closer than a nanometre would fill memory, not areas.
        if distance.is_nan() || distance < NM {
            return Ok(Ruled { is_faulty: true, ..Ruled::default() });
        }
        let coordinates = |[x, y]: [f64; 2]| {
            let v = [x - self.base[0], y - self.base[1]];
            let s = (d[0] * v[1] - d[1] * v[0]) / area;
            // Noise must not decide which lines touch an edge along them.
            let s = if (s - s.round()).abs() < 1e-9 { s.round() } else { s };
            [s, (v[0] * o[1] - v[1] * o[0]) / area]
        };
        let mut crossings: Vec<(f64, f64)> = Vec::new();
        for ring in rings {
            for i in 0..ring.len() {
                let [a, b] = [ring[i], ring[(i + 1) % ring.len()]].map(coordinates);
                let [lo, hi] = if a[0] < b[0] { [a, b] } else { [b, a] };
                let (first, last) = (lo[0].ceil(), hi[0].ceil() - 1.0);
                if crossings.len() as f64 + (last - first).max(0.0) > MAX_CROSSINGS {
                    return Err(Stop::Full);
                }
                let n = if last < first { 0 } else { (last - first) as usize + 1 };
                crossings.extend((0..n).map(|k| {
                    let s = first + k as f64;
                    (s, lo[1] + (hi[1] - lo[1]) * ((s - lo[0]) / (hi[0] - lo[0])))
                }));
            }
        }
        crossings.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
        let mut ruled = Ruled { crossings: crossings.len(), ..Ruled::default() };
        for pair in crossings.chunks_exact(2) {
            ruled.has_dots |= self.dash(pair[0].0, [pair[0].1, pair[1].1], out)?;
        }
        Ok(ruled)
    }

    /// Appends the dashes of line s from t0 to t1; returns whether dots were left out.
    fn dash(&self, s: f64, [t0, t1]: [f64; 2], out: &mut Lines) -> Result<bool, Stop> {
        let scale = self.direction[0].hypot(self.direction[1]);
        let mut put = |from: f64, to: f64| {
            if (to - from) * scale < LEAST {
                return Ok(());
            }
            if out.points.len() + 2 > MAX_POINTS {
                return Err(Stop::Full);
            }
            let at = |t: f64| [0, 1].map(|k| self.base[k] + t * self.direction[k] + s * self.offset[k]);
            out.push(&[at(from), at(to)]);
            Ok(())
        };
        let period: f64 = self.dashes.iter().map(|d| d.abs()).sum();
        if period * scale < LEAST {
            put(t0, t1)?;
            return Ok(false);
        }
        let has_dots = self.dashes.contains(&0.0);
        let (first, last) = ((t0 / period).floor(), (t1 / period).floor());
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
                        Some([a, b]) => {
                            put(a, b)?;
                            Some([from, to])
                        }
                        None => Some([from, to]),
                    };
                }
                at = end;
            }
        }
        if let Some([a, b]) = open {
            put(a, b)?;
        }
        Ok(has_dots)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SQUARE: [[f64; 2]; 4] = [[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]];
    const HOLE: [[f64; 2]; 4] = [[4.0, 4.0], [6.0, 4.0], [6.0, 6.0], [4.0, 6.0]];

    fn drawn(ruling: &Ruling<'_>, rings: &[&[[f64; 2]]]) -> (Ruled, Vec<[[f64; 2]; 2]>) {
        let mut lines = Lines::default();
        let ruled = ruling.draw(rings.iter().copied(), &mut lines).expect("drawn");
        (ruled, lines.iter().map(|l| [l[0], l[1]]).collect())
    }

    fn length(lines: &[[[f64; 2]; 2]]) -> f64 {
        lines.iter().map(|[a, b]| (b[0] - a[0]).hypot(b[1] - a[1])).sum()
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
        let mut lines = Lines::default();
        assert_eq!(ruling([0.0, 1.1e-6], &[]).draw([&SQUARE[..]].into_iter(), &mut lines), Err(Stop::Full));
        let large = SQUARE.map(|p| p.map(|v| 10.0 * v));
        let mut lines = Lines::default();
        assert_eq!(ruling([0.0, 1.0], &[1.5e-6, -1.5e-6]).draw([&large[..]].into_iter(), &mut lines), Err(Stop::Full));
    }
}
