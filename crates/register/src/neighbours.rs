//! Points, to find those around one of them.

use rstar::primitives::GeomWithData;
use rstar::{PointDistance, RTree};
use terrace_core::geom::SpacePoint;

/// Points by their numbers.
#[derive(Debug)]
pub struct Neighbours {
    tree: RTree<GeomWithData<SpacePoint, usize>>,
}

impl Neighbours {
    /// Takes points, mm, numbered in their order.
    pub fn new(points: impl IntoIterator<Item = SpacePoint>) -> Self {
        let numbered = points.into_iter().enumerate().map(|(i, at)| GeomWithData::new(at, i));
        Self { tree: RTree::bulk_load(numbered.collect()) }
    }

    /// Number and distance, mm, of each point, the nearest first.
    pub fn of(&self, at: SpacePoint) -> impl Iterator<Item = (usize, f64)> {
        self.tree.nearest_neighbor_iter(&at).map(move |p| (p.data, p.geom().distance_2(&at).sqrt()))
    }
}
