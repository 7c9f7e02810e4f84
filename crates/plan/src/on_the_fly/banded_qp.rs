//! Banded convex quadratic programs: many unknowns in a row, each constraint and each term of the objective over a few
//! neighbours.
//!
//! `minimise` is a primal-dual interior point method (Mehrotra's predictor and corrector, Nocedal and
//! Wright, Numerical Optimization, ch. 14 and 16): because all terms are local its linear systems are narrow
//! bands, so a step costs time in proportion to the length of the chain. It needs a start that keeps every
//! constraint strictly, and every answer on the way keeps them too.

/// A symmetric matrix with entries only near its diagonal, lower half.
#[derive(Clone, Debug)]
pub struct Band {
    width: usize,
    entries: Vec<f64>,
}

impl Band {
    /// Zeros: `n` rows, `width` entries left of the diagonal.
    pub fn new(n: usize, width: usize) -> Self {
        Self { width, entries: vec![0.0; n * (width + 1)] }
    }

    /// Adds to the entry in row `i` and column `j`, i ≥ j ≥ i - width, and to its mirror image.
    #[inline]
    pub fn add(&mut self, i: usize, j: usize, value: f64) {
        self.entries[i * (self.width + 1) + (i - j)] += value;
    }

    fn clear(&mut self) {
        self.entries.fill(0.0);
    }

    /// Cholesky's factor in place of a positive definite matrix. A pivot that rounding has made too small is
    /// raised to `floor` of its diagonal entry, which only shortens the step.
    fn factor(&mut self, floor: f64) {
        let (w, stride) = (self.width, self.width + 1);
        let n = self.entries.len() / stride;
        // Row by row, as in a dense matrix: the factor has no entry outside of the band either.
        for i in 0..n {
            let diagonal = self.entries[i * stride];
            for j in i.saturating_sub(w)..=i {
                let from = i.saturating_sub(w).max(j.saturating_sub(w));
                let mut sum = self.entries[i * stride + (i - j)];
                for k in from..j {
                    sum -= self.entries[i * stride + (i - k)] * self.entries[j * stride + (j - k)];
                }
                self.entries[i * stride + (i - j)] = if i == j {
                    sum.max(floor * diagonal).max(f64::MIN_POSITIVE).sqrt()
                } else {
                    sum / self.entries[j * stride]
                };
            }
        }
    }

    /// Solves with the factor, in place.
    fn solve(&self, x: &mut [f64]) {
        let (w, stride) = (self.width, self.width + 1);
        let n = x.len();
        // Forward through the lower half, then backward through its mirror image.
        let row = |i: usize| &self.entries[i * stride..(i + 1) * stride];
        for i in 0..n {
            let reach = w.min(i);
            let known: f64 = (1..=reach).map(|k| row(i)[k] * x[i - k]).sum();
            x[i] = (x[i] - known) / row(i)[0];
        }
        for i in (0..n).rev() {
            let reach = w.min(n - 1 - i);
            let known: f64 = (1..=reach).map(|k| row(i + k)[k] * x[i + k]).sum();
            x[i] = (x[i] - known) / row(i)[0];
        }
    }
}

/// A constraint over `W` unknowns in a row: `lo` ≤ `Σ a[k] x[at + k]` ≤ `hi`; an end that is not finite does
/// not bind.
#[derive(Clone, Copy, Debug)]
pub struct Row<const W: usize> {
    /// Index of the first unknown.
    pub at: usize,
    /// Factors; past the last unknown they are zero.
    pub a: [f64; W],
    /// Least value.
    pub lo: f64,
    /// Largest value.
    pub hi: f64,
}

impl<const W: usize> Row<W> {
    #[inline]
    fn dot(&self, x: &[f64]) -> f64 {
        let end = (self.at + W).min(x.len());
        x[self.at..end].iter().zip(&self.a).map(|(x, a)| x * a).sum()
    }
}

