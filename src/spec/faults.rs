//! What can be wrong with a job file that reads as one: found without opening any other file.

use super::{AreaSpec, Format, Job, Method, Parts, Pattern, SetupsSpec, TextureSpec};
use crate::diag::{Diag, Place};
use crate::units::Angle;

/// Most pens of a job: no controller holds more, and marks count them in 16 bits.
const MAX_PENS: usize = 1000;

/// Most passes of a job.
const MAX_PASSES: u32 = 100;

/// Most columns and most rows of set-ups.
pub const MAX_PARTS: u32 = 100;

/// Every fault, in the order of the file's sections.
pub(super) fn of(job: &Job) -> Vec<Diag> {
    let mut faults = Vec::new();
    let file = &job.file;
    let whole = Place::file(job.path.display().to_string());
    let focus = &file.focus;
    match (&focus.pdof, &focus.dof) {
        (Some(p), Some(_)) => faults.push(
            Diag::input("focus-both", "focus has both pdof and dof").at(job.place(p.span())).hint("keep one of them"),
        ),
        (None, None) => faults.push(
            Diag::input("focus-missing", "focus has neither pdof nor dof")
                .at(whole.clone())
                .hint("add pdof = \"0.07 mm\", measured on your process; it is never derived from the optics"),
        ),
        (Some(v), None) | (None, Some(v)) => {
            if !(1e-4..=1000.0).contains(&job.pdof().as_mm()) {
                faults.push(
                    Diag::input("focus-range", format!("the depth of focus comes to {}", job.pdof()))
                        .at(job.place(v.span()))
                        .hint("it must lie between 0.1 um and 1000 mm"),
                );
            }
        }
    }
    if focus.factor.is_some_and(|f| !f.is_finite() || f <= 0.0) {
        faults.push(Diag::input("focus-factor", "focus.factor must be above zero").at(whole.clone()));
    }
    if file.texture.is_empty() {
        faults.push(Diag::input("texture-none", "the job has no [[texture]]").at(whole.clone()));
    }
    if file.pen.is_empty() {
        faults.push(Diag::input("pen-none", "the job has no [[pen]]").at(whole.clone()));
    }
    if file.pen.len() > MAX_PENS {
        let text = format!("the job has {} pens, more than {MAX_PENS}", file.pen.len());
        faults.push(Diag::input("pen-many", text).at(whole.clone()));
    }
    for (i, pen) in file.pen.iter().take(MAX_PENS).enumerate() {
        if file.pen[..i].iter().any(|p| p.name == pen.name) {
            faults.push(Diag::input("pen-twice", format!("two pens are named {:?}", pen.name)).at(whole.clone()));
        }
        if !pen.name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-') || pen.name.is_empty() {
            let text = format!("pen name {:?} holds something other than letters, digits, - and _", pen.name);
            faults.push(Diag::input("pen-name", text).at(whole.clone()));
        }
        if !(1..=1000).contains(&pen.passes) {
            let text = format!("pen {:?} has {} passes", pen.name, pen.passes);
            faults.push(Diag::input("pen-passes", text).at(whole.clone()).hint("1 to 1000 are possible"));
        }
    }
    for texture in &file.texture {
        of_texture(job, texture, &mut faults);
    }
    if file.partition.zone.as_mm() > 0.0 && file.partition.overlap.as_mm() > 0.0 {
        faults.push(
            Diag::input("seam-both", "partition has both zone and overlap")
                .at(whole.clone())
                .hint("keep one of them: seams are either spread or marked twice"),
        );
    }
    match (&file.machine.profile, &file.machine.file) {
        (Some(p), Some(_)) => faults.push(
            Diag::input("machine-both", "machine has both profile and file").at(job.place(p.span())).hint("keep one"),
        ),
        (None, None) => faults.push(
            Diag::input("machine-missing", "machine has neither profile nor file")
                .at(whole.clone())
                .hint("add profile = \"xyz-galvo-40\"; `terrace machines` lists them"),
        ),
        _ => {}
    }
    if !(0.0..90.0).contains(&file.limits.max_incidence.as_deg()) {
        faults.push(
            Diag::input("limits-incidence", "limits.max_incidence is not between 0 and 90 deg").at(whole.clone()),
        );
    }
    let passes = &file.passes;
    if !(1..=MAX_PASSES).contains(&passes.count()) {
        faults.push(
            Diag::input("passes-count", format!("the job has {} passes", passes.count()))
                .at(job.place(passes.count.span()))
                .hint(format!("1 to {MAX_PASSES} are possible; pen.passes repeats strokes within a block")),
        );
    }
    if passes.lower > job.depth_range() {
        let text = format!("passes.lower {} is more than the depth range {}", passes.lower, job.depth_range());
        faults.push(
            Diag::input("passes-lower", text)
                .at(whole.clone())
                .hint("it is what one pass removes, such as \"8 um\"; check its unit"),
        );
    }
    if let Some(setups) = &file.setups {
        of_setups(job, setups, &mut faults);
    }
    if let Some(dose) = &file.dose {
        if !(1.01..=10.0).contains(&dose.cap) {
            faults.push(Diag::input("dose-cap", "dose.cap is not between 1.01 and 10").at(whole.clone()));
        }
        if !(0.001..=0.2).contains(&dose.step) {
            faults.push(Diag::input("dose-step", "dose.step is not between 0.001 and 0.2").at(whole.clone()));
        }
    }
    if file.placement.origin.is_some_and(|o| o.iter().any(|l| l.as_nm().is_none())) {
        faults.push(
            Diag::input("placement-far", "placement.origin is beyond 4 m")
                .at(whole.clone())
                .hint("check its units; no stage reaches that far"),
        );
    }
    if file.emit.formats.is_empty() {
        faults.push(
            Diag::input("emit-none", "emit.formats is empty")
                .at(whole)
                .hint("name at least one format, such as \"dxf\""),
        );
    }
    faults
}

