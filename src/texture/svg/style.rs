//! The properties that decide what is seen of an element, with the cascade of CSS.

use std::str::FromStr;

use roxmltree::Node;
use simplecss::DeclarationTokenizer;
use svgtypes::{Color, Paint, PaintFallback};

use super::style_sheet::{NAMES, Sheet, Work, declarations};
use crate::diag::Diag;
use crate::texture::artwork::{Colour, Rule};

/// What an element itself says about the properties, each once.
pub(super) struct Declared<'a>(Vec<Value<'a>>);

/// A property of [`NAMES`].
struct Value<'a> {
    name: &'static str,
    text: &'a str,
    important: bool,
}

impl<'a> Declared<'a> {
    /// Attributes first, then the rules of the style sheet in their order, then the `style` attribute;
    /// important declarations win over all others.
    ///
    /// # Errors
    /// `svg-css` where the style sheet takes too much work.
    pub(super) fn new(node: Node<'a, '_>, sheet: &Sheet<'a>, work: &mut Work) -> Result<Self, Box<Diag>> {
        let known = |name: &str| NAMES.iter().copied().find(|&n| n == name);
        let attributes = node.attributes().filter(|a| a.namespace().is_none());
        let mut values: Vec<Value<'a>> = attributes
            .filter_map(|a| Some(Value { name: known(a.name())?, text: a.value(), important: false }))
            .collect();
        let mut set = |d: &simplecss::Declaration<'a>| {
            let Some(name) = known(d.name) else { return };
            match values.iter_mut().find(|v| v.name == name) {
                Some(v) if d.important || !v.important => (v.text, v.important) = (d.value, d.important),
                Some(_) => {}
                None => values.push(Value { name, text: d.value, important: d.important }),
            }
        };
        sheet.apply(node, work, &mut set)?;
        if let Some(style) = node.attribute("style") {
            work.spend(style.len())?;
            if style.contains("/*") {
                // This one knows comments, and takes the square of the length where terms are numbers.
                work.spend(style.len().saturating_mul(style.len()))?;
                DeclarationTokenizer::from(style).for_each(|d| set(&d));
            } else {
                declarations(style).for_each(|d| set(&d));
            }
        }
        Ok(Self(values))
    }

    /// The value of a property of [`NAMES`].
    pub(super) fn get(&self, name: &str) -> Option<&'a str> {
        self.0.iter().find(|v| v.name == name).map(|v| v.text.trim())
    }

    /// Whether it refers to something by one of the names.
    pub(super) fn has_any(&self, names: &[&str]) -> bool {
        names.iter().any(|n| self.get(n).is_some_and(|v| !matches!(v, "" | "none" | "inherit")))
    }

    /// Whether neither the element nor what it holds is drawn.
    pub(super) fn is_gone(&self) -> bool {
        self.get("display") == Some("none") || self.is_zero("opacity")
    }

    fn is_zero(&self, name: &str) -> bool {
        self.number(name).is_some_and(|v| v <= 0.0)
    }

    /// Whether an opacity lies between none and full.
    fn is_partial(&self, name: &str) -> bool {
        let whole = if self.get(name).is_some_and(|v| v.ends_with('%')) { 100.0 } else { 1.0 };
        self.number(name).is_some_and(|v| v > 0.0 && v < whole)
    }

    fn number(&self, name: &str) -> Option<f64> {
        Some(svgtypes::Length::from_str(self.get(name)?).ok()?.number)
    }
}

/// How an area or a line is painted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Coat<'a> {
    None,
    Colour(Colour),
    /// In the colour of the property `color`.
    Current,
    /// By the pattern or gradient of this id.
    Server(&'a str),
}

/// Shape of the ends of lines.
pub(super) type Cap = kurbo::Cap;
/// Shape of the corners of lines.
pub(super) type Join = kurbo::Join;

