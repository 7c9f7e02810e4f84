//! Reader of the `manifest.json` of an on-the-fly job: only what verification needs.

use std::path::Path;

use serde::Deserialize;

use crate::diag::{self, Diag, Error, Place};
use crate::machine::Machine;
use crate::verify::read::manifest::{FileEntry, JobRef, NAME, Placement};

/// Largest manifest that is read.
const MAX_FILE: u64 = 1 << 30;

/// The manifest of an on-the-fly job.
#[derive(Clone, Debug, Deserialize)]
pub(in crate::verify) struct Manifest {
    pub(in crate::verify) schema: u32,
    pub(in crate::verify) job: JobRef,
    pub(in crate::verify) inputs: Vec<FileEntry>,
    pub(in crate::verify) machine: Machine,
    pub(in crate::verify) placement: Placement,
    /// XYZUV or XYZACUV.
    pub(in crate::verify) axes: String,
    pub(in crate::verify) pens: Vec<PenEntry>,
    pub(in crate::verify) files: Vec<FileEntry>,
    pub(in crate::verify) summary: Summary,
}

#[derive(Clone, Debug, Deserialize)]
pub(in crate::verify) struct PenEntry {
    pub(in crate::verify) name: String,
    pub(in crate::verify) speed_mm_s: f64,
    pub(in crate::verify) power_percent: f64,
}

/// The figures that verification finds again.
#[derive(Clone, Debug, Deserialize)]
pub(in crate::verify) struct Summary {
    pub(in crate::verify) moves: usize,
    pub(in crate::verify) marks: usize,
    pub(in crate::verify) time_s: f64,
    pub(in crate::verify) mark_s: f64,
    pub(in crate::verify) worst_displacement_mm: f64,
    pub(in crate::verify) laser_error_mm: f64,
}

/// Whether the folder holds an on-the-fly job.
pub(in crate::verify) fn is_one(folder: &Path) -> bool {
    #[derive(Deserialize)]
    struct Mode {
        mode: String,
    }
    let bytes = diag::read_file(&folder.join(NAME), MAX_FILE).ok();
    bytes.and_then(|b| serde_json::from_slice::<Mode>(&b).ok()).is_some_and(|m| m.mode == "on-the-fly")
}

/// Reads the manifest.
///
/// # Errors
/// `manifest` where it is none of a known version.
pub(in crate::verify) fn read(folder: &Path) -> Result<Manifest, Error> {
    let path = folder.join(NAME);
    let bytes = diag::read_file(&path, MAX_FILE)?;
    let broken = |message: String| {
        Diag::input("manifest", message)
            .at(Place::file(path.display().to_string()))
            .hint("the folder is damaged or of another version: compile it again")
    };
    let manifest: Manifest =
        serde_json::from_slice(&bytes).map_err(|e| broken(format!("the manifest cannot be read: {e}")))?;
    if manifest.schema != 1 {
        return Err(broken(format!("the manifest has schema {}, known is 1", manifest.schema)).into());
    }
    Ok(manifest)
}
