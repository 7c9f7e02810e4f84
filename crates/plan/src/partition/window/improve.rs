//! Fewer boxes: removes a few neighbours and covers what only they contained with as few others.
//!
//! A step that needs as many boxes as before is kept too: so spare capacity moves around until it can be merged. The
//! number of steps follows from the number of boxes and from what the last steps gained, never from a clock, and the
//! pieces that all steps handle from how many there are: the search takes a time in proportion to the job.

use super::cover::{Cover, Dice};
use super::ejection_pool::EjectionPool;
use crate::partition::box_index::Item;
use terrace_core::geom::counting_sort;

/// Rounds at most; a round has as many steps as there are boxes.
const ROUNDS: usize = 16;
/// Times that all pieces are handled, from which on no round begins. Of six surfaces five are done before; the sixth,
/// on which every round keeps gaining half a percent, is left with 2 % more boxes in half the time.
const MOST_WORK: u64 = 256;
/// Boxes taken out in one step.
const TAKEN: std::ops::RangeInclusive<u32> = 3..=9;
/// Orders tried in one step.
const TRIES: usize = 2;

/// Improves until a round gains less than one box in two thousand, or enough work is done.
pub(super) fn run(cover: &mut Cover<'_>) {
    let mut dice = Dice::new();
    let most = MOST_WORK * cover.index.items().len() as u64;
    let is_worth_more =
        |before: usize, cover: &Cover<'_>| before - cover.boxes().len() > before / 2000 && cover.work() < most;
    let mut ejection_pool = EjectionPool::new(cover.index.items().len());
    for _ in 0..ROUNDS {
        let before = cover.boxes().len();
        ejection_pool.round(cover, &mut dice);
        if !is_worth_more(before, cover) {
            break;
        }
    }
    let mut rebuild = Rebuild::default();
    for _ in 0..ROUNDS {
        let before = cover.boxes().len();
        for _ in 0..before {
            rebuild.step(cover, &mut dice);
        }
        if !is_worth_more(before, cover) {
            break;
        }
    }
}

/// The memory of a step.
#[derive(Default)]
struct Rebuild {
    /// Boxes near the first, with their distance.
    near: Vec<(i64, u32)>,
    /// Boxes that are taken out.
    out: Vec<u32>,
    /// Pieces that no box holds.
    bare: Vec<u32>,
    keys: Vec<f32>,
    starts: Vec<u32>,
    /// The bare pieces in the order of a sweep.
    order: Vec<Item>,
    corners: Vec<[i32; 3]>,
}

impl Rebuild {
    /// Takes some boxes out, and puts as many or fewer in their place where these hold what those did; else it puts
    /// them back.
    fn step(&mut self, cover: &mut Cover<'_>, dice: &mut Dice) {
        let count = cover.boxes().len() as u32;
        if count == 0 {
            return;
        }
        self.choose(cover, dice.below(count), dice);
        self.bare.clear();
        for &b in &self.out {
            cover.take(b, &mut self.bare);
        }
        // What only the boxes taken out held is bare now; as many boxes as before or fewer must hold it.
        let is_covered = self.bare.is_empty() || (0..TRIES).any(|_| self.sweep(cover, dice));
        if self.bare.is_empty() {
            self.corners.clear();
        }
        if !is_covered {
            self.out.iter().for_each(|&b| cover.put(b));
            return;
        }
        for (&b, &corner) in self.out.iter().zip(&self.corners) {
            cover.refill(b, corner);
            cover.put(b);
        }
        let gone = &mut self.out[self.corners.len()..];
        gone.sort_unstable();
        gone.iter().rev().for_each(|&b| cover.forget(b));
    }

    /// Chooses box `first` and some boxes near it.
    fn choose(&mut self, cover: &Cover<'_>, first: u32, dice: &mut Dice) {
        let c = cover.corner(first);
        let size = cover.size;
        let reach = size.map(|s| s + s / 8);
        self.near.clear();
        let near = &mut self.near;
        // How much nearer a box to the side is than one above.
        let steep = i64::from(1 + dice.below(10));
        cover.near([0, 1, 2].map(|k| c[k] - reach[k]), [0, 1, 2].map(|k| c[k] + reach[k]), |b, o| {
            let [x, y, z] = [0, 1, 2].map(|k| i64::from((o[k] - c[k]).abs()) * 1000 / i64::from(size[k]));
            if b != first {
                near.push((x + y + steep * z, b));
            }
        });
        // Noise of up to a box: other neighbours each time, near ones mostly.
        let noise = 1 + dice.below(1000);
        for entry in &mut self.near {
            entry.0 += i64::from(dice.below(noise));
        }
        let taken = (TAKEN.start() - 1 + dice.below(TAKEN.end() - TAKEN.start() + 1)) as usize;
        if taken < self.near.len() {
            self.near.select_nth_unstable(taken);
            self.near.truncate(taken);
        }
        self.near.sort_unstable();
        self.out.clear();
        self.out.push(first);
        self.out.extend(self.near.iter().map(|&(_, b)| b));
    }

    /// Holds the bare pieces with at most as many boxes as were taken out, by a sweep in a direction
    /// of chance: every box starts at the first piece left and grows over all that still fit.
    fn sweep(&mut self, cover: &mut Cover<'_>, dice: &mut Dice) -> bool {
        self.sort(cover, dice);
        self.corners.clear();
        let size = cover.size;
        while let Some(&Item { mut lo, mut hi }) = self.order.first() {
            if self.corners.len() == self.out.len() {
                return false;
            }
            // One box: `lo` and `hi` are the box of what it holds so far, pieces that still fit join and leave the
            // list.
            cover.count(self.order.len());
            self.order.retain(|i| {
                let l = [0, 1, 2].map(|k| lo[k].min(i.lo[k]));
                let h = [0, 1, 2].map(|k| hi[k].max(i.hi[k]));
                let fits = (0..3).all(|k| h[k] - l[k] <= size[k]);
                if fits {
                    (lo, hi) = (l, h);
                }
                !fits
            });
            self.corners.push(lo);
        }
        true
    }

    /// Lays the bare pieces out along a direction of chance. Bins are order enough, and much faster.
    fn sort(&mut self, cover: &Cover<'_>, dice: &mut Dice) {
        let items = cover.index.items();
        let way = cover.size.map(|s| (dice.below(2001) as f32 - 1000.0) / s as f32);
        let base = items[self.bare[0] as usize].lo;
        self.keys.clear();
        // Relative to one of them: f32 would not tell large coordinates apart.
        self.keys.extend(self.bare.iter().map(|&i| {
            let lo = items[i as usize].lo;
            (0..3).map(|k| way[k] * (lo[k] - base[k]) as f32).sum::<f32>()
        }));
        let (min, max) = self.keys.iter().fold((f32::MAX, f32::MIN), |(a, b), &k| (a.min(k), b.max(k)));
        let bins = self.bare.len().next_power_of_two().clamp(64, 2048);
        let scale = if max > min { (bins - 1) as f32 / (max - min) } else { 0.0 };
        let bin = |key: f32| ((key - min) * scale) as usize;
        let binned = self.keys.iter().zip(&self.bare).map(|(&key, &i)| (bin(key), items[i as usize]));
        counting_sort(bins, binned, &mut self.starts, &mut self.order);
    }
}
