//! The ids, classes and Inkscape layers of the elements of an SVG drawing, read by the verifier itself.
//!
//! Consumes the drawing's XML. usvg keeps nothing of an element but its id, so every shape and use without one is given
//! an id of its own in a copy of the text ([`Labels::tagged`]), by which what usvg answers is found again here.
//!
//! A label holds for all that its element holds. What a use shows has the labels of the use and of what it refers to;
//! labels below that are not told apart, and count as [`Truth::Maybe`], as those of elements with one id do.

use std::collections::HashMap;

use roxmltree::{Document, Node, NodeId};

const INKSCAPE: &str = "http://www.inkscape.org/namespaces/inkscape";

const SHAPES: [&str; 8] = ["path", "rect", "circle", "ellipse", "line", "polyline", "polygon", "use"];

/// An element that is not known by its id.
pub(crate) const UNKNOWN: u32 = u32::MAX;

/// Whether an element has a label.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Truth {
    Yes,
    No,
    Maybe,
}

/// The elements of a drawing, in the order of its text.
pub(crate) struct Labels {
    elements: Vec<Element>,
    by_id: HashMap<String, u32>,
    any_arcs: bool,
}

struct Element {
    parent: Option<u32>,
    /// The element after the last that it holds.
    end: u32,
    own: Vec<String>,
    /// The element that it shows a copy of.
    refers_to: Option<u32>,
    has_arcs: bool,
    /// Whether another one has its id.
    is_double: bool,
}

impl Labels {
    /// Reads the elements, and writes the text in which all shapes have ids.
    pub(crate) fn tagged(doc: &Document<'_>) -> (Self, String) {
        let text = doc.input_text();
        let prefix = (0..).map(|k| format!("v{k}-")).find(|p| !text.contains(p.as_str())).expect("a free name");
        let mut labels = Self { elements: Vec::new(), by_id: HashMap::new(), any_arcs: false };
        let mut places: HashMap<NodeId, u32> = HashMap::new();
        let (mut tagged, mut written) = (String::with_capacity(text.len()), 0);
        for node in doc.descendants().filter(Node::is_element) {
            let number = labels.elements.len() as u32;
            places.insert(node.id(), number);
            let parent = node.parent_element().map(|p| places[&p.id()]);
            let id = node.attribute("id").filter(|id| !id.is_empty());
            if id.is_none() && SHAPES.contains(&node.tag_name().name()) {
                let start = node.range().start + 1;
                let name = text[start..].find(|c: char| c.is_whitespace() || matches!(c, '/' | '>')).unwrap_or(0);
                tagged.push_str(&text[written..start + name]);
                tagged.push_str(&format!(" id=\"{prefix}{number}\""));
                written = start + name;
            }
            let id = id.map_or_else(|| format!("{prefix}{number}"), str::to_owned);
            let mut element = Element::new(node, parent);
            if let Some(&other) = labels.by_id.get(&id) {
                labels.elements[other as usize].is_double = true;
                element.is_double = true;
            } else {
                labels.by_id.insert(id, number);
            }
            labels.any_arcs |= element.has_arcs;
            labels.elements.push(element);
        }
        tagged.push_str(&text[written..]);
        for number in (1..labels.elements.len()).rev() {
            let Element { parent, end, .. } = labels.elements[number];
            let end = end.max(number as u32 + 1);
            labels.elements[number].end = end;
            if let Some(parent) = parent {
                let parent = &mut labels.elements[parent as usize];
                parent.end = parent.end.max(end);
            }
        }
        for (node, &number) in doc.descendants().filter_map(|n| Some((n, places.get(&n.id())?))) {
            let href = node.attributes().find(|a| a.name() == "href").and_then(|a| a.value().trim().strip_prefix('#'));
            if let Some(id) = href.filter(|_| node.tag_name().name() == "use") {
                labels.elements[number as usize].refers_to = labels.by_id.get(id).copied();
            }
        }
        (labels, tagged)
    }

    /// The element of an id.
    pub(super) fn element(&self, id: &str) -> u32 {
        self.by_id.get(id).copied().unwrap_or(UNKNOWN)
    }

    /// Whether the outline of an element has arcs, which usvg approximates; of copies, whether any has.
    pub(super) fn has_arcs(&self, element: u32) -> bool {
        match self.elements.get(element as usize) {
            Some(own) if own.refers_to.is_none() && !own.is_double => own.has_arcs,
            _ => self.any_arcs,
        }
    }

