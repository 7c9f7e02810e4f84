//! Which block owns which place of the part: a raster of labels over the texture's box.
//!
//! The layout picture is drawn from it; sub-blocks and seams are measured on it. Cells measure 0.25 mm,
//! as the article counts; they grow where the texture's box would need more than 16 million of them.
//!
//! The map is made of the marks, because where windows of stops overlap, the marks alone tell whose a
//! place is:
//! 1. *Marked cells.* Every stroke of every block is followed from cell to cell (`rasterise`). A cell belongs to the
//!    block with the longest marks in it; among equals to the first.
//! 2. *Growth.* From there the labels grow over the other cells, ring by ring, but only where the block's stop admits
//!    the surface at the cell's centre: in its window (the section where stops are on the grid of sections, else the
//!    field) and in its depth interval (`region_growing`). Marked cells whose centre their block does not admit, which
//!    lie on a border, take part as cells without marks. So all cells are judged at their centres, as the article
//!    counts, lines of one level are connected however far from each other they lie, and the number of sub-blocks,
//!    which is taken here, does not depend on the pitch. Rows among rows full of marks need no growth and stay as
//!    marked.
//! 3. *Closing.* Labels stay on cells with marks and on cells in a gap between two marks, along x or along y, of at
//!    most the reach (`closing`); the others are taken back. A dense hatch becomes a closed area up to its outermost
//!    lines, a place without texture stays empty. Cells in gaps that no block admits, such as levels that fall between
//!    two lines, go to the nearest label.
//!
//! The reach is 1.5 times the distance of marks that three of four gaps of the texture do not exceed,
//! at most an eighth of the field. Where more than one of four gaps is wider than that eighth, the texture
//! is a sparse drawing, and the reach is 1 mm.
//!
//! Memory is at most 20 bytes a cell while the map is made, 4 bytes afterwards.

mod closing;
mod measure;
mod rasterise;
mod region_growing;
#[cfg(test)]
mod tests;

use crate::ordered_strokes::{Band, OrderedStrokes};
use rasterise::{BandMarks, BlockMarks, MarkGroups};
use terrace_core::geom::{Box2, Grid, Nm, P2, P3, Turn, Turned};
use terrace_core::program::{Block, Program, Sections};
use terrace_input::surface::Surface;

/// The raster.
#[derive(Clone, Debug)]
pub struct BlockMap {
    grid: Grid,
    labels: Vec<u32>,
    sub_blocks: usize,
}

const CELL: Nm = Nm(250_000);
const MAX_CELLS: i64 = 16_000_000;

/// The widest gap that is closed is this part of the field; in sparse drawings it is this long.
const WIDEST_GAP: i64 = 8;
const SPARSE_GAP: Nm = Nm(1_000_000);

/// Marks may reach into the next section by this part of one: overlaps of seams.
const BEYOND: i64 = 8;

/// Whether the marks of every one of these blocks lie in a section.
pub fn is_gridded(program: &Program, blocks: &[Block], sections: &Sections) -> bool {
    blocks.iter().all(|b| section(program, b, sections).is_some())
}

/// The section in which the marks of a block lie, if they do: its own, or the one that their middle lies in. Of a block
/// without marks the one on whose centre it stands.
fn section(program: &Program, block: &Block, sections: &Sections) -> Option<Box2<Turned>> {
    if !block.stop.tilt.is_upright() {
        return None;
    }
    let c = block.stop.centre;
    let mut marks = Box2::<Turned>::EMPTY;
    let points = program.strokes_of(block).iter().flat_map(|s| program.points_of(s));
    points.for_each(|p| marks.add(P2::new(c.x + i64::from(p.x), c.y + i64::from(p.y))));
    if marks.is_empty() {
        return section_over(sections, c.x, c.y)
            .filter(|s| [s.lo.x.midpoint(s.hi.x), s.lo.y.midpoint(s.hi.y)] == [c.x, c.y]);
    }
    let [w, h] = sections.pitch.map(|Nm(v)| v / BEYOND);
    let holds_marks = |s: &Box2<Turned>| {
        s.lo.x - w <= marks.lo.x && marks.hi.x <= s.hi.x + w && s.lo.y - h <= marks.lo.y && marks.hi.y <= s.hi.y + h
    };
    let own = section_at(sections, block.stop.section.0.map(i64::from));
    let over_middle = section_over(sections, marks.lo.x.midpoint(marks.hi.x), marks.lo.y.midpoint(marks.hi.y));
    [own, over_middle].into_iter().flatten().find(holds_marks)
}

