//! A uniform grid over the mesh that says where the walk may run free.
//!
//! Every bin is *empty* (no facet), *simple* (no rim of the mesh passes through it and one sheet lies over all others)
//! or *complex* (the sheets must be compared). A rim is an edge without a twin: the number of sheets can change only
//! there, so a bin without rims has one number of sheets, counted at its centre. Bins know the facets whose box touches
//! them, padded by two nanometres, so that points on bin lines find their facets from either side, and places on a rim
//! the facet next to them.

use std::ops::Range;

use super::mesh::{Mesh, NONE};
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
        let chunks: Vec<&[[u32; 3]]> = mesh.facets.chunks(AT_ONCE).collect();
        let boxes = parallel::map(chunks.len(), |n| box_of(mesh, chunks[n]));
        let extent = boxes.into_iter().fold(<Box2>::EMPTY, Box2::union);
        // Facets are listed with two nanometres around them: the grid reaches as far, and its last line is open.
        let lo = P2::new(extent.lo.x - 2, extent.lo.y - 2);
        let (w, h) = (extent.hi.x + 3 - lo.x, extent.hi.y + 3 - lo.y);
        let area = w as f64 * h as f64 * FACETS_PER_BIN / mesh.facets.len() as f64;
        // A long thin part must not get more than a few bins per facet either. With some 65,000 bins along a side their
        // numbers are below 2^32.
        let mut size = (area.sqrt().ceil() as i64).max(w.max(h) / 65_000).max(1000);
        loop {
            let grid = Grid { origin: lo, pitch: [Nm(size); 2], count: [(w / size + 1) as u32, (h / size + 1) as u32] };
            // Large facets lie in many bins: bins grow until the references are few. In a single bin every facet
            // has one.
            let limit = if grid.len() == 1 { u64::MAX } else { mesh.facets.len() as u64 * MAX_REFS_PER_FACET + 64 };
            if let Some(facets) = facets_by_cell(&grid, mesh, 0..mesh.facets.len() as u32, limit) {
                let mut bins = Self { grid, class: Vec::new(), facets, fine: FxHashMap::default() };
                bins.divide_crowded(mesh);
                bins.classify(mesh);
                return bins;
            }
            size *= 2;
        }
    }

    /// Gives every crowded bin finer cells.
    fn divide_crowded(&mut self, mesh: &Mesh) {
        let crowded = (0..self.grid.len()).filter(|&b| self.facets(b).len() > CROWDED);
        let fine = crowded.filter_map(|b| Some((b as u32, self.divide(mesh, b)?)));
        self.fine = fine.collect();
    }

    /// The cells of a crowded bin; None where they would not help: its facets are as large as it is.
    fn divide(&self, mesh: &Mesh, b: usize) -> Option<Fine> {
        let facets = self.facets(b);
        let Nm(size) = self.grid.pitch[0];
        // About two facets a cell, and no cell below a nanometre.
        let mut side = ((facets.len() as f64 / FACETS_PER_BIN).sqrt() as i64).min(size);
        while side > 1 {
            let origin = self.grid.area(b).lo;
            let grid = Grid { origin, pitch: [Nm(size / side + 1); 2], count: [side as u32; 2] };
            let limit = facets.len() as u64 * MAX_FINE_REFS;
            if let Some(facets) = facets_by_cell(&grid, mesh, facets.iter().copied(), limit) {
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

    /// Finds the class of every bin.
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

    /// The class of a bin that no rim passes: the number of sheets is the same all over it, and is counted at its
    /// centre.
    fn class_without_rim(&self, mesh: &Mesh, b: usize, centre: P2, sheet: &mut Vec<u32>) -> Class {
        let mut top: Option<(u32, f64)> = None;
        let mut sheets = 0;
        for &f in self.facets(b) {
            if holds(mesh, f, centre) {
                sheets += 1;
                let z = height(mesh, f, centre);
                if top.is_none_or(|(_, top_z)| z > top_z) {
                    top = Some((f, z));
                }
            }
        }
        match (sheets, top) {
            (0, _) | (_, None) => Class::Empty,
            (1, _) => Class::Simple,
            (_, Some((top, _))) if self.is_sheet_free(mesh, b, top, centre, sheet) => Class::Simple,
            _ => Class::Complex,
        }
    }

    /// Whether the sheet of facet `top`, which is topmost at the centre of bin `b`, lies wholly above all other facets
    /// of the bin and is one sheet itself, so that the walk may stay on it. `sheet` is scratch.
    fn is_sheet_free(&self, mesh: &Mesh, b: usize, top: u32, centre: P2, sheet: &mut Vec<u32>) -> bool {
        let facets = self.facets(b);
        let is_in_sheet = gather_sheet(mesh, facets, top, sheet);
        let z = |f: u32| mesh.facets[f as usize].map(|v| mesh.vertices[v as usize].z);
        let lowest = sheet.iter().flat_map(|&f| z(f)).fold(f64::INFINITY, f64::min);
        let mut others = facets.iter().zip(&is_in_sheet).filter(|(_, is_in_sheet)| !**is_in_sheet);
        let is_above_others = others.all(|(&f, _)| z(f).into_iter().all(|z| z < lowest));
        // Facets that hang together may lie over the centre more than once.
        is_above_others && sheet.iter().filter(|&&f| holds(mesh, f, centre)).count() == 1
    }
}

/// Gathers the facets that hang together with `first` within a bin, whose facets are sorted, into `sheet`. Returns of
/// each of the bin's facets whether it is among them.
fn gather_sheet(mesh: &Mesh, facets: &[u32], first: u32, sheet: &mut Vec<u32>) -> Vec<bool> {
    let mut is_in_sheet = vec![false; facets.len()];
    sheet.clear();
    add_once(first, facets, &mut is_in_sheet, sheet);
    // The neighbours of all facets before number `next` have been looked at.
    let mut next = 0;
    while next < sheet.len() {
        for k in 0..3 {
            let twin = mesh.twins[sheet[next] as usize * 3 + k];
            if twin != NONE {
                add_once(twin / 3, facets, &mut is_in_sheet, sheet);
            }
        }
        next += 1;
    }
    is_in_sheet
}

/// Appends facet `f` to a sheet if it is one of a bin's facets and not in the sheet yet.
fn add_once(f: u32, facets: &[u32], is_in_sheet: &mut [bool], sheet: &mut Vec<u32>) {
    if let Ok(i) = facets.binary_search(&f)
        && !std::mem::replace(&mut is_in_sheet[i], true)
    {
        sheet.push(f);
    }
}

/// The box of some facets.
fn box_of(mesh: &Mesh, facets: &[[u32; 3]]) -> Box2 {
    let mut extent = Box2::EMPTY;
    facets.iter().flatten().for_each(|&v| extent.add(mesh.vertices[v as usize].p2()));
    extent
}

/// The facets of every cell of a grid; None where that takes more than `limit` references.
fn facets_by_cell(
    grid: &Grid,
    mesh: &Mesh,
    facets: impl Iterator<Item = u32> + Clone + Sync,
    limit: u64,
) -> Option<Buckets<u32>> {
    let mut total = 0;
    for f in facets.clone() {
        let Box2 { lo, hi } = box_around(mesh, f);
        total += (grid.range(0, lo.x, hi.x).len() * grid.range(1, lo.y, hi.y).len()) as u64;
        if total > limit {
            return None;
        }
    }
    let in_rows = |rows: Range<usize>, sink: &mut dyn FnMut(usize, Range<usize>, u32)| {
        facets.clone().for_each(|f| cells_of(grid, box_around(mesh, f), &rows, |row, across| sink(row, across, f)));
    };
    Some(Buckets::of_rows([grid.columns(), grid.rows()], &in_rows))
}

/// Hands each row of the grid that a box touches, of `rows` alone, and the columns that it touches there to `sink`.
fn cells_of(grid: &Grid, Box2 { lo, hi }: Box2, rows: &Range<usize>, mut sink: impl FnMut(usize, Range<usize>)) {
    let touched = grid.range(1, lo.y, hi.y);
    let (first, end) = (touched.start.max(rows.start), touched.end.min(rows.end));
    if first < end {
        let across = grid.range(0, lo.x, hi.x);
        (first..end).for_each(|row| sink(row, across.clone()));
    }
}

/// The box of facet `f` and two nanometres around it.
fn box_around(mesh: &Mesh, f: u32) -> Box2 {
    let Box2 { lo, hi } = box_of(mesh, &[mesh.facets[f as usize]]);
    Box2 { lo: P2::new(lo.x - 2, lo.y - 2), hi: P2::new(hi.x + 2, hi.y + 2) }
}

/// Whether facet f holds the point shifted by an infinitesimal (ε, ε²): exactly one facet of a sheet
/// holds every point, those on edges and vertices included.
fn holds(mesh: &Mesh, f: u32, p: P2) -> bool {
    let c = mesh.facets[f as usize].map(|v| mesh.vertices[v as usize].p2());
    // Most facets of a bin do not reach its centre; their box says so at once.
    if is_beside(p.x, c.map(|q| q.x)) || is_beside(p.y, c.map(|q| q.y)) {
        return false;
    }
    (0..3).all(|k| {
        let (a, b) = (c[k], c[(k + 1) % 3]);
        let o = orient(a, b, p);
        o > 0.0 || o == 0.0 && (b.y < a.y || b.y == a.y && b.x > a.x)
    })
}

/// Whether a coordinate lies beyond those of all three corners.
fn is_beside(v: i64, [a, b, c]: [i64; 3]) -> bool {
    v < a.min(b).min(c) || v > a.max(b).max(c)
}

/// Height of facet f's plane at p.
fn height(mesh: &Mesh, f: u32, p: P2) -> f64 {
    let c = mesh.facets[f as usize].map(|v| mesh.vertices[v as usize]);
    let w = [0, 1, 2].map(|k: usize| orient(c[(k + 1) % 3].p2(), c[(k + 2) % 3].p2(), p));
    (w[0] * c[0].z + w[1] * c[1].z + w[2] * c[2].z) / (w[0] + w[1] + w[2])
}
