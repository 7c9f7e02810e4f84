//! A run laid out: its cells, and what the axes do there per unit of b.

use super::{Limit, Options, Path};
use crate::on_the_fly::spline;
use terrace_core::math;

/// A run on its cells.
#[derive(Debug)]
pub(super) struct Grid {
    pub axes: usize,
    /// Borders of cells, from the run's start.
    pub x: Vec<f64>,
    /// Segment of the path in which the cell after a border lies; the last border repeats the last.
    pub segment: Vec<u32>,
    /// Largest b at the borders: caps and speed limits.
    pub cap: Vec<f64>,
    /// dq/ds and d²q/ds² per axis as shares of its acceleration limit, at borders (even places) and middles.
    d1: Vec<f64>,
    d2: Vec<f64>,
    /// Acceleration limit / jerk limit, s; 0 without jerk limit.
    pub ramp: Vec<f64>,
}

impl Grid {
    /// Lays the nodes `first..=last` out.
    pub fn lay(path: &Path, limits: &[Limit], options: &Options, first: usize, last: usize, bends: &[f64]) -> Self {
        let axes = limits.len();
        let s = &path.s[first..=last];
        let (x, segment) = cells(s, options, first, fine(path, limits, options, first, last, bends));
        let borders = x.len();
        let mut out = Self {
            axes,
            cap: vec![f64::INFINITY; borders],
            d1: Vec::with_capacity((2 * borders - 1) * axes),
            d2: Vec::with_capacity((2 * borders - 1) * axes),
            ramp: limits.iter().map(|l| l.jerk.map_or(0.0, |j| l.acceleration / j)).collect(),
            x,
            segment,
        };
        for half in 0..2 * borders - 1 {
            // A border belongs to the cell on its right, the last to the one on its left.
            let cell = (half / 2).min(borders - 2);
            let middle = 0.5 * (out.x[half / 2] + out.x[half.div_ceil(2)]);
            let node = out.segment[cell] as usize;
            let width = path.s[node + 1] - path.s[node];
            let offset = (middle - (path.s[node] - path.s[first])).clamp(0.0, width);
            let mut cap = path.caps[node].powi(2);
            for (a, limit) in limits.iter().enumerate() {
                let ends = [path.positions[node * axes + a], path.positions[(node + 1) * axes + a]];
                let from = (node - first) * axes + a;
                let [_, d1, d2] =
                    spline::segment(ends, [bends[from], bends.get(from + axes).copied().unwrap_or(0.0)], width, offset);
                cap = cap.min((limit.speed / d1).powi(2));
                out.d1.push(d1 / limit.acceleration);
                out.d2.push(d2 / limit.acceleration);
            }
            for border in [half / 2, half.div_ceil(2)] {
                out.cap[border] = out.cap[border].min(cap);
            }
        }
        out
    }

    pub fn cells(&self) -> usize {
        self.x.len() - 1
    }

    pub fn width(&self, cell: usize) -> f64 {
        self.x[cell + 1] - self.x[cell]
    }

    pub(crate) fn has_jerk(&self) -> bool {
        self.ramp.iter().any(|&r| r > 0.0)
    }

    /// dq/ds and d²q/ds² of an axis at a border (even) or middle (odd), as shares of its acceleration limit.
    #[inline]
    pub fn shape(&self, half: usize, axis: usize) -> (f64, f64) {
        (self.d1[half * self.axes + axis], self.d2[half * self.axes + axis])
    }

    /// Whether a cell starts or ends at rest with even jerk rather than even acceleration.
    #[inline]
    pub fn is_end(&self, cell: usize) -> bool {
        (cell == 0 || cell + 1 == self.cells()) && self.has_jerk()
    }

    /// Acceleration of an axis over its limit in a cell, at its start, middle or end (`third` 0, 1, 2), as
    /// factors of b at both borders.
    #[inline]
    pub fn acceleration(&self, cell: usize, third: usize, axis: usize) -> [f64; 2] {
        let (d1, d2) = self.shape(2 * cell + third, axis);
        let h = self.width(cell);
        if self.is_end(cell) {
            // From rest with even jerk: b = b₁ u^(4/3), d²s/dt² = 2/3 b₁/h u^(1/3), u the share of the way.
            let (left, share) = if cell == 0 { (true, third as f64 / 2.0) } else { (false, 1.0 - third as f64 / 2.0) };
            let gain = 2.0 / 3.0 / h * math::cbrt(share);
            let factor = d2 * math::cbrt(share).powi(4) + if left { gain * d1 } else { -gain * d1 };
            return if left { [0.0, factor] } else { [factor, 0.0] };
        }
        let v = third as f64 / 2.0;
        [d2 * (1.0 - v) - d1 / (2.0 * h), d2 * v + d1 / (2.0 * h)]
    }

