//! Many jobs: each compiled on its own, unchanged ones skipped, a failing one harming no other.
//!
//! A job is unchanged when its folder's manifest names the same version, mode, seed, objective, job file and inputs by
//! hash, and every file it lists is there with its size. Outcomes are in the order of the list.

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use serde_json::{Value, json};

use crate::diag::{Diag, Error, Failure, Place};
use crate::job::{Job, Overrides};
use crate::job_folder::{self, Durability};
use crate::machine::Machine;
use crate::manifest::{self, AnySummary};
use crate::plan::{self, Plan};

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

/// What became of a job.
#[derive(Debug)]
pub enum State {
    /// Compiled: stops, job time in s, warnings.
    Compiled {
        /// Number of stops; None of on-the-fly jobs.
        stops: Option<usize>,
        /// Job time, s.
        time_s: f64,
        /// Number of warnings.
        warnings: usize,
    },
    /// Nothing had changed: stops and job time of the folder that is there.
    Unchanged {
        /// Number of stops; None of on-the-fly jobs.
        stops: Option<usize>,
        /// Job time, s.
        time_s: f64,
    },
    /// It failed; any older folder is unchanged.
    Failed(Error),
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
}

/// All outcomes.
#[derive(Debug)]
pub struct Report(Vec<Outcome>);

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
    let unreadable = |e: std::io::Error| Diag::input("batch-unreadable", format!("cannot read it: {e}")).at(place());
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
pub fn run(entries: &[Entry], durability: Durability, told: &(dyn Fn(&Outcome) + Sync)) -> Report {
    // Plain threads, not tasks of the pool: a thread of the pool that waits for the parts of one job
    // would begin another one meanwhile, and the jobs in memory at a time would have no bound.
    let next = AtomicUsize::new(0);
    let work = || {
        let mut done = Vec::new();
        loop {
            let i = next.fetch_add(1, Ordering::Relaxed);
            let Some(entry) = entries.get(i) else { return done };
            let outcome = outcome(entry, durability);
            told(&outcome);
            done.push((i, outcome));
        }
    };
    let mut outcomes: Vec<(usize, Outcome)> = std::thread::scope(|scope| {
        let threads = rayon::current_num_threads().min(entries.len());
        let workers: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
        workers.into_iter().flat_map(|w| w.join().expect("panics of a job are caught")).collect()
    });
    outcomes.sort_by_key(|(i, _)| *i);
    Report(outcomes.into_iter().map(|(_, outcome)| outcome).collect())
}

fn outcome(entry: &Entry, durability: Durability) -> Outcome {
    // A panic is our own fault and is reported as such; the other jobs continue.
    let caught = std::panic::catch_unwind(|| one(entry, durability));
    let state = caught.unwrap_or_else(|_| Err(Diag::bug("panic", "an invariant of the program broke").into()));
    Outcome { job: entry.path.clone(), folder: entry.folder.clone(), state: state.unwrap_or_else(State::Failed) }
}

fn one(entry: &Entry, durability: Durability) -> Result<State, Error> {
    let job = entry.job.clone()?;
    job_folder::prepare(&entry.folder, job.mode)?;
    if job_folder::is_unchanged(&job, &entry.folder)
        && let Ok(found) = manifest::read(&entry.folder)
    {
        let (stops, time_s) = match found.summary {
            AnySummary::Stepped(s) => (Some(s.stops), s.time_s.total),
            AnySummary::OnTheFly(s) => (None, s.time_s),
        };
        return Ok(State::Unchanged { stops, time_s });
    }
    let plan = plan::plan(job, &|_| {})?;
    job_folder::write_with(&plan, &entry.folder, durability)?;
    let (stops, time_s) = match &plan {
        Plan::Stepped(plan) => (Some(plan.summary.stops), plan.summary.time_s.total),
        Plan::OnTheFly(plan) => (None, plan.summary.time_s),
    };
    Ok(State::Compiled { stops, time_s, warnings: plan.warnings().len() })
}

impl Report {
    /// The highest exit code of all jobs.
    pub fn exit_code(&self) -> u8 {
        let code = |o: &Outcome| if let State::Failed(e) = &o.state { e.exit_code() } else { 0 };
        self.0.iter().map(code).max().unwrap_or(0)
    }

    /// How many were compiled, unchanged, failed.
    pub fn counts(&self) -> [usize; 3] {
        let mut n = [0; 3];
        for o in &self.0 {
            n[match o.state {
                State::Compiled { .. } => 0,
                State::Unchanged { .. } => 1,
                State::Failed(_) => 2,
            }] += 1;
        }
        n
    }

    /// Job time of all jobs whose folders are there, s.
    pub fn time_s(&self) -> f64 {
        let time = |o: &Outcome| match o.state {
            State::Compiled { time_s, .. } | State::Unchanged { time_s, .. } => time_s,
            State::Failed(_) => 0.0,
        };
        self.0.iter().map(time).sum()
    }

    /// The report as JSON.
    pub fn to_json(&self) -> Value {
        let jobs: Vec<Value> = self
            .0
            .iter()
            .map(|o| {
                let mut v = json!({"job": o.job.display().to_string(), "folder": o.folder.display().to_string()});
                match &o.state {
                    State::Compiled { stops, time_s, warnings } => {
                        v["state"] = json!("compiled");
                        v["stops"] = json!(stops);
                        v["time_s"] = json!(time_s);
                        v["warnings"] = json!(warnings);
                    }
                    State::Unchanged { stops, time_s } => {
                        v["state"] = json!("unchanged");
                        v["stops"] = json!(stops);
                        v["time_s"] = json!(time_s);
                    }
                    State::Failed(e) => {
                        v["state"] = json!("failed");
                        v["exit_code"] = json!(e.exit_code());
                        v["errors"] = json!(Failure::from(e).errors);
                    }
                }
                v
            })
            .collect();
        let [compiled, unchanged, failed] = self.counts();
        json!({"compiled": compiled, "unchanged": unchanged, "failed": failed, "exit_code": self.exit_code(),
            "time_s": self.time_s(), "jobs": jobs})
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for o in &self.0 {
            match &o.state {
                State::Compiled { stops, time_s, warnings } => {
                    write!(f, "compiled   {}  ", o.job.display())?;
                    stops.iter().try_for_each(|n| write!(f, "{n} stops, "))?;
                    write!(f, "{:.1} min", time_s / 60.0)?;
                    match warnings {
                        0 => writeln!(f)?,
                        1 => writeln!(f, ", 1 warning")?,
                        n => writeln!(f, ", {n} warnings")?,
                    }
                }
                State::Unchanged { .. } => writeln!(f, "unchanged  {}", o.job.display())?,
                State::Failed(e) => {
                    writeln!(f, "failed     {}", o.job.display())?;
                    for d in e.diags() {
                        for line in d.render(false).lines() {
                            writeln!(f, "           {line}")?;
                        }
                    }
                }
            }
        }
        let [compiled, unchanged, failed] = self.counts();
        let time = manifest::duration(self.time_s());
        writeln!(f, "{compiled} compiled, {unchanged} unchanged, {failed} failed; job time {time} in all")
    }
}
