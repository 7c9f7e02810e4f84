//! The area that shapes of a drawing make: filled ones by their fill, all others by their closed lines.
//!
//! Colours, and what lies over what, mean nothing here. A shape with a fill is the area of its fill, its stroke is not
//! looked at. Lines of all other shapes bound an area together: one inside another is a hole (rule evenodd). Lines
//! whose ends meet, nearer than the tolerance, are one; a line that does not end where it begins is a fault.

use std::collections::{BTreeMap, BTreeSet};
use terrace_core::math;

use crate::texture::artwork::{Artwork, PaintedShape, PolygonArea, ShapeFigure, TooMany, WindingRule};
use crate::texture::clip::is_closed;
use terrace_core::diag::Diag;
use terrace_core::geom::PlanePoint;

/// Most labels that a message lists.
const MAX_LISTED: usize = 24;

/// The area of the shapes with an id, layer, class or block of that name, or of all; page mm.
pub(super) fn outline(art: &Artwork, name: Option<&str>, tolerance: f64) -> Result<PolygonArea, Box<Diag>> {
    let chosen: Vec<&PaintedShape> = art.shapes.iter().filter(|s| name.is_none_or(|name| has(art, s, name))).collect();
    if chosen.is_empty() {
        return Err(no_area(art, name));
    }
    let filled: BTreeSet<u32> = chosen.iter().filter(|s| s.figure != ShapeFigure::Lines).map(|s| s.name).collect();
    let mut parts = Vec::new();
    let mut lines = Vec::new();
    for shape in chosen {
        let contours = shape.lines.clone().map(|k| art.lines.get(k));
        let rule = match shape.figure {
            ShapeFigure::Fill(rule) => rule,
            ShapeFigure::Stroke => WindingRule::NonZero,
            ShapeFigure::Lines if !filled.contains(&shape.name) => {
                lines.extend(contours.map(|contour| ShapeLine { points: contour.to_vec(), shape }));
                continue;
            }
            ShapeFigure::Lines | ShapeFigure::Grey(_) => continue,
        };
        let area = PolygonArea::new(contours, rule);
        let area = area.and_then(|a| shape.clip.map_or(Ok(a.clone()), |clip| a.within(&art.clips[clip as usize])));
        parts.push(area.map_err(|TooMany| crossings(&art.names[shape.name as usize]))?);
    }
    let rings = closed(art, lines, tolerance)?;
    if !rings.is_empty() {
        let area = PolygonArea::new(rings.iter().map(Vec::as_slice), WindingRule::EvenOdd);
        parts.push(area.map_err(|TooMany| crossings("the lines"))?);
    }
    let area = PolygonArea::union(parts.iter()).map_err(|TooMany| crossings("the drawing"))?;
    if area.is_empty() { Err(no_area(art, name)) } else { Ok(area) }
}

/// Whether a shape has a label of that name.
fn has(art: &Artwork, shape: &PaintedShape, name: &str) -> bool {
    art.labels(shape.labels).any(|label| is_named(label, name))
}

/// Whether a label is of that name, with its kind (`layer:Rim`) or without.
fn is_named(label: &str, name: &str) -> bool {
    label == name || label.split_once(':').is_some_and(|(_, own)| own == name)
}

/// The fault where the shapes of a name, or all, make no area: that they hold none or, where no shape could have the
/// name, which names there are. `inside` and `outside` are the keys of the job that ask for the area.
fn no_area(art: &Artwork, name: Option<&str>) -> Box<Diag> {
    let Some(name) = name else {
        let text = "the drawing of inside or outside holds no area";
        return Diag::input("mask-empty", text).hint("fill a shape, or draw a closed line").into();
    };
    let labels: BTreeSet<&String> = art.labels.iter().flat_map(|set| &set.own).collect();
    let is_known = labels.iter().any(|label| is_named(label, name));
    if is_known {
        let text = format!("{name:?} of inside or outside holds no area");
        return Diag::input("mask-empty", text).hint("fill a shape, or draw a closed line").into();
    }
    let held = match labels.len() {
        0 => "the drawing has no ids, layers, classes or blocks".to_owned(),
        n => {
            let list: Vec<&str> = labels.iter().take(MAX_LISTED).map(|l| l.as_str()).collect();
            let more = if n > MAX_LISTED { format!(" and {} more", n - MAX_LISTED) } else { String::new() };
            format!("the drawing holds {}{more}", list.join(", "))
        }
    };
    Diag::input("mask-unknown", format!("the drawing holds no shape of the name {name:?}")).hint(held).into()
}

