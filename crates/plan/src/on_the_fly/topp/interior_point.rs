//! One interior point descent over a stretch of a run: b there under speed, acceleration and jerk limits.
//!
//! A constraint is |Σ c b| ≤ T over three neighbours of b. For speed and acceleration T is 1; for jerk it is the
//! time between two references of acceleration, which is convex in b: its tangent never exceeds it. So every step
//! takes new tangents where it stands, and what keeps these keeps the limits; multipliers and tangents settle
//! together. Steps are primal-dual with predictor and corrector (Nocedal and Wright, Numerical Optimization,
//! ch. 14 and 16), in shares of b. A start may break limits: bounds begin as wide as it needs and shrink with
//! every step to the limits.
//!
//! [`crate::on_the_fly::banded_qp`] is the general method of this kind. This one knows its three kinds of rows and
//! takes new tangents at every step, which makes it some 26 times as fast on a path of 200,000 nodes.

use std::ops::Range;

use super::grid::Grid;
use super::jerk_rows;

/// Constraints that are computed together.
const LANES: usize = 4;
/// Most steps.
const STEPS: usize = 100;
/// Share of the way to the nearest constraint that a step may go.
const NEAR: f64 = 0.99;
/// Slack that the start gets, as a share of what it could be.
const ROOM: f64 = 0.3;
/// Excess over a limit that an answer may have, relative.
const EXCESS: f64 = 1e-4;
/// Least products aimed at, as a multiple of what of the gradient is not balanced: less ends in worse minima.
const UNBALANCED: f64 = 3.0;
/// Share of itself that b keeps in a step.
const KEPT: f64 = 0.1;

type Lanes = [f64; LANES];

/// What bounds a constraint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Bounded {
    /// 1: speed and acceleration.
    ByOne,
    /// The time around the second border: jerk.
    ByTime,
}

/// A few constraints over the same three borders; lanes that are not used have no factors and never bind.
#[derive(Clone, Debug)]
struct Pack {
    /// The first of the borders.
    at: u32,
    bounded: Bounded,
    /// What the bound is wider than the limit, as long as the start breaks it.
    excess: f64,
    factors: [Lanes; 3],
    /// Multipliers of Σ c b ≤ T and of -Σ c b ≤ T, and how they change.
    multipliers: [Lanes; 2],
    changes: [Lanes; 2],
}

impl Pack {
    #[inline]
    fn bound<'a>(&self, bounds: &'a [Bound]) -> &'a Bound {
        match self.bounded {
            Bounded::ByOne => &ONE,
            Bounded::ByTime => &bounds[self.at as usize],
        }
    }
}

/// The bound of a pack and its derivatives, per share of b.
#[derive(Clone, Copy, Debug)]
struct Bound {
    value: f64,
    slope: [f64; 3],
}

const ONE: Bound = Bound { value: 1.0, slope: [0.0; 3] };

/// A stretch that is being solved. Indices are borders from `origin` on; one that does not exist may follow.
pub(super) struct Stretch<'a> {
    grid: &'a Grid,
    origin: usize,
    /// The unknown ones.
    free: Range<usize>,
    b: Vec<f64>,
    packs: Vec<Pack>,
    bounds: Vec<Bound>,
    gradient: Vec<f64>,
    /// Lower half of the normal matrix, from the diagonal to the left.
    matrix: Vec<[f64; 3]>,
    predictor: Vec<f64>,
    step: Vec<f64>,
    /// Pull of the constraints per unit of centring, and of the predictor's second order.
    pull: Vec<[f64; 2]>,
    /// What of the gradient the multipliers do not balance.
    rest: Vec<f64>,
    /// Right side of the predictor: down the gradient, and back into broken limits.
    target: Vec<f64>,
}

/// Sums over a pass.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    /// What a step adds to slack × multiplier: by the slack's change, the multiplier's and both.
    by_slack: f64,
    by_multiplier: f64,
    by_both: f64,
    /// Largest relative fall of a slack and of a multiplier.
    slack_fall: f64,
    multiplier_fall: f64,
}

impl Sums {
    /// How far slacks and multipliers can go, at most 1.
    fn reach(&self, near: f64) -> [f64; 2] {
        [self.slack_fall, self.multiplier_fall].map(|fall| if fall > near { near / fall } else { 1.0 })
    }
}

