//! The same path taken apart for scanner and stage by every decomposition there is.

use terrace_core::machine::Machine;
use terrace_core::parallel;
use terrace_plan::on_the_fly::decompose::{Family, largest, paced, peak, rms_acceleration, stage, within};
use terrace_plan::on_the_fly::path::Path;
use terrace_plan::on_the_fly::path::schedule::{Samples, Schedule};
use terrace_plan::on_the_fly::xyzuv::{Peaks, ScannerLimits};

/// What a decomposition makes of the path, as strong as field and focus allow.
#[derive(Clone, Debug, PartialEq)]
pub struct Filter {
    /// The name of the filter.
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

/// The filters that are compared.
pub(super) const FAMILIES: [(&str, Family); 2] =
    [("moving average", Family::MovingAverage), ("Gaussian", Family::Gaussian)];

/// All decompositions of one path, that of least acceleration after the filters; where the best filter, of least
/// acceleration among them, is quicker, the one that takes no more time than it comes last.
pub(super) fn filters(
    path: &Path,
    schedule: &Schedule,
    machine: &Machine,
    allowed: ScannerLimits,
    step_s: f64,
) -> Vec<Filter> {
    let even = schedule.samples(path, step_s);
    let limits = Peaks::limits(machine).map(|l| Peaks { jerk: f64::INFINITY, ..l });
    let slower =
        |made: &[[f64; 3]]| (0..3).map(|k| Peaks::of(made, k, even.step_s).slowed(&limits[k])).fold(1.0, f64::max);
    let described = |name: &'static str, made: &[[f64; 3]], strength: Option<[f64; 2]>| {
        let left: Vec<[f64; 2]> = even.at.iter().zip(made).map(|(b, s)| [b[0] - s[0], b[1] - s[1]]).collect();
        let marks = even.at.iter().zip(made).zip(&even.on).filter(|(_, on)| **on);
        Filter {
            name,
            strength_ms: strength.map(|s| s.map(|v| v * even.step_s * 1000.0)),
            reach_mm: peak(&left),
            focus_um: 1000.0 * marks.map(|((b, s), _)| (b[2] - s[2]).abs()).fold(0.0, f64::max),
            rms_acceleration: rms_acceleration(made, even.step_s),
            peak_acceleration: (0..3).map(|k| Peaks::of(made, k, even.step_s).acceleration).fold(0.0, f64::max),
            time_s: schedule.total_s() * slower(made),
        }
    };
    let (made, least): (Vec<_>, _) = parallel::both(
        || parallel::map(FAMILIES.len(), |i| filtered(&even, FAMILIES[i].1, allowed)),
        || least(&even, allowed),
    );
    let mut out: Vec<Filter> = FAMILIES
        .iter()
        .zip(&made)
        .map(|((name, _), (made, strength))| described(name, made, Some(*strength)))
        .collect();
    out.push(described("least acceleration", &least, None));
    let rms = |made: &[[f64; 3]]| rms_acceleration(made, even.step_s);
    let best = made.iter().map(|m| &m.0).min_by(|a, b| rms(a).total_cmp(&rms(b)));
    if let Some(start) = best.filter(|best| slower(best) < slower(&least)) {
        let no_slower = no_slower(&even, allowed, start, limits, slower(start));
        out.push(described("the same, no slower", &no_slower, None));
    }
    out
}

/// Between what ends a stage may be along an axis: in plan the scanner's field, in height the focus where it is
/// marked.
fn ends(even: &Samples, allowed: ScannerLimits, axis: usize) -> Vec<[f64; 2]> {
    let half = [allowed.half_field[0], allowed.half_field[1], allowed.focus][axis];
    let far = |on: bool| if on || axis < 2 { half } else { f64::INFINITY };
    even.at.iter().zip(&even.on).map(|(p, &on)| [p[axis] - far(on), p[axis] + far(on)]).collect()
}

fn joined(axes: [Vec<f64>; 3]) -> Vec<[f64; 3]> {
    let [x, y, z] = axes;
    x.into_iter().zip(y).zip(z).map(|((x, y), z)| [x, y, z]).collect()
}

/// The stage of least acceleration.
fn least(even: &Samples, allowed: ScannerLimits) -> Vec<[f64; 3]> {
    joined([0, 1, 2].map(|k| within(even.at.iter().map(|p| p[k]).collect(), &[], &ends(even, allowed, k))))
}

/// The stage of least acceleration within what a stage of a filter needs, or the axes can do when all is `slower`.
fn no_slower(
    even: &Samples,
    allowed: ScannerLimits,
    start: &[[f64; 3]],
    limits: [Peaks; 3],
    slower: f64,
) -> Vec<[f64; 3]> {
    // A start must keep the limits strictly.
    const INSIDE: f64 = 1.001;
    let h = even.step_s;
    joined([0, 1, 2].map(|k| {
        let most = [limits[k].speed * slower * h, limits[k].acceleration * (slower * h).powi(2)].map(|m| m * INSIDE);
        paced(&start.iter().map(|p| p[k]).collect::<Vec<_>>(), &ends(even, allowed, k), most)
    }))
}

/// A filter in plan and in height, each as strong as it may be; strengths in samples.
fn filtered(even: &Samples, family: Family, allowed: ScannerLimits) -> (Vec<[f64; 3]>, [f64; 2]) {
    let plan: Vec<[f64; 2]> = even.at.iter().map(|p| [p[0], p[1]]).collect();
    let height: Vec<[f64; 1]> = even.at.iter().map(|p| [p[2]]).collect();
    // Longer than the whole path nothing changes any more; half a thousandth of it is a start that is too strong
    // where the scanner has anything to do.
    let start = (even.at.len() as f64 / 4.0).min(4000.0);
    let fits = |strength: f64| {
        let made = stage(&plan, family.at(strength));
        let holds = plan.iter().zip(&made).all(|(p, s)| (0..2).all(|k| (p[k] - s[k]).abs() <= allowed.half_field[k]));
        (made, holds)
    };
    let focused = |strength: f64| {
        let made = stage(&height, family.at(strength));
        let holds =
            height.iter().zip(&made).zip(&even.on).all(|((p, s), &on)| !on || (p[0] - s[0]).abs() <= allowed.focus);
        (made, holds)
    };
    let xy = largest(start, 0.8, 1.0, 0.5, fits);
    let z = largest(start, 0.8, 1.0, 0.5, focused);
    let strength = [xy.as_ref().map_or(0.0, |r| r.strength), z.as_ref().map_or(0.0, |r| r.strength)];
    let (xy, z) = (xy.map_or_else(|| plan.clone(), |r| r.found), z.map_or_else(|| height.clone(), |r| r.found));
    (xy.into_iter().zip(z).map(|([x, y], [z])| [x, y, z]).collect(), strength)
}
