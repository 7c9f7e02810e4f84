//! The same path taken apart for scanner and stage by every decomposition there is.

use terrace_core::machine::Machine;
use terrace_core::parallel;
use terrace_plan::on_the_fly::decompose::{Family, largest, paced, peak, rms_acceleration, stage, within};
use terrace_plan::on_the_fly::path::Path;
use terrace_plan::on_the_fly::path::schedule::{Samples, Schedule};
use terrace_plan::on_the_fly::xyzuv::{Peaks, ScannerLimits};

/// A decomposition of the path, as strong as field and focus allow, in figures.
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
    let judge = StageJudge { even: &even, limits, total_s: schedule.total_s() };
    let (filtered, least): (Vec<_>, _) = parallel::both(
        || parallel::map(FAMILIES.len(), |i| filtered(&even, FAMILIES[i].1, allowed)),
        || least(&even, allowed),
    );
    let mut out: Vec<Filter> = FAMILIES
        .iter()
        .zip(&filtered)
        .map(|((name, _), filtered)| judge.figures(name, &filtered.stage, Some(filtered.strength)))
        .collect();
    out.push(judge.figures("least acceleration", &least, None));
    let rms = |stage: &[[f64; 3]]| rms_acceleration(stage, even.step_s);
    let best = filtered.iter().map(|f| &f.stage).min_by(|a, b| rms(a).total_cmp(&rms(b)));
    if let Some(start) = best.filter(|best| judge.slower(best) < judge.slower(&least)) {
        let no_slower = no_slower(&even, allowed, start, limits, judge.slower(start));
        out.push(judge.figures("the same, no slower", &no_slower, None));
    }
    out
}

/// What the stages of one path are judged by.
struct StageJudge<'a> {
    /// The path at even steps.
    even: &'a Samples,
    /// What X, Y and Z can do; jerk is not limited.
    limits: [Peaks; 3],
    /// Time of the path at the pens' speeds, s.
    total_s: f64,
}

impl StageJudge<'_> {
    /// How many times slower than the pens ask for a stage must run.
    fn slower(&self, stage: &[[f64; 3]]) -> f64 {
        (0..3).map(|k| Peaks::of(stage, k, self.even.step_s).slowed(&self.limits[k])).fold(1.0, f64::max)
    }

    /// The figures of a stage; `strength` in samples.
    fn figures(&self, name: &'static str, stage: &[[f64; 3]], strength: Option<[f64; 2]>) -> Filter {
        let even = self.even;
        let left: Vec<[f64; 2]> = even.at.iter().zip(stage).map(|(b, s)| [b[0] - s[0], b[1] - s[1]]).collect();
        let marks = even.at.iter().zip(stage).zip(&even.on).filter(|(_, on)| **on);
        Filter {
            name,
            strength_ms: strength.map(|s| s.map(|v| v * even.step_s * 1000.0)),
            reach_mm: peak(&left),
            focus_um: 1000.0 * marks.map(|((b, s), _)| (b[2] - s[2]).abs()).fold(0.0, f64::max),
            rms_acceleration: rms_acceleration(stage, even.step_s),
            peak_acceleration: (0..3).map(|k| Peaks::of(stage, k, even.step_s).acceleration).fold(0.0, f64::max),
            time_s: self.total_s * self.slower(stage),
        }
    }
}

/// Between what ends a stage may be along an axis: in plan the scanner's field, in height the focus where it is
/// marked.
fn ends(even: &Samples, allowed: ScannerLimits, axis: usize) -> Vec<[f64; 2]> {
    let half = [allowed.half_field[0], allowed.half_field[1], allowed.half_depth][axis];
    let reach = |on: bool| if on || axis < 2 { half } else { f64::INFINITY };
    even.at.iter().zip(&even.on).map(|(p, &on)| [p[axis] - reach(on), p[axis] + reach(on)]).collect()
}

/// Three coordinates as positions.
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

/// The stage of a filter.
struct FilteredStage {
    stage: Vec<[f64; 3]>,
    /// Strength in plan and in height, samples.
    strength: [f64; 2],
}

/// A filter in plan and in height, each as strong as it may be.
fn filtered(even: &Samples, family: Family, allowed: ScannerLimits) -> FilteredStage {
    let plan: Vec<[f64; 2]> = even.at.iter().map(|p| [p[0], p[1]]).collect();
    let height: Vec<[f64; 1]> = even.at.iter().map(|p| [p[2]]).collect();
    // Longer than the whole path nothing changes any more; half a thousandth of it is a start that is too strong
    // where the scanner has anything to do.
    let start = (even.at.len() as f64 / 4.0).min(4000.0);
    let xy = largest(start, 0.8, 1.0, 0.5, |strength| {
        let smooth = stage(&plan, family.at(strength));
        let is_in_field = is_within_field(&plan, &smooth, allowed.half_field);
        (smooth, is_in_field)
    });
    let z = largest(start, 0.8, 1.0, 0.5, |strength| {
        let smooth = stage(&height, family.at(strength));
        let is_in_focus = is_in_focus(&height, &smooth, &even.on, allowed.half_depth);
        (smooth, is_in_focus)
    });
    let strength = [xy.as_ref().map_or(0.0, |r| r.strength), z.as_ref().map_or(0.0, |r| r.strength)];
    let xy = xy.map_or_else(|| plan.clone(), |r| r.found);
    let z = z.map_or_else(|| height.clone(), |r| r.found);
    FilteredStage { stage: xy.into_iter().zip(z).map(|([x, y], [z])| [x, y, z]).collect(), strength }
}

/// Whether what a stage leaves of a path in plan lies in the field at all samples.
fn is_within_field(path: &[[f64; 2]], stage: &[[f64; 2]], half_field: [f64; 2]) -> bool {
    path.iter().zip(stage).all(|(p, s)| (0..2).all(|k| (p[k] - s[k]).abs() <= half_field[k]))
}

/// Whether what a stage leaves of the heights of a path is in focus at all samples that mark.
fn is_in_focus(path: &[[f64; 1]], stage: &[[f64; 1]], on: &[bool], half_depth: f64) -> bool {
    path.iter().zip(stage).zip(on).all(|((p, s), &on)| !on || (p[0] - s[0]).abs() <= half_depth)
}
