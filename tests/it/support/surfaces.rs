//! Made surfaces: closed forms as meshes without regular order.

#![allow(dead_code, reason = "every test and bench uses a part of it")]

use std::path::Path;
use terrace_core::math;

pub use terrace_core::random::Random;

/// The dome of the counts: z = a (1 - (u² + v²) / 2) over [0, 450]², u and v from -1 to 1.
pub fn dome(x: f64, y: f64) -> f64 {
    let (u, v) = ((x - 225.0) / 225.0, (y - 225.0) / 225.0);
    10.043874448175666 * (1.0 - (u * u + v * v) / 2.0)
}

/// A mesh of `2 n²` facets over the box [x0, y0, x1, y1], inner nodes jittered, diagonals at random,
/// facets shuffled and their corners rotated.
pub fn mesh(n: usize, [x0, y0, x1, y1]: [f64; 4], z: impl Fn(f64, f64) -> f64) -> Vec<[[f64; 3]; 3]> {
    let mut noise = Random::new(7);
    let (hx, hy) = ((x1 - x0) / n as f64, (y1 - y0) / n as f64);
    let mut nodes = Vec::with_capacity((n + 1) * (n + 1));
    for j in 0..=n {
        for i in 0..=n {
            let inner = i > 0 && i < n && j > 0 && j < n;
            let (dx, dy) = if inner { (noise.half() * hx * 0.6, noise.half() * hy * 0.6) } else { (0.0, 0.0) };
            let x = if i == n { x1 } else { x0 + i as f64 * hx + dx };
            let y = if j == n { y1 } else { y0 + j as f64 * hy + dy };
            // Files hold f32: take the height at the place that will be read.
            let (x, y) = (f64::from(x as f32), f64::from(y as f32));
            nodes.push([x, y, z(x, y)]);
        }
    }
    let at = |i: usize, j: usize| nodes[j * (n + 1) + i];
    let mut facets = Vec::with_capacity(2 * n * n);
    for j in 0..n {
        for i in 0..n {
            let (a, b, c, d) = (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
            let pair = if noise.bits().is_multiple_of(2) { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] };
            for mut f in pair {
                f.rotate_left((noise.bits() % 3) as usize);
                facets.push(f);
            }
        }
    }
    noise.shuffle(&mut facets);
    facets
}

/// Writes facets as binary STL.
pub fn write_stl(path: &Path, facets: &[[[f64; 3]; 3]]) {
    let mut out = vec![b' '; 80];
    out.extend((facets.len() as u32).to_le_bytes());
    for f in facets {
        out.extend([0; 12]);
        f.iter().flatten().for_each(|&v| out.extend((v as f32).to_le_bytes()));
        out.extend([0; 2]);
    }
    std::fs::write(path, out).expect("a writable folder");
}

/// Height over (x, y), mm.
pub type Height = fn(f64, f64) -> f64;

/// The five surfaces of the counts over [0, 450]², by name; amplitudes are those for which the article's
/// way needs some 3,553 sub-blocks.
pub const FIVE: [(&str, Height); 5] =
    [("dome", dome), ("saddle", saddle), ("cyl", cyl), ("wave", wave), ("wing", wing)];

fn uv(x: f64, y: f64) -> (f64, f64) {
    ((x - 225.0) / 225.0, (y - 225.0) / 225.0)
}

pub fn saddle(x: f64, y: f64) -> f64 {
    let (u, v) = uv(x, y);
    10.023601109413828 * (u * u - v * v) / 2.0
}

pub fn cyl(x: f64, y: f64) -> f64 {
    let (u, _) = uv(x, y);
    10.06464501554584 * (1.0 - u * u)
}

pub fn wave(x: f64, y: f64) -> f64 {
    let turn = std::f64::consts::TAU;
    5.119498597136223 / 2.0 * math::sin(turn * x / 300.0 + 0.4) * math::cos(turn * y / 260.0)
}

pub fn wing(x: f64, y: f64) -> f64 {
    let (s, t) = (x / 450.0, y / 450.0);
    25.672613179115896
        * (0.9 * (s.max(0.0) + 0.02).sqrt() - 0.75 * s - 0.35 * s * s
            + 0.25 * t * s
            + 0.12 * math::sin(std::f64::consts::PI * t))
}
