//! The scene of an on-the-fly job.

use super::beam::Beams;
use super::relief::Relief;
use super::thin::thin;
use super::{Frame, Group, Mark, Point, Scene, Thinned, unmarked};
use terrace_core::diag::Error;
use terrace_core::geom::{NM_PER_MM, UnitVector};
use terrace_core::math;
use terrace_plan::on_the_fly::program::{self, AxisCommands};
use terrace_plan::plan::OnTheFlyPlan;

/// Points of a group, as many as a tile of a picture should have.
const GROUP: usize = 4096;
/// Marks of a group, so that those of few points are grouped by place too.
const GROUP_MARKS: usize = 32;
/// Samples of the motion that are kept.
const SAMPLES: usize = 40_000;
/// Lines stray from the marks by this share of the spot at most.
const SHARE_OF_SPOT: f64 = 0.05;
/// Lines stray from the marks by this share of half the depth range at most: of all of it that is the share of stepped
/// jobs.
const SHARE_OF_HALF_DEPTH: f64 = 0.04;

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
    let limit = (SHARE_OF_SPOT * plan.machine.lens.spot.as_mm() * NM_PER_MM).min(SHARE_OF_HALF_DEPTH * half_depth);
    let spots = program.spots(&plan.machine)?;
    let mut scene = Scene {
        unmarked: unmarked::of_on_the_fly(plan, relief),
        thinned: Thinned { within_um: limit / 1e3, points: 0 },
        motion: Some(motion(program, &spots)),
        ..Scene::default()
    };
    let mut builder = SceneBuilder {
        beams: Beams::new(&plan.inputs.surface),
        scene: &mut scene,
        limit,
        height: 0.0,
        line: Vec::new(),
    };
    // The mark of the step before.
    let mut open_mark = None;
    for (us, from, step) in program.steps() {
        if open_mark.is_some() && step.mark != open_mark {
            builder.end_mark(open_mark);
        }
        if step.mark.is_some() {
            if builder.line.is_empty() {
                builder.add(&spots(from), us);
            }
            builder.add(&spots(&step.to), step.us);
        }
        open_mark = step.mark;
    }
    builder.end_mark(open_mark);
    Ok(scene)
}

/// A point of the open mark.
struct LinePoint {
    /// Where it lies in the part, nm.
    p: [f64; 3],
    /// Its defocus and incidence; its place in a group is not known yet.
    point: Point,
    /// When the beam is there, microseconds from the program's start.
    us: i64,
}

/// The scene while marks are followed over the surface.
struct SceneBuilder<'a> {
    beams: Beams<'a>,
    scene: &'a mut Scene,
    /// How far a line may stray from its mark, nm.
    limit: f64,
    /// Height of the last point over the focal plane, along the beam, nm.
    height: f64,
    /// The points of the open mark.
    line: Vec<LinePoint>,
}

