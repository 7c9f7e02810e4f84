use super::*;

/// Random numbers.
pub(in crate::partition) fn noise(seed: u64) -> impl FnMut(i32) -> i32 {
    let mut random = terrace_core::random::Random::new(seed);
    move |n| random.below(n as usize) as i32
}

/// A sheet z = f(x, y) of square cells.
fn sheet(cells: [i32; 2], cell: i32, f: impl Fn(f64, f64) -> f64) -> Vec<Item> {
    let mut items = Vec::new();
    for (i, j) in (0..cells[1]).flat_map(|j| (0..cells[0]).map(move |i| (i, j))) {
        let z = f(f64::from(i * cell), f64::from(j * cell)) as i32;
        items.push(Item { lo: [i * cell, j * cell, z], hi: [(i + 1) * cell, (j + 1) * cell, z + 2] });
    }
    items
}

/// How many boxes the grid of sections takes.
fn sections(items: &[Item], size: [i32; 3], step: [i32; 3]) -> usize {
    let room = [0, 1, 2].map(|k| size[k] / step[k]);
    let index = Index::new(items.iter().map(|i| i.on_lattice(size, step)).collect(), room);
    grid::sweep(&index, room).len()
}

fn assert_all_held(items: &[Item], corners: &[[i32; 3]], size: [i32; 3], step: [i32; 3]) {
    assert!(corners.iter().all(|c| (0..3).all(|k| c[k] % step[k] == 0)), "corners lie on the lattice");
    for i in items {
        assert!(corners.iter().any(|&c| i.is_in(c, size)), "{i:?} is not held");
    }
}

#[test]
fn every_piece_is_covered_for_random_pieces() {
    for seed in 0..40 {
        let mut next = noise(seed);
        let size = [50 + next(50), 50 + next(50), 20 + next(20)];
        let step = [1 + next(4), 1 + next(4), 1 + next(3)];
        let count = next(600);
        let items: Vec<Item> = (0..count)
            .map(|_| {
                let lo = [next(600) - 300, next(400), next(150) - 70];
                // Room for the lattice is left.
                let hi = [0, 1, 2].map(|k| lo[k] + next(size[k] - step[k]));
                Item { lo, hi }
            })
            .collect();
        let corners = cover(&items, size, step);
        assert_all_held(&items, &corners, size, step);
        assert!(corners.len() <= items.len());
        assert!(corners.len() <= sections(&items, size, step));
    }
}

#[test]
fn cover_of_a_flat_sheet_is_a_grid() {
    // 12 by 10 windows exactly.
    let items = sheet([120, 100], 10, |_, _| 0.0);
    assert_eq!(cover(&items, [100, 100, 7], [1; 3]).len(), 120);
    assert_eq!(cover(&[], [100, 100, 7], [1; 3]), Vec::<[i32; 3]>::new());
}

#[test]
fn a_slope_along_x_takes_its_levels_and_no_more() {
    // 40 levels of D = 10, each a strip of 10 x 1000 that takes 5 windows.
    let items = sheet([40, 100], 10, |x, _| x);
    let cut: Vec<Item> = items.iter().map(|i| Item { hi: [i.hi[0], i.hi[1], i.lo[2] + 10], ..*i }).collect();
    assert_eq!(cover(&cut, [200, 200, 10], [1; 3]).len(), 40 * 5);
}

#[test]
#[ignore = "slow: make test-all"]
fn free_windows_need_fewer_than_sections_on_a_dome() {
    let items = sheet([225, 225], 2, |x, y| {
        let (u, v) = ((x - 225.0) / 225.0, (y - 225.0) / 225.0);
        3000.0 * (1.0 - (u * u + v * v) / 2.0)
    });
    let (size, step) = ([40, 40, 100], [1; 3]);
    let (free, grid) = (cover(&items, size, step), sections(&items, size, step));
    assert_all_held(&items, &free, size, step);
    assert!(free.len() * 100 <= grid * 80, "{} of {grid}", free.len());
}

#[test]
fn order_and_duplicates_of_pieces_do_not_change_the_cover() {
    let mut items = sheet([60, 60], 5, |x, y| 0.3 * x + 0.001 * y * y);
    let want = cover(&items, [40, 40, 12], [1; 3]);
    items.reverse();
    items.extend_from_within(100..300);
    assert_eq!(cover(&items, [40, 40, 12], [1; 3]), want);
}

#[test]
fn shifted_pieces_give_shifted_boxes() {
    let items = sheet([60, 60], 5, |x, y| 0.3 * x + 0.001 * y * y);
    let by = [400, -7000, 90];
    let moved: Vec<Item> = items
        .iter()
        .map(|i| Item { lo: [0, 1, 2].map(|k| i.lo[k] + by[k]), hi: [0, 1, 2].map(|k| i.hi[k] + by[k]) })
        .collect();
    let back = |c: &[i32; 3]| [0, 1, 2].map(|k| c[k] - by[k]);
    let want = cover(&items, [40, 40, 12], [2; 3]);
    let got: Vec<[i32; 3]> = cover(&moved, [40, 40, 12], [2; 3]).iter().map(back).collect();
    assert_eq!(got, want);
}

#[test]
fn tall_pieces_share_boxes() {
    // Pairs that fit one box together, far from all others.
    let items: Vec<Item> = (0..400)
        .map(|n| {
            let (x, y, z) = (n / 2 % 20 * 300, n / 40 * 300, n % 2 * 8);
            Item { lo: [x + n % 2 * 60, y, z], hi: [x + n % 2 * 60 + 40, y + 40, z + 12] }
        })
        .collect();
    assert_eq!(cover(&items, [100, 100, 20], [1; 3]).len(), 200);
}
