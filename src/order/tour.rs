//! A path through items, made shorter by moves on neighbour lists.
//!
//! An *item* is what is visited once: a stop, or a stroke. It is entered at one of its *ports* and left at
//! the port that belongs to it: a stop has one port, an open stroke two (entered at one end, left at the
//! other), a closed stroke one for every vertex at which it may begin. Item 0 is where the path starts; it
//! ends anywhere. Costs run between ports and must be the same both ways.
//!
//! Moves are 2-opt (a run of items is reversed, each of them turned) and Or-opt (a run of up to three goes
//! to another place, either way round, or one item enters by another port). [`Tour::improve`] makes
//! them while any gains; [`Tour::settle`] then chooses all ports at once, by dynamic programming;
//! [`Tour::perturb`] changes the tour at random and takes back what did not pay.

use super::tree::Tree;

/// No port: beyond the end of the path.
const NONE: u32 = u32::MAX;

/// Longest run that Or-opt moves.
const RUN: usize = 3;

/// Moves in one improvement, for every item: a bound that is not reached in practice.
const MOST_MOVES: usize = 50;

/// Places around a random change.
const KICK: usize = 50;

/// The ports of all items.
#[derive(Default)]
pub(super) struct Ports {
    /// Item of every port.
    item: Vec<u32>,
    /// Where one leaves who entered at a port.
    other: Vec<u32>,
    /// First port of every item, and the number of ports.
    first: Vec<u32>,
}

impl Ports {
    pub(super) fn with_capacity(items: usize, ports: usize) -> Self {
        let mut first = Vec::with_capacity(items + 1);
        first.push(0);
        Self { item: Vec::with_capacity(ports), other: Vec::with_capacity(ports), first }
    }
    /// An item with two ports, entered at one and left at the other.
    pub(super) fn open(&mut self) {
        let port = self.item.len() as u32;
        self.other.extend([port + 1, port]);
        self.end(2);
    }
    /// An item that is left where it was entered, at any of so many ports.
    pub(super) fn closed(&mut self, count: usize) {
        let port = self.item.len() as u32;
        self.other.extend(port..port + count as u32);
        self.end(count);
    }
    fn end(&mut self, count: usize) {
        let item = self.items() as u32;
        self.item.extend(std::iter::repeat_n(item, count));
        self.first.push(self.item.len() as u32);
    }
    pub(super) fn items(&self) -> usize {
        self.first.len() - 1
    }
    pub(super) fn item(&self, port: u32) -> usize {
        self.item[port as usize] as usize
    }
    pub(super) fn of(&self, item: usize) -> std::ops::Range<u32> {
        self.first[item]..self.first[item + 1]
    }
    fn other(&self, port: u32) -> u32 {
        self.other[port as usize]
    }
}

/// The path that always goes to the nearest item, as entry ports. `tree` holds all ports but port 0, by
/// number less one, and `at` is where they are; `far` is the distance, as [`Tree::around`] takes it.
pub(super) fn greedy<const D: usize>(
    ports: &Ports,
    tree: &mut Tree<D>,
    at: &[[f64; D]],
    far: impl Fn([f64; D]) -> f64,
) -> Vec<u32> {
    let mut seq = Vec::with_capacity(ports.items());
    seq.push(0);
    let (mut from, mut near) = (at[0], None);
    while seq.len() < ports.items() {
        let mut next = 0;
        tree.around(from, near, f64::INFINITY, &far, |d, number| {
            next = number + 1;
            d
        });
        ports.of(ports.item(next)).for_each(|port| tree.take(port - 1));
        seq.push(next);
        let exit = ports.other(next);
        (from, near) = (at[exit as usize], Some(exit - 1));
    }
    seq
}

/// Run `a..=b` goes between places `gap` and `gap + 1`, turned or not, and enters by `entry`.
#[derive(Clone, Copy)]
struct Move {
    gain: f64,
    a: usize,
    b: usize,
    gap: usize,
    turned: bool,
    entry: u32,
}

/// What was done to the sequence, so that it can be undone.
enum Step {
    Reverse(usize, usize),
    /// Places from..=to were rotated left by so many.
    Rotate(usize, usize, usize),
    /// Place and its port before.
    Port(usize, u32),
}

