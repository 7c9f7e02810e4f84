//! Units on a fleet beside a batch on this machine, and what a job takes of a machine: `cargo bench --bench fleet`
//! prints three tables. Needs Dask, which `make setup` installs.
//!
//! Paired: 200 jobs whose marks differ by a factor of a hundred, six of them broken, by `terrace batch -j2` and by two
//! workers of one thread each, one after the other in one run; again with nothing changed, and with three changed.
//! Grouped: 2,000 units of some 50 ms, against their own time divided by two. Sizes: one hatch on one surface with ever
//! more marks; time, peak memory and disk of the folder.

#[path = "../tests/it/support/fleet.rs"]
#[allow(dead_code, reason = "the tests use the rest")]
mod fleet;

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::time::Instant;
use terrace_core::math;

use fleet::Fleet;
use serde_json::Value;

/// What the fleet's helper takes its folders from.
fn folder() -> tempfile::TempDir {
    tempfile::tempdir().expect("a writable temporary folder")
}

fn main() {
    let dir = folder();
    let fleet = Fleet::of(2);
    paired(&fleet, dir.path());
    grouped(&fleet, dir.path());
    drop(fleet);
    sizes(dir.path());
}

fn path(path: &Path) -> &str {
    path.to_str().expect("UTF-8")
}

/// A wavy slope of 60 x 60 mm and this height, of `n` x `n` fields, as binary STL.
fn surface(file: &Path, n: usize, height_mm: f32) {
    let at = |i: usize, j: usize| {
        let [x, y] = [i, j].map(|k| 60.0 * k as f32 / n as f32);
        [x, y, height_mm * (x / 60.0 + math::sin(f64::from(y) / 9.0) as f32 / 6.0)]
    };
    let mut bytes = vec![0; 80];
    bytes.extend((2 * n as u32 * n as u32).to_le_bytes());
    for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        for facet in [[a, b, c], [a, c, d]] {
            bytes.extend([0; 12]);
            facet.iter().flatten().for_each(|v| bytes.extend(v.to_le_bytes()));
            bytes.extend([0; 2]);
        }
    }
    std::fs::write(file, bytes).expect("written");
}

fn job(file: &Path, pitch_mm: f64, turn_deg: usize) {
    let text = format!(
        "[surface]\nfile = \"wave.stl\"\nunit = \"mm\"\n\n[[texture]]\npattern = \"hatch\"\npitch = \"{pitch_mm:.4} mm\"\n\
         direction = \"{turn_deg} deg\"\n\n[focus]\npdof = \"0.07 mm\"\n\n[partition]\nmethod = \"contour\"\n\n\
         [machine]\nprofile = \"xyz-galvo-40\"\n\n[[pen]]\nname = \"fill\"\nspeed = \"1000 mm/s\"\npower = \"60 %\"\n\
         frequency = \"60 kHz\"\n\n[emit]\nformats = [\"linuxcnc\", \"ovf\"]\n\n\
         [limits]\nimplausible = \"allow\"\n"
    );
    std::fs::write(file, text).expect("written");
}

/// A command, how long it took, s, and its report.
fn timed(command: &mut Command) -> (f64, Output) {
    let begin = Instant::now();
    let out = command.output().expect("it runs");
    (begin.elapsed().as_secs_f64(), out)
}

fn local(jobs: &Path, out: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_terrace"));
    command.args(["batch", path(jobs), "-o", path(out), "--json", "-q", "-j2", "--no-sync"]);
    command
}

fn carried(fleet: &Fleet, jobs: &Path, out: &Path, plan: &Path) -> Command {
    fleet.terrace(["batch", path(jobs), "-o", path(out), "--json", "--plan", path(plan)])
}

fn count(out: &Output, state: &str) -> u64 {
    let report: Value =
        serde_json::from_slice(&out.stdout).unwrap_or_else(|e| panic!("{e}: {}", String::from_utf8_lossy(&out.stderr)));
    report[state].as_u64().expect("a number")
}

