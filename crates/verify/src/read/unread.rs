//! What usvg does not read of a drawing, though viewers do: the proof names it, since what it changes is not checked.
//!
//! Consumes the drawing's XML; returns sentences for the proof. Looked for are values and properties in attributes,
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

/// The features that usvg does not read, each kind once.
pub(super) fn unread(doc: &Document<'_>) -> Vec<&'static str> {
    let mut out = Vec::new();
    let mut add = |why: Option<&'static str>| out.extend(why.filter(|why| !out.contains(why)));
    add(in_size(doc.root_element()));
    for node in doc.descendants().filter(Node::is_element) {
        add(in_element(node));
        for attribute in node.attributes().filter(|a| a.namespace().is_none()) {
            let (name, value) = (attribute.name(), attribute.value());
            match name {
                "style" => {
                    value.split(';').for_each(|declaration| add(in_style(declaration)));
                    add(in_block(value));
                }
                "pathLength" => add(Some("usvg does not read pathLength, by which dashes are scaled")),
                "requiredFeatures" => add(Some("usvg reads requiredFeatures, which browsers no longer do")),
                "systemLanguage" | "requiredExtensions" if !is_in_switch(node) => {
                    add(Some("usvg does not read conditions outside switch"));
                }
                _ => add(in_value(name, value)),
            }
        }
        if node.tag_name().name() == "style" {
            let sheet = node.text().unwrap_or_default();
            let bodies = sheet.split('{').skip(1).filter_map(|rule| rule.split('}').next());
            for body in bodies {
                body.split(';').for_each(|declaration| add(in_style(declaration)));
                add(in_block(body));
            }
        }
    }
    out
}

/// The feature of an element as such that usvg does not read.
fn in_element(node: Node<'_, '_>) -> Option<&'static str> {
    let link = node.attributes().find(|a| a.name() == "href").map(|a| a.value()).unwrap_or_default();
    let kind = node.attribute("type").unwrap_or("text/css");
    match node.tag_name().name() {
        "linearGradient" | "radialGradient" => Some("what is painted by a gradient counts as not being there"),
        "style" if node.has_attribute("media") || node.has_attribute("title") || kind != "text/css" => {
            Some("usvg does not read media, titles and types of style sheets")
        }
        _ if link.starts_with('#') && link.contains('%') => Some("usvg does not decode links"),
        _ => None,
    }
}

/// The feature of the size of the page that usvg does not read.
fn in_size(root: Node<'_, '_>) -> Option<&'static str> {
    let is_plain = |text: &str| {
        let number = text.trim_end_matches(|c: char| c.is_ascii_lowercase());
        let unit = &text[number.len()..];
        number.parse::<f64>().is_ok() && matches!(unit, "" | "px" | "mm" | "cm" | "in" | "pt" | "pc")
    };
    let all = ["width", "height"].into_iter().filter_map(|name| root.attribute(name));
    let sides: Vec<&str> = all.collect();
    let is_read = sides.iter().all(|side| is_plain(side)) || sides.iter().all(|side| side.ends_with('%'));
    (!is_read).then_some("usvg reads the size of the page otherwise")
}

/// What usvg does not read of the declarations of a block together: of two of one property it takes the last, whether
/// it is valid or not.
fn in_block(block: &str) -> Option<&'static str> {
    let is_unread = |part: &&str| block.contains(*part);
    if ["/*", "\\", "{", ";;"].iter().any(is_unread) || block.trim_start().starts_with(';') {
        return Some("usvg does not read comments, escapes and empty declarations in styles as browsers do");
    }
    let names: Vec<&str> = block.split(';').filter_map(|d| d.split_once(':')).map(|(name, _)| name.trim()).collect();
    let is_double = names.iter().enumerate().any(|(i, name)| names[..i].contains(name));
    is_double.then_some("usvg takes the last of two declarations of a property, valid or not")
}

fn is_in_switch(node: Node<'_, '_>) -> bool {
    node.parent_element().is_some_and(|parent| parent.tag_name().name() == "switch")
}

/// The feature of a declaration that usvg does not read.
fn in_style(declaration: &str) -> Option<&'static str> {
    let (name, value) = declaration.split_once(':')?;
    let name = name.trim();
    if GEOMETRY.contains(&name) {
        return Some("usvg does not read places and sizes from CSS");
    }
    if name == "all" || name.starts_with("transform") {
        return Some("usvg does not read transforms from CSS as browsers do, nor the property all");
    }
    if name.chars().any(|c| c.is_ascii_uppercase()) && !name.starts_with("--") {
        return Some("usvg does not read names of CSS properties in capital letters");
    }
    in_value(name, value)
}

