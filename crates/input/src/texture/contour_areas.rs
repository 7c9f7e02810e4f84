//! Areas of a drawing that are filled along the level lines of the part.
//!
//! Lines are those of a [`Contour`] over the box of the areas: one lattice in each cell of a grid. Of each line is marked
//! what lies in an area at least the inset from its border, exactly; at the border of a cell, lines end without an inset.
//! An area that no line meets, because it is narrower than the pitch, has one line of its own in the direction of its
//! cell. Units: nm as f64 in the turned part frame, mm across and along lines; rounded once.

use std::collections::BTreeSet;
use std::ops::Range;

use super::artwork::{Polygon, Set, Waiting, Waits};
use super::drawing::{Drawing, Placed};
use super::pattern::{Contour, Directions};
use super::place::{NM, Site};
use super::{Figure, MAX_POINTS, too_large};
use terrace_core::diag::Error;
use terrace_core::geom::{Box2, BoxMm, NM_PER_MM, P2, Strokes};
use terrace_core::parallel;
use terrace_core::program::PenId;

/// The places across a narrow area at which a line of its own is tried.
const SHARES: [f64; 7] = [0.5, 0.25, 0.75, 0.125, 0.375, 0.625, 0.875];

/// A drawing with areas whose lines follow, or wait for, the directions of level lines.
#[derive(Clone, Debug)]
pub struct ContourAreas {
    /// All else of the drawing.
    drawing: std::sync::Arc<Drawing>,
    /// How many strokes of it are marked before the lines.
    before: u64,
    /// The lines; with a cross, those at a right angle to them too.
    lattices: Vec<Contour>,
    areas: std::sync::Arc<Vec<Area>>,
    waiting: Waiting,
    bounds: Box2,
    lines: Strokes,
    /// Of each line its area, and whether it lies between those of the lattice.
    origin: Vec<(u32, bool)>,
}

/// One polygon.
#[derive(Debug)]
struct Area {
    /// Index of its element's name.
    name: u32,
    pen: Option<PenId>,
    /// Turned part frame, nm.
    polygon: Polygon,
    bounds: BoxMm<2>,
}

/// A stretch of a line, and whether it lies between those of the lattice.
type Piece = ([P2; 2], bool);

impl ContourAreas {
    /// The areas of a drawing that was placed, cut at `limit`, part frame, mm.
    pub(super) fn new(
        drawing: Drawing,
        waits: &[Waits],
        waiting: Waiting,
        phase: f64,
        limit: Option<BoxMm<2>>,
        site: &Site,
    ) -> Result<Self, Error> {
        let placed = *drawing.placed();
        let mut flat = BoxMm::EMPTY;
        let mut areas = Vec::new();
        for wait in waits {
            for polygon in &wait.polygons {
                polygon.iter().flatten().for_each(|&p| flat.add(placed.part(p)));
                let polygon: Polygon =
                    polygon.iter().map(|ring| ring.iter().map(|&p| nm(&placed, p)).collect()).collect();
                let bounds = BoxMm::of(polygon.iter().flatten().copied());
                areas.push(Area { name: wait.name, pen: wait.pen, polygon, bounds });
            }
        }
        if let Some(limit) = limit {
            flat = BoxMm {
                lo: [0, 1].map(|k| flat.lo[k].max(limit.lo[k])),
                hi: [0, 1].map(|k| flat.hi[k].min(limit.hi[k])),
            };
        }
        let mut lattices = Vec::new();
        if flat.lo[0] < flat.hi[0] && flat.lo[1] < flat.hi[1] {
            for _ in 0..if waiting.cross { 2 } else { 1 } {
                lattices.push(Contour::new(flat, waiting.pitch_mm, phase, site.turn)?);
            }
        }
        let bounds = lattices.iter().fold(drawing.bounds(), |b, l| b.union(l.bounds()));
        let before = drawing.before();
        let (lines, origin) = <_>::default();
        Ok(Self { drawing: drawing.into(), before, lattices, areas: areas.into(), waiting, bounds, lines, origin })
    }

    /// Lays the lines.
    pub(super) fn fill(&mut self, directions: &Directions) -> Result<(), Error> {
        (self.lines, self.origin) = <_>::default();
        for (k, lattice) in self.lattices.iter_mut().enumerate() {
            lattice.fill(&directions.turned(k))?;
        }
        let pieces = parallel::map(self.areas.len(), |i| self.pieces(&self.areas[i]));
        let count: usize = pieces.iter().map(Vec::len).sum();
        if 2 * count as u64 > MAX_POINTS.min(u64::from(u32::MAX)) {
            return Err(too_large(count as u64, 2 * count as u64).into());
        }
        for (i, pieces) in pieces.into_iter().enumerate() {
            for (line, is_own) in pieces {
                if self.lines.push(line) {
                    self.origin.push((i as u32, is_own));
                }
            }
        }
        Ok(())
    }

