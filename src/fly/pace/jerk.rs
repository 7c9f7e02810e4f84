//! Jerk limits: rounds of convex programs, each from the motion that the last one found.
//!
//! A round cuts the run into windows that are solved on their own, with two borders held between them so that
//! no constraint sees two windows; the next round's windows lie half a width further. Only constraints that
//! are near their limit go into a program. Should others be broken by its answer, more go in.

use rayon::prelude::*;

use super::{Options, course::Course};
use crate::fly::chain::{Band, Row, minimise};

/// Borders in a window.
const WINDOW: usize = 512;
/// Share of a limit from which a constraint is part of the program.
const NEAR: f64 = 0.5;
/// Share from which one that was left out goes in.
const BROKEN: f64 = 0.9;
/// A share that every constraint has.
const ALL: f64 = -4.0;
/// Least share of itself that b may fall to in a round.
const LEAST: f64 = 0.05;
/// Accuracy of a program, relative to the time.
const ACCURACY: f64 = 1e-4;

/// Acceleration of an axis over its limit, where the time to the next reference begins or ends, as factors of
/// b at both borders: the middle of a cell, or the moving end of a cell that borders on rest.
#[inline]
fn reference(course: &Course, cell: usize, axis: usize) -> [f64; 2] {
    let third = if !course.is_end(cell) {
        1
    } else if cell == 0 {
        2
    } else {
        0
    };
    course.acceleration(cell, third, axis)
}

/// Time from a border to the reference of a cell beside it, and its derivatives by b at the border and at
/// the cell's other border.
#[inline]
fn half_time(course: &Course, cell: usize, own: f64, other: f64) -> [f64; 3] {
    if course.is_end(cell) {
        return [0.0; 3];
    }
    let h = course.width(cell);
    let (near, middle) = (own.sqrt(), (0.5 * (own + other)).sqrt());
    let sum = near + middle;
    let by = -h / (sum * sum);
    let by_middle = by * 0.25 / middle;
    [h / sum, by * 0.5 / near + by_middle, by_middle]
}

/// Time from reference to reference around border `i`, and its derivatives by b there and beside it.
fn time_around(course: &Course, i: usize, b: [f64; 3]) -> (f64, [f64; 3]) {
    let left = half_time(course, i - 1, b[1], b[0]);
    let right = half_time(course, i, b[1], b[2]);
    (left[0] + right[0], [left[2], left[1] + right[1], right[2]])
}

/// Change of acceleration around a border in units of what the jerk limit allows in one second.
fn change(course: &Course, i: usize, axis: usize) -> [f64; 3] {
    let (l, r) = (reference(course, i - 1, axis), reference(course, i, axis));
    [-l[0], r[0] - l[1], r[1]].map(|c| c * course.ramp[axis])
}

/// Jerk over its limit of an axis in the cells beside the stops, per (2 b^(3/2)) / (9 h²): with even d³s/dt³ it
/// is d³s/dt³ (q' + 9 q'' x + 4.5 q''' x²) at x from the stop.
fn end_factor(course: &Course, cell: usize, axis: usize) -> f64 {
    let h = course.width(cell);
    let (stop, sign) = if cell == 0 { (0, 1.0) } else { (2 * cell + 2, -1.0) };
    let halves = if cell == 0 { [0, 1, 2] } else { [2 * cell + 2, 2 * cell + 1, 2 * cell] };
    let third = (course.shape(halves[2], axis).1 - course.shape(stop, axis).1) / h;
    let at = |(n, half): (usize, usize)| {
        let x = 0.5 * h * n as f64;
        let (d1, d2) = course.shape(half, axis);
        (d1 + sign * 9.0 * d2 * x + sign * 4.5 * third * x * x).abs()
    };
    halves.into_iter().enumerate().map(at).fold(0.0, f64::max) * course.ramp[axis]
}

/// The largest share of the jerk limits that b reaches.
pub(super) fn ratio(course: &Course, b: &[f64]) -> f64 {
    let n = course.cells();
    let mut most = 0.0f64;
    for axis in (0..course.axes).filter(|&a| course.ramp[a] > 0.0) {
        for (cell, b) in [(0, b[1]), (n - 1, b[n - 1])] {
            let even = 2.0 * b.powf(1.5) / (9.0 * course.width(cell).powi(2));
            most = most.max(end_factor(course, cell, axis) * even);
        }
    }
    (1..n).fold(most, |m, i| m.max(ratio_at(course, i, [b[i - 1], b[i], b[i + 1]])))
}

/// The same at one border.
fn ratio_at(course: &Course, i: usize, b: [f64; 3]) -> f64 {
    let (time, _) = time_around(course, i, b);
    let share = |axis| {
        let c = change(course, i, axis);
        (c[0] * b[0] + c[1] * b[1] + c[2] * b[2]).abs() / time
    };
    (0..course.axes).filter(|&a| course.ramp[a] > 0.0).map(share).fold(0.0, f64::max)
}

/// Largest b beside the stops by jerk alone.
fn end_cap(course: &Course, cell: usize) -> f64 {
    let factor = (0..course.axes).map(|a| end_factor(course, cell, a)).fold(0.0, f64::max);
    (4.5 * course.width(cell).powi(2) / factor).powf(2.0 / 3.0)
}

