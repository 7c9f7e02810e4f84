//! The style sheets of a drawing as rules, by what an element must have for them to apply.

use std::sync::Arc;

use cssparser::{
    AtRuleParser, BasicParseErrorKind, CowRcStr, DeclarationParser, ParseError, ParseErrorKind, Parser, ParserState,
    QualifiedRuleParser, RuleBodyItemParser, RuleBodyParser, StyleSheetParser,
};
use rustc_hash::FxHashMap;
use selectors::parser::{Component, ParseRelative, Selector, SelectorList};

use super::condition::{Truth, media, supported};
use super::declaration::{Declaration, declare, raw, without_important};
use super::selector::{MAX_DEPTH, Name, Names, Svg};
use super::value::{Fault, Source};
use super::{Excess, Remark, Weight};

/// Most parts of one selector, for they are compared by recursion.
const MAX_PARTS: usize = 1000;

/// Most selectors of a drawing.
const MAX_SELECTORS: usize = 4_000_000;

/// What a rule declares.
#[derive(Debug, Default)]
pub(crate) struct Block {
    pub(crate) declarations: Vec<Declaration>,
    /// Custom properties.
    pub(crate) variables: Vec<CustomProperty>,
}

/// A declaration of a custom property.
#[derive(Debug)]
pub(crate) struct CustomProperty {
    /// Its name with the dashes.
    pub(crate) name: Arc<str>,
    pub(crate) text: Arc<str>,
    pub(crate) is_important: bool,
}

impl Block {
    fn is_empty(&self) -> bool {
        self.declarations.is_empty() && self.variables.is_empty()
    }

    /// Reads one declaration; says what of it is not read.
    pub(crate) fn add(&mut self, name: &str, text: &str, source: Source) -> Option<Remark> {
        let (text, is_important) = without_important(text);
        if let Some(rest) = name.strip_prefix("--") {
            // The name `--` is reserved (CSS Variables 1, 2).
            if !rest.is_empty() {
                self.variables.push(CustomProperty { name: name.into(), text: text.trim().into(), is_important });
            }
            return None;
        }
        declare(&name.to_ascii_lowercase(), text, is_important, source, &mut self.declarations)
    }
}

/// A selector with what it declares.
#[derive(Debug)]
pub(crate) struct Rule {
    pub(crate) selector: Selector<Svg>,
    pub(crate) block: usize,
    pub(crate) layer: usize,
}

/// All rules of a drawing.
#[derive(Debug, Default)]
pub(crate) struct Sheets {
    pub(crate) rules: Vec<Rule>,
    pub(crate) blocks: Vec<Block>,
    layers: Vec<CascadeLayer>,
    /// Layers with a name, by the layer around them and that name.
    named: FxHashMap<(usize, Arc<str>), usize>,
    /// Per layer, its place in the order of the cascade.
    pub(crate) rank: Vec<usize>,
    // The rules by one thing that the element itself must have: the id that they ask for, else a class, else the tag.
    by_id: FxHashMap<Arc<str>, Vec<usize>>,
    by_class: FxHashMap<Arc<str>, Vec<usize>>,
    by_tag: FxHashMap<Arc<str>, Vec<usize>>,
    /// Rules that ask for none of these.
    others: Vec<usize>,
    pub(crate) remarks: Vec<Remark>,
    excess: Option<Excess>,
}

/// A layer of the cascade, and the layer that holds it.
#[derive(Debug)]
struct CascadeLayer {
    parent: usize,
}

/// The layer of what lies in none.
const UNLAYERED: usize = 0;

impl Sheets {
    pub(crate) fn new() -> Self {
        Self { layers: vec![CascadeLayer { parent: UNLAYERED }], ..Self::default() }
    }

