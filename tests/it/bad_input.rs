//! Bad input through the program: one outcome for every malformed file and job, in little time and
//! memory, with a message that names file, place and remedy, and nothing written.
//!
//! The outcomes of the readers alone are fixed in `bad_surfaces.rs` and `bad_svg.rs`.

use std::path::Path;
use std::process::{Command, Output};

use crate::bad_svg::HEAVY;
use crate::support::{JobText, folder, machine_file, malformed, processor, said, shared, terrace, verify};
use serde_json::Value;

/// What `terrace compile` comes to.
enum Outcome {
    /// Exit 2 with this code, at this place: the end of what is shown of it.
    Refused(&'static str, &'static str),
    /// Exit 1 with this code.
    Limit(&'static str),
    /// Compiled with these warnings, and verified.
    Compiled(&'static [&'static str]),
}
use Outcome::{Compiled, Limit, Refused};

/// Keys of height maps.
const SCALE: &str = "[surface.heightmap]\npixel = \"1 mm\"\nz = [\"0 mm\", \"1 mm\"]";

const HATCH: &str = "pattern = \"hatch\"\npitch = \"0.5 mm\"";

const SURFACES: &[(&str, Outcome)] = &[
    ("stl_all_collinear.stl", Refused("surface-zero-area", ".stl")),
    ("stl_all_degenerate_point.stl", Refused("surface-zero-area", ".stl")),
    ("stl_vertical_only.stl", Refused("surface-edge-on", ".stl")),
    ("stl_ascii_4_vertices.stl", Refused("stl-ascii", ".stl:7")),
    ("stl_ascii_comma_decimals.stl", Refused("surface-number", ".stl:4")),
    ("stl_ascii_multi_solid.stl", Compiled(&["off-part"])),
    ("stl_ascii_nan.stl", Refused("surface-number", ".stl:5")),
    ("stl_ascii_no_endsolid.stl", Compiled(&["stl-no-endsolid", "off-part"])),
    ("stl_ascii_truncated.stl", Refused("stl-ascii", ".stl:6")),
    // Strips of a hood, longer than the stage's travel: a small texture on them, see below.
    ("stl_binary_starts_with_solid.stl", Compiled(&["incidence", "off-part", "depth-budget"])),
    ("stl_upside_down.stl", Compiled(&["surface-upside-down", "incidence", "off-part", "depth-budget"])),
    ("stl_count_too_big.stl", Refused("stl-truncated", ".stl")),
    ("stl_count_too_small.stl", Refused("stl-trailing", ".stl")),
    ("stl_count_zero.stl", Refused("surface-empty", ".stl")),
    ("stl_empty_file.stl", Refused("surface-empty", ".stl")),
    ("stl_header_only_40.stl", Refused("stl-truncated", ".stl")),
    ("stl_huge_coord.stl", Refused("surface-size", ".stl, facet 7")),
    ("stl_inf_vertices.stl", Refused("surface-number", ".stl, facet 7")),
    ("stl_is_really_png.stl", Refused("surface-format", ".stl")),
    // A part of a micrometre: no line of the texture meets it, and its unit is warned of.
    ("stl_micro_units.stl", Limit("job-empty")),
    ("stl_nan_vertices.stl", Refused("surface-number", ".stl, facet 7")),
    ("stl_truncated_mid_facet.stl", Refused("stl-truncated", ".stl")),
    ("stl_utf16.stl", Refused("surface-format", ".stl")),
    ("obj_2gon.obj", Refused("obj-face", ".obj:3")),
    ("obj_huge_ngon.obj", Compiled(&["surface-degenerate", "off-part"])),
    ("obj_index_out_of_range.obj", Refused("obj-index", ".obj:4")),
    ("obj_index_zero.obj", Refused("obj-index", ".obj:4")),
    ("obj_mtllib_path_traversal.obj", Compiled(&["off-part"])),
    ("obj_neg_out_of_range.obj", Refused("obj-index", ".obj:4")),
    ("obj_no_faces.obj", Refused("surface-empty", ".obj")),
    ("obj_overflow_float.obj", Refused("surface-number", ".obj:1")),
    ("ply_bad_format.ply", Refused("ply-header", ".ply:2")),
    ("ply_huge_vertex_count.ply", Refused("ply-truncated", ".ply")),
    ("ply_index_range.ply", Refused("ply-index", ".ply")),
    ("ply_neg_index.ply", Refused("ply-index", ".ply")),
    ("ply_no_end_header.ply", Refused("ply-header", ".ply:10000")),
    ("ply_truncated.ply", Refused("ply-truncated", ".ply")),
    ("png_bad_idat_crc.png", Refused("png-damaged", ".png")),
    ("png_bad_ihdr_crc.png", Refused("png-damaged", ".png")),
    ("png_decompression_bomb.png", Refused("heightmap-size", ".png")),
    // A plate without depth can be marked: it is warned of.
    ("png_flat_black.png", Compiled(&["heightmap-flat"])),
    ("png_huge_dims.png", Refused("heightmap-size", ".png")),
    ("png_is_jpeg.png", Refused("surface-format", ".png")),
    ("png_truncated.png", Refused("png-truncated", ".png")),
    ("png_zero_dims.png", Refused("png-damaged", ".png")),
    ("png_one_bit.png", Refused("heightmap-samples", ".png")),
    ("png_one_bit_no_idat.png", Refused("heightmap-samples", ".png")),
    ("png_newline_in_signature.png", Refused("surface-format", ".png")),
    ("3mf_bad_crc.3mf", Refused("3mf-archive", ".3mf")),
    ("3mf_component_bomb_10e10.3mf", Refused("3mf-components", ".3mf")),
    ("3mf_component_cycle.3mf", Refused("3mf-components", ".3mf")),
    ("3mf_identical_vertices.3mf", Refused("surface-zero-area", ".3mf")),
    ("3mf_index_out_of_range.3mf", Refused("3mf-index", ".3mf")),
    ("3mf_missing_model_part.3mf", Refused("3mf-part", ".3mf")),
    ("3mf_nan_transform.3mf", Refused("3mf-transform", ".3mf")),
    ("3mf_no_build_items.3mf", Refused("3mf-object", ".3mf")),
    ("3mf_path_traversal.3mf", Compiled(&["incidence", "off-part", "depth-budget"])),
    ("3mf_singular_transform.3mf", Refused("3mf-transform", ".3mf")),
    ("3mf_target_outside.3mf", Refused("3mf-part", ".3mf")),
    ("3mf_truncated_zip.3mf", Refused("3mf-archive", ".3mf")),
    ("3mf_unknown_unit.3mf", Refused("surface-unit", ".3mf")),
    ("3mf_xml_bomb.3mf", Refused("3mf-xml", ".3mf")),
    ("3mf_zip_bomb.3mf", Refused("3mf-archive", ".3mf")),
    ("tiff_cyclic_ifd.tif", Refused("tiff-damaged", ".tif")),
    ("tiff_huge_strip.tif", Refused("heightmap-samples", ".tif")),
    ("xyz_all_one_line.xyz", Refused("points-no-surface", ".xyz")),
    ("xyz_mixed_columns.xyz", Refused("points-columns", ".xyz:2")),
    ("xyz_nan.xyz", Compiled(&["points-not-finite", "incidence", "depth-budget"])),
];

