//! Strokes along the edges of solids, against a ray cast just beside them: what is topmost on neither side is never
//! marked, whatever the order, the winding and the first corner of the facets.

use crate::projection::{Skip, Tracer};
use terrace_core::geom::{NM_PER_MM, P2};
use terrace_core::math;
use terrace_core::random::Random;
use terrace_input::surface::Surface;

type Corner = [f64; 3];
type Facet = [Corner; 3];

/// Distance from an edge at which the rays lie, mm: below all features of the solids, above the grid.
const BESIDE: f64 = 1e-4;

/// Tangent of the steepest slope that is marked.
const LIMIT: f64 = 1.732;

/// A solid between polygons of equal length, each at its height, with a bottom and a top or without.
fn loft(rings: &[(f64, &[[f64; 2]])], ends: [bool; 2]) -> Vec<Facet> {
    let at = |k: usize, i: usize| {
        let (z, ring) = rings[k];
        let [x, y] = ring[i % ring.len()];
        [x, y, z]
    };
    let n = rings[0].1.len();
    let mut out = Vec::new();
    for k in 0..rings.len() - 1 {
        for i in 0..n {
            out.push([at(k, i), at(k, i + 1), at(k + 1, i + 1)]);
            out.push([at(k, i), at(k + 1, i + 1), at(k + 1, i)]);
        }
    }
    for (k, _) in [(0, ends[0]), (rings.len() - 1, ends[1])].into_iter().filter(|(_, is_there)| *is_there) {
        out.extend((1..n - 1).map(|i| [at(k, 0), at(k, i), at(k, i + 1)]));
    }
    out
}

fn square(x0: f64, y0: f64, x1: f64, y1: f64) -> [[f64; 2]; 4] {
    [[x0, y0], [x1, y0], [x1, y1], [x0, y1]]
}

/// A cylinder along x, from `from` to `to` in angle, 0 along y; with the flat face that closes it or without.
fn cylinder(from: f64, to: f64, is_closed: bool) -> Vec<Facet> {
    const STEPS: usize = 12;
    let ring: Vec<[f64; 2]> = (0..=STEPS)
        .map(|i| {
            let (sin, cos) = math::sin_cos(from + (to - from) * i as f64 / STEPS as f64);
            [10.0 * cos, 10.0 * sin]
        })
        .collect();
    let at = |i: usize, x: f64| [x, ring[i % ring.len()][0], ring[i % ring.len()][1]];
    let mut out = Vec::new();
    for i in 0..if is_closed { ring.len() } else { STEPS } {
        out.push([at(i, 0.0), at(i, 30.0), at(i + 1, 30.0)]);
        out.push([at(i, 0.0), at(i + 1, 30.0), at(i + 1, 0.0)]);
    }
    if is_closed {
        for x in [0.0, 30.0] {
            out.extend((1..STEPS).map(|i| [at(0, x), at(i, x), at(i + 1, x)]));
        }
    }
    out
}

