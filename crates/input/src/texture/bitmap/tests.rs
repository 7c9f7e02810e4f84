//! Bitmaps from bytes to strokes.

use std::path::Path;
use terrace_core::math;

use super::*;
use crate::texture::{self, FillMode, Kind, Mirror, Request, Texture};
use terrace_core::geom::{BoxMm, P2};
use terrace_core::program::PenId;

const SPOT: f64 = 0.04;

/// A PNG of one band of 8 bits.
fn grey8(columns: u32, rows: u32, sample: impl Fn(u32, u32) -> u8) -> Vec<u8> {
    let data: Vec<u8> = (0..rows).flat_map(|y| (0..columns).map(move |x| (x, y))).map(|(x, y)| sample(x, y)).collect();
    encoded([columns, rows], ::png::ColorType::Grayscale, ::png::BitDepth::Eight, &data)
}

fn encoded(size: [u32; 2], color: ::png::ColorType, depth: ::png::BitDepth, data: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    let mut encoder = ::png::Encoder::new(&mut out, size[0], size[1]);
    encoder.set_color(color);
    encoder.set_depth(depth);
    if color == ::png::ColorType::Indexed {
        encoder.set_palette(vec![255, 255, 255, 255, 0, 0, 0, 0, 0]);
        encoder.set_trns(vec![255, 255, 128]);
    }
    let (xppu, yppu) = (11_811, 5_906);
    encoder.set_pixel_dims(Some(::png::PixelDimensions { xppu, yppu, unit: ::png::Unit::Meter }));
    encoder.write_header().and_then(|mut w| w.write_image_data(data)).expect("encoded");
    out
}

/// A grey baseline JPEG of blocks of one grey each, with a JFIF header of 300 x 150 dpi.
fn jpeg_of_blocks(columns: u16, rows: u16, blocks: &[u8]) -> Vec<u8> {
    let mut out = vec![0xff, 0xd8];
    let mut segment = |marker: u8, data: &[u8]| {
        out.extend([0xff, marker]);
        out.extend((data.len() as u16 + 2).to_be_bytes());
        out.extend(data);
    };
    segment(0xe0, b"JFIF\0\x01\x02\x01\x01\x2c\0\x96\0\0");
    segment(0xdb, &[&[0][..], &[8; 64]].concat());
    let [[h0, h1], [w0, w1]] = [rows.to_be_bytes(), columns.to_be_bytes()];
    segment(0xc0, &[8, h0, h1, w0, w1, 1, 1, 0x11, 0]);
    // Codes of 4 bits for all sizes of differences, and one of 2 bits for the end of a block.
    segment(
        0xc4,
        &[&[0x00, 0, 0, 0, 12, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0][..], &(0..12).collect::<Vec<u8>>()].concat(),
    );
    segment(0xc4, &[0x10, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]);
    segment(0xda, &[1, 1, 0, 0, 63, 0]);
    let mut bits = String::new();
    let mut before = 128;
    for &grey in blocks {
        let difference = i32::from(grey) - before;
        before = i32::from(grey);
        let size = (32 - difference.unsigned_abs().leading_zeros()) as usize;
        let value = if difference < 0 { difference + (1 << size) - 1 } else { difference };
        bits += &format!("{size:04b}");
        bits += &if size > 0 { format!("{value:0size$b}") } else { String::new() };
        bits += "00";
    }
    while !bits.len().is_multiple_of(8) {
        bits.push('1');
    }
    for byte in bits.as_bytes().chunks(8) {
        let byte = byte.iter().fold(0, |v, b| v << 1 | (b - b'0'));
        out.push(byte);
        out.extend((byte == 0xff).then_some(0));
    }
    out.extend([0xff, 0xd9]);
    out
}

fn read(bytes: &[u8]) -> Result<Image, Error> {
    decode(bytes, Path::new("a.png"))
}

fn code(e: &Error) -> &'static str {
    e.diags()[0].code
}

