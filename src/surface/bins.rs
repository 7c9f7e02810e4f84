//! A uniform grid over the mesh that says where the walk may run free.
//!
//! Every bin is *empty* (no facet), *simple* (no rim of the mesh passes through it and one sheet lies
//! over all others) or *complex* (the sheets must be compared). A rim is an edge without a twin: the
//! number of sheets can change only there, so a bin without rims has one number of sheets, counted at
//! its centre. Bins know the facets whose box touches them, padded by two nanometres, so that points on
//! bin lines find their facets from either side, and places on a rim the facet beside them.

use super::mesh::{Mesh, NONE, Vertex};
use crate::geom::{Box2, P2, orient};
use rustc_hash::FxHashMap;

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
    pub lo: P2,
    pub size: i64,
    pub count: [usize; 2],
    pub class: Vec<Class>,
    starts: Vec<u32>,
    refs: Vec<u32>,
    /// Finer cells of crowded bins: many tiny facets beside huge ones.
    fine: FxHashMap<u32, Fine>,
}

/// The cells of one crowded bin.
#[derive(Debug)]
struct Fine {
    cells: Cells,
    starts: Vec<u32>,
    refs: Vec<u32>,
}

/// Facets per bin that the grid aims at.
const FACETS_PER_BIN: f64 = 2.0;
/// Facets from which a bin is divided again.
const CROWDED: usize = 64;
/// References per facet beyond which the cells of a crowded bin are made larger.
const MAX_FINE_REFS: u64 = 4;
/// References per facet beyond which bins are made larger.
const MAX_REFS_PER_FACET: u64 = 12;

impl Bins {
    pub fn new(mesh: &Mesh) -> Self {
        let Box2 { mut lo, mut hi } = <Box2>::EMPTY;
        for v in mesh.facets.iter().flatten().map(|&v| mesh.vertices[v as usize]) {
            lo = P2::new(lo.x.min(v.x.into()), lo.y.min(v.y.into()));
            hi = P2::new(hi.x.max(v.x.into()), hi.y.max(v.y.into()));
        }
        let lo = P2::new(lo.x - 2, lo.y - 2);
        let (w, h) = (hi.x + 3 - lo.x, hi.y + 3 - lo.y);
        let area = w as f64 * h as f64 * FACETS_PER_BIN / mesh.facets.len() as f64;
        // A long thin part must not get more than a few bins per facet either.
        let mut size = (area.sqrt().ceil() as i64).max(w.max(h) / 65_000).max(1000);
        loop {
            let count = [(w / size + 1) as usize, (h / size + 1) as usize];
            let mut bins = Self {
                lo,
                size,
                count,
                class: Vec::new(),
                starts: Vec::new(),
                refs: Vec::new(),
                fine: FxHashMap::default(),
            };
            let limit = mesh.facets.len() as u64 * MAX_REFS_PER_FACET + 64;
            if bins.fill(mesh, if count == [1, 1] { u64::MAX } else { limit }) {
                bins.divide_crowded(mesh);
                bins.classify(mesh);
                return bins;
            }
            size *= 2;
        }
    }

    fn cells(&self) -> Cells {
        Cells { lo: self.lo, size: self.size, count: self.count }
    }

    /// The bin column of x; clamped to the grid.
    pub fn column(&self, x: i64) -> usize {
        self.cells().column(x)
    }

    /// The bin row of y; clamped to the grid.
    pub fn row(&self, y: i64) -> usize {
        self.cells().row(y)
    }

    /// Lists the facets of every bin; gives up where that takes more than `limit` references.
    fn fill(&mut self, mesh: &Mesh, limit: u64) -> bool {
        let Some(lists) = self.cells().lists(mesh, 0..mesh.facets.len() as u32, limit) else { return false };
        (self.starts, self.refs) = lists;
        true
    }

    fn divide_crowded(&mut self, mesh: &Mesh) {
        let crowded = (0..self.class_count()).filter(|&b| self.facets(b).len() > CROWDED);
        let fine = crowded.filter_map(|b| Some((b as u32, self.divide(mesh, b)?)));
        self.fine = fine.collect();
    }

    fn class_count(&self) -> usize {
        self.count[0] * self.count[1]
    }

    /// The cells of a crowded bin; None where they would not help: its facets are as large as it is.
    fn divide(&self, mesh: &Mesh, b: usize) -> Option<Fine> {
        let facets = self.facets(b);
        let [column, row] = [b % self.count[0], b / self.count[0]].map(|i| i as i64);
        let lo = P2::new(self.lo.x + column * self.size, self.lo.y + row * self.size);
        let mut side = ((facets.len() as f64 / 2.0).sqrt() as i64).min(self.size);
        while side > 1 {
            let cells = Cells { lo, size: self.size / side + 1, count: [side as usize; 2] };
            let limit = facets.len() as u64 * MAX_FINE_REFS;
            if let Some((starts, refs)) = cells.lists(mesh, facets.iter().copied(), limit) {
                return Some(Fine { cells, starts, refs });
            }
            side /= 2;
        }
        None
    }

    /// Appends the facets of bin `b` that may lie under the line from `from` to `to`, which may reach
    /// beyond the bin.
    pub fn facets_under(&self, b: usize, from: P2, to: P2, out: &mut Vec<u32>) {
        let Some(Fine { cells, starts, refs }) = self.fine.get(&(b as u32)) else {
            return out.extend_from_slice(self.facets(b));
        };
        cells.along(from, to, |c| out.extend_from_slice(&refs[starts[c] as usize..starts[c + 1] as usize]));
    }