impl<'a> Stretch<'a> {
    /// Some borders of `b` as unknowns, which all lie between the run's ends and are no larger than `most`.
    pub fn new(grid: &'a Grid, most: &[f64], b: &[f64], free: Range<usize>) -> Self {
        let Range { start: at, end: until } = free;
        let origin = at.saturating_sub(2);
        let end = (until + 2).min(b.len());
        let mut values = b[origin..end].to_vec();
        values.push(0.0);
        let n = values.len();
        let mut out = Self {
            grid,
            origin,
            free: at - origin..until - origin,
            b: values,
            packs: Vec::with_capacity(8 * n),
            bounds: vec![ONE; n],
            gradient: vec![0.0; n],
            matrix: vec![[0.0; 3]; n],
            predictor: vec![0.0; n],
            step: vec![0.0; n],
            pull: vec![[0.0; 2]; n],
            rest: vec![0.0; n],
            target: vec![0.0; n],
        };
        let mut rows = Vec::with_capacity(5 * grid.axes);
        // Every cell that touches an unknown border: acceleration, and the cap of the border.
        for cell in at - 1..until {
            rows.clear();
            rows.extend((0..grid.axes).flat_map(|axis| grid.accelerations(cell, axis)).map(|[l, r]| [l, r, 0.0]));
            leave_out(&mut rows, [most[cell], most[cell + 1], 0.0], 1.0);
            if cell + 1 < until {
                rows.push([0.0, most[cell + 1].recip(), 0.0]);
            }
            out.pack(cell, Bounded::ByOne, &rows);
        }
        // Every border whose two references see an unknown one: jerk.
        for i in (at - 1).max(1)..(until + 1).min(grid.cells()) {
            rows.clear();
            let limited = (0..grid.axes).filter(|&a| grid.ramp[a] > 0.0);
            rows.extend(limited.map(|axis| jerk_rows::change(grid, i, axis)));
            let most = [most[i - 1], most[i], most[i + 1]];
            leave_out(&mut rows, most, jerk_rows::time_around(grid, i, most).0);
            out.pack(i - 1, Bounded::ByTime, &rows);
        }
        out
    }

    /// Puts constraints over the borders from `from` on into packs.
    fn pack(&mut self, from: usize, bounded: Bounded, rows: &[[f64; 3]]) {
        let at = (from - self.origin) as u32;
        let mut lane = LANES;
        for row in rows {
            if lane == LANES {
                let empty = [[0.0; LANES]; 2];
                self.packs.push(Pack {
                    at,
                    bounded,
                    excess: 0.0,
                    factors: [[0.0; LANES]; 3],
                    multipliers: empty,
                    changes: empty,
                });
                lane = 0;
            }
            if let Some(pack) = self.packs.last_mut() {
                (0..3).for_each(|k| pack.factors[k][lane] = row[k]);
            }
            lane += 1;
        }
    }

    /// The unknowns that are within `accuracy` of the least time, in steps from `start`, which need not keep the
    /// limits; and how many steps it took. None where it does not settle.
    pub fn descend(&mut self, start: &[f64], accuracy: f64) -> Option<(usize, Vec<f64>)> {
        self.b[self.free.clone()].copy_from_slice(start);
        let count = (2 * LANES * self.packs.len()) as f64;
        let mut excess = f64::INFINITY;
        for round in 0..STEPS {
            self.measure();
            let total: f64 = self.gradient.iter().map(|g| g.abs()).sum();
            if round == 0 {
                self.first_multipliers(total / count);
            }
            let gap = self.assemble();
            excess = self.packs.iter().map(|p| p.excess / p.bound(&self.bounds).value).fold(0.0, f64::max);
            let unbalanced: f64 = self.rest[self.free.clone()].iter().map(|r| r.abs()).sum();
            // The time is of degree -1/2 in b: it is twice the sum.
            if gap.max(unbalanced) <= 2.0 * accuracy * total && excess <= EXCESS {
                return Some((round, self.b[self.free.clone()].to_vec()));
            }
            // Predictor: Newton's step towards products slack × multiplier of zero. One factorisation serves both
            // solves.
            self.factor();
            for i in self.free.clone() {
                self.predictor[i] = self.target[i];
            }
            solve(&self.matrix, self.free.clone(), &mut self.predictor);
            let sums = self.predict();
            let [primal, dual] = sums.reach(1.0);
            let after = gap + primal * sums.by_slack + dual * sums.by_multiplier + primal * dual * sums.by_both;
            // Mehrotra's σ = (gap after / gap)³ (Nocedal and Wright, algorithms 14.3 and 16.4).
            // Products must not fall faster than the gradient is balanced, or a bent measure runs into a corner.
            let centre = ((after / gap).clamp(0.0, 1.0).powi(3) * gap).max(UNBALANCED * unbalanced) / count;
            // Corrector: towards equal products, with what the predictor's step leaves of second order taken back.
            for i in self.free.clone() {
                self.step[i] = centre * self.pull[i][0] - self.pull[i][1] + self.target[i];
            }
            solve(&self.matrix, self.free.clone(), &mut self.step);
            let [primal, dual] = self.correct(centre).reach(NEAR);
            let fall = self.step[self.free.clone()].iter().fold(0.0f64, |m, s| m.max(-s));
            let primal = primal.min((1.0 - KEPT) / fall.max(1.0 - KEPT));
            if !(primal > 1e-9 && self.step.iter().all(|s| s.is_finite())) {
                break;
            }
            self.take_step(primal, dual);
        }
        (excess <= EXCESS).then(|| (STEPS, self.b[self.free.clone()].to_vec()))
    }

