//! The plotter: executes instructions, and puts what the pen draws into an artwork.

use std::f64::consts::TAU;
use terrace_core::math;

use super::encoded::{EncodedStep, EncodedSteps};
use super::polygon::PolygonBuffer;
use super::state::{PlotState, Scaling};
use super::syntax::Instruction;
use super::{Fault, Issue, PlotOptions, Tally, UNIT, fault, page};
use crate::texture::artwork::{
    Artwork, Colour, Labels, MAX_MM, MAX_POINTS, PaintedShape, ShapeFigure, WindingRule, disc, steps,
};
use crate::texture::clip::{extent, traced_twice};
use crate::texture::place::LEAST;
use terrace_core::diag::Diag;
use terrace_core::geom::PlanePoint;

/// Instructions that change nothing that is marked.
const QUIET: [&str; 32] = [
    "CO", "DT", "VS", "VN", "FS", "AS", "AP", "NP", "PT", "TR", "SV", "PS", "BP", "PG", "AF", "AH", "NR", "OE", "OS",
    "OP", "LA", "CT", "CR", "MC", "PC", "MG", "DI", "DR", "SI", "SR", "RF", "IM",
];

/// What the pen returns to when a polygon has been defined.
struct PenBefore {
    /// In plotter units.
    at: PlanePoint,
    is_down: bool,
}

pub(super) struct Plotter<'a> {
    options: &'a PlotOptions<'a>,
    state: PlotState,
    /// The stroke that is being drawn, mm.
    stroke: Vec<PlanePoint>,
    polygon: PolygonBuffer,
    /// The pen before the polygon that is being defined; None where none is.
    before_polygon: Option<PenBefore>,
    /// Whether the file moves a pen at all.
    pub(super) is_plot: bool,
    /// The byte at which the instruction that is executed stands.
    at: usize,
    pub(super) tally: Tally,
    pub(super) art: Artwork,
}

impl<'a> Plotter<'a> {
    pub(super) fn new(options: &'a PlotOptions<'a>) -> Self {
        Self {
            options,
            state: PlotState::default(),
            stroke: Vec::new(),
            polygon: PolygonBuffer::default(),
            before_polygon: None,
            is_plot: false,
            at: 0,
            tally: Tally::default(),
            art: Artwork::default(),
        }
    }

    /// Executes an instruction.
    pub(super) fn execute(&mut self, i: &Instruction) -> Result<(), Fault> {
        if i.values.iter().any(|v| !v.is_finite()) {
            return Err(fault(i, "has a value that is not a number"));
        }
        self.at = i.at;
        let v = i.values.as_slice();
        match (i.name.as_str(), v) {
            ("IN", _) => {
                self.reset()?;
                self.state = PlotState::default();
            }
            ("DF", _) => {
                self.reset()?;
                self.state.set_defaults();
            }
            ("PA" | "PR", _) => {
                self.state.is_relative = i.name == "PR";
                self.moves(i)?;
            }
            ("PU", _) => {
                self.lift()?;
                self.moves(i)?;
            }
            ("PD", _) => {
                self.put_down();
                self.moves(i)?;
            }
            ("SP", _) => {
                self.lift()?;
                self.state.pen = v.first().map_or(0, |p| *p as i64);
            }
            ("PW", _) => self.state.widths.set(v.first().copied(), v.get(1).map(|p| *p as i64)),
            ("WU", _) => self.state.widths.set_unit(v.first().is_some_and(|u| *u == 1.0)),
            ("LT", _) => self.state.is_dashed = !v.is_empty() && v[0].abs() != 7.0,
            ("FT", _) => self.state.is_patterned = v.first().is_some_and(|t| *t > 2.0),
            ("IP", [] | [_, _] | [_, _, _, _]) => self.state.set_corners(v),
            ("SC", []) => self.state.scaling = None,
            ("SC", &[x0, x1, y0, y1] | &[x0, x1, y0, y1, 0.0]) => {
                self.state.scaling = Some(Scaling { range: [x0, x1, y0, y1], at: i.at });
            }
            ("RO" | "IW", []) | ("RO", &[0.0]) => {}
            ("SC" | "IP" | "RO" | "IW", _) => return Err(page(&i.name, i.at)),
            ("CI", &[r, ..]) => self.circle(r)?,
            ("AA", &[x, y, angle, ..]) => self.arc(self.state.point([x, y])?, angle)?,
            ("AR", &[x, y, angle, ..]) => self.arc(self.state.point_from_pen([x, y])?, angle)?,
            ("EA", &[x, y]) if self.before_polygon.is_none() => {
                self.rectangle(self.state.point([x, y])?)?;
                self.edge();
            }
            ("RA", &[x, y]) if self.before_polygon.is_none() => {
                self.rectangle(self.state.point([x, y])?)?;
                self.fill(WindingRule::EvenOdd);
            }
            ("ER", &[x, y]) if self.before_polygon.is_none() => {
                self.rectangle(self.state.point_from_pen([x, y])?)?;
                self.edge();
            }
            ("RR", &[x, y]) if self.before_polygon.is_none() => {
                self.rectangle(self.state.point_from_pen([x, y])?)?;
                self.fill(WindingRule::EvenOdd);
            }
            ("PM", _) => self.polygon_mode(v.first().copied().unwrap_or(0.0))?,
            ("EP", _) => self.edge(),
            ("FP", _) => self.fill(if v.first() == Some(&1.0) { WindingRule::NonZero } else { WindingRule::EvenOdd }),
            ("PE", _) => self.encoded(i)?,
            ("LB" | "BL" | "SM" | "UC", _) => self.tally.note(Issue::Label, i.at),
            (name, _) if QUIET.contains(&name) => {}
            _ => self.tally.note_unread(i),
        }
        Ok(())
    }