fn of_setups(job: &Job, setups: &SetupsSpec, faults: &mut Vec<Diag>) {
    let whole = || Place::file(job.path.display().to_string());
    for (name, parts) in [("columns", setups.columns), ("rows", setups.rows)] {
        if matches!(parts, Parts::Number(n) if !(1..=MAX_PARTS).contains(&n)) {
            let text = format!("setups.{name} is not between 1 and {MAX_PARTS}");
            faults.push(Diag::input("setups-count", text).at(whole()).hint("\"auto\" takes the fewest"));
        }
    }
    let points = &setups.registration;
    let fault = if points.iter().flatten().any(|l| l.as_nm().is_none()) {
        Some("a point of setups.registration is beyond 4 m")
    } else if points.len() < 2 {
        Some("setups.registration has fewer than two points")
    } else if (1..points.len()).any(|i| points[..i].contains(&points[i])) {
        Some("two points of setups.registration are the same")
    } else {
        None
    };
    if let Some(text) = fault {
        let hint = "name tooling holes or corners, x and y in the part's own frame; every set-up must reach two";
        faults.push(Diag::input("setups-registration", text).at(whole()).hint(hint));
    }
    if job.file.placement.origin.is_some() {
        faults.push(
            Diag::input("setups-origin", "the job has both setups and placement.origin")
                .at(whole())
                .hint("leave the origin out: each set-up has its own, in the run sheet"),
        );
    }
    if job.file.partition.method == Method::Tilt {
        faults.push(
            Diag::input("setups-tilt", "a part in several set-ups cannot be tilted")
                .at(whole())
                .hint("use another partition.method, or leave [setups] out"),
        );
    }
    if job.file.emit.formats.contains(&Format::Ovf) {
        faults.push(
            Diag::input("setups-ovf", "\"ovf\" has no stop between set-ups, at which the part could be moved")
                .at(whole())
                .hint("leave it out: emit.formats = [\"dxf\", \"linuxcnc\"]"),
        );
    }
}

