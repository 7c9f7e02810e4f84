//! Marks a stepped job: the stage goes to each block and stands still, then the laser marks it.
//!
//! Consumes a job folder that verifies and a run file, which names the machine's two drivers; writes a journal. A
//! driver is one file under [`stage`] or [`laser`] behind one trait. Nothing is fired unless the user asks for it.
//!
//! Positions are commanded axis values: nm, and millionths of a degree for tilt axes.

pub mod laser;
pub mod settings;
pub mod stage;

use std::sync::atomic::{AtomicU8, Ordering};

/// What the user has asked of a run that is going on, by Ctrl-C.
#[derive(Debug, Default)]
pub struct Interrupt(AtomicU8);

impl Interrupt {
    /// One more request: the first ends the run after the block at work, the second at once.
    pub fn request(&self) {
        let _ = self.0.fetch_update(Ordering::SeqCst, Ordering::SeqCst, |n| (n < 2).then_some(n + 1));
    }
    /// Whether the run is to end after the block at work.
    pub fn is_requested(&self) -> bool {
        self.0.load(Ordering::SeqCst) >= 1
    }
    /// Whether the run is to end at once; drivers look at it while they wait.
    pub fn is_abort(&self) -> bool {
        self.0.load(Ordering::SeqCst) >= 2
    }
}
