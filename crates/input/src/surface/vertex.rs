//! A corner of a mesh, and how near to a rim a place lies on it.

use terrace_core::geom::P2;

/// Says that there is no facet or half-edge.
pub(crate) const NONE: u32 = u32::MAX;

/// A vertex in local coordinates: x and y integer nm, z nm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Vertex {
    pub x: i32,
    pub y: i32,
    pub z: f64,
}

impl Vertex {
    pub fn p2(self) -> P2 {
        P2::new(self.x.into(), self.y.into())
    }
}

/// A corner of a facet: the vertex that it shares with its neighbours, and the number of that.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FacetCorner {
    pub vertex: Vertex,
    pub number: u32,
}

/// A place so near to a rim, nm, lies on it: the grid's diagonal, half of it for the rounding of the stroke
/// and half for that of the rim, and the noise of f64.
pub(super) const ON_RIM: f64 = std::f64::consts::SQRT_2 + 0.05;
