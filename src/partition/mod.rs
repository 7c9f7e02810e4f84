//! Where the stage stands: in every section the levels that the texture needs.
//!
//! A method chooses, for every section, the lower ends of its levels; each level accepts the depth
//! range D above its lower end. That is the whole interface: methods differ in nothing else. Levels lie
//! on the lattice of the stage increment and D is a whole even number of increments, so that the
//! middle of every level is a place where the stage can stand.

mod contour;
pub mod items;
pub mod window;
mod zrange;

use crate::geom::P2;
use crate::program::{Sections, Stop};
use crate::trace::Footprint;

/// Methods that divide a grid of sections.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// Evenly spaced levels of the whole part (the PPGS article, step 3).
    Contour,
    /// In each section the fewest levels that cover the texture's heights.
    ZRange,
}

/// The lattice on which focal planes lie.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lattice {
    /// Depth range of a level, nm; a whole even number of steps.
    pub depth: i64,
    /// Stage increment along z, nm.
    pub step: i64,
    /// Part heights z with (z + offset) a multiple of the step lie on the lattice.
    pub offset: i64,
}

impl Lattice {
    /// `depth` is rounded down to the lattice; None where nothing is left of it.
    pub fn new(depth: i64, step: i64, offset: i64) -> Option<Self> {
        let depth = depth / (2 * step) * (2 * step);
        (depth > 0).then_some(Self { depth, step, offset })
    }
    /// The highest lattice point not above `z`.
    pub fn floor(&self, z: f64) -> i64 {
        let z = z.floor() as i64;
        z - (z + self.offset).rem_euclid(self.step)
    }
}

/// Stops by section.
#[derive(Clone, Debug)]
pub struct Stops {
    /// All stops, section by section, upwards in each.
    pub stops: Vec<Stop>,
    /// First stop of every section, and the number of stops.
    starts: Vec<u32>,
}

impl Stops {
    /// The stops of section `i`, as indices.
    pub fn of_section(&self, i: u32) -> std::ops::Range<usize> {
        self.starts[i as usize] as usize..self.starts[i as usize + 1] as usize
    }

    /// The stop of section `i` that accepts height `z`: half-open upwards, the topmost closed.
    pub fn at(&self, i: u32, z: f64) -> Option<usize> {
        let range = self.of_section(i);
        let above = self.stops[range.clone()].partition_point(|s| s.z_lo as f64 <= z);
        (!range.is_empty()).then(|| range.start + above.saturating_sub(1))
    }
}

/// Chooses the stops for a footprint.
pub fn divide(method: Method, footprint: &Footprint, sections: &Sections, lattice: &Lattice) -> Stops {
    let lowest = footprint.range().map_or(0.0, |r| r.0);
    let z0 = lattice.floor(lowest);
    let mut stops = Vec::new();
    let mut starts = vec![0];
    for i in 0..sections.len() {
        let heights = footprint.of_section(i);
        let centre: P2 = sections.centre(i);
        let levels = match method {
            Method::Contour => contour::levels(heights, z0, lattice),
            Method::ZRange => zrange::levels(heights, lattice),
        };
        stops.extend(levels.into_iter().map(|(level, z_lo)| Stop {
            section: sections.cell(i),
            level,
            centre,
            focus: z_lo + lattice.depth / 2,
            z_lo,
            z_hi: z_lo + lattice.depth,
        }));
        starts.push(stops.len() as u32);
    }
    Stops { stops, starts }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LATTICE: Lattice = Lattice { depth: 70_000, step: 100, offset: 0 };

    #[test]
    fn contour_takes_every_level_that_is_touched() {
        let l = |h: &[(f64, f64)]| contour::levels(h, 0, &LATTICE);
        assert_eq!(l(&[(0.0, 70_000.0)]), [(0, 0)], "the topmost level is closed");
        assert_eq!(l(&[(69_999.0, 70_001.0)]), [(0, 0), (1, 70_000)]);
        assert_eq!(l(&[(0.0, 10.0), (200_000.0, 280_001.0)]), [(0, 0), (2, 140_000), (3, 210_000), (4, 280_000)]);
    }

    #[test]
    fn z_range_takes_the_fewest() {
        let count = |h: &[(f64, f64)]| zrange::levels(h, &LATTICE).len();
        assert_eq!(count(&[(35_000.0, 104_900.0)]), 1);
        assert_eq!(count(&[(35_000.0, 105_100.0)]), 2);
        assert_eq!(count(&[(0.0, 10_000.0), (500_000.0, 540_000.0)]), 2, "no level where nothing is");
        assert_eq!(count(&[(0.0, 10_000.0), (60_000.0, 69_000.0)]), 1);
    }

    #[test]
    fn depth_shrinks_to_the_lattice_and_never_grows() {
        assert_eq!(Lattice::new(70_000, 100, 0).map(|l| l.depth), Some(70_000));
        assert_eq!(Lattice::new(70_500, 1000, 0).map(|l| l.depth), Some(70_000));
        assert_eq!(Lattice::new(1_500, 1000, 0), None);
    }
}
