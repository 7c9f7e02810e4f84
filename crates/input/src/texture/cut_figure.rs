//! A figure of whose strokes something is left: which strokes are one piece, which are several, and the pieces on
//! request.
//!
//! What is left of a stroke is computed whenever it is asked for, so that it takes no memory; only how many pieces
//! there are is kept, in runs.

use std::fmt::Debug;
use std::ops::{AddAssign, Range};
use std::sync::{Arc, Mutex, PoisonError};

use super::place::push;
use super::{Figure, MAX_STROKES, too_large};
use terrace_core::diag::Error;
use terrace_core::geom::{Box2, P2};
use terrace_core::parallel;
use terrace_core::program::PenId;

/// Most strokes that are cut, or runs of strokes that are not.
const MAX_RUNS: usize = 16_000_000;

/// Strokes of a task, at most, and tasks between two looks at the limits.
const CHUNK: u64 = 1 << 16;
const TASKS: u64 = 256;

/// Strokes with more pieces than this are kept after they were cut, as neighbouring pieces are asked for in turn.
const FEW_PIECES: u32 = 4;

/// Most points of strokes that are kept, unless it is one stroke alone.
const MAX_KEPT: usize = 1 << 20;

/// What cuts or moves the strokes of a figure.
pub(super) trait Cutter: Debug + Send + Sync {
    /// What is reused from stroke to stroke.
    type Scratch;
    /// What is counted of strokes, beside their pieces.
    type Tally: AddAssign + Default + Send;

    /// What the first stroke begins with.
    fn scratch(&self) -> Self::Scratch;

    /// Leaves in `pieces`, which is empty, what is left of stroke `i` of the figure.
    fn cut(&self, i: u64, points: &[P2], scratch: &mut Self::Scratch, pieces: &mut Pieces) -> Self::Tally;

    /// Whether a stroke of which one piece is left may be cut again for it. Otherwise only those are in one run that are
    /// left as they are.
    fn is_cheap(&self) -> bool;
}

/// Polylines and dots in one flat array.
#[derive(Debug, Default)]
pub(super) struct Pieces {
    points: Vec<P2>,
    ends: Vec<usize>,
}

impl Pieces {
    fn clear(&mut self) {
        self.points.clear();
        self.ends.clear();
    }

    pub(super) fn len(&self) -> usize {
        self.ends.len()
    }

    pub(super) fn get(&self, k: usize) -> &[P2] {
        &self.points[if k == 0 { 0 } else { self.ends[k - 1] }..self.ends[k]]
    }

    /// Appends a piece; neighbours that are equal become one point. One that has no length is left out, unless it is a
    /// dot.
    pub(super) fn push(&mut self, points: impl IntoIterator<Item = P2>, is_dot: bool) {
        let start = self.points.len();
        for p in points {
            if self.points.len() == start || self.points.last() != Some(&p) {
                self.points.push(p);
            }
        }
        if self.points.len() - start > usize::from(!is_dot) {
            self.ends.push(self.points.len());
        } else {
            self.points.truncate(start);
        }
    }
}

/// What is left of a figure.
#[derive(Debug)]
pub(super) struct CutFigure<C> {
    base: Arc<dyn Figure>,
    cutter: Arc<C>,
    runs: Vec<StrokeRun>,
    len: u64,
    points: u64,
    bounds: Box2,
    /// The pieces of strokes that were cut last, by the index of the stroke of the figure.
    kept: Mutex<Vec<(u64, Arc<Pieces>)>>,
}

/// The pieces of one stroke of the figure, or strokes of it that follow each other and are one piece each.
#[derive(Clone, Copy, Debug)]
struct StrokeRun {
    /// Index of the first stroke of the run.
    start: u32,
    /// Index of the stroke of the figure that this one is, or is a piece of.
    base: u32,
    /// How many pieces of this stroke there are; 0 for strokes that are one piece each, up to the next run.
    pieces: u32,
}

/// Where a stroke comes from.
struct StrokeOrigin {
    /// Index of the stroke of the figure.
    base: u64,
    /// Which of its pieces it is; None where it is the only one.
    piece: Option<usize>,
    /// How many pieces it has; 0 where it is the only one.
    count: u32,
}

/// What is left of a range of strokes.
struct RangeLeft<T> {
    runs: Vec<StrokeRun>,
    len: u64,
    points: u64,
    bounds: Option<Box2>,
    tally: T,
}

/// Buffers reused from stroke to stroke.
struct Scratch<S> {
    points: Vec<P2>,
    pieces: Pieces,
    cutter: S,
}

impl<C: Cutter> CutFigure<C> {
    /// Finds out what is left, and what was counted.
    ///
    /// # Errors
    /// `texture-large`.
    pub(super) fn new(base: Arc<dyn Figure>, cutter: Arc<C>) -> Result<(Self, C::Tally), Error> {
        let mut figure = Self {
            base,
            cutter,
            runs: Vec::new(),
            len: 0,
            points: 0,
            bounds: Box2::EMPTY,
            kept: Mutex::new(Vec::new()),
        };
        let strokes = figure.base.len();
        // By the number of strokes alone, so that the result is the same for any number of threads.
        let chunk = strokes.div_ceil(TASKS).clamp(1, CHUNK);
        let mut tally = C::Tally::default();
        let mut from = 0;
        while from < strokes {
            let to = (from + chunk * TASKS).min(strokes);
            let tasks = (to - from).div_ceil(chunk) as usize;
            let ranges = parallel::map(tasks, |k| {
                let first = from + k as u64 * chunk;
                figure.cut_range(first, (first + chunk).min(to))
            });
            for range in ranges {
                tally += figure.append(range)?;
            }
            from = to;
        }
        Ok((figure, tally))
    }

