//! Paths of least acceleration inside a corridor.

use crate::on_the_fly::banded_qp::{Band, Row, minimise};

/// How near to the least the sum of squares is taken, as a share of what the corridor's walls push.
const NEAR: f64 = 1e-6;

/// The path of least summed squared second differences that stays within `half` of `path`, per coordinate.
pub(super) fn least_acceleration<const N: usize>(path: &[[f64; N]], half: [f64; N]) -> Vec<[f64; N]> {
    let mut out = path.to_vec();
    for k in 0..N {
        let along: Vec<f64> = path.iter().map(|x| x[k]).collect();
        let ends: Vec<[f64; 2]> = along.iter().map(|x| [x - half[k], x + half[k]]).collect();
        for (x, value) in out.iter_mut().zip(within(along, &[], &ends)) {
            x[k] = value;
        }
    }
    out
}

/// The values of least summed squared second differences between two ends of their own for every sample (infinite
/// ones do not bind), from a start strictly between them; a sample that does not start so stays free.
///
/// `steps` are the lengths from sample to sample, none where they are even: then second differences are divided ones.
pub fn within(start: Vec<f64>, steps: &[f64], ends: &[[f64; 2]]) -> Vec<f64> {
    let rows =
        start.iter().zip(ends).enumerate().map(|(at, (x, [lo, hi]))| Row { at, a: [1.0], lo: lo - x, hi: hi - x });
    let moved = least_from::<1, 1>(&start, steps, rows.collect(), usual(ends));
    clamped(&start, &moved, ends)
}

/// The values of least summed squared second differences between two ends of their own for every sample, as [`within`],
/// where first and second differences must not be larger than `most`, those of the start included.
pub fn paced(start: &[f64], ends: &[[f64; 2]], most: [f64; 2]) -> Vec<f64> {
    let [first, second] = most;
    let mut rows: Vec<Row<3>> = Vec::with_capacity(3 * start.len());
    for (at, (x, [lo, hi])) in start.iter().zip(ends).enumerate() {
        rows.push(Row { at, a: [1.0, 0.0, 0.0], lo: lo - x, hi: hi - x });
        if let Some(y) = start.get(at + 1) {
            let own = y - x;
            rows.push(Row { at, a: [-1.0, 1.0, 0.0], lo: -first - own, hi: first - own });
            if let Some(z) = start.get(at + 2) {
                let own = (z - y) - own;
                rows.push(Row { at, a: [1.0, -2.0, 1.0], lo: -second - own, hi: second - own });
            }
        }
    }
    let moved = least_from::<1, 3>(start, &[], rows, usual(ends));
    clamped(start, &moved, ends)
}

/// Size of moves: some part of a usual corridor's width; where all are open, of a radian.
fn usual(ends: &[[f64; 2]]) -> f64 {
    let finite = |[lo, hi]: &[f64; 2]| Some(hi - lo).filter(|w| w.is_finite());
    let (sum, count) = ends.iter().filter_map(finite).fold((0.0, 0), |(s, n), w| (s + w, n + 1));
    if count == 0 { 1.0 } else { 0.5 * sum / f64::from(count) }
}

/// The moved start; rounding of the sum must not pass an end.
fn clamped(start: &[f64], moved: &[f64], ends: &[[f64; 2]]) -> Vec<f64> {
    start.iter().zip(moved).zip(ends).map(|((x, d), [lo, hi])| (x + d).max(*lo).min(*hi)).collect()
}

/// How unknowns move from `start` for the least sum of squared second differences under rows that speak of
/// the move, which is of the size of `usual`. `L` coordinates lie one after the other in each sample; `steps` as in
/// [`within`].
///
/// The move is the unknown, not the place: tolerances are taken from the size of the unknowns, and where the part lies
/// must not matter. It is counted from -`usual`, so that it does not begin at nothing.
pub(super) fn least_from<const L: usize, const W: usize>(
    start: &[f64],
    steps: &[f64],
    mut rows: Vec<Row<W>>,
    usual: f64,
) -> Vec<f64> {
    let seconds = seconds(start.len() / L, steps);
    let bends: Vec<f64> = (2 * L..start.len()).map(|i| second_difference::<L>(&seconds, start, i)).collect();
    let begin: f64 = bends.iter().map(|d| d * d).sum();
    if begin == 0.0 || start.len() < 3 * L {
        return vec![0.0; start.len()];
    }
    // The measure begins at a number that is large against the 1 in the tolerance.
    let measure = SquaredBends::<L> { seconds, bends, weight: 1e6 / begin };
    for row in &mut rows {
        let shift: f64 = row.a.iter().map(|a| a * usual).sum();
        row.lo += shift;
        row.hi += shift;
    }
    let add = |x: &[f64], gradient: &mut [f64], matrix: &mut Band| measure.add(x, gradient, matrix);
    let mut moved = minimise(vec![usual; start.len()], 2 * L, &rows, add, NEAR);
    moved.iter_mut().for_each(|x| *x -= usual);
    moved
}

