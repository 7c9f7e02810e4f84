//! The order of strokes within a block: short jumps.
//!
//! First greedy: from where the beam is to the nearest free end of a stroke, flipping it where its far
//! end is nearer; ends lie in a grid of buckets. Then improvement on neighbour lists until nothing is
//! gained: 2-opt (a run of strokes is reversed, each of them flipped) and Or-opt (one stroke moves to
//! another place, either way round). Distances are Euclidean in nm. Ties go to the lower index, and of
//! ends on one point the first in its bucket is taken, so the order is a function of the strokes alone.

/// A stroke's two ends in the field frame, nm.
pub type Ends = [[i32; 2]; 2];

/// Longest run that 2-opt reverses, and how far a stroke moves: bounds the cost on huge blocks.
const MAX_RUN: usize = 1000;
/// Ends looked at around each end.
const NEIGHBOURS: usize = 6;
/// Rounds of improvement.
const MAX_ROUNDS: usize = 4;

/// The order in which strokes are marked, the beam starting in the centre of the field: index and
/// whether the stroke is reversed.
pub fn order(ends: &[Ends]) -> Vec<(u32, bool)> {
    let mut tour = greedy(ends);
    if ends.len() > 2 {
        improve(ends, &mut tour);
    }
    tour
}

fn distance(a: [i32; 2], b: [i32; 2]) -> f64 {
    let dx = f64::from(a[0]) - f64::from(b[0]);
    let dy = f64::from(a[1]) - f64::from(b[1]);
    (dx * dx + dy * dy).sqrt()
}

/// Buckets of stroke ends: end e of stroke s is number 2 s + e.
struct Buckets {
    lo: [i32; 2],
    size: f64,
    count: [i64; 2],
    starts: Vec<u32>,
    /// How many of each bucket's ends are still free; they stand first.
    free: Vec<u32>,
    items: Vec<u32>,
    /// Place of every end in `items`.
    place: Vec<u32>,
}

impl Buckets {
    fn new(ends: &[Ends]) -> Self {
        let all = || ends.iter().flatten();
        let min = |axis: usize| all().map(|p| p[axis]).min().unwrap_or(0);
        let max = |axis: usize| all().map(|p| p[axis]).max().unwrap_or(0);
        let lo = [min(0), min(1)];
        let span = [0, 1].map(|i| f64::from(max(i)) - f64::from(lo[i]) + 1.0);
        let n = ends.len() as f64 * 2.0;
        let size = (span[0] * span[1] / n).sqrt().max(span[0].max(span[1]) / n).max(1.0);
        let count = span.map(|s| (s / size) as i64 + 1);
        let mut b =
            Self { lo, size, count, starts: Vec::new(), free: Vec::new(), items: Vec::new(), place: Vec::new() };
        let cells = (count[0] * count[1]) as usize;
        let mut starts = vec![0u32; cells + 1];
        all().for_each(|&p| starts[b.cell(p) + 1] += 1);
        for i in 0..cells {
            starts[i + 1] += starts[i];
        }
        let mut next = starts.clone();
        b.items = vec![0; ends.len() * 2];
        b.place = vec![0; ends.len() * 2];
        for (end, &p) in all().enumerate() {
            let slot = &mut next[b.cell(p)];
            b.items[*slot as usize] = end as u32;
            b.place[end] = *slot;
            *slot += 1;
        }
        b.free = (0..cells).map(|i| starts[i + 1] - starts[i]).collect();
        b.starts = starts;
        b
    }

    fn axis(&self, axis: usize, v: i32) -> i64 {
        (((f64::from(v) - f64::from(self.lo[axis])) / self.size) as i64).clamp(0, self.count[axis] - 1)
    }

    fn cell(&self, p: [i32; 2]) -> usize {
        (self.axis(1, p[1]) * self.count[0] + self.axis(0, p[0])) as usize
    }

    fn remove(&mut self, ends: &[Ends], end: usize) {
        let cell = self.cell(ends[end / 2][end % 2]);
        self.free[cell] -= 1;
        let last = (self.starts[cell] + self.free[cell]) as usize;
        let place = self.place[end] as usize;
        self.items.swap(place, last);
        self.place[self.items[place] as usize] = place as u32;
        self.place[end] = last as u32;
    }

    /// Calls `f` with the ends of each ring of cells around `p` until it answers that the ring
    /// distance (no unseen end is nearer) is enough.
    fn rings(&self, p: [i32; 2], mut f: impl FnMut(&[u32]), mut enough: impl FnMut(f64) -> bool) {
        let c = [self.axis(0, p[0]), self.axis(1, p[1])];
        let far = self.count[0].max(self.count[1]);
        for r in 0..=far {
            for y in (c[1] - r).max(0)..=(c[1] + r).min(self.count[1] - 1) {
                let rim = (y - c[1]).abs() == r;
                let mut x = c[0] - r;
                while x <= c[0] + r {
                    if (0..self.count[0]).contains(&x) {
                        let cell = (y * self.count[0] + x) as usize;
                        let start = self.starts[cell] as usize;
                        f(&self.items[start..start + self.free[cell] as usize]);
                    }
                    x += if rim || r == 0 { 1 } else { 2 * r };
                }
            }
            // Everything within this distance of p has been seen (p may lie outside of the grid).
            let inside = [0, 1].map(|i| {
                let at = f64::from(p[i]) - f64::from(self.lo[i]);
                let lo = at - (c[i] - r) as f64 * self.size;
                let hi = (c[i] + r + 1) as f64 * self.size - at;
                lo.min(hi)
            });
            if enough(inside[0].min(inside[1])) {
                return;
            }
        }
    }
}

