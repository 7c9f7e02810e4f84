//! Putting what was written on the disk itself, so that it is there after a power failure.
//!
//! A file that was written and a name that was changed live in the system's caches for up to half a minute, and
//! reach the disk in any order. A new folder is flushed with everything in it before it takes its place, and the
//! folder that lists it after; so under the final name there is the old folder or the new one, whole.

use std::fs::{self, File};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

use terrace_core::parallel;

/// Whether a command waits until what it wrote is on the disk.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Durability {
    /// The result outlives a power failure.
    #[default]
    Synced,
    /// The result outlives the end of the process, however it ends, and no power failure.
    Unsynced,
}

/// Puts one path on the disk: the bytes of a file, or the names in a folder.
pub(super) type Flush<'a> = dyn Fn(&Path) -> io::Result<()> + Sync + 'a;

impl Durability {
    /// What puts a path on the disk.
    pub fn flush(self) -> &'static Flush<'static> {
        match self {
            Self::Synced => &synced,
            Self::Unsynced => &|_| Ok(()),
        }
    }
}

fn synced(path: &Path) -> io::Result<()> {
    // Windows flushes only what is open for writing, and writes changes of folders through.
    let opened = match path.is_dir() {
        true if !cfg!(unix) => return Ok(()),
        is_folder => File::options().read(true).write(!is_folder && !cfg!(unix)).open(path)?,
    };
    match opened.sync_all() {
        // Pipes, devices and some network shares have nothing to flush.
        Err(e) if matches!(e.kind(), ErrorKind::InvalidInput | ErrorKind::Unsupported) => Ok(()),
        done => done,
    }
}

/// Flushes a folder with everything in it: files first, then folders from the innermost out.
pub(super) fn flush_tree(folder: &Path, flush: &Flush<'_>) -> io::Result<()> {
    let mut files = Vec::new();
    let mut folders = Vec::new();
    let mut open = vec![folder.to_owned()];
    while let Some(folder) = open.pop() {
        for entry in fs::read_dir(&folder)? {
            let entry = entry?;
            if entry.file_type()?.is_dir() { open.push(entry.path()) } else { files.push(entry.path()) }
        }
        // A folder stands behind the one that holds it.
        folders.push(folder);
    }
    parallel::map(files.len(), |i| flush(&files[i])).into_iter().collect::<io::Result<()>>()?;
    folders.iter().rev().try_for_each(|folder| flush(folder))
}

/// Makes a folder and those around it that are missing; returns the folders whose lists of names have changed,
/// the innermost first.
pub(super) fn make_all(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let missing = folder.ancestors().take_while(|f| !f.as_os_str().is_empty() && !f.exists());
    let changed = missing.filter_map(Path::parent).map(Path::to_owned).collect();
    fs::create_dir_all(folder)?;
    Ok(changed)
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use super::*;

    #[test]
    fn a_tree_is_flushed_from_the_files_out() {
        let dir = tempfile::tempdir().expect("a folder");
        let top = dir.path().join("top");
        for folder in ["top/a/b", "top/c"] {
            fs::create_dir_all(dir.path().join(folder)).expect("made");
        }
        for file in ["1", "a/2", "a/b/3", "c/4"] {
            fs::write(top.join(file), file).expect("written");
        }
        let seen = Mutex::new(Vec::new());
        let flush = |path: &Path| {
            seen.lock().expect("no panic").push(path.to_owned());
            Ok(())
        };
        flush_tree(&top, &flush).expect("flushed");
        let seen = seen.into_inner().expect("no panic");
        let (files, folders) = seen.split_at(4);
        assert!(files.iter().all(|f| f.is_file()) && folders.iter().all(|f| f.is_dir()), "{seen:?}");
        let at = |name: &str| folders.iter().position(|f| *f == top.join(name)).expect("flushed");
        assert!(at("a/b") < at("a") && at("a") < folders.len() - 1 && at("c") < folders.len() - 1, "{folders:?}");
        assert_eq!((folders.len(), folders.last()), (4, Some(&top)));
    }

    #[test]
    fn a_flush_that_fails_ends_the_work() {
        let dir = tempfile::tempdir().expect("a folder");
        fs::write(dir.path().join("x"), "x").expect("written");
        let fails = |_: &Path| Err(io::Error::other("no"));
        assert!(flush_tree(dir.path(), &fails).is_err());
        assert!(flush_tree(dir.path(), Durability::Synced.flush()).is_ok());
        assert!(Durability::Synced.flush()(&dir.path().join("absent")).is_err());
    }

    #[test]
    fn folders_around_a_new_one_are_named_from_the_innermost_out() {
        let dir = tempfile::tempdir().expect("a folder");
        let at = |name: &str| dir.path().join(name);
        assert_eq!(make_all(&at("a/b")).expect("made"), [at("a"), dir.path().to_owned()]);
        assert_eq!(make_all(&at("a/b")).expect("there"), Vec::<PathBuf>::new());
    }
}
