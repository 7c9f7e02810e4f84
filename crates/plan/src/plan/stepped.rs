//! Planning a stepped job: pass by pass, candidate by candidate.
//!
//! Of every pass: sections, fill along contours, footprint, levels; the stops of each method; strokes cut
//! between them; stops ordered, slid to their places and merged; strokes ordered. The best candidate of the
//! first pass decides the method of all. Every other pass has its own texture (hatches turned, lines along
//! contours moved), a grid of sections and levels that are shifted, and begins where the one before ended.
//! The surface sinks by `passes.lower` from pass to pass: a pass is planned on the surface as it was, with the
//! part's origin lowered instead, so that focal planes lie where the stage can stand; its heights are lowered in
//! the end.

use std::ops::Range;
use std::sync::Arc;

use super::assemble::{self, Assembly};
use super::bound;
use super::candidate::Candidate;
use super::candidates::{Trial, best_of, divide, drop_worse, methods, stops};
use super::cut::{Cut, MarksOfStops, StopMarks};
use super::cut_again::Recut;
use super::dose;
use super::frames;
use super::grid::{Layout, PassGrid};
use super::hatch_direction;
use super::inputs::Inputs;
use super::job_time::{load_s, times};
use super::lifts::PassStage;
use super::merge::{self, Pairs};
use super::off_part::OffPart;
use super::parts::Parts;
use super::pass::Pass;
use super::places;
use super::plausible::{self, Shares};
use super::progress::{Phase, Progress};
use super::setups::{self, Setups};
use super::site::Site;
use super::split::{CutRules, MAX_FRAGMENTS, MAX_POINTS, split, too_large};
use super::start::Start;
use super::stroke_chunks::Sweep;
use super::summary;
use super::warnings;
use crate::block_map::BlockMap;
use crate::budget::StatedErrors;
use crate::check::{Checked, Limits};
use crate::emit;
use crate::fixtures::{self, Fixture};
use crate::manifest::{self, SpaceCurves, Summary, Times};
use crate::partition::Stops;
use crate::projection::{Footprint, Samples};
use crate::split::{Fragments, Sliver};
use terrace_core::clearance::Clearance;
use terrace_core::diag::{Diag, Error};
use terrace_core::geom::{Box2, Nm, P2, Turned};
use terrace_core::machine::{Machine, Origin};
use terrace_core::parallel;
use terrace_core::program::{Block, BlockFigures, OffAxis, PassId, Program, StopId, Stroke, stroke_mm};
use terrace_core::progress::Task;
use terrace_input::job::{Job, Method};
use terrace_input::texture::{Slip, Texture};

/// A stepped job that was planned and checked, not yet written.
#[derive(Clone, Debug)]
pub struct SteppedPlan {
    /// The job.
    pub job: Job,
    /// The machine of the job.
    pub machine: Machine,
    /// The program.
    pub checked: Checked,
    /// The passes, at least one.
    pub passes: Vec<Pass>,
    /// What of the textures that the job places lies off the part.
    pub off_part: OffPart,
    /// The fragments of the first pass that are too short to be marked.
    pub slivers: Vec<Sliver>,
    /// The figures; its warnings are those of the plan.
    pub summary: Summary,
    /// The figures of every block of the program.
    pub figures: Vec<BlockFigures>,
    /// Largest depth range of a block as used.
    pub depth: Nm,
    /// What the user should know.
    pub warnings: Vec<Diag>,
    /// What it was planned from.
    pub inputs: Arc<Inputs>,
}

/// A program before the check: for measuring what no machine may run. [`Draft::checked`] makes a plan of it.
pub struct Draft<'a> {
    job: &'a Job,
    machine: &'a Machine,
    inputs: Arc<Inputs>,
    best: Candidate,
    /// What was compared; empty where one method was asked for.
    tried: Vec<manifest::Candidate>,
    passes: Vec<Pass>,
    /// In the first pass.
    off_part: OffPart,
    slivers: Vec<Sliver>,
    /// The grid of the first pass.
    grid: PassGrid,
    clearance: Clearance,
    /// Positions of the part's origin, by set-up.
    origins: Vec<Origin>,
    /// The space curves of the texture against the surface.
    curves: Option<SpaceCurves>,
    /// What each texture has of the marks of the first pass.
    shares: Shares,
    /// Drawings and curves whose size does not go with the part.
    slips: Vec<(usize, Slip)>,
    /// What the user should know of how it was divided.
    warnings: Vec<Diag>,
}

