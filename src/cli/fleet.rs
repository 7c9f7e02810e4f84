//! Units of `batch` and `sweep`: planned to a file, worked on by number, carried by an engine.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use super::args::{Args, FleetArgs};
use super::{durability, print, show, unwritable};
use crate::batch::collect::{Reasons, collect};
use crate::batch::engine::{self, Fleet, News};
use crate::batch::fragment::{Fragment, host};
use crate::batch::isolated::{self, Isolation};
use crate::batch::units::{self, Chosen};
use crate::batch::work::{Done, End, up_to_date};
use crate::batch::{Outcome, Report, Settings, Unit, work as work_on};
use terrace_core::diag::{Diag, Error, Place};
use terrace_core::parallel;
use terrace_report::job_folder::Durability;

/// How units are worked on in this process.
pub(super) fn settings<'a>(args: &Args, stop: &'a AtomicBool) -> Settings<'a> {
    Settings { durability: durability(args), verify: &verified, stop }
}

/// Verifies the folder of a job.
fn verified(folder: &Path) -> Result<(), Error> {
    let proof = terrace_verify::verify(folder, None)?;
    if proof.ok {
        return Ok(());
    }
    let faults: Vec<String> = proof
        .rules
        .iter()
        .filter(|rule| rule.violated > 0 || !rule.ran)
        .map(|rule| {
            if rule.violated > 0 {
                format!("{}: {}", rule.code, rule.violated)
            } else {
                format!("{}: not checked", rule.code)
            }
        })
        .collect();
    let d = Diag::limit("batch-verify", format!("the folder does not verify ({})", faults.join(", ")));
    let hint = format!("terrace verify {0} tells where; remove the folder to compile the job again", folder.display());
    Err(d.at(Place::file(folder.display().to_string())).hint(hint).into())
}

/// Set by the first Ctrl-C; the second ends the program.
pub(super) fn stop_on_ctrl_c(view: &show::Progress, is_fleet: bool) -> Arc<AtomicBool> {
    let stop = Arc::new(AtomicBool::new(false));
    let (stopped, view) = (stop.clone(), view.clone());
    // Where the system takes no handler, Ctrl-C ends the program at once. Folders are whole either way.
    let _ = ctrlc::set_handler(move || {
        if stopped.swap(true, Ordering::Relaxed) {
            std::process::exit(1);
        }
        view.say(if is_fleet {
            "stopping: what has not begun is cancelled; workers complete what they have begun"
        } else {
            "stopping: running jobs are completed, no others are started; press Ctrl-C again to quit at once"
        });
    });
    stop
}

/// `batch --plan`: writes the file and says what it holds.
pub(super) fn plan(args: &Args, list: &[Unit], file: &Path) -> Result<u8, Error> {
    units::write(list, file, durability(args))?;
    let cost_s: f64 = list.iter().map(|unit| unit.cost_s).sum();
    let text = format!("{} units in {}, expected cost {cost_s:.0} s of one core\n", list.len(), file.display());
    let json = serde_json::json!({"units": list.len(), "file": file.display().to_string(), "cost_s": cost_s});
    print(&if args.json { show::json(&json) } else { text })?;
    Ok(0)
}

/// `batch --unit`: works on units one after another; a line for each as it ends.
pub(super) fn work(args: &Args, file: &Path, chosen: &Chosen, memory: Option<u64>) -> Result<u8, Error> {
    let all = units::read(file)?;
    let list = chosen.of(&all, file)?;
    let (reports, durability) = (units::reports(file), durability(args));
    let mut worst = 0;
    let mut told = |fragment: &Fragment| -> Result<(), Error> {
        worst = worst.max(fragment.end.exit_code());
        print(&if args.json { line(fragment) } else { shown(fragment) })
    };
    if let Some(memory) = memory {
        let command = |ids: &[usize]| again(args, file, ids);
        let mut failed = Ok(());
        let how = Isolation { command: &command, memory, reports: &reports, durability };
        isolated::run(&list, &how, &mut |fragment| failed = failed.clone().and(told(fragment)))?;
        failed?;
    } else {
        let stop = AtomicBool::new(false);
        for unit in list {
            let begin = Instant::now();
            let done = work_on(unit, &settings(args, &stop));
            told(&ended(unit, done, begin, (&reports, durability)))?;
        }
    }
    Ok(worst)
}