/// Most steps; a chain of a million unknowns takes some thirty.
const STEPS: usize = 100;
/// Share of the way to the nearest constraint that a step may go.
const NEAR: f64 = 0.995;

/// The unknowns that make a convex measure least under the rows, from a start that keeps all of them strictly.
///
/// `measure` adds its gradient and its matrix of second derivatives at a point to cleared ones. The
/// answer keeps every row; its measure is within `tolerance` × (1 + Σ |gradient · x|) of the least. Where the
/// start does not keep the rows strictly, or numbers fail, it is the best that was reached.
pub(crate) fn minimise<const W: usize>(
    start: Vec<f64>,
    width: usize,
    rows: &[Row<W>],
    measure: impl Fn(&[f64], &mut [f64], &mut Band),
    tolerance: f64,
) -> Vec<f64> {
    let n = start.len();
    let mut x = start;
    // Two sides of every row: distance to the end, its multiplier, and how both change.
    let mut sides: Vec<[Side; 2]> = rows.iter().map(|r| Side::of(r, r.dot(&x))).collect();
    let count = sides.iter().flatten().filter(|s| s.binds).count();
    if count == 0 && rows.iter().any(|r| r.lo.is_finite() || r.hi.is_finite()) {
        return x;
    }
    let mut matrix = Band::new(n, width.max(W - 1));
    let (mut gradient, mut step, mut rest) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
    for round in 0..STEPS {
        matrix.clear();
        gradient.fill(0.0);
        measure(&x, &mut gradient, &mut matrix);
        if round == 0 {
            first_multipliers(rows, &mut sides, &gradient, &x, count);
        }
        let gap: f64 = sides.iter().flatten().map(Side::product).sum();
        let scale = 1.0 + gradient.iter().zip(&x).map(|(g, x)| (g * x).abs()).sum::<f64>();
        // How far the gradient is from being balanced by the multipliers.
        rest.copy_from_slice(&gradient);
        for (row, pair) in rows.iter().zip(&sides) {
            spread(row, pair[1].multiplier - pair[0].multiplier, &mut rest);
        }
        let unbalanced = rest.iter().zip(&x).map(|(r, x)| (r * x).abs()).sum::<f64>();
        if gap <= tolerance * scale && unbalanced <= tolerance * scale {
            break;
        }
        // Normal equations: H + Σ (multiplier / slack) a aᵀ (Nocedal and Wright, ch. 16, no equalities).
        for (row, pair) in rows.iter().zip(&sides) {
            let weight: f64 = pair.iter().filter(|s| s.binds).map(|s| s.multiplier / s.slack).sum();
            for i in 0..W {
                for j in 0..=i {
                    if row.a[i] != 0.0 && row.a[j] != 0.0 {
                        matrix.add(row.at + i, row.at + j, weight * row.a[i] * row.a[j]);
                    }
                }
            }
        }
        matrix.factor(1e-14);
        // The predictor goes for the constraints themselves; how far it gets decides how central to stay.
        direction(rows, &mut sides, &gradient, &matrix, 0.0, &mut step);
        let (primal, dual) = reach(&sides, 1.0);
        let after: f64 = sides.iter().flatten().map(|s| s.product_after(primal, dual)).sum();
        // Mehrotra's σ = (gap after / gap)³ (Nocedal and Wright, algorithms 14.3 and 16.4).
        // Products must not fall faster than the gradient is balanced, or a bent measure runs into a corner.
        let centre = ((after / gap).clamp(0.0, 1.0).powi(3) * gap).max(0.1 * unbalanced) / count as f64;
        for side in sides.iter_mut().flatten() {
            side.second = side.d_slack * side.d_multiplier;
        }
        direction(rows, &mut sides, &gradient, &matrix, centre, &mut step);
        let (primal, dual) = reach(&sides, NEAR);
        // One length for both: the measure need not be quadratic.
        let length = primal.min(dual);
        if !(length > 1e-13 && step.iter().all(|s| s.is_finite())) {
            break;
        }
        for (x, d) in x.iter_mut().zip(&step) {
            *x += length * d;
        }
        for (row, pair) in rows.iter().zip(&mut sides) {
            let value = row.dot(&x);
            for (side, slack) in pair.iter_mut().zip([value - row.lo, row.hi - value]) {
                // Rounding must not take a slack to nothing or below.
                side.slack = slack.max(1e-3 * side.slack);
                side.multiplier += length * side.d_multiplier;
                side.second = 0.0;
            }
        }
    }
    x
}

