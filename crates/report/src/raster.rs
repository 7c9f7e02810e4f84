//! Cells over an area, and what lies on lines shared among them: of the maps of energy and of density.
//!
//! A line is cut where it passes from column to column, or from row to row if it is steeper; what a piece holds is shared
//! between the two cells on both sides of its middle, by their distance. So parallel lines give the same to all cells
//! wherever they lie between the centres of cells, and a line on the border of the area counts by half, as half of it
//! lies outside.

/// Cells in rows, from the lower left.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cells {
    /// Lower left corner, mm.
    pub lo: [f64; 2],
    /// Sides of a cell, mm.
    pub side: [f64; 2],
    /// Columns and rows.
    pub count: [usize; 2],
}

impl Cells {
    pub(crate) fn len(&self) -> usize {
        self.count[0] * self.count[1]
    }

    /// The centre of a cell, mm.
    pub(crate) fn centre(&self, cell: usize) -> [f64; 2] {
        let place = [cell % self.count[0], cell / self.count[0]];
        [0, 1].map(|k| self.lo[k] + (place[k] as f64 + 0.5) * self.side[k])
    }

    /// Shares a dot, mm, as a line of one cell along x: to the cells on all sides.
    pub(crate) fn share_dot(&self, [x, y]: [f64; 2], add: impl FnMut(usize, f64)) {
        let half = 0.5 * self.side[0];
        self.share_line([x - half, y], [x + half, y], add);
    }

    /// Calls `add` with cells and the shares that they have of a line, mm. What would be shared to cells beyond all is left
    /// out.
    pub(crate) fn share_line(&self, from: [f64; 2], to: [f64; 2], mut add: impl FnMut(usize, f64)) {
        // In cells, from the centre of the first: borders between cells lie at halves.
        let per_mm = self.side.map(|side| 1.0 / side);
        let place = |p: [f64; 2]| [0, 1].map(|k| (p[k] - self.lo[k]) * per_mm[k] - 0.5);
        let (from, to) = (place(from), place(to));
        let along = usize::from((to[1] - from[1]).abs() > (to[0] - from[0]).abs());
        let across = 1 - along;
        let stride = [1, self.count[0]];
        let [begin, end] = if from[along] <= to[along] { [from, to] } else { [to, from] };
        let way = end[along] - begin[along];
        let (per_cell, slope) = if way > 0.0 { (1.0 / way, (end[across] - begin[across]) / way) } else { (0.0, 0.0) };
        if end[along] < -0.5 {
            return;
        }
        let mut at = begin[along].max(-0.5);
        let mut number = (at + 0.5) as usize;
        while number < self.count[along] {
            let next = (number as f64 + 0.5).min(end[along]);
            let share = if way > 0.0 { per_cell * (next - at) } else { 1.0 };
            let middle = begin[across] + slope * (f64::midpoint(at, next) - begin[along]);
            // One more than the cell below it, as a number that is cut off is rounded down from 0 on only; a middle before
            // that has no cell.
            let above = (middle + 1.0).max(0.0) as usize;
            let share_above = (middle + 1.0 - above as f64).max(0.0);
            let base = number * stride[along];
            if above > 0 && above <= self.count[across] {
                add(base + (above - 1) * stride[across], share * (1.0 - share_above));
            }
            if above < self.count[across] {
                add(base + above * stride[across], share * share_above);
            }
            if next >= end[along] {
                return;
            }
            (at, number) = (next, number + 1);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CELLS: Cells = Cells { lo: [10.0, 20.0], side: [2.5; 2], count: [40, 20] };

    /// What the cells have of some lines.
    fn shared(lines: &[[[f64; 2]; 2]]) -> Vec<f64> {
        let mut shares = vec![0.0; CELLS.len()];
        lines.iter().for_each(|&[from, to]| CELLS.share_line(from, to, |cell, share| shares[cell] += share));
        shares
    }

    #[test]
    fn nothing_is_lost_of_lines_within_and_half_of_those_on_the_border() {
        for ([from, to], kept) in [
            ([[12.0, 22.0], [108.0, 68.0]], 1.0),
            ([[108.0, 68.0], [107.0, 22.0]], 1.0),
            ([[11.25, 21.25], [11.25, 21.25]], 1.0),
            ([[50.0, 20.0], [50.0, 70.0]], 1.0),
            ([[20.0, 20.0], [100.0, 20.0]], 0.5),
            ([[20.0, 70.0], [100.0, 70.0]], 0.5),
            ([[10.0, 30.0], [10.0, 60.0]], 0.5),
            ([[-90.0, 30.0], [310.0, 30.0]], 0.25),
            ([[30.0, -1e6], [30.0, 1e9]], 50.0 / (1e9 + 1e6)),
            ([[-5.0, 40.0], [5.0, 40.0]], 0.0),
            ([[50.0, 80.0], [51.0, 80.0]], 0.0),
        ] {
            let sum: f64 = shared(&[[from, to]]).iter().sum();
            assert!((sum - kept).abs() < 1e-9, "{from:?} {to:?}: {sum}");
        }
    }

    #[test]
    fn a_dot_is_shared_by_the_distance_of_the_centres_around_it() {
        let mut shares = vec![0.0; CELLS.len()];
        CELLS.share_dot([CELLS.centre(41)[0] + 0.625, CELLS.centre(41)[1] + 1.25], |cell, share| shares[cell] += share);
        let near = [41, 42, 81, 82].map(|cell| shares[cell]);
        assert!(near.iter().zip([0.375, 0.125, 0.375, 0.125]).all(|(a, b)| (a - b).abs() < 1e-12), "{near:?}");
        assert_eq!(CELLS.centre(41), [13.75, 23.75]);
    }

    #[test]
    fn a_hatch_gives_the_same_to_all_cells_within_it() {
        let lines: Vec<_> = (0..20).map(|k| 20.3 + 2.5 * f64::from(k)).map(|y| [[10.0, y], [110.0, y]]).collect();
        let turned: Vec<_> = (0..40).map(|k| 10.3 + 2.5 * f64::from(k)).map(|x| [[x, 70.0], [x, 20.0]]).collect();
        for (lines, each) in [(lines, 1.0 / 40.0), (turned, 1.0 / 20.0)] {
            let shares = shared(&lines);
            let inner = (1..19).flat_map(|row| (1..39).map(move |column| row * 40 + column));
            assert!(inner.clone().all(|cell| (shares[cell] - each).abs() < 1e-9));
        }
    }
}
