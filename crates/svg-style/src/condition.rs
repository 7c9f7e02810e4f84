//! Conditions of style sheets: media queries and `@supports`.
//!
//! A drawing is seen on a screen, on white paper, by nobody who moves. What depends on the size of a window or on the
//! device is neither so nor otherwise.

use cssparser::{Parser, Token};

use super::declaration::{Support, supports};
use super::value::Fault;

/// Whether a condition holds, by a logic of three values (Kleene): what is unknown stays so unless the rest decides.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Truth {
    True,
    False,
    /// It depends on what is named.
    Unknown(String),
}

impl From<bool> for Truth {
    fn from(holds: bool) -> Self {
        if holds { Self::True } else { Self::False }
    }
}

impl Truth {
    fn not(self) -> Self {
        match self {
            Self::True => Self::False,
            Self::False => Self::True,
            unknown => unknown,
        }
    }

    pub(crate) fn and(self, other: Self) -> Self {
        match (self, other) {
            (Self::False, _) | (_, Self::False) => Self::False,
            (Self::True, other) | (other, Self::True) => other,
            (unknown, _) => unknown,
        }
    }

    fn or(self, other: Self) -> Self {
        self.not().and(other.not()).not()
    }
}

/// Conditions with `not`, `and` and `or` between them, in brackets where they mix; `operand` reads what stands between
/// these words.
fn condition<'i>(
    css: &mut Parser<'i>,
    operand: &mut dyn FnMut(&mut Parser<'i>) -> Result<Truth, Fault>,
) -> Result<Truth, Fault> {
    if css.try_parse(|css| css.expect_ident_matching("not")).is_ok() {
        return operand(css).map(Truth::not);
    }
    let mut truth = operand(css)?;
    let is_or = css.try_parse(|css| css.expect_ident_matching("or")).is_ok();
    if is_or || css.try_parse(|css| css.expect_ident_matching("and")).is_ok() {
        let word = if is_or { "or" } else { "and" };
        loop {
            let next = operand(css)?;
            truth = if is_or { truth.or(next) } else { truth.and(next) };
            if css.try_parse(|css| css.expect_ident_matching(word)).is_err() {
                break;
            }
        }
    }
    Ok(truth)
}

/// Whether one of a list of media queries holds; an empty list does. One that is not understood is as `not all`.
pub(crate) fn media(css: &mut Parser<'_>) -> Truth {
    if css.is_exhausted() {
        return Truth::True;
    }
    let mut truth = Truth::False;
    let _ = css.parse_comma_separated(|css| {
        let query = css.parse_entirely(query);
        while css.next().is_ok() {}
        truth = std::mem::replace(&mut truth, Truth::False).or(query.unwrap_or(Truth::False));
        Ok::<_, Fault>(())
    });
    truth
}

fn query(css: &mut Parser<'_>) -> Result<Truth, Fault> {
    let kind = css.try_parse(|css| {
        let is_not = css.try_parse(|css| css.expect_ident_matching("not")).is_ok();
        if !is_not {
            let _ = css.try_parse(|css| css.expect_ident_matching("only"));
        }
        let word = css.expect_ident()?.to_ascii_lowercase();
        if matches!(word.as_str(), "and" | "or" | "not" | "only" | "layer") {
            return Err(Fault::unexpected_token());
        }
        Ok::<_, Fault>((is_not, Truth::from(matches!(word.as_str(), "all" | "screen"))))
    });
    let Ok((is_not, kind)) = kind else { return condition(css, &mut in_media) };
    let mut truth = kind;
    while css.try_parse(|css| css.expect_ident_matching("and")).is_ok() {
        let is_not = css.try_parse(|css| css.expect_ident_matching("not")).is_ok();
        let next = in_media(css)?;
        truth = truth.and(if is_not { next.not() } else { next });
    }
    Ok(if is_not { truth.not() } else { truth })
}

/// Features of media that follow from what a drawing is seen on, and by which value.
const FEATURES: [(&str, &str); 9] = [
    ("prefers-color-scheme", "light"),
    ("prefers-reduced-motion", "no-preference"),
    ("prefers-reduced-transparency", "no-preference"),
    ("prefers-contrast", "no-preference"),
    ("forced-colors", "none"),
    ("inverted-colors", "none"),
    ("scripting", "none"),
    ("grid", "0"),
    ("monochrome", "0"),
];

