//! `energy.svg`: the energy on the part by area, from the marks of the program.
//!
//! Consumes a [`Layout`]; promises the energy in every cell over the texture, J/cm² of surface: power times time of all
//! passes, by the model of the galvo, so that ends and corners of marks, overlaps at seams and lines that lie close show
//! as they add up. On a slope the energy spreads over 1 / cos of the block's mean incidence. A mark of a tilted block is
//! drawn where it lies in the turned part. Units: mm, J.

use std::fmt::Write;

use super::colour::{hex, of_height};
use super::page::escape;
use super::{Layout, OnTheFlyLayout, image, plain};
use terrace_core::geom::{NM_PER_MM, Turn};
use terrace_core::motion::deposits;
use terrace_core::parallel;
use terrace_plan::on_the_fly::program::Marked;

/// Cells along the longer side of the texture; no smaller than the spot.
const CELLS: f64 = 400.0;
/// Colours, half a power of two each, from a quarter of the median up.
const COLOURS: i64 = 13;

/// Lists of blocks that are summed beside each other: a fixed number, so that sums are the same on any computer.
const LISTS: usize = 16;

/// Energy by area over the texture, that of all passes together.
pub struct EnergyMap {
    /// What the area is of.
    area: &'static str,
    /// Lower left corner, part frame.
    lo: [f64; 2],
    cell: f64,
    size: [usize; 2],
    /// J/cm², row by row from the lower left.
    energy: Vec<f64>,
    /// Of the cells with marks.
    median: f64,
}

impl EnergyMap {
    /// Of the marks of a job.
    pub fn of(job: &Layout<'_>) -> Self {
        let (lo, size) = (job.texture.lo.mm(), job.texture_size().map(|v| v.mm()));
        let cell = (size[0].max(size[1]) / CELLS).max(job.machine.lens.spot.as_mm());
        let count = size.map(|v| ((v / cell).ceil() as usize).max(1));
        let program = job.checked.program();
        let add = |energy: &mut [f64], i: usize| {
            let block = &program.blocks[i];
            let centre = Turn::drawn(block.stop.centre).mm();
            // J/mm² to J/cm².
            let share = 100.0 * job.figures[i].slope.cos()[0] / (cell * cell);
            let mut put = |at: [f64; 2], joule: f64| {
                let [x, y] = [0, 1].map(|k| {
                    let v = (centre[k] + at[k] - lo[k]) / cell;
                    (v.max(0.0) as usize).min(count[k] - 1)
                });
                energy[y * count[0] + x] += share * joule;
            };
            for stroke in program.strokes_of(block) {
                let (pen, points) = (&program.pens[stroke.pen.index()], program.points_of(stroke));
                let (beam, passes) = (pen.beam(job.machine), f64::from(pen.passes));
                deposits(points, beam, cell / 4.0, |at, joule| put(at, passes * joule));
                if let ([dot], Some(dwell)) = (points, pen.dwell) {
                    let at = [dot.x, dot.y].map(|v| f64::from(v) / NM_PER_MM);
                    put(at, passes * beam.power * dwell.as_s());
                }
            }
        };
        let blocks = program.blocks.len();
        let mut energy = vec![0.0; count[0] * count[1]];
        let of_list = |k: usize, ()| {
            let mut energy = vec![0.0; count[0] * count[1]];
            (k * blocks / LISTS..(k + 1) * blocks / LISTS).for_each(|i| add(&mut energy, i));
            energy
        };
        parallel::in_order(vec![(); LISTS], of_list, |list: Vec<f64>| {
            energy.iter_mut().zip(list).for_each(|(sum, e)| *sum += e);
        });
        Self::new("of surface", lo, cell, count, energy)
    }

    /// Of the moves of an on-the-fly program, whose spot has the speed of each: by area as the lens sees it.
    pub(crate) fn of_moves(job: &OnTheFlyLayout<'_>) -> Self {
        let (lo, size) = (job.texture.lo.mm(), job.texture.size().map(|v| v.mm()));
        let cell = (size[0].max(size[1]) / CELLS).max(job.machine.lens.spot.as_mm());
        let count = size.map(|v| ((v / cell).ceil() as usize).max(1));
        let mut energy = vec![0.0; count[0] * count[1]];
        for moved in job.program.marked(job.machine) {
            let Marked { pen, s, way_mm, from, to } = moved;
            let pen = &job.program.pens[pen.index()];
            let full_s = if job.power_by_speed { way_mm / pen.speed.as_mm_s() } else { s };
            let joule = pen.power.as_w(job.machine.laser.max_power) * full_s;
            let way = (to[0] - from[0]).hypot(to[1] - from[1]);
            let steps = (4.0 * way / cell).ceil().max(1.0);
            for k in 0..steps as u32 {
                let share = (f64::from(k) + 0.5) / steps;
                let [x, y] = [0, 1].map(|k| {
                    let v = (from[k] + share * (to[k] - from[k]) - lo[k]) / cell;
                    (v.max(0.0) as usize).min(count[k] - 1)
                });
                // J/mm² to J/cm².
                energy[y * count[0] + x] += 100.0 * joule / (steps * cell * cell);
            }
        }
        Self::new("seen along z", lo, cell, count, energy)
    }

