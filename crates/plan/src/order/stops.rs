//! The tour of the stage, judged by the time that its moves take.
//!
//! Consumes commanded positions (nm) and the machine; promises an order that takes no longer than the
//! best of the plain ones: serpentines by columns and by rows with levels alternately up and down, and
//! always going to the nearest stop. The best of these is improved by the moves of the `tour` module with
//! the times of `terrace_core::motion`, then by random changes that are kept where they pay. So stops over one
//! place come one after another where moves of z alone are cheap, and short moves are what counts where
//! they are not. Everything follows from the stops alone: the random numbers have a fixed seed.
//!
//! # Limits
//! The search takes a move to cost the same both ways; where the stage must lift one way only it takes the
//! mean. The result is judged by the true times. With levels in one direction only, the stops of one level
//! are toured one level after another.

use std::cmp::Ordering;

use super::endpoints::{Endpoints, greedy};
use super::kd_tree::Tree;
use super::move_times::MoveTimer;
use super::tour::Tour;
use terrace_core::machine::{Commanded, Machine};
use terrace_core::motion;
use terrace_core::parallel;

/// In which order levels may be visited.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HeightOrder {
    /// In any.
    Free,
    /// No focal plane lower than the one before.
    Up,
    /// No focal plane higher than the one before.
    Down,
}

/// What the moves of the stage cost.
#[derive(Clone, Copy)]
pub struct Stage<'a> {
    /// The machine.
    pub machine: &'a Machine,
    /// Commanded position from which the stage comes to the first stop, nm.
    pub from: Commanded,
    /// Whether the stage must lift on its way between two stops, given by index; None where it never must.
    pub lifts: Option<&'a (dyn Fn(usize, usize) -> bool + Sync)>,
}

/// Random changes for every stop, as the driver asks for them: eight times as many gain less than a quarter
/// of a percent on 3,500 stops and cost a quarter of a second.
pub const EFFORT: usize = 1;

/// Most random changes of one tour for one unit of effort: beyond, they would take minutes.
const MOST_PERTURBATIONS: usize = 5000;

/// Stops around each stop that moves look at: the nearest, and the nearest over other places.
const NEIGHBOURS: usize = 5;

/// Stops whose neighbours are looked for on one thread.
const CHUNK: usize = 256;

/// A gain below this, s, is rounding.
const LEAST: f64 = 1e-9;

/// Of stops at equal cost the one that is nearer in space is the neighbour: s for every nm.
const TIE: f64 = 1e-12;

/// The order in which the stage visits the positions `stops` (commanded, nm), as indices. `effort` is how
/// many random changes are tried for every stop; the time this takes grows with it.
pub fn tour(stops: &[Commanded], stage: &Stage<'_>, climb: HeightOrder, effort: usize) -> Vec<usize> {
    let mut order: Vec<usize> = (0..stops.len()).collect();
    if climb == HeightOrder::Free {
        return path(stops, stage, order, effort);
    }
    let direction = if climb == HeightOrder::Up { 1 } else { -1 };
    let height = |i: usize| direction * stage.machine.stage.z.sign() * stops[i][2];
    order.sort_by_key(|&i| height(i));
    let mut by_levels: Vec<usize> = Vec::with_capacity(stops.len());
    for level in order.chunk_by(|&a, &b| height(a) == height(b)) {
        let from = by_levels.last().map_or(stage.from, |&last| stops[last]);
        by_levels.extend(path(stops, &Stage { from, ..*stage }, level.to_vec(), effort));
    }
    by_levels
}

/// Time of the moves in an order, from where the stage comes from to the last stop, s.
pub fn time(stops: &[Commanded], stage: &Stage<'_>, order: &[usize]) -> f64 {
    let first = order.first().map_or(0.0, |&i| cost(stage.machine, stage.from, stops[i]));
    first + order.windows(2).map(|w| step(stops, stage, w[0], w[1])).sum::<f64>()
}

fn cost(machine: &Machine, from: Commanded, to: Commanded) -> f64 {
    motion::stage_move(machine, from, to, None).total_s()
}

/// Time from stop `a` to stop `b`.
fn step(stops: &[Commanded], stage: &Stage<'_>, a: usize, b: usize) -> f64 {
    let lift = stage.lifts.filter(|lifts| lifts(a, b)).map(|_| stage.machine.retract_z());
    motion::stage_move(stage.machine, stops[a], stops[b], lift).total_s()
}

