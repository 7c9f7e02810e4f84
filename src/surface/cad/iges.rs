//! The records of an IGES file, as far as Open CASCADE relies on them.
//!
//! Consumes the file line by line. Promises records of 80 columns whose sections come in order and are numbered without
//! a gap, a last record whose counts are those of the sections, and numbers that are finite. What the entities mean is
//! left to the reader.

use std::path::Path;

use super::AGAIN;
use crate::diag::{Diag, Error};
use crate::surface::lines::Lines;

/// The sections, in their order: start, global, directory, parameters, end.
const SECTIONS: &[u8; 5] = b"SGDPT";

/// Column of the section's letter, from 0; what is before it is data, the record's number is behind it.
const LETTER: usize = 72;

/// Columns of data in a record of parameters.
const PARAMETERS: usize = 64;

/// Checks a file.
pub(super) fn check(path: &Path) -> Result<(), Error> {
    let mut lines = Lines::open(path, "an IGES file")?;
    let (mut section, mut counts, mut last) = (0, [0u64; 5], Vec::new());
    while lines.advance()? {
        let line = lines.line();
        if line.iter().all(u8::is_ascii_whitespace) {
            continue;
        }
        let fault = |text: String| Error::from(Diag::input("iges-syntax", text).at(lines.place()).hint(AGAIN));
        let Some(&letter) = line.get(LETTER) else {
            return Err(fault(format!(
                "the record has {} columns of 80: the file is cut short or no IGES",
                line.len()
            )));
        };
        if counts == [0; 5] && (letter == b'C' || letter == b'B') {
            return Err(fault("compressed and binary IGES files are not read: export it as ASCII".into()));
        }
        let next = SECTIONS.iter().position(|&s| s == letter);
        let Some(next) = next.filter(|&next| next >= section && section < 4 || next == 4 && counts[4] == 0) else {
            let text = "the letter in column 73 must be S, G, D, P or T, in this order";
            return Err(fault(format!("{text}; it is {:?}", char::from(letter))));
        };
        section = next;
        counts[section] += 1;
        let number = std::str::from_utf8(&line[LETTER + 1..]).ok().and_then(|n| n.trim().parse().ok());
        if number != Some(counts[section]) {
            let text = format!("the record's number is not {}, the next one of section", counts[section]);
            return Err(fault(format!("{text} {}", char::from(letter))));
        }
        if letter == b'P' {
            finite(&line[..PARAMETERS])
                .map_err(|text| Error::from(Diag::input("surface-number", text).at(lines.place()).hint(AGAIN)))?;
        }
        if letter == b'T' {
            last = line[..LETTER].to_vec();
        }
    }
    let fault = |text: &str| Error::from(Diag::input("iges-syntax", text).at(lines.place()).hint(AGAIN));
    if counts[4] == 0 {
        return Err(fault("the file is cut short: the last record, with the letter T in column 73, is missing"));
    }
    // Letter and count of each section, eight columns each.
    let stated =
        |i: usize| -> Option<u64> { std::str::from_utf8(&last[8 * i + 1..8 * i + 8]).ok()?.trim().parse().ok() };
    if (0..4).any(|i| last[8 * i] != SECTIONS[i] || stated(i) != Some(counts[i])) {
        return Err(fault("the last record states other numbers of records than the file has"));
    }
    Ok(())
}

/// Refuses numbers whose exponent no double has. Such a word fills the whole place between two commas.
fn finite(data: &[u8]) -> Result<(), String> {
    for word in data.split(|&b| b == b',' || b == b';') {
        let word = word.trim_ascii();
        let Some(e) = word.iter().position(|b| b"EeDd".contains(b)) else { continue };
        let is_number = |part: &[u8]| !part.is_empty() && part.iter().all(|b| b.is_ascii_digit() || b"+-.".contains(b));
        let (mantissa, exponent) = (&word[..e], &word[e + 1..]);
        let text = String::from_utf8_lossy(word);
        let huge = || text.to_ascii_lowercase().replace('d', "e").parse::<f64>().is_ok_and(|v| !v.is_finite());
        if is_number(mantissa) && is_number(exponent) && huge() {
            return Err(format!("{:?} is not a finite number", text));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(data: &str, letter: char, number: usize) -> String {
        let data = if letter == 'P' { format!("{data:<64}{:>8}", 1) } else { format!("{data:<72}") };
        format!("{data}{letter}{number:>7}\n")
    }

    fn whole() -> Vec<String> {
        vec![
            record("", 'S', 1),
            record(",,4Hpart;", 'G', 1),
            record("     116       1", 'D', 1),
            record("     116       0", 'D', 2),
            record("116,1.E2,-2.D-3,5H1E999;", 'P', 1),
            record("S      1G      1D      2P      1", 'T', 1),
        ]
    }

    fn checked(records: &[String]) -> Result<(), Error> {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("a.igs");
        std::fs::write(&path, records.concat()).expect("written");
        check(&path)
    }

    #[test]
    fn damaged_records_are_named_with_their_line() {
        assert_eq!(checked(&whole()), Ok(()));
        let with = |i: usize, record: String| {
            let mut all = whole();
            all[i] = record;
            all
        };
        for (records, code, line, say) in [
            (with(3, record("     116       0", 'Q', 2)), "iges-syntax", ":4", "'Q'"),
            (with(3, record("     116       0", 'S', 2)), "iges-syntax", ":4", "'S'"),
            (with(3, record("     116       0", 'D', 3)), "iges-syntax", ":4", "number is not 2"),
            (with(4, "116,1.\n".into()), "iges-syntax", ":5", "cut short"),
            (whole()[..5].to_vec(), "iges-syntax", ":5", "cut short"),
            (with(5, record("S      1G      1D      2P      7", 'T', 1)), "iges-syntax", ":6", "other numbers"),
            (with(4, record("116,1.,1.E999999,2;", 'P', 1)), "surface-number", ":5", "1.E999999"),
            (with(0, record("", 'C', 1)), "iges-syntax", ":1", "compressed"),
            ([whole(), whole()].concat(), "iges-syntax", ":7", "in this order"),
        ] {
            let e = checked(&records).expect_err(say);
            let d = &e.diags()[0];
            assert_eq!(d.code, code, "{d}");
            assert!(d.place.to_string().ends_with(line) && d.message.contains(say), "{d}");
        }
    }
}
