//! Shapes: their subpaths, and the lines and areas that their paint makes of them.

use std::ops::Range;

use kurbo::Cap;
use roxmltree::Node;
use svg_style::{Layer, Style};

use super::outline::{Dropped, Outline, Sink};
use super::path;
use super::servers::Paint;
use super::state::State;
use super::stroke::{Curves, Pen, TooMany};
use super::style::{Ink, rule};
use super::tally::Issue;
use super::walk::{Done, Purpose, Walk, whole};
use crate::texture::artwork::{Colour, Figure, Shape, StrokeMode};
use terrace_core::diag::Diag;

/// How finely curves of strokes are approximated, as a share of the tolerance, before they are flattened.
const FINE: f64 = 0.1;

impl<'a, 'input> Walk<'a, 'input> {
    /// Draws a shape as the purpose asks for.
    pub(super) fn shape(&mut self, node: Node<'a, 'input>, tag: &str, outer: &State) -> Done {
        let Some(state) = &self.enter(node, outer)? else { return Ok(()) };
        let style = &state.style;
        let black = Colour::default();
        match self.purpose {
            Purpose::Bounds => return self.subpaths(node, tag, state, Ink::plain(black), Figure::Lines).map(|_| ()),
            Purpose::Clip if style.visible => {
                let figure = Figure::Fill(rule(style.clip_rule));
                return self.subpaths(node, tag, state, Ink::plain(black), figure).map(|_| ());
            }
            Purpose::Clip => return Ok(()),
            Purpose::Mark | Purpose::Mask => {}
        }
        let place = |layer: Layer| style.paint_order.iter().position(|l| *l == layer);
        if place(Layer::Stroke) < place(Layer::Fill) {
            self.stroke(node, tag, state, None)?;
            return self.fill(node, tag, state).map(|_| ());
        }
        let filled = self.fill(node, tag, state)?;
        self.stroke(node, tag, state, filled)
    }

    /// Draws the area of a shape; returns its polylines, and whether it has points that are not numbers.
    fn fill(&mut self, node: Node<'a, 'input>, tag: &str, state: &State) -> Result<Option<Filled>, Box<Diag>> {
        if tag == "line" {
            return Ok(None);
        }
        match self.paint(node, state, true)? {
            Paint::None => Ok(None),
            Paint::Ink(ink) => {
                let first = self.art.lines.len();
                let figure = Figure::Fill(rule(state.style.fill_rule));
                let dropped = self.subpaths(node, tag, state, ink, figure)?;
                Ok(Some(Filled { lines: first..self.art.lines.len(), dropped }))
            }
            Paint::Pattern(pattern) => self.painted(node, tag, state, pattern).map(|()| None),
        }
    }

    /// Draws the stroke of a shape along its centre, or as the area that it covers.
    fn stroke(&mut self, node: Node<'a, 'input>, tag: &str, state: &State, filled: Option<Filled>) -> Done {
        let Some(mut pen) = self.pen(node, state) else { return Ok(()) };
        let ink = match self.paint(node, state, false)? {
            Paint::None => return Ok(()),
            Paint::Ink(ink) => ink,
            Paint::Pattern(_) => {
                self.note(Issue::Paint, node);
                return Ok(());
            }
        };
        let width = pen.width * state.map.enlarges();
        // A line of the page's colour hides what it covers.
        let is_line = self.purpose == Purpose::Mark
            && !self.marking.is_page(ink.colour)
            && match self.marking.stroke {
                StrokeMode::Centre => true,
                StrokeMode::Shown => width <= self.widest_line || state.style.is_hairline(),
                StrokeMode::Outline | StrokeMode::Hatch => state.style.is_hairline(),
            };
        if is_line && pen.dashes.is_empty() {
            let dropped = match filled {
                Some(Filled { lines, dropped }) if !dropped.hairlines => {
                    self.push(node, state, ink, Figure::Lines, lines);
                    dropped
                }
                _ => self.subpaths(node, tag, state, ink, Figure::Lines)?,
            };
            if dropped.dots {
                let mut curves = Curves::new(self.tolerance * FINE / state.map.enlarges());
                self.draw(node, tag, state, &mut curves);
                self.dots(node, state, ink, &pen, &curves.take_dots(0.0), true)?;
            }
            return Ok(());
        }
        let mut curves = Curves::new(self.tolerance * FINE / state.map.enlarges());
        // What is wrong with the area is wrong with the line.
        let quiet = self.is_quiet;
        self.is_quiet |= filled.is_some();
        if !self.draw(node, tag, state, &mut curves) {
            self.note(Issue::Fault, node);
        }
        self.is_quiet = quiet;
        let dots = curves.take_dots(0.0);
        if pen.dashes.is_empty() {
            self.dots(node, state, ink, &pen, &dots, is_line)?;
        } else if !dots.is_empty() {
            // Browsers draw no dots with dashes.
            self.note(Issue::Dot, node);
        }
        if !pen.dashes.is_empty() {
            self.by_path_length(node, &curves, &mut pen);
        }
        if !pen.dashes.is_empty() {
            let least = curves.dash(&pen).map_err(|TooMany| {
                let text = format!("{} has more than a million dashes", self.called(node));
                Box::new(Diag::limit("texture-large", text).hint("draw longer dashes"))
            })?;
            if is_line {
                self.dots(node, state, ink, &pen, &curves.take_dots(2.0 * least), true)?;
            }
        }
        let figure = if is_line { Figure::Lines } else { Figure::Stroke };
        if !is_line {
            curves.widen(&pen);
        }
        let (lines, dropped) = self.flattened(node, state, figure, |_, out| curves.draw(out))?;
        // Of an area, contours without extent may be parts of its caps and joins.
        if is_line && dropped.hairlines {
            self.note(Issue::Hairline, node);
        }
        self.push(node, state, ink, figure, lines);
        Ok(())
    }

