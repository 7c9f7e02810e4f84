//! Shapes of fixtures, in the frame that their coordinates are measured in.

use super::job::{FixtureFrame, FixtureInput, FixtureShape, Job};
use super::surface;
use terrace_core::diag::{Diag, Error, Place};
use terrace_core::geom::SpacePoint;

/// Most facets of a fixture.
const MAX_FACETS: usize = 1_000_000;

/// The corners of a box by the ends of its axes, two triangles a side.
const BOX_SIDES: [[usize; 3]; 12] = [
    [0, 2, 1],
    [1, 2, 3],
    [4, 5, 6],
    [5, 7, 6],
    [0, 1, 4],
    [1, 5, 4],
    [2, 6, 3],
    [3, 6, 7],
    [0, 4, 2],
    [2, 4, 6],
    [1, 3, 5],
    [3, 7, 5],
];

/// The facets of a fixture, mm: of [`FixtureFrame::Table`] in the table frame, of the others in the part frame before
/// `placement.turn`.
///
/// # Errors
/// Faults of its file; `fixture-shape` for one without facets, or with more than a million.
pub fn facets(job: &Job, fixture: &FixtureInput, notes: &mut Vec<Diag>) -> Result<Vec<[SpacePoint; 3]>, Error> {
    let mut facets = match &fixture.shape {
        FixtureShape::Box(ends) => {
            let corner = |i: usize| [0, 1, 2].map(|k| ends[i >> k & 1][k]);
            BOX_SIDES.map(|side| side.map(corner)).to_vec()
        }
        FixtureShape::File(file, options) => read(job, fixture, (file, options), notes)?,
    };
    let of_part = &job.surface.options;
    let (datum, scale, pose) = match fixture.frame {
        FixtureFrame::Part | FixtureFrame::Table => ([0.0; 3], 1.0, None),
        FixtureFrame::SurfaceFile => {
            let unit_mm = of_part.unit_mm.unwrap_or(1.0);
            (of_part.datum.unwrap_or_default().map(|v| v * unit_mm), of_part.scale.unwrap_or(1.0), of_part.pose)
        }
    };
    for p in facets.iter_mut().flatten() {
        let at = [0, 1, 2].map(|k| (p[k] + fixture.at[k] - datum[k]) * scale);
        *p = pose.map_or(at, |pose| pose.apply(at));
    }
    Ok(facets)
}

/// The facets of a file.
fn read(
    job: &Job,
    fixture: &FixtureInput,
    (file, options): (&std::path::Path, &surface::Options),
    notes: &mut Vec<Diag>,
) -> Result<Vec<[SpacePoint; 3]>, Error> {
    let path = job.relative(file);
    let fault = |text: String, hint: &str| {
        let fault = Diag::input("fixture-shape", text).at(Place::file(path.display().to_string()));
        Error::from(fault.hint(hint))
    };
    let mut facets = Vec::new();
    let mut count = 0;
    surface::read(&path, options, notes, &mut |facet| {
        count += 1;
        if count <= MAX_FACETS {
            facets.push(facet);
        }
    })?;
    let name = &fixture.name;
    match count {
        0 => Err(fault(format!("the file of fixture {name:?} holds no facets"), "export it again")),
        1..=MAX_FACETS => Ok(facets),
        _ => Err(fault(
            format!("the file of fixture {name:?} holds {count} facets, more than {MAX_FACETS}"),
            "export it coarser: the head keeps millimetres clear of it",
        )),
    }
}
