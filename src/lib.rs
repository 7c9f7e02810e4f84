#![doc = include_str!("lib.md")]

mod batch;
#[doc(hidden)]
pub mod cli;
mod resume;
#[cfg(feature = "run")]
#[doc(hidden)]
pub mod run;
mod sweep;

pub use terrace_core::diag::{Diag, Error, Kind, Place};
pub use terrace_core::machine::Machine;
pub use terrace_core::program::{Block, Program, Stop, Stroke};
pub use terrace_input::job::{Job, Mode, Overrides};
pub use terrace_input::surface::Surface;
pub use terrace_input::texture::Texture;
pub use terrace_plan::check::Checked;
pub use terrace_plan::manifest::{OnTheFlySummary, Summary, Times};
pub use terrace_plan::plan::{Inputs, OnTheFlyPlan, Phase, Plan, Progress, SteppedPlan, of_inputs as plan_of, plan};
pub use terrace_report::job_folder::{Durability, default_output, prepare, write, write_with};
pub use terrace_verify::{Proof, Rule, Violation, verify};
