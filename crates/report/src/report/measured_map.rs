//! `measured.svg`: a measured part before and after its correction, and the section of the report that shows it.
//!
//! Consumes a [`MeasuredPart`]; promises two maps over the texture and the points. The first has the correction of the
//! height, and on it each point with what the rigid fit leaves of it, in the same colours: where a point differs from
//! what surrounds it, the others contradict it. The second has the depth that marks keep free, and each point with what
//! the correction leaves of it. Without a correction the first shows points alone. Units: um; places in mm.

use std::fmt::Write;

use super::colour::{Colour, hex, of_height};
use super::page::escape;
use super::{image, plain};
use crate::measured::{self, Area};
use terrace_core::geom::Box2;
use terrace_plan::measured::{MeasuredPart, PointResidual};

/// Width of a map, and what lies beside and above it.
pub(super) const WIDTH: f64 = 560.0;
pub(super) const SIDE: f64 = 12.0;
pub(super) const HEAD: f64 = 62.0;
pub(super) const KEY: f64 = 92.0;

/// Steps of a scale of colours.
const STEPS: usize = 21;

/// Below zero, at zero and above it.
const BELOW: Colour = [26, 82, 164];
const ZERO: Colour = [250, 250, 247];
const ABOVE: Colour = [176, 32, 40];

/// A scale of colours over a range of um.
pub(super) struct Scale {
    range: [f64; 2],
    colours: Vec<Colour>,
}

impl Scale {
    /// Of both signs, as far as the largest of some values.
    fn signed(most: f64) -> Self {
        let most = if most > 0.0 { most } else { 1.0 };
        let colour = |k: usize| {
            let share = 2.0 * k as f64 / (STEPS - 1) as f64 - 1.0;
            let end = if share < 0.0 { BELOW } else { ABOVE };
            [0, 1, 2]
                .map(|c| (f64::from(ZERO[c]) + (f64::from(end[c]) - f64::from(ZERO[c])) * share.abs()).round() as u8)
        };
        Self { range: [-most, most], colours: (0..STEPS).map(colour).collect() }
    }

    /// Light for little, dark for much.
    pub(super) fn amount(range: [f64; 2]) -> Self {
        let last = STEPS as i64 - 1;
        Self { range, colours: (0..=last).map(|k| of_height(last - k, [0, last])).collect() }
    }

    fn step(&self, value: f64) -> usize {
        let [lo, hi] = self.range;
        let share = if hi > lo { (value - lo) / (hi - lo) } else { 0.5 };
        (share.clamp(0.0, 1.0) * (STEPS - 1) as f64).round() as usize
    }

    fn colour(&self, value: f64) -> String {
        hex(self.colours[self.step(value)])
    }
}

/// A point on a map.
struct Dot<'a> {
    point: &'a PointResidual,
    at: [f64; 2],
}

impl Area {
    /// Its height in the picture.
    pub(super) fn height(&self) -> f64 {
        let [wide, high] = self.size();
        (WIDTH * high / wide).clamp(WIDTH / 6.0, 2.5 * WIDTH).ceil()
    }

    /// A place in the picture.
    pub(super) fn on_map(&self, at: [f64; 2]) -> [f64; 2] {
        let [u, v] = [0, 1].map(|k| (at[k] - self.lo()[k]) / self.size()[k]);
        [u * WIDTH, HEAD + (1.0 - v) * self.height()]
    }
}

/// The text of the file; `texture` is the box of the texture, `sigmas` what the job keeps free.
pub fn measured_svg(job: &str, part: &MeasuredPart, texture: Box2, sigmas: f64) -> String {
    let dots: Vec<Dot<'_>> =
        part.lying.points.iter().map(|point| Dot { point, at: measured::beside(part, point) }).collect();
    let area = Area::of(part, texture);
    let heights: Vec<Option<f64>> = area.places().map(|at| measured::correction(part, at)).collect();
    let keeps: Vec<Option<f64>> = area.places().map(|at| measured::kept(part, at)).collect();
    let signed = Scale::signed(measured::most_signed(part, &heights));
    let amount = Scale::amount(measured::range(&keeps));
    let total = HEAD + area.height() + KEY;
    let page = 2.0 * WIDTH + 3.0 * SIDE;
    let name = escape(job);
    let mut out = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<svg xmlns=\"http://www.w3.org/2000/svg\" \
         viewBox=\"0 0 {page} {total}\" font-family=\"sans-serif\" font-size=\"14\">\n\
         <title>{name}: the part as measured</title>\n<rect width=\"{page}\" height=\"{total}\" fill=\"#ffffff\"/>\n\
         <text x=\"{SIDE}\" y=\"24\" font-size=\"18\">{name}: the part as measured, {} points</text>\n",
        dots.len(),
    );
    let ground = Ground { area: &area, values: &heights, scale: &signed };
    let before = Map { ground, scale: &signed, dots: &dots, of_dot: &measured::left_by_fit };
    let head = if part.correction.is_some() { "Correction of the height, um" } else { "Not corrected: rigid" };
    before.draw(&mut out, SIDE, head, "points: what the rigid fit leaves of them");
    let left = |point: &PointResidual| measured::left(part, point);
    let ground = Ground { area: &area, values: &keeps, scale: &amount };
    let after = Map { ground, scale: &signed, dots: &dots, of_dot: &left };
    let is_short = keeps.iter().flatten().any(|v: &f64| v.is_infinite());
    let red = if is_short { "; red: less than that" } else { "" };
    let head = format!("Kept free above and below marks, um ({sigmas} sigma{red})");
    let words = match part.correction {
        Some(_) => "points: what the correction leaves of them, in the colours of the left",
        None => "points: what the rigid fit leaves of them, in the colours of the left",
    };
    after.draw(&mut out, 2.0 * SIDE + WIDTH, &head, words);
    out.push_str("</svg>\n");
    out
}