/// Inherited properties. Lengths are as written, for they may be shares of the viewport.
#[derive(Clone, Copy, Debug)]
pub(super) struct Style<'a> {
    visible: bool,
    fill: Coat<'a>,
    stroke: Coat<'a>,
    colour: Colour,
    /// Fill and stroke are not fully transparent.
    fill_shows: bool,
    stroke_shows: bool,
    /// Something is partly transparent.
    pub(super) is_translucent: bool,
    pub(super) rule: Rule,
    pub(super) clip_rule: Rule,
    pub(super) width: Option<&'a str>,
    pub(super) cap: Cap,
    /// None for those that are not drawn here.
    pub(super) join: Option<Join>,
    pub(super) miter: f64,
    pub(super) dashes: Option<&'a str>,
    pub(super) dash_offset: Option<&'a str>,
    pub(super) stroke_first: bool,
}

impl<'a> Style<'a> {
    /// What holds where nothing is said.
    pub(super) const INITIAL: Self = Self {
        visible: true,
        fill: Coat::Colour([0; 3]),
        stroke: Coat::None,
        colour: [0; 3],
        fill_shows: true,
        stroke_shows: true,
        is_translucent: false,
        rule: Rule::NonZero,
        clip_rule: Rule::NonZero,
        width: None,
        cap: Cap::Butt,
        join: Some(Join::Miter),
        miter: 4.0,
        dashes: None,
        dash_offset: None,
        stroke_first: false,
    };

    /// Whether lines are stroked.
    pub(super) fn has_stroke(&self) -> bool {
        self.stroke != Coat::None
    }

    /// The style of an element that says `own`; `has_id` tells whether a paint server exists.
    pub(super) fn with(mut self, own: &Declared<'a>, has_id: impl Fn(&str) -> bool) -> Self {
        let said = |name: &str| own.get(name).filter(|&v| v != "inherit");
        if let Some(v) = said("visibility") {
            self.visible = v == "visible";
        }
        if let Some(Ok(c)) = said("color").map(Color::from_str) {
            self.colour = [c.red, c.green, c.blue];
        }
        for (name, coat) in [("fill", &mut self.fill), ("stroke", &mut self.stroke)] {
            if let Some(v) = said(name)
                && let Some((c, is_translucent)) = coat_of(v, &has_id)
            {
                *coat = c;
                self.is_translucent |= is_translucent;
            }
        }
        for (name, shows) in [("fill-opacity", &mut self.fill_shows), ("stroke-opacity", &mut self.stroke_shows)] {
            if said(name).is_some() {
                *shows = !own.is_zero(name);
            }
        }
        self.is_translucent |= ["opacity", "fill-opacity", "stroke-opacity"].iter().any(|name| own.is_partial(name));
        for (name, rule) in [("fill-rule", &mut self.rule), ("clip-rule", &mut self.clip_rule)] {
            match said(name) {
                Some("evenodd") => *rule = Rule::EvenOdd,
                Some("nonzero") => *rule = Rule::NonZero,
                _ => {}
            }
        }
        self.stroked(said);
        self
    }

    /// The properties of strokes.
    fn stroked(&mut self, said: impl Fn(&str) -> Option<&'a str>) {
        self.width = said("stroke-width").or(self.width);
        self.dashes = said("stroke-dasharray").or(self.dashes);
        self.dash_offset = said("stroke-dashoffset").or(self.dash_offset);
        match said("stroke-linecap") {
            Some("butt") => self.cap = Cap::Butt,
            Some("round") => self.cap = Cap::Round,
            Some("square") => self.cap = Cap::Square,
            _ => {}
        }
        match said("stroke-linejoin") {
            Some("miter") => self.join = Some(Join::Miter),
            Some("round") => self.join = Some(Join::Round),
            Some("bevel") => self.join = Some(Join::Bevel),
            Some("miter-clip" | "arcs") => self.join = None,
            _ => {}
        }
        if let Some(v) = said("stroke-miterlimit").and_then(|v| v.parse().ok()).filter(|v: &f64| *v >= 1.0) {
            self.miter = v;
        }
        if let Some(v) = said("paint-order") {
            let place = |name: &str| v.split_whitespace().position(|w| w == name).unwrap_or(usize::MAX);
            self.stroke_first = place("stroke") < place("fill");
        }
    }

