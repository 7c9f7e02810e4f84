//! How a part is to be laid under the lens: the side that its facets face, seen from above, in the smallest box.
//!
//! Consumes the facets of a job's surface file in the file's frame; promises a rotation of it and what it was taken
//! from. The winding of the facets is the one witness of the side of an open sheet: their areas, as vectors, add up to
//! the direction that it faces. Those of a closed body add up to nothing; there the direction is taken from which the
//! most area lies within the limit of incidence, and the user is asked where the side away from it shows nearly as
//! much. What one part of a body hides from another is not looked into.

use super::orient;
use terrace_core::diag::{Diag, Error, Place};
use terrace_core::geom::{Pose, SpacePoint};
use terrace_core::math;
use terrace_core::units::Angle;
use terrace_input::job::{Attitude, Job};
use terrace_input::surface::{self, Content};
use terrace_input::texture::{Area, Kind, Masks};

/// Share of the area that an open sheet shows in one direction, at least.
const OPEN_SHEET_SHARE: f64 = 0.2;

/// Share of what the best side shows from which on the other one may be meant as well.
const AS_GOOD: f64 = 0.8;

/// By how much more area a side must show to be taken in place of one that was tried before.
const BETTER_SIDE: f64 = 1.02;

/// By how much smaller a box in plan must be for the part to be turned about z.
const SMALLER_BOX: f64 = 0.99;

/// Directions that are tried for a closed body.
const DIRECTIONS: usize = 400;

/// Most facets that are kept to look at a body from all sides: of more, every nth.
const MOST_KEPT: usize = 20_000;

/// How the side that faces the lens is chosen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Side {
    /// By the facets.
    Found,
    /// The user gives the direction, in the file's frame.
    Up(SpacePoint),
    /// The facet nearest to this point, in the file's frame and unit, lies on the table.
    LieOn(SpacePoint),
}

/// A way to lay a part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Laying {
    /// The direction that looks at the lens, in the file's frame.
    pub up: SpacePoint,
    /// From the file's frame to that of the laid part.
    pub pose: Pose,
    /// Share of the area that faces the lens as the file has it, by its winding, 0 to 1.
    pub faces_lens: f64,
    /// What the side was taken from.
    pub reason: Reason,
}

/// What the side that faces the lens was taken from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reason {
    /// The winding of an open sheet.
    Winding,
    /// The area that a closed body shows.
    Area,
    /// The user.
    Asked,
}

impl Reason {
    /// The reason's name in JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::Winding => "winding",
            Self::Area => "area",
            Self::Asked => "asked",
        }
    }
}

/// Finds how the part of a job is to be laid.
///
/// # Errors
/// Faults of the file; `orient-side` where both sides of a closed body may be meant.
pub fn lay(job: &Job, side: Side) -> Result<Laying, Error> {
    let path = job.surface_path();
    let mut options = job.surface.options.clone();
    options.pose = None;
    let mut facets = FacetSums::default();
    let content = surface::read(&path, &options, &mut Vec::new(), &mut |facet| facets.add(facet))?;
    if let Content::Heightmap(map) = content {
        map.facets(&mut |facet| facets.add(facet));
    }
    let here = |d: Diag| Error::from(d.at(Place::file(path.display().to_string())));
    if facets.area <= 0.0 {
        return Err(here(Diag::input("surface-empty", "the surface file holds no area").hint("export it again")));
    }
    let reason = match side {
        Side::Up(_) | Side::LieOn(_) => Reason::Asked,
        Side::Found if norm(facets.sum) > OPEN_SHEET_SHARE * facets.area => Reason::Winding,
        Side::Found => Reason::Area,
    };
    let up = match side {
        Side::Up(direction) => direction,
        Side::LieOn(point) => {
            let unit = options.unit_mm.unwrap_or(1.0) * options.scale.unwrap_or(1.0);
            let datum = options.datum.unwrap_or_default();
            let in_mm = [0, 1, 2].map(|k| (point[k] - datum[k]) * unit);
            facets.nearest(in_mm).map(|v| -v)
        }
        Side::Found if reason == Reason::Winding => facets.sum,
        Side::Found => facets.best_side(math::cos(job.limits.max_incidence.as_rad())).map_err(here)?,
    };
    let Some(tilt) = Pose::from_up(up) else {
        let d = Diag::input("placement-laid", "the direction that is to look at the lens has no length");
        return Err(here(d.hint("give three numbers, such as 0,0,1")));
    };
    let pose = tilt.then(facets.smallest_box(&tilt));
    let length = norm(up);
    Ok(Laying { up: up.map(|v| v / length), pose, faces_lens: facets.up / facets.area, reason })
}

