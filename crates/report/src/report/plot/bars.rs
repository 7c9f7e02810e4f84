//! Stacked bars to the right, with their totals at the end.

use svg::Node;

use super::canvas::{Canvas, FONT, MARGIN, SMALL, Swatch, XLabels, foot, tenth};
use super::ticks::{AxisEnds, Ruler, brief, is_shown};
use super::{Axis, Bar, Bars, Plot, WIDTH, words};
use crate::report::colour::{self, Colour, hex};
use crate::report::legend::PARTS;
use crate::report::sheet::{el, rectangle, text, titled};
use terrace_core::duration::duration;

/// Height of a bar, and from one to the next.
const HIGH: f64 = 24.0;
const PITCH: f64 = 36.0;
/// Widest line of a name and widest total.
const NAME: f64 = 210.0;
const TOTAL: f64 = 160.0;

impl Bars {
    /// Draws it. Parts of the job time have the colours that they have in the report of a job.
    pub fn draw(&self) -> Plot {
        let mut canvas = Canvas::new(&self.title);
        let colours = colours(&self.parts);
        let entries: Vec<(&str, Swatch)> =
            self.parts.iter().zip(&colours).map(|(name, &c)| (name.as_str(), Swatch::Fill(c))).collect();
        canvas.legend(&entries);
        let totals: Vec<Option<f64>> = self.rows.iter().map(|row| total(&row.parts)).collect();
        let most = totals.iter().flatten().copied().fold(0.0, f64::max);
        let names: Vec<Vec<String>> = self.rows.iter().map(|row| two_lines(&row.name)).collect();
        let widest = names.iter().flatten().map(|line| words::width(line, FONT)).fold(0.0, f64::max);
        let ends = totals.iter().map(|&t| words::bold_width(&self.said(t), FONT).min(TOTAL)).fold(20.0, f64::max);
        let (left, right) = (MARGIN + widest + 10.0, WIDTH - MARGIN - ends - 10.0);
        let (axis, unit) = self.axis(most);
        let range = Some([0.0, if most > 0.0 { most / unit } else { 1.0 }]);
        let x = Ruler::new(&axis, range, AxisEnds::AtValues, foot([left, right]));
        let top = canvas.at + 4.0;
        let rect = [left, top, right, top + PITCH * self.rows.len() as f64];
        canvas.frame(rect, &x, None, XLabels::Below);
        let scale = if most > 0.0 { (right - left) / most } else { 0.0 };
        for (k, (Bar { parts, is_hatched, .. }, total)) in self.rows.iter().zip(&totals).enumerate() {
            let middle = top + PITCH * (k as f64 + 0.5);
            for (n, line) in names[k].iter().enumerate() {
                let y = middle + 15.0 * (n as f64 - (names[k].len() - 1) as f64 / 2.0);
                canvas.words([left - 8.0, y], FONT, "end", line, NAME);
            }
            let mut at = left;
            for (part, &v) in parts.iter().enumerate().filter(|(_, v)| is_shown(**v, true)) {
                let colour = colours.get(part).copied().unwrap_or(colour::SPARE);
                let colour = (!is_hatched).then_some(colour);
                let name = self.parts.get(part).map_or("", String::as_str);
                self.part(&mut canvas, [at, middle, at + v * scale], colour, name, v);
                at += v * scale;
            }
            if *is_hatched {
                hatch(&mut canvas, [left, middle, at]);
            }
            let mut t = text(
                [at + 8.0, middle + 0.36 * FONT],
                FONT,
                "start",
                &words::fitted(&self.said(*total), FONT, TOTAL / words::BOLD),
            );
            t.assign("font-weight", "bold");
            canvas.push(t);
        }
        canvas.x_title(rect, &x);
        canvas.finish()
    }

    /// A part of a bar from left to right about its middle, with its value where that has room; of no colour it is grey
    /// and will be hatched.
    fn part(&self, canvas: &mut Canvas, [x0, y, x1]: [f64; 3], colour: Option<Colour>, name: &str, v: f64) {
        let said = self.said(Some(v));
        let fill = hex(colour.unwrap_or(colour::SPARE));
        let look = [("fill", fill.as_str()), ("stroke", "#fff"), ("stroke-width", "0.8")];
        let bar = rectangle([x0, y - HIGH / 2.0, x1, y + HIGH / 2.0], &look);
        canvas.push(titled(bar, crate::report::clean(&format!("{name}: {said}"))));
        if let Some(colour) = colour.filter(|_| words::width(&said, SMALL) + 8.0 <= x1 - x0) {
            let mut t = text([(x0 + x1) / 2.0, y + 0.36 * SMALL], SMALL, "middle", &said);
            t.assign("fill", if colour::is_dark(colour) { "#fff" } else { "#111" });
            canvas.push(t);
        }
    }

    /// A value in words.
    fn said(&self, v: Option<f64>) -> String {
        match v {
            None => "-".into(),
            Some(v) if self.value.unit == "s" => duration(v),
            Some(v) => format!("{} {}", brief(v), self.value.unit).trim_end().to_owned(),
        }
    }

    /// The axis in the unit that suits the longest bar, and how much of the given unit that is.
    fn axis(&self, most: f64) -> (Axis, f64) {
        if self.value.unit != "s" {
            return (Axis { is_log: false, ..self.value.clone() }, 1.0);
        }
        let (unit, s) = super::time_unit(most);
        (Axis::new(&self.value.name, unit), s)
    }
}

/// Lines across a bar from left to right about its middle.
fn hatch(canvas: &mut Canvas, [x0, y, x1]: [f64; 3]) {
    const APART: f64 = 8.0;
    let foot = y + HIGH / 2.0;
    let count = ((x1 - x0 + HIGH) / APART) as usize;
    let lines = (1..=count).map(|k| {
        // Rises to the right from where it meets the foot, as far as it lies in the bar.
        let from = x0 + APART * k as f64 - HIGH;
        let [a, b] = [from.max(x0), (from + HIGH).min(x1)];
        format!("M{} {}L{} {}", tenth(a), tenth(foot - (a - from)), tenth(b), tenth(foot - (b - from)))
    });
    let d: String = lines.collect();
    if !d.is_empty() {
        canvas.push(el("path", &[("fill", "none"), ("stroke", "#fff"), ("stroke-width", "1.5"), ("d", &d)]));
    }
}

/// A name in at most two lines.
fn two_lines(name: &str) -> Vec<String> {
    let mut lines = words::lines(name, FONT, NAME);
    if lines.len() > 2 {
        let rest = lines.split_off(1).join(" ");
        lines.push(words::fitted(&rest, FONT, NAME));
    }
    lines
}

/// Length of a bar; None where it has no parts.
fn total(parts: &[f64]) -> Option<f64> {
    let shown = parts.iter().filter(|v| is_shown(**v, true));
    (!parts.is_empty()).then(|| shown.sum())
}

/// A colour for each part: that of the report for parts it knows, else the next of those that are left.
fn colours(parts: &[String]) -> Vec<Colour> {
    let known = |name: &str| PARTS.iter().find(|p| p.0 == name).map(|p| p.1);
    let taken: Vec<Colour> = parts.iter().filter_map(|p| known(p)).collect();
    let mut spare = colour::FILLS.into_iter().filter(|c| !taken.contains(c)).cycle();
    parts.iter().map(|p| known(p).or_else(|| spare.next()).unwrap_or(colour::SPARE)).collect()
}
