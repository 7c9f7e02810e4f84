//! A path through items, made shorter by moves on neighbour lists.
//!
//! Items, endpoints and costs are those of module `endpoints`. Moves are 2-opt (a run of items is reversed, each of
//! them turned) and Or-opt (a run of up to three goes to another place, either way round, or one item enters by another
//! endpoint). [`Tour::improve`] makes them while any gains; [`Tour::settle`] then chooses all endpoints at once, by
//! dynamic programming; [`Tour::perturb`] changes the tour at random and takes back what did not pay.

use super::endpoints::Endpoints;

/// No endpoint: beyond the end of the path.
const NONE: u32 = u32::MAX;

/// Longest run that Or-opt moves.
const RUN: usize = 3;

/// Moves in one improvement, for every item: a bound that is not reached in practice.
const MOST_MOVES: usize = 50;

/// Places that a random change may touch.
const PERTURBATION: usize = 50;

/// A run of items that goes to another place.
#[derive(Clone, Copy)]
struct RunMove {
    /// First and last place of the run.
    a: usize,
    b: usize,
    /// It goes between this place and the next.
    gap: usize,
    /// Whether it is reversed, each of its items turned.
    is_turned: bool,
    /// The endpoint by which its one item is entered then; [`NONE`] where that stays.
    entry: u32,
}

impl RunMove {
    /// The run `a..=b` as it is.
    #[inline]
    fn straight(a: usize, b: usize, gap: usize) -> Self {
        Self { a, b, gap, is_turned: false, entry: NONE }
    }

    /// The run `a..=b` reversed.
    #[inline]
    fn turned(a: usize, b: usize, gap: usize) -> Self {
        Self { a, b, gap, is_turned: true, entry: NONE }
    }

    /// The item at place `j`, entered by another endpoint.
    #[inline]
    fn entered_by(entry: u32, j: usize, gap: usize) -> Self {
        Self { a: j, b: j, gap, is_turned: false, entry }
    }
}

/// The best move so far, and what it gains.
#[derive(Clone, Copy)]
struct Move {
    gain: f64,
    run: RunMove,
}

impl Move {
    /// Takes another move if it gains more: `gain` less its costs, which are found only where `gain` alone would do.
    #[inline]
    fn replace_if_better(&mut self, gain: f64, run: RunMove, costs: impl Fn() -> f64) {
        if gain > self.gain {
            let gain = gain - costs();
            if gain > self.gain {
                *self = Self { gain, run };
            }
        }
    }
}

/// What was done to the sequence, so that it can be undone.
enum TourStep {
    Reverse(usize, usize),
    /// Places from..=to were rotated left by this many.
    Rotate(usize, usize, usize),
    /// Place and its endpoint before.
    Endpoint(usize, u32),
}

/// What the path knows of an item.
#[derive(Clone, Copy)]
struct TourItem {
    /// Where it stands on the path.
    place: u32,
    /// Whether it waits in the queue.
    queued: bool,
}

/// A path and what it costs.
pub(super) struct Tour<'a, C, N> {
    endpoints: &'a Endpoints,
    /// Cost between the endpoint that is left and the endpoint that is entered.
    cost: C,
    /// Puts endpoints of other items around an endpoint that are nearer than a limit, nearest first.
    near: N,
    /// Entry endpoint at every place.
    seq: Vec<u32>,
    /// Cost from every place to the next; nothing from the last. Not one list with `seq`: where n places are turned
    /// round, only the n - 1 edges between them are.
    edges: Vec<f64>,
    /// The place of every item.
    items: Vec<TourItem>,
    /// Most places that one move changes.
    longest: usize,
    /// Gains up to this are rounding.
    least: f64,
    /// Items whose surroundings changed, first in first out.
    queue: std::collections::VecDeque<u32>,
    found: Vec<(f64, u32)>,
    /// Kept only while random changes are tried.
    journal: Option<Vec<TourStep>>,
}

