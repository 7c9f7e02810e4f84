//! Shapes: their subpaths, and the lines and areas that their paint makes of them.

use std::ops::Range;

use roxmltree::Node;
use svgtypes::LengthListParser;

use super::outline::{Dropped, Outline, Sink};
use super::path;
use super::stroke::{Curves, Pen, TooMany};
use super::style::Coat;
use super::tally::Issue;
use super::walk::{Done, Purpose, State, Walk};
use crate::diag::Diag;
use crate::texture::artwork::{Colour, Figure, Shape, StrokeMode, WHITE};

/// How finely curves of strokes are approximated, as a share of the tolerance, before they are flattened.
const FINE: f64 = 0.1;

impl<'a, 'input> Walk<'a, 'input> {
    /// Draws a shape as the purpose asks for.
    pub(super) fn shape(&mut self, node: Node<'a, 'input>, tag: &str, state: State<'a>) -> Done {
        let Some(state) = self.enter(node, state)? else { return Ok(()) };
        match self.purpose {
            Purpose::Bounds => return self.subpaths(node, tag, state, [0; 3], Figure::Lines),
            Purpose::Clip if state.style.is_visible() => {
                return self.subpaths(node, tag, state, [0; 3], Figure::Fill(state.style.clip_rule));
            }
            Purpose::Clip => return Ok(()),
            Purpose::Mark | Purpose::Mask => {}
        }
        if state.style.stroke_first {
            self.stroke(node, tag, state, None)?;
            return self.fill(node, tag, state).map(|_| ());
        }
        let filled = self.fill(node, tag, state)?;
        self.stroke(node, tag, state, filled)
    }

    /// Draws the area of a shape; answers with its polylines.
    fn fill(&mut self, node: Node<'a, 'input>, tag: &str, state: State<'a>) -> Result<Option<Range<usize>>, Box<Diag>> {
        let figure = Figure::Fill(state.style.rule);
        match state.style.fill() {
            Coat::Colour(colour) if tag != "line" => {
                let first = self.art.lines.len();
                self.subpaths(node, tag, state, colour, figure)?;
                Ok(Some(first..self.art.lines.len()))
            }
            Coat::Server(id) if tag != "line" => self.painted(node, tag, state, id).map(|()| None),
            _ => Ok(None),
        }
    }

    /// Draws the stroke of a shape along its centre, or as the area that it covers.
    fn stroke(&mut self, node: Node<'a, 'input>, tag: &str, state: State<'a>, filled: Option<Range<usize>>) -> Done {
        let colour = match state.style.stroke() {
            Coat::Colour(colour) => colour,
            Coat::Server(_) => {
                self.note(Issue::Paint, node);
                return Ok(());
            }
            _ => return Ok(()),
        };
        let Some(pen) = self.pen(node, state) else { return Ok(()) };
        let width = pen.width * state.map.enlarges();
        // A line of the page's colour hides what it covers.
        let is_line = self.purpose == Purpose::Mark
            && (colour != WHITE || self.marking.names(WHITE))
            && match self.marking.stroke {
                StrokeMode::Centre => true,
                StrokeMode::Shown => width <= self.widest_line,
                StrokeMode::Outline | StrokeMode::Hatch => false,
            };
        if is_line && pen.dashes.is_empty() {
            return match filled {
                Some(lines) => {
                    self.push(node, state, colour, Figure::Lines, lines);
                    Ok(())
                }
                None => self.subpaths(node, tag, state, colour, Figure::Lines),
            };
        }
        let mut curves = Curves::new(self.tolerance * FINE / state.map.enlarges());
        // What is wrong with the area is wrong with the line.
        let quiet = self.is_quiet;
        self.is_quiet |= filled.is_some();
        if !self.draw(node, tag, state, &mut curves) {
            self.note(Issue::Fault, node);
        }
        self.is_quiet = quiet;
        if !pen.dashes.is_empty() {
            curves.dash(&pen).map_err(|TooMany| {
                let text = format!("{} has more than a million dashes", self.called(node));
                Box::new(Diag::limit("texture-large", text).hint("draw longer dashes"))
            })?;
        }
        let figure = if is_line { Figure::Lines } else { Figure::Stroke };
        if !is_line {
            curves.widen(&pen);
        }
        let (lines, dropped) = self.flattened(node, state, |_, out| curves.draw(out))?;
        // Of an area, contours without extent may be parts of its caps and joins.
        if is_line || lines.is_empty() {
            self.dropped(node, &dropped);
        }
        self.push(node, state, colour, figure, lines);
        Ok(())
    }

    /// How the stroke of a shape is drawn, in its units; None where it has no width.
    fn pen(&mut self, node: Node<'a, 'input>, state: State<'a>) -> Option<Pen> {
        let style = state.style;
        let mut length = |text: Option<&str>| text.and_then(|t| self.parsed(node, t, 2, state)).unwrap_or(f64::NAN);
        let width = style.width.map_or(1.0, |w| length(Some(w)));
        let width = if width.is_finite() { width } else { 1.0 } * state.stretch;
        let offset = length(style.dash_offset);
        let offset = if offset.is_finite() { offset * state.stretch } else { 0.0 };
        let mut dashes = Vec::new();
        if let Some(text) = style.dashes.filter(|t| *t != "none") {
            let lengths = LengthListParser::from(text);
            dashes =
                lengths.map(|l| l.map_or(f64::NAN, |l| self.resolved(node, l, 2, state) * state.stretch)).collect();
            if !dashes.iter().all(|d| *d >= 0.0) || dashes.iter().sum::<f64>() <= 0.0 {
                dashes.clear();
            }
            if dashes.len() % 2 == 1 {
                dashes.extend_from_within(..);
            }
        }
        let Some(join) = style.join else {
            self.note(Issue::Effect, node);
            return None;
        };
        (width > 0.0).then_some(Pen { width, cap: style.cap, join, miter: style.miter, dashes, offset })
    }

