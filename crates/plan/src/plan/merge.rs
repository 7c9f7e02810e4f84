//! Stops that are not worth their cost: what two of them mark is marked from one, where one box holds it.
//!
//! Where a box of the window by the depth range holds all marks of two stops, one stop can make them. Its box stands
//! where the stage loses least on its way: where one of the two stood, over their neighbours in the tour, or as near
//! to these as the marks permit. The stops with the shortest time of marks look for a partner first, and take the one
//! that costs least.
//!
//! Consumes a candidate without strokes; promises boxes of the same size on the same lattice that hold all its marks,
//! and what was too short to be marked. Stops of a turned part are left as they are: what is seen along another beam is
//! not known here.

use std::collections::BTreeMap;

use super::candidate::Candidate;
use super::cut::{Cut, StopMarks};
use super::extent::{Extent, NearExtents};
use crate::partition::Stops;
use crate::split::Sliver;
use terrace_core::geom::{Nm, P2};
use terrace_core::machine::{Commanded, Machine};
use terrace_core::motion;
use terrace_core::program::{Block, SetupId, Stop, StopId};
use terrace_input::job::Job;

/// The machine that stops are merged for, and what a stop costs beside its moves.
pub(super) struct Costs<'a> {
    pub(super) machine: &'a Machine,
    /// Where the stage comes from.
    pub(super) from: Commanded,
    /// Time that a person needs for each block, s.
    pub(super) load_s: f64,
    /// Which pairs are merged.
    pub(super) pairs: Pairs,
}

/// Which pairs of stops are merged.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Pairs {
    /// All that fit one box: the order of stops is searched again afterwards, and may make up for longer ways.
    All,
    /// Pairs whose merger saves time in the tour as it is.
    Saving,
}

/// Whether the job with merged stops is kept: it marks the same at fewer stops, and is no worse by the job's objective.
pub(super) fn improves(merged: &Candidate, unmerged: &Candidate, job: &Job, machine: &Machine) -> bool {
    merged.program.stops() < unmerged.program.stops()
        && merged.program.blocks.len() < unmerged.program.blocks.len()
        && merged.measure(job, machine) <= unmerged.measure(job, machine)
}

/// How often all stops look for a partner.
const ROUNDS: usize = 8;

/// Mergers of fewer than one stop in so many are not worth cutting all strokes again.
const LEAST_SHARE: usize = 100;

/// What rounding may have done to the lowest and the highest mark together: 2 nm each, as in `extent`.
const ROUNDING: Nm = Nm(4);

/// A stop of the tour.
struct TourNode {
    /// Where it stands among the stops of the method.
    id: StopId,
    setup: SetupId,
    extent: Extent,
    /// Lower corner of its box.
    corner: [i64; 3],
    /// Between which corners the box can move and hold the marks still.
    room: [[i64; 2]; 3],
    /// Position of the stage.
    at: Commanded,
    focus_shift: Nm,
    /// Whether the stage lifts on its way there.
    retract: bool,
    /// The stops before and after it in the tour.
    before: Option<usize>,
    after: Option<usize>,
    is_gone: bool,
    /// Whether it marks what others did.
    is_changed: bool,
    /// The node that marks what it did, once it is gone; itself before.
    heir: usize,
}

impl TourNode {
    /// Block `i` of a program of `count`, whose box has this size and holds these marks.
    fn new(block: &Block, id: StopId, extent: Extent, size: [i64; 3], step: i64, [i, count]: [usize; 2]) -> Self {
        let Stop { centre: c, z_lo, .. } = &block.stop;
        let corner = [c.x - size[0] / 2, c.y - size[1] / 2, z_lo.0];
        Self {
            id,
            setup: block.setup,
            room: extent.room(corner, size, step),
            extent,
            corner,
            at: block.stage,
            focus_shift: block.focus_shift,
            retract: block.retract,
            before: i.checked_sub(1),
            after: (i + 1 < count).then_some(i + 1),
            is_gone: false,
            is_changed: false,
            heir: i,
        }
    }
}

