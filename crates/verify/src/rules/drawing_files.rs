//! The files of drawings, masks and bitmaps, each read once by the verifier.

use std::path::{Path, PathBuf};

use crate::read::picture::Picture;
use terrace_input::texture::{DrawingFormat, Image, decode_bitmap, read_drawing};

/// The content of a file.
pub(super) enum Content {
    Picture(Picture),
    Bitmap(Image),
}

/// The files that were read; of the others why they are not.
#[derive(Default)]
pub(crate) struct Files(Vec<(PathBuf, Result<Content, &'static str>)>);

impl Files {
    /// The content of a file, read the first time that it is asked for.
    pub(super) fn get(&mut self, path: &Path) -> Result<&Content, &'static str> {
        let known = self.0.iter().position(|(known, _)| known == path);
        let place = known.unwrap_or_else(|| {
            self.0.push((path.to_owned(), read(path)));
            self.0.len() - 1
        });
        self.0[place].1.as_ref().map_err(|why| *why)
    }

    /// A drawing that was read.
    pub(super) fn picture(&self, path: &Path) -> Option<&Picture> {
        match self.0.iter().find(|(known, _)| known == path)? {
            (_, Ok(Content::Picture(picture))) => Some(picture),
            _ => None,
        }
    }
}

fn read(path: &Path) -> Result<Content, &'static str> {
    let (bytes, format) = read_drawing(path).map_err(|_| "it cannot be read")?;
    match format {
        DrawingFormat::Bitmap => {
            decode_bitmap(&bytes, path).map(Content::Bitmap).map_err(|_| "the bitmap cannot be decoded")
        }
        DrawingFormat::Dxf | DrawingFormat::Plot => Err("DXF and HPGL drawings are not read by the verifier"),
        DrawingFormat::Svg => {
            let text = String::from_utf8(bytes).map_err(|_| "it is not UTF-8 text; compressed SVG is not read")?;
            Picture::read(&text).map(Content::Picture).ok_or(
                "usvg cannot read it, cannot in bounded time, or would read its selectors otherwise than browsers do",
            )
        }
    }
}
