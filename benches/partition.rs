//! Stops of `window` and their lower bound on the surfaces of the counts: `make bench` prints the table.

use terrace::partition::items::Item;
use terrace::partition::window;

fn main() {
    let args: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    for s in SURFACES.iter().filter(|s| args.is_empty() || args.iter().any(|a| a == s.0)) {
        let start = cpu_s();
        let items = if std::env::var("TALL").is_ok() { squares(s.1) } else { items(s.1) };
        let made = cpu_s();
        let corners = window::cover(&items, [40_000_000, 40_000_000, 70_000], [100; 3]);
        println!(
            "{} items {} {:.2} s: {} stops, {:.2} s, {:.0} MB",
            s.0,
            items.len(),
            made - start,
            corners.len(),
            cpu_s() - made,
            peak_mb()
        );
    }
}

type Surface = fn(f64, f64) -> f64;
const SURFACES: [(&str, Surface); 5] =
    [("dome", dome), ("saddle", saddle), ("cyl", cyl), ("wave", wave), ("wing", wing)];

fn dome(x: f64, y: f64) -> f64 {
    let (u, v) = ((x - 225.0) / 225.0, (y - 225.0) / 225.0);
    10.043874448175666 * (1.0 - (u * u + v * v) / 2.0)
}
fn saddle(x: f64, y: f64) -> f64 {
    let (u, v) = ((x - 225.0) / 225.0, (y - 225.0) / 225.0);
    10.023601109413828 * (u * u - v * v) / 2.0
}
fn cyl(x: f64, _: f64) -> f64 {
    let u = (x - 225.0) / 225.0;
    10.06464501554584 * (1.0 - u * u)
}
fn wave(x: f64, y: f64) -> f64 {
    use std::f64::consts::TAU;
    5.119498597136223 / 2.0 * (TAU * x / 300.0 + 0.4).sin() * (TAU * y / 260.0).cos()
}
fn wing(x: f64, y: f64) -> f64 {
    let u = x / 450.0;
    25.672613179115896
        * (0.9 * (u.max(0.0) + 0.02).sqrt() - 0.75 * u - 0.35 * u * u
            + 0.25 * (y / 450.0) * u
            + 0.12 * (std::f64::consts::PI * y / 450.0).sin())
}

/// Half-millimetre hatch along x, cut into cells of 0.5 mm and slabs of D / 7.
fn items(z: Surface) -> Vec<Item> {
    let slab = 10_000.0;
    let mut out = Vec::new();
    for row in 0..=900 {
        let y = f64::from(row) * 0.5;
        let at = |x: f64| z(x, y) * 1e6;
        for column in 0..900 {
            let (mut x0, x1) = (f64::from(column) * 0.5, f64::from(column + 1) * 0.5);
            let (mut z0, z1) = (at(x0), at(x1));
            loop {
                let up = z1 > z0;
                let cut = if up { (z0 / slab + 1e-9).floor() + 1.0 } else { (z0 / slab - 1e-9).ceil() - 1.0 } * slab;
                let within = if up { cut < z1 } else { cut > z1 };
                let (x, end) = if within { (crossing(at, x0, x1, cut), cut) } else { (x1, z1) };
                let nm = |v: f64| v.round() as i32;
                out.push(Item {
                    lo: [nm(x0 * 1e6), nm(y * 1e6), nm(z0.min(end))],
                    hi: [nm(x * 1e6), nm(y * 1e6), nm(z0.max(end))],
                });
                if !within {
                    break;
                }
                (x0, z0) = (x, end);
            }
        }
    }
    out
}

/// Squares of 1 mm at a pitch of 1.5 mm, those that are not taller than D.
fn squares(z: Surface) -> Vec<Item> {
    let mut out = Vec::new();
    for (i, j) in (0..90_000).map(|n| (n % 300, n / 300)) {
        let (x, y) = (f64::from(i) * 1.5, f64::from(j) * 1.5);
        let (mut lo, mut hi) = (f64::INFINITY, f64::NEG_INFINITY);
        for t in (0..=40).map(|k| f64::from(k) / 40.0) {
            for (a, b) in [(t, 0.0), (t, 1.0), (0.0, t), (1.0, t)] {
                let h = z(x + a, y + b) * 1e6;
                (lo, hi) = (lo.min(h), hi.max(h));
            }
        }
        let nm = |v: f64| v.round() as i32;
        let item = Item {
            lo: [nm(x * 1e6), nm(y * 1e6), nm(lo)],
            hi: [nm(x * 1e6) + 1_000_000, nm(y * 1e6) + 1_000_000, nm(hi)],
        };
        if item.hi[2] - item.lo[2] <= 69_900 {
            out.push(item);
        }
    }
    out
}

fn crossing(at: impl Fn(f64) -> f64, mut a: f64, mut b: f64, z: f64) -> f64 {
    let up = at(b) > at(a);
    for _ in 0..40 {
        let m = 0.5 * (a + b);
        if (at(m) < z) == up { a = m } else { b = m }
    }
    a
}

/// CPU seconds of this process so far.
fn cpu_s() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").expect("Linux");
    let fields: Vec<&str> = stat.rsplit(')').next().expect("fields").split_whitespace().collect();
    // utime and stime, in ticks of 10 ms.
    fields[11..13].iter().map(|f| f.parse::<f64>().expect("ticks") / 100.0).sum()
}

/// Peak resident memory, MB.
fn peak_mb() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").expect("Linux");
    let line = status.lines().find(|l| l.starts_with("VmHWM")).expect("a peak");
    let kb: f64 = line.split_whitespace().nth(1).and_then(|w| w.parse().ok()).expect("kB");
    kb / 1024.0
}
