#![doc = include_str!("lib.md")]

pub mod batch;
pub mod block_map;
pub mod budget;
pub mod check;
pub mod clearance;
pub mod cli;
pub mod compare;
pub mod diag;
pub mod emit;
pub mod geom;
pub mod job;
pub mod job_folder;
pub mod machine;
pub mod manifest;
pub mod motion;
pub mod on_the_fly;
pub mod order;
pub mod parallel;
pub mod partition;
pub mod plan;
pub mod program;
pub mod progress;
pub mod projection;
#[cfg(test)]
mod random;
pub mod report;
pub mod resume;
pub mod run;
pub mod scene;
pub mod split;
pub mod surface;
pub mod sweep;
pub mod texture;
pub mod units;
pub mod verify;
pub mod view;
