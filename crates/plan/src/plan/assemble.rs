//! From fragments to a program: focal planes set, stops ordered; then strokes ordered, and all laid out flat.

use super::cut::{Cut, OrderedFragment, StopMarks};
use super::dose;
use super::focal_plane::focal_plane;
use super::lifts::Stage;
use super::parts::fragment;
use super::setups::{self, CellId, Setups, Used};
use super::standstills::{Place, standstills};
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
    pub(super) used: Used,
    pub(super) worst_defocus: Nm,
    /// How far they would lie from focal planes at their mean height.
    pub(super) worst_defocus_mean: Nm,
}

/// How focal planes are set.
#[derive(Clone, Copy)]
pub(super) struct How {
    pub(super) level: Level,
    pub(super) lattice: Lattice,
}

/// A stop that is used: its place among the stops of the method, its focal plane set, and the lowest and highest
/// mark.
struct Placed {
    index: StopId,
    stop: Stop,
    z: [Nm; 2],
}

/// A position of the stage, from which one or more stops are marked.
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

/// Sets the focal planes of the stops that mark something, `marks` by stop, and orders them. `setups` finds those of
/// the stops' centres where the passes before have not.
pub(super) fn assemble(
    stops: &Stops,
    marks: &[StopMarks],
    stage: &Stage<'_>,
    how: How,
    setups: &dyn Fn(&[P2<Turned>]) -> Setups,
) -> Assembly {
    let mut worst = [Nm(0); 2];
    // Where commands of the head's tilt are rounded the stops lie on no lattice, and their planes need not.
    let fine = Lattice { step: Nm(1), ..how.lattice };
    let used = stops.ids().filter(|&i| !marks[i.index()].is_empty());
    let placed: Vec<Placed> = used
        .map(|index| {
            let h = &marks[index.index()].heights;
            let z = [Nm::round(h.lo), Nm::round(h.hi)];
            let stop = stops.stops[index.index()].stop.clone();
            let lattice = if stage.rounds(&stop) { &fine } else { &how.lattice };
            let (focus, mean) = focal_plane(how.level, lattice, z, h.mean());
            worst[1] = worst[1].max((z[1] - mean).max(mean - z[0]));
            Placed { index, stop: Stop { focus, ..stop }, z }
        })
        .collect();
    let centres: Vec<P2<Turned>> = placed.iter().map(|p| p.stop.centre).collect();
    let setups = stage.start.laid.as_ref().map_or_else(|| setups(&centres), |laid| laid.setups.clone());
    let cells: Vec<CellId> = centres.iter().map(|&c| setups.cell(c)).collect();
    let positions = stage.positions(&placed, &cells, &setups, &how.lattice);
    let used = Used::new(cells);
    let tour = stage.sequence(&placed, &positions, &used);
    let mut blocks = Vec::with_capacity(tour.len());
    let mut last = stage.start.before.clone().map(|(stop, cell)| (stop, cell, stage.start.from));
    for &(at, t) in &tour {
        let (Placed { stop, z, .. }, Position { stop: stand, target, by, cell, .. }) = (&placed[t], &positions[at]);
        let [stop, stand] = [stop, stand].map(|stop| moved(stop, *by));
        let origin = setups.origin(*cell, stage.origin);
        let retract = last.as_ref().is_some_and(|(before, of, from)| {
            of != cell || stage.lifts_between((before, *from), (&stand, *target), origin)
        });
        worst[0] = worst[0].max((z[1] - stop.focus).max(stop.focus - z[0]));
        blocks.push(Block {
            pass: stage.start.pass,
            setup: used.number(*cell),
            stage: *target,
            focus_shift: stop.focus - stand.focus,
            retract,
            z_lo: z[0],
            z_hi: z[1],
            strokes: 0..0,
            stop,
        });
        last = Some((stand, *cell, *target));
    }
    let ids = tour.iter().map(|&(_, t)| placed[t].index).collect();
    Assembly { blocks, ids, setups, used, worst_defocus: worst[0], worst_defocus_mean: worst[1] }
}

