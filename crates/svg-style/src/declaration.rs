//! Declarations: names and values, judged before the cascade. One that is not valid is as if it had not been written
//! (CSS 2.1, 4.2), so an earlier one that is valid stays.

use std::sync::Arc;

use cssparser::{Parser, Token, parse_important};

use super::property::{LASTING, NOTHING, Other, Property, Value, other, size_in_font};
use super::value::{Fault, Reading, Source};
use super::variables::has_variables;
use super::{Remark, Weight};

/// A value that is the same for all properties (CSS Cascade 5, 7).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum WideKeyword {
    Inherit,
    Initial,
    Unset,
    /// As the browser has it.
    Revert,
    /// As the layer below has it.
    RevertLayer,
}

/// The value of a declaration.
#[derive(Clone, Debug)]
pub(crate) enum DeclaredValue {
    /// One that is valid for its property.
    Valid(Value),
    Wide(WideKeyword),
    /// One that follows once the variables in it are known.
    Pending(Arc<PendingValue>),
}

/// A declaration with variables as it is written.
#[derive(Debug)]
pub(crate) struct PendingValue {
    /// The property or the shorthand, in lower case.
    pub(crate) name: String,
    pub(crate) text: String,
}

#[derive(Clone, Debug)]
pub(crate) struct Declaration {
    pub(crate) property: Property,
    pub(crate) value: DeclaredValue,
    pub(crate) is_important: bool,
}

/// Properties that stand for several.
const SHORTHANDS: [(&str, &[Property]); 3] = [
    ("marker", &[Property::MarkerStart, Property::MarkerMid, Property::MarkerEnd]),
    ("font", &[Property::FontSize]),
    ("background", &[Property::Background]),
];

/// Reads a declaration whose name is in lower case; says what of it is not read.
pub(crate) fn declare(
    name: &str,
    text: &str,
    is_important: bool,
    source: Source,
    out: &mut Vec<Declaration>,
) -> Option<Remark> {
    let text = text.trim();
    let declaration = |property: Property, value: DeclaredValue| Declaration { property, value, is_important };
    let longhand = Property::of(name).map(|p| [p]);
    let shorthand = SHORTHANDS.iter().find(|(n, _)| *n == name && source != Source::Attribute).map(|(_, all)| *all);
    let properties: &[Property] = match (&longhand, shorthand) {
        (_, Some(longhands)) => longhands,
        (Some(longhand), None) => longhand,
        (None, None) if name == "all" => Property::ALL,
        (None, None) => return other_remark(name, text),
    };
    if let Some(keyword) = wide_keyword(text) {
        out.extend(properties.iter().map(|&p| declaration(p, DeclaredValue::Wide(keyword))));
        return None;
    }
    // `all` takes keywords alone (CSS Cascade 5, 3.2).
    if name == "all" {
        return Some(Remark::new(Weight::Ignored, name, text));
    }
    if has_variables(text) {
        let pending = Arc::new(PendingValue { name: name.to_owned(), text: text.to_owned() });
        out.extend(properties.iter().map(|&p| declaration(p, DeclaredValue::Pending(Arc::clone(&pending)))));
        return None;
    }
    let reading = Reading::new(source);
    match value_of(name, text, properties[0], &reading) {
        Ok(Some(value)) => {
            out.extend(properties.iter().map(|&p| declaration(p, DeclaredValue::Valid(value_for(&value, p)))));
            None
        }
        Ok(None) => None,
        Err(_) => Some(match reading.take_unknown() {
            Some(what) => Remark::new(Weight::Unknown(what), name, text),
            None => Remark::new(Weight::Ignored, name, text),
        }),
    }
}

/// The value of a shorthand for one of its properties: `marker` is read as `marker-start`, and is that of the others.
fn value_for(value: &Value, property: Property) -> Value {
    match (value, property) {
        (Value::MarkerStart(reference), Property::MarkerMid) => Value::MarkerMid(reference.clone()),
        (Value::MarkerStart(reference), Property::MarkerEnd) => Value::MarkerEnd(reference.clone()),
        (value, _) => value.clone(),
    }
}

