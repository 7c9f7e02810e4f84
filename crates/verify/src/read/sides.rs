//! Polylines whose sides are found by their height, so that a point is held against few of them: programs write all
//! cells of a grain as one path, and each mark asks for its place.

use terrace_core::math;

/// Polylines.
pub(super) type Contours = Vec<Vec<[f64; 2]>>;

/// Sides to a strip, about.
const SIDES: usize = 4;

/// How often a side is listed on average, at most: one that is as high as many strips is listed in each of them.
const TIMES: f64 = 4.0;

/// Polylines, and in which strip of y each of their sides lies.
pub(super) struct Sides {
    lines: Contours,
    /// Where the first strip begins, px.
    low: f64,
    /// Strips to a px.
    per_px: f64,
    /// Where each strip begins in `listed`, and where the last one ends.
    begins: Vec<u32>,
    /// Line and corner at which each side begins, strip by strip.
    listed: Vec<[u32; 2]>,
}

impl Sides {
    pub(super) fn new(lines: Contours) -> Self {
        let corners = lines.iter().flatten();
        let (low, high) = corners.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), p| (l.min(p[1]), h.max(p[1])));
        let count: usize = lines.iter().map(Vec::len).sum();
        let heights: f64 = lines.iter().flat_map(|line| line.windows(2)).map(|w| (w[1][1] - w[0][1]).abs()).sum();
        let strips = (count / SIDES) as f64;
        // A strip is higher where many sides are high, so that the list stays short.
        let strips = if high > low { strips.min(TIMES * count as f64 * (high - low) / heights) } else { 1.0 };
        let strips = strips.max(1.0) as usize;
        let per_px = if strips > 1 { strips as f64 / (high - low) } else { 0.0 };
        let mut sides = Self { lines, low, per_px, begins: vec![0; strips + 1], listed: Vec::new() };
        sides.list();
        sides
    }

    /// The polylines.
    pub(super) const fn lines(&self) -> &Contours {
        &self.lines
    }

    /// Lists the sides: counts those of each strip, and puts each behind those of the strips before.
    fn list(&mut self) {
        let mut places = Vec::new();
        for (line, corners) in self.lines.iter().enumerate() {
            for corner in 0..corners.len() {
                let [a, b] = self.side([line as u32, corner as u32]);
                let strips = self.strip(a[1].min(b[1]))..=self.strip(a[1].max(b[1]));
                places.extend(strips.map(|strip| (strip, [line as u32, corner as u32])));
            }
        }
        // Stable: the sides of a strip keep their order.
        places.sort_by_key(|(strip, _)| *strip);
        for (strip, _) in &places {
            self.begins[strip + 1] += 1;
        }
        for strip in 1..self.begins.len() {
            self.begins[strip] += self.begins[strip - 1];
        }
        self.listed = places.into_iter().map(|(_, side)| side).collect();
    }

    /// The strip of a height; the first or the last one beyond them.
    fn strip(&self, y: f64) -> usize {
        (((y - self.low) * self.per_px) as usize).min(self.begins.len() - 2)
    }

    /// The ends of a side; that of the last corner closes its line.
    fn side(&self, [line, corner]: [u32; 2]) -> [[f64; 2]; 2] {
        let line = &self.lines[line as usize];
        [line[corner as usize], line[(corner as usize + 1) % line.len()]]
    }

    /// The sides that reach into this range of y, and some beside it; one of several strips several times.
    fn between(&self, low: f64, high: f64) -> &[[u32; 2]] {
        let [first, last] = [low, high].map(|y| self.strip(y));
        &self.listed[self.begins[first] as usize..self.begins[last + 1] as usize]
    }

    /// The same of the lines as they are drawn, without the sides that close them; those that have a length.
    fn drawn_between(&self, low: f64, high: f64) -> impl Iterator<Item = ([u32; 2], [[f64; 2]; 2])> + '_ {
        let is_drawn = |side: &[u32; 2]| (side[1] as usize) + 1 < self.lines[side[0] as usize].len();
        let drawn = self.between(low, high).iter().filter(move |side| is_drawn(side));
        drawn.map(|&side| (side, self.side(side))).filter(|(_, [a, b])| a != b)
    }

    /// How often the lines, closed, go round a point.
    pub(super) fn turns(&self, [x, y]: [f64; 2]) -> i32 {
        let crossing = |[a, b]: [[f64; 2]; 2]| {
            let is_right = (a[1] <= y) != (b[1] <= y) && a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0]) > x;
            i32::from(is_right) * if b[1] > a[1] { 1 } else { -1 }
        };
        self.between(y, y).iter().map(|&side| crossing(self.side(side))).sum()
    }

    /// The point of the lines that is nearest to one, if not farther than `reach`, and the direction there; not quite
    /// at the end of a side.
    pub(super) fn nearest(&self, p: [f64; 2], reach: f64) -> Option<([f64; 2], [f64; 2])> {
        let near = self.drawn_between(p[1] - reach, p[1] + reach);
        let near = near.map(|(side, [a, b])| (side, between(a, b, along(a, b, p).clamp(1e-6, 1.0 - 1e-6)), [a, b]));
        let near = near.map(|(side, q, ends)| (distance(p, q), side, q, ends)).filter(|(far, ..)| *far <= reach);
        // Of several, the first one of the lines.
        let (_, _, q, [a, b]) = near.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)))?;
        let length = distance(a, b);
        Some((q, [(b[0] - a[0]) / length, (b[1] - a[1]) / length]))
    }

    /// Whether a point lies beside one of the lines, at most so far from it, and not beyond the ends of a side.
    pub(super) fn holds_beside(&self, p: [f64; 2], far: f64) -> bool {
        self.drawn_between(p[1] - far, p[1] + far).any(|(_, [a, b])| {
            let t = along(a, b, p);
            (0.0..=1.0).contains(&t) && distance(p, between(a, b, t)) <= far
        })
    }
}

