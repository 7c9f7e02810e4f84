//! Lines over an axis in one panel or several.

use svg::node::element::Element;

use super::canvas::{Canvas, FONT, LINE, MARGIN, Rect, SMALL, Swatch, XLabels, foot, side, tenth};
use super::ticks::{AxisEnds, Ruler, is_shown, range, with_air};
use super::{Limit, LineChart, Look, MARKS, Panel, Plot, WIDTH, style, thin, words};
use crate::report::colour::FIELD;
use crate::report::sheet::el;

/// Heights of the only panel, and of one of several.
const ALONE: f64 = 380.0;
const STACKED: f64 = 120.0;
/// Between two panels: the title of the lower one.
const ABOVE: f64 = 28.0;
/// Between the names of limits above the first panel and its frame.
const ROWS: f64 = 8.0;
/// Widest label of a limit.
const LABEL: f64 = 230.0;
/// Between the middles of two names of limits beside a panel.
const APART: f64 = 15.0;

impl LineChart {
    /// Draws it.
    pub fn draw(&self) -> Plot {
        Drawing::of(self).draw()
    }
}

/// A chart with all places known.
struct Drawing<'a> {
    chart: &'a LineChart,
    /// Names in the order of their first series.
    names: Vec<&'a str>,
    heights: Vec<f64>,
    ys: Vec<Ruler>,
    x: Ruler,
    left: f64,
    right: f64,
}

impl<'a> Drawing<'a> {
    fn of(chart: &'a LineChart) -> Self {
        let mut names: Vec<&str> = Vec::new();
        for series in chart.panels.iter().flat_map(|p| &p.series) {
            if !names.contains(&series.name.as_str()) {
                names.push(&series.name);
            }
        }
        let usual = if chart.panels.len() > 1 { STACKED } else { ALONE };
        // High enough for the names of all limits beside it.
        let heights: Vec<f64> = chart.panels.iter().map(|p| usual.max(APART * p.limits.len() as f64)).collect();
        let ys: Vec<Ruler> = chart
            .panels
            .iter()
            .zip(&heights)
            .map(|(p, &high)| Ruler::new(&p.y, y_range(chart, p), AxisEnds::AtTicks, side(high)))
            .collect();
        let left = ys.iter().map(|y| y.widest(SMALL)).fold(24.0, f64::max) + MARGIN + 8.0;
        let wide = |limit: &Limit, unit: &str| words::width(&label(limit, unit), SMALL).min(LABEL) + 18.0;
        let beside = chart.panels.iter().flat_map(|p| p.limits.iter().map(move |l| wide(l, &p.y.unit)));
        let mut right = WIDTH - MARGIN - beside.fold(20.0, f64::max);
        let values = x_range(chart);
        let x = Ruler::new(&chart.x, values, AxisEnds::AtValues, foot([left, right]));
        for limit in chart.limits.iter().filter(|l| is_shown(l.value, chart.x.is_log)) {
            let room = WIDTH - MARGIN - left - wide(limit, &chart.x.unit);
            right = right.min(left + room / x.share(limit.value).max(1e-3));
        }
        let x = Ruler::new(&chart.x, values, AxisEnds::AtValues, foot([left, right]));
        Self { chart, names, heights, ys, x, left, right }
    }

    /// How the series of a name look in the legend: with marks where some have them.
    fn look(&self, name: &str) -> Look {
        let named = self.chart.panels.iter().flat_map(|p| &p.series).filter(|s| s.name == name);
        let mut looks = named.map(|s| s.look);
        let first = looks.next().unwrap_or(Look::Line);
        if looks.any(|look| look != first) { Look::LineAndMarks } else { first }
    }