/// The section in a column and a row, if there is one.
fn section_at(sections: &Sections, [column, row]: [i64; 2]) -> Option<Box2<Turned>> {
    let [columns, rows] = sections.count.map(i64::from);
    let is_there = (0..columns).contains(&column) && (0..rows).contains(&row);
    let [w, h] = sections.pitch.map(|Nm(v)| v);
    let centre = P2::new(sections.origin.x + column * w + w / 2, sections.origin.y + row * h + h / 2);
    is_there.then(|| Box2::around(Turn::upright(centre), sections.pitch.map(|w| w / 2)))
}

/// The section that holds a place, if there is one.
fn section_over(sections: &Sections, x: i64, y: i64) -> Option<Box2<Turned>> {
    let [w, h] = sections.pitch.map(|Nm(v)| v);
    section_at(sections, [(x - sections.origin.x).div_euclid(w), (y - sections.origin.y).div_euclid(h)])
}

/// What a block's stop admits.
struct Accepts {
    /// How the part is turned, if it is: window and heights are then those of the turned part.
    turn: Option<Turn>,
    window: Box2<Turned>,
    z: [Nm; 2],
}

impl Accepts {
    /// In a section, or else in the field around its stop.
    fn of(block: &Block, turn: Option<Turn>, section: Option<Box2<Turned>>, field: [Nm; 2]) -> Self {
        let window = section.unwrap_or_else(|| Box2::around(block.stop.centre, field.map(|w| w / 2)));
        Self { turn, window, z: [block.stop.z_lo, block.stop.z_hi] }
    }

    fn admits(&self, p: P2, z: Nm) -> bool {
        let (p, z) = self.turn.map_or((Turn::upright(p), z), |turn| {
            let [x, y, up] = turn.apply(P3::new([p.x, p.y, z.0].map(|v| v as f64))).at.map(|v| v.round() as i64);
            (P2::new(x, y), Nm(up))
        });
        self.z[0] <= z && z <= self.z[1] && self.window.holds(p)
    }
}

impl BlockMap {
    /// The map of a program of one pass on the surface under the texture's box.
    pub fn new(
        program: &Program,
        sections: &Sections,
        turns: &[Option<Turn>],
        field: [Nm; 2],
        surface: &Surface,
        area: Box2,
    ) -> Self {
        let is_gridded = is_gridded(program, &program.blocks, sections);
        let section = |b: &Block| section(program, b, sections).filter(|_| is_gridded);
        let stops = program.blocks.iter().zip(turns).map(|(b, turn)| Accepts::of(b, *turn, section(b), field));
        Self::of(&BlockMarks { program, turns }, &stops.collect::<Vec<_>>(), field, surface, area)
    }

    /// The map of bands of depth over the whole part. Gaps are closed as in a field twice as large as the texture: up to
    /// a quarter of it.
    pub fn of_bands(ordered: &OrderedStrokes, bands: &[Band], surface: &Surface, area: Box2) -> Self {
        let everywhere = raster(area, CELL).bounds();
        let window = Box2 { lo: Turn::upright(everywhere.lo), hi: Turn::upright(everywhere.hi) };
        let stops: Vec<Accepts> = bands.iter().map(|band| Accepts { turn: None, window, z: band.z }).collect();
        let field = area.size().map(|s| (s + Nm(1)) * 2);
        Self::of(&BandMarks { ordered, bands }, &stops, field, surface, area)
    }

