//! Selectors (those of Servo) on the elements of a drawing.

use std::cell::Cell;
use std::fmt::{self, Write};
use std::sync::Arc;

use cssparser::{ParseError, Parser as CssParser, ToCss, serialize_identifier};
use precomputed_hash::PrecomputedHash;
use roxmltree::{Node, NodeId};
use selectors::attr::{AttrSelectorOperation, CaseSensitivity, NamespaceConstraint};
use selectors::bloom::BloomFilter;
use selectors::context::MatchingContext;
use selectors::matching::ElementSelectorFlags;
use selectors::parser::{self, ParseRelative, SelectorList, SelectorParseErrorKind};
use selectors::{Element, OpaqueElement, SelectorImpl};

/// Most steps of all comparisons of elements with selectors, long attributes counted by their length.
const MAX_STEPS: usize = 40_000_000;

/// Deepest nesting of blocks and brackets.
pub(crate) const MAX_DEPTH: u8 = 64;

/// How many bytes of an attribute are compared in one step.
const BYTES_PER_STEP: usize = 64;

/// Whether browsers know a selector.
pub(crate) fn is_selector(text: &str) -> bool {
    let mut css = CssParser::new(text);
    css.set_nested_block_limit(MAX_DEPTH);
    SelectorList::<Svg>::parse(&Names::default(), &mut css, ParseRelative::No).is_ok() && css.is_exhausted()
}

/// What selectors are made of.
#[derive(Clone, Debug)]
pub(crate) struct Svg;

/// A name or value in a selector.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Name(pub(crate) Arc<str>);

impl From<&str> for Name {
    fn from(text: &str) -> Self {
        Self(text.into())
    }
}

impl AsRef<str> for Name {
    fn as_ref(&self) -> &str {
        &self.0
    }
}

impl ToCss for Name {
    fn to_css<W: Write>(&self, out: &mut W) -> fmt::Result {
        serialize_identifier(&self.0, out)
    }
}

impl PrecomputedHash for Name {
    fn precomputed_hash(&self) -> u32 {
        // FNV-1a of 32 bits.
        self.0.bytes().fold(0x811c_9dc5, |hash, byte| (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193))
    }
}

/// A pseudo-class that is not one of structure.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum PseudoClass {
    /// Of links that were not followed.
    Link,
    /// Of elements that are known, which all are.
    Defined,
    /// Of languages: each is a range.
    Lang(Vec<String>),
    /// Of what a user or program does, which nobody does to a drawing that is marked.
    Dynamic(String),
}

impl ToCss for PseudoClass {
    fn to_css<W: Write>(&self, out: &mut W) -> fmt::Result {
        match self {
            Self::Link => out.write_str(":link"),
            Self::Defined => out.write_str(":defined"),
            Self::Lang(ranges) => write!(out, ":lang({})", ranges.join(", ")),
            Self::Dynamic(name) => write!(out, ":{name}"),
        }
    }
}

impl parser::NonTSPseudoClass for PseudoClass {
    fn is_active_or_hover(&self) -> bool {
        matches!(self, Self::Dynamic(name) if name == "active" || name == "hover")
    }

    fn is_user_action_state(&self) -> bool {
        matches!(self, Self::Dynamic(name) if matches!(name.as_str(), "active" | "hover" | "focus"))
    }
}

/// A pseudo-element, none of which shapes have.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct PseudoElement(String);

impl ToCss for PseudoElement {
    fn to_css<W: Write>(&self, out: &mut W) -> fmt::Result {
        write!(out, "::{}", self.0)
    }
}

impl parser::PseudoElement for PseudoElement {}

impl SelectorImpl for Svg {
    type ExtraMatchingData<'a> = ();
    type AttrValue = Name;
    type Identifier = Name;
    type LocalName = Name;
    type NamespaceUrl = Name;
    type NamespacePrefix = Name;
    type BorrowedNamespaceUrl = Name;
    type BorrowedLocalName = Name;
    type NonTSPseudoClass = PseudoClass;
    type PseudoElement = PseudoElement;
}

