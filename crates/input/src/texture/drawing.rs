//! A drawing on the part: placed once, or repeated as tiles over an area.
//!
//! A single drawing is placed, cut at its area and held as points. Tiles form a lattice with the
//! page's pitch that is turned with the page; strokes of tiles wholly inside the area are computed from
//! their index, those of tiles on its border are listed one by one (16 bytes each) and cut on request.

use std::collections::BTreeSet;
use std::sync::Arc;

use super::artwork::Page;
use super::clip::{Polylines, clip, is_inside};
use super::page::{Position, aligned};
use super::place::{SLACK, Site, Turn, far_in, is_near, push};
use super::{Area, ContourAreas, Figure, Kind, MAX_POINTS, Request, too_large};
use terrace_core::diag::{Diag, Error, Place};
use terrace_core::geom::{Box2, BoxMm, P2, Strokes, cos_sin};
use terrace_core::program::PenId;

/// Most strokes on the border of a tiled area.
const MAX_LISTED: usize = 16_000_000;

/// Most points that are looked at to cut border tiles.
const MAX_CUTS: u64 = 1_000_000_000;

/// Most rows of tiles.
const MAX_ROWS: f64 = 1e6;

/// Farthest tile, counted from the origin.
const MAX_TILE: f64 = 1e9;

/// How page mm become part mm.
#[derive(Clone, Copy, Debug)]
pub(super) struct PagePlacement {
    size: [f64; 2],
    origin: [f64; 2],
    /// Cosine and sine of the page's turn about its lower left corner.
    page: [f64; 2],
    /// The part's turn.
    turn: Turn,
}

impl PagePlacement {
    /// The page lies where `position` says, in the area or, without one, in the part's box.
    pub(super) fn new(
        size: [f64; 2],
        position: Position,
        turn_rad: f64,
        area: Option<BoxMm<2>>,
        part_box: BoxMm<2>,
        turn: Turn,
    ) -> Self {
        let mut placed = Self { size, origin: [0.0; 2], page: cos_sin(turn_rad), turn };
        placed.origin = match (position, area) {
            (Position::Origin(origin), _) => origin,
            (Position::Aligned(align), _) => aligned(align, size, area.unwrap_or(part_box), |p| placed.part(p)),
            (Position::Usual, Some(area)) => area.lo,
            (Position::Usual, None) => {
                let middle = placed.part([size[0] / 2.0, size[1] / 2.0]);
                let BoxMm { lo, hi } = part_box;
                [0, 1].map(|k| (lo[k] + hi[k]) / 2.0 - middle[k])
            }
        };
        placed
    }

    /// From the page to the part.
    #[inline]
    pub(super) fn part(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [c, s] = self.page;
        [self.origin[0] + (c * x - s * y), self.origin[1] + (s * x + c * y)]
    }

    /// From the page to the turned part, mm.
    pub(super) fn turned(&self, p: [f64; 2]) -> [f64; 2] {
        self.turn.turned(self.part(p))
    }

    /// From the part to the page.
    fn on_page(&self, p: [f64; 2]) -> [f64; 2] {
        let [c, s] = self.page;
        let [x, y] = [p[0] - self.origin[0], p[1] - self.origin[1]];
        [c * x + s * y, c * y - s * x]
    }

    /// A point of the page in tile (i, j), on the part.
    #[inline]
    fn tile(&self, [x, y]: [f64; 2], i: i64, j: i64) -> [f64; 2] {
        self.part([x + i as f64 * self.size[0], y + j as f64 * self.size[1]])
    }
}

/// Extent of a line of a tile, mm, above which it has two different points wherever its tile lies: a nanometre, and
/// the noise of f64.
const EXTENT: f64 = 1.001e-6;

/// A placed drawing.
#[derive(Debug)]
pub(super) struct Drawing {
    names: Vec<String>,
    /// Per line of the page, or per stroke of a single drawing.
    name_of: Vec<u32>,
    /// The same of pens; None for that of the texture.
    pen_of: Vec<Option<PenId>>,
    layout: Layout,
    placed: PagePlacement,
    bounds: Box2,
    points: u64,
    /// How many strokes of a single drawing are marked before its areas are filled along level lines.
    before: u64,
}

#[derive(Debug)]
enum Layout {
    Single(Strokes),
    Tiled(Tiles),
}

#[derive(Debug)]
struct Tiles {
    placed: PagePlacement,
    area: BoxMm<2>,
    lines: Polylines,
    rows: Vec<TileRow>,
    listed: Vec<BorderStroke>,
    len: u64,
}

