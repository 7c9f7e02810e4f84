//! A pass of a plan.

use std::ops::Range;

use crate::block_map::BlockMap;
use crate::partition::bound::Certificate;
use terrace_core::geom::Box2;
use terrace_core::program::Sections;
use terrace_input::texture::{Directions, Texture};

/// One pass over the texture.
#[derive(Clone, Debug)]
pub struct Pass {
    /// The grid of sections.
    pub sections: Sections,
    /// Directions of what is filled along contours, by section; None where nothing is.
    pub directions: Option<Directions>,
    /// The strokes of the pass.
    pub strokes: Texture,
    /// Which of its blocks owns which place; numbered from its first.
    pub map: BlockMap,
    /// The box of its texture, turned part frame.
    pub texture: Box2,
    /// Why no partition of it has fewer stops than its lower bound; None where none is known.
    pub bound: Option<Certificate>,
    /// The blocks of the pass in the program.
    pub blocks: Range<usize>,
}
