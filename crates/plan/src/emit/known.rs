//! What a target refuses of a job before it is planned: what follows from the pens, the machine and the kinds of
//! textures alone. The same is looked for again in the program, which may have pens that the plan has made.

use terrace_core::diag::Diag;
use terrace_core::machine::Machine;
use terrace_core::program::{Pen, Program, Stroke};

/// The pens of a job on its machine, and what they mark.
#[derive(Clone, Copy, Debug)]
pub struct JobPens<'a> {
    /// The pens of the program.
    pub pens: &'a [Pen],
    /// The machine of the job.
    pub machine: &'a Machine,
    /// Whether the job has dots.
    pub has_dots: bool,
    /// Number of the last pen that marks, from 1; 0 where none is known to mark.
    pub last_pen: usize,
}

impl<'a> JobPens<'a> {
    /// The pens of a program, and what they mark.
    pub(super) fn of_program(program: &'a Program, machine: &'a Machine) -> Self {
        Self {
            pens: &program.pens,
            machine,
            has_dots: program.strokes.iter().any(Stroke::is_dot),
            last_pen: program.strokes.iter().map(|s| s.pen.index() + 1).max().unwrap_or(0),
        }
    }
}

/// The key that a fault is of.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Key {
    /// The target's entry of `emit.formats`.
    Format,
    /// A key of a pen, by the pen's index.
    Pen(usize, &'static str),
    /// A key of the machine file.
    Machine(&'static str),
}

/// A fault and the key whose value it is of.
pub type KnownFault = (Key, Diag);
