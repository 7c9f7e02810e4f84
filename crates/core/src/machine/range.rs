//! The ranges of a machine's numbers: wide enough for any machine that is built, narrow enough that no time, count or
//! memory that follows from them runs away. `docs/reference/machine-file.md` states every one. Those of the field, the
//! travel and the increments have codes of their own.

use super::{Fault, Machine, OverField, ToolServo};
use crate::diag::Diag;
use crate::units::Quantity;

/// What a number of the machine file must keep to.
struct Range {
    key: String,
    /// Lowest and highest value.
    ends: [&'static str; 2],
    is_kept: bool,
}

/// The numbers that lie outside of their range.
pub(super) fn faults(machine: &Machine) -> impl Iterator<Item = Fault> {
    ranges(machine).into_iter().filter(|range| !range.is_kept).map(|Range { key, ends: [lo, hi], .. }| {
        let text = format!("{key} is not between {lo} and {hi}");
        (key, Diag::input("machine-range", text).hint("no such machine is known: check the number and its unit"))
    })
}

fn ranges(m: &Machine) -> Vec<Range> {
    let mut out = Vec::new();
    hold(&mut out, "lens.margin", Some(m.lens.margin), ["0 mm", "0.5 m"]);
    hold(&mut out, "lens.working_distance", Some(m.lens.working_distance), ["0.1 mm", "10 m"]);
    hold(&mut out, "lens.diameter", Some(m.lens.diameter), ["0.1 mm", "2 m"]);
    hold(&mut out, "lens.spot", Some(m.lens.spot), ["0.1 um", "10 mm"]);
    over_field(&mut out, "lens.telecentricity", m.lens.telecentricity.as_ref(), ["0 deg", "30 deg"]);
    over_field(&mut out, "lens.field_residual", m.lens.field_residual.as_ref(), ["0 mm", "10 mm"]);
    hold(&mut out, "scanner.jump_speed", Some(m.scanner.jump_speed), ["0.1 mm/s", "1000 m/s"]);
    hold(&mut out, "scanner.max_mark_speed", Some(m.scanner.max_mark_speed), ["0.1 mm/s", "1000 m/s"]);
    hold(&mut out, "scanner.acceleration", m.scanner.acceleration, ["1 mm/s2", "1e9 mm/s2"]);
    hold(&mut out, "scanner.jerk", m.scanner.jerk, ["1 mm/s3", "1e15 mm/s3"]);
    hold(&mut out, "scanner.accumulated_error", m.scanner.accumulated_error, ["1e-6 mm s", "1000 mm s"]);
    for (name, servo) in [("scanner", m.scanner.servo), ("stage", m.stage.servo)] {
        hold(&mut out, format!("{name}.servo.frequency"), servo.map(|s| s.frequency), ["0.1 Hz", "1 MHz"]);
    }
    for settle in m.stage.settle.by_axis() {
        hold(&mut out, "stage.settle", Some(settle), ["0 s", "60 min"]);
    }
    hold(&mut out, "stage.clearance", Some(m.stage.clearance), ["1 um", "1 m"]);
    hold(&mut out, "stage.accuracy", m.stage.accuracy, ["1 nm", "10 mm"]);
    hold(&mut out, "stage.z_accuracy", m.stage.z_accuracy, ["1 nm", "10 mm"]);
    hold(&mut out, "stage.move.xy", m.stage.move_times.map(|t| t.xy), ["0 s", "60 min"]);
    hold(&mut out, "stage.move.z", m.stage.move_times.map(|t| t.z), ["0 s", "60 min"]);
    for (name, axis) in m.axes() {
        hold(&mut out, format!("stage.{name}.speed"), Some(axis.speed), ["0.001 mm/s", "100 m/s"]);
        hold(&mut out, format!("stage.{name}.acceleration"), Some(axis.acceleration), ["0.01 mm/s2", "1e7 mm/s2"]);
        hold(&mut out, format!("stage.{name}.jerk"), axis.jerk, ["0.1 mm/s3", "1e12 mm/s3"]);
    }
    hold(&mut out, "laser.max_power", Some(m.laser.max_power), ["1 mW", "1000 kW"]);
    hold(&mut out, "laser.wavelength", Some(m.laser.wavelength), ["10 nm", "1 mm"]);
    hold(&mut out, "delays.laser_on", Some(m.delays.laser_on), ["-1 s", "1 s"]);
    hold(&mut out, "delays.laser_off", Some(m.delays.laser_off), ["-1 s", "1 s"]);
    hold(&mut out, "delays.jump", Some(m.delays.jump), ["0 s", "1 s"]);
    hold(&mut out, "delays.mark", Some(m.delays.mark), ["0 s", "1 s"]);
    hold(&mut out, "delays.polygon", Some(m.delays.polygon), ["0 s", "1 s"]);
    hold(&mut out, "operator.load", m.operator.load, ["0 s", "60 min"]);
    hold(&mut out, "controller.servo_period", m.controller.servo_period, ["1 us", "0.1 s"]);
    let zoom = m.zoom.as_ref();
    hold(&mut out, "zoom.range", zoom.map(|z| z.range), ["1 um", "1 m"]);
    hold(&mut out, "zoom.speed", zoom.map(|z| z.speed), ["0.001 mm/s", "100 m/s"]);
    hold(&mut out, "zoom.settle", zoom.map(|z| z.settle), ["0 s", "60 min"]);
    hold(&mut out, "zoom.accuracy", zoom.and_then(|z| z.accuracy), ["1 nm", "10 mm"]);
    tool_servo(&mut out, m.tool_servo.as_ref());
    for i in 0..2 {
        let axis = m.tilt.as_ref().map(|t| &t.axes[i]);
        let key = |name: &str| format!("tilt.axes.{i}.{name}");
        hold(&mut out, key("move_time"), axis.map(|a| a.move_time), ["0 s", "60 min"]);
        hold(&mut out, key("speed"), axis.and_then(|a| a.speed), ["0.001 deg/s", "1e5 deg/s"]);
        hold(&mut out, key("acceleration"), axis.and_then(|a| a.acceleration), ["0.01 deg/s2", "1e8 deg/s2"]);
        hold(&mut out, key("jerk"), axis.and_then(|a| a.jerk), ["0.1 deg/s3", "1e13 deg/s3"]);
    }
    out
}

fn tool_servo(out: &mut Vec<Range>, tool: Option<&ToolServo>) {
    hold(out, "tool_servo.spindle", tool.map(|t| t.spindle), ["1 1/min", "1e5 1/min"]);
    hold(out, "tool_servo.feed", tool.map(|t| t.feed), ["0.001 mm/min", "10 m/min"]);
    hold(out, "tool_servo.cycle", tool.map(|t| t.cycle), ["1 us", "100 ms"]);
    hold(out, "tool_servo.stroke", tool.map(|t| t.stroke), ["1 um", "1 m"]);
    hold(out, "tool_servo.speed", tool.and_then(|t| t.speed), ["0.001 mm/s", "100 m/s"]);
    hold(out, "tool_servo.acceleration", tool.and_then(|t| t.acceleration), ["0.01 mm/s2", "1e8 mm/s2"]);
    hold(out, "tool_servo.jerk", tool.and_then(|t| t.jerk), ["0.1 mm/s3", "1e12 mm/s3"]);
    let drive = tool.and_then(|t| t.drive);
    hold(out, "tool_servo.drive.voltage", drive.map(|d| d.voltage), ["0.1 V", "10 kV"]);
    hold(out, "tool_servo.drive.inductance", drive.map(|d| d.inductance), ["1 uH", "10 H"]);
    hold(out, "tool_servo.drive.force_constant", drive.map(|d| d.force_constant), ["0.01 N/A", "10000 N/A"]);
    hold(out, "tool_servo.drive.mass", drive.map(|d| d.mass), ["1 g", "1000 kg"]);
    let servo = tool.and_then(|t| t.servo);
    hold(out, "tool_servo.servo.frequency", servo.map(|s| s.frequency), ["0.1 Hz", "1 MHz"]);
    let oscillations = tool.map_or(&[][..], |t| &t.oscillations);
    // Without any oscillation the ranges are still there, for the document.
    for oscillation in oscillations.iter().map(Some).chain([None]) {
        hold(out, "tool_servo.oscillations.stroke", oscillation.map(|o| o.stroke), ["1 nm", "1 m"]);
        hold(out, "tool_servo.oscillations.frequency", oscillation.map(|o| o.frequency), ["0.01 Hz", "1 MHz"]);
    }
}

/// Appends the range of a key for each of its values over the field; of none, so that it is in the document.
fn over_field<Q: Quantity>(out: &mut Vec<Range>, key: &str, value: Option<&OverField<Q>>, ends: [&'static str; 2]) {
    let values = value.map(OverField::values).unwrap_or_default();
    for value in values.into_iter().map(Some).chain([None]) {
        hold(out, key, value, ends);
    }
}

/// Appends the range of a key; a value that is not stated lies in it.
fn hold<Q: Quantity>(out: &mut Vec<Range>, key: impl Into<String>, value: Option<Q>, ends: [&'static str; 2]) {
    let [lo, hi] = ends.map(|end| end.parse::<Q>().expect("an end has its unit").base());
    let is_kept = value.is_none_or(|v| (lo..=hi).contains(&v.base()));
    out.push(Range { key: key.into(), ends, is_kept });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::PROFILES;

    #[test]
    fn the_document_states_every_range() {
        let text = include_str!("../../../../docs/reference/machine-file.md");
        let machine = Machine::built_in("xyz-galvo-40").expect("profile");
        let mut rows = std::collections::BTreeSet::new();
        for Range { key, ends: [lo, hi], .. } in ranges(&machine) {
            // One row stands for all three axes, and one for both tilt axes.
            let key = key.replace(".0", "").replace(".1", "");
            let key = if key.starts_with("stage.y.") || key.starts_with("stage.z.") { continue } else { key };
            assert!(text.contains(&format!("| `{key}` | {lo} | {hi} |\n")), "{key} {lo} {hi}");
            rows.insert(key);
        }
        assert_eq!(rows.len(), 53);
    }

    #[test]
    fn range_ends_are_accepted_and_values_beyond_are_refused_with_their_place() {
        let (_, text) = PROFILES[0];
        let edited = |speed: &str| Machine::parse("m.toml", &text.replacen("\"200 mm/s\"", &format!("{speed:?}"), 1));
        for speed in ["0.001 mm/s", "100 m/s"] {
            assert!(edited(speed).is_ok(), "{speed}");
        }
        for speed in ["0.00099 mm/s", "100.1 m/s", "1e300 m/s"] {
            let e = edited(speed).expect_err("out of range");
            let [d] = e.diags() else { panic!("{e}") };
            let line = 1 + text.lines().position(|l| l.starts_with("speed")).expect("a speed");
            assert_eq!(d.code, "machine-range");
            assert!(d.place.to_string().starts_with(&format!("m.toml:{line}:")), "{e}");
        }
    }
}
