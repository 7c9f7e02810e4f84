//! The style sheets of a drawing as rules, by what an element must have for them to apply.

use std::sync::Arc;

use cssparser::{
    AtRuleParser, BasicParseErrorKind, CowRcStr, DeclarationParser, ParseError, ParseErrorKind, Parser, ParserState,
    QualifiedRuleParser, RuleBodyItemParser, RuleBodyParser, StyleSheetParser,
};
use rustc_hash::FxHashMap;
use selectors::parser::{Component, ParseRelative, Selector, SelectorList};

use super::condition::{Holds, media, supported};
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
    /// Custom properties: name, text, whether they are important.
    pub(crate) variables: Vec<(Arc<str>, Arc<str>, bool)>,
}

impl Block {
    fn is_empty(&self) -> bool {
        self.declarations.is_empty() && self.variables.is_empty()
    }

    /// Reads one declaration; says what of it is not read.
    pub(crate) fn add(&mut self, name: &str, text: &str, source: Source) -> Option<Remark> {
        let (text, is_important) = without_important(text);
        if let Some(own) = name.strip_prefix("--") {
            if !own.is_empty() {
                self.variables.push((name.into(), text.trim().into(), is_important));
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
    layers: Vec<Layer>,
    /// Layers with a name, by that of the layer around them.
    named: FxHashMap<(usize, Arc<str>), usize>,
    /// Places of layers in the order of the cascade.
    pub(crate) rank: Vec<usize>,
    by_id: FxHashMap<Arc<str>, Vec<usize>>,
    by_class: FxHashMap<Arc<str>, Vec<usize>>,
    by_tag: FxHashMap<Arc<str>, Vec<usize>>,
    others: Vec<usize>,
    pub(crate) remarks: Vec<Remark>,
    excess: Option<Excess>,
}

#[derive(Debug)]
struct Layer {
    parent: usize,
}

/// The layer of what lies in none.
const UNLAYERED: usize = 0;

impl Sheets {
    pub(crate) fn new() -> Self {
        Self { layers: vec![Layer { parent: UNLAYERED }], ..Self::default() }
    }

    /// Reads a style sheet that begins in a line of the drawing.
    pub(crate) fn add(&mut self, text: &str, line: u32) -> Result<(), Excess> {
        let mut css = Parser::new(text);
        css.set_nested_block_limit(MAX_DEPTH);
        let mut reader = Reader {
            sheets: self,
            names: Names::default(),
            line,
            layer: UNLAYERED,
            parent: None,
            block: Block::default(),
            is_in_rule: false,
            may_import: true,
        };
        let mut all = StyleSheetParser::new(&mut css, &mut reader);
        while let Some(rule) = all.next() {
            if let Err((fault, text, at)) = rule {
                all.parser.dropped(&fault, text, at.line);
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
        for (i, rule) in self.rules.iter().enumerate() {
            // The rightmost part has to hold for the element itself.
            let mut parts = rule.selector.iter();
            let mut key = None;
            for part in &mut parts {
                match part {
                    Component::ID(id) => key = Some((0, id)),
                    Component::Class(class) if key.is_none_or(|(k, _)| k > 1) => key = Some((1, class)),
                    Component::LocalName(name) if key.is_none() => key = Some((2, &name.name)),
                    _ => {}
                }
            }
            match key {
                Some((0, name)) => self.by_id.entry(name.0.clone()).or_default().push(i),
                Some((1, name)) => self.by_class.entry(name.0.clone()).or_default().push(i),
                Some((_, name)) => self.by_tag.entry(name.0.clone()).or_default().push(i),
                None => self.others.push(i),
            }
        }
        // A layer comes after the layers in it, and those in the order in which they are first named.
        let mut children = vec![Vec::new(); self.layers.len()];
        for (i, layer) in self.layers.iter().enumerate().skip(1) {
            children[layer.parent].push(i);
        }
        self.rank = vec![0; self.layers.len()];
        let (mut next, mut open) = (0, vec![(UNLAYERED, 0)]);
        while let Some((layer, done)) = open.pop() {
            match children[layer].get(done) {
                Some(&child) => open.extend([(layer, done + 1), (child, 0)]),
                None => {
                    self.rank[layer] = next;
                    next += 1;
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
        let of = |map: &'s FxHashMap<Arc<str>, Vec<usize>>, name: &str| map.get(name).into_iter().flatten();
        let with_id = id.into_iter().flat_map(move |id| of(&self.by_id, id));
        let with_class = classes.split_ascii_whitespace().flat_map(move |class| of(&self.by_class, class));
        let all = with_id.chain(with_class).chain(of(&self.by_tag, tag)).chain(&self.others).copied();
        all.collect::<Vec<_>>().into_iter()
    }

    fn layer(&mut self, parent: usize, name: Option<&str>) -> usize {
        let new = self.layers.len();
        // One without a name is nobody else's.
        let layer = name.map_or(new, |name| *self.named.entry((parent, name.into())).or_insert(new));
        if layer == new {
            self.layers.push(Layer { parent });
        }
        layer
    }
}

/// Reads rules in their order.
struct Reader<'s> {
    sheets: &'s mut Sheets,
    names: Names,
    /// Line of the drawing in which the sheet begins.
    line: u32,
    layer: usize,
    /// The selectors of the rule that is being read.
    parent: Option<SelectorList<Svg>>,
    /// What that rule declares, up to the next rule in it.
    block: Block,
    is_in_rule: bool,
    /// Whether `@import` and `@namespace` may follow.
    may_import: bool,
}

/// What an at-rule asks for.
enum At {
    /// Rules that apply if a condition holds, in a layer of their own if it has a name.
    Group(Holds),
    Layers(Vec<Vec<Arc<str>>>),
    Namespace(Option<Name>, Name),
    Import(String),
    /// It changes nothing of shapes.
    Nothing,
    Unknown(String),
}

impl Reader<'_> {
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
        let rule = |selector: &Selector<Svg>| Rule { selector: selector.clone(), block: index, layer: self.layer };
        self.sheets.rules.extend(parent.slice().iter().map(rule));
        if self.sheets.rules.len() > MAX_SELECTORS {
            self.sheets.excess = Some(Excess::Selectors);
        }
    }

    /// Reads what stands in a block.
    fn body(&mut self, css: &mut Parser<'_>) {
        let mut all = RuleBodyParser::new(css, self);
        while let Some(item) = all.next() {
            if let Err((fault, text, at)) = item {
                all.parser.dropped(&fault, text, at.line);
            }
            if all.parser.sheets.excess.is_some() {
                return;
            }
        }
    }
}

impl<'i> DeclarationParser<'i> for Reader<'_> {
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

impl<'i> QualifiedRuleParser<'i> for Reader<'_> {
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
        if self.sheets.excess.is_some() {
            return Ok(());
        }
        self.flush();
        let outer = (self.parent.replace(list), std::mem::replace(&mut self.is_in_rule, true));
        self.body(css);
        self.flush();
        (self.parent, self.is_in_rule) = outer;
        Ok(())
    }
}

impl<'i> AtRuleParser<'i> for Reader<'_> {
    type Prelude = At;
    type AtRule = ();
    type Error = ();

    fn parse_prelude(&mut self, name: CowRcStr<'i>, css: &mut Parser<'i>) -> Result<At, Fault> {
        let name = name.to_ascii_lowercase();
        let may_import = self.may_import;
        self.may_import &= matches!(name.as_str(), "import" | "namespace" | "charset" | "layer");
        let at = match name.as_str() {
            "media" => At::Group(media(css)),
            "supports" => At::Group(supported(css)),
            "layer" => At::Layers(if css.is_exhausted() { Vec::new() } else { css.parse_comma_separated(layer_name)? }),
            "namespace" if may_import => {
                let prefix = css.try_parse(|css| css.expect_ident().map(|n| Name(n.as_ref().into()))).ok();
                At::Namespace(prefix, Name(css.expect_url_or_string()?.as_ref().into()))
            }
            "import" if may_import => At::Import(raw(css, false)?.to_owned()),
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
            | "-ms-viewport" => At::Nothing,
            "-moz-document" | "document" => At::Nothing,
            "container" | "scope" | "property" | "function" | "mixin" | "when" | "else" | "if" => {
                At::Unknown(format!("@{name}"))
            }
            // Browsers know no others.
            _ => return Err(Fault::unexpected_token()),
        };
        while css.next().is_ok() {}
        Ok(at)
    }

    fn rule_without_block(&mut self, at: At, start: &ParserState) -> Result<(), ()> {
        let line = start.source_location().line;
        match at {
            At::Layers(names) if !names.is_empty() => {
                for name in names {
                    name.iter().fold(self.layer, |parent, part| self.sheets.layer(parent, Some(part)));
                }
            }
            At::Namespace(None, url) => self.names.default = Some(url),
            At::Namespace(Some(prefix), url) => self.names.prefixes.push((prefix, url)),
            At::Import(text) => {
                let what = format!("@import {text}");
                self.remark(Weight::External, &what, line);
            }
            At::Unknown(what) => self.remark(Weight::Unknown(what), "", line),
            At::Nothing => {}
            At::Layers(_) | At::Group(_) => return Err(()),
        }
        Ok(())
    }

    fn parse_block(&mut self, at: At, start: &ParserState, css: &mut Parser<'i>) -> Result<(), Fault> {
        let outer = self.layer;
        // What was declared before is of the layer out here.
        self.flush();
        match at {
            At::Group(Holds::Yes) => {}
            At::Layers(names) if names.len() < 2 => {
                self.layer = match names.first() {
                    None => self.sheets.layer(outer, None),
                    Some(name) => name.iter().fold(outer, |parent, part| self.sheets.layer(parent, Some(part))),
                };
            }
            At::Group(Holds::Unknown(what)) | At::Unknown(what) => {
                self.remark(Weight::Unknown(what), "", start.source_location().line);
                while css.next().is_ok() {}
                return Ok(());
            }
            At::Group(Holds::No) | At::Nothing => {
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

impl RuleBodyItemParser<'_, (), ()> for Reader<'_> {
    fn parse_declarations(&self) -> bool {
        self.is_in_rule
    }

    fn parse_qualified(&self) -> bool {
        true
    }
}

/// Reads the text of a `style` attribute.
pub(crate) fn style_attribute(text: &str, remarks: &mut Vec<Remark>) -> Block {
    let mut reader = Inline { block: Block::default(), remarks };
    let mut css = Parser::new(text);
    css.set_nested_block_limit(MAX_DEPTH);
    for item in RuleBodyParser::new(&mut css, &mut reader).collect::<Vec<_>>() {
        if let Err((_, text, _)) = item {
            reader.remarks.push(Remark::new(Weight::Ignored, "", text));
        }
    }
    reader.block
}

/// Reads declarations alone.
struct Inline<'r> {
    block: Block,
    remarks: &'r mut Vec<Remark>,
}

impl<'i> DeclarationParser<'i> for Inline<'_> {
    type Declaration = ();
    type Error = ();

    fn parse_value(&mut self, name: CowRcStr<'i>, css: &mut Parser<'i>, _: &ParserState) -> Result<(), Fault> {
        let text = raw(css, name.starts_with("--"))?;
        self.remarks.extend(self.block.add(&name, text, Source::Inline));
        Ok(())
    }
}

impl QualifiedRuleParser<'_> for Inline<'_> {
    type Prelude = ();
    type QualifiedRule = ();
    type Error = ();
}

impl AtRuleParser<'_> for Inline<'_> {
    type Prelude = ();
    type AtRule = ();
    type Error = ();
}

impl RuleBodyItemParser<'_, (), ()> for Inline<'_> {
    fn parse_declarations(&self) -> bool {
        true
    }

    fn parse_qualified(&self) -> bool {
        false
    }
}
