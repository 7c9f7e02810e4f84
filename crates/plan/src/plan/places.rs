//! Where the stops of a candidate stand: each upright one moves inside the room that its marks leave in the field and in
//! the depth of focus, so that the stage moves little and marks lie about the axis; then the part is laid so that they
//! lie in the middle of the travel.
//!
//! Consumes a candidate without strokes. Promises that every stop still admits its marks: a stop, and with it what it
//! admits, moves by whole increments. The focal planes of a job with `level = "mean"`, of a job whose levels must come
//! one after another, and of a zoom optic stay where they are; stops that share a standstill move together.
//!
//! What a stop admits is the window around its centre. A mark that was left out because it is short (see `split`) must
//! stay out of the windows that it was out of, or such a stop would have marked it, and stay in that of its own.

use std::ops::Range;

use super::candidate::Candidate;
use super::cut::{LeftOut, Marks};
use super::extent::{Extent, Near};
use super::lifts::Stage;
use crate::order::slide::{self, MoveRules, Placed, TourStop};
use crate::order::stops::{self, HeightOrder};
use crate::split::Sliver;
use terrace_core::geom::{Box2, Nm, P2};
use terrace_core::machine::{Commanded, Origin};
use terrace_core::program::{Block, Stop};
use terrace_input::job::Level;

/// What the places of stops follow from, beside the candidate.
pub(super) struct Site<'a> {
    pub(super) stage: &'a Stage<'a>,
    pub(super) level: Level,
    /// Whether focal planes stay where that says.
    pub(super) keeps_focus: bool,
    /// Depth range of a stop.
    pub(super) depth: Nm,
    /// Window of a stop, and the pitch of the sections.
    pub(super) window: [Nm; 2],
    pub(super) pitch: [Nm; 2],
    /// Whether the part may lie anywhere.
    pub(super) is_loose: bool,
    /// Whether marks are left out by their length alone.
    pub(super) min_mark: bool,
}

/// How near to the border of a window a mark that was left out counts as on it, nm.
const BESIDE: i64 = 1_000;

/// Tours that are tried again with stops at their new places.
const TOURS: usize = 2;

/// The share of the time that another tour must save.
const LEAST_SHARE: f64 = 1e-3;

/// Moves the stops of a candidate.
pub(super) fn place(made: &mut Candidate, marks: &Marks<'_>, site: &Site<'_>) {
    if made.program.blocks.is_empty() {
        return;
    }
    let mut places = Places::new(made, marks, site);
    places.slide(made, site);
    places.apply(made, site);
}

/// The standstills of a candidate and where they may be.
struct Places {
    /// Blocks of each, in the order of the program.
    blocks: Vec<Range<usize>>,
    /// Where each stood.
    home: Vec<[i64; 3]>,
    /// In the order of the tour.
    tour_stops: Vec<TourStop>,
    /// Which standstill each of them is.
    order: Vec<usize>,
}

impl Places {
    fn new(made: &Candidate, marks: &Marks<'_>, site: &Site<'_>) -> Self {
        let program = &made.program;
        let mut blocks: Vec<Range<usize>> = Vec::new();
        for (i, b) in program.blocks.iter().enumerate() {
            match blocks.last_mut() {
                Some(last) if b.is_reached_by_zoom(&program.blocks[i - 1]) => last.end = i + 1,
                _ => blocks.push(i..i + 1),
            }
        }
        let extents: Vec<Extent> = made.ids.iter().map(|id| Extent::of(&marks.of_stops[id.index()])).collect();
        let limits = site.beside_slivers(made, marks, &extents);
        let mut setup = None;
        let tour_stop = |range: &Range<usize>| {
            let first = &program.blocks[range.start];
            let is_first = setup.replace(first.setup).is_some_and(|before| before != first.setup);
            site.tour_stop(&program.blocks[range.clone()], &extents[range.clone()], &limits[range.clone()], is_first)
        };
        let mut tour_stops: Vec<TourStop> = blocks.iter().map(tour_stop).collect();
        site.within_travel(&mut tour_stops);
        let home = blocks.iter().map(|range| program.blocks[range.start].stage.0).collect();
        let order = (0..blocks.len()).collect();
        Self { blocks, home, tour_stops, order }
    }

