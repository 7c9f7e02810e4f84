//! Jerk limits: the descent of b to where they hold.
//!
//! A long run is cut into windows that are solved on their own (`interior_point`), with two borders held between them
//! so that no constraint sees two windows. These are held at a motion that is slowed down until it keeps all limits; in
//! a second round windows that lie half a width further remove the loss that this causes.

use std::ops::Range;
use terrace_core::math;

use terrace_core::parallel;

use super::grid::Grid;
use super::interior_point::Stretch;
use super::jerk_rows::end_cap;
use super::{Options, ratio};

/// Unknown borders in a window, times the options' `refine`.
const WINDOW: usize = 1024;
/// Accuracy of a first round, where there is a second.
const LOOSE: f64 = 0.02;
/// Borders to each side of a seam between two windows that begin anew, as many times.
const SEAM: usize = 256;
/// Shares of b without jerk limits from which a window begins, and which may break them.
const FAST: [f64; 2] = [0.25, 0.5];

/// Lowers b from what speed and acceleration allow, at the most `most`, to what jerk allows too. Says how many
/// steps the longest stretch took.
pub(super) fn smooth(grid: &Grid, mut most: Vec<f64>, b: &mut [f64], options: &Options) -> usize {
    let n = grid.cells();
    for (border, cell) in [(1, 0), (n - 1, n - 1)] {
        most[border] = most[border].min(end_cap(grid, cell));
    }
    round_off(grid, &most, b);
    let fast = FAST.map(|share| b.iter().map(|b| share * b).collect::<Vec<f64>>());
    slow_down(grid, b);
    let mut steps = 0;
    let refine = options.refine.clamp(1, 8);
    let (width, reach) = (WINDOW * refine, SEAM * refine);
    let (windows, shifted) = (windows(n, width, width), windows(n, width / 2, width));
    let seams: Vec<usize> = windows.windows(2).map(|w| w[0].end).collect();
    // What is held in the second round must not lean on its limits, or next to nothing fits between.
    let rounds = if seams.is_empty() {
        vec![Round { windows, gain: options.gain, beginning: Beginning::FromHeld }]
    } else {
        let first = Round { windows, gain: LOOSE.max(options.gain), beginning: Beginning::FromHeld };
        let beginning = Beginning::AcrossSeams { seams: &seams, reach: reach as f64 };
        vec![first, Round { windows: shifted, gain: options.gain, beginning }]
    };
    for Round { windows, gain, beginning } in rounds {
        let lowered: Vec<Option<(usize, Vec<f64>)>> = parallel::map(windows.len(), |i| {
            let range = &windows[i];
            let mut stretch = Stretch::new(grid, &most, b, range.clone());
            // Where one beginning does not settle, another does; the motion that is held is the last.
            let quick = fast.iter().map(|fast| beginning.motion(grid, fast, b, range));
            quick.chain([b[range.clone()].to_vec()]).find_map(|start| stretch.descend(&start, gain))
        });
        for (range, window) in windows.into_iter().zip(lowered) {
            if let Some((count, values)) = window {
                b[range].copy_from_slice(&values);
                steps = steps.max(count);
            }
        }
    }
    steps
}

/// Windows that are solved independently of each other.
struct Round<'a> {
    windows: Vec<Range<usize>>,
    /// Gain of time, relative, for which a window makes no more steps.
    gain: f64,
    beginning: Beginning<'a>,
}

/// Where the descent of a window begins.
enum Beginning<'a> {
    /// At a fast motion, but near what is held next to the window no faster than even jerk reaches from there.
    FromHeld,
    /// At what was found, but at a fast motion about the seams of the round before.
    AcrossSeams {
        /// The borders held between the windows of the round before.
        seams: &'a [usize],
        /// Borders to each side of a seam that begin anew.
        reach: f64,
    },
}

impl Beginning<'_> {
    fn motion(&self, grid: &Grid, fast: &[f64], b: &[f64], range: &Range<usize>) -> Vec<f64> {
        match self {
            Self::FromHeld => from_held(grid, fast, b, range),
            Self::AcrossSeams { seams, reach } => across(fast, b, range, seams, *reach),
        }
    }
}

/// The unknown borders in windows; two are held between any two of these.
fn windows(end: usize, first: usize, width: usize) -> Vec<Range<usize>> {
    let mut out = Vec::new();
    let mut at = 1;
    while at < end {
        let width = if at == 1 { first } else { width };
        // A last one that would be short joins the one before.
        let until = if at + width + width / 2 >= end { end } else { at + width };
        out.push(at..until);
        at = until + 2;
    }
    out
}

/// Rounds off towards the stops what the other limits allow.
fn round_off(grid: &Grid, caps: &[f64], b: &mut [f64]) {
    let n = grid.cells();
    // From rest with even jerk b rises as x^(4/3); added as resistances are, b stays below both and is smooth.
    let (first, last) =
        (caps[1] / math::pow(grid.width(0), 4.0 / 3.0), caps[n - 1] / math::pow(grid.width(n - 1), 4.0 / 3.0));
    let length = grid.x[n];
    let rise = |c: f64, x: f64| 1.0 / (c * math::pow(x, 4.0 / 3.0));
    for (b, &x) in b.iter_mut().zip(&grid.x).take(n).skip(1) {
        *b = 1.0 / (1.0 / *b + rise(first, x) + rise(last, length - x));
    }
}

/// A motion to begin a window with: `fast`, but near what is held next to it no faster than even jerk reaches from
/// there.
fn from_held(grid: &Grid, fast: &[f64], b: &[f64], range: &Range<usize>) -> Vec<f64> {
    let ends = [range.start - 1, range.end];
    // From rest with even jerk j: t³ = 6 x / j and ds/dt = j t² / 2.
    let rise = ends.map(|i| {
        let slowest = (0..grid.axes).map(|a| grid.shape(2 * i, a).0.abs() * grid.ramp[a]).fold(0.0, f64::max);
        0.25 * math::pow(6f64, 4.0 / 3.0) * math::pow(slowest, -2.0 / 3.0)
    });
    let reached = |i: usize, k: usize| {
        let x = (grid.x[i] - grid.x[ends[k]]).abs();
        if b[ends[k]] > 0.0 { b[ends[k]] + rise[k] * math::pow(x, 4.0 / 3.0) } else { f64::INFINITY }
    };
    range.clone().map(|i| fast[i].min(reached(i, 0)).min(reached(i, 1))).collect()
}

/// A motion to begin a window with once more: what was found, but `fast` about the seams.
fn across(fast: &[f64], b: &[f64], range: &Range<usize>, seams: &[usize], reach: f64) -> Vec<f64> {
    let inside: Vec<usize> = seams.iter().copied().filter(|s| range.contains(s)).collect();
    let share = |i: usize| {
        let near = inside.iter().map(|&s| s.abs_diff(i)).min().map_or(f64::INFINITY, |d| d as f64);
        (2.0 - 2.0 * near / reach).clamp(0.0, 1.0)
    };
    range.clone().map(|i| math::pow(b[i], 1.0 - share(i)) * math::pow(fast[i], share(i))).collect()
}

/// Slows a motion down evenly until it keeps all limits, with some room.
fn slow_down(grid: &Grid, b: &mut [f64]) {
    // Evenly slowed by k, speed falls as k, acceleration as k² and jerk as k³; b is the square of the speed.
    let most = ratio::of(grid, b);
    let slower = 0.9 / math::pow(most.jerk, 2.0 / 3.0).max(most.acceleration).max(most.speed.powi(2)).max(1.0);
    b.iter_mut().for_each(|b| *b *= slower);
}
