//! What a measured part's uncertainty takes of the depth, place by place.
//!
//! Consumes the part as it lies and how surely it lies there; promises for any box of the plane a bound of the standard
//! deviation of the part's height in it, nm. The deviation over a facet is a norm of what is linear in the place, so it
//! is largest in a corner: cells of a few millimetres hold the largest of what facets have in their corners, and no
//! place is underestimated. So it is with a correction: what it holds is linear on each of its triangles, each facet of a
//! corrected part lies in one, and what a part that lies aside changes of the height counts by as much as the points have
//! not seen of it. Facets that are too steep to be marked do not count.

use terrace_core::geom::{Box2, Correction, Grid, NM_PER_MM, Nm, P2};
use terrace_core::machine::Origin;
use terrace_core::math;
use terrace_input::surface::Surface;
use terrace_register::Uncertainty;

/// Side of a cell, nm; larger on parts with more than [`MOST_CELLS`] of them.
const CELL_NM: i64 = 2_000_000;

/// Most cells along x or y.
const MOST_CELLS: i64 = 1000;

/// What stops keep free for the height of a part that is not known exactly.
#[derive(Clone, Debug)]
pub struct HeightReserve {
    grid: Grid,
    /// By cell, nm.
    cells: Vec<f32>,
    keep: KeptFree,
}

/// How much is kept free.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KeptFree {
    /// Deviations.
    pub sigmas: f64,
    /// At most this much, nm.
    pub most: f64,
}

/// Where less is kept free than deviations ask for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Short {
    /// The share of the cells with a part, 0 to 1.
    pub share: f64,
    /// What the least sure of them asks for, nm.
    pub wanted: f64,
}

/// Why the height of a part is not known exactly.
#[derive(Clone, Copy, Debug)]
pub struct HeightDoubt<'a> {
    /// How surely it lies where it does.
    pub uncertainty: &'a Uncertainty,
    /// Its placement.
    pub origin: Origin,
    /// How it is warped: that holds what the pose is off by in height and tilt.
    pub correction: Option<&'a Correction>,
}

impl HeightReserve {
    /// The deviations over a part as it lies, of which some are kept free; `max_slope` is the tangent of the steepest
    /// slope that is marked.
    pub fn new(part: &Surface, doubt: &HeightDoubt<'_>, max_slope: f64, keep: KeptFree) -> Self {
        let box_mm = part.part_box_mm();
        let corner = |at: [f64; 2]| P2::new((at[0] * NM_PER_MM).floor() as i64, (at[1] * NM_PER_MM).floor() as i64);
        let (lo, hi): (P2, P2) = (corner(box_mm.lo), corner(box_mm.hi));
        let longest = (hi.x - lo.x).max(hi.y - lo.y).max(1);
        let side = CELL_NM.max(longest / MOST_CELLS + 1);
        let count = [hi.x - lo.x, hi.y - lo.y].map(|extent| (extent / side + 1) as u32);
        let grid = Grid { origin: P2::new(lo.x, lo.y), pitch: [Nm(side); 2], count };
        let mut reserve = Self { cells: vec![0.0; grid.len()], grid, keep };
        part.each_facet(&mut |facet| reserve.add(facet, doubt, max_slope));
        reserve
    }

    /// Adds a facet, corners in nm.
    fn add(&mut self, facet: [[f64; 3]; 3], doubt: &HeightDoubt<'_>, max_slope: f64) {
        let [a, b, c] = facet;
        let [u, v] = [b, c].map(|p| [0, 1, 2].map(|k| p[k] - a[k]));
        let det = u[0] * v[1] - u[1] * v[0];
        let slope = [(u[2] * v[1] - v[2] * u[1]) / det, (v[2] * u[0] - u[2] * v[0]) / det];
        // An upright facet has no finite slope.
        let is_marked = slope[0] * slope[0] + slope[1] * slope[1] <= max_slope * max_slope;
        if !is_marked {
            return;
        }
        let (mut lo, mut hi) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for p in facet {
            lo = [0, 1].map(|k| lo[k].min(p[k]));
            hi = [0, 1].map(|k| hi[k].max(p[k]));
        }
        let shift = doubt.origin.mm();
        let middle = [0, 1].map(|k| (facet[0][k] + facet[1][k] + facet[2][k]) / 3.0);
        let of_correction = doubt.correction.map(|correction| correction.linear(middle));
        let [columns, rows] = self.touched(lo, hi);
        for row in rows {
            for column in columns.clone() {
                // The corners of the cell, as far as the facet's box reaches.
                let ends = [(0, column), (1, row)].map(|(k, i)| {
                    let from = (if k == 0 { self.grid.origin.x } else { self.grid.origin.y }) as f64;
                    let side = self.grid.pitch[k].f64();
                    [from + i as f64 * side, from + (i + 1) as f64 * side].map(|v| v.clamp(lo[k], hi[k]))
                });
                let deviation = |x: f64, y: f64| {
                    let z = a[2] + slope[0] * (x - a[0]) + slope[1] * (y - a[1]);
                    let at = [0, 1, 2].map(|k| [x, y, z][k] / NM_PER_MM + shift[k]);
                    let Some(linear) = of_correction else { return doubt.uncertainty.height(at, slope) };
                    let [_, deviation, turn, aside @ ..] = linear.map(|l| l.of([x, y]));
                    let seen = [turn / NM_PER_MM, aside[0], aside[1]];
                    let row = doubt.uncertainty.aside_row(at, slope);
                    let unseen = [0, 1, 2].map(|k| row[k] - seen[k]);
                    math::hypot(deviation / NM_PER_MM, doubt.uncertainty.aside(unseen))
                };
                let [xs, ys] = ends;
                let most = xs.iter().flat_map(|&x| ys.map(|y| deviation(x, y))).fold(0.0, f64::max);
                let cell = &mut self.cells[row * self.grid.columns() + column];
                // Rounded up to what f32 holds.
                *cell = cell.max((most * NM_PER_MM * (1.0 + 1e-6)) as f32);
            }
        }
    }

