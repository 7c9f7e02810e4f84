//! Targets: what a machine or its software reads.
//!
//! Every target is one file here with pure functions from a [`Checked`](crate::check::Checked) program
//! and its machine to bytes; [`TARGETS`] lists them. Nothing is rounded
//! here except where a format holds single precision (OVF): coordinates are integers in nm and are
//! written as decimals of mm digit by digit. The same program gives the same bytes.
//!
//! Points leave here in controller coordinates: the field frame after the scanner's swap and mirrors.
//! What each file holds is written down in `docs/formats.md`.

mod cards;
pub mod csv;
pub mod dxf;
pub mod frames;
pub mod gcode;
mod known;
pub mod lightburn;
pub mod lmc;
pub mod on_the_fly;
pub mod ovf;
pub mod poses;
pub mod rtc;
mod target;

pub use known::{Key, Known, KnownFault};
pub use target::{Files, FlyFile, Stepped, Target, block_file, faults, known_faults};

/// All targets, in the order in which files are written.
pub const TARGETS: [Target; 10] = [
    dxf::TARGET,
    csv::TARGET,
    lightburn::TARGET,
    lmc::TARGET,
    rtc::TARGET,
    gcode::LINUXCNC,
    gcode::M0,
    ovf::TARGET,
    poses::TARGET,
    on_the_fly::PMAC,
];

/// The digits 00 to 99, one pair after another.
const PAIRS: [u8; 200] = {
    let mut pairs = [0; 200];
    let mut i = 0;
    while i < 100 {
        pairs[2 * i] = b'0' + (i / 10) as u8;
        pairs[2 * i + 1] = b'0' + (i % 10) as u8;
        i += 1;
    }
    pairs
};

/// Appends nanometres as mm with six decimals: `-0.000001`, never `-0.000000`, never an exponent.
fn push_mm(out: &mut Vec<u8>, nm: i64) {
    // Sign, thirteen digits, point, six digits: the longest i64.
    let mut text = [b'.'; 21];
    let size = nm.unsigned_abs();
    let decimals = (size % 1_000_000) as usize;
    for (at, pair) in [(15, decimals / 10_000), (17, decimals / 100 % 100), (19, decimals % 100)] {
        text[at..at + 2].copy_from_slice(&PAIRS[2 * pair..2 * pair + 2]);
    }
    let mut at = 14;
    let mut whole = size / 1_000_000;
    loop {
        at -= 1;
        text[at] = b'0' + (whole % 10) as u8;
        whole /= 10;
        if whole == 0 {
            break;
        }
    }
    if nm < 0 {
        at -= 1;
        text[at] = b'-';
    }
    out.extend_from_slice(&text[at..]);
}

/// Longest text from a file that a comment quotes, in characters.
const QUOTED: usize = 40;

/// What begins a further line of a comment. A controller acts on comments whose first word it knows (`MSG`, `PRINT`,
/// `LOGOPEN`, ...), so no line may begin with a word of the comment's text.
const FURTHER: &str = "... ";

/// A text from a file as a comment may hold it: in quotes, cut, on one line.
fn quoted(text: &str) -> String {
    let cut: String = text.chars().take(QUOTED).collect();
    let more = if cut.len() < text.len() { "..." } else { "" };
    format!("\"{}{more}\"", plain(&cut).replace('"', "'"))
}

/// A text in printable ASCII; what a controller could take for the end of a comment, or acts on wherever it stands, as
/// GRBL does on `!`, `~` and `?`, becomes `_`.
fn plain(text: &str) -> String {
    text.chars().map(|c| if matches!(c, ' '..='~') && !"();%!~?".contains(c) { c } else { '_' }).collect()
}

/// Names as they could stand in a file: every word on which some controller acts in a comment, and what ends one.
#[cfg(test)]
pub(super) const HOSTILE: [&str; 11] =
    ["MSG", "DEBUG", "PRINT", "LOG", "LOGOPEN", "LOGAPPEND", "LOGCLOSE", "PROBEOPEN", "PROBECLOSE", "PY", "ABORT"];

#[cfg(test)]
mod tests {
    use super::*;

    fn mm(nm: i64) -> String {
        let mut out = Vec::new();
        push_mm(&mut out, nm);
        String::from_utf8(out).expect("ASCII")
    }

    #[test]
    fn nanometres_are_written_as_decimals() {
        for (nm, text) in [
            (0, "0.000000"),
            (1, "0.000001"),
            (-1, "-0.000001"),
            (-999_999, "-0.999999"),
            (1_000_000, "1.000000"),
            (-12_345_678, "-12.345678"),
            (4_000_000_000, "4000.000000"),
            (i64::from(i32::MIN), "-2147.483648"),
            (i64::MIN, "-9223372036854.775808"),
        ] {
            assert_eq!(mm(nm), text);
        }
    }

    #[test]
    fn every_number_reads_back_to_the_nanometre() {
        let mut nm = 1i64;
        while nm < 4_000_000_000 {
            for n in [nm, -nm] {
                let back: f64 = mm(n).parse().expect("number");
                assert_eq!(terrace_core::geom::Nm::from_mm(back), Some(terrace_core::geom::Nm(n)));
            }
            nm = nm * 7 / 5 + 3;
        }
    }
}
