//! The walk against brute force: at many places of random strokes on random and nasty meshes, what the walk says is
//! checked against every facet on its own. A place within [`NEAR`] of a facet's border may count as on it or off it;
//! everywhere else there is one right answer.

use super::{Cursor, Heightmap, Samples, Span, Surface};
use terrace_core::geom::{NM_PER_MM, P2};
use terrace_core::math;
use terrace_core::random::Random;

/// Both the stroke's points and the facets' corners lie on the grid, and the walk closes what the grid
/// cannot hold: nm.
const NEAR: f64 = 2.0;

type Corner = [i64; 3];
type Facet = [Corner; 3];

/// A sheet of n x m cells over `size`, nodes moved by up to `jitter` of a cell (above 0.5 it folds).
fn sheet(noise: &mut Random, [w, h]: [i64; 2], jitter: f64, tall: i64) -> Vec<Facet> {
    let (n, m) = (1 + noise.below(7), 1 + noise.below(7));
    let at = [noise.between(-w / 3, w / 3), noise.between(-h / 3, h / 3), noise.between(-tall, tall)];
    let flat = noise.chance(30);
    let cell = [w / n as i64, h / m as i64];
    let mut nodes = Vec::new();
    for j in 0..=m {
        for i in 0..=n {
            let inner = i > 0 && i < n && j > 0 && j < m || jitter > 0.6;
            let mut move_by = |c: i64| {
                let most = (c as f64 * jitter) as i64;
                if inner { noise.between(-most, most) } else { 0 }
            };
            let p = [i as i64 * cell[0] + move_by(cell[0]), j as i64 * cell[1] + move_by(cell[1])];
            let z = if flat { 0 } else { noise.between(-tall, tall) };
            nodes.push([at[0] + p[0], at[1] + p[1], at[2] + z]);
        }
    }
    let node = |i: usize, j: usize| nodes[j * (n + 1) + i];
    let mut out = Vec::new();
    for j in 0..m {
        for i in 0..n {
            let (a, b, c, d) = (node(i, j), node(i + 1, j), node(i + 1, j + 1), node(i, j + 1));
            out.extend(if noise.chance(50) { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] });
        }
    }
    out
}

/// An upright prism over a rectangle, closed on all sides.
fn solid(noise: &mut Random, [w, h]: [i64; 2], tall: i64) -> Vec<Facet> {
    let (x0, y0) = (noise.between(-w / 2, w / 4), noise.between(-h / 2, h / 4));
    let (x1, y1) = (x0 + noise.between(1, w / 2 + 1), y0 + noise.between(1, h / 2 + 1));
    let (z0, z1) = (-noise.between(0, tall), noise.between(1, tall + 1));
    let ring = [[x0, y0], [x1, y0], [x1, y1], [x0, y1]];
    let up = |[x, y]: [i64; 2], z: i64| [x, y, z];
    let mut out = Vec::new();
    for (z, turned) in [(z0, true), (z1, false)] {
        let [a, b, c, d] = ring.map(|p| up(p, z));
        out.extend(if turned { [[a, c, b], [a, d, c]] } else { [[a, b, c], [a, c, d]] });
    }
    for k in 0..4 {
        let (p, q) = (ring[k], ring[(k + 1) % 4]);
        out.extend([[up(p, z0), up(q, z0), up(q, z1)], [up(p, z0), up(q, z1), up(p, z1)]]);
    }
    out
}

fn soup(noise: &mut Random, count: usize, mut corner: impl FnMut(&mut Random) -> Corner) -> Vec<Facet> {
    (0..count).map(|_| [corner(noise), corner(noise), corner(noise)]).collect()
}

/// Facets that are 1 to 10 nm wide.
fn needles(noise: &mut Random, [w, h]: [i64; 2], tall: i64) -> Vec<Facet> {
    let count = 1 + noise.below(12);
    (0..count).map(|_| needle(noise, [w, h], tall)).collect()
}

