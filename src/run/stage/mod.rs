//! Stages: each driver moves one kind of control, and says when the stage stands still.

pub mod grbl;
pub mod linuxcnc;
pub mod manual;

use std::fmt;
use std::time::Duration;

use super::Interrupt;
use terrace_core::diag::Diag;

/// A straight move of some axes to absolute commanded positions: letters as in the stage programs (X, Y, Z and those of
/// the tilt axes), nm or millionths of a degree.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Move(pub Vec<(char, i64)>);

impl Move {
    /// The same with as many decimals as it needs: `X-1 Y2.5`.
    fn for_people(&self) -> String {
        let words = self.to_string();
        let short = |word: &str| word.trim_end_matches('0').trim_end_matches('.').to_owned();
        words.split(' ').map(short).collect::<Vec<_>>().join(" ")
    }
}

impl fmt::Display for Move {
    /// The move as words of a program, with all six decimals: `X-1.000000 Y2.500000`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, &(letter, value)) in self.0.iter().enumerate() {
            let space = if i > 0 { " " } else { "" };
            let sign = if value < 0 { "-" } else { "" };
            let size = value.unsigned_abs();
            write!(f, "{space}{letter}{sign}{}.{:06}", size / 1_000_000, size % 1_000_000)?;
        }
        Ok(())
    }
}

/// The refusal of a stage that has no START and BUSY.
pub(super) fn no_handshake() -> Diag {
    Diag::input("run-handshake", "this stage driver has no START and BUSY")
        .hint("use laser.driver = \"handshake\" with stage.driver = \"linuxcnc\"")
}

/// A stage and its control.
pub trait Stage {
    /// Connects, and makes sure that the control is ready: no alarm, homed, output off. Never moves. Returns what
    /// the control says that it is, for the log.
    ///
    /// # Errors
    /// Where there is no answer, the control is not ready or not the one that the run file names, or the run is
    /// aborted.
    fn open(&mut self, interrupt: &Interrupt) -> Result<String, Diag>;

    /// Moves, and returns when the stage stands at the target.
    ///
    /// # Errors
    /// Where the control reports an alarm or does not answer, or the run is aborted; the stage is then halted.
    fn go(&mut self, to: &Move, interrupt: &Interrupt) -> Result<(), Diag>;

    /// Says which block the next moves go to, for those who are asked to move; empty where they go to none.
    fn heads_for(&mut self, block: &str) {
        let _ = block;
    }

    /// Makes sure that BUSY of the scan card is off, and that no START of before, such as that of a run which was
    /// killed, still raises it. Nothing has moved yet.
    ///
    /// # Errors
    /// Where it is on or rises. Controls without such an input refuse.
    fn card_is_idle(&mut self, interrupt: &Interrupt) -> Result<(), Diag> {
        let _ = interrupt;
        Err(no_handshake())
    }

    /// Sets START and waits for BUSY of the scan card to rise and to fall, at most so long.
    ///
    /// # Errors
    /// Where BUSY does not rise or fall in time; START is then off. Controls without such outputs refuse.
    fn hand_over(&mut self, longest: Duration, interrupt: &Interrupt) -> Result<(), Diag> {
        let _ = (longest, interrupt);
        Err(no_handshake())
    }

    /// Switches its output off and ends any motion as fast as the control can; called at every end of a run, after
    /// faults too.
    ///
    /// # Errors
    /// Where that is not certain.
    fn halt(&mut self) -> Result<(), Diag>;
}
