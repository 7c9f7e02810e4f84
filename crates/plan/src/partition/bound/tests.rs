use super::*;
use crate::partition::window::{cover, tests::noise};
use terrace_core::math;

const MM: i32 = 1_000_000;
const SIZE: [i32; 3] = [40 * MM, 40 * MM, 70_000];

fn point(p: [i32; 3]) -> Item {
    Item { lo: p, hi: p }
}

/// Points where lines along x, 1 mm apart, cross the heights of rows on the dome of the counts.
fn dome() -> Vec<[i32; 3]> {
    let a = 10.043874448175666;
    let mut points = Vec::new();
    for y in 0..=450 {
        let v = (f64::from(y) - 225.0) / 225.0;
        for z in row_heights(SIZE[2], 0, (a * 1e6) as i32) {
            let square = 2.0 * (1.0 - f64::from(z) / 1e6 / a) - v * v;
            if (0.0..=1.0).contains(&square) {
                let u = square.sqrt();
                points.extend([-u, u].map(|u| [((1.0 + u) * 225e6).round() as i32, y * MM, z]));
            }
        }
    }
    points
}

#[test]
fn certificate_check_equals_a_scan_of_all_boxes() {
    let (mut sound, mut unsound) = (0, 0);
    for seed in 0..400 {
        let mut next = noise(seed);
        let size = [3 + next(4), 3 + next(4), 2 + next(4)];
        let pieces: Vec<(Item, u32)> = (0..2 + next(9))
            .map(|_| {
                let lo = [next(12), next(12), next(9)];
                (Item { lo, hi: [0, 1, 2].map(|k| lo[k] + next(size[k])) }, next(4) as u32)
            })
            .collect();
        let corners = (-8..12).flat_map(|x| (-8..12).flat_map(move |y| (-8..9).map(move |z| [x, y, z])));
        let load = |c| pieces.iter().filter(|(p, _)| p.is_in(c, size)).map(|p| p.1).sum::<u32>();
        let most = corners.map(load).max().unwrap_or(0);
        for whole in 1..12 {
            let certificate = Certificate { size, whole, pieces: pieces.clone() };
            assert_eq!(certificate.check(), most <= whole, "{certificate:?}");
            *(if most <= whole { &mut sound } else { &mut unsound }) += 1;
        }
    }
    assert!(sound > 500 && unsound > 500, "{sound} sound, {unsound} not");
}

#[test]
fn bound_is_at_most_the_size_of_any_cover() {
    for seed in 0..60 {
        let mut next = noise(seed);
        let size = [50 + next(50), 50 + next(50), 20 + next(20)];
        let thick = next(2) * 15;
        let items: Vec<Item> = (0..next(400))
            .map(|_| {
                let lo = [next(600) - 300, next(400), next(150) - 70];
                Item { lo, hi: lo.map(|v| v + next(thick + 1)) }
            })
            .collect();
        let points: Vec<[i32; 3]> = items.iter().map(|i| i.lo).collect();
        let stops = cover(&items, size, [1; 3]).len();
        for certificate in [lower_bound_whole(&items, size), lower_bound(&points, size)] {
            assert!(certificate.check());
            assert!(certificate.stops() <= stops, "{} of {stops}", certificate.stops());
            assert_eq!(certificate.stops() > 0, !items.is_empty());
        }
    }
}

#[test]
fn heights_of_rows_lie_where_asked() {
    let all: Vec<i32> = row_heights(70_000, -500_000, 500_000).collect();
    assert!(all.windows(2).all(|w| w[0] < w[1]) && all.contains(&0));
    for (lo, hi) in [(-1, 1), (0, 0), (1, 8_000), (-70_020, 70_020), (-500_000, -400_000)] {
        let want: Vec<i32> = all.iter().copied().filter(|h| (lo..=hi).contains(h)).collect();
        assert_eq!(row_heights(70_000, lo, hi).collect::<Vec<_>>(), want, "{lo} to {hi}");
    }
}

#[test]
fn points_farther_apart_than_a_box_count_once_each() {
    let apart: Vec<[i32; 3]> =
        (0..12).flat_map(|x| (0..12).map(move |y| [x * (40 * MM + 1), y * 41 * MM, 7])).collect();
    assert_eq!(lower_bound(&apart, SIZE).stops(), 144);
    let touching: Vec<[i32; 3]> = (0..12).map(|x| [x * 40 * MM, 0, 7]).collect();
    assert_eq!(lower_bound(&touching, SIZE).stops(), 6, "boxes are closed");
    assert_eq!(lower_bound(&[], SIZE).stops(), 0);
}

