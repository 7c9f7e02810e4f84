//! Textures as a job sees them: patterns, drawings, tiles, real files.

use std::f64::consts::{FRAC_PI_2, PI};
use std::path::{Path, PathBuf};
use terrace_core::math;

use crate::patterns;
use crate::support::surfaces::Random;
use crate::support::{fixture, folder, outlined, outlines, shared};
use terrace_core::diag::{Diag, Error};
use terrace_core::geom::{Box2, BoxMm, P2, length_mm};
use terrace_core::program::PenId;
use terrace_input::texture::kind::{Lattice, Shape};
use terrace_input::texture::{Area, Kind, Masks, Position, Request, Size, Texture};

pub(crate) const PLATE: BoxMm<2> = BoxMm::rectangle(0.0, 0.0, 450.0, 450.0);

pub(crate) fn request(kind: Kind, area: Area) -> Request {
    Request { kind, area, tolerance_mm: 1e-3, pen: PenId(3), masks: Masks::default() }
}

pub(crate) fn load(request: Request, part_box: BoxMm<2>, turn_rad: f64) -> Result<(Texture, Vec<Diag>), Error> {
    let mut notes = Vec::new();
    Texture::load(&[request], part_box, turn_rad, 0.05, &mut notes).map(|t| (t, notes))
}

pub(crate) fn made(kind: Kind, area: BoxMm<2>) -> Texture {
    load(request(kind, Area::Rectangle(area)), PLATE, 0.0).expect("a texture").0
}

pub(crate) fn code(result: Result<(Texture, Vec<Diag>), Error>) -> &'static str {
    result.expect_err("refused").diags()[0].code
}

/// All strokes, with the promises of the stream checked.
pub(crate) fn strokes(t: &Texture) -> Vec<Vec<P2>> {
    let (mut out, mut bounds) = (Vec::new(), Box2::EMPTY);
    let all: Vec<_> = (0..t.len())
        .map(|i| {
            assert_eq!(t.stroke(i, &mut out), PenId(3));
            // A dot is one point, with a pen that is known as one of dots.
            let is_dot = out.len() == 1 && !t.dot_pens().is_empty();
            assert!((is_dot || out.len() > 1) && out.windows(2).all(|w| w[0] != w[1]), "stroke {i}: {out:?}");
            out.iter().for_each(|&p| bounds.add(p));
            assert!(t.element(i).starts_with("texture 1, "));
            out.clone()
        })
        .collect();
    assert_eq!(t.bounds(), bounds);
    all
}

pub(crate) fn total_mm(t: &Texture) -> f64 {
    strokes(t).iter().map(|s| length_mm(s)).sum()
}

/// Cells on a square lattice.
pub(crate) fn cells(shape: Shape, cell_mm: f64, pitch_mm: f64) -> Kind {
    Kind::Cells { shape, cell_mm, pitch_mm, lattice: Lattice::Square }
}

fn nm(mm: f64) -> i64 {
    (mm * 1e6).round() as i64
}

#[test]
fn hatch_marks_lines_on_both_borders() {
    let t = made(Kind::Hatch { pitch_mm: 0.1, direction_rad: 0.0 }, PLATE);
    assert_eq!(t.len(), 4501);
    for (k, s) in strokes(&t).iter().enumerate() {
        let y = 100_000 * k as i64;
        assert_eq!(s, &[P2::new(0, y), P2::new(450_000_000, y)]);
    }
    let t = made(
        Kind::Hatch { pitch_mm: 0.1, direction_rad: 90f64.to_radians() },
        BoxMm::rectangle(-225.0, -225.0, 225.0, 225.0),
    );
    assert_eq!(t.len(), 4501);
    assert!(strokes(&t).iter().all(|s| s[0].x == s[1].x && s[0].y == -225_000_000 && s[1].y == 225_000_000));
    let t = made(Kind::Hatch { pitch_mm: 0.7, direction_rad: 0.0 }, BoxMm::rectangle(0.0, 0.0, 1.0, 1.0));
    assert_eq!(strokes(&t).iter().map(|s| s[0].y).collect::<Vec<_>>(), [0, 700_000], "the upper border is not hit");
}

