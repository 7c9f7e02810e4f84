//! A texture stroke traced over the surface: what lies under it, piece by piece.
//!
//! Consumes strokes of the texture, the surface and the grid of sections; promises pieces that tile
//! every segment of the stroke: each lies in one section, its height is linear, or it says why it is
//! not marked. Partition and split both look at the part through this one window, so what the first
//! saw is what the second cuts. Units: nm; slopes as squared tangents.

use std::collections::hash_map::Entry;

use rustc_hash::FxHashMap;

use crate::geom::P2;
use crate::program::Sections;
use crate::surface::{Cursor, Span, Surface};

/// Why a piece is not marked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Skip {
    /// No part under it.
    OffPart,
    /// The surface is steeper than the limit.
    Steep,
}

/// A stretch of one segment.
#[derive(Clone, Copy, Debug)]
pub struct Piece {
    /// Parameters on the segment, 0 to 1, t0 < t1.
    pub t0: f64,
    /// See `t0`.
    pub t1: f64,
    /// Heights at the two ends, nm; without meaning on skipped pieces.
    pub z0: f64,
    /// See `z0`.
    pub z1: f64,
    /// Section, or why the piece is not marked.
    pub on: Result<u32, Skip>,
}

/// Traces strokes; holds what can be reused from one to the next.
pub struct Tracer<'a> {
    surface: &'a Surface,
    sections: &'a Sections,
    max_slope2: f64,
    cursor: Cursor,
    spans: Vec<Span>,
    cuts: Vec<(f64, [i64; 2])>,
    /// Largest squared slope of what was marked so far.
    pub worst_slope2: f64,
}

impl<'a> Tracer<'a> {
    /// `max_slope` is the tangent of the steepest slope that is marked.
    pub fn new(surface: &'a Surface, sections: &'a Sections, max_slope: f64) -> Self {
        Self {
            surface,
            sections,
            max_slope2: max_slope * max_slope,
            cursor: Cursor::default(),
            spans: Vec::new(),
            cuts: Vec::new(),
            worst_slope2: 0.0,
        }
    }

    /// Hands the pieces of the segment from `a` to `b` (a ≠ b) to `sink` in order.
    pub fn segment(&mut self, a: P2, b: P2, mut sink: impl FnMut(Piece)) {
        self.surface.walk(a, b, &mut self.cursor, &mut self.spans);
        self.section_cuts(a, b);
        let mut cut = 0;
        for i in 0..self.spans.len() {
            let span = self.spans[i];
            let skip = match span.facet() {
                None => Some(Skip::OffPart),
                Some(f) => {
                    let slope2 = self.surface.slope2(f);
                    if slope2 > self.max_slope2 {
                        Some(Skip::Steep)
                    } else {
                        self.worst_slope2 = self.worst_slope2.max(slope2);
                        None
                    }
                }
            };
            // `cuts[cut]` is the section at the span's begin; later cuts inside the span divide it.
            let mut t = span.t0;
            loop {
                while cut + 1 < self.cuts.len() && self.cuts[cut + 1].0 <= t {
                    cut += 1;
                }
                let end = match self.cuts.get(cut + 1) {
                    Some(&(at, _)) if at < span.t1 => at,
                    _ => span.t1,
                };
                if let Some(skip) = skip {
                    sink(Piece { t0: t, t1: span.t1, z0: 0.0, z1: 0.0, on: Err(skip) });
                    break;
                }
                let [column, row] = self.cuts[cut].1;
                let section = (row * i64::from(self.sections.count[0]) + column) as u32;
                let z = |t: f64| {
                    if t >= span.t1 {
                        span.z1
                    } else {
                        span.z0 + (span.z1 - span.z0) * ((t - span.t0) / (span.t1 - span.t0))
                    }
                };
                sink(Piece { t0: t, t1: end, z0: z(t), z1: z(end), on: Ok(section) });
                if end >= span.t1 {
                    break;
                }
                t = end;
            }
        }
    }

    /// The sections along the segment: parameter at which each begins, column and row.
    fn section_cuts(&mut self, a: P2, b: P2) {
        let d = [b.x - a.x, b.y - a.y];
        let from = [a.x, a.y];
        let mut at = [self.sections.along(0, a.x, d[0]), self.sections.along(1, a.y, d[1])];
        let to = [self.sections.along(0, b.x, -d[0]), self.sections.along(1, b.y, -d[1])];
        // A segment that stays on a border stays on the side it began on.
        let to = [if d[0] == 0 { at[0] } else { to[0] }, if d[1] == 0 { at[1] } else { to[1] }];
        self.cuts.clear();
        self.cuts.push((0.0, at));
        while at != to {
            let next = [0, 1].map(|axis| {
                if at[axis] == to[axis] {
                    return f64::INFINITY;
                }
                let line = self.sections.line(axis, at[axis] + i64::from(d[axis] > 0));
                (line - from[axis]) as f64 / d[axis] as f64
            });
            let t = next[0].min(next[1]);
            for axis in 0..2 {
                if next[axis] == t {
                    at[axis] += d[axis].signum();
                }
            }
            self.cuts.push((t, at));
        }
    }
}

/// Disjoint, sorted intervals of height, nm.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Heights {
    list: Vec<(f64, f64)>,
    /// Not joined yet: joined in one go, so that many separate intervals cost no more than sorting.
    new: Vec<(f64, f64)>,
}

