//! The work of one unit, in this process.
//!
//! Promises that it can be done again at any time, anywhere: a folder that is up to date is left alone, and one that
//! another process has in work is waited for.

use std::panic::AssertUnwindSafe;
use std::path::Path;
use std::sync::atomic::AtomicBool;

use serde::{Deserialize, Serialize};

use super::outcome::{Figures, Outcome, State};
use super::unit::{Combinations, Compile, Task, Unit, hash};
use crate::sweep::{self, JobText, Row};
use terrace_core::diag::{Diag, Error, Fault};
use terrace_input::job::{Job, read_file};
use terrace_plan::manifest::{self, InputFact};
use terrace_plan::plan;
use terrace_report::job_folder::{self, Durability, Writing};

/// Verifies a job folder; an error where it cannot be verified or breaks a rule.
pub type Verify<'a> = dyn Fn(&Path) -> Result<(), Error> + Sync + 'a;

/// How units are worked on.
#[derive(Clone, Copy)]
pub struct Settings<'a> {
    /// Whether folders are flushed to the disk.
    pub durability: Durability,
    /// Verifies the folder of a unit that asks for it.
    pub verify: &'a Verify<'a>,
    /// No unit begins once this is set.
    pub stop: &'a AtomicBool,
}

/// What a unit leaves.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum End {
    /// A job folder, or a reason why there is none.
    Job(Outcome),
    /// Rows of a sweep.
    Rows(Vec<Row>),
}

impl End {
    /// The end of a unit that could not be worked on.
    pub fn failed(unit: &Unit, fault: &Fault) -> Self {
        match &unit.task {
            Task::Compile(_) => Self::Job(Outcome::of(unit, State::Failed(fault.clone()))),
            Task::Sweep(some) => {
                Self::Rows(sweep::unplanned(&some.settings, some.first..some.first + some.count, fault))
            }
        }
    }

    /// The highest exit code of what it holds; a combination that cannot be planned is a row like others.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Job(outcome) => outcome.state.exit_code(),
            Self::Rows(_) => 0,
        }
    }
}

/// What the work of a unit came to.
#[derive(Clone, Debug)]
pub struct WorkResult {
    /// The hash of what the job and its inputs were then; that of the plan, unless files have changed since.
    pub hash: String,
    /// What became of it.
    pub end: End,
}

/// Does the work of a unit. A fault is its end, a panic too: other units are not concerned.
pub fn work(unit: &Unit, settings: &Settings<'_>) -> WorkResult {
    // A job that cannot be read has the hash that its unit was planned with.
    let job = Job::load(&unit.job, &unit.overrides);
    let inputs = job.as_ref().ok().and_then(|job| job_folder::inputs(job).ok());
    let now = hash(job.as_ref().ok(), &unit.task, &unit.overrides, inputs.as_deref().unwrap_or_default());
    // A panic is our own fault and is reported as such; the other units continue.
    let end = std::panic::catch_unwind(AssertUnwindSafe(|| match &unit.task {
        Task::Compile(compile) => {
            let ended = job.and_then(|job| compiled(job, inputs, compile, settings));
            let (state, verified) = ended.unwrap_or_else(|e| (State::Failed(Fault::from(&e)), false));
            End::Job(Outcome { verified, ..Outcome::of(unit, state) })
        }
        Task::Sweep(some) => End::Rows(rows(unit, some)),
    }));
    let broke = |_| End::failed(unit, &Diag::bug("panic", "an invariant of the program broke").into());
    WorkResult { hash: now, end: end.unwrap_or_else(broke) }
}

/// What became of a unit whose folder is up to date and need not be verified; None of others. Its files are as they
/// were when it was planned.
#[cfg(feature = "fleet")]
pub fn up_to_date(unit: &Unit) -> Option<WorkResult> {
    let Task::Compile(Compile { folder, verify: false, pictures }) = &unit.task else { return None };
    let job = Job::load(&unit.job, &unit.overrides).ok()?;
    let state = unchanged(&job, Some(unit.inputs.clone()), *pictures, folder)?;
    Some(WorkResult { hash: unit.hash.clone(), end: End::Job(Outcome::of(unit, state)) })
}

/// Brings a folder up to date, and says whether it was verified.
fn compiled(
    job: Job,
    inputs: Option<Vec<InputFact>>,
    compile: &Compile,
    settings: &Settings<'_>,
) -> Result<(State, bool), Error> {
    let &Compile { ref folder, verify, pictures } = compile;
    job_folder::prepare(folder, job.mode)?;
    let state = match unchanged(&job, inputs.clone(), pictures, folder) {
        Some(state) => state,
        None => {
            let _claim = job_folder::claim(folder)?;
            // Another process may have had it in work until now.
            match unchanged(&job, inputs, pictures, folder) {
                Some(state) => state,
                None => {
                    let plan = plan::plan(job, &|_, _| {})?;
                    let writing = Writing { durability: settings.durability, pictures };
                    job_folder::write_proved(&plan, folder, writing, &|_, _| {}, &|_| Ok(None))?;
                    State::Compiled(Figures::from(&plan.summary()))
                }
            }
        }
    };
    if verify {
        (settings.verify)(folder)?;
    }
    Ok((state, verify))
}

/// The state of a folder that is up to date.
fn unchanged(job: &Job, inputs: Option<Vec<InputFact>>, pictures: bool, folder: &Path) -> Option<State> {
    let is_unchanged = job_folder::is_unchanged(job, inputs?, pictures, folder);
    let found = is_unchanged.then(|| manifest::read(folder).ok()).flatten()?;
    Some(State::Unchanged(Figures::from(&found.summary)))
}

/// The rows of some combinations, the surface read once.
fn rows(unit: &Unit, some: &Combinations) -> Vec<Row> {
    let range = some.first..some.first + some.count;
    let planned = read_file(&unit.job).and_then(|text| {
        let source = JobText { path: &unit.job, text: &text };
        sweep::prepared(source, &unit.overrides, &some.settings)?;
        sweep::rows(source, &unit.overrides, &some.settings, range.clone(), &|| {})
    });
    planned.unwrap_or_else(|e| sweep::unplanned(&some.settings, range, &Fault::from(&e)))
}
