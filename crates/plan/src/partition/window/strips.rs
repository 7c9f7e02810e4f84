//! A first cover: bands of the depth of a stop, and in every connected part of a band windows placed
//! by sweeps.
//!
//! On a sloping surface a band is a narrow strip along the level lines, and the best that windows can
//! do is to follow it end to end. A sweep takes the first piece that is not assigned yet, in the order of
//! a direction, and lets the window grow over all pieces that still fit, in the same order. In a wide
//! band, where the surface is flat, the same rule lays out rows of full windows.

use super::grid::slices;
use crate::partition::box_index::{Index, Item, cell_of, extent, grid_over};
use terrace_core::geom::Grid;

/// Directions of a sweep: the key of a piece is its lower corner times these weights of x and y. Each is tried forwards
/// and backwards.
pub(super) const DIRECTIONS: [[i64; 2]; 4] = [[1, 0], [0, 1], [1, 1], [1, -1]];

/// Lower corners of boxes that hold every piece of `index` named in `upwards`, which is sorted by the
/// pieces' lower ends. The first band begins `below` under the lowest piece; `directions` orders are tried.
pub(super) fn sweep(
    index: &Index,
    upwards: &[u32],
    size: [i32; 3],
    below: i32,
    directions: usize,
    strip: &mut Strip,
) -> Vec<[i32; 3]> {
    let mut corners = Vec::new();
    slices(index.items(), upwards, 2, size[2], below, |z, band| {
        strip.cover(index.items(), band, [size[0], size[1]], &DIRECTIONS[..directions], |c| {
            corners.push([c[0], c[1], z])
        });
    });
    corners
}

/// Covers the pieces of one band; holds the memory for it.
pub(super) struct Strip {
    /// Bins; pieces of neighbouring ones are connected.
    grid: Grid,
    /// The first piece of every bin, as a place in `band`; [`NONE`] where there is none.
    first: Vec<u32>,
    /// The next piece of the same bin.
    next: Vec<u32>,
    /// Pieces of the part at hand, as numbers in `items`.
    part: Vec<u32>,
    /// Bins of the flood fill that are still to be taken.
    frontier: Vec<usize>,
    /// Key and number of the pieces of a part, in the order of a sweep.
    order: Vec<(i64, u32)>,
    sweep: Vec<SweepPiece>,
    /// Lower corners of the fewest windows found so far.
    best: Vec<[i32; 2]>,
    /// Lower corners of the windows of the last sweep.
    corners: Vec<[i32; 2]>,
}

const NONE: u32 = u32::MAX;

/// A piece seen from above, in the order of a sweep.
#[derive(Clone, Copy)]
struct SweepPiece {
    lo: [i32; 2],
    hi: [i32; 2],
    key: i64,
    assigned: bool,
}

impl Strip {
    pub(super) fn new(items: &[Item], size: [i32; 3]) -> Self {
        let [lo, hi] = extent(items.iter().map(|i| i.lo));
        // At most 2000 bins along an axis: four million.
        let grid = grid_over(lo, hi, [size[0] / 32, size[1] / 32], 2000);
        Self {
            grid,
            first: vec![NONE; grid.len()],
            next: Vec::new(),
            part: Vec::new(),
            frontier: Vec::new(),
            order: Vec::new(),
            sweep: Vec::new(),
            best: Vec::new(),
            corners: Vec::new(),
        }
    }

    /// Calls `f` with the lower corner of every window, part by part.
    fn cover(
        &mut self,
        items: &[Item],
        band: &[u32],
        size: [i32; 2],
        directions: &[[i64; 2]],
        mut f: impl FnMut([i32; 2]),
    ) {
        self.next.clear();
        for (n, &i) in band.iter().enumerate() {
            let bin = cell_of(&self.grid, items[i as usize].lo);
            self.next.push(self.first[bin]);
            self.first[bin] = n as u32;
        }
        // A bin that was taken is empty, so every part is covered once.
        for &i in band {
            let bin = cell_of(&self.grid, items[i as usize].lo);
            if self.first[bin] != NONE {
                self.take_part(bin, band);
                self.cover_part(items, size, directions);
                self.best.iter().for_each(|&c| f(c));
            }
        }
    }

    /// Moves the pieces of the bins that are connected with `bin` to `part`.
    fn take_part(&mut self, bin: usize, band: &[u32]) {
        self.part.clear();
        self.frontier.push(bin);
        // Flood fill over bins; taking the pieces of one marks it as seen.
        while let Some(bin) = self.frontier.pop() {
            let mut n = std::mem::replace(&mut self.first[bin], NONE);
            while n != NONE {
                self.part.push(band[n as usize]);
                n = self.next[n as usize];
            }
            for bin in self.grid.around(bin) {
                if self.first[bin] != NONE {
                    self.frontier.push(bin);
                }
            }
        }
        self.part.sort_unstable();
    }

    /// Covers `part` by a sweep in each of `directions`, forwards and backwards, and leaves the lower corners of the fewest
    /// windows in `best`.
    fn cover_part(&mut self, items: &[Item], size: [i32; 2], directions: &[[i64; 2]]) {
        self.best.clear();
        for &direction in directions {
            // Keys of two pieces in one window differ by at most this.
            let reach = direction[0].abs() * i64::from(size[0]) + direction[1].abs() * i64::from(size[1]);
            self.order.clear();
            self.order.extend(self.part.iter().map(|&i| {
                let item = &items[i as usize];
                (direction[0] * i64::from(item.lo[0]) + direction[1] * i64::from(item.lo[1]), i)
            }));
            self.order.sort_unstable();
            self.sweep.clear();
            self.sweep.extend(self.order.iter().map(|&(key, i)| {
                let Item { lo, hi } = items[i as usize];
                SweepPiece { lo: [lo[0], lo[1]], hi: [hi[0], hi[1]], key, assigned: false }
            }));
            // Forwards, then backwards.
            for _ in 0..2 {
                sweep_windows(&mut self.sweep, size, reach, &mut self.corners);
                // A part has a piece, so `best` is empty only before the first sweep.
                if self.best.is_empty() || self.corners.len() < self.best.len() {
                    std::mem::swap(&mut self.best, &mut self.corners);
                }
                // One window cannot be beaten.
                if self.best.len() == 1 {
                    return;
                }
                self.sweep.reverse();
            }
        }
    }
}

/// Windows in the order of the sweep: each starts at the first piece that is not assigned and grows over
/// every piece in order with which it still fits. `reach` is how far keys in one window lie apart.
fn sweep_windows(pieces: &mut [SweepPiece], size: [i32; 2], reach: i64, corners: &mut Vec<[i32; 2]>) {
    corners.clear();
    pieces.iter_mut().for_each(|p| p.assigned = false);
    for n in 0..pieces.len() {
        if pieces[n].assigned {
            continue;
        }
        let SweepPiece { mut lo, mut hi, key, .. } = pieces[n];
        for p in &mut pieces[n + 1..] {
            // The key is linear in the lower corner: behind this, no piece fits a window with the first.
            if p.key.abs_diff(key) > reach as u64 {
                break;
            }
            if p.assigned {
                continue;
            }
            let l = [lo[0].min(p.lo[0]), lo[1].min(p.lo[1])];
            let h = [hi[0].max(p.hi[0]), hi[1].max(p.hi[1])];
            if h[0] - l[0] <= size[0] && h[1] - l[1] <= size[1] {
                (lo, hi) = (l, h);
                p.assigned = true;
            }
        }
        corners.push(lo);
    }
}
