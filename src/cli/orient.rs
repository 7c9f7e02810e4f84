//! `terrace orient`: how the part is laid, the table of set-ups as text and as JSON, and the job file with the best.

use std::fmt::Write;
use std::path::Path;

use serde_json::{Value, json};
use toml_edit::{Array, DocumentMut, Item, Table, value};

use super::args::{Args, Choice};
use super::progress::Steps;
use super::{load, print, show, warn, write_file};
use terrace_core::diag::{Diag, Error, Kind, Place};
use terrace_core::duration::duration;
use terrace_core::geom::{Pose, mm_from_nm};
use terrace_core::units::Angle;
use terrace_input::job::Job;
use terrace_plan::plan::lay::{self, Laying, Reason, Side};
use terrace_plan::plan::orient::{self, Orientation, SetUp};

/// Share of the stage time that a fixture angle saves, from which it is written into the job file.
const WORTH: f64 = 0.05;

/// Finds how to lay the part of a job, prints the set-ups, and writes the best single one into the job file.
pub(super) fn orient(args: &Args, path: &Path, side: Side, apply: bool) -> Result<(), Error> {
    if apply && path == Path::new("-") {
        let d = Diag::input("orient-stdin", "a job from standard input has no file to write to");
        return Err(d.hint("name the job file, or leave out --apply").into());
    }
    let job = load(args, path, &Choice::default())?;
    let laying = match lay::lay(&job, side) {
        Ok(laying) => Some(laying),
        // Without a choice the part stays as the job has it.
        Err(e) if !apply && side == Side::Found && e.diags().iter().all(|d| d.code == "orient-side") => {
            warn(args, &e.diags().iter().map(|d| Diag { kind: Kind::Warning, ..d.clone() }).collect::<Vec<_>>());
            None
        }
        Err(e) => return Err(e),
    };
    let turned = laying.filter(|laying| side != Side::Found || !laying.is_as_placed(job.placement.laid));
    let (laid, found) = match &turned {
        Some(laying) => laid_and_estimated(args, &job, laying)?,
        None => (job.clone(), estimated(args, &job)?),
    };
    let Some(best) = best(&found) else { return Ok(()) };
    let rotate = rotations(&laid, best);
    let is_new = laid.placement.laid != job.placement.laid || best.lean_deg != [0.0; 2];
    if apply && is_new {
        write(args, path, rotate)?;
    }
    if args.json {
        let mut json = json(&found, &laid, laying.as_ref(), rotate);
        json["written"] = (apply && is_new).into();
        return print(&show::json(&json));
    }
    let best = format!("The best single set-up:\n\n[placement]\n{}\n\n", written(rotate));
    let end = match (is_new, apply) {
        (false, false) => "The part lies as well as it can.\n".to_owned(),
        (false, true) => "The part lies as well as it can: the job file stays as it is.\n".to_owned(),
        (true, false) => best + "orient --apply writes it into the job file\n",
        (true, true) => best + &format!("written into {}\n", path.display()),
    };
    print(&(text(&found, turned.as_ref()) + &end))
}

/// The set-ups of a job.
fn estimated(args: &Args, job: &Job) -> Result<Vec<Orientation>, Error> {
    let steps = Steps::new(args.quiet);
    let found = orient::orient(job, &steps.numbered(&orient::PHASES, show::phase))?;
    steps.done();
    Ok(found)
}

/// The job with its part laid as `laying` says, and its set-ups. Where no texture meets the laid part, since their places
/// were chosen on the part as it lay, one hatch over all of it stands in for them.
fn laid_and_estimated(args: &Args, job: &Job, laying: &Laying) -> Result<(Job, Vec<Orientation>), Error> {
    let laid = lay::laid(job, lay::angles(&laying.pose));
    match estimated(args, &laid) {
        Err(e) if e.diags().iter().any(|d| d.code == "job-empty") => {
            let d = Diag::warning("orient-texture", "on the part as it is laid no texture would be marked")
                .at(job.place_of("texture"))
                .hint("place the textures again: their places are in the frame of the laid part");
            warn(args, &[d]);
            let pitch_mm =
                job.machine()?.lens.field.map(|side| side.as_mm()).into_iter().fold(f64::INFINITY, f64::min) / 20.0;
            let found = estimated(args, &lay::hatched(&laid, pitch_mm))?;
            Ok((laid, found))
        }
        found => Ok((laid, found?)),
    }
}

/// The best single set-up: a fixture angle only where it saves some time.
fn best(found: &[Orientation]) -> Option<&SetUp> {
    let single = |name: &str| found.iter().find(|w| w.name == name).and_then(|w| w.set_ups.first());
    let flat = single("as placed")?;
    let leaning = single("tilted fixture");
    Some(leaning.filter(|l| l.stage_s < (1.0 - WORTH) * flat.stage_s).unwrap_or(flat))
}

