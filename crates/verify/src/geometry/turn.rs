//! The part and the head on tilt axes, by arithmetic of its own.

use terrace_core::geom::{P3, Turned};
use terrace_core::machine::{Carries, Commanded, Letter, Machine, Origin, Tilt, TiltAngles};
use terrace_core::math;

type Rows = [[f64; 3]; 3];

/// How a table turns the part about its pivot, nm; of a head that is turned itself, how it sees the part turned about
/// the table frame's origin.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Turn {
    /// Rows of the matrix.
    rows: Rows,
    /// The point that stays in its place, part frame, nm.
    pivot: [f64; 3],
}

/// The rotation, by commands in millionths of a degree, of what the axes carry: the second axis turns it first.
fn carried(axes: &Tilt, commands: TiltAngles) -> Rows {
    let [outer, inner] = [0, 1].map(|k| {
        let axis = &axes.axes[k];
        let sign = if axis.reversed { -1.0 } else { 1.0 };
        let (s, c) = math::sin_cos(sign * commands[k] as f64 / 1e6 * std::f64::consts::PI / 180.0);
        match axis.letter {
            Letter::A => [[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]],
            Letter::B => [[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]],
            Letter::C => [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]],
        }
    });
    outer.map(|row: [f64; 3]| [0, 1, 2].map(|j| (0..3).map(|k| row[k] * inner[k][j]).sum()))
}

impl Turn {
    /// The turn that commands of the axes give a part whose origin lies at `origin` in the table frame, nm.
    pub(crate) fn new(axes: &Tilt, commands: TiltAngles, origin: Origin) -> Self {
        let rotation = carried(axes, commands);
        match axes.carries {
            Carries::Part => {
                // The pivot of a table is given in the table frame.
                let pivot = [0, 1, 2].map(|k| super::nm(axes.pivot[k].as_mm()) - origin[k] as f64);
                Self { rows: rotation, pivot }
            }
            Carries::Head => {
                // A head that turns sees the part turned the other way: the inverse of a rotation is its transpose.
                let inverse = [0, 1, 2].map(|j| [0, 1, 2].map(|k| rotation[k][j]));
                // The table frame's origin, in the part frame.
                let pivot = origin.0.map(|v| -(v as f64));
                Self { rows: inverse, pivot }
            }
        }
    }

    /// Where a point of the part comes to lie.
    pub(crate) fn apply(&self, p: P3) -> P3<Turned> {
        let d = [0, 1, 2].map(|k| p[k] - self.pivot[k]);
        P3::new([0, 1, 2].map(|k| self.pivot[k] + (0..3).map(|j| self.rows[k][j] * d[j]).sum::<f64>()))
    }

    /// Which point of the part comes to lie at `p`.
    pub(crate) fn back(&self, p: P3<Turned>) -> P3 {
        let d = [0, 1, 2].map(|k| p[k] - self.pivot[k]);
        P3::new([0, 1, 2].map(|k| self.pivot[k] + (0..3).map(|j| self.rows[j][k] * d[j]).sum::<f64>()))
    }

    /// How far a point moves sideways on the part where its height is off by 1, and that height where the
    /// point is off by 1: the sine of the tilt.
    pub(crate) fn lean(&self) -> f64 {
        math::hypot(self.rows[2][0], self.rows[2][1])
    }
}

/// Where the commands bring the head over the part: the forward kinematics.
#[derive(Clone, Copy, Debug)]
pub(crate) struct HeadPose {
    /// The centre of the field in the focal plane that the stage sets, part frame, nm.
    pub(crate) centre: [f64; 3],
    /// The directions of the field's x and y and of the beam towards the lens, part frame.
    pub(crate) axes: Rows,
}

impl HeadPose {
    /// Of a part whose origin lies at `origin`.
    pub(crate) fn new(machine: &Machine, stage: Commanded, tilt: TiltAngles, origin: Origin) -> Self {
        let axes = [&machine.stage.x, &machine.stage.y, &machine.stage.z];
        let stands = [0, 1, 2].map(|k| {
            let ahead = (axes[k].carries == Carries::Head) != axes[k].reversed;
            (if ahead { stage[k] } else { -stage[k] } - origin[k]) as f64
        });
        let Some(table) = machine.tilt.as_ref().filter(|_| !tilt.is_upright()) else {
            return Self { centre: stands, axes: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] };
        };
        let turn = Turn::new(table, tilt, origin);
        let centre = match table.carries {
            Carries::Part => turn.back(P3::new(stands)).at,
            Carries::Head => {
                // The pivot stays where the stage has it, the field's centre goes round it.
                let q = table.pivot.map(|p| super::nm(p.as_mm()));
                let turned = carried(table, tilt);
                [0, 1, 2].map(|k| stands[k] + q[k] - (0..3).map(|j| turned[k][j] * q[j]).sum::<f64>())
            }
        };
        Self { centre, axes: turn.rows }
    }
}
