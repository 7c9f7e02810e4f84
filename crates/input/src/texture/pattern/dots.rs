//! Dots on a lattice, each moved a little at random, and dots at random that keep a distance.
//!
//! On a lattice the sites are the centres of cells of `loops`: one dot for each. With a jitter j the dot (row, column)
//! lies at its site + r (cos a, sin a), r = j pitch / 2 √u, a = 2 π v, with u and v uniform from 0 to 1, of the seed,
//! the row and the column: uniform over a disc within its tile.
//!
//! Poisson-disc dots are those of Bridson (Fast Poisson disk sampling in arbitrary dimensions, 2007), but from the
//! newest dot on, not from a random one: around it up to 30 places between one and two distances away are tried, and
//! the first is taken where no dot is nearer than the distance. They are found once and held, 16 bytes each.

use std::collections::BTreeSet;
use std::f64::consts::TAU;
use terrace_core::math;

use schemars::JsonSchema;
use serde::Deserialize;

use super::loops::Loops;
use super::{Fault, Keys, Lattice, bad_pitch};
use crate::texture::kind::{Kind, Shape};
use crate::texture::place::{NM, Turn};
use crate::texture::random::Random;
use crate::texture::{Figure, MAX_STROKES, too_large};
use terrace_core::diag::{Diag, Error, memory};
use terrace_core::geom::{Box2, BoxMm, P2};
use terrace_core::program::PenId;
use terrace_core::units::{Length, Share, positive};

/// Dots on a lattice.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
pub(crate) struct DotsKeys {
    /// Distance between sites.
    #[schemars(example = &"0.5 mm")]
    #[serde(deserialize_with = "positive")]
    pub pitch: Length,
    /// How the sites lie.
    #[serde(default)]
    pub lattice: Lattice,
    /// How far a dot may lie from its site, in percent of half a pitch.
    #[schemars(example = &"50 %", extend("x-value" = "0 % to 100 %", "x-default" = "\"0 %\""))]
    #[serde(default)]
    pub jitter: Option<Share>,
}

impl DotsKeys {
    /// Whether its dots lie at random places.
    pub(crate) fn is_random(&self) -> bool {
        self.jitter.is_some_and(|jitter| jitter.as_percent() > 0.0)
    }
}

impl Keys for DotsKeys {
    fn kind(&self, seed: u64) -> Kind {
        let jitter = self.jitter.map_or(0.0, |jitter| jitter.as_percent() / 100.0);
        Kind::Dots { pitch_mm: self.pitch.as_mm(), lattice: self.lattice, jitter, seed }
    }

    fn faults(&self) -> Vec<Fault> {
        let beyond = self.jitter.filter(|j| !(0.0..=100.0).contains(&j.as_percent()));
        let fault = |jitter| Diag::input("texture-key", format!("jitter {jitter} is not between 0 % and 100 %"));
        beyond.map(|jitter| ("jitter", fault(jitter))).into_iter().collect()
    }
}

/// Dots at random that keep a distance.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
pub(crate) struct PoissonKeys {
    /// Least distance between dots.
    #[schemars(example = &"0.5 mm")]
    #[serde(deserialize_with = "positive")]
    pub pitch: Length,
}

impl Keys for PoissonKeys {
    fn kind(&self, seed: u64) -> Kind {
        Kind::Poisson { pitch_mm: self.pitch.as_mm(), seed }
    }
}

/// How often a place is tried around each dot: as Bridson has it.
const TRIES: u32 = 30;

/// Most cells of the grid that finds near dots.
const MAX_CELLS: f64 = 1e8;

/// The least distance of dots.
const LEAST_PITCH: f64 = 10.0 * NM;

#[derive(Debug)]
pub(in crate::texture) struct Dots {
    sites: Loops,
    /// Largest distance of a dot from its site, mm.
    jitter: f64,
    seed: u64,
    turn: Turn,
}

impl Dots {
    /// Dots on a lattice in an area; `jitter` from 0 to 1.
    ///
    /// # Errors
    /// `texture-pitch`, `texture-large`.
    pub(in crate::texture) fn new(
        area: BoxMm<2>,
        pitch: f64,
        lattice: Lattice,
        jitter: f64,
        seed: u64,
        turn: Turn,
    ) -> Result<Self, Error> {
        if !(pitch >= LEAST_PITCH && pitch.is_finite()) {
            return Err(bad_pitch("dot", pitch, LEAST_PITCH));
        }
        let sites = Loops::new(Shape::Dot, 0.0, pitch, lattice, area, NM, turn)?;
        Ok(Self { sites, jitter: jitter * pitch / 2.0, seed, turn })
    }
}

impl Figure for Dots {
    fn len(&self) -> u64 {
        self.sites.len()
    }

    fn points(&self) -> u64 {
        self.sites.len()
    }

