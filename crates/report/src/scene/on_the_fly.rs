//! The scene of an on-the-fly job.

use super::beam::Beams;
use super::relief::Relief;
use super::thin::thin;
use super::{Frame, Group, Mark, Point, Scene, Thinned, unmarked};
use terrace_core::diag::Error;
use terrace_core::geom::NM_PER_MM;
use terrace_plan::on_the_fly::program::{self, AxisCommands};
use terrace_plan::plan::OnTheFlyPlan;

/// Points of a group, as many as a tile of a picture should have.
const GROUP: usize = 4096;
/// Marks of a group, so that those of few points are grouped by place too.
const GROUP_MARKS: usize = 32;
/// Samples of the motion that are kept.
const SAMPLES: usize = 40_000;
/// Lines stray from the marks by this share of the spot at most, and by this one of half the depth range.
const OF_SPOT: f64 = 0.05;
const OF_DEPTH: f64 = 0.04;

/// How the head moves over the part.
#[derive(Clone, Debug, Default)]
pub struct Motion {
    /// In the order of time.
    pub samples: Vec<MotionSample>,
}

/// Where the head is at a time; the part frame, mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionSample {
    /// From the program's start, s.
    pub time_s: f64,
    /// Centre of the field.
    pub centre: [f64; 3],
    /// Direction to the lens.
    pub up: [f64; 3],
    /// Where the beam meets the focal plane.
    pub spot: [f64; 3],
    /// Whether the laser is on until then.
    pub is_on: bool,
}

/// The scene of a plan. `relief` tells holes from what lies outside the part.
///
/// # Errors
/// Those of a machine that does not have the program's axes.
pub fn of_on_the_fly(plan: &OnTheFlyPlan, relief: &Relief) -> Result<Scene, Error> {
    let program = plan.checked.program();
    let half_depth = plan.job.focus.half_depth_mm() * NM_PER_MM;
    let limit = (OF_SPOT * plan.machine.lens.spot.as_mm() * NM_PER_MM).min(OF_DEPTH * half_depth);
    let spots = program.spots(&plan.machine)?;
    let mut scene = Scene {
        unmarked: unmarked::of_on_the_fly(plan, relief),
        thinned: Thinned { within_um: limit / 1e3, points: 0 },
        motion: Some(motion(program, &spots)),
        ..Scene::default()
    };
    let mut maker =
        Maker { beams: Beams::new(&plan.inputs.surface), scene: &mut scene, limit, height: 0.0, line: Vec::new() };
    let mut before = None;
    for (us, from, step) in program.steps() {
        if before.is_some() && step.mark != before {
            maker.end(before);
        }
        if step.mark.is_some() {
            if maker.line.is_empty() {
                maker.add(&spots(from), us);
            }
            maker.add(&spots(&step.to), step.us);
        }
        before = step.mark;
    }
    maker.end(before);
    Ok(scene)
}

/// The marks while they are followed.
struct Maker<'a> {
    beams: Beams<'a>,
    scene: &'a mut Scene,
    limit: f64,
    height: f64,
    /// The points of the open mark: where they lie in the part, nm, and their time.
    line: Vec<([f64; 3], Point, i64)>,
}

impl Maker<'_> {
    fn add(&mut self, spot: &program::Spot, us: i64) {
        let at = spot.part.map(|v| v * NM_PER_MM);
        let hit = self.beams.hit(at, spot.up, self.height);
        self.height = hit.map_or(self.height, |hit| hit.height);
        let part = [0, 1, 2].map(|k| at[k] + self.height * spot.up[k]);
        let incidence_deg = hit.map_or(0.0, |hit| hit.cos.clamp(-1.0, 1.0).acos().to_degrees()) as f32;
        let point = Point { at: [0; 3], defocus_um: (self.height / 1e3) as f32, incidence_deg };
        self.line.push((part, point, us));
    }

    fn end(&mut self, mark: Option<program::Mark>) {
        let line = std::mem::take(&mut self.line);
        let (Some(mark), Some(first)) = (mark, line.first()) else { return };
        let bare: Vec<[f64; 3]> = line.iter().map(|l| l.0).collect();
        let (mut keep, mut spans) = (Vec::new(), Vec::new());
        thin(&bare, self.limit, &mut keep, &mut spans);
        let scene = &mut *self.scene;
        let full = scene.groups.last().is_none_or(|g| g.points.len() >= GROUP || g.marks.len() >= GROUP_MARKS);
        if full {
            let origin = first.0.map(|v| v.round() / NM_PER_MM);
            let clock = first.2 as f64 / 1e6;
            scene.groups.push(Group { clock_s: [clock; 3], ..Group::new(Frame::upright(origin)) });
        }
        let Some(group) = scene.groups.last_mut() else { return };
        let origin = group.frame.origin.map(|v| v * NM_PER_MM);
        let length_mm = bare.windows(2).map(|w| (w[1][0] - w[0][0]).hypot(w[1][1] - w[0][1])).sum::<f64>() / NM_PER_MM;
        let (from, mut steepest) = (group.points.len(), 0f32);
        for (k, (at, point, us)) in line.iter().enumerate().rev() {
            steepest = steepest.max(point.incidence_deg);
            if keep[k] {
                let at = [0, 1, 2].map(|i| (at[i] - origin[i]).round() as i32);
                group.points.push(Point { at, incidence_deg: steepest, ..*point });
                group.times_us.push(*us);
                steepest = 0.0;
            }
        }
        group.points[from..].reverse();
        group.times_us[from..].reverse();
        scene.thinned.points += keep.iter().filter(|k| !**k).count();
        let len = (group.points.len() - from) as u32;
        group.marks.push(Mark { pen: mark.pen, length_mm, first: from as u32, len });
        group.clock_s[2] = line.last().map_or(group.clock_s[2], |l| l.2 as f64 / 1e6);
        let (begun, others) = (group.clock_s[0], scene.groups.len());
        // The head is under way to a run from the end of the one before.
        if others > 1 {
            let before = scene.groups[others - 2].clock_s[2];
            scene.groups[others - 1].clock_s[0] = before.min(begun);
        } else {
            scene.groups[0].clock_s[0] = 0.0;
        }
    }
}

/// The head at moves evenly spread over the program.
fn motion(program: &program::Program, spots: &impl Fn(&AxisCommands) -> program::Spot) -> Motion {
    let count = program.moves.len();
    let every = count.div_ceil(SAMPLES).max(1);
    let sample = |us: i64, at: &AxisCommands, is_on: bool| {
        let mut centre = *at;
        (centre[5], centre[6]) = (0, 0);
        let (spot, centre) = (spots(at), spots(&centre));
        MotionSample { time_s: us as f64 / 1e6, centre: centre.part, up: centre.up, spot: spot.part, is_on }
    };
    let mut samples = vec![sample(0, &program.start, false)];
    for (i, m) in program.moves.iter().enumerate() {
        if (i + 1) % every == 0 || i + 1 == count {
            samples.push(sample(m.us, &m.to, m.mark.is_some()));
        }
    }
    Motion { samples }
}
