//! Paths in the plane, equal scales both ways.

use super::canvas::{Canvas, FONT, MARGIN, SMALL, Swatch, foot, side};
use super::ticks::{Ends, Ruler, is_shown, range};
use super::{Axis, Look, MARKS, Paths, Plot, Series, WIDTH, style, thin};

/// Least and largest height of the plot.
const LEAST: f64 = 220.0;
const MOST: f64 = 820.0;

impl Paths {
    /// Draws it.
    pub fn draw(&self) -> Plot {
        let mut canvas = Canvas::new(&self.title);
        let entries: Vec<(&str, Swatch)> = self
            .series
            .iter()
            .enumerate()
            .filter(|(_, s)| !s.name.is_empty())
            .map(|(k, s)| (s.name.as_str(), Swatch::Line(style(k), s.look)))
            .collect();
        canvas.legend(&entries);
        let view = View::of(self);
        canvas.words([MARGIN, canvas.at + 12.0], FONT, "start", &view.y.title, WIDTH - 2.0 * MARGIN);
        let top = canvas.at + 28.0;
        let rect @ [left, _, right, bottom] = [view.left, top, view.right, top + view.high];
        canvas.frame(rect, &view.x, Some(&view.y), true);
        let at = |p: &[f64; 2]| {
            let place = || [left + view.x.share(p[0]) * (right - left), bottom - view.y.share(p[1]) * view.high];
            is_point(p).then(place)
        };
        let lines: Vec<Vec<Option<[f64; 2]>>> = self.series.iter().map(|s| s.points.iter().map(at).collect()).collect();
        for (k, (series, runs)) in self.series.iter().zip(thin::paths(&lines)).enumerate() {
            canvas.line(&runs, style(k));
            if series.look == Look::LineAndMarks && series.points.len() <= MARKS {
                canvas.marks(series.points.iter().filter_map(at), style(k));
            }
        }
        if !self.series.iter().flat_map(|s| &s.points).any(is_point) {
            canvas.words([(left + right) / 2.0, (top + bottom) / 2.0], FONT, "middle", "no values", right - left);
        }
        canvas.x_title(rect, &view.x);
        canvas.finish()
    }
}

fn is_point(p: &[f64; 2]) -> bool {
    p.iter().all(|&v| is_shown(v, false))
}

/// Where the plot lies, and what it shows.
struct View {
    x: Ruler,
    y: Ruler,
    left: f64,
    right: f64,
    high: f64,
}

impl View {
    fn of(paths: &Paths) -> Self {
        let points = |axis: usize| {
            let all = paths.series.iter().flat_map(|s: &Series| &s.points).filter(|p| is_point(p));
            range(all.map(|p| p[axis]), false).unwrap_or([0.0, 1.0])
        };
        let [x, y] = [points(0), points(1)];
        let [cx, cy] = [x, y].map(|r| r[0] / 2.0 + r[1] / 2.0);
        let most = (x[1] - x[0]).max(y[1] - y[0]);
        // Where all points are one, around it a little.
        let air = if most > 0.0 { 0.02 * most } else { 0.1 * cx.abs().max(cy.abs()).max(1.0) };
        let [dx, dy] = [x, y].map(|r| r[1] - r[0] + 2.0 * air);
        let mut margin = 32.0;
        loop {
            let [left, right] = [MARGIN + 8.0 + margin, WIDTH - MARGIN - 12.0];
            let wide = right - left;
            let high = (wide * dy / dx).clamp(LEAST, MOST);
            let scale = (wide / dx).min(high / dy);
            let ruler = |name: &str, middle: f64, length: f64, room| {
                let half = length / scale / 2.0;
                let axis = Axis::new(name, &paths.unit);
                Ruler::new(&axis, Some([middle - half, middle + half]), Ends::AtValues, room)
            };
            let x = ruler(&paths.x, cx, wide, foot([left, right]));
            let y = ruler(&paths.y, cy, high, side(high));
            let widest = y.widest(SMALL);
            // Wider labels make the plot narrower, at most to a third.
            if widest <= margin || margin > WIDTH / 2.0 {
                return Self { x, y, left, right, high };
            }
            margin = widest;
        }
    }
}
