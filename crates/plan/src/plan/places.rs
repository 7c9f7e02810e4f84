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
use super::cut::{LeftOutMark, MarksOfStops};
use super::extent::{Extent, NearExtents};
use super::lifts::{CommandedStop, Lifts, PassStage};
use super::start::HeadPosition;
use crate::order::slide::{self, MoveRules, StopAt, TourStop};
use crate::order::stops::{self, HeightOrder};
use crate::split::Sliver;
use terrace_core::geom::{Box2, Nm, P2};
use terrace_core::machine::{Commanded, Origin};
use terrace_core::program::{Block, Stop};
use terrace_input::job::Level;

/// What the places of stops follow from, beside the candidate.
pub(super) struct PlaceRules<'a> {
    pub(super) stage: &'a PassStage<'a>,
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
pub(super) fn place(candidate: &mut Candidate, marks: &MarksOfStops<'_>, rules: &PlaceRules<'_>) {
    if candidate.program.blocks.is_empty() {
        return;
    }
    let mut places = Places::new(candidate, marks, rules);
    places.slide(candidate, rules);
    places.apply(candidate, rules);
}

/// The standstills of a candidate and where they may be.
struct Places {
    /// Blocks of each standstill, in the order of the program.
    blocks: Vec<Range<usize>>,
    /// Where each stood at first, commanded, nm.
    home: Vec<[i64; 3]>,
    /// The standstills in the order of the tour.
    tour_stops: Vec<TourStop>,
    /// Which standstill each of `tour_stops` is.
    order: Vec<usize>,
}

impl Places {
    fn new(candidate: &Candidate, marks: &MarksOfStops<'_>, rules: &PlaceRules<'_>) -> Self {
        let program = &candidate.program;
        let mut blocks: Vec<Range<usize>> = Vec::new();
        for (i, b) in program.blocks.iter().enumerate() {
            match blocks.last_mut() {
                Some(last) if b.is_reached_by_zoom(&program.blocks[i - 1]) => last.end = i + 1,
                _ => blocks.push(i..i + 1),
            }
        }
        let extents: Vec<Extent> = candidate.ids.iter().map(|id| Extent::of(&marks.of_stops[id.index()])).collect();
        let limits = rules.limits_by_slivers(candidate, marks, &extents);
        let mut tour_stops: Vec<TourStop> = Vec::with_capacity(blocks.len());
        let mut last_setup = None;
        for range in &blocks {
            let setup = program.blocks[range.start].setup;
            let is_first = last_setup.replace(setup).is_some_and(|last| last != setup);
            let of_stop = &program.blocks[range.clone()];
            tour_stops.push(rules.tour_stop(of_stop, &extents[range.clone()], &limits[range.clone()], is_first));
        }
        rules.within_travel(&mut tour_stops);
        let home = blocks.iter().map(|range| program.blocks[range.start].stage.0).collect();
        let order = (0..blocks.len()).collect();
        Self { blocks, home, tour_stops, order }
    }

    /// Slides the standstills, and looks for a better tour of the new places.
    fn slide(&mut self, candidate: &Candidate, rules: &PlaceRules<'_>) {
        let first_blocks: Vec<&Block> = self.blocks.iter().map(|r| &candidate.program.blocks[r.start]).collect();
        let may_be_low = rules.may_be_low(&first_blocks, &self.tour_stops);
        let standstills = Standstills { rules, candidate, first_blocks: &first_blocks, home: &self.home, may_be_low };
        let mut time = standstills.slide(&mut self.tour_stops, &self.order);
        let has_zoom = rules.stage.machine.most_focus_shift() > Nm(0);
        if has_zoom || first_blocks.iter().any(|b| !b.stop.tilt.is_upright()) {
            return;
        }
        for _ in 0..TOURS {
            let at: Vec<Commanded> = self.tour_stops.iter().map(|s| Commanded(s.at)).collect();
            let tour = self.tour(&at, rules, |a, b| {
                may_be_low
                    && standstills.lifts(
                        StopAt { number: self.order[a], at: at[a].0 },
                        StopAt { number: self.order[b], at: at[b].0 },
                    )
            });
            let order: Vec<usize> = tour.iter().map(|&i| self.order[i]).collect();
            let mut tour_stops: Vec<TourStop> = tour
                .iter()
                .enumerate()
                .map(|(i, &from)| TourStop { is_first: self.tour_stops[i].is_first, ..self.tour_stops[from].clone() })
                .collect();
            let next = standstills.slide(&mut tour_stops, &order);
            if next > time * (1.0 - LEAST_SHARE) {
                break;
            }
            (time, self.tour_stops, self.order) = (next, tour_stops, order);
        }
    }

