//! What hatches in other directions would save: lines that cross fewer levels are cut less often.
//!
//! Consumes a stepped plan. An estimate: as many fragments less as the lines cross levels less (see `hatch_direction`),
//! each of the mean time that a fragment of the plan spends on delays and on the jump to it. Stops are taken to stay.

use super::SteppedPlan;
use super::hatch_direction::Section;
use crate::projection::Tracer;
use terrace_core::parallel;
use terrace_core::program::PassId;
use terrace_input::texture::{Kind, Request};

/// Least saving that `check` mentions, as a share of the job's time.
const LEAST_SHARE: f64 = 0.03;

/// Turns of all hatches together that are looked at, deg.
const STEP_DEG: u32 = 15;

/// What other directions would save.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HatchSaving {
    /// Lines along contours, s; None where it is less than 3 % of the job's time.
    pub contour_s: Option<f64>,
    /// By how much all hatches would be turned counter-clockwise, deg, and what that would save, s.
    pub turned: Option<(u32, f64)>,
}

impl HatchSaving {
    /// Of a plan.
    pub fn of(plan: &SteppedPlan) -> Self {
        Self::estimate(plan).unwrap_or_default()
    }

    /// None where the job has no fragments or no hatched area, or where its areas cannot be filled along contours.
    fn estimate(plan: &SteppedPlan) -> Option<Self> {
        let SteppedPlan { job, inputs, .. } = plan;
        let (fragments, times) = (plan.summary.fragments, plan.summary.time_s);
        let sections = &plan.passes.first()?.sections;
        let turn = job.placement.turn.as_rad();
        // An entry for each area of `texture.whole_contours`, in its order: the direction of its hatch, rad, frame of the
        // turned part; None where the job fills it along contours itself.
        let mut directions: Vec<Option<f64>> = Vec::new();
        let along = |request: Request| {
            let kind = match request.kind {
                Kind::Hatch { pitch_mm, direction_rad } => {
                    directions.push(Some(direction_rad + turn));
                    // The estimate takes pitch and outline alone.
                    Kind::Contour { pitch_mm, phase: 0.0 }
                }
                kind => {
                    directions.extend(matches!(kind, Kind::Contour { .. }).then_some(None));
                    kind
                }
            };
            Request { kind, ..request }
        };
        let requests: Vec<Request> = job.textures_of_pass(PassId(0)).into_iter().map(along).collect();
        if fragments == 0 || directions.iter().all(Option::is_none) {
            return None;
        }
        let texture = inputs.texture.of_pass(&requests, inputs.surface.part_box_mm(), turn).ok()?;
        let depth = plan.depth.f64();
        let max_slope = job.limits.max_slope();
        // Of every section the fragments with the lines as they are, turned by each step, and along contours.
        let turns = 180 / STEP_DEG;
        let counts = parallel::map(sections.len(), |i| {
            let mut tracer = Tracer::new(&inputs.surface, max_slope);
            let mut all = Section::default();
            let mut turned = vec![0.0; turns as usize];
            for (area, direction) in texture.whole_contours().zip(&directions) {
                let Some(direction) = direction else { continue };
                let mut one = Section::default();
                one.add(area, sections.area(i), depth, &mut tracer);
                for (k, sum) in turned.iter_mut().enumerate() {
                    let (s, c) = (direction + (k as f64 * f64::from(STEP_DEG)).to_radians()).sin_cos();
                    *sum += one.fragments([c, s]);
                }
                all.join(one);
            }
            (turned, all.least())
        });
        let now: f64 = counts.iter().map(|(turned, _)| turned[0]).sum();
        // Fragments are counted in the first pass; every other pass is taken to save as many.
        let s_per_fragment = (times.delay + times.jump) / fragments as f64 * f64::from(job.passes.count);
        let saving_s = |count: f64| Some((now - count) * s_per_fragment).filter(|s| *s > LEAST_SHARE * times.total);
        let total = |k: u32| counts.iter().map(|(turned, _)| turned[k as usize]).sum::<f64>();
        let best = (1..turns).map(|k| (k, total(k))).min_by(|a, b| a.1.total_cmp(&b.1));
        let along_contours: f64 = counts.iter().map(|(_, least)| least).sum();
        Some(Self {
            contour_s: saving_s(along_contours),
            turned: best.and_then(|(k, count)| Some((k * STEP_DEG, saving_s(count)?))),
        })
    }
}
