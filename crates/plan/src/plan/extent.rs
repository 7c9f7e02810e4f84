//! Boxes of marks, and the room that they leave for the box that a stop admits.

use std::collections::BTreeMap;

use super::cut::StopMarks;
use terrace_core::geom::Nm;

/// A box of marks, nm: x, y and z.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extent {
    pub(super) lo: [i64; 3],
    pub(super) hi: [i64; 3],
}

impl Extent {
    /// The box of the marks of a stop, with what is kept free above and below them.
    pub(super) fn of(marks: &StopMarks) -> Self {
        let area = &marks.area;
        let [lo, hi] = marks.heights.held_nm().map(|Nm(z)| z);
        Self { lo: [area.lo.x, area.lo.y, lo], hi: [area.hi.x, area.hi.y, hi] }
    }

    pub(super) fn union(&self, other: &Self) -> Self {
        let ends = |pick: fn(i64, i64) -> i64, a: [i64; 3], b: [i64; 3]| [0, 1, 2].map(|k| pick(a[k], b[k]));
        Self { lo: ends(i64::min, self.lo, other.lo), hi: ends(i64::max, self.hi, other.hi) }
    }

    pub(super) fn middle(&self) -> [i64; 3] {
        [0, 1, 2].map(|k| self.lo[k].midpoint(self.hi[k]))
    }

    /// Between which lower corners, on the lattice of `corner`, a box of `size` that stands there holds these marks.
    pub(super) fn room(&self, corner: [i64; 3], size: [i64; 3], step: i64) -> [[i64; 2]; 3] {
        [0, 1, 2].map(|k| {
            let up = (self.lo[k] - ROUNDING - corner[k]).div_euclid(step) * step;
            let down = (corner[k] + size[k] - self.hi[k] - ROUNDING).div_euclid(step) * step;
            [corner[k] - down.max(0), corner[k] + up.max(0)]
        })
    }
}

/// What rounding may have done to a mark, nm: a cut moved onto the border of a window, a height to the nanometre.
const ROUNDING: i64 = 2;

/// Finds boxes of marks whose middle lies within a size of a place.
pub(super) struct NearExtents {
    size: [i64; 3],
    /// Height and number of the middles over every cell of that size.
    cells: BTreeMap<[i64; 2], Vec<(i64, usize)>>,
}

impl NearExtents {
    pub(super) fn new(middles: impl Iterator<Item = [i64; 3]>, size: [i64; 3]) -> Self {
        let mut near = Self { size, cells: BTreeMap::new() };
        for (i, middle) in middles.enumerate() {
            near.cells.entry(near.cell(middle)).or_default().push((middle[2], i));
        }
        near.cells.values_mut().for_each(|list| list.sort_unstable());
        near
    }

    fn cell(&self, at: [i64; 3]) -> [i64; 2] {
        [0, 1].map(|k| at[k].div_euclid(self.size[k]))
    }

    /// The indices of the boxes whose middle lies within a size of `at`, and of some more.
    pub(super) fn around(&self, at: [i64; 3]) -> impl Iterator<Item = usize> {
        let ([column, row], depth) = (self.cell(at), self.size[2]);
        let cells = (-1..=1).flat_map(move |y| (-1..=1).map(move |x| [column + x, row + y]));
        cells.filter_map(|cell| self.cells.get(&cell)).flat_map(move |list| {
            let from = list.partition_point(|&(z, _)| z < at[2] - depth);
            list[from..].iter().take_while(move |&&(z, _)| z <= at[2] + depth).map(|&(_, i)| i)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrace_core::random::Random;

    const SIZE: [i64; 3] = [4_000_000, 4_000_000, 70_000];

    #[test]
    fn a_box_may_stand_wherever_it_holds_the_marks_and_nowhere_else() {
        let mut random = Random::new(3);
        for _ in 0..2000 {
            let corner = [0, 1, 2].map(|k| random.between(-SIZE[k], SIZE[k]));
            let lo = [0, 1, 2].map(|k| corner[k] + random.between(0, SIZE[k]));
            let extent = Extent { lo, hi: [0, 1, 2].map(|k| lo[k] + random.between(0, corner[k] + SIZE[k] - lo[k])) };
            for (k, [from, to]) in extent.room(corner, SIZE, 100).into_iter().enumerate() {
                let holds = |at: i64| at <= extent.lo[k] && extent.hi[k] <= at + SIZE[k];
                assert!(
                    from <= corner[k]
                        && corner[k] <= to
                        && (to - corner[k]) % 100 == 0
                        && (corner[k] - from) % 100 == 0
                );
                assert!(holds(from) && holds(to));
                // To the rounding of marks no place on the lattice is left out.
                assert!(!holds(from - 100 - ROUNDING) && !holds(to + 100 + ROUNDING));
            }
        }
    }
}