fn needle(noise: &mut Random, [w, h]: [i64; 2], tall: i64) -> Facet {
    let a = [noise.between(-w, w), noise.between(-h, h), noise.between(-tall, tall)];
    let b = match noise.below(3) {
        0 => [a[0] + noise.between(-w, w), a[1], noise.between(-tall, tall)],
        1 => [a[0], a[1] + noise.between(-h, h), noise.between(-tall, tall)],
        _ => [noise.between(-w, w), noise.between(-h, h), noise.between(-tall, tall)],
    };
    let near = if noise.chance(50) { a } else { b };
    [a, b, [near[0] + noise.between(-10, 10), near[1] + noise.between(-10, 10), noise.between(-tall, tall)]]
}

/// Facets around one vertex.
fn fan(noise: &mut Random, [w, h]: [i64; 2], tall: i64) -> Vec<Facet> {
    let n = 3 + noise.below(30);
    let hub = [0, 0, noise.between(-tall, tall)];
    let rim: Vec<Corner> = (0..n)
        .map(|i| {
            let angle = i as f64 / n as f64 * std::f64::consts::TAU;
            let far = |side: i64, of: f64| (side as f64 / 2.0 * of) as i64;
            [far(w, math::cos(angle)), far(h, math::sin(angle)), noise.between(-tall, tall)]
        })
        .collect();
    (0..n).map(|i| [hub, rim[i], rim[(i + 1) % n]]).collect()
}

fn mesh(noise: &mut Random) -> Vec<Facet> {
    let side = [20, 2_000, 70_000, 1_000_000, 100_000_000, 1_500_000_000][noise.below(6)];
    let size = match noise.below(6) {
        0 => [side, (side / 1000).max(3)],
        1 => [(side / 50_000).max(3), side],
        _ => [side, side * 2 / 3],
    };
    let tall = if noise.chance(80) { (size[0].max(size[1]) / 20).max(1) } else { side };
    let mut facets = Vec::new();
    for _ in 0..1 + noise.below(3) {
        facets.extend(match noise.below(9) {
            0 | 1 => sheet(noise, size, 0.3, tall),
            2 => sheet(noise, size, 0.0, tall),
            3 => sheet(noise, size, 0.9, tall),
            4 => solid(noise, size, tall),
            5 => {
                let count = 1 + noise.below(20);
                soup(noise, count, |n| {
                    [n.between(-size[0], size[0]), n.between(-size[1], size[1]), n.between(-tall, tall)]
                })
            }
            6 => needles(noise, size, tall),
            7 => fan(noise, size, tall),
            // Tiny ones among the large.
            _ => {
                let (x, y) = (noise.between(-size[0], size[0]), noise.between(-size[1], size[1]));
                let small = sheet(noise, size.map(|s| (s / 1000).max(7)), 0.3, tall / 100 + 1);
                small.into_iter().map(|f| f.map(|[a, b, c]| [a + x, b + y, c])).collect()
            }
        });
    }
    damage(noise, &mut facets);
    facets
}

/// Turned, doubled, missing, degenerate and cracked facets.
fn damage(noise: &mut Random, facets: &mut Vec<Facet>) {
    for i in 0..facets.len() {
        match noise.below(40) {
            0..8 => facets[i].swap(0, 1),
            8..16 => facets[i].rotate_left(1),
            16 => facets.push(facets[i]),
            17 => facets[i][0] = facets[i][1],
            18 => facets[i][noise.below(3)][0] += noise.between(-3, 3),
            19 => facets[i][noise.below(3)][1] += noise.between(-1, 1),
            20 => {
                // A T-junction: one of a pair is cut in two, its neighbour is not.
                let [a, b, c] = facets[i];
                let m = [0, 1, 2].map(|k| (a[k] + b[k]) / 2);
                facets[i] = [a, m, c];
                facets.push([m, b, c]);
            }
            _ => {}
        }
    }
    if noise.chance(20) && facets.len() > 2 {
        let gone = noise.below(facets.len());
        facets.swap_remove(gone);
    }
    for i in (1..facets.len()).rev() {
        let j = noise.below(i + 1);
        facets.swap(i, j);
    }
}