/// Writes the report of a unit; one that cannot be written tells why in place of what became of the unit.
fn ended(unit: &Unit, done: Done, begin: Instant, (reports, durability): (&Path, Durability)) -> Fragment {
    let fragment = Fragment::new(unit, done, begin.elapsed().as_secs_f64());
    match fragment.write(reports, durability) {
        Ok(()) => fragment,
        Err(e) => Fragment { end: End::failed(unit, &(&e).into()), ..fragment },
    }
}

/// The same command for these units, in this process without a limit of its own.
fn again(args: &Args, file: &Path, ids: &[usize]) -> Command {
    let program = std::env::current_exe().unwrap_or_else(|_| PathBuf::from("terrace"));
    let mut command = Command::new(program);
    let ids: Vec<String> = ids.iter().map(ToString::to_string).collect();
    command.args(["batch", "--json", "--units"]).arg(file).args(["--unit", &ids.join(",")]);
    command.args(args.threads.map(|n| format!("-j{n}"))).args(args.no_sync.then_some("--no-sync"));
    command
}

fn line(fragment: &Fragment) -> String {
    format!("{}\n", serde_json::json!(fragment))
}

fn shown(fragment: &Fragment) -> String {
    match &fragment.end {
        End::Job(outcome) => format!("{outcome}\n"),
        End::Rows(rows) => format!("unit {}: {} combinations\n", fragment.unit, rows.len()),
    }
}

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
pub(super) struct Carried {
    pub(super) reports: PathBuf,
    pub(super) reasons: Reasons,
    /// Goes when all is collected.
    _own: Option<OwnFolder>,
}

impl Carrier<'_> {
    /// Has units worked on; what is up to date is found here, and the engine is asked for the rest only.
    pub(super) fn carry(&self, list: &[Unit], told: &mut dyn FnMut(&Fragment)) -> Result<Carried, Error> {
        let own = self.keep.is_none().then(|| OwnFolder::inside(self.around)).transpose()?;
        let in_own = own.as_ref().map(|own| own.path.join("units.jsonl"));
        let file = in_own.or_else(|| self.keep.map(Path::to_owned)).unwrap_or_default();
        let (reports, durability) = (units::reports(&file), durability(self.args));
        units::write(list, &file, durability)?;
        let known = parallel::map(list.len(), |i| up_to_date(&list[i]));
        let mut rest = Vec::new();
        for (unit, known) in list.iter().zip(known) {
            match known {
                Some(done) => {
                    let fragment = Fragment::new(unit, done, 0.0);
                    fragment.write(&reports, durability)?;
                    told(&fragment);
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
            reasons = engine::run(&rest, &fleet, &mut |news| self.hear(&news, rest.len(), told))?;
        }
        Ok(Carried { reports, reasons, _own: own })
    }

    fn hear(&self, news: &News<'_>, count: usize, told: &mut dyn FnMut(&Fragment)) {
        match news {
            News::Ended(fragment) => told(fragment),
            News::Said(text) => self.view.say(text),
            News::Submitted { .. } if self.args.quiet => {}
            News::Submitted { groups, workers, slots } => {
                self.view.say(&format!("{count} units in {groups} groups for {workers} workers, {slots} at a time"));
            }
        }
    }
}

/// `batch --engine`: units to a file, their work to the engine, one report of it all.
pub(super) fn batch(carrier: &Carrier<'_>, list: &[Unit], told: &mut dyn FnMut(&Outcome)) -> Result<Report, Error> {
    let carried = carrier.carry(list, &mut |fragment| {
        if let End::Job(outcome) = &fragment.end {
            told(outcome);
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
        let path = around.join(format!("{OWN}{}-{}", host(), std::process::id()));
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
