//! The stepped systems: each is compiled as a job is, and its marks are measured where they lie.

use super::{Figures, Hardware, KeyCost, Split, Subject, marked, path_of};
use terrace_core::diag::Error;
use terrace_core::geom::{Box2, FieldPoint, NM_PER_MM, Nm, P2, P3, P3Mm, Turn, mm_from_nm};
use terrace_core::machine::{Carries, Commanded, Machine, Origin};
use terrace_core::math;
use terrace_core::program::{Block, Program};
use terrace_core::progress::Task;
use terrace_core::units::Length;
use terrace_input::job::{DepthRule, Focus, Method, Partition};
use terrace_plan::manifest::Times;
use terrace_plan::on_the_fly::axes::kinematics::Deviation;
use terrace_plan::on_the_fly::path::Node;
use terrace_plan::on_the_fly::path::height_field::HeightField;
use terrace_plan::on_the_fly::xyzuv::step_scan_s;
use terrace_plan::ordered_strokes::OrderedStrokes;
use terrace_plan::plan::{Draft, SteppedPlan};

/// Planes of focus so far apart, nm, that every field has one.
const ONE_PLANE: Nm = Nm(2_000_000_000);

/// What a plan reports of its three phases, 0 to 100 percent each.
const PERCENTS: usize = 3 * 101;

/// The figures of fields side by side, each focused on the middle of its marks. The program is not checked: the lens
/// may come as near to the part as it must, the figures say.
pub(super) fn flat(subject: &Subject<'_>, task: Task<'_>) -> Result<Figures, Error> {
    let mut job = subject.job.plain(Method::ZRange);
    // The depth range would let the planes lie anywhere.
    let one_plane = Focus { pdof: ONE_PLANE, reserve: Nm(0), depth: ONE_PLANE, rule: DepthRule::Range, ..job.focus };
    job.focus = Focus { is_kept: true, ..one_plane };
    job.partition = Partition { method: Method::ZRange, ..Partition::default() };
    let task = task.of_steps(PERCENTS);
    let draft = Draft::new(&job, subject.machine, subject.inputs, &|_, _| task.step())?;
    Ok(figures(subject, &SteppedProgram::of_draft(&draft, subject.machine)))
}

/// A job by a method on a machine.
pub(super) fn planned(
    subject: &Subject<'_>,
    machine: &Machine,
    method: Method,
    task: Task<'_>,
) -> Result<SteppedPlan, Error> {
    let task = task.of_steps(PERCENTS);
    let job = subject.job.plain(method);
    let draft = Draft::new(&job, machine, subject.inputs, &|_, _| task.step());
    draft.and_then(|draft| draft.checked(Vec::new()))
}

/// A key of the partition that may cost time.
struct PartitionKey {
    name: &'static str,
    value: fn(&Partition) -> Nm,
    unset: fn(&mut Partition),
}

/// The keys of the partition that may cost time.
const COSTLY_KEYS: [PartitionKey; 4] = [
    PartitionKey { name: "partition.section", value: |p| p.section.unwrap_or_default(), unset: |p| p.section = None },
    PartitionKey { name: "partition.overlap", value: |p| p.overlap, unset: |p| p.overlap = Nm(0) },
    PartitionKey { name: "partition.zone", value: |p| p.zone, unset: |p| p.zone = Nm(0) },
    PartitionKey { name: "partition.keep_whole", value: |p| p.keep_whole, unset: |p| p.keep_whole = Nm(0) },
];

/// The job by a method without one of the keys of its partition that may cost time, and the time of each such job.
pub(super) fn key_costs(subject: &Subject<'_>, method: Method, system: &'static str, task: Task<'_>) -> Vec<KeyCost> {
    let stated: Vec<&PartitionKey> =
        COSTLY_KEYS.iter().filter(|key| (key.value)(&subject.job.partition) > Nm(0)).collect();
    let tasks = task.parts(stated.len().max(1));
    stated.into_iter().zip(tasks).filter_map(|(key, task)| key_cost(subject, method, system, key, task)).collect()
}

/// The time of the job by a method without one of its keys; None where it would be no job without it.
fn key_cost(
    subject: &Subject<'_>,
    method: Method,
    system: &'static str,
    key: &PartitionKey,
    task: Task<'_>,
) -> Option<KeyCost> {
    let mut job = subject.job.plain(method);
    (key.unset)(&mut job.partition);
    let task = task.of_steps(PERCENTS);
    let draft = Draft::new(&job, subject.machine, subject.inputs, &|_, _| task.step()).ok()?;
    let time_s = draft.times().total + subject.load_s * draft.program().blocks.len() as f64;
    // Beyond the limits of the machine it would be no job.
    draft.checked(Vec::new()).ok()?;
    let value = Length::mm((key.value)(&subject.job.partition).mm()).to_string();
    Some(KeyCost { system, key: key.name, value, time_s })
}