/// Pseudo-classes that match nothing while nobody points at, edits or plays a drawing.
const DYNAMIC: [&str; 33] = [
    "hover",
    "active",
    "focus",
    "focus-within",
    "focus-visible",
    "visited",
    "target",
    "target-within",
    "checked",
    "disabled",
    "enabled",
    "indeterminate",
    "default",
    "valid",
    "invalid",
    "in-range",
    "out-of-range",
    "required",
    "optional",
    "user-valid",
    "user-invalid",
    "read-only",
    "read-write",
    "placeholder-shown",
    "autofill",
    "-webkit-autofill",
    "fullscreen",
    "modal",
    "popover-open",
    "open",
    "picture-in-picture",
    "past",
    "host",
];

/// The pseudo-elements that browsers know.
const PSEUDO_ELEMENTS: [&str; 16] = [
    "before",
    "after",
    "first-line",
    "first-letter",
    "selection",
    "marker",
    "backdrop",
    "placeholder",
    "cue",
    "file-selector-button",
    "target-text",
    "spelling-error",
    "grammar-error",
    "details-content",
    "view-transition",
    "search-text",
];

/// Reads selectors; `unknown` keeps what of them browsers may know though it is not known here.
#[derive(Debug, Default)]
pub(crate) struct Names {
    pub(crate) default: Option<Name>,
    pub(crate) prefixes: Vec<(Name, Name)>,
    pub(crate) unknown: std::cell::RefCell<Option<String>>,
}

impl Names {
    fn unsupported(&self) -> ParseError<SelectorParseErrorKind> {
        ParseError::custom(SelectorParseErrorKind::UnsupportedPseudoClassOrElement)
    }
}

impl<'i> parser::Parser<'i> for Names {
    type Impl = Svg;
    type Error = SelectorParseErrorKind;

    fn parse_nth_child_of(&self) -> bool {
        true
    }

    fn parse_is_and_where(&self) -> bool {
        true
    }

    fn parse_has(&self) -> bool {
        true
    }

    fn parse_parent_selector(&self) -> bool {
        true
    }

    fn parse_non_ts_pseudo_class(&self, name: &str) -> Result<PseudoClass, ParseError<SelectorParseErrorKind>> {
        let name = name.to_ascii_lowercase();
        match name.as_str() {
            "link" | "any-link" | "-webkit-any-link" => Ok(PseudoClass::Link),
            "defined" => Ok(PseudoClass::Defined),
            other if DYNAMIC.contains(&other) => Ok(PseudoClass::Dynamic(name)),
            _ => Err(self.unsupported()),
        }
    }

    fn parse_non_ts_functional_pseudo_class(
        &self,
        name: &str,
        css: &mut CssParser<'i>,
        _after_part: bool,
    ) -> Result<PseudoClass, ParseError<SelectorParseErrorKind>> {
        if name.eq_ignore_ascii_case("lang") {
            let range = |css: &mut CssParser<'i>| Ok(css.expect_ident()?.to_ascii_lowercase());
            return css.parse_comma_separated(range).map(PseudoClass::Lang);
        }
        let name = name.to_ascii_lowercase();
        if matches!(
            name.as_str(),
            "dir" | "state" | "host" | "host-context" | "nth-col" | "nth-last-col" | "-webkit-any"
        ) {
            self.unknown.borrow_mut().get_or_insert(format!("the selector :{name}()"));
        }
        Err(self.unsupported())
    }

    fn parse_pseudo_element(&self, name: &str) -> Result<PseudoElement, ParseError<SelectorParseErrorKind>> {
        let name = name.to_ascii_lowercase();
        let is_known = PSEUDO_ELEMENTS.contains(&name.as_str()) || name.starts_with("-webkit-");
        if is_known { Ok(PseudoElement(name)) } else { Err(self.unsupported()) }
    }

    fn parse_functional_pseudo_element(
        &self,
        name: &str,
        arguments: &mut CssParser<'i>,
    ) -> Result<PseudoElement, ParseError<SelectorParseErrorKind>> {
        let name = name.to_ascii_lowercase();
        while arguments.next().is_ok() {}
        let is_known = matches!(name.as_str(), "part" | "slotted" | "cue" | "highlight") || name.starts_with("view-");
        if is_known { Ok(PseudoElement(name)) } else { Err(self.unsupported()) }
    }

    fn default_namespace(&self) -> Option<Name> {
        self.default.clone()
    }