/// Without a size in the job: a page that has none of its own is refused.
const DRAWINGS: &[(&str, Outcome)] = &[
    ("svg_arc_extremes.svg", Compiled(&[])),
    ("svg_billion_laughs.svg", Refused("svg-dtd", ".svg:1")),
    ("svg_deep_groups_100k.svg", Refused("svg-deep", ".svg:1")),
    ("svg_deep_transforms_5k.svg", Refused("svg-deep", ".svg:1")),
    ("svg_empty.svg", Refused("svg-size", ".svg")),
    ("svg_external_entity.svg", Refused("svg-dtd", ".svg:1")),
    ("svg_external_refs.svg", Refused("svg-image", ".svg")),
    ("svg_hairline_slivers.svg", Refused("texture-empty", ".svg")),
    ("svg_huge_size.svg", Refused("texture-far", ".svg")),
    ("svg_huge_viewbox.svg", Compiled(&[])),
    ("svg_latin1.svg", Compiled(&[])),
    ("svg_negative_size.svg", Refused("svg-viewbox", ".svg")),
    ("svg_not_closed.svg", Refused("svg-xml", ".svg:1")),
    ("svg_only_text.svg", Refused("svg-text", ".svg")),
    ("svg_path_garbage.svg", Refused("texture-empty", ".svg")),
    ("svg_pattern_self_ref.svg", Refused("svg-paint", ".svg")),
    ("svg_pattern_tiny_tile.svg", Refused("svg-large", ".svg")),
    ("svg_quadratic_blowup.svg", Refused("svg-dtd", ".svg:1")),
    ("svg_self_intersecting_million.svg", Limit("texture-crossings")),
    ("svg_use_bomb.svg", Refused("svg-large", ".svg")),
    ("svg_use_cycle.svg", Refused("texture-empty", ".svg")),
    ("svg_utf16_bom.svg", Compiled(&[])),
    ("svg_wrong_namespace.svg", Refused("svg-size", ".svg")),
    ("svg_zero_viewbox.svg", Refused("svg-viewbox", ".svg")),
    ("svgz_bomb.svgz", Refused("svg-large", ".svgz")),
];

/// With `size = ["100 mm", "100 mm"]`.
const SIZED: &[(&str, Outcome)] = &[
    ("svg_empty.svg", Refused("texture-empty", ".svg")),
    ("svg_huge_size.svg", Compiled(&[])),
    ("svg_wrong_namespace.svg", Compiled(&["svg-namespace"])),
];

