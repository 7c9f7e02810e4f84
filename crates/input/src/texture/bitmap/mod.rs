//! Bitmaps: the dark areas of a picture, or its grey by lines.
//!
//! Consumes PNG, TIFF, BMP or JPEG of 1 to 16 bits, told apart by their first bytes. Promises an [`Artwork`] of one
//! shape on a page whose lower left corner is the origin, y up; row 0 of the file is at the top. A sample is a grey
//! from 0 (black) to 1 (white): of colours their luma (0.299 R + 0.587 G + 0.114 B), of transparent pixels what is seen
//! over white. Its density is 1 - sample^gamma, or sample^gamma where light is marked. Profiles and gamma of the file
//! are not used. With a threshold the shape is the area that is darker ([`contour`]); with lines or dashes it is the
//! picture itself, which `artwork` screens.
//!
//! A picture of at most two densities has pixels with sides, not samples of something smooth, so its areas follow the
//! sides: they keep their size, thin lines stay as wide as drawn, and what was screened before keeps its tone. All
//! other borders are interpolated between pixels.
//!
//! The resolution that a file states is used only where the job asks for it: programs write 72 or 96 dpi that nobody
//! chose, and a part marked in the wrong size is lost.
//!
//! Limits: 100 million pixels, 5 million points of contours, a page of 4 m. Damaged files are refused, not repaired.

mod bmp;
mod contour;
mod image;
mod jpeg;
mod png;
mod tiff;
mod tiff_tags;

use std::path::Path;
use terrace_core::math;

use super::artwork::{
    Artwork, Grey, Labels, Marking, PaintedShape, Paper, Resolution, Screen, ShapeFigure, StrokeMode, Tone, WindingRule,
};
use super::clip::Polylines;
use super::page::WantedSize;
use super::place::Site;
use contour::{Borders, contours};
pub use image::Image;
use terrace_core::diag::{Diag, Error, Place, memory};
use terrace_core::geom::{MAX_NM, NM_PER_MM};

/// Most pixels.
const MAX_PIXELS: u64 = 100_000_000;

/// Most points of the contours of a picture.
const MAX_CONTOUR_POINTS: usize = 5_000_000;

const MM_PER_INCH: f64 = 25.4;

type Decode = fn(&[u8]) -> Result<Image, Diag>;

/// A format of bitmaps.
struct BitmapFormat {
    /// How its files may begin.
    magic: &'static [&'static [u8]],
    /// The extensions of their names.
    extensions: &'static [&'static str],
    decode: Decode,
}

