//! Where stops stand on their tour: each inside the room that its marks leave, first so that the moves of the stage take
//! the least time, then, in what freedom is left, so that marks lie about the optical axis.
//!
//! Consumes a tour of stops with their rooms (commanded, nm); promises places inside the rooms, on the lattice of the
//! increments, from which no move takes longer in sum than from where the stops stood. What saves time is a coordinate
//! that neighbours share: an axis that stands still takes no time. So a stop, or a run of stops that share a
//! coordinate, moves to that of a neighbour where its room permits and the moves around it then take less; a run between
//! two others is shared out between them where these can take all of it. This ends in a local optimum. Two starts are
//! compared: the places as they are, and the fewest runs of stops that can share x and y, in the order of the tour.
//!
//! Then every run that shares a coordinate goes as near as it can to where its marks lie about the axis, and to the
//! middle of their heights, without making the moves at its ends longer.

use super::move_times::MoveTimer;
use terrace_core::machine::Machine;

/// A stop of the tour.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct TourStop {
    /// Where it stands.
    pub at: [i64; 3],
    /// Between which places it may stand along each axis; both lie on the lattice of `at`.
    pub room: [[i64; 2]; 3],
    /// Where it would stand with the outermost of its marks on the axis, or in the focal plane, on either side.
    pub marks: [[i64; 2]; 3],
    /// Whether a set-up begins with it: the move to it is not counted.
    pub is_first: bool,
}

/// A stop at a place where it does not stand yet, maybe.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StopAt {
    /// Its place in the tour.
    pub number: usize,
    /// Where the stage stands, commanded, nm.
    pub at: [i64; 3],
}

/// What the moves of the stage cost, and where it may stand.
#[derive(Clone, Copy)]
pub(crate) struct MoveRules<'a> {
    /// The machine.
    pub machine: &'a Machine,
    /// From where the stage comes to the first stop; None where that does not count.
    pub from: Option<[i64; 3]>,
    /// Whether the stage must lift on its way; None where it never must.
    pub lifts: Option<&'a dyn Fn(StopAt, StopAt) -> bool>,
    /// Whether the head keeps clear of the part at a standstill; None where it always does.
    pub is_clear: Option<&'a dyn Fn(StopAt) -> bool>,
}

/// Rounds of improvement at most.
const ROUNDS: usize = 30;

/// A round must save this share of the time for another to follow.
const MIN_SAVING: f64 = 1e-5;

/// A gain below this, s, is rounding.
const ROUNDING_S: f64 = 1e-9;

/// How often the way to the best place of a run is halved where not all of it is free.
const HALVINGS: usize = 12;

/// Moves the stops of a tour inside their rooms. `step` is the increment of the stage. Returns the time of their
/// moves, s.
pub(crate) fn slide(stops: &mut Vec<TourStop>, rules: &MoveRules<'_>, step: i64) -> f64 {
    let timer = MoveTimer::new(rules.machine);
    let mut best = Tour { stops: stops.clone(), rules, timer: &timer, step };
    best.shorten();
    let mut together = Tour { stops: std::mem::take(stops), rules, timer: &timer, step };
    together.stand_together();
    together.shorten();
    if together.time() < best.time() - ROUNDING_S {
        best = together;
    }
    best.centre();
    let time = best.time();
    *stops = best.stops;
    time
}

/// A tour whose stops are moved.
struct Tour<'a> {
    stops: Vec<TourStop>,
    rules: &'a MoveRules<'a>,
    timer: &'a MoveTimer,
    step: i64,
}

