//! The keys of a `[[texture]]` that say how large the page of a drawing is and where it lies.

use super::keys::{DrawingKeys, PlacedMaskKeys};
use crate::job::faults::Faults;
use crate::texture::{Align, Fit, Position, Size};
use terrace_core::diag::Diag;
use terrace_core::units::Length;

/// The keys of a page.
#[derive(Clone, Copy, Default)]
pub(super) struct PageKeys {
    size: Option<[Length; 2]>,
    scale: Option<f64>,
    fit: Option<Fit>,
    align: Option<Align>,
    origin: Option<[Length; 2]>,
    has_dpi: bool,
}

impl From<&DrawingKeys> for PageKeys {
    fn from(keys: &DrawingKeys) -> Self {
        let &DrawingKeys { size, scale, fit, align, origin, dpi, .. } = keys;
        Self { size, scale, fit, align, origin, has_dpi: dpi.is_some() }
    }
}

impl From<&PlacedMaskKeys> for PageKeys {
    fn from(keys: &PlacedMaskKeys) -> Self {
        let &PlacedMaskKeys { size, scale, fit, align, origin, .. } = keys;
        Self { size, scale, fit, align, origin, has_dpi: false }
    }
}

/// Size and position of the page.
pub(super) fn resolve(keys: PageKeys, place: &dyn Fn(&str) -> String, f: &mut Faults<'_>) -> (Size, Position) {
    // Of two keys that say the same thing the second is at fault.
    for (first, has_first, second, has_second) in [
        ("size", keys.size.is_some(), "scale", keys.scale.is_some()),
        ("size", keys.size.is_some(), "fit", keys.fit.is_some()),
        ("scale", keys.scale.is_some(), "fit", keys.fit.is_some()),
        ("dpi", keys.has_dpi, "fit", keys.fit.is_some()),
        ("origin", keys.origin.is_some(), "fit", keys.fit.is_some()),
        ("origin", keys.origin.is_some(), "align", keys.align.is_some()),
    ] {
        if has_first && has_second {
            let fault = Diag::input("texture-key", format!("the texture has both {first} and {second}"));
            f.push(&place(second), fault.hint("keep one"));
        }
    }
    if let Some(scale) = keys.scale.filter(|v| !(v.is_finite() && *v > 0.0)) {
        let fault = Diag::input("texture-key", format!("scale {scale} is not possible"));
        f.push(&place("scale"), fault.hint("write a number above 0: 2.0 is twice as large as the file states"));
    }
    of_agreeing(keys)
}

/// Size and position of the page of keys that are known to agree.
pub(super) fn of_agreeing(keys: PageKeys) -> (Size, Position) {
    let size = match (keys.size, keys.scale, keys.fit) {
        (Some(size), ..) => Size::Mm(size.map(Length::as_mm)),
        (_, Some(scale), _) => Size::Scaled(scale),
        (.., Some(fit)) => Size::Fit(fit),
        (None, None, None) => Size::File,
    };
    let position = match (keys.origin, keys.align) {
        (Some(origin), _) => Position::Origin(origin.map(Length::as_mm)),
        (None, Some(align)) => Position::Aligned(align),
        (None, None) if keys.fit.is_some() => Position::Aligned(Align::Centre),
        (None, None) => Position::Usual,
    };
    (size, position)
}
