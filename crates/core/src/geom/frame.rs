//! The frames of the part, and points in space that belong to one of them.

use std::marker::PhantomData;
use std::ops::Index;

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
