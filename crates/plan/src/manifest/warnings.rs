//! Warnings as job folders hold them.

use super::portable;
use terrace_core::diag::{Diag, Message};
use terrace_input::job::Job;

/// Warnings of a job. They name files as the job file does, and the job file without its folder: from wherever the job
/// is compiled, its manifest has the same bytes.
pub fn warnings(job: &Job, found: &[Diag]) -> Vec<Message> {
    let of_job = |d: &Diag| {
        let mut message = Message::from(d);
        message.file = message.file.map(|file| as_in_job_file(job, file));
        message
    };
    found.iter().map(of_job).collect()
}

fn as_in_job_file(job: &Job, file: String) -> String {
    if file == job.path.display().to_string() {
        let name = job.path.file_name().map(|name| name.to_string_lossy().into_owned());
        return name.unwrap_or(file);
    }
    let inputs = job.input_files();
    let named = inputs.iter().find(|(_, named)| job.relative(named).display().to_string() == file);
    named.map_or(file, |(_, named)| portable(&named.to_string_lossy()))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use terrace_core::diag::Place;
    use terrace_input::job::Overrides;

    #[test]
    fn files_are_named_as_in_the_job_file_wherever_that_lies() {
        let text = "[surface]\nfile = \"parts/hood.stl\"\nunit = \"mm\"\n[[texture]]\npattern = \"hatch\"\n\
                    pitch = \"1 mm\"\n[focus]\npdof = \"0.07 mm\"\n[machine]\nprofile = \"xyz-galvo-40\"\n[[pen]]\n\
                    name = \"p\"\nspeed = \"1 m/s\"\npower = \"50 %\"\nfrequency = \"60 kHz\"\n";
        for folder in ["", "jobs/", "/home/a/jobs/"] {
            let job = Job::parse(Path::new(&format!("{folder}hood.toml")), text, &Overrides::default());
            let job = job.unwrap_or_else(|e| panic!("{e}"));
            let named = |file: &str| {
                let found = [Diag::warning("steep", "steep places").at(Place::line(format!("{folder}{file}"), 3))];
                warnings(&job, &found)[0].file.clone().expect("a file")
            };
            assert_eq!(named("hood.toml"), "hood.toml");
            assert_eq!(named("parts/hood.stl"), "parts/hood.stl");
            assert_eq!(named("other.stl"), format!("{folder}other.stl"));
        }
    }
}
