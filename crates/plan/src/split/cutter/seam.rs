//! Seams: where a stroke is cut although its stop would continue, and what two stops both mark.

use super::{Cutter, EPS, PlannedCut, Run, StrokePlace};
use crate::projection::Piece;
use terrace_core::geom::{P3, Turn, Turned};
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

/// Where a run begins.
const RUN_BEGIN: StrokePlace = StrokePlace { piece: 0, t: 0.0 };

/// A stretch of a stroke that a stop admits, up to a given place.
#[derive(Clone, Copy)]
pub(super) struct AdmittedStretch {
    pub(super) begin: StrokePlace,
    /// nm, in the drawing.
    pub(super) length: f64,
}

/// Where on a piece a stop, which admits what lies between `bounds`, begins to admit the stretch that ends at `to`;
/// None where it does not admit its end. `ends` are those of the piece as the stop sees them.
fn admitted_from(p: &Piece, [a, b]: [P3<Turned>; 2], [lo, hi]: [[f64; 3]; 2], to: f64) -> Option<f64> {
    let mut begin = p.t0;
    // Of the three coordinates the one that enters the box last decides.
    for k in 0..3 {
        // At the edge of a sheet the height jumps from one piece to the next.
        let now = a[k] + (b[k] - a[k]) * ((to - p.t0) / (p.t1 - p.t0));
        if now > hi[k] + EPS || now < lo[k] - EPS {
            return None;
        }
        let limit = a[k].clamp(lo[k], hi[k]);
        if limit != a[k] {
            let share = if b[k] == a[k] { 1.0 } else { (limit - a[k]) / (b[k] - a[k]) };
            begin = begin.max(p.t0 + (p.t1 - p.t0) * share);
        }
    }
    Some(begin)
}

impl Cutter<'_> {
    /// A random place to leave `stop`, which continues from a place on segment `k`: in the zone before the place where
    /// it must be left, as far as the stop that follows admits it too.
    pub(super) fn plan(&mut self, stop: StopId, run: &Run, k: usize, from: StrokePlace) -> Option<PlannedCut> {
        // Where the stop must be left, and the stop that follows there: the cut may lie anywhere before as long as
        // both admit the stroke.
        let left = self.left(stop, run, k, from);
        let p = run.pieces.get(left.piece).filter(|p| p.skip.is_none())?;
        // A stop that is left at once, at the end of a piece, is left on the next.
        if left.t >= p.t1 {
            return None;
        }
        let last = run.segments.partition_point(|s| s.end <= left.piece);
        let (next, _) = self.choose(run, last, left);
        let cuts = self.out.list.len() - self.fragments_before;
        let mut back = self.seam.zone * self.seam.random(self.source, cuts);
        // The zone may be shorter than asked for: the cut then lies at the same share of what there is.
        let whole = self.admitted_before(next, run, left, from, self.seam.zone).length;
        back *= whole / self.seam.zone;
        let at = self.admitted_before(next, run, left, from, back).begin;
        // Such a cut would leave the stop nothing but rounding.
        let is_at_once =
            at.piece == from.piece && (at.t - from.t) * run.segments[k].a.distance(run.segments[k].b) < 2.0;
        (!is_at_once).then_some(PlannedCut { at, next })
    }

    /// Goes back from `to` as long as `stop` admits the stroke, to `from` and over `most` nm at most.
    pub(super) fn admitted_before(
        &self,
        stop: StopId,
        run: &Run,
        mut to: StrokePlace,
        from: StrokePlace,
        most: f64,
    ) -> AdmittedStretch {
        let bounds = self.bounds(stop);
        let lean = self.stops.turn(stop).map_or(0.0, Turn::lean);
        // What is kept to an area is not followed beyond.
        if self.stops.area(stop).is_some() {
            return AdmittedStretch { begin: to, length: 0.0 };
        }
        let mut length = 0.0;
        loop {
            // Invariant: `stop` admits all behind `to`, which is `length` long.
            let s = &run.segments[run.segments.partition_point(|s| s.end <= to.piece)];
            let p = &run.pieces[to.piece];
            let ends = [(p.t0, p.z0), (p.t1, p.z1)].map(|(t, z)| self.seen(stop, s.at(t, z)));
            let Some(mut begin) = admitted_from(p, ends, bounds, to.t) else {
                return AdmittedStretch { begin: to, length };
            };
            if to.piece == from.piece {
                begin = begin.max(from.t);
            }
            let begin = begin.min(to.t);
            let scale = s.a.distance(s.b);
            if length + (to.t - begin) * scale >= most {
                let t = (to.t - (most - length) / scale).max(begin);
                return AdmittedStretch { begin: StrokePlace { t, ..to }, length: most };
            }
            length += (to.t - begin) * scale;
            // Accepted down to the begin of the piece: the one before may continue, unless a gap or the wall between
            // two sheets parts them.
            let continues = begin <= p.t0 && to.piece > from.piece && run.pieces[to.piece - 1].skip.is_none();
            if !continues || (run.pieces[to.piece - 1].z1 - p.z0).abs() * lean > CHORD_NM / 2.0 {
                return AdmittedStretch { begin: StrokePlace { t: begin, ..to }, length };
            }
            to = StrokePlace { piece: to.piece - 1, t: run.pieces[to.piece - 1].t1 };
        }
    }

    /// Keeps those stops, if there are any, that admit as much before a place as is to be shared.
    pub(super) fn overlapping(&self, stops: &mut Vec<StopId>, run: &Run, at: StrokePlace) {
        let Some(open) = &self.open else { return };
        let wanted = self.seam.overlap.min((open.drawn_exact - open.shared) / 2.0);
        let is_full = |&stop: &StopId| self.admitted_before(stop, run, at, RUN_BEGIN, wanted).length >= wanted - SHORT;
        if stops.iter().any(is_full) {
            stops.retain(is_full);
        }
    }

    /// Ends the open fragment at a place, and has `stop`, which continues there, begin before it.
    pub(super) fn share(&mut self, stop: StopId, run: &Run, at: StrokePlace) {
        let segment = |piece: usize| &run.segments[run.segments.partition_point(|s| s.end <= piece)];
        let own = self.open.as_ref().map_or(0.0, |o| o.drawn_exact - o.shared);
        let s = segment(at.piece);
        let cut = s.a.lerp(s.b, at.t);
        // What was too short to be marked cannot be marked twice.
        if !self.close(cut) {
            return;
        }
        // Half of what the fragment before has for itself, so that nothing is marked three times.
        let wanted = self.seam.overlap;
        let AdmittedStretch { begin, length } = self.admitted_before(stop, run, at, RUN_BEGIN, wanted.min(own / 2.0));
        self.out.cuts += 1;
        self.out.short += usize::from(length < wanted - SHORT);
        if length < LEAST_OVERLAP.min(wanted / 2.0) {
            return;
        }
        for j in begin.piece..=at.piece {
            let s = segment(j);
            let p = &run.pieces[j];
            let from = if j == begin.piece { begin.t } else { p.t0 };
            let to = if j == at.piece { at.t } else { p.t1 };
            if from < to {
                self.mark(stop, s, [from, to], p);
            }
            if j < at.piece && j + 1 == s.end {
                self.corner(s.index, s.b);
            }
        }
        if let Some(open) = &mut self.open {
            open.shared = open.drawn + open.last.distance(cut);
        }
    }
}
