//! The systems that mark on the fly.

use super::axis_errors::AxisErrors;
use super::filters::{FAMILIES, filters};
use super::{Beyond, Curves, Figures, Hardware, RestTimes, Split, Subject, marked, path_of};
use terrace_core::diag::Error;
use terrace_core::geom::{Box2, BoxMm, NM_PER_MM, P3Mm, mm_from_nm};
use terrace_core::machine::{Commanded, Machine};
use terrace_core::math;
use terrace_core::motion::{GalvoModel, StageMove, stage_move};
use terrace_core::parallel;
use terrace_core::progress::Task;
use terrace_input::job::Mode;
use terrace_plan::block_map::BlockMap;
use terrace_plan::on_the_fly::axes::following_error::{Axis, Protection, Scanner, Servo};
use terrace_plan::on_the_fly::axes::kinematics::{Axes, Deviation};
use terrace_plan::on_the_fly::axes::motion::AXES;
use terrace_plan::on_the_fly::decompose::{Family, Limits, choose_average};
use terrace_plan::on_the_fly::kinematic_model::{BeyondTravel, KinematicModel};
use terrace_plan::on_the_fly::path::Path;
use terrace_plan::on_the_fly::path::schedule::Schedule;
use terrace_plan::on_the_fly::spot::Rests;
use terrace_plan::on_the_fly::statistics::Statistics;
use terrace_plan::on_the_fly::stop_at_every_point::stop_at_every_point;
use terrace_plan::on_the_fly::turnaround::{SynchronisedPath, Turnaround, quickest};
use terrace_plan::on_the_fly::xyzacuv::{
    AxisFigures, Instant, TimedAxes, ToolPath, UntimedAxes, decompose, decompose_and_time,
};
use terrace_plan::on_the_fly::xyzuv::{Decomposition, ScannerLimits, step_scan_s, synchronise, synchronised_s};
use terrace_plan::ordered_strokes::{Band, OrderedStrokes};
use terrace_plan::plan::strokes::{self, Strokes};

/// Samples of a synchronised path.
const SAMPLES: usize = 300_000;
/// Samples of one band of a synchronised path.
const BAND_SAMPLES: usize = 30_000;
/// How far apart nodes of a path of rotary axes may be, mm.
const STEP: f64 = 1.0;
/// Samples to compare decompositions by.
const FILTERED: usize = 20_000;
/// Length of path on which the time of the seven axes is shown to converge, mm.
const SHOWN: f64 = 20_000.0;
/// Nodes of the seven-axis path whose axes are drawn.
const DRAWN: usize = 2000;

/// The built-in machine whose axes stand in where the job's machine does not have seven.
const LENDER: &str = "xyzac-galvo-10";

/// What the systems on the fly share.
pub(super) struct Follower<'a> {
    subject: &'a Subject<'a>,
    whole: &'a Strokes,
    path: Path,
    /// The path with no more nodes than turning axes need.
    thin: Path,
    /// The time of the path at the pens' speeds, s.
    process_s: f64,
    /// Length of its marks.
    mark_mm: f64,
}

impl<'a> Follower<'a> {
    pub(super) fn new(subject: &'a Subject<'a>, whole: &'a Strokes) -> Self {
        let path = path_of(subject, &whole.ordered, 0..whole.ordered.strokes.len());
        let thin = path.evened(STEP);
        let process_s = Schedule::of(&path, subject.machine, &whole.ordered.pens, 0.0).total_s();
        Self { subject, whole, path, thin, process_s, mark_mm: mark_mm(&whole.ordered, &whole.bands) }
    }

    /// Length of the marks, every pass of the pens counted.
    pub(super) fn mark_mm(&self) -> f64 {
        self.mark_mm
    }