/// Plans a job on its own machine.
///
/// # Errors
/// Limits of the machine that the job breaks, after the warnings of the inputs.
pub(super) fn plan(job: Job, inputs: Inputs, progress: Progress<'_>) -> Result<SteppedPlan, Error> {
    let inputs = Arc::new(inputs);
    let warnings = &inputs.warnings;
    let draft = Draft::new(&job, &inputs.machine, &inputs, progress);
    let plan = draft.and_then(|draft| draft.checked(warnings.clone()));
    plan.map_err(|e| plausible::explained(&e, inputs.texture_as_designed()).after(warnings.clone()))
}

impl<'a> Draft<'a> {
    /// Divides, cuts and orders all passes of a job for a machine, which need not be the job's own.
    ///
    /// # Errors
    /// Limits of the machine that keep the job from being divided.
    pub fn new(
        job: &'a Job,
        machine: &'a Machine,
        inputs: &Arc<Inputs>,
        progress: Progress<'_>,
    ) -> Result<Self, Error> {
        let [tracing, dividing] = Phase::Footprint.task(progress).split([2, 1]);
        let start = Start::first(machine);
        let (clearance, first) = parallel::both(
            || Clearance::new(&tiles(inputs), machine),
            || TracedPass::new(job, machine, inputs, inputs.texture.clone(), start, tracing),
        );
        let first = first?;
        let context = JobContext { job, machine, inputs, clearance: &clearance };
        let cuts = first.cut_by_methods(&context, dividing, progress)?;
        let [merging, ordering, mapping] = Phase::Order.task(progress).split([1, 4, 1]);
        let MethodChoice { mut best, compared, mut warnings } = first.choose(&context, cuts, merging, ordering)?;
        warnings.extend(warnings::not_kept(&first.grid, &first.footprint, best.method, &best.split));
        // What is told of the first pass alone is taken now: the other passes are appended to `best`.
        let is_left_out = inputs.measured.as_ref().is_some_and(|part| !part.lost.off_part.is_none());
        let is_off = best.split.skipped.off_part > 0.0 || best.split.dots.off_part > 0 || is_left_out;
        let off_part = if is_off { OffPart::of(job, first.as_designed(&context)) } else { OffPart::default() };
        let shares = first.shares(&context, &best);
        let slivers = best.split.slivers.clone();
        let grid = first.grid.clone();
        let blocks = 0..best.program.blocks.len();
        let mut passes = vec![first.pass(&context, &best, blocks)];
        // Ends this phase before that of the other passes begins.
        drop(mapping);
        passes.extend(add_passes(&mut best, &context, progress)?);
        Ok(Self {
            job,
            machine,
            inputs: Arc::clone(inputs),
            origins: best.origins(),
            best,
            tried: compared,
            passes,
            off_part,
            slivers,
            grid,
            clearance,
            curves: inputs.curves,
            shares,
            slips: inputs.texture_as_designed().slips().map(|(k, slip)| (k, slip.clone())).collect(),
            warnings,
        })
    }

    /// The program, not yet checked.
    pub fn program(&self) -> &Program {
        &self.best.program
    }
    /// The times of the program.
    pub fn times(&self) -> Times {
        self.best.times
    }
    /// The passes, at least one.
    pub fn passes(&self) -> &[Pass] {
        &self.passes
    }
    /// Position of the part frame's origin in the table frame in the first set-up, nm.
    pub fn origin(&self) -> Origin {
        self.origins.first().copied().unwrap_or(self.grid.origin)
    }