    /// The map of marks, each group of which has the stop at the same place of the list; gaps are closed in proportion
    /// to `field`.
    fn of(marks: &dyn MarkGroups, stops: &[Accepts], field: [Nm; 2], surface: &Surface, area: Box2) -> Self {
        let grid = raster(area, CELL);
        let marked = rasterise::marked_cells(marks, &grid);
        let [least, widest] =
            [SPARSE_GAP, field[0].min(field[1]) / WIDEST_GAP].map(|gap| (gap / grid.pitch[0]) as usize);
        let shown = closing::drawn_cells(&grid, &marked, least, widest);
        let dense = region_growing::dense(&grid, &marked);
        let heights = region_growing::CellHeights::under(surface, &grid, &dense);
        let may_have = |cell: usize, label: u32| {
            let stop = &stops[label as usize - 1];
            heights.at(cell).is_some_and(|z| stop.admits(grid.centre(cell), z))
        };
        // Decided at cell centres: a marked border cell whose centre its stop does not admit is cleared, else lines of
        // one level that touch the next would join what is apart.
        let mut labels = marked.clone();
        for (y, row) in labels.chunks_exact_mut(grid.columns()).enumerate().filter(|(y, _)| !dense[*y]) {
            let first = y * grid.columns();
            let dropped = row.iter_mut().enumerate().filter(|(x, label)| **label != 0 && !may_have(first + x, **label));
            dropped.for_each(|(_, label)| *label = 0);
        }
        region_growing::grow(&grid, &mut labels, may_have);
        // Counted here: closing, which follows, is for the picture.
        let sub_blocks = measure::count_components(&grid, &labels) + without_cell(&labels, stops.len());
        labels.iter_mut().zip(&marked).filter(|(label, _)| **label == 0).for_each(|(label, mark)| *label = *mark);
        region_growing::grow(&grid, &mut labels, |cell, _| shown[cell] && heights.at(cell).is_some());
        labels.iter_mut().zip(&shown).filter(|(_, shown)| !**shown).for_each(|(label, _)| *label = 0);
        Self { grid, labels, sub_blocks }
    }

    /// An empty map over `bounds`, for tests of what is drawn from one.
    #[cfg(any(test, feature = "test-support"))]
    pub fn blank(bounds: Box2, cell: Nm) -> Self {
        let bounds = if bounds.is_empty() { Box2 { lo: P2::new(0, 0), hi: P2::new(0, 0) } } else { bounds };
        let grid = raster(bounds, cell.max(Nm(1)));
        Self { labels: vec![0; grid.len()], grid, sub_blocks: 0 }
    }

    /// The labels, to be filled by a test.
    #[cfg(any(test, feature = "test-support"))]
    pub fn labels_mut(&mut self) -> &mut [u32] {
        &mut self.labels
    }

    /// Side of a cell, nm.
    pub fn cell(&self) -> Nm {
        self.grid.pitch[0]
    }

    /// Columns and rows.
    pub fn size(&self) -> [u32; 2] {
        self.grid.count
    }

    /// The centre of a cell.
    pub fn centre(&self, column: u32, row: u32) -> P2 {
        self.grid.centre(row as usize * self.grid.columns() + column as usize)
    }

    /// Row by row from below: index of the block that owns the cell plus 1, or 0 for none.
    pub fn labels(&self) -> &[u32] {
        &self.labels
    }

    /// The box of all cells.
    pub fn bounds(&self) -> Box2 {
        self.grid.bounds()
    }

    /// Sub-blocks in the article's sense: connected parts (8 neighbours) of one level in one section, that
    /// is of what one stop admits, that hold texture. A block without a cell of its own counts as one.
    pub fn sub_blocks(&self) -> usize {
        self.sub_blocks
    }

    /// Length of the borders between blocks, mm, where both sides are labelled. A straight border of any
    /// direction comes out within 1.4 %; at its ends, and where borders meet, it is short by a cell or two.
    pub fn seam_mm(&self) -> f64 {
        measure::seam_cells(&self.grid, &self.labels) * self.grid.pitch[0].mm()
    }
}

/// How many of `blocks` blocks own no cell.
fn without_cell(labels: &[u32], blocks: usize) -> usize {
    let mut seen = vec![false; blocks + 1];
    labels.iter().for_each(|&label| seen[label as usize] = true);
    seen[1..].iter().filter(|seen| !**seen).count()
}

/// The square cells over a box: of side `cell`, doubled until they are not too many.
fn raster(area: Box2, mut cell: Nm) -> Grid {
    let [w, h] = area.size();
    let count = |v: Nm, cell: Nm| ((v + cell - Nm(1)) / cell).max(1);
    while count(w, cell).saturating_mul(count(h, cell)) > MAX_CELLS {
        cell = cell * 2;
    }
    Grid { origin: area.lo, pitch: [cell; 2], count: [count(w, cell) as u32, count(h, cell) as u32] }
}
