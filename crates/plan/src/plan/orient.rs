//! The fixture angle that needs the least stage time on a stage without tilt table.
//!
//! Consumes a job; promises a table of set-ups: the part as placed, in one tilted fixture, and in two set-ups with a
//! fixture angle each. Stops and times are estimates from sample points of the marks ([`crate::projection::Marks`]):
//! sections of the usable field over the rotated part, in each the levels that its heights need, those within the range
//! of a zoom optic at one stop, the moves timed by `terrace_core::motion`. Angles are searched on a coarse grid, then
//! halved.
//!
//! # Limits
//! The points sampled are those that the lens sees of the part as placed. What a fixture angle hides or makes too steep
//! is not searched for; compiling the job with the rotated part reports it.

use super::grid::{Layout, PassGrid};
use super::hatch_direction;
use super::inputs::Inputs;
use super::progress::{Phase, Progress};
use super::stroke_chunks::Sweep;
use terrace_core::diag::Error;
use terrace_core::geom::{Box2, Nm, P2, P3, Turn};
use terrace_core::machine::{Commanded, Machine};
use terrace_core::math;
use terrace_core::motion;
use terrace_core::parallel;
use terrace_core::program::{PassId, Sections};
use terrace_core::progress::Task;
use terrace_input::job::Job;

/// One way to set the part up.
#[derive(Clone, Debug)]
pub struct Orientation {
    /// How the part is set up, for reading.
    pub name: &'static str,
    /// Every set-up: what of the part it marks, and the fixture angle.
    pub set_ups: Vec<SetUp>,
}

/// One set-up of the part.
#[derive(Clone, Copy, Debug)]
pub struct SetUp {
    /// What of the texture's box is marked in it, nm.
    pub area: Box2,
    /// By how much the part is turned about x, and before that about y, degrees, right-handed.
    pub lean_deg: [f64; 2],
    /// Estimated stops.
    pub stops: u64,
    /// Estimated time of stage moves and settling, s.
    pub stage_s: f64,
}

impl Orientation {
    /// Stops of all set-ups.
    pub fn stops(&self) -> u64 {
        self.set_ups.iter().map(|s| s.stops).sum()
    }
    /// Stage time of all set-ups, s; without the time to set the part up.
    pub fn stage_s(&self) -> f64 {
        self.set_ups.iter().map(|s| s.stage_s).sum()
    }
}

/// Largest fixture angle that is tried, and the first and last step of the search, degrees.
pub(super) const STEEPEST: f64 = 20.0;
const FIRST: f64 = 2.5;
const LAST: f64 = 0.02;

/// The phases of the search, in order.
pub const PHASES: [Phase; 3] = [Phase::Read, Phase::Footprint, Phase::Lean];

/// The ways to set the part up, as it lies first, then by stage time.
///
/// # Errors
/// The errors of [`super::plan`].
pub fn orient(job: &Job, progress: Progress<'_>) -> Result<Vec<Orientation>, Error> {
    let inputs = Inputs::load_with_progress(job, Phase::Read.task(progress))?;
    let machine = &inputs.machine;
    let area = inputs.texture.bounds();
    let layout = Layout::new(job, machine, area, PassId(0), inputs.origin(job))?;
    let max_slope = job.limits.max_slope();
    let [hatching, tracing, sampling] = Phase::Footprint.task(progress).split([1, 4, 4]);
    let texture = hatch_direction::along_contours(
        inputs.texture.clone(),
        &inputs.surface,
        &layout.sections,
        max_slope,
        job.focus.depth,
        hatching,
    )?;
    let sweep = Sweep { surface: &inputs.surface, texture: &texture, max_slope, reserve: None };
    let (footprint, _) = sweep.footprint(&layout.sections, layout.keep, layout.window.map(|w| w / 2), None, tracing);
    let (grid, _) = layout.levels(job, machine, &inputs.surface, footprint, PassId(0))?;
    let pitch = grid.window.map(|w| (w / 20).max(Nm(2)));
    let fine = Sections { origin: area.lo, pitch, count: [0, 1].map(|k| (area.size()[k] / pitch[k] + 1) as u32) };
    let marks = sweep.marks(&fine, sampling).list();
    let scale = Scale::new(machine, &grid);
    let [whole, left_right, front_back] = Phase::Lean.task(progress).split([2, 2, 2]);
    let flat = scale.set_up(&marks, area, [0.0; 2]);
    let leaning = scale.best_set_up(&marks, area, whole);
    let mut others = vec![
        Orientation { name: "tilted fixture", set_ups: vec![leaning] },
        Orientation { name: "two set-ups, left and right", set_ups: scale.two_set_ups(&marks, area, 0, left_right) },
        Orientation { name: "two set-ups, front and back", set_ups: scale.two_set_ups(&marks, area, 1, front_back) },
    ];
    others.sort_by(|a, b| a.stage_s().total_cmp(&b.stage_s()));
    let mut orientations = vec![Orientation { name: "as placed", set_ups: vec![flat] }];
    orientations.extend(others);
    Ok(orientations)
}

