//! Charts: lines over an axis, stacked bars, paths in the plane.
//!
//! Consumes numbers with their names and units, whatever they measure; promises an SVG of [`WIDTH`] units, which fills
//! the window that it is opened in, whose text overlaps no other text and is nowhere cut, equal byte for byte for equal input. The legend is above
//! the plot, names of limits next to it. Colours differ in grey too; from the ninth series on only dashes tell series
//! of one colour apart.
//!
//! Limits: what is not finite, beyond 1e100 or on a logarithmic axis not above 0 is a gap. Widths of text are
//! estimated for a wide face; names that are wider than their place end in "…". Long series
//! are drawn as at most two points for each unit of width, paths within a third of a unit.

mod bars;
mod canvas;
mod lines;
mod paths;
#[cfg(test)]
mod tests;
mod thin;
mod ticks;
mod words;

use super::colour::hex;

/// Width of every chart, in units of the drawing.
pub const WIDTH: f64 = 960.0;

/// The unit that suits times up to `most_s`, and how many seconds it has.
pub fn time_unit(most_s: f64) -> (&'static str, f64) {
    match most_s {
        ..180.0 => ("s", 1.0),
        ..10_800.0 => ("min", 60.0),
        ..400_000.0 => ("h", 3600.0),
        _ => ("days", 86_400.0),
    }
}

/// A chart that is drawn.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Plot {
    title: String,
    element: String,
}

impl Plot {
    /// The title of the plot.
    pub fn title(&self) -> &str {
        &self.title
    }
    /// The text of an SVG file.
    pub fn file(&self) -> String {
        format!("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n{}\n", self.element)
    }
    /// The picture as an SVG element to stand in a page.
    pub fn element(&self) -> &str {
        &self.element
    }
}

/// What an axis measures.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Axis {
    name: String,
    unit: String,
    is_log: bool,
}

impl Axis {
    /// A name and a unit, which may be empty.
    pub fn new(name: &str, unit: &str) -> Self {
        Self { name: name.to_owned(), unit: unit.to_owned(), is_log: false }
    }
    /// An axis on which equal factors are equal distances.
    pub fn log(self) -> Self {
        Self { is_log: true, ..self }
    }
}

/// How the points of a series are shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Look {
    Line,
    LineAndMarks,
}

/// Named points. One that is not finite is a gap in the line. Series of one name share their look in the
/// legend and in all panels; a series without a name is not in the legend.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    name: String,
    points: Vec<[f64; 2]>,
    look: Look,
}

impl Series {
    /// A line through points in their order.
    pub fn new(name: &str, points: Vec<[f64; 2]>) -> Self {
        Self { name: name.to_owned(), points, look: Look::Line }
    }
    /// A line with a mark at every point, where there are at most [`MARKS`].
    pub fn marked(self) -> Self {
        Self { look: Look::LineAndMarks, ..self }
    }
}

/// Points of a series that get marks at most; more would run into one another.
pub const MARKS: usize = 400;

/// A value that is not to be passed, with its name.
#[derive(Clone, Debug, PartialEq)]
pub struct Limit {
    name: String,
    value: f64,
}

impl Limit {
    /// The label shows name, value and unit of the axis.
    pub fn new(name: &str, value: f64) -> Self {
        Self { name: name.to_owned(), value }
    }
    /// Name, value and unit; of what is wider than there is room for, the name is cut.
    fn label(&self, unit: &str, font: f64, room: f64) -> String {
        let value = format!("{} {unit}", ticks::brief(self.value));
        let name = words::fitted(&self.name, font, room - words::width(&format!(" {value}"), font));
        format!("{name} {value}").trim().to_owned()
    }
}

/// Series over one vertical axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Panel {
    /// What is measured upwards.
    pub y: Axis,
    /// The lines.
    pub series: Vec<Series>,
    /// Lines across.
    pub limits: Vec<Limit>,
}

/// Panels one above the other over a common horizontal axis.
#[derive(Clone, Debug, PartialEq)]
pub struct LineChart {
    /// Title.
    pub title: String,
    /// What is measured to the right.
    pub x: Axis,
    /// From the top down.
    pub panels: Vec<Panel>,
    /// Lines upwards through all panels.
    pub limits: Vec<Limit>,
}

/// Bars to the right, one below the other, each the sum of its parts.
#[derive(Clone, Debug, PartialEq)]
pub struct Bars {
    /// Title.
    pub title: String,
    /// What the length of a bar measures. In s it is shown as people say times.
    pub value: Axis,
    /// Names of the parts.
    pub parts: Vec<String>,
    /// The bars.
    pub rows: Vec<Bar>,
}

/// A bar of [`Bars`].
#[derive(Clone, Debug, PartialEq)]
pub struct Bar {
    /// The name of the bar.
    pub name: String,
    /// The parts of the bar in their order; one without parts is shown as "-".
    pub parts: Vec<f64>,
    /// Whether the bar is drawn in grey, hatched: what it shows must not be used.
    pub is_hatched: bool,
}

/// Paths in the plane, equal scales both ways.
#[derive(Clone, Debug, PartialEq)]
pub struct Paths {
    /// Title.
    pub title: String,
    /// To the right.
    pub x: String,
    /// Upwards.
    pub y: String,
    /// Unit of both.
    pub unit: String,
    /// The paths, the last on top.
    pub series: Vec<Series>,
}

/// How a series is told from the others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Style {
    colour: super::colour::Colour,
    dash: &'static str,
    /// Which shape marks its points.
    shape: usize,
}

/// Of series number `k`: four colours far apart in lightness, unbroken, four more with dashes, then the
/// same with other dashes.
fn style(k: usize) -> Style {
    let dash = ["", "8 3", "2 3", "9 3 2 3"][k / 4 % 4];
    Style { colour: super::colour::SERIES[k % 8], dash, shape: k % 4 }
}

impl Style {
    fn hex(self) -> String {
        hex(self.colour)
    }
}
