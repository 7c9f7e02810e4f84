//! The area that shapes of an SVG drawing make, from what usvg answers.
//!
//! Consumes a [`Picture`] and which of its elements count. As masks are defined: a shape with a fill is the area of its
//! fill, whatever its colour; the lines of all other shapes bound one area together by the rule evenodd, those whose
//! ends meet within a tolerance as one. Promises on which side of its border a point lies, and how far from it. px.

use rstar::primitives::{GeomWithData, Line};
use rstar::{AABB, RTree};
use terrace_core::math;

use super::picture::{Clip, Picture, ShapeOutline};
use super::sides::Contours;
use terrace_core::geom::PlanePoint;

/// An edge and the area that it bounds.
type Edge = GeomWithData<Line<PlanePoint>, usize>;

/// The number of edges that bound no area, but cut others.
const CUT: usize = usize::MAX;

/// An area.
pub(crate) struct Outline<'a> {
    edges: RTree<Edge>,
    areas: Vec<Area<'a>>,
    right: f64,
}

/// A part of it.
struct Area<'a> {
    is_evenodd: bool,
    clips: Vec<&'a Clip>,
    /// From where its edges are placed to the drawing.
    scale: PlanePoint,
}

impl<'a> Outline<'a> {
    /// The area of the elements that `counts`, with px multiplied by `scale`; else why it is not known.
    pub(crate) fn new(
        picture: &'a Picture,
        counts: &dyn Fn(u32) -> Option<bool>,
        scale: PlanePoint,
        tolerance: f64,
    ) -> Result<Self, &'static str> {
        let scaled = |contours: &Contours| -> Contours {
            contours.iter().map(|c| c.iter().map(|p| [p[0] * scale[0], p[1] * scale[1]]).collect()).collect()
        };
        let (mut edges, mut areas, mut lines) = (Vec::new(), Vec::new(), Vec::new());
        let mut fault = None;
        picture.pieces(&mut |piece, clips| {
            match counts(piece.element) {
                Some(true) => {}
                Some(false) => return,
                None => fault = Some("it is not known which copies have the label of its area"),
            }
            if piece.is_masked {
                fault = Some("a mask or a pattern of the drawing cuts its area");
            }
            match piece.outline {
                ShapeOutline::Fill { contours, is_evenodd } => {
                    let clips: Vec<&Clip> = clips.to_vec();
                    sides(&scaled(contours), true, |side| edges.push(Edge::new(side, areas.len())));
                    let mut cut = |c: &Contours| sides(&scaled(c), true, |side| edges.push(Edge::new(side, CUT)));
                    clips.iter().for_each(|clip| clip.contours(&mut cut));
                    areas.push(Area { is_evenodd, clips, scale });
                }
                ShapeOutline::Line { is_dashed: true, .. } => fault = Some("the border of its area is dashed"),
                ShapeOutline::Line { .. } if !clips.is_empty() => {
                    fault = Some("the border of its area is cut by a clip path")
                }
                ShapeOutline::Line { centre, .. } => lines.extend(scaled(centre)),
            }
        });
        if let Some(fault) = fault {
            return Err(fault);
        }
        if !lines.is_empty() {
            sides(&lines, false, |side| edges.push(Edge::new(side, areas.len())));
            for gap in gaps(&lines, tolerance).ok_or("the border of its area is open")? {
                edges.push(Edge::new(gap, areas.len()));
            }
            areas.push(Area { is_evenodd: true, clips: Vec::new(), scale });
        }
        let right = edges.iter().map(|e| e.geom().from[0].max(e.geom().to[0])).fold(f64::MIN, f64::max);
        if areas.is_empty() {
            Err("usvg finds no area in it")
        } else {
            Ok(Self { edges: RTree::bulk_load(edges), areas, right })
        }
    }

    /// Whether a point lies in it.
    pub(crate) fn holds(&self, [x, y]: PlanePoint) -> bool {
        if x > self.right {
            return false;
        }
        let mut turns: Vec<(usize, i32)> = Vec::new();
        for edge in self.edges.locate_in_envelope_intersecting(&AABB::from_corners([x, y], [self.right, y])) {
            let Line { from: a, to: b } = *edge.geom();
            if edge.data != CUT && (a[1] <= y) != (b[1] <= y) && a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0]) > x {
                let step = if b[1] > a[1] { 1 } else { -1 };
                match turns.iter_mut().find(|(area, _)| *area == edge.data) {
                    Some((_, sum)) => *sum += step,
                    None => turns.push((edge.data, step)),
                }
            }
        }
        turns.into_iter().any(|(area, sum)| {
            let Area { is_evenodd, ref clips, scale } = self.areas[area];
            let is_inside = if is_evenodd { sum % 2 != 0 } else { sum != 0 };
            is_inside && clips.iter().all(|clip| clip.holds([x / scale[0], y / scale[1]]))
        })
    }

    /// The nearest point on an edge, which may also lie within the area.
    pub(crate) fn nearest_edge(&self, p: PlanePoint) -> Option<PlanePoint> {
        let edge = self.edges.nearest_neighbor(&p)?;
        Some(edge.geom().nearest_point(&p))
    }
}

/// The sides of polylines, with the last of each where they are closed.
fn sides(lines: &Contours, are_closed: bool, mut take: impl FnMut(Line<PlanePoint>)) {
    for line in lines {
        let last = line.last().zip(line.first()).filter(|_| are_closed).map(|(a, b)| [*a, *b]);
        let all = line.windows(2).map(|w| [w[0], w[1]]).chain(last);
        all.filter(|[a, b]| a != b).for_each(|[a, b]| take(Line::new(a, b)));
    }
}

/// The sides that join the ends of open lines; None where an end meets no other.
fn gaps(lines: &Contours, tolerance: f64) -> Option<Vec<Line<PlanePoint>>> {
    let ends = lines.iter().filter_map(|line| Some([*line.first()?, *line.last()?]));
    let mut open: Vec<PlanePoint> = ends.filter(|[a, b]| a != b).flatten().collect();
    let mut found = Vec::new();
    while let Some(end) = open.pop() {
        let away = |p: &PlanePoint| math::hypot(p[0] - end[0], p[1] - end[1]);
        let next = (0..open.len()).min_by(|&a, &b| away(&open[a]).total_cmp(&away(&open[b])))?;
        let other = open.swap_remove(next);
        if away(&other) > tolerance {
            return None;
        }
        if other != end {
            found.push(Line::new(end, other));
        }
    }
    Some(found)
}
