//! Line energy: what the laser gives to each length of a line, from its power and the speed of the spot.
//!
//! Consumes strokes with the power and speed of their pens; promises the mean over the lines of a block, and the place
//! where a line gets most. Where the spot goes from rest to rest the laser is on while it gains and loses speed, so
//! that E(s) = P / v(s) rises at ends and corners; on the line at rest it is infinite, on the part it is spread over
//! the spot. So the energy at a rest is that of the line within half a spot of it: P times the time for that way, over
//! the way. Runs shorter than a spot count up to their middle. Units: J/m, mm, s, W.

use super::galvo::{GalvoModel, pieces, runs, way_mm};
use crate::geom::{FieldPoint, NM_PER_MM};
use crate::math;

/// The laser and the scanner that mark a stroke.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beam {
    /// How the spot moves.
    pub model: GalvoModel,
    /// Speed of the pen, mm/s.
    pub speed: f64,
    /// Power of the pen, W.
    pub power: f64,
    /// Diameter of the spot, mm.
    pub spot: f64,
}

/// Where the spot rests in a mark.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Rest {
    /// At its begin or its end.
    End,
    /// At a corner.
    Corner,
}

/// A place where a line gets more than its pen's energy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Overshoot {
    /// Energy within half a spot of it over that at the pen's speed, P / v: 1 is what is wanted.
    pub ratio: f64,
    /// Where, field frame.
    pub at: FieldPoint,
    /// What the spot does there.
    pub rest: Rest,
}

/// Line energy of the marks of a block, dots left out.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LineEnergy {
    length: f64,
    energy: f64,
    at_speed: f64,
    worst: Option<Overshoot>,
}

/// What lies next to a rest of the spot.
#[derive(Clone, Copy, Default)]
struct NearRest {
    /// Way, mm.
    way: f64,
    /// Time that the spot takes for it, s.
    time: f64,
}

impl NearRest {
    /// What lies before a rest and after it.
    fn and(self, after: Self) -> Self {
        Self { way: self.way + after.way, time: self.time + after.time }
    }
}

impl LineEnergy {
    /// Adds one pass of a stroke. Adds nothing for a dot, nor where the model keeps the spot always at speed: the
    /// energy at ends and corners is then not known.
    pub fn add(&mut self, points: &[FieldPoint], beam: Beam) {
        let Some(&first) = points.first() else { return };
        // What lies next to the last rest before it, and the rest.
        let mut before = NearRest::default();
        let mut at = first;
        let mut rest = Rest::End;
        for (run, end) in pieces(points) {
            let Some(motion) = beam.model.motion(run, beam.speed) else { return };
            let total = motion.total_s();
            // Half a spot, or half of a run that is shorter: no length counts at both of its ends.
            let way = (beam.spot / 2.0).min(run.length / 2.0);
            let after = NearRest { way, time: motion.time_at(way) };
            self.add_rest(at, rest, before.and(after), beam.speed);
            self.length += run.length;
            self.energy += beam.power * total;
            if motion.peak() >= beam.speed {
                // T = L / v + ramp_s, and both ramps together are v * ramp_s long: L - v * ramp_s = 2 L - v T is at
                // speed.
                self.at_speed += (2.0 * run.length - beam.speed * total).max(0.0);
            }
            // The way from rest and the way to it take the same time.
            before = after;
            at = end;
            rest = Rest::Corner;
        }
        if before.way > 0.0 {
            self.add_rest(at, Rest::End, before, beam.speed);
        }
    }

    /// Notes what a line gets next to a rest, where it is the most.
    fn add_rest(&mut self, at: FieldPoint, rest: Rest, near: NearRest, speed: f64) {
        let ratio = speed * near.time / near.way;
        if self.worst.is_none_or(|worst| ratio > worst.ratio) {
            self.worst = Some(Overshoot { ratio, at, rest });
        }
    }

    /// Mean over the length of the lines, J/m; None where there are none.
    pub fn mean_j_per_m(&self) -> Option<f64> {
        (self.length > 0.0).then(|| 1e3 * self.energy / self.length)
    }

    /// Share of the length that is marked at the speed of its pen.
    pub fn share_at_speed(&self) -> Option<f64> {
        (self.length > 0.0).then(|| self.at_speed / self.length)
    }

    /// Where a line gets most.
    pub fn worst(&self) -> Option<Overshoot> {
        self.worst
    }
}

