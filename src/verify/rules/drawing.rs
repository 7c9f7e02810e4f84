//! `drawing`: what is marked of an SVG drawing lies where the drawing shows something, and has the pen of its colour.
//!
//! The drawing is read by the verifier's own reader (`read::picture`). Lines are sampled at three places each, at most
//! [`MAX_LINES`] lines of a drawing, evenly. Colours alone tell pens: labels are not read here, so drawings of which a
//! texture leaves something out by `only` or `except` are not checked.

use std::path::Path;

use crate::geom::P2;
use crate::job::Job;
use crate::texture::{FillMode, Kind, Mirror, Selector, Texture};
use crate::verify::proof::Rule;
use crate::verify::read::picture::Picture;

/// Most lines of one drawing that are looked at.
const MAX_LINES: usize = 30_000;

/// Coordinates of the reader are f32: a share of the drawing's size.
const F32: f64 = 1e-6;

const WHITE: [u8; 3] = [255; 3];

/// Holds the rule for the textures of a pass.
pub(in crate::verify) fn check(job: &Job, texture: &Texture, rule: &mut Rule) {
    rule.ran = true;
    let mut pictures: Vec<(&Path, Option<Picture>)> = Vec::new();
    for (number, request) in job.textures.iter().enumerate() {
        let Kind::Drawing { path, marking, .. } = &request.kind else { continue };
        if !(marking.only.is_empty() && marking.except.is_empty()) {
            continue;
        }
        if !pictures.iter().any(|(known, _)| known == path) {
            pictures.push((path, read(path)));
        }
        let picture = pictures.iter().find(|(known, _)| known == path).and_then(|(_, picture)| picture.as_ref());
        let Some(picture) = picture else { continue };
        let strokes = texture.strokes_of(number);
        let stride = strokes.len().div_ceil(MAX_LINES).max(1);
        let pens =
            |colour: [u8; 3]| marking.pens.iter().find(|(s, _)| *s == Selector::Colour(colour)).map(|(_, pen)| *pen);
        // Contours and centre lines may lie on a border, curves off it by the tolerance.
        let slack = 2.0 * request.tolerance_mm;
        let is_outline = marking.fill == FillMode::Outline;
        let mut points = Vec::new();
        for i in strokes.step_by(stride) {
            let pen = texture.stroke(i, &mut points);
            for p in samples(&points) {
                let Some((mut at, page)) = texture.on_page(i, p) else { continue };
                match marking.mirror {
                    Some(Mirror::X) => at[0] = page[0] - at[0],
                    Some(Mirror::Y) => at[1] = page[1] - at[1],
                    None => {}
                }
                rule.checked += 1;
                let scale = [picture.size[0] / page[0], picture.size[1] / page[1]];
                let slack = slack + page[0].max(page[1]) * F32;
                let is_ink = |c: &[u8; 3]| *c != WHITE || pens(WHITE).is_some();
                let has_pen = |c: &[u8; 3]| match pens(*c) {
                    Some(own) => own == pen,
                    None => {
                        pen == request.pen
                            || marking.pens.iter().any(|(s, p)| matches!(s, Selector::Label(_)) && *p == pen)
                    }
                };
                let colour_at = |q: [f64; 2]| picture.colour_at([q[0] * scale[0], (page[1] - q[1]) * scale[1]]);
                // Nearly all marks are right, and where they are the point itself tells.
                if colour_at(at).is_some_and(|c| is_ink(&c) && has_pen(&c)) {
                    continue;
                }
                let seen: Vec<[u8; 3]> = around(at, slack).filter_map(colour_at).collect();
                if !seen.iter().any(is_ink) {
                    rule.broken(
                        "",
                        texture.element(i),
                        format!(
                            "it is marked where the drawing shows nothing, at {:.4}, {:.4} mm of the page",
                            at[0], at[1]
                        ),
                    );
                } else if !seen.iter().any(|c| is_ink(c) && has_pen(c)) && !is_outline {
                    rule.broken("", texture.element(i), "its pen is not that of its colour");
                }
            }
        }
    }
}

/// The picture of an SVG drawing, if it can be read.
fn read(path: &Path) -> Option<Picture> {
    let is_svg = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("svg"));
    if is_svg { Picture::read(&std::fs::read_to_string(path).ok()?) } else { None }
}

/// Points of a line, not at its ends.
fn samples(points: &[P2]) -> impl Iterator<Item = [f64; 2]> + '_ {
    let sides = points.len() - 1;
    [(0, 0.25), (sides / 2, 0.5), (sides - 1, 0.75)].into_iter().map(move |(k, t)| {
        let (a, b) = (points[k], points[k + 1]);
        [a.x as f64 + t * (b.x - a.x) as f64, a.y as f64 + t * (b.y - a.y) as f64]
    })
}

