//! A flat buffer of polylines.

use super::{Box2, P2};

/// Polylines in one flat array: points of all strokes one after another, and where each begins.
#[derive(Clone, Debug, Default)]
pub struct Strokes {
    points: Vec<P2>,
    ends: Vec<u32>,
}

impl Strokes {
    /// Appends a stroke. Points equal to their predecessor are left out; what then has fewer than two
    /// points is not a stroke and is not kept: the answer says whether it was.
    pub fn push(&mut self, points: impl IntoIterator<Item = P2>) -> bool {
        let start = self.points.len();
        for p in points {
            if self.points.len() == start || self.points.last() != Some(&p) {
                self.points.push(p);
            }
        }
        if self.points.len() < start + 2 {
            self.points.truncate(start);
            return false;
        }
        self.ends.push(u32::try_from(self.points.len()).expect("fewer than 2^32 points in one drawing"));
        true
    }
    /// Appends a dot: a stroke of one point.
    pub fn push_dot(&mut self, p: P2) {
        self.points.push(p);
        self.ends.push(u32::try_from(self.points.len()).expect("fewer than 2^32 points in one drawing"));
    }
    /// How many strokes there are.
    pub fn len(&self) -> usize {
        self.ends.len()
    }
    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.ends.is_empty()
    }
    /// The points of stroke `i`: one of a dot, else at least two.
    pub fn get(&self, i: usize) -> &[P2] {
        let start = if i == 0 { 0 } else { self.ends[i - 1] as usize };
        &self.points[start..self.ends[i] as usize]
    }
    /// All strokes in order.
    pub fn iter(&self) -> impl Iterator<Item = &[P2]> {
        (0..self.len()).map(|i| self.get(i))
    }
    /// The box of all points.
    pub fn bounds(&self) -> Box2 {
        let mut b = Box2::EMPTY;
        self.points.iter().for_each(|&p| b.add(p));
        b
    }
    /// How many points all strokes have together.
    pub fn point_count(&self) -> usize {
        self.points.len()
    }
}
