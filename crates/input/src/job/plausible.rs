//! Values of a job that the machine's optics make implausible: most often a slip of units.
//!
//! Such a job compiles and verifies, since every mark lies where the job asks; the part would be spoilt all the same.
//! So it is refused unless `limits.implausible = "allow"`, which gives a warning instead. What is odd and may be meant
//! (a depth range below [`ODD_DEPTHS`], lines of areas far apart) is a warning from the start.

use super::file::Implausible;
use super::resolved::Job;
use terrace_core::diag::{Diag, Error, Kind};
use terrace_core::geom::NM_PER_MM;
use terrace_core::machine::Machine;

/// Largest depth range of a block, in depths of focus of the optics (2 z_R). Marks lie up to half of it from their
/// focal plane: at 2 z_R from it the spot is sqrt(1 + 2^2) = 2.2 times as wide, and its fluence a fifth.
const MOST_DEPTHS: f64 = 2.0;

/// Smallest depth range of a block, in depths of focus of the optics. Below it the unit is most likely wrong: um in
/// place of mm.
const LEAST_DEPTHS: f64 = 1e-3;

/// Below this the depth range is odd: the optics would keep their focus over fifty times as much. A process may ask for
/// it, as the article's does for a 25th.
const ODD_DEPTHS: f64 = 0.02;

/// Least pitch of a hatch, in spots. Lines that overlap to more than three quarters mark every place more than four
/// times.
const LEAST_PITCH: f64 = 0.25;

/// Largest pitch of the lines that fill areas, in spots: they cover a tenth, and the area is seen as separate lines.
const MOST_PITCH: f64 = 10.0;

/// The hint where a job is refused.
const ALLOW: &str = "check its unit; set limits.implausible = \"allow\" to accept it";

impl Job {
    /// Holds depth of focus and hatch pitch to the machine's optics; returns warnings about what is odd, and about
    /// what they make implausible where the job allows that.
    ///
    /// # Errors
    /// `pdof-large`, `pdof-small`, `pitch-small`.
    pub fn plausible(&self, machine: &Machine) -> Result<Vec<Diag>, Error> {
        let found = self.depth(machine).into_iter().chain(self.dense(machine)).chain(self.sparse(machine));
        let (faults, warnings): (Vec<Diag>, Vec<Diag>) = found.partition(|d| d.kind != Kind::Warning);
        if faults.is_empty() { Ok(warnings) } else { Err(Error::many(faults).after(warnings)) }
    }

