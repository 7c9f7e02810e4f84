//! Pieces of the texture that one stop must hold whole, and an index that answers which of them a box
//! holds.
//!
//! Everything is an exact integer and every box is closed. Inside the search lengths are counted in
//! steps of the lattice on which the boxes' lower corners lie, see `Item::on_lattice`.

use std::ops::Range;

/// A piece of the texture that one stop must hold whole: the closed box of its marks, nm from a common
/// origin, which lies within 2^30 nm of all of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Item {
    /// Lower corner.
    pub lo: [i32; 3],
    /// Upper corner.
    pub hi: [i32; 3],
}

impl Item {
    /// The piece in units of the lattice: a box of `size / step` (rounded down) at the lattice point c
    /// holds the answer exactly when the box of `size` at `c * step` holds the piece.
    ///
    /// # Panics
    /// Where no box on the lattice holds the piece: whoever made it has not cut it small enough.
    pub(super) fn on_lattice(&self, size: [i32; 3], step: [i32; 3]) -> Self {
        let mut out = *self;
        for k in 0..3 {
            // The corners that hold the piece are those from hi - size to lo.
            let first = -(size[k] - self.hi[k]).div_euclid(step[k]);
            out.lo[k] = self.lo[k].div_euclid(step[k]);
            assert!(first <= out.lo[k], "a piece larger than a stop: {self:?}");
            out.hi[k] = first + size[k] / step[k];
        }
        out
    }

    /// Does the box of `size` at `corner` hold the piece?
    #[inline]
    pub(super) fn is_in(&self, corner: [i32; 3], size: [i32; 3]) -> bool {
        (0..3).all(|k| self.lo[k] >= corner[k] && self.hi[k] <= corner[k] + size[k])
    }
}

/// Pieces sorted into square tiles of the plane by their lower corners, upwards in each tile.
pub(super) struct Index {
    items: Vec<Item>,
    /// The first piece of every tile, and the number of pieces.
    starts: Vec<u32>,
    /// Lowest x and y.
    origin: [i32; 2],
    /// Width of a tile.
    tile: [i32; 2],
    /// Columns and rows of tiles.
    shape: [usize; 2],
}

impl Index {
    /// Sorts the pieces, those that are equal once.
    pub(super) fn new(mut items: Vec<Item>, size: [i32; 3]) -> Self {
        let mut origin = [0; 2];
        let mut tile = [1; 2];
        let mut shape = [1; 2];
        // Eight tiles along a stop, but no more tiles than pieces.
        let most = (items.len() as f64).sqrt().ceil().max(1.0) as i32;
        for k in 0..2 {
            let lo = items.iter().map(|i| i.lo[k]).min().unwrap_or(0);
            let hi = items.iter().map(|i| i.lo[k]).max().unwrap_or(0);
            origin[k] = lo;
            tile[k] = (size[k] / 8).max((hi - lo) / most).max(1);
            shape[k] = ((hi - lo) / tile[k]) as usize + 1;
        }
        let mut index = Self { items: Vec::new(), starts: Vec::new(), origin, tile, shape };
        let height = |i: &Item| (i.lo[2], i.hi[2], i.lo, i.hi);
        items.sort_unstable_by_key(|i| (index.tile_of(i), height(i)));
        items.dedup();
        index.starts = vec![0; shape[0] * shape[1] + 1];
        for i in &items {
            let tile = index.tile_of(i);
            index.starts[tile + 1] += 1;
        }
        for t in 1..index.starts.len() {
            index.starts[t] += index.starts[t - 1];
        }
        index.items = items;
        index
    }

    pub(super) fn items(&self) -> &[Item] {
        &self.items
    }

    fn tile_of(&self, i: &Item) -> usize {
        let at = |k: usize| ((i.lo[k] - self.origin[k]) / self.tile[k]) as usize;
        at(1) * self.shape[0] + at(0)
    }

    /// The tiles along axis k that meet [lo, hi].
    fn tiles(&self, k: usize, lo: i32, hi: i32) -> Range<usize> {
        let at = |v: i32| (i64::from(v) - i64::from(self.origin[k])).div_euclid(i64::from(self.tile[k]));
        let first = at(lo).max(0);
        let last = at(hi).min(self.shape[k] as i64 - 1);
        if first > last { 0..0 } else { first as usize..last as usize + 1 }
    }

    /// Calls `f` with every piece (its number) that the box of `size` at `corner` holds.
    #[inline]
    pub(super) fn held(&self, corner: [i32; 3], size: [i32; 3], mut f: impl FnMut(usize)) {
        for y in self.tiles(1, corner[1], corner[1] + size[1]) {
            for x in self.tiles(0, corner[0], corner[0] + size[0]) {
                let tile = y * self.shape[0] + x;
                let range = self.starts[tile] as usize..self.starts[tile + 1] as usize;
                let first = range.start + self.items[range.clone()].partition_point(|i| i.lo[2] < corner[2]);
                for n in first..range.end {
                    let item = &self.items[n];
                    if item.lo[2] > corner[2] + size[2] {
                        break;
                    }
                    if item.is_in(corner, size) {
                        f(n);
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lattice_keeps_what_a_box_holds() {
        let (size, step) = ([40, 25, 7], [3, 4, 2]);
        for lo in -9..9 {
            for tall in 0..4 {
                let item = Item { lo: [lo, lo + 1, -lo], hi: [lo + tall, lo + 2, tall - lo] };
                let small = item.on_lattice(size, step);
                let room = [size[0] / step[0], size[1] / step[1], size[2] / step[2]];
                for c in -20..20 {
                    let corner = [c, -c, c / 2];
                    let full = [corner[0] * step[0], corner[1] * step[1], corner[2] * step[2]];
                    assert_eq!(small.is_in(corner, room), item.is_in(full, size), "{item:?} at {full:?}");
                }
            }
        }
    }

    #[test]
    #[should_panic(expected = "larger than a stop")]
    fn a_piece_that_no_corner_of_the_lattice_holds_is_refused() {
        // It fits the size, but not from 0 or from 10.
        let _ = Item { lo: [5, 0, 0], hi: [14, 0, 0] }.on_lattice([9, 9, 9], [10, 1, 1]);
    }

    #[test]
    fn held_equals_a_linear_scan() {
        let mut random = crate::random::Random::new(1);
        let mut next = |n: usize| random.below(n) as i32;
        let items: Vec<Item> = (0..3000)
            .map(|_| {
                let lo = [next(500) - 250, next(400) - 100, next(60)];
                Item { lo, hi: [lo[0] + next(9), lo[1] + next(9), lo[2] + next(3)] }
            })
            .collect();
        let size = [64, 40, 9];
        let index = Index::new(items, size);
        for _ in 0..200 {
            let corner = [next(700) - 350, next(600) - 200, next(80) - 10];
            let mut got = Vec::new();
            index.held(corner, size, |n| got.push(n));
            got.sort_unstable();
            let want: Vec<usize> = (0..index.items().len()).filter(|&n| index.items()[n].is_in(corner, size)).collect();
            assert_eq!(got, want);
        }
    }
}