    fn draw(&self) -> Plot {
        let mut canvas = Canvas::new(&self.chart.title);
        let entries: Vec<(&str, Swatch)> = self
            .names
            .iter()
            .enumerate()
            .filter(|(_, name)| !name.is_empty())
            .map(|(k, &name)| (name, Swatch::Line(style(k), self.look(name))))
            .collect();
        canvas.legend(&entries);
        let mut rect = [self.left, 0.0, self.right, canvas.at];
        for (k, panel) in self.chart.panels.iter().enumerate() {
            let title_at = [MARGIN, canvas.at + 12.0];
            canvas.words(title_at, FONT, "start", &self.ys[k].title, WIDTH - 2.0 * MARGIN);
            let names = if k == 0 { self.limits().len() } else { 0 };
            let rows = if names > 0 { LINE * names as f64 + ROWS } else { 0.0 };
            let top = canvas.at + ABOVE + rows;
            rect = [self.left, top, self.right, top + self.heights[k]];
            let is_last = k + 1 == self.chart.panels.len();
            let x_labels = if is_last { XLabels::Below } else { XLabels::Elsewhere };
            canvas.frame(rect, &self.x, Some(&self.ys[k]), x_labels);
            if k == 0 {
                self.limit_names(&mut canvas, rect);
            }
            self.panel(&mut canvas, panel, &self.ys[k], rect);
            canvas.at = rect[3] + 6.0;
        }
        canvas.x_title(rect, &self.x);
        canvas.finish()
    }

    /// The limits of the horizontal axis, from left to right.
    fn limits(&self) -> Vec<&Limit> {
        let mut all: Vec<&Limit> = self.chart.limits.iter().filter(|l| is_shown(l.value, self.x.is_log)).collect();
        all.sort_by(|a, b| a.value.total_cmp(&b.value));
        all
    }

    /// Names of the limits of the horizontal axis, above the first panel. The further to the right a limit is, the
    /// lower its name stands, so its line, which ends there, crosses none of the others.
    fn limit_names(&self, canvas: &mut Canvas, rect: Rect) {
        let limits = self.limits();
        for (k, limit) in limits.iter().enumerate() {
            let x = self.left + self.x.share(limit.value) * (self.right - self.left);
            let y = rect[1] - ROWS - LINE * (limits.len() - k) as f64 + LINE / 2.0;
            canvas.push(dashed([[x, y - 6.0], [x, rect[1]]]));
            canvas.words([x + 6.0, y], SMALL, "start", &label(limit, &self.chart.x.unit), LABEL);
        }
    }

    /// Where a point lies in a panel; None where an axis cannot show it.
    fn place(&self, [px, py]: [f64; 2], y: &Ruler, [left, top, right, bottom]: Rect) -> Option<[f64; 2]> {
        let is_shown = is_shown(px, self.x.is_log) && is_shown(py, y.is_log);
        is_shown.then(|| [left + self.x.share(px) * (right - left), bottom - y.share(py) * (bottom - top)])
    }

    /// Draws the limits and the series of a panel.
    fn panel(&self, canvas: &mut Canvas, panel: &Panel, y: &Ruler, rect: Rect) {
        let [left, top, right, bottom] = rect;
        let place = |p: &[f64; 2]| self.place(*p, y, rect);
        for limit in self.limits() {
            let x = left + self.x.share(limit.value) * (right - left);
            canvas.push(dashed([[x, top], [x, bottom]]));
        }
        self.limits_across(canvas, panel, y, rect);
        for series in &panel.series {
            let k = self.names.iter().position(|n| *n == series.name).unwrap_or(0);
            canvas.line(&thin::columns(series.points.iter().map(place)), style(k));
            if series.look == Look::LineAndMarks && series.points.len() <= MARKS {
                canvas.marks(series.points.iter().filter_map(place), style(k));
            }
        }
        if panel.series.iter().all(|s| s.points.iter().all(|p| place(p).is_none())) {
            canvas.words([(left + right) / 2.0, (top + bottom) / 2.0], FONT, "middle", "no values", right - left);
        }
    }

