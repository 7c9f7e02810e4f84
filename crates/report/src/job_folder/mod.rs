//! The job folder: what it holds, and that it is written whole or not at all.
//!
//! Files are written into a hidden folder next to the target, the manifest last; when all are there the folder takes
//! the target's name (`exchange`). A job folder belongs to the program: replacing it removes everything in it.

mod default_output;
mod exchange;
mod files;
mod flush;
mod inputs;
mod pictures;
mod temporary;

use std::fs;
use std::path::{Path, PathBuf};

pub use default_output::default_output;
use files::Fill;
pub use files::{Filling, Programs};
pub use flush::Durability;
use flush::{Flush, make_all};
pub use inputs::{Hashes, inputs};
pub use pictures::Pictures;

use exchange::{Lock, Target, resolved};
use terrace_core::diag::{Diag, Error, Place};
use terrace_input::job::{Job, Mode};
use terrace_plan::manifest::{FileFact, Head, InputFact, MANIFEST};
#[cfg(any(test, feature = "test-support"))]
use terrace_plan::plan::{OnTheFlyPlan, SteppedPlan};
use terrace_plan::plan::{Plan, Progress};

fn place(path: &Path) -> Place {
    Place::file(path.display().to_string())
}

fn failed(what: &str, path: &Path, e: &std::io::Error) -> Error {
    Diag::input("output-unwritable", format!("cannot {what}: {e}"))
        .at(place(path))
        .hint("check path, space and permissions")
        .into()
}

/// Finishes or undoes what a stopped run left next to `target`, and makes sure that a folder may be written there,
/// before time is spent on a plan.
///
/// # Errors
/// `output-not-a-job` where `target` exists and is not a job folder; `output-other-mode` where it is one of the other
/// mode; what the file system refuses.
pub fn prepare(target: &Path, mode: Mode) -> Result<(), Error> {
    let target = Target::find(target, MANIFEST)?;
    target.recover()?;
    target.refuse_unless_replaceable(mode, &[])
}

/// Finishes or undoes what a stopped run left next to `target`.
///
/// # Errors
/// What the file system refuses.
pub fn recover(target: &Path) -> Result<(), Error> {
    Target::find(target, MANIFEST)?.recover()
}

/// Writes the folder of a plan and puts it in the place of `target`, on the disk itself. A run that writes there
/// already is waited for.
///
/// # Errors
/// Those of [`prepare`]; `output-holds-input` where the folder to be replaced holds an input of the job. Whatever
/// fails, an older folder is unchanged.
pub fn write(plan: &Plan, target: &Path) -> Result<(), Error> {
    write_with(plan, target, Durability::Synced, &|_, _| {})
}

/// [`write()`] that waits for the disk or does not, and reports how far it is.
///
/// # Errors
/// Those of [`write()`].
pub fn write_with(plan: &Plan, target: &Path, durability: Durability, progress: Progress<'_>) -> Result<(), Error> {
    write_proved(plan, target, Writing { durability, pictures: true }, progress, &|_| Ok(None))
}

/// How a job folder is written.
#[derive(Clone, Copy, Debug)]
pub struct Writing {
    /// Whether it is flushed to the disk.
    pub durability: Durability,
    /// Whether layout, maps, report and view are drawn.
    pub pictures: bool,
}

/// What was proved of a new folder, for its report; None where nothing was to be proved.
pub(crate) type Prove<'a> = dyn Fn(&Path) -> Result<Option<String>, Error> + 'a;

/// [`write_with`] that has the new folder proved before it takes the place of `target`; its report says so.
///
/// # Errors
/// Those of [`write()`], and what `prove` says: an older folder is then unchanged.
pub fn write_proved(
    plan: &Plan,
    target: &Path,
    Writing { durability, pictures }: Writing,
    progress: Progress<'_>,
    prove: &Prove<'_>,
) -> Result<(), Error> {
    let fill: &FillJob<'_> = match plan {
        Plan::Stepped(plan) => &|filling, head| files::stepped(plan, head, filling, pictures, progress),
        Plan::OnTheFly(plan) => &|filling, head| files::on_the_fly(plan, head, filling, pictures, progress),
    };
    write_job(plan.job(), target, durability, fill, prove)
}

/// For mutants of the verifier: the folder of a plan that was tampered with.
#[cfg(any(test, feature = "test-support"))]
pub fn write_stepped(plan: &SteppedPlan, target: &Path, pictures: bool) -> Result<(), Error> {
    let fill: &FillJob<'_> = &|filling, head| files::stepped(plan, head, filling, pictures, &|_, _| {});
    write_job(&plan.job, target, Durability::Unsynced, fill, &|_| Ok(None))
}

