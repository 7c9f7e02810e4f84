//! What a newcomer does wrong on the first day, and what is said of it: `mistakes.txt` holds the messages, to be read
//! whole. `MISTAKES=write` writes it anew; every message in it is to say what is wrong, where, and what to do.

use std::fmt::Write;
use std::path::Path;
use std::process::Command;

use terrace_input::job::SAMPLE_JOB;

use crate::support::{fixture, folder, said};

/// Texts of the sample job, as they begin a line, and what is written in their place.
const EDITS: &[[&str; 2]] = &[
    ["pdof = \"0.07 mm\"", "pdof = 0.07 mm"],
    ["pdof = \"0.07 mm\"", "pdof: \"0.07 mm\""],
    ["pdof = \"0.07 mm\"", "pdof = \"0.07 mm"],
    ["pdof = \"0.07 mm\"", "pdof = \"0.07 mm\";"],
    ["pdof = \"0.07 mm\"", "pdof = “0.07 mm”"],
    ["pdof = \"0.07 mm\"", "pdof = \"0.07\""],
    ["pdof = \"0.07 mm\"", "pdof = 0.07"],
    ["pdof = \"0.07 mm\"", "pdof = \"0,07 mm\""],
    ["pdof = \"0.07 mm\"", "pdof = \"70 mm\""],
    ["pdof = \"0.07 mm\"", "pdof = \"70 MM\""],
    ["pdof = \"0.07 mm\"", "pdof = \"70 microns\""],
    ["pdof = \"0.07 mm\"", "pdof = \"mm 0.07\""],
    ["pdof = \"0.07 mm\"", "pdof = \"\""],
    ["pdof = \"0.07 mm\"", "pdof ="],
    ["pdof = \"0.07 mm\"", "pdof = \"0 mm\""],
    ["pdof = \"0.07 mm\"", "pdof = \"-0.07 mm\""],
    ["pdof = \"0.07 mm\"", "pdof = \"nan mm\""],
    ["pdof = \"0.07 mm\"", "pdof = \"1e-9 mm\""],
    ["pdof = \"0.07 mm\"", "pdof = \"0.07 mm\"\npdof = \"0.08 mm\""],
    ["pdof = \"0.07 mm\"", "dof = \"0.07 mm\"\npdof = \"0.08 mm\""],
    ["pdof = \"0.07 mm\"", "PDOF = \"0.07 mm\""],
    ["pdof = \"0.07 mm\"", "depth = \"0.07 mm\""],
    ["pdof = \"0.07 mm\"", "pdof = [\"0.07 mm\"]"],
    ["pdof = \"0.07 mm\"", "pdof = { value = \"0.07 mm\" }"],
    ["pdof = \"0.07 mm\"", "pdof = true"],
    ["pdof = \"0.07 mm\"", "// depth\npdof = \"0.07 mm\""],
    ["pdof = \"0.07 mm\"", "pdof == \"0.07 mm\""],
    ["pdof = \"0.07 mm\"", "pdof = \"0.07 mm\"\nreserve = \"0.08 mm\""],
    ["pdof = \"0.07 mm\"", "pdof = \"0.07 mm\"\nfactor = 1.2\nreserve = \"1 %\""],
    ["unit = \"mm\"", "unit = \"millimeters\""],
    ["unit = \"mm\"", "unit = \"MM\""],
    ["unit = \"mm\"", "unit = \"ft\""],
    ["unit = \"mm\"", "unit = mm"],
    ["unit = \"mm\"", "# no unit"],
    ["file = \"sample.stl\"", "file = \"sample.STL\""],
    ["file = \"sample.stl\"", "file = \"sampel.stl\""],
    ["file = \"sample.stl\"", "file = \"sample\""],
    ["file = \"sample.stl\"", "file = \"C:\\parts\\sample.stl\""],
    ["file = \"sample.stl\"", "file = sample.stl"],
    ["file = \"sample.stl\"", "file = \".\""],
    ["file = \"sample.stl\"", "file = \"page.stl\""],
    ["file = \"sample.stl\"", "file = \"lfs.stl\""],
    ["file = \"sample.stl\"", "file = \"empty.stl\""],
    ["file = \"sample.stl\"", "file = \"sample.svg\""],
    ["file = \"sample.stl\"", "file = \"part.sldprt\""],
    ["file = \"sample.stl\"", "file = \"part.zip\""],
    ["file = \"sample.stl\"", "file = \"job.toml\""],
    ["file = \"sample.stl\"", "file = \"nofile/sample.stl\""],
    ["pattern = \"hatch\"", "pattern = \"hatching\""],
    ["pattern = \"hatch\"", "pattern = \"Hatch\""],
    ["pattern = \"hatch\"", "pattern = hatch"],
    ["pattern = \"hatch\"", "pattern = \"leather\""],
    ["pattern = \"hatch\"", "pattern = \"hatch\"\nfile = \"sample.svg\""],
    ["pattern = \"hatch\"", "file = \"nothing.svg\""],
    ["pattern = \"hatch\"", "file = \"text.svg\""],
    ["pattern = \"hatch\"", "file = \"nosize.svg\""],
    ["pattern = \"hatch\"", "file = \"empty.svg\""],
    ["pattern = \"hatch\"", "file = \"page.svg\""],
    ["pattern = \"hatch\"", "file = \"photo.png\""],
    ["pattern = \"hatch\"", "file = \"drawing.ai\""],
    ["pattern = \"hatch\"", "file = \"drawing.pdf\""],
    ["pattern = \"hatch\"", "file = \"drawing.dwg\""],
    ["pitch = \"0.5 mm\"", "# no pitch"],
    ["pitch = \"0.5 mm\"", "pitch = \"0 mm\""],
    ["pitch = \"0.5 mm\"", "pitch = \"0.5 um\""],
    ["pitch = \"0.5 mm\"", "pitch = \"500 mm\""],
    ["pitch = \"0.5 mm\"", "spacing = \"0.5 mm\""],
    ["pitch = \"0.5 mm\"", "pitch = \"0.5 mm\"\ncell = \"1 mm\""],
    ["pitch = \"0.5 mm\"", "pitch = 0.5"],
    ["direction = \"0 deg\"", "direction = 0"],
    ["direction = \"0 deg\"", "direction = \"0 degrees\""],
    ["direction = \"0 deg\"", "direction = \"x\""],
    ["direction = \"0 deg\"", "angle = \"0 deg\""],
    ["area = \"part\"", "area = \"all\""],
    ["area = \"part\"", "area = [0, 0, 10, 10]"],
    ["area = \"part\"", "area = [\"10 mm\", \"10 mm\", \"0 mm\", \"0 mm\"]"],
    ["area = \"part\"", "area = [\"0 mm\", \"0 mm\", \"10 mm\"]"],
    ["area = \"part\"", "area = [\"500 mm\", \"500 mm\", \"510 mm\", \"510 mm\"]"],
    ["area = \"part\"", "mirror = true"],
    ["area = \"part\"", "tile = \"yes\""],
    ["area = \"part\"", "fill = True"],
    ["pen = \"fill\"", "pen = \"engrave\""],
    ["pen = \"fill\"", "pen = 1"],
    ["pen = \"fill\"", "pens = [\"fill\"]"],
    ["method = \"auto\"", "method = \"best\""],
    ["method = \"auto\"", "method = \"tilt\""],
    ["method = \"auto\"", "method = \"auto\"\nsection = \"60 mm\""],
    ["method = \"auto\"", "method = \"auto\"\nsection = \"0 mm\""],
    ["method = \"auto\"", "method = \"auto\"\noverlap = \"1 mm\"\nzone = \"1 mm\""],
    ["profile = \"xyz-galvo-40\"", "profile = \"xyz-galvo-41\""],
    ["profile = \"xyz-galvo-40\"", "profile = \"xyz-galvo-40\"\nfile = \"machine.toml\""],
    ["profile = \"xyz-galvo-40\"", "file = \"machine.toml\""],
    ["profile = \"xyz-galvo-40\"", "name = \"xyz-galvo-40\""],
    ["name = \"fill\"", "name = \"fill\"\nname = \"x\""],
    ["name = \"fill\"", "name = \"\""],
    ["speed = \"1000 mm/s\"", "speed = \"1000\""],
    ["speed = \"1000 mm/s\"", "speed = \"1000 mm/sec\""],
    ["speed = \"1000 mm/s\"", "speed = \"0 mm/s\""],
    ["speed = \"1000 mm/s\"", "speed = \"-5 mm/s\""],
    ["speed = \"1000 mm/s\"", "speed = \"100 m/s\""],
    ["speed = \"1000 mm/s\"", "# none"],
    ["power = \"60 %\"", "power = \"60\""],
    ["power = \"60 %\"", "power = 60"],
    ["power = \"60 %\"", "power = \"120 %\""],
    ["power = \"60 %\"", "power = \"60 percent\""],
    ["power = \"60 %\"", "power = \"500 W\""],
    ["power = \"60 %\"", "power = \"0 %\""],
    ["frequency = \"60 kHz\"", "frequency = \"60\""],
    ["frequency = \"60 kHz\"", "frequency = \"60 khz\""],
    ["frequency = \"60 kHz\"", "frequency = \"0 kHz\""],
    ["passes = 1", "passes = 0"],
    ["passes = 1", "passes = 1.5"],
    ["passes = 1", "passes = \"1\""],
    ["passes = 1", "repeat = 2"],
    ["formats = [\"dxf\", \"linuxcnc\", \"ovf\"]", "formats = [\"dfx\"]"],
    ["formats = [\"dxf\", \"linuxcnc\", \"ovf\"]", "formats = \"dxf\""],
    ["formats = [\"dxf\", \"linuxcnc\", \"ovf\"]", "formats = [\"lmc\"]"],
    ["formats = [\"dxf\", \"linuxcnc\", \"ovf\"]", "formats = [\"rtc\"]"],
    ["formats = [\"dxf\", \"linuxcnc\", \"ovf\"]", "formats = [\"pmac\"]"],
    ["formats = [\"dxf\", \"linuxcnc\", \"ovf\"]", "formats = []\nframes = \"fill\""],
    ["[[texture]]", "[texture]"],
    ["[focus]", "[focus"],
    ["[focus]", "[fokus]"],
    ["[[pen]]", "[pen]"],
    ["[emit]", "[output]"],
    ["[limits]", "[limits]\nwarn_incidence = \"95 deg\"\nmax = 1"],
    ["max_incidence = \"60 deg\"", "max_incidence = \"60\""],
    ["turn = \"0 deg\"", "turn = \"0 deg\"\nrotate = [\"0 deg\", \"0 deg\"]"],
    ["turn = \"0 deg\"", "origin = [\"5 m\", \"0 mm\", \"0 mm\"]"],
    ["turn = \"0 deg\"", "origin = [0, 0, 0]"],
];