#[test]
fn hatch_covers_its_area_at_any_angle() {
    let mut hatched = 0;
    for seed in 0..200 {
        // Shown where the strokes break a promise.
        eprintln!("seed {seed}");
        let mut noise = Random::case(seed);
        let (degrees, pitch) = (noise.range(-360.0, 360.0), noise.range(0.05, 5.0));
        let [w, h] = [0; 2].map(|_| noise.range(1.0, 60.0));
        let turn = noise.range(-PI, PI);
        let area = BoxMm::rectangle(-7.3, 2.9, -7.3 + w, 2.9 + h);
        let hatch = Kind::Hatch { pitch_mm: pitch, direction_rad: degrees.to_radians() };
        let Ok((t, _)) = load(request(hatch, Area::Rectangle(area)), PLATE, turn) else {
            // The line through the corner only touches it, and the next lies beyond the area.
            assert!(w.min(h) < 2.0 * pitch, "seed {seed}: no line");
            continue;
        };
        hatched += 1;
        // Lines of distance p have the area w h / p, but for half a line at each side.
        let (total, want) = (total_mm(&t), w * h / pitch);
        assert!((total - want).abs() <= 1.5 * math::hypot(w, h), "seed {seed}: {total} of {want}");
        // Neighbours have the distance p (measured along the normal, in the turned frame).
        let normal = [-math::sin(degrees.to_radians() + turn), math::cos(degrees.to_radians() + turn)];
        let away = |p: P2| normal[0] * p.mm()[0] + normal[1] * p.mm()[1];
        for pair in strokes(&t).windows(2) {
            assert!((away(pair[1][0]) - away(pair[0][0]) - pitch).abs() < 5e-6, "seed {seed}: {pair:?}");
            assert!((away(pair[0][1]) - away(pair[0][0])).abs() < 5e-6, "seed {seed}: {pair:?}");
        }
    }
    assert!(hatched > 180, "{hatched} areas with lines");
}

#[test]
fn four_quarter_turns_give_the_original() {
    for seed in 0..200 {
        // Shown where the strokes break a promise.
        eprintln!("seed {seed}");
        let mut noise = Random::case(seed);
        let kind = match noise.below(5) {
            0 => Kind::Hatch { pitch_mm: noise.range(0.3, 2.0), direction_rad: noise.range(0.0, PI) },
            1 => Kind::Hilbert { order: noise.between(1, 5) as u32 },
            4 => patterns::any(&mut noise),
            2 => cells(Shape::Circle, noise.range(0.1, 0.5), 0.7),
            _ => cells(Shape::Square, noise.range(0.1, 0.5), 0.7),
        };
        let x = noise.range(-50.0, 50.0);
        let turned = |quarters: i32| {
            let r = request(kind.clone(), Area::Rectangle(BoxMm::rectangle(x, -3.1, x + 11.3, 8.3)));
            strokes(&load(r, PLATE, f64::from(quarters) * FRAC_PI_2).expect("a texture").0)
        };
        let original = turned(0);
        assert_eq!(&turned(4), &original, "seed {seed}");
        assert_eq!(&turned(-4), &original, "seed {seed}");
        let quarter = |p: &P2| P2::new(-p.y, p.x);
        let by_hand: Vec<Vec<P2>> = original.iter().map(|s| s.iter().map(quarter).collect()).collect();
        assert_eq!(&turned(1), &by_hand, "seed {seed}");
    }
}

#[test]
fn hilbert_visits_every_point_once_by_unit_steps() {
    for order in 1..=7 {
        let n = 1i64 << order;
        let area = BoxMm::rectangle(10.0, -5.0, 10.0 + 0.003 * (n - 1) as f64, -5.0 + 0.002 * (n - 1) as f64);
        let t = made(Kind::Hilbert { order }, area);
        assert_eq!((t.len(), t.points_estimate()), (1, 1 << (2 * order)));
        let points = strokes(&t).remove(0);
        let cells: Vec<_> = points
            .iter()
            .map(|p| ((p.x - 10_000_000) / 3000, (p.y + 5_000_000) / 2000, p.x % 1000, p.y % 1000))
            .collect();
        assert!(cells.windows(2).all(|w| (w[1].0 - w[0].0).abs() + (w[1].1 - w[0].1).abs() == 1));
        assert!(cells.iter().all(|c| (0..n).contains(&c.0) && (0..n).contains(&c.1) && c.2 == 0 && c.3 == 0));
        let distinct: std::collections::BTreeSet<_> = cells.iter().collect();
        assert_eq!(distinct.len() as i64, n * n);
        assert_eq!(t.bounds().hi, P2::new(nm(area.hi[0]), nm(area.hi[1])));
    }
    // The figure of physics.md: 40 / 255 mm.
    let t = made(Kind::Hilbert { order: 8 }, BoxMm::rectangle(0.0, 0.0, 40.0, 40.0));
    assert!((total_mm(&t) - 65_535.0 * 40.0 / 255.0).abs() < 65_535.0 * 1e-6);
    let small = request(Kind::Hilbert { order: 13 }, Area::Rectangle(BoxMm::rectangle(0.0, 0.0, 0.01, 0.01)));
    assert_eq!(code(load(small, PLATE, 0.0)), "texture-area");
}

