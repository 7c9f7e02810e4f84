//! The reader as a whole: against ezdxf, in every form of file, and on damaged files.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};
use terrace_core::math;

use super::*;
use crate::texture::artwork::{Marking, StrokeMode, WindingRule};

/// What becomes of a file: how many shapes, or the code of the error; and the codes of the warnings.
type Outcome = (Result<usize, &'static str>, &'static [&'static str]);

const TOLERANCE: f64 = 5e-4;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn shared(folder: &str) -> PathBuf {
    let path = root().join("../shared/data").join(folder);
    assert!(path.is_dir(), "{} is absent", path.display());
    path
}

/// What cannot be read is left out.
fn lenient() -> Marking {
    Marking { is_lenient: true, ..Marking::default() }
}

fn entities() -> Vec<u8> {
    std::fs::read(root().join("fixtures/entities.dxf")).expect("the fixture")
}

/// In mm, every width that of an area.
fn options<'a>(path: &'a Path, marking: &'a Marking) -> DxfOptions<'a> {
    DxfOptions { path, unit_mm: None, tolerance: TOLERANCE, widest_line: 0.0, marking }
}

fn loaded(bytes: &[u8], unit_mm: Option<f64>) -> (Result<Artwork, Error>, Vec<Diag>) {
    let mut notes = Vec::new();
    let marking = lenient();
    let art = load(bytes, &DxfOptions { unit_mm, ..options(Path::new("a.dxf"), &marking) }, &mut notes);
    (art, notes)
}

/// A drawing of tags: group code, value.
fn file(tags: &str) -> Vec<u8> {
    let body: String = tags.split_whitespace().map(|t| format!("{t}\n")).collect();
    format!("0\nSECTION\n2\nENTITIES\n{body}0\nENDSEC\n0\nEOF\n").into_bytes()
}

// --- Against ezdxf

/// Writes what is read of a drawing for the script that compares it with ezdxf.
fn write_json(path: &Path, to: &Path) {
    let bytes = std::fs::read(path).expect("readable");
    let file = file::read(&bytes).expect("read");
    let unit = units::unit_mm(file.unit, file.unit.filter(|&u| u != 0).is_none().then_some(1.0)).expect("a unit");
    let DrawnModel { art, tally, .. } =
        walk::walk(&file, unit, &options(path, &Marking::default()), Polylines::default()).expect("drawn");
    let shape = |s: &crate::texture::artwork::PaintedShape| {
        let lines: Vec<&[[f64; 2]]> = s.lines.clone().map(|i| art.lines.get(i)).collect();
        serde_json::json!({ "name": art.names[s.name as usize], "lines": lines })
    };
    let not_unread = [
        "dxf-hidden",
        "dxf-ignored",
        "dxf-dash",
        "dxf-width",
        "dxf-block",
        "dxf-fault",
        "dxf-bulge",
        "dxf-noplot",
        "dxf-dot",
        "dxf-pattern-dots",
    ];
    let mut unread: BTreeMap<&str, u64> = BTreeMap::new();
    let rows = tally.rows().filter(|(code, ..)| !not_unread.contains(code));
    rows.for_each(|(_, what, n, _)| *unread.entry(what).or_default() += n);
    let hidden: u64 = tally.rows().filter(|r| r.0 == "dxf-hidden").map(|r| r.2).sum();
    let whole = serde_json::json!({
        "file": path.display().to_string(),
        "unit_mm": unit,
        "unread": unread,
        "hidden": hidden,
        "shapes": art.shapes.iter().map(shape).collect::<Vec<_>>(),
    });
    std::fs::write(to, whole.to_string()).expect("written");
}

fn compare(paths: &[PathBuf]) -> String {
    let dir = tempfile::tempdir().expect("a folder");
    let mut command = Command::new(root().join(".venv/bin/python"));
    command.arg(root().join("tests/python/check_drawing.py"));
    for (i, path) in paths.iter().enumerate() {
        let to = dir.path().join(format!("{i}.json"));
        write_json(path, &to);
        command.arg(to);
    }
    let out = command.output().expect("the foreign readers are installed: run tests/python/setup.sh");
    let said = String::from_utf8_lossy(&out.stdout).into_owned() + &String::from_utf8_lossy(&out.stderr);
    assert!(out.status.success(), "{said}");
    assert_eq!(said.lines().filter(|l| l.starts_with("ok")).count(), paths.len(), "{said}");
    said
}

#[test]
fn every_entity_equals_ezdxf_to_a_micrometre() {
    compare(&[root().join("fixtures/entities.dxf")]);
}

#[test]
#[ignore = "needs ../shared: make test-all"]
fn all_drawings_equal_ezdxf_to_a_micrometre() {
    let entries = std::fs::read_dir(shared("textures")).expect("readable");
    let mut paths: Vec<PathBuf> = entries.map(|e| e.expect("readable").path()).collect();
    paths.retain(|p| p.extension().is_some_and(|e| e.eq_ignore_ascii_case("dxf")));
    paths.sort();
    assert!(paths.len() >= 29, "{}", paths.len());
    println!("{}", compare(&paths));
}

// --- What is read

fn shape_of<'a>(art: &'a Artwork, name: &str) -> &'a crate::texture::artwork::PaintedShape {
    let found = art.shapes.iter().find(|s| art.names[s.name as usize] == name);
    found.unwrap_or_else(|| panic!("{name} is not among {:?}", art.names))
}