impl<'a, C: Fn(u32, u32) -> f64, N: Fn(u32, f64, &mut Vec<(f64, u32)>)> Tour<'a, C, N> {
    pub(super) fn new(endpoints: &'a Endpoints, seq: Vec<u32>, longest: usize, least: f64, cost: C, near: N) -> Self {
        let mut items = vec![TourItem { place: 0, queued: true }; seq.len()];
        seq.iter().zip(0..).for_each(|(&endpoint, at)| items[endpoints.item(endpoint)].place = at);
        let mut tour = Self {
            edges: vec![0.0; seq.len()],
            queue: seq.iter().map(|&endpoint| endpoints.item(endpoint) as u32).collect(),
            endpoints,
            cost,
            near,
            seq,
            items,
            longest,
            least,
            found: Vec::new(),
            journal: None,
        };
        (0..tour.seq.len()).for_each(|at| tour.measure(at));
        tour
    }

    /// Entry endpoints in the order of the path, the start first.
    pub(super) fn into_seq(self) -> Vec<u32> {
        self.seq
    }

    fn entry(&self, at: usize) -> u32 {
        self.seq.get(at).copied().unwrap_or(NONE)
    }
    fn exit(&self, at: usize) -> u32 {
        self.endpoints.other(self.seq[at])
    }
    /// Cost from one endpoint to the next, if there is a next.
    fn link(&self, from: u32, to: u32) -> f64 {
        if to == NONE { 0.0 } else { (self.cost)(from, to) }
    }
    /// Sets the cost from place `at` to the next.
    fn measure(&mut self, at: usize) {
        self.edges[at] = self.link(self.exit(at), self.entry(at + 1));
    }

    /// Makes moves that gain until there are none, around all that is new or changed; whether there were any.
    pub(super) fn improve(&mut self) -> bool {
        self.apply_queued_moves(MOST_MOVES * self.seq.len()) > 0.0
    }

    /// Puts the item at a place into the queue.
    fn mark_dirty(&mut self, at: usize) {
        let Some(&endpoint) = self.seq.get(at) else { return };
        let item = self.endpoints.item(endpoint);
        if !std::mem::replace(&mut self.items[item].queued, true) {
            self.queue.push_back(item as u32);
        }
    }

    /// Makes moves that gain around the items in the queue, `most` at most, until the queue is empty. Returns what they
    /// gain together.
    fn apply_queued_moves(&mut self, most: usize) -> f64 {
        let mut gained = 0.0;
        let mut moves = 0;
        while let Some(item) = self.queue.pop_front() {
            self.items[item as usize].queued = false;
            // Around the same item again: its next best move may gain too.
            while moves < most
                && let Some(best) = self.best_move(self.items[item as usize].place as usize)
            {
                gained += best.gain;
                moves += 1;
                self.apply(best.run);
            }
        }
        gained
    }

    /// The best move that brings an endpoint of the item at place `i` to one that is nearer than what it is
    /// joined to.
    fn best_move(&mut self, i: usize) -> Option<Move> {
        // Place 0 is the start, which no move takes: 0 stands for no move.
        let mut best = Move { gain: self.least, run: RunMove::straight(0, 0, 0) };
        let mut found = std::mem::take(&mut self.found);
        let after = self.edges[i];
        if after > self.least {
            (self.near)(self.exit(i), after, &mut found);
            let runs = if found.is_empty() { [0.0; RUN] } else { self.gains_of_runs(i, [1, 0]) };
            for &(d, q) in &found {
                self.join_exit(i, q, d, &runs, &mut best);
            }
        }
        let before = if i == 0 { 0.0 } else { self.edges[i - 1] };
        if before > self.least {
            (self.near)(self.entry(i), before, &mut found);
            let runs = if found.is_empty() { [0.0; RUN] } else { self.gains_of_runs(i, [0, 1]) };
            for &(d, q) in &found {
                self.join_entry(i, q, d, &runs, &mut best);
            }
        }
        self.found = found;
        (best.run.b > 0).then_some(best)
    }

