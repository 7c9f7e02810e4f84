//! Points a second of every writer, on one thread, to memory: `make bench` prints the tables.
//!
//! Two jobs of about a million points on the same dome: lines of a hatch, which are strokes of two points, and circles,
//! which are closed polylines. A rate is that of the fastest of several runs over all blocks of the program; stage
//! programs hold no points, so theirs are blocks.

#[path = "../tests/it/support/surfaces.rs"]
mod surfaces;

use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use surfaces::{dome, mesh, write_stl};
use terrace_core::machine::Machine;
use terrace_input::job::{Job, Overrides};
use terrace_plan::emit::{Files, Stepped, TARGETS};
use terrace_plan::plan::{self, SteppedPlan};

/// How long each writer runs again and again; the fastest run counts.
const MEASURED: Duration = Duration::from_secs(1);

fn main() {
    let dir = PathBuf::from(env!("CARGO_TARGET_TMPDIR"));
    let stl = dir.join("dome-emit.stl");
    if !stl.exists() {
        write_stl(&stl, &mesh(300, [0.0, 0.0, 450.0, 450.0], dome));
    }
    std::fs::write(dir.join("emit-cards.toml"), cards()).expect("a writable folder");
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    for (name, texture) in [
        ("hatch", "pattern = \"hatch\"\npitch = \"0.05 mm\""),
        ("circles", "pattern = \"circles\"\npitch = \"2.7 mm\"\ncell = \"1.8 mm\"\ntolerance = \"2 um\""),
    ] {
        pool.install(|| table(name, &planned(&stl, name, texture)));
    }
}

/// The file of a built-in machine with cards of both makers.
fn cards() -> String {
    let (_, profile) =
        terrace_core::machine::PROFILES.iter().find(|(name, _)| *name == "xyz-galvo-40").expect("built in");
    format!(
        "{profile}\n[lmc]\nunits_per_mm = 500.0\nlaser = \"fiber\"\n\n[rtc]\nboard = \"rtc5\"\nbits_per_mm = 15000.0\n"
    )
}

fn planned(stl: &Path, name: &str, texture: &str) -> SteppedPlan {
    let formats: Vec<&str> = TARGETS.iter().filter(|t| t.stepped.is_some()).map(|t| t.name()).collect();
    let surface = stl.file_name().and_then(|n| n.to_str()).expect("a name");
    let text = format!(
        "[surface]\nfile = {surface:?}\nunit = \"mm\"\n[[texture]]\n{texture}\n[focus]\npdof = \"0.2 mm\"\n[partition]\n\
         method = \"z-range\"\nmin_mark = \"10 um\"\n[machine]\nfile = \"emit-cards.toml\"\n[emit]\nformats = {formats:?}\n\
         [[pen]]\nname = \"a\"\nspeed = \"1000 mm/s\"\npower = \"60 %\"\nfrequency = \"60 kHz\"\n"
    );
    let job = Job::parse(&stl.with_extension(format!("{name}.toml")), &text, &Overrides::default());
    let job = job.unwrap_or_else(|e| panic!("{e}"));
    let inputs = plan::Inputs::load(&job).unwrap_or_else(|e| panic!("{e}"));
    plan::stepped(job, inputs).unwrap_or_else(|e| panic!("{e}"))
}

fn table(name: &str, plan: &SteppedPlan) {
    let SteppedPlan { checked, machine, figures, .. } = plan;
    let machine: &Machine = machine;
    let program = checked.program();
    let (points, blocks) = (program.points.len(), program.blocks.len());
    println!("{name}: {points} points, {} strokes, {blocks} blocks", program.strokes.len());
    println!("{:<10} {:>14} {:>12} {:>10}", "writer", "points/s", "blocks/s", "bytes");
    let job =
        Stepped { checked, machine, figures, job: "job.toml", part: "dome.stl", block_file: Some("dxf"), frames: None };
    for target in TARGETS {
        let Some(files) = target.stepped else { continue };
        let write = || match files {
            Files::Whole(_, write) => black_box(write(&job)).len(),
            Files::Blocks(_, write) => (0..blocks).map(|i| black_box(write(&job, i)).len()).sum(),
        };
        let bytes = write();
        let (start, mut best) = (Instant::now(), f64::INFINITY);
        while start.elapsed() < MEASURED {
            let begin = Instant::now();
            write();
            best = best.min(begin.elapsed().as_secs_f64());
        }
        let points = if target.moves_stage { "-".into() } else { format!("{:.1} M", points as f64 / best / 1e6) };
        println!("{:<10} {points:>14} {:>12.0} {bytes:>10}", target.name(), blocks as f64 / best);
    }
}