    /// A depth range that is far beyond the depth of focus of the optics, or far below it.
    fn depth(&self, machine: &Machine) -> Option<Diag> {
        let depth = self.focus.rule.range(self.focus.pdof).mm();
        let optics = machine.depth_of_focus_mm();
        let depths = depth / optics;
        if (ODD_DEPTHS..=MOST_DEPTHS).contains(&depths) {
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
        let is_refused = is_large || depths < LEAST_DEPTHS;
        let d = match (is_refused && self.limits.implausible == Implausible::Refuse, is_large) {
            (true, true) => Diag::limit("pdof-large", text).hint(ALLOW),
            (true, false) => Diag::limit("pdof-small", text).hint(ALLOW),
            (false, true) => Diag::warning("pdof-large", text),
            (false, false) if is_refused => Diag::warning("pdof-small", text),
            (false, false) => Diag::warning("pdof-small", text)
                .hint("check its unit, and spot and wavelength of the machine: shallower blocks mean more stops"),
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

    /// Lines that lie far apart: those that fill areas, beyond [`MOST_PITCH`]; those of patterns, which are textures of
    /// separate lines at 25 spots as well as at 100, beyond the field, so that stops may hold none.
    fn sparse(&self, machine: &Machine) -> impl Iterator<Item = Diag> {
        let spot = machine.lens.spot.as_mm();
        let field = machine.usable_field().map(|side| side.mm()).into_iter().fold(0.0, f64::max);
        self.textures.iter().enumerate().filter_map(move |(i, texture)| {
            let warning =
                |text: String| Diag::warning("pitch-large", text).at(self.place_of(&format!("texture.{i}.pitch")));
            if let Some(pitch) = texture.kind.fill_pitch_mm().filter(|&pitch| pitch > MOST_PITCH * spot) {
                let text = format!(
                    "areas are filled by lines {pitch} mm apart, which a spot of {spot} mm covers to {:.2} %: they look like \
                     separate lines",
                    100.0 * spot / pitch
                );
                return Some(warning(text).hint("check its unit; without it the lines are half a spot apart"));
            }
            let pitch = texture.kind.texture_pitch_mm().filter(|&pitch| pitch > field)?;
            let text = format!("lines {pitch} mm apart are farther from each other than the field is wide ({field} mm)");
            Some(warning(text).hint("check its unit"))
        })
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
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
        let warned = [("pdof-small", Kind::Warning, place("pdof"))];
        assert_eq!(found(&[(PDOF, "pdof = \"1.8 um\"")]), warned);
        assert_eq!(found(&[(PDOF, "pdof = \"35 um\""), ALLOWED]), warned.clone());
        assert_eq!(found(&[(PDOF, "pdof = \"35.5 um\"")]), []);
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
    fn lines_far_apart_are_reported_where_they_fill_areas_and_of_textures_beyond_the_field() {
        let plain = SAMPLE_JOB
            .lines()
            .filter(|l| !l.starts_with("pitch") && !l.starts_with("direction") && !l.starts_with("area"))
            .map(|l| l.replace("pattern = \"hatch\"", "TEXTURE") + "\n")
            .collect::<String>();
        let machine = Machine::built_in("xyz-galvo-40").expect("a profile");
        for (texture, warns) in [
            ("file = \"a.svg\"\npitch = \"0.2 mm\"", false),
            ("file = \"a.svg\"\npitch = \"0.201 mm\"", true),
            ("file = \"a.svg\"\nfill = \"rings\"\npitch = \"1 mm\"", true),
            ("file = \"a.svg\"\ndirection = \"contour\"\npitch = \"1 mm\"", true),
            ("file = \"a.svg\"\nfill = \"outline\"\nstroke = \"hatch\"\npitch = \"1 mm\"", true),
            ("file = \"a.svg\"", false),
            ("file = \"a.png\"\ndpi = 300\npitch = \"1 mm\"", true),
            ("file = \"a.png\"\ndpi = 300\nscreen = \"lines\"\npitch = \"1 mm\"", false),
            ("pattern = \"hatch\"\ndirection = \"0 deg\"\npitch = \"40 mm\"", false),
            ("pattern = \"hatch\"\ndirection = \"0 deg\"\npitch = \"40.1 mm\"", true),
            ("pattern = \"hatch\"\ndirection = \"contour\"\npitch = \"500 mm\"", true),
            ("pattern = \"concentric\"\npitch = \"500 mm\"", true),
            ("pattern = \"riblets\"\npitch = \"500 mm\"\ncell = \"0.1 mm\"\nline = \"20 um\"", true),
            ("pattern = \"dots\"\npitch = \"500 mm\"", false),
        ] {
            let text = plain.replace("TEXTURE", texture);
            let job = Job::parse(Path::new("job.toml"), &text, &Overrides::default())
                .unwrap_or_else(|e| panic!("{texture}: {e}"));
            let found = job.plausible(&machine).unwrap_or_else(|e| panic!("{texture}: {e}"));
            let codes: Vec<_> = found.iter().map(|d| (d.code, d.kind)).collect();
            assert_eq!(codes == [("pitch-large", Kind::Warning)], warns, "{texture}: {codes:?}");
        }
    }

    #[test]
    fn allowed_implausible_values_give_a_warning() {
        let both = [(PDOF, "pdof = \"70 mm\""), (PITCH, "pitch = \"1 um\""), ALLOWED];
        let codes: Vec<_> = found(&both).into_iter().map(|(code, kind, _)| (code, kind)).collect();
        assert_eq!(codes, [("pdof-large", Kind::Warning), ("pitch-small", Kind::Warning)]);
        assert_eq!(found(&[ALLOWED]), []);
    }
}
