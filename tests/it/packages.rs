//! Drawings of icon sets and of Inkscape's share folder: each is marked as Chromium shows it, or refused; none that was
//! read before is refused.

use std::path::{Path, PathBuf};

use rayon::prelude::*;

use crate::support::chromium::{Picture, Scale, pictures};
use crate::support::seen::{PER_MM, SIDE, SPOT, Verdict, codes, judge, load};
use terrace_input::texture::{Marking, Size};

/// Verdict and file below `.venv`, a line each.
const DRAWINGS: &str = include_str!("../data/package_drawings.txt");

/// Drawings that Chromium does not show, since they do not say that they are SVG, and which are read with a warning.
const WITHOUT_A_NAMESPACE: &[&str] = &["inkscape/examples/flow-go.svg"];

/// What is wrong with a drawing; the longer side of its page is [`SIDE`].
fn fault(was: &str, name: &str, file: &Path, picture: &Result<Picture, String>, counts: &Counts) -> Option<String> {
    let verdict = match picture {
        Ok(picture) => {
            let size = picture.scaled_to(SIDE);
            judge(file, Size::Mm(size), size[1], &picture.ink(), name)
        }
        Err(e) => match load(file, Size::Mm([SIDE; 2]), SPOT, Marking::default()) {
            Ok((_, notes)) => {
                let is_warned = WITHOUT_A_NAMESPACE.iter().any(|known| name.ends_with(known));
                let is_right = is_warned && codes(&notes).contains("svg-namespace");
                return (!is_right).then(|| format!("is read, Chromium says: {e}"));
            }
            Err(e) => Verdict::Refused(codes(e.diags())),
        },
    };
    let (kind, fault) = match &verdict {
        Verdict::Right(_) => (0, None),
        Verdict::Refused(_) => (1, (was == "read").then(|| format!("was read before, {verdict}"))),
        Verdict::Wrong { .. } => (2, Some(verdict.to_string())),
    };
    counts[kind].fetch_add(1, std::sync::atomic::Ordering::Relaxed);
    fault
}

/// How many are right, refused and different.
type Counts = [std::sync::atomic::AtomicUsize; 3];

#[test]
#[ignore = "slow: make test-all"]
fn drawings_of_packages_are_marked_as_shown_or_refused() {
    let rows: Vec<(&str, &str)> = DRAWINGS
        .lines()
        .filter(|line| !line.starts_with('#'))
        .map(|line| line.split_once('\t').expect("a verdict and a file"))
        .collect();
    assert!(rows.len() >= 120, "{} drawings", rows.len());
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join(".venv");
    let files: Vec<PathBuf> = rows.iter().map(|(_, file)| root.join(file)).collect();
    let absent: Vec<&PathBuf> = files.iter().filter(|file| !file.is_file()).collect();
    assert!(absent.is_empty(), "setup.sh all installs {absent:?}");
    let pictures = pictures(&files, Scale::Side((SIDE * PER_MM) as u32));
    let counts = Counts::default();
    let wrong: Vec<String> = (0..rows.len())
        .into_par_iter()
        .filter_map(|i| {
            let (was, name) = rows[i];
            Some(format!("{name}: {}", fault(was, name, &files[i], &pictures.list[i], &counts)?))
        })
        .collect();
    println!("right, refused, different: {counts:?}");
    assert!(wrong.is_empty(), "{} of {} are wrong:\n{}", wrong.len(), rows.len(), wrong.join("\n"));
}
