//! A fast tool servo: a short-stroke axis along z that carries a turning tool, on a spindle that turns the part.

use serde::{Deserialize, Serialize};

use super::{Fault, Servo};
use crate::diag::Diag;
use crate::units::{
    Acceleration, AngularSpeed, ForceConstant, Frequency, Inductance, Jerk, Length, Mass, Speed, Time, Voltage,
    positive, positive_option,
};

/// A fast tool servo, and how a face is turned with it.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ToolServo {
    /// Speed of the spindle; also in rpm, deg/s, rad/s.
    #[schemars(extend("x-value" = "angular speed, such as \"200 1/min\""))]
    #[serde(deserialize_with = "positive")]
    pub spindle: AngularSpeed,
    /// Feed of the tool towards the axis of the spindle.
    #[serde(deserialize_with = "positive")]
    pub feed: Speed,
    /// Control cycle, with a set-point in each.
    #[serde(deserialize_with = "positive")]
    pub cycle: Time,
    /// Full stroke along z.
    #[serde(deserialize_with = "positive")]
    pub stroke: Length,
    /// Top speed along z, where something besides the jerk limits it.
    #[schemars(extend("x-default" = "not limited"))]
    #[serde(default, deserialize_with = "positive_option")]
    pub speed: Option<Speed>,
    /// Top acceleration, likewise.
    #[schemars(extend("x-default" = "not limited"))]
    #[serde(default, deserialize_with = "positive_option")]
    pub acceleration: Option<Acceleration>,
    /// Top jerk; give either this or `[tool_servo.drive]`.
    #[schemars(extend("x-default" = "by the drive"))]
    #[serde(default, deserialize_with = "positive_option")]
    pub jerk: Option<Jerk>,
    /// The linear motor whose voltage limits the jerk.
    #[serde(default)]
    pub drive: Option<Drive>,
    /// How the tool follows its command, as a damped oscillator; without it no following error is computed.
    #[schemars(extend("x-value" = "{ frequency = \"1000 Hz\", damping = 0.7 }"))]
    #[serde(default)]
    pub servo: Option<Servo>,
    /// Oscillations that the drive is said to make, to be checked against its jerk.
    #[serde(default)]
    pub oscillations: Vec<Oscillation>,
}

/// A linear motor.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Drive {
    /// U, the voltage that is left to change the current.
    #[schemars(extend("x-value" = "voltage (mV, V, kV)"))]
    #[serde(deserialize_with = "positive")]
    pub voltage: Voltage,
    /// L of the winding: its time constant times its resistance.
    #[schemars(extend("x-value" = "inductance (uH, mH, H)"))]
    #[serde(deserialize_with = "positive")]
    pub inductance: Inductance,
    /// KT.
    #[schemars(extend("x-value" = "force constant (N/A)"))]
    #[serde(deserialize_with = "positive")]
    pub force_constant: ForceConstant,
    /// M, the moving mass.
    #[schemars(extend("x-value" = "mass (g, kg)"))]
    #[serde(deserialize_with = "positive")]
    pub mass: Mass,
}

/// A sinusoidal motion.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Oscillation {
    /// From end to end.
    #[serde(deserialize_with = "positive")]
    pub stroke: Length,
    /// How often to and fro.
    #[serde(deserialize_with = "positive")]
    pub frequency: Frequency,
}

impl Oscillation {
    /// The largest jerk, mm/s³: half the stroke times the cube of the angular frequency.
    pub fn jerk_mm_s3(&self) -> f64 {
        self.stroke.as_mm() / 2.0 * (std::f64::consts::TAU * self.frequency.as_khz() * 1000.0).powi(3)
    }
}

impl Drive {
    /// Jerk that the motor makes, mm/s³: the voltage changes the current by U / L a second, each ampere is a force of
    /// kT, j = U / L * kT / m (Brecher et al.). Back EMF and resistance are left out.
    pub fn jerk_mm_s3(&self) -> f64 {
        let newtons_per_s = self.voltage.as_v() / self.inductance.as_h() * self.force_constant.as_n_a();
        1000.0 * newtons_per_s / self.mass.as_kg()
    }
}

impl ToolServo {
    /// Top jerk, mm/s³, as stated or by the drive.
    pub fn jerk_mm_s3(&self) -> f64 {
        let stated = self.jerk.map(Jerk::as_mm_s3);
        stated.or(self.drive.map(|drive| drive.jerk_mm_s3())).expect("a file with neither is refused when it is read")
    }

    pub(super) fn faults(&self) -> Vec<Fault> {
        if self.jerk.is_some() != self.drive.is_some() {
            return Vec::new();
        }
        let text = "tool_servo states its jerk twice or not at all";
        let hint = "give either jerk or [tool_servo.drive]";
        vec![("tool_servo".to_owned(), Diag::input("machine-tool-servo", text).hint(hint))]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::rest_to_rest;

    /// The drive of Brecher et al.: a winding of 2.7 ohm and 5.2 ms, 60 N/A, 1.6 kg.
    fn drive(volts: &str) -> Drive {
        let text = format!(
            r#"{{"voltage": "{volts} V", "inductance": "14.04 mH", "force_constant": "60 N/A", "mass": "1.6 kg"}}"#
        );
        serde_json::from_str(&text).expect("a drive")
    }

    #[test]
    fn drive_figures_are_those_of_the_article() {
        // Volts, jerk in m/s3; time in ms and top speed in m/s of a stroke of 8 mm: computed from the printed numbers,
        // and as printed.
        for (volts, jerk, time, speed, printed) in
            [("50", 133_547.0, 12.41, 1.289, [12.0, 1.29]), ("200", 534_188.0, 7.82, 2.047, [7.8, 2.0])]
        {
            let j = drive(volts).jerk_mm_s3();
            assert!((j / 1000.0 / jerk - 1.0).abs() < 1e-5, "{j}");
            let t = rest_to_rest(8.0, 1e9, 1e12, Some(j));
            let v = j * t * t / 16.0;
            assert!((1000.0 * t / time - 1.0).abs() < 2e-3 && (v / 1000.0 / speed - 1.0).abs() < 2e-3, "{t} {v}");
            assert!((1000.0 * t / printed[0] - 1.0).abs() < 0.04 && (v / 1000.0 / printed[1] - 1.0).abs() < 0.04);
        }
    }

    #[test]
    fn an_oscillation_of_300_um_at_300_hz_is_beyond_the_drive() {
        let of = |stroke: &str, hz: f64| {
            let text = format!(r#"{{"stroke": "{stroke}", "frequency": "{hz} Hz"}}"#);
            serde_json::from_str::<Oscillation>(&text).expect("an oscillation").jerk_mm_s3()
        };
        let ratios = [("50", "4 mm", 64.0, 0.97), ("200", "2 mm", 130.0, 1.02), ("200", "300 um", 300.0, 1.88)];
        for (volts, stroke, hz, ratio) in ratios {
            let found = of(stroke, hz) / drive(volts).jerk_mm_s3();
            assert!((found - ratio).abs() < 0.01, "{volts} V, {stroke} at {hz} Hz: {found}");
        }
    }
}
