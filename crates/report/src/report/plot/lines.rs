//! Lines over an axis in one panel or several.

use svg::node::element::Element;

use super::canvas::{Canvas, FONT, LINE, MARGIN, Rect, SMALL, Swatch, foot, side, tenth};
use super::ticks::{Ends, Ruler, is_shown, range, with_air};
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
        let heights: Vec<f64> = chart.panels.iter().map(|p| usual.max(15.0 * p.limits.len() as f64)).collect();
        let ys: Vec<Ruler> = chart
            .panels
            .iter()
            .zip(&heights)
            .map(|(p, &high)| Ruler::new(&p.y, y_range(chart, p), Ends::AtTicks, side(high)))
            .collect();
        let left = ys.iter().map(|y| y.widest(SMALL)).fold(24.0, f64::max) + MARGIN + 8.0;
        let wide = |limit: &Limit, unit: &str| words::width(&label(limit, unit), SMALL).min(LABEL) + 18.0;
        let beside = chart.panels.iter().flat_map(|p| p.limits.iter().map(move |l| wide(l, &p.y.unit)));
        let mut right = WIDTH - MARGIN - beside.fold(20.0, f64::max);
        let values = x_range(chart);
        let x = Ruler::new(&chart.x, values, Ends::AtValues, foot([left, right]));
        for limit in chart.limits.iter().filter(|l| is_shown(l.value, chart.x.is_log)) {
            let room = WIDTH - MARGIN - left - wide(limit, &chart.x.unit);
            right = right.min(left + room / x.share(limit.value).max(1e-3));
        }
        let x = Ruler::new(&chart.x, values, Ends::AtValues, foot([left, right]));
        Self { chart, names, heights, ys, x, left, right }
    }

    fn draw(&self) -> Plot {
        let mut canvas = Canvas::new(&self.chart.title);
        let look = |name: &str| {
            let mut all = self.chart.panels.iter().flat_map(|p| &p.series).filter(|s| s.name == name).map(|s| s.look);
            let first = all.next().unwrap_or(Look::Line);
            if all.any(|l| l != first) { Look::LineAndMarks } else { first }
        };
        let entries: Vec<(&str, Swatch)> = self
            .names
            .iter()
            .enumerate()
            .filter(|(_, name)| !name.is_empty())
            .map(|(k, &name)| (name, Swatch::Line(style(k), look(name))))
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
            canvas.frame(rect, &self.x, Some(&self.ys[k]), is_last);
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

    /// Names of these above the first panel. The further to the right a limit is, the lower its name stands,
    /// so its line, which ends there, crosses none of the others.
    fn limit_names(&self, canvas: &mut Canvas, rect: Rect) {
        let all = self.limits();
        for (k, limit) in all.iter().enumerate() {
            let x = self.left + self.x.share(limit.value) * (self.right - self.left);
            let y = rect[1] - ROWS - LINE * (all.len() - k) as f64 + LINE / 2.0;
            canvas.push(dashed([[x, y - 6.0], [x, rect[1]]]));
            canvas.words([x + 6.0, y], SMALL, "start", &label(limit, &self.chart.x.unit), LABEL);
        }
    }

    fn panel(&self, canvas: &mut Canvas, panel: &Panel, y: &Ruler, rect: Rect) {
        let [left, top, right, bottom] = rect;
        let at = |p: &[f64; 2]| {
            let shown = is_shown(p[0], self.x.is_log) && is_shown(p[1], y.is_log);
            shown.then(|| [left + self.x.share(p[0]) * (right - left), bottom - y.share(p[1]) * (bottom - top)])
        };
        for limit in self.limits() {
            let x = left + self.x.share(limit.value) * (right - left);
            canvas.push(dashed([[x, top], [x, bottom]]));
        }
        self.across(canvas, panel, y, rect);
        for series in &panel.series {
            let k = self.names.iter().position(|n| *n == series.name).unwrap_or(0);
            canvas.line(&thin::columns(series.points.iter().map(at)), style(k));
            if series.look == Look::LineAndMarks && series.points.len() <= MARKS {
                canvas.marks(series.points.iter().filter_map(at), style(k));
            }
        }
        if panel.series.iter().all(|s| s.points.iter().all(|p| at(p).is_none())) {
            canvas.words([(left + right) / 2.0, (top + bottom) / 2.0], FONT, "middle", "no values", right - left);
        }
    }

    /// Limits across a panel, their names next to it, moved apart where they are close.
    fn across(&self, canvas: &mut Canvas, panel: &Panel, y: &Ruler, [left, top, right, bottom]: Rect) {
        let mut all: Vec<(f64, &Limit)> = panel
            .limits
            .iter()
            .filter(|l| is_shown(l.value, y.is_log))
            .map(|l| (bottom - y.share(l.value) * (bottom - top), l))
            .collect();
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut places: Vec<f64> = all.iter().map(|l| l.0).collect();
        for k in 1..places.len() {
            places[k] = places[k].max(places[k - 1] + 15.0);
        }
        let mut lowest = bottom;
        for place in places.iter_mut().rev() {
            *place = place.min(lowest);
            lowest = *place - 15.0;
        }
        for (&(at, limit), place) in all.iter().zip(places) {
            canvas.push(dashed([[left, at], [right, at]]));
            let leader = format!("M{} {}L{} {}", tenth(right), tenth(at), tenth(right + 10.0), tenth(place));
            canvas.push(el("path", &[("fill", "none"), ("stroke", FIELD), ("stroke-width", "1"), ("d", &leader)]));
            canvas.words([right + 14.0, place], SMALL, "start", &label(limit, &panel.y.unit), LABEL);
        }
    }
}

fn label(limit: &Limit, unit: &str) -> String {
    limit.label(unit, SMALL, LABEL)
}

fn dashed([a, b]: [[f64; 2]; 2]) -> Element {
    let d = format!("M{} {}L{} {}", tenth(a[0]), tenth(a[1]), tenth(b[0]), tenth(b[1]));
    el("path", &[("fill", "none"), ("stroke", FIELD), ("stroke-width", "1.2"), ("stroke-dasharray", "6 4"), ("d", &d)])
}

/// From the least to the largest value and beyond the limits, and from 0 where that is near.
fn x_range(chart: &LineChart) -> Option<[f64; 2]> {
    let is_log = chart.x.is_log;
    let of = |p: &Panel| {
        let points = p.series.iter().flat_map(|s| &s.points).filter(|q| is_shown(q[1], p.y.is_log));
        range(points.map(|q| q[0]), is_log)
    };
    let values = chart.panels.iter().filter_map(of).flatten();
    let all = range(values.chain(chart.limits.iter().map(|l| l.value)), is_log)?;
    let [lo, hi] = with_air(all, &chart.limits, is_log);
    Some([if !is_log && lo > 0.0 && lo < 0.1 * hi { 0.0 } else { lo }, hi])
}

/// From the least to the largest value of a panel and beyond the limits; 0 is near sooner than along x.
fn y_range(chart: &LineChart, panel: &Panel) -> Option<[f64; 2]> {
    let points = panel.series.iter().flat_map(|s| &s.points).filter(|p| is_shown(p[0], chart.x.is_log));
    let values = points.map(|p| p[1]).chain(panel.limits.iter().map(|l| l.value));
    let all = range(values, panel.y.is_log)?;
    let [lo, hi] = with_air(all, &panel.limits, panel.y.is_log);
    if panel.y.is_log {
        return Some([lo, hi]);
    }
    Some([if lo > 0.0 && lo < 0.5 * hi { 0.0 } else { lo }, if hi < 0.0 && hi > 0.5 * lo { 0.0 } else { hi }])
}