fn load(bytes: &[u8], size: Option<[f64; 2]>, marking: Marking) -> Result<(Texture, Vec<Diag>), Error> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.png");
    std::fs::write(&path, bytes).expect("written");
    let kind = Kind::Drawing {
        path,
        size: size.map_or(texture::Size::File, texture::Size::Mm),
        unit_mm: None,
        position: texture::Position::Origin([0.0; 2]),
        turn_rad: 0.0,
        tile: false,
        marking: Box::new(marking),
    };
    let request = Request {
        kind,
        area: texture::Area::Unlimited,
        tolerance_mm: 1e-3,
        pen: PenId(0),
        masks: crate::texture::Masks::default(),
    };
    let mut notes = Vec::new();
    Texture::load(&[request], BoxMm::rectangle(0.0, 0.0, 50.0, 50.0), 0.0, SPOT, &mut notes).map(|t| (t, notes))
}

fn strokes(texture: &Texture) -> Vec<Vec<P2>> {
    let mut points = Vec::new();
    (0..texture.len())
        .map(|i| {
            texture.stroke(i, &mut points);
            points.clone()
        })
        .collect()
}

fn tone(screen: Screen) -> Tone {
    Tone { screen, ..Tone::default() }
}

/// Length of straight strokes between two verticals.
fn length_between(strokes: &[Vec<P2>], from: f64, to: f64) -> f64 {
    strokes
        .iter()
        .map(|s| {
            let [a, b] = [s[0].mm(), s[1].mm()];
            let length = math::hypot(b[0] - a[0], b[1] - a[1]);
            let (lo, hi) = (a[0].min(b[0]), a[0].max(b[0]));
            let share = (hi.min(to) - lo.max(from)).max(0.0) / (hi - lo).max(1e-12);
            length * share
        })
        .sum()
}

#[test]
fn sixteen_steps_of_grey_are_reproduced_by_coverage() {
    // Steps of 10 pixels, 2 mm; those at the border of a step are left out, being interpolated.
    let ramp = grey8(160, 100, |x, _| (17 * (x / 10)) as u8);
    let turned = |deg: f64| Marking { direction_rad: deg.to_radians(), ..Marking::default() };
    for (name, marking, tone) in [
        ("lines", turned(0.0), tone(Screen::Lines)),
        ("lines of half a spot", Marking { pitch_mm: Some(SPOT / 2.0), ..turned(0.0) }, tone(Screen::Lines)),
        ("turned lines", turned(30.0), tone(Screen::Lines)),
        ("dashes", turned(0.0), tone(Screen::Dashes)),
        ("turned dashes", turned(-20.0), tone(Screen::Dashes)),
        ("fine dashes", turned(0.0), Tone { period_mm: Some(0.1), ..tone(Screen::Dashes) }),
        ("gamma", turned(0.0), Tone { gamma: 2.2, ..tone(Screen::Dashes) }),
        ("light", turned(0.0), Tone { invert: true, ..tone(Screen::Lines) }),
    ] {
        let marking = Marking { tone: Some(tone), ..marking };
        let (texture, notes) = load(&ramp, Some([32.0, 20.0]), marking).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert!(notes.is_empty(), "{name}: {notes:?}");
        let strokes = strokes(&texture);
        for step in 0..16 {
            let [from, to] = [0.2, 1.8].map(|x| 2.0 * f64::from(step) + x);
            let coverage = length_between(&strokes, from, to) * SPOT / (1.6 * 20.0);
            let light = math::pow(f64::from(step) / 15.0, tone.gamma);
            let want = if tone.invert { light } else { 1.0 - light };
            assert!((coverage - want).abs() < 0.01, "{name}, step {step}: {coverage:.4} instead of {want:.4}");
        }
    }
}

