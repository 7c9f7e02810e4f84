//! How few stops `window` finds, how many there are at least, and what both cost, on the five surfaces
//! of the counts: `make bench` prints the table.
//!
//! Every case runs in a process of its own, on one thread, and reports CPU seconds (user and system) and
//! peak memory, as the kernel counts them. Cells are what the compiler sees of a 0.5 mm hatch; lines are
//! its exact pieces; squares are figures of 1 mm at a pitch of 1.5 mm that stay whole.

#[path = "../tests/it/support/surfaces.rs"]
mod surfaces;

#[path = "support/cpu.rs"]
mod cpu;
#[path = "support/memory.rs"]
mod memory;

use cpu::user_s;
use memory::peak_mb;
use std::process::Command;

use surfaces::FIVE;
use terrace_plan::partition::bound::{Certificate, lower_bound, lower_bound_whole, row_heights};
use terrace_plan::partition::box_index::Item;
use terrace_plan::partition::window;

const MM: f64 = 1e6;
const SIZE: [i32; 3] = [40_000_000, 40_000_000, 70_000];
const STEP: [i32; 3] = [100; 3];
/// Width of a cell and distance of the lines, mm, and height of a slab, nm: a seventh of the depth range, on
/// the lattice.
const CELL: [f64; 2] = [0.5, 10_000.0];
/// The same for four times as few cells, and for four times as many.
const COARSE: [f64; 2] = [1.0, 20_000.0];
const FINE: [f64; 2] = [0.25, 5_000.0];

type Surface = fn(f64, f64) -> f64;

fn main() {
    let args: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    if let [case, name] = &args[..] {
        let surface = FIVE.iter().find(|s| s.0 == name).expect("one of the five").1;
        return run(case, surface);
    }
    let head = ["case", "pieces", "stops", "at least", "ratio", "cover s", "bound s", "peak MB"];
    println!("{}", head.map(|h| format!("{h:>9}")).join(""));
    let scales = ["coarse", "cells", "fine"].map(|case| (case, &FIVE[..1]));
    for (case, surfaces) in scales.into_iter().chain(["cells", "lines", "squares"].map(|case| (case, &FIVE[..]))) {
        for (name, _) in surfaces {
            let me = std::env::current_exe().expect("this program");
            let out = Command::new(me).args([case, name]).output().expect("this program starts");
            assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
            print!("{case:>8} {name:<8}{}", String::from_utf8_lossy(&out.stdout));
        }
    }
}

/// Runs one case and prints its row.
fn run(case: &str, z: Surface) {
    let z = |x: f64, y: f64| z(x, y) * MM;
    let items = match case {
        "squares" => squares(z),
        "lines" => lines(z, CELL),
        "coarse" => cells(&lines(z, COARSE), COARSE),
        "fine" => cells(&lines(z, FINE), FINE),
        _ => cells(&lines(z, CELL), CELL),
    };
    let start = user_s();
    let corners = window::cover(&items, SIZE, STEP);
    let covered = user_s();
    let (certificate, seconds) = bound(case, z, &items);
    assert!(certificate.check(), "a sound certificate");
    let (stops, least) = (corners.len(), certificate.stops());
    println!(
        "{:>9}{stops:>9}{least:>9}{:>9.3}{:>9.2}{seconds:>9.2}{:>9.0}",
        items.len(),
        stops as f64 / least as f64,
        covered - start,
        peak_mb()
    );
}

fn bound(case: &str, z: impl Fn(f64, f64) -> f64, items: &[Item]) -> (Certificate, f64) {
    if case == "squares" {
        let start = user_s();
        return (lower_bound_whole(items, SIZE), user_s() - start);
    }
    let mut points: Vec<[i32; 3]> = Vec::new();
    for (y, x0, x1) in pieces(CELL[0]) {
        let (z0, z1) = (z(x0, y), z(x1, y));
        let heights = row_heights(SIZE[2], z0.min(z1).ceil() as i32, z0.max(z1).floor() as i32);
        for x in heights.map(|h| crossing(|x| z(x, y), x0, x1, f64::from(h))) {
            points.push([x * MM, y * MM, z(x, y)].map(|v| v.round() as i32));
        }
    }
    let start = user_s();
    (lower_bound(&points, SIZE), user_s() - start)
}

