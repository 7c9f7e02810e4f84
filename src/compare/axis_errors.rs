//! Following errors of every axis over a motion, and how much smaller they are with seven axes than with five.
//!
//! Consumes commands and positions of X, Y, Z, A, C, U and V at even steps of time; promises the way of every axis, the
//! mean and the largest size of its following error over the whole motion, jumps included, and its course at the start
//! of the path. Units: mm, rad, s.
//!
//! # Source
//! Ma et al. (2025) report the mean following error of every axis with seven axes beside that with five. An axis with a
//! velocity lag is behind its command by a time constant times its speed, so its mean error follows its mean speed,
//! way S by time T, and falls by 1 - (S7 / S5) (T5 / T7).
//!
//! # Limits
//! That rule holds where the speed changes slowly against the time constant of the servo.

use super::{Comparison, system::Kind};
use crate::on_the_fly::axes::motion::AXES;
use crate::report::plot::{Axis, LineChart, Panel, Plot, Series};
use crate::report::table::{Cell, Column, Table};

/// Name and units of every axis: of its way and of its error, with how many of the latter a mm or a radian is.
const NAMES: [(&str, &str, &str, f64); AXES] = [
    ("X", "mm", "um", 1e3),
    ("Y", "mm", "um", 1e3),
    ("Z", "mm", "um", 1e3),
    ("A", "deg", "mdeg", 180e3 / std::f64::consts::PI),
    ("C", "deg", "mdeg", 180e3 / std::f64::consts::PI),
    ("U", "mm", "um", 1e3),
    ("V", "mm", "um", 1e3),
];

/// Following errors of every axis of a motion.
#[derive(Clone, Debug, Default)]
pub struct AxisErrors {
    /// Way of the commands.
    way: [f64; AXES],
    /// Size of the error, summed over the samples.
    sum: [f64; AXES],
    /// Largest size of the error.
    worst: [f64; AXES],
    /// Step between two samples, s.
    step_s: f64,
    samples: usize,
    last: Option<[f64; AXES]>,
    /// Time and errors with their signs, of the samples up to `until_s`.
    first: Vec<(f64, [f64; AXES])>,
    until_s: f64,
}

impl AxisErrors {
    /// Of no samples yet, which will be `step_s` apart; their course is kept up to `until_s`.
    pub(super) fn new(step_s: f64, until_s: f64) -> Self {
        Self { step_s, until_s, ..Self::default() }
    }

    /// Adds a sample: what the axes are commanded, and how far each is behind that.
    pub(super) fn add(&mut self, commands: [f64; AXES], errors: [f64; AXES]) {
        let last = self.last.replace(commands).unwrap_or(commands);
        for k in 0..AXES {
            self.way[k] += (commands[k] - last[k]).abs();
            self.sum[k] += errors[k].abs();
            self.worst[k] = self.worst[k].max(errors[k].abs());
        }
        let time = self.samples as f64 * self.step_s;
        if time <= self.until_s {
            self.first.push((time, errors));
        }
        self.samples += 1;
    }

    /// Mean size of an axis's error.
    fn mean(&self, axis: usize) -> f64 {
        self.sum[axis] / self.samples.max(1) as f64
    }

    /// Mean size of an axis's speed.
    fn speed(&self, axis: usize) -> f64 {
        self.way[axis] / (self.samples.saturating_sub(1) as f64 * self.step_s)
    }
}

/// The turning systems of a kind, with the errors of their axes.
fn of(c: &Comparison, kind: Kind) -> impl Iterator<Item = (&'static str, &AxisErrors)> {
    let is_kind = move |name: &str| super::SYSTEMS.iter().any(|s| s.name == name && s.kind == kind);
    let rows = c.rows.iter().filter(move |row| is_kind(row.system));
    rows.filter_map(|row| Some((row.system, row.figures.as_ref().ok()?.axis_errors.as_ref()?)))
}

