//! The records of an IGES file, as far as Open CASCADE relies on them.
//!
//! Consumes the file line by line. Promises records of 80 columns whose sections come in order and are numbered without
//! a gap, a last record whose counts are those of the sections, numbers that are finite, and sizes that are those of
//! the part: a scale of 1, and a unit whose flag and name agree. What the entities mean is left to the reader.

use std::path::Path;

use super::AGAIN;
use super::answer::no_unit;
use crate::surface::lines::{Lines, place};
use terrace_core::diag::{Diag, Error};

/// The sections, in their order: start, global, directory, parameters, end.
const SECTIONS: &[u8; 5] = b"SGDPT";

/// Column of the section's letter, from 0; what is before it is data, the record's number is behind it.
const LETTER: usize = 72;

/// Columns of data in a record of parameters.
const PARAMETERS: usize = 64;

/// Checks a file.
pub(super) fn check(path: &Path) -> Result<(), Error> {
    let mut lines = Lines::open(path, "an IGES file")?;
    let mut section = 0;
    let mut counts = [0u64; 5];
    let mut last = Vec::new();
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

/// Refuses a scale other than 1, and a unit that is stated twice and differs.
pub(super) fn check_scale(path: &Path, notes: &mut Vec<Diag>) -> Result<(), Error> {
    let global = parameters(&global_section(path)?)
        .map_err(|text| Diag::input("iges-syntax", text).at(place(path)).hint(AGAIN))?;
    let stated = |number: usize| global.get(number - 1).map_or("", String::as_str);
    let scale = stated(SCALE);
    if !scale.is_empty() && real(scale) != Some(1.0) {
        let text = format!("the file has a model space scale of {scale} (global parameter {SCALE})");
        let hint = "export it again at a scale of 1: its numbers are not the sizes of the part";
        return Err(Diag::input("iges-scale", text).at(place(path)).hint(hint).into());
    }
    match compared(stated(FLAG), stated(NAME)) {
        Unit::Agrees => Ok(()),
        Unit::Absent => Err(no_unit().at(place(path)).into()),
        Unit::Odd(text) => {
            let hint = "compare the box that `terrace inspect` prints with the CAD program";
            notes.push(Diag::warning("iges-unit", text).at(place(path)).hint(hint));
            Ok(())
        }
        Unit::Unclear(text) => {
            let hint = format!("correct global parameter {FLAG} (flag) or {NAME} (name) by exporting it again");
            Err(Diag::input("iges-unit", text).at(place(path)).hint(hint).into())
        }
    }
}

/// Numbers of global parameters: model space scale, flag and name of the unit.
const SCALE: usize = 13;
const FLAG: usize = 14;
const NAME: usize = 15;

/// Most bytes of the global section; real ones have some hundred.
const MAX_GLOBAL: usize = 1 << 20;

/// Units by their flags: length in mm, and names in capitals. The first is that of the standard.
const UNITS: [(f64, &[&str]); 11] = [
    (25.4, &["INCH", "IN", "INCHES"]),
    (1.0, &["MM", "MILLIMETER", "MILLIMETRE", "MILLIMETERS", "MILLIMETRES"]),
    (f64::NAN, &[]),
    (304.8, &["FT", "FOOT", "FEET"]),
    (1_609_344.0, &["MI", "MILE", "MILES"]),
    (1e3, &["M", "METER", "METRE", "METERS", "METRES"]),
    (1e6, &["KM", "KILOMETER", "KILOMETRE", "KILOMETERS", "KILOMETRES"]),
    (0.0254, &["MIL", "MILS"]),
    (1e-3, &["UM", "MICRON", "MICRONS", "MICROMETER", "MICROMETRE"]),
    (10.0, &["CM", "CENTIMETER", "CENTIMETRE", "CENTIMETERS", "CENTIMETRES"]),
    (2.54e-5, &["UIN", "MICROINCH", "MICROINCHES"]),
];

/// The flag by which only the name counts.
const BY_NAME: usize = 3;

/// Names as the standard has them, the only ones by which Open CASCADE takes a unit; all others are mm to it.
const STANDARD: [&str; 11] = ["INCH", "IN", "MM", "FT", "MI", "M", "KM", "MIL", "UM", "CM", "UIN"];

/// How flag and name of the unit go together.
#[derive(Debug, PartialEq)]
enum Unit {
    Agrees,
    /// There is neither.
    Absent,
    /// The unit is clear, but one of the two ways to state it is not that of IGES.
    Odd(String),
    /// The unit is not clear, or Open CASCADE takes it for another one.
    Unclear(String),
}

fn compared(flag: &str, name: &str) -> Unit {
    let capitals = name.to_ascii_uppercase();
    let named = UNITS.iter().find(|(_, names)| names.contains(&capitals.as_str()));
    let number = flag.parse().ok().filter(|&n: &usize| (1..=UNITS.len()).contains(&n));
    let both = format!("flag {flag:?}, name {name:?}");
    let is_unstated = ["", "0"].contains(&flag);
    match (number, named) {
        (Some(BY_NAME) | None, _) if name.is_empty() && (is_unstated || number.is_some()) => Unit::Absent,
        (Some(BY_NAME), Some((mm, _))) if STANDARD.contains(&name) || *mm == 1.0 => Unit::Agrees,
        (None, Some(_)) if is_unstated && STANDARD.contains(&name) => {
            Unit::Odd(format!("the flag of the unit is not one of IGES ({both}): {name} is taken"))
        }
        (Some(BY_NAME) | None, _) => Unit::Unclear(format!("the unit is not one of IGES ({both})")),
        (Some(_), None) if name.is_empty() => Unit::Agrees,
        (Some(n), None) => {
            Unit::Odd(format!("the name of the unit is not one of IGES ({both}): {} is taken", UNITS[n - 1].1[0]))
        }
        (Some(n), Some(named)) if UNITS[n - 1].0 == named.0 => Unit::Agrees,
        (Some(n), Some(named)) => {
            let [by_flag, by_name] = [&UNITS[n - 1], named].map(|(mm, names)| format!("{} ({mm} mm)", names[0]));
            Unit::Unclear(format!("the unit is {by_flag} by its flag and {by_name} by its name ({both})"))
        }
    }
}

/// A number; exponents may have a D.
fn real(text: &str) -> Option<f64> {
    text.to_ascii_uppercase().replace('D', "E").parse().ok()
}

/// The data of the global section.
fn global_section(path: &Path) -> Result<Vec<u8>, Error> {
    let mut lines = Lines::open(path, "an IGES file")?;
    let mut data = Vec::new();
    while lines.advance()? && data.len() < MAX_GLOBAL {
        match lines.line().get(LETTER) {
            Some(b'G') => data.extend_from_slice(&lines.line()[..LETTER]),
            Some(b'S') | None => {}
            Some(_) => break,
        }
    }
    Ok(data)
}

/// The global parameters: texts without their count, everything else as it is.
fn parameters(data: &[u8]) -> Result<Vec<String>, String> {
    let mut out = Vec::new();
    let mut rest = data;
    let mut between = b',';
    let mut end = b';';
    loop {
        rest = rest.trim_ascii_start();
        let (value, after) = match counted(rest)? {
            Some(text) => text,
            None => rest.split_at(rest.iter().position(|&b| b == between || b == end).unwrap_or(rest.len())),
        };
        // The first two state what stands between parameters, and at their end.
        match (out.len(), value) {
            (0, &[b]) => between = b,
            (1, &[b]) => end = b,
            _ => {}
        }
        out.push(String::from_utf8_lossy(value).trim().to_owned());
        let after = after.trim_ascii_start();
        match after.split_first() {
            Some((&b, next)) if b == between => rest = next,
            Some((&b, _)) if b == end => return Ok(out),
            Some(_) => return Err(format!("global parameter {} is followed by no divider", out.len())),
            None => return Ok(out),
        }
    }
}

/// What was split off, and what follows it.
type Split<'a> = (&'a [u8], &'a [u8]);

/// A text with its count before it, such as `2HMM`, and what follows; None where there is none.
fn counted(data: &[u8]) -> Result<Option<Split<'_>>, String> {
    let digits = data.iter().take_while(|b| b.is_ascii_digit()).count();
    if digits == 0 || data.get(digits) != Some(&b'H') {
        return Ok(None);
    }
    let text = &data[digits + 1..];
    let count = std::str::from_utf8(&data[..digits]).ok().and_then(|n| n.parse().ok());
    let parts = count.and_then(|n| text.split_at_checked(n));
    parts.map(Some).ok_or_else(|| "the global section ends inside of a text".into())
}