/// One row of tiles: listed strokes, tiles wholly inside, listed strokes.
#[derive(Debug)]
struct TileRow {
    /// Index of its first stroke.
    start: u64,
    j: i64,
    /// First tile wholly inside, and how many.
    first: i64,
    inside: u64,
    /// Listed strokes before, from here, and how many; those after follow them.
    listed: usize,
    before: usize,
}

/// A stroke of a tile on the border: piece `piece` of a line.
#[derive(Debug)]
struct BorderStroke {
    tile: i32,
    line: u32,
    piece: u32,
}

/// A stroke of a tiled drawing: its tile (i, j), its line of the page, and the piece of that which the area leaves; no
/// piece where the tile lies wholly inside.
struct TileStroke {
    i: i64,
    j: i64,
    line: usize,
    piece: Option<u32>,
}

impl Figure for Drawing {
    fn len(&self) -> u64 {
        match &self.layout {
            Layout::Single(strokes) => strokes.len() as u64,
            Layout::Tiled(tiles) => tiles.len,
        }
    }

    fn points(&self) -> u64 {
        self.points
    }

    fn bounds(&self) -> Box2 {
        self.bounds
    }

    fn stroke(&self, i: u64, out: &mut Vec<P2>) {
        match &self.layout {
            Layout::Single(strokes) => out.extend_from_slice(strokes.get(i as usize)),
            Layout::Tiled(tiles) => tiles.stroke(i, out),
        }
    }

    fn dot_pens(&self, own: PenId) -> BTreeSet<PenId> {
        let dot_pen = |len: usize, i: usize| (len == 1).then(|| self.pen_of[i].unwrap_or(own));
        match &self.layout {
            Layout::Single(strokes) => strokes.iter().enumerate().filter_map(|(i, s)| dot_pen(s.len(), i)).collect(),
            Layout::Tiled(tiles) => tiles.lines.iter().enumerate().filter_map(|(i, s)| dot_pen(s.len(), i)).collect(),
        }
    }

    fn pen(&self, i: u64) -> Option<PenId> {
        match &self.layout {
            Layout::Single(_) => self.pen_of[i as usize],
            Layout::Tiled(tiles) => self.pen_of[tiles.find(i).line],
        }
    }

    fn element(&self, i: u64) -> String {
        let name = |line: usize| &self.names[self.name_of[line] as usize];
        match &self.layout {
            Layout::Single(_) => name(i as usize).clone(),
            Layout::Tiled(tiles) => {
                let TileStroke { i, j, line, .. } = tiles.find(i);
                format!("{}, tile ({i}, {j})", name(line))
            }
        }
    }
}

impl Drawing {
    /// Places a page as a request of kind drawing says.
    pub(super) fn place(mut page: Page, request: &Request, site: &Site) -> Result<super::PlacedStrokes, Error> {
        let Kind::Drawing { path, position, turn_rad, tile, marking, .. } = &request.kind else {
            unreachable!("a drawing was asked for")
        };
        let limit = (request.area != Area::Unlimited).then_some(site.area);
        let position = position.of_page(page.corner, limit.is_some());
        let placed = PagePlacement::new(page.size, position, *turn_rad, limit, site.part_box, site.turn);
        let file = path.display().to_string();
        if *tile {
            return Ok(super::PlacedStrokes::Figure(Arc::new(Self::tiled(page, &placed, limit, &file)?)));
        }
        let unfilled = std::mem::take(&mut page.unfilled);
        let level_hatch = page.level_hatch;
        let drawing = Self::single(page, &placed, limit, &file)?;
        let Some(phase) = marking.along_contours.filter(|_| !unfilled.is_empty()) else {
            let drawing = if drawing.len() == 0 { Err(outside(&file)) } else { Ok(drawing) };
            return Ok(super::PlacedStrokes::Figure(Arc::new(drawing?)));
        };
        let is_far = |p: &[f64; 2]| !is_near(placed.turned(*p));
        if unfilled.iter().flat_map(|areas| areas.polygons.iter().flatten().flatten()).any(is_far) {
            return Err(far_in(&file).into());
        }
        let areas = ContourAreas::new(drawing, &unfilled, level_hatch, phase, limit, site)?;
        if areas.len() == 0 && areas.lattices().is_empty() {
            return Err(outside(&file).into());
        }
        Ok(super::PlacedStrokes::Areas(Box::new(areas)))
    }

    pub(super) fn placed(&self) -> &PagePlacement {
        &self.placed
    }

    pub(super) fn before(&self) -> u64 {
        self.before
    }

    pub(super) fn name(&self, i: u32) -> &str {
        &self.names[i as usize]
    }

