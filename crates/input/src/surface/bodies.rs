//! The bodies of a surface file: connected facets, their boxes, and whether each is closed.
//!
//! Consumes facets as the file has them, mm. Corners that are equal to the nanometre are one, as in the mesh. Promises
//! one [`Body`] for each set of facets that share corners, the largest first. Needs about 100 bytes a facet; nothing of
//! it is used to plan a job.

use std::collections::hash_map::Entry;

use rustc_hash::FxHashMap;

use terrace_core::diag::{Diag, Place};
use terrace_core::geom::{BoxMm, NM_PER_MM, SpacePoint};

/// Facets that are connected by shared corners; two boxes that touch in one corner are one body.
#[derive(Clone, Debug, PartialEq)]
pub struct Body {
    /// How many.
    pub facets: usize,
    /// The box of the body's facets, mm.
    pub bounds: BoxMm<3>,
    /// Edges of one facet alone, and the middle of the first of them.
    pub open_edges: (usize, Option<SpacePoint>),
    /// Whether the normals of its facets nearly cancel, as those of a closed body do; edges may still be open.
    pub is_solid: bool,
}

/// Collects the facets of a file.
#[derive(Default)]
pub struct Bodies {
    corners: FxHashMap<[i64; 3], u32>,
    places: Vec<SpacePoint>,
    /// The corner that stands for each corner's body, as far as it is known.
    joined: Vec<u32>,
    facets: Vec<[u32; 3]>,
}

/// From this share of its area on, a sum of the area vectors of its facets is that of an open sheet; a closed body has 0,
/// a cube without one face 0.2: it counts as solid, with a hole.
const OPEN_SHEET_SHARE: f64 = 0.3;

/// Most bodies that are listed one by one.
pub const MAX_TOLD: usize = 10;

impl Bodies {
    /// Takes a facet, corners in mm.
    pub fn facet(&mut self, facet: [SpacePoint; 3]) {
        if !facet.iter().flatten().all(|v| v.abs() < 1e9) {
            return;
        }
        let ids = facet.map(|p| {
            let next = self.places.len() as u32;
            match self.corners.entry(p.map(|v| (v * NM_PER_MM).round() as i64)) {
                Entry::Occupied(known) => *known.get(),
                Entry::Vacant(free) => {
                    self.places.push(p);
                    self.joined.push(next);
                    *free.insert(next)
                }
            }
        });
        if ids[0] == ids[1] || ids[1] == ids[2] || ids[2] == ids[0] {
            return;
        }
        let [a, b, c] = ids.map(|id| self.root(id));
        let root = a.min(b).min(c);
        [a, b, c].into_iter().for_each(|id| self.joined[id as usize] = root);
        self.facets.push(ids);
    }

    /// The corner that stands for all that a corner is joined with; ways to it are halved.
    fn root(&mut self, mut id: u32) -> u32 {
        while self.joined[id as usize] != id {
            let up = self.joined[self.joined[id as usize] as usize];
            self.joined[id as usize] = up;
            id = up;
        }
        id
    }

    /// The bodies, the largest first.
    pub fn finish(mut self) -> Vec<Body> {
        let facets = std::mem::take(&mut self.facets);
        let mut edges: FxHashMap<[u32; 2], u32> = FxHashMap::default();
        for f in &facets {
            for k in 0..3 {
                let (a, b) = (f[k], f[(k + 1) % 3]);
                *edges.entry([a.min(b), a.max(b)]).or_default() += 1;
            }
        }
        let mut sums: FxHashMap<u32, BodySum> = FxHashMap::default();
        for f in &facets {
            let root = self.root(f[0]);
            let sum = sums.entry(root).or_default();
            sum.add(f.map(|id| self.places[id as usize]));
            for k in 0..3 {
                let (a, b) = (f[k], f[(k + 1) % 3]);
                if edges[&[a.min(b), a.max(b)]] == 1 {
                    sum.add_open_edge([a, b].map(|id| self.places[id as usize]));
                }
            }
        }
        let mut bodies: Vec<Body> = sums.into_values().map(BodySum::body).collect();
        bodies.sort_by(|a, b| {
            // In an order that is not that of the hash map.
            let by_corner = || a.bounds.lo.partial_cmp(&b.bounds.lo).expect("finite corners");
            b.facets.cmp(&a.facets).then_with(by_corner)
        });
        bodies
    }
}

/// The facets of a body, summed up.
struct BodySum {
    facets: usize,
    bounds: BoxMm<3>,
    /// Twice the sum of the areas as vectors, and twice that of their sizes.
    area_vector: SpacePoint,
    area: f64,
    open_edges: (usize, Option<SpacePoint>),
}

impl Default for BodySum {
    fn default() -> Self {
        Self { facets: 0, bounds: BoxMm::EMPTY, area_vector: [0.0; 3], area: 0.0, open_edges: (0, None) }
    }
}

impl BodySum {
    fn add(&mut self, corners: [SpacePoint; 3]) {
        self.facets += 1;
        corners.iter().for_each(|p| self.bounds.add(*p));
        let [u, v] = [1, 2].map(|k| [0, 1, 2].map(|i| corners[k][i] - corners[0][i]));
        let normal = [0, 1, 2].map(|i| u[(i + 1) % 3] * v[(i + 2) % 3] - u[(i + 2) % 3] * v[(i + 1) % 3]);
        self.area += normal.iter().map(|n| n * n).sum::<f64>().sqrt();
        self.area_vector = [0, 1, 2].map(|i| self.area_vector[i] + normal[i]);
    }

