//! The polygon buffer (`PM`): rings of points, and which of their edges the pen drew.

use terrace_core::geom::PlanePoint;

/// A ring, mm.
#[derive(Clone, Debug, Default)]
struct Ring {
    points: Vec<PlanePoint>,
    /// Whether the pen was down on the way to each point.
    is_drawn: Vec<bool>,
}

impl Ring {
    /// Its points, which end with the first.
    fn closed(&self) -> Vec<PlanePoint> {
        let mut points = self.points.clone();
        if points.first() != points.last() {
            points.extend(self.points.first());
        }
        points
    }
}

/// The polygon that is being defined or was last.
#[derive(Debug, Default)]
pub(super) struct PolygonBuffer(Vec<Ring>);

impl PolygonBuffer {
    /// A polygon of one closed ring whose edges are all drawn.
    pub(super) fn of_ring(ring: &[PlanePoint]) -> Self {
        let mut polygon = Self::default();
        polygon.begin();
        ring.iter().for_each(|&p| polygon.add(p, true));
        polygon
    }

    /// Begins another ring.
    pub(super) fn begin(&mut self) {
        self.0.push(Ring::default());
    }

    /// Adds a point to the last ring; `is_drawn` says whether the pen is down on the way to it.
    pub(super) fn add(&mut self, p: PlanePoint, is_drawn: bool) {
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
    pub(super) fn contours(&self) -> Vec<Vec<PlanePoint>> {
        self.0.iter().map(Ring::closed).collect()
    }

    /// The edges that the pen drew, joined to lines. A closed ring is divided where the pen was up, not at its first
    /// point.
    pub(super) fn edges(&self) -> Vec<Vec<PlanePoint>> {
        let mut lines: Vec<Vec<PlanePoint>> = Vec::new();
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
            // The line that ends at the first point continues with the one that begins there.
            if is_closed && is_open && is_drawn[1] && lines.len() > first + 1 {
                let head = lines.remove(first);
                lines.last_mut().expect("more than one").extend_from_slice(&head[1..]);
            }
        }
        lines
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square whose edges are drawn or not, from the one that leaves the first point on.
    fn square(is_drawn: [bool; 4]) -> PolygonBuffer {
        let mut polygon = PolygonBuffer::default();
        polygon.begin();
        polygon.add([0.0, 0.0], false);
        let corners = [[1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.0, 0.0]];
        corners.into_iter().zip(is_drawn).for_each(|(p, is_drawn)| polygon.add(p, is_drawn));
        polygon
    }

    #[test]
    fn drawn_edges_are_joined_over_the_first_point() {
        assert_eq!(square([true; 4]).edges().len(), 1);
        let edges = square([true, false, true, true]).edges();
        assert_eq!(edges, [[[1.0, 1.0], [0.0, 1.0], [0.0, 0.0], [1.0, 0.0]]]);
        assert_eq!(square([false; 4]).edges().len(), 0);
    }
}