    /// Another tour of the stops, each set-up by itself.
    fn tour(
        &self,
        at: &[Commanded],
        rules: &PlaceRules<'_>,
        lifts: impl Fn(usize, usize) -> bool + Sync,
    ) -> Vec<usize> {
        let mut order: Vec<usize> = Vec::with_capacity(at.len());
        let mut first = 0;
        // Invariant: the stops before `first` are in `order`, and a set-up begins with `first`.
        while first < at.len() {
            let more = self.tour_stops[first + 1..].iter().take_while(|s| !s.is_first).count();
            let range = first..first + 1 + more;
            // The stage is lifted while the part is set up anew.
            let from = order.last().map_or(rules.stage.start.from, |&last| {
                Commanded([at[last][0], at[last][1], rules.stage.machine.retract_z().0])
            });
            let lifts = |a: usize, b: usize| lifts(first + a, first + b);
            let stage = stops::Stage { machine: rules.stage.machine, from, lifts: Some(&lifts) };
            let tour = stops::tour(&at[range.clone()], &stage, rules.stage.climb(), stops::EFFORT);
            order.extend(tour.into_iter().map(|i| first + i));
            first = range.end;
        }
        order
    }

    /// Writes the places into the program, in the order of the tour.
    fn apply(self, candidate: &mut Candidate, rules: &PlaceRules<'_>) {
        let Self { blocks: ranges, home, tour_stops, order } = self;
        let shift = rules.centring_shift(&tour_stops);
        let Origin(origin) = candidate.origin;
        candidate.origin = Origin([0, 1, 2].map(|k| origin[k] + rules.sign(k) * shift[k]));
        let order_of_blocks: Vec<usize> = order.iter().flat_map(|&n| ranges[n].clone()).collect();
        let program = &mut candidate.program;
        program.blocks = order_of_blocks.iter().map(|&i| program.blocks[i].clone()).collect();
        candidate.ids = order_of_blocks.iter().map(|&i| candidate.ids[i]).collect();
        candidate.worst_defocus = Nm(0);
        let mut first = 0;
        for (&n, tour_stop) in order.iter().zip(&tour_stops) {
            let count = ranges[n].len();
            let by = [0, 1, 2].map(|k| rules.sign(k) * (tour_stop.at[k] - home[n][k]));
            for block in &mut program.blocks[first..first + count] {
                let centre = block.stop.centre;
                block.stop.centre = P2::new(centre.x + by[0], centre.y + by[1]);
                block.stop.lpfl += Nm(by[2]);
                block.stage = Commanded([0, 1, 2].map(|k| tour_stop.at[k] + shift[k]));
                let defocus = (block.z_hi - block.stop.lpfl).max(block.stop.lpfl - block.z_lo);
                candidate.worst_defocus = candidate.worst_defocus.max(defocus);
            }
            first += count;
        }
        rules.lift(candidate);
    }
}

/// The standstills of a candidate, each by its number in the program, at places where they do not stand yet.
struct Standstills<'a> {
    rules: &'a PlaceRules<'a>,
    candidate: &'a Candidate,
    /// The first block of each.
    first_blocks: &'a [&'a Block],
    /// Where each stands in the program, commanded, nm.
    home: &'a [[i64; 3]],
    /// Whether the head may be too low anywhere, so that every place must be asked for.
    may_be_low: bool,
}

