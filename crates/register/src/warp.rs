//! How a part is warped: a smooth correction of its height from what the rigid fit leaves of the points.
//!
//! A Gaussian process with the Matern covariance of order 3/2 (Rasmussen and Williams 2006, eq. 4.17), zero mean, and
//! the points' own noise. Nobody knows how smooth the warp of a part is, and few points do not tell. So seven lengths
//! are tried; each takes the amplitude for which the points predict one another best, left out one by one (eq. 5.11),
//! and counts by a tempered share of that: what several lengths explain about as well stays in doubt, and the doubt is
//! part of the deviation. Where points left out lie farther off than the deviation says, it grows until they do not.
//! Far from all points the correction goes to zero, and the deviation to the amplitude. But that was found over the gaps
//! between points alone: a dent where none lies, or a bend between two patches that the pose has taken up, may be many
//! times larger. So farther from all points than a few of their gaps the deviation is that of what the part may be warped
//! by at most.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use terrace_core::math;
use terrace_core::parallel;

/// The height of the part over the rigid fit, as a point shows it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observation {
    /// Where, table frame, mm.
    pub at: [f64; 2],
    /// Along z, mm.
    pub height: f64,
    /// Its standard deviation, mm.
    pub sigma: f64,
}

/// A length of the covariance, what it takes, and how much it counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// Over which heights go together, mm.
    pub length: f64,
    /// Standard deviation of the height far from all points, mm.
    pub amplitude: f64,
    /// Share, 0 to 1; all sum to 1.
    pub weight: f64,
}

/// A warp that was fitted.
#[derive(Clone, Debug)]
pub struct Warp {
    points: Vec<Observation>,
    models: Vec<Model>,
    factor: f64,
    /// What the part may be warped by at most, mm.
    limit: f64,
    /// How far points reach, mm.
    reach: f64,
}

#[derive(Clone, Debug)]
struct Model {
    candidate: Candidate,
    cholesky: Cholesky<f64, Dyn>,
    weights: DVector<f64>,
}

/// Points beyond these are put together in square cells.
pub const MOST_POINTS: usize = 300;

/// Points of a cell that count as independent, at most.
const INDEPENDENT: usize = 10;

/// Least standard deviation of an observation, mm: closer points would make the equations singular.
const LEAST_SIGMA: f64 = 2e-4;

/// The longest distance between points, over the shortest length that is tried; each next is twice as long.
const FINEST: f64 = 24.0;
const LENGTHS: i32 = 7;

/// Amplitudes that are tried, in half powers of two of the root mean square of the heights.
const AMPLITUDES: std::ops::Range<i32> = -8..10;

/// Share of the logarithm of what was predicted that weighs the lengths: neighbours say much the same.
const TEMPER: f64 = 0.12;

/// Lengths that weigh less are left out.
const LEAST_WEIGHT: f64 = 1e-3;

/// The deviation of a height, in units of what a part may be warped by at most.
pub const DEVIATION_OF_LIMIT: f64 = 1.0 / 3.0;

/// Points reach so many times as far as half of them have their nearest neighbours: some farther than the largest gap of
/// some hundred points that lie at random, which is three times as far.
const REACH: f64 = 4.0;

/// The largest deviation, in its own units, by which a point that is left out may lie off.
const LARGEST_LEFT_OUT: f64 = 2.5;

/// Matern's covariance of order 3/2, for heights of unit deviation.
pub(crate) fn matern(distance: f64, length: f64) -> f64 {
    let u = 3f64.sqrt() * distance / length;
    (1.0 + u) * math::exp(-u)
}

pub(crate) fn apart(a: [f64; 2], b: [f64; 2]) -> f64 {
    math::hypot(a[0] - b[0], a[1] - b[1])
}

