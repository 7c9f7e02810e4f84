//! The walk over a drawing's entities, inserted blocks within blocks, in drawing order.

use std::collections::HashMap;
use std::f64::consts::TAU;

use super::How;
use super::colour::{BLACK, Paint};
use super::entity::{Entity, Insert, Kind, LineType, Polyline};
use super::file::{File, LAYER_0, Layer};
use super::hatch::{Edge, Fill, Hatch, Path, span};
use super::outline::{Arc, Outline};
use super::pattern::Ruling;
use super::space::{Map, Point, cross, length, times, unit};
use super::tally::{Issue, Tally};
use super::wide::{areas, hairlines};
use crate::texture::artwork::{
    Area, Artwork, Colour, Figure, Labels, MAX_POINTS, Marking, Rule, Shape, Stop, StrokeMode, TooMany,
};
use crate::texture::clip::Lines;
use terrace_core::diag::Diag;

/// Most entities that are drawn, copies by inserts counted one by one.
const MAX_VISITS: u64 = 2_000_000;

/// Most vertices, control points and crossings that are looked at, copies counted: what bounds the time of drawings
/// that are made to cost it without drawing a point.
const MAX_WORK: usize = 20_000_000;

/// Deepest nesting of blocks; drawings made by people stay below 10.
const MAX_DEPTH: usize = 64;

/// What an entity takes from the inserts around it.
#[derive(Clone, Copy)]
struct State {
    /// From its coordinates to mm.
    map: Map,
    /// The layer of entities on layer 0.
    layer: u32,
    /// Colour and dashes of entities that take them from their block.
    colour: Colour,
    is_dashed: bool,
    /// The number of the chain of blocks around it.
    chain: u32,
}

pub(super) struct Walk<'a> {
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

type Done = Result<(), Box<Diag>>;