    /// What taking out the runs of 1 to [`RUN`] items gains that end at place `i` (`[down, up]` is `[1, 0]`) or begin
    /// there (`[0, 1]`). Where there is no run of a length it gains minus infinity, so that no move takes it.
    fn gains_of_runs(&self, i: usize, [down, up]: [usize; 2]) -> [f64; RUN] {
        let mut gains = [f64::NEG_INFINITY; RUN];
        for (k, gain) in gains.iter_mut().enumerate() {
            let (a, b) = (i.saturating_sub(down * k), i + up * k);
            // The start, at place 0, stays; a subtraction that saturated is no run either.
            if a > 0 && i - a == down * k && b < self.seq.len() {
                *gain = self.edges[a - 1] + self.edges[b] - self.link(self.exit(a - 1), self.entry(b + 1));
            }
        }
        gains
    }

    /// Moves after which the exit of place `i` is joined to endpoint `q`, `d` away. `runs` is what taking out
    /// the runs that end with i gains.
    fn join_exit(&self, i: usize, q: u32, d: f64, runs: &[f64; RUN], best: &mut Move) {
        let j = self.items[self.endpoints.item(q)].place as usize;
        if i.abs_diff(j) > self.longest {
            return;
        }
        let [enters_by_q, leaves_by_q] = [self.entry(j) == q, self.exit(j) == q];
        // 2-opt: the run between i and j is reversed. The edges behind both go; d and the edge between what
        // followed them come.
        if leaves_by_q {
            let [lo, hi] = [i.min(j), i.max(j)];
            best.replace_if_better(self.edges[lo] + self.edges[hi] - d, RunMove::turned(lo + 1, hi, lo), || {
                self.link(self.entry(lo + 1), self.entry(hi + 1))
            });
        }
        // Or-opt of one item, which then enters by q: where it follows i already, only its endpoint changes.
        // Item j comes after i.
        let exit = self.endpoints.other(q);
        let out = self.edges[i] - d;
        if j == i + 1 {
            let gain = out + self.edges[j];
            return best.replace_if_better(gain, RunMove::entered_by(q, j, i), || self.link(exit, self.entry(j + 1)));
        }
        best.replace_if_better(self.edges[j - 1] + self.edges[j] + out, RunMove::entered_by(q, j, i), || {
            self.link(self.exit(j - 1), self.entry(j + 1)) + self.link(exit, self.entry(i + 1))
        });
        // A run that ends with i goes before or after j. A run that reaches j, or stands next to it already, does not
        // move; nor does any longer one.
        for (k, gain) in runs.iter().enumerate().take_while(|&(k, _)| k < i) {
            let a = i - k;
            if a == j || a == j + 1 {
                return;
            }
            if enters_by_q {
                let gain = gain + self.edges[j - 1] - d;
                best.replace_if_better(gain, RunMove::straight(a, i, j - 1), || {
                    self.link(self.exit(j - 1), self.entry(a))
                });
            }
            if leaves_by_q {
                let gain = gain + self.edges[j] - d;
                best.replace_if_better(gain, RunMove::turned(a, i, j), || self.link(self.entry(a), self.entry(j + 1)));
            }
        }
    }

