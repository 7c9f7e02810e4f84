//! The facets of a mesh file in a grid.
//!
//! Facets are kept in the order of the cells of their centres, so that a line reads memory in order;
//! each cell lists the facets that touch it in one flat array.

use std::ops::Range;
use terrace_core::math;

use super::grid::Grid;
use super::{BoxNm, Crossing, HAIR, Line, Scratch, Turn, nm};
use terrace_core::geom::{BoxMm, P3};
use terrace_core::parallel;

/// A facet in plan view and its plane: z = z0 + grad · (p - corner 0).
#[derive(Clone, Copy, Debug)]
struct Facet {
    corners: [[f64; 2]; 3],
    z0: f64,
    grad: [f64; 2],
    /// Square of the slope of the part as it lies when it is not turned.
    unturned_slope2: f64,
}

/// What a line has in common with a facet in plan view.
struct FacetCut {
    /// Where it begins and ends, nm from the line's start.
    d: [f64; 2],
    /// Whether the line runs along an edge of the facet.
    is_along_edge: bool,
}

/// Cells of the grid hold about this many facets each.
const FACETS_PER_CELL: f64 = 1.0;

/// Facets are entered in cells a little larger than they are, nm, so that rounding loses none.
const RIM: f64 = 1.0;

/// Collects the facets of a file.
pub(crate) struct MeshBuilder {
    facets: Vec<Facet>,
    /// Corners of facets too thin in plan view to have a height there, nm, upright ones among them: a turned part may
    /// show them.
    walls: Vec<[[f64; 3]; 3]>,
    turn: [f64; 2],
    thinnest: f64,
    lo: [f64; 2],
    hi: [f64; 2],
    /// Sum of width and height of the boxes of all facets, nm.
    extent: f64,
    /// Box of all corners in the file's own frame, mm.
    pub(crate) box_mm: BoxMm<2>,
}

impl MeshBuilder {
    /// For a part turned by `turn_rad`; facets whose least altitude in plan view is at most `thinnest_nm` are kept as
    /// walls.
    pub(crate) fn new(turn_rad: f64, thinnest_nm: f64) -> Self {
        let (sin, cos) = math::sin_cos(turn_rad);
        Self {
            facets: Vec::new(),
            walls: Vec::new(),
            turn: [cos, sin],
            thinnest: thinnest_nm,
            lo: [f64::INFINITY; 2],
            hi: [f64::NEG_INFINITY; 2],
            extent: 0.0,
            box_mm: BoxMm::EMPTY,
        }
    }

    /// Adds a facet with corners in mm, part frame.
    pub(crate) fn push(&mut self, corners_mm: [[f64; 3]; 3]) {
        for [x, y, _] in corners_mm {
            self.box_mm.add([x, y]);
        }
        let [cos, sin] = self.turn;
        let corners = corners_mm.map(|[x, y, z]| [nm(x * cos - y * sin), nm(x * sin + y * cos), nm(z)]);
        self.add(corners, None);
    }

    /// Adds a facet with corners in nm, as they lie.
    pub(super) fn push_nm(&mut self, corners: [[f64; 3]; 3]) {
        self.add(corners, None);
    }

    /// Adds a facet with corners in nm as a turned part shows it; `turn` turns it.
    pub(super) fn push_turned(&mut self, corners: [[f64; 3]; 3], turn: &Turn) {
        let [a, b, c] = corners;
        let [u, v] = [b, c].map(|p| [0, 1, 2].map(|k| p[k] - a[k]));
        let normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
        let unturned_slope2 = (normal[0].powi(2) + normal[1].powi(2)) / normal[2].powi(2);
        self.add(corners.map(|p| turn.apply(P3::new(p)).at), Some(unturned_slope2));
    }

    /// Keeps a facet, corners in nm: by its plane, or as a wall where it is too thin in plan view to have one.
    fn add(&mut self, corners_nm: [[f64; 3]; 3], unturned_slope2: Option<f64>) {
        let corners = corners_nm.map(|[x, y, _]| [x, y]);
        if altitude(&corners) <= self.thinnest {
            self.walls.push(corners_nm);
            return;
        }
        let [a, b, c] = corners;
        let [za, zb, zc] = corners_nm.map(|p| p[2]);
        let (ux, uy, vx, vy) = (b[0] - a[0], b[1] - a[1], c[0] - a[0], c[1] - a[1]);
        // Not zero: the altitude is above `thinnest`.
        let det = ux * vy - uy * vx;
        let grad = [((zb - za) * vy - (zc - za) * uy) / det, ((zc - za) * ux - (zb - za) * vx) / det];
        for k in 0..2 {
            let (lo, hi) = (a[k].min(b[k]).min(c[k]), a[k].max(b[k]).max(c[k]));
            self.lo[k] = self.lo[k].min(lo);
            self.hi[k] = self.hi[k].max(hi);
            self.extent += hi - lo;
        }
        let unturned_slope2 = unturned_slope2.unwrap_or(grad[0] * grad[0] + grad[1] * grad[1]);
        self.facets.push(Facet { corners, z0: za, grad, unturned_slope2 });
    }

