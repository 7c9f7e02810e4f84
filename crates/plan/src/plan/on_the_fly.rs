//! A job that is marked on the fly: the strokes of a plan in their order, divided between stage and scanner.
//!
//! Consumes a job, planned as one block of which the order of strokes counts; promises a checked on-the-fly program,
//! held against the facets of the part, and a list of what of its strokes is left out because the axes cannot keep it
//! in focus. Machines whose swivel and turntable state their speeds mark with seven axes, all others with five: the
//! stage follows a moving average, the scanner is the rest.

use crate::emit::Target;
use std::sync::Arc;
use terrace_core::math;

use crate::budget::{Relief, StatedErrors};
use crate::emit::{self, FlyFile};
use crate::manifest::{self, Deviations, FlyAccuracy, FlyLengths, LaserSwitching, LeftOut, OnTheFlySummary};
use crate::on_the_fly::axes::kinematics::{Deviation, Pose, turned};
use crate::on_the_fly::axes::motion::{Motion, Waypoint};
use crate::on_the_fly::beam_hits::{self, FocusOnPart, Miss, focus_on_part};
use crate::on_the_fly::check::{self, Checked, LineEnergy};
use crate::on_the_fly::decompose::{Family, Limits};
use crate::on_the_fly::kinematic_model::KinematicModel;
use crate::on_the_fly::path::follow::{Follow, Stretch};
use crate::on_the_fly::path::height_field::HeightField;
use crate::on_the_fly::path::schedule::Schedule;
use crate::on_the_fly::path::{Followed, Node, Path};
use crate::on_the_fly::program::{Kind, Program};
use crate::on_the_fly::spot::Rests;
use crate::on_the_fly::turnaround::quickest;
use crate::on_the_fly::xyzacuv::{Instant, TimedAxes, ToolPath, decompose};
use crate::on_the_fly::xyzuv::ScannerLimits;
use crate::ordered_strokes::OrderedStrokes;
use terrace_core::diag::{Diag, Error, Place};
use terrace_core::geom::{BoxMm, NM_PER_MM, Nm, P2, P3Mm, UnitVector, length_mm};
use terrace_core::machine::{Machine, Origin};
use terrace_core::program::{PenId, PieceId};
use terrace_core::progress::Task;
use terrace_core::units::Speed;
use terrace_input::job::Job;
use terrace_input::surface::Surface;
use terrace_input::texture::Texture;

use super::fly_formats;
use super::inputs::Inputs;
use super::plausible;
use super::progress::{Phase, Progress};
use super::strokes::{self, Strokes};

/// Nodes of the path along half of the field.
const NODES: f64 = 100.0;
/// Even samples of the path, where z needs no more.
const SAMPLES: usize = 300_000;
/// What of the field is left to the rounding of samples, mm.
const SPARE: f64 = 1e-3;
/// How far the part may lie from the straight lines between the nodes of a mark, as a share of focus.
const NEAR: f64 = 0.01;
/// How far a mark may lie beside its stroke for that where beams lean, mm; 1 um in all is promised.
const STRAY: f64 = 9e-4;
/// What of focus is left to that and to rounding, as a share: next to a step of 2 [`NEAR`], which is not cut, the part
/// lies up to 3 [`NEAR`] from the line.
const SPARE_FOCUS: f64 = 0.04;
/// Share of focus and incidence that the height field may use up before a mark on it is left out.
const FOLLOWED: f64 = 0.9;
/// How often a motion is stretched to keep the limits of its axes.
const STRETCHES: usize = 8;
/// How many times a plan is rebuilt without marks that were out of focus.
const PLANS: usize = 8;
/// What a program may be beyond focus and incidence for the rounding of its samples, mm and rad.
const ROUNDED: [f64; 2] = [5e-5, 5e-4];
/// A cut at a step takes no more, mm.
const CUT: f64 = 1e-3;
const UNFOCUSED: &str = "widen focus.pdof, or compile a stepped job";

/// An on-the-fly job that was planned and checked, not yet written.
#[derive(Clone, Debug)]
pub struct OnTheFlyPlan {
    /// The job.
    pub job: Job,
    /// The machine of the job.
    pub machine: Machine,
    /// The program.
    pub checked: Checked,
    /// What is not marked next to steps of the part.
    pub left_out: Vec<LeftOut>,
    /// The figures; its warnings are those of the plan.
    pub summary: OnTheFlySummary,
    /// What the user should know.
    pub warnings: Vec<Diag>,
    /// The strokes as they were followed over the part.
    pub texture: Texture,
    /// What it was planned from.
    pub inputs: Arc<Inputs>,
}

