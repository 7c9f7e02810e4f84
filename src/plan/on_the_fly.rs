//! A job that is marked on the fly: the strokes of a plan in their order, decomposed between stage and scanner.
//!
//! Consumes a job, planned as one block of which the order of strokes counts; promises a checked on-the-fly program.
//! Machines whose swivel and turntable state their speeds mark with seven axes, all others with five: the stage
//! follows a moving average, the scanner is the rest.

use crate::diag::{Diag, Error};
use crate::emit;
use crate::geom::mm_from_nm;
use crate::job::Job;
use crate::machine::Machine;
use crate::manifest::{Deviations, OnTheFlySummary};
use crate::on_the_fly::axes::kinematics::machine_from_part;
use crate::on_the_fly::axes::motion::{AXES, Motion};
use crate::on_the_fly::axes::xyzacuv::{KinematicModel, Seven, ToolPath, decompose_and_time};
use crate::on_the_fly::axes::xyzuv::{ScannerLimits, Timed, quickest};
use crate::on_the_fly::check::{self, Checked};
use crate::on_the_fly::decompose::{Family, Limits};
use crate::on_the_fly::path::Path;
use crate::on_the_fly::path::height_field::HeightField;
use crate::on_the_fly::path::schedule::Schedule;
use crate::on_the_fly::program::{Kind, Program};
use crate::on_the_fly::topp::State;

use super::strokes::{self, Strokes};
use super::{Inputs, Progress, Station};

/// Nodes of the path along half of the field.
const NODES: f64 = 100.0;
/// Even samples of the path, where z needs no more.
const SAMPLES: usize = 300_000;
/// What of field and focus is left to the rounding of samples, mm.
const SPARE: f64 = 1e-3;
/// How often a motion is stretched to keep the limits of its axes.
const STRETCHES: usize = 4;

/// An on-the-fly job that was planned and checked, not yet written.
#[derive(Clone, Debug)]
pub struct OnTheFlyPlan {
    /// The job.
    pub job: Job,
    /// Its machine.
    pub machine: Machine,
    /// The program.
    pub checked: Checked,
    /// The figures; its warnings are those of the plan.
    pub summary: OnTheFlySummary,
    /// What the user should know.
    pub warnings: Vec<Diag>,
}

/// Makes an on-the-fly program of a job.
///
/// # Errors
/// Limits of the machine that the motion breaks, after the warnings of the inputs.
pub(super) fn plan(job: Job, inputs: Inputs, progress: Progress<'_>) -> Result<OnTheFlyPlan, Error> {
    let mut warnings = inputs.warnings.clone();
    match planned(&job, &inputs, progress, &mut warnings) {
        Ok((checked, deviations)) => {
            let figures = checked.figures();
            let blend_mm = emit::on_the_fly::blend_us(figures) as f64 * 1e-6 * figures.corner_mm_s / 8.0;
            let summary = OnTheFlySummary::new(&checked, deviations, blend_mm, &warnings);
            Ok(OnTheFlyPlan { job, machine: inputs.machine, checked, summary, warnings })
        }
        Err(e) => Err(e.after(warnings)),
    }
}

fn planned(
    job: &Job,
    inputs: &Inputs,
    progress: Progress<'_>,
    warnings: &mut Vec<Diag>,
) -> Result<(Checked, Deviations), Error> {
    let machine = &inputs.machine;
    progress(Station::Order);
    let Strokes { program: strokes, origin: origin_nm, texture, warnings: found, .. } =
        strokes::in_order(job, machine, inputs, None)?;
    warnings.extend(found);
    let (strokes, surface) = (&strokes, &inputs.surface);
    let half_depth = job.focus.half_depth_mm();
    let Some(height_field) = HeightField::followed(surface, texture, half_depth) else {
        let hint = "compare its area with the part's box";
        return Err(Diag::limit("job-empty", "the texture lies nowhere on the part").hint(hint).into());
    };
    let half_field = machine.usable_field().map(|f| mm_from_nm(f) / 2.0);
    let [width, height] = texture.size().map(mm_from_nm);
    let spacing = half_field[0].min(half_field[1]).min(width.max(height) / 2.0) / NODES;
    let path = Path::of(strokes, 0..strokes.blocks.len(), surface, &height_field, spacing);
    let focus = half_depth - SPARE;
    let origin = origin_nm.mm();
    let (mut motion, kind, deviations) = match KinematicModel::of(machine, &strokes.pens, origin) {
        Some(model) => {
            let allowed = model.scanner_margin()? - SPARE;
            let angle = job.limits.warn_incidence.as_rad();
            let wanted = Limits { focus, angle, field: allowed };
            let found = decompose_and_time(&path, &height_field, &model, wanted, ToolPath::Filtered(Family::Gaussian))?;
            let worst = found.worst();
            let deviations = Deviations { worst_fod_um: worst.focus * 1e3, worst_bia_deg: worst.angle.to_degrees() };
            (turning(&model, &found), Kind::Xyzacuv, deviations)
        }
        None => {
            let allowed = ScannerLimits::of(machine, focus)?;
            let allowed = ScannerLimits { half_field: allowed.half_field.map(|h| h - SPARE), ..allowed };
            let travels = |ends: [[f64; 2]; 3]| {
                machine.axes().iter().zip(ends).zip(origin).all(|(((_, axis), ends), o)| {
                    let [lo, hi] = axis.travel.map(|t| t.as_mm());
                    ends.iter().all(|v| (lo..=hi).contains(&(axis.sign() as f64 * (v + o))))
                })
            };
            let found = quickest(&path, machine, &strokes.pens, allowed, SAMPLES, &travels);
            if !found.sync.fits {
                return Err(too_sharp(job));
            }
            let deviations = upright(&found, &height_field);
            (found.sync.motion(&found.path, &found.schedule), Kind::Xyzuv, deviations)
        }
    };
    let mut program = Program::of(&motion, strokes, machine, origin_nm.0, kind)?;
    // Between its nodes a motion is straight, and bends at them more than the smooth one it stands for.
    for _ in 0..STRETCHES {
        let slow = check::slower(&program, machine);
        if slow <= 1.0 {
            break;
        }
        motion.time.iter_mut().for_each(|t| *t *= 1.001 * slow);
        program = Program::of(&motion, strokes, machine, origin_nm.0, kind)?;
    }
    let asked = Schedule::of(&path, machine, &strokes.pens, 0.0).mark_s;
    let checked = Checked::new(program, machine)?;
    let slow = checked.figures().mark_s / asked;
    if slow > 1.001 {
        warnings.push(slower(job, slow));
    }
    Ok((checked, deviations))
}

