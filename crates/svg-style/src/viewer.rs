//! The viewer for whom a drawing is meant.

use roxmltree::Node;

use super::SVG;

/// Whether an element is for a viewer in English without extensions (SVG 2, 5.8; features are no longer asked for).
/// What others refer to and unknown elements have no conditions.
pub fn holds_conditions(node: Node<'_, '_>) -> bool {
    const WITH_CONDITIONS: [&str; 16] = [
        "a",
        "circle",
        "ellipse",
        "foreignObject",
        "g",
        "image",
        "line",
        "path",
        "polygon",
        "polyline",
        "rect",
        "svg",
        "switch",
        "text",
        "tspan",
        "use",
    ];
    if !WITH_CONDITIONS.contains(&node.tag_name().name()) {
        return true;
    }
    node.attribute("systemLanguage").is_none_or(holds_english)
        && node.attribute("requiredExtensions").is_none_or(are_known_extensions)
}

/// Whether English, of any region, is in a list of languages.
fn holds_english(list: &str) -> bool {
    let is_english = |lang: &str| lang.split('-').next().unwrap_or_default().eq_ignore_ascii_case("en");
    list.split(',').map(str::trim).any(is_english)
}

/// Whether browsers have all extensions of a list; an empty list counts as one that they do not have.
fn are_known_extensions(list: &str) -> bool {
    const KNOWN: [&str; 2] = ["http://www.w3.org/1999/xhtml", "http://www.w3.org/1998/Math/MathML"];
    let mut extensions = list.split_whitespace().peekable();
    extensions.peek().is_some() && extensions.all(|extension| KNOWN.contains(&extension))
}

/// Whether an element is of SVG; one without a namespace is.
pub fn is_svg(node: Node<'_, '_>) -> bool {
    matches!(node.tag_name().namespace(), None | Some(SVG))
}

/// The child of a switch that is drawn: the first whose conditions hold, whether it shows anything or not.
pub fn chosen<'a, 'input>(switch: Node<'a, 'input>) -> Option<Node<'a, 'input>> {
    switch.children().filter(|n| n.is_element() && is_svg(*n)).find(|n| holds_conditions(*n))
}
