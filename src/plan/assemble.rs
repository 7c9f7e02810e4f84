//! From fragments to a program: gathered by stop, focal planes set, stops and strokes ordered, all laid
//! out flat.

use super::dose;
use super::focal_plane::focal_plane;
use super::setups::{self, CellId, Setups, Used};
use super::standstills::{Place, standstills};
use super::start::Start;
use crate::clearance::{Clearance, Head};
use crate::geom::{Box2, Buckets, FieldPoint, Nm, P2, Turned};
use crate::job::{Level, StopOrder, StrokeOrder};
use crate::machine::{Commanded, Machine, Origin, Stand, TiltAngles};
use crate::order;
use crate::order::stops::HeightOrder;
use crate::order::strokes::{Path, Visit};
use crate::parallel;
use crate::partition::{Lattice, Stops};
use crate::program::{Block, Program, Slope, Stop, StopId, Stroke};
use crate::progress::Task;
use crate::split::{Fragment, Fragments};

/// A program in order, and how far its marks lie from their focal planes at most.
pub(super) struct Assembly {
    pub(super) program: Program,
    /// The stop of every block, among those of the method.
    pub(super) ids: Vec<StopId>,
    pub(super) setups: Setups,
    /// The cells of its set-ups.
    pub(super) used: Used,
    pub(super) worst_defocus: Nm,
    /// How far they would lie from focal planes at their mean height.
    pub(super) worst_defocus_mean: Nm,
    /// Slope under the marks of every block.
    pub(super) slopes: Vec<Slope>,
}

/// How focal planes are set and strokes ordered.
#[derive(Clone, Copy)]
pub(super) struct How {
    pub(super) level: Level,
    pub(super) strokes: StrokeOrder,
    pub(super) lattice: Lattice,
}

/// The stage as a pass finds it.
pub(super) struct Stage<'a> {
    pub(super) machine: &'a Machine,
    pub(super) clearance: &'a Clearance,
    pub(super) start: &'a Start,
    /// Where the part's origin lies, nm.
    pub(super) origin: Origin,
    pub(super) climb: StopOrder,
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
    /// Their indices, by rising focal plane.
    members: Vec<usize>,
    /// Where the head stands, its focus the plane that the stage sets.
    stop: Stop,
    target: Commanded,
    /// By how much the target lies off the place of the stop, nm, in x, y and z of the turned part.
    by: [i64; 3],
    cell: CellId,
}

