//! `terrace probe`: where to measure a part, and the program of a touch probe that does it, read back and proved.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::args::{Args, Choice, PointsArgs};
use super::{load, print, show, unwritable, warn, write_file};
use terrace_core::diag::{Diag, Error, Place};
use terrace_core::machine::{Dialect, Machine};
use terrace_core::units::Length;
use terrace_input::job::Job;
use terrace_plan::probe::{Asked, Count, LOG, Probing, Tool, probing, program};
use terrace_report::report::points_svg;
use terrace_verify::ProbeProof;

/// How far a part may lie from where the job says, unless something else is asked for.
const SEARCH_MM: f64 = 2.0;

/// Chooses points, and writes a folder with the program, the list, the map and what to do.
pub(super) fn probe(args: &Args, path: &Path, output: Option<&Path>, asked: &PointsArgs) -> Result<(), Error> {
    let job = load(args, path, &Choice::default())?;
    let machine = job.machine().map_err(|e| job.at_keys(&e))?;
    let asked = Asked {
        tool: tool(&machine, asked)?,
        search_mm: asked.search.map_or(SEARCH_MM, Length::as_mm),
        count: match (asked.points, asked.sigma) {
            (Some(count), _) => Count::Of(count),
            (None, Some(sigma)) => Count::BySigma(sigma.as_mm()),
            (None, None) => Count::ByCost,
        },
    };
    let folder = output.map_or_else(|| path.with_extension("probe"), Path::to_owned);
    if std::fs::symlink_metadata(&folder).is_ok() {
        let d = Diag::input("output-exists", "the folder exists already").at(Place::file(folder.display().to_string()));
        return Err(d.hint("name another folder with -o, or delete this one first").into());
    }
    let steps = super::progress::Steps::new(args.quiet);
    steps.begin("choosing points".to_owned());
    let mut warnings = Vec::new();
    let found = probing(&job, &asked, &mut warnings).map_err(|e| e.after(warnings.clone()))?;
    steps.done();
    warn(args, &warnings);
    let written = program(&found);
    if written.is_none() && matches!(found.tool, Tool::Touch(_)) {
        let text = "Mach touches by words of its own, which terrace does not write: there is a list alone";
        warn(
            args,
            &[Diag::warning("probe-dialect", text).hint("touch the points of points.csv by hand or by a macro")],
        );
    }
    let proof = match (&written, found.tool) {
        (Some((_, bytes)), Tool::Touch(probe)) => {
            Some(proved(terrace_verify::probe(bytes, &job, &machine, (&probe, found.origin), found.search_mm)?)?)
        }
        _ => None,
    };
    let inputs = terrace_report::job_folder::input_paths(&job);
    std::fs::create_dir_all(&folder)
        .map_err(|e| unwritable("make the folder", Place::file(folder.display().to_string()), &e))?;
    let mut files: Vec<(&str, Vec<u8>)> = written.into_iter().collect();
    let sheet = Sheet { job: &job, found: &found, proof: proof.as_ref(), program: files.first().map(|file| file.0) };
    let (text, list) = (sheet.text(), sheet.list());
    let map = points_svg(&path.file_name().unwrap_or_default().to_string_lossy(), &found);
    files.extend([("points.csv", list.into()), ("points.svg", map.into()), ("runsheet.txt", text.clone().into())]);
    let paths: Vec<PathBuf> = files.iter().map(|(name, _)| folder.join(name)).collect();
    for (path, (_, bytes)) in paths.iter().zip(&files) {
        write_file(args, path, bytes, &inputs)?;
    }
    print(&if args.json { show::json(&sheet.json(&paths)) } else { text + &in_folder(&folder, &files) })
}

/// What measures: the sensor that was asked for, or the probe of the machine file.
fn tool(machine: &Machine, asked: &PointsArgs) -> Result<Tool, Error> {
    match (asked.sensor, machine.probe) {
        (Some(sigma), _) => Ok(Tool::Sensor(sigma.as_mm())),
        (None, Some(probe)) => Ok(Tool::Touch(probe)),
        (None, None) => {
            let fault = Diag::input("probe-none-stated", "the machine file has no [probe]");
            let hint = "state the touch probe in the machine file, or --sensor, the standard deviation of a distance \
                        sensor along the beam";
            Err(fault.hint(hint).into())
        }
    }
}

/// A proof that found nothing wrong.
fn proved(proof: ProbeProof) -> Result<ProbeProof, Error> {
    if proof.broken.is_empty() {
        return Ok(proof);
    }
    let text = format!("the program of the probe does not verify:\n{}", proof.broken.join("\n"));
    Err(Diag::bug("not-verified", text).into())
}

