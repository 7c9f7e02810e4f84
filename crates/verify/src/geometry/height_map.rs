//! A height map as an implicit triangulation: each cell of samples is cut by the diagonal from its
//! lower left to its upper right node, and a triangle with a hole among its nodes is not there.

use std::ops::Range;
use terrace_core::math;

use super::grid::Grid;
use super::{BoxNm, Crossing, HAIR, Line, Scratch, nm};
use terrace_core::geom::BoxMm;
use terrace_input::surface::Heightmap;

/// A height map, turned with its part.
pub(crate) struct Map {
    map: Heightmap,
    grid: Grid,
    /// Cosine and sine of the part's turn.
    turn: [f64; 2],
}

impl Map {
    /// For a part turned by `turn_rad`; None where the map has no cell.
    pub(crate) fn new(map: Heightmap, turn_rad: f64) -> Option<Self> {
        if map.columns < 2 || map.rows < 2 || map.samples.len() != map.columns.checked_mul(map.rows)? {
            return None;
        }
        let (sin, cos) = math::sin_cos(turn_rad);
        let grid = Grid { lo: map.origin_mm.map(nm), size: nm(map.pixel_mm), count: [map.columns - 1, map.rows - 1] };
        Some(Self { map, grid, turn: [cos, sin] })
    }

    /// Box of all samples that are not holes, mm, unturned; None where all are holes.
    pub(crate) fn box_mm(map: &Heightmap) -> Option<BoxMm<2>> {
        let mut nodes = [usize::MAX, usize::MAX, 0, 0];
        for row in 0..map.rows {
            let solid = |column: &usize| map.samples.value(row * map.columns + column).is_some();
            let last = || (0..map.columns).rev().find(solid);
            if let Some((first, last)) = (0..map.columns).find(solid).zip(last()) {
                nodes = [nodes[0].min(first), nodes[1].min(row), nodes[2].max(last), nodes[3].max(row)];
            }
        }
        let coordinate = |k: usize, i: usize| map.origin_mm[k] + i as f64 * map.pixel_mm;
        let corner = |[i, j]: [usize; 2]| [coordinate(0, i), coordinate(1, j)];
        let [i0, j0, i1, j1] = nodes;
        (i0 != usize::MAX).then(|| BoxMm { lo: corner([i0, j0]), hi: corner([i1, j1]) })
    }

    /// The smallest height of a triangle in plan: that over its diagonal.
    pub(super) fn altitude(&self) -> f64 {
        self.grid.size * std::f64::consts::FRAC_1_SQRT_2
    }

