//! Planning: the texture is followed over the surface, divided into stops or a path on the fly, ordered, checked, and
//! written as programs and manifest.

pub mod block_map;
pub mod budget;
pub mod check;
pub mod emit;
pub mod fixtures;
pub mod manifest;
pub mod marked;
pub mod measured;
pub mod on_the_fly;
pub mod order;
pub mod ordered_strokes;
pub mod partition;
pub mod plan;
pub mod probe;
pub mod projection;
pub mod split;
