//! How a part is warped: a smooth correction of its height from what the rigid fit leaves of the points.
//!
//! A Gaussian process with the Matern covariance of order 3/2 (Rasmussen and Williams 2006, eq. 4.17), a plane of which
//! nothing is known, and the points' own noise. Nobody knows how smooth the warp of a part is, and few points do not
//! tell. So seven lengths are tried; each takes the largest amplitude that the points do not contradict, and counts by a
//! tempered share of how well its best one predicts the points, left out one by one (eq. 5.11): what several lengths
//! explain about as well stays in doubt, and the doubt is part of the deviation. Where points left out lie farther off
//! than the deviation says, it grows until they do not. Far from all points the correction goes to the plane, and the
//! deviation to the amplitude. But that was found over the gaps between points alone: a dent where none lies, or a bend
//! between two patches that the pose has taken up, may be many times larger. So farther from all points than a few of
//! their gaps the deviation is that of what the part may be warped by at most.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::hull::least_width;
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
    /// What a turn of the part about z, rad, and shifts along x and y, mm, change of it, mm.
    pub aside: [f64; 3],
}

/// What points say of the height of a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Told {
    /// The correction, mm.
    pub height: f64,
    /// Its standard deviation, mm, for a part that lies where the fit has it along x and y.
    pub deviation: f64,
    /// What of a part that lies aside the points have seen there, as [`Observation::aside`].
    pub aside: [f64; 3],
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
    /// The observations that each point was put together from.
    members: Vec<Vec<usize>>,
    models: Vec<Model>,
    factor: f64,
    /// What the part may be warped by at most, mm.
    limit: f64,
    /// How far points reach, mm.
    reach: f64,
    plane: Plane,
}

#[derive(Clone, Debug)]
struct Model {
    candidate: Candidate,
    cholesky: Cholesky<f64, Dyn>,
    /// What the covariances of a place are multiplied with: for its height, and what is seen aside.
    weights: DMatrix<f64>,
}

/// The height and tilt of the rigid fit, of which nothing is taken as known: a plane of a wide covariance.
#[derive(Clone, Copy, Debug)]
struct Plane {
    middle: [f64; 2],
    /// Half the longest distance of points, mm.
    half: f64,
    /// Standard deviation of the height, and of what the tilt makes of it at that distance, mm.
    deviation: f64,
}

impl Plane {
    fn new(points: &[Observation], limit: f64) -> Self {
        let (lo, hi) = span(points);
        let half = (apart(lo, hi) / 2.0).max(1e-3);
        Self { middle: [0, 1].map(|k| (lo[k] + hi[k]) / 2.0), half, deviation: limit.max(LEAST_SIGMA) }
    }

    fn covariance(&self, a: [f64; 2], b: [f64; 2]) -> f64 {
        let along = |k: usize| (a[k] - self.middle[k]) * (b[k] - self.middle[k]);
        self.deviation * self.deviation * (1.0 + (along(0) + along(1)) / (self.half * self.half))
    }
}

/// The covariance of heights for one length and amplitude.
#[derive(Clone, Copy)]
struct Covariance<'a> {
    plane: &'a Plane,
    length: f64,
    amplitude: f64,
}

impl Covariance<'_> {
    fn of(&self, a: [f64; 2], b: [f64; 2]) -> f64 {
        self.amplitude * self.amplitude * matern(apart(a, b), self.length) + self.plane.covariance(a, b)
    }

    fn solved(&self, points: &[Observation]) -> Option<Cholesky<f64, Dyn>> {
        let n = points.len();
        let matrix = DMatrix::from_fn(n, n, |i, k| {
            let noise = if i == k { points[i].sigma.powi(2) } else { 0.0 };
            self.of(points[i].at, points[k].at) + noise
        });
        Cholesky::new(matrix)
    }
}

/// Points beyond these are put together in square cells.
pub const MOST_POINTS: usize = 300;

/// Points of a cell that count as independent, at most.
const INDEPENDENT: usize = 10;

/// By how many times the scatter of a place has to be larger than its noise, as variances: three deviations.
const DISAGREE: f64 = 9.0;

/// Least standard deviation of an observation, mm: closer points would make the equations singular.
const LEAST_SIGMA: f64 = 2e-4;

