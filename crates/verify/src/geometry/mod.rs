//! Heights under a line: the file's own facets, seen from the lens, in f64.
//!
//! Consumes facets as the file has them (not welded, in any order and winding) or a height map;
//! promises for any line in the plane the sequence of pieces on the topmost sheet, with z exactly
//! linear on each, and the gaps between them. A uniform grid finds the facets; every facet under the
//! line is cut against it in the plane, so that no point between vertices escapes.
//!
//! Units: nm in the turned part frame, as f64 (4 m is held to 5e-7 nm). Limits: facets thinner than
//! the [grain](Geometry::grain) in the plan view, vertical walls among them, have no height of their own
//! and are left out; the gap that they leave is narrower than the grain.

mod box_nm;
mod correction;
mod grid;
mod height_doubt;
mod height_map;
mod mesh;
mod pose;
mod topmost;
mod turn;

pub(super) use box_nm::BoxNm;
pub(super) use correction::Correction;
pub(super) use height_doubt::HeightDoubt;
pub(super) use height_map::Map;
pub(super) use mesh::{Mesh, MeshBuilder};
pub(super) use pose::Pose;
pub(super) use turn::{HeadPose, Turn};

use terrace_core::geom::NM_PER_MM;
use terrace_core::math;
use terrace_core::program::CHORD_NM;

/// Rounding of the mesh's vertices and of the cut points moves an edge by at most this, nm.
const ROUNDING: f64 = 1.5;

/// How far beside an edge the two lines lie that stand for its sides, nm. Facets thinner than 2 nm are not kept, and
/// coordinates are known to 5e-7 nm.
const HAIR: f64 = 0.01;

/// Heights a [`HAIR`] beside an edge that differ by less, nm, meet in it.
const MEETS: f64 = 1.0;

/// How steep a piece is, next to the limit of the job.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Slope {
    /// Within the limit.
    Gentle,
    /// So near to the limit that the rounding of the facet's vertices decides.
    Doubtful,
    /// Beyond the limit.
    Steep,
}

/// The topmost sheet on a piece of the line.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sheet {
    /// Heights at the piece's two ends, nm.
    pub(super) z: [f64; 2],
    /// Square of the slope (dz per unit of xy).
    pub(super) slope2: f64,
    /// The slope next to the limit.
    pub(super) slope: Slope,
    /// How much z rises for 1 along x and y.
    pub(super) grad: [f64; 2],
    facet: u32,
}

/// A piece of a line: from `d[0]` to `d[1]` nm along it. Pieces come in order and leave nothing out.
#[derive(Clone, Copy, Debug)]
pub(super) struct Piece {
    /// Where it begins and ends, nm from the line's start.
    pub(super) d: [f64; 2],
    /// The topmost sheet there; None where the line is off the part.
    pub(super) sheet: Option<Sheet>,
    /// Whether the line runs along an edge there, and what lies on either side has been compared.
    pub(super) is_along_edge: bool,
}

impl Piece {
    /// The length of the piece, nm.
    pub(super) fn len(&self) -> f64 {
        self.d[1] - self.d[0]
    }

    /// The part of it that lies in a stretch.
    fn within(&self, d: [f64; 2]) -> Self {
        let len = self.len();
        let z = |s: &Sheet| d.map(|d| s.z[0] + (s.z[1] - s.z[0]) * ((d - self.d[0]) / len).clamp(0.0, 1.0));
        Self { d, sheet: self.sheet.map(|s| Sheet { z: if len > 0.0 { z(&s) } else { s.z }, ..s }), ..*self }
    }

    /// Of what lies on both sides of an edge that which may be marked; else the higher, and of what meets in the edge
    /// the less steep.
    fn or(self, other: Self) -> Self {
        let (Some(a), Some(b)) = (self.sheet, other.sheet) else {
            return if self.sheet.is_some() { self } else { other };
        };
        let takes_other = match (a.slope == Slope::Steep, b.slope == Slope::Steep) {
            (false, true) => false,
            (true, false) => true,
            _ if (0..2).all(|k| (a.z[k] - b.z[k]).abs() <= MEETS) => b.slope2 < a.slope2,
            _ => b.z[0] + b.z[1] > a.z[0] + a.z[1],
        };
        if takes_other { other } else { self }
    }
}

/// A line in the plane: start, unit direction, length in nm.
#[derive(Clone, Copy, Debug)]
pub(super) struct Line {
    pub(super) start: [f64; 2],
    pub(super) dir: [f64; 2],
    pub(super) len: f64,
}

