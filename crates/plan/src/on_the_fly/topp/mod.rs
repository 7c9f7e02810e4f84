//! The least time along a given path under speed, acceleration and jerk limits of all axes together.
//!
//! Consumes positions of up to seven axes at nodes of a path with the path's own parameter s, limits per axis,
//! a largest ds/dt per segment, and the nodes where the machine must come to rest. Promises times at the nodes,
//! the motion at any time, and a report of what a second look at speed, acceleration and jerk found. Units: mm,
//! s, and whatever unit an axis has (mm or rad).
//!
//! # Model
//! Between two stops lies a *run*: a natural cubic spline through the nodes of every axis, so position,
//! direction and curvature are continuous. Runs begin and end at rest and do not know of each other. A run is
//! cut into cells, finer towards its stops (`grid`); the unknown is b = (ds/dt)² at the cells' borders,
//! linear in s between, so ds/dt changes evenly within a cell.
//!
//! 1. Speed and acceleration (`reachability`): the greatest b that backward and forward passes over linear constraints
//!    of two neighbours leave (Pham and Pham, IEEE Trans. Robotics 34 (2018) 645: TOPP-RA).
//! 2. Jerk (`jerk_rows`, `jerk`): acceleration from the middle of a cell to that of the next changes by a linear form
//!    of three neighbours of b, and the time between is convex in b, so its tangent bounds it from below: a linear
//!    constraint that is never too lax. An interior point method (`interior_point`) takes new tangents at every step.
//!
//! A run whose axes are all linear in s with one cap is solved in closed form (`closed_form`).
//!
//! # Limits
//! With jerk limits the acceleration still steps at the borders of cells: the jerk that is limited is its change
//! from middle to middle over the time between. The program is not convex as a whole, so its answer is a local
//! least: on smooth paths all beginnings end alike, on nodes that scatter by a third of their spacing they differ
//! by some percent. A stretch that does not settle keeps a slow motion that is within limits. Curves come from
//! the spline, which cuts corners that are not named as stops.
//!
//! With jerk limits on seven axes a core solves 40,000 to 180,000 cells a second, fewest on long smooth runs.

mod closed_form;
mod grid;
mod interior_point;
mod jerk;
mod jerk_rows;
mod ratio;
mod reachability;

use crate::on_the_fly::spline::{self, cell};
use grid::Grid;
use reachability::Reach;
use terrace_core::diag::{Diag, Error};
use terrace_core::math;
use terrace_core::parallel;

/// Most axes.
pub const AXES: usize = 7;
/// What a check may find beyond a limit before a run is slowed down, relative.
const TOLERANCE: f64 = 1e-3;

/// What one axis may do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limit {
    /// Largest speed, unit/s.
    pub speed: f64,
    /// Largest acceleration, unit/s².
    pub acceleration: f64,
    /// Largest jerk, unit/s³; `None`: acceleration may step.
    pub jerk: Option<f64>,
}

/// A path through nodes.
#[derive(Clone, Copy, Debug)]
pub struct Path<'a> {
    /// Positions, as many per node as there are limits.
    pub positions: &'a [f64],
    /// The parameter at the nodes, strictly increasing, mm.
    pub s: &'a [f64],
    /// Largest ds/dt per segment, mm/s.
    pub caps: &'a [f64],
    /// Nodes where all axes rest, increasing; the ends always do.
    pub stops: &'a [usize],
}

/// How finely to solve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Cells per segment; times as many near stops.
    pub refine: usize,
    /// Cells that a run has at least, times `refine`.
    pub least_cells: usize,
    /// Gain of time, relative, for which no more steps are made.
    pub gain: f64,
}

impl Default for Options {
    fn default() -> Self {
        Self { refine: 1, least_cells: 16, gain: 1e-3 }
    }
}

/// The largest share of its limit that any axis reached, as re-checked at borders, middles and quarters of
/// cells.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Ratio {
    /// Share of speed, caps of ds/dt included.
    pub speed: f64,
    /// Share of acceleration.
    pub acceleration: f64,
    /// Share of jerk, from middle to middle; 0 without limit.
    pub jerk: f64,
}

impl Ratio {
    fn worst(self, other: Self) -> Self {
        Self {
            speed: self.speed.max(other.speed),
            acceleration: self.acceleration.max(other.acceleration),
            jerk: self.jerk.max(other.jerk),
        }
    }