const FORMATS: [BitmapFormat; 4] = [
    BitmapFormat { magic: &[b"\x89PNG"], extensions: &["png"], decode: png::decode },
    BitmapFormat { magic: &[b"\xff\xd8\xff"], extensions: &["jpg", "jpeg"], decode: jpeg::decode },
    BitmapFormat { magic: &[b"BM"], extensions: &["bmp"], decode: bmp::decode },
    // In either byte order; + is the mark of BigTIFF.
    BitmapFormat {
        magic: &[b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"],
        extensions: &["tif", "tiff"],
        decode: tiff::decode,
    },
];

/// Whether a file is a bitmap, by how it begins.
pub(super) fn is_bitmap(bytes: &[u8]) -> bool {
    format(bytes).is_some()
}

/// Whether a file should be a bitmap, by its name.
pub(super) fn has_name(path: &Path) -> bool {
    let has_extension = |extension: &&str| path.extension().is_some_and(|e| e.eq_ignore_ascii_case(extension));
    FORMATS.iter().any(|format| format.extensions.iter().any(has_extension))
}

/// The reader of a file, by how it begins.
fn format(bytes: &[u8]) -> Option<Decode> {
    FORMATS.iter().find(|format| format.magic.iter().any(|m| bytes.starts_with(m))).map(|format| format.decode)
}

/// Decodes the bytes of a file.
///
/// # Errors
/// `bitmap-format`, `bitmap-damaged`, `bitmap-truncated`, `bitmap-samples`, `bitmap-turned`, `bitmap-large`, `memory`.
pub fn decode(bytes: &[u8], path: &Path) -> Result<Image, Error> {
    let decoded = match format(bytes) {
        Some(decode) => decode(bytes),
        None if bytes.is_empty() => Err(image::truncated("the file is empty")),
        None => Err(Diag::input("bitmap-format", "this is no PNG, JPEG, TIFF or BMP, though its name says so")
            .hint("save it again as PNG, or copy it as binary: line ends may have been changed on its way")),
    };
    decoded.map_err(|d| d.at(Place::file(path.display().to_string())).into())
}

/// What is to be marked of a bitmap.
///
/// # Errors
/// `bitmap-size`, `bitmap-large`, `texture-empty`, `texture-far`, `texture-key`, `memory`.
pub(super) fn load(
    image: &Image,
    path: &Path,
    wanted: WantedSize,
    site: &Site,
    marking: &Marking,
    notes: &mut Vec<Diag>,
) -> Result<Artwork, Error> {
    let file = Place::file(path.display().to_string());
    let mut file_notes = image.notes.clone();
    let art = artwork(image, wanted, site, marking, &mut file_notes).map_err(|d| Error::from(d.at(file.clone())))?;
    notes.extend(file_notes.into_iter().map(|d| d.at(file.clone())));
    Ok(art)
}

fn artwork(
    image: &Image,
    wanted: WantedSize,
    site: &Site,
    marking: &Marking,
    notes: &mut Vec<Diag>,
) -> Result<Artwork, Diag> {
    if marking.stroke != StrokeMode::Shown {
        let fault = Diag::input("texture-key", "stroke does not apply to a bitmap");
        return Err(fault.hint("leave it out: a bitmap has areas and grey, no strokes"));
    }
    if marking.paper != Paper::default() {
        let fault = Diag::input("texture-key", "paper does not apply to a bitmap");
        return Err(fault.hint("leave it out, or use threshold to say how dark a pixel must be to be marked"));
    }
    let tone = marking.tone.unwrap_or_default();
    let size = size(image, wanted, tone.resolution, notes)?;
    memory::ask("the bitmap's densities", 2 * image.samples.len() as u64)?;
    let table: Vec<u16> = (0..=u16::MAX).map(|s| density(s, &tone)).collect();
    let grey = image.samples.iter().map(|&s| table[usize::from(s)]).collect();
    let grey = Grey::new(image.columns, image.rows, grey);
    let mut art =
        Artwork { size, names: vec!["the bitmap".into()], labels: vec![Labels::default()], ..Artwork::default() };
    let figure = match tone.screen {
        Screen::Threshold => {
            let borders = if levels(&grey).len() > 2 { Borders::Interpolated } else { Borders::Pixels };
            art.lines = areas(&grey, size, tone.threshold, borders)?;
            art.dark_share = (borders == Borders::Pixels).then(|| grey.darker(tone.threshold));
            ShapeFigure::Fill(WindingRule::EvenOdd)
        }
        _ => {
            // What is finer than the lines is seen by none of them alone, but by their mean.
            let pixel = [size[0] / image.columns as f64, size[1] / image.rows as f64];
            let pixels_per_pitch = marking.pitch_mm.unwrap_or(site.spot_mm) / pixel[0].max(pixel[1]);
            let side = image.columns.max(image.rows) as f64;
            let is_finer = pixels_per_pitch >= 2.0;
            art.greys.push(if is_finer { grey.joined(pixels_per_pitch.min(side) as usize) } else { grey });
            ShapeFigure::Grey(0)
        }
    };
    let lines = 0..art.lines.len();
    art.shapes.push(PaintedShape { name: 0, labels: 0, colour: [0; 3], opacity: 1.0, figure, lines, clip: None });
    Ok(art)
}

/// The density of a sample.
fn density(sample: u16, tone: &Tone) -> u16 {
    let white = f64::from(u16::MAX);
    let light = math::pow(f64::from(sample) / white, tone.gamma);
    let density = if tone.invert { light } else { 1.0 - light };
    (density * white).round() as u16
}

/// The contours of what is darker than a threshold, on the page.
fn areas(grey: &Grey, size: [f64; 2], threshold: f64, borders: Borders) -> Result<Polylines, Diag> {
    let [w, h] = [size[0] / grey.columns as f64, size[1] / grey.rows as f64];
    let mut lines = Polylines::default();
    let mut page = Vec::new();
    let traced = contours(grey, threshold, borders, |contour| {
        page.clear();
        page.extend(contour.iter().map(|p| [p[0] * w, size[1] - p[1] * h]));
        lines.push(&page);
    });
    if traced.is_err() {
        let text = format!("the borders of the dark areas have more than {MAX_CONTOUR_POINTS} points");
        return Err(
            Diag::limit("bitmap-large", text).hint("smooth the bitmap, save it coarser, or use screen = \"lines\"")
        );
    }
    if lines.len() == 0 {
        let text = format!("nothing of the bitmap is darker than {} %", 100.0 * threshold);
        return Err(
            Diag::input("texture-empty", text).hint("change threshold, gamma or invert, or use screen = \"lines\"")
        );
    }
    Ok(lines)
}

/// The densities of a picture, up to three.
fn levels(grey: &Grey) -> Vec<u16> {
    let mut levels = Vec::new();
    for j in 0..grey.rows {
        for &d in grey.row(j) {
            if !levels.contains(&d) {
                levels.push(d);
                if levels.len() == 3 {
                    return levels;
                }
            }
        }
    }
    levels
}

/// Width and height of the page, mm.
fn size(
    image: &Image,
    wanted: WantedSize,
    resolution: Option<Resolution>,
    notes: &mut Vec<Diag>,
) -> Result<[f64; 2], Diag> {
    let pixels = [image.columns as f64, image.rows as f64];
    let sides_at = |per_mm: [f64; 2]| [pixels[0] / per_mm[0], pixels[1] / per_mm[1]];
    let (sides, is_physical) = match (resolution, image.resolution) {
        (Some(Resolution::Dpi(dpi)), _) => (sides_at([dpi / MM_PER_INCH; 2]), true),
        (Some(Resolution::File), Some(stated)) => (sides_at(stated), true),
        (Some(Resolution::File), None) => {
            return Err(Diag::input("bitmap-size", "the bitmap states no resolution").hint(SIZE_HINT));
        }
        (None, Some(stated)) => (sides_at(stated), false),
        (None, None) => (pixels, false),
    };
    let Some(size) = wanted.size(sides, is_physical).map_err(|d| *d)? else {
        let text = format!("the size of the bitmap ({} x {} pixels) is not given", image.columns, image.rows);
        let hint = image.resolution.map_or(SIZE_HINT.to_owned(), |stated| {
            let [w, h] = sides_at(stated);
            let dpi = stated[0] * MM_PER_INCH;
            format!("{SIZE_HINT}, or dpi = \"file\": it states {dpi:.1} dpi, which makes {w:.3} mm x {h:.3} mm")
        });
        return Err(Diag::input("bitmap-size", text).hint(hint));
    };
    if size.iter().any(|&s| !(s > 0.0 && s.is_finite())) {
        let text = format!("a bitmap of {} mm x {} mm is not possible", size[0], size[1]);
        return Err(Diag::input("bitmap-size", text).hint(SIZE_HINT));
    }
    if size.iter().any(|&s| s * NM_PER_MM > MAX_NM.f64()) {
        let text = format!("the bitmap measures {:.1} mm x {:.1} mm, more than 4 m", size[0], size[1]);
        return Err(Diag::input("texture-far", text).hint("check size or dpi of the texture"));
    }
    let stretch = (size[0] / pixels[0]) / (size[1] / pixels[1]);
    if resolution.is_none() && (stretch - 1.0).abs() > 1e-3 {
        let text = format!("the pixels of the bitmap are stretched: {:.4} times as wide as high", stretch);
        let hint =
            format!("give the texture a size in the proportion of its {} x {} pixels", image.columns, image.rows);
        notes.push(Diag::warning("bitmap-stretched", text).hint(hint));
    }
    Ok(size)
}

const SIZE_HINT: &str = "add size = [\"100 mm\", \"100 mm\"] or dpi = 300 to the texture";

#[cfg(test)]
mod tests;
