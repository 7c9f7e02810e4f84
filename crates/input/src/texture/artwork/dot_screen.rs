//! Grey by dots: how many of the sites of a square grid are marked is the density of the picture.
//!
//! Sites lie (i + 1/2) pitch along and (k + 1/2) pitch across one direction, counted from the page's origin. The share
//! q of them that is marked around a point of density D is q = D (pitch / spot)², at most 1: the marked sites times the
//! square of the spot are then D times the area, and black is every site at a pitch of a spot.
//!
//! - *halftone*: cells of n x n sites, n = period / pitch. Site (i, k) of a cell is marked where q is above
//!   (rank + 1/2) / n², its rank by rising distance from full in cos 2πx + cos 2πy (x, y from 0 to 1 over the cell):
//!   round clusters grow from the middle of a cell, and at last leave round holes at its corners.
//! - *diffusion*: row by row, to and fro, a site is marked where q and the errors that it was handed are above 1/2; its
//!   own error goes to its neighbours (Floyd and Steinberg, An adaptive algorithm for spatial greyscale, 1976).
//! - *noise*: as halftone with a threshold mask of 64 x 64 sites that is blue noise (Ulichney, The void-and-cluster
//!   method for dither array generation, 1993), of the seed.

use std::collections::BTreeMap;
use terrace_core::math;

use super::hatch::TooFine;
use super::marking::{Marking, Screen};
use super::screen::{Grey, Picture, pale};
use crate::texture::clip::Polylines;
use crate::texture::random::Random;
use terrace_core::diag::Diag;
use terrace_core::geom::cos_sin;

/// Most sites that are looked at.
const MAX_SITES: f64 = 1e9;

/// Most dots of a picture.
const MAX_DOTS: usize = 20_000_000;

/// The period of halftone cells unless the job states it, in pitches.
const PERIOD: f64 = 10.0;

/// Most sites along a side of a halftone cell.
const MAX_SIDE: f64 = 256.0;

/// Sites along a side of the mask of blue noise.
const NOISE_SIDE: usize = 64;

/// Dots that reproduce grey.
pub(super) struct DotScreen {
    pitch_mm: f64,
    spot_mm: f64,
    direction: [f64; 2],
    /// None where errors are diffused.
    mask: Option<ThresholdMask>,
    is_halftone: bool,
}

/// Thresholds that repeat over the sites.
struct ThresholdMask {
    /// Row by row.
    thresholds: Vec<f64>,
    /// How many sites it has along a side.
    side: usize,
}

impl ThresholdMask {
    /// The threshold of a site.
    fn at(&self, site: [i64; 2]) -> f64 {
        let [column, row] = site.map(|v| v.rem_euclid(self.side as i64) as usize);
        self.thresholds[row * self.side + column]
    }
}

impl DotScreen {
    pub(super) fn new(marking: &Marking, spot_mm: f64, page_rad: f64) -> Self {
        let pitch_mm = marking.pitch_mm.unwrap_or(spot_mm);
        let tone = marking.tone.unwrap_or_default();
        let mask = match tone.screen {
            Screen::Noise => Some(ThresholdMask { thresholds: blue_noise(tone.seed), side: NOISE_SIDE }),
            Screen::Halftone => {
                let side = tone.period_mm.map_or(PERIOD, |period| (period / pitch_mm).round()).clamp(1.0, MAX_SIDE);
                Some(ThresholdMask { thresholds: clusters(side as usize), side: side as usize })
            }
            _ => None,
        };
        Self {
            pitch_mm,
            spot_mm,
            direction: cos_sin(marking.direction_rad - page_rad),
            mask,
            is_halftone: tone.screen == Screen::Halftone,
        }
    }