/// Of every axis its following error with seven axes beside that with five; None where no such system applies.
pub(super) fn table(c: &Comparison) -> Option<Table> {
    let mut columns = ["system", "axis", "way unit"].map(Column::text).to_vec();
    columns.extend(["way", "5-axis way"].map(|name| Column::number(name, "", 1)));
    columns.push(Column::text("error unit"));
    columns.extend(["mean", "5-axis mean", "worst", "5-axis worst"].map(|name| Column::number(name, "", 3)));
    columns.extend(["fall of mean", "fall of worst", "fall by mean speed"].map(Column::share));
    let mut table = Table::new("Following errors of the axes with seven axes beside five", columns);
    let five = of(c, Kind::FiveAxes).next().map(|(_, errors)| errors);
    let mut any = false;
    for (system, seven) in of(c, Kind::SevenAxes) {
        for (k, (axis, way, error, scale)) in NAMES.into_iter().enumerate() {
            // With five axes the scanner does not move.
            let five = five.filter(|f| f.way[k] > 0.0);
            let fall = |of: &dyn Fn(&AxisErrors) -> f64| Cell::from(five.map(|f| 100.0 * (1.0 - of(seven) / of(f))));
            let degrees = if way == "deg" { 1f64.to_degrees() } else { 1.0 };
            let mut cells = [system, axis, way].map(Cell::from).to_vec();
            cells.extend([(degrees * seven.way[k]).into(), five.map(|f| degrees * f.way[k]).into(), error.into()]);
            cells.extend([(scale * seven.mean(k)).into(), five.map(|f| scale * f.mean(k)).into()]);
            cells.extend([(scale * seven.worst[k]).into(), five.map(|f| scale * f.worst[k]).into()]);
            cells.extend([fall(&|e| e.mean(k)), fall(&|e| e.worst[k]), fall(&|e| e.speed(k))]);
            table.push(cells);
            any = true;
        }
    }
    any.then_some(table)
}

/// Following errors over time at the start of the path, of the article's system and of five axes, each with the name of
/// its file.
pub(super) fn plots(c: &Comparison) -> Vec<(&'static str, Plot)> {
    let seven = of(c, Kind::SevenAxes).find(|(name, _)| *name == "7-axis").map(|(_, e)| ("following-7-axis", e, AXES));
    let five = of(c, Kind::FiveAxes).next().map(|(_, e)| ("following-5-axis", e, 5));
    let chart = |(file, errors, axes): (&'static str, &AxisErrors, usize)| {
        let panel = |k: usize| {
            let (name, _, unit, scale) = NAMES[k];
            let points = errors.first.iter().map(|(t, e)| [*t, scale * e[k]]).collect();
            Panel { y: Axis::new(name, unit), series: vec![Series::new("", points)], limits: Vec::new() }
        };
        let title =
            format!("{} axes: following errors at the start of the path", ["Five", "Seven"][usize::from(axes > 5)]);
        let (x, panels) = (Axis::new("time", "s"), (0..axes).map(panel).collect());
        (file, LineChart { title, x, panels, limits: Vec::new() }.draw())
    };
    seven.into_iter().chain(five).map(chart).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_averaged_over_the_samples_and_ways_are_summed() {
        let mut errors = AxisErrors::new(0.5, 1.0);
        for (i, at) in [0.0, 2.0, 1.0, 1.0].into_iter().enumerate() {
            let mut command = [0.0; AXES];
            let mut error = [0.0; AXES];
            (command[0], error[0], error[4]) = (at, if i % 2 == 0 { 0.1 } else { -0.3 }, 0.01);
            errors.add(command, error);
        }
        assert!((errors.mean(0) - 0.2).abs() < 1e-15 && errors.worst[0] == 0.3 && errors.way[0] == 3.0);
        assert!((errors.speed(0) - 2.0).abs() < 1e-15, "3 mm in 1.5 s");
        assert!((errors.mean(4) - 0.01).abs() < 1e-15 && errors.way[4] == 0.0);
        let times: Vec<f64> = errors.first.iter().map(|(t, _)| *t).collect();
        assert_eq!(times, [0.0, 0.5, 1.0]);
    }
}