    /// Checks the program; `warnings` are those given so far.
    ///
    /// # Errors
    /// Limits of the machine that the program breaks; what the job refuses.
    pub fn checked(mut self, mut warnings: Vec<Diag>) -> Result<SteppedPlan, Error> {
        let job = self.job;
        let machine = self.machine;
        let checked = self.check_program()?;
        self.warn(&checked, &mut warnings)?;
        let off_axis = OffAxis::of_blocks(checked.program());
        self.best.figures.iter_mut().zip(off_axis).for_each(|(figures, mm)| figures.off_axis_mm = mm);
        let stated = StatedErrors::new(job, machine, self.inputs.surface.tessellation_mm());
        let stated = stated.with_lying(self.inputs.lying());
        let budget = stated.of_program(checked.program(), &self.best.figures);
        warnings.extend(budget.warning(job, machine));
        let figures = summary::PlanFigures {
            part_mm: self.inputs.designed().size_mm(),
            method: self.best.method,
            times: self.best.times,
            fragments: self.best.fragments,
            split: &self.best.split,
            blocks: &self.best.figures,
            worst_defocus: self.best.worst_defocus,
            worst_defocus_mean: self.best.worst_defocus_mean,
            unmerged: self.best.unmerged,
            curves: self.curves,
            budget,
        };
        let summary = summary::summary(job, machine, &checked, &self.passes, &figures, self.tried, &warnings);
        let energies = checked.program().line_energies(machine);
        self.best.figures.iter_mut().zip(energies).for_each(|(figures, energy)| figures.energy = energy);
        Ok(SteppedPlan {
            job: job.clone(),
            machine: machine.clone(),
            checked,
            passes: self.passes,
            off_part: self.off_part,
            slivers: self.slivers,
            summary,
            figures: self.best.figures,
            depth: self.grid.lattice.depth,
            warnings,
            inputs: self.inputs,
        })
    }

    /// Takes the program out of the draft and holds it to the limits of the machine and to what its formats can carry.
    fn check_program(&mut self) -> Result<Checked, Error> {
        let job = self.job;
        let machine = self.machine;
        let program = std::mem::take(&mut self.best.program);
        setups::hold_fixtures(job, &self.origins)?;
        let limits = Limits {
            machine,
            origins: &self.origins,
            setups_needed: self.best.setups.needed(),
            depth: self.grid.lattice.depth,
            max_slope: self.best.split.worst_slope2.sqrt(),
            clearance: &self.clearance,
            facets: &|sink| self.inputs.surface.each_facet(sink),
            fixtures: &self.inputs.fixtures,
        };
        let checked = Checked::new(program, &limits)?;
        setups::registered(job, machine, &self.origins)?;
        emit::faults(&job.formats, checked.program(), machine)?;
        frames::may_be_shown(job, machine, &checked)?;
        Ok(checked)
    }

    /// Adds what the user should know of the checked program.
    ///
    /// # Errors
    /// What the job refuses.
    fn warn(&self, checked: &Checked, warnings: &mut Vec<Diag>) -> Result<(), Error> {
        let job = self.job;
        let machine = self.machine;
        let program = checked.program();
        let split = &self.best.split;
        warnings::warn(job, split, &self.off_part, &self.slips, warnings)?;
        // The focal plane of a tilted head is met to a nanometre, and two are rounded.
        let rounding = if machine.tilts_head() { Nm(2) } else { Nm(0) };
        warnings.extend(warnings::defocus(self.best.worst_defocus, self.grid.lattice.depth, rounding));
        warnings.extend(warnings::not_carried(job, machine, program));
        let why = "which no file of a stepped job carries";
        let hint = "switch it on in the controller or the marking software";
        warnings.extend(warnings::no_skywriting(job, [why, hint]));
        warnings.extend(warnings::focus_shift_lost(job, machine, program)?);
        warnings.extend(self.shares.warnings(job, self.best.times.total, machine));
        warnings.extend(self.warnings.iter().cloned());
        warnings.extend(warnings::short_overlaps(split));
        warnings.extend(fixtures::beyond(job, machine, &self.inputs.fixtures, &self.origins));
        Ok(())
    }
}

