//! Colours of CSS Color 4 and 5, resolved to sRGB.

use std::sync::Arc;

use color::{AlphaColor, ColorSpaceTag, DynamicColor, Flags, HueDirection, Missing, Srgb};
use cssparser::color::PredefinedColorSpace;
use cssparser::{Parser, Token, match_ignore_ascii_case};
use cssparser_color::{AngleOrNumber, ColorParser, FromParsedColor, NumberOrPercentage, parse_color_with};

use super::value::{Fault, Length, Quantity, Reading, number_or_share, quantity};

/// A colour, which may refer to that of the property `color`.
#[derive(Clone, Debug, PartialEq)]
pub enum Colour {
    /// One that is known.
    Known(Rgba),
    /// That of the property `color`.
    Current,
    /// A mixture of colours, one of which refers to it.
    Mix(Arc<Mix>),
}

/// A colour in sRGB, and its opacity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rgba {
    /// Red, green, blue, 0 to 255.
    pub rgb: [u8; 3],
    /// Opacity, 0 to 1.
    pub alpha: f32,
}

impl Rgba {
    /// Opaque black.
    pub const BLACK: Self = Self { rgb: [0; 3], alpha: 1.0 };
}

/// `color-mix()` of two colours.
#[derive(Clone, Debug)]
pub struct Mix {
    space: ColorSpaceTag,
    hue: HueDirection,
    colours: [Unresolved; 2],
    /// Share of the second, 0 to 1.
    second: f32,
    /// Factor of the opacity, 1 unless the shares sum up to less than 100 %.
    alpha: f32,
}

impl PartialEq for Mix {
    fn eq(&self, other: &Self) -> bool {
        self.colours == other.colours
            && (self.space, self.hue) == (other.space, other.hue)
            && (self.second, self.alpha) == (other.second, other.alpha)
    }
}

/// A colour as it is parsed, with what it says of its space.
#[derive(Clone, Debug)]
enum Unresolved {
    Known(DynamicColor),
    Current,
    Mix(Arc<Mix>),
}

impl PartialEq for Unresolved {
    fn eq(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Known(a), Self::Known(b)) => a.cs == b.cs && a.components == b.components,
            (Self::Current, Self::Current) => true,
            (Self::Mix(a), Self::Mix(b)) => a == b,
            _ => false,
        }
    }
}

impl Colour {
    /// Black.
    pub const BLACK: Self = Self::Known(Rgba::BLACK);

    /// The colour where the property `color` is `current`; what lies beyond sRGB is cut off.
    pub fn resolved(&self, current: Rgba) -> Rgba {
        match self {
            Self::Known(known) => *known,
            Self::Current => current,
            Self::Mix(mix) => srgb(mix.resolved(current)),
        }
    }

    fn new(colour: Unresolved) -> Self {
        match colour {
            Unresolved::Known(known) => Self::Known(srgb(known)),
            Unresolved::Current => Self::Current,
            Unresolved::Mix(mix) if mix.is_known() => Self::Known(srgb(mix.resolved(Rgba::BLACK))),
            Unresolved::Mix(mix) => Self::Mix(mix),
        }
    }
}

/// What browsers show: components beyond sRGB are cut off (CSS Color 4, 13.2, leaves the mapping to the display).
fn srgb(colour: DynamicColor) -> Rgba {
    let AlphaColor { components: [r, g, b, alpha], .. } = colour.to_alpha_color::<Srgb>();
    let byte = |v: f32| (v.clamp(0.0, 1.0) * 255.0).round() as u8;
    Rgba { rgb: [byte(r), byte(g), byte(b)], alpha: alpha.clamp(0.0, 1.0) }
}

impl Unresolved {
    fn resolved(&self, current: Rgba) -> DynamicColor {
        match self {
            Self::Known(known) => *known,
            Self::Current => {
                let [r, g, b] = current.rgb.map(|v| f32::from(v) / 255.0);
                DynamicColor::from_alpha_color(AlphaColor::<Srgb>::new([r, g, b, current.alpha]))
            }
            Self::Mix(mix) => mix.resolved(current),
        }
    }

