//! Order: of stops along the stage's way, of strokes within a block, and where the stage must lift.

pub mod clearance;
mod endpoints;
mod kd_tree;
mod move_times;
pub mod stops;
pub mod strokes;
mod tour;
