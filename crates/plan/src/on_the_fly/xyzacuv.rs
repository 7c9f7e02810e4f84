//! Seven axes on the fly: the stage of X, Y, Z, A and C follows a smoothed path with its normal, the scanner's
//! U and V make up the difference.
//!
//! Consumes the beam's path over the part and the machine's limits; promises a motion of all seven axes that keeps
//! focus, beam angle and field wherever it can be done, and the limits of all axes. The spot rests on the part where
//! the path turns sharply ([`spot`](super::spot)); the stage does not: it goes through the spot's own time as a smooth
//! path ([`stage_path`](super::stage_path)), at the pace of the spot or, where that is too fast for its axes, as fast
//! as they can ([`topp`]). U and V are spot less stage at every instant. With five axes the scanner rests, so the stage
//! stops at corners. Units: mm, s, rad.
//!
//! # Source
//! Ma et al. (2025): Gaussian smoothing in arc length, as strong as focal offset, beam angle and displacement
//! allow, searched from 30,000 um down by 0.95; here then by bisection up to the limit.

use crate::on_the_fly::axes::kinematics::{Axes, Deviation, Pivot, Pose, follow};
use crate::on_the_fly::axes::motion::STAGE;
use crate::on_the_fly::decompose::{Family, Limits, Trial, back_off, refine, rms_bend, seven_axes, stage};
use crate::on_the_fly::in_step::in_step_s;
use crate::on_the_fly::kinematic_model::{BeyondTravel, KinematicModel};
use crate::on_the_fly::path::c_rewind::{PathWithRewinds, with_rewinds};
use crate::on_the_fly::path::height_field::HeightField;
use crate::on_the_fly::path::{Node, Path};
use crate::on_the_fly::spot::{Rests, SpotMotion, SpotPace};
use crate::on_the_fly::stage_path::{StagePath, deviations, listed};
use crate::on_the_fly::topp::{self, State, TimedPath};
use terrace_core::diag::{Diag, Error};
use terrace_core::geom::{P3Mm, Part};
use terrace_core::machine::Letter;
use terrace_core::parallel;

/// How the tool's path is found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ToolPath {
    /// Smoothed as strongly as the limits allow; by the Gaussian in the article.
    Filtered(Family),
    /// Smoothed by a Gaussian of this sigma, mm of path.
    Gaussian {
        /// The sigma of the Gaussian.
        sigma: f64,
    },
    /// Least acceleration of the axes within the limits.
    LeastAcceleration,
    /// On the mark itself: five axes, the scanner rests.
    OnTheMark,
}

/// Trials of the article's back-off search: sigma in mm, and the worst deviations there.
pub type BackOff = Vec<Trial<Deviation>>;

/// A path decomposed between five stage axes and the scanner.
#[derive(Clone, Debug)]
pub struct TimedAxes {
    /// The strengths of smoothing that were tried, to the first that holds.
    pub back_off: BackOff,
    /// The one that was taken, mm of path (of the Gaussian sigma); None where nothing is smoothed.
    pub strength: Option<f64>,
    /// The path, with the nodes that C needs to turn back.
    pub path: Path,
    /// Stage axes as the spot comes to its nodes, seen from the model's pivot.
    pub axes: Vec<Axes>,
    /// Deviation of each node from its tool.
    pub deviation: Vec<Deviation>,
    /// The spot in its own time.
    pub spot: SpotMotion,
    /// X, Y, Z, A and C, with the spot's own time as the parameter.
    pub stage: TimedPath,
    /// Whether the stage carries the spot, which rests in the field.
    pub carries: bool,
}

/// A path and its tools, not yet timed.
#[derive(Clone, Debug)]
pub struct UntimedAxes {
    /// The strengths of smoothing that were tried, to the first that holds.
    pub back_off: BackOff,
    /// The strength that was taken, mm of path (of the Gaussian sigma); None where nothing is smoothed.
    pub strength: Option<f64>,
    /// The path, with the nodes that C needs to turn back.
    pub path: Path,
    /// Stage axes over its nodes.
    pub axes: Vec<Axes>,
    /// What is to be marked at its nodes.
    marks: Vec<Pose<Pivot>>,
    tools: ToolPath,
    rewinds: Vec<[usize; 2]>,
    /// What all marks should keep.
    pub limits: Limits,
}