    /// Lifts the pen, and forgets the polygon.
    fn reset(&mut self) -> Result<(), Fault> {
        self.lift()?;
        self.before_polygon = None;
        self.polygon = PolygonBuffer::default();
        Ok(())
    }

    /// The moves of `PA`, `PR`, `PU` and `PD`.
    fn moves(&mut self, i: &Instruction) -> Result<(), Fault> {
        self.is_plot = true;
        if i.values.len() % 2 == 1 {
            return Err(fault(i, "has an odd number of coordinates"));
        }
        for p in i.values.chunks_exact(2) {
            let p = [p[0], p[1]];
            let to = if self.state.is_relative { self.state.point_from_pen(p)? } else { self.state.point(p)? };
            self.go(to)?;
        }
        Ok(())
    }

    /// Moves the pen, with a mark where it is down.
    fn go(&mut self, to: PlanePoint) -> Result<(), Fault> {
        let from = mm(self.state.at)?;
        let end = mm(to)?;
        self.state.at = to;
        if self.before_polygon.is_some() {
            self.polygon.add(end, self.state.is_down);
        } else if self.state.is_down {
            if self.stroke.is_empty() {
                self.stroke.push(from);
            }
            self.stroke.push(end);
        }
        self.count()
    }

    /// Refuses a plot of too many points.
    fn count(&self) -> Result<(), Fault> {
        let polygon = if self.before_polygon.is_some() { self.polygon.point_count() } else { 0 };
        if self.art.lines.points.len() + self.stroke.len() + polygon <= MAX_POINTS {
            return Ok(());
        }
        let text = format!("the plot has more than {MAX_POINTS} points");
        Err(Diag::limit("texture-large", text).hint("use a larger tolerance or a simpler plot").into())
    }

    /// Puts the pen down, where it draws a point unless it moves.
    fn put_down(&mut self) {
        if !self.state.is_down {
            self.state.is_down = true;
            self.state.rests = true;
        }
    }

    /// Lifts the pen: what was drawn is a stroke, or a point where that has no extent.
    pub(super) fn lift(&mut self) -> Result<(), Fault> {
        self.end_stroke();
        if self.state.rests && self.before_polygon.is_none() {
            self.point()?;
        }
        self.state.is_down = false;
        self.state.rests = false;
        Ok(())
    }

    /// Makes a line of what the pen drew since it was put down.
    fn end_stroke(&mut self) {
        let mut stroke = std::mem::take(&mut self.stroke);
        stroke.dedup();
        if has_extent(&stroke) {
            self.state.rests = false;
            self.shape(&[stroke], ShapeFigure::Lines);
        }
    }

