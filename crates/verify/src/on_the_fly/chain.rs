//! From axis values to the beam over the part, by arithmetic of its own.
//!
//! Units: nm and millionths of a degree in; nm out, part frame. The part lies at the placement's origin in the
//! table frame and is turned about the pivot, by the inner axis first; the beam runs along z of the table frame.

use crate::read::on_the_fly::Commands;
use terrace_core::machine::{Axis, Carries, Machine, Origin};
use terrace_core::math;

/// A beam: where it meets the focal plane, and the direction back along it, of length 1.
#[derive(Clone, Copy, Debug)]
pub(super) struct Beam {
    pub(super) at: [f64; 3],
    pub(super) up: [f64; 3],
}

/// Places of axes among commands.
const A: usize = 3;
const C: usize = 4;
const U: usize = 5;
const V: usize = 6;

impl Beam {
    /// How far apart two beams meet their focal planes, nm.
    pub(super) fn distance(&self, to: &Self) -> f64 {
        (0..3).map(|k| (to.at[k] - self.at[k]).powi(2)).sum::<f64>().sqrt()
    }

    /// How far it moves across itself to where another meets its focal plane, nm.
    pub(super) fn way(&self, to: &Self) -> f64 {
        let (d, up) = ([0, 1, 2].map(|k| to.at[k] - self.at[k]), self.up);
        let [x, y, z] = [d[1] * up[2] - d[2] * up[1], d[2] * up[0] - d[0] * up[2], d[0] * up[1] - d[1] * up[0]];
        math::hypot(math::hypot(x, y), z)
    }
}

/// A machine's axes under a placement.
pub(super) struct Chain {
    /// +1 where a positive command moves the beam in + over the part.
    stage: [f64; 3],
    /// Where the part's origin lies in the table frame, nm.
    origin: [f64; 3],
    /// None where the part is not turned.
    turns: Option<Turns>,
    swap: bool,
    mirror: [bool; 2],
}

struct Turns {
    pivot: [f64; 3],
    /// Of A and C: radians for a millionth of a degree, right-handed.
    rad: [f64; 2],
}

impl Chain {
    /// None where the machine does not have these axes.
    pub(super) fn new(machine: &Machine, Origin(origin): Origin, axes: &str) -> Option<Self> {
        let stage = [&machine.stage.x, &machine.stage.y, &machine.stage.z].map(|axis: &Axis| {
            let carried = if axis.carries == Carries::Head { 1.0 } else { -1.0 };
            if axis.reversed { -carried } else { carried }
        });
        let turns = match axes {
            "XYZUV" => None,
            "XYZACUV" => {
                let table = machine.tilt.as_ref().filter(|table| table.carries == Carries::Part)?;
                if [table.axes[0].letter.char(), table.axes[1].letter.char()] != ['A', 'C'] {
                    return None;
                }
                let rad = [0, 1].map(|k| {
                    let one = std::f64::consts::PI / 180e6;
                    if table.axes[k].reversed { -one } else { one }
                });
                Some(Turns { pivot: table.pivot.map(|p| p.as_mm() * 1e6), rad })
            }
            _ => return None,
        };
        let s = &machine.scanner;
        Some(Self { stage, origin: origin.map(|v| v as f64), turns, swap: s.swap_xy, mirror: [s.mirror_x, s.mirror_y] })
    }

    /// Whether the part may be tilted under the beam.
    pub(super) fn leans(&self) -> bool {
        self.turns.is_some()
    }

    /// Where the scanner points at these commands, nm, field frame.
    pub(super) fn field(&self, to: &Commands<f64>) -> [f64; 2] {
        let u = if self.mirror[0] { -to[U] } else { to[U] };
        let v = if self.mirror[1] { -to[V] } else { to[V] };
        if self.swap { [v, u] } else { [u, v] }
    }

    /// The beam at these commands: its place in the focal plane, nm, and its direction, part frame.
    pub(super) fn beam(&self, to: &Commands<f64>) -> Beam {
        let [u, v] = self.field(to);
        // Where the spot is in the table frame, nm: the stage's place and what the scanner adds to it.
        let spot = [self.stage[0] * to[0] + u, self.stage[1] * to[1] + v, self.stage[2] * to[2]];
        let Some(turns) = &self.turns else {
            return Beam { at: [0, 1, 2].map(|k| spot[k] - self.origin[k]), up: [0.0, 0.0, 1.0] };
        };
        let [a, c] = [turns.rad[0] * to[A], turns.rad[1] * to[C]];
        // The table turns the part by C about z, then by A about x; undone in reverse order.
        let unturned = |[x, y, z]: [f64; 3]| {
            let (y, z) = (math::cos(a) * y + math::sin(a) * z, math::cos(a) * z - math::sin(a) * y);
            [math::cos(c) * x + math::sin(c) * y, math::cos(c) * y - math::sin(c) * x, z]
        };
        let p = unturned([0, 1, 2].map(|k| spot[k] - turns.pivot[k]));
        Beam { at: [0, 1, 2].map(|k| p[k] + turns.pivot[k] - self.origin[k]), up: unturned([0.0, 0.0, 1.0]) }
    }
}