    /// Reads a style sheet that begins in a line of the drawing.
    pub(crate) fn add(&mut self, text: &str, line: u32) -> Result<(), Excess> {
        let mut css = Parser::new(text);
        css.set_nested_block_limit(MAX_DEPTH);
        let mut reader = SheetReader {
            sheets: self,
            names: Names::default(),
            line,
            layer: UNLAYERED,
            parent: None,
            block: Block::default(),
            may_import: true,
        };
        let mut rules = StyleSheetParser::new(&mut css, &mut reader);
        while let Some(rule) = rules.next() {
            if let Err((fault, text, at)) = rule {
                rules.parser.dropped(&fault, text, at.line);
            }
        }
        match self.excess {
            Some(excess) => Err(excess),
            None => Ok(()),
        }
    }

    /// Notes what a media query or condition that is not known of would decide.
    pub(crate) fn remark(&mut self, weight: Weight, text: &str, line: u32) {
        self.remarks.push(Remark { line: Some(line), ..Remark::new(weight, "", text) });
    }

    /// Sorts rules and layers once all sheets are read.
    pub(crate) fn finish(&mut self) {
        self.index_rules();
        self.rank_layers();
    }

    fn index_rules(&mut self) {
        for (i, rule) in self.rules.iter().enumerate() {
            match SelectorKey::of(&rule.selector) {
                Some(SelectorKey::Id(name)) => self.by_id.entry(name.0.clone()).or_default().push(i),
                Some(SelectorKey::Class(name)) => self.by_class.entry(name.0.clone()).or_default().push(i),
                Some(SelectorKey::Tag(name)) => self.by_tag.entry(name.0.clone()).or_default().push(i),
                None => self.others.push(i),
            }
        }
    }

    /// Gives every layer its place in the cascade: after the layers in it, which come in the order in which they are
    /// first named (CSS Cascade 5, 6.4).
    fn rank_layers(&mut self) {
        let mut children = vec![Vec::new(); self.layers.len()];
        for (i, layer) in self.layers.iter().enumerate().skip(1) {
            children[layer.parent].push(i);
        }
        self.rank = vec![0; self.layers.len()];
        let mut next_rank = 0;
        // The layers from the outermost in to one, each with how many of its children have their rank.
        let mut open = vec![(UNLAYERED, 0)];
        while let Some((layer, ranked_children)) = open.pop() {
            match children[layer].get(ranked_children) {
                Some(&child) => open.extend([(layer, ranked_children + 1), (child, 0)]),
                None => {
                    self.rank[layer] = next_rank;
                    next_rank += 1;
                }
            }
        }
    }

    /// The rules that may apply to an element, by what they ask of it.
    pub(crate) fn candidates<'s>(
        &'s self,
        tag: &str,
        id: Option<&str>,
        classes: &'s str,
    ) -> impl Iterator<Item = usize> + 's {
        let rules_of = |map: &'s FxHashMap<Arc<str>, Vec<usize>>, name: &str| map.get(name).into_iter().flatten();
        let with_id = id.into_iter().flat_map(move |id| rules_of(&self.by_id, id));
        let with_class = classes.split_ascii_whitespace().flat_map(move |class| rules_of(&self.by_class, class));
        let rules = with_id.chain(with_class).chain(rules_of(&self.by_tag, tag)).chain(&self.others).copied();
        rules.collect::<Vec<_>>().into_iter()
    }

    /// The layer of a name in another layer; a new one where it is not named yet.
    fn layer(&mut self, parent: usize, name: Option<&str>) -> usize {
        let new = self.layers.len();
        // One without a name is nobody else's.
        let layer = name.map_or(new, |name| *self.named.entry((parent, name.into())).or_insert(new));
        if layer == new {
            self.layers.push(CascadeLayer { parent });
        }
        layer
    }
}

