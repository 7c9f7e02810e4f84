//! What a surface is like, and what the three algorithms make of it, at a grid of samples.

use super::{Counted, Decoupled, HeightGrid, Inversion, Method, Scalar, Surface, counted};
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
    /// How far a height is from that of the sample at most, mm.
    pub worst: f64,
}

/// What was found.
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
    /// The same from the sample before.
    pub warm: Convergence,
    /// Full Newton steps from the linear guess.
    pub newton: Convergence,
    /// Floating-point operations of a point of the surface.
    pub point_operations: u64,
    /// Of a height by algorithm I.
    pub grid_operations: u64,
    /// Of a height by algorithm II; as for any net of these degrees, whether or not this one is decoupled.
    pub decoupled_operations: u64,
    /// Of a Gauss-Newton step of algorithm III.
    pub step_operations: u64,
    /// Of a full Newton step.
    pub newton_step_operations: u64,
}

/// Examines a surface. Samples are even in the parameters, without the rim, in a serpentine.
///
/// # Errors
/// `nurbs-grid` where the grid of algorithm I cannot be made.
pub fn examine(surface: &Surface, steps: GridSteps) -> Result<Examination, Error> {
    let range = surface.range();
    let parameter = |k: usize, i: usize| {
        let [lo, hi] = range[k];
        lo + (hi - lo) * (i as f64 + 0.5) / SAMPLES as f64
    };
    let uvs: Vec<[f64; 2]> = (0..SAMPLES * SAMPLES)
        .map(|n| {
            let (row, along) = (n / SAMPLES, n % SAMPLES);
            [parameter(0, if row % 2 == 0 { along } else { SAMPLES - 1 - along }), parameter(1, row)]
        })
        .collect();
    let samples: Vec<[f64; 3]> = uvs.iter().map(|&uv| surface.point(uv)).collect();
    let turns = uvs.iter().map(|&uv| {
        let [_, u, v, ..] = surface.derivatives::<f64, 1>(uv);
        u[0] * v[1] - u[1] * v[0]
    });
    let (least, most) = turns.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), d| (lo.min(d), hi.max(d)));
    let [lo, hi] = surface.hull();
    let shorter = (hi[0] - lo[0]).min(hi[1] - lo[1]);
    let grid = HeightGrid::over(surface, steps.step.unwrap_or(shorter / 100.0), steps.kernel)?;
    let of_grid: Vec<f64> = samples.iter().filter_map(|&[x, y, z]| Some((grid.height([x, y])? - z).abs())).collect();
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
        is_height_map: least * most > 0.0,
        grid_error: of_grid.iter().copied().reduce(f64::max),
        grid_reaches: of_grid.len(),
        cold: convergence(&samples, |xy| gauss_newton.cold(xy).map(|f| (f.steps, f.at[2])).ok()),
        warm: convergence(&samples[1..], |xy| warm.next(xy).map(|f| (f.steps, f.at[2])).ok()),
        newton: convergence(&samples, |xy| newton.cold(xy).map(|f| (f.steps, f.at[2])).ok()),
        decoupled_error,
        point_operations: operations[0],
        grid_operations: operations[1],
        decoupled_operations: operations[2],
        step_operations: operations[3],
        newton_step_operations: operations[4],
        grid,
        samples,
    })
}

/// What an inversion, which tells steps and height, makes of the samples.
fn convergence(samples: &[[f64; 3]], mut invert: impl FnMut([f64; 2]) -> Option<(usize, f64)>) -> Convergence {
    let found: Vec<(usize, f64)> = samples
        .iter()
        .filter_map(|&[x, y, z]| invert([x, y]).map(|(steps, height)| (steps, (height - z).abs())))
        .collect();
    Convergence {
        samples: samples.len(),
        converged: found.len(),
        mean_steps: found.iter().map(|f| f.0 as f64).sum::<f64>() / found.len().max(1) as f64,
        most_steps: found.iter().map(|f| f.0).max().unwrap_or(0),
        worst: found.iter().map(|f| f.1).fold(0.0, f64::max),
    }
}

/// Operations of a point, of a height by I and by II, and of a step of III by Gauss-Newton and by Newton.
fn operations(surface: &Surface, grid: &HeightGrid) -> Result<[u64; 5], Error> {
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
    Ok([point, by_grid, by_decoupled, step(Method::GaussNewton), step(Method::Newton)])
}

/// A level square whose control points lie at the Greville abscissae.
fn plane(degree: [usize; 2]) -> Result<Surface, Error> {
    let knots = degree.map(|p| [vec![0.0; p + 1], vec![1.0; p + 1]].concat());
    let at = |i: usize, p: usize| i as f64 / p as f64;
    let row = |i: usize| (0..=degree[1]).map(|j| [at(i, degree[0]), at(j, degree[1]), 0.0]).collect();
    Surface::new(degree, knots, &(0..=degree[0]).map(row).collect::<Vec<Vec<_>>>(), None)
}
