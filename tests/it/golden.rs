//! Golden programs: the bytes of eight jobs' program files, one job for each method, for passes, for
//! set-ups, and for on-the-fly machines of five and of seven axes.
//!
//! `tests/golden.txt` holds one BLAKE3 hash for each file of each job folder; drawings of blocks are
//! hashed together. Manifests, run sheets, pictures and reports are left out: their words may change
//! without parts having to be qualified again; programs may not. `GOLDEN=write` writes the file anew; a change
//! of it is a change of emitted programs and is listed in CHANGELOG.md.

use std::fmt::Write;
use std::path::Path;
use std::process::Command;

use terrace_core::math;

use crate::support::surfaces::{mesh, write_stl};
use crate::support::{JobText, command, files, folder, said};

const TABLE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/golden.txt");

/// A part of 60 x 50 mm with two humps and a slope.
fn part(dir: &Path) -> std::path::PathBuf {
    let path = dir.join("part.stl");
    let z = |x: f64, y: f64| 0.03 * x + 0.9 * math::sin(x / 11.0) * math::cos(y / 14.0);
    write_stl(&path, &mesh(40, [0.0, 0.0, 60.0, 50.0], z));
    path
}

/// A part of 24 x 20 mm for the on-the-fly machines.
fn small_part(dir: &Path) -> std::path::PathBuf {
    let path = dir.join("small.stl");
    write_stl(&path, &mesh(40, [-12.0, -10.0, 12.0, 10.0], |x, y| 0.004 * (x * x + y * y) + 0.02 * x));
    path
}

const STEPPED_FORMATS: &str = "[emit]\nformats = [\"dxf\", \"linuxcnc\", \"gcode\", \"ovf\"]\n";

/// The jobs by name, with the mode that each is compiled in. Their parts are written to a folder.
pub fn jobs(dir: &Path) -> Vec<(&'static str, JobText, &'static str)> {
    let part = part(dir);
    let small = small_part(dir);
    let stepped = |method| {
        let mut job = JobText::on(&part)
            .texture("pattern = \"hatch\"\npitch = \"0.8 mm\"\ndirection = \"20 deg\"")
            .texture("pattern = \"circles\"\npitch = \"4 mm\"\ncell = \"3 mm\"")
            .method(method);
        job.more = STEPPED_FORMATS.into();
        job
    };
    let tilt = |mut job: JobText| {
        job.machine = "profile = \"xyz-tilt-galvo-40\"".into();
        job
    };
    let with = |mut job: JobText, more: &str| {
        job.more += more;
        job
    };
    let mut setups = stepped("z-range");
    setups.more = "[emit]\nformats = [\"dxf\", \"linuxcnc\", \"gcode\"]\n[setups]\ncolumns = 2\nrows = 1\n\
                   registration = [[\"20 mm\", \"10 mm\"], [\"40 mm\", \"40 mm\"]]\n"
        .into();
    let passes = "[passes]\ncount = 3\nlower = \"8 um\"\nrotate = \"30 deg\"\n[dose]\ncompensate = \"power\"\n";
    let fly = |texture: &str, profile: &str| {
        let mut job = JobText::on(&small).texture(texture).method("auto");
        job.machine = format!("profile = \"{profile}\"");
        job.more.clear();
        job
    };
    vec![
        ("contour", stepped("contour").partition("overlap = \"0.1 mm\""), "stepped"),
        ("z-range", stepped("z-range").partition("keep_whole = \"4 mm\""), "stepped"),
        ("window", stepped("window").partition("zone = \"0.3 mm\""), "stepped"),
        ("tilt", tilt(stepped("tilt")), "stepped"),
        ("passes", with(stepped("z-range"), passes), "stepped"),
        ("setups", setups, "stepped"),
        ("fly-5", fly("pattern = \"hatch\"\npitch = \"4 mm\"", "xyz-galvo-100"), "on-the-fly"),
        ("fly-7", fly("pattern = \"hilbert\"\norder = 4", "xyzac-galvo-10"), "on-the-fly"),
    ]
}

/// Whether a file of a job folder is a program that a machine or an operator's card reads.
fn is_program(name: &str) -> bool {
    ["txt", "dxf", "ngc", "nc", "ovf", "pmc", "csv"].iter().any(|e| name.ends_with(&format!(".{e}")))
        && !name.starts_with("runsheet")
}

/// Compiles a job into a folder with a command of terrace.
pub fn compile(mut command: Command, job: &Path, mode: &str, out: &Path) {
    let done =
        command.args(["compile", "--no-sync", "--mode", mode, "-o"]).args([out, job]).output().expect("terrace runs");
    assert!(done.status.success(), "{}: {}", job.display(), said(&done));
}

#[test]
#[ignore = "slow: make test-all"]
fn all_files_of_eight_jobs_are_the_same_on_a_processor_without_fused_multiply_add() {
    let dir = folder();
    for (name, job, mode) in jobs(dir.path()) {
        let job = job.write(dir.path(), &format!("{name}.toml"));
        let [with, without] = ["with", "without"].map(|set| dir.path().join(set).join(format!("{name}.job")));
        compile(command(), &job, mode, &with);
        // The C library of Linux takes its other code, as on an older processor.
        let mut older = command();
        older.env("GLIBC_TUNABLES", "glibc.cpu.hwcaps=-FMA,-FMA4,-AVX2");
        compile(older, &job, mode, &without);
        assert_eq!(files(&with), files(&without), "{name}");
    }
}

#[test]
fn programs_of_eight_jobs_keep_their_bytes() {
    let dir = folder();
    let mut table = String::new();
    for (name, job, mode) in jobs(dir.path()) {
        let out = dir.path().join(format!("{name}.job"));
        let path = job.write(dir.path(), &format!("{name}.toml"));
        compile(command(), &path, mode, &out);
        let mut blocks = blake3::Hasher::new();
        let mut count = 0;
        for (file, bytes) in files(&out).into_iter().filter(|(file, _)| is_program(file)) {
            if file.starts_with("blocks/") {
                blocks.update(file.as_bytes()).update(&bytes);
                count += 1;
            } else {
                writeln!(table, "{name} {file} {}", blake3::hash(&bytes).to_hex()).expect("a string");
            }
        }
        if count > 0 {
            writeln!(table, "{name} blocks ({count} files) {}", blocks.finalize().to_hex()).expect("a string");
        }
    }
    if std::env::var("GOLDEN").is_ok_and(|v| v == "write") {
        std::fs::write(TABLE, &table).expect("a writable repository");
    }
    let golden = std::fs::read_to_string(TABLE).expect("tests/golden.txt");
    for (is, was) in table.lines().zip(golden.lines()) {
        assert_eq!(is, was, "a program changed; `GOLDEN=write` states that this is meant");
    }
    assert_eq!(table.lines().count(), golden.lines().count());
}
