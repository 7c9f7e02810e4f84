//! The place of a job folder, and the exchange that puts a new one there.
//!
//! Consumes the path as given; links are followed, so the folder behind a link is replaced and the
//! link stays. Beside the target `NAME` live, only while a run writes, `.NAME.lock` and two folders under names of
//! the process alone ([`temporary`]): the one in the making (once names are exchanged, the one that was replaced), and
//! the one that is replaced, where names cannot be exchanged. The lock is the system's own and ends
//! with its process, however that ends; a second run on the same target waits for it. `.NAME.claim` is another, held
//! by a batch from before it looks whether the folder is up to date until it is: of two batches one compiles.
//!
//! Promises that under the final name there is the whole old folder or the whole new one; where the system cannot
//! exchange two names in one step (other systems than Linux, some network shares), also none between two renames.
//! [`Target::recover`] clears up what a stopped run left. This holds when a process is
//! killed, and, where the new folder and its parent are flushed, when power fails. File systems without locks, or
//! with locks that another system does not see (some network shares), are used without one: then the last of two runs
//! wins, and each looks whether the folder that it put in place is there ([`Target::exchange`]).

use std::collections::BTreeMap;
use std::ffi::{OsStr, OsString};
use std::fs::{self, File};
use std::io::ErrorKind;
use std::path::{Component, Path, PathBuf};

use super::flush::{Flush, flush_tree};
use super::temporary::{self, Kind};
use super::{failed, place};
use terrace_core::diag::{self, Diag, Error};
use terrace_input::job::Mode;
use terrace_plan::manifest::{self, FileFact, InputFact, JobRef, MANIFEST};

/// Where a job folder goes.
#[derive(Debug)]
pub(super) struct Target {
    /// The folder itself, absolute and free of links.
    pub(super) path: PathBuf,
    /// The last part of the path.
    name: OsString,
    /// The folder in the making.
    pub(super) new: PathBuf,
    /// The folder that is replaced.
    pub(super) old: PathBuf,
    lock: PathBuf,
    claim: PathBuf,
    /// The file without which a folder of this kind is not whole.
    sign: &'static str,
}

/// A right at a target, such as that to write there; ends when dropped.
#[derive(Debug)]
pub(super) struct Lock {
    path: PathBuf,
    /// Whether the file was there before: its process has not removed it, so it was stopped, or there are no locks.
    was_left: bool,
    /// Holds the system's lock as long as it is open.
    _file: File,
}

impl Lock {
    /// Waits until no other process holds the lock of this file.
    fn of(path: &Path) -> Result<Self, Error> {
        let refused = |e: std::io::Error| failed("lock the output", path, &e);
        loop {
            if is_no_file(path) {
                let text = "cannot lock the output: something that is not a regular file has the name of its lock";
                let d = Diag::input("output-unwritable", text).at(place(path));
                return Err(d.hint("remove it, or name another folder with -o").into());
            }
            let made = File::options().create_new(true).append(true).open(path);
            let was_left = made.as_ref().is_err_and(|e| e.kind() == ErrorKind::AlreadyExists);
            let file = match if was_left { File::options().append(true).open(path) } else { made } {
                // Removed since by the run that held it.
                Err(e) if was_left && e.kind() == ErrorKind::NotFound => continue,
                opened => opened.map_err(refused)?,
            };
            match file.lock() {
                Err(e) if e.kind() != ErrorKind::Unsupported => return Err(refused(e)),
                _ => {}
            }
            // The run that held it before has removed its file: a lock on that one is worth nothing.
            if is_same(&file, path) {
                return Ok(Self { path: path.to_owned(), was_left, _file: file });
            }
        }
    }

    /// The lock of a file that is there and that no process holds.
    fn free(path: &Path) -> Option<Self> {
        // To open a pipe is to wait for its other end.
        if is_no_file(path) {
            return None;
        }
        let file = File::options().append(true).open(path).ok()?;
        let is_free = file.try_lock().is_ok() && is_same(&file, path);
        is_free.then(|| Self { path: path.to_owned(), was_left: true, _file: file })
    }
}

impl Drop for Lock {
    fn drop(&mut self) {
        // While it is still locked: whoever waits for it sees that it is gone, and makes its own.
        let _ = fs::remove_file(&self.path);
    }
}

