//! `bitmap`: what is marked of a bitmap lies where it is dark, and as densely as it is dark there.
//!
//! The samples are those of the job's own decoders; densities, size, place, turn and mirror are computed here and in
//! [`Page`]. Areas by a threshold: of at most [`MAX_MARKS`] marks places must be dark, and at most
//! [`MAX_PLACES`] dark places must have a mark beside them. Screens: the page is divided into windows of n by n pitches
//! along the lines or rows, at two sizes. What is marked in a window (length of lines in pitches, or number of dots) must
//! lie between n² q for the lightest and for the darkest pixel in or next to it, give or take what the screen itself may
//! be off at an even q:
//!
//! - lines: n (1 + log2(n) / 2), as thresholds of any n neighbouring lines are those of van der Corput;
//! - dashes: a quarter of a period on each line, at the two ends together;
//! - halftone: half a dot in each cell, n being a multiple of its side;
//! - noise: half a dot in each mask, n being a multiple of its side, or 2 n dots in windows smaller than a mask;
//! - diffusion: 1.25 n dots, as no error handed over is above 1/2.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use super::drawing::{F32, Placed};
use super::page::Page;
use crate::geom::{BoxMm, NM_PER_MM, P2};
use crate::texture::{Area, FillMode, Image, Kind, Marking, Request, Resolution, Screen, Tone, is_bitmap, read_bitmap};
use crate::verify::Drawing;
use crate::verify::proof::Rule;

type Point = [f64; 2];

/// Most marks of a texture that are looked at one by one.
const MAX_MARKS: usize = 30_000;

/// Most sides of a mark on which places are looked at.
const SIDES: usize = 64;

/// Most dark places that are looked for.
const MAX_PLACES: usize = 60_000;

/// Most pixels that are looked at for them.
const MAX_LOOKS: usize = 300_000_000;

/// Most cells of the grid that tells where marks are.
const MAX_CELLS: f64 = 4e8;

/// Densities are rounded to 16 bits, twice.
const ROUNDING: f64 = 4e-5;

/// The period of dashes and halftone cells unless the job states it, in pitches.
const PERIOD: f64 = 10.0;

/// Sites along a side of a halftone cell at most, and of the mask of noise.
const MAX_SIDE: f64 = 256.0;
const NOISE_SIDE: usize = 64;

const BEYOND: &str = "it is marked beyond the page of the bitmap";

const MM_PER_INCH: f64 = 25.4;

/// The bitmaps that were read, each once; None where one cannot be.
#[derive(Default)]
pub(in crate::verify) struct Bitmaps(Vec<(PathBuf, Option<Image>)>);

impl Bitmaps {
    fn get(&mut self, path: &Path) -> Option<&Image> {
        let known = self.0.iter().position(|(known, _)| known == path);
        let place = known.unwrap_or_else(|| {
            self.0.push((path.to_owned(), read_bitmap(path).ok()));
            self.0.len() - 1
        });
        self.0[place].1.as_ref()
    }
}

/// Holds the rule for the textures of a pass, as the job states them for it.
pub(in crate::verify) fn check(
    placed: &Placed<'_>,
    requests: &[Request],
    spot_mm: f64,
    bitmaps: &mut Bitmaps,
    rule: &mut Rule,
) {
    let Placed { texture, drawing, site, .. } = placed;
    rule.ran = true;
    for (number, request) in requests.iter().enumerate() {
        let Kind::Drawing { path, marking, .. } = &request.kind else { continue };
        if !is_bitmap(path) {
            continue;
        }
        let Some(image) = bitmaps.get(path) else {
            rule.leaves_out(path, number, "it cannot be read");
            continue;
        };
        let tone = marking.tone.unwrap_or_default();
        let Some(sides) = sides(image, &tone) else {
            rule.leaves_out(path, number, "it states no resolution");
            continue;
        };
        let Some(page) = Page::new(&request.kind, &request.area, site, sides) else { continue };
        let limit = match request.area {
            Area::Part => Some(site.part_box),
            Area::Rectangle(area) => Some(area),
            Area::Unlimited => None,
        };
        let is_cut = request.masks.list().next().is_some();
        let slack_mm = 2.0 * request.tolerance_mm + page.size[0].max(page.size[1]) * F32;
        let strokes = texture.strokes_of(number);
        let grey = Grey::new(image, &tone, page.size);
        let look = Look { page: &page, marking, spot_mm, slack_mm, limit, name: format!("texture {}", number + 1) };
        let marks = Marks { drawing, strokes };
        let compared = match tone.screen {
            Screen::Threshold => look.areas(&grey, tone.threshold, &marks, is_cut, rule),
            _ => look.screen(&grey, &tone, &marks, is_cut, rule),
        };
        if let Err(why) = compared {
            rule.leaves_out(path, number, why);
        }
    }
}

