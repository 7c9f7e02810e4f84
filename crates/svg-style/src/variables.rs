//! Custom properties, and what `var()` puts in their place.

use std::collections::BTreeMap;
use std::sync::Arc;

use cssparser::{Parser, Token};

use super::Excess;
use super::value::Fault;

/// Longest value once variables are put in, bytes.
const MAX_VALUE: usize = 100_000;

/// Most bytes that variables make in all elements of a drawing together.
const MAX_BYTES: usize = 50_000_000;

/// Deepest reference from variable to variable.
const MAX_DEPTH: usize = 64;

/// The custom properties of an element, without those that are not valid.
#[derive(Clone, Debug, Default)]
pub(crate) struct Variables(Arc<BTreeMap<Arc<str>, Arc<str>>>);

/// How many bytes of text variables have made so far, in all elements of a drawing.
#[derive(Debug, Default)]
pub(crate) struct SubstitutedBytes(usize);

impl SubstitutedBytes {
    /// Counts more of them.
    ///
    /// # Errors
    /// [`Excess::Variables`] beyond [`MAX_BYTES`].
    fn add(&mut self, bytes: usize) -> Result<(), Excess> {
        self.0 += bytes;
        if self.0 > MAX_BYTES { Err(Excess::Variables) } else { Ok(()) }
    }
}

impl Variables {
    /// With what an element declares; None takes a variable away.
    pub(crate) fn with(
        &self,
        declared: &BTreeMap<Arc<str>, Option<Arc<str>>>,
        bytes: &mut SubstitutedBytes,
    ) -> Result<Self, Excess> {
        if declared.is_empty() {
            return Ok(self.clone());
        }
        bytes.add(64 * (declared.len() + self.0.len()))?;
        let mut all = (*self.0).clone();
        // What the parent has under the same name is gone even where the own text turns out not to be valid.
        for name in declared.keys() {
            all.remove(name);
        }
        for (name, text) in declared {
            let Some(text) = text else { continue };
            // The variables that are being put in, from the outside in: one that is met again closes a circle.
            let mut open = vec![name.clone()];
            match expanded(text, &|name| self.lookup(declared, name), &mut open, bytes) {
                Ok(Some(text)) => _ = all.insert(name.clone(), text.into()),
                Ok(None) | Err(SubstitutionStop::Circle(_)) => {}
                Err(SubstitutionStop::Excess) => return Err(Excess::Variables),
            }
        }
        Ok(Self(Arc::new(all)))
    }

    /// The text of a variable as the element declares it, or as its parent has it.
    fn lookup(&self, declared: &BTreeMap<Arc<str>, Option<Arc<str>>>, name: &str) -> Option<Arc<str>> {
        match declared.get(name) {
            Some(own) => own.clone(),
            None => self.0.get(name).cloned(),
        }
    }

    /// A value with its variables put in; None where one is missing.
    pub(crate) fn substituted(&self, text: &str, bytes: &mut SubstitutedBytes) -> Result<Option<String>, Excess> {
        match expanded(text, &|name| self.0.get(name).cloned(), &mut Vec::new(), bytes) {
            Ok(text) => Ok(text),
            Err(SubstitutionStop::Circle(_)) => Ok(None),
            Err(SubstitutionStop::Excess) => Err(Excess::Variables),
        }
    }
}

/// Whether a value refers to variables.
pub(crate) fn has_variables(text: &str) -> bool {
    if !text.contains('\\') {
        return text.as_bytes().windows(4).any(|w| w.eq_ignore_ascii_case(b"var("));
    }
    // The name of the function may be escaped.
    let mut css = Parser::new(text);
    css.look_for_arbitrary_substitution_functions(&["var"]);
    while css.next().is_ok() {}
    css.seen_arbitrary_substitution_functions()
}

/// Why variables are not put in.
enum SubstitutionStop {
    /// The open variable of this place is in a circle, and with it all that were opened after it.
    Circle(usize),
    Excess,
}

type Lookup<'a> = &'a dyn Fn(&str) -> Option<Arc<str>>;

/// A text with its variables put in; None where one is missing, or refers to itself.
fn expanded(
    text: &str,
    lookup: Lookup<'_>,
    open: &mut Vec<Arc<str>>,
    bytes: &mut SubstitutedBytes,
) -> Result<Option<String>, SubstitutionStop> {
    bytes.add(text.len()).map_err(|_| SubstitutionStop::Excess)?;
    if !has_variables(text) {
        return Ok(Some(text.to_owned()));
    }
    if open.len() > MAX_DEPTH {
        return Err(SubstitutionStop::Excess);
    }
    let mut out = String::new();
    let mut stop = None;
    let result = Parser::new(text).parse_entirely(|css| {
        copy(css, &mut out, &mut |name, fallback| {
            let result = replacement(name, fallback, lookup, open, bytes);
            result.unwrap_or_else(|e| {
                stop = Some(e);
                None
            })
        })
    });
    match stop {
        Some(e) => Err(e),
        None if out.len() > MAX_VALUE => Err(SubstitutionStop::Excess),
        None => Ok(result.is_ok().then_some(out)),
    }
}