/// What a drawing came to.
pub(super) struct Walked {
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
pub(super) fn walk(file: &File, unit: f64, how: &How<'_>, lines: Lines) -> Result<Walked, Box<Diag>> {
    let mut walk = Walk {
        file,
        tolerance: how.tolerance,
        widest_line: how.widest_line,
        marking: how.marking,
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
    let state = State { map: Map::scale([unit; 3]), layer: LAYER_0, colour: BLACK, is_dashed: false, chain: 0 };
    walk.entities(&file.entities, state)?;
    Ok(Walked { art: walk.art, tally: walk.tally, z: walk.z })
}

impl<'a> Walk<'a> {
    fn entities(&mut self, entities: &'a [Entity], state: State) -> Done {
        entities.iter().try_for_each(|entity| self.entity(entity, state))
    }

    fn entity(&mut self, entity: &'a Entity, state: State) -> Done {
        self.visit(entity, 1)?;
        let number = if entity.layer == LAYER_0 { state.layer } else { entity.layer };
        let layer = &self.file.layers.list[number as usize];
        if self.is_left_out(entity, state.chain, number) {
            return Ok(());
        }
        // A block whose layer is off shows what lies on other layers.
        let is_off = layer.is_off && !matches!(entity.kind, Kind::Insert(_));
        if entity.is_hidden || layer.is_frozen || is_off {
            self.note(Issue::Hidden, entity);
            return Ok(());
        }
        let (colour, is_dashed) = self.look(entity, layer, state);
        if let Some(name) = self.undefined_line_type(entity, layer) {
            self.tally.add(Issue::LineType, name, || self.file.name(entity));
        }
        let issue = match &entity.kind {
            Kind::Insert(insert) => {
                return self.insert(entity, insert, State { layer: number, colour, is_dashed, ..state });
            }
            Kind::Unread(issue) => Some(*issue),
            kind if self.art.lines.is_spatial() && is_area(kind) => Some(Issue::Area),
            Kind::Hatch(hatch) if hatch.fill == Fill::Gradient => Some(Issue::Gradient),
            _ => None,
        };
        if let Some(issue) = issue {
            self.note(issue, entity);
            return Ok(());
        }
        let first = self.art.lines.len();
        let look = State { layer: number, colour, is_dashed, ..state };
        let drawn = self.spend(entity.kind.size()).and_then(|()| match &entity.kind {
            Kind::Polyline(line) if is_wide(line) => self.wide(entity, line, look),
            _ => self.draw(entity, state.map).map(|figure| self.shape(entity, figure, first, look)),
        });
        drawn.map_err(|stop| self.stopped(stop, entity))?;
        if self.art.lines.len() > first && !layer.is_plotted {
            self.note(Issue::NoPlot, entity);
        }
        Ok(())
    }

    /// Makes a shape of the lines from `first` on, if there are any.
    fn shape(&mut self, entity: &Entity, figure: Figure, first: usize, look: State) {
        if self.art.lines.len() == first {
            return;
        }
        if figure == Figure::Lines {
            self.art.lines.trace_once(first, self.tolerance);
        }
        if look.is_dashed && !matches!(entity.kind, Kind::Hatch(_) | Kind::Solid(_)) {
            self.note(Issue::Dash, entity);
            if self.marking.is_lenient {
                self.art.lines.truncate(first);
                return;
            }
        }
        let shape = Shape {
            name: self.name(entity),
            labels: self.labels(look.chain, look.layer),
            colour: look.colour,
            opacity: 1.0,
            figure,
            lines: first..self.art.lines.len(),
            clip: None,
        };
        self.art.shapes.push(shape);
    }

    /// A polyline of which segments have a width: a line where the job or the spot makes it one; else what has no width
    /// as lines, and the rest as an area over it.
    fn wide(&mut self, entity: &Entity, line: &Polyline, look: State) -> Result<(), Stop> {
        let flat = look.map.after(Map::of_extrusion(entity.extrusion));
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
            self.shape(entity, Figure::Lines, first, look);
            return Ok(());
        }
        for run in hairlines(line) {
            if !self.outline(entity, flat, |out| polyline(&run, out))? {
                self.note(Issue::Bulge, entity);
            }
        }
        self.shape(entity, Figure::Lines, first, look);
        let first = self.art.lines.len();
        if !self.outline(entity, flat, |out| areas(line, out))? {
            self.note(Issue::Width, entity);
        }
        self.shape(entity, Figure::Stroke, first, look);
        Ok(())
    }

    /// Colour of an entity, and whether its line is dashed.
    fn look(&self, entity: &Entity, layer: &Layer, state: State) -> (Colour, bool) {
        let colour = match entity.paint {
            Paint::Colour(colour) => colour,
            Paint::Block => state.colour,
            Paint::Layer => match layer.paint {
                Paint::Colour(colour) => colour,
                _ => BLACK,
            },
        };
        let is_dashed = match entity.line_type {
            LineType::Own(own) => self.file.is_dashed(own),
            LineType::Block => state.is_dashed,
            LineType::Layer => self.file.is_dashed(layer.line_type),
        };
        (colour, is_dashed)
    }

    /// The name of the line type that an entity asks for and the file does not define.
    fn undefined_line_type(&self, entity: &Entity, layer: &Layer) -> Option<&'a str> {
        match entity.line_type {
            _ if !has_line(&entity.kind) => None,
            LineType::Own(own) => self.file.undefined_line_type(own),
            LineType::Layer => self.file.undefined_line_type(layer.line_type),
            // That of the insert, which is reported there.
            LineType::Block => None,
        }
    }

    fn insert(&mut self, entity: &'a Entity, insert: &Insert, state: State) -> Done {
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
        let plane = state.map.after(Map::of_extrusion(entity.extrusion));
        let turn = Map::turn(insert.turn);
        for copy in 0..copies {
            let steps = [(copy % columns) as f64 * insert.steps[0], (copy / columns) as f64 * insert.steps[1], 0.0];
            let shift = turn.after(Map::shift(steps));
            let map = Map::shift(insert.place).after(shift).after(Map::scale(insert.scale));
            let map = plane.after(map).after(Map::shift(block.base.map(|v| -v)));
            if !map.is_finite() {
                return Err(self.stopped(Stop::Far, entity));
            }
            self.entities(&block.entities, State { map, chain, ..state })?;
        }
        self.open.pop();
        Ok(())
    }

