//! What is visited, where it is entered and left, and a first path through it.
//!
//! An *item* is what is visited once: a stop, or a stroke. It is entered at one of its *endpoints* and left at
//! the endpoint that belongs to it: a stop has one endpoint, an open stroke two (entered at one end, left at the
//! other), a closed stroke one for every vertex at which it may begin. Item 0 is where the path starts; it
//! ends anywhere. Costs run between endpoints and must be the same both ways.

use super::kd_tree::Tree;

/// The item of an endpoint, and where one leaves who entered at it.
struct Endpoint {
    item: u32,
    other: u32,
}

/// The endpoints of all items.
#[derive(Default)]
pub(super) struct Endpoints {
    list: Vec<Endpoint>,
    /// First endpoint of every item, and the number of endpoints.
    first: Vec<u32>,
}

impl Endpoints {
    pub(super) fn with_capacity(items: usize, endpoints: usize) -> Self {
        let mut first = Vec::with_capacity(items + 1);
        first.push(0);
        Self { list: Vec::with_capacity(endpoints), first }
    }
    /// An item with two endpoints, entered at one and left at the other.
    pub(super) fn open(&mut self) {
        let endpoint = self.list.len() as u32;
        self.add([endpoint + 1, endpoint]);
    }
    /// An item that is left where it was entered, at any of this many endpoints.
    pub(super) fn closed(&mut self, count: usize) {
        let endpoint = self.list.len() as u32;
        self.add(endpoint..endpoint + count as u32);
    }
    /// An item with an endpoint for each of `others`, the endpoints at which one leaves.
    fn add(&mut self, others: impl IntoIterator<Item = u32>) {
        let item = self.items() as u32;
        self.list.extend(others.into_iter().map(|other| Endpoint { item, other }));
        self.first.push(self.list.len() as u32);
    }
    /// How many endpoints all items have.
    pub(super) fn count(&self) -> usize {
        self.list.len()
    }
    pub(super) fn items(&self) -> usize {
        self.first.len() - 1
    }
    pub(super) fn item(&self, endpoint: u32) -> usize {
        self.list[endpoint as usize].item as usize
    }
    pub(super) fn of(&self, item: usize) -> std::ops::Range<u32> {
        self.first[item]..self.first[item + 1]
    }
    /// The endpoint at which an item entered at this one is left.
    pub(super) fn other(&self, endpoint: u32) -> u32 {
        self.list[endpoint as usize].other
    }
}

/// The path that always goes to the nearest item, as entry endpoints. `tree` holds all endpoints but endpoint 0, by
/// number less one, and `at` tells where an endpoint is; `far` is the distance, as [`Tree::around`] takes it.
pub(super) fn greedy<const D: usize>(
    endpoints: &Endpoints,
    tree: &mut Tree<D>,
    at: impl Fn(u32) -> [f64; D],
    far: impl Fn([f64; D]) -> f64,
) -> Vec<u32> {
    let mut seq = Vec::with_capacity(endpoints.items());
    seq.push(0);
    let mut from = at(0);
    let mut near = None;
    while seq.len() < endpoints.items() {
        let mut next = 0;
        tree.around(from, near, f64::INFINITY, &far, |d, number| {
            next = number + 1;
            d
        });
        endpoints.of(endpoints.item(next)).for_each(|endpoint| tree.take(endpoint - 1));
        seq.push(next);
        let exit = endpoints.other(next);
        (from, near) = (at(exit), Some(exit - 1));
    }
    seq
}
