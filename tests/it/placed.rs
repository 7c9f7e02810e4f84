//! Where textures lie: size, fit and alignment of drawings, what is inside or outside the area of one, soft borders.

use std::path::Path;
use terrace_core::math;

use terrace_core::diag::Error;
use terrace_core::geom::{BoxMm, P2, length_mm};
use terrace_input::job::{Job, Overrides};
use terrace_input::texture::Texture;

use crate::support::surfaces::{mesh, write_stl};
use crate::support::{JobText, assert_balance, compile, folder, number, verify};

/// The part's box.
const PART: BoxMm<2> = BoxMm::rectangle(-10.0, 0.0, 50.0, 40.0);

/// The texture that the keys make on a part with that box, next to the files of a folder.
fn texture(dir: &Path, keys: &str) -> Result<Texture, Error> {
    turned(dir, keys, 0.0)
}

fn turned(dir: &Path, keys: &str, turn_rad: f64) -> Result<Texture, Error> {
    let job = JobText::on(Path::new("absent.stl")).texture(keys).write(dir, "job.toml");
    let job = Job::load(&job, &Overrides::default())?;
    Texture::load(&job.textures, PART, turn_rad, 0.02, &mut Vec::new())
}

fn strokes(texture: &Texture) -> Vec<Vec<P2>> {
    let mut points = Vec::new();
    let stroke = |i| {
        texture.stroke(i, &mut points);
        points.clone()
    };
    (0..texture.len()).map(stroke).collect()
}

/// A drawing whose one line runs round its page of 20 x 10.
fn frame(dir: &Path, name: &str, size: &str) {
    let svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" {size} viewBox=\"0 0 20 10\">\
         <path d=\"M0 0h20v10h-20z\" fill=\"none\" stroke=\"#000\" stroke-width=\".001\"/></svg>"
    );
    std::fs::write(dir.join(name), svg).expect("writable");
}

fn bounds(texture: &Texture) -> [f64; 4] {
    let (lo, hi) = (texture.bounds().lo.mm(), texture.bounds().hi.mm());
    [lo[0], lo[1], hi[0], hi[1]]
}

#[test]
fn drawings_are_fitted_scaled_and_aligned() {
    let dir = folder();
    frame(dir.path(), "mm.svg", "width=\"20mm\" height=\"10mm\"");
    frame(dir.path(), "px.svg", "");
    let dxf = "0\nSECTION\n2\nHEADER\n9\n$INSUNITS\n70\n4\n0\nENDSEC\n0\nSECTION\n2\nENTITIES\n\
               0\nLINE\n8\n0\n10\n5\n20\n5\n11\n25\n21\n5\n0\nLINE\n8\n0\n10\n25\n20\n5\n11\n25\n21\n15\n\
               0\nENDSEC\n0\nEOF\n";
    std::fs::write(dir.path().join("corner.dxf"), dxf).expect("writable");
    let area = "area = [\"0 mm\", \"0 mm\", \"30 mm\", \"30 mm\"]";
    for (keys, want) in [
        // The part's box is 60 x 40 mm, from -10, 0 to 50, 40.
        ("file = \"px.svg\"\nfit = \"contain\"".to_owned(), [-10.0, 5.0, 50.0, 35.0]),
        ("file = \"px.svg\"\nfit = \"cover\"".to_owned(), [-20.0, 0.0, 60.0, 40.0]),
        ("file = \"px.svg\"\nfit = \"height\"\nalign = \"left\"".to_owned(), [-10.0, 0.0, 70.0, 40.0]),
        ("file = \"px.svg\"\nfit = \"contain\"\nturn = \"90 deg\"".to_owned(), [10.0, 0.0, 30.0, 40.0]),
        (format!("file = \"px.svg\"\nfit = \"width\"\nalign = \"bottom\"\n{area}"), [0.0, 0.0, 30.0, 15.0]),
        ("file = \"mm.svg\"\nscale = 1.5".to_owned(), [5.0, 12.5, 35.0, 27.5]),
        ("file = \"mm.svg\"\nalign = \"right top\"".to_owned(), [30.0, 30.0, 50.0, 40.0]),
        (format!("file = \"mm.svg\"\nalign = \"centre\"\n{area}"), [5.0, 10.0, 25.0, 20.0]),
        (format!("file = \"mm.svg\"\n{area}"), [0.0, 0.0, 20.0, 10.0]),
        // A turned page is aligned by the box around it.
        ("file = \"mm.svg\"\nturn = \"-90 deg\"\nalign = \"left bottom\"".to_owned(), [-10.0, 0.0, 0.0, 20.0]),
        // Its own coordinates, multiplied; or the box of what it shows, aligned.
        ("file = \"corner.dxf\"\nscale = 2.0".to_owned(), [10.0, 10.0, 50.0, 30.0]),
        ("file = \"corner.dxf\"\nscale = 0.5\nalign = \"centre\"".to_owned(), [15.0, 17.5, 25.0, 22.5]),
        ("file = \"corner.dxf\"\nfit = \"width\"".to_owned(), [-10.0, 5.0, 50.0, 35.0]),
    ] {
        let texture = texture(dir.path(), &keys).unwrap_or_else(|e| panic!("{keys}: {e}"));
        let found = bounds(&texture);
        assert!((0..4).all(|k| (found[k] - want[k]).abs() < 1.5e-6), "{keys}: {found:?}");
    }
}