/// Makes an on-the-fly program of a job.
///
/// # Errors
/// Limits of the machine that the motion breaks, `fly-focus` where marks cannot be kept in focus, after the warnings of
/// the inputs.
pub(super) fn plan(job: Job, inputs: Inputs, progress: Progress<'_>) -> Result<OnTheFlyPlan, Error> {
    let mut warnings = inputs.warnings.clone();
    match plan_motion(&job, &inputs, progress, &mut warnings) {
        Ok(MotionPlan { checked, deviations, relief, lengths, left_out, texture }) => {
            let figures = checked.figures();
            let blend_mm = emit::on_the_fly::blend_us(figures) as f64 * 1e-6 * figures.corner_mm_s / 8.0;
            let stated = StatedErrors::new(&job, &inputs.machine, inputs.surface.tessellation_mm());
            let budget = stated.on_the_fly(deviations.worst_fod_um, deviations.worst_bia_deg.to_radians(), relief);
            warnings.extend(budget.warning(&job, &inputs.machine));
            warnings.extend(uneven(&figures.energy));
            let accuracy = FlyAccuracy {
                part_mm: inputs.surface.size_mm(),
                deviations,
                blend_mm,
                laser: laser(&job, &inputs.machine, &checked),
                budget,
            };
            let summary =
                OnTheFlySummary::new(&checked, lengths, accuracy, inputs.curves, manifest::warnings(&job, &warnings));
            let machine = inputs.machine.clone();
            let inputs = Arc::new(inputs);
            Ok(OnTheFlyPlan { job, machine, checked, left_out, summary, warnings, texture, inputs })
        }
        Err(e) => Err(plausible::explained(&e, &inputs.texture).after(warnings)),
    }
}

/// How early the laser may be switched in each program that is written of a job.
pub fn laser(job: &Job, machine: &Machine, checked: &Checked) -> Vec<LaserSwitching> {
    let kind = checked.program().kind;
    let files = job.formats.iter().filter_map(|&f| Target::of(f).on_the_fly).filter(|f| f.kinds.contains(&kind));
    let switching = |file: FlyFile| {
        let servo_period_s = machine.controller.servo_s(file.servo_s);
        let laser_error_mm = checked.figures().laser_error_mm(servo_period_s);
        LaserSwitching { file: file.name.into(), servo_period_s, laser_error_mm }
    };
    files.map(switching).collect()
}

/// A checked program, how far its marks lie from the best, and what it does not mark.
struct MotionPlan {
    checked: Checked,
    deviations: Deviations,
    /// The height field under the marks, where rotary axes follow it.
    relief: Option<Relief>,
    lengths: FlyLengths,
    left_out: Vec<LeftOut>,
    texture: Texture,
}

/// Follows the strokes, divides their motion between stage and scanner, and checks the program.
fn plan_motion(
    job: &Job,
    inputs: &Inputs,
    progress: Progress<'_>,
    warnings: &mut Vec<Diag>,
) -> Result<MotionPlan, Error> {
    let machine = &inputs.machine;
    let Strokes {
        ordered: strokes, origin, texture, followed, texture_mm, skipped, shares, warnings: of_strokes, ..
    } = strokes::in_order(job, machine, inputs, None, progress)?;
    warnings.extend(of_strokes);
    warnings.extend(fly_formats::unwritten(job, machine)?);
    if KinematicModel::of(machine, &strokes.pens, origin.mm()).is_none_or(|model| model.spot.is_none()) {
        let why = "which is for seven axes with scanner.acceleration in the machine file";
        let hint = "leave it out: without seven axes the quickest turnaround is chosen for all marks";
        warnings.extend(super::warnings::no_skywriting(job, [why, hint]));
    }
    let [field, motion, _rest] = Phase::Motion.task(progress).split([1, 8, 1]);
    let half_depth = job.focus.half_depth_mm();
    let Some(height_field) = HeightField::followed(&inputs.surface, texture, half_depth) else {
        let hint = "compare its area with the part's box";
        return Err(Diag::limit("job-empty", "the texture lies entirely off the part").hint(hint).into());
    };
    drop(field);
    let max_incidence = job.limits.max_incidence.as_rad();
    let half_field = machine.half_usable_field_mm();
    let [width, height] = texture.size().map(Nm::mm);
    let planner = Planner {
        job,
        machine,
        strokes: &strokes,
        origin,
        surface: &inputs.surface,
        height_field: &height_field.no_steeper_than(math::tan(max_incidence)),
        spacing: half_field[0].min(half_field[1]).min(width.max(height) / 2.0) / NODES,
        half_depth,
        max_incidence,
    };
    let (FollowedProgram { program, followed: marks }, worst) = planner.plan_in_focus(motion)?;
    let mark_s_of_pens = Schedule::of(&marks.path, machine, &strokes.pens, 0.0).mark_s;
    let checked = Checked::new(program, machine, job.power_by_speed)?;
    let times_slower = checked.figures().mark_s / mark_s_of_pens;
    if times_slower > LEAST_SLOWER {
        warnings.push(slower(job, times_slower));
    }
    warnings.extend(shares.warnings(job, checked.figures().time_s, machine));
    let left_out = planner.left_out(&inputs.texture, &marks.left_out);
    let lengths = FlyLengths::new(texture_mm, &skipped, &left_out);
    warnings.extend(planner.skipped(&lengths, &marks.left_out));
    let deviations = Deviations { worst_fod_um: worst.defocus * 1e3, worst_bia_deg: worst.angle.to_degrees() };
    let relief = (checked.program().kind == Kind::Xyzacuv).then(|| planner.relief(&marks.path));
    Ok(MotionPlan { checked, deviations, relief, lengths, left_out, texture: followed })
}

