//! Units on other machines: groups of them are given to an engine, which starts a process for each.
//!
//! Consumes units and a file of them that every machine can read; promises that every unit has been worked on, or a
//! reason why it was not. What becomes of units is reported by their processes on standard output, through the engine,
//! so reports are complete where the folders of the machines are not shared. The engine's own means do the rest: it
//! gives the next group to the next free worker, the largest first, starts a group again whose worker died, on another
//! worker too, and gives up after some tries.
//!
//! A fault of a machine is not one of a unit: workers are asked at the beginning whether they can work at all, and a
//! group that a worker ends without a report is given to others. Such a worker, and one that is silent, is set aside
//! and named once.

mod dask;

use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsString;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

pub use dask::PACKAGE;
use dask::{Event, Need, Session, Submission};

use super::collect::Reasons;
use super::fragment::Fragment;
use super::isolated::reason;
use super::outcome::{State, counted};
use super::unit::Unit;
use super::units::numbers;
use super::units_per_process::groups;
use super::work::End;
use terrace_core::diag::{Diag, Error};
use terrace_report::job_folder::Durability;

/// How often units are given to other workers because one could not write or report them.
const MOST_TRIES: usize = 3;

/// After so many groups without a report a worker is set aside: one may be a process that was killed.
const MOST_FAULTS: usize = 2;

/// How long an engine is waited for that is gone, s.
const PATIENCE_S: u64 = 120;

/// What a fleet is to do, and where.
pub struct Fleet<'a> {
    /// Address of the engine's scheduler.
    pub scheduler: &'a str,
    /// The file of units, as the machines can open it.
    pub file: &'a Path,
    /// The folder of reports.
    pub reports: &'a Path,
    /// Limit of memory of a unit, bytes; None: the worker's memory divided by its threads.
    pub memory: Option<u64>,
    /// Threads of a unit.
    pub threads: usize,
    /// Whether reports and folders are flushed to the disk.
    pub durability: Durability,
    /// Once this is set no group begins.
    pub stop: &'a AtomicBool,
}

/// What a fleet reports while it works.
pub enum News<'a> {
    /// So many groups were given to so many workers, which do so many at a time.
    Submitted {
        /// Number of groups.
        groups: usize,
        /// Number of workers.
        workers: usize,
        /// Number of groups at a time.
        slots: usize,
    },
    /// A unit has ended.
    Ended(&'a Fragment),
    /// Something that the user should know.
    Said(String),
}

/// A group that was given to the engine.
struct Group<'a> {
    units: Vec<&'a Unit>,
    /// Workers that could not write its folders, or left no report.
    not: BTreeSet<String>,
    /// How often it has been given before.
    tries: usize,
}

/// Has all units worked on; returns the reasons why some were not.
///
/// # Errors
/// `engine-absent`, `engine-unreachable`, `engine-workers`; what the file system refuses.
pub fn run(units: &[&Unit], fleet: &Fleet<'_>, on_news: &mut dyn FnMut(News<'_>)) -> Result<Reasons, Error> {
    let mut session = Session::start(fleet.scheduler, PATIENCE_S, &need(fleet)?)?;
    let slots = slots(&session, fleet)?;
    for (worker, why) in session.aside() {
        on_news(News::Said(set_aside(&session.shown(worker), why)));
    }
    let list: Vec<Group<'_>> =
        groups(units, slots).into_iter().map(|units| Group { units, not: BTreeSet::new(), tries: 0 }).collect();
    on_news(News::Submitted { groups: list.len(), workers: session.fit().count(), slots });
    let mut work = Work {
        fleet,
        open: BTreeMap::new(),
        given: 0,
        reasons: Reasons::new(),
        faults: BTreeMap::new(),
        full: BTreeSet::new(),
    };
    for group in list {
        work.submit(&mut session, group)?;
    }
    while !work.open.is_empty() {
        if fleet.stop.load(Ordering::Relaxed) {
            work.give_up("the batch was stopped");
            break;
        }
        match session.next(Duration::from_millis(200)) {
            None => {}
            Some(Event::Ended { task, code, out, err, worker }) => {
                if let Some(group) = work.open.remove(&task) {
                    let process = EndedProcess { worker: &worker, code, out: &out, err: &err };
                    work.ended(&mut session, group, &process, on_news)?;
                }
            }
            Some(Event::Lost { task, why }) => work.lost(task, &why),
            Some(Event::Aside { worker, why }) => on_news(News::Said(set_aside(&session.shown(&worker), &why))),
            Some(Event::Back { worker }) => {
                on_news(News::Said(format!("worker {} is heard of again", session.shown(&worker))));
            }
            Some(Event::Workers(count)) => {
                on_news(News::Said(format!("the engine has {} now", counted(count, "worker"))));
            }
            Some(Event::SchedulerLost) => on_news(News::Said(format!(
                "the scheduler at {} is gone: waiting {PATIENCE_S} s for it and a worker to come back",
                fleet.scheduler
            ))),
            Some(Event::SchedulerBack) => on_news(News::Said("the scheduler is back: the rest was given to it".into())),
            Some(Event::Closed(why)) => {
                work.give_up(&why);
                break;
            }
        }
    }
    Ok(work.reasons)
}

