//! The Gaussian filter.

use super::at_or_end;
use terrace_core::math;

/// Weights reach this many standard deviations out.
const REACH: f64 = 4.0;

/// Means under the weights of a normal distribution of `sigma` samples, ends repeated.
pub(super) fn gaussian<const N: usize>(path: &[[f64; N]], sigma: f64) -> Vec<[f64; N]> {
    if !(sigma > 0.0 && sigma.is_finite()) {
        return path.to_vec();
    }
    let reach = (REACH * sigma + 0.5).floor() as usize;
    let mut weights: Vec<f64> = (0..=reach).map(|i| math::exp(-0.5 * (i as f64 / sigma).powi(2))).collect();
    let sum = weights[0] + 2.0 * weights[1..].iter().sum::<f64>();
    weights.iter_mut().for_each(|w| *w /= sum);
    let longer = lengthened(path, reach, |i| *at_or_end(path, i));
    symmetric(&longer, &weights)
}

/// The path with `by` samples more at both ends.
fn lengthened<const N: usize>(path: &[[f64; N]], by: usize, sample: impl Fn(isize) -> [f64; N]) -> Vec<[f64; N]> {
    (-(by as isize)..(path.len() + by) as isize).map(sample).collect()
}

/// Sums under weights that are the same to both sides, of a path lengthened by as many samples as there are weights
/// next to the middle one.
fn symmetric<const N: usize>(longer: &[[f64; N]], weights: &[f64]) -> Vec<[f64; N]> {
    // Several sums at a time: the additions of one depend on each other, those of different ones do not.
    const TOGETHER: usize = 8;
    let reach = weights.len() - 1;
    let mut out: Vec<[f64; N]> = vec![[0.0; N]; longer.len() - 2 * reach];
    for (at, sums) in (0..).step_by(TOGETHER).zip(out.chunks_mut(TOGETHER)) {
        // Small weights first.
        for (i, weight) in weights.iter().enumerate().rev() {
            for (j, sum) in sums.iter_mut().enumerate() {
                let middle = at + j + reach;
                let (left, right) = (&longer[middle - i], &longer[middle + i]);
                for k in 0..N {
                    sum[k] += weight * if i > 0 { left[k] + right[k] } else { left[k] };
                }
            }
        }
    }
    out
}
