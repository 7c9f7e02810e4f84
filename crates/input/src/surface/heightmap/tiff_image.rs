//! TIFF height maps.
//!
//! Consumes the first image of a TIFF or BigTIFF file: one band of 8, 16 or 32 bits with or without a sign, or of
//! floats, in strips or tiles, plain or packed by Deflate, LZW or PackBits. Samples that are NaN or have the value of
//! the tag GDAL_NODATA are holes. The size is checked before anything is allocated; samples take 2, 4 or 8 bytes each,
//! twice that while types are changed. Scales and places that the file has (GeoTIFF) are not used, but cells that are
//! not square by them are refused.

use std::io::{BufReader, Read, Seek};
use std::path::Path;
use terrace_core::math;

use tiff::decoder::ifd::Value;
use tiff::decoder::{Decoder, DecodingResult, Limits};
use tiff::tags::Tag;
use tiff::{ColorType, TiffError};

use super::super::lines::{self, place, shown};
use super::super::{Content, Scale};
use super::{Grid, MAX_SAMPLES, Samples, check_size, check_square};
use terrace_core::diag::{Diag, Error, memory, unreadable};

/// What the decoder may take for the list of strips or tiles, and for one of them, in bytes.
const LIST_BYTES: usize = 16 << 20;
const STRIP_BYTES: usize = 128 << 20;
/// Most bytes that one of the file stands for: LZW reaches some 2500, Deflate 1032.
const MAX_RATIO: u64 = 4096;

const AGAIN: &str = "save or copy the image again";

/// Reads a height map.
pub(in crate::surface) fn read(path: &Path, scale: &Scale, notes: &mut Vec<Diag>) -> Result<Content, Error> {
    let (mut file, length) = lines::open(path)?;
    let mut head = Vec::with_capacity(8);
    file.by_ref().take(8).read_to_end(&mut head).map_err(|e| unreadable(path, &e))?;
    if ![&b"II*\0"[..], b"MM\0*", b"II+\0", b"MM\0+"].iter().any(|mark| head.starts_with(mark)) {
        return Err(no_tiff(&head).at(place(path)).into());
    }
    file.rewind().map_err(|e| unreadable(path, &e))?;
    let mut found = Vec::new();
    let grid = decode(BufReader::with_capacity(1 << 18, file), length, &mut found);
    let grid = grid.map_err(|d| d.at(place(path)))?;
    notes.extend(found.into_iter().map(|d| d.at(place(path))));
    grid.scaled(scale, notes, &place(path)).map_err(|d| d.at(place(path)).into())
}

fn no_tiff(head: &[u8]) -> Diag {
    if head.is_empty() {
        return Diag::input("surface-empty", "the file is empty").hint("export it again");
    }
    let what = lines::foreign(head).map_or("this is".to_owned(), |what| format!("this is {what},"));
    Diag::input("surface-format", format!("{what} not a TIFF image"))
        .hint("save the height map as TIFF of one band, or as 16-bit greyscale PNG")
}

