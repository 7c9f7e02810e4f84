//! Fixtures, placed beside the part again: their files' own facets, taken through their frames by this crate's own
//! arithmetic.

use super::geometry::{Geometry, MeshBuilder, Pose, Shape};
use super::job_facts::THINNEST;
use super::proof::Rule;
use super::read::manifest::{FixtureEntry, Manifest};
use super::rotation::Rotation;
use terrace_core::diag::Error;
use terrace_core::geom::{NM_PER_MM, SpacePoint};
use terrace_core::machine::Origin;
use terrace_core::program::SetupId;
use terrace_input::job::{FixtureFrame, FixtureInput, FixtureShape, Job};
use terrace_input::surface;

/// A fixture beside the part.
pub(crate) struct Fixture {
    /// What messages call it.
    pub(crate) name: String,
    /// Its facets, nm, turned part frame, as the part lies.
    pub(crate) geometry: Geometry,
    setups: Option<Vec<SetupId>>,
}

impl Fixture {
    /// A box, mm, that is there in every set-up.
    #[cfg(test)]
    pub(crate) fn of_box(ends: &[SpacePoint; 2]) -> Self {
        let mut builder = MeshBuilder::new(0.0, THINNEST);
        sides(ends).into_iter().for_each(|side| builder.push(side));
        let geometry = Geometry::new(Shape::Mesh(builder.finish()), 0.0, 0.0);
        Self { name: "clamp".into(), geometry, setups: None }
    }

    /// Whether it is there in a set-up.
    pub(crate) fn is_in(&self, setup: SetupId) -> bool {
        match &self.setups {
            None => true,
            Some(setups) => setups.contains(&setup),
        }
    }
}

/// Places the fixtures of a job beside its part, whose origin lies at `origin`; `pose` moves a measured part.
///
/// # Errors
/// Faults of their files.
pub(super) fn load(job: &Job, origin: Origin, pose: Option<&Pose>) -> Result<Vec<Fixture>, Error> {
    job.fixtures.iter().map(|input| placed(job, input, origin, pose)).collect()
}

fn placed(job: &Job, input: &FixtureInput, origin: Origin, pose: Option<&Pose>) -> Result<Fixture, Error> {
    let is_on_table = input.frame == FixtureFrame::Table;
    let mut builder = MeshBuilder::new(if is_on_table { 0.0 } else { job.placement.turn.as_rad() }, THINNEST);
    let part = &job.surface.options;
    let of_file = (input.frame == FixtureFrame::SurfaceFile).then_some(part);
    let unit = part.unit_mm.unwrap_or(1.0);
    let datum = of_file.and_then(|o| o.datum).map_or([0.0; 3], |d| d.map(|v| v * unit));
    let scale = of_file.and_then(|o| o.scale).unwrap_or(1.0);
    let laid = of_file.and(job.placement.laid).map(|laid| Rotation::new(&laid));
    let mut add = |corners: [SpacePoint; 3]| {
        let mut facet = corners.map(|p| [0, 1, 2].map(|k| scale * (input.at[k] + p[k] - datum[k])));
        if let Some(rotation) = &laid {
            facet = rotation.facet(facet);
        }
        if is_on_table {
            facet = facet.map(|p| [0, 1, 2].map(|k| p[k] - origin.mm()[k]));
        }
        builder.push(facet);
    };
    match &input.shape {
        FixtureShape::File(file, options) => {
            surface::read(&job.relative(file), options, &mut Vec::new(), &mut add)?;
        }
        FixtureShape::Box(ends) => sides(ends).into_iter().for_each(&mut add),
    }
    let geometry = Geometry::new(Shape::Mesh(builder.finish()), 0.0, 0.0);
    let geometry = match pose.filter(|_| !is_on_table) {
        Some(pose) => geometry.moved(pose),
        None => geometry,
    };
    Ok(Fixture { name: input.name.clone(), geometry, setups: input.setups.clone() })
}

/// Holds the fixtures that a manifest lists to those that were placed again.
pub(super) fn check(manifest: &Manifest, placed: &[Fixture], rule: &mut Rule) {
    let is_same = |(entry, fixture): (&FixtureEntry, &Fixture)| {
        let mut ends = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
        fixture.geometry.each_facet(&mut |corners| {
            for p in corners {
                (0..3).for_each(|k| (ends[0][k], ends[1][k]) = (ends[0][k].min(p[k]), ends[1][k].max(p[k])));
            }
        });
        let is_near = |i: usize, k: usize| (ends[i][k] - entry.box_mm[i][k] * NM_PER_MM).abs() < NEAR;
        let numbers: Vec<u32> = fixture.setups.iter().flatten().map(|setup| setup.number()).collect();
        entry.name == fixture.name && entry.setups == numbers && (0..6).all(|i| is_near(i / 3, i % 3))
    };
    let same = manifest.fixtures.len() == placed.len() && manifest.fixtures.iter().zip(placed).all(is_same);
    rule.require("manifest.json", same, "its fixtures are not those of the job");
}

/// How far ends that the manifest lists in tenths of a micrometre may lie from those that are placed again, nm.
const NEAR: f64 = 60.0;

/// The sides of a box between two opposite corners, two triangles each.
fn sides([a, b]: &[SpacePoint; 2]) -> Vec<[SpacePoint; 3]> {
    let mut all = Vec::new();
    for k in 0..3 {
        let (u, v) = ((k + 1) % 3, (k + 2) % 3);
        for at in [a[k], b[k]] {
            let corner = |along_u: f64, along_v: f64| {
                let mut p = [0.0; 3];
                (p[k], p[u], p[v]) = (at, along_u, along_v);
                p
            };
            let diagonal = [corner(a[u], a[v]), corner(b[u], b[v])];
            all.extend([corner(b[u], a[v]), corner(a[u], b[v])].map(|third| [diagonal[0], third, diagonal[1]]));
        }
    }
    all
}
