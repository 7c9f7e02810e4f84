//! How many stops there are at least, with a certificate that anyone can check.
//!
//! If no box of the size of a stop holds pieces of more than unit weight, then every stop holds at
//! most unit weight, and there are at least as many stops as units of weight in all. Pieces are
//! points of marks, or whole figures where those are not to be cut; boxes are closed, upright and stand
//! anywhere, so the bound holds for every method without tilt. All is exact: integers, nm.
//!
//! The certificate holds pieces and weights, not how they were found, and [`Certificate::check`] looks
//! at them alone.

mod independent_set;
mod packing_weights;
mod rows;

use super::box_index::Item;

pub use rows::{row_heights, rows};

/// Weighted pieces of which no stop holds more than unit weight.
#[derive(Clone, Debug)]
pub struct Certificate {
    /// Boxes of this size are what a stop holds, nm.
    pub size: [i32; 3],
    /// The weight of one whole.
    pub whole: u32,
    /// Pieces, points or figures, with their weights.
    pub pieces: Vec<(Item, u32)>,
}

impl Certificate {
    /// The least number of stops, if the certificate is sound.
    pub fn stops(&self) -> usize {
        let sum: u64 = self.pieces.iter().map(|p| u64::from(p.1)).sum();
        sum.div_ceil(u64::from(self.whole.max(1))) as usize
    }

    /// Looks at every box that can matter and returns whether none holds more than one whole.
    ///
    /// A box that holds some pieces can be pushed up, and then along x and y, until a lower end of a
    /// piece that it holds stops it: such boxes are enough. Where the number of pieces in reach of one
    /// is bounded, the time grows with the number of pieces times its logarithm.
    pub fn check(&self) -> bool {
        let sound = |p: &Item| fit(p, p, self.size) && (0..3).all(|k| p.lo[k] <= p.hi[k]);
        if self.whole == 0 || !self.pieces.iter().all(|(p, _)| sound(p)) {
            return false;
        }
        let mut upwards = self.pieces.clone();
        upwards.sort_unstable_by_key(|(p, _)| (p.lo[2], *p));
        let mut above = Vec::new();
        upwards.iter().enumerate().all(|(n, (lowest, _))| {
            above.clear();
            let top = lowest.lo[2].saturating_add(self.size[2]);
            let others = upwards[n..].iter().take_while(|(p, _)| p.lo[2] <= top);
            above.extend(others.filter(|(p, _)| fit(lowest, p, self.size)));
            // Pieces as low as this one that come before it have been looked at together with it.
            heaviest_box_with(lowest, &above, self.size, &[0, 1]) <= u64::from(self.whole)
        })
    }
}

/// A bound from points of marks, nm from a common origin within 2^30 nm. Points at [`row_heights`] (to
/// 3 nm) are worth most: take them where strokes cross those heights.
pub fn lower_bound(points: &[[i32; 3]], size: [i32; 3]) -> Certificate {
    let by_rows = rows::certify(points, size);
    if by_rows.stops() > ENOUGH {
        return by_rows;
    }
    // Where the points form few rows, points at any height may prove more stops.
    let sample = points.iter().step_by(points.len().div_ceil(SAMPLE).max(1));
    let by_swaps = independent_set::certify(sample.map(|&p| Item { lo: p, hi: p }).collect(), size);
    if by_swaps.stops() > by_rows.stops() { by_swaps } else { by_rows }
}

/// Above this many stops rows prove more than random swaps find, which are not tried then.
const ENOUGH: usize = 500;
/// Points among which random swaps search, at most.
const SAMPLE: usize = 20_000;

/// A bound from figures that stay whole, none larger than a stop.
pub fn lower_bound_whole(figures: &[Item], size: [i32; 3]) -> Certificate {
    independent_set::certify(figures.to_vec(), size)
}

/// Whether a box of `size` holds both. Pieces that fit pairwise fit together: along each axis they are intervals.
fn fit(a: &Item, b: &Item, size: [i32; 3]) -> bool {
    (0..3).all(|k| i64::from(a.hi[k].max(b.hi[k])) - i64::from(a.lo[k].min(b.lo[k])) <= i64::from(size[k]))
}

/// Largest total weight of `pieces` in one box of `size` that also holds `piece`. The box moves along `axes` only: what
/// it does not hold along the others is not among `pieces`. Each of these fits a box together with `piece`.
fn heaviest_box_with(piece: &Item, pieces: &[(Item, u32)], size: [i32; 3], axes: &[usize]) -> u64 {
    let all = pieces.iter().map(|n| u64::from(n.1)).sum();
    let Some((&k, rest)) = axes.split_first() else { return all };
    let mut best = 0;
    // A box that moves up until the lower end of a piece inside is its lower border loses no piece: only lower ends are
    // tried as starts. One above that of `piece` would lose it.
    let mut starts: Vec<i32> = pieces.iter().map(|(p, _)| p.lo[k].min(piece.lo[k])).collect();
    starts.sort_unstable();
    starts.dedup();
    let mut inside: Vec<(Item, u32)> = Vec::with_capacity(pieces.len());
    for start in starts {
        let end = i64::from(start) + i64::from(size[k]);
        if end < i64::from(piece.hi[k]) {
            // It does not hold `piece`.
            continue;
        }
        inside.clear();
        inside.extend(pieces.iter().filter(|(p, _)| p.lo[k] >= start && i64::from(p.hi[k]) <= end));
        let sum: u64 = inside.iter().map(|n| u64::from(n.1)).sum();
        // The other axes leave no more of it than this.
        if sum > best {
            best = best.max(heaviest_box_with(piece, &inside, size, rest));
        }
        if best == all {
            break;
        }
    }
    best
}

#[cfg(test)]
mod tests;
