//! Grey by lines: their coverage is the density of the picture.
//!
//! Lines lie at (k + 1/2) pitch from the page's origin along one direction. The share q of them that is marked around a
//! point of density D is q = D pitch / spot, at most 1: the marked length times the spot's width is then D times the
//! area, and black is full lines at a pitch of a spot. Lines farther apart than a spot cover at most spot / pitch.
//!
//! - *lines*: line k is marked where q is above its threshold, the radical inverse of k to base 2 (van der Corput).
//!   Any 2^m neighbours have thresholds that differ by 2^-m, so a share q of them is marked.
//! - *dashes*: each line is divided into periods, those of every second line moved by half of one. In a period a dash
//!   is marked whose length is the mean of q over it, in its middle.

use std::sync::atomic::{AtomicUsize, Ordering};
use terrace_core::math;

use super::hatch::TooFine;
use super::marking::{Marking, Screen};
use crate::texture::clip::Polylines;
use crate::texture::place::LEAST;
use terrace_core::diag::Diag;
use terrace_core::geom::{PlanePoint, cos_sin};
use terrace_core::parallel;

/// Most lines and dashes of a picture.
const MAX_LINES: usize = 20_000_000;

/// Most places at which the picture is looked at.
const MAX_SAMPLES: f64 = 1e9;

/// Fewest places of a dash at which the picture is looked at.
const SAMPLES: f64 = 4.0;

/// Lines that are computed together.
const CHUNK: usize = 64;

/// The period of dashes unless the job states it, in pitches.
const PERIOD: f64 = 10.0;

/// The densities of a picture, rows from the top; 65535 is black.
#[derive(Debug)]
pub(in crate::texture) struct Grey {
    pub(in crate::texture) columns: usize,
    pub(in crate::texture) rows: usize,
    density: Vec<u16>,
    /// Width and height of the picture in pixels; where blocks were joined the last may lie partly beyond it.
    extent: [f64; 2],
    /// Where in the pixels the picture's upper left corner lies.
    corner: [f64; 2],
}

impl Grey {
    pub(in crate::texture) fn new(columns: usize, rows: usize, density: Vec<u16>) -> Self {
        debug_assert_eq!(density.len(), columns * rows);
        Self { columns, rows, density, extent: [columns as f64, rows as f64], corner: [0.0; 2] }
    }

    pub(in crate::texture) fn row(&self, j: usize) -> &[u16] {
        &self.density[j * self.columns..][..self.columns]
    }

    /// The same picture with blocks of `n x n` pixels as one of their mean.
    pub(in crate::texture) fn joined(&self, n: usize) -> Self {
        let [columns, rows] = [self.columns.div_ceil(n), self.rows.div_ceil(n)];
        let mut density = Vec::with_capacity(columns * rows);
        let mut sums = vec![0u64; columns];
        for first in (0..self.rows).step_by(n) {
            let last = (first + n).min(self.rows);
            sums.fill(0);
            for j in first..last {
                for (block, sum) in self.row(j).chunks(n).zip(&mut sums) {
                    *sum += block.iter().map(|&d| u64::from(d)).sum::<u64>();
                }
            }
            for (i, sum) in sums.iter().enumerate() {
                let count = ((last - first) * n.min(self.columns - i * n)) as u64;
                density.push(((sum + count / 2) / count) as u16);
            }
        }
        Self { columns, rows, density, extent: self.extent.map(|v| v / n as f64), corner: [0.0; 2] }
    }

    /// Exchanges left and right (axis 0), or top and bottom (axis 1).
    pub(super) fn mirror(&mut self, axis: usize) {
        self.corner[axis] = [self.columns, self.rows][axis] as f64 - self.extent[axis] - self.corner[axis];
        if axis == 0 {
            self.density.chunks_exact_mut(self.columns).for_each(<[u16]>::reverse);
        } else {
            self.density = (0..self.rows).rev().flat_map(|j| self.row(j).to_vec()).collect();
        }
    }

    /// The density at a place in pixels from the upper left corner, y down, from 0 to 1: linear between the centres of
    /// pixels, and beyond the outermost centres that of the pixel.
    fn at(&self, [x, y]: PlanePoint) -> f64 {
        let split = |v: f64, count: usize| {
            let v = (v - 0.5).clamp(0.0, count as f64 - 1.0);
            (v as usize, (v as usize + 1).min(count - 1), v.fract())
        };
        let (i0, i1, s) = split(x + self.corner[0], self.columns);
        let (j0, j1, t) = split(y + self.corner[1], self.rows);
        let d = |i: usize, j: usize| f64::from(self.density[j * self.columns + i]);
        let [upper, lower] = [j0, j1].map(|j| d(i0, j) + s * (d(i1, j) - d(i0, j)));
        (upper + t * (lower - upper)) / f64::from(u16::MAX)
    }

