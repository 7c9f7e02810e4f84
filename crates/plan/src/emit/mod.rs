//! Targets: what a machine or its software reads.
//!
//! Every target is one file here with pure functions from a [`Checked`](crate::check::Checked) program
//! and its machine to bytes; [`TARGETS`] lists them. Nothing is rounded
//! here except where a format holds single precision (OVF): coordinates are integers in nm and are
//! written as decimals of mm digit by digit. The same program gives the same bytes.
//!
//! Points leave here in controller coordinates: the field frame after the scanner's swap and mirrors.
//! What each file holds is written down in `docs/reference/formats.md`.

mod cards;
pub mod csv;
pub mod dxf;
pub mod frames;
pub mod gcode;
mod known;
pub mod lightburn;
pub(crate) mod lines;
pub mod lmc;
pub mod on_the_fly;
pub mod ovf;
pub mod poses;
pub mod rtc;
mod target;

pub use known::{JobPens, Key, KnownFault};
pub use target::{Files, FlyFile, Stepped, Target, block_file, faults, known_faults};
use target::{OF_BLOCKS, no_faults, no_known_faults};

use crate::on_the_fly::program::Kind;
use terrace_core::format::Format;
use terrace_core::machine::LoadingWay;

/// All targets, in the order in which files are written.
pub const TARGETS: [Target; 10] = [
    Target {
        format: Format::Dxf,
        stepped: Some(Files::Blocks("dxf", |job, i| dxf::block(job.checked, job.machine, i))),
        on_the_fly: None,
        known_faults: no_known_faults,
        faults: no_faults,
        carries_pens: true,
        carries_settings: false,
        carries_focus_shift: false,
        ways: OF_BLOCKS,
        moves_stage: false,
        sheet: &[
            "blocks/B0001.dxf and so on hold one block each, to be marked when the stage stands at the place",
            "of that block and nowhere else. Layer and colour number are the number of the pen. Switch off",
            "sorting and joining of paths where order or direction matter.",
        ],
    },
    Target {
        format: Format::Csv,
        stepped: Some(Files::Blocks("csv", |job, i| csv::block(job.checked, job.machine, i))),
        on_the_fly: None,
        known_faults: no_known_faults,
        faults: no_faults,
        carries_pens: true,
        carries_settings: false,
        carries_focus_shift: false,
        ways: OF_BLOCKS,
        moves_stage: false,
        sheet: &[
            "blocks/B0001.csv and so on hold one block each as points in mm: number of the stroke, number of",
            "the pen, x, y. The beam is on between points of the same stroke and off between strokes.",
        ],
    },
    Target {
        format: Format::Lightburn,
        stepped: Some(Files::Blocks("lbrn2", |job, i| lightburn::block(job.checked, job.machine, i))),
        on_the_fly: None,
        known_faults: lightburn::known_faults,
        faults: no_faults,
        carries_pens: true,
        carries_settings: true,
        carries_focus_shift: false,
        ways: OF_BLOCKS,
        moves_stage: false,
        sheet: &[
            "blocks/B0001.lbrn2 and so on are LightBurn projects of one block each, with speed, power, frequency",
            "and passes of every pen; layer 00 is pen 1. LightBurn marks layer after layer, and the paths of a",
            "layer in the order of the file only with all cut optimization switched off. Switch it off.",
        ],
    },
    Target {
        format: Format::Lmc,
        stepped: Some(Files::Blocks("lmc", |job, i| lmc::block(job.checked, job.machine, i))),
        on_the_fly: None,
        known_faults: lmc::known_faults,
        faults: lmc::faults,
        carries_pens: true,
        carries_settings: true,
        carries_focus_shift: false,
        ways: OF_BLOCKS,
        moves_stage: false,
        sheet: &[
            "blocks/B0001.lmc and so on are lists of one block each for a BJJCZ (LMC) card, in units of the card,",
            "with all settings of the pens. They hold no correction of the field: load it before.",
        ],
    },
    Target {
        format: Format::Rtc,
        stepped: Some(Files::Blocks("rtc", |job, i| rtc::block(job.checked, job.machine, i))),
        on_the_fly: None,
        known_faults: rtc::known_faults,
        faults: rtc::faults,
        carries_pens: true,
        carries_settings: true,
        carries_focus_shift: true,
        ways: OF_BLOCKS,
        moves_stage: false,
        sheet: &[
            "blocks/B0001.rtc and so on are lists of one block each for a SCANLAB RTC board, as text in the units",
            "of the board, for a program of your own that goes through them line by line.",
        ],
    },
    Target {
        format: Format::Linuxcnc,
        stepped: Some(Files::Whole("stage.ngc", gcode::linuxcnc)),
        on_the_fly: Some(FlyFile {
            name: "fly.ngc",
            kinds: &[Kind::Xyzuv],
            write: on_the_fly::linuxcnc,
            servo_s: on_the_fly::LINUXCNC_SERVO_S,
        }),
        known_faults: no_known_faults,
        faults: no_faults,
        carries_pens: false,
        carries_settings: false,
        carries_focus_shift: false,
        ways: &[LoadingWay::Card],
        moves_stage: true,
        sheet: &[
            "stage.ngc (LinuxCNC) goes to each block, settles, sets digital output 0 (START) and waits for",
            "digital input 0 (BUSY) of the scan card to rise and to fall. BUSY must last 20 ms or more. If a",
            "wait takes too long the program ends without moving on: check the laser, then let `terrace resume`",
            "write a program of what is left. The first line of block B0133 is N133. To begin there, first do",
            "what the comments ENTRY before it say.",
        ],
    },
    Target {
        format: Format::Gcode,
        stepped: Some(Files::Whole("stage_m0.nc", gcode::m0)),
        on_the_fly: None,
        known_faults: no_known_faults,
        faults: no_faults,
        carries_pens: false,
        carries_settings: false,
        carries_focus_shift: false,
        ways: &[LoadingWay::Person],
        moves_stage: true,
        sheet: &[
            "stage_m0.nc goes to each block and stops (M0): mark the block, wait for its end, then press",
            "cycle start. Never press it while the laser is on. Dwells are in seconds. The first line of block",
            "B0133 is N133. To begin there, first do what the comments ENTRY before it say.",
        ],
    },
    Target {
        format: Format::Ovf,
        stepped: Some(Files::Whole("job.ovf", |job| ovf::write(job.checked, job.machine, job.job, job.part))),
        on_the_fly: None,
        known_faults: no_known_faults,
        faults: no_faults,
        carries_pens: true,
        carries_settings: true,
        carries_focus_shift: true,
        ways: &[LoadingWay::Ovf],
        moves_stage: false,
        sheet: &[
            "job.ovf holds all blocks of this sheet in its order, with stage positions and pens; planes count from 0.",
        ],
    },
    Target {
        format: Format::Poses,
        stepped: Some(Files::Whole("poses.csv", poses::write)),
        on_the_fly: None,
        known_faults: no_known_faults,
        faults: no_faults,
        carries_pens: false,
        carries_settings: false,
        carries_focus_shift: false,
        ways: &[LoadingWay::Person],
        moves_stage: false,
        sheet: &[
            "poses.csv holds the pose of the head at each block, for a robot or a gantry: the centre of the field in",
            "the focal plane, mm in the frame of the part, and the turns about z, y and x (ZYX Euler angles, deg)",
            "that bring the axes of the part to the field's x and y and the beam, z towards the lens.",
        ],
    },
    Target {
        format: Format::Pmac,
        stepped: None,
        on_the_fly: Some(FlyFile {
            name: "fly.pmc",
            kinds: &[Kind::Xyzuv, Kind::Xyzacuv],
            write: on_the_fly::pmac,
            servo_s: on_the_fly::PMAC_SERVO_S,
        }),
        known_faults: no_known_faults,
        faults: no_faults,
        carries_pens: false,
        carries_settings: false,
        carries_focus_shift: false,
        ways: &[],
        moves_stage: true,
        sheet: &[],
    },
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
pub(crate) fn quoted(text: &str) -> String {
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
