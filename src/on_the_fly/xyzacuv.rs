//! Seven axes on the fly: the stage of X, Y, Z, A and C follows a smoothed path with its normal, the scanner's
//! U and V make up the difference.
//!
//! Consumes the beam's path over the part and the machine's limits; promises axis values at the nodes of the
//! path that keep focus, beam angle and field wherever it can be done, and the least time under the limits of all
//! seven axes. Where the path turns sharply all axes stop: the spot cannot turn otherwise. Units: mm, s, rad.
//!
//! # Source
//! Ma et al. (2025): Gaussian smoothing in arc length, as strong as focal offset, beam angle and displacement
//! allow, searched from 30,000 um down by 0.95; here then by bisection up to the limit.

use crate::diag::Error;
use crate::machine::{Carries, Letter, Machine};
use crate::on_the_fly::axes::following_error::Servo;
use crate::on_the_fly::axes::kinematics::{Axes, Branches, Deviation, Pose, follow};
use crate::on_the_fly::axes::motion::AXES;
use crate::on_the_fly::decompose::{Family, Limits, Trial, back_off, refine, rms_bend, seven_axes, stages};
use crate::on_the_fly::path::c_rewind::rewound;
use crate::on_the_fly::path::height_field::HeightField;
use crate::on_the_fly::path::{Node, NodeKind, Path};
use crate::on_the_fly::topp::{self, Limit, Timed};
use crate::parallel;
use crate::program::Pen;

/// How the tool's path is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ToolPath {
    /// Smoothed as strongly as the limits allow; by the Gaussian in the article.
    Filtered(Family),
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
    /// Stage axes at its nodes, seen from the model's pivot.
    pub axes: Vec<Axes>,
    /// Deviation of each node from its tool.
    pub deviation: Vec<Deviation>,
    /// Their motion: X, Y, Z, A, C, U, V.
    pub timed: Timed,
}

/// A machine of seven axes under a part.
#[derive(Clone, Debug)]
pub struct KinematicModel<'a> {
    /// The machine.
    pub machine: &'a Machine,
    /// The job's pens.
    pub pens: &'a [Pen],
    /// What X, Y, Z, A, C, U and V can do.
    pub limits: [Limit; AXES],
    /// Travel of C as the motion counts it.
    pub c_travel: [f64; 2],
    /// The point of the part about which A and C turn: how far marks lie from it decides how X, Y and Z must go along.
    pub pivot: [f64; 3],
}

impl<'a> KinematicModel<'a> {
    /// Of a part whose origin lies at `origin` in the machine; None where the machine is not one of a swivel A under a
    /// turntable C that states what all its axes can do.
    pub fn of(machine: &'a Machine, pens: &'a [Pen], origin: [f64; 3]) -> Option<Self> {
        let linear = machine.axes().map(|(_, axis)| Limit {
            speed: axis.speed.as_mm_s(),
            acceleration: axis.acceleration.as_mm_s2(),
            jerk: axis.jerk.map(|j| j.as_mm_s3()),
        });
        let table = machine.tilt.as_ref().filter(|table| table.carries == Carries::Part)?;
        if table.axes.each_ref().map(|axis| axis.letter) != [Letter::A, Letter::C] {
            return None;
        }
        let [a, c] = table.axes.each_ref().map(|axis| {
            let (speed, acceleration) = (axis.speed?.as_rad_s(), axis.acceleration?.as_rad_s2());
            Some(Limit { speed, acceleration, jerk: axis.jerk.map(|j| j.as_rad_s3()) })
        });
        let spot = Limit {
            speed: machine.scanner.jump_speed.as_mm_s(),
            acceleration: machine.scanner.acceleration?.as_mm_s2(),
            jerk: machine.scanner.jerk.map(|j| j.as_mm_s3()),
        };
        let [x, y, z] = linear;
        let pivot = [0, 1, 2].map(|k| table.pivot[k].as_mm() - origin[k]);
        // A positive command turns the part right-handed; a positive C of the motion turns it the other way.
        let turntable = &table.axes[1];
        let [lo, hi] = turntable.travel.map(|t| t.as_rad());
        let c_travel = if turntable.reversed { [lo, hi] } else { [-hi, -lo] };
        Some(Self { machine, pens, limits: [x, y, z, a?, c?, spot, spot], c_travel, pivot })
    }

    /// How far the spot may be from the optical axis: the field in any direction, less the following error of X and Y
    /// when both run at top speed, but half of it at least.
    ///
    /// # Errors
    /// As [`Servo::new`].
    pub fn scanner_margin(&self) -> Result<f64, Error> {
        let (reach, [x, y]) = (self.machine.field_reach(), Servo::following_error(self.machine)?);
        Ok(reach - x.hypot(y).min(reach / 2.0))
    }

