//! A uniform grid over the mesh that says where the walk may run free.
//!
//! Every bin is *empty* (no facet), *simple* (no rim of the mesh passes through it and one sheet lies over all others)
//! or *complex* (the sheets must be compared). A rim is an edge without a twin: the number of sheets can change only
//! there, so a bin without rims has one number of sheets, counted at its centre. Bins know the facets whose box touches
//! them, padded by two nanometres, so that points on bin lines find their facets from either side, and places on a rim
//! the facet next to them.

use std::ops::Range;

use super::mesh::{Mesh, NONE, Vertex};
use rustc_hash::FxHashMap;
use terrace_core::geom::{Box2, Buckets, Grid, Nm, P2, orient};
use terrace_core::parallel;

/// What a bin holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Class {
    Empty,
    Simple,
    Complex,
}

/// The grid; coordinates are the mesh's local ones, nm.
#[derive(Debug)]
pub(crate) struct Bins {
    pub grid: Grid,
    pub class: Vec<Class>,
    facets: Buckets<u32>,
    /// Finer cells of crowded bins: many tiny facets next to huge ones.
    fine: FxHashMap<u32, Fine>,
}

/// The cells of one crowded bin.
#[derive(Debug)]
struct Fine {
    grid: Grid,
    facets: Buckets<u32>,
}

/// Facets per bin that the grid aims at.
const FACETS_PER_BIN: f64 = 2.0;
/// Facets from which a bin is divided again.
const CROWDED: usize = 64;
/// References per facet beyond which the cells of a crowded bin are made larger.
const MAX_FINE_REFS: u64 = 4;
/// Bins that a thread classifies one after another.
const AT_ONCE: usize = 1 << 13;
/// References per facet beyond which bins are made larger.
const MAX_REFS_PER_FACET: u64 = 12;

impl Bins {
    pub fn new(mesh: &Mesh) -> Self {
        let of_some = |facets: &[[u32; 3]]| {
            let mut area = <Box2>::EMPTY;
            facets.iter().flatten().for_each(|&v| area.add(mesh.vertices[v as usize].p2()));
            area
        };
        let parts: Vec<&[[u32; 3]]> = mesh.facets.chunks(AT_ONCE).collect();
        let all = parallel::map(parts.len(), |n| of_some(parts[n])).into_iter().fold(<Box2>::EMPTY, Box2::union);
        let (lo, hi) = (P2::new(all.lo.x - 2, all.lo.y - 2), all.hi);
        let (w, h) = (hi.x + 3 - lo.x, hi.y + 3 - lo.y);
        let area = w as f64 * h as f64 * FACETS_PER_BIN / mesh.facets.len() as f64;
        // A long thin part must not get more than a few bins per facet either.
        let mut size = (area.sqrt().ceil() as i64).max(w.max(h) / 65_000).max(1000);
        loop {
            let grid = Grid { origin: lo, pitch: [Nm(size); 2], count: [(w / size + 1) as u32, (h / size + 1) as u32] };
            // Large facets lie in many bins: bins grow until the references are few. In a single bin every facet
            // has one.
            let limit = if grid.len() == 1 { u64::MAX } else { mesh.facets.len() as u64 * MAX_REFS_PER_FACET + 64 };
            if let Some(facets) = listed(&grid, mesh, 0..mesh.facets.len() as u32, limit) {
                let mut bins = Self { grid, class: Vec::new(), facets, fine: FxHashMap::default() };
                bins.divide_crowded(mesh);
                bins.classify(mesh);
                return bins;
            }
            size *= 2;
        }
    }

    fn divide_crowded(&mut self, mesh: &Mesh) {
        let crowded = (0..self.grid.len()).filter(|&b| self.facets(b).len() > CROWDED);
        let fine = crowded.filter_map(|b| Some((b as u32, self.divide(mesh, b)?)));
        self.fine = fine.collect();
    }

    /// The cells of a crowded bin; None where they would not help: its facets are as large as it is.
    fn divide(&self, mesh: &Mesh, b: usize) -> Option<Fine> {
        let facets = self.facets(b);
        let Nm(size) = self.grid.pitch[0];
        let mut side = ((facets.len() as f64 / 2.0).sqrt() as i64).min(size);
        while side > 1 {
            let origin = self.grid.area(b).lo;
            let grid = Grid { origin, pitch: [Nm(size / side + 1); 2], count: [side as u32; 2] };
            let limit = facets.len() as u64 * MAX_FINE_REFS;
            if let Some(facets) = listed(&grid, mesh, facets.iter().copied(), limit) {
                return Some(Fine { grid, facets });
            }
            side /= 2;
        }
        None
    }

    /// Appends the facets of bin `b` that may lie under the line from `from` to `to`, which may reach
    /// beyond the bin.
    pub(crate) fn facets_under(&self, b: usize, from: P2, to: P2, out: &mut Vec<u32>) {
        let Some(Fine { grid, facets }) = self.fine.get(&(b as u32)) else {
            return out.extend_from_slice(self.facets(b));
        };
        grid.under(from, to, |cell| out.extend_from_slice(facets.of(cell)));
    }

    /// The facets whose padded box touches bin `b`.
    pub fn facets(&self, b: usize) -> &[u32] {
        self.facets.of(b)
    }