/// For mutants of the verifier: the folder of an on-the-fly plan that was tampered with, without pictures.
#[cfg(any(test, feature = "test-support"))]
pub fn write_on_the_fly(plan: &OnTheFlyPlan, target: &Path) -> Result<(), Error> {
    let fill: &FillJob<'_> = &|filling, head| files::on_the_fly(plan, head, filling, false, &|_, _| {});
    write_job(&plan.job, target, Durability::Unsynced, fill, &|_| Ok(None))
}

/// Writes the files of a job folder and returns the bytes of its manifest, which begins with the head given.
type FillJob<'a> = dyn Fn(Filling<'_>, &Head) -> Result<Vec<u8>, Error> + 'a;

/// Lets `fill` make a job folder, has it proved, and puts it in the place of `target`.
fn write_job(
    job: &Job,
    target: &Path,
    durability: Durability,
    fill: &FillJob<'_>,
    prove: &Prove<'_>,
) -> Result<(), Error> {
    let target = Target::find(target, MANIFEST)?;
    // Asked once the lock is held: until then another run may put a folder there.
    let allowed = || target.refuse_unless_replaceable(job.mode, &input_paths(job));
    exchange(&target, durability.flush(), &allowed, &|new| {
        fs::create_dir(new).map_err(|e| failed("make the folder", new, &e))?;
        let head = files::head(job, &target.path)?;
        files::fill(new, &|filling| fill(filling, &head))?;
        // Only a folder with pictures has a report that can say so.
        match prove(new)?.filter(|_| new.join(files::REPORT).exists()) {
            Some(proved) => files::tell_proof(new, &proved),
            None => Ok(()),
        }
    })
}

/// Lets `fill` make a folder, which holds the file `sign` when it is whole, and puts it in the place of `target` if
/// `allowed` says that what is there may be replaced.
///
/// # Errors
/// What `allowed` and `fill` say; what the file system refuses. An older folder is then unchanged.
pub fn replace(
    target: &Path,
    sign: &'static str,
    durability: Durability,
    allowed: &dyn Fn() -> Result<(), Error>,
    fill: &dyn Fn(&Path) -> Result<(), Error>,
) -> Result<(), Error> {
    exchange(&Target::find(target, sign)?, durability.flush(), allowed, &|new| {
        fs::create_dir(new).map_err(|e| failed("make the folder", new, &e))?;
        fill(new)
    })
}

/// Lets `fill` make a job folder of a stepped job, and puts it in the place of `target`.
///
/// # Errors
/// Those of [`prepare`], and what `fill` says. An older folder is then unchanged.
pub fn replace_stepped(target: &Path, durability: Durability, fill: &Fill<'_>) -> Result<(), Error> {
    let place = Target::find(target, MANIFEST)?;
    let allowed = || place.refuse_unless_replaceable(Mode::Stepped, &[]);
    replace(target, MANIFEST, durability, &allowed, &|new| files::fill(new, fill))
}

/// Lets `fill` make the new folder of a target under its lock, and puts it in its place.
fn exchange(
    target: &Target,
    flush: &Flush<'_>,
    allowed: &dyn Fn() -> Result<(), Error>,
    fill: &dyn Fn(&Path) -> Result<(), Error>,
) -> Result<(), Error> {
    let parent = target.path.parent().unwrap_or(Path::new("/"));
    let around = make_all(parent).map_err(|e| failed("make the folder", parent, &e))?;
    let lock = target.lock()?;
    target.tidy(&lock)?;
    allowed()?;
    let done = fill(&target.new).and_then(|()| target.exchange(&lock, flush));
    if done.is_err() {
        // What cannot be removed now, the next run removes.
        let _ = fs::remove_dir_all(&target.new);
    }
    done?;
    around.iter().try_for_each(|folder| flush(folder).map_err(|e| failed("put the folder on the disk", folder, &e)))
}

/// Writes one file, and waits for the disk or does not.
///
/// # Errors
/// What the file system refuses.
pub fn write_file(path: &Path, bytes: &[u8], durability: Durability) -> Result<(), Error> {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let flush = durability.flush();
    let written = fs::write(path, bytes).and_then(|()| flush(path)).and_then(|()| flush(folder));
    written.map_err(|e| failed("write the file", path, &e))
}

/// The job file and every other input file of a job, as they can be opened.
pub fn input_paths(job: &Job) -> Vec<PathBuf> {
    let named = job.input_files().into_iter().map(|(_, file)| job.relative(file));
    std::iter::once(job.path.clone()).chain(named).collect()
}

/// Whether the folder was made from exactly this job and these inputs by this program, and is whole.
pub fn is_unchanged(job: &Job, inputs: Vec<InputFact>, pictures: bool, folder: &Path) -> bool {
    let (Ok(head), Ok(job_file)) = (Head::read(folder), path_from(&job.path, folder)) else { return false };
    let wanted = Head::new(job, job_file, inputs);
    let is_there = |f: &FileFact| fs::metadata(folder.join(&f.file)).is_ok_and(|m| m.len() == f.bytes);
    let is_drawn = head.files.iter().any(|f| f.file == files::REPORT);
    head.is_same(&wanted) && (is_drawn || !pictures) && head.files.iter().all(is_there)
}

