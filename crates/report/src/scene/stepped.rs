//! The scene of a stepped job.

use super::beam::Beams;
use super::relief::Relief;
use super::thin::thin;
use super::{Frame, Group, Mark, Point, Scene, Thinned, unmarked};
use terrace_core::geom::{FieldPoint, P2, P3, Turn, Turned};
use terrace_core::machine::Origin;
use terrace_core::parallel;
use terrace_core::program::{Block, stroke_mm};
use terrace_input::surface::Surface;
use terrace_plan::plan::{SteppedPlan, clock_of_program};

/// Lines stray from the marks by this share of the spot at most, and by this one of the depth range.
const OF_SPOT: f64 = 0.05;
const OF_DEPTH: f64 = 0.02;

/// Distance of the places at which the beam is followed along a mark on a tilted part, nm.
const SPACING: f64 = 200_000.0;

/// The scene of a plan. `relief` tells holes from what lies outside the part.
pub fn of_stepped(plan: &SteppedPlan, relief: &Relief) -> Scene {
    let program = plan.checked.program();
    let limit = (OF_SPOT * plan.machine.lens.spot.as_mm() * 1e6).min(OF_DEPTH * plan.depth.f64());
    let make = |block: &Block| {
        let mut maker = Maker::new(&plan.inputs.surface, Lies::of(block, plan), limit);
        maker.marks.reserve_exact(block.strokes.len());
        for stroke in program.strokes_of(block) {
            maker.mark(stroke.pen, program.points_of(stroke));
        }
        let Maker { lies, marks, mut points, left_out, .. } = maker;
        points.shrink_to_fit();
        (Group { marks, points, ..Group::new(lies.frame) }, left_out)
    };
    let mut scene = Scene {
        unmarked: unmarked::of_stepped(plan, relief),
        thinned: Thinned { within_um: limit / 1e3, points: 0 },
        ..Scene::default()
    };
    let clocks = clock_of_program(&plan.machine, program);
    let made = parallel::map(program.blocks.len(), |i| make(&program.blocks[i]));
    for ((group, left_out), clock_s) in made.into_iter().zip(clocks) {
        scene.thinned.points += left_out;
        scene.groups.push(Group { clock_s, ..group });
    }
    scene
}

/// Where the field of a block lies over the part as the pass finds it.
struct Lies {
    frame: Frame,
    /// How the part is turned, if it is.
    turn: Option<Turn>,
    /// Centre and focal plane, nm, turned part frame.
    centre: [f64; 3],
}

impl Lies {
    fn of(block: &Block, plan: &SteppedPlan) -> Self {
        let centre = centre(block, plan);
        let turn = (!block.stop.tilt.is_upright()).then(|| turn_at(block, plan));
        let frame = match &turn {
            Some(turn) => Frame::turned(turn, centre),
            None => Frame::upright(centre.map(|v| v / 1e6)),
        };
        Self { frame, turn, centre }
    }
}

/// Centre of a block and its focal plane over the surface as it is in the file: passes that lower it do not show.
fn centre(block: &Block, plan: &SteppedPlan) -> [f64; 3] {
    let lowered = plan.job.passes.lowered(block.pass);
    let stop = &block.stop;
    [stop.centre.x, stop.centre.y, (stop.focus + lowered).0].map(|v| v as f64)
}

/// How the part is turned at a block.
pub(crate) fn turn_at(block: &Block, plan: &SteppedPlan) -> Turn {
    let Origin([x, y, z]) = plan.checked.origins()[block.setup.index()];
    plan.machine.turn(block.stop.tilt, Origin([x, y, z - plan.job.passes.lowered(block.pass).0]))
}

/// The marks of a block.
struct Maker<'a> {
    beams: Beams<'a>,
    lies: Lies,
    limit: f64,
    marks: Vec<Mark>,
    points: Vec<Point>,
    left_out: usize,
    /// Room to work in: positions in the frame of the block, nm, the tangent of the incidence after each.
    line: Vec<([f64; 3], f64)>,
    bare: Vec<[f64; 3]>,
    keep: Vec<bool>,
    spans: Vec<(usize, usize)>,
    /// Height of the last point.
    height: f64,
}

impl<'a> Maker<'a> {
    fn new(surface: &'a Surface, lies: Lies, limit: f64) -> Self {
        Self {
            beams: Beams::new(surface),
            lies,
            limit,
            marks: Vec::new(),
            points: Vec::new(),
            left_out: 0,
            line: Vec::new(),
            bare: Vec::new(),
            keep: Vec::new(),
            spans: Vec::new(),
            height: 0.0,
        }
    }