    /// [`Grid::acceleration`] at start, middle, end and both quarters of a cell.
    ///
    /// Where s accelerates evenly it is quadratic over the cell: kept at start, middle and end alone, a limit may be
    /// exceeded by a quarter in between.
    pub(crate) fn accelerations(&self, cell: usize, axis: usize) -> impl Iterator<Item = [f64; 2]> {
        let thirds = [0, 1, 2].map(|third| self.acceleration(cell, third, axis));
        let [p, q, r] = thirds;
        let quarter = |p: [f64; 2], r: [f64; 2]| [0, 1].map(|k| (3.0 * p[k] + 6.0 * q[k] - r[k]) / 8.0);
        let quarters = (!self.is_end(cell)).then(|| [quarter(p, r), quarter(r, p)]);
        thirds.into_iter().chain(quarters.into_iter().flatten())
    }

    /// Time of a cell.
    #[inline]
    pub fn time(&self, cell: usize, b: [f64; 2]) -> f64 {
        let sum = b[0].sqrt() + b[1].sqrt();
        // Even jerk from rest covers a third of what the last speed would.
        if self.is_end(cell) { 3.0 * self.width(cell) / sum } else { 2.0 * self.width(cell) / sum }
    }

    /// Times at the borders.
    pub fn times(&self, b: &[f64]) -> Vec<f64> {
        let mut out = Vec::with_capacity(self.x.len());
        let mut t = 0.0;
        out.push(t);
        for cell in 0..self.cells() {
            t += self.time(cell, [b[cell], b[cell + 1]]);
            out.push(t);
        }
        out
    }
}

/// Fine cells that a run needs: at least as many as the options say, and enough that the way from rest to full
/// acceleration holds three. Where jerk is so large that this would be many, it costs next to no time.
fn fine(path: &Path, limits: &[Limit], options: &Options, first: usize, last: usize, bends: &[f64]) -> f64 {
    let k = limits.len();
    let mut ramp = f64::INFINITY;
    for (node, end) in [(first, 0.0), (last - 1, 1.0)] {
        let width = path.s[node + 1] - path.s[node];
        let (mut acceleration, mut jerk) = (f64::INFINITY, f64::INFINITY);
        for (a, l) in limits.iter().enumerate() {
            let ends = [path.positions[node * k + a], path.positions[(node + 1) * k + a]];
            let from = (node - first) * k + a;
            let bent = [bends[from], bends.get(from + k).copied().unwrap_or(0.0)];
            let slope = spline::segment(ends, bent, width, end * width)[1].abs();
            acceleration = acceleration.min(l.acceleration / slope);
            jerk = jerk.min(l.jerk.map_or(f64::INFINITY, |j| j / slope));
        }
        ramp = ramp.min(if jerk.is_finite() { acceleration.powi(3) / (6.0 * jerk * jerk) } else { f64::INFINITY });
    }
    let least = options.least_cells.max(4) as f64;
    let want = 3.0 * math::cbrt(0.5 * (path.s[last] - path.s[first]) / ramp);
    want.clamp(least, 8.0 * least)
}

/// Borders of cells and the segments they lie in. Cells are as long as the segments are over `refine`, and
/// besides no longer than c x^(2/3) at x from the nearer stop, with c so that a run has `fine` × `refine` of
/// these: where even jerk starts from rest they take equal times.
fn cells(s: &[f64], options: &Options, first: usize, fine: f64) -> (Vec<f64>, Vec<u32>) {
    let refine = options.refine.max(1) as f64;
    let length = s[s.len() - 1] - s[0];
    let half = 0.5 * refine * fine;
    let count = |x: f64| fine_cells_up_to(x, length, half);
    let mut x = vec![0.0];
    let mut segment = Vec::new();
    for (i, w) in s.windows(2).enumerate() {
        let (from, to) = (w[0] - s[0], w[1] - s[0]);
        let measure = |x: f64| count(x) - count(from) + refine * (x - from) / (to - from);
        let n = measure(to).round().max(1.0);
        // Far from the stops the fine cells no longer show: the cells of a segment are even.
        let is_even = measure(to) < 1.02 * refine;
        for j in 1..n as usize {
            if is_even {
                x.push(from + (to - from) * j as f64 / n);
                continue;
            }
            let want = measure(to) * j as f64 / n;
            // The measure grows with x: bisection to the last bits that matter.
            let (mut lo, mut hi) = (from, to);
            for _ in 0..50 {
                let mid = 0.5 * (lo + hi);
                if measure(mid) < want { lo = mid } else { hi = mid }
            }
            x.push(lo);
        }
        x.push(to);
        segment.resize(x.len() - 1, (first + i) as u32);
    }
    segment.push((first + s.len() - 2) as u32);
    (x, segment)
}

/// Fine cells of a run up to x, of `half` up to its middle; its two halves are mirrored.
fn fine_cells_up_to(x: f64, length: f64, half: f64) -> f64 {
    let from_stop = |x: f64| half * math::cbrt((x / (0.5 * length)).max(0.0));
    if x <= 0.5 * length { from_stop(x) } else { 2.0 * half - from_stop(length - x) }
}
