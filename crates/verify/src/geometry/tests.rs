//! Closed forms: plane, sphere, undercut shell, height map.

use super::*;
use terrace_core::math;
use terrace_input::surface::{Heightmap, Samples};

const LIMIT: f64 = std::f64::consts::FRAC_PI_3;

fn geometry(facets: &[[[f64; 3]; 3]], turn: f64) -> Geometry {
    let mut builder = MeshBuilder::new(turn, 2.0);
    facets.iter().for_each(|&f| builder.push(f));
    Geometry::new(Shape::Mesh(builder.finish()), LIMIT, 0.0)
}

fn pieces(geometry: &Geometry, a: [f64; 2], b: [f64; 2]) -> Vec<Piece> {
    let mut out = Vec::new();
    geometry.along(&Line::new(a.map(nm), b.map(nm)), &mut Scratch::default(), |p| out.push(p));
    out
}

/// A sheet of (x, y) over `[0, w] x [0, h]` mm in n x m cells, windings and order mixed.
fn sheet(w: f64, h: f64, n: usize, m: usize, z: impl Fn(f64, f64) -> f64) -> Vec<[[f64; 3]; 3]> {
    let at = |i: usize, j: usize| {
        let (x, y) = (w * i as f64 / n as f64, h * j as f64 / m as f64);
        [x, y, z(x, y)]
    };
    let mut out = Vec::new();
    for i in 0..n {
        for j in 0..m {
            out.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            out.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    // A fixed shuffle: no regular order for the grid to lean on.
    terrace_core::random::Random::new(1).shuffle(&mut out);
    out.iter_mut().step_by(3).for_each(|f| f.swap(0, 1));
    out
}

/// Pieces follow each other without a hole, and cover the line.
fn assert_whole(pieces: &[Piece], len_mm: f64) {
    let mut at = 0.0;
    for p in pieces {
        assert!((p.d[0] - at).abs() < 1e-2 && p.d[1] > p.d[0], "hole at {at}: {p:?}");
        at = p.d[1];
    }
    assert!((at - nm(len_mm)).abs() < 1e-2);
}

#[test]
fn a_tilted_plane_is_exact_in_every_direction_and_turn() {
    let z = |x: f64, y: f64| 0.3 * x - 0.2 * y + 5.0;
    for turn in [0.0, 0.4, -2.0] {
        let g = geometry(&sheet(10.0, 8.0, 13, 7, z), turn);
        let (sin, cos) = math::sin_cos(turn);
        let turned = |p: [f64; 2]| [p[0] * cos - p[1] * sin, p[0] * sin + p[1] * cos];
        for (a, b) in
            [([0.0, 0.0], [10.0, 8.0]), ([1.0, 4.0], [9.0, 4.0]), ([3.0, 7.5], [3.0, 0.5]), ([9.7, 0.1], [0.2, 7.9])]
        {
            let found = pieces(&g, turned(a), turned(b));
            let len = math::hypot(b[0] - a[0], b[1] - a[1]);
            assert_whole(&found, len);
            for p in found.iter().filter(|p| p.len() > 1.0) {
                let s = p.sheet.expect("on the plane");
                for (d, zf) in p.d.into_iter().zip(s.z) {
                    let t = d / nm(len);
                    let wanted = nm(z(a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])));
                    assert!((zf - wanted).abs() < 1e-3, "turn {turn}: {zf} {wanted}");
                }
                assert_eq!(s.slope, Slope::Gentle);
            }
        }
    }
}

