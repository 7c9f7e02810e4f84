//! Contours of what is dark in a picture (marching squares).
//!
//! The nodes of the grid are the centres of pixels. Two more rings of nodes lie on the picture's edge: one with the
//! densities of the pixels beside it, which carries the picture to its edge, and one without any density, which closes
//! there what is dark. A contour passes between neighbouring nodes of which one is dark; where four nodes form a
//! saddle, their mean says whether the dark ones are joined. Contours do not cross. Coordinates are pixels from the
//! upper left corner, y down.

use super::MAX_CONTOUR_POINTS;
use crate::texture::artwork::Grey;
use terrace_core::geom::PlanePoint;

/// Where a contour passes between two pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Borders {
    /// Where the density that is interpolated between their centres is that of the threshold.
    Interpolated,
    /// Along the sides of pixels.
    Pixels,
}

/// More points than contours may have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct TooMany;

/// No point.
const NONE: u32 = u32::MAX;

/// Hands each contour of what is darker than `level` to `out`; a contour does not repeat its first point.
pub(super) fn contours(
    grey: &Grey,
    level: f64,
    borders: Borders,
    mut out: impl FnMut(&[PlanePoint]),
) -> Result<(), TooMany> {
    let mut trace = Trace { grey, level, borders, points: Vec::new(), next: Vec::new() };
    trace.sweep()?;
    let mut line = Vec::new();
    for first in 0..trace.next.len() {
        line.clear();
        // Every point is followed by one, so that contours are closed. Those that were handed out are followed by none.
        let mut at = first;
        while trace.next[at] != NONE {
            add(&mut line, trace.points[at]);
            at = std::mem::replace(&mut trace.next[at], NONE) as usize;
        }
        close(&mut line);
        if line.len() > 2 {
            out(&line);
        }
    }
    Ok(())
}

/// Appends a point, and leaves out the one before it where that lies on a straight line.
fn add(line: &mut Vec<PlanePoint>, p: PlanePoint) {
    if line.last() == Some(&p) {
        return;
    }
    if let [.., a, b] = line[..]
        && is_straight(a, b, p)
    {
        line.pop();
    }
    line.push(p);
}

/// The same where the line closes.
fn close(line: &mut Vec<PlanePoint>) {
    while line.len() > 2
        && (line.first() == line.last() || is_straight(line[line.len() - 2], line[line.len() - 1], line[0]))
    {
        line.pop();
    }
    if line.len() > 2 && is_straight(line[line.len() - 1], line[0], line[1]) {
        line.remove(0);
    }
}

fn is_straight(a: PlanePoint, b: PlanePoint, c: PlanePoint) -> bool {
    let [u, v] = [[b[0] - a[0], b[1] - a[1]], [c[0] - b[0], c[1] - b[1]]];
    u[0] * v[1] == u[1] * v[0] && u[0] * v[0] + u[1] * v[1] > 0.0
}

/// The points of all contours, and how they follow each other.
struct Trace<'a> {
    grey: &'a Grey,
    level: f64,
    borders: Borders,
    points: Vec<PlanePoint>,
    /// The point that follows each in its contour.
    next: Vec<u32>,
}

