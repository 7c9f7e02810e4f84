//! PNG: grey, palette and colour, 1 to 16 bits, with or without transparency, interlaced or not.
//!
//! Check sums and a missing end are faults. Gamma, colour profiles and later frames are not used.

use png::{BitDepth, ColorType, Decoder, DecodingError, Limits, Transformations, Unit};

use super::image::{Bands, Exif, Image, SampleForm, check_size, damaged, truncated, upright};
use terrace_core::diag::Diag;

/// What the decoder may allocate for rows and chunks, in bytes.
const DECODER_BYTES: usize = 64 << 20;

/// Most bytes that one of the file stands for: Deflate reaches 1032, and bits become bytes.
const MAX_RATIO: usize = 9000;

pub(super) fn decode(bytes: &[u8]) -> Result<Image, Diag> {
    let input = std::io::Cursor::new(bytes);
    let mut decoder = Decoder::new_with_limits(input, Limits { bytes: DECODER_BYTES });
    decoder.set_transformations(Transformations::EXPAND);
    decoder.set_ignore_text_chunk(true);
    decoder.set_ignore_iccp_chunk(true);
    let info = decoder.read_header_info().map_err(fault)?;
    let (width, height, is_interlaced) = (info.width, info.height, info.interlaced);
    check_size(width.into(), height.into(), if is_interlaced { 8 } else { 0 })?;
    let mut reader = decoder.read_info().map_err(fault)?;
    let (color, depth) = reader.output_color_type();
    let bands = match color {
        ColorType::Grayscale | ColorType::Indexed => Bands::Grey,
        ColorType::GrayscaleAlpha => Bands::GreyAlpha,
        ColorType::Rgb => Bands::Rgb,
        ColorType::Rgba => Bands::RgbAlpha,
    };
    let form = SampleForm { bands, bits: if depth == BitDepth::Sixteen { 16 } else { 8 } };
    let mut image = Image::new(width as usize, height as usize);
    if is_interlaced {
        let size = reader.output_buffer_size().ok_or_else(|| damaged("its size is not possible"))?;
        if size / MAX_RATIO > bytes.len() {
            return Err(truncated(&format!("{width} x {height} pixels cannot be in {} bytes", bytes.len())));
        }
        let mut frame = vec![0; size];
        reader.next_frame(&mut frame).map_err(fault)?;
        image.push(&frame, form);
    } else {
        // Row by row, so that memory grows with what the file really holds.
        while let Some(row) = reader.next_row().map_err(fault)? {
            image.push(row.data(), form);
        }
    }
    // The rest of the file, to its end: a copy that stopped early shows there.
    reader.finish().map_err(fault)?;
    let info = reader.info();
    let exif = info.exif_metadata.as_deref().map(Exif::read).unwrap_or_default();
    upright(exif.orientation)?;
    let dims = info.pixel_dims.filter(|d| d.unit == Unit::Meter && d.xppu > 0 && d.yppu > 0);
    let stated = dims.map(|d| [d.xppu, d.yppu].map(|v| f64::from(v) / 1000.0));
    image.whole().map(|i| i.with_resolution(stated.or(exif.resolution)))
}

fn fault(e: DecodingError) -> Diag {
    match e {
        DecodingError::IoError(e) if e.kind() == std::io::ErrorKind::UnexpectedEof => truncated("its data are cut"),
        DecodingError::LimitsExceeded => damaged("it needs more memory than its size explains"),
        DecodingError::Format(e) if e.to_string().starts_with("CRC") => damaged("a check sum is wrong"),
        e => damaged(&e.to_string()),
    }
}
