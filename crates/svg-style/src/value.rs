//! Numbers, lengths, angles and keywords, with the arithmetic of `calc()`.
//!
//! The tokenizer holds numbers in f32; they are read again from the text, in f64.

use std::cell::RefCell;
use std::f64::consts;

use cssparser::{ParseError, Parser, Token};

/// Why a value is not valid.
pub(crate) type Fault = ParseError<()>;

/// What a value stands in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Source {
    /// A style sheet.
    Css,
    /// A `style` attribute, where some lengths need no unit, as in browsers.
    Inline,
    /// An attribute of its own, where lengths need no unit (SVG 2, 6.6).
    Attribute,
}

/// How values are read, and what was met that browsers may understand though it is not understood here.
pub(crate) struct Reading {
    pub(crate) source: Source,
    unknown: RefCell<Option<String>>,
}

impl Reading {
    pub(crate) fn new(source: Source) -> Self {
        Self { source, unknown: RefCell::new(None) }
    }

    /// Notes what is not understood; the value is then neither valid nor known to be invalid.
    pub(crate) fn unknown(&self, what: impl Into<String>) -> Fault {
        self.unknown.borrow_mut().get_or_insert_with(|| what.into());
        Fault::unexpected_token()
    }

    pub(crate) fn take_unknown(&self) -> Option<String> {
        self.unknown.borrow_mut().take()
    }
}

/// A length: a sum of parts that are resolved at different times.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Length {
    /// CSS pixels.
    pub px: f64,
    /// Share of what the property refers to, 0.5 for 50 %.
    pub share: f64,
    /// Font sizes; 0 in a computed style.
    pub(crate) em: f64,
    /// Font sizes of the root; 0 in a computed style.
    pub(crate) rem: f64,
    /// It has a part in a unit whose size depends on the face of the font: ex and ch, taken as half of the font's size,
    /// or ic, taken as all of it.
    pub needs_font: bool,
    /// It is in mm, cm, Q, in, pt or pc.
    pub is_physical: bool,
}

impl Length {
    /// A length in CSS pixels.
    pub const fn px(px: f64) -> Self {
        Self { px, share: 0.0, em: 0.0, rem: 0.0, needs_font: false, is_physical: false }
    }

    /// A share of what it refers to.
    pub(crate) const fn share(share: f64) -> Self {
        Self { share, ..Self::px(0.0) }
    }

    /// The length in an attribute that is not a property, in a font of these sizes; a number is in px. None where the
    /// text is not a length.
    pub fn from_attribute(text: &str, font_px: f64, root_px: f64) -> Option<Self> {
        let reading = Reading::new(Source::Attribute);
        let mut length = Parser::new(text).parse_entirely(|css| length(&reading, css)).ok()?;
        length.compute(font_px, root_px);
        Some(length)
    }

    /// The length in px, where a share refers to `whole`, px.
    pub fn of(self, whole: f64) -> f64 {
        self.px + self.share * whole
    }

    pub(crate) fn compute(&mut self, font_px: f64, root_px: f64) {
        self.px += self.em * font_px + self.rem * root_px;
        (self.em, self.rem) = (0.0, 0.0);
    }

    fn scaled(self, by: f64) -> Self {
        Self { px: self.px * by, share: self.share * by, em: self.em * by, rem: self.rem * by, ..self }
    }

    fn plus(self, o: Self) -> Self {
        Self {
            px: self.px + o.px,
            share: self.share + o.share,
            em: self.em + o.em,
            rem: self.rem + o.rem,
            needs_font: self.needs_font || o.needs_font,
            is_physical: self.is_physical && o.is_physical,
        }
    }

    /// The only part that is not 0, by its place; None where there are several.
    fn only_part(self) -> Option<(usize, f64)> {
        let parts = [self.px, self.share, self.em, self.rem];
        let mut set = parts.into_iter().enumerate().filter(|(_, v)| *v != 0.0);
        let first = set.next().unwrap_or((0, 0.0));
        set.next().is_none().then_some(first)
    }
}

/// Kinds of quantities that can be compared; below these are the parts of lengths.
const NUMBER: usize = 10;
const ANGLE: usize = 11;

/// A number, length or angle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Quantity {
    Number(f64),
    /// Percentages are lengths.
    Length(Length),
    /// Degrees.
    Angle(f64),
}

