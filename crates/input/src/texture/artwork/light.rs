//! Warnings about colours that may be meant as the page, and about what is translucent in the colour of the page.

use std::collections::{BTreeMap, BTreeSet};

use super::area::PolygonArea;
use super::choice::Class;
use super::paper::is_light;
use super::{Artwork, Colour, Marking, PaintedShape, Paper, Selector, ShapeFigure};
use terrace_core::diag::Diag;

/// Opacity from which on a shape in the colour of the page hides what lies below it. Below it, more is seen of what
/// lies below than of the shape.
pub(super) const HIDES: f32 = 0.5;

/// Most colours that a warning lists.
const MAX_LISTED: usize = 6;

/// What is reported.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Issue {
    /// The shape is marked, and may be meant as the page.
    Light,
    /// In the colour of the page, and so translucent that it hides nothing.
    HidesNothing,
    /// In the colour of the page and translucent, and hides what lies below.
    HidesAll,
}

/// The warnings of a drawing whose shapes have these classes; `area` returns the area of a shape by its number.
pub(super) fn warnings(
    art: &Artwork,
    marking: &Marking,
    classes: &[Class],
    area: impl Fn(usize) -> Option<PolygonArea>,
) -> Vec<Diag> {
    let colours: BTreeSet<Colour> = art.shapes.iter().map(|shape| shape.colour).collect();
    let light = colours.into_iter().filter(|c| is_light(*c) && !marking.names(*c)).collect();
    let issues: Vec<Option<Issue>> =
        art.shapes.iter().zip(classes).map(|(s, class)| issue(s, *class, &light)).collect();
    let mut out = Vec::new();
    for issue in [Issue::Light, Issue::HidesNothing, Issue::HidesAll] {
        let shapes: Vec<usize> = (0..issues.len()).filter(|&i| issues[i] == Some(issue)).collect();
        let Some(&first) = shapes.first() else { continue };
        let mut by_colour: BTreeMap<Colour, Vec<usize>> = BTreeMap::new();
        shapes.iter().for_each(|&i| by_colour.entry(art.shapes[i].colour).or_default().push(i));
        let mut colours: Vec<(Colour, Option<f64>)> =
            by_colour.into_iter().map(|(colour, shapes)| (colour, covered_mm2(&shapes, &area))).collect();
        colours.sort_by(|a, b| b.1.unwrap_or(0.0).total_cmp(&a.1.unwrap_or(0.0)));
        let element = &art.names[art.shapes[first].name as usize];
        out.push(issue.warning(&colours, shapes.len(), element, marking.paper));
    }
    out
}

/// What is reported of a shape; `light` has the light colours that nothing names.
fn issue(shape: &PaintedShape, class: Class, light: &BTreeSet<Colour>) -> Option<Issue> {
    match (class, shape.figure) {
        (_, ShapeFigure::Grey(_)) => None,
        (Class::Pen(_), _) if light.contains(&shape.colour) => Some(Issue::Light),
        // Lines hide nothing, opaque or not.
        (Class::Page, ShapeFigure::Fill(_) | ShapeFigure::Stroke) if shape.opacity < HIDES => Some(Issue::HidesNothing),
        (Class::Page, ShapeFigure::Fill(_) | ShapeFigure::Stroke) if shape.opacity < 1.0 => Some(Issue::HidesAll),
        _ => None,
    }
}

/// What shapes cover together, mm²; None for lines, and where it takes too long to find out.
fn covered_mm2(shapes: &[usize], area: &impl Fn(usize) -> Option<PolygonArea>) -> Option<f64> {
    let areas: Vec<PolygonArea> = shapes.iter().filter_map(|&i| area(i)).collect();
    let union = if areas.is_empty() { None } else { PolygonArea::union(areas.iter()).ok() };
    union.map(|union| union.size_mm2())
}