/// A stepped program with what its figures are found from.
struct SteppedProgram<'a> {
    program: &'a Program,
    machine: &'a Machine,
    /// Position of the part's origin in the table frame, nm.
    origin: Origin,
    texture: Box2,
    times: Times,
    seam_mm: f64,
    /// Marked length in the plane of the drawing, every pass of the pens counted.
    mark_mm: f64,
    /// How much of it is marked twice, where blocks overlap.
    overlap_mm: f64,
}

impl<'a> SteppedProgram<'a> {
    fn of_draft(draft: &'a Draft<'a>, machine: &'a Machine) -> Self {
        let passes = draft.passes();
        let program = draft.program();
        Self {
            program,
            machine,
            origin: draft.origin(),
            texture: passes[0].texture,
            times: draft.times(),
            seam_mm: passes.iter().map(|p| p.map.seam_mm()).sum(),
            mark_mm: program.blocks.iter().map(|block| program.mark_mm(block)).sum(),
            overlap_mm: 0.0,
        }
    }

    fn of(plan: &'a SteppedPlan) -> Self {
        Self {
            program: plan.checked.program(),
            machine: &plan.machine,
            origin: plan.checked.origin(),
            texture: plan.passes[0].texture,
            times: plan.summary.time_s,
            seam_mm: plan.summary.seam_mm,
            mark_mm: plan.summary.mark_mm,
            overlap_mm: plan.summary.overlap_mm,
        }
    }
}

/// What the job file says for a method to be used; None where the job's machine has a zoom optic, without which no job
/// is made for it.
fn without_zoom(subject: &Subject<'_>, method: Method) -> Option<String> {
    subject.inputs.machine.zoom.is_none().then(|| method_key(method))
}

fn method_key(method: Method) -> String {
    format!("partition.method = \"{}\"", method.name())
}

/// The figures of the job stepped by a method.
pub(super) fn measure_method(subject: &Subject<'_>, method: Method, task: Task<'_>) -> Result<Figures, Error> {
    let plan = planned(subject, subject.machine, method, task)?;
    let job_key = without_zoom(subject, method);
    Ok(Figures { job_key, ..figures(subject, &SteppedProgram::of(&plan)) })
}

/// The figures of the job stepped with the fewest levels in each section.
pub(super) fn z_range(subject: &Subject<'_>, task: Task<'_>) -> Result<Figures, Error> {
    let plan = subject.z_range(task)?;
    let job_key = without_zoom(subject, Method::ZRange);
    Ok(Figures { job_key, ..figures(subject, &SteppedProgram::of(plan)) })
}

/// Levels changed by a zoom optic; the stage moves for a new section, or where the optic's range ends.
pub(super) fn zoom(subject: &Subject<'_>, task: Task<'_>) -> Result<Figures, Error> {
    const LENDER: &str = "xyz-zoom-40";
    let mut machine = subject.inputs.machine.clone();
    let hardware = if machine.zoom.is_some() { Hardware::Own } else { Hardware::WithZoom(LENDER) };
    if machine.zoom.is_none() {
        machine.zoom = Machine::built_in(LENDER)?.zoom;
    }
    let plan = planned(subject, &machine, Method::ZRange, task)?;
    let job_key = Some(method_key(Method::ZRange));
    Ok(Figures { hardware, job_key, ..figures(subject, &SteppedProgram::of(&plan)) })
}

/// The part tilted at every stop.
pub(super) fn tilt(subject: &Subject<'_>, task: Task<'_>) -> Result<Figures, Error> {
    tilting(subject, Carries::Part, "xyz-tilt-galvo-40", task)
}

/// The head tilted at every stop.
pub(super) fn head_tilt(subject: &Subject<'_>, task: Task<'_>) -> Result<Figures, Error> {
    let mut figures = tilting(subject, Carries::Head, "xyz-headtilt-galvo-40", task)?;
    figures.notes.push("rob-scan: the head tilts, the part stays".into());
    Ok(figures)
}

/// The figures of the job stepped with tilt axes that carry the part or the head, those of a built-in machine where
/// the job's own has none such.
fn tilting(subject: &Subject<'_>, carries: Carries, lender: &'static str, task: Task<'_>) -> Result<Figures, Error> {
    let mut machine = subject.machine.clone();
    let is_own = machine.tilt.as_ref().is_some_and(|tilt| tilt.carries == carries);
    let hardware = if is_own { Hardware::Own } else { Hardware::WithTilt(lender) };
    if !is_own {
        machine.tilt = Machine::built_in(lender)?.tilt;
    }
    let plan = planned(subject, &machine, Method::Tilt, task)?;
    let job_key = without_zoom(subject, Method::Tilt);
    Ok(Figures { hardware, job_key, ..figures(subject, &SteppedProgram::of(&plan)) })
}