#[test]
fn black_is_full_lines_a_spot_apart_and_white_is_blank() {
    for screen in [Screen::Lines, Screen::Dashes] {
        let marking = || Marking { tone: Some(tone(screen)), ..Marking::default() };
        let (texture, _) = load(&grey8(4, 3, |_, _| 0), Some([4.0, 3.0]), marking()).expect("black");
        assert_eq!(texture.len(), 75);
        for (k, s) in strokes(&texture).iter().enumerate() {
            let y = 20_000 + 40_000 * k as i64;
            let mut ends = [P2::new(0, y), P2::new(4_000_000, y)];
            ends.rotate_left(k % 2);
            assert_eq!(s, &ends, "every second line runs back");
        }
        let e = load(&grey8(4, 3, |_, _| 255), Some([4.0, 3.0]), marking()).expect_err("blank");
        assert_eq!(code(&e), "texture-empty");
    }
    let marking = Marking { pitch_mm: Some(0.1), tone: Some(tone(Screen::Lines)), ..Marking::default() };
    let (_, notes) = load(&grey8(4, 3, |x, _| if x < 2 { 0 } else { 200 }), Some([4.0, 3.0]), marking).expect("marked");
    assert_eq!(notes[0].code, "bitmap-pale");
    assert!(notes[0].message.contains("at most 40 %; 50 %"), "{}", notes[0].message);
}

#[test]
fn the_border_of_a_smooth_disc_is_found_within_a_tenth_of_a_pixel() {
    // Each pixel has the share of it that the disc covers.
    let (centre, radius) = ([31.3, 27.8], 20.4);
    let covered = |x: u32, y: u32| {
        let inside = (0..256)
            .filter(|k| {
                let [dx, dy] = [(k % 16, x, centre[0]), (k / 16, y, centre[1])]
                    .map(|(s, v, c)| f64::from(v) + (f64::from(s) + 0.5) / 16.0 - c);
                math::hypot(dx, dy) < radius
            })
            .count();
        255 - (inside * 255 / 256) as u8
    };
    let marking = Marking { fill: FillMode::Outline, ..Marking::default() };
    let (texture, _) = load(&grey8(64, 64, covered), Some([64.0, 64.0]), marking).expect("a disc");
    let strokes = strokes(&texture);
    assert_eq!(strokes.len(), 1);
    assert_eq!(strokes[0].first(), strokes[0].last());
    for p in &strokes[0] {
        let [x, y] = p.mm();
        let away = math::hypot(x - centre[0], 64.0 - y - centre[1]) - radius;
        assert!(away.abs() < 0.1, "({x}, {y}) lies {away} px off");
    }
}

#[test]
fn threshold_gamma_and_mirror_are_applied() {
    // Samples 0, 0.2, 0.4, ... in columns; 7 rows, of which the upper 2 are white.
    let steps = grey8(6, 7, |x, y| if y < 2 { 255 } else { (51 * x) as u8 });
    let outline = |tone, mirror| Marking { fill: FillMode::Outline, tone: Some(tone), mirror, ..Marking::default() };
    let bounds = |marking| {
        let (texture, _) = load(&steps, Some([6.0, 7.0]), marking).expect("marked");
        let b = texture.bounds();
        [b.lo.mm(), b.hi.mm()]
    };
    let base = tone(Screen::Threshold);
    // Densities are 1, 0.8, 0.6, ... at 0.5, 1.5, ...; below row 2 they fall to white.
    for (tone, mirror, x) in [
        (base, None, [0.0, 3.0]),
        (Tone { threshold: 0.3, ..base }, None, [0.0, 4.0]),
        (base, Some(Mirror::X), [3.0, 6.0]),
        (Tone { threshold: 0.5, gamma: 0.5, ..base }, None, [0.0, 1.785]),
        (Tone { invert: true, ..base }, None, [0.0, 6.0]),
    ] {
        let [lo, hi] = bounds(outline(tone, mirror));
        assert!((lo[0] - x[0]).abs() < 0.01 && (hi[0] - x[1]).abs() < 0.01, "{tone:?}: {lo:?} {hi:?}");
        assert!(lo[1] == 0.0 || tone.invert, "row 0 is at the top: {lo:?}");
    }
    let [lo, hi] = bounds(outline(base, Some(Mirror::Y)));
    assert!(hi[1] == 7.0 && lo[1] > 1.5, "{lo:?} {hi:?}");
    // The screens are mirrored with the picture.
    for mirror in [None, Some(Mirror::X)] {
        let marking = Marking { tone: Some(tone(Screen::Dashes)), mirror, ..Marking::default() };
        let (texture, _) = load(&steps, Some([6.0, 7.0]), marking).expect("marked");
        let [left, right] = [[0.0, 1.0], [5.0, 6.0]].map(|[a, b]| length_between(&strokes(&texture), a, b));
        assert!(if mirror.is_none() { left > 9.0 * right } else { right > 9.0 * left }, "{left} {right}");
    }
}

