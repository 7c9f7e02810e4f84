//! Charts after those of the articles: the seven-axis path in space with its tool vectors (Ma et al. 2025, Fig. 9), and
//! the velocities of a synchronised stage and scanner (Cui et al. 2021, Fig. 3). Units: mm, s.

use super::Curves;
use terrace_core::math;
use terrace_report::report::plot::{Axis, LineChart, Panel, Paths, Plot, Series};

/// Tool vectors that are drawn at most, and their length as a share of the picture's diagonal.
const VECTORS: usize = 250;
const LENGTH: f64 = 0.08;

/// A point as it is seen along (-1, 1, -1), isometric: x goes down to the right, y up to the right, z up.
fn seen([x, y, z]: [f64; 3]) -> [f64; 2] {
    [(x + y) / 2f64.sqrt(), (y - x + 2.0 * z) / 6f64.sqrt()]
}

/// The start of the seven-axis path in space; None where there was none.
pub(super) fn space(curves: &Curves) -> Option<Plot> {
    let nodes = &curves.space;
    let marks: Vec<[f64; 2]> = nodes.iter().map(|[mark, ..]| seen(*mark)).collect();
    let first = marks.first()?;
    let ends = marks
        .iter()
        .fold([*first; 2], |[lo, hi], p| [[lo[0].min(p[0]), lo[1].min(p[1])], [hi[0].max(p[0]), hi[1].max(p[1])]]);
    let length = LENGTH * math::hypot(ends[1][0] - ends[0][0], ends[1][1] - ends[0][1]);
    let vector = |[_, tool, axis]: &[[f64; 3]; 3]| {
        let tip = [0, 1, 2].map(|k| tool[k] + length * axis[k]);
        [seen(*tool), seen(tip), [f64::NAN; 2]]
    };
    let series = vec![
        Series::new("marks", marks.clone()),
        Series::new("tool vectors", nodes.iter().step_by(nodes.len().div_ceil(VECTORS)).flat_map(vector).collect()),
        Series::new("smoothed path", nodes.iter().map(|[_, tool, _]| seen(*tool)).collect()),
    ];
    let title = "Seven axes: the start of the path in space, with tool vectors".into();
    let (x, y) = ("right: (x + y) / sqrt 2".into(), "up: (y - x + 2 z) / sqrt 6".into());
    Some(Paths { title, x, y, unit: "mm".into(), series }.draw())
}

/// Velocities of stage and scanner over the start of the path; None where nothing was synchronised.
pub(super) fn velocities(curves: &Curves) -> Option<Plot> {
    if curves.velocities.is_empty() {
        return None;
    }
    let names = ["stage X", "stage Y", "stage Z", "scanner U", "scanner V"].map(|name| (name, "mm/s"));
    let title = "Scanner and stage synchronised: velocities at the start of the path".into();
    Some(over_time(title, &names, &curves.velocities))
}

/// Quantities over time, s, each with its name and its unit, in a panel of its own.
pub(super) fn over_time<const N: usize>(title: String, names: &[(&str, &str)], samples: &[(f64, [f64; N])]) -> Plot {
    let panel = |(k, (name, unit)): (usize, &(&str, &str))| {
        let points = samples.iter().map(|(t, values)| [*t, values[k]]).collect();
        Panel { y: Axis::new(name, unit), series: vec![Series::new("", points)], limits: Vec::new() }
    };
    let panels = names.iter().enumerate().map(panel).collect();
    LineChart { title, x: Axis::new("time", "s"), panels, limits: Vec::new() }.draw()
}
