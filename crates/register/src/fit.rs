//! The fit: Gauss-Newton steps over pairs and touches together.
//!
//! The unknowns are a small motion of the part on the stage: a rotation vector about the middle of the points and a
//! shift. A pair gives three equations; a touch one, its distance to the part along the normal (Chen and Medioni 1992).
//! Touches are weighted by Tukey's biweight, with the median of their distances as scale, so clamps and dirt do not
//! count. Where some do not, the fit is tried again from weights that count them all and narrow down by halves (graduated
//! non-convexity: Blake and Zisserman, Visual Reconstruction, 1987), and the better of both is taken: a start that was
//! off must not make an outlier of the few touches that hold a motion. Motions to which all distances are blind, by more than what the facets' own normals could hold, are left as
//! they are and named.

use nalgebra::{Matrix6, SMatrix, SVector, SymmetricEigen, Vector3, Vector6};

use super::closed_form::{Pair, closed_form};
use super::facets::{Contact, Facets};
use super::motion::Motion;
use terrace_core::geom::SpacePoint;

/// A point of the stage that lies on the part, at a place that is not known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Touch {
    /// The centre of the tip, or the point that a sensor saw; table frame, mm.
    pub stage: SpacePoint,
    /// How far it stands off the part: the radius of the tip, mm.
    pub off: f64,
    /// Standard deviation, mm: along the normal of a touch, along z of a sensor.
    pub sigma: f64,
    /// Whether the noise is along z, as a sensor's.
    pub is_along_z: bool,
}

/// What was measured.
#[derive(Clone, Copy, Debug)]
pub struct Points<'a> {
    /// Points with partners.
    pub pairs: &'a [Pair],
    /// Points without.
    pub touches: &'a [Touch],
    /// The part; used where there are touches.
    pub part: &'a Facets,
    /// Whether the part may be warped: touches then count by how far they spread, not by their noise alone, since what
    /// they are off by is the warp, which must not shift the part aside against features.
    pub is_warped: bool,
}

impl Points<'_> {
    /// How many times its noise a touch counts as being off, where touches spread so.
    fn counted(&self, spread: f64) -> f64 {
        if self.is_warped { spread } else { 1.0 }
    }
}

/// How surely a part lies where it does: the covariance of a small motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Uncertainty {
    /// The point that it turns about, table frame, mm.
    pub centre: SpacePoint,
    /// Covariance of the rotation vector about the centre, rad, and the shift, mm.
    pub covariance: [[f64; 6]; 6],
}

/// A motion that the points do not hold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FreeMotion {
    /// Rotation vector, rad, about the middle of the points; the longer of it, times the extent of the points, and the
    /// shift has length 1.
    pub turn: SpacePoint,
    /// Shift, mm.
    pub shift: SpacePoint,
    /// Mean distance of the points from their middle, mm.
    pub extent: f64,
}

/// How much larger the part is on the stage than by its file; reported, never applied.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// Part per part: 1e-5 is 10 um over a metre.
    pub excess: f64,
    /// Its standard deviation.
    pub sigma: f64,
}

/// What is left of a touch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TouchResidual {
    /// How far the point lies above the part as fitted, along the normal, mm.
    pub distance: f64,
    /// Whether it lies on the part: no clamp, no dirt, no missed touch.
    pub is_on_part: bool,
    /// Where the part would be touched, table frame, mm.
    pub at: SpacePoint,
    /// Normal of the part there, or the direction from its edge.
    pub normal: SpacePoint,
    /// Standard deviation of the distance, mm.
    pub sigma: f64,
}

/// Where the part lies.
#[derive(Clone, Debug)]
pub struct Fit {
    /// From the part as the job turns it to the table frame.
    pub motion: Motion,
    /// How surely.
    pub uncertainty: Uncertainty,
    /// The motions that the points leave as the start had them.
    pub free: Vec<FreeMotion>,
    /// Of the part; None where the points do not hold it.
    pub scale: Option<Scale>,
    /// Stage position less fitted position of each pair, mm.
    pub pairs: Vec<SpacePoint>,
    /// Of each touch.
    pub touches: Vec<TouchResidual>,
    /// Root of the mean square of residuals over their stated noise: about 1 where the noise is as stated. The
    /// covariance holds the larger of that and 1.
    pub noise_factor: f64,
}

/// Beyond this many deviations a touch does not count (Tukey; 95 % efficient under normal noise).
const TUKEY: f64 = 4.685;

