//! BMP of Windows: palettes of 1 to 8 bits, and colour of 16, 24 and 32 bits. Files of OS/2 and run-length coded ones
//! are refused: no program has written them for decades.
//!
//! Read here and not by a crate: those at hand take the spare byte of plain 32-bit pixels for their opacity, which
//! makes whole pictures white, and fill what a truncated file lacks.

use super::image::{Image, WHITE, check_size, damaged, luma, over_white, truncated, unread};
use terrace_core::diag::Diag;

/// What the two headers of a file say.
struct Header {
    columns: usize,
    rows: usize,
    is_top_down: bool,
    bits: u16,
    packing: Packing,
    /// Where the pixels begin.
    start: usize,
    /// Pixels in a mm.
    resolution: Option<[f64; 2]>,
}

enum Packing {
    Palette(Vec<u16>),
    /// Blue, green, red of a byte each.
    Bytes,
    /// The bits of red, green, blue and opacity.
    Masks([u32; 4]),
}

fn bytes<const N: usize>(data: &[u8], at: usize) -> Result<[u8; N], Diag> {
    let part = at.checked_add(N).and_then(|end| data.get(at..end));
    part.and_then(|b| b.try_into().ok()).ok_or_else(|| truncated("its header is cut"))
}

fn short(data: &[u8], at: usize) -> Result<u16, Diag> {
    bytes(data, at).map(u16::from_le_bytes)
}

fn long(data: &[u8], at: usize) -> Result<u32, Diag> {
    bytes(data, at).map(u32::from_le_bytes)
}

pub(super) fn decode(data: &[u8]) -> Result<Image, Diag> {
    let mut header = header(data)?;
    if let Packing::Masks(masks) = header.packing
        && !header.holds(data, masks[3])?
    {
        // Not one pixel would be seen: the byte is spare after all.
        header.packing = Packing::Masks([masks[0], masks[1], masks[2], 0]);
    }
    let Header { columns, rows, bits, .. } = header;
    let mut image = Image::new(columns, rows);
    for row in 0..rows {
        push(header.line(data, row)?, &header.packing, bits, columns, &mut image)?;
    }
    if !header.is_top_down {
        image.flip();
    }
    image.whole().map(|i| i.with_resolution(header.resolution))
}

impl Header {
    /// The bytes of a row, in the order of the file.
    fn line<'a>(&self, data: &'a [u8], row: usize) -> Result<&'a [u8], Diag> {
        let length = (self.columns * usize::from(self.bits)).div_ceil(8);
        // Of the last row the bytes that fill it up may be missing.
        let at = self.start + row * length.next_multiple_of(4);
        data.get(at..at + length).ok_or_else(|| truncated(&format!("{row} of {} rows are there", self.rows)))
    }

    /// Whether a pixel has a bit of the mask.
    fn holds(&self, data: &[u8], mask: u32) -> Result<bool, Diag> {
        for row in (0..self.rows).filter(|_| mask != 0) {
            if self.line(data, row)?.chunks_exact(usize::from(self.bits / 8)).any(|p| pixel(p) & mask != 0) {
                return Ok(true);
            }
        }
        Ok(false)
    }
}

/// The bytes of a pixel, the lowest first.
fn pixel(bytes: &[u8]) -> u32 {
    bytes.iter().rev().fold(0, |v, &b| v << 8 | u32::from(b))
}

