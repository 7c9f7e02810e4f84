//! JPEG: baseline and progressive, grey or colour, 8 bits.
//!
//! Of colours the file holds the luma itself. Damage that viewers hide is a fault.

use zune_jpeg::JpegDecoder;
use zune_jpeg::errors::DecodeErrors;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

use super::image::{Bands, Exif, Image, SampleForm, check_size, damaged, truncated, unread, upright};
use terrace_core::diag::Diag;

pub(super) fn decode(bytes: &[u8]) -> Result<Image, Diag> {
    let side = usize::from(u16::MAX);
    let options = DecoderOptions::default().set_strict_mode(true).set_max_width(side).set_max_height(side);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    decoder.decode_headers().map_err(|e| fault(bytes, &e))?;
    let (columns, rows) = decoder.dimensions().ok_or_else(|| damaged("it states no size"))?;
    // Three bands of coefficients of a progressive file, and the samples.
    check_size(columns as u64, rows as u64, 8)?;
    // A block of 8 x 8 pixels takes a bit at least.
    if columns * rows / 512 > bytes.len() {
        return Err(truncated(&format!("{columns} x {rows} pixels cannot be in {} bytes", bytes.len())));
    }
    let (bands, out) = match decoder.input_colorspace() {
        Some(ColorSpace::Luma | ColorSpace::YCbCr) => (Bands::Grey, ColorSpace::Luma),
        Some(ColorSpace::RGB) => (Bands::Rgb, ColorSpace::RGB),
        _ => return Err(unread("a JPEG of inks (CMYK)")),
    };
    decoder.set_options(options.jpeg_set_out_colorspace(out));
    let samples = decoder.decode().map_err(|e| fault(bytes, &e))?;
    let exif = decoder.exif().map(|data| Exif::read(data)).unwrap_or_default();
    upright(exif.orientation)?;
    let mut image = Image::new(columns, rows);
    image.push(&samples, SampleForm { bands, bits: 8 });
    image.whole().map(|i| i.with_resolution(density(bytes).or(exif.resolution)))
}

/// The density of the JFIF header, where it is per inch or cm.
fn density(bytes: &[u8]) -> Option<[f64; 2]> {
    let head: [u8; 18] = bytes.get(..18)?.try_into().ok()?;
    if head[..4] != [0xff, 0xd8, 0xff, 0xe0] || head[6..11] != *b"JFIF\0" {
        return None;
    }
    let mm = match head[13] {
        1 => 25.4,
        2 => 10.0,
        _ => return None,
    };
    let density = [[head[14], head[15]], [head[16], head[17]]].map(u16::from_be_bytes);
    (!density.contains(&0)).then(|| density.map(|v| f64::from(v) / mm))
}

fn fault(bytes: &[u8], e: &DecodeErrors) -> Diag {
    // A whole file ends with a marker.
    let tail = &bytes[bytes.len().saturating_sub(1 << 16)..];
    if !tail.windows(2).any(|w| w == [0xff, 0xd9]) {
        return truncated("its end is missing");
    }
    // The message is the text of the error without the lines of its trace.
    damaged(format!("{e:?}").lines().next().unwrap_or_default().trim_matches('"'))
}
