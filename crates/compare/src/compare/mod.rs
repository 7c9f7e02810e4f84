//! Estimates of the same job on every system, side by side: stepping in all its variants, zoom optics, tilting, scanner
//! and stage synchronised, five and seven axes on the fly; and, for reference, turning the surface with a tool servo.
//!
//! Consumes a job; promises for every system its time split in parts, its stops, how far marks lie out of focus and out
//! of the beam's angle, and which share of them keeps the job's limits. Stepped systems are compiled as jobs are; the
//! others are decomposed and timed by [`terrace_plan::on_the_fly`]. Where the job's machine lacks hardware that a
//! system needs, it is taken from a built-in profile, and [`Hardware`] says so. [`Verdict`] says which system to use.
//!
//! The limits are the job's for all: focal offset up to half the depth range, beam angle up to
//! `limits.warn_incidence`, the machine's field. Units: mm, s, deg, um as names say.

mod axis_errors;
mod charts;
mod filters;
mod follow;
mod following_errors;
mod heat;
mod report;
mod stepped;
mod system;
mod tool_servo;
mod verdict;

pub use axis_errors::AxisErrors;
pub use filters::Filter;
use follow::Follower;
pub use report::{overview, page, plots, tables};
use system::Run;
pub use system::{SYSTEMS, System};
use terrace_core::math;
pub use tool_servo::{Need, ToolFigures};
pub use verdict::{Standing, Verdict};

use std::ops::Range;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use crate::nurbs;
use terrace_core::diag::{Diag, Error};
use terrace_core::geom::Nm;
use terrace_core::machine::{Commanded, Cost, Machine};
use terrace_core::motion::{GalvoModel, stage_move};
use terrace_core::progress::Task;
use terrace_input::job::{Job, Method};
use terrace_plan::manifest::Loading;
use terrace_plan::on_the_fly::axes::following_error::Protection;
use terrace_plan::on_the_fly::axes::kinematics::Deviation;
use terrace_plan::on_the_fly::decompose::Limits;
use terrace_plan::on_the_fly::path::Path;
use terrace_plan::on_the_fly::path::height_field::HeightField;
use terrace_plan::on_the_fly::path::schedule::Schedule;
use terrace_plan::on_the_fly::spot::Rests;
use terrace_plan::on_the_fly::statistics::Statistics;
use terrace_plan::on_the_fly::xyzacuv::{AxisFigures, BackOff};
use terrace_plan::ordered_strokes::OrderedStrokes;
use terrace_plan::plan::strokes;
use terrace_plan::plan::{Inputs, SteppedPlan};

/// Parts of a job's time, s.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Split {
    /// Stage moves without marking.
    pub stage: f64,
    /// Settling after them.
    pub settle: f64,
    /// Moves of a zoom optic and their settling.
    pub zoom: f64,
    /// Beam on.
    pub mark: f64,
    /// Jumps.
    pub jump: f64,
    /// Scanner and laser delays.
    pub delay: f64,
}

impl Split {
    /// The times of a motion that runs `slower` than its schedule.
    fn of(schedule: &Schedule, slower: f64) -> Self {
        let [mark, jump, delay] = [schedule.mark_s, schedule.jump_s, schedule.delay_s].map(|t| t * slower);
        Self { mark, jump, delay, ..Self::default() }
    }