    /// What all systems share.
    pub(super) fn subject(&self) -> &Subject<'a> {
        self.subject
    }

    /// The beam's path over the part.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// The box of the texture, mm.
    pub(super) fn texture(&self) -> BoxMm<2> {
        let Box2 { lo, hi } = self.whole.texture;
        BoxMm::of([lo.mm(), hi.mm()])
    }

    /// The job's machine as one of seven axes; None where it has fewer.
    fn seven(&self) -> Option<KinematicModel<'_>> {
        KinematicModel::of(self.subject.machine, &self.whole.ordered.pens, self.whole.origin.mm())
    }

    /// What moves scanner and stage together, and what the job file says for it where the job's machine does: where
    /// the file asks for it, or states what all seven axes can do while they move.
    fn together(&self) -> (Hardware, Option<String>) {
        let job = self.subject.job;
        if job.mode_of_file != Mode::OnTheFly && self.seven().is_none() {
            return (Hardware::Synchronised, None);
        }
        // Jobs with pens of several passes are not made on the fly.
        let is_made = job.pens.iter().all(|pen| pen.passes == 1);
        (Hardware::Own, is_made.then(|| format!("mode = \"{}\"", Mode::OnTheFly.name())))
    }

    fn allowed(&self) -> Result<ScannerLimits, Error> {
        ScannerLimits::of(self.subject.machine, self.subject.limits.half_depth)
    }

    /// The figures of the strokes in their order, synchronised as a whole.
    pub(super) fn synchronised(&self, curves: &mut Curves) -> Result<Figures, Error> {
        let machine = self.subject.machine;
        let allowed = self.allowed()?;
        // Where the part lies is the machine's affair: its travel must be long enough.
        let fits = |ends: BoxMm<3>| too_far(machine, ends).is_none();
        let timed = quickest(&self.path, machine, &self.whole.ordered.pens, allowed, SAMPLES, &fits, Task::silent());
        let SynchronisedPath { path, schedule, sync, .. } = &timed;
        let approach = self.approach(nm(path.nodes[0].at));
        let time = Split {
            stage: approach.travel_s + 2.0 * sync.lead_s,
            settle: approach.settle_s,
            ..Split::of(schedule, sync.slower)
        };
        let notes = self.notes_of_synchronised(&timed, allowed);
        let followed = self.followed(path, schedule, sync)?.figures(self.subject.limits);
        let mut beyond = followed.beyond.clone();
        beyond.extend((!sync.fits).then_some(Beyond::TooSharp));
        beyond.extend(too_far(machine, BoxMm::of(sync.stage.iter().copied())));
        let (hardware, job_key) = self.together();
        let figures = Figures {
            hardware,
            job_key: job_key.filter(|_| self.seven().is_none()),
            beyond,
            is_held_by_z: sync.slower > 1.0 && sync.z_is_slowest,
            marked_mm: self.mark_mm,
            time,
            model_s: Some(synchronised_s(self.subject.move_s, self.process_s)),
            stops: 1,
            speed: 100.0 / sync.slower,
            notes,
            ..followed
        };
        self.draw_synchronised(&timed, allowed, curves);
        Ok(figures)
    }

    /// The move of the stage from where it rests, under the middle of the texture, to the begin of a path, nm.
    fn approach(&self, first: [i64; 3]) -> StageMove {
        let area = self.whole.texture;
        let middle = [(area.lo.x + area.hi.x) / 2, (area.lo.y + area.hi.y) / 2, first[2]];
        stage_move(self.subject.machine, Commanded(middle), Commanded(first), None)
    }

    /// The turnaround and the averages of a synchronised motion, and what the article's rule makes of its path.
    fn notes_of_synchronised(&self, timed: &SynchronisedPath, allowed: ScannerLimits) -> Vec<String> {
        let SynchronisedPath { turn, sync, .. } = timed;
        let slow = sync.slower;
        let mut notes = Vec::new();
        match *turn {
            Turnaround::Skywriting(s) => {
                notes.push(format!("skywriting for {:.0} ms before and after every mark", 1e3 * s * slow))
            }
            Turnaround::Dwell(s) if s > 0.0 => notes.push(format!("waits for {:.0} ms at every end", 1e3 * s * slow)),
            Turnaround::Dwell(_) => {}
        }
        let [plan_ms, height_ms] = [0, 1].map(|k| 1e3 * sync.samples[k] as f64 * sync.step_s);
        notes.push(format!("averages of {plan_ms:.0} ms in plan, {height_ms:.1} ms in height"));
        notes.push(self.by_the_article(allowed));
        notes
    }

    /// The start of a synchronised motion for the charts, and the decompositions of the middle of its path.
    fn draw_synchronised(&self, timed: &SynchronisedPath, allowed: ScannerLimits, curves: &mut Curves) {
        let SynchronisedPath { turn, path, schedule, sync } = timed;
        let machine = self.subject.machine;
        let drawn = path.len().min(DRAWN);
        let until_s = sync.lead_s + schedule.visits[drawn - 1].arrive * sync.slower;
        let drawn_samples = (until_s / sync.step_s) as usize;
        let stage = sync.stage.iter().take(drawn_samples + 1);
        curves.paths = vec![
            ("beam", path.nodes.iter().take(drawn).map(|node| [node.at[0], node.at[1]]).collect()),
            ("stage", stage.map(|p| [p[0], p[1]]).collect()),
        ];
        curves.velocities = velocities(sync, drawn_samples);
        let step_s = sync.step_s / sync.slower;
        let piece = path.middle(FILTERED as f64 * step_s / schedule.total_s());
        let schedule = Schedule::of(&piece, machine, &self.whole.ordered.pens, turn.wait_s());
        curves.filters = filters(&piece, &schedule, machine, allowed, step_s);
    }

    /// What the article's rule (eq. 4) makes of the path at the pens' speeds.
    fn by_the_article(&self, allowed: ScannerLimits) -> String {
        const SAMPLES: usize = 50_000;
        let machine = self.subject.machine;
        let schedule = Schedule::of(&self.path, machine, &self.whole.ordered.pens, 0.0);
        let even = schedule.samples(&self.path, (schedule.total_s() / SAMPLES as f64).max(1e-3));
        let plan: Vec<[f64; 2]> = even.at.iter().map(|p| [p[0], p[1]]).collect();
        let most = machine.stage.x.acceleration.as_mm_s2().min(machine.stage.y.acceleration.as_mm_s2());
        let window = |samples: usize| format!("p = {samples} of {:.1} ms", 1e3 * even.step_s);
        match choose_average(&plan, even.step_s, most, allowed.half_field) {
            Ok(average) => format!("eq. 4: {}", window(average.samples)),
            Err(off) => format!(
                "eq. 4: infeasible, {} takes the scanner {:.0} mm out along {}, its field ends at {:.1} mm; at {:.0} % of \
                 the speed it would fit",
                window(off.average.samples),
                off.average.reach[off.axis],
                ["x", "y"][off.axis],
                off.half_field,
                100.0 * off.speed_share
            ),
        }
    }

    /// What marks get from a synchronised motion.
    fn followed(&self, path: &Path, schedule: &Schedule, sync: &Decomposition) -> Result<MarksOfMotion, Error> {
        let nodes = sync.nodes(path, schedule);
        let half = self.subject.machine.half_usable_field_mm();
        let samples = sync.stage.iter().zip(&sync.beam).zip(&sync.on).map(|((&xyz, b), &on)| Sample {
            // Nothing turns: the part may be taken to lie with its origin at the pivot.
            axes: Axes { xyz: P3Mm::new(xyz), a: 0.0, c: 0.0 },
            spot: [b[0] - xyz[0], b[1] - xyz[1]],
            on,
        });
        let (following_error, _) =
            following(self.subject.machine, &|_| half, Some(self.subject.protection), samples, sync.step_s, 0.0)?;
        let deviations = upright(self.subject, path, |i| nodes[i]);
        Ok(MarksOfMotion {
            deviations,
            weights: path.weights(),
            following_error,
            travel: travel(sync.stage.iter().copied()),
        })
    }

    /// The figures of bands of depth over the whole part: within each x and y follow, z rests.
    pub(super) fn bands(&self) -> Result<Figures, Error> {
        let subject = self.subject;
        let depth = Some(subject.job.focus.depth);
        let strokes = strokes::in_order(subject.job, subject.machine, subject.inputs, depth, &|_, _| {})?;
        let Strokes { ordered, bands, texture, .. } = strokes.repeated();
        let allowed = self.allowed()?;
        let map = BlockMap::of_bands(&ordered, &bands, &subject.inputs.surface, texture);
        let motions = parallel::map(bands.len(), |i| self.band(&bands[i], &ordered, allowed));
        let mut all = MarksOfMotion::default();
        let mut time = Split::default();
        let mut slowest = 1.0f64;
        let mut process_s = 0.0;
        let mut before: Option<Commanded> = None;
        for band in motions.into_iter().collect::<Result<Vec<BandMotion>, Error>>()? {
            let [first, last] = band.ends;
            let moved = before.map(|from| stage_move(subject.machine, from, first, None)).unwrap_or_default();
            before = Some(last);
            time.stage += band.time.stage + moved.travel_s;
            time.settle += moved.settle_s;
            time.mark += band.time.mark;
            time.jump += band.time.jump;
            time.delay += band.time.delay;
            slowest = slowest.max(band.slower);
            process_s += band.process_s;
            all.extend(band.followed);
        }
        Ok(Figures {
            time,
            model_s: Some(step_scan_s(bands.len(), subject.move_s, process_s)),
            stops: bands.len(),
            speed: 100.0 / slowest,
            seam_mm: map.seam_mm(),
            notes: vec!["speed of the slowest band".into()],
            hardware: self.together().0,
            marked_mm: mark_mm(&ordered, &bands),
            ..all.figures(subject.limits)
        })
    }

    /// The motion over one band: x and y are synchronised with z at the band's focal plane.
    fn band(&self, band: &Band, ordered: &OrderedStrokes, allowed: ScannerLimits) -> Result<BandMotion, Error> {
        let machine = self.subject.machine;
        let mut path = path_of(self.subject, ordered, band.strokes.clone());
        let heights: Vec<f64> = path.nodes.iter().map(|node| node.at[2]).collect();
        let plane = band.lpfl.mm();
        path.nodes.iter_mut().for_each(|node| node.at[2] = plane);
        let schedule = Schedule::of(&path, machine, &ordered.pens, 0.0);
        let sync = synchronise(&path, &schedule, machine, allowed, schedule.step_s(BAND_SAMPLES));
        // The marks are judged at their own heights again.
        path.nodes.iter_mut().zip(heights).for_each(|(node, z)| node.at[2] = z);
        let ends =
            [path.nodes[0].at, path.nodes[path.len() - 1].at].map(nm).map(|[x, y, _]| Commanded([x, y, band.lpfl.0]));
        Ok(BandMotion {
            followed: self.followed(&path, &schedule, &sync)?,
            time: Split { stage: 2.0 * sync.lead_s, ..Split::of(&schedule, sync.slower) },
            slower: sync.slower,
            process_s: schedule.total_s(),
            ends,
        })
    }

    /// The figures of five stage axes, with or without the scanner.
    pub(super) fn turning(&self, tools: ToolPath, curves: &mut Curves) -> Result<Figures, Error> {
        let subject = self.subject;
        let lender = self.lender()?;
        let (model, hardware) = match self.seven() {
            Some(model) => (model, Hardware::Own),
            None => (self.lent(&lender), Hardware::Other(LENDER)),
        };
        let allowed = Limits { field: model.scanner_margin()?, ..subject.limits };
        let path = match tools {
            // The stage would have to run up, not the scanner.
            ToolPath::OnTheMark => self.thin.clone(),
            _ => model.with_run_ups(&self.thin, &subject.job.skywriting),
        };
        let decomposed = decompose(&path, &subject.height_field, &model, allowed, tools)?;
        // The article's system is drawn and described.
        let is_of_article = tools == ToolPath::Filtered(Family::Gaussian);
        if is_of_article {
            curves.convergence = decomposed.convergence(&model, SHOWN)?;
        }
        let made = decomposed.clone().timed(&model, 1)?;
        let mut notes = Vec::new();
        let mut job_key = None;
        if is_of_article {
            job_key = self.together().1.filter(|_| hardware == Hardware::Own);
            curves.back_off.clone_from(&made.back_off);
            curves.seven = Some(allowed);
            self.draw(&model, &made, curves);
            curves.shared = self.axis_figures(&model, allowed)?;
            notes.push(format!("sigma {:.0} um", made.strength.unwrap_or_default() * 1000.0));
            curves.rests = self.rests(&model, &decomposed, &made)?;
            if curves.rests.iter().any(|row| row.total_s.is_none()) {
                notes.push("no time with the stage in step with the spot was found".into());
            }
        }
        let mut beyond_travel: Vec<Beyond> = Vec::new();
        beyond_travel.extend(too_far(model.machine, BoxMm::of(made.axes.iter().map(|a| a.xyz.mm))));
        beyond_travel.extend(turns_too_far(&model, &made.axes));
        let nodes: Vec<[f64; AXES]> =
            made.axes.iter().zip(&made.path.nodes).map(|(axes, node)| model.values(axes, node.at)).collect();
        let model_s = Some(stop_at_every_point(&nodes, &model.all_limits()).total_s);
        let mut figures = self.turned(&model, made, tools, allowed)?;
        figures.beyond.extend(beyond_travel);
        Ok(Figures { notes, model_s, hardware, job_key, marked_mm: self.mark_mm, ..figures })
    }

    /// The built-in machine of seven axes, with the scanner's model that all systems share: that of the job's machine.
    fn lender(&self) -> Result<Machine, Error> {
        let mut lender = Machine::built_in(LENDER)?;
        if self.subject.galvo == GalvoModel::AtSpeed {
            lender.scanner.acceleration = None;
            lender.scanner.jerk = None;
        }
        Ok(lender)
    }

    /// The built-in machine under the part, where the middle of the texture lies where its axes meet.
    fn lent<'m>(&'m self, lender: &'m Machine) -> KinematicModel<'m> {
        let model = KinematicModel::of(lender, &self.whole.ordered.pens, [0.0; 3])
            .expect("the profile states the limits of A and C");
        let area = self.whole.texture;
        let pivot = [(area.lo.x + area.hi.x) / 2, (area.lo.y + area.hi.y) / 2, 0].map(mm_from_nm);
        KinematicModel { pivot: P3Mm::new(pivot), ..model }
    }

    /// The time of a motion, and what the model of the article makes of its stage in step with the spot: at rest at
    /// corners, and at every point of a stroke.
    fn rests(
        &self,
        model: &KinematicModel<'_>,
        decomposed: &UntimedAxes,
        made: &TimedAxes,
    ) -> Result<Vec<RestTimes>, Error> {
        // Every vertex of a stroke is a node of the whole path.
        let tools = ToolPath::Gaussian { sigma: made.strength.unwrap_or_default() };
        let whole = decompose(&self.path, &self.subject.height_field, model, decomposed.limits, tools)?;
        let (scanner_s, in_step_s) = decomposed.in_step_s(model, Rests::Corners)?;
        let (every_s, every_in_step_s) = whole.in_step_s(model, Rests::EveryPoint)?;
        Ok(vec![
            RestTimes { rests: Rests::Corners, in_step: false, total_s: Some(made.total_s()), scanner_s },
            RestTimes { rests: Rests::Corners, in_step: true, total_s: in_step_s, scanner_s },
            RestTimes { rests: Rests::EveryPoint, in_step: true, total_s: every_in_step_s, scanner_s: every_s },
        ])
    }

    /// Every decomposition of the first of the path.
    fn axis_figures(
        &self,
        model: &KinematicModel<'_>,
        allowed: Limits,
    ) -> Result<Vec<(&'static str, AxisFigures)>, Error> {
        let count = self.thin.distances().partition_point(|&s| s <= SHOWN).max(2).min(self.thin.len());
        let first = self.thin.piece(0..count);
        let mut all = FAMILIES.map(|(name, family)| (name, ToolPath::Filtered(family))).to_vec();
        all.push(("least acceleration", ToolPath::LeastAcceleration));
        let figures = |_, (name, tools)| {
            let timed = decompose_and_time(&first, &self.subject.height_field, model, allowed, tools)?;
            Ok((name, timed.axis_figures(model)))
        };
        parallel::map_items(all, figures).into_iter().collect()
    }

    /// The start of a seven-axis motion for the charts.
    fn draw(&self, model: &KinematicModel<'_>, made: &TimedAxes, curves: &mut Curves) {
        let path = &made.path;
        let way = path.distances();
        let times = made.times();
        let nodes = made.axes.iter().zip(&path.nodes).zip(&times).take(DRAWN);
        curves.axes = nodes
            .map(|((a, node), &[t, _])| {
                let [x, y, z, a, c, u, v] = model.values(a, node.at);
                (t, [x, y, z, a.to_degrees(), c.to_degrees(), u, v])
            })
            .collect();
        let nodes = made.axes.iter().zip(&path.nodes).take(DRAWN);
        curves.space = nodes
            .map(|(axes, node)| {
                let tool = axes.tool();
                [model.from_pivot(node.at).mm, tool.p.mm, tool.n.0]
            })
            .collect();
        let deviations = made.deviation.iter().zip(&way).zip(&path.nodes);
        curves.along = deviations
            .filter(|(_, node)| node.pen.is_some())
            .map(|((d, &w), _)| [w, d.defocus * 1000.0, d.angle.to_degrees(), d.lateral])
            .collect();
    }

    /// Figures of a turning system.
    fn turned(
        &self,
        model: &KinematicModel<'_>,
        made: TimedAxes,
        tools: ToolPath,
        limits: Limits,
    ) -> Result<Figures, Error> {
        let machine = model.machine;
        let mut time = Split::default();
        let times = made.times();
        for (i, w) in times.windows(2).enumerate() {
            *(if made.path.nodes[i + 1].pen.is_some() { &mut time.mark } else { &mut time.jump }) += w[1][0] - w[0][1];
        }
        time.delay = times.iter().map(|[come, go]| go - come).sum();
        let asked = Schedule::of(&self.thin, machine, &self.whole.ordered.pens, 0.0).mark_s;
        // Where the scanner does not move it does not compensate for the stage either.
        let feed = (tools != ToolPath::OnTheMark).then_some(self.subject.protection);
        let (samples, step_s) = sampled(&made, model);
        // Of a round field what is too far out comes back towards its centre.
        let reach = machine.field_reach();
        let half_field = |[u, v]: [f64; 2]| [u, v].map(|c| c.abs() * (reach / math::hypot(u, v).max(reach)));
        let [_, until_s] = times[times.len().min(DRAWN) - 1];
        let (following_error, axis_errors) = following(machine, &half_field, feed, samples, step_s, until_s)?;
        let travel = travel(made.axes.iter().map(|a| a.xyz.mm));
        let followed =
            MarksOfMotion { deviations: made.deviation, weights: made.path.weights(), following_error, travel };
        let axis_errors = Some(axis_errors);
        Ok(Figures { time, stops: 1, speed: 100.0 * asked / time.mark, axis_errors, ..followed.figures(limits) })
    }
}