    /// A point under the pen.
    fn point(&mut self) -> Result<(), Fault> {
        if self.state.pen <= 0 {
            return Ok(());
        }
        let at = mm(self.state.at)?;
        let first = self.art.lines.len();
        let figure = match self.options.marking.point_disc_mm(self.state.width_mm(), self.options.widest_line) {
            Some(diameter) => {
                self.art.lines.push(&disc(at, diameter, self.options.tolerance));
                ShapeFigure::Stroke
            }
            None => {
                self.art.lines.push(&[at]);
                ShapeFigure::Lines
            }
        };
        self.put_shape("point", first, figure);
        self.count()
    }

    /// Lines or an area of the pen, unless it has none or its line or fill type is not read.
    fn shape(&mut self, lines: &[Vec<PlanePoint>], figure: ShapeFigure) {
        let lines: Vec<_> = lines.iter().filter(|line| has_extent(line)).collect();
        if lines.is_empty() || self.state.pen <= 0 {
            return;
        }
        if self.state.is_dashed && figure == ShapeFigure::Lines {
            return self.tally.note(Issue::Dash, self.at);
        }
        if self.state.is_patterned && figure != ShapeFigure::Lines {
            return self.tally.note(Issue::Fill, self.at);
        }
        let first = self.art.lines.len();
        for line in lines {
            match traced_twice(line, self.options.tolerance).filter(|_| figure == ShapeFigure::Lines) {
                Some(once) => self.art.lines.push(&once),
                None => self.art.lines.push(line),
            }
        }
        self.put_shape("stroke", first, figure);
    }

    /// Makes a shape of the lines from `first` on.
    fn put_shape(&mut self, what: &str, first: usize, figure: ShapeFigure) {
        let label = format!("pen:{}", self.state.pen);
        let known = self.art.labels.iter().position(|l| l.own[0] == label);
        let labels = known.unwrap_or_else(|| {
            self.art.labels.push(Labels { parent: None, own: vec![label] });
            self.art.labels.len() - 1
        });
        let number = self.art.shapes.len() + 1;
        self.art.names.push(format!("{what} {number}"));
        self.art.shapes.push(PaintedShape {
            name: u32::try_from(number - 1).expect("fewer strokes than points"),
            labels: u32::try_from(labels).expect("fewer pens than strokes"),
            colour: colour(self.state.pen),
            opacity: 1.0,
            figure,
            lines: first..self.art.lines.len(),
            clip: None,
        });
    }

    /// Moves the pen along an arc round `centre`, plotter units, over an angle in rad: a circle in the units of the
    /// plot.
    fn sweep(&mut self, centre: PlanePoint, by: f64) -> Result<(), Fault> {
        let factors = self.state.axes()?.map(|[factor, _]| factor);
        let d = [0, 1].map(|k| (self.state.at[k] - centre[k]) / factors[k]);
        let radius = math::hypot(d[0], d[1]) * factors[0].abs().max(factors[1].abs()) * UNIT;
        let steps = steps(by * by * radius, self.options.tolerance, (by.abs() * 2.0).ceil().max(1.0));
        if steps > MAX_POINTS as f64 || steps.is_nan() {
            return Err(Diag::limit("texture-large", format!("an arc of the plot has more than {MAX_POINTS} points"))
                .hint("use a larger tolerance")
                .into());
        }
        for k in 1..=steps as usize {
            let (sin, cos) = math::sin_cos(by * k as f64 / steps);
            let turned = [cos * d[0] - sin * d[1], sin * d[0] + cos * d[1]];
            self.go([0, 1].map(|k| centre[k] + factors[k] * turned[k]))?;
        }
        Ok(())
    }

    fn arc(&mut self, centre: PlanePoint, degrees: f64) -> Result<(), Fault> {
        self.is_plot = true;
        // More than one turn marks nothing new.
        self.sweep(centre, degrees.clamp(-360.0, 360.0).to_radians())
    }

