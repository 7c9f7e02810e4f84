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
use super::candidates::{best_of, divide, drop_worse, methods, stops};
use super::cut::{Cut, Marks, StopMarks};
use super::cut_again::cut_again;
use super::dose;
use super::frames;
use super::grid::{Grid, Layout};
use super::hatch_direction;
use super::inputs::Inputs;
use super::job_time::{load_s, times};
use super::lifts::Stage;
use super::merge::{self, Pairs};
use super::off_part::OffPart;
use super::parts::Parts;
use super::pass::Pass;
use super::places;
use super::plausible::{self, Shares};
use super::progress::{Phase, Progress};
use super::setups::{self, Setups};
use super::site::Site;
use super::split::{Cuts, MAX_FRAGMENTS, MAX_POINTS, split, too_large};
use super::start::Start;
use super::stroke_chunks::Sweep;
use super::summary;
use super::warnings;
use crate::block_map::BlockMap;
use crate::budget::Stated;
use crate::check::{Checked, Limits};
use crate::emit;
use crate::manifest::{self, SpaceCurves, Summary, Times};
use crate::partition::Stops;
use crate::projection::{Footprint, Samples};
use crate::split::{Fragments, Sliver};
use terrace_core::clearance::Clearance;
use terrace_core::diag::{Diag, Error};
use terrace_core::geom::Nm;
use terrace_core::machine::{Machine, Origin};
use terrace_core::parallel;
use terrace_core::program::{Block, BlockFigures, OffAxis, PassId, Program, StopId, Stroke, stroke_mm};
use terrace_core::progress::Task;
use terrace_input::job::{Job, Method};
use terrace_input::texture::{Slip, Texture};

/// A stepped job that was planned and checked, not yet written.
#[derive(Debug)]
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
    grid: Grid,
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
    plan.map_err(|e| plausible::explained(&e, &inputs.texture).after(warnings.clone()))
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
            || Clearance::new(&inputs.surface.tiles(), machine),
            || Ready::new(job, machine, inputs, inputs.texture.clone(), start, tracing),
        );
        let first = first?;
        let on = Given { job, machine, inputs, clearance: &clearance };
        let divided = first.divided(&on, dividing, progress)?;
        let [merging, ordering, mapping] = Phase::Order.task(progress).split([1, 4, 1]);
        let Chosen { mut best, compared, mut warnings } = first.choose(&on, divided, [merging, ordering])?;
        warnings.extend(warnings::not_kept(&first.grid, &first.footprint, best.method, &best.split));
        let is_off = best.split.skipped.off_part > 0.0 || best.split.dots.off_part > 0;
        let off_part = if is_off { OffPart::of(job, first.sweep(job, inputs)) } else { OffPart::default() };
        let shares = first.shares(&on, &best);
        let slivers = best.split.slivers.clone();
        let grid = first.grid.clone();
        let blocks = 0..best.program.blocks.len();
        let mut passes = vec![first.pass(machine, inputs, &best, blocks)];
        drop(mapping);
        passes.extend(add_passes(&mut best, &on, progress)?);
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
            slips: inputs.texture.slips().map(|(k, slip)| (k, slip.clone())).collect(),
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
    pub fn checked(self, mut warnings: Vec<Diag>) -> Result<SteppedPlan, Error> {
        let Self { job, machine, mut best, tried, passes, off_part, slivers, grid, clearance, .. } = self;
        let (origins, curves, inputs) = (self.origins, self.curves, self.inputs);
        let limits = Limits {
            machine,
            origins: &origins,
            setups_needed: best.setups.needed(),
            depth: grid.lattice.depth,
            max_slope: best.split.worst_slope2.sqrt(),
            clearance: &clearance,
            facets: &|sink| inputs.surface.each_facet(sink),
        };
        let checked = Checked::new(best.program, &limits)?;
        setups::registered(job, machine, &origins)?;
        emit::faults(&job.formats, checked.program(), machine)?;
        frames::may_be_shown(job, machine, &checked)?;
        let placed = (&off_part, self.slips.as_slice());
        // The focal plane of a tilted head is met to a nanometre, and two are rounded.
        let met = if machine.tilts_head() { Nm(4) } else { Nm(0) };
        let depth = [grid.lattice.depth, met];
        warnings::warn(job, &best.split, placed, best.worst_defocus, depth, &mut warnings)?;
        warnings.extend(warnings::not_carried(job, machine, checked.program()));
        let why = "which no file of a stepped job carries";
        let hint = "switch it on in the controller or the marking software";
        warnings.extend(warnings::no_skywriting(job, [why, hint]));
        warnings.extend(warnings::focus_shift_lost(job, machine, checked.program())?);
        warnings.extend(self.shares.warnings(job, best.times.total, machine));
        warnings.extend(self.warnings);
        warnings.extend(warnings::short_overlaps(&best.split));
        let farthest = OffAxis::of_blocks(checked.program());
        best.figures.iter_mut().zip(farthest).for_each(|(figures, mm)| figures.off_axis_mm = mm);
        let stated = Stated::new(job, machine, inputs.surface.tessellation_mm());
        let budget = stated.of_program(checked.program(), &best.figures);
        warnings.extend(budget.warning(job, machine));
        let figures = summary::Figures {
            part_mm: inputs.surface.size_mm(),
            method: best.method,
            times: best.times,
            fragments: best.fragments,
            split: &best.split,
            blocks: &best.figures,
            worst_defocus: best.worst_defocus,
            worst_defocus_mean: best.worst_defocus_mean,
            unmerged: best.unmerged,
            curves,
            budget,
        };
        let summary = summary::summary((job, machine), &checked, &passes, &figures, tried, &warnings);
        let energies = checked.program().line_energies(machine);
        best.figures.iter_mut().zip(energies).for_each(|(figures, energy)| figures.energy = energy);
        Ok(SteppedPlan {
            job: job.clone(),
            machine: machine.clone(),
            checked,
            passes,
            off_part,
            slivers,
            summary,
            figures: best.figures,
            depth: grid.lattice.depth,
            warnings,
            inputs,
        })
    }
}