/// The fault of an output that names no folder, as `/` and `..` do.
fn nameless(given: &Path) -> Error {
    let d = Diag::input("output-name", "the output has no name of its own").at(place(given));
    let devices = if cfg!(windows) { "; con, aux, nul, prn, com1 and the like are devices" } else { "" };
    d.hint(format!("name a folder, such as -o hood.job{devices}")).into()
}

/// The hidden neighbour of the folder at `path` of a name, such as `.NAME.lock`.
fn hidden(path: &Path, name: &OsStr, ending: &str) -> PathBuf {
    let mut hidden = OsString::from(".");
    hidden.push(name);
    hidden.push(ending);
    path.with_file_name(hidden)
}

impl Target {
    /// Finds the place of a folder that is whole when it holds the file `sign`; touches nothing.
    pub(super) fn find(given: &Path, sign: &'static str) -> Result<Self, Error> {
        if given.file_name().is_none() {
            return Err(nameless(given));
        }
        let path = resolved(given).map_err(|e| failed("find the folder", given, &e))?;
        let name = path.file_name().ok_or_else(|| nameless(given))?.to_owned();
        let [lock, claim] = [".lock", ".claim"].map(|ending| hidden(&path, &name, ending));
        let [new, old] = [Kind::New, Kind::Old].map(|kind| temporary::own(&path, &name, kind));
        Ok(Self { name, new, old, lock, claim, path, sign })
    }

    /// Finishes or undoes what a stopped run left.
    pub(super) fn recover(&self) -> Result<(), Error> {
        // A run that was stopped has left its lock.
        if is_there(&self.lock) {
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
    pub(super) fn tidy(&self, lock: &Lock) -> Result<(), Error> {
        // A fault of this process, earlier: the system did not let it go then.
        if is_there(&self.new) {
            fs::remove_dir_all(&self.new).map_err(|e| failed("remove an unfinished folder", &self.new, &e))?;
        }
        if !lock.was_left {
            return Ok(());
        }
        let parent = self.path.parent().unwrap_or(Path::new("/"));
        let left = temporary::abandoned(&self.path, &self.name).map_err(|e| failed("read the folder", parent, &e))?;
        for (kind, folder) in left {
            // A replaced folder loses its sign first, so one that has it is whole.
            if kind == Kind::Old && !is_there(&self.path) && folder.join(self.sign).is_file() {
                fs::rename(&folder, &self.path).map_err(|e| failed("restore the old folder", &folder, &e))?;
            } else if kind == Kind::Old {
                self.discard(&folder)?;
            } else {
                fs::remove_dir_all(&folder).map_err(|e| failed("remove an unfinished folder", &folder, &e))?;
            }
        }
        Ok(())
    }

    /// Refuses a target that is there and is not a job folder, is one of another mode, or holds one of the `inputs`.
    pub(super) fn refuse_unless_replaceable(&self, mode: Mode, inputs: &[PathBuf]) -> Result<(), Error> {
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
            // An input that is not there cannot be removed.
            if dunce::canonicalize(input).is_ok_and(|real| real.starts_with(&self.path)) {
                let text = format!("the output would replace the folder that holds the input {}", input.display());
                let d = Diag::input("output-holds-input", text).at(place(&self.path));
                return Err(d.hint("move the input, or name another folder with -o").into());
            }
        }
        Ok(())
    }

    /// Puts the finished new folder in place. Where that fails the old one is put back. The new folder is flushed
    /// before its name changes, and the folder around it before the old one is removed.
    ///
    /// # Errors
    /// `output-disturbed` where what lies there afterwards is not the new folder, whole; what the file system refuses.
    pub(super) fn exchange(&self, _lock: &Lock, flush: &Flush<'_>) -> Result<(), Error> {
        let made = listing(&self.new).map_err(|e| failed("read the new folder", &self.new, &e))?;
        self.put(flush, swap)?;
        if listing(&self.path).is_ok_and(|there| there == made) {
            return Ok(());
        }
        let text = "the folder is not the one that was written: another process wrote here at the same time";
        let d = Diag::input("output-disturbed", text).at(place(&self.path));
        Err(d.hint("compile again while no other computer or system writes this folder").into())
    }

    /// [`Target::exchange`] by a function that exchanges two names in one step, or cannot.
    fn put(&self, flush: &Flush<'_>, swap: fn(&Path, &Path) -> bool) -> Result<(), Error> {
        flush_tree(&self.new, flush).map_err(|e| failed("put the new folder on the disk", &self.new, &e))?;
        let parent = self.path.parent().unwrap_or(Path::new("/"));
        let flush_parent = || flush(parent).map_err(|e| failed("put the folder on the disk", parent, &e));
        let replaces = is_there(&self.path);
        if replaces && swap(&self.new, &self.path) {
            flush_parent()?;
            // It has the name of an unfinished folder by now: a run that is stopped here has it removed by the next.
            return fs::remove_dir_all(&self.new).map_err(|e| failed("remove the replaced folder", &self.new, &e));
        }
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
        flush_parent()?;
        if replaces { self.discard(&self.old) } else { Ok(()) }
    }

    /// Removes the replaced folder, its sign first.
    fn discard(&self, old: &Path) -> Result<(), Error> {
        let _ = fs::remove_file(old.join(self.sign));
        fs::remove_dir_all(old).map_err(|e| failed("remove the replaced folder", old, &e))
    }
}

/// The files of a folder and of those in it, with their sizes, bytes.
fn listing(folder: &Path) -> std::io::Result<BTreeMap<PathBuf, u64>> {
    let mut found = BTreeMap::new();
    let mut open = vec![folder.to_owned()];
    while let Some(inner) = open.pop() {
        for entry in fs::read_dir(&inner)? {
            let entry = entry?;
            let path = entry.path();
            if entry.file_type()?.is_dir() {
                open.push(path);
            } else if let Ok(name) = path.strip_prefix(folder) {
                found.insert(name.to_owned(), entry.metadata()?.len());
            }
        }
    }
    Ok(found)
}

/// Whether anything has this name, a link that leads nowhere included.
fn is_there(path: &Path) -> bool {
    fs::symlink_metadata(path).is_ok()
}

/// Whether what has this name is a pipe, a folder, a link or the like.
fn is_no_file(path: &Path) -> bool {
    fs::symlink_metadata(path).is_ok_and(|meta| !meta.is_file())
}

/// Exchanges the names of two folders in one step; false where system or file system cannot, and nothing is changed.
#[cfg(target_os = "linux")]
fn swap(one: &Path, other: &Path) -> bool {
    use rustix::fs::{CWD, RenameFlags, renameat_with};
    renameat_with(CWD, one, CWD, other, RenameFlags::EXCHANGE).is_ok()
}

#[cfg(not(target_os = "linux"))]
fn swap(_: &Path, _: &Path) -> bool {
    false
}

/// The mode of a job folder of any version; None where the folder is something else: other programs have files of
/// this name too. All that manifests of every version have must be there, and the files that it lists.
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
        #[serde(rename = "job")]
        _job: JobRef,
        #[serde(rename = "inputs")]
        _inputs: Vec<InputFact>,
        files: Vec<FileFact>,
    }
    let bytes = diag::read_file(&path.join(MANIFEST), manifest::MAX_FILE).ok()?;
    let sign: Sign = serde_json::from_slice(&bytes).ok()?;
    // A folder of ours may have lost files; one that never had any is not of ours.
    let has_some = sign.files.iter().any(|fact| is_there(&path.join(&fact.file)));
    has_some.then_some(sign.mode)
}

