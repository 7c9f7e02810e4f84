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
use crate::projection::{Skip, Tracer};
use crate::units::Share;

/// Cells along the longer side of the texture: fine enough for a picture, few enough for a file.
const CELLS: i64 = 600;

/// Strokes that are traced as one task.
const CHUNK: usize = 4096;

/// What lies off the part.
#[derive(Clone, Debug, Default)]
pub struct OffPart {
    /// Of every texture that the job places: its number from 1, its length and what of that lies off the part.
    lengths: Vec<(usize, Nm, Nm)>,
    /// Where that is, turned part frame: rows of cells that do not overlap.
    pub places: Vec<Box2>,
}

/// What is found of one texture.
#[derive(Default)]
struct Found {
    all: i64,
    off: i64,
    cells: BTreeSet<usize>,
}

impl OffPart {
    /// Traces the textures that the job places.
    pub(super) fn of(job: &Job, sweep: Sweep<'_>) -> Self {
        let grid = grid(sweep.texture.bounds());
        let mut cells = BTreeSet::new();
        let mut lengths = Vec::new();
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
            lengths.push((k + 1, Nm(found.all), Nm(found.off)));
            cells.extend(found.cells);
        }
        Self { lengths, places: rows(&grid, &cells) }
    }

    /// The fault where more than a share of a texture lies off the part.
    pub fn fault(&self, most: Share) -> Option<Diag> {
        let share = |all: Nm, off: Nm| 100.0 * off.f64() / all.f64().max(1.0);
        let (number, all, off) =
            self.lengths.iter().copied().find(|&(_, all, off)| share(all, off) > most.as_percent())?;
        let text = format!(
            "texture {number}: {:.3} mm of it ({:.1} %) lie off the part or over a hole",
            off.mm(),
            share(all, off)
        );
        let hint = format!(
            "limits.max_off_part allows {} %: `terrace preview` draws it in red; move the texture with its area or \
             origin, or raise the limit",
            most.as_percent()
        );
        Some(Diag::limit("off-part", text).hint(hint))
    }
}

impl Found {
    fn trace(&mut self, tracer: &mut Tracer<'_>, points: &[P2], grid: &Grid) {
        let (mut all, mut off) = (0.0, 0.0);
        for w in points.windows(2) {
            let (a, b) = (w[0], w[1]);
            let length = ((b.x - a.x) as f64).hypot((b.y - a.y) as f64);
            all += length;
            tracer.segment(a, b, |piece| {
                if piece.skip == Some(Skip::OffPart) {
                    let part = length * (piece.t1 - piece.t0);
                    off += part;
                    // At least two points in every cell that it crosses along an axis.
                    let steps = (2.0 * part / grid.pitch[0].f64()).ceil().max(1.0) as usize;
                    let at = |i: usize| a.lerp(b, piece.t0 + (piece.t1 - piece.t0) * i as f64 / steps as f64);
                    self.cells.extend((0..=steps).map(|i| cell(grid, at(i))));
                }
            });
        }
        self.all += Nm::round(all).0;
        self.off += Nm::round(off).0;
    }

    fn merge(&mut self, other: Self) {
        self.all += other.all;
        self.off += other.off;
        self.cells.extend(other.cells);
    }
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
