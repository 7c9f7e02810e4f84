//! Speed and memory of the whole job, on three sizes: `make bench` prints the table.
//!
//! A plain program that does what cannot be left out (`floor`) runs first on every size, in the same run. CPU seconds
//! are told as multiples of its own as well, and these and the memory are compared with the figures that the repository
//! keeps (`benches/kept.json`): what has become slower or larger by more than a tenth is said at the end. `KEEP=write`
//! keeps the figures of this run.
//!
//! Every case runs in a process of its own, on one thread unless its name says two, from files in
//! the page cache, and reports its CPU seconds (user and system) and its peak memory, as the kernel
//! counts them.

#[path = "../tests/it/support/surfaces.rs"]
mod surfaces;

#[path = "support/cpu.rs"]
mod cpu;
#[path = "support/floor.rs"]
mod floor;
#[path = "support/kept.rs"]
mod kept;
#[path = "support/memory.rs"]
mod memory;

use cpu::cpu_s;
use kept::Kept;
use memory::peak_mb;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

use surfaces::{dome, mesh, write_stl};
use terrace::geom::P2;
use terrace::job::{Job, Overrides};
use terrace::job_folder::Durability;
use terrace::surface::{Cursor, Surface};
use terrace::{job_folder, plan, verify};

fn main() {
    let args: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    if let [case, stl] = &args[..] {
        run(case, Path::new(stl));
        return;
    }
    let dir = PathBuf::from(env!("CARGO_TARGET_TMPDIR"));
    println!("{:<34} {:>9} {:>9} {:>9} {:>9}  ", "case, one thread", "CPU s", "x floor", "wall s", "peak MB");
    let mut kept = Kept::read();
    for (n, name) in [(500, "0.5M"), (1000, "2M"), (2000, "8M")] {
        let stl = dir.join(format!("dome-{name}.stl"));
        if !stl.exists() {
            write_stl(&stl, &mesh(n, [0.0, 0.0, 450.0, 450.0], dome));
        }
        let mut floor_s = 0.0;
        for case in [
            "floor",
            "load",
            "walk",
            "contour",
            "z-range",
            "auto",
            "squares",
            "dots",
            "dots, two threads",
            "poisson",
            "poisson, two threads",
            "verify",
            "flush",
        ] {
            let me = std::env::current_exe().expect("this program");
            let out = Command::new(me).arg(case).arg(&stl).output().expect("this program starts");
            assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
            let text = String::from_utf8(out.stdout).expect("text");
            let [cpu_s, wall_s, peak_mb, note] = columns(&text);
            let [cpu_s, wall_s, peak_mb]: [f64; 3] = [cpu_s, wall_s, peak_mb].map(|v| v.parse().expect("a number"));
            if case == "floor" {
                floor_s = cpu_s;
            }
            let ratio = cpu_s / floor_s;
            let case = format!("{name} triangles, {case}");
            println!("{case:<34} {cpu_s:>9.2} {ratio:>9.2} {wall_s:>9.2} {peak_mb:>9.0}  {note}");
            kept.add(&case, ratio, peak_mb);
        }
    }
    kept.tell();
}

/// The three figures of a case, and what is noted of it.
fn columns(line: &str) -> [&str; 4] {
    let mut rest = line.trim();
    let mut next = || {
        let (word, more) = rest.split_once(char::is_whitespace).unwrap_or((rest, ""));
        rest = more.trim_start();
        word
    };
    let [a, b, c] = [next(), next(), next()];
    [a, b, c, rest]
}

/// Runs one case and prints what it took.
fn run(case: &str, stl: &Path) {
    let (case, threads) = case.strip_suffix(", two threads").map_or((case, 1), |case| (case, 2));
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
    let start = Instant::now();
    let note = pool.install(|| match case {
        "floor" => format!("{} pieces", floor::job(stl, 0.1)),
        "load" => format!("{} facets", load(stl).facet_count()),
        "walk" => walk(&load(stl)),
        "verify" => {
            let proof = verify::verify(&stl.with_extension("contour.job"), None).unwrap_or_else(|e| panic!("{e}"));
            assert!(proof.ok, "{}", proof.to_text());
            format!("{} fragments proved", proof.fragments)
        }
        method => job(method, stl),
    });
    println!("{:>9.2} {:>9.2} {:>9.0}  {note}", cpu_s(), start.elapsed().as_secs_f64(), peak_mb());
}