    /// Slides the standstills, and looks for a better tour of the new places.
    fn slide(&mut self, made: &Candidate, site: &Site<'_>) {
        let machine = site.stage.machine;
        let blocks = &made.program.blocks;
        let is_later = site.stage.start.pass.0 > 0;
        let (starts, home): (Vec<&Block>, _) = (self.blocks.iter().map(|r| &blocks[r.start]).collect(), &self.home);
        let stop_at = |(n, at): Placed| site.stop_at(starts[n], at, home[n]);
        let origin = |n: usize| made.setups.origin(made.used.cell(starts[n].setup), made.origin);
        let meets = site.meets(&starts, &self.tour_stops);
        let lifts = |order: &[usize], (a, b): (Placed, Placed)| {
            let [a, b] = [a, b].map(|(n, at)| (order[n], at));
            let stops = [a, b].map(stop_at);
            site.stage.lifts_between((&stops[0], Commanded(a.1)), (&stops[1], Commanded(b.1)), origin(a.0))
        };
        let is_clear = |order: &[usize], (n, at): Placed| {
            let n = order[n];
            at == home[n] || site.stage.is_clear(&stop_at((n, at)))
        };
        let step = machine.increment_nm().0;
        let slid = |tour_stops: &mut Vec<TourStop>, order: &[usize]| {
            let lifts = |legs| lifts(order, legs);
            let is_clear = |at| is_clear(order, at);
            let from = is_later.then_some(site.stage.start.from.0);
            let rules = MoveRules {
                machine,
                from,
                lifts: meets.then_some(&lifts as &dyn Fn((Placed, Placed)) -> bool),
                is_clear: meets.then_some(&is_clear as &dyn Fn(Placed) -> bool),
            };
            slide::slide(tour_stops, &rules, step)
        };
        let mut time = slid(&mut self.tour_stops, &self.order);
        let has_zoom = machine.most_focus_shift() > Nm(0);
        if has_zoom || starts.iter().any(|b| !b.stop.tilt.is_upright()) {
            return;
        }
        for _ in 0..TOURS {
            let at: Vec<Commanded> = self.tour_stops.iter().map(|s| Commanded(s.at)).collect();
            let way = self.tour(&at, site, |a, b| meets && lifts(&self.order, ((a, at[a].0), (b, at[b].0))));
            let order: Vec<usize> = way.iter().map(|&i| self.order[i]).collect();
            let mut tour_stops: Vec<TourStop> = way
                .iter()
                .enumerate()
                .map(|(i, &from)| TourStop { is_first: self.tour_stops[i].is_first, ..self.tour_stops[from].clone() })
                .collect();
            let next = slid(&mut tour_stops, &order);
            if next > time * (1.0 - LEAST_SHARE) {
                break;
            }
            (time, self.tour_stops, self.order) = (next, tour_stops, order);
        }
    }

    /// Another tour of the stops, each set-up by itself.
    fn tour(&self, at: &[Commanded], site: &Site<'_>, lifts: impl Fn(usize, usize) -> bool + Sync) -> Vec<usize> {
        let mut way: Vec<usize> = Vec::with_capacity(at.len());
        let mut first = 0;
        while first < at.len() {
            let more = self.tour_stops[first + 1..].iter().take_while(|s| !s.is_first).count();
            let range = first..first + 1 + more;
            let from = way.last().map_or(site.stage.start.from, |&last| {
                Commanded([at[last][0], at[last][1], site.stage.machine.retract_z().0])
            });
            let lifts = |a: usize, b: usize| lifts(first + a, first + b);
            let stage = stops::Stage { machine: site.stage.machine, from, lifts: Some(&lifts) };
            let tour = stops::tour(&at[range.clone()], &stage, site.stage.climb(), stops::EFFORT);
            way.extend(tour.into_iter().map(|i| first + i));
            first = range.end;
        }
        way
    }

