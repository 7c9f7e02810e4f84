//! What the reports of both modes have: the picture, what is not marked, histograms by marked length, pens.

use std::fmt::Write;

use super::page::escape;
use super::plain;
use super::sheet::num;
use super::table::share as shown_share;
use crate::scene::{Histogram, Scene, Unmarked};
use terrace_core::geom::Nm;
use terrace_core::machine::Machine;
use terrace_core::program::Pen;

/// `layout.svg` beside the page, which leads to the view in 3D.
pub(super) fn picture(h: &mut String, alt: &str) {
    let _ = writeln!(
        h,
        "<p class=\"picture\"><a href=\"view.html\"><img src=\"layout.svg\" alt=\"{}\"/></a></p>\n\
         <p><a href=\"view.html\">Every mark in 3D, with the machine's clock (view.html)</a></p>",
        escape(alt)
    );
}

/// What is not marked of the first pass: why, how much, what share of its texture, and where.
pub(super) fn unmarked(h: &mut String, unmarked: &Unmarked) {
    if unmarked.rows.is_empty() {
        return;
    }
    h.push_str(
        "<h2>Texture that is not marked</h2>\n<p>Of the first pass, each stroke once; red in the pictures, but for \
         patterns beyond the part, which are meant to end there.</p>\n<div class=\"wide\"><table id=\"unmarked\">\n\
         <tr><th>why</th><th>texture</th><th>length, mm</th><th>dots</th><th>share of the texture</th><th>from x, y, mm</th>\
         <th>to x, y, mm</th></tr>\n",
    );
    for row in &unmarked.rows {
        let class = if row.reason.is_fault() { " class=\"fault\"" } else { "" };
        let corner = |p: terrace_core::geom::P2| [p.x, p.y].map(|v| plain(Nm(v).mm(), 2)).join(", ");
        let _ = writeln!(
            h,
            "<tr{class}><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>",
            row.reason.text(),
            row.texture,
            plain(row.length_mm, 3),
            row.dots,
            shown_share(row.share_percent),
            corner(row.area.lo),
            corner(row.area.hi)
        );
    }
    h.push_str("</table></div>\n");
}

/// How much of the marks has which defocus and which incidence.
pub(super) fn histograms(h: &mut String, scene: &Scene, pens: &[Pen]) {
    if scene.mark_count() == 0 {
        return;
    }
    let passes: Vec<u32> = pens.iter().map(|pen| pen.passes).collect();
    h.push_str("<h2>Marks by defocus and by incidence</h2>\n<div class=\"row\">\n");
    bars(h, &Histogram::of_defocus(scene, &passes), "defocus, um", "marked length by defocus");
    bars(h, &Histogram::of_incidence(scene, &passes), "incidence, deg", "marked length by incidence");
    h.push_str("</div>\n");
}

/// The bars of a histogram; their heights are shares of what is marked.
fn bars(h: &mut String, histogram: &Histogram, axis: &str, label: &str) {
    let sum: f64 = histogram.bins.iter().sum();
    let share = |v: f64| if sum > 0.0 { 100.0 * v / sum } else { 0.0 };
    let most = histogram.bins.iter().copied().map(share).fold(0.0, f64::max).max(f64::MIN_POSITIVE);
    let left = 46.0;
    let wide = 430.0;
    let high = 120.0;
    let step = wide / histogram.bins.len() as f64;
    let edges = histogram.edges();
    let _ = write!(
        h,
        "<div><svg viewBox=\"0 0 500 170\" style=\"width:500px;max-width:100%;height:auto\" font-size=\"12\" role=\"img\" \
         aria-label=\"{label}\">"
    );
    for (k, &v) in histogram.bins.iter().enumerate() {
        let tall = high * share(v) / most;
        let _ = write!(
            h,
            "<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" fill=\"#0070b6\"><title>{} %, {} mm, from {} to {}</title></rect>",
            plain(left + step * k as f64 + 0.5, 2),
            plain(10.0 + high - tall, 2),
            plain(step - 1.0, 2),
            plain(tall, 2),
            plain(share(v), 2),
            plain(v, 1),
            plain(edges[k], 2),
            plain(edges[k + 1], 2)
        );
    }
    let _ = write!(h, "<path d=\"M{left} 10V130H{}\" fill=\"none\" stroke=\"#111\"/>", left + wide);
    let _ = write!(h, "<text x=\"{}\" y=\"18\" text-anchor=\"end\">{} %</text>", left - 4.0, plain(most, 0));
    let _ = write!(h, "<text x=\"{}\" y=\"130\" text-anchor=\"end\">0</text>", left - 4.0);
    let [lo, hi] = histogram.range;
    for k in 0..=4 {
        let (x, v) = (left + wide * f64::from(k) / 4.0, plain(lo + (hi - lo) * f64::from(k) / 4.0, 1));
        let _ = write!(h, "<text x=\"{x}\" y=\"146\" text-anchor=\"middle\">{v}</text>");
    }
    let _ = writeln!(
        h,
        "<text x=\"{}\" y=\"165\" text-anchor=\"middle\">{axis}; bars: share of the marked length</text></svg></div>",
        left + wide / 2.0
    );
}

/// The settings of the laser.
pub(super) fn pens(h: &mut String, pens: &[Pen], machine: &Machine) {
    h.push_str(
        "<h2>Pens</h2>\n<div class=\"wide\"><table>\n\
         <tr><th>pen</th><th>speed</th><th>power</th><th>frequency</th><th>passes</th>\
         <th>dwell of dots</th></tr>\n",
    );
    for pen in pens {
        let name = escape(&pen.name);
        let watts = plain(pen.power.as_w(machine.laser.max_power), 2);
        let speed = pen.speed.as_mm_s();
        let frequency = pen.frequency.as_khz();
        let _ = writeln!(
            h,
            "<tr><td>{name}</td><td>{speed} mm/s</td><td>{} ({watts} W)</td><td>{frequency} kHz</td><td>{}</td>\
             <td>{}</td></tr>",
            escape(&pen.power.to_string()),
            pen.passes,
            pen.dwell.map_or_else(String::new, |dwell| format!("{} us", num(dwell.as_us())))
        );
    }
    h.push_str("</table></div>\n");
}
