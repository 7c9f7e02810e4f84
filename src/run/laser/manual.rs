//! A laser that a person starts.

use std::rc::Rc;

use super::{Beam, Laser, Work};
use crate::run::stage::Stage;
use crate::run::{Console, Interrupt};
use terrace_core::diag::Diag;
use terrace_core::geom::Nm;

/// Asks a person to mark every block.
pub struct Manual(Rc<dyn Console>);

impl Manual {
    /// Asks through this console.
    pub fn new(console: &Rc<dyn Console>) -> Self {
        Self(Rc::clone(console))
    }
}

impl Laser for Manual {
    fn format(&self) -> Option<&'static str> {
        None
    }

    fn has_pilot(&self) -> bool {
        true
    }

    fn sets_focus_shift(&self) -> bool {
        true
    }

    fn open(&mut self, _: &Interrupt) -> Result<String, Diag> {
        Ok("a person marks the blocks".into())
    }

    fn mark(&mut self, work: &Work, beam: Beam, _: &mut dyn Stage, interrupt: &Interrupt) -> Result<(), Diag> {
        let (what, end) = match beam {
            Beam::Pilot => ("show with the pilot laser", "do not fire"),
            Beam::Fire => ("mark", "continue only when the laser is off"),
        };

        let file = work.file.as_ref().map_or(String::new(), |file| format!(" ({})", file.display()));
        let shift = if work.focus_shift == 0 {
            String::new()
        } else {
            format!(" with the focus shifted by {} mm", Nm(work.focus_shift).mm())
        };
        self.0.ask(&format!("{what}: block {}{file}{shift}; {end}", work.block), interrupt)
    }

    fn off(&mut self) -> Result<(), Diag> {
        Ok(())
    }
}