/// A merger of two stops: which stays, where its box stands then, and what time is lost.
struct Merger {
    stays: usize,
    goes: usize,
    corner: [i64; 3],
    at: Commanded,
    loss_s: f64,
}

/// Stops that are left, and which of them marks what the old ones did.
pub(super) struct MergedStops {
    pub(super) stops: Stops,
    /// By old stop, the new one.
    pub(super) ids: Vec<StopId>,
    /// By new stop, whether it stands elsewhere than the old one or marks more.
    pub(super) is_changed: Vec<bool>,
    /// Whether strokes may be cut anew between the new stops, which admit what they mark where they stand now.
    pub(super) may_cut: bool,
}

impl MergedStops {
    /// What the new stops mark, if the old ones marked this.
    pub(super) fn marks(&self, old: &[StopMarks]) -> Vec<StopMarks> {
        let mut marks = vec![StopMarks::default(); self.stops.stops.len()];
        old.iter().zip(&self.ids).filter(|(old, _)| !old.is_empty()).for_each(|(old, id)| marks[id.index()].join(old));
        marks
    }
}

/// The stops of a candidate merged; None where too few can be.
pub(super) fn merged(cut: &Cut, candidate: &Candidate, costs: &Costs<'_>) -> Option<MergedStops> {
    // What is seen along the beam of another stop is not known for a turned part.
    if cut.stops.is_tilted() {
        return None;
    }
    let mut tour = LinkedTour::new(cut, candidate, costs);
    let mark_s = |i: usize| cut.marks[candidate.ids[i].index()].time_s.iter().sum::<f64>();
    let mut poorest: Vec<usize> = (0..tour.nodes.len()).collect();
    poorest.sort_by(|&a, &b| mark_s(a).total_cmp(&mark_s(b)).then(a.cmp(&b)));
    // The boxes of marks grow by mergers; they are looked for where their middles were at first.
    let nearby = NearExtents::new(tour.nodes.iter().map(|n| n.extent.middle()), tour.size);
    for _ in 0..ROUNDS {
        let before = poorest.len();
        for &i in &poorest {
            if !tour.nodes[i].is_gone
                && let Some(merger) = tour.best(i, &nearby)
            {
                tour.merge(&merger);
            }
        }
        poorest.retain(|&i| !tour.nodes[i].is_gone);
        if poorest.len() == before {
            break;
        }
    }
    let gone = tour.nodes.len() - poorest.len();
    (gone > 0 && gone * LEAST_SHARE >= tour.nodes.len()).then(|| tour.stops(cut))
}

/// A stop that the blocks that follow it may join.
struct JoinedStop<'a> {
    block: &'a Block,
    id: StopId,
    /// The lowest and the highest of what must be held for its marks and those that have joined them.
    z: [Nm; 2],
}

impl JoinedStop<'_> {
    /// The lowest and the highest if a block that must hold this joins.
    fn z_with(&self, held: [Nm; 2]) -> [Nm; 2] {
        let [lo, hi] = self.z;
        [held[0].min(lo), held[1].max(hi)]
    }

    /// Whether a block stands at the same place and both fit one depth range.
    fn admits(&self, block: &Block, held: [Nm; 2], depth: Nm) -> bool {
        let place = |b: &Block| (b.setup, b.stage, b.focus_shift, b.stop.tilt);
        let [lo, hi] = self.z_with(held);
        place(self.block) == place(block) && hi - lo + ROUNDING <= depth
    }
}