/// The points, those of a cell together where there are many.
fn thinned(points: &[Observation]) -> Vec<Observation> {
    let floored = |p: &Observation| Observation { sigma: p.sigma.max(LEAST_SIGMA), ..*p };
    if points.len() <= MOST_POINTS {
        return points.iter().map(floored).collect();
    }
    let (lo, hi) = span(points);
    let side = ((hi[0] - lo[0]) * (hi[1] - lo[1]) / MOST_POINTS as f64).sqrt();
    let side = side.max((hi[0] - lo[0]).max(hi[1] - lo[1]) / MOST_POINTS as f64).max(1e-6);
    let mut cells = std::collections::BTreeMap::<[i64; 2], Vec<Observation>>::new();
    for p in points {
        let cell = [1, 0].map(|k| ((p.at[k] - lo[k]) / side).floor() as i64);
        cells.entry(cell).or_default().push(floored(p));
    }
    let together = |of: Vec<Observation>| {
        let n = of.len() as f64;
        let mean = |value: &dyn Fn(&Observation) -> f64| of.iter().map(value).sum::<f64>() / n;
        let noise = mean(&|p| p.sigma * p.sigma) / of.len().min(INDEPENDENT) as f64;
        Observation { at: [mean(&|p| p.at[0]), mean(&|p| p.at[1])], height: mean(&|p| p.height), sigma: noise.sqrt() }
    };
    cells.into_values().map(together).collect()
}

/// The box of points.
fn span(points: &[Observation]) -> ([f64; 2], [f64; 2]) {
    points.iter().fold(([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]), |(lo, hi), p| {
        ([0, 1].map(|k| lo[k].min(p.at[k])), [0, 1].map(|k| hi[k].max(p.at[k])))
    })
}

/// What is left of each point, and its deviation, where the others predict it.
struct LeftOut {
    errors: Vec<f64>,
    variances: Vec<f64>,
}

impl LeftOut {
    /// Logarithm of the density of the points under that.
    fn score(&self) -> f64 {
        let of = |(e, v): (&f64, &f64)| -0.5 * (math::ln(*v) + e * e / v);
        self.errors.iter().zip(&self.variances).map(of).sum()
    }
}

/// The lengths that are tried of points that lie as far apart as this at most, mm.
pub fn lengths(longest: f64) -> impl Iterator<Item = f64> {
    (0..LENGTHS).map(move |k| longest / FINEST * f64::from(1 << k))
}

fn solved(points: &[Observation], length: f64, amplitude: f64) -> Option<Cholesky<f64, Dyn>> {
    let n = points.len();
    let matrix = DMatrix::from_fn(n, n, |i, k| {
        let noise = if i == k { points[i].sigma.powi(2) } else { 0.0 };
        amplitude * amplitude * matern(apart(points[i].at, points[k].at), length) + noise
    });
    Cholesky::new(matrix)
}

fn heights(points: &[Observation]) -> DVector<f64> {
    DVector::from_iterator(points.len(), points.iter().map(|p| p.height))
}

/// The diagonal of the inverse is that of the squares of the columns of the inverse factor.
fn left_out(cholesky: &Cholesky<f64, Dyn>, heights: &DVector<f64>) -> LeftOut {
    let n = heights.len();
    // Rows of the factor, each contiguous.
    let rows = cholesky.l_dirty().transpose();
    let weights = cholesky.solve(heights);
    let mut column = vec![0.0; n];
    let diagonal = (0..n).map(|j| {
        column[j] = 1.0 / rows[(j, j)];
        let mut squares = column[j] * column[j];
        for i in j + 1..n {
            let row = &rows.as_slice()[i * n + j..i * n + i];
            let sum: f64 = row.iter().zip(&column[j..i]).map(|(a, b)| a * b).sum();
            column[i] = -sum / rows[(i, i)];
            squares += column[i] * column[i];
        }
        squares
    });
    let diagonal: Vec<f64> = diagonal.collect();
    LeftOut {
        errors: weights.iter().zip(&diagonal).map(|(w, d)| w / d).collect(),
        variances: diagonal.iter().map(|d| 1.0 / d).collect(),
    }
}

/// How far points reach, mm.
fn reach(points: &[Observation]) -> f64 {
    let mut nearest: Vec<f64> = (0..points.len())
        .map(|i| {
            let others = (0..points.len()).filter(|&k| k != i);
            others.map(|k| apart(points[i].at, points[k].at)).fold(f64::INFINITY, f64::min)
        })
        .collect();
    let half = nearest.len() / 2;
    REACH * *nearest.select_nth_unstable_by(half, f64::total_cmp).1
}

