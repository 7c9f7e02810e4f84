//! The phases of a compilation, and the callback to which progress is reported.

use terrace_core::progress::Task;
use terrace_input::job::{Job, Mode};

/// Phases of a compilation, in order, for progress displays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Reading surface and texture.
    Read,
    /// Where the texture touches the surface, and the stops of every method.
    Footprint,
    /// Cutting strokes.
    Split,
    /// Ordering strokes and stops; of a job in several passes, of the first.
    Order,
    /// All passes but the first.
    Passes,
    /// Motion of stage and scanner on the fly.
    Motion,
    /// Searching for a fixture angle (`orient` alone).
    Lean,
    /// Writing the files of the folder.
    Write,
    /// Drawing pictures and report.
    Draw,
}

/// Told of every phase as it begins, with 0, and of the whole percent of it that is done, up to 100 where the phase
/// ends without an error. Called from any thread, one call at a time.
pub type Progress<'a> = &'a (dyn Fn(Phase, u8) + Sync);

impl Phase {
    /// The phase as a task whose progress is reported.
    pub fn task(self, progress: Progress<'_>) -> Task<'_> {
        Task::new(move |percent| progress(self, percent))
    }
}

/// The phases of planning a job, in order.
pub fn phases(job: &Job) -> Vec<Phase> {
    use Phase::{Footprint, Motion, Order, Passes, Read, Split};
    match job.mode {
        Mode::OnTheFly => vec![Read, Footprint, Split, Order, Motion],
        Mode::Stepped if job.passes.count > 1 => vec![Read, Footprint, Split, Order, Passes],
        Mode::Stepped => vec![Read, Footprint, Split, Order],
    }
}

/// The phases of writing the folder of a job, in order.
pub fn phases_of_writing(job: &Job) -> Vec<Phase> {
    match job.mode {
        Mode::OnTheFly | Mode::Stepped => vec![Phase::Write, Phase::Draw],
    }
}