    fn is_known(&self) -> bool {
        match self {
            Self::Known(_) => true,
            Self::Current => false,
            Self::Mix(mix) => mix.is_known(),
        }
    }
}

impl Mix {
    fn is_known(&self) -> bool {
        self.colours.iter().all(Unresolved::is_known)
    }

    fn resolved(&self, current: Rgba) -> DynamicColor {
        let [first, second] = self.colours.each_ref().map(|c| c.resolved(current));
        let mut mixed = first.interpolate(second, self.space, self.hue).eval(self.second);
        mixed.components[3] *= self.alpha;
        mixed
    }
}

/// A colour of a declaration.
pub(crate) fn colour(reading: &Reading, css: &mut Parser<'_>) -> Result<Colour, Fault> {
    unresolved(reading, css).map(Colour::new)
}

/// A colour as it is written: `color-mix()`, `light-dark()` and system colours are read here, all others by
/// `cssparser_color`.
fn unresolved(reading: &Reading, css: &mut Parser<'_>) -> Result<Unresolved, Fault> {
    let before = css.state();
    let (name, is_function) = match css.next()? {
        Token::Function(name) => (name.to_ascii_lowercase(), true),
        Token::Ident(name) => (name.to_ascii_lowercase(), false),
        // Such as `#fff`.
        _ => (String::new(), false),
    };
    match (name.as_str(), is_function) {
        ("color-mix", true) => return css.parse_nested_block(|css| mix(reading, css)),
        // The first of the two, for light pages, as paper is; the second must be a colour all the same.
        ("light-dark", true) => {
            return css.parse_nested_block(|css| {
                let light = unresolved(reading, css)?;
                css.expect_comma()?;
                unresolved(reading, css).map(|_| light)
            });
        }
        (name @ ("contrast-color" | "alpha" | "color-contrast"), true) => {
            return Err(reading.unknown(format!("{name}()")));
        }
        (name, false) => {
            // The one system colour that is not opaque.
            if name == "highlight" {
                return Ok(Parsed::from_rgba(0, 65, 198, 0.8).0);
            }
            if let Some((_, [r, g, b])) = SYSTEM.iter().find(|(system, _)| *system == name) {
                return Ok(Parsed::from_rgba(*r, *g, *b, 1.0).0);
            }
        }
        _ => {}
    }
    css.reset(&before);
    let is_legacy = has_commas(css);
    let parsed = css.try_parse(|css| parse_color_with(&Components { reading, is_legacy }, css));
    if parsed.is_err() && is_function && is_relative(css) {
        return Err(reading.unknown("a colour relative to another (from)"));
    }
    parsed.map(|Parsed(colour)| colour)
}

/// Whether the arguments of a function that comes next are parted by commas, where percentages need their sign.
fn has_commas(css: &mut Parser<'_>) -> bool {
    let before = css.state();
    let mut has_comma = false;
    if css.expect_function().is_ok() {
        let _ = css.parse_nested_block(|css| {
            while let Ok(token) = css.next() {
                has_comma |= *token == Token::Comma;
            }
            Ok::<_, Fault>(())
        });
    }
    css.reset(&before);
    has_comma
}

/// Whether a colour function takes its components from another colour (CSS Color 5).
fn is_relative(css: &mut Parser<'_>) -> bool {
    let begins_with_from = |css: &mut Parser<'_>| {
        css.expect_ident_matching("from")?;
        while css.next().is_ok() {}
        Ok::<_, Fault>(())
    };
    css.expect_function().is_ok() && css.parse_nested_block(begins_with_from).is_ok()
}

