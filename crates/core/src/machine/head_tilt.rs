//! Where the stage stands for a head that its tilt axes turn.
//!
//! The stage carries the pivot. With the commands at which a head without a tilt has the centre of its field at S of
//! the table frame, a head turned by R about the pivot q (from that centre) has it at F = S + q - R q. So the stage
//! goes to S = F - (q - R q), which is rounded to its increments; F is then found back from what was commanded, and the
//! stop takes it, to the nanometre, as its centre and focal plane. Sideways the field makes up for what rounding has
//! moved; the height of the focal plane counts. A step of x or y raises or lowers a leaning focal plane by less than an
//! increment, so of the positions around the one that was wanted one is taken that meets the height.

use super::{Carries, Commanded, Machine, Origin, TiltAngles};
use crate::geom::{Nm, P2, P3, Turned};

/// How near to the height that is wanted a focal plane comes where a step of x or y can bring it there, nm.
const MET: f64 = 1.0;

/// Positions that are tried at most: all of them where increments are 0.1 um.
const TRIALS: usize = 100_000;

/// Where a stop stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stand {
    /// The commands.
    pub stage: Commanded,
    /// From the place that was wanted to the one that the commands reach, nm, in x, y and z of the turned part.
    pub by: [i64; 3],
}

impl Machine {
    /// Whether the tilt axes carry the head.
    pub fn tilts_head(&self) -> bool {
        self.tilt.as_ref().is_some_and(|tilt| tilt.carries == Carries::Head)
    }

    /// How far from the place that is wanted a tilted head may stand sideways: where increments are coarser than a
    /// focal plane is to be met, far enough to choose among positions.
    pub fn stand_room(&self) -> Nm {
        let step = self.increment_nm();
        if step.f64() <= 2.0 * MET { step * 2 } else { Nm(20_000).max(step * 8) }
    }

    /// The commands that bring the centre of the field to the point `p` of the turned part, at the focal height `lpfl`. The
    /// height is met to `MET`, where a tilt is so small that no position within `stand_room` does, to half
    /// an increment.
    pub fn stand(&self, tilt: TiltAngles, p: P2<Turned>, lpfl: Nm, origin: Origin) -> Stand {
        let Some(head) = self.tilt.as_ref().filter(|_| self.tilts_head() && !tilt.is_upright()) else {
            return Stand { stage: self.stage_from_part(p, lpfl, origin), by: [0; 3] };
        };
        let turn = head.turn(tilt, origin);
        let (swing, step) = (head.swing(tilt), self.increment_nm().f64());
        let wanted = P3::<Turned>::new([p.x, p.y, lpfl.0].map(|v| v as f64));
        let field = turn.back(wanted).at;
        let mut at = [0, 1, 2].map(|k| ((field[k] + origin[k] as f64 - swing[k]) / step).round() * step);
        let reached = |at: [f64; 3]| turn.apply(P3::new([0, 1, 2].map(|k| at[k] - origin[k] as f64 + swing[k]))).at;
        // What x and y are rounded by lifts or lowers the leaning focal plane too: z makes up for it.
        let up = turn.up();
        let height = HeightSteps { off: (wanted[2] - reached(at)[2]) / (up[2] * step), up, step };
        let most = ((self.stand_room().f64() / step - 2.0) * up[2]).max(0.0) as i64;
        let [i, j] = height.fewest(most);
        for (k, n) in [i as f64, j as f64, height.left([i, j]).round()].into_iter().enumerate() {
            at[k] += n * step;
        }
        let place = reached(at);
        let by = [0, 1, 2].map(|k| (place[k] - wanted[k]).round() as i64);
        let axes = self.axes();
        Stand { stage: Commanded([0, 1, 2].map(|k| axes[k].1.sign() * at[k].round() as i64)), by }
    }

    /// Whether commands bring the centre of the field to the point `p` of the turned part and the focal plane to the
    /// focal height `lpfl`: exactly, but for a tilted head, whose place is known to a nanometre.
    pub fn reaches(&self, stage: Commanded, tilt: TiltAngles, p: P2<Turned>, lpfl: Nm, origin: Origin) -> bool {
        if !self.tilts_head() || tilt.is_upright() {
            return stage == self.stage_from_part(p, lpfl, origin);
        }
        let place = self.turn(tilt, origin).apply(self.field_centre(stage, tilt, origin));
        [p.x, p.y, lpfl.0].iter().enumerate().all(|(k, &v)| (place[k] - v as f64).abs() <= 1.0)
    }

