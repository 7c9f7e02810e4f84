//! Journals of one job under other names: a folder that was renamed or copied has its journal where it was.
//!
//! A journal is noted by the hash of its manifest in a folder of the user's, and looked for beside the job folder.

use std::fs;
use std::path::{Path, PathBuf};

use super::journal;
use crate::diag::{Diag, Place};

/// Refuses to begin a job that was begun with another journal.
///
/// # Errors
/// `run-journal-elsewhere`.
pub(super) fn refuse(own: &Path, folder: &Path, manifest: &str) -> Result<(), Diag> {
    let real = |path: &Path| fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    let own = real(own);
    let mut others: Vec<PathBuf> = noted(manifest).into_iter().chain(beside(folder)).map(|path| real(&path)).collect();
    others.sort();
    others.dedup();
    for other in others.into_iter().filter(|other| *other != own) {
        let Some(count @ 1..) = journal::begun(&other, manifest) else { continue };
        let text = format!("this job was begun with another journal, in which {count} blocks are begun or done");
        let hint = format!(
            "go on with --journal {}; to mark another part, run with --again; delete that journal if its part is gone",
            other.display()
        );
        return Err(Diag::input("run-journal-elsewhere", text).at(Place::file(other.display().to_string())).hint(hint));
    }
    Ok(())
}

/// Notes a journal by its manifest.
///
/// # Errors
/// `run-journal-note` where that cannot be written.
pub(super) fn note(own: &Path, manifest: &str) -> Result<(), Diag> {
    let path = note_of(manifest);
    let own = fs::canonicalize(own).unwrap_or_else(|_| own.to_owned()).display().to_string();
    let text = fs::read_to_string(&path).unwrap_or_default();
    if text.lines().any(|line| line == own) {
        return Ok(());
    }
    let written = path.parent().map_or(Ok(()), fs::create_dir_all).and_then(|()| fs::write(&path, text + &own + "\n"));
    written.map_err(|e| {
        Diag::input("run-journal-note", format!("cannot note the journal of this job: {e}"))
            .at(Place::file(path.display().to_string()))
            .hint("make the folder writable, or set XDG_STATE_HOME to one that is")
    })
}

/// Journals that were noted of a manifest.
fn noted(manifest: &str) -> Vec<PathBuf> {
    fs::read_to_string(note_of(manifest)).unwrap_or_default().lines().map(PathBuf::from).collect()
}

/// Journals beside a job folder.
fn beside(folder: &Path) -> Vec<PathBuf> {
    let whole = fs::canonicalize(folder).unwrap_or_else(|_| folder.to_owned());
    let entries = whole.parent().and_then(|parent| fs::read_dir(parent).ok());
    let paths = entries.into_iter().flatten().flatten().map(|entry| entry.path());
    paths.filter(|path| path.to_string_lossy().ends_with(".run.jsonl")).collect()
}

/// The note of a manifest: lines with the paths of its journals.
fn note_of(manifest: &str) -> PathBuf {
    let set = |name: &str| std::env::var_os(name).filter(|v| !v.is_empty()).map(PathBuf::from);
    let state = || set("XDG_STATE_HOME").or_else(|| Some(set("HOME")?.join(".local/state")));
    let folder = if cfg!(windows) { set("LOCALAPPDATA") } else { state() };
    let name = manifest.chars().filter(char::is_ascii_alphanumeric).take(64).collect::<String>();
    folder.unwrap_or_else(std::env::temp_dir).join("terrace").join("runs").join(name)
}