/// A facet of which no more than this counts.
struct Facet {
    centre: SpacePoint,
    /// Its area as a vector, as long as its area.
    area: SpacePoint,
}

/// What the facets of a file come to.
#[derive(Default)]
struct FacetSums {
    /// Area of all, and of those that face up.
    area: f64,
    up: f64,
    /// Areas as vectors, each as long as its area.
    sum: SpacePoint,
    /// Some of the facets.
    kept: Vec<Facet>,
    /// How many facets there are.
    count: usize,
    /// Every nth facet is kept, so that no more than [`MOST_KEPT`] are.
    every: usize,
}

impl FacetSums {
    fn add(&mut self, facet: [SpacePoint; 3]) {
        let [u, v] = [1, 2].map(|k| [0, 1, 2].map(|i| facet[k][i] - facet[0][i]));
        let area = cross(u, v).map(|c| c / 2.0);
        let size = norm(area);
        self.area += size;
        self.up += if area[2] > 0.0 { size } else { 0.0 };
        self.sum = [0, 1, 2].map(|i| self.sum[i] + area[i]);
        self.every = self.every.max(1);
        if size > 0.0 && self.count.is_multiple_of(self.every) {
            let centre = [0, 1, 2].map(|i| (facet[0][i] + facet[1][i] + facet[2][i]) / 3.0);
            self.kept.push(Facet { centre, area });
            if self.kept.len() > MOST_KEPT {
                let mut is_kept = false;
                self.kept.retain(|_| {
                    is_kept = !is_kept;
                    is_kept
                });
                self.every *= 2;
            }
        }
        self.count += 1;
    }

    /// The normal of the facet whose centre is nearest to a point.
    fn nearest(&self, at: SpacePoint) -> SpacePoint {
        let distance = |p: &SpacePoint| norm([0, 1, 2].map(|i| p[i] - at[i]));
        let nearest = self.kept.iter().min_by(|a, b| distance(&a.centre).total_cmp(&distance(&b.centre)));
        nearest.map_or([0.0; 3], |facet| facet.area)
    }

    /// How much area, seen from a direction, lies within the limit of incidence.
    fn shown(&self, from: SpacePoint, least_cos: f64) -> f64 {
        let projected = self.kept.iter().map(|facet| (dot(facet.area, from), norm(facet.area)));
        projected.filter(|(projected, size)| *projected >= least_cos * size).map(|(projected, _)| projected).sum()
    }

    /// The direction from which a closed body shows the most.
    fn best_side(&self, least_cos: f64) -> Result<SpacePoint, Diag> {
        let axes = (0..6).map(|i| {
            let mut axis = [0.0; 3];
            axis[i / 2] = if i % 2 == 0 { 1.0 } else { -1.0 };
            axis
        });
        // Evenly spread: each a golden angle on from the one before.
        let spread = (0..DIRECTIONS).map(|i| {
            let z = 1.0 - (2.0 * i as f64 + 1.0) / DIRECTIONS as f64;
            let (sin, cos) = math::sin_cos(i as f64 * 2.399_963_229_728_653);
            let r = (1.0 - z * z).sqrt();
            [r * cos, r * sin, z]
        });
        // Of equal ones the first: axes go before all others.
        let candidates = axes.chain(spread).map(|d| (self.shown(d, least_cos), d));
        let (most, towards) = candidates
            .fold((0.0, [0.0, 0.0, 1.0]), |best, next| if next.0 > best.0 * BETTER_SIDE { next } else { best });
        let away = towards.map(|v| -v);
        let other = self.shown(away, least_cos);
        if other < AS_GOOD * most {
            return Ok(towards);
        }
        let text = format!(
            "the part is a closed body, and two of its sides may be meant: that towards ({}) shows {most:.0} mm2, that \
             away from it {other:.0} mm2",
            direction(towards)
        );
        let hint = format!("choose with --up {} or --up {}", direction(towards), direction(away));
        Err(Diag::input("orient-side", text).hint(hint))
    }

