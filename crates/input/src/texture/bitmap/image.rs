//! The samples of a bitmap as one grey each.

use super::MAX_PIXELS;
use terrace_core::diag::{Diag, memory};

/// The sample of white.
pub(super) const WHITE: u16 = u16::MAX;

/// A decoded bitmap: rows from the top, each from the left, 0 black and 65535 white.
#[derive(Debug)]
pub struct Image {
    /// Pixels in a row.
    pub columns: usize,
    /// Rows.
    pub rows: usize,
    /// One grey for each pixel.
    pub samples: Vec<u16>,
    /// Pixels in a mm along x and y, as the file states them.
    pub resolution: Option<[f64; 2]>,
    /// What the user should know of the file.
    pub(in crate::texture) notes: Vec<Diag>,
}

impl Image {
    /// An image without rows, to which `columns * rows` samples are pushed.
    pub(super) fn new(columns: usize, rows: usize) -> Self {
        Self { columns, rows, samples: Vec::new(), resolution: None, notes: Vec::new() }
    }

    /// Takes the resolution that a file states where it is one.
    pub(super) fn with_resolution(mut self, per_mm: Option<[f64; 2]>) -> Self {
        self.resolution = per_mm.filter(|r| r.iter().all(|v| v.is_finite() && *v > 0.0));
        self
    }

    /// Adds pixels as a file holds them.
    pub(super) fn push(&mut self, bytes: &[u8], form: SampleForm) {
        let wide = |b: &[u8], k: usize| match form.bits {
            8 => u16::from(b[k]) * 257,
            _ => u16::from_be_bytes([b[2 * k], b[2 * k + 1]]),
        };
        let pixels = bytes.chunks_exact(form.bands.count() * usize::from(form.bits / 8));
        self.samples.extend(pixels.map(|p| {
            let grey = match form.bands {
                Bands::Grey | Bands::GreyAlpha | Bands::Luma => wide(p, 0),
                Bands::Rgb | Bands::RgbAlpha => luma([0, 1, 2].map(|k| wide(p, k))),
            };
            match form.bands {
                Bands::GreyAlpha => over_white(grey, wide(p, 1)),
                Bands::RgbAlpha => over_white(grey, wide(p, 3)),
                _ => grey,
            }
        }));
    }

    /// The image, where all its samples are there.
    pub(super) fn whole(self) -> Result<Self, Diag> {
        let have = self.samples.len();
        let want = self.columns * self.rows;
        if have == want { Ok(self) } else { Err(truncated(&format!("{have} of {want} pixels are there"))) }
    }

    /// Turns the rows of a file that begins with the lowest.
    pub(super) fn flip(&mut self) {
        for row in 0..self.rows / 2 {
            let (top, rest) = self.samples.split_at_mut((self.rows - 1 - row) * self.columns);
            top[row * self.columns..][..self.columns].swap_with_slice(&mut rest[..self.columns]);
        }
    }
}

/// How a pixel is stored: 8 or 16 bits a band, the high byte first.
#[derive(Clone, Copy, Debug)]
pub(super) struct SampleForm {
    pub(super) bands: Bands,
    pub(super) bits: u8,
}

/// The bands of a pixel, in their order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Bands {
    Grey,
    GreyAlpha,
    Rgb,
    RgbAlpha,
    /// Grey, and two bands of colour that are not needed.
    Luma,
}

impl Bands {
    pub(super) fn count(self) -> usize {
        match self {
            Self::Grey => 1,
            Self::GreyAlpha => 2,
            Self::Rgb | Self::Luma => 3,
            Self::RgbAlpha => 4,
        }
    }
}

/// The grey of a colour: Y' of ITU-R BT.601, as in JPEG.
pub(super) fn luma([r, g, b]: [u16; 3]) -> u16 {
    ((299 * u32::from(r) + 587 * u32::from(g) + 114 * u32::from(b) + 500) / 1000) as u16
}

/// A grey of an opacity over white.
pub(super) fn over_white(grey: u16, alpha: u16) -> u16 {
    let white = u64::from(WHITE);
    let alpha = u64::from(alpha);
    ((u64::from(grey) * alpha + white * (white - alpha) + white / 2) / white) as u16
}

/// Refuses sizes that are not read, before anything is allocated; `bytes` is what a pixel takes while it is decoded.
pub(super) fn check_size(columns: u64, rows: u64, bytes: u64) -> Result<(), Diag> {
    if columns == 0 || rows == 0 {
        return Err(damaged(&format!("it has {columns} x {rows} pixels")));
    }
    let pixels = columns.saturating_mul(rows);
    if pixels > MAX_PIXELS {
        let text = format!("the bitmap has {columns} x {rows} pixels, more than {} million", MAX_PIXELS / 1_000_000);
        return Err(Diag::limit("bitmap-large", text).hint("save it coarser: pixels finer than the spot are not seen"));
    }
    memory::ask("the bitmap", pixels * (bytes + 2))
}

/// What is said where an EXIF or TIFF orientation asks viewers to turn the image.
pub(super) fn upright(orientation: Option<u16>) -> Result<(), Diag> {
    match orientation {
        None | Some(0 | 1) => Ok(()),
        Some(o) => {
            let text = format!("the bitmap is stored turned or mirrored (orientation {o}), and viewers turn it back");
            Err(Diag::input("bitmap-turned", text).hint("open it and save it again upright, without that tag"))
        }
    }
}

const AGAIN: &str = "save or copy the bitmap again";

pub(super) fn damaged(what: &str) -> Diag {
    Diag::input("bitmap-damaged", format!("the bitmap is damaged: {what}")).hint(AGAIN)
}

pub(super) fn truncated(what: &str) -> Diag {
    Diag::input("bitmap-truncated", format!("the bitmap ends too early: {what}")).hint(AGAIN)
}