fn of_texture(job: &Job, t: &TextureSpec, faults: &mut Vec<Diag>) {
    let whole = Place::file(job.path.display().to_string());
    if let Some(pen) = &t.pen
        && !job.file.pen.iter().any(|p| p.name == *pen.get_ref())
    {
        let names: Vec<_> = job.file.pen.iter().map(|p| p.name.as_str()).collect();
        faults.push(
            Diag::input("pen-unknown", format!("there is no pen named {:?}", pen.get_ref()))
                .at(job.place(pen.span()))
                .hint(format!("pens of this job: {}", names.join(", "))),
        );
    }
    if let Some(area) = &t.area
        && let AreaSpec::Rectangle([x0, y0, x1, y1]) = area.get_ref()
        && (x0 >= x1 || y0 >= y1)
    {
        faults.push(
            Diag::input("texture-area", "the area is empty")
                .at(job.place(area.span()))
                .hint("write [x0, y0, x1, y1] with the lower left corner first"),
        );
    }
    let (pattern, span) = match (&t.pattern, &t.file) {
        (Some(p), None) => (Some(*p.get_ref()), p.span()),
        (None, Some(f)) => (None, f.span()),
        (Some(p), Some(_)) => {
            faults.push(
                Diag::input("texture-both", "the texture has both pattern and file")
                    .at(job.place(p.span()))
                    .hint("keep one"),
            );
            return;
        }
        (None, None) => {
            faults.push(
                Diag::input("texture-empty", "a texture has neither pattern nor file")
                    .at(whole)
                    .hint("add pattern = \"hatch\" and pitch = \"0.1 mm\", or file = \"drawing.svg\""),
            );
            return;
        }
    };
    let place = job.place(span);
    let (what, needed, possible): (_, &[&str], &[&str]) = match pattern {
        Some(Pattern::Hatch) => ("hatch", &["pitch"], &["direction"]),
        Some(Pattern::Hilbert) => ("hilbert", &["order"], &[]),
        Some(Pattern::Squares) => ("squares", &["pitch", "cell"], &[]),
        Some(Pattern::Circles) => ("circles", &["pitch", "cell"], &[]),
        None => ("a drawing", &[], &["size", "origin", "turn", "tile"]),
    };
    for (key, is_given) in [
        ("pitch", t.pitch.is_some()),
        ("direction", t.direction.is_some()),
        ("order", t.order.is_some()),
        ("cell", t.cell.is_some()),
        ("size", t.size.is_some()),
        ("origin", t.origin.is_some()),
        ("turn", t.turn != Angle::default()),
        ("tile", t.tile),
    ] {
        let fault = match (needed.contains(&key), is_given) {
            (true, false) => format!("{what} needs {key}"),
            (false, true) if !possible.contains(&key) => format!("{key} means nothing for {what}"),
            _ => continue,
        };
        let keys = [needed, possible].concat().join(", ");
        faults
            .push(Diag::input("texture-key", fault).at(place.clone()).hint(format!("keys of {what} alone are {keys}")));
    }
    if t.tile && t.area.is_none() {
        faults.push(
            Diag::input("texture-tile", "tile = true needs an area to fill")
                .at(place.clone())
                .hint("add area = \"part\" or area = [x0, y0, x1, y1]"),
        );
    }
    if let Some(order) = &t.order
        && !(1..=13).contains(order.get_ref())
    {
        faults.push(
            Diag::input("texture-order", format!("Hilbert order {} is not between 1 and 13", order.get_ref()))
                .at(job.place(order.span())),
        );
    }
    if let (Some(cell), Some(pitch)) = (t.cell, t.pitch)
        && needed.contains(&"cell")
        && cell > pitch
    {
        let text = format!("cell {cell} is larger than pitch {pitch}, so figures would overlap");
        faults.push(Diag::input("texture-cell", text).at(place));
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::spec::SAMPLE_JOB;

    /// Codes and messages of the sample job with one text replaced.
    fn faults(from: &str, to: &str) -> Vec<(&'static str, String)> {
        assert!(SAMPLE_JOB.contains(from), "{from}");
        match Job::parse(Path::new("job.toml"), &SAMPLE_JOB.replacen(from, to, 1)) {
            Ok(_) => Vec::new(),
            Err(e) => e.diags().iter().map(|d| (d.code, d.message.clone())).collect(),
        }
    }

    #[test]
    fn keys_of_other_patterns_are_refused_and_needed_ones_asked_for() {
        let pitch = "pitch = \"0.5 mm\"";
        let of = |to: &str| faults(pitch, to).into_iter().map(|f| f.1).collect::<Vec<_>>();
        assert_eq!(of(pitch), Vec::<String>::new());
        assert_eq!(of(""), ["hatch needs pitch"]);
        let more = "pitch = \"0.5 mm\"\ncell = \"1 mm\"\norder = 3\ntile = true";
        let nothing = |key: &str| format!("{key} means nothing for hatch");
        assert_eq!(of(more), [nothing("order"), nothing("cell"), nothing("tile")]);
        let direction = faults("pattern = \"hatch\"", "pattern = \"squares\"\ncell = \"0.6 mm\"");
        assert_eq!(direction[0].1, "direction means nothing for squares");
        assert_eq!(direction[1].0, "texture-cell");
    }

    #[test]
    fn a_placement_that_no_stage_reaches_is_refused() {
        let origin = |x: &str| faults("turn = \"0 deg\"", &format!("origin = [\"{x}\", \"0 mm\", \"0 mm\"]"));
        assert_eq!(origin("4 m"), []);
        assert_eq!(origin("4.1 m")[0].0, "placement-far");
    }

    #[test]
    fn pens_are_counted() {
        let pen = |i: usize| {
            format!("[[pen]]\nname = \"p{i}\"\nspeed = \"1 mm/s\"\npower = \"1 %\"\nfrequency = \"1 kHz\"\n")
        };
        let with = |n: usize| faults("[[pen]]", &((1..n).map(pen).collect::<String>() + "[[pen]]"));
        assert_eq!(with(MAX_PENS), []);
        assert_eq!(with(MAX_PENS + 1)[0].0, "pen-many");
    }
}