/// Boxes over the part and its fixtures, each with the highest place in it. Fixtures of all set-ups are among them:
/// they may cost a lift where they are not.
fn tiles(inputs: &Inputs) -> Vec<(Box2, Nm)> {
    let fixtures = inputs.fixtures.iter().flat_map(Fixture::tiles);
    inputs.surface.tiles().into_iter().chain(fixtures).collect()
}

/// Plans the passes after the first, and appends them to its program.
fn add_passes(first: &mut Candidate, context: &JobContext<'_>, progress: Progress<'_>) -> Result<Vec<Pass>, Error> {
    let &JobContext { job, machine, .. } = context;
    if job.passes.count <= 1 {
        return Ok(Vec::new());
    }
    let begin = Start::first(machine);
    let tasks = Phase::Passes.task(progress).parts(job.passes.count as usize - 1);
    let mut passes = Vec::new();
    for (number, task) in (1..job.passes.count).map(PassId).zip(tasks) {
        let start = first.start_of(number, &begin, &job.passes);
        passes.push(add_pass(first, context, start, task)?);
    }
    Ok(passes)
}

/// Plans a further pass, divided by the method of those before, and appends it to their program.
fn add_pass(before: &mut Candidate, context: &JobContext<'_>, start: Start, task: Task<'_>) -> Result<Pass, Error> {
    let &JobContext { job, machine, inputs, .. } = context;
    let lowered = start.lowered;
    let texture = inputs.texture_of_pass(job, start.pass)?;
    let [tracing, dividing, cutting, ordering] = task.split([2, 1, 3, 1]);
    let traced = TracedPass::new(job, machine, inputs, texture, start, tracing)?;
    let method = before.method;
    let Some(stops) = divide(&traced.site(context), method, dividing) else {
        return Err(Diag::bug("no-candidate", "a pass cannot be divided as the first was").into());
    };
    let rules = CutRules::new(job, machine, traced.grid.keep);
    let sections = &traced.grid.sections;
    let mut parts = split(traced.sweep(context), &[&stops], sections, &job.pens, rules, cutting)?;
    let parts = parts.pop().unwrap_or_default();
    let [merging, ordering] = ordering.split([1, 3]);
    let (cut, arranged) = traced.arranged(context, method, Cut::new(stops, parts, machine, &job.pens), merging);
    let next = traced.with_strokes(context, cut, arranged, ordering);
    let first = before.program.blocks.len();
    let blocks = first..first + next.program.blocks.len();
    // Each pass was held to these bounds while it was cut; all of them together must keep them too.
    if before.fragments + next.fragments > MAX_FRAGMENTS
        || before.program.points.len() + next.program.points.len() > MAX_POINTS
    {
        return Err(too_large(&inputs.texture).into());
    }
    let pass = traced.pass(context, &next, blocks);
    before.append(next, lowered);
    Ok(pass)
}

/// The stops of a method, and the strokes cut between them.
struct MethodCut {
    method: Method,
    stops: Stops,
    parts: Parts,
}

/// The method that is chosen for the first pass.
struct MethodChoice {
    best: Candidate,
    /// The sound candidates that were compared; empty where one method was asked for.
    compared: Vec<manifest::Candidate>,
    /// Methods that were left out because their programs break an invariant.
    warnings: Vec<Diag>,
}

/// What a candidate becomes when some pairs of its stops are merged, before strokes are cut again.
struct StopMerger {
    merged: merge::MergedStops,
    /// What the merged stops mark, as far as that is known before strokes are cut again.
    marks: Vec<StopMarks>,
    /// The merged stops in order.
    ordered: Candidate,
    /// The merged stops in order, where they cost least.
    placed: Candidate,
}

/// What all passes are planned from.
struct JobContext<'a> {
    job: &'a Job,
    machine: &'a Machine,
    inputs: &'a Inputs,
    clearance: &'a Clearance,
}

/// A pass whose strokes were traced over the surface: what its stops are chosen from.
struct TracedPass {
    texture: Texture,
    grid: PassGrid,
    footprint: Footprint,
    /// Points of marks for the lower bound; None where no bound can be given.
    samples: Option<Samples>,
    /// The size of a stop for the lower bound.
    stop_size: Option<[i32; 3]>,
    start: Start,
}

