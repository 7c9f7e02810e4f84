//! The methods of partition that a job is planned by, the stops of each, and the choice between them.

use super::methods::{METHODS, row};
use super::site::Site;
use crate::partition::Stops;
use terrace_core::diag::{Diag, Error};
use terrace_core::machine::Machine;
use terrace_core::progress::Task;
use terrace_input::job::{Job, Method, Objective};

/// The methods that a job asks for and the machine can run.
///
/// # Errors
/// `tilt-missing`.
pub(super) fn methods(job: &Job, machine: &Machine) -> Result<Vec<Method>, Error> {
    match job.partition.method {
        Method::Auto => Ok(METHODS.iter().filter(|row| (row.is_tried)(job, machine)).map(|row| row.method).collect()),
        Method::Tilt if machine.tilt.is_none() => {
            let text = "partition.method = \"tilt\" needs a machine with tilt axes";
            let hint = "describe them under [tilt] in the machine file, or use another method";
            Err(Diag::limit("tilt-missing", text).at(job.place_of("partition.method")).hint(hint).into())
        }
        one => Ok(vec![one]),
    }
}

/// The stops of a method; None where it cannot be used on this job.
pub(super) fn divide(site: &Site<'_>, method: Method, task: Task<'_>) -> Option<Stops> {
    (row(method).divide)(site, task)
}

/// The stops of each of `methods`, those left out that cannot be used or cannot win.
///
/// # Errors
/// `window-wide`.
pub(super) fn stops(
    site: &Site<'_>,
    methods: &[Method],
    objective: Objective,
    task: Task<'_>,
) -> Result<Vec<(Method, Stops)>, Error> {
    let mut stops_by_method: Vec<(Method, Stops)> = Vec::new();
    for (&method, task) in methods.iter().zip(task.parts(methods.len())) {
        // `auto` divides by the grid before it tries windows: the last stops are those of the grid.
        let hopeless = method == Method::Window
            && objective == Objective::Time
            && stops_by_method.last().is_some_and(|(_, grid)| site.windows_cannot_win(grid));
        if !hopeless {
            stops_by_method.extend(divide(site, method, task).map(|stops| (method, stops)));
        }
    }
    if stops_by_method.is_empty() {
        let text = "the texture's box is too wide for this method and this field";
        return Err(Diag::limit("window-wide", text).hint("use partition.method = \"z-range\"").into());
    }
    Ok(stops_by_method)
}

/// The candidate of one method, and the first invariant that its program breaks.
pub(super) struct Trial<T> {
    pub(super) method: Method,
    pub(super) candidate: T,
    pub(super) fault: Option<Diag>,
}

/// Drops candidates that take more than another sound one: they cannot be chosen, whatever is tried next, and their
/// programs are large.
pub(super) fn drop_worse<T, M: PartialOrd>(trials: &mut Vec<Trial<T>>, measure: impl Fn(&T) -> M) {
    let sound = trials.iter().filter(|trial| trial.fault.is_none());
    let measures: Vec<M> = sound.map(|trial| measure(&trial.candidate)).collect();
    // Faults are kept: they are reported in the end.
    trials
        .retain(|Trial { candidate, fault, .. }| fault.is_some() || !measures.iter().any(|m| *m < measure(candidate)));
}

/// The candidate of the least measure. One that breaks an invariant is a fault of ours: where another method
/// gives a sound program it is left out, with a warning; where none does, the faults are the answer.
pub(super) fn best_of<T>(
    trials: Vec<Trial<T>>,
    measure: impl Fn(&T) -> (f64, f64),
    warnings: &mut Vec<Diag>,
) -> Result<T, Error> {
    let mut best: Option<T> = None;
    let mut faults: Vec<(Method, Diag)> = Vec::new();
    for Trial { method, candidate, fault } in trials {
        match fault {
            Some(fault) => faults.push((method, fault)),
            None if best.as_ref().is_none_or(|b| measure(&candidate) < measure(b)) => best = Some(candidate),
            None => {}
        }
    }
    let Some(best) = best else {
        let none = || Diag::bug("no-candidate", "no method was tried");
        let faults: Vec<Diag> = faults.into_iter().map(|(_, fault)| fault).collect();
        return Err(if faults.is_empty() { none().into() } else { Error::many(faults) });
    };
    warnings.extend(faults.into_iter().map(|(method, fault)| {
        let text = format!("method {} is skipped because of a bug in terrace: {}", method.name(), fault.message);
        let hint = "the program of the chosen method is valid; please report this with the job file";
        Diag::warning("method-left-out", text).at(fault.place).hint(hint)
    }));
    Ok(best)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn trial(method: Method, candidate: f64, fault: Option<Diag>) -> Trial<f64> {
        Trial { method, candidate, fault }
    }

    #[test]
    fn a_candidate_that_takes_more_is_dropped() {
        let fault = || Some(Diag::bug("program-invariant", "P2: out of the field"));
        let mut trials = vec![
            trial(Method::Contour, 3.0, None),
            trial(Method::ZRange, 3.0, None),
            trial(Method::Window, 4.0, None),
            trial(Method::Tilt, 1.0, fault()),
        ];
        drop_worse(&mut trials, |&time| time);
        let left: Vec<Method> = trials.iter().map(|trial| trial.method).collect();
        assert_eq!(left, [Method::Contour, Method::ZRange, Method::Tilt], "of equal ones the first is chosen later");
        trials.push(trial(Method::Window, 2.0, None));
        drop_worse(&mut trials, |&time| time);
        let left: Vec<Method> = trials.iter().map(|trial| trial.method).collect();
        assert_eq!(left, [Method::Tilt, Method::Window]);
    }

    #[test]
    fn auto_drops_a_method_whose_program_fails_the_check_with_a_warning() {
        let fault = || Some(Diag::bug("program-invariant", "P2: out of the field"));
        let cost = |&time: &f64| (time, 0.0);
        let mut warnings = Vec::new();
        let sound =
            vec![trial(Method::ZRange, 3.0, None), trial(Method::Tilt, 1.0, fault()), trial(Method::Window, 2.0, None)];
        let best = best_of(sound, cost, &mut warnings).expect("two are sound");
        assert_eq!(best, 2.0, "the cheapest of the sound ones");
        assert_eq!(warnings.len(), 1);
        assert_eq!((warnings[0].code, warnings[0].kind), ("method-left-out", terrace_core::diag::Kind::Warning));
        assert!(warnings[0].message.contains("tilt") && warnings[0].message.contains("P2: out of the field"));
        let broken = vec![trial(Method::ZRange, 3.0, fault()), trial(Method::Tilt, 1.0, fault())];
        let error = best_of(broken, cost, &mut Vec::new()).expect_err("none is sound");
        assert!(error.diags().iter().all(|d| d.kind == terrace_core::diag::Kind::Bug) && error.diags().len() == 2);
    }
}