/// As textures, with `size = ["10 mm", "10 mm"]`.
const BITMAPS: &[(&str, Outcome)] = &[
    ("png_bad_idat_crc.png", Refused("bitmap-damaged", ".png")),
    ("png_bad_ihdr_crc.png", Refused("bitmap-damaged", ".png")),
    ("png_decompression_bomb.png", Limit("bitmap-large")),
    ("png_flat_black.png", Compiled(&[])),
    ("png_huge_dims.png", Limit("bitmap-large")),
    ("png_is_jpeg.png", Refused("bitmap-truncated", ".png")),
    ("png_truncated.png", Refused("bitmap-truncated", ".png")),
    ("png_zero_dims.png", Refused("bitmap-damaged", ".png")),
    ("png_one_bit.png", Compiled(&[])),
    ("png_one_bit_no_idat.png", Refused("bitmap-damaged", ".png")),
    ("png_newline_in_signature.png", Refused("bitmap-damaged", ".png")),
];

/// Compiles under a limit of 512 MB. The limit is one of address space, which is never less than the
/// memory in use; where it strikes the program aborts, and that is not an outcome of any table.
fn compile(job: &Path, out: &Path) -> Output {
    compile_within(512 << 10, job, out)
}

/// The same under another limit, kB.
fn compile_within(limit: u32, job: &Path, out: &Path) -> Output {
    let args = [Path::new("compile"), job, Path::new("-o"), out, Path::new("--json"), Path::new("-j2")];
    if cfg!(target_os = "linux") {
        let limited = format!("ulimit -v {limit} && test $(ulimit -v) = {limit}");
        let script = format!("{limited} && \"$0\" \"$@\"; code=$?; times >&2; exit $code");
        let mut shell = Command::new("sh");
        // Else every thread reserves 64 MB of addresses that it does not use.
        shell.env("MALLOC_ARENA_MAX", "1").args(["-c", &script, env!("CARGO_BIN_EXE_terrace")]).args(args);
        let mut done = shell.output().expect("sh starts");
        let seconds = processor::of_children(&mut done.stderr);
        assert!(seconds < 5.0, "{} took {seconds} s of the processor", job.display());
        done
    } else {
        terrace(args)
    }
}