/// How many groups the engine was given.
fn groups(out: &Output) -> usize {
    let text = String::from_utf8_lossy(&out.stderr).into_owned();
    let line = text.lines().find(|line| line.contains(" groups for "));
    line.map_or(0, |line| line.split(' ').nth(3).and_then(|n| n.parse().ok()).expect("a number"))
}

/// Seconds that the units of a plan took in their processes, together.
fn worked(plan: &Path) -> f64 {
    let files = std::fs::read_dir(plan.with_extension("reports")).expect("reports").flatten();
    let seconds = files.filter_map(|file| {
        let report: Value = serde_json::from_slice(&std::fs::read(file.path()).ok()?).ok()?;
        report["seconds"].as_f64()
    });
    seconds.sum()
}

fn paired(fleet: &Fleet, dir: &Path) {
    let jobs = dir.join("jobs");
    std::fs::create_dir(&jobs).expect("made");
    surface(&jobs.join("wave.stl"), 40, 6.0);
    let file = |i: usize| jobs.join(format!("t{i:03}.toml"));
    for i in 0..200 {
        job(&file(i), 6.0 / (1 + (i * 37) % 100) as f64, i % 180);
    }
    for i in [7, 33, 71, 120, 163, 199] {
        std::fs::write(file(i), "[surface]\nfile = 7\n").expect("written");
    }
    let [here, there, plan] = ["here", "there", "paired.jsonl"].map(|name| dir.join(name));
    println!("200 jobs whose marks differ by 100, six of them broken; two cores");
    let row = |what: &str, seconds: f64, more: &str| println!("{what:<44}{seconds:>9.2} s  {more}");
    let (batch_s, out) = timed(&mut local(&jobs, &here));
    row("terrace batch -j2", batch_s, &format!("{} compiled", count(&out, "compiled")));
    let (fleet_s, out) = timed(&mut carried(fleet, &jobs, &there, &plan));
    let more = format!("{} compiled, x {:.3}, {} groups", count(&out, "compiled"), fleet_s / batch_s, groups(&out));
    row("two workers", fleet_s, &more);
    let ms = 1e3 * (2.0 * fleet_s - worked(&plan)) / 200.0;
    println!("{:<44}{ms:>9.1} ms", "overhead of a unit on one of two slots");
    let same = Command::new("diff").arg("-r").args([&here, &there]).status().expect("diff starts").success();
    println!("{:<44}{:>11}", "same bytes", if same { "yes" } else { "NO" });
    let (s, out) = timed(&mut carried(fleet, &jobs, &there, &plan));
    row("again, nothing changed but the broken ones", s, &format!("{} unchanged", count(&out, "unchanged")));
    for i in [3, 90, 150] {
        let text = std::fs::read_to_string(file(i)).expect("readable");
        std::fs::write(file(i), text + "# changed\n").expect("written");
    }
    let (s, out) = timed(&mut carried(fleet, &jobs, &there, &plan));
    row("again, three changed", s, &format!("{} compiled", count(&out, "compiled")));
    println!();
}

fn grouped(fleet: &Fleet, dir: &Path) {
    let jobs = dir.join("small");
    std::fs::create_dir(&jobs).expect("made");
    surface(&jobs.join("wave.stl"), 20, 0.5);
    for i in 0..2000 {
        job(&jobs.join(format!("s{i:04}.toml")), 3.0, i % 180);
    }
    let [out, plan] = ["small.out", "small.jsonl"].map(|name| dir.join(name));
    let (s, done) = timed(&mut carried(fleet, &jobs, &out, &plan));
    let alone = worked(&plan);
    let unit_ms = 1e3 * alone / 2000.0;
    println!("2,000 units of {unit_ms:.0} ms in {} groups on two workers: {s:.1} s", groups(&done));
    println!(
        "share of the ideal throughput: {:.0} % ({} compiled)\n",
        100.0 * alone / 2.0 / s,
        count(&done, "compiled")
    );
}

