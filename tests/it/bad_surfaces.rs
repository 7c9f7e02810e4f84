//! Malformed and odd surface files, one row each, and real ones: the outcome is fixed here.
//!
//! The files lie in `../shared/data`; where that folder is absent the tests say so and pass.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use terrace::diag::{Diag, Error, Kind};
use terrace::surface::{Content, Options, Scale, read};

/// What reading a file comes to.
#[derive(Debug)]
enum Outcome {
    /// Refused with this code, at this place (the end of "file:line" or "file, facet n"), saying this.
    Refused(&'static str, &'static str, &'static str),
    /// Accepted with this many facets, or samples of a height map, and these warnings.
    Accepted(usize, &'static [&'static str]),
}
use Outcome::{Accepted, Refused};

const BAD: &[(&str, Outcome)] = &[
    // Facets without area and walls: read as they are, the mesh refuses them ("nothing visible").
    ("stl_all_collinear.stl", Accepted(12, &[])),
    ("stl_all_degenerate_point.stl", Accepted(12, &["surface-tiny"])),
    ("stl_vertical_only.stl", Accepted(12, &[])),
    ("stl_ascii_4_vertices.stl", Refused("stl-ascii", ":7", "\"endloop\" (a facet has three vertices)")),
    ("stl_ascii_comma_decimals.stl", Refused("surface-number", ":4", "decimal comma")),
    ("stl_ascii_multi_solid.stl", Accepted(3, &[])),
    ("stl_ascii_nan.stl", Refused("surface-number", ":5", "not a finite number")),
    ("stl_ascii_no_endsolid.stl", Accepted(1, &["stl-no-endsolid"])),
    ("stl_ascii_truncated.stl", Refused("stl-ascii", ":6", "this one has 2")),
    ("stl_binary_starts_with_solid.stl", Accepted(200, &[])),
    ("stl_count_too_big.stl", Refused("stl-truncated", ".stl", "200000000084 bytes, but the file has 10084")),
    ("stl_count_too_small.stl", Refused("stl-trailing", ".stl", "7500 more bytes")),
    ("stl_count_zero.stl", Refused("surface-empty", ".stl", "no facets")),
    ("stl_empty_file.stl", Refused("surface-empty", ".stl", "empty")),
    ("stl_header_only_40.stl", Refused("stl-truncated", ".stl", "40 bytes")),
    ("stl_huge_coord.stl", Refused("surface-size", ", facet 7", "3.000e38")),
    ("stl_inf_vertices.stl", Refused("surface-number", ", facet 7", "inf")),
    ("stl_is_really_png.stl", Refused("surface-format", ".stl", "PNG image, not an STL")),
    ("stl_micro_units.stl", Accepted(200, &["surface-tiny"])),
    ("stl_nan_vertices.stl", Refused("surface-number", ", facet 7", "NaN")),
    ("stl_truncated_mid_facet.stl", Refused("stl-truncated", ".stl", "900084 bytes, but the file has 6107")),
    ("stl_upside_down.stl", Accepted(200, &[])),
    ("stl_utf16.stl", Refused("surface-format", ".stl", "UTF-16")),
    ("obj_2gon.obj", Refused("obj-face", ":3", "2 corners")),
    ("obj_huge_ngon.obj", Accepted(19_998, &[])),
    ("obj_index_out_of_range.obj", Refused("obj-index", ":4", "vertex 9")),
    ("obj_index_zero.obj", Refused("obj-index", ":4", "vertex 0")),
    ("obj_mtllib_path_traversal.obj", Accepted(1, &[])),
    ("obj_neg_out_of_range.obj", Refused("obj-index", ":4", "vertex -4")),
    ("obj_no_faces.obj", Refused("surface-empty", ".obj", "no faces")),
    ("obj_overflow_float.obj", Refused("surface-number", ":1", "1e400")),
    ("png_bad_idat_crc.png", Refused("png-damaged", ".png", "check sum")),
    ("png_bad_ihdr_crc.png", Refused("png-damaged", ".png", "check sum")),
    ("png_decompression_bomb.png", Refused("heightmap-size", ".png", "30000 x 30000")),
    ("png_flat_black.png", Accepted(64 * 64, &["heightmap-flat"])),
    ("png_huge_dims.png", Refused("heightmap-size", ".png", "2147483647")),
    ("png_is_jpeg.png", Refused("surface-format", ".png", "JPEG")),
    ("png_truncated.png", Refused("png-truncated", ".png", "too early")),
    ("png_zero_dims.png", Refused("png-damaged", ".png", "")),
    ("pngsuite_xcsn0g01.png", Refused("heightmap-samples", ".png", "1-bit greyscale")),
    ("pngsuite_xdtn0g01.png", Refused("heightmap-samples", ".png", "1-bit greyscale")),
    ("pngsuite_xhdn0g08.png", Refused("png-damaged", ".png", "check sum")),
    ("pngsuite_xlfn0g04.png", Refused("surface-format", ".png", "signature")),
    ("xyz_all_one_line.xyz", Refused("points-no-surface", ".xyz", "one line")),
    ("xyz_mixed_columns.xyz", Refused("points-columns", ":2", "2 columns")),
    ("xyz_nan.xyz", Accepted(160, &["points-not-finite"])),
];

