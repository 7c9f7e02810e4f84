//! Areas of a drawing that are filled along the level lines of the part.
//!
//! Lines are those of a [`Contour`] over the box of the areas: one lattice in each cell of a grid. Of each line is
//! marked what lies in an area at least the inset from its border, exactly; at the border of a cell, lines end without
//! an inset.
//! An area that no line meets, because it is narrower than the pitch, has one line of its own in the direction of its
//! cell. Units: nm as f64 in the turned part frame, mm across and along lines; rounded once.

use std::collections::BTreeSet;
use std::ops::Range;

use super::artwork::{LevelHatch, LineSet, OWN_LINE_SHARES, Polygon, UnfilledAreas, extent_across};
use super::drawing::{Drawing, PagePlacement};
use super::pattern::{Contour, ContourCell, Directions};
use super::place::{NM, Site};
use super::{Figure, MAX_POINTS, too_large};
use terrace_core::diag::Error;
use terrace_core::geom::{Box2, BoxMm, NM_PER_MM, P2, Strokes};
use terrace_core::parallel;
use terrace_core::program::PenId;

/// A drawing with areas that are filled by lines along the level lines of the part.
#[derive(Clone, Debug)]
pub struct ContourAreas {
    /// All else of the drawing.
    drawing: std::sync::Arc<Drawing>,
    /// How many strokes of it are marked before the lines.
    before: u64,
    /// The lines; with a cross, those at a right angle to them too.
    lattices: Vec<Contour>,
    areas: std::sync::Arc<Vec<FilledPolygon>>,
    hatch: LevelHatch,
    bounds: Box2,
    /// Empty until the directions of level lines are known.
    lines: Strokes,
    /// Per line, where it comes from.
    origins: Vec<LineOrigin>,
}

/// Where a line comes from.
#[derive(Clone, Copy, Debug)]
struct LineOrigin {
    /// Index of its area.
    area: u32,
    /// Whether it lies between the lines of the lattice, in an area that none of them meets.
    is_between: bool,
}

/// A polygon that lines along level lines fill.
#[derive(Debug)]
struct FilledPolygon {
    /// Index of its element's name.
    name: u32,
    pen: Option<PenId>,
    /// Turned part frame, nm.
    polygon: Polygon,
    bounds: BoxMm<2>,
}

/// A line in an area.
struct AreaLine {
    ends: [P2; 2],
    /// Whether it lies between the lines of the lattice.
    is_between: bool,
}