/// Whether a file that is open still has this name: another process may have removed it, on Windows too.
fn is_same(file: &File, path: &Path) -> bool {
    let open = file.try_clone().and_then(same_file::Handle::from_file);
    open.is_ok_and(|open| same_file::Handle::from_path(path).is_ok_and(|named| named == open))
}

/// The path, absolute and free of links; its last parts need not exist.
pub(super) fn resolved(path: &Path) -> std::io::Result<PathBuf> {
    let path = std::path::absolute(path)?;
    let mut rest = Vec::new();
    let mut known = path.as_path();
    let mut out = loop {
        // A link that leads nowhere is there, and is refused by name.
        if is_there(known) {
            break dunce::canonicalize(known)?;
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

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

    use super::*;

    /// A folder in the making with a text in its sign, about to become `a.job`.
    fn made(dir: &Path, text: &str) -> Target {
        let target = Target::find(&dir.join("a.job"), "sign").expect("a place");
        fs::create_dir(&target.new).expect("made");
        fs::write(target.new.join("sign"), text).expect("written");
        target
    }

    #[test]
    fn a_folder_is_replaced_whether_names_can_be_exchanged_or_not() {
        for swap in [swap as fn(&Path, &Path) -> bool, |_, _| false] {
            let dir = tempfile::tempdir().expect("a folder");
            for text in ["one", "two", "three"] {
                made(dir.path(), text).put(&|_| Ok(()), swap).expect("put in place");
                assert_eq!(fs::read_to_string(dir.path().join("a.job/sign")).expect("there"), text);
                assert_eq!(fs::read_dir(dir.path()).expect("there").count(), 1, "nothing is left beside it");
            }
        }
    }

    #[test]
    fn a_folder_that_another_process_has_changed_by_then_is_an_error() {
        let dir = tempfile::tempdir().expect("a folder");
        let lost = dir.path().join("a.job/sign");
        let target = made(dir.path(), "one");
        let lock = target.lock().expect("free");
        // The parent is flushed last, once the folder has its name.
        let disturb = |path: &Path| if path == dir.path() { fs::remove_file(&lost) } else { Ok(()) };
        let e = target.exchange(&lock, &disturb).expect_err("a file is gone");
        assert_eq!(e.diags()[0].code, "output-disturbed");
    }

    #[test]
    fn a_folder_in_the_making_elsewhere_is_left_alone_and_no_lock_is_needed_for_that() {
        let dir = tempfile::tempdir().expect("a folder");
        let foreign = dir.path().join(".a.job.windows-PC-7.new");
        fs::create_dir(&foreign).expect("made");
        // As a process leaves it that is stopped.
        fs::write(dir.path().join(".a.job.lock"), "").expect("made");
        Target::find(&dir.path().join("a.job"), "sign").expect("a place").recover().expect("free");
        let target = made(dir.path(), "one");
        assert!(foreign.is_dir() && !target.lock.exists());
        let lock = target.lock().expect("free");
        target.exchange(&lock, &|_| Ok(())).expect("in place");
        assert!(foreign.is_dir() && target.path.is_dir());
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn at_no_moment_there_is_no_folder() {
        let dir = tempfile::tempdir().expect("a folder");
        made(dir.path(), "0").put(&|_| Ok(()), swap).expect("put in place");
        let sign = dir.path().join("a.job");
        let is_done = AtomicBool::new(false);
        std::thread::scope(|scope| {
            let seen = scope.spawn(|| {
                let mut looks = 0_u64;
                while !is_done.load(Relaxed) {
                    assert!(is_there(&sign), "after {looks} looks");
                    looks += 1;
                }
                looks
            });
            for i in 1..500 {
                made(dir.path(), &i.to_string()).put(&|_| Ok(()), swap).expect("put in place");
            }
            is_done.store(true, Relaxed);
            assert!(seen.join().expect("always there") > 0);
        });
    }

    #[cfg(unix)]
    #[test]
    fn a_pipe_under_the_name_of_a_lock_is_refused_and_not_waited_for() {
        let dir = tempfile::tempdir().expect("a folder");
        let target = Target::find(&dir.path().join("a.job"), "sign").expect("a place");
        for path in [&target.lock, &target.claim] {
            let status = std::process::Command::new("mkfifo").arg(path).status().expect("mkfifo");
            assert!(status.success());
        }
        for refused in [target.lock(), target.claim()] {
            assert_eq!(refused.expect_err("a pipe").diags()[0].code, "output-unwritable");
        }
        assert!(Lock::free(&target.claim).is_none());
    }

    #[test]
    fn only_a_whole_manifest_of_ours_makes_a_job_folder() {
        let dir = tempfile::tempdir().expect("a folder");
        let mode = |text: &str| {
            fs::write(dir.path().join(MANIFEST), text).expect("written");
            mode_of(dir.path())
        };
        fs::write(dir.path().join("program.txt"), "").expect("written");
        let job = "\"job\":{\"file\":\"../a.toml\",\"blake3\":\"00\"},\"inputs\":[]";
        let files = "\"files\":[{\"file\":\"program.txt\",\"bytes\":0,\"blake3\":\"00\"}]";
        let whole = |extra: &str| format!("{{\"terrace\":\"0.1.0\",\"schema\":1{extra},{job},{files}}}");
        assert_eq!(mode(&whole("")), Some(Mode::Stepped));
        assert_eq!(mode(&whole(",\"mode\":\"on-the-fly\"")), Some(Mode::OnTheFly));
        for text in [
            "{\"terrace\":\"x\",\"schema\":1}".to_owned(),
            format!("{{\"terrace\":\"x\",\"schema\":1,{job}}}"),
            format!("{{\"terrace\":\"x\",\"schema\":1,{files}}}"),
            whole("").replace("program.txt", "other.txt"),
            whole("").replace("\"schema\":1", "\"schema\":\"one\""),
        ] {
            assert_eq!(mode(&text), None, "{text}");
        }
    }
}
