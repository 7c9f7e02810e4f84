//! `bitmap`: what is marked of a bitmap lies where it is dark, and as densely as it is dark there.
//!
//! The samples are those of the job's own decoders; densities, size, place, turn and mirror are computed here and in
//! [`Page`]. Areas by a threshold: of at most [`MAX_MARKS`] marks places must be dark, and at most
//! [`areas::MAX_PLACES`] dark places must have a mark beside them. Screens: the page is divided into windows of n by n
//! pitches along the lines or rows, at two sizes. What is marked in a window (length of lines in pitches, or number of
//! dots) must lie between n² q for the lightest and for the darkest pixel in or next to it, to the tolerance of the
//! screen ([`screen`]).
mod areas;
mod grey;
mod screen;
#[cfg(test)]
mod tests;

use super::drawing::{F32, PlacedTextures};
use super::drawing_files::{Content, Files};
use super::page::Page;
use crate::Drawing;
use crate::proof::Rule;
use grey::Grey;
use terrace_core::geom::{BoxMm, P2, PlanePoint};
use terrace_input::texture::{Area, Image, Kind, Marking, Request, Resolution, Screen, Tone};

/// Most marks of a texture that are looked at one by one, as docs/explanation/verify.md states.
const MAX_MARKS: usize = 30_000;

/// Most sides of a mark on which places are looked at, as docs/explanation/verify.md states.
const SIDES: usize = 64;

/// How far a density may lie from the compiler's, which rounds it to steps of 1 / 65535 twice: of each sample, and of
/// the mean of the pixels within a pitch. Half a step each time makes 1.6e-5; the rest is reserve.
const ROUNDING: f64 = 4e-5;

const BEYOND: &str = "it is marked beyond the page of the bitmap";

const MM_PER_INCH: f64 = 25.4;

/// Holds the rule for the textures of a pass, as the job states them for it.
pub(crate) fn check(
    placed: &PlacedTextures<'_>,
    requests: &[Request],
    spot_mm: f64,
    files: &mut Files,
    rule: &mut Rule,
) {
    let PlacedTextures { texture, drawing, site, .. } = placed;
    rule.ran = true;
    for (number, request) in requests.iter().enumerate() {
        let Kind::Drawing { path, marking, .. } = &request.kind else { continue };
        // What cannot be read is named by the rule `drawing`.
        let Ok(Content::Bitmap(image)) = files.get(path) else { continue };
        let tone = marking.tone.unwrap_or_default();
        let Some(sides) = sides(image, &tone) else {
            rule.leaves_out(path, number, "it states no resolution");
            continue;
        };
        let Some(page) = Page::new(&request.kind, &request.area, site, sides) else { continue };
        let limit = match request.area {
            Area::Part => Some(site.part_box),
            Area::Rectangle(area) => Some(area),
            Area::Unlimited => None,
        };
        let is_cut = request.masks.list().next().is_some();
        let slack_mm = 2.0 * request.tolerance_mm + page.size[0].max(page.size[1]) * F32;
        let strokes = texture.strokes_of(number);
        let grey = Grey::new(image, &tone, page.size);
        let name = format!("texture {}", number + 1);
        let placed_bitmap = PlacedBitmap { page: &page, marking, spot_mm, slack_mm, limit, name };
        let marks = TextureStrokes { drawing, strokes };
        let compared = match tone.screen {
            Screen::Threshold => placed_bitmap.check_areas(&grey, tone.threshold, &marks, is_cut, rule),
            _ => placed_bitmap.check_screen(&grey, &tone, &marks, is_cut, rule),
        };
        if let Err(why) = compared {
            rule.leaves_out(path, number, why);
        }
    }
}

/// The sides of the picture without a size, mm; pixels where nothing gives any.
fn sides(image: &Image, tone: &Tone) -> Option<[f64; 2]> {
    let pixels = [image.columns as f64, image.rows as f64];
    match tone.resolution {
        None => Some(pixels),
        Some(Resolution::Dpi(dpi)) => Some(pixels.map(|n| n / dpi * MM_PER_INCH)),
        Some(Resolution::File) => image.resolution.map(|per_mm| [0, 1].map(|k| pixels[k] / per_mm[k])),
    }
}

/// The strokes of a texture.
struct TextureStrokes<'a> {
    drawing: &'a Drawing<'a>,
    strokes: std::ops::Range<usize>,
}

impl TextureStrokes<'_> {
    /// The numbers of at most `most` strokes, evenly spread.
    fn sampled(&self, most: usize) -> impl Iterator<Item = usize> {
        self.strokes.clone().step_by(self.strokes.len().div_ceil(most).max(1))
    }
}

/// A bitmap on its page, and how it is to be marked.
struct PlacedBitmap<'a> {
    page: &'a Page,
    marking: &'a Marking,
    spot_mm: f64,
    /// How far a mark may lie from its place on the page, mm.
    slack_mm: f64,
    /// Beyond it nothing is marked; part frame, mm.
    limit: Option<BoxMm<2>>,
    /// The name of its texture in messages.
    name: String,
}

impl PlacedBitmap<'_> {
    /// Whether all of the part within this distance of a place on the page's plane may be marked.
    fn is_within(&self, p: PlanePoint, by: f64) -> bool {
        let Some(limit) = self.limit else { return true };
        let p_part = self.page.on_part(p);
        (0..2).all(|k| limit.lo[k] + by <= p_part[k] && p_part[k] + by <= limit.hi[k])
    }
}

/// Places of a stroke, not at its ends: on at most [`SIDES`] of its sides three each; of a dot its point.
fn places(points: &[P2]) -> impl Iterator<Item = PlanePoint> + '_ {
    let sides = points.len().saturating_sub(1);
    let dot = points.first().filter(|_| sides == 0).map(|p| [p.x as f64, p.y as f64]);
    let on_sides = points.windows(2).step_by(sides.div_ceil(SIDES).max(1)).flat_map(|w| {
        let [a, b] = [w[0], w[1]].map(|p| [p.x as f64, p.y as f64]);
        [0.1, 0.5, 0.9].map(|t| [0, 1].map(|k| a[k] + t * (b[k] - a[k])))
    });
    dot.into_iter().chain(on_sides)
}
