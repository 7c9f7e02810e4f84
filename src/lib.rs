#![doc = include_str!("lib.md")]

pub mod batch;
pub mod cli;
pub mod resume;
pub mod run;
pub mod sweep;