/// A median of absolute normal deviates, as a standard deviation.
const MEDIAN: f64 = 1.4826;

/// Steps at most, and the step that ends them: mm, and mm at the extent of the points.
const STEPS: usize = 60;
const LEAST_STEP: f64 = 1e-11;

/// Scales from which the weights narrow down, in units of the noise, widest first, the steps at each, and the touches
/// that are used there at most.
const WIDE: [f64; 7] = [128.0, 64.0, 32.0, 16.0, 8.0, 4.0, 2.0];
const WIDE_STEPS: usize = 10;
const WIDE_TOUCHES: usize = 2000;

/// Touches that a start is tried with, and steps from each start.
const TRIED: usize = 80;
const TRIED_STEPS: usize = 10;

/// Turns that are tried about each axis, rad: 4 degrees to either side.
const TRIED_TURN: f64 = 0.07;

/// A motion is free where the mean square of what it changes is below so many times what facets could hold of it by the
/// angles between them, or below this.
const OF_FACETS: f64 = 4.0;
const BLIND: f64 = 1e-8;

/// Sums of equations.
struct Normal {
    matrix: Matrix6<f64>,
    right: Vector6<f64>,
    /// The same with the scale as seventh unknown.
    with_scale: SMatrix<f64, 7, 7>,
    right_scale: SVector<f64, 7>,
    /// Sum of weights, and of weights times the bend of the facets.
    weight: f64,
    bend: f64,
    /// Weights times the square of the distance from the middle.
    spread: f64,
}

impl Normal {
    fn new() -> Self {
        Self {
            matrix: Matrix6::zeros(),
            right: Vector6::zeros(),
            with_scale: SMatrix::zeros(),
            right_scale: SVector::zeros(),
            weight: 0.0,
            bend: 0.0,
            spread: 0.0,
        }
    }

    /// Adds the equation that moving the part at `arm` from the middle along `direction` closes `residual`.
    fn add(&mut self, arm: &Vector3<f64>, direction: &Vector3<f64>, residual: f64, weight: f64) {
        let turn = arm.cross(direction);
        let row = Vector6::new(turn.x, turn.y, turn.z, direction.x, direction.y, direction.z);
        self.matrix += row * row.transpose() * weight;
        self.right += row * (residual * weight);
        let grown = arm.dot(direction);
        let row = SVector::<f64, 7>::from([turn.x, turn.y, turn.z, direction.x, direction.y, direction.z, grown]);
        self.with_scale += row * row.transpose() * weight;
        self.right_scale += row * (residual * weight);
        self.weight += weight;
        self.spread += weight * arm.norm_squared();
    }

    /// Mean distance of the points from their middle, mm.
    fn extent(&self) -> f64 {
        (self.spread / self.weight.max(f64::MIN_POSITIVE)).sqrt().max(1e-6)
    }

    /// The unknowns in units that weigh alike: turns by the extent.
    fn units(&self) -> Vector6<f64> {
        let turn = 1.0 / self.extent();
        Vector6::new(turn, turn, turn, 1.0, 1.0, 1.0)
    }

    /// What the equations hold, and what they leave free.
    fn solved(&self) -> Solved {
        let units = self.units();
        let scaled = Matrix6::from_diagonal(&units) * self.matrix * Matrix6::from_diagonal(&units);
        let eigen = SymmetricEigen::new(scaled);
        let floor = self.weight * BLIND + OF_FACETS * self.bend;
        let mut inverse = Matrix6::zeros();
        let mut free = Vec::new();
        for k in 0..6 {
            let v = eigen.eigenvectors.column(k).component_mul(&units);
            if eigen.eigenvalues[k] > floor {
                inverse += v * v.transpose() / eigen.eigenvalues[k];
            } else {
                free.push(v);
            }
        }
        Solved { step: inverse * self.right, inverse, free }
    }

    /// The scale, as a seventh unknown; None where it is not held.
    fn scale(&self, solved: &Solved) -> Option<Scale> {
        if !solved.free.is_empty() {
            return None;
        }
        let units = self.units();
        let units = SVector::<f64, 7>::from_fn(|k, _| if k < 6 { units[k] } else { 1.0 / self.extent() });
        let units = SMatrix::<f64, 7, 7>::from_diagonal(&units);
        let eigen = SymmetricEigen::new(units * self.with_scale * units);
        let floor = self.weight * BLIND + OF_FACETS * self.bend;
        let mut inverse = SMatrix::<f64, 7, 7>::zeros();
        for k in 0..7 {
            if eigen.eigenvalues[k] <= floor {
                return None;
            }
            let v = units * eigen.eigenvectors.column(k);
            inverse += v * v.transpose() / eigen.eigenvalues[k];
        }
        let solution = inverse * self.right_scale;
        Some(Scale { excess: solution[6], sigma: inverse[(6, 6)].sqrt() })
    }
}