    /// Time's gradient and its second derivatives by shares of b, and the bounds of the jerk's packs.
    fn measure(&mut self) {
        self.gradient.fill(0.0);
        self.matrix.fill([0.0; 3]);
        let grid = self.grid;
        for right in self.free.start..=self.free.end {
            let (left, cell) = (right - 1, self.origin + right - 1);
            // φ = 2 c / (√l + √r).
            let c = if grid.is_end(cell) { 1.5 } else { 1.0 } * grid.width(cell);
            let root = [self.b[left].sqrt(), self.b[right].sqrt()];
            let sum = root[0] + root[1];
            let (two, three) = (c / (sum * sum), c / (sum * sum * sum));
            for (i, root) in [left, right].into_iter().zip(root) {
                self.gradient[i] -= two * root;
                self.matrix[i][0] += three * root * root + 0.5 * two * root;
            }
            self.matrix[right][1] += three * root[0] * root[1];
        }
        for i in (self.free.start - 1).max(1)..(self.free.end + 1).min(self.b.len() - 2) {
            let near = [self.b[i - 1], self.b[i], self.b[i + 1]];
            let (value, slope) = jerk_rows::time_around(grid, self.origin + i, near);
            self.bounds[i - 1] = Bound { value, slope: [0, 1, 2].map(|k| slope[k] * near[k]) };
        }
        // What is held neither pulls nor moves.
        for i in (0..self.free.start).chain(self.free.end..self.b.len()) {
            self.gradient[i] = 0.0;
        }
    }

    /// Multipliers to begin with, all products alike, and how much wider than the limits the bounds begin.
    fn first_multipliers(&mut self, product: f64) {
        for pack in &mut self.packs {
            pack.excess = 0.0;
            let view = View::of(pack, &self.b, &self.bounds);
            let least = view.slack.iter().flatten().copied().fold(f64::INFINITY, f64::min);
            let bound = pack.bound(&self.bounds).value;
            pack.excess = 0.0;
            // Both slacks of a row are twice the bound together.
            let allowed = ROOM * (2.0 * bound - least);
            pack.excess = (allowed - least).max(0.0);
            let view = View::of(pack, &self.b, &self.bounds);
            for side in 0..2 {
                pack.multipliers[side] = view.slack[side].map(|s| product / s);
            }
        }
    }

    /// Adds the constraints to the matrix; says the sum of slack × multiplier, and leaves what of the gradient the
    /// multipliers do not balance.
    fn assemble(&mut self) -> f64 {
        self.rest.copy_from_slice(&self.gradient);
        self.target.iter_mut().zip(&self.gradient).for_each(|(t, g)| *t = -g);
        let mut gap = [0.0; LANES];
        for pack in &self.packs {
            let at = pack.at as usize;
            let view = View::of(pack, &self.b, &self.bounds);
            let [up, down] = &pack.multipliers;
            let (mut sum, mut turn, mut force, mut lift) = ([0.0; LANES], [0.0; LANES], [0.0; LANES], [0.0; LANES]);
            for l in 0..LANES {
                gap[l] += up[l] * view.slack[0][l] + down[l] * view.slack[1][l];
                let (u, d) = (up[l] / view.slack[0][l], down[l] / view.slack[1][l]);
                (sum[l], turn[l]) = (u + d, u - d);
                (force[l], lift[l]) = (up[l] - down[l], up[l] + down[l]);
            }
            let c = &view.factors;
            let tau = &view.slope;
            let (weight, lift) = (total(&sum), total(&lift));
            let lean = [0, 1, 2].map(|k| dot(&turn, &c[k]));
            // Both sides of a row are τ · b ∓ c · b, so with their quotients multiplier / slack u and d the normal
            // matrix gets u (τ - c)(τ - c)ᵀ + d (τ + c)(τ + c)ᵀ, multiplied out here.
            for i in 0..3 {
                self.target[at + i] += pack.excess * (tau[i] * weight - lean[i]);
                self.rest[at + i] -= tau[i] * lift - dot(&force, &c[i]);
                for j in 0..=i {
                    let own = (0..LANES).map(|l| sum[l] * c[i][l] * c[j][l]).sum::<f64>();
                    self.matrix[at + i][i - j] += own + weight * tau[i] * tau[j] - tau[i] * lean[j] - lean[i] * tau[j];
                }
            }
        }
        total(&gap)
    }

