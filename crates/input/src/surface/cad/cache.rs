//! What the converter answered, kept by the hash of all that it came from.
//!
//! A file of the cache is the converter's answer with its hash behind. It is written by renaming, so it is complete or
//! not there; one that is damaged counts as not there and is replaced. The oldest ones go when all together exceed
//! [`MOST`]. The version of Open CASCADE is not part of the key: it is known only once the converter runs.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use super::{CadMesh, Tessellation};
use crate::surface::lines;
use terrace_core::diag::{Error, unreadable};

/// Most bytes of all files of the cache.
const MOST: u64 = 2 << 30;

/// Bytes of the hash at the end of a file.
const HASH: usize = blake3::OUT_LEN;

/// The hash of a file.
pub(super) fn hash(path: &Path) -> Result<blake3::Hash, Error> {
    let (file, _) = lines::open(path)?;
    let mut hasher = blake3::Hasher::new();
    hasher.update_reader(file).map_err(|e| unreadable(path, &e))?;
    Ok(hasher.finalize())
}

/// The name of an answer: of the file, how finely it is converted, and the converter.
pub(super) fn key(file: &blake3::Hash, fine: Tessellation, script: &str) -> String {
    let mut hasher = blake3::Hasher::new_derive_key("terrace: facets of a CAD file");
    hasher.update(file.as_bytes());
    hasher.update(&fine.chord_mm.to_le_bytes());
    hasher.update(&fine.angle_rad.to_le_bytes());
    hasher.update(script.as_bytes());
    hasher.finalize().to_hex().to_string()
}

/// The folder of this user; None where the system names none.
fn folder() -> Option<PathBuf> {
    let named = |name: &str| std::env::var_os(name).map(PathBuf::from).filter(|p| p.is_absolute());
    let around = if cfg!(windows) {
        named("LOCALAPPDATA")
    } else {
        named("XDG_CACHE_HOME").or_else(|| Some(named("HOME")?.join(".cache")))
    };
    Some(around?.join("terrace").join("cad"))
}

/// The answer that is kept under this key, if it is there and whole; it then counts as the newest.
pub(super) fn get(key: &str) -> Option<CadMesh> {
    let path = folder()?.join(key);
    let mut bytes = std::fs::read(&path).ok()?;
    let end = bytes.len().checked_sub(HASH)?;
    if blake3::hash(&bytes[..end]).as_bytes() != &bytes[end..] {
        return None;
    }
    bytes.truncate(end);
    let mesh = CadMesh::read(&bytes).ok()?;
    // `sweep` removes those first that were not used for longest. Where the time cannot be set this one goes earlier,
    // nothing else.
    let file = std::fs::File::options().write(true).open(&path);
    let _ = file.and_then(|f| f.set_modified(SystemTime::now()));
    Some(mesh)
}

/// Keeps an answer.
pub(super) fn put(key: &str, bytes: &[u8]) -> std::io::Result<()> {
    let Some(folder) = folder() else {
        return Err(std::io::Error::other("neither XDG_CACHE_HOME nor HOME (Windows: LOCALAPPDATA) names a folder"));
    };
    std::fs::create_dir_all(&folder)?;
    let new = folder.join(format!(".{key}.{}.new", std::process::id()));
    let written = std::fs::File::create(&new).and_then(|mut file| {
        file.write_all(bytes)?;
        file.write_all(blake3::hash(bytes).as_bytes())
    });
    let kept = written.and_then(|()| std::fs::rename(&new, folder.join(key)));
    if kept.is_err() {
        let _ = std::fs::remove_file(&new);
    }
    kept.map(|()| sweep(&folder, MOST))
}

/// Removes the oldest files until all together have at most `most` bytes. What cannot be removed stays.
fn sweep(folder: &Path, most: u64) {
    let files = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut files: Vec<(SystemTime, PathBuf, u64)> = files
        .filter_map(|entry| {
            let meta = entry.metadata().ok().filter(std::fs::Metadata::is_file)?;
            Some((meta.modified().ok()?, entry.path(), meta.len()))
        })
        .collect();
    files.sort();
    let mut all: u64 = files.iter().map(|file| file.2).sum();
    for (_, path, length) in files {
        if all <= most {
            break;
        }
        if std::fs::remove_file(path).is_ok() {
            all -= length;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn oldest_files_go_first() {
        let dir = tempfile::tempdir().expect("a folder");
        for (name, age) in [("a", 3), ("b", 1), ("c", 2)] {
            let path = dir.path().join(name);
            std::fs::write(&path, [0; 100]).expect("written");
            let time = SystemTime::now() - std::time::Duration::from_secs(age * 1000);
            std::fs::File::options().write(true).open(path).and_then(|f| f.set_modified(time)).expect("dated");
        }
        let left = || ["a", "b", "c"].map(|name| dir.path().join(name).exists());
        sweep(dir.path(), 300);
        assert_eq!(left(), [true, true, true]);
        sweep(dir.path(), 299);
        assert_eq!(left(), [false, true, true]);
        sweep(dir.path(), 120);
        assert_eq!(left(), [false, true, false]);
    }

    #[test]
    fn key_tells_file_tolerance_angle_and_converter_apart() {
        let (a, b) = (blake3::hash(b"a"), blake3::hash(b"b"));
        let fine = Tessellation::within(0.01);
        let others = [
            key(&b, fine, "x"),
            key(&a, Tessellation::within(0.02), "x"),
            key(&a, Tessellation { angle_rad: 0.1, ..fine }, "x"),
            key(&a, fine, "y"),
        ];
        assert!(others.iter().all(|other| *other != key(&a, fine, "x")));
        assert_eq!(key(&a, fine, "x"), key(&a, fine, "x"));
    }
}
