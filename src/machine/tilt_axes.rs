//! The tilt table: how commanded angles turn the part, and which angles turn a direction to the lens.
//!
//! The part is turned about the pivot by the inner axis first, then by the outer one. A positive command
//! turns the part right-handed about its axis, seen along the table frame, unless the axis is `reversed`.

use serde::{Deserialize, Serialize};

use super::{Fault, Origin, TiltAngles};
use crate::diag::Diag;
use crate::geom::{NM_PER_MM, Turn};
use crate::units::{
    Angle, AngularAcceleration, AngularJerk, AngularSpeed, Length, Time, non_negative, positive, positive_option,
};

/// A two-axis tilt table under the part.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Tilt {
    /// Point that both axes pass through, in the table frame.
    pub pivot: [Length; 3],
    /// The axes in the order in which they turn the part, the one nearest to the part last.
    pub axes: [RotaryAxis; 2],
}

/// One rotary axis.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RotaryAxis {
    /// Letter of the axis: A about x, B about y, C about z.
    pub letter: Letter,
    /// Whether a positive command turns the part left-handed.
    #[serde(default)]
    pub reversed: bool,
    /// Lowest and highest angle.
    pub travel: [Angle; 2],
    /// Smallest step of a commanded angle; commands are its multiples.
    #[serde(default = "default_increment", deserialize_with = "positive")]
    pub increment: Angle,
    /// Time of a move, settling included.
    #[serde(deserialize_with = "non_negative")]
    pub move_time: Time,
    /// Top speed, for marking while the axis turns.
    #[serde(default, deserialize_with = "positive_option")]
    pub speed: Option<AngularSpeed>,
    /// Top acceleration, for the same.
    #[serde(default, deserialize_with = "positive_option")]
    pub acceleration: Option<AngularAcceleration>,
    /// Top jerk, for the same; without it the acceleration steps.
    #[serde(default, deserialize_with = "positive_option")]
    pub jerk: Option<AngularJerk>,
}

fn default_increment() -> Angle {
    Angle::deg(1e-4)
}

/// Name of a rotary axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, schemars::JsonSchema)]
pub enum Letter {
    /// About x.
    A,
    /// About y.
    B,
    /// About z.
    C,
}

impl Letter {
    /// The letter as it is written.
    pub fn char(self) -> char {
        ['A', 'B', 'C'][self as usize]
    }
}

impl RotaryAxis {
    /// An angle in radians as a command in millionths of a degree, within travel.
    fn command(&self, angle: f64) -> i64 {
        let step = self.step();
        let signed = if self.reversed { -angle } else { angle };
        let command = (signed.to_degrees() * 1e6 / step as f64).round() as i64 * step;
        let [lo, hi] = self.travel.map(micro);
        command.clamp(lo + (-lo).rem_euclid(step), hi - hi.rem_euclid(step))
    }

    /// The smallest step in millionths of a degree.
    fn step(&self) -> i64 {
        micro(self.increment).max(1)
    }

    /// Whether the axis can be sent to a command.
    pub fn takes(&self, command: i64) -> bool {
        let [lo, hi] = self.travel.map(micro);
        (lo..=hi).contains(&command) && command % self.step() == 0
    }
}

fn micro(angle: Angle) -> i64 {
    (angle.as_deg() * 1e6).round() as i64
}

impl Tilt {
    /// What commands make of a part whose origin lies at `origin`.
    pub fn turn(&self, commands: TiltAngles, origin: Origin) -> Turn {
        let pivot = [0, 1, 2].map(|k| self.pivot[k].as_mm() * NM_PER_MM - origin[k] as f64);
        let turns = self.axes.iter().zip(commands.0).map(|(axis, command)| {
            let angle = (command as f64 * 1e-6).to_radians();
            (axis.letter as usize, if axis.reversed { -angle } else { angle })
        });
        Turn::about(pivot, turns)
    }

    /// The commands that turn a direction of the part towards the lens, as nearly as travel and increments
    /// allow.
    pub fn commands(&self, up: [f64; 3]) -> TiltAngles {
        let [x, y, z] = up;
        let flat = x.hypot(y);
        let angles = match self.axes.each_ref().map(|a| a.letter) {
            // The inner axis turns the direction into the plane in which the outer one can raise it.
            [Letter::A, Letter::B] => [y.atan2(x.hypot(z)), (-x).atan2(z)],
            [Letter::B, Letter::A] => [(-x).atan2(y.hypot(z)), y.atan2(z)],
            _ if flat == 0.0 => [0.0; 2],
            // Of the two ways round the one with the smaller turn.
            [Letter::A, _] if y == 0.0 => [x.atan2(z), std::f64::consts::FRAC_PI_2],
            [Letter::A, _] => [(flat * y.signum()).atan2(z), (x / y).atan()],
            _ if x == 0.0 => [(-y).atan2(z), -std::f64::consts::FRAC_PI_2],
            _ => [(-flat * x.signum()).atan2(z), (-y / x).atan()],
        };
        TiltAngles([0, 1].map(|k| self.axes[k].command(angles[k])))
    }