/// Time and velocities of the stage's X, Y, Z and the scanner's U, V over the first samples of a synchronised motion.
fn velocities(sync: &Decomposition, samples: usize) -> Vec<(f64, [f64; 5])> {
    let steps = sync.stage.windows(2).zip(sync.beam.windows(2)).take(samples).enumerate();
    let velocities = steps.map(|(i, (stage, beam))| {
        let [x, y, z] = [0, 1, 2].map(|k| (stage[1][k] - stage[0][k]) / sync.step_s);
        let [u, v] = [0, 1].map(|k| (beam[1][k] - beam[0][k]) / sync.step_s);
        ((i as f64 + 0.5) * sync.step_s, [x, y, z, u - x, v - y])
    });
    velocities.collect()
}

/// How far the axes of a stage lag behind their commands, each after its own servo, and how far the spot is off, at the
/// samples that mark; and how far every axis is behind its own command, at all samples. `half_field` is half of the
/// field for a command, `feed` how the scanner compensates for the stage. Samples are `step_s` apart; the course of the
/// errors is kept up to `until_s`.
fn following(
    machine: &Machine,
    half_field: &dyn Fn([f64; 2]) -> [f64; 2],
    feed: Option<Protection>,
    samples: impl Iterator<Item = Sample>,
    step_s: f64,
    until_s: f64,
) -> Result<(Vec<FollowingError>, AxisErrors), Error> {
    let feed = feed.map(|protection| protection.on(machine));
    let stage = Servo::of_stage(machine)?;
    let mirror = Servo::of_scanner(machine)?;
    let mut samples = samples.peekable();
    let mut axis_errors = AxisErrors::new(step_s, until_s);
    let Some(&Sample { axes: Axes { xyz, a, c }, spot, .. }) = samples.peek() else {
        return Ok((Vec::new(), axis_errors));
    };
    let [x, y, z] = xyz.mm;
    let mut stage_axes = [x, y, z, a, c].map(|at| Axis::new(stage, step_s, at));
    let mut mirrors = [0, 1].map(|k| Scanner::new(mirror, feed, step_s, spot[k]));
    let mut out = Vec::new();
    for Sample { axes, spot, on } in samples {
        let [x, y, z] = axes.xyz.mm;
        let commands = [x, y, z, axes.a, axes.c];
        let reached: [f64; 5] = std::array::from_fn(|k| stage_axes[k].step(commands[k]));
        let [x, y, z, a, c] = reached;
        // Where the axes that are late see what is to be marked.
        let seen = Axes { xyz: P3Mm::new([x, y, z]), a, c }.seen(axes.spot(spot[0], spot[1]).p);
        let missed = [0, 1].map(|k| seen.uv[k] - spot[k]);
        let half = half_field([0, 1].map(|k| spot[k] + missed[k]));
        let off = [0, 1].map(|k| mirrors[k].step(spot[k], missed[k], half[k]));
        if on {
            let [lag, error, defocus] =
                [math::hypot(missed[0], missed[1]), math::hypot(off[0], off[1]), seen.height].map(|v| 1000.0 * v);
            out.push([lag, error, defocus, step_s]);
        }
        let [dx, dy, dz, da, dc] = std::array::from_fn(|k| commands[k] - reached[k]);
        let [du, dv] = mirrors.each_ref().map(Scanner::following_error);
        let [x, y, z, a, c] = commands;
        axis_errors.add([x, y, z, a, c, spot[0], spot[1]], [dx, dy, dz, da, dc, du, dv]);
    }
    Ok((out, axis_errors))
}

