//! Locks of machines: no two runs on a computer drive one at the same time, whatever run files they have and whoever
//! starts them.
//!
//! A lock is an empty file, named after what it locks, in a folder that all users of the computer share; it is held as
//! long as the handle, and released when its holder is killed. So it is not in a folder of the user's such as
//! `XDG_RUNTIME_DIR`, which a service or another user has not.

use std::fs::{self, File, TryLockError};
use std::io::{Error, ErrorKind};
use std::path::{Path, PathBuf};

use terrace_core::diag::{Diag, Place};

/// Names another folder for the locks.
const FOLDER: &str = "TERRACE_LOCKS";

/// The folder of the locks: it must be on a file system of this computer that has some.
fn folder() -> PathBuf {
    let named = |name: &str| std::env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute());
    let shared = || if cfg!(windows) { named("ProgramData").unwrap_or_else(std::env::temp_dir) } else { "/tmp".into() };
    named(FOLDER).unwrap_or_else(|| shared().join("terrace-locks"))
}

/// Locks all that is named.
///
/// # Errors
/// `run-locked` where another run drives one of them; `run-lock` where that cannot be known: a run without a lock could
/// be one of two.
pub(super) fn take(identities: &[String]) -> Result<Vec<File>, Diag> {
    take_in(&folder(), identities)
}

fn take_in(folder: &Path, identities: &[String]) -> Result<Vec<File>, Diag> {
    identities.iter().map(|identity| lock(folder, identity)).collect()
}

/// Locks one machine or port.
fn lock(folder: &Path, identity: &str) -> Result<File, Diag> {
    let path = folder.join(format!("{}.lock", &blake3::hash(identity.as_bytes()).to_hex()[..32]));
    let opened = make_folder(folder).and_then(|()| open(&path));
    let file = opened.map_err(|e| cannot_lock(identity, &path, &e))?;
    match file.try_lock() {
        Ok(()) => Ok(file),
        Err(TryLockError::WouldBlock) => {
            let text =
                format!("{identity} is driven by another run, or the laser's command of a killed one is still marking");
            let d = Diag::input("run-locked", text).hint("wait for its end");
            Err(d.at(Place::file(path.display().to_string())))
        }
        Err(TryLockError::Error(e)) => Err(cannot_lock(identity, &path, &e)),
    }
}

/// The fault of a lock that the file system refuses.
fn cannot_lock(identity: &str, path: &Path, e: &Error) -> Diag {
    let text = format!("{identity} cannot be locked against a second run: {e}");
    let hint = format!(
        "all users must be able to write to that folder; or set {FOLDER} to one of this computer, the same for all who \
         run this machine"
    );
    Diag::input("run-lock", text).hint(hint).at(Place::file(path.display().to_string()))
}

/// Makes the folder, in which every user may make files and remove none of another.
fn make_folder(folder: &Path) -> Result<(), Error> {
    if folder.is_dir() {
        return Ok(());
    }
    folder.parent().map_or(Ok(()), fs::create_dir_all)?;
    match fs::create_dir(folder) {
        Err(e) if e.kind() == ErrorKind::AlreadyExists => Ok(()),
        Err(e) => Err(e),
        Ok(()) => allow(folder, 0o1777),
    }
}

/// Opens the file of a lock, or makes it. What another user has made can be read, and that is enough to lock it: Linux
/// refuses to open it for writing in a shared folder, or to create it once more.
fn open(path: &Path) -> Result<File, Error> {
    loop {
        match path.symlink_metadata() {
            Ok(found) if !found.is_file() => return Err(Error::other("this is not a regular file")),
            // Nothing can be read from it, and nothing has to be written.
            Ok(_) => return File::open(path),
            Err(e) if e.kind() == ErrorKind::NotFound => {}
            Err(e) => return Err(e),
        }
        match File::options().write(true).create_new(true).open(path) {
            Err(e) if e.kind() == ErrorKind::AlreadyExists => {}
            Err(e) => return Err(e),
            Ok(_) => allow(path, 0o644)?,
        }
    }
}

/// Gives others access, whatever the user's mask.
fn allow(path: &Path, mode: u32) -> Result<(), Error> {
    #[cfg(unix)]
    return fs::set_permissions(path, std::os::unix::fs::PermissionsExt::from_mode(mode));
    #[cfg(not(unix))]
    return {
        // Windows: those of the folder around it are inherited.
        let _ = (path, mode);
        Ok(())
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(names: &[&str]) -> Vec<String> {
        names.iter().map(|name| (*name).to_owned()).collect()
    }

    #[test]
    fn what_one_run_holds_another_is_refused_until_it_ends() {
        let dir = tempfile::tempdir().expect("a folder");
        let folder = dir.path().join("a/locks");
        let first = take_in(&folder, &names(&["machine m", "port p"])).expect("free");
        for shared in ["machine m", "port p"] {
            let e = take_in(&folder, &names(&["machine other", shared])).expect_err("held");
            assert!(e.code == "run-locked" && e.message.contains(shared), "{e}");
        }
        take_in(&folder, &names(&["machine other", "port q"])).expect("free");
        drop(first);
        take_in(&folder, &names(&["machine m", "port p"])).expect("released");
    }

    #[cfg(unix)]
    #[test]
    fn every_user_can_lock_what_another_has_made() {
        use std::os::unix::fs::PermissionsExt;
        let dir = tempfile::tempdir().expect("a folder");
        let folder = dir.path().join("locks");
        drop(take_in(&folder, &names(&["machine m"])).expect("free"));
        let mode = |path: &Path| path.metadata().expect("there").permissions().mode() & 0o7777;
        let file = fs::read_dir(&folder).expect("a folder").next().expect("a lock").expect("readable").path();
        assert_eq!((mode(&folder), mode(&file)), (0o1777, 0o644));
        // What can only be read, as the file of another user, is locked all the same.
        fs::set_permissions(&file, fs::Permissions::from_mode(0o444)).expect("set");
        let held = take_in(&folder, &names(&["machine m"])).expect("free");
        assert_eq!(take_in(&folder, &names(&["machine m"])).expect_err("held").code, "run-locked");
        drop(held);
    }

    #[test]
    fn a_run_without_a_lock_is_refused() {
        let dir = tempfile::tempdir().expect("a folder");
        let folder = dir.path().join("file");
        fs::write(&folder, "").expect("written");
        let e = take_in(&folder, &names(&["machine m"])).expect_err("no folder");
        assert!(e.code == "run-lock" && e.hint.contains(FOLDER), "{e}");
        // Something that is not a file has its name.
        let folder = dir.path().join("locks");
        drop(take_in(&folder, &names(&["machine m"])).expect("free"));
        let file = fs::read_dir(&folder).expect("a folder").next().expect("a lock").expect("readable").path();
        fs::remove_file(&file).expect("removed");
        fs::create_dir(&file).expect("made");
        assert_eq!(take_in(&folder, &names(&["machine m"])).expect_err("a folder").code, "run-lock");
    }
}
