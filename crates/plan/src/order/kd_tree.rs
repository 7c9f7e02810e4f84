//! A k-d tree over points that are removed one by one and queried for the nearest.
//!
//! Consumes points in mm or nm; the distance is the caller's, any function that grows with the difference along every
//! axis. It is balanced by count, not by place, so that neither points on one spot nor a few far outliers slow it down.
//! Building takes O(n log n), a query O(log n).

/// Most points of a leaf, when none was taken out.
const LEAF: usize = 8;

/// Points in a balanced tree; a node's children are 2 i + 1 and 2 i + 2.
pub(super) struct Tree<const D: usize> {
    /// Points leaf by leaf; in each leaf those that are free come first.
    points: Vec<Point<D>>,
    /// Place of every number in `points`.
    place: Vec<u32>,
    nodes: Vec<Node<D>>,
    leaves: usize,
}

/// A point and its number.
#[derive(Clone, Copy)]
struct Point<const D: usize> {
    at: [f64; D],
    number: u32,
}

/// A node: the box of its points, lower and upper corner, and how many of them are free.
#[derive(Clone, Copy)]
struct Node<const D: usize> {
    span: [[f64; D]; 2],
    free: u32,
}

impl<const D: usize> Tree<D> {
    pub(super) fn new(points: impl ExactSizeIterator<Item = [f64; D]>) -> Self {
        let n = points.len();
        let leaves = n.div_ceil(LEAF).next_power_of_two();
        let empty = Node { span: [[f64::INFINITY; D], [f64::NEG_INFINITY; D]], free: 0 };
        let mut tree = Self { points: Vec::new(), place: vec![0; n], nodes: vec![empty; 2 * leaves - 1], leaves };
        let mut list: Vec<Point<D>> = points.zip(0..).map(|(at, number)| Point { at, number }).collect();
        tree.split(0, 0, leaves, &mut list);
        list.iter().zip(0..).for_each(|(p, at)| tree.place[p.number as usize] = at);
        tree.points = list;
        tree.fill();
        tree
    }

    /// Sorts `list`, the points of leaves `first..first + count`, below node `node`.
    fn split(&mut self, node: usize, first: usize, count: usize, list: &mut [Point<D>]) {
        let corner = |pick: fn(f64, f64) -> f64, empty: f64| {
            list.iter().fold([empty; D], |corner, p| std::array::from_fn(|k| pick(corner[k], p.at[k])))
        };
        let span = [corner(f64::min, f64::INFINITY), corner(f64::max, f64::NEG_INFINITY)];
        self.nodes[node].span = span;
        if count == 1 {
            return;
        }
        let mut axis = 0;
        for k in 1..D {
            if span[1][k] - span[0][k] > span[1][axis] - span[0][axis] {
                axis = k;
            }
        }
        let middle = self.start(first + count / 2) - self.start(first);
        if middle < list.len() {
            // Numbers part equal points, so that the tree depends on nothing but the input.
            list.select_nth_unstable_by(middle, |a, b| a.at[axis].total_cmp(&b.at[axis]).then(a.number.cmp(&b.number)));
        }
        let (below, above) = list.split_at_mut(middle);
        self.split(2 * node + 1, first, count / 2, below);
        self.split(2 * node + 2, first + count / 2, count / 2, above);
    }

    /// Place of the first point of a leaf.
    fn start(&self, leaf: usize) -> usize {
        self.place.len() * leaf / self.leaves
    }

    /// The leaf of a place.
    fn leaf(&self, place: usize) -> usize {
        ((place + 1) * self.leaves - 1) / self.place.len()
    }

    /// Makes all points free again.
    pub(super) fn fill(&mut self) {
        for leaf in 0..self.leaves {
            self.nodes[self.leaves - 1 + leaf].free = (self.start(leaf + 1) - self.start(leaf)) as u32;
        }
        for node in (0..self.leaves - 1).rev() {
            self.nodes[node].free = self.nodes[2 * node + 1].free + self.nodes[2 * node + 2].free;
        }
    }

    /// Takes a free point out.
    pub(super) fn take(&mut self, number: u32) {
        let at = self.place[number as usize] as usize;
        let leaf = self.leaf(at);
        let mut node = self.leaves - 1 + leaf;
        let last = self.start(leaf) + self.nodes[node].free as usize - 1;
        // Free points of a leaf come first: the one taken changes places with the last of them.
        self.points.swap(at, last);
        self.place[self.points[at].number as usize] = at as u32;
        self.place[number as usize] = last as u32;
        loop {
            self.nodes[node].free -= 1;
            if node == 0 {
                return;
            }
            node = (node - 1) / 2;
        }
    }

