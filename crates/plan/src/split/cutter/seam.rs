//! Seams: where a stroke is cut although its stop would continue, and what two stops both mark.

use super::{Cutter, EPS, PlannedCut, Run};
use terrace_core::geom::Turn;
use terrace_core::program::{CHORD_NM, StopId, StrokeId};

/// An overlap that lacks no more than this, nm, is there in full: its ends are rounded.
const SHORT: f64 = 2.0;

/// Shorter overlaps, nm, do not count, unless a shorter one was asked for.
const LEAST_OVERLAP: f64 = 1_000.0;

/// Where strokes are cut between two stops that both admit a stretch of them.
#[derive(Clone, Copy, Debug, Default)]
pub struct Seam {
    /// The cut lies at random within the last of this length that both admit, nm; 0 for the very end.
    pub zone: f64,
    /// So much before the cut both mark, nm; 0 for none. Not together with a zone.
    pub overlap: f64,
    /// Seed of the random places.
    pub seed: u64,
}

impl Seam {
    /// A number from 0 to 1 that depends on the seed and on which cut of which stroke it is.
    pub(super) fn random(self, source: StrokeId, cut: usize) -> f64 {
        // The finaliser of SplitMix64.
        let mut h = self.seed ^ u64::from(source.0).wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ (cut as u64) << 32;
        for (shift, factor) in [(30, 0xBF58_476D_1CE4_E5B9u64), (27, 0x94D0_49BB_1331_11EB)] {
            h = (h ^ (h >> shift)).wrapping_mul(factor);
        }
        ((h ^ (h >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }
}

impl Cutter<'_> {
    /// A random place to leave `stop`, which continues from `t` on piece `i` of segment `k`: in the zone before
    /// the place where it must be left, as far as the stop that follows admits it too.
    pub(super) fn plan(&mut self, stop: StopId, run: &Run, k: usize, i: usize, t: f64) -> Option<PlannedCut> {
        // Where the stop must be left, and the stop that follows there: the cut may lie anywhere before as long as
        // both admit the stroke.
        let (j, exit) = self.left(stop, run, k, i, t);
        let p = run.pieces.get(j).filter(|p| p.skip.is_none())?;
        // A stop that is left at once, at the end of a piece, is left on the next.
        if exit >= p.t1 {
            return None;
        }
        let last = run.segments.partition_point(|s| s.end <= j);
        let (next, _) = self.choose(run, last, j, exit);
        let cuts = self.out.list.len() - self.before.0;
        let mut back = self.seam.zone * self.seam.random(self.source, cuts);
        // The zone may be shorter than asked for: the cut then lies at the same share of what there is.
        let whole = self.admitted_before(next, run, (j, exit), (i, t), self.seam.zone).1;
        back *= whole / self.seam.zone;
        let ((piece, at), _) = self.admitted_before(next, run, (j, exit), (i, t), back);
        let begin = piece == i && (at - t) * run.segments[k].a.distance(run.segments[k].b) < 2.0;
        (!begin).then_some(PlannedCut { piece, t: at, next })
    }

    /// Goes back from one place of a stroke to another as long as `stop` admits it, at most `most` nm;
    /// returns where that ends and how far it is.
    pub(super) fn admitted_before(
        &self,
        stop: StopId,
        run: &Run,
        (mut j, mut to): (usize, f64),
        (first, from): (usize, f64),
        most: f64,
    ) -> ((usize, f64), f64) {
        let ([lo, hi], lean) = (self.bounds(stop), self.stops.turn(stop).map_or(0.0, Turn::lean));
        let mut length = 0.0;
        loop {
            let s = &run.segments[run.segments.partition_point(|s| s.end <= j)];
            let p = &run.pieces[j];
            let [a, b] = [(p.t0, p.z0), (p.t1, p.z1)].map(|(t, z)| self.seen(stop, s.at(t, z)));
            let mut begin = p.t0;
            // What is kept to an area is not followed beyond.
            if self.stops.area(stop).is_some() {
                return ((j, to), length);
            }
            for k in 0..3 {
                // At the edge of a sheet the height jumps from one piece to the next.
                let now = a[k] + (b[k] - a[k]) * ((to - p.t0) / (p.t1 - p.t0));
                if now > hi[k] + EPS || now < lo[k] - EPS {
                    return ((j, to), length);
                }
                let limit = a[k].clamp(lo[k], hi[k]);
                if limit != a[k] {
                    let share = if b[k] == a[k] { 1.0 } else { (limit - a[k]) / (b[k] - a[k]) };
                    begin = begin.max(p.t0 + (p.t1 - p.t0) * share);
                }
            }
            if j == first {
                begin = begin.max(from);
            }
            // Of the three coordinates the one that enters the box last says where on this piece `stop` begins to
            // admit.
            let begin = begin.min(to);
            let scale = s.a.distance(s.b);
            if length + (to - begin) * scale >= most {
                return ((j, (to - (most - length) / scale).max(begin)), most);
            }
            length += (to - begin) * scale;
            // Accepted down to the begin of the piece: the one before may continue, unless a gap or the wall between
            // two sheets parts them.
            let goes_on = begin <= p.t0 && j > first && run.pieces[j - 1].skip.is_none();
            if !goes_on || (run.pieces[j - 1].z1 - p.z0).abs() * lean > CHORD_NM / 2.0 {
                return ((j, begin), length);
            }
            j -= 1;
            to = run.pieces[j].t1;
        }
    }

    /// Keeps those stops, if there are any, that admit as much before `t` of piece `i` as is to be shared.
    pub(super) fn overlapping(&self, stops: &mut Vec<StopId>, run: &Run, i: usize, t: f64) {
        let Some(open) = &self.open else { return };
        let wanted = self.seam.overlap.min((open.drawn_exact - open.shared) / 2.0);
        let is_full = |&stop: &StopId| self.admitted_before(stop, run, (i, t), (0, 0.0), wanted).1 >= wanted - SHORT;
        if stops.iter().any(is_full) {
            stops.retain(is_full);
        }
    }

    /// Ends the open fragment at `t` of piece `i`, and has `stop`, which continues there, begin before it.
    pub(super) fn share(&mut self, stop: StopId, run: &Run, i: usize, t: f64) {
        let segment = |piece: usize| &run.segments[run.segments.partition_point(|s| s.end <= piece)];
        let own = self.open.as_ref().map_or(0.0, |o| o.drawn_exact - o.shared);
        let s = segment(i);
        let cut = s.a.lerp(s.b, t);
        // What was too short to be marked cannot be marked twice.
        if !self.close(cut) {
            return;
        }
        // Half of what the fragment before has for itself, so that nothing is marked three times.
        let wanted = self.seam.overlap;
        let ((first, from), length) = self.admitted_before(stop, run, (i, t), (0, 0.0), wanted.min(own / 2.0));
        self.out.cuts += 1;
        self.out.short += usize::from(length < wanted - SHORT);
        if length < LEAST_OVERLAP.min(wanted / 2.0) {
            return;
        }
        for j in first..=i {
            let (s, p) = (segment(j), &run.pieces[j]);
            let part = [if j == first { from } else { p.t0 }, if j == i { t } else { p.t1 }];
            if part[0] < part[1] {
                self.mark(stop, s, part, p);
            }
            if j < i && j + 1 == s.end {
                self.corner(s.index, s.b);
            }
        }
        if let Some(open) = &mut self.open {
            open.shared = open.drawn + open.last.distance(cut);
        }
    }
}
