//! First picture and frames a second of `view.html` in Chromium without a graphics card: `make bench` prints the table.
//!
//! Filled leather on a dome: a million marks. Written by the program itself; `tests/browser/time.mjs` drives the page.

#[path = "../tests/it/support/surfaces.rs"]
mod surfaces;

use std::path::{Path, PathBuf};
use std::process::Command;

use surfaces::{dome, mesh, write_stl};

fn main() {
    let dir = PathBuf::from(env!("CARGO_TARGET_TMPDIR"));
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    write_stl(&dir.join("dome-view.stl"), &mesh(300, [0.0, 0.0, 450.0, 450.0], dome));
    let text = format!(
        "[surface]\nfile = \"dome-view.stl\"\nunit = \"mm\"\n[[texture]]\nfile = {:?}\n\
         area = [\"110 mm\", \"110 mm\", \"330 mm\", \"330 mm\"]\ntile = true\nfill = \"hatch\"\n\
         [focus]\npdof = \"0.07 mm\"\n[machine]\nprofile = \"xyz-galvo-40\"\n\
         [[pen]]\nname = \"a\"\nspeed = \"1000 mm/s\"\npower = \"60 %\"\nfrequency = \"60 kHz\"\n",
        root.join("fixtures/leather.svg").display().to_string()
    );
    std::fs::write(dir.join("view.toml"), text).expect("a writable folder");
    run(Command::new(env!("CARGO_BIN_EXE_terrace")).args(["compile", "view.toml", "-o", "view.job", "-q"]), &dir);
    run(Command::new("node").arg(root.join("tests/browser/time.mjs")).arg("view.job"), &dir);
}

/// Runs a command in a folder; its output is the table.
fn run(command: &mut Command, dir: &Path) {
    let status = command.current_dir(dir).status().expect("the command starts");
    assert!(status.success(), "{command:?}");
}