/// The names of everything in a folder, hidden ones included.
fn names(dir: &Path) -> Vec<String> {
    let mut names: Vec<String> = std::fs::read_dir(dir)
        .expect("a readable folder")
        .map(|e| e.expect("a readable folder").file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

/// Compiles a job and holds it against its outcome; `file` is what the message must name.
fn check(job: &Path, file: &str, want: &Outcome) {
    let dir = job.parent().expect("a folder");
    let before = names(dir);
    let out = dir.join("out.job");
    let done = compile(job, &out);
    let text = said(&done);
    let code = match want {
        Refused(code, _) | Limit(code) => *code,
        Compiled(warnings) => {
            assert_eq!(done.status.code(), Some(0), "{file}: {text}");
            let summary: Value = serde_json::from_slice(&done.stdout).expect("one JSON object");
            let found: Vec<_> = summary["warnings"]
                .as_array()
                .expect("a list")
                .iter()
                .map(|w| w["code"].as_str().expect("text"))
                .collect();
            assert_eq!(found, *warnings, "{file}: {text}");
            verify(&out);
            std::fs::remove_dir_all(&out).expect("removed");
            return;
        }
    };
    assert!(text.contains(&format!("error[{code}]: ")), "{file}: {code} expected, got {text}");
    assert!(text.contains(" = help: "), "{file}: a remedy: {text}");
    let said: Value = serde_json::from_slice(&done.stdout).expect("one JSON object");
    assert!(said["errors"].as_array().expect("a list").iter().any(|e| e["code"] == *code), "{file}: {text}");
    match want {
        Refused(_, place) => {
            assert_eq!(done.status.code(), Some(2), "{file}: {text}");
            let at = text.lines().find(|l| l.trim_start().starts_with("--> ")).unwrap_or_default();
            // After the file an element may be named.
            let at = at.split(", element").next().unwrap_or_default();
            assert!(at.contains(file.trim_end_matches(place)) && at.ends_with(place), "{file}: its place: {text}");
        }
        _ => assert_eq!(done.status.code(), Some(1), "{file}: {text}"),
    }
    assert_eq!(names(dir), before, "{file}: nothing is written");
}

#[test]
#[ignore = "slow: make test-all"]
fn malformed_surfaces_give_the_expected_messages() {
    let dir = folder();
    for (name, want) in SURFACES {
        let path = malformed::file(dir.path(), name);
        let mut job = JobText::on(&path);
        job.more = "[limits]\nmax_off_part = \"100 %\"\n".into();
        if name.starts_with("png") || name.starts_with("tiff") {
            job.surface = job.surface.replace("unit = \"mm\"", SCALE);
        }
        let texture = match *name {
            "stl_binary_starts_with_solid.stl" | "stl_upside_down.stl" => {
                "pattern = \"hatch\"\npitch = \"1 mm\"\narea = [\"20 mm\", \"0 mm\", \"40 mm\", \"10 mm\"]"
            }
            _ => HATCH,
        };
        check(&job.texture(texture).write(dir.path(), "job.toml"), name, want);
    }
}

/// 3MF files that the consortium gives as ones that must fail, by what follows "3mfc_MUSTFAIL_Chapter".
const MUST_FAIL: &[(&str, &str)] = &[
    ("2.1.1a_PartsRelationships_NonExist3DModelPart", "3mf-part"),
    ("2.1.1b_PartsRelationships_LinkToExternal", "3mf-part"),
    ("2.1.2_PartsRelationships_MoreThanOne3DModelPart", "3mf-part"),
    ("2.1.3_PartsRelationships_NonExistThumbnailPart", "3mf-part"),
    ("2.1.4_PartsRelationships_MoreThanOnePrintTicket", "3mf-part"),
    ("2.3.2a_NonUTF_Encoding", "3mf-xml"),
    ("2.3.2b_DataTypeDefinitionInXMLMarkup", "3mf-xml"),
    ("2.3.2c_UndefinedNameSpaceInXDS", "3mf-xml"),
    ("2.3.2d_UndefinedXMLXSIInXSDSchema", "3mf-xml"),
    ("2.3.4_WhiteSpace", "3mf-xml"),
    ("3.4.3.1a_NotMatchingObjectIdInBuildItem", "3mf-object"),
    ("3.4.3.1b_BuildItemReferToObjectOfTypeOther", "3mf-object"),
];

#[test]
#[ignore = "needs ../shared: make test-all"]
fn malformed_surfaces_of_other_sources_give_the_expected_messages() {
    let bad = shared().join("bad");
    let dir = folder();
    let mut rows: Vec<(String, &Outcome)> = SURFACES.iter().map(|(name, want)| ((*name).to_owned(), want)).collect();
    rows.retain(|(name, _)| ["3mf_", "tiff_", "ply_"].iter().any(|p| name.starts_with(p)) && bad.join(name).exists());
    let must_fail: Vec<_> = MUST_FAIL.iter().map(|(name, code)| (name, Refused(code, ".3mf"))).collect();
    rows.extend(must_fail.iter().map(|(name, want)| (format!("3mfc_MUSTFAIL_Chapter{name}.3mf"), want)));
    // Names of metadata change no geometry, so what is wrong with them is a warning.
    for name in ["a_MissingMetadataName", "b_DuplicatedMetadataName"] {
        rows.push((format!("3mfc_MUSTFAIL_Chapter3.4.1{name}.3mf"), &Compiled(&["3mf-metadata"])));
    }
    rows.push(("3mf_bomb_2M_identical_verts.3mf".into(), &Refused("surface-zero-area", ".3mf")));
    rows.push(("3mf_zip_bomb_200MB.3mf".into(), &Refused("3mf-archive", ".3mf")));
    for (name, want) in &rows {
        let mut job = JobText::on(&bad.join(name));
        job.more = "[limits]\nmax_off_part = \"100 %\"\n".into();
        if name.starts_with("tiff") {
            job.surface = job.surface.replace("unit = \"mm\"", SCALE);
        }
        check(&job.texture(HATCH).write(dir.path(), "job.toml"), name, want);
    }
    for entry in std::fs::read_dir(&bad).expect("a readable folder") {
        let name = entry.expect("an entry").file_name().to_string_lossy().into_owned();
        let ours = ["3mf", "tiff_", "ply_"].iter().any(|p| name.starts_with(p));
        assert!(!ours || rows.iter().any(|(known, _)| *known == name), "{name} has no outcome");
    }
}

/// A plate of 100 x 100 mm as OBJ.
fn plate(dir: &Path) -> JobText {
    let path = dir.join("plate.obj");
    std::fs::write(&path, "v 0 0 0\nv 100 0 0\nv 100 100 0\nv 0 100 0\nf 1 2 3 4\n").expect("a writable folder");
    JobText::on(&path)
}

#[test]
fn paper_that_is_neither_a_colour_nor_a_lightness_is_refused() {
    let dir = folder();
    let svg = dir.path().join("a.svg");
    std::fs::write(
        &svg,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"9mm\" height=\"9mm\"><path d=\"M0 0h9v9z\"/></svg>",
    )
    .expect("writable");
    std::fs::copy(crate::support::fixture("aerofoil.png"), dir.path().join("a.png")).expect("copied");
    let of = |texture: &str| {
        let done =
            compile(&plate(dir.path()).texture(texture).write(dir.path(), "job.toml"), &dir.path().join("out.job"));
        (done.status.code(), said(&done))
    };
    for (paper, says) in [
        ("0.98", "paper has the lightness 1.0, which is not between 50 and 100"),
        ("101", "paper has the lightness 101.0"),
        ("nan", "paper has the lightness NaN"),
        ("\"black\"", "paper has the lightness 0.0"),
        ("\"cream\"", "\"cream\" is not a colour"),
        ("\"layer:A\"", "\"layer:A\" is not a colour"),
        ("true", "paper is a colour or a lightness"),
    ] {
        let (exit, text) = of(&format!("file = \"a.svg\"\npaper = {paper}"));
        assert!(exit == Some(2) && text.contains(says), "{paper}: {text}");
    }
    let (exit, text) = of(&format!("{HATCH}\npaper = 98"));
    assert!(exit == Some(2) && text.contains("paper does not apply to hatch"), "{text}");
    let (exit, text) = of("file = \"a.png\"\nsize = [\"9 mm\", \"9 mm\"]\npaper = 95");
    assert!(exit == Some(2) && text.contains("paper does not apply to a bitmap"), "{text}");
    for paper in ["98", "97.5", "\"#fefefe\"", "\"white\""] {
        let (exit, text) = of(&format!("file = \"a.svg\"\npaper = {paper}"));
        assert!(exit == Some(0), "{paper}: {text}");
    }
}

#[test]
fn malformed_drawings_give_the_expected_messages() {
    check_drawings(|name| !HEAVY.contains(&name));
}

#[test]
#[ignore = "slow: make test-all"]
fn heavy_drawings_give_the_expected_messages() {
    check_drawings(|name| HEAVY.contains(&name));
}

/// Compiles the drawings of the tables that are wanted.
fn check_drawings(is_wanted: fn(&str) -> bool) {
    let dir = folder();
    for (table, size) in [(DRAWINGS, ""), (SIZED, "\nsize = [\"100 mm\", \"100 mm\"]")] {
        for (name, want) in table.iter().filter(|(name, _)| is_wanted(name)) {
            let texture = format!("file = {:?}{size}", malformed::file(dir.path(), name).display().to_string());
            check(&plate(dir.path()).texture(&texture).write(dir.path(), "job.toml"), name, want);
        }
    }
}

#[test]
fn a_path_that_leads_somewhere_on_windows_alone_is_refused_at_its_line() {
    let dir = folder();
    let job = plate(dir.path()).texture("file = 'sub\\a.svg'").write(dir.path(), "job.toml");
    std::fs::write(dir.path().join("jobs.txt"), "# all\nsub\\job.toml\n").expect("written");
    let list = dir.path().join("jobs.txt");
    let text = std::fs::read_to_string(&job).expect("readable");
    let line = text.lines().position(|line| line.contains("sub")).expect("a line") + 1;
    for (command, file, at, write) in [
        ("check", &job, format!("job.toml:{line}"), "write sub/a.svg"),
        ("batch", &list, "jobs.txt:2".into(), "write sub/job.toml"),
    ] {
        let done = terrace([Path::new(command), file]);
        let text = said(&done);
        assert_eq!(done.status.code(), Some(2), "{text}");
        assert!(text.contains("error[path-backslash]") && text.contains(&at) && text.contains(write), "{text}");
    }
}

#[test]
fn malformed_bitmaps_give_the_expected_messages() {
    let dir = folder();
    for (name, want) in BITMAPS {
        let file = malformed::file(dir.path(), name).display().to_string();
        let texture = format!("file = {file:?}\nsize = [\"10 mm\", \"10 mm\"]");
        check(&plate(dir.path()).texture(&texture).write(dir.path(), "job.toml"), name, want);
    }
}

#[test]
fn every_malformed_file_is_in_a_table() {
    let tables = || SURFACES.iter().chain(DRAWINGS).map(|(name, _)| *name);
    for name in malformed::names() {
        let ours = ["stl_", "obj_", "ply_", "png", "3mf_", "tiff_", "svg", "xyz_"].iter().any(|p| name.starts_with(p));
        assert!(!ours || tables().any(|n| n == name), "{name} has no outcome");
        let is_bitmap = BITMAPS.iter().any(|(n, _)| *n == name);
        assert!(is_bitmap || !name.starts_with("png"), "{name} has no outcome as a texture");
    }
}

#[test]
fn warnings_are_printed_with_the_error() {
    let dir = folder();
    let tiny =
        JobText::on(&malformed::file(dir.path(), "stl_micro_units.stl")).texture(HATCH).write(dir.path(), "tiny.toml");
    let text = said(&compile(&tiny, &dir.path().join("tiny.job")));
    assert!(text.contains("error[job-empty]") && text.contains("warning[surface-tiny]"), "{text}");
    let quiet = said(&terrace([Path::new("compile"), &tiny, Path::new("--quiet")]));
    assert!(quiet.contains("error[job-empty]") && !quiet.contains("warning"), "{quiet}");
}

#[test]
#[ignore = "slow: make test-all"]
#[cfg(target_os = "linux")]
fn a_mesh_beyond_the_limit_of_memory_is_refused_with_the_figure() {
    const SIDE: u32 = 1100;
    let dir = folder();
    let at = |i: u32| (i as f32 / SIDE as f32 * 100.0).to_le_bytes();
    let mut stl = vec![0; 80];
    stl.extend((2 * SIDE * SIDE).to_le_bytes());
    for (i, j) in (0..SIDE).flat_map(|j| (0..SIDE).map(move |i| (i, j))) {
        for corners in [[(0, 0), (1, 0), (1, 1)], [(0, 0), (1, 1), (0, 1)]] {
            stl.extend([0; 12]);
            corners.iter().for_each(|&(x, y)| stl.extend([at(i + x), at(j + y), [0; 4]].concat()));
            stl.extend([0; 2]);
        }
    }
    std::fs::write(dir.path().join("large.stl"), stl).expect("writable");
    let job = JobText::on(Path::new("large.stl")).texture("pattern = \"hatch\"\npitch = \"5 mm\"");
    let job = job.write(dir.path(), "job.toml");
    let before = names(dir.path());
    let done = compile_within(150_000, &job, &dir.path().join("out.job"));
    let text = said(&done);
    assert_eq!(done.status.code(), Some(1), "{text}");
    assert!(text.contains("error[memory]: the mesh needs about 148 MB of memory, but only "), "{text}");
    assert!(text.contains("of the 147 MB allowed by the limit of address space (ulimit -v) is left"), "{text}");
    assert!(text.contains("large.stl"), "{text}");
    assert_eq!(names(dir.path()), before, "nothing is written");
}

#[test]
fn files_of_other_programs_are_named_with_a_way_to_convert_them() {
    let dir = folder();
    for (name, bytes, code, remedy) in [
        ("logo.png", &b"GIF89a"[..], "drawing-format", "as PNG"),
        ("logo.png", b"neither", "bitmap-format", "as PNG"),
        ("logo.webp", b"RIFF\x10\0\0\0WEBPVP8 ", "drawing-format", "as PNG"),
        ("logo.cdr", b"RIFF\x10\0\0\0CDRC", "drawing-format", "as plain SVG"),
        ("panel.svg", b"AutoCAD Binary DXF\r\n", "svg-format", ".dxf"),
        ("panel.svg", b"%PDF-1.7\n", "svg-format", "Inkscape"),
    ] {
        std::fs::write(dir.path().join(name), bytes).expect("writable");
        let job = plate(dir.path()).texture(&format!("file = {name:?}")).write(dir.path(), "job.toml");
        let done = compile(&job, &dir.path().join("out.job"));
        let text = said(&done);
        assert_eq!(done.status.code(), Some(2), "{name}: {text}");
        assert!(text.contains(&format!("error[{code}]: ")) && text.contains(remedy), "{name}: {text}");
        // Shown where the job names the file, or by the file itself.
        assert!(text.contains(name) && !dir.path().join("out.job").exists(), "{name}: {text}");
    }
    for (name, remedy) in [
        ("door.x_t", "export it from the CAD program as STEP"),
        ("door.SLDPRT", "export it from the CAD program as STEP"),
        ("door.glb", "MeshLab"),
        ("door.off", "MeshLab"),
        ("door.xlsx", "surfaces are read from .stl"),
    ] {
        std::fs::write(dir.path().join(name), b"whatever").expect("writable");
        let job = JobText::on(Path::new(name)).texture(HATCH).write(dir.path(), "job.toml");
        let text = said(&compile(&job, &dir.path().join("out.job")));
        assert!(text.contains("error[surface-format]") && text.contains(remedy), "{name}: {text}");
    }
}

#[test]
fn hints_name_what_lies_beside_a_missing_file_and_what_lists_the_keys() {
    let dir = folder();
    let text = |from: &str, to: &str| said(&compile(&edited(dir.path(), from, to), &dir.path().join("out.job")));
    let mistyped = text("plate.obj", "plaet.obj");
    let whole = dir.path().join("plaet.obj").display().to_string();
    assert!(mistyped.contains(&whole) && mistyped.contains("did you mean plate.obj?"), "{mistyped}");
    let other = text("plate.obj", "plate.stl");
    assert!(other.contains("did you mean plate.obj?"), "{other}");
    let folder = text("profile = \"xyz-galvo-40\"", "file = \"machines/ours.toml\"");
    assert!(folder.contains("there is no folder ") && folder.contains("machines"), "{folder}");
    let windows = text("profile = \"xyz-galvo-40\"", "file = \"C:\\Users\\me\\ours.toml\"");
    assert!(windows.contains("write the path with /"), "{windows}");
    let machine = machine_file("xyz-galvo-40");
    std::fs::write(dir.path().join("ours.toml"), machine.replacen("working_distance", "# ", 1)).expect("writable");
    let missing = text("profile = \"xyz-galvo-40\"", "file = \"ours.toml\"");
    assert!(missing.contains("`terrace machines NAME`") && !missing.contains("terrace init"), "{missing}");
    let key = text("speed = \"1000 mm/s\"", "");
    assert!(key.contains("`terrace init`") && !key.contains("docs/"), "{key}");
}

/// A job on the plate in which `from` is replaced by `to`.
fn edited(dir: &Path, from: &str, to: &str) -> std::path::PathBuf {
    let path = plate(dir).texture(&format!("{HATCH}\npen = \"fill\"")).write(dir, "job.toml");
    let text = std::fs::read_to_string(&path).expect("readable");
    assert!(text.contains(from), "{from:?} stands in the job");
    std::fs::write(&path, text.replacen(from, to, 1)).expect("writable");
    path
}

#[test]
fn job_file_error_says_what_to_write() {
    let dir = folder();
    for (from, to, fault, remedy) in [
        (
            "pattern = \"hatch\"",
            "file = \"sample.svg\"\nmirror = true",
            "mirror = true does not say along which axis",
            "write \"x\" (left and right",
        ),
        (
            "pattern = \"hatch\"",
            "file = \"sample.svg\"\nmirror = \"z\"",
            "\"z\" is not an axis to mirror along",
            "or \"y\" (top and bottom)",
        ),
        (
            "pattern = \"hatch\"",
            "file = \"sample.svg\"\nmirror = false",
            "mirror = false does not name an axis",
            "leave it out",
        ),
        (
            "\"hatch\"",
            "\u{201c}hatch\u{201d}",
            "these are typographic quotes: \u{201c}hatch\u{201d}",
            "straight quotes",
        ),
        ("\"0.07 mm\"", "\u{201e}0.07 mm\u{201c}", "these are typographic quotes", "straight quotes"),
        ("[[texture]]", "[texture]", "[texture] is a single table", "write [[texture]]"),
        ("[[pen]]", "[pen]", "[pen] is a single table", "write [[pen]]"),
    ] {
        let done = compile(&edited(dir.path(), from, to), &dir.path().join("out.job"));
        let text = said(&done);
        assert_eq!(done.status.code(), Some(2), "{to}: {text}");
        assert!(text.contains(&format!("error[toml]: {fault}")) && text.contains(remedy), "{to}: {text}");
    }
}

#[test]
fn job_file_error_shows_line_and_caret() {
    let dir = folder();
    for (from, to, code, line, caret) in [
        ("0.07 mm", "0.07", "toml", "pdof = \"0.07\"", "^^^^^^"),
        ("0.07 mm", "0,07 mm", "toml", "pdof = \"0,07 mm\"", "^^^^^^^^^"),
        ("0.07 mm", "-0.07 mm", "focus-range", "pdof = \"-0.07 mm\"", "^^^^^^^^^^"),
        ("0.07 mm", "0 mm", "focus-range", "pdof = \"0 mm\"", "^^^^^^"),
        ("0.07 mm", "0.07 deg", "toml", "pdof = \"0.07 deg\"", "^^^^^^^^^^"),
        ("0.5 mm", "0 mm", "toml", "pitch = \"0 mm\"", "^^^^^^"),
        ("0.5 mm", "1e999 mm", "toml", "pitch = \"1e999 mm\"", "^^^^^^^^^^"),
        ("pitch = ", "pich = ", "toml", "pich = \"0.5 mm\"", "^^^^"),
        ("\"hatch\"", "\"hatchet\"", "toml", "pattern = \"hatchet\"", "^^^^^^^^^"),
        ("pen = \"fill\"", "pen = \"deep\"", "pen-unknown", "pen = \"deep\"", "^^^^^^"),
        ("xyz-galvo-40", "xyz-galvo-41", "machine-unknown", "profile = \"xyz-galvo-41\"", "^^^^^^^^^^^^^^"),
        ("[focus]", "[focus", "toml", "[focus", "^"),
    ] {
        let job = edited(dir.path(), from, to);
        let before = names(dir.path());
        let done = compile(&job, &dir.path().join("out.job"));
        let text = said(&done);
        assert_eq!(done.status.code(), Some(2), "{to}: {text}");
        assert!(text.contains(&format!("error[{code}]: ")) && text.contains("job.toml:"), "{to}: {text}");
        let lines: Vec<&str> = text.lines().collect();
        let at = lines.iter().position(|l| l.ends_with(line)).unwrap_or_else(|| panic!("{to}: the line: {text}"));
        let marked = lines[at + 1].trim_start_matches([' ', '|']).trim_end();
        assert_eq!(marked, caret, "{to}: {text}");
        // The caret stands under the value.
        let shown = lines[at + 1].find('^').map(|i| &lines[at][i..]).unwrap_or_default();
        assert!(line.ends_with(shown) || line.contains(&shown[..caret.len().min(shown.len())]), "{to}: {text}");
        assert!(text.contains(" = help: "), "{to}: a remedy: {text}");
        assert_eq!(names(dir.path()), before, "{to}: nothing is written");
    }
}

#[test]
fn a_missing_table_or_file_is_named() {
    let dir = folder();
    for (from, to, code, say) in [
        ("pdof = \"0.07 mm\"", "", "focus-missing", "pdof"),
        ("unit = \"mm\"", "", "surface-unit", "plate.obj"),
        ("[[pen]]", "[[pens]]", "toml", "pens"),
        ("plate.obj", "absent.obj", "file-unreadable", "absent.obj"),
        ("plate.obj", ".", "surface-format", "extension"),
        ("profile = \"xyz-galvo-40\"", "file = \"absent.toml\"", "file-unreadable", "absent.toml"),
        ("pattern = \"hatch\"\npitch = \"0.5 mm\"", "file = \"absent.svg\"", "file-unreadable", "absent.svg"),
    ] {
        let done = compile(&edited(dir.path(), from, to), &dir.path().join("out.job"));
        let text = said(&done);
        assert_eq!(done.status.code(), Some(2), "{to}: {text}");
        assert!(text.contains(&format!("error[{code}]: ")) && text.contains(say), "{to}: {text}");
        assert!(!dir.path().join("out.job").exists());
    }
    // Nothing is held against a depth of focus that nobody has stated.
    let reserve = edited(dir.path(), "pdof = \"0.07 mm\"", "reserve = \"2 mm\"");
    let text = said(&compile(&reserve, &dir.path().join("out.job")));
    assert!(text.contains("error[focus-missing]: ") && !text.contains("focus-reserve"), "{text}");
    for bytes in [&b"\xff\xfe\x00"[..], b"", b"\x00\x00\x00\x00", &[b'['; 100_000]] {
        let job = dir.path().join("noise.toml");
        std::fs::write(&job, bytes).expect("writable");
        let done = compile(&job, &dir.path().join("out.job"));
        assert_eq!(done.status.code(), Some(2), "{}", said(&done));
    }
}

#[test]
fn a_faulty_machine_file_is_refused_with_its_place() {
    let dir = folder();
    let machine = machine_file("xyz-galvo-40");
    for (from, to, code) in [
        ("field = [\"40 mm\", \"40 mm\"]", "field = [\"0 mm\", \"0 mm\"]", "machine-field"),
        ("field = [\"40 mm\", \"40 mm\"]", "field = [\"-40 mm\", \"40 mm\"]", "machine-field"),
        ("field = [\"40 mm\", \"40 mm\"]", "field = [\"40 mm\"]", "toml"),
        ("travel = [\"-250 mm\", \"250 mm\"]", "travel = [\"250 mm\", \"-250 mm\"]", "machine-travel"),
        ("jump_speed", "jumpspeed", "toml"),
        // Numbers that can be read and that no machine has: 1e308 s would end as an infinite time, a field of 2 um
        // as millions of sections.
        ("field = [\"40 mm\", \"40 mm\"]", "field = [\"1.9 um\", \"0.46 mm\"]", "machine-field"),
        ("settle = \"0.1 s\"", "settle = \"1e308 s\"", "machine-range"),
        ("speed = \"200 mm/s\"", "speed = \"1e-9 mm/s\"", "machine-range"),
        ("spot = \"0.02 mm\"", "spot = \"20 mm\"", "machine-range"),
        ("laser_off = \"80 us\"", "laser_off = \"80 s\"", "machine-range"),
    ] {
        assert!(machine.contains(from), "{from:?} stands in the profile");
        std::fs::write(dir.path().join("ours.toml"), machine.replacen(from, to, 1)).expect("writable");
        let job = edited(dir.path(), "profile = \"xyz-galvo-40\"", "file = \"ours.toml\"");
        let done = compile(&job, &dir.path().join("out.job"));
        let text = said(&done);
        assert_eq!(done.status.code(), Some(2), "{to}: {text}");
        assert!(text.contains(&format!("error[{code}]: ")) && text.contains("ours.toml:"), "{to}: {text}");
        assert!(!dir.path().join("out.job").exists());
    }
}

#[test]
fn a_limit_of_the_machine_that_the_job_breaks_exits_1_and_writes_nothing() {
    let dir = folder();
    let wide = |keys: &str| {
        let path = dir.path().join("wide.obj");
        std::fs::write(&path, "v 0 0 0\nv 900 0 0\nv 900 90 0\nv 0 90 0\nf 1 2 3 4\n").expect("writable");
        JobText::on(&path).texture(keys)
    };
    // A tower 300 mm high next to the place that is marked.
    let tower = dir.path().join("tower.obj");
    let high = "v 0 0 0\nv 99 0 0\nv 99 99 0\nv 0 99 0\nv 40 0 0\nv 40 0 300\nv 60 0 300\nv 60 60 300\nv 40 60 300\n\
                f 1 2 3 4\nf 6 7 8 9\n";
    std::fs::write(&tower, high).expect("writable");
    let jobs = [
        ("travel", wide("pattern = \"hatch\"\npitch = \"5 mm\"")),
        (
            "clearance",
            JobText::on(&tower)
                .texture("pattern = \"hatch\"\npitch = \"5 mm\"\narea = [\"0 mm\", \"0 mm\", \"20 mm\", \"20 mm\"]"),
        ),
        // Nothing of the texture lies on the part: what it asks for cannot be done.
        (
            "job-empty",
            plate(dir.path())
                .texture("pattern = \"hatch\"\npitch = \"1 mm\"\narea = [\"200 mm\", \"0 mm\", \"220 mm\", \"20 mm\"]"),
        ),
    ];
    for (code, job) in jobs {
        check(&job.write(dir.path(), "job.toml"), code, &Limit(code));
    }
    let section = edited(dir.path(), "method = \"contour\"", "method = \"contour\"\nsection = \"41 mm\"");
    check(&section, "section", &Limit("section-large"));
    let shallow = edited(dir.path(), "0.07 mm", "0.1 um");
    check(&shallow, "depth", &Limit("pdof-small"));
    // Allowed, it is still below two increments of the stage.
    let text = std::fs::read_to_string(&shallow).expect("readable") + "[limits]\nimplausible = \"allow\"\n";
    assert_eq!(text.matches("[limits]").count(), 1);
    std::fs::write(&shallow, text).expect("writable");
    check(&shallow, "depth", &Limit("depth-small"));
    for speed in ["1e-300 mm/s", "0.0099 mm/s", "900 m/s"] {
        let pen = edited(dir.path(), "1000 mm/s", speed);
        check(&pen, speed, &Limit("pen-speed"));
    }
    let pen = edited(dir.path(), "60 %", "60 kW");
    check(&pen, "power", &Limit("pen-power"));
}