#[test]
fn pictures_of_two_greys_keep_the_sides_of_their_pixels() {
    let board = |dark| grey8(8, 8, move |x, y| if (x + y) % 2 == 0 { dark } else { 250 });
    for dark in [0, 90] {
        let marking = Marking { fill: FillMode::Outline, ..Marking::default() };
        let (texture, _) = load(&board(dark), Some([8.0, 8.0]), marking).expect("a board");
        let strokes = strokes(&texture);
        assert!(strokes.iter().flatten().all(|p| p.x % 1_000_000 == 0 && p.y % 1_000_000 == 0));
        let length: f64 = strokes.iter().map(|s| terrace_core::geom::length_mm(s)).sum();
        assert!((length - 32.0 * 4.0).abs() < 1e-9, "{length}");
    }
}

#[test]
fn png_of_every_kind_is_read() {
    use ::png::{BitDepth as B, ColorType as C};
    let red = 0.299 * 65_535.0;
    for (color, depth, data, want) in [
        (C::Grayscale, B::One, &[0b1010_0000u8, 0][..], [65_535.0, 0.0, 0.0, 0.0]),
        (C::Grayscale, B::Two, &[0b0110_0000, 0], [21_845.0, 43_690.0, 0.0, 0.0]),
        (C::Grayscale, B::Four, &[0x1f, 0], [4369.0, 65_535.0, 0.0, 0.0]),
        (C::Grayscale, B::Eight, &[1, 2, 3, 4], [257.0, 514.0, 771.0, 1028.0]),
        (C::Grayscale, B::Sixteen, &[1, 2, 3, 4, 0, 0, 0, 9], [258.0, 772.0, 0.0, 9.0]),
        (C::GrayscaleAlpha, B::Eight, &[0, 255, 0, 0, 0, 51, 255, 9], [0.0, 65_535.0, 52_428.0, 65_535.0]),
        (C::Rgb, B::Eight, &[255, 0, 0, 255, 255, 255, 0, 0, 0, 0, 0, 0], [red, 65_535.0, 0.0, 0.0]),
        (C::Indexed, B::Two, &[0b0001_0000, 0b1001_0000], [65_535.0, red, 65_535.0 * 127.0 / 255.0, red]),
    ] {
        let image = read(&encoded([2, 2], color, depth, data)).expect("read");
        // One bit: the second row begins in a byte of its own.
        let want = if depth == B::One { [65_535.0, 0.0, 0.0, 0.0] } else { want };
        for (have, want) in image.samples.iter().zip(want) {
            assert!((f64::from(*have) - want).abs() <= 1.0, "{color:?} {depth:?}: {:?}", image.samples);
        }
        let [x, y] = image.resolution.expect("stated");
        assert!((x * 25.4 - 300.0).abs() < 0.01 && (y * 25.4 - 150.0).abs() < 0.02);
    }
}