    /// Sorts the facets into the grid.
    pub(crate) fn finish(self) -> Mesh {
        let Self { mut facets, walls, lo, hi, extent, .. } = self;
        let n = facets.len().max(1) as f64;
        let (width, height) = if facets.is_empty() { (1.0, 1.0) } else { (hi[0] - lo[0], hi[1] - lo[1]) };
        let mut size = (width * height * FACETS_PER_CELL / n).sqrt().max(extent / (2.0 * n)).max(1e3);
        let mut grid = Grid { lo: [0.0; 2], size: 1.0, count: [1; 2] };
        if !facets.is_empty() {
            // Long slivers across the grid would fill the memory: the cells grow until they do not.
            loop {
                let count = [width, height].map(|e| ((e + 4.0 * RIM) / size) as usize + 1);
                grid = Grid { lo: [lo[0] - 2.0 * RIM, lo[1] - 2.0 * RIM], size, count };
                let cells = count[0].saturating_mul(count[1]) as f64;
                if cells <= 4.0 * n + 64.0 && entries(&facets, &grid, 12 * facets.len() + 64) {
                    break;
                }
                size *= 1.5;
            }
        }
        sort_by_cell(&mut facets, &grid);
        Mesh { walls, ..Mesh::with_cell_lists(facets, grid) }
    }
}

/// Smallest height of a triangle, in its own unit.
fn altitude([a, b, c]: &[[f64; 2]; 3]) -> f64 {
    let area2 = ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])).abs();
    let edge2 = |p: &[f64; 2], q: &[f64; 2]| (q[0] - p[0]).powi(2) + (q[1] - p[1]).powi(2);
    let longest2 = edge2(a, b).max(edge2(b, c)).max(edge2(c, a));
    if longest2 > 0.0 { area2 / longest2.sqrt() } else { 0.0 }
}

/// Facets whose entries a thread counts at once.
const COUNTED: usize = 1 << 16;

/// Whether the facets make at most `most` entries in the grid.
fn entries(facets: &[Facet], grid: &Grid, most: usize) -> bool {
    let chunks: Vec<&[Facet]> = facets.chunks(COUNTED).collect();
    let counts = parallel::map(chunks.len(), |i| {
        let mut count = 0usize;
        chunks[i].iter().all(|f| {
            f.rows(grid, 0..grid.count[1], |_, columns| count += columns.len());
            count <= most
        });
        count
    });
    counts.into_iter().fold(0, usize::saturating_add) <= most
}

/// Orders the facets by the cell of their centre, in place.
fn sort_by_cell(facets: &mut [Facet], grid: &Grid) {
    let cell = |f: &Facet| {
        let centre = |k: usize| (f.corners[0][k] + f.corners[1][k] + f.corners[2][k]) / 3.0;
        grid.index(1, centre(1)) * grid.count[0] + grid.index(0, centre(0))
    };
    // Counting sort: `next` first counts, then holds where the next facet of each cell goes.
    let mut next = vec![0u32; grid.count[0] * grid.count[1] + 1];
    facets.iter().for_each(|f| next[cell(f) + 1] += 1);
    for i in 1..next.len() {
        next[i] += next[i - 1];
    }
    let mut target: Vec<u32> = Vec::with_capacity(facets.len());
    for f in facets.iter() {
        let slot = &mut next[cell(f)];
        target.push(*slot);
        *slot += 1;
    }
    // Cycles of the permutation in place: every swap brings one facet to where it belongs.
    for i in 0..facets.len() {
        while target[i] as usize != i {
            let t = target[i] as usize;
            facets.swap(i, t);
            target.swap(i, t);
        }
    }
}

impl Facet {
    /// The cells that the facet touches in some rows: each of them with its columns.
    fn rows(&self, grid: &Grid, of: Range<usize>, mut visit: impl FnMut(usize, Range<usize>)) {
        let [a, b, c] = self.corners;
        let (y0, y1) = (a[1].min(b[1]).min(c[1]) - RIM, a[1].max(b[1]).max(c[1]) + RIM);
        let (r0, r1) = (grid.index(1, y0), grid.index(1, y1));
        for row in r0.max(of.start)..(r1 + 1).min(of.end) {
            let lo = if row == r0 { y0 } else { grid.lo[1] + row as f64 * grid.size - RIM };
            let hi = if row == r1 { y1 } else { grid.lo[1] + (row + 1) as f64 * grid.size + RIM };
            let [x0, x1] = self.x_range([lo, hi]);
            if x0 <= x1 {
                visit(row, grid.index(0, x0 - RIM)..grid.index(0, x1 + RIM) + 1);
            }
        }
    }

