//! Screens: in every window of a page as much is marked as the bitmap is dark there.

use std::collections::HashMap;
use terrace_core::math;

use super::grey::Grey;
use super::{BEYOND, MAX_MARKS, PlacedBitmap, ROUNDING, TextureStrokes, places};
use crate::proof::Rule;
use terrace_core::geom::{BoxMm, P2, PlanePoint};
use terrace_input::texture::{Screen, Tone};

/// The period of dashes and halftone cells unless the job states it, in pitches: the default of
/// docs/reference/job-file.md.
const PERIOD: f64 = 10.0;

/// Most sites along a side of a halftone cell: the compiler's limit.
const MAX_SIDE: f64 = 256.0;

/// Sites along a side of the mask of noise, as docs/reference/job-file.md states.
const NOISE_SIDE: usize = 64;

/// The windows at which tones are compared, in cells of the screen along a side.
const WINDOW_CELLS: [usize; 2] = [1, 4];

impl PlacedBitmap<'_> {
    /// Grey by lines or dots.
    pub(super) fn check_screen(
        &self,
        grey: &Grey,
        tone: &Tone,
        marks: &TextureStrokes<'_>,
        is_cut: bool,
        rule: &mut Rule,
    ) -> Result<(), &'static str> {
        let pitch = self.marking.pitch_mm.unwrap_or(self.spot_mm);
        let raster = Raster { screen: tone.screen, pitch, period: tone.period_mm.unwrap_or(PERIOD * pitch) / pitch };
        // A screen takes the mean of the pixels within a pitch, where there are two or more along it.
        let pixels = pitch / grey.pixel[0].max(grey.pixel[1]);
        let joined = (pixels >= 2.0).then(|| grey.joined(pixels.min(grey.columns.max(grey.rows) as f64) as usize));
        let grey = joined.as_ref().unwrap_or(grey);
        self.marks_lie_where_it_is_dark(grey, marks, raster.reach_mm() + self.slack_mm, rule);
        if is_cut {
            return Err("tones are not compared where inside or outside cut them");
        }
        self.tones_are_those_of_the_bitmap(grey, marks, &raster, rule)
    }

    /// Holds places of the marks: nothing is marked beyond the page, or farther than `reach` mm from all that is dark.
    fn marks_lie_where_it_is_dark(&self, grey: &Grey, marks: &TextureStrokes<'_>, reach: f64, rule: &mut Rule) {
        let mut points = Vec::new();
        for i in marks.sampled(MAX_MARKS) {
            (marks.drawing.stroke)(i, &mut points);
            for p in places(&points) {
                rule.checked += 1;
                let [x, y] = self.page.at(p);
                if !self.page.holds(p, self.slack_mm) {
                    rule.broken("", (marks.drawing.element)(i), BEYOND);
                } else if grey.range([x - reach, y - reach], [x + reach, y + reach])[1] <= ROUNDING {
                    let text = format!("it is marked where the bitmap is white, at {x:.4}, {y:.4} mm of the page");
                    rule.broken("", (marks.drawing.element)(i), text);
                }
            }
        }
    }

    /// Holds what is marked in windows of two sizes to the lightest and the darkest pixel in or next to each.
    fn tones_are_those_of_the_bitmap(
        &self,
        grey: &Grey,
        marks: &TextureStrokes<'_>,
        raster: &Raster,
        rule: &mut Rule,
    ) -> Result<(), &'static str> {
        let direction = self.marking.direction_rad - self.page.turn_rad;
        let windows = Windows { bitmap: self, pitch: raster.pitch, direction };
        let cell = raster.cell();
        let amounts = windows.amounts(marks, cell);
        let share = |density: f64| (density * raster.gain(self.spot_mm)).clamp(0.0, 1.0);
        // Windows that are cut are not compared: of a small picture there may be no other.
        let mut compared = 0;
        for cells in WINDOW_CELLS {
            let n = cell * cells;
            let full = (n * n) as f64;
            let tolerance = raster.tolerance(n, cells);
            windows.each_whole(n, raster.reach_mm(), |window, [lo, hi]| {
                let marked = amounts.of_cells(window, cells as i64);
                let [least, most] = grey.range(lo, hi);
                // The shares q of the lightest and of the darkest pixel, however their densities were rounded.
                let [least, most] = [share(least - ROUNDING), share(most + ROUNDING)];
                compared += 1;
                rule.checked += 1;
                if marked < full * least - tolerance || marked > full * most + tolerance {
                    let [x, y] = [0, 1].map(|k| (lo[k] + hi[k]) / 2.0);
                    let text = format!(
                        "of {n} by {n} pitches about {x:.4}, {y:.4} mm of the page {:.1} % are marked, and the bitmap has {:.1} % to {:.1} % there",
                        100.0 * marked / full,
                        100.0 * least,
                        100.0 * most
                    );
                    rule.broken("", self.name.clone(), text);
                }
            });
        }
        if compared == 0 { Err("it is too small for its tones to be compared") } else { Ok(()) }
    }
}

