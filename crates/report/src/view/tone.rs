//! How dense the marks lie, as a map: what the page shows where marks are closer to each other than its pixels.
//!
//! Density is the length of marks per area as seen along z of the part, mm/mm^2; a dot counts as the line that covers
//! its area. A map has one byte a cell, of which 255 is [`Tones::most_per_mm`], and with several pens the pen of most of
//! the length of each cell.

use std::ops::Range;

use serde::Serialize;

use super::pack::Data;
use crate::raster::Cells;
use crate::scene::{Group, Mark, Scene};
use terrace_core::geom::BoxMm;
use terrace_core::math;
use terrace_core::parallel;

/// Cells of all maps: about the pixels that a job fills in a window.
const CELLS: f64 = 600_000.0;
/// What counts as dense: no more than the 50th part of the marked cells is denser. A crossing of lines is not the rule.
const RARE: usize = 50;
/// Greatest side of a map: what every graphics card takes.
const MOST_CELLS: usize = 2048;

/// The map of a pass.
#[derive(Serialize)]
pub(super) struct ToneHead {
    name: String,
    /// Of the pass, from 1.
    pass: usize,
    /// Lowest corner, mm.
    origin: [f64; 2],
    /// Side of a cell, mm.
    cell: f64,
    columns: usize,
    rows: usize,
    /// Whether the pens of the cells follow.
    has_pens: bool,
}

/// The maps of a job, and how dense its marks lie.
#[derive(Default, Serialize)]
pub(super) struct Tones {
    maps: Vec<ToneHead>,
    /// Density of a byte of 255, mm/mm^2.
    most_per_mm: f64,
    /// Density of dense marks averaged over squares of 1, 2, 4 ... cells a side, mm/mm^2.
    dense_per_mm: Vec<f64>,
}

/// The maps of the passes, whose groups are `passes`, and their elements of the page; `spot` in mm.
pub(super) fn tones(scene: &Scene, passes: &[Range<usize>], pens: usize, spot: f64) -> (Tones, Vec<String>) {
    let maps: Vec<Option<Map>> = parallel::map(passes.len(), |k| {
        Map::of(&scene.groups[passes[k].clone()], CELLS / passes.len() as f64, pens > 1, spot)
    });
    let maps: Vec<(usize, Map)> = maps.into_iter().enumerate().filter_map(|(k, map)| Some((k + 1, map?))).collect();
    let dense_per_mm = dense_by_level(maps.iter().map(|(_, map)| map.layer()).collect());
    let Some(&dense) = dense_per_mm.first() else { return (Tones::default(), Vec::new()) };
    let most_per_mm = 2.0 * dense;
    let (heads, elements) = maps.iter().map(|(pass, map)| map.written(*pass, most_per_mm)).unzip();
    (Tones { maps: heads, most_per_mm, dense_per_mm }, elements)
}

/// Lengths of marks in the cells of a pass.
struct Map {
    cells: Cells,
    /// mm of marks.
    length: Vec<f32>,
    /// The pen of most of the length, and by how much, mm; empty where there is one pen.
    pens: Vec<(u8, f32)>,
}

impl Map {
    /// `None` where nothing is marked.
    fn of(groups: &[Group], cells: f64, has_pens: bool, spot: f64) -> Option<Self> {
        let bounds = BoxMm::of(groups.iter().flat_map(|g| g.points.iter().map(|p| g.frame.seen_along_z(p.at))));
        if bounds.lo[0] > bounds.hi[0] {
            return None;
        }
        let [wide, high] = bounds.size();
        // Finer than half a spot there is nothing to see.
        let cell = math::hypot(0.5 * spot, (wide * high / cells).sqrt()).max(wide.max(high) / (MOST_CELLS - 2) as f64);
        // From centre to centre: marks on the border of all are not cut.
        let lo = bounds.lo.map(|v| v - 0.5 * cell);
        let cells = Cells { lo, side: [cell; 2], count: bounds.size().map(|v| (v / cell) as usize + 2) };
        let pens = if has_pens { vec![(0, 0.0); cells.len()] } else { Vec::new() };
        let mut map = Self { cells, length: vec![0.0; cells.len()], pens };
        for group in groups {
            group.marks.iter().for_each(|mark| map.add(group, mark, spot));
        }
        Some(map)
    }