fn crossings(what: &str) -> Box<Diag> {
    let text = format!("the area of {what} has contours that cross each other too often (400000 times)");
    Diag::limit("texture-crossings", text).hint("simplify it in the drawing program").into()
}

/// A line of a shape.
struct ShapeLine<'a> {
    points: Vec<PlanePoint>,
    shape: &'a PaintedShape,
}

/// Lines as rings; open ones are joined where ends meet.
fn closed(art: &Artwork, lines: Vec<ShapeLine<'_>>, tolerance: f64) -> Result<Vec<Vec<PlanePoint>>, Box<Diag>> {
    let mut rings = Vec::new();
    let mut open = Vec::new();
    for line in lines {
        if is_closed(&line.points) {
            rings.push(line.points);
        } else if line.points.len() > 1 {
            open.push(line);
        }
    }
    let mut ends = OpenEnds::new(&open, tolerance);
    for first in 0..open.len() {
        if !ends.take(first) {
            continue;
        }
        let mut ring = open[first].points.clone();
        // Each turn takes a line, or ends.
        loop {
            let last = ring[ring.len() - 1];
            if ring.len() > 2 && distance(last, ring[0]) <= tolerance {
                break;
            }
            let Some(LineEnd { line: next, is_last_point }) = ends.nearest(last) else {
                let [x, y] = last;
                let element = &art.names[open[first].shape.name as usize];
                let text = format!("the outline of {element} is open: it ends at {x:.4}, {y:.4} mm of its page");
                return Err(Diag::input("mask-open", text)
                    .hint("close it in the drawing program, or give the shape a fill")
                    .into());
            };
            ends.take(next);
            let points = &open[next].points;
            if is_last_point { ring.extend(points.iter().rev()) } else { ring.extend(points) }
        }
        rings.push(ring);
    }
    Ok(rings)
}

fn distance(a: PlanePoint, b: PlanePoint) -> f64 {
    math::hypot(a[0] - b[0], a[1] - b[1])
}

/// An end of an open line.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct LineEnd {
    line: usize,
    is_last_point: bool,
}

/// The ends of open lines that are not yet part of a ring, in cells as wide as the tolerance.
struct OpenEnds {
    cells: BTreeMap<[i64; 2], Vec<LineEnd>>,
    ends: Vec<[PlanePoint; 2]>,
    is_taken: Vec<bool>,
    tolerance: f64,
}

impl OpenEnds {
    fn new(open: &[ShapeLine<'_>], tolerance: f64) -> Self {
        let ends = open.iter().map(|line| [line.points[0], line.points[line.points.len() - 1]]).collect();
        let mut open_ends = Self { cells: BTreeMap::new(), ends, is_taken: vec![false; open.len()], tolerance };
        for line in 0..open.len() {
            for is_last_point in [false, true] {
                let end = LineEnd { line, is_last_point };
                open_ends.cells.entry(open_ends.cell(open_ends.place(end))).or_default().push(end);
            }
        }
        open_ends
    }

    fn place(&self, end: LineEnd) -> PlanePoint {
        self.ends[end.line][usize::from(end.is_last_point)]
    }

    fn cell(&self, p: PlanePoint) -> [i64; 2] {
        p.map(|v| (v / self.tolerance).floor() as i64)
    }

    /// Takes a line; false where it is part of a ring already.
    fn take(&mut self, i: usize) -> bool {
        !std::mem::replace(&mut self.is_taken[i], true)
    }

    /// The end that lies nearest to a point, within the tolerance; of equally near ones the first.
    fn nearest(&self, p: PlanePoint) -> Option<LineEnd> {
        let [x, y] = self.cell(p);
        let cells = (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| [x + dx, y + dy]));
        let ends = cells.filter_map(|cell| self.cells.get(&cell)).flatten().filter(|end| !self.is_taken[end.line]);
        let away = |end: &LineEnd| distance(p, self.place(*end));
        let within = ends.copied().filter(|end| away(end) <= self.tolerance);
        within.min_by(|a, b| away(a).total_cmp(&away(b)).then(a.cmp(b)))
    }
}