/// What equations come to.
struct Solved {
    step: Vector6<f64>,
    inverse: Matrix6<f64>,
    free: Vec<Vector6<f64>>,
}

/// A touch against the part as it lies by some motion.
struct Met {
    arm_end: Vector3<f64>,
    /// Normal in the table frame.
    normal: Vector3<f64>,
    /// Above the part, less what it should stand off.
    distance: f64,
    /// Along the normal.
    sigma: f64,
    bend2: f64,
}

impl Touch {
    fn met(&self, part: &Facets, motion: &Motion) -> Option<Met> {
        let centre = motion.back(self.stage);
        let Contact { at, normal, bend2 } = part.nearest(centre)?;
        let (at, n) = (Vector3::from(at), Vector3::from(normal));
        let to = Vector3::from(centre) - at;
        let length = to.norm();
        // At an edge the tip stands off along the line to it.
        let is_beside = length > 1e-3 && (to.dot(&n) / length).abs() > 0.7;
        let along = if is_beside { to * (to.dot(&n).signum() / length) } else { n };
        let normal = motion.turn(&along);
        let sigma = if self.is_along_z { self.sigma * normal.z.abs().max(0.1) } else { self.sigma };
        Some(Met { arm_end: motion.move_point(&at), normal, distance: along.dot(&to) - self.off, sigma, bend2 })
    }
}

/// Fits the part to what was measured, from the motion `start` that is right to some millimetres and degrees; pairs that
/// hold the part by themselves are their own start.
pub fn fit(points: &Points<'_>, start: &Motion) -> Fit {
    let by_pairs = Solver { points, every: usize::MAX };
    let mut motion = *start;
    if points.pairs.len() >= 3 {
        motion = by_pairs.stepped(closed_form(points.pairs), STEPS);
        let held = by_pairs.normal(&motion, 1.0).0.solved().free.is_empty();
        motion = if held { motion } else { by_pairs.stepped(*start, STEPS) };
        if !held && !points.touches.is_empty() {
            motion = best_start(points, &motion);
        }
    } else if !points.touches.is_empty() {
        motion = best_start(points, &by_pairs.stepped(*start, STEPS));
    } else {
        motion = by_pairs.stepped(motion, STEPS);
    }
    let all = Solver { points, every: 1 };
    let motion = all.stepped(motion, STEPS);
    let other = if all.counts_every_touch(&motion) { None } else { Some(all.stepped(narrowed(points, motion), STEPS)) };
    let better = other.filter(|other| {
        let scale = all.scale(&motion).min(all.scale(other));
        all.robust_cost(other, scale) < all.robust_cost(&motion, scale)
    });
    finished(&all, better.unwrap_or(motion))
}

/// A fit with weights that are wide at first and narrow down.
fn narrowed(points: &Points<'_>, start: Motion) -> Motion {
    let some = Solver { points, every: points.touches.len().div_ceil(WIDE_TOUCHES).max(1) };
    WIDE.iter().fold(start, |motion, &least| some.stepped_with(motion, WIDE_STEPS, least))
}

/// The motion that fits pairs best by their weights.
pub(crate) fn refined(pairs: &[Pair]) -> Motion {
    let points = Points { pairs, touches: &[], part: &Facets::new([]), is_warped: false };
    Solver { points: &points, every: usize::MAX }.stepped(closed_form(pairs), STEPS)
}

/// Of some starts around one the one from which touches fit best.
fn best_start(points: &Points<'_>, around: &Motion) -> Motion {
    let few = Solver { points, every: points.touches.len().div_ceil(TRIED).max(1) };
    let centre = middle(points.touches.iter().map(|t| t.stage));
    let tried = (0..27).map(|k| {
        let [x, y, z] = [k % 3, k / 3 % 3, k / 9].map(|i| f64::from(i - 1) * TRIED_TURN);
        let step = Vector6::new(x, y, z, 0.0, 0.0, 0.0);
        few.stepped(around.then_small(&centre, &step), TRIED_STEPS)
    });
    let costs = tried.map(|motion| (few.cost(&motion), motion));
    costs.min_by(|a, b| a.0.total_cmp(&b.0)).map_or(*around, |(_, motion)| motion)
}

