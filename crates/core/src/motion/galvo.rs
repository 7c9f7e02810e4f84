//! Times of marks, jumps and scanner delays, and how the spot moves in them.
//!
//! The model is that of the machine file, the same for every way of marking: see [`GalvoModel`].

use super::RestToRest;
use crate::geom::{FieldPoint, NM_PER_MM};
use crate::machine::Machine;
use crate::math;
use crate::units::{Speed, Time};

/// Turns sharper than this are corners, at which an axis that follows the path stops; between gentler ones the path is
/// a curve, rad. A little under 15 deg, so that regular polygons of up to 24 sides have corners.
pub const CORNER: f64 = 0.26;

/// How the spot moves along marks and jumps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum GalvoModel {
    /// Always at the speed of its pen or of jumps; the delays of the machine file stand for what it loses at starts,
    /// ends and corners. For machines that state no acceleration of their scanner.
    AtSpeed,
    /// From rest to rest between corners and ends. Instead of the delays of ends and corners.
    RestToRest {
        /// Top acceleration along either axis of the field, mm/s².
        acceleration: f64,
        /// Top jerk along either axis, mm/s³; None where the acceleration steps.
        jerk: Option<f64>,
    },
}

/// A run of the spot between two places where it rests: a straight line or a curve of gentle turns.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Run {
    /// The length of the run in the plane of the field, mm.
    pub length: f64,
    /// The largest share of its way that is one axis's, from 1/sqrt 2 along a diagonal to 1 along an axis.
    pub share: f64,
}

impl Run {
    /// The run that continues by a straight step, mm.
    pub fn then(self, [x, y]: [f64; 2]) -> Self {
        let step = math::hypot(x, y);
        if step == 0.0 {
            return self;
        }
        Self { length: self.length + step, share: self.share.max(x.abs().max(y.abs()) / step) }
    }
}

/// The scanner's delays that count in a model, s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DelaysS {
    /// Before a mark.
    pub jump: f64,
    /// After a mark.
    pub mark: f64,
    /// At the inner points of a stroke.
    pub polygon: f64,
}

impl GalvoModel {
    /// The model of a machine: from rest to rest where it states the acceleration of its scanner.
    pub fn of(machine: &Machine) -> Self {
        machine.scanner.acceleration.map_or(Self::AtSpeed, |a| Self::RestToRest {
            acceleration: a.as_mm_s2(),
            jerk: machine.scanner.jerk.map(|j| j.as_mm_s3()),
        })
    }

    /// The model's name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::AtSpeed => "at speed plus delays",
            Self::RestToRest { .. } => "rest to rest",
        }
    }

    /// Way along one axis in which the spot comes from rest to a speed, mm; 0 where it is always at speed.
    pub fn run_up_mm(self, speed: f64) -> f64 {
        let long = Run { length: f64::MAX.sqrt(), share: 1.0 };
        self.motion(long, speed).map_or(0.0, |motion| motion.ramp_mm())
    }

    /// Time of a run at most at `speed` mm/s along it, s.
    pub fn run_s(self, run: Run, speed: f64) -> f64 {
        self.motion(run, speed).map_or(run.length / speed, |motion| motion.total_s())
    }

    /// How the spot moves along a run; None where it is always at speed.
    pub fn motion(self, run: Run, speed: f64) -> Option<RestToRest> {
        match self {
            Self::AtSpeed => None,
            Self::RestToRest { acceleration, jerk } => {
                let share = if run.length > 0.0 { run.share } else { 1.0 };
                Some(RestToRest::new(run.length, speed, acceleration / share, jerk.map(|j| j / share)))
            }
        }
    }

    /// The delays that count: at speed all; from rest to rest that of jumps alone, in which the mirrors settle. What
    /// the others stand for, the stop at ends and corners, is in the runs.
    pub fn delays(self, machine: &Machine) -> DelaysS {
        let [jump, mark, polygon] =
            [machine.delays.jump, machine.delays.mark, machine.delays.polygon].map(|t| t.as_s());
        match self {
            Self::AtSpeed => DelaysS { jump, mark, polygon },
            Self::RestToRest { .. } => DelaysS { jump, mark: 0.0, polygon: 0.0 },
        }
    }
}

