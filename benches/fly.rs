//! How fast a path is timed under the limits of seven axes together, and how the time converges when cells are
//! halved: `cargo bench --bench fly` prints the table.
//!
//! The path is made: steps of 0.1 mm, 20 m without jerk limits and 0.5 m with them, which cost far more; five slow axes that swing over decimetres and a fast pair that
//! swings by millimetres. Smooth: one run. Cornered: stops every 4 mm. Short: stops every 0.2 mm.

use terrace::fly::pace::{Limit, Options, Path, time_optimal};

const STEP: f64 = 0.1;

fn main() {
    let stage = Limit { speed: 200.0, acceleration: 2000.0, jerk: Some(40_000.0) };
    let turn = Limit { speed: 6.0, acceleration: 40.0, jerk: Some(1000.0) };
    let galvo = Limit { speed: 1000.0, acceleration: 20_000.0, jerk: Some(2e7) };
    let limits = [stage, stage, stage, turn, turn, galvo, galvo];
    let free = limits.map(|l| Limit { jerk: None, ..l });
    let head = ["path", "nodes", "cells", "time s", "no jerk s", "steps", "worst", "stretch", "cpu s", "cells/s"];
    println!("{}", head.map(|h| format!("{h:>10}")).join(""));
    for (name, every, nodes, limits) in [
        ("no jerk", 0, 200_000, &free),
        ("smooth", 0, 5_000, &limits),
        ("cornered", 40, 5_000, &limits),
        ("short", 2, 5_000, &limits),
    ] {
        row(name, every, nodes, 1, limits);
    }
    for refine in [1, 2, 4, 8] {
        row(&format!("x{refine}"), 0, 500, refine, &limits);
    }
    for refine in [1, 2, 4, 8] {
        row(&format!("short x{refine}"), 2, 500, refine, &limits);
    }
}

/// Times one path and prints what came of it.
fn row(name: &str, every: usize, nodes: usize, refine: usize, limits: &[Limit]) {
    let s: Vec<f64> = (0..nodes).map(|i| STEP * i as f64).collect();
    let positions: Vec<f64> = s.iter().flat_map(|&s| axes(s)).collect();
    let caps = vec![500.0; nodes - 1];
    let stops: Vec<usize> = if every == 0 { Vec::new() } else { (0..nodes).step_by(every).collect() };
    let path = Path { positions: &positions, s: &s, caps: &caps, stops: &stops };
    let start = cpu_s();
    let timed = time_optimal(&path, limits, &Options { refine, ..Options::default() }).expect("a sound path");
    let cpu = (cpu_s() - start).max(0.01);
    let r = timed.report();
    let worst = r.ratio.speed.max(r.ratio.acceleration).max(r.ratio.jerk);
    println!(
        "{name:>10}{nodes:>10}{:>10}{:>10.3}{:>10.3}{:>10}{worst:>10.5}{:>10.5}{cpu:>10.2}{:>10.0}",
        r.cells,
        r.total_s,
        r.without_jerk_s,
        r.steps,
        r.stretch,
        r.cells as f64 / cpu
    );
}

/// The axes at s.
fn axes(s: f64) -> [f64; 7] {
    [
        100.0 * (s / 130.0).sin() + 4.0 * (s / 11.0).cos(),
        90.0 * (s / 110.0).cos() + 3.0 * (s / 9.0).sin(),
        10.0 * (s / 60.0).sin(),
        0.3 * (s / 90.0).sin() + 0.01 * (s / 7.0).cos(),
        0.5 * (s / 150.0).cos() + 0.01 * (s / 5.0).sin(),
        1.5 * (s / 1.7).sin() + 0.1 * (s / 0.6).cos(),
        1.5 * (s / 1.9).cos() + 0.1 * (s / 0.7).sin(),
    ]
}

/// CPU seconds of this process so far.
fn cpu_s() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").expect("Linux");
    let fields: Vec<&str> = stat.rsplit(')').next().expect("fields").split_whitespace().collect();
    // utime and stime, in ticks of 10 ms.
    fields[11..13].iter().map(|f| f.parse::<f64>().expect("ticks") / 100.0).sum()
}