fn header(data: &[u8]) -> Result<Header, Diag> {
    let start = long(data, 10)? as usize;
    let size = long(data, 14)? as usize;
    if matches!(size, 12 | 16 | 64) {
        return Err(unread("a BMP of OS/2"));
    }
    if !matches!(size, 40 | 52 | 56 | 108 | 124) {
        return Err(damaged(&format!("its header has {size} bytes")));
    }
    // Stored with a sign; rows below zero begin with the uppermost.
    let columns = i64::from(long(data, 18)?.cast_signed());
    let rows = i64::from(long(data, 22)?.cast_signed());
    let bits = short(data, 28)?;
    check_size(columns.max(0).unsigned_abs(), rows.unsigned_abs(), 1)?;
    let compression = long(data, 30)?;
    let packing = match (bits, compression) {
        (1 | 2 | 4 | 8, 0) => Packing::Palette(palette(data, size, bits)?),
        (24, 0) => Packing::Bytes,
        (16, 0) => Packing::Masks([0x7c00, 0x03e0, 0x001f, 0]),
        (32, 0) => Packing::Masks([0xff_0000, 0xff00, 0xff, 0]),
        (16 | 32, 3 | 6) => {
            let has_alpha = compression == 6 || size >= 56;
            let [r, g, b] = [long(data, 54)?, long(data, 58)?, long(data, 62)?];
            Packing::Masks([r, g, b, if has_alpha { long(data, 66)? } else { 0 }])
        }
        (8, 1) | (4, 2) => return Err(unread("a run-length coded BMP")),
        _ => return Err(unread(&format!("a BMP of {bits} bits with compression {compression}"))),
    };
    let resolution = [long(data, 38)?, long(data, 42)?];
    Ok(Header {
        columns: columns as usize,
        rows: rows.unsigned_abs() as usize,
        is_top_down: rows < 0,
        bits,
        packing,
        start,
        resolution: Some(resolution.map(|per_m| f64::from(per_m.cast_signed()) / 1000.0)),
    })
}

/// The greys of a palette, which follows the header.
fn palette(data: &[u8], size: usize, bits: u16) -> Result<Vec<u16>, Diag> {
    let most = 1usize << bits;
    let used = long(data, 46)? as usize;
    let count = if used == 0 { most } else { used.min(most) };
    (0..count)
        .map(|k| {
            let [b, g, r] = bytes(data, 14 + size + 4 * k)?;
            Ok(luma([r, g, b].map(|v| u16::from(v) * 257)))
        })
        .collect()
}

fn colour(palette: &[u16], index: u8) -> Result<u16, Diag> {
    palette
        .get(usize::from(index))
        .copied()
        .ok_or_else(|| damaged(&format!("a pixel has colour {index} of a palette of {}", palette.len())))
}

/// Appends a row.
fn push(line: &[u8], packing: &Packing, bits: u16, columns: usize, image: &mut Image) -> Result<(), Diag> {
    match packing {
        Packing::Palette(palette) => {
            let bits = usize::from(bits);
            let per_byte = 8 / bits;
            for i in 0..columns {
                let index = line[i / per_byte] >> (8 - bits * (i % per_byte + 1)) & (0xff >> (8 - bits)) as u8;
                image.samples.push(colour(palette, index)?);
            }
        }
        Packing::Bytes => {
            image.samples.extend(line.chunks_exact(3).map(|p| luma([p[2], p[1], p[0]].map(|v| u16::from(v) * 257))));
        }
        Packing::Masks(masks) => {
            image.samples.extend(line.chunks_exact(usize::from(bits / 8)).map(|p| {
                let [r, g, b, a] = masks.map(|mask| band(pixel(p), mask));
                over_white(luma([r, g, b].map(|v| v.unwrap_or(0))), a.unwrap_or(WHITE))
            }));
        }
    }
    Ok(())
}

