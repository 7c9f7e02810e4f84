//! Whether what the lens sees of a part, at some places, faces it.
//!
//! Consumes places in plan and facets as the file has them, by their winding, mm. Promises for each place whether the
//! topmost facet there faces away. Nothing of it is used to plan a job: the walk takes the topmost facet whatever its
//! winding.

use terrace_core::geom::{BoxMm, SpacePoint};

/// Facets that lie as near to each other as this, mm, are at one height: one that faces the lens is seen.
const NEAR: f64 = 1e-6;

/// The places, and what lies topmost there so far.
pub struct Facing {
    places: Vec<Place>,
    /// Places by their row of the box, each row sorted along x.
    rows: Vec<Vec<usize>>,
    bounds: BoxMm<2>,
    /// Cosine of the steepest slope that is looked at.
    gentle: f64,
}

/// A place in plan, mm, and the topmost facet over it so far.
struct Place {
    p: [f64; 2],
    top: Option<FacetView>,
}

/// A facet as a place sees it from above.
#[derive(Clone, Copy)]
struct FacetView {
    /// Its height there, mm.
    z: f64,
    /// Whether it faces away from the lens.
    is_away: bool,
    /// Whether it is no steeper than the limit.
    is_gentle: bool,
}

impl FacetView {
    /// Of two facets over a place the one that counts: the upper one, or where they lie at one height the one that
    /// faces the lens; else `self`.
    fn above(self, earlier: Self) -> Self {
        let is_below = earlier.z > self.z + NEAR;
        let ties_and_faces = earlier.z > self.z - NEAR && !earlier.is_away;
        if is_below || ties_and_faces { earlier } else { self }
    }
}

/// How many places see a facet that faces them, and how many one that faces away.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FacingCount {
    /// Places over a facet that is no steeper than the limit.
    pub places: usize,
    /// The places where that facet faces away.
    pub away: usize,
    /// The first of these, mm.
    pub first: Option<SpacePoint>,
}

impl Facing {
    /// Looks at these places; facets beyond a slope with this cosine count for nothing, but hide what is below.
    pub fn new(places: &[[f64; 2]], gentle: f64) -> Self {
        let mut bounds = BoxMm::EMPTY;
        places.iter().for_each(|&p| bounds.add(p));
        let mut facing = Self {
            places: places.iter().map(|&p| Place { p, top: None }).collect(),
            rows: vec![Vec::new(); places.len().max(1)],
            bounds,
            gentle,
        };
        for (i, p) in places.iter().enumerate() {
            let row = facing.row(p[1]);
            facing.rows[row].push(i);
        }
        for row in &mut facing.rows {
            row.sort_by(|&a, &b| places[a][0].total_cmp(&places[b][0]));
        }
        facing
    }

    /// The row of a height in plan, the first or the last where it lies beyond the places.
    fn row(&self, y: f64) -> usize {
        let side = (self.bounds.hi[1] - self.bounds.lo[1]).max(f64::MIN_POSITIVE);
        let count = self.rows.len();
        (((y - self.bounds.lo[1]) / side * count as f64).max(0.0) as usize).min(count - 1)
    }