fn middle(points: impl Iterator<Item = SpacePoint>) -> Vector3<f64> {
    let (sum, count) = points.fold((Vector3::zeros(), 0.0), |(sum, n), p| (sum + Vector3::from(p), n + 1.0));
    sum / f64::max(count, 1.0)
}

/// Fits all pairs and every nth touch.
struct Solver<'a> {
    points: &'a Points<'a>,
    every: usize,
}

impl Solver<'_> {
    fn touches(&self) -> impl Iterator<Item = &Touch> {
        let take = if self.every == usize::MAX { 0 } else { self.points.touches.len() };
        self.points.touches.iter().take(take).step_by(self.every)
    }

    /// The middle of all points on the stage.
    fn centre(&self) -> Vector3<f64> {
        middle(self.points.pairs.iter().map(|p| p.stage).chain(self.touches().map(|t| t.stage)))
    }

    fn met(&self, motion: &Motion) -> Vec<Met> {
        self.touches().filter_map(|touch| touch.met(self.points.part, motion)).collect()
    }

    /// The equations at a motion, and the standard deviation of touches, in units of their noise, at least `least`.
    fn normal(&self, motion: &Motion, least: f64) -> (Normal, f64) {
        let centre = self.centre();
        let mut normal = Normal::new();
        for pair in self.points.pairs {
            let found = motion.move_point(&Vector3::from(pair.part));
            for k in 0..3 {
                let direction = Vector3::ith(k, 1.0);
                let weight = pair.sigma[k].powi(-2);
                normal.add(&(found - centre), &direction, pair.stage[k] - found[k], weight);
            }
        }
        let met = self.met(motion);
        let spread = spread(&met).max(least);
        let counted = self.points.counted(spread);
        for touch in &met {
            let weight = biweight(touch.distance / touch.sigma / spread) / (touch.sigma * counted).powi(2);
            // The part goes up where the point lies above it.
            normal.add(&(touch.arm_end - centre), &touch.normal, touch.distance, weight);
            normal.bend += weight * touch.bend2;
        }
        (normal, spread)
    }

    /// Steps until nothing changes.
    fn stepped(&self, start: Motion, most: usize) -> Motion {
        self.stepped_with(start, most, 1.0)
    }

    /// Steps with weights of at least this scale.
    fn stepped_with(&self, start: Motion, most: usize, least: f64) -> Motion {
        let centre = self.centre();
        let mut motion = start;
        for _ in 0..most {
            let (normal, _) = self.normal(&motion, least);
            let step = normal.solved().step;
            motion = motion.then_small(&centre, &step);
            if step.component_div(&normal.units()).amax() < LEAST_STEP {
                break;
            }
        }
        motion
    }

    /// Whether all touches lie on the part by this motion.
    fn counts_every_touch(&self, motion: &Motion) -> bool {
        let scale = self.scale(motion);
        self.met(motion).iter().all(|t| (t.distance / t.sigma / scale).abs() < TUKEY)
    }

    /// The standard deviation of touches, in units of their noise, at least 1.
    fn scale(&self, motion: &Motion) -> f64 {
        spread(&self.met(motion)).max(1.0)
    }

    /// What the fit makes small: squares of the residuals of pairs, and Tukey's loss of the touches at a scale.
    fn robust_cost(&self, motion: &Motion, scale: f64) -> f64 {
        let of_pairs = self.points.pairs.iter().map(|pair| {
            let found = motion.apply(pair.part);
            (0..3).map(|k| ((pair.stage[k] - found[k]) / pair.sigma[k]).powi(2)).sum::<f64>()
        });
        let loss = |deviations: f64| {
            let inside = 1.0 - (deviations / scale / TUKEY).powi(2).min(1.0);
            TUKEY.powi(2) / 3.0 * (1.0 - inside.powi(3)) * (scale / self.points.counted(scale)).powi(2)
        };
        of_pairs.chain(self.met(motion).iter().map(|t| loss(t.distance / t.sigma))).sum()
    }

    /// How badly touches fit: mean of the squares, none beyond that of a tenth of the points' extent.
    fn cost(&self, motion: &Motion) -> f64 {
        let met = self.met(motion);
        let spread = spread(&met).max(1.0);
        let costs = met.iter().map(|t| (t.distance / t.sigma).powi(2).min((3.0 * spread).powi(2)));
        costs.sum::<f64>() / met.len().max(1) as f64
    }
}

