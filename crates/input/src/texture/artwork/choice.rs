//! Which shapes of a drawing exist, and which pen marks them.

use std::collections::{BTreeMap, BTreeSet};

use super::{Artwork, Colour, Marking, PaintedShape, Paper, Selector};
use terrace_core::diag::Diag;
use terrace_core::program::PenId;

/// Most colours or labels that a message lists.
const MAX_LISTED: usize = 24;

/// What a shape is for a job: marked, page, or left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::texture) enum Class {
    /// The shape is left out, as if it was not drawn.
    Skip,
    /// Painted like the page: it hides, and is not marked.
    Page,
    /// The shape is marked by this pen, or by that of the texture.
    Pen(Option<PenId>),
}

/// The class of each shape; `paper` says which colours are the page, None where there is none.
///
/// Of shapes that `only` or `except` leave out by their colour, those in a colour of the page still hide what lies
/// below: a drawing shows paper there, whichever of its colours are marked. All others that are left out do not exist,
/// so that textures can divide the colours and layers of a drawing between them. What is left out by a label does not
/// exist whatever its colour, like a layer that is switched off.
///
/// # Errors
/// `texture-pens` where a selector chooses nothing, or two give one shape different pens.
pub(in crate::texture) fn classes(
    art: &Artwork,
    marking: &Marking,
    paper: Option<Paper>,
) -> Result<Vec<Class>, Box<Diag>> {
    check_selectors(art, marking)?;
    // Whether a colour is that of the page takes its lightness, so it is found once for each colour.
    let colours: BTreeSet<Colour> = art.shapes.iter().map(|shape| shape.colour).collect();
    let papers: BTreeSet<Colour> = colours.into_iter().filter(|c| paper.is_some_and(|p| p.holds(*c))).collect();
    art.shapes.iter().map(|shape| class(art, marking, shape, papers.contains(&shape.colour))).collect()
}

/// Refuses selectors that choose nothing.
fn check_selectors(art: &Artwork, marking: &Marking) -> Result<(), Box<Diag>> {
    let by_key: [(&str, Vec<&Selector>); 3] = [
        ("pens", marking.pens.iter().map(|(selector, _)| selector).collect()),
        ("only", marking.only.iter().collect()),
        ("except", marking.except.iter().collect()),
    ];
    for (key, selectors) in by_key {
        if let Some(unknown) = selectors.into_iter().find(|s| !is_known(art, s)) {
            let text = format!("{key} names {unknown}, and the drawing holds no such thing");
            return Err(Diag::input("texture-pens", text).hint(format!("the drawing holds {}", held(art))).into());
        }
    }
    Ok(())
}

/// Whether the drawing holds what a selector names.
fn is_known(art: &Artwork, selector: &Selector) -> bool {
    match selector {
        Selector::Colour(_) => art.shapes.iter().any(|shape| chooses(art, selector, shape)),
        // Also where nothing of the element is marked.
        Selector::Label(label) => art.labels.iter().any(|set| set.own.contains(label)),
    }
}

fn chooses(art: &Artwork, selector: &Selector, shape: &PaintedShape) -> bool {
    match selector {
        Selector::Colour(colour) => *colour == shape.colour,
        Selector::Label(label) => art.labels(shape.labels).any(|l| l == label),
    }
}

/// The class of a shape; `is_paper` says whether its colour is that of the page.
fn class(art: &Artwork, marking: &Marking, shape: &PaintedShape, is_paper: bool) -> Result<Class, Box<Diag>> {
    let is_chosen_by = |selectors: &[Selector]| selectors.iter().any(|s| chooses(art, s, shape));
    let is_chosen = marking.only.is_empty() || is_chosen_by(&marking.only);
    if !is_chosen || is_chosen_by(&marking.except) {
        // Left out by its colour it still hides what lies below; left out by a label it does not exist.
        let only_labels = !marking.only.iter().any(|s| matches!(s, Selector::Colour(_)));
        let is_left_out_by_label = (!is_chosen && only_labels) || marking.excepts(art.labels(shape.labels));
        return Ok(if is_paper && !is_left_out_by_label { Class::Page } else { Class::Skip });
    }
    let mut pens = marking.pens.iter().filter(|(s, _)| chooses(art, s, shape));
    let Some((first, pen)) = pens.next() else {
        let is_page = is_paper && marking.is_page(shape.colour);
        return Ok(if is_page { Class::Page } else { Class::Pen(None) });
    };
    if let Some((second, _)) = pens.find(|(_, other)| other != pen) {
        let element = &art.names[shape.name as usize];
        let text = format!("pens gives {element} two pens: by {first} and by {second}");
        return Err(Diag::input("texture-pens", text)
            .hint("name what tells them apart, or use two textures with only and except")
            .into());
    }
    Ok(Class::Pen(Some(*pen)))
}

/// What can be named of a drawing, with the number of shapes that each name chooses: colours, layers, other labels.
pub(in crate::texture) fn selectors(art: &Artwork) -> Vec<(Selector, usize)> {
    let mut colours: BTreeMap<Colour, usize> = BTreeMap::new();
    let mut shapes_of_set = vec![0; art.labels.len()];
    for shape in &art.shapes {
        *colours.entry(shape.colour).or_default() += 1;
        shapes_of_set[shape.labels as usize] += 1;
    }
    let mut labels: BTreeMap<&String, usize> = BTreeMap::new();
    for (set, shapes) in (0..).zip(shapes_of_set) {
        // A label may stand on an element and on what holds it, and counts once.
        let of_set: BTreeSet<&String> = if shapes > 0 { art.labels(set).collect() } else { BTreeSet::new() };
        of_set.into_iter().for_each(|label| *labels.entry(label).or_default() += shapes);
        art.labels[set as usize].own.iter().for_each(|label| _ = labels.entry(label).or_default());
    }
    let (layers, others): (Vec<_>, Vec<_>) = labels.into_iter().partition(|(label, _)| label.starts_with("layer:"));
    let labels = layers.into_iter().chain(others).map(|(label, n)| (Selector::Label(label.clone()), n));
    colours.into_iter().map(|(colour, n)| (Selector::Colour(colour), n)).chain(labels).collect()
}

/// What can be named of a drawing, for a message.
fn held(art: &Artwork) -> String {
    let all: Vec<String> = selectors(art).into_iter().map(|(selector, _)| selector.to_string()).collect();
    match all.len() {
        0 => "no shapes".to_owned(),
        n if n > MAX_LISTED => format!("{} and {} more", all[..MAX_LISTED].join(", "), n - MAX_LISTED),
        _ => all.join(", "),
    }
}