/// The machine with jumps so slow that the scanner keeps its speed while the stage runs against it; no slower than
/// half, where the whole program is slowed instead.
fn slow_jumps(machine: &Machine) -> Machine {
    let mut slow = machine.clone();
    let (x, y) = (&machine.stage.x, &machine.stage.y);
    let jump = machine.scanner.jump_speed.as_mm_s();
    let stage = math::hypot(x.speed.as_mm_s(), y.speed.as_mm_s());
    slow.scanner.jump_speed = Speed::mm_s((jump - stage).max(0.5 * jump));
    slow
}

/// What plans are made of.
struct Planner<'a> {
    job: &'a Job,
    machine: &'a Machine,
    strokes: &'a OrderedStrokes,
    origin: Origin,
    surface: &'a Surface,
    height_field: &'a HeightField,
    /// Distance of the path's nodes, mm.
    spacing: f64,
    /// Half of the depth range, mm.
    half_depth: f64,
    max_incidence: f64,
}

/// A program, and the path over the part that it follows.
struct FollowedProgram {
    program: Program,
    followed: Followed,
}

impl Planner<'_> {
    /// Plans until every mark keeps its focus and incidence on the part.
    fn plan_in_focus(&self, task: Task<'_>) -> Result<(FollowedProgram, FocusOnPart), Error> {
        let limits = beam_hits::Limits {
            half_depth: self.half_depth + ROUNDED[0],
            angle: self.max_incidence + ROUNDED[1],
            beside: STRAY,
        };
        let leans = KinematicModel::of(self.machine, &self.strokes.pens, self.origin.mm()).is_some();
        let near = self.near(leans);
        let mut without = Vec::new();
        let mut last_miss = None;
        let mut rest = task;
        // Invariant: `without` has all stretches that were out of focus in a plan so far.
        for _ in 0..PLANS {
            // How many plans there are is not known: each has most of what is left.
            let [planning, checking, left] = rest.split([3, 1, 1]);
            rest = left;
            let plan = self.plan_without(&without, near, planning)?;
            let around = 2.0 * self.spacing;
            let hits = focus_on_part(&plan.program, self.machine, self.surface, limits, &plan.followed, around)?;
            drop(checking);
            let Some(miss) = hits.first else { return Ok((plan, hits)) };
            without.extend(hits.beyond);
            last_miss = Some(miss);
        }
        Err(last_miss.map_or_else(|| too_sharp(self.job), |miss| self.unfocused(&miss)))
    }

    /// One plan that leaves some stretches out.
    fn plan_without(&self, without: &[Stretch], near: f64, task: Task<'_>) -> Result<FollowedProgram, Error> {
        let Self { strokes, surface, height_field, spacing, .. } = *self;
        let origin = self.origin.mm();
        let machine = slow_jumps(self.machine);
        let model = KinematicModel::of(&machine, &strokes.pens, origin);
        // Seven axes follow the height field: where that leaves the part its marks would be out of focus.
        let most = Limits {
            half_depth: FOLLOWED * self.half_depth,
            angle: FOLLOWED * self.max_incidence,
            field: f64::INFINITY,
        };
        let is_followed = |p: P3Mm, n: UnitVector| {
            let height = height_field.at(p.xy());
            let tool = Pose { p: P3Mm::new([p[0], p[1], height.z]), n: height.normal() };
            model.is_none() || most.hold(Deviation::of(&Pose { p, n }, &tool))
        };
        let [following, timing, _limiting] = task.split([1, 6, 1]);
        let follow = Follow { near, holds: &is_followed, without };
        let all = 0..strokes.strokes.len();
        let followed = Path::following(strokes, all, surface, height_field, spacing, &follow);
        drop(following);
        if followed.marked.is_empty() {
            let text = "the height field that the axes follow leaves the part under all of the texture";
            return Err(Diag::limit("fly-focus", text).hint(UNFOCUSED).into());
        }
        let (motion, kind) = match model {
            Some(model) => (self.motion_of_seven(&followed.path, &model, timing)?, Kind::Xyzacuv),
            None => (self.motion_of_five(&followed.path, &machine, timing)?, Kind::Xyzuv),
        };
        Ok(FollowedProgram { program: self.within_limits(motion, kind)?, followed })
    }

    /// How far the part may lie from the lines between nodes. A beam that leans by l over a slope of s, at an incidence
    /// of i, meets a part that lies lower by h at h cos s sin l / cos i to the side. Next to a step that is not cut, h
    /// is three times as much. Seven axes lean as the height field does somewhere.
    fn near(&self, leans: bool) -> f64 {
        let near = NEAR * self.half_depth;
        if !leans {
            return near;
        }
        let beside = 3.0 * math::sin(self.height_field.steepest_lean()) / math::cos(self.max_incidence);
        if near * beside > STRAY { STRAY / beside } else { near }
    }

    /// The motion of seven axes along a path.
    fn motion_of_seven(&self, path: &Path, model: &KinematicModel<'_>, task: Task<'_>) -> Result<Motion, Error> {
        let [dividing, _timing] = task.split([1, 2]);
        let angle = self.job.limits.warn_incidence.as_rad();
        let wanted =
            Limits { half_depth: (1.0 - SPARE_FOCUS) * self.half_depth, angle, field: model.scanner_margin()? - SPARE };
        let path = &model.with_run_ups(path, &self.job.skywriting);
        let tool_path = ToolPath::Filtered(Family::Gaussian);
        let decomposition = decompose(path, self.height_field, model, wanted, tool_path)?;
        decomposition.within_travel(model)?;
        drop(dividing);
        Ok(motion_of_timed_axes(model, &decomposition.timed(model, 1)?))
    }

    /// The motion of five axes along a path: the stage follows its moving average, the scanner the rest.
    fn motion_of_five(&self, path: &Path, machine: &Machine, task: Task<'_>) -> Result<Motion, Error> {
        let limits = ScannerLimits::of(machine, (1.0 - SPARE_FOCUS) * self.half_depth)?;
        let limits = ScannerLimits { half_field: limits.half_field.map(|h| h - SPARE), ..limits };
        let origin = self.origin.mm();
        let is_within_travel = |ends: BoxMm<3>| is_within_travel(machine, origin, ends);
        let turnaround = quickest(path, machine, &self.strokes.pens, limits, SAMPLES, &is_within_travel, task);
        if !turnaround.sync.fits {
            return Err(too_sharp(self.job));
        }
        Ok(turnaround.sync.motion(&turnaround.path, &turnaround.schedule))
    }

    /// The program of a motion, run as much slower as its axes and marks need.
    fn within_limits(&self, mut motion: Motion, kind: Kind) -> Result<Program, Error> {
        let of_motion = |motion: &Motion| Program::of(motion, self.strokes, self.machine, self.origin, kind);
        let (mut program, mut late) = of_motion(&motion)?;
        // Between its nodes a motion is straight, and bends at them more than the smooth one it stands for.
        for _ in 0..STRETCHES {
            let times_slower = check::slower(&program, self.machine).max(late);
            if times_slower <= 1.0 {
                break;
            }
            motion.waypoints.iter_mut().for_each(|w| w.time *= 1.0 + 1.05 * (times_slower - 1.0) + 1e-6);
            (program, late) = of_motion(&motion)?;
        }
        Ok(program)
    }

    /// Stretches of the program's strokes as those of the texture's.
    fn left_out(&self, texture: &Texture, stretches: &[Stretch]) -> Vec<LeftOut> {
        let mut drawn = Vec::new();
        stretches.iter().map(|stretch| self.left_out_of_texture(texture, stretch, &mut drawn)).collect()
    }

    /// A stretch of a stroke of the program as one of the texture's, whose points go into `drawn`.
    fn left_out_of_texture(&self, texture: &Texture, stretch: &Stretch, drawn: &mut Vec<P2>) -> LeftOut {
        let stroke = &self.strokes.strokes[stretch.stroke.index()];
        texture.stroke(stroke.source.index(), drawn);
        let points = self.points_of(stretch.stroke);
        // The end at which the drawing comes to the stroke, and how far along the drawing that is.
        let begin = if stroke.reversed { points[points.len() - 1] } else { points[0] };
        let segment = stroke.segment as usize;
        let begin_mm = length_mm(&drawn[..=segment]) + drawn[segment].distance(begin) / NM_PER_MM;
        let length = length_mm(points);
        let [from, to] =
            if stroke.reversed { [length - stretch.to, length - stretch.from] } else { [stretch.from, stretch.to] };
        LeftOut { stroke: stroke.source.0, from_mm: begin_mm + from, to_mm: begin_mm + to }
    }

    /// The height field against the part at the nodes of the marks.
    fn relief(&self, path: &Path) -> Relief {
        path.nodes.iter().filter(|node| node.pen.is_some()).fold(Relief::default(), |worst, node| {
            let [x, y, z] = node.at.mm;
            let height = self.height_field.at([x, y]);
            let [dx, dy] = height.slope;
            Relief {
                off_um: worst.off_um.max((z - height.z).abs() * 1e3),
                slope_rad: worst.slope_rad.max(math::atan(math::hypot(dx, dy))),
            }
        })
    }

    /// The points of a stroke on the part.
    fn points_of(&self, stroke: PieceId) -> &[P2] {
        self.strokes.points_of(&self.strokes.strokes[stroke.index()])
    }

    /// What is not marked because the axes cannot keep it in focus.
    fn skipped(&self, lengths: &FlyLengths, stretches: &[Stretch]) -> Option<Diag> {
        let first = stretches.iter().find(|s| s.to - s.from > CUT)?;
        let points = self.points_of(first.stroke);
        let [x_mm, y_mm] = place(points, first.from);
        let text = format!(
            "{:.3} mm of texture is not marked: next to steps of the part the axes cannot keep focus and incidence",
            lengths.skipped_focus_mm
        );
        let place = Place::Part { x_mm, y_mm };
        Some(Diag::warning("fly-skipped", text).at(place).hint("a stepped job marks up to the step"))
    }

    /// A mark that no plan keeps in focus.
    fn unfocused(&self, miss: &Miss) -> Error {
        let ([x_mm, y_mm], hit) = (miss.at, miss.hit);
        let text = format!(
            "a mark would be {:.1} um out of focus ({:.1} um allowed) and {:.1} um off its stroke ({:.1} um allowed), \
             with the beam at {:.1} deg to the surface normal ({:.1} deg allowed)",
            hit.defocus * 1e3,
            self.half_depth * 1e3,
            hit.beside * 1e3,
            STRAY * 1e3,
            hit.angle.to_degrees(),
            self.max_incidence.to_degrees()
        );
        Diag::limit("fly-focus", text).at(Place::Part { x_mm, y_mm }).hint(UNFOCUSED).into()
    }
}