/// A screen with its sizes.
struct Raster {
    screen: Screen,
    /// Distance of its lines or dots, mm.
    pitch: f64,
    /// The period of dashes and halftone cells, in pitches.
    period: f64,
}

impl Raster {
    /// How far a mark may reach over white, mm: a dash lies anywhere in its period.
    fn reach_mm(&self) -> f64 {
        if self.screen == Screen::Dashes { self.period * self.pitch } else { 0.0 }
    }

    /// The side of the smallest windows, in pitches.
    fn cell(&self) -> usize {
        match self.screen {
            // Small enough for a small picture; what these screens may be off is known at any side.
            Screen::Lines | Screen::Noise | Screen::Diffusion => 16,
            // Two periods: in a window of one, both ends of a dash could lie outside.
            Screen::Dashes => (2.0 * self.period).ceil().max(4.0) as usize,
            // Half a dot in each cell holds for whole cells alone.
            _ => self.period.round().clamp(1.0, MAX_SIDE) as usize,
        }
    }

    /// The share that is marked of a density of 1: a line covers its spot across, a dot both ways.
    fn gain(&self, spot_mm: f64) -> f64 {
        let across = self.pitch / spot_mm;
        if matches!(self.screen, Screen::Lines | Screen::Dashes) { across } else { across.powi(2) }
    }

    /// How far the marked amount in a window of `n` pitches, which is `cells` cells wide, may lie from n² q at an even
    /// q, in pitches of line or in dots.
    fn tolerance(&self, n: usize, cells: usize) -> f64 {
        let side = n as f64;
        let by_screen = match self.screen {
            // The thresholds of n neighbouring lines are those of a van der Corput sequence: of these a share q is
            // marked to within log2(n) / 3 + 1 lines (docs/reference/job-file.md), for which log2(n) / 2 + 1 is taken.
            // Each line is `side` long.
            Screen::Lines => side * (1.0 + math::log2(side) / 2.0),
            // A dash of q periods lies in the middle of its period, so up to any place in the period as much as
            // q (1 - q) / 2 of it is missing or too much: an eighth at q = 1/2. So it is at both ends of each line.
            Screen::Dashes => side * self.period / 4.0,
            // No error that is handed on is above half a dot. Down go 3/16 + 5/16 + 1/16 of it, over the upper and the
            // lower border 2 n 9/32. Sideways go 7/16 + 1/16 in the direction of the row and 3/16 against it, over the
            // left and the right border 2 n 11/32. Together that is 1.25 n.
            Screen::Diffusion => 1.25 * side,
            // A part of a mask: less is known than of a whole one, two dots in each row.
            Screen::Noise if n < NOISE_SIDE => 2.0 * side,
            // Each mask of N sites has the thresholds (rank + 1/2) / N once, so N q of them lie below q to half a dot.
            Screen::Noise => (n / NOISE_SIDE).pow(2) as f64 / 2.0,
            // The same of each halftone cell.
            _ => (cells * cells) as f64 / 2.0,
        };
        // Marks on the border of the window count on either side of it.
        by_screen + 1.0
    }
}

/// The windows of a screen: u along its lines or rows, v across them, from the corner of the page.
struct Windows<'a> {
    bitmap: &'a PlacedBitmap<'a>,
    pitch: f64,
    /// On the page.
    direction: f64,
}

/// One window: the tile of the page that it lies on, and its numbers along u and v.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
struct Window {
    tile: [i64; 2],
    place: [i64; 2],
}

/// The amount that is marked in each window of a side: length in pitches, or dots.
#[derive(Default)]
struct Amounts(HashMap<Window, f64>);

impl Amounts {
    /// The amount that is marked in a window that consists of `cells` by `cells` of these.
    fn of_cells(&self, Window { tile, place }: Window, cells: i64) -> f64 {
        let mut sum = 0.0;
        for j in 0..cells {
            for i in 0..cells {
                let cell = Window { tile, place: [cells * place[0] + i, cells * place[1] + j] };
                sum += self.0.get(&cell).unwrap_or(&0.0);
            }
        }
        sum
    }
}