    /// The share of the picture that is darker.
    pub(in crate::texture) fn darker(&self, density: f64) -> f64 {
        let level = density * f64::from(u16::MAX);
        self.density.iter().filter(|&&d| f64::from(d) > level).count() as f64 / self.density.len().max(1) as f64
    }
}

/// Lines that reproduce grey.
pub(super) struct LineScreen {
    pub(super) pitch_mm: f64,
    spot_mm: f64,
    direction: [f64; 2],
    one_way: bool,
    /// Of dashes; None for whole lines.
    period_mm: Option<f64>,
}

impl LineScreen {
    pub(super) fn new(marking: &Marking, spot_mm: f64, page_rad: f64) -> Self {
        let pitch_mm = marking.pitch_mm.unwrap_or(spot_mm);
        let tone = marking.tone.unwrap_or_default();
        let period = tone.period_mm.unwrap_or(PERIOD * pitch_mm);
        Self {
            pitch_mm,
            spot_mm,
            direction: cos_sin(marking.direction_rad - page_rad),
            one_way: marking.one_way,
            period_mm: (tone.screen == Screen::Dashes).then_some(period),
        }
    }

    /// What is said where the lines lie too far apart for the dark parts of a picture.
    pub(super) fn pale(&self, grey: &Grey) -> Option<Diag> {
        pale(grey, self.spot_mm / self.pitch_mm, self.pitch_mm, self.spot_mm, "lines")
    }

    /// Appends the lines of a picture on a page.
    pub(super) fn mark(&self, grey: &Grey, size: [f64; 2], out: &mut Polylines) -> Result<(), TooFine> {
        let [c, s] = self.direction;
        let corners = [[0.0, 0.0], [size[0], 0.0], [0.0, size[1]], size].map(|[x, y]| c * y - s * x);
        let lo = corners.into_iter().fold(f64::MAX, f64::min);
        let hi = corners.into_iter().fold(f64::MIN, f64::max);
        let first = (lo / self.pitch_mm - 0.5).ceil();
        let count = ((hi / self.pitch_mm - 0.5).ceil() - first).max(0.0);
        let picture = Picture::new(grey, size);
        // Twice in a pixel.
        let step = picture.step[0].min(picture.step[1]) / 2.0;
        let least = self.period_mm.map_or(step, |period| step.min(period / SAMPLES));
        if count * math::hypot(size[0], size[1]) / least > MAX_SAMPLES || count > MAX_LINES as f64 {
            return Err(TooFine);
        }
        let count = count as usize;
        // Whether there are too many does not depend on who counts first.
        let line_count = AtomicUsize::new(0);
        let chunks = parallel::map(count.div_ceil(CHUNK), |chunk| {
            let mut lines = Vec::new();
            if line_count.load(Ordering::Relaxed) > MAX_LINES {
                return lines;
            }
            for i in chunk * CHUNK..((chunk + 1) * CHUNK).min(count) {
                self.line(&picture, first as i64 + i as i64, step, &mut lines);
            }
            line_count.fetch_add(lines.len(), Ordering::Relaxed);
            lines
        });
        if line_count.into_inner() > MAX_LINES {
            return Err(TooFine);
        }
        chunks.iter().flatten().for_each(|line| out.push(line));
        Ok(())
    }

    /// Appends what is marked of line `k`.
    fn line(&self, picture: &Picture<'_>, k: i64, step: f64, out: &mut Vec<[PlanePoint; 2]>) {
        let v = (k as f64 + 0.5) * self.pitch_mm;
        let [c, s] = self.direction;
        let place = |u: f64| [c * u - s * v, s * u + c * v];
        let Some([from, to]) = picture.span(place(0.0), self.direction) else { return };
        let share = |u: f64| picture.at(place(u)) * self.pitch_mm / self.spot_mm;
        let mut pieces = match self.period_mm {
            Some(period) => {
                let offset = if k % 2 == 0 { 0.0 } else { period / 2.0 };
                dashes(share, [from, to], period, offset, step)
            }
            None => above(share, [from, to], radical_inverse(k), step),
        };
        pieces.retain(|[a, b]| b - a >= LEAST);
        if !self.one_way && k.rem_euclid(2) == 1 {
            pieces.reverse();
            pieces.iter_mut().for_each(|p| p.reverse());
        }
        out.extend(pieces.into_iter().map(|p| p.map(place)));
    }
}

