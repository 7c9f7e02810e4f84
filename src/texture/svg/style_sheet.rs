//! The style sheets of a drawing: rules in the order of the cascade, and which of them apply to an element.
//!
//! Reads CSS 2.1 without at-rules. A selector that is not understood applies to nothing. Nothing here recurses,
//! and [`Work`] counts what matching costs, so that no sheet and no depth of the drawing decides about time or
//! stack.

use std::ops::Range;

use roxmltree::Node;
use simplecss::{AttributeOperator, Declaration, SelectorToken, SelectorTokenizer};

use crate::diag::Diag;

/// Properties that are looked at, in the order in which their values are kept.
pub(super) const NAMES: [&str; 30] = [
    "display",
    "visibility",
    "opacity",
    "fill",
    "stroke",
    "fill-opacity",
    "stroke-opacity",
    "stroke-width",
    "stroke-dasharray",
    "stroke-dashoffset",
    "stroke-linecap",
    "stroke-linejoin",
    "stroke-miterlimit",
    "fill-rule",
    "clip-rule",
    "color",
    "paint-order",
    "vector-effect",
    "mix-blend-mode",
    "overflow",
    "mask-type",
    "transform-origin",
    "transform",
    "clip-path",
    "mask",
    "filter",
    "marker",
    "marker-start",
    "marker-mid",
    "marker-end",
];

/// Most tokens of all selectors together.
const MAX_TOKENS: usize = 1_000_000;

/// Most comparisons of elements with tokens of selectors, long attributes counted by their length.
const MAX_WORK: usize = 40_000_000;

/// What comparing with one more 64 bytes of an attribute counts as one comparison.
const BYTES_PER_STEP: usize = 64;

/// Comparisons made so far.
#[derive(Debug, Default)]
pub(super) struct Work(usize);

impl Work {
    /// Counts one comparison, and the bytes that it looks at.
    pub(super) fn spend(&mut self, bytes: usize) -> Result<(), Box<Diag>> {
        self.0 += 1 + bytes / BYTES_PER_STEP;
        if self.0 <= MAX_WORK {
            return Ok(());
        }
        let text = format!("applying the style sheet takes more than {MAX_WORK} comparisons");
        Err(Diag::input("svg-css", text).hint(HINT).into())
    }
}

const HINT: &str = "save the drawing with presentation attributes instead of a style sheet, or with fewer rules";

/// All rules of a drawing, the least specific first.
#[derive(Debug, Default)]
pub(super) struct Sheet<'a> {
    rules: Vec<Rule>,
    /// Selectors, one after another, as they are written.
    tokens: Vec<SelectorToken<'a>>,
    /// Of the properties in [`NAMES`] alone; at most one important and one other of each in a rule.
    declarations: Vec<Declaration<'a>>,
}

#[derive(Debug)]
struct Rule {
    tokens: Range<usize>,
    declarations: Range<usize>,
    /// Ids, classes and the like, tags.
    specificity: [usize; 3],
}

impl<'a> Sheet<'a> {
    /// The rules of texts without comments ([`without_comments`]), in the order of the cascade.
    pub(super) fn new(texts: &'a [String]) -> Result<Self, Box<Diag>> {
        let mut sheet = Self::default();
        for text in texts {
            sheet.parse(text)?;
        }
        sheet.rules.sort_by_key(|rule| rule.specificity);
        Ok(sheet)
    }

