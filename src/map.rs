//! Which block owns which place of the part: a raster of labels over the texture's box.
//!
//! The layout picture is drawn from it and sub-blocks are counted on it. A cell belongs to the block
//! whose section and level hold the surface at the cell's centre; cells whose level is no stop of the
//! program belong to none. Cells measure 0.25 mm, as the article counts; they grow where the
//! texture's box would need more than 16 million of them.

use rayon::prelude::*;
use rustc_hash::FxHashMap;

use crate::geom::{Box2, P2};
use crate::program::{Program, Sections};
use crate::surface::{Cursor, Surface};

/// The raster.
#[derive(Clone, Debug)]
pub struct Map {
    origin: P2,
    cell: i64,
    count: [usize; 2],
    labels: Vec<u32>,
}

const CELL_NM: i64 = 250_000;
const MAX_CELLS: i64 = 16_000_000;

impl Map {
    /// Samples the surface under the texture's box.
    pub fn new(program: &Program, sections: &Sections, surface: &Surface, area: Box2) -> Self {
        let (cell, count) = cells(area, CELL_NM);
        // Blocks by section, by height.
        let mut by_section: FxHashMap<[u32; 2], Vec<(i64, i64, u32)>> = FxHashMap::default();
        for (i, block) in program.blocks.iter().enumerate() {
            let s = &block.stop;
            by_section.entry(s.section).or_default().push((s.z_lo, s.z_hi, i as u32 + 1));
        }
        by_section.values_mut().for_each(|v| v.sort_unstable());
        let mut map = Self { origin: area.lo, cell, count, labels: vec![0; count[0] * count[1]] };
        let centre = |i: usize, lo: i64| lo + i as i64 * cell + cell / 2;
        map.labels.par_chunks_mut(count[0]).enumerate().for_each_init(
            || (Cursor::default(), Vec::new()),
            |(cursor, spans), (row, labels)| {
                let y = centre(row, area.lo.y);
                let (a, b) = (P2::new(area.lo.x, y), P2::new(centre(count[0], area.lo.x), y));
                surface.walk(a, b, cursor, spans);
                let r = sections.along(1, y, 0) as u32;
                let mut span = 0;
                for (column, label) in labels.iter_mut().enumerate() {
                    let x = centre(column, area.lo.x);
                    let t = (x - a.x) as f64 / (b.x - a.x) as f64;
                    while spans[span].t1 < t {
                        span += 1;
                    }
                    let s = &spans[span];
                    if s.facet().is_none() {
                        continue;
                    }
                    let z = s.z0 + (s.z1 - s.z0) * ((t - s.t0) / (s.t1 - s.t0));
                    let section = [sections.along(0, x, 0) as u32, r];
                    let Some(blocks) = by_section.get(&section) else { continue };
                    let above = blocks.partition_point(|b| b.0 as f64 <= z);
                    if above > 0 && z <= blocks[above - 1].1 as f64 {
                        *label = blocks[above - 1].2;
                    }
                }
            },
        );
        map
    }

    /// An empty map over `bounds`, for tests of what is drawn from one.
    #[cfg(test)]
    pub(crate) fn blank(bounds: Box2, cell: i64) -> Self {
        let bounds = if bounds.is_empty() { Box2 { lo: P2::new(0, 0), hi: P2::new(0, 0) } } else { bounds };
        let (cell, count) = cells(bounds, cell.max(1));
        Self { origin: bounds.lo, cell, count, labels: vec![0; count[0] * count[1]] }
    }

    /// The labels, to be filled by a test.
    #[cfg(test)]
    pub(crate) fn labels_mut(&mut self) -> &mut [u32] {
        &mut self.labels
    }

    /// Side of a cell, nm.
    pub fn cell(&self) -> i64 {
        self.cell
    }

    /// Columns and rows.
    pub fn size(&self) -> [u32; 2] {
        self.count.map(|n| n as u32)
    }

    /// The centre of a cell.
    pub fn centre(&self, column: u32, row: u32) -> P2 {
        let at = |o: i64, i: u32| o + i64::from(i) * self.cell + self.cell / 2;
        P2::new(at(self.origin.x, column), at(self.origin.y, row))
    }

    /// Row by row from below: index of the block that owns the cell plus 1, or 0 for none.
    pub fn labels(&self) -> &[u32] {
        &self.labels
    }

    /// The box of all cells.
    pub fn bounds(&self) -> Box2 {
        let hi = |o: i64, n: usize| o + n as i64 * self.cell;
        Box2 { lo: self.origin, hi: P2::new(hi(self.origin.x, self.count[0]), hi(self.origin.y, self.count[1])) }
    }