/// Command lines beside the sample job.
const COMMANDS: &[&[&str]] = &[
    &["compile", "sample.stl"],
    &["compile", "jop.toml"],
    &["compile", "."],
    &["compile"],
    &["compile", "job.toml", "other.toml"],
    &["compile", "job.toml", "-o", "job.toml"],
    &["compile", "job.toml", "--out", "x"],
    &["compile", "job.toml", "--mode", "fly"],
    &["verify", "job.job"],
    &["verify", "job.toml"],
    &["verify", "."],
    &["verify", "sample.stl"],
    &["verify", "nothing"],
    &["complie", "job.toml"],
    &["check", "job.toml", "-j", "0"],
    &["sweep", "job.toml"],
    &["sweep", "job.toml", "--set", "pdof=0.1mm,0.2mm"],
    &["sweep", "job.toml", "--set", "focus.pdof=0.1,0.2"],
    &["sweep", "job.toml", "--set", "focus.pdof"],
    &["sweep", "job.toml", "--set", "focus.pdof=0mm,1mm/3"],
    &["inspect", "nothing.stl"],
    &["inspect", "page.stl"],
    &["inspect", "sample.stl", "--unit", "feet"],
    &["machines", "xyz-galvo"],
    &["explain", "nonsense"],
    &["run", "job.toml"],
    &["run", "nothing.job"],
    &["resume", "nothing.job", "--from", "B0001", "-o", "x"],
    &["preview", "job.toml", "-o", "x.gif"],
    &["batch", "nothing"],
    &["batch", ".", "-o", "job.toml"],
    &["compare", "job.toml", "--systems", "laser"],
    &["diff", "job.toml", "job.toml"],
    &["import", "sample.stl"],
    &["orient", "sample.stl"],
];