    fn namespace_for_prefix(&self, prefix: &Name) -> Option<Name> {
        self.prefixes.iter().rev().find(|(name, _)| name == prefix).map(|(_, url)| url.clone())
    }
}

/// What all elements of a drawing share while selectors are matched.
#[derive(Debug)]
pub(crate) struct Tree {
    /// Of every node two bytes, whose places tell nodes and their copies apart.
    places: Vec<[u8; 2]>,
    steps: Cell<usize>,
}

impl Tree {
    pub(crate) fn new(nodes: usize) -> Self {
        Self { places: vec![[0; 2]; nodes], steps: Cell::new(0) }
    }

    /// Counts a step that looks at some bytes. Once there were too many, nothing matches any more and no element has
    /// neighbours, so that matching ends at once.
    pub(crate) fn spend(&self, bytes: usize) -> bool {
        self.steps.set(self.steps.get().saturating_add(1 + bytes / BYTES_PER_STEP));
        !self.is_exhausted()
    }

    pub(crate) fn is_exhausted(&self) -> bool {
        self.steps.get() > MAX_STEPS
    }
}

/// An element as selectors see it.
#[derive(Clone, Copy)]
pub(crate) struct StyledElement<'a, 'i> {
    pub(crate) node: Node<'a, 'i>,
    pub(crate) tree: &'a Tree,
    /// The element that a use shows a copy of: in the copy it has neither parent nor neighbours (SVG 2, 5.6.3).
    pub(crate) copied: Option<NodeId>,
}

impl fmt::Debug for StyledElement<'_, '_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?}", self.node.tag_name())
    }
}

impl<'a, 'i> StyledElement<'a, 'i> {
    fn is_copied(self) -> bool {
        self.copied == Some(self.node.id())
    }

    /// Another element of the same tree, seen from the same place.
    fn with_node(self, node: Node<'a, 'i>) -> Self {
        Self { node, ..self }
    }

    /// The first element among siblings, from one on.
    fn first_element(
        self,
        mut node: Option<Node<'a, 'i>>,
        next: fn(&Node<'a, 'i>) -> Option<Node<'a, 'i>>,
    ) -> Option<Self> {
        while let Some(candidate) = node {
            if !self.tree.spend(0) {
                return None;
            }
            if candidate.is_element() {
                return Some(self.with_node(candidate));
            }
            node = next(&candidate);
        }
        None
    }

    fn attribute(self, name: &str) -> Option<&'a str> {
        let value = self.node.attribute(name)?;
        self.tree.spend(value.len()).then_some(value)
    }

    /// The language of an element (XML, SVG 2).
    fn lang(self) -> &'a str {
        let lang = |n: Node<'a, 'i>| n.attribute((XML, "lang")).or_else(|| n.attribute("lang"));
        self.node.ancestors().find_map(lang).unwrap_or_default()
    }
}

const XML: &str = "http://www.w3.org/XML/1998/namespace";
const XLINK: &str = "http://www.w3.org/1999/xlink";

/// Whether a language is in a range of languages, both in lower case: `en-gb` is in `en` (RFC 4647, 3.3.1).
fn is_in_range(lang: &str, range: &str) -> bool {
    match lang.strip_prefix(range) {
        Some(rest) => !lang.is_empty() && (rest.is_empty() || rest.starts_with('-')),
        None => range == "*" && !lang.is_empty(),
    }
}

impl<'a, 'i> Element for StyledElement<'a, 'i> {
    type Impl = Svg;

    fn opaque(&self) -> OpaqueElement {
        OpaqueElement::new(&self.tree.places[self.node.id().get_usize()][usize::from(self.is_copied())])
    }

    fn parent_element(&self) -> Option<Self> {
        let parent = self.node.parent_element().filter(|_| !self.is_copied())?;
        self.tree.spend(0).then(|| self.with_node(parent))
    }

    fn parent_node_is_shadow_root(&self) -> bool {
        false
    }

    fn containing_shadow_host(&self) -> Option<Self> {
        None
    }

    fn is_pseudo_element(&self) -> bool {
        false
    }

    fn prev_sibling_element(&self) -> Option<Self> {
        self.first_element(self.node.prev_sibling().filter(|_| !self.is_copied()), Node::prev_sibling)
    }

