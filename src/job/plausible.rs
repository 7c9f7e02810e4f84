//! Values of a job that the machine's optics make implausible: most often a slip of units.
//!
//! Such a job compiles and verifies, since every mark lies where the job asks; the part would be spoilt all the same.
//! So it is refused unless `limits.implausible = "allow"`, which gives a warning instead.

use super::file::Implausible;
use super::resolved::Job;
use crate::diag::{Diag, Error};
use crate::geom::NM_PER_MM;
use crate::machine::Machine;

/// Largest depth range of a block, in depths of focus of the optics (2 z_R). Marks lie up to half of it from their
/// focal plane: at 2 z_R from it the spot is sqrt(1 + 2^2) = 2.2 times as wide, and its fluence a fifth.
const MOST_DEPTHS: f64 = 2.0;

/// Smallest depth range of a block, in depths of focus of the optics. Below it the unit is most likely wrong: um in
/// place of mm.
const LEAST_DEPTHS: f64 = 1e-3;

/// Least pitch of a hatch, in spots. Lines that overlap to more than three quarters mark every place more than four
/// times.
const LEAST_PITCH: f64 = 0.25;

/// The hint where a job is refused.
const ALLOW: &str = "check its unit; set limits.implausible = \"allow\" to accept it";

impl Job {
    /// Holds depth of focus and hatch pitch to the machine's optics; answers with warnings where the job allows
    /// what they make implausible.
    ///
    /// # Errors
    /// `pdof-large`, `pdof-small`, `pitch-small`.
    pub fn plausible(&self, machine: &Machine) -> Result<Vec<Diag>, Error> {
        let found: Vec<Diag> = self.depth(machine).into_iter().chain(self.dense(machine)).collect();
        match self.limits.implausible {
            Implausible::Refuse if !found.is_empty() => Err(Error::many(found)),
            _ => Ok(found),
        }
    }

    /// A depth range that is far beyond the depth of focus of the optics, or far below it.
    fn depth(&self, machine: &Machine) -> Option<Diag> {
        let (depth, optics) = (self.focus.depth.mm(), machine.depth_of_focus_mm());
        let depths = depth / optics;
        if (LEAST_DEPTHS..=MOST_DEPTHS).contains(&depths) {
            return None;
        }
        let is_large = depths > MOST_DEPTHS;
        let digits = if is_large { 1 } else { 6 };
        let text = format!(
            "blocks {depth} mm deep are {depths:.digits$} times the depth of focus of the optics (2 z_R = {optics:.3} mm \
             for a spot of {}, {:.0} nm and M2 = {})",
            machine.lens.spot,
            machine.laser.wavelength.as_mm() * 1e6,
            machine.laser.m2
        );
        let d = match (self.limits.implausible, is_large) {
            (Implausible::Refuse, true) => Diag::limit("pdof-large", text).hint(ALLOW),
            (Implausible::Refuse, false) => Diag::limit("pdof-small", text).hint(ALLOW),
            (Implausible::Allow, true) => Diag::warning("pdof-large", text),
            (Implausible::Allow, false) => Diag::warning("pdof-small", text),
        };
        Some(d.at(self.place_of("focus.pdof")))
    }

