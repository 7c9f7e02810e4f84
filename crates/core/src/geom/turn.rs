//! Rigid turns of the part in space.

use super::{P2, P3, Turned};
use crate::math;
use nalgebra::{Matrix3, Rotation3, Vector3};

/// A turn about a point, nm: what a tilt table does to the part, or how a head that is tilted sees it. The
/// turned part is still spoken of in the part's frame, so a turn by nothing changes no coordinate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Turn {
    rotation: Matrix3<f64>,
    shift: Vector3<f64>,
}

impl Turn {
    /// The turn by nothing.
    pub fn none() -> Self {
        Self { rotation: Matrix3::identity(), shift: Vector3::zeros() }
    }

    /// Turns about the x, y or z axis (0, 1, 2) through `pivot` by angles in radians, right-handed; the
    /// last of them first.
    pub fn about(pivot: [f64; 3], turns: impl IntoIterator<Item = (usize, f64)>) -> Self {
        let rotation = turns.into_iter().fold(Matrix3::identity(), |product, (axis, angle)| {
            let turn = Rotation3::from_axis_angle(&Vector3::ith_axis(axis), angle);
            if angle == 0.0 { product } else { product * turn.matrix() }
        });
        let pivot = Vector3::from(pivot);
        Self { rotation, shift: pivot - rotation * pivot }
    }

    /// A rotation of these rows about the origin, then a shift, nm.
    pub fn rigid(rows: [[f64; 3]; 3], shift: [f64; 3]) -> Self {
        Self { rotation: Matrix3::from_fn(|i, k| rows[i][k]), shift: Vector3::from(shift) }
    }

    /// Where a point of the part comes to lie.
    #[inline]
    pub fn apply(&self, p: P3) -> P3<Turned> {
        P3::new((self.rotation * Vector3::from(p.at) + self.shift).into())
    }

    /// The point of the part that comes to lie at `p`.
    #[inline]
    pub fn back(&self, p: P3<Turned>) -> P3 {
        P3::new(self.rotation.tr_mul(&(Vector3::from(p.at) - self.shift)).into())
    }

    /// A point of the part as one of the turned part, where the part is not tilted.
    #[inline]
    pub const fn upright(p: P2) -> P2<Turned> {
        P2::new(p.x, p.y)
    }

    /// A point in space as one of the turned part, where the part is not tilted.
    #[inline]
    pub const fn upright_in_space(p: P3) -> P3<Turned> {
        P3::new(p.at)
    }

    /// The point of the part under one of a part that is not tilted: the inverse of [`Turn::upright`].
    #[inline]
    pub const fn drawn(p: P2<Turned>) -> P2 {
        P2::new(p.x, p.y)
    }

    /// The directions in the part that come to point along x, y and z; each of length 1.
    pub fn rows(&self) -> [[f64; 3]; 3] {
        [0, 1, 2].map(|k| self.rotation.row(k).transpose().into())
    }

    /// The sine of the angle by which the part is tilted.
    #[inline]
    pub fn lean(&self) -> f64 {
        math::hypot(self.rotation[(2, 0)], self.rotation[(2, 1)])
    }

    /// Square of the tangent of the angle between the beam and the normal of a surface (of length 1, part
    /// frame); infinite where it looks away.
    pub fn slope2(&self, normal: [f64; 3]) -> f64 {
        let cos: f64 = normal.iter().zip(self.up()).map(|(n, u)| n * u).sum();
        if cos > 0.0 { (1.0 / (cos * cos) - 1.0).max(0.0) } else { f64::INFINITY }
    }

    /// The direction in the part that comes to point along z, to the lens; of length 1.
    pub fn up(&self) -> [f64; 3] {
        self.rotation.row(2).transpose().into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turns_are_right_handed_keep_the_pivot_and_can_be_undone() {
        let pivot = [1e6, -2e6, 3e6];
        let quarter = std::f64::consts::FRAC_PI_2;
        let near =
            |a: [f64; 3], b: [f64; 3]| assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6), "{a:?} {b:?}");
        let turn = Turn::about([0.0; 3], [(0, quarter)]);
        near(turn.apply(P3::new([0.0, 1.0, 0.0])).at, [0.0, 0.0, 1.0]);
        near(turn.up(), [0.0, 1.0, 0.0]);
        // About y first, then about x.
        let turn = Turn::about(pivot, [(0, quarter), (1, quarter)]);
        near(turn.apply(P3::new(pivot)).at, pivot);
        near(turn.apply(P3::new([pivot[0], pivot[1], pivot[2] + 5.0])).at, [pivot[0] + 5.0, pivot[1], pivot[2]]);
        for p in [[3e8, -1e8, 2e7], [0.0; 3]] {
            near(turn.back(turn.apply(P3::new(p))).at, p);
        }
        assert_eq!(Turn::about(pivot, [(0, 0.0), (1, 0.0)]), Turn::none());
    }
}
