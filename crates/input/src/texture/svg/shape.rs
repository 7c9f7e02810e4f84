//! Shapes: their subpaths, and the lines and areas that their paint makes of them.

use std::ops::Range;

use kurbo::Cap;
use roxmltree::Node;
use svg_style::{Layer, Style};

use super::outline::{DroppedSubpaths, Outline, OutlineUse, Sink};
use super::path;
use super::servers::ResolvedPaint;
use super::state::{ElementState, PaintedPart};
use super::stroke::{Curves, Pen, TooMany};
use super::style::{Ink, rule};
use super::tally::Issue;
use super::walk::{Purpose, Walk, WalkResult, whole};
use crate::texture::artwork::{Colour, PaintedShape, ShapeFigure, StrokeMode};
use terrace_core::diag::Diag;

/// How finely curves of strokes are approximated, as a share of the tolerance, before they are flattened.
const FINE: f64 = 0.1;

impl<'a, 'input> Walk<'a, 'input> {
    /// Draws a shape as the purpose asks for.
    pub(super) fn shape(&mut self, node: Node<'a, 'input>, tag: &str, outer: &ElementState) -> WalkResult {
        let Some(state) = &self.enter(node, outer)? else { return Ok(()) };
        let style = &state.style;
        let black = Colour::default();
        match self.purpose {
            Purpose::Bounds => {
                return self.subpaths(node, tag, state, Ink::plain(black), ShapeFigure::Lines).map(|_| ());
            }
            Purpose::Clip if style.visible => {
                let figure = ShapeFigure::Fill(rule(style.clip_rule));
                return self.subpaths(node, tag, state, Ink::plain(black), figure).map(|_| ());
            }
            Purpose::Clip => return Ok(()),
            Purpose::Mark | Purpose::Mask => {}
        }
        let order_of = |layer: Layer| style.paint_order.iter().position(|l| *l == layer);
        if order_of(Layer::Stroke) < order_of(Layer::Fill) {
            self.stroke(node, tag, state, None)?;
            return self.fill(node, tag, state).map(|_| ());
        }
        let filled = self.fill(node, tag, state)?;
        self.stroke(node, tag, state, filled)
    }

    /// Draws the area of a shape; returns its polylines, and whether it has points that are not numbers.
    fn fill(
        &mut self,
        node: Node<'a, 'input>,
        tag: &str,
        state: &ElementState,
    ) -> Result<Option<FilledArea>, Box<Diag>> {
        if tag == "line" {
            return Ok(None);
        }
        match self.paint(node, state, PaintedPart::Fill)? {
            ResolvedPaint::None => Ok(None),
            ResolvedPaint::Ink(ink) => {
                let first = self.art.lines.len();
                let figure = ShapeFigure::Fill(rule(state.style.fill_rule));
                let dropped = self.subpaths(node, tag, state, ink, figure)?;
                Ok(Some(FilledArea { lines: first..self.art.lines.len(), dropped }))
            }
            ResolvedPaint::Pattern(pattern) => self.painted(node, tag, state, pattern).map(|()| None),
        }
    }

    /// Draws the stroke of a shape along its centre, or as the area that it covers.
    fn stroke(
        &mut self,
        node: Node<'a, 'input>,
        tag: &str,
        state: &ElementState,
        filled: Option<FilledArea>,
    ) -> WalkResult {
        let Some(mut pen) = self.pen(node, state) else { return Ok(()) };
        let ink = match self.paint(node, state, PaintedPart::Stroke)? {
            ResolvedPaint::None => return Ok(()),
            ResolvedPaint::Ink(ink) => ink,
            ResolvedPaint::Pattern(_) => {
                self.note(Issue::Paint, node);
                return Ok(());
            }
        };
        let figure = if self.is_line(ink, &pen, state) { ShapeFigure::Lines } else { ShapeFigure::Stroke };
        if figure == ShapeFigure::Lines && pen.dashes.is_empty() {
            return self.full_line(node, tag, state, ink, &pen, filled);
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
            self.dots(node, state, ink, &pen, &dots, figure)?;
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
            if figure == ShapeFigure::Lines {
                self.dots(node, state, ink, &pen, &curves.take_dots(2.0 * least), figure)?;
            }
        }
        if figure == ShapeFigure::Stroke {
            curves.widen(&pen);
        }
        let (lines, dropped) = self.flattened(node, state, figure, |_, out| curves.draw(out))?;
        // Of an area, contours without extent may be parts of its caps and joins.
        if figure == ShapeFigure::Lines && dropped.hairlines {
            self.note(Issue::Hairline, node);
        }
        self.push(node, state, ink, figure, lines);
        Ok(())
    }