fn load(stl: &Path) -> Surface {
    Surface::load_mm(stl).unwrap_or_else(|e| panic!("{e}"))
}

/// Facets crossed in a second by the lines of a 0.1 mm hatch.
fn walk(surface: &Surface) -> String {
    let (mut cursor, mut spans) = (Cursor::default(), Vec::new());
    let (mut crossed, mut sum) = (0usize, 0.0);
    let start = Instant::now();
    for i in 0..=4500 {
        let y = i * 100_000;
        surface.walk(P2::new(0, y), P2::new(450_000_000, y), &mut cursor, &mut spans);
        crossed += spans.len();
        sum += spans[spans.len() / 2].z0;
    }
    let rate = crossed as f64 / start.elapsed().as_secs_f64() / 1e6;
    format!("{crossed} crossings, {rate:.1} M/s (check sum {sum:.0})")
}

/// Compiles to a folder on disk; dots are planned and ordered alone.
fn job(case: &str, stl: &Path) -> String {
    let (method, texture) = match case {
        "flush" => ("z-range", "pattern = \"hatch\"\npitch = \"1 mm\""),
        "squares" => ("z-range", "pattern = \"squares\"\npitch = \"1 mm\"\ncell = \"0.6 mm\""),
        "dots" => ("z-range", "pattern = \"dots\"\npitch = \"0.45 mm\"\njitter = \"50 %\""),
        "poisson" => ("z-range", "pattern = \"poisson\"\npitch = \"0.4 mm\""),
        method => (method, "pattern = \"hatch\"\npitch = \"0.1 mm\""),
    };
    let name = stl.file_name().and_then(|n| n.to_str()).expect("a name");
    let text = format!(
        "[surface]\nfile = {name:?}\nunit = \"mm\"\n[[texture]]\n{texture}\n[focus]\npdof = \"0.07 mm\"\n[partition]\n\
         method = \"{method}\"\n[machine]\nprofile = \"xyz-galvo-40\"\n[[pen]]\nname = \"a\"\nspeed = \"1000 mm/s\"\n\
         power = \"60 %\"\nfrequency = \"60 kHz\"\ndwell = \"1 ms\"\n"
    );
    let path = stl.with_extension(format!("{case}.toml"));
    std::fs::write(&path, &text).expect("a writable folder");
    let job = Job::parse(&path, &text, &Overrides::default()).unwrap_or_else(|e| panic!("{e}"));
    let begin = Instant::now();
    let plan = plan::plan(job, &|_, _| {}).unwrap_or_else(|e| panic!("{e}"));
    if let "dots" | "poisson" = case {
        let (s, planned) = (&plan.stepped().expect("a stepped job").summary, begin.elapsed().as_secs_f64());
        return format!("{} stops, {} dots, {:.0} a second", s.stops, s.dots.marked, s.dots.marked as f64 / planned);
    }
    let write = |durability| {
        let begin = Instant::now();
        let target = stl.with_extension(format!("{case}.job"));
        job_folder::write_with(&plan, &target, durability, &|_, _| {}).unwrap_or_else(|e| panic!("{e}"));
        begin.elapsed().as_secs_f64()
    };
    let written = write(Durability::Unsynced);
    if case == "flush" {
        return format!("written in {written:.2} s, and flushed to disk in {:.2} s", write(Durability::Synced));
    }
    let s = &plan.stepped().expect("a stepped job").summary;
    let per_figure = s.jump_mm / s.fragments.max(1) as f64;
    format!("{} stops, {} fragments, jumps {per_figure:.3} mm each", s.stops, s.fragments)
}
