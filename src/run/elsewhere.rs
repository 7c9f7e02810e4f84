//! Journals of one job under other names: a folder that was renamed or copied has its journal where it was.
//!
//! A journal is noted by the hash of its manifest in a folder of the user's, and looked for beside the job folder. One
//! that was copied is not noted: it may be older than what it was copied from.
//!
//! What `terrace resume` leaves of a job has a manifest and a journal of its own and the program of the whole. Journals
//! are noted by the hash of that too, so that no block of a part is marked from both folders.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

use super::Order;
use super::folder::Folder;
use super::journal;
use terrace_core::diag::{Diag, Place};

/// The journal of an order for the job of a manifest: the one that it names or the one beside its folder; where that
/// has nothing of the job, the one with which the job was begun.
///
/// # Errors
/// `run-journal-elsewhere` where the job was begun with other journals than this one, and which counts cannot be known.
pub(super) fn choose(order: &Order<'_>, manifest: &str) -> Result<PathBuf, Diag> {
    let own = order.journal.map_or_else(|| journal::beside(order.folder), Path::to_owned);
    let others = others(&own, order.folder, manifest);
    let is_begun = journal::begun(&own, manifest).is_some();
    match others.as_slice() {
        [] => Ok(own),
        _ if is_begun && noted(manifest).contains(&real(&own)) => Ok(own),
        [(only, _)] if !is_begun && order.journal.is_none() => Ok(only.clone()),
        _ if order.journal_choice.again => Ok(own),
        [(other, count), ..] => {
            let text = format!("this job was begun with another journal, in which {count} blocks are begun or done");
            let with = Order { journal: Some(other.as_path()), ..*order };
            let hint = format!(
                "to continue with that part: {}; to mark another part: {}; where that part is gone, delete that journal",
                with.command("--arm --go-on"),
                order.command("--arm --again")
            );
            Err(Diag::input("run-journal-elsewhere", text).at(Place::file(other.display().to_string())).hint(hint))
        }
    }
}

/// The journal that has most blocks of a job as done, on its last part, with these blocks: whichever it was begun with.
fn done(folder: &Path, manifest: &str) -> Option<(PathBuf, Vec<String>)> {
    let own = journal::beside(folder);
    let paths = std::iter::once(own).chain(noted(manifest)).chain(beside(folder));
    let records = paths.map(|path| (journal::done(&path, manifest), path)).filter(|(done, _)| !done.is_empty());
    records.max_by_key(|(done, _)| done.len()).map(|(done, path)| (path, done))
}

/// Blocks of a journal that was written from one folder.
pub(super) struct Marks {
    pub journal: PathBuf,
    pub blocks: Vec<String>,
}

/// The blocks that are marked on the part that is at work, from this folder and from others with its program.
pub(super) fn marked(folder: &Folder) -> Vec<Marks> {
    let own = done(&folder.path, &folder.manifest);
    let since_s = own.as_ref().and_then(|(path, _)| journal::record_of(path, &folder.manifest)).map(|r| r.since_s);
    let others = of_other_folders(folder, since_s);
    own.map(|(journal, blocks)| Marks { journal, blocks }).into_iter().chain(others).collect()
}

/// Refuses to mark blocks that are marked on the part that is at work from another folder with the same program: that of
/// the whole job, or of what is left of it.
///
/// # Errors
/// `run-marked` with the journal of the other folder.
pub(super) fn refuse_marked(order: &Order<'_>, own: &Path, folder: &Folder) -> Result<(), Diag> {
    if order.journal_choice.again {
        return Ok(());
    }
    let record = journal::record_of(own, &folder.manifest);
    let is_done = |id: &str| record.as_ref().is_some_and(|record| record.is_done(id));
    let left: BTreeSet<&str> = folder.blocks.iter().map(|b| b.id.as_str()).filter(|id| !is_done(id)).collect();
    for Marks { journal, blocks } in of_other_folders(folder, record.as_ref().map(|record| record.since_s)) {
        let twice: Vec<&String> = blocks.iter().filter(|id| left.contains(id.as_str())).collect();
        let (Some(first), Some(last)) = (twice.first(), twice.last()) else { continue };
        let text = format!(
            "{} of the blocks that are left, {first} to {last}, were marked from another folder of this job, or may have \
             been",
            twice.len()
        );
        let hint = format!(
            "for what is left now write a folder with terrace resume, from the block after them; to mark another part: {}",
            order.command("--arm --again")
        );
        return Err(Diag::input("run-marked", text).at(Place::file(journal.display().to_string())).hint(hint));
    }
    Ok(())
}

