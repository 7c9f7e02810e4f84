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

use super::grid::Layout;
use super::hatch_direction;
use super::inputs::Inputs;
use super::progress::{Phase, Progress};
use super::stroke_chunks::Sweep;
use terrace_core::diag::Error;
use terrace_core::geom::{Box2, Nm, P2, P3, Turn};
use terrace_core::machine::Commanded;
use terrace_core::motion;
use terrace_core::parallel;
use terrace_core::program::{PassId, Sections};
use terrace_core::progress::Task;
use terrace_input::job::Job;

/// One way to set the part up.
#[derive(Clone, Debug)]
pub struct Orientation {
    /// What it is.
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
/// As [`super::plan`].
pub fn orient(job: &Job, progress: Progress<'_>) -> Result<Vec<Orientation>, Error> {
    let inputs = Inputs::load_with_progress(job, Phase::Read.task(progress))?;
    let machine = &inputs.machine;
    let area = inputs.texture.bounds();
    let layout = Layout::new(job, machine, area, PassId(0), None)?;
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
    let sweep = Sweep { surface: &inputs.surface, texture: &texture, max_slope };
    let (footprint, _) = sweep.footprint(&layout.sections, layout.keep, layout.window.map(|w| w / 2), None, tracing);
    let (grid, _) = layout.levels(job, (machine, &inputs.surface), footprint, PassId(0))?;
    let pitch = grid.window.map(|w| (w / 20).max(Nm(2)));
    let fine = Sections { origin: area.lo, pitch, count: [0, 1].map(|k| (area.size()[k] / pitch[k] + 1) as u32) };
    let marks = sweep.marks(&fine, sampling).list();
    let moved = |to: [Nm; 3]| {
        let to = Commanded(to.map(|Nm(to)| to));
        motion::stage_move(machine, Commanded::default(), to, None).total_s()
    };
    let scale = Scale {
        window: grid.window.map(Nm::f64),
        depth: grid.lattice.depth.f64(),
        xy_s: moved([grid.window[0], Nm(0), Nm(0)]),
        z_s: moved([Nm(0), Nm(0), grid.lattice.depth]),
        reach: (grid.lattice.depth + machine.most_focus_shift() * 2).f64(),
        zoom_s: machine.zoom_time_s(Nm(0), grid.lattice.depth),
    };
    let [all, x, y] = Phase::Lean.task(progress).split([2, 2, 2]);
    let whole = |points: &[P3], area: Box2, task: Task<'_>| -> [SetUp; 2] {
        let set_up = |lean_deg: [f64; 2]| {
            let (stops, stage_s) = scale.estimate(points, lean_deg);
            SetUp { area, lean_deg, stops, stage_s }
        };
        [set_up([0.0; 2]), set_up(scale.search(points, task))]
    };
    let [flat, leaning] = whole(&marks, area, all);
    let mut out = vec![Orientation { name: "as placed", set_ups: vec![flat] }];
    out.push(Orientation { name: "tilted fixture", set_ups: vec![leaning] });
    for (axis, name, task) in [(0, "two set-ups, left and right", x), (1, "two set-ups, front and back", y)] {
        let [first, second] = task.split([1, 1]);
        let middle: P2 = P2::new((area.lo.x + area.hi.x) / 2, (area.lo.y + area.hi.y) / 2);
        let border = if axis == 0 { middle.x } else { middle.y };
        let (low, high): (Vec<P3>, Vec<P3>) = marks.iter().copied().partition(|p| p[axis] < border as f64);
        let (mut low_area, mut high_area) = (area, area);
        if axis == 0 {
            (low_area.hi.x, high_area.lo.x) = (border, border);
        } else {
            (low_area.hi.y, high_area.lo.y) = (border, border);
        }
        let set_ups = vec![whole(&low, low_area, first)[1], whole(&high, high_area, second)[1]];
        out.push(Orientation { name, set_ups });
    }
    out[1..].sort_by(|a, b| a.stage_s().total_cmp(&b.stage_s()));
    Ok(out)
}

/// What sections and moves measure.
struct Scale {
    window: [f64; 2],
    depth: f64,
    xy_s: f64,
    z_s: f64,
    /// Heights that one stop serves: the depth range, and with a zoom optic the optic's range more.
    reach: f64,
    /// Time of the optic from level to level.
    zoom_s: f64,
}

impl Scale {
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
        let (mut sections, mut stops, mut levels) = (0u64, 0u64, 0u64);
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
        let measure = |lean: [f64; 2]| (self.estimate(points, lean).1, lean[0].hypot(lean[1]));
        let steps = (STEEPEST / FIRST) as i32;
        let coarse: Vec<[f64; 2]> = (-steps..=steps)
            .flat_map(|i| (-steps..=steps).map(move |j| [f64::from(i) * FIRST, f64::from(j) * FIRST]))
            .collect();
        // Measured in any order, compared in one.
        let least = |leans: Vec<[f64; 2]>, task: Task<'_>| {
            let task = task.of_steps(leans.len());
            let measured: Vec<_> = parallel::map_items(leans, |_, lean| {
                let found = (measure(lean), lean);
                task.step();
                found
            });
            measured.into_iter().min_by(|a, b| a.0.0.total_cmp(&b.0.0).then(a.0.1.total_cmp(&b.0.1)))
        };
        let [grid, mut rest] = task.split([4, 1]);
        let Some((mut best, mut at)) = least(coarse, grid) else { return [0.0; 2] };
        let mut step = FIRST / 2.0;
        while step > LAST {
            let around = [-1.0, 0.0, 1.0].map(|i| [-1.0, 0.0, 1.0].map(|j| [at[0] + i * step, at[1] + j * step]));
            // How often it looks around is not known: each time has half of what is left.
            let [round, left] = rest.split([1, 1]);
            rest = left;
            match least(around.concat(), round) {
                Some((better, lean)) if better < best => (best, at) = (better, lean),
                _ => step /= 2.0,
            }
        }
        // Angles that can be set.
        at.map(|a| (a * 100.0).round() / 100.0)
    }
}