/// Fits the warp of a part that is warped by `limit`, mm, at most to what points show; None of fewer than four.
pub fn warp(points: &[Observation], limit: f64) -> Option<Warp> {
    let points = thinned(points);
    if points.len() < 4 {
        return None;
    }
    let (lo, hi) = span(&points);
    let longest = apart(lo, hi).max(1e-3);
    let heights = heights(&points);
    let rms = (heights.norm_squared() / heights.len() as f64).sqrt().max(LEAST_SIGMA);
    let best = |length: f64| {
        let tried = AMPLITUDES.filter_map(|k| {
            let amplitude = rms * math::exp(f64::from(k) * 0.5 * std::f64::consts::LN_2);
            let found = left_out(&solved(&points, length, amplitude)?, &heights);
            Some((found.score(), amplitude))
        });
        tried.max_by(|a, b| a.0.total_cmp(&b.0))
    };
    let of_lengths: Vec<f64> = lengths(longest).collect();
    let tried = parallel::map(of_lengths.len(), |k| {
        let length = of_lengths[k];
        best(length).map(|(score, amplitude)| (score, length, amplitude))
    });
    let tried: Vec<(f64, f64, f64)> = tried.into_iter().flatten().collect();
    let most = tried.iter().map(|t| t.0).fold(f64::NEG_INFINITY, f64::max);
    let weight = |score: f64| math::exp(TEMPER * (score - most));
    let all: f64 = tried.iter().map(|t| weight(t.0)).sum();
    let kept: Vec<_> = tried.into_iter().filter(|t| weight(t.0) / all >= LEAST_WEIGHT).collect();
    let all: f64 = kept.iter().map(|t| weight(t.0)).sum();
    let models = kept.into_iter().filter_map(|(score, length, amplitude)| {
        let cholesky = solved(&points, length, amplitude)?;
        let weights = cholesky.solve(&heights);
        Some(Model { candidate: Candidate { length, amplitude, weight: weight(score) / all }, cholesky, weights })
    });
    let mut warp = Warp { models: models.collect(), reach: reach(&points), points, factor: 1.0, limit };
    let largest = warp.left_out().into_iter().map(|[error, deviation]| (error / deviation).abs()).fold(0.0, f64::max);
    warp.factor = (largest / LARGEST_LEFT_OUT).max(1.0);
    Some(warp)
}

impl Warp {
    /// The correction at a place, table frame, and its standard deviation, mm.
    pub fn at(&self, at: [f64; 2]) -> [f64; 2] {
        let found = self.models.iter().map(|model| {
            let Candidate { length, amplitude, weight } = model.candidate;
            let scale = amplitude * amplitude;
            let n = self.points.len();
            let row = DVector::from_iterator(n, self.points.iter().map(|p| scale * matern(apart(p.at, at), length)));
            let mean = row.dot(&model.weights);
            let half = model.cholesky.l_dirty().solve_lower_triangular(&row).unwrap_or_else(|| DVector::zeros(n));
            [weight, mean, (scale - half.norm_squared()).max(0.0)]
        });
        let [mean, variance] = mixed(&found.collect::<Vec<_>>());
        let least = if self.reaches(at) { 0.0 } else { self.limit * DEVIATION_OF_LIMIT };
        [mean, (self.factor * variance.sqrt()).max(least)]
    }

    /// Whether a place lies as near to a point as points say something of it.
    pub fn reaches(&self, at: [f64; 2]) -> bool {
        self.points.iter().any(|p| apart(p.at, at) <= self.reach)
    }

    /// What each point is off where the others predict it, and the deviation of that, mm.
    pub fn left_out(&self) -> Vec<[f64; 2]> {
        let heights = heights(&self.points);
        let each: Vec<(f64, LeftOut)> =
            self.models.iter().map(|m| (m.candidate.weight, left_out(&m.cholesky, &heights))).collect();
        let of = |i: usize| {
            let found = each.iter().map(|(weight, l)| [*weight, l.errors[i], l.variances[i]]);
            let [error, variance] = mixed(&found.collect::<Vec<_>>());
            [error, self.factor * variance.sqrt()]
        };
        (0..self.points.len()).map(of).collect()
    }