/// Decomposes a path between the axes of a model.
///
/// # Errors
/// Those of [`topp::time_optimal`], which are faults of the program.
pub fn decompose(
    path: &Path,
    height_field: &HeightField,
    model: &KinematicModel<'_>,
    limits: Limits,
    tools: ToolPath,
) -> Result<UntimedAxes, Error> {
    // Ma et al. (2025): the tool goes along the marks smoothed over their arc length, as strongly as focus, incidence
    // and displacement allow; A and C turn the tool upright (eq. 11 to 13), and the scanner makes up the difference
    // between tool and mark. Without a filter the tool is the mark itself, or the path of least acceleration.
    let StageAxes { back_off, strength, axes } = match tools {
        ToolPath::Filtered(family) => filtered(path, height_field, model, limits, family),
        ToolPath::Gaussian { sigma } => gaussian(path, height_field, model, sigma),
        ToolPath::LeastAcceleration => least_acceleration(path, height_field, model, limits)?,
        ToolPath::OnTheMark => {
            StageAxes::not_smoothed(follow(&model.all_from_pivot(&marks(path, height_field)), model.branches()))
        }
    };
    // A rewind of C in a jump adds nodes.
    let PathWithRewinds { path, axes, rewinds } = with_rewinds(path, &axes, model.c_travel);
    let marks = model.all_from_pivot(&marks(&path, height_field));
    Ok(UntimedAxes { back_off, strength, path, axes, marks, tools, rewinds, limits })
}

/// Stage axes over the nodes of a path, and how strongly they were smoothed.
struct StageAxes {
    /// The strengths of smoothing that were tried, to the first that holds.
    back_off: BackOff,
    /// The strength that was taken, mm of path; None where nothing is smoothed.
    strength: Option<f64>,
    axes: Vec<Axes>,
}

impl StageAxes {
    fn not_smoothed(axes: Vec<Axes>) -> Self {
        Self { back_off: BackOff::new(), strength: None, axes }
    }
}

/// The stage under tools smoothed by a filter as strongly as the limits allow.
fn filtered(
    path: &Path,
    height_field: &HeightField,
    model: &KinematicModel<'_>,
    limits: Limits,
    family: Family,
) -> StageAxes {
    let smoothing = Smoothing {
        plan: EvenPlan::of(path),
        family,
        height_field,
        marks: marks(path, height_field),
        weights: path.weights(),
        limits,
    };
    let (back_off, strength) = smoothing.strongest();
    let tools = model.all_from_pivot(&smoothing.tools(strength));
    StageAxes { back_off, strength: Some(strength), axes: follow(&tools, model.branches()) }
}

/// The stage under tools smoothed by a Gaussian of this sigma, mm of path.
fn gaussian(path: &Path, height_field: &HeightField, model: &KinematicModel<'_>, sigma: f64) -> StageAxes {
    let plan = EvenPlan::of(path);
    let smooth = stage(&plan.positions, Family::Gaussian.at(sigma / plan.step));
    let tools = model.all_from_pivot(&plan.tools(&smooth, height_field));
    StageAxes { back_off: BackOff::new(), strength: Some(sigma), axes: follow(&tools, model.branches()) }
}

/// The stage with least acceleration within the limits: over the time that the spot takes, which depends but little on
/// how the stage stands. Where the stage slows the spot down, once more over that time.
fn least_acceleration(
    path: &Path,
    height_field: &HeightField,
    model: &KinematicModel<'_>,
    limits: Limits,
) -> Result<StageAxes, Error> {
    let marks = model.all_from_pivot(&marks(path, height_field));
    let rests = Rests::Corners.of(path);
    let over_time_of = |spot: &SpotMotion| {
        let times: Vec<f64> = spot.times().iter().map(|t| t[0]).collect();
        seven_axes(&marks, &steps(&times), limits)
    };
    let on_the_mark = follow(&marks, model.branches());
    let alone = SpotMotion::new(path, &on_the_mark, model, &rests, &[], SpotPace::Scanner)?;
    let axes = over_time_of(&alone);
    let with_stage = SpotMotion::new(path, &axes, model, &rests, &[], SpotPace::ScannerAndStage)?;
    let is_slower = with_stage.total() > SLOWER * alone.total();
    Ok(StageAxes::not_smoothed(if is_slower { over_time_of(&with_stage) } else { axes }))
}

/// Decomposes a path between the axes of a model and times it.
///
/// # Errors
/// Those of [`topp::time_optimal`], which are faults of the program.
pub fn decompose_and_time(
    path: &Path,
    height_field: &HeightField,
    model: &KinematicModel<'_>,
    limits: Limits,
    tools: ToolPath,
) -> Result<TimedAxes, Error> {
    decompose(path, height_field, model, limits, tools)?.timed(model, 1)
}

