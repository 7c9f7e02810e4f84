//! `terrace sweep`: a table to the terminal, as CSV and as a chart.

use std::path::Path;

#[cfg(feature = "fleet")]
use super::args::Engine;
use super::args::{Args, Choice, FleetArgs};
use super::progress::Steps;
use super::{STDIN, job_from_stdin, overrides, print, show, write_file};
#[cfg(feature = "fleet")]
use super::{carrier::Carrier, fleet::stop_on_ctrl_c};
#[cfg(feature = "fleet")]
use crate::batch::{of_sweep, work::End};
use crate::sweep::{self, JobText, Sweep};
use terrace_core::diag::{Diag, Error, Place};
use terrace_core::progress::Task;
use terrace_input::job::{Setting, read_file};
use terrace_report::job_folder;
use terrace_report::report::table::TERMINAL;

/// Plans all combinations and shows them; table and chart are written where files are named for them.
pub(super) fn run(
    args: &Args,
    job: &Path,
    choice: &Choice,
    settings: &[Setting],
    fleet: &FleetArgs,
    [csv, plot]: [Option<&Path>; 2],
) -> Result<(), Error> {
    // By value: built without engines the type is empty, and only behind a reference would need an arm.
    let engine = fleet.engine;
    let sweep = match engine {
        #[cfg(feature = "fleet")]
        Some(Engine::Dask) => carried(args, job, choice, settings, fleet)?,
        None => planned(args, job, choice, settings)?,
    };
    let table = sweep::table(&sweep);
    let mut files = Vec::new();
    if let Some(file) = csv {
        files.push((file, table.csv()));
    }
    if let Some(file) = plot {
        let name = job.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
        let chart = sweep::chart(&sweep, &name).ok_or_else(|| {
            let d = Diag::input("sweep-plot", "the values of the first setting are not numbers of one unit");
            d.at(Place::file(file.display().to_string())).hint("put a setting with numbers first")
        })?;
        files.push((file, chart.file()));
    }
    let inputs = job_folder::input_paths(&sweep.job);
    files.iter().try_for_each(|(file, text)| write_file(args, file, text.as_bytes(), &inputs))?;
    print(&if args.json { show::json(&serde_json::json!({ "sweep": table })) } else { table.text(TERMINAL) })
}

/// In this process.
fn planned(args: &Args, job: &Path, choice: &Choice, settings: &[Setting]) -> Result<Sweep, Error> {
    let (path, text) =
        if job == Path::new("-") { (Path::new(STDIN), job_from_stdin()?) } else { (job, read_file(job)?) };
    let steps = Steps::new(args.quiet);
    let count = sweep::combinations(settings)?;
    let task = Task::new(|percent| steps.show(&format!("planning {count} settings"), percent)).of_steps(count);
    let source = JobText { path, text: &text };
    let sweep = sweep::sweep(source, &overrides(args, choice), settings, &|| task.step())?;
    drop(task);
    steps.done();
    Ok(sweep)
}

/// By an engine.
#[cfg(feature = "fleet")]
fn carried(args: &Args, path: &Path, choice: &Choice, settings: &[Setting], fleet: &FleetArgs) -> Result<Sweep, Error> {
    if path == Path::new("-") {
        let d = Diag::input("engine-stdin", "a job from standard input cannot be read by other machines");
        return Err(d.hint("save it as a file in a folder that all machines share").into());
    }
    let text = read_file(path)?;
    let overrides = overrides(args, choice);
    let job = sweep::prepared(JobText { path, text: &text }, &overrides, settings)?;
    let list = of_sweep::plan(&job, &overrides, settings)?;
    let view = show::Progress::new(args.quiet, sweep::combinations(settings)?, "settings");
    let stop = stop_on_ctrl_c(&view, true);
    let around = path.parent().unwrap_or(Path::new(""));
    let carrier = Carrier { args, asked: fleet, around, keep: None, stop: &stop, view: &view };
    let ended = carrier.carry(&list, &mut |fragment| {
        if let End::Rows(rows) = &fragment.end {
            rows.iter().for_each(|_| view.step());
        }
    })?;
    view.finish();
    let rows = of_sweep::rows(&list, &ended.reports, &ended.reasons);
    Sweep::new(job, &text, &overrides, settings, rows)
}