/// One side of a row, with how its slack and its multiplier change in a step.
#[derive(Clone, Copy, Debug)]
struct Side {
    binds: bool,
    slack: f64,
    multiplier: f64,
    d_slack: f64,
    d_multiplier: f64,
    /// Product of the predictor's changes, which the corrector takes back.
    second: f64,
}

impl Side {
    /// Both sides of a row that has a value.
    fn of<const W: usize>(row: &Row<W>, value: f64) -> [Self; 2] {
        [value - row.lo, row.hi - value].map(|slack| Self {
            binds: slack.is_finite() && slack > 0.0,
            slack: if slack > 0.0 { slack } else { 1.0 },
            multiplier: 0.0,
            d_slack: 0.0,
            d_multiplier: 0.0,
            second: 0.0,
        })
    }

    /// Slack × multiplier.
    fn product(&self) -> f64 {
        if self.binds { self.slack * self.multiplier } else { 0.0 }
    }

    /// Slack × multiplier after shares of their changes.
    fn product_after(&self, primal: f64, dual: f64) -> f64 {
        if !self.binds {
            return 0.0;
        }
        (self.slack + primal * self.d_slack) * (self.multiplier + dual * self.d_multiplier)
    }
}

/// Adds a multiple of a row to a vector.
#[inline]
fn spread<const W: usize>(row: &Row<W>, factor: f64, to: &mut [f64]) {
    let end = (row.at + W).min(to.len());
    to[row.at..end].iter_mut().zip(&row.a).for_each(|(t, a)| *t += factor * a);
}

/// Multipliers to begin with: all products alike, of the size of what the measure can still lose.
fn first_multipliers<const W: usize>(
    rows: &[Row<W>],
    sides: &mut [[Side; 2]],
    gradient: &[f64],
    x: &[f64],
    count: usize,
) {
    debug_assert_eq!(rows.len(), sides.len());
    let scale: f64 = gradient.iter().zip(x).map(|(g, x)| (g * x).abs()).sum::<f64>().max(1e-9);
    for side in sides.iter_mut().flatten().filter(|s| s.binds) {
        side.multiplier = scale / count.max(1) as f64 / side.slack;
    }
}

/// The step of the unknowns, and with it those of slacks and multipliers, towards products of `centre`.
fn direction<const W: usize>(
    rows: &[Row<W>],
    sides: &mut [[Side; 2]],
    gradient: &[f64],
    matrix: &Band,
    centre: f64,
    step: &mut [f64],
) {
    step.iter_mut().zip(gradient).for_each(|(s, g)| *s = -g);
    for (row, pair) in rows.iter().zip(&*sides) {
        let pull = |s: &Side| if s.binds { (centre - s.second) / s.slack } else { 0.0 };
        spread(row, pull(&pair[0]) - pull(&pair[1]), step);
    }
    matrix.solve(step);
    for (row, pair) in rows.iter().zip(sides) {
        let along = row.dot(step);
        for (side, d) in pair.iter_mut().zip([along, -along]).filter(|(s, _)| s.binds) {
            side.d_slack = d;
            side.d_multiplier = (centre - side.second - side.multiplier * d) / side.slack - side.multiplier;
        }
    }
}