    /// Extent along x of the part between two values of y.
    fn x_range(&self, [lo, hi]: [f64; 2]) -> [f64; 2] {
        let mut range = [f64::INFINITY, f64::NEG_INFINITY];
        let mut add = |x: f64| range = [range[0].min(x), range[1].max(x)];
        for i in 0..3 {
            let (p, q) = (self.corners[i], self.corners[(i + 1) % 3]);
            if (lo..=hi).contains(&p[1]) {
                add(p[0]);
            }
            for y in [lo, hi] {
                if (p[1] < y) != (q[1] < y) {
                    add(p[0] + (q[0] - p[0]) * ((y - p[1]) / (q[1] - p[1])));
                }
            }
        }
        range
    }

    /// Where the line crosses the facet; None where they have no length in common.
    #[inline]
    fn cross(&self, line: &Line) -> Option<FacetCut> {
        // Of each corner, nm: its distance from the line, positive to the left, and how far along the line it lies.
        let (mut side, mut along) = ([0.0; 3], [0.0; 3]);
        for (i, v) in self.corners.iter().enumerate() {
            let (dx, dy) = (v[0] - line.start[0], v[1] - line.start[1]);
            side[i] = line.dir[0] * dy - line.dir[1] * dx;
            along[i] = line.dir[0] * dx + line.dir[1] * dy;
        }
        // A facet that is wholly on one side is not crossed.
        if side.iter().all(|&s| s > 0.0) || side.iter().all(|&s| s < 0.0) {
            return None;
        }
        // The least and the greatest `d` at which the line meets the edges, each from corner `i` to corner `j`.
        let (mut lo, mut hi) = (f64::INFINITY, f64::NEG_INFINITY);
        for (i, j) in [(0, 1), (1, 2), (2, 0)] {
            // A corner on the line counts only for the edge that begins there, so each is looked at once; an edge
            // along the line gives both its corners.
            let d = if side[i] == 0.0 {
                along[i]
            } else if side[j] != 0.0 && (side[i] < 0.0) != (side[j] < 0.0) {
                along[i] + (along[j] - along[i]) * (side[i] / (side[i] - side[j]))
            } else {
                continue;
            };
            lo = lo.min(d);
            hi = hi.max(d);
        }
        let (lo, hi) = (lo.max(0.0), hi.min(line.len));
        // Two corners on the line, to half a hair: the lines a hair beside an edge do not count as along it.
        let is_along_edge = side.iter().filter(|s| s.abs() <= HAIR / 2.0).count() > 1;
        (lo < hi).then_some(FacetCut { d: [lo, hi], is_along_edge })
    }

    /// The corners of the facet in space.
    fn solid(&self) -> [[f64; 3]; 3] {
        self.corners.map(|[x, y]| [x, y, self.z_at([x, y])])
    }

    #[inline]
    fn z_at(&self, [x, y]: [f64; 2]) -> f64 {
        self.z0 + self.grad[0] * (x - self.corners[0][0]) + self.grad[1] * (y - self.corners[0][1])
    }
}

/// Facets and the grid that finds them.
pub(crate) struct Mesh {
    facets: Vec<Facet>,
    grid: Grid,
    /// Start of the list of each cell in `listed`; the last entry is its length.
    first: Vec<u32>,
    /// Indices of facets, cell by cell.
    listed: Vec<u32>,
    walls: Vec<[[f64; 3]; 3]>,
}