impl Tour<'_> {
    /// Time of all moves, s.
    fn time(&self) -> f64 {
        (0..self.stops.len()).map(|i| self.leg(i)).sum()
    }

    /// Time of the move to a stop, s; 0 behind the last.
    fn leg(&self, i: usize) -> f64 {
        let Some(stop) = self.stops.get(i) else { return 0.0 };
        match self.before(i) {
            Some(from) => self.move_s(i.checked_sub(1), from, StopAt { number: i, at: stop.at }),
            None => 0.0,
        }
    }

    /// From where the stage comes to a stop, where that counts.
    fn before(&self, i: usize) -> Option<[i64; 3]> {
        match i.checked_sub(1) {
            None => self.rules.from,
            Some(n) => (!self.stops[i].is_first).then(|| self.stops[n].at),
        }
    }

    /// Where it goes from a stop.
    fn after(&self, i: usize) -> Option<[i64; 3]> {
        self.stops.get(i + 1).filter(|next| !next.is_first).map(|next| next.at)
    }

    /// Time of the move from `from` to another stop, s. `from_number` is that of the stop that stands at `from`; None
    /// where the stage comes from there to the first stop.
    fn move_s(&self, from_number: Option<usize>, from: [i64; 3], to: StopAt) -> f64 {
        // Lifts can be asked for between two stops alone: the move to the first counts without one.
        let is_lifted = || match (self.rules.lifts, from_number) {
            (Some(lifts), Some(number)) => lifts(StopAt { number, at: from }, to),
            _ => false,
        };
        let [a, b] = [from, to.at].map(|at| at.map(|v| v as f64));
        // A move of z alone needs no lift.
        if from[..2] != to.at[..2] && is_lifted() { self.timer.lifted(a, b) } else { self.timer.between(a, b) }
    }

    /// Time of the moves to the stops `first` to `last` and from the last, s. Those inside count where a lift may
    /// depend on the place.
    fn around(&self, first: usize, last: usize) -> f64 {
        if self.rules.lifts.is_none() && last > first {
            return self.leg(first) + self.leg(last + 1);
        }
        (first..=last + 1).map(|i| self.leg(i)).sum()
    }

    /// Whether the head keeps clear of the part at the stops `first` to `last`.
    fn is_clear(&self, first: usize, last: usize) -> bool {
        self.rules
            .is_clear
            .is_none_or(|is_clear| (first..=last).all(|i| is_clear(StopAt { number: i, at: self.stops[i].at })))
    }

    /// Moves stops to places that save time, in rounds, until one saves less than [`MIN_SAVING`]. In each, single stops
    /// are moved first, then runs of stops that share x and y, then runs that share one coordinate.
    fn shorten(&mut self) {
        let xy = [true, true, false];
        let mut time = self.time();
        for _ in 0..ROUNDS {
            (0..self.stops.len()).for_each(|i| self.move_stop(i));
            self.each_run(xy, Self::split_between_neighbours);
            self.each_run(xy, |tour, first, last| tour.move_run(first, last, &[0, 1]));
            for axis in 0..3 {
                let shared = [0, 1, 2].map(|k| k == axis);
                self.each_run(shared, |tour, first, last| tour.move_run(first, last, &[axis]));
            }
            let next = self.time();
            if next > time * (1.0 - MIN_SAVING) {
                break;
            }
            time = next;
        }
    }

    /// Calls `f` with the first and the last stop of every run in which all stops stand at one place along `shared`.
    fn each_run(&mut self, shared: [bool; 3], mut f: impl FnMut(&mut Self, usize, usize)) {
        let mut first = 0;
        while first < self.stops.len() {
            let mut last = first;
            while self.after(last).is_some_and(|next| (0..3).all(|k| !shared[k] || next[k] == self.stops[last].at[k])) {
                last += 1;
            }
            f(self, first, last);
            first = last + 1;
        }
    }

    /// The room that all of these stops have along an axis; None where they share none.
    fn room(&self, first: usize, last: usize, axis: usize) -> Option<[i64; 2]> {
        let [mut lo, mut hi] = [i64::MIN, i64::MAX];
        for stop in &self.stops[first..=last] {
            (lo, hi) = (lo.max(stop.room[axis][0]), hi.min(stop.room[axis][1]));
        }
        (lo <= hi).then_some([lo, hi])
    }

    /// Moves one stop to coordinates of its neighbours where that saves time.
    fn move_stop(&mut self, i: usize) {
        let TourStop { at, room, .. } = self.stops[i];
        let neighbours = [self.before(i), self.after(i)];
        let [xs, ys, zs] =
            [0, 1, 2].map(|k| Coordinates::new(at[k], neighbours.map(|place| place.map(|p| p[k])), room[k]));
        if xs.count * ys.count * zs.count == 1 {
            return;
        }
        let mut least = self.around(i, i);
        let mut best = at;
        for &x in xs.list() {
            for &y in ys.list() {
                for &z in zs.list() {
                    self.stops[i].at = [x, y, z];
                    let time = self.around(i, i);
                    if time < least - ROUNDING_S && self.is_clear(i, i) {
                        (least, best) = (time, self.stops[i].at);
                    }
                }
            }
        }
        self.stops[i].at = best;
    }

    /// Moves a run along the axes that it shares to coordinates of its neighbours where that saves time.
    fn move_run(&mut self, first: usize, last: usize, axes: &[usize]) {
        // A single stop was moved along all axes.
        if first == last {
            return;
        }
        let old = self.stops[first].at;
        let neighbours = [self.before(first), self.after(last)];
        let mut coordinates = old.map(Coordinates::only);
        for &k in axes {
            let Some(room) = self.room(first, last, k) else { return };
            coordinates[k] = Coordinates::new(old[k], neighbours.map(|place| place.map(|p| p[k])), room);
        }
        let [xs, ys, zs] = coordinates;
        let mut least = self.around(first, last);
        let mut best = old;
        let mut now = old;
        for &x in xs.list() {
            for &y in ys.list() {
                for &z in zs.list() {
                    now = [x, y, z];
                    self.put(first, last, axes, now);
                    let time = self.around(first, last);
                    if time < least - ROUNDING_S && self.is_clear(first, last) {
                        (least, best) = (time, now);
                    }
                }
            }
        }
        if now != best {
            self.put(first, last, axes, best);
        }
    }

    /// Puts the stops `first` to `last` at `to` along some axes.
    fn put(&mut self, first: usize, last: usize, axes: &[usize], to: [i64; 3]) {
        for stop in &mut self.stops[first..=last] {
            axes.iter().for_each(|&k| stop.at[k] = to[k]);
        }
    }

    /// Splits a run between the places before and after it where its stops can all stand there and that saves time.
    fn split_between_neighbours(&mut self, first: usize, last: usize) {
        let (Some(before), Some(after)) = (self.before(first), self.after(last)) else { return };
        let may_stand =
            |stop: &TourStop, at: [i64; 3]| (0..2).all(|k| stop.room[k][0] <= at[k] && at[k] <= stop.room[k][1]);
        let run = &self.stops[first..=last];
        let at_before = run.iter().take_while(|stop| may_stand(stop, before)).count();
        let at_after = run.iter().rev().take_while(|stop| may_stand(stop, after)).count();
        if at_before + at_after < run.len() {
            return;
        }
        let old = run[0].at;
        let time = |tour: &Self| (first..=last + 1).map(|i| tour.leg(i)).sum::<f64>();
        let old_time = time(self);
        // Of stops that may stand at either place, the place before has them.
        let border = first + at_before;
        for i in first..=last {
            let to = if i < border { before } else { after };
            self.put(i, i, &[0, 1], to);
        }
        if time(self) >= old_time - ROUNDING_S || !self.is_clear(first, last) {
            self.put(first, last, &[0, 1], old);
        }
    }

    /// Puts each longest run of stops whose rooms overlap in x and y on one place of that overlap, the nearest to the place
    /// before: the fewest places that the order allows. z stays as it is.
    fn stand_together(&mut self) {
        // Whether the head keeps clear is not looked at here: where it may not, stops stay where they are.
        if self.rules.is_clear.is_some() {
            return;
        }
        let mut first = 0;
        let mut before: Option<[i64; 3]> = None;
        // Invariant: the stops before `first` stand at the fewest places, the last of them at `before`.
        while first < self.stops.len() {
            // The overlap of the rooms of the run so far.
            let mut room = self.stops[first].room;
            let mut last = first;
            while let Some(next) = self.stops.get(last + 1).filter(|next| !next.is_first) {
                let common = [0, 1].map(|k| [room[k][0].max(next.room[k][0]), room[k][1].min(next.room[k][1])]);
                if common.iter().any(|[lo, hi]| lo > hi) {
                    break;
                }
                room[..2].copy_from_slice(&common);
                last += 1;
            }
            let at = [0, 1, 2].map(|k| before.unwrap_or(self.stops[first].at)[k].clamp(room[k][0], room[k][1]));
            self.put(first, last, &[0, 1], at);
            (before, first) = (Some(at), last + 1);
        }
    }

    /// Moves every run that shares a coordinate towards the middle of its marks, as far as that costs no time.
    fn centre(&mut self) {
        for axis in [0, 1, 2, 0, 1] {
            let shared = [0, 1, 2].map(|k| k == axis);
            self.each_run(shared, |tour, first, last| tour.centre_run(first, last, axis));
        }
    }

    /// Moves a run along an axis towards the middle of its marks: there, or as near as halving the way finds to cost no
    /// time.
    fn centre_run(&mut self, first: usize, last: usize, axis: usize) {
        let Some([lo, hi]) = self.room(first, last, axis) else { return };
        let run = &self.stops[first..=last];
        let ends = run.iter().flat_map(|s| s.marks[axis]);
        let (min, max) = ends.fold((i64::MAX, i64::MIN), |(a, b), v| (a.min(v), b.max(v)));
        let old = run[0].at;
        // On the lattice of the stop.
        let steps = (min.midpoint(max) - old[axis]).div_euclid(self.step);
        let wanted = (old[axis] + steps * self.step).clamp(lo, hi);
        let most_s = self.around(first, last) + ROUNDING_S;
        let at_coordinate = |v: i64| {
            let mut at = old;
            at[axis] = v;
            at
        };
        if wanted == old[axis] || self.put_if_no_longer(first, last, axis, at_coordinate(wanted), most_s) {
            return;
        }
        // Invariant: `good` steps from the old place cost no time, `bad` steps do.
        let mut good = 0i64;
        let mut bad = (wanted - old[axis]) / self.step;
        for _ in 0..HALVINGS {
            let middle = good.midpoint(bad);
            if middle == good || middle == bad {
                break;
            }
            let at = at_coordinate(old[axis] + middle * self.step);
            if self.put_if_no_longer(first, last, axis, at, most_s) { good = middle } else { bad = middle }
        }
        self.put(first, last, &[axis], at_coordinate(old[axis] + good * self.step));
    }

    /// Puts a run at `at` along an axis; returns whether its moves take `most_s` there at most and the head keeps
    /// clear.
    fn put_if_no_longer(&mut self, first: usize, last: usize, axis: usize, at: [i64; 3], most_s: f64) -> bool {
        self.put(first, last, &[axis], at);
        self.around(first, last) <= most_s && self.is_clear(first, last)
    }
}

