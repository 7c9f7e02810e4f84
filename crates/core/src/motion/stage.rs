//! Times of stage moves.

use super::rest_to_rest;
use crate::geom::{Nm, mm_from_nm};
use crate::machine::{Axis, Commanded, Machine};

/// Time of one stage move, s.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StageMove {
    /// Time under way.
    pub travel_s: f64,
    /// Settling after it.
    pub settle_s: f64,
}

impl StageMove {
    /// Both parts.
    pub fn total_s(&self) -> f64 {
        self.travel_s + self.settle_s
    }
}

/// Time from one stage target to the next (axis commands, nm), as the stage programs command it: x and
/// y together, then z on its own; with `retract_z` first z up to that command. Where the machine moves diagonally, all
/// three together, unless it lifts or comes from where it lifts to. No change, no time.
///
/// Measured times of the machine file replace the profiles: `xy` for any move that changes x or y, `z`
/// for one of z alone, and one `z` more for a retract. They hold the settling already.
pub fn stage_move(machine: &Machine, from: Commanded, to: Commanded, retract_z: Option<Nm>) -> StageMove {
    tilting_move(machine, from, to, retract_z, 0.0)
}

/// The move of [`stage_move`], the tilt axes taking `tilt_s` for their turn, which runs together with x and y.
pub fn tilting_move(
    machine: &Machine,
    from: Commanded,
    to: Commanded,
    retract_z: Option<Nm>,
    tilt_s: f64,
) -> StageMove {
    let stage = &machine.stage;
    let plane = from[0] != to[0] || from[1] != to[1] || tilt_s > 0.0;
    let lift = retract_z.filter(|z| z.0 != from[2]);
    if !plane && from[2] == to[2] && lift.is_none() {
        return StageMove::default();
    }
    if let Some(times) = stage.move_times {
        let base = if plane { times.xy.as_s().max(tilt_s) } else { times.z.as_s() };
        let lifted = if lift.is_some() && plane { times.z.as_s() } else { 0.0 };
        return StageMove { travel_s: base + lifted, settle_s: 0.0 };
    }
    let axis_time = |axis: &Axis, from: i64, to: i64| {
        let jerk = axis.jerk.map(|j| j.as_mm_s3());
        rest_to_rest(mm_from_nm((to - from).abs()), axis.speed.as_mm_s(), axis.acceleration.as_mm_s2(), jerk)
    };
    let top = retract_z.map_or(from[2], |z| z.0);
    let lifted = axis_time(&stage.z, from[2], top);
    let across = axis_time(&stage.x, from[0], to[0]).max(axis_time(&stage.y, from[1], to[1])).max(tilt_s);
    let focused = axis_time(&stage.z, top, to[2]);
    let is_diagonal = stage.diagonal && retract_z.is_none() && from[2] != machine.retract_z().0;
    let travel_s = if is_diagonal { across.max(focused) } else { lifted + across + focused };
    StageMove { travel_s, settle_s: stage.settle.after(plane, from[2] != to[2] || lift.is_some()) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::{AxisSettling, MoveTimes, Settling};
    use crate::units::Time;

    const ZERO: Commanded = Commanded([0; 3]);

    fn machine() -> Machine {
        Machine::built_in("xyz-galvo-40").expect("profile")
    }

    fn close(a: f64, b: f64) -> bool {
        (a - b).abs() <= 1e-12 * b.abs().max(1.0)
    }

    #[test]
    fn a_stage_move_costs_its_slowest_axis_then_z_then_the_settling() {
        let m = machine();
        let (x, z) = (&m.stage.x, &m.stage.z);
        let time = |axis: &Axis, mm: f64| {
            let jerk = axis.jerk.map(|j| j.as_mm_s3());
            rest_to_rest(mm, axis.speed.as_mm_s(), axis.acceleration.as_mm_s2(), jerk)
        };
        let both = stage_move(&m, ZERO, Commanded([40_000_000, -3_000_000, 70_000]), None);
        assert!(close(both.travel_s, time(x, 40.0) + time(z, 0.07)), "{both:?}");
        assert_eq!(both.settle_s, m.stage.settle.longest());
        let z_only = stage_move(&m, Commanded([1, 2, 0]), Commanded([1, 2, -70_000]), None);
        assert!(close(z_only.travel_s, time(z, 0.07)));
        let lifted = stage_move(&m, ZERO, Commanded([40_000_000, 0, 70_000]), Some(Nm(200_000_000)));
        assert!(close(lifted.travel_s, time(z, 200.0) + time(x, 40.0) + time(z, 199.93)));
        assert_eq!(stage_move(&m, Commanded([5; 3]), Commanded([5; 3]), None), StageMove::default());
    }

    #[test]
    fn a_diagonal_costs_its_slowest_axis_and_settles_as_the_axes_that_moved() {
        let mut m = machine();
        m.stage.diagonal = true;
        m.stage.settle = Settling::ByAxis(AxisSettling { xy: Time::s(0.1), z: Time::s(0.04) });
        let alone = |to| stage_move(&m, ZERO, Commanded(to), None);
        let [across, down] = [alone([40_000_000, 0, 0]), alone([0, 0, -3_000_000])];
        let both = alone([40_000_000, 0, -3_000_000]);
        assert_eq!(both.travel_s, across.travel_s.max(down.travel_s));
        assert_eq!([across, down, both].map(|m| m.settle_s), [0.1, 0.04, 0.1]);
        // A lift is made by itself.
        let lifted = stage_move(&m, ZERO, Commanded([40_000_000, 0, 0]), Some(Nm(9_000_000)));
        let up = alone([0, 0, 9_000_000]).travel_s;
        assert!(close(lifted.travel_s, up + across.travel_s + up), "{lifted:?}");
    }

    #[test]
    fn measured_times_stand_in_for_the_profiles() {
        let mut m = machine();
        m.stage.move_times = Some(MoveTimes { xy: Time::s(3.7), z: Time::s(0.3) });
        let total = |to, retract| stage_move(&m, ZERO, Commanded(to), retract).total_s();
        assert_eq!(total([1, 0, 0], None), 3.7);
        assert_eq!(total([0, 1, 1], None), 3.7);
        assert_eq!(total([0, 0, 1], None), 0.3);
        assert_eq!(total([1, 0, 0], Some(Nm(9))), 4.0);
        assert_eq!(total([0, 0, 0], None), 0.0);
    }
}
