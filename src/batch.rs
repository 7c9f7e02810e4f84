//! Many jobs: each compiled on its own, unchanged ones skipped, a failing one harming no other.
//!
//! A job is unchanged when its folder's manifest names the same version, seed, job file and inputs by
//! hash, and every file it lists is there with its size. Outcomes stand in the order of the list.

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use serde_json::{Value, json};

use crate::compile;
use crate::diag::{Diag, Error, Place};
use crate::folder;
use crate::machine::Machine;
use crate::spec::Job;

/// One job of a batch.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Entry {
    /// Job file.
    pub job: PathBuf,
    /// Its folder.
    pub folder: PathBuf,
}

/// What became of a job.
#[derive(Debug)]
pub enum State {
    /// Compiled: stops, job time in s, warnings.
    Compiled {
        /// Number of stops.
        stops: usize,
        /// Job time, s.
        time_s: f64,
        /// Number of warnings.
        warnings: usize,
    },
    /// Nothing had changed.
    Unchanged,
    /// It failed; any older folder stands as it was.
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

/// The jobs of a folder (`*.toml`, by name, machine files left out) or of a list file (one path a line, relative to it; `#`
/// begins a comment).
///
/// # Errors
/// Where neither can be read, nothing is listed, or two jobs would write one folder.
pub fn jobs(path: &Path, output: Option<&Path>) -> Result<Vec<Entry>, Error> {
    let place = || Place::file(path.display().to_string());
    let unreadable = |e: std::io::Error| Diag::input("batch-unreadable", format!("cannot read it: {e}")).at(place());
    let mut files = Vec::new();
    // Machine files often lie beside the jobs that name them.
    let is_machine = |file: &Path| Machine::load(file).is_ok();
    if path.is_dir() {
        for entry in std::fs::read_dir(path).map_err(unreadable)? {
            let file = entry.map_err(unreadable)?.path();
            if file.extension().is_some_and(|e| e == "toml") && file.is_file() && !is_machine(&file) {
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
    if files.is_empty() {
        let d = Diag::input("batch-empty", "there is no job").at(place());
        return Err(d.hint("a folder needs *.toml files, a list one job file a line").into());
    }
    let entries: Vec<Entry> = files
        .into_iter()
        .map(|job| {
            let beside = compile::default_output(&job);
            let folder = match (output, beside.file_name()) {
                (Some(o), Some(name)) => o.join(name),
                _ => beside,
            };
            Entry { job, folder }
        })
        .collect();
    for (i, e) in entries.iter().enumerate() {
        if let Some(other) = entries[..i].iter().find(|o| o.folder == e.folder) {
            let text =
                format!("{} and {} would both write {}", other.job.display(), e.job.display(), e.folder.display());
            return Err(Diag::input("batch-clash", text).at(place()).hint("give the job files different names").into());
        }
    }
    Ok(entries)
}

/// Compiles what has changed, as many jobs at a time as there are threads. `told` hears of every job
/// as it ends.
pub fn run(entries: &[Entry], seed: u64, told: &(dyn Fn(&Outcome) + Sync)) -> Report {
    // Plain threads, not tasks of the pool: a thread of the pool that waits for the parts of one job
    // would begin another one meanwhile, and the jobs in memory at a time would have no bound.
    let next = AtomicUsize::new(0);
    let work = || {
        let mut done = Vec::new();
        loop {
            let i = next.fetch_add(1, Ordering::Relaxed);
            let Some(entry) = entries.get(i) else { return done };
            let outcome = outcome(entry, seed);
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

fn outcome(entry: &Entry, seed: u64) -> Outcome {
    // A panic is our own fault and is reported as such; the other jobs go on.
    let caught = std::panic::catch_unwind(|| one(entry, seed));
    let state = caught.unwrap_or_else(|_| Err(Diag::bug("panic", "an invariant of the program broke").into()));
    Outcome { job: entry.job.clone(), folder: entry.folder.clone(), state: state.unwrap_or_else(State::Failed) }
}

fn one(entry: &Entry, seed: u64) -> Result<State, Error> {
    folder::prepare(&entry.folder)?;
    let mut job = Job::load(&entry.job)?;
    job.seed = seed;
    if is_unchanged(&job, &entry.folder, seed) {
        return Ok(State::Unchanged);
    }
    let plan = compile::plan(job, &|_| {})?;
    folder::write(&plan, &entry.folder, seed)?;
    Ok(State::Compiled { stops: plan.summary.stops, time_s: plan.summary.time_s.total, warnings: plan.warnings.len() })
}

/// Whether the folder was made from exactly this job, and is whole.
fn is_unchanged(job: &Job, folder: &Path, seed: u64) -> bool {
    let Ok(bytes) = std::fs::read(folder.join(folder::MANIFEST)) else { return false };
    let Ok(manifest) = serde_json::from_slice::<Value>(&bytes) else { return false };
    let Ok(inputs) = folder::inputs(job) else { return false };
    let same_place = folder::job_file_from(&job.path, folder).is_ok_and(|file| manifest["job"]["file"] == file);
    let same_inputs = manifest["inputs"].as_array().is_some_and(|list| {
        list.len() == inputs.len()
            && list
                .iter()
                .zip(&inputs)
                .all(|(have, want)| have["file"] == want.file.as_str() && have["blake3"] == want.blake3.as_str())
    });
    let whole = manifest["files"].as_array().is_some_and(|list| {
        list.iter().all(|f| {
            let size = f["file"].as_str().and_then(|name| std::fs::metadata(folder.join(name)).ok()).map(|m| m.len());
            size.is_some() && size == f["bytes"].as_u64()
        })
    });
    manifest["terrace"] == env!("CARGO_PKG_VERSION")
        && manifest["seed"] == seed
        && manifest["job"]["blake3"] == blake3::hash(job.source.as_bytes()).to_hex().as_str()
        && same_place
        && same_inputs
        && whole
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
                State::Unchanged => 1,
                State::Failed(_) => 2,
            }] += 1;
        }
        n
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
                    State::Unchanged => v["state"] = json!("unchanged"),
                    State::Failed(e) => {
                        v["state"] = json!("failed");
                        v["exit_code"] = json!(e.exit_code());
                        v["errors"] = e.diags().iter().map(Diag::to_json).collect();
                    }
                }
                v
            })
            .collect();
        let [compiled, unchanged, failed] = self.counts();
        json!({"compiled": compiled, "unchanged": unchanged, "failed": failed, "exit_code": self.exit_code(), "jobs": jobs})
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for o in &self.0 {
            match &o.state {
                State::Compiled { stops, time_s, warnings } => {
                    write!(f, "compiled   {}  {stops} stops, {:.1} min", o.job.display(), time_s / 60.0)?;
                    writeln!(
                        f,
                        "{}",
                        match warnings {
                            0 => String::new(),
                            1 => ", 1 warning".into(),
                            n => format!(", {n} warnings"),
                        }
                    )?;
                }
                State::Unchanged => writeln!(f, "unchanged  {}", o.job.display())?,
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
        writeln!(f, "{compiled} compiled, {unchanged} unchanged, {failed} failed")
    }
}