/// The different coordinates along one axis that a stop or a run may take.
#[derive(Clone, Copy)]
struct Coordinates {
    values: [i64; 3],
    count: usize,
}

impl Coordinates {
    fn only(v: i64) -> Self {
        Self { values: [v; 3], count: 1 }
    }

    /// Its own, and those of its neighbours as near as `room` permits.
    fn new(own: i64, neighbours: [Option<i64>; 2], [lo, hi]: [i64; 2]) -> Self {
        let mut coordinates = Self::only(own);
        for v in neighbours.into_iter().flatten().map(|v| v.clamp(lo, hi)) {
            if !coordinates.list().contains(&v) {
                coordinates.values[coordinates.count] = v;
                coordinates.count += 1;
            }
        }
        coordinates
    }

    fn list(&self) -> &[i64] {
        &self.values[..self.count]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrace_core::machine::Commanded;
    use terrace_core::motion;
    use terrace_core::random::Random;

    const STEP: i64 = 100;
    const MM: i64 = 1_000_000;

    fn rules(machine: &Machine) -> MoveRules<'_> {
        MoveRules { machine, from: None, lifts: None, is_clear: None }
    }

    /// Stops of a grid of columns with rooms of random sizes, column by column.
    fn columns(random: &mut Random, count: i64, levels: i64) -> Vec<TourStop> {
        let mut stops = Vec::new();
        for i in 0..count {
            for level in 0..levels {
                let at = [i % 5 * 40 * MM, i / 5 * 40 * MM, level * 70_000];
                let room = [0, 1, 2].map(|k| {
                    let most = if k < 2 { 40 * MM } else { 70_000 };
                    let free =
                        |random: &mut Random| random.between(0, 3).min(1) * random.between(0, most) / STEP * STEP;
                    [at[k] - free(random), at[k] + free(random)]
                });
                // Marks that leave this room in a field of 40 mm and a depth of 70 um.
                let marks = [0, 1, 2].map(|k| {
                    let half = if k < 2 { 20 * MM } else { 35_000 };
                    [room[k][1] - half, room[k][0] + half].map(|v| v.clamp(room[k][0] - half, room[k][1] + half))
                });
                stops.push(TourStop { at, room, marks, is_first: false });
            }
        }
        stops
    }