/// Whether the stage reaches all of a box of its places on a part at `origin`, mm.
fn is_within_travel(machine: &Machine, origin: [f64; 3], ends: BoxMm<3>) -> bool {
    let ends = ends.lo.into_iter().zip(ends.hi);
    machine.axes().iter().zip(ends).zip(origin).all(|(((_, axis), (least, most)), o)| {
        let [lo, hi] = axis.travel.map(|t| t.as_mm());
        [least, most].iter().all(|v| (lo..=hi).contains(&(axis.sign() as f64 * (v + o))))
    })
}

/// The point at a length along a polyline, mm.
fn place(points: &[P2], mut along: f64) -> [f64; 2] {
    for w in points.windows(2) {
        let length = w[0].distance(w[1]) / NM_PER_MM;
        if along <= length {
            return w[0].lerp(w[1], (along / length).clamp(0.0, 1.0)).mm();
        }
        along -= length;
    }
    points.last().map_or([0.0; 2], |p| p.mm())
}

/// How many times as long as at the pens' speeds the marks must take for a warning.
const LEAST_SLOWER: f64 = 1.001;

/// Marks that take `times` as long as at the pens' speeds.
fn slower(job: &Job, times: f64) -> Diag {
    let text = format!("the axes cannot follow: marks run at {:.1} % of the pens' speeds", 100.0 / times);
    Diag::warning("fly-slow", text)
        .at(job.place())
        .hint("the dose rises as the speed falls; set slower pens, or mark a stepped job")
}