    /// Writes the places into the program, in the order of the tour.
    fn apply(self, made: &mut Candidate, site: &Site<'_>) {
        let Self { blocks: ranges, home, tour_stops, order } = self;
        let moved = site.centring_shift(&tour_stops);
        let Origin(origin) = made.origin;
        made.origin = Origin([0, 1, 2].map(|k| origin[k] + site.sign(k) * moved[k]));
        let order_of_blocks: Vec<usize> = order.iter().flat_map(|&n| ranges[n].clone()).collect();
        made.program.blocks = order_of_blocks.iter().map(|&i| made.program.blocks[i].clone()).collect();
        made.ids = order_of_blocks.iter().map(|&i| made.ids[i]).collect();
        made.worst_defocus = Nm(0);
        let mut first = 0;
        for (&n, tour_stop) in order.iter().zip(&tour_stops) {
            let count = ranges[n].len();
            let by = [0, 1, 2].map(|k| site.sign(k) * (tour_stop.at[k] - home[n][k]));
            for block in &mut made.program.blocks[first..first + count] {
                let centre = block.stop.centre;
                block.stop.centre = P2::new(centre.x + by[0], centre.y + by[1]);
                block.stop.focus += Nm(by[2]);
                block.stage = Commanded([0, 1, 2].map(|k| tour_stop.at[k] + moved[k]));
                let off = (block.z_hi - block.stop.focus).max(block.stop.focus - block.z_lo);
                made.worst_defocus = made.worst_defocus.max(off);
            }
            first += count;
        }
        site.lift(made);
    }
}

