//! A place of the part that may be measured.

use terrace_core::geom::{NM_PER_MM, SpacePoint};
use terrace_core::machine::Commanded;

/// A place of the part.
#[derive(Clone, Debug)]
pub(super) struct Place {
    /// Where it lies, part frame, nm.
    pub(super) at: SpacePoint,
    /// dz/dx and dz/dy there.
    pub(super) slope: [f64; 2],
    /// Where the axes stand as the tip would touch there, or with the focus there.
    pub(super) stage: Commanded,
}

impl Place {
    pub(super) fn plane_mm(&self) -> [f64; 2] {
        [self.at[0] / NM_PER_MM, self.at[1] / NM_PER_MM]
    }
}