    /// The columns and rows of cells that a box touches, clamped to the part.
    fn touched(&self, lo: [f64; 2], hi: [f64; 2]) -> [std::ops::RangeInclusive<usize>; 2] {
        [0, 1].map(|k| {
            let from = (if k == 0 { self.grid.origin.x } else { self.grid.origin.y }) as f64;
            let side = self.grid.pitch[k].f64();
            let last = self.grid.count[k] as usize - 1;
            let index = |v: f64| (((v - from) / side).floor().max(0.0) as usize).min(last);
            index(lo[k])..=index(hi[k])
        })
    }

    /// The largest deviation in a box, nm.
    pub fn deviation(&self, area: Box2) -> f64 {
        let [columns, rows] = self.touched([area.lo.x as f64, area.lo.y as f64], [area.hi.x as f64, area.hi.y as f64]);
        let cell = |row: usize, column: usize| self.cells[row * self.grid.columns() + column];
        let most = rows.flat_map(|row| columns.clone().map(move |column| (row, column)));
        f64::from(most.map(|(row, column)| cell(row, column)).fold(0.0, f32::max))
    }

    /// What is kept free above and below marks in a box, nm.
    pub fn kept(&self, area: Box2) -> f64 {
        self.wanted(area).min(self.keep.most)
    }

    /// What deviations ask for in a box, nm.
    fn wanted(&self, area: Box2) -> f64 {
        self.keep.sigmas * self.deviation(area)
    }

    /// Whether less is kept free in a box than deviations ask for.
    pub fn is_short(&self, area: Box2) -> bool {
        self.wanted(area) > self.keep.most
    }

    /// What of an area that is so of.
    pub fn short(&self, area: Box2) -> Option<Short> {
        let [columns, rows] = self.touched([area.lo.x as f64, area.lo.y as f64], [area.hi.x as f64, area.hi.y as f64]);
        let cells = rows.flat_map(|row| columns.clone().map(move |column| row * self.grid.columns() + column));
        let wanted: Vec<f64> =
            cells.map(|i| self.keep.sigmas * f64::from(self.cells[i])).filter(|wanted| *wanted > 0.0).collect();
        let short = wanted.iter().filter(|wanted| **wanted > self.keep.most).count();
        let most = wanted.iter().fold(0.0, |most: f64, w| most.max(*w));
        (short > 0).then(|| Short { share: short as f64 / wanted.len() as f64, wanted: most })
    }

    /// Side of a cell along x and y.
    pub fn cell(&self) -> [Nm; 2] {
        self.grid.pitch
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrace_core::random::Random;

    #[test]
    fn no_place_is_less_sure_than_its_cell_says() {
        let z = |x: f64, y: f64| 0.02 * x * x - 0.01 * x * y + 3.0;
        let node = |i: i32, k: i32| {
            let [x, y] = [i, k].map(|v| f64::from(v) * 7.0 - 35.0);
            [x, y, z(x, y)]
        };
        let cells = (0..10).flat_map(|i| (0..10).map(move |k| (i, k)));
        let facets = cells.flat_map(|(i, k)| {
            let [a, b, c, d] = [node(i, k), node(i + 1, k), node(i + 1, k + 1), node(i, k + 1)];
            [[a, b, c], [a, c, d]]
        });
        let all: Vec<[[f64; 3]; 3]> = facets.collect();
        let part = Surface::from_facets(all.clone(), &mut Vec::new()).expect("a surface");
        let diagonal = [1e-8, 4e-8, 2e-8, 1e-5, 2e-5, 3e-6];
        let covariance = [0, 1, 2, 3, 4, 5].map(|i| [0, 1, 2, 3, 4, 5].map(|k| if i == k { diagonal[i] } else { 0.0 }));
        let uncertainty = Uncertainty { centre: [100.0, -50.0, 20.0], covariance };
        let origin = Origin([90_000_000, -60_000_000, 1_000_000]);
        let doubt = HeightDoubt { uncertainty: &uncertainty, origin, correction: None };
        let reserve = HeightReserve::new(&part, &doubt, 10.0, KeptFree { sigmas: 1.0, most: f64::INFINITY });
        let mut random = Random::case(1);
        for _ in 0..2000 {
            let [a, b, c] = all[random.below(all.len())];
            let [u, v] = [random.unit(), random.unit()];
            let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
            let at = [0, 1, 2].map(|k| a[k] + u * (b[k] - a[k]) + v * (c[k] - a[k]));
            let (e, f) = ([0, 1, 2].map(|k| b[k] - a[k]), [0, 1, 2].map(|k| c[k] - a[k]));
            let det = e[0] * f[1] - e[1] * f[0];
            let slope = [(e[2] * f[1] - f[2] * e[1]) / det, (f[2] * e[0] - e[2] * f[0]) / det];
            let exact = uncertainty.height([0, 1, 2].map(|k| at[k] + origin.mm()[k]), slope) * NM_PER_MM;
            let p = P2::from_mm(at[0], at[1]).expect("near");
            let found = reserve.deviation(Box2 { lo: p, hi: p });
            assert!(found >= exact && found < 2.0 * exact, "{at:?}: {found} {exact}");
        }
    }
}