    /// Appends the dots of a picture on a page, each as a line of one point; returns what is said where the cells
    /// of a halftone beat with the picture.
    pub(super) fn mark(&self, grey: &Grey, size: [f64; 2], out: &mut Polylines) -> Result<Option<Diag>, TooFine> {
        let [along, across] = self.site_ranges(size);
        let count = [along, across].map(|[lo, hi]| (hi - lo + 1.0).max(0.0));
        if count[0] * count[1] > MAX_SITES {
            return Err(TooFine);
        }
        let picture = Picture::new(grey, size);
        // The share of the sites to be marked for a density of 1: a dot covers the square of a spot.
        let gain = (self.pitch_mm / self.spot_mm).powi(2);
        let first = along[0] as i64;
        let columns = count[0] as usize;
        // One more place on either side for the errors that sites at the ends of a row hand on.
        let mut errors = [vec![0.0; columns + 2], vec![0.0; columns + 2]];
        let mut tones = self.is_halftone.then(|| HalftoneTones::new(self.mask.as_ref().map_or(1, |mask| mask.side)));
        for (row, k) in (across[0] as i64..=across[1] as i64).enumerate() {
            let heading = if row % 2 == 1 { RowHeading::Back } else { RowHeading::Forth };
            for n in 0..columns {
                let n = if heading == RowHeading::Back { columns - 1 - n } else { n };
                let i = first + n as i64;
                let p = self.place(i, k);
                if !(0..2).all(|a| (0.0..=size[a]).contains(&p[a])) {
                    continue;
                }
                let q = (picture.at(p) * gain).min(1.0);
                let is_marked = match &self.mask {
                    Some(mask) => q > mask.at([i, k]),
                    None => diffuse(q, n, heading, &mut errors),
                };
                if is_marked {
                    out.push(&[p]);
                }
                if let Some(tones) = &mut tones {
                    tones.add([i, k], q, is_marked);
                }
            }
            errors.swap(0, 1);
            errors[1].fill(0.0);
            if out.len() > MAX_DOTS {
                return Err(TooFine);
            }
        }
        Ok(tones.and_then(|tones| tones.beat(self.pitch_mm)))
    }

    /// The first and the last site along and across that can lie on a page.
    fn site_ranges(&self, size: [f64; 2]) -> [[f64; 2]; 2] {
        let [c, s] = self.direction;
        let corners = [[0.0, 0.0], [size[0], 0.0], [0.0, size[1]], size];
        let along = corners.map(|[x, y]| (c * x + s * y) / self.pitch_mm - 0.5);
        let across = corners.map(|[x, y]| (c * y - s * x) / self.pitch_mm - 0.5);
        [along, across].map(|all| {
            [all.into_iter().fold(f64::MAX, f64::min).ceil(), all.into_iter().fold(f64::MIN, f64::max).floor()]
        })
    }

    /// The place of site (i, k) on the page.
    fn place(&self, i: i64, k: i64) -> [f64; 2] {
        let [c, s] = self.direction;
        let [u, v] = [i, k].map(|n| (n as f64 + 0.5) * self.pitch_mm);
        [c * u - s * v, s * u + c * v]
    }

    /// What is said where the sites lie too far apart for the dark parts of a picture.
    pub(super) fn pale(&self, grey: &Grey) -> Option<Diag> {
        pale(grey, (self.spot_mm / self.pitch_mm).powi(2), self.pitch_mm, self.spot_mm, "dots")
    }
}

/// Cells along a side of a window in which the dots of a halftone are compared with the picture.
const WINDOW_CELLS: i64 = 4;

/// How far the dots of a window may miss the picture's tone: half a dot of a cell, as a cell has whole dots, and a
/// share.
const MAX_CELL_OFF: f64 = 0.5;
const MAX_SHARE_OFF: f64 = 0.1;

/// The share of the tone in windows that miss it from which on a warning says so.
const BEAT_SHARE: f64 = 0.25;

/// Dots of a halftone, and those that the picture asks for, window by window. Where the picture has a raster of its
/// own, dark places fall on high thresholds here and on low ones there (moire).
struct HalftoneTones {
    /// Sites along a side of a cell.
    side: usize,
    windows: BTreeMap<[i64; 2], ToneWindow>,
}

/// The dots of a window, and those that the picture asks for.
#[derive(Clone, Copy, Debug, Default)]
struct ToneWindow {
    sites: usize,
    wanted: f64,
    dots: usize,
}

impl HalftoneTones {
    fn new(side: usize) -> Self {
        Self { side, windows: BTreeMap::new() }
    }

    fn add(&mut self, site: [i64; 2], share: f64, is_marked: bool) {
        let window = self.windows.entry(site.map(|v| v.div_euclid(WINDOW_CELLS * self.side as i64))).or_default();
        window.sites += 1;
        window.wanted += share;
        window.dots += usize::from(is_marked);
    }

    /// What is said where windows with much of the tone miss it.
    fn beat(&self, pitch_mm: f64) -> Option<Diag> {
        let is_off = |tone: &&ToneWindow| {
            let cells = tone.sites as f64 / (self.side * self.side) as f64;
            (tone.dots as f64 - tone.wanted).abs() > MAX_CELL_OFF * cells.max(1.0) + MAX_SHARE_OFF * tone.wanted
        };
        let wanted_in_all: f64 = self.windows.values().map(|tone| tone.wanted).sum();
        let windows_off = || self.windows.values().filter(is_off);
        let wanted = windows_off().map(|tone| tone.wanted).sum::<f64>();
        let dots = windows_off().map(|tone| tone.dots).sum::<usize>();
        (wanted > BEAT_SHARE * wanted_in_all).then(|| {
            let text = format!(
                "halftone cells of {:.3} mm beat with the raster of the picture (moire): where they do, {dots} dots are marked for a tone of {wanted:.0}",
                self.side as f64 * pitch_mm
            );
            Diag::warning("bitmap-moire", text).hint("use screen = \"diffusion\", or a picture that is not screened")
        })
    }
}

