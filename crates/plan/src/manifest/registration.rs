//! Registration: the stage position at which a known point of the part lies under the optical axis.

use crate::check::Checked;
use terrace_core::geom::{Nm, P2, cos_sin};
use terrace_core::machine::{Machine, Origin};
use terrace_input::job::Job;

/// A point of the part that a set-up reaches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Registered {
    /// The point that the job names, part frame, rounded to the nanometre, mm.
    pub point_mm: [f64; 2],
    /// Commanded x and y, on the increment.
    pub at: [Nm; 2],
}

/// Commanded x and y of the registration points of every set-up; none where the job has no set-ups.
pub fn registered(job: &Job, machine: &Machine, checked: &Checked) -> Vec<Vec<[Nm; 2]>> {
    let points = |&origin: &Origin| registration(job, machine, origin).into_iter().map(|r| r.at).collect();
    checked.origins().iter().map(points).collect()
}

/// The registration points of a job that the stage reaches while the part's origin lies at `origin`, nm.
pub fn registration(job: &Job, machine: &Machine, origin: Origin) -> Vec<Registered> {
    let [cos, sin] = cos_sin(job.placement.turn.as_rad());
    let step = machine.increment_nm().max(Nm(1));
    let points = job.setups.iter().flat_map(|s| &s.registration);
    let placed = points.map(|point| {
        let [x, y] = [point.x as f64, point.y as f64];
        let turned = [cos * x - sin * y, sin * x + cos * y].map(|v| v.round() as i64);
        let [x, y, _] = machine.stage_from_part(P2::new(turned[0], turned[1]), Nm(0), origin).0;
        Registered { point_mm: point.mm(), at: [x, y].map(|v| (Nm(v) + step / 2).down_to(step)) }
    });
    let is_reached = |r: &Registered| {
        machine.axes().iter().zip(r.at).all(|((_, axis), at)| {
            let [lo, hi] = axis.travel_nm();
            (lo..=hi).contains(&at)
        })
    };
    placed.filter(is_reached).collect()
}
