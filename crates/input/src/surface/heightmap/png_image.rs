//! PNG height maps.
//!
//! Consumes an 8- or 16-bit greyscale PNG, interlaced or not; samples are nodes of the grid. Promises a
//! whole image: check sums, missing rows and a missing end are faults. The size is checked before
//! anything is allocated; samples take 2 bytes each (interlaced files twice that while they are read).
//! A resolution that differs in x and y is refused. The file's gamma, colour profile and transparent value are not used: a sample is a height.

use std::io::{BufReader, Read, Seek};
use std::path::Path;

use png::{BitDepth, ColorType, Decoder, DecodingError, Limits};

use super::super::lines::{self, place};
use super::super::{Content, Scale};
use super::{Grid, MAX_SAMPLES, Samples, check_size, check_square};
use terrace_core::diag::{Diag, Error, memory, unreadable};

/// What the decoder may allocate for rows and chunks, in bytes.
const DECODER_BYTES: usize = 32 << 20;

/// Reads a height map.
pub(in crate::surface) fn read(path: &Path, scale: &Scale, notes: &mut Vec<Diag>) -> Result<Content, Error> {
    let (mut file, _) = lines::open(path)?;
    let mut head = Vec::with_capacity(8);
    file.by_ref().take(8).read_to_end(&mut head).map_err(|e| unreadable(path, &e))?;
    if head != b"\x89PNG\r\n\x1a\n" {
        return Err(no_png(&head).at(place(path)).into());
    }
    file.rewind().map_err(|e| unreadable(path, &e))?;
    let image = decode(BufReader::with_capacity(1 << 18, file)).map_err(|d| d.at(place(path)))?;
    image.grid().scaled(scale, notes, &place(path)).map_err(|d| d.at(place(path)).into())
}

fn no_png(head: &[u8]) -> Diag {
    let (text, hint) = match lines::foreign(head) {
        _ if head.is_empty() => return Diag::input("surface-empty", "the file is empty").hint("export it again"),
        Some("a PNG image") => {
            ("the PNG signature is damaged".into(), "copy the file again as binary: line ends were changed on its way")
        }
        Some(what) => (format!("this is {what}, not a PNG image"), "save the height map as 16-bit greyscale PNG"),
        None => ("this is not a PNG image".into(), "save the height map as 16-bit greyscale PNG"),
    };
    Diag::input("surface-format", text).hint(hint)
}

/// Samples from the top row down, and the depth they came with.
struct Image {
    columns: usize,
    rows: usize,
    is_8_bit: bool,
    samples: Vec<u16>,
}

impl Image {
    /// Adds rows as the file holds them: one byte each, or two with the high one first.
    fn add(&mut self, bytes: &[u8]) {
        if self.is_8_bit {
            self.samples.extend(bytes.iter().map(|&b| u16::from(b)));
        } else {
            self.samples.extend(bytes.as_chunks::<2>().0.iter().map(|&b| u16::from_be_bytes(b)));
        }
    }

    fn grid(self) -> Grid {
        let Self { columns, rows, is_8_bit, samples } = self;
        let mut samples = Samples::Whole(samples, None);
        samples.flip(columns);
        let full = Some([0.0, if is_8_bit { 255.0 } else { 65_535.0 }]);
        Grid { columns, rows, samples, full, is_8_bit }
    }
}

fn decode(input: impl std::io::BufRead + Seek) -> Result<Image, Diag> {
    let mut decoder = Decoder::new_with_limits(input, Limits { bytes: DECODER_BYTES });
    decoder.set_ignore_text_chunk(true);
    decoder.set_ignore_iccp_chunk(true);
    let info = decoder.read_header_info().map_err(damaged)?;
    let width = info.width;
    let height = info.height;
    let is_interlaced = info.interlaced;
    let is_8_bit = info.bit_depth == BitDepth::Eight;
    check_samples(info.color_type, info.bit_depth)?;
    check_size(width.into(), height.into(), if is_interlaced { MAX_SAMPLES / 2 } else { MAX_SAMPLES })?;
    let (columns, rows) = (width as usize, height as usize);
    // Samples of 16 bits and a class for each cell; while they grow, the samples are there twice.
    memory::ask("the height map", 5 * u64::from(width) * u64::from(height))?;
    let mut image = Image { columns, rows, is_8_bit, samples: Vec::new() };
    let mut reader = decoder.read_info().map_err(damaged)?;
    if is_interlaced {
        let mut frame = vec![0; columns * rows * if is_8_bit { 1 } else { 2 }];
        reader.next_frame(&mut frame).map_err(damaged)?;
        image.add(&frame);
    } else {
        // Row by row, so that memory grows with what the file really holds.
        while let Some(row) = reader.next_row().map_err(damaged)? {
            image.add(row.data());
        }
    }
    // The rest of the file, to its end: a copy that stopped early shows there.
    reader.finish().map_err(damaged)?;
    if let Some(dims) = reader.info().pixel_dims {
        // Samples a length: the more, the smaller the cell.
        let cells = [dims.yppu, dims.xppu].map(f64::from);
        check_square(cells, "the chunk pHYs", "resample the map to square cells, or remove the chunk if it is wrong")?;
    }
    if image.samples.len() == columns * rows {
        Ok(image)
    } else {
        let text = format!("the image holds {} of {} samples", image.samples.len(), columns * rows);
        Err(Diag::input("png-damaged", text).hint("save or copy the image again"))
    }
}

