//! Fixtures on `layout.svg`, as they are seen from the lens: every facet, or boxes over what has very many.

use std::fmt::Write;

use svg::Node;
use svg::node::element::Element;

use super::colour::FIXTURE;
use super::sheet::{LEAST_FONT, Sheet, el, layer, num, text, titled};
use super::{Picture, clean, plain};
use terrace_core::geom::NM_PER_MM;
use terrace_plan::fixtures::Fixture;

/// Of a fixture with more facets boxes are drawn.
const MOST_FACETS: usize = 4000;

/// The layer; what lies beyond the sheet is cut off.
pub(super) fn draw(job: &Picture<'_>, sheet: &Sheet) -> Option<Element> {
    let fixtures = job.stepped().map_or(&[][..], |layout| layout.fixtures);
    if fixtures.is_empty() {
        return None;
    }
    let [x0, y0, x1, y1] = sheet.view;
    let mut g = layer("layer-fixtures", "Fixtures", &[]);
    let mut clip = el("clipPath", &[("id", "on-sheet")]);
    let size = [("width", num(x1 - x0)), ("height", num(y1 - y0))];
    let mut rect = el("rect", &[("x", &num(x0)), ("y", &num(y0))]);
    size.iter().for_each(|(key, value)| rect.assign(*key, value.as_str()));
    clip.append(rect);
    g.append(clip);
    for fixture in fixtures {
        let look = [("fill", FIXTURE), ("fill-opacity", "0.55"), ("clip-path", "url(#on-sheet)")];
        let mut path = el("path", &look);
        path.assign("d", shape(fixture));
        g.append(titled(path, words(fixture)));
        let [lo, hi] = fixture.ends().map(|p| [p[0] / NM_PER_MM, -p[1] / NM_PER_MM]);
        let middle = [
            f64::midpoint(lo[0].max(x0), hi[0].min(x1)),
            f64::midpoint(hi[1].max(y0), lo[1].min(y1)) + 0.35 * LEAST_FONT * sheet.unit,
        ];
        if (x0..=x1).contains(&middle[0]) && (y0..=y1).contains(&middle[1]) {
            let mut name = text(middle, LEAST_FONT * sheet.unit, "middle", &fixture.name);
            let width = num(0.35 * sheet.unit);
            for (key, value) in [("stroke", "#fff"), ("stroke-width", width.as_str()), ("paint-order", "stroke")] {
                name.assign(key, value);
            }
            g.append(name);
        }
    }
    Some(g)
}

/// The facets of a fixture as one path, each the same way round so that they cover what any of them covers.
fn shape(fixture: &Fixture) -> String {
    let mut d = String::new();
    let mut add = |corners: &[[f64; 2]]| {
        for (i, [x, y]) in corners.iter().enumerate() {
            let _ = write!(d, "{}{} {}", if i == 0 { "M" } else { "L" }, num(x / NM_PER_MM), num(-y / NM_PER_MM));
        }
        d.push('Z');
    };
    if fixture.facets.len() > MOST_FACETS {
        for (area, _) in fixture.tiles() {
            let ([x0, y0], [x1, y1]) = (area.lo.mm(), area.hi.mm());
            add(&[[x0, y0], [x1, y0], [x1, y1], [x0, y1]].map(|p| p.map(|mm| mm * NM_PER_MM)));
        }
        return d;
    }
    for facet in &fixture.facets {
        let [a, b, c] = facet.map(|[x, y, _]| [x, y]);
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        if area > 0.0 {
            add(&[a, b, c]);
        } else if area < 0.0 {
            add(&[a, c, b]);
        }
    }
    d
}

/// "fixture clamp, z 0.0 to 25.0 mm, in set-up 1".
fn words(fixture: &Fixture) -> String {
    let [lo, hi] = fixture.ends().map(|p| plain(p[2] / NM_PER_MM, 1));
    let setups: Vec<String> = fixture.setups.iter().map(|setup| setup.number().to_string()).collect();
    let setups = if setups.is_empty() { String::new() } else { format!(", in set-up {}", setups.join(", ")) };
    format!("fixture {}, z {lo} to {hi} mm{setups}", clean(&fixture.name))
}