    fn mark(&mut self, pen: terrace_core::program::PenId, points: &[FieldPoint]) {
        self.line.clear();
        match self.lies.turn {
            None => self.upright(points),
            Some(turn) => self.leaning(&turn, points),
        }
        let first = self.points.len() as u32;
        self.bare.clear();
        self.bare.extend(self.line.iter().map(|(at, _)| *at));
        thin(&self.bare, self.limit, &mut self.keep, &mut self.spans);
        let mut steepest = 0f64;
        // What is left out between two points is as steep as the steepest of it.
        for (k, &(at, tan)) in self.line.iter().enumerate().rev() {
            steepest = steepest.max(tan);
            if self.keep[k] {
                let at = at.map(|v| v.round() as i32);
                let incidence_deg = steepest.atan().to_degrees() as f32;
                self.points.push(Point { at, defocus_um: at[2] as f32 / 1e3, incidence_deg });
                steepest = 0.0;
            }
        }
        self.points[first as usize..].reverse();
        self.left_out += self.keep.iter().filter(|k| !**k).count();
        let len = self.points.len() as u32 - first;
        self.marks.push(Mark { pen, length_mm: stroke_mm(points), first, len });
    }

    /// Along the surface under a beam that does not lean.
    fn upright(&mut self, points: &[FieldPoint]) {
        let [cx, cy, focus] = self.lies.centre;
        let part = |p: &FieldPoint| P2::new(cx as i64 + i64::from(p.x), cy as i64 + i64::from(p.y));
        let Self { beams, line, height, .. } = self;
        let flat = |p: &FieldPoint, t: f64, q: &FieldPoint| {
            [(p.x, q.x), (p.y, q.y)].map(|(a, b)| f64::from(a) + t * (f64::from(b) - f64::from(a)))
        };
        let pairs = points.windows(2).map(|w| (&w[0], &w[1]));
        let dot = (points.len() == 1).then(|| (&points[0], &points[0]));
        for (p, q) in pairs.chain(dot) {
            let before = line.len();
            let mut end = None;
            beams.along(part(p), part(q), |[(t0, z0), (t1, z1)], tan| {
                let [x, y] = flat(p, t0, q);
                line.push(([x, y, z0 - focus], tan));
                end = Some((t1, z1 - focus, tan));
            });
            // A rim may be missed by rounding: the line is drawn on at the height before it.
            *height = end.map_or(*height, |(_, z, _)| z);
            if let Some(first) = line.get_mut(before) {
                (first.0[0], first.0[1]) = (f64::from(p.x), f64::from(p.y));
            } else {
                line.push(([f64::from(p.x), f64::from(p.y), *height], 0.0));
            }
            if p != q {
                // The end of the last segment stays; that of another is the begin of the next.
                let tan = end.map_or(0.0, |(_, _, tan)| tan);
                line.push(([f64::from(q.x), f64::from(q.y), *height], tan));
            }
        }
        line.dedup_by(|b, a| a.0 == b.0);
        if points.len() > 1 && line.len() == 1 {
            let last = points[points.len() - 1];
            line.push(([f64::from(last.x), f64::from(last.y), *height], line[0].1));
        }
    }

    /// Along the surface under a beam that leans. Marks end where the part turns away: what their ends lie on is looked
    /// at a little inside of them.
    fn leaning(&mut self, turn: &Turn, points: &[FieldPoint]) {
        const INSIDE: f64 = 0.01;
        let up = turn.up();
        let look = |maker: &mut Self, at: [f64; 2], inside: Option<[f64; 2]>| {
            let [cx, cy, focus] = maker.lies.centre;
            let place = |[x, y]: [f64; 2]| turn.back(P3::<Turned>::new([cx + x, cy + y, focus])).at;
            let hit = maker.beams.hit(place(at), up, maker.height);
            maker.height = hit.map_or(maker.height, |hit| hit.height);
            let hit = inside.map_or(hit, |p| maker.beams.hit(place(p), up, maker.height));
            let tan = hit.map_or(0.0, |hit| hit.cos.clamp(1e-6, 1.0).acos().tan());
            maker.line.push(([at[0], at[1], maker.height], tan));
        };
        let flat = |p: &FieldPoint| [f64::from(p.x), f64::from(p.y)];
        for (i, w) in points.windows(2).enumerate() {
            let [a, b] = [flat(&w[0]), flat(&w[1])];
            let steps = ((b[0] - a[0]).hypot(b[1] - a[1]) / SPACING).ceil().max(1.0) as usize;
            let at = |k: f64| [0, 1].map(|c| a[c] + k / steps as f64 * (b[c] - a[c]));
            if i == 0 {
                look(self, a, Some(at(INSIDE)));
            }
            for k in 1..=steps {
                let ends = k == steps && i + 2 == points.len();
                look(self, at(k as f64), ends.then(|| at(k as f64 - INSIDE)));
            }
        }
        if let [dot] = points {
            look(self, flat(dot), None);
        }
    }
}
