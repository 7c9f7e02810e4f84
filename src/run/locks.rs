//! Locks of machines: no two runs drive one at the same time, whatever run files they have.
//!
//! A lock is an empty file in a folder of this computer, named after what it locks; it is held as long as the handle, and
//! released when its holder is killed.

use std::fs::{File, TryLockError};
use std::path::PathBuf;

use crate::diag::{Diag, Place};

/// The folder of the locks: it must be on a file system that has some.
fn folder() -> PathBuf {
    std::env::var_os("XDG_RUNTIME_DIR").map_or_else(std::env::temp_dir, PathBuf::from).join("terrace-locks")
}

/// Locks all that is named.
///
/// # Errors
/// `run-locked` where another run drives one of them; `run-lock` where that cannot be known: a run without a lock could be
/// one of two.
pub(super) fn take(identities: &[String]) -> Result<Vec<File>, Diag> {
    let folder = folder();
    let lock = |identity: &String| {
        let path = folder.join(format!("{}.lock", &blake3::hash(identity.as_bytes()).to_hex()[..32]));
        let at = |d: Diag| d.at(Place::file(path.display().to_string()));
        let failed = |e: &dyn std::fmt::Display| {
            let text = format!("{identity} cannot be locked against a second run: {e}");
            at(Diag::input("run-lock", text)
                .hint("set XDG_RUNTIME_DIR to a folder of this computer that can be written"))
        };
        std::fs::create_dir_all(&folder).map_err(|e| failed(&e))?;
        let file = File::options().create(true).write(true).truncate(false).open(&path).map_err(|e| failed(&e))?;
        match file.try_lock() {
            Ok(()) => Ok(file),
            Err(TryLockError::WouldBlock) => {
                let text = format!(
                    "{identity} is driven by another run, or the laser's command of a killed one is still marking"
                );
                Err(at(Diag::input("run-locked", text).hint("wait for its end")))
            }
            Err(TryLockError::Error(e)) => Err(failed(&e)),
        }
    };
    identities.iter().map(lock).collect()
}
