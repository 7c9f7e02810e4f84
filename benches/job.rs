//! Speed and memory of the whole job, on three sizes: `make bench` prints the table.
//!
//! A plain program that does what cannot be left out (`floor`) runs first on every size, in the same run. Seconds are
//! told as multiples of its own as well, and these and the memory are compared with the figures that the repository
//! keeps (`benches/kept.json`): what has become slower or larger by more than a tenth is said at the end. `KEEP=write`
//! keeps the figures of this run.
//!
//! Every case runs in a process of its own, on one thread unless its name says two, from files in
//! the page cache, and reports the seconds that it computed and its peak memory, as the kernel
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

use cpu::user_s;
use kept::Kept;
use memory::peak_mb;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

use surfaces::{dome, mesh, write_stl};
use terrace_compare::compare;
use terrace_core::geom::P2;
use terrace_input::job::{Job, Overrides};
use terrace_input::surface::{Cursor, Surface};
use terrace_plan::on_the_fly::axes::following_error::Protection;
use terrace_plan::plan;
use terrace_report::job_folder;
use terrace_report::job_folder::Durability;

fn main() {
    let args: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    if let [case, stl] = &args[..] {
        run(case, Path::new(stl));
        return;
    }
    let dir = PathBuf::from(env!("CARGO_TARGET_TMPDIR"));
    let heads = ["user s", "x floor", "wall s", "peak MB", "B/unit"].map(|head| format!("{head:>9}")).join(" ");
    println!("{:<38} {heads}", "case, one thread");
    let mut kept = Kept::read();
    for (n, name, height, cases) in SETS {
        let stl = dir.join(format!("dome-{name}.stl"));
        if !stl.exists() {
            write_stl(&stl, &mesh(n, [0.0, 0.0, 450.0, 450.0], |x, y| height * dome(x, y)));
        }
        let (mut floor_s, mut bare_mb) = (0.0, 0.0);
        for case in ["floor", "load"].iter().chain(cases) {
            // To delete a folder of thousands of files takes longer than to write one, by a time that is up to the disk.
            let _ = std::fs::remove_dir_all(stl.with_extension(format!("{case}.job")));
            let me = std::env::current_exe().expect("this program");
            let out = Command::new(me).arg(case).arg(&stl).output().expect("this program starts");
            assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
            let text = String::from_utf8(out.stdout).expect("text");
            let ([user_s, wall_s, peak_mb, units], note) = columns(&text);
            match *case {
                "floor" => floor_s = user_s,
                "load" => bare_mb = peak_mb,
                _ => {}
            }
            let ratio = user_s / floor_s;
            // What the mesh takes is no unit's.
            let bytes = (peak_mb - bare_mb) * 1024.0 * 1024.0 / units;
            let bytes = if units > 0.0 && bare_mb > 0.0 { format!("{bytes:.0}") } else { String::new() };
            let case = format!("{name} triangles, {case}");
            println!("{case:<38} {user_s:>9.2} {ratio:>9.2} {wall_s:>9.2} {peak_mb:>9.0} {bytes:>9}  {note}");
            kept.add(&case, ratio, peak_mb);
        }
    }
    kept.tell();
}

/// Cases of every size.
const OF_SIZES: [&str; 12] = [
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
    "verify, two threads",
    "flush",
];

/// Cases with very many of one thing, and the comparison of all systems on a hood.
const OF_COUNTS: [&str; 4] = ["stops", "fragments", "dots, 10 million", "compare, two threads"];

/// Squares of facets along a side, name, height by that of the dome, and cases of each mesh.
const SETS: [(usize, &str, f64, &[&str]); 4] = [
    (500, "0.5M", 1.0, &OF_SIZES),
    (1000, "2M", 1.0, &OF_SIZES),
    (2000, "8M", 1.0, &OF_SIZES),
    (250, "0.125M", 2.4, &OF_COUNTS),
];

/// The four figures of a case (CPU seconds, seconds, MB, units), and what is noted of it.
fn columns(line: &str) -> ([f64; 4], &str) {
    let mut rest = line.trim();
    let mut next = || {
        let (word, more) = rest.split_once(char::is_whitespace).unwrap_or((rest, ""));
        rest = more.trim_start();
        word.parse().expect("a number")
    };
    ([next(), next(), next(), next()], rest)
}