impl TracedPass {
    fn new(
        job: &Job,
        machine: &Machine,
        inputs: &Inputs,
        texture: Texture,
        start: Start,
        task: Task<'_>,
    ) -> Result<Self, Error> {
        let [hatching, tracing] = task.split([1, 4]);
        let origin = start.part.as_ref().map(|part| part.origin).or_else(|| inputs.origin(job));
        let layout = Layout::new(job, machine, texture.bounds(), start.pass, origin)?;
        let max_slope = job.limits.max_slope();
        let texture = hatch_direction::along_contours(
            texture,
            &inputs.surface,
            &layout.sections,
            max_slope,
            job.focus.depth,
            hatching,
        )?;
        let sweep = Sweep { surface: &inputs.surface, texture: &texture, max_slope, reserve: inputs.reserve() };
        let stop_size = bound::size(machine, &job.focus);
        let sampling = stop_size.map(|size| bound::sampling(size, &texture));
        let half = layout.window.map(|w| w / 2);
        let (footprint, samples) = sweep.footprint(&layout.sections, layout.keep, half, sampling, tracing);
        let (grid, footprint) = layout.levels(job, machine, &inputs.surface, footprint, start.pass)?;
        grid.most_stops(&footprint)?;
        Ok(Self { texture, grid, footprint, samples, stop_size, start })
    }

    fn sweep<'b>(&'b self, context: &JobContext<'b>) -> Sweep<'b> {
        let &JobContext { job, inputs, .. } = context;
        let max_slope = job.limits.max_slope();
        Sweep { surface: &inputs.surface, texture: &self.texture, max_slope, reserve: inputs.reserve() }
    }

    /// The strokes over the part as designed: where a measured part leaves texture out, it does not show what is off it.
    fn as_designed<'b>(&'b self, context: &JobContext<'b>) -> Sweep<'b> {
        let &JobContext { job, inputs, .. } = context;
        match &inputs.measured {
            None => self.sweep(context),
            Some(part) => {
                let max_slope = job.limits.max_slope();
                Sweep { surface: part.draping.designed(), texture: &part.texture, max_slope, reserve: None }
            }
        }
    }

    fn site<'b>(&'b self, context: &JobContext<'b>) -> Site<'b> {
        let &JobContext { job, machine, .. } = context;
        Site {
            sweep: self.sweep(context),
            machine,
            grid: &self.grid,
            footprint: &self.footprint,
            overlap: job.partition.overlap,
            load_s: load_s(job, machine),
            pass: self.start.pass,
        }
    }

    fn stage<'b>(&'b self, context: &JobContext<'b>) -> PassStage<'b> {
        let &JobContext { job, machine, clearance, .. } = context;
        PassStage { machine, clearance, start: &self.start, origin: self.grid.origin, climb: job.order.stops }
    }

    fn recut<'b>(&'b self, context: &JobContext<'b>) -> Recut<'b> {
        let &JobContext { job, machine, .. } = context;
        Recut {
            sweep: self.sweep(context),
            sections: &self.grid.sections,
            machine,
            pens: &job.pens,
            rules: CutRules::new(job, machine, self.grid.keep),
        }
    }

    /// The stops of every method that the job asks for and that can be used, and the strokes cut between them in one
    /// sweep.
    fn cut_by_methods(
        &self,
        context: &JobContext<'_>,
        dividing: Task<'_>,
        progress: Progress<'_>,
    ) -> Result<Vec<MethodCut>, Error> {
        let &JobContext { job, machine, .. } = context;
        let methods = methods(job, machine)?;
        let stops_by_method = stops(&self.site(context), &methods, job.partition.objective, dividing)?;
        let candidates: Vec<&Stops> = stops_by_method.iter().map(|(_, stops)| stops).collect();
        let rules = CutRules::new(job, machine, self.grid.keep);
        let cutting = Phase::Split.task(progress);
        let parts = split(self.sweep(context), &candidates, &self.grid.sections, &job.pens, rules, cutting)?;
        let cuts = stops_by_method.into_iter().zip(parts);
        Ok(cuts.map(|((method, stops), parts)| MethodCut { method, stops, parts }).collect())
    }