#[test]
fn curves_of_a_drawing_that_grows_stay_within_the_tolerance() {
    let dir = folder();
    let dxf = "0\nSECTION\n2\nENTITIES\n0\nCIRCLE\n8\n0\n10\n0\n20\n0\n40\n0.1\n0\nENDSEC\n0\nEOF\n";
    std::fs::write(dir.path().join("circle.dxf"), dxf).expect("writable");
    std::fs::write(dir.path().join("circle.plt"), "IN;SP1;PA100,100;CI40;").expect("writable");
    for file in ["circle.dxf\"\nunit = \"mm", "circle.plt"] {
        let keys = format!("file = \"{file}\"\nfit = \"height\"\ntolerance = \"1 um\"");
        let circle = &strokes(&texture(dir.path(), &keys).unwrap_or_else(|e| panic!("{file}: {e}")))[0];
        for side in circle.windows(2) {
            let middle = side[0].lerp(side[1], 0.5).mm();
            let from = 20.0 - math::hypot(middle[0] - 20.0, middle[1] - 20.0);
            // The box of the polygon, which is the page, is within the tolerance too.
            assert!((-1e-3..2e-3).contains(&from), "{file}: {} points, {from} mm inside the circle", circle.len());
        }
    }
}

#[test]
fn keys_that_contradict_each_other_are_refused() {
    let dir = folder();
    frame(dir.path(), "mm.svg", "width=\"20mm\" height=\"10mm\"");
    frame(dir.path(), "px.svg", "");
    let size = "size = [\"4 mm\", \"2 mm\"]";
    let origin = "origin = [\"4 mm\", \"2 mm\"]";
    for (keys, code, words) in [
        (format!("file = \"mm.svg\"\nfit = \"width\"\n{size}"), "texture-key", "both size and fit"),
        (format!("file = \"mm.svg\"\nscale = 2.0\n{size}"), "texture-key", "both size and scale"),
        ("file = \"mm.svg\"\nfit = \"width\"\nscale = 2.0".to_owned(), "texture-key", "both scale and fit"),
        (format!("file = \"mm.svg\"\nfit = \"width\"\n{origin}"), "texture-key", "both origin and fit"),
        (format!("file = \"mm.svg\"\nalign = \"left\"\n{origin}"), "texture-key", "both origin and align"),
        ("file = \"mm.svg\"\nscale = 0.0".to_owned(), "texture-key", "scale 0 is not possible"),
        ("file = \"px.svg\"\nscale = 2.0".to_owned(), "svg-size", "no physical size"),
        ("pattern = \"hatch\"\npitch = \"1 mm\"\nalign = \"left\"".to_owned(), "texture-key", "align does not apply"),
    ] {
        let e = texture(dir.path(), &keys).expect_err(&keys);
        let d = &e.diags()[0];
        assert!(d.code == code && d.message.contains(words), "{keys}: {e}");
    }
}

