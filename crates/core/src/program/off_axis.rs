//! How far from the optical axis marks lie.

use crate::math;
use serde::{Deserialize, Serialize};

use super::{Block, Program};
use crate::geom::{FieldPoint, NM_PER_MM};
use crate::parallel;

/// Distances of marks from the optical axis in the field, mm.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct OffAxis {
    /// The distance of the farthest mark.
    pub largest: f64,
    /// Within which 95 % of the marked length lie, each stroke counted once; 95 % of the dots where there are no lines.
    /// It is rounded up to a 512th of the largest.
    pub p95: f64,
}

/// Rings that the distances are counted in.
const RINGS: usize = 512;

/// Parts of a program, at most, whose rings are counted apart: the sums are the same on any number of threads.
const PARTS: usize = 256;

/// The share that lies within the second figure.
const SHARE: f64 = 0.95;

impl OffAxis {
    /// The distances of all marks of a program from the optical axis.
    pub fn of(program: &Program) -> Self {
        let largest = Self::of_blocks(program).into_iter().fold(0.0, f64::max) * NM_PER_MM;
        let width = largest / RINGS as f64;
        if width == 0.0 {
            return Self::default();
        }
        let at_once = program.blocks.len().div_ceil(PARTS).max(1);
        let parts: Vec<&[Block]> = program.blocks.chunks(at_once).collect();
        let counted = parallel::map(parts.len(), |i| rings(program, parts[i], width));
        let mut all = Rings::default();
        counted.iter().for_each(|part| all.add(part));
        let rings = if all.lines.iter().any(|v| *v > 0.0) { &all.lines } else { &all.dots };
        let p95 = (ring_of_share(rings, SHARE) + 1).min(RINGS) as f64 * width;
        Self { largest: largest / NM_PER_MM, p95: p95 / NM_PER_MM }
    }

    /// The largest distance of the marks of each block, mm.
    pub fn of_blocks(program: &Program) -> Vec<f64> {
        parallel::map(program.blocks.len(), |i| farthest_nm(program, &program.blocks[i]) / NM_PER_MM)
    }
}

/// What lies in each ring: lengths of lines, nm, and numbers of dots.
struct Rings {
    lines: Vec<f64>,
    dots: Vec<f64>,
}

impl Default for Rings {
    fn default() -> Self {
        Self { lines: vec![0.0; RINGS], dots: vec![0.0; RINGS] }
    }
}

impl Rings {
    fn add(&mut self, other: &Self) {
        self.lines.iter_mut().zip(&other.lines).for_each(|(sum, v)| *sum += v);
        self.dots.iter_mut().zip(&other.dots).for_each(|(sum, v)| *sum += v);
    }

    /// A line from `a` to `b`, each ring as wide as `width`: between two of its circles lies the difference of what
    /// lies within them.
    fn line(&mut self, a: FieldPoint, b: FieldPoint, width: f64) {
        let [(ax, ay), (bx, by)] = [a, b].map(|p| (f64::from(p.x), f64::from(p.y)));
        let (dx, dy) = (bx - ax, by - ay);
        let length = math::hypot(dx, dy);
        if length == 0.0 {
            return;
        }
        // Along the line, from the foot of the perpendicular from the axis.
        let (from, to) = ((ax * dx + ay * dy) / length, (bx * dx + by * dy) / length);
        let foot = ((ax * dy - ay * dx) / length).abs();
        let nearest = if from < 0.0 && to > 0.0 { 0.0 } else { from.abs().min(to.abs()) };
        let ring = |along: f64| ((math::hypot(foot, along) / width) as usize).min(RINGS - 1);
        let (first, last) = (ring(nearest), ring(from.abs().max(to.abs())));
        // Invariant: `inside` is the length within the circle around the ring before.
        let mut inside = 0.0;
        for ring in first..last {
            // The circle that is this ring's outer border.
            let half = (((ring + 1) as f64 * width).powi(2) - foot * foot).max(0.0).sqrt();
            let within = (to.clamp(-half, half) - from.clamp(-half, half)).max(inside);
            self.lines[ring] += within - inside;
            inside = within;
        }
        self.lines[last] += length - inside;
    }
}

/// The innermost ring within which, itself included, a share of what is in all rings lies; [`RINGS`] where there is
/// none.
fn ring_of_share(rings: &[f64], share: f64) -> usize {
    let total = rings.iter().sum::<f64>();
    let mut inside = 0.0;
    for (ring, v) in rings.iter().enumerate() {
        inside += v;
        if inside >= share * total {
            return ring;
        }
    }
    RINGS
}