/// The most groups that the workers do at a time: the threads of all.
///
/// # Errors
/// `engine-workers` where there is no worker, or none with the memory of a unit.
fn slots(session: &Session, fleet: &Fleet<'_>) -> Result<usize, Error> {
    let slots: usize = session.fit().map(|worker| worker.threads).sum();
    if slots == 0 && !session.aside().is_empty() {
        let whys = session.aside().iter().map(|(worker, why)| format!("{}: {why}", session.shown(worker)));
        let text = format!(
            "no worker of the scheduler at {} can work on the units ({})",
            fleet.scheduler,
            whys.collect::<Vec<_>>().join("; ")
        );
        return Err(Diag::limit("engine-workers", text).hint("mend one, and run the same command again").into());
    }
    if slots == 0 {
        let d = Diag::limit("engine-workers", format!("the scheduler at {} has no worker", fleet.scheduler));
        return Err(d.hint(format!("start one on each machine: dask worker {}", fleet.scheduler)).into());
    }
    let limits: Vec<u64> = session.fit().map(|worker| worker.memory).collect();
    match fleet.memory {
        Some(wanted) if !has_room(wanted, &limits) => {
            let largest = limits.iter().max().copied().unwrap_or_default();
            let [wanted, largest] = [wanted, largest].map(|bytes| bytes as f64 / 1e6);
            let text = format!("no worker has the {wanted:.0} MB of a unit; the largest has {largest:.0} MB");
            let hint = "ask for less with --memory, or start a worker with a larger --memory-limit";
            Err(Diag::limit("engine-workers", text).hint(hint).into())
        }
        _ => Ok(slots),
    }
}

/// Whether a worker with one of these limits of memory, bytes, can hold a unit; 0 is no limit.
fn has_room(unit: u64, limits: &[u64]) -> bool {
    limits.iter().any(|&limit| limit == 0 || limit >= unit)
}

/// What a worker needs to work on the units of a fleet.
fn need(fleet: &Fleet<'_>) -> Result<Need, Error> {
    let bytes = std::fs::metadata(fleet.file).map_err(|e| unstartable(&e))?.len();
    Ok(Need {
        program: std::env::current_exe().map_err(|e| unstartable(&e))?,
        version: concat!("terrace ", env!("CARGO_PKG_VERSION")).into(),
        cwd: std::env::current_dir().map_err(|e| unstartable(&e))?,
        file: fleet.file.to_owned(),
        bytes,
        memory: fleet.memory.unwrap_or(0),
    })
}

/// The line that names a worker which has no more tasks.
fn set_aside(worker: &str, why: &str) -> String {
    format!("worker {worker} is set aside, the others do its work: {why}")
}

/// What the engine has in work.
struct Work<'a, 'f> {
    fleet: &'f Fleet<'f>,
    open: BTreeMap<usize, Group<'a>>,
    /// Number of tasks that were given so far; those given first come first.
    given: usize,
    reasons: Reasons,
    /// How many groups each worker has ended without a report.
    faults: BTreeMap<String, usize>,
    /// Workers of which it was said that they cannot write.
    full: BTreeSet<String>,
}

