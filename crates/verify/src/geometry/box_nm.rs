//! Boxes in the plane of the turned part frame, in nm as f64.

/// A box in the plane, borders included; nm in the turned part frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BoxNm {
    /// Lower corner.
    pub(crate) lo: [f64; 2],
    /// Upper corner.
    pub(crate) hi: [f64; 2],
}

impl BoxNm {
    /// The box that holds nothing; grows with [`BoxNm::add`].
    pub(crate) const EMPTY: Self = Self { lo: [f64::INFINITY; 2], hi: [f64::NEG_INFINITY; 2] };

    /// Grows the box to hold `p`.
    pub(crate) fn add(&mut self, p: [f64; 2]) {
        self.lo = [0, 1].map(|k| self.lo[k].min(p[k]));
        self.hi = [0, 1].map(|k| self.hi[k].max(p[k]));
    }
    /// The box that reaches `by` beyond this one on all sides.
    pub(crate) fn grown(self, by: f64) -> Self {
        Self { lo: self.lo.map(|v| v - by), hi: self.hi.map(|v| v + by) }
    }
    /// Whether all of another box lies in this one.
    pub(crate) fn holds(&self, o: &Self) -> bool {
        (0..2).all(|k| self.lo[k] <= o.lo[k] && o.hi[k] <= self.hi[k])
    }
    /// Whether it shares a point with another box.
    pub(crate) fn touches(&self, o: &Self) -> bool {
        (0..2).all(|k| o.lo[k] <= self.hi[k] && self.lo[k] <= o.hi[k])
    }
}