fn check_samples(color: ColorType, depth: BitDepth) -> Result<(), Diag> {
    let what = match (color, depth) {
        (ColorType::Grayscale, BitDepth::Eight | BitDepth::Sixteen) => return Ok(()),
        (ColorType::Grayscale, depth) => format!("{}-bit greyscale", depth as u8),
        (ColorType::GrayscaleAlpha, _) => "greyscale with transparency".into(),
        (ColorType::Rgb, _) => "colour".into(),
        (ColorType::Rgba, _) => "colour with transparency".into(),
        (ColorType::Indexed, _) => "colour from a palette".into(),
    };
    Err(Diag::input("heightmap-samples", format!("a height map is 16- or 8-bit greyscale; this image is {what}"))
        .hint("save it as 16-bit greyscale without transparency"))
}

fn damaged(e: DecodingError) -> Diag {
    let text = match e {
        DecodingError::IoError(e) if e.kind() == std::io::ErrorKind::UnexpectedEof => {
            return Diag::input("png-truncated", "the PNG file ends too early").hint("save or copy the image again");
        }
        DecodingError::LimitsExceeded => "the PNG image needs more memory than its size explains".into(),
        DecodingError::Format(e) if e.to_string().starts_with("CRC") => "a check sum in the PNG image is wrong".into(),
        e => format!("the PNG image is damaged: {e}"),
    };
    Diag::input("png-damaged", text).hint("save or copy the image again")
}

#[cfg(test)]
mod tests {
    use super::super::super::Heightmap;
    use super::*;

    const SCALE: Scale =
        Scale { pixel_mm: 2.0, z_mm: [0.0, 65.535], values: None, nodata: None, origin_mm: [-1.0, 5.0] };

    fn png(width: u32, height: u32, color: ColorType, depth: BitDepth, data: &[u8]) -> Vec<u8> {
        let mut out = vec![];
        let mut encoder = png::Encoder::new(&mut out, width, height);
        encoder.set_color(color);
        encoder.set_depth(depth);
        if color == ColorType::Indexed {
            encoder.set_palette(vec![0; 6]);
        }
        encoder.write_header().and_then(|mut w| w.write_image_data(data)).expect("encoded");
        out
    }

    fn grey16(width: u32, height: u32, v: impl Fn(u32, u32) -> u16) -> Vec<u8> {
        let data: Vec<u8> = (0..height)
            .flat_map(|y| (0..width).map(move |x| (x, y)))
            .flat_map(|(x, y)| v(x, y).to_be_bytes())
            .collect();
        png(width, height, ColorType::Grayscale, BitDepth::Sixteen, &data)
    }

    fn read_bytes(bytes: &[u8], scale: &Scale) -> (Result<Heightmap, Error>, Vec<Diag>) {
        super::super::read_bytes("a.png", read, bytes, scale)
    }

    #[track_caller]
    fn refused(bytes: &[u8], scale: &Scale, code: &str, say: &str) {
        let e = read_bytes(bytes, scale).0.expect_err("refused");
        assert_eq!(e.diags()[0].code, code, "{e}");
        assert!(e.to_string().contains(say) && !e.diags()[0].hint.is_empty(), "{e}");
        assert!(e.diags()[0].place.to_string().ends_with("a.png"), "{e}");
    }

    #[test]
    fn the_top_row_of_the_file_has_the_largest_y() {
        for rows in [4, 5] {
            let (map, notes) = read_bytes(&grey16(3, rows, |x, y| (100 * y + x) as u16), &SCALE);
            let map = map.expect("read");
            assert!(notes.is_empty(), "{notes:?}");
            assert_eq!((map.columns, map.rows), (3, rows as usize));
            for i in 0..3 * rows {
                assert_eq!(map.samples.value(i as usize), Some(f64::from(100 * (rows - 1 - i / 3) + i % 3)));
            }
            assert!((map.z_mm[0] + 401.0 * map.z_mm[1] - 0.401).abs() < 1e-12);
        }
    }

    #[test]
    fn values_and_their_heights_may_run_either_way() {
        let scale = Scale { values: Some([1000.0, 200.0]), z_mm: [1.0, 9.0], nodata: Some(7.0), ..SCALE };
        let (map, _) = read_bytes(&grey16(2, 2, |x, _| if x == 0 { 7 } else { 600 }), &scale);
        let map = map.expect("read");
        assert!((map.z_mm[0] + 600.0 * map.z_mm[1] - 5.0).abs() < 1e-12);
        assert_eq!([0, 1].map(|i| map.samples.value(i)), [None, Some(600.0)]);
    }