/// The feature of the value of a property or of an attribute that usvg does not read.
fn in_value(name: &str, value: &str) -> Option<&'static str> {
    let value = value.trim();
    // Any attribute may hold a reference, which usvg reads as url() in lower case alone.
    let is_capital = |(at, word): (usize, &str)| word != "url(" && !value[..at].ends_with(char::is_alphanumeric);
    if value.to_ascii_lowercase().match_indices("url(").any(|(at, _)| is_capital((at, &value[at..at + 4]))) {
        return Some("usvg does not read keywords in capital letters");
    }
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
    // Functions are found by their whole name: oklab( does not count as lab(.
    let calls = |function: &&str| {
        lower
            .match_indices(*function)
            .any(|(at, _)| !lower[..at].ends_with(|c: char| c.is_ascii_alphanumeric() || c == '-'))
    };
    if FUNCTIONS.iter().any(calls) {
        return Some("usvg does not read some functions of CSS, such as var(), calc() and oklch()");
    }
    let is_keyword = WITH_KEYWORDS.contains(&name) && KEYWORDS.contains(&lower.as_str());
    if is_keyword && lower != value {
        return Some("usvg does not read keywords in capital letters");
    }
    (!is_plain(name, &lower)).then_some("usvg reads some values otherwise than browsers do")
}

/// Whether the value of a property, in lower case, is one that all programs read alike.
fn is_plain(name: &str, value: &str) -> bool {
    if matches!(value, "unset" | "initial" | "revert" | "revert-layer" | "transparent") {
        return false;
    }
    let is_word = value.chars().all(|c| c.is_ascii_alphabetic());
    let of = |text: &str, more: &str| text.chars().all(|c| c.is_ascii_digit() || more.contains(c));
    match name {
        "fill" | "stroke" | "color" | "stop-color" => {
            let hex = value.strip_prefix('#').filter(|h| h.chars().all(|c| c.is_ascii_hexdigit()));
            let rgb = value.strip_prefix("rgb(").and_then(|v| v.strip_suffix(')'));
            is_word
                || hex.is_some_and(|h| matches!(h.len(), 3 | 4 | 6 | 8))
                || rgb.is_some_and(|v| v.matches(',').count() == 2 && of(v, ", ."))
                || value.starts_with("url(")
        }
        "stroke-dasharray" => value == "none" || (of(value, "., \t\nmcipxt%e") && !value.ends_with(',')),
        "stroke-linecap" | "stroke-linejoin" | "display" | "visibility" | "fill-rule" | "clip-rule" => {
            is_word && (KEYWORDS.contains(&value) || matches!(value, "inline" | "block"))
        }
        _ => value == "inherit" || of(value, ".mcipxte+-%") && !value.starts_with('-'),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_usvg_does_not_read_is_named() {
        for (body, why) in [
            ("<path fill='oklch(0.5 0.2 30)'/>", Some("functions of CSS")),
            ("<path style='fill:color(display-p3 1 1 1)'/>", Some("functions of CSS")),
            ("<style>.a{fill:var(--ink, black)}</style>", Some("functions of CSS")),
            ("<path fill='None'/>", Some("keywords")),
            ("<path fill='Url(#g)'/>", Some("keywords")),
            ("<path clip-path=' uRL( #g )'/>", Some("keywords")),
            ("<path clip-path='url(#g)' fill='url(#URL)'/>", None),
            ("<path style='Fill:none'/>", Some("names of CSS properties")),
            ("<style>rect{x:3px}</style>", Some("places and sizes")),
            ("<path pathLength='10'/>", Some("pathLength")),
            ("<path style='vector-effect:non-scaling-stroke'/>", Some("vector-effect")),
            ("<path fill='#fff icc-color(SWOP, 0, 0, 0, 0)'/>", Some("functions of CSS")),
            ("<path systemLanguage='de'/>", Some("conditions")),
            ("<path style='fill:red;fill:blue'/>", Some("last of two")),
            ("<path style=';fill:red'/>", Some("empty declarations")),
            ("<path style='transform:scale(2)'/>", Some("transforms")),
            ("<path fill='rgba(0,0,0,0%)'/>", Some("some values")),
            ("<path stroke-width='-1'/>", Some("some values")),
            ("<linearGradient/>", Some("gradient")),
            ("<style media='print'>.a{fill:red}</style>", Some("media")),
            ("<use href='#a%20b'/>", Some("links")),
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
