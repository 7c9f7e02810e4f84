//! The stepped systems: each is compiled as a job is, and its marks are measured where they lie.

use super::{Figures, Ground, Split, marked, path_of, reason, upright};
use crate::compile::{Plan, plan_for};
use crate::fly::spread::Spread;
use crate::geom::mm_from_nm;
use crate::machine::Machine;
use crate::motion;
use crate::program::{Block, Program};
use crate::record::Times;
use crate::spec::{Job, Method};
use crate::units::Length;

/// Planes of focus so far apart that every field has one.
const ONE_PLANE: f64 = 2_000.0;

/// Fields side by side, each focused on the middle of its marks.
pub(super) fn flat(ground: &Ground<'_>) -> Result<Figures, String> {
    let job = ground.job.plain(Method::ZRange, Some(Length::mm(ONE_PLANE)));
    let mut machine = ground.machine.clone();
    // Where one plane has to do, the lens may come as near to the part as it must: the figures tell.
    machine.lens.working_distance = Length::mm(10.0 * ONE_PLANE);
    let plan = plan_for(job, machine, &|_| {}).map_err(|e| reason(&e))?;
    Ok(measured(ground, &plan))
}

/// A job by a method on a machine.
pub(super) fn planned(job: &Job, machine: Machine, method: Method) -> Result<Plan, String> {
    plan_for(job.plain(method, None), machine, &|_| {}).map_err(|e| reason(&e))
}

/// Stepped by a method.
pub(super) fn by(ground: &Ground<'_>, method: Method) -> Result<Figures, String> {
    Ok(measured(ground, &planned(ground.job, ground.machine.clone(), method)?))
}

/// Stepped, fewest levels in each section.
pub(super) fn z_range(ground: &Ground<'_>) -> Result<Figures, String> {
    Ok(measured(ground, ground.z_range()?))
}

/// Levels changed by a zoom optic; the stage moves for a new section, or where the zoom's range ends.
pub(super) fn zoom(ground: &Ground<'_>) -> Result<Figures, String> {
    let machine = ground.machine;
    let (mut zoom, mut notes) = (machine.zoom.clone(), Vec::new());
    if zoom.is_none() {
        zoom = Machine::built_in("xyz-zoom-40").ok().and_then(|m| m.zoom);
        notes.push("zoom optic of xyz-zoom-40 added".into());
    }
    let Some(zoom) = zoom else { return Err("no zoom optic".into()) };
    let plan = ground.z_range()?;
    let mut figures = measured(ground, plan);
    let range = zoom.range.as_nm().unwrap_or(i64::MAX);
    let blocks = &plan.checked.program().blocks;
    let (mut at, mut planes) = (blocks[0].stage, [i64::MAX, i64::MIN]);
    let (mut time, mut focus) = (Split { stage: 0.0, settle: 0.0, ..figures.time }, blocks[0].stop.focus);
    (figures.stops, figures.stage_travel_mm) = (1, 0.0);
    for (i, block) in blocks.iter().enumerate() {
        let stop = &block.stop;
        let reached = [planes[0].min(stop.focus), planes[1].max(stop.focus)];
        let stays = i > 0 && blocks[i - 1].stop.section == stop.section && reached[1] - reached[0] <= range;
        if stays {
            planes = reached;
            let moved = mm_from_nm((stop.focus - focus).abs());
            if moved > 0.0 {
                time.zoom += moved / zoom.speed.as_mm_s() + zoom.settle.as_s();
            }
        } else {
            planes = [stop.focus; 2];
            if i > 0 {
                let lift = block.retract.then(|| machine.retract_z());
                let moved = motion::stage_move(machine, at, block.stage, lift);
                time.stage += moved.travel_s;
                time.settle += moved.settle_s;
                figures.stops += 1;
                figures.stage_travel_mm += way(at, block.stage);
            }
            at = block.stage;
        }
        focus = stop.focus;
    }
    figures.time = time;
    figures.notes.extend(notes);
    Ok(figures)
}