/// In which direction the sites of a row are decided.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum RowHeading {
    Forth,
    Back,
}

/// Whether site `n` of a row is marked; hands its error on. `errors` are those of this row and the next, each one place
/// further.
fn diffuse(q: f64, n: usize, heading: RowHeading, errors: &mut [Vec<f64>; 2]) -> bool {
    let wanted = q + errors[0][n + 1];
    let is_marked = wanted > 0.5;
    let error = wanted - f64::from(u8::from(is_marked));
    // The site n has place n + 1 in both rows.
    let (next, last) = match heading {
        RowHeading::Forth => (n + 2, n),
        RowHeading::Back => (n, n + 2),
    };
    // The weights of Floyd and Steinberg.
    errors[0][next] += error * 7.0 / 16.0;
    errors[1][last] += error * 3.0 / 16.0;
    errors[1][n + 1] += error * 5.0 / 16.0;
    errors[1][next] += error / 16.0;
    is_marked
}

/// The thresholds of a halftone cell.
fn clusters(side: usize) -> Vec<f64> {
    let wave = |v: usize| math::cos(std::f64::consts::TAU * (v as f64 + 0.5) / side as f64);
    // -cos - cos is highest in the middle of the cell.
    let height = |i: usize| -wave(i % side) - wave(i / side);
    let mut order: Vec<usize> = (0..side * side).collect();
    order.sort_by(|&a, &b| {
        // Equal but for noise: by place.
        let a_height = (height(a) * 1e9).round();
        let b_height = (height(b) * 1e9).round();
        b_height.total_cmp(&a_height).then(a.cmp(&b))
    });
    thresholds(&order)
}

/// The threshold of every site, from the sites in the order in which they are marked.
fn thresholds(order: &[usize]) -> Vec<f64> {
    let mut mask = vec![0.0; order.len()];
    for (rank, &site) in order.iter().enumerate() {
        mask[site] = (rank as f64 + 0.5) / order.len() as f64;
    }
    mask
}

/// The thresholds of a mask of blue noise, which repeats without a seam.
fn blue_noise(seed: u64) -> Vec<f64> {
    /// Share of the sites that the first pattern has.
    const PROTOTYPE: usize = NOISE_SIDE * NOISE_SIDE / 10;
    let mut random = Random::at(seed, 0, 0);
    let mut field = NoiseField::new();
    while field.count < PROTOTYPE {
        let site = random.below(NOISE_SIDE * NOISE_SIDE);
        if !field.is_set[site] {
            field.toggle(site);
        }
    }
    // The tightest cluster is moved into the largest void until it is that void.
    loop {
        let cluster = field.tightest();
        field.toggle(cluster);
        let void = field.widest();
        field.toggle(void);
        if void == cluster {
            break;
        }
    }
    let mut order = vec![0; NOISE_SIDE * NOISE_SIDE];
    let mut thinned = field.clone();
    for rank in (0..PROTOTYPE).rev() {
        let cluster = thinned.tightest();
        thinned.toggle(cluster);
        order[rank] = cluster;
    }
    for slot in &mut order[PROTOTYPE..] {
        let void = field.widest();
        field.toggle(void);
        *slot = void;
    }
    thresholds(&order)
}

/// A pattern of sites and how crowded each site is.
#[derive(Clone)]
struct NoiseField {
    is_set: Vec<bool>,
    crowd: Vec<f64>,
    count: usize,
    /// The weight of a neighbour that many columns or rows away.
    weight: [f64; Self::REACH + 1],
}

impl NoiseField {
    /// Sites farther away along x or y are left out: their weight is below 1e-6.
    const REACH: usize = 7;
    /// Standard deviation of the Gaussian that weighs neighbours, sites; that of Ulichney.
    const SIGMA: f64 = 1.5;

    fn new() -> Self {
        let sites = NOISE_SIDE * NOISE_SIDE;
        let weight = std::array::from_fn(|d| math::exp(-((d * d) as f64) / (2.0 * Self::SIGMA * Self::SIGMA)));
        Self { is_set: vec![false; sites], crowd: vec![0.0; sites], count: 0, weight }
    }

