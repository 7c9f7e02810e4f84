//! The tags of a TIFF: which are used, which say nothing of what its samples mean, and which are refused.
//!
//! A tag that changes the meaning of bytes and is not used would mark another picture. So every tag of TIFF 6.0, of its
//! supplements and of libtiff has a row; other tags below 32768 are refused by their number, as they may belong to an
//! extension that changes the samples. Tags from there on are private: TIFF 6.0 has readers skip them.

use tiff::TiffError;
use tiff::decoder::Decoder;
use tiff::decoder::ifd::Value;
use tiff::tags::Tag;

use super::image::{damaged, truncated, unread};
use terrace_core::diag::Diag;

/// What is done with a tag.
#[derive(Clone, Copy, Debug)]
enum TagUse {
    /// This reader or its decoder uses it, or refuses the values that it cannot use.
    Used,
    /// The tag does not change what is seen, or viewers do not use it; the constants below say why.
    Harmless,
    /// The tag is refused unless all its values are among these.
    Only(&'static [f64]),
    /// The tag is refused unless its pairs are 0 and the highest sample, or those of colour differences.
    FullRange,
}

use TagUse::{FullRange, Harmless, Only, Used};

/// The decoder of a TIFF that is held as bytes.
pub(super) type TiffDecoder<'a> = Decoder<std::io::Cursor<&'a [u8]>>;

/// What is wrong with a file.
pub(super) fn fault(e: TiffError) -> Diag {
    match e {
        TiffError::IoError(e) if e.kind() == std::io::ErrorKind::UnexpectedEof => truncated("its data are cut"),
        TiffError::LimitsExceeded | TiffError::IntSizeError => damaged("it needs more memory than its size explains"),
        TiffError::UnsupportedError(e) => unread(&format!("a TIFF of a kind that is rare ({e})")),
        e => damaged(&e.to_string()),
    }
}

/// A description.
const TEXT: TagUse = Harmless;
/// How the picture was screened, or advice to printers.
const SCREENING: TagUse = Harmless;
/// A statistic, "not to affect the visual appearance" (TIFF 6.0), or one of a transmission.
const STATISTIC: TagUse = Harmless;
/// A place on a page, which the job states.
const PLACE: TagUse = Harmless;
/// Colour profiles and gamma of a file are not used.
const COLOUR_MANAGEMENT: TagUse = Harmless;
/// Of the colour alone: the luma is that of the file.
const CHROMA: TagUse = Harmless;
/// The tag belongs to a kind of TIFF, or to another tag, that is refused.
const OF_REFUSED: TagUse = Harmless;
/// The tag points to data besides the image, or to unused bytes.
const OTHER_DATA: TagUse = Harmless;

/// Numbers, names and uses, by number.
const TAGS: [(u16, &str, TagUse); 89] = [
    // A reduced copy or a mask is not the picture; 2 is a page of several.
    (254, "NewSubfileType", Only(&[0.0, 2.0])),
    (255, "SubfileType", Only(&[1.0, 3.0])),
    (256, "ImageWidth", Used),
    (257, "ImageLength", Used),
    (258, "BitsPerSample", Used),
    (259, "Compression", Used),
    (262, "PhotometricInterpretation", Used),
    (263, "Threshholding", SCREENING),
    (264, "CellWidth", SCREENING),
    (265, "CellLength", SCREENING),
    (266, "FillOrder", Used),
    (269, "DocumentName", TEXT),
    (270, "ImageDescription", TEXT),
    (271, "Make", TEXT),
    (272, "Model", TEXT),
    (273, "StripOffsets", Used),
    (274, "Orientation", Used),
    (277, "SamplesPerPixel", Used),
    (278, "RowsPerStrip", Used),
    (279, "StripByteCounts", Used),
    (280, "MinSampleValue", STATISTIC),
    (281, "MaxSampleValue", STATISTIC),
    (282, "XResolution", Used),
    (283, "YResolution", Used),
    (284, "PlanarConfiguration", Used),
    (285, "PageName", TEXT),
    (286, "XPosition", PLACE),
    (287, "YPosition", PLACE),
    (288, "FreeOffsets", OTHER_DATA),
    (289, "FreeByteCounts", OTHER_DATA),
    (290, "GrayResponseUnit", COLOUR_MANAGEMENT),
    (291, "GrayResponseCurve", COLOUR_MANAGEMENT),
    (292, "T4Options", OF_REFUSED),
    // Data with uncompressed runs are not decoded.
    (293, "T6Options", Only(&[0.0])),
    (296, "ResolutionUnit", Used),
    (297, "PageNumber", TEXT),
    (301, "TransferFunction", COLOUR_MANAGEMENT),
    (305, "Software", TEXT),
    (306, "DateTime", TEXT),
    (315, "Artist", TEXT),
    (316, "HostComputer", TEXT),
    (317, "Predictor", Used),
    (318, "WhitePoint", COLOUR_MANAGEMENT),
    (319, "PrimaryChromaticities", COLOUR_MANAGEMENT),
    (320, "ColorMap", OF_REFUSED),
    (321, "HalftoneHints", SCREENING),
    (322, "TileWidth", Used),
    (323, "TileLength", Used),
    (324, "TileOffsets", Used),
    (325, "TileByteCounts", Used),
    (326, "BadFaxLines", STATISTIC),
    (327, "CleanFaxData", STATISTIC),
    (328, "ConsecutiveBadFaxLines", STATISTIC),
    (330, "SubIFDs", OTHER_DATA),
    (332, "InkSet", OF_REFUSED),
    (333, "InkNames", OF_REFUSED),
    (334, "NumberOfInks", OF_REFUSED),
    (336, "DotRange", OF_REFUSED),
    (337, "TargetPrinter", TEXT),
    (338, "ExtraSamples", Used),
    (339, "SampleFormat", Used),
    (340, "SMinSampleValue", STATISTIC),
    (341, "SMaxSampleValue", STATISTIC),
    (342, "TransferRange", COLOUR_MANAGEMENT),
    (343, "ClipPath", Only(&[])),
    (344, "XClipPathUnits", OF_REFUSED),
    (345, "YClipPathUnits", OF_REFUSED),
    (346, "Indexed", Only(&[0.0])),
    (347, "JPEGTables", Used),
    (351, "OPIProxy", Only(&[0.0])),
    (512, "JPEGProc", OF_REFUSED),
    (513, "JPEGInterchangeFormat", OF_REFUSED),
    (514, "JPEGInterchangeFormatLength", OF_REFUSED),
    (515, "JPEGRestartInterval", OF_REFUSED),
    (517, "JPEGLosslessPredictors", OF_REFUSED),
    (518, "JPEGPointTransforms", OF_REFUSED),
    (519, "JPEGQTables", OF_REFUSED),
    (520, "JPEGDCTables", OF_REFUSED),
    (521, "JPEGACTables", OF_REFUSED),
    (529, "YCbCrCoefficients", CHROMA),
    (530, "YCbCrSubSampling", CHROMA),
    (531, "YCbCrPositioning", CHROMA),
    (532, "ReferenceBlackWhite", FullRange),
    (559, "StripRowCounts", Only(&[])),
    (700, "XMP", OTHER_DATA),
    // Private tags that change the samples all the same: opacity before ExtraSamples, its SampleFormat, volumes.
    (32995, "Matteing", Only(&[0.0])),
    (32996, "DataType", Only(&[2.0])),
    (32997, "ImageDepth", Only(&[1.0])),
    (32998, "TileDepth", Only(&[1.0])),
];

/// The first private tag.
const PRIVATE: u16 = 32768;

/// Refuses a file with a tag that changes the meaning of its samples and is not used.
pub(super) fn check(decoder: &mut TiffDecoder<'_>, bits: u8) -> Result<(), Diag> {
    let tags: Vec<Tag> = decoder.image_ifd().directory().iter().map(|(tag, _)| tag).collect();
    for tag in tags {
        let number = tag.to_u16();
        let Some((_, name, use_)) = TAGS.iter().find(|row| row.0 == number) else {
            if number < PRIVATE {
                return Err(unread(&format!("a TIFF with tag {number}, which may change what its samples mean")));
            }
            continue;
        };
        let is_sound = |values: &[f64]| match use_ {
            Used | Harmless => true,
            Only(allowed) => !values.is_empty() && values.iter().all(|v| allowed.contains(v)),
            FullRange => is_full_range(values, bits),
        };
        let values = match use_ {
            Used | Harmless => Vec::new(),
            Only(_) | FullRange => decoder.find_tag(tag).map_err(fault)?.map(|v| values(&v)).unwrap_or_default(),
        };
        if !is_sound(&values) {
            let list: Vec<String> = values.iter().take(6).map(f64::to_string).collect();
            return Err(unread(&format!("a TIFF whose tag {name} is {}", list.join(", "))));
        }
    }
    Ok(())
}

/// Whether black and white of each band are the lowest and the highest sample; of colour differences black is the
/// middle.
fn is_full_range(values: &[f64], bits: u8) -> bool {
    let most = 2f64.powi(i32::from(bits)) - 1.0;
    let middle = (most + 1.0) / 2.0;
    let is_difference = |pair: &[f64]| pair[0] == middle;
    let is_full = |(k, pair): (usize, &[f64])| pair[1] == most && (pair[0] == 0.0 || k > 0 && is_difference(pair));
    values.len() == 6 && values.chunks_exact(2).enumerate().all(is_full)
}

/// The numbers of a tag.
fn values(value: &Value) -> Vec<f64> {
    match value {
        Value::List(list) => list.iter().flat_map(values).collect(),
        Value::Rational(n, d) => vec![f64::from(*n) / f64::from(*d)],
        Value::Byte(v) => vec![f64::from(*v)],
        Value::Short(v) => vec![f64::from(*v)],
        Value::Unsigned(v) => vec![f64::from(*v)],
        _ => Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tags_are_in_order_and_known_once() {
        assert!(TAGS.windows(2).all(|w| w[0].0 < w[1].0));
    }

    #[test]
    fn a_full_range_is_that_of_luma_or_of_rgb() {
        for (values, bits, is_full) in [
            ([0.0, 255.0, 128.0, 255.0, 128.0, 255.0], 8, true),
            ([0.0, 255.0, 0.0, 255.0, 0.0, 255.0], 8, true),
            ([0.0, 65_535.0, 0.0, 65_535.0, 0.0, 65_535.0], 16, true),
            ([15.0, 235.0, 128.0, 240.0, 128.0, 240.0], 8, false),
            ([255.0, 0.0, 255.0, 0.0, 255.0, 0.0], 8, false),
            ([0.0, 255.0, 0.0, 255.0, 0.0, 255.0], 16, false),
        ] {
            assert_eq!(is_full_range(&values, bits), is_full, "{values:?}");
        }
        assert!(!is_full_range(&[], 8));
    }
}