/// The sample job, and files of other kinds under the names of those that are wanted.
fn lay(dir: &Path) {
    let write = |name: &str, bytes: &[u8]| std::fs::write(dir.join(name), bytes).expect("a writable folder");
    let done = terrace(dir, &["init", "."]);
    assert!(done.status.success(), "{}", said(&done));
    let page = b"<!DOCTYPE html>\n<html><body>Sign in</body></html>\n";
    write("page.stl", page);
    write("page.svg", page);
    write("lfs.stl", b"version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n");
    write("empty.stl", b"");
    write("empty.svg", b"");
    write("part.sldprt", &[0xd0, 0xcf, 0x11, 0xe0]);
    write("part.zip", b"PK\x03\x04");
    let svg = |size: &str, inside: &str| {
        format!("<svg xmlns=\"http://www.w3.org/2000/svg\" {size} viewBox=\"0 0 10 10\">{inside}</svg>")
    };
    let page_size = "width=\"10mm\" height=\"10mm\"";
    write("text.svg", svg(page_size, "<text x=\"1\" y=\"5\">A</text>").as_bytes());
    write("nosize.svg", svg("", "<path d=\"M1 1h5\"/>").as_bytes());
    write("drawing.ai", b"%!PS-Adobe-3.0\n");
    write("drawing.pdf", b"%PDF-1.4\n");
    write("drawing.dwg", b"AC1027\0\0\0");
    std::fs::copy(fixture("aerofoil.png"), dir.join("photo.png")).expect("a fixture");
}