/// The tour of some of the stops.
fn path(stops: &[Commanded], stage: &Stage<'_>, some: Vec<usize>, effort: usize) -> Vec<usize> {
    if some.len() < 2 {
        return some;
    }
    let costs = PathCosts::new(stops, stage, &some);
    let at = costs.at.as_slice();
    // A stop is entered and left at one place, so it has one endpoint.
    let mut endpoints = Endpoints::with_capacity(at.len(), at.len());
    (0..at.len()).for_each(|_| endpoints.closed(1));
    let mut tree = Tree::new(at[1..].iter().copied());
    // 2-opt and Or-opt end in a local optimum: which one is decided by where they start, so the best of eleven
    // plain tours is taken.
    let mut starts = strips(at);
    starts.push(greedy(&endpoints, &mut tree, |endpoint| at[endpoint as usize], |gap| costs.over(gap)));
    tree.fill();
    let time_s = |seq: &[u32]| time(stops, stage, &costs.stops_of(seq));
    let timed_starts = parallel::map_items(starts, |_, seq| (time_s(&seq), seq));
    let Some((start_s, start)) = timed_starts.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)) else { return some };
    let lists = neighbours(&tree, &costs);
    // A move changes the whole tour, but where that would be long.
    let longest = (100_000_000 / some.len()).max(1000);
    let both_ways = |a: u32, b: u32| costs.both_ways(a, b);
    let mut tour = Tour::new(&endpoints, start.clone(), longest, LEAST, both_ways, |endpoint, limit, found| {
        found.clear();
        found.extend(lists[endpoint as usize].iter().take_while(|f| f.0 < limit));
    });
    tour.improve();
    tour.perturb(effort * some.len().min(MOST_PERTURBATIONS), 1);
    let better = tour.into_seq();
    costs.stops_of(if time_s(&better) < start_s { &better } else { &start })
}

/// What the moves of a path cost, between its endpoints: endpoint 0 is where the stage comes from, the others are
/// stops.
struct PathCosts<'a> {
    stage: &'a Stage<'a>,
    timer: MoveTimer,
    /// The stop of every endpoint but the first.
    some: &'a [usize],
    /// Where each endpoint lies, commanded, nm.
    at: Vec<[f64; 3]>,
}

impl<'a> PathCosts<'a> {
    fn new(stops: &[Commanded], stage: &'a Stage<'a>, some: &'a [usize]) -> Self {
        let endpoints = std::iter::once(stage.from).chain(some.iter().map(|&i| stops[i]));
        let at = endpoints.map(|p| p.0.map(|v| v as f64)).collect();
        Self { stage, timer: MoveTimer::new(stage.machine), some, at }
    }

    /// Time of a move over a gap, s, and a little for its length: of stops at equal cost the nearer one counts.
    #[inline]
    fn over(&self, gap: [f64; 3]) -> f64 {
        self.timer.over(gap) + TIE * gap.iter().map(|v| v * v).sum::<f64>().sqrt()
    }

    /// Time of the move between two endpoints, s, the mean of both ways.
    #[inline]
    fn both_ways(&self, a: u32, b: u32) -> f64 {
        let [from, to] = [a, b].map(|endpoint| self.at[endpoint as usize]);
        // Endpoint 0 is no stop, for which a lift could be asked.
        let Some(lifts) = self.stage.lifts.filter(|_| a > 0 && b > 0) else { return self.timer.between(from, to) };
        let [i, j] = [a, b].map(|endpoint| self.some[endpoint as usize - 1]);
        0.5 * (self.one_way(lifts(i, j), from, to) + self.one_way(lifts(j, i), to, from))
    }

    fn one_way(&self, is_lifted: bool, from: [f64; 3], to: [f64; 3]) -> f64 {
        if is_lifted { self.timer.lifted(from, to) } else { self.timer.between(from, to) }
    }

    /// The stops of a sequence of endpoints, which begins with endpoint 0.
    fn stops_of(&self, seq: &[u32]) -> Vec<usize> {
        seq[1..].iter().map(|&endpoint| self.some[endpoint as usize - 1]).collect()
    }
}

