//! The walk over a drawing's entities, inserted blocks within blocks, in drawing order.

use std::collections::HashMap;
use std::f64::consts::TAU;
use terrace_core::math;

use super::DxfOptions;
use super::colour::{BLACK, EntityPaint};
use super::entity::{Entity, EntityKind, Insert, LineType, Polyline};
use super::file::{DxfLayer, File, LAYER_0};
use super::hatch::{BoundaryEdge, BoundaryPath, Family, Fill, Hatch, span};
use super::outline::{Arc, Outline};
use super::pattern::Ruling;
use super::space::{SpaceMap, cross, length, times, unit};
use super::tally::{Issue, Tally};
use super::wide::{areas, hairlines};
use crate::texture::artwork::{
    Artwork, Colour, Labels, MAX_POINTS, Marking, PaintedShape, PolygonArea, ShapeFigure, Stop, StrokeMode, TooMany,
    WindingRule,
};
use crate::texture::clip::Polylines;
use terrace_core::diag::Diag;
use terrace_core::geom::SpacePoint;

/// Most entities that are drawn, copies by inserts counted one by one.
const MAX_VISITS: u64 = 2_000_000;

/// Most vertices, control points and crossings that are looked at, copies counted: what bounds the time of drawings
/// that are made to cost it without drawing a point.
const MAX_WORK: usize = 20_000_000;

/// Deepest nesting of blocks; drawings made by people stay below 10.
const MAX_DEPTH: usize = 64;

/// What an entity takes from the inserts around it, or shows itself.
#[derive(Clone, Copy)]
struct InsertState {
    /// From its coordinates to mm.
    map: SpaceMap,
    /// The layer of entities on layer 0.
    layer: u32,
    /// Colour and dashes of entities that take them from their block.
    colour: Colour,
    is_dashed: bool,
    /// The number of the chain of blocks around it.
    chain: u32,
}

pub(super) struct ModelWalk<'a> {
    file: &'a File,
    tolerance: f64,
    widest_line: f64,
    marking: &'a Marking,
    art: Artwork,
    pub(super) tally: Tally,
    /// Lowest and highest point drawn, mm.
    z: [f64; 2],
    visits: u64,
    work: usize,
    /// Blocks that are being inserted right now, from the outside in.
    open: Vec<u32>,
    /// Chains of blocks: the number of the one around it, and the block.
    chains: HashMap<(u32, u32), u32>,
    /// Names of the blocks of each chain.
    blocks_of: Vec<Vec<String>>,
    /// Sets of labels by chain and layer.
    labels: HashMap<(u32, u32), u32>,
    /// Names by the address of their entity in the file.
    names: HashMap<*const Entity, u32>,
}

/// Whether a step of the walk could be done.
type WalkResult = Result<(), Box<Diag>>;

/// What model space shows, and what of it is not drawn.
pub(super) struct DrawnModel {
    pub(super) art: Artwork,
    pub(super) tally: Tally,
    /// Lowest and highest point, mm.
    pub(super) z: [f64; 2],
}

/// Draws all that is visible in model space, in mm, into `lines`, flat or in space; `unit` is the length of a drawing
/// unit.
///
/// # Errors
/// `dxf-cycle`, `dxf-large`, `texture-far`, `texture-large`.
pub(super) fn walk(
    file: &File,
    unit: f64,
    options: &DxfOptions<'_>,
    lines: Polylines,
) -> Result<DrawnModel, Box<Diag>> {
    let mut walk = ModelWalk {
        file,
        tolerance: options.tolerance,
        widest_line: options.widest_line,
        marking: options.marking,
        art: Artwork { lines, ..Artwork::default() },
        tally: Tally::default(),
        z: [f64::INFINITY, f64::NEG_INFINITY],
        visits: 0,
        work: 0,
        open: Vec::new(),
        chains: HashMap::new(),
        blocks_of: vec![Vec::new()],
        labels: HashMap::new(),
        names: HashMap::new(),
    };
    let state =
        InsertState { map: SpaceMap::scale([unit; 3]), layer: LAYER_0, colour: BLACK, is_dashed: false, chain: 0 };
    walk.entities(&file.entities, state)?;
    Ok(DrawnModel { art: walk.art, tally: walk.tally, z: walk.z })
}

