//! Conditions of style sheets: media queries and `@supports`.
//!
//! A drawing is seen on a screen, on white paper, by nobody who moves. What depends on the size of a window or on the
//! device is neither so nor otherwise.

use cssparser::{Parser, Token};

use super::declaration::{Support, supports};
use super::value::Fault;

/// Whether a condition holds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Holds {
    Yes,
    No,
    /// It depends on what is named.
    Unknown(String),
}

impl Holds {
    fn of(holds: bool) -> Self {
        if holds { Self::Yes } else { Self::No }
    }

    fn not(self) -> Self {
        match self {
            Self::Yes => Self::No,
            Self::No => Self::Yes,
            unknown => unknown,
        }
    }

    pub(crate) fn and(self, other: Self) -> Self {
        match (self, other) {
            (Self::No, _) | (_, Self::No) => Self::No,
            (Self::Yes, other) | (other, Self::Yes) => other,
            (unknown, _) => unknown,
        }
    }

    fn or(self, other: Self) -> Self {
        self.not().and(other.not()).not()
    }
}

/// Conditions with `not`, `and` and `or` between them, in brackets where they mix.
fn condition<'i>(
    css: &mut Parser<'i>,
    one: &mut dyn FnMut(&mut Parser<'i>) -> Result<Holds, Fault>,
) -> Result<Holds, Fault> {
    if css.try_parse(|css| css.expect_ident_matching("not")).is_ok() {
        return one(css).map(Holds::not);
    }
    let mut all = one(css)?;
    let is_or = css.try_parse(|css| css.expect_ident_matching("or")).is_ok();
    if is_or || css.try_parse(|css| css.expect_ident_matching("and")).is_ok() {
        let word = if is_or { "or" } else { "and" };
        loop {
            let next = one(css)?;
            all = if is_or { all.or(next) } else { all.and(next) };
            if css.try_parse(|css| css.expect_ident_matching(word)).is_err() {
                break;
            }
        }
    }
    Ok(all)
}

/// Whether one of a list of media queries holds; an empty list does. One that is not understood is as `not all`.
pub(crate) fn media(css: &mut Parser<'_>) -> Holds {
    if css.is_exhausted() {
        return Holds::Yes;
    }
    let mut any = Holds::No;
    let _ = css.parse_comma_separated(|css| {
        let one = css.parse_entirely(query);
        while css.next().is_ok() {}
        any = std::mem::replace(&mut any, Holds::No).or(one.unwrap_or(Holds::No));
        Ok::<_, Fault>(())
    });
    any
}

fn query(css: &mut Parser<'_>) -> Result<Holds, Fault> {
    let kind = css.try_parse(|css| {
        let is_not = css.try_parse(|css| css.expect_ident_matching("not")).is_ok();
        if !is_not {
            let _ = css.try_parse(|css| css.expect_ident_matching("only"));
        }
        let word = css.expect_ident()?.to_ascii_lowercase();
        if matches!(word.as_str(), "and" | "or" | "not" | "only" | "layer") {
            return Err(Fault::unexpected_token());
        }
        Ok::<_, Fault>((is_not, Holds::of(matches!(word.as_str(), "all" | "screen"))))
    });
    let Ok((is_not, kind)) = kind else { return condition(css, &mut in_media) };
    let mut all = kind;
    while css.try_parse(|css| css.expect_ident_matching("and")).is_ok() {
        let is_not = css.try_parse(|css| css.expect_ident_matching("not")).is_ok();
        let next = in_media(css)?;
        all = all.and(if is_not { next.not() } else { next });
    }
    Ok(if is_not { all.not() } else { all })
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
fn in_media(css: &mut Parser<'_>) -> Result<Holds, Fault> {
    if let Ok(name) = css.try_parse(|css| css.expect_function().cloned()) {
        css.parse_nested_block(all_tokens)?;
        return Ok(Holds::Unknown(format!("{name}() in a media query")));
    }
    css.expect_parenthesis_block()?;
    css.parse_nested_block(|css| {
        if let Ok(holds) = css.try_parse(|css| css.parse_entirely(|css| condition(css, &mut in_media))) {
            return Ok(holds);
        }
        let start = css.position();
        let name = css.try_parse(|css| css.expect_ident().cloned()).map(|name| name.to_ascii_lowercase());
        let known = name.ok().and_then(|name| FEATURES.iter().find(|(known, _)| *known == name));
        if let Some((_, value)) = known {
            if css.is_exhausted() {
                return Ok(Holds::of(!matches!(*value, "none" | "no-preference" | "0")));
            }
            if css.try_parse(Parser::expect_colon).is_ok() {
                let start = css.position();
                all_tokens(css)?;
                return Ok(Holds::of(css.slice_from(start).trim().eq_ignore_ascii_case(value)));
            }
        }
        all_tokens(css)?;
        Ok(Holds::Unknown(format!("the media feature ({})", css.slice_from(start).trim())))
    })
}

fn all_tokens(css: &mut Parser<'_>) -> Result<(), Fault> {
    while css.next().is_ok() {}
    Ok(())
}

/// Whether the condition of `@supports` holds in browsers.
pub(crate) fn supported(css: &mut Parser<'_>) -> Holds {
    let start = css.state();
    let holds =
        condition(css, &mut in_supports).and_then(|holds| css.expect_exhausted().map(|()| holds).map_err(Fault::from));
    holds.unwrap_or_else(|_| {
        css.reset(&start);
        while css.next().is_ok() {}
        Holds::No
    })
}

fn in_supports(css: &mut Parser<'_>) -> Result<Holds, Fault> {
    match css.next()?.clone() {
        Token::Function(name) => css.parse_nested_block(|css| {
            let start = css.position();
            all_tokens(css)?;
            let text = css.slice_from(start).trim();
            Ok(if name.eq_ignore_ascii_case("selector") {
                Holds::of(super::selector::is_selector(text))
            } else {
                Holds::Unknown(format!("{name}() in @supports"))
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
                return Ok(Holds::No);
            };
            let start = css.position();
            all_tokens(css)?;
            let text = css.slice_from(start).trim();
            Ok(match supports(&name, text) {
                Support::Yes => Holds::Yes,
                Support::No => Holds::No,
                Support::Unknown => Holds::Unknown(format!("@supports ({name}: {text})")),
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
            let known = if matches!(holds, Holds::Unknown(_)) { None } else { Some(holds == Holds::Yes) };
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
            let known = if matches!(holds, Holds::Unknown(_)) { None } else { Some(holds == Holds::Yes) };
            assert_eq!(known, want, "{text}: {holds:?}");
        }
    }
}