    /// Time by the model of motion.
    fn exact_s(machine: &Machine, stops: &[TourStop]) -> f64 {
        let at = |s: &TourStop| Commanded(s.at);
        stops.windows(2).map(|w| motion::stage_move(machine, at(&w[0]), at(&w[1]), None).total_s()).sum()
    }

    #[test]
    fn a_stop_may_take_its_own_coordinate_and_those_of_its_neighbours_within_its_room() {
        let list = |neighbours| Coordinates::new(5, neighbours, [2, 8]).list().to_vec();
        assert_eq!(list([None, None]), [5]);
        assert_eq!(list([Some(3), Some(7)]), [5, 3, 7]);
        assert_eq!(list([Some(-9), Some(99)]), [5, 2, 8], "as near as the room permits");
        assert_eq!(list([Some(5), Some(3)]), [5, 3], "each once");
        assert_eq!(list([Some(10), Some(8)]), [5, 8]);
    }

    #[test]
    fn stops_stay_in_their_rooms_on_the_lattice_and_moves_take_less_time() {
        let machine = Machine::built_in("xyz-galvo-40").expect("a profile");
        let mut random = Random::new(11);
        for _ in 0..40 {
            let before = {
                let (count, levels) = (random.between(1, 12), random.between(1, 9));
                columns(&mut random, count, levels)
            };
            let mut after = before.clone();
            let time = slide(&mut after, &rules(&machine), STEP);
            let [old, new] = [&before, &after].map(|stops| exact_s(&machine, stops));
            assert!((time - new).abs() <= 3e-4 * new + 1e-9, "{time} {new}");
            assert!(new <= old * (1.0 + 3e-4) + 1e-9, "{new} {old}");
            for (b, a) in before.iter().zip(&after) {
                assert_eq!((b.room, b.marks), (a.room, a.marks));
                for k in 0..3 {
                    assert!(a.room[k][0] <= a.at[k] && a.at[k] <= a.room[k][1]);
                    assert_eq!((a.at[k] - b.at[k]) % STEP, 0);
                }
            }
        }
    }