    /// Whether a stroke is marked along its centre, and not as the area that it covers.
    fn is_line(&self, ink: Ink, pen: &Pen, state: &ElementState) -> bool {
        let width = pen.width * state.map.enlarges();
        // A line of the page's colour hides what it covers.
        self.purpose == Purpose::Mark
            && !self.marking.is_page(ink.colour)
            && match self.marking.stroke {
                StrokeMode::Centre => true,
                StrokeMode::Shown => width <= self.widest_line || state.style.is_hairline(),
                // A hairline has no width at any zoom, so it covers no area.
                StrokeMode::Outline | StrokeMode::Hatch => state.style.is_hairline(),
            }
    }

    /// Draws a stroke without dashes along its centre.
    fn full_line(
        &mut self,
        node: Node<'a, 'input>,
        tag: &str,
        state: &ElementState,
        ink: Ink,
        pen: &Pen,
        filled: Option<FilledArea>,
    ) -> WalkResult {
        let dropped = match filled {
            // The same polylines as those of the area, unless that left out some which are lines all the same.
            Some(FilledArea { lines, dropped }) if !dropped.hairlines => {
                self.push(node, state, ink, ShapeFigure::Lines, lines);
                dropped
            }
            _ => self.subpaths(node, tag, state, ink, ShapeFigure::Lines)?,
        };
        if dropped.dots {
            let mut curves = Curves::new(self.tolerance * FINE / state.map.enlarges());
            self.draw(node, tag, state, &mut curves);
            self.dots(node, state, ink, pen, &curves.take_dots(0.0), ShapeFigure::Lines)?;
        }
        Ok(())
    }