/// The next point of a stroke: anywhere, on a corner, on an edge, on a bin line, or a step away.
fn place(noise: &mut Random, facets: &[Facet], surface: &Surface, last: P2) -> P2 {
    let all = facets.iter().flatten();
    let min = |k: usize| all.clone().map(|c| c[k]).min().unwrap_or(0);
    let max = |k: usize| all.clone().map(|c| c[k]).max().unwrap_or(0);
    let (lo, hi) = (<P2>::new(min(0), min(1)), <P2>::new(max(0), max(1)));
    let (w, h) = (hi.x - lo.x, hi.y - lo.y);
    let f = facets[noise.below(facets.len())];
    let anywhere =
        |n: &mut Random| P2::new(n.between(lo.x - w / 8, hi.x + w / 8), n.between(lo.y - h / 8, hi.y + h / 8));
    let p = match noise.below(10) {
        0..3 => anywhere(noise),
        3..5 => {
            let c = f[noise.below(3)];
            P2::new(c[0], c[1])
        }
        5 => {
            let (a, b, t) = (f[0], f[1], noise.between(-200, 1200) as f64 / 1000.0);
            P2::new(a[0], a[1]).lerp(P2::new(b[0], b[1]), t)
        }
        6 => {
            let axis = noise.below(2);
            let line = surface.bin_line(axis, noise.between(0, surface.bin_count(axis)));
            let (o, q) = (surface.origin(), anywhere(noise));
            if axis == 0 { P2::new(o.x + line, q.y) } else { P2::new(q.x, o.y + line) }
        }
        7 => P2::new(last.x + noise.between(-1, 1), last.y + noise.between(-1, 1)),
        8 => P2::new(last.x, anywhere(noise).y),
        _ => P2::new(anywhere(noise).x, last.y),
    };
    if noise.chance(10) { P2::new(p.x + noise.between(-1, 1), p.y + noise.between(-1, 1)) } else { p }
}

/// What one facet says of a place.
#[derive(Debug)]
struct FacetView {
    /// How far inside the facet's border it lies, nm; negative outside.
    depth: f64,
    /// The height of the facet's plane there.
    z: f64,
    /// How much the height may change within [`NEAR`].
    tolerance: f64,
}

fn view(f: &Facet, [x, y]: [f64; 2]) -> Option<FacetView> {
    let o = f[0];
    let q = |c: Corner| [(c[0] - o[0]) as f64, (c[1] - o[1]) as f64, (c[2] - o[2]) as f64];
    let (b, c) = (q(f[1]), q(f[2]));
    let exact = i128::from(f[1][0] - o[0]) * i128::from(f[2][1] - o[1])
        - i128::from(f[1][1] - o[1]) * i128::from(f[2][0] - o[0]);
    if exact == 0 {
        return None;
    }
    let area = exact as f64;
    let p = [x - o[0] as f64, y - o[1] as f64];
    let corners = [[0.0, 0.0, 0.0], b, c];
    let mut depth = f64::INFINITY;
    let mut outside = 0f64;
    for k in 0..3 {
        let (u, v) = (corners[k], corners[(k + 1) % 3]);
        let d = [v[0] - u[0], v[1] - u[1]];
        let len = math::hypot(d[0], d[1]);
        depth = depth.min((d[0] * (p[1] - u[1]) - d[1] * (p[0] - u[0])) / len * area.signum());
        let t = (((p[0] - u[0]) * d[0] + (p[1] - u[1]) * d[1]) / (len * len)).clamp(0.0, 1.0);
        let away = math::hypot(p[0] - u[0] - t * d[0], p[1] - u[1] - t * d[1]);
        outside = if k == 0 { away } else { outside.min(away) };
    }
    let depth = if depth < 0.0 { -outside } else { depth };
    let n = [b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2]];
    let slope = math::hypot(n[0] / area, n[1] / area);
    let z = -(n[0] * p[0] + n[1] * p[1]) / area;
    let (lo, hi) = (b[2].min(c[2]).min(0.0), b[2].max(c[2]).max(0.0));
    let tolerance = (slope * 2.0 * NEAR).min(hi - lo) + 1.0;
    Some(FacetView { depth, z: z.clamp(lo, hi) + o[2] as f64, tolerance })
}

