//! `runsheet.txt` of an on-the-fly job.

use std::fmt::Write;

use super::runsheet::{budget, clock, field, pens};
use terrace_core::diag;
use terrace_plan::emit::TARGETS;
use terrace_plan::manifest::{LaserSwitching, OnTheFlyFacts, portable};

/// The sheet for the operator, plain text of fixed width. `job_file` is the path from the job folder to the job file,
/// `files` are the programs in the folder.
pub fn on_the_fly_txt(facts: &OnTheFlyFacts<'_>, job_file: &str, files: &[&str]) -> Vec<u8> {
    let mut out = String::new();
    // Writing to a String cannot fail.
    let _ = written(&mut out, facts, job_file, files);
    diag::escaped(&out).into_owned().into_bytes()
}

fn written(out: &mut String, facts: &OnTheFlyFacts<'_>, job_file: &str, files: &[&str]) -> std::fmt::Result {
    let OnTheFlyFacts { job, machine, program, summary: s, .. } = *facts;
    let [x, y, z] = program.origin.mm();
    writeln!(out, "RUN SHEET, ON THE FLY\n")?;
    writeln!(out, "job        {}", portable(job_file))?;
    writeln!(out, "part       {}", portable(&job.surface.file.display().to_string()))?;
    let [w, d, h] = s.part_mm;
    writeln!(out, "size       {w:.3} x {d:.3} x {h:.3} mm as it is laid")?;
    writeln!(out, "machine    {}, axes {}", machine.name, program.kind.letters())?;
    writeln!(out, "field      {}", field(machine))?;
    writeln!(out, "part zero  X{x:.4} Y{y:.4} Z{z:.4} mm in the table frame")?;
    if let Some([x, y, z]) = job.placement.laid_deg() {
        writeln!(out, "part laid  rotated {x} deg about x, {y} deg about y, {z} deg about z of its file")?;
    }
    writeln!(out, "part turn  {} deg about z", job.placement.turn.as_deg())?;
    writeln!(out, "marks      {} in {} moves, {:.1} mm", s.marks, s.moves, s.mark_mm)?;
    writeln!(out, "not marked {:.1} mm", s.lengths.skipped_mm)?;
    writeln!(
        out,
        "defocus    {:.1} um at most, {:.1} um allowed",
        s.deviations.worst_fod_um,
        job.focus.half_depth_mm() * 1e3
    )?;
    budget(out, &s.budget)?;
    writeln!(out, "incidence  {:.2} deg at most", s.deviations.worst_bia_deg)?;
    writeln!(out, "time       {} ({} with the laser on)", clock(s.time_s), clock(s.mark_s))?;
    if job.power_by_speed {
        writeln!(out, "power      follows the speed of the spot: every length of a line gets as much")?;
    }
    let energy = &s.line_energy;
    writeln!(
        out,
        "energy     up to {:.2} times P / v of its pen over a spot, {:.1} % of the marks at the speed of the pens",
        energy.worst_share, energy.length_at_speed_percent
    )?;
    for LaserSwitching { file, servo_period_s, laser_error_mm } in &s.laser {
        writeln!(
            out,
            "laser      switched up to {laser_error_mm:.4} mm early in {file}: one period of {servo_period_s} s of the \
             servo at {:.1} mm/s",
            s.mark_speed_mm_s
        )?;
    }
    for warning in &s.warnings {
        writeln!(out, "WARNING    {}", warning.message)?;
    }
    pens(out, &program.pens, machine, "the program sets speed and power: set the frequency at the laser")?;
    writeln!(out, "\nPEAKS OF THE AXES (the drives must reach these)")?;
    for (axis, peak) in &s.peaks {
        let unit = if ["A", "C"].contains(&axis.as_str()) { "deg" } else { "mm" };
        writeln!(
            out,
            "  {axis}  {:>10.2} {unit}/s  {:>12.1} {unit}/s2  {:>14.0} {unit}/s3",
            peak.speed, peak.acceleration, peak.jerk
        )?;
    }
    writeln!(out, "\nBEFORE THE FIRST MARK")?;
    writeln!(
        out,
        "  - Place the part so that its zero and turn are as this sheet says, and compare it with layout.svg."
    )?;
    writeln!(
        out,
        "  - Find the focus on the part where the program begins: X{:.4} Y{:.4} Z{:.4}.",
        start(facts, 0),
        start(facts, 1),
        start(facts, 2)
    )?;
    writeln!(out, "  - Run the program once with the laser source off, and once with the pilot laser.")?;
    writeln!(
        out,
        "  - Stage and scanner must follow together: a program that is stopped is not continued, but begun anew."
    )?;
    writeln!(
        out,
        "  - terrace is not a safety system. Enclosure, interlock, eye protection and emergency stop are your own."
    )?;
    writeln!(out, "\nFILES")?;
    for file in files {
        let target = TARGETS.iter().find(|t| t.on_the_fly.as_ref().is_some_and(|f| f.name == *file));
        let name = target.map_or("", |t| t.name());
        writeln!(out, "  - {file} ({name}): the whole job, see docs/how-to/operating.md, On the fly")?;
    }
    Ok(())
}

/// Where an axis of the stage stands at the program's start, mm.
fn start(facts: &OnTheFlyFacts<'_>, axis: usize) -> f64 {
    terrace_core::geom::mm_from_nm(facts.program.start[axis])
}