/// Blocks of a candidate that follow each other and have come to stand at one place, with one focal plane: one stop
/// marks what they do. Where a mark was left out in or next to one of them they stay two: what is cut anew might not
/// lie in the depth range of stops that have found their places. None where no blocks become one.
pub(super) fn at_one_place(cut: &Cut, candidate: &Candidate) -> Option<MergedStops> {
    if cut.stops.is_tilted() {
        return None;
    }
    let [width, height, depth] = cut.stops.size();
    let mut stops: Vec<Stop> = cut.stops.stops.iter().map(|s| s.stop.clone()).collect();
    let mut ids: Vec<StopId> = cut.stops.ids().collect();
    let mut is_changed = vec![false; stops.len()];
    let mut is_beside_sliver = vec![false; stops.len()];
    for part in cut.parts.list() {
        let beside = part.slivers.iter().flat_map(|s| part.stops_at(s));
        beside.for_each(|stop| is_beside_sliver[stop.index()] = true);
    }
    let mut last: Option<JoinedStop<'_>> = None;
    for (block, &id) in candidate.program.blocks.iter().zip(&candidate.ids) {
        let held = cut.marks[id.index()].heights.held_nm();
        let is_joined = |last: &JoinedStop<'_>| {
            let is_beside = is_beside_sliver[last.id.index()] || is_beside_sliver[id.index()];
            !is_beside && last.admits(block, held, depth)
        };
        let Some(stop) = last.as_mut().filter(|last| is_joined(last)) else {
            last = Some(JoinedStop { block, id, z: held });
            continue;
        };
        stop.z = stop.z_with(held);
        ids[id.index()] = stop.id;
        is_changed[stop.id.index()] = true;
        // The focal plane is in the middle, unless it stands at a mean height.
        let [lo, hi] = stop.z;
        let [lowest, highest] = [hi + ROUNDING / 2 - depth, lo - ROUNDING / 2];
        let z_lo = (block.stop.lpfl - depth / 2).clamp(lowest, highest);
        stops[stop.id.index()] = Stop { z_lo, z_hi: z_lo + depth, ..block.stop.clone() };
    }
    let stops = Stops::new(stops, [width, height], depth);
    is_changed.contains(&true).then_some(MergedStops { stops, ids, is_changed, may_cut: false })
}

/// The stops in order, linked.
struct LinkedTour<'a> {
    costs: &'a Costs<'a>,
    /// Size of a box, nm.
    size: [i64; 3],
    nodes: Vec<TourNode>,
}

impl<'a> LinkedTour<'a> {
    fn new(cut: &Cut, candidate: &Candidate, costs: &'a Costs<'a>) -> Self {
        let size = cut.stops.size().map(|Nm(v)| v);
        let step = costs.machine.increment_nm().0;
        // A box must hold what its stop left out as well: it may be marked once strokes are cut again.
        let mut slivers: BTreeMap<StopId, Extent> = BTreeMap::new();
        for &Sliver { stop, lo, hi, .. } in cut.slivers() {
            let sliver = Extent { lo, hi };
            slivers.entry(stop).and_modify(|extent| *extent = extent.union(&sliver)).or_insert(sliver);
        }
        let Candidate { program, ids, .. } = candidate;
        let mut nodes = Vec::with_capacity(ids.len());
        for (i, (block, &id)) in program.blocks.iter().zip(ids).enumerate() {
            let marks = Extent::of(&cut.marks[id.index()]);
            let extent = slivers.get(&id).map_or(marks, |slivers| marks.union(slivers));
            nodes.push(TourNode::new(block, id, extent, size, step, [i, ids.len()]));
        }
        Self { costs, size, nodes }
    }

    /// The merger of stop `i` with another that saves the most time; None where none can be or saves any.
    fn best(&self, i: usize, nearby: &NearExtents) -> Option<Merger> {
        let mut best: Option<Merger> = None;
        for j in nearby.around(self.nodes[i].extent.middle()) {
            let [a, b] = [&self.nodes[i], &self.nodes[j]];
            if i == j || b.is_gone || a.setup != b.setup {
                continue;
            }
            // Corners at which one box holds the marks of both.
            let room = [0, 1, 2].map(|k| [a.room[k][0].max(b.room[k][0]), a.room[k][1].min(b.room[k][1])]);
            if room.iter().any(|[from, to]| from > to) {
                continue;
            }
            for (stays, goes) in [(i, j), (j, i)] {
                for corner in self.corners(i, j, self.nodes[stays].corner[2], room) {
                    let at = self.target(stays, goes, corner);
                    let loss_s = self.loss_s(stays, goes, at) - self.costs.load_s;
                    let is_better = match &best {
                        Some(best) => loss_s < best.loss_s,
                        None => self.costs.pairs == Pairs::All || loss_s < 0.0,
                    };
                    if is_better {
                        best = Some(Merger { stays, goes, corner, at, loss_s });
                    }
                }
            }
        }
        best
    }

