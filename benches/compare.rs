//! How long `terrace compare` takes with all systems on two threads, and how the time of seven axes converges: `cargo
//! bench --bench compare` prints the table. One thread must make the same figures.

use std::path::Path;
use std::process::Command;
use std::time::Instant;

fn main() {
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures");
    println!("{:<34}{:>9}{:>9}  least time of 20 m beside the finest grid", "case", "wall s", "CPU s");
    row("dome, hatch of 1 mm", &fixtures.join("sources/cao/lines.toml"));
    row("250 mm of a hood, leather", &fixtures.join("hood.toml"));
}

/// Compares on two threads and on one, and prints what it took.
fn row(name: &str, job: &Path) {
    let (first, wall, cpu) = compared(job, "2");
    let (again, ..) = compared(job, "1");
    let json: serde_json::Value = serde_json::from_slice(&first).expect("JSON");
    let grids = json["convergence"].as_array().map(Vec::as_slice).unwrap_or_default();
    let off: Vec<String> =
        grids.iter().filter_map(|g| g["above_the_finest_percent"].as_f64()).map(|p| format!("{p:.2} %")).collect();
    assert!(first == again, "{name}: one and two threads must make the same figures");
    println!("{name:<34}{wall:>9.1}{cpu:>9.1}  {}", off.join(", "));
}

/// The comparison as JSON, and the seconds that it took, by the clock and of the processor.
fn compared(job: &Path, threads: &str) -> (Vec<u8>, f64, f64) {
    let (begin, before) = (Instant::now(), children_cpu_s());
    let out = Command::new(env!("CARGO_BIN_EXE_terrace"))
        .args(["compare", "--json", "-j", threads])
        .arg(job)
        .output()
        .expect("the program starts");
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    (out.stdout, begin.elapsed().as_secs_f64(), children_cpu_s() - before)
}

/// CPU seconds of the processes that this one has waited for.
fn children_cpu_s() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").expect("Linux");
    let fields: Vec<&str> = stat.rsplit(')').next().expect("fields").split_whitespace().collect();
    // cutime and cstime, in ticks of 10 ms.
    fields[13..15].iter().map(|f| f.parse::<f64>().expect("ticks") / 100.0).sum()
}