fn greedy(ends: &[Ends]) -> Vec<(u32, bool)> {
    let mut buckets = Buckets::new(ends);
    let mut tour = Vec::with_capacity(ends.len());
    let mut at = [0, 0];
    while tour.len() < ends.len() {
        let best = std::cell::Cell::new((f64::INFINITY, u32::MAX));
        buckets.rings(
            at,
            |items| {
                for &end in items {
                    // Nothing is nearer; thousands of ends may lie on one point.
                    if best.get().0 == 0.0 {
                        return;
                    }
                    let d = distance(at, ends[end as usize / 2][end as usize % 2]);
                    let (bd, be) = best.get();
                    if d < bd || d == bd && end < be {
                        best.set((d, end));
                    }
                }
            },
            |reach| best.get().0 <= reach,
        );
        let end = best.get().1;
        let (stroke, reversed) = (end / 2, end % 2 == 1);
        buckets.remove(ends, 2 * stroke as usize);
        buckets.remove(ends, 2 * stroke as usize + 1);
        tour.push((stroke, reversed));
        at = ends[stroke as usize][usize::from(!reversed)];
    }
    tour
}

/// The nearest ends of other strokes to `end` that are nearer than `limit`, nearest first.
fn nearer(buckets: &Buckets, ends: &[Ends], end: usize, limit: f64, near: &mut Vec<(f64, u32)>) {
    let p = ends[end / 2][end % 2];
    near.clear();
    if limit <= 0.0 {
        return;
    }
    let reach = std::cell::Cell::new(limit);
    buckets.rings(
        p,
        |items| {
            for &e in items {
                let d = distance(p, ends[e as usize / 2][e as usize % 2]);
                if e as usize / 2 != end / 2 && d < reach.get() {
                    let at = near.partition_point(|&(nd, ne)| (nd, ne) < (d, e));
                    near.insert(at, (d, e));
                    if near.len() > NEIGHBOURS {
                        near.pop();
                        reach.set(near[NEIGHBOURS - 1].0);
                    }
                }
            }
        },
        |seen| reach.get() <= seen,
    );
}

/// The tour with what the moves need: where every stroke stands.
struct Tour<'a> {
    ends: &'a [Ends],
    list: &'a mut Vec<(u32, bool)>,
    place: Vec<u32>,
}

impl Tour<'_> {
    /// Where the beam enters the stroke at place i; past the end it goes nowhere.
    fn entry(&self, i: usize) -> [i32; 2] {
        let (s, r) = self.list[i];
        self.ends[s as usize][usize::from(r)]
    }
    fn exit(&self, i: usize) -> [i32; 2] {
        let (s, r) = self.list[i];
        self.ends[s as usize][usize::from(!r)]
    }
    /// The jump into place i from the place before it (the field centre before the first).
    fn jump_into(&self, i: usize) -> f64 {
        if i >= self.list.len() {
            return 0.0;
        }
        let from = if i == 0 { [0, 0] } else { self.exit(i - 1) };
        distance(from, self.entry(i))
    }
    /// The jump that end 0 or 1 of a stroke is joined by.
    fn jump_at(&self, stroke: usize, end: usize) -> f64 {
        let i = self.place[stroke] as usize;
        let is_exit = (end == 1) != self.list[i].1;
        self.jump_into(i + usize::from(is_exit))
    }
    fn reverse(&mut self, i: usize, j: usize) {
        self.list[i..=j].reverse();
        for k in i..=j {
            self.list[k].1 = !self.list[k].1;
            self.place[self.list[k].0 as usize] = k as u32;
        }
    }
    /// Reverses places i..=j if that shortens the tour.
    fn try_reverse(&mut self, i: usize, j: usize) -> bool {
        if i > j || j - i > MAX_RUN {
            return false;
        }
        let from = if i == 0 { [0, 0] } else { self.exit(i - 1) };
        let old = self.jump_into(i) + self.jump_into(j + 1);
        let out = if j + 1 < self.list.len() { distance(self.entry(i), self.entry(j + 1)) } else { 0.0 };
        let gains = distance(from, self.exit(j)) + out < old - 0.5;
        if gains {
            self.reverse(i, j);
        }
        gains
    }
    /// Moves the stroke at place i between places j - 1 and j if that shortens the tour.
    fn try_move(&mut self, i: usize, j: usize) -> bool {
        if j == i || j == i + 1 || i.abs_diff(j) > MAX_RUN {
            return false;
        }
        let (entry, exit) = (self.entry(i), self.exit(i));
        let before = if i == 0 { [0, 0] } else { self.exit(i - 1) };
        let after = (i + 1 < self.list.len()).then(|| self.entry(i + 1));
        let gain = self.jump_into(i) + self.jump_into(i + 1) - after.map_or(0.0, |a| distance(before, a));
        let from = if j == 0 { [0, 0] } else { self.exit(j - 1) };
        let to = (j < self.list.len()).then(|| self.entry(j));
        let cost = |entry, exit| distance(from, entry) + to.map_or(0.0, |t| distance(exit, t)) - self.jump_into(j);
        let (kept, flipped) = (cost(entry, exit), cost(exit, entry));
        if kept.min(flipped) >= gain - 0.5 {
            return false;
        }
        if flipped < kept {
            self.list[i].1 = !self.list[i].1;
        }
        let (lo, hi) = if i < j {
            self.list[i..j].rotate_left(1);
            (i, j)
        } else {
            self.list[j..=i].rotate_right(1);
            (j, i + 1)
        };
        for k in lo..hi {
            self.place[self.list[k].0 as usize] = k as u32;
        }
        true
    }
}

