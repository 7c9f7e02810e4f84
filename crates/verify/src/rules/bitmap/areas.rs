//! Areas by a threshold: what is marked lies in the dark, and the dark is filled or outlined.

use super::super::drawing::around;
use super::grey::Grey;
use super::{BEYOND, MAX_MARKS, PlacedBitmap, ROUNDING, TextureStrokes, places};
use crate::proof::Rule;
use terrace_core::geom::{BoxMm, NM_PER_MM, P2, PlanePoint};
use terrace_core::math;
use terrace_input::texture::FillMode;

/// Most dark places that are looked for, as docs/explanation/verify.md states.
pub(super) const MAX_PLACES: usize = 60_000;

/// Most pixels that are looked at for them.
const MAX_LOOKS: usize = 300_000_000;

/// Most cells of the grid that says where marks are.
const MAX_CELLS: f64 = 4e8;

impl PlacedBitmap<'_> {
    /// Areas that are darker than a threshold.
    pub(super) fn check_areas(
        &self,
        grey: &Grey,
        threshold: f64,
        marks: &TextureStrokes<'_>,
        is_cut: bool,
        rule: &mut Rule,
    ) -> Result<(), &'static str> {
        self.marks_lie_in_the_dark(grey, threshold, marks, rule);
        if is_cut {
            return Err("whether all dark areas are filled is not compared where inside or outside cut them");
        }
        if self.marking.along_contours.is_some() {
            return Err("whether all dark areas are filled is not compared for lines along contours");
        }
        self.the_dark_is_marked(grey, threshold, marks, rule);
        Ok(())
    }

    /// Holds places of the marks: each lies on the page and in the dark.
    fn marks_lie_in_the_dark(&self, grey: &Grey, threshold: f64, marks: &TextureStrokes<'_>, rule: &mut Rule) {
        let by_pixels = grey.is_two_tone();
        let mut points = Vec::new();
        for i in marks.sampled(MAX_MARKS) {
            (marks.drawing.stroke)(i, &mut points);
            for p in places(&points) {
                rule.checked += 1;
                let is_dark_at = |q| self.is_dark_near(grey, threshold, by_pixels, self.page.at(q));
                if !self.page.holds(p, self.slack_mm) {
                    rule.broken("", (marks.drawing.element)(i), BEYOND);
                } else if !around(p, self.slack_mm * NM_PER_MM).any(is_dark_at) {
                    let [x, y] = self.page.at(p);
                    let text = format!("it is marked where the bitmap is light, at {x:.4}, {y:.4} mm of the page");
                    rule.broken("", (marks.drawing.element)(i), text);
                }
            }
        }
    }

    /// Whether a pixel is dark of those that a point of the page may lie in. Of a bitmap of two tones the border of the
    /// dark is the side of a pixel; of others it lies between the centres of neighbours.
    fn is_dark_near(&self, grey: &Grey, threshold: f64, by_pixels: bool, p: PlanePoint) -> bool {
        let slack = self.slack_mm;
        let [columns, mut rows] = if by_pixels {
            self.pixels_at(grey, p)
        } else {
            grey.around([p[0] - slack, p[1] - slack], [p[0] + slack, p[1] + slack])
        };
        rows.any(|j| grey.density[j * grey.columns..][columns.clone()].iter().any(|&d| self.is_dark(d, threshold)))
    }

    fn is_dark(&self, density: f32, threshold: f64) -> bool {
        f64::from(density) > threshold - ROUNDING
    }

    /// The pixels that a point lies on, to the tolerance.
    fn pixels_at(&self, grey: &Grey, p: PlanePoint) -> [std::ops::Range<usize>; 2] {
        let range = |v: f64, side: f64, count: usize| {
            let pixel = |v: f64| (v / side).floor().clamp(0.0, count as f64 - 1.0) as usize;
            pixel(v - self.slack_mm)..pixel(v + self.slack_mm) + 1
        };
        [range(p[0], grey.pixel[0], grey.columns), range(grey.height - p[1], grey.pixel[1], grey.rows)]
    }

    /// Holds dark places: each has a mark beside it.
    fn the_dark_is_marked(&self, grey: &Grey, threshold: f64, marks: &TextureStrokes<'_>, rule: &mut Rule) {
        let pitch = self.marking.pitch_mm.unwrap_or(self.spot_mm / 2.0);
        let is_outline = self.marking.fill == FillMode::Outline;
        let inset = self.marking.inset_mm.unwrap_or(self.spot_mm / 2.0);
        let widest = grey.pixel[0].max(grey.pixel[1]);
        // How deep in the dark a place must lie for a line to pass within `reach` of it. A line passes within half a
        // pitch, and about that place of the line it is dark as far as the inset and one pitch more.
        let (depth, reach) = if is_outline { (0.0, widest) } else { (inset + 1.5 * pitch + self.slack_mm, pitch) };
        let marked = MarkedCells::new(self, marks, reach + self.slack_mm);
        let wide = [0, 1].map(|k| (depth / grey.pixel[k]).ceil() as usize + 1);
        let looks = if is_outline { 2 } else { (2 * wide[0] + 1) * (2 * wide[1] + 1) };
        let most = MAX_PLACES.min(MAX_LOOKS / looks.max(1)).max(1);
        // On borders few pixels count, so all are looked at.
        let stride = if is_outline { 1 } else { (grey.density.len().div_ceil(most)).max(1) };
        let mut found = 0;
        for k in (0..grey.density.len()).step_by(stride) {
            let (i, j) = (k % grey.columns, k / grey.columns);
            let is_place = if is_outline {
                self.is_at_border(grey, threshold, i, j)
            } else {
                is_deep_in_the_dark(grey, threshold, i, j, wide)
            };
            if !is_place {
                continue;
            }
            found += 1;
            if found > MAX_PLACES {
                break;
            }
            let on_file = [(i as f64 + 0.5) * grey.pixel[0], grey.height - (j as f64 + 0.5) * grey.pixel[1]];
            for p in self.page.copies(on_file, self.limit) {
                if !self.is_within(p, depth + reach) {
                    continue;
                }
                rule.checked += 1;
                if !marked.has_near(p) {
                    let [x, y] = on_file;
                    let text =
                        format!("the bitmap is dark at {x:.4}, {y:.4} mm of the page, and nothing is marked there");
                    rule.broken("", self.name.clone(), text);
                }
            }
        }
    }

    /// Whether a pixel is dark for certain and has the border of the dark on its right or its lower side.
    fn is_at_border(&self, grey: &Grey, threshold: f64, i: usize, j: usize) -> bool {
        let is_light = |i: usize, j: usize| !self.is_dark(grey.density[j * grey.columns + i], threshold);
        is_surely_dark(grey, threshold, i, j)
            && (i + 1 == grey.columns || is_light(i + 1, j) || j + 1 == grey.rows || is_light(i, j + 1))
    }
}

