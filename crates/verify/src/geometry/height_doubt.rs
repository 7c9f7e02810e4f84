//! How surely the height of a measured part is known, place by place.

use super::Correction;
use terrace_core::geom::SpacePoint;

/// The covariance of a small motion of the part, and how much of it marks keep free.
#[derive(Clone, Debug)]
pub(crate) struct HeightDoubt {
    /// The point that the part turns about, nm, in the frame of the geometry.
    pub(crate) centre: SpacePoint,
    /// Of the rotation vector, rad, and the shift, nm.
    pub(crate) covariance: [[f64; 6]; 6],
    /// Deviations that are kept free.
    pub(crate) sigmas: f64,
    /// No more than this is kept free, nm.
    pub(crate) most: f64,
    /// How it is warped: that holds what the pose is off by in height and tilt.
    pub(crate) correction: Option<Correction>,
}

impl HeightDoubt {
    /// What is kept free above and below a place of the part with this slope (dz/dx, dz/dy), nm.
    pub(crate) fn kept(&self, at: SpacePoint, [p, q]: [f64; 2]) -> f64 {
        self.wanted(at, [p, q]).min(self.most)
    }

    /// What deviations ask for there, nm.
    fn wanted(&self, at: SpacePoint, [p, q]: [f64; 2]) -> f64 {
        let [x, y, z] = [0, 1, 2].map(|k| at[k] - self.centre[k]);
        // A motion by w x r + s raises the part over a place by its part along (-p, -q, 1).
        let mut row = [y + q * z, -x - p * z, -q * x + p * y, -p, -q, 1.0];
        let mut known = 0.0;
        if let Some(correction) = &self.correction {
            // Tilt and height are in its own deviation, and of what lies aside counts what the points have not seen.
            let [_, deviation, seen @ ..] = correction.at([at[0], at[1]]);
            row = [0.0, 0.0, row[2] - seen[0], row[3] - seen[1], row[4] - seen[2], 0.0];
            known = deviation * deviation;
        }
        let part = |i: usize| (0..6).map(|k| row[i] * self.covariance[i][k] * row[k]).sum::<f64>();
        let variance = known + (0..6).map(part).sum::<f64>();
        self.sigmas * variance.max(0.0).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_small_motion_raises_the_part_by_its_row() {
        // The plane z = p x + q y about a centre, moved by a small motion: its height over (x, y) changes by the row.
        let (p, q) = (0.3, -0.2);
        let (w, s) = ([1e-7, -2e-7, 3e-7], [1e-3, -2e-3, 5e-4]);
        let (x, y) = (40.0, -25.0);
        let z = p * x + q * y;
        let moved = [w[1] * z - w[2] * y + s[0], w[2] * x - w[0] * z + s[1], w[0] * y - w[1] * x + s[2]];
        let raised = moved[2] - p * moved[0] - q * moved[1];
        let motion = [w[0], w[1], w[2], s[0], s[1], s[2]];
        let covariance = [0, 1, 2, 3, 4, 5].map(|i: usize| [0, 1, 2, 3, 4, 5].map(|k: usize| motion[i] * motion[k]));
        let doubt = HeightDoubt { centre: [0.0; 3], covariance, sigmas: 1.0, most: f64::INFINITY, correction: None };
        assert!((doubt.kept([x, y, z], [p, q]) - f64::abs(raised)).abs() < 1e-12);
    }
}
