//! The figures of a stepped plan.

use super::pass::Pass;
use crate::budget::Budget;
use crate::check::Checked;
use crate::manifest::{self, Candidate, Dots, Loading, SpaceCurves, Summary, Times};
use crate::partition::bound::Certificate;
use crate::split::Fragments;
use terrace_core::diag::Diag;
use terrace_core::geom::Nm;
use terrace_core::machine::Machine;
use terrace_core::program::{Block, BlockFigures, OffAxis, Program};
use terrace_input::job::{Job, Method};

/// What the best candidate is known by, all passes together.
pub(super) struct PlanFigures<'a> {
    pub(super) method: Method,
    pub(super) times: Times,
    pub(super) fragments: usize,
    pub(super) split: &'a Fragments,
    /// The figures of every block of the program.
    pub(super) blocks: &'a [BlockFigures],
    /// Largest distance of a mark from its focal plane.
    pub(super) worst_defocus: Nm,
    /// What it would be with every focal plane at the mean height of its marks.
    pub(super) worst_defocus_mean: Nm,
    /// Stops before any were merged.
    pub(super) unmerged: usize,
    pub(super) curves: Option<SpaceCurves>,
    pub(super) budget: Budget,
    pub(super) part_mm: [f64; 3],
}

/// The summary of a checked program.
pub(super) fn summary(
    job: &Job,
    machine: &Machine,
    checked: &Checked,
    passes: &[Pass],
    figures: &PlanFigures<'_>,
    candidates: Vec<Candidate>,
    warnings: &[Diag],
) -> Summary {
    let program = checked.program();
    let split = figures.split;
    let blocks = |pick: fn(&Program, &Block) -> f64| program.blocks.iter().map(|b| pick(program, b)).sum::<f64>();
    let bounds: Option<Vec<usize>> = passes.iter().map(|p| p.bound.as_ref().map(Certificate::stops)).collect();
    Summary {
        part_mm: figures.part_mm,
        stops: program.stops(),
        stops_merged: figures.unmerged.saturating_sub(program.stops()),
        blocks: program.blocks.len(),
        passes: passes.len() as u32,
        setups: checked.origins().len(),
        sub_blocks: passes.iter().map(|p| p.map.sub_blocks()).sum(),
        method: figures.method.name().into(),
        lower_bound_stops: bounds.map(|of_pass| of_pass.iter().sum()),
        texture_mm: split.texture_mm,
        mark_mm: split.mark_mm,
        overlap_mm: split.overlap_mm,
        skipped_mm: split.skipped.off_part + split.skipped.steep + split.skipped.small,
        skipped_off_part_mm: split.skipped.off_part,
        skipped_steep_mm: split.skipped.steep,
        skipped_small_mm: split.skipped.small,
        dots: Dots {
            texture: split.dots.texture,
            marked: split.dots.marked(),
            off_part: split.dots.off_part,
            steep: split.dots.steep,
        },
        fragments: figures.fragments,
        strokes_cut: split.strokes_cut,
        figures_whole: split.figures_whole,
        figures_cut: split.figures_cut,
        seam_mm: passes.iter().map(|p| p.map.seam_mm()).sum(),
        jump_mm: blocks(Program::jump_mm),
        worst_defocus_um: figures.worst_defocus.f64() / 1000.0,
        worst_defocus_mean_um: figures.worst_defocus_mean.f64() / 1000.0,
        worst_incidence_deg: figures.blocks.iter().map(|b| b.slope.incidence_deg()[1]).fold(0.0, f64::max),
        off_axis_mm: OffAxis::of(program),
        budget: figures.budget.clone(),
        curves: figures.curves,
        time_s: figures.times,
        loading: Loading::new(job, machine, program.blocks.len(), figures.times.total),
        candidates,
        warnings: manifest::warnings(job, warnings),
    }
}
