//! The strokes of a pass cut between the stops of a method, and what each stop has of them.

use super::parts::{Member, Parts, fragment};
use super::split::join;
use crate::order;
use crate::order::strokes::{Path, Visit};
use crate::partition::Stops;
use crate::split::{Fragment, Fragments, Measure, Sliver};
use terrace_core::geom::{Box2, Buckets, FieldPoint, Nm, P2, Turned};
use terrace_core::machine::Machine;
use terrace_core::motion;
use terrace_core::parallel;
use terrace_core::program::{Pen, Stop, StopId};
use terrace_input::job::StrokeOrder;

/// Fragments, chunk by chunk of the texture, and the stops that they are cut for.
pub(super) struct Cut {
    pub(super) stops: Stops,
    pub(super) parts: Parts,
    /// By stop.
    pub(super) members: Members,
    /// By stop.
    pub(super) marks: Vec<StopMarks>,
}

impl Cut {
    pub(super) fn new(stops: Stops, parts: Parts, machine: &Machine, pens: &[Pen]) -> Self {
        let members = Members::new(parts.list(), stops.stops.len());
        let marks = parallel::map(stops.stops.len(), |i| {
            StopMarks::new(&stops.stops[i].stop, members.fragments(&parts, StopId(i as u32)), machine, pens)
        });
        Self { stops, parts, members, marks }
    }

    /// What was too short to be marked.
    pub(super) fn slivers(&self) -> impl Iterator<Item = &Sliver> {
        self.parts.list().iter().flat_map(|part| &part.slivers)
    }

    /// What the stops of `of_stops` mark, and what this cut left out, given to them: `ids` has, by stop of this cut,
    /// the one of them that marks what it did.
    pub(super) fn marks_by<'a>(&self, of_stops: &'a [StopMarks], ids: &[StopId]) -> MarksOfStops<'a> {
        let new_id = |stop: StopId| ids[stop.index()];
        let renumbered = |part: &Fragments, sliver: &Sliver| LeftOutMark {
            sliver: Sliver { stop: new_id(sliver.stop), ..*sliver },
            beside: part.stops_beside(sliver).map(new_id).collect(),
        };
        let left_out = self.parts.list().iter().flat_map(|part| part.slivers.iter().map(move |s| renumbered(part, s)));
        MarksOfStops { of_stops, left_out: left_out.collect() }
    }

    /// The figures of all parts, without what they were cut into.
    pub(super) fn totals(parts: Vec<Fragments>) -> Fragments {
        parts.into_iter().fold(Fragments::default(), join)
    }
}

/// What one stop marks.
#[derive(Clone, Copy, Debug)]
pub(super) struct StopMarks {
    pub(super) heights: MarkHeights,
    /// Box of the marks on the turned part.
    pub(super) area: Box2<Turned>,
    /// Time of the marks and of the scanner's delays, without jumps, s.
    pub(super) time_s: [f64; 2],
}

impl Default for StopMarks {
    fn default() -> Self {
        Self { heights: MarkHeights::default(), area: Box2::EMPTY, time_s: [0.0; 2] }
    }
}

impl StopMarks {
    /// What a stop marks with these fragments.
    fn new<'a>(
        stop: &Stop,
        fragments: impl Iterator<Item = (&'a Fragment, &'a Measure, &'a [FieldPoint])>,
        machine: &Machine,
        pens: &[Pen],
    ) -> Self {
        let mut marks = Self::default();
        for (f, measure, points) in fragments {
            let pen = &pens[f.pen.index()];
            let mark = motion::Mark { points, speed: pen.speed, passes: pen.passes, dwell: pen.dwell };
            let time = motion::marking(machine, [mark]);
            marks.time_s[0] += time.mark_s;
            marks.time_s[1] += time.delay_s;
            marks.heights.add(f, measure, stop.z_lo.f64());
            let on_part = |p: &FieldPoint| P2::new(stop.centre.x + i64::from(p.x), stop.centre.y + i64::from(p.y));
            points.iter().for_each(|p| marks.area.add(on_part(p)));
        }
        marks
    }

    pub(super) fn is_empty(&self) -> bool {
        self.heights.lo > self.heights.hi
    }

    /// Adds what another stop marks that becomes one with this.
    pub(super) fn join(&mut self, other: &Self) {
        self.heights.join(&other.heights);
        self.area = self.area.union(other.area);
        (0..2).for_each(|k| self.time_s[k] += other.time_s[k]);
    }
}

/// What stops mark, and what was left out of the marks.
pub(super) struct MarksOfStops<'a> {
    /// By stop.
    pub(super) of_stops: &'a [StopMarks],
    pub(super) left_out: Vec<LeftOutMark>,
}

/// A mark that was left out, its stop, and those of the marks beside it on its stroke.
pub(super) struct LeftOutMark {
    pub(super) sliver: Sliver,
    pub(super) beside: Vec<StopId>,
}