/// The figures of marks with time, stops and ways of a stepped plan.
fn with_times(marks: Figures, subject: &Subject<'_>, plan: &SteppedProgram<'_>) -> Figures {
    let program = plan.program;
    let Times { stage, settle, zoom, mark, jump, delay, .. } = plan.times;
    let stops = program.stops();
    Figures {
        time: Split { stage, settle, zoom, mark, jump, delay },
        model_s: Some(step_scan_s(stops, subject.move_s, zoom + mark + jump + delay)),
        load_s: Some(subject.load_s * program.blocks.len() as f64),
        stops,
        marked_mm: plan.mark_mm,
        seam_mm: plan.seam_mm,
        // Two stops stand off by this much each, and independently.
        stitch_um: subject.machine.stage.accuracy.map(|a| a.as_mm() * 1000.0 * std::f64::consts::SQRT_2),
        stage_travel_mm: program.blocks.windows(2).map(|w| way(w[0].stage, w[1].stage)).sum(),
        speed: 100.0,
        ..marks
    }
}

/// The figures of a stepped plan, by the nodes of its marks on the part.
fn figures(subject: &Subject<'_>, plan: &SteppedProgram<'_>) -> Figures {
    let program = plan.program;
    let turns: Vec<Turn> = program.blocks.iter().map(|b| plan.machine.turn(b.stop.tilt, plan.origin)).collect();
    let ordered = if turns.iter().any(|turn| turn.lean() > 0.0) {
        seen_from_above(program, &turns, &subject.height_field, plan.texture)
    } else {
        OrderedStrokes::of_program(program)
    };
    let owner = owners(program);
    let path = path_of(subject, &ordered, 0..ordered.strokes.len());
    let deviation_of_node = |node: &Node| {
        let block = owner[node.stroke.index()] as usize;
        deviation(node.at, &program.blocks[block], &turns[block], &subject.height_field)
    };
    let deviations: Vec<Deviation> = path.nodes.iter().map(deviation_of_node).collect();
    let weights = path.weights_of_passes(&program.pens);
    let mut figures = with_times(marked(&deviations, &weights, subject.limits), subject, plan);
    if plan.overlap_mm > 0.0 {
        figures.notes.push(format!("{:.1} mm marked twice where blocks overlap", plan.overlap_mm));
    }
    figures
}

/// How far a place of a mark, mm, part frame, is from the ideal beam at the stop of its block.
fn deviation(place: P3Mm, block: &Block, turn: &Turn, height_field: &HeightField) -> Deviation {
    let stop = &block.stop;
    let p = turn.apply(P3::new(place.mm.map(|v| v * NM_PER_MM))).at.map(|v| v / NM_PER_MM);
    let centre = stop.centre.mm();
    // On a slope a place that is some nanometres off lies at another height: no mark lies beyond its block's depth.
    let height = p[2].clamp(block.z_lo.mm(), block.z_hi.mm());
    Deviation {
        defocus: (height - stop.lpfl.mm()).abs(),
        angle: math::atan(turn.slope2(height_field.at(place.xy()).normal().0).sqrt()),
        lateral: math::hypot(p[0] - centre[0], p[1] - centre[1]),
    }
}

/// The strokes of all blocks where they lie on the untilted part, seen along z; points in the box of the texture.
fn seen_from_above(program: &Program, turns: &[Turn], height_field: &HeightField, texture: Box2) -> OrderedStrokes {
    OrderedStrokes::placed(program, |i, point| {
        let [x, y] = place_on_part(point, &program.blocks[i], &turns[i], height_field).xy();
        // Rounding must put nothing beyond an edge of the part.
        let [x, y] = [x, y].map(|v| (v * NM_PER_MM).round() as i64);
        P2::new(x.clamp(texture.lo.x, texture.hi.x), y.clamp(texture.lo.y, texture.hi.y))
    })
}

/// Where the beam through a point of the focal plane meets the part, at no other height than the block's marks, mm.
fn place_on_part(point: FieldPoint, block: &Block, turn: &Turn, height_field: &HeightField) -> P3Mm {
    let (centre, lpfl, up) = (block.stop.centre, block.stop.lpfl, turn.up());
    let [lo, hi] = [block.z_lo, block.z_hi].map(|z| (z - lpfl).mm());
    let point = [centre.x + i64::from(point.x), centre.y + i64::from(point.y), lpfl.0];
    let from = turn.back(P3::new(point.map(|v| v as f64))).at.map(|v| v / NM_PER_MM);
    let (mut way, mut p) = (0.0f64, from);
    // Newton's steps along the beam: it closes in on the height field by its direction against the slope.
    for _ in 0..4 {
        let h = height_field.at([p[0], p[1]]);
        let closing = up[2] - h.slope[0] * up[0] - h.slope[1] * up[1];
        way = (way + (h.z - p[2]) / closing).clamp(lo, hi);
        p = [0, 1, 2].map(|k| from[k] + way * up[k]);
    }
    P3Mm::new(p)
}

/// The block of every stroke.
fn owners(program: &Program) -> Vec<u32> {
    let mut out = vec![0; program.strokes.len()];
    for (i, block) in program.blocks.iter().enumerate() {
        out[block.strokes.clone()].fill(i as u32);
    }
    out
}

/// Way of the stage from one position to another, mm.
fn way(a: Commanded, b: Commanded) -> f64 {
    (0..3).map(|k| mm_from_nm(b[k] - a[k]).powi(2)).sum::<f64>().sqrt()
}
