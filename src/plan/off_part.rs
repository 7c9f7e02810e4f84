//! What of the textures that the job places lies off the part.
//!
//! A pattern over the part's box is limited to the part by its own meaning, so what of it lies off the part is nobody's
//! mistake; of all other textures (`Request::is_placed`) it may be one. Strokes of the latter are traced once more.
//! Lengths are sums of whole nanometres, and places are cells of a grid over the texture, so threads change nothing.

use std::collections::BTreeSet;

use super::stroke_chunks::Sweep;
use crate::diag::Diag;
use crate::geom::{Box2, Grid, Nm, P2};
use crate::job::Job;
use crate::parallel;
use crate::projection::{Skip, Tracer, segments};
use crate::texture::Slip;
use crate::units::Share;

/// Cells along the longer side of the texture: fine enough for a picture, few enough for a file.
const CELLS: i64 = 600;

/// Strokes that are traced as one task.
const CHUNK: usize = 4096;

/// What lies off the part.
#[derive(Clone, Debug, Default)]
pub struct OffPart {
    /// Of every texture that the job places: its number from 1, and what was found.
    textures: Vec<(usize, Extent)>,
    /// Those whose size does not go with the part, by their index.
    slips: Vec<(usize, Slip)>,
    /// Where that is, turned part frame: rows of cells that do not overlap.
    pub places: Vec<Box2>,
}

/// Lengths and dots of a texture, all and those off the part.
#[derive(Clone, Copy, Debug, Default)]
struct Extent {
    all: i64,
    off: i64,
    dots: u64,
    dots_off: u64,
}

impl Extent {
    /// The share that lies off the part, of the lines or of the dots, %.
    fn off_percent(&self) -> f64 {
        let lines = self.off as f64 / self.all.max(1) as f64;
        100.0 * lines.max(self.dots_off as f64 / self.dots.max(1) as f64)
    }
}

/// What is found of one texture.
#[derive(Default)]
struct Found {
    extent: Extent,
    cells: BTreeSet<usize>,
}

impl OffPart {
    /// Traces the textures that the job places.
    pub(super) fn of(job: &Job, sweep: Sweep<'_>) -> Self {
        let grid = grid(sweep.texture.bounds());
        let mut cells = BTreeSet::new();
        let mut textures = Vec::new();
        for (k, _) in job.textures.iter().enumerate().filter(|(_, request)| request.is_placed()) {
            let strokes = sweep.texture.strokes_of(k);
            let chunk = |i: usize| (strokes.start + i * CHUNK)..(strokes.start + (i + 1) * CHUNK).min(strokes.end);
            let found = parallel::fold(
                strokes.len().div_ceil(CHUNK),
                Found::default,
                |found, i| {
                    let mut tracer = Tracer::new(sweep.surface, sweep.max_slope);
                    let mut points = Vec::new();
                    for stroke in chunk(i) {
                        sweep.texture.stroke(stroke, &mut points);
                        found.trace(&mut tracer, &points, &grid);
                    }
                },
                Found::merge,
            );
            textures.push((k + 1, found.extent));
            cells.extend(found.cells);
        }
        let slips = sweep.texture.slips().map(|(k, slip)| (k, slip.clone())).collect();
        Self { textures, slips, places: rows(&grid, &cells) }
    }

    /// The fault where more than a share of a texture lies off the part; where its size explains it, the hint says so.
    pub fn fault(&self, most: Share) -> Option<Diag> {
        let (number, found) = self.textures.iter().find(|(_, found)| found.off_percent() > most.as_percent())?;
        let text = format!(
            "texture {number}: {} of it ({:.1} %) lie off the part or over a hole",
            lengths_and_dots(Nm(found.off).mm(), found.dots_off),
            found.off_percent()
        );
        let hint = format!(
            "limits.max_off_part allows {} %: `terrace preview` draws it in red; move the texture with its area or \
             origin, or raise the limit",
            most.as_percent()
        );
        let slip = self.slips.iter().find(|(k, _)| k + 1 == *number).map(|(_, slip)| slip.cause());
        Some(Diag::limit("off-part", text).hint(slip.unwrap_or(hint)))
    }
}