    /// Factor on time that brings the ratios to 1; at least 1.
    fn slow_down(&self) -> f64 {
        self.speed.max(self.acceleration.sqrt()).max(math::cbrt(self.jerk)).max(1.0)
    }
}

/// How a path was solved.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Report {
    /// Whole time, s.
    pub total_s: f64,
    /// What it would be without jerk limits on the same cells, s.
    pub without_jerk_s: f64,
    /// Runs.
    pub runs: usize,
    /// Runs in closed form.
    pub straight: usize,
    /// Cells.
    pub cells: usize,
    /// Most steps of descent of any window.
    pub steps: usize,
    /// What of its limits the final motion reaches.
    pub ratio: Ratio,
    /// Largest factor by which a run's time was stretched to keep limits between borders of cells.
    pub stretch: f64,
}

impl Report {
    /// Adds all of a run but its time.
    fn add_run(&mut self, run: &Self) {
        self.without_jerk_s += run.without_jerk_s;
        self.runs += 1;
        self.straight += run.straight;
        self.cells += run.cells;
        self.steps = self.steps.max(run.steps);
        self.ratio = self.ratio.worst(run.ratio);
        self.stretch = self.stretch.max(run.stretch);
    }
}

/// Axes at a time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct State {
    /// The parameter, mm.
    pub s: f64,
    /// ds/dt, mm/s.
    pub rate: f64,
    /// Positions.
    pub position: Vec<f64>,
    /// Velocities.
    pub velocity: Vec<f64>,
    /// Accelerations.
    pub acceleration: Vec<f64>,
}

/// A path with its motion.
#[derive(Clone, Debug)]
pub struct TimedPath {
    axes: usize,
    positions: Vec<f64>,
    /// Second derivatives at the nodes.
    bends: Vec<f64>,
    nodes: Vec<f64>,
    /// Borders of cells: parameter, ds/dt, time, segment that begins there or holds it.
    s: Vec<f64>,
    rate: Vec<f64>,
    time: Vec<f64>,
    segment: Vec<u32>,
    /// Border of each node.
    at_node: Vec<u32>,
    report: Report,
}

/// A run with its motion: borders of its cells.
struct TimedRun {
    /// Offsets from the run's start.
    x: Vec<f64>,
    rate: Vec<f64>,
    time: Vec<f64>,
    /// Segments of the path, by the border where they begin; the last border has none.
    segment: Vec<u32>,
    report: Report,
}

/// The fastest motion along a path.
///
/// # Errors
/// `fly-path` where numbers of the path or the limits do not fit together, which a caller must not let happen.
pub fn time_optimal(path: &Path, limits: &[Limit], options: &Options) -> Result<TimedPath, Error> {
    validate(path, limits)?;
    let (axes, last) = (limits.len(), path.s.len() - 1);
    let mut stops: Vec<usize> = vec![0];
    stops.extend(path.stops.iter().copied().filter(|&n| n > 0 && n < last));
    stops.push(last);
    stops.dedup();
    let mut bends = vec![0.0; path.positions.len()];
    let mut rest = &mut bends[..];
    let mut parts = Vec::with_capacity(stops.len());
    for w in stops.windows(2) {
        // The second derivative is 0 at both ends of a run. A run owns those of its nodes but the last, which is the
        // first of the next run.
        let (part, tail) = rest.split_at_mut((w[1] - w[0]) * axes);
        parts.push((w[0], w[1], part));
        rest = tail;
    }
    let runs: Vec<TimedRun> = parallel::map_items(parts, |_, (first, last, bends)| {
        spline::bends(&path.positions[first * axes..(last + 1) * axes], &path.s[first..=last], axes, bends);
        run(path, limits, options, first, last, bends)
    });
    Ok(join(path, axes, bends, &runs))
}

/// Refuses numbers that do not fit together.
fn validate(path: &Path, limits: &[Limit]) -> Result<(), Error> {
    let refused = |what: &str| Err(Diag::bug("fly-path", format!("a path cannot be timed: {what}")).into());
    let (axes, nodes) = (limits.len(), path.s.len());
    let positive = |v: f64| v > 0.0 && v.is_finite();
    if !(1..=AXES).contains(&axes) || nodes < 2 || nodes > u32::MAX as usize / 64 {
        return refused("it needs one to seven axes and two or more nodes");
    }
    if path.positions.len() != nodes * axes || path.caps.len() != nodes - 1 {
        return refused("positions, nodes and segments differ in number");
    }
    if !path.s.windows(2).all(|w| positive(w[1] - w[0])) || !path.positions.iter().all(|p| p.is_finite()) {
        return refused("its parameter does not increase, or a number is not finite");
    }
    if !path.caps.iter().all(|&c| positive(c)) {
        return refused("a largest speed is not positive");
    }
    if !limits.iter().all(|l| positive(l.speed) && positive(l.acceleration) && l.jerk.is_none_or(positive)) {
        return refused("a limit is not positive");
    }
    if !path.stops.windows(2).all(|w| w[0] < w[1]) {
        return refused("its stops are not in order");
    }
    Ok(())
}

