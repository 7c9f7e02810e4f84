//! Drawings and curves whose size against the part shows a slip of units: 25.4 or 1000 times too large or too small.
//!
//! The sizes are those of all that is marked, before an area cuts it. A drawing may well be a twentieth of the part, or
//! overlap it five times, so a factor of 25.4 is told from the sizes alone only where the drawing is made too large.

use super::artwork::{Artwork, Class, Marking, Resolution, classes};
use super::place::Site;
use super::{Kind, Size};
use terrace_core::diag::{Diag, Error};
use terrace_core::geom::BoxMm;
use terrace_core::math;

/// From this many times the part's size a drawing is reported: a slip of 25.4 makes it so large where it was to fill
/// more than half of the part.
const LARGE: f64 = 12.7;

/// From this many times the part's size the factor is named where the job is refused anyway.
const DOUBTFUL: f64 = 5.0;

/// Up to this share of the part's size a drawing is reported: a logo of 4 mm on a part of 4 m is larger.
const SMALL: f64 = 1e-3;

/// Units that are taken for each other.
#[derive(Clone, Copy, Debug, PartialEq)]
struct UnitMixUp {
    /// How many times too large it makes a drawing; below 1 too small.
    factor: f64,
    units: &'static str,
}

impl UnitMixUp {
    /// The same units taken for each other the other way.
    fn reversed(self) -> Self {
        Self { factor: 1.0 / self.factor, ..self }
    }
}

/// The units that are taken for each other, by their factor.
const MIX_UPS: [UnitMixUp; 2] =
    [UnitMixUp { factor: 25.4, units: "mm and inches" }, UnitMixUp { factor: 1000.0, units: "um, mm and m" }];

/// How far a drawing that was to fill the part may reach beyond it.
const BEYOND: f64 = 2.0;

/// Lengths in mm of the units that a job can state.
const UNITS: [(&str, f64); 5] = [("mm", 1.0), ("cm", 10.0), ("m", 1000.0), ("in", 25.4), ("um", 1e-3)];

/// A size that does not go with the part.
#[derive(Clone, Debug, PartialEq)]
pub struct Slip {
    /// The drawing's longer side in longer sides of the part.
    ratio: f64,
    is_small: bool,
    /// What it is: the end of a sentence.
    pub text: String,
    /// What to change.
    pub hint: String,
}

impl Slip {
    /// Of a drawing or of curves, before they are marked.
    pub(super) fn of(art: &Artwork, kind: &Kind, site: &Site) -> Option<Self> {
        let (marking, is_tiled) = match kind {
            Kind::Drawing { marking, tile, .. } => (marking, *tile),
            Kind::Curves { marking, .. } => (marking, false),
            _ => return None,
        };
        let bounds = bounds(art, marking)?;
        let size = bounds.size();
        let part = site.part_box.size();
        let [long, side] = [size, part].map(|s| s[0].max(s[1]));
        let ratio = long / side;
        // Tiles may be as small as they like, as long as the spot can draw them.
        let is_small = long < site.spot_mm || !is_tiled && ratio < SMALL;
        let beside = if matches!(kind, Kind::Curves { .. }) { mix_up_beside(bounds, site.part_box) } else { None };
        if !(is_small || ratio > DOUBTFUL || beside.is_some()) || ratio <= 0.0 {
            return None;
        }
        let [w, h, pw, ph] = [size[0], size[1], part[0], part[1]].map(figure);
        let text = if ratio > 1.0 {
            format!("measures {w} mm x {h} mm, {} times the part ({pw} mm x {ph} mm)", figure(ratio))
        } else {
            format!("measures {w} mm x {h} mm, 1/{} of the part ({pw} mm x {ph} mm)", figure(1.0 / ratio))
        };
        Some(Self { ratio, is_small, text, hint: hint(kind, beside.or_else(|| mix_up_of_ratio(ratio))) })
    }

    /// Whether a warning says so where the job is not refused.
    pub fn is_warned_of(&self) -> bool {
        self.is_small || self.ratio > LARGE
    }

    /// The hint for what it causes.
    pub fn cause(&self) -> String {
        format!("the texture {}: {}", self.text, self.hint)
    }

    /// Names it as the cause of what refuses the drawing.
    pub(super) fn explain(&self, e: &Error) -> Error {
        const CAUSED: [&str; 4] = ["texture-far", "texture-large", "texture-crossings", "texture-empty"];
        let explained = |d: &Diag| if CAUSED.contains(&d.code) { d.clone().hint(self.cause()) } else { d.clone() };
        Error::many(e.diags().iter().map(explained).collect())
    }
}

/// The box of all shapes that exist, mm; None where there are none.
fn bounds(art: &Artwork, marking: &Marking) -> Option<BoxMm<2>> {
    let classes = classes(art, marking, None).ok()?;
    let mut all = BoxMm::EMPTY;
    for (shape, class) in art.shapes.iter().zip(classes) {
        if class != Class::Skip {
            shape.lines.clone().flat_map(|i| art.lines.get(i)).for_each(|&p| all.add(p));
        }
    }
    if !art.greys.is_empty() {
        [[0.0; 2], art.size].into_iter().for_each(|p| all.add(p));
    }
    (all.lo[0] <= all.hi[0]).then_some(all)
}

