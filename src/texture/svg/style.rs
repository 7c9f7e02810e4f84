//! How shapes are painted: the computed styles of `svg_style` with links and opacities resolved.

use std::sync::Arc;

use svg_style::{Display, FillRule, LineCap, LineJoin, Link, Paint, Rgba, Style};

use super::walk::State;
use crate::texture::artwork::{Colour, Rule};

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
pub(super) fn rule(rule: FillRule) -> Rule {
    match rule {
        FillRule::NonZero => Rule::NonZero,
        FillRule::EvenOdd => Rule::EvenOdd,
    }
}

pub(super) fn cap(cap: LineCap) -> kurbo::Cap {
    match cap {
        LineCap::Butt => kurbo::Cap::Butt,
        LineCap::Round => kurbo::Cap::Round,
        LineCap::Square => kurbo::Cap::Square,
    }
}

/// None for those that are not drawn here.
pub(super) fn join(join: LineJoin) -> Option<kurbo::Join> {
    match join {
        LineJoin::Miter => Some(kurbo::Join::Miter),
        LineJoin::Round => Some(kurbo::Join::Round),
        LineJoin::Bevel => Some(kurbo::Join::Bevel),
        LineJoin::MiterClip | LineJoin::Arcs => None,
    }
}

impl State {
    /// How areas are painted.
    pub(super) fn fill(&self) -> Coat {
        self.coat(&self.style.fill, self.style.fill_opacity)
    }

    /// How lines are painted, their width aside.
    pub(super) fn stroke(&self) -> Coat {
        self.coat(&self.style.stroke, self.style.stroke_opacity)
    }

    /// Whether a shape can be seen.
    pub(super) fn is_seen(&self) -> bool {
        self.fill() != Coat::None || self.stroke() != Coat::None
    }

    /// What `context-fill` and `context-stroke` mean in what a use shows: its own paint without opacities.
    pub(super) fn context(&self) -> [Coat; 2] {
        [&self.style.fill, &self.style.stroke].map(|paint| self.seen_through(paint, 1.0))
    }

    fn coat(&self, paint: &Paint, opacity: f64) -> Coat {
        let opacity = (self.opacity * opacity) as f32;
        if !self.style.visible || opacity <= 0.0 { Coat::None } else { self.seen_through(paint, opacity) }
    }

    fn seen_through(&self, paint: &Paint, opacity: f32) -> Coat {
        let of_context = |k: usize| match self.context.as_ref().map(|context| &context[k]) {
            // Without a use nothing is painted (SVG 2, 13.2).
            None | Some(Coat::None) => Coat::None,
            Some(Coat::Colour(colour, alpha)) => Coat::Colour(*colour, alpha * opacity),
            Some(_) => Coat::Context,
        };
        match paint {
            Paint::None => Coat::None,
            Paint::Colour(colour) => painted(colour.resolved(self.style.current()), opacity),
            Paint::ContextFill => of_context(0),
            Paint::ContextStroke => of_context(1),
            Paint::Server(Link::Local(id), _) => Coat::Server(id.clone()),
            Paint::Server(Link::External, _) => Coat::External,
        }
    }

    /// What stands in for a paint server that is not there.
    pub(super) fn fallback(&self, is_fill: bool) -> Coat {
        let style = &self.style;
        let (paint, own) =
            if is_fill { (&style.fill, style.fill_opacity) } else { (&style.stroke, style.stroke_opacity) };
        match paint {
            Paint::Server(_, Some(colour)) => painted(colour.resolved(style.current()), (self.opacity * own) as f32),
            _ => Coat::None,
        }
    }
}

/// A colour seen through an opacity.
pub(super) fn painted(Rgba { rgb, alpha }: Rgba, opacity: f32) -> Coat {
    let opacity = opacity * alpha;
    if opacity > 0.0 { Coat::Colour(rgb, opacity) } else { Coat::None }
}
