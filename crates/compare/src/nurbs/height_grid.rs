//! Algorithm I: heights on a square grid, between them a Gaussian-weighted mean of 7 x 7 (Brecher et al., eq. 2).
//!
//! Weights are e^(-d²/k²). They smooth: the height is off by about k²/4 times the Laplacian of z, more where k is much
//! smaller than the distance of the nodes, since the mean then ripples. 0.85 to 1 times that distance is best.

use super::{Inversion, Method, Scalar, Surface};
use terrace_core::diag::{Diag, Error};

/// Nodes to each side of the nearest.
const REACH: usize = 3;
const NODES: usize = 2 * REACH + 1;
/// k over the distance of the nodes where nothing else is asked for.
const KERNEL: f64 = 0.9;
/// Most nodes that are kept, and most that are inverted for.
const MOST: f64 = 2e7;
const INVERSIONS: f64 = 1e6;

/// Heights on a grid.
#[derive(Clone, Debug)]
pub struct HeightGrid {
    lo: [f64; 2],
    /// Distance of the nodes, mm.
    step: f64,
    kernel: f64,
    count: [usize; 2],
    /// Rows of one y each; no number where the surface is not.
    heights: Vec<f64>,
}

impl HeightGrid {
    /// The grid over a surface with nodes `step` mm apart and a kernel of `kernel` mm, by default 0.9 of `step`.
    /// Heights of the nodes are those of algorithm III, exact.
    ///
    /// # Errors
    /// `nurbs-grid` where the grid is empty or has more than a million nodes, or a distance is not positive.
    pub fn over(surface: &Surface, step: f64, kernel: Option<f64>) -> Result<Self, Error> {
        let [lo, hi] = surface.hull();
        let mut inversion = Inversion::new(surface, Method::GaussNewton);
        Self::within(INVERSIONS, [[lo[0], lo[1]], [hi[0], hi[1]]], step, kernel, |xy| {
            inversion.next(xy).map_or(f64::NAN, |found| found.at[2])
        })
    }

    /// The grid over the box from `lo` to `hi` mm, of heights by (x, y); no number where there is none.
    ///
    /// # Errors
    /// As [`Self::over`], of 20 million nodes.
    pub fn of(
        area: [[f64; 2]; 2],
        step: f64,
        kernel: Option<f64>,
        height: impl FnMut([f64; 2]) -> f64,
    ) -> Result<Self, Error> {
        Self::within(MOST, area, step, kernel, height)
    }

    fn within(
        most: f64,
        [lo, hi]: [[f64; 2]; 2],
        step: f64,
        kernel: Option<f64>,
        mut height: impl FnMut([f64; 2]) -> f64,
    ) -> Result<Self, Error> {
        let refused =
            |text: String| Err(Diag::input("nurbs-grid", text).hint("a hundredth of the part is usual").into());
        let kernel = kernel.unwrap_or(KERNEL * step);
        if !(step > 0.0 && step.is_finite() && kernel > 0.0 && kernel.is_finite()) {
            return refused("the distance of the grid's nodes, or its kernel, is not positive".into());
        }
        let size = [0, 1].map(|k| ((hi[k] - lo[k]) / step + 1e-9).floor() + 1.0);
        if size.iter().any(|&n| n < NODES as f64) || size[0] * size[1] > most {
            let text = format!(
                "a grid of {} x {} nodes {step} mm apart is not between {NODES} x {NODES} and {most} nodes",
                size[0], size[1]
            );
            return refused(text);
        }
        let count = size.map(|n| n as usize);
        let nodes = (0..count[1]).flat_map(|j| (0..count[0]).map(move |i| [i, j]));
        let heights = nodes.map(|[i, j]| height([lo[0] + i as f64 * step, lo[1] + j as f64 * step])).collect();
        Ok(Self { lo, step, kernel, count, heights })
    }

    /// Distance of the nodes, mm.
    pub fn step(&self) -> f64 {
        self.step
    }

    /// k, mm.
    pub fn kernel(&self) -> f64 {
        self.kernel
    }

    /// The height at (x, y), mm; None where one of the 49 nodes is not on the surface. The kernel is separable, so that
    /// it takes 14 exponentials instead of 49.
    pub fn height<T: Scalar>(&self, xy: [T; 2]) -> Option<T> {
        let per_step = T::of(1.0 / self.step);
        let per_kernel = T::of(1.0 / self.kernel);
        let mut first = [0; 2];
        let mut weights = [[T::of(0.0); NODES]; 2];
        for k in 0..2 {
            let at = (xy[k] - T::of(self.lo[k])) * per_step;
            let nearest = at.value().round();
            if !(nearest >= REACH as f64 && nearest < (self.count[k] - REACH) as f64) {
                return None;
            }
            first[k] = nearest as usize - REACH;
            for (n, weight) in weights[k].iter_mut().enumerate() {
                let far = (T::of(self.lo[k] + (first[k] + n) as f64 * self.step) - xy[k]) * per_kernel;
                *weight = (T::of(0.0) - far * far).exp();
            }
        }
        let sum_of = |weights: &[T; NODES]| weights[1..].iter().fold(weights[0], |sum, &w| sum + w);
        let mut sum = T::of(0.0);
        for (row, &weight) in weights[1].iter().enumerate() {
            let line = &self.heights[(first[1] + row) * self.count[0] + first[0]..][..NODES];
            let across = line.iter().zip(&weights[0]).fold(T::of(0.0), |sum, (&z, &w)| sum + w * T::of(z));
            sum = sum + weight * across;
        }
        let height = sum / (sum_of(&weights[0]) * sum_of(&weights[1]));
        height.value().is_finite().then_some(height)
    }
}