/// The units that were most likely taken for each other in a drawing of this ratio to the part: of a large one the
/// least factor that brings it onto the part, of a small one the largest that does not make it reach beyond.
fn mix_up_of_ratio(ratio: f64) -> Option<UnitMixUp> {
    let times = ratio.max(1.0 / ratio);
    if ratio > 1.0 {
        return MIX_UPS.into_iter().find(|units| times <= units.factor * BEYOND);
    }
    MIX_UPS.into_iter().rev().find(|units| times * BEYOND >= units.factor).map(UnitMixUp::reversed)
}

/// The same of curves that lie beside the part: they are in the frame of the surface file, so the factor that brings
/// them onto the part is the slip. Of several it is the one that leaves them largest.
fn mix_up_beside(curves: BoxMm<2>, part: BoxMm<2>) -> Option<UnitMixUp> {
    if (0..2).all(|k| curves.lo[k] <= part.hi[k] && curves.hi[k] >= part.lo[k]) {
        return None;
    }
    let is_on_part = |f: f64| (0..2).all(|k| curves.lo[k] / f >= part.lo[k] && curves.hi[k] / f <= part.hi[k]);
    let too_small = MIX_UPS.into_iter().rev().map(UnitMixUp::reversed);
    too_small.chain(MIX_UPS).find(|units| is_on_part(units.factor))
}

/// The key to set.
fn hint(kind: &Kind, mix_up: Option<UnitMixUp>) -> String {
    let Some(UnitMixUp { factor, units }) = mix_up else {
        return "no slip of units explains this: check size and scale of the texture, and the unit of the surface"
            .into();
    };
    let times = if factor > 1.0 { figure(factor) } else { format!("1/{}", figure(1.0 / factor)) };
    let (unit, size) = match kind {
        Kind::Drawing { unit_mm, size, .. } => (*unit_mm, *size),
        Kind::Curves { unit_mm, .. } => (*unit_mm, Size::File),
        _ => (None, Size::File),
    };
    let named = |mm: f64| UNITS.iter().find(|(_, length)| (length / mm - 1.0).abs() < 1e-9).map(|(name, _)| *name);
    let change = match (kind, size, unit.and_then(|mm| named(mm / factor))) {
        (_, Size::Mm([w, h]), _) => {
            let [w, h] = [w, h].map(|s| figure(s / factor));
            format!("set size = [\"{w} mm\", \"{h} mm\"]")
        }
        (_, Size::Scaled(scale), _) => format!("set scale = {}", figure(scale / factor)),
        (_, _, Some(unit)) => format!("set unit = \"{unit}\""),
        (Kind::Curves { .. }, ..) => "correct the unit of the file in the drawing program ($INSUNITS)".into(),
        (Kind::Drawing { marking, .. }, ..) if marking.tone.is_some_and(|t| t.resolution.is_some()) => {
            match marking.tone.and_then(|t| t.resolution) {
                Some(Resolution::Dpi(dpi)) => format!("set dpi = {}", figure(dpi * factor)),
                _ => "the dots per inch that the file states are wrong: set dpi or size".into(),
            }
        }
        _ => format!("set scale = {}", figure(1.0 / factor)),
    };
    format!(
        "most likely {units} were taken for each other, a factor of {times}: {change}, or check the unit of the surface"
    )
}

/// A number to six digits, without zeros at its end.
fn figure(v: f64) -> String {
    if v == 0.0 || !v.is_finite() {
        return v.to_string();
    }
    let digits = (5 - math::log10(v.abs()).floor() as i64).clamp(0, 12) as usize;
    let text = format!("{v:.digits$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_factor_is_the_least_that_brings_a_large_drawing_onto_the_part() {
        for (ratio, want) in [
            (6.0, Some(25.4)),
            (25.4, Some(25.4)),
            (50.8, Some(25.4)),
            (50.9, Some(1000.0)),
            (1000.0, Some(1000.0)),
            (2001.0, None),
            (1.0 / 25.4, Some(1.0 / 25.4)),
            (1e-3, Some(1e-3)),
            (1e-5, Some(1e-3)),
        ] {
            assert_eq!(mix_up_of_ratio(ratio).map(|units| units.factor), want, "{ratio}");
        }
    }

    #[test]
    fn curves_beside_the_part_are_brought_onto_it_by_the_least_change() {
        let part = BoxMm::rectangle(10.0, 10.0, 70.0, 60.0);
        for (seen, want) in [
            ([508.0, 508.0, 635.0, 635.0], Some(25.4)),
            ([20e3, 20e3, 40e3, 30e3], Some(1000.0)),
            ([1.0, 1.0, 2.0, 2.0], Some(1.0 / 25.4)),
            ([0.02, 0.02, 0.05, 0.05], Some(1e-3)),
            ([20.0, 20.0, 50.0, 50.0], None),
            ([100.0, 0.0, 110.0, 5.0], None),
        ] {
            let [x0, y0, x1, y1] = seen;
            let mix_up = mix_up_beside(BoxMm::rectangle(x0, y0, x1, y1), part);
            assert_eq!(mix_up.map(|units| units.factor), want, "{seen:?}");
        }
    }

    #[test]
    fn figures_have_six_digits() {
        for (v, want) in [(25.4, "25.4"), (1.0 / 25.4, "0.0393701"), (1524.0, "1524"), (2.5e6, "2500000"), (0.0, "0")] {
            assert_eq!(figure(v), want);
        }
    }
}