fn decode(input: impl Read + Seek, length: u64, notes: &mut Vec<Diag>) -> Result<Grid, Diag> {
    let mut limits = Limits::default();
    limits.ifd_value_size = LIST_BYTES;
    limits.intermediate_buffer_size = STRIP_BYTES;
    limits.decoding_buffer_size = usize::try_from(8 * MAX_SAMPLES).unwrap_or(usize::MAX);
    let mut decoder = Decoder::new(input).map_err(damaged)?.with_limits(limits);
    let (width, height) = decoder.dimensions().map_err(damaged)?;
    check_size(width.into(), height.into(), MAX_SAMPLES)?;
    let bits = check_samples(&mut decoder)?;
    let samples = u64::from(width) * u64::from(height);
    if samples.saturating_mul(bits) / 8 > length.saturating_mul(MAX_RATIO) {
        let text = format!("an image of {width} x {height} samples cannot be in a file of {length} bytes");
        return Err(Diag::input("tiff-truncated", text).hint(AGAIN));
    }
    // As decoded, as kept, and a class for each cell.
    memory::ask("the height map", samples * (bits / 8 + 9))?;
    let hole = hole(&mut decoder)?;
    check_cells(&mut decoder)?;
    if decoder.more_images() {
        let d = Diag::warning("tiff-images", "the file holds more than one image; the first is read");
        notes.push(d.hint("overviews and masks are no surface; check that the first image is the height map"));
    }
    let result = decoder.read_image().map_err(damaged)?;
    let (columns, rows) = (width as usize, height as usize);
    let (mut samples, full) = kept(result)?;
    if samples.len() != columns * rows {
        let text = format!("the image holds {} of {} samples", samples.len(), columns * rows);
        return Err(Diag::input("tiff-damaged", text).hint(AGAIN));
    }
    let infinite = (0..samples.len()).find(|&i| samples.value(i).is_some_and(f64::is_infinite));
    if let Some(i) = infinite {
        let text = format!("the sample in column {}, row {} (counted from 0) is infinite", i % columns, i / columns);
        return Err(Diag::input("surface-number", text).hint("make it NaN: such samples are holes"));
    }
    if let Some(v) = hole.filter(|v| full.is_none_or(|[lo, hi]| (lo..=hi).contains(v) && v.fract() == 0.0)) {
        samples.add_hole(v);
    }
    samples.flip(columns);
    Ok(Grid { columns, rows, samples, full, is_8_bit: bits == 8 })
}

/// The bits of a sample; the image has one band, whose values are heights as they are, from the top row down.
fn check_samples<R: Read + Seek>(decoder: &mut Decoder<R>) -> Result<u64, Diag> {
    let photometric = decoder.find_tag_unsigned::<u16>(Tag::PhotometricInterpretation).map_err(damaged)?;
    let orientation = decoder.find_tag_unsigned::<u16>(Tag::Orientation).map_err(damaged)?.unwrap_or(1);
    let fill_order = decoder.find_tag_unsigned::<u16>(Tag::FillOrder).map_err(damaged)?.unwrap_or(1);
    let what = match decoder.colortype().map_err(damaged)? {
        ColorType::Gray(bits @ (8 | 16 | 32 | 64)) => {
            let what = match (photometric, orientation) {
                _ if fill_order != 1 => "stored with the lowest bit of each byte first".to_owned(),
                (Some(0), _) => "stored with white as zero".to_owned(),
                (_, 1) => return Ok(bits.into()),
                (_, orientation) => format!("stored turned (orientation {orientation})"),
            };
            return Err(Diag::input("heightmap-samples", format!("this image is {what}"))
                .hint("save it with black as zero and the first sample at the upper left"));
        }
        ColorType::Gray(bits) => format!("{bits}-bit greyscale"),
        ColorType::Palette(_) => "colour from a palette".into(),
        ColorType::GrayA(_) => "greyscale with transparency".into(),
        ColorType::Multiband { num_samples, .. } => format!("{num_samples} bands"),
        color => format!("colour of {} bands", color.num_samples()),
    };
    Err(Diag::input(
        "heightmap-samples",
        format!("a height map has one band of 8, 16 or 32 bits; this image is {what}"),
    )
    .hint("save the band with the heights alone, as 16- or 32-bit TIFF"))
}

/// Refuses cells that are not square by the resolution, or by the scale or the transformation of GeoTIFF.
fn check_cells<R: Read + Seek>(decoder: &mut Decoder<R>) -> Result<(), Diag> {
    let remedy = "resample the map to square cells, or remove the tags if they are wrong";
    if let [x, y, ..] = numbers(decoder, Tag::ModelPixelScaleTag)?[..] {
        check_square([x, y], "the tag ModelPixelScale", remedy)?;
    }
    // Columns of the matrix are the sides of a cell.
    if let [a, b, _, _, c, d, ..] = numbers(decoder, Tag::ModelTransformationTag)?[..] {
        let what = "the tag ModelTransformation";
        check_square([math::hypot(a, c), math::hypot(b, d)], what, remedy)?;
        if (a * b + c * d).abs() > 1e-6 * math::hypot(a, c) * math::hypot(b, d) {
            let text = format!("by {what} its cells are skewed; a height map has square ones");
            return Err(Diag::input("heightmap-cells", text).hint(remedy));
        }
    }
    let [x, y] = [numbers(decoder, Tag::XResolution)?, numbers(decoder, Tag::YResolution)?].map(|v| v.first().copied());
    // Samples a length: the more, the smaller the cell.
    match (x, y) {
        (Some(x), Some(y)) => check_square([y, x], "the tags XResolution and YResolution", remedy),
        _ => Ok(()),
    }
}