impl<'a> ModelWalk<'a> {
    fn entities(&mut self, entities: &'a [Entity], state: InsertState) -> WalkResult {
        entities.iter().try_for_each(|entity| self.entity(entity, state))
    }

    fn entity(&mut self, entity: &'a Entity, state: InsertState) -> WalkResult {
        self.visit(entity, 1)?;
        let number = if entity.layer == LAYER_0 { state.layer } else { entity.layer };
        let layer = &self.file.layers.list[number as usize];
        if self.is_left_out(entity, state.chain, number) {
            return Ok(());
        }
        // A block whose layer is off shows what lies on other layers.
        let is_off = layer.is_off && !matches!(entity.kind, EntityKind::Insert(_));
        if entity.is_hidden || layer.is_frozen || is_off {
            self.note(Issue::Hidden, entity);
            return Ok(());
        }
        // What the entity itself is drawn with.
        let own = self.own_state(entity, layer, InsertState { layer: number, ..state });
        if let Some(name) = self.undefined_line_type(entity, layer) {
            self.tally.add(Issue::LineType, name, || self.file.name(entity));
        }
        let issue = match &entity.kind {
            EntityKind::Insert(insert) => {
                return self.insert(entity, insert, own);
            }
            EntityKind::Unread(issue) => Some(*issue),
            kind if self.art.lines.is_spatial() && is_area(kind) => Some(Issue::Area),
            EntityKind::Hatch(hatch) if hatch.fill == Fill::Gradient => Some(Issue::Gradient),
            _ => None,
        };
        if let Some(issue) = issue {
            self.note(issue, entity);
            return Ok(());
        }
        let first = self.art.lines.len();
        let drawn = self.spend(entity.kind.size()).and_then(|()| match &entity.kind {
            EntityKind::Polyline(line) if is_wide(line) => self.wide(entity, line, own),
            _ => self.draw(entity, state.map).map(|figure| self.shape(entity, figure, first, own)),
        });
        drawn.map_err(|stop| self.stopped(stop, entity))?;
        if self.art.lines.len() > first && !layer.is_plotted {
            self.note(Issue::NoPlot, entity);
        }
        Ok(())
    }

    /// Makes a shape of the lines from `first` on, if there are any.
    fn shape(&mut self, entity: &Entity, figure: ShapeFigure, first: usize, own: InsertState) {
        if self.art.lines.len() == first {
            return;
        }
        if figure == ShapeFigure::Lines {
            self.art.lines.trace_once(first, self.tolerance);
        }
        if own.is_dashed && !matches!(entity.kind, EntityKind::Hatch(_) | EntityKind::Solid(_)) {
            self.note(Issue::Dash, entity);
            if self.marking.is_lenient {
                self.art.lines.truncate(first);
                return;
            }
        }
        let shape = PaintedShape {
            name: self.name(entity),
            labels: self.labels(own.chain, own.layer),
            colour: own.colour,
            opacity: 1.0,
            figure,
            lines: first..self.art.lines.len(),
            clip: None,
        };
        self.art.shapes.push(shape);
    }

