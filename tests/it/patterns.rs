//! Patterns in closed form: how many strokes, how long, where, and what is left of them at borders.

use std::collections::BTreeSet;
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use terrace_core::math;

use crate::support::surfaces::{Random, dome, mesh, write_stl};
use crate::support::{JobText, assert_balance, compile, folder, number, verify};
use crate::textures::{PLATE, cells, code, load, made, request, strokes, total_mm};
use terrace_core::geom::{BoxMm, P2, length_mm};
use terrace_input::texture::kind::{Lattice, Shape};
use terrace_input::texture::{Area, Kind, Texture};

/// Any pattern that has a file of its own since cells, of some tenths of a millimetre to two.
pub(crate) fn any(noise: &mut Random) -> Kind {
    let pitch_mm = noise.range(0.6, 2.0);
    let cell_mm = 0.6 * pitch_mm;
    let centre_mm = noise.chance(60).then(|| [noise.range(-60.0, 70.0), noise.range(-15.0, 20.0)]);
    let lattice = if noise.chance(50) { Lattice::Hex } else { Lattice::Square };
    let shape = match noise.below(4) {
        0 => Shape::Hexagon,
        1 => Shape::Cross { width_mm: 0.2 * cell_mm },
        2 => Shape::Jerusalem { width_mm: 0.1 * cell_mm, bar_mm: 0.5 * cell_mm },
        _ => Shape::Ring { inner_mm: 0.7 * cell_mm },
    };
    match noise.below(5) {
        0 => Kind::Cells { shape, cell_mm, pitch_mm, lattice },
        1 => Kind::Honeycomb { pitch_mm },
        2 => Kind::Riblets { pitch_mm, cell_mm, line_mm: noise.range(0.05, 0.3), direction_rad: noise.range(-PI, PI) },
        3 => Kind::Concentric { pitch_mm, centre_mm },
        _ => Kind::Spiral { pitch_mm, centre_mm },
    }
}

fn points_of(strokes: &[Vec<P2>]) -> u64 {
    strokes.iter().map(|s| s.len() as u64).sum()
}

