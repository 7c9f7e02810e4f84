//! The tilt axes: how commanded angles turn the part or the head, and which angles bring a direction of the part and
//! the beam together.
//!
//! What the axes carry is turned about the pivot by the inner axis first, then by the outer one. A positive command
//! turns it right-handed about its axis, seen along the table frame, unless the axis is `reversed`.
//!
//! A head that is turned by R sees the part turned by R⁻¹: with [`Turn`] of that, stops, cuts and depths are those of a
//! turned part. It is taken about the table frame's origin, so that the turned frame has the axes of the head and does
//! not depend on where the part lies; where the stage stands for it says [`Machine::stand`](super::Machine::stand).

use crate::math;
use serde::{Deserialize, Serialize};

use super::{Carries, Fault, Origin, TiltAngles};
use crate::diag::Diag;
use crate::geom::{NM_PER_MM, P3, Turn};
use crate::units::{
    Angle, AngularAcceleration, AngularJerk, AngularSpeed, Length, Time, non_negative, positive, positive_option,
};

/// Two tilt axes: a table under the part, or a swivel that carries the head (rob-scan).
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Tilt {
    /// What the axes turn.
    #[serde(default = "the_part")]
    pub carries: Carries,
    /// The point that both axes pass through: of a table in the table frame; of a head from the centre of its field in
    /// the focal plane, without a tilt.
    pub pivot: [Length; 3],
    /// The axes in the order in which they carry each other, the one nearest to the part or to the head last.
    pub axes: [RotaryAxis; 2],
}

/// One rotary axis.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RotaryAxis {
    /// A turns about x, B about y, C about z. With a table the outer axis is A or B, with a head the inner one; the
    /// other axis has another letter.
    pub letter: Letter,
    /// Whether a positive command turns what is carried left-handed.
    #[serde(default)]
    pub reversed: bool,
    /// Lowest and highest angle; 0 lies between them, at most a turn either way (of C: 100 turns). A turntable C
    /// without ends is "continuous".
    #[schemars(extend("x-value" = "two angles, or \"continuous\""))]
    pub travel: AxisTravel,
    /// How a continuous axis is commanded: whole turns count; or from 0 to under 360 deg, and the axis goes the shorter
    /// way round. Modulo takes an `increment` that divides 360 deg.
    #[serde(default)]
    pub commands: AngleCommands,
    /// Smallest step of a commanded angle; commands are its multiples.
    #[serde(default = "default_increment", deserialize_with = "positive")]
    pub increment: Angle,
    /// Time of a move, settling included.
    #[serde(deserialize_with = "non_negative")]
    pub move_time: Time,
    /// Top speed, such as "20 deg/s" or "0.36 rad/s"; only for marking while the axis turns.
    #[serde(default, deserialize_with = "positive_option")]
    pub speed: Option<AngularSpeed>,
    /// Top acceleration, such as "100 deg/s2", for the same.
    #[serde(default, deserialize_with = "positive_option")]
    pub acceleration: Option<AngularAcceleration>,
    /// Top jerk, such as "1000 deg/s3", for the same.
    #[serde(default, deserialize_with = "positive_option")]
    pub jerk: Option<AngularJerk>,
}

const fn the_part() -> Carries {
    Carries::Part
}

/// How far a rotary axis turns.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, schemars::JsonSchema)]
#[serde(untagged)]
pub enum AxisTravel {
    /// Between a lowest and a highest angle.
    Ends([Angle; 2]),
    /// Any angle, either way.
    Endless(Endless),
}

/// The word for a travel without ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, schemars::JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Endless {
    /// "continuous".
    Continuous,
}

/// How the angles of a rotary axis are commanded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, schemars::JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum AngleCommands {
    /// Whole turns count.
    #[default]
    Absolute,
    /// From 0 to under 360 deg; the axis goes the shorter way round.
    Modulo,
}

/// A whole turn, millionths of a degree.
const TURN: i64 = 360_000_000;