/// Serpentines over all but place 0, where they start: bands along x or y, in them column by column, each
/// from the end that is nearer. Bands are as narrow as the distinct places, or hold several of them.
fn strips(at: &[[f64; 3]]) -> Vec<Vec<u32>> {
    let mut tours = Vec::new();
    for axis in [0, 1] {
        // Across the bands, along them, and up.
        let key = |endpoint: &u32| {
            let p = at[*endpoint as usize];
            [p[1 - axis], p[axis], p[2]]
        };
        let mut endpoints: Vec<u32> = (1..at.len() as u32).collect();
        endpoints.sort_by(|a, b| compare(key(a), key(b), [0, 1, 2]));
        // Stops over one place are one column, which is climbed in one go.
        let columns = endpoints.chunk_by(|a, b| key(a)[..2] == key(b)[..2]).count() as f64;
        let span = |k: usize| {
            let values = || endpoints.iter().map(|p| key(p)[k]);
            values().fold(f64::NEG_INFINITY, f64::max) - values().fold(f64::INFINITY, f64::min)
        };
        // Bands in which neighbours along and across are about as far apart.
        let even = (span(0) * span(1) / columns).sqrt();
        for width in [0.0, 0.5 * even, even, 1.5 * even, 2.0 * even] {
            let along = |a: &u32, b: &u32| compare(key(a), key(b), [1, 0, 2]);
            tours.push(strip(&endpoints, width, key, along, at[0][2]));
        }
    }
    tours
}

/// Which of two places comes first by their coordinates in this order.
fn compare(a: [f64; 3], b: [f64; 3], coordinates: [usize; 3]) -> Ordering {
    coordinates.into_iter().map(|k| a[k].total_cmp(&b[k])).find(|o| o.is_ne()).unwrap_or(Ordering::Equal)
}

/// One serpentine through `endpoints`, which stand band by band; `along` sorts a band.
fn strip(
    endpoints: &[u32],
    width: f64,
    key: impl Fn(&u32) -> [f64; 3],
    along: impl Fn(&u32, &u32) -> Ordering,
    mut z: f64,
) -> Vec<u32> {
    let mut seq = vec![0];
    let mut rest = endpoints;
    let mut forward = true;
    // Invariant: `seq` has the endpoints before `rest`, and ends at height `z`.
    while let Some(first) = rest.first() {
        let end = key(first)[0] + width;
        let (band, more) = rest.split_at(rest.partition_point(|p| key(p)[0] <= end));
        let mut band = band.to_vec();
        band.sort_by(&along);
        let mut columns: Vec<&[u32]> = band.chunk_by(|a, b| key(a)[..2] == key(b)[..2]).collect();
        if !forward {
            columns.reverse();
        }
        for column in columns {
            let [low, high] = [column[0], column[column.len() - 1]].map(|p| key(&p)[2]);
            // From the end that is nearer to where the last column left off: levels go alternately up and down.
            if (high - z).abs() < (low - z).abs() {
                seq.extend(column.iter().rev());
                z = low;
            } else {
                seq.extend(column);
                z = high;
            }
        }
        (rest, forward) = (more, !forward);
    }
    seq
}

/// The neighbours of every endpoint: the nearest stops, and the nearest that are not over the same place.
/// With their costs, cheapest first.
fn neighbours(tree: &Tree<3>, costs: &PathCosts<'_>) -> Vec<Vec<(f64, u32)>> {
    let count = costs.at.len();
    let columns = Columns::new(&costs.at);
    let chunks = parallel::map(count.div_ceil(CHUNK), |chunk| {
        let endpoints = chunk * CHUNK..count.min((chunk + 1) * CHUNK);
        endpoints.map(|endpoint| neighbours_of(endpoint, tree, &columns, costs)).collect::<Vec<_>>()
    });
    chunks.into_iter().flatten().collect()
}

/// The neighbours of an endpoint with their costs, cheapest first.
fn neighbours_of(endpoint: usize, tree: &Tree<3>, columns: &Columns, costs: &PathCosts<'_>) -> Vec<(f64, u32)> {
    let at = costs.at.as_slice();
    let over = |gap| costs.over(gap);
    let mut near = Nearest::default();
    // The tree holds stops alone: its item 0 is endpoint 1.
    tree.around(at[endpoint], (endpoint as u32).checked_sub(1), f64::INFINITY, over, |distance, item| {
        let other = item as usize + 1;
        if other == endpoint { near.limit() } else { near.insert(distance, other as u32) }
    });
    let mut beside = Nearest::default();
    columns.nearest_in_others(endpoint, at, over, &mut beside);
    let mut list = near.0;
    list.extend(beside.0.iter().filter(|&&(_, p)| at[p as usize][..2] != at[endpoint][..2]));
    list.iter_mut().for_each(|(cost, other)| *cost = costs.both_ways(endpoint as u32, *other));
    list.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    // A stop may be among the nearest of both kinds.
    list.dedup();
    list
}

