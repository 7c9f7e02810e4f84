//! Points, boxes and predicates on the nanometre grid.
//!
//! Everything in the plane of the part is an integer number of nanometres, held as `i64` for the part
//! and as `i32` inside a block (2.1 m either way). Predicates are exact. mm appear only where a file
//! is read or written, and z stays `f64` until a mark is made of it.

mod box_mm;
mod buckets;
mod correction;
mod field;
mod frame;
mod grid;
mod nm;
mod pose;
mod stroke;
mod turn;

pub use box_mm::BoxMm;
pub use buckets::{Buckets, counting_sort};
pub use correction::{Corrected, Correction, Linear};
pub use field::{ControllerPoint, FieldPoint};
pub use frame::{Controller, P3, P3Mm, Part, Turned, UnitVector};
pub use grid::Grid;
pub use nm::Nm;
pub use pose::Pose;
pub use stroke::Strokes;
pub use turn::Turn;

use std::fmt;
use std::marker::PhantomData;

use nalgebra::Point3;

use crate::math;

/// A point of a drawing: x and y in the unit of the module.
pub type PlanePoint = [f64; 2];

/// A point in space, or a vector: x, y and z in the unit of the module.
pub type SpacePoint = [f64; 3];

/// Nanometres in a millimetre.
pub const NM_PER_MM: f64 = 1e6;

/// The largest coordinate that is accepted, 4 m: far beyond any stage, far below any overflow.
pub const MAX_NM: Nm = Nm(4_000_000_000);

/// A point in the plane, in nm, of the part as it is drawn unless another frame is named.
///
/// ```compile_fail
/// # use terrace::geom::{P2, Turned};
/// let drawn: P2 = P2::new(0, 0);
/// let centre: P2<Turned> = drawn;
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Default)]
pub struct P2<F = Part> {
    /// x in nm.
    pub x: i64,
    /// y in nm.
    pub y: i64,
    frame: PhantomData<F>,
}

impl<F> P2<F> {
    /// The point (x, y), in nm.
    pub const fn new(x: i64, y: i64) -> Self {
        Self { x, y, frame: PhantomData }
    }
    /// The point in mm.
    pub fn mm(self) -> [f64; 2] {
        [mm_from_nm(self.x), mm_from_nm(self.y)]
    }
    /// The nearest grid point to (x, y) mm; None where that is not finite or beyond [`MAX_NM`].
    pub fn from_mm(x: f64, y: f64) -> Option<Self> {
        Some(Self::new(Nm::from_mm(x)?.0, Nm::from_mm(y)?.0))
    }
    /// Distance to `o` in nm.
    pub fn distance(self, o: Self) -> f64 {
        (((o.x - self.x) as f64).powi(2) + ((o.y - self.y) as f64).powi(2)).sqrt()
    }
    /// The grid point nearest to the point at parameter `t` (0 to 1) of the segment from `self` to `o`.
    pub fn lerp(self, o: Self, t: f64) -> Self {
        let between = |a: i64, b: i64| a + nearest((b - a) as f64 * t);
        Self::new(between(self.x, o.x), between(self.y, o.y))
    }
}

impl<F> fmt::Debug for P2<F> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("P2").field("x", &self.x).field("y", &self.y).finish()
    }
}

/// A box in the plane, borders included, in nm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Box2<F = Part> {
    /// Lower corner.
    pub lo: P2<F>,
    /// Upper corner.
    pub hi: P2<F>,
}

impl<F> Box2<F> {
    /// The box that holds nothing; grows with [`Box2::add`].
    pub const EMPTY: Self = Self { lo: P2::new(i64::MAX, i64::MAX), hi: P2::new(i64::MIN, i64::MIN) };

