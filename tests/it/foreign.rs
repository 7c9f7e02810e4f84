//! Foreign readers agree with the written files: ezdxf, protobuf, LinuxCNC's interpreter, galvoplotter and meerk40t.
//!
//! `tests/python/setup.sh` installs them (`make test` runs it). Without them these tests fail.

use std::path::{Path, PathBuf};
use std::process::Command;
use terrace_core::math;

use crate::support::surfaces::{dome, mesh, write_stl};
use crate::support::{JobText, compile, folder, machine_file, manifest, said, shared, verify};
use serde_json::Value;

/// The folder of the foreign readers.
pub fn readers() -> PathBuf {
    let venv = Path::new(env!("CARGO_MANIFEST_DIR")).join(".venv");
    let installed = venv.join("bin/python").exists() && venv.join("linuxcnc/rs274").exists();
    assert!(installed, "the foreign readers are not installed: run tests/python/setup.sh");
    venv
}

/// Has foreign readers compare the files of a job folder with its program.txt.
pub fn check_folder(job: &Path, scripts: &[&str]) {
    let venv = readers();
    scripts.iter().for_each(|script| check(&venv, script, job));
}

fn check(venv: &Path, script: &str, job: &Path) {
    let script_path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python").join(script);
    let mut command = Command::new(venv.join("bin/python"));
    command.arg(script_path).arg(job);
    if ["check_gcode.py", "check_frames.py"].contains(&script) {
        command.arg(venv.join("linuxcnc/rs274")).arg(venv.join("linuxcnc/tool.tbl"));
    }
    let out = command.output().expect("python starts");
    assert!(out.status.success(), "{script}: {}", said(&out));
    assert!(String::from_utf8_lossy(&out.stdout).starts_with("ok"), "{script}: {}", said(&out));
}

/// Compiles a job in all formats and has every foreign reader compare the files with program.txt.
fn assert_read(job: &JobText, dir: &Path) -> Value {
    let venv = readers();
    let out = dir.join("out.job");
    let summary = compile(&job.write(dir, "job.toml"), &out);
    for script in ["check_dxf.py", "check_csv.py", "check_ovf.py", "check_gcode.py"] {
        let needs_csv = script == "check_csv.py";
        if needs_csv && !job.more.contains("\"csv\"") {
            continue;
        }
        check(&venv, script, &out);
    }
    summary
}

/// Two pens; lines, open and closed polylines: all that a drawing or a program holds.
fn every_entity(stl: &Path, squares: &str) -> JobText {
    let mut job = JobText::on(stl)
        .texture("pattern = \"hatch\"\npitch = \"2 mm\"\ndirection = \"30 deg\"")
        .texture("pattern = \"circles\"\npitch = \"6 mm\"\ncell = \"4 mm\"\npen = \"deep\"")
        .texture(&format!("pattern = \"hilbert\"\n{squares}"));
    job.more =
        "[[pen]]\nname = \"deep\"\nspeed = \"300 mm/s\"\npower = \"7 W\"\nfrequency = \"40 kHz\"\npasses = 3\n\n\
                [emit]\nformats = [\"dxf\", \"csv\", \"linuxcnc\", \"gcode\", \"ovf\"]\n"
            .into();
    job
}

/// The job with dots and a pen for them.
fn with_dots(mut job: JobText) -> JobText {
    job = job.texture("pattern = \"dots\"\npitch = \"3 mm\"\nlattice = \"hex\"\njitter = \"40 %\"\npen = \"dot\"");
    let pen = "[[pen]]\nname = \"dot\"\nspeed = \"500 mm/s\"\npower = \"40 %\"\nfrequency = \"50 kHz\"\npulses = 12\npasses = 2\n";
    job.more = format!("{pen}\n{}", job.more);
    job
}

#[test]
fn ezdxf_protobuf_and_linuxcnc_read_what_was_written() {
    let dir = folder();
    let stl = dir.path().join("bump.stl");
    write_stl(&stl, &mesh(40, [0.0, 0.0, 60.0, 50.0], |x, y| 0.2 * math::sin(x / 9.0) * math::cos(y / 8.0)));
    let hilbert = "order = 4\narea = [\"10 mm\", \"10 mm\", \"50 mm\", \"40 mm\"]";
    let summary = assert_read(&with_dots(every_entity(&stl, hilbert)), dir.path());
    assert!(summary["dots"]["marked"].as_u64() > Some(300), "{summary}");
    assert!(summary["stops"].as_u64() > Some(10), "{summary}");
}

