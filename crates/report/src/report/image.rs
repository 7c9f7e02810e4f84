//! Images inside a drawing: PNG files as data URIs.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use png::{BitDepth, ColorType, DeflateCompression, Encoder, Filter};

/// How a PNG is written: what compresses best and fast of pictures with few values.
fn encoder(
    out: &mut Vec<u8>,
    [width, height]: [usize; 2],
    colour: ColorType,
    depth: BitDepth,
) -> Encoder<'_, &mut Vec<u8>> {
    let mut encoder = Encoder::new(out, width as u32, height as u32);
    encoder.set_color(colour);
    encoder.set_depth(depth);
    encoder.set_deflate_compression(DeflateCompression::Level(4));
    encoder.set_filter(Filter::NoFilter);
    encoder
}

fn written(encoder: Encoder<'_, &mut Vec<u8>>, data: &[u8]) {
    let mut writer = encoder.write_header().expect("the head is sound and memory takes it");
    writer.write_image_data(data).expect("as many bytes as the head says");
    writer.finish().expect("memory takes it");
}

/// A PNG file as a data URI.
fn address(png: &[u8]) -> String {
    format!("data:image/png;base64,{}", STANDARD.encode(png))
}

/// A PNG file of red, green and blue, from the upper left, row by row.
pub(super) fn of_pixels(size: [usize; 2], pixels: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    let mut encoder = encoder(&mut out, size, ColorType::Rgb, BitDepth::Eight);
    encoder.set_filter(Filter::Adaptive);
    written(encoder, pixels);
    out
}

/// A data URI of an image of pairs of grey and opacity, from the upper left, row by row.
pub(super) fn of_shades(size: [usize; 2], pairs: &[u8]) -> String {
    let mut out = Vec::new();
    let mut encoder = encoder(&mut out, size, ColorType::GrayscaleAlpha, BitDepth::Eight);
    encoder.set_filter(Filter::Adaptive);
    written(encoder, pairs);
    address(&out)
}

/// A data URI of an image of indices into a palette of red, green, blue and opacity, at most 256 of them; from the
/// upper left, row by row.
pub(super) fn of_indices(size: [usize; 2], palette: &[[u8; 4]], pixels: &[u8]) -> String {
    let mut out = Vec::new();
    // Two pixels a byte where the palette is small enough, the first in the high bits; every row begins a new byte.
    let is_small = palette.len() <= 16;
    let depth = if is_small { BitDepth::Four } else { BitDepth::Eight };
    let mut encoder = encoder(&mut out, size, ColorType::Indexed, depth);
    encoder.set_palette(palette.iter().flat_map(|c| c[..3].to_vec()).collect::<Vec<u8>>());
    encoder.set_trns(palette.iter().map(|c| c[3]).collect::<Vec<u8>>());
    if is_small {
        let byte_of = |pair: &[u8]| pair[0] << 4 | pair.get(1).copied().unwrap_or(0);
        let packed: Vec<u8> = pixels.chunks(size[0]).flat_map(|row| row.chunks(2).map(byte_of)).collect();
        written(encoder, &packed);
    } else {
        written(encoder, pixels);
    }
    address(&out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_of_odd_rows_are_read_back() {
        for colours in [3u8, 40] {
            let palette: Vec<[u8; 4]> = (0..colours).map(|k| [k, 2 * k, 3, 100 + k]).collect();
            let pixels: Vec<u8> = (0..35).map(|k| k % colours).collect();
            let text = of_indices([7, 5], &palette, &pixels);
            let tree = usvg_image(&text);
            for (k, &index) in pixels.iter().enumerate() {
                let at = tree.pixel((k % 7) as u32, (k / 7) as u32).expect("inside").demultiply();
                assert_eq!(at.alpha(), palette[index as usize][3], "{colours} colours, pixel {k}");
            }
        }
    }

    fn usvg_image(address: &str) -> resvg::tiny_skia::Pixmap {
        let svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 7 5\"><image width=\"7\" height=\"5\" \
             image-rendering=\"optimizeSpeed\" href=\"{address}\"/></svg>"
        );
        let tree = resvg::usvg::Tree::from_str(&svg, &resvg::usvg::Options::default()).expect("a drawing");
        let mut pixels = resvg::tiny_skia::Pixmap::new(7, 5).expect("a size");
        resvg::render(&tree, resvg::tiny_skia::Transform::default(), &mut pixels.as_mut());
        pixels
    }
}
