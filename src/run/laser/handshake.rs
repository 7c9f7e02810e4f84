//! A scan card that is started and watched through two wires of the stage's control.

use super::{Beam, Laser, Work};
use crate::run::Interrupt;
use crate::run::stage::Stage;
use terrace_core::diag::Diag;

/// Hands over by START and BUSY; the card has its drawings already.
#[derive(Default)]
pub struct Handshake {
    /// Whether the card was started and has not said that it has ended.
    is_doubtful: bool,
}

impl Laser for Handshake {
    fn format(&self) -> Option<&'static str> {
        None
    }

    fn has_pilot(&self) -> bool {
        false
    }

    fn open(&mut self, _: &Interrupt) -> Result<String, Diag> {
        Ok("START and BUSY of the stage's control".into())
    }

    fn is_idle(&mut self, stage: &mut dyn Stage, interrupt: &Interrupt) -> Result<(), Diag> {
        stage.card_is_idle(interrupt)
    }

    fn mark(&mut self, work: &Work, _: Beam, stage: &mut dyn Stage, interrupt: &Interrupt) -> Result<(), Diag> {
        self.is_doubtful = true;
        stage.hand_over(work.longest(), interrupt)?;
        self.is_doubtful = false;
        Ok(())
    }

    /// The stage switches START off when it is halted; a card that was started continues all the same.
    fn off(&mut self) -> Result<(), Diag> {
        if !self.is_doubtful {
            return Ok(());
        }
        let text = "it is not certain that the laser is off: the scan card may still be marking";
        Err(Diag::limit("run-laser-off", text).hint("switch it off by hand"))
    }
}
