//! Normal equations of a small motion of the part, and what they hold.

use nalgebra::{Matrix6, SMatrix, SVector, SymmetricEigen, Vector3, Vector6};

/// How much larger the part is on the stage than by its file; reported, never applied.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// Part per part: 1e-5 is 10 um over a metre.
    pub excess: f64,
    /// Its standard deviation.
    pub sigma: f64,
}

/// A motion is free where the mean square of what it changes is below so many times what facets could hold of it by the
/// angles between them, or below this.
const OF_FACETS: f64 = 4.0;
const BLIND: f64 = 1e-8;

/// Sums of equations.
pub(crate) struct Normal {
    matrix: Matrix6<f64>,
    right: Vector6<f64>,
    /// The same with the scale as seventh unknown.
    with_scale: SMatrix<f64, 7, 7>,
    right_scale: SVector<f64, 7>,
    /// Sum of weights, and of weights times the bend of the facets.
    weight: f64,
    pub(crate) bend: f64,
    /// Weights times the square of the distance from the middle.
    spread: f64,
}

impl Normal {
    pub(crate) fn new() -> Self {
        Self {
            matrix: Matrix6::zeros(),
            right: Vector6::zeros(),
            with_scale: SMatrix::zeros(),
            right_scale: SVector::zeros(),
            weight: 0.0,
            bend: 0.0,
            spread: 0.0,
        }
    }

    /// Adds the equation that moving the part at `arm` from the middle along `direction` closes `residual`.
    pub(crate) fn add(&mut self, arm: &Vector3<f64>, direction: &Vector3<f64>, residual: f64, weight: f64) {
        let turn = arm.cross(direction);
        let row = Vector6::new(turn.x, turn.y, turn.z, direction.x, direction.y, direction.z);
        self.matrix += row * row.transpose() * weight;
        self.right += row * (residual * weight);
        let grown = arm.dot(direction);
        let row = SVector::<f64, 7>::from([turn.x, turn.y, turn.z, direction.x, direction.y, direction.z, grown]);
        self.with_scale += row * row.transpose() * weight;
        self.right_scale += row * (residual * weight);
        self.weight += weight;
        self.spread += weight * arm.norm_squared();
    }

    /// Mean distance of the points from their middle, mm.
    pub(crate) fn extent(&self) -> f64 {
        (self.spread / self.weight.max(f64::MIN_POSITIVE)).sqrt().max(1e-6)
    }

    /// The unknowns in units that weigh alike: turns by the extent.
    pub(crate) fn units(&self) -> Vector6<f64> {
        let turn = 1.0 / self.extent();
        Vector6::new(turn, turn, turn, 1.0, 1.0, 1.0)
    }

    /// What the equations hold, and what they leave free.
    pub(crate) fn solved(&self) -> Solved {
        let units = self.units();
        let scaled = Matrix6::from_diagonal(&units) * self.matrix * Matrix6::from_diagonal(&units);
        let eigen = SymmetricEigen::new(scaled);
        let floor = self.weight * BLIND + OF_FACETS * self.bend;
        let mut inverse = Matrix6::zeros();
        let mut free = Vec::new();
        for k in 0..6 {
            let v = eigen.eigenvectors.column(k).component_mul(&units);
            if eigen.eigenvalues[k] > floor {
                inverse += v * v.transpose() / eigen.eigenvalues[k];
            } else {
                free.push(v);
            }
        }
        Solved { step: inverse * self.right, inverse, free }
    }

    /// The scale, as a seventh unknown; None where it is not held.
    pub(crate) fn scale(&self, solved: &Solved) -> Option<Scale> {
        if !solved.free.is_empty() {
            return None;
        }
        let units = self.units();
        let units = SVector::<f64, 7>::from_fn(|k, _| if k < 6 { units[k] } else { 1.0 / self.extent() });
        let units = SMatrix::<f64, 7, 7>::from_diagonal(&units);
        let eigen = SymmetricEigen::new(units * self.with_scale * units);
        let floor = self.weight * BLIND + OF_FACETS * self.bend;
        let mut inverse = SMatrix::<f64, 7, 7>::zeros();
        for k in 0..7 {
            if eigen.eigenvalues[k] <= floor {
                return None;
            }
            let v = units * eigen.eigenvectors.column(k);
            inverse += v * v.transpose() / eigen.eigenvalues[k];
        }
        let solution = inverse * self.right_scale;
        Some(Scale { excess: solution[6], sigma: inverse[(6, 6)].sqrt() })
    }
}

/// What equations come to.
pub(crate) struct Solved {
    pub(crate) step: Vector6<f64>,
    pub(crate) inverse: Matrix6<f64>,
    pub(crate) free: Vec<Vector6<f64>>,
}