/// A page of 40 x 30 mm: a square with a hole, a star of one closed line, two layers and an open line.
const SHAPES: &str = "<svg xmlns=\"http://www.w3.org/2000/svg\" xmlns:i=\"http://www.inkscape.org/namespaces/inkscape\" \
    width=\"40mm\" height=\"30mm\" viewBox=\"0 0 40 30\">\
    <path id=\"ring\" d=\"M2 2h16v16h-16zM6 6h8v8h-8z\" fill-rule=\"evenodd\" fill=\"#fff\"/>\
    <g i:groupmode=\"layer\" i:label=\"Rim\" id=\"layer1\"><circle cx=\"28\" cy=\"12\" r=\"9\" fill=\"none\" stroke=\"#f00\"/>\
    <circle cx=\"28\" cy=\"12\" r=\"4\" fill=\"none\" stroke=\"#f00\"/></g>\
    <path id=\"star\" class=\"sharp\" d=\"M20 1L26 29L1 11L39 11L14 29Z\" fill-rule=\"evenodd\"/>\
    <path id=\"open\" d=\"M1 1h9v9\" fill=\"none\" stroke=\"#000\" stroke-width=\".01\"/></svg>";

fn total(texture: &Texture) -> f64 {
    strokes(texture).iter().map(|s| length_mm(s)).sum()
}

#[test]
fn hatch_inside_a_ring_has_the_length_of_its_closed_form() {
    let dir = folder();
    std::fs::write(dir.path().join("shapes.svg"), SHAPES).expect("writable");
    let hatch = "pattern = \"hatch\"\npitch = \"0.5 mm\"";
    // The lower left corner of the page lies at 0.1, 0.1, so no line lies on a border; y of the page points down.
    let mask = |name: &str| format!("{{ file = \"shapes.svg{name}\", origin = [\"0.1 mm\", \"0.1 mm\"] }}");
    let ring = texture(dir.path(), &format!("{hatch}\ninside = {}", mask("#ring"))).expect("a texture");
    // 32 lines meet the square, 16 of them the hole too.
    assert_eq!(ring.len(), 48);
    assert!((total(&ring) - (32.0 * 16.0 - 16.0 * 8.0)).abs() < 1e-5, "{}", total(&ring));
    assert_eq!(bounds(&ring).map(|v| (v * 1e6).round() / 1e6), [2.1, 12.5, 18.1, 28.0]);
    assert!(ring.element(1).ends_with("piece 1") || ring.element(17).contains("piece"), "{}", ring.element(17));
    let outside = texture(dir.path(), &format!("{hatch}\noutside = {}", mask("#ring"))).expect("a texture");
    let all = texture(dir.path(), hatch).expect("a texture");
    assert!((total(&ring) + total(&outside) - total(&all)).abs() < 1e-4);
    // Both: what lies in the one and not in the other.
    let both = format!("inside = {}\noutside = {}", mask("#ring"), mask("#star"));
    let only = |more: &str| total(&texture(dir.path(), &format!("{hatch}\n{more}")).expect("a texture"));
    let common = only(&both);
    assert!(common > 10.0 && common < total(&ring) - 10.0);
    // Circles that are lines bound a ring, whose area the lines tell.
    let area = 0.5 * only(&format!("inside = {}", mask("#Rim")));
    let want = std::f64::consts::PI * (81.0 - 16.0);
    assert!((area / want - 1.0).abs() < 0.01, "{area} instead of {want}");
}

