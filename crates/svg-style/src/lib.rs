//! The style of the elements of an SVG drawing, cascaded and computed as browsers do.
//!
//! Consumes the tree of a drawing (`roxmltree`). Promises for every element the computed values of the properties that
//! decide what is seen of it ([`Style`]), from presentation attributes, style sheets and the `style` attribute, by CSS
//! Cascade 5: layers, importance, specificity, order, custom properties, `inherit` and its kin. Values are judged
//! before the cascade. The parser, the selectors and the colours are those of Servo (`cssparser`, `selectors`,
//! `cssparser-color`); conversions of colours are those of `color`.
//!
//! Nothing is dropped silently: a [`Remark`] says what browsers ignore as well, and what they may understand
//! though it is not understood here, so that the caller can refuse it. Media are those of a screen that shows the
//! drawing on white paper; what depends on the size of a window is not known here.
//!
//! Lengths are f64 from the text of the number on. Work is bounded: 40 million steps of matching, 4 million selectors
//! of at most 1,000 parts, 64 levels of nesting, 50 MB of text made by variables ([`Excess`]).
//!
//! Considered instead: `lightningcss` reads numbers in f32, knows no properties of geometry, and does not tell values
//! that are not valid from those that it does not know; `stylo` has no properties of SVG outside of Firefox;
//! `simplecss` matches by trying every way and knows CSS 2.1 alone.

mod colour;
mod condition;
mod declaration;
mod link;
mod map;
mod matrix;
mod property;
mod selector;
mod sheet;
mod transform;
mod value;
mod variables;
mod view;
mod viewer;

use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;

use roxmltree::{Document, Node, NodeId};
use selectors::context::{
    MatchingContext, MatchingForInvalidation, MatchingMode, NeedsSelectorFlags, QuirksMode, SelectorCaches,
};
use selectors::matching::matches_selector;

pub use colour::{Colour, Rgba};
use declaration::{Declaration, DeclaredValue, PendingValue, WideKeyword, declare};
pub use link::{Link, href, local};
pub use map::Map;
pub use property::{Auto, Background, Display, FillRule, Layer, Paint, Reference, Style};
use property::{Property, Value};
use selector::{StyledElement, Tree};
use sheet::{Block, Sheets};
pub use transform::{Reference as ReferenceBox, Transform, TransformBox};
pub use value::Length;
use value::Source;
use variables::SubstitutedBytes;
pub use view::{aspect, view_box, view_map};
pub use viewer::{chosen, holds_conditions, is_svg};

const SVG: &str = "http://www.w3.org/2000/svg";
const XHTML: &str = "http://www.w3.org/1999/xhtml";

/// Something in a drawing's styles that is not read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Remark {
    /// Whether browsers ignore it too.
    pub weight: Weight,
    /// The property, in lower case; empty for rules and conditions.
    pub property: String,
    /// The text as it is written, cut to 60 characters.
    pub text: String,
    /// Line of the drawing, from 1; None for attributes of an element.
    pub line: Option<u32>,
    /// It is of an attribute of its own.
    pub is_attribute: bool,
}

/// How much it matters that something is not read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Weight {
    /// Browsers ignore it as well.
    Ignored,
    /// Browsers may understand it, and show something else; what is named is not read.
    Unknown(String),
    /// It stands in another file.
    External,
}

/// Longest text of a remark, characters.
const MAX_TEXT: usize = 60;

impl Remark {
    fn new(weight: Weight, property: &str, text: &str) -> Self {
        let text = if property.is_empty() { text.to_owned() } else { format!("{property}: {text}") };
        let words: Vec<&str> = text.split_whitespace().collect();
        let mut text = words.join(" ");
        if text.chars().count() > MAX_TEXT {
            text = text.chars().take(MAX_TEXT - 3).collect::<String>() + "...";
        }
        Self { weight, property: property.to_owned(), text, line: None, is_attribute: false }
    }
}

