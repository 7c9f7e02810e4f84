//! Order: of stops along the stage's way, and of strokes within a block.

mod endpoints;
mod kd_tree;
mod move_times;
pub mod slide;
pub mod stops;
pub mod strokes;
mod tour;