fn improve(ends: &[Ends], list: &mut Vec<(u32, bool)>) {
    let buckets = Buckets::new(ends);
    let mut near = Vec::new();
    let mut place = vec![0; ends.len()];
    list.iter().enumerate().for_each(|(i, &(s, _))| place[s as usize] = i as u32);
    let mut tour = Tour { ends, list, place };
    // Strokes whose surroundings changed since they were last looked at.
    let mut stale = vec![true; ends.len()];
    for _ in 0..MAX_ROUNDS {
        let mut gained = false;
        for stroke in 0..ends.len() {
            if !std::mem::replace(&mut stale[stroke], false) {
                continue;
            }
            for end in 0..2 {
                // The end is worth joining to a nearer one than it is joined to now, only.
                let jump = tour.jump_at(stroke, end);
                nearer(&buckets, ends, 2 * stroke + end, jump - 0.5, &mut near);
                for &(d, e) in &near {
                    if d >= tour.jump_at(stroke, end) - 0.5 {
                        break;
                    }
                    let (i, j) = (tour.place[stroke] as usize, tour.place[e as usize / 2] as usize);
                    let (lo, hi) = (i.min(j), i.max(j));
                    let better = tour.try_reverse(lo + 1, hi)
                        || tour.try_reverse(lo, hi - 1)
                        || tour.try_move(i, j)
                        || tour.try_move(i, j + 1);
                    if better {
                        gained = true;
                        for at in [lo.saturating_sub(1), lo, lo + 1, hi.saturating_sub(1), hi, hi + 1] {
                            if let Some(&(s, _)) = tour.list.get(at) {
                                stale[s as usize] = true;
                            }
                        }
                    }
                }
            }
        }
        if !gained {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn jumps(ends: &[Ends], tour: &[(u32, bool)]) -> f64 {
        let mut at = [0, 0];
        let mut sum = 0.0;
        for &(s, r) in tour {
            let e = ends[s as usize];
            sum += distance(at, e[usize::from(r)]);
            at = e[usize::from(!r)];
        }
        sum
    }

    fn random(n: usize, mut seed: u64) -> Vec<Ends> {
        let mut next = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (seed >> 40) as i32 % 1_000_000
        };
        (0..n).map(|_| [[next(), next()], [next(), next()]]).collect()
    }

    #[test]
    fn every_stroke_is_marked_once() {
        for n in [1, 2, 3, 50, 500] {
            let ends = random(n, n as u64);
            let mut seen: Vec<u32> = order(&ends).iter().map(|t| t.0).collect();
            seen.sort_unstable();
            assert_eq!(seen, (0..n as u32).collect::<Vec<_>>());
        }
    }

    #[test]
    fn improvement_never_loses_and_mostly_gains() {
        let ends = random(400, 9);
        let (first, better) = (jumps(&ends, &greedy(&ends)), jumps(&ends, &order(&ends)));
        assert!(better < 0.95 * first, "{first} {better}");
    }

    #[test]
    fn shuffled_hatch_becomes_a_serpentine() {
        let mut ends: Vec<Ends> = (0..100).map(|i| [[-500_000, i * 1000], [500_000, i * 1000]]).collect();
        for i in 0..100 {
            ends.swap(i, (i * 37) % 100);
        }
        let tour = order(&ends);
        let steps: Vec<f64> = tour
            .windows(2)
            .map(|w| distance(ends[w[0].0 as usize][usize::from(!w[0].1)], ends[w[1].0 as usize][usize::from(w[1].1)]))
            .collect();
        assert!(steps.iter().all(|&s| s <= 1000.0), "{steps:?}");
    }

    #[test]
    fn identical_strokes_are_all_kept() {
        let ends = vec![[[5, 5], [5, 5]]; 40];
        assert_eq!(order(&ends).len(), 40);
    }
}