impl Line {
    /// The line from `a` to `b`, which differ.
    pub(super) fn new(a: [f64; 2], b: [f64; 2]) -> Self {
        let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
        // Axis-parallel lines get exact directions: most hatches are such, and so are most borders.
        let len = if dx == 0.0 || dy == 0.0 { dx.abs() + dy.abs() } else { math::hypot(dx, dy) };
        Self { start: a, dir: [dx / len, dy / len], len }
    }
    /// The point `d` nm from the start.
    pub(super) fn at(&self, d: f64) -> [f64; 2] {
        [self.start[0] + self.dir[0] * d, self.start[1] + self.dir[1] * d]
    }
    /// The part from `d[0]` to `d[1]`, moved sideways to the left by `s`.
    pub(super) fn part(&self, d: [f64; 2], s: f64) -> Self {
        let [x, y] = self.at(d[0]);
        Self { start: [x - self.dir[1] * s, y + self.dir[0] * s], dir: self.dir, len: d[1] - d[0] }
    }
}

/// A facet's crossing of the line, before sheets are compared.
#[derive(Clone, Copy, Debug)]
struct Crossing {
    d: [f64; 2],
    z: [f64; 2],
    slope2: f64,
    grad: [f64; 2],
    /// Square of the slope in the frame of the drawing, where the part is turned; else the same.
    unturned_slope2: f64,
    facet: u32,
}

impl Crossing {
    fn rise(&self) -> f64 {
        (self.z[1] - self.z[0]) / (self.d[1] - self.d[0])
    }
    fn z_at(&self, d: f64) -> f64 {
        if d <= self.d[0] {
            self.z[0]
        } else if d >= self.d[1] {
            self.z[1]
        } else {
            self.z[0] + (d - self.d[0]) * self.rise()
        }
    }
}

/// Buffers that queries reuse.
#[derive(Default)]
pub(super) struct Scratch {
    crossings: Vec<Crossing>,
    /// Per facet the number of the last query that met it.
    seen: Vec<u32>,
    query: u32,
    active: Vec<u32>,
    /// Whether the line that was cut runs along an edge.
    is_along_edge: bool,
}

/// The two forms of a surface.
pub(super) enum Shape {
    Mesh(Mesh),
    Map(Map),
}

impl Shape {
    /// Lowest and highest place, nm.
    fn heights(&self) -> [f64; 2] {
        match self {
            Self::Mesh(mesh) => mesh.heights(),
            Self::Map(map) => map.heights(),
        }
    }

    /// Hands the corners (nm) of all facets to `sink`.
    fn each_facet(&self, sink: &mut dyn FnMut([[f64; 3]; 3])) {
        match self {
            Self::Mesh(mesh) => mesh.each_facet(sink),
            Self::Map(map) => map.each_facet(sink),
        }
    }

    /// Hands the corners (nm) of all facets that touch an area to `sink`.
    fn facets_in(&self, area: BoxNm, sink: &mut dyn FnMut([[f64; 3]; 3])) {
        match self {
            Self::Mesh(mesh) => mesh.facets_in(area, sink),
            Self::Map(map) => map.facets_in(area, sink),
        }
    }
}

/// The surface with the limits by which pieces are judged.
pub(super) struct Geometry {
    shape: Shape,
    /// Slope beyond which nothing is marked.
    limit2: f64,
    weld: f64,
    /// How far a mark may run off its line, nm: on a tilted part.
    beside: f64,
    /// How surely a measured part is known.
    doubt: Option<HeightDoubt>,
}

impl Geometry {
    /// The geometry of a job: `max_incidence_rad` is below a right angle, `weld_nm` is the distance
    /// below which the job lets vertices become one.
    pub(super) fn new(shape: Shape, max_incidence_rad: f64, weld_nm: f64) -> Self {
        Self { shape, limit2: math::tan(max_incidence_rad).powi(2), weld: weld_nm.max(0.0), beside: 0.0, doubt: None }
    }

    /// The geometry as a turned part shows it, under and around an area of the part.
    pub(super) fn turned(&self, turn: &Turn, area: BoxNm) -> Self {
        // A place that hides another from a leaning beam lies beside it by their difference in height times the tangent
        // of the tilt, which is kept finite.
        let [lowest, highest] = self.shape.heights();
        let around = (highest - lowest) * turn.lean() / (1.0 - turn.lean().powi(2)).max(1e-6).sqrt() + 1e5;
        let mut builder = MeshBuilder::new(0.0, 2.0);
        self.shape.facets_in(area.grown(around), &mut |corners| builder.push_turned(corners, turn));
        Self {
            shape: Shape::Mesh(builder.finish()),
            limit2: self.limit2,
            weld: self.weld,
            beside: CHORD_NM,
            doubt: None,
        }
    }