    /// The box that reaches `half` beyond `centre` along x and y.
    #[inline]
    pub const fn around(centre: P2<F>, [x, y]: [Nm; 2]) -> Self
    where
        F: Copy,
    {
        Self { lo: P2::new(centre.x - x.0, centre.y - y.0), hi: P2::new(centre.x + x.0, centre.y + y.0) }
    }
    /// Grows the box to hold `p`.
    pub fn add(&mut self, p: P2<F>) {
        self.lo = P2::new(self.lo.x.min(p.x), self.lo.y.min(p.y));
        self.hi = P2::new(self.hi.x.max(p.x), self.hi.y.max(p.y));
    }
    /// The smallest box that holds both.
    #[must_use]
    pub fn union(mut self, o: Self) -> Self {
        if !o.is_empty() {
            self.add(o.lo);
            self.add(o.hi);
        }
        self
    }
    /// Whether nothing was added yet.
    pub fn is_empty(&self) -> bool {
        self.lo.x > self.hi.x || self.lo.y > self.hi.y
    }
    /// Whether `p` lies inside or on the border.
    pub fn holds(&self, p: P2<F>) -> bool {
        self.lo.x <= p.x && p.x <= self.hi.x && self.lo.y <= p.y && p.y <= self.hi.y
    }
    /// Extents along x and y.
    pub fn size(&self) -> [Nm; 2] {
        [Nm(self.hi.x - self.lo.x), Nm(self.hi.y - self.lo.y)]
    }
}

/// The whole number nearest to `v`, halves away from zero, without the call that `f64::round` is on
/// plain x86-64. Beyond 2^52, and for the largest number below a half, it may be off by one.
#[inline]
pub fn nearest(v: f64) -> i64 {
    (v + 0.5f64.copysign(v)) as i64
}

/// A coordinate in nm as mm.
pub fn mm_from_nm(nm: i64) -> f64 {
    nm as f64 / NM_PER_MM
}

/// Twice the signed area of (a, b, c): positive where c lies left of the line from a to b. Its sign
/// is exact; its value is the exact one rounded once.
#[inline]
pub fn orient(a: P2, b: P2, c: P2) -> f64 {
    let (abx, aby) = (b.x - a.x, b.y - a.y);
    let (acx, acy) = (c.x - a.x, c.y - a.y);
    // Differences are below 2^34, so each product below 2^68 needs f64 with a filter or i128.
    let l = abx as f64 * acy as f64;
    let r = aby as f64 * acx as f64;
    let det = l - r;
    if det.abs() > 4.0 * f64::EPSILON * (l.abs() + r.abs()) {
        return det;
    }
    (i128::from(abx) * i128::from(acy) - i128::from(aby) * i128::from(acx)) as f64
}

/// Length in mm of a polyline given in nm.
pub fn length_mm(points: &[P2]) -> f64 {
    points.windows(2).map(|w| w[0].distance(w[1])).sum::<f64>() / NM_PER_MM
}

/// Square of the slope (tangent of the angle to the horizontal) of the plane through three points that
/// do not stand upright.
pub fn slope2(corners: [Point3<f64>; 3]) -> f64 {
    let [a, b, c] = corners;
    let n = (b - a).cross(&(c - a));
    n.xy().norm_squared() / (n.z * n.z)
}

/// The normal of the plane through three points that do not stand upright: upwards, of length 1.
pub fn normal(corners: [Point3<f64>; 3]) -> [f64; 3] {
    let [a, b, c] = corners;
    let n = (b - a).cross(&(c - a)).normalize();
    (n * n.z.signum()).into()
}

/// Cosine and sine of an angle, exact for multiples of 90 degrees.
pub fn cos_sin(rad: f64) -> [f64; 2] {
    let quarters = rad / std::f64::consts::FRAC_PI_2;
    // Degrees turned into radians miss a quarter turn by one ulp or so.
    if (quarters - quarters.round()).abs() <= 4.0 * f64::EPSILON * quarters.abs().max(1.0) {
        return match quarters.round().rem_euclid(4.0) as u8 {
            0 => [1.0, 0.0],
            1 => [0.0, 1.0],
            2 => [-1.0, 0.0],
            _ => [0.0, -1.0],
        };
    }
    let (s, c) = math::sin_cos(rad);
    [c, s]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn orientation_is_exact_where_floats_cancel() {
        let a: P2 = P2::new(-3_999_999_999, -3_999_999_998);
        let b = P2::new(3_999_999_998, 3_999_999_999);
        // One nm off the line of 11 m: the two products agree in their first 19 digits.
        for dy in -2..=2 {
            let c = P2::new(0, dy);
            let exact = i128::from(b.x - a.x) * i128::from(c.y - a.y) - i128::from(b.y - a.y) * i128::from(c.x - a.x);
            assert_eq!(orient(a, b, c).partial_cmp(&0.0), Some(exact.cmp(&0)), "dy {dy}");
        }
    }
}
