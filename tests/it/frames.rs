//! Frames: written beside the blocks, read by foreign readers, kept by a resumed job, refused where they would mark.

use std::path::{Path, PathBuf};
use terrace_core::math;

use crate::foreign;
use crate::support::surfaces::{mesh, write_stl};
use crate::support::{JobText, compile, folder, manifest, said, terrace, verify};

const PILOT: &str = "[[pen]]\nname = \"pilot\"\nspeed = \"500 mm/s\"\npower = \"0.1 W\"\nfrequency = \"60 kHz\"\n";

/// A wave in two set-ups, hatched inside a diamond of two passes, with frames by this pen.
fn wave(dir: &Path, pen: &str, pilot: &str) -> PathBuf {
    let stl = dir.join("wave.stl");
    write_stl(&stl, &mesh(20, [0.0, 0.0, 90.0, 50.0], |x, y| 0.2 * math::sin(x / 9.0) * math::cos(y / 8.0)));
    let job = JobText {
        more: format!(
            "[passes]\ncount = 2\nrotate = \"90 deg\"\n\n{pilot}\n\
             [setups]\ncolumns = 2\nregistration = [[\"0 mm\", \"0 mm\"], [\"90 mm\", \"0 mm\"]]\n\n\
             [emit]\nframes = \"{pen}\"\nformats = [\"dxf\", \"csv\", \"lightburn\", \"linuxcnc\", \"gcode\"]\n"
        ),
        ..JobText::on(&stl).texture("pattern = \"circles\"\npitch = \"7 mm\"\ncell = \"5 mm\"")
    };
    job.write(dir, "wave.toml")
}

#[test]
#[ignore = "slow: make test-all"]
fn frames_are_read_by_foreign_readers_and_kept_by_a_resumed_job() {
    let dir = folder();
    let whole = dir.path().join("wave.job");
    compile(&wave(dir.path(), "pilot", PILOT), &whole);
    verify(&whole);
    let outline = manifest(&whole)["frames"]["outline"].as_array().expect("a list").len();
    assert!((4..=16).contains(&outline), "up to eight blocks in each of two set-ups: {outline}");
    foreign::check_folder(&whole, &["check_frames.py"]);

    let rest = dir.path().join("rest.job");
    let paths = [whole.as_path(), Path::new("-o"), &rest].map(|p| p.to_str().expect("text"));
    let out = terrace(["resume", "--from", "B0004"].iter().chain(&paths));
    assert!(out.status.success(), "{}", said(&out));
    verify(&rest);
    foreign::check_folder(&rest, &["check_frames.py"]);
    assert!(!rest.join("frames/B0003-frame.dxf").exists());
    for name in ["B0004-frame.dxf", "B0005-frame.lbrn2"] {
        let [here, there] = [&rest, &whole].map(|f| std::fs::read(f.join("frames").join(name)).expect("a frame"));
        assert!(here == there, "{name}");
    }
}

#[test]
fn frames_that_would_mark_are_refused() {
    let dir = folder();
    let strong = PILOT.replace("0.1 W", "60 %");
    for (pen, pilot, words) in [
        ("pilto", PILOT, ["frames-pen", "\"pilot\""]),
        ("fill", PILOT, ["frames-pen", "marks texture 1"]),
        ("pilot", strong.as_str(), ["frames-power", "60 %"]),
    ] {
        let job = wave(dir.path(), pen, pilot);
        let out = terrace(["compile", job.to_str().expect("text"), "-o", "never.job"]);
        assert!(!out.status.success());
        words.iter().for_each(|word| assert!(said(&out).contains(word), "{word}: {}", said(&out)));
    }
}