impl Standstills<'_> {
    /// The stop of a standstill at a place.
    fn stop(&self, StopAt { number, at }: StopAt) -> Stop {
        self.rules.stop_at(self.first_blocks[number], at, self.home[number])
    }

    /// Whether the stage must lift between two places.
    fn lifts(&self, from: StopAt, to: StopAt) -> bool {
        let [from_stop, to_stop] = [from, to].map(|stop| self.stop(stop));
        let Candidate { setups, used, origin, .. } = self.candidate;
        let origin = setups.origin(used.cell(self.first_blocks[from.number].setup), *origin);
        self.rules.stage.lifts_between(
            CommandedStop { stop: &from_stop, stage: Commanded(from.at) },
            CommandedStop { stop: &to_stop, stage: Commanded(to.at) },
            origin,
        )
    }

    /// Whether the head keeps clear of the part at a place. Where the standstill stands in the program is always
    /// allowed.
    fn is_clear(&self, stop: StopAt) -> bool {
        stop.at == self.home[stop.number] || self.rules.stage.is_clear(&self.stop(stop))
    }

    /// Slides the standstills of a tour, `order` those that its stops are. Returns the time of the moves, s.
    fn slide(&self, tour_stops: &mut Vec<TourStop>, order: &[usize]) -> f64 {
        let standstill = |stop: StopAt| StopAt { number: order[stop.number], ..stop };
        let lifts = |from: StopAt, to: StopAt| self.lifts(standstill(from), standstill(to));
        let is_clear = |stop: StopAt| self.is_clear(standstill(stop));
        let stage = self.rules.stage;
        let is_later_pass = stage.start.pass.0 > 0;
        let move_rules = MoveRules {
            machine: stage.machine,
            from: is_later_pass.then_some(stage.start.from.0),
            lifts: self.may_be_low.then_some(&lifts as &dyn Fn(StopAt, StopAt) -> bool),
            is_clear: self.may_be_low.then_some(&is_clear as &dyn Fn(StopAt) -> bool),
        };
        slide::slide(tour_stops, &move_rules, stage.machine.increment_nm().0)
    }
}

impl PlaceRules<'_> {
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
    fn tour_stop(&self, blocks: &[Block], extents: &[Extent], limits: &[MoveLimits], is_first: bool) -> TourStop {
        let first = &blocks[0];
        let step = self.stage.machine.increment_nm().0;
        let Commanded(at) = first.stage;
        let mut tour_stop = TourStop { at, room: at.map(|v| [v; 2]), marks: at.map(|v| [v; 2]), is_first };
        if !first.stop.tilt.is_upright() {
            return tour_stop;
        }
        let marks = extents[1..].iter().fold(extents[0], |marks, extent| marks.union(extent));
        let [w, h] = self.field();
        let centre = [first.stop.centre.x, first.stop.centre.y, first.stop.lpfl.0];
        let limit = |axis: usize, end: usize| {
            if axis == 2 { i64::MAX } else { limits.iter().map(|free| free[axis][end]).min().unwrap_or(i64::MAX) }
        };
        for (axis, half) in [w / 2, h / 2, self.depth.0 / 2 - ROUNDING].into_iter().enumerate() {
            if axis == 2 && !self.may_refocus() {
                continue;
            }
            let free = [centre[axis] + half - marks.hi[axis], marks.lo[axis] + half - centre[axis]];
            let free = [0, 1].map(|end| free[end].min(limit(axis, end)).max(0) / step * step);
            let command = |place: i64| at[axis] + self.sign(axis) * (place - centre[axis]);
            tour_stop.room[axis] = sorted([command(centre[axis] - free[0]), command(centre[axis] + free[1])]);
            tour_stop.marks[axis] = sorted([command(marks.lo[axis]), command(marks.hi[axis])]);
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
    fn limits_by_slivers(
        &self,
        candidate: &Candidate,
        marks: &MarksOfStops<'_>,
        extents: &[Extent],
    ) -> Vec<MoveLimits> {
        let blocks = &candidate.program.blocks;
        let mut limits = vec![[[i64::MAX; 2]; 2]; blocks.len()];
        let mut block_of = vec![None; marks.of_stops.len()];
        candidate.ids.iter().enumerate().for_each(|(i, id)| block_of[id.index()] = Some(i));
        // Wherever a stop moves to, its window holds its marks.
        let middles = extents.iter().map(Extent::middle);
        let nearby = NearExtents::new(middles, [self.window[0].0, self.window[1].0, self.depth.0]);
        for LeftOutMark { sliver, beside } in &marks.left_out {
            let middle = [0, 1, 2].map(|k| sliver.lo[k].midpoint(sliver.hi[k]));
            let own = block_of[sliver.stop.index()];
            let blocks_near: Vec<usize> = if self.min_mark {
                nearby.around(middle).collect()
            } else {
                beside.iter().filter_map(|id| block_of[id.index()]).collect()
            };
            let mut is_in_another_window = false;
            for i in blocks_near {
                let stop = &blocks[i].stop;
                // What only touches its interval of heights it does not admit.
                if sliver.lo[2] >= stop.z_hi.0 || stop.z_lo.0 >= sliver.hi[2] {
                    continue;
                }
                let centre = [stop.centre.x, stop.centre.y];
                for window in [self.window, self.pitch] {
                    keep_out(&mut limits[i], sliver, centre, window);
                }
                let is_in_window = (0..2).all(|k| (middle[k] - centre[k]).abs() <= self.window[k].0 / 2);
                is_in_another_window |= Some(i) != own && is_in_window;
            }
            if let Some(i) = own.filter(|_| is_in_another_window) {
                let centre = blocks[i].stop.centre;
                keep_in(&mut limits[i], sliver, [centre.x, centre.y], self.window);
            }
        }
        limits
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
            let places = || tour_stops.iter().map(|s| s.at[axis]);
            let lo = places().min().unwrap_or_default();
            let hi = places().max().unwrap_or_default();
            let allowed = [up(from - lo, step), down(to - hi, step)];
            let wanted = down(from.midpoint(to) - lo.midpoint(hi), step);
            if allowed[0] <= allowed[1] { wanted.clamp(allowed[0], allowed[1]) } else { wanted }
        })
    }

    /// Whether the head may be too low anywhere in the rooms, so that every place must be asked for.
    fn may_be_low(&self, blocks: &[&Block], tour_stops: &[TourStop]) -> bool {
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
                lowest = lowest.min(stop.lpfl);
            }
        }
        lowest < self.stage.clearance.lowest_focus(area.lo, area.hi) + self.stage.start.lowered
    }

    /// The stop of a block with the stage somewhere else, its focus the plane that the stage sets.
    fn stop_at(&self, block: &Block, at: [i64; 3], home: [i64; 3]) -> Stop {
        let [x, y, z] = [0, 1, 2].map(|k| self.sign(k) * (at[k] - home[k]));
        let centre = P2::new(block.stop.centre.x + x, block.stop.centre.y + y);
        Stop { centre, lpfl: block.stage_plane() + Nm(z), ..block.stop.clone() }
    }

    /// Finds anew on the way to which blocks the stage must lift.
    fn lift(&self, candidate: &mut Candidate) {
        let mut lifts = Lifts::new(self.stage);
        for block in &mut candidate.program.blocks {
            let cell = candidate.used.cell(block.setup);
            let origin = candidate.setups.origin(cell, candidate.origin);
            let stop = Stop { lpfl: block.stage_plane(), ..block.stop.clone() };
            block.retract = lifts.is_needed_to(HeadPosition { stop, stage: block.stage, cell }, origin);
        }
    }
}