/// A motion over one band of depth.
struct BandMotion {
    followed: MarksOfMotion,
    time: Split,
    /// How many times slower than the pens ask for it runs.
    slower: f64,
    /// Its time at the pens' speeds, s.
    process_s: f64,
    /// Where the stage begins and ends, nm.
    ends: [Commanded; 2],
}

/// What marks get from a motion.
#[derive(Default)]
struct MarksOfMotion {
    deviations: Vec<Deviation>,
    weights: Vec<f64>,
    following_error: Vec<FollowingError>,
    /// Way of the stage, mm.
    travel: f64,
}

/// At a sample that marks, um: how far the stage lags behind its command across the beam, how far the spot is off,
/// and how far the stage lags along the beam; and the time that the sample stands for, s.
type FollowingError = [f64; 4];

impl MarksOfMotion {
    fn extend(&mut self, other: Self) {
        self.deviations.extend(other.deviations);
        self.weights.extend(other.weights);
        self.following_error.extend(other.following_error);
        self.travel += other.travel;
    }

    fn figures(&self, limits: Limits) -> Figures {
        let following_error = |k: usize| Statistics::of(self.following_error.iter().map(|t| (t[k], t[3])));
        Figures {
            stage_lag_um: Some(following_error(0)),
            spot_error_um: Some(following_error(1)),
            focus_lag_um: Some(following_error(2)),
            stage_travel_mm: self.travel,
            ..marked(&self.deviations, &self.weights, limits)
        }
    }
}