/// Lowers b from what speed and acceleration allow to what jerk allows too. Says how many rounds it took.
pub(super) fn smooth(course: &Course, b: &mut Vec<f64>, options: &Options) -> usize {
    let n = course.cells();
    let mut caps = course.cap.clone();
    for (border, cell) in [(1, 0), (n - 1, n - 1)] {
        caps[border] = caps[border].min(end_cap(course, cell));
    }
    begin(course, &caps, b);
    let mut best = course.times(b)[n];
    for round in 0..options.rounds {
        // A little room for the program to begin in; less from round to round.
        let room = 1.0 - 0.02 * 0.7f64.powi(round as i32).max(0.02);
        let start: Vec<f64> = b.iter().map(|b| b * room).collect();
        let mut found = start.clone();
        let shift = if round % 2 == 0 { 0 } else { WINDOW / 2 };
        let solve = |(at, part): (usize, &mut [f64])| window(course, &caps, &start, at, part, round == 0);
        windows(&mut found, shift).into_par_iter().for_each(solve);
        let time = course.times(&found)[n];
        if time < best {
            *b = found;
        }
        let gain = (best - time) / best;
        best = best.min(time);
        if gain < options.gain && round > 1 {
            return round + 1;
        }
    }
    options.rounds
}

/// Stretches of unknowns with where they begin; two borders are held between any two.
fn windows(b: &mut [f64], shift: usize) -> Vec<(usize, &mut [f64])> {
    let end = b.len() - 1;
    let mut out = Vec::new();
    let (_, mut rest) = b.split_at_mut(1);
    let mut at = 1;
    let mut until = if shift > 0 { shift } else { WINDOW };
    while at < end {
        // A last stretch that would be short joins the one before.
        if until + WINDOW / 4 >= end {
            until = end;
        }
        let (part, tail) = rest.split_at_mut(until - at);
        out.push((at, part));
        let held = 2.min(tail.len());
        rest = tail.split_at_mut(held).1;
        at = until + held;
        until = at + WINDOW;
    }
    out
}

/// A motion that keeps the jerk limits: what the other limits allow, rounded off towards the stops, then
/// slowed down evenly until it does.
fn begin(course: &Course, caps: &[f64], b: &mut [f64]) {
    let n = course.cells();
    let (first, last) = (caps[1] / course.width(0).powf(4.0 / 3.0), caps[n - 1] / course.width(n - 1).powf(4.0 / 3.0));
    let length = course.x[n];
    for i in 1..n {
        let rise = |c: f64, x: f64| 1.0 / (c * x.powf(4.0 / 3.0));
        b[i] = 1.0 / (1.0 / b[i] + rise(first, course.x[i]) + rise(last, length - course.x[i]));
    }
    let most = course.ratio(b);
    let slower = most.jerk.powf(2.0 / 3.0).max(most.acceleration).max(1.0).recip();
    b.iter_mut().for_each(|b| *b *= slower);
}

/// Where a window lies: its unknowns are b at the borders `at..until`, as shares of `start`.
struct Window<'a> {
    course: &'a Course,
    caps: &'a [f64],
    start: &'a [f64],
    at: usize,
    until: usize,
}

/// Solves one window's program and leaves its answer in `part`.
fn window(course: &Course, caps: &[f64], start: &[f64], at: usize, part: &mut [f64], all: bool) {
    let window = Window { course, caps, start, at, until: at + part.len() };
    let whole: f64 = window.cells().map(|c| course.time(c, [start[c], start[c + 1]])).sum();
    let ones = vec![1.0; part.len()];
    let mut last: Option<Vec<f64>> = None;
    for near in [NEAR, NEAR, ALL] {
        let near = if all { ALL } else { near };
        let rows = window.rows(near, last.as_deref());
        let measure = |x: &[f64], g: &mut [f64], m: &mut Band| window.measure(whole, x, g, m);
        let found = minimise(ones.clone(), 1, &rows, measure, ACCURACY);
        if window.keeps(&found) {
            part.iter_mut().zip(&found).for_each(|(p, x)| *p *= x);
            return;
        }
        last = Some(found);
    }
}

