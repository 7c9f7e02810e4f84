//! Windows and levels placed freely: boxes of one size, as few as can be found, that hold every piece.
//!
//! A first cover is the best of a few sweeps; then boxes are taken out and what they alone held is
//! given to others, as long as that pays. All of it is combinatorial, on exact integers, and the same
//! for the same pieces in any order. Nothing proves that the result is the fewest; how far it can be
//! from that, the bound of `bound` shows.
//!
//! Cost: about a second for two million pieces and three times that where improving pays.

mod cover;
mod ejection_pool;
mod grid;
mod improve;
mod strips;
mod tall;

use super::box_index::{Index, Item};
use cover::Cover;
use strips::Strip;

/// Boxes of `size` (nm: window x, window y, depth range), lower corners at multiples of `step` (nm)
/// along every axis, that hold every item. Returns the lower corners, upwards.
///
/// # Panics
/// Where no box at a multiple of `step` holds an item: the caller has cut it.
pub fn cover(items: &[Item], size: [i32; 3], step: [i32; 3]) -> Vec<[i32; 3]> {
    let room = [0, 1, 2].map(|k| size[k] / step[k]);
    let index = Index::new(items.iter().map(|i| i.on_lattice(size, step)).collect(), room);
    let mut cover = Cover::new(&index, room, &first(&index, room));
    improve::run(&mut cover);
    let mut corners: Vec<[i32; 3]> = cover.boxes().iter().map(|b| [0, 1, 2].map(|k| b[k] * step[k])).collect();
    corners.sort_unstable_by_key(|&[x, y, z]| (z, y, x));
    corners
}

/// The fewest boxes that a sweep finds.
fn first(index: &Index, size: [i32; 3]) -> Vec<[i32; 3]> {
    let items = index.items();
    // Never worse than the grid of sections: that cover is one of those compared.
    let mut best = grid::sweep(index, size);
    // No band holds most of the pieces that are a good part of its depth.
    let is_tall = |i: u32| items[i as usize].hi[2] - items[i as usize].lo[2] > size[2] / 4;
    let mut upwards: Vec<u32> = (0..items.len() as u32).collect();
    upwards.sort_unstable_by_key(|&i| (items[i as usize].lo[2], i));
    let (high, mut low): (Vec<u32>, Vec<u32>) = upwards.into_iter().partition(|&i| is_tall(i));
    let mut corners = tall::sweep(index, &high, size);
    if !high.is_empty() {
        let mut is_held = vec![false; items.len()];
        corners.iter().for_each(|&c| index.contained(c, size, |i| is_held[i] = true));
        low.retain(|&i| !is_held[i as usize]);
    }
    corners.extend(bands(index, &low, size));
    if corners.len() < best.len() {
        best = corners;
    }
    best
}

/// Places at which the first band may begin, as parts of the depth.
const OFFSETS: i32 = 4;

/// Bands that begin at the best of a few heights.
fn bands(index: &Index, upwards: &[u32], size: [i32; 3]) -> Vec<[i32; 3]> {
    let mut strip = Strip::new(index.items(), size);
    let below = |n: i32| size[2] / OFFSETS * n;
    let best = (0..OFFSETS).min_by_key(|&n| strips::sweep(index, upwards, size, below(n), 1, &mut strip).len());
    strips::sweep(index, upwards, size, below(best.unwrap_or(0)), strips::DIRECTIONS.len(), &mut strip)
}

#[cfg(test)]
pub(in crate::partition) mod tests;