impl Site<'_> {
    /// Direction of an axis: +1 where its command grows with the place over the part.
    fn sign(&self, axis: usize) -> i64 {
        self.stage.machine.axes()[axis].1.sign()
    }

    /// What of the field the marks of a stop may use: its window. Where the job states sections that are smaller than
    /// the field, it is because the lens is to be used no farther than that.
    fn field(&self) -> [i64; 2] {
        let usable = self.stage.machine.usable_field();
        [0, 1].map(|k| self.window[k].min(usable[k]).0 / 2 * 2)
    }

    /// A standstill and its room, `limits` those of its blocks along x and y.
    fn tour_stop(&self, blocks: &[Block], extents: &[Extent], limits: &[Free], is_first: bool) -> TourStop {
        let (first, step) = (&blocks[0], self.stage.machine.increment_nm().0);
        let Commanded(at) = first.stage;
        let mut tour_stop = TourStop { at, room: at.map(|v| [v; 2]), marks: at.map(|v| [v; 2]), is_first };
        if !first.stop.tilt.is_upright() {
            return tour_stop;
        }
        let all = extents[1..].iter().fold(extents[0], |all, one| all.union(one));
        let [w, h] = self.field();
        let centre = [first.stop.centre.x, first.stop.centre.y, first.stop.focus.0];
        let limit = |axis: usize, end: usize| {
            if axis == 2 { i64::MAX } else { limits.iter().map(|free| free[axis][end]).min().unwrap_or(i64::MAX) }
        };
        for (axis, half) in [w / 2, h / 2, self.depth.0 / 2 - ROUNDING].into_iter().enumerate() {
            if axis == 2 && !self.may_refocus() {
                continue;
            }
            let free = [centre[axis] + half - all.hi[axis], all.lo[axis] + half - centre[axis]];
            let free = [0, 1].map(|end| free[end].min(limit(axis, end)).max(0) / step * step);
            let command = |place: i64| at[axis] + self.sign(axis) * (place - centre[axis]);
            tour_stop.room[axis] = sorted([command(centre[axis] - free[0]), command(centre[axis] + free[1])]);
            tour_stop.marks[axis] = sorted([command(all.lo[axis]), command(all.hi[axis])]);
        }
        tour_stop
    }

    /// Whether focal planes may move.
    fn may_refocus(&self) -> bool {
        let has_zoom = self.stage.machine.most_focus_shift() > Nm(0);
        self.level == Level::Mid && !self.keeps_focus && self.stage.climb() == HeightOrder::Free && !has_zoom
    }

    /// How far each block may move before a mark that was left out would have been its own: one beside its marks, or,
    /// where marks are left out by their length alone, any.
    fn beside_slivers(&self, made: &Candidate, marks: &Marks<'_>, extents: &[Extent]) -> Vec<Free> {
        let blocks = &made.program.blocks;
        let mut free = vec![[[i64::MAX; 2]; 2]; blocks.len()];
        let mut block_of = vec![None; marks.of_stops.len()];
        made.ids.iter().enumerate().for_each(|(i, id)| block_of[id.index()] = Some(i));
        // Wherever a stop moves to, its window holds its marks.
        let near = Near::new(extents.iter().map(Extent::middle), [self.window[0].0, self.window[1].0, self.depth.0]);
        for LeftOut { sliver, beside } in &marks.left_out {
            let middle = [0, 1, 2].map(|k| sliver.lo[k].midpoint(sliver.hi[k]));
            let of_beside = beside.iter().filter_map(|id| block_of[id.index()]);
            let some: Vec<usize> = if self.min_mark { near.of(middle).collect() } else { of_beside.collect() };
            let own = block_of[sliver.stop.index()];
            let mut is_of_another = false;
            for i in some {
                let stop = &blocks[i].stop;
                // What only touches its interval of heights it does not admit.
                if sliver.lo[2] >= stop.z_hi.0 || stop.z_lo.0 >= sliver.hi[2] {
                    continue;
                }
                let centre = [stop.centre.x, stop.centre.y];
                for window in [self.window, self.pitch] {
                    keep_out(&mut free[i], sliver, centre, window);
                }
                let holds = (0..2).all(|k| (middle[k] - centre[k]).abs() <= self.window[k].0 / 2);
                is_of_another |= Some(i) != own && holds;
            }
            if let Some(i) = own.filter(|_| is_of_another) {
                let centre = blocks[i].stop.centre;
                keep_in(&mut free[i], sliver, [centre.x, centre.y], self.window);
            }
        }
        free
    }

    /// Takes from the rooms what lies beyond the travel. A part that may lie anywhere lies where all can stand.
    fn within_travel(&self, tour_stops: &mut [TourStop]) {
        let step = self.stage.machine.increment_nm().0;
        for axis in 0..3 {
            let [from, to] = self.travel(axis);
            let lowest = tour_stops.iter().map(|s| s.room[axis][1]).min().unwrap_or_default();
            let highest = tour_stops.iter().map(|s| s.room[axis][0]).max().unwrap_or_default();
            // By how much the part can be moved so that every room reaches into the travel.
            let allowed = [up(from - lowest, step), down(to - highest, step)];
            let by =
                if self.is_loose && axis < 2 && allowed[0] <= allowed[1] { 0.clamp(allowed[0], allowed[1]) } else { 0 };
            for tour_stop in tour_stops.iter_mut() {
                let at = tour_stop.at[axis];
                let room = [at + up(from - by - at, step), at + down(to - by - at, step)];
                let room = [room[0].max(tour_stop.room[axis][0]), room[1].min(tour_stop.room[axis][1])];
                if room[0] <= room[1] {
                    tour_stop.room[axis] = room;
                    tour_stop.at[axis] = at.clamp(room[0], room[1]);
                }
            }
        }
    }

    /// Ends of the travel of an axis, as commanded.
    fn travel(&self, axis: usize) -> [i64; 2] {
        self.stage.machine.axes()[axis].1.travel_nm().map(|Nm(v)| v)
    }

    /// By how much the part is moved so that the stops lie in the middle of the travel, in commands of x, y and z, nm; whole
    /// increments.
    fn centring_shift(&self, tour_stops: &[TourStop]) -> [i64; 3] {
        if !self.is_loose || tour_stops.is_empty() {
            return [0; 3];
        }
        let step = self.stage.machine.increment_nm().0;
        [0, 1, 2].map(|axis| {
            if axis == 2 {
                return 0;
            }
            let [from, to] = self.travel(axis);
            let all = || tour_stops.iter().map(|s| s.at[axis]);
            let (lo, hi) = (all().min().unwrap_or_default(), all().max().unwrap_or_default());
            let allowed = [up(from - lo, step), down(to - hi, step)];
            let wanted = down(from.midpoint(to) - lo.midpoint(hi), step);
            if allowed[0] <= allowed[1] { wanted.clamp(allowed[0], allowed[1]) } else { wanted }
        })
    }

    /// Whether the head may be too low anywhere in the rooms, so that it has to be asked for every place.
    fn meets(&self, blocks: &[&Block], tour_stops: &[TourStop]) -> bool {
        if blocks.iter().any(|b| !b.stop.tilt.is_upright()) {
            return true;
        }
        let mut area = Box2::EMPTY;
        let mut lowest = Nm(i64::MAX);
        for (block, tour_stop) in blocks.iter().zip(tour_stops) {
            for end in 0..2 {
                let at = [0, 1, 2].map(|k| tour_stop.room[k][end]);
                let stop = self.stop_at(block, at, block.stage.0);
                area.add(stop.centre);
                lowest = lowest.min(stop.focus);
            }
        }
        lowest < self.stage.clearance.lowest_focus(area.lo, area.hi) + self.stage.start.lowered
    }

    /// The stop of a block with the stage somewhere else, its focus the plane that the stage sets.
    fn stop_at(&self, block: &Block, at: [i64; 3], home: [i64; 3]) -> Stop {
        let [x, y, z] = [0, 1, 2].map(|k| self.sign(k) * (at[k] - home[k]));
        let centre = P2::new(block.stop.centre.x + x, block.stop.centre.y + y);
        Stop { centre, focus: block.plane() + Nm(z), ..block.stop.clone() }
    }

    /// Finds anew on the way to which blocks the stage must lift.
    fn lift(&self, made: &mut Candidate) {
        let stand = |b: &Block| Stop { focus: b.plane(), ..b.stop.clone() };
        let start = self.stage.start;
        let mut last = start.before.clone().map(|(stop, cell)| (stop, cell, start.from));
        for block in &mut made.program.blocks {
            let cell = made.used.cell(block.setup);
            let origin = made.setups.origin(cell, made.origin);
            let here = stand(block);
            block.retract = last.as_ref().is_some_and(|(before, of, from)| {
                *of != cell || self.stage.lifts_between((before, *from), (&here, block.stage), origin)
            });
            last = Some((here, cell, block.stage));
        }
    }
}