    /// Of every element, whether it has a label that `is_meant`.
    pub(crate) fn having(&self, is_meant: impl Fn(&str) -> bool) -> LabelledElements {
        let own: Vec<bool> = self.elements.iter().map(|e| e.own.iter().any(|l| is_meant(l))).collect();
        let mut all: Vec<Truth> = Vec::with_capacity(own.len());
        for (k, element) in self.elements.iter().enumerate() {
            let above = element.parent.map_or(Truth::No, |p| all[p as usize]);
            all.push(if own[k] { Truth::Yes } else { above });
        }
        for (k, element) in self.elements.iter().enumerate() {
            let mut shown = element.refers_to;
            // A use that refers to a use, and so on; circles are not drawn.
            for _ in 0..self.elements.len().min(100) {
                let Some(target) = shown.filter(|_| all[k] == Truth::No) else { break };
                let held = target as usize + 1..self.elements[target as usize].end as usize;
                let may_hold = held.clone().any(|e| own[e] || self.elements[e].refers_to.is_some());
                all[k] = match (own[target as usize], may_hold && own.contains(&true)) {
                    (true, _) => Truth::Yes,
                    (false, true) => Truth::Maybe,
                    (false, false) => Truth::No,
                };
                shown = self.elements[target as usize].refers_to;
            }
        }
        for (known, element) in all.iter_mut().zip(&self.elements) {
            *known = if element.is_double { Truth::Maybe } else { *known };
        }
        LabelledElements(all)
    }
}

/// Which elements have a label.
pub(crate) struct LabelledElements(Vec<Truth>);

impl LabelledElements {
    /// Whether this one has.
    pub(crate) fn has(&self, element: u32) -> Truth {
        self.0.get(element as usize).copied().unwrap_or(Truth::Maybe)
    }
}

impl Element {
    fn new(node: Node<'_, '_>, parent: Option<u32>) -> Self {
        let attribute = |name| node.attribute(name);
        let mut own = Vec::new();
        if node.attribute((INKSCAPE, "groupmode")) == Some("layer") {
            own.extend(node.attribute((INKSCAPE, "label")).or(attribute("id")).map(|l| format!("layer:{l}")));
        }
        own.extend(attribute("id").map(|l| format!("id:{l}")));
        own.extend(attribute("class").unwrap_or_default().split_whitespace().map(|l| format!("class:{l}")));
        let has_arcs = match node.tag_name().name() {
            "circle" | "ellipse" => true,
            "rect" => attribute("rx").is_some() || attribute("ry").is_some(),
            "path" => attribute("d").is_some_and(|d| d.contains(['a', 'A'])),
            _ => false,
        };
        Self { parent, end: 0, own, refers_to: None, has_arcs, is_double: false }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_are_inherited_and_copied() {
        let text = "<svg xmlns:inkscape=\"http://www.inkscape.org/namespaces/inkscape\">\
                    <g inkscape:groupmode=\"layer\" inkscape:label=\"A\"><path d=\"M0 0\"/><g class=\"x y\"><rect id=\"r\"/></g>\
                    </g><g id=\"held\"><g id=\"one\"><line class=\"x\"/></g></g><use href=\"#r\"/><use href=\"#held\"/>\
                    <circle id=\"twin\"/><circle id=\"twin\" class=\"x\"/></svg>";
        let doc = Document::parse(text).expect("XML");
        let (labels, tagged) = Labels::tagged(&doc);
        assert_eq!(tagged.matches("id=\"v0-").count(), 4, "{tagged}");
        Document::parse(&tagged).expect("XML");
        let path = labels.element("v0-2");
        let (r, copy, group) = (labels.element("r"), labels.element("v0-8"), labels.element("v0-9"));
        let twin = labels.element("twin");
        for (label, want) in [
            ("layer:A", [Truth::Yes, Truth::Yes, Truth::No, Truth::No, Truth::Maybe]),
            ("class:x", [Truth::No, Truth::Yes, Truth::No, Truth::Maybe, Truth::Maybe]),
            ("id:r", [Truth::No, Truth::Yes, Truth::Yes, Truth::No, Truth::Maybe]),
            ("id:held", [Truth::No, Truth::No, Truth::No, Truth::Yes, Truth::Maybe]),
        ] {
            let having = labels.having(|l| l == label);
            assert_eq!([path, r, copy, group, twin].map(|e| having.has(e)), want, "{label}");
            assert_eq!(having.has(UNKNOWN), Truth::Maybe);
        }
        assert!(labels.has_arcs(twin) && labels.has_arcs(copy) && !labels.has_arcs(path));
    }
}
