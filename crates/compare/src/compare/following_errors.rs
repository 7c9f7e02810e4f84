//! Following errors of every axis with seven axes beside those with five, as a table and as charts.
//!
//! # Source
//! Ma et al. (2025) report the mean following error of every axis with seven axes beside that with five. An axis with a
//! velocity lag is behind its command by a time constant times its speed, so its mean error follows its mean speed,
//! way S by time T, and falls by 1 - (S7 / S5) (T5 / T7).
//!
//! # Limits
//! That rule holds where the speed changes slowly against the time constant of the servo.

use super::axis_errors::AxisErrors;
use super::system::{Kind, SYSTEMS};
use super::{Comparison, charts};
use terrace_plan::on_the_fly::axes::motion::AXES;
use terrace_report::report::plot::Plot;
use terrace_report::report::table::{Cell, Column, Table};

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

/// The turning systems of a kind, with the errors of their axes.
fn systems(c: &Comparison, kind: Kind) -> impl Iterator<Item = (&'static str, &AxisErrors)> {
    let is_kind = move |name: &str| SYSTEMS.iter().any(|s| s.name == name && s.kind == kind);
    let rows = c.rows.iter().filter(move |row| is_kind(row.system));
    rows.filter_map(|row| Some((row.system, row.figures.as_ref().ok()?.axis_errors.as_ref()?)))
}

/// The following error of every axis with seven axes beside that with five; None where no such system applies.
pub(super) fn table(c: &Comparison) -> Option<Table> {
    let mut columns = ["system", "axis", "way unit"].map(Column::text).to_vec();
    columns.extend(["way", "5-axis way"].map(|name| Column::number(name, "", 1)));
    columns.push(Column::text("error unit"));
    columns.extend(["mean", "5-axis mean", "worst", "5-axis worst"].map(|name| Column::number(name, "", 3)));
    columns.extend(["fall of mean", "fall of worst", "fall by mean speed"].map(Column::share));
    let mut table = Table::new("Following errors of the axes with seven axes beside five", columns);
    let five = systems(c, Kind::FiveAxes).next().map(|(_, errors)| errors);
    let mut any = false;
    for (system, seven) in systems(c, Kind::SevenAxes) {
        for (k, (axis, way, error, scale)) in NAMES.into_iter().enumerate() {
            // With five axes the scanner does not move.
            let five = five.filter(|f| f.way[k] > 0.0);
            let fall = |figure: &dyn Fn(&AxisErrors) -> f64| {
                Cell::from(five.map(|f| 100.0 * (1.0 - figure(seven) / figure(f))))
            };
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
    let seven = systems(c, Kind::SevenAxes).find(|(name, _)| *name == "7-axis");
    let seven = seven.map(|(_, errors)| ("following-7-axis", chart("Seven", errors, AXES)));
    let five = systems(c, Kind::FiveAxes).next();
    let five = five.map(|(_, errors)| ("following-5-axis", chart("Five", errors, 5)));
    seven.into_iter().chain(five).collect()
}

/// The errors of the first `axes` axes over time at the start of the path.
fn chart(number: &str, errors: &AxisErrors, axes: usize) -> Plot {
    let title = format!("{number} axes: following errors at the start of the path");
    let names = NAMES.map(|(name, _, unit, _)| (name, unit));
    let scaled = |(t, e): &(f64, [f64; AXES])| (*t, std::array::from_fn::<f64, AXES, _>(|k| NAMES[k].3 * e[k]));
    let samples: Vec<_> = errors.first.iter().map(scaled).collect();
    charts::over_time(title, &names[..axes], &samples)
}