#[test]
fn a_sphere_is_met_to_its_chord_error_and_its_rim_is_steep() {
    let r = 20.0f64;
    let cap = |x: f64, y: f64| (r * r - (x - 15.0).powi(2) - (y - 15.0).powi(2)).max(0.0).sqrt();
    let g = geometry(&sheet(30.0, 30.0, 300, 300, cap), 0.0);
    let found = pieces(&g, [0.0, 15.03], [30.0, 14.9]);
    assert_whole(&found, math::hypot(30.0f64, 0.13));
    let line = Line::new([0.0, nm(15.03)], [nm(30.0), nm(14.9)]);
    for p in found.iter().filter(|p| p.len() > 1.0) {
        let s = p.sheet.expect("on the cap");
        for (d, z) in p.d.into_iter().zip(s.z) {
            let [x, y] = line.at(d).map(|v| v / 1e6);
            // Chord error of 0.1 mm cells: h^2 (1 + tan^2)^1.5 / (4 R) at the steepest is below 0.7 um.
            assert!((z / 1e6 - cap(x, y)).abs() < 0.7e-3, "at ({x}, {y})");
        }
    }
    assert!(found.iter().all(|p| p.sheet.is_some_and(|s| s.slope == Slope::Gentle)), "49 degrees at the rim");
    let far = |x: f64, y: f64| (r * r - (x - 1.0).powi(2) - (y - 15.0).powi(2)).max(0.0).sqrt();
    let g = geometry(&sheet(30.0, 30.0, 300, 300, far), 0.0);
    let steep: f64 = pieces(&g, [1.0, 15.0], [21.0, 15.0])
        .iter()
        .filter(|p| p.sheet.is_some_and(|s| s.slope == Slope::Steep))
        .map(Piece::len)
        .sum();
    // 60 degrees is reached at R sin 60; beyond it the rest of R is steep.
    assert!((steep / 1e6 - r * (1.0 - math::sin(60f64.to_radians()))).abs() < 0.1, "{steep}");
}

#[test]
fn of_several_sheets_the_topmost_counts_and_changes_where_they_cross() {
    // A floor, a tilted shell that dives through it, and an island above both.
    let mut facets = sheet(20.0, 10.0, 20, 10, |_, _| 1.0);
    facets.extend(sheet(20.0, 10.0, 7, 3, |x, _| 3.0 - 0.25 * x));
    facets.extend(sheet(4.0, 10.0, 2, 2, |_, _| 9.0).into_iter().map(|f| f.map(|[x, y, z]| [x + 12.0, y, z])));
    // A vertical wall closes the island; it has no plan view.
    facets.push([[12.0, 0.0, 1.0], [12.0, 10.0, 1.0], [12.0, 10.0, 9.0]]);
    let g = geometry(&facets, 0.0);
    let found = pieces(&g, [0.5, 5.2], [25.0, 5.2]);
    assert_whole(&found, 24.5);
    let top = |x: f64| {
        let base = (3.0 - 0.25 * x).max(1.0);
        if (12.0..=16.0).contains(&x) { Some(9.0) } else { (x <= 20.0).then_some(base) }
    };
    for p in found.iter().filter(|p| p.len() > 1.0) {
        let x = 0.5 + (p.d[0] + p.d[1]) / 2e6;
        let mid = p.sheet.map(|s| (s.z[0] + s.z[1]) / 2e6);
        match (mid, top(x)) {
            (Some(z), Some(w)) => assert!((z - w).abs() < 1e-9, "x {x}: {z} {w}"),
            (found, wanted) => assert_eq!(found.is_some(), wanted.is_some(), "x {x}"),
        }
    }
}