    /// The lines in an area.
    fn pieces(&self, area: &Area) -> Vec<Piece> {
        let mut out = Vec::new();
        for lattice in &self.lattices {
            let first = out.len();
            let reach = self.waiting.inset_mm * NM_PER_MM;
            let grown = BoxMm { lo: area.bounds.lo.map(|v| v - reach), hi: area.bounds.hi.map(|v| v + reach) };
            let near = |cell: Box2| {
                let (lo, hi) = ([cell.lo.x, cell.lo.y], [cell.hi.x, cell.hi.y]);
                (0..2).all(|k| lo[k] as f64 <= grown.hi[k] && hi[k] as f64 >= grown.lo[k])
            };
            for cell in lattice.cells().filter(|cell| near(cell.bounds())) {
                let sides = sides(&area.polygon, |p| cell.along(p));
                let begin = cell.first() as f64 * self.waiting.pitch_mm;
                for span in Set::new(begin, cell.count, &self.waiting).spans(&sides) {
                    let stretch = self.turned_back(cell.first() + span.line as i64, [span.from, span.to]);
                    let line = cell.piece(span.v * NM_PER_MM, stretch.0);
                    out.extend(line.map(|[a, b]| (if stretch.1 { [b, a] } else { [a, b] }, false)));
                }
            }
            if out.len() > first {
                continue;
            }
            // No line of the lattice meets it: one of its own, if any fits.
            'cells: for cell in lattice.cells().filter(|cell| near(cell.bounds())) {
                let sides = sides(&area.polygon, |p| cell.along(p));
                let heights = || sides.iter().map(|[p, _]| p[1]);
                let (lo, hi) = (heights().fold(f64::INFINITY, f64::min), heights().fold(f64::NEG_INFINITY, f64::max));
                for share in SHARES {
                    let own = Set::new(lo + share * (hi - lo), 1, &self.waiting).spans(&sides);
                    let piece =
                        |v: f64, from: f64, to: f64| cell.piece(v * NM_PER_MM, [from, to].map(|u| u * NM_PER_MM));
                    out.extend(own.iter().filter_map(|s| piece(s.v, s.from, s.to)).map(|line| (line, true)));
                    if out.len() > first {
                        break 'cells;
                    }
                }
            }
        }
        out
    }

    /// A stretch of line `k` in nm, and whether it is marked backwards.
    fn turned_back(&self, k: i64, stretch: [f64; 2]) -> ([f64; 2], bool) {
        (stretch.map(|u| u * NM_PER_MM), !self.waiting.one_way && k.rem_euclid(2) == 1)
    }

    /// The boxes that the lines are laid in.
    pub fn lattices(&self) -> &[Contour] {
        &self.lattices
    }

    /// The strokes that are lines of areas.
    pub fn own(&self) -> Range<u64> {
        self.before..self.before + self.lines.len() as u64
    }

    /// Whether a stroke lies between the lines of the lattice, in an area that none of them meets.
    pub fn is_between(&self, i: u64) -> bool {
        self.own().contains(&i) && self.origin[(i - self.before) as usize].1
    }

    /// The line `i`, or the stroke of the drawing.
    fn find(&self, i: u64) -> Result<usize, u64> {
        let own = self.own();
        match i {
            i if own.contains(&i) => Ok((i - own.start) as usize),
            i if i < own.start => Err(i),
            i => Err(i - (own.end - own.start)),
        }
    }
}

fn nm(placed: &Placed, p: [f64; 2]) -> [f64; 2] {
    placed.turned(p).map(|v| v * NM_PER_MM)
}

/// The sides of a polygon along and across the lines of a cell, mm.
fn sides(polygon: &Polygon, along: impl Fn([f64; 2]) -> [f64; 2]) -> Vec<[[f64; 2]; 2]> {
    let mut out = Vec::new();
    for ring in polygon {
        let ring: Vec<[f64; 2]> = ring.iter().map(|&p| along(p).map(|v| v * NM)).collect();
        out.extend(ring.iter().zip(ring.iter().cycle().skip(1)).map(|(&a, &b)| [a, b]));
    }
    out
}

impl Figure for ContourAreas {
    fn len(&self) -> u64 {
        self.drawing.len() + self.lines.len() as u64
    }

    fn points(&self) -> u64 {
        self.drawing.points() + self.lines.point_count() as u64
    }

    /// The box of the areas and of all else; that of the lines lies in it.
    fn bounds(&self) -> Box2 {
        self.bounds
    }

    fn stroke(&self, i: u64, out: &mut Vec<P2>) {
        match self.find(i) {
            Ok(k) => out.extend_from_slice(self.lines.get(k)),
            Err(i) => self.drawing.stroke(i, out),
        }
    }

    fn element(&self, i: u64) -> String {
        match self.find(i) {
            Ok(k) => self.drawing.name(self.areas[self.origin[k].0 as usize].name).to_owned(),
            Err(i) => self.drawing.element(i),
        }
    }

    fn dot_pens(&self, own: PenId) -> BTreeSet<PenId> {
        self.drawing.dot_pens(own)
    }

    fn pen(&self, i: u64) -> Option<PenId> {
        match self.find(i) {
            Ok(k) => self.areas[self.origin[k].0 as usize].pen,
            Err(i) => self.drawing.pen(i),
        }
    }
}
