//! What was named in place of a job folder.

use std::path::{Path, PathBuf};

use super::show;
use terrace_core::diag::{Diag, Error, Place, edits};
use terrace_input::job::Mode;
use terrace_report::job_folder;

/// The file that makes a folder a job folder.
const MANIFEST: &str = "manifest.json";

/// Most folders that a hint names.
const SHOWN: usize = 3;

/// Refuses what is not a job folder where another one was most likely meant; what is wrong with a folder is reported by
/// the command that reads it.
///
/// # Errors
/// `job-folder`.
pub fn job_folder(path: &Path) -> Result<(), Error> {
    if path.join(MANIFEST).exists() {
        return Ok(());
    }
    let refused = |what: &str, hint: String| {
        Err(Diag::input("job-folder", what).at(Place::file(path.display().to_string())).hint(hint).into())
    };
    if path.file_name().is_some_and(|name| name == MANIFEST) && path.is_file() {
        let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        return refused("this is the manifest of a folder, not a job folder", mean(&[folder.to_owned()]));
    }
    if path.is_file() {
        let own: Vec<PathBuf> = [Mode::Stepped, Mode::OnTheFly]
            .map(|mode| job_folder::default_output(path, mode))
            .into_iter()
            .filter(|folder| is_job_folder(folder))
            .collect();
        let is_job = path.extension().is_some_and(|e| e == "toml");
        let hint = match (own.is_empty(), is_job) {
            (false, _) => mean(&own),
            (true, true) => format!("make its folder first: terrace compile {} --verify", show::shown(path)),
            (true, false) => "name the folder that `terrace compile` has made".into(),
        };
        return refused(
            if is_job { "this is a job file, not a job folder" } else { "this is a file, not a job folder" },
            hint,
        );
    }
    let near = if path.is_dir() { folders_in(path, |_| true) } else { near(path) };
    if near.is_empty() {
        return match job_of(path) {
            Some(job) => {
                let hint = format!("make it first: terrace compile {} --verify", show::shown(&job));
                refused("there is no such job folder", hint)
            }
            None => Ok(()),
        };
    }
    refused(
        if path.is_dir() { "this is a folder, not a job folder" } else { "there is no such job folder" },
        mean(&near),
    )
}

/// The job file whose folder a path would be.
fn job_of(folder: &Path) -> Option<PathBuf> {
    let name = folder.file_name()?.to_str()?;
    let stem = name.strip_suffix(".fly.job").or_else(|| name.strip_suffix(".job"))?;
    Some(folder.with_file_name(format!("{stem}.toml"))).filter(|job| job.is_file())
}

fn is_job_folder(path: &Path) -> bool {
    path.join(MANIFEST).is_file()
}

/// The job folders in a folder whose names are wanted.
fn folders_in(folder: &Path, is_wanted: impl Fn(&str) -> bool) -> Vec<PathBuf> {
    // Folders may be huge; this is only for a hint.
    const MOST: usize = 1000;
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let entries = std::fs::read_dir(folder).into_iter().flatten().take(MOST).flatten();
    let wanted = entries.filter(|entry| is_wanted(&entry.file_name().to_string_lossy()));
    let mut found: Vec<PathBuf> = wanted
        .map(|entry| entry.path())
        .filter(|path| is_job_folder(path) && !path.file_name().is_some_and(|n| n.to_string_lossy().starts_with('.')))
        .map(|path| path.strip_prefix("./").map(Path::to_owned).unwrap_or(path))
        .collect();
    found.sort();
    found
}

/// Job folders beside a path that is not there, with nearly its name or that name and an extension.
fn near(path: &Path) -> Vec<PathBuf> {
    let (Some(folder), Some(name)) = (path.parent(), path.file_name()) else { return Vec::new() };
    let name = name.to_string_lossy().to_lowercase();
    folders_in(folder, |other| {
        let other = other.to_lowercase();
        let is_longer =
            other.strip_prefix(&name).is_some_and(|rest| matches!(rest, ".job" | ".fly.job" | "job" | "fly.job"));
        is_longer || edits(&name, &other) <= 2 && name.len() > 5
    })
}

fn mean(folders: &[PathBuf]) -> String {
    let names: Vec<String> = folders.iter().take(SHOWN).map(|folder| folder.display().to_string()).collect();
    format!("did you mean {}?", names.join(" or "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_folder_that_was_meant_is_offered() {
        let dir = tempfile::tempdir().expect("a folder");
        let at = |name: &str| dir.path().join(name);
        for name in ["hood.job", "hood.fly.job", "parts/door.job"] {
            std::fs::create_dir_all(at(name)).expect("made");
            std::fs::write(at(name).join(MANIFEST), "{}").expect("written");
        }
        for name in ["hood.toml", "door.toml", "x.stl"] {
            std::fs::write(at(name), "").expect("written");
        }
        assert!(job_folder(&at("hood.job")).is_ok());
        let refusal = |name: &str| match job_folder(&at(name)) {
            Ok(()) => String::new(),
            Err(e) => format!("{}|{}", e.diags()[0].message, e.diags()[0].hint)
                .replace(&format!("{}/", at("").display().to_string().trim_end_matches('/')), ""),
        };
        assert_eq!(refusal("hood.toml"), "this is a job file, not a job folder|did you mean hood.job or hood.fly.job?");
        assert_eq!(
            refusal("door.toml"),
            "this is a job file, not a job folder|make its folder first: terrace compile door.toml --verify"
        );
        assert!(refusal("x.stl").starts_with("this is a file, not a job folder|name the folder"));
        assert_eq!(
            refusal("hood.job/manifest.json"),
            "this is the manifest of a folder, not a job folder|did you mean hood.job?"
        );
        assert_eq!(refusal("parts"), "this is a folder, not a job folder|did you mean parts/door.job?");
        assert_eq!(refusal("hood"), "there is no such job folder|did you mean hood.fly.job or hood.job?");
        assert_eq!(refusal("hodo.job"), "there is no such job folder|did you mean hood.job?");
        std::fs::write(at("lid.toml"), "").expect("written");
        let hint = "there is no such job folder|make it first: terrace compile lid.toml --verify";
        assert_eq!(refusal("lid.job"), hint);
        assert_eq!(refusal("lid.fly.job"), hint);
        // Nothing is known to be meant: the command says what is wrong.
        assert_eq!(refusal("elsewhere.job"), "");
    }
}
