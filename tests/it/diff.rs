//! `terrace diff` on two folders of one job with another depth of focus, and on folders that it cannot show.

use std::path::Path;

use crate::cli::{done, job_folder_fixture, json, refused, run};

/// Two folders of one job, the second with twice the depth of focus.
fn two_folders() -> tempfile::TempDir {
    let dir = job_folder_fixture();
    let at = dir.path();
    done(at, &["compile", "a.toml", "-o", "before one.job", "--json"]);
    let text = std::fs::read_to_string(at.join("a.toml")).expect("a job");
    assert!(text.contains("0.07 mm"), "{text}");
    std::fs::write(at.join("a.toml"), text.replace("0.07 mm", "0.14 mm")).expect("a writable folder");
    done(at, &["compile", "a.toml", "-o", "after.job", "--json"]);
    dir
}

#[test]
fn figures_and_files_that_differ_are_told() {
    let dir = two_folders();
    let at = dir.path();
    let found = json(&done(at, &["diff", "before one.job", "after.job", "--json"]));
    let row = |name: &str| {
        let rows = found["figures"].as_array().expect("figures");
        rows.iter().find(|r| r["name"] == name).unwrap_or_else(|| panic!("{name} in {found}")).clone()
    };
    assert_eq!((&row("mode")["change"], &row("mode")["before"]), (&"".into(), &"stepped".into()));
    assert_eq!(row("marked")["change"], "");
    let changed = found["changed"].as_array().expect("a list");
    assert!(changed.contains(&"view.html".into()), "{found}");
    let text = done(at, &["diff", "before one.job", "after.job"]);
    let lines: Vec<&str> = text.lines().collect();
    assert!(lines[0].contains("before one.job  after.job") && lines[0].ends_with("change"), "{text}");
    let column = lines[0].find("after.job").expect("a heading");
    assert!(lines[1..5].iter().all(|line| line.len() < column || line.as_bytes()[column - 1] == b' '), "{text}");
    let same = done(at, &["diff", "after.job", "after.job"]);
    assert!(same.contains("have equal bytes") && !same.contains("changed"), "{same}");
}

#[test]
fn a_page_shows_both_views_from_where_it_lies() {
    let dir = two_folders();
    let at = dir.path();
    std::fs::create_dir(at.join("pages")).expect("a writable folder");
    let text = done(at, &["diff", "before one.job", "after.job", "-o", "pages/both.html"]);
    assert!(text.ends_with("open  pages/both.html\n"), "{text}");
    let page = std::fs::read_to_string(at.join("pages/both.html")).expect("a page");
    for address in ["../before%20one.job/view.html", "../after.job/view.html"] {
        assert!(page.contains(&format!("src=\"{address}\"")), "{page}");
    }
    done(at, &["compile", "a.toml", "-o", "bare.job", "--no-pictures", "--json"]);
    refused(&run(at, &["diff", "after.job", "bare.job", "-o", "x.html"]), 2, "diff-no-view");
    assert!(!at.join("x.html").exists());
    done(at, &["diff", "after.job", "bare.job"]);
    refused(&run(at, &["diff", "after.job", "absent.job"]), 2, "file-unreadable");
    let view = Path::new("after.job/view.html");
    let before = std::fs::read(at.join(view)).expect("a view");
    refused(&run(at, &["diff", "before one.job", "after.job", "-o", "after.job/view.html"]), 2, "output-is-input");
    assert_eq!(std::fs::read(at.join(view)).expect("a view"), before);
}