    /// Draws points: discs or squares where the stroke is wider than a line, else dots of the pen.
    fn dots(
        &mut self,
        node: Node<'a, 'input>,
        state: &ElementState,
        ink: Ink,
        pen: &Pen,
        dots: &[[f64; 2]],
        figure: ShapeFigure,
    ) -> WalkResult {
        if pen.cap == Cap::Butt || dots.is_empty() {
            if !dots.is_empty() {
                self.note(Issue::Dot, node);
            }
            return Ok(());
        }
        if figure == ShapeFigure::Lines {
            let first = self.art.lines.len();
            dots.iter().for_each(|&dot| self.art.lines.push(&[state.map.at(dot)]));
            let lines = first..self.art.lines.len();
            self.push(node, state, ink, ShapeFigure::Lines, lines);
            return Ok(());
        }
        let half = pen.width / 2.0;
        let (lines, _) = self.flattened(node, state, ShapeFigure::Stroke, |_, out| {
            for &[x, y] in dots {
                match pen.cap {
                    Cap::Round => out.ellipse([x, y], half, half),
                    _ => rect([x - half, y - half], [pen.width; 2], [0.0; 2], out),
                }
            }
        })?;
        self.push(node, state, ink, ShapeFigure::Stroke, lines);
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

    /// How the stroke of a shape is drawn, in its units; None where it has no width or cannot be drawn.
    fn pen(&mut self, node: Node<'a, 'input>, state: &ElementState) -> Option<Pen> {
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
        Some(Pen {
            width,
            cap: style.stroke_linecap,
            join,
            miter: style.stroke_miterlimit,
            dashes,
            offset: length(style.stroke_dashoffset),
        })
    }

    /// Draws the subpaths of a shape as one figure; returns what of them is not drawn.
    pub(super) fn subpaths(
        &mut self,
        node: Node<'a, 'input>,
        tag: &str,
        state: &ElementState,
        ink: Ink,
        figure: ShapeFigure,
    ) -> Result<DroppedSubpaths, Box<Diag>> {
        let mut is_faultless = true;
        let (lines, dropped) =
            self.flattened(node, state, figure, |walk, out| is_faultless = walk.draw(node, tag, state, out))?;
        if !is_faultless {
            self.note(Issue::Fault, node);
        }
        let is_only_fill = figure != ShapeFigure::Lines && state.style.stroke == svg_style::Paint::None;
        if dropped.hairlines && (is_only_fill || figure == ShapeFigure::Lines) {
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
        state: &ElementState,
        figure: ShapeFigure,
        draw: impl FnOnce(&mut Self, &mut Outline<'_>),
    ) -> Result<(Range<usize>, DroppedSubpaths), Box<Diag>> {
        let mut lines = std::mem::take(&mut self.art.lines);
        let first = lines.len();
        let outline_use = if figure == ShapeFigure::Lines { OutlineUse::Line } else { OutlineUse::Area };
        let mut out = Outline::new(state.map, self.tolerance, outline_use, &mut lines);
        draw(self, &mut out);
        let ended = out.end();
        self.art.lines = lines;
        let dropped = ended.map_err(|stop| Box::new(self.stopped(stop, node)))?;
        Ok((first..self.art.lines.len(), dropped))
    }

    /// Makes a shape of polylines.
    fn push(
        &mut self,
        node: Node<'a, 'input>,
        state: &ElementState,
        ink: Ink,
        figure: ShapeFigure,
        lines: Range<usize>,
    ) {
        if lines.is_empty() {
            return;
        }
        let name = self.name(node);
        // What is translucent in the colour of the page is reported with the drawing as a whole.
        if ink.opacity < 1.0 && !self.marking.is_page(ink.colour) {
            self.note(Issue::Translucent, node);
        }
        self.art.shapes.push(PaintedShape {
            name,
            labels: state.labels,
            colour: ink.colour,
            opacity: ink.opacity,
            figure,
            lines,
            clip: state.clip,
        });
    }

    /// Draws a shape; returns whether its description was faultless.
    fn draw(&mut self, node: Node<'a, 'input>, tag: &str, state: &ElementState, out: &mut impl Sink) -> bool {
        let text = |name: &str| node.attribute(name).unwrap_or_default();
        let style = &state.style;
        let resolved = |length: svg_style::Length, axis: usize| length.of(whole(state.port, axis));
        match tag {
            "path" => return path::path(style.d.as_deref().unwrap_or(text("d")), out),
            "polyline" => return path::polyline(text("points"), out),
            "polygon" => return path::polygon(text("points"), out),
            "line" => {
                out.move_to([self.length(node, "x1", 0, state), self.length(node, "y1", 1, state)]);
                out.line_to([self.length(node, "x2", 0, state), self.length(node, "y2", 1, state)]);
            }
            "rect" => {
                let side = |length: svg_style::Auto, axis: usize| length.map_or(0.0, |l| resolved(l, axis));
                let corner = [resolved(style.x, 0), resolved(style.y, 1)];
                let size = [side(style.width, 0), side(style.height, 1)];
                rect(corner, size, radii(style, size, resolved), out);
            }
            "circle" => {
                let r = resolved(style.r, 2);
                ellipse([resolved(style.cx, 0), resolved(style.cy, 1)], [r, r], out);
            }
            _ => {
                let centre = [resolved(style.cx, 0), resolved(style.cy, 1)];
                ellipse(centre, radii(style, [f64::INFINITY; 2], resolved), out);
            }
        }
        true
    }
}

/// The area of a shape as it was drawn.
struct FilledArea {
    lines: Range<usize>,
    /// What bounds no area, and may still have a stroke.
    dropped: DroppedSubpaths,
}

/// Radii of a rectangle's corners or of an ellipse: one that is not given equals the other; `resolved` gives a length
/// along an axis in user units.
fn radii(style: &Style, size: [f64; 2], resolved: impl Fn(svg_style::Length, usize) -> f64) -> [f64; 2] {
    let [rx, ry] = match [style.rx, style.ry] {
        [Some(rx), Some(ry)] => [resolved(rx, 0), resolved(ry, 1)],
        [Some(rx), None] => [resolved(rx, 0); 2],
        [None, Some(ry)] => [resolved(ry, 1); 2],
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
