//! Set-ups of a part beyond the stage travel.
//!
//! The box of the stops' centres is divided into equal cells. A stop belongs to the cell that its centre lies in, stops
//! of later passes outside the box to the nearest. In the set-up of a cell the part lies so that the cell's centre is
//! at the centre of travel, moved by whole increments from where the part would lie alone: stops then stay where the
//! stage can stand. Stops, cuts and what is marked are those of the whole part. Cells without stops have no set-up.
//! Later passes keep the cells of the first, of which every other goes backwards, so that the part stays where it is
//! from one pass to the next.

use super::grid::PassGrid;
use crate::manifest;
use terrace_core::diag::{Diag, Error};
use terrace_core::geom::{Box2, Nm, P2, Turned};
use terrace_core::machine::{Machine, Origin};
use terrace_core::program::{Block, PassId, SetupId};
use terrace_input::job::{Job, MAX_SETUPS};

/// The cells, and where the part lies in each.
#[derive(Clone, Debug)]
pub(super) struct Setups {
    /// Along x and along y.
    axes: [AxisCells; 2],
    /// The fewest columns and rows whose stops lie in travel.
    needed: [u32; 2],
}

/// A cell, row by row; a set-up where it has stops.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct CellId(usize);

/// The cells along one axis.
#[derive(Clone, Debug)]
struct AxisCells {
    lo: Nm,
    size: Nm,
    /// By how much the part is moved in each.
    shift: Vec<Nm>,
}

impl AxisCells {
    /// `count` cells whose centres come to `middle`, by multiples of `step`, on a part that lies at `origin`.
    fn new(lo: Nm, size: Nm, count: u32, [origin, middle, step]: [Nm; 3]) -> Self {
        let centre = |i: u32| lo + size * i64::from(2 * i + 1) / i64::from(2 * count);
        let shift = (0..count).map(|i| (middle - centre(i) - origin).down_to(step)).collect();
        Self { lo, size, shift }
    }

    fn of(&self, v: Nm) -> usize {
        let n = self.shift.len() as i64;
        ((v - self.lo) * n / self.size.max(Nm(1))).clamp(0, n - 1) as usize
    }

    /// Borders of the cells.
    fn borders(&self) -> impl Iterator<Item = Nm> {
        let n = self.shift.len() as i64;
        (1..n).map(move |i| self.lo + self.size * i / n)
    }
}

/// The centres of all stops along one axis.
struct StopsAlong {
    centres: Vec<Nm>,
    lo: Nm,
    hi: Nm,
    /// Where the part's origin lies without set-ups.
    origin: Nm,
    /// What the axis reaches in the table frame.
    range: [Nm; 2],
    /// Increment of the stage.
    step: Nm,
}

impl StopsAlong {
    fn new(machine: &Machine, grid: &PassGrid, centres: &[P2<Turned>], axis: usize) -> Self {
        let centres: Vec<Nm> = centres.iter().map(|c| Nm(if axis == 0 { c.x } else { c.y })).collect();
        let lo = centres.iter().copied().min().unwrap_or_default();
        let hi = centres.iter().copied().max().unwrap_or_default();
        let origin = Nm(grid.origin[axis]);
        Self { centres, lo, hi, origin, range: range(machine, axis), step: machine.increment_nm() }
    }

    /// So many cells over all stops.
    fn cells(&self, count: u32) -> AxisCells {
        let [from, to] = self.range;
        AxisCells::new(self.lo, self.hi - self.lo, count, [self.origin, from + (to - from) / 2, self.step])
    }

    /// Whether all stops lie in travel in the set-ups of these cells, and those of later passes, whose lowest and
    /// highest centres are `moved`.
    fn fit_in(&self, cells: &AxisCells, moved: &[Nm]) -> bool {
        let [from, to] = self.range;
        let is_in_travel = |&v: &Nm| (from..=to).contains(&(v + self.origin + cells.shift[cells.of(v)]));
        // Stops of passes whose sections are moved lie anywhere in a cell.
        let reaches_borders = || cells.borders().flat_map(|b| [b - Nm(1), b]).all(|v| is_in_travel(&v));
        self.centres.iter().all(is_in_travel)
            && (moved.is_empty() || moved.iter().all(is_in_travel) && reaches_borders())
    }
}

impl Setups {
    /// The set-ups of a job, for stops with these centres over a texture in `area`.
    pub(super) fn of(job: &Job, machine: &Machine, grid: &PassGrid, area: Box2, centres: &[P2<Turned>]) -> Self {
        let [(x, columns), (y, rows)] = [0, 1].map(|k| {
            let stops = StopsAlong::new(machine, grid, centres, k);
            let moved = moved(job, grid.sections.pitch, area, k);
            let needed = (1..MAX_SETUPS).find(|&n| stops.fit_in(&stops.cells(n), &moved)).unwrap_or(MAX_SETUPS);
            let cells = match &job.setups {
                // The part lies where the job says.
                None => AxisCells { lo: stops.lo, size: stops.hi - stops.lo, shift: vec![Nm(0)] },
                Some(setups) => stops.cells(setups.count[k].unwrap_or(needed)),
            };
            (cells, needed)
        });
        Self { axes: [x, y], needed: [columns, rows] }
    }

    /// The cell of a stop.
    pub(super) fn cell(&self, centre: P2<Turned>) -> CellId {
        let [x, y] = &self.axes;
        CellId(y.of(Nm(centre.y)) * x.shift.len() + x.of(Nm(centre.x)))
    }

