//! The scene of a stepped job.

use super::beam::Beams;
use super::relief::Relief;
use super::thin::thin;
use super::{Frame, Group, Mark, Point, Scene, Thinned, unmarked};
use terrace_core::geom::{FieldPoint, P2, P3, Turn, Turned};
use terrace_core::machine::Origin;
use terrace_core::math;
use terrace_core::parallel;
use terrace_core::program::{Block, PenId, stroke_mm};
use terrace_input::surface::Surface;
use terrace_plan::plan::{SteppedPlan, clock_of_program};

/// Lines stray from the marks by this share of the spot at most.
const SHARE_OF_SPOT: f64 = 0.05;
/// Lines stray from the marks by this share of the depth range at most.
const SHARE_OF_DEPTH: f64 = 0.02;

/// Distance of the places at which the beam is followed along a mark on a tilted part, nm.
const SPACING: f64 = 200_000.0;

/// The scene of a plan. `relief` tells holes from what lies outside the part.
pub fn of_stepped(plan: &SteppedPlan, relief: &Relief) -> Scene {
    let program = plan.checked.program();
    let limit = (SHARE_OF_SPOT * plan.machine.lens.spot.as_mm() * 1e6).min(SHARE_OF_DEPTH * plan.depth.f64());
    let mut scene = Scene {
        unmarked: unmarked::of_stepped(plan, relief),
        thinned: Thinned { within_um: limit / 1e3, points: 0 },
        ..Scene::default()
    };
    let clocks = clock_of_program(&plan.machine, program);
    let groups = parallel::map(program.blocks.len(), |i| group_of(&program.blocks[i], plan, limit));
    for ((group, left_out), clock_s) in groups.into_iter().zip(clocks) {
        scene.thinned.points += left_out;
        scene.groups.push(Group { clock_s, ..group });
    }
    scene
}

/// The marks of a block, within `limit` nm, and how many points are left out.
fn group_of(block: &Block, plan: &SteppedPlan, limit: f64) -> (Group, usize) {
    let program = plan.checked.program();
    let mut builder = GroupBuilder::new(&plan.inputs.surface, FieldPose::of(block, plan), limit);
    builder.marks.reserve_exact(block.strokes.len());
    for stroke in program.strokes_of(block) {
        builder.mark(stroke.pen, program.points_of(stroke));
    }
    let GroupBuilder { field, marks, mut points, left_out, .. } = builder;
    points.shrink_to_fit();
    (Group { marks, points, ..Group::new(field.frame) }, left_out)
}

/// Where the field of a block lies over the part as the pass finds it.
struct FieldPose {
    frame: Frame,
    /// How the part is turned, if it is.
    turn: Option<Turn>,
    /// Centre and focal plane, nm, turned part frame.
    centre: [f64; 3],
}

impl FieldPose {
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
    [stop.centre.x, stop.centre.y, (stop.lpfl + lowered).0].map(|v| v as f64)
}

/// How the part is turned at a block.
pub(crate) fn turn_at(block: &Block, plan: &SteppedPlan) -> Turn {
    let Origin([x, y, z]) = plan.checked.origins()[block.setup.index()];
    plan.machine.turn(block.stop.tilt, Origin([x, y, z - plan.job.passes.lowered(block.pass).0]))
}

/// A point of a mark on the surface.
#[derive(Clone, Copy)]
struct SurfacePoint {
    /// In the frame of the block, nm.
    p: [f64; 3],
    /// Tangent of the incidence from here to the next point.
    tan: f64,
}

/// The marks of a block while they are followed over the surface.
struct GroupBuilder<'a> {
    beams: Beams<'a>,
    field: FieldPose,
    /// How far a line may stray from its mark, nm.
    limit: f64,
    marks: Vec<Mark>,
    points: Vec<Point>,
    left_out: usize,
    /// Scratch: the points of the mark before it is thinned.
    line: Vec<SurfacePoint>,
    /// Scratch: the places of these.
    places: Vec<[f64; 3]>,
    keep: Vec<bool>,
    spans: Vec<(usize, usize)>,
    /// Height of the last point.
    height: f64,
}

impl<'a> GroupBuilder<'a> {
    fn new(surface: &'a Surface, field: FieldPose, limit: f64) -> Self {
        Self {
            beams: Beams::new(surface),
            field,
            limit,
            marks: Vec::new(),
            points: Vec::new(),
            left_out: 0,
            line: Vec::new(),
            places: Vec::new(),
            keep: Vec::new(),
            spans: Vec::new(),
            height: 0.0,
        }
    }

    /// Appends the mark of a stroke.
    fn mark(&mut self, pen: PenId, points: &[FieldPoint]) {
        self.line.clear();
        match self.field.turn {
            None => self.follow_upright(points),
            Some(turn) => self.follow_tilted(&turn, points),
        }
        let first = self.points.len() as u32;
        self.append_thinned();
        let len = self.points.len() as u32 - first;
        self.marks.push(Mark { pen, length_mm: stroke_mm(points), first, len });
    }