    fn bounds(&self) -> Box2 {
        let Box2 { lo, hi, .. } = self.sites.bounds();
        let by = (self.jitter / NM).ceil() as i64;
        let mut bounds = Box2::EMPTY;
        if lo.x <= hi.x {
            bounds.add(P2::new(lo.x - by, lo.y - by));
            bounds.add(P2::new(hi.x + by, hi.y + by));
        }
        bounds
    }

    fn stroke(&self, i: u64, out: &mut Vec<P2>) {
        let (row, column) = self.sites.cell(i);
        let [x, y] = self.sites.centre(row, column);
        let [dx, dy] = if self.jitter > 0.0 {
            let mut random = Random::at(self.seed, row, column);
            let r = self.jitter * random.unit().sqrt();
            let a = TAU * random.unit();
            [r * math::cos(a), r * math::sin(a)]
        } else {
            [0.0; 2]
        };
        out.push(self.turn.nm([x + dx, y + dy]));
    }

    fn element(&self, i: u64) -> String {
        let (row, column) = self.sites.cell(i);
        format!("dot in row {}, column {}", row + 1, column + 1)
    }

    fn dot_pens(&self, own: PenId) -> BTreeSet<PenId> {
        BTreeSet::from([own])
    }
}

/// Poisson-disc dots.
#[derive(Debug)]
pub(in crate::texture) struct Scattered {
    dots: Vec<P2>,
    bounds: Box2,
}

impl Scattered {
    /// Dots in an area, no two nearer to each other than `distance`.
    ///
    /// # Errors
    /// `texture-pitch`, `texture-large`, `memory`.
    pub(in crate::texture) fn new(area: BoxMm<2>, distance: f64, seed: u64, turn: Turn) -> Result<Self, Error> {
        if !(distance >= LEAST_PITCH && distance.is_finite()) {
            return Err(bad_pitch("dot", distance, LEAST_PITCH));
        }
        // Rounding moves each of two dots by up to 0.71 nm.
        let places = poisson(area, distance + 2.0 * NM, &mut Random::at(seed, 0, 0))?;
        let dots: Vec<P2> = places.into_iter().map(|p| turn.nm(p)).collect();
        let mut bounds = Box2::EMPTY;
        dots.iter().for_each(|&p| bounds.add(p));
        Ok(Self { dots, bounds })
    }
}

impl Figure for Scattered {
    fn len(&self) -> u64 {
        self.dots.len() as u64
    }

    fn points(&self) -> u64 {
        self.dots.len() as u64
    }

    fn bounds(&self) -> Box2 {
        self.bounds
    }

    fn stroke(&self, i: u64, out: &mut Vec<P2>) {
        out.push(self.dots[i as usize]);
    }

    fn element(&self, i: u64) -> String {
        format!("dot {}", i + 1)
    }

    fn dot_pens(&self, own: PenId) -> BTreeSet<PenId> {
        BTreeSet::from([own])
    }
}

/// Points of an area that are all at least `distance` apart.
fn poisson(area: BoxMm<2>, distance: f64, random: &mut Random) -> Result<Vec<[f64; 2]>, Diag> {
    let mut grid = DotGrid::new(area, distance)?;
    let BoxMm { lo, hi } = area;
    let first = [0, 1].map(|k| lo[k] + random.unit() * (hi[k] - lo[k]));
    grid.put(first);
    let mut points = vec![first];
    // The newest first: its neighbours are still in the cache.
    let mut active = vec![first];
    while let Some(&[x, y]) = active.last() {
        let free_place = (0..TRIES).find_map(|_| {
            let [dx, dy] = in_ring(random);
            let p = [x + distance * dx, y + distance * dy];
            let is_inside = (0..2).all(|k| lo[k] <= p[k] && p[k] <= hi[k]);
            (is_inside && grid.is_free(p)).then_some(p)
        });
        match free_place {
            Some(p) => {
                grid.put(p);
                points.push(p);
                active.push(p);
            }
            None => _ = active.pop(),
        }
    }
    Ok(points)
}

/// A place between 1 and 2 from the origin, uniform over this ring.
fn in_ring(random: &mut Random) -> [f64; 2] {
    loop {
        let [x, y] = [0, 1].map(|_| 4.0 * random.unit() - 2.0);
        if (1.0..=4.0).contains(&(x * x + y * y)) {
            return [x, y];
        }
    }
}

/// Points by their cells, whose diagonal is the least distance of points: each holds one at most.
struct DotGrid {
    lo: [f64; 2],
    distance: f64,
    side: f64,
    columns: usize,
    /// Row by row, with two more cells on every side; infinite where there is no point.
    cells: Vec<[f64; 2]>,
    /// From a cell to those that can hold a point nearer than the distance, the nearest first.
    near: [isize; 20],
}

/// Columns and rows from a cell to those of [`DotGrid::near`], in one quadrant.
const NEAR: [[isize; 2]; 5] = [[1, 0], [1, 1], [2, 0], [2, 1], [1, 2]];