/// Textures of every kind.
fn kinds(dir: &Path) -> Vec<String> {
    let tile = "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"7mm\" height=\"5mm\" viewBox=\"0 0 7 5\">\
                <path d=\"M0 0L7 5M1 4q2-3 5 0z\" fill=\"none\" stroke=\"#000\" stroke-width=\".01\"/></svg>";
    std::fs::write(dir.join("tile.svg"), tile).expect("writable");
    let patterns = [
        ("hatch", "pitch = \"0.7 mm\"\ndirection = \"31 deg\""),
        ("hilbert", "order = 5"),
        ("squares", "pitch = \"2 mm\"\ncell = \"1.5 mm\""),
        ("circles", "pitch = \"3 mm\"\ncell = \"2.9 mm\"\nlattice = \"hex\""),
        ("honeycomb", "pitch = \"3 mm\""),
        ("riblets", "pitch = \"2 mm\"\ncell = \"1 mm\"\nline = \"0.2 mm\""),
        ("concentric", "pitch = \"1.1 mm\""),
        ("spiral", "pitch = \"1.3 mm\""),
    ];
    let patterns = patterns.iter().map(|(name, keys)| format!("pattern = \"{name}\"\n{keys}"));
    let drawings = ["fit = \"cover\"\narea = \"part\"", "tile = true\narea = \"part\"\nturn = \"20 deg\""];
    patterns.chain(drawings.iter().map(|keys| format!("file = \"tile.svg\"\n{keys}"))).collect()
}

#[test]
#[ignore = "slow: make test-all"]
fn inside_and_outside_divide_every_kind_of_texture() {
    let dir = folder();
    std::fs::write(dir.path().join("shapes.svg"), SHAPES).expect("writable");
    for turn in [0.0, 0.6] {
        for keys in kinds(dir.path()) {
            let with = |side: &str| {
                let mask = "{ file = \"shapes.svg#star\", origin = [\"-3.3 mm\", \"4.1 mm\"], turn = \"10 deg\" }";
                turned(dir.path(), &format!("{keys}\n{side} = {mask}"), turn).unwrap_or_else(|e| panic!("{keys}: {e}"))
            };
            let (all, inside, outside) =
                (turned(dir.path(), &keys, turn).expect("whole"), with("inside"), with("outside"));
            let sum = total(&inside) + total(&outside);
            assert!((sum / total(&all) - 1.0).abs() < 1e-6, "{keys}: {sum} instead of {}", total(&all));
            assert!(total(&inside) > 0.05 * sum && total(&outside) > 0.05 * sum, "{keys}");
            for part in [&inside, &outside] {
                let found = strokes(part);
                let mut bounds = terrace_core::geom::Box2::EMPTY;
                found.iter().flatten().for_each(|&p| bounds.add(p));
                assert_eq!(part.bounds(), bounds, "{keys}");
                assert!(found.iter().all(|s| s.len() > 1 && s.windows(2).all(|w| w[0] != w[1])), "{keys}");
                assert_eq!(part.points_estimate(), found.iter().map(|s| s.len() as u64).sum::<u64>(), "{keys}");
                // In whatever order they are asked for.
                let mut points = Vec::new();
                for i in (0..part.len()).rev().step_by(7) {
                    part.stroke(i, &mut points);
                    assert_eq!(points, found[i], "{keys}, stroke {i}");
                }
            }
        }
    }
}

