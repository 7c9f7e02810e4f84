//! `energy.svg`: the energy on the part by area, from the marks of the program.
//!
//! Consumes a [`Layout`]; promises the energy in every cell over the texture, J/cm² of surface: power times time of all
//! passes, by the model of the galvo, so that ends and corners of marks, overlaps at seams and lines that lie close show
//! as they add up. On a slope the energy spreads over 1 / cos of the block's mean incidence. A mark of a tilted block is
//! drawn where it lies in the turned part. Units: mm, J.

use std::fmt::Write;
use terrace_core::math;

use super::colour::{hex, of_height};
use super::page::escape;
use super::{Layout, OnTheFlyLayout, image, plain};
use crate::raster::Cells;
use terrace_core::geom::{NM_PER_MM, Turn};
use terrace_core::motion::deposits;
use terrace_core::parallel;
use terrace_plan::on_the_fly::program::Marked;

/// Cells along the longer side of the texture at most, and at least.
const CELLS: [f64; 2] = [400.0, 25.0];
/// Colours, half a power of two each, from a quarter of the median up.
const COLOURS: i64 = 13;

/// Lists of blocks that are summed beside each other: a fixed number, so that sums are the same on any computer.
const LISTS: usize = 16;

/// The cells of a map over a box of that size, marked on `mark_mm`: about square, no smaller than the spot, and the mean
/// distance of marks wide as long as there are enough cells, so that a hatch of that distance gives the same to all of
/// them.
fn cells_over(lo: [f64; 2], size: [f64; 2], spot: f64, mark_mm: f64) -> Cells {
    let long = size[0].max(size[1]);
    let lines = if mark_mm > 0.0 { size[0] * size[1] / mark_mm } else { 0.0 };
    let about = (long / CELLS[0]).max(spot).max(lines.min(long / CELLS[1]));
    let count = size.map(|v| ((v / about).round() as usize).max(1));
    // A box that is narrower than a cell has whole ones.
    let side = [0, 1].map(|k| if size[k] < about { about } else { size[k] / count[k] as f64 });
    Cells { lo, side, count }
}

/// Energy by area over the texture, that of all passes together.
pub struct EnergyMap {
    /// What the area is of.
    area: &'static str,
    cells: Cells,
    /// Of every cell, J/cm².
    energy: Vec<f64>,
    /// Of the cells with marks.
    median: f64,
}

/// The cell with the most energy.
pub(super) struct EnergyPeak {
    /// Median of the cells with marks, J/cm².
    pub median: f64,
    /// Its energy as a multiple of the median.
    pub ratio: f64,
    /// Its centre, mm.
    pub centre: [f64; 2],
    /// Sides of a cell, mm.
    pub cell: [f64; 2],
}

impl EnergyPeak {
    /// As the map says it, with what separates it from what follows.
    fn shown(&self) -> String {
        let [x, y] = self.centre.map(|v| plain(v, 2));
        format!("most: {} times the median, at ({x}, {y}) mm; ", plain(self.ratio, 2))
    }
}

impl EnergyMap {
    /// Of the marks of a job.
    pub fn of(job: &Layout<'_>) -> Self {
        let size = job.texture_size().map(|v| v.mm());
        let mark_mm = job.summary.mark_mm / f64::from(job.summary.passes.max(1));
        let cells = cells_over(job.texture.lo.mm(), size, job.machine.lens.spot.as_mm(), mark_mm);
        let blocks = job.checked.program().blocks.len();
        let mut energy = vec![0.0; cells.len()];
        let energy_of_list = |k: usize, ()| {
            let mut energy = vec![0.0; cells.len()];
            (k * blocks / LISTS..(k + 1) * blocks / LISTS).for_each(|i| add_block(job, i, &cells, &mut energy));
            energy
        };
        parallel::in_order(vec![(); LISTS], energy_of_list, |list: Vec<f64>| {
            energy.iter_mut().zip(list).for_each(|(sum, e)| *sum += e);
        });
        Self::new("of surface", cells, energy)
    }

    /// Of the moves of an on-the-fly program, whose spot has the speed of each: by area as the lens sees it.
    pub(crate) fn of_moves(job: &OnTheFlyLayout<'_>) -> Self {
        let size = job.texture.size().map(|v| v.mm());
        let cells = cells_over(job.texture.lo.mm(), size, job.machine.lens.spot.as_mm(), job.summary.mark_mm);
        let mut energy = vec![0.0; cells.len()];
        for marked in job.program.marked(job.machine) {
            add_move(job, &marked, &cells, &mut energy);
        }
        Self::new("seen along z", cells, energy)
    }

