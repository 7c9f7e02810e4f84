//! Text and images of which nothing is seen: empty, unpainted, hidden, of no size, or off the page.

use roxmltree::Node;
use svg_style::{Length, href};

use super::state::ElementState;
use super::style::is_gone;
use super::walk::Walk;
use crate::texture::xml::MAX_DEPTH;
use terrace_core::diag::Diag;
use terrace_core::geom::BoxMm;

/// How far a letter reaches from where its text begins, at most, in sizes of the font.
const LETTER: f64 = 2.0;

impl<'a, 'input> Walk<'a, 'input> {
    /// Whether something may be seen of text, an image or a foreign object.
    pub(super) fn is_seen(&mut self, node: Node<'a, 'input>, state: &ElementState) -> Result<bool, Box<Diag>> {
        match node.tag_name().name() {
            "image" => {
                let link = href(node).unwrap_or_default();
                Ok(!link.is_empty() && state.style.visible && self.is_box_on_page(state).unwrap_or(true))
            }
            "foreignObject" => {
                let is_empty = node.children().all(|n| !n.is_element() && n.text().is_none_or(is_blank));
                Ok(!is_empty && state.style.visible && self.is_box_on_page(state).unwrap_or(false))
            }
            _ => Ok(self.has_letters(node, state, 0)? && self.may_reach_page(node, state)),
        }
    }

    /// Whether the box of an element has an extent and lies on the page; None where its style does not say how large it
    /// is, so that an image has the size of its file, and a foreign object none.
    fn is_box_on_page(&self, state: &ElementState) -> Option<bool> {
        let style = &state.style;
        let sides =
            [(style.width, state.port[0]), (style.height, state.port[1])].map(|(s, whole)| s.map(|s| s.of(whole)));
        match sides {
            [Some(w), Some(h)] if w > 0.0 && h > 0.0 => {
                let [x, y] = [style.x.of(state.port[0]), style.y.of(state.port[1])];
                Some(self.touches_page(BoxMm { lo: [x, y], hi: [x + w, y + h] }, state))
            }
            [Some(w), _] if w <= 0.0 => Some(false),
            [_, Some(h)] if h <= 0.0 => Some(false),
            _ => None,
        }
    }

    /// Whether a box in an element's units meets the page.
    fn touches_page(&self, own: BoxMm<2>, state: &ElementState) -> bool {
        let on_page = BoxMm::of(own.corners().map(|c| state.map.at(c)));
        (0..2).all(|k| on_page.lo[k] < self.page.hi[k] && on_page.hi[k] > self.page.lo[k])
    }

    /// Whether text holds a letter that is painted.
    fn has_letters(&mut self, node: Node<'a, 'input>, state: &ElementState, depth: usize) -> Result<bool, Box<Diag>> {
        let is_painted = state.is_seen() && state.style.font_size.px > 0.0;
        let has_link = node.tag_name().name() == "tref";
        if is_painted && (has_link || node.children().any(|n| n.is_text() && !n.text().is_none_or(is_blank))) {
            return Ok(true);
        }
        if depth > MAX_DEPTH {
            return Ok(true);
        }
        for child in node.children().filter(Node::is_element) {
            if matches!(child.tag_name().name(), "title" | "desc" | "metadata" | "flowRegion" | "style") {
                continue;
            }
            let style = self.style(child, &state.style, state.copied)?;
            if is_gone(&style) {
                continue;
            }
            let inner = ElementState { style, ..state.clone() };
            if self.has_letters(child, &inner, depth + 1)? {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Whether a letter may lie on the page: each lies near a stated place, in any direction. Of text on a path or
    /// without a place of its own that is not known.
    fn may_reach_page(&mut self, node: Node<'a, 'input>, state: &ElementState) -> bool {
        let parts: Vec<_> = node.descendants().filter(Node::is_element).collect();
        if !parts.iter().all(|part| has_plain_places(*part, node)) || !self.has_no_sheet() {
            return true;
        }
        let letters =
            parts.iter().flat_map(|n| n.children()).filter_map(|n| n.text()).map(|t| t.chars().count()).sum::<usize>();
        let reach = LETTER * letters as f64 * state.style.font_size.px;
        let mut places: [Vec<f64>; 2] = [vec![0.0], vec![0.0]];
        for part in &parts {
            for (k, name) in ["x", "y"].into_iter().enumerate() {
                let Some(list) = part.attribute(name) else { continue };
                if *part == node {
                    places[k].clear();
                }
                for text in list.split([' ', ',', '\t', '\n', '\r']).filter(|t| !t.is_empty()) {
                    let style = &state.style;
                    let length = Length::from_attribute(text, style.font_size.px, style.root_font_px);
                    let Some(length) = length else { return true };
                    places[k].push(length.of(state.port[k]));
                }
            }
        }
        let lo = places.each_ref().map(|values| values.iter().copied().fold(f64::INFINITY, f64::min) - reach);
        let hi = places.each_ref().map(|values| values.iter().copied().fold(f64::NEG_INFINITY, f64::max) + reach);
        self.touches_page(BoxMm { lo, hi }, state)
    }
}

/// Whether the places of the letters in a part of a text follow from the attributes x and y of its parts and from the
/// style of the text.
fn has_plain_places(part: Node<'_, '_>, text: Node<'_, '_>) -> bool {
    matches!(part.tag_name().name(), "text" | "tspan" | "a" | "title" | "desc" | "metadata")
        && ["transform", "style", "font-size"].iter().all(|name| part == text || !part.has_attribute(*name))
        && !["dx", "dy", "textLength"].iter().any(|name| part.has_attribute(*name))
}

fn is_blank(text: &str) -> bool {
    text.chars().all(char::is_whitespace)
}
