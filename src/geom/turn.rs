//! Rigid turns of the part in space.

use nalgebra::{Matrix3, Rotation3, Vector3};

/// A turn about a point, nm: what a tilt table does to the part. The turned part is still spoken of in the
/// part's frame, so a turn by nothing changes no coordinate.
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
        let rotation = turns.into_iter().fold(Matrix3::identity(), |all, (axis, angle)| {
            let one = Rotation3::from_axis_angle(&Vector3::ith_axis(axis), angle);
            if angle == 0.0 { all } else { all * one.matrix() }
        });
        let pivot = Vector3::from(pivot);
        Self { rotation, shift: pivot - rotation * pivot }
    }

    /// Where a point of the part comes to lie.
    #[inline]
    pub fn apply(&self, p: [f64; 3]) -> [f64; 3] {
        (self.rotation * Vector3::from(p) + self.shift).into()
    }

    /// The point of the part that comes to lie at `p`.
    #[inline]
    pub fn back(&self, p: [f64; 3]) -> [f64; 3] {
        self.rotation.tr_mul(&(Vector3::from(p) - self.shift)).into()
    }

    /// The sine of the angle by which the part is tilted.
    #[inline]
    pub fn lean(&self) -> f64 {
        self.rotation[(2, 0)].hypot(self.rotation[(2, 1)])
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
        near(turn.apply([0.0, 1.0, 0.0]), [0.0, 0.0, 1.0]);
        near(turn.up(), [0.0, 1.0, 0.0]);
        // About y first, then about x.
        let turn = Turn::about(pivot, [(0, quarter), (1, quarter)]);
        near(turn.apply(pivot), pivot);
        near(turn.apply([pivot[0], pivot[1], pivot[2] + 5.0]), [pivot[0] + 5.0, pivot[1], pivot[2]]);
        for p in [[3e8, -1e8, 2e7], [0.0; 3]] {
            near(turn.back(turn.apply(p)), p);
        }
        assert_eq!(Turn::about(pivot, [(0, 0.0), (1, 0.0)]), Turn::none());
    }
}
