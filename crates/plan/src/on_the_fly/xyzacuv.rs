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

use crate::on_the_fly::axes::kinematics::{Axes, Deviation, Pose, follow};
use crate::on_the_fly::axes::motion::STAGE;
use crate::on_the_fly::decompose::{Family, Limits, Trial, back_off, refine, rms_bend, seven_axes, stage};
use crate::on_the_fly::in_step::in_step_s;
use crate::on_the_fly::kinematic_model::{BeyondTravel, KinematicModel};
use crate::on_the_fly::path::c_rewind::{Rewound, rewound};
use crate::on_the_fly::path::height_field::HeightField;
use crate::on_the_fly::path::{Node, Path};
use crate::on_the_fly::spot::{Rests, SpotMotion, Waits};
use crate::on_the_fly::stage_path::{StagePath, deviations, listed};
use crate::on_the_fly::topp::{self, State, Timed};
use terrace_core::diag::{Diag, Error};
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
    pub stage: Timed,
    /// Whether the stage carries the spot, which rests in the field.
    pub carries: bool,
}

/// A path and its tools, not yet timed.
#[derive(Clone, Debug)]
pub struct Decomposed {
    /// How far the motion was held back, as [`TimedAxes::back_off`] says.
    pub back_off: BackOff,
    /// The strength of the filter, as [`TimedAxes::strength`] says.
    pub strength: Option<f64>,
    /// The path, with the nodes that C needs to turn back.
    pub path: Path,
    /// Stage axes over its nodes.
    pub axes: Vec<Axes>,
    /// What is to be marked at its nodes, seen from the pivot.
    marks: Vec<Pose>,
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
) -> Result<Decomposed, Error> {
    let s = path.distances();
    let marks = marks(path, height_field);
    // Ma et al. (2025): the tool goes along the marks smoothed over their arc length, as strongly as focus, incidence
    // and displacement allow; A and C turn the tool upright (eq. 11 to 13), and the scanner makes up the difference
    // between tool and mark. Without a filter the tool is the mark itself, or the path of least acceleration.
    let (back_off, strength, axes) = match tools {
        ToolPath::Filtered(family) => {
            let even = Resampled::of(path, &s);
            let smooth = |strength: f64| stage(&even.plan, family.at(strength / even.step));
            let tools = |strength: f64| even.tools(&smooth(strength), height_field, &s);
            let (trials, strength) = even.smoothing(family, &tools, &marks, &path.weights(), limits);
            let tools = model.all_from_pivot(tools(strength));
            (trials, Some(strength), follow(&tools, model.branches()))
        }
        ToolPath::Gaussian { sigma } => {
            let even = Resampled::of(path, &s);
            let smooth = stage(&even.plan, Family::Gaussian.at(sigma / even.step));
            let tools = model.all_from_pivot(even.tools(&smooth, height_field, &s));
            (BackOff::new(), Some(sigma), follow(&tools, model.branches()))
        }
        ToolPath::LeastAcceleration => {
            // Least over the time that the spot takes, which depends but little on how the stage stands; where the
            // stage slows it down, once more over that time.
            let marks = model.all_from_pivot(marks);
            let rests = Rests::Corners.of(path);
            let over = |spot: &SpotMotion| {
                let times: Vec<f64> = spot.times().iter().map(|t| t[0]).collect();
                seven_axes(&marks, &steps(&times), limits)
            };
            let alone = SpotMotion::new(path, &follow(&marks, model.branches()), model, &rests, &[], Waits::AtRests)?;
            let axes = over(&alone);
            let paced = SpotMotion::new(path, &axes, model, &rests, &[], Waits::OnTheWay)?;
            let is_slower = paced.total() > SLOWER * alone.total();
            (BackOff::new(), None, if is_slower { over(&paced) } else { axes })
        }
        ToolPath::OnTheMark => (BackOff::new(), None, follow(&model.all_from_pivot(marks), model.branches())),
    };
    // A rewind of C in a jump adds nodes.
    let Rewound { path, axes, rewinds } = rewound(path, &axes, model.c_travel);
    let marks = model.all_from_pivot(self::marks(&path, height_field));
    Ok(Decomposed { back_off, strength, path, axes, marks, tools, rewinds, limits })
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
/// Longest time between nodes of the stage that its jerk is looked at, s, and how many parts a cell gets at most.
const FINE: f64 = 0.0125;
const FINEST: usize = 4;

impl Decomposed {
    /// The motion, the stage's time found on a grid `refine` times as fine.
    ///
    /// # Errors
    /// Those of [`topp::time_optimal`], which are faults of the program.
    pub fn timed(self, model: &KinematicModel<'_>, refine: usize) -> Result<TimedAxes, Error> {
        let carries = self.tools == ToolPath::OnTheMark;
        let (spot, stage, caps) = if carries {
            let spot = SpotMotion::carried(&self.path.distances());
            let stage = StagePath::through_stops(&spot, &self.axes, Rests::Corners.of(&self.path));
            let caps = (1..self.path.len()).map(|i| model.cap(&self.path, spot.way(), i)).collect();
            (spot, stage, caps)
        } else {
            let (spot, stage) = self.shared(model)?;
            let caps = vec![1.0; stage.at.len() - 1];
            (spot, stage, caps)
        };
        let axes = stage.at_nodes(&spot);
        let deviation = deviations(&self.marks, &axes);
        // Jerks are seen where cells are short; a stage that is slower than the spot makes them long.
        let apart = stage.at.windows(2).map(|w| w[1] - w[0]).fold(0.0, f64::max);
        let finer = |slower: f64| if carries { 1 } else { ((slower * apart / FINE).ceil() as usize).clamp(1, FINEST) };
        let path = stage;
        let mut stage = least_time(model, &path, &caps, refine * finer(1.0))?;
        let slower = stage.total_s() / spot.total();
        if finer(slower) > finer(1.0) {
            stage = least_time(model, &path, &caps, refine * finer(slower))?;
        }
        let Self { back_off, strength, path, .. } = self;
        Ok(TimedAxes { back_off, strength, path, axes, deviation, spot, stage, carries })
    }

    /// Refuses what the swivel and the turntable have no travel for, before any time is spent on it.
    ///
    /// # Errors
    /// `travel`, with the travel that would be needed.
    pub(crate) fn within_travel(&self, model: &KinematicModel<'_>) -> Result<(), Error> {
        let fault = |BeyondTravel { letter, needed: [least, most], travel: [lo, hi] }| {
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
        };
        let faults: Vec<Diag> = model.beyond_travel(&self.axes).into_iter().map(fault).collect();
        if faults.is_empty() { Ok(()) } else { Err(Error::many(faults)) }
    }

    /// The scanner's time of the whole path, s, if the stage took nothing of its limits and were never too slow; and
    /// the time with the stage in step with it, where one is found ([`in_step`](super::in_step)).
    ///
    /// # Errors
    /// As [`Decomposed::timed`].
    pub fn in_step_s(&self, model: &KinematicModel<'_>, rests: Rests) -> Result<(f64, Option<f64>), Error> {
        let nodes = rests.of(&self.path);
        let spot = SpotMotion::new(&self.path, &self.axes, model, &nodes, &[], Waits::AtRests)?;
        let times: Vec<f64> = nodes.windows(2).map(|w| spot.times()[w[1]][0] - spot.times()[w[0]][0]).collect();
        let positions: Vec<[f64; STAGE]> = nodes.iter().map(|&i| listed(&self.axes[i])).collect();
        Ok((spot.total(), in_step_s(&times, &positions, &model.limits)))
    }

    /// Cells and least times, s, of the first `length` mm of the path on grids that are 1, 2 and 4 times as fine.
    ///
    /// # Errors
    /// As [`Decomposed::timed`].
    pub fn convergence(&self, model: &KinematicModel<'_>, length: f64) -> Result<Vec<[f64; 2]>, Error> {
        let count = self.path.distances().partition_point(|&s| s <= length).max(2).min(self.path.len());
        let rewinds: Vec<[usize; 2]> = self.rewinds.iter().copied().filter(|r| r[1] < count).collect();
        let on = |refine| {
            let (path, axes) = (self.path.piece(0..count), self.axes[..count].to_vec());
            let (marks, rewinds) = (self.marks[..count].to_vec(), rewinds.clone());
            let first = Self { path, axes, marks, rewinds, back_off: BackOff::new(), ..*self };
            let timed = first.timed(model, refine)?;
            Ok([timed.stage.report().cells as f64, timed.total_s()])
        };
        [1, 2, 4].into_iter().map(on).collect()
    }

    /// The spot between its rests, and the stage over its time.
    fn shared(&self, model: &KinematicModel<'_>) -> Result<(SpotMotion, StagePath), Error> {
        let Self { path, axes, rewinds, .. } = self;
        let stops = Rests::Corners.of(path);
        let weights = path.weights();
        let stage_of = |spot: &SpotMotion| {
            let through = || StagePath::through_nodes(spot, axes, rewinds);
            if self.tools == ToolPath::LeastAcceleration {
                return through();
            }
            let evened = |window: f64| {
                let stage = StagePath::evened(spot, axes, rewinds, window);
                let found = deviations(&self.marks, &stage.at_nodes(spot));
                self.limits.hold(worst(&found, &weights)).then_some(stage)
            };
            WINDOWS.into_iter().find_map(evened).unwrap_or_else(through)
        };
        let alone = SpotMotion::new(path, axes, model, &stops, &[], Waits::OnTheWay)?;
        if model.spot.is_none() {
            let stage = stage_of(&alone);
            return Ok((alone, stage));
        }
        // What the stage takes of the scanner's limits is known once it moves; the scanner then is a little slower.
        let shares = stage_of(&alone).shares(path, &alone, model, &stops);
        let spot = SpotMotion::new(path, axes, model, &stops, &shares, Waits::OnTheWay)?;
        let stage = stage_of(&spot);
        Ok((spot, stage))
    }
}

/// The least time of the stage along a path, on a grid `refine` times as fine.
fn least_time(model: &KinematicModel<'_>, path: &StagePath, caps: &[f64], refine: usize) -> Result<Timed, Error> {
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
    made: &'a TimedAxes,
    model: &'a KinematicModel<'a>,
    hint: usize,
    node: usize,
    cell: usize,
    state: State,
}

impl Reader<'_> {
    /// The axes at a time, s.
    pub fn at(&mut self, time: f64) -> Instant {
        self.made.stage.at(time, &mut self.hint, &mut self.state);
        let own = self.state.s;
        let TimedAxes { path, spot, .. } = self.made;
        let node = spot.node_at(own, &mut self.node);
        let way = spot.way_at(own, &mut self.node, &mut self.cell);
        let [from, to] = [spot.way()[node], spot.way()[node + 1]];
        let share = ((way - from) / (to - from)).clamp(0.0, 1.0);
        let [p, q] = [path.nodes[node].at, path.nodes[node + 1].at];
        self.instant(node, std::array::from_fn(|k| p[k] + share * (q[k] - p[k])))
    }

    /// The axes at a time, s, at which the spot is at a node.
    pub(crate) fn at_node(&mut self, node: usize, time: f64) -> Instant {
        self.made.stage.at(time, &mut self.hint, &mut self.state);
        self.instant(node, self.made.path.nodes[node].at)
    }

    fn instant(&self, node: usize, spot: [f64; 3]) -> Instant {
        let [x, y, z, a, c] = std::array::from_fn(|k| self.state.position[k]);
        let axes = Axes { xyz: [x, y, z], a, c };
        let [u, v, _] = axes.field_from_part(self.model.from_pivot(spot));
        Instant { axes, node, field: if self.made.carries { [0.0; 2] } else { [u, v] } }
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
        Reader { made: self, model, hint: 0, node: 0, cell: 0, state: State::default() }
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
        let xyz: Vec<[f64; 3]> = self.axes.iter().map(|a| a.xyz).collect();
        let speed = model.pens.first().map_or(0.0, |pen| pen.speed.as_mm_s());
        AxisFigures {
            strength: self.strength,
            worst: self.worst(),
            rms_acceleration: rms_bend(&xyz, &steps(&self.path.distances())) * speed * speed,
            time_s: self.total_s(),
        }
    }
}

