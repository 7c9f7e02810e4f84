//! Files that stand for another one: a web page where a download was wanted, a pointer of Git LFS.

use std::fs::File;
use std::io::Read;

use super::{Diag, Error, Place};

/// The error, in which a file that cannot be read because it stands for another one is reported as that.
#[must_use]
pub fn explained(e: Error) -> Error {
    let mut diags: Vec<Diag> = Vec::new();
    for d in e.0 {
        let found = match &d.place {
            Place::File { path, .. }
            | Place::Text { path, .. }
            | Place::Facet { path, .. }
            | Place::Element { path, .. } => stand_in(path),
            Place::Nowhere | Place::Part { .. } | Place::Block(_) => None,
        };
        let d = found.unwrap_or(d);
        if !diags.contains(&d) {
            diags.push(d);
        }
    }
    Error(diags)
}

/// What a file is in place of the one that was wanted.
fn stand_in(path: &str) -> Option<Diag> {
    let mut begin = [0; 512];
    let count = File::open(path).ok()?.read(&mut begin).ok()?;
    let text =
        String::from_utf8_lossy(&begin[..count]).trim_start_matches(['\u{feff}', ' ', '\n', '\r', '\t']).to_lowercase();
    let (what, hint) = if text.starts_with("version https://git-lfs") {
        ("this is a pointer of Git LFS, not the file", "fetch the file itself: git lfs pull")
    } else if text.starts_with("<!doctype html") || text.starts_with("<html") {
        ("this is a web page, not the file", "open it in a browser to see why, and download the file itself")
    } else {
        return None;
    };
    Some(Diag::input("file-stand-in", what).at(Place::file(path)).hint(hint))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_stands_for_another_is_reported_once_as_that() {
        let dir = tempfile::tempdir().expect("a folder");
        let file = |name: &str, text: &str| {
            let path = dir.path().join(name);
            std::fs::write(&path, text).expect("a writable folder");
            path.display().to_string()
        };
        let page = file("a.stl", "\n<!DOCTYPE html><html><body>sign in</body></html>");
        let pointer = file("b.stl", "version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 5\n");
        let part = file("c.stl", "solid c\n");
        let told = |paths: &[&String]| {
            let faults = paths.iter().map(|path| Diag::input("stl-ascii", "no facets").at(Place::file(path.as_str())));
            let told = explained(Error::many(faults.collect()));
            told.diags().iter().map(|d| d.message.clone()).collect::<Vec<_>>()
        };
        assert_eq!(told(&[&page, &page]), ["this is a web page, not the file"]);
        assert_eq!(told(&[&pointer]), ["this is a pointer of Git LFS, not the file"]);
        assert_eq!(told(&[&part]), ["no facets"]);
    }
}
