//! What a surface is like, and what the three algorithms make of it, at a grid of samples.

use super::{Counted, Decoupled, HeightGrid, Inversion, InvertedPoint, Method, NotConverged, Scalar, Surface, counted};
use terrace_core::diag::{Diag, Error};

/// Samples along each parameter.
const SAMPLES: usize = 40;

/// The grid of algorithm I, mm.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GridSteps {
    /// Distance of the nodes; by default a hundredth of the shorter side.
    pub step: Option<f64>,
    /// The kernel's k; by default 0.9 of the distance.
    pub kernel: Option<f64>,
}

/// How inversions of samples end.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Convergence {
    /// Inversions.
    pub samples: usize,
    /// How many of them converge.
    pub converged: usize,
    /// Mean steps of these.
    pub mean_steps: f64,
    /// Most steps of these.
    pub most_steps: usize,
    /// Largest difference of a height that was found from that of its sample, mm.
    pub worst: f64,
}

/// A surface in figures, and the errors and costs of the three algorithms on it.
#[derive(Debug)]
pub struct Examination {
    /// Samples as x, y and z, mm.
    pub samples: Vec<[f64; 3]>,
    /// x and y determine the point near every sample: the map from u, v to x, y turns the same way at all.
    pub is_height_map: bool,
    /// Worst error of algorithm I at samples that it reaches, mm.
    pub grid_error: Option<f64>,
    /// How many samples it reaches.
    pub grid_reaches: usize,
    /// The grid of heights.
    pub grid: HeightGrid,
    /// Worst error of algorithm II, mm; or why the net is not decoupled.
    pub decoupled_error: Result<f64, Error>,
    /// Algorithm III from the linear guess.
    pub cold: Convergence,
    /// Algorithm III from the sample before.
    pub warm: Convergence,
    /// Full Newton steps from the linear guess.
    pub newton: Convergence,
    /// Floating-point operations of a point of the surface.
    pub point_operations: u64,
    /// Floating-point operations of a height by algorithm I.
    pub grid_operations: u64,
    /// Floating-point operations of a height by algorithm II; as for any net of these degrees, whether or not this one
    /// is decoupled.
    pub decoupled_operations: u64,
    /// Floating-point operations of a Gauss-Newton step of algorithm III.
    pub step_operations: u64,
    /// Floating-point operations of a full Newton step.
    pub newton_step_operations: u64,
}

/// Examines a surface. Samples are even in the parameters, without the rim, in a serpentine.
///
/// # Errors
/// `nurbs-grid` where the grid of algorithm I cannot be made.
pub fn examine(surface: &Surface, steps: GridSteps) -> Result<Examination, Error> {
    let uvs = parameters(surface);
    let samples: Vec<[f64; 3]> = uvs.iter().map(|&uv| surface.point(uv)).collect();
    let [lo, hi] = surface.hull();
    let shorter = (hi[0] - lo[0]).min(hi[1] - lo[1]);
    let grid = HeightGrid::over(surface, steps.step.unwrap_or(shorter / 100.0), steps.kernel)?;
    let grid_errors: Vec<f64> =
        samples.iter().filter_map(|&[x, y, z]| Some((grid.height([x, y])? - z).abs())).collect();
    let decoupled = Decoupled::of(surface);
    let decoupled_error = decoupled.as_ref().map_err(Clone::clone).map(|decoupled| {
        let off = |&[x, y, z]: &[f64; 3]| (decoupled.point([x, y])[2] - z).abs();
        samples.iter().map(off).fold(0.0, f64::max)
    });
    let gauss_newton = Inversion::new(surface, Method::GaussNewton);
    let newton = Inversion::new(surface, Method::Newton);
    let mut warm = gauss_newton.clone();
    // From one sample to the next, without the first, which starts cold.
    let _ = warm.next([samples[0][0], samples[0][1]]);
    let operations = operations(surface, &grid)?;
    Ok(Examination {
        is_height_map: is_height_map(surface, &uvs),
        grid_error: grid_errors.iter().copied().reduce(f64::max),
        grid_reaches: grid_errors.len(),
        cold: convergence(&samples, |xy| gauss_newton.cold(xy)),
        warm: convergence(&samples[1..], |xy| warm.next(xy)),
        newton: convergence(&samples, |xy| newton.cold(xy)),
        decoupled_error,
        point_operations: operations.point,
        grid_operations: operations.grid,
        decoupled_operations: operations.decoupled,
        step_operations: operations.gauss_newton_step,
        newton_step_operations: operations.newton_step,
        grid,
        samples,
    })
}

