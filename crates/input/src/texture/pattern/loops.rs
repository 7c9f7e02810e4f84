//! Closed loops on a lattice (FSS cells): each cell has the outlines of [`Shape`].
//!
//! The lattice is made of tiles, of which as many whole ones are used as fit into the area, the first in its lower left
//! corner. A tile of a square lattice is a square of side pitch: centres at x0 + (i + 1/2) pitch, y0 + (j + 1/2) pitch.
//! A tile of a hexagonal one is a regular hexagon of width pitch with a corner at the top, of height 2 s with
//! s = pitch / √3: centres at x0 + (i + 1/2) pitch, in every second row half a pitch further right, and
//! y0 + s + 3/2 s j. A cell lies within its tile, so cells do not overlap.
//!
//! Cells are marked row by row from the lower left, every second row backwards; a cell has all its loops in turn.

use crate::texture::Figure;
use crate::texture::place::{SLACK, Turn, push, steps};
use crate::texture::{MAX_STROKES, too_large};
use terrace_core::diag::{Diag, Error};
use terrace_core::geom::{Box2, BoxMm, P2};

use super::Lattice;
use crate::texture::kind::Shape;

#[derive(Debug)]
pub(in crate::texture) struct Loops {
    /// Centre of the lower left cell.
    first: [f64; 2],
    /// Distance of neighbours in a row, and of rows.
    pitch: [f64; 2],
    /// By how much rows 1, 3, ... lie further right.
    shift: f64,
    /// Cells of rows 0, 2, ..., and of rows 1, 3, ...
    columns: [u64; 2],
    rows: u64,
    /// Outlines about the centre; the last point of each is the first.
    outlines: Vec<Vec<[f64; 2]>>,
    turn: Turn,
}

impl Figure for Loops {
    fn len(&self) -> u64 {
        self.cells() * self.outlines.len() as u64
    }

    fn points(&self) -> u64 {
        self.cells() * self.outlines.iter().map(|o| o.len() as u64).sum::<u64>()
    }

    /// The rows of one kind are a rectangle: its extremes are taken by its corners.
    fn bounds(&self) -> Box2 {
        let mut bounds = Box2::EMPTY;
        let mut out = Vec::new();
        for kind in [0, 1] {
            let columns = self.columns[kind as usize];
            if columns == 0 || self.rows <= kind {
                continue;
            }
            let last = kind + (self.rows - 1 - kind) / 2 * 2;
            for (row, column) in [(kind, 0), (kind, columns - 1), (last, 0), (last, columns - 1)] {
                for outline in &self.outlines {
                    out.clear();
                    self.draw(row, column, outline, &mut out);
                    out.iter().for_each(|&p| bounds.add(p));
                }
            }
        }
        bounds
    }

    fn stroke(&self, i: u64, out: &mut Vec<P2>) {
        let n = self.outlines.len() as u64;
        let (row, column) = self.cell(i / n);
        self.draw(row, column, &self.outlines[(i % n) as usize], out);
    }

    fn element(&self, i: u64) -> String {
        let n = self.outlines.len() as u64;
        let (row, column) = self.cell(i / n);
        let which = if n > 1 { format!("loop {} of the cell", i % n + 1) } else { "loop".into() };
        format!("{which} in row {}, column {}", row + 1, column + 1)
    }
}

impl Loops {
    /// Cells of a size, `pitch` apart.
    ///
    /// # Errors
    /// `texture-cell`, `texture-large`.
    pub(in crate::texture) fn new(
        shape: Shape,
        size: f64,
        pitch: f64,
        lattice: Lattice,
        area: BoxMm<2>,
        tolerance: f64,
        turn: Turn,
    ) -> Result<Self, Error> {
        let outlines = shape.outlines(size, tolerance)?;
        let room = outlines.iter().flatten().map(|&p| 2.0 * lattice.reach(p)).fold(size, f64::max);
        if !(pitch * (1.0 + SLACK) >= room && pitch.is_finite()) {
            let text = format!("cells of {size} mm do not fit a pitch of {pitch} mm");
            return Err(Diag::input("texture-cell", text)
                .hint(format!("use a pitch of at least {} mm, or smaller cells", (room * 1e6).ceil() / 1e6))
                .into());
        }
        let [width, height] = area.size();
        let side = pitch / 3f64.sqrt();
        let (tile, rise, shift) = match lattice {
            Lattice::Square => (pitch, pitch, 0.0),
            Lattice::Hex => (2.0 * side, 1.5 * side, pitch / 2.0),
        };
        let columns = [0.0, shift].map(|shift| steps((width - shift).max(0.0), pitch));
        let rows = steps((height - (tile - rise)).max(0.0), rise);
        let strokes = (columns[0] + columns[1]) / 2.0 * rows * outlines.len() as f64;
        if strokes > MAX_STROKES as f64 {
            let n = strokes as u64;
            return Err(too_large(n, n.saturating_mul(outlines[0].len() as u64)).into());
        }
        let first = [area.lo[0] + 0.5 * pitch, area.lo[1] + 0.5 * tile];
        let columns = columns.map(|n| n as u64);
        Ok(Self { first, pitch: [pitch, rise], shift, columns, rows: rows as u64, outlines, turn })
    }

    fn cells(&self) -> u64 {
        self.columns[0] * self.rows.div_ceil(2) + self.columns[1] * (self.rows / 2)
    }

    #[inline]
    pub(super) fn cell(&self, i: u64) -> (u64, u64) {
        let [even, odd] = self.columns;
        // Odd rows run back.
        let pair = i / (even + odd);
        let k = i % (even + odd);
        if k < even { (2 * pair, k) } else { (2 * pair + 1, odd - 1 - (k - even)) }
    }

    /// The centre of a cell.
    pub(super) fn centre(&self, row: u64, column: u64) -> [f64; 2] {
        let shift = if row.is_multiple_of(2) { 0.0 } else { self.shift };
        [self.first[0] + column as f64 * self.pitch[0] + shift, self.first[1] + row as f64 * self.pitch[1]]
    }

    fn draw(&self, row: u64, column: u64, outline: &[[f64; 2]], out: &mut Vec<P2>) {
        let [x, y] = self.centre(row, column);
        for v in outline {
            push(out, self.turn.nm([x + v[0], y + v[1]]));
        }
    }
}
