//! From fragments to a program: focal planes set, stops ordered; then strokes ordered, and all laid out flat.

use super::cut::{Cut, OrderedFragment, StopMarks};
use super::dose;
use super::focal_plane::focal_plane;
use super::lifts::{Lifts, PassStage};
use super::parts::fragment;
use super::setups::{self, CellId, Setups, UsedCells};
use super::standstills::{BlockPlace, Sharing, Standstill, standstills};
use super::start::HeadPosition;
use crate::order;
use crate::order::stops::HeightOrder;
use crate::partition::{Lattice, Stops};
use crate::split::Fragments;
use terrace_core::geom::{Box2, FieldPoint, Nm, P2, Turned};
use terrace_core::machine::{Commanded, Stand};
use terrace_core::parallel;
use terrace_core::program::{Block, Program, Slope, Stop, StopId, Stroke};
use terrace_core::progress::Task;
use terrace_input::job::{Level, StopOrder, StrokeOrder};

/// Stops in order, and how far their marks lie from their focal planes at most.
pub(super) struct Assembly {
    /// The blocks, without strokes.
    pub(super) blocks: Vec<Block>,
    /// The stop of every block, among those of the method.
    pub(super) ids: Vec<StopId>,
    pub(super) setups: Setups,
    /// The cells of its set-ups.
    pub(super) used: UsedCells,
    pub(super) worst_defocus: Nm,
    /// How far they would lie from focal planes at their mean height.
    pub(super) worst_defocus_mean: Nm,
}

/// How focal planes are set.
#[derive(Clone, Copy)]
pub(super) struct FocusRule {
    pub(super) level: Level,
    pub(super) lattice: Lattice,
}

/// A stop that marks something, its focal plane set.
struct FocusedStop {
    /// Its place among the stops of the method.
    id: StopId,
    stop: Stop,
    /// Its lowest and its highest mark.
    z: [Nm; 2],
    /// How far its marks would lie from a focal plane at their mean height.
    defocus_mean: Nm,
}

impl FocusedStop {
    fn new(id: StopId, stop: &Stop, marks: &StopMarks, rule: FocusRule, stage: &PassStage<'_>) -> Self {
        let h = &marks.heights;
        let z = [Nm::round(h.lo), Nm::round(h.hi)];
        // Where commands of the head's tilt are rounded the stops lie on no lattice, and their planes need not.
        let lattice = if stage.rounds(stop) { Lattice { step: Nm(1), ..rule.lattice } } else { rule.lattice };
        let (lpfl, mean) = focal_plane(rule.level, &lattice, h.held_nm(), h.mean());
        let defocus_mean = (z[1] - mean).max(mean - z[0]);
        Self { id, stop: Stop { lpfl, ..stop.clone() }, z, defocus_mean }
    }
}

/// A position of the stage, from which one stop is marked, or with a zoom optic one or more.
struct Position {
    /// The indices of the stops there, by rising focal plane.
    members: Vec<usize>,
    /// Where the head stands, its focus the plane that the stage sets.
    stop: Stop,
    target: Commanded,
    /// By how much the target lies off the place of the stop, nm, in x, y and z of the turned part.
    by: [i64; 3],
    cell: CellId,
}

/// A stop in the order of the tour: indices of its position and of the stop.
struct StopOnTour {
    position: usize,
    stop: usize,
}