    #[test]
    fn stops_that_can_all_stand_over_one_place_stand_where_their_marks_lie_about_the_axis() {
        let machine = Machine::built_in("xyz-galvo-40").expect("a profile");
        let stop = |level: i64, from: i64, to: i64| {
            let at = [0, 0, level * 70_000];
            let room = [[to - 20 * MM, from + 20 * MM], [-5 * MM, 5 * MM], [at[2]; 2]];
            TourStop { at, room, marks: [[from, to], [-15 * MM, 15 * MM], [at[2]; 2]], is_first: false }
        };
        // Marks from 2 to 18 mm beside the axis in all, each level a part of it.
        let mut stops = vec![stop(0, 2 * MM, 10 * MM), stop(1, 5 * MM, 18 * MM), stop(2, 3 * MM, 12 * MM)];
        slide(&mut stops, &rules(&machine), STEP);
        assert!(stops.iter().all(|s| s.at[..2] == [10 * MM, 0]), "{stops:?}");
    }

    #[test]
    fn runs_that_share_a_place_are_the_fewest_that_the_order_allows() {
        let machine = Machine::built_in("xyz-galvo-40").expect("a profile");
        let (timer, mut random) = (MoveTimer::new(&machine), Random::new(12));
        for _ in 0..60 {
            let stops = columns(&mut random, 6, 3);
            let rules = rules(&machine);
            let mut tour = Tour { stops: stops.clone(), rules: &rules, timer: &timer, step: STEP };
            tour.stand_together();
            let runs = 1 + tour.stops.windows(2).filter(|w| w[0].at[..2] != w[1].at[..2]).count();
            // The fewest runs up to every stop, whatever the runs before.
            let mut fewest = vec![0; stops.len() + 1];
            for end in 1..=stops.len() {
                let shared = |begin: &usize| {
                    let room = |k: usize, end_: usize, pick: fn(i64, i64) -> i64| {
                        stops[*begin..end].iter().map(|s| s.room[k][end_]).reduce(pick).expect("a stop")
                    };
                    (0..2).all(|k| room(k, 0, i64::max) <= room(k, 1, i64::min))
                };
                fewest[end] = (0..end).filter(shared).map(|begin| fewest[begin] + 1).min().expect("a run of one");
            }
            assert!(runs <= fewest[stops.len()], "{runs} {fewest:?}");
        }
    }

    #[test]
    fn a_lift_and_a_place_over_which_the_head_is_too_low_are_kept_out_of() {
        let machine = Machine::built_in("xyz-galvo-40").expect("a profile");
        // Beside x = 30 mm the part is high.
        let high = |v: i64| v > 30 * MM;
        let is_clear = |stop: StopAt| !high(stop.at[0]);
        let lifts = |_: StopAt, to: StopAt| high(to.at[0]);
        let rules = MoveRules { lifts: Some(&lifts), is_clear: Some(&is_clear), ..rules(&machine) };
        let stop = |x: i64, room: [i64; 2]| TourStop {
            at: [x, 0, 0],
            room: [room, [0; 2], [0; 2]],
            marks: [room, [0; 2], [0; 2]],
            is_first: false,
        };
        let mut stops =
            vec![stop(0, [0, 40 * MM]), stop(20 * MM, [10 * MM, 40 * MM]), stop(40 * MM, [40 * MM, 40 * MM])];
        slide(&mut stops, &rules, STEP);
        assert!(stops[..2].iter().all(|s| !high(s.at[0])) && stops[0].at == stops[1].at, "{stops:?}");
    }
}
