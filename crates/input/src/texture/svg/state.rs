//! What an element of a drawing has of those that hold it.

use std::sync::Arc;

use roxmltree::NodeId;
use svg_style::{Link, Map, Paint, Style};

use super::style::{Coat, painted};

/// What an element inherits.
#[derive(Clone)]
pub(super) struct State {
    /// From the element's units to page mm.
    pub(super) map: Map,
    pub(super) style: Arc<Style>,
    /// The style that the element inherits from.
    pub(super) parent: Arc<Style>,
    /// Of the element and all that hold it, 0 to 1.
    pub(super) opacity: f64,
    /// Size of the nearest viewport, which percentages refer to.
    pub(super) port: [f64; 2],
    /// Index of the area that it is cut at.
    pub(super) clip: Option<u32>,
    /// Index of its set of labels.
    pub(super) labels: u32,
    /// Factor of widths and dashes of strokes.
    pub(super) stretch: f64,
    pub(super) depth: usize,
    /// What the innermost use around it refers to.
    pub(super) copied: Option<NodeId>,
    /// How that use is painted: areas and lines.
    pub(super) context: Option<Arc<[Coat; 2]>>,
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