/// Sets the focal planes of the stops that mark something, `marks` by stop, and orders them. `setups` finds those of
/// the stops' centres where the passes before have not.
pub(super) fn assemble(
    stops: &Stops,
    marks: &[StopMarks],
    stage: &PassStage<'_>,
    rule: FocusRule,
    setups: &dyn Fn(&[P2<Turned>]) -> Setups,
) -> Assembly {
    let focused: Vec<FocusedStop> = stops
        .ids()
        .filter(|id| !marks[id.index()].is_empty())
        .map(|id| FocusedStop::new(id, &stops.stops[id.index()].stop, &marks[id.index()], rule, stage))
        .collect();
    let centres: Vec<P2<Turned>> = focused.iter().map(|f| f.stop.centre).collect();
    let setups = stage.start.part.as_ref().map_or_else(|| setups(&centres), |part| part.setups.clone());
    let cells: Vec<CellId> = centres.iter().map(|&c| setups.cell(c)).collect();
    let positions = stage.positions(&focused, &cells, &setups, &rule.lattice);
    let used = UsedCells::new(cells);
    let tour = stage.sequence(&focused, &positions, &used);
    let mut worst_defocus = Nm(0);
    let mut blocks = Vec::with_capacity(tour.len());
    let mut lifts = Lifts::new(stage);
    for visit in &tour {
        let position = &positions[visit.position];
        let FocusedStop { stop, z: [z_lo, z_hi], .. } = &focused[visit.stop];
        // What the head reaches: the commands of a tilted head are rounded.
        let [stop, head] = [stop, &position.stop].map(|stop| moved(stop, position.by));
        worst_defocus = worst_defocus.max((*z_hi - stop.lpfl).max(stop.lpfl - *z_lo));
        let focus_shift = stop.lpfl - head.lpfl;
        let origin = setups.origin(position.cell, stage.origin);
        let head = HeadPosition { stop: head, stage: position.target, cell: position.cell };
        blocks.push(Block {
            pass: stage.start.pass,
            setup: used.number(position.cell),
            stage: position.target,
            focus_shift,
            retract: lifts.is_needed_to(head, origin),
            z_lo: *z_lo,
            z_hi: *z_hi,
            strokes: 0..0,
            stop,
        });
    }
    let ids = tour.iter().map(|visit| focused[visit.stop].id).collect();
    let worst_defocus_mean = focused.iter().map(|f| f.defocus_mean).fold(Nm(0), Nm::max);
    Assembly { blocks, ids, setups, used, worst_defocus, worst_defocus_mean }
}

/// Orders the strokes of blocks and lays them out; `ids` are the stops of the blocks. Returns the slope under the
/// marks of every block, too.
pub(super) fn lay_out(
    blocks: Vec<Block>,
    ids: &[StopId],
    mut cut: Cut,
    pens: dose::Pens,
    order: StrokeOrder,
    task: Task<'_>,
) -> (Program, Vec<Slope>, Fragments) {
    let slopes = ids.iter().map(|&id| slope_under(&cut, id, &pens)).collect();
    pens.assign(&mut cut.parts);
    // What is not needed any more goes before the lists of the program come: here a job needs most memory.
    let Cut { stops, parts, members, .. } = cut;
    let parts = parts.into_list();
    let task = task.of_steps(ids.len());
    let orders: Vec<Vec<OrderedFragment>> = parallel::map(ids.len(), |i| {
        let fragments = members.ordered(&parts, ids[i], order);
        task.step();
        fragments
    });
    drop(members);
    let mut program = Program { pens: pens.list, blocks, ..Program::default() };
    program.strokes.reserve_exact(parts.iter().map(|p| p.list.len()).sum());
    program.points.reserve_exact(parts.iter().map(|p| p.points.len()).sum());
    for ((id, fragments), block) in ids.iter().zip(orders).zip(&mut program.blocks) {
        let first = program.strokes.len();
        // Points are counted from the centre that the stop had when it was cut; its block may stand elsewhere.
        let cut_at = stops.stops[id.index()].stop.centre;
        let by = [cut_at.x - block.stop.centre.x, cut_at.y - block.stop.centre.y].map(|v| v as i32);
        let in_field = |p: FieldPoint| FieldPoint::new(p.x + by[0], p.y + by[1]);
        for fragment in fragments {
            append_stroke(&mut program.strokes, &mut program.points, &parts, fragment, in_field);
        }
        block.strokes = first..program.strokes.len();
    }
    (program, slopes, Cut::totals(parts))
}

/// The slope under the marks of a stop.
fn slope_under(cut: &Cut, id: StopId, pens: &dose::Pens) -> Slope {
    let mut slope = Slope::default();
    for (_, measure, _) in cut.members.fragments(&cut.parts, id) {
        let [length, slope2] = [measure.length, measure.slope2].map(f64::from);
        slope.add(length, measure.cos(), slope2, pens.gain(measure.cos()));
    }
    slope
}

/// A stop where the commands reach, which lies off by `by`.
fn moved(stop: &Stop, by: [i64; 3]) -> Stop {
    let centre = P2::new(stop.centre.x + by[0], stop.centre.y + by[1]);
    Stop { centre, lpfl: stop.lpfl + Nm(by[2]), ..stop.clone() }
}

