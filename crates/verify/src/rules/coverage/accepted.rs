//! What a block accepts for certain: whether it would have marked a run that no mark covers.
//!
//! A block accepts the places inside its window whose heights lie in the interval that its stop admits, and which its
//! beam reaches. Heights and borders are known to their rounding. The window of a stop is its section
//! around its centre; where the stage stands still for several blocks (zoom optic, tilt table) the window is somewhere
//! else, and what lies between the block's own marks is inside it, whatever it is.

use super::{MarkSpan, PieceChecker, ROUNDED};
use crate::geometry::{Piece, Scratch, Sheet, Slope};
use crate::rules::stretch::StretchRun;
use crate::rules::turned::Turned;
use terrace_core::geom::P3;
use terrace_core::program::Block;

/// How much of what follows a mark, nm, decides whether its block would have continued, as docs/explanation/verify.md
/// states.
const BEGIN: f64 = 100.0;

/// The share of a run that a block must accept for certain to have begun with it, as docs/explanation/verify.md states.
const CERTAIN_SHARE: f64 = 0.8;

/// A run up to this, nm, is the rounding of its two ends and begins nothing.
const SHORTEST: f64 = 2.0 * ROUNDED;

/// The box of places that a block accepts: x, y and z, nm, in the frame of the table where the block is tilted.
#[derive(Clone, Copy, Debug)]
pub(super) struct AcceptedBox {
    lo: [f64; 3],
    hi: [f64; 3],
    /// Whether it is the box of the block's own marks, which lie inside the window for certain.
    is_of_marks: bool,
}

/// How borders and heights count that are known to a tolerance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Certainty {
    /// As they are stated.
    AsStated,
    /// As far inside as they may lie: what is accepted then is accepted for certain.
    Surely,
    /// As far outside as they may lie: what is accepted then may be accepted.
    Perhaps,
}

impl AcceptedBox {
    /// The window of these sizes around the centre of a stop.
    pub(super) fn section(block: &Block, size: [f64; 2]) -> Self {
        let c = [block.stop.centre.x as f64, block.stop.centre.y as f64];
        Self::new(block, [0, 1].map(|k| [c[k] - size[k] / 2.0, c[k] + size[k] / 2.0]), false)
    }

    fn new(block: &Block, [x, y]: [[f64; 2]; 2], is_of_marks: bool) -> Self {
        let z = [block.stop.z_lo.f64(), block.stop.z_hi.f64()];
        Self { lo: [x[0], y[0], z[0]], hi: [x[1], y[1], z[1]], is_of_marks }
    }

    /// The same with its borders so far inside, in plan and in height.
    fn inset(self, [plan, height]: [f64; 2]) -> Self {
        let by = [plan, plan, height];
        let [lo, hi] = [(self.lo, 1.0), (self.hi, -1.0)].map(|(v, sign)| [0, 1, 2].map(|k| v[k] + sign * by[k]));
        Self { lo, hi, ..self }
    }

    /// Which shares of the way from `a` to `b` lie inside, where the borders in plan are `plan` wider and those of
    /// height `height`, nm.
    fn share(&self, a: P3, b: P3, plan: f64, height: f64) -> Option<[f64; 2]> {
        let mut share = [0.0f64, 1.0f64];
        for k in 0..3 {
            let by = if k < 2 { plan } else { height };
            let (lo, hi, rise) = (self.lo[k] - by, self.hi[k] + by, b[k] - a[k]);
            if rise == 0.0 {
                if a[k] < lo || a[k] > hi {
                    return None;
                }
                continue;
            }
            let (from, to) = ((lo - a[k]) / rise, (hi - a[k]) / rise);
            share = [share[0].max(from.min(to)), share[1].min(from.max(to))];
        }
        (share[0] < share[1]).then_some(share)
    }
}

