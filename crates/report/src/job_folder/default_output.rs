//! Where a job's folder lies when nobody says where.

use std::path::{Path, PathBuf};

use terrace_input::job::Mode;

/// Folder of a job file's outputs: `hood.toml` makes `hood.job` next to it, or `hood.fly.job` of an on-the-fly job, so
/// that neither replaces the other.
pub fn default_output(job: &Path, mode: Mode) -> PathBuf {
    match mode {
        Mode::Stepped => job.with_extension("job"),
        Mode::OnTheFly => job.with_extension("fly.job"),
    }
}
