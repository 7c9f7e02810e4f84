//! A sweep as units for an engine: planned, and collected from the reports that they left.

use std::path::Path;

use super::collect::{Reasons, fragment};
use super::unit::{Combinations, Task, Unit};
use super::work::End;
use crate::sweep::{self, Row};
use terrace_core::diag::Error;
use terrace_input::job::{Job, Overrides, Setting};
use terrace_report::job_folder::Hashes;

/// Most units of a sweep. The surface is read once for a unit, so there are no more than keep a fleet busy.
const UNITS_OF_A_SWEEP: usize = 256;

/// The units of a sweep of a job, each some combinations that follow one another.
///
/// # Errors
/// `sweep-many`.
pub fn plan(job: &Job, overrides: &Overrides, settings: &[Setting]) -> Result<Vec<Unit>, Error> {
    let combinations = sweep::combinations(settings)?;
    let hashes = Hashes::default();
    let count = combinations.div_ceil(combinations.div_ceil(UNITS_OF_A_SWEEP));
    let units = (0..count).map(|id| {
        let first = id * combinations / count;
        let end = (id + 1) * combinations / count;
        let task = Task::Sweep(Combinations { settings: settings.to_vec(), first, count: end - first });
        Unit::new(id, &job.path, task, overrides, Some(job), &hashes)
    });
    Ok(units.collect())
}

/// The rows of all units of a sweep, in the order of the combinations.
pub fn rows(units: &[Unit], reports: &Path, reasons: &Reasons) -> Vec<Row> {
    units.iter().flat_map(|unit| rows_of_unit(unit, reports, reasons)).collect()
}

/// The rows of one unit; where it left none, rows that say why.
fn rows_of_unit(unit: &Unit, reports: &Path, reasons: &Reasons) -> Vec<Row> {
    let Task::Sweep(task) = &unit.task else { return Vec::new() };
    match fragment(unit, reports, reasons).map(|fragment| fragment.end) {
        Ok(End::Rows(rows)) => rows,
        Ok(End::Job(_)) => Vec::new(),
        Err(fault) => sweep::unplanned(&task.settings, task.first..task.first + task.count, &fault),
    }
}
