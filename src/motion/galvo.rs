//! Times of marks, jumps and scanner delays.

use crate::geom::{FieldPoint, NM_PER_MM};
use crate::machine::Machine;
use crate::units::{Speed, Time};

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
/// delay at each inner point. A controller that loops whole pens instead makes other jumps between
/// passes; marks and delays are the same. A dot costs the dwell of its pen, a jump delay and a mark delay.
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
        let dwell = if stroke.points.len() == 1 { stroke.dwell.map_or(0.0, Time::as_s) } else { 0.0 };
        out.mark_s += passes * (length / stroke.speed.as_mm_s() + dwell);
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
}