/// A path and what it costs.
pub(super) struct Tour<'a, C, N> {
    ports: &'a Ports,
    /// Cost between the port that is left and the port that is entered.
    cost: C,
    /// Puts ports of other items around a port that are nearer than a limit, nearest first.
    near: N,
    /// Entry port at every place.
    seq: Vec<u32>,
    /// Place of every item.
    place: Vec<u32>,
    /// Most places that one move changes.
    longest: usize,
    /// Gains up to this are rounding.
    least: f64,
    /// Items whose surroundings changed, first in first out.
    queue: std::collections::VecDeque<u32>,
    queued: Vec<bool>,
    found: Vec<(f64, u32)>,
    /// Kept only while random changes are tried.
    journal: Option<Vec<Step>>,
}

impl<'a, C: Fn(u32, u32) -> f64, N: FnMut(u32, f64, &mut Vec<(f64, u32)>)> Tour<'a, C, N> {
    pub(super) fn new(ports: &'a Ports, seq: Vec<u32>, longest: usize, least: f64, cost: C, near: N) -> Self {
        let mut place = vec![0; seq.len()];
        seq.iter().zip(0..).for_each(|(&port, at)| place[ports.item(port)] = at);
        let queued = vec![false; seq.len()];
        Self {
            ports,
            cost,
            near,
            seq,
            place,
            longest,
            least,
            queue: Default::default(),
            queued,
            found: Vec::new(),
            journal: None,
        }
    }

    /// Entry ports in the order of the path, the start first.
    pub(super) fn into_seq(self) -> Vec<u32> {
        self.seq
    }

    fn entry(&self, at: usize) -> u32 {
        self.seq.get(at).copied().unwrap_or(NONE)
    }
    fn exit(&self, at: usize) -> u32 {
        self.ports.other(self.seq[at])
    }
    /// Cost from one port to the next, if there is a next.
    fn link(&self, from: u32, to: u32) -> f64 {
        if to == NONE { 0.0 } else { (self.cost)(from, to) }
    }
    /// Cost from place `at` to the next.
    fn edge(&self, at: usize) -> f64 {
        self.link(self.exit(at), self.entry(at + 1))
    }
    /// Cost of the whole path.
    pub(super) fn total(&self) -> f64 {
        (0..self.seq.len()).map(|at| self.edge(at)).sum()
    }

    /// Makes moves that gain until there are none.
    pub(super) fn improve(&mut self) {
        for at in 0..self.seq.len() {
            self.stale(at);
        }
        self.work(MOST_MOVES * self.seq.len());
    }

    fn stale(&mut self, at: usize) {
        let Some(&port) = self.seq.get(at) else { return };
        let item = self.ports.item(port);
        if !std::mem::replace(&mut self.queued[item], true) {
            self.queue.push_back(item as u32);
        }
    }

    /// Works the queue off; answers with what was gained.
    fn work(&mut self, most: usize) -> f64 {
        let mut gained = 0.0;
        let mut moves = 0;
        while let Some(item) = self.queue.pop_front() {
            self.queued[item as usize] = false;
            while moves < most
                && let Some(best) = self.best_move(self.place[item as usize] as usize)
            {
                gained += best.gain;
                moves += 1;
                self.apply(best);
            }
        }
        gained
    }

    /// The best move that brings a port of the item at place `i` to one that is nearer than what it is
    /// joined to.
    fn best_move(&mut self, i: usize) -> Option<Move> {
        let mut best = Move { gain: self.least, a: 0, b: 0, gap: 0, turned: false, entry: NONE };
        let mut found = std::mem::take(&mut self.found);
        let after = self.edge(i);
        if after > self.least {
            let port = self.exit(i);
            (self.near)(port, after, &mut found);
            for &(d, q) in &found {
                self.after(i, after, q, d, &mut best);
            }
        }
        let before = if i == 0 { 0.0 } else { self.edge(i - 1) };
        if before > self.least {
            let port = self.entry(i);
            (self.near)(port, before, &mut found);
            for &(d, q) in &found {
                self.before(i, before, q, d, &mut best);
            }
        }
        self.found = found;
        (best.b > 0).then_some(best)
    }

