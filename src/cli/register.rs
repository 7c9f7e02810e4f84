//! `terrace register`: where a measured part lies, as text and as JSON; and the table of points of a probe's log.

use std::collections::HashSet;
use std::fmt::Write;
use std::path::Path;

use serde_json::{Value, json};

use super::args::{Args, Choice, ProbeArgs};
use super::{load, print, show, warn, write_file};
use terrace_core::diag::{Diag, Error, Place};
use terrace_core::geom::{SpacePoint, cos_sin};
use terrace_core::machine::Machine;
use terrace_core::math;
use terrace_core::progress::Task;
use terrace_core::units::Length;
use terrace_input::job::Job;
use terrace_input::measured::{LoggedZero, Measure, MeasuredPoint, read_log, read_table, written};
use terrace_plan::measured::{Lying, PointResidual, Residual, Warp, fitted, stage_from_table};
use terrace_plan::plan;

/// Points that are listed in the text, those of the largest residuals; JSON has all.
const LISTED: usize = 40;

/// Fits the part of a job to its measured points, and prints where it lies; a log becomes its table first.
pub(super) fn register(
    args: &Args,
    path: &Path,
    (log, at): (Option<&Path>, Option<SpacePoint>),
    probe: &ProbeArgs,
) -> Result<(), Error> {
    let job = load(args, path, &Choice::default())?;
    let machine = job.machine().map_err(|e| job.at_keys(&e))?;
    let Some(measured) = &job.placement.measured else {
        let fault = Diag::input("register-table", "the job does not name a table of measured points");
        let hint = "add [placement.measured] with file = \"measured.csv\"";
        return Err(fault.at(job.place_of("placement")).hint(hint).into());
    };
    let table = job.relative(&measured.file);
    let mut warnings = Vec::new();
    let mut added = None;
    if let Some(log) = log {
        if table.exists() && !probe.force && !probe.add {
            let fault = Diag::input("register-exists", "the table of measured points is there already");
            let hint = "give --force to replace it, --add to add to it, or leave out the log to fit the part to it";
            return Err(fault.at(Place::file(table.display().to_string())).hint(hint).into());
        }
        let mut points = if probe.add { read_table(&table).map_err(|e| job.at_keys(&e))? } else { Vec::new() };
        let (touches, touched_by) = of_log(args, &machine, log, probe)?;
        let there: HashSet<[u64; 3]> = points.iter().filter(|p| p.measure == touched_by).map(bits).collect();
        // Counted twice they would seem surer than they are.
        let new: Vec<MeasuredPoint> = touches.into_iter().filter(|touch| !there.contains(&bits(touch))).collect();
        if new.is_empty() {
            let fault = Diag::input("register-exists", "the table has all touches of this log already");
            let place = Place::file(table.display().to_string());
            return Err(fault.at(place).hint("leave out the log to fit the part to the table").into());
        }
        // Named as they follow one another, so that no name is there twice.
        let number = |p: &MeasuredPoint| p.name.strip_prefix("touch ").and_then(|n| n.parse::<usize>().ok());
        let first = points.iter().filter_map(number).max().unwrap_or(0) + 1;
        points.extend((first..).zip(new).map(|(n, touch)| MeasuredPoint { name: format!("touch {n}"), ..touch }));
        // What does not fit is not added; a new table is there to be mended.
        if !probe.add {
            write_file(args, &table, written(&points).as_bytes(), &[log.to_owned(), path.to_owned()])?;
        }
        added = Some(points);
    }
    let points = match &added {
        Some(points) => points.clone(),
        None => read_table(&table).map_err(|e| job.at_keys(&e))?,
    };
    let surface =
        plan::designed(&job, &machine, &mut warnings, &mut |_| {}, Task::silent()).map_err(|e| job.at_keys(&e))?;
    let shown = table.display().to_string();
    let lying =
        fitted(&job, &machine, &surface, &points, &shown, &mut warnings).map_err(|e| e.after(warnings.clone()))?;
    if let (Some(log), true) = (log, probe.add) {
        write_file(args, &table, written(&points).as_bytes(), &[log.to_owned(), path.to_owned()])?;
    }
    warn(args, &warnings);
    let figures = Figures::new(&lying);
    let looked_at = at.map(|at| LookedAt::new(&job, &machine, &lying, at));
    if args.json {
        let mut json = figures.json(&lying);
        if let Some(place) = looked_at {
            json["at"] =
                json!({"part_mm": place.part, "stage_mm": place.stage, "sigma_um": place.sigma.map(|mm| mm * 1e3)});
        }
        return print(&show::json(&json));
    }
    print(&(figures.text(&job, &lying) + &looked_at.map_or(String::new(), |place| place.text())))
}

/// The bits of a position.
fn bits(point: &MeasuredPoint) -> [u64; 3] {
    point.stage.map(|v| (v + 0.0).to_bits())
}