fn solids() -> Vec<(&'static str, Vec<Facet>)> {
    let (foot, top) = (square(0.0, 0.0, 40.0, 30.0), square(4.0, 4.0, 36.0, 26.0));
    let half = std::f64::consts::PI;
    let drafted = loft(&[(0.0, &foot), (10.0, &top)], [true, true]);
    // The same with more facets below than the walls have.
    let divided = {
        let mut facets = loft(&[(0.0, &foot), (10.0, &top)], [false, true]);
        for i in 0..4 {
            let x = f64::from(i) * 10.0;
            let [a, b, c, d] = square(x, 0.0, x + 10.0, 30.0).map(|[x, y]| [x, y, 0.0]);
            facets.extend([[a, b, c], [a, c, d]]);
        }
        facets
    };
    let hollow = {
        // Its underside rises to a point inside.
        let mut facets = loft(&[(0.0, &foot), (10.0, &top)], [false, true]);
        let tip = [20.0, 15.0, 5.0];
        facets.extend((0..4).map(|i| {
            let [a, b] = [foot[i], foot[(i + 1) % 4]].map(|[x, y]| [x, y, 0.0]);
            [a, b, tip]
        }));
        facets
    };
    let stacked = {
        let mut facets = drafted.clone();
        facets.extend(loft(
            &[(10.0, &square(10.0, 8.0, 30.0, 22.0)), (16.0, &square(11.0, 9.0, 29.0, 21.0))],
            [true, true],
        ));
        facets
    };
    vec![
        ("drafted block", drafted),
        ("drafted block without a bottom", loft(&[(0.0, &foot), (10.0, &top)], [false, true])),
        ("drafted block on a divided bottom", divided),
        ("block with undercut walls", loft(&[(0.0, &top), (10.0, &foot)], [true, true])),
        (
            "parting line between two drafts",
            loft(
                &[(0.0, &square(2.0, 2.0, 38.0, 28.0)), (6.0, &foot), (15.0, &square(3.0, 3.0, 37.0, 27.0))],
                [true, true],
            ),
        ),
        ("half cylinder", cylinder(0.0, half, true)),
        ("half cylinder without a bottom", cylinder(0.0, half, false)),
        ("channel", cylinder(half, 2.0 * half, false)),
        ("upright block", loft(&[(0.0, &foot), (10.0, &foot)], [true, true])),
        ("hollow block", hollow),
        ("pyramid with gentle sides", loft(&[(0.0, &foot), (3.0, &square(12.0, 9.0, 28.0, 21.0))], [true, true])),
        (
            "pocket with drafted walls",
            loft(
                &[(0.0, &square(10.0, 10.0, 30.0, 20.0)), (9.0, &square(8.0, 8.0, 32.0, 22.0)), (9.0, &foot)],
                [true, false],
            ),
        ),
        ("one block on another", stacked),
    ]
}

/// The facets in another order, with other windings and first corners.
fn shuffled(facets: &[Facet], seed: u64, winding: u64) -> Vec<Facet> {
    let mut noise = Random::case(seed);
    let mut out = facets.to_vec();
    for i in (1..out.len()).rev() {
        let j = noise.below(i + 1);
        out.swap(i, j);
    }
    for f in &mut out {
        f.rotate_left(noise.below(3));
        if match winding {
            0 => false,
            1 => true,
            _ => noise.chance(50),
        } {
            f.swap(0, 1);
        }
    }
    out
}

/// Height and squared slope of the topmost facet over a place, if one is there.
fn topmost(facets: &[Facet], [x, y]: [f64; 2]) -> Option<(f64, f64)> {
    let over = |&[a, b, c]: &Facet| {
        let area =
            |p: [f64; 2], q: [f64; 2], r: [f64; 2]| (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]);
        let [p, q, r] = [a, b, c].map(|v| [v[0], v[1]]);
        let all = area(p, q, r);
        if all.abs() < 1e-9 {
            return None;
        }
        let w = [area(q, r, [x, y]), area(r, p, [x, y]), area(p, q, [x, y])].map(|w| w / all);
        let [u, v] = [b, c].map(|e| [0, 1, 2].map(|k| e[k] - a[k]));
        let [nx, ny, nz] = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
        w.iter().all(|&w| w >= 0.0).then(|| (w[0] * a[2] + w[1] * b[2] + w[2] * c[2], (nx * nx + ny * ny) / (nz * nz)))
    };
    facets.iter().filter_map(over).max_by(|a, b| a.0.total_cmp(&b.0))
}