impl ContourAreas {
    /// The areas of a drawing that was placed, cut at `limit`, part frame, mm.
    pub(super) fn new(
        drawing: Drawing,
        unfilled: &[UnfilledAreas],
        hatch: LevelHatch,
        phase: f64,
        limit: Option<BoxMm<2>>,
        site: &Site,
    ) -> Result<Self, Error> {
        let placed = *drawing.placed();
        let mut flat = BoxMm::EMPTY;
        let mut areas = Vec::new();
        for element in unfilled {
            for polygon in &element.polygons {
                polygon.iter().flatten().for_each(|&p| flat.add(placed.part(p)));
                let polygon: Polygon =
                    polygon.iter().map(|ring| ring.iter().map(|&p| nm(&placed, p)).collect()).collect();
                let bounds = BoxMm::of(polygon.iter().flatten().copied());
                areas.push(FilledPolygon { name: element.name, pen: element.pen, polygon, bounds });
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
            for _ in 0..if hatch.cross { 2 } else { 1 } {
                lattices.push(Contour::new(flat, hatch.pitch_mm, phase, site.turn)?);
            }
        }
        let bounds = lattices.iter().fold(drawing.bounds(), |b, l| b.union(l.bounds()));
        let before = drawing.before();
        Ok(Self {
            drawing: drawing.into(),
            before,
            lattices,
            areas: areas.into(),
            hatch,
            bounds,
            lines: Strokes::default(),
            origins: Vec::new(),
        })
    }

    /// Fills the areas with lines in these directions.
    pub(super) fn fill(&mut self, directions: &Directions) -> Result<(), Error> {
        self.lines = Strokes::default();
        self.origins.clear();
        for (k, lattice) in self.lattices.iter_mut().enumerate() {
            lattice.fill(&directions.turned(k))?;
        }
        let lines = parallel::map(self.areas.len(), |i| self.lines_in(&self.areas[i]));
        let count: usize = lines.iter().map(Vec::len).sum();
        if 2 * count as u64 > MAX_POINTS.min(u64::from(u32::MAX)) {
            return Err(too_large(count as u64, 2 * count as u64).into());
        }
        for (i, lines) in lines.into_iter().enumerate() {
            for AreaLine { ends, is_between } in lines {
                if self.lines.push(ends) {
                    self.origins.push(LineOrigin { area: i as u32, is_between });
                }
            }
        }
        Ok(())
    }

    /// The lines in an area: those of each lattice, or one of its own where none of a lattice meets it.
    fn lines_in(&self, area: &FilledPolygon) -> Vec<AreaLine> {
        let mut out = Vec::new();
        let reach = self.hatch.inset_mm * NM_PER_MM;
        let grown = BoxMm { lo: area.bounds.lo.map(|v| v - reach), hi: area.bounds.hi.map(|v| v + reach) };
        for lattice in &self.lattices {
            let cells: Vec<_> = lattice.cells().filter(|cell| meets(&grown, cell.bounds())).collect();
            let before = out.len();
            for cell in &cells {
                self.lattice_lines(area, cell, &mut out);
            }
            if out.len() == before {
                let own_line = cells.iter().map(|cell| self.own_line(area, cell)).find(|line| !line.is_empty());
                out.extend(own_line.into_iter().flatten());
            }
        }
        out
    }

    /// Appends the lines of the lattice in a cell, as far as they lie in the area.
    fn lattice_lines(&self, area: &FilledPolygon, cell: &ContourCell<'_>, out: &mut Vec<AreaLine>) {
        let sides = sides(&area.polygon, |p| cell.along(p));
        let begin = cell.first() as f64 * self.hatch.pitch_mm;
        for span in LineSet::new(begin, cell.count, &self.hatch).spans(&sides) {
            let is_backward = !self.hatch.one_way && (cell.first() + span.line as i64).rem_euclid(2) == 1;
            let piece = cell.piece(span.v * NM_PER_MM, [span.from, span.to].map(|u| u * NM_PER_MM));
            let ends = piece.map(|[a, b]| if is_backward { [b, a] } else { [a, b] });
            out.extend(ends.map(|ends| AreaLine { ends, is_between: false }));
        }
    }

    /// The pieces of a single line in a cell, at the first of [`OWN_LINE_SHARES`] where any fits into the area.
    fn own_line(&self, area: &FilledPolygon, cell: &ContourCell<'_>) -> Vec<AreaLine> {
        let sides = sides(&area.polygon, |p| cell.along(p));
        let [lo, hi] = extent_across(&sides);
        for share in OWN_LINE_SHARES {
            let spans = LineSet::new(lo + share * (hi - lo), 1, &self.hatch).spans(&sides);
            let lines: Vec<AreaLine> = spans
                .iter()
                .filter_map(|s| cell.piece(s.v * NM_PER_MM, [s.from, s.to].map(|u| u * NM_PER_MM)))
                .map(|ends| AreaLine { ends, is_between: true })
                .collect();
            if !lines.is_empty() {
                return lines;
            }
        }
        Vec::new()
    }

    /// The boxes that hold the lines.
    pub fn lattices(&self) -> &[Contour] {
        &self.lattices
    }

    /// The strokes that are lines of areas.
    pub fn own(&self) -> Range<u64> {
        self.before..self.before + self.lines.len() as u64
    }

    /// Whether a stroke lies between the lines of the lattice, in an area that none of them meets.
    pub fn is_between(&self, i: u64) -> bool {
        self.own().contains(&i) && self.origins[(i - self.before) as usize].is_between
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

/// Whether the box of a cell meets a box, nm.
fn meets(area: &BoxMm<2>, cell: Box2) -> bool {
    let lo = [cell.lo.x, cell.lo.y];
    let hi = [cell.hi.x, cell.hi.y];
    (0..2).all(|k| lo[k] as f64 <= area.hi[k] && hi[k] as f64 >= area.lo[k])
}

/// A point of the page in the turned part frame, nm.
fn nm(placed: &PagePlacement, p: [f64; 2]) -> [f64; 2] {
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
            Ok(k) => self.drawing.name(self.areas[self.origins[k].area as usize].name).to_owned(),
            Err(i) => self.drawing.element(i),
        }
    }

    fn dot_pens(&self, own: PenId) -> BTreeSet<PenId> {
        self.drawing.dot_pens(own)
    }

    fn pen(&self, i: u64) -> Option<PenId> {
        match self.find(i) {
            Ok(k) => self.areas[self.origins[k].area as usize].pen,
            Err(i) => self.drawing.pen(i),
        }
    }
}
