//! A first cover of pieces that are tall against the depth of a stop, such as whole figures: no band
//! holds most of them, so every stop takes its level from the lowest piece that is not assigned yet, and
//! its place from counting.

use crate::partition::box_index::{Index, Item};

/// Lower corners of boxes that hold every piece named in `upwards` (sorted by lower ends).
pub(super) fn sweep(index: &Index, upwards: &[u32], size: [i32; 3]) -> Vec<[i32; 3]> {
    let items = index.items();
    let mut open = vec![false; items.len()];
    upwards.iter().for_each(|&i| open[i as usize] = true);
    let mut corners = Vec::new();
    let mut near: Vec<usize> = Vec::new();
    let mut ends: Vec<(i32, i32)> = Vec::new();
    let mut lefts: Vec<i32> = Vec::new();
    for &i in upwards {
        if !open[i as usize] {
            continue;
        }
        let seed = items[i as usize];
        let z = seed.lo[2];
        // All that fits a box with the seed lies in a box of twice the size.
        near.clear();
        let wide = [2 * size[0], 2 * size[1], size[2]];
        index.contained([seed.hi[0] - size[0], seed.hi[1] - size[1], z], wide, |n| {
            if open[n] {
                near.push(n);
            }
        });
        let corner = place(items, &near, &seed, size, &mut lefts, &mut ends);
        for &n in &near {
            open[n] &= !items[n].is_in(corner, size);
        }
        corners.push(corner);
    }
    corners
}

/// Left ends that are tried at most.
const LEFTS: usize = 64;

/// The box that holds `seed`, at its level, and the most of `near`.
fn place(
    items: &[Item],
    near: &[usize],
    seed: &Item,
    size: [i32; 3],
    lefts: &mut Vec<i32>,
    ends: &mut Vec<(i32, i32)>,
) -> [i32; 3] {
    lefts.clear();
    lefts.extend(near.iter().map(|&n| items[n].lo[0]).filter(|&x| x <= seed.lo[0] && x + size[0] >= seed.hi[0]));
    lefts.push(seed.lo[0]);
    lefts.sort_unstable();
    lefts.dedup();
    let mut best = ([seed.lo[0], seed.lo[1]], 0);
    for &x in lefts.iter().step_by(lefts.len().div_ceil(LEFTS)) {
        ends.clear();
        // With the left end fixed, a piece is assigned by the boxes that begin between `first` and `last` along y, both
        // ends included; the most such intervals over one place are found by going through their ends.
        for &n in near {
            let i = &items[n];
            if i.lo[0] >= x && i.hi[0] <= x + size[0] {
                let (first, last) = (i.hi[1].max(seed.hi[1]) - size[1], i.lo[1].min(seed.lo[1]));
                if first <= last {
                    ends.push((first, 1));
                    ends.push((last + 1, -1));
                }
            }
        }
        ends.sort_unstable();
        let mut assigned = 0;
        for &(y, change) in ends.iter() {
            assigned += change;
            if assigned > best.1 {
                best = ([x, y], assigned);
            }
        }
    }
    [best.0[0], best.0[1], seed.lo[2]]
}