    /// Where the part's origin lies in a cell, which is at `base` without set-ups.
    pub(super) fn origin(&self, CellId(cell): CellId, Origin([x, y, z]): Origin) -> Origin {
        let [columns, rows] = &self.axes;
        let n = columns.shift.len();
        Origin([x + columns.shift[cell % n].0, y + rows.shift[cell / n].0, z])
    }

    /// The fewest columns and rows of set-ups whose stops lie within travel.
    pub(super) fn needed(&self) -> [u32; 2] {
        self.needed
    }
}

/// What an axis reaches in the table frame.
pub(super) fn range(machine: &Machine, k: usize) -> [Nm; 2] {
    let (_, axis) = machine.axes()[k];
    let [lo, hi] = axis.travel_nm();
    if axis.sign() > 0 { [lo, hi] } else { [-hi, -lo] }
}

/// The lowest and highest centres of sections of the passes that move them.
fn moved(job: &Job, pitch: [Nm; 2], area: Box2, k: usize) -> Vec<Nm> {
    let passes = &job.passes;
    let (lo, hi) = if k == 0 { (area.lo.x, area.hi.x) } else { (area.lo.y, area.hi.y) };
    let (lo, hi) = (Nm(lo), Nm(hi));
    let grain = job.figure_pitch().unwrap_or(Nm(1));
    let shifts = (1..passes.count).map(|pass| passes.grid_shift(PassId(pass), pitch, grain)[k]);
    let ends = |by: Nm| {
        let first = lo - by + pitch[k] / 2;
        [first, first + pitch[k] * ((hi - lo + by) / pitch[k])]
    };
    shifts.filter(|&by| by != Nm(0)).flat_map(ends).collect()
}

/// The cells that have stops: the set-ups in the order in which they are numbered.
#[derive(Clone, Debug, Default)]
pub(super) struct UsedCells(Vec<CellId>);

impl UsedCells {
    /// The set-ups of these cells.
    pub(super) fn new(mut cells: Vec<CellId>) -> Self {
        cells.sort_unstable();
        cells.dedup();
        Self(cells)
    }

    /// The number of the set-up of a cell, which is one of them.
    pub(super) fn number(&self, cell: CellId) -> SetupId {
        SetupId(self.0.partition_point(|&used| used < cell) as u32)
    }

    /// The cell of a set-up.
    pub(super) fn cell(&self, setup: SetupId) -> CellId {
        self.0[setup.index()]
    }

    /// The cells, rising.
    pub(super) fn iter(&self) -> impl DoubleEndedIterator<Item = CellId> {
        self.0.iter().copied()
    }

    /// The set-ups of these cells and of others.
    pub(super) fn union(&self, other: &Self) -> Self {
        Self::new(self.iter().chain(other.iter()).collect())
    }

    /// Gives blocks whose set-ups are numbered among these the numbers that they have among `others`.
    pub(super) fn renumber(&self, blocks: &mut [Block], others: &Self) {
        blocks.iter_mut().for_each(|b| b.setup = others.number(self.cell(b.setup)));
    }
}

/// Holds every set-up to two registration points.
///
/// # Errors
/// `registration`, once, with the set-ups that reach fewer and what these reach.
pub(super) fn registered(job: &Job, machine: &Machine, origins: &[Origin]) -> Result<(), Error> {
    if job.setups.is_none() {
        return Ok(());
    }
    let found: Vec<usize> = origins.iter().map(|&o| manifest::registration(job, machine, o).len()).collect();
    let poor: Vec<usize> = (0..origins.len()).filter(|&i| found[i] < 2).collect();
    let Some(&first) = poor.first() else { return Ok(()) };
    let text = match poor.len() {
        1 => format!(
            "set-up {} of {} reaches {} registration points, two are needed",
            first + 1,
            origins.len(),
            found[first]
        ),
        count => format!("{count} of {} set-ups reach fewer than two registration points", origins.len()),
    };
    let reach = |&i: &usize| {
        let [x, y] = [0, 1].map(|k| range(machine, k).map(|v| (v - Nm(origins[i][k])).mm()));
        format!("set-up {} reaches x {} to {} mm and y {} to {} mm", i + 1, x[0], x[1], y[0], y[1])
    };
    let turned = if job.placement.turn.as_rad() == 0.0 { "" } else { ", as it is turned" };
    let all: Vec<String> = poor.iter().take(NAMED).map(reach).collect();
    let more = if poor.len() > NAMED { format!(", and {} more set-ups", poor.len() - NAMED) } else { String::new() };
    let hint = format!("{}{more} of the part{turned}: name points there in setups.registration", all.join("; "));
    Err(Diag::limit("registration", text).hint(hint).into())
}

/// Holds every fixture to the set-ups that there are.
///
/// # Errors
/// `fixture-setups`.
pub(super) fn hold_fixtures(job: &Job, origins: &[Origin]) -> Result<(), Error> {
    for (i, fixture) in job.fixtures.iter().enumerate() {
        let Some(last) = fixture.setups.as_ref().and_then(|setups| setups.last()) else { continue };
        if last.index() >= origins.len() {
            let text =
                format!("fixture {:?} is in set-up {}, but there are {}", fixture.name, last.number(), origins.len());
            let hint = "correct the number; the layout and the run sheet show which set-up is where";
            let fault = Diag::input("fixture-setups", text).at(job.place_of(&format!("fixture.{i}.setups")));
            return Err(fault.hint(hint).into());
        }
    }
    Ok(())
}

/// Set-ups that a message names one by one.
const NAMED: usize = 8;
