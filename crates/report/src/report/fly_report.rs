//! `report.html` of an on-the-fly job.

use std::fmt::Write;

use super::energy_map::EnergyMap;
use super::page::{self, escape};
use super::table::share as shown_share;
use super::{OnTheFlyLayout, energy, error_budget, job_report, length_text, plain, record};
use terrace_core::duration::duration;
use terrace_plan::manifest::LaserSwitching;

/// The report as the text of an HTML file.
pub fn on_the_fly_html(job: &OnTheFlyLayout<'_>, energy_map: &EnergyMap) -> String {
    let s = job.summary;
    let mut h = page::open(&format!("{}: job report", job.job), job.job, job_report::STYLE);
    let reasons = [
        ("off the part", s.lengths.skipped_off_part_mm),
        ("too steep", s.lengths.skipped_steep_mm),
        ("too small", s.lengths.skipped_small_mm),
        ("out of focus next to steps", s.lengths.skipped_focus_mm),
    ];
    let parts: Vec<String> = reasons
        .into_iter()
        .filter(|(_, mm)| *mm > 0.0)
        .map(|(why, mm)| format!("{why} {} ({})", length_text(mm), shown_share(100.0 * mm / s.lengths.texture_mm)))
        .collect();
    let texture = length_text(s.lengths.texture_mm);
    let lines = [
        job_report::NOT_VERIFIED.to_owned(),
        job_report::warnings_line(s.warnings.len()),
        if parts.is_empty() {
            format!("All of the texture is marked: {texture}.")
        } else {
            format!("Not marked of {texture}: {}.", parts.join(", "))
        },
        format!("A person attends {}: one program marks all, without a stop.", duration(s.time_s)),
    ];
    record::picture(&mut h, &format!("Marks over the part, {} of them", s.marks));
    job_report::verdict_block(&mut h, &lines);
    let _ = writeln!(
        h,
        "<p>Machine {}, axes {}, marking while the stage moves. {} in all.</p>",
        escape(&job.machine.name),
        job.program.kind.letters(),
        duration(s.time_s)
    );
    job_report::warnings(&mut h, &s.warnings);
    let rows = [
        ("Part", format!("{} x {} x {} mm", plain(s.part_mm[0], 3), plain(s.part_mm[1], 3), plain(s.part_mm[2], 3))),
        ("Moves", s.moves.to_string()),
        ("Marks", s.marks.to_string()),
        ("Time", duration(s.time_s)),
        ("Laser on", duration(s.mark_s)),
        ("Texture", texture),
        ("Marked", length_text(s.mark_mm)),
        ("Not marked", length_text(s.lengths.skipped_mm)),
        ("Jumps", length_text(s.jump_mm)),
        ("Worst defocus (FOD)", format!("{} um", plain(s.deviations.worst_fod_um, 2))),
        ("Worst incidence (BIA)", format!("{} deg", plain(s.deviations.worst_bia_deg, 2))),
        ("Farthest from the field's centre", format!("{} mm", plain(s.worst_displacement_mm, 3))),
        ("Fastest mark", format!("{} mm/s", plain(s.mark_speed_mm_s, 1))),
        ("Mean line energy", format!("{} J/m", plain(s.line_energy.mean_j_per_m, 4))),
        ("Length at the speed of the pens", format!("{} %", plain(s.line_energy.length_at_speed_percent, 1))),
        ("Laser on below half that speed", duration(s.line_energy.slow_s)),
        ("Most energy of a line over a spot", {
            let [x, y] = s.line_energy.worst_at_mm.map(|v| plain(v, 3));
            format!("{} times P / v of its pen, at ({x}, {y}) mm", plain(s.line_energy.worst_share, 2))
        }),
    ];
    let rows = rows.map(|(name, value)| (name.to_owned(), value)).into_iter().chain(s.laser.iter().map(switching_row));
    h.push_str("<div class=\"row\">\n<div class=\"wide\">\n<h2>Figures</h2>\n<table>\n");
    for (name, value) in rows {
        let _ = writeln!(h, "<tr><td>{name}</td><td>{value}</td></tr>");
    }
    h.push_str("</table>\n</div>\n<div class=\"wide\">\n<h2>Peaks of the axes</h2>\n<table>\n");
    h.push_str("<tr><th>axis</th><th>speed</th><th>acceleration</th><th>jerk</th></tr>\n");
    for (axis, peak) in &s.peaks {
        let unit = if ["A", "C"].contains(&axis.as_str()) { "deg" } else { "mm" };
        let _ = writeln!(
            h,
            "<tr><td>{axis}</td><td>{} {unit}/s</td><td>{} {unit}/s2</td><td>{} {unit}/s3</td></tr>",
            plain(peak.speed, 2),
            plain(peak.acceleration, 1),
            plain(peak.jerk, 0)
        );
    }
    h.push_str("</table>\n</div>\n</div>\n");
    energy::map_line(&mut h, energy_map);
    error_budget::section(&mut h, &s.budget);
    record::unmarked(&mut h, &job.scene.unmarked);
    record::histograms(&mut h, job.scene, &job.program.pens);
    record::pens(&mut h, &job.program.pens, job.machine);
    h + "</body>\n</html>\n"
}

/// Name and value of how early the laser is switched.
fn switching_row(l: &LaserSwitching) -> (String, String) {
    let early = format!("{} mm early: one period of {} s of the servo", plain(l.laser_error_mm, 4), l.servo_period_s);
    (format!("Laser of {} switched up to", l.file), early)
}