#[test]
fn tiff_and_jpeg_are_read() {
    use ::tiff::encoder::{TiffEncoder, colortype};
    use ::tiff::tags::{ResolutionUnit, Tag};
    let mut bytes = std::io::Cursor::new(Vec::new());
    let mut encoder = TiffEncoder::new(&mut bytes).expect("written");
    let mut image = encoder.new_image::<colortype::Gray16>(3, 2).expect("written");
    image.resolution(ResolutionUnit::Centimeter, ::tiff::encoder::Rational { n: 100, d: 1 });
    image.write_data(&[0, 1, 2, 3, 4, 65_535]).expect("written");
    let image = read(bytes.get_ref()).expect("read");
    assert_eq!((image.samples, image.resolution), (vec![0, 1, 2, 3, 4, 65_535], Some([10.0; 2])));
    for cut in 4..bytes.get_ref().len() {
        assert!(read(&bytes.get_ref()[..cut]).is_err(), "{cut}");
    }

    let mut bytes = std::io::Cursor::new(Vec::new());
    let mut encoder = TiffEncoder::new(&mut bytes).expect("written");
    let mut image = encoder.new_image::<colortype::RGB8>(2, 1).expect("written");
    image.encoder().write_tag(Tag::Orientation, 6u16).expect("written");
    image.write_data(&[255, 0, 0, 255, 255, 255]).expect("written");
    assert_eq!(code(&read(bytes.get_ref()).expect_err("turned")), "bitmap-turned");

    let bytes = jpeg_of_blocks(20, 9, &[0, 255, 100, 7, 8, 9]);
    let image = read(&bytes).expect("read");
    assert_eq!((image.columns, image.rows), (20, 9));
    for (at, want) in [(0, 0), (15, 255), (16, 100), (8 * 20, 7), (8 * 20 + 19, 9)] {
        assert!((f64::from(image.samples[at]) / 257.0 - f64::from(want)).abs() <= 1.0, "{at}: {:?}", image.samples);
    }
    assert!(image.resolution.is_some_and(|[x, y]| (x * 25.4 - 300.0).abs() < 1e-9 && (y * 25.4 - 150.0).abs() < 1e-9));
    // EXIF counts where JFIF states an aspect alone: 254 pixels in an inch.
    let mut aspect = bytes.clone();
    aspect[13] = 0;
    assert_eq!(read(&aspect).expect("read").resolution, None);
    let exif = b"\xff\xe1\0\x40Exif\0\0II*\0\x08\0\0\0\x02\0\x1a\x01\x05\0\x01\0\0\0\x28\0\0\0\x1b\x01\x05\0\x01\0\0\0\
        \x28\0\0\0\0\0\0\0\0\0\xfe\0\0\0\x01\0\0\0\0\0\0\0\0\0\0\0";
    assert_eq!(exif.len(), 2 + 0x40);
    aspect.splice(20..20, *exif);
    assert_eq!(read(&aspect).expect("read").resolution, Some([10.0; 2]));
    aspect[13] = 2;
    assert_eq!(read(&aspect).expect("read").resolution, Some([30.0, 15.0]), "JFIF comes first");
    for cut in 3..bytes.len() - 2 {
        let e = read(&bytes[..cut]).expect_err("cut");
        assert_eq!(code(&e), "bitmap-truncated", "{cut}: {e}");
    }
    // Whatever byte is wrong: an answer, and no panic.
    for at in 3..bytes.len() {
        for value in [0, 1, 0x7f, 0xff] {
            let mut data = bytes.clone();
            data[at] = value;
            let _ = read(&data);
        }
    }
}

/// A TIFF of one strip, 16 x 4 pixels of 1 bit, with more tags of one short each.
fn tiff_of_bits(compression: u16, more: &[(u16, u16)], data: &[u8]) -> Vec<u8> {
    let own = [(256, 16), (257, 4), (258, 1), (259, compression), (262, 0), (273, 0), (277, 1), (278, 4)];
    let mut tags: Vec<(u16, u16)> = own.iter().chain(&[(279, data.len() as u16)]).chain(more).copied().collect();
    tags.sort_unstable();
    let start = 8 + 2 + 12 * tags.len() as u16 + 4;
    let mut out = b"II*\0\x08\0\0\0".to_vec();
    out.extend((tags.len() as u16).to_le_bytes());
    for (tag, value) in tags {
        let value = if tag == 273 { start } else { value };
        out.extend([tag, 3, 1, 0, value, 0].iter().flat_map(|v| v.to_le_bytes()));
    }
    out.extend([0; 4]);
    out.extend(data);
    out
}