/// Standard deviation of touches by the median of their absolute values, in units of their noise.
fn spread(met: &[Met]) -> f64 {
    let mut sizes: Vec<f64> = met.iter().map(|t| (t.distance / t.sigma).abs()).collect();
    if sizes.is_empty() {
        return 0.0;
    }
    let half = sizes.len() / 2;
    MEDIAN * *sizes.select_nth_unstable_by(half, f64::total_cmp).1
}

/// Tukey's weight.
fn biweight(deviations: f64) -> f64 {
    let u = deviations / TUKEY;
    if u.abs() < 1.0 { (1.0 - u * u).powi(2) } else { 0.0 }
}

/// What a fit comes to.
fn finished(solver: &Solver<'_>, motion: Motion) -> Fit {
    let points = solver.points;
    let (normal, spread) = solver.normal(&motion, 1.0);
    let solved = normal.solved();
    let residual = |pair: &Pair| {
        let found = motion.apply(pair.part);
        [0, 1, 2].map(|k| pair.stage[k] - found[k])
    };
    let pairs: Vec<SpacePoint> = points.pairs.iter().map(residual).collect();
    let met = solver.met(&motion);
    let touches: Vec<TouchResidual> = met
        .iter()
        .map(|t| TouchResidual {
            distance: t.distance,
            is_on_part: (t.distance / t.sigma / spread).abs() < TUKEY,
            at: t.arm_end.into(),
            normal: t.normal.into(),
            sigma: t.sigma,
        })
        .collect();
    let of_pairs = pairs.iter().zip(points.pairs).flat_map(|(r, p)| (0..3).map(|k| (r[k] / p.sigma[k]).powi(2)));
    let counted = points.counted(spread);
    let on_part = met.iter().zip(&touches).filter(|(_, t)| t.is_on_part);
    let of_touches = on_part.map(|(m, _)| (m.distance / m.sigma / counted).powi(2));
    let squares: Vec<f64> = of_pairs.chain(of_touches).collect();
    let dof = squares.len().saturating_sub(6 - solved.free.len());
    let noise_factor = if dof > 0 { (squares.iter().sum::<f64>() / dof as f64).sqrt() } else { 0.0 };
    // Few residuals say little of the noise: the stated one holds where they are smaller.
    let grown = noise_factor.max(1.0).powi(2);
    let free = solved.free.iter().map(|v| FreeMotion {
        turn: [v[0], v[1], v[2]],
        shift: [v[3], v[4], v[5]],
        extent: normal.extent(),
    });
    Fit {
        motion,
        uncertainty: Uncertainty {
            centre: solver.centre().into(),
            covariance: [0, 1, 2, 3, 4, 5].map(|i| [0, 1, 2, 3, 4, 5].map(|k| solved.inverse[(i, k)] * grown)),
        },
        free: free.collect(),
        scale: normal.scale(&solved),
        pairs,
        touches,
        noise_factor,
    }
}

/// What turns about a centre and shifts change of the height over a point of the stage, where the part has this slope.
pub(crate) fn height_row(at: SpacePoint, slope: [f64; 2], centre: SpacePoint) -> [f64; 6] {
    let arm = Vector3::from(at) - Vector3::from(centre);
    let up = Vector3::new(-slope[0], -slope[1], 1.0);
    let turn = arm.cross(&up);
    [turn.x, turn.y, turn.z, up.x, up.y, up.z]
}

impl Uncertainty {
    /// Standard deviation of the part's height over a point of the stage, mm, where the part has this slope there
    /// (dz/dx, dz/dy): what the focus is off by, since a part that moves sideways on a slope changes its height too.
    pub fn height(&self, at: SpacePoint, slope: [f64; 2]) -> f64 {
        self.along(height_row(at, slope, self.centre))
    }

    /// Standard deviations of the place of a point along x, y and z, mm.
    pub fn place(&self, at: SpacePoint) -> SpacePoint {
        let arm = Vector3::from(at) - Vector3::from(self.centre);
        [0, 1, 2].map(|k| {
            let direction = Vector3::ith(k, 1.0);
            let turn = arm.cross(&direction);
            self.along([turn.x, turn.y, turn.z, direction.x, direction.y, direction.z])
        })
    }

