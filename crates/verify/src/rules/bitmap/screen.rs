//! Screens: in every window of a page as much is marked as the bitmap is dark there.

use std::collections::HashMap;

use super::grey::Grey;
use super::{BEYOND, Look, MAX_MARKS, Marks, Point, ROUNDING, places};
use crate::proof::Rule;
use terrace_core::geom::{BoxMm, P2};
use terrace_input::texture::{Screen, Tone};

/// The period of dashes and halftone cells unless the job states it, in pitches.
const PERIOD: f64 = 10.0;

/// Sites along a side of a halftone cell at most, and of the mask of noise.
const MAX_SIDE: f64 = 256.0;
const NOISE_SIDE: usize = 64;

impl Look<'_> {
    /// Grey by lines or dots.
    pub(super) fn screen(
        &self,
        grey: &Grey,
        tone: &Tone,
        marks: &Marks<'_>,
        is_cut: bool,
        rule: &mut Rule,
    ) -> Result<(), &'static str> {
        let pitch = self.marking.pitch_mm.unwrap_or(self.spot_mm);
        let raster = Raster { screen: tone.screen, pitch, period: tone.period_mm.unwrap_or(PERIOD * pitch) / pitch };
        // A screen takes the mean of the pixels within a pitch.
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
    fn marks_lie_where_it_is_dark(&self, grey: &Grey, marks: &Marks<'_>, reach: f64, rule: &mut Rule) {
        let mut points = Vec::new();
        for i in marks.some(MAX_MARKS) {
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
        marks: &Marks<'_>,
        raster: &Raster,
        rule: &mut Rule,
    ) -> Result<(), &'static str> {
        let direction = self.marking.direction_rad - self.page.turn_rad;
        let windows = Windows { look: self, pitch: raster.pitch, direction };
        let cell = raster.cell();
        let amounts = windows.amounts(marks, cell);
        let share = |density: f64| (density * raster.gain(self.spot_mm)).clamp(0.0, 1.0);
        let mut compared = 0;
        for times in [1, 4] {
            let n = cell * times;
            let (full, off) = ((n * n) as f64, raster.tolerance(n, times));
            windows.each(n, raster.reach_mm(), |tile, window, [lo, hi]| {
                let marked = amounts.of(tile, window, times as i64);
                let [least, most] = grey.range(lo, hi);
                let [least, most] = [share(least - ROUNDING), share(most + ROUNDING)];
                compared += 1;
                rule.checked += 1;
                if marked < full * least - off || marked > full * most + off {
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
            // Small enough for a small picture; what these may be off is known at any side.
            Screen::Lines | Screen::Noise | Screen::Diffusion => 16,
            // Two periods: of one, both ends of a dash could lie outside.
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

    /// How far the marked amount in a window of `n` pitches, `times` cells, may be off at an even density, in pitches of
    /// line or in dots; and one more, for marks on the window's border.
    fn tolerance(&self, n: usize, times: usize) -> f64 {
        let side = n as f64;
        let off = match self.screen {
            // The thresholds of n neighbouring lines are those of a van der Corput sequence, whose discrepancy is at
            // most 1 + log2(n) / 2 lines; each is `side` long.
            Screen::Lines => side * (1.0 + side.log2() / 2.0),
            // On each line an eighth of a period at each of the two ends.
            Screen::Dashes => side * self.period / 4.0,
            // No error that is handed on is above half a dot; those handed over the borders of n rows and n columns
            // come to 1.25 n.
            Screen::Diffusion => 1.25 * side,
            // A part of a mask: less is known than of a whole one, two dots in each row.
            Screen::Noise if n < NOISE_SIDE => 2.0 * side,
            // Each mask has every threshold once: half a dot.
            Screen::Noise => (n / NOISE_SIDE).pow(2) as f64 / 2.0,
            // Each cell has every threshold once: half a dot.
            _ => (times * times) as f64 / 2.0,
        };
        off + 1.0
    }
}

/// The windows of a screen: u along its lines or rows, v across them, from the corner of the page.
struct Windows<'a> {
    look: &'a Look<'a>,
    pitch: f64,
    /// On the page.
    direction: f64,
}

/// What is marked in each window of a side: length in pitches, or dots.
struct Amounts(HashMap<([i64; 2], [i64; 2]), f64>);

impl Amounts {
    /// In a window that consists of `times` by `times` of them.
    fn of(&self, tile: [i64; 2], window: [i64; 2], times: i64) -> f64 {
        let mut sum = 0.0;
        for j in 0..times {
            for i in 0..times {
                sum += self.0.get(&(tile, [times * window[0] + i, times * window[1] + j])).unwrap_or(&0.0);
            }
        }
        sum
    }
}

impl Windows<'_> {
    fn along(&self, [x, y]: Point) -> Point {
        let (s, c) = self.direction.sin_cos();
        [c * x + s * y, c * y - s * x]
    }

    fn amounts(&self, marks: &Marks<'_>, n: usize) -> Amounts {
        let page = self.look.page;
        let side = n as f64 * self.pitch;
        let mut all = HashMap::new();
        let mut points = Vec::new();
        let mut at = |middle: Point, amount: f64| {
            let tile = page.tile_of(middle);
            let window = self.along(page.in_tile(middle, tile)).map(|v| (v / side).floor() as i64);
            *all.entry((tile, window)).or_insert(0.0) += amount;
        };
        for i in marks.strokes.clone() {
            (marks.drawing.stroke)(i, &mut points);
            let on = |p: &P2| page.on_plane([p.x as f64, p.y as f64]);
            if let [dot] = points[..] {
                at(on(&dot), 1.0);
            }
            for w in points.windows(2) {
                let (a, b) = (on(&w[0]), on(&w[1]));
                let length = (b[0] - a[0]).hypot(b[1] - a[1]);
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
                        at(place((c[0] + c[1]) / 2.0), (c[1] - c[0]) * length / self.pitch);
                    }
                }
            }
        }
        Amounts(all)
    }

    /// Every window of a side that lies on the page, farther than `margin` from its edges, and where marks are not cut;
    /// with its tile and the box around it, enlarged by the margin, on the page as the file has it.
    fn each(&self, n: usize, margin: f64, mut of: impl FnMut([i64; 2], [i64; 2], [Point; 2])) {
        let Look { page, limit, .. } = *self.look;
        let side = n as f64 * self.pitch;
        let ends = BoxMm::of(BoxMm { lo: [0.0; 2], hi: page.size }.corners().map(|p| self.along(p)));
        let range = |k: usize| (ends.lo[k] / side).floor() as i64..=(ends.hi[k] / side).ceil() as i64;
        let (s, c) = self.direction.sin_cos();
        let tiles = page.tiles(limit);
        for j in range(1) {
            for i in range(0) {
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
                        corners.iter().all(|p| self.look.is_within([p[0] + shift[0], p[1] + shift[1]], 1e-5));
                    if is_whole {
                        of(tile, [i, j], file);
                    }
                }
            }
        }
    }
}
