//! The part on a tilt table, by arithmetic of its own.

use crate::geom::{P3, Turned};
use crate::machine::{Letter, Origin, Tilt, TiltAngles};

/// How a table turns the part about its pivot, nm.
#[derive(Clone, Copy, Debug)]
pub(in crate::verify) struct Turn {
    /// Rows of the matrix.
    rows: [[f64; 3]; 3],
    pivot: [f64; 3],
}

impl Turn {
    /// What the commands (millionths of a degree) make of a part whose origin lies at `origin` (nm): the second
    /// axis turns it first.
    pub(in crate::verify) fn of(table: &Tilt, commands: TiltAngles, origin: Origin) -> Self {
        let [outer, inner] = [0, 1].map(|k| {
            let axis = &table.axes[k];
            let sign = if axis.reversed { -1.0 } else { 1.0 };
            let (s, c) = (sign * commands[k] as f64 / 1e6 * std::f64::consts::PI / 180.0).sin_cos();
            match axis.letter {
                Letter::A => [[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]],
                Letter::B => [[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]],
                Letter::C => [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]],
            }
        });
        let rows = outer.map(|row| [0, 1, 2].map(|j| (0..3).map(|k| row[k] * inner[k][j]).sum()));
        Self { rows, pivot: [0, 1, 2].map(|k| super::nm(table.pivot[k].as_mm()) - origin[k] as f64) }
    }

    /// Where a point of the part comes to lie.
    pub(in crate::verify) fn apply(&self, p: P3) -> P3<Turned> {
        let d = [0, 1, 2].map(|k| p[k] - self.pivot[k]);
        P3::new([0, 1, 2].map(|k| self.pivot[k] + (0..3).map(|j| self.rows[k][j] * d[j]).sum::<f64>()))
    }

    /// Which point of the part comes to lie at `p`.
    pub(in crate::verify) fn back(&self, p: P3<Turned>) -> P3 {
        let d = [0, 1, 2].map(|k| p[k] - self.pivot[k]);
        P3::new([0, 1, 2].map(|k| self.pivot[k] + (0..3).map(|j| self.rows[j][k] * d[j]).sum::<f64>()))
    }

    /// How far a point moves sideways on the part where its height is off by 1, and that height where the
    /// point is off by 1: the sine of the tilt.
    pub(in crate::verify) fn lean(&self) -> f64 {
        self.rows[2][0].hypot(self.rows[2][1])
    }
}
