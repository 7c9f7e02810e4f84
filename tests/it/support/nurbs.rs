//! NURBS surfaces made from a height and a map of the plane, by interpolation at the Greville abscissae.

use std::f64::consts::PI;

use nalgebra::DMatrix;
use terrace::nurbs::Surface;

/// Where a control point of the undistorted square lies.
pub type Warp = dyn Fn([f64; 2]) -> [f64; 2];

/// Height of the surface of the reference figures.
pub fn height([x, y]: [f64; 2]) -> f64 {
    0.55 * (PI * x / 25.0).cos() * (PI * y / 40.0).cos() + 0.002 * x * x - 0.0015 * y * y
        + 0.15 * (2.0 * PI * (x + 0.5 * y) / 18.0).sin()
}

/// Half of the square's side, mm.
pub const HALF: f64 = 25.0;

/// The distortion of the reference surfaces, from 0 (none) to 1; at 1 points move by up to 5 mm.
pub fn warp(strength: f64) -> impl Fn([f64; 2]) -> [f64; 2] {
    move |[x, y]| {
        let moved = |along: f64, across: f64| {
            along - 5.0 * strength * (PI * across / HALF).sin() * (PI * along / (2.0 * HALF)).cos()
        };
        [moved(x, y), moved(y, x)]
    }
}

/// Clamped knots from 0 to 1, evenly spaced.
pub fn knots(degree: usize, count: usize) -> Vec<f64> {
    let inner = count - degree;
    (0..count + degree + 1).map(|i| (i.saturating_sub(degree)).min(inner) as f64 / inner as f64).collect()
}

/// Greville abscissae.
pub fn greville(degree: usize, knots: &[f64]) -> Vec<f64> {
    (0..knots.len() - degree - 1).map(|i| knots[i + 1..=i + degree].iter().sum::<f64>() / degree as f64).collect()
}

/// The net over a square of ±`half` mm that passes through the height at the Greville abscissae while all weights are 1.
pub fn net(degree: usize, count: usize, half: f64, warp: &Warp, height: &dyn Fn([f64; 2]) -> f64) -> Vec<Vec<[f64; 3]>> {
    let knots = knots(degree, count);
    let at = greville(degree, &knots);
    let place = |i: usize| half * (2.0 * at[i] - 1.0);
    let plan: Vec<Vec<[f64; 2]>> = (0..count).map(|i| (0..count).map(|j| warp([place(i), place(j)])).collect()).collect();
    // Values of the basis functions at the abscissae: those of a curve whose control points are unit vectors.
    let basis = DMatrix::from_fn(count, count, |row, k| {
        let points: Vec<Vec<[f64; 3]>> = (0..count).map(|i| vec![[0.0, 0.0, f64::from(i == k)]; 2]).collect();
        let ruled = Surface::new([degree, 1], [knots.clone(), vec![0.0, 0.0, 1.0, 1.0]], &points, None);
        ruled.expect("a ruled surface").point([at[row], 0.5])[2]
    });
    let lu = basis.clone().lu();
    let along = |k: usize| &basis * DMatrix::from_fn(count, count, |i, j| plan[i][j][k]) * basis.transpose();
    let (x, y) = (along(0), along(1));
    let wanted = DMatrix::from_fn(count, count, |i, j| height([x[(i, j)], y[(i, j)]]));
    let half_way = lu.solve(&wanted).expect("collocation at Greville abscissae is regular").transpose();
    let z = lu.solve(&half_way).expect("as above").transpose();
    (0..count).map(|i| (0..count).map(|j| [plan[i][j][0], plan[i][j][1], z[(i, j)]]).collect()).collect()
}

/// Of such a net, with weights or without.
pub fn surface(degree: usize, strength: f64, weights: Option<&[Vec<f64>]>) -> Surface {
    const COUNT: usize = 30;
    let points = net(degree, COUNT, HALF, &warp(strength), &height);
    Surface::new([degree; 2], [knots(degree, COUNT), knots(degree, COUNT)], &points, weights).expect("a surface")
}