/// Real files: unit in mm, facets or samples, warnings.
const GOOD: &[(&str, f64, usize, &[&str])] = &[
    ("hood_mm_bin.stl", 1.0, 18_000, &[]),
    ("hood_inches_bin.stl", 25.4, 4500, &[]),
    ("hood_ascii_crlf.stl", 1.0, 4500, &[]),
    ("hood_dirty_bin.stl", 0.5, 18_406, &[]),
    ("fuji_ascii.stl", 1.0, 344, &[]),
    ("propeller_and_shaft.stl", 1.0, 6899, &[]),
    ("busted.STL", 1.0, 3878, &[]),
    ("hood_quads_uv.obj", 1.0, 4500, &[]),
    ("quadknot.obj", 1.0, 2880, &[]),
    ("fuze.obj", 1000.0, 1000, &[]),
    ("fuze.obj", 1.0, 1000, &["surface-tiny"]),
    ("groups.obj", 1.0, 2308, &[]),
    ("panel_negidx_ngon.obj", 1.0, 7, &[]),
    ("helens_dem_u16_decimetre.png", 1.0, 327 * 468, &[]),
    ("hood_u16_2mm.png", 1.0, 640 * 780, &[]),
    ("hood_u8_2mm.png", 1.0, 640 * 780, &["heightmap-8-bit"]),
    ("jacksboro_dem_u16_m.png", 1.0, 403 * 344, &[]),
];

fn data(folder: &str) -> Option<PathBuf> {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data")).join(folder);
    if !path.is_dir() {
        eprintln!("skipped: {} is absent", path.display());
        return None;
    }
    Some(path)
}

struct Got {
    result: Result<Content, Error>,
    notes: Vec<Diag>,
    facets: Vec<[[f64; 3]; 3]>,
}

fn read_at(path: &Path, unit_mm: f64) -> Got {
    let scale = Scale { pixel_mm: 2.0, z_mm: [0.0, 100.0], values: None, nodata: None, origin_mm: [0.0; 2] };
    let options = Options { unit_mm: Some(unit_mm), heightmap: Some(scale), max_edge_mm: None };
    let (mut notes, mut facets) = (vec![], vec![]);
    let start = Instant::now();
    let result = read(path, &options, &mut notes, &mut |f| facets.push(f));
    assert!(start.elapsed() < Duration::from_secs(5), "{} took {:?}", path.display(), start.elapsed());
    assert!(facets.iter().flatten().flatten().all(|v: &f64| v.abs() <= 4000.0), "{}", path.display());
    Got { result, notes, facets }
}

/// Facets that were counted and handed on, or samples.
fn amount(got: &Got) -> usize {
    match got.result.as_ref().expect("accepted") {
        Content::Facets(n) => {
            assert_eq!(*n, got.facets.len());
            *n
        }
        Content::Heightmap(map) => {
            assert_eq!(map.samples.len(), map.columns * map.rows);
            map.samples.len()
        }
    }
}

fn codes(notes: &[Diag]) -> Vec<&'static str> {
    assert!(notes.iter().all(|d| d.kind == Kind::Warning && !d.hint.is_empty()), "{notes:?}");
    notes.iter().map(|d| d.code).collect()
}

#[test]
fn every_malformed_file_has_its_outcome() {
    let Some(folder) = data("bad") else { return };
    for (name, want) in BAD {
        let got = read_at(&folder.join(name), 1.0);
        match want {
            Refused(code, place, say) => {
                let e = got.result.as_ref().err().unwrap_or_else(|| panic!("{name} was accepted"));
                let d = &e.diags()[0];
                assert_eq!((d.code, d.kind, e.exit_code()), (*code, Kind::Input, 2), "{d}");
                let at = d.place.to_string();
                assert!(at.contains(name) && at.ends_with(place), "{d}");
                assert!(d.message.contains(say) && !d.hint.is_empty(), "{d}");
            }
            Accepted(n, warnings) => {
                assert_eq!(codes(&got.notes), *warnings, "{name}: {:?}", got.notes);
                assert_eq!(amount(&got), *n, "{name}");
            }
        }
    }
}

