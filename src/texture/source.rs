//! The files of drawings: each is read once, by the reader of its format.

use std::path::{Path, PathBuf};

use super::artwork::Artwork;
use super::place::Site;
use super::{Kind, Request, dxf, hpgl, svg};
use crate::diag::{self, Diag, Error};

/// Largest plot, bytes.
const MAX_PLOT: u64 = 256 << 20;

/// What a file holds.
enum Content {
    Svg(String),
    Dxf(Vec<u8>),
    Plot(Vec<u8>),
}

/// The contents of the drawings of a job.
#[derive(Default)]
pub(super) struct Sources(Vec<(PathBuf, Content)>);

impl Sources {
    /// The drawing of a request of kind drawing.
    ///
    /// # Errors
    /// `file-…`, `svg-…`, `dxf-…`, `hpgl-…`, `texture-…`.
    pub(super) fn artwork(&mut self, request: &Request, site: &Site, notes: &mut Vec<Diag>) -> Result<Artwork, Error> {
        let Kind::Drawing { path, size_mm, unit_mm, marking, .. } = &request.kind else {
            unreachable!("a drawing was asked for")
        };
        let mut art = match self.read(path)? {
            Content::Svg(text) => return svg::load(text, path, *size_mm, site, marking, notes),
            Content::Dxf(bytes) => dxf::load(bytes, path, *unit_mm, site.tolerance, marking, notes)?,
            Content::Plot(bytes) => hpgl::load(bytes, path, site.tolerance, marking, notes)?,
        };
        if let Some(size) = size_mm {
            art.stretch(*size);
        }
        Ok(art)
    }

    fn read(&mut self, path: &Path) -> Result<&Content, Error> {
        let known = self.0.iter().position(|(p, _)| p == path);
        let i = match known {
            Some(i) => i,
            None => {
                let content = match extension(path).as_str() {
                    "dxf" => Content::Dxf(diag::read_file(path, dxf::MAX_FILE)?),
                    "plt" | "hpgl" | "hpg" => Content::Plot(diag::read_file(path, MAX_PLOT)?),
                    _ => Content::Svg(svg::read(path)?),
                };
                self.0.push((path.to_owned(), content));
                self.0.len() - 1
            }
        };
        Ok(&self.0[i].1)
    }
}

/// The extension of a file's name in small letters.
fn extension(path: &Path) -> String {
    path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default()
}
