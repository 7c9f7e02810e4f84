//! What the methods of partition choose stops from.

use super::grid::PassGrid;
use super::stroke_chunks::Sweep;
use crate::partition::{self, Fine, FreeSearch, Lattice, Stops};
use crate::projection::Footprint;
use terrace_core::geom::Nm;
use terrace_core::machine::{Commanded, Machine};
use terrace_core::motion;
use terrace_core::program::{PassId, Sections};
use terrace_core::progress::Task;

/// What stops are chosen from.
pub(super) struct Site<'a> {
    pub(super) sweep: Sweep<'a>,
    pub(super) machine: &'a Machine,
    pub(super) grid: &'a PassGrid,
    pub(super) footprint: &'a Footprint,
    /// What two stops may both mark at a cut.
    pub(super) overlap: Nm,
    /// Time that a person needs for each block, s.
    pub(super) load_s: f64,
    /// The pass, from 0.
    pub(super) pass: PassId,
}

impl Site<'_> {
    /// The stops of a method that divides the sections one by one.
    pub(super) fn on_sections(&self, divide: fn(&Footprint, &Sections, [Nm; 2], &Lattice) -> Stops) -> Stops {
        let PassGrid { sections, window, lattice, .. } = self.grid;
        divide(self.footprint, sections, *window, lattice)
    }

    /// Free windows, or the grid where it has fewer.
    pub(super) fn free_windows(&self, task: Task<'_>) -> Option<Stops> {
        let PassGrid { sections, window, lattice, keep, .. } = self.grid;
        let lowest = self.footprint.range()?.lo;
        let fine = Fine::over(sections, *window, lattice, lowest)?;
        // Other passes begin in other corners.
        let flips = [1, 2, 1].map(|bit| self.pass.0 & bit != 0);
        let [trace, _search] = task.split([3, 1]);
        let cells = self.sweep.cells(&fine, *keep, trace);
        let search = FreeSearch { window: *window, overlap: self.overlap, flips, reserve: self.sweep.reserve };
        let free = partition::free(cells, &fine, sections, lattice, &search);
        // Where fields fit the texture exactly, their grid can be the better choice of windows.
        let grid = self.on_sections(partition::z_range);
        Some(if keep.0 == Nm(0) && grid.stops.len() < free.stops.len() { grid } else { free })
    }

    /// Whether `auto` may leave free windows out, whose search takes seconds where a texture is dense: even with six
    /// tenths of the stops of the grid, fewer than they need on any surface with a dense texture, they would
    /// lose, because nearly all moves of a grid are moves of z alone.
    ///
    /// Where a texture is sparse, windows slide into its gaps until most of their moves are moves of z alone too. With
    /// hatches over the five surfaces of the tests they save up to 7 % of the job from 6 to 12 mm in a
    /// field of 40 mm, and lose everywhere at 5 mm.
    pub(super) fn windows_cannot_win(&self, grid: &Stops) -> bool {
        /// 5 mm in a field of 40 mm, where free windows lost on all surfaces.
        const DENSE: f64 = 0.125;
        let [w, h] = self.grid.window.map(|Nm(w)| w);
        let spacing = self.sweep.texture.spacing_estimate();
        if spacing.lines.min(spacing.dots) > DENSE * w.min(h) as f64 {
            return false;
        }
        let time = |to: [i64; 3]| {
            let moved = motion::stage_move(self.machine, Commanded::default(), Commanded(to), None);
            moved.travel_s + moved.settle_s
        };
        let depth = self.grid.lattice.depth;
        let z = match self.machine.most_focus_shift() {
            Nm(0) => time([0, 0, depth.0]),
            _ => self.machine.zoom_time_s(Nm(0), depth),
        };
        let xy = time([w, h, 0]);
        let sections = (0..self.grid.sections.len()).filter(|&i| self.footprint.is_used(i)).count() as f64;
        let stops = grid.stops.len() as f64;
        let free = 0.6 * stops * (time([w / 2, h / 2, 0]) + self.load_s);
        free > sections * xy + (stops - sections) * z + stops * self.load_s
    }
}