/// Lines along x, cut into cells: y and the ends along x, mm.
fn pieces(cell: f64) -> impl Iterator<Item = (f64, f64, f64)> {
    let at = move |n: i32| f64::from(n) * cell;
    let count = (450.0 / cell) as i32;
    (0..=count).flat_map(move |row| (0..count).map(move |column| (at(row), at(column), at(column + 1))))
}

/// Pieces of lines, cut into slabs.
fn lines(z: impl Fn(f64, f64) -> f64, [cell, slab]: [f64; 2]) -> Vec<Item> {
    let mut out = Vec::new();
    for (y, mut x0, x1) in pieces(cell) {
        let at = |x: f64| z(x, y);
        let (mut z0, z1) = (at(x0), at(x1));
        loop {
            let up = z1 > z0;
            let cut = if up { (z0 / slab + 1e-9).floor() + 1.0 } else { (z0 / slab - 1e-9).ceil() - 1.0 } * slab;
            let is_within = if up { cut < z1 } else { cut > z1 };
            let (x, end) = if is_within { (crossing(at, x0, x1, cut), cut) } else { (x1, z1) };
            let nm = |v: f64| v.round() as i32;
            out.push(Item {
                lo: [nm(x0 * MM), nm(y * MM), nm(z0.min(end))],
                hi: [nm(x * MM), nm(y * MM), nm(z0.max(end))],
            });
            if !is_within {
                break;
            }
            (x0, z0) = (x, end);
        }
    }
    out
}

/// Where the height is `z`, between a and b.
fn crossing(at: impl Fn(f64) -> f64, mut a: f64, mut b: f64, z: f64) -> f64 {
    let up = at(b) > at(a);
    for _ in 0..40 {
        let m = 0.5 * (a + b);
        if (at(m) < z) == up { a = m } else { b = m }
    }
    a
}

/// Full cells and slabs around pieces of lines.
fn cells(lines: &[Item], [cell, slab]: [f64; 2]) -> Vec<Item> {
    let full = |i: &Item| {
        let size = [cell * MM, cell * MM, slab];
        let lo = [0, 1, 2].map(|k| (f64::from(i.lo[k] + i.hi[k]) / 2.0 / size[k]).floor() as i32 * size[k] as i32);
        Item { lo, hi: [0, 1, 2].map(|k| lo[k] + size[k] as i32) }
    };
    lines.iter().map(full).collect()
}

/// Squares, those that a stop holds from a place on the lattice.
fn squares(z: impl Fn(f64, f64) -> f64) -> Vec<Item> {
    let mut out = Vec::new();
    for (i, j) in (0..300).flat_map(|j| (0..300).map(move |i| (i, j))) {
        let (x, y) = (f64::from(i) * 1.5, f64::from(j) * 1.5);
        let sides = (0..=40).map(|k| f64::from(k) / 40.0).flat_map(|t| [[t, 0.0], [t, 1.0], [0.0, t], [1.0, t]]);
        let heights = sides.map(|[a, b]| z(x + a, y + b).round() as i32);
        let (lo, hi) = heights.fold((i32::MAX, i32::MIN), |(lo, hi), h| (lo.min(h), hi.max(h)));
        let corner = [x, y].map(|v| (v * MM).round() as i32);
        if lo.div_euclid(STEP[2]) * STEP[2] + SIZE[2] >= hi {
            let hi = [corner[0] + 1_000_000, corner[1] + 1_000_000, hi];
            out.push(Item { lo: [corner[0], corner[1], lo], hi });
        }
    }
    out
}
