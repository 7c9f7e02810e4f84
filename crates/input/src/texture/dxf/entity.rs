//! Entities as they are defined: numbers are finite, nothing is mapped or flattened yet.

use super::colour::EntityPaint;
use super::hatch::{BoundaryEdge, Hatch};
use super::outline::Vertex;
use super::record::Record;
use super::space::Z;
use super::spline::Spline;
use super::tags::{Fault, Tag, TagPlace};
use super::tally::Issue;
use terrace_core::geom::SpacePoint;

/// A line type as an entity or layer gives it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum LineType {
    Layer,
    Block,
    /// The number of the line type among those of the file.
    Own(u32),
}

#[derive(Debug)]
pub(super) struct Entity {
    pub(super) kind: EntityKind,
    /// The number of its type's name.
    pub(super) what: u16,
    pub(super) handle: Option<u64>,
    pub(super) at: TagPlace,
    pub(super) layer: u32,
    pub(super) paint: EntityPaint,
    pub(super) line_type: LineType,
    pub(super) is_hidden: bool,
    pub(super) extrusion: SpacePoint,
}

#[derive(Debug)]
pub(super) enum EntityKind {
    Line([SpacePoint; 2]),
    Dot(SpacePoint),
    /// An arc, counter-clockwise between angles in degrees; without them a circle.
    Arc {
        centre: SpacePoint,
        radius: f64,
        angles: Option<[f64; 2]>,
    },
    Ellipse {
        centre: SpacePoint,
        major: SpacePoint,
        ratio: f64,
        params: [f64; 2],
    },
    Polyline(Polyline),
    Spline(Box<Spline>),
    /// In the order round it.
    Solid([SpacePoint; 4]),
    Hatch(Box<Hatch>),
    Insert(Box<Insert>),
    /// What is counted, not drawn.
    Unread(Issue),
}

impl EntityKind {
    /// What it costs to draw it at least, in points.
    pub(super) fn size(&self) -> usize {
        match self {
            Self::Polyline(line) => line.vertices.len(),
            Self::Spline(spline) => spline_size(spline),
            Self::Hatch(hatch) => hatch
                .paths
                .iter()
                .flat_map(|p| &p.edges)
                .map(|edge| match edge {
                    BoundaryEdge::Polyline(vertices) => vertices.len(),
                    BoundaryEdge::Spline(spline) => spline_size(spline),
                    BoundaryEdge::Line(_) | BoundaryEdge::Arc(_) => 1,
                })
                .sum(),
            _ => 1,
        }
    }
}

/// What it costs to draw a spline at least, in points. Of a span every Bézier point takes a triangle of de Boor's
/// steps, so control points cost the cube of the degree. A degree that is not read costs no more than one of 99.
fn spline_size(spline: &Spline) -> usize {
    spline.fit.len() + spline.control.len() * (spline.degree + 1).min(100).pow(3) / 8
}

#[derive(Debug, Default)]
pub(super) struct Polyline {
    pub(super) vertices: Vec<Vertex>,
    pub(super) is_closed: bool,
    /// Whether its points are those of space, not of a plane.
    pub(super) is_spatial: bool,
}

#[derive(Debug)]
pub(super) struct Insert {
    /// The number of its block.
    pub(super) block: u32,
    pub(super) place: SpacePoint,
    pub(super) scale: SpacePoint,
    /// Degrees.
    pub(super) turn: f64,
    /// Columns and rows of an array, at least 1.
    pub(super) counts: [u64; 2],
    pub(super) steps: [f64; 2],
}

/// What a record of an entity draws; `block` numbers the blocks by their names.
///
/// # Errors
/// `dxf-number`.
pub(super) fn kind(r: &Record<'_, '_>, block: impl FnOnce(&str) -> u32) -> Result<EntityKind, Fault> {
    Ok(match r.kind {
        b"LINE" => EntityKind::Line([r.place(10)?, r.place(11)?]),
        b"POINT" => EntityKind::Dot(r.place(10)?),
        b"CIRCLE" => EntityKind::Arc { centre: r.place(10)?, radius: r.real(40)?.unwrap_or(0.0), angles: None },
        b"ARC" => {
            let angles = [r.real(50)?.unwrap_or(0.0), r.real(51)?.unwrap_or(360.0)];
            EntityKind::Arc { centre: r.place(10)?, radius: r.real(40)?.unwrap_or(0.0), angles: Some(angles) }
        }
        b"ELLIPSE" => {
            let params = [r.real(41)?.unwrap_or(0.0), r.real(42)?.unwrap_or(std::f64::consts::TAU)];
            EntityKind::Ellipse { centre: r.place(10)?, major: r.place(11)?, ratio: r.real(40)?.unwrap_or(1.0), params }
        }
        b"LWPOLYLINE" => EntityKind::Polyline(light_polyline(r)?),
        b"POLYLINE" if r.has(70, 16 | 64)? => EntityKind::Unread(Issue::Mesh),
        b"POLYLINE" => EntityKind::Polyline(Polyline {
            is_closed: r.has(70, 1)?,
            is_spatial: r.has(70, 8)?,
            ..Polyline::default()
        }),
        b"SPLINE" => EntityKind::Spline(Box::new(spline(r)?)),
        b"SOLID" | b"TRACE" => {
            let [a, b, c] = [r.place(10)?, r.place(11)?, r.place(12)?];
            let d = r.point(13)?.unwrap_or(c);
            EntityKind::Solid([a, b, d, c])
        }
        b"HATCH" => EntityKind::Hatch(Box::new(Hatch::of(r)?)),
        b"INSERT" => EntityKind::Insert(Box::new(insert(r, block)?)),
        other => EntityKind::Unread(Issue::of_kind(other)),
    })
}

