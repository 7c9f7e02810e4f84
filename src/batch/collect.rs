//! One report of what became of all units, from the reports that they left.

use std::collections::BTreeMap;
use std::path::Path;

use super::fragment::Fragment;
use super::outcome::{Outcome, State};
use super::report::Report;
use super::unit::{Compile, Task, Unit};
use super::work::End;
use terrace_core::diag::{Diag, Fault, Place};
use terrace_input::job::Job;
use terrace_report::job_folder;

/// Why units left no report, where an engine knows.
pub type Reasons = BTreeMap<usize, String>;

/// What became of all units of a batch. A unit that left no report is missing, and so is one whose report is of other
/// inputs than were planned, or whose folder is not here.
pub fn collect(units: &[Unit], reports: &Path, reasons: &Reasons) -> Report {
    Report(units.iter().map(|unit| outcome(unit, reports, reasons)).collect())
}

fn outcome(unit: &Unit, reports: &Path, reasons: &Reasons) -> Outcome {
    let ended = fragment(unit, reports, reasons).and_then(|found| match found.end {
        End::Job(outcome) if outcome.state.figures().is_none() || is_here(unit) => Ok(outcome),
        End::Job(_) => {
            let text = format!("the job was compiled on {}, and its folder is not here or not whole", found.host);
            let hint = "copy the folder here, or let all machines write to one shared folder";
            Err(Fault::from(missing(unit, text).hint(hint)))
        }
        End::Rows(_) => Err(Fault::from(missing(unit, "its report is that of a sweep".into()))),
    });
    ended.unwrap_or_else(|fault| Outcome::of(unit, State::Missing(fault)))
}

/// The report of a unit, of the inputs that were planned.
pub(super) fn fragment(unit: &Unit, reports: &Path, reasons: &Reasons) -> Result<Fragment, Fault> {
    match Fragment::read(reports, unit.id) {
        Some(found) if found.hash == unit.hash => Ok(found),
        Some(_) => {
            Err(missing(unit, "its job file or an input has changed since the units were planned".into()).into())
        }
        None => {
            let why = reasons.get(&unit.id).map_or_else(|| "it left no report".into(), Clone::clone);
            Err(missing(unit, why).into())
        }
    }
}

/// The fault of a unit that left no report of what it is now.
fn missing(unit: &Unit, why: String) -> Diag {
    let d = Diag::limit("unit-missing", format!("unit {} is missing: {why}", unit.id));
    d.at(Place::file(unit.job.display().to_string())).hint("run the same command again: what is there is kept")
}

/// Whether the folder of a unit is here, made from these inputs, and whole.
fn is_here(unit: &Unit) -> bool {
    let Ok(job) = Job::load(&unit.job, &unit.overrides) else { return false };
    let has_pictures = matches!(&unit.task, Task::Compile(Compile { pictures: true, .. }));
    job_folder::is_unchanged(&job, unit.inputs.clone(), has_pictures, unit.folder())
}
