//! Fewer boxes: takes one out and pushes its pieces into its neighbours, which shift to hold them and
//! drop others in turn, until all are held again or it has taken too long.
//!
//! What is dropped is chosen by weight, and a piece that found no room weighs more the next time: the
//! search learns which pieces are hard to place. This is the ejection pool of Nagata and Bräysy (2009),
//! made for the fewest vehicles. It is at its best where a box holds few pieces.

use super::cover::{Cover, Dice};

/// Shifts before a box is given up.
const SHIFTS: usize = 300;
/// Boxes that are compared before one is taken out.
const COMPARED: usize = 4;

pub(super) struct EjectionPool {
    /// How hard every piece has been to place.
    weights: Vec<u32>,
    /// Pieces that no box holds, and some that one holds again.
    pool: Vec<u32>,
    /// Boxes that were shifted, and from where.
    log: Vec<(u32, [i32; 3])>,
    /// Boxes that can be shifted at the least cost found so far, and to where; scratch space.
    ties: Vec<(u32, [i32; 3])>,
}

/// A shift of box `b` to another corner.
struct Shift {
    b: u32,
    to: [i32; 3],
    /// The weight of the pieces that no box holds then.
    cost: u64,
}

impl EjectionPool {
    pub(super) fn new(items: usize) -> Self {
        Self { weights: vec![1; items], pool: Vec::new(), log: Vec::new(), ties: Vec::new() }
    }

    /// Tries one box in sixteen.
    pub(super) fn round(&mut self, cover: &mut Cover<'_>, dice: &mut Dice) {
        for _ in 0..cover.boxes().len().div_ceil(16) {
            let count = cover.boxes().len() as u32;
            let weight = |b: u32| cover.own(b).map(|i| u64::from(self.weights[i as usize])).sum::<u64>();
            let lightest = (0..COMPARED).map(|_| dice.below(count)).min_by_key(|&b| weight(b));
            if let Some(b) = lightest {
                self.remove(cover, b, dice);
            }
        }
    }

    /// Does without box b, or leaves everything as it was.
    fn remove(&mut self, cover: &mut Cover<'_>, b: u32, dice: &mut Dice) {
        self.pool.clear();
        self.log.clear();
        cover.take(b, &mut self.pool);
        let mut bare = self.pool.len();
        let mut left = SHIFTS;
        while bare > 0 && left > 0 {
            left -= 1;
            let i = self.pool.swap_remove(dice.below(self.pool.len() as u32) as usize);
            if cover.times(i) > 0 {
                continue;
            }
            // A piece of the pool goes into the neighbour whose own pieces it throws out for the least weight;
            // these join the pool. `bare` counts the pieces of the pool that no box holds.
            let Some(shift) = self.cheapest(cover, i, dice) else { break };
            if shift.cost > 0 {
                self.weights[i as usize] += 1;
            }
            self.log.push((shift.b, cover.corner(shift.b)));
            let had = self.pool.len();
            bare -= cover.shift(shift.b, shift.to, &mut self.pool);
            bare += self.pool.len() - had;
        }
        if bare == 0 {
            cover.forget(b);
        } else {
            // Backwards, so that a box that was shifted twice comes back to where it was first.
            for &(b, corner) in self.log.iter().rev() {
                cover.shift(b, corner, &mut self.pool);
            }
            cover.put(b);
        }
    }

    /// The shift that makes a box hold piece i for the least weight of dropped pieces, by chance one of several; None
    /// where no box is near enough.
    fn cheapest(&mut self, cover: &Cover<'_>, i: u32, dice: &mut Dice) -> Option<Shift> {
        let items = cover.index.items();
        let item = items[i as usize];
        let size = cover.size;
        let mut best = u64::MAX;
        let weights = &self.weights;
        let ties = &mut self.ties;
        ties.clear();
        // Boxes that need no more than their own size to reach the piece: from farther away all that they hold
        // would be dropped.
        let lo = [0, 1, 2].map(|k| item.hi[k] - 2 * size[k]);
        let hi = [0, 1, 2].map(|k| item.lo[k] + size[k]);
        cover.near(lo, hi, |b, corner| {
            // The shortest shift to the piece: any other drops the same pieces, or more.
            let to = [0, 1, 2].map(|k| corner[k].clamp(item.hi[k] - size[k], item.lo[k]));
            let mut cost = 0;
            for dropped in cover.own(b).filter(|&own| !items[own as usize].is_in(to, size)) {
                cost += u64::from(weights[dropped as usize]);
                if cost > best {
                    return;
                }
            }
            if cost < best {
                best = cost;
                ties.clear();
            }
            ties.push((b, to));
        });
        let &(b, to) = ties.get(dice.below(ties.len() as u32) as usize)?;
        Some(Shift { b, to, cost: best })
    }
}