    /// The declarations for an element, in the order of the cascade.
    pub(super) fn apply(
        &self,
        node: Node<'_, '_>,
        work: &mut Work,
        mut set: impl FnMut(&Declaration<'a>),
    ) -> Result<(), Box<Diag>> {
        for rule in &self.rules {
            if matches(&self.tokens[rule.tokens.clone()], node, work)? {
                self.declarations[rule.declarations.clone()].iter().for_each(&mut set);
            }
        }
        Ok(())
    }

    fn parse(&mut self, text: &'a str) -> Result<(), Box<Diag>> {
        let mut at = 0;
        loop {
            let is_at_rule = text[at..].trim_start().starts_with('@');
            let Some(end) = find(text, at, if is_at_rule { b"{;" } else { b"{" }) else { return Ok(()) };
            let prelude = &text[at..end];
            at = end + 1;
            if text.as_bytes()[end] == b'{' {
                let close = block_end(text, at);
                if !is_at_rule {
                    self.rule(prelude, &text[at..close])?;
                }
                at = (close + 1).min(text.len());
            }
        }
    }

    fn rule(&mut self, selectors: &'a str, block: &'a str) -> Result<(), Box<Diag>> {
        let first = self.declarations.len();
        for d in declarations(block).filter(|d| NAMES.contains(&d.name)) {
            let same = |o: &&mut Declaration<'_>| o.name == d.name && o.important == d.important;
            match self.declarations[first..].iter_mut().find(same) {
                Some(earlier) => *earlier = d,
                None => self.declarations.push(d),
            }
        }
        let declarations = first..self.declarations.len();
        if declarations.is_empty() {
            return Ok(());
        }
        let mut at = 0;
        while at <= selectors.len() {
            let end = find(selectors, at, b",").unwrap_or(selectors.len());
            self.selector(selectors[at..end].trim(), declarations.clone())?;
            at = end + 1;
        }
        Ok(())
    }

    fn selector(&mut self, text: &'a str, declarations: Range<usize>) -> Result<(), Box<Diag>> {
        let first = self.tokens.len();
        let mut specificity = [0; 3];
        for token in SelectorTokenizer::from(text) {
            match token {
                Ok(SelectorToken::IdSelector(_) | SelectorToken::AttributeSelector("id", _)) => specificity[0] += 1,
                Ok(SelectorToken::TypeSelector(_)) => specificity[2] += 1,
                Ok(
                    SelectorToken::UniversalSelector
                    | SelectorToken::DescendantCombinator
                    | SelectorToken::ChildCombinator
                    | SelectorToken::AdjacentCombinator,
                ) => {}
                Ok(SelectorToken::PseudoClass(name)) if !PSEUDO_CLASSES.contains(&name) => {
                    self.tokens.truncate(first);
                    return Ok(());
                }
                Ok(_) => specificity[1] += 1,
                Err(_) => {
                    self.tokens.truncate(first);
                    return Ok(());
                }
            }
            if self.tokens.len() == MAX_TOKENS {
                let text = format!("the selectors of the style sheet have more than {MAX_TOKENS} parts");
                return Err(Diag::input("svg-css", text).hint(HINT).into());
            }
            self.tokens.extend(token);
        }
        self.rules.push(Rule { tokens: first..self.tokens.len(), declarations, specificity });
        Ok(())
    }
}

/// The declarations of a block without comments; what is none is left out.
pub(super) fn declarations(block: &str) -> impl Iterator<Item = Declaration<'_>> {
    let mut at = 0;
    std::iter::from_fn(move || {
        let start = at;
        (start <= block.len()).then(|| {
            let end = find(block, start, b";").unwrap_or(block.len());
            at = end + 1;
            &block[start..end]
        })
    })
    .filter_map(|text| {
        let (name, value) = text.split_once(':')?;
        let (value, important) = match value.rsplit_once('!') {
            Some((value, word)) if word.trim() == "important" => (value, true),
            _ => (value, false),
        };
        Some(Declaration { name: name.trim(), value: value.trim(), important })
    })
}

/// Pseudo-classes that are known; all but the first apply to nothing in a drawing that is marked.
const PSEUDO_CLASSES: [&str; 6] = ["first-child", "link", "visited", "hover", "active", "focus"];

