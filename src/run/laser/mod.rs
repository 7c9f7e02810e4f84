//! Lasers: each driver hands the file of a block to one kind of marking software or card, and says when it is marked.

pub mod command;
pub mod handshake;
pub mod lightburn;
pub mod lmc;
pub mod manual;

use std::fs::File;
use std::path::PathBuf;
use std::time::Duration;

use super::Interrupt;
use super::stage::Stage;
use terrace_core::diag::Diag;

/// A block as a laser is given it; the stage stands still at its place.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Work {
    /// The name of the block, such as B0133.
    pub block: String,
    /// The file of the block in the format that the driver takes; None of a driver that takes none.
    pub file: Option<PathBuf>,
    /// What the zoom optic adds to the focal plane, nm; 0 without an optic.
    pub focus_shift: i64,
    /// Estimated time of its marks, jumps and delays.
    pub estimate: Duration,
}

impl Work {
    /// The longest time to wait for its end: twice the estimate and 10 s, as the stage programs wait.
    pub fn longest(&self) -> Duration {
        2 * self.estimate + Duration::from_secs(10)
    }
}

/// What a block is marked with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Beam {
    /// The pilot laser: it shows the marks and leaves none.
    Pilot,
    /// The laser.
    Fire,
}

/// A laser with its scanner.
pub trait Laser {
    /// The format whose files it takes, by its name in `emit.formats`; None where it takes none.
    fn format(&self) -> Option<&'static str>;

    /// Whether it can show a block with the pilot laser.
    fn has_pilot(&self) -> bool;

    /// Whether it sets the zoom optic of a block; jobs that need that are refused otherwise.
    fn sets_focus_shift(&self) -> bool {
        false
    }

    /// Connects, and makes sure that it is ready and off. Returns what it says that it is, for the log.
    ///
    /// # Errors
    /// Where there is no answer, it is not ready, or the run is aborted.
    fn open(&mut self, interrupt: &Interrupt) -> Result<String, Diag>;

    /// Takes a handle of the machine's lock: no other run begins while one is open. A driver whose marking continues
    /// where this program is killed lets what marks keep it open.
    fn hold(&mut self, lock: File) {
        drop(lock);
    }

    /// Makes sure through the control of the stage that nothing is being marked, before the stage moves.
    ///
    /// # Errors
    /// Where something is.
    fn is_idle(&mut self, stage: &mut dyn Stage, interrupt: &Interrupt) -> Result<(), Diag> {
        let _ = (stage, interrupt);
        Ok(())
    }

    /// Whether nothing is being marked; asked before the stage moves and before a block is begun where the driver says
    /// so over a link whose answers can be others'. Where something is, the block that ended last may not have.
    ///
    /// # Errors
    /// Where that cannot be known.
    fn is_free(&mut self, interrupt: &Interrupt) -> Result<bool, Diag> {
        let _ = interrupt;
        Ok(true)
    }

    /// Marks a block, and returns when the beam is off for certain. `stage` is for drivers that hand over through its
    /// control; they never move it.
    ///
    /// # Errors
    /// Where it cannot be said that all of the block is marked, or the run is aborted; the beam is then off as far as
    /// the driver can tell, and the message says where that is not certain.
    fn mark(&mut self, work: &Work, beam: Beam, stage: &mut dyn Stage, interrupt: &Interrupt) -> Result<(), Diag>;

    /// Switches the beam off; called at every end of a run, after faults too.
    ///
    /// # Errors
    /// Where that is not certain.
    fn off(&mut self) -> Result<(), Diag>;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::stage::Move;

    /// A stage that must not be touched.
    pub(super) struct UntouchedStage;

    impl Stage for UntouchedStage {
        fn open(&mut self, _: &Interrupt) -> Result<String, Diag> {
            unreachable!("the laser does not open the stage")
        }
        fn go(&mut self, _: &Move, _: &Interrupt) -> Result<(), Diag> {
            unreachable!("the laser does not move the stage")
        }
        fn halt(&mut self) -> Result<(), Diag> {
            unreachable!("the laser does not halt the stage")
        }
    }
}