/// Holds the spans of one stroke against all facets.
fn judge(facets: &[Facet], a: P2, b: P2, spans: &[Span]) -> Result<(), String> {
    if spans.is_empty() || spans[0].t0 != 0.0 || spans[spans.len() - 1].t1 != 1.0 {
        return Err("spans do not reach from 0 to 1".into());
    }
    if let Some(w) = spans.windows(2).find(|w| w[0].t1 != w[1].t0) {
        return Err(format!("spans do not join at {} and {}", w[0].t1, w[1].t0));
    }
    if let Some(s) = spans.iter().find(|s| s.t0 >= s.t1) {
        return Err(format!("a span runs from {} to {}", s.t0, s.t1));
    }
    let (dx, dy) = ((b.x - a.x) as f64, (b.y - a.y) as f64);
    let at = |t: f64| [a.x as f64 + t * dx, a.y as f64 + t * dy];
    // Places: within every span, and between everything that any facet could change.
    let mut cuts: Vec<f64> = spans.iter().flat_map(|s| [s.t0, s.t1]).collect();
    for f in facets {
        for k in 0..3 {
            let (u, v) = (f[k], f[(k + 1) % 3]);
            let side = |c: Corner| dx * (c[1] - a.y) as f64 - dy * (c[0] - a.x) as f64;
            let (su, sv) = (side(u), side(v));
            if (su < 0.0) != (sv < 0.0) {
                let s = su / (su - sv);
                let p = [0, 1].map(|k| u[k] as f64 + s * (v[k] - u[k]) as f64);
                cuts.push(((p[0] - a.x as f64) * dx + (p[1] - a.y as f64) * dy) / (dx * dx + dy * dy));
            }
        }
    }
    cuts.retain(|t| (0.0..=1.0).contains(t));
    cuts.sort_by(f64::total_cmp);
    cuts.dedup();
    for w in cuts.windows(2) {
        let t = (w[0] + w[1]) / 2.0;
        let Some(span) = spans.iter().find(|s| s.t0 < t && t < s.t1) else { continue };
        let p = at(t);
        let views: Vec<FacetView> = facets.iter().filter_map(|f| view(f, p)).filter(|v| v.depth > -NEAR).collect();
        let inside = views.iter().filter(|v| v.depth > NEAR);
        let must = inside.map(|v| v.z - v.tolerance).fold(f64::NEG_INFINITY, f64::max);
        if span.facet().is_none() {
            if must > f64::NEG_INFINITY {
                return Err(format!("a gap at {t} where a facet is at height {must}"));
            }
            continue;
        }
        let z = span.z0 + (span.z1 - span.z0) * ((t - span.t0) / (span.t1 - span.t0));
        if z < must {
            return Err(format!("height {z} at {t} lies below a facet, {must}"));
        }
        if !views.iter().any(|v| (v.z - z).abs() <= v.tolerance) {
            return Err(format!("height {z} at {t} is not a facet's: {views:?}"));
        }
    }
    Ok(())
}

fn mm(facets: &[Facet]) -> Vec<[[f64; 3]; 3]> {
    facets.iter().map(|f| f.map(|c| c.map(|v| v as f64 / NM_PER_MM))).collect()
}

