//! Field corrections of EzCad (.cor): 65 rows of 65 shifts in units of the card.

use std::path::Path;

use terrace_core::diag::{self, Diag, Place};

const POINTS: usize = 65 * 65;

/// Label of the files with numbers in double precision, in UTF-16; all others have whole numbers.
const LABEL: &str = "LMC1COR_1.0";

/// Bytes before the points: of files with numbers in double precision, and of all others.
const HEADERS: [usize; 2] = [22 + 506, 22 + 14];

/// The shifts as the card takes them: size, and 0x8000 more for a negative one.
pub(super) fn read(file: &Path) -> Result<Vec<[u16; 2]>, Diag> {
    let bytes = diag::read_file(file, 1 << 20).map_err(|e| e.diags()[0].clone())?;
    let label: Vec<u8> = LABEL.encode_utf16().flat_map(u16::to_le_bytes).collect();
    let values: Option<Vec<f64>> = if bytes.starts_with(&label) {
        bytes.get(HEADERS[0]..).map(|b| b.as_chunks().0.iter().map(|b| f64::from_le_bytes(*b)).collect())
    } else {
        bytes.get(HEADERS[1]..).map(|b| b.as_chunks().0.iter().map(|b| i32::from_le_bytes(*b).into()).collect())
    };
    let values = values
        .filter(|v| v.len() >= 2 * POINTS)
        .ok_or_else(|| fault(file, "this is not a field correction of 65 x 65 points"))?;
    let shifts: Option<Vec<u16>> = values[..2 * POINTS].iter().map(|v| shift(*v)).collect();
    shifts
        .map(|s| s.as_chunks().0.to_vec())
        .ok_or_else(|| fault(file, "a shift of the field correction is beyond 32767 units"))
}

/// What is wrong with a file of a field correction.
fn fault(file: &Path, text: &str) -> Diag {
    Diag::input("lmc-correction", text)
        .at(Place::file(file.display().to_string()))
        .hint("state the .cor file that EzCad uses for this lens")
}

/// A shift as the card takes it; None beyond what 15 bits hold.
fn shift(value: f64) -> Option<u16> {
    let size = value.abs().round_ties_even();
    (size <= 32767.0).then(|| size as u16 + if value < 0.0 && size > 0.0 { 0x8000 } else { 0 })
}