/// The sides of the picture without a size, mm; pixels where nothing gives any.
fn sides(image: &Image, tone: &Tone) -> Option<[f64; 2]> {
    let pixels = [image.columns as f64, image.rows as f64];
    match tone.resolution {
        None => Some(pixels),
        Some(Resolution::Dpi(dpi)) => Some(pixels.map(|n| n / dpi * MM_PER_INCH)),
        Some(Resolution::File) => image.resolution.map(|per_mm| [0, 1].map(|k| pixels[k] / per_mm[k])),
    }
}

/// The densities of a picture on its page, rows from the top, 0 to 1.
struct Grey {
    columns: usize,
    rows: usize,
    density: Vec<f32>,
    /// Width and height of a pixel, mm.
    pixel: [f64; 2],
    height: f64,
}

impl Grey {
    fn new(image: &Image, tone: &Tone, size: [f64; 2]) -> Self {
        let of = |&sample: &u16| {
            let light = (f64::from(sample) / f64::from(u16::MAX)).powf(tone.gamma);
            (if tone.invert { light } else { 1.0 - light }) as f32
        };
        Self {
            columns: image.columns,
            rows: image.rows,
            density: image.samples.iter().map(of).collect(),
            pixel: [size[0] / image.columns as f64, size[1] / image.rows as f64],
            height: size[1],
        }
    }

    /// Blocks of pixels, counted from the upper left corner, as one of their mean.
    fn joined(&self, n: usize) -> Self {
        let (columns, rows) = (self.columns.div_ceil(n), self.rows.div_ceil(n));
        let mut sums = vec![(0.0f64, 0u32); columns * rows];
        for (k, &d) in self.density.iter().enumerate() {
            let sum = &mut sums[k / self.columns / n * columns + k % self.columns / n];
            *sum = (sum.0 + f64::from(d), sum.1 + 1);
        }
        let density = sums.into_iter().map(|(sum, count)| (sum / f64::from(count)) as f32).collect();
        Self { columns, rows, density, pixel: self.pixel.map(|v| v * n as f64), height: self.height }
    }

    /// The pixels that are seen in a box on the page, y up, or within half a pixel of it: columns and rows.
    fn around(&self, lo: Point, hi: Point) -> [std::ops::Range<usize>; 2] {
        let range = |lo: f64, hi: f64, side: f64, count: usize| {
            let first = (lo / side - 1.0).floor().clamp(0.0, count as f64 - 1.0) as usize;
            let last = (hi / side).ceil().clamp(0.0, count as f64 - 1.0) as usize;
            first..last + 1
        };
        [
            range(lo[0], hi[0], self.pixel[0], self.columns),
            range(self.height - hi[1], self.height - lo[1], self.pixel[1], self.rows),
        ]
    }

    /// The least and the largest density in a box on the page and within half a pixel of it.
    fn range(&self, lo: Point, hi: Point) -> [f64; 2] {
        let [columns, rows] = self.around(lo, hi);
        let mut found = [f32::MAX, f32::MIN];
        for j in rows {
            for &d in &self.density[j * self.columns..][columns.clone()] {
                found = [found[0].min(d), found[1].max(d)];
            }
        }
        found.map(f64::from)
    }

    /// Whether it has at most two densities: then its areas have the sides of its pixels.
    fn is_two_tone(&self) -> bool {
        let mut found = Vec::new();
        for &d in &self.density {
            if !found.contains(&d) {
                found.push(d);
                if found.len() > 2 {
                    return false;
                }
            }
        }
        true
    }
}

/// The strokes of a texture.
struct Marks<'a> {
    drawing: &'a Drawing<'a>,
    strokes: std::ops::Range<usize>,
}