/// Plans the passes after the first, and appends them to its program.
fn add_passes(program: &mut Candidate, on: &Given<'_>, progress: Progress<'_>) -> Result<Vec<Pass>, Error> {
    let &Given { job, machine, .. } = on;
    if job.passes.count <= 1 {
        return Ok(Vec::new());
    }
    let begin = Start::first(machine);
    let tasks = Phase::Passes.task(progress).parts(job.passes.count as usize - 1);
    let mut passes = Vec::new();
    for (number, task) in (1..job.passes.count).map(PassId).zip(tasks) {
        let start = program.start_of(number, &begin, &job.passes);
        passes.push(add_pass(program, on, start, task)?);
    }
    Ok(passes)
}

/// Plans a further pass, divided as those before, and appends it to their program.
fn add_pass(program: &mut Candidate, on: &Given<'_>, start: Start, task: Task<'_>) -> Result<Pass, Error> {
    let &Given { job, machine, inputs, .. } = on;
    let lowered = start.lowered;
    let texture = inputs.texture_of_pass(job, start.pass)?;
    let [tracing, dividing, cutting, ordering] = task.split([2, 1, 3, 1]);
    let ready = Ready::new(job, machine, inputs, texture, start, tracing)?;
    let method = program.method;
    let Some(stops) = divide(&ready.site(job, machine, inputs), method, dividing) else {
        return Err(Diag::bug("no-candidate", "a pass cannot be divided as the first was").into());
    };
    let cuts = Cuts::new(job, machine, ready.grid.keep);
    let mut parts = split(ready.sweep(job, inputs), &[&stops], &ready.grid.sections, &job.pens, cuts, cutting)?;
    let parts = parts.pop().unwrap_or_default();
    let [merging, ordering] = ordering.split([1, 3]);
    let (cut, made) = ready.arranged(on, method, Cut::new(stops, parts, machine, &job.pens), merging);
    let next = ready.laid_out(on, cut, made, ordering);
    let first = program.program.blocks.len();
    let blocks = first..first + next.program.blocks.len();
    if program.fragments + next.fragments > MAX_FRAGMENTS
        || program.program.points.len() + next.program.points.len() > MAX_POINTS
    {
        return Err(too_large(&inputs.texture).into());
    }
    let pass = ready.pass(machine, inputs, &next, blocks);
    program.append(next, lowered);
    Ok(pass)
}

/// The stops of a method, and the strokes cut between them.
struct Divided {
    method: Method,
    stops: Stops,
    parts: Parts,
}

/// The candidate of the first pass that was chosen.
struct Chosen {
    best: Candidate,
    /// What it was compared with; empty where one method was asked for.
    compared: Vec<manifest::Candidate>,
    /// Methods that were left out.
    warnings: Vec<Diag>,
}