/// Whether a selector applies to an element.
///
/// A selector is a row of chains with descendant combinators between them; a chain holds child and adjacent
/// combinators only. From right to left each chain is put on the nearest ancestor on which it holds, and never
/// moved again. That finds a match wherever there is one: how many levels a chain climbs is fixed, and the
/// siblings it passes have the same ancestors, so a chain that holds nearer to the element ends at a place that
/// has all the ancestors of any other place where it holds. The cost is the depth times the length of the chains.
fn matches(tokens: &[SelectorToken<'_>], node: Node<'_, '_>, work: &mut Work) -> Result<bool, Box<Diag>> {
    let Some((mut top, mut rest)) = climb(tokens, node, work)? else { return Ok(false) };
    while !rest.is_empty() {
        let Some(ancestor) = top.parent_element() else { return Ok(false) };
        (top, rest) = climb(rest, ancestor, work)?.unwrap_or((ancestor, rest));
    }
    Ok(true)
}

/// Where the last chain of a selector ends that begins, from the right, at an element, and what stands before it;
/// None where it does not hold there.
fn climb<'a, 'i, 't>(
    tokens: &'t [SelectorToken<'t>],
    mut node: Node<'a, 'i>,
    work: &mut Work,
) -> Result<Option<Climbed<'a, 'i, 't>>, Box<Diag>> {
    for (i, token) in tokens.iter().enumerate().rev() {
        let mut has = |name: &str, operator: AttributeOperator<'_>| {
            let Some(value) = node.attribute(name) else { return Ok(false) };
            work.spend(value.len())?;
            Ok::<bool, Box<Diag>>(operator.matches(value))
        };
        let holds = match *token {
            SelectorToken::UniversalSelector => true,
            SelectorToken::TypeSelector(tag) => node.tag_name().name() == tag,
            SelectorToken::ClassSelector(class) => has("class", AttributeOperator::Contains(class))?,
            SelectorToken::IdSelector(id) => has("id", AttributeOperator::Matches(id))?,
            SelectorToken::AttributeSelector(name, operator) => has(name, operator)?,
            SelectorToken::PseudoClass(name) => name == "first-child" && sibling_before(node, work)?.is_none(),
            SelectorToken::LangPseudoClass(_) => false,
            SelectorToken::ChildCombinator | SelectorToken::AdjacentCombinator => {
                let next = match *token {
                    SelectorToken::ChildCombinator => node.parent_element(),
                    _ => sibling_before(node, work)?,
                };
                let Some(next) = next else { return Ok(None) };
                node = next;
                true
            }
            SelectorToken::DescendantCombinator => return Ok(Some((node, &tokens[..i]))),
        };
        work.spend(0)?;
        if !holds {
            return Ok(None);
        }
    }
    Ok(Some((node, &[])))
}

