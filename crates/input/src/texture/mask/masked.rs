//! A figure of which a border leaves a part: which strokes are whole, which are cut, and the pieces of these on
//! request.

use std::ops::Range;
use std::sync::{Arc, Mutex, PoisonError};

use super::border::Border;
use crate::texture::clip::Polylines;
use crate::texture::place::push;
use crate::texture::{Figure, MAX_STROKES, too_large};
use terrace_core::diag::Error;
use terrace_core::geom::{Box2, NM_PER_MM, P2};
use terrace_core::parallel;
use terrace_core::program::PenId;

/// Most strokes that the border cuts, or runs of strokes that it does not.
const MAX_RUNS: usize = 16_000_000;

/// Strokes of a task, at most, and tasks between two looks at the limits.
const CHUNK: u64 = 1 << 16;
const TASKS: u64 = 256;

/// Strokes with more pieces than this are kept after they were cut, as neighbouring pieces are asked for in turn.
const FEW_PIECES: u32 = 4;

/// Most points of strokes that are kept, unless it is one stroke alone.
const MAX_KEPT: usize = 1 << 20;

/// What is left of a figure.
#[derive(Debug)]
pub(in crate::texture) struct Masked {
    base: Arc<dyn Figure>,
    border: Arc<Border>,
    runs: Vec<StrokeRun>,
    len: u64,
    points: u64,
    bounds: Box2,
    /// The pieces of strokes that were cut last, by the index of the stroke of the figure.
    kept: Mutex<Vec<(u64, Arc<Polylines>)>>,
}

/// The pieces of one stroke of the figure, or strokes of it that follow each other and are not cut.
#[derive(Clone, Copy, Debug)]
struct StrokeRun {
    /// Index of the first stroke of the run.
    start: u32,
    /// Index of the stroke of the figure that this one is, or is a piece of.
    base: u32,
    /// How many pieces of this stroke there are; 0 for strokes that are not cut, up to the next run.
    pieces: u32,
}

/// Where a stroke comes from.
struct StrokeOrigin {
    /// Index of the stroke of the figure.
    base: u64,
    /// Which of its pieces it is; None where it is not cut.
    piece: Option<usize>,
    /// How many pieces it has; 0 where it is not cut.
    count: u32,
}

/// What the border leaves of a range of strokes.
#[derive(Default)]
struct RangeLeft {
    runs: Vec<StrokeRun>,
    len: u64,
    points: u64,
    bounds: Option<Box2>,
}

/// Buffers reused from stroke to stroke.
#[derive(Default)]
struct Scratch {
    points: Vec<P2>,
    line: Vec<[f64; 2]>,
    pieces: Polylines,
    hard: Polylines,
}

impl Masked {
    /// Finds out what the border leaves.
    ///
    /// # Errors
    /// `texture-large`.
    pub(in crate::texture) fn new(base: Arc<dyn Figure>, border: Arc<Border>) -> Result<Self, Error> {
        let mut masked = Self {
            base,
            border,
            runs: Vec::new(),
            len: 0,
            points: 0,
            bounds: Box2::EMPTY,
            kept: Mutex::new(Vec::new()),
        };
        let strokes = masked.base.len();
        // By the number of strokes alone, so that the result is the same for any number of threads.
        let chunk = strokes.div_ceil(TASKS).clamp(1, CHUNK);
        let mut from = 0;
        while from < strokes {
            let to = (from + chunk * TASKS).min(strokes);
            let tasks = (to - from).div_ceil(chunk) as usize;
            let ranges = parallel::map(tasks, |k| {
                let first = from + k as u64 * chunk;
                masked.cut_range(first, (first + chunk).min(to))
            });
            ranges.into_iter().try_for_each(|range| masked.append(range))?;
            from = to;
        }
        Ok(masked)
    }

    /// Appends what is left of the range of strokes that follows.
    fn append(&mut self, range: RangeLeft) -> Result<(), Error> {
        if self.len + range.len > MAX_STROKES || self.runs.len() + range.runs.len() > MAX_RUNS {
            return Err(too_large(self.len + range.len, self.points + range.points).into());
        }
        let before = self.len as u32;
        self.runs.extend(range.runs.iter().map(|run| StrokeRun { start: run.start + before, ..*run }));
        self.len += range.len;
        self.points += range.points;
        self.bounds = range.bounds.map_or(self.bounds, |b| self.bounds.union(b));
        Ok(())
    }

    /// What the border leaves of strokes `first..end` of the figure; indices count from the first that is left.
    fn cut_range(&self, first: u64, end: u64) -> RangeLeft {
        let mut left = RangeLeft::default();
        let mut scratch = Scratch::default();
        // The stroke that would continue the run of untouched strokes.
        let mut run_next = None;
        for base in first..end {
            let is_whole = self.cut(base, &mut scratch);
            let pieces = scratch.pieces.len();
            if pieces == 0 {
                // Nothing is left of it: the next untouched stroke begins a new run.
                continue;
            }
            let start = left.len as u32;
            if !is_whole {
                left.runs.push(StrokeRun { start, base: base as u32, pieces: pieces as u32 });
            } else if run_next != Some(base) {
                left.runs.push(StrokeRun { start, base: base as u32, pieces: 0 });
            }
            run_next = is_whole.then_some(base + 1);
            left.len += pieces as u64;
            left.points += scratch.pieces.points.len() as u64;
            let mut bounds = left.bounds.unwrap_or(Box2::EMPTY);
            scratch.pieces.points.iter().for_each(|&p| bounds.add(nm(p)));
            left.bounds = Some(bounds);
        }
        left
    }

    /// Cuts a stroke of the figure; returns whether it is left as it is.
    fn cut(&self, base: u64, scratch: &mut Scratch) -> bool {
        let Scratch { points, line, pieces, hard } = scratch;
        points.clear();
        self.base.stroke(base, points);
        line.clear();
        line.extend(points.iter().map(|p| p.mm()));
        pieces.clear();
        self.border.cut(line, base, hard, pieces);
        pieces.len() == 1 && pieces.get(0) == line.as_slice()
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
    pub(in crate::texture) fn pieces_of(&self, base: u64) -> Range<u64> {
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
    fn pieces(&self, base: u64, count: u32) -> Arc<Polylines> {
        let lock = || self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        if count > FEW_PIECES
            && let Some((_, known)) = lock().iter().find(|(known, _)| *known == base)
        {
            return Arc::clone(known);
        }
        let mut scratch = Scratch::default();
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

/// The point on the nanometre grid.
fn nm(p: [f64; 2]) -> P2 {
    let [x, y] = p.map(|v| (v * NM_PER_MM).round() as i64);
    P2::new(x, y)
}

impl Figure for Masked {
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
            None => self.base.stroke(base, out),
            Some(k) => self.pieces(base, count).get(k).iter().for_each(|&p| push(out, nm(p))),
        }
    }

    fn element(&self, i: u64) -> String {
        let StrokeOrigin { base, piece, count } = self.origin(i);
        let name = self.base.element(base);
        piece.filter(|_| count > 1).map_or(name.clone(), |k| format!("{name}, piece {}", k + 1))
    }

    fn pen(&self, i: u64) -> Option<PenId> {
        self.base.pen(self.origin(i).base)
    }
}