    fn cell_of(&self, p: P2) -> [i64; 2] {
        [(p.x - self.origin.x).div_euclid(self.cell), (p.y - self.origin.y).div_euclid(self.cell)]
    }

    fn label(&self, x: i64, y: i64) -> u32 {
        let inside = (0..self.count[0] as i64).contains(&x) && (0..self.count[1] as i64).contains(&y);
        if inside { self.labels[y as usize * self.count[0] + x as usize] } else { 0 }
    }

    /// Sub-blocks in the article's sense: connected parts (8 neighbours) of one level in one section
    /// that hold texture. A block without a cell of its own counts as one. Parts without texture lose their
    /// label: nothing is machined there.
    pub fn sub_blocks(&mut self, program: &Program) -> usize {
        let parts = self.components();
        let mut touched = vec![false; parts.iter().max().map_or(0, |&m| m as usize + 1)];
        let mut sub_blocks = 0;
        for (i, block) in program.blocks.iter().enumerate() {
            let mut any = false;
            for stroke in program.strokes_of(block) {
                for p in program.points_of(stroke) {
                    let c = block.stop.centre;
                    let [x, y] = self.cell_of(P2::new(c.x + i64::from(p[0]), c.y + i64::from(p[1])));
                    // A mark on a border may lie in a cell of the neighbour.
                    for (dx, dy) in NEAR {
                        if self.label(x + dx, y + dy) == i as u32 + 1 {
                            let part =
                                &mut touched[parts[(y + dy) as usize * self.count[0] + (x + dx) as usize] as usize];
                            sub_blocks += usize::from(!*part);
                            *part = true;
                            any = true;
                            break;
                        }
                    }
                }
            }
            sub_blocks += usize::from(!any);
        }
        for (label, &part) in self.labels.iter_mut().zip(&parts) {
            if !touched[part as usize] {
                *label = 0;
            }
        }
        sub_blocks
    }

    /// The component of every cell: cells of equal label that touch, corners included, have the same
    /// number; cells without label have number 0.
    fn components(&self) -> Vec<u32> {
        let [columns, rows] = self.count;
        let mut parent: Vec<u32> = (0..self.labels.len() as u32).collect();
        fn root(parent: &mut [u32], mut i: u32) -> u32 {
            while parent[i as usize] != i {
                parent[i as usize] = parent[parent[i as usize] as usize];
                i = parent[i as usize];
            }
            i
        }
        for y in 0..rows {
            for x in 0..columns {
                let i = y * columns + x;
                if self.labels[i] == 0 {
                    continue;
                }
                for (dx, dy) in [(-1, 0), (-1, -1), (0, -1), (1, -1)] {
                    if self.label(x as i64 + dx, y as i64 + dy) == self.labels[i] {
                        let j = ((y as i64 + dy) * columns as i64 + x as i64 + dx) as u32;
                        let (a, b) = (root(&mut parent, i as u32), root(&mut parent, j));
                        parent[a.max(b) as usize] = a.min(b);
                    }
                }
            }
        }
        let mut numbers = vec![0u32; self.labels.len()];
        let mut next = 0;
        for i in 0..self.labels.len() {
            if self.labels[i] != 0 {
                let r = root(&mut parent, i as u32) as usize;
                if r == i {
                    next += 1;
                    numbers[i] = next;
                } else {
                    numbers[i] = numbers[r];
                }
            }
        }
        numbers
    }

    /// Length of the borders between blocks, mm: cell sides between two blocks, times π/4 because a
    /// slanting border crosses more sides than it is long (Cauchy and Crofton).
    pub fn seam_mm(&self) -> f64 {
        let [columns, rows] = self.count;
        let mut sides = 0usize;
        for y in 0..rows {
            for x in 0..columns {
                let here = self.labels[y * columns + x];
                let differs = |x: usize, y: usize| {
                    let there = self.labels[y * columns + x];
                    here != 0 && there != 0 && here != there
                };
                sides += usize::from(x + 1 < columns && differs(x + 1, y));
                sides += usize::from(y + 1 < rows && differs(x, y + 1));
            }
        }
        sides as f64 * self.cell as f64 / crate::geom::NM_PER_MM * std::f64::consts::FRAC_PI_4
    }
}

/// Side and number of the cells over a box: `cell`, doubled until they are not too many.
fn cells(area: Box2, mut cell: i64) -> (i64, [usize; 2]) {
    let [w, h] = area.size();
    while (w / cell + 1).saturating_mul(h / cell + 1) > MAX_CELLS {
        cell *= 2;
    }
    (cell, [(w / cell + 1) as usize, (h / cell + 1) as usize])
}

const NEAR: [(i64, i64); 9] = [(0, 0), (1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1)];
