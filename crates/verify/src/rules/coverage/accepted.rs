//! What a block accepts for certain: whether it would have marked a run that no mark covers.
//!
//! A block accepts the places inside its window whose heights lie in the interval that its stop admits, and which its
//! beam reaches. Heights and borders are known to what rounding makes of them. The window of a stop is its section
//! around its centre; where the stage stands still for several blocks (zoom optic, tilt table) the window is somewhere
//! else, and what lies between the block's own marks is inside it, whatever it is.

use super::{Cover, ROUNDED, Span};
use crate::geometry::{Piece, Scratch, Sheet, Slope};
use crate::rules::stretch::Run;
use crate::rules::turned::Turned;
use terrace_core::geom::P3;
use terrace_core::program::Block;

/// How much of what follows a mark, nm, decides whether its block would have continued.
const SURE: f64 = 100.0;

/// The box of places that a block accepts: x, y and z, nm, in the frame of the table where the block is tilted.
#[derive(Clone, Copy, Debug)]
pub(super) struct Accepted {
    lo: [f64; 3],
    hi: [f64; 3],
    /// Whether it is the box of the block's own marks, which lie inside the window for certain.
    is_of_marks: bool,
}

/// How borders and heights are taken that are known to a tolerance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Known {
    /// As they are stated.
    AsStated,
    /// What is accepted wherever they are.
    Surely,
    /// What may be accepted.
    Perhaps,
}

impl Accepted {
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

impl Cover<'_> {
    /// Whether the block of the mark before a run would have gone on: for certain it accepts how the run begins, as far
    /// from its border as `zone` says, in plan and in height.
    pub(super) fn would_go_on(&mut self, mark: &Span, run: &Run, zone: [f64; 2], scratch: &mut Scratch) -> bool {
        let Some(begin) = run.begin(SURE) else { return false };
        let reach = self.geometry.reach();
        self.depth_holds && run.len > 2.0 * ROUNDED && {
            let accepted = self.accepted(mark).inset(zone);
            // On whichever side of the line rounding has put what lies there: a rim that the line meets at 1 deg is met
            // 60 nm further on for each nanometre aside.
            [0.0, reach, -reach].into_iter().all(|side| {
                self.longest_of(mark, &begin, &accepted, Known::Surely, side, scratch) > begin.len - ROUNDED
            })
        }
    }

    /// Whether the block of the mark after a run would have begun with it: it may accept all of it, for certain does
    /// four fifths, and no other block may accept all. Where another does, or more is in doubt, which stop had how the
    /// run begins lies in the last figure of a border or of a height.
    pub(super) fn would_have_begun(&mut self, mark: &Span, run: &Run, scratch: &mut Scratch) -> bool {
        let reach = self.geometry.reach();
        self.depth_holds && run.len > 2.0 * ROUNDED && {
            let accepted = self.accepted(mark);
            self.longest_of(mark, run, &accepted, Known::Perhaps, 0.0, scratch) > run.len - ROUNDED
                && [0.0, reach, -reach]
                    .into_iter()
                    .all(|side| self.longest_of(mark, run, &accepted, Known::Surely, side, scratch) > 0.8 * run.len)
                && !self.is_of_another(mark, run, scratch)
        }
    }

    /// Whether a block other than that of a mark may accept all of a run.
    fn is_of_another(&self, mark: &Span, run: &Run, scratch: &mut Scratch) -> bool {
        let (own, window) = (self.block_of(mark.mark), self.windows[self.pass.index()]);
        self.blocks_near(run).into_iter().filter(|&block| block != own).any(|block| {
            let section = Accepted::section(&self.facts.raised(&self.file.program.blocks[block]), window);
            self.longest(run, &section, Known::Perhaps, 0.0, scratch) > run.len - ROUNDED
        })
    }

