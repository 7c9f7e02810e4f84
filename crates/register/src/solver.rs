//! Gauss-Newton steps over pairs and touches together.
//!
//! Touches are weighted by Tukey's biweight, with the median of their distances as scale, so clamps and dirt do not
//! count.

use nalgebra::Vector3;

use super::equations::Normal;
use super::motion::Motion;
use super::points::{Met, Points, Touch};
use terrace_core::geom::SpacePoint;

/// Beyond this many deviations a touch does not count (Tukey; 95 % efficient under normal noise).
pub(crate) const TUKEY: f64 = 4.685;

/// A median of absolute normal deviates, as a standard deviation.
const MEDIAN: f64 = 1.4826;

/// A step that ends them: mm, and mm at the extent of the points.
const LEAST_STEP: f64 = 1e-11;

/// Fits all pairs and every nth touch.
pub(crate) struct Solver<'a> {
    pub(crate) points: &'a Points<'a>,
    pub(crate) every: usize,
}

impl Solver<'_> {
    fn touches(&self) -> impl Iterator<Item = &Touch> {
        let take = if self.every == usize::MAX { 0 } else { self.points.touches.len() };
        self.points.touches.iter().take(take).step_by(self.every)
    }

    /// The middle of all points on the stage.
    pub(crate) fn centre(&self) -> Vector3<f64> {
        middle(self.points.pairs.iter().map(|p| p.stage).chain(self.touches().map(|t| t.stage)))
    }

    pub(crate) fn met(&self, motion: &Motion) -> Vec<Met> {
        self.touches().filter_map(|touch| touch.met(self.points.part, motion)).collect()
    }

    /// The equations at a motion, and the standard deviation of touches, in units of their noise, at least `least`.
    pub(crate) fn normal(&self, motion: &Motion, least: f64) -> (Normal, f64) {
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
        for touch in &met {
            let counted = self.points.counted(spread, touch, met.len());
            let weight = biweight(touch.distance / touch.sigma / spread) / (touch.sigma * counted).powi(2);
            // The part goes up where the point lies above it.
            normal.add(&(touch.arm_end - centre), &touch.normal, touch.distance, weight);
            normal.bend += weight * touch.bend2;
        }
        (normal, spread)
    }

    /// Steps until nothing changes.
    pub(crate) fn stepped(&self, start: Motion, most: usize) -> Motion {
        self.stepped_with(start, most, 1.0)
    }

    /// Steps with weights of at least this scale.
    pub(crate) fn stepped_with(&self, start: Motion, most: usize, least: f64) -> Motion {
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
    pub(crate) fn counts_every_touch(&self, motion: &Motion) -> bool {
        let scale = self.scale(motion);
        self.met(motion).iter().all(|t| (t.distance / t.sigma / scale).abs() < TUKEY)
    }

    /// The standard deviation of touches, in units of their noise, at least 1.
    pub(crate) fn scale(&self, motion: &Motion) -> f64 {
        spread(&self.met(motion)).max(1.0)
    }

    /// What the fit makes small: squares of the residuals of pairs, and Tukey's loss of the touches at a scale.
    pub(crate) fn robust_cost(&self, motion: &Motion, scale: f64) -> f64 {
        let of_pairs = self.points.pairs.iter().map(|pair| {
            let found = motion.apply(pair.part);
            (0..3).map(|k| ((pair.stage[k] - found[k]) / pair.sigma[k]).powi(2)).sum::<f64>()
        });
        let met = self.met(motion);
        let loss = |t: &Met| {
            let inside = 1.0 - (t.distance / t.sigma / scale / TUKEY).powi(2).min(1.0);
            let counted = self.points.counted(scale, t, met.len());
            TUKEY.powi(2) / 3.0 * (1.0 - inside.powi(3)) * (scale / counted).powi(2)
        };
        of_pairs.chain(met.iter().map(loss)).sum()
    }

    /// How badly touches fit: mean of the squares, none beyond that of a tenth of the points' extent.
    pub(crate) fn cost(&self, motion: &Motion) -> f64 {
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

/// The middle of some points.
pub(crate) fn middle(points: impl Iterator<Item = SpacePoint>) -> Vector3<f64> {
    let (sum, count) = points.fold((Vector3::zeros(), 0.0), |(sum, n), p| (sum + Vector3::from(p), n + 1.0));
    sum / f64::max(count, 1.0)
}