impl Quantity {
    fn scaled(self, by: f64) -> Self {
        match self {
            Self::Number(v) => Self::Number(v * by),
            Self::Length(v) => Self::Length(v.scaled(by)),
            Self::Angle(v) => Self::Angle(v * by),
        }
    }

    fn plus(self, other: Self) -> Option<Self> {
        Some(match (self, other) {
            (Self::Number(a), Self::Number(b)) => Self::Number(a + b),
            (Self::Length(a), Self::Length(b)) => Self::Length(a.plus(b)),
            (Self::Angle(a), Self::Angle(b)) => Self::Angle(a + b),
            _ => return None,
        })
    }

    /// Kind and value; only those of one kind can be compared.
    fn comparable(self) -> Option<(usize, f64)> {
        match self {
            Self::Number(v) => Some((NUMBER, v)),
            Self::Angle(v) => Some((ANGLE, v)),
            Self::Length(v) => v.only_part(),
        }
    }
}

/// A number, length, percentage or angle, or a sum of `calc()`.
pub(crate) fn quantity(reading: &Reading, css: &mut Parser<'_>) -> Result<Quantity, Fault> {
    css.skip_whitespace();
    let start = css.position();
    let token = css.next()?.clone();
    let text = css.slice_from(start);
    match &token {
        Token::Number { value, .. } => finite(Quantity::Number(exact(text, "", *value))),
        Token::Percentage { unit_value, .. } => {
            finite(Quantity::Length(Length::share(exact(text, "%", unit_value * 100.0) / 100.0)))
        }
        Token::Dimension { value, unit, .. } => finite(dimension(reading, exact(text, unit, *value), unit)?),
        Token::Function(name) => {
            let name = name.to_ascii_lowercase();
            css.parse_nested_block(|css| function(reading, &name, css))
        }
        _ => Err(Fault::unexpected_token()),
    }
}

/// The number in a token with this text and unit. The parser has it in f32, as `value`, which is taken where the number
/// cannot be cut out of the text: a unit that is written with escapes is longer there.
fn exact(text: &str, unit: &str, value: f32) -> f64 {
    let digits = text.len().checked_sub(unit.len()).and_then(|n| text.get(..n)).unwrap_or_default();
    digits.parse::<f64>().ok().filter(|v| v.is_finite()).unwrap_or(f64::from(value))
}

fn finite(quantity: Quantity) -> Result<Quantity, Fault> {
    let is_finite = match quantity {
        Quantity::Number(v) | Quantity::Angle(v) => v.is_finite(),
        Quantity::Length(v) => [v.px, v.share, v.em, v.rem].iter().all(|v| v.is_finite()),
    };
    if is_finite { Ok(quantity) } else { Err(Fault::unexpected_token()) }
}

fn dimension(reading: &Reading, v: f64, unit: &str) -> Result<Quantity, Fault> {
    let px = |px: f64| Ok(Quantity::Length(Length { is_physical: !unit.eq_ignore_ascii_case("px"), ..Length::px(px) }));
    let font = |em: f64| Ok(Quantity::Length(Length { em, needs_font: true, ..Length::px(0.0) }));
    match unit.to_ascii_lowercase().as_str() {
        "px" => px(v),
        "mm" => px(v * (96.0 / 25.4)),
        "cm" => px(v * (96.0 / 2.54)),
        "q" => px(v * (96.0 / 101.6)),
        "in" => px(v * 96.0),
        "pt" => px(v * (96.0 / 72.0)),
        "pc" => px(v * 16.0),
        "em" => Ok(Quantity::Length(Length { em: v, ..Length::px(0.0) })),
        "rem" => Ok(Quantity::Length(Length { rem: v, ..Length::px(0.0) })),
        "ex" | "ch" => font(0.5 * v),
        "ic" => font(v),
        "deg" => Ok(Quantity::Angle(v)),
        "rad" => Ok(Quantity::Angle(v.to_degrees())),
        "grad" => Ok(Quantity::Angle(v * 0.9)),
        "turn" => Ok(Quantity::Angle(v * 360.0)),
        other if DEPENDENT_UNITS.contains(&other) => Err(reading.unknown(format!("the unit {other}"))),
        _ => Err(Fault::unexpected_token()),
    }
}

