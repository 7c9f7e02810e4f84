//! How a job lays its part, by the verifier's own arithmetic: each rotation turns points in a plane.

use terrace_core::geom::{SpacePoint, cos_sin};
use terrace_core::math;
use terrace_input::job::Attitude;

/// The rotation from the surface file to the part frame.
pub(super) enum Rotation {
    /// About x, y and z, in this order: cosine and sine of each.
    Axes([[f64; 2]; 3]),
    /// About an axis in the plane of x and y, of length 1, by an angle of this cosine and sine.
    Tilt([f64; 2], [f64; 2]),
}

impl Rotation {
    /// The rotation of a job that was accepted.
    pub(super) fn new(laid: &Attitude) -> Self {
        let up = match *laid {
            Attitude::Rotated(angles) => return Self::Axes(angles.map(|a| cos_sin(a.as_rad()))),
            Attitude::Up(up) => up,
            Attitude::Level([a, b, c]) => {
                let [u, v] = [b, c].map(|p| [p[0] - a[0], p[1] - a[1], p[2] - a[2]]);
                [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
            }
        };
        let [x, y, z] = up;
        let (level, whole) = (math::hypot(x, y), math::hypot(math::hypot(x, y), z));
        if level < 1e-12 * whole {
            return Self::Tilt([1.0, 0.0], [z.signum(), 0.0]);
        }
        // The axis stands at a right angle on the direction, as its shadow in the plane does.
        Self::Tilt([y / level, -x / level], [z / whole, level / whole])
    }

    pub(super) fn facet(&self, facet: [SpacePoint; 3]) -> [SpacePoint; 3] {
        facet.map(|p| self.point(p))
    }

    pub(super) fn point(&self, [x, y, z]: SpacePoint) -> SpacePoint {
        match self {
            Self::Axes([about_x, about_y, about_z]) => {
                let turn = |[c, s]: [f64; 2], u: f64, v: f64| [c * u - s * v, s * u + c * v];
                let [y, z] = turn(*about_x, y, z);
                let [z, x] = turn(*about_y, z, x);
                let [x, y] = turn(*about_z, x, y);
                [x, y, z]
            }
            Self::Tilt([a, b], [c, s]) => {
                // Along the axis nothing changes; across it the point turns with z.
                let (along, across) = (x * a + y * b, y * a - x * b);
                let (across, z) = (c * across - s * z, s * across + c * z);
                [along * a - across * b, along * b + across * a, z]
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrace_core::random::Random;
    use terrace_core::units::Angle;

    #[test]
    fn it_is_the_rotation_of_the_compiler() {
        for seed in 0..500 {
            let mut noise = Random::case(seed);
            let mut point = || [0; 3].map(|_| noise.range(-100.0, 100.0));
            let (up, points, p) = (point(), [point(), point(), point()], point());
            let angles = point().map(|v| format!("{v} deg").parse::<Angle>().expect("an angle"));
            for laid in [
                Attitude::Rotated(angles),
                Attitude::Up(up),
                Attitude::Level(points),
                Attitude::Up([0.0, 0.0, -1.0]),
                Attitude::Up([0.0, 0.0, 3.0]),
            ] {
                let (own, other) = (Rotation::new(&laid).point(p), laid.pose().expect("a rotation").apply(p));
                assert!(own.iter().zip(other).all(|(a, b)| (a - b).abs() < 1e-10), "{laid:?}: {own:?} {other:?}");
            }
        }
    }
}