    /// What leaving item `j` out gains.
    fn gap_gain(&self, j: usize) -> f64 {
        self.edge(j - 1) + self.edge(j) - self.link(self.exit(j - 1), self.entry(j + 1))
    }

    /// Moves after which the exit of place `i` is joined to port `q`, `d` away; it leaves by a link that
    /// costs `out` now.
    fn after(&self, i: usize, out: f64, q: u32, d: f64, best: &mut Move) {
        let j = self.place[self.ports.item(q)] as usize;
        if i.abs_diff(j) > self.longest {
            return;
        }
        let mut offer = |gain: f64, [a, b]: [usize; 2], gap: usize, turned: bool, entry: u32| {
            if gain > best.gain {
                *best = Move { gain, a, b, gap, turned, entry };
            }
        };
        let next = self.entry(i + 1);
        let leaves_by_q = self.exit(j) == q;
        if leaves_by_q {
            let [lo, hi] = [i.min(j), i.max(j)];
            let gain = self.edge(lo) + self.edge(hi) - d - self.link(self.entry(lo + 1), self.entry(hi + 1));
            offer(gain, [lo + 1, hi], lo, true, NONE);
        }
        // Item j comes after i.
        let exit = self.ports.other(q);
        if j == i + 1 {
            let gain = out + self.edge(j) - d - self.link(exit, self.entry(j + 1));
            return offer(gain, [j, j], i, false, q);
        }
        offer(self.gap_gain(j) + out - d - self.link(exit, next), [j, j], i, false, q);
        // A run that ends with i goes before or after j.
        let enters_by_q = self.entry(j) == q;
        for a in (i.saturating_sub(RUN - 1).max(1)..=i).rev() {
            if (a..=i).contains(&j) || a - 1 == j {
                return;
            }
            let first = self.entry(a);
            let gain = self.edge(a - 1) + out - self.link(self.exit(a - 1), next) - d;
            if enters_by_q {
                let gain = gain + self.edge(j - 1) - self.link(self.exit(j - 1), first);
                offer(gain, [a, i], j - 1, false, NONE);
            }
            if leaves_by_q {
                let gain = gain + self.edge(j) - self.link(first, self.entry(j + 1));
                offer(gain, [a, i], j, true, NONE);
            }
        }
    }

    /// The same for the entry of place `i`, whose link from the place before costs `out` now.
    fn before(&self, i: usize, out: f64, q: u32, d: f64, best: &mut Move) {
        let j = self.place[self.ports.item(q)] as usize;
        if i.abs_diff(j) > self.longest {
            return;
        }
        let mut offer = |gain: f64, [a, b]: [usize; 2], gap: usize, turned: bool, entry: u32| {
            if gain > best.gain {
                *best = Move { gain, a, b, gap, turned, entry };
            }
        };
        let last = self.exit(i - 1);
        let enters_by_q = self.entry(j) == q;
        if enters_by_q {
            let [lo, hi] = [i.min(j), i.max(j)];
            let gain = self.edge(lo - 1) + self.edge(hi - 1) - d - self.link(self.exit(lo - 1), self.exit(hi - 1));
            offer(gain, [lo, hi - 1], lo - 1, true, NONE);
        }
        // Item j comes before i.
        let entry = self.ports.other(q);
        if j == i - 1 {
            let gain = out + self.edge(j - 1) - d - self.link(self.exit(j - 1), entry);
            return offer(gain, [j, j], j - 1, false, entry);
        }
        offer(self.gap_gain(j) + out - d - self.link(last, entry), [j, j], i - 1, false, entry);
        // A run that begins with i goes before or after j.
        let leaves_by_q = self.exit(j) == q;
        for b in i..(i + RUN).min(self.seq.len()) {
            if (i..=b).contains(&j) || b + 1 == j {
                return;
            }
            let exit = self.exit(b);
            let gain = self.edge(b) + out - self.link(last, self.entry(b + 1)) - d;
            if leaves_by_q {
                let gain = gain + self.edge(j) - self.link(exit, self.entry(j + 1));
                offer(gain, [i, b], j, false, NONE);
            }
            if enters_by_q {
                let gain = gain + self.edge(j - 1) - self.link(self.exit(j - 1), exit);
                offer(gain, [i, b], j - 1, true, NONE);
            }
        }
    }

