//! The comparison as tables, charts and a page.

use super::heat::{self, AFTER_S, PRINTED};
use super::{Comparison, Figures, Standing, Verdict, charts, following_errors};
use terrace_plan::on_the_fly::axes::kinematics::Deviation;
use terrace_plan::on_the_fly::spot::Rests;
use terrace_report::report::page::{Item, page_html};
use terrace_report::report::plot::{Axis, Bar, Bars, Limit, LineChart, Panel, Paths, Plot, Series};
use terrace_report::report::table::{Cell, Column, Table};

/// The table to choose by: what each system runs on, its time, stops or cost, its worst marks, and a note.
pub fn overview(c: &Comparison) -> Table {
    let verdict = Verdict::of(c);
    let third = match c.cost {
        Some(cost) => Column::number("cost", &cost.currency(), 2),
        None => Column::count("stops"),
    };
    let columns = vec![
        Column::text("system"),
        Column::text("machine"),
        Column::time(if c.loading.load_s > 0.0 { "time with loading" } else { "time" }),
        third,
        Column::number("worst defocus", "um", 1),
        Column::number("worst incidence", "deg", 2),
        Column::text("note"),
    ];
    let width = columns.len();
    let mut table = Table::new("", columns);
    for (k, row) in c.rows.iter().enumerate() {
        let mut cells: Vec<Cell> = vec![row.system.into()];
        match &row.figures {
            Ok(f) => cells.extend([
                f.hardware.label(&c.machine).into(),
                f.counted_s().into(),
                if c.cost.is_some() { c.cost_of(f).into() } else { f.stops.into() },
                f.of_marks(f.focus_um.worst).into(),
                f.of_marks(f.incidence_deg.worst).into(),
            ]),
            Err(_) => cells.resize(width - 1, Cell::Missing),
        }
        cells.push(verdict.note(k).into());
        if verdict.systems[k].standing == Standing::BeyondLimits {
            table.push_struck(cells);
        } else {
            table.push(cells);
        }
    }
    table
}

/// The table of systems: times, and the worst of everything.
fn systems(c: &Comparison) -> Table {
    let mut columns = vec![
        Column::text("system"),
        Column::text("machine"),
        Column::text("galvo"),
        Column::time("total"),
        Column::time("with loading"),
        Column::time("model"),
        Column::time("stage"),
        Column::time("settle"),
        Column::time("zoom"),
        Column::time("mark"),
        Column::time("jump"),
        Column::time("delay"),
        Column::count("stops"),
        Column::number("speed", "%", 1),
        Column::number("marked", "m", 2),
        Column::number("worst FOD", "um", 1),
        Column::number("worst BIA", "deg", 2),
        Column::number("worst displacement", "mm", 2),
        Column::number("worst spot error", "um", 1),
        Column::share("within limits"),
        Column::number("seam", "mm", 0),
        Column::number("stitch", "um", 1),
        Column::number("stage way", "m", 1),
    ];
    columns.extend(c.cost.map(|cost| Column::number("cost", &cost.currency(), 2)));
    columns.extend(["job key", "beyond", "note"].map(Column::text));
    let width = columns.len();
    let mut table = Table::new("Systems", columns);
    for row in &c.rows {
        let mut cells: Vec<Cell> = vec![row.system.into()];
        match &row.figures {
            Ok(f) => cells.extend(figures(c, f)),
            Err(e) => {
                cells.resize(width - 1, Cell::Missing);
                let why = e.diags().iter().map(|d| d.message.as_str()).collect::<Vec<_>>().join("; ");
                cells.push(format!("does not apply: {why}").as_str().into());
            }
        }
        table.push(cells);
    }
    table
}

fn figures(c: &Comparison, f: &Figures) -> Vec<Cell> {
    let t = &f.time;
    let mut cells: Vec<Cell> = vec![f.hardware.label(&c.machine).into(), c.galvo.name().into()];
    cells.extend([Some(t.total()), f.load_s.map(|_| f.counted_s()), f.model_s].map(Cell::from));
    cells.extend(t.parts().map(|(_, s)| Cell::from(s)));
    cells.extend([f.stops.into(), f.speed.into(), f.of_marks(f.marked_mm / 1000.0).into()]);
    let worst = [f.focus_um.worst, f.incidence_deg.worst, f.displacement_mm.worst];
    cells.extend(worst.map(|v| Cell::from(f.of_marks(v))));
    cells.extend([f.spot_error_um.map(|s| s.worst).into(), f.within.into()]);
    cells.extend([f.seam_mm.into(), f.stitch_um.into(), (f.stage_travel_mm / 1000.0).into()]);
    cells.extend(c.cost.map(|_| Cell::from(c.cost_of(f))));
    cells.push(f.job_key.clone().into());
    let beyond: Vec<String> = f.beyond.iter().map(ToString::to_string).collect();
    cells.push((!beyond.is_empty()).then(|| beyond.join("; ")).into());
    cells.push(f.notes.join("; ").as_str().into());
    cells
}

