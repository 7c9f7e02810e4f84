//! The few properties that decide whether an element is marked, with the cascade of CSS.

use std::str::FromStr;

use roxmltree::Node;
use simplecss::DeclarationTokenizer;
use svgtypes::{Paint, PaintFallback};

use super::style_sheet::{NAMES, Sheet, Work, declarations};
use crate::diag::Diag;

/// What an element itself says about the properties.
pub(super) struct Declared<'a>([Option<&'a str>; NAMES.len()]);

impl<'a> Declared<'a> {
    /// Attributes first, then the rules of the style sheet in their order, then the `style` attribute;
    /// important declarations win over all others.
    ///
    /// # Errors
    /// `svg-css` where the style sheet takes too much work.
    pub(super) fn new(node: Node<'a, '_>, sheet: &Sheet<'a>, work: &mut Work) -> Result<Self, Box<Diag>> {
        let mut values = NAMES.map(|name| node.attribute(name));
        let mut important = [false; NAMES.len()];
        let mut set = |d: &simplecss::Declaration<'a>| {
            if let Some(i) = NAMES.iter().position(|&n| n == d.name)
                && (d.important || !important[i])
            {
                values[i] = Some(d.value);
                important[i] = d.important;
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
        NAMES.iter().position(|&n| n == name).and_then(|i| self.0[i]).map(str::trim)
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
        self.get(name).and_then(|v| svgtypes::Length::from_str(v).ok()).is_some_and(|l| l.number <= 0.0)
    }
}

/// How an area or a line is painted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Coat {
    None,
    Color,
    /// By a pattern or gradient.
    Server,
}

/// Inherited properties.
#[derive(Clone, Copy, Debug)]
pub(super) struct Style {
    visible: bool,
    fill: Coat,
    stroke: Coat,
    /// Fill and stroke are not fully transparent, the stroke has a width.
    fill_shows: bool,
    stroke_shows: bool,
    has_width: bool,
    dashed: bool,
}

impl Style {
    /// What holds where nothing is said.
    pub(super) const INITIAL: Self = Self {
        visible: true,
        fill: Coat::Color,
        stroke: Coat::None,
        fill_shows: true,
        stroke_shows: true,
        has_width: true,
        dashed: false,
    };

    /// The style of an element that says `own`; `has_id` tells whether a paint server exists.
    pub(super) fn with(mut self, own: &Declared<'_>, has_id: impl Fn(&str) -> bool) -> Self {
        let said = |name: &str| own.get(name).filter(|&v| v != "inherit");
        if let Some(v) = said("visibility") {
            self.visible = v == "visible";
        }
        for (name, coat) in [("fill", &mut self.fill), ("stroke", &mut self.stroke)] {
            if let Some(v) = said(name)
                && let Some(c) = coat_of(v, &has_id)
            {
                *coat = c;
            }
        }
        for (name, shows) in [
            ("fill-opacity", &mut self.fill_shows),
            ("stroke-opacity", &mut self.stroke_shows),
            ("stroke-width", &mut self.has_width),
        ] {
            if said(name).is_some() {
                *shows = !own.is_zero(name);
            }
        }
        if let Some(v) = said("stroke-dasharray") {
            self.dashed = v != "none";
        }
        self
    }

    /// Whether a shape of this style can be seen.
    pub(super) fn is_seen(&self) -> bool {
        self.visible && (self.seen_fill() != Coat::None || self.seen_stroke() != Coat::None)
    }

    /// Whether a pattern or gradient is seen.
    pub(super) fn is_served(&self) -> bool {
        self.seen_fill() == Coat::Server || self.seen_stroke() == Coat::Server
    }

    /// Whether only dashes are seen of an outline.
    pub(super) fn is_dashed(&self) -> bool {
        self.dashed && self.seen_stroke() != Coat::None && self.seen_fill() == Coat::None
    }

    fn seen_fill(&self) -> Coat {
        if self.fill_shows { self.fill } else { Coat::None }
    }

    fn seen_stroke(&self) -> Coat {
        if self.stroke_shows && self.has_width { self.stroke } else { Coat::None }
    }
}

/// None where the value is not understood: it is as if it had not been said.
fn coat_of(value: &str, has_id: impl Fn(&str) -> bool) -> Option<Coat> {
    Some(match Paint::from_str(value).ok()? {
        Paint::Inherit => return None,
        Paint::None => Coat::None,
        Paint::Color(c) if c.alpha == 0 => Coat::None,
        Paint::Color(_) | Paint::CurrentColor | Paint::ContextFill | Paint::ContextStroke => Coat::Color,
        Paint::FuncIRI(id, _) if has_id(id) => Coat::Server,
        Paint::FuncIRI(_, None | Some(PaintFallback::None)) => Coat::None,
        Paint::FuncIRI(_, Some(_)) => Coat::Color,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn style(text: &str) -> Style {
        let doc = roxmltree::Document::parse(text).expect("xml");
        let root = doc.root_element();
        let css = root.children().find(|n| n.has_tag_name("style")).and_then(|n| n.text()).unwrap_or_default();
        let texts = [css.to_owned()];
        let sheet = Sheet::new(&texts).expect("a small sheet");
        let node = doc.descendants().find(|n| n.has_tag_name("path")).expect("path");
        let own = Declared::new(node, &sheet, &mut Work::default()).expect("little work");
        Style::INITIAL.with(&own, |id| id == "there")
    }

    #[test]
    fn the_cascade_goes_attribute_sheet_style_important() {
        for (text, seen) in [
            ("<s><path/></s>", true),
            ("<s><path fill='none'/></s>", false),
            ("<s><path fill='none' stroke='red'/></s>", true),
            ("<s><path fill='none' stroke='red' stroke-width='0'/></s>", false),
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
            assert_eq!(style(text).is_seen(), seen, "{text}");
        }
        assert!(style("<s><path fill='url(#there)'/></s>").is_served());
    }
}