impl Heights {
    /// Adds the interval between `a` and `b`.
    pub fn add(&mut self, a: f64, b: f64) {
        let (lo, hi) = (a.min(b), a.max(b));
        let i = self.list.partition_point(|&(_, h)| h < lo);
        let alone = self.new.is_empty() && self.list.len() == 1;
        match self.list.get_mut(i) {
            Some((l, h)) if *l <= lo && hi <= *h => return,
            Some((l, h)) if alone && *l <= hi => {
                return (*l, *h) = (l.min(lo), h.max(hi));
            }
            _ => self.new.push((lo, hi)),
        }
        if self.new.len() > self.list.len() + 16 {
            self.join();
        }
    }

    /// Joins what was added, where it touches.
    pub fn join(&mut self) {
        if self.new.is_empty() {
            return;
        }
        self.list.append(&mut self.new);
        self.list.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        self.list.dedup_by(|next, last| {
            let touches = next.0 <= last.1;
            if touches {
                last.1 = last.1.max(next.1);
            }
            touches
        });
    }

    /// The intervals, upwards; joined.
    pub fn intervals(&self) -> &[(f64, f64)] {
        debug_assert!(self.new.is_empty());
        &self.list
    }
}

/// Where the texture touches the surface: the heights of its marks in every section.
#[derive(Clone, Debug, Default)]
pub struct Footprint {
    /// By section; most sections of a large grid may hold nothing.
    heights: FxHashMap<u32, Heights>,
}

impl Footprint {
    /// Adds one traced stroke.
    pub fn add(&mut self, points: &[P2], tracer: &mut Tracer<'_>) {
        // Pieces of one section that follow each other make one interval each time the section or
        // the sheet changes.
        let mut run: Option<(u32, f64, f64)> = None;
        let heights = &mut self.heights;
        let mut close = |run: &mut Option<(u32, f64, f64)>| {
            if let Some((section, lo, hi)) = run.take() {
                heights.entry(section).or_default().add(lo, hi);
            }
        };
        for w in points.windows(2) {
            tracer.segment(w[0], w[1], |p| match (&mut run, p.on) {
                (Some((section, lo, hi)), Ok(s)) if *section == s && p.z0 <= *hi && p.z0 >= *lo => {
                    *lo = lo.min(p.z1);
                    *hi = hi.max(p.z1);
                }
                (run, on) => {
                    close(run);
                    *run = on.ok().map(|s| (s, p.z0.min(p.z1), p.z0.max(p.z1)));
                }
            });
        }
        close(&mut run);
    }

    /// Joins what another part of the texture found.
    pub fn merge(&mut self, other: Self) {
        for (section, mut theirs) in other.heights {
            match self.heights.entry(section) {
                Entry::Vacant(mine) => _ = mine.insert(theirs),
                Entry::Occupied(mine) => mine.into_mut().new.append(&mut {
                    theirs.join();
                    theirs.list
                }),
            }
        }
    }

    /// The same with all intervals joined, as the next functions need it.
    #[must_use]
    pub fn joined(mut self) -> Self {
        self.heights.values_mut().for_each(Heights::join);
        self
    }

    /// The intervals of a section, upwards.
    pub fn of_section(&self, section: usize) -> &[(f64, f64)] {
        self.heights.get(&(section as u32)).map_or(&[], Heights::intervals)
    }

    /// Lowest and highest mark, nm; None where nothing is marked.
    pub fn range(&self) -> Option<(f64, f64)> {
        let all = self.heights.values().flat_map(Heights::intervals);
        all.fold(None, |r: Option<(f64, f64)>, &(lo, hi)| Some(r.map_or((lo, hi), |(a, b)| (a.min(lo), b.max(hi)))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heights_join_what_touches_and_nothing_else() {
        let mut h = Heights::default();
        for (a, b) in [(5.0, 6.0), (1.0, 2.0), (9.0, 8.0), (2.0, 3.0)] {
            h.add(a, b);
        }
        h.join();
        assert_eq!(h.intervals(), [(1.0, 3.0), (5.0, 6.0), (8.0, 9.0)]);
        h.add(2.5, 8.5);
        h.join();
        assert_eq!(h.intervals(), [(1.0, 9.0)]);
    }

    #[test]
    fn pieces_tile_the_segment_and_lie_in_their_sections() {
        let facets =
            [[[0.0, 0.0, 0.0], [9.0, 0.0, 0.9], [9.0, 9.0, 0.9]], [[0.0, 0.0, 0.0], [9.0, 9.0, 0.9], [0.0, 9.0, 0.0]]];
        let surface = Surface::from_facets(facets, &mut Vec::new()).expect("two facets");
        let mm = 1_000_000;
        let sections = Sections { origin: P2::new(0, 0), pitch: [2 * mm, 2 * mm], count: [5, 5] };
        let mut tracer = Tracer::new(&surface, &sections, 1.0);
        for (a, b) in [((0, 0), (8, 8)), ((9, 1), (0, 7)), ((2, 8), (2, 0)), ((8, 4), (1, 4)), ((-1, 3), (10, 3))] {
            let (a, b) = (P2::new(a.0 * mm, a.1 * mm), P2::new(b.0 * mm, b.1 * mm));
            let mut t = 0.0;
            tracer.segment(a, b, |p| {
                assert_eq!(p.t0, t);
                assert!(p.t1 > p.t0);
                t = p.t1;
                let mid = a.lerp(b, (p.t0 + p.t1) / 2.0);
                match p.on {
                    Ok(s) => {
                        let want = sections.along(1, mid.y, 0) * 5 + sections.along(0, mid.x, 0);
                        assert_eq!(i64::from(s), want, "{a:?} {b:?} {p:?}");
                        assert!((p.z0 - 0.1 * a.lerp(b, p.t0).x as f64).abs() < 2.0);
                    }
                    Err(skip) => assert!(skip == Skip::OffPart && (mid.x < 0 || mid.x > 9 * mm)),
                }
            });
            assert_eq!(t, 1.0);
        }
    }
}