    /// A polyline of which segments have a width: a line where the job or the spot makes it one; else what has no width
    /// as lines, and the rest as an area over it.
    fn wide(&mut self, entity: &Entity, line: &Polyline, own: InsertState) -> Result<(), Stop> {
        let flat = own.map.after(SpaceMap::of_extrusion(entity.extrusion));
        let first = self.art.lines.len();
        let widest = || line.vertices.iter().flat_map(|v| v.widths).fold(0.0, |w: f64, width| w.max(width.abs()));
        let is_line = match self.marking.stroke {
            StrokeMode::Centre => true,
            StrokeMode::Shown => widest() * flat.enlarges() <= self.widest_line,
            StrokeMode::Outline | StrokeMode::Hatch => false,
        };
        if is_line {
            if !self.outline(entity, flat, |out| polyline(line, out))? {
                self.note(Issue::Bulge, entity);
            }
            self.shape(entity, ShapeFigure::Lines, first, own);
            return Ok(());
        }
        for run in hairlines(line) {
            if !self.outline(entity, flat, |out| polyline(&run, out))? {
                self.note(Issue::Bulge, entity);
            }
        }
        self.shape(entity, ShapeFigure::Lines, first, own);
        let first = self.art.lines.len();
        if !self.outline(entity, flat, |out| areas(line, out))? {
            self.note(Issue::Width, entity);
        }
        self.shape(entity, ShapeFigure::Stroke, first, own);
        Ok(())
    }

    /// The state with the colour of an entity, and whether its line is dashed.
    fn own_state(&self, entity: &Entity, layer: &DxfLayer, state: InsertState) -> InsertState {
        let colour = match entity.paint {
            EntityPaint::Colour(colour) => colour,
            EntityPaint::Block => state.colour,
            EntityPaint::Layer => match layer.paint {
                EntityPaint::Colour(colour) => colour,
                _ => BLACK,
            },
        };
        let is_dashed = match entity.line_type {
            LineType::Own(own) => self.file.is_dashed(own),
            LineType::Block => state.is_dashed,
            LineType::Layer => self.file.is_dashed(layer.line_type),
        };
        InsertState { colour, is_dashed, ..state }
    }

