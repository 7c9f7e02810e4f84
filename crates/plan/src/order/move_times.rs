//! Times of stage moves for the search, which asks for millions of them: read off tables.
//!
//! They are those of [`motion::stage_move`], to one part in 5000; results are judged by that itself.
//! Positions are commands in nm, as `f64`.

use terrace_core::geom::Nm;
use terrace_core::machine::{Commanded, Machine, MoveTimes};
use terrace_core::motion;
use terrace_core::units::Time;

/// Times of a machine's stage.
pub(super) enum MoveTimer {
    /// Measured times.
    Fixed(MoveTimes),
    /// Profiles of the axes, the settling, the command that z is lifted to, and whether z moves together with x and y.
    Profiles { axes: [AxisTimes; 3], settling: [f64; 2], top: f64, is_diagonal: bool },
}

impl MoveTimer {
    pub(super) fn new(machine: &Machine) -> Self {
        if let Some(times) = machine.stage.move_times {
            return Self::Fixed(times);
        }
        let axes = [0, 1, 2].map(|axis| {
            AxisTimes::new(|nm| {
                let mut to = Commanded::default();
                to[axis] = nm.0;
                motion::stage_move(machine, Commanded::default(), to, None).travel_s
            })
        });
        let settling = machine.stage.settle.by_axis().map(Time::as_s);
        Self::Profiles { axes, settling, top: machine.retract_z().f64(), is_diagonal: machine.stage.diagonal }
    }

    /// Time of a move over these distances, none negative, without a lift.
    pub(super) fn over(&self, gap: [f64; 3]) -> f64 {
        if gap == [0.0; 3] {
            return 0.0;
        }
        match self {
            Self::Fixed(times) => if gap[0] > 0.0 || gap[1] > 0.0 { times.xy } else { times.z }.as_s(),
            Self::Profiles { axes: [x, y, z], settling, is_diagonal, .. } => {
                let [across, along] = [x.at(gap[0]).max(y.at(gap[1])), z.at(gap[2])];
                let travel = if *is_diagonal { across.max(along) } else { across + along };
                travel + settled(settling, gap)
            }
        }
    }

    /// Time of a move.
    pub(super) fn between(&self, a: [f64; 3], b: [f64; 3]) -> f64 {
        self.over(gap(a, b))
    }

    /// Time of a move with a lift on the way.
    pub(super) fn lifted(&self, a: [f64; 3], b: [f64; 3]) -> f64 {
        match self {
            Self::Fixed(times) => times.xy.as_s() + times.z.as_s(),
            Self::Profiles { axes: [x, y, z], settling, top, .. } => {
                let gap = gap(a, b);
                let [up, down] = [a, b].map(|end| (top - end[2]).abs());
                let settled = settled(settling, [gap[0], gap[1], up.max(down)]);
                x.at(gap[0]).max(y.at(gap[1])) + z.at(up) + z.at(down) + settled
            }
        }
    }
}

/// Settling after a move over these distances.
fn settled([xy, z]: &[f64; 2], gap: [f64; 3]) -> f64 {
    let plane = if gap[0] > 0.0 || gap[1] > 0.0 { *xy } else { 0.0 };
    plane.max(if gap[2] > 0.0 { *z } else { 0.0 })
}

fn gap(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|k| (a[k] - b[k]).abs())
}

/// Times of one axis from rest to rest, by distance.
pub(super) struct AxisTimes(Vec<f64>);

/// Bits of a distance below those that find its place in the table: 64 points in every octave.
const BELOW: u32 = 52 - 6;

/// Octaves of the table, in nm: up to 17 m, twice the longest move.
const OCTAVES: u64 = 34;

impl AxisTimes {
    fn new(time: impl Fn(Nm) -> f64) -> Self {
        let base = 1f64.to_bits();
        // Points of the table are rounded to whole nm; so are those that stand close together at its beginning.
        let points = (0..=OCTAVES << (52 - BELOW)).map(|k| f64::from_bits(base + (k << BELOW)));
        Self(points.map(|x| between(x - 1.0, &time)).collect())
    }

    fn at(&self, nm: f64) -> f64 {
        // The bits of a float are a piecewise linear logarithm: exponent and first bits of the mantissa are the
        // place in the table, the rest the share between two places. One is added so that 0 has a place.
        let bits = (nm + 1.0).to_bits() - 1f64.to_bits();
        let at = ((bits >> BELOW) as usize).min(self.0.len() - 2);
        let share = (bits & ((1 << BELOW) - 1)) as f64 / (1u64 << BELOW) as f64;
        self.0[at] + (self.0[at + 1] - self.0[at]) * share
    }
}

/// Time at a distance between whole nm.
fn between(nm: f64, time: impl Fn(Nm) -> f64) -> f64 {
    let [lo, hi] = [Nm::floor(nm), Nm::ceil(nm)].map(time);
    lo + (hi - lo) * nm.fract()
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrace_core::machine::{AxisSettling, PROFILES, Settling};

    #[test]
    fn integer_move_times_equal_those_of_the_motion_model() {
        let mut random = terrace_core::random::Random::new(3);
        // Of all sizes, from 0 upwards.
        let mut next = |bits: u32| random.between(0, (1 << bits) - 1) >> random.below(29);
        for (name, _) in PROFILES {
            let measured = Some(MoveTimes { xy: Time::s(3.7), z: Time::s(0.3) });
            for (times, is_diagonal) in [(None, false), (measured, false), (None, true)] {
                let mut machine = Machine::built_in(name).expect("profile");
                machine.stage.move_times = times.or(machine.stage.move_times);
                if is_diagonal {
                    machine.stage.diagonal = true;
                    machine.stage.settle = Settling::ByAxis(AxisSettling { xy: Time::s(0.1), z: Time::s(0.04) });
                }
                let timer = MoveTimer::new(&machine);
                for i in 0..3000 {
                    let a = [next(28), next(28), next(26)];
                    let b = if i % 3 == 0 { [a[0], a[1], next(26)] } else { [next(28), next(28), next(26)] };
                    let at = [a, b].map(|p| p.map(|v| v as f64));
                    let close =
                        |t: f64, want: f64| assert!((t - want).abs() <= 2e-4 * want, "{name} {a:?} {b:?}: {t} {want}");
                    close(
                        timer.between(at[0], at[1]),
                        motion::stage_move(&machine, Commanded(a), Commanded(b), None).total_s(),
                    );
                    if a[..2] != b[..2] {
                        let top = Some(machine.retract_z());
                        close(
                            timer.lifted(at[0], at[1]),
                            motion::stage_move(&machine, Commanded(a), Commanded(b), top).total_s(),
                        );
                    }
                }
            }
        }
    }
}
