//! The same path taken apart for scanner and stage by every decomposition there is.

use rayon::prelude::*;

use crate::fly::decompose::{Family, Method, largest, peak, rms_acceleration, stage, within};
use crate::fly::path::Path;
use crate::fly::schedule::{Samples, Schedule};
use crate::fly::sync::{Peaks, Room};
use crate::machine::Machine;

/// What a decomposition makes of the path, as strong as field and focus allow.
#[derive(Clone, Debug, PartialEq)]
pub struct Filter {
    /// Its name.
    pub name: &'static str,
    /// Strength in plan and in height, ms; None where there is none to choose.
    pub strength_ms: Option<[f64; 2]>,
    /// How far the scanner goes to a side, mm.
    pub reach_mm: [f64; 2],
    /// Largest focal offset of a mark, um.
    pub focus_um: f64,
    /// Root of the mean squared acceleration of the stage at the pens' speeds, mm/s².
    pub rms_acceleration: f64,
    /// Largest acceleration of an axis at the pens' speeds, mm/s².
    pub peak_acceleration: f64,
    /// Time of the path at the speed that the stage can follow, s.
    pub time_s: f64,
}

/// All decompositions of one path.
pub(super) fn filters(path: &Path, schedule: &Schedule, machine: &Machine, room: Room, step_s: f64) -> Vec<Filter> {
    let total = schedule.total_s();
    let even = schedule.samples(path, step_s);
    let limits = Peaks::limits(machine);
    let families: [(&'static str, Option<Family>); 5] = [
        ("moving average", Some(Family::MovingAverage)),
        ("Gaussian", Some(Family::Gaussian)),
        ("Savitzky-Golay", Some(Family::SavitzkyGolay { order: 3 })),
        ("low-pass", Some(Family::LowPass)),
        ("least acceleration", None),
    ];
    families
        .into_par_iter()
        .map(|(name, family)| {
            let (made, strength) = match family {
                Some(family) => filtered(&even, family, room),
                None => (least(&even, room), None),
            };
            let left: Vec<[f64; 2]> = even.at.iter().zip(&made).map(|(b, s)| [b[0] - s[0], b[1] - s[1]]).collect();
            let off =
                even.at.iter().zip(&made).zip(&even.on).filter(|(_, on)| **on).map(|((b, s), _)| (b[2] - s[2]).abs());
            let peaks = [0, 1, 2].map(|k| Peaks::of(&made, k, even.step_s));
            let slower =
                (0..3).map(|k| peaks[k].slowed(&Peaks { jerk: f64::INFINITY, ..limits[k] })).fold(1.0, f64::max);
            Filter {
                name,
                strength_ms: strength.map(|s| s.map(|v| v * even.step_s * 1000.0)),
                reach_mm: peak(&left),
                focus_um: 1000.0 * off.fold(0.0, f64::max),
                rms_acceleration: rms_acceleration(&made, even.step_s),
                peak_acceleration: peaks.iter().map(|p| p.acceleration).fold(0.0, f64::max),
                time_s: total * slower,
            }
        })
        .collect()
}

/// The stage of least acceleration; in height it is bound where it is marked, as filters are.
fn least(even: &Samples, room: Room) -> Vec<[f64; 3]> {
    let plan: Vec<[f64; 2]> = even.at.iter().map(|p| [p[0], p[1]]).collect();
    let plan = stage(&plan, Method::LeastAcceleration { half: room.half_field });
    let ends = |(p, &on): (&[f64; 3], &bool)| {
        let far = if on { room.focus } else { f64::INFINITY };
        [p[2] - far, p[2] + far]
    };
    let ends: Vec<[f64; 2]> = even.at.iter().zip(&even.on).map(ends).collect();
    let z = within(even.at.iter().map(|p| p[2]).collect(), &ends);
    plan.into_iter().zip(z).map(|([x, y], z)| [x, y, z]).collect()
}

/// A filter in plan and in height, each as strong as it may be; strengths in samples.
fn filtered(even: &Samples, family: Family, room: Room) -> (Vec<[f64; 3]>, Option<[f64; 2]>) {
    let plan: Vec<[f64; 2]> = even.at.iter().map(|p| [p[0], p[1]]).collect();
    let height: Vec<[f64; 1]> = even.at.iter().map(|p| [p[2]]).collect();
    // Longer than the whole path nothing changes any more; half a thousandth of it is a start that is too strong
    // where the scanner has anything to do.
    let start = (even.at.len() as f64 / 4.0).min(4000.0);
    let fits = |strength: f64| {
        let made = stage(&plan, family.at(strength));
        let holds = plan.iter().zip(&made).all(|(p, s)| (0..2).all(|k| (p[k] - s[k]).abs() <= room.half_field[k]));
        (made, holds)
    };
    let focused = |strength: f64| {
        let made = stage(&height, family.at(strength));
        let holds =
            height.iter().zip(&made).zip(&even.on).all(|((p, s), &on)| !on || (p[0] - s[0]).abs() <= room.focus);
        (made, holds)
    };
    let xy = largest(start, 0.8, 1.0, 0.5, fits);
    let z = largest(start, 0.8, 1.0, 0.5, focused);
    let strength = [xy.as_ref().map_or(0.0, |r| r.strength), z.as_ref().map_or(0.0, |r| r.strength)];
    let (xy, z) = (xy.map_or(plan, |r| r.found), z.map_or(height, |r| r.found));
    (xy.into_iter().zip(z).map(|([x, y], [z])| [x, y, z]).collect(), Some(strength))
}
