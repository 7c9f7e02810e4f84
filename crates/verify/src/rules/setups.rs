//! The set-ups of the manifest against the job: as many as it allows, and every registration point where it
//! says, computed from the point, the turn of the part and the set-up's origin.

use crate::job_facts::JobFacts;
use crate::read::manifest::{Manifest, RegistrationEntry, SetupEntry};
use crate::read::number::nm_from_mm;
use crate::read::program::ProgramFile;
use terrace_core::geom::{NM_PER_MM, P2, cos_sin};
use terrace_core::machine::{Axis, Origin};

/// Registration points that a set-up needs: they give place and turn.
const LEAST: usize = 2;

/// Whether the set-ups of the manifest are those that the job asks for.
pub(super) fn are_the_jobs(manifest: &Manifest, file: &ProgramFile, facts: &JobFacts) -> bool {
    let Some(setups) = &facts.setups else {
        return file.origins.len() == 1 && manifest.setups.iter().all(|s| s.registration.is_empty());
    };
    let most = setups.count.map(|n| n.map_or(usize::MAX, |n| n as usize));
    file.origins.len() <= most[0].saturating_mul(most[1])
        && manifest.setups.iter().zip(&file.origins).all(|(entry, &origin)| {
            entry.registration.len() >= LEAST && is_registered(entry, origin, &setups.registration, facts)
        })
}

/// Whether the points of a set-up are those of the job that it reaches, each at its commands.
fn is_registered(entry: &SetupEntry, origin: Origin, points: &[P2], facts: &JobFacts) -> bool {
    let machine = &facts.machine;
    let step = machine.increment_nm().f64();
    let [cos, sin] = cos_sin(facts.turn_deg.to_radians());
    let mut stated = entry.registration.iter().peekable();
    for point in points {
        let [x, y] = point.mm();
        let turned = [cos * x - sin * y, sin * x + cos * y];
        let axes = machine.axes();
        let wanted = [0, 1].map(|k| axes[k].1.sign() as f64 * (turned[k] * NM_PER_MM + origin[k] as f64));
        let within = |slack: f64| (0..2).all(|k| is_in_travel(axes[k].1, wanted[k], slack));
        let is_stated = |r: &RegistrationEntry| r.point_mm.map(nm_from_mm) == [Some(point.x), Some(point.y)];
        // A point that is stated lies in travel; one that is left out does not. Within an increment of its end it may
        // be either: the command is rounded.
        if stated.peek().is_some_and(|r| is_stated(r)) {
            let command = stated.next().map_or([f64::NAN; 2], |r| r.stage.map(|v| v * NM_PER_MM));
            let is_there = (0..2).all(|k| (command[k] - wanted[k]).abs() <= step);
            if !is_there || !within(step) {
                return false;
            }
        } else if within(-step) {
            return false;
        }
    }
    stated.next().is_none()
}

/// Whether a command, nm, lies within the travel of an axis made longer by `slack` at both ends.
fn is_in_travel(axis: &Axis, command: f64, slack: f64) -> bool {
    let [lo, hi] = axis.travel.map(|t| t.as_mm() * NM_PER_MM);
    (lo - slack..=hi + slack).contains(&command)
}
