//! What one method of partition gives: a program in order with its figures, to be compared and continued.

use super::cut::Cut;
use super::grid::PassGrid;
use super::job_time::load_s;
use super::setups::{Setups, UsedCells};
use super::split::join;
use super::start::{HeadPosition, PartPosition, Start};
use crate::check::{self, Limits};
use crate::manifest::{self, Times};
use crate::split::Fragments;
use terrace_core::clearance::Clearance;
use terrace_core::diag::Diag;
use terrace_core::geom::Nm;
use terrace_core::machine::{Machine, Origin};
use terrace_core::program::{Block, BlockFigures, PassId, PenId, Program, Stop, StopId};
use terrace_input::job::{Job, Method, Objective, Passes};

/// What one method gives.
#[derive(Clone)]
pub(super) struct Candidate {
    pub(super) method: Method,
    /// Without strokes until it is laid out; its times are without jumps until then.
    pub(super) program: Program,
    /// The stop of every block of a pass, among those of the method.
    pub(super) ids: Vec<StopId>,
    /// How many stops it has, or had before some were merged.
    pub(super) unmerged: usize,
    /// Where the part's origin lies in the table frame.
    pub(super) origin: Origin,
    pub(super) setups: Setups,
    /// The cells of its set-ups.
    pub(super) used: UsedCells,
    pub(super) times: Times,
    /// The figures of every block of the program.
    pub(super) figures: Vec<BlockFigures>,
    pub(super) fragments: usize,
    pub(super) split: Fragments,
    pub(super) worst_defocus: Nm,
    pub(super) worst_defocus_mean: Nm,
}

impl Candidate {
    /// The candidate as the summary lists it.
    pub(super) fn listed(&self, job: &Job, machine: &Machine) -> manifest::Candidate {
        manifest::Candidate {
            method: self.method.name().into(),
            stops: self.program.stops(),
            fragments: self.fragments,
            time_s: self.times,
            total_s: self.total_s(job, machine),
        }
    }

    /// The job time with the loading of the blocks, s.
    fn total_s(&self, job: &Job, machine: &Machine) -> f64 {
        self.times.total + load_s(job, machine) * self.program.blocks.len() as f64
    }

    /// The first invariant that it breaks, if it breaks any.
    pub(super) fn fault(&self, machine: &Machine, grid: &PassGrid, clearance: &Clearance) -> Option<Diag> {
        let origins = self.origins();
        let limits = Limits {
            machine,
            origins: &origins,
            setups_needed: [1; 2],
            depth: grid.lattice.depth,
            max_slope: self.split.worst_slope2.sqrt(),
            clearance,
            facets: &|_| (),
            fixtures: &[],
        };
        check::first_broken(&self.program, &limits)
    }

    /// Positions of the part's origin, by set-up.
    pub(super) fn origins(&self) -> Vec<Origin> {
        self.used.iter().map(|cell| self.setups.origin(cell, self.origin)).collect()
    }

    /// What the best candidate has least of.
    pub(super) fn measure(&self, job: &Job, machine: &Machine) -> (f64, f64) {
        let total_s = self.total_s(job, machine);
        match job.partition.objective {
            Objective::Time => (total_s, 0.0),
            Objective::Stops => (self.program.stops() as f64, total_s),
        }
    }

    /// Keeps the blocks whose stops mark something still; the others stood where the block before them does.
    pub(super) fn keep_blocks(&mut self, cut: &Cut) {
        let blocks = std::mem::take(&mut self.program.blocks).into_iter().zip(std::mem::take(&mut self.ids));
        for (mut block, id) in blocks {
            let heights = &cut.marks[id.index()].heights;
            if cut.marks[id.index()].is_empty() {
                continue;
            }
            let stop = &cut.stops.stops[id.index()].stop;
            (block.z_lo, block.z_hi) = (Nm::round(heights.lo), Nm::round(heights.hi));
            (block.stop.z_lo, block.stop.z_hi) = (stop.z_lo, stop.z_hi);
            let defocus = (block.z_hi - block.stop.lpfl).max(block.stop.lpfl - block.z_lo);
            self.worst_defocus = self.worst_defocus.max(defocus);
            self.program.blocks.push(block);
            self.ids.push(id);
        }
    }

    /// Where pass `pass` begins after all passes before it, the first of which began at `begin`.
    pub(super) fn start_of(&self, pass: PassId, begin: &Start, passes: &Passes) -> Start {
        let lowered = passes.lowered(pass);
        let Origin([x, y, z]) = self.origin;
        let last = self.program.blocks.last();
        let head = |b: &Block| HeadPosition {
            stop: Stop { lpfl: b.stage_plane() + lowered, ..b.stop.clone() },
            stage: b.stage,
            cell: self.used.cell(b.setup),
        };
        Start {
            pass,
            lowered,
            part: Some(PartPosition { origin: Origin([x, y, z - lowered.0]), setups: self.setups.clone() }),
            from: last.map_or(begin.from, |b| b.stage),
            before: last.map(head),
            focus_shift: last.map_or(begin.focus_shift, |b| b.focus_shift),
        }
    }

    /// Puts a later pass behind, its heights lowered.
    pub(super) fn append(&mut self, mut next: Self, lowered: Nm) {
        let used = self.used.union(&next.used);
        self.used.renumber(&mut self.program.blocks, &used);
        next.used.renumber(&mut next.program.blocks, &used);
        self.used = used;
        append(&mut self.program, next.program, lowered);
        let s = &mut self.times;
        let t = next.times;
        s.stage += t.stage;
        s.settle += t.settle;
        s.zoom += t.zoom;
        s.mark += t.mark;
        s.jump += t.jump;
        s.delay += t.delay;
        s.total += t.total;
        self.unmerged += next.unmerged;
        self.figures.extend(next.figures);
        self.fragments += next.fragments;
        self.split = join(std::mem::take(&mut self.split), next.split);
        self.worst_defocus = self.worst_defocus.max(next.worst_defocus);
        self.worst_defocus_mean = self.worst_defocus_mean.max(next.worst_defocus_mean);
    }
}

/// Puts blocks behind those of a program, their heights lowered by `lowered`.
fn append(program: &mut Program, next: Program, lowered: Nm) {
    let strokes = program.strokes.len();
    let points = program.points.len() as u32;
    program.points.extend(next.points);
    // Pens that compensate the slope differ from pass to pass.
    let pens: Vec<PenId> = next
        .pens
        .into_iter()
        .map(|pen| {
            let same = program.pens.iter().position(|p| *p == pen);
            let index = same.unwrap_or_else(|| {
                program.pens.push(pen);
                program.pens.len() - 1
            });
            PenId(index as u16)
        })
        .collect();
    program.strokes.extend(next.strokes.into_iter().map(|mut s| {
        s.first += points;
        s.pen = pens[s.pen.index()];
        s
    }));
    program.blocks.extend(next.blocks.into_iter().map(|mut b| {
        b.strokes = b.strokes.start + strokes..b.strokes.end + strokes;
        for z in [&mut b.stop.lpfl, &mut b.stop.z_lo, &mut b.stop.z_hi, &mut b.z_lo, &mut b.z_hi] {
            *z -= lowered;
        }
        b
    }));
}