/// Whether the spot rests between a step and the next, mm.
pub fn is_corner(before: [f64; 2], after: [f64; 2]) -> bool {
    angle(before, after) > CORNER
}

/// Angle between two directions, rad.
pub fn angle(a: [f64; 2], b: [f64; 2]) -> f64 {
    math::atan2((a[0] * b[1] - a[1] * b[0]).abs(), a[0] * b[0] + a[1] * b[1])
}

/// The runs of a stroke from corner to corner, in their order.
pub(super) fn runs(points: &[FieldPoint]) -> impl Iterator<Item = Run> {
    pieces(points).map(|(run, _)| run)
}

/// The runs of a stroke from corner to corner, each with the point at which it ends.
pub(super) fn pieces(points: &[FieldPoint]) -> impl Iterator<Item = (Run, FieldPoint)> {
    let steps = points.windows(2).map(|w| (way_mm(w[0], w[1]), w[1]));
    let mut steps = steps.filter(|(step, _)| *step != [0.0; 2]).peekable();
    std::iter::from_fn(move || {
        let (mut last, mut end) = steps.next()?;
        let mut run = Run::default().then(last);
        while let Some((next, to)) = steps.next_if(|(next, _)| !is_corner(last, *next)) {
            run = run.then(next);
            (last, end) = (next, to);
        }
        Some((run, end))
    })
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
    /// How long the beam is on where it is a dot.
    pub dwell: Option<Time>,
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
/// delay at each inner point, as far as these count in the model ([`GalvoModel::delays`]). A controller
/// that loops whole pens instead makes other jumps between passes; marks and delays are the same. A dot
/// costs the dwell of its pen, a jump delay and a mark delay.
pub fn marking<'a>(machine: &Machine, strokes: impl IntoIterator<Item = Mark<'a>>) -> Marking {
    let model = GalvoModel::of(machine);
    let jump_speed = machine.scanner.jump_speed.as_mm_s();
    let delays = model.delays(machine);
    let jump_s = |from: FieldPoint, to: FieldPoint| model.run_s(Run::default().then(way_mm(from, to)), jump_speed);
    let mut at = FieldPoint::AXIS;
    let mut out = Marking::default();
    for stroke in strokes {
        let (Some(&first), Some(&last)) = (stroke.points.first(), stroke.points.last()) else { continue };
        let passes = f64::from(stroke.passes);
        let speed = stroke.speed.as_mm_s();
        let mark_s = match model {
            GalvoModel::AtSpeed => {
                let steps = stroke.points.windows(2).map(|w| way_mm(w[0], w[1]));
                model.run_s(steps.fold(Run::default(), Run::then), speed)
            }
            GalvoModel::RestToRest { .. } => runs(stroke.points).map(|run| model.run_s(run, speed)).sum(),
        };
        let corners = stroke.points.len().saturating_sub(2) as f64;
        let dwell = if stroke.points.len() == 1 { stroke.dwell.map_or(0.0, Time::as_s) } else { 0.0 };
        out.mark_s += passes * (mark_s + dwell);
        out.jump_s += jump_s(at, first) + jump_s(last, first) * f64::from(stroke.passes.saturating_sub(1));
        out.delay_s += passes * (delays.jump + delays.mark + corners * delays.polygon);
        at = last;
    }
    out
}

