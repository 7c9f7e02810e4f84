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
pub(super) mod program;
mod rtc;
pub(super) mod runsheet;
mod unread;

use formats::Row;
use terrace_core::machine::Machine;
use terrace_core::program::Block;

/// All formats.
pub(crate) const FORMATS: [Row; 10] = [
    dxf::ROW,
    csv::ROW,
    lightburn::ROW,
    lmc::ROW,
    rtc::ROW,
    gcode::LINUXCNC,
    gcode::M0,
    ovf::ROW,
    poses::ROW,
    on_the_fly::pmac::ROW,
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
    /// Its pen, from 1; None where the file names none that the block can have.
    pub(crate) pen: Option<usize>,
    /// Its points in the controller's coordinates, in the units of the format.
    pub(crate) points: &'a [[i64; 2]],
    /// The settings that it is marked with, in the format's own order and units, last the dwell of a dot; empty where the
    /// file has none.
    pub(crate) settings: &'a [i64],
}

/// Takes the strokes of a block one by one.
pub(crate) type Strokes<'v> = dyn FnMut(FileStroke<'_>) + 'v;

/// What is wrong with a text file, and in which line (from 1).
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
