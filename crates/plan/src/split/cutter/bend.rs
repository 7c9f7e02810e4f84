//! Lines in the field of a turned part.

use terrace_core::math;
use terrace_core::program::CHORD_NM;

/// A line in the field that bends with the surface, followed from its last point: the directions in which it may
/// continue straight and pass all places since then within [`CHORD_NM`].
#[derive(Clone, Copy, Default)]
pub(super) struct Bend {
    from: [f64; 2],
    /// The last place; None where there is none since the last point.
    at: Option<[f64; 2]>,
    /// Unit vector in which directions are measured, and their least and greatest tangent.
    along: [f64; 2],
    open: [f64; 2],
}

impl Bend {
    /// Goes on from a point of the program.
    pub(super) fn start(from: [f64; 2]) -> Self {
        Self { from, at: None, along: [0.0; 2], open: [0.0; 2] }
    }

    /// Goes on to `to`; returns the place at which a point must be set, if one must.
    pub(super) fn go(&mut self, to: [f64; 2]) -> Option<[f64; 2]> {
        let corner = self.at.filter(|_| !self.reaches(to));
        if let Some(corner) = corner {
            *self = Self::start(corner);
        }
        let d = [to[0] - self.from[0], to[1] - self.from[1]];
        let length = math::hypot(d[0], d[1]);
        if self.at.is_none() {
            self.along = [d[0] / length, d[1] / length];
            self.open = [f64::NEG_INFINITY, f64::INFINITY];
        }
        // The tangents of the lines from `from` that pass this place within the tolerance; the line that serves all
        // places so far lies in the intersection.
        // Nearer than the tolerance nothing is a direction.
        let (x, y) = self.local(d);
        if x > CHORD_NM {
            self.open = [self.open[0].max((y - CHORD_NM) / x), self.open[1].min((y + CHORD_NM) / x)];
        }
        self.at = Some(to);
        corner
    }

    fn reaches(&self, to: [f64; 2]) -> bool {
        let (x, y) = self.local([to[0] - self.from[0], to[1] - self.from[1]]);
        x > 0.0 && (self.open[0]..=self.open[1]).contains(&(y / x))
    }

    fn local(&self, d: [f64; 2]) -> (f64, f64) {
        let [x, y] = self.along;
        (d[0] * x + d[1] * y, d[1] * x - d[0] * y)
    }
}