    #[test]
    fn eight_bits_and_flat_maps_are_noted() {
        let (map, notes) = read_bytes(&png(2, 2, ColorType::Grayscale, BitDepth::Eight, &[0, 255, 3, 4]), &SCALE);
        assert_eq!(map.expect("read").samples, Samples::Whole(vec![3, 4, 0, 255], None));
        assert_eq!(notes[0].code, "heightmap-8-bit");
        assert!(notes[0].message.contains("257.0 um"), "{}", notes[0].message);
        let (map, notes) = read_bytes(&grey16(2, 2, |_, _| 0), &SCALE);
        assert!(map.is_ok());
        assert_eq!(notes[0].code, "heightmap-flat");
    }

    #[test]
    fn files_that_are_no_height_map_are_refused() {
        let gray = ColorType::Grayscale;
        for (color, depth, data, say) in [
            (ColorType::Rgb, BitDepth::Eight, &[0; 12][..], "this image is colour"),
            (ColorType::GrayscaleAlpha, BitDepth::Eight, &[0; 8], "greyscale with transparency"),
            (ColorType::Indexed, BitDepth::Eight, &[0; 4], "palette"),
            (gray, BitDepth::One, &[0; 2], "1-bit greyscale"),
        ] {
            refused(&png(2, 2, color, depth, data), &SCALE, "heightmap-samples", say);
        }
        refused(&png(1, 2, gray, BitDepth::Eight, &[0; 2]), &SCALE, "heightmap-size", "1 x 2");
        refused(b"", &SCALE, "surface-empty", "empty");
        refused(b"\xff\xd8\xff\xe0", &SCALE, "surface-format", "JPEG");
        refused(b"\x89PNG\n\x1a\nIHDR", &SCALE, "surface-format", "signature");
        let whole = grey16(20, 20, |x, y| (x * y * 977) as u16);
        for cut in [9, 30, 45, whole.len() / 2, whole.len() - 12, whole.len() - 1] {
            refused(&whole[..cut], &SCALE, "png-truncated", "too early");
        }
        let mut flipped = whole.clone();
        flipped[whole.len() / 2] ^= 16;
        refused(&flipped, &SCALE, "png-damaged", "check sum");
    }

    #[test]
    fn a_scale_that_does_not_fit_the_file_is_refused() {
        let map = grey16(3, 3, |x, _| x as u16);
        let byte = png(2, 2, ColorType::Grayscale, BitDepth::Eight, &[1; 4]);
        refused(&map, &Scale { values: Some([5.0, 5.0]), ..SCALE }, "heightmap-scale", "both 5");
        refused(&byte, &Scale { values: Some([0.0, 65_535.0]), ..SCALE }, "heightmap-scale", "from 0 to 255");
        refused(&byte, &Scale { nodata: Some(256.0), ..SCALE }, "heightmap-scale", "nodata 256");
        refused(&byte, &Scale { nodata: Some(0.5), ..SCALE }, "heightmap-scale", "nodata 0.5");
        refused(&byte, &Scale { nodata: Some(1.0), ..SCALE }, "heightmap-empty", "every sample is nodata");
        refused(&map, &Scale { pixel_mm: 3000.0, ..SCALE }, "surface-size", "5999, 6005");
        refused(&map, &Scale { pixel_mm: f64::NAN, ..SCALE }, "heightmap-scale", "scale of the height map is invalid");
        let (_, notes) = read_bytes(&map, &Scale { pixel_mm: 0.1, z_mm: [0.0, 1.0], ..SCALE });
        assert_eq!(notes[0].code, "surface-tiny");
    }

    #[test]
    fn cells_that_are_not_square_are_refused() {
        let of = |xppu, yppu, unit| {
            let mut out = vec![];
            let mut encoder = png::Encoder::new(&mut out, 2, 2);
            encoder.set_color(ColorType::Grayscale);
            encoder.set_depth(BitDepth::Sixteen);
            encoder.set_pixel_dims(Some(png::PixelDimensions { xppu, yppu, unit }));
            encoder.write_header().and_then(|mut w| w.write_image_data(&[1, 2, 3, 4, 5, 6, 7, 8])).expect("encoded");
            out
        };
        for unit in [png::Unit::Meter, png::Unit::Unspecified] {
            assert!(read_bytes(&of(3937, 3937, unit), &SCALE).0.is_ok());
            refused(
                &of(5906, 2953, unit),
                &SCALE,
                "heightmap-cells",
                "by the chunk pHYs its cells are 0.5000 times as wide",
            );
        }
        assert!(read_bytes(&of(0, 7, png::Unit::Meter), &SCALE).0.is_ok(), "nothing is stated");
    }
}