/// What an element must have for a selector to match it.
enum SelectorKey<'s> {
    Id(&'s Name),
    Class(&'s Name),
    Tag(&'s Name),
}

impl<'s> SelectorKey<'s> {
    /// What the rightmost part of a selector asks for, as that part has to hold for the element itself: its id, else a
    /// class, else its tag.
    fn of(selector: &'s Selector<Svg>) -> Option<Self> {
        let mut key = None;
        for part in selector.iter() {
            match part {
                Component::ID(id) => key = Some(Self::Id(id)),
                Component::Class(class) if !matches!(key, Some(Self::Id(_) | Self::Class(_))) => {
                    key = Some(Self::Class(class));
                }
                Component::LocalName(name) if key.is_none() => key = Some(Self::Tag(&name.name)),
                _ => {}
            }
        }
        key
    }
}

/// Reads rules in their order.
struct SheetReader<'s> {
    sheets: &'s mut Sheets,
    names: Names,
    /// Line of the drawing in which the sheet begins.
    line: u32,
    layer: usize,
    /// The selectors of the rule that is being read; None outside of rules.
    parent: Option<SelectorList<Svg>>,
    /// What that rule declares, up to the next rule in it.
    block: Block,
    /// Whether `@import` and `@namespace` may follow.
    may_import: bool,
}

/// What an at-rule asks for.
enum AtPrelude {
    /// Rules that apply if a condition holds, in a layer of their own if it has a name.
    Group(Truth),
    Layers(Vec<Vec<Arc<str>>>),
    Namespace(Option<Name>, Name),
    Import(String),
    /// It changes nothing of shapes.
    Nothing,
    Unknown(String),
}

impl SheetReader<'_> {
    fn remark(&mut self, weight: Weight, text: &str, line: u32) {
        let line = self.line + line;
        self.sheets.remark(weight, text, line);
    }

    /// Notes a rule or declaration that is not valid.
    fn dropped(&mut self, fault: &ParseError<()>, text: &str, line: u32) {
        let unknown = self.names.unknown.borrow_mut().take();
        let weight = match (unknown, &fault.kind) {
            (Some(what), _) => Weight::Unknown(what),
            (None, ParseErrorKind::Basic(BasicParseErrorKind::TooManyNestedBlocks)) => {
                self.sheets.excess = Some(Excess::Depth);
                return;
            }
            (None, _) => Weight::Ignored,
        };
        let text = text.trim_end_matches('{').trim();
        if !text.is_empty() {
            self.remark(weight, text, line);
        }
    }

    /// Makes a rule of what was declared so far.
    fn flush(&mut self) {
        let block = std::mem::take(&mut self.block);
        let Some(parent) = self.parent.as_ref().filter(|_| !block.is_empty()) else { return };
        let index = self.sheets.blocks.len();
        self.sheets.blocks.push(block);
        let layer = self.layer;
        let selectors = parent.slice().iter().cloned();
        self.sheets.rules.extend(selectors.map(|selector| Rule { selector, block: index, layer }));
        if self.sheets.rules.len() > MAX_SELECTORS {
            self.sheets.excess = Some(Excess::Selectors);
        }
    }

    /// Reads what stands in a block.
    fn body(&mut self, css: &mut Parser<'_>) {
        let mut items = RuleBodyParser::new(css, self);
        while let Some(item) = items.next() {
            if let Err((fault, text, at)) = item {
                items.parser.dropped(&fault, text, at.line);
            }
            if items.parser.sheets.excess.is_some() {
                return;
            }
        }
    }
}

impl<'i> DeclarationParser<'i> for SheetReader<'_> {
    type Declaration = ();
    type Error = ();

    fn parse_value(&mut self, name: CowRcStr<'i>, css: &mut Parser<'i>, start: &ParserState) -> Result<(), Fault> {
        let text = raw(css, name.starts_with("--"))?;
        if let Some(remark) = self.block.add(&name, text, Source::Css) {
            let line = Some(self.line + start.source_location().line);
            self.sheets.remarks.push(Remark { line, ..remark });
        }
        Ok(())
    }
}