#[test]
fn masks_are_found_by_their_names_and_lie_where_a_drawing_with_the_same_keys_would() {
    let dir = folder();
    std::fs::write(dir.path().join("shapes.svg"), SHAPES).expect("writable");
    let hatch = "pattern = \"hatch\"\npitch = \"0.5 mm\"";
    let shown = |keys: &str| {
        let found = texture(dir.path(), keys).unwrap_or_else(|e| panic!("{keys}: {e}"));
        bounds(&found).map(|v| (v * 10.0).round() / 10.0)
    };
    for name in ["star", "id:star", "class:sharp", "sharp"] {
        // The page lies in the middle of the part's box: its corner at 0, 5.
        let found = shown(&format!("{hatch}\ninside = \"shapes.svg#{name}\""));
        assert!((found[0] - 1.0).abs() < 0.5 && (found[1] - 6.0).abs() < 0.6 && found[3] <= 34.0, "{name}: {found:?}");
    }
    assert_eq!(shown(&format!("{hatch}\ninside = \"shapes.svg#layer:Rim\"")), [19.0, 14.5, 37.0, 31.5]);
    // The drawing and the mask have one page, which the keys of the texture place.
    let place = "fit = \"height\"\nalign = \"left\"\nfill = \"outline\"\nstroke = \"centre\"";
    let drawing = format!("file = \"shapes.svg\"\n{place}\nonly = [\"id:star\"]");
    let whole = total(&texture(dir.path(), &drawing).expect("drawn"));
    for name in ["star", "id:star"] {
        let inside = total(&texture(dir.path(), &format!("{drawing}\ninside = \"shapes.svg#{name}\"")).expect("drawn"));
        assert!((inside / whole - 1.0).abs() < 1e-6, "the outline lies on its own border: {inside} of {whole}");
    }
}

#[test]
fn outlines_of_dxf_files_are_joined_and_open_ones_are_refused() {
    let dir = folder();
    // A stadium of two lines and two arcs, in disorder and both directions, around a circle; its end misses by 0.5 um.
    let entities = |end: f64| {
        format!(
            "0\nSECTION\n2\nHEADER\n9\n$INSUNITS\n70\n4\n0\nENDSEC\n0\nSECTION\n2\nENTITIES\n\
             0\nLINE\n8\nRIM\n10\n10\n20\n10\n11\n30\n21\n10\n\
             0\nARC\n8\nRIM\n10\n10\n20\n15\n40\n5\n50\n90\n51\n270\n\
             0\nLINE\n8\nRIM\n10\n10\n20\n20\n11\n{end}\n21\n20\n\
             0\nARC\n8\nRIM\n10\n30\n20\n15\n40\n5\n50\n270\n51\n90\n\
             0\nCIRCLE\n8\nRIM\n10\n20\n20\n15\n40\n2\n\
             0\nLINE\n8\nNOTE\n10\n0\n20\n0\n11\n1\n21\n0\n0\nENDSEC\n0\nEOF\n"
        )
    };
    let keys = "pattern = \"hatch\"\npitch = \"0.05 mm\"\ninside = \"rim.dxf#RIM\"";
    std::fs::write(dir.path().join("rim.dxf"), entities(30.0005)).expect("writable");
    let found = texture(dir.path(), keys).expect("joined");
    // The lines on the straight sides, 20 mm long, belong to the area: half of each lies beyond it.
    let want = 200.0 + std::f64::consts::PI * (25.0 - 4.0) + 0.05 * 20.0;
    assert!((0.05 * total(&found) / want - 1.0).abs() < 2e-4, "{}", 0.05 * total(&found));
    // It keeps its own coordinates.
    assert_eq!(bounds(&found).map(f64::round), [5.0, 10.0, 35.0, 20.0]);
    std::fs::write(dir.path().join("rim.dxf"), entities(29.9)).expect("writable");
    let e = texture(dir.path(), keys).expect_err("open");
    assert!(e.diags()[0].code == "mask-open" && e.to_string().contains("rim.dxf"), "{e}");
}

