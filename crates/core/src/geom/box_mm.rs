//! Boxes in mm, before what is in them is rounded to the nanometre.

/// A box in mm in `D` dimensions, borders included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoxMm<const D: usize> {
    /// Lower corner.
    pub lo: [f64; D],
    /// Upper corner.
    pub hi: [f64; D],
}

impl<const D: usize> BoxMm<D> {
    /// The box that holds nothing; grows with [`BoxMm::add`].
    pub const EMPTY: Self = Self { lo: [f64::INFINITY; D], hi: [f64::NEG_INFINITY; D] };

    /// The smallest box that holds all of these points.
    pub fn of(points: impl IntoIterator<Item = [f64; D]>) -> Self {
        let mut all = Self::EMPTY;
        points.into_iter().for_each(|p| all.add(p));
        all
    }
    /// Grows the box to hold `p`.
    #[inline]
    pub fn add(&mut self, p: [f64; D]) {
        for ((lo, hi), v) in self.lo.iter_mut().zip(&mut self.hi).zip(p) {
            *lo = lo.min(v);
            *hi = hi.max(v);
        }
    }
    /// Extents along the axes.
    pub fn size(&self) -> [f64; D] {
        std::array::from_fn(|k| self.hi[k] - self.lo[k])
    }
}

impl BoxMm<2> {
    /// The box from (x0, y0) to (x1, y1), mm: in the order of job files.
    pub const fn rectangle(x0: f64, y0: f64, x1: f64, y1: f64) -> Self {
        Self { lo: [x0, y0], hi: [x1, y1] }
    }
    /// The corners of the box, counter-clockwise from the lower left, mm.
    pub const fn corners(&self) -> [[f64; 2]; 4] {
        let ([x0, y0], [x1, y1]) = (self.lo, self.hi);
        [[x0, y0], [x1, y0], [x1, y1], [x0, y1]]
    }
}
