//! Greyscale and other PNG files, written chunk by chunk: also such as no encoder writes.

use std::io::{Read, Write};

use flate2::write::ZlibEncoder;
use flate2::{Compression, Crc};

/// The signature of a PNG file.
pub const SIGNATURE: [u8; 8] = *b"\x89PNG\r\n\x1a\n";

/// Kinds of samples, as IHDR has them.
#[derive(Clone, Copy)]
pub enum Colour {
    Grey = 0,
    Palette = 3,
    GreyAlpha = 4,
    Rgba = 6,
}

/// A chunk with its length and check sum.
pub fn chunk(name: &[u8; 4], data: &[u8]) -> Vec<u8> {
    let mut crc = Crc::new();
    crc.update(name);
    crc.update(data);
    let length = u32::try_from(data.len()).expect("a short chunk").to_be_bytes();
    [&length[..], name, data, &crc.sum().to_be_bytes()].concat()
}

/// Signature and header, and a palette where the samples are indices.
pub fn head([width, height]: [u32; 2], depth: u8, colour: Colour, interlaced: bool) -> Vec<u8> {
    let header =
        [&width.to_be_bytes()[..], &height.to_be_bytes(), &[depth, colour as u8, 0, 0, interlaced.into()]].concat();
    let palette = if matches!(colour, Colour::Palette) { chunk(b"PLTE", &[0; 48]) } else { Vec::new() };
    [SIGNATURE.to_vec(), chunk(b"IHDR", &header), palette].concat()
}

/// A zlib stream.
pub fn deflated(mut data: impl Read) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::fast());
    std::io::copy(&mut data, &mut encoder).and_then(|_| encoder.flush()).expect("memory");
    encoder.finish().expect("memory")
}

/// A height map: 16-bit grey samples, row by row.
pub fn height_map(width: usize, samples: &[u16]) -> Vec<u8> {
    grey16(width, samples, false, usize::MAX)
}

/// 16-bit grey samples, row by row or in the seven passes of Adam7, in IDAT chunks of `size` bytes.
pub fn grey16(width: usize, samples: &[u16], interlaced: bool, size: usize) -> Vec<u8> {
    let height = samples.len() / width;
    const ADAM7: [[usize; 4]; 7] =
        [[0, 0, 8, 8], [4, 0, 8, 8], [0, 4, 4, 8], [2, 0, 4, 4], [0, 2, 2, 4], [1, 0, 2, 2], [0, 1, 1, 2]];
    let passes: &[[usize; 4]] = if interlaced { &ADAM7 } else { &[[0, 0, 1, 1]] };
    let mut raw = Vec::new();
    for &[x0, y0, dx, dy] in passes {
        for y in (y0..height).step_by(dy) {
            // Filter type 0: none.
            raw.push(0);
            raw.extend((x0..width).step_by(dx).flat_map(|x| samples[y * width + x].to_be_bytes()));
        }
    }
    let mut out = head([width as u32, height as u32], 16, Colour::Grey, interlaced);
    out.extend(deflated(&raw[..]).chunks(size).flat_map(|part| chunk(b"IDAT", part)));
    out.extend(chunk(b"IEND", b""));
    out
}

/// A square of zeros of another kind of samples.
pub fn zeros(side: u32, depth: u8, colour: Colour) -> Vec<u8> {
    let channels = match colour {
        Colour::Grey | Colour::Palette => 1,
        Colour::GreyAlpha => 2,
        Colour::Rgba => 4,
    };
    let row = 1 + (side as usize * channels * usize::from(depth)).div_ceil(8);
    let data = deflated(&vec![0; side as usize * row][..]);
    [head([side; 2], depth, colour, false), chunk(b"IDAT", &data), chunk(b"IEND", b"")].concat()
}
