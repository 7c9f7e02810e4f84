//! Folders in the making, and folders that are replaced: names that no other process uses.
//!
//! Beside the folder `NAME` they are `.NAME.SYSTEM-HOST-PID.new` and `.NAME.SYSTEM-HOST-PID.old`. Two processes that
//! write one folder at once, from two computers or two systems that do not see each other's locks, thus never touch
//! what the other has in the making.

use std::ffi::{OsStr, OsString};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;
use std::time::Duration;

use terrace_core::host;

/// How long nothing must have changed in what another computer, or another system, has left: nobody here knows
/// whether its process still runs.
const ABANDONED: Duration = Duration::from_hours(24);

/// The system and the computer: `linux-bench3`.
static COMPUTER: LazyLock<String> = LazyLock::new(|| format!("{}-{}", std::env::consts::OS, host::name()));

/// What a temporary folder is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// In the making; once names are exchanged, replaced.
    New,
    /// Replaced, where names cannot be exchanged.
    Old,
}

impl Kind {
    fn ending(self) -> &'static str {
        match self {
            Self::New => ".new",
            Self::Old => ".old",
        }
    }
}

/// The name of this process for a temporary folder beside `path`, whose last part is `name`.
pub(super) fn own(path: &Path, name: &OsStr, kind: Kind) -> PathBuf {
    let mut own = OsString::from(".");
    own.push(name);
    own.push(format!(".{}-{}{}", *COMPUTER, std::process::id(), kind.ending()));
    path.with_file_name(own)
}

/// The temporary folders beside `path` whose processes have ended, as far as can be known.
pub(super) fn abandoned(path: &Path, name: &OsStr) -> io::Result<Vec<(Kind, PathBuf)>> {
    let Some(parent) = path.parent() else { return Ok(Vec::new()) };
    let mut found = Vec::new();
    for entry in fs::read_dir(parent)? {
        let entry = entry?;
        let Some((kind, owner)) = parts(&entry.file_name(), name) else { continue };
        if has_ended(&owner) || is_aged(&entry) {
            found.push((kind, entry.path()));
        }
    }
    Ok(found)
}

/// What the temporary folder of the name `file` is, and who has made it: `SYSTEM-HOST-PID`. None where it is not one
/// of the folder `name`.
fn parts(file: &OsStr, name: &OsStr) -> Option<(Kind, String)> {
    let file = file.to_str()?;
    let rest = file.strip_prefix('.')?.strip_prefix(name.to_str()?)?.strip_prefix('.')?;
    let (owner, kind) = [Kind::New, Kind::Old].iter().find_map(|k| Some((rest.strip_suffix(k.ending())?, *k)))?;
    // A point stands in the names of other folders, and in no owner.
    let is_owner = !owner.contains('.') && owner.rsplit_once('-').is_some_and(|(_, pid)| pid.parse::<u32>().is_ok());
    is_owner.then(|| (kind, owner.to_owned()))
}

/// Whether a process of this computer has ended. The caller holds the lock, so where locks work it has in any case.
fn has_ended(owner: &str) -> bool {
    let Some((computer, pid)) = owner.rsplit_once('-') else { return false };
    let is_running = || cfg!(target_os = "linux") && Path::new("/proc").join(pid).exists();
    computer == COMPUTER.as_str() && !is_running()
}

/// Whether nothing has changed in a folder for long.
fn is_aged(entry: &fs::DirEntry) -> bool {
    let changed = entry.metadata().and_then(|meta| meta.modified());
    changed.is_ok_and(|at| at.elapsed().is_ok_and(|age| age > ABANDONED))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_temporary_folder_belongs_to_one_folder_and_one_process() {
        let of = |file: &str| parts(OsStr::new(file), OsStr::new("a.job"));
        assert_eq!(of(".a.job.linux-bench-3-71.new"), Some((Kind::New, "linux-bench-3-71".into())));
        assert_eq!(of(".a.job.windows-PC_1-8.old"), Some((Kind::Old, "windows-PC_1-8".into())));
        for other in [".a.job.lock", ".a.job.new", ".a.job.b.linux-x-1.new", "a.job.linux-x-1.new", ".b.linux-x-1.new"]
        {
            assert_eq!(of(other), None, "{other}");
        }
    }

    #[test]
    fn only_what_ended_processes_have_left_is_abandoned() {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("a.job");
        let name = OsStr::new("a.job");
        // No process has so high a number, and 1 is always there.
        let ended = format!(".a.job.{}-4294967295.new", *COMPUTER);
        for made in [ended.as_str(), ".a.job.plan9-elsewhere-7.new", ".a.job.lock"] {
            fs::create_dir(dir.path().join(made)).expect("made");
        }
        #[cfg(target_os = "linux")]
        fs::create_dir(dir.path().join(format!(".a.job.{}-1.new", *COMPUTER))).expect("made");
        assert_eq!(abandoned(&path, name).expect("readable"), [(Kind::New, dir.path().join(&ended))]);

        let elsewhere = fs::File::open(dir.path().join(".a.job.plan9-elsewhere-7.new")).expect("there");
        elsewhere.set_modified(std::time::SystemTime::now() - 2 * ABANDONED).expect("set");
        assert_eq!(abandoned(&path, name).expect("readable").len(), 2);
    }
}
