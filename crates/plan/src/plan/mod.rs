//! Planning: from a job and its inputs to a checked program.
//!
//! [`Inputs::load`] opens every input file once. [`plan`] then makes a [`SteppedPlan`] or an
//! [`OnTheFlyPlan`] of them, by the job's mode. Both are chains of values: every function takes what it
//! needs and returns something new; `stepped` and `on_the_fly` alone know the order of the steps. The
//! files of this module use each other in one direction, without cycles.
//!
//! Threads are used in `stroke_chunks` and `split`: work is cut into chunks whose number does not depend on the
//! number of threads, and results are joined in the order of the chunks, so threads never change a byte.

mod assemble;
mod bound;
mod candidate;
mod candidates;
mod cut;
mod cut_again;
mod dose;
mod doubled;
mod early;
mod extent;
mod fly_formats;
mod focal_plane;
mod frames;
mod grid;
mod hatch_direction;
mod hatch_saving;
mod inputs;
mod job_time;
pub mod lay;
mod lifts;
mod merge;
mod methods;
mod nothing;
mod off_part;
mod on_the_fly;
mod operator_way;
pub mod orient;
pub mod part;
mod parts;
mod pass;
mod places;
mod plausible;
mod progress;
mod setups;
mod site;
mod space_curves;
mod split;
mod standstills;
mod start;
mod stepped;
mod stroke_chunks;
pub mod strokes;
mod summary;
mod tilted_stops;
mod warnings;

pub use hatch_saving::HatchSaving;
pub use inputs::{Inputs, designed};
pub use job_time::{clock_of_program, of_program};
pub use off_part::OffPart;
pub use on_the_fly::OnTheFlyPlan;
#[cfg(any(test, feature = "test-support"))]
pub use on_the_fly::laser;
pub use pass::Pass;
pub use progress::{Phase, Progress, phases, phases_of_writing};
pub use stepped::{Draft, SteppedPlan};

use crate::manifest::AnySummary;
use terrace_core::diag::{Diag, Error};
use terrace_core::machine::Machine;
use terrace_input::job::{Job, Mode};

/// A job that was planned and checked, not yet written.
#[derive(Debug)]
pub enum Plan {
    /// The stage steps from stop to stop.
    Stepped(Box<SteppedPlan>),
    /// The galvo marks while the stage moves.
    OnTheFly(Box<OnTheFlyPlan>),
}

impl Plan {
    /// The job.
    pub fn job(&self) -> &Job {
        match self {
            Self::Stepped(plan) => &plan.job,
            Self::OnTheFly(plan) => &plan.job,
        }
    }
    /// The machine of the job.
    pub fn machine(&self) -> &Machine {
        match self {
            Self::Stepped(plan) => &plan.machine,
            Self::OnTheFly(plan) => &plan.machine,
        }
    }
    /// The plan of a stepped job; None of an on-the-fly one.
    pub fn stepped(&self) -> Option<&SteppedPlan> {
        match self {
            Self::Stepped(plan) => Some(plan),
            Self::OnTheFly(_) => None,
        }
    }
    /// The figures of the plan.
    pub fn summary(&self) -> AnySummary {
        match self {
            Self::Stepped(plan) => AnySummary::Stepped(Box::new(plan.summary.clone())),
            Self::OnTheFly(plan) => AnySummary::OnTheFly(Box::new(plan.summary.clone())),
        }
    }
    /// What the user should know.
    pub fn warnings(&self) -> &[Diag] {
        match self {
            Self::Stepped(plan) => &plan.warnings,
            Self::OnTheFly(plan) => &plan.warnings,
        }
    }
}

/// Reads the inputs of a job and plans it by its mode.
///
/// # Errors
/// Faults of the inputs; limits of the machine that the job breaks.
pub fn plan(job: Job, progress: Progress<'_>) -> Result<Plan, Error> {
    let inputs = Inputs::load_each(&job, &mut |_| {}, Phase::Read.task(progress))?;
    of_inputs(job, inputs, progress)
}

/// Plans a job whose inputs were read, by its mode.
///
/// # Errors
/// Limits of the machine that the job breaks.
pub fn of_inputs(job: Job, inputs: Inputs, progress: Progress<'_>) -> Result<Plan, Error> {
    match job.mode {
        Mode::Stepped => stepped::plan(job, inputs, progress).map(|p| Plan::Stepped(Box::new(p))),
        Mode::OnTheFly => on_the_fly::plan(job, inputs, progress).map(|p| Plan::OnTheFly(Box::new(p))),
    }
}

/// Plans a stepped job whose inputs were read.
///
/// # Errors
/// Limits of the machine that the job breaks.
pub fn stepped(job: Job, inputs: Inputs) -> Result<SteppedPlan, Error> {
    stepped::plan(job, inputs, &|_, _| {})
}