/// What stands for a variable: its value, or the fallback.
fn replacement(
    name: &str,
    fallback: Option<&str>,
    lookup: Lookup<'_>,
    open: &mut Vec<Arc<str>>,
    bytes: &mut SubstitutedBytes,
) -> Result<Option<String>, SubstitutionStop> {
    if let Some(place) = open.iter().position(|o| &**o == name) {
        // In a circle no fallback counts (CSS Variables 1, 2.3).
        return Err(SubstitutionStop::Circle(place));
    }
    if let Some(text) = lookup(name) {
        let own = open.len();
        open.push(name.into());
        let value = expanded(&text, lookup, open, bytes);
        open.pop();
        match value {
            Ok(Some(value)) => return Ok(Some(value)),
            Ok(None) => {}
            // Who refers to a member of the circle from outside has its fallback.
            Err(SubstitutionStop::Circle(place)) if place >= own => {}
            Err(stop) => return Err(stop),
        }
    }
    fallback.map_or(Ok(None), |text| expanded(text, lookup, open, bytes))
}

/// Copies tokens, with `var()` replaced; a fault where there is nothing to replace it by.
fn copy(
    css: &mut Parser<'_>,
    out: &mut String,
    replace: &mut dyn FnMut(&str, Option<&str>) -> Option<String>,
) -> Result<(), Fault> {
    loop {
        let start = css.position();
        let Ok(token) = css.next_including_whitespace_and_comments() else { return Ok(()) };
        let close = match token {
            Token::Function(name) if name.eq_ignore_ascii_case("var") => {
                let replacement = css.parse_nested_block(|css| {
                    let name = css.expect_ident()?.clone();
                    // Names of custom properties begin with two dashes.
                    if !name.starts_with("--") {
                        return Err(Fault::unexpected_token());
                    }
                    // All that follows the first comma, further ones among it; it may be empty.
                    let fallback = css.try_parse(Parser::expect_comma).is_ok().then(|| {
                        let start = css.position();
                        while css.next_including_whitespace_and_comments().is_ok() {}
                        css.slice_from(start)
                    });
                    css.expect_exhausted()?;
                    replace(&name, fallback).ok_or_else(Fault::unexpected_token)
                })?;
                // What is substituted does not join with its neighbours (CSS Variables 1, 3).
                out.push_str("/**/");
                out.push_str(&replacement);
                out.push_str("/**/");
                continue;
            }
            Token::Function(_) | Token::ParenthesisBlock => ")",
            Token::SquareBracketBlock => "]",
            Token::CurlyBracketBlock => "}",
            _ => {
                out.push_str(css.slice_from(start));
                // Whoever called sees the length and refuses it.
                if out.len() > MAX_VALUE {
                    return Ok(());
                }
                continue;
            }
        };
        out.push_str(css.slice_from(start));
        css.parse_nested_block(|css| copy(css, out, replace))?;
        out.push_str(close);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn substituted(declared: &[(&str, &str)], text: &str) -> Result<Option<String>, Excess> {
        let declared = declared.iter().map(|(n, v)| (Arc::from(*n), Some(Arc::from(*v)))).collect();
        let mut bytes = SubstitutedBytes::default();
        let variables = Variables::default().with(&declared, &mut bytes)?;
        Ok(variables.substituted(text, &mut bytes)?.map(|text| text.replace("/**/", "")))
    }

    #[test]
    fn variables_are_put_in_with_their_fallbacks() {
        let all = [("--a", "red"), ("--b", "var(--a)"), ("--c", "var(--c)"), ("--d", "var(--x, rgb(1 2 3))")];
        for (text, want) in [
            ("var(--a)", Some("red")),
            ("var(--b)", Some("red")),
            ("f(1, var(--b) 2)", Some("f(1, red 2)")),
            ("var(--c)", None),
            ("var(--c, blue)", Some(" blue")),
            ("var(--d)", Some(" rgb(1 2 3)")),
            ("var(--x)", None),
            ("var(--x, var(--a))", Some(" red")),
            ("var(--a,)", Some("red")),
            ("var(--x,)", Some("")),
            ("var(a)", None),
        ] {
            assert_eq!(substituted(&all, text).expect("small").as_deref(), want, "{text}");
        }
    }

    #[test]
    fn variables_that_double_are_refused() {
        let names: Vec<(String, String)> =
            (0..60).map(|i| (format!("--v{}", i + 1), format!("var(--v{i}) var(--v{i})"))).collect();
        let mut all: Vec<(&str, &str)> = names.iter().map(|(n, v)| (n.as_str(), v.as_str())).collect();
        all.push(("--v0", "lol"));
        assert_eq!(substituted(&all, "var(--v60)").expect_err("refused"), Excess::Variables);
    }
}
