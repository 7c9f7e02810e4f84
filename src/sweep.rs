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

use terrace_core::diag::{Diag, Error, Fault, Place, Severity};
use terrace_core::parallel;
use terrace_input::job::{Job, KeyValue, Keys, Mode, Overrides, Setting, near_keys};
use terrace_input::surface::Surface;
use terrace_plan::manifest::Summary;
use terrace_plan::plan::{self, Inputs};
use terrace_report::report::plot::{Axis, LineChart, Panel, Plot, Series};
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

/// Plans the job of `text`, which lies or would lie at `path`, with every combination of the settings' values.
/// `done` is called after each.
///
/// # Errors
/// As [`prepared`]; the first fault where no combination can be planned.
pub fn sweep(
    (path, text): (&Path, &str),
    overrides: &Overrides,
    settings: &[Setting],
    done: &(dyn Fn() + Sync),
) -> Result<Sweep, Error> {
    let job = prepared((path, text), overrides, settings)?;
    let count = combinations(settings)?;
    let found = rows((path, text), overrides, settings, 0..count, done)?;
    Sweep::of((job, text), overrides, settings, found)
}

/// The job as its file has it, if it can be swept.
///
/// # Errors
/// Faults of the job file as it is; `sweep-key` where a setting names no place in it; `sweep-many`; `sweep-mode`.
pub fn prepared((path, text): (&Path, &str), overrides: &Overrides, settings: &[Setting]) -> Result<Job, Error> {
    let job = Job::parse(path, text, overrides)?;
    if job.mode != Mode::Stepped {
        let text = "a sweep compares stepped jobs";
        return Err(Diag::input("sweep-mode", text).at(job.place_of("mode")).hint("add --mode stepped").into());
    }
    combinations(settings)?;
    edited((path, text), settings, 0)?;
    Ok(job)
}

impl Sweep {
    /// The sweep of a job, with a row for every combination.
    ///
    /// # Errors
    /// The first fault where no combination can be planned.
    pub fn of(
        (job, text): (Job, &str),
        overrides: &Overrides,
        settings: &[Setting],
        rows: Vec<Row>,
    ) -> Result<Self, Error> {
        if rows.iter().all(|row| row.summary.is_err()) {
            // A fault holds what is shown of an error; the error itself is found again.
            let (_, edited) = edited((&job.path, text), settings, 0)?;
            planned((&job.path, &edited), overrides, &OnceLock::new())?;
        }
        Ok(Self { keys: settings.iter().map(|s| s.key.clone()).collect(), rows, job })
    }
}

/// The values of a combination.
fn values(settings: &[Setting], number: usize) -> Vec<KeyValue> {
    let (mut rest, mut values) = (number, Vec::new());
    for setting in settings.iter().rev() {
        values.push(setting.values[rest % setting.values.len()].clone());
        rest /= setting.values.len();
    }
    values.reverse();
    values
}

/// The values of a combination, and the job's text with its keys so set.
fn edited((path, text): (&Path, &str), settings: &[Setting], number: usize) -> Result<(Vec<KeyValue>, String), Error> {
    let mut keys = Keys::of(text).expect("a job was read from this text");
    let values = values(settings, number);
    for (setting, value) in settings.iter().zip(&values) {
        keys.set(&setting.key, value).map_err(|what| {
            let d = Diag::input("sweep-key", format!("{} cannot be set: {what}", setting.key));
            let hint = match near_keys(&setting.key).as_slice() {
                [] => "name a key with its table as docs/job-file.md does, such as focus.pdof".to_owned(),
                near => format!("did you mean {}?", near.join(" or ")),
            };
            d.at(Place::file(path.display().to_string())).hint(hint)
        })?;
    }
    Ok((values, keys.text()))
}