    fn add(&mut self, group: &Group, mark: &Mark, spot: f64) {
        let cells = self.cells;
        let pen = mark.pen.0 as u8;
        let points = group.points_of(mark);
        let mut from = group.frame.seen_along_z(points[0].at);
        if let [_] = points {
            let length = std::f64::consts::FRAC_PI_4 * spot;
            cells.share_dot(from, |cell, share| self.add_to(cell, length * share, pen));
        }
        for point in &points[1..] {
            let to = group.frame.seen_along_z(point.at);
            let [dx, dy] = [to[0] - from[0], to[1] - from[1]];
            let length = (dx * dx + dy * dy).sqrt();
            cells.share_line(from, to, |cell, share| self.add_to(cell, length * share, pen));
            from = to;
        }
    }

    fn add_to(&mut self, at: usize, length: f64, pen: u8) {
        self.length[at] += length as f32;
        // The majority of a stream, weighed by length.
        if let Some((most, by)) = self.pens.get_mut(at) {
            *by += if *most == pen { length as f32 } else { -(length as f32) };
            if *by < 0.0 {
                (*most, *by) = (pen, -*by);
            }
        }
    }

    fn layer(&self) -> Layer {
        let Cells { side: [side, _], count: [columns, rows], .. } = self.cells;
        let area = (side * side) as f32;
        Layer { columns, rows, density: self.length.iter().map(|l| l / area).collect() }
    }

    fn written(&self, pass: usize, most_per_mm: f64) -> (ToneHead, String) {
        let Cells { lo: origin, side: [cell, _], count: [columns, rows] } = self.cells;
        let byte = 255.0 / (most_per_mm * cell * cell);
        let mut data = Data::default();
        // No marked cell is lost.
        data.u8(self
            .length
            .iter()
            .map(|&l| if l > 0.0 { (f64::from(l) * byte + 0.5).clamp(1.0, 255.0) as u8 } else { 0 }));
        data.u8(self.pens.iter().map(|&(pen, _)| pen));
        let name = format!("tone-{pass}");
        let element = data.element(&name);
        (ToneHead { name, pass, origin, cell, columns, rows, has_pens: !self.pens.is_empty() }, element)
    }
}

/// Densities of a map, mm/mm^2.
struct Layer {
    columns: usize,
    rows: usize,
    density: Vec<f32>,
}

impl Layer {
    /// Averaged over two cells by two.
    fn halved(&self) -> Self {
        let (columns, rows) = (self.columns.div_ceil(2), self.rows.div_ceil(2));
        let at = |column: usize, row: usize| {
            let is_in = column < self.columns && row < self.rows;
            if is_in { self.density[row * self.columns + column] } else { 0.0 }
        };
        let density = (0..columns * rows).map(|i| {
            let (c, r) = (2 * (i % columns), 2 * (i / columns));
            (at(c, r) + at(c + 1, r) + at(c, r + 1) + at(c + 1, r + 1)) / 4.0
        });
        Self { columns, rows, density: density.collect() }
    }
}

/// The density of dense marks over squares of 1, 2, 4 ... cells a side, as long as there are several such squares.
fn dense_by_level(mut layers: Vec<Layer>) -> Vec<f64> {
    let mut levels = Vec::new();
    loop {
        let Some(dense) = dense_of(layers.iter().flat_map(|l| &l.density)) else { return levels };
        levels.push(dense);
        if layers.iter().all(|l| l.columns.max(l.rows) <= 2) {
            return levels;
        }
        layers = layers.iter().map(Layer::halved).collect();
    }
}

