//! Fixtures in the frame of the part as it lies: what the head keeps clear of, and beams must not meet.
//!
//! Consumes the fixtures of a job, in mm of their own frames; promises facets, nm, turned part frame, moved with the
//! part where it was measured, and boxes over them for the search of lifts.

use crate::measured::Lying;
use terrace_core::diag::{Diag, Error};
use terrace_core::geom::{Box2, NM_PER_MM, Nm, P2, SpacePoint, cos_sin};
use terrace_core::machine::{Machine, Origin};
use terrace_core::program::SetupId;
use terrace_input::fixture;
use terrace_input::job::{FixtureFrame, FixtureInput, Job};

/// A fixture beside the part.
#[derive(Clone, Debug)]
pub struct Fixture {
    /// What messages call it.
    pub name: String,
    /// Its facets, nm, turned part frame.
    pub facets: Vec<[SpacePoint; 3]>,
    /// The set-ups in which it is there, rising; empty: all.
    pub setups: Vec<SetupId>,
}

/// Columns and rows of the boxes over a fixture.
const TILES: usize = 32;

impl Fixture {
    /// Whether it is there in a set-up.
    pub fn is_in(&self, setup: SetupId) -> bool {
        self.setups.is_empty() || self.setups.contains(&setup)
    }

    /// Its lowest and its highest corner, nm.
    pub fn ends(&self) -> [SpacePoint; 2] {
        let mut ends = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
        for p in self.facets.iter().flatten() {
            (0..3).for_each(|k| (ends[0][k], ends[1][k]) = (ends[0][k].min(p[k]), ends[1][k].max(p[k])));
        }
        ends
    }

    /// Boxes over it, each with the highest place in it.
    pub fn tiles(&self) -> Vec<(Box2, Nm)> {
        let [lo, hi] = self.ends();
        let size = [0, 1].map(|k| ((hi[k] - lo[k]) / TILES as f64).max(1.0));
        let tile = |k: usize, v: f64| (((v - lo[k]) / size[k]) as usize).min(TILES - 1);
        let mut tops = vec![f64::NEG_INFINITY; TILES * TILES];
        for corners in &self.facets {
            let range = |k: usize| {
                let v = corners.map(|p| p[k]);
                tile(k, v[0].min(v[1]).min(v[2]))..=tile(k, v[0].max(v[1]).max(v[2]))
            };
            let top = corners.iter().map(|p| p[2]).fold(f64::NEG_INFINITY, f64::max);
            for row in range(1) {
                range(0).for_each(|column| tops[row * TILES + column] = tops[row * TILES + column].max(top));
            }
        }
        let line = |k: usize, n: usize| lo[k] + n as f64 * size[k];
        let tiles = tops.iter().enumerate().filter(|(_, top)| top.is_finite());
        let around = tiles.map(|(i, &top)| {
            let (column, row) = (i % TILES, i / TILES);
            let at = |column: usize, row: usize, by: i64| {
                P2::new(line(0, column).floor() as i64 + by, line(1, row).floor() as i64 + by)
            };
            // A facet that ends on a border was taken as one of the tile beyond it.
            (Box2 { lo: at(column, row, -1), hi: at(column + 1, row + 1, 1) }, Nm::ceil(top))
        });
        around.collect()
    }
}

/// Fixtures that the head never gets near: they are in another place than was meant, or in another frame.
pub(crate) fn beyond(job: &Job, machine: &Machine, fixtures: &[Fixture], origins: &[Origin]) -> Vec<Diag> {
    let [x, y, _] = machine.axes();
    let around = (machine.lens.diameter.as_mm() / 2.0 + machine.stage.clearance.as_mm()) * NM_PER_MM;
    // Where the head can be over the table.
    let reached = [x, y].map(|(_, axis)| {
        let ends = axis.travel_nm().map(|Nm(end)| (axis.sign() * end) as f64);
        [ends[0].min(ends[1]) - around, ends[0].max(ends[1]) + around]
    });
    let is_reached = |fixture: &Fixture, origin: &Origin| {
        let [lo, hi] = fixture.ends();
        (0..2).all(|k| hi[k] + origin[k] as f64 >= reached[k][0] && lo[k] + origin[k] as f64 <= reached[k][1])
    };
    let told = fixtures.iter().enumerate().filter_map(|(i, fixture)| {
        let there = || origins.iter().enumerate().filter(|(n, _)| fixture.is_in(SetupId(*n as u32)));
        let (_, origin) = there().next()?;
        if there().any(|(_, origin)| is_reached(fixture, origin)) {
            return None;
        }
        let [lo, hi] = fixture.ends();
        let at = |k: usize, v: f64| (v + origin[k] as f64) / NM_PER_MM;
        let text = format!(
            "the head never gets near fixture {:?}: on the table it lies from X {:.1} to {:.1} mm and Y {:.1} to {:.1} mm",
            fixture.name,
            at(0, lo[0]),
            at(0, hi[0]),
            at(1, lo[1]),
            at(1, hi[1])
        );
        let hint = match job.fixtures[i].frame {
            FixtureFrame::Table => "check its numbers: they count from the zero of the table, mm",
            FixtureFrame::Part | FixtureFrame::SurfaceFile => {
                "frame = \"table\" if its numbers are from the table; without it they are of the part"
            }
        };
        Some(Diag::warning("fixture-beyond", text).at(job.place_of(&format!("fixture.{i}"))).hint(hint))
    });
    told.collect()
}

/// The fixtures of a job beside its part; `lying` where the part was measured.
///
/// # Errors
/// Faults of their files.
pub fn load(job: &Job, lying: Option<&Lying>, notes: &mut Vec<Diag>) -> Result<Vec<Fixture>, Error> {
    job.fixtures.iter().map(|input| placed(job, input, lying, notes)).collect()
}

/// A fixture beside the part of a job.
fn placed(job: &Job, input: &FixtureInput, lying: Option<&Lying>, notes: &mut Vec<Diag>) -> Result<Fixture, Error> {
    let facets = fixture::facets(job, input, notes)?;
    let [c, s] = cos_sin(job.placement.turn.as_rad());
    // A fixture on the table is refused where neither of both says where the part lies.
    let Origin(origin) = lying.map(|lying| lying.origin).or(job.placement.origin).unwrap_or_default();
    let place = |p: SpacePoint| {
        let at = p.map(|mm| mm * NM_PER_MM);
        match (input.frame, lying) {
            (FixtureFrame::Table, _) => [0, 1, 2].map(|k| at[k] - origin[k] as f64),
            (FixtureFrame::Part | FixtureFrame::SurfaceFile, None) => turned(at, [c, s]),
            (FixtureFrame::Part | FixtureFrame::SurfaceFile, Some(lying)) => {
                let at = turned(at, [c, s]);
                [0, 1, 2].map(|k| (0..3).map(|i| lying.rows[k][i] * at[i]).sum::<f64>() + lying.rest_nm[k])
            }
        }
    };
    let facets = facets.into_iter().map(|facet| facet.map(place)).collect();
    Ok(Fixture { name: input.name.clone(), facets, setups: input.setups.clone().unwrap_or_default() })
}

/// A point turned about the z axis by an angle of this cosine and sine.
fn turned([x, y, z]: SpacePoint, [c, s]: [f64; 2]) -> SpacePoint {
    [c * x - s * y, s * x + c * y, z]
}
