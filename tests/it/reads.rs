//! Each input file is opened for reading once by every command, and once more at most for its hash.
#![cfg(target_os = "linux")]

use std::collections::BTreeMap;
use std::path::Path;

use inotify::{EventMask, Inotify, WatchMask};

use crate::support::surfaces::{mesh, write_stl};
use crate::support::{JobText, folder, image, said, terrace};

/// Runs the program and counts how often each file of `dir` was opened by it.
fn opened(dir: &Path, args: &[&str]) -> BTreeMap<String, usize> {
    let mut inotify = Inotify::init().expect("the kernel watches files");
    let mut names = BTreeMap::new();
    for entry in std::fs::read_dir(dir).expect("a folder").map(|e| e.expect("an entry")) {
        if entry.path().is_file() {
            // Opening and closing alternate, so that no two events are alike and none is merged with another.
            let watch = inotify.watches().add(entry.path(), WatchMask::OPEN | WatchMask::CLOSE).expect("a watch");
            names.insert(watch.get_watch_descriptor_id(), entry.file_name().to_string_lossy().into_owned());
        }
    }
    let out = terrace(args);
    assert!(out.status.success(), "{args:?}: {}", said(&out));
    let mut counts: BTreeMap<String, usize> = names.values().map(|n| (n.clone(), 0)).collect();
    let mut buffer = [0; 1 << 16];
    while let Ok(events) = inotify.read_events(&mut buffer) {
        for event in events.filter(|e| e.mask.contains(EventMask::OPEN)) {
            *counts.get_mut(&names[&event.wd.get_watch_descriptor_id()]).expect("watched") += 1;
        }
    }
    counts
}

#[test]
#[ignore = "slow: make test-all"]
fn every_command_opens_each_input_once_and_once_for_its_hash() {
    let dir = folder();
    let path = |name: &str| dir.path().join(name).display().to_string();
    write_stl(Path::new(&path("part.stl")), &mesh(20, [-12.0, -10.0, 12.0, 10.0], |x, y| 0.004 * (x * x + y * y)));
    let drawing = "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"8mm\" height=\"8mm\" viewBox=\"0 0 8 8\">\
                   <path d=\"M1 1 L7 7 L1 7 Z\"/></svg>";
    std::fs::write(path("drawing.svg"), drawing).expect("written");
    std::fs::write(path("grey.png"), image::height_map(2, &[0, 20_000, 40_000, 60_000])).expect("written");
    std::fs::write(path("machine.toml"), terrace(["machines", "xyz-galvo-100"]).stdout).expect("written");
    let mut job = JobText::on(Path::new(&path("part.stl")))
        .texture("file = \"drawing.svg\"")
        .texture("file = \"drawing.svg\"\norigin = [\"-10 mm\", \"-9 mm\"]")
        .texture("file = \"grey.png\"\nsize = [\"1 mm\", \"1 mm\"]\npitch = \"0.25 mm\"")
        .texture("file = \"grey.png\"\nsize = [\"1 mm\", \"1 mm\"]\nscreen = \"lines\"\npitch = \"0.25 mm\"\norigin = [\"-9 mm\", \"0 mm\"]")
        .texture("pattern = \"hatch\"\npitch = \"9 mm\"")
        .method("auto");
    job.machine = "file = \"machine.toml\"".into();
    job.write(dir.path(), "one.toml");
    job.more = "[passes]\ncount = 3\nrotate = \"30 deg\"\n".into();
    job.write(dir.path(), "passes.toml");
    let [one, passes] = ["one.toml", "passes.toml"].map(path);
    let [stepped, fly] = ["one.job", "one.fly.job"].map(path);
    for (args, most) in [
        (vec!["check", &one], 1),
        (vec!["check", &passes], 1),
        (vec!["preview", &one, "-o", "-"], 1),
        (vec!["orient", &one], 1),
        (vec!["compare", &one, "--systems", "flat,contour,z-range,zoom,sync,5-axis"], 1),
        (vec!["compile", &one], 2),
        (vec!["compile", &passes], 2),
        (vec!["compile", &one, "--mode", "on-the-fly"], 2),
        (vec!["verify", &stepped], 2),
        (vec!["verify", &fly], 2),
        (vec!["batch", &one], 2),
    ] {
        for (name, times) in opened(dir.path(), &args) {
            let is_other_job = name.ends_with(".toml") && name != "machine.toml" && !args[1].ends_with(&name);
            // Drawings are read once more by the verifier's own reader, bitmaps for its own densities.
            let is_read_again = [".svg", ".png"].iter().any(|end| name.ends_with(end));
            let most = most + usize::from(args == ["verify", stepped.as_str()] && is_read_again);
            // `orient` chooses the side by the facets as the file has them, then reads the part as it is laid.
            let most = most + usize::from(args[0] == "orient" && name == "part.stl");
            assert!(is_other_job || times <= most, "{args:?} opens {name} {times} times");
        }
    }
}