    /// A drawing placed once, cut at `area`; it may hold nothing.
    fn single(page: Page, placed: &PagePlacement, area: Option<BoxMm<2>>, path: &str) -> Result<Self, Error> {
        let mut strokes = Strokes::default();
        let mut name_of = Vec::new();
        let mut pen_of = Vec::new();
        let mut line = Vec::new();
        let mut pieces = Polylines::default();
        let mut before = 0;
        for (k, ((points, &name), &pen)) in page.lines.iter().zip(&page.name_of).zip(&page.pen_of).enumerate() {
            before = if k == page.before { strokes.len() } else { before };
            line.clear();
            line.extend(points.iter().map(|&p| placed.part(p)));
            pieces.clear();
            match area {
                Some(area) => clip(&line, area, &mut pieces),
                None => pieces.push(&line),
            }
            for piece in pieces.iter() {
                if piece.iter().any(|&p| !is_near(placed.turn.turned(p))) {
                    return Err(far_in(path).into());
                }
                if let [dot] = line[..] {
                    strokes.push_dot(placed.turn.nm(dot));
                    name_of.push(name);
                    pen_of.push(pen);
                } else if strokes.push(piece.iter().map(|&p| placed.turn.nm(p))) {
                    name_of.push(name);
                    pen_of.push(pen);
                }
            }
        }
        before = if page.before >= page.lines.len() { strokes.len() } else { before };
        let bounds = strokes.bounds();
        let points = strokes.point_count() as u64;
        Ok(Self {
            names: page.names,
            name_of,
            pen_of,
            layout: Layout::Single(strokes),
            placed: *placed,
            bounds,
            points,
            before: before as u64,
        })
    }

    /// A drawing repeated over `area`.
    fn tiled(page: Page, placed: &PagePlacement, area: Option<BoxMm<2>>, path: &str) -> Result<Self, Error> {
        let Some(area) = area else {
            return Err(Diag::input("texture-tile", "tiling needs an area to fill")
                .at(Place::file(path))
                .hint("add area = \"part\" or area = [x0, y0, x1, y1]")
                .into());
        };
        // Strokes of tiles are counted, not made, so each line must have two points in every tile, or be a dot.
        let mut lines = Polylines::default();
        let mut name_of = Vec::new();
        let mut pen_of = Vec::new();
        for ((line, &name), &pen) in page.lines.iter().zip(&page.name_of).zip(&page.pen_of) {
            let bounds = BoxMm::of(line.iter().map(|&p| placed.turned(p)));
            if line.len() == 1 || bounds.size().iter().any(|&side| side > EXTENT) {
                lines.push(line);
                name_of.push(name);
                pen_of.push(pen);
            }
        }
        let mut drawing = Self {
            names: page.names,
            name_of,
            pen_of,
            layout: Layout::Single(Strokes::default()),
            placed: *placed,
            bounds: Box2::EMPTY,
            points: 0,
            before: 0,
        };
        let mut tiles = Tiles { placed: *placed, area, lines, rows: Vec::new(), listed: Vec::new(), len: 0 };
        let lattice = TileLattice::new(placed, area);
        let extremes = tiles.extremes();
        let mut cuts = 0;
        for j in lattice.rows().ok_or_else(|| Error::from(too_large(u64::MAX, u64::MAX).at(Place::file(path))))? {
            let columns = lattice.columns(j);
            let page_points = tiles.lines.points.len() as u64;
            cuts += columns.on_border() * page_points;
            drawing.points += columns.whole() * page_points;
            if cuts > MAX_CUTS || drawing.points > MAX_POINTS {
                return Err(too_large(tiles.len, drawing.points.max(cuts)).at(Place::file(path)).into());
            }
            drawing.add_row(&mut tiles, j, columns, &extremes);
            if tiles.listed.len() > MAX_LISTED {
                return Err(too_large(tiles.len, drawing.points).at(Place::file(path)).into());
            }
        }
        if tiles.len == 0 {
            return Err(outside(path).into());
        }
        drawing.layout = Layout::Tiled(tiles);
        Ok(drawing)
    }

    /// Adds row `j` to the tiles: strokes of its border tiles are listed, those of tiles inside are counted. `extremes`
    /// are the points of the page that a box of its strokes needs.
    fn add_row(&mut self, tiles: &mut Tiles, j: i64, columns: RowTiles, extremes: &[[f64; 2]]) {
        let whole = columns.whole();
        let RowTiles { touched, inside } = columns;
        let listed = tiles.listed.len();
        (touched.start..inside.start).for_each(|i| self.list(tiles, i, j));
        let before = tiles.listed.len() - listed;
        (inside.end..touched.end).for_each(|i| self.list(tiles, i, j));
        if whole > 0 {
            // All tiles between the outermost ones lie in the box of these.
            for i in [inside.start, inside.end - 1] {
                extremes.iter().for_each(|&p| self.bounds.add(tiles.placed.turn.nm(tiles.placed.tile(p, i, j))));
            }
        }
        tiles.rows.push(TileRow { start: tiles.len, j, first: inside.start, inside: whole, listed, before });
        tiles.len += whole * tiles.lines.len() as u64 + (tiles.listed.len() - listed) as u64;
    }