    /// The name of the line type that an entity asks for and the file does not define.
    fn undefined_line_type(&self, entity: &Entity, layer: &DxfLayer) -> Option<&'a str> {
        match entity.line_type {
            _ if !has_line(&entity.kind) => None,
            LineType::Own(own) => self.file.undefined_line_type(own),
            LineType::Layer => self.file.undefined_line_type(layer.line_type),
            // That of the insert, which is reported there.
            LineType::Block => None,
        }
    }

    fn insert(&mut self, entity: &'a Entity, insert: &Insert, state: InsertState) -> WalkResult {
        let file = self.file;
        let block = &file.blocks.list[insert.block as usize];
        if !block.is_here {
            self.note(Issue::Block, entity);
            return Ok(());
        }
        if self.open.contains(&insert.block) || self.open.len() >= MAX_DEPTH {
            let name = file.name(entity);
            let text = if self.open.contains(&insert.block) {
                format!("block {:?} inserts itself, by {name}", block.name)
            } else {
                format!("blocks are nested deeper than {MAX_DEPTH} at {name}")
            };
            return Err(Diag::input("dxf-cycle", text).hint("explode the blocks in the drawing program").into());
        }
        let [columns, rows] = insert.counts;
        let copies = columns.saturating_mul(rows);
        self.visit(entity, copies)?;
        self.open.push(insert.block);
        let chain = self.chain(state.chain, insert.block);
        let plane = state.map.after(SpaceMap::of_extrusion(entity.extrusion));
        let turn = SpaceMap::turn(insert.turn);
        for copy in 0..copies {
            let steps = [(copy % columns) as f64 * insert.steps[0], (copy / columns) as f64 * insert.steps[1], 0.0];
            let shift = turn.after(SpaceMap::shift(steps));
            let map = SpaceMap::shift(insert.place).after(shift).after(SpaceMap::scale(insert.scale));
            let map = plane.after(map).after(SpaceMap::shift(block.base.map(|v| -v)));
            if !map.is_finite() {
                return Err(self.stopped(Stop::Far, entity));
            }
            self.entities(&block.entities, InsertState { map, chain, ..state })?;
        }
        self.open.pop();
        Ok(())
    }

    /// Draws an entity into lines; none where its description is faulty.
    fn draw(&mut self, entity: &Entity, map: SpaceMap) -> Result<ShapeFigure, Stop> {
        let flat = map.after(SpaceMap::of_extrusion(entity.extrusion));
        match &entity.kind {
            EntityKind::Dot(p) => {
                self.outline(entity, map, |out| {
                    out.dot(*p);
                    true
                })?;
            }
            EntityKind::Line([a, b]) => self.line(entity, map, |out| {
                out.move_to(*a);
                out.line_to(*b);
            })?,
            // A radius that is not positive draws nothing.
            EntityKind::Arc { radius, .. } if *radius <= 0.0 => self.note(Issue::Fault, entity),
            EntityKind::Arc { centre, radius, angles } => {
                let r = *radius;
                let [start, by] = angles.map_or([0.0, TAU], |a| {
                    let [from, to] = a.map(f64::to_radians);
                    [from, span(from, to)]
                });
                let arc = Arc { centre: *centre, a: [r, 0.0, 0.0], b: [0.0, r, 0.0], start, by };
                self.line(entity, flat, |out| out.arc(&arc))?;
            }
            EntityKind::Ellipse { major, ratio, .. } if *ratio == 0.0 || *major == [0.0; 3] => {
                self.note(Issue::Fault, entity)
            }
            EntityKind::Ellipse { centre, major, ratio, params: [from, to] } => {
                let normal = unit(entity.extrusion).unwrap_or(super::space::Z);
                let minor = unit(cross(normal, *major)).unwrap_or_default();
                let arc = Arc {
                    centre: *centre,
                    a: *major,
                    b: times(minor, length(*major) * *ratio),
                    start: *from,
                    by: span(*from, *to),
                };
                self.line(entity, map, |out| out.arc(&arc))?;
            }
            EntityKind::Polyline(line) => {
                let map = if line.is_spatial { map } else { flat };
                if !self.outline(entity, map, |out| polyline(line, out))? {
                    self.note(Issue::Bulge, entity);
                }
            }
            EntityKind::Spline(spline) => match spline.pieces() {
                Some(pieces) => self.line(entity, map, |out| out.spline(&pieces))?,
                None => self.note(Issue::Fault, entity),
            },
            EntityKind::Solid(corners) => {
                self.line(entity, flat, |out| ring(corners, out))?;
                return Ok(ShapeFigure::Fill(WindingRule::EvenOdd));
            }
            EntityKind::Hatch(hatch) => return self.hatch(entity, hatch, flat),
            EntityKind::Insert(_) | EntityKind::Unread(_) => {}
        }
        Ok(ShapeFigure::Lines)
    }

    /// Draws lines of an entity whose description is not faulty.
    fn line(&mut self, entity: &Entity, map: SpaceMap, draw: impl FnOnce(&mut Outline<'_>)) -> Result<(), Stop> {
        self.outline(entity, map, |out| {
            draw(out);
            true
        })
        .map(|_| ())
    }

    /// Draws lines of an entity; answers as `draw` does.
    fn outline(
        &mut self,
        entity: &Entity,
        map: SpaceMap,
        draw: impl FnOnce(&mut Outline<'_>) -> bool,
    ) -> Result<bool, Stop> {
        let mut out = Outline::new(map, self.tolerance, &mut self.art.lines);
        let is_sound = draw(&mut out);
        let drawn = out.end()?;
        self.z = [self.z[0].min(drawn.z[0]), self.z[1].max(drawn.z[1])];
        if drawn.has_dots {
            self.note(Issue::Dot, entity);
        }
        Ok(is_sound)
    }

    /// Draws a hatch: the rings of its area, or the lines of its pattern in it.
    fn hatch(&mut self, entity: &Entity, hatch: &Hatch, map: SpaceMap) -> Result<ShapeFigure, Stop> {
        let HatchBoundary { rings, mut is_sound } = self.hatch_boundary(hatch, map)?;
        is_sound &= rings.len() > 0;
        let figure = match &hatch.fill {
            Fill::Pattern(families) => {
                is_sound &= !families.is_empty();
                is_sound &= self.pattern_lines(entity, families, &rings, map)?;
                ShapeFigure::Lines
            }
            _ => {
                rings.iter().for_each(|ring| self.art.lines.push(ring));
                ShapeFigure::Fill(WindingRule::EvenOdd)
            }
        };
        if !is_sound {
            self.note(Issue::Fault, entity);
        }
        Ok(figure)
    }

    /// The boundary of a hatch, without the boxes of texts in it.
    fn hatch_boundary(&mut self, hatch: &Hatch, map: SpaceMap) -> Result<HatchBoundary, Stop> {
        // Where a line meets its boundary at a small angle, an error of the boundary moves its end by more.
        let part = if matches!(hatch.fill, Fill::Pattern(_)) { 10.0 } else { 1.0 };
        let mut rings = Polylines::default();
        let mut is_sound = true;
        for path in hatch.bounds() {
            is_sound &= rings_of(path, map, self.tolerance / part, &mut rings)?;
        }
        let mut texts = Polylines::default();
        for path in hatch.text_boxes() {
            is_sound &= rings_of(path, map, self.tolerance / part, &mut texts)?;
        }
        if texts.len() > 0 {
            self.spend(texts.points.len())?;
            match without(&rings, &texts) {
                Ok(around_texts) => rings = around_texts,
                Err(TooMany) => is_sound = false,
            }
        }
        self.spend(rings.points.len())?;
        if rings.points.len() + self.art.lines.points.len() > MAX_POINTS {
            return Err(Stop::Full);
        }
        Ok(HatchBoundary { rings, is_sound })
    }

    /// Draws the lines of a hatch pattern; returns whether all of its families could be drawn.
    fn pattern_lines(
        &mut self,
        entity: &Entity,
        families: &[Family],
        rings: &Polylines,
        map: SpaceMap,
    ) -> Result<bool, Stop> {
        let origin = map.at([0.0; 3]);
        let along = |[x, y]: [f64; 2]| {
            let p = map.along([x, y, 0.0]);
            [p[0], p[1]]
        };
        let mut is_sound = true;
        let mut has_dots = false;
        for family in families {
            let base = along(family.base);
            let ruling = Ruling {
                base: [base[0] + origin[0], base[1] + origin[1]],
                direction: along(family.direction),
                offset: along(family.offset),
                dashes: &family.dashes,
            };
            let report = ruling.draw(rings.iter(), &mut self.art.lines)?;
            self.spend(rings.points.len() + report.crossings)?;
            is_sound &= !report.is_faulty;
            has_dots |= report.has_dots;
        }
        if has_dots {
            self.note(Issue::Dots, entity);
        }
        Ok(is_sound)
    }

    /// Counts entities that are looked at.
    fn visit(&mut self, entity: &Entity, n: u64) -> WalkResult {
        self.visits = self.visits.saturating_add(n);
        if self.visits <= MAX_VISITS {
            return Ok(());
        }
        let name = self.file.name(entity);
        let text = format!("the drawing has more than {MAX_VISITS} entities at {name}, copies by blocks counted");
        Err(Diag::limit("dxf-large", text).hint("draw one copy and tile it, or split the drawing").into())
    }

    /// Counts vertices, control points and crossings that are looked at.
    fn spend(&mut self, work: usize) -> Result<(), Stop> {
        self.work = self.work.saturating_add(work);
        if self.work > MAX_WORK { Err(Stop::Full) } else { Ok(()) }
    }

    fn stopped(&self, stop: Stop, entity: &Entity) -> Box<Diag> {
        let name = self.file.name(entity);
        Box::new(match stop {
            Stop::Far => Diag::input("texture-far", format!("{name} reaches beyond any part"))
                .hint("check its coordinates, the scales of its blocks and the unit of the drawing"),
            Stop::Full => {
                let text = format!("the drawing has more than {MAX_POINTS} points, or costs as much, at {name}");
                Diag::limit("texture-large", text).hint("use a larger tolerance or a simpler drawing")
            }
        })
    }

    fn note(&mut self, issue: Issue, entity: &Entity) {
        self.tally.add(issue, self.file.type_of(entity), || self.file.name(entity));
    }

    /// The place of the entity's name among the names.
    fn name(&mut self, entity: &Entity) -> u32 {
        *self.names.entry(std::ptr::from_ref(entity)).or_insert_with(|| {
            self.art.names.push(self.file.name(entity));
            u32::try_from(self.art.names.len() - 1).expect("fewer entities than visits")
        })
    }

    /// The number of the chain of blocks that an insert adds one to.
    fn chain(&mut self, around: u32, block: u32) -> u32 {
        *self.chains.entry((around, block)).or_insert_with(|| {
            let mut blocks = self.blocks_of[around as usize].clone();
            blocks.push(format!("block:{}", self.file.blocks.list[block as usize].name));
            self.blocks_of.push(blocks);
            u32::try_from(self.blocks_of.len() - 1).expect("fewer chains than visits")
        })
    }

    /// Whether the job leaves out an entity by its layer and its blocks.
    fn is_left_out(&mut self, entity: &Entity, chain: u32, layer: u32) -> bool {
        if !self.marking.chooses() {
            return false;
        }
        let labels = self.labels(chain, layer);
        let labels = self.art.labels(labels);
        match entity.kind {
            EntityKind::Insert(_) => self.marking.excepts(labels),
            _ => self.marking.leaves_out(labels),
        }
    }

    /// The place of a set of labels among all sets.
    fn labels(&mut self, chain: u32, layer: u32) -> u32 {
        *self.labels.entry((chain, layer)).or_insert_with(|| {
            let mut set = vec![format!("layer:{}", self.file.layers.list[layer as usize].name)];
            set.extend_from_slice(&self.blocks_of[chain as usize]);
            self.art.labels.push(Labels { parent: None, own: set });
            u32::try_from(self.art.labels.len() - 1).expect("fewer sets than visits")
        })
    }
}

/// The boundary of a hatch as closed lines, mm.
struct HatchBoundary {
    rings: Polylines,
    /// Whether all of its edges could be drawn, and all texts left out.
    is_sound: bool,
}

/// Whether line types apply to an entity, or to entities in its block.
fn has_line(kind: &EntityKind) -> bool {
    !matches!(kind, EntityKind::Dot(_) | EntityKind::Solid(_) | EntityKind::Hatch(_) | EntityKind::Unread(_))
}

/// Whether an entity is more than a curve.
fn is_area(kind: &EntityKind) -> bool {
    match kind {
        EntityKind::Solid(_) | EntityKind::Hatch(_) => true,
        EntityKind::Polyline(line) => is_wide(line),
        _ => false,
    }
}

/// Whether a segment has a width.
fn is_wide(line: &Polyline) -> bool {
    let ends = line.vertices.len().saturating_sub(usize::from(!line.is_closed));
    line.vertices[..ends].iter().any(|v| v.widths != [0.0; 2])
}

fn polyline(line: &Polyline, out: &mut Outline<'_>) -> bool {
    let Some(first) = line.vertices.first() else { return true };
    out.move_to(first.p);
    let mut is_sound = true;
    let mut bulge = first.bulge;
    for v in &line.vertices[1..] {
        is_sound &= out.bulge_to(v.p, bulge);
        bulge = v.bulge;
    }
    if line.is_closed && line.vertices.len() > 1 {
        is_sound &= out.bulge_to(first.p, bulge);
    }
    is_sound
}

fn ring(corners: &[SpacePoint; 4], out: &mut Outline<'_>) {
    out.move_to(corners[0]);
    corners[1..].iter().for_each(|&p| out.line_to(p));
    out.close();
}

/// The borders of what rings hold by the rule evenodd, without what other rings go round.
fn without(rings: &Polylines, holes: &Polylines) -> Result<Polylines, TooMany> {
    let filled = PolygonArea::new(rings.iter(), WindingRule::EvenOdd)?
        .without(&PolygonArea::new(holes.iter(), WindingRule::NonZero)?)?;
    let mut out = Polylines::default();
    for contour in filled.contours() {
        out.points.extend(contour.iter().chain(contour.first()));
        out.finish();
    }
    Ok(out)
}

/// The closed lines of a boundary path, in mm; returns whether all its edges could be drawn.
fn rings_of(path: &BoundaryPath, map: SpaceMap, tolerance: f64, rings: &mut Polylines) -> Result<bool, Stop> {
    let mut edges = Polylines::default();
    let mut is_sound = true;
    for edge in &path.edges {
        let mut out = Outline::new(map, tolerance, &mut edges);
        match edge {
            BoundaryEdge::Polyline(vertices) => {
                let line = Polyline { vertices: vertices.clone(), is_closed: true, is_spatial: false };
                is_sound &= polyline(&line, &mut out);
            }
            BoundaryEdge::Line([a, b]) => {
                out.move_to(*a);
                out.line_to(*b);
            }
            BoundaryEdge::Arc(arc) => out.arc(arc),
            BoundaryEdge::Spline(spline) => match spline.pieces() {
                Some(pieces) => out.spline(&pieces),
                None => is_sound = false,
            },
        }
        out.end()?;
    }
    join(&edges, tolerance, rings);
    Ok(is_sound)
}

/// Joins edges end to end to closed rings, each edge turned as it fits. An edge that fits nowhere begins a new ring
/// where the last one is closed, and else follows over a straight line.
fn join(edges: &Polylines, tolerance: f64, rings: &mut Polylines) {
    let is_near = |p: [f64; 2], q: [f64; 2]| math::hypot(p[0] - q[0], p[1] - q[1]) <= tolerance;
    let mut ring: Vec<[f64; 2]> = Vec::new();
    for edge in edges.iter() {
        let (Some(&start), Some(&end)) = (edge.first(), edge.last()) else { continue };
        let (Some(&first), Some(&last)) = (ring.first(), ring.last()) else {
            ring.extend_from_slice(edge);
            continue;
        };
        if ring.len() > 2 && is_near(first, last) {
            finish(&mut ring, rings);
            ring.extend_from_slice(edge);
        } else if is_near(last, start) {
            ring.extend_from_slice(&edge[1..]);
        } else if is_near(last, end) {
            ring.extend(edge.iter().rev().skip(1));
        } else if is_near(first, end) || is_near(first, start) {
            ring.reverse();
            if is_near(first, start) {
                ring.extend_from_slice(&edge[1..]);
            } else {
                ring.extend(edge.iter().rev().skip(1));
            }
        } else {
            ring.extend_from_slice(edge);
        }
    }
    finish(&mut ring, rings);
}

/// Closes a ring of three points or more and appends it; less of a ring is dropped.
fn finish(ring: &mut Vec<[f64; 2]>, rings: &mut Polylines) {
    if let Some(&first) = ring.first().filter(|_| ring.len() > 2) {
        if ring.last() != Some(&first) {
            ring.push(first);
        }
        rings.push(ring);
    }
    ring.clear();
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edges_are_joined_whichever_way_they_run() {
        let mut edges = Polylines::default();
        for edge in [
            [[0.0, 0.0], [1.0, 0.0]],
            [[1.0, 1.0], [1.0, 0.0]],
            [[0.0, 1.0], [0.0, 0.0]],
            [[1.0, 1.0], [0.0, 1.0]],
            [[5.0, 5.0], [6.0, 5.0]],
            [[6.0, 6.0], [7.0, 7.0]],
        ] {
            edges.push(&edge);
        }
        let mut rings = Polylines::default();
        join(&edges, 1e-9, &mut rings);
        assert_eq!(rings.len(), 2);
        let square = rings.get(0);
        let area: f64 = square.windows(2).map(|w| w[0][0] * w[1][1] - w[1][0] * w[0][1]).sum::<f64>() / 2.0;
        assert_eq!((square.len(), area.abs()), (5, 1.0));
        assert_eq!(rings.get(1), [[5.0, 5.0], [6.0, 5.0], [6.0, 6.0], [7.0, 7.0], [5.0, 5.0]], "a gap is bridged");
    }
}
