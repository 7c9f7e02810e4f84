//! Keys of a machine file that have no effect because another one is missing or overrides them.

use super::{Fault, FieldShape, Machine};
use crate::diag::Diag;

impl Machine {
    /// A warning for every key that has no effect, with its path in the machine file.
    pub fn unused(&self) -> Vec<Fault> {
        let mut out = Vec::new();
        let mut report =
            |key: String, text: String, hint: &str| out.push((key, Diag::warning("key-unused", text).hint(hint)));
        if self.scanner.jerk.is_some() && self.scanner.acceleration.is_none() {
            let text =
                "scanner.jerk has no effect: without scanner.acceleration the scanner is taken to be always at speed";
            report("scanner.jerk".into(), text.into(), "state scanner.acceleration too, or leave it out");
        }
        let [x, y] = self.lens.field;
        if self.lens.shape == FieldShape::Circle && x != y {
            let side = if x > y { "first" } else { "second" };
            let text = format!(
                "the {side} size of lens.field has no effect: it is the larger one, and a circle takes the smaller as its \
                 diameter"
            );
            report("lens.field".into(), text, "state the diameter twice, or shape = \"rectangle\"");
        }
        for (i, axis) in self.tilt.iter().flat_map(|tilt| tilt.axes.iter().enumerate()) {
            let given = [
                ("speed", axis.speed.is_some()),
                ("acceleration", axis.acceleration.is_some()),
                ("jerk", axis.jerk.is_some()),
            ];
            let is_whole = given[0].1 && given[1].1;
            if let Some((key, _)) = given.iter().find(|(_, is_given)| *is_given && !is_whole) {
                let key = format!("tilt.axes.{i}.{key}");
                let text = format!(
                    "{key} has no effect: the axis does not state both speed and acceleration, so nothing is marked \
                     while it turns"
                );
                report(
                    key,
                    text,
                    "state speed and acceleration of both axes, or leave out speed, acceleration and jerk",
                );
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::PROFILES;
    use crate::units::Length;

    #[test]
    fn built_in_machines_have_no_unused_keys() {
        for (name, _) in PROFILES {
            assert_eq!(Machine::built_in(name).expect("a profile").unused(), [], "{name}");
        }
    }

    #[test]
    fn keys_that_need_another_one_are_reported() {
        let codes = |name: &str, change: &dyn Fn(&mut Machine)| {
            let mut machine = Machine::built_in(name).expect("a profile");
            change(&mut machine);
            machine.unused().into_iter().map(|(key, d)| format!("{key} {}", d.code)).collect::<Vec<_>>()
        };
        let jerk = |m: &mut Machine| (m.scanner.acceleration, m.scanner.jerk) = (None, "1000 m/s3".parse().ok());
        assert_eq!(codes("xyz-galvo-40", &jerk), ["scanner.jerk key-unused"]);
        let round = |m: &mut Machine| (m.lens.shape, m.lens.field[1]) = (FieldShape::Circle, Length::mm(60.0));
        assert_eq!(codes("xyz-galvo-40", &round), ["lens.field key-unused"]);
        let half = |m: &mut Machine| m.tilt.as_mut().expect("axes").axes[1].acceleration = None;
        assert_eq!(codes("xyzac-galvo-10", &half), ["tilt.axes.1.speed key-unused"]);
    }
}