/// The largest distance of a block's marks, nm.
fn farthest_nm(program: &Program, block: &Block) -> f64 {
    let points = program.strokes_of(block).iter().flat_map(|s| program.points_of(s));
    points.map(|p| math::hypot(f64::from(p.x), f64::from(p.y))).fold(0.0, f64::max)
}

/// What lies in the rings of some blocks.
fn rings(program: &Program, blocks: &[Block], width: f64) -> Rings {
    let mut out = Rings::default();
    for points in blocks.iter().flat_map(|b| program.strokes_of(b)).map(|s| program.points_of(s)) {
        if let [dot] = points {
            let ring = (math::hypot(f64::from(dot.x), f64::from(dot.y)) / width) as usize;
            out.dots[ring.min(RINGS - 1)] += 1.0;
        }
        points.windows(2).for_each(|w| out.line(w[0], w[1], width));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::program::sample;

    fn of(strokes: &[&[[i32; 2]]]) -> OffAxis {
        let (mut program, _) = sample::program();
        let stroke = program.strokes[0];
        (program.strokes, program.points) = (Vec::new(), Vec::new());
        for points in strokes {
            let (first, len) = (program.points.len() as u32, points.len() as u32);
            program.strokes.push(crate::program::Stroke { first, len, ..stroke });
            program.points.extend(points.iter().map(|&[x, y]| FieldPoint::new(x * 1000, y * 1000)));
        }
        program.blocks.truncate(1);
        program.blocks[0].strokes = 0..program.strokes.len();
        OffAxis::of(&program)
    }

    fn near(found: OffAxis, largest: f64, p95: f64) {
        assert!((found.largest - largest).abs() < 1e-12, "{found:?}");
        assert!((p95..p95 + largest / 500.0).contains(&found.p95), "{found:?}, not {p95}");
    }

    #[test]
    fn the_ring_of_a_share_is_the_first_that_reaches_it() {
        assert_eq!([0.1, 0.25, 0.5, 1.0].map(|share| ring_of_share(&[1.0, 0.0, 3.0], share)), [0, 0, 2, 2]);
        assert_eq!(ring_of_share(&[], 0.5), RINGS);
    }

    #[test]
    fn distances_are_those_of_closed_forms() {
        // Through the axis: the length within r is 2 r.
        near(of(&[&[[-10_000, 0], [10_000, 0]]]), 10.0, 9.5);
        // Beside it by 6 mm: 95 % of 16 mm reach 7.6 mm from the foot.
        near(of(&[&[[6_000, -8_000], [6_000, 8_000]]]), 10.0, math::hypot(6f64, 7.6));
        // The same drawn in pieces, and backwards.
        near(of(&[&[[6_000, 8_000], [6_000, 1_000], [6_000, -8_000]]]), 10.0, math::hypot(6f64, 7.6));
        // Away from the axis: from 3 to 10 mm.
        near(of(&[&[[0, 3_000], [0, 10_000]]]), 10.0, 3.0 + 0.95 * 7.0);
        // Lines decide where there are dots too.
        near(of(&[&[[0, 20_000]], &[[0, -1_000], [0, 1_000]]]), 20.0, 0.95);
    }

    #[test]
    fn dots_count_where_there_are_no_lines() {
        let dots: Vec<Vec<[i32; 2]>> = (1..=20).map(|i| vec![[i * 1000, 0]]).collect();
        let dots: Vec<&[[i32; 2]]> = dots.iter().map(Vec::as_slice).collect();
        near(of(&dots), 20.0, 19.0);
        assert_eq!(of(&[&[[0, 0]]]), OffAxis::default());
    }

    #[test]
    fn the_sum_of_all_rings_is_the_length() {
        let mut random = crate::random::Random::new(7);
        for _ in 0..1000 {
            let [a, b] = [0, 1].map(|_| {
                FieldPoint::new(
                    random.between(-28_000_000, 28_000_000) as i32,
                    random.between(-28_000_000, 28_000_000) as i32,
                )
            });
            let mut rings = Rings::default();
            rings.line(a, b, 80_000.0);
            let length = math::hypot(f64::from(a.x - b.x), f64::from(a.y - b.y));
            let sum: f64 = rings.lines.iter().sum();
            assert!((sum - length).abs() <= 1e-9 * length && rings.lines.iter().all(|v| *v >= 0.0), "{a:?} {b:?}");
        }
    }
}