/// A point and eight about it.
fn around(p: [f64; 2], by: f64) -> impl Iterator<Item = [f64; 2]> {
    let steps = [0.0, -by, by];
    steps.into_iter().flat_map(move |x| steps.map(|y| [p[0] + x, p[1] + y]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::BoxMm;
    use crate::job::Overrides;

    const PENS: [&str; 6] = ["a", "b", "c", "d", "e", "f"];
    const COLOURS: [&str; 6] = ["#000000", "#ff0000", "#00ff00", "#0000ff", "#ff00ff", "#808080"];

    /// A job of one drawing with a pen for each of six colours.
    fn job(folder: &Path, more: &str) -> Job {
        let pens: Vec<String> = COLOURS.iter().zip(PENS).map(|(c, pen)| format!("{c:?} = {pen:?}")).collect();
        let made = |name: &&str| {
            format!("[[pen]]\nname = {name:?}\nspeed = \"100 mm/s\"\npower = \"5 %\"\nfrequency = \"60 kHz\"\n")
        };
        let text = format!(
            "surface = {{ file = \"x.stl\", unit = \"mm\" }}\nfocus = {{ pdof = \"0.1 mm\" }}\n\
             machine = {{ profile = \"xyz-galvo-40\" }}\n[[texture]]\nfile = \"d.svg\"\nturn = \"20 deg\"\n\
             pens = {{ {} }}\n{more}\n{}",
            pens.join(", "),
            PENS.iter().map(made).collect::<String>()
        );
        Job::parse(&folder.join("job.toml"), &text, &Overrides::default()).expect("a job")
    }

    /// Six layers, each of one colour: a square with a line across it.
    fn layers(colours: [&str; 6]) -> String {
        let layer = |(k, colour): (usize, &&str)| {
            let x = 3 * k + 1;
            format!(
                "<g id=\"l{k}\" fill=\"{colour}\" stroke=\"{colour}\" stroke-width=\"0.01\">\
                 <rect x=\"{x}\" y=\"1\" width=\"2\" height=\"2\"/><path d=\"M{x} 6h2\" fill=\"none\"/></g>"
            )
        };
        let body: String = colours.iter().enumerate().map(layer).collect();
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"20mm\" height=\"10mm\" viewBox=\"0 0 20 10\">{body}</svg>"
        )
    }

    /// What the rule finds if the drawing changes after it has been placed.
    fn found(more: &str, before: &str, after: &str) -> Rule {
        let folder = tempfile::tempdir().expect("a folder");
        let drawing = folder.path().join("d.svg");
        std::fs::write(&drawing, before).expect("written");
        let job = job(folder.path(), more);
        let area = BoxMm::rectangle(0.0, 0.0, 100.0, 100.0);
        let texture = Texture::load(&job.textures, area, 0.3, 0.03, &mut Vec::new()).expect("a texture");
        std::fs::write(&drawing, after).expect("written");
        let mut rule = Rule::new("drawing", "");
        check(&job, &texture, &mut rule);
        rule
    }

    #[test]
    fn six_colours_have_their_pens() {
        let drawn = layers(COLOURS);
        for more in ["", "mirror = \"x\"", "tile = true\narea = \"part\"", "fill = \"outline\"", "fill = \"rings\""] {
            let rule = found(&format!("{more}\npitch = \"0.1 mm\""), &drawn, &drawn);
            assert!(rule.checked >= 36 && rule.violated == 0, "{more}: {:?}", rule.violations);
        }
    }

    #[test]
    fn what_is_fully_transparent_hides_nothing() {
        let glass = "<path d=\"M0 0h20v10h-20z\" fill=\"white\" fill-opacity=\"0\" stroke=\"white\" stroke-width=\"9\" \
                     stroke-opacity=\"0\"/></svg>";
        let drawn = layers(COLOURS).replace("</svg>", glass);
        let rule = found("pitch = \"0.1 mm\"", &drawn, &drawn);
        assert!(rule.checked >= 36 && rule.violated == 0, "{:?}", rule.violations);
    }

    #[test]
    fn a_pen_of_another_colour_and_a_mark_beside_its_figure_are_found() {
        let drawn = layers(COLOURS);
        let [a, b, c, d, e, f] = COLOURS;
        for other in [
            layers([b, a, c, d, e, f]),
            drawn.replacen("width=\"2\"", "width=\"1\"", 1),
            drawn.replacen("M1 6", "M1 7", 1),
        ] {
            let rule = found("pitch = \"0.1 mm\"", &drawn, &other);
            assert!(rule.violated > 0, "{other}");
        }
    }
}