#[test]
fn loops_are_whole_closed_and_in_their_place() {
    let t = made(cells(Shape::Square, 0.6, 1.0), PLATE);
    assert_eq!((t.len(), t.points_estimate()), (202_500, 5 * 202_500));
    let all = strokes(&t);
    assert_eq!(
        all[0],
        [[0.2, 0.2], [0.8, 0.2], [0.8, 0.8], [0.2, 0.8], [0.2, 0.2]].map(|[x, y]| P2::new(nm(x), nm(y)))
    );
    assert_eq!(all[450][0], P2::new(nm(449.2), nm(1.2)), "the second row runs back");
    assert!(all.iter().all(|s| (length_mm(s) - 2.4).abs() < 1e-5));
    assert_eq!(
        made(cells(Shape::Square, 1.0, 1.0), BoxMm::rectangle(0.0, 0.0, 2.99, 1.5)).len(),
        2,
        "whole cells only"
    );

    let t = made(cells(Shape::Circle, 8.0, 10.0), BoxMm::rectangle(0.0, 0.0, 20.0, 10.0));
    for (s, x) in strokes(&t).iter().zip([5.0, 15.0]) {
        assert_eq!(s.first(), s.last());
        let away = |[a, b]: [f64; 2]| math::hypot(a - x, b - 5.0);
        for w in s.windows(2) {
            let middle = [0, 1].map(|k| (w[0].mm()[k] + w[1].mm()[k]) / 2.0);
            assert!((away(w[0].mm()) - 4.0).abs() < 1e-6 && 4.0 - away(middle) <= 1e-3 + 1e-6);
        }
    }
    let one = |kind| load(request(kind, Area::Rectangle(BoxMm::rectangle(0.0, 0.0, 5.0, 5.0))), PLATE, 0.0);
    assert_eq!(code(one(cells(Shape::Square, 6.0, 6.0))), "texture-empty");
    assert_eq!(code(one(cells(Shape::Square, 2.0, 1.0))), "texture-cell");
    assert_eq!(code(one(cells(Shape::Circle, 1e-9, 1.0))), "texture-cell");
    assert_eq!(code(one(Kind::Hatch { pitch_mm: 0.0, direction_rad: 0.0 })), "texture-pitch");
    // The line through the lower left corner runs away from the area, the next misses it.
    assert_eq!(code(one(Kind::Hatch { pitch_mm: 20.0, direction_rad: -0.5 })), "texture-empty");
    assert_eq!(code(one(cells(Shape::Square, 1e-5, 1e-5))), "texture-large");
    let far = request(Kind::Hilbert { order: 3 }, Area::Rectangle(BoxMm::rectangle(0.0, 0.0, 5000.0, 5.0)));
    assert_eq!(code(load(far, PLATE, 0.0)), "texture-far");
}

/// A drawing of 30 mm x 20 mm in a temporary file.
struct Sheet(tempfile::NamedTempFile);

impl Sheet {
    fn new(body: &str) -> Self {
        let text = format!(
            r#"<svg xmlns="http://www.w3.org/2000/svg" width="30mm" height="2cm" viewBox="0 0 60 40"><g fill="none" stroke="black">{body}</g></svg>"#
        );
        let file = tempfile::Builder::new().suffix(".svg").tempfile().expect("a file");
        std::fs::write(file.path(), text).expect("written");
        Self(file)
    }
    fn kind(&self, origin_mm: Option<[f64; 2]>, turn_rad: f64, tile: bool) -> Kind {
        Kind::Drawing {
            path: self.0.path().to_owned(),
            size: Size::File,
            unit_mm: None,
            position: origin_mm.map_or(Position::Usual, Position::Origin),
            turn_rad,
            tile,
            marking: outlines(),
        }
    }
}

fn mm(points: &[P2]) -> Vec<[f64; 2]> {
    points.iter().map(|p| p.mm()).collect()
}