    /// Lists what lies in the area of tile (i, j), which its border crosses.
    fn list(&mut self, tiles: &mut Tiles, i: i64, j: i64) {
        let tile = i32::try_from(i).expect("fewer than 2^31 tiles of a row");
        let mut pieces = Polylines::default();
        for line in 0..tiles.lines.len() {
            if tiles.listed.len() > MAX_LISTED {
                // The caller refuses the texture; until then memory is kept.
                return;
            }
            pieces.clear();
            tiles.cut(line, i, j, &mut pieces);
            for (piece, points) in pieces.iter().enumerate() {
                // What collapses to a point is not a dot, and not marked.
                let mut places = points.iter().map(|&p| tiles.placed.turn.nm(p));
                let first = places.next();
                if tiles.lines.get(line).len() > 1 && places.all(|p| Some(p) == first) {
                    continue;
                }
                let line = u32::try_from(line).expect("fewer lines than points");
                tiles.listed.push(BorderStroke {
                    tile,
                    line,
                    piece: u32::try_from(piece).expect("fewer pieces than points"),
                });
            }
            self.points += pieces.points.len() as u64;
            pieces.points.iter().for_each(|&p| self.bounds.add(tiles.placed.turn.nm(p)));
        }
    }
}

impl Tiles {
    fn stroke(&self, i: u64, out: &mut Vec<P2>) {
        let TileStroke { i, j, line, piece } = self.find(i);
        let Some(piece) = piece else {
            let nm = |&p: &[f64; 2]| self.placed.turn.nm(self.placed.tile(p, i, j));
            return self.lines.get(line).iter().for_each(|p| push(out, nm(p)));
        };
        let mut pieces = Polylines::default();
        self.cut(line, i, j, &mut pieces);
        pieces.get(piece as usize).iter().for_each(|&p| push(out, self.placed.turn.nm(p)));
    }

    /// Where stroke `i` comes from.
    fn find(&self, i: u64) -> TileStroke {
        let row = &self.rows[self.rows.partition_point(|r| r.start <= i) - 1];
        let k = i - row.start;
        let lines = self.lines.len() as u64;
        let inside = row.inside * lines;
        let before = row.before as u64;
        if k >= before && k < before + inside {
            let k = k - before;
            let i = row.first + (k / lines) as i64;
            return TileStroke { i, j: row.j, line: (k % lines) as usize, piece: None };
        }
        let listed = &self.listed[row.listed + if k < before { k } else { k - inside } as usize];
        TileStroke { i: i64::from(listed.tile), j: row.j, line: listed.line as usize, piece: Some(listed.piece) }
    }

    /// What lies in the area of a line of tile (i, j), in part mm.
    fn cut(&self, line: usize, i: i64, j: i64, pieces: &mut Polylines) {
        let placed: Vec<_> = self.lines.get(line).iter().map(|&p| self.placed.tile(p, i, j)).collect();
        clip(&placed, self.area, pieces);
    }

    /// The points of the page that can lie on the border of its strokes' box, in the turned frame.
    fn extremes(&self) -> Vec<[f64; 2]> {
        let BoxMm { lo, hi } = BoxMm::of(self.lines.points.iter().map(|&p| self.placed.turned(p)));
        // Ten nanometres are far above the noise of f64 and far below any drawing.
        let is_near = |a: f64, b: f64| (a - b).abs() < 1e-5;
        let is_extreme = |&p: &[f64; 2]| {
            let p = self.placed.turned(p);
            (0..2).any(|k| is_near(p[k], lo[k]) || is_near(p[k], hi[k]))
        };
        self.lines.points.iter().copied().filter(is_extreme).collect()
    }
}

fn outside(path: &str) -> Diag {
    Diag::input("texture-empty", "nothing of the drawing lies in the texture's area")
        .at(Place::file(path))
        .hint("check origin, size and area of the texture")
}

/// The area as seen from the page: a convex quadrangle over a grid of unit tiles.
struct TileLattice {
    corners: [[f64; 2]; 4],
    area: BoxMm<2>,
    placed: PagePlacement,
}