    /// What the block of a mark accepts.
    fn accepted(&self, mark: &Span) -> Accepted {
        let block = self.facts.raised(&self.file.program.blocks[self.block_of(mark.mark)]);
        let machine = &self.facts.machine;
        if machine.tilt.is_none() && machine.zoom.is_none() {
            return Accepted::section(&block, self.windows[block.pass.index()]);
        }
        let c = [block.stop.centre.x, block.stop.centre.y];
        let mut span = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
        for p in self.file.program.strokes_of(&block).iter().flat_map(|stroke| self.file.program.points_of(stroke)) {
            for (k, v) in [p.x, p.y].into_iter().enumerate() {
                let v = (c[k] + i64::from(v)) as f64;
                span[k] = [span[k][0].min(v), span[k][1].max(v)];
            }
        }
        Accepted::new(&block, span, true)
    }

    /// [`Cover::longest`] in the frame of a mark's block.
    fn longest_of(
        &mut self,
        mark: &Span,
        run: &Run,
        accepted: &Accepted,
        known: Known,
        side: f64,
        scratch: &mut Scratch,
    ) -> f64 {
        let block = &self.file.program.blocks[self.block_of(mark.mark)];
        let mut turned = self.turned.take();
        let is_turned = Turned::of(self.file, block, self.facts, self.geometry, &mut turned);
        let of = turned.as_ref().filter(|_| is_turned);
        let longest = self.longest_in(of, run, accepted, known, side, scratch);
        self.turned = turned;
        longest
    }

    /// The longest part of a run that an upright block accepts, on a line so far aside, nm.
    pub(super) fn longest(
        &self,
        run: &Run,
        accepted: &Accepted,
        known: Known,
        side: f64,
        scratch: &mut Scratch,
    ) -> f64 {
        self.longest_in(None, run, accepted, known, side, scratch)
    }

    fn longest_in(
        &self,
        turned: Option<&Turned>,
        run: &Run,
        accepted: &Accepted,
        known: Known,
        side: f64,
        scratch: &mut Scratch,
    ) -> f64 {
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
                        let slack = [self.plan_slack(accepted, known), self.height_slack(&sheet, 0.0, known)];
                        accepted.share(ends[0], ends[1], slack[0], slack[1])
                    }
                    Some(turned) => self.share_of(turned, ends, &sheet, accepted, known, &mut beam),
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
    fn plan_slack(&self, accepted: &Accepted, known: Known) -> f64 {
        if accepted.is_of_marks {
            // Their ends are rounded, and on a tilted part found by heights.
            return 2.0 + self.geometry.beside() / 8.0;
        }
        match known {
            Known::AsStated => 0.0,
            Known::Surely => -self.geometry.reach(),
            Known::Perhaps => self.geometry.reach(),
        }
    }

    /// By how much wider an interval of heights is taken, nm. Rounding in the plane moves heights by as much as the
    /// slope, and the lean of the beam, makes of it.
    fn height_slack(&self, sheet: &Sheet, lean: f64, known: Known) -> f64 {
        let tolerance = self.geometry.z_tolerance(sheet.slope2) + self.geometry.grain() * (sheet.slope2.sqrt() + lean);
        match known {
            Known::AsStated => 0.0,
            Known::Surely => -tolerance,
            Known::Perhaps => tolerance,
        }
    }

    /// The shares of a piece that a tilted block accepts: both ends must be what its beam meets.
    fn share_of(
        &self,
        turned: &Turned,
        ends: [P3; 2],
        sheet: &Sheet,
        accepted: &Accepted,
        known: Known,
        scratch: &mut Scratch,
    ) -> Option<[f64; 2]> {
        let [a, b] = ends.map(|end| turned.turn.apply(end).at);
        let tolerance = self.height_slack(sheet, turned.turn.lean(), Known::Perhaps);
        let mut is_met = |[x, y, z]: [f64; 3]| {
            let around = turned.geometry.around([x, y], scratch);
            let slack = |s: &Sheet| tolerance + turned.geometry.z_tolerance(s.slope2);
            let met = around.iter().filter_map(|p| p.sheet).all(|s| {
                s.slope != Slope::Steep
                    && s.z.iter().all(|found| (found - z).abs() <= slack(&s) + 2.0 * self.geometry.grain())
            });
            met && !around.is_empty()
        };
        if known == Known::Surely && !(is_met(a) && is_met(b)) {
            return None;
        }
        let height = self.height_slack(sheet, turned.turn.lean(), known);
        accepted.share(P3::new(a), P3::new(b), self.plan_slack(accepted, known), height)
    }
}