/// The energy over a spot, as a multiple of the pen's, from which a warning says that marks are uneven.
const UNEVEN: f64 = 2.0;

/// Marks that get much more energy where the spot slows down with the laser on.
fn uneven(energy: &LineEnergy) -> Option<Diag> {
    let LineEnergy { at_speed, slow_s, worst_share, worst_at: [x_mm, y_mm], .. } = *energy;
    (worst_share > UNEVEN).then(|| {
        let text = format!(
            "the spot slows down with the laser on: a line gets up to {worst_share:.1} times the energy of its pen (P / v) \
             over the length of a spot, {:.1} % of the marks run at the speed of their pens, {slow_s:.1} s below half of it",
            100.0 * at_speed
        );
        Diag::warning("fly-energy", text)
            .at(Place::Part { x_mm, y_mm })
            .hint("set a pen speed that the axes reach (energy.svg shows where they do not), or compile a stepped job")
    })
}

fn too_sharp(job: &Job) -> Error {
    let text = "some marks turn or rise too sharply for the stage to keep them in focus at any speed";
    Diag::limit("fly-focus", text).at(job.place()).hint(UNFOCUSED).into()
}

/// Time between waypoints of seven axes, s: longer in programs of more than [`WAYPOINTS`].
const STEP_S: f64 = 2e-3;
const WAYPOINTS: f64 = 1e6;
/// Waypoints between two rests of the spot, at least: it speeds up and slows down between them.
const BETWEEN_RESTS: f64 = 8.0;

