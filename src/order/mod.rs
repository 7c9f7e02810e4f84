//! Order: of stops along the stage's way, of strokes within a block, and where the stage must lift.

pub mod clearance;
mod clock;
mod ports;
pub mod stops;
pub mod strokes;
mod tour;
mod tree;
