//! `terrace batch`: which of its steps is to be done, lines as jobs end, the files that it writes beside job folders,
//! and Ctrl-C.

use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};

#[cfg(feature = "fleet")]
use super::args::Engine;
use super::args::{Args, Batch};
#[cfg(feature = "fleet")]
use super::carrier::{self, Carrier};
use super::fleet::{settings, stop_on_ctrl_c};
use super::{durability, fleet, overrides, print, refuse_input, show, unwritable, write_file};
use crate::batch::collect::{Reasons, collect};
use crate::batch::{self, Outcome, Report, Unit, units};
use terrace_core::diag::{Error, Place};
use terrace_report::job_folder::Durability;

/// Runs the command, in whichever of its forms; returns the exit code.
pub fn run(args: &Args, asked: &Batch) -> Result<u8, Error> {
    if let (Some(file), Some(chosen)) = (&asked.units, &asked.unit) {
        return fleet::work(args, file, chosen, asked.fleet.memory);
    }
    if let Some(file) = &asked.collect {
        let units = units::read(file)?;
        let report = collect(&units, &units::reports(file), &Reasons::new());
        write_results(args, asked, &report, &inputs(&units, asked))?;
        return Ok(report.exit_code());
    }
    let list = batch::plan(
        &asked.jobs,
        asked.output.as_deref(),
        &overrides(args, &asked.choice),
        asked.verify,
        !asked.no_pictures,
    )?;
    let inputs = inputs(&list, asked);
    prepare_outputs(asked, &inputs)?;
    if let (Some(file), None) = (&asked.plan, asked.fleet.engine) {
        return fleet::plan(args, &list, file);
    }
    let mut log = asked.log.as_deref().map(|path| Log::open(path, durability(args))).transpose()?;
    let view = show::Progress::new(args.quiet, list.len(), "jobs");
    let stop = stop_on_ctrl_c(&view, asked.fleet.engine.is_some());
    let mut ended = 0;
    let mut on_outcome = |outcome: &Outcome| {
        ended += 1;
        view.job(outcome, [ended, list.len()]);
        log.iter_mut().for_each(|log| log.add(outcome));
    };
    // By value: built without engines the type is empty, and only behind a reference would need an arm.
    let engine = asked.fleet.engine;
    let report = match engine {
        #[cfg(feature = "fleet")]
        Some(Engine::Dask) => {
            let around = asked.output.clone().unwrap_or_default();
            let keep = asked.plan.as_deref();
            let carrier = Carrier { args, asked: &asked.fleet, around: &around, keep, stop: &stop, view: &view };
            carrier::batch(&carrier, &list, &mut on_outcome)?
        }
        None => batch::run(&list, &settings(args, &stop), &mut on_outcome),
    };
    view.finish();
    // Before the result is printed: where a file cannot be written, its error is the only JSON object.
    log.map_or(Ok(()), Log::close)?;
    write_results(args, asked, &report, &inputs)?;
    Ok(report.exit_code())
}

/// Makes the folders of the files that will be written, so that what cannot be written at the end of a night is found
/// before it begins.
fn prepare_outputs(asked: &Batch, inputs: &[PathBuf]) -> Result<(), Error> {
    for file in [&asked.report, &asked.log, &asked.index, &asked.plan].into_iter().flatten() {
        refuse_input(file, inputs)?;
        std::fs::create_dir_all(folder_of(file))
            .map_err(|e| unwritable("make the folder", Place::file(folder_of(file).display().to_string()), &e))?;
    }
    Ok(())
}

/// All files that are read, and those that name them.
fn inputs(units: &[Unit], asked: &Batch) -> Vec<PathBuf> {
    units.iter().flat_map(Unit::input_paths).chain(asked.jobs.iter().cloned()).collect()
}

/// Writes the report and the page to the files that were asked for, and prints the report.
fn write_results(args: &Args, asked: &Batch, report: &Report, inputs: &[PathBuf]) -> Result<(), Error> {
    let json = show::json(&report.to_json());
    // Both are tried: where the report cannot be written, the page may be.
    let report_written = asked.report.as_ref().map_or(Ok(()), |file| write_file(args, file, json.as_bytes(), inputs));
    let page_written = asked
        .index
        .as_ref()
        .map_or(Ok(()), |file| write_file(args, file, batch::index_html(report, folder_of(file))?.as_bytes(), inputs));
    report_written.and(page_written)?;
    print(&if args.json { json } else { report.to_string() })
}

/// The folder in which a file lies.
pub(super) fn folder_of(file: &Path) -> &Path {
    file.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// A file of JSON lines, one for each job that has ended.
struct Log {
    path: PathBuf,
    file: File,
    durability: Durability,
    /// What the first failure to write was. The batch continues: job folders matter more.
    failed: Option<std::io::Error>,
}

impl Log {
    fn open(path: &Path, durability: Durability) -> Result<Self, Error> {
        let file = File::options().create(true).append(true).open(path);
        let file = file.map_err(|e| unwritable("write the file", Place::file(path.display().to_string()), &e))?;
        Ok(Self { path: path.to_owned(), file, durability, failed: None })
    }

    /// Appends the line of a job.
    fn add(&mut self, outcome: &Outcome) {
        let line = format!("{}\n", outcome.to_json());
        let written = (&self.file).write_all(line.as_bytes()).and_then(|()| self.flush());
        self.failed = self.failed.take().or(written.err());
    }

    /// Waits for the disk, or does not.
    fn flush(&self) -> std::io::Result<()> {
        match self.durability {
            Durability::Synced => self.file.sync_data(),
            Durability::Unsynced => Ok(()),
        }
    }

    /// Says what could not be written.
    fn close(self) -> Result<(), Error> {
        let place = Place::file(self.path.display().to_string());
        self.failed.map_or(Ok(()), |e| Err(unwritable("write the file", place, &e)))
    }
}