/// A candidate some of whose stops are merged.
struct Merging {
    merged: merge::Merged,
    /// What its stops mark, as far as that is known before strokes are cut again.
    marks: Vec<StopMarks>,
    next: Candidate,
    /// The same with its stops where they cost least.
    placed: Candidate,
}

/// What all passes are planned from.
struct Given<'a> {
    job: &'a Job,
    machine: &'a Machine,
    inputs: &'a Inputs,
    clearance: &'a Clearance,
}

/// A pass that is ready to be divided.
struct Ready {
    texture: Texture,
    grid: Grid,
    footprint: Footprint,
    /// Points of marks for the lower bound, and the size of a stop for it.
    samples: Option<Samples>,
    stop_size: Option<[i32; 3]>,
    start: Start,
}

impl Ready {
    fn new(
        job: &Job,
        machine: &Machine,
        inputs: &Inputs,
        texture: Texture,
        start: Start,
        task: Task<'_>,
    ) -> Result<Self, Error> {
        let [hatching, tracing] = task.split([1, 4]);
        let layout =
            Layout::new(job, machine, texture.bounds(), start.pass, start.laid.as_ref().map(|laid| laid.origin))?;
        let max_slope = job.limits.max_slope();
        let texture = hatch_direction::along_contours(
            texture,
            &inputs.surface,
            &layout.sections,
            max_slope,
            job.focus.depth,
            hatching,
        )?;
        let sweep = Sweep { surface: &inputs.surface, texture: &texture, max_slope };
        let stop_size = bound::size(machine, &job.focus);
        let sampling = stop_size.map(|size| bound::sampling(size, &texture));
        let half = layout.window.map(|w| w / 2);
        let (footprint, samples) = sweep.footprint(&layout.sections, layout.keep, half, sampling, tracing);
        let (grid, footprint) = layout.levels(job, (machine, &inputs.surface), footprint, start.pass)?;
        grid.most_stops(&footprint)?;
        Ok(Self { texture, grid, footprint, samples, stop_size, start })
    }

    fn sweep<'a>(&'a self, job: &Job, inputs: &'a Inputs) -> Sweep<'a> {
        Sweep { surface: &inputs.surface, texture: &self.texture, max_slope: job.limits.max_slope() }
    }

