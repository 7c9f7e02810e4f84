//! Where the job file of a folder and what it reads lie.

use std::path::{Path, PathBuf};

/// The job file and the folder that its inputs are relative to.
pub(super) struct Inputs {
    /// The job file.
    pub(super) job: PathBuf,
}

impl Inputs {
    /// The job file as the manifest names it, or the file of that name in `inputs_override`.
    pub(super) fn locate(folder: &Path, job_file: &str, inputs_override: Option<&Path>) -> Self {
        let named = Path::new(job_file);
        let job = match inputs_override {
            Some(root) => root.join(named.file_name().unwrap_or(named.as_os_str())),
            None => folder.join(named),
        };
        Self { job }
    }

    /// A path that is relative to the job file.
    pub(super) fn resolve(&self, file: &str) -> PathBuf {
        self.job.parent().unwrap_or(Path::new("")).join(file)
    }
}