    /// Appends what is left of the range of strokes that follows.
    fn append(&mut self, range: RangeLeft<C::Tally>) -> Result<C::Tally, Error> {
        if self.len + range.len > MAX_STROKES || self.runs.len() + range.runs.len() > MAX_RUNS {
            return Err(too_large(self.len + range.len, self.points + range.points).into());
        }
        let before = self.len as u32;
        self.runs.extend(range.runs.iter().map(|run| StrokeRun { start: run.start + before, ..*run }));
        self.len += range.len;
        self.points += range.points;
        self.bounds = range.bounds.map_or(self.bounds, |b| self.bounds.union(b));
        Ok(range.tally)
    }

    /// What is left of strokes `first..end` of the figure; indices count from the first that is left.
    fn cut_range(&self, first: u64, end: u64) -> RangeLeft<C::Tally> {
        let mut left = RangeLeft { runs: Vec::new(), len: 0, points: 0, bounds: None, tally: C::Tally::default() };
        let mut scratch = self.scratch();
        // The stroke that would continue the run of single pieces.
        let mut run_next = None;
        for base in first..end {
            left.tally += self.cut(base, &mut scratch);
            let pieces = scratch.pieces.len();
            if pieces == 0 {
                // Nothing is left of it: the next single piece begins a new run.
                continue;
            }
            let is_single =
                pieces == 1 && (self.cutter.is_cheap() || scratch.pieces.get(0) == scratch.points.as_slice());
            let start = left.len as u32;
            if !is_single {
                left.runs.push(StrokeRun { start, base: base as u32, pieces: pieces as u32 });
            } else if run_next != Some(base) {
                left.runs.push(StrokeRun { start, base: base as u32, pieces: 0 });
            }
            run_next = is_single.then_some(base + 1);
            left.len += pieces as u64;
            left.points += scratch.pieces.points.len() as u64;
            let mut bounds = left.bounds.unwrap_or(Box2::EMPTY);
            scratch.pieces.points.iter().for_each(|&p| bounds.add(p));
            left.bounds = Some(bounds);
        }
        left
    }

    fn scratch(&self) -> Scratch<C::Scratch> {
        Scratch { points: Vec::new(), pieces: Pieces::default(), cutter: self.cutter.scratch() }
    }

    /// Cuts a stroke of the figure.
    fn cut(&self, base: u64, scratch: &mut Scratch<C::Scratch>) -> C::Tally {
        let Scratch { points, pieces, cutter } = scratch;
        points.clear();
        self.base.stroke(base, points);
        pieces.clear();
        self.cutter.cut(base, points, cutter, pieces)
    }

    /// Where stroke `i` comes from.
    fn origin(&self, i: u64) -> StrokeOrigin {
        let run = self.runs[self.runs.partition_point(|run| u64::from(run.start) <= i) - 1];
        let base = u64::from(run.base);
        let k = i - u64::from(run.start);
        match run.pieces {
            0 => StrokeOrigin { base: base + k, piece: None, count: 0 },
            count => StrokeOrigin { base, piece: Some(k as usize), count },
        }
    }

    /// The indices of the pieces of a stroke of the figure.
    pub(super) fn pieces_of(&self, base: u64) -> Range<u64> {
        let next = self.runs.partition_point(|run| u64::from(run.base) <= base);
        let Some(run) = next.checked_sub(1).map(|k| self.runs[k]) else { return 0..0 };
        let start = u64::from(run.start);
        let end = self.runs.get(next).map_or(self.len, |run| u64::from(run.start));
        let k = base - u64::from(run.base);
        match run.pieces {
            0 if start + k < end => start + k..start + k + 1,
            pieces if k == 0 => start..start + u64::from(pieces),
            _ => 0..0,
        }
    }

    /// The pieces of a stroke of the figure, which has `count` of them.
    fn pieces(&self, base: u64, count: u32) -> Arc<Pieces> {
        let lock = || self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        if count > FEW_PIECES
            && let Some((_, known)) = lock().iter().find(|(known, _)| *known == base)
        {
            return Arc::clone(known);
        }
        let mut scratch = self.scratch();
        self.cut(base, &mut scratch);
        let pieces = Arc::new(scratch.pieces);
        if count > FEW_PIECES {
            let mut kept = lock();
            kept.push((base, Arc::clone(&pieces)));
            while kept.len() > 1 && kept.iter().map(|(_, p)| p.points.len()).sum::<usize>() > MAX_KEPT {
                kept.remove(0);
            }
        }
        pieces
    }
}

impl<C: Cutter> Figure for CutFigure<C> {
    fn len(&self) -> u64 {
        self.len
    }

    fn points(&self) -> u64 {
        self.points
    }

    fn bounds(&self) -> Box2 {
        self.bounds
    }

    fn stroke(&self, i: u64, out: &mut Vec<P2>) {
        let StrokeOrigin { base, piece, count } = self.origin(i);
        match piece {
            None if !self.cutter.is_cheap() => self.base.stroke(base, out),
            _ => self.pieces(base, count).get(piece.unwrap_or(0)).iter().for_each(|&p| push(out, p)),
        }
    }

    fn element(&self, i: u64) -> String {
        let StrokeOrigin { base, piece, count } = self.origin(i);
        let name = self.base.element(base);
        piece.filter(|_| count > 1).map_or(name.clone(), |k| format!("{name}, piece {}", k + 1))
    }

    fn dot_pens(&self, own: PenId) -> std::collections::BTreeSet<PenId> {
        self.base.dot_pens(own)
    }

    fn pen(&self, i: u64) -> Option<PenId> {
        self.base.pen(self.origin(i).base)
    }
}