/// The ground of a map: a value for each cell of an area.
pub(super) struct Ground<'a> {
    /// The area.
    pub(super) area: &'a Area,
    /// By cell, from the upper left, row by row; None where there is none. What is not finite is red.
    pub(super) values: &'a [Option<f64>],
    /// Its colours.
    pub(super) scale: &'a Scale,
}

impl Ground<'_> {
    /// Draws it with its left side at `x`, and opens a group that [`Ground::close`] ends.
    pub(super) fn open(&self, out: &mut String, x: f64, head: &str) {
        let height = self.area.height();
        let palette: Vec<[u8; 4]> = std::iter::once([255, 255, 255, 0])
            .chain(self.scale.colours.iter().map(|[r, g, b]| [*r, *g, *b, 255]))
            .chain([[ABOVE[0], ABOVE[1], ABOVE[2], 255]])
            .collect();
        let pixel = |v: f64| if v.is_finite() { 1 + self.scale.step(v) as u8 } else { 1 + STEPS as u8 };
        let pixels: Vec<u8> = self.values.iter().map(|v| v.map_or(0, pixel)).collect();
        let address = image::of_indices(self.area.cells(), &palette, &pixels);
        // Writing to a String cannot fail.
        let _ = writeln!(
            out,
            "<g transform=\"translate({x})\">\n<text y=\"{}\">{head}</text>\n\
             <image y=\"{HEAD}\" width=\"{WIDTH}\" height=\"{height}\" preserveAspectRatio=\"none\" href=\"{address}\"/>\n\
             <rect y=\"{HEAD}\" width=\"{WIDTH}\" height=\"{height}\" fill=\"none\" stroke=\"#444\"/>",
            HEAD - 10.0,
        );
    }

    /// Draws the scale of its colours and words below it, and ends the group.
    pub(super) fn close(&self, out: &mut String, words: &str) {
        let below = HEAD + self.area.height();
        let step = WIDTH / STEPS as f64;
        for (k, colour) in self.scale.colours.iter().enumerate() {
            let _ = writeln!(
                out,
                "<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"16\" fill=\"{}\"/>",
                plain(k as f64 * step, 2),
                below + 10.0,
                plain(step + 0.2, 2),
                hex(*colour)
            );
        }
        let [lo, hi] = self.scale.range.map(|v| plain(v, 1));
        let middle = plain(f64::midpoint(self.scale.range[0], self.scale.range[1]), 1);
        let _ = writeln!(
            out,
            "<text y=\"{0}\">{lo}</text><text x=\"{1}\" y=\"{0}\" text-anchor=\"middle\">{middle}</text>\
             <text x=\"{WIDTH}\" y=\"{0}\" text-anchor=\"end\">{hi} um</text>\n<text y=\"{2}\">{words}</text>\n</g>",
            below + 42.0,
            WIDTH / 2.0,
            below + 64.0,
        );
    }
}

/// One of the maps.
struct Map<'a> {
    ground: Ground<'a>,
    /// Of the points.
    scale: &'a Scale,
    dots: &'a [Dot<'a>],
    of_dot: &'a dyn Fn(&PointResidual) -> Option<f64>,
}

impl Map<'_> {
    /// Draws it with its left side at `x`.
    fn draw(&self, out: &mut String, x: f64, head: &str, words: &str) {
        self.ground.open(out, x, head);
        let radius = if self.dots.len() > 400 { 2.0 } else { 5.0 };
        for dot in self.dots {
            let [u, v] = self.ground.area.on_map(dot.at).map(|v| plain(v, 1));
            let name = escape(&dot.point.name);
            match (self.of_dot)(dot.point) {
                Some(value) => {
                    let _ = writeln!(
                        out,
                        "<circle cx=\"{u}\" cy=\"{v}\" r=\"{radius}\" fill=\"{}\" stroke=\"#222\" stroke-width=\".8\">\
                         <title>{name}: {} um</title></circle>",
                        self.scale.colour(value),
                        plain(value, 1)
                    );
                }
                None => {
                    let _ = writeln!(
                        out,
                        "<path d=\"M{u} {v}m-5 -5l10 10m0 -10l-10 10\" fill=\"none\" stroke=\"#222\" stroke-width=\"1.5\">\
                         <title>{name}: does not count</title></path>"
                    );
                }
            }
        }
        self.ground.close(out, words);
    }
}

/// Writes the section of the report.
pub(super) fn section(h: &mut String, part: &MeasuredPart) {
    let lying = &part.lying;
    let off = lying.points.iter().filter(|point| !point.counts()).count();
    let _ = writeln!(
        h,
        "<h2>Measured part</h2>\n<p id=\"measured\">{} points, {off} of them not on the part; the farthest lies {} um from \
         where the rigid fit has it. The part leans by {} deg.",
        lying.points.len(),
        plain(lying.worst_residual_mm() * 1e3, 1),
        plain(lying.fit.motion.lean().to_degrees(), 4),
    );
    if let Some(correction) = &part.correction {
        let [[lowest, highest], [least, most]] = correction.ranges().map(|range| range.map(|nm| plain(nm / 1e3, 1)));
        let _ = writeln!(
            h,
            " Its height is corrected by {lowest} to {highest} um, known to {least} um (one sigma) at best and {most} um at worst."
        );
    }
    h.push_str(
        "</p>\n<p class=\"picture\"><a href=\"measured.svg\"><img src=\"measured.svg\" alt=\"The correction of the height, \
         the depth that is kept free, and the measured points\"/></a></p>\n",
    );
}
