//! Parallel lines at one distance, clipped to a rectangle.
//!
//! The line through the lower left corner belongs to the lattice; lines on the border are marked,
//! lines that only touch a corner are not. Stroke `i` is line `first + i`, counted along the normal
//! that lies left of the direction, and runs along the direction.

use crate::diag::{Diag, Error};
use crate::geom::{Box2, BoxMm, P2, cos_sin};
use crate::texture::Figure;
use crate::texture::place::{NM, Turn, steps};
use crate::texture::{MAX_STROKES, too_large};

#[derive(Debug)]
pub(in crate::texture) struct Hatch {
    area: BoxMm<2>,
    direction: [f64; 2],
    pitch: f64,
    /// Number of the first line in the lattice.
    first: i64,
    count: i64,
    turn: Turn,
}

/// The error for a pitch that lines cannot have.
pub(super) fn bad_pitch(pitch: f64) -> Error {
    Diag::input("texture-pitch", format!("a hatch pitch of {pitch} mm is not possible"))
        .hint("use a pitch of at least 1 nm")
        .into()
}

impl Figure for Hatch {
    fn len(&self) -> u64 {
        self.count as u64
    }

    fn points(&self) -> u64 {
        2 * self.len()
    }

    /// The ends of lines move along the border evenly from corner to corner, so the extremes are
    /// taken by the outermost lines or by lines next to a corner.
    fn bounds(&self) -> Box2 {
        let last = self.first + self.count - 1;
        let mut bounds = Box2::EMPTY;
        if self.count == 0 {
            return bounds;
        }
        for corner in self.area.corners() {
            let k = (self.height(corner) / self.pitch).round() as i64;
            for k in k - 1..=k + 1 {
                self.line(k.clamp(self.first, last)).into_iter().flatten().for_each(|p| bounds.add(p));
            }
        }
        bounds
    }

    fn stroke(&self, i: u64, out: &mut Vec<P2>) {
        let line = self.line(self.first + i as i64).expect("lines between the outermost ones have a length");
        out.extend_from_slice(&line);
    }

    fn element(&self, i: u64) -> String {
        format!("hatch line {}", i + 1)
    }
}

impl Hatch {
    pub(in crate::texture) fn new(area: BoxMm<2>, pitch: f64, direction: f64, turn: Turn) -> Result<Self, Error> {
        if !(pitch >= NM && pitch.is_finite() && direction.is_finite()) {
            return Err(bad_pitch(pitch));
        }
        let direction = cos_sin(direction);
        let mut hatch = Self { area, direction, pitch, first: 0, count: 0, turn };
        let heights = area.corners().map(|c| hatch.height(c));
        let lowest = heights.into_iter().fold(0.0, f64::min);
        let highest = heights.into_iter().fold(0.0, f64::max);
        let (below, above) = (steps(-lowest, pitch), steps(highest, pitch));
        if below + above >= MAX_STROKES as f64 {
            return Err(too_large((below + above) as u64, 2 * (below + above) as u64).into());
        }
        hatch.first = -(below as i64);
        hatch.count = below as i64 + above as i64 + 1;
        // Lines through a corner have no length; near it the length grows with the distance, so
        // only the outermost lines can be that short.
        while hatch.count > 0 && hatch.line(hatch.first).is_none() {
            hatch.first += 1;
            hatch.count -= 1;
        }
        while hatch.count > 0 && hatch.line(hatch.first + hatch.count - 1).is_none() {
            hatch.count -= 1;
        }
        Ok(hatch)
    }

    /// Distance of a point from line 0, along the normal.
    fn height(&self, p: [f64; 2]) -> f64 {
        let [c, s] = self.direction;
        c * (p[1] - self.area.lo[1]) - s * (p[0] - self.area.lo[0])
    }

    /// The ends of line `k`; None where it has no length in the area.
    fn line(&self, k: i64) -> Option<[P2; 2]> {
        let (BoxMm { lo, hi }, d) = (self.area, self.direction);
        let offset = k as f64 * self.pitch;
        let mut p = [lo[0] - d[1] * offset, lo[1] + d[0] * offset];
        let (mut t0, mut t1) = (f64::NEG_INFINITY, f64::INFINITY);
        for a in 0..2 {
            if d[a] == 0.0 {
                // The last line may miss the border by the slack of the count.
                p[a] = p[a].clamp(lo[a], hi[a]);
                continue;
            }
            let (ta, tb) = ((lo[a] - p[a]) / d[a], (hi[a] - p[a]) / d[a]);
            t0 = t0.max(ta.min(tb));
            t1 = t1.min(ta.max(tb));
        }
        if t0 >= t1 {
            return None;
        }
        let end = |t: f64| self.turn.nm([0, 1].map(|a| (p[a] + t * d[a]).clamp(lo[a], hi[a])));
        let ends = [end(t0), end(t1)];
        (ends[0] != ends[1]).then_some(ends)
    }
}
