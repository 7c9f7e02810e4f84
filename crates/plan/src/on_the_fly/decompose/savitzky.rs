//! The filter of Savitzky and Golay: around each sample the polynomial of least squares, taken at that sample.

use super::gauss::{lengthened, symmetric};

/// Fits over `samples` of degree `order`. Beyond its ends the path continues as if turned about them by half
/// a turn, which keeps its direction there.
pub(super) fn savitzky_golay<const N: usize>(path: &[[f64; N]], samples: usize, order: usize) -> Vec<[f64; N]> {
    let n = path.len();
    // No fit reaches further than the turned path goes.
    let half = (samples / 2).min(n - 1);
    let longer = lengthened(path, half, |i| {
        let last = n as isize - 1;
        let about = |end: isize, i: isize| {
            std::array::from_fn(|k| 2.0 * path[end as usize][k] - path[(2 * end - i) as usize][k])
        };
        match i {
            i if i < 0 => about(0, i),
            i if i > last => about(last, i),
            i => path[i as usize],
        }
    });
    symmetric(&longer, &weights(half, order))
}

/// Weights of the middle sample and those to one side.
///
/// By polynomials that are orthogonal over the samples (Gram's), from their three-term recurrence: normal
/// equations of powers would lose all digits at some hundred samples.
fn weights(half: usize, order: usize) -> Vec<f64> {
    let at: Vec<f64> = (0..=half).map(|i| i as f64 / half.max(1) as f64).collect();
    // A product of two polynomials that are both even or both odd, summed over all samples.
    let norm = |q: &[f64]| q[0] * q[0] + 2.0 * q[1..].iter().map(|v| v * v).sum::<f64>();
    let (mut before, mut now) = (vec![0.0; half + 1], vec![1.0; half + 1]);
    let mut before_norm = 1.0;
    let mut out = vec![0.0; half + 1];
    // The weight of sample t in the fit at 0 is Σ qₖ(0) qₖ(t) / |qₖ|² over the orthogonal polynomials qₖ, with
    // qₖ₊₁ = t qₖ - (|qₖ|² / |qₖ₋₁|²) qₖ₋₁: the middle factor of the recurrence is zero, samples lie even about 0.
    for degree in 0..=order.min(2 * half) {
        let now_norm = norm(&now);
        // Odd ones are 0 in the middle.
        if degree % 2 == 0 {
            out.iter_mut().zip(&now).for_each(|(w, q)| *w += now[0] * q / now_norm);
        }
        let share = if degree == 0 { 0.0 } else { now_norm / before_norm };
        let next = at.iter().zip(&now).zip(&before).map(|((t, q), p)| t * q - share * p).collect();
        (before, now) = (now, next);
        before_norm = now_norm;
    }
    out
}