/// What is said of samples that are not read.
pub(super) fn unread(what: &str) -> Diag {
    Diag::input("bitmap-samples", format!("the bitmap is {what}, which is not read"))
        .hint("save it as PNG, grey or colour, of 1 to 16 bits")
}

/// What EXIF data say of a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Exif {
    pub(super) orientation: Option<u16>,
    /// Pixels in a mm along x and y, where they are stated per inch or cm.
    pub(super) resolution: Option<[f64; 2]>,
}

impl Exif {
    /// Reads the first directory of EXIF data, a TIFF in either byte order, with or without their name before them.
    /// What lies beyond the data is not stated.
    pub(super) fn read(data: &[u8]) -> Self {
        let bytes = TiffBytes { is_little: false, data: data.strip_prefix(b"Exif\0\0").unwrap_or(data) };
        let bytes = TiffBytes { is_little: bytes.data.starts_with(b"II"), ..bytes };
        let orientation = bytes.number(0x112);
        let sides = [bytes.ratio(0x11a), bytes.ratio(0x11b)];
        let mm = match bytes.number(0x128) {
            None | Some(2) => 25.4,
            Some(3) => 10.0,
            _ => f64::NAN,
        };
        let resolution = if let [Some(x), Some(y)] = sides { Some([x / mm, y / mm]) } else { None };
        Self { orientation, resolution: resolution.filter(|r| r.iter().all(|v| v.is_finite() && *v > 0.0)) }
    }
}

/// Bytes of a TIFF.
struct TiffBytes<'a> {
    is_little: bool,
    data: &'a [u8],
}

impl TiffBytes<'_> {
    fn array<const N: usize>(&self, at: usize) -> Option<[u8; N]> {
        self.data.get(at..at.checked_add(N)?)?.try_into().ok()
    }

    fn short(&self, at: usize) -> Option<u16> {
        let bytes = self.array(at)?;
        Some(if self.is_little { u16::from_le_bytes(bytes) } else { u16::from_be_bytes(bytes) })
    }

    fn long(&self, at: usize) -> Option<u32> {
        let bytes = self.array(at)?;
        Some(if self.is_little { u32::from_le_bytes(bytes) } else { u32::from_be_bytes(bytes) })
    }

    /// Where the value of a tag, or the place of its value, stands in the first directory.
    fn value(&self, tag: u16) -> Option<usize> {
        let list = self.long(4)? as usize;
        let entry = |k: usize| list.checked_add(2 + 12 * k);
        let number =
            (0..usize::from(self.short(list)?)).find(|&k| entry(k).and_then(|at| self.short(at)) == Some(tag))?;
        // After the tag, the type and the count.
        entry(number).map(|at| at + 8)
    }

    /// The short number of a tag.
    fn number(&self, tag: u16) -> Option<u16> {
        self.short(self.value(tag)?)
    }

    /// The rational number of a tag.
    fn ratio(&self, tag: u16) -> Option<f64> {
        let at = self.long(self.value(tag)?)? as usize;
        Some(f64::from(self.long(at)?) / f64::from(self.long(at.checked_add(4)?)?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_become_their_luma_over_white() {
        let mut image = Image::new(4, 1);
        image.push(
            &[255, 0, 0, 255, 0, 255, 0, 255, 0, 0, 255, 255, 10, 20, 30, 0],
            SampleForm { bands: Bands::RgbAlpha, bits: 8 },
        );
        let want = [0.299, 0.587, 0.114, 1.0].map(|v| (v * 65_535.0_f64).round() as u16);
        assert_eq!(image.samples, want);
        let mut image = Image::new(2, 1);
        image.push(&[0x12, 0x34, 0xff, 0xff, 0, 0, 0x80, 0], SampleForm { bands: Bands::GreyAlpha, bits: 16 });
        assert_eq!(image.samples, [0x1234, 0x7fff]);
    }

    #[test]
    fn exif_orientations_are_found_in_both_byte_orders() {
        let little = b"Exif\0\0II*\0\x08\0\0\0\x02\0\x0f\x01\x02\0\0\0\0\0\0\0\0\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0";
        let big = b"MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x03\0\0";
        let orientation = |data: &[u8]| Exif::read(data).orientation;
        assert_eq!(orientation(little), Some(6));
        assert_eq!(orientation(big), Some(3));
        for cut in 0..little.len() - 4 {
            assert_eq!(orientation(&little[..cut]), None, "{cut}");
        }
        assert!(upright(Some(6)).is_err() && upright(Some(1)).is_ok() && upright(None).is_ok());
    }

    #[test]
    fn exif_resolutions_are_found_with_their_unit() {
        // 254 along x and 127 along y, of this unit.
        let data = |unit: u16| {
            let mut out = b"MM\0*\0\0\0\x08\0\x03".to_vec();
            for (tag, kind, value) in [(0x11au16, 5u16, 50u32), (0x11b, 5, 58), (0x128, 3, u32::from(unit) << 16)] {
                out.extend([tag.to_be_bytes(), kind.to_be_bytes()].concat());
                out.extend([1u32.to_be_bytes(), value.to_be_bytes()].concat());
            }
            out.extend([0; 4]);
            out.extend([508u32, 2, 127, 1].iter().flat_map(|v| v.to_be_bytes()));
            out
        };
        for (unit, want) in [(2, Some([10.0, 5.0])), (3, Some([25.4, 12.7])), (1, None)] {
            assert_eq!(Exif::read(&data(unit)).resolution, want, "{unit}");
        }
        for cut in 0..data(2).len() {
            assert_eq!(Exif::read(&data(2)[..cut]).resolution, None, "{cut}");
        }
    }
}