/// Runs one case and prints what it took.
fn run(case: &str, stl: &Path) {
    let (case, threads) = case.strip_suffix(", two threads").map_or((case, 1), |case| (case, 2));
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
    let start = Instant::now();
    let (units, note) = pool.install(|| match case {
        "floor" => (0, format!("{} pieces", floor::job(stl, 0.1))),
        "load" => (0, format!("{} facets", load(stl).facet_count())),
        "walk" => (0, walk(&load(stl))),
        "verify" => {
            let proof =
                terrace_verify::verify(&stl.with_extension("contour.job"), None).unwrap_or_else(|e| panic!("{e}"));
            assert!(proof.ok, "{}", proof.to_text());
            (proof.fragments, format!("{} fragments proved", proof.fragments))
        }
        "compare" => (0, compare_hood()),
        method => job(method, stl),
    });
    println!("{:>9.2} {:>9.2} {:>9.1} {units:>9}  {note}", user_s(), start.elapsed().as_secs_f64(), peak_mb());
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

/// Compares all systems on the hood of the README.
fn compare_hood() -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/hood.toml");
    let job = Job::load(&path, &Overrides::default()).unwrap_or_else(|e| panic!("{e}"));
    let untold = compare::Progress { begins: &|_| {}, percent: &|_| {} };
    let found =
        compare::compare(&job, &compare::SYSTEMS, Protection::Saturate, None, untold).unwrap_or_else(|e| panic!("{e}"));
    format!("{} systems", found.rows.len())
}

/// Compiles to a folder on disk; of very many units they are planned and ordered alone. Answers with the number of
/// units.
fn job(case: &str, stl: &Path) -> (usize, String) {
    let (method, texture) = match case {
        "stops" => ("z-range", "pattern = \"hatch\"\npitch = \"5 mm\""),
        "fragments" => ("z-range", "pattern = \"hatch\"\npitch = \"0.01 mm\""),
        "dots, 10 million" => ("z-range", "pattern = \"dots\"\npitch = \"0.142 mm\""),
        "flush" => ("z-range", "pattern = \"hatch\"\npitch = \"1 mm\""),
        "squares" => ("z-range", "pattern = \"squares\"\npitch = \"1 mm\"\ncell = \"0.6 mm\""),
        "dots" => ("z-range", "pattern = \"dots\"\npitch = \"0.45 mm\"\njitter = \"50 %\""),
        "poisson" => ("z-range", "pattern = \"poisson\"\npitch = \"0.4 mm\""),
        method => (method, "pattern = \"hatch\"\npitch = \"0.1 mm\""),
    };
    let pdof = match case {
        "stops" => "0.0022 mm",
        _ => "0.07 mm",
    };
    let name = stl.file_name().and_then(|n| n.to_str()).expect("a name");
    let text = format!(
        "[surface]\nfile = {name:?}\nunit = \"mm\"\n[[texture]]\n{texture}\n[focus]\npdof = {pdof:?}\n[partition]\n\
         method = \"{method}\"\n[machine]\nprofile = \"xyz-galvo-40\"\n[[pen]]\nname = \"a\"\nspeed = \"1000 mm/s\"\n\
         power = \"60 %\"\nfrequency = \"60 kHz\"\ndwell = \"1 ms\"\n"
    );
    let path = stl.with_extension(format!("{case}.toml"));
    std::fs::write(&path, &text).expect("a writable folder");
    let job = Job::parse(&path, &text, &Overrides::default()).unwrap_or_else(|e| panic!("{e}"));
    let begin = Instant::now();
    let plan = plan::plan(job, &|_, _| {}).unwrap_or_else(|e| panic!("{e}"));
    let (s, planned) = (&plan.stepped().expect("a stepped job").summary, begin.elapsed().as_secs_f64());
    let units = match case {
        "stops" => s.stops,
        "dots" | "dots, 10 million" | "poisson" => s.dots.marked as usize,
        _ => s.fragments,
    };
    if let "dots" | "poisson" | "dots, 10 million" | "stops" | "fragments" = case {
        let (stops, rate) = (s.stops, units as f64 / planned);
        return (units, format!("{units} units in {stops} stops, {rate:.0} units a second"));
    }
    let write = |durability| {
        let begin = Instant::now();
        let target = stl.with_extension(format!("{case}.job"));
        job_folder::write_with(&plan, &target, durability, &|_, _| {}).unwrap_or_else(|e| panic!("{e}"));
        begin.elapsed().as_secs_f64()
    };
    let written = write(Durability::Unsynced);
    if case == "flush" {
        let flushed = write(Durability::Synced);
        return (units, format!("written in {written:.2} s, and flushed to disk in {flushed:.2} s"));
    }
    let per_figure = s.jump_mm / s.fragments.max(1) as f64;
    (units, format!("{} stops, {} fragments, jumps {per_figure:.3} mm each", s.stops, s.fragments))
}