/// The points of a probe's log, and how they were measured.
fn of_log(
    args: &Args,
    machine: &Machine,
    log: &Path,
    probe: &ProbeArgs,
) -> Result<(Vec<MeasuredPoint>, Measure), Error> {
    let stated = machine.probe;
    let [radius, noise] = [(probe.radius, stated.map(|p| p.radius)), (probe.noise, stated.map(|p| p.noise))]
        .map(|(given, stated)| given.or(stated));
    let (Some(radius), Some(noise)) = (radius, noise) else {
        let fault = Diag::input("probe-none-stated", "the machine file has no [probe]");
        return Err(fault.hint("state the probe there, or give --radius and --noise").into());
    };
    let found = read_log(log)?;
    if let Some(line) = found.missed.first() {
        let text = format!("{} probe moves touched nothing", found.missed.len());
        let place = Place::line(log.display().to_string(), *line);
        warn(args, &[Diag::warning("probe-missed", text).at(place).hint("they are left out")]);
    }
    let shown = log.display().to_string();
    let zero = match (probe.zero, found.zero) {
        (Some(zero), _) | (None, LoggedZero::At(zero)) => zero,
        (None, unknown) => {
            let text = match unknown {
                LoggedZero::Unclear(why) => why,
                _ => {
                    "the log does not say where the zero of G54 lies, and GRBL counts touches from that of the machine"
                        .to_owned()
                }
            };
            let hint = "keep the answers of one run alone, with that to $# in it, or give --zero X,Y,Z: 0,0,0 where the \
                        zero of G54 is the machine's";
            return Err(Diag::input("probe-zero", text).at(Place::file(shown)).hint(hint).into());
        }
    };
    let measure = Measure::Touch { tip_mm: radius.as_mm() };
    let pretravel = probe.pretravel.or(stated.map(|p| p.pretravel)).map_or(0.0, Length::as_mm);
    let offset = probe.offset.or(stated.map(|p| p.offset_mm())).unwrap_or_default();
    let signs = machine.axes().map(|(_, axis)| axis.sign() as f64);
    let point = |(line, at): (usize, SpacePoint)| {
        // The tip had touched before the controller knew: it stands that much too low.
        let table = [0, 1, 2].map(|k| signs[k] * (at[k] - zero[k]) + offset[k] + if k == 2 { pretravel } else { 0.0 });
        MeasuredPoint {
            // Named by its place in the table.
            name: String::new(),
            place: Place::line(shown.clone(), line),
            measure,
            stage: [0, 1, 2].map(|k| signs[k] * table[k]),
            sigma_mm: [noise.as_mm(); 2],
        }
    };
    Ok((found.touched.into_iter().map(point).collect(), measure))
}

/// Where the axes stand with the focus on a place of the part.
struct LookedAt {
    /// As the user has given it, mm.
    part: SpacePoint,
    stage: SpacePoint,
    /// Standard deviations along x, y and z, mm.
    sigma: SpacePoint,
}

impl LookedAt {
    fn new(job: &Job, machine: &Machine, lying: &Lying, part: SpacePoint) -> Self {
        let [cos, sin] = cos_sin(job.placement.turn.as_rad());
        let [x, y, z] = part;
        let mut table = lying.fit.motion.apply([cos * x - sin * y, sin * x + cos * y, z]);
        let mut sigma = lying.fit.uncertainty.place(table);
        if let Some(warp) = &lying.warp {
            let told = warp.at([table[0], table[1]]);
            table[2] += told.height;
            sigma[2] = told.deviation;
        }
        Self { part, stage: stage_from_table(machine, table), sigma }
    }

    fn text(&self) -> String {
        let [[px, py, pz], [x, y, z]] = [self.part, self.stage];
        let [sx, sy, sz] = self.sigma.map(|mm| mm * 1e3);
        format!(
            "\nlook at       X{px} Y{py} Z{pz} mm of the part: stage_x {x:.4}  stage_y {y:.4}  stage_z {z:.4}\n              \
             sigma {sx:.1} um, {sy:.1} um, {sz:.1} um, without what the eye is off by\n"
        )
    }
}

/// What is told of a fit.
struct Figures {
    /// Turn about z, and lean, deg.
    turn_deg: f64,
    lean_deg: f64,
    /// Standard deviations at the middle of the points, um.
    place_um: SpacePoint,
    /// Of the turns about x, y and z, mrad.
    turns_mrad: SpacePoint,
    on_part: usize,
}

impl Figures {
    fn new(lying: &Lying) -> Self {
        let [[xx, ..], [yx, ..], _] = lying.rows;
        let uncertainty = &lying.fit.uncertainty;
        Self {
            turn_deg: math::atan2(yx, xx).to_degrees(),
            lean_deg: lying.fit.motion.lean().to_degrees(),
            place_um: uncertainty.place(uncertainty.centre).map(|mm| mm * 1e3),
            turns_mrad: uncertainty.turns().map(|rad| rad * 1e3),
            on_part: lying.points.iter().filter(|p| p.counts()).count(),
        }
    }