/// The nearest of what was found, [`NEIGHBOURS`] at most, by distance.
#[derive(Default)]
struct Nearest(Vec<(f64, u32)>);

impl Nearest {
    /// The distance below which another one counts.
    fn limit(&self) -> f64 {
        if self.0.len() < NEIGHBOURS { f64::INFINITY } else { self.0[NEIGHBOURS - 1].0 }
    }

    /// Inserts what lies nearer than the limit; returns the new limit.
    fn insert(&mut self, d: f64, endpoint: u32) -> f64 {
        let place = self.0.partition_point(|f| f.0 <= d);
        self.0.insert(place, (d, endpoint));
        self.0.truncate(NEIGHBOURS);
        self.limit()
    }
}

/// Stops over one place, place by place. Thousands of levels may lie over one: nearest stops over other places are
/// looked for among the places.
struct Columns {
    tree: Tree<2>,
    /// The stops of every place, upwards: height and endpoint.
    levels: Vec<Vec<(f64, u32)>>,
    /// The place of every endpoint but the first, from which the stage comes.
    of: Vec<u32>,
}

impl Columns {
    fn new(at: &[[f64; 3]]) -> Self {
        let mut order: Vec<u32> = (1..at.len() as u32).collect();
        let key = |&p: &u32| at[p as usize];
        order.sort_by(|a, b| {
            let a_at = key(a);
            let b_at = key(b);
            (0..3).map(|k| a_at[k].total_cmp(&b_at[k])).find(|o| o.is_ne()).unwrap_or(a.cmp(b))
        });
        let mut columns = Self { tree: Tree::new([].into_iter()), levels: Vec::new(), of: vec![u32::MAX; at.len()] };
        let mut places = Vec::new();
        for column in order.chunk_by(|a, b| key(a)[..2] == key(b)[..2]) {
            column.iter().for_each(|&p| columns.of[p as usize] = places.len() as u32);
            places.push([key(&column[0])[0], key(&column[0])[1]]);
            columns.levels.push(column.iter().map(|&p| (at[p as usize][2], p)).collect());
        }
        columns.tree = Tree::new(places.into_iter());
        columns
    }

    /// Leaves in `found` the nearest stops that have another x, y than an endpoint. `far` grows with the gap along every
    /// axis: so the distance in the plane bounds that to every stop of a column, and within a column stops get farther
    /// with their height.
    fn nearest_in_others(&self, endpoint: usize, at: &[[f64; 3]], far: impl Fn([f64; 3]) -> f64, found: &mut Nearest) {
        found.0.clear();
        let ([x, y, z], own_column) = (at[endpoint], self.of[endpoint]);
        let in_plane = |[x, y]: [f64; 2]| far([x, y, 0.0]);
        let hint = (own_column != u32::MAX).then_some(own_column);
        self.tree.around([x, y], hint, f64::INFINITY, in_plane, |_, column| {
            let levels = &self.levels[column as usize];
            // The place from which the stage comes has no column, but may lie over one.
            if column == own_column || at[levels[0].1 as usize][..2] == [x, y] {
                return found.limit();
            }
            let first_above = levels.partition_point(|level| level.0 < z);
            let distance = |p: u32| far([0, 1, 2].map(|k| (at[p as usize][k] - at[endpoint][k]).abs()));
            insert_until_farther(found, levels[first_above..].iter().map(|level| level.1), distance);
            insert_until_farther(found, levels[..first_above].iter().rev().map(|level| level.1), distance);
            found.limit()
        });
    }
}

