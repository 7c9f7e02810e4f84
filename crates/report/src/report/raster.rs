//! A drawing as pixels.
//!
//! Text is drawn in DejaVu Sans, which is part of the program, so a picture is the same on every computer.

use std::sync::Arc;

use resvg::tiny_skia::{Color, Pixmap, Transform};
use resvg::usvg::{Options, Tree, fontdb};

use super::layout::at_width;
use terrace_core::diag::{Diag, Error};

/// A drawing is rendered at least so many px wide, and a smaller picture made of that: the images in it are then
/// averaged, not sampled.
const RENDERED: u32 = 2400;
/// The most that is rendered, px along a side.
const MOST: u32 = 20_000;

/// A drawing of this module as usvg reads it, with its text as outlines; as it is where it is `width` px wide.
///
/// # Errors
/// `picture` where it is not a drawing of ours.
pub(super) fn tree(svg: &str, width: u32) -> Result<Tree, Error> {
    let mut fonts = fontdb::Database::new();
    for face in [dejavu::sans::regular(), dejavu::sans::bold()] {
        fonts.load_font_source(fontdb::Source::Binary(Arc::new(face)));
    }
    let options = Options { fontdb: Arc::new(fonts), ..Options::default() };
    Tree::from_str(&at_width(svg, width), &options)
        .map_err(|e| Diag::bug("picture", format!("a drawing cannot be rendered: {e}")).into())
}

/// The drawing as a PNG file, `width` px wide.
///
/// # Errors
/// `picture-size` where that is beyond 20,000 px along a side.
pub fn png(svg: &str, width: u32) -> Result<Vec<u8>, Error> {
    let tree = tree(svg, width)?;
    let size = tree.size();
    let scale = f64::from(width.max(1)) / f64::from(size.width());
    let height = ((f64::from(size.height()) * scale).round() as u32).max(1);
    let times = RENDERED.div_ceil(width.max(1)).clamp(1, 6);
    let too_large = || {
        let text = format!("a picture of {width} x {height} px cannot be made");
        Diag::input("picture-size", text).hint("at most 20000 px along a side: lower --width")
    };
    if width == 0 || width.max(height) > MOST {
        return Err(too_large().into());
    }
    let mut large = Pixmap::new(width * times, height * times).ok_or_else(too_large)?;
    // The last row of a height that was rounded up is paper too.
    large.fill(Color::WHITE);
    let scale = (scale * f64::from(times)) as f32;
    resvg::render(&tree, Transform::from_scale(scale, scale), &mut large.as_mut());
    Ok(averaged(&large, times as usize))
}

/// The picture made smaller by a whole factor, as a PNG file: the mean of every `times` x `times` pixels.
fn averaged(large: &Pixmap, times: usize) -> Vec<u8> {
    // Bytes of a pixel: red, green, blue, each multiplied by the opacity, and opacity. The paper is opaque, so the
    // first three are as they are seen.
    const BYTES: usize = 4;
    let stride = large.width() as usize * BYTES;
    let size = [large.width() as usize / times, large.height() as usize / times];
    let mut pixels = Vec::with_capacity(size[0] * size[1] * 3);
    let count = (times * times) as u32;
    for y in 0..size[1] {
        for x in 0..size[0] {
            // Half of the divisor, so that the mean is rounded to the nearest.
            let mut sums = [count / 2; 3];
            for row in 0..times {
                let at = (y * times + row) * stride + x * times * BYTES;
                for pixel in large.data()[at..at + times * BYTES].chunks_exact(BYTES) {
                    (0..3).for_each(|k| sums[k] += u32::from(pixel[k]));
                }
            }
            pixels.extend(sums.map(|sum| (sum / count) as u8));
        }
    }
    super::image::of_pixels(size, &pixels)
}