#[test]
fn colours_layers_and_blocks_are_those_of_the_insert_where_the_entity_says_so() {
    let drawing = "0 SECTION 2 TABLES 0 LAYER 2 Grain 62 1 0 LAYER 2 Rim 62 7 420 16744448 0 ENDSEC \
        0 SECTION 2 BLOCKS 0 BLOCK 2 leaf 10 0 20 0 \
        0 LINE 5 A1 8 0 10 0 20 0 11 1 21 0 0 LINE 5 A2 8 0 62 0 10 0 20 1 11 1 21 1 \
        0 LINE 5 A3 8 Rim 10 0 20 2 11 1 21 2 0 LINE 5 A4 62 5 8 rim 10 0 20 3 11 1 21 3 0 ENDBLK \
        0 BLOCK 2 tree 10 0 20 0 0 INSERT 2 LEAF 8 0 62 0 10 0 20 0 0 ENDBLK 0 ENDSEC \
        0 SECTION 2 ENTITIES 0 INSERT 2 Tree 8 Grain 62 3 10 7 20 5 0 LINE 8 Grain 62 7 10 0 20 0 11 1 21 9 \
        0 ENDSEC 0 EOF";
    let text: String = drawing.split_whitespace().map(|t| format!("{t}\r\n")).collect();
    let (art, notes) = loaded(text.as_bytes(), Some(1.0));
    let art = art.expect("read");
    assert_eq!(notes, []);
    let tree = ["block:tree", "block:leaf"];
    for (name, colour, labels) in [
        ("LINE A1", [255, 0, 0], ["layer:Grain", tree[0], tree[1]].as_slice()),
        ("LINE A2", [0, 255, 0], &["layer:Grain", tree[0], tree[1]]),
        ("LINE A3", [255, 128, 0], &["layer:Rim", tree[0], tree[1]]),
        ("LINE A4", [0, 0, 255], &["layer:Rim", tree[0], tree[1]]),
        ("LINE at line 136", [0; 3], &["layer:Grain"]),
    ] {
        let shape = shape_of(&art, name);
        assert_eq!(
            (shape.colour, art.labels[shape.labels as usize].own.join(" ")),
            (colour, labels.join(" ")),
            "{name}"
        );
    }
    assert_eq!((art.size, art.corner), ([8.0, 9.0], Some([0.0, 0.0])));
}

#[test]
fn names_are_read_in_every_code_page_and_case_does_not_part_them() {
    let mut bytes = b"0\nSECTION\n2\nENTITIES\n".to_vec();
    for name in [&b"Caf\xc3\xa9"[..], b"Caf\xe9", b"Caf\\U+00E9", b"CAF\\U+00C9", b"Caf\\U+zz"] {
        bytes.extend([b"0\nLINE\n8\n", name, b"\n11\n1\n"].concat());
    }
    bytes.extend(b"0\nENDSEC\n0\nEOF\n");
    let art = loaded(&bytes, Some(1.0)).0.expect("read");
    let own: Vec<String> = art.labels.iter().map(|l| l.own.join(" ")).collect();
    assert_eq!(own, ["layer:Caf\u{e9}", "layer:Caf\\U+zz"]);
}

#[test]
fn drawings_keep_their_coordinates_in_mm() {
    let (art, _) = loaded(&file("0 LINE 10 -3 20 7 11 1 21 9 0 SOLID 10 0 20 8 11 1 21 8 12 0 22 9"), Some(25.4));
    let art = art.expect("read");
    let near = |a: [f64; 2], b: [f64; 2]| (0..2).all(|k| (a[k] - b[k]).abs() < 1e-12);
    assert!(near(art.size, [101.6, 50.8]) && near(art.corner.expect("a corner"), [-76.2, 177.8]));
    assert_eq!(art.lines.get(0)[0], [0.0, 0.0]);
    let figures: Vec<ShapeFigure> = art.shapes.iter().map(|s| s.figure).collect();
    assert_eq!(figures, [ShapeFigure::Lines, ShapeFigure::Fill(WindingRule::EvenOdd)]);
}

