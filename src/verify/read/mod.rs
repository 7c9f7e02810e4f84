//! Readers of the emitted files, written for verification alone: they share no code with the writers.
//!
//! Every reader checks its file as it goes, bounds what it allocates by the bytes there are, and
//! answers a fault with its line or place, never with a panic.

mod csv;
mod dxf;
pub(super) mod formats;
pub(super) mod gcode;
pub(super) mod manifest;
pub(super) mod number;
pub(super) mod on_the_fly;
pub(super) mod ovf;
pub(super) mod program;
pub(super) mod runsheet;

/// Takes the strokes of a block one by one: the pen from 1, None where the file names none that the block can have,
/// and the points in nm in the controller's coordinates.
pub(in crate::verify) type Strokes<'v> = dyn FnMut(Option<usize>, &[[i64; 2]]) + 'v;

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
