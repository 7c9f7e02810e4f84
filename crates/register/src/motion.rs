//! Rigid motions in space.

use nalgebra::{Matrix3, Vector3, Vector6};
use terrace_core::geom::SpacePoint;
use terrace_core::math;

/// A rigid motion: a rotation about the origin, then a shift, mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    rotation: Matrix3<f64>,
    shift: Vector3<f64>,
}

impl Motion {
    /// A shift alone, mm.
    pub fn shift(by: SpacePoint) -> Self {
        Self { rotation: Matrix3::identity(), shift: Vector3::from(by) }
    }

    /// The motion of a rotation, which must be one, and a shift.
    pub(crate) fn new(rotation: Matrix3<f64>, shift: Vector3<f64>) -> Self {
        Self { rotation, shift }
    }

    /// The rows of its rotation.
    pub fn rows(&self) -> [SpacePoint; 3] {
        [0, 1, 2].map(|i| [0, 1, 2].map(|k| self.rotation[(i, k)]))
    }

    /// Where the origin comes to lie, mm.
    pub fn origin(&self) -> SpacePoint {
        self.shift.into()
    }

    /// Where a point comes to lie.
    pub fn apply(&self, p: SpacePoint) -> SpacePoint {
        self.move_point(&Vector3::from(p)).into()
    }

    /// The point that comes to lie at `p`.
    pub fn back(&self, p: SpacePoint) -> SpacePoint {
        self.rotation.tr_mul(&(Vector3::from(p) - self.shift)).into()
    }

    /// Where a direction comes to point.
    pub fn turned(&self, v: SpacePoint) -> SpacePoint {
        self.turn(&Vector3::from(v)).into()
    }

    pub(crate) fn move_point(&self, p: &Vector3<f64>) -> Vector3<f64> {
        self.rotation * p + self.shift
    }

    /// See [`Motion::turned`].
    pub(crate) fn turn(&self, v: &Vector3<f64>) -> Vector3<f64> {
        self.rotation * v
    }

    /// This motion, then a small one: the rotation vector of the first three numbers, rad, about `centre`, and the shift
    /// of the last three.
    pub fn then_small(&self, centre: &Vector3<f64>, step: &Vector6<f64>) -> Self {
        let turn = rotation(&step.fixed_rows::<3>(0).into_owned());
        let shift = step.fixed_rows::<3>(3).into_owned();
        let rotation = turn * self.rotation;
        Self { rotation: orthogonal(rotation), shift: turn * (self.shift - centre) + centre + shift }
    }

    /// The angle by which its rotation turns the z axis, rad.
    pub fn lean(&self) -> f64 {
        math::atan2(math::hypot(self.rotation[(0, 2)], self.rotation[(1, 2)]), self.rotation[(2, 2)])
    }
}

/// The rotation of a rotation vector (Rodrigues).
pub(crate) fn rotation(w: &Vector3<f64>) -> Matrix3<f64> {
    let angle = w.norm();
    if angle < 1e-300 {
        return Matrix3::identity();
    }
    let k = (w / angle).cross_matrix();
    let (sin, cos) = math::sin_cos(angle);
    // 1 - cos loses all its digits for small angles.
    let half = math::sin(angle / 2.0);
    let versine = if cos > 0.9 { 2.0 * half * half } else { 1.0 - cos };
    Matrix3::identity() + k * sin + k * k * versine
}

/// The rotation nearest to a matrix that is one but for rounding: its rows made orthogonal, each of length 1.
fn orthogonal(m: Matrix3<f64>) -> Matrix3<f64> {
    // One step of Newton's iteration for the polar factor squares the error (Higham 1986).
    m * (Matrix3::identity() * 3.0 - m.tr_mul(&m)) * 0.5
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_motions_are_right_handed_and_keep_their_centre() {
        let quarter = std::f64::consts::FRAC_PI_2;
        let centre = Vector3::new(1.0, 2.0, 3.0);
        let motion = Motion::shift([0.0; 3]).then_small(&centre, &Vector6::new(0.0, 0.0, quarter, 0.0, 0.0, 0.5));
        let near = |a: SpacePoint, b: SpacePoint| assert!((0..3).all(|k| (a[k] - b[k]).abs() < 1e-12), "{a:?} {b:?}");
        near(motion.apply([1.0, 2.0, 3.0]), [1.0, 2.0, 3.5]);
        near(motion.apply([2.0, 2.0, 3.0]), [1.0, 3.0, 3.5]);
        near(motion.back(motion.apply([7.0, -5.0, 2.0])), [7.0, -5.0, 2.0]);
        let leaning = Motion::shift([0.0; 3]).then_small(&centre, &Vector6::new(1e-3, 0.0, 0.0, 0.0, 0.0, 0.0));
        assert!((leaning.lean() - 1e-3).abs() < 1e-15);
    }

    #[test]
    fn a_rotation_stays_one_over_many_steps() {
        let mut motion = Motion::shift([0.0; 3]);
        for k in 0..10_000 {
            let step = Vector6::new(1e-3, f64::from(k % 7) * 1e-3, -2e-3, 0.1, 0.0, 0.0);
            motion = motion.then_small(&Vector3::new(5.0, 6.0, 7.0), &step);
        }
        let off = motion.rotation.tr_mul(&motion.rotation) - Matrix3::identity();
        assert!(off.amax() < 1e-15, "{off}");
    }
}