/// The motion of seven axes at the nodes of the path and at even steps of time between; the spot runs straight from
/// node to node.
fn motion_of_timed_axes(model: &KinematicModel<'_>, timed: &TimedAxes) -> Motion {
    let path = &timed.path;
    let times = timed.times();
    let longest_s = STEP_S.max(timed.total_s() / WAYPOINTS);
    let mut reader = timed.read(model);
    let mut waypoints = Vec::new();
    let waypoint = |time, instant, pen, stroke| waypoint(model, time, instant, pen, stroke);
    waypoints.push(waypoint(0.0, reader.at_node(0, 0.0), None, path.nodes[0].stroke));
    for rests in Rests::Corners.of(path).windows(2) {
        let [first, last] = [rests[0], rests[1]];
        let step_s = longest_s.min((times[last][0] - times[first][1]) / BETWEEN_RESTS);
        for i in first..last {
            let [arrives, leaves] = times[i];
            let stroke = path.nodes[i].stroke;
            // The spot waits with the laser off, and the stage continues.
            let count = ((leaves - arrives) / longest_s).ceil() as usize;
            for k in 1..=count {
                let time = arrives + (leaves - arrives) * k as f64 / count as f64;
                waypoints.push(waypoint(time, reader.at_node(i, time), None, stroke));
            }
            let (from, to) = (leaves, times[i + 1][0]);
            let Node { pen, stroke, .. } = path.nodes[i + 1];
            let count = ((to - from) / step_s).ceil().max(1.0) as usize;
            for k in 1..count {
                let time = from + (to - from) * k as f64 / count as f64;
                waypoints.push(waypoint(time, reader.at(time), pen, stroke));
            }
            waypoints.push(waypoint(to, reader.at_node(i + 1, to), pen, stroke));
        }
    }
    let end = timed.total_s();
    let last = path.len() - 1;
    if end > times[last][0] {
        waypoints.push(waypoint(end, reader.at_node(last, end), None, path.nodes[last].stroke));
    }
    Motion { waypoints }
}

/// Where all axes are at an instant, from the part's own origin, as a motion is seen.
fn waypoint(
    model: &KinematicModel<'_>,
    time: f64,
    Instant { axes, field: [u, v], .. }: Instant,
    pen: Option<PenId>,
    stroke: PieceId,
) -> Waypoint {
    let [x, y, z] = axes.xyz.moved(turned(axes.a, axes.c, model.pivot).mm).mm;
    Waypoint { time, axes: [x, y, z, axes.a, axes.c, u, v], pen, stroke }
}