    fn add_open_edge(&mut self, [a, b]: [SpacePoint; 2]) {
        self.open_edges.0 += 1;
        self.open_edges.1.get_or_insert([0, 1, 2].map(|i| (a[i] + b[i]) / 2.0));
    }

    fn body(self) -> Body {
        // Both are doubled: only their ratio counts.
        let net = self.area_vector.iter().map(|v| v * v).sum::<f64>().sqrt();
        let is_solid = net < OPEN_SHEET_SHARE * self.area;
        Body { facets: self.facets, bounds: self.bounds, open_edges: self.open_edges, is_solid }
    }
}

impl Body {
    /// Whether it lies above another: over some of it in plan, and higher.
    pub(crate) fn is_above(&self, other: &Self) -> bool {
        let (a, b) = (&self.bounds, &other.bounds);
        let over = (0..2).all(|k| a.lo[k] < b.hi[k] && b.lo[k] < a.hi[k]);
        over && a.hi[2] > b.hi[2] && a.lo[2] >= (b.lo[2] + b.hi[2]) / 2.0
    }
}

/// What a user should know of the bodies of a file before it is marked: holes in closed ones, and one above another.
pub fn warnings(bodies: &[Body], place: &Place) -> Vec<Diag> {
    let shown = |p: SpacePoint| format!("({:.3}, {:.3}, {:.3})", p[0], p[1], p[2]);
    let mut out = Vec::new();
    let holed = |b: &&Body| b.is_solid && b.open_edges.0 > 0;
    if let Some(first) = bodies.iter().find(holed) {
        let text = format!(
            "{} of {} bodies are closed but for holes: {} open edges, one near {}; what the lens sees through them would be \
             marked",
            bodies.iter().filter(holed).count(),
            bodies.len(),
            bodies.iter().filter(holed).map(|b| b.open_edges.0).sum::<usize>(),
            shown(first.open_edges.1.unwrap_or_default()),
        );
        let hint = "export the part again, or close the holes, unless they are meant";
        out.push(Diag::warning("surface-hole", text).at(place.clone()).hint(hint));
    }
    // Of very many bodies the largest.
    const MOST: usize = 1000;
    let some = &bodies[..bodies.len().min(MOST)];
    let above = some.iter().enumerate().find_map(|(i, a)| {
        let below = some.iter().enumerate().find(|(k, b)| *k != i && a.is_above(b))?;
        Some((i + 1, a, below.0 + 1))
    });
    if let Some((upper, body, lower)) = above {
        let text = format!(
            "body {upper}, from {} to {}, lies above body {lower}: where it does, it is marked in place of that",
            shown(body.bounds.lo),
            shown(body.bounds.hi)
        );
        let hint =
            "take it out of the file if it is a clamp, a helper or another part; `terrace inspect` lists all bodies";
        out.push(Diag::warning("surface-above", text).at(place.clone()).hint(hint));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The facets of an upright box, the top with two, one or no facets.
    fn block(lo: SpacePoint, hi: SpacePoint, tops: usize) -> Vec<[SpacePoint; 3]> {
        let at = |i: usize, up: bool| {
            let [x, y] = [[lo[0], lo[1]], [hi[0], lo[1]], [hi[0], hi[1]], [lo[0], hi[1]]][i % 4];
            [x, y, if up { hi[2] } else { lo[2] }]
        };
        let mut out = vec![[at(0, false), at(2, false), at(1, false)], [at(0, false), at(3, false), at(2, false)]];
        out.extend(
            [[at(0, true), at(1, true), at(2, true)], [at(0, true), at(2, true), at(3, true)]].iter().take(tops),
        );
        for i in 0..4 {
            out.push([at(i, false), at(i + 1, false), at(i + 1, true)]);
            out.push([at(i, false), at(i + 1, true), at(i, true)]);
        }
        out
    }

    fn found(facets: Vec<[SpacePoint; 3]>) -> (Vec<Body>, Vec<&'static str>) {
        let mut bodies = Bodies::default();
        facets.into_iter().for_each(|f| bodies.facet(f));
        let bodies = bodies.finish();
        let codes = warnings(&bodies, &Place::Nowhere).iter().map(|d| d.code).collect();
        (bodies, codes)
    }

    #[test]
    fn bodies_holes_and_what_lies_above_are_reported() {
        let plate = || block([0.0; 3], [40.0, 30.0, 10.0], 2);
        let (bodies, codes) = found(plate());
        assert_eq!((bodies.len(), bodies[0].facets, bodies[0].open_edges.0), (1, 12, 0));
        assert!(bodies[0].is_solid && codes.is_empty());
        let (bodies, codes) = found(block([0.0; 3], [40.0, 30.0, 10.0], 1));
        assert_eq!((bodies[0].open_edges.0, codes), (3, vec!["surface-hole"]));
        let beside = block([50.0, 0.0, 0.0], [60.0, 30.0, 30.0], 2);
        let (bodies, codes) = found([plate(), beside].concat());
        assert_eq!((bodies.len(), codes.len()), (2, 0));
        let above = block([5.0, 5.0, 12.0], [15.0, 15.0, 30.0], 2);
        let (bodies, codes) = found([plate(), above].concat());
        assert_eq!((bodies.len(), codes), (2, vec!["surface-above"]));
        assert_eq!(bodies[1].bounds.hi[2], 30.0);
        // An open sheet has a rim and no holes.
        let (bodies, codes) = found(vec![[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]]);
        assert!(!bodies[0].is_solid && bodies[0].open_edges.0 == 3 && codes.is_empty());
    }
}
