//! The section of the report on line energy: what pens give, and where lines get more.
//!
//! Consumes a [`Layout`]; promises the nominal energy of every pen, the mean over the blocks, and the blocks whose lines
//! get most at a corner or an end.

use std::fmt::Write;

use super::energy_map::{EnergyMap, EnergyPeak};
use super::page::escape;
use super::{Layout, mm, plain};
use terrace_core::geom::Nm;
use terrace_core::motion::{Overshoot, Rest};
use terrace_core::program::BlockId;

/// Blocks that are listed.
const LISTED: usize = 10;

/// The line that leads to the map.
pub(super) fn map_line(h: &mut String, map: &EnergyMap) {
    let Some(EnergyPeak { median, ratio, centre: [x, y], cell }) = map.peak() else { return };
    let _ = writeln!(
        h,
        "<p><a href=\"energy.svg\">Map of the energy by area (energy.svg)</a>: median {} J/cm2 {} in cells of {} x {} mm; at most \
         {} times that, at ({}, {}) mm.</p>",
        plain(median, 3),
        map.area(),
        plain(cell[0], 3),
        plain(cell[1], 3),
        plain(ratio, 2),
        plain(x, 2),
        plain(y, 2),
    );
}

/// Writes the section.
pub(super) fn section(h: &mut String, job: &Layout<'_>, map: &EnergyMap) {
    let program = job.checked.program();
    h.push_str(
        "<h2>Line energy</h2>\n<div class=\"wide\"><table id=\"energy\">\n<tr><th>pen</th><th>P / v, J/m</th></tr>\n",
    );
    for pen in &program.pens {
        let nominal = 1e3 * pen.power.as_w(job.machine.laser.max_power) / pen.speed.as_mm_s();
        let _ = writeln!(h, "<tr><td>{}</td><td>{}</td></tr>", escape(&pen.name), plain(nominal, 4));
    }
    h.push_str("</table></div>\n");
    map_line(h, map);
    let energies = job.figures.iter().map(|figures| &figures.energy).enumerate();
    let mut worst: Vec<(usize, Overshoot, f64, f64)> =
        energies.filter_map(|(i, e)| Some((i, e.worst()?, e.mean_j_per_m()?, e.share_at_speed()?))).collect();
    if worst.is_empty() {
        h.push_str(
            "<p>Of corners and ends nothing is known: the machine file does not state scanner.acceleration, and the spot \
             counts as always at the speed of its pen.</p>\n",
        );
        return;
    }
    worst.sort_by(|a, b| b.1.ratio.total_cmp(&a.1.ratio));
    h.push_str(
        "<p>The spot rests at ends and corners of marks; the laser is on while it loses and gains speed. Worst: the \
         energy within half a spot of such a place, as a multiple of P / v of its pen. One pass of the pens.</p>\n\
         <div class=\"wide\"><table>\n<tr><th>block</th><th>mean, J/m</th><th>length at pen's speed</th><th>worst</th>\
         <th>at</th><th>x</th><th>y</th></tr>\n",
    );
    for (i, Overshoot { ratio, at, rest }, mean, at_speed) in worst.into_iter().take(LISTED) {
        let centre = program.blocks[i].stop.centre;
        let [x, y] = [centre.x + i64::from(at.x), centre.y + i64::from(at.y)].map(|v| mm(Nm(v), 3));
        let place = match rest {
            Rest::Corner => "corner",
            Rest::End => "end",
        };
        let _ = writeln!(
            h,
            "<tr><td>{}</td><td>{}</td><td>{} %</td><td>{} times</td><td>{place}</td><td>{x}</td><td>{y}</td></tr>",
            BlockId::new(i),
            plain(mean, 4),
            plain(100.0 * at_speed, 1),
            plain(ratio, 2),
        );
    }
    h.push_str("</table></div>\n");
}
