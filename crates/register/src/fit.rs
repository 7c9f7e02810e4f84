//! The fit of the part to what was measured.
//!
//! The unknowns are a small motion of the part on the stage: a rotation vector about the middle of the points and a
//! shift. A pair gives three equations; a touch one, its distance to the part along the normal (Chen and Medioni 1992),
//! robustly weighted. Where some touches do not count, the fit is tried again from weights that count them all and narrow
//! down by halves (graduated non-convexity: Blake and Zisserman, Visual Reconstruction, 1987), and the better of both is
//! taken: a start that was off must not make an outlier of the few touches that hold a motion. Motions to which all
//! distances are blind, by more than what the facets' own normals could hold, are left as they are and named.

use nalgebra::Vector6;

use super::closed_form::{Pair, closed_form};
use super::equations::Scale;
use super::facets::Facets;
use super::motion::Motion;
use super::points::Points;
use super::solver::{Solver, TUKEY, middle};
use super::uncertainty::Uncertainty;
use terrace_core::geom::SpacePoint;

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
    /// Whether pairs hold the part without any touch.
    pub is_held_by_pairs: bool,
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

/// Steps at most.
const STEPS: usize = 60;

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

/// Fits the part to what was measured, from the motion `start` that is right to some millimetres and degrees; pairs that
/// hold the part by themselves are their own start.
pub fn fit(points: &Points<'_>, start: &Motion) -> Fit {
    let by_pairs = Solver { points, every: usize::MAX };
    let mut motion = *start;
    let mut is_held = false;
    if points.pairs.len() >= 3 {
        motion = by_pairs.stepped(closed_form(points.pairs), STEPS);
        is_held = by_pairs.normal(&motion, 1.0).0.solved().free.is_empty();
        motion = if is_held { motion } else { by_pairs.stepped(*start, STEPS) };
        if !is_held && !points.touches.is_empty() {
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
    Fit { is_held_by_pairs: is_held, ..finished(&all, better.unwrap_or(motion)) }
}

/// A fit with weights that are wide at first and narrow down.
fn narrowed(points: &Points<'_>, start: Motion) -> Motion {
    let some = Solver { points, every: points.touches.len().div_ceil(WIDE_TOUCHES).max(1) };
    WIDE.iter().fold(start, |motion, &least| some.stepped_with(motion, WIDE_STEPS, least))
}

/// The motion that fits pairs best by their weights.
pub(crate) fn refined(pairs: &[Pair]) -> Motion {
    let points = Points { pairs, touches: &[], part: &Facets::new([]), warp: None };
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
    let counted = if points.warp.is_some() { spread } else { 1.0 };
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
        is_held_by_pairs: false,
        scale: normal.scale(&solved),
        pairs,
        touches,
        noise_factor,
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::points::Touch;
    use nalgebra::{Matrix3, Matrix6, Vector3};
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
            let points = Points { pairs: &pairs, touches: &[], part: &Facets::new([]), warp: None };
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
        let points = Points { pairs: &pairs, touches: &[], part: &Facets::new([]), warp: None };
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
            let points = Points { pairs: &pairs, touches: &[], part: &Facets::new([]), warp: None };
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
            let points = Points { pairs: &[], touches: &touches, part: &part, warp: None };
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
            let points = Points { pairs: &[], touches: &touches, part: &part, warp: None };
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
            fit(&Points { pairs: &[], touches: &touches, part, warp: None }, &Motion::shift([0.3, -0.2, 0.1])).free
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