/// What sections measure, nm, and what moves take.
struct Scale {
    window: [f64; 2],
    depth: f64,
    /// Time of the stage from section to section.
    xy_s: f64,
    /// Time of the stage from level to level.
    z_s: f64,
    /// Heights that one stop serves: the depth range, and with a zoom optic the optic's range more.
    reach: f64,
    /// Time of the optic from level to level.
    zoom_s: f64,
}

/// A fixture angle and what it costs.
#[derive(Clone, Copy)]
struct Lean {
    /// About x and about y.
    deg: [f64; 2],
    stage_s: f64,
}

impl Lean {
    /// What the best fixture angle has least of: stage time, and of equal times the angle itself.
    fn measure(&self) -> [f64; 2] {
        [self.stage_s, math::hypot(self.deg[0], self.deg[1])]
    }
}

impl Scale {
    fn new(machine: &Machine, grid: &PassGrid) -> Self {
        let move_s = |to: [Nm; 3]| {
            let to = Commanded(to.map(|Nm(to)| to));
            motion::stage_move(machine, Commanded::default(), to, None).total_s()
        };
        let depth = grid.lattice.depth;
        Self {
            window: grid.window.map(Nm::f64),
            depth: depth.f64(),
            xy_s: move_s([grid.window[0], Nm(0), Nm(0)]),
            z_s: move_s([Nm(0), Nm(0), depth]),
            reach: (depth + machine.most_focus_shift() * 2).f64(),
            zoom_s: machine.zoom_time_s(Nm(0), depth),
        }
    }

    /// The set-up of an area, whose marks are `points`, at a fixture angle.
    fn set_up(&self, points: &[P3], area: Box2, lean_deg: [f64; 2]) -> SetUp {
        let (stops, stage_s) = self.estimate(points, lean_deg);
        SetUp { area, lean_deg, stops, stage_s }
    }

    /// The set-up of an area at its best fixture angle.
    fn best_set_up(&self, points: &[P3], area: Box2, task: Task<'_>) -> SetUp {
        self.set_up(points, area, self.search(points, task))
    }

    /// The set-ups of the lower and the upper half of an area along x or y, each at its best fixture angle.
    fn two_set_ups(&self, points: &[P3], area: Box2, axis: usize, task: Task<'_>) -> Vec<SetUp> {
        let [first, second] = task.split([1, 1]);
        let middle: P2 = P2::new((area.lo.x + area.hi.x) / 2, (area.lo.y + area.hi.y) / 2);
        let border = if axis == 0 { middle.x } else { middle.y };
        let (low, high): (Vec<P3>, Vec<P3>) = points.iter().copied().partition(|p| p[axis] < border as f64);
        let (mut low_area, mut high_area) = (area, area);
        if axis == 0 {
            (low_area.hi.x, high_area.lo.x) = (border, border);
        } else {
            (low_area.hi.y, high_area.lo.y) = (border, border);
        }
        vec![self.best_set_up(&low, low_area, first), self.best_set_up(&high, high_area, second)]
    }