    fn new(area: &'static str, cells: Cells, energy: Vec<f64>) -> Self {
        let mut marked: Vec<f64> = energy.iter().copied().filter(|e| *e > 0.0).collect();
        marked.sort_by(f64::total_cmp);
        let median = marked.get(marked.len() / 2).copied().unwrap_or(0.0);
        Self { area, cells, energy, median }
    }

    /// What the area is of, after a number of J/cm2.
    pub(super) fn area(&self) -> &'static str {
        self.area
    }

    /// The cell with the most energy; None where nothing is marked.
    pub(super) fn peak(&self) -> Option<EnergyPeak> {
        let most = (0..self.energy.len()).max_by(|a, b| self.energy[*a].total_cmp(&self.energy[*b]))?;
        (self.median > 0.0).then(|| EnergyPeak {
            median: self.median,
            ratio: self.energy[most] / self.median,
            centre: self.cells.centre(most),
            cell: self.cells.side,
        })
    }

    /// The colour of an energy; 0 for none.
    fn colour(&self, energy: f64) -> u8 {
        if energy <= 0.0 {
            return 0;
        }
        let halves = (2.0 * math::log2(energy / self.median)).round() as i64;
        1 + (halves + 4).clamp(0, COLOURS - 1) as u8
    }
}

/// Adds the energy of block `i` of a job to its cells.
fn add_block(job: &Layout<'_>, i: usize, cells: &Cells, energy: &mut [f64]) {
    let program = job.checked.program();
    let block = &program.blocks[i];
    let centre = Turn::drawn(block.stop.centre).mm();
    // J/mm² to J/cm².
    let share = 100.0 * job.figures[i].slope.cos()[0] / (cells.side[0] * cells.side[1]);
    let in_part = |[x, y]: [f64; 2]| [centre[0] + x, centre[1] + y];
    for stroke in program.strokes_of(block) {
        let pen = &program.pens[stroke.pen.index()];
        let points = program.points_of(stroke);
        let beam = pen.beam(job.machine);
        let by_area = share * f64::from(pen.passes);
        // While its speed changes, half a cell at a time.
        deposits(points, beam, cells.side[0].min(cells.side[1]) / 2.0, |[from, to], joule| {
            let joule = by_area * joule;
            cells.share_line(in_part(from), in_part(to), |cell, share| energy[cell] += joule * share);
        });
        if let ([dot], Some(dwell)) = (points, pen.dwell) {
            let p = [dot.x, dot.y].map(|v| f64::from(v) / NM_PER_MM);
            let joule = by_area * beam.power * dwell.as_s();
            cells.share_dot(in_part(p), |cell, share| energy[cell] += joule * share);
        }
    }
}

/// Adds the energy of a move of an on-the-fly program, spread evenly over its way, to its cells.
fn add_move(job: &OnTheFlyLayout<'_>, marked: &Marked, cells: &Cells, energy: &mut [f64]) {
    let &Marked { pen, s, way_mm, from, to } = marked;
    let pen = &job.program.pens[pen.index()];
    // Where the power follows the speed of the spot the energy is that of the way at full power and speed.
    let full_s = if job.power_by_speed { way_mm / pen.speed.as_mm_s() } else { s };
    let joule = pen.power.as_w(job.machine.laser.max_power) * full_s;
    // J/mm² to J/cm².
    let by_area = 100.0 * joule / (cells.side[0] * cells.side[1]);
    cells.share_line(from, to, |cell, share| energy[cell] += by_area * share);
}

/// The largest of 1, 2, 5, 10 ... that is not above a length.
fn round_below(length: f64) -> f64 {
    let power = 10f64.powi(math::log10(length).floor() as i32);
    [5.0, 2.0, 1.0].into_iter().map(|k| k * power).find(|v| *v <= length).unwrap_or(power)
}

