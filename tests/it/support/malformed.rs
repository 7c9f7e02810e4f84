//! Malformed files: those of `fixtures/bad`, and those that are too large for the repository, made here.

use std::io::{Read, Write, repeat};
use std::path::{Path, PathBuf};
use terrace_core::math;

use flate2::Compression;
use flate2::write::GzEncoder;

use super::image::{self, Colour};

const PAGE: &str = r#"<svg xmlns="http://www.w3.org/2000/svg" width="100mm" height="100mm" viewBox="0 0 100 100">"#;

/// A made file: its name and what makes its bytes.
type Made = (&'static str, fn() -> Vec<u8>);

const MADE: [Made; 14] = [
    ("3mf_identical_vertices.3mf", identical_vertices),
    ("3mf_zip_bomb.3mf", || threemf(&mut text_with_spaces(50_000_000))),
    ("obj_huge_ngon.obj", huge_ngon),
    ("ply_no_end_header.ply", || format!("ply\nformat ascii 1.0\n{}", "comment x\n".repeat(10_000)).into_bytes()),
    ("png_decompression_bomb.png", png_bomb),
    ("png_one_bit.png", || image::zeros(32, 1, Colour::Grey)),
    ("png_one_bit_no_idat.png", || [image::head([32; 2], 1, Colour::Grey, false), image::chunk(b"IEND", b"")].concat()),
    ("png_newline_in_signature.png", newline_in_signature),
    ("svg_deep_groups_100k.svg", || nested("<g>", 100_000)),
    ("svg_deep_transforms_5k.svg", || nested(r#"<g transform="scale(1.01)">"#, 5000)),
    ("svg_hairline_slivers.svg", slivers),
    ("svg_quadratic_blowup.svg", quadratic_blowup),
    ("svg_self_intersecting_million.svg", self_intersecting),
    ("svgz_bomb.svgz", svgz_bomb),
];

/// The path of a malformed file; the large ones are made in `dir`. A name of no file is a path of no file.
pub fn file(dir: &Path, name: &str) -> PathBuf {
    match MADE.iter().find(|(made, _)| *made == name) {
        Some((_, make)) => {
            let path = dir.join(name);
            std::fs::write(&path, make()).expect("a writable folder");
            path
        }
        None => committed().join(name),
    }
}

/// The names of all malformed files.
pub fn names() -> Vec<String> {
    let mut names: Vec<String> = std::fs::read_dir(committed())
        .expect("fixtures/bad is in the repository")
        .map(|entry| entry.expect("a readable folder").file_name().to_string_lossy().into_owned())
        .chain(MADE.iter().map(|(name, _)| (*name).to_owned()))
        .collect();
    names.sort();
    names
}

fn committed() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/bad")
}

/// A 3MF file of one model.
fn threemf(model: &mut dyn Read) -> Vec<u8> {
    let mut out = std::io::Cursor::new(Vec::new());
    let mut archive = zip::ZipWriter::new(&mut out);
    let options = zip::write::SimpleFileOptions::default();
    archive.start_file("_rels/.rels", options).expect("memory");
    let space = "http://schemas.openxmlformats.org/package/2006/relationships";
    let kind = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel";
    let one = format!("<Relationship Target=\"/3D/3dmodel.model\" Id=\"a\" Type=\"{kind}\"/>");
    write!(archive, "<Relationships xmlns=\"{space}\">{one}</Relationships>").expect("memory");
    archive.start_file("3D/3dmodel.model", options).expect("memory");
    std::io::copy(model, &mut archive).expect("memory");
    archive.finish().expect("memory");
    out.into_inner()
}

const MODEL: &str = "<model xmlns=\"http://schemas.microsoft.com/3dmanufacturing/core/2015/02\"><resources>\
                     <object id=\"1\"><mesh><vertices>";

/// 200,000 vertices in one place, and as many triangles without area.
fn identical_vertices() -> Vec<u8> {
    let vertices = "<vertex x=\"0\" y=\"0\" z=\"0\"/>".repeat(200_000);
    let triangles = "<triangle v1=\"0\" v2=\"1\" v3=\"2\"/>".repeat(200_000);
    let end = "</triangles></mesh></object></resources><build><item objectid=\"1\"/></build></model>";
    threemf(&mut format!("{MODEL}{vertices}</vertices><triangles>{triangles}{end}").as_bytes())
}

/// The beginning of a model and so many spaces.
fn text_with_spaces(count: u64) -> impl Read {
    MODEL.as_bytes().chain(repeat(b' ').take(count))
}

/// One face of 20,000 corners.
fn huge_ngon() -> Vec<u8> {
    let n = 20_000;
    let mut out = String::new();
    for i in 0..n {
        let a = f64::from(i) / f64::from(n) * std::f64::consts::TAU;
        out += &format!("v {:.6} {:.6} 0\n", math::cos(a), math::sin(a));
    }
    out += "f";
    (1..=n).for_each(|i| out += &format!(" {i}"));
    out.into_bytes()
}

/// 900 MB of black, of which an eighth is there.
fn png_bomb() -> Vec<u8> {
    let data = image::deflated(repeat(0).take(30_001 * 3750));
    [image::head([30_000; 2], 8, Colour::Grey, false), image::chunk(b"IDAT", &data), image::chunk(b"IEND", b"")]
        .concat()
}

/// A signature whose CR LF became LF LF.
fn newline_in_signature() -> Vec<u8> {
    let mut bytes = image::zeros(32, 8, Colour::Grey);
    bytes[4] = b'\n';
    bytes
}

fn nested(group: &str, depth: usize) -> Vec<u8> {
    let (open, close) = (group.repeat(depth), "</g>".repeat(depth));
    format!(r#"{PAGE}{open}<path d="M0 0h50v50z"/>{close}</svg>"#).into_bytes()
}

/// A thousand rectangles that are 10 nm wide.
fn slivers() -> Vec<u8> {
    let rect = |i| format!(r#"<rect x="{:.4}" y="0" width="0.00001" height="100"/>"#, f64::from(i) / 10.0);
    format!("{PAGE}{}</svg>", (0..1000).map(rect).collect::<String>()).into_bytes()
}

/// An entity of 100 kB, used 10,000 times.
fn quadratic_blowup() -> Vec<u8> {
    let (entity, uses) = ("x".repeat(100_000), "&a;".repeat(10_000));
    let doctype = format!(r#"<?xml version="1.0"?><!DOCTYPE svg [<!ENTITY a "{entity}">]>"#);
    format!("{doctype}{PAGE}<desc>{uses}</desc></svg>").into_bytes()
}

/// One path of 20,000 edges that cross each other some 10^8 times.
fn self_intersecting() -> Vec<u8> {
    let corners: String = (0..20_000).map(|i| format!("L{} {}", i * 37 % 101, i * 53 % 103)).collect();
    format!(r#"{PAGE}<path fill-rule="evenodd" d="M0 0{corners}Z"/></svg>"#).into_bytes()
}

/// 100 MB of spaces, packed.
fn svgz_bomb() -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    let mut text = PAGE.as_bytes().chain(repeat(b' ').take(100_000_000)).chain(&b"</svg>"[..]);
    std::io::copy(&mut text, &mut encoder).and_then(|_| encoder.flush()).expect("memory");
    encoder.finish().expect("memory")
}