    /// The geometry as a rigid motion takes it. Corners were rounded twice for the job, which counts as welding.
    pub(super) fn moved(&self, pose: &Pose) -> Self {
        let mut builder = MeshBuilder::new(0.0, 2.0);
        self.shape.each_facet(&mut |corners| builder.push_nm(corners.map(|p| pose.apply(p))));
        let shape = Shape::Mesh(builder.finish());
        Self { shape, limit2: self.limit2, weld: self.weld + 1.0, beside: 0.0, doubt: None }
    }

    /// The geometry as a measured part lies: moved, and raised by its correction.
    pub(super) fn measured(&self, pose: &Pose, doubt: HeightDoubt) -> Self {
        let moved = self.moved(pose);
        let Some(correction) = &doubt.correction else { return Self { doubt: Some(doubt), ..moved } };
        let mut builder = MeshBuilder::new(0.0, 2.0);
        let mut add = |corners: [[f64; 3]; 3]| builder.push_nm(corners);
        moved.each_facet(&mut |corners| correction.raised(corners, &mut add));
        let weld = moved.weld + correction::CUT_NM;
        Self { shape: Shape::Mesh(builder.finish()), weld, doubt: Some(doubt), ..moved }
    }

    /// What a mark at a place keeps free above and below it, nm; 0 where the part was not measured.
    pub(super) fn kept(&self, at: [f64; 3], grad: [f64; 2]) -> f64 {
        self.doubt.as_ref().map_or(0.0, |doubt| doubt.kept(at, grad))
    }

    /// Whether marks keep anything free.
    pub(super) fn keeps_free(&self) -> bool {
        self.doubt.as_ref().is_some_and(|doubt| doubt.sigmas > 0.0)
    }

    /// Lowest and highest place, nm.
    pub(super) fn heights(&self) -> [f64; 2] {
        self.shape.heights()
    }

    /// Hands the corners (nm) of all facets to `sink`, walls among them.
    pub(super) fn each_facet(&self, sink: &mut dyn FnMut([[f64; 3]; 3])) {
        self.shape.each_facet(sink);
    }

    /// Hands the corners (nm) of all facets that touch an area to `sink`, walls among them.
    pub(super) fn facets_in(&self, area: BoxNm, sink: &mut dyn FnMut([[f64; 3]; 3])) {
        self.shape.facets_in(area, sink);
    }

    /// How far, in nm, a mark may lie next to an edge and still be taken as on it: the rounding of both to the grid,
    /// the grid step within which the program takes a stroke as lying on a border, and welding.
    pub(super) fn reach(&self) -> f64 {
        ROUNDING + 1.5 + self.weld + self.beside
    }

    /// Lengths up to this, in nm, decide nothing: two edges, each off by rounding and welding, that the line crosses at
    /// 30 degrees, and next to which a mark on a tilted part may run.
    pub(super) fn grain(&self) -> f64 {
        // Two edges, each by 1 / sin 30 deg = 2.
        4.0 * (ROUNDING + 0.5 + self.weld + self.beside)
    }

    /// Whether an edge that lies on a line lies on that of the compiled job as well: corners are not welded, and the
    /// part is not tilted.
    pub(super) fn is_exact(&self) -> bool {
        self.weld == 0.0 && self.beside == 0.0
    }

    /// How far a mark may run off its line, nm; 0 where the part is not tilted.
    pub(super) fn beside(&self) -> f64 {
        self.beside
    }

    /// Cosine of the steepest slope that is marked.
    pub(super) fn least_cos(&self) -> f64 {
        1.0 / (1.0 + self.limit2).sqrt()
    }

    /// How far, in nm, a height may differ from the compiled one on a slope.
    pub(super) fn z_tolerance(&self, slope2: f64) -> f64 {
        let [level, slope] = self.z_tolerance_parts();
        level + slope * slope2.sqrt()
    }

    /// [`Geometry::z_tolerance`] where the geometry is level, and what each unit of slope adds to it, nm.
    pub(super) fn z_tolerance_parts(&self) -> [f64; 2] {
        [1.0 + self.weld, ROUNDING + self.weld]
    }

    /// How far vertices may lie apart that became one, nm.
    pub(super) fn weld(&self) -> f64 {
        self.weld
    }

    /// [`Geometry::z_tolerance`] on the steepest slope that is marked.
    pub(super) fn z_tolerance_at_limit(&self) -> f64 {
        self.z_tolerance(self.limit2)
    }