/// How far along a side the point lies that is nearest to another, in lengths of the side.
fn along(a: [f64; 2], b: [f64; 2], p: [f64; 2]) -> f64 {
    let d = [b[0] - a[0], b[1] - a[1]];
    (d[0] * (p[0] - a[0]) + d[1] * (p[1] - a[1])) / (d[0] * d[0] + d[1] * d[1])
}

fn between(a: [f64; 2], b: [f64; 2], t: f64) -> [f64; 2] {
    [0, 1].map(|k| a[k] + t * (b[k] - a[k]))
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    math::hypot(a[0] - b[0], a[1] - b[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Stars, a comb of high sides, points and an empty line, from a seed.
    fn lines(seed: u64) -> Contours {
        let mut state = seed * 2 + 1;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f64 / f64::from(1 << 24)
        };
        let mut out: Contours = (0..40)
            .map(|_| {
                let centre = [random() * 100.0, random() * 60.0];
                (0..12).map(|_| [centre[0] + random() * 8.0, centre[1] + random() * 8.0]).collect()
            })
            .collect();
        out.push((0..400).map(|k| [f64::from(k) / 4.0, if k % 4 < 2 { 5.0 } else { 55.0 }]).collect());
        out.extend([vec![[3.0, 4.0]], vec![], vec![[1.0, 2.0]; 3]]);
        out
    }

    /// All sides, those that close their lines too.
    fn all(lines: &Contours) -> Vec<[[f64; 2]; 2]> {
        lines.iter().flat_map(|l| (0..l.len()).map(|k| [l[k], l[(k + 1) % l.len()]])).collect()
    }

    #[test]
    fn a_point_is_answered_as_by_all_sides() {
        for seed in 0..5 {
            let lines = lines(seed);
            let sides = Sides::new(lines.clone());
            assert!(sides.begins.len() > 10 && sides.listed.len() < 5 * 900, "{}", sides.listed.len());
            for k in 0..2000 {
                let p = [f64::from(k % 50) * 2.2 - 3.0, f64::from(k / 50) * 1.75 - 5.0];
                let right = all(&lines).into_iter().filter(|[a, b]| {
                    (a[1] <= p[1]) != (b[1] <= p[1]) && a[0] + (p[1] - a[1]) / (b[1] - a[1]) * (b[0] - a[0]) > p[0]
                });
                let turns: i32 = right.map(|[a, b]| if b[1] > a[1] { 1 } else { -1 }).sum();
                assert_eq!(sides.turns(p), turns, "{p:?}");
                let drawn = lines.iter().flat_map(|l| l.windows(2)).filter(|w| w[0] != w[1]);
                let far =
                    |w: &[[f64; 2]]| distance(p, between(w[0], w[1], along(w[0], w[1], p).clamp(1e-6, 1.0 - 1e-6)));
                let least = drawn.map(far).fold(f64::INFINITY, f64::min);
                let found = sides.nearest(p, 0.7).map(|(q, _)| distance(p, q));
                assert_eq!(found, (least <= 0.7).then_some(least), "{p:?}");
                assert!(!sides.holds_beside(p, 0.7) || least < 0.7 + 1e-4, "{p:?}");
            }
        }
    }

    #[test]
    fn lines_without_a_height_or_without_a_side_have_one_strip() {
        let level = Sides::new(vec![vec![[0.0, 1.0], [9.0, 1.0], [4.0, 1.0]]]);
        assert_eq!((level.begins.len(), level.turns([1.0, 1.0])), (2, 0));
        assert!(level.holds_beside([2.0, 1.2], 0.3) && !level.holds_beside([2.0, 1.4], 0.3));
        let none = Sides::new(vec![]);
        assert_eq!((none.turns([0.0, 0.0]), none.nearest([0.0, 0.0], 9.0)), (0, None));
    }
}
