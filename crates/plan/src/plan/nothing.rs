//! Why nothing of a job would be marked.

use terrace_core::diag::Diag;
use terrace_input::job::Job;
use terrace_input::surface::Surface;

/// Share of the part's area that is too steep, from which that is the reason.
const STEEP: f64 = 0.9;

/// The error of a job of which nothing would be marked: its part stands, or its texture lies beside it.
pub(super) fn marked(job: &Job, surface: &Surface) -> Diag {
    let steep = surface.share_steeper(job.limits.max_slope());
    let d = if steep >= STEEP {
        let text = format!(
            "nothing would be marked: {:.0} % of the part's area is steeper than {} deg, as if it stood upright",
            steep * 100.0,
            job.limits.max_incidence.as_deg()
        );
        Diag::limit("job-empty", text).hint("lay it under the lens with `terrace orient JOB --apply`")
    } else {
        Diag::limit("job-empty", "nothing would be marked: no texture lies on the part where it may be marked")
            .hint("compare the texture's area and origin with the part's box (`terrace inspect`)")
    };
    d.at(job.place())
}