fn light_polyline(r: &Record<'_, '_>) -> Result<Polyline, Fault> {
    let height = r.real(38)?.unwrap_or(0.0);
    let width = r.real(43)?.unwrap_or(0.0);
    let mut vertices: Vec<Vertex> = Vec::new();
    for tag in r.tags {
        if tag.code == 10 {
            vertices.push(Vertex { p: [tag.real()?, 0.0, height], bulge: 0.0, widths: [width; 2] });
            continue;
        }
        let Some(last) = vertices.last_mut() else { continue };
        match tag.code {
            20 => last.p[1] = tag.real()?,
            40 => last.widths[0] = tag.real()?,
            41 => last.widths[1] = tag.real()?,
            42 => last.bulge = tag.real()?,
            _ => {}
        }
    }
    Ok(Polyline { vertices, is_closed: r.has(70, 1)?, is_spatial: false })
}

/// The vertex of a POLYLINE whose height, widths and flags are these; None for a point of the frame of a spline.
pub(super) fn vertex(r: &Record<'_, '_>, defaults: &VertexDefaults) -> Result<Option<Vertex>, Fault> {
    const FRAME_POINT: i64 = 16;
    if r.has(70, FRAME_POINT)? {
        return Ok(None);
    }
    let mut p = r.place(10)?;
    if let Some(height) = defaults.height {
        p[2] = height;
    }
    let [from, to] = defaults.widths;
    let widths = [r.real(40)?.unwrap_or(from), r.real(41)?.unwrap_or(to)];
    let bulge = if defaults.height.is_some() { r.real(42)?.unwrap_or(0.0) } else { 0.0 };
    Ok(Some(Vertex { p, bulge, widths }))
}

/// What the vertices of a POLYLINE take from it.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct VertexDefaults {
    /// z of all points of a flat one.
    height: Option<f64>,
    widths: [f64; 2],
}

impl VertexDefaults {
    pub(super) fn of(r: &Record<'_, '_>) -> Result<Self, Fault> {
        let height = if r.has(70, 8)? { None } else { Some(r.real(30)?.unwrap_or(0.0)) };
        Ok(Self { height, widths: [r.real(40)?.unwrap_or(0.0), r.real(41)?.unwrap_or(0.0)] })
    }
}

fn spline(r: &Record<'_, '_>) -> Result<Spline, Fault> {
    let mut s = Spline { degree: usize::try_from(r.whole(71)?.unwrap_or(3)).unwrap_or(0), ..Spline::default() };
    // The list that coordinates y and z belong to.
    for tag in r.tags {
        let (list, axis) = match tag.code {
            40 => {
                s.knots.push(tag.real()?);
                continue;
            }
            41 => {
                s.weights.push(tag.real()?);
                continue;
            }
            10 | 20 | 30 => (&mut s.control, tag.code / 10 - 1),
            11 | 21 | 31 => (&mut s.fit, tag.code / 10 - 1),
            _ => continue,
        };
        if axis == 0 {
            list.push([tag.real()?, 0.0, 0.0]);
        } else if let Some(last) = list.last_mut() {
            last[axis as usize] = tag.real()?;
        }
    }
    let tangents = [r.place(12)?, r.place(13)?];
    s.tangents = (!tangents.contains(&[0.0; 3])).then_some(tangents);
    const CLOSED: i64 = 1;
    s.is_open_loop = r.has(70, CLOSED)? && s.control.is_empty() && s.fit.first() != s.fit.last();
    Ok(s)
}

fn insert(r: &Record<'_, '_>, block: impl FnOnce(&str) -> u32) -> Result<Insert, Fault> {
    let name = r.tag(2).map(Tag::text).unwrap_or_default();
    // A scale of 0 would leave nothing; drawing programs take it as 1.
    let scale = |code| Ok::<f64, Fault>(r.real(code)?.filter(|&s| s != 0.0).unwrap_or(1.0));
    let steps = [r.real(44)?.unwrap_or(0.0), r.real(45)?.unwrap_or(0.0)];
    let count = |code, step: f64| {
        let n = u64::try_from(r.whole(code)?.unwrap_or(1)).unwrap_or(1).max(1);
        // Copies at one place are one.
        Ok::<u64, Fault>(if step == 0.0 { 1 } else { n })
    };
    Ok(Insert {
        block: block(&name),
        place: r.place(10)?,
        scale: [scale(41)?, scale(42)?, scale(43)?],
        turn: r.real(50)?.unwrap_or(0.0),
        counts: [count(70, steps[0])?, count(71, steps[1])?],
        steps,
    })
}

/// The direction that the plane of an entity faces.
pub(super) fn extrusion(r: &Record<'_, '_>) -> Result<SpacePoint, Fault> {
    Ok(r.point(210)?.unwrap_or(Z))
}
