//! Contours that look closed and are not: lines joined end to end whose two loose ends lie near each other.

use std::collections::HashMap;

/// A gap shorter than this part of its contour looks like an error.
const SMALL: f64 = 0.02;

/// Least number of lines that make a contour.
const LEAST_LINES: usize = 3;

/// A line with two ends, mm.
pub(super) struct Ends {
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
pub(super) fn gaps(lines: &[Ends], tolerance: f64) -> Vec<Gap> {
    let key = |p: [f64; 2]| p.map(|v| (v / tolerance).round() as i64);
    let mut at: HashMap<[i64; 2], Vec<usize>> = HashMap::new();
    for (i, line) in lines.iter().enumerate() {
        line.ends.iter().for_each(|&p| at.entry(key(p)).or_default().push(i));
    }
    let degree = |p: [f64; 2]| at[&key(p)].len();
    let mut is_done = vec![false; lines.len()];
    let mut out = Vec::new();
    for start in 0..lines.len() {
        let Some(loose) = lines[start].ends.into_iter().find(|&p| degree(p) == 1).filter(|_| !is_done[start]) else {
            continue;
        };
        // Follows the contour while just two lines meet.
        let (mut line, mut from, mut count, mut length) = (start, loose, 0, 0.0);
        let end = loop {
            is_done[line] = true;
            count += 1;
            length += lines[line].length;
            let [a, b] = lines[line].ends;
            let to = if key(a) == key(from) { b } else { a };
            match at[&key(to)].as_slice() {
                &[i, j] if i != j => (line, from) = (if i == line { j } else { i }, to),
                _ => break to,
            }
            if is_done[line] {
                break to;
            }
        };
        let width = (end[0] - loose[0]).hypot(end[1] - loose[1]);
        if count >= LEAST_LINES && degree(end) == 1 && width > 2.0 * tolerance && width < SMALL * length {
            out.push(Gap { width, lines: count, name: lines[start].name });
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(points: &[[f64; 2]]) -> Vec<Ends> {
        let line = |(i, w): (usize, &[[f64; 2]])| {
            // Every other one runs the other way.
            let ends = if i % 2 == 0 { [w[0], w[1]] } else { [w[1], w[0]] };
            Ends { ends, length: (w[1][0] - w[0][0]).hypot(w[1][1] - w[0][1]), name: i as u32 }
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