/// The value of the first of the properties; None where the text says nothing of it.
fn value_of(name: &str, text: &str, property: Property, reading: &Reading) -> Result<Option<Value>, Fault> {
    let mut css = Parser::new(text);
    match name {
        "font" => match size_in_font(reading, &mut css) {
            // Without a family it is not valid.
            Some(_) if css.is_exhausted() => Err(Fault::unexpected_token()),
            size => Ok(size.map(Value::FontSize)),
        },
        _ => property.parse(reading, &mut css).map(Some),
    }
}

fn wide_keyword(text: &str) -> Option<WideKeyword> {
    let words = [
        ("inherit", WideKeyword::Inherit),
        ("initial", WideKeyword::Initial),
        ("unset", WideKeyword::Unset),
        ("revert", WideKeyword::Revert),
        ("revert-layer", WideKeyword::RevertLayer),
    ];
    words.iter().find(|(word, _)| text.eq_ignore_ascii_case(word)).map(|(_, keyword)| *keyword)
}

/// What is said of a property that is not read.
fn other_remark(name: &str, text: &str) -> Option<Remark> {
    match other(name) {
        Other::Harmless => None,
        Other::Visible => {
            let is_any = |word: &str, of: &[&str]| of.iter().any(|n| word.eq_ignore_ascii_case(n));
            let mut words = text.split([' ', ',']).filter(|word| !word.is_empty());
            let is_nothing = match name.starts_with("animation") {
                // What is left when it has ended is what the other properties say.
                true => !words.any(|word| is_any(word, LASTING)),
                false => words.all(|word| is_any(word, NOTHING)),
            };
            (!is_nothing).then(|| Remark::new(Weight::Unknown(format!("the property {name}")), name, text))
        }
        Other::Unheard => Some(Remark::new(Weight::Ignored, name, text)),
    }
}

/// Whether a declaration is valid in browsers.
pub(crate) enum Support {
    Yes,
    No,
    Unknown,
}

/// Whether browsers support a declaration.
pub(crate) fn supports(name: &str, text: &str) -> Support {
    let (text, _) = without_important(text);
    if name.starts_with("--") {
        return Support::Yes;
    }
    if Property::of(name).is_none() {
        return if matches!(other(name), Other::Unheard) { Support::No } else { Support::Unknown };
    }
    let mut out = Vec::new();
    match declare(name, text, false, Source::Css, &mut out) {
        None => Support::Yes,
        Some(Remark { weight: Weight::Unknown(_), .. }) => Support::Unknown,
        Some(_) => Support::No,
    }
}

/// A value without its `!important`, and whether it had one.
pub(crate) fn without_important(text: &str) -> (&str, bool) {
    if !text.contains('!') {
        return (text, false);
    }
    let mut css = Parser::new(text);
    let start = css.position();
    loop {
        let end = css.position();
        let before = css.state();
        match css.next_including_whitespace_and_comments() {
            Err(_) => return (text, false),
            Ok(Token::Delim('!')) => {
                css.reset(&before);
                if css.try_parse(parse_important).is_ok() && css.is_exhausted() {
                    return (css.slice(start..end).trim_end(), true);
                }
                let _ = css.next();
            }
            Ok(_) => {}
        }
    }
}

/// The text up to where the parser ends; a fault where it holds a block in braces or something broken.
pub(crate) fn raw<'i>(css: &mut Parser<'i>, may_hold_blocks: bool) -> Result<&'i str, Fault> {
    css.skip_whitespace();
    let start = css.position();
    while let Ok(token) = css.next_including_whitespace_and_comments() {
        let is_broken = match token {
            Token::CurlyBracketBlock => !may_hold_blocks,
            Token::BadString(_) | Token::BadUrl(_) => true,
            Token::CloseParenthesis | Token::CloseSquareBracket | Token::CloseCurlyBracket => true,
            _ => false,
        };
        if is_broken {
            return Err(Fault::unexpected_token());
        }
    }
    Ok(css.slice_from(start).trim())
}
