//! Which shapes of a drawing exist, and which pen marks them.

use std::collections::{BTreeMap, BTreeSet};

use super::{Artwork, Colour, Marking, Paper, Selector, Shape};
use terrace_core::diag::Diag;
use terrace_core::program::PenId;

/// Most colours or labels that a message lists.
const MAX_LISTED: usize = 24;

/// What a shape is.
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
    let holds = |s: &Selector, shape: &Shape| match s {
        Selector::Colour(c) => *c == shape.colour,
        Selector::Label(label) => art.labels(shape.labels).any(|l| l == label),
    };
    let named =
        [("pens", marking.pens.iter().map(|(s, _)| s).collect()), ("only", marking.only.iter().collect::<Vec<_>>())];
    for (key, selectors) in named.into_iter().chain([("except", marking.except.iter().collect())]) {
        let is_known = |s: &&Selector| match s {
            Selector::Colour(_) => art.shapes.iter().any(|shape| holds(s, shape)),
            // Also where nothing of the element is marked.
            Selector::Label(label) => art.labels.iter().any(|set| set.own.contains(label)),
        };
        if let Some(s) = selectors.into_iter().find(|s| !is_known(s)) {
            let text = format!("{key} names {s}, and the drawing holds no such thing");
            return Err(Diag::input("texture-pens", text).hint(format!("the drawing holds {}", held(art))).into());
        }
    }
    let colours: BTreeSet<Colour> = art.shapes.iter().map(|shape| shape.colour).collect();
    let papers: BTreeSet<Colour> = colours.into_iter().filter(|c| paper.is_some_and(|p| p.holds(*c))).collect();
    let class = |shape: &Shape| {
        let any = |selectors: &[Selector]| selectors.iter().any(|s| holds(s, shape));
        let is_paper = papers.contains(&shape.colour);
        let is_chosen = marking.only.is_empty() || any(&marking.only);
        let only_labels = !marking.only.iter().any(|s| matches!(s, Selector::Colour(_)));
        let by_label = (!is_chosen && only_labels) || marking.excepts(art.labels(shape.labels));
        if !is_chosen || any(&marking.except) {
            return Ok(if is_paper && !by_label { Class::Page } else { Class::Skip });
        }
        let mut pens = marking.pens.iter().filter(|(s, _)| holds(s, shape));
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
    };
    art.shapes.iter().map(class).collect()
}

/// What can be named of a drawing, with the number of shapes that each name chooses: colours, layers, other labels.
pub(in crate::texture) fn selectors(art: &Artwork) -> Vec<(Selector, usize)> {
    let mut colours: BTreeMap<Colour, usize> = BTreeMap::new();
    let mut sets = vec![0; art.labels.len()];
    for shape in &art.shapes {
        *colours.entry(shape.colour).or_default() += 1;
        sets[shape.labels as usize] += 1;
    }
    let mut labels: BTreeMap<&String, usize> = BTreeMap::new();
    for (set, shapes) in (0..).zip(sets) {
        // A label may stand on an element and on what holds it.
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
