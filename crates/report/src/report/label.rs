//! Where the numbers of blocks stand: well inside each piece of a block, as large as it allows.
//!
//! Consumes the grid of [`super::outline`]. A piece is a 4-connected set of cells of one block. For
//! each the cell deepest inside is found with a chamfer distance transform, among about equally deep
//! ones the cell nearest to the piece's centroid; there the number is turned along the piece if that
//! makes it clearly larger. Time follows the cells. Units: cells, rim included.

use super::outline::PaddedMap;
use terrace_core::math;

/// One number on the drawing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Spot {
    /// Index of the block.
    pub block: u32,
    /// Centre of the number, in cells.
    pub at: [f64; 2],
    /// Font size, in cells.
    pub font: f64,
    /// Direction of the text from +x towards +y, in degrees, -90 to 90.
    pub turn: i32,
}

/// Width of a digit per font size, air included.
const DIGIT: f64 = 0.66;
/// Height of the box of a number per font size, air included.
const TALL: f64 = 0.9;

/// Most pieces of a block that get a number.
const NUMBERS: usize = 4;
/// Least radius of such a piece, as a share of that of the block's deepest.
const WORTH: f64 = 0.4;

/// Spots for the numbers 1, 2, … of all blocks that have cells, sorted by block, a block's deepest
/// piece first. No font is larger than `limit` cells.
pub(super) fn place(grid: &PaddedMap, limit: f64) -> Vec<Spot> {
    let pieces = Pieces::of(grid);
    let deep = depths(grid, &pieces.of_cell);
    let mut cores: Vec<Core> = pieces.blocks.iter().map(|&block| Core { block, ..Core::default() }).collect();
    cells_of(&pieces, grid, |k, x, y, i| {
        let core = &mut cores[k];
        core.depth = core.depth.max(deep[i]);
        core.sum = [core.sum[0] + x as u64, core.sum[1] + y as u64];
        core.count += 1;
    });
    cells_of(&pieces, grid, |k, x, y, i| {
        let core = &mut cores[k];
        if u32::from(deep[i]) * 10 >= u32::from(core.depth) * 9 {
            let off = |v: usize, sum: u64| (v as f64 - sum as f64 / core.count as f64).powi(2);
            let off = off(x, core.sum[0]) + off(y, core.sum[1]);
            if core.best.is_none_or(|(least, _)| off < least) {
                core.best = Some((off, i));
            }
        }
    });
    let mut order: Vec<usize> = (0..cores.len()).collect();
    order.sort_by_key(|&k| (cores[k].block, std::cmp::Reverse(cores[k].depth), k));
    let mut spots: Vec<Spot> = Vec::new();
    for of_block in order.chunk_by(|&a, &b| cores[a].block == cores[b].block) {
        let least = cores[of_block[0]].radius() * WORTH;
        for &k in of_block.iter().take(NUMBERS).filter(|&&k| cores[k].radius() >= least) {
            spots.extend(cores[k].best.map(|(_, i)| fit(grid, &pieces.of_cell, &cores[k], i, limit)));
        }
    }
    spots
}

/// What is known of a piece.
#[derive(Default)]
struct Core {
    block: u32,
    depth: u16,
    sum: [u64; 2],
    count: u64,
    best: Option<(f64, usize)>,
}

impl Core {
    /// Radius of the circle round its deepest cell's centre that lies in it, in cells.
    fn radius(&self) -> f64 {
        f64::from(self.depth) / 3.0 - 0.5
    }
}

/// Connected pieces of blocks.
struct Pieces {
    /// Piece + 1 of every cell, or 0.
    of_cell: Vec<u32>,
    /// The block of every piece.
    blocks: Vec<u32>,
}