/// Why a style cannot be computed in bounded time and memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Excess {
    /// More than 40 million comparisons of elements with selectors.
    Steps,
    /// More than 4 million selectors, or one of more than 1,000 parts.
    Selectors,
    /// Blocks or brackets nested more than 64 deep.
    Depth,
    /// Variables that make a value of more than 100 kB or more than 50 MB in all, or refer to each other more than 64
    /// deep.
    Variables,
}

impl fmt::Display for Excess {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Steps => "applying the style sheet takes more than 40 million comparisons",
            Self::Selectors => "the style sheet has more than 4 million selectors, or one of more than 1000 parts",
            Self::Depth => "the style sheet nests blocks or brackets deeper than 64",
            Self::Variables => "the variables of the style sheet make too much text",
        })
    }
}

/// The style sheets of a drawing, by which the styles of its elements are computed.
pub struct Cascade {
    sheets: Sheets,
    tree: Tree,
    caches: SelectorCaches,
    substituted: SubstitutedBytes,
    root_font_px: f64,
}

/// Where a declaration stands in the cascade, the stronger the greater: its fields in the order in which they decide
/// (CSS Cascade 5, 6).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Rank {
    is_important: bool,
    origin: Origin,
    specificity: u32,
    order: usize,
}

impl Rank {
    /// The rank of declaration `index` of a block.
    fn new(place: BlockPlace, index: usize, is_important: bool) -> Self {
        let BlockPlace { origin, specificity, order } = place;
        let origin = match origin {
            // Of important declarations that of the earlier layer is the stronger (CSS Cascade 5, 6.1).
            Origin::Rule(layer) if is_important => Origin::Rule(usize::MAX - layer),
            origin => origin,
        };
        Self { is_important, origin, specificity, order: order * ORDER + index }
    }
}

/// Something declared, with its rank.
struct Ranked<T> {
    rank: Rank,
    /// Where it is declared; that of the rank differs where it is important.
    origin: Origin,
    declared: T,
}

/// What the attributes and the rules of an element declare, in no order.
#[derive(Default)]
struct Declared<'a> {
    properties: Vec<Ranked<&'a Declaration>>,
    /// The texts of custom properties by their names.
    variables: BTreeMap<&'a Arc<str>, Vec<Ranked<&'a Arc<str>>>>,
}

impl<'a> Declared<'a> {
    fn add_properties(&mut self, place: BlockPlace, declarations: &'a [Declaration]) {
        self.properties.extend(declarations.iter().enumerate().map(|(index, declared)| Ranked {
            rank: Rank::new(place, index, declared.is_important),
            origin: place.origin,
            declared,
        }));
    }

    fn add_block(&mut self, place: BlockPlace, block: &'a Block) {
        self.add_properties(place, &block.declarations);
        for (index, variable) in block.variables.iter().enumerate() {
            let rank = Rank::new(place, index, variable.is_important);
            let ranked = Ranked { rank, origin: place.origin, declared: &variable.text };
            self.variables.entry(&variable.name).or_default().push(ranked);
        }
    }
}

/// Where the declarations of an element come from, the stronger the greater.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Origin {
    /// Presentation attributes.
    Hint,
    /// Rules, by the rank of their layer.
    Rule(usize),
    /// The `style` attribute.
    Inline,
}

impl Cascade {
    /// Reads all style sheets of a drawing. What of them is not read is in [`Cascade::remarks`].
    ///
    /// # Errors
    /// [`Excess::Selectors`] or [`Excess::Depth`].
    pub fn new(doc: &Document<'_>) -> Result<Self, Excess> {
        let mut sheets = Sheets::new();
        for pi in doc.root().children().filter_map(|n| n.pi()).filter(|pi| pi.target == "xml-stylesheet") {
            let text = pi.value.unwrap_or_default();
            let of_print = text.contains("media=\"print\"") || text.contains("media='print'");
            let is_alternate = text.contains("alternate=\"yes\"") || text.contains("alternate='yes'");
            if !(of_print || is_alternate) {
                sheets.remark(Weight::External, &format!("<?xml-stylesheet {text}?>"), 1);
            }
        }
        let mut lines = LineCounter { text: doc.input_text(), counted_to: 0, line: 1 };
        let mut nodes = 0;
        let mut title = None;
        for node in doc.descendants() {
            nodes += 1;
            read_sheet(node, &mut lines, &mut title, &mut sheets)?;
        }
        sheets.finish();
        Ok(Self {
            sheets,
            tree: Tree::new(nodes),
            caches: SelectorCaches::default(),
            substituted: SubstitutedBytes::default(),
            root_font_px: property::FONT_PX,
        })
    }