    /// Orders, places and merges the stops of every method, orders their strokes, and keeps the best.
    fn choose(
        &self,
        context: &JobContext<'_>,
        cuts: Vec<MethodCut>,
        merging: Task<'_>,
        ordering: Task<'_>,
    ) -> Result<MethodChoice, Error> {
        let &JobContext { job, machine, clearance, .. } = context;
        let is_single = cuts.len() == 1;
        let [merging, ordering] = [merging, ordering].map(|task| task.parts(cuts.len()));
        let cuts = cuts.into_iter().zip(merging).collect();
        // A tour is searched on one thread; those of several methods side by side.
        let arranged = parallel::map_items(cuts, |_, (MethodCut { method, stops, parts }, task)| {
            self.arranged(context, method, Cut::new(stops, parts, machine, &job.pens), task)
        });
        let mut compared = Vec::new();
        let mut trials = Vec::new();
        for ((cut, stops), task) in arranged.into_iter().zip(ordering) {
            let method = stops.method;
            let candidate = self.with_strokes(context, cut, stops, task);
            // A single method is checked in the end, with everything else.
            let fault = if is_single { None } else { candidate.fault(machine, &self.grid, clearance) };
            if fault.is_none() && !is_single {
                compared.push(candidate.listed(job, machine));
            }
            trials.push(Trial { method, candidate, fault });
            drop_worse(&mut trials, |candidate| candidate.measure(job, machine));
        }
        let mut warnings = Vec::new();
        let best = best_of(trials, |candidate| candidate.measure(job, machine), &mut warnings)?;
        Ok(MethodChoice { best, compared, warnings })
    }

    /// What each texture has of the marks of the first pass.
    fn shares(&self, context: &JobContext<'_>, best: &Candidate) -> Shares {
        let &JobContext { job, machine, inputs, .. } = context;
        let program = &best.program;
        let strokes_of = |i: usize, visit: &mut dyn FnMut(&Stroke, f64)| {
            program.strokes_of(&program.blocks[i]).iter().for_each(|s| visit(s, stroke_mm(program.points_of(s))));
        };
        let blocks = program.blocks.partition_point(|b| b.pass == PassId(0));
        Shares::new(job, &self.texture, blocks, &strokes_of, inputs.part_box(job), machine)
    }

    /// A candidate without strokes: its stops ordered, placed, and merged where that makes it better.
    fn arranged(&self, context: &JobContext<'_>, method: Method, cut: Cut, task: Task<'_>) -> (Cut, Candidate) {
        let [merging, joining] = task.split([3, 1]);
        let (cut, mut candidate) = self.merged(context, method, cut, merging);
        let cut = self.joined(context, cut, &mut candidate, joining);
        (cut, candidate)
    }

    /// An arranged candidate with the strokes of its stops, in order.
    fn with_strokes(&self, context: &JobContext<'_>, cut: Cut, arranged: Candidate, ordering: Task<'_>) -> Candidate {
        let &JobContext { job, machine, .. } = context;
        let fragments = cut.parts.count();
        let pens = dose::Pens::new(job.dose, &job.pens, &cut.parts);
        let blocks = arranged.program.blocks;
        let (program, slopes, split) = assemble::lay_out(blocks, &arranged.ids, cut, pens, job.order.strokes, ordering);
        let (times, block_times) = times(machine, &self.start, &program);
        let figures = block_times.into_iter().zip(slopes);
        let figures = figures.map(|(time_s, slope)| BlockFigures { time_s, slope, ..BlockFigures::default() });
        Candidate { program, times, figures: figures.collect(), fragments, split, ..arranged }
    }

