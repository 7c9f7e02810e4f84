//! Malformed and odd surface files, one row each, and real ones: the outcome is fixed here.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::Path;
use std::time::{Duration, Instant};

use crate::support::image::{self, Colour};
use crate::support::surfaces::Random;
use crate::support::{fixture, folder, malformed, processor, shared};
use terrace_core::diag::{Diag, Error, Kind};
use terrace_input::surface::{Content, Options, Samples, Scale, read};

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
    ("obj_overflow_float.obj", Refused("surface-number", ":1", "not a finite number")),
    ("ply_bad_format.ply", Refused("ply-header", ":2", "binary_middle_endian")),
    ("ply_huge_vertex_count.ply", Refused("ply-truncated", ".ply", "the file has 214 bytes")),
    ("ply_index_range.ply", Refused("ply-index", ".ply", "vertex 70000")),
    ("ply_neg_index.ply", Refused("ply-index", ".ply", "vertex -1")),
    ("ply_no_end_header.ply", Refused("ply-header", ":10000", "end_header")),
    ("ply_truncated.ply", Refused("ply-truncated", ".ply", "ends inside face 0")),
    ("png_bad_idat_crc.png", Refused("png-damaged", ".png", "check sum")),
    ("png_bad_ihdr_crc.png", Refused("png-damaged", ".png", "check sum")),
    ("png_decompression_bomb.png", Refused("heightmap-size", ".png", "30000 x 30000")),
    ("png_flat_black.png", Accepted(64 * 64, &["heightmap-flat"])),
    ("png_huge_dims.png", Refused("heightmap-size", ".png", "2147483647")),
    ("png_is_jpeg.png", Refused("surface-format", ".png", "JPEG")),
    ("png_truncated.png", Refused("png-truncated", ".png", "too early")),
    ("png_zero_dims.png", Refused("png-damaged", ".png", "")),
    ("png_one_bit.png", Refused("heightmap-samples", ".png", "1-bit greyscale")),
    ("png_one_bit_no_idat.png", Refused("heightmap-samples", ".png", "1-bit greyscale")),
    ("png_newline_in_signature.png", Refused("surface-format", ".png", "signature")),
    ("3mf_bad_crc.3mf", Refused("3mf-archive", ".3mf", "3D/3dmodel.model is damaged")),
    ("3mf_component_bomb_10e10.3mf", Refused("3mf-components", ".3mf", "at most 1000000")),
    ("3mf_component_cycle.3mf", Refused("3mf-components", ".3mf", "component of itself")),
    // Refused as a mesh, like STL files without area.
    ("3mf_identical_vertices.3mf", Accepted(200_000, &["surface-tiny"])),
    ("3mf_index_out_of_range.3mf", Refused("3mf-index", ".3mf", "4294967295")),
    ("3mf_missing_model_part.3mf", Refused("3mf-part", ".3mf", "is not in the archive")),
    ("3mf_nan_transform.3mf", Refused("3mf-transform", ".3mf", "\"nan\"")),
    ("3mf_no_build_items.3mf", Refused("3mf-object", ".3mf", "no build items")),
    ("3mf_path_traversal.3mf", Accepted(4, &[])),
    ("3mf_singular_transform.3mf", Refused("3mf-transform", ".3mf", "flat")),
    ("3mf_target_outside.3mf", Refused("3mf-part", ".3mf", "etc/passwd\", which lies outside")),
    ("3mf_truncated_zip.3mf", Refused("3mf-archive", ".3mf", "the archive is damaged")),
    ("3mf_unknown_unit.3mf", Refused("surface-unit", ".3mf", "furlong")),
    ("3mf_xml_bomb.3mf", Refused("3mf-xml", ".3mf", "DTD")),
    ("3mf_zip_bomb.3mf", Refused("3mf-archive", ".3mf", "has 500001")),
    ("tiff_cyclic_ifd.tif", Refused("tiff-damaged", ".tif", "cycle")),
    ("tiff_huge_strip.tif", Refused("heightmap-samples", ".tif", "photometric")),
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
    ("hood_ascii_quads.ply", 1.0, 4500, &[]),
    ("hood_bin_be_double.ply", 1.0, 4500, &[]),
    ("hood_bin_le_float.ply", 1.0, 4500, &[]),
    ("cycloidal.ply", 25.4, 43_368, &[]),
    ("fuze_ascii.ply", 1000.0, 1000, &[]),
    ("mirror_freeform_f64.ply", 1.0, 28_800, &[]),
    ("helens_dem_u16_decimetre.png", 1.0, 327 * 468, &[]),
    ("hood_u16_2mm.png", 1.0, 640 * 780, &[]),
    ("hood_u8_2mm.png", 1.0, 640 * 780, &["heightmap-8-bit"]),
    ("jacksboro_dem_u16_m.png", 1.0, 403 * 344, &[]),
];

