//! Strokes cut between stops that took the place of others.
//!
//! Consumes a cut and the stops that replace those it was made for, which admit all that these mark. Fragments are
//! given to the new stops as they are where that can be; else all strokes are cut once more.

use super::cut::Cut;
use super::merge::MergedStops;
use super::parts::Parts;
use super::split::{CutRules, split};
use super::stroke_chunks::Sweep;
use crate::partition::Stops;
use crate::split::{Fragments, Regroup, Splitter};
use terrace_core::machine::Machine;
use terrace_core::parallel;
use terrace_core::program::{Pen, Sections};
use terrace_core::progress::Task;

/// What strokes are cut from, and how.
pub(super) struct Recut<'a> {
    pub(super) sweep: Sweep<'a>,
    pub(super) sections: &'a Sections,
    pub(super) machine: &'a Machine,
    pub(super) pens: &'a [Pen],
    pub(super) rules: CutRules,
}

impl Recut<'_> {
    /// The strokes cut between the stops that replace those of `old`.
    ///
    /// # Errors
    /// `old` as it was: where other stops would leave more unmarked or cut more figures, and where memory does not
    /// suffice.
    pub(super) fn between(&self, old: Cut, merged: MergedStops, task: Task<'_>) -> Result<Cut, Box<Cut>> {
        match (self.rules.may_regroup(), merged.may_cut) {
            (true, _) => Ok(self.regrouped(old, merged, task)),
            (false, true) => self.traced_again(old, merged.stops, task),
            (false, false) => Err(Box::new(old)),
        }
    }

    /// All strokes traced and cut once more.
    fn traced_again(&self, old: Cut, stops: Stops, task: Task<'_>) -> Result<Cut, Box<Cut>> {
        let parts = split(self.sweep, &[&stops], self.sections, self.pens, self.rules, task);
        let Some(parts) = parts.ok().and_then(|mut parts| parts.pop()) else { return Err(Box::new(old)) };
        let is_no_worse = Losses::new(parts.list()).are_no_worse_than(&Losses::new(old.parts.list()));
        if is_no_worse { Ok(Cut::new(stops, parts, self.machine, self.pens)) } else { Err(Box::new(old)) }
    }

    /// The fragments given to the new stops; only strokes that the new stops change are cut again.
    fn regrouped(&self, mut old: Cut, merged: MergedStops, task: Task<'_>) -> Cut {
        let MergedStops { stops, ids, is_changed, may_cut } = merged;
        let CutRules { least, keep, seam } = self.rules;
        let regroup = Regroup { old: &old.stops, new: &stops, ids: &ids, is_changed: &is_changed, may_cut };
        let (chunks, measures) = std::mem::take(&mut old.parts).apart();
        let task = task.of_steps(chunks.len());
        let mut parts = Parts::default();
        parallel::in_order(
            chunks,
            |k, chunk| {
                let splitter = Splitter::new(self.sweep.tracer(), &[&stops], least, keep, seam);
                let chunk = regroup.apply(&chunk, measures.of(k), splitter, keep, &mut |source, points| {
                    let pen = self.sweep.texture.stroke(source.0 as usize, points);
                    (pen, self.pens[pen.index()].passes)
                });
                task.step();
                chunk
            },
            |chunk| parts.push(chunk),
        );
        Cut::new(stops, parts, self.machine, self.pens)
    }
}

/// What a cut loses, by which a job may get worse.
#[derive(Default)]
struct Losses {
    /// Length of the fragments that are too short to be marked, mm.
    small_mm: f64,
    figures_whole: usize,
    /// Figures that were to stay whole and are cut.
    not_kept: usize,
    /// Cuts that overlap by less than was asked for.
    short_overlaps: usize,
}

impl Losses {
    fn new(chunks: &[Fragments]) -> Self {
        let mut losses = Self::default();
        for chunk in chunks {
            losses.small_mm += chunk.skipped.small;
            losses.figures_whole += chunk.figures_whole;
            losses.not_kept += chunk.not_kept;
            losses.short_overlaps += chunk.short;
        }
        losses
    }

    fn are_no_worse_than(&self, old: &Self) -> bool {
        // Sums over other fragments: equal lengths may differ by rounding.
        const ROUNDING_MM: f64 = 1e-9;
        self.small_mm <= old.small_mm + ROUNDING_MM
            && self.figures_whole >= old.figures_whole
            && self.not_kept <= old.not_kept
            && self.short_overlaps <= old.short_overlaps
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cut_is_no_worse_where_it_loses_no_more_of_anything() {
        let old = Losses { small_mm: 2.0, figures_whole: 5, not_kept: 1, short_overlaps: 3 };
        let is_no_worse = |change: fn(&mut Losses)| {
            let mut new = Losses { ..old };
            change(&mut new);
            new.are_no_worse_than(&old)
        };
        assert!(is_no_worse(|_| ()) && is_no_worse(|new| new.small_mm += 1e-10));
        assert!(!is_no_worse(|new| new.small_mm += 1e-6));
        assert!(!is_no_worse(|new| new.figures_whole -= 1) && is_no_worse(|new| new.figures_whole += 1));
        assert!(!is_no_worse(|new| new.not_kept += 1) && !is_no_worse(|new| new.short_overlaps += 1));
    }
}
