//! The place of a job folder, and the exchange that puts a new one there.
//!
//! Consumes the path as given; links are followed, so the folder behind a link is replaced and the
//! link stays. Beside the target `NAME` live, only while a run writes, `.NAME.new` (the folder in the
//! making), `.NAME.old` (the one it replaces) and `.NAME.lock`. The lock is the system's own and ends
//! with its process, however that ends; a second run on the same target waits for it. `.NAME.claim` is another, held
//! by a batch from before it looks whether the folder is up to date until it is: of two batches one compiles.
//!
//! Promises that under the final name there is the whole old folder, the whole new one, or, between
//! two renames, none; [`Target::recover`] clears up what a stopped run left. This holds when a process is
//! killed, and, where the new folder and its parent are flushed, when power fails. Limits: file systems
//! without locks (some network shares) are used without one.

use std::ffi::OsString;
use std::fs::{self, File};
use std::path::{Component, Path, PathBuf};

use super::flush::{Flush, flush_tree};
use super::{failed, place};
use crate::diag::{Diag, Error};
use crate::job::Mode;
use crate::manifest::MANIFEST;

/// Where a job folder goes.
#[derive(Debug)]
pub(super) struct Target {
    /// The folder itself, absolute and free of links.
    pub(super) path: PathBuf,
    /// The folder in the making.
    pub(super) new: PathBuf,
    old: PathBuf,
    lock: PathBuf,
    claim: PathBuf,
    /// The file without which a folder of this kind is not whole.
    sign: &'static str,
}

/// A right at a target, such as that to write there; ends when dropped.
#[derive(Debug)]
pub(super) struct Lock {
    path: PathBuf,
    /// Holds the system's lock as long as it is open.
    _file: File,
}

impl Lock {
    /// Waits until no other process holds the lock of this file.
    fn of(path: &Path) -> Result<Self, Error> {
        let refused = |e: std::io::Error| failed("lock the output", path, &e);
        loop {
            let file = File::options().create(true).append(true).open(path).map_err(refused)?;
            match file.lock() {
                Err(e) if e.kind() != std::io::ErrorKind::Unsupported => return Err(refused(e)),
                _ => {}
            }
            // The run that held it before has removed its file: a lock on that one is worth nothing.
            if is_same(&file, path) {
                return Ok(Self { path: path.to_owned(), _file: file });
            }
        }
    }

    /// The lock of a file that is there and that no process holds.
    fn free(path: &Path) -> Option<Self> {
        let file = File::options().append(true).open(path).ok()?;
        let is_free = file.try_lock().is_ok() && is_same(&file, path);
        is_free.then(|| Self { path: path.to_owned(), _file: file })
    }
}

impl Drop for Lock {
    fn drop(&mut self) {
        // While it is still locked: whoever waits for it sees that it is gone, and makes its own.
        let _ = fs::remove_file(&self.path);
    }
}

impl Target {
    /// Finds the place of a folder that is whole when it holds the file `sign`; touches nothing.
    pub(super) fn find(given: &Path, sign: &'static str) -> Result<Self, Error> {
        let nameless = || {
            let d = Diag::input("output-name", "the output has no name of its own").at(place(given));
            Error::from(d.hint("name a folder, such as -o hood.job"))
        };
        if given.file_name().is_none() {
            return Err(nameless());
        }
        let path = resolved(given).map_err(|e| failed("find the folder", given, &e))?;
        let name = path.file_name().ok_or_else(nameless)?.to_owned();
        let hidden = |what: &str| {
            let mut hidden = OsString::from(".");
            hidden.push(&name);
            hidden.push(what);
            path.with_file_name(hidden)
        };
        Ok(Self {
            new: hidden(".new"),
            old: hidden(".old"),
            lock: hidden(".lock"),
            claim: hidden(".claim"),
            path,
            sign,
        })
    }

    /// Finishes or undoes what a stopped run left.
    pub(super) fn recover(&self) -> Result<(), Error> {
        if [&self.new, &self.old, &self.lock].into_iter().any(|p| is_there(p)) {
            let lock = self.lock()?;
            self.tidy(&lock)?;
        }
        // Of a process that was killed: it goes with the lock, unless another holds it.
        drop(Lock::free(&self.claim));
        Ok(())
    }

    /// Waits until no other run writes here.
    pub(super) fn lock(&self) -> Result<Lock, Error> {
        Lock::of(&self.lock)
    }

    /// Waits until no other run has the folder in work.
    pub(super) fn claim(&self) -> Result<Lock, Error> {
        Lock::of(&self.claim)
    }

