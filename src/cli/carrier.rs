//! Units of `batch` and `sweep`, carried to other machines by an engine.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use super::args::{Args, FleetArgs};
use super::{durability, show, unwritable};
use crate::batch::collect::{Reasons, collect};
use crate::batch::engine::{self, Fleet, News};
use crate::batch::fragment::Fragment;
use crate::batch::units;
use crate::batch::work::{End, up_to_date};
use crate::batch::{Outcome, Report, Unit};
use terrace_core::diag::{Error, Place};
use terrace_core::host;
use terrace_core::parallel;

/// Units that are carried by an engine.
pub(super) struct Carrier<'a> {
    pub(super) args: &'a Args,
    pub(super) asked: &'a FleetArgs,
    /// The folder in which the file of units is made where nobody wants to keep it.
    pub(super) around: &'a Path,
    /// The file of units that is kept.
    pub(super) keep: Option<&'a Path>,
    pub(super) stop: &'a AtomicBool,
    pub(super) view: &'a show::Progress,
}

/// What became of units that were carried.
pub(super) struct CarryResult {
    pub(super) reports: PathBuf,
    pub(super) reasons: Reasons,
    /// Keeps the folder until the reports are collected: dropping it removes the folder.
    _own: Option<OwnFolder>,
}

impl Carrier<'_> {
    /// Has the engine work on units; those that are up to date are reported at once, and not sent to it.
    pub(super) fn carry(&self, list: &[Unit], on_fragment: &mut dyn FnMut(&Fragment)) -> Result<CarryResult, Error> {
        let own = self.keep.is_none().then(|| OwnFolder::inside(self.around)).transpose()?;
        let in_own = own.as_ref().map(|own| own.path.join("units.jsonl"));
        let file = in_own.or_else(|| self.keep.map(Path::to_owned)).unwrap_or_default();
        let reports = units::reports(&file);
        let durability = durability(self.args);
        // First: it removes the reports of an older plan.
        units::write(list, &file, durability)?;
        let done_already = parallel::map(list.len(), |i| up_to_date(&list[i]));
        let mut rest = Vec::new();
        for (unit, done) in list.iter().zip(done_already) {
            match done {
                Some(done) => {
                    let fragment = Fragment::new(unit, done, 0.0);
                    fragment.write(&reports, durability)?;
                    on_fragment(&fragment);
                }
                None => rest.push(unit),
            }
        }
        let mut reasons = Reasons::new();
        if !rest.is_empty() {
            let fleet = Fleet {
                scheduler: &self.asked.scheduler,
                file: &file,
                reports: &reports,
                memory: self.asked.memory,
                threads: self.args.threads.unwrap_or(1),
                durability,
                stop: self.stop,
            };
            reasons = engine::run(&rest, &fleet, &mut |news| self.hear(&news, rest.len(), on_fragment))?;
        }
        Ok(CarryResult { reports, reasons, _own: own })
    }

    fn hear(&self, news: &News<'_>, count: usize, on_fragment: &mut dyn FnMut(&Fragment)) {
        match news {
            News::Ended(fragment) => on_fragment(fragment),
            News::Said(text) => self.view.say(text),
            News::Submitted { .. } if self.args.quiet => {}
            News::Submitted { groups, workers, slots } => {
                self.view.say(&format!("{count} units in {groups} groups for {workers} workers, {slots} at a time"));
            }
        }
    }
}

/// `batch --engine`: units to a file, their work to the engine, one report of it all.
pub(super) fn batch(
    carrier: &Carrier<'_>,
    list: &[Unit],
    on_outcome: &mut dyn FnMut(&Outcome),
) -> Result<Report, Error> {
    let carried = carrier.carry(list, &mut |fragment| {
        if let End::Job(outcome) = &fragment.end {
            on_outcome(outcome);
        }
    })?;
    Ok(collect(list, &carried.reports, &carried.reasons))
}

/// A hidden folder that goes when it is dropped; one whose process was killed goes when the next is made.
struct OwnFolder {
    path: PathBuf,
    /// Holds the system's lock as long as it is open.
    _lock: File,
}

/// How the names of these folders begin.
const OWN: &str = ".fleet-";

impl OwnFolder {
    fn inside(around: &Path) -> Result<Self, Error> {
        let path = around.join(format!("{OWN}{}-{}", host::name(), std::process::id()));
        let failed = |e: std::io::Error| unwritable("make the folder", Place::file(path.display().to_string()), &e);
        std::fs::create_dir_all(around).map_err(failed)?;
        remove_left(around);
        std::fs::create_dir_all(&path).map_err(failed)?;
        let lock = File::create(path.join("lock.new")).map_err(failed)?;
        // It gets its name once it is locked; on a file system without locks never, and left folders stay.
        if lock.try_lock().is_ok() {
            std::fs::rename(path.join("lock.new"), path.join("lock")).map_err(failed)?;
        }
        Ok(Self { path: path.clone(), _lock: lock })
    }
}

/// Removes what killed processes have left: the folders that nobody has locked.
fn remove_left(around: &Path) {
    let around = if around.as_os_str().is_empty() { Path::new(".") } else { around };
    for entry in std::fs::read_dir(around).into_iter().flatten().flatten() {
        let is_own = entry.file_name().to_string_lossy().starts_with(OWN);
        let lock = || File::options().append(true).open(entry.path().join("lock"));
        if is_own && lock().is_ok_and(|lock| lock.try_lock().is_ok()) {
            let _ = std::fs::remove_dir_all(entry.path());
        }
    }
}

impl Drop for OwnFolder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.path);
    }
}
