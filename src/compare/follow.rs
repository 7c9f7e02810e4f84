//! The systems that mark on the fly.

use rayon::prelude::*;

use super::filters::filters;
use super::{Curves, Figures, Ground, Split, System, marked, path_of, reason};
use crate::compile::{Plan, plan_whole};
use crate::fly::decompose::Limits;
use crate::fly::kinematics::Deviation;
use crate::fly::pace::{self, State};
use crate::fly::path::Path;
use crate::fly::schedule::Schedule;
use crate::fly::servo::{Servo, Synthesis};
use crate::fly::seven::{Rig, Seven, Tools, seven};
use crate::fly::spread::Spread;
use crate::fly::sync::{Room, Sync, Timed, ends, quickest, synchronise};
use crate::geom::{NM_PER_MM, mm_from_nm};
use crate::machine::Machine;
use crate::motion::stage_move;
use crate::program::Block;
use crate::units::Length;

/// Servos where the machine states none: a stage of 20 Hz and a scanner of 1 kHz, well damped.
const STAGE_HZ: f64 = 20.0;
const SCANNER_HZ: f64 = 1000.0;
const DAMPING: f64 = 0.7;
/// Samples of a synchronised path, and of one band of it.
const SAMPLES: usize = 300_000;
const COARSE: usize = 30_000;
/// How far apart nodes of a path of turning axes may be, mm.
const STEP: f64 = 1.0;
/// Samples to compare decompositions by.
const FILTERED: usize = 40_000;
/// Length of path on which the time of the seven axes is shown to converge, mm.
const SHOWN: f64 = 20_000.0;
/// Nodes of the seven-axis path whose axes are drawn.
const DRAWN: usize = 2000;

/// What the systems on the fly share.
pub(super) struct Follower<'a> {
    ground: &'a Ground<'a>,
    whole: &'a Plan,
    path: Path,
    /// The same with no more nodes than turning axes need.
    thin: Path,
}

impl<'a> Follower<'a> {
    pub(super) fn new(ground: &'a Ground<'a>, whole: &'a Plan) -> Self {
        let path = path_of(ground, whole.checked.program(), 0..whole.checked.program().blocks.len());
        let thin = path.evened(STEP);
        Self { ground, whole, path, thin }
    }

    fn room(&self) -> Room {
        let half_field = self.ground.machine.usable_field().map(|f| mm_from_nm(f) / 2.0);
        Room { half_field, focus: self.ground.limits.focus }
    }

