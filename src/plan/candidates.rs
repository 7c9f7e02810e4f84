//! The methods of partition that a job is planned by, and the stops of each.

use super::grid::Grid;
use super::methods::{METHODS, row};
use super::stroke_chunks::Sweep;
use crate::diag::{Diag, Error};
use crate::job::{Job, Method, Objective};
use crate::machine::{Commanded, Machine};
use crate::motion;
use crate::partition::{self, Fine, Lattice, Stops};
use crate::program::{PassId, Sections};
use crate::projection::Footprint;

/// The methods that a job asks for and the machine can run.
///
/// # Errors
/// `tilt-missing`.
pub(super) fn methods(job: &Job, machine: &Machine) -> Result<Vec<Method>, Error> {
    match job.partition.method {
        Method::Auto => Ok(METHODS.iter().filter(|row| (row.is_tried)(job, machine)).map(|row| row.method).collect()),
        Method::Tilt if machine.tilt.is_none() => {
            let text = "partition.method = \"tilt\" needs a machine with a tilt table";
            let hint = "describe the table under [tilt] in the machine file, or use another method";
            Err(Diag::limit("tilt-missing", text).at(job.place_of("partition.method")).hint(hint).into())
        }
        one => Ok(vec![one]),
    }
}

/// What stops are chosen from.
pub(super) struct Site<'a> {
    pub(super) sweep: Sweep<'a>,
    pub(super) machine: &'a Machine,
    pub(super) grid: &'a Grid,
    pub(super) footprint: &'a Footprint,
    /// What two stops may both mark at a cut, nm.
    pub(super) overlap: i64,
    /// The pass, from 0.
    pub(super) pass: PassId,
}

impl Site<'_> {
    /// The stops of a method; None where it cannot be used on this job.
    pub(super) fn divide(&self, method: Method) -> Option<Stops> {
        (row(method).divide)(self)
    }

    pub(super) fn on_sections(&self, divide: fn(&Footprint, &Sections, [i64; 2], &Lattice) -> Stops) -> Stops {
        let Grid { sections, window, lattice, .. } = self.grid;
        divide(self.footprint, sections, *window, lattice)
    }

    pub(super) fn free_windows(&self) -> Option<Stops> {
        let Grid { sections, window, lattice, keep, .. } = self.grid;
        let (lowest, _) = self.footprint.range()?;
        let fine = Fine::over(sections, *window, lattice, lowest)?;
        // Other passes begin in other corners.
        let flips = [1, 2, 1].map(|bit| self.pass.0 & bit != 0);
        let cells = self.sweep.cells(&fine, *keep);
        let free = partition::free(cells, &fine, sections, *window, lattice, self.overlap, flips);
        // Where fields fit the texture exactly, their grid can be the better choice of windows.
        let grid = self.on_sections(partition::z_range);
        Some(if keep.0 == 0 && grid.stops.len() < free.stops.len() { grid } else { free })
    }

    /// The stops of each of `methods`, those left out that cannot be used or cannot win.
    ///
    /// # Errors
    /// `window-wide`.
    pub(super) fn stops(&self, methods: &[Method], objective: Objective) -> Result<Vec<(Method, Stops)>, Error> {
        let mut found: Vec<(Method, Stops)> = Vec::new();
        for &method in methods {
            let hopeless = method == Method::Window
                && objective == Objective::Time
                && found.last().is_some_and(|(_, grid)| self.windows_cannot_win(grid));
            if !hopeless {
                found.extend(self.divide(method).map(|stops| (method, stops)));
            }
        }
        if found.is_empty() {
            let text = "the texture's box is too wide for this method and this field";
            return Err(Diag::limit("window-wide", text).hint("use partition.method = \"z-range\"").into());
        }
        Ok(found)
    }

    /// Whether `auto` may leave free windows out, whose search takes seconds: even with six tenths of the stops
    /// of the grid, fewer than they need on any surface with a dense texture, they would lose, because nearly
    /// all moves of a grid are moves of z alone.
    fn windows_cannot_win(&self, grid: &Stops) -> bool {
        let [w, h] = self.grid.window;
        let time = |to: [i64; 3]| {
            let moved = motion::stage_move(self.machine, Commanded::default(), Commanded(to), None);
            moved.travel_s + moved.settle_s
        };
        let (xy, z) = (time([w, h, 0]), time([0, 0, self.grid.lattice.depth]));
        let sections = (0..self.grid.sections.len()).filter(|&i| self.footprint.is_used(i)).count() as f64;
        let stops = grid.stops.len() as f64;
        0.6 * stops * time([w / 2, h / 2, 0]) > sections * xy + (stops - sections) * z
    }
}

/// The candidate of the least measure. One that breaks an invariant is a fault of ours: where another method
/// gives a sound program it is left out, and the user is told; where none does, the faults are the answer.
pub(super) fn best_of<T>(
    candidates: impl Iterator<Item = (Method, T, Option<Diag>)>,
    measure: impl Fn(&T) -> (f64, f64),
    warnings: &mut Vec<Diag>,
) -> Result<T, Error> {
    let (mut best, mut faults): (Option<T>, Vec<(Method, Diag)>) = (None, Vec::new());
    for (method, made, fault) in candidates {
        match fault {
            Some(fault) => faults.push((method, fault)),
            None if best.as_ref().is_none_or(|b| measure(&made) < measure(b)) => best = Some(made),
            None => {}
        }
    }
    let Some(best) = best else {
        let none = || Diag::bug("no-candidate", "no method was tried");
        let faults: Vec<Diag> = faults.into_iter().map(|(_, fault)| fault).collect();
        return Err(if faults.is_empty() { none().into() } else { Error::many(faults) });
    };
    warnings.extend(faults.into_iter().map(|(method, fault)| {
        let text = format!("method {} is left out, by a fault of terrace: {}", method.name(), fault.message);
        let hint = "the program of the method that is taken is sound; please report this with the job file";
        Diag::warning("method-left-out", text).at(fault.place).hint(hint)
    }));
    Ok(best)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn auto_drops_a_method_whose_program_fails_the_check_with_a_warning() {
        let fault = || Some(Diag::bug("program-invariant", "P2: out of the field"));
        let cost = |&time: &f64| (time, 0.0);
        let mut warnings = Vec::new();
        let sound = [(Method::ZRange, 3.0, None), (Method::Tilt, 1.0, fault()), (Method::Window, 2.0, None)];
        let best = best_of(sound.into_iter(), cost, &mut warnings).expect("two are sound");
        assert_eq!(best, 2.0, "the cheapest of the sound ones");
        assert_eq!(warnings.len(), 1);
        assert_eq!((warnings[0].code, warnings[0].kind), ("method-left-out", crate::diag::Kind::Warning));
        assert!(warnings[0].message.contains("tilt") && warnings[0].message.contains("P2: out of the field"));
        let broken = [(Method::ZRange, 3.0, fault()), (Method::Tilt, 1.0, fault())];
        let error = best_of(broken.into_iter(), cost, &mut Vec::new()).expect_err("none is sound");
        assert!(error.diags().iter().all(|d| d.kind == crate::diag::Kind::Bug) && error.diags().len() == 2);
    }
}