#[test]
fn masks_that_cannot_be_are_refused() {
    let dir = folder();
    std::fs::write(dir.path().join("shapes.svg"), SHAPES).expect("writable");
    let hatch = "pattern = \"hatch\"\npitch = \"0.5 mm\"";
    for (keys, code, words) in [
        ("inside = \"shapes.svg#rum\"", "mask-unknown", "layer:Rim"),
        ("inside = \"shapes.svg#open\"", "mask-open", "10.0000, 20.0000 mm"),
        ("inside = \"shapes.svg#\"", "texture-key", "names no file"),
        ("inside = \"absent.svg#a\"", "file-unreadable", "absent.svg"),
        ("soft = \"1 mm\"", "texture-key", "without inside or outside"),
        ("inside = \"shapes.svg#ring\"\nseed = 4", "texture-key", "without soft"),
        ("inside = { file = \"shapes.svg#ring\", scale = 1.0, fit = \"cover\" }", "texture-key", "both scale and fit"),
        ("inside = { file = \"shapes.svg#ring\", origin = [\"90 mm\", \"0 mm\"] }", "texture-empty", "nothing to mark"),
        ("inside = \"shapes.svg#ring\"\noutside = \"shapes.svg#ring\"", "texture-empty", "nothing to mark"),
    ] {
        let e = texture(dir.path(), &format!("{hatch}\n{keys}")).expect_err(keys);
        let d = &e.diags()[0];
        assert!(d.code == code && e.to_string().contains(words), "{keys}: {e}");
    }
}

/// The share of a texture that is marked at distances from the border of a mask, in tenths of the width.
fn shares(texture: &Texture, whole: &Texture, away: impl Fn([f64; 2]) -> f64) -> [f64; 12] {
    let lengths = |texture: &Texture| {
        let mut out = [0.0; 12];
        for stroke in strokes(texture) {
            for side in stroke.windows(2) {
                let steps = (side[0].distance(side[1]) / 5e3).ceil();
                for k in 0..steps as u32 {
                    let at = side[0].lerp(side[1], (f64::from(k) + 0.5) / steps).mm();
                    let tenth = (away(at) * 10.0).floor();
                    if (0.0..12.0).contains(&tenth) {
                        out[tenth as usize] += side[0].distance(side[1]) / steps;
                    }
                }
            }
        }
        out
    };
    let (part, all) = (lengths(texture), lengths(whole));
    std::array::from_fn(|k| part[k] / all[k])
}

/// The length of what lies between two values of x.
fn length_between(texture: &Texture, [lo, hi]: [f64; 2]) -> f64 {
    let side = |w: &[P2]| {
        let ([x0, y0], [x1, y1]) = (w[0].mm(), w[1].mm());
        let t = |x: f64| if x1 == x0 { f64::from(x0 >= x) } else { ((x - x0) / (x1 - x0)).clamp(0.0, 1.0) };
        math::hypot(x1 - x0, y1 - y0) * (t(hi) - t(lo)).abs()
    };
    strokes(texture).iter().flat_map(|s| s.windows(2).map(side).collect::<Vec<_>>()).sum()
}