/// The divided second difference that ends at value `i`, of `L` coordinates that lie one after the other in each
/// sample.
#[inline]
fn second_difference<const L: usize>(seconds: &[[f64; 3]], x: &[f64], i: usize) -> f64 {
    let [a, _, c] = seconds[i / L - 2];
    a * (x[i - 2 * L] - x[i - L]) + c * (x[i] - x[i - L])
}

/// Half the weighted sum of squared second differences after a move, as a function of the move.
struct SquaredBends<const L: usize> {
    /// Factors of the second differences.
    seconds: Vec<[f64; 3]>,
    /// Second differences before the move.
    bends: Vec<f64>,
    weight: f64,
}

impl<const L: usize> SquaredBends<L> {
    /// Adds its gradient and its second derivatives at a move.
    #[inline]
    fn add(&self, x: &[f64], gradient: &mut [f64], matrix: &mut Band) {
        // ½ Σ d² with d = a x[i - 2L] + b x[i - L] + c x[i]: its gradient is d (a, b, c), its matrix the outer product.
        for i in 2 * L..x.len() {
            let d = self.weight * (self.bends[i - 2 * L] + second_difference::<L>(&self.seconds, x, i));
            let [a, b, c] = self.seconds[i / L - 2];
            let terms = [(i - 2 * L, a), (i - L, b), (i, c)];
            for (m, (j, a)) in terms.into_iter().enumerate() {
                gradient[j] += a * d;
                for (k, b) in terms.into_iter().take(m + 1) {
                    matrix.add(j, k, self.weight * a * b);
                }
            }
        }
    }
}

/// Root of the mean squared second derivative of positions by the way along them, whose steps need not be even; those
/// under a twentieth of the mean count as that much.
pub fn rms_bend<const N: usize>(positions: &[[f64; N]], steps: &[f64]) -> f64 {
    let mean = steps.iter().sum::<f64>() / steps.len().max(1) as f64;
    // Ways count in mean steps. The factors hold the root of the way that a sample stands for, so the sum of squares is
    // an integral over the way.
    let (mut integral, mut way) = (0.0, 0.0);
    for ((p, [a, b, c]), w) in positions.windows(3).zip(seconds(positions.len(), steps)).zip(steps.windows(2)) {
        integral += (0..N).map(|k| (a * p[0][k] + b * p[1][k] + c * p[2][k]).powi(2)).sum::<f64>();
        way += 0.5 * w.iter().map(|s| (s / mean).max(LEAST)).sum::<f64>();
    }
    if way > 0.0 { (integral / way).sqrt() / (mean * mean) } else { 0.0 }
}

/// Steps shorter than this share of their mean count as that: nearer samples would make their factors enormous, and
/// say nothing.
const LEAST: f64 = 0.05;

/// Factors of three neighbours in the divided second difference around each sample but the ends, times the root of
/// how much of the way it stands for; steps count in their mean.
fn seconds(count: usize, steps: &[f64]) -> Vec<[f64; 3]> {
    let even = count.saturating_sub(2);
    if steps.is_empty() {
        return vec![[1.0, -2.0, 1.0]; even];
    }
    let mean = steps.iter().sum::<f64>() / steps.len() as f64;
    steps
        .windows(2)
        .map(|w| {
            let [g, h] = [w[0], w[1]].map(|s| (s / mean).max(LEAST));
            let share = (0.5 * (g + h)).sqrt();
            let [a, c] = [2.0 / (g * (g + h)), 2.0 / (h * (g + h))].map(|f| f * share);
            [a, -(a + c), c]
        })
        .collect()
}
