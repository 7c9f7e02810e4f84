//! What all charts have: title, legend, frame with axes. Written from the top down.

use std::fmt::Write;

use svg::Node;
use svg::node::element::Element;

use super::ticks::{Ruler, TickSpace};
use super::{Look, Plot, Style, WIDTH, words};
use crate::report::colour::{Colour, hex};
use crate::report::sheet::{FONTS, el, num, rectangle, text, titled};

/// Air round the drawing.
pub const MARGIN: f64 = 16.0;
/// Sizes of text: most of it, labels of ticks, the title.
pub(crate) const FONT: f64 = 13.0;
pub const SMALL: f64 = 12.0;
const TITLE: f64 = 17.0;
/// From one line of text to the next.
pub const LINE: f64 = 18.0;
/// Colour of frames and ticks.
const FRAME: &str = "#555";
const GRID: &str = "#e2e2e2";

/// What stands before a name in the legend.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Swatch {
    Line(Style, Look),
    Fill(Colour),
}

/// Left, top, right, bottom.
pub type Rect = [f64; 4];

/// A chart that is being drawn.
pub struct Canvas {
    title: String,
    parts: Vec<Element>,
    /// How far down it is drawn.
    pub at: f64,
}

impl Canvas {
    pub fn new(title: &str) -> Self {
        let mut canvas = Self { title: title.to_owned(), parts: Vec::new(), at: MARGIN };
        for line in words::lines(title, TITLE, (WIDTH - 2.0 * MARGIN) / words::BOLD) {
            canvas.at += 1.2 * TITLE;
            let mut t = text([MARGIN, canvas.at - 0.3 * TITLE], TITLE, "start", &line);
            t.assign("font-weight", "bold");
            canvas.parts.push(t);
        }
        canvas.at += 4.0;
        canvas
    }

    pub fn push(&mut self, e: Element) {
        self.parts.push(e);
    }

    /// Words at a point, their foot `down` below its middle line; cut to a width.
    pub fn words(&mut self, at: [f64; 2], font: f64, anchor: &str, content: &str, limit: f64) {
        let cut = words::fitted(content, font, limit);
        let t = text([at[0], at[1] + 0.36 * font], font, anchor, &cut);
        self.parts.push(if cut == content { t } else { titled(t, crate::report::clean(content)) });
    }

    /// Names with what they stand for, in as many lines as they need.
    pub fn legend(&mut self, entries: &[(&str, Swatch)]) {
        const GAP: f64 = 22.0;
        if entries.is_empty() {
            return;
        }
        let mut x = MARGIN;
        self.at += LINE / 2.0;
        for &(name, swatch) in entries {
            let sign = if matches!(swatch, Swatch::Fill(_)) { 16.0 } else { 30.0 };
            let limit = WIDTH - 2.0 * MARGIN - sign - 6.0;
            let wide = sign + 6.0 + words::width(&words::fitted(name, FONT, limit), FONT);
            if x > MARGIN && x + wide > WIDTH - MARGIN {
                x = MARGIN;
                self.at += LINE;
            }
            let y = self.at;
            match swatch {
                Swatch::Fill(colour) => {
                    self.push(rectangle([x, y - 7.0, x + sign, y + 7.0], &[("fill", &hex(colour))]));
                }
                Swatch::Line(style, look) => {
                    self.line(&[vec![[x, y], [x + sign, y]]], style);
                    if look == Look::LineAndMarks {
                        self.marks([[x + sign / 2.0, y]].into_iter(), style);
                    }
                }
            }
            self.words([x + sign + 6.0, y], FONT, "start", name, limit);
            x += wide + GAP;
        }
        self.at += LINE / 2.0 + 6.0;
    }

    /// Runs of points as one line; a run of one point is a dot.
    pub fn line(&mut self, runs: &[Vec<[f64; 2]>], style: Style) {
        let mut d = String::new();
        for run in runs.iter().filter(|run| run.len() > 1) {
            for (k, [x, y]) in run.iter().enumerate() {
                let _ = write!(d, "{}{} {}", if k == 0 { 'M' } else { 'L' }, tenth(*x), tenth(*y));
            }
        }
        let colour = style.hex();
        if !d.is_empty() {
            let look =
                [("fill", "none"), ("stroke", colour.as_str()), ("stroke-width", "1.6"), ("stroke-linejoin", "round")];
            let mut path = el("path", &look);
            if !style.dash.is_empty() {
                path.assign("stroke-dasharray", style.dash);
            }
            path.assign("d", d);
            self.push(path);
        }
        for [x, y] in runs.iter().filter(|run| run.len() == 1).flatten() {
            self.push(el("circle", &[("cx", &tenth(*x)), ("cy", &tenth(*y)), ("r", "1.6"), ("fill", &colour)]));
        }
    }

