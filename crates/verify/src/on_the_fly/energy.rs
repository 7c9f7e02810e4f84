//! What the laser gives to each length of a mark, from the moves of the program: power times time over way, and the
//! most over the length of a spot.
//!
//! Units: nm and us in; J/m, s and percent out.

use super::chain::Chain;
use crate::job_facts::JobFacts;
use crate::read::on_the_fly::FlyProgram;

/// A move within a hundredth of the speed of its pen is at it.
const AT_SPEED: f64 = 0.99;
/// A move of less than half the speed of its pen is slow.
const SLOW: f64 = 0.5;
/// How near to a border of speeds a move may count on either side, as a share.
const DOUBT: f64 = 1e-6;

/// Line energy of all marks.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Energy {
    pub(super) mean_j_per_m: f64,
    pub(super) at_speed_percent: f64,
    /// The share that lies so near to the border that either answer is right.
    pub(super) doubt_percent: f64,
    pub(super) slow_s: f64,
    pub(super) slow_doubt_s: f64,
    pub(super) worst_share: f64,
}

/// A mark from move to move.
struct Course {
    /// The number of the mark in the program.
    run: u32,
    /// Speed of its pen, mm/s.
    speed: f64,
    /// Way in mm and time in s at the end of each move, from its begin; the begin comes first.
    ends: Vec<[f64; 2]>,
}

impl Course {
    /// When the spot comes to a place, s.
    fn arrives(&self, way: f64) -> f64 {
        self.time(way, self.ends.partition_point(|c| c[0] < way), |[begun, _]| begun)
    }

    /// When the spot leaves a place, s: later than it arrives where it rests there.
    fn leaves(&self, way: f64) -> f64 {
        self.time(way, self.ends.partition_point(|c| c[0] <= way), |[_, ended]| ended)
    }

    /// When the spot is at a place in the move that ends at number `before`; in a rest what `at_rest` takes of its
    /// begin and its end.
    fn time(&self, way: f64, before: usize, at_rest: impl Fn([f64; 2]) -> f64) -> f64 {
        let i = before.clamp(1, self.ends.len() - 1);
        let ([from, begun], [to, ended]) = (self.ends[i - 1], self.ends[i]);
        if to > from {
            begun + ((way - from) / (to - from)).clamp(0.0, 1.0) * (ended - begun)
        } else {
            at_rest([begun, ended])
        }
    }
}

impl Energy {
    /// Of a program whose pens are those of the job; zeros where the job could not be read.
    pub(super) fn new(program: &FlyProgram, facts: &JobFacts, chain: &Chain) -> Self {
        let (full, spot) = (facts.machine.laser.max_power, facts.machine.lens.spot.as_mm());
        let pens = facts.pens.as_deref().unwrap_or_default();
        let mut out = Self::default();
        // Of all marks: energy, length, length at speed, and length so near to the border that it may be at speed.
        let (mut joule, mut length, mut fast, mut doubt) = (0.0, 0.0, 0.0, 0.0);
        let mut course: Option<Course> = None;
        for (us, from, step) in program.moves() {
            let mark = step.mark.and_then(|mark| Some((mark.run, pens.get(mark.pen.index())?)));
            if course.as_ref().map(|c| c.run) != mark.map(|m| m.0) {
                out.end_mark(course.take(), spot);
            }
            let Some((run, pen)) = mark else { continue };
            let [a, b] = [from, &step.to].map(|to| chain.beam(&to.float()));
            let (way, s) = (a.way(&b) / 1e6, (step.us - us) as f64 / 1e6);
            let speed = pen.speed.as_mm_s();
            let share = way / (speed * s);
            // How long the pen's own power would take for as much energy.
            let full_s = if facts.power_by_speed { way / speed } else { s };
            joule += pen.power.as_w(full) * full_s;
            length += way;
            if share >= AT_SPEED {
                fast += way;
            }
            if (share - AT_SPEED).abs() < DOUBT {
                doubt += way;
            }
            if share < SLOW {
                out.slow_s += s;
            }
            if (share - SLOW).abs() < DOUBT {
                out.slow_doubt_s += s;
            }
            let course = course.get_or_insert_with(|| Course { run, speed, ends: vec![[0.0; 2]] });
            let [gone, time] = course.ends.last().copied().unwrap_or_default();
            course.ends.push([gone + way, time + full_s]);
        }
        out.end_mark(course, spot);
        if length > 0.0 {
            out.mean_j_per_m = 1e3 * joule / length;
            out.at_speed_percent = 100.0 * fast / length;
            out.doubt_percent = 100.0 * doubt / length;
        }
        out
    }

    /// Takes a mark that has ended: the longest time that the spot takes for its own width of it.
    fn end_mark(&mut self, course: Option<Course>, spot: f64) {
        let Some(course) = course else { return };
        let [length, total] = course.ends.last().copied().unwrap_or_default();
        if length <= 0.0 {
            return;
        }
        let width = spot.min(length);
        let last = length - width;
        // The time for a width is piecewise linear in where it begins: it is longest where one of its ends is the end
        // of a move.
        let starts = course.ends.iter().flat_map(|c| [c[0], c[0] - width]).map(|from| from.clamp(0.0, last));
        let times = starts.map(|from| {
            let to = if from < last { from + width } else { length };
            course.leaves(to) - course.arrives(from)
        });
        let longest = times.fold(0.0, f64::max);
        let longest = if width < length { longest } else { total };
        self.worst_share = self.worst_share.max(course.speed * longest / width);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spot_that_rests_gives_its_width_more_than_one_that_moves() {
        // Two moves of 1 mm at 10 mm/s, and a rest of 0.2 s between them.
        let ends = vec![[0.0, 0.0], [1.0, 0.1], [1.0, 0.3], [2.0, 0.4]];
        let course = Course { run: 1, speed: 10.0, ends };
        assert_eq!([course.arrives(0.5), course.arrives(1.0), course.leaves(1.0)], [0.05, 0.1, 0.3]);
        let mut energy = Energy::default();
        energy.end_mark(Some(course), 0.5);
        assert!((energy.worst_share - 10.0 * 0.25 / 0.5).abs() < 1e-9, "{energy:?}");
    }
}