impl Issue {
    fn warning(self, colours: &[(Colour, Option<f64>)], shapes: usize, first: &str, paper: Paper) -> Diag {
        let name = |colour| Selector::Colour(colour).to_string();
        let name_with_area = |(colour, mm2): &(Colour, Option<f64>)| match mm2 {
            Some(mm2) => format!("{} on {mm2:.2} mm2", name(*colour)),
            None => name(*colour),
        };
        let mut list: Vec<String> = colours.iter().take(MAX_LISTED).map(name_with_area).collect();
        if colours.len() > MAX_LISTED {
            list.push(format!("{} more colours", colours.len() - MAX_LISTED));
        }
        let list = format!("{} ({shapes}, first {first})", list.join(", "));
        match self {
            Self::Light => {
                let (colour, _) = colours[0];
                let hint = if paper.holds(colour) {
                    "a label of pens gives them a pen: name the colours in pens that are to be marked, not the label"
                        .into()
                } else {
                    let name = name(colour);
                    format!(
                        "to make such a colour the page write paper = \"{name}\"; to mark it on purpose name it in pens or \
                         only"
                    )
                };
                Diag::warning("texture-light", format!("shapes in light colours are marked: {list}")).hint(hint)
            }
            Self::HidesNothing => {
                let text = "shapes in the colour of the page with less than half opacity hide nothing";
                Diag::warning("texture-translucent", format!("{text}: {list}")).hint("make them opaque, or remove them")
            }
            Self::HidesAll => {
                let text = "translucent shapes in the colour of the page hide what lies below like opaque ones";
                Diag::warning("texture-translucent", format!("{text}: {list}"))
                    .hint("make them opaque, or less than half opaque where what lies below is to be marked")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::texture::artwork::{Labels, WindingRule, marks};
    use terrace_core::program::PenId;

    /// Squares of which each lies in the one before: side, colour, opacity.
    fn squares(all: &[(f64, u32, f32)]) -> Artwork {
        let mut art = Artwork { size: [20.0; 2], labels: vec![Labels::default()], ..Artwork::default() };
        for (i, &(side, colour, opacity)) in all.iter().enumerate() {
            let (lo, hi) = (10.0 - side / 2.0, 10.0 + side / 2.0);
            art.lines.push(&[[lo, lo], [hi, lo], [hi, hi], [lo, hi], [lo, lo]]);
            art.names.push(format!("square {}", i + 1));
            art.shapes.push(PaintedShape {
                name: i as u32,
                labels: 0,
                colour: [colour >> 16, colour >> 8, colour].map(|v| (v & 255) as u8),
                opacity,
                figure: ShapeFigure::Fill(WindingRule::EvenOdd),
                lines: i..i + 1,
                clip: None,
            });
        }
        art
    }

    /// The area that is marked, mm², and the warnings.
    fn marked(art: &Artwork, marking: Marking) -> (f64, Vec<Diag>) {
        let marking = Marking { pitch_mm: Some(0.1), inset_mm: Some(0.0), ..marking };
        let mut notes = Vec::new();
        let page = marks(art, &marking, 0.1, 0.0, &mut notes).expect("marks");
        let length: f64 = page.lines.iter().flat_map(|l| l.windows(2)).map(|s| (s[1][0] - s[0][0]).abs()).sum();
        ((length * 0.1).round(), notes)
    }

    fn select(names: &[&str]) -> Vec<Selector> {
        names.iter().map(|n| Selector::parse(n).expect("a selector")).collect()
    }

    #[test]
    fn translucent_shapes_in_the_colour_of_the_page_hide_from_half_opacity_on() {
        for (opacity, hides, says) in [
            (1.0, true, None),
            (0.999, true, Some("hide what lies below")),
            (0.5, true, Some("hide what lies below")),
            (0.499, false, Some("hide nothing")),
            (0.01, false, Some("hide nothing")),
        ] {
            for white in [0xff_ffff, 0xfe_fefe] {
                let (area, notes) = marked(&squares(&[(10.0, 0, 1.0), (4.0, white, opacity)]), Marking::default());
                assert_eq!(area, if hides { 84.0 } else { 100.0 }, "{opacity}");
                let codes: Vec<_> =
                    notes.iter().map(|d| (d.code, d.message.contains(says.unwrap_or_default()))).collect();
                assert_eq!(
                    codes,
                    says.map(|_| ("texture-translucent", true)).into_iter().collect::<Vec<_>>(),
                    "{notes:?}"
                );
                let list = format!("#{white:06x} on 16.00 mm2 (1, first square 2)");
                assert!(notes.iter().all(|d| d.message.ends_with(&list)), "{notes:?}");
            }
        }
        // Coloured ones are marked as opaque ones are; white that is named is marked, whatever its opacity.
        let (area, notes) = marked(&squares(&[(10.0, 0xff_0000, 0.1)]), Marking::default());
        assert!(area == 100.0 && notes.is_empty(), "{area} {notes:?}");
        let only = Marking { only: select(&["white"]), ..Marking::default() };
        let (area, notes) = marked(&squares(&[(10.0, 0, 1.0), (4.0, 0xff_ffff, 0.1)]), only);
        assert!(area == 16.0 && notes.is_empty(), "{area} {notes:?}");
    }

    #[test]
    fn light_colours_that_are_marked_are_reported_once_with_their_areas() {
        let drawn =
            squares(&[(12.0, 0xf5_f5f5, 1.0), (10.0, 0xff_ffe0, 1.0), (6.0, 0xff_ff00, 1.0), (2.0, 0xfe_fefe, 1.0)]);
        let (area, notes) = marked(&drawn, Marking::default());
        assert_eq!(area, 140.0);
        let [warning] = notes.as_slice() else { panic!("{notes:?}") };
        assert_eq!(warning.code, "texture-light");
        let list = "marked: #f5f5f5 on 144.00 mm2, #ffffe0 on 100.00 mm2 (2, first square 1)";
        assert!(warning.message.ends_with(list) && warning.hint.contains("paper = \"#f5f5f5\""), "{warning:?}");
        // Each is no longer reported where it is the page, or is named.
        let (area, notes) = marked(&drawn, Marking { paper: Paper::Colour([0xf5; 3]), ..Marking::default() });
        assert!(area == 96.0 && notes[0].message.contains("marked: #ffffe0 on 100.00 mm2 (1,"), "{area} {notes:?}");
        let pens = select(&["#f5f5f5", "#ffffe0"]).into_iter().map(|s| (s, PenId(1))).collect();
        assert_eq!(marked(&drawn, Marking { pens, ..Marking::default() }).1, []);
        // A pen by a label marks the page of its layer too.
        let mut labelled = squares(&[(10.0, 0xff_ffff, 1.0)]);
        labelled.labels = vec![Labels { parent: None, own: vec!["layer:A".into()] }];
        let pens = vec![(select(&["layer:A"])[0].clone(), PenId(1))];
        let (area, notes) = marked(&labelled, Marking { pens, ..Marking::default() });
        assert!(area == 100.0 && notes[0].hint.contains("a label of pens"), "{area} {notes:?}");
    }

    #[test]
    fn page_hides_though_it_is_left_out_by_colour() {
        // Red, a white ring on it, blue in the ring.
        let mut drawn = squares(&[(10.0, 0xff_0000, 1.0), (6.0, 0xfe_fefe, 1.0), (2.0, 0x00_00ff, 1.0)]);
        drawn.labels = ["layer:A", "layer:B", "layer:C"].map(|l| Labels { parent: None, own: vec![l.into()] }).into();
        drawn.shapes.iter_mut().zip(0..).for_each(|(shape, k)| shape.labels = k);
        let of = |only: &[&str], except: &[&str]| {
            marked(&drawn, Marking { only: select(only), except: select(except), ..Marking::default() }).0
        };
        assert_eq!(of(&[], &[]), 68.0);
        for (only, except, area) in [
            (&["red"][..], &[][..], 64.0),
            (&["blue"], &[], 4.0),
            (&[], &["#fefefe"], 68.0),
            (&[], &["red"], 4.0),
            (&["#fefefe"], &[], 36.0),
            // What a label leaves out does not exist.
            (&["layer:A"], &[], 100.0),
            (&[], &["layer:B"], 100.0),
            (&["layer:A", "layer:B"], &[], 64.0),
            // One of the names is a colour: what has neither is left out by its colour.
            (&["red", "layer:C"], &[], 68.0),
            (&["red"], &["layer:B"], 100.0),
        ] {
            assert_eq!(of(only, except), area, "only {only:?}, except {except:?}");
        }
    }

    #[test]
    fn colours_that_are_left_out_hide_nothing() {
        let drawn = squares(&[(10.0, 0xff_0000, 1.0), (6.0, 0x00_00ff, 1.0)]);
        let only = |name: &str| marked(&drawn, Marking { only: select(&[name]), ..Marking::default() }).0;
        assert_eq!((only("red"), only("blue")), (100.0, 36.0));
        let pens = select(&["red", "blue"]).into_iter().zip([PenId(0), PenId(1)]).collect();
        assert_eq!(marked(&drawn, Marking { pens, ..Marking::default() }).0, 100.0, "64 and 36");
    }
}