    /// A mark at each point: disc, square, diamond or triangle.
    pub fn marks(&mut self, points: impl Iterator<Item = [f64; 2]>, style: Style) {
        let mut d = String::new();
        for [x, y] in points {
            let [x, y] = [tenth(x), tenth(y)];
            let shape = match style.shape {
                0 => "m-4 0a4 4 0 1 0 8 0a4 4 0 1 0 -8 0z",
                1 => "m-3.6 -3.6h7.2v7.2h-7.2z",
                2 => "m0 -5l5 5l-5 5l-5 -5z",
                _ => "m0 -5l4.6 8h-9.2z",
            };
            let _ = write!(d, "M{x} {y}{shape}");
        }
        if !d.is_empty() {
            self.push(el("path", &[("fill", &style.hex()), ("stroke", "#fff"), ("stroke-width", ".8"), ("d", &d)]));
        }
    }

    /// Grid, frame, ticks and labels round a place; where `y` is None only what belongs to the other axis.
    pub fn frame(&mut self, [left, top, right, bottom]: Rect, x: &Ruler, y: Option<&Ruler>, x_labels: XLabels) {
        let mut minor = String::new();
        let mut major = String::new();
        let mut ticks = String::new();
        for tick in &x.ticks {
            let at = tenth(left + x.share(tick.value) * (right - left));
            let d = if tick.label.is_empty() { &mut minor } else { &mut major };
            let _ = write!(d, "M{at} {}V{}", tenth(top), tenth(bottom));
            if !tick.label.is_empty() {
                let _ = write!(ticks, "M{at} {}v4", tenth(bottom));
            }
        }
        for tick in y.map_or(&[][..], |y| &y.ticks) {
            let at = tenth(bottom - y.map_or(0.0, |y| y.share(tick.value)) * (bottom - top));
            let d = if tick.label.is_empty() { &mut minor } else { &mut major };
            let _ = write!(d, "M{} {at}H{}", tenth(left), tenth(right));
            if !tick.label.is_empty() {
                let _ = write!(ticks, "M{} {at}h-4", tenth(left));
            }
        }
        let _ = write!(ticks, "M{0} {1}H{2}V{3}H{0}z", tenth(left), tenth(top), tenth(right), tenth(bottom));
        for (d, stroke, width) in [(minor, GRID, "0.5"), (major, GRID, "1"), (ticks, FRAME, "1")] {
            if !d.is_empty() {
                self.push(el("path", &[("fill", "none"), ("stroke", stroke), ("stroke-width", width), ("d", &d)]));
            }
        }
        for tick in x.ticks.iter().filter(|t| x_labels == XLabels::Below && !t.label.is_empty()) {
            let at = left + x.share(tick.value) * (right - left);
            self.words([at, bottom + 14.0], SMALL, "middle", &tick.label, f64::INFINITY);
        }
        for tick in y.iter().flat_map(|y| &y.ticks).filter(|t| !t.label.is_empty()) {
            let at = bottom - y.map_or(0.0, |y| y.share(tick.value)) * (bottom - top);
            self.words([left - 7.0, at], SMALL, "end", &tick.label, f64::INFINITY);
        }
    }

    /// The name of the axis below a frame; ends the part of the drawing that the frame is in.
    pub(crate) fn x_title(&mut self, [left, _, right, bottom]: Rect, x: &Ruler) {
        let half = ((left + right) / 2.0 - MARGIN).min(WIDTH - MARGIN - (left + right) / 2.0);
        self.words([(left + right) / 2.0, bottom + 34.0], FONT, "middle", &x.title, 2.0 * half);
        self.at = bottom + 46.0;
    }

    pub fn finish(self) -> Plot {
        let height = (self.at + MARGIN / 2.0).ceil();
        let (wide, high) = (num(WIDTH), num(height));
        let root = el(
            "svg",
            &[
                ("xmlns", "http://www.w3.org/2000/svg"),
                ("viewBox", &format!("0 0 {wide} {high}")),
                ("role", "img"),
                ("font-family", FONTS),
                ("fill", "#1a1a1a"),
            ],
        );
        let mut root = titled(root, crate::report::clean(&self.title));
        root.append(rectangle([0.0, 0.0, WIDTH, height], &[("fill", "#fff")]));
        self.parts.into_iter().for_each(|e| root.append(e));
        Plot { title: self.title, element: root.to_string() }
    }
}

/// Whether the labels of the horizontal axis stand below a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum XLabels {
    /// They do.
    Below,
    /// They stand below another frame, which has the same axis.
    Elsewhere,
}

/// Space for the labels of an axis along the foot of a frame, whose labels may reach to the rim of the drawing.
pub fn foot([left, right]: [f64; 2]) -> TickSpace {
    let beyond = [left - 4.0, WIDTH - right - 4.0];
    TickSpace { length: right - left, beyond, is_level: true, font: SMALL }
}

/// Space for the labels of an axis up the side of a frame.
pub fn side(height: f64) -> TickSpace {
    TickSpace { length: height, beyond: [SMALL; 2], is_level: false, font: SMALL }
}

/// A coordinate to a tenth of a unit.
pub fn tenth(v: f64) -> String {
    num((v * 10.0).round() / 10.0)
}