/// A motion at an instant: the stage, where the spot is in the field, and whether it marks.
struct Sample {
    axes: Axes,
    spot: [f64; 2],
    on: bool,
}

/// A turning motion at even steps of time from its start to its end, and the length of a step, s.
fn sampled<'a>(motion: &'a TimedAxes, model: &'a KinematicModel<'a>) -> (impl Iterator<Item = Sample> + use<'a>, f64) {
    /// Longest step, s, unless the motion would then have more than `MOST` steps.
    const STEP_S: f64 = 1e-3;
    const MOST: usize = 500_000;
    let total_s = motion.total_s();
    let count = ((total_s / STEP_S).ceil() as usize).clamp(1, MOST);
    let step_s = total_s / count as f64;
    let mut reader = motion.read(model);
    let samples = (0..=count).map(move |k| {
        let Instant { axes, node, field } = reader.at(k as f64 * step_s);
        // The spot comes from `node`: it is on the stretch that ends at the next one.
        Sample { axes, spot: field, on: motion.path.pen_at(node + 1).is_some() }
    });
    (samples, step_s)
}

/// Deviations of the nodes of a path under upright beams; `beam` gives x, y and the focal plane of a node's beam.
fn upright(subject: &Subject<'_>, path: &Path, beam: impl Fn(usize) -> [f64; 3]) -> Vec<Deviation> {
    let deviation = |i: usize| {
        let (p, b) = (path.nodes[i].at, beam(i));
        let angle = math::acos(subject.height_field.at(p.xy()).normal().0[2]);
        Deviation { defocus: (p[2] - b[2]).abs(), angle, lateral: math::hypot(p[0] - b[0], p[1] - b[1]) }
    };
    (0..path.len()).map(deviation).collect()
}