/// The text of the file, of the job of a name.
pub fn energy_svg(job: &str, map: &EnergyMap) -> String {
    const WIDTH: f64 = 900.0;
    /// Above the map, below it, and at its sides.
    const HEAD: f64 = 34.0;
    const KEY: f64 = 122.0;
    const SIDE: f64 = 10.0;
    let colours: Vec<_> = (0..COLOURS).map(|k| of_height(k, [0, COLOURS - 1])).collect();
    let palette: Vec<[u8; 4]> =
        std::iter::once([255, 255, 255, 0]).chain(colours.iter().map(|[r, g, b]| [*r, *g, *b, 255])).collect();
    let [columns, rows] = map.cells.count;
    let pixels: Vec<u8> =
        (0..rows).rev().flat_map(|y| map.energy[y * columns..][..columns].iter().map(|e| map.colour(*e))).collect();
    let [wide, high] = [0, 1].map(|k| map.cells.side[k] * map.cells.count[k] as f64);
    let height = (WIDTH * high / wide).ceil();
    let bottom = HEAD + height;
    let address = image::of_indices(map.cells.count, &palette, &pixels);
    let [x, y] = map.cells.lo;
    let px_per_mm = WIDTH / wide;
    let scale = round_below(0.25 * WIDTH / px_per_mm);
    let mut out = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<svg xmlns=\"http://www.w3.org/2000/svg\" \
         viewBox=\"-{SIDE} 0 {page} {total}\" font-family=\"sans-serif\" font-size=\"14\">\n\
         <title>{name}: energy by area</title>\n<rect x=\"-{SIDE}\" width=\"{page}\" height=\"{total}\" fill=\"#ffffff\"/>\n\
         <text y=\"23\" font-size=\"18\">{name}: energy by area</text>\n\
         <image y=\"{HEAD}\" width=\"{WIDTH}\" height=\"{height}\" preserveAspectRatio=\"none\" \
         style=\"image-rendering:pixelated\" href=\"{address}\"/>\n\
         <rect y=\"{HEAD}\" width=\"{WIDTH}\" height=\"{height}\" fill=\"none\" stroke=\"#444\"/>\n\
         <path d=\"M0.5 {}v8m0-4h{bar}m0-4v8\" fill=\"none\" stroke=\"#000\"/><text x=\"{}\" y=\"{}\">{scale} mm</text>\n",
        bottom + 6.0,
        plain(scale * px_per_mm + 8.0, 2),
        bottom + 15.0,
        name = escape(job),
        bar = plain(scale * px_per_mm, 2),
        page = WIDTH + 2.0 * SIDE,
        total = bottom + KEY,
    );
    let ramp = bottom + 24.0;
    let step = WIDTH / COLOURS as f64;
    for (k, colour) in colours.iter().enumerate() {
        let _ = writeln!(
            out,
            "<rect x=\"{}\" y=\"{ramp}\" width=\"{}\" height=\"16\" fill=\"{}\"/>",
            plain(k as f64 * step, 2),
            plain(step, 2),
            hex(*colour)
        );
        if k % 2 == 0 {
            let times = plain(2f64.powi(k as i32 / 2 - 2), 2);
            let _ =
                writeln!(out, "<text x=\"{}\" y=\"{}\">{times}</text>", plain(k as f64 * step + 4.0, 2), ramp + 30.0);
        }
    }
    let _ = write!(
        out,
        "<text y=\"{}\">Energy by area as a multiple of the median, {} J/cm2 {}</text>\n\
         <text y=\"{}\">{}cells of {} x {} mm, the lower left at ({}, {}) mm</text>\n\
         <text y=\"{}\">white: no marks. The mean of a cell, lines and what lies between them: in a line it is \
         more</text>\n</svg>\n",
        ramp + 50.0,
        plain(map.median, 3),
        map.area,
        ramp + 68.0,
        map.peak().map_or_else(String::new, |peak| peak.shown()),
        plain(map.cells.side[0], 3),
        plain(map.cells.side[1], 3),
        plain(x, 3),
        plain(y, 3),
        ramp + 86.0,
    );
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cell_holds_several_lines_as_long_as_there_are_enough_cells() {
        let side = |mark_mm| cells_over([0.0; 2], [100.0, 50.0], 0.04, mark_mm).side[0];
        assert_eq!(side(100_000.0), 0.25);
        // A hatch of 0.5 mm.
        assert_eq!(side(10_000.0), 0.5);
        assert_eq!((side(100.0), side(0.0)), (4.0, 0.25));
    }

    #[test]
    fn cells_fit_the_box() {
        let cells = cells_over([0.0; 2], [10.0, 5.2], 1.0, 1e9);
        assert_eq!((cells.side, cells.count), ([1.0, 1.04], [10, 5]));
        let narrow = cells_over([0.0; 2], [10.0, 0.3], 1.0, 1e9);
        assert_eq!((narrow.side, narrow.count), ([1.0, 1.0], [10, 1]));
    }
}
