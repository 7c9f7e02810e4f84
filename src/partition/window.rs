//! Windows and levels placed freely: boxes of one size, as few as can be found, that hold every piece.

mod bands;

use super::items::{Index, Item};
use bands::Ribbon;

/// Boxes of `size` (nm: window x, window y, depth range), lower corners at multiples of `step` (nm)
/// along every axis, that hold every item. Answers the lower corners.
///
/// # Panics
/// Where an item is larger than a box: the caller has cut it.
pub fn cover(items: &[Item], size: [i32; 3], step: [i32; 3]) -> Vec<[i32; 3]> {
    let index = Index::new(
        items.iter().map(|i| i.on_lattice(size, step)).collect(),
        [size[0] / step[0], size[1] / step[1], size[2] / step[2]],
    );
    let room = [size[0] / step[0], size[1] / step[1], size[2] / step[2]];
    let mut upwards: Vec<u32> = (0..index.items().len() as u32).collect();
    upwards.sort_unstable_by_key(|&i| (index.items()[i as usize].lo[2], i));
    let mut ribbon = Ribbon::new(index.items(), room);
    let mut best: Option<Vec<[i32; 3]>> = None;
    for n in 0..4 {
        let corners = bands::sweep(&index, &upwards, room, room[2] / 4 * n, &mut ribbon);
        if best.as_ref().is_none_or(|b| corners.len() < b.len()) {
            best = Some(corners);
        }
    }
    let mut corners = best.unwrap_or_default();
    for c in &mut corners {
        *c = [c[0] * step[0], c[1] * step[1], c[2] * step[2]];
    }
    corners
}
