//! One job with some keys set to many values, planned side by side: what each setting costs in stops, time, fragments
//! and seams.
//!
//! Consumes the text of a job file and settings; promises a row for every combination of their values, in the order in
//! which they are given, the last setting changing first. The surface file is read once for all combinations that read
//! and turn it alike. Nothing is written. A combination that cannot be planned says why in its row.

use std::ops::Range;
use std::path::Path;
use std::sync::{Arc, OnceLock};

use serde::{Deserialize, Serialize};

use terrace_core::diag::{Diag, Error, Fault, Kind, Place, Severity};
use terrace_core::parallel;
use terrace_input::job::{Job, KeyValue, Keys, Mode, Overrides, Setting, near_keys};
use terrace_input::surface::Surface;
use terrace_plan::manifest::Summary;
use terrace_plan::plan::{self, Inputs};
use terrace_report::report::plot::{Axis, LineChart, Panel, Plot, Series, time_unit};
use terrace_report::report::table::{Cell, Column, Table};

/// Most combinations of one sweep.
const MOST: usize = 10_000;

/// One combination of values.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// The value of every setting.
    pub values: Vec<KeyValue>,
    /// The figures of the job so set, or why it cannot be planned.
    pub summary: Result<Summary, Fault>,
}

/// A whole sweep.
#[derive(Clone, Debug)]
pub struct Sweep {
    /// The keys that were set.
    pub keys: Vec<String>,
    /// A row for every combination.
    pub rows: Vec<Row>,
    /// The job as its file has it.
    pub job: Job,
}

/// The text of a job file, and where it lies or would lie.
#[derive(Clone, Copy, Debug)]
pub struct JobText<'a> {
    /// The job file; it need not be there.
    pub path: &'a Path,
    /// What it holds.
    pub text: &'a str,
}

/// How many combinations the settings have.
///
/// # Errors
/// `sweep-many`.
pub fn combinations(settings: &[Setting]) -> Result<usize, Error> {
    let count = settings.iter().try_fold(1usize, |n, s| n.checked_mul(s.values.len()).filter(|&n| n <= MOST));
    count.ok_or_else(|| {
        let text = format!("the settings have more than {MOST} combinations");
        Diag::input("sweep-many", text).hint("give fewer values").into()
    })
}

/// Plans a job with every combination of the settings' values. `done` is called after each.
///
/// # Errors
/// Those of [`prepared`]; the first fault where no combination can be planned.
pub fn sweep(
    source: JobText<'_>,
    overrides: &Overrides,
    settings: &[Setting],
    done: &(dyn Fn() + Sync),
) -> Result<Sweep, Error> {
    let job = prepared(source, overrides, settings)?;
    let count = combinations(settings)?;
    let rows = rows(source, overrides, settings, 0..count, done)?;
    Sweep::new(job, source.text, overrides, settings, rows)
}

/// The job as its file has it, if it can be swept.
///
/// # Errors
/// Faults of the job file as it is; `sweep-key` where a setting names no place in it; `sweep-many`; `sweep-mode`.
pub fn prepared(source: JobText<'_>, overrides: &Overrides, settings: &[Setting]) -> Result<Job, Error> {
    let job = Job::parse(source.path, source.text, overrides)?;
    if job.mode != Mode::Stepped {
        let text = "a sweep compares stepped jobs";
        return Err(Diag::input("sweep-mode", text).at(job.place_of("mode")).hint("add --mode stepped").into());
    }
    combinations(settings)?;
    edited(source, settings, 0)?;
    Ok(job)
}

impl Sweep {
    /// The sweep of a job that was read from `text`, with a row for every combination.
    ///
    /// # Errors
    /// The first fault where no combination can be planned.
    pub fn new(
        job: Job,
        text: &str,
        overrides: &Overrides,
        settings: &[Setting],
        rows: Vec<Row>,
    ) -> Result<Self, Error> {
        if rows.iter().all(|row| row.summary.is_err()) {
            // A fault holds what is shown of an error; the error itself is found again.
            let first = edited(JobText { path: &job.path, text }, settings, 0)?;
            planned(JobText { path: &job.path, text: &first.text }, overrides, &SharedSurface::new())
                .map_err(|e| with_values(&e, settings, &first.values))?;
        }
        Ok(Self { keys: settings.iter().map(|s| s.key.clone()).collect(), rows, job })
    }
}