/// One random mesh and a few strokes on it; None where there is nothing to walk on.
fn trial(seed: u64) -> Option<Result<(), String>> {
    let mut noise = Random::case(seed);
    let facets = mesh(&mut noise);
    let surface = Surface::from_facets(mm(&facets), &mut Vec::new()).ok()?;
    let walked = walk_about(&mut noise, &facets, &surface);
    Some(walked.map_err(|fault| format!("seed {seed}: {fault} on {} facets", facets.len())))
}

/// A few strokes over a surface of these facets.
fn walk_about(noise: &mut Random, facets: &[Facet], surface: &Surface) -> Result<(), String> {
    let mut cursor = Cursor::default();
    let mut spans = Vec::new();
    let mut last = P2::new(0, 0);
    for _ in 0..25 {
        let p = place(noise, facets, surface, last);
        if p != last {
            surface.walk(last, p, &mut cursor, &mut spans);
            judge(facets, last, p, &spans).map_err(|fault| format!("{last:?} to {p:?}: {fault}"))?;
        }
        last = p;
    }
    Ok(())
}

fn trials(seeds: std::ops::Range<u64>) {
    let results: Vec<Result<(), String>> = seeds.clone().filter_map(trial).collect();
    let faults: Vec<&String> = results.iter().filter_map(|r| r.as_ref().err()).collect();
    assert!(results.len() * 10 > (seeds.end - seeds.start) as usize * 9, "{} of {seeds:?} are meshes", results.len());
    let shown: Vec<_> = faults.iter().take(12).collect();
    assert!(faults.is_empty(), "{} of {} seeds: {shown:#?}", faults.len(), results.len());
}

#[test]
fn walk_equals_brute_force_over_all_facets() {
    trials(0..250);
    // Sheets that tie on their own side, and across the line.
    trials(24_939..24_940);
    trials(49_808..49_809);
}

#[test]
#[ignore = "slow: make test-all"]
fn walk_equals_brute_force_over_all_facets_at_length() {
    trials(250..150_000);
}

#[test]
fn walk_on_a_height_map_equals_brute_force_over_its_facets() {
    height_maps(0..500);
}

#[test]
#[ignore = "slow: make test-all"]
fn walk_on_a_height_map_equals_brute_force_over_its_facets_at_length() {
    height_maps(500..50_000);
}

/// A height map is walked as its own facets are, holes included.
fn height_maps(seeds: std::ops::Range<u64>) {
    for seed in seeds {
        let mut noise = Random::case(seed);
        let (columns, rows) = (2 + noise.below(9), 2 + noise.below(9));
        let holes = [0, 5, 40][noise.below(3)];
        let sample = |n: &mut Random| if n.chance(holes) { 0 } else { 1 + n.below(500) as u16 };
        let samples: Vec<u16> = (0..columns * rows).map(|_| sample(&mut noise)).collect();
        let map = Heightmap {
            columns,
            rows,
            samples: Samples::Whole(samples, Some(0)),
            origin_mm: [noise.between(-5_000, 5_000) as f64 * 1e-3, noise.between(-5_000, 5_000) as f64 * 1e-3],
            pixel_mm: [1e-5, 0.000_333_333, 0.1, 1.0 / 3.0, 7.25][noise.below(5)],
            z_mm: [-0.01, 1e-4],
        };
        let mut facets = Vec::new();
        let nm = |v: f64| (v * NM_PER_MM).round() as i64;
        // Nodes are rounded from the map's corner.
        let o = map.origin_mm;
        map.facets(&mut |f| {
            facets.push(f.map(|[x, y, z]| {
                let grid = |v: f64, o: f64| nm(o) + nm(v - o);
                [grid(x, o[0]), grid(y, o[1]), nm(z)]
            }))
        });
        if facets.is_empty() {
            continue;
        }
        let surface = Surface::from_heightmap(map).expect("facets");
        let walked = walk_about(&mut noise, &facets, &surface);
        assert_eq!(walked, Ok(()), "seed {seed} on {columns} x {rows} samples");
    }
}
