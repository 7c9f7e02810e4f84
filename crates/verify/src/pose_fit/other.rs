//! Whether another pose fits touches better that a stated one leaves beside the part.
//!
//! A fit that leaves out what lies far off can end where it leaves out the few touches that hold a motion, and no small
//! step from there improves it. So from the stated pose all points are fitted by least absolute deviations, which leave
//! none out (weights anew from the residuals of each step: Schlossmacher, Journal of the American Statistical Association
//! 68, 1973), and from where that ends as the stated pose was.

use super::{CUT, Equations, PosePoints, TouchFound, dot, spread, weights};
use crate::geometry::Pose;
use terrace_core::geom::SpacePoint;

/// Steps of either fit at most, and the step, nm, that ends them.
const STEPS: usize = 25;
const REST_NM: f64 = 1.0;

impl PosePoints<'_> {
    /// By how much the sum of losses of the points (squares of deviations, bounded for touches) falls from a pose to
    /// another that the verifier finds from there; None where all touches lie on the part already.
    pub(crate) fn falls_elsewhere(&self, pose: &Pose) -> Option<f64> {
        let stated = self.met(pose);
        let scale = spread(&stated);
        let is_far = |t: &TouchFound| (t.distance / t.sigma / scale).abs() >= CUT;
        if !stated.iter().any(is_far) {
            return None;
        }
        let absolute = |touches: &[TouchFound]| -> Vec<f64> {
            touches.iter().map(|t| (t.distance / t.sigma / scale).abs().max(1.0).sqrt().recip()).collect()
        };
        let all = self.settled(*pose, &absolute)?;
        let other = self.settled(all, &weights)?;
        Some(self.losses(pose, scale) - self.losses(&other, scale))
    }

    /// Steps from a pose until nothing changes; None where the points do not hold it.
    fn settled(&self, from: Pose, weights: &dyn Fn(&[TouchFound]) -> Vec<f64>) -> Option<Pose> {
        let mut pose = from;
        for _ in 0..STEPS {
            let touches = self.met(&pose);
            let step = self.planes(&pose, &touches, &weights(&touches)).step()?;
            pose = self.stepped(&pose, &step);
            if self.size(&step) < REST_NM {
                break;
            }
        }
        Some(pose)
    }

    /// The equations of least squares if the part were, at each touch, the plane that it touches.
    fn planes(&self, pose: &Pose, touches: &[TouchFound], weights: &[f64]) -> Equations {
        let middle = self.middle();
        let reach = self.reach();
        let unit = |k: usize| if k < 3 { 1.0 / reach } else { 1.0 };
        let mut sums = Equations { matrix: [[0.0; 6]; 6], right: [0.0; 6], units: [0, 1, 2, 3, 4, 5].map(unit) };
        let mut add = |at: SpacePoint, along: SpacePoint, residual: f64, weight: f64| {
            let arm = [0, 1, 2].map(|k| at[k] - middle[k]);
            let turn = [0, 1, 2].map(|k| {
                let (i, j) = ((k + 1) % 3, (k + 2) % 3);
                arm[i] * along[j] - arm[j] * along[i]
            });
            let row = [0, 1, 2, 3, 4, 5].map(|k| unit(k) * weight * if k < 3 { turn[k] } else { along[k - 3] });
            for i in 0..6 {
                sums.right[i] += row[i] * weight * residual;
                (0..6).for_each(|k| sums.matrix[i][k] += row[i] * row[k]);
            }
        };
        for pair in &self.pairs {
            let at = pose.apply(pair.part);
            for k in 0..3 {
                let along = [0, 1, 2].map(|i| f64::from(u8::from(i == k)));
                add(at, along, pair.table[k] - at[k], 1.0 / pair.sigma[k]);
            }
        }
        let spread = spread(touches);
        for (touch, weight) in touches.iter().zip(weights) {
            let by = self.divisor(touch, spread, touches.len());
            add(touch.foot, touch.direction, touch.distance, weight / touch.sigma / by);
        }
        sums
    }

    /// The sum of losses at a pose: of touches Tukey's, of pairs squares.
    fn losses(&self, pose: &Pose, scale: f64) -> f64 {
        let of_pairs = self.pairs.iter().map(|pair| {
            let at = pose.apply(pair.part);
            let off = [0, 1, 2].map(|k| (pair.table[k] - at[k]) / pair.sigma[k]);
            dot(off, off)
        });
        let touches = self.met(pose);
        let of_touches = touches.iter().map(|t| {
            let inside = (1.0 - (t.distance / t.sigma / scale / CUT).powi(2)).max(0.0);
            let counted = scale / self.divisor(t, scale, touches.len());
            CUT * CUT / 3.0 * (1.0 - inside * inside * inside) * counted * counted
        });
        of_pairs.chain(of_touches).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::super::{PosePoints, PoseTouch, flattest};
    use crate::geometry::{Geometry, MeshBuilder, Pose, Shape};
    use terrace_core::geom::NM_PER_MM;
    use terrace_core::random::Random;

    /// A block of 240 mm x 160 mm, its top at z = 0, with walls that lean outwards by a third.
    fn block() -> Geometry {
        let [x, y, z] = [120.0, 80.0, 15.0];
        let corner = |k: usize, down: f64| {
            let [u, v] = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]][k % 4];
            [u * (x + down / 3.0), v * (y + down / 3.0), -down]
        };
        let mut facets = vec![[0, 1, 2].map(|k| corner(k, 0.0)), [0, 2, 3].map(|k| corner(k, 0.0))];
        for k in 0..4 {
            let [a, b, c, d] = [corner(k, 0.0), corner(k + 1, 0.0), corner(k + 1, z), corner(k, z)];
            facets.extend([[a, b, c], [a, c, d]]);
        }
        let mut builder = MeshBuilder::new(0.0, 2.0);
        facets.into_iter().for_each(|facet| builder.push(facet));
        Geometry::new(Shape::Mesh(builder.finish()), 1.0, 0.0)
    }

    fn shifted(mm: [f64; 3]) -> Pose {
        Pose { rows: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], shift: mm.map(|v| v * NM_PER_MM) }
    }

    #[test]
    fn a_feature_at_a_corner_is_of_the_least_steep_face() {
        let part = block();
        for mm in [[120.0, 80.0, 0.0], [120.0, 10.0, 0.0], [120.5, 80.5, 0.5]] {
            assert_eq!(flattest(&part, mm.map(|v| v * NM_PER_MM)), Some([0.0, 0.0, 1.0]), "{mm:?}");
        }
    }

    #[test]
    fn a_pose_that_leaves_the_touches_of_walls_out_has_a_better_one_and_the_right_pose_has_none() {
        let part = block();
        let mut random = Random::case(7);
        let mut touch = |k: usize| {
            let [u, v] = [random.range(-100.0, 100.0), random.range(-70.0, 70.0)];
            // Two on each of three walls, and one on a chip.
            let at = match k {
                0 | 1 => [u, -82.5, -7.5],
                2 | 3 => [122.5, v, -7.5],
                4 | 5 => [u, 82.5, -7.5],
                6 => [u, v, 0.8],
                _ => [u, v, 0.0],
            };
            let noise = random.range(-0.02, 0.02);
            let table = [at[0], at[1], at[2] + noise].map(|v| v * NM_PER_MM);
            PoseTouch { table, off: 0.0, sigma: 0.02 * NM_PER_MM, is_along_z: false }
        };
        let touches: Vec<PoseTouch> = (0..120).map(&mut touch).collect();
        let points = PosePoints { pairs: Vec::new(), touches, part: &part, warp: None };
        let right = points.falls_elsewhere(&shifted([0.0; 3])).expect("the chip lies beside the part");
        assert!(right.abs() < 5.0, "{right}");
        let left_out = points.falls_elsewhere(&shifted([0.7, 0.6, 0.0])).expect("touches lie beside the part");
        assert!(left_out > 5.0, "{left_out}");
        let without_chip = PosePoints { touches: points.touches[..6].to_vec(), ..points };
        assert_eq!(without_chip.falls_elsewhere(&shifted([0.0; 3])), None);
    }
}
