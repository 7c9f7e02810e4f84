//! A unit: what one engine task may do, named by the hash of all that its result depends on.
//!
//! Units share nothing. Paths are those that were typed, so a unit is worked on in the folder in which it was planned,
//! or in a copy of that folder.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use serde::ser::Error as _;
use serde::{Deserialize, Serialize, Serializer};

use terrace_input::job::{Job, Overrides, Setting};
use terrace_plan::manifest::InputFact;
use terrace_report::job_folder::Hashes;

/// What a job costs whatever its size, s of one core.
const COST_OF_A_JOB_S: f64 = 0.02;

/// Bytes of input files that cost a second of one core, by their role: a drawing has more marks to a byte than a
/// surface. Measured on the jobs of `benches/fleet.rs`; a job of a pattern can cost a hundred times more than its
/// files say, which is why groups are small and are given out one by one.
const BYTES_A_SECOND: [(&str, f64); 2] = [("surface", 8e6), ("texture", 4e5)];

/// One line of a file of units.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Unit {
    /// The number of the unit, from 0, in the order of the list.
    pub id: usize,
    /// Version of the program that planned it.
    pub terrace: String,
    /// The job file's name without extension.
    pub name: String,
    /// The job file.
    #[serde(serialize_with = "with_slashes")]
    pub job: PathBuf,
    /// What is to be done with it.
    pub task: Task,
    /// What the command line set over its keys.
    pub overrides: Overrides,
    /// The input files of the job but itself; empty where the job cannot be read.
    pub inputs: Vec<InputFact>,
    /// Of everything that the result depends on, hex.
    pub hash: String,
    /// What the sizes of its files let expect, s of one core.
    pub cost_s: f64,
}

/// What is to be done with a job.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Task {
    /// The unit's folder is brought up to date.
    Compile(Compile),
    /// The job is planned with some combinations of settings.
    Sweep(Combinations),
}

/// A folder to bring up to date.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Compile {
    /// The folder.
    #[serde(serialize_with = "with_slashes")]
    pub folder: PathBuf,
    /// Whether it is verified, an unchanged one too.
    pub verify: bool,
    /// Whether layout, maps, report and view are drawn.
    #[serde(default = "drawn")]
    pub pictures: bool,
}

fn drawn() -> bool {
    true
}

/// A path with `/` between its names, which every system reads: what Windows plans Linux may work on.
pub(super) fn with_slashes<S: Serializer>(path: &Path, serializer: S) -> Result<S::Ok, S::Error> {
    let text = path.to_str().ok_or_else(|| S::Error::custom("path contains invalid UTF-8 characters"))?;
    serializer.serialize_str(&if cfg!(windows) { text.replace('\\', "/") } else { text.to_owned() })
}

/// Some combinations of a sweep.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Combinations {
    /// All settings.
    pub settings: Vec<Setting>,
    /// The first combination.
    pub first: usize,
    /// How many there are.
    pub count: usize,
}

impl Unit {
    /// A unit of the job file at `path`; `job` is None where it cannot be read.
    pub(super) fn new(
        id: usize,
        path: &Path,
        task: Task,
        overrides: &Overrides,
        job: Option<&Job>,
        hashes: &Hashes,
    ) -> Self {
        // A job whose inputs cannot be read fails when it is compiled, and says why.
        let inputs = job.and_then(|job| hashes.inputs(job).ok()).unwrap_or_default();
        let size: f64 = inputs.iter().map(|input| input.bytes as f64 / rate(&input.role)).sum();
        let times = if let Task::Sweep(some) = &task { some.count } else { 1 };
        let hash = hash(job, &task, overrides, &inputs);
        let name = path.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
        let cost_s = (COST_OF_A_JOB_S + size) * times as f64;
        let terrace = env!("CARGO_PKG_VERSION").into();
        Self { id, terrace, name, job: path.to_owned(), task, overrides: *overrides, inputs, hash, cost_s }
    }

    /// The folder that it makes; the job file itself where it makes none.
    pub fn folder(&self) -> &Path {
        match &self.task {
            Task::Compile(compile) => &compile.folder,
            Task::Sweep(_) => &self.job,
        }
    }

    /// The files that it reads, its own first, as they can be opened.
    pub fn input_paths(&self) -> Vec<PathBuf> {
        let around = self.job.parent().unwrap_or(Path::new(""));
        let others = self.inputs.iter().map(|input| around.join(&input.file));
        std::iter::once(self.job.clone()).chain(others).collect()
    }
}

/// Bytes that cost a second.
fn rate(role: &str) -> f64 {
    BYTES_A_SECOND.iter().find(|(name, _)| *name == role).map_or(f64::INFINITY, |(_, rate)| *rate)
}

/// The hash of a unit whose job has these inputs now.
pub(super) fn hash(job: Option<&Job>, task: &Task, overrides: &Overrides, inputs: &[InputFact]) -> String {
    let json = |value: serde_json::Result<String>| value.unwrap_or_default();
    let task = json(serde_json::to_string(task));
    let overrides = json(serde_json::to_string(overrides));
    let inputs = json(serde_json::to_string(inputs));
    let mut hasher = blake3::Hasher::new();
    for part in [
        env!("CARGO_PKG_VERSION"),
        job.map_or("", |job| &job.source),
        job.and_then(|job| job.path.file_name()).and_then(OsStr::to_str).unwrap_or(""),
        &task,
        &overrides,
        &inputs,
    ] {
        // Lengths keep parts apart.
        hasher.update(&(part.len() as u64).to_le_bytes());
        hasher.update(part.as_bytes());
    }
    hasher.finalize().to_hex().to_string()
}