/// Orders the strokes of blocks and lays them out; `ids` are the stops of the blocks. Returns the slope under the
/// marks of every block, too.
pub(super) fn lay_out(
    (blocks, ids): (Vec<Block>, &[StopId]),
    mut cut: Cut,
    (pens, order): (dose::Pens, StrokeOrder),
    task: Task<'_>,
) -> (Program, Vec<Slope>, Fragments) {
    let slopes = ids.iter().map(|&id| {
        let mut slope = Slope::default();
        for (_, measure, _) in cut.members.fragments(&cut.parts, id) {
            let [length, slope2] = [measure.length, measure.slope2].map(f64::from);
            slope.add(length, measure.cos(), slope2, pens.gain(measure.cos()));
        }
        slope
    });
    let slopes = slopes.collect();
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
    for (i, (id, fragments)) in ids.iter().zip(orders).enumerate() {
        let first = program.strokes.len();
        let (from, at) = (stops.stops[id.index()].stop.centre, program.blocks[i].stop.centre);
        let by = [from.x - at.x, from.y - at.y].map(|v| v as i32);
        let in_field = |p: FieldPoint| FieldPoint::new(p.x + by[0], p.y + by[1]);
        for fragment in fragments {
            append_stroke(&mut program.strokes, &mut program.points, (&parts, fragment), in_field);
        }
        program.blocks[i].strokes = first..program.strokes.len();
    }
    (program, slopes, Cut::totals(parts))
}

/// A stop where the commands reach, which lies off by `by`.
fn moved(stop: &Stop, by: [i64; 3]) -> Stop {
    let centre = P2::new(stop.centre.x + by[0], stop.centre.y + by[1]);
    Stop { centre, focus: stop.focus + Nm(by[2]), ..stop.clone() }
}