/// The numbers of a tag; none where the file does not have it.
fn numbers<R: Read + Seek>(decoder: &mut Decoder<R>, tag: Tag) -> Result<Vec<f64>, Diag> {
    let value = decoder.find_tag(tag).map_err(damaged)?;
    Ok(value.map(numbers_of).unwrap_or_default())
}

/// The numbers of a value.
fn numbers_of(value: Value) -> Vec<f64> {
    match value {
        Value::List(values) => values.into_iter().flat_map(numbers_of).collect(),
        Value::Rational(n, d) => vec![f64::from(n) / f64::from(d)],
        Value::Double(v) => vec![v],
        Value::Float(v) => vec![v.into()],
        whole => whole.into_u32().map(f64::from).into_iter().collect(),
    }
}

/// The value of the tag GDAL_NODATA.
fn hole<R: Read + Seek>(decoder: &mut Decoder<R>) -> Result<Option<f64>, Diag> {
    let Some(tag) = decoder.find_tag(Tag::GdalNodata).map_err(damaged)? else { return Ok(None) };
    let text = tag.into_string().map_err(damaged)?;
    let text = text.trim_end_matches('\0').trim();
    match text.parse::<f64>() {
        Ok(v) => Ok(Some(v).filter(|v| !v.is_nan())),
        Err(_) if text.is_empty() => Ok(None),
        Err(_) => {
            let text = format!("the tag GDAL_NODATA is \"{}\", which is not a number", shown(text.as_bytes()));
            Err(Diag::input("tiff-damaged", text).hint("save the image again with a number, or without the tag"))
        }
    }
}

/// The samples as they are kept, and the range of their type where it has whole numbers.
fn kept(result: DecodingResult) -> Result<(Samples, Option<[f64; 2]>), Diag> {
    fn range<T: Into<f64>>(lo: T, hi: T) -> Option<[f64; 2]> {
        Some([lo.into(), hi.into()])
    }
    Ok(match result {
        DecodingResult::U8(v) => {
            (Samples::Whole(v.into_iter().map(u16::from).collect(), None), range(u8::MIN, u8::MAX))
        }
        DecodingResult::U16(v) => (Samples::Whole(v, None), range(u16::MIN, u16::MAX)),
        DecodingResult::I8(v) => (Samples::Single(v.into_iter().map(f32::from).collect()), range(i8::MIN, i8::MAX)),
        DecodingResult::I16(v) => (Samples::Single(v.into_iter().map(f32::from).collect()), range(i16::MIN, i16::MAX)),
        DecodingResult::U32(v) => (Samples::Double(v.into_iter().map(f64::from).collect()), range(u32::MIN, u32::MAX)),
        DecodingResult::I32(v) => (Samples::Double(v.into_iter().map(f64::from).collect()), range(i32::MIN, i32::MAX)),
        DecodingResult::F16(v) => (Samples::Single(v.into_iter().map(|v| v.to_f32()).collect()), None),
        DecodingResult::F32(v) => (Samples::Single(v), None),
        DecodingResult::F64(v) => (Samples::Double(v), None),
        DecodingResult::U64(_) | DecodingResult::I64(_) => {
            let text = "whole numbers of 64 bits are not read";
            return Err(Diag::input("heightmap-samples", text).hint("save the heights as 32-bit floats"));
        }
    })
}

