//! The viewer for whom a drawing is meant.

use roxmltree::Node;

use super::SVG;

/// Whether an element is for a viewer in English without extensions (SVG 2, 5.8; features are no longer asked for). What
/// others refer to and unknown elements have no conditions.
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
    let speaks = |list: &str| {
        list.split(',').map(str::trim).any(|lang| {
            let primary = lang.split('-').next().unwrap_or_default();
            primary.eq_ignore_ascii_case("en")
        })
    };
    let extensions = |list: &str| {
        let known = ["http://www.w3.org/1999/xhtml", "http://www.w3.org/1998/Math/MathML"];
        let mut all = list.split_whitespace().peekable();
        all.peek().is_some() && all.all(|e| known.contains(&e))
    };
    node.attribute("systemLanguage").is_none_or(speaks) && node.attribute("requiredExtensions").is_none_or(extensions)
}

/// Whether an element is of SVG; one without a namespace is.
pub fn is_svg(node: Node<'_, '_>) -> bool {
    matches!(node.tag_name().namespace(), None | Some(SVG))
}

/// The child of a switch that is drawn: the first whose conditions hold, whether it shows anything or not.
pub fn chosen<'a, 'input>(switch: Node<'a, 'input>) -> Option<Node<'a, 'input>> {
    switch.children().filter(|n| n.is_element() && is_svg(*n)).find(|n| holds_conditions(*n))
}
