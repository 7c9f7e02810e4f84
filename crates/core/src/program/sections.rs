//! The regular grid of sections over the texture's box.

use crate::geom::Grid;

/// Sections in the turned part frame, nm: the cells of a grid whose pitch is even, so that their centres are
/// whole.
pub type Sections = Grid;