fn mix(reading: &Reading, css: &mut Parser<'_>) -> Result<Unresolved, Fault> {
    let mut space = ColorSpaceTag::Oklab;
    let mut hue = HueDirection::Shorter;
    if css.try_parse(|css| css.expect_ident_matching("in")).is_ok() {
        let name = css.expect_ident()?.clone();
        space = space_of(&name).ok_or_else(|| reading.unknown(format!("color-mix() in {name}")))?;
        let way = css.try_parse(|css| {
            let way = css.expect_ident()?.to_ascii_lowercase();
            css.expect_ident_matching("hue")?;
            Ok::<_, Fault>(match way.as_str() {
                "shorter" => HueDirection::Shorter,
                "longer" => HueDirection::Longer,
                "increasing" => HueDirection::Increasing,
                "decreasing" => HueDirection::Decreasing,
                _ => return Err(Fault::unexpected_token()),
            })
        });
        // Only spaces with a hue take a direction of it (CSS Color 4, 12.4).
        hue = match way {
            Ok(_) if !has_hue(space) => return Err(Fault::unexpected_token()),
            way => way.unwrap_or(hue),
        };
        css.expect_comma()?;
    }
    let first = mix_part(reading, css)?;
    css.expect_comma()?;
    let second = mix_part(reading, css)?;
    // CSS Color 5, 3.1.
    let [a, b] = match [first.share, second.share] {
        [None, None] => [0.5, 0.5],
        [Some(a), None] => [a, 1.0 - a],
        [None, Some(b)] => [1.0 - b, b],
        [Some(a), Some(b)] => [a, b],
    };
    if a + b <= 0.0 {
        return Ok(Parsed::from_rgba(0, 0, 0, 0.0).0);
    }
    let second_share = b / (a + b);
    let alpha = (a + b).min(1.0);
    let colours = [first.colour, second.colour];
    Ok(Unresolved::Mix(Arc::new(Mix { space, hue, colours, second: second_share, alpha })))
}

/// One of the colours of `color-mix()`, and the share that it is given.
struct MixPart {
    colour: Unresolved,
    share: Option<f32>,
}

/// The share may stand before the colour or after it.
fn mix_part(reading: &Reading, css: &mut Parser<'_>) -> Result<MixPart, Fault> {
    let share_before = css.try_parse(|css| share(reading, css)).ok();
    let colour = unresolved(reading, css)?;
    let share = share_before.or_else(|| css.try_parse(|css| share(reading, css)).ok());
    Ok(MixPart { colour, share })
}

fn share(reading: &Reading, css: &mut Parser<'_>) -> Result<f32, Fault> {
    match quantity(reading, css)? {
        Quantity::Length(Length { px: 0.0, em: 0.0, rem: 0.0, share, .. }) if (0.0..=1.0).contains(&share) => {
            Ok(share as f32)
        }
        _ => Err(Fault::unexpected_token()),
    }
}

fn space_of(name: &str) -> Option<ColorSpaceTag> {
    Some(match_ignore_ascii_case! { name,
        "srgb" => ColorSpaceTag::Srgb,
        "srgb-linear" => ColorSpaceTag::LinearSrgb,
        "display-p3" => ColorSpaceTag::DisplayP3,
        "a98-rgb" => ColorSpaceTag::A98Rgb,
        "prophoto-rgb" => ColorSpaceTag::ProphotoRgb,
        "rec2020" => ColorSpaceTag::Rec2020,
        "lab" => ColorSpaceTag::Lab,
        "lch" => ColorSpaceTag::Lch,
        "oklab" => ColorSpaceTag::Oklab,
        "oklch" => ColorSpaceTag::Oklch,
        "hsl" => ColorSpaceTag::Hsl,
        "hwb" => ColorSpaceTag::Hwb,
        "xyz" | "xyz-d65" => ColorSpaceTag::XyzD65,
        "xyz-d50" => ColorSpaceTag::XyzD50,
        _ => return None,
    })
}

fn has_hue(space: ColorSpaceTag) -> bool {
    matches!(space, ColorSpaceTag::Hsl | ColorSpaceTag::Hwb | ColorSpaceTag::Lch | ColorSpaceTag::Oklch)
}

/// Components of colour functions, in which `calc()` may stand.
struct Components<'a> {
    reading: &'a Reading,
    is_legacy: bool,
}

