//! How fast a path is timed under the limits of seven axes together, and how the time converges when cells are halved:
//! `cargo bench --bench on_the_fly` prints the table.
//!
//! The paths are made: 20 m in steps of 0.1 mm, five slow axes that swing over decimetres and a fast pair that
//! swings by millimetres. Smooth: one run. Cornered: stops every 4 mm. Short: stops every 0.2 mm, on 4 m. Dome: 450
//! lines of a hatch on a sphere, of 450 nodes each.

#[path = "support/cpu.rs"]
mod cpu;

use cpu::user_s;
use terrace_core::math;
use terrace_plan::on_the_fly::topp::{Limit, Options, Path, time_optimal};

const STEP: f64 = 0.1;

fn main() {
    let stage = Limit { speed: 200.0, acceleration: 2000.0, jerk: Some(40_000.0) };
    let turn = Limit { speed: 6.0, acceleration: 40.0, jerk: Some(1000.0) };
    let galvo = Limit { speed: 1000.0, acceleration: 20_000.0, jerk: Some(2e7) };
    let limits = [stage, stage, stage, turn, turn, galvo, galvo];
    let free = limits.map(|l| Limit { jerk: None, ..l });
    let head = ["path", "nodes", "cells", "time s", "no jerk s", "steps", "worst", "stretch", "cpu s", "cells/s"];
    println!("{}", head.map(|h| format!("{h:>10}")).join(""));
    row("no jerk", &made(200_000, 0), 1, &free);
    row("cornered", &made(200_000, 40), 1, &limits);
    row("dome", &dome(), 1, &limits);
    for refine in [1, 2, 4] {
        row(&format!("smooth x{refine}"), &made(200_000, 0), refine, &limits);
    }
    for refine in [1, 2, 4] {
        row(&format!("short x{refine}"), &made(40_000, 2), refine, &limits);
    }
}

/// A path of its own.
struct Owned {
    s: Vec<f64>,
    positions: Vec<f64>,
    stops: Vec<usize>,
}

/// Steps along `axes` with a stop after each `every`, or none.
fn made(nodes: usize, every: usize) -> Owned {
    let s: Vec<f64> = (0..nodes).map(|i| STEP * i as f64).collect();
    let positions = s.iter().flat_map(|&s| axes(s)).collect();
    Owned { positions, stops: if every == 0 { Vec::new() } else { (0..nodes).step_by(every).collect() }, s }
}

/// Lines there and back over a sphere of radius 60 mm, with stops at both ends of each.
fn dome() -> Owned {
    let mut out = Owned { s: Vec::new(), positions: Vec::new(), stops: Vec::new() };
    for line in 0..450 {
        let y = -20.0 + 40.0 / 450.0 * f64::from(line) + 0.05;
        for i in 0..450 {
            let along = STEP * f64::from(i) - 22.5;
            let x = if line % 2 == 0 { along } else { -along };
            let (u, v) = (0.8 * math::sin(x / 1.3) + 0.05 * math::sin(x / 0.4), 0.5 * math::cos(x / 1.7 + y));
            let far = math::hypot(x, y);
            let turn = [math::asin(far / 60.0), math::atan2(y.abs().max(2.0), x)];
            out.positions.extend([x - u, y - v, (3600.0 - far * far).sqrt() - 60.0, turn[0], turn[1], u, v]);
            out.s.push(STEP * out.s.len() as f64);
        }
        out.stops.extend([450 * line as usize, 450 * line as usize + 449]);
    }
    out
}

/// Times one path and prints what came of it.
fn row(name: &str, path: &Owned, refine: usize, limits: &[Limit]) {
    let (nodes, caps) = (path.s.len(), vec![500.0; path.s.len() - 1]);
    let path = Path { positions: &path.positions, s: &path.s, caps: &caps, stops: &path.stops };
    let start = user_s();
    let timed = time_optimal(&path, limits, &Options { refine, ..Options::default() }).expect("a sound path");
    let cpu = (user_s() - start).max(0.01);
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
        100.0 * math::sin(s / 130.0) + 4.0 * math::cos(s / 11.0),
        90.0 * math::cos(s / 110.0) + 3.0 * math::sin(s / 9.0),
        10.0 * math::sin(s / 60.0),
        0.3 * math::sin(s / 90.0) + 0.01 * math::cos(s / 7.0),
        0.5 * math::cos(s / 150.0) + 0.01 * math::sin(s / 5.0),
        1.5 * math::sin(s / 1.7) + 0.1 * math::cos(s / 0.6),
        1.5 * math::cos(s / 1.9) + 0.1 * math::sin(s / 0.7),
    ]
}