    /// A point of the part seen from the pivot.
    pub fn from_pivot(&self, p: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|k| p[k] - self.pivot[k])
    }

    fn all(&self, mut poses: Vec<Pose>) -> Vec<Pose> {
        poses.iter_mut().for_each(|pose| pose.p = self.from_pivot(pose.p));
        poses
    }

    fn branches(&self) -> Branches {
        Branches::Quickest { a: self.limits[3].speed, c: self.limits[4].speed }
    }

    /// Axis values at a node of the path: X, Y, Z, A, C, U, V.
    pub fn values(&self, axes: &Axes, p: [f64; 3]) -> [f64; AXES] {
        let [u, v, _] = axes.field_from_part(self.from_pivot(p));
        let [x, y, z] = axes.xyz;
        [x, y, z, axes.a, axes.c, u, v]
    }

    /// The least time of all axes along the nodes of the path that `s` holds, on a grid `refine` times as fine.
    fn time(&self, path: &Path, s: &[f64], axes: &[Axes], refine: usize) -> Result<Timed, Error> {
        let axes = &axes[..s.len()];
        let positions: Vec<f64> = axes.iter().zip(&path.nodes).flat_map(|(a, node)| self.values(a, node.at)).collect();
        let jump = self.machine.scanner.jump_speed.as_mm_s();
        // The beam stands nearly upright on the part: a pen's speed is one along the part, s is seen from the lens.
        let cap = |i: usize| {
            let Some(pen) = path.nodes[i].pen else { return jump };
            let (plan, rise) = (s[i] - s[i - 1], path.nodes[i].at[2] - path.nodes[i - 1].at[2]);
            self.pens[pen.index()].speed.as_mm_s() * plan / plan.hypot(rise)
        };
        let caps: Vec<f64> = (1..s.len()).map(cap).collect();
        let stops: Vec<usize> =
            (0..s.len()).filter(|&i| matches!(path.nodes[i].kind, NodeKind::Corner | NodeKind::End)).collect();
        let path = topp::Path { positions: &positions, s, caps: &caps, stops: &stops };
        topp::time_optimal(&path, &self.limits, &topp::Options { refine, gain: 5e-3, ..topp::Options::default() })
    }
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
    let s = path.distances();
    let marks = marks(path, height_field);
    let filtered = |family: Family| {
        let even = Resampled::of(path, &s);
        let smooth = stages(&even.plan, family);
        let tools = |strength: f64| even.tools(&smooth(strength / even.step), height_field, &s);
        let (trials, strength) = even.smoothing(family, &tools, &marks, &path.weights(), limits);
        (trials, Some(strength), model.all(tools(strength)))
    };
    // Ma et al. (2025): the tool goes along the marks smoothed over their arc length, as strongly as focus, incidence
    // and displacement allow; A and C turn the tool upright (eq. 11 to 13), and the scanner makes up the difference
    // between tool and mark. Without a filter the tool is the mark itself, or the path of least acceleration.
    let filtered = if let ToolPath::Filtered(family) = tools { Some(filtered(family)) } else { None };
    let marks = model.all(marks);
    let axes = match (&filtered, tools) {
        (Some((.., tools)), _) => follow(tools, model.branches()),
        (None, ToolPath::LeastAcceleration) => seven_axes(&marks, &steps(&s), limits),
        (None, _) => follow(&marks, model.branches()),
    };
    // A rewind of C in a jump adds nodes, so distances, marks and deviations are those of the longer path.
    let (path, axes) = rewound(path, &axes, model.c_travel);
    let s = path.distances();
    let marks = model.all(self::marks(&path, height_field));
    let deviation: Vec<Deviation> = marks.iter().zip(&axes).map(|(m, a)| Deviation::of(m, &a.tool())).collect();
    let timed = model.time(&path, &s, &axes, 1)?;
    let (back_off, strength, _) = filtered.unwrap_or_default();
    Ok(TimedAxes { back_off, strength, path, axes, deviation, timed })
}

impl TimedAxes {
    /// Cells and least times, s, of the first `length` mm of the path on grids that are 1, 2 and 4 times as fine.
    ///
    /// # Errors
    /// As [`decompose_and_time`].
    pub fn convergence(&self, model: &KinematicModel<'_>, length: f64) -> Result<Vec<[f64; 2]>, Error> {
        let mut s = self.path.distances();
        s.truncate(s.partition_point(|&s| s <= length).max(2).min(s.len()));
        let on = |refine| {
            let timed = model.time(&self.path, &s, &self.axes, refine)?;
            Ok([timed.report().cells as f64, timed.total_s()])
        };
        [1, 2, 4].into_iter().map(on).collect()
    }
}

/// What a decomposition makes of a path for seven axes, as strong as the limits allow.
#[derive(Clone, Debug)]
pub struct AxisFigures {
    /// Its strength, mm of path; None where there is none to choose.
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

    /// Its figures for the table of decompositions.
    pub fn axis_figures(&self, model: &KinematicModel<'_>) -> AxisFigures {
        let xyz: Vec<[f64; 3]> = self.axes.iter().map(|a| a.xyz).collect();
        let speed = model.pens.first().map_or(0.0, |pen| pen.speed.as_mm_s());
        AxisFigures {
            strength: self.strength,
            worst: self.worst(),
            rms_acceleration: rms_bend(&xyz, &steps(&self.path.distances())) * speed * speed,
            time_s: self.timed.total_s(),
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

/// The worst deviations: of focus and angle where it is marked, of the field everywhere.
fn worst(tools: &[Pose], marks: &[Pose], weights: &[f64]) -> Deviation {
    marks.iter().zip(tools).zip(weights).fold(Deviation::default(), |worst, ((mark, tool), &w)| {
        let d = Deviation::of(mark, tool);
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
            let worst = worst(&tools(strength), marks, weights);
            (worst, limits.hold(worst))
        };
        let start = if family == Family::Gaussian { START } else { LONGER * START };
        let trials = back_off(start, FACTOR, self.step / 4.0, attempt);
        let held = trials.last().filter(|r| r.holds).map_or(0.0, |r| r.strength);
        let failed = trials.iter().rev().nth(1).filter(|_| held > 0.0).map(|r| r.strength);
        let finer = failed.and_then(|failed| refine(held, failed, 1e-3 * self.step, attempt));
        (trials, finer.map_or(held, |r| r.strength))
    }
}
