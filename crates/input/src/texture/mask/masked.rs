//! A figure of which a border leaves a part: which strokes are whole, which are cut, and the pieces of these on
//! request.

use std::ops::Range;
use std::sync::{Arc, Mutex, PoisonError};

use super::border::Border;
use crate::texture::clip::Lines;
use crate::texture::place::push;
use crate::texture::{Figure, MAX_STROKES, too_large};
use terrace_core::diag::Error;
use terrace_core::geom::{Box2, NM_PER_MM, P2};
use terrace_core::parallel;
use terrace_core::program::PenId;

/// Most strokes that the border cuts, or runs of strokes that it does not.
const MAX_LISTED: usize = 16_000_000;

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
    list: Vec<Entry>,
    len: u64,
    points: u64,
    bounds: Box2,
    kept: Mutex<Vec<(u64, Arc<Lines>)>>,
}

/// Strokes of the figure that follow each other.
#[derive(Clone, Copy, Debug)]
struct Entry {
    /// Index of the first.
    start: u32,
    /// Index of the stroke of the figure that it is, or is a piece of.
    base: u32,
    /// Pieces of this stroke; 0 for a run of strokes that are not cut, up to the next entry.
    pieces: u32,
}

/// What the border leaves of a range of strokes.
#[derive(Default)]
struct RangeLeft {
    list: Vec<Entry>,
    len: u64,
    points: u64,
    bounds: Option<Box2>,
}

/// Buffers reused from stroke to stroke.
#[derive(Default)]
struct Scratch {
    points: Vec<P2>,
    line: Vec<[f64; 2]>,
    pieces: Lines,
    hard: Lines,
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
            list: Vec::new(),
            len: 0,
            points: 0,
            bounds: Box2::EMPTY,
            kept: Mutex::new(Vec::new()),
        };
        let all = masked.base.len();
        let chunk = all.div_ceil(TASKS).clamp(1, CHUNK);
        let mut from = 0;
        while from < all {
            let to = (from + chunk * TASKS).min(all);
            let tasks = (to - from).div_ceil(chunk) as usize;
            let found = parallel::map(tasks, |k| {
                let first = from + k as u64 * chunk;
                masked.cut_range(first, (first + chunk).min(to))
            });
            for found in found {
                if masked.len + found.len > MAX_STROKES || masked.list.len() + found.list.len() > MAX_LISTED {
                    return Err(too_large(masked.len + found.len, masked.points + found.points).into());
                }
                let before = masked.len as u32;
                masked.list.extend(found.list.iter().map(|e| Entry { start: e.start + before, ..*e }));
                masked.len += found.len;
                masked.points += found.points;
                masked.bounds = found.bounds.map_or(masked.bounds, |b| masked.bounds.union(b));
            }
            from = to;
        }
        Ok(masked)
    }

    /// What the border leaves of strokes `first..end` of the figure; indices count from the first that is left.
    fn cut_range(&self, first: u64, end: u64) -> RangeLeft {
        let mut found = RangeLeft::default();
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
            let (start, stroke) = (found.len as u32, base as u32);
            if !is_whole {
                found.list.push(Entry { start, base: stroke, pieces: pieces as u32 });
            } else if run_next != Some(base) {
                found.list.push(Entry { start, base: stroke, pieces: 0 });
            }
            run_next = is_whole.then_some(base + 1);
            found.len += pieces as u64;
            found.points += scratch.pieces.points.len() as u64;
            let mut bounds = found.bounds.unwrap_or(Box2::EMPTY);
            scratch.pieces.points.iter().for_each(|&p| bounds.add(nm(p)));
            found.bounds = Some(bounds);
        }
        found
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

    /// The stroke of the figure that stroke `i` is, or of which it is a piece, and which one.
    fn find_base(&self, i: u64) -> (u64, Option<usize>, u32) {
        let entry = self.list[self.list.partition_point(|e| u64::from(e.start) <= i) - 1];
        let k = i - u64::from(entry.start);
        match entry.pieces {
            0 => (u64::from(entry.base) + k, None, 0),
            pieces => (u64::from(entry.base), Some(k as usize), pieces),
        }
    }

    /// The indices of the pieces of a stroke of the figure.
    pub(in crate::texture) fn pieces_of(&self, base: u64) -> Range<u64> {
        let next = self.list.partition_point(|e| u64::from(e.base) <= base);
        let Some(entry) = next.checked_sub(1).map(|k| self.list[k]) else { return 0..0 };
        let start = u64::from(entry.start);
        let end = self.list.get(next).map_or(self.len, |e| u64::from(e.start));
        let k = base - u64::from(entry.base);
        match entry.pieces {
            0 if start + k < end => start + k..start + k + 1,
            pieces if k == 0 => start..start + u64::from(pieces),
            _ => 0..0,
        }
    }

    /// The pieces of a stroke.
    fn pieces(&self, base: u64, count: u32) -> Arc<Lines> {
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
        match self.find_base(i) {
            (base, None, _) => self.base.stroke(base, out),
            (base, Some(k), count) => self.pieces(base, count).get(k).iter().for_each(|&p| push(out, nm(p))),
        }
    }

    fn element(&self, i: u64) -> String {
        let (base, piece, count) = self.find_base(i);
        let name = self.base.element(base);
        piece.filter(|_| count > 1).map_or(name.clone(), |k| format!("{name}, piece {}", k + 1))
    }

    fn pen(&self, i: u64) -> Option<PenId> {
        self.base.pen(self.find_base(i).0)
    }
}
