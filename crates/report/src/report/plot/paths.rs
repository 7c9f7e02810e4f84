//! Paths in the plane, equal scales both ways.

use super::canvas::{Canvas, FONT, MARGIN, SMALL, Swatch, XLabels, foot, side};
use super::ticks::{AxisEnds, Ruler, is_shown, range};
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
        canvas.frame(rect, &view.x, Some(&view.y), XLabels::Below);
        let place = |p: &[f64; 2]| view.place(*p, bottom);
        let lines: Vec<Vec<Option<[f64; 2]>>> =
            self.series.iter().map(|s| s.points.iter().map(place).collect()).collect();
        for (k, (series, runs)) in self.series.iter().zip(thin::paths(&lines)).enumerate() {
            canvas.line(&runs, style(k));
            if series.look == Look::LineAndMarks && series.points.len() <= MARKS {
                canvas.marks(series.points.iter().filter_map(place), style(k));
            }
        }
        if !self.series.iter().flat_map(|s| &s.points).any(is_point) {
            canvas.words([(left + right) / 2.0, (top + bottom) / 2.0], FONT, "middle", "no values", right - left);
        }
        canvas.x_title(rect, &view.x);
        canvas.finish()
    }
}

/// Whether a point can be shown.
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
        let [x, y] = [0, 1].map(|axis| extent(paths, axis));
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
            let around = |middle: f64, length: f64| {
                let half = length / scale / 2.0;
                Some([middle - half, middle + half])
            };
            let axis = |name: &str| Axis::new(name, &paths.unit);
            let x = Ruler::new(&axis(&paths.x), around(cx, wide), AxisEnds::AtValues, foot([left, right]));
            let y = Ruler::new(&axis(&paths.y), around(cy, high), AxisEnds::AtValues, side(high));
            let widest = y.widest(SMALL);
            // Wider labels make the plot narrower, at most to a third.
            if widest <= margin || margin > WIDTH / 2.0 {
                return Self { x, y, left, right, high };
            }
            margin = widest;
        }
    }

    /// Where a point lies in a plot that ends below at `bottom`; None where it cannot be shown.
    fn place(&self, p: [f64; 2], bottom: f64) -> Option<[f64; 2]> {
        let wide = self.right - self.left;
        is_point(&p).then(|| [self.left + self.x.share(p[0]) * wide, bottom - self.y.share(p[1]) * self.high])
    }
}

/// Least and largest coordinate of all points along an axis; without points 0 to 1.
fn extent(paths: &Paths, axis: usize) -> [f64; 2] {
    let points = paths.series.iter().flat_map(|s: &Series| &s.points).filter(|p| is_point(p));
    range(points.map(|p| p[axis]), false).unwrap_or([0.0, 1.0])
}
