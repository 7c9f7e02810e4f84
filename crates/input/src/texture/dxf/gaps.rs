//! Contours that look closed and are not: lines joined end to end whose two loose ends lie near each other.

use std::collections::HashMap;
use terrace_core::math;

/// A gap shorter than this part of its contour looks like an error.
const SMALL: f64 = 0.02;

/// Least number of lines that make a contour.
const LEAST_LINES: usize = 3;

/// A line with two ends, mm.
pub(super) struct LineEnds {
    pub(super) ends: [[f64; 2]; 2],
    pub(super) length: f64,
    /// The number of its name.
    pub(super) name: u32,
}

/// A contour that is not closed.
#[derive(Debug, PartialEq)]
pub(super) struct Gap {
    /// mm.
    pub(super) width: f64,
    pub(super) lines: usize,
    /// The line at one of its loose ends.
    pub(super) name: u32,
}

/// The gaps of all contours. Ends meet where they fall on one point of a grid of `tolerance`; gaps of two grid steps
/// are not told from none.
pub(super) fn gaps(lines: &[LineEnds], tolerance: f64) -> Vec<Gap> {
    let grid = EndGrid::new(lines, tolerance);
    let mut is_done = vec![false; lines.len()];
    let mut out = Vec::new();
    for start in 0..lines.len() {
        if is_done[start] {
            continue;
        }
        let Some(loose) = lines[start].ends.into_iter().find(|&p| grid.degree(p) == 1) else { continue };
        let contour = grid.follow(start, loose, &mut is_done);
        let width = math::hypot(contour.end[0] - loose[0], contour.end[1] - loose[1]);
        let is_long = contour.lines >= LEAST_LINES && width < SMALL * contour.length;
        if is_long && grid.degree(contour.end) == 1 && width > 2.0 * tolerance {
            out.push(Gap { width, lines: contour.lines, name: lines[start].name });
        }
    }
    out
}

/// Lines by the points of a grid on which their ends fall.
struct EndGrid<'a> {
    lines: &'a [LineEnds],
    tolerance: f64,
    lines_at: HashMap<[i64; 2], Vec<usize>>,
}

/// Lines joined end to end.
struct OpenContour {
    /// Where the last of them ends.
    end: [f64; 2],
    lines: usize,
    length: f64,
}

impl<'a> EndGrid<'a> {
    fn new(lines: &'a [LineEnds], tolerance: f64) -> Self {
        let mut grid = Self { lines, tolerance, lines_at: HashMap::new() };
        for (i, line) in lines.iter().enumerate() {
            line.ends.iter().for_each(|&p| grid.lines_at.entry(grid.key(p)).or_default().push(i));
        }
        grid
    }

    fn key(&self, p: [f64; 2]) -> [i64; 2] {
        p.map(|v| (v / self.tolerance).round() as i64)
    }

    /// How many ends of lines fall on the point of the grid.
    fn degree(&self, p: [f64; 2]) -> usize {
        self.lines_at[&self.key(p)].len()
    }

    /// Follows a contour from the loose end of a line, while just two lines meet.
    fn follow(&self, start: usize, loose: [f64; 2], is_done: &mut [bool]) -> OpenContour {
        let mut line = start;
        let mut from = loose;
        let mut contour = OpenContour { end: loose, lines: 0, length: 0.0 };
        loop {
            is_done[line] = true;
            contour.lines += 1;
            contour.length += self.lines[line].length;
            let [a, b] = self.lines[line].ends;
            contour.end = if self.key(a) == self.key(from) { b } else { a };
            match self.lines_at[&self.key(contour.end)].as_slice() {
                &[i, j] if i != j => line = if i == line { j } else { i },
                _ => return contour,
            }
            from = contour.end;
            if is_done[line] {
                return contour;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(points: &[[f64; 2]]) -> Vec<LineEnds> {
        let line = |(i, w): (usize, &[[f64; 2]])| {
            // Every other one runs the other way.
            let ends = if i % 2 == 0 { [w[0], w[1]] } else { [w[1], w[0]] };
            LineEnds { ends, length: math::hypot(w[1][0] - w[0][0], w[1][1] - w[0][1]), name: i as u32 }
        };
        points.windows(2).enumerate().map(line).collect()
    }

    #[test]
    fn only_small_gaps_of_long_contours_are_found() {
        let contour = |end: [f64; 2]| lines(&[[0.0, 0.0], [9.0, 0.0], [9.0, 9.0], [0.0, 9.0], end]);
        let found = gaps(&contour([0.0, 0.1]), 1e-3);
        assert_eq!(found, [Gap { width: 0.1, lines: 4, name: 0 }]);
        for (end, why) in [([0.0, 0.0], "closed"), ([0.0, 0.001], "noise"), ([0.0, 2.0], "open on purpose")] {
            assert_eq!(gaps(&contour(end), 1e-3), [], "{why}");
        }
        assert_eq!(gaps(&lines(&[[0.0, 0.0], [9.0, 0.0], [0.0, 0.1]]), 1e-3), [], "two lines are an angle");
    }
}