    /// The facets whose padded box touches bin `b`.
    pub fn facets(&self, b: usize) -> &[u32] {
        &self.refs[self.starts[b] as usize..self.starts[b + 1] as usize]
    }

    fn classify(&mut self, mesh: &Mesh) {
        let mut class = vec![Class::Simple; self.count[0] * self.count[1]];
        for he in (0..mesh.twins.len()).filter(|&he| mesh.twins[he] == NONE) {
            let f = &mesh.facets[he / 3];
            let (a, b) = (mesh.vertices[f[he % 3] as usize], mesh.vertices[f[(he % 3 + 1) % 3] as usize]);
            self.cells().along(a.p2(), b.p2(), |bin| class[bin] = Class::Complex);
        }
        let mut sheet = Vec::new();
        for row in 0..self.count[1] {
            for column in 0..self.count[0] {
                let b = row * self.count[0] + column;
                if class[b] == Class::Simple {
                    let centre = P2::new(
                        self.lo.x + column as i64 * self.size + self.size / 2,
                        self.lo.y + row as i64 * self.size + self.size / 2,
                    );
                    class[b] = self.class_without_rim(mesh, b, centre, &mut sheet);
                } else if self.facets(b).is_empty() {
                    class[b] = Class::Empty;
                }
            }
        }
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

/// Square cells in rows.
#[derive(Clone, Copy, Debug)]
struct Cells {
    lo: P2,
    size: i64,
    count: [usize; 2],
}

impl Cells {
    fn axis(&self, v: i64, lo: i64, count: usize) -> usize {
        ((v - lo).div_euclid(self.size)).clamp(0, count as i64 - 1) as usize
    }
    fn column(&self, x: i64) -> usize {
        self.axis(x, self.lo.x, self.count[0])
    }
    fn row(&self, y: i64) -> usize {
        self.axis(y, self.lo.y, self.count[1])
    }

    /// The cells that the box of a facet touches, two nanometres around it included.
    fn range(&self, corners: &[Vertex; 3]) -> Range2 {
        let xs = corners.map(|v| i64::from(v.x));
        let ys = corners.map(|v| i64::from(v.y));
        let min = |v: [i64; 3]| v[0].min(v[1]).min(v[2]) - 2;
        let max = |v: [i64; 3]| v[0].max(v[1]).max(v[2]) + 2;
        Range2 { x: [self.column(min(xs)), self.column(max(xs))], y: [self.row(min(ys)), self.row(max(ys))] }
    }

    /// The facets of every cell, as one list and where each cell's begins; None where that takes more
    /// than `limit` references.
    fn lists(
        &self,
        mesh: &Mesh,
        facets: impl Iterator<Item = u32> + Clone,
        limit: u64,
    ) -> Option<(Vec<u32>, Vec<u32>)> {
        let range = |f: u32| self.range(&mesh.facets[f as usize].map(|v| mesh.vertices[v as usize]));
        let mut starts = vec![0u32; self.count[0] * self.count[1] + 1];
        let mut total = 0;
        for f in facets.clone() {
            let range = range(f);
            total += range.area();
            if total > limit {
                return None;
            }
            range.for_each(self.count[0], |b| starts[b + 1] += 1);
        }
        for b in 0..starts.len() - 1 {
            starts[b + 1] += starts[b];
        }
        let mut refs = vec![0u32; starts[starts.len() - 1] as usize];
        let mut next = starts.clone();
        for f in facets {
            range(f).for_each(self.count[0], |b| {
                refs[next[b] as usize] = f;
                next[b] += 1;
            });
        }
        Some((starts, refs))
    }

    /// Calls `f` with every cell that the line from a to b touches, some nanometres around it included.
    fn along(&self, a: P2, b: P2, mut f: impl FnMut(usize)) {
        let (a, b) = if a.y <= b.y { (a, b) } else { (b, a) };
        let dy = (b.y - a.y) as f64;
        let beyond =
            |lo: i64, hi: i64, from: i64, count: usize| hi + 3 < from || lo - 3 > from + count as i64 * self.size;
        if beyond(a.y, b.y, self.lo.y, self.count[1]) {
            return;
        }
        for row in self.row(a.y - 1)..=self.row(b.y + 1) {
            let y0 = (self.lo.y + row as i64 * self.size - 1).clamp(a.y, b.y);
            let y1 = (self.lo.y + (row as i64 + 1) * self.size + 1).clamp(a.y, b.y);
            let at =
                |y: i64| if dy > 0.0 { a.x as f64 + (b.x - a.x) as f64 * ((y - a.y) as f64 / dy) } else { a.x as f64 };
            let (mut x0, mut x1) = if dy > 0.0 { (at(y0), at(y1)) } else { (a.x as f64, b.x as f64) };
            if x0 > x1 {
                std::mem::swap(&mut x0, &mut x1);
            }
            let (x0, x1) = (x0.floor() as i64 - 2, x1.ceil() as i64 + 2);
            if beyond(x0, x1, self.lo.x, self.count[0]) {
                continue;
            }
            for column in self.column(x0)..=self.column(x1) {
                f(row * self.count[0] + column);
            }
        }
    }
}

/// A range of bins, ends included.
struct Range2 {
    x: [usize; 2],
    y: [usize; 2],
}

impl Range2 {
    fn area(&self) -> u64 {
        (self.x[1] - self.x[0] + 1) as u64 * (self.y[1] - self.y[0] + 1) as u64
    }
    fn for_each(&self, columns: usize, mut f: impl FnMut(usize)) {
        for y in self.y[0]..=self.y[1] {
            for x in self.x[0]..=self.x[1] {
                f(y * columns + x);
            }
        }
    }
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