#[test]
#[ignore = "slow: make test-all"]
fn coverage_falls_linearly_over_a_soft_border() {
    let dir = folder();
    let svg = "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"60mm\" height=\"40mm\" viewBox=\"0 0 60 40\">\
               <path id=\"half\" d=\"M-100-100h150v300h-150z\"/></svg>";
    std::fs::write(dir.path().join("half.svg"), svg).expect("writable");
    // The border is the line x = 40 of the part; what lies beyond the other sides is far away.
    let width = 8.0;
    for keys in [
        "pattern = \"hatch\"\npitch = \"0.02 mm\"",
        "pattern = \"hatch\"\npitch = \"0.02 mm\"\ndirection = \"35 deg\"",
        "pattern = \"hatch\"\npitch = \"0.01 mm\"\ndirection = \"90 deg\"",
        "pattern = \"squares\"\npitch = \"0.4 mm\"\ncell = \"0.3 mm\"",
    ] {
        let whole = texture(dir.path(), keys).expect("whole");
        for (side, sign) in [("inside", 1.0), ("outside", -1.0)] {
            let mask = format!("{side} = {{ file = \"half.svg#half\", origin = [\"-10 mm\", \"0 mm\"] }}");
            let soft = texture(dir.path(), &format!("{keys}\n{mask}\nsoft = \"{width} mm\"")).expect("soft");
            let far = if sign > 0.0 { [-20.0, 40.0 - width] } else { [40.0 + width, 60.0] };
            let [all, marked] = [&whole, &soft].map(|texture| length_between(texture, far));
            assert!((all - marked).abs() < 1e-4 && all > 10.0, "{keys}, {side}: {marked} of {all} far from the border");
            let found = shares(&soft, &whole, |p| sign * (40.0 - p[0]) / width);
            for (k, share) in found.iter().enumerate() {
                let want = ((k as f64 + 0.5) / 10.0).min(1.0);
                // Lines along the border are marked or not in lengths of 20 mm, 160 in each tenth: 3 standard deviations.
                let drawn = if keys.contains("90 deg") { 0.12 } else { 0.05 };
                let tolerance = if want == 1.0 { 5e-3 } else { drawn };
                assert!((share - want).abs() < tolerance, "{keys}, {side}, {k} tenths: {share}");
            }
        }
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn the_seed_decides_where_strokes_end_and_far_from_the_border_none_is_cut() {
    let dir = folder();
    std::fs::write(dir.path().join("shapes.svg"), SHAPES).expect("writable");
    for keys in kinds(dir.path()) {
        let with = |more: &str| {
            let keys = format!("{keys}\noutside = {{ file = \"shapes.svg#star\", fit = \"contain\" }}\n{more}");
            strokes(&texture(dir.path(), &keys).unwrap_or_else(|e| panic!("{keys}: {e}")))
        };
        let soft = with("soft = \"2 mm\"");
        assert_eq!(soft, with("soft = \"2 mm\"\nseed = 0"), "{keys}");
        assert_ne!(soft, with("soft = \"2 mm\"\nseed = 1"), "{keys}");
        let (sharp, length) = (with(""), |s: &[Vec<P2>]| s.iter().map(|s| length_mm(s)).sum::<f64>());
        assert!(length(&soft) < length(&sharp) && length(&soft) > 0.3 * length(&sharp), "{keys}");
    }
    // A closed figure that the border is far from stays closed and whole.
    let far = "pattern = \"circles\"\npitch = \"2 mm\"\ncell = \"1 mm\"\nsoft = \"0.2 mm\"\n\
               inside = { file = \"shapes.svg#star\", fit = \"contain\" }";
    let closed = strokes(&texture(dir.path(), far).expect("circles")).iter().filter(|s| s.first() == s.last()).count();
    assert!(closed > 50, "{closed}");
}

#[test]
#[ignore = "slow: make test-all"]
fn jobs_with_masks_are_verified_and_name_their_files() {
    let dir = folder();
    let stl = dir.path().join("ridge.stl");
    write_stl(&stl, &mesh(40, [-10.0, 0.0, 50.0, 40.0], |x, y| 2.0 * math::sin(x / 20.0) + math::cos(y / 17.0)));
    std::fs::write(dir.path().join("shapes.svg"), SHAPES).expect("writable");
    let mut job = JobText::on(&stl)
        .texture("pattern = \"hatch\"\npitch = \"0.5 mm\"\ninside = \"shapes.svg#Rim\"\nsoft = \"1 mm\"")
        .texture("pattern = \"hatch\"\npitch = \"0.5 mm\"\ndirection = \"contour\"\noutside = \"shapes.svg#Rim\"")
        .texture("file = \"shapes.svg\"\nonly = [\"id:star\"]\npitch = \"0.3 mm\"\ninside = \"shapes.svg#ring\"");
    for (turn, passes) in [(0, 1), (25, 2)] {
        job.more = format!("[placement]\nturn = \"{turn} deg\"\n[passes]\ncount = {passes}\nrotate = \"67 deg\"\n");
        let (job, out) = (job.write(dir.path(), "job.toml"), dir.path().join("out.job"));
        let summary = compile(&job, &out);
        assert_balance(&summary, &verify(&out));
        assert!(number(&summary, "mark_mm") > 1000.0);
        let manifest = crate::support::manifest(&out);
        let inputs = manifest["inputs"].as_array().expect("inputs");
        assert!(inputs.iter().any(|i| i["file"] == "shapes.svg"), "{inputs:?}");
    }
}