/// The marks of a path, and its jumps, on the height field.
fn marks(path: &Path, height_field: &HeightField) -> Vec<Pose> {
    let poses = path.nodes.iter().map(|&Node { at: p, .. }| Pose { p, n: height_field.at([p[0], p[1]]).normal() });
    poses.collect()
}

fn steps(s: &[f64]) -> Vec<f64> {
    s.windows(2).map(|w| w[1] - w[0]).collect()
}

/// Where the article's back-off search starts, mm, and what each trial is of the one before. Other filters have longer
/// windows for as much smoothing.
const START: f64 = 30.0;
const LONGER: f64 = 10.0;
const FACTOR: f64 = 0.95;
/// Share of the limits that the smoothing does not use up.
const SPARE: f64 = 0.01;

/// The worst deviations: of focus and angle where it is marked, of the field everywhere.
fn worst(found: &[Deviation], weights: &[f64]) -> Deviation {
    found.iter().zip(weights).fold(Deviation::default(), |worst, (&d, &w)| {
        worst.max(if w > 0.0 { d } else { Deviation { lateral: d.lateral, ..Deviation::default() } })
    })
}

/// The plan of a path at even steps of its length.
struct Resampled {
    plan: Vec<[f64; 2]>,
    step: f64,
}

impl Resampled {
    fn of(path: &Path, s: &[f64]) -> Self {
        let total = s.last().copied().unwrap_or_default();
        let count = path.len().max(2);
        let step = total / (count - 1) as f64;
        let mut i = 0;
        let plan = (0..count)
            .map(|k| {
                let at = k as f64 * step;
                while i + 2 < s.len() && s[i + 1] <= at {
                    i += 1;
                }
                let t = ((at - s[i]) / (s[i + 1] - s[i])).clamp(0.0, 1.0);
                [0, 1].map(|c| path.nodes[i].at[c] + t * (path.nodes[i + 1].at[c] - path.nodes[i].at[c]))
            })
            .collect();
        Self { plan, step }
    }