    /// Appends the points of the line that are needed to keep it within the limit.
    fn append_thinned(&mut self) {
        let first = self.points.len();
        self.places.clear();
        self.places.extend(self.line.iter().map(|point| point.p));
        thin(&self.places, self.limit, &mut self.keep, &mut self.spans);
        let mut steepest = 0f64;
        // What is left out between two points is as steep as the steepest of it.
        for (&SurfacePoint { p, tan }, &is_kept) in self.line.iter().zip(&self.keep).rev() {
            steepest = steepest.max(tan);
            if is_kept {
                let at = p.map(|v| v.round() as i32);
                let incidence_deg = math::atan(steepest).to_degrees() as f32;
                self.points.push(Point { at, defocus_um: at[2] as f32 / 1e3, incidence_deg });
                steepest = 0.0;
            }
        }
        self.points[first..].reverse();
        self.left_out += self.keep.iter().filter(|is_kept| !**is_kept).count();
    }

    /// Follows a stroke over the surface under a beam that is not tilted.
    fn follow_upright(&mut self, points: &[FieldPoint]) {
        for w in points.windows(2) {
            self.follow_segment(&w[0], &w[1]);
        }
        if let [dot] = points {
            self.follow_segment(dot, dot);
        }
        self.line.dedup_by(|b, a| a.p == b.p);
        if points.len() > 1 && self.line.len() == 1 {
            let last = points[points.len() - 1];
            let p = [f64::from(last.x), f64::from(last.y), self.height];
            self.line.push(SurfacePoint { p, tan: self.line[0].tan });
        }
    }

    /// Appends the points of one segment, from `p` to `q`; of a dot they are the same.
    fn follow_segment(&mut self, p: &FieldPoint, q: &FieldPoint) {
        let [cx, cy, lpfl] = self.field.centre;
        let part = |p: &FieldPoint| P2::new(cx as i64 + i64::from(p.x), cy as i64 + i64::from(p.y));
        let flat = |t: f64| [(p.x, q.x), (p.y, q.y)].map(|(a, b)| f64::from(a) + t * (f64::from(b) - f64::from(a)));
        let before = self.line.len();
        let mut last_piece = None;
        let Self { beams, line, .. } = self;
        beams.along(part(p), part(q), |piece| {
            let [x, y] = flat(piece.t0);
            line.push(SurfacePoint { p: [x, y, piece.z0 - lpfl], tan: piece.slope2.sqrt() });
            last_piece = Some(piece);
        });
        // A rim may be missed by rounding: the line is drawn on at the height before it.
        self.height = last_piece.as_ref().map_or(self.height, |piece| piece.z1 - lpfl);
        let [px, py] = [f64::from(p.x), f64::from(p.y)];
        if let Some(first) = self.line.get_mut(before) {
            (first.p[0], first.p[1]) = (px, py);
        } else {
            self.line.push(SurfacePoint { p: [px, py, self.height], tan: 0.0 });
        }
        if p != q {
            // The end of the last segment stays; that of another is the begin of the next.
            let tan = last_piece.map_or(0.0, |piece| piece.slope2.sqrt());
            self.line.push(SurfacePoint { p: [f64::from(q.x), f64::from(q.y), self.height], tan });
        }
    }

    /// Follows a stroke over the surface under a tilted beam. Marks end where the part turns away: the incidence at
    /// their ends is that a little inside of them.
    fn follow_tilted(&mut self, turn: &Turn, points: &[FieldPoint]) {
        /// As a share of a step.
        const INSIDE: f64 = 0.01;
        let flat = |p: &FieldPoint| [f64::from(p.x), f64::from(p.y)];
        for (i, w) in points.windows(2).enumerate() {
            let [a, b] = [flat(&w[0]), flat(&w[1])];
            let steps = (math::hypot(b[0] - a[0], b[1] - a[1]) / SPACING).ceil().max(1.0) as usize;
            let after = |k: f64| [0, 1].map(|c| a[c] + k / steps as f64 * (b[c] - a[c]));
            if i == 0 {
                self.add_tilted(turn, a, Some(after(INSIDE)));
            }
            for k in 1..=steps {
                let is_end = k == steps && i + 2 == points.len();
                self.add_tilted(turn, after(k as f64), is_end.then(|| after(k as f64 - INSIDE)));
            }
        }
        if let [dot] = points {
            self.add_tilted(turn, flat(dot), None);
        }
    }

    /// Appends the point where the beam through `p` of the field, nm, meets the part; `inside` is the place at which
    /// its incidence is measured, if that is another.
    fn add_tilted(&mut self, turn: &Turn, p: [f64; 2], inside: Option<[f64; 2]>) {
        let [cx, cy, lpfl] = self.field.centre;
        let part = |[x, y]: [f64; 2]| turn.back(P3::<Turned>::new([cx + x, cy + y, lpfl])).at;
        let hit = self.beams.hit(part(p), turn.up(), self.height);
        self.height = hit.map_or(self.height, |hit| hit.height);
        let hit = inside.map_or(hit, |q| self.beams.hit(part(q), turn.up(), self.height));
        // Of a beam that grazes the part the tangent has no end.
        let tan = hit.map_or(0.0, |hit| math::tan(math::acos(hit.cos.clamp(1e-6, 1.0))));
        self.line.push(SurfacePoint { p: [p[0], p[1], self.height], tan });
    }
}
