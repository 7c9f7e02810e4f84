//! The job: what to mark, on what, how, with which machine.
//!
//! [`mod@file`] is the TOML as written, `resolve` turns it in one step into a [`Job`] whose values cannot be
//! wrong: lengths are nanometres within 4 m, names are indices, every default is filled, every pattern has
//! its own variant. All faults of a file are reported at once, each at its place. What needs other files
//! (the surface, drawings, the machine) is found out when these are read.

mod faults;
pub mod file;
mod file_unit;
mod fixtures;
mod marked;
mod not_a_job;
mod partition;
mod passes;
mod plausible;
mod read;
mod resolve;
mod resolved;
mod sample;
mod setting;
mod texture;
mod unused;

pub use file::{
    Compensate, DepthRule, Dose, Implausible, Level, MarkPower, Mode, Steep, StopOrder, StrokeOrder, Unsure,
    json_schema,
};
pub use file_unit::FileUnit;
pub use fixtures::{FixtureFrame, FixtureInput, FixtureShape};
pub use marked::MarkedInput;
pub use partition::{Method, Objective, Partition};
pub use passes::Passes;
pub use read::{read_file, read_text};
pub use resolve::MAX_SETUPS;
pub use resolved::{
    Attitude, Focus, Job, Limits, MachineInput, MeasuredInput, Order, Overrides, Placement, Setups, SurfaceInput,
    backslash,
};
pub use sample::{SAMPLE_DRAWING, SAMPLE_DRAWING_NAME, SAMPLE_JOB, SAMPLE_SURFACE_NAME, SCHEMA_NAME, sample_surface};
pub use setting::{KeyValue, Keys, KnownKey, Setting, known_keys, near_keys};
pub use terrace_core::format::Format;
