//! Readers of the emitted files, written for verification alone: they share no code with the writers.
//!
//! Every reader checks its file as it goes, bounds what it allocates by the bytes there are, and
//! answers a fault with its line or place, never with a panic.

pub(crate) mod comments;
mod csv;
pub(super) mod curves;
mod dxf;
pub(super) mod formats;
pub(super) mod gcode;
pub(super) mod labels;
pub(super) mod leaves;
mod lightburn;
mod lmc;
pub(super) mod manifest;
pub(super) mod number;
pub(super) mod on_the_fly;
pub(super) mod outline;
pub(super) mod ovf;
pub(super) mod picture;
pub(super) mod poses;
pub(super) mod probe;
pub(super) mod program;
mod rtc;
pub(super) mod runsheet;
mod sides;
mod unread;

use formats::{BlockFiles, OnTheFly, Row, Stepped, drawing, in_nm, no_dwell, tens_of_us};
use terrace_core::format::Format;
use terrace_core::machine::Machine;
use terrace_core::program::Block;

/// All formats.
pub(crate) const FORMATS: [Row; 10] = [
    Row {
        format: Format::Dxf,
        name: "dxf",
        stepped: drawing("dxf", |bytes, of, visit| dxf::strokes(bytes, of.id, visit)),
        on_the_fly: None,
    },
    Row {
        format: Format::Csv,
        name: "csv",
        stepped: drawing("csv", |bytes, _, visit| csv::strokes(bytes, visit)),
        on_the_fly: None,
    },
    Row {
        format: Format::Lightburn,
        name: "lightburn",
        stepped: Some(Stepped::Blocks(BlockFiles {
            ending: "lbrn2",
            read: lightburn::strokes,
            units: in_nm,
            names_pens: true,
            repeats: false,
            settings: lightburn::settings,
            dwell: no_dwell,
        })),
        on_the_fly: None,
    },
    Row {
        format: Format::Lmc,
        name: "lmc",
        stepped: Some(Stepped::Blocks(BlockFiles {
            ending: "lmc",
            read: |bytes, _, visit| lmc::strokes(bytes, visit),
            units: lmc::units,
            names_pens: false,
            repeats: true,
            settings: lmc::settings,
            dwell: tens_of_us,
        })),
        on_the_fly: None,
    },
    Row {
        format: Format::Rtc,
        name: "rtc",
        stepped: Some(Stepped::Blocks(BlockFiles {
            ending: "rtc",
            read: rtc::strokes,
            units: rtc::units,
            names_pens: false,
            repeats: true,
            settings: rtc::settings,
            dwell: tens_of_us,
        })),
        on_the_fly: None,
    },
    Row {
        format: Format::Linuxcnc,
        name: "linuxcnc",
        stepped: Some(Stepped::Stage { file: "stage.ngc", handshake: true, read: gcode::read }),
        on_the_fly: Some(OnTheFly {
            file: "fly.ngc",
            axes: &["XYZUV"],
            read: on_the_fly::linuxcnc::read,
            servo_s: 1e-3,
        }),
    },
    Row {
        format: Format::Gcode,
        name: "gcode",
        stepped: Some(Stepped::Stage { file: "stage_m0.nc", handshake: false, read: gcode::read }),
        on_the_fly: None,
    },
    Row {
        format: Format::Ovf,
        name: "ovf",
        stepped: Some(Stepped::Planes { file: "job.ovf", open: |bytes| ovf::OvfFile::open(bytes) }),
        on_the_fly: None,
    },
    Row {
        format: Format::Poses,
        name: "poses",
        stepped: Some(Stepped::Poses { file: "poses.csv", read: poses::read }),
        on_the_fly: None,
    },
    Row {
        format: Format::Pmac,
        name: "pmac",
        stepped: None,
        on_the_fly: Some(OnTheFly {
            file: "fly.pmc",
            axes: &["XYZUV", "XYZACUV"],
            read: on_the_fly::pmac::read,
            servo_s: 50e-6,
        }),
    },
];

/// The block whose file is read.
#[derive(Clone, Copy)]
pub(crate) struct BlockOf<'a> {
    pub(crate) id: &'a str,
    pub(crate) block: &'a Block,
    pub(crate) machine: &'a Machine,
}

/// A stroke in the file of a block.
pub(crate) struct FileStroke<'a> {
    /// The pen of the stroke, from 1; None where the file names none that the block can have.
    pub(crate) pen: Option<usize>,
    /// The points of the stroke in the controller's coordinates, in the units of the format.
    pub(crate) points: &'a [[i64; 2]],
    /// The settings that it is marked with, in the format's own order and units, last the dwell of a dot; empty where
    /// the file has none.
    pub(crate) settings: &'a [i64],
}

/// Takes the strokes of a block one by one.
pub(crate) type Strokes<'v> = dyn FnMut(FileStroke<'_>) + 'v;

/// A fault of a text file, and its line, from 1.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Fault {
    /// Line, from 1.
    pub(super) line: usize,
    /// One sentence.
    pub(super) message: String,
}

impl Fault {
    pub(super) fn new(line: usize, message: impl Into<String>) -> Self {
        Self { line, message: message.into() }
    }
}
