//! A unit that the text of a file names.
//!
//! STL, OBJ, PLY and points have no field for a unit, but programs write one into headers, comments and names of
//! columns. The unit of the job counts; where the two contradict each other, a warning says so, once for a file.

use super::facets::Unit;
use super::lines::shown;
use terrace_core::diag::{Diag, Place};

/// Names of units, the one of job files first where they have it, and mm.
const UNITS: &[(&[&str], f64)] = &[
    (&["mm", "millimeter", "millimeters", "millimetre", "millimetres"], 1.0),
    (&["cm", "centimeter", "centimeters", "centimetre", "centimetres"], 10.0),
    (&["m", "meter", "meters", "metre", "metres"], 1000.0),
    (&["in", "inch", "inches"], 25.4),
    (&["um", "µm", "μm", "micron", "microns", "micrometer", "micrometers", "micrometre", "micrometres"], 1e-3),
    (&["nm", "nanometer", "nanometers", "nanometre", "nanometres"], 1e-6),
    (&["ft", "foot", "feet"], 304.8),
    (&["km", "kilometer", "kilometers", "kilometre", "kilometres"], 1e6),
    (&["mil", "mils", "thou"], 0.0254),
];

/// Units of `[surface]`.
const IN_JOBS: usize = 5;

/// The number of mm in a unit of this name.
pub(super) fn unit_mm(name: &str) -> Option<f64> {
    found(name).map(|(_, mm)| *mm)
}

fn found(name: &str) -> Option<&'static (&'static [&'static str], f64)> {
    let name = name.to_lowercase();
    UNITS.iter().find(|(names, _)| names.contains(&name.as_str()))
}

/// Looks for a unit in the text of a file.
pub(super) struct StatedUnit {
    unit: Unit,
    is_found: bool,
    /// The warning.
    pub note: Option<Diag>,
}

impl StatedUnit {
    /// Nothing found yet; `unit` is that of the job.
    pub(super) fn new(unit: Unit) -> Self {
        Self { unit, is_found: false, note: None }
    }

    /// Looks at a text such as "File units = centimeters"; the first that names a unit counts.
    pub(super) fn look(&mut self, text: &[u8], place: impl FnOnce() -> Place) {
        if self.is_found || !has_word_unit(text) {
            return;
        }
        if let Some(mm) = named(&String::from_utf8_lossy(text)) {
            self.is(mm, text, place());
        }
    }

    /// The file says in `text` that its unit is so many mm.
    pub(super) fn is(&mut self, mm: f64, text: &[u8], place: Place) {
        if std::mem::replace(&mut self.is_found, true) {
            return;
        }
        let taken = self.unit.file_mm();
        if (mm - taken).abs() <= 1e-6 * mm {
            return;
        }
        // Headers of binary files continue in zeros.
        let printable = text.split(u8::is_ascii_control).next().unwrap_or_default();
        let said = shown(printable.trim_ascii());
        let text = format!("the file says \"{said}\", {mm} mm, but one unit of it is taken as {taken} mm");
        let hint = match UNITS[..IN_JOBS].iter().find(|(_, of)| *of == mm) {
            Some((names, _)) => format!("set unit = \"{}\" in [surface], unless the file is wrong", names[0]),
            None => "check unit in [surface]: one of the two is wrong".to_owned(),
        };
        self.note = Some(Diag::warning("surface-unit-named", text).at(place).hint(hint));
    }
}

/// Whether a text may name a unit; most do not.
fn has_word_unit(text: &[u8]) -> bool {
    text.windows(4).any(|w| w.eq_ignore_ascii_case(b"unit"))
}

/// mm in the unit that follows the word "unit" or "units".
fn named(text: &str) -> Option<f64> {
    let mut words = text.split(|c: char| !c.is_alphanumeric()).filter(|w| !w.is_empty());
    words.find(|w| w.eq_ignore_ascii_case("unit") || w.eq_ignore_ascii_case("units"))?;
    let mut words =
        words.skip_while(|w| ["are", "is", "of", "length", "1"].iter().any(|filler| w.eq_ignore_ascii_case(filler)));
    let first = words.next()?;
    // "units in mm", but "units = in".
    let after = words.next().filter(|_| first.eq_ignore_ascii_case("in")).and_then(unit_mm);
    after.or_else(|| unit_mm(first))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_found_in_the_words_of_programs() {
        for (text, mm) in [
            ("# File units = centimeters", Some(10.0)),
            ("UNITS=in COLOR=\u{1}\u{2}", Some(25.4)),
            ("comment unit: 1 mm", Some(1.0)),
            ("units in mm", Some(1.0)),
            ("Units are Metres", Some(1000.0)),
            ("obj_info units µm", Some(1e-3)),
            ("# 1 unit = 10 mm", None),
            ("solid unit_7", None),
            ("# a reunited part in m", None),
            ("units", None),
        ] {
            assert_eq!(named(text), mm, "{text}");
        }
    }

    #[test]
    fn only_the_first_contradiction_is_reported() {
        let mut stated = StatedUnit::new(Unit::mm(1.0));
        stated.look(b"# units: mm", || Place::Nowhere);
        stated.look(b"# units: cm", || Place::Nowhere);
        assert!(stated.note.is_none());
        let mut stated = StatedUnit::new(Unit { mm: 0.254, scale: 0.01, ..Unit::mm(1.0) });
        stated.look(b"# units: in", || Place::Nowhere);
        assert!(stated.note.is_none(), "a scale changes no unit");
        let mut stated = StatedUnit::new(Unit::mm(1.0));
        stated.look(b"units feet", || Place::Nowhere);
        assert_eq!(
            stated.note.expect("a note").message,
            "the file says \"units feet\", 304.8 mm, but one unit of it is taken as 1 mm"
        );
    }
}
