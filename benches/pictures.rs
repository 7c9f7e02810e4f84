//! Time and size of the pictures of a large job, beside the time in which it is planned: `make bench` prints the table.
//!
//! A fine hatch on the dome of the counts: some 3,500 blocks and 700,000 fragments, on all threads.

#[path = "../tests/it/support/surfaces.rs"]
mod surfaces;

use std::path::PathBuf;
use std::time::Instant;

use surfaces::{dome, mesh, write_stl};
use terrace_input::job::{Job, Overrides};
use terrace_plan::plan::{self, Plan};
use terrace_report::job_folder::{self, Durability, Pictures};

fn main() {
    let dir = PathBuf::from(env!("CARGO_TARGET_TMPDIR"));
    let stl = dir.join("dome-pictures.stl");
    if !stl.exists() {
        write_stl(&stl, &mesh(300, [0.0, 0.0, 450.0, 450.0], dome));
    }
    let text = "[surface]\nfile = \"dome-pictures.stl\"\nunit = \"mm\"\n[[texture]]\npattern = \"hatch\"\npitch = \"0.1 mm\"\n\
                [focus]\npdof = \"0.07 mm\"\n[partition]\nmethod = \"contour\"\n[machine]\nprofile = \"xyz-galvo-40\"\n\
                [[pen]]\nname = \"a\"\nspeed = \"1000 mm/s\"\npower = \"60 %\"\nfrequency = \"60 kHz\"\n";
    let path = dir.join("pictures.toml");
    std::fs::write(&path, text).expect("a writable folder");
    let job = Job::parse(&path, text, &Overrides::default()).unwrap_or_else(|e| panic!("{e}"));
    let (plan, planned) = timed(|| plan::plan(job, &|_, _| {}).unwrap_or_else(|e| panic!("{e}")));
    let Plan::Stepped(stepped) = &plan else { return };
    println!("{} blocks, {} fragments", stepped.summary.blocks, stepped.summary.fragments);
    let ((), folder) = timed(|| {
        job_folder::write_with(&plan, &dir.join("pictures.job"), Durability::Unsynced, &|_, _| {})
            .unwrap_or_else(|e| panic!("{e}"));
    });
    let whole = planned + folder;
    println!("{:<28} {:>8} {:>12} {:>12}", "", "s", "of compile", "bytes");
    let row = |name: &str, s: f64, bytes: usize| {
        println!("{name:<28} {s:>8.2} {:>10.1} % {bytes:>12}", 100.0 * s / whole);
    };
    row("planned", planned, 0);
    row("folder written", folder, 0);
    let (pictures, s) = timed(|| Pictures::of(&plan).unwrap_or_else(|e| panic!("{e}")));
    row("marks on the part", s, 0);
    let (view, s) = timed(|| pictures.view_html());
    row("view.html", s, view.len());
    let (layout, s) = timed(|| pictures.layout_svg());
    row("layout.svg", s, layout.len());
}

fn timed<T>(work: impl FnOnce() -> T) -> (T, f64) {
    let begin = Instant::now();
    let made = work();
    (made, begin.elapsed().as_secs_f64())
}