/// The right to bring a job folder up to date; ends when dropped, and with the process.
#[derive(Debug)]
pub struct Claim(#[expect(dead_code, reason = "held, not read")] Lock);

/// Waits until no other batch brings the folder at `target` up to date.
///
/// # Errors
/// What the file system refuses.
pub fn claim(target: &Path) -> Result<Claim, Error> {
    let target = Target::find(target, MANIFEST)?;
    let parent = target.path.parent().unwrap_or(Path::new("/"));
    make_all(parent).map_err(|e| failed("make the folder", parent, &e))?;
    target.claim().map(Claim)
}

/// A file as seen from inside the folder at `target`, with `/` between the names; neither need exist yet. Whole where
/// they lie on different drives of Windows.
///
/// # Errors
/// Where a folder on the way cannot be read.
pub fn path_from(file: &Path, target: &Path) -> Result<String, Error> {
    let real = |p: &Path| resolved(p).map_err(|e| failed("find the folder", p, &e));
    let from = real(target)?;
    // A job file may be a link: its inputs are relative to where it is named, not to where it leads.
    let folder = file.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let file = real(folder)?.join(file.file_name().unwrap_or_default());
    let common = file.components().zip(from.components()).take_while(|(a, b)| a == b).count();
    if common == 0 {
        return Ok(file.to_string_lossy().replace('\\', "/"));
    }
    let mut out = vec!["..".to_owned(); from.components().count() - common];
    out.extend(file.components().skip(common).map(|c| c.as_os_str().to_string_lossy().into_owned()));
    Ok(out.join("/"))
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use super::*;

    /// Puts a folder with the files `sign` and `blocks/1` in the place of `target`; returns what was flushed, in
    /// order, each with whether the target held the new folder by then, and whether the old one was still there.
    fn flushed(target: &Path, text: &str) -> Vec<(PathBuf, bool, bool)> {
        let target = Target::find(target, "sign").expect("a place");
        let (new, old) = (&target.new, &target.old);
        let seen = Mutex::new(Vec::new());
        let flush = |path: &Path| {
            let is_new = fs::read_to_string(target.path.join("sign")).is_ok_and(|held| held == text);
            // Where names are exchanged, the old folder has that of the new one by then.
            let has_old = old.exists() || is_new && new.exists();
            seen.lock().expect("no panic").push((path.to_owned(), is_new, has_old));
            Ok(())
        };
        let fill = |new: &Path| {
            fs::create_dir_all(new.join("blocks")).expect("made");
            fs::write(new.join("blocks/1"), text).expect("written");
            fs::write(new.join("sign"), text).expect("written");
            Ok(())
        };
        exchange(&target, &flush, &|| Ok(()), &fill).expect("exchanged");
        seen.into_inner().expect("no panic")
    }

    #[test]
    fn a_new_folder_is_flushed_before_it_takes_its_name_and_its_parent_before_the_old_one_goes() {
        let dir = tempfile::tempdir().expect("a folder");
        let top = dunce::canonicalize(dir.path()).expect("there");
        let parent = top.join("a");
        let made = Target::find(&top.join("a/out.job"), "sign").expect("a place");
        let new = &made.new;
        let first = flushed(&top.join("a/out.job"), "one");
        let again = flushed(&top.join("a/out.job"), "two");
        for (seen, replaces) in [(&first, false), (&again, true)] {
            let (files, rest) = seen.split_at(2);
            let mut names: Vec<&PathBuf> = files.iter().map(|(path, ..)| path).collect();
            names.sort();
            assert_eq!(names, [&new.join("blocks/1"), &new.join("sign")]);
            assert!(files.iter().all(|(_, is_new, _)| !is_new));
            assert_eq!(rest[..2], [(new.join("blocks"), false, false), (new.to_owned(), false, false)]);
            assert_eq!(rest[2], (parent.clone(), true, replaces), "the names have changed, the old folder is there");
        }
        // The folder around it was new, so the one around that has a new name too.
        assert_eq!(first[5..], [(top.clone(), true, false)]);
        assert_eq!(again.len(), 5);
        assert!(!made.old.exists());
    }

    #[test]
    fn a_folder_that_cannot_be_flushed_does_not_take_its_name() {
        let dir = tempfile::tempdir().expect("a folder");
        let target = Target::find(&dir.path().join("out.job"), "sign").expect("a place");
        let fails = |_: &Path| Err(std::io::Error::other("the disk is gone"));
        let fill = |new: &Path| fs::create_dir(new).map_err(|e| failed("make", new, &e));
        let e = exchange(&target, &fails, &|| Ok(()), &fill).expect_err("not on the disk");
        assert_eq!(e.diags()[0].code, "output-unwritable");
        assert_eq!(fs::read_dir(dir.path()).expect("there").count(), 0, "nothing is left");
    }
}
