//! Points of the scan field and of the controller that moves the spot in it.

use super::{Controller, P2};

/// A point of the field frame, nm: from the optical axis, x and y as the turned part's.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct FieldPoint {
    /// x in nm.
    pub x: i32,
    /// y in nm.
    pub y: i32,
}

impl FieldPoint {
    /// The optical axis.
    pub const AXIS: Self = Self { x: 0, y: 0 };

    /// The point (x, y), in nm.
    pub const fn new(x: i32, y: i32) -> Self {
        Self { x, y }
    }
}

impl From<[i32; 2]> for FieldPoint {
    /// The point (x, y), in nm.
    fn from([x, y]: [i32; 2]) -> Self {
        Self { x, y }
    }
}

/// A point as the controller of the scanner gets it, nm: of the field, with axes swapped and mirrored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct ControllerPoint {
    /// x in nm.
    pub x: i32,
    /// y in nm.
    pub y: i32,
}

impl ControllerPoint {
    /// The point with coordinates as boxes have them.
    #[inline]
    pub fn p2(self) -> P2<Controller> {
        P2::new(self.x.into(), self.y.into())
    }
}