/// Divides the segments of one pass of a stroke into pieces, and calls `visit` for each with its ends, mm in the field, and
/// the energy that it gets, J. Where the speed of the spot changes they are equal, of `step` mm or less; where it does not,
/// a piece is as long as the segment. Leaves dots out.
pub fn deposits(points: &[FieldPoint], beam: Beam, step: f64, mut visit: impl FnMut([[f64; 2]; 2], f64)) {
    let mut run_motions = runs(points).map(|run| (run.length, beam.model.motion(run, beam.speed)));
    // The run that holds the segment, and how much of it lies before the segment, mm.
    let (mut run_length, mut motion, mut run_before) = (0.0, None, 0.0);
    for pair in points.windows(2) {
        let [x, y] = way_mm(pair[0], pair[1]);
        let length = math::hypot(x, y);
        // Runs leave out segments of no length too.
        if length == 0.0 {
            continue;
        }
        // Equal at the end of a run, without a rounding error: its length is the sum of the same numbers in the same
        // order.
        if run_before >= run_length {
            (run_length, motion) = run_motions.next().unwrap_or_default();
            run_before = 0.0;
        }
        // When the spot has gone a share of the segment, s: from the start of the run, or of the segment where it is
        // always at speed. Only differences count.
        let time = |share: f64| match &motion {
            Some(motion) => motion.time_at(run_before + share * length),
            None => share * length / beam.speed,
        };
        let first = [pair[0].x, pair[0].y].map(|v| f64::from(v) / NM_PER_MM);
        let place = |share: f64| [first[0] + share * x, first[1] + share * y];
        // The shares of the segment at which the spot has gained its speed, and at which it begins to lose it.
        let [gained, kept] = match &motion {
            Some(motion) => [motion.ramp_mm(), run_length - motion.ramp_mm()].map(|way| (way - run_before) / length),
            None => [0.0, 1.0],
        };
        let gained = gained.clamp(0.0, 1.0);
        let kept = kept.clamp(gained, 1.0);
        let (mut from, mut before) = (place(0.0), time(0.0));
        for (begin, end, step) in [(0.0, gained, step), (gained, kept, f64::INFINITY), (kept, 1.0, step)] {
            if begin == end {
                continue;
            }
            let count = ((end - begin) * length / step).ceil().max(1.0);
            for k in 1..=count as u32 {
                let share = begin + (end - begin) * f64::from(k) / count;
                let (to, now) = (place(share), time(share));
                visit([from, to], beam.power * (now - before));
                (from, before) = (to, now);
            }
        }
        run_before += length;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::Run;

    fn beam(speed: f64) -> Beam {
        let model = GalvoModel::RestToRest { acceleration: 20_000.0, jerk: Some(1e6) };
        Beam { model, speed, power: 1.2, spot: 0.0245 }
    }

    fn points(list: &[[i32; 2]]) -> Vec<FieldPoint> {
        list.iter().map(|p| FieldPoint::from(*p)).collect()
    }

    #[test]
    fn energy_is_power_times_time_and_worst_at_rests() {
        // The jerk alone limits the first half of a spot from rest: t = (6 s / j)^(1/3).
        let from_rest = |way: f64| math::cbrt(6.0 * way / 1e6);
        let mut one = LineEnergy::default();
        one.add(&points(&[[0, 0], [20_000_000, 0]]), beam(100.0));
        let run = Run::default().then([20.0, 0.0]);
        let total = beam(100.0).model.run_s(run, 100.0);
        assert!((one.mean_j_per_m().expect("a line") - 1.2 * total / 20e-3).abs() < 1e-9);
        let worst = one.worst().expect("a line");
        let share = 100.0 * from_rest(0.012_25) / 0.012_25;
        assert!((worst.ratio - share).abs() < 1e-6 * share && worst.rest == Rest::End, "{worst:?} {share}");
        // Over the ramps the spot takes sqrt(v / j) twice each, at half of the speed in the mean.
        let ramps = 100.0 * 2.0 * (100.0f64 / 1e6).sqrt();
        assert!((one.share_at_speed().expect("a line") - (1.0 - ramps / 20.0)).abs() < 1e-9);
        // A corner between short runs gets more than the ends of a long one; twice the pen's speed makes it worse.
        let mut bent = LineEnergy::default();
        bent.add(&points(&[[0, 0], [20_000_000, 0], [20_000_000, 6_000], [0, 6_000]]), beam(100.0));
        let short = bent.worst().expect("a line");
        assert!(short.ratio > worst.ratio && short.rest == Rest::Corner && short.at.x == 20_000_000, "{short:?}");
        let mut quick = LineEnergy::default();
        quick.add(&points(&[[0, 0], [20_000_000, 0]]), beam(200.0));
        assert!((quick.worst().expect("a line").ratio / worst.ratio - 2.0).abs() < 1e-6);
    }

    #[test]
    fn nothing_is_said_of_dots_and_of_a_spot_that_is_always_at_speed() {
        let mut none = LineEnergy::default();
        none.add(&points(&[[0, 0], [1_000_000, 0]]), Beam { model: GalvoModel::AtSpeed, ..beam(100.0) });
        none.add(&points(&[[5, 5]]), beam(100.0));
        none.add(&[], beam(100.0));
        assert_eq!((none.mean_j_per_m(), none.share_at_speed(), none.worst()), (None, None, None));
    }

    #[test]
    fn deposits_sum_up_to_the_energy_of_the_marks_and_are_densest_at_corners() {
        let bent = points(&[[0, 0], [3_000_000, 0], [3_000_000, 0], [6_000_000, 200_000], [6_000_000, 5_000_000]]);
        for model in [beam(400.0).model, GalvoModel::AtSpeed] {
            let beam = Beam { model, ..beam(400.0) };
            let (mut sum, mut way, mut densest) = (0.0, 0.0, ([0.0; 2], 0.0));
            deposits(&bent, beam, 0.05, |[from, to], energy| {
                let length = math::hypot(to[0] - from[0], to[1] - from[1]);
                (sum, way) = (sum + energy, way + length);
                if energy / length > densest.1 {
                    densest = ([0, 1].map(|k| f64::midpoint(from[k], to[k])), energy / length);
                }
            });
            assert!((way - 3.0 - math::hypot(3.0, 0.2) - 4.8).abs() < 1e-9, "{way}");
            let time: f64 = runs(&bent).map(|run| model.run_s(run, 400.0)).sum();
            assert!((sum / (1.2 * time) - 1.0).abs() < 1e-12, "{sum}");
            let is_at_rest = [[0.0, 0.0], [6.0, 0.2], [6.0, 5.0]]
                .iter()
                .any(|p| math::hypot(p[0] - densest.0[0], p[1] - densest.0[1]) < 0.05);
            assert!(is_at_rest || model == GalvoModel::AtSpeed, "{densest:?}");
        }
    }
}