fn sizes(dir: &Path) {
    let jobs = dir.join("sizes");
    std::fs::create_dir(&jobs).expect("made");
    surface(&jobs.join("wave.stl"), 300, 6.0);
    println!("One job on one core, 180,000 facets");
    println!("{}", ["pitch mm", "fragments", "time s", "memory MB", "folder MB"].map(|h| format!("{h:>12}")).join(""));
    let mut measured = Vec::new();
    for pitch in [0.1, 0.01, 0.001] {
        let (file, out) = (jobs.join("size.toml"), jobs.join("size.job"));
        job(&file, pitch, 30);
        let mut command = Command::new(env!("CARGO_BIN_EXE_terrace"));
        command.args(["compile", path(&file), "-o", path(&out), "--json", "-q", "-j1", "--no-sync"]);
        let (s, done, peak) = watched(&mut command);
        let summary: Value = serde_json::from_slice(&done.stdout).expect("a summary");
        let mut line = String::new();
        let _ = write!(line, "{pitch:>12}{:>12}{s:>12.2}", summary["fragments"]);
        let disk = size(&out) as f64;
        println!("{line}{:>12}{:>12.1}", peak >> 20, disk / 1e6);
        let fragments = summary["fragments"].as_f64().expect("a number");
        measured.push(Size { fragments, hours: s / 3600.0, memory: peak as f64, disk });
    }
    sizing(&measured);
}

/// What one job takes.
#[derive(Clone, Copy)]
struct Size {
    fragments: f64,
    hours: f64,
    memory: f64,
    disk: f64,
}

/// What work takes of a fleet, from the jobs that were measured; time, memory and disk grow with the fragments.
fn sizing(measured: &[Size]) {
    println!("\nSizing, by these figures; memory is that of one unit at a time on each core");
    let head = ["work", "core hours", "4 x 16 cores, h", "memory GB", "disk GB"];
    println!("{:<44}{}", head[0], head[1..].iter().map(|h| format!("{h:>17}")).collect::<String>());
    // A job alone has one core.
    let row = |what: &str, jobs: f64, one: Size| {
        let hours = jobs * one.hours;
        let memory = one.memory / 1e9;
        println!(
            "{what:<44}{hours:>17.1}{:>17.2}{memory:>17.2}{:>17.0}",
            hours / jobs.min(64.0),
            jobs * one.disk / 1e9
        );
    };
    let [small, medium, large] = measured else { panic!("three sizes") };
    for one in [small, medium, large] {
        row(&format!("1,000 parts x 100 variants of {:.0} fragments", one.fragments), 1e5, *one);
    }
    for all in [1e8_f64, 1e9] {
        row(&format!("10^{:.0} fragments, in such largest jobs", math::log10(all)), all / large.fragments, *large);
    }
    let times = 1e8 / large.fragments;
    // Of 10^9 all figures are ten times these.
    let grown = Size { hours: large.hours * times, memory: large.memory * times, disk: large.disk * times, ..*large };
    row("10^8 fragments in one job, on one core", 1.0, grown);
}

/// A command, its time and its peak of memory, bytes, as the system counts it.
fn watched(command: &mut Command) -> (f64, Output, u64) {
    use std::process::Stdio;
    let begin = Instant::now();
    let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("it runs");
    let status = PathBuf::from(format!("/proc/{}/status", child.id()));
    let watch = std::thread::spawn(move || {
        let mut peak = 0;
        // The file of a process that has ended has no such line.
        while let Some(kb) = std::fs::read_to_string(&status).ok().and_then(|text| {
            text.lines().find_map(|l| l.strip_prefix("VmHWM:")?.split_whitespace().next()?.parse::<u64>().ok())
        }) {
            peak = peak.max(kb << 10);
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
        peak
    });
    let out = child.wait_with_output().expect("ended");
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    (begin.elapsed().as_secs_f64(), out, watch.join().expect("watched"))
}

/// Bytes of the files below a folder.
fn size(folder: &Path) -> u64 {
    let entries = std::fs::read_dir(folder).expect("readable").flatten();
    entries.map(|e| if e.path().is_dir() { size(&e.path()) } else { e.metadata().map_or(0, |m| m.len()) }).sum()
}