    /// The tool at every node of the path whose plan was smoothed.
    fn tools(&self, smooth: &[[f64; 2]], height_field: &HeightField, s: &[f64]) -> Vec<Pose> {
        let last = smooth.len() - 2;
        let tool = |s: &f64| {
            let at = s / self.step;
            let i = (at as usize).min(last);
            let t = at - i as f64;
            let xy = [0, 1].map(|c| smooth[i][c] + t * (smooth[i + 1][c] - smooth[i][c]));
            let h = height_field.at(xy);
            Pose { p: [xy[0], xy[1], h.z], n: h.normal() }
        };
        let some: Vec<&[f64]> = s.chunks(4096).collect();
        parallel::map(some.len(), |k| some[k].iter().map(tool).collect::<Vec<_>>()).concat()
    }

    /// The article's back-off search, strengths in mm and the worst deviations there; and the largest strength that
    /// holds, by bisection above its last trial, 0 where none does.
    fn smoothing(
        &self,
        family: Family,
        tools: &dyn Fn(f64) -> Vec<Pose>,
        marks: &[Pose],
        weights: &[f64],
        limits: Limits,
    ) -> (BackOff, f64) {
        let attempt = |strength: f64| {
            let found: Vec<Deviation> = marks.iter().zip(&tools(strength)).map(|(m, t)| Deviation::of(m, t)).collect();
            let worst = worst(&found, weights);
            (worst, limits.hold(worst))
        };
        // A little is left for the pace of the stage, which is not quite that of the spot.
        let spared = |strength: f64| {
            let (worst, _) = attempt(strength);
            (worst, limits.scaled(1.0 - SPARE).hold(worst))
        };
        let start = if family == Family::Gaussian { START } else { LONGER * START };
        let trials = back_off(start, FACTOR, self.step / 4.0, attempt);
        let held = trials.last().filter(|r| r.holds).map_or(0.0, |r| r.strength);
        let failed = trials.iter().rev().nth(1).filter(|_| held > 0.0).map(|r| r.strength);
        let finer = failed.and_then(|failed| refine(held, failed, 1e-3 * self.step, spared));
        (trials, finer.map_or(held, |r| r.strength))
    }
}

#[cfg(test)]
mod tests;