/// Which linear axes need more travel than they have for a motion between some ends; None where none does.
fn too_far(machine: &Machine, ends: BoxMm<3>) -> Option<Beyond> {
    let names: Vec<String> = machine
        .axes()
        .into_iter()
        .zip(ends.size())
        .filter_map(|((name, axis), size)| {
            let travel = axis.travel[1].as_mm() - axis.travel[0].as_mm();
            (size > travel).then(|| format!("{name} needs {size:.0} mm of travel"))
        })
        .collect();
    (!names.is_empty()).then(|| Beyond::Travel(names.join(", ")))
}

/// Which turning axes need more travel than they have; None where none does.
fn turns_too_far(model: &KinematicModel<'_>, axes: &[Axes]) -> Option<Beyond> {
    let need = |BeyondTravel { letter, needed: [least, most], .. }: BeyondTravel| {
        format!("{} needs {least:.0} to {most:.0} deg of travel", letter.char())
    };
    let needs: Vec<String> = model.beyond_travel(axes).into_iter().map(need).collect();
    (!needs.is_empty()).then(|| Beyond::Travel(needs.join(", ")))
}

/// Length of the marks of all bands.
fn mark_mm(ordered: &OrderedStrokes, bands: &[Band]) -> f64 {
    bands.iter().map(|band| ordered.mark_mm(band.strokes.clone())).sum()
}

/// A point in mm as one in nm.
fn nm(p: P3Mm) -> [i64; 3] {
    p.mm.map(|v| (v * NM_PER_MM).round() as i64)
}

/// Length of the way through some points.
fn travel(points: impl Iterator<Item = [f64; 3]>) -> f64 {
    let mut last: Option<[f64; 3]> = None;
    let mut sum = 0.0;
    for p in points {
        if let Some(l) = last {
            sum += (0..3).map(|k| (p[k] - l[k]).powi(2)).sum::<f64>().sqrt();
        }
        last = Some(p);
    }
    sum
}