/// The tags of a text file in a binary form.
fn binary(text: &[u8], is_r12: bool) -> Vec<u8> {
    let text = std::str::from_utf8(text).expect("UTF-8");
    let mut out = b"AutoCAD Binary DXF\r\n\x1a\0".to_vec();
    let mut lines = text.lines();
    while let (Some(code), Some(value)) = (lines.next(), lines.next()) {
        let code: i16 = code.trim().parse().expect("a code");
        match (is_r12, u8::try_from(code)) {
            (true, Ok(code)) if code < 255 => out.push(code),
            (true, _) => out.extend([&[255][..], &code.to_le_bytes()].concat()),
            (false, _) => out.extend(code.to_le_bytes()),
        }
        let real = || value.trim().parse::<f64>().expect("a number");
        let whole = || value.trim().parse::<i64>().expect("a number");
        match code {
            10..=59 | 110..=149 | 210..=239 | 460..=469 | 1010..=1059 => out.extend(real().to_le_bytes()),
            60..=79 | 170..=179 | 270..=289 | 370..=389 | 400..=409 | 1060..=1070 => {
                out.extend((whole() as i16).to_le_bytes());
            }
            90..=99 | 420..=429 | 440..=459 | 1071 => out.extend((whole() as i32).to_le_bytes()),
            160..=169 => out.extend(whole().to_le_bytes()),
            290..=299 => out.push(whole() as u8),
            310..=319 | 1004 => {
                out.push(value.len() as u8);
                out.extend(value.bytes());
            }
            _ => out.extend([value.as_bytes(), &[0]].concat()),
        }
    }
    out
}

#[test]
fn all_forms_of_a_file_are_one_drawing() {
    let text = entities();
    let (expected, notes) = loaded(&text, None);
    let expected = expected.expect("read");
    assert!(expected.shapes.len() > 100, "{}", expected.shapes.len());
    let crlf = String::from_utf8(text.clone()).expect("UTF-8").replace("\r\n", "\n").replace('\n', "\r\n").into_bytes();
    let cr = String::from_utf8(crlf.clone()).expect("UTF-8").replace("\r\n", "\r").into_bytes();
    let bom = [&[0xef, 0xbb, 0xbf], text.as_slice()].concat();
    for (what, bytes) in [
        ("CR LF", crlf),
        ("CR", cr),
        ("with a byte order mark", bom),
        ("binary of R12", binary(&text, true)),
        ("binary of R13", binary(&text, false)),
    ] {
        let (art, other) = loaded(&bytes, None);
        let art = art.unwrap_or_else(|e| panic!("{what}: {e}"));
        assert_eq!(art.lines.points, expected.lines.points, "{what}");
        assert_eq!(
            (&art.shapes, &art.names, &art.labels),
            (&expected.shapes, &expected.names, &expected.labels),
            "{what}"
        );
        assert_eq!(other, notes, "{what}");
    }
}

#[test]
fn every_ignored_entity_is_listed_with_count_and_handle() {
    let (_, notes) = loaded(&entities(), None);
    let codes: Vec<&str> = notes.iter().map(|n| n.code).collect();
    for code in [
        "dxf-text",
        "dxf-dimension",
        "dxf-mesh",
        "dxf-infinite",
        "dxf-mline",
        "dxf-gradient",
        "dxf-pattern-dots",
        "dxf-dash",
        "dxf-block",
        "dxf-fault",
        "dxf-hidden",
        "dxf-noplot",
        "dxf-paper",
        "dxf-dot",
        "dxf-ignored",
    ] {
        assert_eq!(codes.iter().filter(|c| **c == code).count(), 1, "{code} in {codes:?}");
    }
    let text = notes.iter().find(|n| n.code == "dxf-mesh").expect("a warning");
    let list = text.message.split(": ").skip(1).collect::<Vec<_>>().join(": ");
    assert!(list.starts_with("1 3DFACE (first: 3DFACE ") && list.contains("2 POLYLINE (first: POLYLINE "), "{list}");
}