#[test]
fn the_table_has_a_row_for_every_malformed_file() {
    let Some(folder) = data("bad") else { return };
    let mut missing: Vec<String> = std::fs::read_dir(folder)
        .expect("a folder")
        .map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned())
        .filter(|name| ["stl_", "obj_", "png_", "pngsuite_", "xyz_"].iter().any(|p| name.starts_with(p)))
        .filter(|name| !BAD.iter().any(|(known, _)| known == name))
        .collect();
    missing.sort();
    assert_eq!(missing, Vec::<String>::new());
}

#[test]
fn real_files_load_whole() {
    let Some(folder) = data("surfaces") else { return };
    for (name, unit_mm, n, warnings) in GOOD {
        let got = read_at(&folder.join(name), *unit_mm);
        assert!(got.result.is_ok(), "{name}: {:?}", got.result.as_ref().err());
        assert_eq!(codes(&got.notes), *warnings, "{name}");
        assert_eq!(amount(&got), *n, "{name}");
    }
}

#[test]
fn real_clouds_are_covered_but_for_slivers_at_their_border() {
    let Some(folder) = data("surfaces") else { return };
    for (name, unit_mm, points, hull_mm2) in [
        ("mirror_cloud_shuffled.xyz", 1.0, 16_969, 43_338.857),
        // UTM metres lie 5,100 km from their origin; a map scale brings them in reach.
        ("helens_cloud_utm.xyz", 5e-4, 40_000, 33.470_887),
    ] {
        let got = read_at(&folder.join(name), unit_mm);
        assert_eq!(codes(&got.notes), [""; 0], "{name}");
        let n = amount(&got);
        let area = |[a, b, c]: &[[f64; 3]; 3]| ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])) / 2.0;
        assert!(got.facets.iter().all(|f| area(f) > 0.0), "{name}");
        let part = got.facets.iter().map(area).sum::<f64>() / hull_mm2;
        assert!(n <= 2 * points - 5 && n > 2 * points - 2 - points / 50, "{name}: {n}");
        assert!(part < 1.000_001 && part > 0.99, "{name}: {part}");
    }
}

#[test]
fn interlaced_height_maps_equal_plain_ones() {
    let Some(folder) = data("textures") else { return };
    let samples = |name: &str| match read_at(&folder.join(name), 1.0).result.expect(name) {
        Content::Heightmap(map) => map.samples,
        Content::Facets(_) => panic!("{name} is a height map"),
    };
    let plain = samples("pngsuite_basn0g16.png");
    assert!(plain.len() == 32 * 32 && plain.iter().any(|&v| v > 40_000));
    assert_eq!(samples("pngsuite_basi0g16.png"), plain);
    assert_eq!(samples("pngsuite_oi9n0g16.png"), plain, "one IDAT for every byte");
    for name in ["pngsuite_basn0g01.png", "pngsuite_basn3p04.png", "pngsuite_basn6a16.png", "pngsuite_basn4a08.png"] {
        let e = read_at(&folder.join(name), 1.0).result.err().expect(name);
        assert_eq!(e.diags()[0].code, "heightmap-samples", "{e}");
    }
}

#[test]
fn a_cloud_in_utm_metres_is_refused_by_its_size() {
    let Some(folder) = data("surfaces") else { return };
    let e = read_at(&folder.join("helens_cloud_utm.xyz"), 1000.0).result.err().expect("refused");
    assert_eq!(e.diags()[0].code, "surface-size", "{e}");
    assert!(e.to_string().contains("1000 mm"), "{e}");
}

#[test]
fn a_file_without_unit_scale_or_known_extension_is_refused() {
    for (name, code, say) in [
        ("a.stl", "surface-unit", "an STL file carries no unit (add unit = \"mm\" to [surface])"),
        ("a.OBJ", "surface-unit", "an OBJ file carries no unit"),
        ("a.csv", "surface-unit", "a point cloud carries no unit"),
        ("a.Png", "heightmap-scale", "add [surface.heightmap]"),
        ("a.step", "surface-format", "chord tolerance"),
        ("a.doc", "surface-format", ".stl, .obj, .png"),
        ("stl", "surface-format", "no extension"),
    ] {
        let e = read(Path::new(name), &Options::default(), &mut vec![], &mut |_| {}).err().expect(name);
        assert_eq!(e.diags()[0].code, code, "{e}");
        assert!(e.to_string().starts_with(name) && e.to_string().contains(say), "{e}");
    }
    let folder = tempfile::tempdir().expect("a folder");
    let e = read_at(&folder.path().join("absent.stl"), 1.0).result.err().expect("refused");
    assert_eq!(e.diags()[0].code, "file-unreadable");
    let as_folder = folder.path().join("folder.png");
    std::fs::create_dir(&as_folder).expect("made");
    assert_eq!(read_at(&as_folder, 1.0).result.err().expect("refused").diags()[0].code, "file-unreadable");
}