/// The part tilted at every stop.
pub(super) fn tilt(ground: &Ground<'_>) -> Result<Figures, String> {
    let mut machine = ground.machine.clone();
    let mut notes = vec!["focus and incidence by the worst of each block".into()];
    if machine.tilt.is_none() {
        machine.tilt = Machine::built_in("xyz-tilt-galvo-40").ok().and_then(|m| m.tilt);
        notes.push("tilt table of xyz-tilt-galvo-40 added".into());
    }
    let plan = planned(ground.job, machine, Method::Tilt)?;
    let program = plan.checked.program();
    let off = |b: &Block| mm_from_nm((b.z_hi - b.stop.focus).max(b.stop.focus - b.z_lo)) * 1000.0;
    let rows: Vec<[f64; 3]> = program
        .blocks
        .iter()
        .zip(&plan.slopes)
        .map(|(b, slope)| [program.mark_mm(b), off(b), slope.incidence_deg()[1]])
        .collect();
    let reach = program.blocks.iter().flat_map(|b| program.strokes_of(b)).flat_map(|s| program.points_of(s));
    let reach = reach.map(|p| f64::from(p[0]).hypot(f64::from(p[1])) / 1e6);
    let inside =
        |r: &&[f64; 3]| r[1] <= ground.limits.focus * 1000.0 + 1e-3 && r[2] <= ground.limits.angle.to_degrees();
    let all: f64 = rows.iter().map(|r| r[0]).sum();
    Ok(Figures {
        focus_um: Spread::of(rows.iter().map(|r| (r[1], r[0]))),
        incidence_deg: Spread::of(rows.iter().map(|r| (r[2], r[0]))),
        displacement_mm: Spread::of(reach.map(|r| (r, 1.0))),
        within: 100.0 * rows.iter().filter(inside).map(|r| r[0]).sum::<f64>() / all,
        notes,
        ..stepping(ground, &plan)
    })
}

/// Time, stops and ways of a stepped plan.
fn stepping(ground: &Ground<'_>, plan: &Plan) -> Figures {
    let program = plan.checked.program();
    let Times { stage, settle, mark, jump, delay, .. } = plan.summary.time_s;
    Figures {
        time: Split { stage, settle, zoom: 0.0, mark, jump, delay },
        stops: program.blocks.len(),
        seam_mm: plan.summary.seam_mm,
        // Two stops stand off by this much each, and independently.
        stitch_um: ground.machine.stage.accuracy.map(|a| a.as_mm() * 1000.0 * std::f64::consts::SQRT_2),
        stage_travel_mm: program.blocks.windows(2).map(|w| way(w[0].stage, w[1].stage)).sum(),
        speed: 100.0,
        ..Figures::default()
    }
}

/// The figures of a stepped plan whose part lies untilted.
fn measured(ground: &Ground<'_>, plan: &Plan) -> Figures {
    let program = plan.checked.program();
    let owner = owners(program);
    let path = path_of(ground, plan, 0..program.blocks.len());
    let beam = |i: usize| {
        let stop = &program.blocks[owner[path.stroke[i] as usize] as usize].stop;
        let [x, y] = stop.centre.mm();
        [x, y, mm_from_nm(stop.focus)]
    };
    let deviations = upright(ground, &path, beam);
    let Figures { focus_um, incidence_deg, displacement_mm, within, .. } =
        marked(&deviations, &path.weights(), ground.limits);
    Figures { focus_um, incidence_deg, displacement_mm, within, ..stepping(ground, plan) }
}

/// The block of every stroke.
fn owners(program: &Program) -> Vec<u32> {
    let mut out = vec![0; program.strokes.len()];
    for (i, block) in program.blocks.iter().enumerate() {
        out[block.strokes.clone()].fill(i as u32);
    }
    out
}

fn way(a: [i64; 3], b: [i64; 3]) -> f64 {
    (0..3).map(|k| mm_from_nm(b[k] - a[k]).powi(2)).sum::<f64>().sqrt()
}