impl<'a> Work<'a, '_> {
    fn submit(&mut self, session: &mut Session, group: Group<'a>) -> Result<(), Error> {
        let ids: Vec<usize> = group.units.iter().map(|unit| unit.id).collect();
        // Workers that declare memory give each task its part; others have as many tasks as threads.
        let declared = session.fit().any(|worker| worker.declared.is_some());
        let submission = Submission {
            task: self.given,
            argv: self.argv(&ids)?,
            cwd: std::env::current_dir().map_err(|e| unstartable(&e))?,
            memory: self.fleet.memory.filter(|_| declared),
            not: group.not.iter().cloned().collect(),
        };
        session.submit(&submission)?;
        self.open.insert(self.given, group);
        self.given += 1;
        Ok(())
    }

    /// The command of a group on a worker.
    fn argv(&self, ids: &[usize]) -> Result<Vec<String>, Error> {
        let program = std::env::current_exe().map_err(|e| unstartable(&e))?;
        let memory = self.fleet.memory.map_or_else(|| "{memory}B".to_owned(), |bytes| format!("{bytes}B"));
        let mut argv = vec![utf8_argument(program.into())?, "batch".into()];
        argv.extend(["--units".into(), utf8_argument(self.fleet.file.into())?, "--unit".into(), numbers(ids)]);
        argv.extend(["--memory".into(), memory, "--json".into(), "-q".into(), format!("-j{}", self.fleet.threads)]);
        if self.fleet.durability == Durability::Unsynced {
            argv.push("--no-sync".into());
        }
        Ok(argv)
    }

    /// Takes up the reports of a group; units that the worker's disk had no room for, or that it left without a report,
    /// are given to other workers.
    fn ended(
        &mut self,
        session: &mut Session,
        group: Group<'a>,
        process: &EndedProcess<'_>,
        on_news: &mut dyn FnMut(News<'_>),
    ) -> Result<(), Error> {
        let &EndedProcess { worker, code, out, err } = process;
        let mut not = group.not;
        not.insert(worker.to_owned());
        let tries = group.tries + 1;
        let has_other = session.fit().any(|other| !not.contains(&other.address)) && tries <= MOST_TRIES;
        let shown = session.shown(worker);
        let mut is_faulty = false;
        let found: Vec<Fragment> = out.lines().filter_map(|line| serde_json::from_str(line).ok()).collect();
        let mut again = Vec::new();
        for unit in group.units {
            match found.iter().find(|fragment| fragment.unit == unit.id) {
                Some(fragment) if has_other && could_not_write(fragment) => again.push(unit),
                Some(fragment) => {
                    fragment.write(self.fleet.reports, self.fleet.durability)?;
                    on_news(News::Ended(fragment));
                }
                None if has_other => {
                    is_faulty = true;
                    again.push(unit);
                }
                None => {
                    let why =
                        format!("its process on {shown} ended with exit code {code} and no report: {}", reason(err));
                    self.reasons.insert(unit.id, why);
                }
            }
        }
        if again.is_empty() {
            return Ok(());
        }
        if is_faulty {
            let faults = self.faults.entry(worker.to_owned()).or_default();
            *faults += 1;
            if *faults == MOST_FAULTS {
                session.set_aside(worker, reason(err))?;
            }
        } else if self.full.insert(worker.to_owned()) {
            on_news(News::Said(format!(
                "units could not be written on {shown}: such units are given to other workers"
            )));
        }
        self.submit(session, Group { units: again, not, tries })
    }

    fn lost(&mut self, task: usize, why: &str) {
        for unit in self.open.remove(&task).into_iter().flat_map(|group| group.units) {
            self.reasons.insert(unit.id, format!("the engine gave it up: {why}"));
        }
    }

    fn give_up(&mut self, why: &str) {
        for unit in std::mem::take(&mut self.open).into_values().flat_map(|group| group.units) {
            self.reasons.insert(unit.id, why.to_owned());
        }
    }
}

/// The process of a group that has ended.
struct EndedProcess<'a> {
    /// The worker that it ran on.
    worker: &'a str,
    code: i32,
    /// What it wrote to its output, and to its error output.
    out: &'a str,
    err: &'a str,
}

/// Whether a unit failed for want of room or rights on its machine.
fn could_not_write(fragment: &Fragment) -> bool {
    match &fragment.end {
        End::Job(outcome) => match &outcome.state {
            State::Failed(fault) => fault.failure.errors.iter().any(|m| m.code == "output-unwritable"),
            _ => false,
        },
        End::Rows(_) => false,
    }
}

/// A word of a command line, as the engine takes it.
fn utf8_argument(word: OsString) -> Result<String, Error> {
    word.into_string().map_err(|word| {
        let text = format!("the path {} cannot be given to the engine", word.to_string_lossy());
        Diag::input("unit-path", text).hint("use file names that are UTF-8 text").into()
    })
}

/// The fault of a program that cannot be started.
fn unstartable(e: &std::io::Error) -> Error {
    Diag::input("unit-process", format!("cannot find the program or the working folder: {e}")).into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_worker_without_a_limit_of_memory_holds_any_unit() {
        assert!(has_room(8 << 30, &[0, 4 << 30]) && has_room(4 << 30, &[4 << 30]));
        assert!(!has_room(8 << 30, &[4 << 30, 2 << 30]) && !has_room(1, &[]));
    }
}
