//! What a machine is commanded and where the part lies on it: values of frames of their own.

use std::ops::{Index, IndexMut};

use crate::geom::mm_from_nm;

/// Commanded positions of the linear axes x, y and z, nm, with the signs of the axes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[repr(transparent)]
pub struct Commanded(pub [i64; 3]);

/// Where the origin of the part frame lies in the table frame, nm.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[repr(transparent)]
pub struct Origin(pub [i64; 3]);

/// Commanded angles of the tilt axes, outer and inner, millionths of a degree.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[repr(transparent)]
pub struct TiltAngles(pub [i64; 2]);

impl Commanded {
    /// The positions in mm.
    pub fn mm(self) -> [f64; 3] {
        self.0.map(mm_from_nm)
    }
}

impl Origin {
    /// The place in mm.
    pub fn mm(self) -> [f64; 3] {
        self.0.map(mm_from_nm)
    }
}

impl TiltAngles {
    /// The table as it lies without a command.
    pub const UPRIGHT: Self = Self([0; 2]);

    /// Whether nothing is tilted.
    pub fn is_upright(self) -> bool {
        self == Self::UPRIGHT
    }
    /// The angles in degrees.
    pub fn deg(self) -> [f64; 2] {
        self.0.map(|micro| micro as f64 / 1e6)
    }
}

macro_rules! by_axis {
    ($($name:ty),*) => {$(
        impl Index<usize> for $name {
            type Output = i64;

            fn index(&self, axis: usize) -> &i64 {
                &self.0[axis]
            }
        }

        impl IndexMut<usize> for $name {
            fn index_mut(&mut self, axis: usize) -> &mut i64 {
                &mut self.0[axis]
            }
        }
    )*};
}

by_axis!(Commanded, Origin, TiltAngles);
