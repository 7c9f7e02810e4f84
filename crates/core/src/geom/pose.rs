//! How a part is laid under the lens: a rotation of what its file holds.

use crate::math;
use nalgebra::{Matrix3, Unit, Vector3};

use super::cos_sin;

/// A rotation about the origin, from the frame of the file to that of the part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose(Matrix3<f64>);

impl Pose {
    /// Rotations about the x, then the y, then the z axis of the file, rad, right-handed; quarter turns are exact.
    pub fn from_angles([x, y, z]: [f64; 3]) -> Self {
        let [[cx, sx], [cy, sy], [cz, sz]] = [x, y, z].map(cos_sin);
        let about_x = Matrix3::new(1.0, 0.0, 0.0, 0.0, cx, -sx, 0.0, sx, cx);
        let about_y = Matrix3::new(cy, 0.0, sy, 0.0, 1.0, 0.0, -sy, 0.0, cy);
        let about_z = Matrix3::new(cz, -sz, 0.0, sz, cz, 0.0, 0.0, 0.0, 1.0);
        Self(about_z * about_y * about_x)
    }

    /// The least rotation that makes a direction of the file look at the lens; half a turn about x where it looks away.
    /// None where it has no length.
    pub fn from_up(direction: [f64; 3]) -> Option<Self> {
        let up = Unit::try_new(Vector3::from(direction), 1e-12)?;
        let axis = up.cross(&Vector3::z());
        let (sin, cos) = (axis.norm(), up.z);
        if sin < 1e-12 {
            return Some(if cos > 0.0 {
                Self(Matrix3::identity())
            } else {
                Self(Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, -1.0)))
            });
        }
        let k = (axis / sin).cross_matrix();
        Some(Self(Matrix3::identity() + k * sin + k * k * (1.0 - cos)))
    }

    /// The least rotation that makes the plane through three points level; they run counter-clockwise as the lens sees
    /// them. None where they lie on one line.
    pub fn from_plane([a, b, c]: [[f64; 3]; 3]) -> Option<Self> {
        let [a, b, c] = [a, b, c].map(Vector3::from);
        let (u, v) = (b - a, c - a);
        let normal = u.cross(&v);
        (normal.norm() > 1e-9 * u.norm() * v.norm()).then(|| Self::from_up(normal.into()))?
    }

    /// First this, then `next`.
    pub fn then(self, next: Self) -> Self {
        Self(next.0 * self.0)
    }

    /// Where a point of the file comes to lie.
    #[inline]
    pub fn apply(&self, p: [f64; 3]) -> [f64; 3] {
        (self.0 * Vector3::from(p)).into()
    }

    /// The rotations of the pose about x, y and z, in the order of [`Pose::from_angles`], rad.
    pub fn angles(&self) -> [f64; 3] {
        let m = &self.0;
        let y = math::asin((-m[(2, 0)]).clamp(-1.0, 1.0));
        if m[(2, 0)].abs() > 1.0 - 1e-12 {
            // x and z turn about one line: all of it is given to x.
            return [math::atan2(-m[(1, 2)], m[(1, 1)]), y, 0.0];
        }
        [math::atan2(m[(2, 1)], m[(2, 2)]), y, math::atan2(m[(1, 0)], m[(0, 0)])]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    fn assert_near(a: [f64; 3], b: [f64; 3]) {
        assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9), "{a:?} {b:?}");
    }

    #[test]
    fn quarter_turns_are_exact_and_in_order() {
        let quarter = std::f64::consts::FRAC_PI_2;
        assert_eq!(Pose::from_angles([quarter, 0.0, 0.0]).apply([1.0, 2.0, 3.0]), [1.0, -3.0, 2.0]);
        assert_eq!(Pose::from_angles([0.0, quarter, 0.0]).apply([1.0, 2.0, 3.0]), [3.0, 2.0, -1.0]);
        assert_eq!(Pose::from_angles([0.0, 0.0, quarter]).apply([1.0, 2.0, 3.0]), [-2.0, 1.0, 3.0]);
        // About x first: y goes to z, and z to -y, which the turn about z makes x.
        assert_eq!(Pose::from_angles([quarter, 0.0, quarter]).apply([0.0, 0.0, 1.0]), [1.0, 0.0, 0.0]);
    }

    #[test]
    fn a_direction_looks_at_the_lens_and_lengths_stay() {
        for seed in 0..200 {
            let mut noise = Random::case(seed);
            let d = [0; 3].map(|_| noise.range(-1.0, 1.0));
            let pose = Pose::from_up(d).expect("a direction");
            let length = d.iter().map(|v| v * v).sum::<f64>().sqrt();
            assert_near(pose.apply(d), [0.0, 0.0, length]);
            // The same rotation by its angles.
            let again = Pose::from_angles(pose.angles());
            let p = [0; 3].map(|_| noise.range(-1.0, 1.0));
            assert_near(pose.apply(p), again.apply(p));
        }
        assert_eq!(Pose::from_up([0.0, 0.0, -2.0]).expect("down").apply([1.0, 2.0, 3.0]), [1.0, -2.0, -3.0]);
        assert_eq!(Pose::from_up([0.0; 3]), None);
        for half in [[0.3, std::f64::consts::FRAC_PI_2, 0.0], [1.2, -std::f64::consts::FRAC_PI_2, 0.4]] {
            let pose = Pose::from_angles(half);
            let again = Pose::from_angles(pose.angles());
            assert_near(pose.apply([1.0, 2.0, 3.0]), again.apply([1.0, 2.0, 3.0]));
        }
    }

    #[test]
    fn three_points_become_level_on_the_side_that_they_run_about() {
        let points = [[1.0, 0.0, 0.0], [1.0, 5.0, 0.0], [1.0, 5.0, 2.0]];
        let pose = Pose::from_plane(points).expect("a plane");
        let [a, b, c] = points.map(|p| pose.apply(p));
        assert!((a[2] - b[2]).abs() < 1e-12 && (a[2] - c[2]).abs() < 1e-12);
        assert!((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) > 0.0);
        assert_eq!(Pose::from_plane([[0.0; 3], [1.0, 1.0, 1.0], [2.0, 2.0, 2.0]]), None);
    }
}
