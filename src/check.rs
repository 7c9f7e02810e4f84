//! The gate before the emitters: a [`Checked`] program keeps the invariants P1 to P5 of
//! [`crate::program`] and the limits of its machine. There is no other way to make one.

use crate::program::Program;

/// A program that may be emitted.
#[derive(Debug)]
pub struct Checked {
    program: Program,
    origin: [i64; 3],
}

impl Checked {
    /// The program.
    pub fn program(&self) -> &Program {
        &self.program
    }
    /// Position of the part frame's origin in the table frame, nm.
    pub fn origin(&self) -> [i64; 3] {
        self.origin
    }
    /// For tests of the emitters and mutants of the verifier: a program that nobody checked.
    #[cfg(test)]
    pub(crate) fn unchecked(program: Program, origin: [i64; 3]) -> Self {
        Self { program, origin }
    }
}