/// The longest distance between points, over the shortest length that is tried; each next is twice as long.
const FINEST: f64 = 24.0;
const LENGTHS: i32 = 7;

/// Amplitudes that are tried, in half powers of two of the deviation that the limit says.
const AMPLITUDES: std::ops::Range<i32> = -16..4;

/// By how much less, in logarithms, the points may be predicted by a larger amplitude that they do not contradict: two
/// deviations.
const NOT_CONTRADICTED: f64 = 2.0;

/// Share of the logarithm of what was predicted that weighs the lengths: neighbours say much the same.
const TEMPER: f64 = 0.12;

/// Lengths that weigh less are left out.
const LEAST_WEIGHT: f64 = 1e-3;

/// The deviation of a height, in units of what a part may be warped by at most.
pub const DEVIATION_OF_LIMIT: f64 = 1.0 / 3.0;

/// Points reach so many times as far as half of them have their nearest neighbours: some farther than the largest gap of
/// some hundred points that lie at random, which is three times as far.
const REACH: f64 = 4.0;

/// And no farther than this share of their least width: points along a rim, or in two rows, say nothing of a bend between
/// them.
const REACH_ACROSS: f64 = 0.4;

/// Points nearer than this share of their longest distance are one place: left out one by one they would predict one
/// another over any length.
const SAME_PLACE: f64 = 0.002;

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

/// The observations that are put together: those of a place, and where there are many those of a cell.
fn members(points: &[Observation]) -> Vec<Vec<usize>> {
    if points.len() <= MOST_POINTS { places(points) } else { cells(points) }
}

/// Observations as one; where those of a place disagree, they are no surer than that.
fn together(points: &[Observation], of: &[usize], are_of_a_place: bool) -> Observation {
    let n = of.len() as f64;
    let mean = |value: &dyn Fn(&Observation) -> f64| of.iter().map(|&i| value(&points[i])).sum::<f64>() / n;
    let height = mean(&|p| p.height);
    let noise = mean(&|p| p.sigma.max(LEAST_SIGMA).powi(2)) / of.len().min(INDEPENDENT) as f64;
    let scatter = mean(&|p| (p.height - height).powi(2)) / (n - 1.0).max(1.0);
    let variance = if are_of_a_place && scatter > DISAGREE * noise { scatter } else { noise };
    Observation {
        at: [mean(&|p| p.at[0]), mean(&|p| p.at[1])],
        height,
        sigma: variance.sqrt(),
        aside: [0, 1, 2].map(|k| mean(&|p| p.aside[k])),
    }
}

/// The observations of square cells.
fn cells(points: &[Observation]) -> Vec<Vec<usize>> {
    let (lo, hi) = span(points);
    let side = ((hi[0] - lo[0]) * (hi[1] - lo[1]) / MOST_POINTS as f64).sqrt();
    let side = side.max((hi[0] - lo[0]).max(hi[1] - lo[1]) / MOST_POINTS as f64).max(1e-6);
    let mut cells = std::collections::BTreeMap::<[i64; 2], Vec<usize>>::new();
    for (i, p) in points.iter().enumerate() {
        let cell = [1, 0].map(|k| ((p.at[k] - lo[k]) / side).floor() as i64);
        cells.entry(cell).or_default().push(i);
    }
    cells.into_values().collect()
}

/// The observations of each place: each is near to the first of the place, in their order.
fn places(points: &[Observation]) -> Vec<Vec<usize>> {
    let (lo, hi) = span(points);
    let near = SAME_PLACE * apart(lo, hi);
    let mut places: Vec<Vec<usize>> = Vec::new();
    for (i, p) in points.iter().enumerate() {
        match places.iter_mut().find(|place| apart(points[place[0]].at, p.at) <= near) {
            Some(place) => place.push(i),
            None => places.push(vec![i]),
        }
    }
    places
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
    let gap = *nearest.select_nth_unstable_by(half, f64::total_cmp).1;
    (REACH * gap).min(REACH_ACROSS * least_width(points.iter().map(|p| p.at).collect()))
}