impl Trace<'_> {
    /// The densities of a row of nodes; below zero where there is no picture.
    fn row(&self, j: usize, out: &mut Vec<f64>) {
        let columns = self.grey.columns;
        let rows = self.grey.rows;
        out.clear();
        if j == 0 || j == rows + 3 {
            out.resize(columns + 4, -1.0);
            return;
        }
        let row = self.grey.row((j - 1).clamp(1, rows) - 1);
        let density = |&d: &u16| f64::from(d) / f64::from(u16::MAX);
        out.push(-1.0);
        out.extend(row.first().map(density));
        out.extend(row.iter().map(density));
        out.extend(row.last().map(density));
        out.push(-1.0);
    }

    /// Where node `i` of `count` lies.
    fn place(i: usize, count: usize) -> f64 {
        match i {
            0 | 1 => 0.0,
            _ if i > count + 1 => count as f64,
            _ => i as f64 - 1.5,
        }
    }

    fn is_dark(&self, density: f64) -> bool {
        density > self.level
    }

    fn push(&mut self, p: PlanePoint) -> Result<u32, TooMany> {
        if self.points.len() == MAX_CONTOUR_POINTS {
            return Err(TooMany);
        }
        self.points.push(p);
        self.next.push(NONE);
        Ok(self.points.len() as u32 - 1)
    }

    /// The share of the way from one node to the next at which the contour passes; None where it does not.
    fn crossing(&self, from: f64, to: f64) -> Option<f64> {
        (self.is_dark(from) != self.is_dark(to)).then(|| match self.borders {
            Borders::Interpolated => (self.level - from) / (to - from),
            Borders::Pixels => 0.5,
        })
    }

    /// Finds all points and joins them, cell by cell.
    fn sweep(&mut self) -> Result<(), TooMany> {
        let columns = self.grey.columns;
        let rows = self.grey.rows;
        let mut above = Vec::new();
        let mut below = Vec::new();
        self.row(0, &mut above);
        // The points on the edges between nodes of the row above, and of the row below.
        let mut upper = vec![NONE; columns + 3];
        let mut lower = vec![NONE; columns + 3];
        for j in 1..rows + 4 {
            self.row(j, &mut below);
            let [top, bottom] = [j - 1, j].map(|j| Self::place(j, rows));
            // A point lies on a side that two cells share. It is made by the cell to the left of it or above it, and
            // kept for the other one in `left` and `upper`.
            let mut left = NONE;
            for i in 0..columns + 3 {
                let [x0, x1] = [i, i + 1].map(|i| Self::place(i, columns));
                let corners = [above[i], above[i + 1], below[i + 1], below[i]];
                lower[i] = match self.crossing(corners[3], corners[2]) {
                    Some(t) => self.push([x0 + t * (x1 - x0), bottom])?,
                    None => NONE,
                };
                let right = match self.crossing(corners[1], corners[2]) {
                    Some(t) => self.push([x1, top + t * (bottom - top)])?,
                    None => NONE,
                };
                self.join(corners, [upper[i], right, lower[i], left], [(x0 + x1) / 2.0, (top + bottom) / 2.0])?;
                left = right;
            }
            std::mem::swap(&mut above, &mut below);
            std::mem::swap(&mut upper, &mut lower);
        }
        Ok(())
    }

    /// Joins the points on the sides of a cell (top, right, bottom, left); what is dark lies to the right of a contour,
    /// seen with y down. Corners go round from the upper left.
    fn join(&mut self, corners: [f64; 4], sides: [u32; 4], middle: PlanePoint) -> Result<(), TooMany> {
        let dark = corners.map(|d| self.is_dark(d));
        let mean = self.is_dark(corners.iter().sum::<f64>() / 4.0);
        let is_saddle = sides.iter().all(|&s| s != NONE);
        // Going round, a side lies between a corner and the next: it is entered where the first is the dark one.
        for side in (0..4).filter(|&s| sides[s] != NONE && dark[s]) {
            let to = match (is_saddle, mean) {
                // Round the light corner after the side, or round the dark one before it.
                (true, true) => (side + 1) % 4,
                (true, false) => (side + 3) % 4,
                (false, _) => (0..4).find(|&s| sides[s] != NONE && s != side).expect("contours that enter leave"),
            };
            let mut from = sides[side];
            if self.borders == Borders::Pixels {
                // From side to side of a cell through its middle, where the corners of pixels are.
                let corner = self.push(middle)?;
                self.next[from as usize] = corner;
                from = corner;
            }
            self.next[from as usize] = sides[to];
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A picture of densities in tenths, row by row.
    fn picture(rows: &[&str]) -> Grey {
        let tenth = |c: char| (c.to_digit(10).expect("a digit") as f64 / 9.0 * 65_535.0).round() as u16;
        let density = rows.iter().flat_map(|r| r.chars().map(tenth)).collect();
        Grey::new(rows[0].len(), rows.len(), density)
    }

    fn traced(rows: &[&str], level: f64, borders: Borders) -> Vec<Vec<PlanePoint>> {
        let mut out = Vec::new();
        contours(&picture(rows), level, borders, |line| out.push(line.to_vec())).expect("few");
        out
    }

    /// What contours enclose; y points down, so that those with the dark on their right count.
    fn area(lines: &[Vec<PlanePoint>]) -> f64 {
        let of = |line: &Vec<PlanePoint>| -> f64 {
            line.iter().zip(line.iter().cycle().skip(1)).map(|(a, b)| (a[0] * b[1] - b[0] * a[1]) / 2.0).sum()
        };
        lines.iter().map(of).sum()
    }

    #[test]
    fn pixels_keep_their_sides() {
        let dark = traced(&["999", "999"], 0.5, Borders::Pixels);
        assert_eq!(dark, [[[0.0, 0.0], [3.0, 0.0], [3.0, 2.0], [0.0, 2.0]]]);
        for (rows, count, want) in [
            (&["000", "090", "000"][..], 1, 1.0),
            (&["999", "909", "999"], 2, 8.0),
            (&["90", "09"], 2, 2.0),
            (&["9"], 1, 1.0),
            (&["90909", "09090", "90909"], 8, 8.0),
            (&["00", "00"], 0, 0.0),
        ] {
            let lines = traced(rows, 0.5, Borders::Pixels);
            assert_eq!(area(&lines), want, "{rows:?}: {lines:?}");
            let corners: usize = lines.iter().map(Vec::len).sum();
            assert!(lines.iter().flatten().flatten().all(|v| v.fract() == 0.0), "{rows:?}: {lines:?}");
            assert!(lines.len() <= count && corners <= 4 * count, "{rows:?}: {lines:?}");
        }
    }

    #[test]
    fn borders_lie_where_the_interpolated_density_is_that_of_the_threshold() {
        // From 9/9 in the middle to 0 beside it: the half lies half way.
        let diamond = traced(&["000", "090", "000"], 0.5, Borders::Interpolated);
        assert!((area(&diamond) - 0.5).abs() < 1e-4, "{diamond:?}");
        // A ramp along x: density x / 9 at x + 1/2, so that 0.25 is reached at 2.25 + 0.5.
        let ramp = traced(&["0123456789", "0123456789"], 0.25, Borders::Interpolated);
        assert_eq!(ramp.len(), 1);
        assert!((area(&ramp) - 2.0 * (10.0 - 2.75)).abs() < 1e-3, "{ramp:?}");
        // A picture that is dark to its edge is marked to its edge.
        assert_eq!(area(&traced(&["999", "999"], 0.5, Borders::Interpolated)), 6.0);
    }

    #[test]
    fn the_mean_decides_at_saddles() {
        // Dark corners of 9 or 8 tenths across from each other; the mean of all four is above a half or not.
        for (rows, count) in
            [(["90", "09"], 2), (["97", "79"], 1), (["93", "39"], 1), (["81", "18"], 2), (["82", "28"], 1)]
        {
            assert_eq!(traced(&rows, 0.5, Borders::Interpolated).len(), count, "{rows:?}");
        }
    }
}
