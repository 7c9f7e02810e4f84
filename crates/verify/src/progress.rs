//! The phases of a verification, and the callback to which progress is reported.

use terrace_core::progress::Task;

/// Phases of a verification, in order, for progress displays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Reading the program, the surface and the texture, and the files of the folder beside.
    Read,
    /// Comparing the files of the folder with each other where the inputs have changed, else with the part and the job.
    Files,
    /// Where every mark lies.
    Marks,
    /// Whether all texture is marked, and once.
    Coverage,
}

/// Told of every phase as it begins, with 0, and of the whole percent of it that is done, up to 100.
pub type Progress<'a> = &'a (dyn Fn(Phase, u8) + Sync);

impl Phase {
    /// All, in order. A folder whose inputs have changed goes through the first two alone.
    pub const ALL: [Self; 4] = [Self::Read, Self::Files, Self::Marks, Self::Coverage];

    /// The phase as a task whose progress is reported.
    pub(super) fn task(self, progress: Progress<'_>) -> Task<'_> {
        Task::new(move |percent| progress(self, percent))
    }
}
