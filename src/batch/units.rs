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
pub enum Chosen {
    /// By their numbers.
    Numbers(Vec<RangeInclusive<usize>>),
    /// One of so many shares of about the same expected cost; counted from 1.
    Share(usize, usize),
}

impl FromStr for Chosen {
    type Err = String;

    /// `3`, `0-9,12`, or `3/40`: the third of forty shares.
    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("{text:?} is neither units such as 0-9,12 nor a share such as 3/40");
        let number = |text: &str| text.trim().parse::<usize>().map_err(|_| wrong());
        if let Some((share, of)) = text.split_once('/') {
            let (share, of) = (number(share)?, number(of)?);
            return if (1..=of).contains(&share) { Ok(Self::Share(share, of)) } else { Err(wrong()) };
        }
        let range = |part: &str| match part.split_once('-') {
            Some((from, to)) => Ok(number(from)?..=number(to)?),
            None => number(part).map(|n| n..=n),
        };
        let ranges = text.split(',').map(range).collect::<Result<Vec<_>, String>>()?;
        if ranges.iter().any(RangeInclusive::is_empty) { Err(wrong()) } else { Ok(Self::Numbers(ranges)) }
    }
}

impl Chosen {
    /// The units that are meant, in the order in which they are to be worked on.
    ///
    /// # Errors
    /// `unit-unknown` where the file has no unit of a number.
    pub fn of<'a>(&self, units: &'a [Unit], file: &Path) -> Result<Vec<&'a Unit>, Error> {
        match self {
            Self::Share(share, of) => Ok(shares(units, *of).swap_remove(share - 1)),
            Self::Numbers(ranges) => {
                let one = |id: usize| {
                    units.get(id).ok_or_else(|| {
                        let text = format!("there is no unit {id}; the file has {} units, from 0", units.len());
                        Diag::input("unit-unknown", text).at(Place::file(file.display().to_string())).into()
                    })
                };
                ranges.iter().cloned().flatten().map(one).collect()
            }
        }
    }
}

/// Numbers of units as [`Chosen`] reads them.
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
    let shown = file.display().to_string();
    let fault = |line: usize, what: String| {
        let d = Diag::input("units-file", what).at(Place::line(shown.clone(), line + 1));
        Error::from(d.hint("make the file with `terrace batch … --plan FILE`, with this version of terrace"))
    };
    let lines = bytes.split(|&b| b == b'\n').filter(|line| !line.is_empty()).enumerate();
    let units: Vec<Unit> = lines
        .map(|(i, line)| serde_json::from_slice(line).map_err(|e| fault(i, format!("this is not a unit: {e}"))))
        .collect::<Result<_, _>>()?;
    if let Some((i, unit)) = units.iter().enumerate().find(|(i, unit)| unit.id != *i) {
        return Err(fault(i, format!("the unit has the number {}, its line is that of number {i}", unit.id)));
    }
    if let Some(unit) = units.iter().find(|unit| unit.terrace != env!("CARGO_PKG_VERSION")) {
        let text = format!("terrace {} planned these units, this is {}", unit.terrace, env!("CARGO_PKG_VERSION"));
        let d = Diag::input("units-version", text).at(Place::file(file.display().to_string()));
        return Err(d.hint("install the same version on all machines, and plan again").into());
    }
    Ok(units)
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
        let read = |text: &str| text.parse::<Chosen>();
        assert_eq!(read("3"), Ok(Chosen::Numbers(vec![3..=3])));
        assert_eq!(read("0-9,12"), Ok(Chosen::Numbers(vec![0..=9, 12..=12])));
        assert_eq!(read("3/40"), Ok(Chosen::Share(3, 40)));
        for wrong in ["", "a", "1-", "5-2", "0/3", "4/3", "1,,2"] {
            assert!(read(wrong).is_err(), "{wrong}");
        }
    }
}