impl<'i> QualifiedRuleParser<'i> for SheetReader<'_> {
    type Prelude = SelectorList<Svg>;
    type QualifiedRule = ();
    type Error = ();

    fn parse_prelude(&mut self, css: &mut Parser<'i>) -> Result<SelectorList<Svg>, Fault> {
        self.may_import = false;
        let relative = if self.parent.is_some() { ParseRelative::ForNesting } else { ParseRelative::No };
        let list = SelectorList::parse(&self.names, css, relative).map_err(|_| Fault::unexpected_token())?;
        css.expect_exhausted()?;
        if list.slice().iter().any(|s| s.len() > MAX_PARTS) {
            self.sheets.excess = Some(Excess::Selectors);
        }
        Ok(match &self.parent {
            Some(parent) => list.replace_parent_selector(parent),
            None => list,
        })
    }

    fn parse_block(&mut self, list: SelectorList<Svg>, _: &ParserState, css: &mut Parser<'i>) -> Result<(), Fault> {
        // `Sheets::add` fails then, whatever else the sheet holds.
        if self.sheets.excess.is_some() {
            return Ok(());
        }
        // What the outer rule declares in front of a nested one is a block of its own, and comes before it in the
        // cascade (CSS Nesting 1).
        self.flush();
        let outer_parent = self.parent.replace(list);
        self.body(css);
        self.flush();
        self.parent = outer_parent;
        Ok(())
    }
}

impl<'i> AtRuleParser<'i> for SheetReader<'_> {
    type Prelude = AtPrelude;
    type AtRule = ();
    type Error = ();

    fn parse_prelude(&mut self, name: CowRcStr<'i>, css: &mut Parser<'i>) -> Result<AtPrelude, Fault> {
        let name = name.to_ascii_lowercase();
        let may_import = self.may_import;
        self.may_import &= matches!(name.as_str(), "import" | "namespace" | "charset" | "layer");
        let prelude = match name.as_str() {
            "media" => AtPrelude::Group(media(css)),
            "supports" => AtPrelude::Group(supported(css)),
            "layer" if css.is_exhausted() => AtPrelude::Layers(Vec::new()),
            "layer" => AtPrelude::Layers(css.parse_comma_separated(layer_name)?),
            "namespace" if may_import => {
                let prefix = css.try_parse(|css| css.expect_ident().map(|n| Name(n.as_ref().into()))).ok();
                AtPrelude::Namespace(prefix, Name(css.expect_url_or_string()?.as_ref().into()))
            }
            "import" if may_import => AtPrelude::Import(raw(css, false)?.to_owned()),
            // Too late, so browsers ignore them.
            "namespace" | "import" => return Err(Fault::unexpected_token()),
            "charset"
            | "font-face"
            | "font-feature-values"
            | "font-palette-values"
            | "keyframes"
            | "page"
            | "-webkit-keyframes"
            | "-moz-keyframes"
            | "-o-keyframes"
            | "counter-style"
            | "color-profile"
            | "view-transition"
            | "starting-style"
            | "position-try"
            | "viewport"
            | "-ms-viewport" => AtPrelude::Nothing,
            "-moz-document" | "document" => AtPrelude::Nothing,
            "container" | "scope" | "property" | "function" | "mixin" | "when" | "else" | "if" => {
                AtPrelude::Unknown(format!("@{name}"))
            }
            // Browsers know no others.
            _ => return Err(Fault::unexpected_token()),
        };
        while css.next().is_ok() {}
        Ok(prelude)
    }

    fn rule_without_block(&mut self, prelude: AtPrelude, start: &ParserState) -> Result<(), ()> {
        let line = start.source_location().line;
        match prelude {
            AtPrelude::Layers(names) if !names.is_empty() => {
                for name in names {
                    name.iter().fold(self.layer, |parent, part| self.sheets.layer(parent, Some(part)));
                }
            }
            AtPrelude::Namespace(None, url) => self.names.default = Some(url),
            AtPrelude::Namespace(Some(prefix), url) => self.names.prefixes.push((prefix, url)),
            AtPrelude::Import(text) => {
                let what = format!("@import {text}");
                self.remark(Weight::External, &what, line);
            }
            AtPrelude::Unknown(what) => self.remark(Weight::Unknown(what), "", line),
            AtPrelude::Nothing => {}
            AtPrelude::Layers(_) | AtPrelude::Group(_) => return Err(()),
        }
        Ok(())
    }

    fn parse_block(&mut self, prelude: AtPrelude, start: &ParserState, css: &mut Parser<'i>) -> Result<(), Fault> {
        let outer = self.layer;
        // What was declared before is of the layer out here.
        self.flush();
        match prelude {
            AtPrelude::Group(Truth::True) => {}
            AtPrelude::Layers(names) if names.len() < 2 => {
                self.layer = match names.first() {
                    None => self.sheets.layer(outer, None),
                    Some(name) => name.iter().fold(outer, |parent, part| self.sheets.layer(parent, Some(part))),
                };
            }
            AtPrelude::Group(Truth::Unknown(what)) | AtPrelude::Unknown(what) => {
                self.remark(Weight::Unknown(what), "", start.source_location().line);
                while css.next().is_ok() {}
                return Ok(());
            }
            AtPrelude::Group(Truth::False) | AtPrelude::Nothing => {
                while css.next().is_ok() {}
                return Ok(());
            }
            _ => return Err(Fault::unexpected_token()),
        }
        self.body(css);
        self.flush();
        self.layer = outer;
        Ok(())
    }
}