    /// The parts with their names.
    pub fn parts(&self) -> [(&'static str, f64); 6] {
        let Self { stage, settle, zoom, mark, jump, delay } = *self;
        [("stage", stage), ("settle", settle), ("zoom", zoom), ("mark", mark), ("jump", jump), ("delay", delay)]
    }

    /// The sum of the parts.
    pub fn total(&self) -> f64 {
        self.parts().iter().map(|p| p.1).sum()
    }
}

/// What a system runs on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Hardware {
    /// The job's machine.
    #[default]
    Own,
    /// The job's machine with the zoom optic of a built-in one.
    WithZoom(&'static str),
    /// The job's machine on the tilt table of a built-in one.
    WithTilt(&'static str),
    /// The job's machine with a controller that moves scanner and stage together.
    Synchronised,
    /// A built-in machine.
    Other(&'static str),
}

impl Hardware {
    /// The machine in a table; `own` is the name of the job's.
    pub fn label(self, own: &str) -> String {
        match self {
            Self::Own => own.to_owned(),
            Self::WithZoom(lender) => format!("with zoom of {lender}"),
            Self::WithTilt(lender) => format!("+ tilt of {lender}"),
            Self::Synchronised => "+ synchronised control".to_owned(),
            Self::Other(machine) => machine.to_owned(),
        }
    }
}

/// A limit that some marks, or the whole motion, do not keep.
#[derive(Clone, Debug, PartialEq)]
pub enum Beyond {
    /// Out of focus: worst and allowed, um.
    Focus([f64; 2]),
    /// Beam incidence: worst and allowed, deg.
    Incidence([f64; 2]),
    /// Distance of the spot from the optical axis: worst and allowed, mm.
    Displacement([f64; 2]),
    /// No motion of z keeps all marks in focus.
    TooSharp,
    /// What the drive of a tool servo does not make: which figure, its unit, what is needed and what there is.
    Drive(&'static str, &'static str, [f64; 2]),
    /// Axes that need more travel than they have, and how much.
    Travel(String),
}

/// How long the seven axes take, by where the spot rests and how the stage goes along.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RestTimes {
    /// Where the spot rests.
    pub rests: Rests,
    /// Whether the stage keeps in step with the spot, as the article's does; by a model that knows no jerk of the
    /// stage.
    pub in_step: bool,
    /// Whole time, s; None where the model finds none.
    pub total_s: Option<f64>,
    /// What the scanner alone would take, s.
    pub scanner_s: f64,
}

/// Figures of one system.
#[derive(Clone, Debug, Default)]
pub struct Figures {
    /// Time in its parts.
    pub time: Split,
    /// What a simple model says, s: eq. 8 of Cui et al. for what steps and eq. 9 for what is synchronised, every move
    /// as long as that of a field; for turning axes a stop at every node of the path.
    pub model_s: Option<f64>,
    /// Time that loading all blocks takes, s; None for systems that load none.
    pub load_s: Option<f64>,
    /// Standstills of the stage between marks.
    pub stops: usize,
    /// Focal offset, um.
    pub focus_um: Statistics,
    /// Beam incidence, deg.
    pub incidence_deg: Statistics,
    /// Distance of the spot from the optical axis, mm.
    pub displacement_mm: Statistics,
    /// How far the stage lags behind its command while it marks, um; None where it is at rest.
    pub stage_lag_um: Option<Statistics>,
    /// How far the spot is off its place after the scanner has taken up the stage's lag, um.
    pub spot_error_um: Option<Statistics>,
    /// How far the stage is out of focus because it lags behind its command, um.
    pub focus_lag_um: Option<Statistics>,
    /// Following errors of every axis of a machine of five or seven.
    pub axis_errors: Option<AxisErrors>,
    /// Length of the marks, seen along z, every pass of the pens counted, mm.
    pub marked_mm: f64,
    /// Share of the marked length within all limits, percent.
    pub within: f64,
    /// Length of seams.
    pub seam_mm: f64,
    /// Error of stitching at seams, um, where the machine states the positioning accuracy of its stage.
    pub stitch_um: Option<f64>,
    /// Way of the stage, X, Y and Z together.
    pub stage_travel_mm: f64,
    /// Mark speed as a share of the pen's, percent.
    pub speed: f64,
    /// What it runs on.
    pub hardware: Hardware,
    /// The key of the job file with which `compile` makes it on that; None where it is an estimate alone.
    pub job_key: Option<String>,
    /// The limits that it does not keep: empty where it keeps all of them with all marks.
    pub beyond: Vec<Beyond>,
    /// Whether the system runs slower than the pens do, and z is the axis that cannot go faster.
    pub is_held_by_z: bool,
    /// What a tool servo must do; of all other systems None.
    pub tool: Option<ToolFigures>,
    /// What the figures take for granted or leave out.
    pub notes: Vec<String>,
}

impl Figures {
    /// Time of the machine and of loading the blocks, one after the other, s: a person attends all of it.
    pub(crate) fn counted_s(&self) -> f64 {
        self.time.total() + self.load_s.unwrap_or(0.0)
    }
}

/// One row of the comparison.
#[derive(Clone, Debug)]
pub struct Row {
    /// The name of the system.
    pub system: &'static str,
    /// The figures of the system, or why it does not apply.
    pub figures: Result<Figures, Error>,
}

/// What is drawn and reported in addition to the table.
#[derive(Clone, Debug, Default)]
pub struct Curves {
    /// Decompositions of the same path for scanner and stage; empty where no such system was asked for.
    pub filters: Vec<Filter>,
    /// Decompositions for seven axes of the path's first 20 m, with their names; as above.
    pub shared: Vec<(&'static str, AxisFigures)>,
    /// Times of the seven axes with other rests of the spot, the row's own first.
    pub rests: Vec<RestTimes>,
    /// Trials of the seven-axis back-off search.
    pub back_off: BackOff,
    /// Time and axis values of the first nodes of the seven-axis path.
    pub axes: Vec<(f64, [f64; 7])>,
    /// Along that path: way in mm, focal offset in um, beam angle in deg, displacement in mm.
    pub along: Vec<[f64; 4]>,
    /// Limits of the seven axes, whose machine may be another.
    pub seven: Option<Limits>,
    /// Cells and least time, s, of the first 20 m of the seven-axis path on finer and finer grids.
    pub convergence: Vec<[f64; 2]>,
    /// Nodes of the seven-axis path that are drawn, seen from the pivot of A and C: the mark, the point of the tool on
    /// the smoothed path, and the tool's axis.
    pub space: Vec<[[f64; 3]; 3]>,
    /// Beam and stage as seen from the lens, synchronised.
    pub paths: Vec<(&'static str, Vec<[f64; 2]>)>,
    /// Of the same: time, s, and velocities of stage X, Y, Z and scanner U, V, mm/s.
    pub velocities: Vec<(f64, [f64; 5])>,
}

impl Curves {
    /// Takes what another system has to show.
    fn add(&mut self, other: Self) {
        if other.seven.is_some() {
            let Self { filters, paths, velocities, .. } = std::mem::take(self);
            *self = Self { filters, paths, velocities, ..other };
        } else if !other.paths.is_empty() {
            (self.filters, self.paths, self.velocities) = (other.filters, other.paths, other.velocities);
        }
    }
}

/// A key of the job that a stepped system goes by, and what it would take without it.
#[derive(Clone, Debug, PartialEq)]
pub struct KeyCost {
    /// The system.
    pub system: &'static str,
    /// The key.
    pub key: &'static str,
    /// The value of the key.
    pub value: String,
    /// Time without it, loading included, s.
    pub time_s: f64,
}

/// A whole comparison.
#[derive(Debug)]
pub struct Comparison {
    /// The job's name.
    pub job: String,
    /// The name of the job's machine.
    pub machine: String,
    /// The limits of all systems.
    pub limits: Limits,
    /// Length of what may be marked of the texture, every pass of the pens counted, mm.
    pub marked_mm: f64,
    /// How often the job goes over the whole texture; compared is one time.
    pub passes: u32,
    /// Who loads the blocks of stepped systems, and in which time each.
    pub loading: Loading,
    /// How the spot moves, in every system: as the file of the job's machine has it, whatever a system runs on.
    pub galvo: GalvoModel,
    /// What an hour of the job's machine costs, where its file says so.
    pub cost: Option<Cost>,
    /// What single keys of the job cost the fastest of the stepped systems that `compile` makes on the machine.
    pub key_costs: Vec<KeyCost>,
    /// Systems in the order asked for.
    pub rows: Vec<Row>,
    /// For pictures and more tables.
    pub curves: Curves,
    /// What the user should know.
    pub warnings: Vec<Diag>,
}

impl Comparison {
    /// What a system costs, where the machine file states rates and the system runs on that machine, whatever is added
    /// to it.
    pub(crate) fn cost_of(&self, figures: &Figures) -> Option<f64> {
        let cost = self.cost.filter(|_| !matches!(figures.hardware, Hardware::Other(_)))?;
        Some(cost.of(figures.counted_s()))
    }
}

/// What all systems share.
struct Subject<'a> {
    job: &'a Job,
    /// The job's machine without its zoom optic, which one system alone uses.
    machine: &'a Machine,
    inputs: &'a Arc<Inputs>,
    height_field: HeightField,
    limits: Limits,
    /// Size of the texture's box, mm.
    size: [f64; 2],
    /// How the spot moves, in every system.
    galvo: GalvoModel,
    /// Time for one block, s, as far as it is known.
    load_s: f64,
    /// Of the scanner, while it compensates the following error of the stage.
    protection: Protection,
    /// Time of a stage move by the width of the field, s.
    move_s: f64,
    /// The exact surface, where it is given.
    exact: Option<&'a nurbs::Surface>,
    /// The job by the method that most systems go by, planned once.
    z_range: OnceLock<Result<SteppedPlan, Error>>,
}

impl Subject<'_> {
    fn z_range(&self, task: Task<'_>) -> Result<&SteppedPlan, Error> {
        let plan = || stepped::planned(self, self.machine, Method::ZRange, task);
        self.z_range.get_or_init(plan).as_ref().map_err(Clone::clone)
    }
}

/// To whom the progress of a comparison is reported.
#[derive(Clone, Copy)]
pub struct Progress<'a> {
    /// Told of every system as it begins; several run at the same time.
    pub begins: &'a (dyn Fn(&'static str) + Sync),
    /// Told of the whole percent that is done of all systems together, from 0 to 100.
    pub percent: &'a (dyn Fn(u8) + Sync),
}

