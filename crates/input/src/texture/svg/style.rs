//! How shapes are painted: the computed styles of `svg_style` with links and opacities resolved.

use std::sync::Arc;

use svg_style::{Display, FillRule, Rgba, Style};

use crate::texture::artwork::{Colour, WindingRule};

/// How an area or a line is painted.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Coat {
    None,
    /// In a colour, with an opacity of 0 to 1 that is not 0.
    Colour(Colour, f32),
    /// By what has this id.
    Server(Arc<str>),
    /// By a server that a use refers to and what it shows is painted with.
    Context,
    /// By something in another file.
    External,
}

/// Whether neither an element nor what it holds is drawn.
pub(super) fn is_gone(style: &Style) -> bool {
    style.display == Display::None
}

/// The rule of an area.
pub(super) fn rule(rule: FillRule) -> WindingRule {
    match rule {
        FillRule::NonZero => WindingRule::NonZero,
        FillRule::EvenOdd => WindingRule::EvenOdd,
    }
}

/// A colour seen through an opacity.
pub(super) fn painted(Rgba { rgb, alpha }: Rgba, opacity: f32) -> Coat {
    let opacity = opacity * alpha;
    if opacity > 0.0 { Coat::Colour(rgb, opacity) } else { Coat::None }
}

/// What something is painted with.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ink {
    pub(super) colour: Colour,
    /// 0 to 1.
    pub(super) opacity: f32,
}

impl Ink {
    pub(super) const fn plain(colour: Colour) -> Self {
        Self { colour, opacity: 1.0 }
    }
}
