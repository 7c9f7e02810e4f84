//! The properties that decide what is seen of an element, each with its grammar, and the style that they make up.
//!
//! `properties!` has one row per property. What other properties do is said by [`other`].

use std::sync::{Arc, LazyLock};

use cssparser::{Parser, Token};
use kurbo::{Cap, Join};
use rustc_hash::FxHashMap;

use super::colour::{Colour, colour, opacity};
use super::link::Link;
use super::transform::{self, Transform, TransformBox};
use super::value::{
    Fault, Length, Quantity, Reading, Source, inline_length, is_next, keyword, loose_length, not_negative, number,
    quantity,
};
use super::variables::Variables;

/// Paint of an area or a line.
#[derive(Clone, Debug, PartialEq)]
pub enum Paint {
    /// Not at all.
    None,
    /// In a colour.
    Colour(Colour),
    /// As the areas of the use that shows a copy (`context-fill`).
    ContextFill,
    /// As the lines of the use that shows a copy (`context-stroke`).
    ContextStroke,
    /// By the pattern or gradient of a link, or, where there is none, by a colour.
    Server(Link, Option<Colour>),
}

/// What a clip path, mask, filter or marker property refers to.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Reference {
    /// Nothing.
    #[default]
    None,
    /// An element.
    Link(Link),
    /// Functions or images.
    Other,
}

/// The points that the contours of an area enclose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FillRule {
    /// Those that the contours go round more often one way than the other.
    NonZero,
    /// Those that the contours go round an odd number of times.
    EvenOdd,
}

/// Whether an element is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Display {
    /// It is.
    Shown,
    /// Neither it nor what it holds.
    None,
    /// What it holds is drawn as if the element was not there.
    Contents,
}

/// The order in which a shape's fill, stroke and markers are painted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layer {
    /// The area.
    Fill,
    /// The line.
    Stroke,
    /// The markers.
    Markers,
}

/// What lies behind an element's box.
#[derive(Clone, Debug, PartialEq)]
pub enum Background {
    /// Nothing.
    None,
    /// A colour.
    Colour(Colour),
    /// Images, which are not read.
    Other,
}

/// A length; None where it follows from others (`auto`).
pub type Auto = Option<Length>;

macro_rules! inherits {
    (inherited) => {
        true
    };
    (own) => {
        false
    };
}