/// The bits of a mask as 16; None without a mask.
fn band(pixel: u32, mask: u32) -> Option<u16> {
    let most = mask >> mask.trailing_zeros().min(31);
    let value = u64::from((pixel & mask) >> mask.trailing_zeros().min(31));
    (mask != 0).then(|| (value * u64::from(WHITE) / u64::from(most)) as u16)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A file with a header of 40 bytes, or of more where it has masks.
    fn file(size: [i32; 2], bits: u16, compression: u32, masks: &[u32], palette: &[[u8; 4]], pixels: &[u8]) -> Vec<u8> {
        let length = 40 + 4 * masks.len() as u32;
        let start = 14 + length + 4 * palette.len() as u32;
        let mut out = b"BM".to_vec();
        out.extend([start + pixels.len() as u32, 0, start, length].iter().flat_map(|v| v.to_le_bytes()));
        out.extend(size.iter().flat_map(|v| v.to_le_bytes()));
        out.extend([1, bits].iter().flat_map(|v| v.to_le_bytes()));
        out.extend([compression, 0, 11_811, 11_811, palette.len() as u32, 0].iter().flat_map(|v| v.to_le_bytes()));
        out.extend(masks.iter().flat_map(|v| v.to_le_bytes()));
        out.extend(palette.iter().flatten());
        out.extend(pixels);
        out
    }

    const INK: [[u8; 4]; 2] = [[255, 255, 255, 0], [0; 4]];

    #[test]
    fn every_kind_of_pixels_is_read() {
        let [w, k, red] = [WHITE, 0, luma([WHITE, 0, 0])];
        let masks = [0xff_0000, 0xff00, 0xff, 0xff00_0000];
        let rgb = [0, 0, 255, 255, 255, 255, 0, 0, 0, 0, 0, 0, 0, 0];
        for (name, data, want) in [
            ("1 bit", file([3, 2], 1, 0, &[], &INK, &[0b0100_0000, 0, 0, 0, 0b1110_0000, 0, 0, 0]), [k, k, k, w, k, w]),
            ("top down", file([3, -2], 1, 0, &[], &INK, &[0b0100_0000, 0, 0, 0, 0b1110_0000]), [w, k, w, k, k, k]),
            ("4 bits", file([3, 2], 4, 0, &[], &INK, &[0x01, 0x10, 0, 0, 0x11, 0, 0, 0]), [k, k, w, w, k, k]),
            ("8 bits", file([3, 2], 8, 0, &[], &INK, &[0, 1, 0, 0, 1, 1, 1, 0]), [k, k, k, w, k, w]),
            ("24 bits", file([2, 2], 24, 0, &[], &[], &rgb), [k, k, red, w, 0, 0]),
            ("32 bits", file([2, 1], 32, 0, &[], &[], &[0, 0, 255, 0, 0, 0, 0, 0]), [red, k, 0, 0, 0, 0]),
            ("opacity", file([2, 1], 32, 3, &masks, &[], &[0, 0, 0, 255, 0, 0, 0, 0]), [k, w, 0, 0, 0, 0]),
            ("spare byte", file([2, 1], 32, 3, &masks, &[], &[0, 0, 0, 0, 255, 255, 255, 0]), [k, w, 0, 0, 0, 0]),
            ("16 bits", file([2, 1], 16, 0, &[], &[], &[0, 0x7c, 0xff, 0x7f]), [red, w, 0, 0, 0, 0]),
        ] {
            let image = decode(&data).unwrap_or_else(|d| panic!("{name}: {d}"));
            assert_eq!(image.samples, want[..image.columns * image.rows], "{name}");
            assert!((image.resolution.expect("stated")[0] * 25.4 - 300.0).abs() < 0.01);
        }
    }

    #[test]
    fn damaged_files_are_refused() {
        let whole = file([3, 2], 8, 0, &[], &INK, &[0, 1, 0, 0, 1, 1, 1, 0]);
        for cut in 2..whole.len() - 1 {
            assert_eq!(decode(&whole[..cut]).expect_err("cut").code, "bitmap-truncated", "{cut}");
        }
        for (data, code) in [
            (file([1, 1], 8, 0, &[], &INK, &[2, 0, 0, 0]), "bitmap-damaged"),
            (file([-1, 1], 8, 0, &[], &INK, &[0; 4]), "bitmap-damaged"),
            (file([i32::MAX, i32::MIN], 8, 0, &[], &INK, &[0; 4]), "bitmap-large"),
            (file([2, 1], 8, 1, &[], &INK, &[2, 1, 0, 1]), "bitmap-samples"),
            (file([2, 1], 4, 2, &[], &INK, &[2, 1, 0, 1]), "bitmap-samples"),
            (file([2, 1], 8, 4, &[], &INK, &[0; 4]), "bitmap-samples"),
        ] {
            assert_eq!(decode(&data).expect_err("refused").code, code);
        }
        let mut of_os2 = whole.clone();
        of_os2[14] = 12;
        assert!(decode(&of_os2).expect_err("refused").message.contains("OS/2"));
        // Whatever byte is wrong: an answer, and no panic.
        for at in 2..whole.len() {
            for value in [0, 1, 0x7f, 0x80, 0xff] {
                let mut data = whole.clone();
                data[at] = value;
                let _ = decode(&data);
            }
        }
    }
}