#[test]
fn tolerance_holds_after_all_maps() {
    let circle = "0 SECTION 2 BLOCKS 0 BLOCK 2 c 0 CIRCLE 10 0 20 0 40 1 0 ENDBLK 0 ENDSEC 0 SECTION 2 ENTITIES \
        0 INSERT 2 c 10 0 20 0 41 300 42 200 0 ENDSEC 0 EOF";
    let text: String = circle.split_whitespace().map(|t| format!("{t}\n")).collect();
    for tolerance in [1e-4, 1e-2] {
        let marking = lenient();
        let options = DxfOptions { unit_mm: Some(1.0), tolerance, ..options(Path::new("a"), &marking) };
        let art = load(text.as_bytes(), &options, &mut Vec::new()).expect("read");
        let line = art.lines.get(0);
        let corner = art.corner.expect("a corner");
        let on_ellipse = |p: [f64; 2]| math::hypot((p[0] + corner[0]) / 300.0, (p[1] + corner[1]) / 200.0) - 1.0;
        assert!(line.iter().all(|&p| on_ellipse(p).abs() < 1e-12), "all points lie on the curve");
        let sag = |w: &[[f64; 2]]| on_ellipse([(w[0][0] + w[1][0]) / 2.0, (w[0][1] + w[1][1]) / 2.0]).abs();
        let worst = line.windows(2).map(sag).fold(0.0, f64::max);
        assert!(worst * 200.0 <= tolerance && worst * 300.0 > tolerance / 2.0, "{worst} of {tolerance}");
    }
}

// --- Damaged files

/// Files of one section of entities.
const ODD: [(&str, Outcome); 24] = [
    ("0 LWPOLYLINE 43 1 10 0 20 0 10 10 20 0 10 0 20 2", (Ok(1), &["dxf-width"])),
    ("0 LWPOLYLINE 90 2000000000 70 1 10 0 20 0 10 5 20 5", (Ok(1), &[])),
    (
        "0 LWPOLYLINE 70 1 10 0 20 0 42 1e308 10 10 20 0 42 1e-320 10 10 20 10 42 -1 10 10 20 10 42 5",
        (Ok(1), &["dxf-bulge"]),
    ),
    ("0 LINE 10 0,5 20 0 11 5 21 5", (Err("dxf-number"), &[])),
    ("0 LINE 10 nan 20 0 11 inf 21 5", (Err("dxf-number"), &[])),
    ("0 LINE 10 0 20 0 11 1e400 21 5", (Err("dxf-number"), &[])),
    ("0 LINE 10 0 20 0 11 1e300 21 5", (Err("texture-far"), &[])),
    ("0 INSERT 2 NOPE 10 0 20 0", (Ok(0), &["dxf-block"])),
    ("0 ARC 10 10 20 0 40 5 50 0 51 90 210 0 220 0 230 -1", (Ok(1), &[])),
    ("0 ARC 10 0 20 0 40 0 50 0 51 90 0 CIRCLE 10 0 20 0 40 -5", (Ok(0), &["dxf-fault"])),
    (
        "0 SPLINE 70 8 71 3 72 5 73 4 40 0 40 0 40 0 40 0 40 1 10 0 20 0 10 1 20 1 10 2 20 1 10 3 20 0",
        (Ok(0), &["dxf-fault"]),
    ),
    ("0 SPLINE 70 1 71 3 11 0 21 0 11 1 21 1 11 2 21 0", (Ok(0), &["dxf-fault"])),
    ("0 LINE 10 1 20 1 11 1 21 1", (Ok(0), &["dxf-dot"])),
    ("0 LINE 60 1 10 1 20 1 11 1 21 2", (Ok(0), &["dxf-hidden"])),
    ("0 POLYLINE 66 1 0 VERTEX 10 0 20 0 0 VERTEX 10 5 20 0 0 LINE 10 1 20 1 11 1 21 2", (Ok(2), &[])),
    ("0 VERTEX 10 0 20 0 0 LINE 10 1 20 1 11 1 21 2", (Ok(1), &["dxf-outside"])),
    ("0 ENDSEC 0 LINE 10 1 20 1 11 1 21 2", (Ok(0), &["dxf-outside"])),
    ("0 HATCH 70 1 91 0 75 0", (Ok(0), &["dxf-fault"])),
    ("0 ENDSEC 0 SECTION 2 OBJECTS 0 SPATIAL_FILTER 5 1F", (Ok(0), &["dxf-clip"])),
    (
        "0 LINE 10 0 20 0 11 9 21 0 0 LINE 10 9 20 0 11 9 21 9 0 LINE 10 9 20 9 11 0 21 9 0 LINE 10 0 20 9 11 0 21 0.1",
        (Ok(4), &["dxf-open"]),
    ),
    ("0 TEXT 10 0 20 0 0 MTEXT 1 \\P 0 MTEXT 0 LINE 11 1", (Ok(1), &["dxf-ignored"])),
    ("0 TEXT 1 a 0 LINE 11 1", (Ok(1), &["dxf-text"])),
    ("0 LINE 6 HIDDEN 11 1 0 LINE 6 Continuous 11 2", (Ok(2), &["dxf-linetype"])),
    ("0 SOLID 10 0 20 0 11 1 21 0 12 0 22 1 0 FROB 5 1F 10 x", (Ok(1), &["dxf-unread"])),
];