/// What counts as dense among densities; `None` where nothing is marked. To a part in 128: by the upper half of their
/// bits, whose order is that of the numbers.
fn dense_of<'a>(densities: impl Iterator<Item = &'a f32>) -> Option<f64> {
    let mut counts = vec![0_u32; 1 << 15];
    densities.filter(|d| **d > 0.0).for_each(|d| counts[(d.to_bits() >> 16) as usize] += 1);
    let marked: usize = counts.iter().map(|&n| n as usize).sum();
    let mut left = marked / RARE + 1;
    let upper = (0..counts.len()).rev().find(|&upper| {
        left = left.saturating_sub(counts[upper] as usize);
        left == 0
    })?;
    (marked > 0).then(|| f64::from(f32::from_bits((upper as u32) << 16 | 0x8000)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Frame, Point};
    use terrace_core::program::PenId;

    /// Lines along x, `pitch` mm apart, 10 mm by 10 mm, at (100, 200) mm.
    fn hatch(pitch: f64, pen: u16) -> Group {
        let mut group = Group::new(Frame::upright([100.0, 200.0, 5.0]));
        for k in 0..=(10.0 / pitch) as u32 {
            let y = (f64::from(k) * pitch * 1e6) as i32;
            let first = group.points.len() as u32;
            group.points.extend([0, 10_000_000].map(|x| Point { at: [x, y, 0], ..Point::default() }));
            group.marks.push(Mark { pen: PenId(pen), length_mm: 10.0, first, len: 2 });
        }
        group
    }

    #[test]
    fn a_hatch_is_as_dense_as_its_pitch_says_at_every_level() {
        let scene = Scene { groups: vec![hatch(0.05, 0)], ..Scene::default() };
        let (tones, elements) = tones(&scene, std::slice::from_ref(&(0..1)), 1, 0.04);
        assert_eq!((tones.maps.len(), elements.len()), (1, 1));
        for (level, &dense) in tones.dense_per_mm.iter().enumerate().filter(|(level, _)| (5..8).contains(level)) {
            assert!((dense - 20.0).abs() < 1.2, "level {level}: {dense} mm/mm^2");
        }
        let map = &tones.maps[0];
        assert_eq!(map.origin.map(|v| v + 0.5 * map.cell), [100.0, 200.0]);
        assert!(map.columns * map.rows <= CELLS as usize + 3000 && map.cell >= 0.02);
    }

    #[test]
    fn lengths_of_all_cells_are_those_of_the_marks_and_most_of_a_cell_is_its_pen() {
        let spot = 0.04;
        let mut dot = Group::new(Frame::upright([105.0, 212.0, 5.0]));
        dot.points.push(Point::default());
        dot.marks.push(Mark { pen: PenId(0), length_mm: 0.0, first: 0, len: 1 });
        let groups = [hatch(0.5, 0), hatch(0.1, 1), dot];
        let map = Map::of(&groups, 400.0, true, spot).expect("marks");
        let total: f64 = map.length.iter().map(|&l| f64::from(l)).sum();
        let marked = 10.0 * (21.0 + 101.0) + std::f64::consts::FRAC_PI_4 * spot;
        assert!((total - marked).abs() < 1e-2, "{total} mm of {marked}");
        let pens: Vec<u8> = map.pens.iter().zip(&map.length).filter(|(_, l)| **l > 0.1).map(|(p, _)| p.0).collect();
        assert!(pens.len() > 200 && pens.iter().all(|&pen| pen == 1));
    }

    #[test]
    fn passes_without_marks_have_no_map() {
        let scene = Scene { groups: vec![Group::new(Frame::upright([0.0; 3])), hatch(1.0, 0)], ..Scene::default() };
        let (tones, elements) = tones(&scene, &[0..1, 1..2], 1, 0.04);
        assert_eq!(tones.maps.iter().map(|m| m.pass).collect::<Vec<_>>(), [2]);
        assert_eq!(elements.len(), 1);
        assert!(super::tones(&Scene::default(), &[], 1, 0.04).0.dense_per_mm.is_empty());
    }
}