/// Inserts stops, each farther than the one before, until none can be nearer than those that were found.
fn insert_until_farther(found: &mut Nearest, stops: impl Iterator<Item = u32>, distance: impl Fn(u32) -> f64) {
    for stop in stops {
        let d = distance(stop);
        if d >= found.limit() {
            break;
        }
        found.insert(d, stop);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrace_core::machine::MoveTimes;
    use terrace_core::units::Time;

    const MM: i64 = 1_000_000;

    fn machine(times: Option<[f64; 2]>) -> Machine {
        let mut machine = Machine::built_in("xyz-galvo-40").expect("profile");
        machine.stage.move_times = times.map(|[xy, z]| MoveTimes { xy: Time::s(xy), z: Time::s(z) });
        machine
    }

    fn stage(machine: &Machine) -> Stage<'_> {
        Stage { machine, from: Commanded([0, 0, machine.retract_z().0]), lifts: None }
    }

    /// Stops at random places under a dome.
    fn dome(n: usize) -> Vec<Commanded> {
        let mut random = terrace_core::random::Random::new(n as u64);
        let mut next = || random.between(-200_000, 199_999);
        let stop = |_| {
            let [x, y, z] = [next(), next(), next() / 100];
            let sag = (x * x + y * y) as f64 / 1e4;
            Commanded([x * 1000, y * 1000, z * 1000 - sag as i64])
        };
        (0..n).map(stop).collect()
    }

    /// Levels over a grid of sections, in the order of the sections.
    fn grid(columns: i64, rows: i64, levels: i64) -> Vec<Commanded> {
        let stop = |i: i64| {
            let (section, level) = (i / levels, i % levels);
            let (x, y) = (section % columns, section / columns);
            Commanded([x * 40 * MM, y * 40 * MM, (level + (3 * x + 5 * y) % 7) * 70_000])
        };
        (0..columns * rows * levels).map(stop).collect()
    }

    fn assert_is_tour(order: &[usize], n: usize) {
        let mut seen = order.to_vec();
        seen.sort_unstable();
        assert_eq!(seen, (0..n).collect::<Vec<_>>());
    }

    /// Row by row to and fro, levels alternately up and down.
    fn serpentine(columns: usize, rows: usize, levels: usize) -> Vec<usize> {
        let mut order = Vec::new();
        for section in 0..columns * rows {
            let (row, along) = (section / columns, section % columns);
            let column = if row % 2 == 0 { along } else { columns - 1 - along };
            let first = (row * columns + column) * levels;
            let up = (first..first + levels).collect::<Vec<_>>();
            if section % 2 == 0 { order.extend(up.iter().rev()) } else { order.extend(up) }
        }
        order
    }

    #[test]
    fn neighbours_over_other_places_are_those_of_a_search_through_all() {
        let machine = machine(None);
        let timer = MoveTimer::new(&machine);
        let far = |gap: [f64; 3]| timer.over(gap) + TIE * gap.iter().map(|v| v * v).sum::<f64>().sqrt();
        for stops in [dome(150), grid(4, 3, 9), grid(1, 1, 20), dome(3)] {
            let at: Vec<[f64; 3]> =
                std::iter::once([0.0; 3]).chain(stops.iter().map(|p| p.0.map(|v| v as f64))).collect();
            let (columns, mut found) = (Columns::new(&at), Nearest::default());
            for endpoint in 0..at.len() {
                columns.nearest_in_others(endpoint, &at, far, &mut found);
                let others = (1..at.len()).filter(|&p| at[p][..2] != at[endpoint][..2]);
                let gap = |p: usize| [0, 1, 2].map(|k| (at[p][k] - at[endpoint][k]).abs());
                let mut all: Vec<f64> = others.map(|p| far(gap(p))).collect();
                all.sort_by(f64::total_cmp);
                all.truncate(NEIGHBOURS);
                let near: Vec<f64> = found.0.iter().map(|f| f.0).collect();
                assert_eq!(near, all);
            }
        }
    }

    #[test]
    fn no_tour_takes_longer_than_the_serpentine() {
        let stops = grid(6, 5, 8);
        for times in [None, Some([3.7, 0.3]), Some([1.0, 1.0])] {
            let machine = machine(times);
            let stage = stage(&machine);
            let order = tour(&stops, &stage, HeightOrder::Free, EFFORT);
            assert_is_tour(&order, stops.len());
            let (have, plain) = (time(&stops, &stage, &order), time(&stops, &stage, &serpentine(6, 5, 8)));
            assert!(have <= plain, "{times:?}: {have} {plain}");
        }
    }

    #[test]
    fn stops_of_one_section_are_consecutive_where_z_moves_are_fast() {
        let stops = grid(6, 5, 8);
        let machine = machine(Some([3.7, 0.3]));
        let order = tour(&stops, &stage(&machine), HeightOrder::Free, EFFORT);
        let moved = order.windows(2).filter(|w| stops[w[0]].0[..2] != stops[w[1]].0[..2]).count();
        assert_eq!(moved, 6 * 5 - 1);
        // The stage comes from above the first.
        assert!((time(&stops, &stage(&machine), &order) - (29.0 * 3.7 + 211.0 * 0.3)).abs() < 1e-9);
    }

    #[test]
    fn scattered_stops_are_toured_better_than_from_nearest_to_nearest() {
        let stops = dome(600);
        let machine = machine(None);
        let stage = stage(&machine);
        let (plain, good) =
            (tour(&stops, &stage, HeightOrder::Free, 0), tour(&stops, &stage, HeightOrder::Free, 8 * EFFORT));
        assert_is_tour(&good, stops.len());
        let (plain, good) = (time(&stops, &stage, &plain), time(&stops, &stage, &good));
        let mut nearest: Vec<usize> = (0..stops.len()).collect();
        for i in 0..stops.len() {
            let from = if i == 0 { stage.from } else { stops[nearest[i - 1]] };
            let far = |&k: &usize| cost(&machine, from, stops[nearest[k]]);
            let next = (i..stops.len()).min_by(|a, b| far(a).total_cmp(&far(b))).expect("some are left");
            nearest.swap(i, next);
        }
        let nearest = time(&stops, &stage, &nearest);
        assert!(good <= plain && plain < nearest && good < 0.97 * nearest, "{nearest} {plain} {good}");
        assert_eq!(tour(&stops, &stage, HeightOrder::Free, EFFORT), tour(&stops, &stage, HeightOrder::Free, EFFORT));
    }

    #[test]
    fn tour_of_nine_stops_is_optimal() {
        let stops = dome(9);
        for times in [None, Some([2.0, 0.5])] {
            let machine = machine(times);
            let stage = stage(&machine);
            let have = time(&stops, &stage, &tour(&stops, &stage, HeightOrder::Free, 100));
            let mut best = f64::INFINITY;
            let mut order: Vec<usize> = (0..9).collect();
            permutations(&mut order, 0, &mut |order| best = best.min(time(&stops, &stage, order)));
            assert!(have <= best + 1e-9, "{times:?}: {have} {best}");
        }
    }

    fn permutations(order: &mut Vec<usize>, fixed: usize, f: &mut impl FnMut(&[usize])) {
        if fixed == order.len() {
            return f(order);
        }
        for i in fixed..order.len() {
            order.swap(fixed, i);
            permutations(order, fixed + 1, f);
            order.swap(fixed, i);
        }
    }

    #[test]
    fn levels_run_one_way_where_that_is_asked() {
        let stops = grid(5, 4, 3);
        for head in [true, false] {
            let mut machine = machine(None);
            machine.stage.z.carries =
                if head { terrace_core::machine::Carries::Head } else { terrace_core::machine::Carries::Part };
            let stage = stage(&machine);
            let sign = machine.stage.z.sign();
            for (climb, way) in [(HeightOrder::Up, 1), (HeightOrder::Down, -1)] {
                let order = tour(&stops, &stage, climb, EFFORT);
                assert_is_tour(&order, stops.len());
                assert!(order.windows(2).all(|w| way * sign * (stops[w[1]][2] - stops[w[0]][2]) >= 0));
                let plain = time(&stops, &stage, &tour(&stops, &stage, HeightOrder::Free, EFFORT));
                assert!(plain < time(&stops, &stage, &order));
            }
        }
    }

    #[test]
    fn tour_avoids_moves_that_need_a_lift() {
        // Two rows; whoever changes row must lift, but at the end of the rows.
        let stops: Vec<Commanded> = (0..40).map(|i| Commanded([i % 20 * 10 * MM, i / 20 * 10 * MM, 0])).collect();
        let lifts = |a: usize, b: usize| a / 20 != b / 20 && (a % 20 != 19 || b % 20 != 19);
        let machine = machine(None);
        let free = Stage { from: Commanded::default(), ..stage(&machine) };
        let stage = Stage { lifts: Some(&lifts), ..free };
        let order = tour(&stops, &stage, HeightOrder::Free, 50);
        assert!(order.windows(2).all(|w| !lifts(w[0], w[1])), "{order:?}");
        assert_eq!(time(&stops, &stage, &order), time(&stops, &free, &order));
    }

    #[test]
    fn tours_of_up_to_seven_stops_visit_every_stop() {
        let machine = machine(None);
        for n in 0..8 {
            let stops = vec![Commanded([5; 3]); n];
            assert_is_tour(&tour(&stops, &stage(&machine), HeightOrder::Free, EFFORT), n);
        }
    }
}
