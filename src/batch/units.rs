//! A file of units, one JSON object a line, and which of them are meant.
//!
//! Beside the file `NAME.jsonl` lies the folder `NAME.reports`, in which every unit that was worked on leaves a report.

use std::fs;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use super::unit::Unit;
use super::units_per_process::shares;
use terrace_core::diag::{self, Diag, Error, Place};
use terrace_report::job_folder::{self, Durability};

/// Largest file of units that is read: some 1000 bytes for each of a million units.
const MAX_FILE: u64 = 1 << 30;

/// Which units of a file are meant.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum UnitSelection {
    /// By their numbers.
    Numbers(Vec<RangeInclusive<usize>>),
    /// One of so many shares of about the same expected cost; counted from 1.
    Share(usize, usize),
}

impl FromStr for UnitSelection {
    type Err = String;

    /// `3`, `0-9,12`, or `3/40`: the third of forty shares.
    fn from_str(text: &str) -> Result<Self, String> {
        let chosen = match text.split_once('/') {
            Some((share, count)) => share_of(share, count),
            None => text.split(',').map(range).collect::<Option<Vec<_>>>().map(Self::Numbers),
        };
        chosen.ok_or_else(|| format!("{text:?} is neither units such as 0-9,12 nor a share such as 3/40"))
    }
}

/// The share of that number, from 1, of so many.
fn share_of(share: &str, count: &str) -> Option<UnitSelection> {
    let share = number(share)?;
    let count = number(count)?;
    (1..=count).contains(&share).then_some(UnitSelection::Share(share, count))
}

/// One number, or a range such as `0-9`; None where it is neither, or empty.
fn range(text: &str) -> Option<RangeInclusive<usize>> {
    let (from, to) = text.split_once('-').unwrap_or((text, text));
    let range = number(from)?..=number(to)?;
    (!range.is_empty()).then_some(range)
}

fn number(text: &str) -> Option<usize> {
    text.trim().parse().ok()
}

impl UnitSelection {
    /// The units that are meant, in the order in which they are to be worked on.
    ///
    /// # Errors
    /// `unit-unknown` where the file has no unit of a number.
    pub fn of<'a>(&self, units: &'a [Unit], file: &Path) -> Result<Vec<&'a Unit>, Error> {
        match self {
            Self::Share(share, of) => Ok(shares(units, *of).swap_remove(share - 1)),
            Self::Numbers(ranges) => ranges.iter().cloned().flatten().map(|id| unit_of(units, id, file)).collect(),
        }
    }
}

/// The unit of a number.
fn unit_of<'a>(units: &'a [Unit], id: usize, file: &Path) -> Result<&'a Unit, Error> {
    units.get(id).ok_or_else(|| {
        let text = format!("there is no unit {id}; the file has {} units, from 0", units.len());
        Diag::input("unit-unknown", text).at(Place::file(file.display().to_string())).into()
    })
}

/// Numbers of units as [`UnitSelection`] reads them.
#[cfg(feature = "fleet")]
pub(super) fn numbers(ids: &[usize]) -> String {
    ids.iter().map(ToString::to_string).collect::<Vec<_>>().join(",")
}

/// Writes a file of units, and removes the reports of units that lay beside it.
///
/// # Errors
/// `unit-path` where a path cannot be written as text; what the file system refuses.
pub fn write(units: &[Unit], file: &Path, durability: Durability) -> Result<(), Error> {
    let mut text = String::new();
    for unit in units {
        let line = serde_json::to_string(unit).map_err(|e| {
            let d = Diag::input("unit-path", format!("the job cannot be written to a file of units: {e}"));
            d.at(Place::file(unit.job.display().to_string())).hint("use file names that are UTF-8 text")
        })?;
        text.push_str(&line);
        text.push('\n');
    }
    // Reports are named by the number of a unit alone: those of an older plan would be taken for reports of this one. They
    // go first, so that a new file never has old reports.
    let reports = reports(file);
    if reports.is_dir() {
        fs::remove_dir_all(&reports).map_err(|e| unwritable("remove the reports of an older plan", &reports, &e))?;
    }
    job_folder::write_file(file, text.as_bytes(), durability)
}

/// Reads a file of units of this version.
///
/// # Errors
/// `units-file` with the line that is not a unit; `units-version` where another version planned them.
pub fn read(file: &Path) -> Result<Vec<Unit>, Error> {
    let bytes = diag::read_file(file, MAX_FILE)?;
    let mut units: Vec<Unit> = Vec::new();
    for (i, line) in bytes.split(|&b| b == b'\n').filter(|line| !line.is_empty()).enumerate() {
        units.push(serde_json::from_slice(line).map_err(|e| no_unit(file, i, format!("this is not a unit: {e}")))?);
    }
    if let Some((i, unit)) = units.iter().enumerate().find(|(i, unit)| unit.id != *i) {
        let text = format!("the unit has the number {}, its line is that of number {i}", unit.id);
        return Err(no_unit(file, i, text));
    }
    if let Some(unit) = units.iter().find(|unit| unit.terrace != env!("CARGO_PKG_VERSION")) {
        let text = format!("terrace {} planned these units, this is {}", unit.terrace, env!("CARGO_PKG_VERSION"));
        let d = Diag::input("units-version", text).at(Place::file(file.display().to_string()));
        return Err(d.hint("install the same version on all machines, and plan again").into());
    }
    Ok(units)
}

/// The fault of the line of unit `i`.
fn no_unit(file: &Path, i: usize, text: String) -> Error {
    let d = Diag::input("units-file", text).at(Place::line(file.display().to_string(), i + 1));
    d.hint("make the file with `terrace batch … --plan FILE`, with this version of terrace").into()
}

/// The folder of the reports of a file of units.
pub fn reports(file: &Path) -> PathBuf {
    file.with_extension("reports")
}

pub(super) fn unwritable(what: &str, path: &Path, e: &std::io::Error) -> Error {
    let d = Diag::input("output-unwritable", format!("cannot {what}: {e}"));
    d.at(Place::file(path.display().to_string())).hint("check path, space and permissions").into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_chosen_by_numbers_and_shares() {
        let read = |text: &str| text.parse::<UnitSelection>();
        assert_eq!(read("3"), Ok(UnitSelection::Numbers(vec![3..=3])));
        assert_eq!(read("0-9,12"), Ok(UnitSelection::Numbers(vec![0..=9, 12..=12])));
        assert_eq!(read("3/40"), Ok(UnitSelection::Share(3, 40)));
        for wrong in ["", "a", "1-", "5-2", "0/3", "4/3", "1,,2"] {
            assert!(read(wrong).is_err(), "{wrong}");
        }
    }
}
