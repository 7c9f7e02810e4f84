//! Reading of a job file: its text, its TOML, the resolved job.

use std::io::Read;
use std::path::Path;
use std::sync::Arc;

use super::faults::Faults;
use super::file::JobFile;
use super::not_a_job;
use super::resolve::resolve;
use super::resolved::{Job, Overrides};
use super::texture::by_source;
use terrace_core::diag::{self, Diag, Error, Place, TableKey};

/// Largest job file that is read.
const MAX_FILE: u64 = 4 << 20;

/// Where all keys of a job file are listed.
const KEYS: &str =
    "`terrace init` writes a commented job file; `terrace init --schema` lists every key with its values";

/// The tables of a job file.
const TABLES: [TableKey; 17] = {
    const fn optional(name: &'static str) -> TableKey {
        TableKey { name, is_list: false, needed: None }
    }
    const fn optional_list(name: &'static str) -> TableKey {
        TableKey { name, is_list: true, needed: None }
    }
    const fn needed(name: &'static str, hint: &'static str) -> TableKey {
        TableKey { name, is_list: false, needed: Some(hint) }
    }
    const fn needed_list(name: &'static str, hint: &'static str) -> TableKey {
        TableKey { name, is_list: true, needed: Some(hint) }
    }
    [
        needed("surface", "add [surface] with the file of the part and its unit"),
        optional("surface.heightmap"),
        optional("placement"),
        optional("placement.measured"),
        optional_list("fixture"),
        optional_list("marked"),
        needed_list("texture", "add a [[texture]] with pattern, file or curves: what is marked"),
        needed("focus", "add [focus] with pdof = \"0.07 mm\", measured on your process"),
        optional("partition"),
        optional("order"),
        optional("passes"),
        optional("setups"),
        optional("limits"),
        optional("dose"),
        needed("machine", "add [machine] with profile = \"xyz-galvo-40\", or file = \"machine.toml\""),
        needed_list("pen", "add a [[pen]] at the end of the file, with its name, speed, power and frequency"),
        optional("emit"),
    ]
};

/// Reads the text of a job file.
///
/// # Errors
/// `file-unreadable`, `job-utf8`.
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
    diag::utf8(bytes).map_err(|e| {
        let d = Diag::input("job-utf8", format!("the job file is {e}"));
        e.at(d, path.display().to_string()).into()
    })
}

/// Reads the text of the job file at `path`.
///
/// # Errors
/// Those of [`read_text`]; `not-a-job` for a folder, and for a file whose name says that it is something else.
pub fn read_file(path: &Path) -> Result<String, Error> {
    if let Some(fault) = not_a_job::by_name(path) {
        return Err(fault.into());
    }
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
    /// Those of [`Job::load`].
    pub fn parse(path: &Path, text: &str, overrides: &Overrides) -> Result<Self, Error> {
        let source: Arc<str> = text.into();
        if let Some(fault) = not_a_job::by_keys(path, &source) {
            return Err(fault.into());
        }
        // Missing tables, each with a hint. What is not TOML passes, and is reported when it is parsed.
        let table_faults = diag::table_faults(path, &source, "job file", &TABLES);
        if !table_faults.is_empty() {
            return Err(Error::many(table_faults));
        }
        let shown = path.display().to_string();
        let mut table = diag::parse_toml(&shown, &source, KEYS)?;
        let mut faults = Faults::new(path, &source);
        // A texture that lacks what its source needs cannot be typed: that would be a second fault for the same slip.
        let may_be_typed = by_source::split_keys(table.get_mut(), &mut faults);
        let key_faults = faults.list;
        if !may_be_typed {
            return Err(Error::many(key_faults));
        }
        let file: JobFile = match diag::from_table(&shown, &source, table, KEYS) {
            Ok(file) => file,
            Err(e) => return Err(Error::many([key_faults, e.diags().to_vec()].concat())),
        };
        let job = resolve(path, Arc::clone(&source), &file, overrides, key_faults)?;
        let backslashes = job.backslashes();
        if backslashes.is_empty() { Ok(job) } else { Err(Error::many(backslashes)) }
    }

    /// The place of a key of the job file, such as `partition.section`; the file where it is not given.
    pub fn place_of(&self, key: &str) -> Place {
        Faults::new(&self.path, &self.source).place(key)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_table_of_the_schema_is_listed_as_what_it_is() {
        diag::lists_all_of(&crate::job::json_schema(), &TABLES, &["inside", "outside"]);
    }
}