/// Indices of rows, or of tiles in a row.
type Span = std::ops::Range<i64>;

/// The tiles of a row, by their index along it.
struct RowTiles {
    /// Those that the area touches.
    touched: Span,
    /// Those among them that lie wholly in it; empty at the end of `touched` where there is none.
    inside: Span,
}

impl RowTiles {
    /// How many tiles lie wholly in the area.
    fn whole(&self) -> u64 {
        (self.inside.end - self.inside.start) as u64
    }

    /// How many tiles the border of the area crosses.
    fn on_border(&self) -> u64 {
        (self.touched.end - self.touched.start - (self.inside.end - self.inside.start)) as u64
    }
}

impl TileLattice {
    fn new(placed: &PagePlacement, area: BoxMm<2>) -> Self {
        let [w, h] = placed.size;
        let corners = area.corners().map(|c| {
            let [x, y] = placed.on_page(c);
            [x / w, y / h]
        });
        Self { corners, area, placed: *placed }
    }

    /// Rows of tiles that the area touches; None where there are too many.
    fn rows(&self) -> Option<Span> {
        let [lo, hi] = self.span(1);
        let is_near = [self.span(0), [lo, hi]].iter().flatten().all(|v| v.abs() < MAX_TILE);
        (is_near && hi - lo < MAX_ROWS).then(|| down(lo)..up(hi))
    }

    /// Tiles of row `j` that the area touches, and among them those that lie wholly in it.
    fn columns(&self, j: i64) -> RowTiles {
        let low = j as f64;
        let high = (j + 1) as f64;
        // The widest extent over the row is taken at its limits or at a corner between them.
        let mut wide = [f64::INFINITY, f64::NEG_INFINITY];
        let limits = [self.across(low), self.across(high)];
        let within = self.corners.iter().filter(|c| low <= c[1] && c[1] <= high).map(|c| [c[0], c[0]]);
        for [a, b] in limits.into_iter().flatten().chain(within) {
            wide = [wide[0].min(a), wide[1].max(b)];
        }
        if wide[0] > wide[1] {
            return RowTiles { touched: 0..0, inside: 0..0 };
        }
        let touched = down(wide[0])..up(wide[1]).max(down(wide[0]));
        let none_inside = touched.end..touched.end;
        let [Some(a), Some(b)] = limits else { return RowTiles { touched, inside: none_inside } };
        // By the limits first, then to the nanometre by the tiles themselves.
        let mut first = touched.start.max(a[0].max(b[0]).floor() as i64 - 1);
        let mut last = touched.end.min(a[1].min(b[1]).ceil() as i64 + 1);
        while first < last && !self.is_whole(first, j) {
            first += 1;
        }
        while first < last && !self.is_whole(last - 1, j) {
            last -= 1;
        }
        let inside = if first < last { first..last } else { none_inside };
        RowTiles { touched, inside }
    }

    fn is_whole(&self, i: i64, j: i64) -> bool {
        let page = BoxMm { lo: [0.0; 2], hi: self.placed.size };
        is_inside(&page.corners().map(|c| self.placed.tile(c, i, j)), self.area)
    }

    /// Extent of the area along the line y = `y`; None where it does not meet it.
    fn across(&self, y: f64) -> Option<[f64; 2]> {
        let [lo, hi] = self.span(1);
        let slack = SLACK * y.abs().max(1.0);
        if y < lo - slack || y > hi + slack {
            return None;
        }
        let y = y.clamp(lo, hi);
        let mut out = [f64::INFINITY, f64::NEG_INFINITY];
        for k in 0..4 {
            let p = self.corners[k];
            let q = self.corners[(k + 1) % 4];
            if (p[1] - y) * (q[1] - y) > 0.0 {
                continue;
            }
            // A side along the line counts with both ends.
            let ts = if p[1] == q[1] { [0.0, 1.0] } else { [(y - p[1]) / (q[1] - p[1]); 2] };
            for t in ts {
                let x = p[0] + t * (q[0] - p[0]);
                out = [out[0].min(x), out[1].max(x)];
            }
        }
        Some(out)
    }

    fn span(&self, axis: usize) -> [f64; 2] {
        let values = self.corners.map(|c| c[axis]);
        [values.into_iter().fold(f64::INFINITY, f64::min), values.into_iter().fold(f64::NEG_INFINITY, f64::max)]
    }
}

/// Floor and ceiling that forgive the noise of a division.
fn down(v: f64) -> i64 {
    (v + SLACK * v.abs().max(1.0)).floor() as i64
}

fn up(v: f64) -> i64 {
    (v - SLACK * v.abs().max(1.0)).ceil() as i64
}
