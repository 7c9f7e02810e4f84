//! How a measured part is warped, by the verifier's own arithmetic.
//!
//! The covariances of the manifest are taken, and proved to be those that docs/reference/measured.md asks for: that each
//! length has the amplitude for which the points predict one another best, that lengths weigh as that says, and that the
//! deviation grows as the worst point asks. Then height and deviation follow at every node. Systems are solved by
//! elimination in place (L D L'), not by the compiler's library. Lengths are mm.

use terrace_core::math;
use terrace_core::parallel;

/// What a point says of the height.
#[derive(Clone, Copy, Debug)]
pub(super) struct WarpPoint {
    pub(super) at: [f64; 2],
    pub(super) height: f64,
    pub(super) sigma: f64,
}

/// A covariance, and its share.
#[derive(Clone, Copy, Debug)]
pub(super) struct Covariance {
    pub(super) length: f64,
    pub(super) amplitude: f64,
    pub(super) weight: f64,
}

/// Points of one table, and the least of them that are taken together.
pub(super) struct WarpPoints(Vec<WarpPoint>);

/// Relative difference of lengths and amplitudes that are the same: places of points are known to some nm.
const SAME: f64 = 1e-4;

/// How far weights, scores and the factor may be from their own: they follow from heights that are known to some nm, over
/// deviations that may be as small as 200 nm.
const CLOSE: f64 = 0.01;

impl WarpPoints {
    /// The points, in cells where there are more than 300.
    pub(super) fn new(points: Vec<WarpPoint>) -> Self {
        let points: Vec<WarpPoint> = points.into_iter().map(|p| WarpPoint { sigma: p.sigma.max(2e-4), ..p }).collect();
        if points.len() <= 300 {
            return Self(points);
        }
        let [left, right, below, above] = span(&points);
        let (width, height) = (right - left, above - below);
        let side = (width * height / 300.0).sqrt().max(width.max(height) / 300.0).max(1e-6);
        let cell =
            |p: &WarpPoint| [((p.at[1] - below) / side).floor() as i64, ((p.at[0] - left) / side).floor() as i64];
        let mut order: Vec<usize> = (0..points.len()).collect();
        order.sort_by_key(|&i| (cell(&points[i]), i));
        let groups = order.chunk_by(|&a, &b| cell(&points[a]) == cell(&points[b]));
        let mean = groups.map(|group| {
            let n = group.len() as f64;
            let sum = |of: &dyn Fn(&WarpPoint) -> f64| group.iter().map(|&i| of(&points[i])).sum::<f64>() / n;
            let noise = sum(&|p| p.sigma * p.sigma) / n.min(10.0);
            WarpPoint { at: [sum(&|p| p.at[0]), sum(&|p| p.at[1])], height: sum(&|p| p.height), sigma: noise.sqrt() }
        });
        Self(mean.collect())
    }

    pub(super) fn len(&self) -> usize {
        self.0.len()
    }

    /// What is wrong with the covariances and the factor that a manifest states; None if nothing is.
    pub(super) fn fault(&self, stated: &[Covariance], factor: f64) -> Option<String> {
        if self.0.len() < 4 || stated.is_empty() {
            return Some("its covariances are missing".to_owned());
        }
        let [left, right, below, above] = span(&self.0);
        let longest = math::hypot(right - left, above - below).max(1e-3);
        let squares: f64 = self.0.iter().map(|p| p.height * p.height).sum();
        let rms = (squares / self.0.len() as f64).sqrt().max(2e-4);
        // Of each length the best amplitude: the score of it, and its half powers of two.
        let best = parallel::map(7, |k| {
            let length = longest / 24.0 * 2f64.powi(k as i32);
            let scores = (-8..10).filter_map(|half| {
                let amplitude = rms * math::pow(2.0, f64::from(half) / 2.0);
                Some((amplitude, self.score(length, amplitude)?))
            });
            let scores: Vec<(f64, f64)> = scores.collect();
            (length, scores)
        });
        let most_of = |scores: &[(f64, f64)]| scores.iter().map(|s| s.1).fold(f64::NEG_INFINITY, f64::max);
        let most = best.iter().map(|(_, scores)| most_of(scores)).fold(f64::NEG_INFINITY, f64::max);
        let raw = |score: f64| math::exp(0.12 * (score - most));
        let all: f64 = best.iter().map(|(_, scores)| raw(most_of(scores))).sum();
        let counted: Vec<&(f64, Vec<(f64, f64)>)> =
            best.iter().filter(|(_, scores)| raw(most_of(scores)) / all >= 1e-3).collect();
        let of_counted: f64 = counted.iter().map(|(_, scores)| raw(most_of(scores))).sum();
        if counted.len() != stated.len() {
            return Some("its lengths are not those that count".to_owned());
        }
        for ((length, scores), covariance) in counted.iter().zip(stated) {
            if !is_same(*length, covariance.length) {
                return Some("a length of it is not one that is tried".to_owned());
            }
            let score = scores.iter().find(|(amplitude, _)| is_same(*amplitude, covariance.amplitude)).map(|s| s.1);
            let top = most_of(scores);
            if score.is_none_or(|score| score < top - CLOSE * (1.0 + top.abs())) {
                return Some("an amplitude of it is not the best one".to_owned());
            }
            if (raw(top) / of_counted - covariance.weight).abs() > CLOSE {
                return Some("a weight of it is not what the points say".to_owned());
            }
        }
        let plain = Warped::new(&self.0, stated, (1.0, f64::INFINITY))?;
        let worst = plain.left_out().into_iter().map(|[error, sigma]| (error / sigma).abs()).fold(0.0, f64::max);
        ((worst / 2.5).max(1.0) / factor - 1.0)
            .abs()
            .gt(&CLOSE)
            .then(|| "its factor is not what the worst point asks for".to_owned())
    }