    /// Sets a site, or takes it out.
    fn toggle(&mut self, site: usize) {
        self.is_set[site] ^= true;
        let sign = if self.is_set[site] { 1.0 } else { -1.0 };
        self.count = if self.is_set[site] { self.count + 1 } else { self.count - 1 };
        let column = site % NOISE_SIDE;
        let row = site / NOISE_SIDE;
        for dy in 0..=2 * Self::REACH {
            let y = (row + NOISE_SIDE + dy - Self::REACH) % NOISE_SIDE;
            let row_weight = self.weight[dy.abs_diff(Self::REACH)];
            for dx in 0..=2 * Self::REACH {
                let x = (column + NOISE_SIDE + dx - Self::REACH) % NOISE_SIDE;
                self.crowd[y * NOISE_SIDE + x] += sign * row_weight * self.weight[dx.abs_diff(Self::REACH)];
            }
        }
    }

    /// The set site that is most crowded.
    fn tightest(&self) -> usize {
        let set = (0..self.crowd.len()).filter(|&i| self.is_set[i]);
        set.max_by(|&a, &b| self.crowd[a].total_cmp(&self.crowd[b]).then(b.cmp(&a))).unwrap_or(0)
    }

    /// The free site that is least crowded.
    fn widest(&self) -> usize {
        let free = (0..self.crowd.len()).filter(|&i| !self.is_set[i]);
        free.min_by(|&a, &b| self.crowd[a].total_cmp(&self.crowd[b]).then(a.cmp(&b))).unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::texture::artwork::Tone;

    /// Sites that are marked of a picture of one density, of all.
    fn marked(density: f64, screen: Screen, direction_rad: f64, seed: u64) -> f64 {
        let tone = Tone { screen, seed, ..Tone::default() };
        let marking = Marking { tone: Some(tone), pitch_mm: Some(0.02), direction_rad, ..Marking::default() };
        let grey = Grey::new(4, 4, vec![(density * 65535.0).round() as u16; 16]);
        let mut out = Polylines::default();
        let size = [6.4, 5.12];
        DotScreen::new(&marking, 0.02, 0.0).mark(&grey, size, &mut out).map_err(|_| "fine").expect("dots");
        assert!(out.iter().all(|dot| dot.len() == 1 && (0..2).all(|k| (0.0..=size[k]).contains(&dot[0][k]))));
        out.len() as f64 * 0.02 * 0.02 / (size[0] * size[1])
    }

    #[test]
    #[ignore = "slow: make test-all"]
    fn coverage_is_the_density_in_sixteen_steps() {
        for screen in [Screen::Halftone, Screen::Diffusion, Screen::Noise] {
            for step in 0..=15 {
                let density = f64::from(step) / 15.0;
                for direction in [0.0, 0.4] {
                    let found = marked(density, screen, direction, 1);
                    assert!((found - density).abs() <= 0.01, "{screen:?} {direction}: {found} for {density}");
                }
            }
        }
    }

    #[test]
    fn masks_have_every_threshold_once() {
        for mask in [clusters(10), clusters(1), clusters(7), blue_noise(3)] {
            let mut sorted = mask.clone();
            sorted.sort_by(f64::total_cmp);
            let n = mask.len() as f64;
            assert!(sorted.iter().enumerate().all(|(k, t)| (t - (k as f64 + 0.5) / n).abs() < 1e-12));
        }
        assert_ne!(blue_noise(1), blue_noise(2));
        assert_eq!(blue_noise(1), blue_noise(1));
    }

    #[test]
    fn a_halftone_cluster_grows_from_the_middle() {
        let mask = clusters(8);
        let lowest = (0..64).min_by(|&a, &b| mask[a].total_cmp(&mask[b])).expect("sites");
        assert!([27, 28, 35, 36].contains(&lowest), "{lowest}");
        let highest = (0..64).max_by(|&a, &b| mask[a].total_cmp(&mask[b])).expect("sites");
        assert!([0, 7, 56, 63].contains(&highest), "{highest}");
    }

    #[test]
    fn blue_noise_has_no_near_pairs_where_it_is_pale() {
        // Of a tenth of the sites, thrown at random, a third would have a neighbour.
        let mask = blue_noise(5);
        let is_set = |x: usize, y: usize| mask[y % NOISE_SIDE * NOISE_SIDE + x % NOISE_SIDE] < 0.1;
        let pairs = (0..NOISE_SIDE * NOISE_SIDE).filter(|i| {
            let (x, y) = (i % NOISE_SIDE, i / NOISE_SIDE);
            is_set(x, y) && (is_set(x + 1, y) || is_set(x, y + 1) || is_set(x + 1, y + 1))
        });
        assert_eq!(pairs.count(), 0);
    }
}