    /// Draws the subpaths of a shape as one figure.
    pub(super) fn subpaths(
        &mut self,
        node: Node<'a, 'input>,
        tag: &str,
        state: State<'a>,
        colour: Colour,
        figure: Figure,
    ) -> Done {
        let mut whole = true;
        let (lines, dropped) = self.flattened(node, state, |walk, out| whole = walk.draw(node, tag, state, out))?;
        if !whole {
            self.note(Issue::Fault, node);
        }
        self.dropped(node, &dropped);
        self.push(node, state, colour, figure, lines);
        Ok(())
    }

    /// Notes what of an element is too small to be marked.
    fn dropped(&mut self, node: Node<'a, 'input>, dropped: &Dropped) {
        for (is_met, issue) in [(dropped.dots, Issue::Dot), (dropped.hairlines, Issue::Hairline)] {
            if is_met {
                self.note(issue, node);
            }
        }
    }

    /// The polylines of what is drawn.
    fn flattened(
        &mut self,
        node: Node<'a, 'input>,
        state: State<'a>,
        draw: impl FnOnce(&mut Self, &mut Outline<'_>),
    ) -> Result<(Range<usize>, Dropped), Box<Diag>> {
        let mut lines = std::mem::take(&mut self.art.lines);
        let first = lines.len();
        let mut out = Outline::new(state.map, self.tolerance, &mut lines);
        draw(self, &mut out);
        let ended = out.end();
        self.art.lines = lines;
        let dropped = ended.map_err(|stop| Box::new(self.stopped(stop, node)))?;
        Ok((first..self.art.lines.len(), dropped))
    }

    /// Makes a shape of polylines.
    fn push(&mut self, node: Node<'a, 'input>, state: State<'a>, colour: Colour, figure: Figure, lines: Range<usize>) {
        if !lines.is_empty() {
            let (name, State { labels, clip, .. }) = (self.name(node), state);
            self.art.shapes.push(Shape { name, labels, colour, opacity: 1.0, figure, lines, clip });
        }
    }

    /// Draws a shape; answers whether its description was faultless.
    fn draw(&mut self, node: Node<'a, 'input>, tag: &str, state: State<'a>, out: &mut impl Sink) -> bool {
        let text = |name: &str| node.attribute(name).unwrap_or_default();
        let mut get = |name: &str, axis: usize| self.length(node, name, axis, state);
        match tag {
            "path" => return path::path(text("d"), out),
            "polyline" => return path::points(text("points"), false, out),
            "polygon" => return path::points(text("points"), true, out),
            "line" => {
                out.move_to([get("x1", 0), get("y1", 1)]);
                out.line_to([get("x2", 0), get("y2", 1)]);
            }
            "rect" => {
                let (p, size) = ([get("x", 0), get("y", 1)], [get("width", 0), get("height", 1)]);
                let radii = radii(node, size, &mut get);
                rect(p, size, radii, out);
            }
            "circle" => {
                let r = get("r", 2);
                ellipse([get("cx", 0), get("cy", 1)], [r, r], out);
            }
            _ => {
                let centre = [get("cx", 0), get("cy", 1)];
                let radii = radii(node, [f64::INFINITY; 2], &mut get);
                ellipse(centre, radii, out);
            }
        }
        true
    }
}

/// Radii of a rectangle's corners or of an ellipse: one that is not given equals the other.
fn radii(node: Node<'_, '_>, size: [f64; 2], get: &mut impl FnMut(&str, usize) -> f64) -> [f64; 2] {
    let given = |name: &str| node.attribute(name).is_some_and(|t| t.trim() != "auto");
    let [rx, ry] = match [given("rx"), given("ry")] {
        [true, true] => [get("rx", 0), get("ry", 1)],
        [true, false] => [get("rx", 0); 2],
        [false, true] => [get("ry", 1); 2],
        [false, false] => [0.0; 2],
    };
    [rx.clamp(0.0, (size[0] / 2.0).max(0.0)), ry.clamp(0.0, (size[1] / 2.0).max(0.0))]
}

fn rect([x, y]: [f64; 2], [w, h]: [f64; 2], [rx, ry]: [f64; 2], out: &mut impl Sink) {
    if !(w > 0.0 && h > 0.0) {
        return out.dot();
    }
    out.move_to([x + rx, y]);
    let sides = [
        ([x + w - rx, y], [x + w, y + ry]),
        ([x + w, y + h - ry], [x + w - rx, y + h]),
        ([x + rx, y + h], [x, y + h - ry]),
        ([x, y + ry], [x + rx, y]),
    ];
    for (line_end, arc_end) in sides {
        if line_end != out.at() {
            out.line_to(line_end);
        }
        out.arc_to([rx, ry], 0.0, false, true, arc_end);
    }
    out.close();
}

fn ellipse(centre: [f64; 2], [rx, ry]: [f64; 2], out: &mut impl Sink) {
    if rx > 0.0 && ry > 0.0 { out.ellipse(centre, rx, ry) } else { out.dot() }
}