/// Solves one run from rest to rest.
fn run(path: &Path, limits: &[Limit], options: &Options, first: usize, last: usize, bends: &[f64]) -> TimedRun {
    if let Some(solved) = closed_form::solve(path, limits, first, last, bends) {
        return solved;
    }
    general(path, limits, options, first, last, bends)
}

/// Solves any run on cells.
fn general(path: &Path, limits: &[Limit], options: &Options, first: usize, last: usize, bends: &[f64]) -> TimedRun {
    let grid = Grid::lay(path, limits, options, first, last, bends);
    let Reach { most, greatest: mut b } = reachability::reach(&grid);
    let without_jerk_s = grid.times(&b).last().copied().unwrap_or(0.0);
    let mut steps = 0;
    if grid.has_jerk() {
        steps = jerk::smooth(&grid, most, &mut b, options);
    }
    let mut reached = ratio::of(&grid, &b);
    let mut stretch = reached.slow_down();
    if stretch > 1.0 + TOLERANCE / 3.0 {
        b.iter_mut().for_each(|b| *b /= stretch * stretch);
        reached = ratio::of(&grid, &b);
    } else {
        stretch = 1.0;
    }
    let time = grid.times(&b);
    let report = Report {
        total_s: time.last().copied().unwrap_or(0.0),
        without_jerk_s,
        runs: 1,
        straight: 0,
        cells: b.len() - 1,
        steps,
        ratio: reached,
        stretch,
    };
    let rate = b.iter().map(|b| b.sqrt()).collect();
    TimedRun { x: grid.x, rate, time, segment: grid.segment, report }
}

/// Puts the runs one after the other.
fn join(path: &Path, axes: usize, bends: Vec<f64>, runs: &[TimedRun]) -> TimedPath {
    let borders = 1 + runs.iter().map(|r| r.x.len() - 1).sum::<usize>();
    let mut out = TimedPath {
        axes,
        positions: path.positions.to_vec(),
        bends,
        nodes: path.s.to_vec(),
        s: Vec::with_capacity(borders),
        rate: Vec::with_capacity(borders),
        time: Vec::with_capacity(borders),
        segment: Vec::with_capacity(borders),
        at_node: Vec::with_capacity(path.s.len()),
        report: Report { stretch: 1.0, ..Report::default() },
    };
    let mut start_s = 0.0;
    for run in runs {
        let from = path.s[run.segment[0] as usize];
        for i in 0..run.x.len() - 1 {
            let segment = run.segment[i];
            let begins = i == 0 || run.segment[i - 1] != segment;
            if begins {
                out.at_node.push(out.s.len() as u32);
            }
            out.s.push(if begins { path.s[segment as usize] } else { from + run.x[i] });
            out.rate.push(run.rate[i]);
            out.time.push(start_s + run.time[i]);
            out.segment.push(segment);
        }
        start_s += run.report.total_s;
        out.report.add_run(&run.report);
    }
    out.report.total_s = start_s;
    out.at_node.push(out.s.len() as u32);
    out.s.push(path.s[path.s.len() - 1]);
    out.rate.push(0.0);
    out.time.push(start_s);
    out.segment.push(path.s.len() as u32 - 2);
    out
}

/// A motion within a cell.
struct PlaceInCell {
    /// Way since the cell began, mm.
    way: f64,
    /// ds/dt, mm/s.
    rate: f64,
    /// d²s/dt², mm/s².
    s_acceleration: f64,
}

impl TimedPath {
    /// How it was solved.
    pub fn report(&self) -> &Report {
        &self.report
    }

    /// Whole time, s.
    pub fn total_s(&self) -> f64 {
        self.report.total_s
    }