/// How far slacks and multipliers can go, at most 1.
fn reach(sides: &[[Side; 2]], near: f64) -> (f64, f64) {
    let (mut primal, mut dual) = (1.0f64, 1.0f64);
    for s in sides.iter().flatten().filter(|s| s.binds) {
        if s.d_slack < 0.0 {
            primal = primal.min(-near * s.slack / s.d_slack);
        }
        if s.d_multiplier < 0.0 {
            dual = dual.min(-near * s.multiplier / s.d_multiplier);
        }
    }
    (primal, dual)
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrace_core::math;

    /// Least sum of squares of second differences within a corridor.
    fn smooth(centre: &[f64], half: f64) -> Vec<f64> {
        let rows: Vec<Row<1>> =
            centre.iter().enumerate().map(|(at, c)| Row { at, a: [1.0], lo: c - half, hi: c + half }).collect();
        minimise(centre.to_vec(), 2, &rows, second_differences, 1e-10)
    }

    fn second_differences(x: &[f64], gradient: &mut [f64], matrix: &mut Band) {
        for i in 2..x.len() {
            let d = x[i - 2] - 2.0 * x[i - 1] + x[i];
            for (j, a) in [(i - 2, 1.0), (i - 1, -2.0), (i, 1.0)] {
                gradient[j] += a * d;
                for (k, b) in [(i - 2, 1.0), (i - 1, -2.0), (i, 1.0)] {
                    if k <= j {
                        matrix.add(j, k, a * b);
                    }
                }
            }
        }
    }

    #[test]
    fn a_line_within_the_corridor_is_found() {
        // A zigzag of less than the corridor's width about a line: the best has no second difference.
        let centre: Vec<f64> = (0..500).map(|i| 0.3 * f64::from(i) + if i % 2 == 0 { 0.8 } else { -0.8 }).collect();
        let found = smooth(&centre, 1.0);
        let worst = (2..found.len()).map(|i| (found[i - 2] - 2.0 * found[i - 1] + found[i]).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-3, "{worst}");
        assert!(found.iter().zip(&centre).all(|(f, c)| (f - c).abs() <= 1.0));
    }

    #[test]
    fn the_answer_keeps_the_rows_and_meets_the_conditions_of_the_least() {
        let centre: Vec<f64> = (0..400).map(|i| 5.0 * math::sin(f64::from(i) / 7.0) + f64::from(i % 13)).collect();
        let half = 2.0;
        let found = smooth(&centre, half);
        assert!(found.iter().zip(&centre).all(|(f, c)| (f - c).abs() <= half));
        let (mut gradient, mut matrix) = (vec![0.0; found.len()], Band::new(found.len(), 2));
        second_differences(&found, &mut gradient, &mut matrix);
        for ((g, f), c) in gradient.iter().zip(&found).zip(&centre) {
            // What pushes an unknown down leans on its lower end, and the other way round.
            let leans_on = if *g > 0.0 { half + (f - c) } else { half - (f - c) };
            assert!(g.abs() * leans_on < 1e-6, "{g} at {leans_on} from the end");
        }
    }

    #[test]
    fn a_measure_that_is_not_quadratic_meets_its_closed_form() {
        // Least Σ 1/x under x ≤ i + 1: every unknown at its end.
        let rows: Vec<Row<1>> = (0..50).map(|at| Row { at, a: [1.0], lo: 0.0, hi: at as f64 + 1.0 }).collect();
        let start = vec![0.5; 50];
        let found = minimise(
            start,
            0,
            &rows,
            |x, gradient, matrix| {
                for (i, &x) in x.iter().enumerate() {
                    gradient[i] -= 1.0 / (x * x);
                    matrix.add(i, i, 2.0 / (x * x * x));
                }
            },
            1e-10,
        );
        for (i, x) in found.iter().enumerate() {
            let end = i as f64 + 1.0;
            assert!(*x <= end && end - x < 1e-5 * end, "{i}: {x}");
        }
    }
}
