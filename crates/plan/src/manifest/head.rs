//! What every manifest begins with, and its text. The verifier has a reader of its own.

use std::path::Path;

use serde::de::IgnoredAny;
use serde::{Deserialize, Serialize};

use terrace_core::diag::{self, Diag, Error, Place};
use terrace_input::job::{Job, Mode, Objective};

/// The name of the file that makes a folder a job folder; written last.
pub const MANIFEST: &str = "manifest.json";

/// Version of the manifest's keys.
const SCHEMA: u32 = 4;

/// Largest manifest that is read: some 600 bytes for each of a million blocks.
pub const MAX_FILE: u64 = 1 << 30;

/// A path as manifests and run sheets have it: on Windows with `/` for its backslashes, which elsewhere belong to
/// names.
pub fn portable(path: &str) -> String {
    if cfg!(windows) { path.replace('\\', "/") } else { path.to_owned() }
}

/// An input file of the job.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct InputFact {
    /// What it is for: `surface`, `texture`, `machine`.
    pub role: String,
    /// The path of the file, relative to the job file.
    pub file: String,
    /// The size of the file.
    pub bytes: u64,
    /// BLAKE3 of its bytes, hex.
    pub blake3: String,
}

/// A file of the job folder.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct FileFact {
    /// The path of the file inside the folder.
    pub file: String,
    /// The size of the file.
    pub bytes: u64,
    /// BLAKE3 of its bytes, hex.
    pub blake3: String,
}

/// The job file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct JobRef {
    /// The path of the job file from inside the job folder.
    pub file: String,
    /// BLAKE3 of its text, hex.
    pub blake3: String,
}

/// The keys that both modes have.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Head {
    /// Version of the keys.
    pub schema: u32,
    /// Version of the program.
    pub terrace: String,
    /// How the part is marked.
    pub mode: Mode,
    /// The job file.
    pub job: JobRef,
    /// The other input files.
    pub inputs: Vec<InputFact>,
    /// Seed of everything random.
    pub seed: u64,
    /// What `auto` minimised.
    pub objective: Objective,
    /// The files of the folder but the manifest.
    pub files: Vec<FileFact>,
    /// Whether the folder holds some blocks of the job alone.
    #[serde(default, rename = "subset", skip_serializing, deserialize_with = "is_there")]
    pub is_subset: bool,
}

/// Whatever the value is.
fn is_there<'a, D: serde::Deserializer<'a>>(value: D) -> Result<bool, D::Error> {
    IgnoredAny::deserialize(value).map(|_| true)
}

impl Head {
    /// The head for a new job folder that holds all blocks; `file` is the path of the job file from inside the folder.
    /// The caller adds the files of the folder.
    pub fn new(job: &Job, file: String, inputs: Vec<InputFact>) -> Self {
        let blake3 = blake3::hash(job.source.as_bytes()).to_hex().to_string();
        Self {
            schema: SCHEMA,
            terrace: env!("CARGO_PKG_VERSION").into(),
            mode: job.mode,
            job: JobRef { file, blake3 },
            inputs,
            seed: job.seed,
            objective: job.partition.objective,
            files: Vec::new(),
            is_subset: false,
        }
    }

    /// Reads that of a job folder.
    ///
    /// # Errors
    /// `manifest` where the folder holds none of this version; `file-…` where it cannot be read.
    pub fn read(folder: &Path) -> Result<Self, Error> {
        parse(folder, &bytes(folder)?)
    }

    /// Whether the folder would be made alike again: the same program, job, inputs and settings.
    pub fn is_same(&self, other: &Self) -> bool {
        Self { files: Vec::new(), ..self.clone() } == Self { files: Vec::new(), ..other.clone() }
    }
}

/// A manifest with other facts of one of its files; everything else stays as it is.
///
/// # Errors
/// `manifest-reread` where it is not one.
pub fn with_file(manifest: &[u8], fact: &FileFact) -> Result<Vec<u8>, Error> {
    let broken = || Error::from(Diag::bug("manifest-reread", "a manifest that was just written cannot be read again"));
    let mut document: serde_json::Value = serde_json::from_slice(manifest).map_err(|_| broken())?;
    let files = document.get_mut("files").and_then(serde_json::Value::as_array_mut).ok_or_else(broken)?;
    let old = files.iter_mut().find(|file| file["file"] == fact.file.as_str()).ok_or_else(broken)?;
    *old = serde_json::to_value(fact).map_err(|_| broken())?;
    Ok(text(&document, manifest.len()))
}

/// The text of a document, of about this length: JSON, a line feed at the end.
pub(super) fn text(document: &impl Serialize, length: usize) -> Vec<u8> {
    let mut out = Vec::with_capacity(length);
    serde_json::to_writer_pretty(&mut out, document).expect("a Vec takes every byte, and all keys are text");
    out.push(b'\n');
    out
}

pub(super) fn bytes(folder: &Path) -> Result<Vec<u8>, Error> {
    diag::read_file(&folder.join(MANIFEST), MAX_FILE)
}

pub(super) fn parse<'a, T: Deserialize<'a>>(folder: &Path, bytes: &'a [u8]) -> Result<T, Error> {
    serde_json::from_slice(bytes).map_err(|e| {
        Diag::input("manifest", format!("this is not a manifest of this version: {e}"))
            .at(Place::file(folder.join(MANIFEST).display().to_string()))
            .hint("compile the job again")
            .into()
    })
}