/// What is said where `what`, a pitch apart, cover at most a share of `most`.
pub(super) fn pale(grey: &Grey, most: f64, pitch_mm: f64, spot_mm: f64, what: &str) -> Option<Diag> {
    let share = if most < 1.0 { grey.darker(most) } else { 0.0 };
    (share > 0.0).then(|| {
        let text = format!(
            "{what} {pitch_mm} mm apart under a spot of {spot_mm} mm cover at most {:.0} %; {:.0} % of the picture is darker and marked alike",
            100.0 * most,
            100.0 * share
        );
        Diag::warning("bitmap-pale", text).hint("use a pitch of the spot or less")
    })
}

/// A picture on its page.
pub(super) struct Picture<'a> {
    grey: &'a Grey,
    size: [f64; 2],
    /// Width and height of a pixel, mm.
    step: [f64; 2],
}

impl<'a> Picture<'a> {
    pub(super) fn new(grey: &'a Grey, size: [f64; 2]) -> Self {
        Self { grey, size, step: [0, 1].map(|k| size[k] / grey.extent[k]) }
    }

    /// The density at a place on the page, from 0 to 1.
    pub(super) fn at(&self, [x, y]: PlanePoint) -> f64 {
        self.grey.at([x / self.step[0], (self.size[1] - y) / self.step[1]])
    }

    /// Where a line is on the page.
    fn span(&self, p: PlanePoint, direction: [f64; 2]) -> Option<[f64; 2]> {
        let mut from = f64::MIN;
        let mut to = f64::MAX;
        for k in 0..2 {
            if direction[k] == 0.0 {
                if p[k] < 0.0 || p[k] > self.size[k] {
                    return None;
                }
                continue;
            }
            let ends = [0.0, self.size[k]].map(|side| (side - p[k]) / direction[k]);
            from = from.max(ends[0].min(ends[1]));
            to = to.min(ends[0].max(ends[1]));
        }
        (to - from >= LEAST).then_some([from, to])
    }
}

/// The stretches where a share is above a threshold.
fn above(share: impl Fn(f64) -> f64, [from, to]: [f64; 2], threshold: f64, step: f64) -> Vec<[f64; 2]> {
    let count = ((to - from) / step).ceil().max(1.0) as usize;
    let place = |i: usize| if i == count { to } else { from + i as f64 * ((to - from) / count as f64) };
    let mut out: Vec<[f64; 2]> = Vec::new();
    let mut before = share(from) - threshold;
    let mut start = (before > 0.0).then_some(from);
    for i in 1..=count {
        let now = share(place(i)) - threshold;
        if (before > 0.0) != (now > 0.0) {
            let a = place(i - 1);
            let b = place(i);
            let at = a + before / (before - now) * (b - a);
            match start.take() {
                Some(begun) => out.push([begun, at]),
                None => start = Some(at),
            }
        }
        before = now;
    }
    out.extend(start.map(|begun| [begun, to]));
    out
}

/// One dash in the middle of each period; dashes that touch are one.
fn dashes(share: impl Fn(f64) -> f64, [from, to]: [f64; 2], period: f64, offset: f64, step: f64) -> Vec<[f64; 2]> {
    let first = ((from - offset) / period).floor();
    let count = ((to - offset) / period).ceil() - first;
    let mut out: Vec<[f64; 2]> = Vec::new();
    for m in 0..count as usize {
        let begin = offset + (first + m as f64) * period;
        let a = begin.max(from);
        let b = (begin + period).min(to);
        if b - a < LEAST {
            continue;
        }
        let samples = ((b - a) / step).ceil().max(SAMPLES) as usize;
        let middle = |i: usize| a + (i as f64 + 0.5) / samples as f64 * (b - a);
        let mean = (0..samples).map(|i| share(middle(i))).sum::<f64>() / samples as f64;
        let gap = (1.0 - mean.min(1.0)) / 2.0 * (b - a);
        match out.last_mut() {
            Some(last) if a + gap - last[1] < LEAST => last[1] = b - gap,
            _ => out.push([a + gap, b - gap]),
        }
    }
    out
}

/// The binary digits of k behind the point, the lowest first: between 0 and 1.
fn radical_inverse(k: i64) -> f64 {
    f64::from((k as u32).reverse_bits()) * 2.0_f64.powi(-32)
}