    fn next_sibling_element(&self) -> Option<Self> {
        self.first_element(self.node.next_sibling().filter(|_| !self.is_copied()), Node::next_sibling)
    }

    fn first_element_child(&self) -> Option<Self> {
        self.first_element(self.node.first_child(), Node::next_sibling)
    }

    fn is_html_element_in_html_document(&self) -> bool {
        false
    }

    fn has_local_name(&self, name: &Name) -> bool {
        self.tree.spend(0) && self.node.tag_name().name() == &*name.0
    }

    fn has_namespace(&self, url: &Name) -> bool {
        self.tree.spend(0) && self.node.tag_name().namespace().unwrap_or_default() == &*url.0
    }

    fn is_same_type(&self, other: &Self) -> bool {
        self.tree.spend(0) && self.node.tag_name() == other.node.tag_name()
    }

    fn attr_matches(
        &self,
        namespace: &NamespaceConstraint<&Name>,
        name: &Name,
        operation: &AttrSelectorOperation<&Name>,
    ) -> bool {
        let has_namespace = |url: Option<&str>| match namespace {
            NamespaceConstraint::Any => true,
            NamespaceConstraint::Specific(wanted) => url.unwrap_or_default() == &*wanted.0,
        };
        self.node.attributes().any(|a| {
            self.tree.spend(0)
                && a.name() == &*name.0
                && has_namespace(a.namespace())
                && self.tree.spend(a.value().len())
                && operation.eval_str(a.value())
        })
    }

    fn match_non_ts_pseudo_class(&self, class: &PseudoClass, _: &mut MatchingContext<'_, Svg>) -> bool {
        match class {
            PseudoClass::Link => self.is_link(),
            PseudoClass::Defined => true,
            PseudoClass::Lang(ranges) => {
                let lang = self.lang().to_ascii_lowercase();
                self.tree.spend(lang.len()) && ranges.iter().any(|range| is_in_range(&lang, range))
            }
            PseudoClass::Dynamic(_) => false,
        }
    }

    fn match_pseudo_element(&self, _: &PseudoElement, _: &mut MatchingContext<'_, Svg>) -> bool {
        false
    }

    fn apply_selector_flags(&self, _: ElementSelectorFlags) {}

    fn is_link(&self) -> bool {
        let has_link = self.node.has_attribute("href") || self.node.has_attribute((XLINK, "href"));
        has_link && self.node.tag_name().name() == "a"
    }

    fn is_html_slot_element(&self) -> bool {
        false
    }

    fn has_id(&self, id: &Name, case: CaseSensitivity) -> bool {
        self.attribute("id").is_some_and(|own| case.eq(own.as_bytes(), id.0.as_bytes()))
    }

    fn has_class(&self, name: &Name, case: CaseSensitivity) -> bool {
        let own = self.attribute("class").unwrap_or_default();
        own.split_ascii_whitespace().any(|c| case.eq(c.as_bytes(), name.0.as_bytes()))
    }

    fn has_custom_state(&self, _: &Name) -> bool {
        false
    }

    fn imported_part(&self, _: &Name) -> Option<Name> {
        None
    }

    fn is_part(&self, _: &Name) -> bool {
        false
    }

    fn is_empty(&self) -> bool {
        let is_nothing =
            |n: Node<'_, '_>| !n.is_element() && n.text().filter(|_| n.is_text()).is_none_or(str::is_empty);
        self.node.children().all(|n| self.tree.spend(0) && is_nothing(n))
    }

    fn is_root(&self) -> bool {
        self.node.parent_element().is_none()
    }

    fn add_element_unique_hashes(&self, _: &mut BloomFilter) -> bool {
        false
    }
}

#[cfg(test)]
mod tests {
    use super::is_in_range;

    #[test]
    fn ranges_hold_languages_that_begin_with_their_parts() {
        for (lang, range, want) in [
            ("en", "en", true),
            ("en-gb", "en", true),
            ("eng", "en", false),
            ("en", "en-gb", false),
            ("de", "*", true),
            ("", "*", false),
            ("", "", false),
        ] {
            assert_eq!(is_in_range(lang, range), want, "{lang:?} in {range:?}");
        }
    }
}