/// The parameters of the samples: even, without the rim, in a serpentine.
fn parameters(surface: &Surface) -> Vec<[f64; 2]> {
    let parameter = |[lo, hi]: [f64; 2], i: usize| lo + (hi - lo) * (i as f64 + 0.5) / SAMPLES as f64;
    let [u_range, v_range] = surface.range();
    (0..SAMPLES * SAMPLES)
        .map(|n| {
            let (row, along) = (n / SAMPLES, n % SAMPLES);
            let column = if row % 2 == 0 { along } else { SAMPLES - 1 - along };
            [parameter(u_range, column), parameter(v_range, row)]
        })
        .collect()
}

/// Whether the map from u, v to x, y turns the same way everywhere.
fn is_height_map(surface: &Surface, uvs: &[[f64; 2]]) -> bool {
    let turns = uvs.iter().map(|&uv| {
        let [_, u, v, ..] = surface.derivatives::<f64, 1>(uv);
        u[0] * v[1] - u[1] * v[0]
    });
    let (least, most) = turns.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), d| (lo.min(d), hi.max(d)));
    least * most > 0.0
}

/// How inversions of the samples end, by their x and y; each height that is found is compared with its z.
fn convergence(
    samples: &[[f64; 3]],
    mut invert: impl FnMut([f64; 2]) -> Result<InvertedPoint<f64>, NotConverged>,
) -> Convergence {
    let mut out = Convergence { samples: samples.len(), ..Convergence::default() };
    let mut total_steps = 0.0;
    for &[x, y, z] in samples {
        let Ok(point) = invert([x, y]) else { continue };
        out.converged += 1;
        total_steps += point.steps as f64;
        out.most_steps = out.most_steps.max(point.steps);
        out.worst = out.worst.max((point.at[2] - z).abs());
    }
    out.mean_steps = total_steps / out.converged.max(1) as f64;
    out
}

/// Floating-point operations.
struct Operations {
    /// Of a point of the surface.
    point: u64,
    /// Of a height by algorithm I.
    grid: u64,
    /// Of a height by algorithm II.
    decoupled: u64,
    /// Of a step of algorithm III by Gauss-Newton.
    gauss_newton_step: u64,
    /// Of a step of algorithm III by Newton.
    newton_step: u64,
}

/// What a point of the surface and the three algorithms cost.
fn operations(surface: &Surface, grid: &HeightGrid) -> Result<Operations, Error> {
    let middle = surface.range().map(|[lo, hi]| 0.5 * (lo + hi));
    let (_, point) = counted(|| surface.point(middle.map(Counted::of)));
    let [x, y, _] = surface.point(middle);
    let (reached, by_grid) = counted(|| grid.height([x, y].map(Counted::of)));
    if reached.is_none() {
        let text = "the grid of algorithm I does not reach the middle of the surface";
        return Err(Diag::input("nurbs-grid", text).hint("choose a finer grid").into());
    }
    // A plane net of the same degrees: what is counted does not depend on the numbers.
    let plane = plane(surface.degree())?;
    let decoupled = Decoupled::of(&plane)?;
    let (_, by_decoupled) = counted(|| decoupled.point([Counted::of(0.5); 2]));
    let step = |method| Inversion::new(surface, method).operations_of_a_step();
    Ok(Operations {
        point,
        grid: by_grid,
        decoupled: by_decoupled,
        gauss_newton_step: step(Method::GaussNewton),
        newton_step: step(Method::Newton),
    })
}

/// A level square whose control points lie at the Greville abscissae.
fn plane(degree: [usize; 2]) -> Result<Surface, Error> {
    let knots = degree.map(|p| [vec![0.0; p + 1], vec![1.0; p + 1]].concat());
    let at = |i: usize, p: usize| i as f64 / p as f64;
    let row = |i: usize| (0..=degree[1]).map(|j| [at(i, degree[0]), at(j, degree[1]), 0.0]).collect();
    Surface::new(degree, knots, &(0..=degree[0]).map(row).collect::<Vec<Vec<_>>>(), None)
}
