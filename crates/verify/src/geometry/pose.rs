//! A measured part: how it lies beside its placement.

use terrace_core::geom::SpacePoint;

/// A rotation about the origin of the part, then a shift, nm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Pose {
    /// Rows of the rotation.
    pub(crate) rows: [SpacePoint; 3],
    /// The shift, nm.
    pub(crate) shift: SpacePoint,
}

impl Pose {
    /// Where a point of the part comes to lie.
    pub(crate) fn apply(&self, p: SpacePoint) -> SpacePoint {
        [0, 1, 2].map(|k| (0..3).map(|j| self.rows[k][j] * p[j]).sum::<f64>() + self.shift[k])
    }

    /// Which point of the part comes to lie at `p`.
    pub(crate) fn back(&self, p: SpacePoint) -> SpacePoint {
        let d = [0, 1, 2].map(|k| p[k] - self.shift[k]);
        [0, 1, 2].map(|k| (0..3).map(|j| self.rows[j][k] * d[j]).sum::<f64>())
    }

    /// How far the rows are from those of a rotation: of products of two rows from 0 or 1, and of the determinant from 1.
    pub(crate) fn skew(&self) -> f64 {
        let [a, b, c] = self.rows;
        let dot = |u: SpacePoint, v: SpacePoint| (0..3).map(|k| u[k] * v[k]).sum::<f64>();
        let cross = [0, 1, 2].map(|k| a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3]);
        let off =
            [dot(a, a) - 1.0, dot(b, b) - 1.0, dot(c, c) - 1.0, dot(a, b), dot(a, c), dot(b, c), dot(cross, c) - 1.0];
        off.iter().map(|v| v.abs()).fold(0.0, f64::max)
    }
}