    /// Draws points: discs or squares where the stroke is wider than a line, else dots of the pen.
    fn dots(
        &mut self,
        node: Node<'a, 'input>,
        state: &State,
        ink: Ink,
        pen: &Pen,
        dots: &[[f64; 2]],
        is_line: bool,
    ) -> Done {
        if pen.cap == Cap::Butt || dots.is_empty() {
            if !dots.is_empty() {
                self.note(Issue::Dot, node);
            }
            return Ok(());
        }
        if is_line {
            let first = self.art.lines.len();
            dots.iter().for_each(|&dot| self.art.lines.push(&[state.map.at(dot)]));
            let lines = first..self.art.lines.len();
            self.push(node, state, ink, Figure::Lines, lines);
            return Ok(());
        }
        let half = pen.width / 2.0;
        let (lines, _) = self.flattened(node, state, Figure::Stroke, |_, out| {
            for &[x, y] in dots {
                match pen.cap {
                    Cap::Round => out.ellipse([x, y], half, half),
                    _ => rect([x - half, y - half], [pen.width; 2], [0.0; 2], out),
                }
            }
        })?;
        self.push(node, state, ink, Figure::Stroke, lines);
        Ok(())
    }

    /// Takes lengths of dashes from the units of the attribute `pathLength` (SVG 2, 9.6.1).
    fn by_path_length(&mut self, node: Node<'a, 'input>, curves: &Curves, pen: &mut Pen) {
        let Some(text) = node.attribute("pathLength") else { return };
        let stated = text.trim().parse::<f64>().ok().filter(|v| v.is_finite()).unwrap_or(0.0);
        if stated < 0.0 {
            return;
        }
        self.note(Issue::PathLength, node);
        let factor = curves.length() / stated;
        // A length of 0, or next to it, makes the first dash longer than any path: a solid line. So is what is no
        // number, which counts as 0 in browsers.
        if !factor.is_finite() {
            pen.dashes.clear();
            return;
        }
        pen.dashes.iter_mut().for_each(|d| *d *= factor);
        pen.offset *= factor;
    }

    /// How the stroke of a shape is drawn, in its units; None where it has no width.
    fn pen(&mut self, node: Node<'a, 'input>, state: &State) -> Option<Pen> {
        let style = &state.style;
        let length = |l: svg_style::Length| l.of(whole(state.port, 2)) * state.stretch;
        let width = length(style.stroke_width);
        let mut dashes: Vec<f64> = style.stroke_dasharray.iter().map(|&d| length(d)).collect();
        if dashes.len() % 2 == 1 {
            dashes.extend_from_within(..);
        }
        if !dashes.iter().all(|d| *d >= 0.0) || dashes.iter().sum::<f64>() <= 0.0 {
            dashes.clear();
        }
        if style.stroke == svg_style::Paint::None || !(width > 0.0 || style.hairline) {
            return None;
        }
        let Some(join) = style.stroke_linejoin else {
            self.note(Issue::Effect, node);
            return None;
        };
        let (cap, miter) = (style.stroke_linecap, style.stroke_miterlimit);
        Some(Pen { width, cap, join, miter, dashes, offset: length(style.stroke_dashoffset) })
    }