    pub(super) fn heights(&self) -> [f64; 2] {
        let solid = (0..self.map.samples.len()).filter_map(|i| self.map.samples.value(i));
        let z = solid.map(|v| nm(self.map.z_mm[0] + v * self.map.z_mm[1]));
        z.fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], z| [lo.min(z), hi.max(z)])
    }

    /// Hands the corners of all triangles that touch a box of the turned part, and some around, to `sink`.
    pub(super) fn facets_in(&self, area: BoxNm, sink: &mut dyn FnMut([[f64; 3]; 3])) {
        let [cos, sin] = self.turn;
        let ([x0, y0], [x1, y1]) = (area.lo, area.hi);
        let mut flat = BoxNm::EMPTY;
        for [x, y] in [[x0, y0], [x1, y0], [x0, y1], [x1, y1]] {
            flat.add([x * cos + y * sin, y * cos - x * sin]);
        }
        self.facets_of([0, 1].map(|k| self.grid.index(k, flat.lo[k])..self.grid.index(k, flat.hi[k]) + 1), sink);
    }

    /// Hands the corners of all triangles to `sink`.
    pub(super) fn each_facet(&self, sink: &mut dyn FnMut([[f64; 3]; 3])) {
        self.facets_of(self.grid.count.map(|count| 0..count), sink);
    }

    /// Hands the corners of the triangles of some columns and rows of cells to `sink`.
    fn facets_of(&self, [columns, rows]: [Range<usize>; 2], sink: &mut dyn FnMut([[f64; 3]; 3])) {
        for row in rows {
            for column in columns.clone() {
                // Both triangles of a cell have the ends of its diagonal as corners.
                let diagonal = (self.node(column, row), self.node(column + 1, row + 1));
                let (Some(lower_left), Some(upper_right)) = diagonal else { continue };
                if let Some(lower_right) = self.node(column + 1, row) {
                    sink([lower_left, lower_right, upper_right]);
                }
                if let Some(upper_left) = self.node(column, row + 1) {
                    sink([lower_left, upper_right, upper_left]);
                }
            }
        }
    }

    /// The place of a sample on the turned part, nm; None of a hole.
    fn node(&self, column: usize, row: usize) -> Option<[f64; 3]> {
        let [cos, sin] = self.turn;
        let value = self.map.samples.value(row * self.map.columns + column)?;
        let coordinate = |k: usize, i: usize| self.grid.lo[k] + i as f64 * self.grid.size;
        let (x, y) = (coordinate(0, column), coordinate(1, row));
        let z = nm(self.map.z_mm[0] + value * self.map.z_mm[1]);
        Some([x * cos - y * sin, x * sin + y * cos, z])
    }

    /// Cuts both triangles of every cell under the line.
    pub(super) fn crossings(&self, line: &Line, out: &mut Scratch) {
        let [cos, sin] = self.turn;
        let back = |[x, y]: [f64; 2]| [x * cos + y * sin, y * cos - x * sin];
        let line = Line { start: back(line.start), dir: back(line.dir), len: line.len };
        self.grid.along(&line, |column, row| {
            for half in [CellHalf::LowerRight, CellHalf::UpperLeft] {
                self.triangle(&line, [column, row], half, out);
            }
        });
    }

    /// Cuts one triangle of a cell under the line.
    fn triangle(&self, line: &Line, [column, row]: [usize; 2], half: CellHalf, out: &mut Scratch) {
        let upper = half == CellHalf::UpperLeft;
        let z = |dx: usize, dy: usize| {
            let value = self.map.samples.value((row + dy) * self.map.columns + column + dx);
            value.map(|v| nm(self.map.z_mm[0] + v * self.map.z_mm[1]))
        };
        let (Some(z00), Some(z11)) = (z(0, 0), z(1, 1)) else { return };
        let Some(corner) = (if upper { z(0, 1) } else { z(1, 0) }) else { return };
        let size = self.grid.size;
        let rise = if upper { [z11 - corner, corner - z00] } else { [corner - z00, z11 - corner] };
        let grad = rise.map(|r| r / size);
        let lo = [
            self.grid.lo[0] + column as f64 * size - line.start[0],
            self.grid.lo[1] + row as f64 * size - line.start[1],
        ];
        // Three half-planes of (x, y) from the cell's corner: past the leg, before the other leg, next to the diagonal.
        let (near, far) = if upper { (0, 1) } else { (1, 0) };
        let mut d = [0.0, line.len];
        let sides = [
            (line.dir[near], lo[near]),
            (-line.dir[far], -(lo[far] + size)),
            (line.dir[far] - line.dir[near], lo[far] - lo[near]),
        ];
        sides.iter().for_each(|&(rate, least)| clip(&mut d, rate, least));
        if d[0] < d[1] {
            let is_along = |&(rate, least): &(f64, f64)| rate.abs() * line.len + least.abs() <= HAIR / 2.0;
            out.is_along_edge |= sides.iter().any(is_along);
            let z_at = |d: f64| z00 + grad[0] * (d * line.dir[0] - lo[0]) + grad[1] * (d * line.dir[1] - lo[1]);
            let slope2 = grad[0] * grad[0] + grad[1] * grad[1];
            let ([cos, sin], [gx, gy]) = (self.turn, grad);
            let grad = [cos * gx - sin * gy, sin * gx + cos * gy];
            out.crossings.push(Crossing {
                d,
                z: d.map(z_at),
                slope2,
                grad,
                unturned_slope2: slope2,
                facet: u32::from(upper),
            });
        }
    }
}

/// One of the triangles into which the diagonal divides a cell.
#[derive(Clone, Copy, PartialEq, Eq)]
enum CellHalf {
    LowerRight,
    UpperLeft,
}

/// Keeps the stretch of `d` on which `d * rate >= least`.
fn clip(d: &mut [f64; 2], rate: f64, least: f64) {
    if rate == 0.0 {
        if least > 0.0 {
            d[1] = f64::NEG_INFINITY;
        }
    } else if rate > 0.0 {
        d[0] = d[0].max(least / rate);
    } else {
        d[1] = d[1].min(least / rate);
    }
}