impl AxisTravel {
    /// A travel without ends.
    pub const CONTINUOUS: Self = Self::Endless(Endless::Continuous);

    /// Lowest and highest angle; None where it has no ends.
    pub fn ends(self) -> Option<[Angle; 2]> {
        match self {
            Self::Ends(ends) => Some(ends),
            Self::Endless(_) => None,
        }
    }
}

impl<'de> Deserialize<'de> for AxisTravel {
    fn deserialize<D: serde::Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        struct Visitor;
        impl<'de> serde::de::Visitor<'de> for Visitor {
            type Value = AxisTravel;

            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("two angles such as [\"-90 deg\", \"90 deg\"], or \"continuous\"")
            }
            fn visit_str<E: serde::de::Error>(self, text: &str) -> Result<AxisTravel, E> {
                if text == "continuous" {
                    return Ok(AxisTravel::CONTINUOUS);
                }
                Err(E::invalid_value(serde::de::Unexpected::Str(text), &self))
            }
            fn visit_seq<A: serde::de::SeqAccess<'de>>(self, seq: A) -> Result<AxisTravel, A::Error> {
                Ok(AxisTravel::Ends(Deserialize::deserialize(serde::de::value::SeqAccessDeserializer::new(seq))?))
            }
        }
        d.deserialize_any(Visitor)
    }
}

fn default_increment() -> Angle {
    Angle::deg(1e-4)
}

/// Most turns either way of a turntable with ends.
const TURNS: f64 = 100.0;

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
        match self.travel.ends().map(|ends| ends.map(micro)) {
            Some([lo, hi]) => command.clamp(lo + (-lo).rem_euclid(step), hi - hi.rem_euclid(step)),
            None => self.written(command),
        }
    }

    /// A command in millionths of a degree as the controller takes it.
    pub fn written(&self, command: i64) -> i64 {
        match self.commands {
            AngleCommands::Absolute => command,
            AngleCommands::Modulo => command.rem_euclid(TURN),
        }
    }

    /// The smallest step in millionths of a degree.
    fn step(&self) -> i64 {
        micro(self.increment).max(1)
    }

    /// Whether the axis can be sent to a command.
    pub fn takes(&self, command: i64) -> bool {
        let within = match self.travel.ends().map(|ends| ends.map(micro)) {
            Some([lo, hi]) => (lo..=hi).contains(&command),
            None => self.written(command) == command,
        };
        within && command % self.step() == 0
    }
}

fn micro(angle: Angle) -> i64 {
    (angle.as_deg() * 1e6).round() as i64
}

impl Tilt {
    /// What commands make of a part whose origin lies at `origin`, as the head sees it.
    pub fn turn(&self, commands: TiltAngles, origin: Origin) -> Turn {
        let [outer, inner] = self.angles(commands);
        let origin = origin.0.map(|v| v as f64);
        match self.carries {
            Carries::Part => {
                let pivot = self.pivot_nm();
                Turn::about([0, 1, 2].map(|k| pivot[k] - origin[k]), [outer, inner])
            }
            Carries::Head => Turn::about(origin.map(|v| -v), [(inner.0, -inner.1), (outer.0, -outer.1)]),
        }
    }

    /// By how much commands move the centre of the field of a head whose stage stays, nm, table frame; not at all where
    /// the axes carry the part.
    pub fn swing(&self, commands: TiltAngles) -> [f64; 3] {
        if self.carries == Carries::Part || commands.is_upright() {
            return [0.0; 3];
        }
        Turn::about(self.pivot_nm(), self.angles(commands)).apply(P3::new([0.0; 3])).at
    }

    /// The pivot, nm.
    fn pivot_nm(&self) -> [f64; 3] {
        self.pivot.map(|p| p.as_mm() * NM_PER_MM)
    }