#[test]
#[ignore = "slow: make test-all"]
fn strokes_along_edges_are_marked_on_what_is_topmost_beside_them() {
    for (name, solid) in solids() {
        for turn in [0.0f64, 0.4] {
            let (sin, cos) = math::sin_cos(turn);
            let place = |[x, y]: [f64; 2]| [x * cos - y * sin, x * sin + y * cos];
            let mut edges: Vec<[[f64; 2]; 2]> = Vec::new();
            for f in &solid {
                for k in 0..3 {
                    let [a, b] = [f[k], f[(k + 1) % 3]].map(|v| [v[0], v[1]]);
                    if a < b && !edges.contains(&[a, b]) {
                        edges.push([a, b]);
                    }
                }
            }
            // What a ray cast shows on either side of some places on each edge.
            type Seen = Option<(f64, f64)>;
            let shares: Vec<f64> = (0..23).map(|i| (f64::from(i) + 0.4) / 23.0).collect();
            let seen: Vec<Vec<[Seen; 2]>> = edges
                .iter()
                .map(|&[a, b]| {
                    let d = [b[0] - a[0], b[1] - a[1]];
                    let len = math::hypot(d[0], d[1]);
                    let beside = |t: f64, side: f64| {
                        let by = side * BESIDE / len;
                        topmost(&solid, [a[0] + t * d[0] - by * d[1], a[1] + t * d[1] + by * d[0]])
                    };
                    shares.iter().map(|&t| [beside(t, 1.0), beside(t, -1.0)]).collect()
                })
                .collect();
            for order in 0..14 {
                for winding in 0..4 {
                    let turned = shuffled(&solid, order, winding).into_iter().map(|f| {
                        f.map(|[x, y, z]| {
                            let [x, y] = place([x, y]);
                            [x, y, z]
                        })
                    });
                    let surface = Surface::from_facets(turned, &mut Vec::new()).expect("a solid");
                    let mut tracer = Tracer::new(&surface, LIMIT);
                    for (edge, seen) in edges.iter().zip(&seen) {
                        let [a, b] = edge.map(|p| {
                            let [x, y] = place(p);
                            P2::from_mm(x, y).expect("near")
                        });
                        for [from, to] in [[0.0, 1.0], [1.0, 0.0], [0.1, 0.83]] {
                            let mut pieces = Vec::new();
                            tracer.segment(a.lerp(b, from), a.lerp(b, to), |p| pieces.push(p));
                            for (&share, sides) in shares.iter().zip(seen) {
                                let t = (share - from) / (to - from);
                                let Some(p) = pieces.iter().find(|p| p.t0 <= t && t <= p.t1) else { continue };
                                let markable = |s: &Seen| s.filter(|s| s.1 <= LIMIT * LIMIT).map(|s| s.0);
                                let marked = sides.iter().filter_map(markable).reduce(f64::max);
                                let found = p.skip.is_none().then(|| p.z(t) / NM_PER_MM);
                                let what = format!(
                                    "{name}, turn {turn}, order {order}, winding {winding}: {edge:?} at {share}: {found:?} \
                                     for {marked:?} of {sides:?}"
                                );
                                match (found, marked) {
                                    (Some(z), Some(want)) => assert!((z - want).abs() < 3.0 * BESIDE, "{what}"),
                                    (None, None) => {
                                        let is_off = sides.iter().all(Option::is_none);
                                        assert_eq!(p.skip == Some(Skip::OffPart), is_off, "{what}");
                                    }
                                    _ => panic!("{what}"),
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}

#[test]
fn nothing_shows_through_where_a_line_leaves_an_edge_for_one_that_it_crosses_at_a_small_angle() {
    // The line y = 0 meets the edge from p to a within rounding near p, and then crosses that from a to b.
    let [p, a, b] = [[0.0, 0.0, 4.0], [-0.218263, -0.000955, 4.174478], [0.0, 0.003807, 4.174478]];
    let [c, d] = [[0.0, 0.015221, 4.348623], [-0.218761, 0.010448, 4.348623]];
    let e = [-0.218097, -0.004759, 4.0];
    let base = square(-10.0, -10.0, 10.0, 10.0).map(|[x, y]| [x, y, 0.0]);
    let facets = [[a, e, p], [a, p, b], [a, b, c], [a, c, d], [base[0], base[1], base[2]], [base[0], base[2], base[3]]];
    for (order, winding) in (0..14).flat_map(|order| (0..4).map(move |winding| (order, winding))) {
        let surface = Surface::from_facets(shuffled(&facets, order, winding), &mut Vec::new()).expect("a surface");
        let mut tracer = Tracer::new(&surface, LIMIT);
        let ends = [-0.21, 0.0].map(|x| P2::from_mm(x, 0.0).expect("near"));
        for [from, to] in [ends, [ends[1], ends[0]]] {
            tracer.segment(from, to, |piece| {
                assert_eq!(piece.skip, Some(Skip::Steep), "order {order}, winding {winding}: {piece:?}");
            });
        }
    }
}