    /// Calls `f` with the distance and number of free points around `from`, until none can be nearer
    /// than the limit that `f` last answered with. `near` is a point close to `from`, if one is known: the
    /// search begins there. `far` is the distance from a difference, whose parts it gets without sign.
    pub(super) fn around(
        &self,
        from: [f64; D],
        near: Option<u32>,
        mut limit: f64,
        far: impl Fn([f64; D]) -> f64,
        mut f: impl FnMut(f64, u32) -> f64,
    ) {
        let Some(near) = near else {
            return self.below(0, from, &mut limit, &far, &mut f);
        };
        let mut node = self.leaves - 1 + self.leaf(self.place[near as usize] as usize);
        self.below(node, from, &mut limit, &far, &mut f);
        // Up to the root: at each step all below `node` has been seen, its sibling not.
        while node > 0 {
            let sibling = if node % 2 == 1 { node + 1 } else { node - 1 };
            if self.nodes[sibling].free > 0 && self.reach(sibling, from, &far) < limit {
                self.below(sibling, from, &mut limit, &far, &mut f);
            }
            node = (node - 1) / 2;
        }
    }

    fn below(
        &self,
        node: usize,
        from: [f64; D],
        limit: &mut f64,
        far: &impl Fn([f64; D]) -> f64,
        f: &mut impl FnMut(f64, u32) -> f64,
    ) {
        if node + 1 >= self.leaves {
            let start = self.start(node + 1 - self.leaves);
            for p in &self.points[start..start + self.nodes[node].free as usize] {
                let d = far(gap(from, [p.at; 2]));
                if d < *limit {
                    *limit = f(d, p.number);
                }
            }
            return;
        }
        let children = [2 * node + 1, 2 * node + 2];
        let mut reach = [f64::INFINITY; 2];
        for (reach, &c) in reach.iter_mut().zip(&children) {
            if self.nodes[c].free > 0 {
                *reach = self.reach(c, from, far);
            }
        }
        // The nearer child first: what it holds may lower the limit below the reach of the other.
        let nearer = usize::from(reach[1] < reach[0]);
        for c in [nearer, 1 - nearer] {
            if reach[c] < *limit {
                self.below(children[c], from, limit, far, f);
            }
        }
    }

    /// Distance from a point to the box of a node.
    fn reach(&self, node: usize, from: [f64; D], far: &impl Fn([f64; D]) -> f64) -> f64 {
        far(gap(from, self.nodes[node].span))
    }
}

/// How far a point lies from a box along every axis.
fn gap<const D: usize>(from: [f64; D], [lo, hi]: [[f64; D]; 2]) -> [f64; D] {
    let mut gap = [0.0; D];
    for k in 0..D {
        gap[k] = (lo[k] - from[k]).max(from[k] - hi[k]).max(0.0);
    }
    gap
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square([x, y]: [f64; 2]) -> f64 {
        x * x + y * y
    }

    fn nearest(tree: &Tree<2>, from: [f64; 2], near: Option<u32>) -> Option<f64> {
        let mut best = None;
        tree.around(from, near, f64::INFINITY, square, |d, _| {
            best = Some(d);
            d
        });
        best
    }

    #[test]
    fn the_nearest_is_found_while_points_are_taken_out() {
        let mut random = terrace_core::random::Random::new(5);
        let mut next = || random.below(1 << 19) as f64;
        // Half of the points lie on a few spots, and two far away.
        for n in [1usize, 2, 9, 64, 300] {
            let mut points: Vec<[f64; 2]> = (0..n).map(|_| [next(), next()]).collect();
            (0..n / 2).for_each(|i| points[i] = [(i % 3) as f64, 7.0]);
            points[n - 1] = [1e12, -1e12];
            let mut tree = Tree::new(points.iter().copied());
            let mut free: Vec<u32> = (0..n as u32).collect();
            while !free.is_empty() {
                let from = [next(), next()];
                let d = |&i: &u32| {
                    let p = points[i as usize];
                    square([p[0] - from[0], p[1] - from[1]])
                };
                let want = free.iter().map(d).reduce(f64::min);
                assert_eq!(nearest(&tree, from, None), want);
                assert_eq!(nearest(&tree, from, Some(free[0])), want);
                let gone = free.swap_remove(next() as usize % free.len());
                tree.take(gone);
            }
            assert_eq!(nearest(&tree, [0.0, 0.0], Some(0)), None);
            tree.fill();
            assert_eq!(nearest(&tree, points[n / 2], None), Some(0.0));
        }
    }
}
