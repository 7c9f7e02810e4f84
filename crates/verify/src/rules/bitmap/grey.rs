//! How dark a bitmap is on its page.

use terrace_core::geom::PlanePoint;
use terrace_core::math;
use terrace_input::texture::{Image, Tone};

/// The densities of a picture on its page, rows from the top, 0 to 1.
pub(super) struct Grey {
    pub(super) columns: usize,
    pub(super) rows: usize,
    pub(super) density: Vec<f32>,
    /// Width and height of a pixel, mm.
    pub(super) pixel: [f64; 2],
    /// Height of the page, mm.
    pub(super) height: f64,
}

impl Grey {
    /// The densities of a bitmap whose page has these sides, mm.
    pub(super) fn new(image: &Image, tone: &Tone, size: [f64; 2]) -> Self {
        let density = |&sample: &u16| {
            let light = math::pow(f64::from(sample) / f64::from(u16::MAX), tone.gamma);
            (if tone.invert { light } else { 1.0 - light }) as f32
        };
        Self {
            columns: image.columns,
            rows: image.rows,
            density: image.samples.iter().map(density).collect(),
            pixel: [size[0] / image.columns as f64, size[1] / image.rows as f64],
            height: size[1],
        }
    }

    /// The same picture with blocks of `n` by `n` pixels, counted from the upper left corner, as one of their mean.
    pub(super) fn joined(&self, n: usize) -> Self {
        let (columns, rows) = (self.columns.div_ceil(n), self.rows.div_ceil(n));
        let mut sums = vec![(0.0f64, 0u32); columns * rows];
        for (k, &d) in self.density.iter().enumerate() {
            let sum = &mut sums[k / self.columns / n * columns + k % self.columns / n];
            *sum = (sum.0 + f64::from(d), sum.1 + 1);
        }
        let density = sums.into_iter().map(|(sum, count)| (sum / f64::from(count)) as f32).collect();
        Self { columns, rows, density, pixel: self.pixel.map(|v| v * n as f64), height: self.height }
    }

    /// The pixels that are seen in a box on the page, y up, or within half a pixel of it: columns and rows.
    pub(super) fn around(&self, lo: PlanePoint, hi: PlanePoint) -> [std::ops::Range<usize>; 2] {
        let range = |lo: f64, hi: f64, side: f64, count: usize| {
            let first = (lo / side - 1.0).floor().clamp(0.0, count as f64 - 1.0) as usize;
            let last = (hi / side).ceil().clamp(0.0, count as f64 - 1.0) as usize;
            first..last + 1
        };
        [
            range(lo[0], hi[0], self.pixel[0], self.columns),
            range(self.height - hi[1], self.height - lo[1], self.pixel[1], self.rows),
        ]
    }

    /// The least and the largest density in a box on the page and within half a pixel of it.
    pub(super) fn range(&self, lo: PlanePoint, hi: PlanePoint) -> [f64; 2] {
        let [columns, rows] = self.around(lo, hi);
        let mut found = [f32::MAX, f32::MIN];
        for j in rows {
            for &d in &self.density[j * self.columns..][columns.clone()] {
                found = [found[0].min(d), found[1].max(d)];
            }
        }
        found.map(f64::from)
    }

    /// Whether it has at most two densities: then its areas have the sides of its pixels.
    pub(super) fn is_two_tone(&self) -> bool {
        let mut found = Vec::new();
        for &d in &self.density {
            if !found.contains(&d) {
                found.push(d);
                if found.len() > 2 {
                    return false;
                }
            }
        }
        true
    }
}
