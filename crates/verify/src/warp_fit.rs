//! How a measured part is warped, by the verifier's own arithmetic.
//!
//! The covariances of the manifest are taken, and proved to be those that docs/reference/measured.md asks for: that each
//! length has the largest amplitude that the points do not contradict, that lengths weigh as the best one of each says,
//! and that the deviation grows as the worst point asks. Then height and deviation follow at every node. Systems are solved by
//! elimination in place (L D L'), not by the compiler's library. Lengths are mm.

use terrace_core::math;
use terrace_core::parallel;

/// What a point says of the height.
#[derive(Clone, Copy, Debug)]
pub(super) struct WarpPoint {
    pub(super) at: [f64; 2],
    pub(super) height: f64,
    pub(super) sigma: f64,
    /// What a turn of the part about z, rad, and shifts along x and y change of the height.
    pub(super) aside: [f64; 3],
}

/// A covariance, and its share.
#[derive(Clone, Copy, Debug)]
pub(super) struct Covariance {
    pub(super) length: f64,
    pub(super) amplitude: f64,
    pub(super) weight: f64,
}

/// Points of one table, and what the part may be warped by at most.
pub(super) struct WarpPoints {
    points: Vec<WarpPoint>,
    limit: f64,
}

/// A plane of which nothing is known, about the middle of points.
#[derive(Clone, Copy)]
struct UnknownPlane {
    middle: [f64; 2],
    /// Square of half the longest distance.
    half2: f64,
    /// Of its height, and of the height that its tilt makes of that distance.
    variance: f64,
}

/// By how much worse the points may predict one another by an amplitude that they do not contradict.
const NOT_CONTRADICTED: f64 = 2.0;

/// Relative difference of lengths and amplitudes that are the same: places of points are known to some nm.
const SAME: f64 = 1e-4;

/// How far weights and the factor may be from their own: they follow from heights that are known to some nm, over
/// deviations that may be as small as 200 nm.
const CLOSE: f64 = 0.01;

/// And scores, in logarithms.
const CLOSE_SCORE: f64 = 0.2;

impl WarpPoints {
    /// The points, features before others, in cells where there are more than 300.
    pub(super) fn new(points: Vec<WarpPoint>, limit: f64) -> Self {
        let points: Vec<WarpPoint> = points.into_iter().map(|p| WarpPoint { sigma: p.sigma.max(2e-4), ..p }).collect();
        let [left, right, below, above] = span(&points);
        let together = |group: &[usize]| {
            let n = group.len() as f64;
            let sum = |of: &dyn Fn(&WarpPoint) -> f64| group.iter().map(|&i| of(&points[i])).sum::<f64>() / n;
            let noise = sum(&|p| p.sigma * p.sigma) / n.min(10.0);
            WarpPoint {
                at: [sum(&|p| p.at[0]), sum(&|p| p.at[1])],
                height: sum(&|p| p.height),
                sigma: noise.sqrt(),
                aside: [sum(&|p| p.aside[0]), sum(&|p| p.aside[1]), sum(&|p| p.aside[2])],
            }
        };
        if points.len() <= 300 {
            let near2 = 4e-6 * square_apart([left, below], [right, above]);
            let one = |group: &Vec<usize>| {
                let one = together(group);
                // The variance of the mean by the differences of each two.
                let n = group.len() as f64;
                let of_two = |(i, &a): (usize, &usize)| {
                    group[..i].iter().map(|&b| (points[a].height - points[b].height).powi(2)).sum::<f64>()
                };
                let differences: f64 = group.iter().enumerate().map(of_two).sum();
                let disagreed = if n > 1.0 { differences / (n * n * (n - 1.0)) } else { 0.0 };
                // Nothing within three deviations of the noise.
                if disagreed > 9.0 * one.sigma * one.sigma { WarpPoint { sigma: disagreed.sqrt(), ..one } } else { one }
            };
            return Self { points: one_places(&points, near2).iter().map(one).collect(), limit };
        }
        let (width, height) = (right - left, above - below);
        let side = (width * height / 300.0).sqrt().max(width.max(height) / 300.0).max(1e-6);
        let cell =
            |p: &WarpPoint| [((p.at[1] - below) / side).floor() as i64, ((p.at[0] - left) / side).floor() as i64];
        let mut order: Vec<usize> = (0..points.len()).collect();
        order.sort_by_key(|&i| (cell(&points[i]), i));
        let groups = order.chunk_by(|&a, &b| cell(&points[a]) == cell(&points[b]));
        Self { points: groups.map(together).collect(), limit }
    }

    pub(super) fn len(&self) -> usize {
        self.points.len()
    }

    fn plane(&self) -> UnknownPlane {
        let [left, right, below, above] = span(&self.points);
        let half2 = ((right - left).powi(2) + (above - below).powi(2)) / 4.0;
        UnknownPlane {
            middle: [(left + right) / 2.0, (below + above) / 2.0],
            half2: half2.max(1e-6),
            variance: self.limit.max(2e-4).powi(2),
        }
    }