    fn site<'a>(&'a self, job: &Job, machine: &'a Machine, inputs: &'a Inputs) -> Site<'a> {
        Site {
            sweep: self.sweep(job, inputs),
            machine,
            grid: &self.grid,
            footprint: &self.footprint,
            overlap: job.partition.overlap,
            load_s: load_s(job, machine),
            pass: self.start.pass,
        }
    }

    /// The stops of every method that the job asks for and that can be used, and the strokes cut between them in one sweep.
    fn divided(&self, on: &Given<'_>, dividing: Task<'_>, progress: Progress<'_>) -> Result<Vec<Divided>, Error> {
        let &Given { job, machine, inputs, .. } = on;
        let methods = methods(job, machine)?;
        let found = stops(&self.site(job, machine, inputs), &methods, job.partition.objective, dividing)?;
        let candidates: Vec<&Stops> = found.iter().map(|(_, stops)| stops).collect();
        let cuts = Cuts::new(job, machine, self.grid.keep);
        let cutting = Phase::Split.task(progress);
        let parts = split(self.sweep(job, inputs), &candidates, &self.grid.sections, &job.pens, cuts, cutting)?;
        let divided = found.into_iter().zip(parts);
        Ok(divided.map(|((method, stops), parts)| Divided { method, stops, parts }).collect())
    }

    /// Orders, places and merges the stops of every method, orders their strokes, and keeps the best.
    fn choose(
        &self,
        on: &Given<'_>,
        divided: Vec<Divided>,
        [merging, ordering]: [Task<'_>; 2],
    ) -> Result<Chosen, Error> {
        let &Given { job, machine, clearance, .. } = on;
        let is_single = divided.len() == 1;
        let [merging, ordering] = [merging, ordering].map(|task| task.parts(divided.len()));
        let divided = divided.into_iter().zip(merging).collect();
        // A tour is searched on one thread; those of several methods side by side.
        let arranged = parallel::map_items(divided, |_, (Divided { method, stops, parts }, task)| {
            self.arranged(on, method, Cut::new(stops, parts, machine, &job.pens), task)
        });
        let (mut compared, mut warnings, mut made) = (Vec::new(), Vec::new(), Vec::new());
        for ((cut, stops), task) in arranged.into_iter().zip(ordering) {
            let method = stops.method;
            let one = self.laid_out(on, cut, stops, task);
            // A single method is checked in the end, with everything else.
            let fault = if is_single { None } else { one.fault(machine, &self.grid, clearance) };
            if fault.is_none() && !is_single {
                compared.push(one.listed(job, machine));
            }
            made.push((method, one, fault));
            drop_worse(&mut made, |made| made.measure(job, machine));
        }
        let best = best_of(made.into_iter(), |made| made.measure(job, machine), &mut warnings)?;
        Ok(Chosen { best, compared, warnings })
    }

    /// What each texture has of the marks of the first pass.
    fn shares(&self, on: &Given<'_>, best: &Candidate) -> Shares {
        let &Given { job, machine, inputs, .. } = on;
        let program = &best.program;
        let strokes_of = |i: usize, visit: &mut dyn FnMut(&Stroke, f64)| {
            program.strokes_of(&program.blocks[i]).iter().for_each(|s| visit(s, stroke_mm(program.points_of(s))));
        };
        let blocks = program.blocks.partition_point(|b| b.pass == PassId(0));
        Shares::of(job, &self.texture, (blocks, &strokes_of), inputs.part_box(job), machine)
    }

    /// A candidate without strokes: its stops ordered, placed, and merged where that makes it better.
    fn arranged(&self, on: &Given<'_>, method: Method, cut: Cut, task: Task<'_>) -> (Cut, Candidate) {
        let [merging, joining] = task.split([3, 1]);
        let (cut, mut made) = self.merged(on, method, cut, merging);
        let cut = self.joined(on, cut, &mut made, joining);
        (cut, made)
    }

    /// The candidate with the strokes of its stops, in order.
    fn laid_out(&self, on: &Given<'_>, cut: Cut, made: Candidate, ordering: Task<'_>) -> Candidate {
        let &Given { job, machine, .. } = on;
        let fragments = cut.parts.count();
        let pens = dose::Pens::new(job.dose, &job.pens, &cut.parts);
        let how = (pens, job.order.strokes);
        let (program, slopes, split) = assemble::lay_out((made.program.blocks, &made.ids), cut, how, ordering);
        let (times, block_times) = times(machine, &self.start, &program);
        let figures = block_times.into_iter().zip(slopes);
        let figures = figures.map(|(time_s, slope)| BlockFigures { time_s, slope, ..BlockFigures::default() });
        Candidate { program, times, figures: figures.collect(), fragments, split, ..made }
    }

    /// The stops in order; `setups` are those of the part where it lies in some already.
    fn candidate(
        &self,
        on: &Given<'_>,
        method: Method,
        (stops, marks): (&Stops, &[StopMarks]),
        setups: Option<&Setups>,
    ) -> Candidate {
        let &Given { job, machine, .. } = on;
        let new = |centres: &[_]| Setups::of(job, machine, &self.grid, self.texture.bounds(), centres);
        let setups = |centres: &[_]| setups.map_or_else(|| new(centres), Setups::clone);
        let how = assemble::How { level: job.focus.level, lattice: self.grid.lattice };
        let Assembly { blocks, ids, setups, used, worst_defocus, worst_defocus_mean } =
            assemble::assemble(stops, marks, &self.stage(on), how, &setups);
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

    /// A candidate whose stops stand at their places, merged where that makes it better.
    fn merged(&self, on: &Given<'_>, method: Method, mut cut: Cut, task: Task<'_>) -> (Cut, Candidate) {
        let &Given { job, machine, inputs, .. } = on;
        let made = self.candidate(on, method, (&cut.stops, &cut.marks), None);
        let as_cut = |cut: &Cut| -> Vec<StopId> { cut.stops.ids().collect() };
        let as_made = |cut: &Cut| self.placed(on, made.clone(), &cut.marks_by(&cut.marks, &as_cut(cut)));
        // Asked for by name, `contour` is the method of the article: a stop for every section and level.
        if job.partition.method == Method::Contour {
            let placed = as_made(&cut);
            return (cut, placed);
        }
        let merging = |cut: &Cut, pairs| self.merging(on, (cut, &made), pairs);
        let (placed, mut first) = parallel::both(|| as_made(&cut), || merging(&cut, Pairs::All));
        for (pairs, task) in [Pairs::All, Pairs::Saving].into_iter().zip(task.split([1, 1])) {
            let found = match pairs {
                Pairs::All => first.take(),
                Pairs::Saving => merging(&cut, pairs),
            };
            let Some(Merging { merged, marks, next, placed: judged }) = found else { break };
            if !merge::improves(&judged, &placed, job, machine) {
                continue;
            }
            let cuts = Cuts::new(job, machine, self.grid.keep);
            let (sweep, made_for) = (self.sweep(job, inputs), (machine, job.pens.as_slice()));
            match cut_again(sweep, cut, merged, &self.grid.sections, made_for, cuts, task) {
                Ok(cut) => {
                    // The stops stay in order where their marks lie as high as they were taken to.
                    let as_taken = marks.iter().zip(&cut.marks).all(|(a, b)| a.heights.nm() == b.heights.nm());
                    let again = || self.candidate(on, method, (&cut.stops, &cut.marks), Some(&made.setups));
                    let next = if as_taken { next } else { again() };
                    let next = self.placed(on, next, &cut.marks_by(&cut.marks, &as_cut(&cut)));
                    return (cut, Candidate { unmerged: placed.unmerged, ..next });
                }
                Err(as_it_was) => cut = *as_it_was,
            }
        }
        (cut, placed)
    }

    /// What becomes of a candidate when stops of these pairs are merged; None where there are none.
    fn merging(&self, on: &Given<'_>, (cut, made): (&Cut, &Candidate), pairs: Pairs) -> Option<Merging> {
        let &Given { job, machine, .. } = on;
        let costs = merge::Costs { machine, from: self.start.from, load_s: load_s(job, machine), pairs };
        let merged = merge::merged(cut, made, &costs)?;
        let marks = merged.marks(&cut.marks);
        // The part stays where it lies: two stops of a set-up are merged within it.
        let next = self.candidate(on, made.method, (&merged.stops, &marks), Some(&made.setups));
        let placed = self.placed(on, next.clone(), &cut.marks_by(&marks, &merged.ids));
        Some(Merging { merged, marks, next, placed })
    }

    /// A candidate with its stops where they cost least.
    fn placed(&self, on: &Given<'_>, mut made: Candidate, marks: &Marks<'_>) -> Candidate {
        let &Given { job, machine, .. } = on;
        let Grid { window, sections, lattice, .. } = &self.grid;
        let upright = made.program.blocks.iter().all(|b| b.stop.tilt.is_upright());
        let stated = job.placement.origin.is_some() || job.setups.is_some() || self.start.laid.is_some();
        let site = places::Site {
            stage: &self.stage(on),
            level: job.focus.level,
            keeps_focus: job.focus.is_kept,
            depth: lattice.depth,
            window: *window,
            pitch: sections.pitch,
            is_loose: upright && !stated,
            min_mark: job.partition.min_mark.is_some(),
        };
        places::place(&mut made, marks, &site);
        made.times = self.times_of_stops(machine, &made.program, marks.of_stops);
        made
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
    fn joined(&self, on: &Given<'_>, cut: Cut, made: &mut Candidate, task: Task<'_>) -> Cut {
        let &Given { job, machine, inputs, .. } = on;
        if job.partition.method == Method::Contour {
            return cut;
        }
        let Some(merged) = merge::at_one_place(&cut, made) else { return cut };
        let cuts = Cuts::new(job, machine, self.grid.keep);
        let (sweep, made_for) = (self.sweep(job, inputs), (machine, job.pens.as_slice()));
        match cut_again(sweep, cut, merged, &self.grid.sections, made_for, cuts, task) {
            Err(as_it_was) => *as_it_was,
            Ok(cut) => {
                made.keep_blocks(&cut);
                cut
            }
        }
    }

    fn stage<'b>(&'b self, on: &Given<'b>) -> Stage<'b> {
        let &Given { job, machine, clearance, .. } = on;
        Stage { machine, clearance, start: &self.start, origin: self.grid.origin, climb: job.order.stops }
    }

    /// What the pass is remembered by, once `made` of it.
    fn pass(self, machine: &Machine, inputs: &Inputs, made: &Candidate, blocks: Range<usize>) -> Pass {
        let Self { texture, grid, samples, stop_size, .. } = self;
        let tilted = |b: &Block| (!b.stop.tilt.is_upright()).then(|| machine.turn(b.stop.tilt, grid.origin));
        let turns: Vec<_> = made.program.blocks.iter().map(tilted).collect();
        let field = machine.usable_field();
        let area = texture.bounds();
        let (map, bound) = parallel::both(
            || BlockMap::new(&made.program, &grid.sections, &turns, field, &inputs.surface, area),
            || bound::certificate(&grid, samples, stop_size, made.method, &made.split.slivers),
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