    /// Takes a facet.
    pub fn facet(&mut self, facet: [SpacePoint; 3]) {
        let [u, v] = [1, 2].map(|k| [0, 1, 2].map(|i| facet[k][i] - facet[0][i]));
        let normal = [0, 1, 2].map(|i| u[(i + 1) % 3] * v[(i + 2) % 3] - u[(i + 2) % 3] * v[(i + 1) % 3]);
        let size = normal.iter().map(|n| n * n).sum::<f64>().sqrt();
        let mut over = BoxMm::<2>::EMPTY;
        facet.iter().for_each(|p| over.add([p[0], p[1]]));
        let misses = (0..2).any(|k| over.hi[k] < self.bounds.lo[k] || over.lo[k] > self.bounds.hi[k]);
        if misses || normal[2] == 0.0 || !size.is_finite() {
            return;
        }
        let is_away = normal[2] < 0.0;
        let is_gentle = normal[2].abs() >= self.gentle * size;
        for row in self.row(over.lo[1])..=self.row(over.hi[1]) {
            let list = &self.rows[row];
            let first = list.partition_point(|&i| self.places[i].p[0] < over.lo[0]);
            for &i in &list[first..] {
                let place = &mut self.places[i];
                if place.p[0] > over.hi[0] {
                    break;
                }
                if !holds(&facet, place.p) {
                    continue;
                }
                let d = [0, 1].map(|k| place.p[k] - facet[0][k]);
                let z = facet[0][2] - (normal[0] * d[0] + normal[1] * d[1]) / normal[2];
                let view = FacetView { z, is_away, is_gentle };
                place.top = Some(place.top.map_or(view, |top| view.above(top)));
            }
        }
    }

    /// What lies topmost at the places.
    pub fn seen(&self) -> FacingCount {
        let mut count = FacingCount { places: 0, away: 0, first: None };
        for place in &self.places {
            let Some(top) = place.top.filter(|top| top.is_gentle) else { continue };
            count.places += 1;
            if top.is_away {
                count.away += 1;
                count.first.get_or_insert([place.p[0], place.p[1], top.z]);
            }
        }
        count
    }
}

/// Whether a facet lies over a place, its border included.
fn holds(facet: &[SpacePoint; 3], p: [f64; 2]) -> bool {
    let sides = [0, 1, 2].map(|k| {
        let (a, b) = (facet[k], facet[(k + 1) % 3]);
        (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])
    });
    sides.iter().all(|&s| s >= 0.0) || sides.iter().all(|&s| s <= 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A level square of two facets, seen from the side that its winding says.
    fn square(lo: [f64; 2], hi: [f64; 2], z: f64, is_away: bool) -> [[SpacePoint; 3]; 2] {
        let [a, b, c, d] = [[lo[0], lo[1], z], [hi[0], lo[1], z], [hi[0], hi[1], z], [lo[0], hi[1], z]];
        if is_away { [[a, c, b], [a, d, c]] } else { [[a, b, c], [a, c, d]] }
    }

    #[test]
    fn the_topmost_facet_of_each_place_counts() {
        let places: Vec<[f64; 2]> = (0..10).map(|i| [f64::from(i) + 0.5, 0.3 * f64::from(i)]).collect();
        let seen = |facets: &[[[SpacePoint; 3]; 2]]| {
            let mut facing = Facing::new(&places, 0.5);
            facets.iter().flatten().for_each(|&f| facing.facet(f));
            facing.seen()
        };
        let (floor, top) =
            (square([-1.0, -1.0], [20.0, 20.0], 0.0, true), square([-1.0, -1.0], [20.0, 20.0], 5.0, false));
        assert_eq!(seen(&[floor, top]), FacingCount { places: 10, away: 0, first: None });
        assert_eq!(seen(&[top, floor]), FacingCount { places: 10, away: 0, first: None });
        assert_eq!(seen(&[floor]), FacingCount { places: 10, away: 10, first: Some([0.5, 0.0, 0.0]) });
        // A hole over the last three places, on whose border none lies.
        let holed = square([-1.0, -1.0], [7.0, 20.0], 5.0, false);
        assert_eq!(seen(&[holed, floor]), FacingCount { places: 10, away: 3, first: Some([7.5, 2.1, 0.0]) });
        // Both windings at one height.
        assert_eq!(seen(&[floor, square([-1.0, -1.0], [20.0, 20.0], 0.0, false)]).away, 0);
        // Steep facets hide, and count for nothing.
        let steep = [[[-1.0, -1.0, 100.0], [20.0, -1.0, 200.0], [20.0, 20.0, 200.0]]; 2];
        assert_eq!(seen(&[floor, steep]).places, 0);
        assert_eq!(Facing::new(&[], 0.5).seen(), FacingCount { places: 0, away: 0, first: None });
    }
}
