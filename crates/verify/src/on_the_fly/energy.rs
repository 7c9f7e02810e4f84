//! What the laser gives to each length of a mark, from the moves of the program: power times time over way, and the most
//! over the length of a spot.
//!
//! Units: nm and us in; J/m, s and percent out.

use super::chain::Chain;
use crate::job_facts::JobFacts;
use crate::read::on_the_fly::FlyProgram;

/// A move within a hundredth of the speed of its pen is at it.
const AT_SPEED: f64 = 0.99;
/// How near to a border of speeds a move may count on either side, as a share.
const DOUBT: f64 = 1e-6;

/// Line energy of all marks.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Energy {
    pub(super) mean_j_per_m: f64,
    pub(super) at_speed_percent: f64,
    /// What lies so near to the border that either answer is right.
    pub(super) doubt_percent: f64,
    pub(super) slow_s: f64,
    pub(super) slow_doubt_s: f64,
    pub(super) worst_share: f64,
}

/// Way in mm and time in s at the end of each move of a mark, from its begin.
type Course = Vec<[f64; 2]>;

impl Energy {
    /// Of a program whose pens are those of the job; zeros where the job could not be read.
    pub(super) fn of(program: &FlyProgram, facts: &JobFacts, chain: &Chain) -> Self {
        let (full, spot) = (facts.machine.laser.max_power, facts.machine.lens.spot.as_mm());
        let pens = facts.pens.as_deref().unwrap_or_default();
        let (mut out, mut joule, mut length, mut fast, mut doubt) = (Self::default(), 0.0, 0.0, 0.0, 0.0);
        let mut course: Option<(u32, f64, Course)> = None;
        for (us, from, step) in program.moves() {
            let mark = step.mark.and_then(|mark| Some((mark.run, pens.get(mark.pen.index())?)));
            if course.as_ref().map(|c| c.0) != mark.map(|m| m.0) {
                out.end(course.take(), spot);
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
            if share < 0.5 {
                out.slow_s += s;
            }
            if (share - 0.5).abs() < DOUBT {
                out.slow_doubt_s += s;
            }
            let (_, _, course) = course.get_or_insert_with(|| (run, speed, vec![[0.0; 2]]));
            let [gone, time] = course.last().copied().unwrap_or_default();
            course.push([gone + way, time + full_s]);
        }
        out.end(course, spot);
        if length > 0.0 {
            out.mean_j_per_m = 1e3 * joule / length;
            (out.at_speed_percent, out.doubt_percent) = (100.0 * fast / length, 100.0 * doubt / length);
        }
        out
    }

    /// A mark has ended: the longest time that the spot takes for its own width of it.
    fn end(&mut self, course: Option<(u32, f64, Course)>, spot: f64) {
        let Some((_, speed, course)) = course else { return };
        let [length, total] = course.last().copied().unwrap_or_default();
        if length <= 0.0 {
            return;
        }
        let width = spot.min(length);
        // When the spot comes to a place, or leaves it where it rests there.
        let when = |way: f64, leaves: bool| {
            let before = course.partition_point(|c| if leaves { c[0] <= way } else { c[0] < way });
            let i = before.clamp(1, course.len() - 1);
            let ([from, begun], [to, ended]) = (course[i - 1], course[i]);
            if to > from {
                begun + ((way - from) / (to - from)).clamp(0.0, 1.0) * (ended - begun)
            } else if leaves {
                ended
            } else {
                begun
            }
        };
        let last = length - width;
        let starts = course.iter().flat_map(|c| [c[0], c[0] - width]).map(|from| from.clamp(0.0, last));
        let times = starts.map(|from| {
            let to = if from < last { from + width } else { length };
            when(to, true) - when(from, false)
        });
        let longest = times.fold(0.0, f64::max);
        let longest = if width < length { longest } else { total };
        self.worst_share = self.worst_share.max(speed * longest / width);
    }
}