#[test]
fn tiff_with_low_bit_first_is_the_same_picture() {
    use ::tiff::encoder::{Compression, DeflateLevel, TiffEncoder, colortype};
    use ::tiff::tags::Tag;
    // Compression, and the rows 0f0f, 8001, 0000 and ffff.
    for (compression, data) in [
        (1, &b"\x0f\x0f\x80\x01\0\0\xff\xff"[..]),
        (32773, b"\x07\x0f\x0f\x80\x01\0\0\xff\xff"),
        // Group 4: horizontal runs of 4, 4, 4 and 4; 0, 1, 14 and 1; none; 0 and 16.
        (4, &fax_of_rows()),
    ] {
        let high = read(&tiff_of_bits(compression, &[], data)).expect("read");
        let bits: Vec<u8> = high.samples.iter().map(|&s| u8::from(s == 0)).collect();
        let row = |v: u16| (0..16).rev().map(move |k| (v >> k & 1) as u8);
        assert_eq!(bits, [0x0f0f, 0x8001, 0, 0xffff].into_iter().flat_map(row).collect::<Vec<_>>(), "{compression}");
        let turned: Vec<u8> = data.iter().map(|b| b.reverse_bits()).collect();
        let low = read(&tiff_of_bits(compression, &[(266, 2)], &turned)).expect("read");
        assert_eq!(low.samples, high.samples, "{compression}");
        assert_eq!(read(&tiff_of_bits(compression, &[(266, 1)], data)).expect("read").samples, high.samples);
    }
    assert!(read(&tiff_of_bits(1, &[(266, 3)], &[0; 8])).expect_err("refused").to_string().contains("FillOrder is 3"));
    // Packed data are turned as they are stored.
    for packing in [Compression::Lzw, Compression::Deflate(DeflateLevel::Fast), Compression::Packbits] {
        let mut bytes = std::io::Cursor::new(Vec::new());
        let mut encoder = TiffEncoder::new(&mut bytes).expect("written").with_compression(packing);
        let mut image = encoder.new_image::<colortype::Gray8>(3, 2).expect("written");
        image.encoder().write_tag(Tag::FillOrder, 2u16).expect("written");
        image.write_data(&[1, 2, 3, 4, 5, 128]).expect("written");
        let mut bytes = bytes.into_inner();
        let mut decoder = ::tiff::decoder::Decoder::new(std::io::Cursor::new(bytes.clone())).expect("a TIFF");
        let mut of = |tag| decoder.get_tag_u64_vec(tag).expect("strips");
        for (start, count) in of(Tag::StripOffsets).into_iter().zip(of(Tag::StripByteCounts)) {
            bytes[start as usize..][..count as usize].iter_mut().for_each(|b| *b = b.reverse_bits());
        }
        let image = read(&bytes).expect("read");
        assert_eq!(image.samples.iter().map(|s| s / 257).collect::<Vec<_>>(), [1, 2, 3, 4, 5, 128]);
    }
}

/// Rows of Group 4 (ITU-T T.6): code words of modes and runs.
fn fax_of_rows() -> Vec<u8> {
    let (horizontal, vertical, pass) = ("001", "1", "0001");
    let white = |n: usize| ["00110101", "000111", "", "", "1011"].get(n).copied().unwrap_or("110100");
    let black = |n: usize| ["0000110111", "010", "", "", "011"].get(n).copied().unwrap_or("0000010111");
    let mut bits = String::new();
    // 0f0f against white.
    bits += &[horizontal, white(4), black(4), horizontal, white(4), black(4)].concat();
    // 8001: 0 white and 1 black, 14 white and 1 black.
    bits += &[horizontal, white(0), black(1), horizontal, white(14), black(1)].concat();
    // White: both runs above are passed.
    bits += &[pass, pass, vertical].concat();
    // Black.
    bits += &[horizontal, white(0), black(16)].concat();
    // The end of the block.
    bits += "000000000001000000000001";
    while !bits.len().is_multiple_of(8) {
        bits.push('0');
    }
    bits.as_bytes().chunks(8).map(|byte| byte.iter().fold(0, |v, b| v << 1 | (b - b'0'))).collect()
}