/// Whether all points lie in the area but for their rounding.
fn assert_within(strokes: &[Vec<P2>], area: BoxMm<2>) {
    for [x, y] in strokes.iter().flatten().map(|p| p.mm()) {
        let [lo, hi] = [area.lo.map(|v| v - 1e-6), area.hi.map(|v| v + 1e-6)];
        assert!(lo[0] <= x && x <= hi[0] && lo[1] <= y && y <= hi[1], "{x} {y} beside {area:?}");
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn any_pattern_at_any_turn_keeps_the_promises_of_strokes() {
    for seed in 0..600 {
        eprintln!("seed {seed}");
        let mut noise = Random::case(seed);
        let kind = any(&mut noise);
        let [w, h] = [0; 2].map(|_| noise.range(0.5, 25.0));
        let area = BoxMm::rectangle(-7.3, 2.9, -7.3 + w, 2.9 + h);
        let placed = |turn| load(request(kind.clone(), Area::Rectangle(area)), PLATE, turn).map(|t| t.0);
        let turn = noise.range(-PI, PI);
        match (placed(0.0), placed(turn)) {
            (Ok(plain), Ok(turned)) => {
                let (plain, back) = (strokes(&plain), strokes(&turned));
                assert_within(&plain, area);
                assert!(points_of(&back) <= turned.points_estimate(), "{kind:?}");
                assert_eq!(plain.len(), back.len());
                let length = |all: &[Vec<P2>]| all.iter().map(|s| length_mm(s)).sum::<f64>();
                assert!((length(&plain) - length(&back)).abs() < 1e-6 * points_of(&back) as f64, "{kind:?}");
                let (sin, cos) = math::sin_cos(turn);
                for (p, q) in plain.iter().zip(&back) {
                    let ([x, y], to) = (p[0].mm(), q[0].mm());
                    assert!(math::hypot(cos * x - sin * y - to[0], sin * x + cos * y - to[1]) < 3e-6, "{kind:?}");
                }
            }
            (Err(a), Err(b)) => assert_eq!((a.diags()[0].code, b.diags()[0].code), ("texture-empty", "texture-empty")),
            (a, b) => panic!("{kind:?}: {a:?} {b:?}"),
        }
    }
}

#[test]
fn cells_have_their_number_and_their_lengths() {
    let area = BoxMm::rectangle(3.0, -4.0, 13.05, 6.1);
    let root = 3f64.sqrt();
    // Shape, strokes of a cell, length of them.
    let shapes = [
        (Shape::Square, 1, 4.0 * 0.6),
        (Shape::Circle, 1, PI * 0.6),
        (Shape::Hexagon, 1, 2.0 * root * 0.6),
        (Shape::Cross { width_mm: 0.15 }, 1, 4.0 * 0.6),
        (Shape::Jerusalem { width_mm: 0.1, bar_mm: 0.3 }, 1, 4.0 * 0.6 + 8.0 * 0.3 - 8.0 * 0.1),
        (Shape::Ring { inner_mm: 0.4 }, 2, PI * (0.6 + 0.4)),
    ];
    for (shape, loops, length) in shapes {
        // Ten rows of ten; of hexagonal tiles rows lie 0.866 mm apart and are 1.155 mm high.
        for (lattice, count) in [(Lattice::Square, 100), (Lattice::Hex, 6 * 10 + 5 * 9)] {
            let t = made(Kind::Cells { shape, cell_mm: 0.6, pitch_mm: 1.0, lattice }, area);
            assert_eq!(t.len(), loops * count, "{shape:?} {lattice:?}");
            let all = strokes(&t);
            assert_within(&all, area);
            assert!(all.iter().all(|s| s.first() == s.last()), "{shape:?}: closed");
            let total = all.iter().map(|s| length_mm(s)).sum::<f64>();
            // Chords are shorter than their arcs.
            assert!((total / (count as f64 * length) - 1.0).abs() < 2.5e-3, "{shape:?}: {total}");
            let centres: Vec<[f64; 2]> = all.iter().step_by(loops).map(|s| centre(s)).collect();
            let first = if lattice == Lattice::Hex { [3.5, -4.0 + 1.0 / root] } else { [3.5, -3.5] };
            assert!(math::hypot(centres[0][0] - first[0], centres[0][1] - first[1]) < 2e-3, "{:?}", centres[0]);
            for (i, a) in centres.iter().enumerate() {
                let near = centres.iter().enumerate().filter(|(k, _)| *k != i);
                let near = near.map(|(_, b)| math::hypot(a[0] - b[0], a[1] - b[1])).fold(f64::INFINITY, f64::min);
                assert!((near - 1.0).abs() < 4e-6, "{shape:?} {lattice:?}: {near}");
            }
        }
    }
}

/// The middle of a stroke's box.
fn centre(stroke: &[P2]) -> [f64; 2] {
    let b = BoxMm::of(stroke.iter().map(|p| p.mm()));
    [0, 1].map(|k| (b.lo[k] + b.hi[k]) / 2.0)
}

#[test]
fn outlines_are_as_the_formula_says() {
    let one = |shape| {
        let t = made(cells(shape, 1.0, 2.0), BoxMm::rectangle(-1.0, -1.0, 1.0, 1.0));
        strokes(&t)[0].iter().map(|p| p.mm()).collect::<Vec<_>>()
    };
    let cross = one(Shape::Cross { width_mm: 0.2 });
    assert_eq!(cross[..4], [[-0.1, -0.5], [0.1, -0.5], [0.1, -0.1], [0.5, -0.1]]);
    assert_eq!(cross.len(), 13);
    let jerusalem = one(Shape::Jerusalem { width_mm: 0.1, bar_mm: 0.5 });
    assert_eq!(jerusalem[..5], [[-0.25, -0.5], [0.25, -0.5], [0.25, -0.4], [0.05, -0.4], [0.05, -0.05]]);
    assert_eq!(jerusalem[5..8], [[0.4, -0.05], [0.4, -0.25], [0.5, -0.25]]);
    assert_eq!(jerusalem.len(), 29);
    let hexagon = one(Shape::Hexagon);
    assert_eq!((hexagon.len(), hexagon[0], hexagon[1]), (7, [0.0, -0.577350], [0.5, -0.288675]));
}

#[test]
fn cells_that_do_not_fit_their_tile_are_refused() {
    let area = BoxMm::rectangle(0.0, 0.0, 9.0, 9.0);
    let of = |shape, cell_mm, pitch_mm, lattice| {
        load(request(Kind::Cells { shape, cell_mm, pitch_mm, lattice }, Area::Rectangle(area)), PLATE, 0.0)
    };
    for (shape, pitch, lattice) in [
        (Shape::Hexagon, 1.0, Lattice::Hex),
        (Shape::Hexagon, 2.0 / 3f64.sqrt(), Lattice::Square),
        (Shape::Square, (1.0 + 3f64.sqrt()) / 2.0, Lattice::Hex),
        (Shape::Circle, 1.0, Lattice::Hex),
        (Shape::Cross { width_mm: 0.5 }, (0.5 + 3f64.sqrt()) / 2.0, Lattice::Hex),
    ] {
        assert!(of(shape, 1.0, pitch, lattice).is_ok(), "{shape:?}");
        assert_eq!(code(of(shape, 1.0, pitch * 0.999_99, lattice)), "texture-cell", "{shape:?}");
    }
    for shape in [
        Shape::Cross { width_mm: 1.0 },
        Shape::Cross { width_mm: 0.0 },
        Shape::Jerusalem { width_mm: 0.2, bar_mm: 0.2 },
        Shape::Jerusalem { width_mm: 0.2, bar_mm: 0.6 },
        Shape::Ring { inner_mm: 1.0 },
        Shape::Ring { inner_mm: 0.0 },
    ] {
        assert_eq!(code(of(shape, 1.0, 2.0, Lattice::Square)), "texture-cell", "{shape:?}");
    }
    let one = |kind| load(request(kind, Area::Rectangle(area)), PLATE, 0.0);
    let riblets = |pitch_mm, cell_mm, line_mm| Kind::Riblets { pitch_mm, cell_mm, line_mm, direction_rad: 0.0 };
    assert_eq!(code(one(riblets(1.0, 1.0, 0.1))), "texture-cell");
    assert_eq!(code(one(riblets(1.0, 0.5, 0.6))), "texture-cell");
    assert_eq!(code(one(riblets(1.0, 0.5, 0.0))), "texture-pitch");
    for pitch_mm in [0.0, -1.0, f64::NAN, 1e-6] {
        assert_eq!(code(one(Kind::Honeycomb { pitch_mm })), "texture-pitch");
        assert_eq!(code(one(Kind::Concentric { pitch_mm, centre_mm: None })), "texture-pitch");
        assert_eq!(code(one(Kind::Spiral { pitch_mm, centre_mm: None })), "texture-pitch");
    }
    assert_eq!(code(one(Kind::Honeycomb { pitch_mm: 2e-5 })), "texture-large");
    let wide = Area::Rectangle(BoxMm::rectangle(0.0, 0.0, 3000.0, 3000.0));
    for kind in [riblets(1.0, 0.9999, 1e-6), Kind::Concentric { pitch_mm: 1e-3, centre_mm: None }] {
        assert_eq!(code(load(request(kind, wide.clone()), PLATE, 0.0)), "texture-large");
    }
    assert_eq!(code(one(Kind::Spiral { pitch_mm: 2e-5, centre_mm: None })), "texture-large");
    assert_eq!(code(one(Kind::Spiral { pitch_mm: 1.0, centre_mm: Some([4001.0, 0.0]) })), "texture-far");
    assert_eq!(code(one(Kind::Concentric { pitch_mm: 20.0, centre_mm: None })), "texture-empty");
}

/// What a rectangle leaves of a segment, mm.
fn left_of([a, b]: [[f64; 2]; 2], area: BoxMm<2>) -> f64 {
    let (mut t0, mut t1) = (0.0_f64, 1.0_f64);
    for k in 0..2 {
        let d = b[k] - a[k];
        if d.abs() < 1e-12 {
            if a[k] < area.lo[k] - 1e-9 || a[k] > area.hi[k] + 1e-9 {
                return 0.0;
            }
            continue;
        }
        let (ta, tb) = ((area.lo[k] - a[k]) / d, (area.hi[k] - a[k]) / d);
        t0 = t0.max(ta.min(tb));
        t1 = t1.min(ta.max(tb));
    }
    (t1 - t0).max(0.0) * math::hypot(b[0] - a[0], b[1] - a[1])
}

#[test]
fn honeycomb_has_every_wall_once() {
    // Four whole tiles in a row and three rows: 5 and 4 uprights, zig-zag lines of 8 walls each.
    let side = 1.0 / 3f64.sqrt();
    let t = made(Kind::Honeycomb { pitch_mm: 1.0 }, BoxMm::rectangle(0.0, 0.0, 4.0, 4.5 * side));
    assert_eq!(t.len(), 3 + 5 + 4 + 5);
    assert!((total_mm(&t) - side * f64::from(3 * 8 + 5 + 4 + 5)).abs() < 1e-4);
    for seed in 0..200 {
        eprintln!("seed {seed}");
        let mut noise = Random::case(seed);
        let pitch = noise.range(0.3, 3.0);
        let side = pitch / 3f64.sqrt();
        let [w, h] = [0; 2].map(|_| noise.range(0.2, 9.0));
        let area = BoxMm::rectangle(1.0, -2.0, 1.0 + w, -2.0 + h);
        // The three walls of every tile that lie on its right, cut by hand.
        let mut want = 0.0;
        for row in -2..=(h / side) as i32 + 2 {
            for column in -2..=(w / pitch) as i32 + 2 {
                let x = area.lo[0] + pitch * (f64::from(column) + if row % 2 == 0 { 0.5 } else { 1.0 });
                let y = area.lo[1] + side + 1.5 * side * f64::from(row);
                let at = |k: i32| {
                    let (sin, cos) = math::sin_cos(PI / 6.0 + f64::from(k) * PI / 3.0);
                    [x + side * cos, y + side * sin]
                };
                want += (-2..1).map(|k| left_of([at(k), at(k + 1)], area)).sum::<f64>();
            }
        }
        let Some(t) = seen(Kind::Honeycomb { pitch_mm: pitch }, area) else {
            assert!(want < 1e-5, "seed {seed}: {want} mm");
            continue;
        };
        let all = strokes(&t);
        assert_within(&all, area);
        let total = all.iter().map(|s| length_mm(s)).sum::<f64>();
        assert!((total - want).abs() < 2e-6 * points_of(&all) as f64, "seed {seed}: {total} of {want}");
        let ends = |w: &[P2]| (w[0].x.min(w[1].x), w[0].x.max(w[1].x), w[0].y.min(w[1].y), w[0].y.max(w[1].y));
        let walls: Vec<_> = all.iter().flat_map(|s| s.windows(2)).map(ends).collect();
        assert_eq!(walls.iter().collect::<BTreeSet<_>>().len(), walls.len(), "seed {seed}: no wall twice");
    }
}

#[test]
fn riblets_are_grooves_of_lines() {
    let area = BoxMm::rectangle(0.0, 0.0, 30.0, 10.0);
    let riblets = |direction_rad| Kind::Riblets { pitch_mm: 1.0, cell_mm: 0.35, line_mm: 0.1, direction_rad };
    let t = made(riblets(0.0), area);
    // Ten grooves of four lines, and the first line of one more on the border.
    let heights: Vec<_> = strokes(&t).iter().map(|s| s[0].y).collect();
    let want: Vec<_> = (0..41).map(|k| k / 4 * 1_000_000 + k % 4 * 100_000).collect();
    assert_eq!(heights, want);
    assert!((total_mm(&t) - 41.0 * 30.0).abs() < 1e-9);
    assert_eq!(
        (t.element(0), t.element(6)),
        ("texture 1, line 1 of groove 1".into(), "texture 1, line 3 of groove 2".into())
    );
    assert_eq!(made(riblets(FRAC_PI_2), area).len(), 30 * 4 + 1);
    // Of the lines beside the corner, in a groove that begins outside, those inside are marked.
    for seed in 0..200 {
        let mut noise = Random::case(seed);
        let direction = noise.range(-PI, PI);
        let (sin, cos) = math::sin_cos(direction);
        let t = made(riblets(direction), area);
        let mut want = 0.0;
        for groove in -40..40 {
            for line in 0..4 {
                let offset = f64::from(groove) + 0.1 * f64::from(line);
                let end = |t: f64| [t * cos - offset * sin, t * sin + offset * cos];
                want += left_of([end(-100.0), end(100.0)], area);
            }
        }
        let total = total_mm(&t);
        assert!((total - want).abs() < 2e-6 * t.len() as f64, "seed {seed}: {total} of {want}");
    }
}

/// The length of a curve about a centre in the area, found by small steps along it up to the angle `last`; `at` is the
/// radius at an angle.
fn walked(area: BoxMm<2>, centre: [f64; 2], at: impl Fn(f64) -> f64, last: f64, step: f64) -> f64 {
    let mut length = 0.0;
    let point = |t: f64| [centre[0] + at(t) * math::cos(t), centre[1] + at(t) * math::sin(t)];
    let n = (last / step).ceil();
    for k in 0..n as u64 {
        let [a, b] = [k, k + 1].map(|k| point(k as f64 / n * last));
        length += left_of([a, b], area);
    }
    length
}

fn corners_away(area: BoxMm<2>, c: [f64; 2]) -> f64 {
    area.corners().iter().map(|p| math::hypot(p[0] - c[0], p[1] - c[1])).fold(0.0, f64::max)
}

/// A centre in the area, on its border or corner, or beside it.
fn any_centre(noise: &mut Random, area: BoxMm<2>) -> [f64; 2] {
    [0, 1].map(|k| match noise.below(6) {
        0 => area.lo[k],
        1 => area.hi[k],
        2 => (area.lo[k] + area.hi[k]) / 2.0,
        _ => noise.range(2.0 * area.lo[k] - area.hi[k], 2.0 * area.hi[k] - area.lo[k]),
    })
}

fn seen(kind: Kind, area: BoxMm<2>) -> Option<Texture> {
    load(request(kind, Area::Rectangle(area)), PLATE, 0.0).ok().map(|t| t.0)
}

#[test]
fn concentric_circles_fill_their_area() {
    // Five whole circles, the largest along the border, and what the corners hold of larger ones.
    let area = BoxMm::rectangle(10.0, 20.0, 20.0, 30.0);
    let t = made(Kind::Concentric { pitch_mm: 1.0, centre_mm: None }, area);
    let all = strokes(&t);
    assert_eq!(t.len(), 5 + 4 * 2);
    assert!(all[..5].iter().all(|s| s.first() == s.last()), "whole circles are closed");
    assert_eq!(all[4][0], P2::new(20_000_000, 25_000_000));
    let arcs = [6.0f64, 7.0].map(|r| 4.0 * r * (FRAC_PI_2 - 2.0 * math::acos(5.0 / r)));
    let want = TAU * 15.0 + arcs.iter().sum::<f64>();
    assert!((total_mm(&t) / want - 1.0).abs() < 1e-3, "{} of {want}", total_mm(&t));
    for seed in 0..150 {
        eprintln!("seed {seed}");
        let mut noise = Random::case(seed);
        let (area, c, pitch, far) = any_rings(&mut noise);
        let lengths = (1..=(far / pitch) as u64).map(|m| m as f64 * pitch).map(|r| walked(area, c, |_| r, TAU, 4e-3));
        let want: f64 = lengths.sum();
        let kind = Kind::Concentric { pitch_mm: pitch, centre_mm: Some(c) };
        let Some(t) = seen(kind, area) else {
            assert!(want < 1e-2, "seed {seed}: {want} mm");
            continue;
        };
        let all = strokes(&t);
        assert_within(&all, area);
        let total = all.iter().map(|s| length_mm(s)).sum::<f64>();
        assert!((total - want).abs() < 2e-3 * want + 1e-5, "seed {seed}: {total} of {want}");
        for s in &all {
            let away = |[x, y]: [f64; 2]| math::hypot(x - c[0], y - c[1]);
            let r = (away(s[0].mm()) / pitch).round() * pitch;
            for w in s.windows(2) {
                let middle = [0, 1].map(|k| (w[0].mm()[k] + w[1].mm()[k]) / 2.0);
                assert!((away(w[0].mm()) - r).abs() < 3e-6 && r - away(middle) < 1e-3 + 3e-6, "seed {seed}");
            }
        }
    }
}

/// An area, a centre, a pitch, and how far the farthest corner lies from the centre.
fn any_rings(noise: &mut Random) -> (BoxMm<2>, [f64; 2], f64, f64) {
    let [w, h] = [0; 2].map(|_| noise.range(0.7, 9.0));
    let area = BoxMm::rectangle(1.0, -2.0, 1.0 + w, -2.0 + h);
    let (c, pitch) = (any_centre(noise, area), noise.range(0.2, 2.0));
    (area, c, pitch, corners_away(area, c))
}

#[test]
#[ignore = "slow: make test-all"]
fn the_spiral_runs_from_its_centre_to_the_corners() {
    for seed in 0..150 {
        eprintln!("seed {seed}");
        let mut noise = Random::case(seed);
        let (area, c, pitch, far) = any_rings(&mut noise);
        let at = |t: f64| pitch * t / TAU;
        let want = walked(area, c, at, (far / pitch + 1.0) * TAU, 4e-3);
        let Some(t) = seen(Kind::Spiral { pitch_mm: pitch, centre_mm: Some(c) }, area) else {
            assert!(want < 1e-2, "seed {seed}: {want} mm");
            continue;
        };
        let all = strokes(&t);
        assert_within(&all, area);
        let total = all.iter().map(|s| length_mm(s)).sum::<f64>();
        assert!((total - want).abs() < 2e-3 * want + 1e-5, "seed {seed}: {total} of {want}");
        // Vertices lie on the spiral: the radius says which turn, the direction how far into it.
        let mut last = -1.0;
        for p in all.iter().flatten().map(|p| p.mm()) {
            let (r, angle) = (math::hypot(p[0] - c[0], p[1] - c[1]), math::atan2(p[1] - c[1], p[0] - c[0]));
            let off = (r / pitch - angle / TAU).rem_euclid(1.0);
            assert!(off.min(1.0 - off) * pitch.min(r) < 1e-5, "seed {seed}: {off} at {r}");
            assert!(r > last - 2e-6, "seed {seed}: outwards only");
            last = r;
        }
    }
    // Length of an Archimedean spiral of n whole turns, and one stroke where all of it lies inside.
    let t = made(Kind::Spiral { pitch_mm: 0.5, centre_mm: None }, BoxMm::rectangle(0.0, 0.0, 100.0, 10.0));
    let first = &strokes(&t)[0];
    assert_eq!(first[0], P2::new(50_000_000, 5_000_000));
    let out = (first[first.len() - 1].mm()[1] - 5.0).abs();
    assert!((out - 5.0).abs() < 1e-6, "it ends on the border");
}

#[test]
#[ignore = "slow: make test-all"]
fn patterns_on_a_dome_compile_and_verify() {
    let dir = folder();
    let stl = dir.path().join("dome.stl");
    write_stl(&stl, &mesh(40, [185.0, 185.0, 265.0, 245.0], dome));
    let patterns = [
        ("hexagons", "pitch = \"4 mm\"\ncell = \"3 mm\""),
        ("crosses", "pitch = \"5 mm\"\ncell = \"4 mm\"\nwidth = \"1 mm\""),
        ("jerusalem", "pitch = \"6 mm\"\ncell = \"5 mm\"\nwidth = \"0.5 mm\"\nbar = \"2.5 mm\"\nlattice = \"hex\""),
        ("rings", "pitch = \"4 mm\"\ncell = \"3 mm\"\ninner = \"2 mm\"\nlattice = \"hex\""),
        ("squares", "pitch = \"4 mm\"\ncell = \"2 mm\"\nlattice = \"hex\""),
        ("honeycomb", "pitch = \"3.7 mm\""),
        ("riblets", "pitch = \"2 mm\"\ncell = \"0.4 mm\"\nline = \"0.1 mm\"\ndirection = \"30 deg\""),
        ("concentric", "pitch = \"1.3 mm\"\ncentre = [\"200 mm\", \"300 mm\"]"),
        ("spiral", "pitch = \"1.3 mm\""),
    ];
    for (name, keys) in patterns {
        let mut job = JobText::on(&stl).texture(&format!("pattern = \"{name}\"\n{keys}")).method("z-range");
        job.partition = "min_mark = \"0 mm\"".into();
        let out = dir.path().join(format!("{name}.job"));
        let summary = compile(&job.write(dir.path(), "job.toml"), &out);
        assert_balance(&summary, &verify(&out));
        assert!(number(&summary, "mark_mm") > 500.0, "{name}: {summary}");
        assert!(number(&summary, "skipped_mm") < 1e-3, "{name}: {summary}");
    }
}
