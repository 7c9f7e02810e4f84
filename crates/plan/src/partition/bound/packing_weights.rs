//! Pieces with weights, and how much weight more a piece can take.

use super::super::box_index::{Item, cell_of, grid_over};
use super::{Certificate, fit, heaviest_box_with};
use terrace_core::geom::Grid;

/// Bins along an axis at most.
const BINS: i32 = 1000;

#[derive(Clone, Copy)]
struct Entry {
    piece: Item,
    number: u32,
    weight: u32,
}

/// Weights of which no box of `size` holds more than one whole, as long as no more is added than
/// [`PackingWeights::room`] allows.
pub(super) struct PackingWeights {
    size: [i32; 3],
    whole: u32,
    /// By the lower corners in the plane, each bin upwards.
    bins: Vec<Vec<Entry>>,
    grid: Grid,
    sum: u64,
    near: Vec<(Item, u32)>,
}

impl PackingWeights {
    /// None yet; pieces will lie between `lo` and `hi` in the plane.
    pub(super) fn new(lo: [i32; 2], hi: [i32; 2], size: [i32; 3], whole: u32) -> Self {
        let grid = grid_over(lo, hi, [size[0], size[1]], BINS);
        Self { size, whole, bins: vec![Vec::new(); grid.len()], grid, sum: 0, near: Vec::new() }
    }

    /// The weight of all.
    pub(super) fn sum(&self) -> u64 {
        self.sum
    }

    /// The pieces that fit one box with `piece`: their numbers. Stops where `f` answers false.
    pub(super) fn fitting(&self, piece: &Item, mut f: impl FnMut(u32) -> bool) {
        self.entries(piece, |e| f(e.number));
    }

    fn entries(&self, piece: &Item, mut f: impl FnMut(&Entry) -> bool) {
        // Pieces that fit one box have lower corners no farther apart than its size, which no bin is narrower than.
        // Its own bin comes first, since most of them lie there.
        let own = cell_of(&self.grid, piece.lo);
        let others = self.grid.around(own).filter(|&bin| bin != own);
        for bin in std::iter::once(own).chain(others).map(|bin| &self.bins[bin]) {
            let first = bin.partition_point(|e| e.piece.lo[2] < piece.hi[2] - self.size[2]);
            let top = piece.lo[2] + self.size[2];
            for e in bin[first..].iter().take_while(|e| e.piece.lo[2] <= top) {
                if fit(piece, &e.piece, self.size) && !f(e) {
                    return;
                }
            }
        }
    }

    /// How much can be added to the weight of `piece`.
    pub(super) fn room(&mut self, piece: &Item) -> u32 {
        let mut near = std::mem::take(&mut self.near);
        near.clear();
        self.entries(piece, |e| {
            near.push((e.piece, e.weight));
            true
        });
        // The constraint of the packing: no box holds more than one whole. Only boxes that hold the piece change by
        // it, so what the heaviest of them lacks can be added.
        let load = heaviest_box_with(piece, &near, self.size, &[2, 0, 1]);
        self.near = near;
        self.whole - (load as u32).min(self.whole)
    }

    /// Adds weight to piece `number`.
    pub(super) fn add(&mut self, piece: &Item, number: u32, weight: u32) {
        let bin = &mut self.bins[cell_of(&self.grid, piece.lo)];
        match bin.binary_search_by_key(&(piece.lo[2], number), |e| (e.piece.lo[2], e.number)) {
            Ok(at) => bin[at].weight += weight,
            Err(at) => bin.insert(at, Entry { piece: *piece, number, weight }),
        }
        self.sum += u64::from(weight);
    }

    /// Takes weight from piece `number`, which has as much.
    pub(super) fn remove(&mut self, piece: &Item, number: u32, weight: u32) {
        let bin = &mut self.bins[cell_of(&self.grid, piece.lo)];
        let at = bin.binary_search_by_key(&(piece.lo[2], number), |e| (e.piece.lo[2], e.number));
        let at = at.expect("added before");
        bin[at].weight -= weight;
        if bin[at].weight == 0 {
            bin.remove(at);
        }
        self.sum -= u64::from(weight);
    }

    pub(super) fn certificate(self) -> Certificate {
        let mut pieces: Vec<(Item, u32)> = self.bins.iter().flatten().map(|e| (e.piece, e.weight)).collect();
        pieces.sort_unstable_by_key(|(p, _)| (p.lo[2], *p));
        Certificate { size: self.size, whole: self.whole, pieces }
    }
}
