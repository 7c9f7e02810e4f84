//! A stage that a person moves.

use std::rc::Rc;

use super::{Move, Stage};
use crate::diag::Diag;
use crate::run::{Console, Interrupt};

/// Asks a person for every move.
pub struct Manual(Rc<dyn Console>);

impl Manual {
    /// Asks through this console.
    pub fn new(console: &Rc<dyn Console>) -> Self {
        Self(Rc::clone(console))
    }
}

impl Stage for Manual {
    fn open(&mut self) -> Result<String, Diag> {
        Ok("a person moves the stage".into())
    }

    fn go(&mut self, to: &Move, interrupt: &Interrupt) -> Result<(), Diag> {
        self.0.ask(&format!("move the stage to {to}"), interrupt)
    }

    fn halt(&mut self) -> Result<(), Diag> {
        Ok(())
    }
}