    /// Draws an entity into lines; none where its description is faulty.
    fn draw(&mut self, entity: &Entity, map: Map) -> Result<Figure, Stop> {
        let flat = map.after(Map::of_extrusion(entity.extrusion));
        match &entity.kind {
            Kind::Dot(p) => {
                self.outline(entity, map, |out| {
                    out.dot(*p);
                    true
                })?;
            }
            Kind::Line([a, b]) => self.line(entity, map, |out| {
                out.move_to(*a);
                out.line_to(*b);
            })?,
            // A radius that is not positive draws nothing.
            Kind::Arc { radius, .. } if *radius <= 0.0 => self.note(Issue::Fault, entity),
            Kind::Arc { centre, radius, angles } => {
                let r = *radius;
                let [start, by] = angles.map_or([0.0, TAU], |a| {
                    let [from, to] = a.map(f64::to_radians);
                    [from, span(from, to)]
                });
                let arc = Arc { centre: *centre, a: [r, 0.0, 0.0], b: [0.0, r, 0.0], start, by };
                self.line(entity, flat, |out| out.arc(&arc))?;
            }
            Kind::Ellipse { major, ratio, .. } if *ratio == 0.0 || *major == [0.0; 3] => {
                self.note(Issue::Fault, entity)
            }
            Kind::Ellipse { centre, major, ratio, params: [from, to] } => {
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
            Kind::Polyline(line) => {
                let map = if line.is_spatial { map } else { flat };
                if !self.outline(entity, map, |out| polyline(line, out))? {
                    self.note(Issue::Bulge, entity);
                }
            }
            Kind::Spline(spline) => match spline.pieces() {
                Some(pieces) => self.line(entity, map, |out| out.spline(&pieces))?,
                None => self.note(Issue::Fault, entity),
            },
            Kind::Solid(corners) => {
                self.line(entity, flat, |out| ring(corners, out))?;
                return Ok(Figure::Fill(Rule::EvenOdd));
            }
            Kind::Hatch(hatch) => return self.hatch(entity, hatch, flat),
            Kind::Insert(_) | Kind::Unread(_) => {}
        }
        Ok(Figure::Lines)
    }

    fn line(&mut self, entity: &Entity, map: Map, draw: impl FnOnce(&mut Outline<'_>)) -> Result<(), Stop> {
        let draw = |out: &mut Outline<'_>| {
            draw(out);
            true
        };
        self.outline(entity, map, draw).map(|_| ())
    }

    /// Draws lines of an entity; answers as `draw` does.
    fn outline(
        &mut self,
        entity: &Entity,
        map: Map,
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

    fn hatch(&mut self, entity: &Entity, hatch: &Hatch, map: Map) -> Result<Figure, Stop> {
        let mut rings = Lines::default();
        let mut is_sound = true;
        // Where a line meets its boundary at a small angle, an error of the boundary moves its end by more.
        let part = if matches!(hatch.fill, Fill::Pattern(_)) { 10.0 } else { 1.0 };
        for path in hatch.bounds() {
            is_sound &= rings_of(path, map, self.tolerance / part, &mut rings)?;
        }
        let mut texts = Lines::default();
        for path in hatch.text_boxes() {
            is_sound &= rings_of(path, map, self.tolerance / part, &mut texts)?;
        }
        if texts.len() > 0 {
            self.spend(texts.points.len())?;
            match without(&rings, &texts) {
                Ok(open) => rings = open,
                Err(TooMany) => is_sound = false,
            }
        }
        self.spend(rings.points.len())?;
        if rings.points.len() + self.art.lines.points.len() > MAX_POINTS {
            return Err(Stop::Full);
        }
        let families = match &hatch.fill {
            Fill::Pattern(families) => families,
            _ => {
                rings.iter().for_each(|ring| self.art.lines.push(ring));
                if !is_sound || rings.len() == 0 {
                    self.note(Issue::Fault, entity);
                }
                return Ok(Figure::Fill(Rule::EvenOdd));
            }
        };
        let (mut has_dots, origin) = (false, map.at([0.0; 3]));
        is_sound &= !families.is_empty() && rings.len() > 0;
        let flat = |p: Point| [p[0], p[1]];
        for family in families {
            let along = |[x, y]: [f64; 2]| flat(map.along([x, y, 0.0]));
            let base = along(family.base);
            let ruling = Ruling {
                base: [base[0] + origin[0], base[1] + origin[1]],
                direction: along(family.direction),
                offset: along(family.offset),
                dashes: &family.dashes,
            };
            let ruled = ruling.draw(rings.iter(), &mut self.art.lines)?;
            self.spend(rings.points.len() + ruled.crossings)?;
            is_sound &= !ruled.is_faulty;
            has_dots |= ruled.has_dots;
        }
        if has_dots {
            self.note(Issue::Dots, entity);
        }
        if !is_sound {
            self.note(Issue::Fault, entity);
        }
        Ok(Figure::Lines)
    }

    fn visit(&mut self, entity: &Entity, n: u64) -> Done {
        self.visits = self.visits.saturating_add(n);
        if self.visits <= MAX_VISITS {
            return Ok(());
        }
        let name = self.file.name(entity);
        let text = format!("the drawing has more than {MAX_VISITS} entities at {name}, copies by blocks counted");
        Err(Diag::limit("dxf-large", text).hint("draw one copy and tile it, or split the drawing").into())
    }

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
            Kind::Insert(_) => self.marking.excepts(labels),
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

/// Whether line types apply to an entity, or to entities in its block.
fn has_line(kind: &Kind) -> bool {
    !matches!(kind, Kind::Dot(_) | Kind::Solid(_) | Kind::Hatch(_) | Kind::Unread(_))
}

/// Whether an entity is more than a curve.
fn is_area(kind: &Kind) -> bool {
    match kind {
        Kind::Solid(_) | Kind::Hatch(_) => true,
        Kind::Polyline(line) => is_wide(line),
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

fn ring(corners: &[Point; 4], out: &mut Outline<'_>) {
    out.move_to(corners[0]);
    corners[1..].iter().for_each(|&p| out.line_to(p));
    out.close();
}

/// The borders of what rings hold by the rule evenodd, without what other rings go round.
fn without(rings: &Lines, holes: &Lines) -> Result<Lines, TooMany> {
    let filled = Area::new(rings.iter(), Rule::EvenOdd)?.without(&Area::new(holes.iter(), Rule::NonZero)?)?;
    let mut out = Lines::default();
    for contour in filled.contours() {
        out.points.extend(contour.iter().chain(contour.first()));
        out.finish();
    }
    Ok(out)
}

/// The closed lines of a boundary path, in mm; returns whether all its edges could be drawn.
fn rings_of(path: &Path, map: Map, tolerance: f64, rings: &mut Lines) -> Result<bool, Stop> {
    let mut edges = Lines::default();
    let mut is_sound = true;
    for edge in &path.edges {
        let mut out = Outline::new(map, tolerance, &mut edges);
        match edge {
            Edge::Polyline(vertices) => {
                let line = Polyline { vertices: vertices.clone(), is_closed: true, is_spatial: false };
                is_sound &= polyline(&line, &mut out);
            }
            Edge::Line([a, b]) => {
                out.move_to(*a);
                out.line_to(*b);
            }
            Edge::Arc(arc) => out.arc(arc),
            Edge::Spline(spline) => match spline.pieces() {
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
fn join(edges: &Lines, tolerance: f64, rings: &mut Lines) {
    let near = |p: [f64; 2], q: [f64; 2]| (p[0] - q[0]).hypot(p[1] - q[1]) <= tolerance;
    let mut ring: Vec<[f64; 2]> = Vec::new();
    for edge in edges.iter() {
        let (Some(&start), Some(&end)) = (edge.first(), edge.last()) else { continue };
        let (Some(&first), Some(&last)) = (ring.first(), ring.last()) else {
            ring.extend_from_slice(edge);
            continue;
        };
        if ring.len() > 2 && near(first, last) {
            finish(&mut ring, rings);
            ring.extend_from_slice(edge);
        } else if near(last, start) {
            ring.extend_from_slice(&edge[1..]);
        } else if near(last, end) {
            ring.extend(edge.iter().rev().skip(1));
        } else if near(first, end) || near(first, start) {
            ring.reverse();
            if near(first, start) {
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

fn finish(ring: &mut Vec<[f64; 2]>, rings: &mut Lines) {
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
        let mut edges = Lines::default();
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
        let mut rings = Lines::default();
        join(&edges, 1e-9, &mut rings);
        assert_eq!(rings.len(), 2);
        let square = rings.get(0);
        let area: f64 = square.windows(2).map(|w| w[0][0] * w[1][1] - w[1][0] * w[0][1]).sum::<f64>() / 2.0;
        assert_eq!((square.len(), area.abs()), (5, 1.0));
        assert_eq!(rings.get(1), [[5.0, 5.0], [6.0, 5.0], [6.0, 6.0], [7.0, 7.0], [5.0, 5.0]], "a gap is bridged");
    }
}