impl<'i> ColorParser<'i> for Components<'_> {
    type Output = Parsed;
    type Error = ();

    fn parse_angle_or_number(&self, css: &mut Parser<'_>) -> Result<AngleOrNumber, Fault> {
        match quantity(self.reading, css)? {
            Quantity::Number(value) => Ok(AngleOrNumber::Number { value: value as f32 }),
            Quantity::Angle(degrees) => Ok(AngleOrNumber::Angle { degrees: degrees as f32 }),
            Quantity::Length(_) => Err(Fault::unexpected_token()),
        }
    }

    fn parse_percentage(&self, css: &mut Parser<'_>) -> Result<f32, Fault> {
        match quantity(self.reading, css)? {
            Quantity::Length(Length { px: 0.0, em: 0.0, rem: 0.0, share, .. }) => Ok(share as f32),
            Quantity::Number(percent) if !self.is_legacy => Ok((percent / 100.0) as f32),
            _ => Err(Fault::unexpected_token()),
        }
    }

    fn parse_number(&self, css: &mut Parser<'_>) -> Result<f32, Fault> {
        super::value::number(self.reading, css).map(|v| v as f32)
    }

    fn parse_number_or_percentage(&self, css: &mut Parser<'_>) -> Result<NumberOrPercentage, Fault> {
        match quantity(self.reading, css)? {
            Quantity::Number(value) => Ok(NumberOrPercentage::Number { value: value as f32 }),
            Quantity::Length(Length { px: 0.0, em: 0.0, rem: 0.0, share, .. }) => {
                Ok(NumberOrPercentage::Percentage { unit_value: share as f32 })
            }
            _ => Err(Fault::unexpected_token()),
        }
    }
}

struct Parsed(Unresolved);

impl Parsed {
    /// A colour of four components, of which some may be missing (`none`).
    fn new(cs: ColorSpaceTag, components: [Option<f32>; 4]) -> Self {
        let mut missing = Missing::default();
        for (i, _) in components.iter().enumerate().filter(|(_, c)| c.is_none()) {
            missing.insert(i);
        }
        let components = components.map(Option::unwrap_or_default);
        Self(Unresolved::Known(DynamicColor { cs, flags: Flags::from_missing(missing), components }))
    }
}

/// A share as the crate of colours has it.
fn percent(share: Option<f32>) -> Option<f32> {
    share.map(|v| 100.0 * v)
}

impl FromParsedColor for Parsed {
    fn from_current_color() -> Self {
        Self(Unresolved::Current)
    }

    fn from_rgba(r: u8, g: u8, b: u8, alpha: f32) -> Self {
        let [r, g, b] = [r, g, b].map(|v| Some(f32::from(v) / 255.0));
        Self::new(ColorSpaceTag::Srgb, [r, g, b, Some(alpha)])
    }

    fn from_hsl(h: Option<f32>, s: Option<f32>, l: Option<f32>, alpha: Option<f32>) -> Self {
        Self::new(ColorSpaceTag::Hsl, [h, percent(s.map(|v| v.max(0.0))), percent(l), alpha])
    }

    fn from_hwb(h: Option<f32>, w: Option<f32>, b: Option<f32>, alpha: Option<f32>) -> Self {
        Self::new(ColorSpaceTag::Hwb, [h, percent(w), percent(b), alpha])
    }

    fn from_lab(l: Option<f32>, a: Option<f32>, b: Option<f32>, alpha: Option<f32>) -> Self {
        Self::new(ColorSpaceTag::Lab, [l.map(|l| l.clamp(0.0, 100.0)), a, b, alpha])
    }

    fn from_lch(l: Option<f32>, c: Option<f32>, h: Option<f32>, alpha: Option<f32>) -> Self {
        Self::new(ColorSpaceTag::Lch, [l.map(|l| l.clamp(0.0, 100.0)), c, h, alpha])
    }