    /// What is wrong with the table.
    pub(super) fn faults(&self) -> Vec<Fault> {
        let mut faults = Vec::new();
        let mut fault = |key: String, text: String, hint: &str| {
            faults.push((key, Diag::input("machine-tilt", text).hint(hint)));
        };
        let [outer, inner] = self.axes.each_ref();
        if outer.letter == inner.letter || outer.letter == Letter::C {
            let text = "tilt.axes must be A or B, and then another of A, B and C nearer to the part";
            fault("tilt.axes".into(), text.into(), "a table that turns about z carries the part itself");
        }
        for (i, axis) in self.axes.iter().enumerate() {
            let [lo, hi] = axis.travel.map(Angle::as_deg);
            if !(lo..=hi).contains(&0.0) || lo < -360.0 || hi > 360.0 {
                let text = format!("travel of tilt axis {} must hold 0 deg and stay within a turn", axis.letter.char());
                fault(format!("tilt.axes.{i}.travel"), text, "write the lower end first");
            }
            if !(1e-6..=1.0).contains(&axis.increment.as_deg()) {
                let text = format!("increment of tilt axis {} is not between 1e-6 and 1 deg", axis.letter.char());
                fault(format!("tilt.axes.{i}.increment"), text, "0.0001 deg is usual");
            }
        }
        if self.pivot.iter().any(|p| p.as_nm().is_none()) {
            fault("tilt.pivot".into(), "tilt.pivot is beyond 4 m".into(), "check the unit");
        }
        faults
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(letters: [Letter; 2], reversed: bool) -> Tilt {
        let axis = |letter| RotaryAxis {
            letter,
            reversed,
            travel: [Angle::deg(-180.0), Angle::deg(180.0)],
            increment: Angle::deg(1e-6),
            move_time: Time::s(1.0),
            speed: None,
            acceleration: None,
            jerk: None,
        };
        Tilt { pivot: [Length::mm(1.0), Length::mm(2.0), Length::mm(-100.0)], axes: letters.map(axis) }
    }

    #[test]
    fn commands_turn_every_direction_to_the_lens_whatever_the_axes() {
        use Letter::{A, B, C};
        for letters in [[A, B], [B, A], [A, C], [B, C]] {
            for reversed in [false, true] {
                let table = table(letters, reversed);
                for i in 0..400 {
                    let (slope, around) = (f64::from(i % 20) / 10.0, f64::from(i / 20) * 0.314);
                    let n = [slope * around.cos(), slope * around.sin(), 1.0];
                    let turn = table.turn(table.commands(n), Origin([7, 8, 9]));
                    let length = (slope * slope + 1.0).sqrt();
                    let off = turn.up().iter().zip(n).map(|(u, n)| (u - n / length).abs()).fold(0.0, f64::max);
                    assert!(off < 1e-7, "{letters:?} {n:?}: {off}");
                }
                assert_eq!(table.commands([0.0, 0.0, 1.0]), TiltAngles::UPRIGHT);
            }
        }
    }

    #[test]
    fn commands_stay_within_travel_and_on_increments() {
        let mut table = table([Letter::A, Letter::B], false);
        table.axes[0].travel = [Angle::deg(-2.0), Angle::deg(3.0)];
        table.axes[0].increment = Angle::deg(0.7);
        assert_eq!(table.commands([0.0, 1.0, 1.0])[0], 2_800_000);
        assert_eq!(table.commands([0.0, -1.0, 1.0])[0], -1_400_000);
        assert!(table.axes[0].takes(2_800_000) && !table.axes[0].takes(2_900_000) && !table.axes[0].takes(3_500_000));
    }

    #[test]
    fn tilt_tables_without_a_tilt_axis_are_refused() {
        use Letter::{A, B, C};
        for letters in [[A, A], [C, A], [C, B], [C, C]] {
            assert_eq!(table(letters, false).faults().len(), 1, "{letters:?}");
        }
        let mut t = table([A, B], false);
        t.axes[1].travel = [Angle::deg(1.0), Angle::deg(5.0)];
        assert_eq!(t.faults().len(), 1);
    }
}