    /// Whether a shape of this style can be seen.
    pub(super) fn is_seen(&self) -> bool {
        self.fill() != Coat::None || self.stroke() != Coat::None
    }

    /// Whether it would be seen as part of a clip path.
    pub(super) fn is_visible(&self) -> bool {
        self.visible
    }

    /// How areas are painted.
    pub(super) fn fill(&self) -> Coat<'a> {
        self.coat(self.fill, self.fill_shows)
    }

    /// How lines are painted, their width aside.
    pub(super) fn stroke(&self) -> Coat<'a> {
        self.coat(self.stroke, self.stroke_shows)
    }

    fn coat(&self, coat: Coat<'a>, shows: bool) -> Coat<'a> {
        match coat {
            _ if !(self.visible && shows) => Coat::None,
            Coat::Current => Coat::Colour(self.colour),
            coat => coat,
        }
    }
}

/// How something is painted, and whether that is partly transparent; None where the value is not understood: it is as
/// if it had not been said.
fn coat_of<'a>(value: &'a str, has_id: impl Fn(&str) -> bool) -> Option<(Coat<'a>, bool)> {
    let of = |c: Color| match c.alpha {
        0 => (Coat::None, false),
        alpha => (Coat::Colour([c.red, c.green, c.blue]), alpha < 255),
    };
    Some(match Paint::from_str(value).ok()? {
        Paint::Inherit => return None,
        Paint::None => (Coat::None, false),
        Paint::Color(c) => of(c),
        Paint::CurrentColor | Paint::ContextFill | Paint::ContextStroke => (Coat::Current, false),
        Paint::FuncIRI(id, _) if has_id(id) => (Coat::Server(id), false),
        Paint::FuncIRI(_, None | Some(PaintFallback::None)) => (Coat::None, false),
        Paint::FuncIRI(_, Some(PaintFallback::CurrentColor)) => (Coat::Current, false),
        Paint::FuncIRI(_, Some(PaintFallback::Color(c))) => of(c),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(text: &str) -> bool {
        let doc = roxmltree::Document::parse(text).expect("xml");
        let root = doc.root_element();
        let css = root.children().find(|n| n.has_tag_name("style")).and_then(|n| n.text()).unwrap_or_default();
        let texts = [css.to_owned()];
        let sheet = Sheet::new(&texts).expect("a small sheet");
        let node = doc.descendants().find(|n| n.has_tag_name("path")).expect("path");
        let own = Declared::new(node, &sheet, &mut Work::default()).expect("little work");
        Style::INITIAL.with(&own, |id| id == "there").is_seen()
    }

    #[test]
    fn the_cascade_goes_attribute_sheet_style_important() {
        for (text, seen) in [
            ("<s><path/></s>", true),
            ("<s><path fill='none'/></s>", false),
            ("<s><path fill='none' stroke='red'/></s>", true),
            ("<s><style>path{fill:none}</style><path fill='red'/></s>", false),
            ("<s><style>path{fill:none}</style><path style='fill:red'/></s>", true),
            ("<s><style>path{fill:none!important}</style><path style='fill:red'/></s>", false),
            ("<s><style>path{fill:red}.a{fill:none}</style><path class='a b'/></s>", false),
            ("<s><path fill='url(#there)'/></s>", true),
            ("<s><path fill='url(#gone)'/></s>", false),
            ("<s><path fill='url(#gone) red'/></s>", true),
            ("<s><path fill='rgba(1,2,3,0)'/></s>", false),
            ("<s><path fill='nonsense'/></s>", true),
            ("<s><path visibility='hidden'/></s>", false),
        ] {
            assert_eq!(self::seen(text), seen, "{text}");
        }
    }
}
