//! The log of a run: JSON lines with the time, appended to a file that the user names.

use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use serde::Serialize;
use serde_json::json;

use terrace_core::diag::{Diag, Place};

/// The log; without a file it keeps nothing.
pub(super) struct Log(Option<(File, PathBuf)>);

impl Log {
    /// Appends to the file at `path`.
    pub fn open(path: Option<&Path>) -> Result<Self, Diag> {
        let Some(path) = path else { return Ok(Self(None)) };
        let file = File::options().create(true).append(true).open(path).map_err(|e| unwritable(path, &e))?;
        Ok(Self(Some((file, path.to_owned()))))
    }

    /// One line: what happened, and its value.
    pub fn write(&mut self, event: &str, value: &impl Serialize) -> Result<(), Diag> {
        let Some((file, path)) = &mut self.0 else { return Ok(()) };
        let line = format!("{}\n", json!({"time_s": now_s(), "event": event, "value": value}));
        file.write_all(line.as_bytes()).map_err(|e| unwritable(path, &e))
    }
}

/// Seconds since 1970, to the millisecond.
pub(super) fn now_s() -> f64 {
    let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    since.as_millis() as f64 / 1e3
}

/// A journal or log that cannot be written.
pub(super) fn unwritable(path: &Path, e: &std::io::Error) -> Diag {
    Diag::input("run-unwritable", format!("cannot write journal or log: {e}"))
        .at(Place::file(path.display().to_string()))
        .hint("check path, space and permissions")
}
