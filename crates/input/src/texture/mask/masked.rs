//! A figure of which a border leaves a part.

use super::border::Border;
use crate::texture::clip::Polylines;
use crate::texture::cut_figure::{CutFigure, Cutter, Pieces};
use terrace_core::geom::{NM_PER_MM, P2};

/// What a border leaves of a figure.
pub(in crate::texture) type Masked = CutFigure<Border>;

/// Buffers reused from stroke to stroke.
#[derive(Default)]
pub(in crate::texture) struct BorderScratch {
    line: Vec<[f64; 2]>,
    left: Polylines,
    hard: Polylines,
}

impl Cutter for Border {
    type Scratch = BorderScratch;
    type Tally = Nothing;

    fn scratch(&self) -> BorderScratch {
        BorderScratch::default()
    }

    fn cut(&self, i: u64, points: &[P2], scratch: &mut BorderScratch, pieces: &mut Pieces) -> Nothing {
        let BorderScratch { line, left, hard } = scratch;
        line.clear();
        line.extend(points.iter().map(|p| p.mm()));
        left.clear();
        Self::cut(self, line, i, hard, left);
        // Dots are whole or not there; a border leaves no line without length.
        left.iter().for_each(|piece| pieces.push(piece.iter().map(|&p| nm(p)), true));
        Nothing
    }

    fn is_cheap(&self) -> bool {
        false
    }
}

/// Nothing is counted of what a border leaves out.
#[derive(Default)]
pub(in crate::texture) struct Nothing;

impl std::ops::AddAssign for Nothing {
    fn add_assign(&mut self, _: Self) {}
}

/// The point on the nanometre grid.
fn nm(p: [f64; 2]) -> P2 {
    let [x, y] = p.map(|v| (v * NM_PER_MM).round() as i64);
    P2::new(x, y)
}