impl DotGrid {
    fn new(area: BoxMm<2>, distance: f64) -> Result<Self, Diag> {
        let side = distance / 2f64.sqrt();
        let size = area.size();
        let count = size.map(|length| (length / side).floor() + 5.0);
        if count[0] * count[1] > MAX_CELLS {
            let dots = (0.7 * size[0] * size[1] / (distance * distance)) as u64;
            return Err(too_large(dots.max(MAX_STROKES), dots));
        }
        let [columns, rows] = count.map(|n| n as usize);
        memory::ask("the grid of the dots", (columns * rows * 32) as u64)?;
        // By quarter turns from one quadrant to all.
        let quarters = NEAR.into_iter().flat_map(|[i, j]| [[i, j], [-j, i], [-i, -j], [j, -i]]);
        let mut near = [0; 20];
        near.iter_mut().zip(quarters).for_each(|(to, [i, j])| *to = j * columns as isize + i);
        Ok(Self { lo: area.lo, distance, side, columns, cells: vec![[f64::INFINITY; 2]; columns * rows], near })
    }

    fn cell(&self, p: [f64; 2]) -> usize {
        let [i, j] = [0, 1].map(|k| ((p[k] - self.lo[k]) / self.side) as usize + 2);
        j * self.columns + i
    }

    fn put(&mut self, p: [f64; 2]) {
        let cell = self.cell(p);
        self.cells[cell] = p;
    }

    /// Whether no point is nearer to `p` than the distance.
    fn is_free(&self, p: [f64; 2]) -> bool {
        let cell = self.cell(p);
        self.cells[cell][0].is_infinite()
            && self.near.iter().all(|&by| {
                let q = self.cells[cell.wrapping_add_signed(by)];
                let [dx, dy] = [p[0] - q[0], p[1] - q[1]];
                dx * dx + dy * dy >= self.distance * self.distance
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dots(figure: &dyn Figure) -> Vec<P2> {
        let mut out = Vec::new();
        (0..figure.len()).for_each(|i| figure.stroke(i, &mut out));
        assert_eq!(out.len() as u64, figure.len(), "one point each");
        assert!(out.iter().all(|&p| figure.bounds().holds(p)));
        out
    }

    const AREA: BoxMm<2> = BoxMm::rectangle(-3.0, 1.0, 7.0, 9.0);

    #[test]
    fn dots_lie_on_their_lattice() {
        let turn = Turn::new(0.0);
        let square = dots(&Dots::new(AREA, 0.5, Lattice::Square, 0.0, 0, turn).expect("dots"));
        assert_eq!(square.len(), 20 * 16);
        assert!(square.iter().all(|p| (p.x - 250_000) % 500_000 == 0 && (p.y - 250_000) % 500_000 == 0));
        let hex = dots(&Dots::new(AREA, 0.5, Lattice::Hex, 0.0, 0, turn).expect("dots"));
        let nearest = |p: &P2| hex.iter().filter(|q| q != &p).map(|q| p.distance(*q)).fold(f64::INFINITY, f64::min);
        assert!(hex.iter().all(|p| (nearest(p) - 500_000.0).abs() < 2.0));
    }

    #[test]
    fn jitter_stays_within_its_disc_and_follows_from_the_seed() {
        let turn = Turn::new(0.3);
        let of = |jitter: f64, seed: u64| dots(&Dots::new(AREA, 0.5, Lattice::Hex, jitter, seed, turn).expect("dots"));
        let (sites, moved) = (of(0.0, 1), of(0.6, 1));
        let away: Vec<f64> = sites.iter().zip(&moved).map(|(a, b)| a.distance(*b)).collect();
        let most = away.iter().copied().fold(0.0, f64::max);
        assert!((140_000.0..150_002.0).contains(&most), "{most}");
        // The mean distance from the middle of a disc is two thirds of its radius.
        let mean = away.iter().sum::<f64>() / away.len() as f64;
        assert!((mean - 100_000.0).abs() < 5_000.0, "{mean}");
        assert_eq!(moved, of(0.6, 1));
        assert_ne!(moved, of(0.6, 2));
    }

    #[test]
    fn poisson_dots_keep_their_distance_and_leave_no_room_for_another() {
        for seed in 0..20 {
            let turn = Turn::new(seed as f64);
            let found = dots(&Scattered::new(AREA, 0.2, seed, turn).expect("dots"));
            let nearest = |p: P2, but: usize| {
                let others = found.iter().enumerate().filter(|(k, _)| *k != but);
                others.map(|(_, q)| p.distance(*q)).fold(f64::INFINITY, f64::min)
            };
            let least = (0..found.len()).map(|k| nearest(found[k], k)).fold(f64::INFINITY, f64::min);
            assert!(least >= 200_000.0, "seed {seed}: {least}");
            // Random places are hardly ever farther from all dots than the distance.
            let mut random = Random::at(seed, 1, 1);
            let places = (0..500).map(|_| [-3.0 + 10.0 * random.unit(), 1.0 + 8.0 * random.unit()]);
            let free = places.filter(|&p| nearest(turn.nm(p), usize::MAX) > 200_000.0).count();
            assert!(free <= 5, "seed {seed}: {free} of 500");
        }
    }
}