#[test]
fn a_height_map_is_the_mesh_of_its_lower_left_diagonals() {
    let (columns, rows) = (7, 5);
    let mut samples: Vec<u16> = (0..columns * rows).map(|i| ((i * 7919) % 1000) as u16 + 1).collect();
    samples[2 * columns + 3] = 0;
    let map = Heightmap {
        columns,
        rows,
        samples: Samples::Whole(samples, Some(0)),
        origin_mm: [-2.0, 3.0],
        pixel_mm: 0.7,
        z_mm: [1.0, 0.0005],
    };
    let node = |i: usize, j: usize| {
        let v = map.samples.value(j * columns + i)?;
        Some([map.origin_mm[0] + i as f64 * 0.7, map.origin_mm[1] + j as f64 * 0.7, 1.0 + v * 0.0005])
    };
    let mut facets = Vec::new();
    for i in 0..columns - 1 {
        for j in 0..rows - 1 {
            for third in [node(i + 1, j), node(i, j + 1)] {
                if let (Some(a), Some(b), Some(c)) = (node(i, j), node(i + 1, j + 1), third) {
                    facets.push([a, b, c]);
                }
            }
        }
    }
    for turn in [0.0, 1.1] {
        let mesh = geometry(&facets, turn);
        let of_map = Geometry::new(Shape::Map(Map::new(map.clone(), turn).expect("cells")), LIMIT, 0.0);
        let (sin, cos) = math::sin_cos(turn);
        let turned = |p: [f64; 2]| [p[0] * cos - p[1] * sin, p[0] * sin + p[1] * cos];
        for (a, b) in [([-3.0, 3.1], [4.0, 5.9]), ([0.31, 2.0], [0.33, 7.0]), ([2.0, 5.7], [-2.5, 2.9])] {
            let (m, h) = (pieces(&mesh, turned(a), turned(b)), pieces(&of_map, turned(a), turned(b)));
            assert_whole(&h, math::hypot(b[0] - a[0], b[1] - a[1]));
            let long = |v: &[Piece]| v.iter().filter(|p| p.len() > 1.0).copied().collect::<Vec<_>>();
            let (m, h) = (long(&m), long(&h));
            assert_eq!(m.len(), h.len());
            for (m, h) in m.iter().zip(&h) {
                assert!((m.d[0] - h.d[0]).abs() < 1e-2 && (m.d[1] - h.d[1]).abs() < 1e-2);
                match (m.sheet, h.sheet) {
                    (Some(m), Some(h)) => assert!((m.z[0] - h.z[0]).abs() < 1e-2 && (m.z[1] - h.z[1]).abs() < 1e-2),
                    (m, h) => assert_eq!(m.is_some(), h.is_some()),
                }
            }
        }
        assert!(pieces(&of_map, turned([-3.0, 3.1]), turned([4.0, 5.9])).iter().any(|p| p.sheet.is_none()));
    }
}

#[test]
fn lines_on_edges_and_borders_are_on_the_part() {
    let g = geometry(&sheet(10.0, 10.0, 10, 10, |_, _| 2.0), 0.0);
    for (a, b) in [
        ([0.0, 0.0], [10.0, 0.0]),
        ([0.0, 10.0], [10.0, 10.0]),
        ([10.0, 0.0], [10.0, 10.0]),
        ([0.0, 3.0], [10.0, 3.0]),
        ([2.0, 2.0], [7.0, 7.0]),
    ] {
        let found = pieces(&g, a, b);
        assert_whole(&found, math::hypot(b[0] - a[0], b[1] - a[1]));
        assert!(found.iter().all(|p| p.len() < 1.0 || p.sheet.is_some_and(|s| s.z == [2e6, 2e6])), "{a:?} {b:?}");
    }
}

#[test]
fn slivers_do_not_exhaust_memory() {
    let facets: Vec<_> = (0..3000)
        .map(|i| {
            let t = f64::from(i) * 0.1;
            [[t, 0.0, 0.0], [t + 300.0, 300.0, 0.0], [t + 0.1, 0.0, 0.0]]
        })
        .collect();
    let mut builder = MeshBuilder::new(0.0, 2.0);
    facets.iter().for_each(|&f| builder.push(f));
    let mesh = builder.finish();
    assert_eq!(mesh.len(), 3000);
    let g = Geometry::new(Shape::Mesh(mesh), LIMIT, 0.0);
    assert_whole(&pieces(&g, [0.0, 0.5], [500.0, 0.5]), 500.0);
}

#[test]
#[ignore = "slow: make test-all"]
fn lines_over_two_million_facets_have_no_gap() {
    let facets = sheet(450.0, 450.0, 1000, 1000, |x, y| 40.0 - ((x - 225.0).powi(2) + (y - 225.0).powi(2)) / 2500.0);
    let g = geometry(&facets, 0.0);
    let (mut scratch, mut crossings) = (Scratch::default(), 0);
    for row in 0..4500 {
        let y = 0.05 + f64::from(row) * 0.1;
        for k in 0..150 {
            let line = Line::new([nm(f64::from(k) * 3.0), nm(y)], [nm(f64::from(k + 1) * 3.0), nm(y)]);
            crossings += g.along(&line, &mut scratch, |p| assert!(p.sheet.is_some() || p.len() < 1.0));
        }
    }
    assert!(crossings > 4500 * 2 * 1000, "two facets a cell: {crossings}");
}
