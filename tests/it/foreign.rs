//! Foreign readers agree with the written files: ezdxf, protobuf, and LinuxCNC's interpreter.
//!
//! `tests/python/setup.sh` installs them (`make test` runs it). Without them these tests say so and
//! pass, but fail where CI is set.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::support::surfaces::{dome, mesh, write_stl};
use crate::support::{JobText, compile, folder, said};

/// The folder of the foreign readers; None, said aloud, where they are not installed.
fn readers() -> Option<PathBuf> {
    let venv = Path::new(env!("CARGO_MANIFEST_DIR")).join(".venv");
    if venv.join("bin/python").exists() && venv.join("linuxcnc/rs274").exists() {
        return Some(venv);
    }
    assert!(std::env::var_os("CI").is_none(), "the foreign readers are not installed: run tests/python/setup.sh");
    eprintln!("\n*** SKIPPED: the foreign readers are not installed; run tests/python/setup.sh\n");
    None
}

fn check(venv: &Path, script: &str, job: &Path) {
    let script_path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python").join(script);
    let mut command = Command::new(venv.join("bin/python"));
    command.arg(script_path).arg(job);
    if script == "check_gcode.py" {
        command.arg(venv.join("linuxcnc/rs274")).arg(venv.join("linuxcnc/tool.tbl"));
    }
    let out = command.output().expect("python starts");
    assert!(out.status.success(), "{script}: {}", said(&out));
    assert!(String::from_utf8_lossy(&out.stdout).starts_with("ok"), "{script}: {}", said(&out));
}

#[test]
fn foreign_readers_read_what_was_written() {
    let Some(venv) = readers() else { return };
    let dir = folder();
    let stl = dir.path().join("dome.stl");
    write_stl(&stl, &mesh(200, [0.0, 0.0, 450.0, 450.0], dome));
    let mut job = JobText::on(&stl)
        .texture("pattern = \"hatch\"\npitch = \"2 mm\"\ndirection = \"30 deg\"")
        .texture("pattern = \"circles\"\npitch = \"6 mm\"\ncell = \"4 mm\"\npen = \"deep\"")
        .texture("pattern = \"hilbert\"\norder = 7\narea = [\"100 mm\", \"100 mm\", \"200 mm\", \"180 mm\"]");
    job.more =
        "[[pen]]\nname = \"deep\"\nspeed = \"300 mm/s\"\npower = \"7 W\"\nfrequency = \"40 kHz\"\npasses = 3\n\n\
                [emit]\nformats = [\"dxf\", \"csv\", \"linuxcnc\", \"gcode\", \"ovf\"]\n"
            .into();
    let out = dir.path().join("dome.job");
    compile(&job.write(dir.path(), "dome.toml"), &out);
    for script in ["check_dxf.py", "check_csv.py", "check_ovf.py", "check_gcode.py"] {
        check(&venv, script, &out);
    }
}

#[test]
fn foreign_readers_read_a_real_panel() {
    let (Some(venv), Some(data)) = (readers(), crate::support::shared()) else { return };
    let dir = folder();
    let svg = data.join("textures/contours_jacksboro_40m.svg");
    let job = JobText::on(&data.join("surfaces/mirror_freeform.stl"))
        .texture(&format!("file = {:?}\norigin = [\"-50 mm\", \"80 mm\"]", svg.display().to_string()))
        .method("z-range");
    let out = dir.path().join("mirror.job");
    let summary = compile(&job.write(dir.path(), "mirror.toml"), &out);
    assert!(summary["fragments"].as_u64() > Some(1000));
    for script in ["check_dxf.py", "check_ovf.py", "check_gcode.py"] {
        check(&venv, script, &out);
    }
}
