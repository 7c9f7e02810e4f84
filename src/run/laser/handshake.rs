//! A scan card that is started and watched through two wires of the stage's control.

use super::{Beam, Laser, Work};
use crate::diag::Diag;
use crate::run::Interrupt;
use crate::run::stage::Stage;

/// Hands over by START and BUSY; the card has its drawings already.
pub struct Handshake;

impl Laser for Handshake {
    fn format(&self) -> Option<&'static str> {
        None
    }

    fn has_pilot(&self) -> bool {
        false
    }

    fn open(&mut self) -> Result<String, Diag> {
        Ok("START and BUSY of the stage's control".into())
    }

    fn is_idle(&mut self, stage: &mut dyn Stage, interrupt: &Interrupt) -> Result<(), Diag> {
        stage.card_is_idle(interrupt)
    }

    fn mark(&mut self, work: &Work, _: Beam, stage: &mut dyn Stage, interrupt: &Interrupt) -> Result<(), Diag> {
        stage.hand_over(work.longest(), interrupt)
    }

    /// The stage switches START off when it is halted.
    fn off(&mut self) -> Result<(), Diag> {
        Ok(())
    }
}