    /// Moves after which the entry of place `i` is joined to endpoint `q`, `d` away. `runs` is what taking out the runs
    /// that begin with i gains.
    fn join_entry(&self, i: usize, q: u32, d: f64, runs: &[f64; RUN], best: &mut Move) {
        let j = self.items[self.endpoints.item(q)].place as usize;
        if i.abs_diff(j) > self.longest {
            return;
        }
        let [enters_by_q, leaves_by_q] = [self.entry(j) == q, self.exit(j) == q];
        // 2-opt, as in `join_exit`: the edges before both places go.
        if enters_by_q {
            let [lo, hi] = [i.min(j), i.max(j)];
            best.replace_if_better(
                self.edges[lo - 1] + self.edges[hi - 1] - d,
                RunMove::turned(lo, hi - 1, lo - 1),
                || self.link(self.exit(lo - 1), self.exit(hi - 1)),
            );
        }
        // Item j comes before i.
        let entry = self.endpoints.other(q);
        let out = self.edges[i - 1] - d;
        if j == i - 1 {
            let gain = out + self.edges[j - 1];
            return best
                .replace_if_better(gain, RunMove::entered_by(entry, j, j - 1), || self.link(self.exit(j - 1), entry));
        }
        best.replace_if_better(self.edges[j - 1] + self.edges[j] + out, RunMove::entered_by(entry, j, i - 1), || {
            self.link(self.exit(j - 1), self.entry(j + 1)) + self.link(self.exit(i - 1), entry)
        });
        // A run that begins with i goes before or after j.
        for (k, gain) in runs.iter().enumerate().take_while(|&(k, _)| i + k < self.seq.len()) {
            let b = i + k;
            if b == j || b + 1 == j {
                return;
            }
            if leaves_by_q {
                let gain = gain + self.edges[j] - d;
                best.replace_if_better(gain, RunMove::straight(i, b, j), || self.link(self.exit(b), self.entry(j + 1)));
            }
            if enters_by_q {
                let gain = gain + self.edges[j - 1] - d;
                best.replace_if_better(gain, RunMove::turned(i, b, j - 1), || {
                    self.link(self.exit(j - 1), self.exit(b))
                });
            }
        }
    }

    fn apply(&mut self, m: RunMove) {
        // Only items at the ends of changed edges can have new moves that gain (don't-look bits, Bentley 1992).
        for at in [m.a - 1, m.a, m.b, m.b + 1, m.gap, m.gap + 1] {
            self.mark_dirty(at);
        }
        if m.entry != NONE {
            let old = self.enter(m.a, m.entry);
            self.journal.iter_mut().for_each(|j| j.push(TourStep::Endpoint(m.a, old)));
        }
        if m.is_turned {
            self.reverse(m.a, m.b);
        }
        // Taking the run out and laying it elsewhere is a rotation of all places between: no other place changes.
        if m.gap > m.b {
            self.rotate(m.a, m.gap, m.b + 1 - m.a);
        } else if m.gap + 1 < m.a {
            self.rotate(m.gap + 1, m.b, m.a - m.gap - 1);
        }
    }

    /// Lets place `at` be entered by another endpoint; returns the endpoint before.
    fn enter(&mut self, at: usize, endpoint: u32) -> u32 {
        let old = std::mem::replace(&mut self.seq[at], endpoint);
        self.measure(at - 1);
        self.measure(at);
        old
    }

    /// Reverses places `lo..=hi` and turns every item there.
    fn reverse(&mut self, lo: usize, hi: usize) {
        self.journal.iter_mut().for_each(|j| j.push(TourStep::Reverse(lo, hi)));
        let Self { endpoints, seq, items, .. } = self;
        let run = &mut seq[lo..=hi];
        run.reverse();
        for (endpoint, at) in run.iter_mut().zip(lo as u32..) {
            *endpoint = endpoints.other(*endpoint);
            items[endpoints.item(*endpoint)].place = at;
        }
        self.edges[lo..hi].reverse();
        self.measure(lo - 1);
        self.measure(hi);
    }

    /// Rotates places `lo..=hi` left by so many.
    fn rotate(&mut self, lo: usize, hi: usize, by: usize) {
        self.journal.iter_mut().for_each(|j| j.push(TourStep::Rotate(lo, hi, by)));
        self.seq[lo..=hi].rotate_left(by);
        let Self { endpoints, seq, items, .. } = self;
        seq[lo..=hi].iter().zip(lo as u32..).for_each(|(&endpoint, at)| items[endpoints.item(endpoint)].place = at);
        self.edges[lo..=hi].rotate_left(by);
        self.measure(lo - 1);
        self.measure(hi - by);
        self.measure(hi);
    }