    /// What the predictor does to slacks and multipliers, and the pull that the corrector needs.
    fn predict(&mut self) -> Sums {
        self.pull.fill([0.0; 2]);
        let mut sums = Sums::default();
        let [mut by_slack, mut by_multiplier, mut by_both, mut fall, mut rise] = [[0.0f64; LANES]; 5];
        for pack in &self.packs {
            let at = pack.at as usize;
            let view = View::of(pack, &self.b, &self.bounds);
            let change = view.change(&self.predictor[at..at + 3]);
            // Pull of both sides, their sum and their difference.
            let [mut one, mut second, mut one_turn, mut second_turn] = [[0.0; LANES]; 4];
            for side in 0..2 {
                let sign = [1.0, -1.0][side];
                for l in 0..LANES {
                    let (slack, multiplier, d) = (view.slack[side][l], pack.multipliers[side][l], change[side][l]);
                    let inverse = 1.0 / slack;
                    let relative = d * inverse;
                    let m = -multiplier * (1.0 + relative);
                    fall[l] = fall[l].max(-relative);
                    rise[l] = rise[l].max(1.0 + relative);
                    by_slack[l] += d * multiplier;
                    by_multiplier[l] += slack * m;
                    by_both[l] += d * m;
                    one[l] += inverse;
                    one_turn[l] += sign * inverse;
                    second[l] += relative * m;
                    second_turn[l] += sign * relative * m;
                }
            }
            let (one, second) = (total(&one), total(&second));
            for k in 0..3 {
                let c = &view.factors[k];
                self.pull[at + k][0] += view.slope[k] * one - dot(&one_turn, c);
                self.pull[at + k][1] += view.slope[k] * second - dot(&second_turn, c);
            }
        }
        (sums.by_slack, sums.by_multiplier, sums.by_both) = (total(&by_slack), total(&by_multiplier), total(&by_both));
        (sums.slack_fall, sums.multiplier_fall) = (most(&fall), most(&rise));
        sums
    }

    /// The corrector's changes of multipliers towards products of `centre`, and how far they can go.
    fn correct(&mut self, centre: f64) -> Sums {
        let [mut fall, mut drop] = [[0.0f64; LANES]; 2];
        for pack in &mut self.packs {
            let at = pack.at as usize;
            let view = View::of(pack, &self.b, &self.bounds);
            let (first, change) = (view.change(&self.predictor[at..at + 3]), view.change(&self.step[at..at + 3]));
            for side in 0..2 {
                for l in 0..LANES {
                    let (slack, multiplier) = (view.slack[side][l], pack.multipliers[side][l]);
                    let inverse = 1.0 / slack;
                    let relative = first[side][l] * inverse;
                    let second = -relative * multiplier * (1.0 + relative);
                    let falls = -change[side][l] * inverse;
                    let m = centre * inverse - second - multiplier + multiplier * falls;
                    pack.changes[side][l] = m;
                    fall[l] = fall[l].max(falls);
                    drop[l] = drop[l].max(-m / multiplier);
                }
            }
        }
        Sums { slack_fall: most(&fall), multiplier_fall: most(&drop), ..Sums::default() }
    }

    /// Moves b by a share of the step, and the multipliers by one of their changes; the bounds shrink with b.
    fn take_step(&mut self, primal: f64, dual: f64) {
        for i in self.free.clone() {
            self.b[i] *= 1.0 + primal * self.step[i];
        }
        for pack in &mut self.packs {
            pack.excess *= 1.0 - primal;
            for side in 0..2 {
                for l in 0..LANES {
                    pack.multipliers[side][l] += dual * pack.changes[side][l];
                }
            }
        }
    }