/// What other folders with the program of this one have marked, since its part was begun.
fn of_other_folders(folder: &Folder, since_s: Option<f64>) -> Vec<Marks> {
    let Some(program) = folder.program() else { return Vec::new() };
    let mut paths: Vec<PathBuf> =
        noted(program).into_iter().chain(beside(&folder.path)).map(|path| real(&path)).collect();
    paths.sort();
    paths.dedup();
    let of = |path: PathBuf| {
        let record = journal::record_of_program(&path, program)?;
        if record.manifest.as_ref() == Some(&folder.manifest) {
            return None;
        }
        let blocks: Vec<String> = record.marked_since(since_s.unwrap_or(0.0)).map(str::to_owned).collect();
        (!blocks.is_empty()).then_some(Marks { journal: path, blocks })
    };
    paths.into_iter().filter_map(of).collect()
}

/// The other journals in which the job is begun, and how many blocks.
fn others(own: &Path, folder: &Path, manifest: &str) -> Vec<(PathBuf, usize)> {
    let own = real(own);
    let mut paths: Vec<PathBuf> = noted(manifest).into_iter().chain(beside(folder)).map(|path| real(&path)).collect();
    paths.sort();
    paths.dedup();
    let others = paths.into_iter().filter(|path| *path != own);
    others.filter_map(|path| journal::begun(&path, manifest).map(|count| (path, count))).collect()
}

/// Notes a journal by the hash of its manifest or of its program; returns when that is on the disk.
///
/// # Errors
/// `run-journal-note` where it cannot be written.
pub(super) fn note(own: &Path, hash: &str) -> Result<(), Diag> {
    let path = note_of(hash);
    let own = real(own);
    if noted(hash).contains(&own) {
        return Ok(());
    }
    append(&path, &own).map_err(|e| {
        Diag::input("run-journal-note", format!("cannot note the journal of this job: {e}"))
            .at(Place::file(path.display().to_string()))
            .hint("make the folder writable, or set XDG_STATE_HOME to one that is; the journal's path must be Unicode")
    })
}

/// The folder in which journals are noted, where it can be written.
///
/// # Errors
/// Why it cannot.
pub(super) fn writable() -> Result<PathBuf, String> {
    let folder = notes();
    let told = |e: std::io::Error| format!("{}: {e}", folder.display());
    fs::create_dir_all(&folder).map_err(told)?;
    let tried = folder.join(format!(".tried-{}", std::process::id()));
    File::create(&tried).and_then(|_| fs::remove_file(&tried)).map_err(told)?;
    Ok(folder)
}

/// Appends the path of a journal to a note; returns when that is on the disk.
fn append(note: &Path, journal: &Path) -> std::io::Result<()> {
    // A line feed in a name must not make two of it.
    let line = serde_json::to_string(journal).map_err(|e| std::io::Error::new(ErrorKind::InvalidInput, e))?;
    note.parent().map_or(Ok(()), fs::create_dir_all)?;
    let mut file = File::options().create(true).append(true).open(note)?;
    // A line that was not completed ends here.
    file.write_all(format!("\n{line}\n").as_bytes())?;
    file.sync_all()
}

/// Journals that were noted of a hash.
fn noted(hash: &str) -> Vec<PathBuf> {
    let text = fs::read_to_string(note_of(hash)).unwrap_or_default();
    text.lines().filter_map(|line| serde_json::from_str(line).ok()).collect()
}

/// Journals beside a job folder.
fn beside(folder: &Path) -> Vec<PathBuf> {
    let entries = real(folder).parent().and_then(|parent| fs::read_dir(parent).ok());
    let paths = entries.into_iter().flatten().flatten().map(|entry| entry.path());
    paths.filter(|path| path.to_string_lossy().ends_with(".run.jsonl")).collect()
}

/// A path by which a file has one name, where it is there.
fn real(path: &Path) -> PathBuf {
    dunce::canonicalize(path).unwrap_or_else(|_| path.to_owned())
}

/// The note of a hash: lines with the paths of its journals, as JSON.
fn note_of(hash: &str) -> PathBuf {
    notes().join(hash)
}

/// The folder of the notes.
fn notes() -> PathBuf {
    let set = |name: &str| std::env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute());
    let state = || set("XDG_STATE_HOME").or_else(|| Some(set("HOME")?.join(".local/state")));
    let folder = if cfg!(windows) { set("LOCALAPPDATA") } else { state() };
    folder.unwrap_or_else(std::env::temp_dir).join("terrace").join("runs")
}
