//! What hatches in other directions would save: lines that cross fewer levels are cut less often.
//!
//! Consumes a stepped plan. An estimate: as many fragments less as the lines cross levels less (see `hatch_direction`),
//! each of the mean time that a fragment of the plan spends on delays and on the jump to it. Stops are taken to stay.

use super::SteppedPlan;
use super::hatch_direction::HatchSection;
use crate::projection::Tracer;
use terrace_core::geom::{Box2, Nm};
use terrace_core::math;
use terrace_core::parallel;
use terrace_core::program::PassId;
use terrace_input::job::Job;
use terrace_input::texture::{Contour, Kind, Request};

/// Least saving that `check` mentions, as a share of the job's time.
const LEAST_SHARE: f64 = 0.03;

/// Turns of all hatches together that are looked at, deg.
const STEP_DEG: u32 = 15;

/// How many turns these are: a hatch that is turned by 180 deg is the same.
const TURNS: u32 = 180 / STEP_DEG;

/// What other directions would save.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HatchSaving {
    /// Lines along contours, s; None where it is less than 3 % of the job's time.
    pub contour_s: Option<f64>,
    /// By how much all hatches would be turned counter-clockwise, deg, and what that would save, s.
    pub turned: Option<(u32, f64)>,
}

impl HatchSaving {
    /// What other directions would save of a plan.
    pub fn of(plan: &SteppedPlan) -> Self {
        Self::estimate(plan).unwrap_or_default()
    }

    /// None where the job has no fragments or no hatched area, where its part was measured, or where its areas cannot be filled along contours.
    fn estimate(plan: &SteppedPlan) -> Option<Self> {
        let SteppedPlan { job, inputs, .. } = plan;
        let fragments = plan.summary.fragments;
        let times = plan.summary.time_s;
        let sections = &plan.passes.first()?.sections;
        let turn = job.placement.turn.as_rad();
        let (requests, directions) = along_contours(job, turn);
        if inputs.measured.is_some() || fragments == 0 || directions.iter().all(Option::is_none) {
            return None;
        }
        let texture = inputs.texture.of_pass(&requests, inputs.surface.part_box_mm(), turn).ok()?;
        let max_slope = job.limits.max_slope();
        let depth = plan.depth;
        let counts = parallel::map(sections.len(), |i| {
            let mut tracer = Tracer::new(&inputs.surface, max_slope);
            let areas = texture.whole_contours().zip(&directions);
            let hatches = areas.filter_map(|(area, direction)| Some((area, (*direction)?)));
            SectionFragments::new(hatches, sections.area(i), depth, &mut tracer)
        });
        let now: f64 = counts.iter().map(|section| section.turned[0]).sum();
        // Fragments are counted in the first pass; every other pass is taken to save as many.
        let s_per_fragment = (times.delay + times.jump) / fragments as f64 * f64::from(job.passes.count);
        let saving_s = |count: f64| Some((now - count) * s_per_fragment).filter(|s| *s > LEAST_SHARE * times.total);
        let total = |k: u32| counts.iter().map(|section| section.turned[k as usize]).sum::<f64>();
        let best = (1..TURNS).map(|k| (k, total(k))).min_by(|a, b| a.1.total_cmp(&b.1));
        let along_contours: f64 = counts.iter().map(|section| section.along_contours).sum();
        Some(Self {
            contour_s: saving_s(along_contours),
            turned: best.and_then(|(k, count)| Some((k * STEP_DEG, saving_s(count)?))),
        })
    }
}

/// The textures of a job with their hatches as areas to be filled along contours. With an entry for each area of
/// `Texture::whole_contours` of these, in its order: the direction of its hatch, rad, frame of the turned part; None
/// where the job fills it along contours itself.
fn along_contours(job: &Job, turn: f64) -> (Vec<Request>, Vec<Option<f64>>) {
    let mut directions = Vec::new();
    let mut requests = job.textures_of_pass(PassId(0));
    for request in &mut requests {
        match request.kind {
            Kind::Hatch { pitch_mm, direction_rad } => {
                directions.push(Some(direction_rad + turn));
                // The estimate takes pitch and outline alone.
                request.kind = Kind::Contour { pitch_mm, phase: 0.0 };
            }
            Kind::Contour { .. } => directions.push(None),
            _ => {}
        }
    }
    (requests, directions)
}

/// How many fragments the hatches of a section come to.
struct SectionFragments {
    /// With the lines as they are, and turned by each step.
    turned: Vec<f64>,
    along_contours: f64,
}

impl SectionFragments {
    /// For areas with the directions of their hatches.
    fn new<'a>(
        hatches: impl Iterator<Item = (&'a Contour, f64)>,
        area: Box2,
        depth: Nm,
        tracer: &mut Tracer<'_>,
    ) -> Self {
        let mut all = HatchSection::default();
        let mut turned = vec![0.0; TURNS as usize];
        for (outline, direction) in hatches {
            let mut hatch = HatchSection::default();
            hatch.add(outline, area, depth.f64(), tracer);
            for (k, sum) in turned.iter_mut().enumerate() {
                let (s, c) = math::sin_cos(direction + (k as f64 * f64::from(STEP_DEG)).to_radians());
                *sum += hatch.fragments([c, s]);
            }
            all.join(hatch);
        }
        Self { turned, along_contours: all.least() }
    }
}
