//! Many jobs: each compiled on its own, unchanged ones skipped, a failing one harming no other.
//!
//! Consumes the arguments of the command; promises job folders and a [`Report`], which is JSON, text and a page.
//!
//! A job is unchanged when its folder's manifest names the same version, mode, seed, objective, job file and inputs by
//! hash, and every file it lists is there with its size. Outcomes are in the order of the list.

mod index;
mod report;

use std::panic::AssertUnwindSafe;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use crate::diag::{Diag, Error, Place};
use crate::job::{Job, Overrides};
use crate::job_folder::{self, Durability};
use crate::machine::Machine;
use crate::manifest::{self, AnySummary};
use crate::plan;
pub use index::index_html;
pub use report::Report;

/// One job of a batch.
#[derive(Clone, Debug)]
pub struct Entry {
    /// Job file.
    pub path: PathBuf,
    /// Its folder.
    pub folder: PathBuf,
    /// The job, or what is wrong with its file.
    job: Result<Job, Error>,
}

impl Entry {
    /// The files that the job reads, its own first.
    pub fn inputs(&self) -> Vec<PathBuf> {
        self.job.as_ref().map_or_else(|_| vec![self.path.clone()], job_folder::input_paths)
    }

    fn ended(&self, state: State, verified: bool) -> Outcome {
        Outcome { job: self.path.clone(), folder: self.folder.clone(), state, verified }
    }
}

/// What the manifest of a job's folder tells of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Figures {
    /// Number of stops; None of on-the-fly jobs.
    pub stops: Option<usize>,
    /// Job time, s: that of the machine.
    pub time_s: f64,
    /// Time of the machine and of the person who loads the blocks, s; None where no person is needed.
    pub by_hand_s: Option<f64>,
    /// Number of warnings.
    pub warnings: usize,
}

impl From<&AnySummary> for Figures {
    fn from(summary: &AnySummary) -> Self {
        match summary {
            AnySummary::Stepped(s) => Self {
                stops: Some(s.stops),
                time_s: s.time_s.total,
                by_hand_s: s.by_hand.needed.then_some(s.by_hand.total_s),
                warnings: s.warnings.len(),
            },
            AnySummary::OnTheFly(s) => {
                Self { stops: None, time_s: s.time_s, by_hand_s: None, warnings: s.warnings.len() }
            }
        }
    }
}

/// What became of a job.
#[derive(Debug)]
pub enum State {
    /// It was compiled.
    Compiled(Figures),
    /// Nothing had changed: the figures of the folder that is there.
    Unchanged(Figures),
    /// It could not be compiled, and any older folder is unchanged; or its folder does not verify.
    Failed(Error),
    /// The batch was stopped before this job began.
    Left,
}

/// A job and what became of it.
#[derive(Debug)]
pub struct Outcome {
    /// Job file.
    pub job: PathBuf,
    /// Its folder.
    pub folder: PathBuf,
    /// What became of it.
    pub state: State,
    /// Whether its folder was verified, without a fault.
    pub verified: bool,
}

/// Verifies a job folder; an error where it cannot be verified or breaks a rule.
pub type Verify<'a> = dyn Fn(&Path) -> Result<(), Error> + Sync + 'a;

/// How a batch is run.
#[derive(Clone, Copy)]
pub struct Settings<'a> {
    /// Whether folders are flushed to the disk.
    pub durability: Durability,
    /// Called with the folder of every job that is compiled or unchanged; None: folders are not verified.
    pub verify: Option<&'a Verify<'a>>,
    /// No job begins once this is set.
    pub stop: &'a AtomicBool,
}