/// Gathers fragments by stop, orders stops and strokes, and lays the program out flat. `setups` finds those of
/// the stops' centres where the passes before have not.
pub(super) fn assemble(
    stops: &Stops,
    parts: &[Fragments],
    pens: &dose::Pens,
    stage: &Stage<'_>,
    how: How,
    setups: &dyn Fn(&[P2<Turned>]) -> Setups,
    task: Task<'_>,
) -> Assembly {
    let members = Members::new(parts, stops.stops.len());
    let (heights, slopes) = measure(parts, stops.stops.len(), pens);
    let mut worst = [Nm(0); 2];
    // Where commands of the head's tilt are rounded the stops lie on no lattice, and their planes need not.
    let fine = Lattice { step: Nm(1), ..how.lattice };
    let used = stops.ids().filter(|&i| !members.of(i).is_empty());
    let placed: Vec<Placed> = used
        .map(|index| {
            let h = &heights[index.index()];
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
    let [strokes, tours] = task.split([3, 1]);
    let strokes = strokes.of_steps(placed.len());
    let in_order = |p: &Placed| {
        let visits = members.ordered(parts, p.index, how.strokes);
        strokes.step();
        visits
    };
    let (tour, orders): (_, Vec<Vec<Visit>>) = parallel::both(
        || {
            let sequence = stage.sequence(&placed, &positions, &used);
            drop(tours);
            sequence
        },
        || parallel::map(placed.len(), |i| in_order(&placed[i])),
    );
    let mut program = Program { pens: pens.list.clone(), ..Program::default() };
    program.strokes.reserve_exact(members.len());
    program.points.reserve_exact(parts.iter().map(|p| p.points.len()).sum());
    program.blocks.reserve_exact(tour.len());
    let mut last = stage.start.before.clone().map(|(stop, cell)| (stop, cell, stage.start.from));
    for &(at, t) in &tour {
        let (Placed { index, stop, z }, Position { stop: stand, target, by, cell, .. }) = (&placed[t], &positions[at]);
        let [stop, stand] = [stop, stand].map(|stop| moved(stop, *by));
        let first_stroke = program.strokes.len();
        let list = members.of(*index);
        let first_point = program.points.len();
        orders[t]
            .iter()
            .for_each(|visit| append_stroke(&mut program, parts, list[visit.stroke as usize], *visit, pens));
        for p in &mut program.points[first_point..] {
            *p = FieldPoint::new(p.x - by[0] as i32, p.y - by[1] as i32);
        }
        let origin = setups.origin(*cell, stage.origin);
        let retract = last.as_ref().is_some_and(|(before, of, from)| {
            of != cell || stage.lifts_between((before, *from), (&stand, *target), origin)
        });
        worst[0] = worst[0].max((z[1] - stop.focus).max(stop.focus - z[0]));
        program.blocks.push(Block {
            pass: stage.start.pass,
            setup: used.number(*cell),
            stage: *target,
            focus_shift: stop.focus - stand.focus,
            retract,
            z_lo: z[0],
            z_hi: z[1],
            strokes: first_stroke..program.strokes.len(),
            stop,
        });
        last = Some((stand, *cell, *target));
    }
    let ids: Vec<StopId> = tour.iter().map(|&(_, t)| placed[t].index).collect();
    let slopes = ids.iter().map(|id| slopes[id.index()]).collect();
    Assembly { program, ids, setups, used, worst_defocus: worst[0], worst_defocus_mean: worst[1], slopes }
}

/// A stop where the commands reach, which lies off by `by`.
fn moved(stop: &Stop, by: [i64; 3]) -> Stop {
    let centre = P2::new(stop.centre.x + by[0], stop.centre.y + by[1]);
    Stop { centre, focus: stop.focus + Nm(by[2]), ..stop.clone() }
}

/// Heights of one block's marks, nm.
#[derive(Clone, Copy)]
struct Heights {
    lo: f64,
    hi: f64,
    /// Integral of the height over the length.
    z_length: f64,
    length: f64,
    /// Sum over the dots, and how many there are.
    z_dots: f64,
    dots: f64,
}

impl Heights {
    const NONE: Self =
        Self { lo: f64::INFINITY, hi: f64::NEG_INFINITY, z_length: 0.0, length: 0.0, z_dots: 0.0, dots: 0.0 };

    fn add(&mut self, f: &Fragment) {
        self.lo = self.lo.min(f.z[0]);
        self.hi = self.hi.max(f.z[1]);
        self.z_length += f.z_length;
        self.length += f.length;
        if f.len == 1 {
            self.z_dots += f.z[0];
            self.dots += 1.0;
        }
    }

    fn mean(&self) -> f64 {
        if self.length > 0.0 {
            (self.z_length / self.length).clamp(self.lo, self.hi)
        } else if self.dots > 0.0 {
            (self.z_dots / self.dots).clamp(self.lo, self.hi)
        } else {
            (self.lo + self.hi) / 2.0
        }
    }
}

/// Heights and slopes under the marks of every stop.
fn measure(parts: &[Fragments], stops: usize, pens: &dose::Pens) -> (Vec<Heights>, Vec<Slope>) {
    let (mut heights, mut slopes) = (vec![Heights::NONE; stops], vec![Slope::default(); stops]);
    for f in parts.iter().flat_map(|p| &p.list) {
        heights[f.stop.index()].add(f);
        slopes[f.stop.index()].add(f.length, dose::mean_cos(f), f.slope2, pens.gain(f));
    }
    (heights, slopes)
}

/// The fragments of every stop, in the order in which they were cut: chunk and index in it.
pub(super) struct Members(Buckets<(u32, u32)>);

impl Members {
    pub(super) fn new(parts: &[Fragments], stops: usize) -> Self {
        let members = (0u32..)
            .zip(parts)
            .flat_map(|(part, fragments)| (0u32..).zip(&fragments.list).map(move |(i, f)| (f.stop.index(), (part, i))));
        Self(Buckets::new(stops, members))
    }

    fn len(&self) -> usize {
        self.0.items().len()
    }

    pub(super) fn of(&self, stop: StopId) -> &[(u32, u32)] {
        self.0.of(stop.index())
    }

    /// The order in which the fragments of a stop are marked.
    pub(super) fn ordered(&self, parts: &[Fragments], stop: StopId, order: StrokeOrder) -> Vec<Visit> {
        let members = self.of(stop);
        let path = |&m: &(u32, u32)| {
            let (f, points) = fragment(parts, m);
            Path { points, is_closed: f.is_figure }
        };
        match order {
            StrokeOrder::Shortest => order::strokes::order(&members.iter().map(path).collect::<Vec<_>>()),
            StrokeOrder::Drawing => order::strokes::as_drawn(members.len()),
        }
    }
}

/// A fragment and its points.
fn fragment(parts: &[Fragments], (part, i): (u32, u32)) -> (&Fragment, &[FieldPoint]) {
    let part = &parts[part as usize];
    let f = &part.list[i as usize];
    (f, &part.points[f.first as usize..(f.first + f.len) as usize])
}

/// The fragments of some members.
pub(super) fn segments<'a>(parts: &'a [Fragments], members: &'a [(u32, u32)]) -> impl Iterator<Item = &'a Fragment> {
    members.iter().map(|&m| fragment(parts, m).0)
}

/// Appends a fragment as a stroke.
pub(super) fn append_stroke(
    program: &mut Program,
    parts: &[Fragments],
    member: (u32, u32),
    visit: Visit,
    pens: &dose::Pens,
) {
    let Visit { start, reversed, .. } = visit;
    let (f, points) = fragment(parts, member);
    let first = program.points.len();
    if reversed {
        program.points.extend(points.iter().rev());
    } else {
        // A closed stroke is turned so that it begins and ends at its start.
        program.points.extend_from_slice(&points[start as usize..]);
        program.points.extend_from_slice(&points[1..][..start as usize]);
    }
    program.strokes.push(Stroke {
        source: f.source,
        segment: f.segment + start,
        reversed,
        pen: pens.of(f),
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

    /// The order in which the stops are marked: positions as the stage visits them, and at each the stops from the end
    /// that is nearer to where the zoom optic is. Indices of position and stop.
    fn sequence(&self, placed: &[Placed], positions: &[Position], used: &Used) -> Vec<(usize, usize)> {
        let mut out = Vec::with_capacity(placed.len());
        let mut focus_shift = self.start.focus_shift;
        for at in self.tours(placed, positions, used) {
            let Position { members, stop, .. } = &positions[at];
            let shift = |i: usize| placed[i].stop.focus - stop.focus;
            let [low, high] = [members[0], members[members.len() - 1]].map(shift);
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

    /// Whether the commands of a stop are those of a tilted head, which are rounded.
    fn rounds(&self, stop: &Stop) -> bool {
        self.machine.tilts_head() && !stop.tilt.is_upright()
    }

    /// Whether the stage must lift between two stops with their commands, of a part that lies at `origin`.
    pub(super) fn lifts_between(
        &self,
        (a, from): (&Stop, Commanded),
        (b, to): (&Stop, Commanded),
        origin: Origin,
    ) -> bool {
        if !self.rounds(a) && !self.rounds(b) {
            return self.lifts(a, b);
        }
        // The surface is that before it sank, as everywhere here.
        let Origin([x, y, z]) = origin;
        let head =
            Head { machine: self.machine, origin: Origin([x, y, z + self.start.lowered.0]), clearance: self.clearance };
        head.over_move((from, a.tilt), (to, b.tilt)) > Nm(0)
    }

    /// Whether the stage must lift between two stops.
    fn lifts(&self, a: &Stop, b: &Stop) -> bool {
        if a.tilt == b.tilt {
            return a.centre != b.centre && self.lowest_between(a, b) - self.start.lowered < self.lowest_over(a, b);
        }
        let turn = |u: i64, v: i64| self.machine.turn(TiltAngles([u, v]), self.origin);
        let [[a0, a1], [b0, b1]] = [a.tilt.0, b.tilt.0];
        a.focus - self.start.lowered
            < self.clearance.lowest_swing([turn(a0, a1), turn(b0, a1), turn(a0, b1), turn(b0, b1)])
    }

    /// The lowest focal plane on the way from one stop to another of the same tilt, without a lift.
    fn lowest_between(&self, a: &Stop, b: &Stop) -> Nm {
        if self.machine.stage.diagonal { a.focus.min(b.focus) } else { a.focus }
    }

    /// Whether the head keeps clear of the part where it stands at a stop.
    pub(super) fn is_clear(&self, stop: &Stop) -> bool {
        stop.focus - self.start.lowered >= self.lowest_over(stop, stop)
    }

    /// The lowest focal plane at which the stage may go straight from one stop to another of the same tilt.
    fn lowest_over(&self, a: &Stop, b: &Stop) -> Nm {
        if a.tilt.is_upright() {
            return self.clearance.lowest_focus(a.centre, b.centre);
        }
        let turn = self.machine.turn(a.tilt, self.origin);
        self.clearance.lowest_swing([turn; 4])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn members_lists_every_fragment_once_at_its_stop() {
        let fragment = |stop: u32| Fragment { stop: StopId(stop), ..Fragment::default() };
        let part =
            |stops: &[u32]| Fragments { list: stops.iter().map(|&s| fragment(s)).collect(), ..Default::default() };
        let parts = [part(&[2, 0, 2]), part(&[0, 2])];
        let members = Members::new(&parts, 4);
        assert_eq!(members.of(StopId(0)), [(0, 1), (1, 0)]);
        assert_eq!(members.of(StopId(1)), []);
        assert_eq!(members.of(StopId(2)), [(0, 0), (0, 2), (1, 1)]);
        assert_eq!(members.of(StopId(3)), []);
    }
}