    /// A candidate of stops that mark this, in order; `setups` are those of the part where it lies in some already.
    fn ordered(
        &self,
        context: &JobContext<'_>,
        method: Method,
        stops: &Stops,
        marks: &[StopMarks],
        setups: Option<&Setups>,
    ) -> Candidate {
        let &JobContext { job, machine, .. } = context;
        let setups_of = |centres: &[P2<Turned>]| match setups {
            Some(setups) => setups.clone(),
            None => Setups::of(job, machine, &self.grid, self.texture.bounds(), centres),
        };
        let focus = assemble::FocusRule { level: job.focus.level, lattice: self.grid.lattice };
        let Assembly { blocks, ids, setups, used, worst_defocus, worst_defocus_mean } =
            assemble::assemble(stops, marks, &self.stage(context), focus, &setups_of);
        let program = Program { blocks, ..Program::default() };
        let unmerged = program.stops();
        let times = self.times_of_stops(machine, &program, marks);
        Candidate {
            method,
            times,
            figures: Vec::new(),
            fragments: 0,
            split: Fragments::default(),
            worst_defocus,
            worst_defocus_mean,
            program,
            ids,
            unmerged,
            origin: self.grid.origin,
            setups,
            used,
        }
    }

    /// A candidate whose stops stand at their places, pairs of them merged where that makes it better: all pairs that
    /// fit one box, or else those whose merger saves time.
    fn merged(&self, context: &JobContext<'_>, method: Method, cut: Cut, task: Task<'_>) -> (Cut, Candidate) {
        let ordered = self.ordered(context, method, &cut.stops, &cut.marks, None);
        // Asked for by name, `contour` is the method of the article: a stop for every section and level.
        if context.job.partition.method == Method::Contour {
            let placed = self.placed_over(context, ordered, &cut);
            return (cut, placed);
        }
        let [merging_all, merging_saving] = task.split([1, 1]);
        let (unmerged, all_pairs) = parallel::both(
            || self.placed_over(context, ordered.clone(), &cut),
            || self.merger(context, &cut, &ordered, Pairs::All),
        );
        let Some(all_pairs) = all_pairs else { return (cut, unmerged) };
        let cut = match self.cut_merged(context, cut, &ordered, &unmerged, all_pairs, merging_all) {
            Ok(merged) => return merged,
            Err(as_it_was) => *as_it_was,
        };
        let Some(saving_pairs) = self.merger(context, &cut, &ordered, Pairs::Saving) else { return (cut, unmerged) };
        match self.cut_merged(context, cut, &ordered, &unmerged, saving_pairs, merging_saving) {
            Ok(merged) => merged,
            Err(as_it_was) => (*as_it_was, unmerged),
        }
    }

    /// What becomes of an ordered candidate when stops of these pairs are merged; None where there are too few.
    fn merger(&self, context: &JobContext<'_>, cut: &Cut, ordered: &Candidate, pairs: Pairs) -> Option<StopMerger> {
        let &JobContext { job, machine, .. } = context;
        let costs = merge::Costs { machine, from: self.start.from, load_s: load_s(job, machine), pairs };
        let merged = merge::merged(cut, ordered, &costs)?;
        let marks = merged.marks(&cut.marks);
        // The part stays where it lies: two stops of a set-up are merged within it.
        let ordered = self.ordered(context, ordered.method, &merged.stops, &marks, Some(&ordered.setups));
        let placed = self.placed(context, ordered.clone(), &cut.marks_by(&marks, &merged.ids));
        Some(StopMerger { merged, marks, ordered, placed })
    }

    /// The strokes cut between merged stops, and the candidate of these, in order and placed. `ordered` and `unmerged`
    /// are the candidate without the merger, before and after it was placed.
    ///
    /// # Errors
    /// `cut` as it was: where the merger does not make the job better, or strokes cannot be cut so.
    fn cut_merged(
        &self,
        context: &JobContext<'_>,
        cut: Cut,
        ordered: &Candidate,
        unmerged: &Candidate,
        merger: StopMerger,
        task: Task<'_>,
    ) -> Result<(Cut, Candidate), Box<Cut>> {
        let StopMerger { merged, marks, ordered: merged_in_order, placed } = merger;
        if !merge::improves(&placed, unmerged, context.job, context.machine) {
            return Err(Box::new(cut));
        }
        let cut = self.recut(context).between(cut, merged, task)?;
        // Of the marks only their heights decide about focal planes, and so about the order: where cutting has not
        // changed them, the order that was found before holds.
        let has_same_heights = marks
            .iter()
            .zip(&cut.marks)
            .all(|(a, b)| a.heights.nm() == b.heights.nm() && a.heights.held_nm() == b.heights.held_nm());
        let candidate = if has_same_heights {
            merged_in_order
        } else {
            self.ordered(context, ordered.method, &cut.stops, &cut.marks, Some(&ordered.setups))
        };
        let candidate = self.placed_over(context, candidate, &cut);
        Ok((cut, Candidate { unmerged: unmerged.unmerged, ..candidate }))
    }

