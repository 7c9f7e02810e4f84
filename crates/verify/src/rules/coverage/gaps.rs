//! What no mark covers: whether it is off the part, too steep, or so short that the job lets it go unmarked.

use super::accepted::{AcceptedBox, Certainty};
use super::{MarkSpan, NOISE, PieceChecker, noise};
use crate::geometry::{Line, Piece, Scratch, Slope};
use crate::rules::stretch::{self, Stretch, StretchRun, confirmed, note, whole};
use terrace_core::geom::NM_PER_MM;
use terrace_core::program::Block;

impl PieceChecker<'_> {
    /// Judges an unmarked part of the stroke.
    pub(super) fn gap(&mut self, number: usize, [from, to]: [f64; 2], passes: f64, beside: [Option<MarkSpan>; 2]) {
        let per_nm = passes / NM_PER_MM;
        // Each end of the gap is known to the grain.
        self.figures.doubt_mm += 2.0 * self.geometry.grain() * per_nm;
        self.figures.rounding_mm += NOISE * per_nm;
        self.figures.lengths.skipped_mm += (to - from) * per_nm;
        // Lengths off the part, on steep facets and on gentle ones, and how much of it rounding may put elsewhere, nm.
        let (mut off, mut steep, mut open) = (0.0, 0.0, 0.0);
        let mut doubt = 0.0;
        let mut list: Vec<Stretch> = Vec::new();
        let mut scratch = std::mem::take(&mut self.scratch);
        let (first, last) = (self.stroke.locate(from).0, self.stroke.locate(to).0);
        // Each stretch of the gap is off the part, too steep, or could have been marked; only the last needs a reason.
        for k in first..=last {
            let line = self.stroke.line(k);
            let d = [(from - self.stroke.along(k)).max(0.0), (to - self.stroke.along(k)).min(line.len)];
            if d[1] <= d[0] {
                continue;
            }
            self.geometry.along(&line.part(d, 0.0), &mut scratch, |p| match p.sheet.map(|s| s.slope) {
                None => off += p.len(),
                Some(Slope::Steep) => steep += p.len(),
                Some(Slope::Doubtful) => {
                    steep += p.len();
                    doubt += p.len();
                }
                Some(Slope::Gentle) => {
                    open += p.len();
                    note(&mut list, k, p.d.map(|x| x + d[0]), line.len);
                }
            });
            doubt += self.border(&line, d, &mut scratch);
        }
        let gentle = |p: &Piece| whole(p, p.sheet.is_some_and(|s| s.slope == Slope::Gentle));
        let runs = if list.is_empty() {
            Vec::new()
        } else {
            confirmed(&list, self.geometry, &mut scratch, |k| self.stroke.line(k), gentle)
        };
        let small: f64 = runs.iter().map(|r| r.len).sum();
        // What rounding may have put off the part counts as that; so does a cut through a wall.
        let lengths = &mut self.figures.lengths;
        lengths.skipped_off_part_mm += (off + open - small) * per_nm;
        lengths.skipped_steep_mm += steep * per_nm;
        lengths.skipped_small_mm += small * per_nm;
        self.figures.doubt_mm += (doubt + open - small) * per_nm;
        for run in &runs {
            if self.is_small(run, [from, to], beside, &mut scratch) {
                continue;
            }
            // What rounding decides may divide a run that the job let go unmarked as a whole.
            let around = self.around(run, [from, to], &mut scratch);
            if !around.is_some_and(|around| self.is_small(&around, [from, to], beside, &mut scratch)) {
                self.note_missing(number, run, beside);
            }
        }
        self.scratch = scratch;
    }

    /// The run of a gap that holds this one, with all that could be marked if the line lay a little aside.
    fn around(&self, run: &StretchRun, [from, to]: [f64; 2], scratch: &mut Scratch) -> Option<StretchRun> {
        let (reach, grain) = (self.geometry.reach(), self.geometry.grain());
        let mut list: Vec<Stretch> = Vec::new();
        for k in self.stroke.locate(from).0..=self.stroke.locate(to).0 {
            let line = self.stroke.line(k);
            let d = [(from - self.stroke.along(k)).max(0.0), (to - self.stroke.along(k)).min(line.len)];
            if d[1] <= d[0] {
                continue;
            }
            let mut parts: Vec<[f64; 2]> = Vec::new();
            for side in [0.0, reach, -reach] {
                self.geometry.along(&line.part(d, side), scratch, |p| {
                    if p.sheet.is_some_and(|s| s.slope != Slope::Steep) {
                        parts.push([p.d[0] + d[0], p.d[1] + d[0]]);
                    }
                });
            }
            parts.sort_by(|a, b| a[0].total_cmp(&b[0]));
            for [a, b] in parts {
                let a = if a <= grain { 0.0 } else { a };
                let b = if b >= line.len - grain { line.len } else { b };
                // Parts as near to each other as the grain are one.
                let a = list.last().filter(|l| l.segment == k && a - l.d[1] <= grain).map_or(a, |l| a.min(l.d[1]));
                note(&mut list, k, [a, b], line.len);
            }
        }
        stretch::runs(&list).into_iter().find(|around| around.holds(run))
    }

    /// How much of a stretch runs along a border between gentle places, steep ones and none, so that
    /// rounding decides which it is, nm.
    fn border(&self, line: &Line, d: [f64; 2], scratch: &mut Scratch) -> f64 {
        let reach = self.geometry.reach();
        let [here, left, right] = [0.0, reach, -reach].map(|side| {
            let mut found = [0.0; 2];
            self.geometry.along(&line.part(d, side), scratch, |p| {
                if let Some(s) = p.sheet {
                    found[usize::from(s.slope == Slope::Gentle)] += p.len();
                }
            });
            found
        });
        let differs = |beside: [f64; 2]| (beside[0] - here[0]).abs() + (beside[1] - here[1]).abs();
        differs(left) + differs(right)
    }

    /// Whether the job lets so short a run in the gap between two marks go unmarked: shorter than `min_mark` between
    /// two cuts, or cut again where its height leaves what a block accepts.
    fn is_small(
        &mut self,
        run: &StretchRun,
        gap: [f64; 2],
        beside: [Option<MarkSpan>; 2],
        scratch: &mut Scratch,
    ) -> bool {
        // Twice `min_mark`: a run may be cut once more by a border of sections.
        let least = 2.0 * self.facts.min_mark_nm;
        if self.interrupts_one_mark(run, gap, beside, scratch) {
            return false;
        }
        if self.facts.only_slivers {
            return self.is_sliver(run, gap, beside, scratch);
        }
        // What tilted blocks would accept is not looked into.
        if run.len < if self.drawn.is_empty() { least } else { 2.0 * least } {
            return true;
        }
        if least == 0.0 {
            return false;
        }
        self.blocks_near(run).into_iter().all(|block| {
            let section =
                AcceptedBox::section(&self.facts.raised(&self.file.program.blocks[block]), self.facts.section_nm);
            self.longest(run, &section, Certainty::AsStated, 0.0, scratch) < least
        })
    }

    /// Whether the run is what cuts left over next to marks: shorter than `min_mark` for each end that is the end of a
    /// mark, and not all within what the block of such a mark accepts, which then would have continued.
    fn is_sliver(
        &mut self,
        run: &StretchRun,
        [from, to]: [f64; 2],
        beside: [Option<MarkSpan>; 2],
        scratch: &mut Scratch,
    ) -> bool {
        let [Some(first), Some(last)] = [run.stretches.first(), run.stretches.last()] else { return false };
        let away =
            [self.stroke.along(first.segment) + first.d[0] - from, to - self.stroke.along(last.segment) - last.d[1]];
        let reach = self.geometry.grain() + self.length_noise(beside);
        let marks: Vec<MarkSpan> = (0..2).filter(|&k| away[k] <= reach).filter_map(|k| beside[k]).collect();
        let is_short = run.len < marks.len() as f64 * self.facts.min_mark_nm + self.length_noise(beside);
        if marks.is_empty() || !is_short {
            return false;
        }
        // Cuts in a zone or with an overlap lie elsewhere than where the block ends; without them the mark after would
        // have begun with what its block accepts, too.
        let asked: &[Option<MarkSpan>] = if self.facts.zone_nm > 0.0 {
            &[]
        } else if self.facts.overlap_nm > 0.0 {
            &beside[..1]
        } else {
            &beside
        };
        let next_to = |k: usize| asked.get(k).copied().flatten().filter(|_| away[k] <= reach);
        let would_continue = next_to(0).is_some_and(|mark| self.would_continue(&mark, run, [0.0; 2], scratch));
        // Between two marks of one block it is the first that counts ([`PieceChecker::interrupts_one_mark`]).
        let is_left = next_to(0).zip(next_to(1)).is_some_and(|(a, b)| self.block_of(a.mark) == self.block_of(b.mark));
        let begins = next_to(1).filter(|_| !is_left);
        !would_continue && !begins.is_some_and(|mark| self.would_have_begun(&mark, run, scratch))
    }

    /// Blocks of this pass whose sections may reach to the run.
    pub(super) fn blocks_near(&self, run: &StretchRun) -> Vec<usize> {
        let start = run.stretches.first().map(|s| self.stroke.line(s.segment).at(s.d[0])).unwrap_or_default();
        // Sections of another pass have other borders.
        let is_near = |b: &Block| {
            let c = [b.stop.centre.x as f64, b.stop.centre.y as f64];
            b.pass == self.pass && (0..2).all(|k| (start[k] - c[k]).abs() <= self.facts.section_nm[k] / 2.0 + run.len)
        };
        (0..self.file.program.blocks.len()).filter(|&b| is_near(&self.file.program.blocks[b])).collect()
    }

    /// Whether the run lies between two marks of one block that accepts how it begins: nothing cuts a mark there.
    fn interrupts_one_mark(
        &mut self,
        run: &StretchRun,
        [from, to]: [f64; 2],
        beside: [Option<MarkSpan>; 2],
        scratch: &mut Scratch,
    ) -> bool {
        let ([Some(before), Some(after)], Some(first), Some(last)) =
            (beside, run.stretches.first(), run.stretches.last())
        else {
            return false;
        };
        let away =
            [self.stroke.along(first.segment) + first.d[0] - from, to - self.stroke.along(last.segment) - last.d[1]];
        let reach = self.geometry.grain() + self.length_noise(beside);
        let is_next_to_both = away.iter().all(|&away| away <= reach);
        is_next_to_both
            && self.block_of(before.mark) == self.block_of(after.mark)
            && self.would_continue(&before, run, self.zone(), scratch)
    }

    /// How far from the border of what a block accepts a cut may lie in a job with zones, nm: in plan, and in height,
    /// where levels reach over each other by a quarter of the depth range at most.
    fn zone(&self) -> [f64; 2] {
        if self.facts.zone_nm == 0.0 { [0.0; 2] } else { [self.facts.zone_nm, self.facts.depth_range_nm() / 4.0] }
    }

    /// How far lengths between two marks may be off, nm.
    fn length_noise(&self, [before, after]: [Option<MarkSpan>; 2]) -> f64 {
        2.0 * noise(before.as_ref(), after.as_ref())
    }
}