    /// Times at the path's nodes, increasing, s.
    pub(crate) fn node_times(&self) -> impl ExactSizeIterator<Item = f64> + '_ {
        self.at_node.iter().map(|&i| self.time[i as usize])
    }

    /// The time at a node of the path, s.
    pub(crate) fn node_time(&self, node: usize) -> f64 {
        self.time[self.at_node[node] as usize]
    }

    /// ds/dt at the path's nodes, mm/s.
    #[cfg(test)]
    fn node_rates(&self) -> impl ExactSizeIterator<Item = f64> + '_ {
        self.at_node.iter().map(|&i| self.rate[i as usize])
    }

    /// The axes at `time`, s, held at its ends before and after.
    ///
    /// `hint` is the cell of the last call, and becomes that of this one: rising times cost no search.
    pub fn at(&self, time: f64, hint: &mut usize, state: &mut State) {
        let (i, t) = cell(&self.time, time, hint);
        let place = self.place_in_cell(i, t - self.time[i]);
        state.s = self.s[i] + place.way;
        state.rate = place.rate;
        self.state_at(self.segment[i] as usize, place.s_acceleration, state);
    }

    /// The parameter at `time`, as [`TimedPath::at`] has it.
    pub(crate) fn parameter_at(&self, time: f64, hint: &mut usize) -> f64 {
        let (i, t) = cell(&self.time, time, hint);
        self.s[i] + self.place_in_cell(i, t - self.time[i]).way
    }

    /// When the parameter is reached, s; `hint` as in [`TimedPath::at`].
    pub fn time_at(&self, s: f64, hint: &mut usize) -> f64 {
        let (i, s) = cell(&self.s, s, hint);
        // Invariant: the time in the cell lies between these.
        let (mut lo, mut hi) = (0.0, self.time[i + 1] - self.time[i]);
        let x = s - self.s[i];
        if x <= 0.0 || s >= self.s[i + 1] {
            return self.time[i] + if x <= 0.0 { 0.0 } else { hi };
        }
        // Newton's steps, by bisection where one leaves what is left of the cell.
        let mut t = hi * x / (self.s[i + 1] - self.s[i]);
        for _ in 0..60 {
            let PlaceInCell { way, rate, .. } = self.place_in_cell(i, t);
            *(if way < x { &mut lo } else { &mut hi }) = t;
            let next = t + (x - way) / rate;
            let next = if lo < next && next < hi { next } else { 0.5 * (lo + hi) };
            if (next - t).abs() <= 1e-15 * self.time[i + 1].max(1.0) {
                break;
            }
            t = next;
        }
        self.time[i] + t
    }

    /// Where the motion is in a cell after `t`, s. Both ends give a cubic, which is exact for even acceleration and for
    /// even jerk.
    fn place_in_cell(&self, i: usize, t: f64) -> PlaceInCell {
        let d = self.time[i + 1] - self.time[i];
        let (v0, v1, h) = (self.rate[i], self.rate[i + 1], self.s[i + 1] - self.s[i]);
        let (mean, u) = (h / d, t / d);
        let (c2, c3) = (3.0 * mean - 2.0 * v0 - v1, v0 + v1 - 2.0 * mean);
        PlaceInCell {
            way: t * (v0 + u * (c2 + u * c3)),
            rate: v0 + u * (2.0 * c2 + 3.0 * u * c3),
            s_acceleration: (2.0 * c2 + 6.0 * u * c3) / d,
        }
    }

    /// Position, velocity and acceleration of every axis in a segment, by the chain rule, from `state.s` (mm),
    /// `state.rate` (ds/dt) and `s_acceleration` (d2s/dt2, mm/s2).
    fn state_at(&self, segment: usize, s_acceleration: f64, state: &mut State) {
        let k = self.axes;
        for list in [&mut state.position, &mut state.velocity, &mut state.acceleration] {
            list.resize(k, 0.0);
        }
        let (s0, s1) = (self.nodes[segment], self.nodes[segment + 1]);
        let (from, to) = (segment * k, (segment + 1) * k);
        for a in 0..k {
            let ends = [self.positions[from + a], self.positions[to + a]];
            let bends = [self.bends[from + a], self.bends[to + a]];
            let [q, d1, d2] = spline::segment(ends, bends, s1 - s0, state.s - s0);
            state.position[a] = q;
            state.velocity[a] = d1 * state.rate;
            state.acceleration[a] = d2 * state.rate * state.rate + d1 * s_acceleration;
        }
    }
}

#[cfg(test)]
mod tests;
