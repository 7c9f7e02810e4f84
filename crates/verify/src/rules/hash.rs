//! `hash`: every listed file exists with its size and hash, nothing unlisted lies in the folder, and
//! job file and inputs are the ones that the job was compiled from.

use std::collections::BTreeSet;
use std::fs::File;
use std::io;
use std::path::{Component, Path};

use crate::inputs::Inputs;
use crate::proof::Rule;
use crate::read::manifest::{self, FileEntry, Listed};

/// Folders inside the job folder are looked into this deep; terrace writes one level.
const DEEPEST: usize = 8;

/// Holds the rule; returns whether job file and inputs are unchanged.
pub(crate) fn check(folder: &Path, manifest: &Listed<'_>, inputs: &Inputs, rule: &mut Rule) -> bool {
    rule.ran = true;
    let mut listed = BTreeSet::new();
    for entry in manifest.files {
        let path = Path::new(&entry.file);
        if !is_inside(&entry.file) {
            rule.broken("", &entry.file, "is listed, but is not a path inside the job folder");
            continue;
        }
        if !listed.insert(entry.file.clone()) {
            rule.broken("", &entry.file, "is listed twice");
        }
        check_file(&folder.join(path), entry, &entry.file, rule);
    }
    // What is not listed has no hash, and an operator might load it.
    walk(folder, "", 0, &listed, rule);
    // From here on only job file and inputs count: whether they are what was compiled decides which rules can run.
    let before = rule.violated;
    let job = FileEntry { file: manifest.job.file.clone(), bytes: 0, blake3: manifest.job.blake3.clone() };
    match hash_of(&inputs.job) {
        Ok((hash, _)) if hash == job.blake3 => {}
        Ok(_) => rule.broken("", &job.file, "the job file has changed since the job was compiled"),
        Err(e) => rule.broken("", &job.file, missing_input(&e)),
    }
    rule.checked += 1;
    for entry in manifest.inputs {
        match hash_of(&inputs.resolve(&entry.file)) {
            Ok(found) if found == (entry.blake3.clone(), entry.bytes) => {}
            Ok(_) => rule.broken("", &entry.file, "this input has changed since the job was compiled"),
            Err(e) => rule.broken("", &entry.file, missing_input(&e)),
        }
        rule.checked += 1;
    }
    rule.violated == before
}

/// Whether a path of the manifest stays inside the job folder.
pub(super) fn is_inside(file: &str) -> bool {
    !file.is_empty() && Path::new(file).components().all(|c| matches!(c, Component::Normal(_)))
}

fn missing_input(e: &io::Error) -> String {
    format!("this input cannot be read: {e}; name the folder that holds the job file and its inputs")
}

/// Holds a file of the folder to its entry in the manifest.
fn check_file(path: &Path, entry: &FileEntry, name: &str, rule: &mut Rule) {
    rule.checked += 1;
    // What a link leads to can change under whoever loads it.
    if path.symlink_metadata().is_ok_and(|found| found.file_type().is_symlink()) {
        return rule.broken("", name, "is a link, and not a file of the folder");
    }
    match hash_of(path) {
        Ok((_, bytes)) if bytes != entry.bytes => {
            rule.broken("", name, format!("has {bytes} bytes, listed are {}", entry.bytes));
        }
        Ok((hash, _)) if hash != entry.blake3 => rule.broken("", name, "its bytes differ from the listed hash"),
        Ok(_) => {}
        Err(e) => rule.broken("", name, format!("is listed, but cannot be read: {e}")),
    }
}

/// BLAKE3 in hex and size of a file. A pipe or device is not opened, which could wait for ever.
fn hash_of(path: &Path) -> io::Result<(String, u64)> {
    if !path.metadata()?.is_file() {
        return Err(io::Error::other("not a regular file"));
    }
    let file = File::open(path)?;
    let mut hasher = blake3::Hasher::new();
    hasher.update_reader(file)?;
    Ok((hasher.finalize().to_hex().to_string(), hasher.count()))
}

/// Looks for files that are not listed.
fn walk(folder: &Path, prefix: &str, depth: usize, listed: &BTreeSet<String>, rule: &mut Rule) {
    let entries = match std::fs::read_dir(folder.join(prefix)) {
        Ok(entries) if depth < DEEPEST => entries,
        _ => return rule.broken("", prefix, "this folder cannot be read"),
    };
    let mut names: Vec<_> = entries.flatten().collect();
    names.sort_by_key(|e| e.file_name());
    for entry in names {
        let name = entry.file_name();
        let is_text = name.to_str().is_some();
        let name = name.to_string_lossy();
        let path = if prefix.is_empty() { name.into_owned() } else { format!("{prefix}/{name}") };
        if !is_text {
            // No name of a manifest is such a one, however it is shown.
            rule.broken("", path, "is in the folder, but its name is not text");
        } else if entry.file_type().is_ok_and(|t| t.is_dir()) {
            walk(folder, &path, depth + 1, listed, rule);
        } else if path != manifest::NAME && !listed.contains(&path) {
            rule.broken("", path, "is in the folder, but is not listed");
        }
    }
}