/// Small valid files of each kind.
fn seeds() -> Vec<(&'static str, Vec<u8>)> {
    let ascii = "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 9 0 0\nvertex 0 9 0\nendloop\nendfacet\nendsolid a\n";
    let mut binary = vec![b' '; 80];
    binary.extend(2u32.to_le_bytes());
    for v in [0.0f32, 0.0, 1.0, 0.0, 0.0, 0.0, 9.0, 0.0, 0.0, 0.0, 9.0, 0.0].iter().cycle().take(24).enumerate() {
        binary.extend(v.1.to_le_bytes());
        if v.0 % 12 == 11 {
            binary.extend([0; 2]);
        }
    }
    let obj = "v 0 0 0\nv 9 0 0\nv 9 9 0\nv 0 9 1\nv 4 5 2\nf 1 2 3 4 5\nf -1/1 -2//2 \\\n -3/1/1\n# end\n";
    let mut points = String::from("x, y, z, q\n");
    for i in 0..40 {
        points += &format!("{}, {}, {}, 1\n", i % 7, i / 7, (i * 13) % 5);
    }
    let mut images = vec![];
    for depth in [png::BitDepth::Eight, png::BitDepth::Sixteen] {
        let mut image = vec![];
        let mut encoder = png::Encoder::new(&mut image, 6, 5);
        encoder.set_color(png::ColorType::Grayscale);
        encoder.set_depth(depth);
        let bytes: Vec<u8> =
            (0..30 * if depth == png::BitDepth::Eight { 1u8 } else { 2 }).map(|i| i.wrapping_mul(37)).collect();
        encoder.write_header().and_then(|mut w| w.write_image_data(&bytes)).expect("encoded");
        images.push(("png", image));
    }
    let mut all = vec![("stl", ascii.into()), ("stl", binary), ("obj", obj.into()), ("xyz", points.into())];
    all.extend(images);
    all
}

/// A small generator of its own, so that every run makes the same files.
struct Random(u64);

impl Random {
    fn below(&mut self, n: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 % n.max(1) as u64) as usize
    }
}

/// Damages a file in one of the ways that files get damaged.
fn damage(bytes: &mut Vec<u8>, random: &mut Random) {
    const WORDS: &[&str] = &[
        "nan",
        "-1e39",
        "1e400",
        "0",
        "-0",
        ",",
        ";",
        "\n",
        "\r",
        " ",
        "\\\n",
        "9999999999",
        "f",
        "v",
        "endloop",
        "/",
    ];
    let at = random.below(bytes.len());
    match random.below(6) {
        0 if !bytes.is_empty() => bytes[at] = random.below(256) as u8,
        1 if !bytes.is_empty() => bytes[at] ^= 1 << random.below(8),
        2 => bytes.truncate(at),
        3 => {
            let word = WORDS[random.below(WORDS.len())];
            bytes.splice(at..at, word.bytes());
        }
        4 => {
            let end = (at + random.below(12)).min(bytes.len());
            bytes.drain(at..end);
        }
        _ => {
            let end = (at + random.below(60)).min(bytes.len());
            let copy = bytes[at..end].to_vec();
            bytes.splice(at..at, copy);
        }
    }
}

#[test]
fn damaged_files_never_panic_and_never_yield_what_is_no_length() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut random = Random(0x9e37_79b9_7f4a_7c15);
    let (mut accepted, mut refused) = (0, 0);
    for (extension, seed) in seeds() {
        let path = folder.path().join(format!("a.{extension}"));
        std::fs::write(&path, &seed).expect("written");
        assert!(read_at(&path, 1.0).result.is_ok(), "the undamaged {extension} file loads");
        for _ in 0..1500 {
            let mut bytes = seed.clone();
            for _ in 0..1 + random.below(3) {
                damage(&mut bytes, &mut random);
            }
            std::fs::write(&path, &bytes).expect("written");
            match read_at(&path, 1.0).result {
                Ok(_) => accepted += 1,
                Err(e) => {
                    refused += 1;
                    let d = &e.diags()[0];
                    assert!(d.place.to_string().contains("a.") && !d.message.is_empty(), "{d}");
                    assert_eq!(d.kind, Kind::Input, "{d}");
                }
            }
        }
        for length in (0..300).step_by(7) {
            let noise: Vec<u8> = (0..length).map(|_| random.below(256) as u8).collect();
            std::fs::write(&path, noise).expect("written");
            assert!(read_at(&path, 1.0).result.is_err(), "noise is no {extension} file");
        }
    }
    assert!(accepted > 500 && refused > 3000, "{accepted} accepted, {refused} refused");
}