    fn new(area: &'static str, lo: [f64; 2], cell: f64, size: [usize; 2], energy: Vec<f64>) -> Self {
        let mut marked: Vec<f64> = energy.iter().copied().filter(|e| *e > 0.0).collect();
        marked.sort_by(f64::total_cmp);
        let median = marked.get(marked.len() / 2).copied().unwrap_or(0.0);
        Self { area, lo, cell, size, energy, median }
    }

    /// What the area is of, after a number of J/cm2.
    pub(super) fn area(&self) -> &'static str {
        self.area
    }

    /// Median of the cells with marks, J/cm²; the most of any cell as a multiple of it, and where that is; the side of a
    /// cell. None where nothing is marked.
    pub(super) fn worst(&self) -> Option<(f64, f64, [f64; 2], f64)> {
        let most = (0..self.energy.len()).max_by(|a, b| self.energy[*a].total_cmp(&self.energy[*b]))?;
        let place = [most % self.size[0], most / self.size[0]];
        let at = [0, 1].map(|k| self.lo[k] + (place[k] as f64 + 0.5) * self.cell);
        (self.median > 0.0).then(|| (self.median, self.energy[most] / self.median, at, self.cell))
    }

    /// The colour of an energy; 0 for none.
    fn colour(&self, energy: f64) -> u8 {
        if energy <= 0.0 {
            return 0;
        }
        let halves = (2.0 * (energy / self.median).log2()).round() as i64;
        1 + (halves + 4).clamp(0, COLOURS - 1) as u8
    }
}

/// The text of the file, of the job of a name.
pub fn energy_svg(job: &str, map: &EnergyMap) -> String {
    const WIDTH: f64 = 900.0;
    const KEY: f64 = 60.0;
    let colours: Vec<_> = (0..COLOURS).map(|k| of_height(k, [0, COLOURS - 1])).collect();
    let palette: Vec<[u8; 4]> =
        std::iter::once([255, 255, 255, 0]).chain(colours.iter().map(|[r, g, b]| [*r, *g, *b, 255])).collect();
    let [columns, rows] = map.size;
    let pixels: Vec<u8> =
        (0..rows).rev().flat_map(|y| map.energy[y * columns..][..columns].iter().map(|e| map.colour(*e))).collect();
    let height = (WIDTH * rows as f64 / columns as f64).ceil();
    let (address, [x, y]) = (image::of_indices(map.size, &palette, &pixels), map.lo);
    let mut out = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<svg xmlns=\"http://www.w3.org/2000/svg\" \
         viewBox=\"0 0 {WIDTH} {total}\" font-family=\"sans-serif\" font-size=\"14\">\n\
         <title>{}: energy by area</title>\n<rect width=\"{WIDTH}\" height=\"{total}\" fill=\"#ffffff\"/>\n\
         <image width=\"{WIDTH}\" height=\"{height}\" preserveAspectRatio=\"none\" \
         style=\"image-rendering:pixelated\" href=\"{address}\"/>\n",
        escape(job),
        total = height + KEY,
    );
    let step = WIDTH / COLOURS as f64;
    for (k, colour) in colours.iter().enumerate() {
        let _ = writeln!(
            out,
            "<rect x=\"{}\" y=\"{height}\" width=\"{}\" height=\"16\" fill=\"{}\"/>",
            plain(k as f64 * step, 2),
            plain(step, 2),
            hex(*colour)
        );
        if k % 2 == 0 {
            let times = plain(2f64.powi(k as i32 / 2 - 2), 2);
            let _ =
                writeln!(out, "<text x=\"{}\" y=\"{}\">{times}</text>", plain(k as f64 * step + 4.0, 2), height + 30.0);
        }
    }
    let _ = write!(
        out,
        "<text x=\"4\" y=\"{}\">Energy by area as a multiple of the median, {} J/cm2 {}; cells of {} mm, the \
         lower left at ({}, {}) mm</text>\n</svg>\n",
        height + 50.0,
        plain(map.median, 3),
        map.area,
        plain(map.cell, 3),
        plain(x, 3),
        plain(y, 3),
    );
    out
}
