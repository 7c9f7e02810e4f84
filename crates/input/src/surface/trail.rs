//! A stroke followed over the surface: what lies under each of its segments.
//!
//! A walk gives the sheet that lies topmost. Where a segment runs along an edge, what lies beside it decides, by the
//! steepest slope that is marked. So plan, texture and pictures see the same part under the same stroke.

use super::walk::Cursor;
use super::{Span, Surface};
use terrace_core::geom::P2;

/// Follows strokes; holds what can be reused from one to the next.
#[derive(Debug)]
pub struct Trail {
    max_slope2: f64,
    cursor: Cursor,
    spans: Vec<Span>,
    /// Squared slopes of the facets of the spans.
    slopes2: Vec<f64>,
}

impl Trail {
    /// `max_slope` is the tangent of the steepest slope that is marked.
    pub fn new(max_slope: f64) -> Self {
        let max_slope2 = max_slope * max_slope;
        Self { max_slope2, cursor: Cursor::new(max_slope2), spans: Vec::new(), slopes2: Vec::new() }
    }

    /// Square of the steepest slope that is marked.
    pub fn max_slope2(&self) -> f64 {
        self.max_slope2
    }

    /// The spans of the segment that was followed last, each with its squared slope, which has no meaning off the part.
    pub fn spans(&self) -> impl Iterator<Item = (&Span, f64)> {
        self.spans.iter().zip(self.slopes2.iter().copied())
    }

    /// Follows the segment from `a` to `b`; one of length 0 is one span with one height.
    pub fn follow(&mut self, surface: &Surface, a: P2, b: P2) {
        if a == b {
            self.follow_point(surface, a);
        } else {
            self.walk(surface, a, b);
        }
    }

    /// Leaves the spans of a segment and their slopes. Where it runs along an edge, what lies beside it decides.
    fn walk(&mut self, surface: &Surface, a: P2, b: P2) {
        let is_compared = surface.walk(a, b, &mut self.cursor, &mut self.spans);
        self.update_slopes(surface);
        let is_along_edge = |(span, &slope2): (&Span, &f64)| {
            let is_steep = slope2 > self.max_slope2;
            (is_steep || is_compared) && surface.is_along_edge(a, b, span, is_steep)
        };
        if self.spans.iter().zip(&self.slopes2).any(is_along_edge) {
            surface.walk_along_edges(a, b, &mut self.cursor, &mut self.spans);
            self.update_slopes(surface);
        }
    }

    fn update_slopes(&mut self, surface: &Surface) {
        let slope2 = |span: &Span| span.facet().map_or(0.0, |f| surface.slope2(f));
        self.slopes2.clear();
        self.slopes2.extend(self.spans.iter().map(slope2));
    }

    /// Leaves one span for the whole of a segment that is a point: what a walk away from it begins with. A point on the
    /// rim of the part is on the part, and one on the edge of a place that may be marked is marked.
    fn follow_point(&mut self, surface: &Surface, p: P2) {
        /// Longer than the distance within which walks snap to rims, nm.
        const STEP: i64 = 16;
        let mut best: Option<(Span, f64)> = None;
        for (x, y) in [(STEP, 0), (-STEP, 0), (0, STEP), (0, -STEP)] {
            self.walk(surface, p, P2::new(p.x + x, p.y + y));
            let found = (self.spans[0], self.slopes2[0]);
            let is_marked = found.0.facet().is_some() && found.1 <= self.max_slope2;
            if is_marked || best.is_none_or(|(span, _)| span.facet().is_none()) {
                best = Some(found);
            }
            if is_marked {
                break;
            }
        }
        let (mut span, slope2) = best.expect("four directions");
        (span.t0, span.t1, span.z1) = (0.0, 1.0, span.z0);
        self.spans.clear();
        self.spans.push(span);
        self.slopes2.clear();
        self.slopes2.push(slope2);
    }
}