impl PieceChecker<'_> {
    /// Whether it is asked which block would have marked a run. What marks on a measured part keep free, and so which
    /// block has the ends of their strokes, the program knows by cells of its own.
    fn is_asked(&self, run: &StretchRun) -> bool {
        self.depth_holds && run.len > SHORTEST && !self.geometry.keeps_free()
    }

    /// Whether the block of the mark before a run would have continued it: for certain it accepts how the run begins,
    /// as far from its border as `zone` says, in plan and in height.
    pub(super) fn would_continue(
        &mut self,
        mark: &MarkSpan,
        run: &StretchRun,
        zone: [f64; 2],
        scratch: &mut Scratch,
    ) -> bool {
        let Some(begin) = run.begin(BEGIN) else { return false };
        if !self.is_asked(run) {
            return false;
        }
        let reach = self.geometry.reach();
        let accepted = self.accepted(mark).inset(zone);
        // On whichever side of the line rounding has put what lies there: a rim that the line meets at 1 deg is met 60
        // nm further on for each nanometre aside.
        [0.0, reach, -reach].into_iter().all(|side| {
            self.longest_of(mark, &begin, &accepted, Certainty::Surely, side, scratch) > begin.len - ROUNDED
        })
    }

    /// Whether the block of the mark after a run would have begun with it: it may accept all of it, for certain does
    /// four fifths, and no other block may accept all. Where another does, or more is in doubt, which stop had how the
    /// run begins lies in the last figure of a border or of a height.
    pub(super) fn would_have_begun(&mut self, mark: &MarkSpan, run: &StretchRun, scratch: &mut Scratch) -> bool {
        if !self.is_asked(run) {
            return false;
        }
        let reach = self.geometry.reach();
        let accepted = self.accepted(mark);
        self.longest_of(mark, run, &accepted, Certainty::Perhaps, 0.0, scratch) > run.len - ROUNDED
            && [0.0, reach, -reach].into_iter().all(|side| {
                self.longest_of(mark, run, &accepted, Certainty::Surely, side, scratch) > CERTAIN_SHARE * run.len
            })
            && !self.is_of_another(mark, run, scratch)
    }

    /// Whether a block other than that of a mark may accept all of a run.
    fn is_of_another(&self, mark: &MarkSpan, run: &StretchRun, scratch: &mut Scratch) -> bool {
        let (own, window) = (self.block_of(mark.mark), self.windows[self.pass.index()]);
        self.blocks_near(run).into_iter().filter(|&block| block != own).any(|block| {
            let section = AcceptedBox::section(&self.facts.raised(&self.file.program.blocks[block]), window);
            self.longest(run, &section, Certainty::Perhaps, 0.0, scratch) > run.len - ROUNDED
        })
    }

    /// The box of places that the block of a mark accepts.
    fn accepted(&self, mark: &MarkSpan) -> AcceptedBox {
        let block = self.facts.raised(&self.file.program.blocks[self.block_of(mark.mark)]);
        let machine = &self.facts.machine;
        // Elsewhere the stage may stand still for several blocks: then the window is not the section around the stop.
        if machine.tilt.is_none() && machine.zoom.is_none() {
            return AcceptedBox::section(&block, self.windows[block.pass.index()]);
        }
        let c = [block.stop.centre.x, block.stop.centre.y];
        let mut span = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
        for p in self.file.program.strokes_of(&block).iter().flat_map(|stroke| self.file.program.points_of(stroke)) {
            for (k, v) in [p.x, p.y].into_iter().enumerate() {
                let v = (c[k] + i64::from(v)) as f64;
                span[k] = [span[k][0].min(v), span[k][1].max(v)];
            }
        }
        AcceptedBox::new(&block, span, true)
    }

    /// [`PieceChecker::longest`] in the frame of a mark's block.
    fn longest_of(
        &mut self,
        mark: &MarkSpan,
        run: &StretchRun,
        accepted: &AcceptedBox,
        certainty: Certainty,
        side: f64,
        scratch: &mut Scratch,
    ) -> f64 {
        let block = &self.file.program.blocks[self.block_of(mark.mark)];
        let mut turned = self.turned.take();
        let is_turned = Turned::prepare(self.file, block, self.facts, self.geometry, &mut turned);
        let frame = turned.as_ref().filter(|_| is_turned);
        let longest = self.longest_in(frame, run, accepted, certainty, side, scratch);
        self.turned = turned;
        longest
    }

    /// The longest part of a run that an upright block accepts, on a line so far aside, nm.
    pub(super) fn longest(
        &self,
        run: &StretchRun,
        accepted: &AcceptedBox,
        certainty: Certainty,
        side: f64,
        scratch: &mut Scratch,
    ) -> f64 {
        self.longest_in(None, run, accepted, certainty, side, scratch)
    }

    /// [`PieceChecker::longest`] in the frame of a tilted block, or of an upright one.
    fn longest_in(
        &self,
        turned: Option<&Turned>,
        run: &StretchRun,
        accepted: &AcceptedBox,
        certainty: Certainty,
        side: f64,
        scratch: &mut Scratch,
    ) -> f64 {
        // `length` is that of the accepted part which reaches to the place at hand, over pieces and segments.
        let (mut longest, mut length) = (0.0f64, 0.0);
        let mut pieces: Vec<Piece> = Vec::new();
        let mut beam = Scratch::default();
        for s in &run.stretches {
            // Heights are those beside the line, places those on it.
            let line = self.stroke.line(s.segment).part(s.d, 0.0);
            pieces.clear();
            self.geometry.along(&self.stroke.line(s.segment).part(s.d, side), scratch, |p| pieces.push(p));
            for p in &pieces {
                let Some(sheet) = p.sheet else {
                    length = 0.0;
                    continue;
                };
                let ends = [0, 1].map(|k| {
                    let [x, y] = line.at(p.d[k]);
                    P3::new([x, y, sheet.z[k]])
                });
                let share = match turned {
                    None => {
                        let plan = self.plan_slack(accepted, certainty);
                        let height = self.height_slack(&sheet, 0.0, certainty);
                        accepted.share(ends[0], ends[1], plan, height)
                    }
                    Some(turned) => self.share_of_tilted(turned, ends, &sheet, accepted, certainty, &mut beam),
                };
                let Some([from, to]) = share else {
                    length = 0.0;
                    continue;
                };
                // A piece that leaves the box ends the part, and may begin another.
                length = if from > 0.0 { 0.0 } else { length } + (to - from) * p.len();
                longest = longest.max(length);
                if to < 1.0 {
                    length = 0.0;
                }
            }
        }
        longest
    }

    /// By how much wider a window is taken, nm.
    fn plan_slack(&self, accepted: &AcceptedBox, certainty: Certainty) -> f64 {
        if accepted.is_of_marks {
            // Their ends are rounded, and on a tilted part found by heights.
            return 2.0 + self.geometry.beside() / 8.0;
        }
        match certainty {
            Certainty::AsStated => 0.0,
            Certainty::Surely => -self.geometry.reach(),
            Certainty::Perhaps => self.geometry.reach(),
        }
    }

    /// By how much wider an interval of heights is taken, nm. Rounding in the plane moves heights by itself times the
    /// slope, and times the lean of the beam.
    fn height_slack(&self, sheet: &Sheet, lean: f64, certainty: Certainty) -> f64 {
        let tolerance = self.geometry.z_tolerance(sheet.slope2) + self.geometry.grain() * (sheet.slope2.sqrt() + lean);
        match certainty {
            Certainty::AsStated => 0.0,
            Certainty::Surely => -tolerance,
            Certainty::Perhaps => tolerance,
        }
    }

    /// The shares of a piece that a tilted block accepts: both ends must be what its beam meets.
    fn share_of_tilted(
        &self,
        turned: &Turned,
        ends: [P3; 2],
        sheet: &Sheet,
        accepted: &AcceptedBox,
        certainty: Certainty,
        scratch: &mut Scratch,
    ) -> Option<[f64; 2]> {
        let [a, b] = ends.map(|end| turned.turn.apply(end).at);
        let lean = turned.turn.lean();
        if certainty == Certainty::Surely {
            let tolerance = self.height_slack(sheet, lean, Certainty::Perhaps);
            if !(self.is_met(turned, a, tolerance, scratch) && self.is_met(turned, b, tolerance, scratch)) {
                return None;
            }
        }
        let height = self.height_slack(sheet, lean, certainty);
        accepted.share(P3::new(a), P3::new(b), self.plan_slack(accepted, certainty), height)
    }

    /// Whether the beam of a tilted block meets a place of the turned part for certain: all that may be topmost there
    /// may be marked and lies at its height, which is known to `tolerance`, nm.
    fn is_met(&self, turned: &Turned, [x, y, z]: [f64; 3], tolerance: f64, scratch: &mut Scratch) -> bool {
        let around = turned.geometry.around([x, y], scratch);
        let is_at_height = |s: &Sheet| {
            let slack = tolerance + turned.geometry.z_tolerance(s.slope2);
            s.z.iter().all(|found| (found - z).abs() <= slack + 2.0 * self.geometry.grain())
        };
        !around.is_empty() && around.iter().filter_map(|p| p.sheet).all(|s| s.slope != Slope::Steep && is_at_height(&s))
    }
}