/// Windows of time over which the pace of the stage is averaged, s: the longest with which all limits hold is taken.
const WINDOWS: [f64; 3] = [0.1, 0.05, 0.025];
/// How many times longer the spot takes with the stage where least acceleration is looked for over that time again.
const SLOWER: f64 = 1.1;
/// The stage's jerk is found on cells that take no longer than this, s.
const FINE: f64 = 0.0125;
/// Most parts into which the cells between two nodes are cut for that.
const FINEST: usize = 4;

impl UntimedAxes {
    /// The motion, the stage's time found on a grid `refine` times as fine.
    ///
    /// # Errors
    /// Those of [`topp::time_optimal`], which are faults of the program.
    pub fn timed(self, model: &KinematicModel<'_>, refine: usize) -> Result<TimedAxes, Error> {
        let carries = self.tools == ToolPath::OnTheMark;
        let (spot, stage_path) = if carries { self.carried() } else { self.shared(model)? };
        let caps: Vec<f64> = if carries {
            // The parameter is the way: pens and scanner bound the speed along it.
            (1..self.path.len()).map(|i| model.cap(&self.path, spot.way(), i)).collect()
        } else {
            // The parameter is the spot's own time, which does not pass faster than time.
            vec![1.0; stage_path.at.len() - 1]
        };
        let axes = stage_path.at_nodes(&spot);
        let deviation = deviations(&self.marks, &axes);
        // Jerks are seen where cells are short; a stage that is slower than the spot makes them long.
        let longest = stage_path.at.windows(2).map(|w| w[1] - w[0]).fold(0.0, f64::max);
        let parts = |slower: f64| if carries { 1 } else { parts_of_cell(slower * longest) };
        let mut stage = least_time(model, &stage_path, &caps, refine * parts(1.0))?;
        let slower = stage.total_s() / spot.total();
        if parts(slower) > parts(1.0) {
            stage = least_time(model, &stage_path, &caps, refine * parts(slower))?;
        }
        let Self { back_off, strength, path, .. } = self;
        Ok(TimedAxes { back_off, strength, path, axes, deviation, spot, stage, carries })
    }

    /// Refuses what the swivel and the turntable have no travel for, before any time is spent on it.
    ///
    /// # Errors
    /// `travel`, with the travel that would be needed.
    pub(crate) fn within_travel(&self, model: &KinematicModel<'_>) -> Result<(), Error> {
        let faults: Vec<Diag> = model.beyond_travel(&self.axes).into_iter().map(travel_fault).collect();
        if faults.is_empty() { Ok(()) } else { Err(Error::many(faults)) }
    }

    /// The scanner's time of the whole path, s, if the stage took nothing of its limits and were never too slow; and
    /// the time with the stage in step with it, where one is found ([`in_step`](super::in_step)).
    ///
    /// # Errors
    /// Those of [`topp::time_optimal`], which are faults of the program.
    pub fn in_step_s(&self, model: &KinematicModel<'_>, rests: Rests) -> Result<(f64, Option<f64>), Error> {
        let nodes = rests.of(&self.path);
        let spot = SpotMotion::new(&self.path, &self.axes, model, &nodes, &[], SpotPace::Scanner)?;
        let times: Vec<f64> = nodes.windows(2).map(|w| spot.times()[w[1]][0] - spot.times()[w[0]][0]).collect();
        let positions: Vec<[f64; STAGE]> = nodes.iter().map(|&i| listed(&self.axes[i])).collect();
        Ok((spot.total(), in_step_s(&times, &positions, &model.limits)))
    }

    /// Cells and least times, s, of the first `length` mm of the path on grids that are 1, 2 and 4 times as fine.
    ///
    /// # Errors
    /// Those of [`topp::time_optimal`], which are faults of the program.
    pub fn convergence(&self, model: &KinematicModel<'_>, length: f64) -> Result<Vec<[f64; 2]>, Error> {
        let count = self.path.distances().partition_point(|&s| s <= length).max(2).min(self.path.len());
        let cells_and_time = |refine| {
            let timed = self.beginning(count).timed(model, refine)?;
            Ok([timed.stage.report().cells as f64, timed.total_s()])
        };
        [1, 2, 4].into_iter().map(cells_and_time).collect()
    }