struct Got {
    result: Result<Content, Error>,
    notes: Vec<Diag>,
    facets: Vec<[[f64; 3]; 3]>,
}

fn read_at(path: &Path, unit_mm: f64) -> Got {
    let scale = Scale { pixel_mm: 2.0, z_mm: [0.0, 100.0], values: None, nodata: None, origin_mm: [0.0; 2] };
    let has_scale = ["png", "tif"].iter().any(|e| path.extension().is_some_and(|of| of == *e));
    let heightmap = has_scale.then_some(scale);
    let unit_mm = path.extension().is_none_or(|e| !e.eq_ignore_ascii_case("3mf")).then_some(unit_mm);
    let options = Options { unit_mm, heightmap, ..Default::default() };
    let (mut notes, mut facets) = (vec![], vec![]);
    let name = path.display().to_string();
    let result = processor::within(5, &name, || read(path, &options, &mut notes, &mut |f| facets.push(f)));
    assert!(facets.iter().flatten().flatten().all(|v: &f64| v.abs() <= 4000.0), "{}", path.display());
    Got { result, notes, facets }
}

/// Facets that were counted and handed on, or samples.
fn amount(got: &Got) -> usize {
    match got.result.as_ref().expect("accepted") {
        Content::Facets(n) | Content::Tessellated(n, _) => {
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
fn malformed_files_give_the_expected_messages() {
    let dir = folder();
    for (name, want) in BAD {
        let got = read_at(&malformed::file(dir.path(), name), 1.0);
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
    let missing: Vec<String> = malformed::names()
        .into_iter()
        .filter(|name| ["stl_", "obj_", "ply_", "png_", "3mf_", "tiff_", "xyz_"].iter().any(|p| name.starts_with(p)))
        .filter(|name| !BAD.iter().any(|(known, _)| known == name))
        .collect();
    assert_eq!(missing, Vec::<String>::new());
}

/// Reads a file and asserts that it is accepted with that many facets or samples, and these warnings.
fn assert_loads(path: &Path, unit_mm: f64, n: usize, warnings: &[&str]) {
    let got = read_at(path, unit_mm);
    assert!(got.result.is_ok(), "{}: {:?}", path.display(), got.result.as_ref().err());
    assert_eq!(codes(&got.notes), warnings, "{}", path.display());
    assert_eq!(amount(&got), n, "{}", path.display());
}

#[test]
fn valid_files_load_with_every_facet() {
    let dir = folder();
    assert_loads(&fixture("hood.stl"), 1.0, 18_000, &[]);
    assert_loads(&fixture("panel.obj"), 1.0, 7, &[]);
    let image = dir.path().join("map.png");
    std::fs::write(&image, image::height_map(40, &ramp(40))).expect("written");
    assert_loads(&image, 1.0, 40 * 40, &[]);
}

#[test]
#[ignore = "needs ../shared: make test-all"]
fn valid_files_of_other_sources_load_with_every_facet() {
    let folder = shared().join("surfaces");
    for (name, unit_mm, n, warnings) in GOOD {
        assert_loads(&folder.join(name), *unit_mm, *n, warnings);
    }
}

/// Asserts that a cloud is triangulated up to slivers at its border; `hull_mm2` is the area of its convex hull.
fn assert_covers(path: &Path, unit_mm: f64, points: usize, hull_mm2: f64) {
    let (got, name) = (read_at(path, unit_mm), path.display());
    assert_eq!(codes(&got.notes), [""; 0], "{name}");
    let n = amount(&got);
    let area = |[a, b, c]: &[[f64; 3]; 3]| ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])) / 2.0;
    assert!(got.facets.iter().all(|f| area(f) > 0.0), "{name}");
    let part = got.facets.iter().map(area).sum::<f64>() / hull_mm2;
    assert!(n <= 2 * points - 5 && n > 2 * points - 2 - points / 50, "{name}: {n}");
    assert!(part < 1.000_001 && part > 0.99, "{name}: {part}");
}

#[test]
fn clouds_are_triangulated_up_to_slivers_at_their_border() {
    let dir = folder();
    // A mirror in an elliptic aperture of 250 x 160 mm; and the same, smaller and 3 m from the origin.
    for (name, unit_mm, origin) in [("near.xyz", 1.0, [0.0, 0.0]), ("far.xyz", 0.02, [57_805.0, 158_025.0])] {
        let (path, mut noise) = (dir.path().join(name), Random::new(3));
        let mut points: Vec<[f64; 2]> = Vec::new();
        for (i, j) in (0..100).flat_map(|j| (0..100).map(move |i| (i, j))) {
            let (u, v) = (f64::from(i) / 49.5 - 1.0, f64::from(j) / 49.5 - 1.0);
            if u * u + v * v <= 1.0 {
                points.push([125.0 * u + noise.half() + origin[0], 80.0 * v + noise.half() + origin[1]]);
            }
        }
        noise.shuffle(&mut points);
        let line = |[x, y]: &[f64; 2]| format!("{x:.6} {y:.6} {:.6}\n", ((x - origin[0]).powi(2)) / 900.0);
        std::fs::write(&path, points.iter().map(line).collect::<String>()).expect("written");
        assert_covers(&path, unit_mm, points.len(), hull_area(&points) * unit_mm * unit_mm);
    }
}

/// Area of the convex hull (Andrew's monotone chain).
fn hull_area(points: &[[f64; 2]]) -> f64 {
    let cross = |a: [f64; 2], b: [f64; 2], c: [f64; 2]| (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    let mut sorted = points.to_vec();
    sorted.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    let mut hull: Vec<[f64; 2]> = Vec::new();
    for _ in 0..2 {
        let start = hull.len();
        for &p in &sorted {
            while hull.len() >= start + 2 && cross(hull[hull.len() - 2], hull[hull.len() - 1], p) <= 0.0 {
                hull.pop();
            }
            hull.push(p);
        }
        hull.pop();
        sorted.reverse();
    }
    (2..hull.len()).map(|i| cross(hull[0], hull[i - 1], hull[i])).sum::<f64>() / 2.0
}

#[test]
#[ignore = "needs ../shared: make test-all"]
fn clouds_of_other_sources_are_triangulated_up_to_slivers_at_their_border() {
    let folder = shared().join("surfaces");
    assert_covers(&folder.join("mirror_cloud_shuffled.xyz"), 1.0, 16_969, 43_338.857);
    // UTM metres lie 5,100 km from their origin; a map scale brings them in reach.
    assert_covers(&folder.join("helens_cloud_utm.xyz"), 5e-4, 40_000, 33.470_887);
}

/// Samples of a square map that tell row, column and both bytes.
fn ramp(side: usize) -> Vec<u16> {
    (0..side * side).map(|i| (i * 40_503 % 65_521) as u16).collect()
}

#[test]
fn interlaced_height_maps_equal_plain_ones() {
    let dir = folder();
    let path = dir.path().join("map.png");
    let read = |image: Vec<u8>| {
        std::fs::write(&path, image).expect("written");
        read_at(&path, 1.0).result
    };
    for side in [5, 32] {
        let samples = ramp(side);
        // A height map holds the lowest y, the last row of the file, first.
        let want: Vec<u16> = samples.chunks(side).rev().flatten().copied().collect();
        // In one IDAT chunk, and in one for every byte.
        for (interlaced, size) in [(false, 1 << 20), (true, 1 << 20), (false, 1), (true, 1)] {
            match read(image::grey16(side, &samples, interlaced, size)).expect("a height map") {
                Content::Heightmap(map) => {
                    assert_eq!(map.samples, Samples::Whole(want.clone(), None), "{side} {interlaced} {size}");
                }
                _ => panic!("a height map has samples"),
            }
        }
    }
    for (depth, colour) in [(1, Colour::Grey), (4, Colour::Palette), (16, Colour::Rgba), (8, Colour::GreyAlpha)] {
        let e = read(image::zeros(32, depth, colour)).err().expect("refused");
        assert_eq!(e.diags()[0].code, "heightmap-samples", "{e}");
    }
}

#[test]
fn a_cloud_in_utm_metres_is_refused_by_its_size() {
    let dir = folder();
    let path = dir.path().join("utm.xyz");
    let points = (0..9).map(|i| format!("{} {} 684\n", 557_805 + 30 * (i % 3), 5_108_025 + 30 * (i / 3)));
    std::fs::write(&path, points.collect::<String>()).expect("written");
    let e = read_at(&path, 1000.0).result.err().expect("refused");
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
        ("a.step", "file-unreadable", "cannot read"),
        ("a.sldprt", "surface-format", "export it from the CAD program as STEP"),
        ("a.ply", "surface-unit", "a PLY file carries no unit"),
        (
            "a.doc",
            "surface-format",
            ".stl, .obj, .ply, .3mf, .step, .stp, .iges, .igs, .png, .tif, .tiff (height maps)",
        ),
        ("a.TIFF", "heightmap-scale", "add [surface.heightmap]"),
        ("a.dem", "surface-format", "gdal_translate"),
        ("a.asc", "surface-unit", "a point cloud carries no unit"),
        ("a.grd", "surface-format", "gdal_translate"),
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
    let grid =
        "ncols 4\nnrows 3\nxllcorner 1\nyllcorner 2\ncellsize 2.5\nNODATA_value -9\n1 2 3 4\n5 -9 7 8\n9 1 2 3\n";
    all.extend([("asc", grid.into()), ("3mf", threemf()), ("tif", tiff())]);
    all.extend(more_seeds());
    all
}

/// The less usual forms of text and of PLY.
fn more_seeds() -> Vec<(&'static str, Vec<u8>)> {
    let stl = "solid UNITS=mm facet normal 0 0 1 outer loop vertex 0 0 0 vertex 9 0 0 vertex 0 9D0 0 endloop endfacet\n\
               color 1 0 0 facet normal nan 0 0\nouter loop vertex 0 0 1 vertex 9 0 1\nvertex 0 9 1 endloop endfacet endsolid a\n\x1a";
    let obj = "# units: mm\nf 1 2 3 # C:\\a\\\nf 3 4 5\nv 0 0 0\nv 9 0 0\nv 9 9 0 1\no b\\\nv 0 9 1\nv 4 5 2 1 0 0\n\
               v nan 0 0\nf 1 \\\n 2 5\nfo -4 -3 -2\nsurf 1 2\n";
    let points = "sep=;\n% units: mm\n12\nid;Y [mm];X [mm];Z [mm];note\n";
    let row = |i: usize| format!("{i};{};{};{};a\n", i % 4, i / 4, (i * 7) % 3);
    let points = (0..12).map(row).fold(points.to_owned(), |all, row| all + &row);
    let scan = "2\n3\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n5 6 7 1\n\
                0 0 0 0.5\n9 0 1 0.5\n0 9 2 0.5\n9 9 1 0.5\n5 4 1 0.5\n0 0 0 0\n";
    let head = |format: &str| {
        format!(
            "ply\nformat {format} 1.0\ncomment units: mm\nmade by hand\nelement vertex 4\nproperty float x\n\
             property float y\nproperty float z\nproperty uchar red\nelement face 2\n\
             property list uchar int vertex_indices\nelement tristrips 1\n\
             property list int int vertex_indices\nend_header\n"
        )
    };
    let ascii = head("ascii") + "0 0 0 7\n9 0 0 nan\n9 9 0 x\n0 9 1 7\n4 0 1 2 3\n2 0 1\n7 0 1 2 3 -1 0 1\n";
    let mut binary = head("binary_little_endian").into_bytes();
    for p in [[0.0f32, 0.0, 0.0], [9.0, 0.0, 0.0], [9.0, 9.0, 0.0], [0.0, 9.0, 1.0]] {
        p.iter().for_each(|v| binary.extend(v.to_le_bytes()));
        binary.push(7);
    }
    for corners in [&[0i32, 1, 2, 3][..], &[0, 1]] {
        binary.push(corners.len() as u8);
        corners.iter().for_each(|i| binary.extend(i.to_le_bytes()));
    }
    [5i32, 0, 1, 2, 3, -1].iter().for_each(|i| binary.extend(i.to_le_bytes()));
    let grid =
        "ncols 3\nnrows 2\nxllcorner 1\nyllcorner 2\ndx 2\ndy 2\nNODATA_value -3.4e38\nnan 2 3\n-3.40001e38 5 6\n";
    vec![
        ("stl", stl.into()),
        ("obj", obj.into()),
        ("csv", points.into()),
        ("txt", scan.into()),
        ("ply", ascii.into()),
        ("ply", binary),
        ("asc", grid.into()),
    ]
}

/// A 3MF file of one triangle, its parts stored as they are.
fn threemf() -> Vec<u8> {
    let mut out = std::io::Cursor::new(Vec::new());
    let mut archive = zip::ZipWriter::new(&mut out);
    let options = zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
    for (name, text) in [
        (
            "_rels/.rels",
            "<Relationships><Relationship Target=\"/a.model\" \
             Type=\"http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel\"/></Relationships>",
        ),
        (
            "a.model",
            "<model xmlns=\"http://schemas.microsoft.com/3dmanufacturing/core/2015/02\"><resources><object id=\"1\">\
             <mesh><vertices><vertex x=\"0\" y=\"0\" z=\"1\"/><vertex x=\"9\" y=\"0\" z=\"1\"/>\
             <vertex x=\"0\" y=\"9\" z=\"1\"/></vertices><triangles><triangle v1=\"0\" v2=\"1\" v3=\"2\"/></triangles>\
             </mesh></object></resources><build><item objectid=\"1\"/></build></model>",
        ),
    ] {
        archive.start_file(name, options).expect("a part");
        archive.write_all(text.as_bytes()).expect("written");
    }
    archive.finish().expect("an archive");
    out.into_inner()
}

/// A TIFF of 6 x 5 samples in 16 bits.
fn tiff() -> Vec<u8> {
    let mut out = std::io::Cursor::new(Vec::new());
    let data: Vec<u16> = (0..30).map(|i| i * 2111).collect();
    let mut encoder = tiff::encoder::TiffEncoder::new(&mut out).expect("an encoder");
    encoder.write_image::<tiff::encoder::colortype::Gray16>(6, 5, &data).expect("an image");
    out.into_inner()
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
        "#",
        "//",
        "-1",
        "-1.#IND",
        "1D5",
        "x y z",
        "[mm]",
        "units: in",
        "\x1a",
        "facet normal",
        "0 0 0\n0 0 0\n",
        "property list uchar int vertex_indices\n",
        "dy 3\n",
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

/// How many damaged files were accepted and refused.
#[derive(Default)]
struct Tally {
    accepted: usize,
    refused: usize,
}

impl Tally {
    /// Reads a damaged form of a file.
    fn damaged(&mut self, path: &Path, seed: &[u8], random: &mut Random) {
        let mut bytes = seed.to_vec();
        for _ in 0..1 + random.below(3) {
            damage(&mut bytes, random);
        }
        std::fs::write(path, &bytes).expect("written");
        match read_at(path, 1.0).result {
            Ok(_) => self.accepted += 1,
            Err(e) => {
                self.refused += 1;
                let d = &e.diags()[0];
                assert!(d.place.to_string().contains("a.") && !d.message.is_empty(), "{d}");
                assert_eq!(d.kind, Kind::Input, "{d}");
            }
        }
    }
}

#[test]
fn damaged_surface_files_never_panic_and_yield_finite_coordinates() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut random = Random::new(0x9e37_79b9_7f4a_7c15);
    let mut tally = Tally::default();
    for (extension, seed) in seeds() {
        let path = folder.path().join(format!("a.{extension}"));
        std::fs::write(&path, &seed).expect("written");
        let result = read_at(&path, 1.0).result;
        assert!(result.is_ok(), "the undamaged {extension} file loads: {:?}", result.err());
        for _ in 0..1000 {
            tally.damaged(&path, &seed, &mut random);
        }
        for length in (0..300).step_by(7) {
            let noise: Vec<u8> = (0..length).map(|_| random.below(256) as u8).collect();
            std::fs::write(&path, noise).expect("written");
            assert!(read_at(&path, 1.0).result.is_err(), "noise is no {extension} file");
        }
    }
    let Tally { accepted, refused } = tally;
    assert!(accepted > 500 && refused > 3000, "{accepted} accepted, {refused} refused");
}

/// The same for as long as `FUZZ_SECONDS` says for each format (10 where it says nothing), from `FUZZ_SEED`; only the
/// formats of `FUZZ_FORMATS` where that is set; a file that fails stays in `FUZZ_FOLDER`, where that is set.
#[test]
#[ignore = "takes as long as FUZZ_SECONDS says"]
fn damaged_surface_files_never_panic_for_minutes() {
    let number = |name: &str, default: u64| std::env::var(name).ok().and_then(|v| v.parse().ok()).unwrap_or(default);
    let time = Duration::from_secs(number("FUZZ_SECONDS", 10));
    let formats = std::env::var("FUZZ_FORMATS").ok();
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = std::env::var_os("FUZZ_FOLDER").map_or(temporary.path().to_owned(), Into::into);
    let mut by_format: BTreeMap<&str, Vec<Vec<u8>>> = BTreeMap::new();
    for (extension, seed) in seeds() {
        by_format.entry(extension).or_default().push(seed);
    }
    for (i, (extension, seeds)) in by_format.into_iter().enumerate() {
        if formats.as_ref().is_some_and(|formats| !formats.split(',').any(|format| format == extension)) {
            continue;
        }
        let path = folder.join(format!("a.{extension}"));
        let mut random = Random::new(number("FUZZ_SEED", 1) + i as u64);
        let (start, mut tally) = (Instant::now(), Tally::default());
        while start.elapsed() < time {
            seeds.iter().for_each(|seed| tally.damaged(&path, seed, &mut random));
        }
        eprintln!("{extension}: {} accepted, {} refused", tally.accepted, tally.refused);
    }
}
