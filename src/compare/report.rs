//! The comparison as tables, charts and a page.

use super::{Comparison, Figures};
use crate::report::page::{Item, page_html};
use crate::report::plot::{Axis, Bars, Limit, LineChart, Panel, Paths, Plot, Series};
use crate::report::table::{Cell, Column, Table};

/// The table of systems: times, and the worst of everything.
fn systems(c: &Comparison) -> Table {
    let columns = vec![
        Column::text("system"),
        Column::time("total"),
        Column::time("by hand"),
        Column::time("model"),
        Column::time("stage"),
        Column::time("settle"),
        Column::time("zoom"),
        Column::time("mark"),
        Column::time("jump"),
        Column::time("delay"),
        Column::count("stops"),
        Column::number("speed", "%", 1),
        Column::number("texture marked", "m", 2),
        Column::number("worst FOD", "um", 1),
        Column::number("worst BIA", "deg", 2),
        Column::number("worst displacement", "mm", 2),
        Column::number("worst spot error", "um", 1),
        Column::share("within limits"),
        Column::number("seam", "mm", 0),
        Column::number("stitch", "um", 1),
        Column::number("stage way", "m", 1),
        Column::text("note"),
    ];
    let width = columns.len();
    let mut table = Table::new("Systems", columns);
    for row in &c.rows {
        let mut cells: Vec<Cell> = vec![row.system.into()];
        match &row.figures {
            Ok(f) => cells.extend(figures(f)),
            Err(e) => {
                cells.extend((0..width - 2).map(|_| None::<f64>.into()));
                let why = e.diags().iter().map(|d| d.message.as_str()).collect::<Vec<_>>().join("; ");
                cells.push(format!("does not apply: {why}").as_str().into());
            }
        }
        table.push(cells);
    }
    table
}

fn figures(f: &Figures) -> Vec<Cell> {
    let t = &f.time;
    let mut cells: Vec<Cell> = vec![t.total().into(), f.by_hand_s.into(), f.model_s.into()];
    cells.extend(t.parts().map(|(_, s)| Cell::from(s)));
    cells.extend([f.stops.into(), f.speed.into(), (f.marked_mm / 1000.0).into()]);
    cells.extend([f.focus_um.worst, f.incidence_deg.worst, f.displacement_mm.worst].map(Cell::from));
    cells.extend([f.spot_error_um.map(|s| s.worst).into(), f.within.into()]);
    cells.extend([f.seam_mm.into(), f.stitch_um.into(), (f.stage_travel_mm / 1000.0).into()]);
    cells.push(f.notes.join("; ").as_str().into());
    cells
}

/// How each figure of each system is spread over the marks; None where no system applies.
fn deviations(c: &Comparison) -> Option<Table> {
    let mut columns = vec![Column::text("system"), Column::text("figure"), Column::text("unit")];
    columns.extend(["mean", "median", "of 95 %", "worst"].map(|name| Column::number(name, "", 3)));
    let mut table = Table::new("How deviations are spread over the marks", columns);
    let mut any = false;
    for (system, f) in c.rows.iter().filter_map(|r| Some((r.system, r.figures.as_ref().ok()?))) {
        let spreads = [
            ("FOD", "um", Some(f.focus_um)),
            ("BIA", "deg", Some(f.incidence_deg)),
            ("displacement", "mm", Some(f.displacement_mm)),
            ("stage lag", "um", f.stage_lag_um),
            ("focus lag", "um", f.focus_lag_um),
            ("spot error", "um", f.spot_error_um),
        ];
        for (name, unit, spread) in spreads {
            let Some(s) = spread else { continue };
            let figures = [s.mean, s.median, s.p95, s.worst].map(Cell::from);
            table.push([system.into(), name.into(), unit.into()].into_iter().chain(figures).collect());
            any = true;
        }
    }
    any.then_some(table)
}

/// The table of decompositions for scanner and stage; None where none was made.
fn decompositions(c: &Comparison) -> Option<Table> {
    if c.curves.filters.is_empty() {
        return None;
    }
    let mut table = Table::new(
        "Decompositions for scanner and stage, the middle of the path",
        vec![
            Column::text("decomposition"),
            Column::number("strength in plan", "ms", 1),
            Column::number("strength in height", "ms", 1),
            Column::number("scanner in x", "mm", 2),
            Column::number("scanner in y", "mm", 2),
            Column::number("worst FOD", "um", 1),
            Column::number("rms stage acceleration", "mm/s2", 1),
            Column::number("peak stage acceleration", "mm/s2", 1),
            Column::time("time"),
        ],
    );
    for f in &c.curves.filters {
        table.row([
            f.name.into(),
            f.strength_ms.map(|s| s[0]).into(),
            f.strength_ms.map(|s| s[1]).into(),
            f.reach_mm[0].into(),
            f.reach_mm[1].into(),
            f.focus_um.into(),
            f.rms_acceleration.into(),
            f.peak_acceleration.into(),
            f.time_s.into(),
        ]);
    }
    Some(table)
}

/// The table of decompositions for seven axes; None where none was made.
fn shared(c: &Comparison) -> Option<Table> {
    if c.curves.shared.is_empty() {
        return None;
    }
    let mut table = Table::new(
        "Decompositions for seven axes, the first 20 m of path",
        vec![
            Column::text("decomposition"),
            Column::number("strength", "mm", 3),
            Column::number("worst FOD", "um", 1),
            Column::number("worst BIA", "deg", 2),
            Column::number("worst displacement", "mm", 2),
            Column::number("rms stage acceleration", "mm/s2", 1),
            Column::time("least time"),
        ],
    );
    for (name, s) in &c.curves.shared {
        table.row([
            (*name).into(),
            s.strength.into(),
            (s.worst.focus * 1000.0).into(),
            s.worst.angle.to_degrees().into(),
            s.worst.lateral.into(),
            s.rms_acceleration.into(),
            s.time_s.into(),
        ]);
    }
    Some(table)
}