/// Whether a pixel is darker than the threshold, however its density was rounded.
fn is_surely_dark(grey: &Grey, threshold: f64, i: usize, j: usize) -> bool {
    f64::from(grey.density[j * grey.columns + i]) > threshold + ROUNDING
}

/// Whether a pixel and all others up to `wide` columns and rows from it are dark for certain, and on the page.
fn is_deep_in_the_dark(grey: &Grey, threshold: f64, i: usize, j: usize, wide: [usize; 2]) -> bool {
    i >= wide[0]
        && j >= wide[1]
        && i + wide[0] < grey.columns
        && j + wide[1] < grey.rows
        && (j - wide[1]..=j + wide[1])
            .all(|j| (i - wide[0]..=i + wide[0]).all(|i| is_surely_dark(grey, threshold, i, j)))
}

/// Where marks are, to a cell of a grid over the page or its tiles.
struct MarkedCells {
    lo: PlanePoint,
    cell: f64,
    count: [usize; 2],
    is_set: Vec<bool>,
}

impl MarkedCells {
    /// The cells that the strokes pass; each is as wide as `reach`, mm, or as the memory for the grid asks.
    fn new(bitmap: &PlacedBitmap<'_>, marks: &TextureStrokes<'_>, reach: f64) -> Self {
        let BoxMm { lo, hi } = bitmap.page.extent(bitmap.limit);
        let area = (hi[0] - lo[0]) * (hi[1] - lo[1]);
        let cell = reach.max((area / MAX_CELLS).sqrt());
        // Marks on an edge may lie beside it.
        let lo = lo.map(|v| v - cell);
        let count = [0, 1].map(|k| ((hi[k] - lo[k]) / cell) as usize + 2);
        let mut marked = Self { lo, cell, count, is_set: vec![false; count[0] * count[1]] };
        let mut points = Vec::new();
        for i in marks.strokes.clone() {
            (marks.drawing.stroke)(i, &mut points);
            let on_plane = |p: &P2| bitmap.page.on_plane([p.x as f64, p.y as f64]);
            points.first().map(on_plane).into_iter().for_each(|p| marked.set(p));
            for w in points.windows(2) {
                let (a, b) = (on_plane(&w[0]), on_plane(&w[1]));
                // Steps of half a cell at most: a cell that is left out is cut at a corner, next to one that is set.
                let steps = (math::hypot(b[0] - a[0], b[1] - a[1]) / cell * 2.0).ceil().max(1.0);
                for k in 1..=steps as usize {
                    let t = k as f64 / steps;
                    marked.set([0, 1].map(|m| a[m] + t * (b[m] - a[m])));
                }
            }
        }
        marked
    }

    fn cell_of(&self, p: PlanePoint) -> [i64; 2] {
        [0, 1].map(|k| ((p[k] - self.lo[k]) / self.cell).floor() as i64)
    }

    fn index(&self, [i, j]: [i64; 2]) -> Option<usize> {
        let is_in = |v: i64, count: usize| (0..count as i64).contains(&v);
        (is_in(i, self.count[0]) && is_in(j, self.count[1])).then(|| j as usize * self.count[0] + i as usize)
    }

    fn set(&mut self, p: PlanePoint) {
        if let Some(k) = self.index(self.cell_of(p)) {
            self.is_set[k] = true;
        }
    }

    /// Whether a mark passes the cell of a point or one next to it.
    fn has_near(&self, p: PlanePoint) -> bool {
        let [i, j] = self.cell_of(p);
        (-1..=1).any(|x| (-1..=1).any(|y| self.index([i + x, j + y]).is_some_and(|k| self.is_set[k])))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_lie_deep_in_the_dark_where_all_about_them_is_dark_and_on_the_page() {
        let mut density = vec![1.0; 25];
        density[4] = 0.0;
        let grey = Grey { columns: 5, rows: 5, density, pixel: [1.0; 2], height: 5.0 };
        let is_deep = |i, j| is_deep_in_the_dark(&grey, 0.5, i, j, [1, 1]);
        assert!(is_deep(2, 2) && is_deep(1, 1) && is_deep(3, 3));
        assert!(!is_deep(3, 1), "next to the light pixel");
        assert!(!is_deep(0, 2) && !is_deep(2, 4), "at the edge of the page");
    }
}