    /// Corners that a box for the marks of two stops may have: over those of either and of their neighbours in the
    /// tour, or as near as `room` permits.
    fn corners(&self, i: usize, j: usize, z: i64, room: [[i64; 2]; 3]) -> Vec<[i64; 3]> {
        // Stops that share a standstill of a zoom optic stand over one place, which is not given up.
        let has_zoom = self.costs.machine.most_focus_shift() > Nm(0);
        let neighbours = [i, j].into_iter().flat_map(|n| {
            let TourNode { before, after, .. } = self.nodes[n];
            [before, after].map(|n| n.filter(|_| !has_zoom))
        });
        let mut corners: Vec<[i64; 3]> = [Some(i), Some(j)]
            .into_iter()
            .chain(neighbours)
            .flatten()
            .map(|n| {
                let [x, y, _] = self.nodes[n].corner;
                [x, y, z]
            })
            .filter(|corner| !has_zoom || (0..2).all(|k| room[k][0] <= corner[k] && corner[k] <= room[k][1]))
            .map(|corner| [0, 1, 2].map(|k| corner[k].clamp(room[k][0], room[k][1])))
            .collect();
        corners.sort_unstable();
        corners.dedup();
        corners
    }

    /// Where the stage stands once `stays` marks what `goes` did, its box at `corner`.
    fn target(&self, stays: usize, goes: usize, corner: [i64; 3]) -> Commanded {
        let [stays, goes] = [&self.nodes[stays], &self.nodes[goes]];
        let middle = |e: &Extent| e.middle()[2];
        // With a zoom optic the plane that the stage sets stays, and the optic shifts.
        let raised = if self.costs.machine.most_focus_shift() > Nm(0) {
            0
        } else {
            middle(&stays.extent.union(&goes.extent)) - middle(&stays.extent)
        };
        let by = [corner[0] - stays.corner[0], corner[1] - stays.corner[1], raised];
        let mut at = stays.at;
        for (k, (_, axis)) in self.costs.machine.axes().into_iter().enumerate() {
            at[k] += axis.sign() * by[k];
        }
        at
    }

    /// By how much longer the tour takes without `goes` and with `stays` at `at`, s.
    fn loss_s(&self, stays: usize, goes: usize, at: Commanded) -> f64 {
        let [s, g] = [&self.nodes[stays], &self.nodes[goes]];
        let stood = |n: usize| self.nodes[n].at;
        let moved = |n: usize| if n == stays { at } else { self.nodes[n].at };
        let past_gone = |n: Option<usize>, next: Option<usize>| if n == Some(goes) { next } else { n };
        let before = past_gone(s.before, g.before);
        let after = past_gone(s.after, g.after);
        let mut new = 0.0;
        let mut old = 0.0;
        new += self.leg_s(before, Some(stays), moved) + self.leg_s(Some(stays), after, moved);
        old += self.leg_s(s.before, Some(stays), stood) + self.leg_s(Some(stays), s.after, stood);
        // Where the two follow each other, the leg between them is counted above, and so is the one past the gone stop.
        if g.before == Some(stays) {
            old += self.leg_s(Some(goes), g.after, stood);
        } else if g.after == Some(stays) {
            old += self.leg_s(g.before, Some(goes), stood);
        } else {
            old += self.leg_s(g.before, Some(goes), stood) + self.leg_s(Some(goes), g.after, stood);
            // A lift to the stop that goes is taken to be needed still on the way past it.
            let retract = g.retract || g.after.is_some_and(|n| self.nodes[n].retract);
            new += self.move_s(g.before, g.after, stood, retract);
        }
        new - old
    }