    /// The turn about z with which the part has the smallest box in plan, its longer side along x; none where that
    /// saves little.
    fn smallest_box(&self, tilt: &Pose) -> Pose {
        let plan: Vec<[f64; 2]> =
            self.kept.iter().map(|facet| tilt.apply(facet.centre)).map(|[x, y, _]| [x, y]).collect();
        let size = |deg: f64| sides(&plan, deg).iter().product::<f64>();
        let smaller = |a: f64, b: f64| if size(b) < SMALLER_BOX * size(a) { b } else { a };
        // Whole degrees, of which no turn is tried first.
        let mut best = (-44..=45).map(f64::from).fold(0.0, smaller);
        if best != 0.0 {
            // Twentieths of a degree around it.
            best = (-20..=20)
                .map(|i| best + f64::from(i) * 0.05)
                .min_by(|a, b| size(*a).total_cmp(&size(*b)))
                .unwrap_or(best);
        }
        Pose::from_angles([0.0, 0.0, best.to_radians()])
    }
}

/// The sides of the box around points of the plane, turned by `deg`.
fn sides(points: &[[f64; 2]], deg: f64) -> [f64; 2] {
    let (sin, cos) = math::sin_cos(deg.to_radians());
    [[cos, -sin], [sin, cos]].map(|[a, b]| {
        let along = points.iter().map(|[x, y]| a * x + b * y);
        let (lo, hi) = along.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        hi - lo
    })
}

/// A direction as a user can give it; a zero has no sign.
fn direction(d: SpacePoint) -> String {
    d.map(|v| format!("{:.3}", v + 0.0)).join(",")
}

/// The job with its part laid by these rotations about x, y and z of the surface file.
pub fn laid(job: &Job, rotate: [Angle; 3]) -> Job {
    let mut job = job.clone();
    let laid = Attitude::Rotated(rotate);
    (job.placement.laid, job.surface.options.pose) = (Some(laid), laid.pose());
    for texture in &mut job.textures {
        if let Kind::Curves { pose, .. } = &mut texture.kind {
            *pose = laid.pose();
        }
    }
    job
}

/// The job with one hatch over all of the part: what its textures cover once it is laid is not known.
pub fn hatched(job: &Job, pitch_mm: f64) -> Job {
    let mut job = job.clone();
    job.textures.truncate(1);
    for texture in &mut job.textures {
        texture.kind = Kind::Hatch { pitch_mm, direction_rad: 0.0 };
        (texture.area, texture.masks) = (Area::Part, Masks::default());
    }
    job
}

/// Rotations about x, y and z as they are written: to a hundredth of a degree.
pub fn angles(pose: &Pose) -> [Angle; 3] {
    pose.angles().map(|rad| Angle::deg((rad.to_degrees() * 100.0).round() / 100.0 + 0.0))
}

impl Laying {
    /// Whether the part lies on that side already: within the fixture angles that [`super::orient`] tries it leans.
    pub fn is_as_placed(&self, laid: Option<Attitude>) -> bool {
        let now = laid.and_then(|laid| laid.pose()).map_or(self.up, |pose| pose.apply(self.up));
        now[2] > math::cos(orient::STEEPEST.to_radians())
    }
}

fn cross(u: SpacePoint, v: SpacePoint) -> SpacePoint {
    [0, 1, 2].map(|i| u[(i + 1) % 3] * v[(i + 2) % 3] - u[(i + 2) % 3] * v[(i + 1) % 3])
}

fn dot(u: SpacePoint, v: SpacePoint) -> f64 {
    u.iter().zip(v).map(|(u, v)| u * v).sum()
}

fn norm(v: SpacePoint) -> f64 {
    dot(v, v).sqrt()
}
