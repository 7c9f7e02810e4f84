//! The basis functions of a B-spline that are not 0 at a parameter, and their derivatives.

use super::Scalar;

/// Highest degree.
pub(super) const MAX_DEGREE: usize = 9;
const MOST: usize = MAX_DEGREE + 1;

/// Basis functions at a parameter.
pub(super) struct Basis<T> {
    /// Number of the first that is not 0.
    pub first: usize,
    /// The functions from `first` on, `degree` more at most: values, first and second derivatives as far as asked for,
    /// else 0.
    pub values: [[T; MOST]; 3],
}

impl<T: Scalar> Basis<T> {
    /// The basis functions of a degree and knots, at `t`, with derivatives up to `ORDER` (The NURBS Book, A2.2 and eq.
    /// 2.7).
    pub fn of<const ORDER: usize>(degree: usize, knots: &[f64], t: T) -> Self {
        let (p, count) = (degree, knots.len() - degree - 1);
        // The last span of the range holds its end too; spans without width hold nothing.
        let (at, end) = (t.value().max(knots[p]), knots[count]);
        let span = knots[p + 1..count].partition_point(|&knot| knot <= at && knot < end) + p;
        let zero = T::of(0.0);
        let mut values = [[zero; MOST]; 3];
        let n = &mut values[0];
        n[0] = T::of(1.0);
        // Basis functions of one degree less over the widths of their supports, and these widths; before that, of two
        // degrees less.
        let (mut shares, mut widths, mut lower) = ([zero; MOST], [zero; MOST], [zero; MOST]);
        for j in 1..=p {
            lower = shares;
            let mut carried = zero;
            for r in 0..j {
                let (right, left) = (T::of(knots[span + r + 1]) - t, t - T::of(knots[span + 1 + r - j]));
                widths[r] = right + left;
                shares[r] = n[r] / widths[r];
                n[r] = carried + right * shares[r];
                carried = left * shares[r];
            }
            n[j] = carried;
        }
        let factor = |degree: usize| T::of(degree as f64);
        let differences = |of: &[T; MOST], degree: usize, r: usize| {
            let before = if r > 0 { of[r - 1] } else { zero };
            let own = if r < degree { of[r] } else { zero };
            factor(degree) * (before - own)
        };
        if ORDER >= 1 {
            for (r, value) in values[1][..=p].iter_mut().enumerate() {
                *value = differences(&shares, p, r);
            }
        }
        if ORDER >= 2 {
            let mut slopes = [zero; MOST];
            for (r, slope) in slopes[..p].iter_mut().enumerate() {
                *slope = differences(&lower, p - 1, r) / widths[r];
            }
            for (r, value) in values[2][..=p].iter_mut().enumerate() {
                *value = differences(&slopes, p, r);
            }
        }
        Self { first: span - p, values }
    }
}