    /// The first `count` nodes, as a path of their own.
    fn beginning(&self, count: usize) -> Self {
        Self {
            path: self.path.piece(0..count),
            axes: self.axes[..count].to_vec(),
            marks: self.marks[..count].to_vec(),
            rewinds: self.rewinds.iter().copied().filter(|r| r[1] < count).collect(),
            back_off: BackOff::new(),
            ..*self
        }
    }

    /// A spot that rests in the field, and the stage that carries it, at rest at corners.
    fn carried(&self) -> (SpotMotion, StagePath) {
        let spot = SpotMotion::carried(&self.path.distances());
        let stage = StagePath::through_stops(&spot, &self.axes, Rests::Corners.of(&self.path));
        (spot, stage)
    }

    /// The spot between its rests, and the stage over its time.
    fn shared(&self, model: &KinematicModel<'_>) -> Result<(SpotMotion, StagePath), Error> {
        let Self { path, axes, .. } = self;
        let stops = Rests::Corners.of(path);
        let weights = path.weights();
        let alone = SpotMotion::new(path, axes, model, &stops, &[], SpotPace::ScannerAndStage)?;
        let stage = self.stage_over(&alone, &weights);
        if model.spot.is_none() {
            return Ok((alone, stage));
        }
        // What the stage takes of the scanner's limits is known once it moves; the scanner then is a little slower.
        let shares = stage.shares(path, &alone, model, &stops);
        let spot = SpotMotion::new(path, axes, model, &stops, &shares, SpotPace::ScannerAndStage)?;
        let stage = self.stage_over(&spot, &weights);
        Ok((spot, stage))
    }

    /// The stage over the time of a spot: at a pace averaged over the longest window with which all marks keep their
    /// limits, or through every node where there is none.
    fn stage_over(&self, spot: &SpotMotion, weights: &[f64]) -> StagePath {
        // Least acceleration was found over the spot's time, node by node: it is smooth as it is.
        if self.tools != ToolPath::LeastAcceleration {
            for window in WINDOWS {
                let stage = StagePath::evened(spot, &self.axes, &self.rewinds, window);
                if self.limits.hold(worst(&deviations(&self.marks, &stage.at_nodes(spot)), weights)) {
                    return stage;
                }
            }
        }
        StagePath::through_nodes(spot, &self.axes, &self.rewinds)
    }
}

/// How many parts a cell is cut into that takes so long, s.
fn parts_of_cell(cell_s: f64) -> usize {
    ((cell_s / FINE).ceil() as usize).clamp(1, FINEST)
}

/// The refusal of a motion that turns an axis beyond its travel.
fn travel_fault(beyond: BeyondTravel) -> Diag {
    let BeyondTravel { letter, needed: [least, most], travel: [lo, hi] } = beyond;
    let text = format!(
        "{} would have to turn from {least:.2} to {most:.2} deg, {:.2} deg in all; its travel is {lo} to {hi} deg",
        letter.char(),
        most - least
    );
    let hint = if letter == Letter::C {
        "jumps are where C can turn back: mark with more of them, or on a turntable without ends \
         (travel = \"continuous\")"
    } else {
        "see the travel of A in the machine file; a part may lean no more than that"
    };
    Diag::limit("travel", text).hint(hint)
}

/// The least time of the stage along a path, on a grid `refine` times as fine.
fn least_time(model: &KinematicModel<'_>, path: &StagePath, caps: &[f64], refine: usize) -> Result<TimedPath, Error> {
    let path = topp::Path { positions: &path.positions, s: &path.at, caps, stops: &path.stops };
    topp::time_optimal(&path, &model.limits, &topp::Options { refine, ..topp::Options::default() })
}

/// Where all axes are at an instant.
#[derive(Clone, Copy, Debug)]
pub struct Instant {
    /// The stage, seen from the pivot.
    pub axes: Axes,
    /// The node of the path that the spot comes from.
    pub node: usize,
    /// U and V.
    pub field: [f64; 2],
}

/// A motion that is read at rising times.
pub struct Reader<'a> {
    timed: &'a TimedAxes,
    model: &'a KinematicModel<'a>,
    hint: usize,
    node: usize,
    cell: usize,
    state: State,
}

