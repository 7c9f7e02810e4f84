#![doc = include_str!("lib.md")]

pub mod check;
pub mod diag;
pub mod emit;
pub mod geom;
pub mod machine;
pub mod motion;
pub mod order;
pub mod partition;
pub mod program;
pub mod record;
pub mod spec;
pub mod split;
pub mod surface;
pub mod texture;
pub mod trace;
pub mod units;