fn check(name: &str, bytes: &[u8], unit_mm: Option<f64>, (expected, warnings): Outcome) -> Option<Error> {
    let start = Instant::now();
    let (art, notes) = loaded(bytes, unit_mm);
    assert!(start.elapsed() < Duration::from_secs(5), "{name}: {:?}", start.elapsed());
    let codes: Vec<_> = notes.iter().map(|n| n.code).collect();
    assert_eq!(codes, warnings, "{name}: {art:?}");
    match (art, expected) {
        (Ok(art), Ok(n)) => {
            assert_eq!(art.shapes.len(), n, "{name}");
            assert!(art.lines.points.iter().flatten().all(|v| v.is_finite()), "{name}");
            assert!(art.lines.iter().all(|l| l.len() > 1 && l.windows(2).all(|w| w[0] != w[1])), "{name}");
            assert_eq!(art.corner.is_some(), n > 0, "{name}");
            None
        }
        (Err(e), Err(code)) => {
            assert_eq!(e.diags()[0].code, code, "{name}: {e}");
            assert!(!e.diags()[0].hint.is_empty() && e.to_string().contains("a.dxf"), "{name}: {e}");
            Some(e)
        }
        (art, expected) => panic!("{name}: {art:?}, expected {expected:?}"),
    }
}

#[test]
fn odd_entities_have_one_outcome() {
    for (tags, outcome) in ODD {
        check(tags, &file(tags), Some(1.0), outcome);
    }
    // There and back is one line, and flat lines alone are: z may differ.
    for tags in ["0 LWPOLYLINE 70 1 10 1 20 1 10 9 20 1", "0 LWPOLYLINE 10 1 20 1 10 9 20 1 10 1 20 1"] {
        let art = loaded(&file(tags), Some(1.0)).0.expect("read");
        assert_eq!(art.lines.iter().collect::<Vec<_>>(), [[[0.0, 0.0], [8.0, 0.0]]], "{tags}");
    }
    let notes = loaded(&file("0 LINE 6 Hidden 11 1"), Some(1.0)).1;
    assert!(notes[0].message.contains("1 Hidden (first: LINE at line"), "{}", notes[0].message);
    let mirrored = file("0 ARC 10 10 20 0 40 5 50 0 51 90 210 0 220 0 230 -1");
    let art = loaded(&mirrored, Some(1.0)).0.expect("read");
    assert!((art.corner.expect("a corner")[0] + 15.0).abs() < 1e-12, "x is mirrored: {:?}", art.corner);
}

/// A solid hatch of polyline paths: flags, and the lower left and upper right corner of each.
fn hatch(style: i32, paths: &[(i32, [i32; 4])]) -> Vec<u8> {
    let path = |(flags, [x0, y0, x1, y1]): &(i32, [i32; 4])| {
        format!("92 {flags} 72 0 73 1 93 4 10 {x0} 20 {y0} 10 {x1} 20 {y0} 10 {x1} 20 {y1} 10 {x0} 20 {y1} 97 0 ")
    };
    let paths: (usize, String) = (paths.len(), paths.iter().map(path).collect());
    file(&format!("0 HATCH 2 SOLID 70 1 91 {} {}75 {style} 76 1 98 0", paths.0, paths.1))
}

