//! NURBS surfaces made from a height and a map of the plane, by interpolation at the Greville abscissae.

use std::f64::consts::PI;
use terrace_core::math;

use nalgebra::DMatrix;
use terrace_compare::nurbs::Surface;

/// Where a control point of the undistorted square lies.
pub type Warp = dyn Fn([f64; 2]) -> [f64; 2];

/// Height of the surface of the reference figures.
pub fn height([x, y]: [f64; 2]) -> f64 {
    0.55 * math::cos(PI * x / 25.0) * math::cos(PI * y / 40.0) + 0.002 * x * x - 0.0015 * y * y
        + 0.15 * math::sin(2.0 * PI * (x + 0.5 * y) / 18.0)
}

/// Half of the square's side, mm.
pub const HALF: f64 = 25.0;

/// The distortion of the reference surfaces, from 0 (none) to 1; at 1 points move by up to 5 mm.
pub fn warp(strength: f64) -> impl Fn([f64; 2]) -> [f64; 2] {
    move |[x, y]| {
        let moved = |along: f64, across: f64| {
            along - 5.0 * strength * math::sin(PI * across / HALF) * math::cos(PI * along / (2.0 * HALF))
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
pub fn net(
    degree: usize,
    count: usize,
    half: f64,
    warp: &Warp,
    height: &dyn Fn([f64; 2]) -> f64,
) -> Vec<Vec<[f64; 3]>> {
    let knots = knots(degree, count);
    let at = greville(degree, &knots);
    let place = |i: usize| half * (2.0 * at[i] - 1.0);
    let plan: Vec<Vec<[f64; 2]>> =
        (0..count).map(|i| (0..count).map(|j| warp([place(i), place(j)])).collect()).collect();
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

/// A surface as a NURBS file.
pub fn file(degree: usize, points: &[Vec<[f64; 3]>], weights: Option<&[Vec<f64>]>) -> String {
    let knots: Vec<String> =
        [points.len(), points[0].len()].iter().map(|&n| format!("{:?}", knots(degree, n))).collect();
    let rows: Vec<String> = points.iter().map(|row| format!("    {row:?}")).collect();
    let weights = weights.map_or(String::new(), |weights| {
        let rows: Vec<String> = weights.iter().map(|row| format!("    {row:?}")).collect();
        format!(",\n  \"weights\": [\n{}\n  ]", rows.join(",\n"))
    });
    format!(
        "{{\n  \"unit\": \"mm\",\n  \"degree\": [{degree}, {degree}],\n  \"knots\": [\n    {}\n  ],\n  \"points\": [\n{}\n  ]{weights}\n}}\n",
        knots.join(",\n    "),
        rows.join(",\n")
    )
}

/// The dish of `fixtures/sources/brecher`: 32 x 32 mm, waves of 0.4 mm on a bulge; degree 3, decoupled.
pub fn dish() -> String {
    let height = |[x, y]: [f64; 2]| {
        0.2 * math::cos(2.0 * PI * x / 10.0) * math::cos(2.0 * PI * y / 12.0) - 0.004 * (x * x + y * y)
    };
    let mut points = net(3, 16, 16.0, &|p| p, &height);
    // As many digits of the height as a part has; x and y whole, or the net would not be decoupled.
    points.iter_mut().flatten().for_each(|p| p[2] = (p[2] * 1e6).round() / 1e6);
    file(3, &points, None)
}

/// The patch there: 10 x 10 mm, distorted, with weights; degree 2.
pub fn patch() -> String {
    let warp = |[x, y]: [f64; 2]| {
        let moved = |along: f64, across: f64| along - 0.8 * math::sin(PI * across / 5.0) * math::cos(PI * along / 10.0);
        [moved(x, y), moved(y, x)].map(|v| (v * 1e6).round() / 1e6)
    };
    let mut points = net(2, 10, 5.0, &warp, &|[x, y]| 0.1 * math::sin(0.7 * x) * math::cos(0.5 * y));
    points.iter_mut().flatten().for_each(|p| p[2] = (p[2] * 1e6).round() / 1e6);
    let weights: Vec<Vec<f64>> = (0..10)
        .map(|i| (0..10).map(|j| [1.0, 1.2, 0.85, 1.1, 0.9, 1.25, 0.8][(3 * i + 5 * j) % 7]).collect())
        .collect();
    file(2, &points, Some(&weights))
}

/// Triangles of a surface between parameters `1 / steps` of the range apart: corners, and their indices.
pub fn tessellated(surface: &Surface, steps: usize) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
    let at = |k: usize, i: usize| {
        let [lo, hi] = surface.range()[k];
        lo + (hi - lo) * i as f64 / steps as f64
    };
    let corners =
        (0..=steps).flat_map(|j| (0..=steps).map(move |i| (i, j))).map(|(i, j)| surface.point([at(0, i), at(1, j)]));
    let corner = |i: usize, j: usize| (j * (steps + 1) + i) as u32;
    let cells = (0..steps).flat_map(|j| (0..steps).map(move |i| (i, j)));
    let facets = cells.flat_map(|(i, j)| {
        let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
        [[a, b, c], [a, c, d]]
    });
    (corners.collect(), facets.collect())
}

/// How far such triangles lie off the surface at most, along z, mm: half-widths in the parameters times second
/// derivatives (D. Filip, R. Magedson, R. Markot, Surface algorithms using bounds on derivatives, 1986), and what a
/// distance in x and y makes on the slope. Derivatives are the largest at nine places of every triangle's cell.
pub fn chord_error(surface: &Surface, steps: usize) -> f64 {
    let [[u0, u1], [v0, v1]] = surface.range();
    let [hu, hv] = [(u1 - u0) / steps as f64, (v1 - v0) / steps as f64];
    let side = 2 * steps + 1;
    let size = |d: [f64; 3]| d.iter().map(|c| c * c).sum::<f64>().sqrt();
    let (mut bent, mut slope) = ([0.0f64; 3], 0.0f64);
    for n in 0..side * side {
        let [i, j] = [n % side, n / side].map(|k| k as f64 / (2 * steps) as f64);
        let [_, u, v, uu, uv, vv] = surface.derivatives::<f64, 2>([u0 + (u1 - u0) * i, v0 + (v1 - v0) * j]);
        bent = [bent[0].max(size(uu)), bent[1].max(size(uv)), bent[2].max(size(vv))];
        let det = u[0] * v[1] - u[1] * v[0];
        let [sx, sy] = [(u[2] * v[1] - u[1] * v[2]) / det, (u[0] * v[2] - u[2] * v[0]) / det];
        slope = slope.max(math::hypot(sx, sy));
    }
    let off = (hu * hu * bent[0] + 2.0 * hu * hv * bent[1] + hv * hv * bent[2]) / 8.0;
    off * (1.0 + slope * slope).sqrt()
}

/// Such triangles as a binary PLY file, corners as floats.
pub fn ply((corners, facets): &(Vec<[f64; 3]>, Vec<[u32; 3]>)) -> Vec<u8> {
    let mut out = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
         element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        corners.len(),
        facets.len()
    )
    .into_bytes();
    corners.iter().flatten().for_each(|c| out.extend((*c as f32).to_le_bytes()));
    for facet in facets {
        out.push(3);
        facet.iter().for_each(|i| out.extend(i.to_le_bytes()));
    }
    out
}
