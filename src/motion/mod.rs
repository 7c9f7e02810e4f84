//! How long the machine takes: stage moves, marks, jumps, delays.
//!
//! Consumes the machine and plain geometry; promises estimates whose parts sum to their totals. Units
//! are mm and s inside, nm where the program hands over positions.
//!
//! # Limits
//! A stage axis follows a jerk-limited profile from rest to rest and stops at every target. A galvo is
//! taken as always at its mark or jump speed; what it loses at starts, ends and corners is what the
//! delays of the machine file stand for. Laser-on and laser-off delays run inside the scanner's own
//! delays and cost no time of their own.

mod profile;

pub use profile::rest_to_rest;

use crate::geom::{FieldPoint, NM_PER_MM, Nm, mm_from_nm};
use crate::machine::{Axis, Commanded, Machine};
use crate::units::Speed;

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
/// y together, then z on its own; with `retract_z` first z up to that command. No change, no time.
///
/// Measured times of the machine file replace the profiles: `xy` for any move that changes x or y, `z`
/// for one of z alone, and one `z` more for a retract. They hold the settling already.
pub fn stage_move(machine: &Machine, from: Commanded, to: Commanded, retract_z: Option<Nm>) -> StageMove {
    tilting_move(machine, from, to, retract_z, 0.0)
}

/// As [`stage_move`], the tilt axes taking `tilt_s` for their turn, which runs together with x and y.
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
    let leg = |axis: &Axis, from: i64, to: i64| {
        let jerk = axis.jerk.map(|j| j.as_mm_s3());
        rest_to_rest(mm_from_nm((to - from).abs()), axis.speed.as_mm_s(), axis.acceleration.as_mm_s2(), jerk)
    };
    let top = retract_z.map_or(from[2], |z| z.0);
    let lifted = leg(&stage.z, from[2], top);
    let across = leg(&stage.x, from[0], to[0]).max(leg(&stage.y, from[1], to[1])).max(tilt_s);
    let focused = leg(&stage.z, top, to[2]);
    StageMove { travel_s: lifted + across + focused, settle_s: stage.settle.as_s() }
}

/// One stroke as the scanner gets it.
#[derive(Clone, Copy, Debug)]
pub struct Mark<'a> {
    /// Points in marking order, field frame, nm.
    pub points: &'a [FieldPoint],
    /// Mark speed of its pen.
    pub speed: Speed,
    /// How often it is marked.
    pub passes: u32,
}

/// Time of the strokes of one block, s.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Marking {
    /// Beam on.
    pub mark_s: f64,
    /// Jumps.
    pub jump_s: f64,
    /// Scanner delays.
    pub delay_s: f64,
}

impl Marking {
    /// All parts.
    pub fn total_s(&self) -> f64 {
        self.mark_s + self.jump_s + self.delay_s
    }
}

/// Time of the strokes of one block in marking order, the beam starting at the field's centre.
///
/// A stroke with n passes is taken as marked n times in a row, with a jump back to its start between
/// passes (none where it is closed). Per pass it costs one jump delay, one mark delay and a polygon
/// delay at each inner point. A controller that loops whole pens instead makes other jumps between
/// passes; marks and delays are the same.
pub fn marking<'a>(machine: &Machine, strokes: impl IntoIterator<Item = Mark<'a>>) -> Marking {
    let jump_speed = machine.scanner.jump_speed.as_mm_s();
    let delays = &machine.delays;
    let ends = delays.jump.as_s() + delays.mark.as_s();
    let polygon = delays.polygon.as_s();
    let mut at = FieldPoint::AXIS;
    let mut out = Marking::default();
    for stroke in strokes {
        let (Some(&first), Some(&last)) = (stroke.points.first(), stroke.points.last()) else { continue };
        let passes = f64::from(stroke.passes);
        let length: f64 = stroke.points.windows(2).map(|w| distance_mm(w[0], w[1])).sum();
        let back = distance_mm(last, first) * f64::from(stroke.passes.saturating_sub(1));
        let corners = stroke.points.len().saturating_sub(2) as f64;
        out.mark_s += passes * length / stroke.speed.as_mm_s();
        out.jump_s += (distance_mm(at, first) + back) / jump_speed;
        out.delay_s += passes * (ends + corners * polygon);
        at = last;
    }
    out
}

/// Distance of two field points, mm.
fn distance_mm(a: FieldPoint, b: FieldPoint) -> f64 {
    let dx = f64::from(b.x) - f64::from(a.x);
    let dy = f64::from(b.y) - f64::from(a.y);
    (dx * dx + dy * dy).sqrt() / NM_PER_MM
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::MoveTimes;
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
        assert_eq!(both.settle_s, m.stage.settle.as_s());
        let z_only = stage_move(&m, Commanded([1, 2, 0]), Commanded([1, 2, -70_000]), None);
        assert!(close(z_only.travel_s, time(z, 0.07)));
        let lifted = stage_move(&m, ZERO, Commanded([40_000_000, 0, 70_000]), Some(Nm(200_000_000)));
        assert!(close(lifted.travel_s, time(z, 200.0) + time(x, 40.0) + time(z, 199.93)));
        assert_eq!(stage_move(&m, Commanded([5; 3]), Commanded([5; 3]), None), StageMove::default());
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

    #[test]
    fn passes_repeat_marks_and_delays_and_jump_back_only_where_open() {
        let m = machine();
        let speed = Speed::mm_s(1000.0);
        let open = [[1_000_000, 0], [11_000_000, 0]].map(FieldPoint::from);
        let loop_ = [[0, 0], [1_000_000, 0], [1_000_000, 1_000_000], [0, 1_000_000], [0, 0]].map(FieldPoint::from);
        let once = marking(&m, [Mark { points: &open, speed, passes: 1 }]);
        assert!(close(once.mark_s, 0.01));
        assert!(close(once.jump_s, 1.0 / 5000.0));
        assert!(close(once.delay_s, 300e-6));
        let twice = marking(&m, [Mark { points: &open, speed, passes: 3 }]);
        assert!(close(twice.mark_s, 0.03));
        assert!(close(twice.jump_s, 21.0 / 5000.0));
        assert!(close(twice.delay_s, 900e-6));
        let closed = marking(&m, [Mark { points: &loop_, speed, passes: 2 }]);
        assert!(close(closed.mark_s, 0.008));
        assert_eq!(closed.jump_s, 0.0);
        assert!(close(closed.delay_s, 2.0 * (300e-6 + 3.0 * 30e-6)));
        assert_eq!(closed.total_s(), closed.mark_s + closed.jump_s + closed.delay_s);
    }
}