#[test]
fn tags_that_change_samples_are_refused_by_name() {
    let of = |tag, value| read(&tiff_of_bits(1, &[(tag, value)], &[0; 8]));
    for (tag, value, say) in [
        (254, 1, "NewSubfileType is 1"),
        (254, 4, "NewSubfileType is 4"),
        (255, 2, "SubfileType is 2"),
        (293, 2, "T6Options is 2"),
        (343, 7, "ClipPath is 7"),
        (346, 1, "Indexed is 1"),
        (532, 1, "ReferenceBlackWhite is 1"),
        (32995, 1, "Matteing is 1"),
        (32997, 2, "ImageDepth is 2"),
        (4711, 1, "tag 4711, which may change what its samples mean"),
    ] {
        let e = of(tag, value).expect_err("refused");
        assert!(code(&e) == "bitmap-samples" && e.to_string().contains(say), "{tag}: {e}");
    }
    for (tag, value) in [(254, 0), (254, 2), (263, 2), (280, 1), (291, 3), (297, 0), (346, 0), (32997, 1), (50000, 1)] {
        assert!(of(tag, value).is_ok(), "{tag}");
    }
}

#[test]
fn files_that_are_damaged_or_of_other_kinds_are_refused() {
    let whole = grey8(20, 20, |x, y| (x * y * 97) as u8);
    for cut in [9, 30, 45, whole.len() / 2, whole.len() - 12, whole.len() - 1] {
        assert_eq!(code(&read(&whole[..cut]).expect_err("cut")), "bitmap-truncated", "{cut}");
    }
    let mut flipped = whole.clone();
    flipped[whole.len() / 2] ^= 16;
    assert_eq!(code(&read(&flipped).expect_err("damaged")), "bitmap-damaged");
    for (bytes, code, say) in [
        (&b""[..], "bitmap-truncated", "empty"),
        (b"GIF89a", "bitmap-format", "no PNG"),
        (b"\x89PNG\n\x1a\nIHDR", "bitmap-damaged", "damaged"),
        (b"\xff\xd8\xff\xe0 not a JPEG", "bitmap-truncated", "end is missing"),
        (b"BM", "bitmap-truncated", "header"),
    ] {
        let e = read(bytes).expect_err("refused");
        assert_eq!(e.diags()[0].code, code, "{e}");
        assert!(e.to_string().contains(say) && !e.diags()[0].hint.is_empty(), "{e}");
        assert_eq!(e.diags()[0].place.to_string(), "a.png");
    }
}

#[test]
fn the_size_is_stated_and_that_of_the_file_is_used_only_where_the_job_asks_for_it() {
    let bytes = grey8(300, 150, |_, _| 0);
    let sized = |size, resolution| {
        let tone = Tone { resolution, ..Tone::default() };
        let marking = Marking { fill: FillMode::Outline, tone: Some(tone), ..Marking::default() };
        load(&bytes, size, marking).map(|(texture, notes)| (texture.bounds().hi.mm(), notes.first().map(|n| n.code)))
    };
    let (hi, note) = sized(None, Some(Resolution::Dpi(600.0))).expect("sized");
    assert_eq!((hi, note), ([12.7, 6.35], None));
    let (hi, note) = sized(None, Some(Resolution::File)).expect("sized");
    assert!((hi[0] - 25.4).abs() < 1e-3 && (hi[1] - 25.4).abs() < 1e-2 && note.is_none(), "{hi:?}");
    let (hi, note) = sized(Some([20.0, 20.0]), None).expect("sized");
    assert_eq!((hi, note), ([20.0, 20.0], Some("bitmap-stretched")));
    let e = sized(None, None).expect_err("no size");
    assert_eq!(code(&e), "bitmap-size");
    assert!(e.diags()[0].hint.contains("300.0 dpi, which makes 25.400 mm x 25.398 mm"), "{e}");
    assert_eq!(code(&sized(None, Some(Resolution::Dpi(0.5))).expect_err("far")), "texture-far");
    assert_eq!(code(&sized(Some([1.0, 0.0]), None).expect_err("no size")), "bitmap-size");
}

/// A picture of 5 x 5 mm of pixels of 0.1 mm: dark where `is_dark` says.
fn screened(is_dark: impl Fn(u32, u32) -> bool) -> Vec<u8> {
    grey8(50, 50, |x, y| if is_dark(x, y) { 0 } else { 255 })
}