/// The rotations of the surface file with which a set-up lies. It leans about the axes of the turned part, and the job
/// turns the part after these rotations.
fn rotations(job: &Job, set_up: &SetUp) -> [Angle; 3] {
    let [x, y] = set_up.lean_deg.map(f64::to_radians);
    let lean = Pose::from_angles([0.0, y, 0.0]).then(Pose::from_angles([x, 0.0, 0.0]));
    let turn = job.placement.turn.as_rad();
    let [turned, back] = [turn, -turn].map(|rad| Pose::from_angles([0.0, 0.0, rad]));
    let laid = job.placement.laid.and_then(|laid| laid.pose()).unwrap_or(Pose::from_angles([0.0; 3]));
    lay::angles(&laid.then(turned).then(lean).then(back))
}

/// Writes rotations into the job file, all else of which stays as it is.
fn write(args: &Args, path: &Path, rotate: [Angle; 3]) -> Result<(), Error> {
    let shown = path.display().to_string();
    let text = std::fs::read_to_string(path).map_err(|e| terrace_core::diag::unreadable(path, &e))?;
    let fault = |e: &dyn std::fmt::Display| {
        Error::from(Diag::input("toml", format!("the job file cannot be edited: {e}")).at(Place::file(&shown)))
    };
    let mut file: DocumentMut = text.parse().map_err(|e: toml_edit::TomlError| fault(&e))?;
    let placement = file.entry("placement").or_insert(Item::Table(Table::new()));
    let Some(placement) = placement.as_table_like_mut() else { return Err(fault(&"placement is not a table")) };
    placement.remove("up");
    placement.remove("level");
    let angles: Array = rotate.iter().map(|angle| format!("{} deg", angle.as_deg())).collect();
    placement.insert("rotate", value(angles));
    write_file(args, path, file.to_string().as_bytes(), &[])
}

fn written(rotate: [Angle; 3]) -> String {
    let [x, y, z] = rotate.map(|angle| format!("\"{} deg\"", angle.as_deg()));
    format!("rotate = [{x}, {y}, {z}]")
}

/// The table for people.
fn text(found: &[Orientation], turned: Option<&Laying>) -> String {
    let mut out = String::new();
    if let Some(laying) = turned {
        let [x, y, z] = laying.up;
        let why = match laying.reason {
            Reason::Winding => "its facets face that way",
            Reason::Area => "it shows the most area that way",
            Reason::Asked => "as asked for",
        };
        let _ = writeln!(
            out,
            "The part is laid with ({x:.3}, {y:.3}, {z:.3}) of its file towards the lens: {why}.\nAs the file has it, \
             {:.0} % of its area faces the lens. Rows and angles below are of the laid part.\n",
            laying.faces_lens * 100.0
        );
    }
    let _ = writeln!(out, "{:<30} {:>12} {:>12} {:>8} {:>12}", "set-up", "about x", "about y", "stops", "stage time");
    for way in found {
        for (i, s) in way.set_ups.iter().enumerate() {
            let name = if i == 0 { way.name } else { "" };
            let [x, y] = s.lean_deg;
            let time = duration(s.stage_s);
            let _ = writeln!(out, "{name:<30} {x:>8.2} deg {y:>8.2} deg {:>8} {time:>12}", s.stops);
        }
        if way.set_ups.len() > 1 {
            let _ = writeln!(out, "{:<55} {:>8} {:>12}", "  together", way.stops(), duration(way.stage_s()));
        }
    }
    out.push_str(
        "\nEstimated from sample points; marking and set-up time not included. Angles rotate the part about\n\
         y, then about x (right-handed). Compiling the job also reports hidden and too steep areas.\n\n",
    );
    out
}

/// The table for machines.
fn json(found: &[Orientation], job: &Job, laying: Option<&Laying>, rotate: [Angle; 3]) -> Value {
    let side =
        laying.map(|laying| json!({"up": laying.up, "faces_lens": laying.faces_lens, "reason": laying.reason.name()}));
    json!({
        "orientations": found.iter().map(|orientation| orientation_json(orientation, job)).collect::<Vec<_>>(),
        "side": side,
        "rotate_deg": rotate.map(Angle::as_deg),
    })
}

fn orientation_json(orientation: &Orientation, job: &Job) -> Value {
    json!({
        "name": orientation.name,
        "set_ups": orientation.set_ups.iter().map(|set_up| set_up_json(set_up, job)).collect::<Vec<_>>(),
        "stops": orientation.stops(),
        "stage_s": orientation.stage_s(),
    })
}

fn set_up_json(set_up: &SetUp, job: &Job) -> Value {
    let [lo, hi] = [set_up.area.lo, set_up.area.hi];
    let area_mm = [lo.x, lo.y, hi.x, hi.y].map(mm_from_nm);
    json!({
        "area_mm": area_mm,
        "lean_deg": set_up.lean_deg,
        "rotate_deg": rotations(job, set_up).map(Angle::as_deg),
        "stops": set_up.stops,
        "stage_s": set_up.stage_s,
    })
}
