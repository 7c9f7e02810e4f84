//! The regular grid of sections over the texture's box.

use crate::geom::{Box2, P2};

/// Sections in the turned part frame, nm. Section (i, j) is half-open: it holds its lower and left
/// border; the last column and row hold their upper and right border too.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sections {
    /// Lower left corner.
    pub origin: P2,
    /// Pitch along x and y; even.
    pub pitch: [i64; 2],
    /// Columns and rows.
    pub count: [u32; 2],
}

impl Sections {
    /// The fewest sections of the given pitch over `area`, the grid starting at its lower corner or
    /// up to one `step` below it: at the next lower point whose section centres lie on multiples of
    /// `step` less `offset`, where stage targets can stand.
    pub fn over(area: Box2, pitch: [i64; 2], step: i64, offset: [i64; 2]) -> Self {
        let axis = |lo: i64, hi: i64, pitch: i64, offset: i64| {
            let start = lo - (lo + pitch / 2 + offset).rem_euclid(step);
            let count = ((hi - start) as u64).div_ceil(pitch as u64).max(1);
            (start, u32::try_from(count).unwrap_or(u32::MAX))
        };
        let (x, nx) = axis(area.lo.x, area.hi.x, pitch[0], offset[0]);
        let (y, ny) = axis(area.lo.y, area.hi.y, pitch[1], offset[1]);
        Self { origin: P2::new(x, y), pitch, count: [nx, ny] }
    }

    /// How many sections there are.
    pub fn len(&self) -> usize {
        self.count[0] as usize * self.count[1] as usize
    }

    /// Whether there is none; never, as made by [`Sections::over`].
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The point under the optical axis when section `i` is marked.
    pub fn centre(&self, i: usize) -> P2 {
        let [c, r] = self.cell(i).map(i64::from);
        P2::new(
            self.origin.x + c * self.pitch[0] + self.pitch[0] / 2,
            self.origin.y + r * self.pitch[1] + self.pitch[1] / 2,
        )
    }

    /// What section `i` covers, borders included.
    pub fn area(&self, i: usize) -> Box2 {
        let [column, row] = self.cell(i).map(i64::from);
        let lo = P2::new(self.line(0, column), self.line(1, row));
        Box2 { lo, hi: P2::new(self.line(0, column + 1), self.line(1, row + 1)) }
    }

    /// Column and row of section `i`.
    pub fn cell(&self, i: usize) -> [u32; 2] {
        [(i % self.count[0] as usize) as u32, (i / self.count[0] as usize) as u32]
    }

    /// The column (axis 0) or row (axis 1) in which a stroke is that goes from `v` in direction
    /// `d` along that axis: a point on a border belongs to the side it goes to, and to the upper side
    /// if it stays on the border.
    pub fn along(&self, axis: usize, v: i64, d: i64) -> i64 {
        let from = v - if axis == 0 { self.origin.x } else { self.origin.y };
        let pitch = self.pitch[axis];
        let i = if d < 0 { (from - 1).div_euclid(pitch) } else { from.div_euclid(pitch) };
        i.clamp(0, i64::from(self.count[axis]) - 1)
    }

    /// Part-frame coordinate of the lower border of column or row `i`.
    pub fn line(&self, axis: usize, i: i64) -> i64 {
        (if axis == 0 { self.origin.x } else { self.origin.y }) + i * self.pitch[axis]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_whole_number_of_fields_needs_no_extra_section() {
        let mm = 1_000_000;
        let area = |w: i64| Box2 { lo: P2::new(0, 0), hi: P2::new(w * mm, 450 * mm) };
        let s = Sections::over(area(400), [40 * mm, 40 * mm], 100, [0, 0]);
        assert_eq!(s.count, [10, 12]);
        assert_eq!(s.centre(11), P2::new(60 * mm, 60 * mm));
        assert_eq!(Sections::over(area(450), [40 * mm, 40 * mm], 100, [0, 0]).len(), 144);
    }

    #[test]
    fn centres_lie_where_the_stage_can_stand() {
        let area = Box2 { lo: P2::new(12_345, -777), hi: P2::new(90_000_000, 1_000_000) };
        let s = Sections::over(area, [40_000_000, 40_000_000], 100, [37, -5]);
        let c = s.centre(0);
        assert_eq!([(c.x + 37) % 100, (c.y - 5) % 100], [0, 0]);
        assert!(s.origin.x <= 12_345 && s.origin.x > 12_345 - 100);
    }

    #[test]
    fn borders_belong_to_the_side_a_stroke_goes_to() {
        let s = Sections { origin: P2::new(0, 0), pitch: [10, 10], count: [3, 1] };
        assert_eq!([s.along(0, 10, 1), s.along(0, 10, -1), s.along(0, 10, 0)], [1, 0, 1]);
        assert_eq!([s.along(0, 30, 0), s.along(0, 0, -1)], [2, 0]);
    }
}