/// How far a block may move down and up along x and y, nm.
type Free = [[i64; 2]; 2];

/// Keeps a window from admitting more of a sliver than it does: it stops short of it on the axis that leaves it the
/// most room, or, where the window ends on the sliver, does not move over it at all.
fn keep_out(free: &mut Free, sliver: &Sliver, centre: [i64; 2], window: [Nm; 2]) {
    // How far outside the window the sliver lies, below and above it.
    let outside = [0, 1].map(|k| {
        let half = window[k].0 / 2;
        [centre[k] - half - sliver.hi[k], sliver.lo[k] - (centre[k] + half)]
    });
    let farthest = (0..2).flat_map(|k| [0, 1].map(|end| (outside[k][end], k, end))).max();
    if let Some((away, axis, end)) = farthest
        && away > BESIDE
    {
        free[axis][end] = free[axis][end].min(away - BESIDE);
        return;
    }
    for k in 0..2 {
        let sticks_out = [centre[k] - window[k].0 / 2 - sliver.lo[k], sliver.hi[k] - (centre[k] + window[k].0 / 2)];
        for end in 0..2 {
            if sticks_out[end] > -BESIDE {
                free[k][end] = 0;
            }
        }
    }
}

/// Keeps a sliver inside the window of its stop: where another stop admits it too, that one did not have it.
fn keep_in(free: &mut Free, sliver: &Sliver, centre: [i64; 2], window: [Nm; 2]) {
    for k in 0..2 {
        let half = window[k].0 / 2;
        let inside = [centre[k] + half - sliver.hi[k], sliver.lo[k] - (centre[k] - half)];
        for end in 0..2 {
            free[k][end] = free[k][end].min((inside[end] - BESIDE).max(0));
        }
    }
}

/// What rounding may have done to a border or a height, nm.
const ROUNDING: i64 = 2;

fn sorted([a, b]: [i64; 2]) -> [i64; 2] {
    [a.min(b), a.max(b)]
}

/// The nearest multiple of `step` that is not below `v`.
fn up(v: i64, step: i64) -> i64 {
    -((-v).div_euclid(step) * step)
}

/// The nearest multiple of `step` that is not above `v`.
fn down(v: i64, step: i64) -> i64 {
    v.div_euclid(step) * step
}