/// All tables, each with the name of its file.
pub fn tables(c: &Comparison) -> Vec<(&'static str, Table)> {
    let all = [
        ("systems", Some(systems(c))),
        ("deviations", deviations(c)),
        ("decompositions", decompositions(c)),
        ("seven-axis-decompositions", shared(c)),
        ("convergence", convergence(c)),
    ];
    all.into_iter().filter_map(|(name, table)| Some((name, table?))).collect()
}

/// How the least time of seven axes converges on finer grids; None where they were not asked for.
fn convergence(c: &Comparison) -> Option<Table> {
    let finest = c.curves.convergence.last()?[1];
    let columns =
        vec![Column::count("cells"), Column::number("least time", "s", 3), Column::number("above the finest", "%", 3)];
    let mut table = Table::new("Seven axes: least time of the first 20 m of path on finer grids", columns);
    for &[cells, time] in &c.curves.convergence {
        table.row([(cells as usize).into(), time.into(), (100.0 * (time / finest - 1.0)).into()]);
    }
    Some(table)
}

/// The charts, each with the name of its file.
pub fn plots(c: &Comparison) -> Vec<(&'static str, Plot)> {
    let applied: Vec<(&str, &Figures)> =
        c.rows.iter().filter_map(|r| Some((r.system, r.figures.as_ref().ok()?))).collect();
    let parts = Figures::default().time.parts().map(|(name, _)| name.to_owned()).to_vec();
    let rows = applied.iter().map(|(n, f)| ((*n).to_owned(), f.time.parts().map(|p| p.1).to_vec())).collect();
    let mut out = vec![("times", Bars { title: "Time".into(), value: Axis::new("time", "s"), parts, rows }.draw())];
    let panel = |y: Axis, series: Vec<Series>, limits: Vec<Limit>| Panel { y, series, limits };
    let limits = c.curves.seven.unwrap_or(c.limits);
    let [focus, angle, field] =
        [limits.focus * 1000.0, limits.angle.to_degrees(), limits.field].map(|v| vec![Limit::new("limit", v)]);
    if !c.curves.back_off.is_empty() {
        let trials = |pick: &dyn Fn(&crate::on_the_fly::axes::kinematics::Deviation) -> f64| {
            let points = c.curves.back_off.iter().map(|r| [r.strength * 1000.0, pick(&r.found)]).collect();
            vec![Series::new("worst of all marks", points).marked()]
        };
        let panels = vec![
            panel(Axis::new("FOD", "um"), trials(&|d| d.focus * 1000.0), focus.clone()),
            panel(Axis::new("BIA", "deg"), trials(&|d| d.angle.to_degrees()), angle.clone()),
            panel(Axis::new("displacement", "mm"), trials(&|d| d.lateral), field.clone()),
        ];
        let title = "Seven axes: how strongly the path may be smoothed".into();
        out.push(("back-off", LineChart { title, x: Axis::new("sigma", "um"), panels, limits: Vec::new() }.draw()));
    }
    if !c.curves.axes.is_empty() {
        let names = [("X", "mm"), ("Y", "mm"), ("Z", "mm"), ("A", "deg"), ("C", "deg"), ("U", "mm"), ("V", "mm")];
        let panels = names
            .iter()
            .enumerate()
            .map(|(k, (name, unit))| {
                let points = c.curves.axes.iter().map(|(t, a)| [*t, a[k]]).collect();
                panel(Axis::new(name, unit), vec![Series::new("", points)], Vec::new())
            })
            .collect();
        let title = format!("Seven axes: motion of the first {} points", c.curves.axes.len());
        out.push(("axes", LineChart { title, x: Axis::new("time", "s"), panels, limits: Vec::new() }.draw()));
    }
    if !c.curves.along.is_empty() {
        let column = |k: usize| vec![Series::new("", c.curves.along.iter().map(|r| [r[0], r[k]]).collect())];
        let panels = vec![
            panel(Axis::new("FOD", "um"), column(1), focus),
            panel(Axis::new("BIA", "deg"), column(2), angle),
            panel(Axis::new("displacement", "mm"), column(3), field),
        ];
        let title = "Seven axes: deviations along the path".into();
        out.push(("along", LineChart { title, x: Axis::new("way", "mm"), panels, limits: Vec::new() }.draw()));
    }
    if !c.curves.paths.is_empty() {
        let series = c.curves.paths.iter().map(|(name, points)| Series::new(name, points.clone())).collect();
        let title = "Scanner and stage synchronised: the start of the path".into();
        out.push(("paths", Paths { title, x: "x".into(), y: "y".into(), unit: "mm".into(), series }.draw()));
    }
    out
}

/// All in one page.
pub fn page(c: &Comparison) -> String {
    let (tables, plots) = (tables(c), plots(c));
    let intro = format!(
        "{} on machine {}. Limits of all systems: focal offset (FOD) {:.1} um, beam incidence (BIA) {:.1} deg, \
         displacement of the spot {:.1} mm.",
        c.job,
        c.machine,
        c.limits.focus * 1000.0,
        c.limits.angle.to_degrees(),
        c.limits.field
    );
    let mut items = vec![Item::Text(&intro)];
    items.extend(tables.iter().map(|(_, t)| Item::Table(t)));
    items.extend(plots.iter().map(|(_, p)| Item::Plot(p)));
    page_html(&format!("{}: comparison of marking systems", c.job), &items)
}