/// A feature or a condition in brackets.
fn in_media(css: &mut Parser<'_>) -> Result<Truth, Fault> {
    if let Ok(name) = css.try_parse(|css| css.expect_function().cloned()) {
        css.parse_nested_block(all_tokens)?;
        return Ok(Truth::Unknown(format!("{name}() in a media query")));
    }
    css.expect_parenthesis_block()?;
    css.parse_nested_block(|css| {
        if let Ok(holds) = css.try_parse(|css| css.parse_entirely(|css| condition(css, &mut in_media))) {
            return Ok(holds);
        }
        let start = css.position();
        let name = css.try_parse(|css| css.expect_ident().cloned()).map(|name| name.to_ascii_lowercase());
        let feature = name.ok().and_then(|name| FEATURES.iter().find(|(known, _)| *known == name));
        if let Some((_, value)) = feature {
            if css.is_exhausted() {
                // A feature without a value holds unless its own means nothing (Media Queries 4, 2.4.2).
                return Ok(Truth::from(!matches!(*value, "none" | "no-preference" | "0")));
            }
            if css.try_parse(Parser::expect_colon).is_ok() {
                let start = css.position();
                all_tokens(css)?;
                return Ok(Truth::from(css.slice_from(start).trim().eq_ignore_ascii_case(value)));
            }
        }
        all_tokens(css)?;
        Ok(Truth::Unknown(format!("the media feature ({})", css.slice_from(start).trim())))
    })
}

fn all_tokens(css: &mut Parser<'_>) -> Result<(), Fault> {
    while css.next().is_ok() {}
    Ok(())
}

/// Whether the condition of `@supports` holds in browsers.
pub(crate) fn supported(css: &mut Parser<'_>) -> Truth {
    let start = css.state();
    let truth =
        condition(css, &mut in_supports).and_then(|truth| css.expect_exhausted().map(|()| truth).map_err(Fault::from));
    // A condition that is not valid does not hold.
    truth.unwrap_or_else(|_| {
        css.reset(&start);
        while css.next().is_ok() {}
        Truth::False
    })
}

fn in_supports(css: &mut Parser<'_>) -> Result<Truth, Fault> {
    match css.next()?.clone() {
        Token::Function(name) => css.parse_nested_block(|css| {
            let start = css.position();
            all_tokens(css)?;
            let text = css.slice_from(start).trim();
            Ok(if name.eq_ignore_ascii_case("selector") {
                Truth::from(super::selector::is_selector(text))
            } else {
                Truth::Unknown(format!("{name}() in @supports"))
            })
        }),
        Token::ParenthesisBlock => css.parse_nested_block(|css| {
            if let Ok(holds) = css.try_parse(|css| css.parse_entirely(|css| condition(css, &mut in_supports))) {
                return Ok(holds);
            }
            let name = css.try_parse(|css| {
                let name = css.expect_ident()?.to_ascii_lowercase();
                css.expect_colon()?;
                Ok::<_, Fault>(name)
            });
            let Ok(name) = name else {
                // Something that no browser knows.
                all_tokens(css)?;
                return Ok(Truth::False);
            };
            let start = css.position();
            all_tokens(css)?;
            let text = css.slice_from(start).trim();
            Ok(match supports(&name, text) {
                Support::Yes => Truth::True,
                Support::No => Truth::False,
                Support::Unknown => Truth::Unknown(format!("@supports ({name}: {text})")),
            })
        }),
        _ => Err(Fault::unexpected_token()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn media_queries_hold_for_a_light_screen() {
        for (text, want) in [
            ("", Some(true)),
            ("all", Some(true)),
            ("Screen", Some(true)),
            ("print", Some(false)),
            ("print, screen", Some(true)),
            ("not print", Some(true)),
            ("only screen and (prefers-color-scheme: light)", Some(true)),
            ("(prefers-color-scheme: dark)", Some(false)),
            ("(prefers-color-scheme)", Some(true)),
            ("not (prefers-color-scheme: dark)", Some(true)),
            ("(prefers-reduced-motion)", Some(false)),
            ("print and (min-width: 10px)", Some(false)),
            ("screen and (min-width: 10px)", None),
            ("(min-width: 10px) or (prefers-contrast: no-preference)", Some(true)),
            ("all, (min-width: 10px)", Some(true)),
            ("&nonsense", Some(false)),
            ("(400px < width)", None),
        ] {
            let holds = media(&mut Parser::new(text));
            let known = if matches!(holds, Truth::Unknown(_)) { None } else { Some(holds == Truth::True) };
            assert_eq!(known, want, "{text}: {holds:?}");
        }
    }

    #[test]
    fn supports_asks_the_grammar_of_properties() {
        for (text, want) in [
            ("(fill: red)", Some(true)),
            ("(fill: bogus)", Some(false)),
            ("not (fill: bogus)", Some(true)),
            ("(fill: red) and (stroke: oklch(0.5 0.1 20))", Some(true)),
            ("(fill: bogus) or (display: grid)", Some(true)),
            ("((fill: red))", Some(true)),
            ("selector(:has(> g))", Some(true)),
            ("selector(:bogus)", Some(false)),
            ("(--x: 1)", Some(true)),
            ("(hyphens: auto)", None),
            ("fill: red", Some(false)),
        ] {
            let holds = supported(&mut Parser::new(text));
            let known = if matches!(holds, Truth::Unknown(_)) { None } else { Some(holds == Truth::True) };
            assert_eq!(known, want, "{text}: {holds:?}");
        }
    }
}