    /// The warp by covariances and a factor, of a part that may be warped by `limit`.
    pub(super) fn warped(&self, stated: &[Covariance], factor: f64, limit: f64) -> Option<Warped<'_>> {
        Warped::new(&self.0, stated, (factor, limit))
    }

    /// Logarithm of the density of the points, each by the others.
    fn score(&self, length: f64, amplitude: f64) -> Option<f64> {
        let system = System::new(&self.0, length, amplitude)?;
        let (solution, diagonal) = (system.solved(heights(&self.0)), system.inverse_diagonal());
        let of = |(a, d): (&f64, &f64)| {
            let (error, variance) = (a / d, 1.0 / d);
            -0.5 * (math::ln(variance) + error * error / variance)
        };
        Some(solution.iter().zip(&diagonal).map(of).sum())
    }
}

fn is_same(a: f64, b: f64) -> bool {
    (a - b).abs() <= SAME * a.abs().max(b.abs())
}

fn span(points: &[WarpPoint]) -> [f64; 4] {
    let least = |k: usize| points.iter().map(|p| p.at[k]).fold(f64::INFINITY, f64::min);
    let most = |k: usize| points.iter().map(|p| p.at[k]).fold(f64::NEG_INFINITY, f64::max);
    [least(0), most(0), least(1), most(1)]
}

fn square_apart(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1])
}

/// Square of the distance that half of the points have to the nearest other at most.
fn typical_gap2(points: &[WarpPoint]) -> f64 {
    let gap2 = |(i, p): (usize, &WarpPoint)| {
        let others = points.iter().enumerate().filter(|&(k, _)| k != i);
        others.map(|(_, q)| square_apart(p.at, q.at)).fold(f64::INFINITY, f64::min)
    };
    let mut all: Vec<f64> = points.iter().enumerate().map(gap2).collect();
    all.sort_by(f64::total_cmp);
    all.get(all.len() / 2).copied().unwrap_or(0.0)
}

fn heights(points: &[WarpPoint]) -> Vec<f64> {
    points.iter().map(|p| p.height).collect()
}

/// The covariance of two places.
fn covariance(a: [f64; 2], b: [f64; 2], length: f64, amplitude: f64) -> f64 {
    let distance = math::hypot(a[0] - b[0], a[1] - b[1]) * 3f64.sqrt() / length;
    amplitude * amplitude * (1.0 + distance) * math::exp(-distance)
}

/// A covariance matrix of the points with their noise, as unit lower rows and a diagonal.
struct System {
    rows: Vec<Vec<f64>>,
    diagonal: Vec<f64>,
}

impl System {
    fn new(points: &[WarpPoint], length: f64, amplitude: f64) -> Option<Self> {
        let mut rows: Vec<Vec<f64>> = Vec::with_capacity(points.len());
        let mut diagonal = Vec::with_capacity(points.len());
        for (i, p) in points.iter().enumerate() {
            // The row times the diagonal first.
            let mut row: Vec<f64> = points[..i].iter().map(|q| covariance(p.at, q.at, length, amplitude)).collect();
            for k in 0..i {
                let known: f64 = rows[k].iter().zip(&row).map(|(a, b)| a * b).sum();
                row[k] -= known;
            }
            let mut pivot = amplitude * amplitude + p.sigma * p.sigma;
            for (k, v) in row.iter_mut().enumerate() {
                let scaled = *v / diagonal[k];
                pivot -= *v * scaled;
                *v = scaled;
            }
            if pivot <= 0.0 {
                return None;
            }
            rows.push(row);
            diagonal.push(pivot);
        }
        Some(Self { rows, diagonal })
    }

    /// The right side with the lower rows taken off.
    fn forward(&self, mut right: Vec<f64>) -> Vec<f64> {
        for i in 0..right.len() {
            let known: f64 = self.rows[i].iter().zip(&right).map(|(a, b)| a * b).sum();
            right[i] -= known;
        }
        right
    }

