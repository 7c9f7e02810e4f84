//! `points.svg`: where a part is to be measured, and how surely its height would be known then.
//!
//! Consumes a [`Probing`]; promises one map over the places where something is marked, coloured by the standard deviation
//! of the height after these points, with the points in their order and the way between them. Units: um; places in mm.

use std::fmt::Write;

use super::measured_map::{Ground, HEAD, KEY, SIDE, Scale, WIDTH};
use super::page::escape;
use super::plain;
use crate::measured::Area;
use terrace_plan::probe::Probing;

/// Points beyond these have no names on the map.
const MOST_NAMED: usize = 150;

/// The text of the file.
pub fn points_svg(job: &str, probing: &Probing) -> String {
    let at = |point: &terrace_plan::probe::ProbePoint| [point.part_mm[0], point.part_mm[1]];
    let marked = probing.deviations.iter();
    let area = Area::around(marked.clone().map(|(at, _)| *at).chain(probing.points.iter().map(at)));
    // Marked places are about evenly apart; what lies farther from all of them than that is not marked.
    let apart = 1.5 * area.extent() / (probing.deviations.len() as f64).sqrt();
    let nearest = |place: [f64; 2]| {
        let away = |at: &[f64; 2]| (at[0] - place[0]).powi(2) + (at[1] - place[1]).powi(2);
        let found = marked.clone().map(|(at, sigma)| (away(at), *sigma)).min_by(|a, b| a.0.total_cmp(&b.0))?;
        (found.0 <= apart * apart).then_some(found.1 * 1e3)
    };
    let values: Vec<Option<f64>> = area.places().map(nearest).collect();
    let [least, most] = marked
        .clone()
        .map(|(_, sigma)| sigma * 1e3)
        .fold([f64::INFINITY, 0.0], |[lo, hi]: [f64; 2], v| [lo.min(v), hi.max(v)]);
    let scale = Scale::amount(if least.is_finite() { [least, most] } else { [0.0, 1.0] });
    let ground = Ground { area: &area, values: &values, scale: &scale };
    let (page, total) = (WIDTH + 2.0 * SIDE, HEAD + area.height() + KEY);
    let name = escape(job);
    let mut out = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<svg xmlns=\"http://www.w3.org/2000/svg\" \
         viewBox=\"0 0 {page} {total}\" font-family=\"sans-serif\" font-size=\"14\">\n\
         <title>{name}: where to measure</title>\n<rect width=\"{page}\" height=\"{total}\" fill=\"#ffffff\"/>\n\
         <text x=\"{SIDE}\" y=\"24\" font-size=\"18\">{name}: where to measure, {} points</text>\n",
        probing.points.len(),
    );
    ground.open(&mut out, SIDE, "Sigma of the height after these points, um");
    let places: Vec<[String; 2]> =
        probing.points.iter().map(|point| area.on_map(at(point)).map(|v| plain(v, 1))).collect();
    let way: Vec<String> = places.iter().map(|[u, v]| format!("{u},{v}")).collect();
    // Writing to a String cannot fail.
    let _ = writeln!(
        out,
        "<polyline points=\"{}\" fill=\"none\" stroke=\"#222\" stroke-width=\".7\" stroke-dasharray=\"4 3\"/>",
        way.join(" ")
    );
    for (point, [u, v]) in probing.points.iter().zip(&places) {
        let _ = writeln!(
            out,
            "<circle cx=\"{u}\" cy=\"{v}\" r=\"4\" fill=\"#fff\" stroke=\"#222\" stroke-width=\"1.2\"><title>{}</title></circle>",
            point.name
        );
        if probing.points.len() <= MOST_NAMED {
            let number = point.name.trim_start_matches(['P', '0']);
            let _ = writeln!(
                out,
                "<text x=\"{u}\" y=\"{v}\" dx=\"6\" dy=\"-4\" font-size=\"11\" stroke=\"#fff\" stroke-width=\"2.5\" \
                 paint-order=\"stroke\">{number}</text>"
            );
        }
    }
    ground.close(&mut out, "circles: points in their order; the way between them is dashed");
    out.push_str("</svg>\n");
    out
}