    /// The axes by number, with the angles in radians by which they turn what they carry, right-handed.
    fn angles(&self, commands: TiltAngles) -> [(usize, f64); 2] {
        [0, 1].map(|k| {
            let (axis, angle) = (&self.axes[k], (commands[k] as f64 * 1e-6).to_radians());
            (axis.letter as usize, if axis.reversed { -angle } else { angle })
        })
    }

    /// The commands that bring a direction of the part and the beam together, as nearly as travel and increments
    /// allow.
    pub fn commands(&self, up: [f64; 3]) -> TiltAngles {
        let [outer, inner] = self.axes.each_ref().map(|a| a.letter);
        let angles = match self.carries {
            Carries::Part => to_the_lens([outer, inner], up),
            // The part as the head sees it is turned back, by the outer axis first.
            Carries::Head => {
                let [inner, outer] = to_the_lens([inner, outer], up);
                [-outer, -inner]
            }
        };
        TiltAngles([0, 1].map(|k| self.axes[k].command(angles[k])))
    }

    /// What is wrong with the axes.
    pub(super) fn faults(&self) -> Vec<Fault> {
        let mut faults = Vec::new();
        let [outer, inner] = self.axes.each_ref();
        let (leaning, hint) = match self.carries {
            Carries::Part => (outer, "a table that turns about z carries the part itself"),
            Carries::Head => (inner, "an axis that turns about z carries the other one"),
        };
        if outer.letter == inner.letter || leaning.letter == Letter::C {
            let text = match self.carries {
                Carries::Part => "tilt.axes must be A or B, and then another of A, B and C nearer to the part",
                Carries::Head => "tilt.axes must be one of A, B and C, and then another, A or B, nearer to the head",
            };
            faults.push(fault("tilt.axes", text, hint));
        }
        for (i, axis) in self.axes.iter().enumerate() {
            let letter = axis.letter.char();
            if let Some([lo, hi]) = axis.travel.ends().map(|ends| ends.map(Angle::as_deg)) {
                let turns = if axis.letter == Letter::C { TURNS } else { 1.0 };
                if !(lo..=hi).contains(&0.0) || lo < -360.0 * turns || hi > 360.0 * turns {
                    let text = format!(
                        "travel of tilt axis {letter} must hold 0 deg and end within {} deg either way",
                        360.0 * turns
                    );
                    faults.push(fault(&format!("tilt.axes.{i}.travel"), text, "write the lower end first"));
                }
            } else if axis.letter != Letter::C {
                let text = format!("travel of tilt axis {letter} cannot be continuous");
                let hint = "a turntable C can; give the others two angles";
                faults.push(fault(&format!("tilt.axes.{i}.travel"), text, hint));
            }
            if axis.commands == AngleCommands::Modulo && (axis.travel.ends().is_some() || TURN % axis.step() != 0) {
                let text = format!("tilt axis {letter} cannot be commanded modulo a turn");
                let hint = "that takes travel = \"continuous\" and an increment that divides 360 deg";
                faults.push(fault(&format!("tilt.axes.{i}.commands"), text, hint));
            }
            if !(1e-6..=1.0).contains(&axis.increment.as_deg()) {
                let text = format!("increment of tilt axis {} is not between 1e-6 and 1 deg", axis.letter.char());
                faults.push(fault(&format!("tilt.axes.{i}.increment"), text, "0.0001 deg is usual"));
            }
        }
        if self.pivot.iter().any(|p| p.as_nm().is_none()) {
            faults.push(fault("tilt.pivot", "tilt.pivot is beyond 4 m", "check the unit"));
        }
        faults
    }
}

/// A fault of the value of a key of the tilt axes.
fn fault(key: &str, text: impl Into<String>, hint: &str) -> Fault {
    (key.to_owned(), Diag::input("machine-tilt", text).hint(hint))
}