/// The rows of some combinations of a job that was [`prepared`]; the surface is read once for all of them.
///
/// # Errors
/// `sweep-key`.
pub fn rows(
    (path, text): (&Path, &str),
    overrides: &Overrides,
    settings: &[Setting],
    some: Range<usize>,
    done: &(dyn Fn() + Sync),
) -> Result<Vec<Row>, Error> {
    let texts = some.map(|number| edited((path, text), settings, number)).collect::<Result<Vec<_>, _>>()?;
    let shared = OnceLock::new();
    let one = |i: usize| {
        let (values, text): &(Vec<KeyValue>, String) = &texts[i];
        let summary = planned((path, text), overrides, &shared).map_err(|e| Fault::from(&e));
        done();
        Row { values: values.clone(), summary }
    };
    // One after another until one has read the surface for the others.
    let mut found = Vec::with_capacity(texts.len());
    while shared.get().is_none() && found.len() < texts.len() {
        found.push(one(found.len()));
    }
    let first = found.len();
    found.extend(parallel::map(texts.len() - first, |i| one(first + i)));
    Ok(found)
}

/// Rows of combinations that could not be planned.
pub fn unplanned(settings: &[Setting], some: Range<usize>, fault: &Fault) -> Vec<Row> {
    some.map(|number| Row { values: values(settings, number), summary: Err(fault.clone()) }).collect()
}

/// The figures of one job; the surface that the first has read is shared where it can be.
fn planned(
    (path, text): (&Path, &str),
    overrides: &Overrides,
    shared: &OnceLock<(Job, Arc<Surface>)>,
) -> Result<Summary, Error> {
    let plan = || {
        let job = Job::parse(path, text, overrides)?;
        let inputs = Inputs::load_beside(&job, shared.get().map(|(of, surface)| (of, surface)))?;
        if shared.get().is_none() {
            drop(shared.set((job.clone(), Arc::clone(&inputs.surface))));
        }
        Ok(plan::stepped(job, inputs)?.summary)
    };
    // Lines and columns are those of the text with its keys set, which nobody has.
    let whole = |d: &Diag| match &d.place {
        Place::Text { path, .. } | Place::File { path, .. } => d.clone().at(Place::file(path.clone())),
        _ => d.clone(),
    };
    plan().map_err(|e: Error| Error::many(e.diags().iter().map(whole).collect()))
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

/// Stops and times over the first setting, a line for every combination of the others; None where it has no numbers.
pub fn chart(sweep: &Sweep) -> Option<Plot> {
    let key = sweep.keys.first()?;
    let number = |v: &KeyValue| {
        let text = v.to_string();
        let end = text.find(|c: char| !(c.is_ascii_digit() || matches!(c, '.' | '-'))).unwrap_or(text.len());
        text[..end].parse::<f64>().ok().map(|n| (n, text[end..].trim().to_owned()))
    };
    let xs: Option<Vec<(f64, String)>> = sweep.rows.iter().map(|r| number(&r.values[0])).collect();
    let xs = xs?;
    let unit = xs.first()?.1.clone();
    if xs.iter().any(|x| x.1 != unit) {
        return None;
    }
    let mut names: Vec<String> = Vec::new();
    let name = |row: &Row| row.values[1..].iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
    sweep.rows.iter().for_each(|row| {
        if !names.contains(&name(row)) {
            names.push(name(row));
        }
    });
    let panel = |y: Axis, of: fn(&Summary) -> f64| {
        let series = names.iter().map(|of_name| {
            let mine = sweep.rows.iter().zip(&xs).filter(|(row, _)| name(row) == *of_name);
            let points = mine.map(|(row, x)| [x.0, row.summary.as_ref().map_or(f64::NAN, of)]);
            Series::new(of_name, points.collect()).marked()
        });
        Panel { y, series: series.collect(), limits: Vec::new() }
    };
    let panels = vec![
        panel(Axis::new("stops", ""), |s| s.stops as f64),
        panel(Axis::new("machine time", "min"), |s| s.time_s.total / 60.0),
        panel(Axis::new("with loading", "min"), |s| s.loading.total_s / 60.0),
    ];
    Some(LineChart { title: format!("Sweep of {key}"), x: Axis::new(key, &unit), panels, limits: Vec::new() }.draw())
}