    fn solved(&self, right: Vec<f64>) -> Vec<f64> {
        let mut x = self.forward(right);
        x.iter_mut().zip(&self.diagonal).for_each(|(v, d)| *v /= d);
        for i in (0..x.len()).rev() {
            let of = x[i];
            x.iter_mut().zip(&self.rows[i]).for_each(|(v, a)| *v -= a * of);
        }
        x
    }

    /// What is left of a variance once the points with these covariances are known.
    fn variance(&self, at_place: f64, covariances: Vec<f64>) -> f64 {
        let known: f64 = self.forward(covariances).iter().zip(&self.diagonal).map(|(v, d)| v * v / d).sum();
        (at_place - known).max(0.0)
    }

    /// The diagonal of the inverse.
    fn inverse_diagonal(&self) -> Vec<f64> {
        let n = self.diagonal.len();
        let mut column = vec![0.0; n];
        let of = (0..n).map(|k| {
            column[k] = 1.0;
            let mut sum = 1.0 / self.diagonal[k];
            for i in k + 1..n {
                let known: f64 = self.rows[i][k..i].iter().zip(&column[k..i]).map(|(a, b)| a * b).sum();
                column[i] = -known;
                sum += known * known / self.diagonal[i];
            }
            sum
        });
        of.collect()
    }
}

/// A warp: a mixture of Gaussian processes.
pub(super) struct Warped<'a> {
    points: &'a [WarpPoint],
    parts: Vec<(Covariance, System, Vec<f64>)>,
    factor: f64,
    /// What the part may be warped by at most, and the square of how far points reach.
    limit: f64,
    reach2: f64,
}

impl<'a> Warped<'a> {
    fn new(points: &'a [WarpPoint], stated: &[Covariance], (factor, limit): (f64, f64)) -> Option<Self> {
        let part = |c: &Covariance| {
            let system = System::new(points, c.length, c.amplitude)?;
            let solution = system.solved(heights(points));
            Some((*c, system, solution))
        };
        let parts = stated.iter().map(part).collect::<Option<_>>()?;
        Some(Self { points, parts, factor, limit, reach2: 16.0 * typical_gap2(points) })
    }

    /// Height and deviation at a place.
    pub(super) fn at(&self, at: [f64; 2]) -> [f64; 2] {
        let each = self.parts.iter().map(|(c, system, solution)| {
            let row: Vec<f64> = self.points.iter().map(|p| covariance(p.at, at, c.length, c.amplitude)).collect();
            let mean: f64 = row.iter().zip(solution).map(|(a, b)| a * b).sum();
            [c.weight, mean, system.variance(c.amplitude * c.amplitude, row)]
        });
        let [height, deviation] = self.together(&each.collect::<Vec<_>>());
        // Where no point is near, only the limit is known.
        let is_far = self.points.iter().all(|p| square_apart(p.at, at) > self.reach2);
        [height, if is_far { deviation.max(self.limit / 3.0) } else { deviation }]
    }

    /// Of each point what it is off by the others, and the deviation of that.
    fn left_out(&self) -> Vec<[f64; 2]> {
        let diagonals: Vec<Vec<f64>> = self.parts.iter().map(|(_, system, _)| system.inverse_diagonal()).collect();
        let of = |i: usize| {
            let each = self.parts.iter().zip(&diagonals);
            let each = each.map(|((c, _, solution), d)| [c.weight, solution[i] / d[i], 1.0 / d[i]]);
            self.together(&each.collect::<Vec<_>>())
        };
        (0..self.points.len()).map(of).collect()
    }

    /// Mean and deviation of weights, means and variances.
    fn together(&self, each: &[[f64; 3]]) -> [f64; 2] {
        let mean: f64 = each.iter().map(|e| e[0] * e[1]).sum();
        let square: f64 = each.iter().map(|e| e[0] * (e[2] + e[1] * e[1])).sum();
        [mean, self.factor * (square - mean * mean).max(0.0).sqrt()]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrace_core::random::Random;

    #[test]
    fn a_system_solves_its_equations() {
        let mut random = Random::case(7);
        let points: Vec<WarpPoint> = (0..40)
            .map(|_| WarpPoint {
                at: [random.range(0.0, 100.0), random.range(0.0, 100.0)],
                height: random.range(-1.0, 1.0),
                sigma: 0.01,
            })
            .collect();
        let system = System::new(&points, 30.0, 0.5).expect("regular");
        let x = system.solved(heights(&points));
        let entry =
            |i: usize, k: usize| covariance(points[i].at, points[k].at, 30.0, 0.5) + if i == k { 1e-4 } else { 0.0 };
        for i in 0..40 {
            let found: f64 = (0..40).map(|k| entry(i, k) * x[k]).sum();
            assert!((found - points[i].height).abs() < 1e-9, "{i}");
            let mut unit = vec![0.0; 40];
            unit[i] = 1.0;
            let inverse = system.solved(unit)[i];
            assert!((system.inverse_diagonal()[i] / inverse - 1.0).abs() < 1e-9, "{i}");
        }
    }
}