impl Reader<'_> {
    /// The axes at a time, s.
    pub fn at(&mut self, time: f64) -> Instant {
        self.timed.stage.at(time, &mut self.hint, &mut self.state);
        let own = self.state.s;
        let TimedAxes { path, spot, .. } = self.timed;
        let node = spot.node_at(own, &mut self.node);
        let way = spot.way_at(own, &mut self.node, &mut self.cell);
        let [from, to] = [spot.way()[node], spot.way()[node + 1]];
        let share = ((way - from) / (to - from)).clamp(0.0, 1.0);
        let [p, q] = [path.nodes[node].at, path.nodes[node + 1].at];
        self.instant(node, p.lerp(q, share))
    }

    /// The axes at a time, s, at which the spot is at a node.
    pub(crate) fn at_node(&mut self, node: usize, time: f64) -> Instant {
        self.timed.stage.at(time, &mut self.hint, &mut self.state);
        self.instant(node, self.timed.path.nodes[node].at)
    }

    fn instant(&self, node: usize, spot: P3Mm) -> Instant {
        let [x, y, z, a, c] = std::array::from_fn(|k| self.state.position[k]);
        let axes = Axes { xyz: P3Mm::new([x, y, z]), a, c };
        let seen = axes.seen(self.model.from_pivot(spot));
        Instant { axes, node, field: if self.timed.carries { [0.0; 2] } else { seen.uv } }
    }
}

impl TimedAxes {
    /// Whole time, s.
    pub fn total_s(&self) -> f64 {
        self.stage.total_s()
    }

    /// When the spot comes to each node and leaves it, s.
    pub fn times(&self) -> Vec<[f64; 2]> {
        let mut hint = 0;
        self.spot.times().iter().map(|t| t.map(|own| self.stage.time_at(own, &mut hint))).collect()
    }

    /// The motion of all axes.
    pub fn read<'a>(&'a self, model: &'a KinematicModel<'a>) -> Reader<'a> {
        Reader { timed: self, model, hint: 0, node: 0, cell: 0, state: State::default() }
    }
}

/// What a decomposition makes of a path for seven axes, as strong as the limits allow.
#[derive(Clone, Debug)]
pub struct AxisFigures {
    /// The strength of the filter, mm of path; None where there is none to choose.
    pub strength: Option<f64>,
    /// Worst deviations.
    pub worst: Deviation,
    /// Root of the mean squared acceleration of X, Y and Z at the first pen's speed, mm/s².
    pub rms_acceleration: f64,
    /// Least time, s.
    pub time_s: f64,
}

impl TimedAxes {
    /// Worst deviations of its marks.
    pub fn worst(&self) -> Deviation {
        let marks = self.deviation.iter().zip(self.path.weights()).filter(|(_, w)| *w > 0.0);
        marks.fold(Deviation::default(), |worst, (&d, _)| worst.max(d))
    }

    /// The figures for the table of decompositions.
    pub fn axis_figures(&self, model: &KinematicModel<'_>) -> AxisFigures {
        let xyz: Vec<[f64; 3]> = self.axes.iter().map(|axes| axes.xyz.mm).collect();
        let speed = model.pens.first().map_or(0.0, |pen| pen.speed.as_mm_s());
        // At an even speed along the path an acceleration is the second derivative by the way times the speed squared.
        AxisFigures {
            strength: self.strength,
            worst: self.worst(),
            rms_acceleration: rms_bend(&xyz, &steps(&self.path.distances())) * speed * speed,
            time_s: self.total_s(),
        }
    }
}

/// The marks of a path, and its jumps, on the height field.
fn marks(path: &Path, height_field: &HeightField) -> Vec<Pose<Part>> {
    let poses = path.nodes.iter().map(|&Node { at: p, .. }| Pose { p, n: height_field.at(p.xy()).normal() });
    poses.collect()
}

fn steps(s: &[f64]) -> Vec<f64> {
    s.windows(2).map(|w| w[1] - w[0]).collect()
}

/// Where the article's back-off search starts, mm of path (30,000 um).
const START: f64 = 30.0;
/// What each trial of that search is of the one before.
const FACTOR: f64 = 0.95;
/// How many times farther up filters other than the Gaussian start: their windows are longer for as much smoothing.
const LONGER: f64 = 10.0;
/// Share of the limits that the smoothing leaves for the pace of the stage, which is not quite that of the spot.
const SPARE: f64 = 0.01;

/// The worst deviations: of focus and angle where it is marked, of the field everywhere.
fn worst(deviations: &[Deviation], weights: &[f64]) -> Deviation {
    deviations.iter().zip(weights).fold(Deviation::default(), |worst, (&d, &w)| {
        worst.max(if w > 0.0 { d } else { Deviation { lateral: d.lateral, ..Deviation::default() } })
    })
}