    fn json(&self, lying: &Lying) -> Value {
        let scale = lying.fit.scale.map(|scale| json!({"excess": scale.excess, "sigma": scale.sigma}));
        json!({
            "origin_mm": lying.fit.motion.origin(),
            "rows": lying.rows,
            "turn_deg": self.turn_deg,
            "lean_deg": self.lean_deg,
            "centre_mm": lying.fit.uncertainty.centre,
            "sigma_um": self.place_um,
            "sigma_turns_mrad": self.turns_mrad,
            "covariance": lying.fit.uncertainty.covariance,
            "noise_factor": lying.fit.noise_factor,
            "scale": scale,
            "worst_residual_um": lying.worst_residual_mm() * 1e3,
            "warp": lying.warp.as_ref().map(warp_json),
            "points": lying.points.iter().map(point_json).collect::<Vec<_>>(),
        })
    }

    fn text(&self, job: &Job, lying: &Lying) -> String {
        let mut out = String::new();
        let [x, y, z] = lying.fit.motion.origin();
        let [sx, sy, sz] = self.place_um;
        let [tx, ty, tz] = self.turns_mrad;
        let count = lying.points.len();
        // Writing to a String cannot fail.
        let _ = writeln!(out, "points     {count}, of which {} lie on the part", self.on_part);
        let _ = writeln!(out, "part zero  X{x:.4} Y{y:.4} Z{z:.4} mm in the table frame");
        let _ = writeln!(out, "turned     {:.4} deg about z, beside placement.turn", self.turn_deg);
        let _ = writeln!(out, "leaning    {:.4} deg", self.lean_deg);
        let _ = writeln!(out, "sigma      x {sx:.1} um, y {sy:.1} um, z {sz:.1} um at the middle of the points");
        let _ = writeln!(out, "           turns about x {tx:.3} mrad, y {ty:.3} mrad, z {tz:.3} mrad");
        if let Some(scale) = lying.fit.scale {
            let [excess, sigma] = [scale.excess, scale.sigma].map(|share| share * 100.0);
            let _ = writeln!(out, "scale      {excess:+.4} % +- {sigma:.4} % of the part's size; not applied");
        }
        let _ = writeln!(out, "noise      residuals are {:.2} times what the table states", lying.fit.noise_factor);
        if let Some(warp) = &lying.warp {
            let [[lowest, highest], [least, most]] = warp.ranges().map(|range| range.map(|mm| mm * 1e3));
            let points = warp.points().len();
            let _ = writeln!(
                out,
                "warp       heights are corrected by {lowest:+.1} to {highest:+.1} um, from {points} points"
            );
            let _ = writeln!(
                out,
                "           sigma of the height {least:.1} um at best, {most:.1} um at worst in the box of the points"
            );
        }
        let mut points: Vec<&PointResidual> = lying.points.iter().collect();
        points.sort_by(|a, b| b.distance_mm().total_cmp(&a.distance_mm()));
        let most = if count > LISTED { format!(", the {LISTED} largest of {count}") } else { String::new() };
        let _ = writeln!(out, "\nRESIDUALS (um{most})");
        for point in points.into_iter().take(LISTED) {
            let um = |mm: f64| mm * 1e3;
            let what = match point.residual {
                Residual::Place([x, y, z]) => format!("x {:.1}  y {:.1}  z {:.1}", um(x), um(y), um(z)),
                Residual::Above(off, true) => format!("{:.1} above the part", um(off)),
                Residual::Above(off, false) => format!("{:.1} above the part: not on it, does not count", um(off)),
            };
            let left = point.left.map_or(String::new(), |left| format!(", {:+.1} in z once corrected", um(left)));
            let _ = writeln!(out, "  {:<20} {what}{left}", point.name);
        }
        let _ = writeln!(out, "\nthen run       terrace compile {}", job.path.display());
        out
    }
}

fn warp_json(warp: &Warp) -> Value {
    let [height, deviation] = warp.ranges().map(|range| range.map(|mm| mm * 1e3));
    let candidates = warp
        .candidates()
        .into_iter()
        .map(|c| json!({"length_mm": c.length, "amplitude_um": c.amplitude * 1e3, "weight": c.weight}));
    json!({
        "points": warp.points().len(),
        "lengths": candidates.collect::<Vec<_>>(),
        "factor": warp.factor(),
        "height_um": height,
        "sigma_um": deviation,
    })
}

fn point_json(point: &PointResidual) -> Value {
    let mut json = json!({"name": point.name, "at_mm": point.at, "residual_um": point.distance_mm() * 1e3});
    if let Some(left) = point.left {
        json["left_um"] = (left * 1e3).into();
    }
    match point.residual {
        Residual::Place(r) => json["residual_xyz_um"] = json!(r.map(|mm| mm * 1e3)),
        Residual::Above(_, is_on_part) => json["on_part"] = is_on_part.into(),
    }
    json
}
