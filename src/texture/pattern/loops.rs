//! Closed loops on a square lattice: squares, or circles as polygons (FSS cells).
//!
//! Centres at x0 + (i + 1/2) pitch, y0 + (j + 1/2) pitch for the whole cells that fit into the area;
//! row by row from the lower left, every second row backwards. Loops run counter-clockwise: squares
//! from their lower left corner, circles from their rightmost point. The vertices of a circle lie on
//! it, its chords within the tolerance.

use std::f64::consts::TAU;

use crate::diag::{Diag, Error};
use crate::geom::{Box2, BoxMm, P2};
use crate::texture::Figure;
use crate::texture::place::{LEAST, Turn, push, steps};
use crate::texture::{MAX_STROKES, too_large};

/// Fewest segments of a circle.
const LEAST_SEGMENTS: f64 = 8.0;

#[derive(Debug)]
pub(in crate::texture) struct Loops {
    /// Centre of the lower left cell.
    first: [f64; 2],
    pitch: f64,
    columns: u64,
    rows: u64,
    /// Vertices about the centre; the last is the first.
    vertices: Vec<[f64; 2]>,
    turn: Turn,
}

impl Figure for Loops {
    fn len(&self) -> u64 {
        self.columns * self.rows
    }

    fn points(&self) -> u64 {
        self.len() * self.vertices.len() as u64
    }

    /// The extremes of a lattice are taken by its corners.
    fn bounds(&self) -> Box2 {
        let mut bounds = Box2::EMPTY;
        if self.len() == 0 {
            return bounds;
        }
        let mut out = Vec::new();
        for row in [0, self.rows - 1] {
            for column in [0, self.columns - 1] {
                out.clear();
                self.draw(row, column, &mut out);
                out.iter().for_each(|&p| bounds.add(p));
            }
        }
        bounds
    }

    fn stroke(&self, i: u64, out: &mut Vec<P2>) {
        let (row, column) = self.cell(i);
        self.draw(row, column, out);
    }

    fn element(&self, i: u64) -> String {
        let (row, column) = self.cell(i);
        format!("loop in row {}, column {}", row + 1, column + 1)
    }
}

impl Loops {
    pub(in crate::texture) fn squares(area: BoxMm<2>, cell: f64, pitch: f64, turn: Turn) -> Result<Self, Error> {
        let r = cell / 2.0;
        Self::new(area, cell, pitch, turn, vec![[-r, -r], [r, -r], [r, r], [-r, r], [-r, -r]])
    }

    pub(in crate::texture) fn circles(
        area: BoxMm<2>,
        cell: f64,
        pitch: f64,
        tolerance: f64,
        turn: Turn,
    ) -> Result<Self, Error> {
        let r = cell / 2.0;
        // The sagitta of a chord over the angle a is r (1 - cos(a / 2)), at most r a² / 8.
        let wanted = (TAU * (r / (8.0 * tolerance)).sqrt()).ceil().max(LEAST_SEGMENTS);
        // Chords shorter than two nanometres would only repeat points.
        let n = wanted.min((TAU * r / LEAST).floor()).max(LEAST_SEGMENTS) as u32;
        let mut vertices: Vec<_> = (0..n)
            .map(|k| {
                let (sin, cos) = (TAU * f64::from(k) / f64::from(n)).sin_cos();
                [r * cos, r * sin]
            })
            .collect();
        vertices.push(vertices[0]);
        Self::new(area, cell, pitch, turn, vertices)
    }

    fn new(area: BoxMm<2>, cell: f64, pitch: f64, turn: Turn, vertices: Vec<[f64; 2]>) -> Result<Self, Error> {
        // Eight chords of a circle of 6 nm are longer than two nanometres.
        if !(cell >= 3.0 * LEAST && cell.is_finite()) {
            return Err(Diag::input("texture-cell", format!("a cell of {cell} mm is too small to mark")).into());
        }
        if !(pitch >= cell && pitch.is_finite()) {
            let text = format!("cells of {cell} mm do not fit a pitch of {pitch} mm");
            return Err(Diag::input("texture-cell", text).hint("use a pitch of at least the cell's size").into());
        }
        let [columns, rows] = area.size().map(|side| steps(side, pitch));
        if columns * rows > MAX_STROKES as f64 {
            let n = (columns * rows) as u64;
            return Err(too_large(n, n.saturating_mul(vertices.len() as u64)).into());
        }
        let first = area.lo.map(|v| v + 0.5 * pitch);
        Ok(Self { first, pitch, columns: columns as u64, rows: rows as u64, vertices, turn })
    }

    #[inline]
    fn cell(&self, i: u64) -> (u64, u64) {
        let (row, k) = (i / self.columns, i % self.columns);
        (row, if row % 2 == 0 { k } else { self.columns - 1 - k })
    }

    fn draw(&self, row: u64, column: u64, out: &mut Vec<P2>) {
        let [x, y] = [self.first[0] + column as f64 * self.pitch, self.first[1] + row as f64 * self.pitch];
        for v in &self.vertices {
            push(out, self.turn.nm([x + v[0], y + v[1]]));
        }
    }
}