/// Refuses numbers whose exponent no double has. Such a word fills the whole place between two commas.
fn finite(data: &[u8]) -> Result<(), String> {
    for word in data.split(|&b| b == b',' || b == b';') {
        let word = word.trim_ascii();
        let Some(e) = word.iter().position(|b| b"EeDd".contains(b)) else { continue };
        let is_number = |part: &[u8]| !part.is_empty() && part.iter().all(|b| b.is_ascii_digit() || b"+-.".contains(b));
        let mantissa = &word[..e];
        let exponent = &word[e + 1..];
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

    #[test]
    fn global_parameters_are_divided_as_the_first_two_of_them_say() {
        for (data, want) in [
            (",,4Hpart,3Ha,b,, 1. ;rest", &["", "", "part", "a,b", "", "1."][..]),
            ("1H,,1H;,2H;,,7;", &[",", ";", ";,", "7"]),
            ("1H//1H|/1Ha/2 |", &["/", "|", "a", "2"]),
            (",,5", &["", "", "5"]),
            ("", &[""]),
        ] {
            assert_eq!(parameters(data.as_bytes()).expect("parameters"), want, "{data}");
        }
        for (data, say) in
            [(",,9Hpart;", "inside of a text"), (",,4Hpart x;", "parameter 3"), ("99999999999999999999H", "inside")]
        {
            assert!(parameters(data.as_bytes()).expect_err(data).contains(say), "{data}");
        }
    }

    #[test]
    fn scale_and_unit_are_those_of_the_part() {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("a.igs");
        let checked = |scale: &str, flag: &str, name: &str| {
            let name = if name.is_empty() { String::new() } else { format!("{}H{name}", name.len()) };
            let text = format!("{}{scale},{flag},{name},1,0.01;", ",".repeat(12));
            std::fs::write(&path, [record("", 'S', 1), record(&text, 'G', 1)].concat()).expect("written");
            let mut notes = Vec::new();
            let result = check_scale(&path, &mut notes);
            result.map(|()| notes).map_err(|e| e.diags()[0].clone())
        };
        for (scale, flag, name) in [
            ("1.", "2", "MM"),
            ("", "1", "IN"),
            ("1.0D0", "1", "INCH"),
            ("1.E+00", "6", "m"),
            ("1", "10", "centimeters"),
            ("1", "2", ""),
            ("1", "3", "INCH"),
            ("1", "3", "UM"),
            ("1", "3", "mm"),
        ] {
            assert_eq!(checked(scale, flag, name), Ok(vec![]), "{scale} {flag} {name}");
        }
        for scale in ["0.5", "2", "1.0000001", "0", "-1", "x", "1HA"] {
            let d = checked(scale, "2", "MM").expect_err(scale);
            assert!(d.code == "iges-scale" && d.message.contains("parameter 13"), "{d}");
        }
        let d = checked("1", "1", "MM").expect_err("two units");
        assert_eq!(
            d.message,
            "the unit is INCH (25.4 mm) by its flag and MM (1 mm) by its name (flag \"1\", name \"MM\")"
        );
        // Open CASCADE takes most of these for mm.
        for (flag, name) in [
            ("2", "inches"),
            ("3", "inch"),
            ("3", "cm"),
            ("3", "FURLONG"),
            ("0", "in"),
            ("", "FURLONG"),
            ("12", "MM"),
            ("12", ""),
        ] {
            assert_eq!(checked("1", flag, name).expect_err(name).code, "iges-unit", "{flag} {name}");
        }
        for flag in ["", "0", "3"] {
            assert_eq!(checked("1", flag, "").expect_err(flag).code, "cad-unit", "{flag}");
        }
        for (flag, name, say) in
            [("2", "FURLONG", "MM is taken"), ("0", "IN", "IN is taken"), ("", "MM", "MM is taken")]
        {
            let notes = checked("1", flag, name).expect(say);
            assert!(notes.len() == 1 && notes[0].code == "iges-unit" && notes[0].message.ends_with(say), "{notes:?}");
        }
    }

    #[test]
    fn damaged_files_never_panic() {
        const WORDS: &[&str] =
            &["1H,", "1H;", "99999H", "0H", ",", ";", "3,2HIN", "S", "G", "D", "P", "T", "\n", "1.E9999", "\u{fe}"];
        let global = ",,4Hpart,3Ha,b,16Hsystem,7Hversion,32,38,6,308,15,,1.,2,2HMM,1,0.01;";
        let mut records = whole();
        records[1] = record(global, 'G', 1);
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("a.igs");
        crate::surface::mutants::each(&[records.concat().into_bytes()], WORDS, |bytes| {
            std::fs::write(&path, bytes).expect("written");
            let faults = [check(&path).err(), check_scale(&path, &mut Vec::new()).err()];
            assert!(faults.iter().flatten().flat_map(Error::diags).all(|d| !d.hint.is_empty()));
        });
        crate::surface::mutants::each(&[global.as_bytes().to_vec()], WORDS, |bytes| {
            assert!(parameters(bytes).is_ok_and(|all| all.len() <= bytes.len() + 1) || parameters(bytes).is_err());
        });
    }
}