    /// A candidate of the stops of a cut, with these where they cost least.
    fn placed_over(&self, context: &JobContext<'_>, candidate: Candidate, cut: &Cut) -> Candidate {
        let ids: Vec<StopId> = cut.stops.ids().collect();
        self.placed(context, candidate, &cut.marks_by(&cut.marks, &ids))
    }

    /// A candidate with its stops where they cost least.
    fn placed(&self, context: &JobContext<'_>, mut candidate: Candidate, marks: &MarksOfStops<'_>) -> Candidate {
        let &JobContext { job, machine, .. } = context;
        let PassGrid { window, sections, lattice, .. } = &self.grid;
        let is_upright = candidate.program.blocks.iter().all(|b| b.stop.tilt.is_upright());
        let is_stated = context.inputs.origin(job).is_some() || job.setups.is_some() || self.start.part.is_some();
        let rules = places::PlaceRules {
            stage: &self.stage(context),
            level: job.focus.level,
            keeps_focus: job.focus.is_kept,
            depth: lattice.depth,
            window: *window,
            pitch: sections.pitch,
            is_loose: is_upright && !is_stated,
            min_mark: job.partition.min_mark.is_some(),
        };
        places::place(&mut candidate, marks, &rules);
        candidate.times = self.times_of_stops(machine, &candidate.program, marks.of_stops);
        candidate
    }

    /// Times of a program without strokes whose stops mark this, without jumps.
    fn times_of_stops(&self, machine: &Machine, program: &Program, marks: &[StopMarks]) -> Times {
        let (mut times, _) = times(machine, &self.start, program);
        for marks in marks {
            let [mark, delay] = marks.time_s;
            times.mark += mark;
            times.delay += delay;
            times.total += mark + delay;
        }
        times
    }

    /// Makes one block of those that stand at one place. They were never merged, since they stood elsewhere.
    fn joined(&self, context: &JobContext<'_>, cut: Cut, candidate: &mut Candidate, task: Task<'_>) -> Cut {
        // The method of the article has a stop for every section and level.
        if context.job.partition.method == Method::Contour {
            return cut;
        }
        let Some(merged) = merge::at_one_place(&cut, candidate) else { return cut };
        match self.recut(context).between(cut, merged, task) {
            Err(as_it_was) => *as_it_was,
            Ok(cut) => {
                candidate.keep_blocks(&cut);
                cut
            }
        }
    }

    /// What the pass is remembered by, once `candidate` is made of it.
    fn pass(self, context: &JobContext<'_>, candidate: &Candidate, blocks: Range<usize>) -> Pass {
        let &JobContext { machine, inputs, .. } = context;
        let Self { texture, grid, samples, stop_size, .. } = self;
        let turn = |b: &Block| (!b.stop.tilt.is_upright()).then(|| machine.turn(b.stop.tilt, grid.origin));
        let turns: Vec<_> = candidate.program.blocks.iter().map(turn).collect();
        let field = machine.usable_field();
        let area = texture.bounds();
        let (map, bound) = parallel::both(
            || BlockMap::new(&candidate.program, &grid.sections, &turns, field, &inputs.surface, area),
            || bound::certificate(&grid, samples, stop_size, candidate.method, &candidate.split.slivers),
        );
        Pass {
            directions: texture.directions().cloned(),
            map,
            texture: area,
            strokes: texture,
            bound,
            blocks,
            sections: grid.sections,
        }
    }
}