fn slower(job: &Job, slower: f64) -> Diag {
    let text = format!("the axes cannot follow: marks run at {:.1} % of the pens' speeds", 100.0 / slower);
    Diag::warning("fly-slow", text)
        .at(job.place())
        .hint("the dose rises as the speed falls; set slower pens, or mark a stepped job")
}

fn too_sharp(job: &Job) -> Error {
    let text = "some marks turn or rise too sharply for the stage to keep them in focus at any speed";
    Diag::limit("fly-focus", text).at(job.place()).hint("widen focus.pdof, or compile a stepped job").into()
}

/// Worst focal offset and angle of upright beams at the nodes of their marks.
fn upright(found: &Timed, height_field: &HeightField) -> Deviations {
    let mut out = Deviations::default();
    let (path, stage) = (&found.path, found.sync.nodes(&found.path, &found.schedule));
    let lit = |i: usize| path.pen[i].is_some() || path.pen.get(i + 1).copied().flatten().is_some();
    for (at, stage) in (0..path.len()).filter(|&i| lit(i)).map(|i| (path.at[i], stage[i])) {
        out.worst_fod_um = out.worst_fod_um.max((at[2] - stage[2]).abs() * 1e3);
        out.worst_bia_deg = out.worst_bia_deg.max(height_field.at([at[0], at[1]]).normal()[2].acos().to_degrees());
    }
    out
}

/// The motion of seven axes at the nodes of the path and the borders of the cells it was timed by; the spot runs
/// straight from node to node.
fn turning(model: &KinematicModel<'_>, found: &Seven) -> Motion {
    let path = &found.path;
    let s = path.distances();
    let mut motion = Motion::default();
    let (mut hint, mut state, mut node) = (0, State::default(), 0);
    for (time, at, _) in found.timed.borders() {
        while node + 2 < s.len() && s[node + 1] <= at {
            node += 1;
        }
        found.timed.at(time, &mut hint, &mut state);
        let length = s[node + 1] - s[node];
        let share = if length > 0.0 { ((at - s[node]) / length).clamp(0.0, 1.0) } else { 1.0 };
        let [p, q] = [path.at[node], path.at[node + 1]];
        let spot = std::array::from_fn(|k| p[k] + share * (q[k] - p[k]));
        let mut axes: [f64; AXES] = std::array::from_fn(|k| state.position[k]);
        let tool =
            crate::on_the_fly::axes::kinematics::Axes { xyz: [axes[0], axes[1], axes[2]], a: axes[3], c: axes[4] };
        let [u, v, _] = tool.field_from_part(model.from_pivot(spot));
        (axes[5], axes[6]) = (u, v);
        // A motion is seen from the part's own origin.
        let shift = machine_from_part(axes[3], axes[4], model.pivot);
        (0..3).for_each(|k| axes[k] += shift[k]);
        // The stretch that ends here is that of the node behind, at the node itself too.
        let behind = if share > 0.0 { node + 1 } else { node };
        motion.time.push(time);
        motion.axes.push(axes);
        motion.pen.push(path.pen[behind]);
        motion.stroke.push(path.stroke[behind]);
    }
    motion
}
