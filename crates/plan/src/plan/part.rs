//! What a user should know of the part of a plan before it is marked: its bodies, and the sides of what is marked.
//!
//! Consumes a plan and the facets of its surface file, as the file has them; promises warnings. Files of more than
//! half a million are not looked at, which is one of them, nor height maps, whose facets all face the lens.

use super::Plan;
use terrace_core::diag::{Diag, Place};
use terrace_core::math;
use terrace_input::surface::bodies::{self, Bodies};
use terrace_input::surface::{self, Facing};
use terrace_input::texture::Texture;

/// Most facets of a file that is looked at: of more it takes long next to the plan.
const MOST_FACETS: usize = 500_000;

/// Places along the marks that are looked at.
const PLACES: usize = 4096;

/// Strokes on which these lie.
const STROKES: usize = 1024;

/// The facets of a surface file, of not too many.
#[derive(Default)]
pub struct Facets {
    facets: Vec<[[f64; 3]; 3]>,
    are_too_many: bool,
}

impl Facets {
    /// Takes the next facet of the file; of too many none is kept, since they would take up room while the job is
    /// planned.
    pub fn take(&mut self, facet: [[f64; 3]; 3]) {
        if self.facets.len() == MOST_FACETS {
            *self = Self { facets: Vec::new(), are_too_many: true };
        }
        if !self.are_too_many {
            self.facets.push(facet);
        }
    }
}

/// Looks at the part of a plan.
pub fn look_at(plan: &Plan, Facets { facets, are_too_many }: &Facets) -> Vec<Diag> {
    if facets.is_empty() && !are_too_many {
        return Vec::new();
    }
    let (job, texture) = match plan {
        Plan::Stepped(plan) => (&plan.job, plan.inputs.texture_as_designed()),
        Plan::OnTheFly(plan) => (&plan.job, &plan.texture),
    };
    let place = Place::file(job.surface_path().display().to_string());
    if *are_too_many {
        return vec![not_looked_at(place)];
    }
    let mut facing = Facing::new(&places(texture), math::cos(job.limits.max_incidence.as_rad()));
    let (s, c) = math::sin_cos(job.placement.turn.as_rad());
    let mut found = Bodies::default();
    for &facet in facets {
        found.facet(facet);
        facing.facet(facet.map(|[x, y, z]| [c * x - s * y, s * x + c * y, z]));
    }
    // The points of a cloud are no body.
    let are_bodies = !surface::is_cloud(&job.surface_path());
    let mut warnings = if are_bodies { bodies::warnings(&found.finish(), &place) } else { Vec::new() };
    // Where all of the part lies upside down, that was said.
    let is_warned_of = plan.warnings().iter().any(|d| d.code == "surface-upside-down");
    let seen = facing.seen();
    if let Some([x, y, z]) = seen.first.filter(|_| !is_warned_of) {
        let in_file = [c * x + s * y, c * y - s * x, z];
        warnings.push(facing_away(seen.away, seen.places, in_file).at(place));
    }
    warnings
}

/// A file with too many facets.
fn not_looked_at(place: Place) -> Diag {
    let text = format!(
        "the file has more than {MOST_FACETS} facets: its bodies, its holes and the sides of the facets under the \
         marks are not looked at"
    );
    let hint = "`terrace inspect` of the file lists bodies and holes";
    Diag::warning("surface-not-looked-at", text).at(place).hint(hint)
}

/// Marks on facets that face away from the lens: how many of the places, and one of them.
fn facing_away(away: usize, places: usize, [x, y, z]: [f64; 3]) -> Diag {
    let text = format!(
        "{away} of {places} places looked at along the marks lie on facets that face away from the lens, as the underside \
         of a part does; one at ({x:.3}, {y:.3}, {z:.3})"
    );
    let hint = "look whether the part has a hole there, or shows its inside; if its normals are reversed, all is well";
    Diag::warning("surface-away", text).hint(hint)
}

/// Places along the strokes of a texture, evenly over some of them, mm.
fn places(texture: &Texture) -> Vec<[f64; 2]> {
    let strokes = texture.len().min(STROKES);
    let each = PLACES / strokes.max(1);
    let mut points = Vec::new();
    let mut out = Vec::new();
    for i in 0..strokes {
        texture.stroke((texture.len() as f64 * (i as f64 + 0.5) / strokes as f64) as usize, &mut points);
        let points: Vec<[f64; 2]> = points.iter().map(|p| p.mm()).collect();
        let length = |w: &[[f64; 2]]| math::hypot(w[1][0] - w[0][0], w[1][1] - w[0][1]);
        let whole: f64 = points.windows(2).map(length).sum();
        let mut along = 0.0;
        let mut next = 0;
        for w in points.windows(2) {
            let length = length(w);
            while next < each {
                let at = whole * (next as f64 + 0.5) / each as f64 - along;
                if at > length {
                    break;
                }
                let share = if length > 0.0 { at / length } else { 0.0 };
                out.push([0, 1].map(|k| w[0][k] + (w[1][k] - w[0][k]) * share));
                next += 1;
            }
            along += length;
        }
        if let [dot] = points[..] {
            out.push(dot);
        }
    }
    out
}
