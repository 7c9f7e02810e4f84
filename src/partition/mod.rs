//! Where the stage stands: the grid of sections and the levels in each.

use crate::geom::P2;

/// The regular grid of sections over the texture's box, turned part frame, nm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sections {
    /// Lower left corner.
    pub origin: P2,
    /// Pitch along x and y.
    pub pitch: [i64; 2],
    /// Columns and rows.
    pub count: [u32; 2],
}
