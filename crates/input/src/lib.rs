//! Readers of what a job is made from: surfaces, textures and job files.

pub mod fixture;
pub mod job;
pub mod measured;
pub mod surface;
pub mod texture;