fn terrace(dir: &Path, args: &[&str]) -> std::process::Output {
    Command::new(env!("CARGO_BIN_EXE_terrace")).current_dir(dir).args(args).output().expect("the program starts")
}

/// What was done, and all that was said of it.
fn answer(dir: &Path, what: &str, args: &[&str]) -> String {
    let out = terrace(dir, args);
    let text = String::from_utf8_lossy(&out.stderr).replace(&dir.display().to_string(), "DIR");
    // How long a job took is not what is read here.
    let text = text.replace("after 0.1 s", "after 0.0 s");
    assert!(!text.trim().is_empty(), "{what}: nothing is said, {}", said(&out));
    assert_ne!(out.status.code(), Some(3), "{what}: {text}");
    // How far the work has come is no answer.
    let lines: String = text
        .lines()
        .filter(|line| !line.starts_with("step "))
        .map(|line| format!("    {line}").trim_end().to_owned() + "\n")
        .collect();
    format!("{what}\n{lines}\n")
}

#[test]
fn every_mistake_is_answered_as_it_was_read_to_be_right() {
    let dir = folder();
    lay(dir.path());
    let mut found = String::new();
    for [from, to] in EDITS {
        let at = SAMPLE_JOB.find(&format!("\n{from}")).unwrap_or_else(|| panic!("{from}")) + 1;
        let text = [&SAMPLE_JOB[..at], to, &SAMPLE_JOB[at + from.len()..]].concat();
        std::fs::write(dir.path().join("job.toml"), text).expect("a writable folder");
        let _ = write!(found, "{}", answer(dir.path(), &to.replace('\n', " | "), &["check", "job.toml"]));
    }
    std::fs::write(dir.path().join("job.toml"), SAMPLE_JOB).expect("a writable folder");
    for args in COMMANDS {
        let _ = write!(found, "{}", answer(dir.path(), &format!("terrace {}", args.join(" ")), args));
    }
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it/mistakes.txt");
    if std::env::var_os("MISTAKES").is_some_and(|v| v == "write") {
        std::fs::write(&file, &found).expect("a writable folder");
    }
    let kept = std::fs::read_to_string(&file).expect("it is kept");
    let wrong = kept.lines().zip(found.lines()).find(|(kept, found)| kept != found);
    assert!(kept == found, "MISTAKES=write makes it anew; first difference: {wrong:?}");
    assert!(EDITS.len() + COMMANDS.len() >= 143);
}
