//! The files of drawings, each read once, by the reader that their first bytes or their name ask for.

use std::path::{Path, PathBuf};

use super::artwork::{Artwork, ShapeFigure};
use super::page::WantedSize;
use super::place::Site;
use super::{Kind, Request, bitmap, dxf, foreign, hpgl, svg, xml};
use terrace_core::diag::{self, Diag, Error, Place};

/// Largest file of a drawing.
const MAX_FILE: u64 = 256 << 20;

/// A file that was read.
pub(super) enum Source {
    Svg(String),
    Dxf(Vec<u8>),
    Plot(Vec<u8>),
    Bitmap(bitmap::Image),
}

/// The drawings of a job.
#[derive(Default)]
pub(super) struct Sources(Vec<(PathBuf, Source)>);

impl Sources {
    /// The drawing of a request of kind drawing.
    ///
    /// # Errors
    /// `file-…`; faults of the drawing (`svg-…`, `dxf-…`, `hpgl-…`, `bitmap-…`), `texture-…`.
    pub(super) fn artwork(&mut self, request: &Request, site: &Site, notes: &mut Vec<Diag>) -> Result<Artwork, Error> {
        let Kind::Drawing { path, unit_mm, marking, .. } = &request.kind else {
            unreachable!("a drawing was asked for")
        };
        let wanted = request.wanted(site);
        let source = self.read(path)?;
        if marking.tone.is_some() && !matches!(source, Source::Bitmap(_)) {
            return Err(Diag::input("texture-key", "a key of bitmaps does not apply to this drawing")
                .at(Place::file(path.display().to_string()))
                .hint("leave out dpi, gamma, invert, screen, threshold and period")
                .into());
        }
        let mut art = match source {
            Source::Svg(text) => svg::load(text, path, wanted, site, marking, notes)?,
            Source::Bitmap(image) => bitmap::load(image, path, wanted, site, marking, notes)?,
            Source::Dxf(bytes) => {
                let load = |growth: f64, notes: &mut Vec<Diag>| {
                    let tolerance = site.tolerance / growth;
                    let widest_line = marking.widest_line_mm(site.spot_mm) / growth;
                    let options = dxf::DxfOptions { path, unit_mm: *unit_mm, tolerance, widest_line, marking };
                    dxf::load(bytes, &options, notes)
                };
                stretched(load, wanted, path, notes)?
            }
            Source::Plot(bytes) => {
                let load = |growth: f64, notes: &mut Vec<Diag>| {
                    let tolerance = site.tolerance / growth;
                    let widest_line = marking.widest_line_mm(site.spot_mm) / growth;
                    hpgl::load(bytes, &hpgl::PlotOptions { path, tolerance, widest_line, marking }, notes)
                };
                stretched(load, wanted, path, notes)?
            }
        };
        if let Some(mirror) = marking.mirror {
            art.mirror(mirror);
        }
        Ok(art)
    }

    /// The file of a drawing.
    pub(super) fn read(&mut self, path: &Path) -> Result<&Source, Error> {
        let i = match self.0.iter().position(|(p, _)| p == path) {
            Some(i) => i,
            None => {
                let (bytes, format) = read_drawing(path)?;
                let source = match format {
                    DrawingFormat::Bitmap => Source::Bitmap(bitmap::decode(&bytes, path)?),
                    DrawingFormat::Dxf => Source::Dxf(bytes),
                    DrawingFormat::Plot => Source::Plot(bytes),
                    DrawingFormat::Svg => Source::Svg(xml::text(bytes, path)?),
                };
                self.0.push((path.to_owned(), source));
                self.0.len() - 1
            }
        };
        Ok(&self.0[i].1)
    }
}

/// What a drawing is read as.
pub enum DrawingFormat {
    /// SVG.
    Svg,
    /// DXF.
    Dxf,
    /// HPGL.
    Plot,
    /// PNG, JPEG, TIFF or BMP.
    Bitmap,
}

/// The file of a drawing, and what its first bytes or its name say that it is.
///
/// # Errors
/// `file-…`; `drawing-format`.
pub fn read_drawing(path: &Path) -> Result<(Vec<u8>, DrawingFormat), Error> {
    let bytes = diag::read_file(path, MAX_FILE)?;
    if let Some(d) = foreign::refused(&bytes) {
        return Err(d.at(Place::file(path.display().to_string())).into());
    }
    let is_text = xml::is_xml(&bytes);
    let format = match extension(path).as_str() {
        _ if bitmap::is_bitmap(&bytes) => DrawingFormat::Bitmap,
        "dxf" if !is_text => DrawingFormat::Dxf,
        "plt" | "hpgl" | "hpg" if !is_text => DrawingFormat::Plot,
        _ if bitmap::has_name(path) && !is_text => DrawingFormat::Bitmap,
        _ => DrawingFormat::Svg,
    };
    Ok((bytes, format))
}

/// A drawing whose page gets the size that is wanted once it was read; `load` reads it for a page that grows by a
/// factor. One that grows is read again with a finer tolerance; so is one with wide lines that shrinks, as they may
/// become thin.
fn stretched(
    load: impl Fn(f64, &mut Vec<Diag>) -> Result<Artwork, Error>,
    wanted: WantedSize,
    path: &Path,
    notes: &mut Vec<Diag>,
) -> Result<Artwork, Error> {
    let before = notes.len();
    let mut art = load(1.0, notes)?;
    let grown = wanted_size(&wanted, &art, path)?;
    // A side of length 0 does not grow.
    let growth = (0..2).map(|k| grown[k] / art.size[k]).filter(|f| f.is_finite()).reduce(f64::max).unwrap_or(1.0);
    if growth > 1.0 || growth > 0.0 && growth < 1.0 && art.shapes.iter().any(|s| s.figure == ShapeFigure::Stroke) {
        notes.truncate(before);
        art = load(growth, notes)?;
    }
    let size = wanted_size(&wanted, &art, path)?;
    if size != art.size {
        art.stretch(size);
    }
    Ok(art)
}

/// The size that the page of a drawing is to have, mm.
fn wanted_size(wanted: &WantedSize, art: &Artwork, path: &Path) -> Result<[f64; 2], Error> {
    let size = wanted.size(art.size, true).map_err(|d| Error::from(d.at(Place::file(path.display().to_string()))))?;
    Ok(size.unwrap_or(art.size))
}

/// The extension of a file's name in small letters.
fn extension(path: &Path) -> String {
    path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default()
}
