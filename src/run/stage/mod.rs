//! Stages: each driver moves one kind of control, and says when the stage stands still.

pub mod grbl;

use std::time::Duration;

use super::Interrupt;
use crate::diag::Diag;

/// A straight move of some axes to absolute commanded positions: letters as in the stage programs (X, Y, Z and those of
/// the tilt axes), nm or millionths of a degree.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Move(pub Vec<(char, i64)>);

/// A stage and its control.
pub trait Stage {
    /// Connects, and makes sure that the control is ready: no alarm, homed, output off. Never moves. Answers with what
    /// the control says that it is, for the log.
    ///
    /// # Errors
    /// Where there is no answer, or the control is not ready or not the one that the run file names.
    fn open(&mut self) -> Result<String, Diag>;

    /// Moves, and returns when the stage stands at the target.
    ///
    /// # Errors
    /// Where the control reports an alarm or does not answer, or the run is aborted; the stage is then halted.
    fn go(&mut self, to: &Move, interrupt: &Interrupt) -> Result<(), Diag>;

    /// Sets START and waits for BUSY of the scan card to rise and to fall, at most so long.
    ///
    /// # Errors
    /// Where BUSY does not rise or fall in time; START is then off. Controls without such outputs refuse.
    fn hand_over(&mut self, longest: Duration, interrupt: &Interrupt) -> Result<(), Diag> {
        let _ = (longest, interrupt);
        Err(Diag::input("run-handshake", "this stage driver has no START and BUSY")
            .hint("use laser.driver = \"handshake\" with stage.driver = \"linuxcnc\""))
    }

    /// Switches its output off and ends any motion as fast as the control can; called at every end of a run, after
    /// faults too.
    ///
    /// # Errors
    /// Where that is not certain.
    fn halt(&mut self) -> Result<(), Diag>;
}