/// Stops over those of a part that is known exactly, in words.
fn more(cost: f64) -> String {
    if cost < 2.0 {
        format!("{:.1} % more than for a part known exactly", (cost - 1.0) * 100.0)
    } else {
        format!("{cost:.1} times as many as for a part known exactly")
    }
}

fn in_folder(folder: &Path, files: &[(&str, Vec<u8>)]) -> String {
    let names: Vec<&str> = files.iter().map(|(name, _)| *name).collect();
    format!("\nwritten    {}: {}\n", folder.display(), names.join(", "))
}

/// What is told of points to measure.
struct Sheet<'a> {
    job: &'a Job,
    found: &'a Probing,
    proof: Option<&'a ProbeProof>,
    program: Option<&'a str>,
}

impl Sheet<'_> {
    fn text(&self) -> String {
        let Probing { after, of_net, before, points, .. } = self.found;
        let um = |mm: f64| mm * 1e3;
        let mut out = String::new();
        // Writing to a String cannot fail.
        let _ =
            writeln!(out, "points     {}, {} of the machine {:?}", points.len(), self.tool(), self.found.machine.name);
        let _ = writeln!(
            out,
            "sigma      of the height {:.1} um at worst where something is marked, {:.1} um before",
            um(after.worst),
            um(before.worst)
        );
        let _ = writeln!(out, "           {:.1} um with an even net of as many points", um(of_net.worst));
        if self.found.earlier == 0 {
            let [tx, ty, tz, x, y, z] = after.motion;
            let [tx, ty, tz] = [tx, ty, tz].map(|rad| rad * 1e3);
            let _ = writeln!(out, "           of the place x {:.1} um, y {:.1} um, z {:.1} um", um(x), um(y), um(z));
            let _ = writeln!(out, "           of turns about x {tx:.3} mrad, y {ty:.3} mrad, z {tz:.3} mrad");
        } else {
            let _ = writeln!(out, "           taking {} earlier points into account", self.found.earlier);
        }
        if let Some(limit) = self.found.believed {
            let _ = writeln!(
                out,
                "           if the part is warped by up to {limit} mm over half its extent; once it is measured, run this \
                 again for points where they are missing"
            );
        }
        let _ = writeln!(
            out,
            "stops      {}, since {} sigma stay free; {} with the net",
            more(after.cost),
            self.found.sigmas,
            more(of_net.cost)
        );
        for motion in self.loose() {
            let _ = writeln!(out, "loose      {motion}");
        }
        if let (Some(proof), Some(name)) = (self.proof, self.program) {
            let _ = writeln!(
                out,
                "proved     {name} was read back: on {} moves nothing but a touching tip meets the part, wherever within \
                 {} mm of its place it lies",
                proof.moves, self.found.search_mm
            );
            let _ = writeln!(
                out,
                "           not looked at: what the job does not name, cables; what the probe itself does"
            );
        }
        out + &self.what_to_do()
    }

    fn tool(&self) -> &'static str {
        match self.found.tool {
            Tool::Touch(_) => "by the touch probe",
            Tool::Sensor(_) => "by a sensor along the beam",
        }
    }

    /// Motions that the points hold no better than before.
    fn loose(&self) -> Vec<String> {
        if self.found.earlier > 0 {
            return Vec::new();
        }
        const NAMES: [&str; 6] =
            ["the turn about x", "the turn about y", "the turn about z", "the shift along x", "the shift along y", "z"];
        let held = |k: usize| self.found.after.motion[k] < LOOSE * self.found.before.motion[k];
        let loose: Vec<&str> = (0..6).filter(|&k| !held(k)).map(|k| NAMES[k]).collect();
        let may_be_warped = self.job.placement.measured.as_ref().is_some_and(|measured| measured.warp.is_some());
        if loose.is_empty() && !may_be_warped {
            return Vec::new();
        }
        let why = match &loose[..] {
            [] => {
                "the part may be warped, and what it is warped by says as much of where it lies as its form:".to_owned()
            }
            loose => format!("the form of the part does not hold {}:", loose.join(", ")),
        };
        vec![
            why,
            "measure three features of the part too, such as holes, with the pilot laser (kind optical)".to_owned(),
        ]
    }

    /// The table that the job names.
    fn table(&self) -> String {
        let named = self.job.placement.measured.as_ref().map(|measured| self.job.relative(&measured.file));
        named.map_or("the table of placement.measured".to_owned(), |path| path.display().to_string())
    }

    fn what_to_do(&self) -> String {
        let job = self.job.path.display();
        let add = if self.found.earlier > 0 { " --add" } else { "" };
        let mut out = String::from("\nTO DO\n");
        let mut number = 0;
        let mut step = |text: &str| {
            number += 1;
            let _ = writeln!(out, "[ ] {number}. {text}");
        };
        let [x, y, z] = self.found.origin.mm();
        if self.found.earlier > 0 {
            let table = self.table();
            step(&format!(
                "leave the part as it lay when {table} was measured; was it moved, measure into a new table"
            ));
        } else {
            step(&format!(
                "clamp the part with its zero at X{x:.3} Y{y:.3} Z{z:.3} mm in the table frame, within {} mm",
                self.found.search_mm
            ));
        }
        match (self.found.tool, self.program) {
            (Tool::Touch(_), Some(name)) => {
                step("put the probe on, touch it by hand and see that the controller shows it");
                if self.found.machine.controller.dialect == Dialect::Grbl {
                    step("send $# and keep what GRBL answers: it says where the zero of G54 lies");
                }
                step(&format!(
                    "run {name} with a hand on feed hold: it lifts first, and touches one point after another"
                ));
                if self.found.machine.controller.dialect == Dialect::Grbl {
                    step(&format!("keep all that GRBL answers as {LOG}: the lines [PRB:x,y,z:1] too"));
                } else {
                    step(&format!("fetch {LOG}, which LinuxCNC writes beside its own settings"));
                }
                step(&format!("terrace register {job} {LOG}{add}"));
            }
            (Tool::Touch(_), None) => {
                step(&format!(
                    "touch the points of points.csv, and write a line of each into {LOG}: what the controller shows as x, y \
                     and z, and six zeros"
                ));
                step(&format!("terrace register {job} {LOG}{add}"));
            }
            (Tool::Sensor(_), _) => {
                step("go to each point of points.csv, move z until the sensor shows the focus, and write z as stage_z");
                let table = self.table();
                let how = if self.found.earlier > 0 { "add these rows to" } else { "save that as" };
                step(&format!("{how} {table}, then: terrace register {job}"));
            }
        }
        step(&format!("terrace compile {job}"));
        out
    }

    /// The points: of a sensor as a table of measured ones whose z is still to be filled in, what the job expects being a
    /// comment. Axes do not stand at the tip of a probe, so of its points the places alone, with `expected_z`.
    fn list(&self) -> String {
        let Tool::Sensor(sigma) = self.found.tool else {
            let mut out = String::from("name,stage_x,stage_y,expected_z,part_x,part_y,part_z\n");
            for point in &self.found.points {
                let [x, y, z] = point.stage.mm();
                let [u, v, w] = point.part_mm;
                let _ = writeln!(out, "{},{x:.4},{y:.4},{z:.4},{u:.4},{v:.4},{w:.4}", point.name);
            }
            return out;
        };
        let mut out = String::from("# Fill in stage_z: what the controller shows at each point. Expected are\n");
        for point in &self.found.points {
            let [.., z] = point.stage.mm();
            let _ = writeln!(out, "#   {} z {z:.4}", point.name);
        }
        out += "name,kind,stage_x,stage_y,stage_z,sigma_um\n";
        for point in &self.found.points {
            let [x, y, _] = point.stage.mm();
            let _ = writeln!(out, "{},distance,{x:.4},{y:.4},,{}", point.name, sigma * 1e3);
        }
        out
    }

    fn json(&self, files: &[PathBuf]) -> Value {
        let Probing { after, of_net, before, points, .. } = self.found;
        let known = |known: &terrace_plan::probe::Known| {
            let [tx, ty, tz, x, y, z] = known.motion;
            json!({
                "worst_um": known.worst * 1e3,
                "stops_factor": known.cost,
                "sigma_um": json!([x, y, z].map(|mm| mm * 1e3)),
                "sigma_turns_mrad": json!([tx, ty, tz].map(|rad| rad * 1e3)),
            })
        };
        let point = |p: &terrace_plan::probe::ProbePoint| json!({"name": p.name, "stage_mm": p.stage.mm(), "part_mm": p.part_mm});
        json!({
            "points": points.iter().map(point).collect::<Vec<_>>(),
            "search_mm": self.found.search_mm,
            "before": known(before),
            "after": known(after),
            "even_net": known(of_net),
            "loose": self.loose(),
            "proved_moves": self.proof.map(|proof| proof.moves),
            "files": files.iter().map(|f| f.display().to_string()).collect::<Vec<_>>(),
        })
    }
}

/// A motion is held where its deviation falls below this share of what it was.
const LOOSE: f64 = 0.3;