/// Units of a size that the drawing does not state: those of the window, of containers, of faces.
const DEPENDENT_UNITS: [&str; 36] = [
    "vw", "vh", "vi", "vb", "vmin", "vmax", "svw", "svh", "svi", "svb", "svmin", "svmax", "lvw", "lvh", "lvi", "lvb",
    "lvmin", "lvmax", "dvw", "dvh", "dvi", "dvb", "dvmin", "dvmax", "cqw", "cqh", "cqi", "cqb", "cqmin", "cqmax", "lh",
    "rlh", "cap", "rcap", "rex", "rch",
];

/// Functions of mathematics that are not evaluated.
const UNREAD_FUNCTIONS: [&str; 22] = [
    "round",
    "mod",
    "rem",
    "sin",
    "cos",
    "tan",
    "asin",
    "acos",
    "atan",
    "atan2",
    "pow",
    "sqrt",
    "hypot",
    "log",
    "exp",
    "abs",
    "sign",
    "env",
    "attr",
    "if",
    "calc-size",
    "sibling-index",
];

fn function(reading: &Reading, name: &str, css: &mut Parser<'_>) -> Result<Quantity, Fault> {
    match name {
        "calc" | "-webkit-calc" => sum(reading, css).and_then(finite),
        "min" | "max" | "clamp" => {
            let all = css.parse_comma_separated(|css| sum(reading, css))?;
            extreme(reading, name, &all).and_then(finite)
        }
        _ if UNREAD_FUNCTIONS.contains(&name) => Err(reading.unknown(format!("{name}()"))),
        _ => Err(Fault::unexpected_token()),
    }
}

/// The quantity that `min()`, `max()` or `clamp()` is, of those that it compares.
fn extreme(reading: &Reading, name: &str, all: &[Quantity]) -> Result<Quantity, Fault> {
    let Some(values) = comparable_values(all) else {
        return Err(reading.unknown(format!("{name}() of different units")));
    };
    let chosen = match (name, values.as_slice()) {
        ("min", values) => (0..values.len()).min_by(|&a, &b| values[a].total_cmp(&values[b])),
        ("max", values) => (0..values.len()).max_by(|&a, &b| values[a].total_cmp(&values[b])),
        // max(least, min(value, most)): the least wins over the most (CSS Values 4, 10.2).
        ("clamp", &[least, value, most]) if value < least || most < least => Some(0),
        ("clamp", &[_, value, most]) => Some(if value > most { 2 } else { 1 }),
        _ => None,
    };
    chosen.map(|i| all[i]).ok_or_else(Fault::unexpected_token)
}

/// The values of quantities of one kind, which alone can be compared.
fn comparable_values(all: &[Quantity]) -> Option<Vec<f64>> {
    let compared = all.iter().map(|q| q.comparable()).collect::<Option<Vec<(usize, f64)>>>()?;
    let kind = compared.iter().find(|(_, v)| *v != 0.0).or(compared.first()).map(|c| c.0);
    // A length of 0 has no unit of its own among lengths.
    let is_zero_length = |k: usize, v: f64| v == 0.0 && k < NUMBER && kind < Some(NUMBER);
    let is_alike = compared.iter().all(|&(k, v)| Some(k) == kind || is_zero_length(k, v));
    is_alike.then(|| compared.into_iter().map(|(_, v)| v).collect())
}

/// Terms with + and - between them; blanks stand around these (CSS Values 4, 10.8).
fn sum(reading: &Reading, css: &mut Parser<'_>) -> Result<Quantity, Fault> {
    let mut total = product(reading, css)?;
    loop {
        let before = css.state();
        let sign = match css.next_including_whitespace() {
            Ok(Token::WhiteSpace(_)) => css.next().ok().and_then(|token| match token {
                Token::Delim('+') => Some(1.0),
                Token::Delim('-') => Some(-1.0),
                _ => None,
            }),
            _ => None,
        };
        let Some(sign) = sign else {
            css.reset(&before);
            return Ok(total);
        };
        css.expect_whitespace()?;
        let term = product(reading, css)?.scaled(sign);
        total = total.plus(term).ok_or_else(Fault::unexpected_token)?;
    }
}