    /// What of the style sheets is not read, in their order.
    pub fn remarks(&self) -> &[Remark] {
        &self.sheets.remarks
    }

    /// Whether there are no rules, so that styles come from attributes alone.
    pub fn is_empty(&self) -> bool {
        self.sheets.rules.is_empty()
    }

    /// The style of an element, with what of its attributes is not read.
    ///
    /// `parent` is the style of its parent or, if a use refers to it, of the use; the root inherits from
    /// [`Style::initial`]. `copied` is the element that the innermost use around it refers to: selectors see nothing
    /// outside of that. The root must be asked for first, since rem refers to its font.
    ///
    /// # Errors
    /// [`Excess::Steps`] or [`Excess::Variables`], counted over all calls.
    pub fn style(
        &mut self,
        node: Node<'_, '_>,
        parent: &Arc<Style>,
        copied: Option<NodeId>,
    ) -> Result<(Arc<Style>, Vec<Remark>), Excess> {
        let mut remarks = Vec::new();
        let hints = self.hints(node, &mut remarks);
        let inline = node.attribute("style").map(|text| sheet::style_attribute(text, &mut remarks));
        let matched = self.matched(node, copied)?;
        if hints.is_empty() && inline.is_none() && matched.is_empty() {
            let style = if parent.is_plain { parent.clone() } else { Arc::new(parent.child()) };
            return Ok((style, remarks));
        }
        let mut style = parent.child();
        style.root_font_px = self.root_font_px;
        let mut declared = Declared::default();
        declared.add_properties(BlockPlace::of_attributes(Origin::Hint), &hints);
        for place in matched {
            declared.add_block(place, &self.sheets.blocks[place.order]);
        }
        if let Some(block) = &inline {
            declared.add_block(BlockPlace::of_attributes(Origin::Inline), block);
        }
        let Declared { mut properties, variables } = declared;
        let variables = variables.into_iter().filter_map(|(name, texts)| declared_variable(name, texts)).collect();
        style.variables = parent.variables.with(&variables, &mut self.substituted)?;
        // By property, the strongest first.
        properties.sort_by(|a, b| (a.declared.property, b.rank).cmp(&(b.declared.property, a.rank)));
        for declarations in properties.chunk_by(|a, b| a.declared.property == b.declared.property) {
            decide(&mut style, parent, declarations, &mut self.substituted, &mut remarks)?;
            if declarations[0].declared.property == Property::FontSize {
                let own = &mut style.font_size;
                own.compute(parent.font_size.px, self.root_font_px);
                if node.parent_element().is_none() {
                    self.root_font_px = own.px;
                    style.root_font_px = own.px;
                }
            }
        }
        style.compute_lengths();
        Ok((Arc::new(style), remarks))
    }

    /// The presentation attributes of an element.
    fn hints(&self, node: Node<'_, '_>, remarks: &mut Vec<Remark>) -> Vec<Declaration> {
        let mut hints = Vec::new();
        let tag = node.tag_name().name();
        for attribute in node.attributes().filter(|a| a.namespace().is_none() && !a.value().trim().is_empty()) {
            let name = match (tag, attribute.name()) {
                ("pattern", "patternTransform") | ("linearGradient" | "radialGradient", "gradientTransform") => {
                    "transform"
                }
                (_, name) => name,
            };
            let is_renamed = name != attribute.name();
            let property = Property::of(name).filter(|p| p.name() == name && (is_renamed || p.is_attribute(tag)));
            if property.is_some() {
                let remark = declare(name, attribute.value(), false, Source::Attribute, &mut hints);
                remarks.extend(remark.map(|r| Remark { is_attribute: true, ..r }));
            }
        }
        hints
    }

