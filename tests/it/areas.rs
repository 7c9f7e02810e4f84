//! Filled areas of drawings: hatch and rings in closed form, exactly inside, with the pens that the job gives.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, SQRT_2};
use terrace_core::math;

use crate::support::surfaces::Random;
use crate::support::{folder, processor};
use terrace_core::diag::{Diag, Error};
use terrace_core::geom::{BoxMm, Nm, P2};
use terrace_core::program::{PenId, Sections};
use terrace_input::texture::{
    Area, ContourPass, Directions, FillMode, Kind, Marking, Masks, Mirror, Paper, Position, Request, Selector, Size,
    StrokeMode, Texture,
};

const SPOT: f64 = 0.04;

/// A page of 20 mm x 20 mm, y down.
fn load(body: &str, marking: Marking) -> Result<(Texture, Vec<Diag>), Error> {
    let folder = folder();
    let path = folder.path().join("drawing.svg");
    let text = format!(
        r#"<svg xmlns="http://www.w3.org/2000/svg" xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape"
            width="20mm" height="20mm" viewBox="0 0 20 20">{body}</svg>"#
    );
    std::fs::write(&path, text).expect("written");
    let kind = Kind::Drawing {
        path,
        size: Size::File,
        unit_mm: None,
        position: Position::Origin([0.0; 2]),
        turn_rad: 0.0,
        tile: false,
        marking: Box::new(marking),
    };
    let request = Request { kind, area: Area::Unlimited, tolerance_mm: 1e-3, pen: PenId(0), masks: Masks::default() };
    let mut notes = Vec::new();
    Texture::load(&[request], BoxMm::rectangle(0.0, 0.0, 20.0, 20.0), 0.0, SPOT, &mut notes).map(|t| (t, notes))
}

fn strokes(texture: &Texture) -> Vec<(PenId, Vec<P2>)> {
    let mut points = Vec::new();
    (0..texture.len()).map(|i| (texture.stroke(i, &mut points), points.clone())).collect()
}

fn length(points: &[P2]) -> f64 {
    points
        .windows(2)
        .map(|w| (w[1].x - w[0].x) as f64 * 1e-6)
        .zip(points.windows(2))
        .map(|(dx, w)| math::hypot(dx, (w[1].y - w[0].y) as f64 * 1e-6))
        .sum()
}

fn total(texture: &Texture) -> f64 {
    strokes(texture).iter().map(|(_, points)| length(points)).sum()
}

/// A square of 10 mm with a square hole of 4 mm in its middle.
const RING: &str = r#"<path fill-rule="evenodd" d="M4 4h10v10h-10zM7 7h4v4h-4z"/>"#;

#[test]
fn a_square_with_a_hole_has_the_lines_of_its_closed_form() {
    let (pitch, inset) = (0.1, SPOT / 2.0);
    let marking = Marking { pitch_mm: Some(pitch), direction_rad: FRAC_PI_4, ..Marking::default() };
    let (texture, notes) = load(RING, marking).expect("a texture");
    assert!(notes.is_empty(), "{notes:?}");
    // The middle of both squares is (9, 11) on the page, y up; lines lie at v = (y - x) / sqrt(2) = (k + 1/2) pitch.
    let (mut count, mut want) = (0, 0.0);
    for k in -200..200 {
        let away = ((f64::from(k) + 0.5) * pitch - (11.0 - 9.0) / SQRT_2).abs();
        let chord = SQRT_2 * (10.0 - 2.0 * inset) - 2.0 * away;
        if chord <= 0.0 {
            continue;
        }
        // The hole grown by the inset: a square on its corner whose corners are arcs.
        let corner = 2.0 * SQRT_2;
        let half = if away <= inset / SQRT_2 {
            corner + (inset * inset - away * away).sqrt()
        } else if away <= corner + inset / SQRT_2 {
            corner + inset * SQRT_2 - away
        } else {
            (inset * inset - (away - corner).powi(2)).max(0.0).sqrt()
        };
        count += if half > 0.0 { 2 } else { 1 };
        want += chord - 2.0 * half;
    }
    assert_eq!(texture.len(), count);
    assert!((total(&texture) / want - 1.0).abs() < 1e-6, "{} mm instead of {want}", total(&texture));
    // Neighbours run in opposite directions.
    let towards = |points: &[P2]| points[1].x > points[0].x;
    let lines = strokes(&texture);
    assert!(lines.iter().any(|(_, l)| towards(l)) && lines.iter().any(|(_, l)| !towards(l)));
}