/// How each figure of each system is spread over the marks; None where no system applies.
fn deviations(c: &Comparison) -> Option<Table> {
    let mut columns = vec![Column::text("system"), Column::text("figure"), Column::text("unit")];
    columns.extend(["mean", "median", "of 95 %", "worst"].map(|name| Column::number(name, "", 3)));
    let mut table = Table::new("How deviations are spread over the marks", columns);
    let mut has_rows = false;
    for (system, f) in c.rows.iter().filter_map(|r| Some((r.system, r.figures.as_ref().ok()?))) {
        let spreads = [
            ("FOD", "um", f.of_marks(f.focus_um)),
            ("BIA", "deg", f.of_marks(f.incidence_deg)),
            ("displacement", "mm", f.of_marks(f.displacement_mm)),
            ("stage lag", "um", f.stage_lag_um),
            ("focus lag", "um", f.focus_lag_um),
            ("spot error", "um", f.spot_error_um),
        ];
        for (name, unit, spread) in spreads {
            let Some(s) = spread else { continue };
            let values = [s.mean, s.median, s.p95, s.worst].map(Cell::from);
            table.push([system.into(), name.into(), unit.into()].into_iter().chain(values).collect());
            has_rows = true;
        }
    }
    has_rows.then_some(table)
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
            (s.worst.defocus * 1000.0).into(),
            s.worst.angle.to_degrees().into(),
            s.worst.lateral.into(),
            s.rms_acceleration.into(),
            s.time_s.into(),
        ]);
    }
    Some(table)
}

/// The trials of the article's back-off search for sigma; None where there was none.
fn back_off(c: &Comparison) -> Option<Table> {
    if c.curves.back_off.is_empty() {
        return None;
    }
    let mut table = Table::new(
        "Seven axes: the back-off search for sigma",
        vec![
            Column::number("sigma", "um", 1),
            Column::number("worst FOD", "um", 1),
            Column::number("worst BIA", "deg", 2),
            Column::number("worst displacement", "mm", 3),
            Column::text("within limits"),
        ],
    );
    for trial in &c.curves.back_off {
        let d = trial.found;
        table.row([
            (trial.strength * 1000.0).into(),
            (d.defocus * 1000.0).into(),
            d.angle.to_degrees().into(),
            d.lateral.into(),
            if trial.holds { "yes" } else { "no" }.into(),
        ]);
    }
    Some(table)
}

/// Times of seven axes by where the spot rests; None where they were not asked for.
fn rests(c: &Comparison) -> Option<Table> {
    if c.curves.rests.is_empty() {
        return None;
    }
    let columns = vec![
        Column::text("spot rests at"),
        Column::text("stage"),
        Column::time("total"),
        Column::time("scanner alone"),
    ];
    let mut table = Table::new("Seven axes by the rests of the spot", columns);
    for row in &c.curves.rests {
        let rests = match row.rests {
            Rests::Corners => "corners",
            Rests::EveryPoint => "every point",
        };
        let pace = if row.in_step { "in step with the spot" } else { "at an even pace" };
        table.row([rests.into(), pace.into(), row.total_s.into(), row.scanner_s.into()]);
    }
    Some(table)
}

/// All tables, each with the name of its file.
pub fn tables(c: &Comparison) -> Vec<(&'static str, Table)> {
    let all = [
        ("overview", Some(overview(c))),
        ("systems", Some(systems(c))),
        ("deviations", deviations(c)),
        ("following-errors", following_errors::table(c)),
        ("decompositions", decompositions(c)),
        ("seven-axis-decompositions", shared(c)),
        ("back-off", back_off(c)),
        ("seven-axis-rests", rests(c)),
        ("convergence", convergence(c)),
        ("tool-servo", tool_servo(c)),
        ("heat", Some(heat())),
    ];
    all.into_iter().filter_map(|(name, table)| Some((name, table?))).collect()
}