impl Marks<'_> {
    /// At most so many, evenly.
    fn some(&self, most: usize) -> impl Iterator<Item = usize> {
        self.strokes.clone().step_by(self.strokes.len().div_ceil(most).max(1))
    }
}

/// How one bitmap is to be marked.
struct Look<'a> {
    page: &'a Page,
    marking: &'a Marking,
    spot_mm: f64,
    slack_mm: f64,
    /// Beyond it nothing is marked; part frame, mm.
    limit: Option<BoxMm<2>>,
    name: String,
}

impl Look<'_> {
    /// Areas that are darker than a threshold.
    fn areas(
        &self,
        grey: &Grey,
        threshold: f64,
        marks: &Marks<'_>,
        is_cut: bool,
        rule: &mut Rule,
    ) -> Result<(), &'static str> {
        let by_pixels = grey.is_two_tone();
        // The border lies between the centres of neighbours, or is the side of a pixel.
        let near = |p: Point| {
            let slack = self.slack_mm;
            let around = || grey.around([p[0] - slack, p[1] - slack], [p[0] + slack, p[1] + slack]);
            let [columns, mut rows] = if by_pixels { self.pixels_at(grey, p) } else { around() };
            rows.any(|j| grey.density[j * grey.columns..][columns.clone()].iter().any(|&d| self.is_dark(d, threshold)))
        };
        let mut points = Vec::new();
        for i in marks.some(MAX_MARKS) {
            (marks.drawing.stroke)(i, &mut points);
            for p in places(&points) {
                rule.checked += 1;
                if !self.page.holds(p, self.slack_mm) {
                    rule.broken("", (marks.drawing.element)(i), BEYOND);
                } else if !around_point(p, self.slack_mm * NM_PER_MM).any(|q| near(self.page.at(q))) {
                    let [x, y] = self.page.at(p);
                    let text = format!("it is marked where the bitmap is light, at {x:.4}, {y:.4} mm of the page");
                    rule.broken("", (marks.drawing.element)(i), text);
                }
            }
        }
        if is_cut {
            return Err("whether all dark areas are filled is not compared where inside or outside cut them");
        }
        if self.marking.along_contours.is_some() {
            return Err("whether all dark areas are filled is not compared for lines along contours");
        }
        self.filled(grey, threshold, marks, rule);
        Ok(())
    }

    fn is_dark(&self, density: f32, threshold: f64) -> bool {
        f64::from(density) > threshold - ROUNDING
    }

    /// The pixels that a point lies on, to the tolerance.
    fn pixels_at(&self, grey: &Grey, p: Point) -> [std::ops::Range<usize>; 2] {
        let range = |v: f64, side: f64, count: usize| {
            let at = |v: f64| (v / side).floor().clamp(0.0, count as f64 - 1.0) as usize;
            at(v - self.slack_mm)..at(v + self.slack_mm) + 1
        };
        [range(p[0], grey.pixel[0], grey.columns), range(grey.height - p[1], grey.pixel[1], grey.rows)]
    }

    /// Dark places must have a mark beside them.
    fn filled(&self, grey: &Grey, threshold: f64, marks: &Marks<'_>, rule: &mut Rule) {
        let pitch = self.marking.pitch_mm.unwrap_or(self.spot_mm / 2.0);
        let is_outline = self.marking.fill == FillMode::Outline;
        let inset = self.marking.inset_mm.unwrap_or(self.spot_mm / 2.0);
        let widest = grey.pixel[0].max(grey.pixel[1]);
        // How deep in the dark a place must lie for a line to pass within this distance of it.
        let (depth, reach) = if is_outline { (0.0, widest) } else { (inset + 1.5 * pitch + self.slack_mm, pitch) };
        let trace = Trace::new(self, marks, reach + self.slack_mm);
        let wide = [0, 1].map(|k| (depth / grey.pixel[k]).ceil() as usize + 1);
        let looks = if is_outline { 2 } else { (2 * wide[0] + 1) * (2 * wide[1] + 1) };
        let is_dark = |i: usize, j: usize| f64::from(grey.density[j * grey.columns + i]) > threshold + ROUNDING;
        let is_light = |i: usize, j: usize| !self.is_dark(grey.density[j * grey.columns + i], threshold);
        let most = MAX_PLACES.min(MAX_LOOKS / looks.max(1)).max(1);
        // On borders few pixels count, so all are looked at.
        let stride = if is_outline { 1 } else { (grey.density.len().div_ceil(most)).max(1) };
        let mut found = 0;
        for k in (0..grey.density.len()).step_by(stride) {
            let (i, j) = (k % grey.columns, k / grey.columns);
            let is_place = if is_outline {
                is_dark(i, j)
                    && (i + 1 == grey.columns || is_light(i + 1, j) || j + 1 == grey.rows || is_light(i, j + 1))
            } else {
                i >= wide[0]
                    && j >= wide[1]
                    && i + wide[0] < grey.columns
                    && j + wide[1] < grey.rows
                    && (j - wide[1]..=j + wide[1]).all(|j| (i - wide[0]..=i + wide[0]).all(|i| is_dark(i, j)))
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
                if !trace.has_near(p) {
                    let [x, y] = on_file;
                    let text =
                        format!("the bitmap is dark at {x:.4}, {y:.4} mm of the page, and nothing is marked there");
                    rule.broken("", self.name.clone(), text);
                }
            }
        }
    }

    /// Whether all of the part within this distance of a place on the page's plane may be marked.
    fn is_within(&self, p: Point, by: f64) -> bool {
        let Some(limit) = self.limit else { return true };
        let at = self.page.on_part(p);
        (0..2).all(|k| limit.lo[k] + by <= at[k] && at[k] + by <= limit.hi[k])
    }

    /// Grey by lines or dots.
    fn screen(
        &self,
        grey: &Grey,
        tone: &Tone,
        marks: &Marks<'_>,
        is_cut: bool,
        rule: &mut Rule,
    ) -> Result<(), &'static str> {
        let pitch = self.marking.pitch_mm.unwrap_or(self.spot_mm);
        let fits = pitch / grey.pixel[0].max(grey.pixel[1]);
        let blocks = fits.min(grey.columns.max(grey.rows) as f64) as usize;
        let joined = (fits >= 2.0).then(|| grey.joined(blocks));
        let grey = joined.as_ref().unwrap_or(grey);
        let period = tone.period_mm.unwrap_or(PERIOD * pitch) / pitch;
        let is_dashed = tone.screen == Screen::Dashes;
        let reach = if is_dashed { period * pitch } else { 0.0 } + self.slack_mm;
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
        if is_cut {
            return Err("tones are not compared where inside or outside cut them");
        }
        let cell = match tone.screen {
            Screen::Lines | Screen::Noise | Screen::Diffusion => 16,
            Screen::Dashes => (2.0 * period).ceil().max(4.0) as usize,
            _ => period.round().clamp(1.0, MAX_SIDE) as usize,
        };
        let gain = if matches!(tone.screen, Screen::Lines | Screen::Dashes) {
            pitch / self.spot_mm
        } else {
            (pitch / self.spot_mm).powi(2)
        };
        let screen = Windows { look: self, pitch, direction: self.marking.direction_rad - self.page.turn_rad };
        let amounts = screen.amounts(marks, cell);
        let mut compared = 0;
        for times in [1, 4] {
            let n = cell * times;
            let side = n as f64;
            let off = match tone.screen {
                Screen::Lines => side * (1.0 + side.log2() / 2.0),
                Screen::Dashes => side * period / 4.0,
                Screen::Diffusion => 1.25 * side,
                Screen::Noise if n < NOISE_SIDE => 2.0 * side,
                Screen::Noise => (n / NOISE_SIDE).pow(2) as f64 / 2.0,
                _ => (times * times) as f64 / 2.0,
            } + 1.0;
            screen.each(n, if is_dashed { reach } else { 0.0 }, |tile, window, [lo, hi]| {
                let marked = amounts.of(tile, window, times as i64);
                let full = side * side;
                let [least, most] = grey.range(lo, hi);
                let share = |d: f64| (d * gain).clamp(0.0, 1.0);
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

/// Places of a stroke, not at its ends: on at most [`SIDES`] of its sides three each; of a dot its point.
fn places(points: &[P2]) -> impl Iterator<Item = Point> + '_ {
    let sides = points.len().saturating_sub(1);
    let dot = points.first().filter(|_| sides == 0).map(|p| [p.x as f64, p.y as f64]);
    let on_sides = points.windows(2).step_by(sides.div_ceil(SIDES).max(1)).flat_map(|w| {
        let [a, b] = [w[0], w[1]].map(|p| [p.x as f64, p.y as f64]);
        [0.1, 0.5, 0.9].map(|t| [0, 1].map(|k| a[k] + t * (b[k] - a[k])))
    });
    dot.into_iter().chain(on_sides)
}

/// A point and eight about it.
fn around_point(p: Point, by: f64) -> impl Iterator<Item = Point> {
    let steps = [0.0, -by, by];
    steps.into_iter().flat_map(move |x| steps.map(|y| [p[0] + x, p[1] + y]))
}

/// Where marks are, to a cell of a grid over the page or its tiles.
struct Trace {
    lo: Point,
    cell: f64,
    count: [usize; 2],
    is_set: Vec<bool>,
}

impl Trace {
    fn new(look: &Look<'_>, marks: &Marks<'_>, reach: f64) -> Self {
        let BoxMm { lo, hi } = look.page.extent(look.limit);
        let area = (hi[0] - lo[0]) * (hi[1] - lo[1]);
        let cell = reach.max((area / MAX_CELLS).sqrt());
        // Marks on an edge may lie beside it.
        let lo = lo.map(|v| v - cell);
        let count = [0, 1].map(|k| ((hi[k] - lo[k]) / cell) as usize + 2);
        let mut trace = Self { lo, cell, count, is_set: vec![false; count[0] * count[1]] };
        let mut points = Vec::new();
        for i in marks.strokes.clone() {
            (marks.drawing.stroke)(i, &mut points);
            let at = |p: &P2| look.page.on_plane([p.x as f64, p.y as f64]);
            points.first().map(at).into_iter().for_each(|p| trace.set(p));
            for w in points.windows(2) {
                let (a, b) = (at(&w[0]), at(&w[1]));
                let steps = ((b[0] - a[0]).hypot(b[1] - a[1]) / cell * 2.0).ceil().max(1.0);
                for k in 1..=steps as usize {
                    let t = k as f64 / steps;
                    trace.set([0, 1].map(|m| a[m] + t * (b[m] - a[m])));
                }
            }
        }
        trace
    }

    fn cell_of(&self, p: Point) -> [i64; 2] {
        [0, 1].map(|k| ((p[k] - self.lo[k]) / self.cell).floor() as i64)
    }

    fn index(&self, [i, j]: [i64; 2]) -> Option<usize> {
        let is_in = |v: i64, count: usize| (0..count as i64).contains(&v);
        (is_in(i, self.count[0]) && is_in(j, self.count[1])).then(|| j as usize * self.count[0] + i as usize)
    }

    fn set(&mut self, p: Point) {
        if let Some(k) = self.index(self.cell_of(p)) {
            self.is_set[k] = true;
        }
    }

    fn has_near(&self, p: Point) -> bool {
        let [i, j] = self.cell_of(p);
        (-1..=1).any(|x| (-1..=1).any(|y| self.index([i + x, j + y]).is_some_and(|k| self.is_set[k])))
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

#[cfg(test)]
mod tests {
    use super::super::page::Site;
    use super::*;
    use crate::job::{Job, Overrides};
    use crate::texture::Texture;
    use crate::verify::tests::made::bmp;

    const COLUMNS: usize = 240;
    const ROWS: usize = 150;

    /// A picture that looks like none of its mirror images: a ramp from the left, a white field, a black one.
    fn picture(i: usize, j: usize) -> u8 {
        match (i, j) {
            (20..90, 15..60) => 255,
            (150..220, 90..140) => 0,
            _ => 20 + (i * 215 / COLUMNS) as u8,
        }
    }

    fn areas(i: usize, j: usize) -> u8 {
        if ((i as i64 - 80).pow(2) + (j as i64 - 60).pow(2) < 2000) || (150..220).contains(&i) && (90..140).contains(&j)
        {
            0
        } else {
            255
        }
    }

    /// What the rule finds of a bitmap whose file, keys and strokes are changed after it was placed.
    fn found(
        keys: [&str; 2],
        pictures: [&dyn Fn(usize, usize) -> u8; 2],
        change: impl Fn(&Texture, usize, &mut Vec<P2>),
    ) -> Rule {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("b.bmp");
        let job = |keys: &str| {
            let text = format!(
                "surface = {{ file = \"x.stl\", unit = \"mm\" }}\nfocus = {{ pdof = \"0.1 mm\" }}\n\
                 machine = {{ profile = \"xyz-galvo-40\" }}\n[[texture]]\nfile = \"b.bmp\"\n{keys}\n\
                 [[pen]]\nname = \"a\"\nspeed = \"100 mm/s\"\npower = \"5 %\"\nfrequency = \"60 kHz\"\ndwell = \"1 ms\"\n"
            );
            Job::parse(&folder.path().join("job.toml"), &text, &Overrides::default()).expect("a job")
        };
        let part_box = BoxMm::rectangle(0.0, 0.0, 26.0, 17.0);
        std::fs::write(&file, bmp([COLUMNS, ROWS], pictures[0])).expect("written");
        let before = job(keys[0]);
        let texture = Texture::load(&before.textures, part_box, 0.3, 0.03, &mut Vec::new()).expect("a texture");
        std::fs::write(&file, bmp([COLUMNS, ROWS], pictures[1])).expect("written");
        let drawing = Drawing {
            stroke: Box::new(|i, out| {
                let pen = texture.stroke(i, out);
                change(&texture, i, out);
                pen
            }),
            ..Drawing::of(&texture)
        };
        let job = job(keys[1]);
        let site = Site { part_box, turn_rad: 0.3 };
        let placed = Placed { job: &job, texture: &texture, drawing: &drawing, site };
        let mut rule = Rule::new("bitmap", "");
        check(&placed, &job.textures, 0.03, &mut Bitmaps::default(), &mut rule);
        rule
    }

    const SCREENS: [&str; 7] = [
        "screen = \"lines\"",
        "screen = \"lines\"\npitch = \"0.06 mm\"\ndirection = \"20 deg\"",
        "screen = \"dashes\"\ndirection = \"45 deg\"",
        "screen = \"halftone\"\ndirection = \"15 deg\"",
        "screen = \"halftone\"\nperiod = \"0.12 mm\"",
        "screen = \"diffusion\"",
        "screen = \"noise\"\nseed = 9",
    ];

    const AREAS: [&str; 5] = [
        "pitch = \"0.05 mm\"\ndirection = \"30 deg\"",
        "pitch = \"0.05 mm\"\ncross = true\ninset = \"0.1 mm\"\nthreshold = \"30 %\"",
        "fill = \"rings\"\npitch = \"0.05 mm\"",
        "fill = \"outline\"",
        "pitch = \"0.3 mm\"\ncontour = \"after\"",
    ];

    const PLACES: [&str; 6] = [
        "dpi = 254",
        "size = [\"24 mm\", \"15 mm\"]\nturn = \"10 deg\"\nmirror = \"x\"",
        "fit = \"contain\"\nmirror = \"y\"\nturn = \"90 deg\"",
        "dpi = 508\ntile = true\narea = \"part\"\nturn = \"-5 deg\"",
        "dpi = 254\norigin = [\"-4 mm\", \"3 mm\"]\narea = \"part\"",
        "dpi = 400\ngamma = 1.8\nalign = \"right top\"\ninvert = true",
    ];

    #[test]
    fn sound_bitmaps_hold() {
        for place in PLACES {
            for keys in SCREENS {
                let keys = format!("{place}\n{keys}");
                let rule = found([&keys; 2], [&picture; 2], |_, _, _| {});
                assert!(rule.violated == 0 && rule.left_out.is_empty(), "{keys}: {rule:?}");
                assert!(rule.checked > 1000, "{keys}: {}", rule.checked);
            }
            for keys in AREAS {
                for of in [areas, picture] {
                    let keys = format!("{place}\n{keys}");
                    let rule = found([&keys; 2], [&of; 2], |_, _, _| {});
                    assert!(rule.violated == 0 && rule.left_out.is_empty(), "{keys}: {rule:?}");
                    assert!(rule.checked > 100, "{keys}: {}", rule.checked);
                }
            }
        }
    }

    #[test]
    fn a_bitmap_that_looks_otherwise_is_found() {
        type Grey = fn(usize, usize) -> u8;
        let others: [Grey; 6] = [
            |i, j| picture(COLUMNS - 1 - i, j),
            |i, j| picture(i, ROWS - 1 - j),
            |i, j| picture(COLUMNS - 1 - i, ROWS - 1 - j),
            |i, j| 255 - picture(i, j),
            |i, j| (255.0 * (f64::from(picture(i, j)) / 255.0).powf(1.5)) as u8,
            |i, j| picture((i + 12) % COLUMNS, j),
        ];
        for keys in SCREENS {
            for (k, other) in others.iter().enumerate() {
                let keys = format!("{}\n{keys}", PLACES[1]);
                let rule = found([&keys; 2], [&picture, other], |_, _, _| {});
                assert!(rule.violated > 0, "{keys} {k}");
            }
        }
        let others: [Grey; 4] = [
            |i, j| areas(COLUMNS - 1 - i, j),
            |i, j| areas(i, ROWS - 1 - j),
            |i, j| 255 - areas(i, j),
            |i, j| areas((i + 3) % COLUMNS, j),
        ];
        for keys in AREAS {
            for (k, other) in others.iter().enumerate() {
                let keys = format!("{}\n{keys}", PLACES[1]);
                assert!(found([&keys; 2], [&areas, other], |_, _, _| {}).violated > 0, "{keys} {k}");
            }
        }
    }

    #[test]
    fn other_keys_are_found() {
        for (keys, other) in [
            ("dpi = 254", "dpi = 260"),
            ("dpi = 254\nmirror = \"x\"", "dpi = 254"),
            ("dpi = 254\nturn = \"3 deg\"", "dpi = 254"),
            ("dpi = 254\ninvert = true", "dpi = 254"),
            ("dpi = 254\ngamma = 1.4", "dpi = 254"),
        ] {
            for screen in SCREENS {
                let keys = [keys, other].map(|k| format!("{k}\n{screen}"));
                let rule = found([&keys[0], &keys[1]], [&picture; 2], |_, _, _| {});
                assert!(rule.violated > 0, "{keys:?}");
            }
        }
        let keys = ["30 %", "60 %"].map(|t| format!("dpi = 254\npitch = \"0.05 mm\"\nthreshold = \"{t}\""));
        for [a, b] in [[0, 1], [1, 0]] {
            assert!(found([&keys[a], &keys[b]], [&picture; 2], |_, _, _| {}).violated > 0, "{a}");
        }
    }

    #[test]
    fn marks_that_are_missing_doubled_or_beside_are_found() {
        // Every second one lies on the first.
        let piled = |texture: &Texture, i: usize, out: &mut Vec<P2>| {
            if i % 2 == 1 {
                let mut first = Vec::new();
                texture.stroke(0, &mut first);
                out.fill(first[0]);
            }
        };
        // What lies in one quarter of the texture is marked elsewhere in it.
        let gathered = |texture: &Texture, i: usize, out: &mut Vec<P2>| {
            if i < texture.len() / 4 {
                texture.stroke(i + texture.len() / 2, out);
            }
        };
        for keys in SCREENS {
            let keys = format!("{}\n{keys}", PLACES[0]);
            assert!(found([&keys; 2], [&picture; 2], gathered).violated > 0, "{keys}");
            assert!(found([&keys; 2], [&picture; 2], piled).violated > 0, "{keys}");
        }
        for keys in [AREAS[0], AREAS[2]] {
            let keys = format!("{}\n{keys}", PLACES[0]);
            assert!(found([&keys; 2], [&areas; 2], gathered).violated > 0, "{keys}");
        }
        let moved = |texture: &Texture, i: usize, out: &mut Vec<P2>| {
            if i == texture.len() / 2 {
                out.iter_mut().for_each(|p| p.x += (100.0 * NM_PER_MM) as i64);
            }
        };
        for keys in AREAS {
            let keys = format!("{}\n{keys}", PLACES[0]);
            let rule = found([&keys; 2], [&areas; 2], moved);
            assert!(rule.violations.iter().any(|v| v.message.contains("beyond the page")), "{keys}: {rule:?}");
        }
    }
}