fn damaged(e: TiffError) -> Diag {
    let text = match e {
        TiffError::IoError(e) if e.kind() == std::io::ErrorKind::UnexpectedEof => {
            return Diag::input("tiff-truncated", "the TIFF file ends too early").hint(AGAIN);
        }
        TiffError::UnsupportedError(e) => {
            let d = Diag::input("heightmap-samples", format!("the TIFF image is not read: {e}"));
            return d.hint("save it with one band, plain or packed by Deflate or LZW");
        }
        TiffError::LimitsExceeded | TiffError::IntSizeError => {
            "the TIFF image needs more memory than its size explains".into()
        }
        e => format!("the TIFF image is damaged: {e}"),
    };
    Diag::input("tiff-damaged", text).hint(AGAIN)
}

#[cfg(test)]
mod tests {
    use tiff::encoder::colortype::{self, ColorType as Type};
    use tiff::encoder::{Compression, TiffEncoder, TiffValue};

    use super::super::super::Heightmap;
    use super::*;

    const SCALE: Scale =
        Scale { pixel_mm: 2.0, z_mm: [0.0, 100.0], values: Some([0.0, 100.0]), nodata: None, origin_mm: [-1.0, 5.0] };

    /// An image of three columns with these tags.
    fn tiff<T: Type>(data: &[T::Inner], packing: Compression, tags: &[(u16, &str)]) -> Vec<u8>
    where
        [T::Inner]: TiffValue,
    {
        let mut out = std::io::Cursor::new(Vec::new());
        let mut encoder = TiffEncoder::new(&mut out).expect("an encoder").with_compression(packing);
        let samples = T::BITS_PER_SAMPLE.len();
        let mut image = encoder.new_image::<T>(3, (data.len() / samples / 3) as u32).expect("an image");
        for (tag, text) in tags {
            let tag = Tag::from_u16_exhaustive(*tag);
            match text.parse::<u16>() {
                Ok(number) if tag != Tag::GdalNodata => image.encoder().write_tag(tag, number).expect("a tag"),
                _ => image.encoder().write_tag(tag, *text).expect("a tag"),
            }
        }
        image.write_data(data).expect("written");
        out.into_inner()
    }

    fn read_bytes(bytes: &[u8], scale: &Scale) -> (Result<Heightmap, Error>, Vec<Diag>) {
        super::super::read_bytes("a.tif", read, bytes, scale)
    }

    /// The values, the lowest row first.
    fn values(bytes: &[u8], scale: &Scale) -> Vec<Option<f64>> {
        let map = read_bytes(bytes, &Scale { z_mm: [0.0, 1e-6], ..scale.clone() }).0.unwrap_or_else(|e| panic!("{e}"));
        (0..map.samples.len()).map(|i| map.samples.value(i)).collect()
    }

    #[test]
    fn every_type_and_packing_gives_the_values_of_the_file() {
        use colortype::{Gray8, Gray16, Gray32, Gray32Float, Gray64Float, GrayI8, GrayI16, GrayI32};
        let want = |v: [f64; 6]| [v[3], v[4], v[5], v[0], v[1], v[2]].map(Some);
        for packing in [
            Compression::Uncompressed,
            Compression::Lzw,
            Compression::Packbits,
            Compression::Deflate(tiff::encoder::compression::DeflateLevel::Fast),
        ] {
            let of = |bytes: Vec<u8>| values(&bytes, &SCALE);
            assert_eq!(of(tiff::<Gray8>(&[0, 1, 2, 3, 4, 255], packing, &[])), want([0., 1., 2., 3., 4., 255.]));
            assert_eq!(of(tiff::<Gray16>(&[0, 1, 2, 3, 4, 65_535], packing, &[]))[2], Some(65_535.0));
            assert_eq!(of(tiff::<GrayI8>(&[-128, 1, 2, 3, 4, 5], packing, &[]))[3], Some(-128.0));
            assert_eq!(of(tiff::<GrayI16>(&[-9, 1, 2, 3, 4, -5], packing, &[])), want([-9., 1., 2., 3., 4., -5.]));
            assert_eq!(of(tiff::<Gray32>(&[16_777_217, 1, 2, 3, 4, 5], packing, &[]))[3], Some(16_777_217.0));
            assert_eq!(of(tiff::<GrayI32>(&[-16_777_217, 1, 2, 3, 4, 5], packing, &[]))[3], Some(-16_777_217.0));
            let floats = [0.1f32, f32::NAN, 2.5, -3.25, 4.0, 5.0];
            let found = of(tiff::<Gray32Float>(&floats, packing, &[]));
            assert_eq!(found[..], [Some(-3.25), Some(4.0), Some(5.0), Some(f64::from(0.1f32)), None, Some(2.5)]);
            assert_eq!(
                of(tiff::<Gray64Float>(&[0.1, 1.0, 2.0, 3.0, 4.0, f64::NAN], packing, &[]))[2..4],
                [None, Some(0.1)]
            );
        }
    }