/// The angles of a table's axes, outer and inner, in radians, that turn a direction of the part, of any length, to the
/// lens: to z. The inner axis turns it first, into the plane across the outer axis, in which that one can raise it. The
/// outer axis is A or B (see [`Tilt::faults`]).
fn to_the_lens(axes: [Letter; 2], [x, y, z]: [f64; 3]) -> [f64; 2] {
    let flat = math::hypot(x, y);
    match axes {
        [Letter::A, Letter::B] => [math::atan2(y, math::hypot(x, z)), math::atan2(-x, z)],
        [Letter::B, Letter::A] => [math::atan2(-x, math::hypot(y, z)), math::atan2(y, z)],
        // From here on the inner axis is C, which need not turn what lies along it.
        _ if flat == 0.0 => [0.0; 2],
        // Two angles of C, half a turn apart, bring the direction into that plane: the smaller one is taken. Where both
        // are a quarter turn it is always the same one, whatever the sign of the zero.
        [Letter::A, _] if y == 0.0 => [math::atan2(x, z), std::f64::consts::FRAC_PI_2],
        [Letter::A, _] => [math::atan2(flat * y.signum(), z), math::atan(x / y)],
        // B and C.
        _ if x == 0.0 => [math::atan2(-y, z), -std::f64::consts::FRAC_PI_2],
        _ => [math::atan2(-flat * x.signum(), z), math::atan(-y / x)],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(letters: [Letter; 2], reversed: bool) -> Tilt {
        let axis = |letter| RotaryAxis {
            letter,
            reversed,
            travel: AxisTravel::Ends([Angle::deg(-180.0), Angle::deg(180.0)]),
            commands: AngleCommands::Absolute,
            increment: Angle::deg(1e-6),
            move_time: Time::s(1.0),
            speed: None,
            acceleration: None,
            jerk: None,
        };
        Tilt {
            carries: Carries::Part,
            pivot: [Length::mm(1.0), Length::mm(2.0), Length::mm(-100.0)],
            axes: letters.map(axis),
        }
    }

    #[test]
    fn commands_turn_every_direction_to_the_lens_whatever_the_axes() {
        use Letter::{A, B, C};
        for letters in [[A, B], [B, A], [A, C], [B, C]] {
            for reversed in [false, true] {
                let table = table(letters, reversed);
                for i in 0..400 {
                    let (slope, around) = (f64::from(i % 20) / 10.0, f64::from(i / 20) * 0.314);
                    let n = [slope * math::cos(around), slope * math::sin(around), 1.0];
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
    fn a_head_leans_along_every_direction_and_turns_about_its_pivot() {
        use Letter::{A, B, C};
        for letters in [[A, B], [B, A], [C, A], [C, B]] {
            for reversed in [false, true] {
                let head = Tilt { carries: Carries::Head, ..table(letters, reversed) };
                for i in 0..400 {
                    let (slope, around) = (f64::from(i % 20) / 10.0, f64::from(i / 20) * 0.314);
                    let n = [slope * math::cos(around), slope * math::sin(around), 1.0];
                    let commands = head.commands(n);
                    let turn = head.turn(commands, Origin([7, 8, 9]));
                    let length = (slope * slope + 1.0).sqrt();
                    let off = turn.up().iter().zip(n).map(|(u, n)| (u - n / length).abs()).fold(0.0, f64::max);
                    assert!(off < 1e-7, "{letters:?} {n:?}: {off}");
                    // The table frame's origin stays, and the field's centre keeps its distance from the pivot.
                    let at = turn.apply(P3::new([-7.0, -8.0, -9.0])).at;
                    assert!(at.iter().zip([-7.0, -8.0, -9.0]).all(|(a, b)| (a - b).abs() < 1e-6), "{at:?}");
                    let (pivot, swing) = (head.pivot_nm(), head.swing(commands));
                    let far = |d: [f64; 3]| d.iter().map(|v| v * v).sum::<f64>().sqrt();
                    let away = far([0, 1, 2].map(|k| swing[k] - pivot[k]));
                    assert!((away - far(pivot)).abs() < 1e-3, "{away}");
                }
                assert_eq!(head.commands([0.0, 0.0, 1.0]), TiltAngles::UPRIGHT);
                assert_eq!(head.swing(TiltAngles::UPRIGHT), [0.0; 3]);
            }
        }
    }

    #[test]
    fn a_positive_command_swings_the_field_right_handed_about_the_pivot() {
        let head = Tilt {
            carries: Carries::Head,
            pivot: [0.0, 0.0, 100.0].map(Length::mm),
            ..table([Letter::C, Letter::B], false)
        };
        // The example of the manual.
        let high = Tilt { pivot: [0.0, 0.0, 250.0].map(Length::mm), ..head.clone() };
        let at = high.swing(TiltAngles([0, 10_000_000])).map(|v| v / NM_PER_MM);
        assert!((at[0] + 43.41).abs() < 0.01 && at[1] == 0.0 && (at[2] - 3.80).abs() < 0.01, "{at:?}");
        // About y by 90 deg, from 100 mm below the pivot to 100 mm towards -x of it.
        let at = head.swing(TiltAngles([0, 90_000_000]));
        assert!(at.iter().zip([-1e8, 0.0, 1e8]).all(|(a, b)| (a - b).abs() < 1e-3), "{at:?}");
        let up = head.turn(TiltAngles([0, 90_000_000]), Origin::default()).up();
        assert!(up.iter().zip([1.0, 0.0, 0.0]).all(|(a, b)| (a - b).abs() < 1e-12), "{up:?}");
    }

    #[test]
    fn commands_stay_within_travel_and_on_increments() {
        let mut table = table([Letter::A, Letter::B], false);
        table.axes[0].travel = AxisTravel::Ends([Angle::deg(-2.0), Angle::deg(3.0)]);
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
        for letters in [[A, A], [A, C], [B, C], [C, C]] {
            let head = Tilt { carries: Carries::Head, ..table(letters, false) };
            assert_eq!(head.faults().len(), 1, "{letters:?}");
        }
        let mut t = table([A, B], false);
        t.axes[1].travel = AxisTravel::Ends([Angle::deg(1.0), Angle::deg(5.0)]);
        assert_eq!(t.faults().len(), 1);
    }

    #[test]
    fn a_turntable_may_have_no_ends_and_take_angles_modulo_a_turn() {
        let mut table = table([Letter::A, Letter::C], false);
        table.axes[1].travel = AxisTravel::CONTINUOUS;
        assert!(table.faults().is_empty());
        let leans = |table: &Tilt| table.commands([-0.1, -0.001, 1.0])[1];
        let absolute = leans(&table);
        assert!(table.axes[1].takes(absolute) && table.axes[1].takes(-900 * 1_000_000));
        table.axes[1].commands = AngleCommands::Modulo;
        assert!(table.faults().is_empty());
        assert_eq!(leans(&table), absolute.rem_euclid(TURN));
        assert_eq!(table.axes[1].written(-10), TURN - 10);
        assert!(!table.axes[1].takes(-10) && !table.axes[1].takes(TURN) && table.axes[1].takes(TURN - 10));
        // Increments that do not divide a turn, a swivel without ends, ends and modulo.
        table.axes[1].increment = Angle::deg(0.7);
        assert_eq!(table.faults().len(), 1);
        table.axes[1].increment = Angle::deg(1e-4);
        table.axes[0].travel = AxisTravel::CONTINUOUS;
        assert_eq!(table.faults().len(), 1);
        table.axes.iter_mut().for_each(|axis| axis.travel = AxisTravel::Ends([Angle::deg(-5.0), Angle::deg(5.0)]));
        assert_eq!(table.faults().len(), 1);
        // A turntable with ends may turn more than once.
        table.axes[1].commands = AngleCommands::Absolute;
        table.axes[1].travel = AxisTravel::Ends([Angle::deg(-720.0), Angle::deg(720.0)]);
        assert!(table.faults().is_empty());
        table.axes.swap(0, 1);
        table.axes[0].letter = Letter::B;
        assert_eq!(table.faults().len(), 1);
    }
}