    /// Calls `visit` with the pieces of `line` in order; returns how many crossings of facets were cut.
    ///
    /// A line along an edge shows neither side of it, but the border of both, and of a closed solid the underside as
    /// well. It is judged by the two lines a [`HAIR`] beside it: what may be marked on one of them, else what is
    /// higher.
    pub(super) fn along(&self, line: &Line, scratch: &mut Scratch, mut visit: impl FnMut(Piece)) -> u64 {
        let cut = self.cut(line, scratch);
        if !scratch.is_along_edge {
            self.pieces(line.len, scratch, visit);
            return cut;
        }
        let [left, right] = [HAIR, -HAIR].map(|side| {
            let mut found = Vec::new();
            self.cut(&line.part([0.0, line.len], side), scratch);
            self.pieces(line.len, scratch, |p| found.push(p));
            found
        });
        let (mut l, mut r, mut at) = (0, 0, 0.0);
        while let (Some(a), Some(b)) = (left.get(l), right.get(r)) {
            let end = a.d[1].min(b.d[1]);
            if end > at {
                let [a, b] = [a, b].map(|p| p.within([at, end]));
                // Where both sides show the same facet, the edge lies elsewhere on the line.
                let facet = |p: &Piece| p.sheet.map(|s| s.facet);
                let is_along_edge = facet(&a) != facet(&b);
                visit(Piece { is_along_edge, ..a.or(b) });
                at = end;
            }
            (l, r) = (l + usize::from(a.d[1] <= end), r + usize::from(b.d[1] <= end));
        }
        cut
    }

    /// Cuts all facets under the line.
    fn cut(&self, line: &Line, scratch: &mut Scratch) -> u64 {
        scratch.crossings.clear();
        scratch.is_along_edge = false;
        match &self.shape {
            Shape::Mesh(mesh) => mesh.crossings(line, scratch),
            Shape::Map(map) => map.crossings(line, scratch),
        }
        scratch.crossings.len() as u64
    }

    /// Hands the topmost of what was cut to `visit`.
    fn pieces(&self, len: f64, scratch: &mut Scratch, mut visit: impl FnMut(Piece)) {
        let Scratch { crossings, active, .. } = scratch;
        topmost::pieces(crossings, active, len, |d, top| {
            let sheet =
                top.map(|(c, z)| Sheet { z, slope2: c.slope2, slope: self.slope(c), grad: c.grad, facet: c.facet });
            visit(Piece { d, sheet, is_along_edge: false });
        });
    }

    /// The pieces that a point may lie on, as far as rounding decides: the piece under it first, then those within the
    /// grain, which is as wide as the gaps that walls leave.
    pub(super) fn around(&self, [x, y]: [f64; 2], scratch: &mut Scratch) -> Vec<Piece> {
        let reach = self.grain();
        let mut out = Vec::new();
        for side in [0.0, reach / 2.0, -reach / 2.0, reach, -reach] {
            let line = Line { start: [x - reach, y + side], dir: [1.0, 0.0], len: 2.0 * reach };
            self.along(&line, scratch, |p| {
                let is_under = side == 0.0 && p.d[0] <= reach && reach <= p.d[1];
                let at = if is_under && !out.is_empty() { 0 } else { out.len() };
                let sheet = p.sheet.map(|s| {
                    // Of the piece under the point the height at the point.
                    let share = if p.len() > 0.0 { (reach - p.d[0]) / p.len() } else { 0.0 };
                    let z = if is_under { [s.z[0] + share * (s.z[1] - s.z[0]); 2] } else { s.z };
                    Sheet { z, ..s }
                });
                out.insert(at, Piece { sheet, ..p });
            });
        }
        out
    }

    /// How far the rounding and welding of a facet's vertices may change its slope.
    pub(super) fn slope_doubt(&self, sheet: &Sheet) -> f64 {
        self.doubt(sheet.facet, sheet.slope2.sqrt())
    }

    /// [`Geometry::slope_doubt`] of a facet of this slope.
    fn doubt(&self, facet: u32, slope: f64) -> f64 {
        let altitude = match &self.shape {
            Shape::Mesh(mesh) => mesh.altitude(facet),
            Shape::Map(map) => map.altitude(),
        };
        // docs/explanation/verify.md states this bound: a vertex that moves in height turns the facet by as much over
        // its altitude, and one that moves in the plane by the slope times that.
        4.0 * (ROUNDING + self.weld) / altitude * (1.0 + slope)
    }

    /// Judges a facet's slope; near the limit by how far the rounding of its vertices may turn it.
    fn slope(&self, c: &Crossing) -> Slope {
        let steepest2 = c.slope2.max(c.unturned_slope2);
        // So far below the limit the altitude of the facet is not looked up.
        if steepest2 < 0.25 * self.limit2 {
            return Slope::Gentle;
        }
        let (slope, limit) = (steepest2.sqrt(), self.limit2.sqrt());
        let doubt = self.doubt(c.facet, slope) + 1e-9 * limit;
        if slope <= limit - doubt {
            Slope::Gentle
        } else if slope <= limit + doubt {
            Slope::Doubtful
        } else {
            Slope::Steep
        }
    }
}

fn nm(mm: f64) -> f64 {
    mm * NM_PER_MM
}

#[cfg(test)]
mod tests;