/// What a tool servo must do and what it can; None where there is none.
fn tool_servo(c: &Comparison) -> Option<Table> {
    let tool = c.rows.iter().find_map(|row| row.figures.as_ref().ok()?.tool.as_ref())?;
    let columns = vec![
        Column::text("figure"),
        Column::text("unit"),
        Column::number("needed", "", 3),
        Column::number("limit", "", 3),
        Column::number("of the limit", "%", 1),
    ];
    let mut table = Table::new("Tool servo: what turning the surface needs, and what the drive makes", columns);
    for need in &tool.needs {
        let share = need.limit.map(|limit| 100.0 * need.needed / limit);
        table.row([need.figure.as_str().into(), need.unit.into(), need.needed.into(), need.limit.into(), share.into()]);
    }
    Some(table)
}

/// Heat at seams, an order of magnitude: the same for every job.
fn heat() -> Table {
    let mut columns = vec![Column::number("radius", "um", 0), Column::number("absorptivity", "", 3)];
    let after = AFTER_S.map(|s| format!("second exposure after {:.0} ms", 1e3 * s));
    columns.extend(after.iter().map(|name| Column::number(name, "degC", 0)));
    let title = format!(
        "Heat at seams, an order of magnitude: the absorptivity that explains {PRINTED:.0} degC of Cui et al. (2021), by the \
         1/e2 radius of the beam, which is not published"
    );
    let mut table = Table::new(&title, columns);
    for fit in heat::fits() {
        let mut cells: Vec<Cell> = vec![fit.radius_um.into(), fit.absorptivity.into()];
        cells.extend(fit.second_exposure_degc.map(Cell::from));
        table.push(cells);
    }
    table
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

/// The time that counts of every system, in its parts; of those beyond the limits hatched.
fn times(c: &Comparison) -> Plot {
    let mut parts: Vec<String> = Figures::default().time.parts().iter().map(|(name, _)| (*name).to_owned()).collect();
    let is_loaded = c.loading.load_s > 0.0;
    parts.extend(is_loaded.then(|| "loading".to_owned()));
    let marks =
        c.rows.iter().filter_map(|row| Some((row.system, row.figures.as_ref().ok().filter(|f| f.tool.is_none())?)));
    let rows = marks.map(|(name, f)| time_bar(name, f, is_loaded)).collect();
    Bars { title: "Time".into(), value: Axis::new("time", "s"), parts, rows }.draw()
}

/// The time of a system in its parts, with that of loading where blocks are loaded.
fn time_bar(name: &str, f: &Figures, is_loaded: bool) -> Bar {
    let mut parts: Vec<f64> = f.time.parts().iter().map(|(_, s)| *s).collect();
    parts.extend(is_loaded.then(|| f.load_s.unwrap_or(0.0)));
    let is_hatched = !f.keeps_limits() && !f.is_yours_to_set();
    Bar { name: if is_hatched { format!("{name} (beyond limits)") } else { name.to_owned() }, parts, is_hatched }
}

/// The charts, each with the name of its file.
pub fn plots(c: &Comparison) -> Vec<(&'static str, Plot)> {
    let mut out = vec![("times", times(c))];
    out.extend(back_off_chart(c).map(|plot| ("back-off", plot)));
    if !c.curves.axes.is_empty() {
        let names = [("X", "mm"), ("Y", "mm"), ("Z", "mm"), ("A", "deg"), ("C", "deg"), ("U", "mm"), ("V", "mm")];
        let title = format!("Seven axes: motion of the first {} points", c.curves.axes.len());
        out.push(("axes", charts::over_time(title, &names, &c.curves.axes)));
    }
    out.extend(deviations_chart(c).map(|plot| ("along", plot)));
    if !c.curves.paths.is_empty() {
        let series = c.curves.paths.iter().map(|(name, points)| Series::new(name, points.clone())).collect();
        let title = "Scanner and stage synchronised: the start of the path".into();
        out.push(("paths", Paths { title, x: "x".into(), y: "y".into(), unit: "mm".into(), series }.draw()));
    }
    out.extend(charts::space(&c.curves).map(|plot| ("space", plot)));
    out.extend(charts::velocities(&c.curves).map(|plot| ("velocities", plot)));
    out.extend(following_errors::plots(c));
    out
}

/// The worst deviations of the seven axes by the strength of the smoothing; None where it was not looked for.
fn back_off_chart(c: &Comparison) -> Option<Plot> {
    if c.curves.back_off.is_empty() {
        return None;
    }
    let worst = |part: fn(&Deviation) -> f64| {
        let points = c.curves.back_off.iter().map(|r| [r.strength * 1000.0, part(&r.found)]).collect();
        vec![Series::new("worst of all marks", points).marked()]
    };
    let series = [worst(|d| d.defocus * 1000.0), worst(|d| d.angle.to_degrees()), worst(|d| d.lateral)];
    let title = "Seven axes: how strongly the path may be smoothed".into();
    let panels = deviation_panels(c, series);
    Some(LineChart { title, x: Axis::new("sigma", "um"), panels, limits: Vec::new() }.draw())
}

/// The deviations of the seven axes along the path; None where there are none.
fn deviations_chart(c: &Comparison) -> Option<Plot> {
    if c.curves.along.is_empty() {
        return None;
    }
    let column = |k: usize| vec![Series::new("", c.curves.along.iter().map(|r| [r[0], r[k]]).collect())];
    let title = "Seven axes: deviations along the path".into();
    let panels = deviation_panels(c, [1, 2, 3].map(column));
    Some(LineChart { title, x: Axis::new("way", "mm"), panels, limits: Vec::new() }.draw())
}

/// Panels of focal offset, beam incidence and displacement, each with its limit for seven axes.
fn deviation_panels(c: &Comparison, [defocus, angle, field]: [Vec<Series>; 3]) -> Vec<Panel> {
    let limits = c.curves.seven.unwrap_or(c.limits);
    let panel =
        |y: Axis, series: Vec<Series>, limit: f64| Panel { y, series, limits: vec![Limit::new("limit", limit)] };
    vec![
        panel(Axis::new("FOD", "um"), defocus, limits.half_depth * 1000.0),
        panel(Axis::new("BIA", "deg"), angle, limits.angle.to_degrees()),
        panel(Axis::new("displacement", "mm"), field, limits.field),
    ]
}

/// The charts of motions, in the order of the page.
const MOTIONS: [&str; 7] = ["axes", "along", "space", "following-7-axis", "following-5-axis", "paths", "velocities"];

/// All in one page: the verdict, the times and the table to choose by, then everything else.
pub fn page(c: &Comparison) -> String {
    let (verdict, tables, plots) = (Verdict::of(c), tables(c), plots(c));
    let table =
        |wanted: &'static str| tables.iter().filter(move |(name, _)| *name == wanted).map(|(_, t)| Item::Table(t));
    let plot = |wanted: &'static str| plots.iter().filter(move |(name, _)| *name == wanted).map(|(_, p)| Item::Plot(p));
    let (answer, rest) = verdict.sentences.split_first().map_or(("", &[][..]), |(first, rest)| (first.as_str(), rest));
    let mut items = vec![Item::Answer(answer), Item::List(rest)];
    items.extend(plot("times").chain(table("overview")));
    let limits = limits(c);
    let mut figures = vec![Item::Text(&limits)];
    figures.extend(table("systems").chain(table("deviations")).chain(table("following-errors")));
    let divided: Vec<Item<'_>> = table("decompositions")
        .chain(table("seven-axis-decompositions"))
        .chain(table("back-off"))
        .chain(plot("back-off"))
        .collect();
    let moved: Vec<Item<'_>> = table("seven-axis-rests")
        .chain(table("convergence"))
        .chain(table("tool-servo"))
        .chain(MOTIONS.into_iter().flat_map(plot))
        .collect();
    let warm: Vec<Item<'_>> = table("heat").collect();
    let folds = [
        ("Limits, all figures, and how deviations are spread", &figures),
        ("How motions are divided between scanner and stage", &divided),
        ("Motions and their grids", &moved),
        ("Heat at seams", &warm),
    ];
    items
        .extend(folds.iter().filter(|(_, inside)| !inside.is_empty()).map(|(title, inside)| Item::Fold(title, inside)));
    page_html(&format!("{}: comparison of marking systems", c.job), &items)
}

/// What all systems are held to, and what of the job is compared.
fn limits(c: &Comparison) -> String {
    let mut out = format!(
        "Machine {}. Blocks of stepped systems: {}. Galvo of all systems: {}. Limits of all systems: focal offset (FOD) {:.1} um, beam incidence (BIA) {:.1} deg, displacement of \
         the spot {:.1} mm. Marks of {:.2} m, every pass of the pens counted.",
        c.machine,
        c.loading.sentence_per_block(),
        c.galvo.name(),
        c.limits.half_depth * 1000.0,
        c.limits.angle.to_degrees(),
        c.limits.field,
        c.marked_mm / 1000.0
    );
    if c.passes > 1 {
        out += &format!(" The job goes over the texture {} times; one of these is compared.", c.passes);
    }
    out
}