impl Windows<'_> {
    /// A point of a page in u and v.
    fn along(&self, [x, y]: PlanePoint) -> PlanePoint {
        let (s, c) = math::sin_cos(self.direction);
        [c * x + s * y, c * y - s * x]
    }

    /// The amount that the strokes mark in each window of `n` pitches.
    fn amounts(&self, marks: &TextureStrokes<'_>, n: usize) -> Amounts {
        let side = n as f64 * self.pitch;
        let mut amounts = Amounts::default();
        let mut points = Vec::new();
        for i in marks.strokes.clone() {
            (marks.drawing.stroke)(i, &mut points);
            let on_plane = |p: &P2| self.bitmap.page.on_plane([p.x as f64, p.y as f64]);
            if let [dot] = points[..] {
                self.add(on_plane(&dot), 1.0, side, &mut amounts);
            }
            for w in points.windows(2) {
                self.add_line(on_plane(&w[0]), on_plane(&w[1]), side, &mut amounts);
            }
        }
        amounts
    }

    /// Adds an amount to the window of this side, mm, in which a point of the page's plane lies.
    fn add(&self, p: PlanePoint, amount: f64, side: f64, amounts: &mut Amounts) {
        let page = self.bitmap.page;
        let tile = page.tile_of(p);
        let place = self.along(page.in_tile(p, tile)).map(|v| (v / side).floor() as i64);
        *amounts.0.entry(Window { tile, place }).or_insert(0.0) += amount;
    }

    /// Adds a line between two points of the page's plane, cut where the tile or the window along u changes. Lines of a
    /// screen run along u, so that no window changes along v.
    fn add_line(&self, a: PlanePoint, b: PlanePoint, side: f64, amounts: &mut Amounts) {
        let page = self.bitmap.page;
        let length = math::hypot(b[0] - a[0], b[1] - a[1]);
        let place = |t: f64| [0, 1].map(|k| a[k] + t * (b[k] - a[k]));
        let tiles = page.tile_crossings(a, b);
        for t in tiles.windows(2) {
            let tile = page.tile_of(place((t[0] + t[1]) / 2.0));
            let [u0, u1] = [t[0], t[1]].map(|t| self.along(page.in_tile(place(t), tile))[0] / side);
            let mut cuts = vec![t[0]];
            let (lo, hi) = (u0.min(u1), u0.max(u1));
            let inner = (lo.floor() as i64 + 1..=hi.ceil() as i64 - 1).map(|k| k as f64);
            cuts.extend(inner.map(|k| t[0] + (k - u0) / (u1 - u0) * (t[1] - t[0])));
            cuts.push(t[1]);
            cuts.sort_by(f64::total_cmp);
            for c in cuts.windows(2) {
                self.add(place((c[0] + c[1]) / 2.0), (c[1] - c[0]) * length / self.pitch, side, amounts);
            }
        }
    }

    /// Visits every window of `n` pitches that lies on the page, farther than `margin` from its edges, and where marks
    /// are not cut; with the box around it, enlarged by the margin, on the page as the file has it.
    fn each_whole(&self, n: usize, margin: f64, mut visit: impl FnMut(Window, [PlanePoint; 2])) {
        let PlacedBitmap { page, limit, .. } = *self.bitmap;
        let side = n as f64 * self.pitch;
        let ends = BoxMm::of(BoxMm { lo: [0.0; 2], hi: page.size }.corners().map(|p| self.along(p)));
        let places = |k: usize| (ends.lo[k] / side).floor() as i64..=(ends.hi[k] / side).ceil() as i64;
        let (s, c) = math::sin_cos(self.direction);
        let tiles = page.tiles(limit);
        for j in places(1) {
            for i in places(0) {
                let corners = [[0, 0], [1, 0], [0, 1], [1, 1]].map(|[a, b]| {
                    let [u, v] = [(i + a) as f64 * side, (j + b) as f64 * side];
                    [c * u - s * v, s * u + c * v]
                });
                let around = BoxMm::of(corners);
                let (lo, hi) = (around.lo.map(|v| v - margin), around.hi.map(|v| v + margin));
                if (0..2).any(|k| lo[k] < 0.0 || hi[k] > page.size[k]) {
                    continue;
                }
                let (a, b) = (page.unmirrored(lo), page.unmirrored(hi));
                let file = [[a[0].min(b[0]), a[1].min(b[1])], [a[0].max(b[0]), a[1].max(b[1])]];
                for &tile in &tiles {
                    let shift = page.shift_of(tile);
                    let is_whole =
                        corners.iter().all(|p| self.bitmap.is_within([p[0] + shift[0], p[1] + shift[1]], 1e-5));
                    if is_whole {
                        visit(Window { tile, place: [i, j] }, file);
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tolerances_are_those_of_the_table_in_docs() {
        let tolerance = |screen, n, cells| Raster { screen, pitch: 0.1, period: 10.0 }.tolerance(n, cells);
        assert_eq!(tolerance(Screen::Lines, 16, 1), 16.0 * 3.0 + 1.0);
        assert_eq!(tolerance(Screen::Dashes, 20, 1), 20.0 * 2.5 + 1.0);
        assert_eq!(tolerance(Screen::Halftone, 40, 4), 8.0 + 1.0);
        assert_eq!(tolerance(Screen::Diffusion, 64, 4), 80.0 + 1.0);
        assert_eq!(tolerance(Screen::Noise, 16, 1), 32.0 + 1.0);
        assert_eq!(tolerance(Screen::Noise, 64, 4), 0.5 + 1.0);
    }
}