/// Appends a fragment as a stroke, whose points `place` puts into the frame of the list.
pub(super) fn append_stroke<P>(
    strokes: &mut Vec<Stroke>,
    list: &mut Vec<P>,
    (parts, ordered): (&[Fragments], OrderedFragment),
    place: impl Fn(FieldPoint) -> P,
) {
    let OrderedFragment { member, start, reversed } = ordered;
    let (f, points) = fragment(parts, member);
    let first = list.len();
    if reversed {
        list.extend(points.iter().rev().map(|&p| place(p)));
    } else {
        // A closed stroke is turned so that it begins and ends at its start.
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

impl Stage<'_> {
    /// The positions from which the stops are marked.
    fn positions(&self, placed: &[Placed], cells: &[CellId], setups: &Setups, lattice: &Lattice) -> Vec<Position> {
        let machine = self.machine;
        let place = |(p, &cell): (&Placed, &CellId)| {
            let Stop { tilt, centre, focus, .. } = p.stop;
            Place { cell, tilt, centre, focus }
        };
        let places: Vec<Place> = placed.iter().zip(cells).map(place).collect();
        let [lowest, highest] = setups::range(machine, 2).map(|z| z - Nm(self.origin[2]));
        let allowed = |i: usize| {
            let at = &placed[i].stop;
            let clear = self.lowest_over(at, at).saturating_add(self.start.lowered);
            [lattice.floor((lowest.max(clear) + lattice.step - Nm(1)).f64()), lattice.floor(highest.f64())]
        };
        let shares = self.climb() == HeightOrder::Free;
        let found = standstills(&places, lattice, machine.most_focus_shift(), shares, allowed);
        let position = |found: super::standstills::Standstill| {
            let (Place { cell, .. }, head) = (places[found.members[0]], &placed[found.members[0]].stop);
            let origin = setups.origin(cell, self.origin);
            let Stand { stage: target, by } = machine.stand(head.tilt, head.centre, found.plane, origin);
            Position { stop: Stop { focus: found.plane, ..head.clone() }, members: found.members, target, by, cell }
        };
        found.into_iter().map(position).collect()
    }

    /// The order in which the stops are marked, as indices of position and stop: positions in the order of the tour, at each
    /// its stops by rising or falling focal plane, from the end that needs the smaller change of the zoom optic.
    fn sequence(&self, placed: &[Placed], positions: &[Position], used: &Used) -> Vec<(usize, usize)> {
        let mut out = Vec::with_capacity(placed.len());
        let mut focus_shift = self.start.focus_shift;
        for at in self.tours(placed, positions, used) {
            let Position { members, stop, .. } = &positions[at];
            let shift = |i: usize| placed[i].stop.focus - stop.focus;
            let [low, high] = [members[0], members[members.len() - 1]].map(shift);
            // A tie goes upwards. Without a zoom optic a position has one stop, and both ways are the same.
            if (high - focus_shift).abs() < (low - focus_shift).abs() {
                out.extend(members.iter().rev().map(|&i| (at, i)));
                focus_shift = low;
            } else {
                out.extend(members.iter().map(|&i| (at, i)));
                focus_shift = high;
            }
        }
        out
    }

    /// The order in which the stage visits the positions: set-up after set-up, backwards in every other pass.
    fn tours(&self, placed: &[Placed], positions: &[Position], used: &Used) -> Vec<usize> {
        // Where levels have to come one after another, their focal planes decide, not those that the stage sets.
        let target = |p: &Position| {
            let mut target = p.target;
            if self.climb() != HeightOrder::Free {
                target[2] += self.machine.stage.z.sign() * (placed[p.members[0]].stop.focus - p.stop.focus).0;
            }
            target
        };
        let targets: Vec<Commanded> = positions.iter().map(target).collect();
        let all: Vec<&Stop> = positions.iter().map(|p| &p.stop).collect();
        let mut used: Vec<CellId> = used.iter().collect();
        if used.len() <= 1 {
            return self.tour(&all, &targets, self.start.from);
        }
        if self.start.pass.0 % 2 == 1 {
            used.reverse();
        }
        let mut from = self.start.from;
        let mut order = Vec::with_capacity(positions.len());
        for cell in used {
            let members: Vec<usize> = (0..positions.len()).filter(|&i| positions[i].cell == cell).collect();
            let stops: Vec<&Stop> = members.iter().map(|&i| all[i]).collect();
            let at: Vec<Commanded> = members.iter().map(|&i| targets[i]).collect();
            order.extend(self.tour(&stops, &at, from).into_iter().map(|i| members[i]));
            from =
                order.last().map_or(from, |&i| Commanded([targets[i][0], targets[i][1], self.machine.retract_z().0]));
        }
        order
    }

    /// The order in which the stage visits positions of one set-up.
    fn tour(&self, stops: &[&Stop], targets: &[Commanded], from: Commanded) -> Vec<usize> {
        if stops.is_empty() {
            return Vec::new();
        }
        // Most parts are so flat that the head never needs to lift.
        let mut area = Box2::EMPTY;
        stops.iter().for_each(|stop| area.add(stop.centre));
        let lowest = self.clearance.lowest_focus(area.lo, area.hi) + self.start.lowered;
        if stops.iter().any(|stop| !stop.tilt.is_upright()) {
            return self.tilted_tour(targets, stops);
        }
        let lifts =
            |a: usize, b: usize| self.lowest_between(stops[a], stops[b]) < lowest && self.lifts(stops[a], stops[b]);
        let is_low = stops.iter().any(|stop| stop.focus < lowest);
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
        let mut columns: Vec<usize> = (0..stops.len()).collect();
        let key = |i: usize| (stops[i].centre, stops[i].tilt);
        columns.sort_by_key(|&i| (key(i), targets[i][2]));
        let columns: Vec<&[usize]> = columns.chunk_by(|&a, &b| key(a) == key(b)).collect();
        let middle: Vec<Commanded> = columns.iter().map(|c| targets[c[c.len() / 2]]).collect();
        let mut z = stage.from[2];
        let mut order = Vec::with_capacity(stops.len());
        for c in order::stops::tour(&middle, &stage, HeightOrder::Free, order::stops::EFFORT) {
            let column = columns[c];
            let [low, high] = [column[0], column[column.len() - 1]].map(|i| targets[i][2]);
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