/// Fits the warp of a part that is warped by `limit`, mm, at most to what points show; None of fewer than four.
pub fn warp(points: &[Observation], limit: f64) -> Option<Warp> {
    let members = members(points);
    if members.len() < 4 {
        return None;
    }
    let are_places = points.len() <= MOST_POINTS;
    let points: Vec<Observation> = members.iter().map(|of| together(points, of, are_places)).collect();
    let (lo, hi) = span(&points);
    let longest = apart(lo, hi).max(1e-3);
    let heights = heights(&points);
    let plane = Plane::new(&points, limit);
    let expected = (limit * DEVIATION_OF_LIMIT).max(LEAST_SIGMA);
    // The best score of a length, and the largest amplitude that the points do not contradict.
    let best = |length: f64| {
        let tried = AMPLITUDES.filter_map(|k| {
            let amplitude = expected * math::exp(f64::from(k) * 0.5 * std::f64::consts::LN_2);
            let covariance = Covariance { plane: &plane, length, amplitude };
            Some((left_out(&covariance.solved(&points)?, &heights).score(), amplitude))
        });
        let tried: Vec<(f64, f64)> = tried.collect();
        let (score, most) = tried.iter().copied().max_by(|a, b| a.0.total_cmp(&b.0))?;
        let is_open = |t: &&(f64, f64)| t.0 >= score - NOT_CONTRADICTED && t.1 <= expected.max(most);
        let amplitude = tried.iter().filter(is_open).map(|t| t.1).fold(most, f64::max);
        Some((score, amplitude))
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
        let cholesky = Covariance { plane: &plane, length, amplitude }.solved(&points)?;
        let right =
            DMatrix::from_fn(points.len(), 4, |i, k| if k == 0 { points[i].height } else { points[i].aside[k - 1] });
        let weights = cholesky.solve(&right);
        Some(Model { candidate: Candidate { length, amplitude, weight: weight(score) / all }, cholesky, weights })
    });
    let mut warp = Warp { models: models.collect(), reach: reach(&points), points, members, factor: 1.0, limit, plane };
    let largest = warp.left_out().into_iter().map(|[error, deviation]| (error / deviation).abs()).fold(0.0, f64::max);
    warp.factor = (largest / LARGEST_LEFT_OUT).max(1.0);
    Some(warp)
}