impl Window<'_> {
    /// Cells that border on an unknown.
    fn cells(&self) -> std::ops::Range<usize> {
        self.at - 1..self.until
    }

    /// Borders whose jerk depends on an unknown.
    fn borders(&self) -> std::ops::Range<usize> {
        (self.at - 1).max(1)..(self.until + 1).min(self.course.cells())
    }

    /// The share at a border.
    #[inline]
    fn share(&self, x: &[f64], border: usize) -> f64 {
        if (self.at..self.until).contains(&border) { x[border - self.at] } else { 1.0 }
    }

    /// b at a border.
    #[inline]
    fn b(&self, x: &[f64], border: usize) -> f64 {
        self.share(x, border) * self.start[border]
    }

    /// Adds Σ c x over the shares from border `from` on to the rows, if an unknown is among them.
    fn push(&self, from: usize, c: [f64; 3], lo: f64, hi: f64, rows: &mut Vec<Row<3>>) {
        let mut row = Row { at: from.max(self.at) - self.at, a: [0.0; 3], lo, hi };
        for (border, c) in (from..).zip(c) {
            if (self.at..self.until).contains(&border) {
                row.a[border - self.at - row.at] = c;
            } else {
                row.lo -= c;
                row.hi -= c;
            }
        }
        if row.a != [0.0; 3] {
            rows.push(row);
        }
    }

    /// The constraints that reach `near` of their limit at the start, or were nearly or wholly broken by a
    /// program's answer `last`.
    fn rows(&self, near: f64, last: Option<&[f64]>) -> Vec<Row<3>> {
        let (course, s) = (self.course, self.start);
        let mut rows = Vec::with_capacity(8 * (self.until - self.at));
        for i in self.at..self.until {
            rows.push(Row { at: i - self.at, a: [1.0, 0.0, 0.0], lo: LEAST, hi: self.caps[i] / s[i] });
        }
        for cell in self.cells() {
            // At rest itself an end cell needs no constraint.
            let rests = |border| course.is_end(cell) && border;
            let thirds = usize::from(rests(cell == 0))..3 - usize::from(rests(cell > 0));
            for (axis, third) in (0..course.axes).flat_map(|a| thirds.clone().map(move |t| (a, t))) {
                let c = course.acceleration(cell, third, axis);
                let c = [c[0] * s[cell], c[1] * s[cell + 1], 0.0];
                let lately = last.map_or(0.0, |x| (c[0] * self.share(x, cell) + c[1] * self.share(x, cell + 1)).abs());
                if (c[0] + c[1]).abs() >= near || lately > BROKEN {
                    self.push(cell, c, -1.0, 1.0, &mut rows);
                }
            }
        }
        for i in self.borders() {
            let b = [s[i - 1], s[i], s[i + 1]];
            let (time, slope) = time_around(course, i, b);
            let x = last.map(|x| [self.share(x, i - 1), self.share(x, i), self.share(x, i + 1)]);
            let since = x.map_or(1.0, |x| time_around(course, i, [b[0] * x[0], b[1] * x[1], b[2] * x[2]]).0 / time);
            for axis in (0..course.axes).filter(|&a| course.ramp[a] > 0.0) {
                let c = change(course, i, axis);
                let c = [c[0] * b[0], c[1] * b[1], c[2] * b[2]].map(|c| c / time);
                let lately = x.map_or(0.0, |x| (c[0] * x[0] + c[1] * x[1] + c[2] * x[2]) / since);
                for sign in [1.0, -1.0] {
                    if sign * (c[0] + c[1] + c[2]) >= near || sign * lately > BROKEN {
                        // The time is of degree -1/2 in b, so its tangent is 3/2 time + slope * b.
                        let bent = [0, 1, 2].map(|k| sign * c[k] - slope[k] * b[k] / time);
                        self.push(i - 1, bent, f64::NEG_INFINITY, 1.5, &mut rows);
                    }
                }
            }
        }
        rows
    }

    /// The time of the window's cells over `whole`, with its derivatives.
    fn measure(&self, whole: f64, x: &[f64], gradient: &mut [f64], matrix: &mut Band) {
        for cell in self.cells() {
            let ends = [cell, cell + 1];
            let b = ends.map(|i| self.b(x, i));
            let h = self.course.width(cell) / whole;
            // φ = c / (√l + √r) and its derivatives by the shares.
            let c = if self.course.is_end(cell) { 1.5 * h } else { h };
            let root = b.map(f64::sqrt);
            let sum = root[0] + root[1];
            let (two, three) = (c / (sum * sum), c / (sum * sum * sum));
            let known = ends.map(|i| (self.at..self.until).contains(&i));
            for k in (0..2).filter(|&k| known[k]) {
                let (i, s) = (ends[k] - self.at, self.start[ends[k]]);
                gradient[i] -= s * two / root[k];
                matrix.add(i, i, s * s * (three / b[k] + 0.5 * two / (b[k] * root[k])));
            }
            if known[0] && known[1] {
                let s = self.start[ends[0]] * self.start[ends[1]];
                let i = ends[1] - self.at;
                matrix.add(i, i - 1, s * three / (root[0] * root[1]));
            }
        }
    }

    /// Whether the shares keep all limits.
    fn keeps(&self, x: &[f64]) -> bool {
        let course = self.course;
        let most = 1.0 + 1e-9;
        let capped = (self.at..self.until).all(|i| self.b(x, i) <= self.caps[i] * most);
        capped
            && self.cells().all(|cell| {
                let b = [cell, cell + 1].map(|i| self.b(x, i));
                (0..course.axes).flat_map(|a| [(a, 0), (a, 1), (a, 2)]).all(|(axis, third)| {
                    let c = course.acceleration(cell, third, axis);
                    (c[0] * b[0] + c[1] * b[1]).abs() <= most
                })
            })
            && self.borders().all(|i| ratio_at(course, i, [i - 1, i, i + 1].map(|j| self.b(x, j))) <= most)
    }
}