    /// Hatches whose lines lie far within each other's spots.
    fn dense(&self, machine: &Machine) -> impl Iterator<Item = Diag> {
        let spot = machine.lens.spot.as_mm();
        self.textures.iter().enumerate().filter_map(move |(i, texture)| {
            let (pitch_mm, key) = texture.kind.line_pitch_mm()?;
            let nm = |mm: f64| (mm * NM_PER_MM).round();
            if nm(pitch_mm) >= nm(LEAST_PITCH * spot) {
                return None;
            }
            let times = (spot / pitch_mm).round();
            let text = format!("lines {pitch_mm} mm apart under a spot of {spot} mm mark every place {times} times");
            let d = match self.limits.implausible {
                Implausible::Refuse => Diag::limit("pitch-small", text).hint(ALLOW),
                Implausible::Allow => Diag::warning("pitch-small", text),
            };
            Some(d.at(self.place_of(&format!("texture.{i}.{key}"))))
        })
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::diag::Kind;
    use crate::job::{Overrides, SAMPLE_JOB};

    /// Codes, kinds and places of what the sample job comes to with texts replaced.
    fn found(changes: &[(&str, &str)]) -> Vec<(&'static str, Kind, String)> {
        let mut text = SAMPLE_JOB.to_owned();
        for (from, to) in changes {
            assert!(text.contains(from), "{from}");
            text = text.replacen(from, to, 1);
        }
        let job = Job::parse(Path::new("job.toml"), &text, &Overrides::default()).unwrap_or_else(|e| panic!("{e}"));
        let machine = Machine::built_in("xyz-galvo-40").expect("a profile");
        let diags = job.plausible(&machine).unwrap_or_else(|e| e.diags().to_vec());
        diags.into_iter().map(|d| (d.code, d.kind, d.place.to_string())).collect()
    }

    const PDOF: &str = "pdof = \"0.07 mm\"";
    const PITCH: &str = "pitch = \"0.5 mm\"";
    const ALLOWED: (&str, &str) = ("[limits]", "[limits]\nimplausible = \"allow\"");

    /// The place of a key's value in the sample job.
    fn place(key: &str) -> String {
        let line = SAMPLE_JOB.lines().position(|l| l.starts_with(key)).expect("a key") + 1;
        format!("job.toml:{line}:{}", key.len() + 4)
    }

    #[test]
    fn depth_of_focus_is_twice_the_rayleigh_length() {
        let mut machine = Machine::built_in("xyz-galvo-40").expect("a profile");
        assert!((machine.depth_of_focus_mm() - 1.769_911).abs() < 1e-6, "{}", machine.depth_of_focus_mm());
        machine.laser.m2 = 2.0;
        assert!((machine.depth_of_focus_mm() - 0.884_956).abs() < 1e-6);
    }

    #[test]
    fn pdof_beyond_twice_the_depth_of_focus_is_refused_at_its_key() {
        assert_eq!(found(&[]), []);
        assert_eq!(found(&[(PDOF, "pdof = \"3.5 mm\"")]), []);
        let refused = [("pdof-large", Kind::Limit, place("pdof"))];
        assert_eq!(found(&[(PDOF, "pdof = \"3.6 mm\"")]), refused);
        assert_eq!(found(&[(PDOF, "pdof = \"70 mm\"")]), refused);
        // Under this rule a block is twice as deep.
        let half = ("rule = \"range\"", "rule = \"half\"");
        assert_eq!(found(&[(PDOF, "pdof = \"1.7 mm\""), half]), []);
        assert_eq!(found(&[(PDOF, "pdof = \"1.8 mm\""), half]), refused);
    }

    #[test]
    fn pdof_below_a_thousandth_of_the_depth_of_focus_is_refused_at_its_key() {
        assert_eq!(found(&[(PDOF, "pdof = \"1.8 um\"")]), []);
        let refused = [("pdof-small", Kind::Limit, place("pdof"))];
        assert_eq!(found(&[(PDOF, "pdof = \"1.7 um\"")]), refused);
        let allowed = found(&[(PDOF, "pdof = \"0.5 um\""), ALLOWED]);
        assert!(matches!(allowed[..], [("pdof-small", Kind::Warning, _)]), "{allowed:?}");
    }

    #[test]
    fn a_pitch_below_a_quarter_of_the_spot_is_refused_at_its_key() {
        assert_eq!(found(&[(PITCH, "pitch = \"5 um\"")]), []);
        let refused = [("pitch-small", Kind::Limit, place("pitch"))];
        assert_eq!(found(&[(PITCH, "pitch = \"4.9 um\"")]), refused);
        let contour = ("direction = \"0 deg\"", "direction = \"contour\"");
        assert_eq!(found(&[(PITCH, "pitch = \"0.1 um\""), contour]), refused);
    }

    #[test]
    fn allowed_implausible_values_give_a_warning() {
        let both = [(PDOF, "pdof = \"70 mm\""), (PITCH, "pitch = \"1 um\""), ALLOWED];
        let codes: Vec<_> = found(&both).into_iter().map(|(code, kind, _)| (code, kind)).collect();
        assert_eq!(codes, [("pdof-large", Kind::Warning), ("pitch-small", Kind::Warning)]);
        assert_eq!(found(&[ALLOWED]), []);
    }
}
