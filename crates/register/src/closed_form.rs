//! Pairs of points, and the motion that fits them in one step.

use nalgebra::{Matrix3, Vector3};

use super::motion::Motion;
use terrace_core::geom::SpacePoint;

/// A point of the part, and where it lies on the stage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pair {
    /// On the part as the job turns it, mm.
    pub part: SpacePoint,
    /// In the table frame, mm.
    pub stage: SpacePoint,
    /// Standard deviation of the stage position along x, y and z, mm.
    pub sigma: SpacePoint,
}

/// The sum of products of two lists of points about their middles.
pub(crate) fn scatter(points: impl Iterator<Item = ([f64; 3], [f64; 3])> + Clone) -> Matrix3<f64> {
    let count = points.clone().count().max(1) as f64;
    let sums =
        points.clone().fold([Vector3::zeros(); 2], |[a, b], (p, q)| [a + Vector3::from(p), b + Vector3::from(q)]);
    let [a, b] = sums.map(|sum| sum / count);
    points.fold(Matrix3::zeros(), |sum, (p, q)| sum + (Vector3::from(q) - b) * (Vector3::from(p) - a).transpose())
}

/// The motion that fits pairs of equal weight best (Arun, Huang and Blostein 1987, with the reflection of Umeyama 1991).
pub(crate) fn closed_form(pairs: &[Pair]) -> Motion {
    let svd = scatter(pairs.iter().map(|p| (p.part, p.stage))).svd(true, true);
    let (Some(u), Some(v_t)) = (svd.u, svd.v_t) else { return Motion::shift([0.0; 3]) };
    let mut signs = Vector3::new(1.0, 1.0, 1.0);
    if (u * v_t).determinant() < 0.0 {
        // The least singular value belongs to the direction in which the points are flattest.
        signs[svd.singular_values.imin()] = -1.0;
    }
    let rotation = u * Matrix3::from_diagonal(&signs) * v_t;
    let count = pairs.len().max(1) as f64;
    let middle = |of: fn(&Pair) -> [f64; 3]| pairs.iter().map(|p| Vector3::from(of(p))).sum::<Vector3<f64>>() / count;
    Motion::new(rotation, middle(|p| p.stage) - rotation * middle(|p| p.part))
}