    /// Lowest and highest correction, and the least and the largest deviation, mm, at the nodes of a net of 40 by 40 over
    /// the points.
    pub fn ranges(&self) -> [[f64; 2]; 2] {
        const NET: usize = 40;
        let (lo, hi) = span(&self.points);
        let at = |i: usize, axis: usize| lo[axis] + (hi[axis] - lo[axis]) * i as f64 / (NET - 1) as f64;
        let rows = parallel::map(NET, |row| (0..NET).map(|i| self.at([at(i, 0), at(row, 1)])).collect::<Vec<_>>());
        [0, 1].map(|m| {
            let all = rows.iter().flatten().map(|found| found[m]);
            all.fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], v| [lo.min(v), hi.max(v)])
        })
    }

    /// The points that it was fitted to, those of a cell together.
    pub fn points(&self) -> &[Observation] {
        &self.points
    }

    /// The lengths that count.
    pub fn candidates(&self) -> Vec<Candidate> {
        self.models.iter().map(|m| m.candidate).collect()
    }

    /// How many times the deviation is larger than the covariances say.
    pub fn factor(&self) -> f64 {
        self.factor
    }
}

/// Mean and variance of a mixture of weight, mean and variance.
fn mixed(of: &[[f64; 3]]) -> [f64; 2] {
    let mean: f64 = of.iter().map(|[w, m, _]| w * m).sum();
    [mean, of.iter().map(|[w, m, v]| w * (v + (m - mean).powi(2))).sum()]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::tests::gauss;
    use terrace_core::random::Random;

    /// Dents and bumps of a width on a plate of 450 mm, 0.4 mm from lowest to highest, less their mean plane.
    fn dents(random: &mut Random, width: f64) -> impl Fn([f64; 2]) -> f64 + use<> {
        let all: Vec<[f64; 3]> = (0..random.below(9) + 4)
            .map(|_| [random.range(-225.0, 225.0), random.range(-225.0, 225.0), random.range(-1.0, 1.0)])
            .collect();
        let raw = move |at: [f64; 2]| -> f64 {
            all.iter().map(|&[x, y, h]| h * math::exp(-0.5 * (apart(at, [x, y]) / width).powi(2))).sum()
        };
        let net = net(46);
        let (lo, hi) =
            net.iter().map(|&p| raw(p)).fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), z| (l.min(z), h.max(z)));
        let n = net.len() as f64;
        let mean = net.iter().map(|&p| raw(p)).sum::<f64>() / n;
        let slope = [0, 1]
            .map(|k| net.iter().map(|&p| raw(p) * p[k]).sum::<f64>() / net.iter().map(|p| p[k] * p[k]).sum::<f64>());
        move |at| (raw(at) - mean - slope[0] * at[0] - slope[1] * at[1]) * 0.4 / (hi - lo)
    }

    fn net(side: usize) -> Vec<[f64; 2]> {
        let at = |i: usize| 450.0 * (i as f64 / (side - 1) as f64 - 0.5);
        (0..side * side).map(|i| [at(i % side), at(i / side)]).collect()
    }

    /// Points in an even net, up to 3 mm beside it, with 5 um of noise.
    fn measured(random: &mut Random, truth: impl Fn([f64; 2]) -> f64, count: usize) -> Vec<Observation> {
        let side = (count as f64).sqrt().ceil() as usize;
        let all = net(side).into_iter().take(count).map(|p| {
            let at = p.map(|v| v * 0.97 + random.range(-3.0, 3.0));
            Observation { at, height: truth(at) + 0.005 * gauss(random), sigma: 0.005 }
        });
        all.collect()
    }

    /// Share of all places within three deviations, and the worst error, mm.
    fn coverage(warp: &Warp, truth: impl Fn([f64; 2]) -> f64) -> (f64, f64) {
        let net = net(46);
        let found: Vec<(f64, f64)> =
            net.iter().map(|&p| (warp.at(p), truth(p))).map(|([m, d], z)| ((m - z).abs(), d)).collect();
        let inside = found.iter().filter(|(e, d)| *e <= 3.0 * d).count();
        (inside as f64 / net.len() as f64, found.iter().map(|f| f.0).fold(0.0, f64::max))
    }

    #[test]
    fn a_twisted_plate_is_found_and_known_surely() {
        let truth = |[x, y]: [f64; 2]| 0.4 * x * y / (450.0 * 450.0);
        let mut random = Random::case(1);
        let points = measured(&mut random, truth, 64);
        let warp = warp(&points, 0.5).expect("a warp");
        let (inside, worst) = coverage(&warp, truth);
        assert!(inside > 0.995 && worst < 0.03, "{inside} {worst}");
        let middle = warp.at([3.0, 5.0]);
        assert!(middle[1] < 0.005, "{middle:?}");
        // Far away nothing is known, and nothing is corrected.
        let far = warp.at([20_000.0, 0.0]);
        assert!(far[0].abs() < 0.01 && far[1] >= 0.5 / 3.0, "{far:?}");
    }

    #[test]
    fn between_two_patches_that_were_measured_the_deviation_holds_the_bend_that_no_point_shows() {
        for seed in 0..3 {
            let mut random = Random::case(seed);
            let depth = random.range(0.05, 0.4);
            // Bent by so much over 400 mm; what lies in the patches looks flat.
            let truth = |[x, _]: [f64; 2]| depth * (1.0 - (x / 200.0).powi(2));
            let points: Vec<Observation> = (0..60)
                .map(|k| {
                    let x = if k % 2 == 0 { -170.0 } else { 170.0 } + random.range(-30.0, 30.0);
                    let at = [x, random.range(-30.0, 30.0)];
                    Observation {
                        at,
                        height: truth(at) - truth([170.0, 0.0]) + 0.005 * gauss(&mut random),
                        sigma: 0.005,
                    }
                })
                .collect();
            let warp = warp(&points, 0.5).expect("a warp");
            for x in -200..=200 {
                let at = [f64::from(x), 0.0];
                let [height, deviation] = warp.at(at);
                let error = height - (truth(at) - truth([170.0, 0.0]));
                assert!(error.abs() <= 3.0 * deviation, "seed {seed}, {x}: {error} {deviation} {depth}");
            }
            assert!(warp.at([170.0, 5.0])[1] < 0.01 && !warp.reaches([0.0, 0.0]));
        }
    }

    #[test]
    fn many_points_are_put_together_and_one_that_others_contradict_is_seen() {
        let truth = |[x, y]: [f64; 2]| 1e-6 * (x * x - y * y);
        let mut random = Random::case(2);
        let mut points = measured(&mut random, truth, 2500);
        assert!(thinned(&points).len() <= 2 * MOST_POINTS);
        let many = warp(&points, 0.5).expect("a warp");
        assert!(coverage(&many, truth).0 > 0.99);
        points.truncate(100);
        let few = warp(&points, 0.5).expect("a warp").factor();
        points[50].height += 0.3;
        let wrong = warp(&points, 0.5).expect("a warp");
        assert!(wrong.factor() > few + 0.2, "{} {few}", wrong.factor());
        assert!(warp(&points[..3], 0.5).is_none());
    }

    #[test]
    #[ignore = "slow: make test-all"]
    fn places_of_dented_plates_lie_within_three_deviations() {
        for (width, count) in [20.0, 40.0, 80.0].into_iter().flat_map(|w| [60, 120, 240].map(|n| (w, n))) {
            let found = parallel::map(40, |i| {
                let mut random = Random::case(1000 * count as u64 + i as u64);
                let truth = dents(&mut random, width);
                let points = measured(&mut random, &truth, count);
                coverage(&warp(&points, 0.5).expect("a warp"), &truth)
            });
            let mean = found.iter().map(|f| f.0).sum::<f64>() / found.len() as f64;
            let worst = found.iter().map(|f| f.1).fold(0.0, f64::max);
            println!("dents of {width} mm, {count} points: {:.2} % within, worst error {worst:.3} mm", 100.0 * mean);
            assert!(mean >= 0.99, "{width} {count}: {mean}");
        }
    }
}