type Climbed<'a, 'i, 't> = (Node<'a, 'i>, &'t [SelectorToken<'t>]);

/// The element before an element, over text and comments.
fn sibling_before<'a, 'i>(mut node: Node<'a, 'i>, work: &mut Work) -> Result<Option<Node<'a, 'i>>, Box<Diag>> {
    while let Some(before) = node.prev_sibling() {
        work.spend(0)?;
        if before.is_element() {
            return Ok(Some(before));
        }
        node = before;
    }
    Ok(None)
}

/// A style sheet with every comment left out; one that does not end goes to the end of the text.
pub(super) fn without_comments(mut text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    while let Some(start) = find_comment(text) {
        out.push_str(&text[..start]);
        text = text[start + 2..].split_once("*/").map_or("", |(_, rest)| rest);
    }
    out.push_str(text);
    out
}

fn find_comment(text: &str) -> Option<usize> {
    let mut at = 0;
    loop {
        let slash = find(text, at, b"/")?;
        if text[slash..].starts_with("/*") {
            return Some(slash);
        }
        at = slash + 1;
    }
}

/// The first of some ASCII characters at or after a byte, outside of strings. A string ends at its quote or its line.
fn find(text: &str, from: usize, stops: &[u8]) -> Option<usize> {
    let (mut quote, mut escaped) = (None, false);
    for (i, &b) in text.as_bytes().iter().enumerate().skip(from) {
        if escaped {
            escaped = false;
            continue;
        }
        match (b, quote) {
            (b'\\', _) => escaped = true,
            (b'\n', Some(_)) => quote = None,
            (b, Some(q)) if b == q => quote = None,
            (b, None) if stops.contains(&b) => return Some(i),
            (b'"' | b'\'', None) => quote = Some(b),
            _ => {}
        }
    }
    None
}

/// Where a block ends whose content begins at a byte: at its brace, or at the end of the text.
fn block_end(text: &str, from: usize) -> usize {
    let (mut open, mut at) = (0, from);
    while let Some(brace) = find(text, at, b"{}") {
        match text.as_bytes()[brace] {
            b'{' => open += 1,
            _ if open == 0 => return brace,
            _ => open -= 1,
        }
        at = brace + 1;
    }
    text.len()
}

#[cfg(test)]
mod tests {
    use roxmltree::Document;

    use super::*;
    use crate::random::Random;

    /// As simplecss sees an element; its matcher tries every way, which is right and can take for ever.
    struct Element<'a, 'i>(Node<'a, 'i>);

    impl simplecss::Element for Element<'_, '_> {
        fn parent_element(&self) -> Option<Self> {
            self.0.parent_element().map(Element)
        }
        fn prev_sibling_element(&self) -> Option<Self> {
            self.0.prev_sibling_element().map(Element)
        }
        fn has_local_name(&self, name: &str) -> bool {
            self.0.tag_name().name() == name
        }
        fn attribute_matches(&self, name: &str, operator: AttributeOperator<'_>) -> bool {
            self.0.attribute(name).is_some_and(|v| operator.matches(v))
        }
        fn pseudo_class_matches(&self, class: simplecss::PseudoClass<'_>) -> bool {
            class == simplecss::PseudoClass::FirstChild && self.prev_sibling_element().is_none()
        }
    }

    fn count(css: &str, xml: &str) -> Result<(usize, usize), Box<Diag>> {
        let texts = [without_comments(css)];
        let sheet = Sheet::new(&texts)?;
        let doc = Document::parse(xml).expect("well-formed");
        let (mut work, mut met) = (Work::default(), 0);
        for node in doc.descendants().filter(Node::is_element) {
            sheet.apply(node, &mut work, |_| met += 1)?;
        }
        Ok((met, work.0))
    }

    fn nested(depth: usize) -> String {
        "<g>".repeat(depth) + "<rect/>" + &"</g>".repeat(depth)
    }

    #[test]
    fn descendant_selectors_cost_depth_times_length() {
        for n in [4, 12, 60, 200] {
            let css = format!("x {} rect{{fill:none}}", "g ".repeat(n));
            let (met, work) = count(&css, &nested(250)).expect("within the limit");
            assert_eq!(met, 0);
            // 250 groups that no rule ends at, and one climb of the rectangle with a step for each group and token.
            assert!(work <= 251 + 250 + 2 * n + 250, "{n}: {work}");
            let (met, _) = count(&format!("{} rect{{fill:none}}", "g ".repeat(n)), &nested(250)).expect("as above");
            assert_eq!(met, 1);
        }
    }

    #[test]
    fn long_selectors_and_comments_do_not_overflow_the_stack() {
        let chain = format!("{}rect{{fill:none}}", "g+".repeat(400_000));
        assert_eq!(count(&chain, &format!("<s>{}<rect/></s>", "<g/>".repeat(450_000))).expect("linear").0, 1);
        assert_eq!(count(&format!("rect{}{{fill:none}}", "/**/".repeat(400_000)), "<rect/>").expect("linear").0, 1);
        assert_eq!(count(&"@media x{".repeat(400_000), "<rect/>").expect("linear").0, 0);
        assert_eq!(count(&format!("rect{}{{fill:none}}", "[id]".repeat(400_000)), "<rect/>").expect("linear").0, 0);
    }

    #[test]
    fn work_and_parts_beyond_their_limits_are_refused() {
        let refused = |css: &str, xml: &str| count(css, xml).expect_err("refused").code;
        // Every element is compared with those before it.
        let chain = "g+".repeat(20_000) + "rect{fill:none}";
        let row = format!("<s>{}<rect/></s>", "<g/>".repeat(20_000));
        assert_eq!(count(&chain, &row).expect("one climb").0, 1);
        assert_eq!(refused(&format!("x+{}*{{fill:none}}", "*+".repeat(20_000)), &row), "svg-css");
        // Comments and text between elements are looked at as well.
        let sparse = format!("<s>{}<rect/></s>", "<!---->".repeat(20_000));
        assert_eq!(refused(&("g+rect,".repeat(20_000) + "g{fill:none}"), &sparse), "svg-css");
        assert_eq!(refused(&("a,".repeat(MAX_TOKENS) + "a{fill:none}"), "<g/>"), "svg-css");
    }

    #[test]
    fn style_sheets_are_parsed_by_the_css_rules() {
        let all = |block| declarations(block).map(|d| (d.name, d.value, d.important)).collect::<Vec<_>>();
        assert_eq!(
            all(" fill : red ! important ;;x;stroke:url(#a)"),
            [("fill", "red", true), ("stroke", "url(#a)", false)]
        );
        assert_eq!(all("font:'a;b:c';fill:none"), [("font", "'a;b:c'", false), ("fill", "none", false)]);
        for (css, met) in [
            ("rect{fill:none}", 1),
            ("rect{fill:none;fill:red;fill:blue}", 1),
            ("rect{fill:none;fill:red!important}", 2),
            ("rect{cursor:help}", 0),
            ("g,rect , .b{fill:none}", 2),
            ("g:not(.x),rect{fill:none}", 1),
            ("g:hover,:first-child{fill:none}", 2),
            ("@charset 'x;{';rect{fill:none}", 1),
            ("@media print{rect{fill:none} g{fill:none}}rect{fill:none}", 1),
            ("/* rect{ */g{fill:none}/*", 1),
            ("rect[id='a,{b']{fill:none}", 1),
            ("r/* */ect{fill:none}", 1),
            ("rect{fill:none", 1),
            ("}rect{fill:none}g{fill:none}", 1),
            ("g>rect{fill:none} g+rect{fill:none} g rect{fill:none} rect rect{fill:none}", 2),
        ] {
            assert_eq!(count(css, "<g><rect id='a,{b'/></g>").expect("small").0, met, "{css}");
        }
    }

    /// Where the exhaustive matcher says that a selector applies, this one says so, and nowhere else.
    #[test]
    fn selector_matching_equals_brute_force() {
        for seed in 0..256 {
            let mut noise = Random::case(seed);
            let (mut xml, mut open) = ("<s>".to_owned(), 0);
            for _ in 0..noise.between(1, 39) {
                let (tag, class, up) = (["a", "b", "c"][noise.below(3)], noise.below(3), noise.chance(50));
                xml += &format!("<{tag} class='c{class}'{}>", if up { "/" } else { "" });
                open += usize::from(!up);
                if up && open > 0 && class == 0 {
                    // Closed below, by its own tag: the tag of the last element that is open.
                    let tag = last_open(&xml);
                    xml += &format!("</{tag}>");
                    open -= 1;
                }
            }
            while open > 0 {
                let tag = last_open(&xml);
                xml += &format!("</{tag}>");
                open -= 1;
            }
            xml += "</s>";
            let mut css = String::new();
            for i in 0..noise.between(1, 6) {
                if i > 0 {
                    css += [" ", ">", "+"][noise.below(3)];
                }
                css += ["a", "b", "*", ".c1"][noise.below(4)];
            }
            let doc = Document::parse(&xml).expect("well-formed");
            let tokens: Vec<_> = SelectorTokenizer::from(&*css).map(|t| t.expect("a token")).collect();
            let slow = simplecss::Selector::parse(&css).expect("a selector");
            for node in doc.descendants().filter(Node::is_element) {
                let fast = matches(&tokens, node, &mut Work::default()).expect("little work");
                assert_eq!(fast, slow.matches(&Element(node)), "seed {seed}: {css} on {xml}");
            }
        }
    }

    /// The tag of the innermost element that is open at the end of a text.
    fn last_open(xml: &str) -> char {
        let mut open = Vec::new();
        for tag in xml.split('<').skip(1) {
            match tag.strip_prefix('/') {
                Some(_) => drop(open.pop()),
                None if tag.ends_with("/>") => {}
                None => open.extend(tag.chars().next()),
            }
        }
        open.pop().expect("something is open")
    }
}
