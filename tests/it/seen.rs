//! What is marked of a drawing is what resvg and Chromium, two independent renderers, show of it.
//!
//! resvg reads CSS as this program once did: it knows neither the selectors nor the at-rules nor the colours of level 4,
//! compares keywords by case, keeps the last declaration of a property whether valid or not, and ignores `pathLength`.
//! What turns on any of these is in `fixtures/seen_css` and compared with Chromium alone.

use std::path::{Path, PathBuf};

use rayon::prelude::*;

use crate::support::chromium::{Picture, Scale, pictures};
use crate::support::seen::{PER_MM, SIDE, SPOT, Verdict, by_resvg, judge, load};
use crate::support::{fixture, shared};
use terrace_input::texture::{Marking, Size};

fn name(path: &Path) -> String {
    path.file_stem().expect("a name").to_string_lossy().into_owned()
}

/// The drawings whose marks are not what resvg shows, with what is wrong.
fn unlike_resvg(paths: &[PathBuf]) -> Vec<String> {
    let one = |path: &PathBuf| match judge(path, Size::Mm([SIDE; 2]), SIDE, &by_resvg(path, [SIDE; 2]), &name(path)) {
        Verdict::Right(_) => None,
        verdict => Some(format!("{}: {verdict}", name(path))),
    };
    paths.par_iter().filter_map(one).collect()
}

/// The same with Chromium; the longer side of each page is [`SIDE`].
fn unlike_chromium(paths: &[PathBuf]) -> Vec<String> {
    let pictures = pictures(paths, Scale::Side((SIDE * PER_MM) as u32));
    let one = |(path, picture): (&PathBuf, &Result<Picture, String>)| {
        let picture = match picture {
            Ok(picture) => picture,
            Err(e) => return Some(format!("{}: Chromium: {e}", name(path))),
        };
        let size = picture.scaled_to(SIDE);
        match judge(path, Size::Mm(size), size[1], &picture.ink(), &name(path)) {
            Verdict::Right(_) => None,
            verdict => Some(format!("{}: {verdict}", name(path))),
        }
    };
    paths.par_iter().zip(&pictures.list).filter_map(one).collect()
}

fn drawings(folder: &Path, begin: &str) -> Vec<PathBuf> {
    let files = std::fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("a file").path());
    let is_meant = |path: &PathBuf| {
        let name = path.file_name().expect("a name").to_string_lossy();
        name.starts_with(begin) && name.ends_with(".svg")
    };
    let mut paths: Vec<PathBuf> = files.filter(is_meant).collect();
    paths.sort();
    paths
}

#[test]
#[ignore = "slow: make test-all"]
fn marks_are_what_a_renderer_shows() {
    let paths = drawings(&fixture("seen"), "");
    assert!(paths.len() >= 40, "{} drawings", paths.len());
    let wrong = unlike_resvg(&paths);
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
#[ignore = "slow: make test-all"]
fn marks_are_what_a_browser_shows() {
    let paths = drawings(&fixture("seen"), "");
    assert!(paths.len() >= 40, "{} drawings", paths.len());
    let wrong = unlike_chromium(&paths);
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
#[ignore = "slow: make test-all"]
fn marks_of_drawings_that_turn_on_css_are_what_a_browser_shows() {
    let paths = drawings(&fixture("seen_css"), "");
    assert!(paths.len() >= 12, "{} drawings", paths.len());
    let wrong = unlike_chromium(&paths);
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// A drawing that resvg shows right belongs into `fixtures/seen`, where both renderers are asked.
#[test]
#[ignore = "slow: make test-all"]
fn resvg_shows_none_of_the_drawings_that_turn_on_css() {
    let paths = drawings(&fixture("seen_css"), "");
    let pictures = pictures(&paths, Scale::Side((SIDE * PER_MM) as u32));
    let same = paths.iter().zip(&pictures.list).filter(|(path, picture)| {
        let browser = picture.as_ref().expect("a picture").ink();
        let differ = by_resvg(path, [SIDE; 2]).is_ink.iter().zip(&browser.is_ink).filter(|(a, b)| a != b).count();
        differ * 200 < browser.is_ink.len()
    });
    let same: Vec<String> = same.map(|(path, _)| name(path)).collect();
    assert!(same.is_empty(), "{}", same.join("\n"));
}

#[test]
#[ignore = "needs ../shared"]
fn marks_of_foreign_cases_are_what_a_renderer_shows() {
    let paths = drawings(&shared().join("textures"), "resvg_");
    assert_eq!(paths.len(), 15);
    let refused = [("pattern_nested", "svg-paint"), ("text_textPath", "svg-text"), ("text_text", "svg-text")];
    let mut drawn = Vec::new();
    for path in paths {
        match refused.iter().find(|(part, _)| path.display().to_string().contains(part)) {
            Some((_, code)) => {
                let refusal = load(&path, Size::Mm([SIDE; 2]), SPOT, Marking::default()).expect_err("refused");
                assert_eq!(refusal.diags()[0].code, *code);
            }
            None => drawn.push(path),
        }
    }
    let wrong = unlike_resvg(&drawn);
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
