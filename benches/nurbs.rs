//! How many heights a second the three algorithms find on one thread: `cargo bench --bench nurbs` prints the table. A
//! control cycle of 8 kHz needs 8000.
//!
//! Places lie on a spiral over the reference surfaces of 30 x 30 control points, algorithm III from the place before,
//! and at even parameters from a linear guess. Worst: the slowest of all heights that are found from a linear guess,
//! each timed over many repetitions.

#[path = "../tests/it/support/nurbs.rs"]
#[allow(dead_code, reason = "the tests use the rest")]
mod nurbs;

use std::hint::black_box;
use std::time::Instant;
use terrace_core::math;

use terrace_compare::nurbs::{Decoupled, HeightGrid, Inversion, Method, Surface};

fn main() {
    println!("{:<10}{:>9}{:>28}{:>14}{:>14}", "surface", "warp", "algorithm", "heights/s", "x 8 kHz");
    let weights: Vec<Vec<f64>> =
        (0..30).map(|i| (0..30).map(|j| 0.7 + 0.6 * f64::from((7 * i + 11 * j) % 13) / 12.0).collect()).collect();
    for degree in [2, 3] {
        for (warp, weights) in [(0.0, None), (0.5, None), (1.0, Some(weights.as_slice()))] {
            let surface = nurbs::surface(degree, warp, weights);
            let row = |algorithm: &str, rate: f64| {
                println!("degree {degree:<3}{warp:>9}{algorithm:>28}{rate:>14.0}{:>14.0}", rate / 8000.0);
            };
            measure(&surface, row);
        }
    }
}

fn measure(surface: &Surface, row: impl Fn(&str, f64)) {
    let spiral: Vec<[f64; 2]> = (0..20_000)
        .map(|n| {
            let (angle, radius) = (0.02 * f64::from(n), 20.0 * f64::from(n) / 20_000.0);
            [radius * math::cos(angle), radius * math::sin(angle)]
        })
        .collect();
    let even: Vec<[f64; 2]> = (0..1600)
        .map(|n| [(f64::from(n % 40) + 0.5) / 40.0, (f64::from(n / 40) + 0.5) / 40.0])
        .map(|uv| surface.point(uv))
        .map(|[x, y, _]| [x, y])
        .collect();
    let grid = HeightGrid::over(surface, 0.25, None).expect("a grid");
    row("I", rate(&spiral, |xy| grid.height(xy).expect("a height")));
    if let Ok(decoupled) = Decoupled::of(surface) {
        row("II", rate(&spiral, |xy| decoupled.height(xy).expect("a height")));
    }
    let inversion = Inversion::new(surface, Method::GaussNewton);
    let mut warm = inversion.clone();
    row("III along a spiral", rate(&spiral, |xy| warm.next(xy).expect("a height").at[2]));
    let cold = |xy| inversion.cold(xy).expect("a height").at[2];
    row("III from a linear guess", rate(&even, cold));
    let slowest = even.iter().map(|&xy| rate(&[xy; 64], cold)).fold(f64::INFINITY, f64::min);
    row("III, the worst of these", slowest);
}

/// Heights a second, the best of three.
fn rate(places: &[[f64; 2]], mut height: impl FnMut([f64; 2]) -> f64) -> f64 {
    let mut once = || {
        let begin = Instant::now();
        for &xy in places {
            black_box(height(black_box(xy)));
        }
        places.len() as f64 / begin.elapsed().as_secs_f64()
    };
    (0..3).map(|_| once()).fold(0.0, f64::max)
}