    /// Time of the move from one stop to another, which stand at `place`, s; lifted where the tour lifts there.
    fn leg_s(&self, from: Option<usize>, to: Option<usize>, place: impl Fn(usize) -> Commanded) -> f64 {
        self.move_s(from, to, place, to.is_some_and(|n| self.nodes[n].retract))
    }

    /// Time of a move of the stage or of the optic, s; from None the stage comes from its start, and nothing is moved
    /// to None.
    fn move_s(&self, from: Option<usize>, to: Option<usize>, place: impl Fn(usize) -> Commanded, retract: bool) -> f64 {
        let (machine, Some(to)) = (self.costs.machine, to) else { return 0.0 };
        let (start, shift) = from.map_or((self.costs.from, Nm(0)), |n| (place(n), self.nodes[n].focus_shift));
        let stage = motion::stage_move(machine, start, place(to), retract.then(|| machine.retract_z())).total_s();
        stage.max(machine.zoom_time_s(shift, self.nodes[to].focus_shift))
    }

    /// Takes a stop out of the tour; the one that stays has its marks.
    fn merge(&mut self, merger: &Merger) {
        let &Merger { stays, goes, corner, at, .. } = merger;
        let TourNode { before, after, extent, .. } = self.nodes[goes];
        before.into_iter().for_each(|n| self.nodes[n].after = after);
        after.into_iter().for_each(|n| self.nodes[n].before = before);
        (self.nodes[goes].is_gone, self.nodes[goes].heir) = (true, stays);
        let size = self.size;
        let step = self.costs.machine.increment_nm().0;
        let node = &mut self.nodes[stays];
        node.extent = node.extent.union(&extent);
        (node.corner, node.at, node.is_changed) = (corner, at, true);
        node.room = node.extent.room(corner, size, step);
    }

    /// The stops that are left, in the order in which the method gave them, with those that hold nothing but slivers.
    fn stops(&self, cut: &Cut) -> MergedStops {
        let [w, h, depth] = self.size;
        let old = &cut.stops.stops;
        let mut left: BTreeMap<StopId, (Stop, bool)> =
            cut.slivers().map(|s| (s.stop, (old[s.stop.index()].stop.clone(), false))).collect();
        for n in &self.nodes {
            let [x, y, z] = n.corner;
            let (z_lo, z_hi) = (Nm(z), Nm(z + depth));
            let centre = P2::new(x + w / 2, y + h / 2);
            let stop = Stop { centre, lpfl: z_lo + Nm(depth / 2), z_lo, z_hi, ..old[n.id.index()].stop.clone() };
            if n.is_gone {
                left.remove(&n.id)
            } else {
                left.insert(n.id, (stop, n.is_changed))
            };
        }
        let new_ids: BTreeMap<StopId, StopId> = left.keys().copied().zip((0..).map(StopId)).collect();
        let mut ids: Vec<StopId> = cut.stops.ids().map(|id| new_ids.get(&id).copied().unwrap_or_default()).collect();
        for n in self.nodes.iter().filter(|n| n.is_gone) {
            // What takes a stop over may be taken over itself later.
            let mut heir = n.heir;
            while self.nodes[heir].is_gone {
                heir = self.nodes[heir].heir;
            }
            ids[n.id.index()] = new_ids[&self.nodes[heir].id];
        }
        let (stops, is_changed): (Vec<Stop>, Vec<bool>) = left.into_values().unzip();
        MergedStops { stops: Stops::new(stops, [Nm(w), Nm(h)], Nm(depth)), ids, is_changed, may_cut: true }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrace_core::random::Random;

    const SIZE: [i64; 3] = [4_000_000, 4_000_000, 70_000];

    fn costs(machine: &Machine, pairs: Pairs) -> Costs<'_> {
        Costs { machine, from: Commanded([0, 0, 100_000_000]), load_s: 0.0, pairs }
    }

