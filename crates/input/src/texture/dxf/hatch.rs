//! Hatches as they are defined: boundary paths of edges, and families of pattern lines.

use std::f64::consts::{PI, TAU};
use terrace_core::math;

use super::outline::{Arc, Vertex};
use super::record::Record;
use super::space::{cos_sin, length};
use super::spline::Spline;
use super::tags::{Fault, Tag};
use terrace_core::geom::SpacePoint;

/// Everything in the plane of the hatch.
#[derive(Debug, Default)]
pub(super) struct Hatch {
    pub(super) paths: Vec<BoundaryPath>,
    pub(super) fill: Fill,
    style: i64,
}

#[derive(Debug, Default, PartialEq)]
pub(super) enum Fill {
    #[default]
    Solid,
    Gradient,
    Pattern(Vec<Family>),
}

/// A boundary path.
#[derive(Debug, Default)]
pub(super) struct BoundaryPath {
    flags: i64,
    pub(super) edges: Vec<BoundaryEdge>,
}

#[derive(Debug)]
pub(super) enum BoundaryEdge {
    /// Closed.
    Polyline(Vec<Vertex>),
    Line([SpacePoint; 2]),
    Arc(Arc),
    Spline(Spline),
}

/// Parallel lines: one through `base`, the next one `offset` from it, and so on both ways.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Family {
    pub(super) base: [f64; 2],
    pub(super) direction: [f64; 2],
    pub(super) offset: [f64; 2],
    /// Lengths of dashes, of gaps (negative) and dots (0), from the base; none for full lines.
    pub(super) dashes: Vec<f64>,
}

const EXTERNAL: i64 = 1;
const POLYLINE: i64 = 2;
const TEXT_BOX: i64 = 8;
const OUTERMOST: i64 = 16;

/// Hatch styles (group 75): only the outermost area is filled, or all that the outer paths hold.
const OUTER_STYLE: i64 = 1;
const IGNORE_STYLE: i64 = 2;

impl Hatch {
    /// # Errors
    /// `dxf-number`.
    pub(super) fn of(r: &Record<'_, '_>) -> Result<Self, Fault> {
        let mut hatch = Self { style: r.whole(75)?.unwrap_or(0), ..Self::default() };
        let height = r.real(30)?.unwrap_or(0.0);
        // Paths are between their number (group 91) and what follows them.
        let start = r.tags.iter().position(|t| t.code == 91).map_or(r.tags.len(), |i| i + 1);
        let after = |codes: &[i32]| {
            let rest = r.tags[start..].iter().position(|t| codes.contains(&t.code));
            rest.map_or(r.tags.len(), |i| start + i)
        };
        let end = after(&[75, 76, 98, 450]);
        let mut paths = r.tags[start..end].split(|t| t.code == 92);
        // What stands before the first path is not a path.
        let mut at = start + paths.next().map_or(0, <[_]>::len);
        for tags in paths {
            let flags = r.tags[at].whole()?;
            at += 1 + tags.len();
            hatch.paths.push(path(flags, tags, height)?);
        }
        let is_solid = r.has(70, 1)?;
        hatch.fill = if is_solid && r.has(450, 1)? {
            Fill::Gradient
        } else if is_solid {
            Fill::Solid
        } else {
            Fill::Pattern(families(&r.tags[after(&[78])..])?)
        };
        Ok(hatch)
    }

    /// The paths that bound what is filled, by the style of the hatch: all, those of the outermost area, or the
    /// outer ones alone; without those of texts.
    pub(super) fn bounds(&self) -> Vec<&BoundaryPath> {
        let wanted = match self.style {
            IGNORE_STYLE => EXTERNAL,
            OUTER_STYLE => EXTERNAL | OUTERMOST,
            _ => i64::MAX,
        };
        let bounds = || self.paths.iter().filter(|p| p.flags & TEXT_BOX == 0);
        let with_flag: Vec<&BoundaryPath> = bounds().filter(|p| wanted == i64::MAX || p.flags & wanted != 0).collect();
        if with_flag.is_empty() { bounds().collect() } else { with_flag }
    }

    /// The boxes about texts: what lies in them is never filled, whether they lie in the fill, in an island or across a
    /// border. A hatch that ignores all inner paths ignores them too.
    pub(super) fn text_boxes(&self) -> Vec<&BoundaryPath> {
        let is_text_box = |p: &&BoundaryPath| p.flags & TEXT_BOX != 0 && self.style != IGNORE_STYLE;
        self.paths.iter().filter(is_text_box).collect()
    }
}

