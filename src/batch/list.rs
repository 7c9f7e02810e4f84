//! The arguments of a batch, and the units that they stand for.

use std::path::{Path, PathBuf};

use super::unit::{Compile, Task, Unit};
use terrace_core::diag::{self, Diag, Error, Place};
use terrace_core::machine::Machine;
use terrace_core::parallel;
use terrace_input::job::{Job, Overrides, backslash};
use terrace_report::job_folder::{Hashes, default_output};

/// A job file that was listed.
struct JobEntry {
    path: PathBuf,
    folder: PathBuf,
    job: Result<Job, Error>,
}

/// The units of several arguments, each a folder (its `*.toml` by name, machine files left out), a list file (one
/// path a line, relative to it; `#` begins a comment), or one job file (`*.toml`). A job that is named twice is one.
///
/// # Errors
/// Where an argument cannot be read, nothing is listed, or two jobs would write one folder. A job that is faulty is
/// no error: its unit fails.
pub fn plan(
    paths: &[PathBuf],
    output: Option<&Path>,
    overrides: &Overrides,
    is_verified: bool,
    is_drawn: bool,
) -> Result<Vec<Unit>, Error> {
    let jobs = jobs(paths, output, overrides)?;
    let hashes = Hashes::default();
    Ok(parallel::map(jobs.len(), |id| {
        let JobEntry { path, folder, job } = &jobs[id];
        let task = Task::Compile(Compile { folder: folder.clone(), verify: is_verified, pictures: is_drawn });
        Unit::new(id, path, task, overrides, job.as_ref().ok(), &hashes)
    }))
}

/// The jobs of several arguments.
fn jobs(paths: &[PathBuf], output: Option<&Path>, overrides: &Overrides) -> Result<Vec<JobEntry>, Error> {
    let mut entries: Vec<JobEntry> = Vec::new();
    for path in paths {
        let is_folder = path.is_dir();
        let listed = listed(path)?.into_iter().filter_map(|file| entry(file, is_folder, output, overrides));
        let before = entries.len();
        let mut found = false;
        for new in listed {
            found = true;
            if !entries.iter().any(|known| known.path == new.path) {
                entries.push(new);
            }
        }
        if !found {
            let d = Diag::input("batch-empty", "there is no job").at(Place::file(path.display().to_string()));
            return Err(d.hint("a folder needs *.toml files, a list one job file per line").into());
        }
        for (i, e) in entries.iter().enumerate().skip(before) {
            if let Some(other) = entries[..i].iter().find(|o| o.folder == e.folder) {
                let [one, two, folder] = [&other.path, &e.path, &e.folder].map(|p| p.display());
                let d = Diag::input("batch-clash", format!("{one} and {two} would both write {folder}"));
                let d = d.at(Place::file(path.display().to_string()));
                return Err(d.hint("give the job files different names").into());
            }
        }
    }
    Ok(entries)
}

/// The files that one argument stands for.
fn listed(path: &Path) -> Result<Vec<PathBuf>, Error> {
    let place = || Place::file(path.display().to_string());
    let unreadable =
        |e: std::io::Error| Diag::input("batch-unreadable", format!("cannot read the folder or list: {e}")).at(place());
    let is_toml = |file: &Path| file.extension().is_some_and(|e| e == "toml");
    if is_toml(path) && !path.is_dir() {
        return Ok(vec![path.to_owned()]);
    }
    let mut files = Vec::new();
    if path.is_dir() {
        for entry in std::fs::read_dir(path).map_err(unreadable)? {
            let file = entry.map_err(unreadable)?.path();
            if is_toml(&file) && file.is_file() {
                files.push(file);
            }
        }
        files.sort();
    } else {
        let text = diag::utf8(diag::read_file(path, 16 << 20)?)
            .map_err(|e| e.at(Diag::input("batch-utf8", format!("the list is {e}")), path.display().to_string()))?;
        let base = path.parent().unwrap_or(Path::new(""));
        for (line, number) in text.lines().zip(1..) {
            let file = line.split('#').next().unwrap_or("").trim();
            if let Some(fault) = backslash(Path::new(file), &base.join(file)) {
                return Err(fault.at(Place::line(path.display().to_string(), number)).into());
            }
            if !file.is_empty() {
                files.push(base.join(file));
            }
        }
    }
    Ok(files)
}

/// The job of a file; None of a machine file in a folder of jobs.
fn entry(path: PathBuf, is_folder: bool, output: Option<&Path>, overrides: &Overrides) -> Option<JobEntry> {
    let job = Job::load(&path, overrides);
    // Machine files often lie next to the jobs that name them.
    if is_folder && job.is_err() && Machine::load(&path).is_ok() {
        return None;
    }
    let mode = job.as_ref().map_or(overrides.mode.unwrap_or_default(), |job| job.mode);
    let beside = default_output(&path, mode);
    let folder = match (output, beside.file_name()) {
        (Some(o), Some(name)) => o.join(name),
        _ => beside,
    };
    Some(JobEntry { path, folder, job })
}