    /// Chooses the endpoints of all items at once so that the path is shortest in its present order.
    pub(super) fn settle(&mut self) {
        let n = self.seq.len();
        // Least cost of the path that ends with entering each endpoint of each place, and the endpoint before.
        let mut from = vec![0u32; self.endpoints.count()];
        let mut last = vec![(0.0, self.seq[0])];
        let mut next = Vec::new();
        // Forwards: of the paths through places 0..=at that enter `at` by an endpoint, only the cheapest matters
        // (Viterbi). Backwards, the endpoints of the best path are read off `from`.
        for at in 1..n {
            for endpoint in self.endpoints.of(self.endpoints.item(self.seq[at])) {
                let mut best = (f64::INFINITY, 0);
                for &(cost, before) in &last {
                    let cost = cost + (self.cost)(self.endpoints.other(before), endpoint);
                    if cost < best.0 {
                        best = (cost, before);
                    }
                }
                from[endpoint as usize] = best.1;
                next.push((best.0, endpoint));
            }
            std::mem::swap(&mut last, &mut next);
            next.clear();
        }
        let end = last.iter().copied().reduce(|a, b| if b.0 < a.0 { b } else { a });
        let Some((_, mut endpoint)) = end else { return };
        for at in (1..n).rev() {
            if self.enter(at, endpoint) != endpoint {
                [at - 1, at, at + 1].into_iter().for_each(|at| self.mark_dirty(at));
            }
            endpoint = from[endpoint as usize];
        }
    }

    /// Makes `perturbations` random changes, each mended by moves around it and taken back unless the path is no
    /// longer than before.
    pub(super) fn perturb(&mut self, perturbations: usize, seed: u64) {
        let n = self.seq.len();
        if n < 8 {
            return;
        }
        let mut random = Random(seed);
        for _ in 0..perturbations {
            self.journal.get_or_insert_default().clear();
            let span = PERTURBATION.min(n - 1);
            let lo = 1 + random.below(n - span);
            // Two neighbouring runs change places.
            let [mut p, mut q] = [random.below(span), random.below(span)];
            if p > q {
                std::mem::swap(&mut p, &mut q);
            }
            let (a, b, c) = (lo, lo + p, lo + q);
            if b == a || c == b {
                continue;
            }
            let lost = self.swap(a, b, c);
            // Kept where the repair gains what the perturbation cost: paths of equal length count as better, so that
            // the search can drift over plateaus.
            if self.apply_queued_moves(MOST_MOVES * PERTURBATION) >= lost {
                continue;
            }
            for step in self.journal.take().into_iter().flatten().rev() {
                match step {
                    TourStep::Reverse(lo, hi) => self.reverse(lo, hi),
                    TourStep::Rotate(lo, hi, by) => self.rotate(lo, hi, hi + 1 - lo - by),
                    TourStep::Endpoint(at, endpoint) => {
                        self.enter(at, endpoint);
                    }
                }
            }
        }
        self.journal = None;
    }

    /// Runs `a..b` and `b..c` change places; what it costs.
    fn swap(&mut self, a: usize, b: usize, c: usize) -> f64 {
        let ends = |tour: &Self, middle: usize| tour.edges[a - 1] + tour.edges[middle - 1] + tour.edges[c - 1];
        let old = ends(self, b);
        [a - 1, a, b - 1, b, c - 1, c].into_iter().for_each(|at| self.mark_dirty(at));
        self.rotate(a, c - 1, b - a);
        ends(self, a + c - b) - old
    }
}

/// Numbers that look random (splitmix64).
struct Random(u64);

impl Random {
    /// A number below `n`.
    fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (((z ^ (z >> 31)) >> 32) as usize * n) >> 32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::order::endpoints::greedy;
    use crate::order::kd_tree::Tree;