/// How far a block may move down and up along x and y, nm.
type MoveLimits = [[i64; 2]; 2];

/// Keeps a window from admitting more of a sliver than it does: it stops short of it on the axis that leaves it the
/// most room, or, where the window ends on the sliver, does not move over it at all.
fn keep_out(limits: &mut MoveLimits, sliver: &Sliver, centre: [i64; 2], window: [Nm; 2]) {
    // How far outside the window the sliver lies, below and above it.
    let outside = [0, 1].map(|k| {
        let half = window[k].0 / 2;
        [centre[k] - half - sliver.hi[k], sliver.lo[k] - (centre[k] + half)]
    });
    let farthest = (0..2).flat_map(|k| [0, 1].map(|end| (outside[k][end], k, end))).max();
    if let Some((away, axis, end)) = farthest
        && away > BESIDE
    {
        limits[axis][end] = limits[axis][end].min(away - BESIDE);
        return;
    }
    for k in 0..2 {
        let sticks_out = [centre[k] - window[k].0 / 2 - sliver.lo[k], sliver.hi[k] - (centre[k] + window[k].0 / 2)];
        for end in 0..2 {
            if sticks_out[end] > -BESIDE {
                limits[k][end] = 0;
            }
        }
    }
}

/// Keeps a sliver inside the window of its stop: where another stop admits it too, that one did not have it.
fn keep_in(limits: &mut MoveLimits, sliver: &Sliver, centre: [i64; 2], window: [Nm; 2]) {
    for k in 0..2 {
        let half = window[k].0 / 2;
        let inside = [centre[k] + half - sliver.hi[k], sliver.lo[k] - (centre[k] - half)];
        for end in 0..2 {
            limits[k][end] = limits[k][end].min((inside[end] - BESIDE).max(0));
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
