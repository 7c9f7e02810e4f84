//! The files of drawings, each read once, by the reader that their first bytes or their name ask for.

use std::path::{Path, PathBuf};

use super::artwork::{Artwork, Marking};
use super::place::Site;
use super::{bitmap, svg};
use crate::diag::{self, Diag, Error, Place};

/// Largest file of a drawing.
const MAX_FILE: u64 = 256 << 20;

/// A file that was read.
enum Source {
    Svg(String),
    Bitmap(bitmap::Image),
}

/// The drawings of a job.
#[derive(Default)]
pub(super) struct Sources(Vec<(PathBuf, Source)>);

impl Sources {
    /// Reads a drawing; `size_mm` wins over the file's own size.
    ///
    /// # Errors
    /// `file-…`; faults of the drawing (`svg-…`, `bitmap-…`), `texture-empty`, `texture-far`, `texture-large`,
    /// `texture-key`.
    pub(super) fn artwork(
        &mut self,
        path: &Path,
        size_mm: Option<[f64; 2]>,
        site: &Site,
        marking: &Marking,
        notes: &mut Vec<Diag>,
    ) -> Result<Artwork, Error> {
        let mut art = match self.read(path)? {
            Source::Svg(text) => {
                if marking.tone.is_some() {
                    return Err(Diag::input("texture-key", "a key of bitmaps does not apply to this drawing")
                        .at(Place::file(path.display().to_string()))
                        .hint("leave out dpi, gamma, invert, screen, threshold and period")
                        .into());
                }
                svg::load(text, path, size_mm, site, marking, notes)?
            }
            Source::Bitmap(image) => bitmap::load(image, path, size_mm, site, marking, notes)?,
        };
        if let Some(mirror) = marking.mirror {
            art.mirror(mirror);
        }
        Ok(art)
    }

    fn read(&mut self, path: &Path) -> Result<&Source, Error> {
        let known = self.0.iter().position(|(p, _)| p == path);
        let i = match known {
            Some(i) => i,
            None => {
                let bytes = diag::read_file(path, MAX_FILE)?;
                let source = if bitmap::is_bitmap(&bytes) || (bitmap::has_name(path) && !svg::is_svg(&bytes)) {
                    Source::Bitmap(bitmap::decode(&bytes, path)?)
                } else {
                    Source::Svg(svg::text(bytes, path)?)
                };
                self.0.push((path.to_owned(), source));
                self.0.len() - 1
            }
        };
        Ok(&self.0[i].1)
    }
}