/// Way between two field points along x and y, mm.
pub(super) fn way_mm(a: FieldPoint, b: FieldPoint) -> [f64; 2] {
    [f64::from(b.x) - f64::from(a.x), f64::from(b.y) - f64::from(a.y)].map(|v| v / NM_PER_MM)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn machine() -> Machine {
        Machine::built_in("xyz-galvo-40").expect("profile")
    }

    fn close(a: f64, b: f64) -> bool {
        (a - b).abs() <= 1e-12 * b.abs().max(1.0)
    }

    #[test]
    fn passes_repeat_marks_and_delays_and_jump_back_only_where_open() {
        let m = machine();
        let speed = Speed::mm_s(1000.0);
        let open = [[1_000_000, 0], [11_000_000, 0]].map(FieldPoint::from);
        let loop_ = [[0, 0], [1_000_000, 0], [1_000_000, 1_000_000], [0, 1_000_000], [0, 0]].map(FieldPoint::from);
        let once = marking(&m, [Mark { points: &open, speed, passes: 1, dwell: None }]);
        assert!(close(once.mark_s, 0.01));
        assert!(close(once.jump_s, 1.0 / 5000.0));
        assert!(close(once.delay_s, 300e-6));
        let twice = marking(&m, [Mark { points: &open, speed, passes: 3, dwell: None }]);
        assert!(close(twice.mark_s, 0.03));
        assert!(close(twice.jump_s, 21.0 / 5000.0));
        assert!(close(twice.delay_s, 900e-6));
        let closed = marking(&m, [Mark { points: &loop_, speed, passes: 2, dwell: None }]);
        assert!(close(closed.mark_s, 0.008));
        assert_eq!(closed.jump_s, 0.0);
        assert!(close(closed.delay_s, 2.0 * (300e-6 + 3.0 * 30e-6)));
        assert_eq!(closed.total_s(), closed.mark_s + closed.jump_s + closed.delay_s);
    }

    fn limited() -> Machine {
        Machine::built_in("xyzac-galvo-10").expect("profile")
    }

    #[test]
    fn spot_rests_at_corners_and_ends_alone() {
        let m = limited();
        let mm = |list: &[[f64; 2]]| -> Vec<FieldPoint> {
            list.iter().map(|p| FieldPoint::from(p.map(|v| (v * 1e6).round() as i32))).collect()
        };
        // One, two and three steps of the curve of Ma et al. (2025).
        let step = 0.156_863;
        let points = mm(&[[0.0; 2], [step, 0.0], [step, 2.0 * step], [4.0 * step, 2.0 * step]]);
        let speed = Speed::mm_s(3000.0);
        let got = marking(&m, [Mark { points: &points, speed, passes: 1, dwell: None }]);
        let want = [17.12, 21.57, 24.69];
        let each: Vec<f64> = runs(&points).map(|run| 1e3 * GalvoModel::of(&m).run_s(run, 3000.0)).collect();
        assert!(each.iter().zip(want).all(|(t, want)| (t - want).abs() < 0.005), "{each:?}");
        assert!(close(1e3 * got.mark_s, each.iter().sum()));
        assert_eq!((got.jump_s, got.delay_s), (0.0, m.delays.jump.as_s()));
        // A gentle turn is not a corner, and neither is a point that stands there twice.
        let curve = mm(&[[0.0; 2], [1.0, 0.0], [1.0, 0.0], [2.0, 0.2], [2.0, 5.0]]);
        let found: Vec<f64> = runs(&curve).map(|run| run.length).collect();
        assert!(found.len() == 2 && close(found[0], 1.0 + math::hypot(1.0, 0.2)) && close(found[1], 4.8), "{found:?}");
        assert_eq!(runs(&curve[..1]).count(), 0);
    }

    #[test]
    fn each_axis_of_the_field_keeps_its_own_limits() {
        let model = GalvoModel::of(&limited());
        let [along, across] = [Run::default().then([1.0, 0.0]), Run::default().then([1.0, 1.0])];
        // On a diagonal both axes go as far in the same time.
        assert!(close(model.run_s(along, 1e9), model.run_s(across, 1e9)));
        assert!(close(model.motion(across, 1e9).expect("a motion").total_s(), model.run_s(across, 1e9)));
        assert_eq!(model.run_s(Run::default(), 100.0), 0.0);
        assert_eq!(model.motion(Run::default(), 100.0).expect("a motion").total_s(), 0.0);
        assert_eq!(GalvoModel::of(&machine()), GalvoModel::AtSpeed);
    }
}