    /// Stops and stage time of points on a part at a fixture angle.
    fn estimate(&self, points: &[P3], [about_x, about_y]: [f64; 2]) -> (u64, f64) {
        let turn = Turn::about([0.0; 3], [(0, about_x.to_radians()), (1, about_y.to_radians())]);
        let turned: Vec<[f64; 3]> = points.iter().map(|&p| turn.apply(p).at).collect();
        let lowest = |k: usize| turned.iter().map(|p| p[k]).fold(f64::INFINITY, f64::min);
        let lo = [lowest(0), lowest(1)];
        let section = |p: &[f64; 3]| [0, 1].map(|k| ((p[k] - lo[k]) / self.window[k]) as usize);
        let columns = turned.iter().map(|p| section(p)[0]).max().map_or(1, |c| c + 1);
        let rows = turned.iter().map(|p| section(p)[1]).max().map_or(1, |r| r + 1);
        let mut heights = vec![[f64::INFINITY, f64::NEG_INFINITY]; columns * rows];
        for p in &turned {
            let [column, row] = section(p);
            let [lo, hi] = &mut heights[row * columns + column];
            (*lo, *hi) = (lo.min(p[2]), hi.max(p[2]));
        }
        let mut sections = 0u64;
        let mut stops = 0u64;
        let mut levels = 0u64;
        for [lo, hi] in heights.iter().filter(|h| h[0] <= h[1]) {
            let count = |height: f64| ((hi - lo) / height).ceil().max(1.0) as u64;
            sections += 1;
            stops += count(self.reach);
            levels += count(self.depth);
        }
        let moves = (stops - sections) as f64 * self.z_s + (levels - stops) as f64 * self.zoom_s;
        (stops, sections as f64 * self.xy_s + moves)
    }

    /// The fixture angle with the least stage time; of equal ones the smallest.
    fn search(&self, points: &[P3], task: Task<'_>) -> [f64; 2] {
        let steps = (STEEPEST / FIRST) as i32;
        let coarse: Vec<[f64; 2]> = (-steps..=steps)
            .flat_map(|i| (-steps..=steps).map(move |j| [f64::from(i) * FIRST, f64::from(j) * FIRST]))
            .collect();
        let [grid, mut rest] = task.split([4, 1]);
        let Some(mut best) = self.least(points, coarse, grid) else { return [0.0; 2] };
        let mut step = FIRST / 2.0;
        while step > LAST {
            let at = best.deg;
            let around = [-1.0, 0.0, 1.0].map(|i| [-1.0, 0.0, 1.0].map(|j| [at[0] + i * step, at[1] + j * step]));
            // How often it looks around is not known: each time has half of what is left.
            let [round, left] = rest.split([1, 1]);
            rest = left;
            match self.least(points, around.concat(), round) {
                Some(better) if better.measure() < best.measure() => best = better,
                _ => step /= 2.0,
            }
        }
        // Angles that can be set.
        best.deg.map(|deg| (deg * 100.0).round() / 100.0)
    }

    /// The best of some fixture angles.
    fn least(&self, points: &[P3], leans: Vec<[f64; 2]>, task: Task<'_>) -> Option<Lean> {
        let task = task.of_steps(leans.len());
        // Measured in any order, compared in one.
        let measured: Vec<Lean> = parallel::map_items(leans, |_, deg| {
            let lean = Lean { deg, stage_s: self.estimate(points, deg).1 };
            task.step();
            lean
        });
        measured.into_iter().min_by(|a, b| {
            let ([a_s, a_deg], [b_s, b_deg]) = (a.measure(), b.measure());
            a_s.total_cmp(&b_s).then(a_deg.total_cmp(&b_deg))
        })
    }
}
