//! The grid of sections, each with its fewest levels: rows, in every row columns, in every column
//! levels, each as interval stabbing by one sweep. Where nothing straddles, this is `z-range`; `window`
//! never does worse, since this is one of the covers that it starts from.

use crate::partition::box_index::{Index, Item};

/// Lower corners of boxes that hold every piece.
pub(super) fn sweep(index: &Index, size: [i32; 3]) -> Vec<[i32; 3]> {
    let items = index.items();
    let mut corners = Vec::new();
    let mut all: Vec<u32> = (0..items.len() as u32).collect();
    let sort = |ids: &mut Vec<u32>, k: usize| ids.sort_unstable_by_key(|&i| items[i as usize].lo[k]);
    sort(&mut all, 1);
    slices(items, &all, 1, size[1], 0, |y, row| {
        sort(row, 0);
        slices(items, row, 0, size[0], 0, |x, column| {
            sort(column, 2);
            slices(items, column, 2, size[2], 0, |z, _| corners.push([x, y, z]));
        });
    });
    corners
}

/// Cuts pieces, sorted by their lower ends along axis `k`, into slices no thicker than `size`: every
/// slice begins at the lowest piece that no slice below holds (the first one `below` under it) and
/// holds all that fit. Calls `f` with the lower end of each and what it holds.
pub(super) fn slices(
    items: &[Item],
    sorted: &[u32],
    k: usize,
    size: i32,
    below: i32,
    mut f: impl FnMut(i32, &mut Vec<u32>),
) {
    let ends = |i: u32| (items[i as usize].lo[k], items[i as usize].hi[k]);
    let Some(&lowest) = sorted.first() else { return };
    let mut start = ends(lowest).0 - below;
    let mut from = 0;
    // Pieces that begin in a slice and end above it.
    let mut left: Vec<u32> = Vec::new();
    let mut slice: Vec<u32> = Vec::new();
    loop {
        slice.clear();
        let top = start + size;
        // What began in the slice before and reached beyond it comes first: the next slice begins no higher than
        // the lowest of these.
        left.retain(|&i| {
            let fits = ends(i).1 <= top;
            if fits {
                slice.push(i);
            }
            !fits
        });
        while let Some(&i) = sorted.get(from).filter(|&&i| ends(i).0 <= top) {
            (if ends(i).1 <= top { &mut slice } else { &mut left }).push(i);
            from += 1;
        }
        if !slice.is_empty() {
            f(start, &mut slice);
        }
        match left.first().into_iter().chain(sorted.get(from)).map(|&i| ends(i).0).min() {
            Some(next) => start = next,
            None => return,
        }
    }
}