    /// Cholesky's factor in place, its diagonal inverted, over the unknown borders. A pivot that rounding has made
    /// too small is raised, which only shortens the step.
    fn factor(&mut self) {
        let (mut before, mut last) = ([0.0; 3], [0.0; 3]);
        for (n, i) in self.free.clone().enumerate() {
            // L Lᵀ with two entries left of the diagonal; `before` and `last` are the two rows above.
            let [d, mut l1, mut l2] = self.matrix[i];
            l2 = if n < 2 { 0.0 } else { l2 * before[0] };
            l1 = if n < 1 { 0.0 } else { (l1 - l2 * last[1]) * last[0] };
            let pivot = (d - l1 * l1 - l2 * l2).max(1e-14 * d).max(f64::MIN_POSITIVE);
            self.matrix[i] = [1.0 / pivot.sqrt(), l1, l2];
            (before, last) = (last, self.matrix[i]);
        }
    }
}

/// Leaves out what another constraint implies for all b up to `most`, where the bound is at least `least`: a
/// multiple of it by less than 1, and a rest that is small.
fn leave_out(rows: &mut Vec<[f64; 3]>, most: [f64; 3], least: f64) {
    let weigh = |row: &[f64; 3]| [0, 1, 2].map(|k| row[k] * most[k]);
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let size = |row: &[f64; 3]| dot(weigh(row), weigh(row));
    let Some(at) = (0..rows.len()).max_by(|&a, &b| size(&rows[a]).total_cmp(&size(&rows[b]))) else { return };
    rows.swap(0, at);
    let (first, length) = (weigh(&rows[0]), size(&rows[0]));
    let mut is_first = true;
    rows.retain(|row| {
        let row = weigh(row);
        let share = dot(row, first) / length;
        let rest: f64 = (0..3).map(|k| (row[k] - share * first[k]).abs()).sum();
        std::mem::take(&mut is_first) || share.abs() + rest / least > 1.0 + EXCESS
    });
}

/// Solves with the factor, in place.
fn solve(factor: &[[f64; 3]], free: Range<usize>, x: &mut [f64]) {
    let (mut before, mut last) = (0.0, 0.0);
    for i in free.clone() {
        let [d, l1, l2] = factor[i];
        x[i] = (x[i] - l1 * last - l2 * before) * d;
        (before, last) = (last, x[i]);
    }
    let (mut from_next, mut from_second) = (0.0, [0.0; 2]);
    for i in free.rev() {
        let [d, l1, l2] = factor[i];
        x[i] = (x[i] - from_next - from_second[0]) * d;
        from_next = l1 * x[i];
        from_second = [from_second[1], l2 * x[i]];
    }
}

/// A pack where b stands: factors per share of b, the bound's slope, and the slack of both sides.
struct View {
    factors: [Lanes; 3],
    slope: [f64; 3],
    excess: f64,
    slack: [Lanes; 2],
}

impl View {
    #[inline]
    fn of(pack: &Pack, b: &[f64], bounds: &[Bound]) -> Self {
        let at = pack.at as usize;
        let near = &b[at..at + 3];
        let bound = pack.bound(bounds);
        let mut factors = pack.factors;
        for (lanes, b) in factors.iter_mut().zip(near) {
            lanes.iter_mut().for_each(|c| *c *= b);
        }
        let along: Lanes = std::array::from_fn(|l| factors[0][l] + factors[1][l] + factors[2][l]);
        let value = bound.value + pack.excess;
        let slack = [along.map(|u| value - u), along.map(|u| value + u)];
        Self { factors, slope: bound.slope, excess: pack.excess, slack }
    }

    /// Change of both slacks by a step.
    #[inline]
    fn change(&self, step: &[f64]) -> [Lanes; 2] {
        let lift = self.slope[0] * step[0] + self.slope[1] * step[1] + self.slope[2] * step[2] - self.excess;
        let c = &self.factors;
        let along: Lanes = std::array::from_fn(|l| c[0][l] * step[0] + c[1][l] * step[1] + c[2][l] * step[2]);
        [along.map(|u| lift - u), along.map(|u| lift + u)]
    }
}

#[inline]
fn total(lanes: &Lanes) -> f64 {
    lanes.iter().sum()
}

#[inline]
fn dot(a: &Lanes, b: &Lanes) -> f64 {
    (0..LANES).map(|l| a[l] * b[l]).sum()
}

fn most(lanes: &Lanes) -> f64 {
    lanes.iter().copied().fold(0.0, f64::max)
}
