//! The report of one unit: a file of its own, written whole or not at all, so that units on many machines need not
//! wait for each other.

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::unit::Unit;
use super::units::unwritable;
use super::work::{End, WorkResult};
use terrace_core::diag::Error;
use terrace_report::job_folder::{self, Durability};

/// What a unit says of itself when it has ended.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Fragment {
    /// The number of the unit.
    pub unit: usize,
    /// The hash of what the job and its inputs were.
    pub hash: String,
    /// The machine that worked on it.
    pub host: String,
    /// How long that took, s.
    pub seconds: f64,
    /// What became of it.
    pub end: End,
}

impl Fragment {
    /// The fragment of a unit that was worked on here.
    pub fn new(unit: &Unit, result: WorkResult, seconds: f64) -> Self {
        Self { unit: unit.id, hash: result.hash, host: terrace_core::host::name(), seconds, end: result.end }
    }

    /// Writes it into the folder of reports, over one of an earlier try.
    ///
    /// # Errors
    /// What the file system refuses.
    pub fn write(&self, reports: &Path, durability: Durability) -> Result<(), Error> {
        // Not the folders around it: once they are removed nobody waits for the report any more.
        match fs::create_dir(reports) {
            Err(e) if e.kind() != ErrorKind::AlreadyExists => return Err(unwritable("make the folder", reports, &e)),
            _ => {}
        }
        let text = serde_json::to_string(self).expect("a unit was read from JSON, and so can be what became of it");
        // Two processes, on two machines even, may end the same unit at the same time.
        let new = reports.join(format!(".{}.{}.{}", self.unit, self.host, std::process::id()));
        job_folder::write_file(&new, text.as_bytes(), durability)?;
        let whole = file(reports, self.unit);
        fs::rename(&new, &whole).map_err(|e| unwritable("put the report in place", &whole, &e))
    }

    /// Reads the fragment of a unit; None where there is none, or none that is whole.
    pub fn read(reports: &Path, unit: usize) -> Option<Self> {
        serde_json::from_slice(&fs::read(file(reports, unit)).ok()?).ok()
    }
}

/// The file of the report of a unit.
fn file(reports: &Path, unit: usize) -> PathBuf {
    reports.join(format!("{unit:06}.json"))
}
