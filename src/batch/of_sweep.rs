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
    let all = sweep::combinations(settings)?;
    let hashes = Hashes::default();
    let count = all.div_ceil(all.div_ceil(UNITS_OF_A_SWEEP));
    let unit = |id: usize| {
        let (first, end) = (id * all / count, (id + 1) * all / count);
        let some = Combinations { settings: settings.to_vec(), first, count: end - first };
        Unit::new(id, &job.path, Task::Sweep(some), overrides, Some(job), &hashes)
    };
    Ok((0..count).map(unit).collect())
}

/// The rows of all units of a sweep, in the order of the combinations.
pub fn rows(units: &[Unit], reports: &Path, reasons: &Reasons) -> Vec<Row> {
    let of = |unit: &Unit| {
        let Task::Sweep(some) = &unit.task else { return Vec::new() };
        match fragment(unit, reports, reasons).map(|found| found.end) {
            Ok(End::Rows(rows)) => rows,
            Ok(End::Job(_)) => Vec::new(),
            Err(fault) => sweep::unplanned(&some.settings, some.first..some.first + some.count, &fault),
        }
    };
    units.iter().flat_map(of).collect()
}