    /// Draws the subpaths of a shape as one figure; returns what of them is not drawn.
    pub(super) fn subpaths(
        &mut self,
        node: Node<'a, 'input>,
        tag: &str,
        state: &State,
        ink: Ink,
        figure: Figure,
    ) -> Result<Dropped, Box<Diag>> {
        let mut whole = true;
        let (lines, dropped) =
            self.flattened(node, state, figure, |walk, out| whole = walk.draw(node, tag, state, out))?;
        if !whole {
            self.note(Issue::Fault, node);
        }
        let is_only_fill = figure != Figure::Lines && state.style.stroke == svg_style::Paint::None;
        if dropped.hairlines && (is_only_fill || figure == Figure::Lines) {
            self.note(Issue::Hairline, node);
        }
        if dropped.dots && is_only_fill {
            self.note(Issue::Dot, node);
        }
        self.push(node, state, ink, figure, lines);
        Ok(dropped)
    }

    /// The polylines of what is drawn.
    fn flattened(
        &mut self,
        node: Node<'a, 'input>,
        state: &State,
        figure: Figure,
        draw: impl FnOnce(&mut Self, &mut Outline<'_>),
    ) -> Result<(Range<usize>, Dropped), Box<Diag>> {
        let mut lines = std::mem::take(&mut self.art.lines);
        let first = lines.len();
        let mut out = Outline::new(state.map, self.tolerance, figure == Figure::Lines, &mut lines);
        draw(self, &mut out);
        let ended = out.end();
        self.art.lines = lines;
        let dropped = ended.map_err(|stop| Box::new(self.stopped(stop, node)))?;
        Ok((first..self.art.lines.len(), dropped))
    }

    /// Makes a shape of polylines.
    fn push(&mut self, node: Node<'a, 'input>, state: &State, ink: Ink, figure: Figure, lines: Range<usize>) {
        if lines.is_empty() {
            return;
        }
        let (name, labels, clip) = (self.name(node), state.labels, state.clip);
        // What is translucent in the colour of the page is reported with the drawing as a whole.
        if ink.opacity < 1.0 && !self.marking.is_page(ink.colour) {
            self.note(Issue::Translucent, node);
        }
        self.art.shapes.push(Shape { name, labels, colour: ink.colour, opacity: ink.opacity, figure, lines, clip });
    }

    /// Draws a shape; returns whether its description was faultless.
    fn draw(&mut self, node: Node<'a, 'input>, tag: &str, state: &State, out: &mut impl Sink) -> bool {
        let text = |name: &str| node.attribute(name).unwrap_or_default();
        let style = &state.style;
        let of = |length: svg_style::Length, axis: usize| length.of(whole(state.port, axis));
        match tag {
            "path" => return path::path(style.d.as_deref().unwrap_or(text("d")), out),
            "polyline" => return path::points(text("points"), false, out),
            "polygon" => return path::points(text("points"), true, out),
            "line" => {
                let mut get = |name: &str, axis: usize| self.length(node, name, axis, state);
                out.move_to([get("x1", 0), get("y1", 1)]);
                out.line_to([get("x2", 0), get("y2", 1)]);
            }
            "rect" => {
                let side = |length: svg_style::Auto, axis: usize| length.map_or(0.0, |l| of(l, axis));
                let (p, size) = ([of(style.x, 0), of(style.y, 1)], [side(style.width, 0), side(style.height, 1)]);
                rect(p, size, radii(style, size, of), out);
            }
            "circle" => {
                let r = of(style.r, 2);
                ellipse([of(style.cx, 0), of(style.cy, 1)], [r, r], out);
            }
            _ => ellipse([of(style.cx, 0), of(style.cy, 1)], radii(style, [f64::INFINITY; 2], of), out),
        }
        true
    }
}

/// The area of a shape as it was drawn.
struct Filled {
    lines: Range<usize>,
    /// What bounds no area, and may still have a stroke.
    dropped: Dropped,
}

/// Radii of a rectangle's corners or of an ellipse: one that is not given equals the other.
fn radii(style: &Style, size: [f64; 2], of: impl Fn(svg_style::Length, usize) -> f64) -> [f64; 2] {
    let [rx, ry] = match [style.rx, style.ry] {
        [Some(rx), Some(ry)] => [of(rx, 0), of(ry, 1)],
        [Some(rx), None] => [of(rx, 0); 2],
        [None, Some(ry)] => [of(ry, 1); 2],
        [None, None] => [0.0; 2],
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