/// The jobs of several arguments, each a folder (its `*.toml` by name, machine files left out), a list file (one
/// path a line, relative to it; `#` begins a comment), or one job file (`*.toml`). A job that is named twice is one.
///
/// # Errors
/// Where an argument cannot be read, nothing is listed, or two jobs would write one folder.
pub fn jobs(paths: &[PathBuf], output: Option<&Path>, overrides: &Overrides) -> Result<Vec<Entry>, Error> {
    let mut entries: Vec<Entry> = Vec::new();
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
        let text = String::from_utf8(crate::diag::read_file(path, 16 << 20)?)
            .map_err(|_| Diag::input("batch-utf8", "the list is not UTF-8 text").at(place()))?;
        let base = path.parent().unwrap_or(Path::new(""));
        let lines = text.lines().map(|l| l.split('#').next().unwrap_or("").trim()).filter(|l| !l.is_empty());
        files.extend(lines.map(|l| base.join(l)));
    }
    Ok(files)
}

/// The job of a file; None of a machine file in a folder of jobs.
fn entry(path: PathBuf, is_folder: bool, output: Option<&Path>, overrides: &Overrides) -> Option<Entry> {
    let job = Job::load(&path, overrides);
    // Machine files often lie next to the jobs that name them.
    if is_folder && job.is_err() && Machine::load(&path).is_ok() {
        return None;
    }
    let mode = job.as_ref().map_or(overrides.mode.unwrap_or_default(), |job| job.mode);
    let beside = plan::default_output(&path, mode);
    let folder = match (output, beside.file_name()) {
        (Some(o), Some(name)) => o.join(name),
        _ => beside,
    };
    Some(Entry { path, folder, job })
}

/// Compiles what has changed, as many jobs at a time as there are threads. `told` hears of every job
/// as it ends.
pub fn run(entries: &[Entry], settings: &Settings<'_>, told: &mut (dyn FnMut(&Outcome) + Send)) -> Report {
    // Plain threads, not tasks of the pool: a thread of the pool that waits for the parts of one job
    // would begin another one meanwhile, and the jobs in memory at a time would have no bound.
    let (next, told) = (AtomicUsize::new(0), Mutex::new(told));
    let work = || {
        let mut done = Vec::new();
        while !settings.stop.load(Ordering::Relaxed) {
            let i = next.fetch_add(1, Ordering::Relaxed);
            let Some(entry) = entries.get(i) else { break };
            let outcome = outcome(entry, settings);
            told.lock().expect("no listener panics")(&outcome);
            done.push((i, outcome));
        }
        done
    };
    let mut outcomes: Vec<Outcome> = entries.iter().map(|entry| entry.ended(State::Left, false)).collect();
    std::thread::scope(|scope| {
        let threads = rayon::current_num_threads().min(entries.len());
        let workers: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
        for (i, outcome) in workers.into_iter().flat_map(|w| w.join().expect("panics of a job are caught")) {
            outcomes[i] = outcome;
        }
    });
    Report(outcomes)
}

fn outcome(entry: &Entry, settings: &Settings<'_>) -> Outcome {
    let verified = |state: State| match settings.verify {
        Some(verify) => verify(&entry.folder).map(|()| (state, true)),
        None => Ok((state, false)),
    };
    // A panic is our own fault and is reported as such; the other jobs continue.
    let caught = std::panic::catch_unwind(AssertUnwindSafe(|| compiled(entry, settings.durability).and_then(verified)));
    let ended = caught.unwrap_or_else(|_| Err(Diag::bug("panic", "an invariant of the program broke").into()));
    let (state, verified) = ended.unwrap_or_else(|e| (State::Failed(e), false));
    entry.ended(state, verified)
}

/// Compiles a job if it has changed.
fn compiled(entry: &Entry, durability: Durability) -> Result<State, Error> {
    let job = entry.job.clone()?;
    job_folder::prepare(&entry.folder, job.mode)?;
    if job_folder::is_unchanged(&job, &entry.folder)
        && let Ok(found) = manifest::read(&entry.folder)
    {
        return Ok(State::Unchanged(Figures::from(&found.summary)));
    }
    let plan = plan::plan(job, &|_, _| {})?;
    job_folder::write_with(&plan, &entry.folder, durability, &|_, _| {})?;
    Ok(State::Compiled(Figures::from(&plan.summary())))
}
