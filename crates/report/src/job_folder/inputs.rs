//! The input files of jobs by their hashes, each file read once.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use super::place;
use terrace_core::diag::{Diag, Error};
use terrace_input::job::Job;
use terrace_plan::manifest::{self, InputFact};

/// Size and hash of a file, or why it cannot be read.
type Hash = Result<(u64, String), Error>;

/// Hashes of files, for jobs that share them. What a file holds when it is first asked for counts.
#[derive(Debug, Default)]
pub struct Hashes(Mutex<BTreeMap<PathBuf, Arc<OnceLock<Hash>>>>);

impl Hashes {
    /// Every file that a job names, with its size and hash; one that is named twice for the same use, once.
    ///
    /// # Errors
    /// Where a file cannot be read.
    pub fn inputs(&self, job: &Job) -> Result<Vec<InputFact>, Error> {
        let mut seen = BTreeSet::new();
        job.input_files()
            .into_iter()
            .filter(|input| seen.insert(*input))
            .map(|(role, file)| {
                let (bytes, blake3) = self.of(&job.relative(file))?;
                let shown = manifest::portable(&file.to_string_lossy());
                Ok(InputFact { role: role.into(), file: shown, bytes, blake3 })
            })
            .collect()
    }

    /// Size and hash of a file, which is read where it has not been asked for before.
    fn of(&self, path: &Path) -> Hash {
        let known = Arc::clone(self.0.lock().unwrap_or_else(PoisonError::into_inner).entry(path.into()).or_default());
        known.get_or_init(|| hash(path)).clone()
    }
}

/// Every input file of a job but the job file itself, with its hash.
///
/// # Errors
/// Where a file cannot be read.
pub fn inputs(job: &Job) -> Result<Vec<InputFact>, Error> {
    Hashes::default().inputs(job)
}

fn hash(path: &Path) -> Hash {
    let unreadable =
        |e| Error::from(Diag::input("file-unreadable", format!("cannot read the file: {e}")).at(place(path)));
    let mut hasher = blake3::Hasher::new();
    let opened = File::open(path).map_err(unreadable)?;
    hasher.update_reader(opened).map_err(unreadable)?;
    Ok((hasher.count(), hasher.finalize().to_hex().to_string()))
}