fn product(reading: &Reading, css: &mut Parser<'_>) -> Result<Quantity, Fault> {
    let mut value = term(reading, css)?;
    loop {
        let before = css.state();
        match css.next() {
            Ok(Token::Delim('*')) => {
                value = match (value, term(reading, css)?) {
                    (Quantity::Number(by), q) | (q, Quantity::Number(by)) => q.scaled(by),
                    _ => return Err(Fault::unexpected_token()),
                }
            }
            Ok(Token::Delim('/')) => {
                let Quantity::Number(by) = term(reading, css)? else { return Err(Fault::unexpected_token()) };
                value = value.scaled(1.0 / by);
            }
            _ => {
                css.reset(&before);
                return Ok(value);
            }
        }
    }
}

fn term(reading: &Reading, css: &mut Parser<'_>) -> Result<Quantity, Fault> {
    if css.try_parse(Parser::expect_parenthesis_block).is_ok() {
        return css.parse_nested_block(|css| sum(reading, css));
    }
    let constant = css.try_parse(|css| {
        Ok::<_, Fault>(match &*css.expect_ident()?.to_ascii_lowercase() {
            "e" => consts::E,
            "pi" => consts::PI,
            _ => return Err(Fault::unexpected_token()),
        })
    });
    constant.map(Quantity::Number).or_else(|_| quantity(reading, css))
}

/// A length or percentage; in attributes a number is in px, in style sheets 0 is (SVG 2 allows others in the
/// properties of strokes, see [`loose_length`]).
pub(crate) fn length(reading: &Reading, css: &mut Parser<'_>) -> Result<Length, Fault> {
    match quantity(reading, css)? {
        Quantity::Length(length) => Ok(length),
        Quantity::Number(px) if reading.source == Source::Attribute || px == 0.0 => Ok(Length::px(px)),
        _ => Err(Fault::unexpected_token()),
    }
}

/// A length or percentage for which a number counts as px in `style` attributes too.
pub(crate) fn inline_length(reading: &Reading, css: &mut Parser<'_>) -> Result<Length, Fault> {
    if reading.source == Source::Inline { loose_length(reading, css) } else { length(reading, css) }
}

/// A length or percentage for which a number counts as px everywhere.
pub(crate) fn loose_length(reading: &Reading, css: &mut Parser<'_>) -> Result<Length, Fault> {
    match quantity(reading, css)? {
        Quantity::Length(length) => Ok(length),
        Quantity::Number(px) => Ok(Length::px(px)),
        Quantity::Angle(_) => Err(Fault::unexpected_token()),
    }
}

/// Refuses what is known to be negative.
pub(crate) fn not_negative(length: Length) -> Result<Length, Fault> {
    match length.only_part() {
        Some((_, v)) if v < 0.0 => Err(Fault::unexpected_token()),
        _ => Ok(length),
    }
}

pub(crate) fn number(reading: &Reading, css: &mut Parser<'_>) -> Result<f64, Fault> {
    match quantity(reading, css)? {
        Quantity::Number(v) => Ok(v),
        _ => Err(Fault::unexpected_token()),
    }
}

/// A number, or a percentage as a share.
pub(crate) fn number_or_share(reading: &Reading, css: &mut Parser<'_>) -> Result<f64, Fault> {
    match quantity(reading, css)? {
        Quantity::Number(v) => Ok(v),
        Quantity::Length(Length { px: 0.0, em: 0.0, rem: 0.0, share, .. }) => Ok(share),
        _ => Err(Fault::unexpected_token()),
    }
}

/// An angle in degrees.
pub(crate) fn angle(reading: &Reading, css: &mut Parser<'_>) -> Result<f64, Fault> {
    match quantity(reading, css)? {
        Quantity::Angle(v) => Ok(v),
        Quantity::Number(0.0) => Ok(0.0),
        _ => Err(Fault::unexpected_token()),
    }
}

/// The value of one of some keywords, whatever their case.
pub(crate) fn keyword<T: Copy>(css: &mut Parser<'_>, keywords: &[(&str, T)]) -> Result<T, Fault> {
    let word = css.expect_ident()?;
    let keyword = keywords.iter().find(|(name, _)| word.eq_ignore_ascii_case(name));
    keyword.map(|(_, value)| *value).ok_or_else(Fault::unexpected_token)
}

/// Whether the keyword comes next; it is then read.
pub(crate) fn is_next(css: &mut Parser<'_>, word: &str) -> bool {
    css.try_parse(|css| css.expect_ident_matching(word)).is_ok()
}