    /// A tour of stops at random places with marks in random boxes within theirs.
    fn tour<'a>(costs: &'a Costs<'a>, random: &mut Random, count: usize) -> LinkedTour<'a> {
        let nodes = (0..count).map(|i| {
            let corner =
                [random.between(0, 80) * 100_000, random.between(0, 40) * 100_000, random.between(0, 15) * 10_000];
            let mut lo = corner;
            let mut hi = corner;
            for k in 0..3 {
                lo[k] += random.between(0, SIZE[k] * 2 / 3);
                hi[k] = lo[k] + random.between(0, corner[k] + SIZE[k] - lo[k]);
            }
            let extent = Extent { lo, hi };
            TourNode {
                id: StopId(i as u32),
                setup: SetupId(0),
                room: extent.room(corner, SIZE, 100),
                extent,
                corner,
                at: Commanded(corner),
                focus_shift: Nm(0),
                retract: random.between(0, 9) == 0,
                before: i.checked_sub(1),
                after: (i + 1 < count).then_some(i + 1),
                is_gone: false,
                is_changed: false,
                heir: i,
            }
        });
        LinkedTour { costs, size: SIZE, nodes: nodes.collect() }
    }

    /// Time of the whole tour, move by move.
    fn total_s(tour: &LinkedTour<'_>) -> f64 {
        let mut next = (0..tour.nodes.len()).find(|&i| !tour.nodes[i].is_gone && tour.nodes[i].before.is_none());
        let (mut last, mut sum, mut seen) = (None, 0.0, 0);
        while let Some(i) = next {
            sum += tour.move_s(last, Some(i), |n| tour.nodes[n].at, tour.nodes[i].retract);
            (last, next, seen) = (Some(i), tour.nodes[i].after, seen + 1);
        }
        assert_eq!(seen, tour.nodes.iter().filter(|n| !n.is_gone).count());
        sum
    }

    #[test]
    fn mergers_lose_what_the_tour_loses_and_boxes_hold_all_marks() {
        let machine = Machine::built_in("xyz-galvo-40").expect("a profile");
        for (pairs, seed) in [(Pairs::All, 4), (Pairs::Saving, 5), (Pairs::All, 6), (Pairs::Saving, 7)] {
            let (costs, mut random) = (costs(&machine, pairs), Random::new(seed));
            let mut tour = tour(&costs, &mut random, 60);
            let first: Vec<Extent> = tour.nodes.iter().map(|n| n.extent).collect();
            let nearby = NearExtents::new(tour.nodes.iter().map(|n| n.extent.middle()), SIZE);
            let mut mergers = 0;
            for i in 0..60 {
                let Some(merger) = (!tour.nodes[i].is_gone).then(|| tour.best(i, &nearby)).flatten() else { continue };
                let before = total_s(&tour);
                tour.merge(&merger);
                mergers += 1;
                let lost = total_s(&tour) - before;
                // A lift of the stop that goes is taken to be needed still; here it may not be.
                assert!(lost <= merger.loss_s + 1e-9, "{lost} {}", merger.loss_s);
                let retracts = tour.nodes.iter().any(|n| n.retract);
                assert!(retracts || (lost - merger.loss_s).abs() < 1e-9);
                assert!(pairs == Pairs::All || lost < 0.0);
            }
            let left: Vec<&TourNode> = tour.nodes.iter().filter(|n| !n.is_gone).collect();
            assert_eq!(left.len() + mergers, 60);
            assert!(mergers > 5, "{mergers}");
            for n in &left {
                assert!((0..3).all(|k| n.corner[k] <= n.extent.lo[k] && n.extent.hi[k] <= n.corner[k] + SIZE[k]));
            }
            for e in &first {
                let holds = |n: &&TourNode| (0..3).all(|k| n.extent.lo[k] <= e.lo[k] && e.hi[k] <= n.extent.hi[k]);
                assert!(left.iter().any(holds));
            }
        }
    }
}
