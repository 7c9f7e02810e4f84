//! Lengths and heights in whole nanometres.

use std::iter::Sum;
use std::ops::{Add, AddAssign, Div, Mul, Neg, Rem, Sub, SubAssign};

use super::{MAX_NM, NM_PER_MM};

/// A length, a height or a coordinate in whole nanometres: a number of them is a length again, the ratio of two
/// is a number.
///
/// ```compile_fail
/// # use terrace::geom::Nm;
/// let depth = Nm(70_000) + 1;
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[repr(transparent)]
pub struct Nm(pub i64);

impl Nm {
    /// No length.
    pub const ZERO: Self = Self(0);
    /// The lowest that can be held.
    pub const MIN: Self = Self(i64::MIN);
    /// The highest that can be held.
    pub const MAX: Self = Self(i64::MAX);

    /// Nearest nanometre to `mm`; None where that is not finite or beyond [`MAX_NM`].
    pub fn from_mm(mm: f64) -> Option<Self> {
        let nm = (mm * NM_PER_MM).round();
        (nm.abs() <= MAX_NM.f64()).then_some(Self(nm as i64))
    }
    /// The nearest to `nm` nanometres, halves away from zero.
    #[inline]
    pub fn round(nm: f64) -> Self {
        Self(nm.round() as i64)
    }
    /// The largest that is not above `nm` nanometres.
    #[inline]
    pub fn floor(nm: f64) -> Self {
        Self(nm.floor() as i64)
    }
    /// The smallest that is not below `nm` nanometres.
    #[inline]
    pub fn ceil(nm: f64) -> Self {
        Self(nm.ceil() as i64)
    }
    /// The length in mm.
    #[inline]
    pub fn mm(self) -> f64 {
        self.f64() / NM_PER_MM
    }
    /// The length in nm.
    #[inline]
    pub const fn f64(self) -> f64 {
        self.0 as f64
    }
    /// The length without its sign.
    #[inline]
    #[must_use]
    pub const fn abs(self) -> Self {
        Self(self.0.abs())
    }
    /// How often `by` fits into it, rounded down where `by` is above zero.
    #[inline]
    pub const fn div_euclid(self, by: Self) -> i64 {
        self.0.div_euclid(by.0)
    }
    /// What is left of it then: from zero to below `by`.
    #[inline]
    #[must_use]
    pub const fn rem_euclid(self, by: Self) -> Self {
        Self(self.0.rem_euclid(by.0))
    }
    /// Both together; not above [`Nm::MAX`].
    #[inline]
    #[must_use]
    pub const fn saturating_add(self, o: Self) -> Self {
        Self(self.0.saturating_add(o.0))
    }
    /// What is left of it less another; not below [`Nm::MIN`].
    #[inline]
    #[must_use]
    pub const fn saturating_sub(self, o: Self) -> Self {
        Self(self.0.saturating_sub(o.0))
    }
    /// The next lower multiple of `step`; the length itself if it is one.
    #[inline]
    #[must_use]
    pub const fn down_to(self, step: Self) -> Self {
        Self(self.0 - self.0.rem_euclid(step.0))
    }
}

impl Add for Nm {
    type Output = Self;
    #[inline]
    fn add(self, o: Self) -> Self {
        Self(self.0 + o.0)
    }
}

impl Sub for Nm {
    type Output = Self;
    #[inline]
    fn sub(self, o: Self) -> Self {
        Self(self.0 - o.0)
    }
}

impl Neg for Nm {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        Self(-self.0)
    }
}

impl AddAssign for Nm {
    #[inline]
    fn add_assign(&mut self, o: Self) {
        self.0 += o.0;
    }
}

impl SubAssign for Nm {
    #[inline]
    fn sub_assign(&mut self, o: Self) {
        self.0 -= o.0;
    }
}

impl Mul<i64> for Nm {
    type Output = Self;
    #[inline]
    fn mul(self, n: i64) -> Self {
        Self(self.0 * n)
    }
}

impl Div<i64> for Nm {
    type Output = Self;
    /// Rounded towards zero.
    #[inline]
    fn div(self, n: i64) -> Self {
        Self(self.0 / n)
    }
}

impl Div for Nm {
    type Output = i64;
    /// How often the other fits into it, rounded towards zero.
    #[inline]
    fn div(self, o: Self) -> i64 {
        self.0 / o.0
    }
}

impl Rem for Nm {
    type Output = Self;
    #[inline]
    fn rem(self, o: Self) -> Self {
        Self(self.0 % o.0)
    }
}

impl Sum for Nm {
    fn sum<I: Iterator<Item = Self>>(lengths: I) -> Self {
        Self(lengths.map(|length| length.0).sum())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nanometres_refuse_non_finite_and_huge_values() {
        assert_eq!(Nm::from_mm(0.0000004), Some(Nm(0)));
        assert_eq!(Nm::from_mm(-0.07), Some(Nm(-70_000)));
        for bad in [f64::NAN, f64::INFINITY, 1e30] {
            assert_eq!(Nm::from_mm(bad), None);
        }
    }

    #[test]
    fn the_ratio_of_two_lengths_is_a_number() {
        let (pitch, size) = (Nm(30), Nm(-70));
        assert_eq!((size / pitch, size.div_euclid(pitch), size.rem_euclid(pitch)), (-2, -3, Nm(20)));
        assert_eq!((size / 2, size * 3, size % pitch, size.down_to(pitch)), (Nm(-35), Nm(-210), Nm(-10), Nm(-90)));
    }
}