    fn from_oklab(l: Option<f32>, a: Option<f32>, b: Option<f32>, alpha: Option<f32>) -> Self {
        Self::new(ColorSpaceTag::Oklab, [l.map(|l| l.clamp(0.0, 1.0)), a, b, alpha])
    }

    fn from_oklch(l: Option<f32>, c: Option<f32>, h: Option<f32>, alpha: Option<f32>) -> Self {
        Self::new(ColorSpaceTag::Oklch, [l.map(|l| l.clamp(0.0, 1.0)), c, h, alpha])
    }

    fn from_color_function(
        space: PredefinedColorSpace,
        c1: Option<f32>,
        c2: Option<f32>,
        c3: Option<f32>,
        alpha: Option<f32>,
    ) -> Self {
        let tag = match space {
            PredefinedColorSpace::Srgb => ColorSpaceTag::Srgb,
            PredefinedColorSpace::SrgbLinear => ColorSpaceTag::LinearSrgb,
            PredefinedColorSpace::DisplayP3 => ColorSpaceTag::DisplayP3,
            PredefinedColorSpace::A98Rgb => ColorSpaceTag::A98Rgb,
            PredefinedColorSpace::ProphotoRgb => ColorSpaceTag::ProphotoRgb,
            PredefinedColorSpace::Rec2020 => ColorSpaceTag::Rec2020,
            PredefinedColorSpace::XyzD50 => ColorSpaceTag::XyzD50,
            PredefinedColorSpace::XyzD65 => ColorSpaceTag::XyzD65,
            _ => ColorSpaceTag::Srgb,
        };
        Self::new(tag, [c1, c2, c3, alpha])
    }
}

/// An opacity, 0 to 1.
pub(crate) fn opacity(reading: &Reading, css: &mut Parser<'_>) -> Result<f64, Fault> {
    number_or_share(reading, css).map(|v| v.clamp(0.0, 1.0))
}

/// System colours (CSS Color 4, 6.2 and appendix A) as Chromium has them on a light page.
const SYSTEM: [(&str, [u8; 3]); 41] = [
    ("accentcolor", [0, 117, 255]),
    ("accentcolortext", [255, 255, 255]),
    ("activetext", [255, 0, 0]),
    ("buttonborder", [0, 0, 0]),
    ("buttonface", [239, 239, 239]),
    ("buttontext", [0, 0, 0]),
    ("canvas", [255, 255, 255]),
    ("canvastext", [0, 0, 0]),
    ("field", [255, 255, 255]),
    ("fieldtext", [0, 0, 0]),
    ("graytext", [128, 128, 128]),
    ("highlighttext", [255, 255, 255]),
    ("linktext", [0, 0, 238]),
    ("mark", [255, 255, 0]),
    ("marktext", [0, 0, 0]),
    ("selecteditem", [25, 103, 210]),
    ("selecteditemtext", [255, 255, 255]),
    ("visitedtext", [85, 26, 139]),
    ("activeborder", [0, 0, 0]),
    ("activecaption", [255, 255, 255]),
    ("appworkspace", [255, 255, 255]),
    ("background", [255, 255, 255]),
    ("buttonhighlight", [239, 239, 239]),
    ("buttonshadow", [239, 239, 239]),
    ("captiontext", [0, 0, 0]),
    ("inactiveborder", [0, 0, 0]),
    ("inactivecaption", [255, 255, 255]),
    ("inactivecaptiontext", [128, 128, 128]),
    ("infobackground", [255, 255, 255]),
    ("infotext", [0, 0, 0]),
    ("menu", [255, 255, 255]),
    ("menutext", [0, 0, 0]),
    ("scrollbar", [255, 255, 255]),
    ("threeddarkshadow", [0, 0, 0]),
    ("threedface", [239, 239, 239]),
    ("threedhighlight", [0, 0, 0]),
    ("threedlightshadow", [0, 0, 0]),
    ("threedshadow", [0, 0, 0]),
    ("window", [255, 255, 255]),
    ("windowframe", [0, 0, 0]),
    ("windowtext", [0, 0, 0]),
];
