//! Pieces of the texture that one stop must hold whole, and an index that answers which of them a box
//! holds.
//!
//! Everything is an exact integer and every box is closed. Inside the search lengths are counted in
//! steps of the lattice on which the boxes' lower corners lie, see `Item::on_lattice`.

use terrace_core::geom::{Buckets, Grid, Nm, P2};

/// A piece of the texture that one stop must hold whole: the closed box of its marks, nm from a common
/// origin, which lies within 2^30 nm of all of them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
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
            // A box on the lattice and a box of `size / step` lattice units hold the same pieces if pieces are
            // rounded outward: lower ends down, and upper ends so that the lowest corner that holds them stays the
            // lowest.
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

/// A grid over places of the plane from `lo` to `hi`: cells of the size `least` or larger, so that there are
/// hardly more than `most` along an axis.
pub(super) fn grid_over(lo: [i32; 2], hi: [i32; 2], least: [i32; 2], most: i32) -> Grid {
    let pitch = [0, 1].map(|k| Nm(i64::from(least[k].max((hi[k] - lo[k]) / most).max(1))));
    let count = [0, 1].map(|k| (Nm(i64::from(hi[k] - lo[k])) / pitch[k]) as u32 + 1);
    Grid { origin: P2::new(lo[0].into(), lo[1].into()), pitch, count }
}

/// Lowest and highest x and y of some places; 0 where there is none.
pub(super) fn extent(places: impl Iterator<Item = [i32; 3]>) -> [[i32; 2]; 2] {
    let first = |p: [i32; 3]| [[p[0], p[1]]; 2];
    let add = |[lo, hi]: [[i32; 2]; 2], [p, _]: [[i32; 2]; 2]| {
        [[lo[0].min(p[0]), lo[1].min(p[1])], [hi[0].max(p[0]), hi[1].max(p[1])]]
    };
    places.map(first).reduce(add).unwrap_or_default()
}

/// The cell of a place; of one outside the grid the nearest.
#[inline]
pub(super) fn cell_of(grid: &Grid, place: [i32; 3]) -> usize {
    let [column, row] = [0, 1].map(|k| grid.along(k, place[k].into(), 0) as usize);
    row * grid.columns() + column
}

/// Pieces sorted into square tiles of the plane by their lower corners, upwards in each tile.
pub(super) struct Index {
    /// The tiles, in steps of the lattice.
    grid: Grid,
    /// The pieces of every tile.
    items: Buckets<Item>,
}

impl Index {
    /// Sorts the pieces, those that are equal once.
    pub(super) fn new(mut items: Vec<Item>, size: [i32; 3]) -> Self {
        // Eight tiles along a stop, but no more tiles than pieces.
        let most = (items.len() as f64).sqrt().ceil().max(1.0) as i32;
        let [lo, hi] = extent(items.iter().map(|i| i.lo));
        let grid = grid_over(lo, hi, [size[0] / 8, size[1] / 8], most);
        // From below, so that the pieces of every tile are: counting keeps their order.
        items.sort_unstable_by_key(|i| (i.lo[2], i.hi[2], i.lo, i.hi));
        items.dedup();
        let items = Buckets::new(grid.len(), items.iter().map(|i| (cell_of(&grid, i.lo), *i)));
        Self { grid, items }
    }

    pub(super) fn items(&self) -> &[Item] {
        self.items.items()
    }

    /// Calls `f` with every piece (its number) that the box of `size` at `corner` holds.
    #[inline]
    pub(super) fn contained(&self, corner: [i32; 3], size: [i32; 3], mut f: impl FnMut(usize)) {
        let tiles = |k: usize| self.grid.range(k, corner[k].into(), (corner[k] + size[k]).into());
        for y in tiles(1) {
            for x in tiles(0) {
                let tile = y * self.grid.columns() + x;
                let range = self.items.range(tile);
                let items = self.items.of(tile);
                let first = items.partition_point(|i| i.lo[2] < corner[2]);
                for (item, n) in items[first..].iter().zip(range.start + first..) {
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
        let mut random = terrace_core::random::Random::new(1);
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
            index.contained(corner, size, |n| got.push(n));
            got.sort_unstable();
            let want: Vec<usize> = (0..index.items().len()).filter(|&n| index.items()[n].is_in(corner, size)).collect();
            assert_eq!(got, want);
        }
    }
}
