//! Reading of a job file: its text, its TOML, the resolved job.

use std::io::Read;
use std::path::Path;
use std::sync::Arc;

use toml::de::{DeTable, DeValue};

use super::faults::Faults;
use super::file::JobFile;
use super::resolve::resolve;
use super::resolved::{Job, Overrides};
use crate::diag::{self, Diag, Error, Place};

/// Largest job file that is read.
const MAX_FILE: u64 = 4 << 20;

/// Where all keys of a job file are listed.
const KEYS: &str =
    "`terrace init` writes a commented job file; `terrace init --schema` lists every key with its values";

/// Reads the text of a job file.
///
/// # Errors
/// Where it cannot be read, is too large or is not UTF-8.
pub fn read_text(path: &Path, from: &mut dyn Read) -> Result<String, Error> {
    let place = || Place::file(path.display().to_string());
    let mut bytes = Vec::new();
    from.take(MAX_FILE + 1)
        .read_to_end(&mut bytes)
        .map_err(|e| Diag::input("file-unreadable", format!("cannot read the job: {e}")).at(place()))?;
    if bytes.len() as u64 > MAX_FILE {
        let text = format!("cannot read the job: it has more than {MAX_FILE} bytes");
        return Err(Diag::input("file-unreadable", text).at(place()).into());
    }
    let utf8 = String::from_utf8(bytes);
    utf8.map_err(|_| Diag::input("job-utf8", "the job file is not UTF-8 text").at(place()).into())
}

/// Reads the text of the job file at `path`.
///
/// # Errors
/// As [`read_text`].
pub fn read_file(path: &Path) -> Result<String, Error> {
    let bytes = diag::read_file(path, MAX_FILE)?;
    read_text(path, &mut bytes.as_slice())
}

impl Job {
    /// Reads and resolves a job file.
    ///
    /// # Errors
    /// Every fault of the file, each with its place.
    pub fn load(path: &Path, overrides: &Overrides) -> Result<Self, Error> {
        Self::parse(path, &read_file(path)?, overrides)
    }

    /// Resolves the text of a job file that lies, or would lie, at `path`.
    ///
    /// # Errors
    /// As [`Job::load`].
    pub fn parse(path: &Path, text: &str, overrides: &Overrides) -> Result<Self, Error> {
        let source: Arc<str> = text.into();
        if let Some(fault) = single_table(path, &source) {
            return Err(fault.into());
        }
        let file: JobFile = diag::from_toml(&path.display().to_string(), &source, KEYS)?;
        resolve(path, source, &file, overrides)
    }

    /// The place of a key of the job file, such as `partition.section`; the file where it is not given.
    pub fn place_of(&self, key: &str) -> Place {
        Faults::new(&self.path, &self.source).place(key)
    }
}

/// The fault of a table that is written once, `[texture]`, where the file has a list of them.
fn single_table(path: &Path, source: &Arc<str>) -> Option<Diag> {
    let root = DeTable::parse(source).ok()?;
    let (name, table) = ["texture", "pen"].into_iter().find_map(|name| {
        let value = root.get_ref().get(name)?;
        matches!(value.get_ref(), DeValue::Table(_)).then_some((name, value))
    })?;
    let place = Place::Text { path: path.display().to_string(), source: source.clone(), span: table.span() };
    let text = format!("[{name}] is a single table, and a job has a list of them");
    Some(Diag::input("toml", text).at(place).hint(format!("write [[{name}]]")))
}