    /// The places of the blocks whose rules apply to an element.
    fn matched(&mut self, node: Node<'_, '_>, copied: Option<NodeId>) -> Result<Vec<BlockPlace>, Excess> {
        if self.sheets.rules.is_empty() {
            return Ok(Vec::new());
        }
        let mut context = MatchingContext::new(
            MatchingMode::Normal,
            None,
            &mut self.caches,
            QuirksMode::NoQuirks,
            NeedsSelectorFlags::No,
            MatchingForInvalidation::No,
        );
        let element = StyledElement { node, tree: &self.tree, copied };
        let classes = node.attribute("class").unwrap_or_default();
        let mut matched = Vec::new();
        for i in self.sheets.candidates(node.tag_name().name(), node.attribute("id"), classes) {
            let rule = &self.sheets.rules[i];
            if self.tree.spend(0) && matches_selector(&rule.selector, 0, None, element, &mut context) {
                let origin = Origin::Rule(self.sheets.rank[rule.layer]);
                matched.push(BlockPlace { origin, specificity: rule.selector.specificity(), order: rule.block });
            }
        }
        if self.tree.is_exhausted() { Err(Excess::Steps) } else { Ok(matched) }
    }
}

/// Sets a property by its declarations, of which the strongest comes first.
fn decide(
    style: &mut Style,
    parent: &Style,
    declared: &[Ranked<&Declaration>],
    substituted_bytes: &mut SubstitutedBytes,
    remarks: &mut Vec<Remark>,
) -> Result<(), Excess> {
    let property = declared[0].declared.property;
    let mut reverted = Vec::new();
    for Ranked { origin, declared: declaration, .. } in declared {
        // After `revert-layer` what stands in the same layer does not count.
        if reverted.contains(origin) {
            continue;
        }
        let keyword = match &declaration.value {
            DeclaredValue::Valid(value) => {
                style.set(value);
                return Ok(());
            }
            DeclaredValue::Wide(keyword) => *keyword,
            DeclaredValue::Pending(pending) => match resolved(style, pending, property, substituted_bytes, remarks)? {
                Some(DeclaredValue::Valid(value)) => {
                    style.set(&value);
                    return Ok(());
                }
                Some(DeclaredValue::Wide(keyword)) => keyword,
                // Weaker declarations are out of the cascade by then (CSS Variables 1, 3.1).
                _ => WideKeyword::Unset,
            },
        };
        match keyword {
            WideKeyword::Inherit | WideKeyword::Initial | WideKeyword::Unset if property == Property::Overflow => {
                // Nested drawings hide what leaves them by the sheet of the browser alone. A declaration overrides it,
                // and the initial value is `visible`.
                let inherited = if keyword == WideKeyword::Inherit { parent.overflows } else { None };
                style.set(&Value::Overflow(Some(inherited.unwrap_or(true))));
            }
            WideKeyword::Inherit => style.take(property, parent),
            WideKeyword::Initial => style.take(property, &Style::initial()),
            WideKeyword::Unset | WideKeyword::Revert if property.is_inherited() => style.take(property, parent),
            WideKeyword::Unset | WideKeyword::Revert => style.take(property, &Style::initial()),
            WideKeyword::RevertLayer => {
                reverted.push(*origin);
                continue;
            }
        }
        return Ok(());
    }
    Ok(())
}

/// What a declaration says of a property once its variables are put in; None where it is not valid then.
fn resolved(
    style: &Style,
    pending: &PendingValue,
    property: Property,
    substituted_bytes: &mut SubstitutedBytes,
    remarks: &mut Vec<Remark>,
) -> Result<Option<DeclaredValue>, Excess> {
    let PendingValue { name, text } = pending;
    let Some(text) = style.variables.substituted(text, substituted_bytes)? else {
        remarks.push(Remark::new(Weight::Ignored, name, text));
        return Ok(None);
    };
    // A shorthand declares several properties.
    let mut declarations = Vec::new();
    remarks.extend(declare(name, &text, false, Source::Css, &mut declarations));
    Ok(declarations.into_iter().find(|d| d.property == property).map(|d| d.value))
}

