//! A texture of whose strokes something is left, request by request: what a measured part takes along, and what jobs
//! before have not marked.

use std::ops::Range;
use std::sync::Arc;

use super::cut_figure::{CutFigure, Cutter};
use super::{Figure, Part, PlacedStrokes, Texture, numbered};
use terrace_core::diag::Error;
use terrace_core::geom::Box2;
use terrace_core::program::PenId;

/// What is left of each stroke of each request.
#[derive(Debug)]
pub(super) struct CutParts<C>(Vec<CutPart<C>>);

#[derive(Debug)]
struct CutPart<C> {
    figure: Arc<CutFigure<C>>,
    /// Where the request's strokes begin, before and after.
    before: u64,
    after: u64,
}

impl<C: Cutter> CutParts<C> {
    /// The strokes that are left of stroke `i` of the texture.
    pub(super) fn pieces(&self, i: usize) -> Range<usize> {
        let i = i as u64;
        let k = self.0.partition_point(|part| part.before <= i) - 1;
        let CutPart { figure, before, after } = &self.0[k];
        let Range { start, end } = figure.pieces_of(i - before);
        (after + start) as usize..(after + end) as usize
    }
}

impl Texture {
    /// The texture as a cutter leaves it, which is made for the strokes of a request and its pen; with what it counted.
    ///
    /// # Errors
    /// `texture-large`; `texture-empty` where nothing is left of a request that had strokes, unless that `may_be`.
    pub(super) fn cut_by<C: Cutter + 'static>(
        &self,
        cutter: impl Fn(&Arc<dyn Figure>, PenId) -> Arc<C>,
        may_be: bool,
    ) -> Result<(Self, C::Tally, CutParts<C>), Error> {
        let mut texture = Self { parts: Vec::new(), len: 0, points: 0, bounds: Box2::EMPTY, directions: None, ..*self };
        let mut tally = C::Tally::default();
        let mut parts = Vec::new();
        for (k, part) in self.parts.iter().enumerate() {
            let base = part.base();
            let may_be_empty = may_be || base.is_empty();
            let cutter = cutter(&base, part.pen);
            let (figure, counted) = CutFigure::new(base, cutter).map_err(|e| numbered(&e, k))?;
            tally += counted;
            let figure = Arc::new(figure);
            texture.bounds = texture.bounds.union(figure.bounds());
            let placed = PlacedStrokes::Figure(Arc::clone(&figure) as Arc<dyn Figure>);
            texture.parts.push(Part { placed, masked: None, border: None, slip: None, artwork: None, ..part.clone() });
            if may_be_empty { texture.count_any(k) } else { texture.count(k) }?;
            parts.push(CutPart { figure, before: part.start, after: texture.parts[k].start });
        }
        Ok((texture, tally, CutParts(parts)))
    }
}