    /// A circle round the pen, which draws it whether it is up or down, and comes back.
    fn circle(&mut self, r: f64) -> Result<(), Fault> {
        self.is_plot = true;
        self.end_stroke();
        let centre = self.state.at;
        let was_down = self.state.is_down;
        let rested = self.state.rests;
        let start = self.state.point_from_pen([r, 0.0])?;
        if self.before_polygon.is_some() {
            self.end_ring();
        }
        self.state.is_down = false;
        self.go(start)?;
        self.state.is_down = true;
        self.sweep(centre, TAU)?;
        if self.before_polygon.is_some() {
            self.end_ring();
        } else if let [first, .., last] = self.stroke.as_mut_slice() {
            // Ends where it started, exactly.
            *last = *first;
        }
        self.end_stroke();
        self.state.at = centre;
        self.state.is_down = was_down;
        self.state.rests = rested;
        Ok(())
    }

    /// The corners of a rectangle from the pen to a point become the polygon, which is drawn or filled next.
    fn rectangle(&mut self, to: PlanePoint) -> Result<(), Fault> {
        self.is_plot = true;
        self.end_stroke();
        // What the pen draws from where it stands is not a point.
        self.state.rests = false;
        let [a, b] = [self.state.at, to];
        let mut ring = Vec::new();
        for p in [a, [b[0], a[1]], b, [a[0], b[1]], a] {
            ring.push(mm(p)?);
        }
        self.polygon = PolygonBuffer::of_ring(&ring);
        Ok(())
    }

    /// `PM`: 0 begins a polygon, 1 another ring of it, 2 ends it. A ring is closed by an edge where the pen is down.
    /// What defines the polygon draws nothing, and the pen is then where and as it was before.
    fn polygon_mode(&mut self, mode: f64) -> Result<(), Fault> {
        self.is_plot = true;
        if mode == 0.0 {
            self.end_stroke();
            self.state.rests = false;
            self.polygon = PolygonBuffer::default();
            self.polygon.begin();
            self.polygon.add(mm(self.state.at)?, false);
            self.before_polygon = Some(PenBefore { at: self.state.at, is_down: self.state.is_down });
        } else if self.before_polygon.is_some() {
            self.end_ring();
        }
        if mode == 2.0
            && let Some(PenBefore { at, is_down }) = self.before_polygon.take()
        {
            self.state.at = at;
            self.state.is_down = is_down;
            self.state.rests = false;
        }
        Ok(())
    }

    /// Ends the ring of the polygon that is being defined.
    fn end_ring(&mut self) {
        if self.state.is_down {
            self.polygon.close();
        }
        self.polygon.begin();
    }

    /// Draws the edges of the polygon that the pen drew.
    fn edge(&mut self) {
        self.end_stroke();
        self.shape(&self.polygon.edges(), ShapeFigure::Lines);
    }

    /// Fills the polygon.
    fn fill(&mut self, rule: WindingRule) {
        self.end_stroke();
        self.shape(&self.polygon.contours(), ShapeFigure::Fill(rule));
    }

    /// Draws an encoded polyline (`PE`).
    fn encoded(&mut self, i: &Instruction) -> Result<(), Fault> {
        self.is_plot = true;
        self.lift()?;
        let mut steps = EncodedSteps::new(&i.code);
        while let Some(step) = steps.step().map_err(|what| fault(i, what))? {
            match step {
                EncodedStep::Pen(pen) => {
                    self.lift()?;
                    self.state.pen = pen;
                }
                EncodedStep::Move { by, is_up, is_absolute } => {
                    let to = if is_absolute { self.state.point(by)? } else { self.state.point_from_pen(by)? };
                    if is_up {
                        self.lift()?;
                    } else {
                        self.put_down();
                    }
                    self.go(to)?;
                }
            }
        }
        Ok(())
    }
}

fn has_extent(line: &[PlanePoint]) -> bool {
    let [w, h] = extent(line);
    line.len() > 1 && w.max(h) >= LEAST
}

/// From plotter units.
fn mm(p: PlanePoint) -> Result<PlanePoint, Fault> {
    let p = p.map(|v| v * UNIT);
    if p.iter().all(|v| v.abs() <= MAX_MM) {
        return Ok(p);
    }
    Err(Diag::input("texture-far", "the plot reaches beyond any part").hint("check its coordinates").into())
}

fn colour(pen: i64) -> Colour {
    const PENS: [Colour; 7] =
        [[0; 3], [255, 0, 0], [0, 255, 0], [255, 255, 0], [0, 0, 255], [255, 0, 255], [0, 255, 255]];
    PENS[(pen - 1).rem_euclid(7) as usize]
}
