//! The keys of a `[[texture]]` that say how a bitmap is marked.

use std::ops::{Range, RangeInclusive};

use super::keys::{CommonKeys, DpiKeys, DpiName, DrawingKeys};
use crate::job::faults::Faults;
use crate::texture::{Resolution, Screen, Tone};
use terrace_core::diag::Diag;
use terrace_core::units::{Length, Share};

/// Possible pixels in an inch.
const DPI: RangeInclusive<f64> = 0.01..=1e6;
/// Possible exponents of the tone.
const GAMMA: RangeInclusive<f64> = 0.01..=100.0;
/// Possible thresholds, percent: at 100 % all of a bitmap would be dark.
const PERCENT: Range<f64> = 0.0..100.0;

/// How a bitmap is marked; None where nothing is said of it.
pub(super) fn resolve(
    keys: &DrawingKeys,
    common: &CommonKeys,
    place: &dyn Fn(&str) -> String,
    f: &mut Faults<'_>,
) -> Option<Tone> {
    let screen = keys.screen.unwrap_or_default();
    let is_area = screen == Screen::Threshold;
    // Keys that the screen has no use for.
    for (key, applies) in [
        ("threshold", is_area),
        ("period", matches!(screen, Screen::Dashes | Screen::Halftone)),
        ("seed", screen == Screen::Noise || common.soft.is_some()),
        ("one_way", !screen.is_of_dots()),
        ("fill", is_area),
        ("cross", is_area),
        ("inset", is_area),
        ("contour", is_area),
    ] {
        if !applies && f.is_given(&place(key)) {
            let fault = format!("{key} does not apply to screen = \"{}\"", screen.name());
            f.push(&place(key), Diag::input("texture-key", fault).hint("leave it out, or change screen"));
        }
    }
    if keys.dpi.is_some() && keys.size.is_some() {
        let fault = Diag::input("texture-key", "the texture has both size and dpi");
        f.push(&place("dpi"), fault.hint("keep one"));
    }
    let dpi = keys.dpi.and_then(|d| if let DpiKeys::Number(v) = d { Some(v) } else { None });
    let threshold = keys.threshold.map(Share::as_percent);
    // Not a number lies in no range.
    for (key, impossible, hint) in [
        ("dpi", dpi.filter(|v| !DPI.contains(v)), "write pixels in an inch, 0.01 to 1000000, or \"file\""),
        ("gamma", keys.gamma.filter(|v| !GAMMA.contains(v)), "write 0.01 to 100"),
        ("threshold", threshold.filter(|v| !PERCENT.contains(v)), "write 0 % to less than 100 %"),
    ] {
        if let Some(v) = impossible {
            f.push(&place(key), Diag::input("texture-key", format!("{key} {v} is not possible")).hint(hint));
        }
    }
    let is_stated = keys.dpi.is_some()
        || keys.gamma.is_some()
        || keys.invert
        || keys.screen.is_some()
        || keys.threshold.is_some()
        || keys.period.is_some();
    let usual = Tone::default();
    is_stated.then(|| Tone {
        resolution: keys.dpi.map(|d| match d {
            DpiKeys::Number(v) => Resolution::Dpi(v),
            DpiKeys::Stated(DpiName::File) => Resolution::File,
        }),
        gamma: keys.gamma.unwrap_or(usual.gamma),
        invert: keys.invert,
        screen,
        threshold: threshold.map_or(usual.threshold, |v| v / 100.0),
        period_mm: keys.period.map(Length::as_mm),
        seed: common.seed.unwrap_or(usual.seed),
    })
}
