//! Where the centre of the field can go, on `layout.svg`: a dashed rectangle for every set-up.
//!
//! Only what lies on the sheet is drawn: the travel of a large stage around a small part shows no line.

use svg::Node;
use svg::node::element::Element;

use super::colour::TRAVEL;
use super::sheet::{FONT, Sheet, el, layer, num, text, titled};
use super::{Picture, plain};
use terrace_core::geom::mm_from_nm;
use terrace_core::machine::{Machine, Origin};

/// The rectangle in the drawing: left, top, right, bottom.
pub(super) fn rectangle(machine: &Machine, origin: Origin) -> [f64; 4] {
    let [x0, x1] = travel_mm(machine, origin, 0);
    let [y0, y1] = travel_mm(machine, origin, 1);
    [x0, -y1, x1, -y0]
}

/// From and to where the centre of the field can go along axis `k`, part frame, mm.
fn travel_mm(machine: &Machine, origin: Origin, k: usize) -> [f64; 2] {
    let (_, axis) = machine.axes()[k];
    let ends = axis.travel_nm().map(|end| mm_from_nm(axis.sign() * end.0 - origin[k]));
    [ends[0].min(ends[1]), ends[0].max(ends[1])]
}

/// How much of the rectangles lies on the sheet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Visibility {
    /// All sides.
    Whole,
    /// Some sides.
    Partly,
    /// None: the field can go everywhere on the sheet.
    None,
}

/// The sides of a rectangle that cross the view, as lines.
fn sides(view: [f64; 4], r: [f64; 4]) -> Vec<[f64; 4]> {
    let [x0, y0, x1, y1] = [r[0].max(view[0]), r[1].max(view[1]), r[2].min(view[2]), r[3].min(view[3])];
    let mut out = Vec::new();
    if x0 > x1 || y0 > y1 {
        return out;
    }
    for (k, x) in [(0, r[0]), (2, r[2])] {
        if x == [x0, x1][k / 2] {
            out.push([x, y0, x, y1]);
        }
    }
    for (k, y) in [(1, r[1]), (3, r[3])] {
        if y == [y0, y1][k / 2] {
            out.push([x0, y, x1, y]);
        }
    }
    out
}

/// How much of the travel of all set-ups the layer shows.
pub(super) fn visibility(job: &Picture<'_>, sheet: &Sheet) -> Visibility {
    let counts = job.origins.iter().map(|&origin| sides(sheet.view, rectangle(job.machine, origin)).len());
    match counts.sum::<usize>() {
        0 => Visibility::None,
        sum if sum == 4 * job.origins.len() => Visibility::Whole,
        _ => Visibility::Partly,
    }
}

/// The layer. Of several set-ups each has its number above the part.
pub(super) fn draw(job: &Picture<'_>, sheet: &Sheet) -> Element {
    let u = sheet.unit;
    let mut g = layer("layer-travel", "Machine travel", &[]);
    let width = num(0.18 * u);
    let dash = format!("{} {}", num(1.1 * u), num(0.7 * u));
    let look = [
        ("fill", "none"),
        ("stroke", TRAVEL),
        ("stroke-width", width.as_str()),
        ("stroke-dasharray", dash.as_str()),
        ("pointer-events", "stroke"),
    ];
    // Where the last number ends.
    let mut number_end = f64::NEG_INFINITY;
    for (k, &origin) in job.origins.iter().enumerate() {
        let r = rectangle(job.machine, origin);
        let d: String = sides(sheet.view, r)
            .into_iter()
            .map(|s| format!("M{} {}L{} {}", num(s[0]), num(s[1]), num(s[2]), num(s[3])))
            .collect();
        if !d.is_empty() {
            let mut path = el("path", &look);
            path.assign("d", d);
            g.append(titled(path, format!("set-up {}: {}", k + 1, words(r))));
        }
        // Set-ups come from the left to the right; those that lie one above the other share a number's place.
        let (left, right) = (r[0].max(sheet.view[0]), r[2].min(sheet.view[2]));
        let middle = (left + right) / 2.0;
        let half = 3.2 * FONT * u;
        if job.origins.len() > 1
            && left < right
            && middle - half > number_end
            && middle + half < sheet.view[2] + 2.0 * u
        {
            let mut t = text([middle, sheet.view[1] - 1.1 * u], FONT * u, "middle", &format!("set-up {}", k + 1));
            t.assign("fill", TRAVEL);
            g.append(t);
            number_end = middle + half;
        }
    }
    g
}

/// The size of the travel, and where it lies.
pub(super) fn words([x0, y0, x1, y1]: [f64; 4]) -> String {
    let [w, h, x0, x1, y0, y1] = [x1 - x0, y1 - y0, x0, x1, -y1, -y0].map(|v| plain(v, 1));
    format!("{w} x {h} mm, x {x0} to {x1}, y {y0} to {y1}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn travel_has_the_signs_of_the_axes_and_lies_where_the_part_does() {
        let mut machine = Machine::built_in("xyz-galvo-40").expect("profile");
        let travel = machine.stage.x.travel;
        let [lo, hi] = travel.map(|t| t.as_mm());
        for reversed in [false, true] {
            machine.stage.x.reversed = reversed;
            let origin = Origin([3_000_000, -5_000_000, 0]);
            let [x0, ..] = rectangle(&machine, origin);
            // Where the stage stands at an end of its travel, the field's centre is at an end of the rectangle.
            let end = if machine.stage.x.sign() > 0 { lo } else { -hi };
            assert!((x0 - (end - 3.0)).abs() < 1e-9, "{x0}");
        }
    }

    #[test]
    fn only_sides_in_view_are_drawn() {
        let view = [0.0, 0.0, 100.0, 50.0];
        assert_eq!(sides(view, [-10.0, -10.0, 110.0, 60.0]), Vec::<[f64; 4]>::new());
        assert_eq!(sides(view, [20.0, -10.0, 110.0, 60.0]), [[20.0, 0.0, 20.0, 50.0]]);
        assert_eq!(sides(view, [20.0, 10.0, 30.0, 20.0]).len(), 4);
        assert_eq!(sides(view, [200.0, 10.0, 300.0, 20.0]), Vec::<[f64; 4]>::new());
    }
}