#[test]
fn a_mirrored_page_has_the_mirrored_marks() {
    // Cut at a clip path with a corner of its own, so that both are mirrored alike.
    let body = r#"<clipPath id="c"><path d="M2 2h12l-7 9z"/></clipPath><path clip-path="url(#c)" d="M1 3h9v5h-9z"/>
        <path fill="none" stroke="black" stroke-width="0.01" d="M1 15l4 3l6 1"/>"#;
    for fill in [FillMode::Outline, FillMode::Hatch] {
        let marks = |mirror| load(body, Marking { fill, mirror, ..Marking::default() }).expect("a texture").0;
        let plain = marks(None);
        for (mirror, axis) in [(Mirror::X, 0), (Mirror::Y, 1)] {
            let mirrored = marks(Some(mirror));
            assert!((total(&mirrored) - total(&plain)).abs() < 1e-3 * total(&plain), "{mirror:?}");
            let [plain, mirrored] = [&plain, &mirrored].map(|t| [t.bounds().lo.mm(), t.bounds().hi.mm()]);
            let mut want = plain;
            (want[0][axis], want[1][axis]) = (20.0 - plain[1][axis], 20.0 - plain[0][axis]);
            let near = |a: [f64; 2], b: [f64; 2]| (0..2).all(|k| (a[k] - b[k]).abs() < SPOT / 2.0);
            assert!(near(mirrored[0], want[0]) && near(mirrored[1], want[1]), "{mirror:?}: {mirrored:?} {want:?}");
        }
    }
}

/// Twice the area of a triangle, exactly.
fn side(a: P2, b: P2, c: P2) -> i128 {
    i128::from(b.x - a.x) * i128::from(c.y - a.y) - i128::from(b.y - a.y) * i128::from(c.x - a.x)
}

fn inside(p: P2, ring: &[P2]) -> bool {
    let mut odd = false;
    for (k, &a) in ring.iter().enumerate() {
        let b = ring[(k + 1) % ring.len()];
        let (low, high) = if a.y <= b.y { (a, b) } else { (b, a) };
        if (low.y <= p.y) != (high.y <= p.y) && side(low, high, p) > 0 {
            odd = !odd;
        }
    }
    odd
}

#[test]
fn no_line_leaves_its_area() {
    for seed in 0..40 {
        let mut noise = Random::case(seed);
        let (corners, path) = star(&mut noise);
        let marking = Marking { direction_rad: noise.range(-3.0, 3.0), ..hatch(seed) };
        let Ok((texture, _)) = load(&path, marking) else { continue };
        lies_in(&texture, &corners, seed);
    }
}

/// A hatch with or without an inset and a second set of lines.
fn hatch(seed: u64) -> Marking {
    Marking {
        pitch_mm: Some(0.1),
        inset_mm: Some(if seed.is_multiple_of(2) { 0.0 } else { 0.02 }),
        cross: seed.is_multiple_of(3),
        ..Marking::default()
    }
}

