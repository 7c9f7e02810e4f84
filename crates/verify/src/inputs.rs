//! Where the job file of a folder and what it reads lie.

use std::path::{Path, PathBuf};

use super::proof::Input;
use terrace_input::job::{Job, MachineInput};

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

    /// The files that a job is read from, for the verdict. A file lies elsewhere that is not beside the job folder, nor
    /// below where that lies.
    pub(super) fn used(&self, job: &Job, folder: &Path) -> Vec<Input> {
        let whole =
            |path: &Path| dunce::canonicalize(path).or_else(|_| std::path::absolute(path)).unwrap_or(path.into());
        let around = whole(folder).parent().map(Path::to_owned);
        let file = |role, path: &Path| {
            let path = whole(path);
            let is_elsewhere = !around.as_ref().is_some_and(|around| path.starts_with(around));
            Input { role, place: path.display().to_string(), is_elsewhere }
        };
        let mut all = vec![file("job", &self.job)];
        for (role, path) in job.input_files() {
            let input = file(role, &self.resolve(&path.to_string_lossy()));
            if !all.contains(&input) {
                all.push(input);
            }
        }
        if let MachineInput::Profile(name) = &job.machine {
            let place = format!("the built-in profile {name}");
            all.push(Input { role: "machine", place, is_elsewhere: false });
        }
        all
    }

    /// A path that is relative to the job file.
    pub(super) fn resolve(&self, file: &str) -> PathBuf {
        self.job.parent().unwrap_or(Path::new("")).join(file)
    }
}