    /// Standard deviation of a sum of the unknowns.
    fn along(&self, row: [f64; 6]) -> f64 {
        let sum = |i: usize| (0..6).map(|k| self.covariance[i][k] * row[k]).sum::<f64>();
        (0..6).map(|i| row[i] * sum(i)).sum::<f64>().max(0.0).sqrt()
    }

    /// Standard deviations of the turns about x, y and z, rad.
    pub fn turns(&self) -> SpacePoint {
        [0, 1, 2].map(|k| self.covariance[k][k].max(0.0).sqrt())
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use nalgebra::Matrix3;
    use terrace_core::math;
    use terrace_core::random::Random;

    /// A normal deviate (Box and Muller).
    pub(crate) fn gauss(random: &mut Random) -> f64 {
        let [u, v] = [1.0 - random.unit(), random.unit()];
        (-2.0 * math::ln(u)).sqrt() * math::cos(std::f64::consts::TAU * v)
    }

    /// A motion by up to an angle, deg, about any axis, and by up to a shift, mm.
    pub(crate) fn random_motion(random: &mut Random, deg: f64, mm: f64) -> Motion {
        let axis = Vector3::from([0; 3].map(|_| gauss(random))).normalize();
        let w = axis * random.range(0.0, deg.to_radians());
        let t = [0; 3].map(|_| random.range(-mm, mm));
        Motion::shift([0.0; 3]).then_small(&Vector3::zeros(), &Vector6::new(w.x, w.y, w.z, t[0], t[1], t[2]))
    }

    /// Angle between two motions, rad, and the distance between where they take a point, mm.
    fn apart(a: &Motion, b: &Motion, at: SpacePoint) -> (f64, f64) {
        let rows = [a.rows(), b.rows()].map(|r| Matrix3::from_fn(|i, k| r[i][k]));
        let turn = rows[0].tr_mul(&rows[1]);
        let skew = Vector3::new(turn[(2, 1)] - turn[(1, 2)], turn[(0, 2)] - turn[(2, 0)], turn[(1, 0)] - turn[(0, 1)]);
        let [p, q] = [a, b].map(|m| Vector3::from(m.apply(at)));
        (skew.norm() / 2.0, (p - q).norm())
    }

    /// A height field as facets.
    fn field(size: f64, step: f64, z: impl Fn(f64, f64) -> f64) -> Facets {
        let n = (size / step) as i64;
        let at = |i: i64, k: i64| {
            let [x, y] = [i, k].map(|v| v as f64 * step - size / 2.0);
            [x, y, z(x, y)]
        };
        let cells = (0..n).flat_map(|i| (0..n).map(move |k| (i, k)));
        Facets::new(cells.flat_map(|(i, k)| {
            let [a, b, c, d] = [at(i, k), at(i + 1, k), at(i + 1, k + 1), at(i, k + 1)];
            [[a, b, c], [a, c, d]]
        }))
    }

    fn hood(x: f64, y: f64) -> f64 {
        -x * x / 1500.0 - y * y / 900.0 + 4.0 * math::sin(x / 60.0) * math::cos(y / 45.0)
    }

    #[test]
    fn noise_free_pairs_give_the_pose_to_rounding() {
        for seed in 0..100 {
            let mut random = Random::case(seed);
            let count = 3 + random.below(8);
            let truth = random_motion(&mut random, 180.0, 600.0);
            let pairs: Vec<Pair> = (0..count)
                .map(|_| {
                    let part = [0; 3].map(|_| random.range(-200.0, 200.0));
                    let sigma = [0.01, 0.01, 0.002];
                    Pair { part, stage: truth.apply(part), sigma }
                })
                .collect();
            let points = Points { pairs: &pairs, touches: &[], part: &Facets::new([]), is_warped: false };
            let found = fit(&points, &Motion::shift([0.0; 3]));
            let (turn, off) = apart(&found.motion, &truth, [0.0; 3]);
            assert!(turn < 1e-12 && off < 1e-9, "seed {seed}, {count} pairs: {turn} {off}");
            assert!(found.free.is_empty());
        }
    }

    #[test]
    fn collinear_pairs_leave_the_turn_about_their_line_free() {
        let truth = Motion::shift([10.0, 20.0, -5.0]);
        let on_line = |k: i32| [f64::from(k) * 40.0, f64::from(k) * 30.0, 0.0];
        let pair = |part: SpacePoint| Pair { part, stage: truth.apply(part), sigma: [0.01; 3] };
        let pairs: Vec<Pair> = (0..4).map(|k| pair(on_line(k))).collect();
        let points = Points { pairs: &pairs, touches: &[], part: &Facets::new([]), is_warped: false };
        let found = fit(&points, &truth);
        assert_eq!(found.free.len(), 1);
        let [x, y, z] = found.free[0].turn;
        assert!((x * 30.0 - y * 40.0).abs() < 1e-9 && z.abs() < 1e-9, "{:?}", found.free);
        assert!(apart(&found.motion, &truth, [50.0, -40.0, 7.0]).1 < 1e-9);
    }

    #[test]
    fn pairs_lie_within_their_covariance_and_a_scale_is_seen() {
        let mut inside = 0;
        for seed in 0..200 {
            let mut random = Random::case(seed);
            let truth = random_motion(&mut random, 5.0, 300.0);
            let grown = 1.0 + 2e-4;
            let pairs: Vec<Pair> = (0..6)
                .map(|_| {
                    let part = [random.range(-200.0, 200.0), random.range(-150.0, 150.0), random.range(0.0, 30.0)];
                    let stage = truth.apply(part.map(|v| v * grown)).map(|v| v + 0.01 * gauss(&mut random));
                    Pair { part, stage, sigma: [0.01; 3] }
                })
                .collect();
            let points = Points { pairs: &pairs, touches: &[], part: &Facets::new([]), is_warped: false };
            let found = fit(&points, &Motion::shift([0.0; 3]));
            let scale = found.scale.expect("a scale");
            inside += usize::from((scale.excess - 2e-4).abs() < 3.0 * scale.sigma);
        }
        assert!(inside >= 197, "{inside}");
    }

    /// Square of the distance of two motions in units of the covariance.
    fn mahalanobis2(found: &Fit, truth: &Motion) -> f64 {
        let centre = found.uncertainty.centre;
        let rows = [found.motion.rows(), truth.rows()].map(|r| Matrix3::from_fn(|i, k| r[i][k]));
        let turn = rows[1] * rows[0].transpose();
        let w =
            Vector3::new(turn[(2, 1)] - turn[(1, 2)], turn[(0, 2)] - turn[(2, 0)], turn[(1, 0)] - turn[(0, 1)]) / 2.0;
        let part = found.motion.back(centre);
        let s = Vector3::from(truth.apply(part)) - Vector3::from(centre);
        let error = Vector6::new(w.x, w.y, w.z, s.x, s.y, s.z);
        let covariance = Matrix6::from_fn(|i, k| found.uncertainty.covariance[i][k]);
        error.dot(&(covariance.try_inverse().expect("held") * error))
    }

    #[test]
    fn touches_of_a_tip_find_the_part_from_afar_and_know_how_surely() {
        assert_eq!(within_ellipsoid(0..2), 2);
    }

    #[test]
    #[ignore = "slow: make test-all"]
    fn many_touched_parts_lie_within_their_ellipsoids() {
        let within = within_ellipsoid(2..62);
        assert!(within >= 59, "{within} of 60");
    }

    /// How many parts of these seeds, touched by a tip of 2 mm, lie within the ellipsoid of 99.73 % of their fits.
    fn within_ellipsoid(seeds: std::ops::Range<u64>) -> usize {
        let part = field(300.0, 6.0, hood);
        let mut within = 0;
        for seed in seeds {
            let mut random = Random::case(seed);
            let truth = random_motion(&mut random, 5.0, 5.0);
            let radius = 2.0;
            let touches: Vec<Touch> = (0..300)
                .map(|k| {
                    let [x, y] = [0; 2].map(|_| random.range(-145.0, 145.0));
                    let foot = part.nearest([x, y, hood(x, y)]).expect("a facet");
                    // Above the inside of a facet the tip touches that facet.
                    let n = Vector3::from(foot.normal);
                    let off = radius + 0.02 * gauss(&mut random) + if k % 20 == 0 { 3.0 } else { 0.0 };
                    Touch {
                        stage: truth.apply((Vector3::from(foot.at) + n * off).into()),
                        off: radius,
                        sigma: 0.02,
                        is_along_z: false,
                    }
                })
                .collect();
            let points = Points { pairs: &[], touches: &touches, part: &part, is_warped: false };
            let found = fit(&points, &Motion::shift([0.0; 3]));
            assert!(found.free.is_empty(), "seed {seed}: {:?}", found.free);
            // 99.73 % of an ellipsoid in six dimensions.
            within += usize::from(mahalanobis2(&found, &truth) < 20.06);
            let off: usize = found.touches.iter().filter(|t| !t.is_on_part).count();
            assert!((15..=18).contains(&off), "seed {seed}: {off}");
        }
        within
    }

    #[test]
    fn few_touches_of_its_walls_hold_a_block_though_one_of_many_is_off() {
        let [x, y, z] = [120.0, 80.0, 15.0];
        let wall = |a: [f64; 2], b: [f64; 2]| {
            // Drafted by a third.
            let foot = |[u, v]: [f64; 2]| [u + u.signum() * z / 3.0, v + v.signum() * z / 3.0, -z];
            let (top_a, top_b) = ([a[0], a[1], 0.0], [b[0], b[1], 0.0]);
            [[top_a, top_b, foot(a)], [top_b, foot(b), foot(a)]]
        };
        let corners = [[-x, -y], [x, -y], [x, y], [-x, y]];
        let [a, b, c, d] = corners.map(|[u, v]| [u, v, 0.0]);
        let walls = (0..4).flat_map(|k| wall(corners[k], corners[(k + 1) % 4]));
        let part = Facets::new([[a, b, c], [a, c, d]].into_iter().chain(walls));
        for seed in 0..6 {
            let mut random = Random::case(seed);
            let truth = random_motion(&mut random, 3.0, 4.0);
            let touch = |random: &mut Random, k: usize| {
                // Each twentieth lies on a wall, two on each of three; one lies on a chip.
                let [u, v] = [random.range(-0.9, 0.9), random.range(-0.9, 0.9)];
                let at = match k {
                    1 | 21 => [x * u, -y - z / 6.0, -z / 2.0],
                    41 | 61 => [x + z / 6.0, y * v, -z / 2.0],
                    81 | 101 => [x * u, y + z / 6.0, -z / 2.0],
                    _ => [x * u, y * v, 0.0],
                };
                let n = Vector3::from(part.nearest(at).expect("a facet").normal);
                let off = 1.0 + 0.02 * gauss(random) + if k == 5 { 0.8 } else { 0.0 };
                let stage = truth.apply((Vector3::from(at) + n * off).into());
                Touch { stage, off: 1.0, sigma: 0.02, is_along_z: false }
            };
            let touches: Vec<Touch> = (0..120).map(|k| touch(&mut random, k)).collect();
            let points = Points { pairs: &[], touches: &touches, part: &part, is_warped: false };
            let found = fit(&points, &Motion::shift([0.0; 3]));
            assert!(found.free.is_empty(), "seed {seed}: {:?}", found.free);
            let off: Vec<usize> = (0..120).filter(|&k| !found.touches[k].is_on_part).collect();
            assert_eq!(off, [5], "seed {seed}");
            assert!(mahalanobis2(&found, &truth) < 20.06, "seed {seed}: {}", mahalanobis2(&found, &truth));
        }
    }

    #[test]
    fn the_three_turns_of_a_dome_and_the_shift_along_a_cylinder_are_free() {
        let free = |part: &Facets, z: &dyn Fn(f64, f64) -> f64| {
            let mut random = Random::case(3);
            let touches: Vec<Touch> = (0..300)
                .map(|_| {
                    let [x, y] = [0; 2].map(|_| random.range(-90.0, 90.0));
                    let at = part.nearest([x, y, z(x, y)]).expect("a facet").at;
                    Touch {
                        stage: [at[0], at[1], at[2] + 0.01 * gauss(&mut random)],
                        off: 0.0,
                        sigma: 0.01,
                        is_along_z: true,
                    }
                })
                .collect();
            fit(&Points { pairs: &[], touches: &touches, part, is_warped: false }, &Motion::shift([0.3, -0.2, 0.1]))
                .free
        };
        let dome = |x: f64, y: f64| (250.0_f64.powi(2) - x * x - y * y).sqrt();
        let found = free(&field(200.0, 5.0, dome), &dome);
        assert_eq!(found.len(), 3, "{found:?}");
        let cylinder = |x: f64, _: f64| (300.0_f64.powi(2) - x * x).sqrt();
        let found = free(&field(200.0, 5.0, cylinder), &cylinder);
        // Along its axis, and about it.
        assert_eq!(found.len(), 2, "{found:?}");
        let plate = |_: f64, _: f64| 3.0;
        assert_eq!(free(&field(200.0, 5.0, plate), &plate).len(), 3);
    }
}