impl Pieces {
    /// Two passes over the cells with a union-find of provisional pieces.
    fn of(grid: &PaddedMap) -> Self {
        let (c, w) = (&grid.cells, grid.width);
        let mut of_cell = vec![0u32; c.len()];
        let mut parent = vec![0u32];
        for i in w..c.len() {
            if c[i] == 0 {
                continue;
            }
            let left = c[i - 1] == c[i];
            let below = c[i - w] == c[i];
            of_cell[i] = match (left, below) {
                (true, true) => join(&mut parent, of_cell[i - 1], of_cell[i - w]),
                (true, false) => of_cell[i - 1],
                (false, true) => of_cell[i - w],
                (false, false) => {
                    parent.push(parent.len() as u32);
                    parent.len() as u32 - 1
                }
            };
        }
        let mut piece = vec![0u32; parent.len()];
        let mut blocks = Vec::new();
        for (cell, &label) in of_cell.iter_mut().zip(c).filter(|(p, _)| **p != 0) {
            let root = root(&mut parent, *cell) as usize;
            if piece[root] == 0 {
                blocks.push(label - 1);
                piece[root] = blocks.len() as u32;
            }
            *cell = piece[root];
        }
        Self { of_cell, blocks }
    }
}

/// The provisional piece that stands for all that `p` is joined with; ways to it are halved.
fn root(parent: &mut [u32], mut p: u32) -> u32 {
    while parent[p as usize] != p {
        parent[p as usize] = parent[parent[p as usize] as usize];
        p = parent[p as usize];
    }
    p
}

/// Joins two provisional pieces; returns the one that stands for both.
fn join(parent: &mut [u32], a: u32, b: u32) -> u32 {
    if a == b {
        return a;
    }
    let (a, b) = (root(parent, a), root(parent, b));
    parent[a.max(b) as usize] = a.min(b);
    a.min(b)
}

/// Calls `f` with piece, x, y and index of every cell that belongs to one.
fn cells_of(pieces: &Pieces, grid: &PaddedMap, mut f: impl FnMut(usize, usize, usize, usize)) {
    for y in 1..grid.height - 1 {
        for x in 1..grid.width - 1 {
            let i = y * grid.width + x;
            if pieces.of_cell[i] != 0 {
                f(pieces.of_cell[i] as usize - 1, x, y, i);
            }
        }
    }
}

/// Thirds of a cell to the nearest cell of another piece: chamfer 3-4, two sweeps. A map of four
/// million cells is nowhere deeper than 1,000, so 16 bits hold it.
fn depths(grid: &PaddedMap, of_cell: &[u32]) -> Vec<u16> {
    let w = grid.width;
    let mut deep = vec![0u16; of_cell.len()];
    // Up: the shortest ways that come from below and from the left.
    for i in w..of_cell.len() - w {
        if of_cell[i] != 0 {
            deep[i] = u16::MAX;
            deep[i] = depth_from(&deep, of_cell, i, [i - 1, i - w], [i - w - 1, i - w + 1]);
        }
    }
    // Down: those from above and from the right.
    for i in (w..of_cell.len() - w).rev() {
        if of_cell[i] != 0 {
            deep[i] = depth_from(&deep, of_cell, i, [i + 1, i + w], [i + w + 1, i + w - 1]);
        }
    }
    deep
}

/// The depth of cell `i` by way of two cells that share a side with it and two that share a corner: a step is 3 thirds
/// of a cell, or 4, about 3 times the root of 2.
fn depth_from(deep: &[u16], of_cell: &[u32], i: usize, sides: [usize; 2], corners: [usize; 2]) -> u16 {
    let by_way_of = |j: usize, step: u16| step.saturating_add(if of_cell[j] == of_cell[i] { deep[j] } else { 0 });
    let by_sides = sides.into_iter().map(|j| by_way_of(j, 3));
    let by_corners = corners.into_iter().map(|j| by_way_of(j, 4));
    by_sides.chain(by_corners).fold(deep[i], u16::min)
}

/// Directions tried, in degrees, level first.
const TURNS: [i32; 12] = [0, 15, -15, 30, -30, 45, -45, 60, -60, 75, -75, 90];

/// A turned number must be larger than a level one by this factor.
const WORTH_TURNING: f64 = 1.25;