/// Heights of one stop's marks, nm.
#[derive(Clone, Copy, Debug)]
pub(super) struct MarkHeights {
    pub(super) lo: f64,
    pub(super) hi: f64,
    /// From the lowest to the highest with what is kept free around each mark: what a stop must hold.
    held: [f64; 2],
    /// Integral of the height over the length.
    z_length: f64,
    length: f64,
    /// Sum over the dots, and how many there are.
    z_dots: f64,
    dots: f64,
}

impl Default for MarkHeights {
    fn default() -> Self {
        let held = [f64::INFINITY, f64::NEG_INFINITY];
        Self { lo: f64::INFINITY, hi: f64::NEG_INFINITY, held, z_length: 0.0, length: 0.0, z_dots: 0.0, dots: 0.0 }
    }
}

impl MarkHeights {
    /// Adds a fragment over the lower end of what its stop admits.
    fn add(&mut self, f: &Fragment, measure: &Measure, z_lo: f64) {
        let [lo, hi] = measure.z.map(|z| z_lo + f64::from(z));
        self.lo = self.lo.min(lo);
        self.hi = self.hi.max(hi);
        self.hold(measure.held(z_lo));
        let length = f64::from(measure.length);
        self.z_length += (z_lo + f64::from(measure.mean_z)) * length;
        self.length += length;
        // A dot has no length: its height counts once.
        if f.len == 1 {
            self.z_dots += lo;
            self.dots += 1.0;
        }
    }

    fn join(&mut self, other: &Self) {
        self.lo = self.lo.min(other.lo);
        self.hi = self.hi.max(other.hi);
        self.hold(other.held);
        self.z_length += other.z_length;
        self.length += other.length;
        self.z_dots += other.z_dots;
        self.dots += other.dots;
    }

    fn hold(&mut self, [lo, hi]: [f64; 2]) {
        self.held = [self.held[0].min(lo), self.held[1].max(hi)];
    }

    /// The lowest and the highest place that a stop must hold, in whole nanometres.
    pub(super) fn held_nm(&self) -> [Nm; 2] {
        self.held.map(Nm::round)
    }

    /// Lowest, highest and mean height in whole nanometres.
    pub(super) fn nm(&self) -> [Nm; 3] {
        [self.lo, self.hi, self.mean()].map(Nm::round)
    }

    /// Mean height over the length of the marks; of marks without length that of the dots, or the middle.
    pub(super) fn mean(&self) -> f64 {
        // Sums may round a mean beyond the ends of what it is the mean of.
        if self.length > 0.0 {
            (self.z_length / self.length).clamp(self.lo, self.hi)
        } else if self.dots > 0.0 {
            (self.z_dots / self.dots).clamp(self.lo, self.hi)
        } else {
            (self.lo + self.hi) / 2.0
        }
    }
}

/// The fragments of every stop, in the order in which they were cut.
pub(super) struct Members(Buckets<Member>);

impl Members {
    pub(super) fn new(parts: &[Fragments], stops: usize) -> Self {
        let members = (0u32..).zip(parts).flat_map(|(chunk, fragments)| {
            (0u32..).zip(&fragments.list).map(move |(index, f)| (f.stop.index(), Member { chunk, index }))
        });
        Self(Buckets::new(stops, members))
    }

    pub(super) fn of(&self, stop: StopId) -> &[Member] {
        self.0.of(stop.index())
    }

    /// The fragments of a stop.
    pub(super) fn fragments<'a>(
        &'a self,
        parts: &'a Parts,
        stop: StopId,
    ) -> impl Iterator<Item = (&'a Fragment, &'a Measure, &'a [FieldPoint])> {
        self.of(stop).iter().map(|&m| {
            let (f, points) = fragment(parts.list(), m);
            (f, parts.measure(m), points)
        })
    }

    /// The fragments of a stop in the order in which they are marked.
    pub(super) fn ordered(&self, parts: &[Fragments], stop: StopId, order: StrokeOrder) -> Vec<OrderedFragment> {
        let members = self.of(stop);
        let path = |&m: &Member| {
            let (f, points) = fragment(parts, m);
            Path { points, is_closed: f.is_figure }
        };
        let visits = match order {
            StrokeOrder::Shortest => order::strokes::order(&members.iter().map(path).collect::<Vec<_>>()),
            StrokeOrder::Drawing => order::strokes::as_drawn(members.len()),
        };
        let ordered = |Visit { stroke, start, reversed }| {
            let member = members[stroke as usize];
            OrderedFragment { member, start, reversed }
        };
        visits.into_iter().map(ordered).collect()
    }
}

/// A fragment where its stop marks it.
#[derive(Clone, Copy, Debug)]
pub(super) struct OrderedFragment {
    pub(super) member: Member,
    /// Vertex at which a closed stroke begins and ends; 0 for open ones.
    pub(super) start: u32,
    /// Whether it is marked against the direction of drawing.
    pub(super) reversed: bool,
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
        let places = |stop| members.of(StopId(stop)).iter().map(|m| (m.chunk, m.index)).collect::<Vec<_>>();
        assert_eq!(places(0), [(0, 1), (1, 0)]);
        assert_eq!(places(2), [(0, 0), (0, 2), (1, 1)]);
        assert!(places(1).is_empty() && places(3).is_empty());
    }
}