    /// Where commands bring the centre of the field, part frame, nm: x, y and the height of the focal plane.
    pub fn field_centre(&self, stage: Commanded, tilt: TiltAngles, origin: Origin) -> P3 {
        let swing = self.tilt.as_ref().map_or([0.0; 3], |head| head.swing(tilt));
        let axes = self.axes();
        P3::new([0, 1, 2].map(|k| (axes[k].1.sign() * stage[k] - origin[k]) as f64 + swing[k]))
    }
}

/// How steps of x and y move the height of a leaning focal plane, of which steps of z take up the rest.
struct HeightSteps {
    /// The height that is missing without any, in steps of z.
    off: f64,
    /// The direction to the lens.
    up: [f64; 3],
    /// The increment of the stage, nm.
    step: f64,
}

impl HeightSteps {
    /// The height that is missing after i steps of x and j of y, in steps of z.
    fn left(&self, [i, j]: [i64; 2]) -> f64 {
        let [ux, uy, uz] = self.up;
        self.off - (i as f64 * ux + j as f64 * uy) / uz
    }

    /// The height that is missing with the nearest whole steps of z, nm.
    fn miss(&self, steps: [i64; 2]) -> f64 {
        let left = self.left(steps);
        (left - left.round()).abs() * self.up[2] * self.step
    }

    /// The fewest steps of x and y, `most` together, with which the height is met; where none does, those that miss it
    /// by least.
    fn fewest(&self, most: i64) -> [i64; 2] {
        let [ux, uy, _] = self.up;
        // Fewer steps do not move the height by what is missing.
        let first = ((self.miss([0; 2]) - MET) / self.step / ux.abs().max(uy.abs())).max(0.0) as i64;
        let mut best = [0; 2];
        for steps in (first.min(most)..=most).flat_map(ring).take(TRIALS) {
            if self.miss(steps) < self.miss(best) {
                best = steps;
            }
            if self.miss(best) <= MET {
                break;
            }
        }
        best
    }
}

/// Steps of x and y that are `n` together.
fn ring(n: i64) -> impl Iterator<Item = [i64; 2]> {
    (-n..=n).flat_map(move |i| [[i, n - i.abs()], [i, i.abs() - n]])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::Length;

    #[test]
    fn height_is_met_to_half_an_increment_with_fine_increments_at_any_tilt() {
        let mut machine = Machine::built_in("xyz-headtilt-galvo-40").expect("a profile");
        let (wanted, lpfl) = (P2::<Turned>::new(100_200_300, 400_500_600), Nm(-7_654_321));
        for step in [1, 3, 7, 20] {
            machine.stage.increment = Length::mm(f64::from(step) * 1e-6);
            for commands in [[0, 100], [0, 3_000], [30_000_000, 0], [20_000_000, -90], [-12_345_600, 3_210_900]] {
                let commands = TiltAngles(commands);
                let Stand { by, .. } = machine.stand(commands, wanted, lpfl, Origin::default());
                assert!(by[2].abs() <= i64::from(step / 2 + 1), "{step} {commands:?}: {by:?}");
                assert!(by[0].abs().max(by[1].abs()) <= machine.stand_room().0, "{step} {commands:?}: {by:?}");
            }
        }
    }

    #[test]
    fn a_tilted_head_stands_where_its_field_meets_the_place_to_the_nanometre() {
        let machine = Machine::built_in("xyz-headtilt-galvo-40").expect("a profile");
        let origin = Origin([-225_000_000, -224_000_000, 3_000_100]);
        let (wanted, lpfl) = (P2::<Turned>::new(100_200_300, 400_500_600), Nm(-7_654_321));
        for commands in [[12_345_600, -3_210_900], [0, 100], [-20_000_000, 20_000_000], [0, 230_000]].map(TiltAngles) {
            let Stand { stage, by } = machine.stand(commands, wanted, lpfl, origin);
            assert!(stage.0.iter().all(|v| v % machine.increment_nm().0 == 0), "{stage:?}");
            let back = machine.turn(commands, origin).apply(machine.field_centre(stage, commands, origin));
            let meant = [wanted.x + by[0], wanted.y + by[1], lpfl.0 + by[2]];
            let off = (0..3).map(|k| (back[k] - meant[k] as f64).abs()).fold(0.0, f64::max);
            assert!(off <= 0.51, "{commands:?}: {off}");
            let room = machine.stand_room().0;
            assert!(by[0].abs().max(by[1].abs()) <= room, "{by:?}");
            // A ten-thousandth of a degree tilts no focal plane by enough.
            assert!(by[2].abs() <= if commands[1] == 100 { 50 } else { 1 }, "{by:?}");
        }
        let upright = machine.stand(TiltAngles::UPRIGHT, wanted, lpfl, origin);
        assert_eq!(upright, Stand { stage: machine.stage_from_part(wanted, lpfl, origin), by: [0; 3] });
    }
}