/// A bump on a machine with a zoom optic, an LMC card and an RTC board, in the formats of these, and the checks of them.
fn assert_cards_are_read(formats: &str, scripts: &[&str], [w, h]: [f64; 2], pitch: &str) {
    let dir = folder();
    let stl = dir.path().join("bump.stl");
    write_stl(&stl, &mesh(40, [0.0, 0.0, w, h], |x, y| 0.6 * math::sin(x / 9.0) * math::cos(y / 8.0)));
    let machine = machine_file("xyz-zoom-40").replacen("mirror_y = false", "mirror_y = true", 1)
        + "\n[lmc]\nunits_per_mm = 1500\n[rtc]\nboard = \"rtc5\"\nbits_per_mm = 20000\nfocus_bits_per_mm = 4000\n";
    std::fs::write(dir.path().join("machine.toml"), machine).expect("a writable folder");
    let mut job = every_entity(&stl, "order = 3").partition("min_mark = \"3 um\"");
    if !formats.contains("lightburn") {
        job = with_dots(job);
    }
    job.machine = "file = \"machine.toml\"".into();
    job.textures[0] = format!("pattern = \"hatch\"\npitch = {pitch:?}\ndirection = \"30 deg\"");
    job.more = job.more.replace("[\"dxf\", \"csv\", \"linuxcnc\", \"gcode\", \"ovf\"]", formats);
    let out = dir.path().join("out.job");
    let summary = compile(&job.write(dir.path(), "job.toml"), &out);
    assert!(summary["blocks"].as_u64() > summary["stops"].as_u64(), "{summary}");
    verify(&out);
    let venv = readers();
    scripts.iter().for_each(|script| check(&venv, script, &out));
}

#[test]
#[ignore = "slow: make test-all"]
fn galvoplotter_protobuf_and_linuxcnc_read_a_job_for_cards_with_zoom_optic() {
    let scripts = ["check_lmc.py", "check_rtc.py", "check_ovf.py", "check_gcode.py"];
    assert_cards_are_read("[\"lmc\", \"rtc\", \"linuxcnc\", \"gcode\", \"ovf\"]", &scripts, [46.0, 24.0], "2 mm");
}

#[test]
#[ignore = "slow: make test-all"]
fn meerk40t_loads_projects_for_lightburn() {
    assert_cards_are_read("[\"lightburn\"]", &["check_lightburn.py"], [60.0, 50.0], "0.2 mm");
}

#[test]
#[ignore = "slow: make test-all"]
fn galvoplotter_meerk40t_and_a_player_of_lists_read_a_block_of_10_000_marks() {
    let dir = folder();
    let stl = dir.path().join("plate.stl");
    write_stl(&stl, &mesh(2, [0.0, 0.0, 36.0, 25.0], |_, _| 0.0));
    let machine =
        machine_file("xyz-galvo-40") + "\n[lmc]\nunits_per_mm = 1500\n[rtc]\nboard = \"rtc5\"\nbits_per_mm = 20000\n";
    std::fs::write(dir.path().join("machine.toml"), machine).expect("a writable folder");
    let squares = "pattern = \"squares\"\npitch = \"0.25 mm\"\ncell = \"0.2 mm\"";
    let lines = "pattern = \"hatch\"\npitch = \"0.1 mm\"\npen = \"deep\"";
    let mut job = JobText::on(&stl)
        .texture(&format!("{squares}\narea = [\"0 mm\", \"0 mm\", \"30 mm\", \"25 mm\"]"))
        .texture(&format!("{lines}\narea = [\"31 mm\", \"0 mm\", \"35 mm\", \"25 mm\"]"));
    job.machine = "file = \"machine.toml\"".into();
    job.more = every_entity(&stl, "")
        .more
        .replace("[\"dxf\", \"csv\", \"linuxcnc\", \"gcode\", \"ovf\"]", "[\"lmc\", \"lightburn\", \"rtc\"]");
    let out = dir.path().join("out.job");
    compile(&job.write(dir.path(), "job.toml"), &out);
    verify(&out);
    let blocks = manifest(&out)["blocks"].clone();
    assert_eq!(blocks.as_array().map(Vec::len), Some(1));
    assert!(blocks[0]["strokes"].as_u64() >= Some(10_000), "{blocks}");
    // More than a packet, a shape and a list can hold.
    let bytes =
        |ending: &str| std::fs::read(out.join("blocks/B0001").with_extension(ending)).expect("a file of the block");
    let count = |ending: &str, word: &str| String::from_utf8(bytes(ending)).expect("text").matches(word).count();
    assert!(bytes("lmc").len() > 200 * 3072);
    assert!(count("lbrn2", "<Shape ") >= 3 && count("rtc", "\nlist ") >= 15);
    let venv = readers();
    ["check_lmc.py", "check_lightburn.py", "check_rtc.py"].iter().for_each(|script| check(&venv, script, &out));
}

#[test]
#[ignore = "slow: make test-all"]
fn ezdxf_protobuf_and_linuxcnc_read_a_dome_of_450_mm() {
    let dir = folder();
    let stl = dir.path().join("dome.stl");
    write_stl(&stl, &mesh(200, [0.0, 0.0, 450.0, 450.0], dome));
    let hilbert = "order = 7\narea = [\"100 mm\", \"100 mm\", \"200 mm\", \"180 mm\"]";
    assert_read(&every_entity(&stl, hilbert), dir.path());
}

#[test]
#[ignore = "slow, needs ../shared: make test-all"]
fn ezdxf_protobuf_and_linuxcnc_read_contour_lines_on_a_mirror() {
    let (dir, data) = (folder(), shared());
    let svg = data.join("textures/contours_jacksboro_40m.svg");
    let job = JobText::on(&data.join("surfaces/mirror_freeform.stl"))
        .texture(&format!(
            "file = {:?}\norigin = [\"-50 mm\", \"80 mm\"]\nfill = \"outline\"\nstroke = \"centre\"",
            svg.display().to_string()
        ))
        .method("z-range");
    assert!(assert_read(&job, dir.path())["fragments"].as_u64() > Some(1000));
}
