//! Points, vectors and affine maps of space. A drawing is flat, but its entities lie in planes of space: which way a
//! plane faces decides what is mirrored.

use terrace_core::geom::SpacePoint;
use terrace_core::math;

pub(super) const Z: SpacePoint = [0.0, 0.0, 1.0];

/// An affine map: the images of the axes and of the origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SpaceMap {
    axes: [SpacePoint; 3],
    origin: SpacePoint,
}

impl SpaceMap {
    pub(super) const fn scale([x, y, z]: SpacePoint) -> Self {
        Self { axes: [[x, 0.0, 0.0], [0.0, y, 0.0], [0.0, 0.0, z]], origin: [0.0; 3] }
    }

    pub(super) const fn shift(origin: SpacePoint) -> Self {
        Self { axes: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], Z], origin }
    }

    /// A turn about z by an angle in degrees; quarter turns are exact.
    pub(super) fn turn(degrees: f64) -> Self {
        let [c, s] = cos_sin(degrees);
        Self { axes: [[c, s, 0.0], [-s, c, 0.0], Z], origin: [0.0; 3] }
    }

    /// From the coordinates of an entity to those around it: the arbitrary axis algorithm of the DXF reference.
    pub(super) fn of_extrusion(extrusion: SpacePoint) -> Self {
        let Some(n) = unit(extrusion).filter(|&n| n != Z) else { return Self::scale([1.0; 3]) };
        let near_z = n[0].abs() < 1.0 / 64.0 && n[1].abs() < 1.0 / 64.0;
        let x = unit(cross(if near_z { [0.0, 1.0, 0.0] } else { Z }, n)).expect("n is not along that axis");
        Self { axes: [x, cross(n, x), n], origin: [0.0; 3] }
    }

    /// First `o`, then this.
    pub(super) fn after(self, o: Self) -> Self {
        let [x, y, z] = o.axes;
        Self { axes: [self.along(x), self.along(y), self.along(z)], origin: self.at(o.origin) }
    }

    /// The image of a point.
    pub(super) fn at(self, p: SpacePoint) -> SpacePoint {
        add(self.origin, self.along(p))
    }

    /// The image of a vector.
    pub(super) fn along(self, v: SpacePoint) -> SpacePoint {
        let [x, y, z] = self.axes;
        [
            x[0] * v[0] + y[0] * v[1] + z[0] * v[2],
            x[1] * v[0] + y[1] * v[1] + z[1] * v[2],
            x[2] * v[0] + y[2] * v[1] + z[2] * v[2],
        ]
    }

    /// By how much it enlarges lengths of the xy plane at most, seen in plan.
    pub(super) fn enlarges(self) -> f64 {
        let [x, y, _] = self.axes;
        largest_radius([x[0], x[1], 0.0], [y[0], y[1], 0.0])
    }

    pub(super) fn is_finite(self) -> bool {
        self.axes.iter().chain([&self.origin]).flatten().all(|v| v.is_finite())
    }
}

/// The longest radius of the ellipse with these conjugate radii.
pub(super) fn largest_radius(a: SpacePoint, b: SpacePoint) -> f64 {
    let squares = (dot(a, a) + dot(b, b)) / 2.0;
    let area = length(cross(a, b));
    (squares + ((squares - area) * (squares + area)).max(0.0).sqrt()).sqrt()
}

/// Cosine and sine of an angle in degrees, exact for quarter turns.
pub(super) fn cos_sin(degrees: f64) -> [f64; 2] {
    let turn = degrees.rem_euclid(360.0);
    match turn {
        0.0 | 360.0 => [1.0, 0.0],
        90.0 => [0.0, 1.0],
        180.0 => [-1.0, 0.0],
        270.0 => [0.0, -1.0],
        _ => [math::cos(turn.to_radians()), math::sin(turn.to_radians())],
    }
}

pub(super) fn add(a: SpacePoint, b: SpacePoint) -> SpacePoint {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

pub(super) fn sub(a: SpacePoint, b: SpacePoint) -> SpacePoint {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub(super) fn times(a: SpacePoint, s: f64) -> SpacePoint {
    [a[0] * s, a[1] * s, a[2] * s]
}

pub(super) fn dot(a: SpacePoint, b: SpacePoint) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(super) fn cross(a: SpacePoint, b: SpacePoint) -> SpacePoint {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub(super) fn length(a: SpacePoint) -> f64 {
    dot(a, a).sqrt()
}

/// The vector of length 1; None for those without a direction.
pub(super) fn unit(a: SpacePoint) -> Option<SpacePoint> {
    let n = length(a);
    (n > 0.0 && n.is_finite()).then(|| a.map(|v| v / n))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn extrusion_maps_are_right_handed_and_mirror_x_where_it_points_down() {
        let down = SpaceMap::of_extrusion([0.0, 0.0, -1.0]);
        assert_eq!(down.at([10.0, 3.0, 1.0]), [-10.0, 3.0, -1.0]);
        for n in [[1.0, 2.0, 3.0], [0.001, 0.0, 5.0], [0.0, -1.0, 0.0], [0.3, 0.0, -1.0]] {
            let m = SpaceMap::of_extrusion(n);
            let [x, y, z] = m.axes;
            assert!(length(sub(cross(x, y), z)) < 1e-15 && length(sub(z, unit(n).expect("a direction"))) < 1e-15);
        }
        assert_eq!(SpaceMap::of_extrusion([0.0; 3]), SpaceMap::scale([1.0; 3]), "no direction");
    }
}