#[test]
fn text_islands_of_hatches_are_not_filled() {
    const OUTER: (i32, [i32; 4]) = (7, [0, 0, 30, 30]);
    const ISLAND: (i32, [i32; 4]) = (22, [5, 5, 25, 25]);
    for (name, style, text, want) in [
        ("in the fill", 0, [1, 1, 4, 3], 900 - 400 - 6),
        ("in the island", 0, [10, 10, 20, 20], 900 - 400),
        ("across the border of the island", 0, [1, 10, 9, 20], 900 - 400 - 40),
        ("of the outer style", 1, [1, 1, 4, 3], 900 - 400 - 6),
        ("of the style that ignores what lies inside", 2, [1, 1, 4, 3], 900),
    ] {
        let art = loaded(&hatch(style, &[OUTER, ISLAND, (10, text)]), Some(1.0)).0.expect("read");
        let rings = crate::texture::artwork::PolygonArea::new(art.lines.iter(), WindingRule::EvenOdd).expect("few");
        let twice = |c: &Vec<[f64; 2]>| -> f64 {
            (0..c.len()).map(|i| (c[i], c[(i + 1) % c.len()])).map(|(p, q)| p[0] * q[1] - q[0] * p[1]).sum()
        };
        let area = rings.contours().map(twice).sum::<f64>() / 2.0;
        assert!((area - f64::from(want)).abs() < 1e-6, "{name}: {area}");
    }
}

#[test]
fn damaged_files_are_refused_with_their_line() {
    let line = "0\nSECTION\n2\nENTITIES\n0\nLINE\n10\n0\n20\n0\n11\n5\n21\n5\n";
    let cycle = "0 SECTION 2 BLOCKS 0 BLOCK 2 A 0 INSERT 2 B 0 ENDBLK 0 BLOCK 2 B 0 INSERT 2 a 0 ENDBLK 0 ENDSEC \
        0 SECTION 2 ENTITIES 0 INSERT 2 A 0 ENDSEC 0 EOF";
    let bomb = "0 SECTION 2 BLOCKS 0 BLOCK 2 A 0 LINE 11 1 0 ENDBLK 0 ENDSEC \
        0 SECTION 2 ENTITIES 0 INSERT 2 A 70 32000 71 32000 44 1 45 1 0 ENDSEC 0 EOF";
    // Each level has ten of the one below.
    let level = |i: u32| format!("0 BLOCK 2 L{i} {} 0 ENDBLK ", format!("0 INSERT 2 L{} ", i + 1).repeat(10));
    let levels: String = (0..12).map(level).collect();
    let nested = format!(
        "0 SECTION 2 BLOCKS {levels} 0 BLOCK 2 L12 0 LINE 11 1 0 ENDBLK 0 ENDSEC 0 SECTION 2 ENTITIES 0 INSERT 2 L0 0 EOF"
    );
    let chain: String = (0..70).map(|i| format!("0 BLOCK 2 L{i} 0 INSERT 2 L{} 0 ENDBLK ", i + 1)).collect();
    let deep =
        format!("0 SECTION 2 BLOCKS {chain} 0 BLOCK 2 L70 0 ENDBLK 0 ENDSEC 0 SECTION 2 ENTITIES 0 INSERT 2 L0 0 EOF");
    let tags = |text: &str| text.split_whitespace().map(|t| format!("{t}\n")).collect::<String>().into_bytes();
    let hatch = "0 SECTION 2 ENTITIES 0 HATCH 70 0 91 1 92 3 72 0 73 1 93 3 10 0 20 0 10 1000 20 0 10 0 20 1000 75 0 78 1 \
        53 0 43 0 44 0 45 0 46 0.00001 79 0 0 ENDSEC 0 EOF";
    let noise: Vec<u8> = (0..4096u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 13) as u8).collect();
    let binary = binary(line.as_bytes(), false);
    let cases: [(&str, Vec<u8>, Outcome, &str); 18] = [
        ("no end", line.into(), (Ok(1), &["dxf-eof"]), ""),
        ("a blank without a line end", format!("{line} ").into(), (Ok(1), &["dxf-eof"]), ""),
        ("no end mark in binary", binary.clone(), (Ok(1), &["dxf-eof"]), ""),
        ("binary that is cut", binary[..binary.len() - 3].into(), (Err("dxf-syntax"), &[]), "byte 80"),
        ("no value", format!("{line}11\n").into(), (Err("dxf-syntax"), &[]), ":15"),
        ("trash after the end", format!("{line}0\nEOF\nignore\nthis").into(), (Ok(1), &[]), ""),
        ("blank lines after the end", format!("{line}0\nENDSEC\n0\nEOF\n\n \n").into(), (Ok(1), &[]), ""),
        ("trash before the end", format!("{line}0\nENDSEC\nthis\nis not").into(), (Err("dxf-syntax"), &[]), ":17"),
        ("comment first", format!("999\nmade by\n{line}0\nEOF").into(), (Ok(1), &[]), ""),
        ("text", b"this is not\na dxf file\n".repeat(20), (Err("dxf-syntax"), &[]), ":1"),
        ("an SVG", b"<svg/>".into(), (Err("dxf-syntax"), &[]), ":1"),
        ("numbers", b"1\n2\n3\n4\n".into(), (Err("dxf-format"), &[]), ":2"),
        ("empty", Vec::new(), (Err("dxf-format"), &[]), ""),
        ("noise", noise, (Err("dxf-syntax"), &[]), ":1"),
        ("a cycle", tags(cycle), (Err("dxf-cycle"), &[]), "\"A\""),
        ("10^9 copies", tags(bomb), (Err("dxf-large"), &[]), "INSERT at line"),
        ("10^12 copies, nested", tags(&nested), (Err("dxf-large"), &[]), "at line"),
        ("a narrow hatch", tags(hatch), (Err("texture-large"), &[]), "HATCH at line 6"),
    ];
    for (name, bytes, outcome, place) in cases {
        let error = check(name, &bytes, Some(1.0), outcome);
        assert!(error.is_none_or(|e| e.to_string().contains(place)), "{name}: {place}");
    }
    check("deep", &tags(&deep), Some(1.0), (Err("dxf-cycle"), &["dxf-eof"][..0]));
    check("no unit", &file("0 LINE 11 1"), None, (Err("dxf-unit"), &[]));
}

