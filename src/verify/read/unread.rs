//! What usvg does not read of a drawing, though viewers do: the proof names it, since what it changes is not checked.
//!
//! Consumes the drawing's XML; answers with sentences for the proof. Looked for are values and properties in attributes,
//! in `style` attributes and in style sheets, by their text.

use roxmltree::{Document, Node};

/// Functions of CSS that usvg reads as nothing, in values of presentation attributes and of styles.
const FUNCTIONS: [&str; 11] =
    ["var(", "calc(", "oklch(", "oklab(", "lab(", "lch(", "hwb(", "color(", "color-mix(", "light-dark(", "icc-color("];

/// Properties that usvg reads as attributes alone.
const GEOMETRY: [&str; 13] =
    ["cx", "cy", "r", "rx", "ry", "x", "y", "width", "height", "d", "rotate", "scale", "translate"];

/// Keywords that usvg reads in lower case alone.
const KEYWORDS: [&str; 12] = [
    "none", "inherit", "hidden", "collapse", "visible", "evenodd", "nonzero", "butt", "round", "square", "bevel",
    "miter",
];

/// Properties that have such keywords.
const WITH_KEYWORDS: [&str; 8] =
    ["fill", "stroke", "display", "visibility", "fill-rule", "clip-rule", "stroke-linecap", "stroke-linejoin"];

/// What usvg does not read, each kind once.
pub(super) fn unread(doc: &Document<'_>) -> Vec<&'static str> {
    let mut out = Vec::new();
    let mut add = |why: Option<&'static str>| out.extend(why.filter(|why| !out.contains(why)));
    for node in doc.descendants().filter(Node::is_element) {
        for attribute in node.attributes().filter(|a| a.namespace().is_none()) {
            let (name, value) = (attribute.name(), attribute.value());
            match name {
                "style" => value.split(';').for_each(|declaration| add(in_style(declaration))),
                "pathLength" => add(Some("usvg does not read pathLength, by which dashes are scaled")),
                "systemLanguage" | "requiredExtensions" if !is_in_switch(node) => {
                    add(Some("usvg does not read conditions outside switch"));
                }
                _ => add(in_value(name, value)),
            }
        }
        if node.tag_name().name() == "style" {
            let sheet = node.text().unwrap_or_default();
            let bodies = sheet.split('{').skip(1).filter_map(|rule| rule.split('}').next());
            bodies.flat_map(|body| body.split(';')).for_each(|declaration| add(in_style(declaration)));
        }
    }
    out
}

fn is_in_switch(node: Node<'_, '_>) -> bool {
    node.parent_element().is_some_and(|parent| parent.tag_name().name() == "switch")
}

/// What usvg does not read of a declaration.
fn in_style(declaration: &str) -> Option<&'static str> {
    let (name, value) = declaration.split_once(':')?;
    let name = name.trim();
    if GEOMETRY.contains(&name) {
        return Some("usvg does not read places and sizes from CSS");
    }
    if name.chars().any(|c| c.is_ascii_uppercase()) && !name.starts_with("--") {
        return Some("usvg does not read names of CSS properties in capital letters");
    }
    in_value(name, value)
}

/// What usvg does not read of the value of a property or of an attribute.
fn in_value(name: &str, value: &str) -> Option<&'static str> {
    let value = value.trim();
    if name == "vector-effect" && value != "none" {
        return Some("usvg does not read vector-effect, by which strokes keep their width");
    }
    let is_paint = matches!(name, "fill" | "stroke" | "color" | "stop-color");
    let is_property =
        is_paint || WITH_KEYWORDS.contains(&name) || name.ends_with("opacity") || name.starts_with("stroke-");
    if !is_property {
        return None;
    }
    let lower = value.to_ascii_lowercase();
    let has = |function: &&str| {
        lower
            .match_indices(*function)
            .any(|(at, _)| !lower[..at].ends_with(|c: char| c.is_ascii_alphanumeric() || c == '-'))
    };
    if FUNCTIONS.iter().any(has) {
        return Some("usvg does not read some functions of CSS, such as var(), calc() and oklch()");
    }
    let is_keyword = WITH_KEYWORDS.contains(&name) && KEYWORDS.contains(&lower.as_str());
    (is_keyword && lower != value).then_some("usvg does not read keywords in capital letters")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_usvg_does_not_read_is_named() {
        for (body, why) in [
            ("<path fill='oklch(0.5 0.2 30)'/>", Some("functions of CSS")),
            ("<path style='fill:white;fill:color(display-p3 1 1 1)'/>", Some("functions of CSS")),
            ("<style>.a{fill:var(--ink, black)}</style>", Some("functions of CSS")),
            ("<path fill='None'/>", Some("keywords")),
            ("<path style='Fill:none'/>", Some("names of CSS properties")),
            ("<style>rect{x:3px}</style>", Some("places and sizes")),
            ("<path pathLength='10'/>", Some("pathLength")),
            ("<path style='vector-effect:non-scaling-stroke'/>", Some("vector-effect")),
            ("<path fill='#fff icc-color(SWOP, 0, 0, 0, 0)'/>", Some("functions of CSS")),
            ("<path systemLanguage='de'/>", Some("conditions")),
            ("<switch><path systemLanguage='de'/></switch>", None),
            (
                "<path fill='Black' stroke='#ABC' style='stroke:currentColor;fill:rgb(1,2,3)' transform='scale(2)'/>",
                None,
            ),
            ("<style>.fil0 {fill:#FEFEFE} .str0 {stroke:Red;stroke-width:1}</style>", None),
        ] {
            let text = format!("<svg>{body}</svg>");
            let found = unread(&Document::parse(&text).expect("xml"));
            assert_eq!(found.len(), usize::from(why.is_some()), "{body}: {found:?}");
            assert!(why.is_none_or(|why| found[0].contains(why)), "{body}: {found:?}");
        }
    }
}