/// Appends a fragment as a stroke, whose points `place` puts into the frame of the list.
pub(super) fn append_stroke<P>(
    strokes: &mut Vec<Stroke>,
    list: &mut Vec<P>,
    parts: &[Fragments],
    ordered: OrderedFragment,
    place: impl Fn(FieldPoint) -> P,
) {
    let OrderedFragment { member, start, reversed } = ordered;
    let (f, points) = fragment(parts, member);
    let first = list.len();
    if reversed {
        list.extend(points.iter().rev().map(|&p| place(p)));
    } else {
        // A closed stroke is turned so that it begins and ends at its start.
        // Its first point is its last: the points after the first up to the start close it.
        list.extend(points[start as usize..].iter().map(|&p| place(p)));
        list.extend(points[1..][..start as usize].iter().map(|&p| place(p)));
    }
    strokes.push(Stroke {
        source: f.source,
        segment: f.segment + start,
        reversed,
        pen: f.pen,
        first: u32::try_from(first).expect("memory holds fewer than 2^32 points"),
        len: f.len,
    });
}

impl PassStage<'_> {
    /// The positions from which the stops are marked.
    fn positions(
        &self,
        focused: &[FocusedStop],
        cells: &[CellId],
        setups: &Setups,
        lattice: &Lattice,
    ) -> Vec<Position> {
        let places: Vec<BlockPlace> = focused
            .iter()
            .zip(cells)
            .map(|(FocusedStop { stop: Stop { tilt, centre, lpfl, .. }, .. }, &cell)| BlockPlace {
                cell,
                tilt: *tilt,
                centre: *centre,
                lpfl: *lpfl,
            })
            .collect();
        let allowed = |i: usize| self.allowed_planes(&focused[i].stop, lattice);
        let sharing = if self.climb() == HeightOrder::Free { Sharing::Allowed } else { Sharing::Forbidden };
        let found = standstills(&places, lattice, self.machine.most_focus_shift(), sharing, allowed);
        found.into_iter().map(|standstill| self.position(standstill, focused, cells, setups)).collect()
    }

    /// The lowest and the highest plane, on the lattice, at which the head may stand over a stop.
    fn allowed_planes(&self, stop: &Stop, lattice: &Lattice) -> [Nm; 2] {
        let [lowest, highest] = setups::range(self.machine, 2).map(|z| z - Nm(self.origin[2]));
        let clear = self.lowest_over(stop, stop).saturating_add(self.start.lowered);
        // The lower end is rounded up.
        [lattice.floor((lowest.max(clear) + lattice.step - Nm(1)).f64()), lattice.floor(highest.f64())]
    }

    /// Where the stage stands for the stops of a standstill.
    fn position(&self, standstill: Standstill, focused: &[FocusedStop], cells: &[CellId], setups: &Setups) -> Position {
        let Standstill { members, plane } = standstill;
        // The members have centre, tilt and cell in common.
        let first = &focused[members[0]].stop;
        let cell = cells[members[0]];
        let origin = setups.origin(cell, self.origin);
        let Stand { stage: target, by } = self.machine.stand(first.tilt, first.centre, plane, origin);
        Position { stop: Stop { lpfl: plane, ..first.clone() }, members, target, by, cell }
    }

    /// The order in which the stops are marked: positions in the order of the tour, at each its stops by rising or
    /// falling focal plane, from the end that needs the smaller change of the zoom optic.
    fn sequence(&self, focused: &[FocusedStop], positions: &[Position], used: &UsedCells) -> Vec<StopOnTour> {
        let mut visits = Vec::with_capacity(focused.len());
        let mut focus_shift = self.start.focus_shift;
        for position in self.tours(focused, positions, used) {
            let Position { members, stop: head, .. } = &positions[position];
            let shift = |i: usize| focused[i].stop.lpfl - head.lpfl;
            let [low, high] = [members[0], members[members.len() - 1]].map(shift);
            let visit = |&stop: &usize| StopOnTour { position, stop };
            // A tie goes upwards. Without a zoom optic a position has one stop, and both ways are the same.
            if (high - focus_shift).abs() < (low - focus_shift).abs() {
                visits.extend(members.iter().rev().map(visit));
                focus_shift = low;
            } else {
                visits.extend(members.iter().map(visit));
                focus_shift = high;
            }
        }
        visits
    }

    /// The order in which the stage visits the positions: set-up after set-up, backwards in every other pass.
    fn tours(&self, focused: &[FocusedStop], positions: &[Position], used: &UsedCells) -> Vec<usize> {
        let targets: Vec<Commanded> = positions.iter().map(|p| self.tour_target(p, focused)).collect();
        let stops: Vec<&Stop> = positions.iter().map(|p| &p.stop).collect();
        let mut used: Vec<CellId> = used.iter().collect();
        if used.len() <= 1 {
            return self.tour(&stops, &targets, self.start.from);
        }
        // The part stays in its last set-up from one pass to the next.
        if self.start.pass.0 % 2 == 1 {
            used.reverse();
        }
        let mut from = self.start.from;
        let mut order = Vec::with_capacity(positions.len());
        for cell in used {
            let of_cell: Vec<usize> = (0..positions.len()).filter(|&i| positions[i].cell == cell).collect();
            let stops_of_cell: Vec<&Stop> = of_cell.iter().map(|&i| stops[i]).collect();
            let targets_of_cell: Vec<Commanded> = of_cell.iter().map(|&i| targets[i]).collect();
            order.extend(self.tour(&stops_of_cell, &targets_of_cell, from).into_iter().map(|i| of_cell[i]));
            // The stage is lifted while the part is set up anew.
            from =
                order.last().map_or(from, |&i| Commanded([targets[i][0], targets[i][1], self.machine.retract_z().0]));
        }
        order
    }

    /// Where the stage stands for a position, as the order of the tour sees it. Where levels have to come one after
    /// another, their focal planes decide, not those that the stage sets.
    fn tour_target(&self, position: &Position, focused: &[FocusedStop]) -> Commanded {
        let mut target = position.target;
        if self.climb() != HeightOrder::Free {
            let focus_shift = focused[position.members[0]].stop.lpfl - position.stop.lpfl;
            target[2] += self.machine.stage.z.sign() * focus_shift.0;
        }
        target
    }

    /// The order in which the stage visits positions of one set-up.
    fn tour(&self, stops: &[&Stop], targets: &[Commanded], from: Commanded) -> Vec<usize> {
        if stops.is_empty() {
            return Vec::new();
        }
        if stops.iter().any(|stop| !stop.tilt.is_upright()) {
            return self.tilted_tour(targets, stops);
        }
        // Most parts are so flat that the head never needs to lift: no stop is then below the lowest plane at which the
        // head is clear of all of the part under the stops.
        let mut area = Box2::EMPTY;
        stops.iter().for_each(|stop| area.add(stop.centre));
        let lowest = self.clearance.lowest_focus(area.lo, area.hi) + self.start.lowered;
        let lifts =
            |a: usize, b: usize| self.lowest_between(stops[a], stops[b]) < lowest && self.lifts(stops[a], stops[b]);
        let is_low = stops.iter().any(|stop| stop.lpfl < lowest);
        let stage = order::stops::Stage { machine: self.machine, from, lifts: is_low.then_some(&lifts) };
        order::stops::tour(targets, &stage, self.climb(), order::stops::EFFORT)
    }

    pub(super) fn climb(&self) -> HeightOrder {
        match self.climb {
            StopOrder::Time => HeightOrder::Free,
            StopOrder::ZUp => HeightOrder::Up,
            StopOrder::ZDown => HeightOrder::Down,
        }
    }

    /// The tour of tilted stops: levels of one place and tilt follow each other, alternately up and down, since
    /// every other move turns the part.
    fn tilted_tour(&self, targets: &[Commanded], stops: &[&Stop]) -> Vec<usize> {
        let stage = order::stops::Stage { machine: self.machine, from: self.start.from, lifts: None };
        if self.climb() != HeightOrder::Free {
            return order::stops::tour(targets, &stage, self.climb(), order::stops::EFFORT);
        }
        let mut by_column: Vec<usize> = (0..stops.len()).collect();
        let place = |i: usize| (stops[i].centre, stops[i].tilt);
        by_column.sort_by_key(|&i| (place(i), targets[i][2]));
        let columns: Vec<&[usize]> = by_column.chunk_by(|&a, &b| place(a) == place(b)).collect();
        let middles: Vec<Commanded> = columns.iter().map(|c| targets[c[c.len() / 2]]).collect();
        let mut z = stage.from[2];
        let mut order = Vec::with_capacity(stops.len());
        for c in order::stops::tour(&middles, &stage, HeightOrder::Free, order::stops::EFFORT) {
            let column = columns[c];
            let [low, high] = [column[0], column[column.len() - 1]].map(|i| targets[i][2]);
            // A column begins at the end that is nearer to the height at which the one before has ended.
            if (high - z).abs() < (low - z).abs() {
                order.extend(column.iter().rev());
                z = low;
            } else {
                order.extend(column);
                z = high;
            }
        }
        order
    }
}
