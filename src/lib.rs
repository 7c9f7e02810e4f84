#![doc = include_str!("lib.md")]

pub mod check;
pub mod diag;
pub mod geom;
pub mod machine;
pub mod partition;
pub mod preview;
pub mod program;
pub mod record;
pub mod spec;
pub mod surface;
pub mod texture;
pub mod units;
