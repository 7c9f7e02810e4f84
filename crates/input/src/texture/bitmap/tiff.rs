//! TIFF: the first image; grey of 1 to 16 bits and colour of 8 or 16, in strips or tiles; plain, PackBits, LZW,
//! Deflate, fax and JPEG. `tiff_tags` says which tags are used.

use tiff::ColorType;
use tiff::decoder::{Decoder, DecodingResult, Limits};
use tiff::tags::Tag;

use super::image::{Bands, Image, SampleForm, WHITE, check_size, damaged, truncated, unread, upright};
use super::tiff_tags::{self, TiffDecoder, fault};
use terrace_core::diag::Diag;

/// What the decoder may take for the list of strips or tiles, and for one of them, in bytes.
const LIST_BYTES: usize = 16 << 20;
const STRIP_BYTES: usize = 256 << 20;

/// The compression JPEG.
const JPEG: u16 = 7;

/// Most bytes that one of the file stands for: LZW reaches some 2500, Deflate 1032.
const MAX_RATIO: u64 = 4096;

pub(super) fn decode(bytes: &[u8]) -> Result<Image, Diag> {
    let mut decoder = reader(bytes)?;
    match short(&mut decoder, Tag::FillOrder)? {
        None | Some(1) => read(bytes, decoder),
        Some(2) => {
            let high_bit_first = with_high_bit_first(bytes, &mut decoder)?;
            read(&high_bit_first, reader(&high_bit_first)?)
        }
        Some(order) => Err(unread(&format!("a TIFF whose tag FillOrder is {order}"))),
    }
}

fn reader(bytes: &[u8]) -> Result<TiffDecoder<'_>, Diag> {
    let mut limits = Limits::default();
    limits.ifd_value_size = LIST_BYTES;
    limits.intermediate_buffer_size = STRIP_BYTES;
    limits.decoding_buffer_size = STRIP_BYTES;
    Ok(Decoder::new(std::io::Cursor::new(bytes)).map_err(fault)?.with_limits(limits))
}

/// The file with the bits of each byte of its strips or tiles in reverse: TIFF 6.0 has FillOrder 2 turn the bits of the
/// data as they are stored, so before they are decoded, whatever their compression. JPEG data have an order of their
/// own and stay (as in libtiff).
fn with_high_bit_first(bytes: &[u8], decoder: &mut TiffDecoder<'_>) -> Result<Vec<u8>, Diag> {
    let mut out = bytes.to_vec();
    if short(decoder, Tag::Compression)? == Some(JPEG) {
        return Ok(out);
    }
    let mut list = |tag| decoder.find_tag_unsigned_vec::<u64>(tag).map_err(fault).map(Option::unwrap_or_default);
    let [offsets, counts] = match list(Tag::TileOffsets)? {
        tiles if !tiles.is_empty() => [tiles, list(Tag::TileByteCounts)?],
        _ => [list(Tag::StripOffsets)?, list(Tag::StripByteCounts)?],
    };
    let mut ranges: Vec<(u64, u64)> = offsets.into_iter().zip(counts).collect();
    ranges.sort_unstable();
    let mut end = 0;
    for (offset, count) in ranges {
        if offset < end {
            return Err(damaged("its strips or tiles overlap"));
        }
        end = offset.saturating_add(count);
        // What lies beyond the file is found when it is decoded.
        let index = |v: u64| usize::try_from(v).unwrap_or(usize::MAX).min(bytes.len());
        out[index(offset)..index(end)].iter_mut().for_each(|b| *b = b.reverse_bits());
    }
    Ok(out)
}