/// How far apart nodes of a path may lie: this part of the field, or of the texture where that is smaller.
const NODES: f64 = 40.0;

/// Compares the systems; `exact` is the surface of the part, which a tool servo needs.
///
/// # Errors
/// Those of the job itself; a system that cannot do it says so in its row.
pub fn compare(
    job: &Job,
    systems: &[&'static System],
    protection: Protection,
    exact: Option<&nurbs::Surface>,
    progress: Progress<'_>,
) -> Result<Comparison, Error> {
    let [reading, ordering, measuring, replanning] = Task::new(progress.percent).split([2, 1, 16, 1]);
    (progress.begins)("reading surface and texture");
    let mut inputs = Inputs::load_with_progress(job, reading)?;
    let loading = Loading::new(job, &inputs.machine, 0, 0.0);
    // The job is planned without its formats, from which the way follows where nobody states it.
    inputs.machine.operator.way = Some(loading.way);
    let inputs = Arc::new(inputs);
    let machine = &Machine { zoom: None, ..inputs.machine.clone() };
    let whole =
        strokes::in_order(job, machine, &inputs, None, &|_, _| {}).map_err(|e| e.after(inputs.warnings.clone()))?;
    let whole = whole.repeated();
    let limits = mark_limits(job, machine);
    let height_field = HeightField::followed(&inputs.surface, whole.texture, limits.half_depth).ok_or_else(|| {
        Diag::limit("compare-surface", "the texture lies entirely off the part")
            .hint("compare its area with the part's box")
    })?;
    let subject = Subject {
        job,
        machine,
        inputs: &inputs,
        height_field,
        limits,
        size: whole.texture.size().map(Nm::mm),
        galvo: GalvoModel::of(machine),
        load_s: loading.load_s,
        protection,
        move_s: move_across_field_s(machine),
        exact,
        z_range: OnceLock::new(),
    };
    let follower = Follower::new(&subject, &whole);
    drop(ordering);
    let marked_mm = follower.mark_mm();
    let mut rows = Vec::new();
    let mut curves = Curves::default();
    for (&system, result) in systems.iter().zip(run(systems, &subject, &follower, progress, measuring)) {
        curves.add(result.curves);
        rows.push(row(system, result.figures, marked_mm));
    }
    let key_costs = key_costs(&subject, &rows, replanning);
    let job_name = job.path.file_stem().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
    let warnings = [inputs.warnings.as_slice(), &whole.warnings].concat();
    Ok(Comparison {
        job: job_name,
        machine: machine.name.clone(),
        limits,
        marked_mm,
        passes: job.passes.count,
        loading,
        key_costs,
        galvo: subject.galvo,
        cost: machine.cost,
        rows,
        curves,
        warnings,
    })
}

/// What all marks should keep.
fn mark_limits(job: &Job, machine: &Machine) -> Limits {
    let half = machine.half_usable_field_mm();
    Limits {
        half_depth: job.focus.half_depth_mm(),
        angle: job.limits.warn_incidence.as_rad(),
        // The corners of the field are the scanner's too.
        field: math::hypot(half[0], half[1]),
    }
}

/// Time of a move of the stage over the width of the field, settling included, s.
fn move_across_field_s(machine: &Machine) -> f64 {
    let across = stage_move(machine, Commanded::default(), Commanded([machine.usable_field()[0].0, 0, 0]), None);
    across.travel_s + across.settle_s
}

/// The row of a system; its notes say where it marks less than the `marked_mm` that may be marked.
fn row(system: &System, mut figures: Result<Figures, Error>, marked_mm: f64) -> Row {
    if let Ok(figures) = &mut figures {
        let own_mm = figures.tool.is_none().then_some(figures.marked_mm);
        figures.notes.extend(own_mm.and_then(|own_mm| left_out(own_mm, marked_mm)));
    }
    Row { system: system.name, figures }
}

/// What the keys of the job cost the fastest stepped system of the machine that marks all in focus.
fn key_costs(subject: &Subject<'_>, rows: &[Row], task: Task<'_>) -> Vec<KeyCost> {
    let stepped = rows.iter().filter_map(|row| {
        let methods = [Method::Auto, Method::Contour, Method::ZRange, Method::Window];
        let method = methods.into_iter().find(|method| method.name() == row.system)?;
        let figures = row.figures.as_ref().ok().filter(|f| f.keeps_limits() || f.is_yours_to_set())?;
        Some((method, row.system, figures.counted_s()))
    });
    let Some((method, system, _)) = stepped.min_by(|a, b| a.2.total_cmp(&b.2)) else { return Vec::new() };
    stepped::key_costs(subject, method, system, task)
}

/// What is said of a system that marks less than may be marked: a thousandth of it, or what the table shows.
fn left_out(marked_mm: f64, whole_mm: f64) -> Option<String> {
    const SHOWN: f64 = 5.0;
    let left = whole_mm - marked_mm;
    let is_shown = left >= SHOWN || left >= 1e-3 * whole_mm;
    is_shown.then(|| format!("marks {left:.1} mm less: pieces too small to be marked"))
}

/// What a system was found to do, with its curves.
struct SystemResult {
    figures: Result<Figures, Error>,
    curves: Curves,
}

/// Runs the systems, each in its turn of the table; their results in the order of `systems`.
fn run(
    systems: &[&'static System],
    subject: &Subject<'_>,
    follower: &Follower<'_>,
    progress: Progress<'_>,
    task: Task<'_>,
) -> Vec<SystemResult> {
    let results: Vec<OnceLock<SystemResult>> = systems.iter().map(|_| OnceLock::new()).collect();
    // Each system takes its own task as it begins.
    let tasks: Vec<Mutex<Option<Task<'_>>>> =
        task.parts(systems.len()).into_iter().map(|t| Mutex::new(Some(t))).collect();
    let run_and_keep = |i: usize| {
        let task = tasks[i].lock().unwrap_or_else(PoisonError::into_inner).take();
        (progress.begins)(systems[i].name);
        drop(results[i].set(run_system(systems[i], subject, follower, task.unwrap_or_else(Task::silent))));
    };
    let starting = |start: u8| (0..systems.len()).filter(move |&i| systems[i].start == start);
    rayon::scope_fifo(|scope| {
        let last = systems.iter().map(|s| s.start).max().unwrap_or(0);
        for start in 0..=last {
            // Stepped systems share a plan: one task does them in order, in parallel with the others.
            let is_stepped = |&i: &usize| matches!(systems[i].run, Run::Stepped(_));
            let run_and_keep = &run_and_keep;
            scope.spawn_fifo(move |_| starting(start).filter(is_stepped).for_each(run_and_keep));
            starting(start).filter(|i| !is_stepped(i)).for_each(|i| scope.spawn_fifo(move |_| run_and_keep(i)));
        }
    });
    results.into_iter().map(|result| result.into_inner().expect("every system was run")).collect()
}

/// Runs one system; its task is done at the end.
fn run_system(system: &System, subject: &Subject<'_>, follower: &Follower<'_>, task: Task<'_>) -> SystemResult {
    let mut curves = Curves::default();
    let figures = match system.run {
        Run::Stepped(figures) => figures(subject, task),
        Run::OnTheFly(figures) => figures(follower, &mut curves),
    };
    SystemResult { figures, curves }
}

/// Deviations of the marks of a path from the ideal beam: focus, incidence, displacement, and the share within limits.
/// Nodes weigh as much as is marked next to them.
fn marked(deviations: &[Deviation], weights: &[f64], limits: Limits) -> Figures {
    let spread = |pick: fn(&Deviation) -> f64| Statistics::of(deviations.iter().map(pick).zip(weights.iter().copied()));
    // A nanometre, and as little of an angle, for rounding.
    let less =
        |d: &Deviation| Deviation { defocus: d.defocus - 1e-6, angle: d.angle - 1e-9, lateral: d.lateral - 1e-6 };
    let marks = || deviations.iter().zip(weights).filter(|(_, w)| **w > 0.0);
    let inside = marks().filter(|(d, _)| limits.hold(less(d))).map(|(_, w)| w).sum::<f64>();
    let marked_mm = marks().map(|(_, w)| w).sum::<f64>();
    let figures = Figures {
        marked_mm,
        focus_um: spread(|d| d.defocus * 1000.0),
        incidence_deg: spread(|d| d.angle.to_degrees()),
        displacement_mm: spread(|d| d.lateral),
        // In this order all of it is exactly 100.
        within: 100.0 * (inside / marked_mm),
        ..Figures::default()
    };
    let keeps = |pick: fn(&Deviation) -> f64, limit: f64| marks().all(|(d, _)| pick(&less(d)) <= limit);
    let mut beyond = Vec::new();
    if !keeps(|d| d.defocus, limits.half_depth) {
        beyond.push(Beyond::Focus([figures.focus_um.worst, limits.half_depth * 1000.0]));
    }
    if !keeps(|d| d.angle, limits.angle) {
        beyond.push(Beyond::Incidence([figures.incidence_deg.worst, limits.angle.to_degrees()]));
    }
    if !keeps(|d| d.lateral, limits.field) {
        beyond.push(Beyond::Displacement([figures.displacement_mm.worst, limits.field]));
    }
    Figures { beyond, ..figures }
}

/// The path of some strokes over the part.
fn path_of(subject: &Subject<'_>, ordered: &OrderedStrokes, strokes: Range<usize>) -> Path {
    let field = subject.machine.usable_field().map(Nm::mm);
    let spacing = field[0].min(field[1]).min(subject.size[0].max(subject.size[1])) / NODES;
    Path::of(ordered, strokes, &subject.inputs.surface, &subject.height_field, spacing)
}