    /// [`Target::recover`] under a lock that is held already.
    pub(super) fn tidy(&self, _lock: &Lock) -> Result<(), Error> {
        if is_there(&self.old) {
            // A replaced folder loses its sign first, so one that has it is whole.
            if !is_there(&self.path) && self.old.join(self.sign).is_file() {
                fs::rename(&self.old, &self.path).map_err(|e| failed("restore the old folder", &self.old, &e))?;
            } else {
                self.discard_old()?;
            }
        }
        if is_there(&self.new) {
            fs::remove_dir_all(&self.new).map_err(|e| failed("remove an unfinished folder", &self.new, &e))?;
        }
        Ok(())
    }

    /// Refuses a target that is something else than a job folder, is one of another mode, or holds one of the
    /// `inputs`.
    pub(super) fn may_be_replaced(&self, mode: Mode, inputs: &[PathBuf]) -> Result<(), Error> {
        if !is_there(&self.path) {
            return Ok(());
        }
        let Some(held) = mode_of(&self.path) else {
            let d = Diag::input("output-not-a-job", "the output exists and is not a job folder").at(place(&self.path));
            return Err(d.hint("name another folder with -o, or remove it yourself").into());
        };
        if held != mode {
            let text = format!("the output holds a job of mode {}, this one is of mode {}", held.name(), mode.name());
            let d = Diag::input("output-other-mode", text);
            let hint = "name another folder with -o, or remove it yourself";
            return Err(d.at(place(&self.path)).hint(hint).into());
        }
        for input in inputs {
            if fs::canonicalize(input).is_ok_and(|real| real.starts_with(&self.path)) {
                let text = format!("the output would replace the folder that holds the input {}", input.display());
                let d = Diag::input("output-holds-input", text).at(place(&self.path));
                return Err(d.hint("move the input, or name another folder with -o").into());
            }
        }
        Ok(())
    }

    /// Puts the finished new folder in place. Where that fails the old one is put back. The new folder is flushed
    /// before its name changes, and the folder around it before the old one is removed.
    pub(super) fn exchange(&self, _lock: &Lock, flush: &Flush<'_>) -> Result<(), Error> {
        flush_tree(&self.new, flush).map_err(|e| failed("put the new folder on the disk", &self.new, &e))?;
        let replaces = is_there(&self.path);
        if replaces {
            fs::rename(&self.path, &self.old).map_err(|e| failed("set the old folder aside", &self.path, &e))?;
        }
        if let Err(e) = fs::rename(&self.new, &self.path) {
            if replaces {
                // Should this fail too, the next run restores it.
                let _ = fs::rename(&self.old, &self.path);
            }
            return Err(failed("put the new folder in place", &self.path, &e));
        }
        let parent = self.path.parent().unwrap_or(Path::new("/"));
        flush(parent).map_err(|e| failed("put the folder on the disk", parent, &e))?;
        if replaces { self.discard_old() } else { Ok(()) }
    }

    /// Removes the replaced folder, its sign first.
    fn discard_old(&self) -> Result<(), Error> {
        let _ = fs::remove_file(self.old.join(self.sign));
        fs::remove_dir_all(&self.old).map_err(|e| failed("remove the replaced folder", &self.old, &e))
    }
}

/// Whether anything has this name, a link that leads nowhere included.
fn is_there(path: &Path) -> bool {
    fs::symlink_metadata(path).is_ok()
}

/// The mode of a job folder of any version; None where the folder is something else: other programs have files of
/// this name too.
fn mode_of(path: &Path) -> Option<Mode> {
    #[derive(serde::Deserialize)]
    struct Sign {
        #[serde(rename = "terrace")]
        _terrace: String,
        #[serde(rename = "schema")]
        _schema: u64,
        /// Stepped folders of the first schema have none.
        #[serde(default)]
        mode: Mode,
    }
    let bytes = fs::read(path.join(MANIFEST)).ok()?;
    serde_json::from_slice::<Sign>(&bytes).ok().map(|sign| sign.mode)
}

#[cfg(unix)]
fn is_same(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let (Ok(a), Ok(b)) = (file.metadata(), fs::metadata(path)) else { return false };
    (a.dev(), a.ino()) == (b.dev(), b.ino())
}

/// Elsewhere a file that is open keeps its name.
#[cfg(not(unix))]
fn is_same(_: &File, _: &Path) -> bool {
    true
}

/// The path, absolute and free of links; its last parts need not exist.
pub(super) fn resolved(path: &Path) -> std::io::Result<PathBuf> {
    let path = std::path::absolute(path)?;
    let mut rest = Vec::new();
    let mut known = path.as_path();
    let mut out = loop {
        // A link that leads nowhere is there, and is refused by name.
        if is_there(known) {
            break fs::canonicalize(known)?;
        }
        rest.extend(known.components().next_back());
        known = known.parent().unwrap_or(Path::new("/"));
    };
    for part in rest.into_iter().rev() {
        match part {
            Component::ParentDir => _ = out.pop(),
            other => out.push(other),
        }
    }
    Ok(out)
}
