//! How surely a part lies where it does.

use nalgebra::Vector3;

use terrace_core::geom::SpacePoint;

/// How surely a part lies where it does: the covariance of a small motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Uncertainty {
    /// The point that it turns about, table frame, mm.
    pub centre: SpacePoint,
    /// Covariance of the rotation vector about the centre, rad, and the shift, mm.
    pub covariance: [[f64; 6]; 6],
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

    /// Standard deviation of what a part that lies aside changes of the height, mm, where a turn about z and shifts along
    /// x and y change so much of it.
    pub fn aside(&self, [turn, x, y]: [f64; 3]) -> f64 {
        self.along([0.0, 0.0, turn, x, y, 0.0])
    }

    /// What a turn about z, rad, and shifts along x and y, mm, change of the height over a point of the stage, mm, where
    /// the part has this slope there.
    pub fn aside_row(&self, at: SpacePoint, slope: [f64; 2]) -> [f64; 3] {
        let [.., turn, x, y, _] = height_row(at, slope, self.centre);
        [turn, x, y]
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