    #[test]
    fn holes_are_those_of_the_tag_and_those_of_the_job() {
        use colortype::{Gray16, Gray32Float, GrayI16};
        let plain = Compression::Uncompressed;
        let holes = |bytes: Vec<u8>, nodata| {
            let found = values(&bytes, &Scale { nodata, ..SCALE });
            (0..6).filter(|&i| found[i].is_none()).collect::<Vec<_>>()
        };
        let i16s = |tag: &str| tiff::<GrayI16>(&[1, 2, 3, 4, -32_768, 6], plain, &[(42_113, tag)]);
        assert_eq!(holes(i16s("-32768 "), None), [1]);
        assert_eq!(holes(i16s("-32768"), Some(1.0)), [1, 3]);
        assert_eq!(holes(i16s("nan"), None), [0; 0]);
        // A value that the type cannot have marks nothing.
        assert_eq!(holes(i16s("-99999"), None), [0; 0]);
        let u16s = tiff::<Gray16>(&[1, 0, 3, 4, 5, 6], plain, &[(42_113, "0")]);
        assert_eq!((holes(u16s.clone(), None), holes(u16s, Some(6.0))), (vec![4], vec![2, 4]));
        let floats = tiff::<Gray32Float>(
            &[f32::MIN, 1.0, 2.0, 3.0, 4.0, f32::NAN],
            plain,
            &[(42_113, "-3.4028234663852886e+38")],
        );
        assert_eq!(holes(floats, None), [2, 3]);
    }

    #[test]
    fn files_that_are_no_height_map_are_refused() {
        use colortype::{Gray8, Gray16, Gray32Float, Gray64, RGB8};
        let plain = Compression::Uncompressed;
        let whole = tiff::<Gray16>(&[7; 6], plain, &[]);
        let float = tiff::<Gray32Float>(&[1.0; 6], plain, &[]);
        let none = Scale { values: None, ..SCALE };
        for (bytes, scale, code, say) in [
            (tiff::<RGB8>(&[1; 18], plain, &[]), &SCALE, "heightmap-samples", "colour of 3 bands"),
            (tiff::<Gray64>(&[1; 6], plain, &[]), &SCALE, "heightmap-samples", "64 bits"),
            (tiff::<Gray8>(&[1; 3], plain, &[]), &SCALE, "heightmap-size", "3 x 1"),
            (tiff::<Gray16>(&[7; 6], plain, &[(274, "3")]), &SCALE, "heightmap-samples", "orientation 3"),
            (tiff::<Gray16>(&[7; 6], plain, &[(266, "2")]), &SCALE, "heightmap-samples", "lowest bit"),
            (tiff::<Gray16>(&[7; 6], plain, &[(42_113, "many")]), &SCALE, "tiff-damaged", "\"many\""),
            (
                tiff::<Gray32Float>(&[1.0, f32::INFINITY, 3.0, 4.0, 5.0, 6.0], plain, &[]),
                &SCALE,
                "surface-number",
                "column 1, row 0",
            ),
            (tiff::<Gray32Float>(&[f32::NAN; 6], plain, &[]), &SCALE, "heightmap-empty", "every sample"),
            (
                tiff::<Gray32Float>(&[f32::MIN, 2.0, 3.0, 4.0, 5.0, 6.0], plain, &[]),
                &SCALE,
                "surface-size",
                "-3.403e38",
            ),
            (float, &none, "heightmap-scale", "not known beforehand"),
            (whole[..whole.len() / 2].to_vec(), &SCALE, "tiff-truncated", "too early"),
            (b"II*\0\x08\0".to_vec(), &SCALE, "tiff-truncated", "too early"),
            (b"\x89PNG\r\n\x1a\n".to_vec(), &SCALE, "surface-format", "a PNG image, not a TIFF"),
            (vec![], &SCALE, "surface-empty", "empty"),
        ] {
            let e = read_bytes(&bytes, scale).0.expect_err(say);
            assert_eq!(e.diags()[0].code, code, "{say}: {e}");
            assert!(e.to_string().contains(say) && !e.diags()[0].hint.is_empty(), "{say}: {e}");
        }
        // A width of 15,000 x 10,000 in a file of some hundred bytes.
        let (mut wide, at) = (whole.clone(), |tag: u16| whole.windows(4).position(|w| w == [tag as u8, 1, 4, 0]));
        for (tag, size) in [(0, 15_000u32), (1, 10_000)] {
            let at = at(tag).expect("a tag of 4 bytes") + 8;
            wide[at..at + 4].copy_from_slice(&size.to_le_bytes());
        }
        let e = read_bytes(&wide, &SCALE).0.expect_err("too small a file");
        assert_eq!(e.diags()[0].code, "tiff-truncated", "{e}");
    }