    /// The figures of a system and what it has to show; None of one that steps.
    pub(super) fn system(
        &self,
        system: System,
        progress: &(dyn Fn(&'static str) + std::marker::Sync),
    ) -> Option<(Result<Figures, String>, Curves)> {
        let mut curves = Curves::default();
        let by: &dyn Fn(&mut Curves) -> Result<Figures, String> = match system {
            System::Sync => &|c| self.synchronised(c),
            System::SyncBands => &|_| self.bands(),
            System::Seven => &|c| self.turning(Tools::Gaussian, c),
            System::SevenSmooth => &|c| self.turning(Tools::LeastAcceleration, c),
            System::Five => &|c| self.turning(Tools::OnTheMark, c),
            _ => return None,
        };
        progress(system.name());
        Some((by(&mut curves), curves))
    }

    /// The strokes in their order, synchronised as a whole.
    fn synchronised(&self, curves: &mut Curves) -> Result<Figures, String> {
        let machine = self.ground.machine;
        let pens = &self.whole.checked.program().pens;
        // Where the part lies is the machine's affair: its travel must be long enough.
        let fits = |ends: [[f64; 2]; 3]| beyond(machine, ends).is_none();
        let Timed { run_s, path, schedule, sync } = quickest(&self.path, machine, pens, self.room(), SAMPLES, &fits);
        // The texture's middle lies where the stage rests.
        let (area, first) = (self.whole.texture, nm(path.at[0]));
        let middle = [(area.lo.x + area.hi.x) / 2, (area.lo.y + area.hi.y) / 2, first[2]];
        let approach = stage_move(machine, middle, first, None);
        let slow = sync.slower;
        let time = Split {
            stage: approach.travel_s + 2.0 * sync.lead_s,
            settle: approach.settle_s,
            ..Split::of(&schedule, slow)
        };
        let mut notes = Vec::new();
        if run_s > 0.0 {
            notes.push(format!("runs dark for {:.0} ms beside every mark", 1e3 * run_s * slow));
        }
        if !sync.fits {
            notes.push("some marks turn or rise too sharply to be followed in focus".into());
        }
        notes.extend(beyond(machine, ends(sync.stage.iter().copied())));
        let figures = Figures {
            time,
            stops: 1,
            speed: 100.0 / slow,
            notes,
            ..self.followed(&path, &schedule, &sync)?.figures(self.ground.limits)
        };
        let drawn = path.len().min(DRAWN);
        let until = sync.lead_s + schedule.arrive[drawn - 1] * slow;
        let stage = sync.stage.iter().take((until / sync.step_s) as usize + 1);
        curves.paths = vec![
            ("beam", path.at.iter().take(drawn).map(|p| [p[0], p[1]]).collect()),
            ("stage", stage.map(|p| [p[0], p[1]]).collect()),
        ];
        let (schedule, step_s) = Schedule::sampled(&path, machine, pens, FILTERED);
        curves.filters = filters(&path, &schedule, machine, self.room(), step_s);
        Ok(figures)
    }

    /// What marks get from a synchronised motion.
    fn followed(&self, path: &Path, schedule: &Schedule, sync: &Sync) -> Result<Followed, String> {
        let nodes = sync.nodes(path, schedule);
        let marks: Vec<f64> = sync.on.iter().map(|&on| f64::from(u8::from(on)) * sync.step_s).collect();
        let trail = self.trailing(self.ground.machine, &sync.stage, &sync.beam, sync.step_s, &marks)?;
        let deviations = upright(self.ground, path, |i| nodes[i]);
        Ok(Followed { deviations, weights: path.weights(), trail, travel: travel(sync.stage.iter().copied()) })
    }

    /// Bands of depth over the whole part: within each x and y follow, z rests.
    fn bands(&self) -> Result<Figures, String> {
        let ground = self.ground;
        let depth = Some(Length::mm(2.0 * ground.limits.focus));
        let plan = plan_whole(ground.job, ground.machine, depth).map_err(|e| reason(&e))?;
        let program = plan.checked.program();
        let band = |(i, block): (usize, &Block)| {
            let mut path = path_of(ground, program, i..i + 1);
            let plane = mm_from_nm(block.stop.focus);
            let heights: Vec<f64> = path.at.iter().map(|p| p[2]).collect();
            path.at.iter_mut().for_each(|p| p[2] = plane);
            let (schedule, step_s) = Schedule::sampled(&path, ground.machine, &program.pens, COARSE);
            let sync = synchronise(&path, &schedule, ground.machine, self.room(), step_s);
            path.at.iter_mut().zip(heights).for_each(|(p, z)| p[2] = z);
            let time = Split { stage: 2.0 * sync.lead_s, ..Split::of(&schedule, sync.slower) };
            let ends = [path.at[0], path.at[path.len() - 1]].map(nm).map(|[x, y, _]| [x, y, block.stop.focus]);
            Ok((self.followed(&path, &schedule, &sync)?, time, sync.slower, ends))
        };
        let bands = program.blocks.par_iter().enumerate().map(band).collect::<Result<Vec<_>, String>>()?;
        let (mut all, mut time, mut slowest) = (Followed::default(), Split::default(), 1.0f64);
        let mut before: Option<[i64; 3]> = None;
        for (followed, own, slow, [first, last]) in bands {
            let moved = before.map(|from| stage_move(ground.machine, from, first, None)).unwrap_or_default();
            before = Some(last);
            time.stage += own.stage + moved.travel_s;
            time.settle += moved.settle_s;
            (time.mark, time.jump, time.delay) = (time.mark + own.mark, time.jump + own.jump, time.delay + own.delay);
            slowest = slowest.max(slow);
            all.extend(followed);
        }
        Ok(Figures {
            time,
            stops: program.blocks.len(),
            speed: 100.0 / slowest,
            seam_mm: plan.summary.seam_mm,
            notes: vec!["speed of the slowest band".into()],
            ..all.figures(ground.limits)
        })
    }

    /// Five stage axes, with or without the scanner.
    fn turning(&self, tools: Tools, curves: &mut Curves) -> Result<Figures, String> {
        let ground = self.ground;
        let mut notes = Vec::new();
        let pens = &self.whole.checked.program().pens;
        let other = Machine::built_in("xyzac-galvo-10").map_err(|e| reason(&e))?;
        let own = Rig::of(ground.machine, pens, self.whole.checked.origin().map(mm_from_nm));
        let rig = match own {
            Some(rig) => rig,
            None => {
                notes.push("on the machine xyzac-galvo-10".to_owned());
                let rig = Rig::of(&other, pens, [0.0; 3]).ok_or("no limits of A and C are known")?;
                // The middle of the texture lies where its axes meet.
                let area = self.whole.texture;
                Rig { pivot: [(area.lo.x + area.hi.x) / 2, (area.lo.y + area.hi.y) / 2, 0].map(mm_from_nm), ..rig }
            }
        };
        let room = Limits { field: reach(rig.machine), ..ground.limits };
        let made = seven(&self.thin, &ground.relief, &rig, room, tools).map_err(|e| reason(&e))?;
        if tools == Tools::Gaussian {
            curves.ladder.clone_from(&made.ladder);
            curves.seven = Some(room);
            curves.convergence = made.convergence(&self.thin, &rig, SHOWN).map_err(|e| reason(&e))?;
            self.draw(&rig, &made, curves);
            notes.push(format!("sigma {:.0} um", made.sigma.unwrap_or_default() * 1000.0));
        }
        notes.extend(beyond(rig.machine, ends(made.axes.iter().map(|a| a.xyz))));
        Ok(Figures { notes, ..self.turned(rig.machine, made, room)? })
    }

    fn draw(&self, rig: &Rig<'_>, made: &Seven, curves: &mut Curves) {
        let path = &self.thin;
        let way = path.distances();
        let times = made.timed.node_times();
        let nodes = made.axes.iter().zip(&path.at).zip(times).take(DRAWN);
        curves.axes = nodes
            .map(|((a, &p), t)| {
                let ([x, y, z], [u, v, _]) = (a.xyz, a.sees(rig.sees(p)));
                (t, [x, y, z, a.a.to_degrees(), a.c.to_degrees(), u, v])
            })
            .collect();
        let deviations = made.deviation.iter().zip(&way).zip(&path.pen);
        curves.along = deviations
            .filter(|(_, pen)| pen.is_some())
            .map(|((d, &w), _)| [w, d.focus * 1000.0, d.angle.to_degrees(), d.lateral])
            .collect();
    }

    /// Figures of a turning system.
    fn turned(&self, machine: &Machine, made: Seven, limits: Limits) -> Result<Figures, String> {
        let mut time = Split::default();
        let times: Vec<f64> = made.timed.node_times().collect();
        for (i, w) in times.windows(2).enumerate() {
            *(if self.thin.pen[i + 1].is_some() { &mut time.mark } else { &mut time.jump }) += w[1] - w[0];
        }
        let asked = Schedule::of(&self.thin, machine, &self.whole.checked.program().pens, 0.0).mark_s;
        let even = sampled(&made.timed, &self.thin);
        let trail = self.trailing(machine, &even.stage, &even.beam, even.step_s, &even.marks)?;
        let travel = travel(made.axes.iter().map(|a| a.xyz));
        let followed = Followed { deviations: made.deviation, weights: self.thin.weights(), trail, travel };
        Ok(Figures { time, stops: 1, speed: 100.0 * asked / time.mark, ..followed.figures(limits) })
    }

    /// How far the stage trails its command in x and y, and how far the spot is off, at the samples that weigh
    /// anything.
    fn trailing(
        &self,
        machine: &Machine,
        stage: &[[f64; 3]],
        beam: &[[f64; 3]],
        step_s: f64,
        marks: &[f64],
    ) -> Result<Vec<Trail>, String> {
        let servo = |stated: Option<crate::machine::Servo>, hz: f64| {
            let (hz, damping) = stated.map_or((hz, DAMPING), |s| (s.frequency.as_khz() * 1000.0, s.damping));
            Servo::new(hz, damping).map_err(|e| reason(&e))
        };
        let (carrier, scanner) = (servo(machine.stage.servo, STAGE_HZ)?, servo(machine.scanner.servo, SCANNER_HZ)?);
        let half = machine.usable_field().map(|f| mm_from_nm(f) / 2.0);
        let [x, y] = [0, 1].map(|k| {
            let command: Vec<f64> = stage.iter().map(|p| p[k]).collect();
            let rest: Vec<f64> = beam.iter().zip(stage).map(|(b, s)| b[k] - s[k]).collect();
            let both = Synthesis { stage: carrier, scanner, half_field: half[k], feed: Some(self.ground.protection) };
            let reached = both.follow(&command, &rest, step_s, &[]);
            let lag: Vec<f64> = reached.stage.iter().zip(&command).map(|(a, c)| a - c).collect();
            (lag, reached.error)
        });
        let um = |a: f64, b: f64| 1000.0 * a.hypot(b);
        let at = |i: usize| [um(x.0[i], y.0[i]), um(x.1[i], y.1[i]), marks[i]];
        Ok((0..marks.len()).filter(|&i| marks[i] > 0.0).map(at).collect())
    }
}

/// What marks get from a motion.
#[derive(Default)]
struct Followed {
    deviations: Vec<Deviation>,
    weights: Vec<f64>,
    trail: Vec<Trail>,
    /// Way of the stage, mm.
    travel: f64,
}

/// At a sample, um: how far the stage trails its command, how far the spot is off; and what the sample weighs.
type Trail = [f64; 3];

impl Followed {
    fn extend(&mut self, other: Self) {
        self.deviations.extend(other.deviations);
        self.weights.extend(other.weights);
        self.trail.extend(other.trail);
        self.travel += other.travel;
    }

    fn figures(&self, limits: Limits) -> Figures {
        let trail = |k: usize| Spread::of(self.trail.iter().map(|t| (t[k], t[2])));
        Figures {
            stage_lag_um: Some(trail(0)),
            spot_error_um: Some(trail(1)),
            stage_travel_mm: self.travel,
            ..marked(&self.deviations, &self.weights, limits)
        }
    }
}

/// A turning motion at even steps of time, in machine coordinates.
#[derive(Default)]
struct Sampled {
    stage: Vec<[f64; 3]>,
    beam: Vec<[f64; 3]>,
    /// 1 where it marks, else 0.
    marks: Vec<f64>,
    step_s: f64,
}

fn sampled(timed: &pace::Timed, path: &Path) -> Sampled {
    const SAMPLES: usize = 150_000;
    let total = timed.total_s();
    let count = ((total / 1e-3).ceil() as usize).clamp(1, SAMPLES);
    let step_s = total / count as f64;
    let nodes: Vec<f64> = timed.node_times().collect();
    let (mut hint, mut state, mut node) = (0, State::default(), 0);
    let mut out = Sampled { step_s, ..Sampled::default() };
    for k in 0..=count {
        let now = k as f64 * step_s;
        while node + 1 < nodes.len() && nodes[node + 1] <= now {
            node += 1;
        }
        timed.at(now, &mut hint, &mut state);
        let p = &state.position;
        out.stage.push([p[0], p[1], p[2]]);
        out.beam.push([p[0] + p[5], p[1] + p[6], p[2]]);
        out.marks.push(f64::from(u8::from(path.pen.get(node + 1).copied().flatten().is_some())));
    }
    out
}

/// Of the nodes of a path under upright beams; `beam` tells where that of a node stands: x, y and the plane of
/// focus.
fn upright(ground: &Ground<'_>, path: &Path, beam: impl Fn(usize) -> [f64; 3]) -> Vec<Deviation> {
    let deviation = |i: usize| {
        let (p, b) = (path.at[i], beam(i));
        let angle = ground.relief.at([p[0], p[1]]).normal()[2].acos();
        Deviation { focus: (p[2] - b[2]).abs(), angle, lateral: (p[0] - b[0]).hypot(p[1] - b[1]) }
    };
    (0..path.len()).map(deviation).collect()
}

/// How far the spot may be from the optical axis in any direction.
fn reach(machine: &Machine) -> f64 {
    let [x, y] = machine.lens.field.map(|f| f.as_mm() / 2.0 - machine.lens.margin.as_mm());
    x.min(y)
}

/// What is said where the machine's travel is too short for a motion between some ends.
fn beyond(machine: &Machine, ends: [[f64; 2]; 3]) -> Option<String> {
    let names: Vec<String> = machine
        .axes()
        .into_iter()
        .zip(ends)
        .filter_map(|((name, axis), [lo, hi])| {
            let travel = axis.travel[1].as_mm() - axis.travel[0].as_mm();
            (hi - lo > travel).then(|| format!("{name} needs {:.0} mm of travel", hi - lo))
        })
        .collect();
    (!names.is_empty()).then(|| names.join(", "))
}

fn nm(p: [f64; 3]) -> [i64; 3] {
    p.map(|v| (v * NM_PER_MM).round() as i64)
}

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