/// A star about (10, 10) whose corners are whole nanometres, and its element.
fn star(noise: &mut Random) -> (Vec<P2>, String) {
    let angles: Vec<f64> =
        (0..noise.range(3.0, 40.0) as usize).map(|_| noise.range(0.0, std::f64::consts::TAU)).collect();
    let corner = |(a, r): (f64, f64)| {
        P2::new(((10.0 + r * math::cos(a)) * 1e6) as i64, ((10.0 + r * math::sin(a)) * 1e6) as i64)
    };
    let mut corners: Vec<P2> = angles.into_iter().map(|angle| (angle, noise.range(0.5, 9.0))).map(corner).collect();
    let angle = |p: &P2| math::atan2((p.y - 10_000_000) as f64, (p.x - 10_000_000) as f64);
    corners.sort_by(|a, b| angle(a).total_cmp(&angle(b)));
    let path: Vec<String> =
        corners.iter().map(|p| format!("{:.6} {:.6}", p.x as f64 * 1e-6, 20.0 - p.y as f64 * 1e-6)).collect();
    (corners, format!(r#"<path d="M{}Z"/>"#, path.join("L")))
}

/// Holds every line of a texture to lie in a polygon, exactly.
fn lies_in(texture: &Texture, corners: &[P2], seed: u64) {
    for (_, line) in strokes(texture) {
        let [a, b] = line[..] else { panic!("seed {seed}: a line has two ends") };
        assert!(inside(a, corners) && inside(b, corners), "seed {seed}: {a:?} {b:?}");
        for (k, &c) in corners.iter().enumerate() {
            let d = corners[(k + 1) % corners.len()];
            let apart = (side(a, b, c) > 0) == (side(a, b, d) > 0) || (side(c, d, a) > 0) == (side(c, d, b) > 0);
            assert!(apart, "seed {seed}: {a:?} {b:?} crosses the side at {c:?}");
        }
    }
}

/// Fills the areas of a texture in sections of 4 mm.
fn fill(texture: &mut Texture, mut direction: impl FnMut() -> u16) -> Sections {
    let side = Nm(4_000_000);
    let grid = Sections::over(texture.bounds(), [side, side], Nm(100), [Nm(0); 2]);
    let hundredths = (0..grid.len()).map(|_| direction()).collect();
    texture.fill(Directions { grid, hundredths }).expect("lines");
    grid
}

#[test]
fn lines_along_contours_stay_in_area_and_section() {
    for seed in 0..40 {
        let mut noise = Random::case(seed);
        let (corners, path) = star(&mut noise);
        let marking = Marking { along_contours: Some(0.0), ..hatch(seed) };
        let sets = if marking.cross { 2.0 } else { 1.0 };
        let Ok((mut texture, _)) = load(&path, marking) else { continue };
        assert_eq!(texture.len(), 0, "areas hold no line until directions are known");
        let mut directions = Vec::new();
        let grid = fill(&mut texture, || {
            directions.push((noise.bits() % 18_000) as u16);
            directions[directions.len() - 1]
        });
        lies_in(&texture, &corners, seed);
        for (_, line) in strokes(&texture) {
            let sections = (0..grid.len()).filter(|&i| line.iter().all(|&p| grid.area(i).holds(p)));
            let is_along = |i: usize| {
                let [c, s] = Directions::cos_sin(directions[i]);
                let [dx, dy] = [(line[1].x - line[0].x) as f64, (line[1].y - line[0].y) as f64];
                (c * dy - s * dx).abs() < 2.0 || sets > 1.0 && (c * dx + s * dy).abs() < 2.0
            };
            assert!(sections.clone().any(is_along), "seed {seed}: {line:?}");
        }
        let area: f64 = corners
            .iter()
            .zip(corners.iter().cycle().skip(1))
            .map(|(a, b)| [*a, *b].map(P2::mm))
            .map(|[a, b]| (a[0] * b[1] - b[0] * a[1]) / 2.0)
            .sum();
        let border: f64 = corners.windows(2).map(length).sum();
        // At borders of areas and sections less than a pitch stays free.
        let slack = sets * (border * 0.15 + 0.1 * 2.0 * 40.0) / 0.1;
        let want = sets * area / 0.1;
        assert!(
            (total(&texture) - want).abs() < slack.min(0.5 * want + 40.0),
            "seed {seed}: {} {want}",
            total(&texture)
        );
    }
}

#[test]
fn one_direction_along_contours_is_a_plain_hatch() {
    let marking = || Marking { pitch_mm: Some(0.5), inset_mm: Some(0.25), ..Marking::default() };
    // Sections begin with the area, so lines lie half a pitch inside its box, as on the page.
    let square = r#"<rect x="5" y="5" width="8" height="8"/>"#;
    for (what, marking, want) in [
        ("lines", marking(), 16.0 * 7.5),
        ("one way", Marking { one_way: true, ..marking() }, 16.0 * 7.5),
        ("cross", Marking { cross: true, ..marking() }, 32.0 * 7.5),
        ("contour", Marking { contour: ContourPass::After, ..marking() }, 20.0 * 7.5),
        ("contour first", Marking { contour: ContourPass::Before, ..marking() }, 20.0 * 7.5),
    ] {
        let contour = marking.contour;
        let marking = Marking { along_contours: Some(0.0), ..marking };
        let one_way = marking.one_way;
        let (mut texture, notes) = load(square, marking).expect("a texture");
        assert!(notes.is_empty(), "{notes:?}");
        fill(&mut texture, || 0);
        assert!((total(&texture) - want).abs() < 1e-3, "{what}: {} mm instead of {want}", total(&texture));
        let strokes = strokes(&texture);
        let ring = strokes.iter().position(|(_, line)| line.len() == 5);
        let want = match contour {
            ContourPass::None => None,
            ContourPass::Before => Some(0),
            ContourPass::After => Some(strokes.len() - 1),
        };
        assert_eq!(ring, want, "{what}");
        if one_way {
            assert!(strokes.iter().all(|(_, l)| l[1].x > l[0].x), "all lines run along +x");
        }
    }
    // An area narrower than the pitch has one line all the same; what has no room for one is said.
    let thin = r#"<rect x="5" y="5.1" width="8" height="0.1"/><rect x="5" y="9" width="8" height="0.03"/>"#;
    let marking = Marking { pitch_mm: Some(0.5), along_contours: Some(0.3), ..Marking::default() };
    let (mut texture, notes) = load(thin, marking).expect("a texture");
    assert_eq!(notes.iter().map(|d| d.code).collect::<Vec<_>>(), ["texture-thin"]);
    fill(&mut texture, || 0);
    assert!(!texture.is_empty() && total(&texture) <= 8.0);
}

#[test]
fn fills_have_the_lengths_of_their_modes() {
    let square = r#"<rect x="5" y="5" width="8" height="8"/>"#;
    let marking = || Marking { pitch_mm: Some(0.5), inset_mm: Some(0.25), ..Marking::default() };
    // 16 lines of 7.5 mm; the contour at the inset; rings of 7.5, 6.5 ... 0.5 mm.
    let (lines, contour, rings) = (16.0 * 7.5, 4.0 * 7.5, 4.0 * 8.0 * 4.0);
    for (what, marking, want) in [
        ("lines", marking(), lines),
        ("one way", Marking { one_way: true, ..marking() }, lines),
        ("across", Marking { direction_rad: FRAC_PI_2, ..marking() }, lines),
        ("cross", Marking { cross: true, ..marking() }, 2.0 * lines),
        ("with contour", Marking { contour: ContourPass::After, ..marking() }, lines + contour),
        ("rings", Marking { fill: FillMode::Rings, ..marking() }, rings),
        ("outline", Marking { fill: FillMode::Outline, ..marking() }, 32.0),
    ] {
        let (texture, notes) = load(square, marking.clone()).expect("a texture");
        assert!((total(&texture) - want).abs() < 1e-4, "{what}: {} mm instead of {want}", total(&texture));
        assert!(notes.is_empty(), "{notes:?}");
        if marking.contour == ContourPass::After {
            assert_eq!(strokes(&texture).last().expect("strokes").1.len(), 5, "the contour comes last");
        }
        if marking.one_way {
            assert!(strokes(&texture).iter().all(|(_, l)| l[1].x > l[0].x), "all lines run along +x");
        }
    }
    let wide = r#"<path d="M5 5h8" stroke="black" stroke-width="2" fill="none"/>"#;
    for (stroke, want) in [(StrokeMode::Centre, 8.0), (StrokeMode::Outline, 20.0), (StrokeMode::Hatch, 4.0 * 7.5)] {
        let (texture, _) = load(wide, Marking { stroke, ..marking() }).expect("a texture");
        assert!((total(&texture) - want).abs() < 1e-4, "{stroke:?}: {} mm instead of {want}", total(&texture));
    }
}

#[test]
fn what_is_not_marked_is_said() {
    let thin = r#"<rect x="5" y="5" width="8" height="0.03"/><rect x="5" y="9" width="8" height="1"/>"#;
    let (_, notes) = load(thin, Marking::default()).expect("a texture");
    assert_eq!(notes.iter().map(|d| d.code).collect::<Vec<_>>(), ["texture-thin"]);
    for (body, code) in [
        (r#"<rect width="5" height="5" filter="url(#f)"/>"#, "svg-effect"),
        (r#"<rect width="5" height="5" style="mix-blend-mode:multiply"/>"#, "svg-effect"),
        (r#"<rect width="5" height="5" clip-path="url(#none)"/>"#, "svg-effect"),
        (
            r#"<linearGradient id="l"><stop/><stop stop-color="red"/></linearGradient>
               <rect width="5" height="5" fill="url(#l)"/>"#,
            "svg-paint",
        ),
        (
            r#"<marker id="m"><path d="M0 0h1"/></marker><path d="M1 1h5" stroke="red" marker-end="url(#m)"/>"#,
            "svg-marker",
        ),
        (r#"<text x="3" y="3">a</text>"#, "svg-text"),
        (r#"<image href="data:," width="3" height="3"/>"#, "svg-image"),
        (
            r#"<mask id="m"><rect width="9" height="9" fill="grey"/></mask><rect width="5" height="5" mask="url(#m)"/>"#,
            "svg-effect",
        ),
        (
            r#"<clipPath id="c" clipPathUnits="objectBoundingBox"><circle cx=".5" cy=".5" r=".4"/></clipPath>
               <g clip-path="url(#c)"><ellipse cx="5" cy="5" rx="3" ry="1" transform="rotate(45 5 5)"/></g>"#,
            "svg-box",
        ),
        (
            r##"<mask id="m"><rect width="9" height="9" fill="white"/></mask>
               <defs><rect id="r" width="3" height="3" transform="rotate(9)"/></defs>
               <use href="#r" mask="url(#m)" stroke="red"/>"##,
            "svg-box",
        ),
        (
            r#"<mask id="m" x="0"><rect width="9" height="9" fill="white"/></mask><g mask="url(#m)">
               <g transform="rotate(20)"><rect width="3" height="3" transform="rotate(-20)"/></g></g>"#,
            "svg-box",
        ),
    ] {
        let body = format!(r#"{body}<rect x="10" y="10" width="3" height="3"/>"#);
        let error = load(&body, Marking::default()).expect_err("refused");
        assert_eq!(error.diags()[0].code, code, "{body}");
        // Left out, nothing of it is marked.
        let (texture, notes) = load(&body, Marking { is_lenient: true, ..Marking::default() }).expect("a texture");
        assert_eq!(notes[0].code, code);
        assert!(texture.bounds().lo.x > 9_000_000, "{body}");
    }
}

#[test]
fn an_inset_that_leaves_nothing_is_told_from_too_many_lines() {
    let body = format!(r#"{RING}<rect x="15" y="15" width="4" height="4"/>"#);
    for (inset_mm, kept) in [(1.6, true), (2.1, false), (5.1, false), (1e6, false), (1e300, false)] {
        for contour in [ContourPass::None, ContourPass::After] {
            let loaded = load(&body, Marking { inset_mm: Some(inset_mm), contour, ..Marking::default() });
            match loaded {
                Ok((texture, _)) => assert!(kept && !texture.is_empty(), "{inset_mm}"),
                Err(e) => assert!(!kept && e.diags()[0].code == "texture-empty", "{inset_mm}: {e}"),
            }
        }
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn areas_that_all_overlap_are_refused_in_time() {
    let body = r#"<path d="M1 1h9v9z"/>"#.repeat(20_000);
    let error = processor::within(5, "the drawing", || load(&body, Marking::default())).expect_err("refused");
    assert_eq!(error.diags()[0].code, "texture-crossings");
}

#[test]
fn pens_follow_colours_and_labels() {
    let body = r#"
        <g inkscape:groupmode="layer" inkscape:label="Grain"><rect id="a" x="1" y="1" width="3" height="3" fill="red"/></g>
        <g inkscape:groupmode="layer" inkscape:label="Logo">
          <rect id="b" x="3" y="1" width="3" height="3" fill="blue"/>
          <path class="fine thin" d="M1 10h9" stroke="red" stroke-width="0.01"/>
        </g>
        <rect x="8" y="1" width="3" height="3"/>"#;
    let select = |names: &[&str]| names.iter().map(|n| Selector::parse(n).expect("a selector")).collect::<Vec<_>>();
    let pens = |pairs: &[(&str, u16)]| {
        pairs.iter().map(|(name, pen)| (select(&[name])[0].clone(), PenId(*pen))).collect::<Vec<_>>()
    };
    let marking = || Marking { pitch_mm: Some(0.1), ..Marking::default() };
    // Length by pen, mm.
    let lengths = |marking: Marking| {
        let (texture, _) = load(body, marking).expect("a texture");
        let mut out = [0.0; 4];
        strokes(&texture).iter().for_each(|(pen, points)| out[pen.0 as usize] += length(points));
        out.map(|v: f64| v.round())
    };
    // A square of 3 mm holds 30 lines of 2.96 mm; of the red one 2 mm are seen where pens differ.
    assert_eq!(lengths(marking()), [247.0, 0.0, 0.0, 0.0], "both squares are one area of 5 mm x 3 mm");
    let by_colour = Marking { pens: pens(&[("red", 1), ("#0000ff", 2)]), ..marking() };
    assert_eq!(lengths(by_colour), [89.0, 59.0 + 9.0, 89.0, 0.0]);
    let by_label = Marking { pens: pens(&[("layer:Grain", 1), ("class:fine", 3), ("id:b", 2)]), ..marking() };
    assert_eq!(lengths(by_label), [89.0, 59.0, 89.0, 9.0]);
    let only = Marking { only: select(&["layer:Logo"]), except: select(&["class:thin"]), ..marking() };
    assert_eq!(lengths(only), [89.0, 0.0, 0.0, 0.0]);
    for (marking, says) in [
        (Marking { only: select(&["layer:Grian"]), ..marking() }, "layer:Grain"),
        (Marking { pens: pens(&[("#00ff00", 1)]), ..marking() }, "#0000ff"),
        (Marking { pens: pens(&[("layer:Grain", 1), ("id:a", 2)]), ..marking() }, "tells them apart"),
    ] {
        let error = load(body, marking).expect_err("refused");
        assert_eq!(error.diags()[0].code, "texture-pens");
        assert!(error.to_string().contains(says), "{error}");
    }
}

/// Paper as CorelDRAW writes it: a page and a knock-out in `#FEFEFE`, by classes.
const COREL: &str = r#"<style>.fil0{fill:#2B2A29}.fil1{fill:#FEFEFE}</style><rect class="fil1" width="20" height="20"/>
    <polygon class="fil0" points="2,2 12,2 12,12 2,12"/><polygon class="fil1" points="4,4 8,4 8,8 4,8"/>"#;

#[test]
fn near_white_page_and_knock_out_are_not_marked() {
    let select = |names: &[&str]| names.iter().map(|n| Selector::parse(n).expect("a selector")).collect::<Vec<_>>();
    let marking = || Marking { pitch_mm: Some(0.1), inset_mm: Some(0.0), ..Marking::default() };
    // Area by pen, mm2, and the codes of the warnings.
    let marked = |marking: Marking| {
        let (texture, notes) = load(COREL, marking).expect("a texture");
        let mut out = [0.0; 2];
        strokes(&texture).iter().for_each(|(pen, points)| out[pen.0 as usize] += 0.1 * length(points));
        (out.map(|v: f64| v.round()), notes.iter().map(|d| d.code).collect::<Vec<_>>())
    };
    assert_eq!(marked(marking()), ([84.0, 0.0], vec![]));
    assert_eq!(marked(Marking { only: select(&["#2b2a29"]), ..marking() }), ([84.0, 0.0], vec![]));
    assert_eq!(marked(Marking { except: select(&["#fefefe"]), ..marking() }), ([84.0, 0.0], vec![]));
    assert_eq!(marked(Marking { paper: Paper::Colour([254; 3]), ..marking() }), ([84.0, 0.0], vec![]));
    // What is named is marked; white alone as the page leaves the near-white to be marked, with a warning.
    assert_eq!(marked(Marking { only: select(&["#fefefe"]), ..marking() }), ([400.0, 0.0], vec![]));
    let pens = vec![(select(&["#fefefe"])[0].clone(), PenId(1))];
    assert_eq!(marked(Marking { pens, ..marking() }), ([84.0, 316.0], vec![]));
    assert_eq!(marked(Marking { paper: Paper::Colour([255; 3]), ..marking() }), ([400.0, 0.0], vec!["texture-light"]));
    // A class is a label: what it leaves out does not exist.
    assert_eq!(marked(Marking { only: select(&["class:fil0"]), ..marking() }), ([100.0, 0.0], vec![]));
}
