//! Every malformed drawing has one fixed outcome, in little time. `bad_input` bounds the memory.

use std::path::Path;

use crate::support::surfaces::Random;
use crate::support::{folder, malformed, outlined, outlines, processor};
use terrace_core::geom::BoxMm;
use terrace_core::program::PenId;
use terrace_input::texture::{Area, Kind, Masks, Position, Request, Size, Texture};

/// What must come of a file: strokes, or the code of the error; and the codes of the warnings.
type Outcome = (Result<usize, &'static str>, &'static [&'static str]);

/// Files whose page has a physical size of its own, or must not need one to be refused.
const AS_IS: [(&str, Outcome); 30] = [
    ("svg_arc_extremes.svg", (Ok(1), &[])),
    ("svg_billion_laughs.svg", (Err("svg-dtd"), &[])),
    ("svg_deep_groups_100k.svg", (Err("svg-deep"), &[])),
    ("svg_deep_transforms_5k.svg", (Err("svg-deep"), &[])),
    ("svg_empty.svg", (Err("svg-size"), &[])),
    ("svg_external_entity.svg", (Err("svg-dtd"), &[])),
    ("svg_external_refs.svg", (Ok(1), &["svg-image", "svg-external", "svg-external"])),
    ("svg_hairline_slivers.svg", (Err("texture-empty"), &["svg-hairline"])),
    ("svg_huge_size.svg", (Err("texture-far"), &[])),
    ("svg_huge_viewbox.svg", (Ok(1), &[])),
    ("svg_latin1.svg", (Ok(1), &[])),
    ("svg_negative_size.svg", (Err("svg-viewbox"), &[])),
    ("svg_not_closed.svg", (Err("svg-xml"), &[])),
    ("svg_only_text.svg", (Err("texture-empty"), &["svg-text"])),
    ("svg_path_garbage.svg", (Err("texture-empty"), &["svg-path"])),
    ("svg_pattern_self_ref.svg", (Err("texture-empty"), &["svg-paint"])),
    ("svg_pattern_tiny_tile.svg", (Err("svg-large"), &[])),
    ("svg_quadratic_blowup.svg", (Err("svg-dtd"), &[])),
    // 388 corners lie up to 2 mm beyond the page.
    ("svg_self_intersecting_million.svg", (Ok(388), &["svg-overhang"])),
    ("svg_use_bomb.svg", (Err("svg-large"), &[])),
    ("svg_use_cycle.svg", (Err("texture-empty"), &["svg-use"])),
    ("svg_utf16_bom.svg", (Ok(1), &[])),
    ("svg_wrong_namespace.svg", (Err("svg-size"), &["svg-namespace"])),
    ("svg_zero_viewbox.svg", (Err("svg-viewbox"), &[])),
    ("svgz_bomb.svgz", (Err("svg-large"), &[])),
    ("png_truncated.png", (Err("bitmap-truncated"), &[])),
    ("stl_ascii_nan.stl", (Err("svg-xml"), &[])),
    ("stl_empty_file.stl", (Err("svg-xml"), &[])),
    ("3mf_xml_bomb.3mf", (Err("drawing-format"), &[])),
    ("no_such_file.svg", (Err("file-unreadable"), &[])),
];

/// Those that take a second where the program is built without optimization.
pub const HEAVY: [&str; 2] = ["svg_self_intersecting_million.svg", "svg_use_bomb.svg"];

/// The same with a size given.
const SIZED: [(&str, Outcome); 4] = [
    ("svg_empty.svg", (Err("texture-empty"), &[])),
    ("svg_huge_size.svg", (Ok(1), &[])),
    ("svg_negative_size.svg", (Err("svg-viewbox"), &[])),
    ("svg_wrong_namespace.svg", (Ok(1), &["svg-namespace"])),
];

fn check(path: &Path, size_mm: Option<[f64; 2]>, (expected, warnings): Outcome) {
    let name = path.file_name().expect("a name").to_string_lossy();
    let request = Request {
        kind: outlined(path, size_mm),
        area: Area::Unlimited,
        tolerance_mm: 1e-3,
        pen: PenId(0),
        masks: Masks::default(),
    };
    let mut notes = Vec::new();
    let loaded = processor::within(5, &name, || {
        Texture::load(&[request], BoxMm::rectangle(0.0, 0.0, 100.0, 100.0), 0.0, 0.05, &mut notes)
    });
    let codes: Vec<_> = notes.iter().map(|n| n.code).collect();
    match (&loaded, expected) {
        (Ok(texture), Ok(n)) => {
            assert_eq!(texture.len(), n, "{name}: strokes; {codes:?}");
            let mut out = Vec::new();
            for i in 0..texture.len() {
                texture.stroke(i, &mut out);
                assert!(!out.is_empty() && out.iter().all(|&p| texture.bounds().holds(p)), "{name}: stroke {i}");
                assert!(out.windows(2).all(|w| w[0] != w[1]), "{name}: stroke {i}");
            }
        }
        (Err(e), Err(code)) => {
            assert_eq!(e.diags()[0].code, code, "{name}: {e}");
            assert!(e.to_string().contains(&*name), "{name} is named: {e}");
            let hinted = !e.diags()[0].hint.is_empty();
            assert!(hinted, "{name}: a remedy: {e}");
        }
        (got, expected) => panic!("{name}: expected {expected:?}, got {:?}", got.as_ref().map(Texture::len)),
    }
    assert_eq!(codes, warnings, "{name}: {notes:#?}");
}

#[test]
fn malformed_drawings_give_the_expected_messages() {
    let dir = folder();
    for (name, outcome) in AS_IS.into_iter().filter(|(name, _)| !HEAVY.contains(name)) {
        check(&malformed::file(dir.path(), name), None, outcome);
    }
    for (name, outcome) in SIZED {
        check(&malformed::file(dir.path(), name), Some([100.0, 100.0]), outcome);
    }
    let known = |name: &str| AS_IS.iter().any(|(n, _)| *n == name);
    for name in malformed::names() {
        assert!(!name.starts_with("svg") || known(&name), "{name} has no outcome in the table");
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn heavy_drawings_give_the_expected_messages() {
    let dir = folder();
    for (name, outcome) in AS_IS.into_iter().filter(|(name, _)| HEAVY.contains(name)) {
        check(&malformed::file(dir.path(), name), None, outcome);
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn hostile_drawings_are_refused_or_bounded() {
    let dir = folder();
    let head = r#"<svg xmlns="http://www.w3.org/2000/svg" width="100mm" height="100mm" viewBox="0 0 100 100" fill="none" stroke="black">"#;
    let deep_uses: String =
        (0..2000).map(|i| format!(r##"<g id="d{i}"><use href="#d{}"/></g>"##, i + 1)).collect::<String>()
            + "<g id='d2000'/>";
    // A box is asked for around a chain of uses.
    let chain: String = (0..100_000).map(|i| format!(r##"<use id="u{i}" href="#u{}"/>"##, i + 1)).collect();
    let boxed = "<clipPath id='b' clipPathUnits='objectBoundingBox'><path d='M0 0h1v1z'/></clipPath>";
    let chain = format!("<defs>{boxed}{chain}</defs><use href='#u0' clip-path='url(#b)'/>");
    let rules: String = (0..20_000).map(|i| format!(".c{i} g{{fill:none}}")).collect();
    // Each clip path asks thirty times for the one before it.
    let circles = |k: u32| format!("<circle r='9' clip-path='url(#c{k})'/>").repeat(30);
    let clips: String = (1..6).map(|k| format!("<clipPath id='c{k}'>{}</clipPath>", circles(k - 1))).collect();
    let clips = format!("<clipPath id='c0'><circle r='9'/></clipPath>{clips}<path clip-path='url(#c5)' d='M0 0L9 9'/>");
    // Each clip path is cut at the one before it.
    let nested = |k: u32| format!("<clipPath id='n{k}'><circle r='9' clip-path='url(#n{})'/></clipPath>", k - 1);
    let nested: String = (1..200).map(nested).collect();
    let nested =
        format!("<clipPath id='n0'><circle r='9'/></clipPath>{nested}<path clip-path='url(#n199)' d='M0 0L9 9'/>");
    let attributes: String = (0..100_000).map(|i| format!(" a{i}=''")).collect();
    for (name, body, outcome) in [
        ("deep_uses", deep_uses, (Err("svg-deep"), &[][..])),
        ("nested_clips", nested, (Err("svg-deep"), &[])),
        ("chain", chain, (Err("svg-deep"), &[])),
        ("rules", format!("<style>{rules}</style>{}", "<g/>".repeat(20_000)), (Err("svg-css"), &[])),
        ("attributes", format!("<path{attributes}/>"), (Err("svg-large"), &[])),
        ("clips", clips, (Err("svg-large"), &[])),
        (
            "dots",
            r#"<path d="M0 0L9 9"/><path d="M0 0h9" stroke-width="0.01" stroke-linecap="round" stroke-dasharray="0 1"/>"#
                .into(),
            (Ok(10), &[]),
        ),
        ("many_points", r#"<circle r="1e8" cx="0" cy="0" transform="scale(100)"/>"#.into(), (Err("texture-far"), &[])),
        ("nan", r#"<rect width="nan" height="1e999"/><path d="M0 0L9 9"/>"#.into(), (Ok(1), &["svg-path"])),
        (
            "flat",
            r#"<g transform="scale(0 1)"><path d="M0 0L9 9"/></g><path d="M0 0L9 9"/>"#.into(),
            (Ok(1), &["svg-flat"]),
        ),
        ("self_use", r##"<g id="a"><path d="M0 0L9 9"/><use href="#a"/></g>"##.into(), (Ok(1), &["svg-use"])),
        ("entity", "<text>&unknown;</text>".into(), (Err("svg-xml"), &[])),
    ] {
        let path = dir.path().join(format!("{name}.svg"));
        std::fs::write(&path, format!("{head}{body}</svg>")).expect("written");
        check(&path, None, outcome);
    }
}

/// A drawing with most of what is read.
const PLAIN: &str = r##"<svg xmlns="http://www.w3.org/2000/svg" xmlns:x="http://www.w3.org/1999/xlink"
    width="2in" height="1in" viewBox="0 0 200 100">
    <style>.a{fill:#000} g>.b{fill:none;stroke:red!important}</style><defs><symbol id="s" viewBox="0 0 10 10">
    <path d="M5 0A5 5 0 1 1 4.999 0ZM5 2.5a2.5 2.5 30 1 0 5 2q1 2 3 4t5 6c1-2 3-4.5e1 5 6s7 8 9 1z"/></symbol></defs>
    <use x:href="#s" x="10%" y="65" width="20" height="20"/><g transform="rotate(15 60 75) scale(1.2)" class="b">
    <use href="#s" x="40"/><svg x="1" width="50%" height="3em" viewBox="0 0 9 9"><rect rx="1" width="5" height="4"/>
    </svg><polygon points="1,2 3-4 5.5.5"/><ellipse cx="9" rx="4" ry="3mm"/><line x2="9" style="stroke:blue"/></g>
    </svg>"##;

/// What it is damaged with.
const PIECES: [&str; 20] = [
    "<", ">", "\"", "/", "0", "-", "e9", "e-9", "9999", ".", "z", "A", "&", "%", "#", "<g>", "</g>", "nan", "\u{0}", "",
];

#[test]
fn damaged_drawings_never_panic_and_yield_valid_strokes() {
    for seed in 0..300 {
        // Shown where the program panics.
        eprintln!("seed {seed}");
        let mut noise = Random::case(seed);
        let which = noise.below(3);
        let mut text = PLAIN.to_owned();
        for _ in 0..noise.between(1, 5) {
            let (at, piece) = (noise.below(text.len()), noise.below(PIECES.len()));
            if text.is_char_boundary(at) && text.is_char_boundary(at + 1) {
                text.replace_range(at..at + which.min(1), PIECES[piece]);
            }
        }
        let file = tempfile::Builder::new().suffix(".svg").tempfile().expect("a file");
        std::fs::write(file.path(), text).expect("written");
        let kind = Kind::Drawing {
            path: file.path().into(),
            size: Size::File,
            unit_mm: None,
            position: Position::Usual,
            turn_rad: 0.3,
            tile: which == 2,
            marking: outlines(),
        };
        let request = Request { kind, area: Area::Part, tolerance_mm: 1e-2, pen: PenId(0), masks: Masks::default() };
        if let Ok(texture) =
            Texture::load(&[request], BoxMm::rectangle(0.0, 0.0, 30.0, 20.0), 0.1, 0.05, &mut Vec::new())
        {
            let mut out = Vec::new();
            for i in (0..texture.len()).take(1000) {
                texture.stroke(i, &mut out);
                assert!(out.len() > 1 && out.windows(2).all(|w| w[0] != w[1]), "seed {seed}: stroke {i}");
                assert!(out.iter().all(|&p| texture.bounds().holds(p)), "seed {seed}: stroke {i}");
            }
        }
    }
}