impl Found {
    fn trace(&mut self, tracer: &mut Tracer<'_>, points: &[P2], grid: &Grid) {
        let (mut all, mut off) = (0.0, 0.0);
        let is_dot = points.len() == 1;
        self.extent.dots += u64::from(is_dot);
        for (a, b) in segments(points) {
            let length = ((b.x - a.x) as f64).hypot((b.y - a.y) as f64);
            all += length;
            tracer.segment(a, b, |piece| {
                if piece.skip == Some(Skip::OffPart) {
                    let part = length * (piece.t1 - piece.t0);
                    self.extent.dots_off += u64::from(is_dot);
                    if is_dot {
                        self.cells.extend(block(grid, a));
                    }
                    off += part;
                    // At least two points in every cell that it crosses along an axis.
                    let steps = (2.0 * part / grid.pitch[0].f64()).ceil().max(1.0) as usize;
                    let at = |i: usize| a.lerp(b, piece.t0 + (piece.t1 - piece.t0) * i as f64 / steps as f64);
                    self.cells.extend((0..=steps).map(|i| cell(grid, at(i))));
                }
            });
        }
        self.extent.all += Nm::round(all).0;
        self.extent.off += Nm::round(off).0;
    }

    fn merge(&mut self, other: Self) {
        self.extent.all += other.extent.all;
        self.extent.off += other.extent.off;
        self.extent.dots += other.extent.dots;
        self.extent.dots_off += other.extent.dots_off;
        self.cells.extend(other.cells);
    }
}

/// What is not marked: a length, dots, or both.
pub(super) fn lengths_and_dots(mm: f64, dots: u64) -> String {
    match (mm > 0.0, dots) {
        (_, 0) => length(mm),
        (false, dots) => format!("{dots} dots"),
        (true, dots) => format!("{} and {dots} dots", length(mm)),
    }
}

/// A length, mm, for messages.
pub(super) fn length(mm: f64) -> String {
    if mm < 0.001 { format!("{:.3} um", mm * 1000.0) } else { format!("{mm:.3} mm") }
}

/// Square cells over a box.
fn grid(area: Box2) -> Grid {
    let size = area.size();
    let pitch = (size[0].max(size[1]) / CELLS + Nm(1)).max(Nm(1));
    Grid { origin: area.lo, pitch: [pitch; 2], count: size.map(|s| (s / pitch + 1) as u32) }
}

fn cell(grid: &Grid, p: P2) -> usize {
    (grid.along(1, p.y, 0) * i64::from(grid.count[0]) + grid.along(0, p.x, 0)) as usize
}

/// The cells around a dot, so many that a picture shows them.
fn block(grid: &Grid, p: P2) -> impl Iterator<Item = usize> {
    const REACH: i64 = 2;
    let [column, row] = [(0, p.x), (1, p.y)].map(|(axis, v)| grid.along(axis, v, 0));
    let [columns, rows] = grid.count.map(i64::from);
    let near = |at: i64, count: i64| (at - REACH).max(0)..(at + REACH + 1).min(count);
    near(row, rows).flat_map(move |j| near(column, columns).map(move |i| (j * columns + i) as usize))
}

/// Neighbouring cells of a row as one box.
fn rows(grid: &Grid, cells: &BTreeSet<usize>) -> Vec<Box2> {
    let mut out: Vec<Box2> = Vec::new();
    let mut last = None;
    for &i in cells {
        let area = grid.area(i);
        match out.last_mut() {
            Some(row) if last == Some(i.wrapping_sub(1)) && row.lo.y == area.lo.y => row.hi = area.hi,
            _ => out.push(area),
        }
        last = Some(i);
    }
    out
}
