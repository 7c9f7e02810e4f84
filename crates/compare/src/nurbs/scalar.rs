//! Numbers to calculate with: plain ones, and ones that count what is done with them.

use std::cell::Cell;
use std::ops::{Add, Div, Mul, Sub};
use terrace_core::math;

/// What the algorithms need of a number.
pub trait Scalar:
    Copy + PartialOrd + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    /// A constant.
    fn of(v: f64) -> Self;
    /// The plain number, for comparisons and roundings: what is done with it is not counted.
    fn value(self) -> f64;
    /// e to its power.
    fn exp(self) -> Self;
}

impl Scalar for f64 {
    fn of(v: f64) -> Self {
        v
    }
    fn value(self) -> f64 {
        self
    }
    fn exp(self) -> Self {
        math::exp(self)
    }
}

thread_local! {
    static OPERATIONS: Cell<u64> = const { Cell::new(0) };
}

/// A number that counts floating-point operations: every sum, difference, product, quotient and exponential is one.
/// Comparisons, roundings to whole numbers and the search of the knot span are none.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub struct Counted(f64);

/// What `work` comes to, and the operations on [`Counted`] numbers that it takes.
pub fn counted<R>(work: impl FnOnce() -> R) -> (R, u64) {
    let before = OPERATIONS.get();
    let out = work();
    (out, OPERATIONS.get() - before)
}

impl Counted {
    /// The result of one operation, which is counted.
    fn done(v: f64) -> Self {
        OPERATIONS.set(OPERATIONS.get() + 1);
        Self(v)
    }
}

impl Scalar for Counted {
    fn of(v: f64) -> Self {
        Self(v)
    }
    fn value(self) -> f64 {
        self.0
    }
    fn exp(self) -> Self {
        Self::done(math::exp(self.0))
    }
}

impl Add for Counted {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self::done(self.0 + other.0)
    }
}

impl Sub for Counted {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self::done(self.0 - other.0)
    }
}

impl Mul for Counted {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        Self::done(self.0 * other.0)
    }
}

impl Div for Counted {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        Self::done(self.0 / other.0)
    }
}
