//! The polygon buffer (`PM`): rings of points, and which of their edges the pen drew.

use super::Point;

/// A ring, mm.
#[derive(Clone, Debug, Default)]
struct Ring {
    points: Vec<Point>,
    /// Whether the pen was down on the way to each point.
    is_drawn: Vec<bool>,
}

/// The polygon that is being defined or was last.
#[derive(Debug, Default)]
pub(super) struct Polygon(Vec<Ring>);

impl Polygon {
    /// A polygon of one closed ring whose edges are all drawn.
    pub(super) fn of_ring(ring: &[Point]) -> Self {
        let mut polygon = Self::default();
        polygon.begin();
        ring.iter().for_each(|&p| polygon.add(p, true));
        polygon
    }

    /// Begins another ring.
    pub(super) fn begin(&mut self) {
        self.0.push(Ring::default());
    }

    pub(super) fn add(&mut self, p: Point, is_drawn: bool) {
        let Some(ring) = self.0.last_mut() else { return };
        if ring.points.last() == Some(&p) {
            return;
        }
        ring.is_drawn.push(is_drawn && !ring.points.is_empty());
        ring.points.push(p);
    }

    /// Draws the last ring to its first point.
    pub(super) fn close(&mut self) {
        if let Some(first) = self.0.last().and_then(|ring| ring.points.first().copied()) {
            self.add(first, true);
        }
    }

    pub(super) fn point_count(&self) -> usize {
        self.0.iter().map(|ring| ring.points.len()).sum()
    }

    /// The rings of the polygon, closed: what they enclose is filled whether the pen was down or not.
    pub(super) fn contours(&self) -> Vec<Vec<Point>> {
        let closed = |ring: &Ring| {
            let mut points = ring.points.clone();
            if points.first() != points.last() {
                points.extend(ring.points.first());
            }
            points
        };
        self.0.iter().map(closed).collect()
    }

    /// The edges that the pen drew, joined to lines. A closed ring is divided where the pen was up, not at its first
    /// point.
    pub(super) fn edges(&self) -> Vec<Vec<Point>> {
        let mut lines: Vec<Vec<Point>> = Vec::new();
        for Ring { points, is_drawn } in &self.0 {
            let first = lines.len();
            let mut is_open = false;
            for (k, edge) in points.windows(2).enumerate() {
                if !is_drawn[k + 1] {
                    is_open = false;
                } else if is_open {
                    lines.last_mut().expect("one was begun").push(edge[1]);
                } else {
                    lines.push(edge.to_vec());
                    is_open = true;
                }
            }
            let is_closed = points.len() > 2 && points.first() == points.last();
            if is_closed && is_open && is_drawn[1] && lines.len() > first + 1 {
                let head = lines.remove(first);
                lines.last_mut().expect("more than one").extend_from_slice(&head[1..]);
            }
        }
        lines
    }
}