fn read(bytes: &[u8], mut decoder: TiffDecoder<'_>) -> Result<Image, Diag> {
    let (width, height) = decoder.dimensions().map_err(fault)?;
    check_size(width.into(), height.into(), 1)?;
    let (bands, bits) = form(&mut decoder)?;
    tiff_tags::check(&mut decoder, bits)?;
    let size = u64::from(width) * u64::from(height);
    // Fax packs blank rows without bound.
    let is_fax = matches!(short(&mut decoder, Tag::Compression)?, Some(2..=4));
    if !is_fax && size * u64::from(bits) * bands.count() as u64 / 8 > bytes.len() as u64 * MAX_RATIO {
        return Err(truncated(&format!("{width} x {height} pixels cannot be in {} bytes", bytes.len())));
    }
    upright(short(&mut decoder, Tag::Orientation)?)?;
    if bands.count() > 1 && short(&mut decoder, Tag::PlanarConfiguration)? == Some(2) {
        return Err(unread("a TIFF with its colours in separate planes"));
    }
    let resolution = resolution(&mut decoder)?;
    let mut image = Image::new(width as usize, height as usize);
    image.samples = vec![WHITE; image.columns * image.rows];
    let (w, h) = decoder.chunk_dimensions();
    if w == 0 || h == 0 {
        return Err(damaged("its strips or tiles have no size"));
    }
    let across = width.div_ceil(w);
    for chunk in 0..across * height.div_ceil(h) {
        let (columns, rows) = decoder.chunk_data_dimensions(chunk);
        let mut tile = Image::new(columns as usize, rows as usize);
        match decoder.read_chunk(chunk).map_err(fault)? {
            DecodingResult::U8(v) if bits < 8 => unpack(&v, bits, &mut tile),
            DecodingResult::U8(v) => tile.push(&v, SampleForm { bands, bits: 8 }),
            DecodingResult::U16(v) => {
                let bytes: Vec<u8> = v.iter().flat_map(|v| v.to_be_bytes()).collect();
                tile.push(&bytes, SampleForm { bands, bits: 16 });
            }
            _ => return Err(unread("a TIFF whose samples have a sign or are not whole numbers")),
        }
        let tile = tile.whole()?;
        let x = (chunk % across * w) as usize;
        let y = (chunk / across * h) as usize;
        for (row, from) in tile.samples.chunks_exact(tile.columns).enumerate() {
            image.samples[(y + row) * image.columns + x..][..tile.columns].copy_from_slice(from);
        }
    }
    if decoder.more_images() {
        let d = Diag::warning("bitmap-pages", "the file holds more than one image; the first is used");
        image.notes.push(d.hint("save the image that is to be marked in a file of its own"));
    }
    Ok(image.with_resolution(resolution))
}

/// Bands and bits of a pixel that is read.
fn form(decoder: &mut TiffDecoder<'_>) -> Result<(Bands, u8), Diag> {
    // 3 is a palette, which the decoder does not know.
    if short(decoder, Tag::PhotometricInterpretation)? == Some(3) {
        return Err(unread("a TIFF with a palette"));
    }
    let is_jpeg = short(decoder, Tag::Compression)? == Some(JPEG);
    let has_alpha = match decoder.find_tag_unsigned_vec::<u16>(Tag::ExtraSamples).map_err(fault)?.as_deref() {
        Some([1, ..]) => return Err(unread("a TIFF whose colours are multiplied by their opacity")),
        extra => extra == Some(&[2]),
    };
    Ok(match decoder.colortype().map_err(fault)? {
        ColorType::Gray(bits @ (1 | 2 | 4 | 8 | 16)) => (Bands::Grey, bits),
        ColorType::RGB(bits @ (8 | 16)) => (Bands::Rgb, bits),
        ColorType::RGBA(bits @ (8 | 16)) => (Bands::RgbAlpha, bits),
        ColorType::Multiband { bit_depth: bits @ (8 | 16), num_samples: 2 } if has_alpha => (Bands::GreyAlpha, bits),
        ColorType::YCbCr(8) if is_jpeg => (Bands::Luma, 8),
        other => return Err(unread(&format!("a TIFF of {} bits in {} bands", other.bit_depth(), other.num_samples()))),
    })
}

/// Samples of fewer than 8 bits; each row begins with a byte.
fn unpack(bytes: &[u8], bits: u8, tile: &mut Image) {
    let per_byte = usize::from(8 / bits);
    let most = (1u16 << bits) - 1;
    for row in bytes.chunks_exact(tile.columns.div_ceil(per_byte)).take(tile.rows) {
        let sample = |i: usize| u16::from(row[i / per_byte] >> (8 - bits as usize * (i % per_byte + 1))) & most;
        tile.samples.extend((0..tile.columns).map(|i| sample(i) * (WHITE / most)));
    }
}

fn short(decoder: &mut TiffDecoder<'_>, tag: Tag) -> Result<Option<u16>, Diag> {
    decoder.find_tag_unsigned::<u16>(tag).map_err(fault)
}

/// Pixels in a mm, where the file states them per inch or cm.
fn resolution(decoder: &mut TiffDecoder<'_>) -> Result<Option<[f64; 2]>, Diag> {
    let mm = match short(decoder, Tag::ResolutionUnit)? {
        None | Some(2) => 25.4,
        Some(3) => 10.0,
        _ => return Ok(None),
    };
    let sides = [ratio(decoder, Tag::XResolution)?, ratio(decoder, Tag::YResolution)?];
    Ok(if let [Some(x), Some(y)] = sides { Some([x / mm, y / mm]) } else { None })
}

/// The rational number of a tag.
fn ratio(decoder: &mut TiffDecoder<'_>, tag: Tag) -> Result<Option<f64>, Diag> {
    let ratio = decoder.find_tag_unsigned_vec::<u32>(tag).map_err(fault)?;
    Ok(ratio.and_then(|v| if let [n, d] = v[..] { Some(f64::from(n) / f64::from(d)) } else { None }))
}
