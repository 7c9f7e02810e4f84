//! The error and depth budget in the reports of both modes.

use std::fmt::Write;

use super::page::escape;
use super::plain;
use terrace_plan::budget::{Budget, Cause, TOLERATED, Terms};

/// A table for where marks are and one for how far from focus, each with its terms and what they come to.
pub(super) fn section(h: &mut String, budget: &Budget) {
    let Budget { pdof_mm, reserve_mm, lateral, depth, depth_left_um } = budget;
    let [pdof, reserve] = [pdof_mm, reserve_mm].map(|mm| plain(mm * 1e3, 1));
    let _ = writeln!(
        h,
        "<h2>Error and depth budget</h2>\n<p>PDOF {pdof} um, of which {reserve} um are kept for errors (focus.reserve). \
         Each term is a bound, and so is their sum; the root of the sum of squares is what to expect where the terms are \
         independent of each other. What is not stated comes on top. {}</p>\n\
         <div class=\"row\" id=\"budget\" style=\"row-gap:1em\">",
        warned_of(*reserve_mm),
    );
    table(h, "Lateral, um", lateral, &[]);
    let left = [("left of PDOF", plain(*depth_left_um, 2))];
    table(h, "Depth, um", depth, &left);
    h.push_str("</div>\n");
}

/// From where on the sum of the depth terms is warned of.
fn warned_of(reserve_mm: f64) -> String {
    if reserve_mm > 0.0 {
        return "A warning says where the sum in depth exceeds what is left of PDOF by more than an increment of the \
                stage."
            .to_owned();
    }
    format!(
        "Without a reserve, a warning comes only where the sum in depth exceeds what is left of PDOF by {} % of half the \
         depth range.",
        plain(100.0 * TOLERATED, 0)
    )
}

/// The terms of one side.
fn table(h: &mut String, title: &str, side: &Terms, more: &[(&str, String)]) {
    let of = side.block.as_ref().map_or("worst marks".to_owned(), |block| format!("worst block {}", escape(block)));
    let _ = write!(h, "<div class=\"wide\"><table>\n<tr><th>{title}</th><th>{of}</th><th>stated by</th></tr>\n");
    for term in &side.terms {
        let stated = match (term.cause, term.um, term.cause.key()) {
            (Cause::Tessellation, Some(_), _) => "surface file",
            (Cause::Projection, ..) => "pitch, slope",
            (Cause::Slope, ..) => "lateral errors, slope",
            (Cause::Relief, ..) => "in the defocus, not summed",
            (Cause::Tilt, ..) => "not modelled",
            (_, _, key) => key.unwrap_or_default(),
        };
        let um = term.um.map_or_else(|| "not stated".to_owned(), |um| plain(um, 2));
        let _ = writeln!(h, "<tr><td>{}</td><td>{um}</td><td>{stated}</td></tr>", term.cause.name());
    }
    let [sum, rss] = [side.sum_um, side.rss_um].map(|um| plain(um, 2));
    let totals = [("sum of what is stated", sum), ("root of the sum of squares", rss)];
    for (name, value) in totals.iter().chain(more) {
        let _ = writeln!(h, "<tr><th>{name}</th><th>{value}</th><th></th></tr>");
    }
    h.push_str("</table></div>\n");
}