/// Where a block of declarations stands in the cascade.
#[derive(Clone, Copy, Debug)]
struct BlockPlace {
    origin: Origin,
    specificity: u32,
    /// Its index among the blocks of the sheets; 0 for attributes.
    order: usize,
}

impl BlockPlace {
    /// The place of an element's own attributes.
    fn of_attributes(origin: Origin) -> Self {
        Self { origin, specificity: 0, order: 0 }
    }
}

/// More than a block has declarations.
const ORDER: usize = 1 << 24;

/// A custom property and its text, by its declarations; None where it is taken away or kept as the parent has it.
fn declared_variable(name: &Arc<str>, mut texts: Vec<Ranked<&Arc<str>>>) -> Option<(Arc<str>, Option<Arc<str>>)> {
    texts.sort_by_key(|text| std::cmp::Reverse(text.rank));
    let mut reverted = Vec::new();
    for Ranked { origin, declared: text, .. } in texts {
        if reverted.contains(&origin) {
            continue;
        }
        match text.trim().to_ascii_lowercase().as_str() {
            "revert-layer" => reverted.push(origin),
            "initial" => return Some((name.clone(), None)),
            "inherit" | "unset" | "revert" => return None,
            _ => return Some((name.clone(), Some(text.clone()))),
        }
    }
    None
}

/// The lines of places that are asked for in the order of the document, so that its text is counted through once.
struct LineCounter<'a> {
    text: &'a str,
    /// `line` is the line of this byte.
    counted_to: usize,
    line: u32,
}

impl LineCounter<'_> {
    /// The line of a byte, from 1.
    fn line_of(&mut self, byte: usize) -> u32 {
        let next = self.text.get(self.counted_to..byte).unwrap_or_default();
        self.line += next.bytes().filter(|&b| b == b'\n').count() as u32;
        self.counted_to = self.counted_to.max(byte);
        self.line
    }
}

/// Reads the style sheet that an element holds, if it is one.
fn read_sheet<'a>(
    node: Node<'a, '_>,
    lines: &mut LineCounter<'_>,
    title: &mut Option<&'a str>,
    sheets: &mut Sheets,
) -> Result<(), Excess> {
    let namespace = node.tag_name().namespace();
    match (node.tag_name().name(), namespace) {
        ("style", None | Some(SVG | XHTML)) => {}
        ("link", Some(XHTML)) => {
            let is_sheet = node.attribute("rel").is_some_and(|r| r.to_ascii_lowercase().contains("stylesheet"));
            if is_sheet {
                let href = node.attribute("href").unwrap_or_default();
                sheets.remark(Weight::External, &format!("<link href={href:?}>"), lines.line_of(node.range().start));
            }
            return Ok(());
        }
        _ => return Ok(()),
    }
    let line = lines.line_of(node.range().start);
    let kind = node.attribute("type").unwrap_or_default();
    if !(kind.is_empty() || kind.eq_ignore_ascii_case("text/css")) {
        sheets.remark(Weight::Ignored, &format!("<style type={kind:?}>"), line);
        return Ok(());
    }
    // Of sheets with titles only those with the first one count (CSSOM, 6.2.3).
    if let Some(own) = node.attribute("title").filter(|t| !t.is_empty())
        && *title.get_or_insert(own) != own
    {
        sheets.remark(Weight::Ignored, &format!("<style title={own:?}>"), line);
        return Ok(());
    }
    match condition::media(&mut cssparser::Parser::new(node.attribute("media").unwrap_or_default())) {
        condition::Truth::False => return Ok(()),
        condition::Truth::Unknown(what) => {
            sheets.remark(Weight::Unknown(what), "", line);
            return Ok(());
        }
        condition::Truth::True => {}
    }
    let mut texts = node.children().filter(Node::is_text);
    let Some(first) = texts.next() else { return Ok(()) };
    let start = lines.line_of(first.range().start);
    let mut text = first.text().unwrap_or_default().to_owned();
    texts.for_each(|t| text.push_str(t.text().unwrap_or_default()));
    sheets.add(&text, start)
}

#[cfg(test)]
mod tests;