/// The error of a combination, with its values: no line of the job file has them.
fn with_values(e: &Error, settings: &[Setting], values: &[KeyValue]) -> Error {
    let set: Vec<String> = settings.iter().zip(values).map(|(s, value)| format!("{} = {value}", s.key)).collect();
    let named = |d: &Diag| Diag { message: format!("with {}: {}", set.join(", "), d.message), ..d.clone() };
    Error::many(e.diags().iter().map(|d| if d.kind == Kind::Warning { d.clone() } else { named(d) }).collect())
}

/// The values of a combination.
fn values(settings: &[Setting], number: usize) -> Vec<KeyValue> {
    // The number in a system whose digits are the values; the last setting is the least significant.
    let mut rest = number;
    let mut values = Vec::new();
    for setting in settings.iter().rev() {
        values.push(setting.values[rest % setting.values.len()].clone());
        rest /= setting.values.len();
    }
    values.reverse();
    values
}

/// A job with the values of a combination.
struct Edited {
    values: Vec<KeyValue>,
    /// The text of the job file with its keys so set.
    text: String,
}

/// The surface that the first combination has read, and the job that it was read for.
type SharedSurface = OnceLock<(Job, Arc<Surface>)>;

/// The job with the values of combination `number`.
fn edited(source: JobText<'_>, settings: &[Setting], number: usize) -> Result<Edited, Error> {
    let mut keys = Keys::of(source.text).expect("a job was read from this text");
    let values = values(settings, number);
    for (setting, value) in settings.iter().zip(&values) {
        keys.set(&setting.key, value).map_err(|what| {
            let d = Diag::input("sweep-key", format!("{} cannot be set: {what}", setting.key));
            let hint = match near_keys(&setting.key).as_slice() {
                [] => "name a key with its table as docs/reference/job-file.md does, such as focus.pdof".to_owned(),
                near => format!("did you mean {}?", near.join(" or ")),
            };
            d.at(Place::file(source.path.display().to_string())).hint(hint)
        })?;
    }
    Ok(Edited { values, text: keys.text() })
}

/// The rows of some combinations of a job that was [`prepared`]; the surface is read once for all of them.
///
/// # Errors
/// `sweep-key`.
pub fn rows(
    source: JobText<'_>,
    overrides: &Overrides,
    settings: &[Setting],
    numbers: Range<usize>,
    done: &(dyn Fn() + Sync),
) -> Result<Vec<Row>, Error> {
    let jobs = numbers.map(|number| edited(source, settings, number)).collect::<Result<Vec<Edited>, _>>()?;
    let shared = SharedSurface::new();
    let row_of = |i: usize| {
        let row = row(source.path, &jobs[i], overrides, &shared);
        done();
        row
    };
    // One after another until one has read the surface for the others.
    let mut rows = Vec::with_capacity(jobs.len());
    while shared.get().is_none() && rows.len() < jobs.len() {
        rows.push(row_of(rows.len()));
    }
    let first = rows.len();
    rows.extend(parallel::map(jobs.len() - first, |i| row_of(first + i)));
    Ok(rows)
}

/// The row of one combination of a job at `path`.
fn row(path: &Path, job: &Edited, overrides: &Overrides, shared: &SharedSurface) -> Row {
    let planned = planned(JobText { path, text: &job.text }, overrides, shared);
    Row { values: job.values.clone(), summary: planned.map_err(|e| Fault::from(&e)) }
}

/// Rows of combinations that could not be planned.
pub fn unplanned(settings: &[Setting], numbers: Range<usize>, fault: &Fault) -> Vec<Row> {
    numbers.map(|number| Row { values: values(settings, number), summary: Err(fault.clone()) }).collect()
}

/// The figures of one job. Its errors are placed in the file as a whole: lines and columns are those of the text with
/// its keys set, which nobody has.
fn planned(source: JobText<'_>, overrides: &Overrides, shared: &SharedSurface) -> Result<Summary, Error> {
    let without_line = |d: &Diag| match &d.place {
        Place::Text { path, .. } | Place::File { path, .. } => d.clone().at(Place::file(path.clone())),
        _ => d.clone(),
    };
    plan_sharing(source, overrides, shared).map_err(|e| Error::many(e.diags().iter().map(without_line).collect()))
}

/// Plans one job, with the surface that another has read where that can be.
fn plan_sharing(source: JobText<'_>, overrides: &Overrides, shared: &SharedSurface) -> Result<Summary, Error> {
    let job = Job::parse(source.path, source.text, overrides)?;
    let inputs = Inputs::load_beside(&job, shared.get().map(|(reader, surface)| (reader, surface)))?;
    if shared.get().is_none() {
        // Another may have been first: then its surface is the shared one.
        drop(shared.set((job.clone(), Arc::clone(inputs.designed()))));
    }
    Ok(plan::stepped(job, inputs)?.summary)
}