fn path(flags: i64, tags: &[Tag<'_>], height: f64) -> Result<BoundaryPath, Fault> {
    let edges = if flags & POLYLINE != 0 {
        vec![BoundaryEdge::Polyline(vertices(tags, height)?)]
    } else {
        // The type of an edge (group 72) begins it.
        let mut parts = tags.split(|t| t.code == 72);
        let mut at = parts.next().map_or(0, <[_]>::len);
        let mut edges = Vec::new();
        for part in parts {
            let what = tags[at].whole()?;
            at += 1 + part.len();
            edges.extend(edge(what, part, height)?);
        }
        edges
    };
    Ok(BoundaryPath { flags, edges })
}

fn vertices(tags: &[Tag<'_>], height: f64) -> Result<Vec<Vertex>, Fault> {
    let mut out: Vec<Vertex> = Vec::new();
    for tag in tags {
        match (tag.code, out.last_mut()) {
            (10, _) => out.push(Vertex { p: [tag.real()?, 0.0, height], ..Vertex::default() }),
            (20, Some(last)) => last.p[1] = tag.real()?,
            (42, Some(last)) => last.bulge = tag.real()?,
            _ => {}
        }
    }
    Ok(out)
}

fn edge(what: i64, tags: &[Tag<'_>], height: f64) -> Result<Option<BoundaryEdge>, Fault> {
    let real = |code: i32| tags.iter().find(|t| t.code == code).map(Tag::real).transpose();
    let point =
        |code: i32, z: f64| Ok::<SpacePoint, Fault>([real(code)?.unwrap_or(0.0), real(code + 10)?.unwrap_or(0.0), z]);
    let is_left = real(73)?.unwrap_or(1.0) != 0.0;
    Ok(match what {
        1 => Some(BoundaryEdge::Line([point(10, height)?, point(11, height)?])),
        2 => {
            let r = real(40)?.unwrap_or(0.0);
            let angles = [real(50)?.unwrap_or(0.0), real(51)?.unwrap_or(360.0)];
            let [start, by] = sweep(angles.map(f64::to_radians), is_left);
            Some(BoundaryEdge::Arc(Arc { centre: point(10, height)?, a: [r, 0.0, 0.0], b: [0.0, r, 0.0], start, by }))
        }
        3 => {
            let a = point(11, 0.0)?;
            let ratio = real(40)?.unwrap_or(1.0);
            let angles = [real(50)?.unwrap_or(0.0), real(51)?.unwrap_or(360.0)];
            let is_whole = (angles[1] - angles[0]).abs() >= 360.0 - 1e-9;
            let b = [-a[1] * ratio, a[0] * ratio, 0.0];
            // The angles are those of points seen from the centre, not those of the parameter.
            let params = angles.map(|angle| {
                let [cos, sin] = cos_sin(angle);
                math::atan2(sin / ratio, cos)
            });
            let mut part = sweep(params, is_left);
            if is_whole {
                part[1] = TAU.copysign(part[1]);
            }
            let arc = Arc { centre: point(10, height)?, a, b, start: part[0], by: part[1] };
            (ratio != 0.0 && length(a) > 0.0).then_some(BoundaryEdge::Arc(arc))
        }
        4 => Some(BoundaryEdge::Spline(spline(tags, height)?)),
        _ => None,
    })
}

/// Start and sweep of an arc between two angles, rad; those of one to the right are mirrored about the first axis.
fn sweep([from, to]: [f64; 2], is_left: bool) -> [f64; 2] {
    let by = span(from, to);
    if is_left { [from, by] } else { [-from, -by] }
}

/// From one angle to the other counter-clockwise, rad; whole turns are one, equal angles none.
pub(super) fn span(from: f64, to: f64) -> f64 {
    if (to - from).abs() < 1e-9 {
        return 0.0;
    }
    let by = (to - from).rem_euclid(TAU);
    // A turn has the noise of degrees, or was written as 6.28319.
    if TAU - by < 1e-9 || ((to - from).abs() > PI && by < 1e-5) { TAU } else { by }
}

fn spline(tags: &[Tag<'_>], height: f64) -> Result<Spline, Fault> {
    let mut s = Spline::default();
    let mut tangents = [[0.0; 3]; 2];
    for tag in tags {
        match tag.code {
            94 => s.degree = usize::try_from(tag.whole()?).unwrap_or(0),
            40 => s.knots.push(tag.real()?),
            42 => s.weights.push(tag.real()?),
            10 => s.control.push([tag.real()?, 0.0, height]),
            11 => s.fit.push([tag.real()?, 0.0, height]),
            20 => s.control.iter_mut().next_back().map_or(Ok(()), |p| tag.real().map(|v| p[1] = v))?,
            21 => s.fit.iter_mut().next_back().map_or(Ok(()), |p| tag.real().map(|v| p[1] = v))?,
            12 | 22 => tangents[0][(tag.code / 10 - 1) as usize] = tag.real()?,
            13 | 23 => tangents[1][(tag.code / 10 - 1) as usize] = tag.real()?,
            _ => {}
        }
    }
    s.tangents = (!tangents.contains(&[0.0; 3])).then_some(tangents);
    Ok(s)
}

fn families(tags: &[Tag<'_>]) -> Result<Vec<Family>, Fault> {
    let mut out: Vec<Family> = Vec::new();
    for tag in tags.iter().take_while(|t| t.code != 98 && t.code < 100) {
        if tag.code == 53 {
            out.push(Family { direction: cos_sin(tag.real()?), ..Family::default() });
        }
        let Some(family) = out.last_mut() else { continue };
        match tag.code {
            43 => family.base[0] = tag.real()?,
            44 => family.base[1] = tag.real()?,
            45 => family.offset[0] = tag.real()?,
            46 => family.offset[1] = tag.real()?,
            49 => family.dashes.push(tag.real()?),
            _ => {}
        }
    }
    Ok(out)
}