    fn classify(&mut self, mesh: &Mesh) {
        let mut class = vec![Class::Simple; self.grid.len()];
        // The number of sheets changes at rims only: every bin that one passes, or passes by a few nanometres, must
        // compare.
        for he in (0..mesh.twins.len()).filter(|&he| mesh.twins[he] == NONE) {
            let f = &mesh.facets[he / 3];
            let (a, b) = (mesh.vertices[f[he % 3] as usize], mesh.vertices[f[(he % 3 + 1) % 3] as usize]);
            self.grid.under(a.p2(), b.p2(), |bin| class[bin] = Class::Complex);
        }
        parallel::map_items(class.chunks_mut(AT_ONCE).collect(), |n, classes| {
            let mut sheet = Vec::new();
            for (b, class) in (n * AT_ONCE..).zip(classes) {
                if *class == Class::Simple {
                    *class = self.class_without_rim(mesh, b, self.grid.centre(b), &mut sheet);
                } else if self.facets(b).is_empty() {
                    *class = Class::Empty;
                }
            }
        });
        self.class = class;
    }

    fn class_without_rim(&self, mesh: &Mesh, b: usize, centre: P2, sheet: &mut Vec<u32>) -> Class {
        let facets = self.facets(b);
        let mut top: Option<(u32, f64)> = None;
        let mut sheets = 0;
        for &f in facets {
            if holds(mesh, f, centre) {
                sheets += 1;
                let z = height(mesh, f, centre);
                if top.is_none_or(|(_, t)| z > t) {
                    top = Some((f, z));
                }
            }
        }
        match (sheets, top) {
            (0, _) | (_, None) => Class::Empty,
            (1, _) => Class::Simple,
            (_, Some((top, _))) => {
                // Several sheets: free only if the topmost one, gathered from facet to facet, lies
                // wholly above all others here and is one sheet itself. Facets of a bin are sorted.
                let mut of_sheet = vec![false; facets.len()];
                let mut join = |f: u32, sheet: &mut Vec<u32>| {
                    if let Ok(i) = facets.binary_search(&f)
                        && !std::mem::replace(&mut of_sheet[i], true)
                    {
                        sheet.push(f);
                    }
                };
                sheet.clear();
                join(top, sheet);
                let mut next = 0;
                while next < sheet.len() {
                    for k in 0..3 {
                        let twin = mesh.twins[sheet[next] as usize * 3 + k];
                        if twin != NONE {
                            join(twin / 3, sheet);
                        }
                    }
                    next += 1;
                }
                let z = |f: u32| mesh.facets[f as usize].map(|v| mesh.vertices[v as usize].z);
                let lowest = sheet.iter().flat_map(|&f| z(f)).fold(f64::INFINITY, f64::min);
                let others = facets.iter().zip(&of_sheet).filter(|(_, of)| !**of).map(|(f, _)| f);
                let below = others.flat_map(|&f| z(f)).all(|z| z < lowest);
                let single = sheet.iter().filter(|&&f| holds(mesh, f, centre)).count() == 1;
                if below && single { Class::Simple } else { Class::Complex }
            }
        }
    }
}

/// The facets of every cell of a grid; None where that takes more than `limit` references.
fn listed(
    grid: &Grid,
    mesh: &Mesh,
    facets: impl Iterator<Item = u32> + Clone + Sync,
    limit: u64,
) -> Option<Buckets<u32>> {
    let area = |f: u32| around(mesh.facets[f as usize].map(|v| mesh.vertices[v as usize]));
    let mut total = 0;
    for f in facets.clone() {
        let Box2 { lo, hi } = area(f);
        total += (grid.range(0, lo.x, hi.x).len() * grid.range(1, lo.y, hi.y).len()) as u64;
        if total > limit {
            return None;
        }
    }
    let touched = |rows: Range<usize>, sink: &mut dyn FnMut(usize, Range<usize>, u32)| {
        for f in facets.clone() {
            let Box2 { lo, hi } = area(f);
            let of_facet = grid.range(1, lo.y, hi.y);
            let (first, end) = (of_facet.start.max(rows.start), of_facet.end.min(rows.end));
            if first < end {
                let across = grid.range(0, lo.x, hi.x);
                (first..end).for_each(|row| sink(row, across.clone(), f));
            }
        }
    };
    Some(Buckets::of_rows([grid.columns(), grid.rows()], &touched))
}

/// The box of a facet and two nanometres around it.
fn around(corners: [Vertex; 3]) -> Box2 {
    let mut area = Box2::EMPTY;
    corners.iter().for_each(|v| area.add(v.p2()));
    Box2 { lo: P2::new(area.lo.x - 2, area.lo.y - 2), hi: P2::new(area.hi.x + 2, area.hi.y + 2) }
}

/// Whether facet f holds the point shifted by an infinitesimal (ε, ε²): exactly one facet of a sheet
/// holds every point, those on edges and vertices included.
fn holds(mesh: &Mesh, f: u32, p: P2) -> bool {
    let c = mesh.facets[f as usize].map(|v| mesh.vertices[v as usize].p2());
    // Most facets of a bin do not reach its centre; their box says so at once.
    let beside = |get: fn(P2) -> i64| {
        let (v, [a, b, c]) = (get(p), c.map(get));
        v < a.min(b).min(c) || v > a.max(b).max(c)
    };
    if beside(|q| q.x) || beside(|q| q.y) {
        return false;
    }
    (0..3).all(|k| {
        let (a, b) = (c[k], c[(k + 1) % 3]);
        let o = orient(a, b, p);
        o > 0.0 || o == 0.0 && (b.y < a.y || b.y == a.y && b.x > a.x)
    })
}

/// Height of facet f's plane at p.
fn height(mesh: &Mesh, f: u32, p: P2) -> f64 {
    let c = mesh.facets[f as usize].map(|v| mesh.vertices[v as usize]);
    let w = [0, 1, 2].map(|k: usize| orient(c[(k + 1) % 3].p2(), c[(k + 2) % 3].p2(), p));
    (w[0] * c[0].z + w[1] * c[1].z + w[2] * c[2].z) / (w[0] + w[1] + w[2])
}