/// The largest font at cell `i`.
fn fit(grid: &PaddedMap, of_cell: &[u32], core: &Core, i: usize, limit: f64) -> Spot {
    let (x, y) = (i % grid.width, i / grid.width);
    let at = [x as f64 + 0.5, y as f64 + 0.5];
    let digits = (core.block + 1).ilog10() + 1;
    let wide = DIGIT * f64::from(digits);
    // The circle round the cell's centre always holds a number; a band as deep holds one as tall.
    let radius = core.radius();
    let sure = (2.0 * radius / math::hypot(wide, TALL)).min(limit);
    let most = (2.0 * radius + 1.0).max(sure * TALL) / TALL;
    let mut spot = Spot { block: core.block, at, font: sure, turn: 0 };
    for turn in TURNS {
        let needed = if spot.turn == 0 && turn != 0 { spot.font * WORTH_TURNING } else { spot.font };
        let mut font = most.min(limit);
        while font > needed {
            if holds(grid, of_cell, i, at, [font * wide / 2.0, font * TALL / 2.0], turn) {
                spot = Spot { font, turn, ..spot };
                break;
            }
            font *= 0.87;
        }
    }
    spot
}

/// Whether the box of half sizes `half` round `at`, turned, lies in the piece of cell `i`: its long
/// sides and its middle line are probed every half cell or, for large boxes, at 24 places.
fn holds(grid: &PaddedMap, of_cell: &[u32], i: usize, at: [f64; 2], half: [f64; 2], turn: i32) -> bool {
    let (sin, cos) = math::sin_cos(f64::from(turn).to_radians());
    let steps = ((half[0] * 4.0).ceil() as i32).clamp(2, 24);
    for k in 0..=steps {
        let u = half[0] * (f64::from(2 * k) / f64::from(steps) - 1.0);
        for v in [-half[1], 0.0, half[1]] {
            let (x, y) = (at[0] + u * cos - v * sin, at[1] + u * sin + v * cos);
            let inside = x >= 1.0 && y >= 1.0 && (x as usize) < grid.width - 1 && (y as usize) < grid.height - 1;
            if !inside || of_cell[y as usize * grid.width + x as usize] != of_cell[i] {
                return false;
            }
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(rows: &[&str]) -> PaddedMap {
        let width = rows[0].len() + 2;
        let mut cells = vec![0; width];
        for row in rows.iter().rev() {
            cells.push(0);
            cells.extend(row.bytes().map(|b| if b == b'.' { 0 } else { u32::from(b - b'0') }));
            cells.push(0);
        }
        cells.extend(vec![0; width]);
        PaddedMap { width, height: rows.len() + 2, cells }
    }

    #[test]
    fn block_number_lies_at_the_point_deepest_inside() {
        let g = grid(&["11111111", "1.....11", "1.222.11", "1.....11", "11111111"]);
        let spots = place(&g, 100.0);
        assert_eq!(spots.iter().map(|s| s.block).collect::<Vec<_>>(), [0, 1]);
        for s in spots {
            assert_eq!(g.cells[s.at[1] as usize * g.width + s.at[0] as usize], s.block + 1);
            assert!(s.font > 0.0, "{s:?}");
        }
        assert_eq!(place(&g, 100.0)[1].at, [4.5, 3.5]);
    }

    #[test]
    fn a_number_is_turned_along_a_steep_band_and_stays_inside() {
        let rows: Vec<String> =
            (0..30i32).map(|y| (0..30i32).map(|x| if (x - y).abs() < 4 { '9' } else { '.' }).collect()).collect();
        let mut g = grid(&rows.iter().map(String::as_str).collect::<Vec<_>>());
        for c in &mut g.cells {
            *c *= 1000;
        }
        let long = place(&g, 100.0)[0];
        assert_eq!(long.turn, -45, "row 0 of the picture is the top: {long:?}");
    }

    #[test]
    fn separate_pieces_of_a_block_are_numbered_each_unless_tiny() {
        let g = grid(&["111...111", "111...111", "111...111", ".........", "1........"]);
        let spots = place(&g, 100.0);
        assert_eq!(spots.len(), 2, "{spots:?}");
    }
}