/// The rows as a table. The note has the codes of warnings, or why the row cannot be planned.
pub fn table(sweep: &Sweep) -> Table {
    let mut columns: Vec<Column> = sweep.keys.iter().map(|key| Column::text(key)).collect();
    columns.extend([
        Column::text("method"),
        Column::count("stops"),
        Column::count("blocks"),
        Column::time("machine time"),
        Column::time("with loading"),
        Column::count("fragments"),
        Column::number("seam", "mm", 0),
        Column::number("worst incidence", "deg", 2),
        Column::number("worst defocus", "um", 1),
        Column::text("note"),
    ]);
    let mut table = Table::new("Sweep", columns);
    for row in &sweep.rows {
        let mut cells: Vec<Cell> = row.values.iter().map(|v| v.to_string().as_str().into()).collect();
        match &row.summary {
            Ok(s) => {
                cells.push(s.method.as_str().into());
                cells.extend([s.stops.into(), s.blocks.into(), s.time_s.total.into(), s.loading.total_s.into()]);
                cells.extend([s.fragments.into(), s.seam_mm.into(), s.worst_incidence_deg.into()]);
                let warnings: Vec<&str> = s.warnings.iter().map(|w| w.code.as_str()).collect();
                cells.extend([s.worst_defocus_um.into(), warnings.join(", ").into()]);
            }
            Err(e) => {
                cells.push("-".into());
                cells.extend((0..8).map(|_| Cell::from(None::<f64>)));
                let why = e.failure.errors.iter().find(|m| m.severity != Severity::Warning).map(|m| m.message.as_str());
                cells.push(why.unwrap_or("cannot be planned").into());
            }
        }
        table.push(cells);
    }
    table
}

/// Stops and times of the job of a name over the first setting, a line for every combination of the others; None where
/// it has no numbers.
pub fn chart(sweep: &Sweep, job: &str) -> Option<Plot> {
    let key = sweep.keys.first()?;
    let xs: Vec<(f64, String)> = sweep.rows.iter().map(|r| number_and_unit(&r.values[0])).collect::<Option<_>>()?;
    let unit = xs.first()?.1.clone();
    if xs.iter().any(|x| x.1 != unit) {
        return None;
    }
    let mut names: Vec<String> = Vec::new();
    for name in sweep.rows.iter().map(other_values) {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    let panel = |y: Axis, figure: &dyn Fn(&Summary) -> f64| {
        let series = names.iter().map(|name| {
            let own = sweep.rows.iter().zip(&xs).filter(|(row, _)| other_values(row) == *name);
            let points = own.map(|(row, x)| [x.0, row.summary.as_ref().map_or(f64::NAN, figure)]);
            Series::new(name, points.collect()).marked()
        });
        Panel { y, series: series.collect(), limits: Vec::new() }
    };
    let summaries = || sweep.rows.iter().filter_map(|row| row.summary.as_ref().ok());
    let (unit_of_time, s_per_unit) = time_unit(summaries().map(|s| s.loading.total_s).fold(0.0, f64::max));
    let mut panels = vec![
        panel(Axis::new("stops", ""), &|s| s.stops as f64),
        panel(Axis::new("machine time", unit_of_time), &|s| s.time_s.total / s_per_unit),
    ];
    if summaries().any(|s| s.loading.total_s > s.time_s.total) {
        panels.push(panel(Axis::new("with loading", unit_of_time), &|s| s.loading.total_s / s_per_unit));
    }
    Some(
        LineChart { title: format!("{job}: sweep of {key}"), x: Axis::new(key, &unit), panels, limits: Vec::new() }
            .draw(),
    )
}

/// The number with which a value begins, and what follows it; None where it begins with something else.
fn number_and_unit(v: &KeyValue) -> Option<(f64, String)> {
    let text = v.to_string();
    let end = text.find(|c: char| !(c.is_ascii_digit() || matches!(c, '.' | '-'))).unwrap_or(text.len());
    text[..end].parse::<f64>().ok().map(|n| (n, text[end..].trim().to_owned()))
}

/// The values of a row beside the first, as the name of a line.
fn other_values(row: &Row) -> String {
    row.values[1..].iter().map(ToString::to_string).collect::<Vec<_>>().join(", ")
}