    #[test]
    fn cells_that_are_not_square_are_refused() {
        use tiff::encoder::Rational;
        let of = |tags: &[(Tag, &[f64])]| {
            let mut out = std::io::Cursor::new(Vec::new());
            let mut encoder = TiffEncoder::new(&mut out).expect("an encoder");
            let mut image = encoder.new_image::<colortype::Gray16>(3, 2).expect("an image");
            for (tag, values) in tags {
                let ratio = Rational { n: (values[0] * 1000.0) as u32, d: 1000 };
                match tag {
                    Tag::XResolution | Tag::YResolution => image.encoder().write_tag(*tag, ratio),
                    _ => image.encoder().write_tag(*tag, *values),
                }
                .expect("a tag");
            }
            image.write_data(&[1, 2, 3, 4, 5, 6]).expect("written");
            read_bytes(&out.into_inner(), &SCALE).0
        };
        let matrix = |a, b, c, d| [a, b, 0.0, 7.0, c, d, 0.0, 8.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0];
        for (tags, say) in [
            (vec![(Tag::ModelPixelScaleTag, vec![2.0, 2.0, 0.0])], ""),
            (vec![(Tag::ModelPixelScaleTag, vec![1.0, 1.5, 0.0])], "ModelPixelScale its cells are 0.6667 times"),
            (vec![(Tag::ModelTransformationTag, matrix(3.0, 4.0, -4.0, 3.0).to_vec())], ""),
            (
                vec![(Tag::ModelTransformationTag, matrix(2.0, 0.0, 0.0, -1.0).to_vec())],
                "ModelTransformation its cells are 2.0000",
            ),
            (vec![(Tag::ModelTransformationTag, matrix(5.0, 3.0, 0.0, 4.0).to_vec())], "its cells are skewed"),
            (vec![(Tag::XResolution, vec![10.0]), (Tag::YResolution, vec![10.0])], ""),
            (
                vec![(Tag::XResolution, vec![10.0]), (Tag::YResolution, vec![6.667])],
                "YResolution its cells are 0.6667 times",
            ),
            (vec![(Tag::XResolution, vec![10.0]), (Tag::YResolution, vec![0.0])], ""),
        ] {
            let tags: Vec<(Tag, &[f64])> = tags.iter().map(|(tag, v)| (*tag, v.as_slice())).collect();
            match of(&tags) {
                Ok(_) => assert_eq!(say, "", "{tags:?}"),
                Err(e) => {
                    assert_eq!(e.diags()[0].code, "heightmap-cells", "{e}");
                    assert!(!say.is_empty() && e.to_string().contains(say), "{say}: {e}");
                }
            }
        }
    }
}