    /// What is wrong with the covariances and the factor that a manifest states; None if nothing is.
    pub(super) fn fault(&self, stated: &[Covariance], factor: f64) -> Option<String> {
        if self.points.len() < 4 || stated.is_empty() {
            return Some("its covariances are missing".to_owned());
        }
        let [left, right, below, above] = span(&self.points);
        let longest = math::hypot(right - left, above - below).max(1e-3);
        let expected = (self.limit / 3.0).max(2e-4);
        // Of each length the scores of half powers of two of the amplitude that the limit says.
        let best = parallel::map(7, |k| {
            let length = longest / 24.0 * 2f64.powi(k as i32);
            let scores = (-16..4).filter_map(|half| {
                let amplitude = expected * math::pow(2.0, f64::from(half) / 2.0);
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
            let top = most_of(scores);
            let close = CLOSE_SCORE;
            let least = top - NOT_CONTRADICTED;
            let score = scores.iter().find(|(amplitude, _)| is_same(*amplitude, covariance.amplitude)).map(|s| s.1);
            // The best amplitude may be larger than what the limit says, one that is only not contradicted not. Which of
            // those that are about as good is the best is not asked.
            let may_be_best = |score: f64| score >= top - close;
            let least_best = scores.iter().filter(|s| may_be_best(s.1)).map(|s| s.0).fold(f64::INFINITY, f64::min);
            let most = expected.max(least_best) * (1.0 + SAME);
            let is_open = |&&(amplitude, score): &&(f64, f64)| score >= least + close && amplitude <= most;
            let larger = scores.iter().filter(is_open).map(|s| s.0).fold(0.0, f64::max);
            let is_allowed = |score: f64| {
                score >= least - close && (may_be_best(score) || covariance.amplitude <= expected * (1.0 + SAME))
            };
            if !score.is_some_and(is_allowed) || larger > covariance.amplitude * (1.0 + SAME) {
                return Some("an amplitude of it is not the largest that the points do not contradict".to_owned());
            }
            if (raw(top) / of_counted - covariance.weight).abs() > CLOSE {
                return Some("a weight of it is not what the points say".to_owned());
            }
        }
        let plain = Warped::new(self, stated, 1.0)?;
        let worst = plain.left_out().into_iter().map(|[error, sigma]| (error / sigma).abs()).fold(0.0, f64::max);
        ((worst / 2.5).max(1.0) / factor - 1.0)
            .abs()
            .gt(&CLOSE)
            .then(|| "its factor is not what the worst point asks for".to_owned())
    }

    /// The warp by covariances and a factor.
    pub(super) fn warped(&self, stated: &[Covariance], factor: f64) -> Option<Warped<'_>> {
        Warped::new(self, stated, factor)
    }

    /// Logarithm of the density of the points, each by the others.
    fn score(&self, length: f64, amplitude: f64) -> Option<f64> {
        let system = System::new(&self.points, &self.plane().with(length, amplitude))?;
        let (solution, diagonal) = (system.solved(heights(&self.points)), system.inverse_diagonal());
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

/// Points that are one place: the first that is left takes all that are left and near to it.
fn one_places(points: &[WarpPoint], near2: f64) -> Vec<Vec<usize>> {
    let mut left: Vec<usize> = (0..points.len()).collect();
    let mut places = Vec::new();
    while let Some(&first) = left.first() {
        let at = points[first].at;
        let (place, others) = left.into_iter().partition(|&i| square_apart(points[i].at, at) <= near2);
        places.push(place);
        left = others;
    }
    places
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

/// Square of the least width of points: of each two that have all others to their left, how far these lie at most.
fn width2(points: &[WarpPoint]) -> f64 {
    let [left, right, below, above] = span(points);
    let longest = math::hypot(right - left, above - below);
    let across = |a: &WarpPoint, b: &WarpPoint| {
        let (u, v) = (b.at[0] - a.at[0], b.at[1] - a.at[1]);
        let length = math::hypot(u, v);
        if length <= 1e-9 * longest {
            return None;
        }
        let mut most = 0.0_f64;
        for p in points {
            let aside = (u * (p.at[1] - a.at[1]) - v * (p.at[0] - a.at[0])) / length;
            if aside < -1e-9 * longest {
                return None;
            }
            most = most.max(aside);
        }
        Some(most)
    };
    let all = points.iter().flat_map(|a| points.iter().filter_map(move |b| across(a, b)));
    all.reduce(f64::min).unwrap_or(0.0).powi(2)
}

fn heights(points: &[WarpPoint]) -> Vec<f64> {
    points.iter().map(|p| p.height).collect()
}

/// How heights go together: smoothly over a length, on a plane.
#[derive(Clone, Copy)]
struct Kernel {
    plane: UnknownPlane,
    length: f64,
    amplitude: f64,
}

impl UnknownPlane {
    fn with(self, length: f64, amplitude: f64) -> Kernel {
        Kernel { plane: self, length, amplitude }
    }
}

impl Kernel {
    /// The covariance of two places.
    fn of(&self, a: [f64; 2], b: [f64; 2]) -> f64 {
        let distance = math::hypot(a[0] - b[0], a[1] - b[1]) * 3f64.sqrt() / self.length;
        let smooth = self.amplitude * self.amplitude * (1.0 + distance) * math::exp(-distance);
        let UnknownPlane { middle: [x, y], half2, variance } = self.plane;
        let tilt = (a[0] - x) * (b[0] - x) + (a[1] - y) * (b[1] - y);
        smooth + variance + variance * tilt / half2
    }
}

/// A covariance matrix of the points with their noise, as unit lower rows and a diagonal.
struct System {
    rows: Vec<Vec<f64>>,
    diagonal: Vec<f64>,
}

impl System {
    fn new(points: &[WarpPoint], kernel: &Kernel) -> Option<Self> {
        let mut rows: Vec<Vec<f64>> = Vec::with_capacity(points.len());
        let mut diagonal = Vec::with_capacity(points.len());
        for (i, p) in points.iter().enumerate() {
            // The row times the diagonal first.
            let mut row: Vec<f64> = points[..i].iter().map(|q| kernel.of(p.at, q.at)).collect();
            for k in 0..i {
                let known: f64 = rows[k].iter().zip(&row).map(|(a, b)| a * b).sum();
                row[k] -= known;
            }
            let mut pivot = kernel.of(p.at, p.at) + p.sigma * p.sigma;
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
    points: &'a WarpPoints,
    parts: Vec<Part>,
    factor: f64,
    /// Square of how far points reach.
    reach2: f64,
}

/// One of its processes, with what the points' heights come to, and what they have seen of each motion aside.
struct Part {
    weight: f64,
    kernel: Kernel,
    system: System,
    heights: Vec<f64>,
    aside: [Vec<f64>; 3],
}

impl<'a> Warped<'a> {
    fn new(points: &'a WarpPoints, stated: &[Covariance], factor: f64) -> Option<Self> {
        let all = &points.points;
        let part = |c: &Covariance| {
            let kernel = points.plane().with(c.length, c.amplitude);
            let system = System::new(all, &kernel)?;
            let heights = system.solved(heights(all));
            let aside = [0, 1, 2].map(|k| system.solved(all.iter().map(|p| p.aside[k]).collect()));
            Some(Part { weight: c.weight, kernel, system, heights, aside })
        };
        let parts = stated.iter().map(part).collect::<Option<_>>()?;
        // Two fifths of the width of the points at most.
        let reach2 = (16.0 * typical_gap2(all)).min(0.16 * width2(all));
        Some(Self { points, parts, factor, reach2 })
    }

    /// Height and deviation at a place, and what the points have seen there of a turn about z and shifts along x and y.
    pub(super) fn at(&self, at: [f64; 2]) -> [f64; 5] {
        let points = &self.points.points;
        let mut aside = [0.0; 3];
        let each = self.parts.iter().map(|part| {
            let row: Vec<f64> = points.iter().map(|p| part.kernel.of(p.at, at)).collect();
            let sum = |with: &[f64]| row.iter().zip(with).map(|(a, b)| a * b).sum::<f64>();
            let mean = sum(&part.heights);
            (0..3).for_each(|k| aside[k] += part.weight * sum(&part.aside[k]));
            [part.weight, mean, part.system.variance(part.kernel.of(at, at), row)]
        });
        let [height, deviation] = self.together(&each.collect::<Vec<_>>());
        // Where no point is near, only the limit is known.
        let is_far = points.iter().all(|p| square_apart(p.at, at) > self.reach2);
        let [turn, x, y] = aside;
        [height, if is_far { deviation.max(self.points.limit / 3.0) } else { deviation }, turn, x, y]
    }

    /// Of each point what it is off by the others, and the deviation of that.
    fn left_out(&self) -> Vec<[f64; 2]> {
        let diagonals: Vec<Vec<f64>> = self.parts.iter().map(|part| part.system.inverse_diagonal()).collect();
        let of = |i: usize| {
            let each = self.parts.iter().zip(&diagonals);
            let each = each.map(|(part, d)| [part.weight, part.heights[i] / d[i], 1.0 / d[i]]);
            self.together(&each.collect::<Vec<_>>())
        };
        (0..self.points.points.len()).map(of).collect()
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
                aside: [0.0; 3],
            })
            .collect();
        let points = WarpPoints::new(points, 0.5);
        let kernel = points.plane().with(30.0, 0.5);
        let points = points.points;
        let system = System::new(&points, &kernel).expect("regular");
        let x = system.solved(heights(&points));
        let entry = |i: usize, k: usize| kernel.of(points[i].at, points[k].at) + if i == k { 1e-4 } else { 0.0 };
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
