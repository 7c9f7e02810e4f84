//! The job folder: what it holds, and that it is written whole or not at all.
//!
//! Files are written into a hidden folder beside the target, the manifest last; when all are there the
//! folder takes the target's name (`target`). A job folder belongs to the program: replacing it removes
//! everything in it.

mod files;
mod target;

use std::fs;
use std::path::{Path, PathBuf};

use files::Fill;
pub use files::layout_svg;

use crate::diag::{Diag, Error, Place};
use crate::job::{Job, Mode};
use crate::manifest::{FileFact, Head, InputFact};
use crate::plan::{OnTheFlyPlan, Plan, SteppedPlan};
use target::{Target, resolved};

fn place(path: &Path) -> Place {
    Place::file(path.display().to_string())
}

fn failed(what: &str, path: &Path, e: &std::io::Error) -> Error {
    Diag::input("output-unwritable", format!("cannot {what}: {e}"))
        .at(place(path))
        .hint("check path, space and permissions")
        .into()
}

/// Finishes or undoes what a stopped run left beside `target`, and makes sure that a folder may be
/// written there, before time is spent on a plan.
///
/// # Errors
/// `output-not-a-job` where `target` exists and is not a job folder; `output-other-mode` where it is one of the other
/// mode; what the file system refuses.
pub fn prepare(target: &Path, mode: Mode) -> Result<(), Error> {
    let target = Target::find(target)?;
    target.recover()?;
    target.may_be_replaced(mode, &[])
}

/// Writes the folder of a plan and puts it in the place of `target`. A run that writes there already is
/// waited for.
///
/// # Errors
/// As [`prepare`]; `output-holds-input` where the folder to be replaced holds an input of the job.
/// Whatever fails, an older folder stands as it was.
pub fn write(plan: &Plan, target: &Path) -> Result<(), Error> {
    match plan {
        Plan::Stepped(plan) => write_stepped(plan, target),
        Plan::OnTheFly(plan) => write_on_the_fly(plan, target),
    }
}

pub(crate) fn write_stepped(plan: &SteppedPlan, target: &Path) -> Result<(), Error> {
    exchange(&plan.job, target, &|filling, head| files::stepped(plan, head, filling))
}

pub(crate) fn write_on_the_fly(plan: &OnTheFlyPlan, target: &Path) -> Result<(), Error> {
    exchange(&plan.job, target, &|filling, head| files::on_the_fly(plan, head, filling))
}

/// Lets `fill` make a folder, whose manifest it answers with, and puts it in the place of `target`.
fn exchange(job: &Job, target: &Path, fill: &Fill<'_>) -> Result<(), Error> {
    let target = Target::find(target)?;
    let parent = target.path.parent().unwrap_or(Path::new("/"));
    fs::create_dir_all(parent).map_err(|e| failed("make the folder", parent, &e))?;
    let lock = target.lock()?;
    target.tidy(&lock)?;
    target.may_be_replaced(job.mode, &input_paths(job))?;
    let done = files::fill(job, &target.new, &target.path, fill).and_then(|()| target.exchange(&lock));
    if done.is_err() {
        // What cannot be removed now, the next run removes.
        let _ = fs::remove_dir_all(&target.new);
    }
    done
}

/// Every input file of a job but the job file itself, with its hash.
///
/// # Errors
/// Where a file cannot be read.
pub fn inputs(job: &Job) -> Result<Vec<InputFact>, Error> {
    let mut list = job.input_files();
    list.dedup();
    list.into_iter()
        .map(|(role, file)| {
            let path = job.relative(file);
            let mut hasher = blake3::Hasher::new();
            let unreadable =
                |e| Error::from(Diag::input("file-unreadable", format!("cannot read the file: {e}")).at(place(&path)));
            let opened = fs::File::open(&path).map_err(unreadable)?;
            hasher.update_reader(opened).map_err(unreadable)?;
            let bytes = hasher.count();
            let shown = file.to_string_lossy().replace('\\', "/");
            Ok(InputFact { role: role.into(), file: shown, bytes, blake3: hasher.finalize().to_hex().to_string() })
        })
        .collect()
}

/// The job file and every other input file of a job, as they can be opened.
pub fn input_paths(job: &Job) -> Vec<PathBuf> {
    let named = job.input_files().into_iter().map(|(_, file)| job.relative(file));
    std::iter::once(job.path.clone()).chain(named).collect()
}

/// Whether the folder was made from exactly this job by this program, and is whole.
pub fn is_unchanged(job: &Job, folder: &Path) -> bool {
    let made = || {
        let found = Head::read(folder).ok()?;
        let wanted = Head::new(job, job_file_from(&job.path, folder).ok()?, inputs(job).ok()?);
        let is_there = |f: &FileFact| fs::metadata(folder.join(&f.file)).is_ok_and(|m| m.len() == f.bytes);
        Some(found.is_same(&wanted) && found.files.iter().all(is_there))
    };
    made().unwrap_or(false)
}

/// The job file as seen from inside the folder at `target`, which need not exist yet.
///
/// # Errors
/// Where a folder on the way cannot be read.
pub fn job_file_from(job: &Path, target: &Path) -> Result<String, Error> {
    let real = |p: &Path| resolved(p).map_err(|e| failed("find the folder", p, &e));
    let from = real(target)?;
    // The job file may be a link: its inputs are relative to where it is named, not to where it leads.
    let folder = job.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let file = real(folder)?.join(job.file_name().unwrap_or_default());
    let common = file.components().zip(from.components()).take_while(|(a, b)| a == b).count();
    let mut out = vec!["..".to_owned(); from.components().count() - common];
    out.extend(file.components().skip(common).map(|c| c.as_os_str().to_string_lossy().into_owned()));
    Ok(out.join("/"))
}