    /// Places of the endpoints of stops and of open and closed strokes, mixed.
    fn mixed(n: usize, seed: u64) -> (Endpoints, Vec<[f64; 2]>) {
        let mut endpoints = Endpoints::with_capacity(n + 1, 4 * n);
        endpoints.closed(1);
        for i in 0..n {
            if i % 3 == 0 { endpoints.open() } else { endpoints.closed(i % 3 * 2) }
        }
        let mut random = terrace_core::random::Random::new(seed);
        let mut next = || random.below(1 << 24) as f64;
        let at = (0..endpoints.count()).map(|_| [next(), next()]).collect();
        (endpoints, at)
    }

    fn square([x, y]: [f64; 2]) -> f64 {
        x * x + y * y
    }

    fn distance(at: &[[f64; 2]], a: u32, b: u32) -> f64 {
        let (a, b) = (at[a as usize], at[b as usize]);
        square([a[0] - b[0], a[1] - b[1]]).sqrt()
    }

    fn length(endpoints: &Endpoints, at: &[[f64; 2]], seq: &[u32]) -> f64 {
        seq.windows(2).map(|w| distance(at, endpoints.other(w[0]), w[1])).sum()
    }

    #[test]
    fn every_move_of_the_tour_shortens_it_and_keeps_its_links_consistent() {
        for seed in 1..6 {
            let (endpoints, at) = mixed(120, seed);
            let mut tree = Tree::new(at[1..].iter().copied());
            let first = greedy(&endpoints, &mut tree, |endpoint| at[endpoint as usize], square);
            let cost = |a: u32, b: u32| distance(&at, a, b);
            let near = |endpoint: u32, limit: f64, found: &mut Vec<(f64, u32)>| {
                found.clear();
                let others = (1..at.len() as u32).filter(|&p| endpoints.item(p) != endpoints.item(endpoint));
                found.extend(others.map(|p| (cost(endpoint, p), p)).filter(|f| f.0 < limit));
                found.sort_by(|a, b| a.0.total_cmp(&b.0));
                found.truncate(8);
            };
            let mut before = length(&endpoints, &at, &first);
            let greedy = before;
            let mut tour = Tour::new(&endpoints, first, 1000, 1e-6, cost, near);
            for step in 0..4 {
                match step {
                    1 => assert!(tour.improve()),
                    2 => tour.perturb(200, 1),
                    _ => tour.settle(),
                }
                let after = length(&endpoints, &at, &tour.seq);
                assert!(after <= before + 1e-3, "step {step} with seed {seed}: {before} {after}");
                assert!((tour.edges.iter().sum::<f64>() - after).abs() < 1e-3, "step {step} with seed {seed}");
                let mut seen = vec![false; endpoints.items()];
                for (at, &endpoint) in tour.seq.iter().enumerate() {
                    assert_eq!(tour.items[endpoints.item(endpoint)].place as usize, at);
                    assert!(!std::mem::replace(&mut seen[endpoints.item(endpoint)], true));
                }
                assert_eq!((tour.seq[0], tour.seq.len()), (0, endpoints.items()));
                before = after;
            }
            assert!(before < 0.9 * greedy, "seed {seed}: {greedy} {before}");
        }
    }

    #[test]
    fn endpoint_choice_is_optimal() {
        let (endpoints, at) = mixed(6, 4);
        let seq: Vec<u32> = (0..endpoints.items()).map(|i| endpoints.of(i).start).collect();
        let cost = |a: u32, b: u32| distance(&at, a, b);
        let mut tour = Tour::new(&endpoints, seq, 10, 0.0, cost, |_, _, found| found.clear());
        tour.settle();
        let mut all = vec![vec![0]];
        for item in 1..endpoints.items() {
            let longer = |seq: &Vec<u32>| {
                endpoints.of(item).map(|endpoint| [&seq[..], &[endpoint]].concat()).collect::<Vec<_>>()
            };
            all = all.iter().flat_map(longer).collect();
        }
        let best = all.iter().map(|seq| length(&endpoints, &at, seq)).fold(f64::INFINITY, f64::min);
        assert!(all.len() > 100 && (length(&endpoints, &at, &tour.into_seq()) - best).abs() < 1e-6);
    }
}