impl SceneBuilder<'_> {
    /// Appends the point of the part under a spot to the open mark.
    fn add(&mut self, spot: &program::Spot, us: i64) {
        let (focal_point, UnitVector(up)) = (spot.part.mm.map(|v| v * NM_PER_MM), spot.up);
        let hit = self.beams.hit(focal_point, up, self.height);
        self.height = hit.map_or(self.height, |hit| hit.height);
        let p = [0, 1, 2].map(|k| focal_point[k] + self.height * up[k]);
        let incidence_deg = hit.map_or(0.0, |hit| math::acos(hit.cos.clamp(-1.0, 1.0)).to_degrees()) as f32;
        let point = Point { at: [0; 3], defocus_um: (self.height / 1e3) as f32, incidence_deg };
        self.line.push(LinePoint { p, point, us });
    }

    /// Ends the open mark, if there is one, and appends it to a group.
    fn end_mark(&mut self, mark: Option<program::Mark>) {
        let line = std::mem::take(&mut self.line);
        let (Some(mark), Some(first), Some(last)) = (mark, line.first(), line.last()) else { return };
        let places: Vec<[f64; 3]> = line.iter().map(|point| point.p).collect();
        let mut keep = Vec::new();
        thin(&places, self.limit, &mut keep, &mut Vec::new());
        let Some(group) = self.open_group(first) else { return };
        let from = group.points.len();
        append_thinned(group, &line, &keep);
        let length = places.windows(2).map(|w| math::hypot(w[1][0] - w[0][0], w[1][1] - w[0][1])).sum::<f64>();
        let len = (group.points.len() - from) as u32;
        group.marks.push(Mark { pen: mark.pen, length_mm: length / NM_PER_MM, first: from as u32, len });
        group.clock_s[2] = last.us as f64 / 1e6;
        self.scene.thinned.points += keep.iter().filter(|is_kept| !**is_kept).count();
        self.set_approach();
    }

    /// The last group, or a new one around `first` where that is full.
    fn open_group(&mut self, first: &LinePoint) -> Option<&mut Group> {
        let groups = &mut self.scene.groups;
        let is_full = groups.last().is_none_or(|g| g.points.len() >= GROUP || g.marks.len() >= GROUP_MARKS);
        if is_full {
            let origin = first.p.map(|v| v.round() / NM_PER_MM);
            let clock = first.us as f64 / 1e6;
            groups.push(Group { clock_s: [clock; 3], ..Group::new(Frame::upright(origin)) });
        }
        groups.last_mut()
    }

    /// The head is under way to the last group from the end of the one before, to the first from the program's start.
    fn set_approach(&mut self) {
        match self.scene.groups.as_mut_slice() {
            [.., before, last] => last.clock_s[0] = before.clock_s[2].min(last.clock_s[0]),
            [first] => first.clock_s[0] = 0.0,
            [] => {}
        }
    }
}

/// Appends the points of a line that are kept, and their times, to a group.
fn append_thinned(group: &mut Group, line: &[LinePoint], keep: &[bool]) {
    let origin = group.frame.origin.map(|v| v * NM_PER_MM);
    let from = group.points.len();
    // From the line's end back: a point that is kept takes the steepest incidence of what is left out between it and
    // the next one, which has been gone through by then. Turned round at the end.
    let mut steepest = 0f32;
    for (LinePoint { p, point, us }, &is_kept) in line.iter().zip(keep).rev() {
        steepest = steepest.max(point.incidence_deg);
        if is_kept {
            // The axes of these groups are those of the part.
            let at = [0, 1, 2].map(|i| (p[i] - origin[i]).round() as i32);
            group.points.push(Point { at, incidence_deg: steepest, ..*point });
            group.times_us.push(*us);
            steepest = 0.0;
        }
    }
    group.points[from..].reverse();
    group.times_us[from..].reverse();
}

/// The head at moves evenly spread over the program.
fn motion(program: &program::Program, spots: &impl Fn(&AxisCommands) -> program::Spot) -> Motion {
    let count = program.moves.len();
    let every = count.div_ceil(SAMPLES).max(1);
    let mut samples = vec![motion_sample(spots, 0, &program.start)];
    for (i, m) in program.moves.iter().enumerate() {
        if (i + 1) % every == 0 || i + 1 == count {
            samples.push(MotionSample { is_on: m.mark.is_some(), ..motion_sample(spots, m.us, &m.to) });
        }
    }
    Motion { samples }
}

/// The head at these commands, the laser off until then.
fn motion_sample(spots: impl Fn(&AxisCommands) -> program::Spot, us: i64, commands: &AxisCommands) -> MotionSample {
    // With u and v at 0 the beam goes through the centre of the field.
    let mut at_centre = *commands;
    (at_centre[5], at_centre[6]) = (0, 0);
    let spot = spots(commands);
    let centre = spots(&at_centre);
    MotionSample { time_s: us as f64 / 1e6, centre: centre.part.mm, up: centre.up.0, spot: spot.part.mm, is_on: false }
}
