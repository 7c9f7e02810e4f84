//! The frames of the part, and points in space that belong to one of them.

use std::marker::PhantomData;
use std::ops::{Index, IndexMut};

/// The frame of the part as it lies on the table without a tilt: that of surface and texture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Part;

/// The same frame with the part in it as the tilt table has turned it at a stop, or as a head that is tilted sees
/// it. Points come from one to the other by [`Turn`](super::Turn) alone.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Turned;

/// The frame of the scanner's controller: the field with axes swapped and mirrored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Controller;

/// A point in space, nm; its coordinates by index.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct P3<F = Part> {
    /// x, y and z in nm.
    pub at: [f64; 3],
    frame: PhantomData<F>,
}

impl<F> P3<F> {
    /// The point (x, y, z), nm.
    #[inline]
    pub const fn new(at: [f64; 3]) -> Self {
        Self { at, frame: PhantomData }
    }
}

impl<F> Index<usize> for P3<F> {
    type Output = f64;

    #[inline]
    fn index(&self, axis: usize) -> &f64 {
        &self.at[axis]
    }
}

/// A point in space, mm; its coordinates by index.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct P3Mm<F = Part> {
    /// x, y and z in mm.
    pub mm: [f64; 3],
    frame: PhantomData<F>,
}

impl<F> P3Mm<F> {
    /// The point (x, y, z), mm.
    #[inline]
    pub const fn new(mm: [f64; 3]) -> Self {
        Self { mm, frame: PhantomData }
    }
    /// What of each coordinate leads from another point to this one, mm.
    pub fn way_from(self, other: Self) -> [f64; 3] {
        [0, 1, 2].map(|k| self.mm[k] - other.mm[k])
    }
    /// The point that lies so far from this one, mm.
    #[must_use]
    pub fn moved(self, by: [f64; 3]) -> Self {
        Self::new([0, 1, 2].map(|k| self.mm[k] + by[k]))
    }
    /// The point at a share, 0 to 1, of the way to another.
    #[must_use]
    pub fn lerp(self, to: Self, share: f64) -> Self {
        Self::new([0, 1, 2].map(|k| self.mm[k] + share * (to.mm[k] - self.mm[k])))
    }
    /// x and y.
    pub fn xy(self) -> [f64; 2] {
        [self.mm[0], self.mm[1]]
    }
}

impl<F> Index<usize> for P3Mm<F> {
    type Output = f64;

    #[inline]
    fn index(&self, axis: usize) -> &f64 {
        &self.mm[axis]
    }
}

impl<F> IndexMut<usize> for P3Mm<F> {
    #[inline]
    fn index_mut(&mut self, axis: usize) -> &mut f64 {
        &mut self.mm[axis]
    }
}

/// A direction in the frame of the part: a vector of length 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnitVector(pub [f64; 3]);

impl UnitVector {
    /// Up, as the part lies.
    pub const UP: Self = Self([0.0, 0.0, 1.0]);
}