    fn apply(&mut self, m: Move) {
        for at in [m.a - 1, m.a, m.b, m.b + 1, m.gap, m.gap + 1] {
            self.stale(at);
        }
        if m.entry != NONE {
            let old = std::mem::replace(&mut self.seq[m.a], m.entry);
            self.journal.iter_mut().for_each(|j| j.push(Step::Port(m.a, old)));
        }
        if m.turned {
            self.reverse(m.a, m.b);
        }
        if m.gap > m.b {
            self.rotate(m.a, m.gap, m.b + 1 - m.a);
        } else if m.gap + 1 < m.a {
            self.rotate(m.gap + 1, m.b, m.a - m.gap - 1);
        }
    }

    /// Reverses places `lo..=hi` and turns every item there.
    fn reverse(&mut self, lo: usize, hi: usize) {
        self.journal.iter_mut().for_each(|j| j.push(Step::Reverse(lo, hi)));
        let Self { ports, seq, place, .. } = self;
        let run = &mut seq[lo..=hi];
        run.reverse();
        for (port, at) in run.iter_mut().zip(lo as u32..) {
            *port = ports.other(*port);
            place[ports.item(*port)] = at;
        }
    }

    fn rotate(&mut self, lo: usize, hi: usize, by: usize) {
        self.journal.iter_mut().for_each(|j| j.push(Step::Rotate(lo, hi, by)));
        self.seq[lo..=hi].rotate_left(by);
        let Self { ports, seq, place, .. } = self;
        seq[lo..=hi].iter().zip(lo as u32..).for_each(|(&port, at)| place[ports.item(port)] = at);
    }

    /// Chooses the ports of all items at once so that the path is shortest in its present order.
    pub(super) fn settle(&mut self) {
        let n = self.seq.len();
        // Least cost of the path that ends with entering each port of each place, and the port before.
        let mut from = vec![0u32; self.ports.item.len()];
        let mut last = vec![(0.0, self.seq[0])];
        let mut next = Vec::new();
        for at in 1..n {
            for port in self.ports.of(self.ports.item(self.seq[at])) {
                let mut best = (f64::INFINITY, 0);
                for &(cost, before) in &last {
                    let cost = cost + (self.cost)(self.ports.other(before), port);
                    if cost < best.0 {
                        best = (cost, before);
                    }
                }
                from[port as usize] = best.1;
                next.push((best.0, port));
            }
            std::mem::swap(&mut last, &mut next);
            next.clear();
        }
        let end = last.iter().copied().reduce(|a, b| if b.0 < a.0 { b } else { a });
        let Some((_, mut port)) = end else { return };
        for at in (1..n).rev() {
            self.seq[at] = port;
            port = from[port as usize];
        }
    }

    /// Makes `kicks` random changes, each mended by moves around it and taken back unless the path is no
    /// longer than before.
    pub(super) fn perturb(&mut self, kicks: usize, seed: u64) {
        let n = self.seq.len();
        if n < 8 {
            return;
        }
        let mut random = Random(seed);
        for _ in 0..kicks {
            self.journal.get_or_insert_default().clear();
            let span = KICK.min(n - 1);
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
            if self.work(MOST_MOVES * KICK) >= lost {
                continue;
            }
            for step in self.journal.take().into_iter().flatten().rev() {
                match step {
                    Step::Reverse(lo, hi) => self.reverse(lo, hi),
                    Step::Rotate(lo, hi, by) => self.rotate(lo, hi, hi + 1 - lo - by),
                    Step::Port(at, port) => self.seq[at] = port,
                }
            }
        }
        self.journal = None;
    }

    /// Runs `a..b` and `b..c` change places; what it costs.
    fn swap(&mut self, a: usize, b: usize, c: usize) -> f64 {
        let old = self.edge(a - 1) + self.edge(b - 1) + self.edge(c - 1);
        [a - 1, a, b - 1, b, c - 1, c].into_iter().for_each(|at| self.stale(at));
        self.rotate(a, c - 1, b - a);
        let middle = a + c - b;
        self.edge(a - 1) + self.edge(middle - 1) + self.edge(c - 1) - old
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