macro_rules! properties {
    ($($(#[$doc:meta])* $variant:ident $name:literal $flow:ident, $field:ident: $type:ty = $initial:expr, $parse:expr;)*) => {
        /// A property.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
        pub(crate) enum Property { $($variant),* }

        /// A valid value of a property.
        #[derive(Clone, Debug, PartialEq)]
        pub(crate) enum Value { $($variant($type)),* }

        /// The computed style of an element. Lengths are in CSS px (96 to the inch), or shares of what they refer to.
        #[derive(Clone, Debug)]
        pub struct Style {
            $($(#[$doc])* pub $field: $type,)*
            /// Whether it says nothing but what is inherited.
            pub(crate) is_plain: bool,
            /// Size of the root element's font, px, to which rem refers.
            pub root_font_px: f64,
            pub(crate) variables: Variables,
        }

        impl Property {
            pub(crate) const ALL: &'static [Self] = &[$(Self::$variant),*];

            pub(crate) fn name(self) -> &'static str {
                match self { $(Self::$variant => $name),* }
            }

            pub(crate) fn is_inherited(self) -> bool {
                match self { $(Self::$variant => inherits!($flow)),* }
            }

            /// Reads a value, which ends where the text does.
            pub(crate) fn parse(self, reading: &Reading, css: &mut Parser<'_>) -> Result<Value, Fault> {
                let value = match self { $(Self::$variant => Value::$variant($parse(reading, css)?)),* };
                css.expect_exhausted()?;
                Ok(value)
            }
        }

        impl Style {
            /// The initial value of every property.
            pub fn initial() -> Self {
                let (root_font_px, variables) = (FONT_PX, Variables::default());
                Self { $($field: $initial,)* is_plain: true, root_font_px, variables }
            }

            /// The style of a child that declares nothing: what is inherited, and initial values.
            pub fn child(&self) -> Self {
                Self {
                    $($field: if inherits!($flow) { self.$field.clone() } else { $initial },)*
                    is_plain: true,
                    root_font_px: self.root_font_px,
                    variables: self.variables.clone(),
                }
            }

            pub(crate) fn set(&mut self, value: &Value) {
                match value {
                    $(Value::$variant(v) => {
                        self.$field = v.clone();
                        self.is_plain &= inherits!($flow);
                    })*
                }
            }

            /// Takes a property from another style.
            pub(crate) fn take(&mut self, property: Property, from: &Self) {
                self.is_plain &= property.is_inherited();
                match property { $(Property::$variant => self.$field = from.$field.clone()),* }
            }
        }
    };
}

/// The size of the font where nothing is said, px.
pub(crate) const FONT_PX: f64 = 16.0;

properties! {
    /// Size of the font, px.
    FontSize "font-size" inherited, font_size: Length = Length::px(FONT_PX), font_size;
    /// The colour that `currentColor` refers to.
    Color "color" inherited, color: Colour = Colour::BLACK, colour;
    /// Whether the element and what it holds are drawn.
    Display "display" own, display: Display = Display::Shown, display;
    /// Whether a shape is seen.
    Visibility "visibility" inherited, visible: bool = true, |_, css|
        keyword(css, &[("visible", true), ("hidden", false), ("collapse", false)]);
    /// Opacity of the element as a whole, 0 to 1.
    Opacity "opacity" own, opacity: f64 = 1.0, opacity;
    /// Paint of areas.
    Fill "fill" inherited, fill: Paint = Paint::Colour(Colour::BLACK), paint;
    /// Opacity of areas, 0 to 1.
    FillOpacity "fill-opacity" inherited, fill_opacity: f64 = 1.0, opacity;
    /// The points that an area holds.
    FillRule "fill-rule" inherited, fill_rule: FillRule = FillRule::NonZero, fill_rule;
    /// The points that an area holds as part of a clip path.
    ClipRule "clip-rule" inherited, clip_rule: FillRule = FillRule::NonZero, fill_rule;
    /// Paint of lines.
    Stroke "stroke" inherited, stroke: Paint = Paint::None, paint;
    /// Opacity of lines, 0 to 1.
    StrokeOpacity "stroke-opacity" inherited, stroke_opacity: f64 = 1.0, opacity;
    /// Width of lines.
    StrokeWidth "stroke-width" inherited, stroke_width: Length = Length::px(1.0), |r, css|
        not_negative(loose_length(r, css)?);
    /// Lengths of dashes and gaps in turn; none for a full line.
    StrokeDasharray "stroke-dasharray" inherited, stroke_dasharray: Arc<[Length]> = Arc::default(), dashes;
    /// Where in the dashes a line begins.
    StrokeDashoffset "stroke-dashoffset" inherited, stroke_dashoffset: Length = Length::px(0.0), loose_length;
    /// Ends of lines.
    StrokeLinecap "stroke-linecap" inherited, stroke_linecap: Cap = Cap::Butt, |_, css|
        keyword(css, &[("butt", Cap::Butt), ("round", Cap::Round), ("square", Cap::Square)]);
    /// Corners of lines; None for `miter-clip` and `arcs`, which few programs draw.
    StrokeLinejoin "stroke-linejoin" inherited, stroke_linejoin: Option<Join> = Some(Join::Miter), line_join;
    /// Longest sharp corner, in widths of the line.
    StrokeMiterlimit "stroke-miterlimit" inherited, stroke_miterlimit: f64 = 4.0, miter_limit;
    /// Whether lines have no width at any zoom (Inkscape).
    Hairline "-inkscape-stroke" inherited, hairline: bool = false, |_, css|
        keyword(css, &[("hairline", true), ("none", false)]);
    /// What is painted first, second and third.
    PaintOrder "paint-order" inherited, paint_order: [Layer; 3] = [Layer::Fill, Layer::Stroke, Layer::Markers],
        paint_order;
    /// Marker at the start of a line.
    MarkerStart "marker-start" inherited, marker_start: Reference = Reference::None, reference;
    /// Marker at the corners of a line.
    MarkerMid "marker-mid" inherited, marker_mid: Reference = Reference::None, reference;
    /// Marker at the end of a line.
    MarkerEnd "marker-end" inherited, marker_end: Reference = Reference::None, reference;
    /// Whether lines have the width that they have on the screen, whatever the transforms.
    VectorEffect "vector-effect" own, non_scaling_stroke: bool = false, |_, css|
        keyword(css, &[("none", false), ("non-scaling-stroke", true)]);
    /// The area outside which nothing is seen.
    ClipPath "clip-path" own, clip_path: Reference = Reference::None, reference;
    /// The drawing whose brightness or opacity shows the element.
    Mask "mask" own, mask: Reference = Reference::None, reference;
    /// Whether the opacity of a mask counts, not its brightness.
    MaskType "mask-type" own, is_alpha_mask: bool = false, |_, css|
        keyword(css, &[("luminance", false), ("alpha", true)]);
    /// Effects on pixels.
    Filter "filter" own, filter: Reference = Reference::None, reference;
    /// Whether its colours are mixed with those below, by a blend mode.
    MixBlendMode "mix-blend-mode" own, is_blended: bool = false, |_, css| keyword(css, &BLEND_MODES);
    /// Whether what leaves a viewport is seen; None where nothing is said.
    Overflow "overflow" own, overflows: Option<bool> = None, overflow;
    /// Colour of a gradient's stop.
    StopColor "stop-color" own, stop_color: Colour = Colour::BLACK, colour;
    /// Opacity of a gradient's stop, 0 to 1.
    StopOpacity "stop-opacity" own, stop_opacity: f64 = 1.0, opacity;
    /// What lies behind the outermost element.
    Background "background-color" own, background: Background = Background::None, background;
    /// The first, outermost transform.
    Translate "translate" own, translate: Transform = Transform::default(), transform::translate;
    /// The second transform.
    Rotate "rotate" own, rotate: Transform = Transform::default(), transform::rotate;
    /// The third transform.
    Scale "scale" own, scale: Transform = Transform::default(), transform::scale;
    /// The last, innermost transform.
    Transform "transform" own, transform: Transform = Transform::default(), transform::transform;
    /// The point that scales and turns leave where it is, from the corner of the reference box.
    TransformOrigin "transform-origin" own, transform_origin: [Length; 2] = [Length::px(0.0); 2], transform::origin;
    /// The reference box, whose sides percentages of the origin and of shifts refer to.
    TransformBox "transform-box" own, transform_box: TransformBox = TransformBox::View, transform::reference_box;
    /// Left side, or shift to the right.
    X "x" own, x: Length = Length::px(0.0), loose_length;
    /// Upper side, or shift downwards.
    Y "y" own, y: Length = Length::px(0.0), loose_length;
    /// Width; None where it follows from the element.
    Width "width" own, width: Auto = None, size;
    /// Height; None where it follows from the element.
    Height "height" own, height: Auto = None, size;
    /// Centre along x.
    Cx "cx" own, cx: Length = Length::px(0.0), loose_length;
    /// Centre along y.
    Cy "cy" own, cy: Length = Length::px(0.0), loose_length;
    /// Radius of a circle.
    R "r" own, r: Length = Length::px(0.0), |r, css| not_negative(loose_length(r, css)?);
    /// Radius along x; None where it equals the other.
    Rx "rx" own, rx: Auto = None, radius;
    /// Radius along y; None where it equals the other.
    Ry "ry" own, ry: Auto = None, radius;
    /// Path data that replaces the attribute, empty for `none`; None where nothing is said.
    D "d" own, d: Option<Arc<str>> = None, path_data;
}

impl Style {
    /// Lengths in px, now that the size of the font is known.
    pub(crate) fn compute_lengths(&mut self) {
        let font = self.font_size.px;
        let root = self.root_font_px;
        for length in [&mut self.stroke_width, &mut self.stroke_dashoffset, &mut self.x, &mut self.y] {
            length.compute(font, root);
        }
        for length in [&mut self.cx, &mut self.cy, &mut self.r] {
            length.compute(font, root);
        }
        for length in [&mut self.width, &mut self.height, &mut self.rx, &mut self.ry].into_iter().flatten() {
            length.compute(font, root);
        }
        self.transform_origin.iter_mut().for_each(|l| l.compute(font, root));
        if self.stroke_dasharray.iter().any(|l| l.em != 0.0 || l.rem != 0.0) {
            Arc::make_mut(&mut self.stroke_dasharray).iter_mut().for_each(|l| l.compute(font, root));
        }
        self.translate.compute(font, root);
        self.transform.compute(font, root);
    }

    /// Whether a length of a shape or its stroke has a unit that depends on the face of the font.
    pub fn needs_font(&self) -> bool {
        let all = [self.stroke_width, self.stroke_dashoffset, self.x, self.y, self.cx, self.cy, self.r];
        let open = [self.width, self.height, self.rx, self.ry];
        let dashes = self.stroke_dasharray.iter().copied();
        all.into_iter().chain(open.into_iter().flatten()).chain(dashes).any(|l| l.needs_font)
    }

    /// Whether its strokes are lines without a width at any zoom: hairlines of Inkscape, or strokes that do not scale
    /// of one pixel or less.
    pub fn is_hairline(&self) -> bool {
        let width = self.stroke_width;
        let is_pixel = width.share == 0.0 && !width.is_physical && width.px > 0.0 && width.px <= 1.0;
        self.hairline || (self.non_scaling_stroke && is_pixel)
    }

    /// What the property `color` is.
    pub fn current(&self) -> super::Rgba {
        self.color.resolved(super::Rgba::BLACK)
    }
}

impl Property {
    /// The property of a name in lower case.
    pub(crate) fn of(name: &str) -> Option<Self> {
        static BY_NAME: LazyLock<FxHashMap<&str, Property>> =
            LazyLock::new(|| Property::ALL.iter().map(|p| (p.name(), *p)).collect());
        let name = name.strip_prefix("-webkit-").filter(|n| PREFIXED.contains(n)).unwrap_or(name);
        BY_NAME.get(name).copied()
    }

    /// Whether the property has an attribute of the same name on an element (SVG 2, 6.6).
    pub(crate) fn is_attribute(self, tag: &str) -> bool {
        match self {
            Self::X | Self::Y | Self::Width | Self::Height => {
                matches!(tag, "svg" | "rect" | "image" | "foreignObject" | "use")
            }
            Self::Cx | Self::Cy => matches!(tag, "circle" | "ellipse"),
            Self::R => tag == "circle",
            Self::Rx | Self::Ry => matches!(tag, "rect" | "ellipse"),
            Self::Transform => !matches!(tag, "pattern" | "linearGradient" | "radialGradient"),
            // Path data has a grammar of its own, and is read where it is drawn.
            Self::D | Self::MixBlendMode | Self::TransformBox | Self::Hairline => false,
            Self::Translate | Self::Rotate | Self::Scale | Self::Background => false,
            _ => true,
        }
    }
}

/// Properties that have a second name with the prefix of WebKit.
const PREFIXED: [&str; 7] =
    ["transform", "transform-origin", "clip-path", "mask", "filter", "opacity", "transform-box"];

/// What a property that is not among [`Property`] does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Other {
    /// Nothing to what is drawn.
    Harmless,
    /// It may move, hide or paint, unless its value is made of [`NOTHING`].
    Visible,
    /// Browsers do not know it.
    Unheard,
}

/// Values by which properties change nothing.
pub(crate) const NOTHING: &[&str] =
    &["none", "auto", "normal", "initial", "unset", "revert", "revert-layer", "0", "0s", "1"];

/// Words by which an animation does not end, or leaves what it made.
pub(crate) const LASTING: &[&str] = &["infinite", "forwards", "both", "paused"];

/// Properties that can change what is seen of shapes and are not read, and those that begin so.
const VISIBLE: [&str; 18] = [
    "animation",
    "animation-iteration-count",
    "animation-fill-mode",
    "animation-play-state",
    "offset",
    "offset-path",
    "offset-position",
    "perspective",
    "zoom",
    "content-visibility",
    "mask-image",
    "-webkit-mask-image",
    "mask-border",
    "clip",
    "overflow-x",
    "overflow-y",
    "outline",
    "outline-style",
];

/// Beginnings of the names of properties that change nothing of shapes.
const HARMLESS: [&str; 98] = [
    "-inkscape-",
    "-webkit-",
    "-moz-",
    "-ms-",
    "-o-",
    "-adobe-",
    "-sodipodi-",
    "accent-color",
    "align",
    "alignment-",
    "animation-",
    "appearance",
    "aspect-ratio",
    "backface-visibility",
    "background",
    "baseline-",
    "block-",
    "border-",
    "bottom",
    "box-",
    "break-",
    "buffered-rendering",
    "caret",
    "clear",
    "color-",
    "column",
    "contain",
    "content",
    "counter-",
    "cursor",
    "direction",
    "dominant-baseline",
    "enable-background",
    "flex",
    "float",
    "flood-",
    "font",
    "forced-color-adjust",
    "gap",
    "glyph-orientation",
    "grid",
    "hanging-",
    "hyphen",
    "image-",
    "inline-",
    "inset",
    "isolation",
    "justify-",
    "kerning",
    "left",
    "letter-spacing",
    "lighting-color",
    "line-",
    "list-",
    "margin",
    "mask-",
    "math-",
    "max-",
    "min-",
    "object-",
    "offset-",
    "order",
    "orphans",
    "outline-",
    "overflow-",
    "overscroll-",
    "padding",
    "page",
    "perspective-",
    "place-",
    "pointer-events",
    "position",
    "print-",
    "quotes",
    "resize",
    "right",
    "row-gap",
    "ruby-",
    "scroll",
    "shape-",
    "solid-",
    "speak",
    "tab-size",
    "table-",
    "text",
    "top",
    "touch-action",
    "transform-style",
    "transition",
    "unicode-bidi",
    "user-select",
    "vertical-align",
    "view-",
    "white-space",
    "widows",
    "will-change",
    "word-",
    "writing-mode",
];

/// What a property of another name does.
pub(crate) fn other(name: &str) -> Other {
    if VISIBLE.contains(&name) {
        Other::Visible
    } else if HARMLESS.iter().any(|begin| name.starts_with(begin)) || name == "z-index" {
        Other::Harmless
    } else {
        Other::Unheard
    }
}

const BLEND_MODES: [(&str, bool); 18] = [
    ("normal", false),
    ("multiply", true),
    ("screen", true),
    ("overlay", true),
    ("darken", true),
    ("lighten", true),
    ("color-dodge", true),
    ("color-burn", true),
    ("hard-light", true),
    ("soft-light", true),
    ("difference", true),
    ("exclusion", true),
    ("hue", true),
    ("saturation", true),
    ("color", true),
    ("luminosity", true),
    ("plus-lighter", true),
    ("plus-darker", true),
];

/// Words of `display` by which an element is drawn.
const SHOWN: [&str; 28] = [
    "inline",
    "block",
    "inline-block",
    "flex",
    "inline-flex",
    "grid",
    "inline-grid",
    "table",
    "inline-table",
    "table-row-group",
    "table-header-group",
    "table-footer-group",
    "table-row",
    "table-cell",
    "table-column-group",
    "table-column",
    "table-caption",
    "list-item",
    "flow-root",
    "flow",
    "ruby",
    "run-in",
    "math",
    "compact",
    "marker",
    "-webkit-box",
    "-webkit-flex",
    "-webkit-inline-box",
];

fn display(_: &Reading, css: &mut Parser<'_>) -> Result<Display, Fault> {
    if is_next(css, "none") {
        return Ok(Display::None);
    }
    if is_next(css, "contents") {
        return Ok(Display::Contents);
    }
    keyword(css, &SHOWN.map(|word| (word, ())))?;
    while css.try_parse(|css| keyword(css, &SHOWN.map(|word| (word, ())))).is_ok() {}
    Ok(Display::Shown)
}

fn fill_rule(_: &Reading, css: &mut Parser<'_>) -> Result<FillRule, Fault> {
    keyword(css, &[("nonzero", FillRule::NonZero), ("evenodd", FillRule::EvenOdd)])
}

fn line_join(_: &Reading, css: &mut Parser<'_>) -> Result<Option<Join>, Fault> {
    let words = [
        ("miter", Some(Join::Miter)),
        ("round", Some(Join::Round)),
        ("bevel", Some(Join::Bevel)),
        ("miter-clip", None),
        ("arcs", None),
    ];
    keyword(css, &words)
}

fn miter_limit(reading: &Reading, css: &mut Parser<'_>) -> Result<f64, Fault> {
    number(reading, css).and_then(|v| if v >= 0.0 { Ok(v) } else { Err(Fault::unexpected_token()) })
}

fn paint(reading: &Reading, css: &mut Parser<'_>) -> Result<Paint, Fault> {
    if is_next(css, "none") {
        return Ok(Paint::None);
    }
    if is_next(css, "context-fill") {
        return Ok(Paint::ContextFill);
    }
    if is_next(css, "context-stroke") {
        return Ok(Paint::ContextStroke);
    }
    if let Ok(link) = css.try_parse(link) {
        if css.is_exhausted() || is_next(css, "none") {
            return Ok(Paint::Server(link, None));
        }
        return Ok(Paint::Server(link, Some(colour(reading, css)?)));
    }
    let colour = colour(reading, css)?;
    // A colour of print beside the one of the screen (SVG 1.1, 11.2).
    if let Ok(name) = css.try_parse(|css| css.expect_function().cloned()) {
        if !matches!(&*name.to_ascii_lowercase(), "icc-color" | "device-cmyk" | "device-gray" | "device-rgb") {
            return Err(Fault::unexpected_token());
        }
        css.parse_nested_block(|css| {
            while css.next().is_ok() {}
            Ok::<_, Fault>(())
        })?;
    }
    Ok(Paint::Colour(colour))
}

/// The text of `url()`.
fn link(css: &mut Parser<'_>) -> Result<Link, Fault> {
    Ok(Link::new(&css.expect_url()?))
}

/// A link, or none, or functions; of several the first counts that is not the only one.
fn reference(_: &Reading, css: &mut Parser<'_>) -> Result<Reference, Fault> {
    if is_next(css, "none") {
        return Ok(Reference::None);
    }
    if let Ok(link) = css.try_parse(link)
        && css.is_exhausted()
    {
        return Ok(Reference::Link(link));
    }
    let mut is_function = false;
    while let Ok(token) = css.next() {
        match token {
            Token::Function(_) | Token::UnquotedUrl(_) => is_function = true,
            Token::Ident(_) | Token::Comma | Token::Percentage { .. } | Token::Dimension { .. } | Token::Delim('/') => {
            }
            Token::Number { .. } => {}
            _ => return Err(Fault::unexpected_token()),
        }
    }
    // A box alone cuts at the box of the element.
    let _ = is_function;
    Ok(Reference::Other)
}

fn dashes(reading: &Reading, css: &mut Parser<'_>) -> Result<Arc<[Length]>, Fault> {
    if is_next(css, "none") {
        return Ok(Arc::default());
    }
    let mut dashes = Vec::new();
    loop {
        dashes.push(not_negative(loose_length(reading, css)?)?);
        let has_comma = css.try_parse(Parser::expect_comma).is_ok();
        if css.is_exhausted() {
            return if has_comma { Err(Fault::unexpected_token()) } else { Ok(dashes.into()) };
        }
    }
}

fn paint_order(_: &Reading, css: &mut Parser<'_>) -> Result<[Layer; 3], Fault> {
    let words = [("fill", Layer::Fill), ("stroke", Layer::Stroke), ("markers", Layer::Markers)];
    let mut order = Vec::new();
    if !is_next(css, "normal") {
        while !css.is_exhausted() {
            let next = keyword(css, &words)?;
            if order.contains(&next) {
                return Err(Fault::unexpected_token());
            }
            order.push(next);
        }
    }
    // What is not said comes after, in its usual order.
    let rest: Vec<Layer> = words.iter().map(|(_, layer)| *layer).filter(|layer| !order.contains(layer)).collect();
    order.extend(rest);
    order.try_into().map_err(|_| Fault::unexpected_token())
}

fn overflow(_: &Reading, css: &mut Parser<'_>) -> Result<Option<bool>, Fault> {
    let words = [("visible", true), ("auto", true), ("hidden", false), ("scroll", false), ("clip", false)];
    let first = keyword(css, &words)?;
    let second = css.try_parse(|css| keyword(css, &words)).unwrap_or(first);
    Ok(Some(first && second))
}

fn background(reading: &Reading, css: &mut Parser<'_>) -> Result<Background, Fault> {
    if is_next(css, "none") || is_next(css, "transparent") {
        return Ok(Background::None);
    }
    let colour = css.try_parse(|css| {
        let colour = colour(reading, css)?;
        css.expect_exhausted()?;
        Ok::<_, Fault>(Background::Colour(colour))
    });
    colour.or_else(|_| {
        while css.next().is_ok() {}
        Ok(Background::Other)
    })
}

fn size(reading: &Reading, css: &mut Parser<'_>) -> Result<Auto, Fault> {
    let words = ["auto", "min-content", "max-content", "fit-content", "-webkit-fill-available", "stretch"];
    if css.try_parse(|css| keyword(css, &words.map(|w| (w, ())))).is_ok() {
        return Ok(None);
    }
    not_negative(inline_length(reading, css)?).map(Some)
}

fn radius(reading: &Reading, css: &mut Parser<'_>) -> Result<Auto, Fault> {
    if reading.source == Source::Attribute {
        // A length that is negative is not valid; what is not a length at all is 0, as browsers have it.
        let length = css.try_parse(|css| loose_length(reading, css)).unwrap_or_default();
        while css.next().is_ok() {}
        return not_negative(length).map(Some);
    }
    if is_next(css, "auto") { Ok(None) } else { not_negative(loose_length(reading, css)?).map(Some) }
}

fn path_data(reading: &Reading, css: &mut Parser<'_>) -> Result<Option<Arc<str>>, Fault> {
    if is_next(css, "none") {
        return Ok(Some("".into()));
    }
    let name = css.expect_function()?.to_ascii_lowercase();
    match name.as_str() {
        "path" => css.parse_nested_block(|css| {
            let text: Arc<str> = css.expect_string()?.as_ref().into();
            // Browsers refuse faulty data here, which they draw up to its fault in the attribute.
            let is_faultless = svgtypes::PathParser::from(&*text).all(|segment| segment.is_ok());
            if is_faultless { Ok(Some(text)) } else { Err(Fault::unexpected_token()) }
        }),
        "shape" => Err(reading.unknown("shape()")),
        _ => Err(Fault::unexpected_token()),
    }
}

/// Sizes of fonts by name, px (CSS Fonts 4, 2.5).
const FONT_SIZES: [(&str, f64); 8] = [
    ("xx-small", 9.0),
    ("x-small", 10.0),
    ("small", 13.0),
    ("medium", 16.0),
    ("large", 18.0),
    ("x-large", 24.0),
    ("xx-large", 32.0),
    ("xxx-large", 48.0),
];

/// Percentages are of the parent's font.
fn font_size(reading: &Reading, css: &mut Parser<'_>) -> Result<Length, Fault> {
    if let Ok(px) = css.try_parse(|css| keyword(css, &FONT_SIZES)) {
        return Ok(Length::px(px));
    }
    if let Ok(em) = css.try_parse(|css| keyword(css, &[("larger", 1.2), ("smaller", 1.0 / 1.2)])) {
        return Ok(Length { em, ..Length::px(0.0) });
    }
    let mut size = not_negative(inline_length(reading, css)?)?;
    (size.em, size.share) = (size.em + size.share, 0.0);
    Ok(size)
}

/// The size of the font in the value of `font`: the first length.
pub(crate) fn size_in_font(reading: &Reading, css: &mut Parser<'_>) -> Option<Length> {
    loop {
        let before = css.state();
        // Weights are numbers.
        if let Ok(Quantity::Number(_)) = css.try_parse(|css| quantity(reading, css)) {
            continue;
        }
        css.reset(&before);
        let css_reading = Reading::new(Source::Css);
        if let Ok(size) = css.try_parse(|css| font_size(&css_reading, css)) {
            return Some(size);
        }
        css.next().ok()?;
    }
}
