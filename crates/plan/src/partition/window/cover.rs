//! A cover and its indices: which pieces each box contains, how many boxes contain each piece, and which boxes are
//! near.

use crate::partition::box_index::{Index, cell_of, extent, grid_over};
use terrace_core::geom::Grid;

/// Bins along an axis at most.
const BINS: i32 = 1000;

pub(super) struct Cover<'a> {
    pub(super) index: &'a Index,
    pub(super) size: [i32; 3],
    boxes: Vec<[i32; 3]>,
    /// The pieces of every box.
    lists: Vec<Vec<u32>>,
    /// How many boxes hold each piece.
    held_by: Vec<u32>,
    /// The boxes that are in place, by their corners in the plane, each bin upwards.
    bins: Vec<Vec<(i32, u32)>>,
    grid: Grid,
    /// A list that is free to be written.
    spare: Vec<u32>,
    /// Pieces that were handled so far: what a search has cost.
    work: u64,
}

impl<'a> Cover<'a> {
    /// Boxes of `size` at `corners`, which hold every piece.
    pub(super) fn new(index: &'a Index, size: [i32; 3], corners: &[[i32; 3]]) -> Self {
        let [lo, hi] = extent(corners.iter().copied());
        let grid = grid_over(lo, hi, [size[0], size[1]], BINS);
        let mut cover = Self {
            index,
            size,
            boxes: corners.to_vec(),
            lists: vec![Vec::new(); corners.len()],
            held_by: vec![0; index.items().len()],
            bins: vec![Vec::new(); grid.len()],
            grid,
            spare: Vec::new(),
            work: 0,
        };
        for (b, &corner) in corners.iter().enumerate() {
            cover.refill(b as u32, corner);
            cover.put(b as u32);
        }
        cover
    }

    pub(super) fn boxes(&self) -> &[[i32; 3]] {
        &self.boxes
    }
    /// Counts pieces that were handled.
    pub(super) fn count(&mut self, pieces: usize) {
        self.work += pieces as u64;
    }
    /// How many pieces have been handled.
    pub(super) fn work(&self) -> u64 {
        self.work
    }
    pub(super) fn corner(&self, b: u32) -> [i32; 3] {
        self.boxes[b as usize]
    }
    /// How many boxes hold piece i.
    pub(super) fn times(&self, i: u32) -> u32 {
        self.held_by[i as usize]
    }
    /// The pieces that box b holds and no other box.
    pub(super) fn own(&self, b: u32) -> impl Iterator<Item = u32> {
        self.lists[b as usize].iter().copied().filter(|&i| self.held_by[i as usize] == 1)
    }

    /// The bin of a corner; corners outside belong to the outermost bins.
    fn bin_of(&mut self, corner: [i32; 3]) -> &mut Vec<(i32, u32)> {
        &mut self.bins[cell_of(&self.grid, corner)]
    }

    /// Calls `f` with every box in place whose corner lies in the closed box from `lo` to `hi`.
    pub(super) fn near(&self, lo: [i32; 3], hi: [i32; 3], mut f: impl FnMut(u32, [i32; 3])) {
        let bins = |k: usize| {
            let [first, last] = [lo[k], hi[k]].map(|v| self.grid.along(k, v.into(), 0) as usize);
            first..=last
        };
        for y in bins(1) {
            for x in bins(0) {
                let bin = &self.bins[y * self.grid.columns() + x];
                let first = bin.partition_point(|&(z, _)| z < lo[2]);
                for &(_, b) in bin[first..].iter().take_while(|&&(z, _)| z <= hi[2]) {
                    let c = self.boxes[b as usize];
                    if (0..2).all(|k| lo[k] <= c[k] && c[k] <= hi[k]) {
                        f(b, c);
                    }
                }
            }
        }
    }

    /// Gives box b, which is not in place, another corner.
    pub(super) fn refill(&mut self, b: u32, corner: [i32; 3]) {
        let list = &mut self.lists[b as usize];
        list.clear();
        self.index.contained(corner, self.size, |i| list.push(i as u32));
        self.work += list.len() as u64;
        self.boxes[b as usize] = corner;
    }

    pub(super) fn put(&mut self, b: u32) {
        let corner = self.boxes[b as usize];
        let bin = self.bin_of(corner);
        let at = bin.partition_point(|&entry| entry < (corner[2], b));
        bin.insert(at, (corner[2], b));
        for &i in &self.lists[b as usize] {
            self.held_by[i as usize] += 1;
        }
    }

    /// Takes box b out of its place; the pieces that no box holds now are added to `bare`.
    pub(super) fn take(&mut self, b: u32, bare: &mut Vec<u32>) {
        let corner = self.boxes[b as usize];
        let bin = self.bin_of(corner);
        let at = bin.binary_search(&(corner[2], b)).expect("in place");
        bin.remove(at);
        self.work += self.lists[b as usize].len() as u64;
        for &i in &self.lists[b as usize] {
            let times = &mut self.held_by[i as usize];
            *times -= 1;
            if *times == 0 {
                bare.push(i);
            }
        }
    }

    /// Moves box b; the pieces that no box holds any more are added to `bare`. Returns how many
    /// pieces that no box held it holds now.
    pub(super) fn shift(&mut self, b: u32, corner: [i32; 3], bare: &mut Vec<u32>) -> usize {
        let mut list = std::mem::take(&mut self.spare);
        std::mem::swap(&mut list, &mut self.lists[b as usize]);
        let from = self.boxes[b as usize];
        let bin = self.bin_of(from);
        let at = bin.binary_search(&(from[2], b)).expect("in place");
        bin.remove(at);
        self.refill(b, corner);
        let caught = self.lists[b as usize].iter().filter(|&&i| self.held_by[i as usize] == 0).count();
        // Put before the old pieces are let go, so that those in both places never count as bare.
        self.put(b);
        for &i in &list {
            let times = &mut self.held_by[i as usize];
            *times -= 1;
            if *times == 0 {
                bare.push(i);
            }
        }
        self.spare = list;
        caught
    }

    /// Forgets box b, which is not in place; the last box takes its number.
    pub(super) fn forget(&mut self, b: u32) {
        let last = self.boxes.len() as u32 - 1;
        // The bins name boxes by number: the entry of the last box is renamed.
        if b != last {
            let corner = self.boxes[last as usize];
            let bin = self.bin_of(corner);
            let at = bin.binary_search(&(corner[2], last)).expect("in place");
            bin.remove(at);
            let at = bin.partition_point(|&entry| entry < (corner[2], b));
            bin.insert(at, (corner[2], b));
        }
        self.boxes.swap_remove(b as usize);
        self.lists.swap_remove(b as usize);
    }
}

/// A small generator of numbers: the search is the same every time.
pub(super) struct Dice(u64);

impl Dice {
    pub(super) fn new() -> Self {
        Self(0x9E37_79B9_7F4A_7C15)
    }
    /// A number below `n`.
    pub(super) fn below(&mut self, n: u32) -> u32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (((self.0 >> 32) * u64::from(n)) >> 32) as u32
    }
}