#[test]
fn laps_around_a_closed_line_count_its_last_part() {
    // 25.6 windows along a circle, each as wide as 40 mm along x or y.
    let r = 25.6 * 40e6 / (4.0 * std::f64::consts::SQRT_2);
    let points: Vec<[i32; 3]> = (0..20_000)
        .map(|n| {
            let t = f64::from(n) / 20e3 * std::f64::consts::TAU;
            [(r * math::cos(t)) as i32, (r * math::sin(t)) as i32, 0]
        })
        .collect();
    let certificate = lower_bound(&points, SIZE);
    assert!(certificate.check());
    assert!(certificate.pieces.iter().any(|p| p.1 < certificate.whole), "parts of a whole");
    let alone = lower_bound_whole(&points.iter().map(|&p| point(p)).collect::<Vec<_>>(), SIZE);
    assert!(certificate.stops() > alone.stops(), "{} over {}", certificate.stops(), alone.stops());
}

#[test]
#[ignore = "slow: make test-all"]
fn the_dome_needs_more_than_a_greedy_packing_tells_and_mutants_are_refused() {
    let sound = lower_bound(&dome(), SIZE);
    assert!(sound.check());
    assert!(sound.stops() >= 2150, "{}", sound.stops());

    let whole = sound.whole;
    let alone: Vec<usize> = (0..sound.pieces.len()).filter(|&n| sound.pieces[n].1 == whole).collect();
    let gap = |a: &Item, b: &Item| (0..2).map(|k| (a.lo[k] - b.lo[k]).abs() - SIZE[k]).max().unwrap_or(0);
    // A point moved towards another until one closed box just holds both, and 1 nm less.
    let mut moved = 0;
    for &n in alone.iter().step_by(97) {
        let p = sound.pieces[n].0;
        let near = alone.iter().map(|&m| sound.pieces[m].0).filter(|q| q.lo[2] == p.lo[2] && *q != p);
        let Some(q) = near.min_by_key(|q| gap(&p, q)) else { continue };
        let mut mutant = sound.clone();
        let into_reach = |k: usize, more: i32| p.lo[k].clamp(q.lo[k] - SIZE[k] - more, q.lo[k] + SIZE[k] + more);
        mutant.pieces[n].0 = point([into_reach(0, 0), into_reach(1, 0), p.lo[2]]);
        assert!(!mutant.check(), "{p:?} in reach of {q:?}");
        let pair = |more: i32| Certificate {
            pieces: vec![(point([into_reach(0, more), into_reach(1, more), p.lo[2]]), whole), (q, whole)],
            ..sound.clone()
        };
        assert!(!pair(0).check() && pair(1).check() || gap(&p, &q) <= 0, "one nanometre decides");
        moved += 1;
    }
    assert!(moved > 5, "{moved}");

    // A row moved into reach of the next, a weight too much, a piece that no stop holds, no whole.
    let mut mutant = sound.clone();
    for (p, _) in mutant.pieces.iter_mut().filter(|(p, _)| p.lo[2] < 2 * MM) {
        *p = point([p.lo[0], p.lo[1], p.lo[2] + 17]);
    }
    assert!(!mutant.check(), "rows that are too near");
    let mut mutant = sound.clone();
    mutant.pieces[alone[3]].1 += 1;
    assert!(!mutant.check());
    let mut mutant = sound.clone();
    mutant.pieces[alone[3]].0.hi[2] += SIZE[2] + 1;
    assert!(!mutant.check());
    assert!(!Certificate { whole: 0, ..sound }.check());
}

#[test]
fn points_at_any_height_form_rows_too() {
    // A slope of 70 levels, 4 windows wide, its points at heights of no order.
    let mut next = noise(5);
    let points: Vec<[i32; 3]> = (0..40_000)
        .map(|_| {
            let (x, y) = (next(200 * MM), next(150 * MM));
            [x, y, (f64::from(x) / 200e6 * 70.0 * 70e3) as i32]
        })
        .collect();
    let certificate = lower_bound(&points, SIZE);
    assert!(certificate.check());
    assert!((200..=284).contains(&certificate.stops()), "{}", certificate.stops());
}
