//! What every part of terrace shares: quantities and geometry, faults, progress and threads, the machine with its
//! motion, and the program of a stepped job.

pub mod clearance;
pub mod diag;
pub mod duration;
pub mod format;
pub mod geom;
pub mod host;
pub mod machine;
pub mod math;
pub mod motion;
pub mod parallel;
pub mod program;
pub mod progress;
pub mod python;
#[cfg(any(test, feature = "test-support"))]
pub mod random;
pub mod units;
#[cfg(any(test, feature = "test-support"))]
pub mod variants;