impl Mesh {
    /// Lists for every cell the facets that touch it, in ascending order. Every thread fills the lists of a band of
    /// rows.
    fn with_cell_lists(facets: Vec<Facet>, grid: Grid) -> Self {
        let [columns, rows] = grid.count;
        let rows_per_band = rows.div_ceil(parallel::threads()).max(1);
        let band = |n: usize| n * rows_per_band..(n + 1) * rows_per_band;
        // First the number of facets in each cell, then the end of its list, in the end its start.
        let mut first = vec![0u32; columns * rows + 1];
        parallel::map_items(first[..columns * rows].chunks_mut(rows_per_band * columns).collect(), |n, counts| {
            for f in &facets {
                f.rows(&grid, band(n), |row, touched| {
                    counts[(row - band(n).start) * columns..][touched].iter_mut().for_each(|n| *n += 1);
                });
            }
        });
        // Filling each list from its back moves its end to its start.
        let mut sum = 0;
        for count in &mut first {
            sum += *count;
            *count = sum;
        }
        let mut listed = vec![0u32; sum as usize];
        let (mut lists, mut rest, mut start) = (Vec::new(), &mut listed[..], 0);
        for ends in first[..columns * rows].chunks_mut(rows_per_band * columns) {
            let end = ends.last().map_or(start, |end| *end);
            let (own, after) = rest.split_at_mut((end - start) as usize);
            lists.push((ends, own, start));
            (rest, start) = (after, end);
        }
        parallel::map_items(lists, |n, (slots, own, start)| {
            // Backwards, so that the lists ascend.
            for (i, f) in facets.iter().enumerate().rev() {
                f.rows(&grid, band(n), |row, touched| {
                    for slot in &mut slots[(row - band(n).start) * columns..][touched] {
                        *slot -= 1;
                        own[(*slot - start) as usize] = i as u32;
                    }
                });
            }
        });
        Self { facets, grid, first, listed, walls: Vec::new() }
    }

    pub(super) fn heights(&self) -> [f64; 2] {
        let z = self.facets.iter().flat_map(|f| f.corners.map(|c| f.z_at(c)));
        let z = z.chain(self.walls.iter().flatten().map(|p| p[2]));
        z.fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], z| [lo.min(z), hi.max(z)])
    }

    /// Hands the corners of all facets that touch an area to `sink`, walls among them.
    pub(super) fn facets_in(&self, area: BoxNm, sink: &mut dyn FnMut([[f64; 3]; 3])) {
        let touches = |corners: &[[f64; 3]; 3]| {
            let mut around = BoxNm::EMPTY;
            corners.iter().for_each(|&[x, y, _]| around.add([x, y]));
            area.touches(&around)
        };
        // Cells list facets by their boxes, several times where a facet is large: once each, and only if it touches.
        let [columns, rows] = [0, 1].map(|k| self.grid.index(k, area.lo[k])..self.grid.index(k, area.hi[k]) + 1);
        let cells = rows.flat_map(|row| columns.clone().map(move |column| row * self.grid.count[0] + column));
        let mut found: Vec<u32> = cells
            .flat_map(|cell| &self.listed[self.first[cell] as usize..self.first[cell + 1] as usize])
            .copied()
            .collect();
        found.sort_unstable();
        found.dedup();
        for f in found.into_iter().map(|i| &self.facets[i as usize]) {
            let corners = f.solid();
            if touches(&corners) {
                sink(corners);
            }
        }
        self.walls.iter().filter(|w| touches(w)).for_each(|w| sink(*w));
    }

    /// Hands the corners of all facets to `sink`, walls among them.
    pub(super) fn each_facet(&self, sink: &mut dyn FnMut([[f64; 3]; 3])) {
        self.facets.iter().for_each(|f| sink(f.solid()));
        self.walls.iter().for_each(|w| sink(*w));
    }

    /// How many facets are kept.
    #[cfg(test)]
    pub(super) fn len(&self) -> usize {
        self.facets.len()
    }

    pub(super) fn altitude(&self, facet: u32) -> f64 {
        altitude(&self.facets[facet as usize].corners)
    }

    /// Cuts every facet under the line.
    pub(super) fn crossings(&self, line: &Line, scratch: &mut Scratch) {
        let Scratch { crossings, seen, query, is_along_edge, .. } = scratch;
        if seen.len() != self.facets.len() || *query == u32::MAX {
            seen.clear();
            seen.resize(self.facets.len(), 0);
            *query = 0;
        }
        *query += 1;
        self.grid.along(line, |column, row| {
            let cell = row * self.grid.count[0] + column;
            for &i in &self.listed[self.first[cell] as usize..self.first[cell + 1] as usize] {
                // A facet stands in every cell that it touches, but is cut once a query.
                let seen = &mut seen[i as usize];
                if *seen == *query {
                    continue;
                }
                *seen = *query;
                let facet = &self.facets[i as usize];
                if let Some(cut) = facet.cross(line) {
                    *is_along_edge |= cut.is_along_edge;
                    let d = cut.d;
                    let z = d.map(|d| facet.z_at(line.at(d)));
                    let slope2 = facet.grad[0] * facet.grad[0] + facet.grad[1] * facet.grad[1];
                    crossings.push(Crossing {
                        d,
                        z,
                        slope2,
                        grad: facet.grad,
                        unturned_slope2: facet.unturned_slope2,
                        facet: i,
                    });
                }
            }
        });
    }
}