impl Warp {
    /// What the points say of a place, table frame.
    pub fn at(&self, at: [f64; 2]) -> Told {
        let mut aside = [0.0; 3];
        let found = self.models.iter().map(|model| {
            let Candidate { length, amplitude, weight } = model.candidate;
            let covariance = Covariance { plane: &self.plane, length, amplitude };
            let n = self.points.len();
            let row = DVector::from_iterator(n, self.points.iter().map(|p| covariance.of(p.at, at)));
            let [mean, seen @ ..] = [0, 1, 2, 3].map(|k| row.dot(&model.weights.column(k)));
            (0..3).for_each(|k| aside[k] += weight * seen[k]);
            let half = model.cholesky.l_dirty().solve_lower_triangular(&row).unwrap_or_else(|| DVector::zeros(n));
            [weight, mean, (covariance.of(at, at) - half.norm_squared()).max(0.0)]
        });
        let [height, variance] = mixed(&found.collect::<Vec<_>>());
        let least = if self.reaches(at) { 0.0 } else { self.limit * DEVIATION_OF_LIMIT };
        Told { height, deviation: (self.factor * variance.sqrt()).max(least), aside }
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
        let told = |i: usize, row: usize| {
            let Told { height, deviation, .. } = self.at([at(i, 0), at(row, 1)]);
            [height, deviation]
        };
        let rows = parallel::map(NET, |row| (0..NET).map(|i| told(i, row)).collect::<Vec<_>>());
        [0, 1].map(|m| {
            let all = rows.iter().flatten().map(|found| found[m]);
            all.fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], v| [lo.min(v), hi.max(v)])
        })
    }

    /// The points that it was fitted to, those of a cell together.
    pub fn points(&self) -> &[Observation] {
        &self.points
    }

    /// The observations that each of these points was put together from, by their numbers.
    pub fn members(&self) -> &[Vec<usize>] {
        &self.members
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
            Observation { at, height: truth(at) + 0.005 * gauss(random), sigma: 0.005, aside: [0.0; 3] }
        });
        all.collect()
    }

    /// Share of all places within three deviations, and the worst error, mm.
    fn coverage(warp: &Warp, truth: impl Fn([f64; 2]) -> f64) -> (f64, f64) {
        let net = net(46);
        let found: Vec<(f64, f64)> = net
            .iter()
            .map(|&p| (warp.at(p), truth(p)))
            .map(|(told, z)| ((told.height - z).abs(), told.deviation))
            .collect();
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
        assert!(middle.deviation < 0.005, "{middle:?}");
        // Far away nothing is known.
        let far = warp.at([20_000.0, 0.0]);
        assert!(far.deviation >= 0.5 / 3.0, "{far:?}");
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
                        aside: [0.0; 3],
                    }
                })
                .collect();
            let warp = warp(&points, 0.5).expect("a warp");
            for x in -200..=200 {
                let at = [f64::from(x), 0.0];
                let Told { height, deviation, .. } = warp.at(at);
                let error = height - (truth(at) - truth([170.0, 0.0]));
                assert!(error.abs() <= 3.0 * deviation, "seed {seed}, {x}: {error} {deviation} {depth}");
            }
            assert!(warp.at([170.0, 5.0]).deviation < 0.01 && !warp.reaches([0.0, 0.0]));
        }
    }

    /// Points of a level part with noise, less the plane that a fit takes out of them.
    fn noise_less_its_plane(random: &mut Random, places: &[[f64; 2]], sigma: f64) -> (Vec<Observation>, [f64; 3]) {
        let noise: Vec<f64> = places.iter().map(|_| sigma * gauss(random)).collect();
        let rows = DMatrix::from_fn(places.len(), 3, |i, k| if k == 0 { 1.0 } else { places[i][k - 1] });
        let right = DVector::from_vec(noise.clone());
        let plane = (rows.transpose() * &rows).try_inverse().expect("a plane") * rows.transpose() * right;
        let of = |p: [f64; 2]| plane[0] + plane[1] * p[0] + plane[2] * p[1];
        let shown = places.iter().zip(noise);
        let points = shown.map(|(&at, z)| Observation { at, height: z - of(at), sigma, aside: [0.0; 3] });
        (points.collect(), [plane[0], plane[1], plane[2]])
    }

    #[test]
    fn noise_leaves_the_plane_of_a_level_part_in_doubt() {
        for (side, sigma) in [(4, 0.005), (6, 0.02), (10, 0.005)] {
            let (mut inside, mut all) = (0, 0);
            for seed in 0..20 {
                let mut random = Random::case(seed);
                let (points, [z, x, y]) = noise_less_its_plane(&mut random, &net(side), sigma);
                let warp = warp(&points, 0.5).expect("a warp");
                for at in net(7) {
                    // The part is level: the fit has put it off by minus that plane.
                    let told = warp.at(at);
                    let error = told.height + z + x * at[0] + y * at[1];
                    inside += usize::from(error.abs() <= 3.0 * told.deviation);
                    all += 1;
                    assert!(told.deviation < 1.5 * sigma, "{side}: {told:?}");
                }
            }
            assert!(inside * 100 >= all * 99, "{side}, {sigma}: {inside} of {all}");
        }
    }

    #[test]
    fn places_that_are_measured_twice_are_known_as_closely_as_their_noise_says() {
        let truth = |[x, y]: [f64; 2]| 0.15 * math::sin(x / 120.0) * math::cos(y / 140.0);
        for seed in 0..2 {
            let mut random = Random::case(seed);
            let once = measured(&mut random, truth, 49);
            let again = once.iter().map(|p| Observation { height: truth(p.at) + 0.005 * gauss(&mut random), ..*p });
            let twice: Vec<Observation> = once.iter().copied().chain(again).collect();
            let [few, many] = [&once, &twice].map(|points| warp(points, 0.5).expect("a warp"));
            let worst = |warp: &Warp| warp.ranges()[1][1];
            assert!(worst(&many) < 1.1 * worst(&few), "seed {seed}: {} {}", worst(&many), worst(&few));
            assert!(coverage(&many, truth).0 > 0.99, "seed {seed}");
        }
    }

    #[test]
    fn a_place_is_no_surer_than_its_points_agree_and_no_longer_than_its_points_are_near_to_the_first() {
        let point = |x: f64, height: f64| Observation { at: [x, 0.0], height, sigma: 0.001, aside: [0.0; 3] };
        let mut points: Vec<Observation> = net(5).into_iter().map(|at| Observation { at, ..point(0.0, 0.0) }).collect();
        points.extend([point(30.0, 0.0), point(30.2, 0.25)]);
        let warp = warp(&points, 0.3).expect("a warp");
        let known = warp.points().last().expect("the place that was measured twice");
        assert_eq!(warp.members().last(), Some(&vec![25, 26]));
        assert!((known.sigma - 0.125).abs() < 1e-9 && (known.height - 0.125).abs() < 1e-9, "{known:?}");
        // A line of points that are each near to the next.
        let line: Vec<Observation> = (0..251).map(|k| point(f64::from(k), 0.0)).collect();
        let far = [Observation { at: [0.0, 545.0], ..line[0] }];
        assert!(members(&[&line[..], &far].concat()).len() > 120);
    }

    #[test]
    fn points_along_a_rim_say_nothing_of_what_lies_within_it() {
        let circle =
            |k: i32| [0, 1].map(|axis| 220.0 * math::cos(f64::from(k - 3 * axis) * std::f64::consts::TAU / 12.0));
        let rim: Vec<[f64; 2]> = (0..12).map(circle).collect();
        let corners = [[-220.0, -220.0], [220.0, -220.0], [220.0, 220.0], [-220.0, 220.0]];
        // A corner that is moved by 3 mm turns the direction along which they spread most.
        let moved = [[-220.0, -220.0], [220.0, -220.0], [223.0, 223.0], [-220.0, 220.0]];
        let row = |count: i32, apart: f64| -> Vec<[f64; 2]> {
            let along = |k: i32| f64::from(k % count) * 80.0 - f64::from(count - 1) * 40.0;
            (0..2 * count).map(|k| [along(k), (f64::from(k / count) - 0.5) * apart]).collect()
        };
        let (long, short) = (row(6, 400.0), row(6, 300.0));
        for places in [&rim[..], &corners[..], &moved[..], &long[..], &short[..]] {
            let mut random = Random::case(5);
            let warp = warp(&noise_less_its_plane(&mut random, places, 0.005).0, 0.5).expect("a warp");
            assert!(warp.at([0.0; 2]).deviation >= 0.5 / 3.0, "{} points: {:?}", places.len(), warp.at([0.0; 2]));
        }
        // Nine in a net show that it sags.
        let sag = |[x, y]: [f64; 2]| -0.3 * (1.0 - (x * x + y * y) / 1e5);
        for seed in 0..20 {
            let mut random = Random::case(seed);
            let points = measured(&mut random, sag, 9);
            let (inside, _) = coverage(&warp(&points, 0.5).expect("a warp"), sag);
            assert!(inside > 0.99, "seed {seed}: {inside}");
        }
    }

    #[test]
    fn what_lies_aside_is_seen_between_points_of_the_same_slope_and_not_on_a_ramp() {
        // Two level areas and a ramp of 20 mm between them, on which no point lies.
        let slope = |x: f64| if x.abs() < 10.0 { 0.8 } else { 0.0 };
        let places: Vec<[f64; 2]> = net(8).into_iter().filter(|p| slope(p[0]) == 0.0).collect();
        let point = |at: [f64; 2]| Observation { at, height: 0.0, sigma: 0.005, aside: [0.0, -slope(at[0]), 0.0] };
        let level: Vec<Observation> = places.iter().map(|&at| point(at)).collect();
        let told = warp(&level, 0.1).expect("a warp").at([0.0; 2]);
        assert!(told.aside.iter().all(|v| v.abs() < 1e-9), "{told:?}");
        // A slope that all points have is seen everywhere.
        let leaning: Vec<Observation> = level.iter().map(|p| Observation { aside: [0.0, -0.3, 0.0], ..*p }).collect();
        let told = warp(&leaning, 0.1).expect("a warp").at([0.0; 2]);
        assert!((told.aside[1] + 0.3).abs() < 1e-3, "{told:?}");
    }

    #[test]
    fn many_points_are_put_together_and_one_that_others_contradict_is_seen() {
        let truth = |[x, y]: [f64; 2]| 1e-6 * (x * x - y * y);
        let mut random = Random::case(2);
        let mut points = measured(&mut random, truth, 2500);
        assert!(members(&points).len() <= 2 * MOST_POINTS);
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