#[test]
fn cut_and_flipped_files_never_panic() {
    let text = entities();
    let r13 = binary(&text, false);
    let mut noise = terrace_core::random::Random::case(7);
    let mut refused = 0;
    for bytes in [&text, &r13] {
        for _ in 0..60 {
            let mut bytes = bytes.clone();
            bytes.truncate(noise.range(30.0, bytes.len() as f64) as usize);
            for _ in 0..4 {
                let at = noise.range(0.0, bytes.len() as f64) as usize;
                bytes[at] = noise.range(0.0, 256.0) as u8;
            }
            let (art, notes) = loaded(&bytes, Some(1.0));
            match art {
                Ok(art) => assert!(!notes.is_empty() && art.lines.points.iter().flatten().all(|v| v.is_finite())),
                Err(e) => refused += usize::from(!e.diags()[0].code.is_empty()),
            }
        }
    }
    assert!((20..120).contains(&refused), "{refused} of 120");
}

#[test]
#[ignore = "needs ../shared: make test-all"]
fn malformed_files_have_one_outcome() {
    let files: [(&str, Outcome); 18] = [
        ("dxf_bulge_extremes.dxf", (Ok(1), &["dxf-bulge"])),
        ("dxf_comma_decimal.dxf", (Err("dxf-number"), &[])),
        ("dxf_garbage.dxf", (Err("dxf-syntax"), &[])),
        ("dxf_huge_vertex_count.dxf", (Ok(1), &[])),
        ("dxf_insert_cycle.dxf", (Err("dxf-cycle"), &[])),
        ("dxf_minsert_bomb.dxf", (Err("dxf-large"), &[])),
        ("dxf_missing_block.dxf", (Ok(0), &["dxf-block"])),
        ("dxf_nan_coords.dxf", (Err("dxf-number"), &[])),
        ("dxf_negative_extrusion.dxf", (Ok(1), &[])),
        ("dxf_no_eof.dxf", (Ok(1), &["dxf-eof"])),
        ("dxf_odd_lines.dxf", (Err("dxf-syntax"), &[])),
        ("dxf_spline_bad_knots.dxf", (Ok(0), &["dxf-fault"])),
        ("dxf_text_garbage.dxf", (Err("dxf-syntax"), &[])),
        ("dxf_zero_radius_arc.dxf", (Ok(0), &["dxf-fault"])),
        ("ezdxf_R12_trash_beyond_EOF.dxf", (Ok(1), &[])),
        ("ezdxf_missing_block_definition.dxf", (Ok(0), &[])),
        ("tm_broken_loop.dxf", (Ok(5), &["dxf-open"])),
        ("png_truncated.png", (Err("dxf-syntax"), &[])),
    ];
    let folder = shared("bad");
    let listed: Vec<_> = files.iter().map(|f| f.0).collect();
    for entry in std::fs::read_dir(&folder).expect("readable") {
        let name = entry.expect("readable").file_name().to_string_lossy().into_owned();
        assert!(!name.ends_with(".dxf") || listed.contains(&&*name), "{name} has an outcome");
    }
    for (name, outcome) in files {
        let bytes = std::fs::read(folder.join(name)).expect("readable");
        let has_unit = file::read(&bytes).is_ok_and(|f| f.unit.is_some_and(|u| u != 0));
        check(name, &bytes, (!has_unit).then_some(1.0), outcome);
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn copies_that_cost_time_and_draw_nothing_are_bounded() {
    for (kind, points) in [("LWPOLYLINE", 2000), ("SPLINE 71 25", 2000), ("HATCH 70 1 91 1 92 3 72 0 73 1 93 9", 2000)]
    {
        let points = "10 0 20 0 ".repeat(points);
        let text = format!(
            "0 SECTION 2 BLOCKS 0 BLOCK 2 A 0 {kind} {points} 0 ENDBLK 0 ENDSEC \
            0 SECTION 2 ENTITIES 0 INSERT 2 A 70 1000 71 1000 44 1 45 1 0 ENDSEC 0 EOF"
        );
        let text: String = text.split_whitespace().map(|t| format!("{t}\n")).collect();
        let start = Instant::now();
        check(kind, text.as_bytes(), Some(1.0), (Err("texture-large"), &[]));
        println!("{kind}: {:?}", start.elapsed());
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn large_drawing_is_read_in_time() {
    let mut text = String::from(
        "0\nSECTION\n2\nBLOCKS\n0\nBLOCK\n2\nA\n0\nCIRCLE\n40\n1.5\n0\nENDBLK\n0\nENDSEC\n0\nSECTION\n2\nENTITIES\n",
    );
    let mut noise = terrace_core::random::Random::case(1);
    for i in 0..10_000 {
        text += &format!("0\nLWPOLYLINE\n5\n{i:X}\n8\nlayer {}\n70\n1\n", i % 7);
        for k in 0..34 {
            let [x, y, bulge] = [0; 3].map(|_| noise.range(-1.0, 1.0));
            text += &format!("10\n{}\n20\n{y}\n42\n{}\n", x + f64::from(i), if k % 4 == 0 { bulge } else { 0.0 });
        }
        text += &format!("0\nINSERT\n2\nA\n10\n{i}\n20\n3\n41\n2\n42\n0.5\n");
        text += &format!("0\nLINE\n10\n{i}\n20\n0\n11\n{}\n21\n1\n", i + 1).repeat(10);
    }
    text += "0\nENDSEC\n0\nEOF\n";
    let start = Instant::now();
    let art = loaded(text.as_bytes(), Some(1.0)).0.expect("read");
    let took = start.elapsed();
    println!("{} MB, {} shapes, {} points: {took:?}", text.len() >> 20, art.shapes.len(), art.lines.points.len());
    assert_eq!(art.shapes.len(), 120_000);
    assert!(took < Duration::from_secs(20), "{took:?}");
}

#[test]
fn polylines_with_a_width_are_lines_or_areas_as_strokes_are() {
    // 0.03 mm wide, once as it is and once three times as large.
    let text = "0 SECTION 2 BLOCKS 0 BLOCK 2 c 0 LWPOLYLINE 43 0.03 10 0 20 0 10 5 20 0 10 5 20 5 0 ENDBLK 0 ENDSEC \
        0 SECTION 2 ENTITIES 0 INSERT 2 c 10 0 20 0 0 INSERT 2 c 10 9 20 0 41 3 42 3 43 3 0 ENDSEC 0 EOF";
    let text: String = text.split_whitespace().map(|t| format!("{t}\n")).collect();
    for (stroke, widest_line, want) in [
        (StrokeMode::Shown, 0.06, [ShapeFigure::Lines, ShapeFigure::Stroke]),
        (StrokeMode::Shown, 0.02, [ShapeFigure::Stroke, ShapeFigure::Stroke]),
        (StrokeMode::Centre, 0.0, [ShapeFigure::Lines, ShapeFigure::Lines]),
        (StrokeMode::Outline, 0.06, [ShapeFigure::Stroke, ShapeFigure::Stroke]),
    ] {
        let marking = Marking { stroke, ..Marking::default() };
        let options = DxfOptions { unit_mm: Some(1.0), widest_line, ..options(Path::new("a"), &marking) };
        let art = load(text.as_bytes(), &options, &mut Vec::new()).expect("read");
        let figures: Vec<ShapeFigure> = art.shapes.iter().map(|s| s.figure).collect();
        assert_eq!(figures, want, "{stroke:?} {widest_line}");
        if let [ShapeFigure::Lines, _] = want {
            let corner = art.corner.expect("a corner");
            let line: Vec<[f64; 2]> = art.lines.get(0).iter().map(|p| [p[0] + corner[0], p[1] + corner[1]]).collect();
            assert_eq!(line, [[0.0, 0.0], [5.0, 0.0], [5.0, 5.0]]);
        }
    }
}