/// The notes on one marked with a spot of 0.04 mm.
fn notes_on(bytes: &[u8], marking: Marking) -> Vec<Diag> {
    let (_, mut notes) = load(bytes, Some([5.0, 5.0]), marking).expect("marked");
    notes.retain(|n| n.code.starts_with("bitmap") || n.code == "texture-thin");
    notes
}

#[test]
fn a_threshold_that_loses_the_tone_of_a_screened_picture_is_reported() {
    let threshold = |pitch_mm| Marking { pitch_mm, tone: Some(tone(Screen::Threshold)), ..Marking::default() };
    let board = screened(|x, y| (x + y) % 2 == 0);
    // Squares of 0.1 mm with an inset of 0.045 mm hold one line of 0.01 mm at most: 0.05 x 0.04 mm of 0.01 mm².
    let marking = Marking { inset_mm: Some(0.045), ..threshold(None) };
    let notes = notes_on(&board, marking);
    assert_eq!(notes.iter().map(|n| n.code).collect::<Vec<_>>(), ["bitmap-coverage"], "{notes:?}");
    let covered: f64 = notes[0].message.split(' ').nth(3).expect("a number").parse().expect("a share");
    assert!(covered < 0.15 && notes[0].message.ends_with("a coverage of 0.500"), "{}", notes[0].message);
    assert!(notes[0].hint.contains("screen = \"diffusion\""), "{}", notes[0].hint);
    // Lines that fill the squares keep it, and so do large areas; lines two spots apart cover half on purpose.
    let half = screened(|x, _| x < 25);
    for marking in [threshold(None), threshold(Some(0.08)), Marking { cross: true, ..threshold(Some(0.08)) }] {
        let notes = notes_on(&half, marking);
        assert!(notes.is_empty(), "{notes:?}");
    }
    // Nothing fits: the refusal names what does.
    let marking = Marking { inset_mm: Some(0.06), ..threshold(None) };
    let e = load(&board, Some([5.0, 5.0]), marking).expect_err("empty");
    assert!(code(&e) == "texture-empty" && e.to_string().contains("screen = \"diffusion\""), "{e}");
}

#[test]
fn a_halftone_that_beats_with_the_raster_of_a_picture_is_reported() {
    let halftone = |period_mm| {
        let tone = Tone { period_mm: Some(period_mm), ..tone(Screen::Halftone) };
        Marking { pitch_mm: Some(SPOT), tone: Some(tone), ..Marking::default() }
    };
    // In every cell at its corner, where thresholds are highest.
    let dots = screened(|x, y| x % 4 == 0 && y % 4 == 1);
    let notes = notes_on(&dots, halftone(0.4));
    assert_eq!(notes.iter().map(|n| n.code).collect::<Vec<_>>(), ["bitmap-moire"], "{notes:?}");
    assert!(notes[0].message.contains("0.400 mm") && notes[0].hint.contains("diffusion"), "{}", notes[0].message);
    // Diffusion keeps the tone; a ramp and line art have no raster.
    let diffusion = Marking { tone: Some(tone(Screen::Diffusion)), ..Marking::default() };
    assert!(notes_on(&dots, diffusion).is_empty());
    for picture in [
        grey8(50, 50, |x, _| (x * 5) as u8),
        grey8(50, 50, |_, _| 240),
        screened(|x, y| (10..40).contains(&x) && (y < 12 || x > 30)),
    ] {
        let notes = notes_on(&picture, halftone(0.4));
        assert!(notes.is_empty(), "{notes:?}");
    }
}

#[test]
fn joined_pixels_keep_the_mean() {
    let grey = Grey::new(5, 3, (0..15).map(|v| v * 1000).collect());
    let joined = grey.joined(2);
    assert_eq!((joined.columns, joined.rows), (3, 2));
    assert_eq!([joined.row(0), joined.row(1)], [&[3000, 5000, 6500][..], &[10_500, 12_500, 14_000]]);
}