/// The parts of a layer's name.
fn layer_name(css: &mut Parser<'_>) -> Result<Vec<Arc<str>>, Fault> {
    let mut parts = vec![css.expect_ident()?.as_ref().into()];
    while css.try_parse(|css| css.expect_delim('.')).is_ok() {
        parts.push(css.expect_ident()?.as_ref().into());
    }
    Ok(parts)
}

impl RuleBodyItemParser<'_, (), ()> for SheetReader<'_> {
    fn parse_declarations(&self) -> bool {
        self.parent.is_some()
    }

    fn parse_qualified(&self) -> bool {
        true
    }
}

/// Reads the text of a `style` attribute.
pub(crate) fn style_attribute(text: &str, remarks: &mut Vec<Remark>) -> Block {
    let mut reader = StyleAttributeReader { block: Block::default(), remarks };
    let mut css = Parser::new(text);
    css.set_nested_block_limit(MAX_DEPTH);
    for item in RuleBodyParser::new(&mut css, &mut reader).collect::<Vec<_>>() {
        if let Err((_, text, _)) = item {
            reader.remarks.push(Remark::new(Weight::Ignored, "", text));
        }
    }
    reader.block
}

/// Reads the declarations of a `style` attribute, which holds no rules.
struct StyleAttributeReader<'r> {
    block: Block,
    remarks: &'r mut Vec<Remark>,
}

impl<'i> DeclarationParser<'i> for StyleAttributeReader<'_> {
    type Declaration = ();
    type Error = ();

    fn parse_value(&mut self, name: CowRcStr<'i>, css: &mut Parser<'i>, _: &ParserState) -> Result<(), Fault> {
        let text = raw(css, name.starts_with("--"))?;
        self.remarks.extend(self.block.add(&name, text, Source::Inline));
        Ok(())
    }
}

impl QualifiedRuleParser<'_> for StyleAttributeReader<'_> {
    type Prelude = ();
    type QualifiedRule = ();
    type Error = ();
}

impl AtRuleParser<'_> for StyleAttributeReader<'_> {
    type Prelude = ();
    type AtRule = ();
    type Error = ();
}

impl RuleBodyItemParser<'_, (), ()> for StyleAttributeReader<'_> {
    fn parse_declarations(&self) -> bool {
        true
    }

    fn parse_qualified(&self) -> bool {
        false
    }
}