/// The plan of a path at even steps of its length.
struct EvenPlan {
    positions: Vec<[f64; 2]>,
    /// Length between two of the positions, mm.
    step: f64,
    /// Way along the path to each of its own nodes, mm.
    way: Vec<f64>,
}

impl EvenPlan {
    /// As many positions as the path has nodes.
    fn of(path: &Path) -> Self {
        let way = path.distances();
        let total = way.last().copied().unwrap_or_default();
        let count = path.len().max(2);
        let step = total / (count - 1) as f64;
        let mut positions = Vec::with_capacity(count);
        let mut i = 0;
        for k in 0..count {
            let s = k as f64 * step;
            while i + 2 < way.len() && way[i + 1] <= s {
                i += 1;
            }
            // Invariant: s lies between nodes i and i + 1, or past the last by rounding.
            let t = ((s - way[i]) / (way[i + 1] - way[i])).clamp(0.0, 1.0);
            positions.push([0, 1].map(|c| path.nodes[i].at[c] + t * (path.nodes[i + 1].at[c] - path.nodes[i].at[c])));
        }
        Self { positions, step, way }
    }

    /// The tool at every node of the path whose plan was smoothed.
    fn tools(&self, smooth: &[[f64; 2]], height_field: &HeightField) -> Vec<Pose<Part>> {
        /// Nodes that a thread takes at a time.
        const CHUNK: usize = 4096;
        let chunks: Vec<&[f64]> = self.way.chunks(CHUNK).collect();
        let tools_of = |ways: &[f64]| ways.iter().map(|&s| self.tool(smooth, height_field, s)).collect::<Vec<_>>();
        parallel::map(chunks.len(), |k| tools_of(chunks[k])).concat()
    }

    /// The tool at a way along the path: upright on the height field under the smoothed plan.
    fn tool(&self, smooth: &[[f64; 2]], height_field: &HeightField, s: f64) -> Pose<Part> {
        let at = s / self.step;
        let i = (at as usize).min(smooth.len() - 2);
        let t = at - i as f64;
        let xy = [0, 1].map(|c| smooth[i][c] + t * (smooth[i + 1][c] - smooth[i][c]));
        let h = height_field.at(xy);
        Pose { p: P3Mm::new([xy[0], xy[1], h.z]), n: h.normal() }
    }
}

/// A search for the strongest smoothing of a path by a filter, strengths in mm of path.
struct Smoothing<'a> {
    plan: EvenPlan,
    family: Family,
    height_field: &'a HeightField,
    /// What is to be marked at the nodes of the path.
    marks: Vec<Pose<Part>>,
    /// How much each node counts; those of weight 0 are not marked.
    weights: Vec<f64>,
    limits: Limits,
}

impl Smoothing<'_> {
    /// The tools over the nodes of the path, smoothed so strongly.
    fn tools(&self, strength: f64) -> Vec<Pose<Part>> {
        let smooth = stage(&self.plan.positions, self.family.at(strength / self.plan.step));
        self.plan.tools(&smooth, self.height_field)
    }

    /// The worst deviations of marks from tools smoothed so strongly.
    fn worst_deviation(&self, strength: f64) -> Deviation {
        let tools = self.tools(strength);
        let deviations: Vec<Deviation> = self.marks.iter().zip(&tools).map(|(m, t)| Deviation::of(m, t)).collect();
        worst(&deviations, &self.weights)
    }

    /// The article's back-off search with the worst deviations at each strength; and the largest strength that keeps
    /// the limits, by bisection above its last trial, 0 where none does.
    fn strongest(&self) -> (BackOff, f64) {
        let start = if self.family == Family::Gaussian { START } else { LONGER * START };
        let trials = back_off(start, FACTOR, self.plan.step / 4.0, |strength| {
            let worst = self.worst_deviation(strength);
            (worst, self.limits.hold(worst))
        });
        let held = trials.last().filter(|trial| trial.holds).map_or(0.0, |trial| trial.strength);
        // Where the first trial holds there is nothing above it to look for.
        let failed = trials.iter().rev().nth(1).filter(|_| held > 0.0).map(|trial| trial.strength);
        let limits = self.limits.scaled(1.0 - SPARE);
        let finer = failed.and_then(|failed| {
            refine(held, failed, 1e-3 * self.plan.step, |strength| {
                let worst = self.worst_deviation(strength);
                (worst, limits.hold(worst))
            })
        });
        (trials, finer.map_or(held, |trial| trial.strength))
    }
}

#[cfg(test)]
mod tests;
