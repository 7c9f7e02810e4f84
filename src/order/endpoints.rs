//! What is visited, where it is entered and left, and a first path through it.
//!
//! An *item* is what is visited once: a stop, or a stroke. It is entered at one of its *endpoints* and left at
//! the endpoint that belongs to it: a stop has one endpoint, an open stroke two (entered at one end, left at the
//! other), a closed stroke one for every vertex at which it may begin. Item 0 is where the path starts; it
//! ends anywhere. Costs run between endpoints and must be the same both ways.

use super::kd_tree::Tree;

/// The endpoints of all items.
#[derive(Default)]
pub(super) struct Endpoints {
    /// Item of every endpoint.
    item: Vec<u32>,
    /// Where one leaves who entered at an endpoint.
    other: Vec<u32>,
    /// First endpoint of every item, and the number of endpoints.
    first: Vec<u32>,
}

impl Endpoints {
    pub(super) fn with_capacity(items: usize, endpoints: usize) -> Self {
        let mut first = Vec::with_capacity(items + 1);
        first.push(0);
        Self { item: Vec::with_capacity(endpoints), other: Vec::with_capacity(endpoints), first }
    }
    /// An item with two endpoints, entered at one and left at the other.
    pub(super) fn open(&mut self) {
        let endpoint = self.item.len() as u32;
        self.other.extend([endpoint + 1, endpoint]);
        self.end(2);
    }
    /// An item that is left where it was entered, at any of this many endpoints.
    pub(super) fn closed(&mut self, count: usize) {
        let endpoint = self.item.len() as u32;
        self.other.extend(endpoint..endpoint + count as u32);
        self.end(count);
    }
    fn end(&mut self, count: usize) {
        let item = self.items() as u32;
        self.item.extend(std::iter::repeat_n(item, count));
        self.first.push(self.item.len() as u32);
    }
    /// How many endpoints all items have.
    pub(super) fn count(&self) -> usize {
        self.item.len()
    }
    pub(super) fn items(&self) -> usize {
        self.first.len() - 1
    }
    pub(super) fn item(&self, endpoint: u32) -> usize {
        self.item[endpoint as usize] as usize
    }
    pub(super) fn of(&self, item: usize) -> std::ops::Range<u32> {
        self.first[item]..self.first[item + 1]
    }
    /// The endpoint at which one leaves who entered at this one.
    pub(super) fn other(&self, endpoint: u32) -> u32 {
        self.other[endpoint as usize]
    }
}

/// The path that always goes to the nearest item, as entry endpoints. `tree` holds all endpoints but endpoint 0, by
/// number less one, and `at` is where they are; `far` is the distance, as [`Tree::around`] takes it.
pub(super) fn greedy<const D: usize>(
    endpoints: &Endpoints,
    tree: &mut Tree<D>,
    at: &[[f64; D]],
    far: impl Fn([f64; D]) -> f64,
) -> Vec<u32> {
    let mut seq = Vec::with_capacity(endpoints.items());
    seq.push(0);
    let (mut from, mut near) = (at[0], None);
    while seq.len() < endpoints.items() {
        let mut next = 0;
        tree.around(from, near, f64::INFINITY, &far, |d, number| {
            next = number + 1;
            d
        });
        endpoints.of(endpoints.item(next)).for_each(|endpoint| tree.take(endpoint - 1));
        seq.push(next);
        let exit = endpoints.other(next);
        (from, near) = (at[exit as usize], Some(exit - 1));
    }
    seq
}