#[test]
fn drawings_lie_where_they_are_placed() {
    let sheet = Sheet::new(r#"<path d="M0 40L20 40L20 30Z"/><circle id="hole" cx="40" cy="20" r="8"/>"#);
    let (t, notes) =
        load(request(sheet.kind(Some([100.0, 7.0]), 0.0, false), Area::Unlimited), PLATE, 0.0).expect("drawn");
    let all = strokes(&t);
    assert!(notes.is_empty(), "{notes:?}");
    assert_eq!(
        mm(&all[0]),
        [[100.0, 7.0], [110.0, 7.0], [110.0, 12.0], [100.0, 7.0]],
        "y is flipped, 60 units are 30 mm"
    );
    assert_eq!((t.element(0), t.element(1)), ("texture 1, path 1".into(), "texture 1, hole".into()));
    for p in mm(&all[1]) {
        assert!((math::hypot(p[0] - 120.0, p[1] - 17.0) - 4.0).abs() < 1e-6, "every vertex lies on the circle");
    }
    // Turned about the page's corner, then with the part about its origin.
    let quarter = request(sheet.kind(Some([100.0, 7.0]), FRAC_PI_2, false), Area::Unlimited);
    let (t, _) = load(quarter, PLATE, FRAC_PI_2).expect("drawn");
    assert_eq!(mm(&strokes(&t)[0]), [[-7.0, 100.0], [-17.0, 100.0], [-17.0, 95.0], [-7.0, 100.0]]);
    // Without an origin: in the corner of the area, or centred on the part.
    let (t, _) = load(request(sheet.kind(None, 0.0, false), Area::Part), BoxMm::rectangle(5.0, 6.0, 450.0, 450.0), 0.0)
        .expect("drawn");
    assert_eq!(t.bounds().lo.mm(), [5.0, 6.0]);
    let (t, _) = load(request(sheet.kind(None, PI, false), Area::Unlimited), PLATE, 0.0).expect("drawn");
    assert_eq!(mm(&strokes(&t)[0])[0], [240.0, 235.0]);
    // Cut at the area; out of it there is nothing.
    let cut = request(sheet.kind(Some([0.0, 0.0]), 0.0, false), Area::Rectangle(BoxMm::rectangle(0.0, 0.0, 20.0, 4.0)));
    let (t, _) = load(cut, PLATE, 0.0).expect("drawn");
    assert_eq!(mm(&strokes(&t)[0]), [[8.0, 4.0], [0.0, 0.0], [10.0, 0.0], [10.0, 4.0]], "one piece over the start");
    let gone =
        request(sheet.kind(Some([500.0, 0.0]), 0.0, false), Area::Rectangle(BoxMm::rectangle(0.0, 0.0, 20.0, 4.0)));
    assert_eq!(code(load(gone, PLATE, 0.0)), "texture-empty");
    let far = request(sheet.kind(Some([3990.0, 0.0]), 0.0, false), Area::Unlimited);
    assert_eq!(code(load(far, PLATE, 0.0)), "texture-far");
}

#[test]
fn dashes_in_units_of_a_path_length_next_to_nothing_are_a_solid_line() {
    let strokes_of = |attribute: &str| {
        let body = format!("<path d='M1 1h9' stroke='red' stroke-width='2' stroke-dasharray='1 2' {attribute}/>");
        let (t, _) =
            load(request(Sheet::new(&body).kind(None, 0.0, false), Area::Unlimited), PLATE, 0.0).expect("drawn");
        strokes(&t).iter().map(|points| mm(points)).collect::<Vec<_>>()
    };
    let solid = strokes_of("pathLength='0'");
    for length in ["1e-300", "5e-324"] {
        assert_eq!(strokes_of(&format!("pathLength='{length}'")), solid, "{length}");
    }
    assert_ne!(strokes_of("pathLength='9'"), solid);
}

#[test]
fn elements_that_are_not_marked_are_counted() {
    let sheet = Sheet::new(
        r##"<style>@import url(x.css); .no{display:none}</style><defs><path id="d" d="M1 1h5"/><linearGradient id="l"><stop/><stop stop-color="red"/></linearGradient></defs>
        <g class="no"><path d="M1 1h9"/></g><path d="M1 1h9" visibility="hidden"/><path d="M1 1h9" fill="none"/>
        <text>a</text><image href="data:,"/><use href="#d" x="3"/><use href="o.svg#a"/><use href="#gone"/>
        <rect width="4" height="4" fill="url(#l)"/><path d="M1 1h9v1m3 3h0" clip-path="url(#c)" marker-end="url(#m)"/>
        <path d="M1 1h9" stroke="red" fill="none" stroke-dasharray="1 2"/><path d="M50 20h20"/><path d="M1 1h9x"/>
        <path d="M2 2h9" transform="turn(3)"/><rect width="9" height="0.0001"/><line x2="1ex" y2="3"/>"##,
    );
    let (t, notes) = load(request(sheet.kind(None, 0.0, false), Area::Unlimited), PLATE, 0.0).expect("drawn");
    let said: Vec<_> =
        notes.iter().map(|n| (n.code, n.message.rsplit(['(', ')']).nth(1).unwrap_or_default())).collect();
    assert_eq!(
        said,
        [
            ("svg-hidden", "2"),
            ("svg-text", "1"),
            ("svg-image", "1"),
            ("svg-external", "1"),
            ("svg-use", "1"),
            ("svg-paint", "1"),
            ("svg-effect", "1"),
            ("svg-transform", "1"),
            ("svg-path", "1"),
            ("svg-unit", "1"),
            ("svg-overhang", "1"),
            ("svg-external", "x.css"),
        ]
    );
    assert!(notes.iter().all(|n| !n.hint.is_empty()));
    assert!(notes[..11].iter().all(|n| n.place.to_string().contains("element")));
    // Ten: nine shapes are marked, one of them in two dashes, and a rectangle without a height as one line.
    assert_eq!(t.len(), 10);
}

#[test]
fn tiles_repeat_the_page_and_are_cut_at_the_area() {
    // A cross and a closed square, so that whole tiles and cut ones can be told apart.
    let sheet = Sheet::new(r#"<path d="M0 20H60M30 0V40"/><rect x="10" y="10" width="10" height="10"/>"#);
    let tiled = |area, origin, turn| {
        load(request(sheet.kind(origin, turn, true), Area::Rectangle(area)), PLATE, 0.0).expect("tiled").0
    };
    let t = tiled(BoxMm::rectangle(10.0, 10.0, 100.0, 70.0), None, 0.0);
    assert_eq!((t.len(), t.points_estimate()), (9 * 3, 9 * 9), "three by three whole tiles");
    assert_eq!(mm(&strokes(&t)[3 * 4]), [[40.0, 40.0], [70.0, 40.0]], "row by row");
    assert_eq!(t.element(13), "texture 1, path 1, tile (1, 1)");
    // The lattice is anchored at the origin, also far away.
    let shifted = tiled(BoxMm::rectangle(10.0, 10.0, 100.0, 70.0), Some([10.0 - 300.0, 10.0 + 2000.0]), 0.0);
    assert_eq!(strokes(&shifted), strokes(&t));
    // Lines of the cross: one over the whole width every 20 mm, one over the whole height every 30 mm.
    let (w, h) = (95.0, 47.0);
    let t = tiled(BoxMm::rectangle(0.0, 0.0, w, h), None, 0.0);
    let (mut cross, mut squares) = (0.0, 0.0);
    for (i, s) in strokes(&t).iter().enumerate() {
        *(if t.element(i).contains("rect") { &mut squares } else { &mut cross }) += length_mm(s);
    }
    assert!((cross - (2.0 * w + 3.0 * h)).abs() < 1e-5, "{cross}: lines at y 10, 30 and x 15, 45, 75");
    // Squares at x 5..10 + 30 i, y 10..15 + 20 j: columns 0, 1, 2 whole, the fourth cut at 95 = its left side.
    assert!((squares - (2.0 * (3.0 * 20.0 + 5.0))).abs() < 1e-5, "{squares}");
    assert_eq!(code(load(request(sheet.kind(None, 0.0, true), Area::Unlimited), PLATE, 0.0)), "texture-tile");
    let tiny = Sheet::new(r#"<path d="M0 0L60 40"/>"#);
    let Kind::Drawing { path, .. } = tiny.kind(None, 0.0, true) else { unreachable!() };
    let kind = Kind::Drawing {
        path,
        size: Size::Mm([3e-5, 2e-5]),
        unit_mm: None,
        position: Position::Usual,
        turn_rad: 0.0,
        tile: true,
        marking: outlines(),
    };
    assert_eq!(code(load(request(kind, Area::Part), PLATE, 0.0)), "texture-large");
}

#[test]
fn turned_tiles_fill_the_area() {
    let sheet = Sheet::new(r#"<path d="M0 20H60"/>"#);
    let mut filled = 0;
    for seed in 0..60 {
        // Shown where the strokes break a promise.
        eprintln!("seed {seed}");
        let mut noise = Random::case(seed);
        let (degrees, turn) = (noise.range(0.0, 360.0), noise.range(-PI, PI));
        let [w, h] = [0; 2].map(|_| noise.range(5.0, 120.0));
        let area = BoxMm::rectangle(-20.0, 33.0, -20.0 + w, 33.0 + h);
        let kind = sheet.kind(Some([1.7, -4.1]), degrees.to_radians(), true);
        let Ok((t, _)) = load(request(kind, Area::Rectangle(area)), PLATE, turn) else {
            // No line meets the area: then it is narrower than their distance.
            assert!(w.min(h) < 20.0, "seed {seed}: no line");
            continue;
        };
        filled += 1;
        // The tiles together are one hatch of 20 mm pitch.
        let total = total_mm(&t);
        let hatch: f64 = {
            let (s, c) = math::sin_cos(degrees.to_radians());
            let chord = |k: f64| {
                let p = [1.7 - s * (10.0 + 20.0 * k), -4.1 + c * (10.0 + 20.0 * k)];
                let span = |d: f64, p: f64, lo: f64, hi: f64| {
                    let (a, b) = ((lo - p) / d, (hi - p) / d);
                    [a.min(b), a.max(b)]
                };
                let (x, y) = (span(c, p[0], area.lo[0], area.hi[0]), span(s, p[1], area.lo[1], area.hi[1]));
                (x[1].min(y[1]) - x[0].max(y[0])).max(0.0)
            };
            (-40..40).map(|k| chord(f64::from(k))).sum()
        };
        assert!((total - hatch).abs() < 1e-4, "seed {seed}: {total} of {hatch}");
    }
    assert!(filled > 45, "{filled} areas with lines");
}

#[test]
fn text_of_a_job_with_several_textures_keeps_order_and_pens() {
    let hatch = Request {
        kind: Kind::Hatch { pitch_mm: 1.0, direction_rad: 0.0 },
        area: Area::Part,
        tolerance_mm: 1e-3,
        pen: PenId(1),
        masks: Masks::default(),
    };
    let curve = Request {
        kind: Kind::Hilbert { order: 2 },
        area: Area::Rectangle(BoxMm::rectangle(20.0, 0.0, 30.0, 10.0)),
        tolerance_mm: 1e-3,
        pen: PenId(0),
        masks: Masks::default(),
    };
    let t = Texture::load(&[hatch, curve], BoxMm::rectangle(0.0, 0.0, 10.0, 10.0), 0.0, 0.05, &mut Vec::new())
        .expect("textures");
    let mut out = Vec::new();
    assert_eq!((t.len(), t.stroke(10, &mut out), t.stroke(11, &mut out)), (12, PenId(1), PenId(0)));
    assert_eq!(
        (t.element(10).as_str(), t.element(11).as_str()),
        ("texture 1, hatch line 11", "texture 2, hilbert curve")
    );
    assert_eq!((t.bounds().lo.mm(), t.bounds().hi.mm()), ([0.0, 0.0], [30.0, 10.0]));
}

/// The drawings of a folder.
fn drawings(dir: &Path) -> Vec<PathBuf> {
    let mut files: Vec<_> = std::fs::read_dir(dir)
        .expect("a readable folder")
        .map(|entry| entry.expect("a readable folder").path())
        .filter(|p| p.extension().is_some_and(|e| e == "svg"))
        .collect();
    files.sort();
    files
}

fn real_request(path: &Path, size_mm: Option<[f64; 2]>) -> Request {
    request(outlined(path, size_mm), Area::Unlimited)
}

/// Length of what usvg, an independent reader, draws: f32, curves sampled finely, scaled to the page.
fn length_by_usvg(path: &Path, size: [f64; 2]) -> Option<f64> {
    let tree = usvg::Tree::from_data(&std::fs::read(path).ok()?, &usvg::Options::default()).ok()?;
    let scale = [size[0] / f64::from(tree.size().width()), size[1] / f64::from(tree.size().height())];
    let mut total = 0.0;
    walk(tree.root(), &mut |p: &usvg::Path| {
        let dashed = p.stroke().and_then(|s| {
            let array = s.dasharray()?.to_vec();
            p.data().clone().dash(&usvg::tiny_skia_path::StrokeDash::new(array, s.dashoffset())?, 1.0)
        });
        let Some(data) = dashed.unwrap_or_else(|| p.data().clone()).transform(p.abs_transform()) else { return };
        let at = |p: usvg::tiny_skia_path::Point| [f64::from(p.x) * scale[0], f64::from(p.y) * scale[1]];
        let (mut last, mut start) = ([0.0; 2], [0.0; 2]);
        let mut to = |last: &mut [f64; 2], p: [f64; 2]| {
            total += math::hypot(p[0] - last[0], p[1] - last[1]);
            *last = p;
        };
        use usvg::tiny_skia_path::PathSegment as S;
        for s in data.segments() {
            match s {
                S::MoveTo(p) => (last, start) = (at(p), at(p)),
                S::LineTo(p) => to(&mut last, at(p)),
                S::Close => to(&mut last, start),
                S::QuadTo(c, p) => {
                    let (a, c, p) = (last, at(c), at(p));
                    for i in 1..=64 {
                        let (t, s) = (f64::from(i) / 64.0, 1.0 - f64::from(i) / 64.0);
                        to(&mut last, [0, 1].map(|k| s * s * a[k] + 2.0 * s * t * c[k] + t * t * p[k]));
                    }
                }
                S::CubicTo(c, d, p) => {
                    let (a, c, d, p) = (last, at(c), at(d), at(p));
                    for i in 1..=64 {
                        let (t, s) = (f64::from(i) / 64.0, 1.0 - f64::from(i) / 64.0);
                        let on = |k: usize| {
                            s * s * s * a[k] + 3.0 * s * s * t * c[k] + 3.0 * s * t * t * d[k] + t * t * t * p[k]
                        };
                        to(&mut last, [0, 1].map(on));
                    }
                }
            }
        }
    });
    Some(total)
}

fn walk(group: &usvg::Group, visit: &mut dyn FnMut(&usvg::Path)) {
    for node in group.children() {
        match node {
            usvg::Node::Group(g) => walk(g, visit),
            usvg::Node::Path(p) if p.is_visible() => visit(p),
            _ => {}
        }
    }
}

/// Drawings in which nothing hides or cuts anything; of others less is marked than usvg tells.
const WHOLE: [&str; 4] =
    ["aerofoil.svg", "vpype_7k_lines.svg", "vpype_900_quad_beziers.svg", "vpype_bar_nodef_path_polylines.svg"];

/// Loads drawings and compares their lengths with usvg; answers with the number compared.
fn compared_with_usvg(paths: &[PathBuf]) -> usize {
    const SIZE: [f64; 2] = [100.0, 100.0];
    // One stroke per line element; the map's countries have islands; 38 of the 990 contours are points, and one runs
    // there and back.
    const COUNTS: [(&str, usize); 4] = [
        ("vpype_7k_lines.svg", 7000),
        ("svgmaps_world.svg", 2668),
        ("contours_jacksboro_40m.svg", 952),
        ("vpype_bar_nodef_path_polylines.svg", 175),
    ];
    let mut compared = 0;
    for path in paths {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let loaded = load(real_request(path, Some(SIZE)), PLATE, 0.0);
        let (t, notes) = loaded.unwrap_or_else(|e| panic!("{name}: {e}"));
        let length = total_mm(&t);
        assert!(length > 1.0 && length.is_finite(), "{name}: {length}");
        let codes: Vec<_> = notes.iter().map(|n| n.code).filter(|&c| c != "svg-stretched").collect();
        let by_usvg = length_by_usvg(path, SIZE).unwrap_or_else(|| panic!("{name}: usvg"));
        eprintln!(
            "{name}: {} strokes, {} points, {length:.3} mm (usvg {by_usvg:.3}) {codes:?}",
            t.len(),
            t.points_estimate()
        );
        if let Some((_, n)) = COUNTS.iter().find(|(n, _)| *n == name) {
            assert_eq!(t.len(), *n, "{name}: strokes");
        }
        // usvg states what elements are before they are cut; what others hide is not marked.
        let text = std::fs::read_to_string(path).expect("readable");
        let is_plain = !["clip-path", "<pattern", "mask"].iter().any(|word| text.contains(word));
        if is_plain && codes.iter().all(|c| !matches!(*c, "svg-overhang" | "svg-hairline")) {
            assert!(length < by_usvg * 1.001, "{name}: {length} mm, by usvg {by_usvg} mm");
            let is_whole = WHOLE.contains(&name.as_str());
            assert!(!is_whole || length > by_usvg * 0.999, "{name}: {length} mm, by usvg {by_usvg} mm");
            compared += 1;
        }
    }
    compared
}

#[test]
fn lengths_of_drawings_agree_with_usvg() {
    let compared = compared_with_usvg(&drawings(&fixture("")));
    assert_eq!(compared, 2, "aerofoil and twill; leather reaches beyond its page, the logo is cut");
}

#[test]
#[ignore = "needs ../shared: make test-all"]
fn lengths_of_drawings_of_other_sources_agree_with_usvg() {
    let compared = compared_with_usvg(&drawings(&shared().join("textures")));
    assert!(compared >= 28, "{compared}");
}

/// Drawings with a physical size load without one in the job, the others are refused.
fn assert_own_sizes(paths: &[PathBuf]) {
    for path in paths {
        let text = std::fs::read_to_string(path).expect("text");
        let head = text.split_once("<svg").and_then(|(_, t)| t.split_once('>')).expect("a root").0;
        let physical = ["mm\"", "cm\"", "in\""].iter().any(|unit| head.contains(unit));
        match load(real_request(path, None), PLATE, 0.0) {
            Ok((t, _)) => assert!(physical && !t.is_empty(), "{}", path.display()),
            Err(e) => {
                assert!(!physical, "{e}");
                assert_eq!((e.diags().len(), e.diags()[0].code), (1, "svg-size"));
                assert!(e.diags()[0].hint.contains("size = ["));
            }
        }
    }
}

#[test]
fn drawings_keep_their_own_size_or_ask_for_one() {
    let dir = folder();
    let [bare, sized] = ["bare.svg", "sized.svg"].map(|name| dir.path().join(name));
    for (path, size) in [(&bare, "width=\"40\" height=\"40\""), (&sized, "width=\"40mm\" height=\"40mm\"")] {
        let path_of = "<path d=\"M1 1h9v9\" fill=\"none\" stroke=\"black\" stroke-width=\"0.001\"/>";
        let text = format!("<svg xmlns=\"http://www.w3.org/2000/svg\" {size} viewBox=\"0 0 40 40\">{path_of}</svg>");
        std::fs::write(path, text).expect("written");
    }
    assert_own_sizes(&[vec![bare, sized], drawings(&fixture(""))].concat());
}

#[test]
#[ignore = "needs ../shared: make test-all"]
fn drawings_of_other_sources_keep_their_own_size_or_ask_for_one() {
    assert_own_sizes(&drawings(&shared().join("textures")));
}

#[test]
fn tiles_cover_an_area_with_the_density_of_their_page() {
    for path in drawings(&fixture("")) {
        let kind = |tile| Kind::Drawing {
            path: path.clone(),
            size: Size::Mm([50.0, 50.0]),
            unit_mm: None,
            position: Position::Usual,
            turn_rad: 0.0,
            tile,
            marking: outlines(),
        };
        let one = total_mm(&load(request(kind(false), Area::Unlimited), PLATE, 0.0).expect("a page").0);
        let nine = total_mm(
            &load(request(kind(true), Area::Rectangle(BoxMm::rectangle(0.0, 0.0, 150.0, 150.0))), PLATE, 0.0)
                .expect("tiles")
                .0,
        );
        assert!((nine / (9.0 * one) - 1.0).abs() < 1e-6, "{}: {nine} of 9 x {one}", path.display());
        // Cut a quarter into the tiles on two sides and three quarters on the others: the same in sum.
        let cut = request(
            Kind::Drawing {
                path: path.clone(),
                size: Size::Mm([50.0, 50.0]),
                unit_mm: None,
                position: Position::Origin([-12.5, -12.5]),
                turn_rad: 0.0,
                tile: true,
                marking: outlines(),
            },
            Area::Rectangle(BoxMm::rectangle(0.0, 0.0, 100.0, 100.0)),
        );
        let four = total_mm(&load(cut, PLATE, 0.0).expect("tiles").0);
        // Lines on the cut are marked at both ends of it, so there may be a little more.
        assert!(
            four >= 4.0 * one * (1.0 - 1e-6) && four < 4.0 * one + 2.0 * 200.0,
            "{}: {four} of 4 x {one}",
            path.display()
        );
    }
}
