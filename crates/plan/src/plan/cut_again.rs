//! Strokes cut between stops that took the place of others.

use super::cut::Cut;
use super::merge::Merged;
use super::parts::Parts;
use super::split::{Cuts, split};
use super::stroke_chunks::Sweep;
use crate::projection::Tracer;
use crate::split::{Fragments, Regroup, Splitter};
use terrace_core::machine::Machine;
use terrace_core::parallel;
use terrace_core::program::{Pen, Sections};
use terrace_core::progress::Task;

/// Cuts strokes between other stops, which admit all that the old ones mark. Fragments are given to the new stops as
/// they are where that can be. Else, and where it would leave more unmarked or cut more figures, or where memory does
/// not suffice, None of the fragments; and the old ones as they were.
pub(super) fn cut_again(
    sweep: Sweep<'_>,
    mut old: Cut,
    merged: Merged,
    sections: &Sections,
    (machine, pens): (&Machine, &[Pen]),
    cuts: Cuts,
    task: Task<'_>,
) -> Result<Cut, Box<Cut>> {
    let Merged { stops, ids, is_changed, may_cut } = merged;
    if !cuts.may_regroup() && !may_cut {
        return Err(Box::new(old));
    }
    if !cuts.may_regroup() {
        let parts = split(sweep, &[&stops], sections, pens, cuts, task);
        let Some(parts) = parts.ok().and_then(|mut parts| parts.pop()) else { return Err(Box::new(old)) };
        let count = |parts: &Parts, of: fn(&Fragments) -> usize| parts.list().iter().map(of).sum::<usize>();
        let small = |parts: &Parts| parts.list().iter().map(|p| p.skipped.small).sum::<f64>();
        let is_no_worse = small(&parts) <= small(&old.parts) + 1e-9
            && count(&parts, |p| p.figures_whole) >= count(&old.parts, |p| p.figures_whole)
            && count(&parts, |p| p.not_kept) <= count(&old.parts, |p| p.not_kept)
            && count(&parts, |p| p.short) <= count(&old.parts, |p| p.short);
        return if is_no_worse { Ok(Cut::new(stops, parts, machine, pens)) } else { Err(Box::new(old)) };
    }
    let Sweep { surface, texture, max_slope } = sweep;
    let regroup = Regroup { old: &old.stops, new: &stops, ids: &ids, is_changed: &is_changed, may_cut };
    let (parts, measures) = std::mem::take(&mut old.parts).apart();
    let task = task.of_steps(parts.len());
    let regrouped = |k: usize, part: Fragments| {
        let splitter = Splitter::new(Tracer::new(surface, max_slope), &[&stops], cuts.least, cuts.keep, cuts.seam);
        let part = regroup.apply((&part, measures.of(k)), splitter, cuts.keep, &mut |source, points| {
            let pen = texture.stroke(source.0 as usize, points);
            (pen, pens[pen.index()].passes)
        });
        task.step();
        part
    };
    let mut again = Parts::default();
    parallel::in_order(parts, regrouped, |part| again.push(part));
    Ok(Cut::new(stops, again, machine, pens))
}