    /// Draws the limits of a panel as lines across it, and their names to the right of it, moved apart where they are
    /// close; a short line leads from each limit to its name.
    fn limits_across(&self, canvas: &mut Canvas, panel: &Panel, y: &Ruler, [left, top, right, bottom]: Rect) {
        // With how far down each lies, from the top down.
        let mut limits: Vec<(f64, &Limit)> = panel
            .limits
            .iter()
            .filter(|l| is_shown(l.value, y.is_log))
            .map(|l| (bottom - y.share(l.value) * (bottom - top), l))
            .collect();
        limits.sort_by(|a, b| a.0.total_cmp(&b.0));
        let name_places = spaced(limits.iter().map(|l| l.0).collect(), bottom);
        for (&(limit_y, limit), name_y) in limits.iter().zip(name_places) {
            canvas.push(dashed([[left, limit_y], [right, limit_y]]));
            let leader = format!("M{} {}L{} {}", tenth(right), tenth(limit_y), tenth(right + 10.0), tenth(name_y));
            canvas.push(el("path", &[("fill", "none"), ("stroke", FIELD), ("stroke-width", "1"), ("d", &leader)]));
            canvas.words([right + 14.0, name_y], SMALL, "start", &label(limit, &panel.y.unit), LABEL);
        }
    }
}

/// Rising places of names along y, moved apart to at least [`APART`]: first down, then up from `bottom`.
fn spaced(mut places: Vec<f64>, bottom: f64) -> Vec<f64> {
    for k in 1..places.len() {
        places[k] = places[k].max(places[k - 1] + APART);
    }
    let mut lowest = bottom;
    for place in places.iter_mut().rev() {
        *place = place.min(lowest);
        lowest = *place - APART;
    }
    places
}

/// What a limit is called beside its line.
fn label(limit: &Limit, unit: &str) -> String {
    limit.label(unit, SMALL, LABEL)
}

/// The line of a limit.
fn dashed([a, b]: [[f64; 2]; 2]) -> Element {
    let d = format!("M{} {}L{} {}", tenth(a[0]), tenth(a[1]), tenth(b[0]), tenth(b[1]));
    el("path", &[("fill", "none"), ("stroke", FIELD), ("stroke-width", "1.2"), ("stroke-dasharray", "6 4"), ("d", &d)])
}

/// From the least to the largest value and beyond the limits, and from 0 where that is near.
fn x_range(chart: &LineChart) -> Option<[f64; 2]> {
    let is_log = chart.x.is_log;
    let ranges = chart.panels.iter().filter_map(|panel| {
        let points = panel.series.iter().flat_map(|s| &s.points).filter(|p| is_shown(p[1], panel.y.is_log));
        range(points.map(|p| p[0]), is_log)
    });
    let values = ranges.flatten().chain(chart.limits.iter().map(|l| l.value));
    let [lo, hi] = with_air(range(values, is_log)?, &chart.limits, is_log);
    Some([if !is_log && lo > 0.0 && lo < 0.1 * hi { 0.0 } else { lo }, hi])
}

/// From the least to the largest value of a panel and beyond the limits; 0 is near sooner than along x.
fn y_range(chart: &LineChart, panel: &Panel) -> Option<[f64; 2]> {
    let points = panel.series.iter().flat_map(|s| &s.points).filter(|p| is_shown(p[0], chart.x.is_log));
    let values = points.map(|p| p[1]).chain(panel.limits.iter().map(|l| l.value));
    let [lo, hi] = with_air(range(values, panel.y.is_log)?, &panel.limits, panel.y.is_log);
    if panel.y.is_log {
        return Some([lo, hi]);
    }
    Some([if lo > 0.0 && lo < 0.5 * hi { 0.0 } else { lo }, if hi < 0.0 && hi > 0.5 * lo { 0.0 } else { hi }])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_limits_are_moved_apart_and_stay_above_the_bottom() {
        assert_eq!(spaced(vec![10.0, 12.0, 60.0], 100.0), [10.0, 25.0, 60.0]);
        assert_eq!(spaced(vec![95.0, 98.0], 100.0), [85.0, 100.0]);
    }
}
