//! A stage that a person moves.

use std::rc::Rc;

use super::{Move, Stage};
use crate::run::{Console, Interrupt};
use terrace_core::diag::Diag;

/// Asks a person for every move.
pub struct Manual {
    console: Rc<dyn Console>,
    /// The block that the next moves go to.
    block: String,
}

impl Manual {
    /// Asks through this console.
    pub fn new(console: &Rc<dyn Console>) -> Self {
        Self { console: Rc::clone(console), block: String::new() }
    }
}

impl Stage for Manual {
    fn open(&mut self, _: &Interrupt) -> Result<String, Diag> {
        Ok("a person moves the stage".into())
    }

    fn go(&mut self, to: &Move, interrupt: &Interrupt) -> Result<(), Diag> {
        let block = if self.block.is_empty() { String::new() } else { format!("block {}: ", self.block) };
        self.console.ask(&format!("{block}move the stage to {}", to.for_people()), interrupt)
    }

    fn heads_for(&mut self, block: &str) {
        block.clone_into(&mut self.block);
    }

    fn halt(&mut self) -> Result<(), Diag> {
        Ok(())
    }
}
